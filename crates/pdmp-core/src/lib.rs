//! Parametric Dynamic Movement Primitives: one movement primitive learnt from many demonstrations.
//!
//! T. Matsubara, S.-H. Hyon, J. Morimoto, *Learning parametric dynamic movement primitives from multiple
//! demonstrations*, Neural Networks 24 (2011) 493–500, [doi:10.1016/j.neunet.2011.02.004].
//!
//! The data flow, in the order of the modules of [`learning`], [`model`] and [`motion`]:
//!
//! ```text
//! demonstrations (T_m, D) ─ alignment ─► (M, C, D) ─ targets ─► F (M, C·D) ─ factorization ─► S (M, J), F_basis (J, C·D)
//!       ─ regression ─► forcing table u ↦ (J, D) ─► Primitive ─► Controller ─ step ─► y, ẏ, ÿ
//!                                                           └──► rollout ─► Trajectory
//! ```
//!
//! | paper | code | shape | unit | meaning |
//! |---|---|---|---|---|
//! | M, D, C, J, N | `n_demos`, `n_dofs`, `n_samples`, `n_styles`, `n_basis` | | | demonstrations, degrees of freedom, samples, style dimension, basis functions |
//! | y, ẏ, ÿ | `position`, `velocity`, `acceleration` | (D,) | DoF unit, /s, /s² | output of the primitive |
//! | z | `z` | (D,) | DoF unit | auxiliary state of the output system |
//! | g, y_a, y₀ | `goal`, `anchor`, `start` | (D,) | DoF unit | point attractor, centre of oscillation, start position |
//! | τ, ρ = 1/τ | `tau`, `rate` | | s, 1/s | time constant, and its inverse |
//! | x, φ, r, r₀ | `phase`, `phase`, `r`, `amplitude` | | –, rad, –, – | phase, polar phase, amplitude and its target |
//! | – | `u`, `clock` | | – | u̇ = 1/τ: x = exp(−α_x u), φ = u mod 2π |
//! | s, S | `style`, `styles` | (J,), (M, J) | – | style parameter |
//! | b(x; W) | `landscape` | (J, D) | DoF unit | attractor landscape of each style dimension, without gate |
//! | w = gate·sᵀb | `forcing` | (D,) | DoF unit | forcing term; stored for unit styles in the [`dynamics::ForcingTable`] |
//! | m(u) | `transport` | | | fraction of the displacement from start to goal that the frame has covered |
//! | U: h ↦ s | `ContextMap` | | | map from a context to style, goal, start or anchor, and duration |
//!
//! Time is axis 0 of every array that has a time axis.
//!
//! # Fit, and run at 1 kHz
//!
//! ```
//! # #[cfg(feature = "learning")]
//! # fn main() -> pdmp_core::Result<()> {
//! use ndarray::Array2;
//! use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Sampling, Status, fit};
//!
//! let bend = |h: f64| {
//!     let position = Array2::from_shape_fn((101, 2), |(c, d)| {
//!         let s = c as f64 / 100.0;
//!         if d == 0 { s * s * (3.0 - 2.0 * s) } else { h * (s * (1.0 - s)).powi(2) }
//!     });
//!     Demonstration::new(position, Sampling::Uniform { dt: 0.01 })
//! };
//! let demos = [bend(0.5)?, bend(1.0)?, bend(2.0)?];
//! let model = fit(&demos, &FitOptions::discrete())?;
//!
//! let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
//! controller.set_goal(&[1.2, 0.1])?;
//! while controller.step()? == Status::Working {
//!     let _command = (controller.position(), controller.velocity());
//! }
//! assert!((controller.position()[0] - 1.2).abs() < 2e-3);
//! # Ok(())
//! # }
//! # #[cfg(not(feature = "learning"))]
//! # fn main() {}
//! ```
//!
//! The example `control_loop` runs a model from a file on the wall clock; [`Controller::update`] reads and writes the
//! caller's memory alone.
//!
//! [doi:10.1016/j.neunet.2011.02.004]: https://doi.org/10.1016/j.neunet.2011.02.004

// In a build without learning, some functions of shared modules have no caller.
#![cfg_attr(not(feature = "learning"), allow(dead_code, unused_imports))]

pub mod context;
pub mod demonstration;
pub mod dynamics;
mod error;
pub mod inference;
mod kind;
#[cfg(feature = "learning")]
pub mod learning;
pub mod model;
pub mod motion;
pub mod numerics;
#[cfg(feature = "learning")]
pub mod preprocessing;
#[cfg(test)]
#[path = "../tests/common/random.rs"]
mod random;
mod validate;

pub use demonstration::{Demonstration, Sampling};
pub use error::{Error, ErrorKind, LimitError, Mismatch, MovementError, Result, RotationError};
pub use kind::Kind;
#[cfg(feature = "learning")]
pub use learning::{FitOptions, fit};
pub use model::{Conditions, Model, Primitive};
pub use motion::{Command, Controller, Motion, Status, rollout};
