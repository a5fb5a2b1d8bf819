//! Warping functions: time as a function of phase, for a demonstration or for a movement with given segment durations.
//!
//! Breaks 0 = p_0 < … < p_K = 1 divide the phase axis of a movement into segments of durations T_k (K,) in seconds. Time
//! is a cubic in each segment. At the breaks it is t_k = Σ T_i, i < k, with slopes from the chords δ_k = T_k/(p_{k+1} − p_k):
//!
//! ```text
//! 2/ṫ_k = 1/δ_{k−1} + 1/δ_k,   ẗ = 0 at both ends of a discrete movement;   the ends of a cycle are one break
//! ```
//!
//! No slope exceeds twice an adjacent chord, so that time increases strictly for all positive durations: its slope is at
//! least a quarter of the smallest among the chord and the two end slopes of the segment. For equal chords time is linear
//! up to rounding.
//!
//! - F. N. Fritsch, R. E. Carlson, Monotone piecewise cubic interpolation, SIAM Journal on Numerical Analysis 17, 1980,
//!   doi:10.1137/0717021;
//! - J. Butland, A method of interpolating reasonable-shaped curves through any data, Computer Graphics 80, 1980 (the
//!   harmonic mean).

use crate::kind::Kind;

/// Time as a monotone function of phase, and its inverse.
#[derive(Clone, Debug)]
pub(crate) struct WarpingFunction {
    kind: Kind,
    /// Phases of the breaks (K+1,).
    breaks: Vec<f64>,
    /// Times at the breaks (K+1,), in seconds.
    times: Vec<f64>,
    /// Seconds per unit of phase at the breaks (K+1,).
    slopes: Vec<f64>,
}

impl WarpingFunction {
    /// Returns the warping function through the breaks.
    ///
    /// The caller ensures that breaks (K+1,) increase from 0 to 1 and that the durations (K,) are positive.
    pub(crate) fn new(kind: Kind, breaks: &[f64], segment_durations: &[f64]) -> Self {
        let n = segment_durations.len();
        let mut times = vec![0.0; n + 1];
        for (k, seconds) in segment_durations.iter().enumerate() {
            times[k + 1] = times[k] + seconds;
        }
        let chords: Vec<f64> = (0..n).map(|k| segment_durations[k] / (breaks[k + 1] - breaks[k])).collect();
        let harmonic_mean = |left: f64, right: f64| 2.0 / (1.0 / left + 1.0 / right);
        let mut slopes = vec![chords[0]; n + 1];
        for k in 1..n {
            slopes[k] = harmonic_mean(chords[k - 1], chords[k]);
        }
        let ends = match kind {
            Kind::Rhythmic => [harmonic_mean(chords[n - 1], chords[0]); 2],
            Kind::Discrete if n == 1 => [chords[0]; 2],
            Kind::Discrete => [(0, 1), (n - 1, n - 1)].map(|(k, next)| (3.0 * chords[k] - slopes[next]) / 2.0),
        };
        [slopes[0], slopes[n]] = ends;
        Self { kind, breaks: breaks.to_vec(), times, slopes }
    }

