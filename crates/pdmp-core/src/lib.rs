//! Parametric Dynamic Movement Primitives: one movement primitive learnt from many demonstrations.
//!
//! T. Matsubara, S.-H. Hyon, J. Morimoto, *Learning parametric dynamic movement primitives from multiple
//! demonstrations*, Neural Networks 24 (2011) 493–500, [doi:10.1016/j.neunet.2011.02.004].
//!
//! The way of the data, which is also that of the modules:
//!
//! ```text
//! demos (T_m, D) ─ align ─► (M, C, D) ─ attractor ─► F (M, C·D) ─ factor ─► S (M, J), F_basis (J, C·D)
//!       ─ basis ─► landscape u ↦ (J, D) ─► Model ─► Controller ─ step ─► y, ẏ, ÿ
//!                                             └─► rollout ─► Trajectory
//! ```
//!
//! | paper | code | shape | unit | meaning |
//! |---|---|---|---|---|
//! | M, D, C, J, N | `n_demos`, `n_dofs`, `n_samples`, `n_styles`, `n_basis` | | | demonstrations, degrees of freedom, samples, style dimension, basis functions |
//! | y, ẏ, ÿ | `position`, `velocity`, `acceleration` | (D,) | DoF unit, /s, /s² | output of the primitive |
//! | z | `z` | (D,) | DoF unit | auxiliary state of the output system |
//! | g, y_a | `goal`, `anchor` | (D,) | DoF unit | point attractor, centre of oscillation |
//! | τ | `tau` | | s | time constant |
//! | x, φ, r, r₀ | `phase`, `phase`, `r`, `amplitude` | | –, rad, –, – | phase, polar phase, amplitude and its target |
//! | – | `u`, `clock` | | – | u̇ = 1/τ: x = exp(−α_x u), φ = u mod 2π |
//! | s, S | `style`, `styles` | (J,), (M, J) | – | style parameter |
//! | b(x; W), w | `basis`, `landscape` | (J, D) | DoF unit | attractor landscape per style, and the same times its gate |
//! | m(u) | `transport` | | | share of the way from start to goal that the frame has covered |
//! | U: h ↦ s | `ContextMap` | | | from a condition to style, goal, start or anchor, and timing |
//!
//! Time is axis 0 of every array that has a time axis.
//!
//! # Learn, and run at 1 kHz
//!
//! ```
//! use std::sync::Arc;
//!
//! use ndarray::Array2;
//! use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, Sampling, Status, fit};
//!
//! # fn main() -> pdmp_core::Result<()> {
//! let bend = |h: f64| {
//!     let position = Array2::from_shape_fn((101, 2), |(c, d)| {
//!         let s = c as f64 / 100.0;
//!         if d == 0 { s * s * (3.0 - 2.0 * s) } else { h * (s * (1.0 - s)).powi(2) }
//!     });
//!     Demonstration::new(position, Sampling::Uniform { dt: 0.01 })
//! };
//! let demos = [bend(0.5)?, bend(1.0)?, bend(2.0)?];
//! let model = Arc::new(fit(&demos, &FitOptions::new(Kind::Discrete))?);
//!
//! let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
//! controller.set_goal(&[1.2, 0.1])?;
//! while controller.step()? == Status::Working {
//!     let _command = (controller.position(), controller.velocity());
//! }
//! assert!((controller.position()[0] - 1.2).abs() < 2e-3);
//! # Ok(())
//! # }
//! ```
//!
//! `examples/control_loop.rs` runs a model from a file on the clock, with [`Controller::update`] and no memory but the
//! caller's.
//!
//! [doi:10.1016/j.neunet.2011.02.004]: https://doi.org/10.1016/j.neunet.2011.02.004

// A build without learning keeps the few lines of shared modules that learning alone uses.
#![cfg_attr(not(feature = "learning"), allow(dead_code, unused_imports))]

pub mod context;
pub mod demonstration;
pub mod dynamics;
mod error;
mod kind;
#[cfg(feature = "learning")]
pub mod learning;
pub mod model;
pub mod motion;
pub mod numerics;
#[cfg(feature = "learning")]
pub mod preprocessing;
mod validate;

pub use demonstration::{Demonstration, Sampling};
pub use error::{Error, ErrorKind, Result};
pub use kind::Kind;
#[cfg(feature = "learning")]
pub use learning::{FitOptions, fit};
pub use model::{Conditions, Model, Primitive};
pub use motion::{Command, Controller, Motion, Status, rollout};
