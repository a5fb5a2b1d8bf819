//! Time over phase: the warping function of a demonstration, and of a movement that is given its timing.
//!
//! The phase axis [0, 1] of a movement is divided by breaks 0 = p_0 < … < p_K = 1. A timing (K,) is the time in seconds
//! that is spent in each segment. Time runs through t_k = Σ timing_i, i < k, at the breaks, on a cubic between each two,
//! with slopes made of the chords δ_k = timing_k/(p_{k+1} − p_k):
//!
//! ```text
//! 2/ṫ_k = 1/δ_{k−1} + 1/δ_k,   ẗ = 0 at both ends;   where rhythmic, the ends are one break
//! ```
//!
//! No slope exceeds twice a chord beside it, so that time increases everywhere, for every positive timing: a quarter of
//! a segment's chord and slopes bounds it from below. Where all chords are equal, time is linear to rounding.
//!
//! - F. N. Fritsch, R. E. Carlson, Monotone piecewise cubic interpolation, SIAM Journal on Numerical Analysis 17, 1980,
//!   doi:10.1137/0717021;
//! - J. Butland, A method of interpolating reasonable-shaped curves through any data, Computer Graphics 80, 1980 (the
//!   harmonic mean).

use crate::kind::Kind;

/// Time as a function of phase, and its inverse.
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
    /// The caller has checked that breaks (K+1,) increase from 0 to 1 and that the timing (K,) is positive.
    pub(crate) fn new(kind: Kind, breaks: &[f64], timing: &[f64]) -> Self {
        let n = timing.len();
        let mut times = vec![0.0; n + 1];
        for (k, seconds) in timing.iter().enumerate() {
            times[k + 1] = times[k] + seconds;
        }
        let chords: Vec<f64> = (0..n).map(|k| timing[k] / (breaks[k + 1] - breaks[k])).collect();
        let between = |left: f64, right: f64| 2.0 / (1.0 / left + 1.0 / right);
        let mut slopes = vec![chords[0]; n + 1];
        for k in 1..n {
            slopes[k] = between(chords[k - 1], chords[k]);
        }
        let ends = match kind {
            Kind::Rhythmic => [between(chords[n - 1], chords[0]); 2],
            Kind::Discrete if n == 1 => [chords[0]; 2],
            Kind::Discrete => [(0, 1), (n - 1, n - 1)].map(|(k, next)| (3.0 * chords[k] - slopes[next]) / 2.0),
        };
        [slopes[0], slopes[n]] = ends;
        Self { kind, breaks: breaks.to_vec(), times, slopes }
    }

    /// Seconds from start to end.
    pub(crate) fn duration(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    /// Share of the duration that is gone at a phase in [0, 1]; exact at the breaks.
    pub(crate) fn share(&self, phase: f64) -> f64 {
        if phase >= 1.0 {
            return 1.0;
        }
        let k = self.breaks.partition_point(|&p| p <= phase).clamp(1, self.breaks.len() - 1) - 1;
        let piece = self.piece(k);
        (self.times[k] + piece.rise * piece.at((phase - self.breaks[k]) / piece.run)[0]) / self.duration()
    }

    /// Seconds per unit of phase, dt/dp, at a phase of at least 0: past the end of a discrete movement that of the end,
    /// while a rhythmic one repeats.
    pub(crate) fn slope(&self, phase: f64) -> f64 {
        let phase = match self.kind {
            Kind::Discrete => phase.min(1.0),
            Kind::Rhythmic => phase.fract(),
        };
        let k = self.breaks.partition_point(|&p| p <= phase).clamp(1, self.breaks.len() - 1) - 1;
        let piece = self.piece(k);
        piece.chord() * piece.at((phase - self.breaks[k]) / piece.run)[1]
    }

    /// Phase p with ṗ and p̈ at a time of at least 0, in seconds. Past its end a discrete movement goes on at the last
    /// rate, and a rhythmic one repeats, counting its turns.
    pub(crate) fn phase(&self, time: f64) -> [f64; 3] {
        let duration = self.duration();
        let (turns, time) = match self.kind {
            Kind::Discrete if time >= duration => {
                let rate = 1.0 / self.slopes[self.slopes.len() - 1];
                return [1.0 + (time - duration) * rate, rate, 0.0];
            }
            Kind::Discrete => (0.0, time),
            Kind::Rhythmic => {
                // Turns are counted by what is left: a quotient of its own may round to the next one.
                let left = time.rem_euclid(duration);
                (((time - left) / duration).round(), left)
            }
        };
        let k = self.times.partition_point(|&t| t <= time).clamp(1, self.times.len() - 1) - 1;
        let piece = self.piece(k);
        let r = piece.inverse((time - self.times[k]) / piece.rise);
        let [_, slope, bend] = piece.at(r);
        let rate = 1.0 / (piece.chord() * slope);
        // p̈ = −ẗ/ṫ³ with primes of t over p.
        [turns + self.breaks[k] + r * piece.run, rate, -piece.chord() / piece.run * bend * rate.powi(3)]
    }

    fn piece(&self, k: usize) -> Piece {
        let (run, rise) = (self.breaks[k + 1] - self.breaks[k], self.times[k + 1] - self.times[k]);
        let chord = rise / run;
        Piece { run, rise, from: self.slopes[k] / chord, to: self.slopes[k + 1] / chord }
    }
}

