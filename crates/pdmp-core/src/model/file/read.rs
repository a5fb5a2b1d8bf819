//! Deserialisation of a model from the bytes of a file, with checks of dimensions, numbers and checksum.

use std::sync::Arc;

use ndarray::{Array2, Axis};
use safetensors::tensor::{Dtype, SafeTensors};
use serde::Deserialize;

use super::section::{PREFIX, Section};
use super::{Constants, Layout, Map, SCHEMA, Sealed, checksum, ensure, header, unreadable};
use crate::context::{ContextMap, ContextMapKind, Kernel, MapParameters, StackingWeights};
use crate::demonstration::MIN_SAMPLES_PER_DEMONSTRATION;
use crate::dynamics::canonical::Canonical;
use crate::dynamics::forcing_table::ForcingTable;
use crate::dynamics::hermite_table::{KnotTable, MAX_CELLS};
use crate::dynamics::mean_rotation::MeanRotation;
use crate::dynamics::output_system::Attractor;
use crate::dynamics::transport::Transport;
use crate::error::Result;
use crate::kind::Kind;
use crate::model::conditions::MAX_STYLE_MAGNITUDE;
use crate::model::primitive::{MAX_RATE, MAX_TAU, Parts, Primitive};
use crate::model::sensitivity::STEPS;
use crate::model::template::{TimeWarp, WarpTemplate};
use crate::model::{Coordinates, DemonstrationParameters, FitSummary, Model, Moments};
use crate::numerics::smoothing_spline::Noise;
use crate::validate::MAX_MAGNITUDE;

impl Model {
    /// Reads a model from the bytes of a file; a prior in it is checked for damage alone.
    ///
    /// # Errors
    /// Bytes that are damaged, not a model, or of another version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        Ok(Self::from_bytes_with_prior(bytes)?.0)
    }

    /// Reads a model, and its prior if there is one, from the bytes of a file.
    ///
    /// # Errors
    /// As for [`Self::from_bytes`].
    pub(crate) fn from_bytes_with_prior(bytes: &[u8]) -> Result<(Self, Option<Section>)> {
        let json = header::constants(bytes)?;
        // The version is parsed first: other versions may have other fields.
        let version: Version = serde_json::from_str(&json).map_err(unreadable)?;
        let found = version.schema.ok_or(unreadable("no schema version"))?;
        ensure(found == u64::from(SCHEMA), &format!("version {found}, while this library reads version {SCHEMA}"))?;
        let tensors = SafeTensors::deserialize(bytes).map_err(unreadable)?;
        let sealed: Sealed = serde_json::from_str(&json).map_err(unreadable)?;
        // The checksum covers the values of the constants. A flipped bit may give another text of the same values, such
        // as 1.50 for 1.5, which differs from the text that `to_bytes` writes.
        let canonical = serde_json::to_string(&sealed).map_err(unreadable)?;
        ensure(canonical == json, "damaged: the text of its constants is not canonical")?;
        let reader = Reader { tensors };
        let model = reader.model(&sealed.model)?;
        let prior = sealed.prior.map(|version| reader.section(version)).transpose()?;
        reader.verify(&sealed, &model, prior.as_ref())?;
        Ok((model, prior))
    }
}

/// Version of a file; other fields are ignored.
#[derive(Deserialize)]
struct Version {
    schema: Option<u64>,
}

/// Reader of the arrays of a file, which checks dimensions and numbers.
struct Reader<'a> {
    tensors: SafeTensors<'a>,
}

