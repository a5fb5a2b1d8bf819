//! Motion generation: the control loop, rollouts, batches of rollouts and their derivatives.

pub(crate) mod angular;
pub(crate) mod batch;
pub(crate) mod batch_conditions;
mod batch_singles;
pub(crate) mod command;
mod commands;
pub(crate) mod controller;
mod controllers;
pub(crate) mod fastest;
pub(crate) mod feasibility;
pub(crate) mod jacobian;
pub(crate) mod limits;
pub(crate) mod perturbation;
pub(crate) mod prediction_band;
pub(crate) mod rate_limits;
mod response_products;
pub(crate) mod rollout;
pub(crate) mod sampled_path;
mod shares;
pub(crate) mod stopping;
pub(crate) mod superposition;
pub(crate) mod time_law;
pub(crate) mod trajectory;
mod transposed_rollout;
mod two_arms;
pub(crate) mod unit_responses;
mod vector_jacobian;
pub(crate) mod viability;

pub use batch::{Batch, BatchChunks, batch};
pub use batch_conditions::{BatchConditions, PerMovement};
pub use command::{Command, Coupling, Motion};
pub use commands::{Commands, Motions};
pub use controller::{Controller, Status};
pub use controllers::Controllers;
pub use fastest::{fastest, fastest_tau};
pub use feasibility::{Extreme, Margins, feasible};
#[cfg(feature = "learning")]
pub use feasibility::{Vary, feasible_prediction, nearest_feasible};
pub use jacobian::{WithRespectTo, jacobian};
pub use limits::{Limit, Limits};
pub use perturbation::Compliance;
pub use prediction_band::{PredictionBand, prediction_band};
pub use rollout::{TimeGrid, rollout, rollout_with};
pub use trajectory::{Trajectories, Trajectory};
pub use two_arms::{Pose, TwoArms, mean_pose};
pub use unit_responses::{UnitCurves, unit_curves};