/// A segment, whose time rises by the chord's slope times `from` where it starts, and times `to` where it ends.
struct Piece {
    run: f64,
    rise: f64,
    from: f64,
    to: f64,
}

impl Piece {
    fn chord(&self) -> f64 {
        self.rise / self.run
    }

    /// Share s of the rise at the share `r` of the run, with s′ and s″.
    fn at(&self, r: f64) -> [f64; 3] {
        let (bend, twist) = (3.0 - 2.0 * self.from - self.to, self.from + self.to - 2.0);
        [
            r * (self.from + r * (bend + r * twist)),
            self.from + r * (2.0 * bend + 3.0 * r * twist),
            2.0 * bend + 6.0 * r * twist,
        ]
    }

    /// The share of the run at which the share of the rise is `s`: Newton's method between bounds.
    fn inverse(&self, s: f64) -> f64 {
        let (mut low, mut high, mut r) = (0.0, 1.0, s.clamp(0.0, 1.0));
        // Bisection alone would be done after so many.
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

    /// Breaks and timing of some segments, up to a thousandfold apart.
    fn timings() -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
        prop::collection::vec((-3.0..3.0, -3.0..3.0), 1..12).prop_map(|logarithms: Vec<(f64, f64)>| {
            let [runs, timing]: [Vec<f64>; 2] =
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
            (breaks, timing)
        })
    }

    proptest! {
        /// Time increases, its slope is that of the breaks' neighbours on both sides, and phase of time is its inverse.
        #[test]
        fn time_is_monotone_and_smooth_and_phase_is_its_inverse(
            (breaks, timing) in timings(), place in any::<prop::sample::Index>(), share in 0.01..0.99f64,
        ) {
            for kind in [Kind::Discrete, Kind::Rhythmic] {
                let warp = WarpingFunction::new(kind, &breaks, &timing);
                for k in 0..timing.len() {
                    let (piece, chord) = (warp.piece(k), timing[k] / (breaks[k + 1] - breaks[k]));
                    for i in 0..=50 {
                        prop_assert!(piece.at(f64::from(i) / 50.0)[1] >= 0.25 * piece.from.min(piece.to).min(1.0));
                    }
                    prop_assert!((piece.at(1.0)[0] - 1.0).abs() < 1e-12);
                    prop_assert!((piece.at(1.0)[1] * chord / warp.slopes[k + 1] - 1.0).abs() < 1e-9);
                    prop_assert!((piece.at(0.0)[1] * chord / warp.slopes[k] - 1.0).abs() < 1e-9);
                }
                if kind == Kind::Rhythmic {
                    prop_assert_eq!(warp.slopes[0], warp.slopes[timing.len()]);
                }
                // Within a segment: the chords of a difference quotient would cut the corners of the rate at breaks.
                let k = place.index(timing.len());
                let (time, h) = (warp.times[k] + share * timing[k], 1e-4 * timing[k]);
                let [phase, rate, bend] = warp.phase(time);
                prop_assert!((warp.share(phase) * warp.duration() - time).abs() < 1e-12 * warp.duration());
                prop_assert!((rate * warp.slope(phase) - 1.0).abs() < 1e-9);
                let [[before, slower, _], [after, faster, _]] = [time - h, time + h].map(|time| warp.phase(time));
                prop_assert!(((after - before) / (2.0 * h * rate) - 1.0).abs() < 1e-4);
                prop_assert!(((faster - slower) / (2.0 * h) - bend).abs() < 1e-3 * (bend.abs() + rate / timing[k]));
            }
        }

        /// At the breaks time is that of the timing, whatever lies between.
        #[test]
        fn breaks_are_met((breaks, timing) in timings()) {
            let warp = WarpingFunction::new(Kind::Discrete, &breaks, &timing);
            for (k, phase) in breaks.iter().enumerate() {
                prop_assert_eq!(warp.share(*phase), warp.times[k] / warp.duration());
                prop_assert!((warp.phase(warp.times[k])[0] - phase).abs() < 1e-14);
            }
        }
    }

    /// Equal chords are linear time; beyond the end the clock goes on, or around.
    #[test]
    fn equal_chords_are_linear_time() {
        for kind in [Kind::Discrete, Kind::Rhythmic] {
            let warp = WarpingFunction::new(kind, &[0.0, 0.3, 0.45, 1.0], &[0.6, 0.3, 1.1]);
            for i in 0..60 {
                let time = f64::from(i) / 20.0;
                let [phase, rate, bend] = warp.phase(time);
                assert!((phase - time / 2.0).abs() < 1e-14 && (rate - 0.5).abs() < 1e-14 && bend.abs() < 1e-13);
            }
        }
    }

    /// Turns are counted once, also where a time is a whole number of them but for rounding.
    #[test]
    fn turns_are_counted_once() {
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
