//! Vector-Jacobian products of batches: gradients of a function of many movements by their conditions.
//!
//! For a function L of the movements with v⁽ᵏ⁾ = ∂L/∂y⁽ᵏ⁾ (T, D), and inner products ⟨·,·⟩ over time and orders k,
//!
//! ```text
//! a_j[d] = ⟨v, Rⱼ⟩[d],  e[d] = ⟨v, E⟩[d],  n[d] = ⟨v, V⟩[d],  q[d] = ⟨v, G⟩[d],  c[d] = Σₜ v⁽⁰⁾[t, d]
//! ∂L/∂sⱼ = r₀ Σ_d (a_j − e·Rⱼ(0) − n·Ṙⱼ(0))        ∂L/∂r₀ = Σⱼ sⱼ(∂L/∂sⱼ)/r₀
//! ∂L/∂g = c − e      ∂L/∂y(0) = e      ∂L/∂ẏ(0) = n      ∂L/∂ẏ_g = q
//! ∂L/∂τ = (−Σₖ k⟨v⁽ᵏ⁾, y⁽ᵏ⁾⟩ − Σₖ⟨t·v⁽ᵏ⁾, y⁽ᵏ⁺¹⁾⟩ + n·ẏ(0) + q·ẏ_g)/τ
//! ```
//!
//! with the unit responses of `unit_responses` and, for k = 2, the third derivative of the movement (`third_derivative` of the
//! controller). The loops are those of `superposition`, transposed: no Jacobian is formed.
//! Movements that differ in τ, in phase or in segment durations have no responses in common; the products of each are those of
//! `transposed_rollout`. With rotations, cotangents are converted to the degrees of freedom first, and gradients by positions and
//! velocities back to coordinates (`batch_poses`).

use std::ops::Range;

use ndarray::{Array2, ArrayView3, ArrayViewMut1, ArrayViewMut2, Axis, aview1, s};

use crate::error::{Error, Result};
use crate::model::responses::{Curves, Derivative};
use crate::motion::batch::{BLOCK, Batch, MIN_MOVEMENTS_PER_BLOCK, PROGRESS_INTERVAL};
use crate::motion::batch_conditions::PerMovement;
use crate::motion::batch_singles::Singles;
use crate::motion::jacobian::WithRespectTo;
use crate::motion::response_products::{Product, timed_dot};
use crate::motion::superposition::{Combination, Tile, tile_size};
use crate::motion::unit_responses::third_derivatives;
use crate::numerics::threads::Threads;
use crate::validate::{row_major, zeros};

