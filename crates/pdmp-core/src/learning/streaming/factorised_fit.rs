//! Factorisation of a partial fit, and the model with the styles of a second pass over the blocks.

use ndarray::{Array2, Axis, s};

use super::block_styles::{BlockStyles, StyleProjection};
use super::partial_fit::{PartialFit, Regressor};
use super::summaries::Summaries;
use crate::dynamics::transport::Transport;
use crate::error::{Error, Result};
use crate::learning::assembly::Foundation;
use crate::learning::constants::Constants;
use crate::learning::factorization::{Factors, Truncation, orthonormal_styles};
use crate::learning::fit::{Contexts, learn_map};
use crate::learning::movement_metric::{phase_curves, residual_variance};
use crate::learning::noise_findings;
use crate::learning::options::{CanonicalOptions, FitOptions, NStyles, Stage, TransportSelection};
use crate::learning::stiffness::stiffness;
use crate::learning::style_selection::singular_values::{Recorded, noise_limit, squares_are_regressors, systematic};
use crate::learning::targets::lag_target;
use crate::model::{DemonstrationParameters, Finding, FitSummary, Model, Moments};
use crate::numerics::orthonormal_span::OrthonormalSpan;
use crate::preprocessing::inspection::apart;

/// Factorised targets of a [`PartialFit`], which await the styles of its demonstrations.
#[derive(Clone)]
pub struct FactorisedFit {
    projection: StyleProjection,
    summaries: Summaries,
    foundation: Foundation,
    factors: Factors,
    contexts: Option<Contexts>,
    nominal: usize,
    findings: Vec<Finding>,
    options: FitOptions,
}

impl PartialFit {
    /// Factorises the targets, with the number of styles that the options select.
    ///
    /// Alignment, gains and canonical system are those of the partial fit; the other options apply here.
    ///
    /// # Errors
    /// No demonstration, options out of range or that need all demonstrations at once, or the error that `progress` returned.
    pub fn factorise(
        &self,
        options: &FitOptions,
        progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
    ) -> Result<FactorisedFit> {
        let settings = &self.settings;
        let (kind, n_demos) = (settings.canonical.kind(), self.n_demos());
        if options.canonical.kind() != kind {
            return Err(Error::Kind { name: "kind", kind, instead: ": that of the partial fit" });
        }
        if n_demos == 0 {
            return Err(Error::NoDemonstrations);
        }
        if !self.factor.has_finite_elements() {
            return Err(Error::Fit("the targets overflow: give the demonstrations in a larger unit".into()));
        }
        let nominal = options.alignment().nominal_of(&self.summaries.durations)?;
        let duration = self.summaries.durations[nominal];
        let tau = duration / settings.canonical.extent();
        let constants = Constants { attractor: settings.attractor(), canonical: settings.canonical, tau };
        options.dof_scale.given(self.n_dofs())?;
        let dof_scale = options.dof_scale.of(&self.ranges, &settings.units);
        let transport = match options.canonical {
            CanonicalOptions::Discrete { transport: TransportSelection::Learnt, .. } => {
                let largest =
                    dof_scale.iter().zip(&settings.unit).fold(0.0f64, |most, (scale, unit)| most.max(unit / scale));
                let factors: Vec<f64> =
                    settings.unit.iter().zip(&dof_scale).map(|(unit, scale)| unit / scale / largest).collect();
                self.profile.profile(&factors, settings.canonical)?
            }
            _ => Transport::immediate(),
        };
        // Styles beyond the rank of the targets are of rows of zeros.
        let min_rows = if let NStyles::Truncated(Truncation::Rank(n)) = options.n_styles { n.max(1) } else { 1 };
        let rows = self.factor.matrix(min_rows);
        let targets = self.compressed_targets(&rows, &transport, &dof_scale);
        let contexts = self.summaries.tabulated();
        let mut factorising = |share| progress(Stage::Factorise, share);
        let mut factors = match options.n_styles {
            NStyles::AboveNoise => {
                let recorded = Recorded {
                    noise: &settings.noise(),
                    durations: &self.summaries.durations,
                    n_recorded: &self.summaries.n_recorded,
                    n_samples: settings.n_samples,
                };
                let noise = noise_limit(&recorded, &constants, &transport, &dof_scale, options.threads)?;
                let regressors = contexts.as_ref().map(|contexts| self.compressed_regressors(&rows, contexts));
                systematic(targets.view(), n_demos, noise, regressors.as_ref(), &mut factorising)?
            }
            NStyles::Truncated(count) => Factors::of_compressed(targets.view(), n_demos, count, &mut factorising)?,
            NStyles::CrossValidated => {
                let problem =
                    "needs all demonstrations at once for cross-validation: pass a number of styles, or leave it out";
                return Err(Error::Argument { name: "n_styles", problem });
            }
        };
        if factors.basis_targets.nrows() > n_demos {
            factors = factors.leading(n_demos);
        }
        factors.singular_values.truncate(n_demos);

        let mut findings = self.findings.clone();
        findings.extend(apart(&self.summaries.magnitudes(), &settings.units));
        findings.extend(noise_findings::noisy(&settings.noise(), &self.ranges, &settings.names, &settings.units));
        if settings.units.iter().all(String::is_empty) {
            let squares = |d| noise_findings::squares(targets.view(), self.n_dofs(), d);
            let (noise, names) = (settings.noise(), &settings.names);
            findings.extend(noise_findings::truncation_error(
                &self.ranges,
                squares,
                &factors,
                &noise,
                &dof_scale,
                names,
            ));
        }
        let foundation = Foundation {
            constants,
            transport,
            dof_scale,
            ranges: self.ranges.clone(),
            accelerations: self.accelerations.clone(),
            names: settings.names.clone(),
            units: settings.units.clone(),
            breaks: vec![0.0, 1.0],
            n_samples: settings.n_samples,
            vectors: Vec::new(),
        };
        let mut factorised = FactorisedFit {
            projection: StyleProjection {
                settings: settings.clone(),
                transport: foundation.transport.clone(),
                dof_scale: foundation.dof_scale.clone(),
                directions: directions(&factors),
                curves: None,
                nominal,
                threads: options.threads,
            },
            summaries: self.summaries.clone(),
            foundation,
            factors,
            contexts,
            nominal,
            findings,
            options: options.clone(),
        };
        if factorised.contexts.is_some() {
            factorised.add_curves(progress)?;
        }
        Ok(factorised)
    }

