//! Continuation of a movement past its last observation.
//!
//! Each hypothesis of the time predicts another position, with a covariance. The mean of rotations is that of the unit
//! quaternions, the rotation of the smallest mean squared chordal distance (R. Hartley et al., Int. J. Comput. Vis. 103, 2013).
//! The deviations of a rotation are those of rotation vectors φ from this mean, q = q̂ ⊗ exp(φ), to first order within a
//! hypothesis: φ = J(δ)(δ′ − δ), as for a prediction band.

use ndarray::Array2;

use super::evidence::Belief;
use super::movement_table::Place;
use super::recogniser::Recogniser;
use super::rotations::{Layout, Matrix};
use super::triangle::square;
use crate::error::Result;
use crate::model::coordinates::Rotation;
use crate::numerics::rotation::{Quaternion, Vector, add_scaled, dot, on_side_of};
use crate::numerics::simd::{F64x4, WIDTH};
use crate::validate::{check_length, check_number, check_range, row_major_mut, zeros};

/// Positions to come.
#[derive(Clone, Debug, PartialEq)]
pub struct Continuation {
    /// Times (T,), in seconds, on the clock of the observations.
    pub time: Vec<f64>,
    /// Mean positions (T, n_q). The signs of quaternions are continuous.
    pub position: Array2<f64>,
    /// Standard deviations (T, D), scaled so that 90 % of held-out positions lie within 1.645 of them. Those of a rotation are
    /// of the components of the rotation vector in rad from the mean, in the frame of angular velocities.
    pub deviation: Array2<f64>,
}

impl Recogniser {
    /// Predicts the positions at times (T,) in seconds, from the last observation on. A movement that is stopped goes on at
    /// once.
    ///
    /// # Errors
    /// A time before the last observation or not finite, and as for [`Recogniser::estimate`].
    pub fn continuation(&mut self, time: &[f64]) -> Result<Continuation> {
        let [mut position, mut deviation] = [
            zeros("continuation", (time.len(), self.layout.n_coordinates))?,
            zeros("continuation", (time.len(), self.layout.n_dofs))?,
        ];
        self.write_continuation(time, row_major_mut(&mut position), row_major_mut(&mut deviation))?;
        Ok(Continuation { time: time.to_vec(), position, deviation })
    }

    /// Writes the positions (T·n_q,) and their standard deviations (T·D,), by times, as [`Self::continuation`] returns them.
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
        let Layout { n_coordinates, n_dofs, .. } = self.layout;
        check_length("deviation", deviation.len(), time.len() * n_dofs, "DoF of each time")?;
        self.write_mean(time, position)?;
        let duration = self.estimate()?.duration;
        let factor = self.factors(duration).position;
        deviation.fill(0.0);
        let sum = self.sum_of_weights();
        self.ahead(time, |layout, predicted| {
            let position = &position[predicted.index * n_coordinates..][..n_coordinates];
            let deviation = &mut deviation[predicted.index * n_dofs..][..n_dofs];
            for &[column, d] in &layout.plain {
                deviation[d] += predicted.square(d, predicted.mean[d] - F64x4::splat(position[column])) / sum;
            }
            for rotation in layout.rotations() {
                predicted.add_turns(layout, rotation, rotation.columns.read(position), sum, deviation);
            }
        });
        deviation.iter_mut().for_each(|square| *square = factor * square.sqrt());
        Ok(())
    }

    /// Predicts the mean positions (T, n_q) as [`Self::continuation`] does.
    ///
    /// # Errors
    /// As for [`Self::continuation`].
    pub(crate) fn mean_continuation(&mut self, time: &[f64]) -> Result<Array2<f64>> {
        let mut position: Array2<f64> = zeros("continuation", (time.len(), self.layout.n_coordinates))?;
        self.write_mean(time, row_major_mut(&mut position))?;
        Ok(position)
    }

    /// Writes the mean positions (T·n_q,).
    ///
    /// # Errors
    /// As for [`Self::write_continuation`].
    fn write_mean(&mut self, time: &[f64], position: &mut [f64]) -> Result<()> {
        let n_coordinates = self.layout.n_coordinates;
        let per = if self.layout.rotations().is_empty() { "DoF of each time" } else { "coordinate of each time" };
        check_length("position", position.len(), time.len() * n_coordinates, per)?;
        self.weigh()?;
        let [_, last] = self.times.unwrap_or_default();
        for (index, &t) in time.iter().enumerate() {
            check_number("time", index, t)?;
            check_range("time", t, t >= last, "must not be before the last observation")?;
        }
        position.fill(0.0);
        let sum = self.sum_of_weights();
        self.ahead(time, |layout, predicted| {
            let position = &mut position[predicted.index * n_coordinates..][..n_coordinates];
            for &[column, d] in &layout.plain {
                position[column] += (predicted.belief.weight * predicted.mean[d]).reduce_add() / sum;
            }
            for rotation in layout.rotations() {
                predicted.for_each_rotation(layout, rotation, |weight, _, q| {
                    // The quaternions of a movement that turns several times differ in their signs.
                    let before = rotation.columns.read(position);
                    rotation.columns.write(add_scaled(before, weight, on_side_of(q, before)), position);
                });
            }
        });
        for rotation in self.layout.rotations() {
            let mut before = [0.0; 4];
            for position in position.chunks_exact_mut(n_coordinates) {
                let q = rotation.columns.read(position);
                let norm = dot(q, q).sqrt();
                before = on_side_of(q.map(|x| x / norm), before);
                rotation.columns.write(before, position);
            }
        }
        Ok(())
    }

    /// Calls a function with the predictions of four hypotheses after four for every time.
    fn ahead(&mut self, time: &[f64], mut predicted: impl FnMut(&Layout, &mut Predicted)) {
        let [_, last] = self.times.unwrap_or_default();
        let (q, width) = (self.table.n_directions, self.table.width);
        let Self { table, noise, rows, clock, layout, lanes, variances, .. } = self;
        for ((belief, sums), four) in self.beliefs.iter().zip(&self.sums).zip(&self.fours) {
            if !belief.counts() {
                continue;
            }
            let along = |values: &[F64x4]| {
                values.iter().zip(&belief.mean).fold(F64x4::ZERO, |sum, (value, mean)| sum + *value * *mean)
            };
            for (index, t) in time.iter().enumerate() {
                let places = table.places(four.fraction(*clock + (t - last)));
                for (d, process) in sums.processes.chunks_exact(width).enumerate() {
                    let row = &mut rows[d * width..][..width];
                    table.rows::<F64x4>(&places, d, row);
                    let (decay, variance) = noise.ahead(t - last, d);
                    let residual = process[q] - along(process);
                    lanes[d] = row[q] + along(row) + residual * F64x4::splat(decay);
                    variances[d] = variance;
                }
                predicted(layout, &mut Predicted { index, belief, places, mean: lanes, variances, rows, width });
            }
        }
    }

    fn sum_of_weights(&self) -> f64 {
        self.beliefs.iter().filter(|belief| belief.counts()).map(|belief| belief.weight.reduce_add()).sum()
    }
}