impl Reader<'_> {
    /// Returns the elements of an array, after a check of its type, shape and magnitudes.
    fn array(&self, name: &str, shape: &[usize]) -> Result<Vec<f64>> {
        let tensor = self.tensors.tensor(name).map_err(|_| unreadable(format!("no array {name}")))?;
        if tensor.dtype() != Dtype::F64 || tensor.shape() != shape {
            let (dtype, found) = (tensor.dtype(), tensor.shape());
            return Err(unreadable(format!("{name} is {dtype:?} {found:?}, expected F64 {shape:?}")));
        }
        let (bytes, _) = tensor.data().as_chunks();
        let data: Vec<f64> = bytes.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        let limit = max_magnitude(name);
        match data.iter().position(|x| x.is_nan() || x.abs() > limit) {
            Some(index) => Err(unreadable(format!("{name}[{index}] = {:e} is out of range", data[index]))),
            None => Ok(data),
        }
    }

    fn matrix(&self, name: &str, shape: (usize, usize)) -> Result<Array2<f64>> {
        let data = self.array(name, &[shape.0, shape.1])?;
        Array2::from_shape_vec(shape, data).map_err(|error| unreadable(format!("{name}: {error}")))
    }

    fn positive(&self, name: &str, length: usize) -> Result<Vec<f64>> {
        let data = self.array(name, &[length])?;
        match data.iter().position(|x| *x <= 0.0) {
            Some(index) => Err(unreadable(format!("{name}[{index}] = {} is not positive", data[index]))),
            None => Ok(data),
        }
    }

    fn noise(&self, n_dofs: usize) -> Result<Noise> {
        let [levels, cut_offs] = [self.array("noise.levels", &[n_dofs])?, self.array("noise.cut_offs", &[n_dofs])?];
        ensure(!levels.iter().chain(&cut_offs).any(|x| *x < 0.0), "a noise or cut-off is negative")?;
        let cut_offs = cut_offs.into_iter().map(|hz| Some(hz).filter(|hz| *hz > 0.0)).collect();
        // The array of a model without ends at rest is left out.
        let ends = match self.tensors.tensor("noise.ends") {
            Ok(_) => self.matrix("noise.ends", (n_dofs, 2))?,
            Err(_) => Array2::zeros((n_dofs, 2)),
        };
        let ends = ends.rows().into_iter().map(|rest| [rest[0] > 0.0, rest[1] > 0.0]).collect();
        Ok(Noise { levels, cut_offs, ends })
    }

    /// Returns the shape of an array with N axes.
    fn shape<const N: usize>(&self, name: &str) -> Result<[usize; N]> {
        let tensor = self.tensors.tensor(name).map_err(|_| unreadable(format!("no array {name}")))?;
        tensor.shape().try_into().map_err(|_| unreadable(format!("{name} has {} axes", tensor.shape().len())))
    }

    fn model(&self, constants: &Constants) -> Result<Model> {
        let kind = constants.canonical.kind();
        let [n_demos, n_styles] = self.shape("styles")?;
        let [n_knots, _, n_dofs] = self.shape("forcing_table.values")?;
        let [n_values] = self.shape("singular_values")?;
        let [_, n_segments] = self.shape("segment_durations")?;
        let filled = ![n_segments, n_demos, n_styles, n_dofs].contains(&0);
        ensure(filled && n_values >= n_styles, "an array is empty")?;
        let labelled = [&constants.names, &constants.units].iter().all(|labels| labels.len() == n_dofs);
        let fits = (2..=MAX_CELLS + 1).contains(&n_knots) && labelled;
        ensure(fits, "the forcing table does not fit the rest")?;
        let valid = constants.nominal < n_demos && constants.n_samples >= MIN_SAMPLES_PER_DEMONSTRATION;
        ensure(valid, "nominal or n_samples is out of range")?;
        constants.check()?;

        let contexts = match &constants.map {
            Some(map) => Some(self.matrix("contexts", (n_demos, map.columns.len()))?),
            None => None,
        };
        let knots = |name| self.array(name, &[n_knots, n_styles, n_dofs]);
        let (values, slopes) = (knots("forcing_table.values")?, knots("forcing_table.slopes")?);
        let knots = KnotTable { n_outputs: n_styles * n_dofs, values, slopes };
        let forcing_table = ForcingTable::from_knots(constants.canonical, n_dofs, &knots, constants.table_error);
        let [n_coefficients] = self.shape("transport")?;
        let transport = self.array("transport", &[n_coefficients])?;
        let transport = Transport::from_coefficients(transport, constants.canonical).map_err(unreadable)?;
        let braking = constants.braking;
        // The forcing past the end is exp(−α_z v)(a + b·exp(−(κ − α_z)v)): for κ < α_z the second exponential overflows.
        let valid = braking.is_none_or(|braking| (constants.alpha_z..=1e12).contains(&braking));
        ensure(valid && braking.is_none() == transport.is_immediate(), "braking does not fit the rest")?;
        let breaks = self.array("breaks", &[n_segments + 1])?;
        let increasing = !breaks.windows(2).any(|pair| pair[0] >= pair[1]);
        let valid = breaks[0] == 0.0 && breaks[n_segments] == 1.0 && increasing;
        ensure(valid, "breaks do not increase from 0 to 1")?;
        let segment_durations = self.matrix("segment_durations", (n_demos, n_segments))?;
        ensure(segment_durations.iter().all(|seconds| *seconds > 0.0), "a segment duration is not positive")?;
        // A fit ensures this; the default duration of a rollout relies on it.
        let ratio = segment_durations.row(constants.nominal).sum() / (constants.tau * constants.canonical.extent());
        let agrees = ((1.0 - 1e-6)..=(1.0 + 1e-6)).contains(&ratio);
        ensure(agrees, "tau does not agree with the nominal duration")?;
        let demonstrated = DemonstrationParameters {
            styles: self.matrix("styles", (n_demos, n_styles))?,
            goals: self.matrix("goals", (n_demos, n_dofs))?,
            starts: self.matrix("starts", (n_demos, n_dofs))?,
            anchors: self.matrix("anchors", (n_demos, n_dofs))?,
            durations: segment_durations.sum_axis(Axis(1)).to_vec(),
            segment_durations,
            contexts,
            nominal: constants.nominal,
        };
        let singular_values = self.array("singular_values", &[n_values])?;
        let dof_scale = self.positive("dof_scale", n_dofs)?;
        let ranges = self.array("ranges", &[n_dofs])?;
        let negative = singular_values.iter().chain(&ranges).any(|x| *x < 0.0);
        ensure(!negative, "a range or singular value is negative")?;
        let (map, residual_variance) = match &constants.map {
            Some(map) => {
                let residual_variance = self.matrix("residual_variance", (kind.samples(STEPS), n_dofs))?;
                ensure(residual_variance.iter().all(|x| *x >= 0.0), "a residual variance is negative")?;
                (Some(self.map(map, &demonstrated, kind)?), Some(residual_variance))
            }
            None => (None, None),
        };
        let learnt = FitSummary {
            n_samples: constants.n_samples,
            noise: self.noise(n_dofs)?,
            template: self.template(constants, n_segments, n_dofs)?,
            dof_scale,
            singular_values,
            truncation_error: constants.truncation_error,
            residual_variance,
            findings: Vec::new(),
            regression: constants.regression.clone(),
        };
        let primitive = Primitive::new(Parts {
            attractor: Attractor { alpha_z: constants.alpha_z, beta_z: constants.beta_z },
            forcing_table,
            transport,
            braking,
            tau: constants.tau,
            names: constants.names.clone(),
            units: constants.units.clone(),
            ranges,
            breaks,
            nominal: demonstrated.nominal_conditions(kind),
        });
        let primitive = match &constants.coordinates {
            Some(layout) => self.coordinates(layout, primitive)?,
            None => Arc::new(primitive),
        };
        Ok(Model { primitive, demonstrated, learnt, map, moments: Moments::default() })
    }

    /// Returns a primitive with the coordinates of the file.
    fn coordinates(&self, layout: &Layout, dofs: Primitive) -> Result<Arc<Primitive>> {
        let Layout { names, units, frame, rotations } = layout;
        let [n_rotations, n_knots, _] = self.shape("mean_rotations")?;
        let overlap = rotations.windows(2).any(|pair| pair[0].column.saturating_add(4) > pair[1].column);
        let last = rotations.last().map_or(usize::MAX, |last| last.column.saturating_add(4));
        let n = dofs.n_dofs().saturating_add(rotations.len());
        let counts = [names.len(), units.len()] == [n; 2] && n_rotations == rotations.len();
        ensure(counts && !overlap && last <= n && !rotations.is_empty(), "the coordinates do not fit the rest")?;
        let components = self.array("mean_rotations", &[n_rotations, n_knots, 4])?;
        let (quaternions, _) = components.as_chunks::<4>();
        let means = rotations.iter().zip(quaternions.chunks(n_knots.max(1))).map(|(columns, knots)| {
            let valid = MeanRotation::are_valid(knots, dofs.kind());
            ensure(valid, "a mean rotation is no curve of unit quaternions")?;
            Ok((*columns, MeanRotation::through(knots.to_vec(), dofs.canonical())))
        });
        let means = means.collect::<Result<Vec<_>>>()?;
        let dofs = Arc::new(dofs);
        let coordinates = Coordinates::new(Arc::clone(&dofs), names.clone(), units.clone(), *frame, means);
        Ok(Arc::new(Primitive::clone(&dofs).with_coordinates(coordinates)))
    }

    fn template(&self, constants: &Constants, n_segments: usize, n_dofs: usize) -> Result<Option<WarpTemplate>> {
        let Some(slope) = constants.slope else { return Ok(None) };
        let shape = self.matrix("template.shape", (WarpTemplate::cells(n_segments), n_dofs))?;
        Ok(Some(WarpTemplate { slope, unit: self.positive("template.unit", n_dofs)?, shape }))
    }

    /// Restores the context map from its constants and the parameters of the demonstrations.
    fn map(&self, map: &Map, demonstrated: &DemonstrationParameters, kind: Kind) -> Result<ContextMap> {
        let outputs = demonstrated.outputs(kind);
        let ratios = self.array("map.ratios", &[outputs.ncols()])?;
        let valid = match map.kernel {
            None => ratios.iter().all(|ratio| *ratio == 0.0),
            Some(Kernel::Linear) => false,
            Some(Kernel::Quadratic) => ratios.iter().all(|ratio| *ratio >= 0.0),
            Some(Kernel::Matern { length }) => length > 0.0 && ratios.iter().all(|ratio| *ratio >= 0.0),
        };
        let contexts = demonstrated.contexts.as_ref().ok_or(unreadable("no contexts"))?;
        for (q, column) in map.columns.iter().enumerate() {
            let known = contexts.column(q).iter().all(|&number| column.value(q, number).is_ok());
            ensure(known, "a context has an unknown label")?;
        }
        ensure(valid, "the map's constants are out of range")?;
        let errors = map.errors.iter().map(|&(kind, error)| (kind, error.unwrap_or(f64::INFINITY))).collect();
        let directions = self.matrix("map.directions", (outputs.ncols(), outputs.ncols()))?;
        let line = match map.kind {
            ContextMapKind::Stacked => Some(self.stacked_line(outputs.ncols())?),
            _ => None,
        };
        let parameters = MapParameters { kind: map.kind, kernel: map.kernel, ratios, line, errors };
        ContextMap::restore(map.columns.clone(), contexts, outputs.view(), directions, parameters)
            .and_then(|restored| restored.with_names(map.names.clone()))
            .map_err(unreadable)
    }

    /// Returns the line of a stacked map: its signal-to-noise ratios (P,) and the stacking weights.
    fn stacked_line(&self, n_outputs: usize) -> Result<(Vec<f64>, StackingWeights)> {
        let ratios = self.array("map.slopes", &[n_outputs])?;
        let weights = self.array("map.weights", &[2, 2])?;
        let weights =
            StackingWeights { interpolation: [weights[0], weights[1]], extrapolation: [weights[2], weights[3]] };
        let valid = |[g, l]: [f64; 2]| g >= 0.0 && l >= 0.0 && g + l <= 1.0 + 1e-9;
        let valid = valid(weights.interpolation) && valid(weights.extrapolation);
        ensure(valid && ratios.iter().all(|ratio| *ratio >= 0.0), "the map's line is out of range")?;
        Ok((ratios, weights))
    }

    /// Returns the arrays of the prior.
    fn section(&self, version: u32) -> Result<Section> {
        let names = self.tensors.names().into_iter().filter_map(|name| name.strip_prefix(PREFIX));
        names.into_iter().try_fold(Section::new(version), |section, name| {
            let full = format!("{PREFIX}{name}");
            let tensor = self.tensors.tensor(&full).map_err(unreadable)?;
            Ok(section.with_array(name, tensor.shape(), self.array(&full, tensor.shape())?))
        })
    }

    /// Checks that the file contains the arrays of the model and of the prior and no others, and compares the checksum.
    fn verify(&self, sealed: &Sealed, model: &Model, prior: Option<&Section>) -> Result<()> {
        let arrays = model.arrays();
        let others = prior.into_iter().flat_map(|prior| prior.arrays.keys().map(String::as_str));
        let names: Vec<&str> = arrays.iter().map(|(name, ..)| *name).chain(others).collect();
        ensure(names.len() == self.tensors.len(), "it contains arrays that do not belong to a model")?;
        let tensors: Vec<_> = names.iter().filter_map(|name| self.tensors.tensor(name).ok()).collect();
        let data = names.iter().copied().zip(tensors.iter().map(|tensor| tensor.data()));
        ensure(checksum(&sealed.model, sealed.prior, data)? == sealed.crc32, "damaged: the checksum does not match")
    }
}

