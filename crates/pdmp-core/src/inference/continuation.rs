//! Continuation of a movement past its last observation.

use ndarray::Array2;

use super::evidence::Belief;
use super::recogniser::Recogniser;
use super::triangle::square;
use crate::error::Result;
use crate::numerics::simd::F64x4;
use crate::validate::{check_length, check_number, check_range, row_major_mut, zeros};

/// Positions to come.
#[derive(Clone, Debug, PartialEq)]
pub struct Continuation {
    /// Times (T,), in seconds, on the clock of the observations.
    pub time: Vec<f64>,
    /// Mean positions (T, D).
    pub position: Array2<f64>,
    /// Standard deviations (T, D), scaled so that 90 % of held-out positions lie within 1.645 of them.
    pub deviation: Array2<f64>,
}

impl Recogniser {
    /// Predicts the positions at times (T,) in seconds, from the last observation on. A movement that is stopped goes on at
    /// once.
    ///
    /// # Errors
    /// A time before the last observation or not finite, and as for [`Recogniser::estimate`].
    pub fn continuation(&mut self, time: &[f64]) -> Result<Continuation> {
        let shape = (time.len(), self.prior.residual().len());
        let (mut position, mut deviation) = (zeros("continuation", shape)?, zeros("continuation", shape)?);
        self.write_continuation(time, row_major_mut(&mut position), row_major_mut(&mut deviation))?;
        Ok(Continuation { time: time.to_vec(), position, deviation })
    }

    /// Writes the positions and their standard deviations (T·D,), by times and DoFs, as [`Self::continuation`] returns them.
    /// Does not allocate.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # use pdmp_core::inference::{Recogniser, Timing};
    /// # use pdmp_core::learning::learn_prior;
    /// # use pdmp_core::numerics::Threads;
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let demos = [demos.clone(), demos].concat();
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let prior = learn_prior(&model, &demos, None, Threads::ONE)?;
    /// let mut recogniser = Recogniser::new(&model, &prior, Timing::default())?;
    /// recogniser.update(0.0, &[0.0, 0.0])?;
    /// let (mut position, mut deviation) = ([0.0; 4], [0.0; 4]);
    /// recogniser.write_continuation(&[0.1, 0.2], &mut position, &mut deviation)?;
    /// assert!(deviation.iter().all(|sd| *sd > 0.0));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A wrong length, and as for [`Self::continuation`]. The arrays then keep their numbers.
    pub fn write_continuation(&mut self, time: &[f64], position: &mut [f64], deviation: &mut [f64]) -> Result<()> {
        let (n_dofs, per) = (self.prior.residual().len(), "DoF of each time");
        check_length("deviation", deviation.len(), time.len() * n_dofs, per)?;
        self.write_mean(time, position)?;
        let duration = self.estimate()?.duration;
        let factor = self.factors(duration).position;
        deviation.fill(0.0);
        let sum = self.sum_of_weights();
        self.ahead(time, |belief, k, mean, residual, row| {
            let error = mean - F64x4::splat(position[k]);
            let variance = error * error + square::<F64x4>(&belief.covariance, row) + F64x4::splat(residual);
            deviation[k] += (belief.weight * variance).reduce_add() / sum;
        });
        deviation.iter_mut().for_each(|square| *square = factor * square.sqrt());
        Ok(())
    }

    /// Predicts the mean positions (T, D) as [`Self::continuation`] does.
    ///
    /// # Errors
    /// As for [`Self::continuation`].
    pub(crate) fn mean_continuation(&mut self, time: &[f64]) -> Result<Array2<f64>> {
        let mut position: Array2<f64> = zeros("continuation", (time.len(), self.prior.residual().len()))?;
        self.write_mean(time, row_major_mut(&mut position))?;
        Ok(position)
    }

    /// Writes the mean positions (T·D,).
    ///
    /// # Errors
    /// As for [`Self::write_continuation`].
    fn write_mean(&mut self, time: &[f64], position: &mut [f64]) -> Result<()> {
        let n_dofs = self.prior.residual().len();
        check_length("position", position.len(), time.len() * n_dofs, "DoF of each time")?;
        self.weigh()?;
        let [_, last] = self.times.unwrap_or_default();
        for (index, &t) in time.iter().enumerate() {
            check_number("time", index, t)?;
            check_range("time", t, t >= last, "must not be before the last observation")?;
        }
        position.fill(0.0);
        let sum = self.sum_of_weights();
        self.ahead(time, |belief, k, mean, _, _| position[k] += (belief.weight * mean).reduce_add() / sum);
        Ok(())
    }

    /// Calls a function for four hypotheses after four and every element of (T, D), with the mean positions, the variance of
    /// the residual, and the row (q,) of the table.
    fn ahead(&mut self, time: &[f64], mut predicted: impl FnMut(&Belief, usize, F64x4, f64, &[F64x4])) {
        let [_, last] = self.times.unwrap_or_default();
        let (q, width) = (self.table.n_directions, self.table.width);
        let Self { table, noise, rows, clock, .. } = self;
        let row = &mut rows[..width];
        for ((belief, sums), four) in self.beliefs.iter().zip(&self.sums).zip(&self.fours) {
            if !belief.counts() {
                continue;
            }
            let along = |values: &[F64x4]| {
                values.iter().zip(&belief.mean).fold(F64x4::ZERO, |sum, (value, mean)| sum + *value * *mean)
            };
            let mut k = 0;
            for t in time {
                let places = table.places(four.fraction(*clock + (t - last)));
                for (d, process) in sums.processes.chunks_exact(width).enumerate() {
                    table.rows::<F64x4>(&places, d, row);
                    let (decay, variance) = noise.ahead(t - last, d);
                    let residual = process[q] - along(process);
                    let mean = row[q] + along(row) + residual * F64x4::splat(decay);
                    predicted(belief, k, mean, variance, &row[..q]);
                    k += 1;
                }
            }
        }
    }

    fn sum_of_weights(&self) -> f64 {
        self.beliefs.iter().filter(|belief| belief.counts()).map(|belief| belief.weight.reduce_add()).sum()
    }
}