impl Batch {
    /// Computes the gradients of a function L of the movements of a range with respect to their conditions.
    ///
    /// `cotangents` are the derivatives ∂L/∂y, ∂L/∂ẏ and ∂L/∂ÿ of L by positions, velocities and accelerations, one to
    /// three arrays (n, T, D); the orders left out do not enter L. The result has a matrix for each of `variables`: (n, J)
    /// for the style, (n, 1) for amplitude and τ, else (n, D), row b being the gradient by the condition of movement b. A
    /// condition that all movements share has the sum of the rows as its gradient. The gradients equal
    /// Σ v·∂y/∂v with the Jacobians of [`crate::motion::jacobian`], to rounding.
    ///
    /// In a model with rotations, cotangents of positions and gradients by goals, anchors and starts have a column for each
    /// coordinate. The gradient by a unit quaternion q is that of L as a function of q/|q|, orthogonal to q; of cotangents of a
    /// quaternion the part along it has no effect. Cotangents and gradients of velocities are those of angular velocities, in
    /// the frame of the model.
    ///
    /// `progress` is called periodically with the completed fraction; an error it returns cancels the call.
    ///
    /// ```
    /// # use ndarray::{Axis, array};
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # use pdmp_core::model::Derivative;
    /// # use pdmp_core::motion::{BatchConditions, PerMovement, TimeGrid, WithRespectTo, batch};
    /// # use pdmp_core::numerics::Threads;
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let goals = PerMovement::Each(array![[1.0, 0.0], [1.2, 0.1]]);
    /// let conditions = BatchConditions { goal: Some(goals), ..BatchConditions::default() };
    /// let batch = batch(model.primitive(), conditions, TimeGrid { dt: 0.01, duration: None }, &mut |_| Ok(()))?;
    /// let movements = batch.rollouts(0..2, Derivative::Position, Threads::ONE, &mut |_| Ok(()))?;
    /// // L = ½ Σ y².
    /// let cotangents = [movements.position.view()];
    /// let variables = [WithRespectTo::Style, WithRespectTo::Goal];
    /// let gradients = batch.vector_jacobian(0..2, &variables, &cotangents, Threads::ONE, &mut |_| Ok(()))?;
    /// assert_eq!(gradients[0].dim(), (2, model.n_styles()));
    /// assert_eq!(gradients[1].dim(), (2, 2));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A range beyond the batch; cotangents of another number or shape, or that are not finite; a variable of the other
    /// kind of primitive, or a velocity or start that the batch does not have; τ with segment durations, or with accelerations
    /// of rotations; or the error of `progress`.
    pub fn vector_jacobian(
        &self,
        movements: Range<usize>,
        variables: &[WithRespectTo],
        cotangents: &[ArrayView3<f64>],
        threads: Threads,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Vec<Array2<f64>>> {
        self.check_cotangents(&movements, variables, cotangents)?;
        let (_, n_samples, n_dofs) = self.shape();
        let columns = |variable: &WithRespectTo| match variable {
            WithRespectTo::Style => self.n_styles(),
            WithRespectTo::Amplitude | WithRespectTo::Tau => 1,
            WithRespectTo::Velocity | WithRespectTo::GoalVelocity => n_dofs,
            _ => self.n_columns(Derivative::Position),
        };
        let new = |variable| zeros("gradients", (movements.len(), columns(variable)));
        let mut gradients = variables.iter().map(new).collect::<Result<Vec<_>>>()?;
        let by_tau = variables.contains(&WithRespectTo::Tau);
        let time: Vec<f64> = match by_tau {
            true => (0..n_samples).flat_map(|k| std::iter::repeat_n(k as f64 * self.dt, n_dofs)).collect(),
            false => Vec::new(),
        };
        let by_accelerations = by_tau && cotangents.len() > 2 && self.singles.is_none();
        let third = by_accelerations
            .then(|| third_derivatives(&self.primitive, &self.responses, self.tau, self.forcing.as_ref(), self.dt));
        // With rotations, the products of a change of τ are those in coordinates.
        let work = Contraction { batch: self, time, by_tau: by_tau && self.poses.is_none(), third: third.transpose()? };
        let in_block = (BLOCK / (n_samples * n_dofs)).max(MIN_MOVEMENTS_PER_BLOCK);
        let mut outputs: Vec<_> =
            gradients.iter_mut().map(|rows| rows.axis_chunks_iter_mut(Axis(0), in_block)).collect();
        let mut blocks = (0..movements.len())
            .step_by(in_block)
            .map(|first| (first, outputs.iter_mut().filter_map(Iterator::next).collect::<Vec<ArrayViewMut2<f64>>>()));
        loop {
            let next: Vec<_> = blocks.by_ref().take(PROGRESS_INTERVAL * threads.get()).collect();
            let Some((first, _)) = next.first() else { break };
            progress(*first as f64 / movements.len() as f64)?;
            threads.try_for_each(next, |(first, mut outputs)| {
                let at = first..(first + in_block).min(movements.len());
                let cotangents: Vec<_> = cotangents.iter().map(|array| array.slice(s![at.clone(), .., ..])).collect();
                let products = work.products(movements.start + first, &cotangents, by_tau)?;
                for (i, product) in products.iter().enumerate() {
                    for (variable, output) in variables.iter().zip(&mut outputs) {
                        self.write_gradient(movements.start + first + i, *variable, product, output.row_mut(i))?;
                    }
                }
                Ok(())
            })?;
        }
        drop(blocks);
        drop(outputs);
        Ok(gradients)
    }

    /// Checks the arguments of [`Batch::vector_jacobian`], whose numbers are checked in the gradients.
    fn check_cotangents(
        &self,
        movements: &Range<usize>,
        variables: &[WithRespectTo],
        cotangents: &[ArrayView3<f64>],
    ) -> Result<()> {
        let (n_movements, n_samples, _) = self.shape();
        let wrong = |name, problem| Err(Error::Argument { name, problem });
        if movements.end > n_movements {
            let value = movements.end as f64;
            return Err(Error::Range { name: "movements", value, allowed: "exceeds the number of movements" });
        }
        let mut orders = Derivative::ALL.map(|order| (movements.len(), n_samples, self.n_columns(order))).into_iter();
        if cotangents.is_empty() || cotangents.iter().any(|array| Some(array.dim()) != orders.next()) {
            return wrong(
                "cotangents",
                "must be one to three arrays (movements, samples, DoFs) of the batch, that of positions with its coordinates",
            );
        }
        for variable in variables {
            self.poses.as_ref().map_or(Ok(()), |poses| poses.check(*variable, cotangents.len()))?;
            variable.check(self.kind)?;
            if *variable == WithRespectTo::Tau && self.singles.as_ref().is_some_and(Singles::is_warped) {
                return wrong(
                    "tau",
                    "does not apply to movements that follow segment_durations, which are given in place of it: pass tau \
                     instead of them to differentiate by it",
                );
            }
            let (name, given) = match variable {
                WithRespectTo::Start => ("start", self.starts.is_some()),
                WithRespectTo::Velocity => ("velocity", self.velocities.is_some()),
                WithRespectTo::GoalVelocity => ("goal_velocity", self.goal_velocities.is_some()),
                _ => continue,
            };
            if !given {
                return wrong(name, "is not among the conditions: pass it to differentiate with respect to it");
            }
        }
        Ok(())
    }

    /// Writes the gradient by one condition of movement `b`.
    fn write_gradient(
        &self,
        b: usize,
        variable: WithRespectTo,
        product: &Product,
        mut gradient: ArrayViewMut1<f64>,
    ) -> Result<()> {
        let Product { centre, start, velocity, goal_velocity, .. } = product;
        let unit_style = |j: usize| {
            let mut sum = product.styles[j];
            for (given, derivative, products) in [
                (self.starts.is_some(), Derivative::Position, start),
                (self.velocities.is_some(), Derivative::Velocity, velocity),
            ] {
                // The products of movements of a timing of their own are net of both.
                if given && self.singles.is_none() {
                    let at_start = self.responses.of(derivative).styles[j].row(0);
                    sum -= at_start.iter().zip(products).fold(0.0, |sum, (r, product)| sum + r * product);
                }
            }
            sum
        };
        let dot = |rows: &Option<PerMovement>, products: &[f64]| {
            rows.as_ref().map_or(0.0, |rows| rows.row(b).iter().zip(products).fold(0.0, |sum, (v, p)| sum + v * p))
        };
        match (variable, &self.poses) {
            (WithRespectTo::Style, _) => {
                gradient.indexed_iter_mut().for_each(|(j, to)| *to = self.amplitudes.row(b)[0] * unit_style(j))
            }
            (WithRespectTo::Amplitude, _) => {
                gradient[0] = self.styles.row(b).indexed_iter().fold(0.0, |sum, (j, s)| sum + s * unit_style(j));
            }
            (_, Some(poses)) => self.write_pose_gradient(poses, b, variable, product, gradient.view_mut())?,
            (WithRespectTo::Goal | WithRespectTo::Anchor, _) if self.starts.is_some() => {
                gradient.indexed_iter_mut().for_each(|(d, to)| *to = centre[d] - start[d]);
            }
            (WithRespectTo::Goal | WithRespectTo::Anchor, _) => gradient.assign(&aview1(centre)),
            (WithRespectTo::Start, _) => gradient.assign(&aview1(start)),
            (WithRespectTo::Velocity, _) => gradient.assign(&aview1(velocity)),
            (WithRespectTo::GoalVelocity, _) => gradient.assign(&aview1(goal_velocity)),
            (WithRespectTo::Tau, _) => {
                let given = dot(&self.velocities, velocity) + dot(&self.goal_velocities, goal_velocity);
                gradient[0] = (given - product.scaled_time) / self.tau_of(b);
            }
        }
        if gradient.iter().all(|value| value.is_finite()) {
            return Ok(());
        }
        let problem = "must be finite, and so small that the gradients do not overflow";
        Err(Error::Argument { name: "cotangents", problem })
    }
}

/// Settings of the products of all blocks.
struct Contraction<'a> {
    batch: &'a Batch,
    /// Times (T·D,) of the elements of a movement, if τ is a variable.
    time: Vec<f64>,
    by_tau: bool,
    /// Third derivatives of the responses, if τ is a variable of accelerations.
    third: Option<&'a Curves>,
}