    /// Returns the duration in seconds.
    pub(crate) fn duration(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    /// Returns the elapsed fraction of the duration at a phase in [0, 1]; exact at the breaks.
    pub(crate) fn share(&self, phase: f64) -> f64 {
        if phase >= 1.0 {
            return 1.0;
        }
        let k = segment_index(&self.breaks, phase);
        let segment = self.segment(k);
        (self.times[k] + segment.rise * segment.at((phase - self.breaks[k]) / segment.run)[0]) / self.duration()
    }

    /// Returns dt/dp in seconds per unit of phase at a phase p ≥ 0. It is constant past the end of a discrete movement and
    /// periodic for a rhythmic one.
    pub(crate) fn slope(&self, phase: f64) -> f64 {
        let phase = match self.kind {
            Kind::Discrete => phase.min(1.0),
            Kind::Rhythmic => phase.fract(),
        };
        let k = segment_index(&self.breaks, phase);
        let segment = self.segment(k);
        segment.chord() * segment.at((phase - self.breaks[k]) / segment.run)[1]
    }

    /// Returns phase p, ṗ and p̈ at a time t ≥ 0 in seconds. The phase of a discrete movement continues at constant rate
    /// past the end; that of a rhythmic one increases by 1 per cycle.
    pub(crate) fn phase(&self, time: f64) -> [f64; 3] {
        let duration = self.duration();
        let (cycles, time) = match self.kind {
            Kind::Discrete if time >= duration => {
                let rate = 1.0 / self.slopes[self.slopes.len() - 1];
                return [1.0 + (time - duration) * rate, rate, 0.0];
            }
            Kind::Discrete => (0.0, time),
            Kind::Rhythmic => {
                // The cycles follow from the remainder: the rounded quotient time/duration may belong to the next cycle.
                let remainder = time.rem_euclid(duration);
                (((time - remainder) / duration).round(), remainder)
            }
        };
        let k = segment_index(&self.times, time);
        let segment = self.segment(k);
        let r = segment.inverse((time - self.times[k]) / segment.rise);
        let [_, slope, curvature] = segment.at(r);
        let rate = 1.0 / (segment.chord() * slope);
        // p̈ = −t″/t′³.
        [cycles + self.breaks[k] + r * segment.run, rate, -segment.chord() / segment.run * curvature * rate.powi(3)]
    }

    fn segment(&self, k: usize) -> Segment {
        let (run, rise) = (self.breaks[k + 1] - self.breaks[k], self.times[k + 1] - self.times[k]);
        let chord = rise / run;
        Segment { run, rise, start_slope: self.slopes[k] / chord, end_slope: self.slopes[k + 1] / chord }
    }
}

/// Returns the index of the segment that contains `x`, the first or last one for `x` outside of the knots.
fn segment_index(knots: &[f64], x: f64) -> usize {
    knots.partition_point(|&knot| knot <= x).clamp(1, knots.len() - 1) - 1
}

/// Segment of a warping function, with its end slopes relative to the chord.
struct Segment {
    run: f64,
    rise: f64,
    start_slope: f64,
    end_slope: f64,
}

impl Segment {
    fn chord(&self) -> f64 {
        self.rise / self.run
    }

    /// Returns the fraction s of the rise at the fraction `r` of the run, with s′ and s″.
    fn at(&self, r: f64) -> [f64; 3] {
        let Self { start_slope, end_slope, .. } = *self;
        let (square, cube) = (3.0 - 2.0 * start_slope - end_slope, start_slope + end_slope - 2.0);
        [
            r * (start_slope + r * (square + r * cube)),
            start_slope + r * (2.0 * square + 3.0 * r * cube),
            2.0 * square + 6.0 * r * cube,
        ]
    }

    /// Returns the fraction of the run at the fraction `s` of the rise, by Newton's method safeguarded by bisection.
    fn inverse(&self, s: f64) -> f64 {
        let (mut low, mut high, mut r) = (0.0, 1.0, s.clamp(0.0, 1.0));
        // Bisection alone reaches the resolution of f64 in 60 iterations.
        for _ in 0..60 {
            let [value, slope, _] = self.at(r);
            if value < s {
                low = r;
            } else {
                high = r;
            }
            let newton = r - (value - s) / slope;
            let next = if low <= newton && newton <= high { newton } else { (low + high) / 2.0 };
            if (next - r).abs() <= f64::EPSILON * r {
                return next;
            }
            r = next;
        }
        r
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Breaks and durations of up to eleven segments, which differ by up to a factor of e⁶.
    fn segments() -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
        prop::collection::vec((-3.0..3.0, -3.0..3.0), 1..12).prop_map(|logarithms: Vec<(f64, f64)>| {
            let [runs, segment_durations]: [Vec<f64>; 2] =
                [logarithms.iter().map(|(p, _)| p.exp()).collect(), logarithms.iter().map(|(_, t)| t.exp()).collect()];
            let total: f64 = runs.iter().sum();
            let mut breaks: Vec<f64> = runs
                .iter()
                .scan(0.0, |p, run| {
                    let here = *p;
                    *p += run / total;
                    Some(here)
                })
                .collect();
            breaks.push(1.0);
            (breaks, segment_durations)
        })
    }

