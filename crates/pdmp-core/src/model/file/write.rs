//! Serialisation of a model to the bytes of a file.

use std::collections::HashMap;

use ndarray::Array2;
use safetensors::tensor::{Dtype, TensorView, serialize};

use super::section::Section;
use super::{Constants, KEY, Layout, Map, SCHEMA, Sealed, checksum, header, unreadable};
use crate::context::{ContextMap, MapParameters, StackingWeights};
use crate::dynamics::hermite_table::KnotTable;
use crate::error::Result;
use crate::model::{Coordinates, Model};
use crate::numerics::smoothing_spline::NATURAL;

/// Array of a file: its name, shape and elements by rows.
type Array = (&'static str, Vec<usize>, Vec<f64>);

fn matrix(name: &'static str, matrix: &Array2<f64>) -> Array {
    (name, matrix.shape().to_vec(), matrix.iter().copied().collect())
}

fn vector(name: &'static str, vector: &[f64]) -> Array {
    (name, vec![vector.len()], vector.to_vec())
}

fn little_endian(data: &[f64]) -> Vec<u8> {
    data.iter().flat_map(|x| x.to_le_bytes()).collect()
}

impl Model {
    /// Returns the model as the bytes of a file.
    ///
    /// # Errors
    /// A model that exceeds the limits of the format.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        self.to_bytes_with(None)
    }

    /// Returns the model, with its prior if there is one, as the bytes of a file.
    ///
    /// # Errors
    /// As for [`Self::to_bytes`].
    pub(crate) fn to_bytes_with(&self, prior: Option<&Section>) -> Result<Vec<u8>> {
        let constants = Constants {
            canonical: self.canonical(),
            tau: self.tau,
            alpha_z: self.attractor.alpha_z,
            beta_z: self.attractor.beta_z,
            braking: self.braking,
            names: self.names.clone(),
            units: self.units.clone(),
            nominal: self.demonstrated.nominal,
            n_samples: self.learnt.n_samples,
            slope: self.learnt.template.as_ref().map(|template| template.slope),
            truncation_error: self.learnt.truncation_error,
            regression: self.learnt.regression.clone(),
            table_error: self.forcing_table.error(),
            map: self.map.as_ref().map(Map::of),
            coordinates: self.coordinates().map(Layout::of),
        };
        let others = prior.into_iter().flat_map(|prior| &prior.arrays);
        let arrays: Vec<(&str, Vec<usize>, Vec<u8>)> = self
            .arrays()
            .into_iter()
            .map(|(name, shape, data)| (name, shape, little_endian(&data)))
            .chain(others.map(|(name, (shape, data))| (name.as_str(), shape.clone(), little_endian(data))))
            .collect();
        let version = prior.map(|prior| prior.version);
        let crc32 = checksum(&constants, version, arrays.iter().map(|(name, _, bytes)| (*name, bytes.as_slice())))?;
        let sealed = Sealed { schema: SCHEMA, crc32, model: constants, prior: version };
        let json = serde_json::to_string(&sealed).map_err(unreadable)?;
        let views = arrays
            .iter()
            .map(|(name, shape, bytes)| Ok((*name, TensorView::new(Dtype::F64, shape.clone(), bytes)?)))
            .collect::<std::result::Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(unreadable)?;
        let metadata = HashMap::from([(KEY.to_string(), json)]);
        let bytes = serialize(views, Some(metadata)).map_err(unreadable)?;
        header::constants(&bytes)?;
        Ok(bytes)
    }

    /// Returns the arrays of the model's file.
    pub(super) fn arrays(&self) -> Vec<Array> {
        let demonstrated = &self.demonstrated;
        let KnotTable { values, slopes, .. } = self.forcing_table.knots();
        let knots = vec![self.forcing_table.cells() + 1, self.n_styles(), self.n_dofs()];
        // 0 stands for interpolation without smoothing.
        let cut_offs: Vec<f64> = self.learnt.noise.cut_offs().iter().map(|hz| hz.unwrap_or(0.0)).collect();
        let mut arrays = vec![
            matrix("styles", &demonstrated.styles),
            matrix("goals", &demonstrated.goals),
            matrix("starts", &demonstrated.starts),
            matrix("anchors", &demonstrated.anchors),
            vector("breaks", &self.breaks),
            matrix("segment_durations", &demonstrated.segment_durations),
            vector("singular_values", &self.learnt.singular_values),
            vector("dof_scale", &self.learnt.dof_scale),
            vector("ranges", &self.ranges),
            vector("noise.levels", self.learnt.noise.levels()),
            vector("noise.cut_offs", &cut_offs),
            vector("transport", self.transport.coefficients()),
            ("forcing_table.values", knots.clone(), values),
            ("forcing_table.slopes", knots, slopes),
        ];
        let ends = self.learnt.noise.ends();
        if ends.iter().any(|rest| *rest != NATURAL) {
            let numbers = ends.iter().flatten().map(|is_at_rest| f64::from(u8::from(*is_at_rest))).collect();
            arrays.push(("noise.ends", vec![ends.len(), 2], numbers));
        }
        if let Some(coordinates) = self.coordinates() {
            let knots: Vec<_> = coordinates.rotations().iter().map(|rotation| rotation.mean.knots()).collect();
            let shape = vec![knots.len(), knots.first().map_or(0, |knots| knots.len()), 4];
            arrays.push(("mean_rotations", shape, knots.concat().concat()));
        }
        if let Some(template) = &self.learnt.template {
            arrays.push(vector("template.unit", &template.unit));
            arrays.push(matrix("template.shape", &template.shape));
        }
        if let (Some(contexts), Some(map)) = (&demonstrated.contexts, &self.map) {
            arrays.push(matrix("contexts", contexts));
            let parameters = map.parameters();
            arrays.push(matrix("map.directions", map.directions()));
            arrays.push(vector("map.ratios", &parameters.ratios));
            if let Some((ratios, StackingWeights { interpolation, extrapolation })) = &parameters.line {
                arrays.push(vector("map.slopes", ratios));
                arrays.push(("map.weights", vec![2, 2], [*interpolation, *extrapolation].concat()));
            }
            arrays.extend(
                self.learnt
                    .residual_variance
                    .as_ref()
                    .map(|residual_variance| matrix("residual_variance", residual_variance)),
            );
        }
        arrays
    }
}

impl Layout {
    fn of(coordinates: &Coordinates) -> Self {
        Self {
            names: coordinates.names().to_vec(),
            units: coordinates.units().to_vec(),
            frame: coordinates.frame(),
            rotations: coordinates.columns(),
        }
    }
}

impl Map {
    /// Returns the constants of a context map.
    fn of(map: &ContextMap) -> Self {
        let MapParameters { kind, kernel, errors, .. } = map.parameters();
        // JSON has no infinity, the error of a map that no other contexts can predict.
        let errors = errors.iter().map(|&(kind, error)| (kind, error.is_finite().then_some(error))).collect();
        Self { columns: map.columns().to_vec(), names: map.names().to_vec(), kind: *kind, kernel: *kernel, errors }
    }
}
