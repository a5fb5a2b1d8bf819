//! Many movements at once: sums of the same responses, each with its own coefficients.

use std::ops::Range;
use std::sync::Arc;

use ndarray::{Array2, Array3, ArrayView1, ArrayViewMut3, Axis, aview1};

use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::{Conditions, LARGEST_STYLE};
use crate::model::primitive::Primitive;
use crate::model::responses::{Derivative, Responses};
use crate::motion::rollout::Timing;
use crate::motion::superposition::Combination;
use crate::motion::unit_responses::responses;
use crate::numerics::threads::Threads;
use crate::validate::check_vector;
use crate::validate::{check_matrix, zeros};

/// Numbers that one thread writes into each output before it takes new work, and fewest movements among them: the
/// responses are read from cache memory for all of these.
const BLOCK: usize = 1 << 17;
const LEAST_IN_BLOCK: usize = 8;
/// Blocks for each thread between two questions whether to go on.
const PORTION: usize = 16;

/// A vector (D,) for all movements of a batch, or one for each.
#[derive(Clone, Debug, PartialEq)]
pub enum Rows {
    /// The same for all, (D,).
    All(Vec<f64>),
    /// One for each, (B, D).
    Each(Array2<f64>),
}

/// What the movements of a batch start with; what is `None` is that of the nominal demonstration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BatchConditions {
    /// Styles s (B, J).
    pub styles: Array2<f64>,
    /// Goals g, discrete.
    pub goals: Option<Rows>,
    /// Anchors y_a, rhythmic.
    pub anchors: Option<Rows>,
    /// Start positions; rhythmic movements otherwise start on their cycles.
    pub starts: Option<Rows>,
    /// Start velocities, per second; otherwise those of the demonstrations.
    pub velocities: Option<Rows>,
    /// Amplitude r₀ of all, rhythmic; otherwise 1.
    pub amplitude: Option<f64>,
    /// Time constant τ of all, in seconds.
    pub tau: Option<f64>,
}

/// Movements that are ready to be written, all or some at a time, with the same bits whichever way.
#[derive(Clone, Debug)]
pub struct Batch {
    responses: Arc<Responses>,
    styles: Array2<f64>,
    /// Goals or anchors.
    centres: Rows,
    starts: Option<Rows>,
    velocities: Option<Rows>,
    amplitude: f64,
}