/// Prediction of four hypotheses at one time.
struct Predicted<'a> {
    /// Index of the time.
    index: usize,
    belief: &'a Belief,
    places: [Place; WIDTH],
    /// Mean DoFs (D,).
    mean: &'a [F64x4],
    /// Variances of the residual (D,).
    variances: &'a [f64],
    /// Rows (D, w) of the table.
    rows: &'a mut [F64x4],
    width: usize,
}

impl Predicted<'_> {
    /// Returns the sum over the hypotheses of the mean square of a DoF about a position from which its mean deviates by an
    /// error.
    fn square(&self, d: usize, error: F64x4) -> f64 {
        let row = &self.rows[d * self.width..][..self.belief.mean.len()];
        let variance = error * error + square::<F64x4>(&self.belief.covariance, row) + F64x4::splat(self.variances[d]);
        (self.belief.weight * variance).reduce_add()
    }

    /// Calls a function with weight, rotation vector and rotation of each hypothesis that has a weight, and its lane.
    fn for_each_rotation(
        &self,
        layout: &Layout,
        rotation: &Rotation,
        mut visit: impl FnMut(f64, (Vector, usize), Quaternion),
    ) {
        for (lane, weight) in self.belief.weight.to_array().into_iter().enumerate() {
            if weight > 0.0 {
                let (delta, q) = layout.turned(rotation, self.places[lane], self.mean, lane);
                visit(weight, (delta, lane), q);
            }
        }
    }

    /// Adds the mean squares of a rotation about a mean, as a share of the sum of the weights. The rows of its DoFs become
    /// those of rotation vectors.
    fn add_turns(&mut self, layout: &Layout, rotation: &Rotation, mean: Quaternion, sum: f64, squares: &mut [f64]) {
        let (first, width) = (rotation.dof, self.width);
        let mut maps = [[F64x4::ZERO; 3]; 3];
        let mut errors = [F64x4::ZERO; 3];
        self.for_each_rotation(layout, rotation, |_, (delta, lane), q| {
            let (map, error): (Matrix, Vector) = (layout.tangent(delta, q), layout.turn(mean, q));
            for i in 0..3 {
                errors[i].as_mut_array()[lane] = error[i];
                for j in 0..3 {
                    maps[i][j].as_mut_array()[lane] = map[i][j];
                }
            }
        });
        let rows = &mut self.rows[first * width..][..3 * width];
        for k in 0..self.belief.mean.len() {
            let own = [0, 1, 2].map(|j| rows[j * width + k]);
            for i in 0..3 {
                rows[i * width + k] = maps[i][0] * own[0] + maps[i][1] * own[1] + maps[i][2] * own[2];
            }
        }
        for i in 0..3 {
            let residuals = maps[i].iter().zip(&self.variances[first..]).map(|(x, v)| *x * *x * F64x4::splat(*v));
            let residual = residuals.fold(F64x4::ZERO, |sum, x| sum + x);
            let row = &rows[i * width..][..self.belief.mean.len()];
            let variance = errors[i] * errors[i] + square::<F64x4>(&self.belief.covariance, row) + residual;
            squares[first + i] += (self.belief.weight * variance).reduce_add() / sum;
        }
    }
}
