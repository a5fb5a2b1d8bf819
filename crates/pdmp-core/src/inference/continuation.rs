//! Continuation of a movement past its last observation.

use ndarray::Array2;

use super::estimate::MIN_WEIGHT;
use super::recogniser::Recogniser;
use crate::error::Result;
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
    /// Predicts the positions at times (T,) in seconds, from the last observation on.
    ///
    /// # Errors
    /// A time before the last observation or not finite, and as for [`Recogniser::estimate`].
    pub fn continuation(&mut self, time: &[f64]) -> Result<Continuation> {
        let duration = self.estimate()?.duration;
        let position = self.mean_continuation(time)?;
        let factor = self.factors(duration).position;
        let mut deviation: Array2<f64> = zeros("continuation", position.dim())?;
        let mut row = vec![0.0; self.table.width];
        for h in self.active() {
            for ((k, d), square) in deviation.indexed_iter_mut() {
                let (mean, residual) = self.ahead(h, time[k], d, &mut row);
                let along = self.beliefs[h].variance(&mut row[..self.table.n_directions]);
                *square += self.beliefs[h].weight * ((mean - position[[k, d]]).powi(2) + along + residual);
            }
        }
        let sum = self.sum_of_weights();
        deviation.mapv_inplace(|square| factor * (square / sum).sqrt());
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
        let mut row = vec![0.0; self.table.width];
        let sum = self.sum_of_weights();
        for h in self.active() {
            for ((k, d), mean) in position.indexed_iter_mut() {
                *mean += self.beliefs[h].weight / sum * self.ahead(h, time[k], d, &mut row).0;
            }
        }
        Ok(position)
    }

    /// Returns the mean position of a DoF under a hypothesis and the variance of the residual; `row` becomes that of the
    /// table.
    fn ahead(&self, h: usize, time: f64, dof: usize, row: &mut [f64]) -> (f64, f64) {
        let [first, last] = self.times.unwrap_or_default();
        let (q, mean) = (self.table.n_directions, &self.beliefs[h].mean);
        self.table.row(self.hypotheses[h].fraction(time - first), dof, row);
        let process = &self.processes[(h * self.prior.residual().len() + dof) * self.table.width..][..=q];
        let along = |values: &[f64]| values.iter().zip(mean).map(|(a, b)| a * b).sum::<f64>();
        let (decay, variance) = self.noise.ahead(time - last, dof);
        (row[q] + along(row) + decay * (process[q] - along(process)), variance)
    }

    /// Returns the hypotheses whose weights count.
    fn active(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.beliefs.len()).filter(|&h| self.beliefs[h].weight > MIN_WEIGHT)
    }

    fn sum_of_weights(&self) -> f64 {
        self.active().map(|h| self.beliefs[h].weight).sum()
    }
}
