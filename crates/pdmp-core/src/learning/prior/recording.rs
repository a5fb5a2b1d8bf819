//! Samples of a demonstration for simulated recognition.

use ndarray::Array2;

use crate::demonstration::{Demonstration, Sampling, check_rotations};
use crate::error::Result;
use crate::inference::Layout;
use crate::kind::Kind;
use crate::model::{Coordinates, Model};
use crate::validate::check_length;

/// Largest number of samples of a recording; a finer one carries little more, since the residual is correlated.
const MAX_SAMPLES: usize = 60;

/// Samples of a demonstration.
pub(super) struct Recording {
    time: Vec<f64>,
    position: Array2<f64>,
    /// Duration or period, in seconds.
    pub(super) duration: f64,
    /// Goal, or mean of a cycle (n_q,).
    goal: Vec<f64>,
    kind: Kind,
}

impl Recording {
    /// Thins a demonstration of a given duration.
    ///
    /// # Errors
    /// Other rotations or another number of DoFs than the model has.
    pub(super) fn new(demo: &Demonstration, model: &Model, duration: f64) -> Result<Self> {
        check_length("position", demo.n_dofs(), model.n_dofs(), "DoF of the model")?;
        let columns = model.primitive().coordinates().map_or_else(Vec::new, Coordinates::columns);
        check_rotations(demo.rotations(), &columns, "the model")?;
        let n = demo.n_samples();
        let of = |c: usize| match demo.sampling() {
            Sampling::Stamped { time } => time[c] - time[0],
            _ => duration * c as f64 / model.kind().steps(n) as f64,
        };
        let chosen: Vec<usize> = (0..n).step_by(n.div_ceil(MAX_SAMPLES)).collect();
        let position = demo.position().select(ndarray::Axis(0), &chosen);
        let goal = match model.kind() {
            Kind::Discrete => demo.goal().map_or_else(|| demo.position().row(n - 1).to_vec(), <[f64]>::to_vec),
            Kind::Rhythmic => demo.position().mean_axis(ndarray::Axis(0)).map(|mean| mean.to_vec()).unwrap_or_default(),
        };
        Ok(Self { time: chosen.into_iter().map(of).collect(), position, duration, goal, kind: model.kind() })
    }

    /// Returns the goal or anchor (n_q,). The rotations of an anchor are those of the mean DoFs.
    pub(super) fn goal(&self, layout: &Layout) -> Vec<f64> {
        let mut goal = self.goal.clone();
        if self.kind == Kind::Rhythmic && !layout.rotations().is_empty() {
            let (mut mean, mut dofs) = (vec![0.0; layout.n_dofs], vec![0.0; layout.n_dofs]);
            for (time, position) in self.samples() {
                layout.dofs(time / self.duration, &position, &mut dofs);
                mean.iter_mut().zip(&dofs).for_each(|(mean, y)| *mean += y / self.time.len() as f64);
            }
            layout.plain.iter().for_each(|&[column, dof]| mean[dof] = goal[column]);
            layout.write(layout.clocks()[0], &mean, &mut goal);
        }
        goal
    }

    /// Returns the times, and the positions (n_q,) at them.
    pub(super) fn samples(&self) -> impl Iterator<Item = (f64, Vec<f64>)> + '_ {
        self.time.iter().zip(self.position.rows()).map(|(time, row)| (*time, row.to_vec()))
    }
    /// Returns the samples from one on: to the end of a movement, or of a cycle, which repeats, for a period.
    pub(super) fn rest(&self, seen: usize) -> Vec<(f64, Vec<f64>)> {
        let next = self.samples().map(|(time, position)| (time + self.duration, position));
        let n_again = if self.kind == Kind::Rhythmic { seen } else { 0 };
        self.samples().skip(seen).chain(next.take(n_again)).collect()
    }
}
