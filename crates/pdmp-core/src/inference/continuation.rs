//! Continuation of a movement past its last observation.

use ndarray::Array2;

use super::evidence::Belief;
use super::recogniser::Recogniser;
use super::triangle::square;
use crate::error::Result;
use crate::numerics::simd::F64x4;
use crate::validate::{check_number, check_range, zeros};

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
        let duration = self.estimate()?.duration;
        let position = self.mean_continuation(time)?;
        let factor = self.factors(duration).position;
        let mut deviation: Array2<f64> = zeros("continuation", position.dim())?;
        let sum = self.sum_of_weights();
        self.ahead(time, |belief, k, d, mean, residual, row| {
            let error = mean - F64x4::splat(position[[k, d]]);
            let variance = error * error + square::<F64x4>(&belief.covariance, row) + F64x4::splat(residual);
            deviation[[k, d]] += (belief.weight * variance).reduce_add() / sum;
        });
        deviation.mapv_inplace(|square| factor * square.sqrt());
        Ok(Continuation { time: time.to_vec(), position, deviation })
    }

    /// Predicts the mean positions (T, D) as [`Self::continuation`] does.
    ///
    /// # Errors
    /// As for [`Self::continuation`].
    pub(crate) fn mean_continuation(&mut self, time: &[f64]) -> Result<Array2<f64>> {
        self.weigh()?;
        let [_, last] = self.times.unwrap_or_default();
        for (index, &t) in time.iter().enumerate() {
            check_number("time", index, t)?;
            check_range("time", t, t >= last, "must not be before the last observation")?;
        }
        let mut position: Array2<f64> = zeros("continuation", (time.len(), self.prior.residual().len()))?;
        let sum = self.sum_of_weights();
        self.ahead(time, |belief, k, d, mean, _, _| {
            position[[k, d]] += (belief.weight * mean).reduce_add() / sum;
        });
        Ok(position)
    }

    /// Calls a function for four hypotheses after four, every time and DoF, with the mean positions, the variance of the
    /// residual, and the row (q,) of the table.
    fn ahead(&self, time: &[f64], mut predicted: impl FnMut(&Belief, usize, usize, F64x4, f64, &[F64x4])) {
        let [_, last] = self.times.unwrap_or_default();
        let (q, width) = (self.table.n_directions, self.table.width);
        let mut row = vec![F64x4::ZERO; width];
        for ((belief, sums), four) in self.beliefs.iter().zip(&self.sums).zip(&self.fours) {
            if !belief.counts() {
                continue;
            }
            let along = |values: &[F64x4]| {
                values.iter().zip(&belief.mean).fold(F64x4::ZERO, |sum, (value, mean)| sum + *value * *mean)
            };
            for (k, &t) in time.iter().enumerate() {
                let places = self.table.places(four.fraction(self.clock + (t - last)));
                for (d, process) in sums.processes.chunks_exact(width).enumerate() {
                    self.table.rows::<F64x4>(&places, d, &mut row);
                    let (decay, variance) = self.noise.ahead(t - last, d);
                    let residual = process[q] - along(process);
                    let mean = row[q] + along(&row) + residual * F64x4::splat(decay);
                    predicted(belief, k, d, mean, variance, &row[..q]);
                }
            }
        }
    }

    fn sum_of_weights(&self) -> f64 {
        self.beliefs.iter().filter(|belief| belief.counts()).map(|belief| belief.weight.reduce_add()).sum()
    }
}
