//! Batches of rollouts: linear combinations of shared unit responses.

use std::ops::Range;
use std::sync::Arc;

use ndarray::{ArrayViewMut3, Axis};

use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::model::responses::{Derivative, Responses};
use crate::motion::batch_conditions::{BatchConditions, PerMovement};
use crate::motion::batch_poses::Poses;
use crate::motion::batch_singles::Singles;
use crate::motion::rollout::TimeGrid;
use crate::motion::superposition::{self, Combination};
use crate::motion::trajectory::Trajectories;
use crate::motion::unit_responses::responses;
use crate::numerics::threads::Threads;
use crate::validate::{check_range, zeros};

/// Number of elements of each output that one thread writes per block.
pub(super) const BLOCK: usize = 1 << 17;
/// Minimum number of movements per block, so that a tile of the responses is read from cache several times.
pub(super) const MIN_MOVEMENTS_PER_BLOCK: usize = 8;
/// Number of blocks per thread between two calls of `progress`.
pub(super) const PROGRESS_INTERVAL: usize = 16;

/// Checked movements of a batch, ready to be computed as a whole or in parts, with bitwise equal results.
///
/// ```
/// # use ndarray::Array2;
/// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
/// # use pdmp_core::model::Derivative;
/// # use pdmp_core::motion::{BatchConditions, PerMovement, TimeGrid, batch};
/// # use pdmp_core::numerics::Threads;
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let styles = Array2::from_shape_fn((1000, model.n_styles()), |(b, _)| b as f64 / 1000.0);
/// let conditions = BatchConditions { style: Some(PerMovement::Each(styles)), ..BatchConditions::default() };
/// let batch = batch(model.primitive(), conditions, TimeGrid { dt: 0.01, duration: None }, &mut |_| Ok(()))?;
/// for movements in batch.chunks(300)? {
///     let n = movements.len();
///     let trajectories = batch.rollouts(movements, Derivative::Velocity, Threads::ONE, &mut |_| Ok(()))?;
///     assert_eq!(trajectories.position.dim(), (n, 101, 2));
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Batch {
    pub(super) responses: Arc<Responses>,
    n_movements: usize,
    pub(super) kind: Kind,
    pub(super) styles: PerMovement,
    /// Goals of discrete, anchors of rhythmic movements.
    centres: PerMovement,
    pub(super) starts: Option<PerMovement>,
    pub(super) velocities: Option<PerMovement>,
    pub(super) goal_velocities: Option<PerMovement>,
    /// Amplitudes r₀ (1,).
    pub(super) amplitudes: PerMovement,
    /// Additional forcing, whose displacement then is that of the last curves of the responses.
    pub(super) forcing: Option<Arc<AdditionalForcing>>,
    pub(super) tau: f64,
    /// Sampling interval, in s.
    pub(super) dt: f64,
    /// Primitive of the responses, in degrees of freedom.
    pub(super) primitive: Arc<Primitive>,
    /// Primitive and conditions in coordinates with rotations.
    pub(super) poses: Option<Poses>,
    /// Movements of different timings, which share no responses; those of the batch are then empty.
    pub(super) singles: Option<Singles>,
    n_samples: usize,
    n_dofs: usize,
}