    /// Returns a matrix A (K, C·D) with AᵀA = FᵀF for the targets F (M, C·D) about the moving frame, scaled.
    ///
    /// Both are linear in the targets about the goal and the reaches g − y₀, which the factor holds.
    fn compressed_targets(&self, rows: &Array2<f64>, transport: &Transport, dof_scale: &[f64]) -> Array2<f64> {
        let (n_dofs, n_samples) = (self.n_dofs(), self.settings.n_samples);
        let mut targets = rows.slice(s![.., ..n_samples * n_dofs]).to_owned();
        let reaches = rows.slice(s![.., n_samples * n_dofs..(n_samples + 1) * n_dofs]);
        let lag = lag_target(transport, self.settings.attractor(), self.settings.canonical, n_samples);
        for (mut row, reach) in targets.rows_mut().into_iter().zip(reaches.rows()) {
            for (c, mut sample) in row.exact_chunks_mut(n_dofs).into_iter().enumerate() {
                for (d, f) in sample.iter_mut().enumerate() {
                    let lag = lag.as_ref().map_or(0.0, |lag| lag[c]);
                    *f = (*f - reach[d] * lag) * (self.settings.sizes[d] / dof_scale[d]);
                }
            }
        }
        targets
    }

    /// Returns the span of the regressors in the rows of the factor; the first is constant.
    fn compressed_regressors(&self, rows: &Array2<f64>, contexts: &Contexts) -> OrthonormalSpan {
        let squares = squares_are_regressors(&contexts.0, &contexts.1);
        let first = rows.ncols() - self.regressors.len();
        let mut span = OrthonormalSpan::default();
        let columns = || self.regressors.iter().enumerate().map(|(k, regressor)| (regressor, rows.column(first + k)));
        let is_square = |regressor: &Regressor| matches!(regressor, Regressor::Square(_));
        columns().filter(|(regressor, _)| !is_square(regressor)).for_each(|(_, column)| span.add(column));
        if squares {
            columns().filter(|(regressor, _)| is_square(regressor)).for_each(|(_, column)| span.add(column));
        }
        span
    }
}

/// Returns V·Σ⁻¹ (C·D, J), by which targets F are multiplied to their styles S = F·V·Σ⁻¹.
fn directions(factors: &Factors) -> Array2<f64> {
    let mut directions = factors.basis_targets.t().to_owned();
    for (mut direction, sigma) in directions.columns_mut().into_iter().zip(&factors.singular_values) {
        // A style of singular value 0 has no direction; its column is completed in `finish`.
        let weight = if *sigma > 0.0 { sigma.powi(-2) } else { 0.0 };
        direction.mapv_inplace(|x| x * weight);
    }
    directions
}

impl FactorisedFit {
    /// Returns the number of styles J.
    pub fn n_styles(&self) -> usize {
        self.factors.basis_targets.nrows()
    }

    /// Returns the number of demonstrations M.
    pub fn n_demos(&self) -> usize {
        self.summaries.len()
    }

    /// Returns the projection of blocks to their styles, for the second pass.
    pub fn projection(&self) -> &StyleProjection {
        &self.projection
    }

