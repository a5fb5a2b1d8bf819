//! Mean rotation of demonstrations over the clock: the Karcher mean at each phase.
//!
//! The mean is the rotation about which the residuals log(q̄⁻¹q_m) of the demonstrations add up to zero. Every step is a
//! linear map of quaternion components with common coefficients, or acts on residuals: a constant rotation of the world or
//! of the body frame turns the path with it.
//!
//! H. Karcher, Riemannian center of mass and mollifier smoothing, Communications on Pure and Applied Mathematics 30, 1977.

use crate::dynamics::canonical::Canonical;
use crate::dynamics::mean_rotation::{MeanRotation, end_motion};
use crate::dynamics::time_warp::WarpingFunction;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::numerics::rotation::{self, Quaternion, add_scaled, distance, dot, exp, normalised, product};
use crate::numerics::smoothing_spline::{MIN_DECIMATED, Noise, Samples, Smoothing, pooled};
use crate::numerics::spline::{Knots, Splines};
use crate::numerics::threads::Threads;
use ndarray::Array2;

/// Largest number of demonstrations in the mean. It is the origin of the residuals, which describe each demonstration.
const MAX_AVERAGED: usize = 200;
/// Shares of the path before its end over which the velocity and the acceleration of a mean rotation that does not end at
/// rest fade. The residuals take up the difference, 0.02 of the velocity at most, which shorter shares would make smaller but
/// sharper. Most recordings end at rest with some acceleration, for which the second share is short.
const FADING_SHARES: [f64; 2] = [0.1, 0.03];

/// Recorded rotation of one demonstration.
pub(super) struct Recording {
    /// Times of the samples (n,) in seconds.
    pub(super) time: Vec<f64>,
    /// Duration or period in seconds.
    pub(super) duration: f64,
    /// Unit quaternions (n,) with continuous signs.
    pub(super) rotations: Vec<Quaternion>,
    /// Time as a function of phase; `None` for linear time.
    pub(super) warp: Option<WarpingFunction>,
}

impl Recording {
    /// Returns times, period and components; those of a cycle twice, as its quaternion may change its sign.
    fn components(&self, kind: Kind) -> (Vec<f64>, Option<f64>, Array2<f64>) {
        let (n, q) = (self.rotations.len(), &self.rotations);
        let closing = if dot(q[n - 1], q[0]) < 0.0 { -1.0 } else { 1.0 };
        let (copies, period) = match kind {
            Kind::Discrete => (1, None),
            Kind::Rhythmic => (2, Some(2.0 * self.duration)),
        };
        let time = (0..copies * n).map(|c| self.time[c % n] + self.duration * (c / n) as f64).collect();
        let sign = |c: usize| if c < n { 1.0 } else { closing };
        (time, period, Array2::from_shape_fn((copies * n, 4), |(c, i)| sign(c) * q[c % n][i]))
    }

    /// Returns the rotations at the ends of equal parts of the phase.
    fn resampled(&self, kind: Kind, parts: usize) -> Vec<Quaternion> {
        let (time, period, values) = self.components(kind);
        let knots = match period {
            None => Knots::not_a_knot(time),
            Some(period) => Knots::periodic(time, period),
        };
        let mut rows = vec![0.0; 4 * (parts + 1)];
        let share = |phase: f64| self.warp.as_ref().map_or(phase, |warp| warp.share(phase));
        let times = (0..=parts).map(|k| self.duration * share(k as f64 / parts as f64));
        Splines::through(knots, crate::validate::row_major(&values), 4).sample(times, &mut rows);
        rows.chunks_exact(4).map(|q| normalised(std::array::from_fn(|i| q[i]))).collect()
    }
}