impl Contraction<'_> {
    /// Returns the products of consecutive movements from `first` on with their cotangents, in DoFs.
    fn products(&self, first: usize, cotangents: &[ArrayView3<f64>], by_tau: bool) -> Result<Vec<Product>> {
        let of_dofs = |cotangents: &[ArrayView3<f64>]| match &self.batch.singles {
            Some(singles) => singles.products(first, cotangents, self.by_tau),
            None => Ok(self.block(first, cotangents)),
        };
        let Some(poses) = &self.batch.poses else { return of_dofs(cotangents) };
        let found = self.batch.pull_back(poses, first, cotangents, by_tau)?;
        let mut products = of_dofs(&found.orders.iter().map(|array| array.view()).collect::<Vec<_>>())?;
        products.iter_mut().zip(found.scaled_times).for_each(|(product, sum)| product.scaled_time = sum);
        Ok(products)
    }

    /// Returns the products of consecutive movements from `first` on with their cotangents.
    fn block(&self, first: usize, cotangents: &[ArrayView3<f64>]) -> Vec<Product> {
        let batch = self.batch;
        let (_, n_samples, n_dofs) = batch.shape();
        let n_styles = batch.responses.of(Derivative::Position).styles.len();
        let combinations: Vec<Combination> =
            (first..first + cotangents[0].len_of(Axis(0))).map(|b| batch.combination(b)).collect();
        let Some(period) = combinations.first().map(|combination| combination.centre.len()) else { return Vec::new() };
        let (length, tile) = (n_samples * n_dofs, tile_size(period));
        let has_velocity = batch.velocities.is_some();
        let mut totals = vec![Product::zeros(n_styles, period); combinations.len()];
        let (zeros, mut buffer) = (vec![0.0; period], vec![0.0; tile]);
        for (order, cotangents) in Derivative::ALL.into_iter().zip(cotangents) {
            let cotangents = cotangents.as_standard_layout();
            let mut products = vec![Product::zeros(n_styles, period); combinations.len()];
            for from in (0..length).step_by(tile) {
                let at = from..(from + tile).min(length);
                let part = Tile::new(batch.responses.of(order), at.clone());
                let slope = match Derivative::ALL.get(order as usize + 1) {
                    Some(slope) => Some(batch.responses.of(*slope)).filter(|_| self.by_tau),
                    None => self.third,
                };
                let slope = slope.map(|curves| Tile::new(curves, at.clone()));
                let movements = combinations.iter().zip(&mut products).zip(row_major(&cotangents).chunks(length));
                for ((combination, product), v) in movements {
                    let v = &v[at.clone()];
                    product.add(&part, v, order == Derivative::Position, has_velocity);
                    if let Some(slope) = &slope {
                        let slopes = &mut buffer[..at.len()];
                        slope.sum(combination, &zeros, slopes);
                        product.scaled_time += timed_dot(slopes, v, &self.time[at.clone()]);
                    }
                }
            }
            for ((total, mut product), combination) in totals.iter_mut().zip(products).zip(&combinations) {
                if self.by_tau && order != Derivative::Position {
                    product.scaled_time += product.with(combination) * f64::from(order as u8);
                }
                total.add_all(&product);
            }
        }
        totals.iter().map(|total| total.folded(n_dofs)).collect()
    }
}