    proptest! {
        /// Time increases with a continuous slope, and the phase as a function of time is its inverse.
        #[test]
        fn time_is_monotone_and_smooth_and_phase_is_its_inverse(
            (breaks, segment_durations) in segments(), index in any::<prop::sample::Index>(), share in 0.01..0.99f64,
        ) {
            for kind in [Kind::Discrete, Kind::Rhythmic] {
                let warp = WarpingFunction::new(kind, &breaks, &segment_durations);
                for k in 0..segment_durations.len() {
                    let (segment, chord) = (warp.segment(k), segment_durations[k] / (breaks[k + 1] - breaks[k]));
                    let min_slope = 0.25 * segment.start_slope.min(segment.end_slope).min(1.0);
                    for i in 0..=50 {
                        prop_assert!(segment.at(f64::from(i) / 50.0)[1] >= min_slope);
                    }
                    prop_assert!((segment.at(1.0)[0] - 1.0).abs() < 1e-12);
                    prop_assert!((segment.at(1.0)[1] * chord / warp.slopes[k + 1] - 1.0).abs() < 1e-9);
                    prop_assert!((segment.at(0.0)[1] * chord / warp.slopes[k] - 1.0).abs() < 1e-9);
                }
                if kind == Kind::Rhythmic {
                    prop_assert_eq!(warp.slopes[0], warp.slopes[segment_durations.len()]);
                }
                // Within a segment: the derivative of the rate jumps at breaks, where a difference quotient fails.
                let k = index.index(segment_durations.len());
                let (time, h) = (warp.times[k] + share * segment_durations[k], 1e-4 * segment_durations[k]);
                let [phase, rate, acceleration] = warp.phase(time);
                prop_assert!((warp.share(phase) * warp.duration() - time).abs() < 1e-12 * warp.duration());
                prop_assert!((rate * warp.slope(phase) - 1.0).abs() < 1e-9);
                let [[before, rate_before, _], [after, rate_after, _]] =
                    [time - h, time + h].map(|time| warp.phase(time));
                prop_assert!(((after - before) / (2.0 * h * rate) - 1.0).abs() < 1e-4);
                let scale = acceleration.abs() + rate / segment_durations[k];
                prop_assert!(((rate_after - rate_before) / (2.0 * h) - acceleration).abs() < 1e-3 * scale);
            }
        }

        /// Time at each break is the sum of the segment durations before it.
        #[test]
        fn time_at_breaks_is_the_sum_of_durations((breaks, segment_durations) in segments()) {
            let warp = WarpingFunction::new(Kind::Discrete, &breaks, &segment_durations);
            for (k, phase) in breaks.iter().enumerate() {
                prop_assert_eq!(warp.share(*phase), warp.times[k] / warp.duration());
                prop_assert!((warp.phase(warp.times[k])[0] - phase).abs() < 1e-14);
            }
        }
    }

    /// Equal chords give linear time, past the end too.
    #[test]
    fn equal_chords_are_linear_time() {
        for kind in [Kind::Discrete, Kind::Rhythmic] {
            let warp = WarpingFunction::new(kind, &[0.0, 0.3, 0.45, 1.0], &[0.6, 0.3, 1.1]);
            for i in 0..60 {
                let time = f64::from(i) / 20.0;
                let [phase, rate, acceleration] = warp.phase(time);
                assert!((phase - time / 2.0).abs() < 1e-14 && (rate - 0.5).abs() < 1e-14);
                assert!(acceleration.abs() < 1e-13);
            }
        }
    }

    /// The phase increases by 1 per cycle, also at times that are a whole number of cycles up to rounding.
    #[test]
    fn cycles_are_counted_once() {
        for hundredths in 20..300 {
            let period = f64::from(hundredths) / 100.0;
            let warp = WarpingFunction::new(Kind::Rhythmic, &[0.0, 0.5, 1.0], &[0.6 * period, 0.4 * period]);
            for dt in [0.01, 0.001, period / 50.0] {
                let mut before = -1e-12;
                for k in 0..(10.0 * period / dt) as usize {
                    let time = k as f64 * dt;
                    let [phase, ..] = warp.phase(time);
                    assert!(phase > before && (phase - time / period).abs() < 0.2, "{period} {time}: {phase}");
                    before = phase;
                }
            }
        }
    }
}