    /// Computes the responses of the model to its styles, from which the residuals of the demonstrations follow.
    fn add_curves(&mut self, progress: &mut dyn FnMut(Stage, f64) -> Result<()>) -> Result<()> {
        let styles = Array2::zeros((self.summaries.len(), self.n_styles()));
        let demonstrated = self.demonstrated(styles);
        let foundation = self.foundation.clone();
        let (table, _) = foundation.forcing_table(&self.factors.basis_targets, &self.options, progress)?;
        let primitive = foundation.primitive(table, &demonstrated);
        self.projection.curves = Some(phase_curves(&primitive)?);
        Ok(())
    }

    /// Returns the parameters of the demonstrations with given styles (M, J).
    fn demonstrated(&self, styles: Array2<f64>) -> DemonstrationParameters {
        let summaries = &self.summaries;
        let durations = ndarray::Array1::from(summaries.durations.clone());
        DemonstrationParameters {
            styles,
            goals: summaries.matrix(&summaries.goals),
            starts: summaries.matrix(&summaries.starts),
            anchors: summaries.matrix(&summaries.anchors),
            segment_durations: durations.insert_axis(Axis(1)),
            durations: summaries.durations.clone(),
            contexts: self.contexts.as_ref().map(|(_, numbers)| numbers.clone()),
            nominal: self.nominal,
        }
    }

    /// Returns the styles of a block, the first of whose demonstrations has the index `first` among all.
    ///
    /// # Errors
    /// A block that does not match those of the first pass.
    pub fn styles(&self, block: &[crate::Demonstration], first: usize) -> Result<BlockStyles> {
        self.projection.styles(block, first, &mut |_| Ok(()))
    }

    /// Returns the model, given the styles of all blocks in any order.
    ///
    /// # Errors
    /// Blocks that differ from those of the first pass, or the error that `progress` returned.
    pub fn finish(
        mut self,
        mut blocks: Vec<BlockStyles>,
        progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
    ) -> Result<Model> {
        blocks.sort_by_key(|block| block.first);
        let n_demos = self.summaries.len();
        let mut projected = Array2::zeros((n_demos, self.n_styles()));
        let mut squares: Option<Array2<f64>> = None;
        let (mut next, mut nominal) = (0, None);
        for block in blocks {
            let rows = block.styles.nrows();
            if block.first != next || self.summaries.differ(next, block.starts.view()).is_some() {
                return Err(different_blocks());
            }
            projected.slice_mut(s![next..next + rows, ..]).assign(&block.styles);
            next += rows;
            nominal = nominal.or(block.nominal);
            squares = match (squares, block.squares) {
                (Some(sum), Some(other)) => Some(sum + other),
                (sum, other) => sum.or(other),
            };
        }
        if next != n_demos {
            return Err(different_blocks());
        }
        let (styles, signs) = orthonormal_styles(projected);
        let Factors { mut basis_targets, singular_values, error, .. } = self.factors;
        for (mut row, sign) in basis_targets.rows_mut().into_iter().zip(&signs) {
            row.mapv_inplace(|x| x * sign);
        }
        self.factors = Factors { styles, basis_targets, singular_values, error };
        self.assemble(squares, nominal, progress)
    }

    fn assemble(
        mut self,
        squares: Option<Array2<f64>>,
        nominal: Option<Array2<f64>>,
        progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
    ) -> Result<Model> {
        let (forcing_table, regression) =
            self.foundation.forcing_table(&self.factors.basis_targets, &self.options, progress)?;
        let truncation_error = self.factors.truncation_error();
        let styles = std::mem::take(&mut self.factors.styles);
        let demonstrated = self.demonstrated(styles);
        let (n_samples, noise) = (self.foundation.n_samples, self.projection.settings.noise());
        let dof_scale = self.foundation.dof_scale.clone();
        let primitive = self.foundation.primitive(forcing_table, &demonstrated);
        let mut findings = self.findings;
        if let Some(recorded) = nominal {
            let sample = |position: &mut [f64]| position.iter_mut().zip(&recorded).for_each(|(to, from)| *to = *from);
            findings.extend(stiffness(&primitive, (self.nominal, n_samples), sample)?);
        }
        let learn = |(columns, _): Contexts| learn_map(columns, &primitive, &demonstrated, &self.options);
        let map = self.contexts.map(learn).transpose()?;
        let residual_variance = squares.map(|sum| residual_variance(sum, demonstrated.durations.len(), &noise));
        let learnt = FitSummary {
            n_samples,
            noise,
            template: None,
            dof_scale,
            singular_values: self.factors.singular_values,
            truncation_error,
            residual_variance,
            regression,
            findings,
        };
        Ok(Model { primitive, demonstrated, learnt, map, moments: Moments::default() })
    }
}

/// Returns the error of a pass with other blocks.
pub(super) fn different_blocks() -> Error {
    let problem = "differ between the passes: pass those of the first one in the same order; a function returns them at each \
                   call";
    Error::Argument { name: "blocks", problem }
}