/// Checks the conditions of a batch and computes the unit responses, unless the primitive has them in its cache.
///
/// Movements that differ in τ, follow segment durations, or start at a phase have no response curves in common: each is
/// then a [`crate::rollout`], to the bit. All are sampled at the same times, without a duration up to that of the longest
/// movement; the others continue past their end as a rollout does, discrete ones at rest on their goal.
///
/// `progress` is called periodically with the completed fraction; an error it returns cancels the call.
///
/// # Errors
/// Conditions or times that do not fit the primitive, numbers of rows that differ, or the error of `progress`.
pub fn batch(
    primitive: &Arc<Primitive>,
    conditions: BatchConditions,
    grid: TimeGrid,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Batch> {
    let (outside, primitive) = (primitive, primitive.inside());
    let (conditions, given) = match outside.coordinates() {
        Some(coordinates) => (conditions.clone().in_dofs(coordinates)?, Some(conditions)),
        None => (conditions, None),
    };
    let n_movements = conditions.check(primitive)?;
    let tau = conditions.common_tau(primitive, n_movements)?;
    let singles = match tau {
        Some(_) => None,
        None => Some(Singles::new(outside, given.as_ref().unwrap_or(&conditions).movements(n_movements), grid)?),
    };
    let BatchConditions { style, goal, anchor, start, velocity, goal_velocity, amplitude, forcing, .. } = conditions;
    let nominal = Conditions { tau, ..Conditions::default() }.complete(primitive)?;
    let n_samples = match &singles {
        Some(singles) => singles.n_samples()?,
        None => grid.steps(primitive, nominal.tau)? + 1,
    };
    let mut responses = match &singles {
        Some(_) => Arc::new(Responses::none()),
        None => responses(primitive, nominal.tau, goal_velocity.is_some(), grid, progress)?,
    };
    if let (None, Some(forcing)) = (&singles, &forcing) {
        responses = Arc::new(responses.with_forcing(forcing, grid.dt / nominal.tau, 1.0 / nominal.tau));
    }
    Ok(Batch {
        singles,
        n_samples,
        n_dofs: primitive.n_dofs(),
        responses,
        forcing,
        primitive: Arc::clone(primitive),
        n_movements,
        kind: primitive.kind(),
        styles: style.unwrap_or(PerMovement::All(nominal.style)),
        centres: goal.or(anchor).unwrap_or(PerMovement::All(nominal.centre)),
        starts: start.or(nominal.start.map(PerMovement::All)),
        velocities: velocity,
        goal_velocities: goal_velocity,
        amplitudes: amplitude.unwrap_or(PerMovement::All(vec![nominal.amplitude])),
        tau: nominal.tau,
        dt: grid.dt,
        poses: given.map(|conditions| Poses { primitive: Arc::clone(outside), conditions }),
    })
}

impl Batch {
    /// Returns the numbers of movements B, samples T and degrees of freedom D.
    pub fn shape(&self) -> (usize, usize, usize) {
        (self.n_movements, self.n_samples, self.n_dofs)
    }

    /// Returns the number of style parameters.
    pub(super) fn n_styles(&self) -> usize {
        self.styles.row(0).len()
    }

    /// Returns τ of movement `b`, in seconds.
    pub(super) fn tau_of(&self, b: usize) -> f64 {
        self.singles.as_ref().map_or(self.tau, |singles| singles.tau(b))
    }

    /// Returns the number of columns of positions, or of a derivative: coordinates or DoFs.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # use pdmp_core::model::Derivative;
    /// # use pdmp_core::motion::{BatchConditions, TimeGrid, batch};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let grid = TimeGrid { dt: 0.01, duration: None };
    /// let batch = batch(model.primitive(), BatchConditions::default(), grid, &mut |_| Ok(()))?;
    /// assert_eq!(batch.n_columns(Derivative::Position), model.n_coordinates());
    /// # Ok(())
    /// # }
    /// ```
    pub fn n_columns(&self, derivative: Derivative) -> usize {
        match &self.poses {
            Some(poses) if derivative == Derivative::Position => poses.primitive.n_coordinates(),
            _ => self.shape().2,
        }
    }

    /// Returns consecutive ranges of `size` movements, the last one possibly shorter, to compute the batch in parts by
    /// [`Batch::rollouts`] or [`Batch::write`].
    ///
    /// # Errors
    /// A size of zero.
    pub fn chunks(&self, size: usize) -> Result<BatchChunks> {
        check_range("size", size as f64, size > 0, "must be at least 1")?;
        Ok(BatchChunks { remaining: 0..self.n_movements, size })
    }

    /// Computes a range of the movements: positions and their derivatives up to `highest`, each (n, T, D).
    ///
    /// ```
    /// # use ndarray::array;
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # use pdmp_core::model::Derivative;
    /// # use pdmp_core::motion::{BatchConditions, PerMovement, TimeGrid, batch};
    /// # use pdmp_core::numerics::Threads;
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let goals = PerMovement::Each(array![[1.0, 0.0], [1.2, 0.1], [0.8, 0.3]]);
    /// let styles = PerMovement::Each(model.demonstrated().styles.clone());
    /// let conditions = BatchConditions { style: Some(styles), goal: Some(goals), ..BatchConditions::default() };
    /// let batch = batch(model.primitive(), conditions, TimeGrid { dt: 0.01, duration: None }, &mut |_| Ok(()))?;
    /// let movements = batch.rollouts(0..3, Derivative::Position, Threads::available(), &mut |_| Ok(()))?;
    /// assert_eq!(movements.position.dim(), (3, 101, 2));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As for [`Batch::write`], or outputs that do not fit into memory.
    pub fn rollouts(
        &self,
        movements: Range<usize>,
        highest: Derivative,
        threads: Threads,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Trajectories> {
        let (_, n_samples, _) = self.shape();
        let new = |order: Derivative| zeros("rollouts", (movements.len(), n_samples, self.n_columns(order)));
        let derivative = |order: Derivative| (order as usize <= highest as usize).then(|| new(order)).transpose();
        let mut position = new(Derivative::Position)?;
        let (mut velocity, mut acceleration) =
            (derivative(Derivative::Velocity)?, derivative(Derivative::Acceleration)?);
        let outputs = [Some(&mut position), velocity.as_mut(), acceleration.as_mut()];
        let outputs = outputs.into_iter().flatten().map(|output| output.view_mut()).collect();
        self.write(movements, outputs, threads, progress)?;
        Ok(Trajectories { position, velocity, acceleration })
    }

    /// Writes a range of n movements to up to three `outputs` (n, T, D): positions, velocities and accelerations.
    ///
    /// `progress` is called periodically with the completed fraction; an error it returns cancels the call.
    ///
    /// ```
    /// # use ndarray::Array3;
    /// # use pdmp_core::motion::Batch;
    /// # use pdmp_core::numerics::Threads;
    /// fn positions(batch: &Batch) -> pdmp_core::Result<Array3<f64>> {
    ///     let mut positions = Array3::zeros(batch.shape());
    ///     batch.write(0..batch.shape().0, vec![positions.view_mut()], Threads::available(), &mut |_| Ok(()))?;
    ///     Ok(positions)
    /// }
    /// ```
    ///
    /// # Errors
    /// A range beyond the batch, outputs of another shape or number, or the error of `progress`.
    pub fn write(
        &self,
        movements: Range<usize>,
        mut outputs: Vec<ArrayViewMut3<f64>>,
        threads: Threads,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<()> {
        let (n_movements, n_samples, n_dofs) = self.shape();
        let mut expected = Derivative::ALL.map(|order| (movements.len(), n_samples, self.n_columns(order))).into_iter();
        if movements.end > n_movements {
            let value = movements.end as f64;
            return Err(Error::Range { name: "movements", value, allowed: "exceeds the number of movements" });
        }
        if outputs.len() > 3 || outputs.iter().any(|output| Some(output.dim()) != expected.next()) {
            return Err(Error::Argument {
                name: "outputs",
                problem: "must be at most three, each (movements, samples, DoFs) of the batch",
            });
        }
        let in_block = (BLOCK / (n_samples * n_dofs)).max(MIN_MOVEMENTS_PER_BLOCK);
        let mut chunks: Vec<_> =
            outputs.iter_mut().map(|output| output.axis_chunks_iter_mut(Axis(0), in_block)).collect();
        let mut blocks = movements
            .clone()
            .step_by(in_block)
            .map(|first| (first, chunks.iter_mut().filter_map(Iterator::next).collect::<Vec<ArrayViewMut3<f64>>>()));
        loop {
            let next: Vec<_> = blocks.by_ref().take(PROGRESS_INTERVAL * threads.get()).collect();
            let Some((first, _)) = next.first() else { return Ok(()) };
            progress((first - movements.start) as f64 / movements.len() as f64)?;
            threads.try_for_each(next, |(first, mut outputs)| match &self.singles {
                Some(singles) => singles.write(first, &mut outputs),
                None => self.write_block(first, outputs),
            })?;
        }
    }

    /// Writes one block, the movements from `first` on.
    fn write_block(&self, first: usize, outputs: Vec<ArrayViewMut3<f64>>) -> Result<()> {
        if let Some(poses) = &self.poses {
            return self.write_poses(poses, first, outputs);
        }
        let n = outputs.first().map_or(0, |output| output.len_of(Axis(0)));
        let combinations: Vec<Combination> = (first..first + n).map(|b| self.combination(b)).collect();
        for (derivative, output) in Derivative::ALL.into_iter().zip(outputs) {
            superposition::write(&combinations, self.responses.of(derivative), derivative, output);
        }
        Ok(())
    }

    /// Returns the coefficients of movement `b`.
    pub(super) fn combination(&self, b: usize) -> Combination {
        let displacement = self.forcing.is_some().then_some(1.0);
        let amplitude = self.amplitudes.row(b)[0];
        let style: Vec<f64> = self.styles.row(b).iter().map(|s| amplitude * s).chain(displacement).collect();
        let centre = self.centres.row(b).to_vec();
        // Difference of a condition from its value at the start of the sum of the styles.
        let difference = |condition: &Option<PerMovement>, derivative: Derivative, centre: &[f64]| match condition {
            Some(rows) => {
                let curves = &self.responses.of(derivative).styles;
                let row = rows.row(b);
                (0..centre.len())
                    .map(|d| {
                        row[d] - style.iter().zip(curves).fold(centre[d], |sum, (s, curve)| sum + s * curve[[0, d]])
                    })
                    .collect()
            }
            None => vec![0.0; centre.len()],
        };
        let start = difference(&self.starts, Derivative::Position, &centre);
        let velocity = difference(&self.velocities, Derivative::Velocity, &vec![0.0; centre.len()]);
        let goal_velocity = self.goal_velocities.as_ref().map(|rows| rows.row(b).to_vec());
        Combination::new(style, [&centre, &start, &velocity], goal_velocity.as_deref())
    }
}

/// Iterator over the ranges of movements that [`Batch::chunks`] returns.
#[derive(Clone, Debug)]
pub struct BatchChunks {
    remaining: Range<usize>,
    size: usize,
}

impl Iterator for BatchChunks {
    type Item = Range<usize>;

    fn next(&mut self) -> Option<Range<usize>> {
        let first = self.remaining.start;
        self.remaining.start += self.size.min(self.remaining.len());
        Some(first..self.remaining.start).filter(|chunk| !chunk.is_empty())
    }
}
