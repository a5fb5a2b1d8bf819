//! Pauses of a movement that is observed.
// Closures of iterators stay calls, into which the instructions of larger registers are not inlined.
#![allow(clippy::needless_range_loop)]

use super::movement_table::{MovementTable, Place};
use super::noise_filter::{NoiseFilter, WHITE};
use super::observation::Sums;
use super::prior::Prior;
use super::recogniser::Recogniser;
use super::rotations::{Layout, Sample};
use crate::numerics::simd::{F64x4, Kernel, Register, WIDTH, compute};

/// Length of the windows over which speeds are compared, in mean durations.
const WINDOW: f64 = 0.04;
/// Expected number of pauses in a mean duration.
const RATE: f64 = 0.1;
/// Mean length of a pause, in mean durations.
const LENGTH: f64 = 0.5;
/// Standard deviation of the observed speed, relative to the predicted one. With 0.5, errors of the recordings that do not
/// pause in docs/recognition.md change by at most 0.005, or 0.025 where the duration is known; with 0.4, those of people
/// left out grow by up to 60 %.
const SPEED_DEVIATION: f64 = 0.5;
/// Probability from which on the clock rests.
const STOP: f64 = 0.9;
/// Probability from which on it rests no longer.
const RESUME: f64 = 0.5;
/// Largest relative speed by which the clock advances as it goes on.
const MAX_SPEED: f64 = 2.0;
/// Largest logarithm of the ratio of likelihoods in a window.
const MAX_LOG_RATIO: f64 = 8.0;

/// Filter of the probability that a movement has stopped.
///
/// A hidden Markov model of two states compares the displacement in a window with the predicted one. With δ the root of the
/// sum of squares over the DoFs, each relative to the white noise of two positions, ρ = δ/δ_predicted is normal about 1 while
/// the movement goes on, and about 0 in a pause, of variance 0.5² + 1/δ²_predicted. A movement that is predicted to be slow
/// is no evidence.
///
/// While it is stopped, the clock of the movement rests at the last window that was not slow, and what was observed since
/// is no part of the sums.
#[derive(Clone, Debug)]
pub(crate) struct Pauses {
    /// Mean duration of the demonstrations, in seconds.
    duration: f64,
    /// Variances of the difference of two positions in a pause (D,).
    variances: Vec<f64>,
    /// Probability that the movement is stopped.
    pub(crate) probability: f64,
    /// True while the clock of the movement rests.
    pub(crate) stopped: bool,
    /// Time of the begin of the window, in seconds.
    since: f64,
    /// Position and predicted velocities (D,) at the begin of the window, or where it rests.
    anchor: Sample,
    velocity: Vec<f64>,
    /// Memory of a displacement (D,), and of the ends of a window under four hypotheses (D,).
    moved: Vec<f64>,
    ends: [Vec<F64x4>; 2],
    /// The recogniser at the begin of the last window that was not slow.
    saved: Saved,
}

/// State to which a recogniser returns.
#[derive(Clone, Debug)]
struct Saved {
    clock: f64,
    n_observed: usize,
    noise: NoiseFilter,
    sums: Vec<Sums>,
    anchor: Sample,
    velocity: Vec<f64>,
    /// Weights of the hypotheses, and means (q,) of each four of them.
    weights: Vec<F64x4>,
    means: Vec<F64x4>,
}

impl Pauses {
    pub(crate) fn new(
        prior: &Prior,
        layout: &Layout,
        noise: &NoiseFilter,
        sums: &[Sums],
        table: &MovementTable,
    ) -> Self {
        let logs = prior.log_durations();
        let (missing, unknown) = (Sample::missing(layout), vec![f64::NAN; layout.n_dofs]);
        let (noise, sums) = (noise.clone(), sums.to_vec());
        let saved = Saved {
            clock: 0.0,
            n_observed: 0,
            noise,
            weights: vec![F64x4::ZERO; sums.len()],
            means: vec![F64x4::ZERO; sums.len() * table.n_directions],
            sums,
            anchor: missing.clone(),
            velocity: unknown.clone(),
        };
        Self {
            duration: (logs.iter().sum::<f64>() / logs.len() as f64).exp(),
            variances: prior.residual().iter().map(|sd| 2.0 * WHITE * sd * sd).collect(),
            probability: 0.0,
            stopped: false,
            since: f64::NEG_INFINITY,
            anchor: missing,
            moved: unknown.clone(),
            velocity: unknown,
            ends: [(); 2].map(|()| vec![F64x4::ZERO; layout.n_dofs]),
            saved,
        }
    }

    pub(crate) fn reset(&mut self) {
        (self.probability, self.stopped, self.since) = (0.0, false, f64::NEG_INFINITY);
        self.velocity.fill(f64::NAN);
    }

    /// Returns the observed speed relative to the predicted one, and the logarithm of the ratio of the likelihoods of a pause
    /// and of a movement that goes on.
    fn compare(&mut self, span: f64, sample: &Sample, layout: &Layout) -> (f64, f64) {
        let (mut moved, mut predicted) = (0.0, 0.0);
        layout.change(&self.anchor, sample, &mut self.moved);
        for (d, &own) in self.moved.iter().enumerate() {
            let expected = span * self.velocity[d];
            if !(own + expected).is_nan() {
                // The squares of the noise add one of each DoF.
                moved += own * own / self.variances[d] - 1.0;
                predicted += expected * expected / self.variances[d];
            }
        }
        // Over longer intervals the velocity is not constant.
        if predicted <= 0.0 || span > 2.0 * WINDOW * self.duration {
            return (1.0, 0.0);
        }
        let ratio = (moved.max(0.0) / predicted).sqrt();
        let variance = SPEED_DEVIATION * SPEED_DEVIATION + predicted.recip();
        (ratio, ((0.5 - ratio) / variance).clamp(-MAX_LOG_RATIO, MAX_LOG_RATIO))
    }

