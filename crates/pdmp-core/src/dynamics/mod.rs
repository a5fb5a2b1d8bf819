//! Dynamical systems of a primitive: canonical system, output system, forcing term, transport, time warp and command
//! filters.

pub(crate) mod additional_forcing;
pub(crate) mod braking;
pub(crate) mod canonical;
pub(crate) mod command_filter;
mod forcing_block;
mod forcing_slopes;
pub(crate) mod forcing_table;
pub(crate) mod forcing_transpose;
pub(crate) mod goal_transition;
pub(crate) mod hermite_table;
pub(crate) mod mean_rotation;
pub(crate) mod output_system;
pub(crate) mod propagator_series;
pub(crate) mod time_warp;
pub(crate) mod transport;

pub use additional_forcing::AdditionalForcing;
pub use canonical::Canonical;
pub use forcing_table::ForcingTable;
pub use output_system::Attractor;
