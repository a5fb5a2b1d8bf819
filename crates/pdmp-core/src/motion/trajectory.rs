//! Trajectories: sampled movements, singly and in batches.

use ndarray::{Array2, Array3};

/// Generated movement, sampled at T times: row k of each array is the state at `time[k]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Times (T,), in seconds from the start.
    pub time: Vec<f64>,
    /// Positions (T, D), in the unit of each DoF.
    pub position: Array2<f64>,
    /// Velocities (T, D), per second.
    pub velocity: Array2<f64>,
    /// Accelerations (T, D), per second squared.
    pub acceleration: Array2<f64>,
}

/// Generated movements of a batch, sampled at T common times: entry b of each array is movement b.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectories {
    /// Positions (B, T, D), in the unit of each DoF.
    pub position: Array3<f64>,
    /// Velocities (B, T, D), per second, if requested.
    pub velocity: Option<Array3<f64>>,
    /// Accelerations (B, T, D), per second squared, if requested.
    pub acceleration: Option<Array3<f64>>,
}

impl Trajectories {
    /// Returns the positions and the derivatives that are present, in order of differentiation.
    pub fn iter(&self) -> impl Iterator<Item = &Array3<f64>> {
        [Some(&self.position), self.velocity.as_ref(), self.acceleration.as_ref()].into_iter().flatten()
    }
}
