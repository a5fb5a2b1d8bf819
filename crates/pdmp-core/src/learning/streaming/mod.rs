//! Fit of demonstrations that arrive in blocks, in bounded memory.
//!
//! The targets F (M, C·D) of M demonstrations are needed for their singular value decomposition alone, and all but the styles
//! follows from a factor R of F, RᵀR = FᵀF, with no more rows than F has dimensions:
//!
//! ```text
//! blocks ─ alignment, targets ─► R, sums and numbers of each demonstration ─ factorise ─► V·Σ⁻¹, F_basis
//! blocks ─ alignment, targets ─► S = F·V·Σ⁻¹ ─ finish ─► Model
//! ```
//!
//! The moving frame and the scales of the DoFs, which depend on all demonstrations, enter the targets linearly, and are
//! applied to R, which therefore has the reaches g − y₀ as further columns. So has it the regressors of the contexts, from
//! which the F-tests of the styles follow.

mod block_styles;
mod factorised_fit;
mod file;
mod fit_blocks;
mod partial_fit;
mod row_factor;
mod settings;
mod summaries;
mod triangle;

pub use block_styles::{BlockStyles, StyleProjection};
pub use factorised_fit::FactorisedFit;
pub use fit_blocks::{Blocks, fit_blocks};
pub use partial_fit::PartialFit;