/// Returns the mean of recordings over the clock; `duration` is that of the nominal one, for which the cut-off of the
/// measurement noise is that of the recordings.
///
/// # Errors
/// Too few samples for the speed of the rotation, or threads that the system does not provide.
pub(super) fn mean_path(
    recordings: &[Recording],
    canonical: Canonical,
    duration: f64,
    parts: usize,
    smoothing: Smoothing,
    threads: Threads,
) -> Result<MeanRotation> {
    let (kind, n) = (canonical.kind(), recordings.len());
    let averaged = n.min(MAX_AVERAGED);
    let paths: Vec<Vec<Quaternion>> =
        (0..averaged).map(|p| recordings[p * n / averaged].resampled(kind, parts)).collect();
    let mut mean = first_mean(&paths);
    let mut rotations: Vec<Quaternion> = (0..=parts)
        .map(|k| {
            mean = rotation::mean(mean, paths.iter().map(|path| path[k]));
            mean
        })
        .collect();
    let noise = noise_of(recordings, kind, smoothing, threads)?;
    if noise.cut_offs()[0].is_some() {
        let time = (0..if kind == Kind::Discrete { parts + 1 } else { parts })
            .map(|k| duration * k as f64 / parts as f64)
            .collect();
        rotations.truncate(if kind == Kind::Discrete { parts + 1 } else { parts });
        let (time, period, values) =
            Recording { time, duration, rotations: rotations.clone(), warp: None }.components(kind);
        let samples = Samples { time: &time, period, values: values.view() };
        let smoothed = samples.smoothed(noise.cut_offs(), noise.ends());
        let rows = smoothed.rows().into_iter().take(parts + 1);
        rotations = rows.map(|q| normalised(std::array::from_fn(|i| q[i]))).collect();
    }
    match kind {
        Kind::Discrete => slow_down(&mut rotations),
        Kind::Rhythmic => {
            let sign = if dot(rotations[0], rotations[parts]) < 0.0 { -1.0 } else { 1.0 };
            rotations[parts] = rotations[0].map(|x| sign * x);
        }
    }
    if !MeanRotation::are_valid(&rotations, kind) {
        let problem = "has a rotation of more than 50 degrees from one sample to the next: record at a higher rate, or check \
                       the columns and the order of rotations";
        return Err(Error::Argument { name: "position", problem });
    }
    Ok(MeanRotation::through(rotations, canonical))
}

/// Returns the first rotation of the path that is closest to all others, where the iteration starts.
fn first_mean(paths: &[Vec<Quaternion>]) -> Quaternion {
    let spread = |path: &&Vec<Quaternion>| paths.iter().map(|other| distance(path[0], other[0]).powi(2)).sum::<f64>();
    let closest = paths.iter().min_by(|a, b| spread(a).total_cmp(&spread(b)));
    closest.map_or([1.0, 0.0, 0.0, 0.0], |path| path[0])
}

/// Returns the common noise of quaternion components.
fn noise_of(recordings: &[Recording], kind: Kind, smoothing: Smoothing, threads: Threads) -> Result<Noise> {
    let pool: Vec<_> = pooled(recordings.len()).map(|m| recordings[m].components(kind)).collect();
    let samples: Vec<Samples> =
        pool.iter().map(|(time, period, values)| Samples { time, period: *period, values: values.view() }).collect();
    let components = 0..4;
    let vectors = std::slice::from_ref(&components);
    Noise::estimate(smoothing, &samples, vectors, MIN_DECIMATED, threads)?.with_ends(&samples, vectors, threads)
}

/// Brings a path to rest at its end, with changes near the end that are proportional to its velocity and acceleration there.
fn slow_down(rotations: &mut [Quaternion]) {
    let n = rotations.len() - 1;
    let motion = end_motion(rotations);
    // Polynomials with the slope or the bend 1 at x = 1, and otherwise zero to second order at both ends.
    let shapes = [|x: f64| x.powi(3) * (-4.0 + x * (7.0 - 3.0 * x)), |x: f64| x.powi(3) * (0.5 + x * (0.5 * x - 1.0))];
    for (k, q) in rotations.iter_mut().enumerate() {
        let mut advance = [0.0; 3];
        for ((share, shape), (order, motion)) in
            FADING_SHARES.into_iter().zip(shapes).zip([1, 2].into_iter().zip(motion))
        {
            let length = (share * n as f64).ceil().clamp(1.0, n as f64);
            let x = 1.0 - (n - k) as f64 / length;
            if x > 0.0 {
                advance = add_scaled(advance, shape(x) * length.powi(order), motion);
            }
        }
        if advance != [0.0; 3] {
            *q = normalised(product(*q, exp(advance.map(|x| -x))));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The end of a slowed path is where it was, at rest; the path before the slowed share is unchanged.
    #[test]
    fn slowed_path_ends_at_rest() {
        let path: Vec<Quaternion> =
            (0..=1000).map(|k| f64::from(k) / 1000.0).map(|t| exp([2.0 * t, (3.0 * t).sin(), t * t])).collect();
        let mut slowed = path.clone();
        slow_down(&mut slowed);
        assert!(distance(path[1000], slowed[1000]) < 1e-15 && path[..900] == slowed[..900]);
        let [[before, _], [after, bend]] = [&path, &slowed].map(|path| end_motion(path));
        let size = |v: [f64; 3]| dot(v, v).sqrt();
        assert!(size(before) > 0.002 && size(after) < 1e-3 * size(before) && size(bend) < 1e-6, "{after:?} {bend:?}");
    }
}