    /// Includes a window, and returns its speed and ratio as [`Self::compare`] does.
    fn filter(&mut self, span: f64, sample: &Sample, layout: &Layout) -> (f64, f64) {
        let (speed, log_ratio) = self.compare(span, sample, layout);
        let steps = span / self.duration;
        let (stays, begins) = ((-steps / LENGTH).exp(), 1.0 - (-steps * RATE).exp());
        let before = self.probability * stays + (1.0 - self.probability) * begins;
        let odds = before / (1.0 - before) * log_ratio.exp();
        self.probability = odds / (1.0 + odds);
        (speed, log_ratio)
    }
}

impl Recogniser {
    /// Compares the displacement with the predicted one at the end of a window: stops the clock, lets it run on, or begins
    /// the next window.
    pub(crate) fn watch(&mut self, time: f64) {
        let Self { pauses: Some(pauses), sample, layout, .. } = self else { return };
        let span = time - pauses.since;
        if span < WINDOW * pauses.duration {
            return;
        }
        let unknown = pauses.velocity[0].is_nan();
        let (speed, log_ratio) = if unknown { (1.0, 0.0) } else { pauses.filter(span, sample, layout) };
        match (pauses.stopped, pauses.probability > if pauses.stopped { RESUME } else { STOP }) {
            (true, true) => pauses.since = time,
            (false, true) => {
                let Saved { clock, n_observed, noise, sums, anchor, velocity, .. } = &pauses.saved;
                (self.clock, self.n_observed) = (*clock, *n_observed);
                self.noise.copy_from(noise);
                self.sums.iter_mut().zip(sums).for_each(|(to, from)| to.copy_from(from));
                pauses.anchor.copy_from(anchor);
                pauses.velocity.copy_from_slice(velocity);
                (pauses.stopped, pauses.since) = (true, time);
            }
            (stopped, false) => {
                pauses.stopped = false;
                if stopped {
                    // The way from where it rested gives the time since when it goes on.
                    self.include(span * speed.min(MAX_SPEED));
                }
                self.begin_window(time, log_ratio <= 0.0);
            }
        }
    }

    /// Begins a window, and keeps the state if it is one of a movement that goes on. The velocity is that of the state that
    /// is kept: later observations, of a pause, would be taken for a slow movement.
    fn begin_window(&mut self, time: f64, keep: bool) {
        let known = !keep || self.weigh().is_ok();
        let Self { pauses, beliefs, fours, table, rows, layout, sample, .. } = self;
        let Some(pauses) = pauses else { return };
        let Pauses { saved, velocity, ends, .. } = pauses;
        pauses.since = time;
        pauses.anchor.copy_from(sample);
        if keep && known {
            let means = saved.means.chunks_exact_mut(table.n_directions);
            for ((belief, weight), mean) in beliefs.iter().zip(&mut saved.weights).zip(means) {
                *weight = if belief.counts() { belief.weight } else { F64x4::ZERO };
                mean.copy_from_slice(&belief.mean);
            }
        }
        velocity.fill(if known { 0.0 } else { f64::NAN });
        let window = WINDOW * pauses.duration;
        let sum: f64 = saved.weights.iter().map(|weight| weight.reduce_add()).sum();
        let means = saved.means.chunks_exact(table.n_directions);
        for ((&weight, mean), four) in saved.weights.iter().zip(means).zip(&*fours) {
            if known && weight != F64x4::ZERO {
                let places = [self.clock, self.clock + window].map(|clock| table.places(four.fraction(clock)));
                let scale = F64x4::splat((sum * window).recip());
                for (&place, ends) in places.iter().zip(&mut *ends) {
                    compute(Predict { mean, table, places: place, row: &mut rows[..table.width], positions: ends });
                }
                layout.add_changes(places, ends, weight * scale, velocity);
            }
        }
        if keep {
            (saved.clock, saved.n_observed) = (self.clock, self.n_observed);
            saved.noise.copy_from(&self.noise);
            saved.sums.iter_mut().zip(&self.sums).for_each(|(to, from)| to.copy_from(from));
            saved.anchor.copy_from(&pauses.anchor);
            saved.velocity.copy_from_slice(velocity);
        }
    }
}

/// Kernel that computes the mean positions of the DoFs (D,) at four places.
struct Predict<'a> {
    mean: &'a [F64x4],
    table: &'a MovementTable,
    places: [Place; WIDTH],
    /// Memory of a row (w,).
    row: &'a mut [F64x4],
    positions: &'a mut [F64x4],
}

impl Kernel for Predict<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { mean, table, places, row, positions } = self;
        let q = table.n_directions;
        for d in 0..positions.len() {
            table.rows::<T>(&places, d, row);
            let mut sum = T::load(&row[q]);
            for i in 0..q {
                sum = sum + T::load(&row[i]) * T::load(&mean[i]);
            }
            positions[d] = sum.store();
        }
    }
}
