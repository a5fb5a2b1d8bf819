//! Assembly of a primitive from the factors of the targets (step 4 of Section 3.2).

use std::ops::Range;
use std::sync::Arc;

use ndarray::{Array2, s};

use super::braking_rate::braking_rate;
use super::constants::Constants;
use super::options::{FitOptions, Stage};
use super::tabulation::compile;
use crate::dynamics::forcing_table::ForcingTable;
use crate::dynamics::transport::Transport;
use crate::error::Result;
use crate::model::DemonstrationParameters;
use crate::model::primitive::{Parts, Primitive, end_velocities};

/// Quantities of a primitive that do not depend on its styles.
#[derive(Clone)]
pub(super) struct Foundation {
    pub(super) constants: Constants,
    pub(super) transport: Transport,
    /// Scale of each DoF in the factorisation (D,).
    pub(super) dof_scale: Vec<f64>,
    /// Largest peak-to-peak ranges (D,).
    pub(super) ranges: Vec<f64>,
    /// Largest |y″| (D,) with respect to the clock.
    pub(super) accelerations: Vec<f64>,
    pub(super) names: Vec<String>,
    pub(super) units: Vec<String>,
    /// Phases (K+1,) that divide the movement into segments.
    pub(super) breaks: Vec<f64>,
    /// Number of samples C after alignment.
    pub(super) n_samples: usize,
    /// DoFs that are the components of a vector.
    pub(super) vectors: Vec<Range<usize>>,
}

impl Foundation {
    /// Regresses F_basis (J, C·D) on the clock; returns the table, and a description of the regression.
    ///
    /// # Errors
    /// An ill-posed regression, or the error that `progress` returned.
    pub(super) fn forcing_table(
        &self,
        basis_targets: &Array2<f64>,
        options: &FitOptions,
        progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
    ) -> Result<(ForcingTable, String)> {
        progress(Stage::Regress, 0.0)?;
        let (domain, canonical) = (self.constants.domain(), self.constants.canonical);
        let clock = canonical.clock(self.n_samples);
        let outputs = by_clock(basis_targets, &self.dof_scale);
        let mut regressing = |share| progress(Stage::Regress, share);
        let regression = options.basis.regress(domain, &clock, outputs.view(), &mut regressing)?;
        let mut compiling = |share| progress(Stage::Compile, share);
        let shape = (basis_targets.nrows(), self.dof_scale.len());
        let regressed = regression.as_ref();
        let table = compile(canonical, shape, self.n_samples, regressed, options.threads, &mut compiling)?;
        Ok((table, regression.describe()))
    }

    /// Returns the primitive.
    pub(super) fn primitive(
        self,
        forcing_table: ForcingTable,
        demonstrated: &DemonstrationParameters,
    ) -> Arc<Primitive> {
        let Self { constants, transport, ranges, accelerations, names, units, breaks, vectors, .. } = self;
        let Constants { attractor, canonical, tau } = constants;
        let nominal = demonstrated.nominal_conditions(canonical.kind());
        let braking = (!transport.is_immediate()).then(|| {
            let end_velocities = end_velocities(attractor, &forcing_table, names.len());
            braking_rate(attractor, &accelerations, demonstrated.styles.view(), &end_velocities, &vectors)
        });
        let parts = Parts { attractor, forcing_table, transport, braking, tau, names, units, ranges, breaks, nominal };
        Arc::new(Primitive::new(parts))
    }
}

/// Rearranges F_basis (J, C·D) to outputs over the clock (C, J·D), in the unit of each DoF.
fn by_clock(basis: &Array2<f64>, dof_scale: &[f64]) -> Array2<f64> {
    let n_dofs = dof_scale.len();
    let mut outputs = Array2::zeros((basis.ncols() / n_dofs, basis.nrows() * n_dofs));
    for (c, mut output) in outputs.rows_mut().into_iter().enumerate() {
        let forcing = basis.slice(s![.., c * n_dofs..(c + 1) * n_dofs]);
        for ((output, forcing), scale) in output.iter_mut().zip(forcing).zip(dof_scale.iter().cycle()) {
            *output = forcing * scale;
        }
    }
    outputs
}
