//! Continuation of a movement past its last observation.

use ndarray::Array2;

use super::estimate::MIN_WEIGHT;
use super::recogniser::Recogniser;
use crate::error::Result;
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
    /// Predicts the positions at times (T,) in seconds, from the last observation on.
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
        let mut row = std::mem::take(&mut self.row);
        for h in self.active() {
            for (k, (square, expected)) in deviation.iter_mut().zip(&*position).enumerate() {
                let (mean, residual) = self.ahead(h, time[k / n_dofs], k % n_dofs, &mut row);
                let along = self.beliefs[h].variance(&mut row[..self.table.n_directions]);
                *square += self.beliefs[h].weight * ((mean - expected).powi(2) + along + residual);
            }
        }
        self.row = row;
        let sum = self.sum_of_weights();
        deviation.iter_mut().for_each(|square| *square = factor * (*square / sum).sqrt());
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
        let mut row = std::mem::take(&mut self.row);
        let sum = self.sum_of_weights();
        for h in self.active() {
            for (k, mean) in position.iter_mut().enumerate() {
                *mean += self.beliefs[h].weight / sum * self.ahead(h, time[k / n_dofs], k % n_dofs, &mut row).0;
            }
        }
        self.row = row;
        Ok(())
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
