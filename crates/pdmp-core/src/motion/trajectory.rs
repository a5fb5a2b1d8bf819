//! Trajectories: sampled movements.

use ndarray::Array2;

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
