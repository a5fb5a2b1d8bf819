//! The bytes of a file into its model: dimensions, numbers and checksum are checked before one comes out.

use std::sync::Arc;

use ndarray::{Array2, Axis};
use safetensors::tensor::{Dtype, SafeTensors};
use serde::Deserialize;

use super::{Constants, Map, SCHEMA, Sealed, checksum, header};
use crate::context::{ContextMap, Kernel, MapKind, Recipe, Stack};
use crate::dynamics::canonical::Canonical;
use crate::dynamics::forcing_table::Landscape;
use crate::dynamics::hermite_table::{Jets, MOST_CELLS};
use crate::dynamics::output_system::Attractor;
use crate::dynamics::transport::Transport;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::LARGEST_STYLE;
use crate::model::primitive::{MAX_RATE, MAX_TAU, Parts, Primitive};
use crate::model::sensitivity::STEPS;
use crate::model::template::{Template, Warp};
use crate::model::{Demonstrated, Learnt, Model};
use crate::numerics::smoothing_spline::Noise;
use crate::validate::LARGEST;

impl Model {
    /// Reads a model from the bytes of a file.
    ///
    /// # Errors
    /// Bytes that are not whole, not a model, or of another version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let bad = |reason: &str| Error::File(reason.to_string());
        let json = header::constants(bytes)?;
        // The version is read alone first: another one may hold anything else.
        let version: Version = serde_json::from_str(&json).map_err(|error| Error::File(error.to_string()))?;
        match version.schema {
            Some(found) if found == u64::from(SCHEMA) => {}
            Some(found) => {
                return Err(Error::File(format!("version {found}, while this library reads version {SCHEMA}")));
            }
            None => return Err(bad("no schema version")),
        }
        let tensors = SafeTensors::deserialize(bytes).map_err(|error| Error::File(error.to_string()))?;
        let sealed: Sealed = serde_json::from_str(&json).map_err(|error| Error::File(error.to_string()))?;
        // One text alone is written for these constants: a flipped bit may leave another that means the same.
        if serde_json::to_string(&sealed).ok().as_deref() != Some(json.as_str()) {
            return Err(bad("damaged: its constants are not written as they were"));
        }
        Reader { tensors }.model(sealed.model, sealed.crc32)
    }
}

/// The version of a file, whatever else it holds.
#[derive(Deserialize)]
struct Version {
    schema: Option<u64>,
}

/// Takes arrays out of a file, checking dimensions and numbers.
struct Reader<'a> {
    tensors: SafeTensors<'a>,
}

