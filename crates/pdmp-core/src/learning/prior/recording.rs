//! Samples of a demonstration for simulated recognition.

use ndarray::Array2;

use crate::demonstration::{Demonstration, Sampling};
use crate::error::Result;
use crate::kind::Kind;
use crate::model::Model;
use crate::validate::check_length;

/// Largest number of samples of a recording; a finer one carries little more, since the residual is correlated.
const MAX_SAMPLES: usize = 60;

/// Samples of a demonstration.
pub(super) struct Recording {
    time: Vec<f64>,
    position: Array2<f64>,
    /// Duration or period, in seconds.
    pub(super) duration: f64,
    /// Goal, or mean of a cycle (D,).
    pub(super) goal: Vec<f64>,
}

impl Recording {
    /// Thins a demonstration of a given duration.
    ///
    /// # Errors
    /// Another number of DoFs than the model has.
    pub(super) fn new(demo: &Demonstration, model: &Model, duration: f64) -> Result<Self> {
        check_length("position", demo.n_dofs(), model.n_dofs(), "DoF of the model")?;
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
        Ok(Self { time: chosen.into_iter().map(of).collect(), position, duration, goal })
    }

    /// Returns the times, and the positions (D,) at them.
    pub(super) fn samples(&self) -> impl Iterator<Item = (f64, Vec<f64>)> + '_ {
        self.time.iter().zip(self.position.rows()).map(|(time, row)| (*time, row.to_vec()))
    }
}
