//! Numerical methods that are independent of movements.

#[cfg(target_arch = "x86_64")]
mod avx;
pub(crate) mod blocks;
pub(crate) mod linear_algebra;
pub(crate) mod matern;
pub(crate) mod orthonormal_span;
pub(crate) mod pool;
pub(crate) mod rotation;
pub(crate) mod rotation_transpose;
#[cfg(test)]
pub(crate) mod runge_kutta;
pub(crate) mod simd;
pub(crate) mod smoothing_spline;
pub(crate) mod spline;
pub(crate) mod state;
pub(crate) mod statistics;
pub(crate) mod threads;

pub use smoothing_spline::{Noise, Smoothing};
pub use threads::Threads;