/// Returns the maximum magnitude of the elements of an array: the limit of the interface, squared for variances.
fn max_magnitude(name: &str) -> f64 {
    match name {
        "styles" => MAX_STYLE_MAGNITUDE,
        "residual_variance" => MAX_MAGNITUDE * MAX_MAGNITUDE,
        _ => MAX_MAGNITUDE,
    }
}

impl Constants {
    /// Checks that the constants lie within the bounds that a fit imposes.
    fn check(&self) -> Result<()> {
        let (phase_rate, u_end) = match self.canonical {
            Canonical::Discrete { alpha_x, u_end } => (alpha_x, u_end),
            Canonical::Rhythmic { mu } => (mu, 1.0),
        };
        let max_slope = self.slope.unwrap_or(1.0);
        TimeWarp { n_segments: 1, max_slope }.check(1).map_err(unreadable)?;
        for (name, value, limit) in [
            ("tau", self.tau, MAX_TAU),
            ("alpha_z", self.alpha_z, MAX_RATE),
            ("beta_z", self.beta_z, MAX_RATE),
            ("alpha_x or mu", phase_rate, MAX_RATE),
            ("u_end", u_end, 1.01e3),
        ] {
            ensure((1.0 / limit..=limit).contains(&value), &format!("{name} = {value} is out of range"))?;
        }
        Ok(())
    }
}