/// Movements of many styles, checked and ready to be written.
///
/// `proceed` is told now and then the share that is done of responses which the model does not remember.
///
/// # Errors
/// Conditions or times that do not fit the model, another number of rows than there are styles, or whatever
/// `proceed` returns.
pub fn batch(
    primitive: &Arc<Primitive>,
    conditions: BatchConditions,
    timing: Timing,
    proceed: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Batch> {
    let BatchConditions { styles, goals, anchors, starts, velocities, amplitude, tau } = conditions;
    check_styles(&styles, primitive.n_styles())?;
    let kind = primitive.kind();
    let (centres, (name, other, instead)) = match kind {
        Kind::Discrete => (goals, ("anchors", anchors, ": they move to goals; set goals")),
        Kind::Rhythmic => (anchors, ("goals", goals, ": they move about anchors; set anchors")),
    };
    if other.is_some() {
        return Err(Error::Kind { name, kind, instead });
    }
    let centre = if kind == Kind::Discrete { "goals" } else { "anchors" };
    for (name, rows) in [(centre, &centres), ("starts", &starts), ("velocities", &velocities)] {
        if let Some(rows) = rows {
            rows.check(name, styles.nrows(), primitive.n_dofs())?;
        }
    }
    let nominal = Conditions { amplitude, tau, ..Conditions::default() }.complete(primitive)?;
    Ok(Batch {
        responses: responses(primitive, nominal.tau, timing, proceed)?,
        styles,
        centres: centres.unwrap_or(Rows::All(nominal.centre)),
        starts: starts.or(nominal.start.map(Rows::All)),
        velocities,
        amplitude: nominal.amplitude,
    })
}

/// Movements of many styles: positions and their derivatives up to `highest`, each (B, T, D).
///
/// # Errors
/// As for [`batch`], or movements that memory does not hold.
pub fn rollouts(
    primitive: &Arc<Primitive>,
    conditions: BatchConditions,
    timing: Timing,
    highest: Derivative,
    threads: Threads,
    proceed: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Vec<Array3<f64>>> {
    let batch = batch(primitive, conditions, timing, proceed)?;
    batch.rollouts(0..batch.shape().0, highest, threads, proceed)
}

impl Batch {
    /// Numbers of movements B, samples T and degrees of freedom D.
    pub fn shape(&self) -> (usize, usize, usize) {
        let (n_samples, n_dofs) = self.responses.of(Derivative::Position).start.dim();
        (self.styles.nrows(), n_samples, n_dofs)
    }

    /// The whole batch in pieces of `size` movements, the last perhaps shorter, for [`Batch::rollouts`] or
    /// [`Batch::write`]: so many are in memory at a time.
    ///
    /// # Errors
    /// A size of zero.
    pub fn chunks(&self, size: usize) -> Result<Chunks> {
        match size {
            0 => Err(Error::Range { name: "size", value: 0.0, allowed: "must be at least 1" }),
            _ => Ok(Chunks { left: 0..self.styles.nrows(), size }),
        }
    }

    /// Some of the movements: positions and their derivatives up to `highest`.
    ///
    /// # Errors
    /// Movements that memory does not hold, or whatever `proceed` returns.
    pub fn rollouts(
        &self,
        movements: Range<usize>,
        highest: Derivative,
        threads: Threads,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Vec<Array3<f64>>> {
        let (_, n_samples, n_dofs) = self.shape();
        let mut outputs = (0..=highest as usize)
            .map(|_| zeros("rollouts", (movements.len(), n_samples, n_dofs)))
            .collect::<Result<Vec<Array3<f64>>>>()?;
        self.write(movements, outputs.iter_mut().map(|output| output.view_mut()).collect(), threads, proceed)?;
        Ok(outputs)
    }

    /// Writes some of the movements where the caller wants them: positions, velocities and accelerations in this order,
    /// as many as there are outputs. `proceed` is told now and then the share that is done.
    ///
    /// # Errors
    /// Movements that the batch does not have, outputs of another shape, or whatever `proceed` returns.
    pub fn write(
        &self,
        movements: Range<usize>,
        mut outputs: Vec<ArrayViewMut3<f64>>,
        threads: Threads,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<()> {
        let (n_movements, n_samples, n_dofs) = self.shape();
        let shape = (movements.len(), n_samples, n_dofs);
        if movements.end > n_movements || outputs.len() > 3 || outputs.iter().any(|output| output.dim() != shape) {
            return Err(Error::Arguments(
                "outputs must be at most three, each (movements, samples, DoFs) of the batch",
            ));
        }
        let in_block = (BLOCK / (n_samples * n_dofs)).max(LEAST_IN_BLOCK);
        let mut chunks: Vec<_> =
            outputs.iter_mut().map(|output| output.axis_chunks_iter_mut(Axis(0), in_block)).collect();
        let mut blocks = movements
            .clone()
            .step_by(in_block)
            .map(|first| (first, chunks.iter_mut().filter_map(Iterator::next).collect::<Vec<ArrayViewMut3<f64>>>()));
        loop {
            let portion: Vec<_> = blocks.by_ref().take(PORTION * threads.get()).collect();
            let Some((first, _)) = portion.first() else { return Ok(()) };
            proceed((first - movements.start) as f64 / movements.len() as f64)?;
            threads.try_for_each(portion, |(first, outputs)| {
                self.write_block(first, outputs);
                Ok(())
            })?;
        }
    }

    /// Writes the movements from `first` on.
    fn write_block(&self, first: usize, outputs: Vec<ArrayViewMut3<f64>>) {
        let n = outputs.first().map_or(0, |output| output.len_of(Axis(0)));
        let combinations: Vec<Combination> = (first..first + n).map(|b| self.combination(b)).collect();
        for (derivative, output) in Derivative::ALL.into_iter().zip(outputs) {
            crate::motion::superposition::write(&combinations, self.responses.of(derivative), derivative, output);
        }
    }

    /// How a movement is made of the responses.
    fn combination(&self, b: usize) -> Combination {
        let style: Vec<f64> = self.styles.row(b).iter().map(|s| self.amplitude * s).collect();
        let centre = self.centres.row(b).to_vec();
        // What a given condition adds to that of the movement which starts as demonstrated.
        let beyond = |given: &Option<Rows>, derivative: Derivative, centre: &[f64]| match given {
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
        let start = beyond(&self.starts, Derivative::Position, &centre);
        let velocity = beyond(&self.velocities, Derivative::Velocity, &vec![0.0; centre.len()]);
        Combination::new(style, &centre, &start, &velocity)
    }
}

/// Pieces of a batch: see [`Batch::chunks`].
#[derive(Clone, Debug)]
pub struct Chunks {
    left: Range<usize>,
    size: usize,
}

impl Iterator for Chunks {
    type Item = Range<usize>;

    fn next(&mut self) -> Option<Range<usize>> {
        let first = self.left.start;
        self.left.start += self.size.min(self.left.len());
        Some(first..self.left.start).filter(|chunk| !chunk.is_empty())
    }
}

impl Rows {
    fn row(&self, b: usize) -> ArrayView1<'_, f64> {
        match self {
            Self::All(row) => aview1(row),
            Self::Each(rows) => rows.row(b),
        }
    }

    fn check(&self, name: &'static str, n: usize, n_dofs: usize) -> Result<()> {
        match self {
            Self::All(row) => check_vector(name, row, n_dofs, "DoF"),
            Self::Each(rows) if rows.nrows() != n => Err(Error::Rows { name, expected: n, found: rows.nrows() }),
            Self::Each(rows) => check_width(name, rows, n_dofs, "DoF"),
        }
    }
}

fn check_width(name: &'static str, rows: &Array2<f64>, expected: usize, per: &'static str) -> Result<()> {
    if rows.ncols() != expected {
        return Err(Error::Length { name, expected, found: rows.ncols(), per });
    }
    check_matrix(name, rows.view())
}

/// Checks styles (B, J) as [`crate::model::conditions::check_style`] does one.
fn check_styles(styles: &Array2<f64>, n_styles: usize) -> Result<()> {
    check_width("styles", styles, n_styles, "style dimension")?;
    match styles.indexed_iter().find(|(_, s)| s.abs() > LARGEST_STYLE) {
        Some(((row, column), &value)) => {
            Err(Error::Magnitude { name: "styles", row, column, value, limit: LARGEST_STYLE })
        }
        None => Ok(()),
    }
}
