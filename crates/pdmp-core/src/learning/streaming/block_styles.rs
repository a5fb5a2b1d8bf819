//! Second pass over the blocks: their styles, and the residuals of the model.

use ndarray::{Array1, Array2, ArrayView2, Axis};

use super::partial_fit::in_all;
use super::settings::Settings;
use crate::context::outputs;
use crate::demonstration::Demonstration;
use crate::dynamics::transport::Transport;
use crate::error::Result;
use crate::learning::movement_metric::squared_residuals;
use crate::learning::targets::Targets;
use crate::model::responses::Curves;
use crate::numerics::threads::Threads;
use crate::validate::row_major_mut;

/// Projection of targets to styles, S = F·V·Σ⁻¹.
#[derive(Clone, Debug)]
pub struct StyleProjection {
    pub(super) settings: Settings,
    pub(super) transport: Transport,
    pub(super) dof_scale: Vec<f64>,
    /// V·Σ⁻¹ (C·D, J).
    pub(super) directions: Array2<f64>,
    /// Responses of the model; `None` where residuals are not needed.
    pub(super) curves: Option<Curves>,
    /// Index of the nominal demonstration.
    pub(super) nominal: usize,
    pub(super) threads: Threads,
}

/// Styles of a block of demonstrations.
#[derive(Clone, Debug)]
pub struct BlockStyles {
    /// Index of the first demonstration of the block among all.
    pub(super) first: usize,
    /// Styles (B, J), orthonormal over all blocks to rounding.
    pub(super) styles: Array2<f64>,
    /// Starts (B, D), by which blocks are recognised.
    pub(super) starts: Array2<f64>,
    /// Sum of squared residuals (S, D).
    pub(super) squares: Option<Array2<f64>>,
    /// Aligned positions (C, D) of the nominal demonstration, if it is in the block.
    pub(super) nominal: Option<Array2<f64>>,
}

impl BlockStyles {
    /// Returns the styles (B, J), but for their signs.
    pub fn styles(&self) -> ArrayView2<'_, f64> {
        self.styles.view()
    }
}

impl StyleProjection {
    /// Returns the styles of a block, the first of whose demonstrations has the index `first` among all.
    ///
    /// # Errors
    /// A block that does not match those of the first pass, or the error that `progress` returned.
    pub fn styles(
        &self,
        block: &[Demonstration],
        first: usize,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<BlockStyles> {
        let inside = |error| in_all(error, first);
        let Self { settings, threads, .. } = self;
        let demos = settings.prepared(block).map_err(inside)?;
        let aligned = settings.aligned(&demos, *threads).map_err(inside)?;
        let (attractor, canonical) = (settings.attractor(), settings.canonical);
        let mut targets = Targets::of(&aligned, attractor, canonical, *threads, progress)?;
        targets.carry(&self.transport, attractor, canonical);
        targets.scale(&self.dof_scale);
        let styles = targets.forcing.dot(&self.directions);
        let Targets { starts, goals, anchors, .. } = targets;
        let position = |m: usize| {
            let mut position = Array2::zeros((settings.n_samples, settings.n_dofs()));
            aligned.sample(m, row_major_mut(&mut position));
            position
        };
        let nominal = self.nominal.checked_sub(first).filter(|m| *m < demos.len()).map(position);
        let squares = self.curves.as_ref().map(|curves| {
            let durations = Array1::from(aligned.durations()).insert_axis(Axis(1));
            let positions = [goals.view(), starts.view(), anchors.view()];
            let outputs = outputs(canonical.kind(), styles.view(), positions, durations.view());
            squared_residuals(canonical.kind(), curves, outputs.view(), aligned)
        });
        Ok(BlockStyles { first, styles, starts, squares, nominal })
    }
}