impl Reader<'_> {
    fn array(&self, name: &str, shape: &[usize]) -> Result<Vec<f64>> {
        let tensor = self.tensors.tensor(name).map_err(|_| Error::File(format!("no array {name}")))?;
        if tensor.dtype() != Dtype::F64 || tensor.shape() != shape {
            let (dtype, found) = (tensor.dtype(), tensor.shape());
            return Err(Error::File(format!("{name} is {dtype:?} {found:?}, expected F64 {shape:?}")));
        }
        let data: Vec<f64> = tensor
            .data()
            .chunks_exact(8)
            .map(|chunk| f64::from_le_bytes(chunk.try_into().unwrap_or_default()))
            .collect();
        let limit = limit(name);
        match data.iter().position(|x| x.is_nan() || x.abs() > limit) {
            Some(index) => Err(Error::File(format!("{name} holds {:e} at {index}", data[index]))),
            None => Ok(data),
        }
    }

    fn matrix(&self, name: &str, shape: (usize, usize)) -> Result<Array2<f64>> {
        let data = self.array(name, &[shape.0, shape.1])?;
        Array2::from_shape_vec(shape, data).map_err(|error| Error::File(format!("{name}: {error}")))
    }

    fn positive(&self, name: &str, length: usize) -> Result<Vec<f64>> {
        let data = self.array(name, &[length])?;
        match data.iter().position(|x| *x <= 0.0) {
            Some(index) => Err(Error::File(format!("{name} holds {} at {index}, not a positive number", data[index]))),
            None => Ok(data),
        }
    }

    fn noise(&self, n_dofs: usize) -> Result<Noise> {
        let [levels, cut_offs] = [self.array("noise.levels", &[n_dofs])?, self.array("noise.cut_offs", &[n_dofs])?];
        if levels.iter().chain(&cut_offs).any(|x| *x < 0.0) {
            return Err(Error::File("a noise or cut-off is negative".to_string()));
        }
        Ok(Noise { levels, cut_offs: cut_offs.into_iter().map(|hz| Some(hz).filter(|hz| *hz > 0.0)).collect() })
    }

    fn shape<const N: usize>(&self, name: &str) -> Result<[usize; N]> {
        let tensor = self.tensors.tensor(name).map_err(|_| Error::File(format!("no array {name}")))?;
        tensor.shape().try_into().map_err(|_| Error::File(format!("{name} has {} axes", tensor.shape().len())))
    }

    fn model(&self, constants: Constants, crc32: u32) -> Result<Model> {
        let bad = |reason: &str| Error::File(reason.to_string());
        let kind = constants.canonical.kind();
        let [n_demos, n_styles] = self.shape("styles")?;
        let [n_knots, _, n_dofs] = self.shape("landscape.values")?;
        let [n_values] = self.shape("singular_values")?;
        let [_, n_segments] = self.shape("timings")?;
        if n_segments == 0 || n_demos == 0 || n_styles == 0 || n_dofs == 0 || n_values < n_styles {
            return Err(bad("an array is empty"));
        }
        if !(2..=MOST_CELLS + 1).contains(&n_knots)
            || [&constants.names, &constants.units].iter().any(|labels| labels.len() != n_dofs)
        {
            return Err(bad("the landscape does not fit the rest"));
        }
        if constants.nominal >= n_demos || constants.n_samples < crate::demonstration::LEAST_SAMPLES {
            return Err(bad("nominal or n_samples is out of range"));
        }
        constants.check()?;

        let contexts = match &constants.map {
            Some(map) => Some(self.matrix("contexts", (n_demos, map.columns.len()))?),
            None => None,
        };
        let knots = |name| self.array(name, &[n_knots, n_styles, n_dofs]);
        let (values, slopes) = (knots("landscape.values")?, knots("landscape.slopes")?);
        let knots = Jets { n_outputs: n_styles * n_dofs, values, slopes };
        let landscape = Landscape::from_knots(constants.canonical, n_dofs, &knots, constants.table_error);
        let [n_coefficients] = self.shape("transport")?;
        let transport = self.array("transport", &[n_coefficients])?;
        let transport = Transport::from_coefficients(transport, constants.canonical)
            .map_err(|error| Error::File(error.to_string()))?;
        let braking = constants.braking;
        // Slower than z the two parts of the forcing past the end would part without bound.
        let sound = braking.is_none_or(|braking| (constants.alpha_z..=1e12).contains(&braking));
        if braking.is_none() != transport.is_immediate() || !sound {
            return Err(bad("braking does not fit the rest"));
        }
        let breaks = self.array("breaks", &[n_segments + 1])?;
        if breaks[0] != 0.0 || breaks[n_segments] != 1.0 || breaks.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(bad("breaks do not increase from 0 to 1"));
        }
        let timings = self.matrix("timings", (n_demos, n_segments))?;
        if timings.iter().any(|seconds| *seconds <= 0.0) {
            return Err(bad("a time is not positive"));
        }
        // What a fit makes so: movements of default length and rate then have the number of samples that dt promises.
        let share = timings.row(constants.nominal).sum() / (constants.tau * constants.canonical.extent());
        if !((1.0 - 1e-6)..=(1.0 + 1e-6)).contains(&share) {
            return Err(bad("tau does not agree with the nominal duration"));
        }
        let demonstrated = Demonstrated {
            styles: self.matrix("styles", (n_demos, n_styles))?,
            goals: self.matrix("goals", (n_demos, n_dofs))?,
            starts: self.matrix("starts", (n_demos, n_dofs))?,
            anchors: self.matrix("anchors", (n_demos, n_dofs))?,
            durations: timings.sum_axis(Axis(1)).to_vec(),
            timings,
            contexts,
            nominal: constants.nominal,
        };
        let singular_values = self.array("singular_values", &[n_values])?;
        let dof_scale = self.positive("dof_scale", n_dofs)?;
        let ranges = self.array("ranges", &[n_dofs])?;
        if singular_values.iter().chain(&ranges).any(|x| *x < 0.0) {
            return Err(bad("a range or singular value is negative"));
        }
        let (map, left_over) = match &constants.map {
            Some(map) => {
                let left_over = self.matrix("left_over", (kind.samples(STEPS), n_dofs))?;
                if left_over.iter().any(|x| *x < 0.0) {
                    return Err(bad("left_over holds no variances"));
                }
                (Some(self.map(map, &demonstrated, kind)?), Some(left_over))
            }
            None => (None, None),
        };
        let learnt = Learnt {
            n_samples: constants.n_samples,
            noise: self.noise(n_dofs)?,
            template: self.template(&constants, n_segments, n_dofs)?,
            dof_scale,
            singular_values,
            left_out: constants.left_out,
            left_over,
            findings: Vec::new(),
            basis: constants.basis.clone(),
        };
        let primitive = Primitive::new(Parts {
            attractor: Attractor { alpha_z: constants.alpha_z, beta_z: constants.beta_z },
            landscape,
            transport,
            braking,
            tau: constants.tau,
            names: constants.names.clone(),
            units: constants.units.clone(),
            ranges,
            breaks,
            nominal: demonstrated.nominal(kind),
        });
        let model = Model { primitive: Arc::new(primitive), demonstrated, learnt, map };
        self.verify(&constants, &model, crc32)?;
        Ok(model)
    }

    fn template(&self, constants: &Constants, n_segments: usize, n_dofs: usize) -> Result<Option<Template>> {
        let Some(slope) = constants.slope else { return Ok(None) };
        let shape = self.matrix("template.shape", (Template::cells(n_segments), n_dofs))?;
        Ok(Some(Template { slope, unit: self.positive("template.unit", n_dofs)?, shape }))
    }

    /// The map, had again from what was demonstrated.
    fn map(&self, map: &Map, demonstrated: &Demonstrated, kind: Kind) -> Result<ContextMap> {
        let bad = |reason: &str| Error::File(reason.to_string());
        let outputs = demonstrated.outputs(kind);
        let ratios = self.array("map.ratios", &[outputs.ncols()])?;
        let sound = match map.kernel {
            None => ratios.iter().all(|ratio| *ratio == 0.0),
            Some(Kernel::Linear) => false,
            Some(Kernel::Quadratic) => ratios.iter().all(|ratio| *ratio >= 0.0),
            Some(Kernel::Matern { length }) => length > 0.0 && ratios.iter().all(|ratio| *ratio >= 0.0),
        };
        let contexts = demonstrated.contexts.as_ref().ok_or(bad("no contexts"))?;
        for (q, column) in map.columns.iter().enumerate() {
            if contexts.column(q).iter().any(|&number| column.value(q, number).is_err()) {
                return Err(bad("a context is none of its labels"));
            }
        }
        if !sound {
            return Err(bad("the map's constants are out of range"));
        }
        let errors = map.errors.iter().map(|&(kind, error)| (kind, error.unwrap_or(f64::INFINITY))).collect();
        let directions = self.matrix("map.directions", (outputs.ncols(), outputs.ncols()))?;
        let trend = match map.kind {
            MapKind::Stacked => Some(self.trend(outputs.ncols())?),
            _ => None,
        };
        let recipe = Recipe { kind: map.kind, kernel: map.kernel, directions, ratios, trend, errors };
        ContextMap::restore(map.columns.clone(), contexts, outputs.view(), recipe)
            .map_err(|error| Error::File(error.to_string()))
    }

    /// The line of a stacked map: ratios (P,) and weights.
    fn trend(&self, n_outputs: usize) -> Result<(Vec<f64>, Stack)> {
        let slopes = self.array("map.slopes", &[n_outputs])?;
        let weights = self.array("map.weights", &[2, 2])?;
        let stack = Stack { inside: [weights[0], weights[1]], outside: [weights[2], weights[3]] };
        let sound = |[g, l]: [f64; 2]| g >= 0.0 && l >= 0.0 && g + l <= 1.0 + 1e-9;
        if slopes.iter().any(|ratio| *ratio < 0.0) || !sound(stack.inside) || !sound(stack.outside) {
            return Err(Error::File("the map's line is out of range".to_string()));
        }
        Ok((slopes, stack))
    }

    /// Checks that the file holds the model's arrays and no others, unchanged.
    fn verify(&self, constants: &Constants, model: &Model, crc32: u32) -> Result<()> {
        let names: Vec<&str> = model.arrays().iter().map(|(name, ..)| *name).collect();
        if names.len() != self.tensors.len() {
            return Err(Error::File("arrays that do not belong to a model".to_string()));
        }
        let tensors: Vec<_> = names.iter().filter_map(|name| self.tensors.tensor(name).ok()).collect();
        let found = checksum(constants, names.iter().copied().zip(tensors.iter().map(|tensor| tensor.data())))?;
        if found == crc32 { Ok(()) } else { Err(Error::File("damaged: the checksum does not match".to_string())) }
    }
}

/// Largest magnitude of an array's numbers: what the interface takes, or for a variance the square of it.
fn limit(name: &str) -> f64 {
    match name {
        "styles" => LARGEST_STYLE,
        "left_over" => LARGEST * LARGEST,
        _ => LARGEST,
    }
}

impl Constants {
    fn check(&self) -> Result<()> {
        let (a, b) = match self.canonical {
            Canonical::Discrete { alpha_x, u_end } => (alpha_x, u_end),
            Canonical::Rhythmic { mu } => (mu, 1.0),
        };
        let slope = self.slope.unwrap_or(1.0);
        Warp { segments: 1, slope }.check(1).map_err(|error| Error::File(error.to_string()))?;
        // The bounds within which these are learnt.
        for (name, value, limit) in [
            ("tau", self.tau, MAX_TAU),
            ("alpha_z", self.alpha_z, MAX_RATE),
            ("beta_z", self.beta_z, MAX_RATE),
            ("alpha_x or mu", a, MAX_RATE),
            ("u_end", b, 1.01e3),
        ] {
            if !(1.0 / limit..=limit).contains(&value) {
                return Err(Error::File(format!("{name} = {value} is out of range")));
            }
        }
        Ok(())
    }
}
