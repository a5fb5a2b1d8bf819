//! Motion of a primitive: the control loop, whole trajectories and many at once.

pub(crate) mod batch;
pub(crate) mod command;
pub(crate) mod controller;
pub(crate) mod jacobian;
pub(crate) mod perturbation;
pub(crate) mod prediction_band;
pub(crate) mod rollout;
pub(crate) mod superposition;
pub(crate) mod trajectory;
pub(crate) mod unit_responses;

pub use batch::{Batch, BatchConditions, Chunks, Rows, batch, rollouts};
pub use command::{Command, Coupling, Motion};
pub use controller::{Controller, Status};
pub use jacobian::{Variable, jacobian};
pub use prediction_band::prediction_band;
pub use rollout::{Timing, rollout, rollout_with};
pub use trajectory::Trajectory;
