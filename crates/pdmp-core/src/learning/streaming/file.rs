//! Files of partial fits, and the bytes of the parts of a second pass: safetensors, with the constants as JSON in the metadata.

use std::collections::HashMap;
use std::path::Path;

use ndarray::Array2;
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::block_styles::{BlockStyles, StyleProjection};
use super::partial_fit::{PartialFit, Regressor};
use super::row_factor::{RowFactor, Span};
use super::settings::Settings;
use super::summaries::{Summaries, Values};
use crate::dynamics::transport::Transport;
use crate::error::Result;
use crate::learning::options::FitOptions;
use crate::learning::transport_profile::ProfileSums;
use crate::model::file::{ensure, read_file, unreadable, write_atomically};
use crate::model::responses::Curves;
use crate::numerics::threads::Threads;

/// Version of the format.
const SCHEMA: u32 = 3;
/// Metadata key of the constants.
const KEY: &str = "pdmp-partial";

/// Constants with the version of the format, the type of the object and the checksum of its arrays.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sealed<T> {
    schema: u32,
    kind: String,
    crc32: u32,
    constants: T,
}

/// Arrays of an object by name, each with its shape.
type Arrays = Vec<(&'static str, Vec<usize>, Vec<f64>)>;

fn write<T: Serialize>(kind: &str, constants: T, arrays: Arrays) -> Result<Vec<u8>> {
    let arrays: Vec<(&str, Vec<usize>, Vec<u8>)> = arrays
        .into_iter()
        .map(|(name, shape, data)| (name, shape, data.iter().flat_map(|x| x.to_le_bytes()).collect()))
        .collect();
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&serde_json::to_vec(&constants).map_err(unreadable)?);
    arrays.iter().for_each(|(_, _, bytes)| hasher.update(bytes));
    let sealed = Sealed { schema: SCHEMA, kind: kind.to_string(), crc32: hasher.finalize(), constants };
    let json = serde_json::to_string(&sealed).map_err(unreadable)?;
    let views = arrays
        .iter()
        .map(|(name, shape, bytes)| Ok((*name, TensorView::new(Dtype::F64, shape.clone(), bytes)?)))
        .collect::<std::result::Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(unreadable)?;
    serialize(views, Some(HashMap::from([(KEY.to_string(), json)]))).map_err(unreadable)
}

/// Reader of the arrays of an object, in the order in which they were written.
struct Reader<'a> {
    tensors: SafeTensors<'a>,
    hasher: crc32fast::Hasher,
}

impl<'a> Reader<'a> {
    /// Returns the constants, the checksum and a reader of the arrays.
    fn open<T: Serialize + DeserializeOwned>(kind: &str, bytes: &'a [u8]) -> Result<(T, u32, Self)> {
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(unreadable)?;
        let json = metadata.metadata().as_ref().and_then(|all| all.get(KEY));
        let is_model = metadata.metadata().as_ref().is_some_and(|all| all.contains_key("pdmp"));
        let found =
            if is_model { format!("a model, not a {kind}: load it as a model") } else { format!("not a {kind}") };
        let json = json.ok_or_else(|| unreadable(found))?;
        let sealed: Sealed<T> = serde_json::from_str(json).map_err(unreadable)?;
        let found = sealed.schema;
        ensure(found == SCHEMA, &format!("version {found}, while this library reads version {SCHEMA}"))?;
        ensure(sealed.kind == kind, &format!("a {}, not a {kind}", sealed.kind))?;
        let canonical = serde_json::to_string(&sealed).map_err(unreadable)?;
        ensure(canonical == *json, "damaged: the text of its constants is not canonical")?;
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(&serde_json::to_vec(&sealed.constants).map_err(unreadable)?);
        let tensors = SafeTensors::deserialize(bytes).map_err(unreadable)?;
        Ok((sealed.constants, sealed.crc32, Self { tensors, hasher }))
    }

    /// Returns the elements of the next array, of the given shape.
    fn array(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f64>> {
        let tensor = self.tensors.tensor(name).map_err(|_| unreadable(format!("no array {name}")))?;
        if tensor.dtype() != Dtype::F64 || tensor.shape() != shape {
            return Err(unreadable(format!("{name} is {:?}, expected F64 {shape:?}", tensor.shape())));
        }
        self.hasher.update(tensor.data());
        let (bytes, _) = tensor.data().as_chunks();
        let data: Vec<f64> = bytes.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        ensure(data.iter().all(|x| x.is_finite()), &format!("{name} is not finite"))?;
        Ok(data)
    }

    fn matrix(&mut self, name: &str, shape: (usize, usize)) -> Result<Array2<f64>> {
        let data = self.array(name, &[shape.0, shape.1])?;
        Array2::from_shape_vec(shape, data).map_err(|error| unreadable(format!("{name}: {error}")))
    }

    /// Returns the lengths of an array with N axes.
    fn shape<const N: usize>(&self, name: &str) -> Result<[usize; N]> {
        let tensor = self.tensors.tensor(name).map_err(|_| unreadable(format!("no array {name}")))?;
        tensor.shape().try_into().map_err(|_| unreadable(format!("{name} has {} axes", tensor.shape().len())))
    }

    fn close(self, crc32: u32) -> Result<()> {
        ensure(self.hasher.finalize() == crc32, "damaged: its checksum does not agree")
    }
}

fn flat(name: &'static str, matrix: &Array2<f64>) -> (&'static str, Vec<usize>, Vec<f64>) {
    (name, matrix.shape().to_vec(), matrix.iter().copied().collect())
}

fn list(name: &'static str, values: Vec<f64>) -> (&'static str, Vec<usize>, Vec<f64>) {
    (name, vec![values.len()], values)
}

/// Constants of a partial fit.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Constants {
    settings: Settings,
    regressors: Vec<Regressor>,
    /// Labels of each context value; empty for a number.
    labels: Vec<Vec<String>>,
    /// Largest norm of a row of the targets, if they lie in a span.
    largest: Option<f64>,
}

/// Type of an object in its file.
const PARTIAL: &str = "partial fit";
const PROJECTION: &str = "style projection";
const STYLES: &str = "styles of a block";

impl PartialFit {
    /// Writes a file atomically, as [`Model::save`](crate::Model::save) does.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions};
    /// # use pdmp_core::learning::PartialFit;
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("reaches.safetensors");
    /// let options = FitOptions::discrete();
    /// let mut partial = PartialFit::new(&demos, &options)?;
    /// partial.update(&demos[..2])?;
    /// partial.save(&path)?;
    /// let mut loaded = PartialFit::load(&path)?;
    /// loaded.update(&demos[2..])?;
    /// assert_eq!(loaded.n_demos(), 3);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A path that cannot be written, or whose folder does not exist.
    pub fn save(&self, path: &Path) -> Result<()> {
        write_atomically(path, &self.to_bytes()?)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// A path that cannot be read, or a file that is damaged, not a partial fit, or of another version.
    pub fn load(path: &Path) -> Result<Self> {
        read_file(path, Self::from_bytes)
    }

    /// Returns the partial fit as the bytes of a file; findings are left out.
    ///
    /// # Errors
    /// A partial fit that exceeds the limits of the format.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let summaries = &self.summaries;
        let labels = |values: &Values| match values {
            Values::Numbers(_) => Vec::new(),
            Values::Labels(labels, _) => labels.clone(),
        };
        let numbers = |values: &Values| match values {
            Values::Numbers(numbers) => numbers.clone(),
            Values::Labels(_, indices) => indices.iter().map(|index| *index as f64).collect(),
        };
        let (span, triangle) = self.factor.parts();
        let constants = Constants {
            settings: self.settings.clone(),
            regressors: self.regressors.clone(),
            labels: summaries.contexts.iter().map(labels).collect(),
            largest: span.map(|span| span.largest),
        };
        let (profile_samples, profile_dofs, profile_counts) = self.profile.numbers();
        let arrays = vec![
            list("span", span.map_or_else(Vec::new, |span| span.vectors.clone())),
            list("triangle", triangle),
            flat("profile.samples", &profile_samples),
            flat("profile.dofs", &profile_dofs),
            list("profile.counts", profile_counts.to_vec()),
            list("ranges", self.ranges.clone()),
            list("accelerations", self.accelerations.clone()),
            list("starts", summaries.starts.clone()),
            list("goals", summaries.goals.clone()),
            list("anchors", summaries.anchors.clone()),
            list("durations", summaries.durations.clone()),
            list("n_recorded", summaries.n_recorded.iter().map(|n| *n as f64).collect()),
            list("magnitudes", summaries.magnitudes.clone()),
            list("contexts", summaries.contexts.iter().flat_map(numbers).collect()),
        ];
        write(PARTIAL, constants, arrays)
    }

    /// Reads a partial fit from the bytes of a file.
    ///
    /// # Errors
    /// Bytes that are damaged, not a partial fit, or of another version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let (constants, crc32, mut reader) = Reader::open::<Constants>(PARTIAL, bytes)?;
        let Constants { settings, regressors, labels, largest } = constants;
        settings.check().map_err(unreadable)?;
        let mut partial = Self::with(settings, Threads::available())?;
        let (n_dofs, n_contexts) = (partial.n_dofs(), partial.settings.contexts.len());
        ensure(labels.len() == n_contexts && regressors.starts_with(&partial.regressors), "its contexts do not agree")?;
        let n = partial.factor.n_columns() + regressors.len() - partial.regressors.len();
        let [n_demos] = reader.shape("durations")?;
        let [n_vectors] = reader.shape("span")?.map(|length: usize| length / n);
        let vectors = reader.array("span", &[n_vectors * n])?;
        let span = largest.map(|largest| Span { vectors, largest });
        let rank = if span.is_some() { n_vectors } else { n };
        partial.factor = RowFactor::from_parts(n, span, &reader.array("triangle", &[rank * (rank + 1) / 2])?);
        let n_profile = partial.profile.n_samples();
        let samples = reader.matrix("profile.samples", (n_profile, 2 * n_dofs + 1))?;
        let (dofs, counts) = (reader.matrix("profile.dofs", (3, n_dofs))?, reader.array("profile.counts", &[2])?);
        partial.profile = ProfileSums::from_numbers(&samples, &dofs, [counts[0], counts[1]]);
        (partial.ranges, partial.accelerations) =
            (reader.array("ranges", &[n_dofs])?, reader.array("accelerations", &[n_dofs])?);
        let mut vectors = |name| reader.array(name, &[n_demos * n_dofs]);
        let (starts, goals, anchors) = (vectors("starts")?, vectors("goals")?, vectors("anchors")?);
        let durations = reader.array("durations", &[n_demos])?;
        ensure(durations.iter().all(|seconds| *seconds > 0.0), "a duration is not positive")?;
        let n_recorded = reader.array("n_recorded", &[n_demos])?.into_iter().map(|n| n as usize).collect();
        let magnitudes = reader.array("magnitudes", &[n_demos * (n_dofs + 1)])?;
        let numbers = reader.array("contexts", &[n_demos * n_contexts])?;
        reader.close(crc32)?;
        let mut summaries = Summaries::none(n_dofs, &partial.settings.contexts);
        for (k, (values, labels)) in summaries.contexts.iter_mut().zip(labels).enumerate() {
            let numbers = &numbers[k * n_demos..(k + 1) * n_demos];
            match values {
                Values::Numbers(own) => own.extend(numbers),
                Values::Labels(own, indices) => {
                    let valid = |x: &f64| *x >= 0.0 && x.fract() == 0.0 && (*x as usize) < labels.len();
                    ensure(numbers.iter().all(valid), "a label is out of range")?;
                    indices.extend(numbers.iter().map(|x| *x as usize));
                    *own = labels;
                }
            }
        }
        partial.summaries = Summaries { starts, goals, anchors, durations, n_recorded, magnitudes, ..summaries };
        partial.regressors = regressors;
        Ok(partial)
    }

    /// Sets the largest number of threads; the results do not depend on it.
    pub fn with_threads(self, options: &FitOptions) -> Self {
        Self { threads: options.threads, ..self }
    }
}

/// Constants of a projection.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ProjectionConstants {
    settings: Settings,
    nominal: usize,
    has_curves: bool,
}

impl StyleProjection {
    /// Returns the projection as bytes.
    ///
    /// # Errors
    /// A projection that exceeds the limits of the format.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let constants = ProjectionConstants {
            settings: self.settings.clone(),
            nominal: self.nominal,
            has_curves: self.curves.is_some(),
        };
        let mut arrays = vec![
            flat("directions", &self.directions),
            list("dof_scale", self.dof_scale.clone()),
            list("transport", self.transport.coefficients().to_vec()),
        ];
        if let Some(curves) = &self.curves {
            let (length, n_dofs) = curves.start.dim();
            let all = curves.styles.iter().chain([&curves.start, &curves.velocity]).flatten().copied();
            arrays.push(("curves", vec![curves.styles.len() + 2, length, n_dofs], all.collect()));
        }
        write(PROJECTION, constants, arrays)
    }

    /// Reads a projection from bytes.
    ///
    /// # Errors
    /// Bytes that are damaged, not a projection, or of another version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let (constants, crc32, mut reader) = Reader::open::<ProjectionConstants>(PROJECTION, bytes)?;
        let ProjectionConstants { settings, nominal, has_curves } = constants;
        settings.check().map_err(unreadable)?;
        let ([_, n_styles], [n_coefficients]) = (reader.shape("directions")?, reader.shape("transport")?);
        let n_dofs = settings.n_dofs();
        let directions = reader.matrix("directions", (settings.n_samples * n_dofs, n_styles))?;
        let dof_scale = reader.array("dof_scale", &[n_dofs])?;
        let coefficients = reader.array("transport", &[n_coefficients])?;
        let transport = Transport::from_coefficients(coefficients, settings.canonical).map_err(unreadable)?;
        let curves = if has_curves {
            let [_, length, _] = reader.shape("curves")?;
            let numbers = reader.array("curves", &[n_styles + 2, length, n_dofs])?;
            let curve =
                |k: usize| Array2::from_shape_fn((length, n_dofs), |(c, d)| numbers[(k * length + c) * n_dofs + d]);
            let styles = (0..n_styles).map(curve).collect();
            Some(Curves { styles, start: curve(n_styles), velocity: curve(n_styles + 1), goal_velocity: None })
        } else {
            None
        };
        reader.close(crc32)?;
        Ok(Self { settings, transport, dof_scale, directions, curves, nominal, threads: Threads::available() })
    }
}

/// Constants of the styles of a block.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StylesConstants {
    first: usize,
    has_squares: bool,
    has_nominal: bool,
}

impl BlockStyles {
    /// Returns the styles as bytes.
    ///
    /// # Errors
    /// Styles that exceed the limits of the format.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let (has_squares, has_nominal) = (self.squares.is_some(), self.nominal.is_some());
        let constants = StylesConstants { first: self.first, has_squares, has_nominal };
        let optional = [("squares", &self.squares), ("nominal", &self.nominal)];
        let optional = optional.into_iter().filter_map(|(name, matrix)| Some(flat(name, matrix.as_ref()?)));
        let arrays = [flat("styles", &self.styles), flat("starts", &self.starts)].into_iter().chain(optional).collect();
        write(STYLES, constants, arrays)
    }

    /// Reads styles from bytes.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions};
    /// use pdmp_core::learning::{BlockStyles, PartialFit, StyleProjection};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let options = FitOptions::discrete();
    /// # let mut partial = PartialFit::new(&demos, &options)?;
    /// # partial.update(&demos)?;
    /// let factorised = partial.factorise(&options, &mut |_, _| Ok(()))?;
    /// // In another process:
    /// let projection = StyleProjection::from_bytes(&factorised.projection().to_bytes()?)?;
    /// let bytes = projection.styles(&demos, 0, &mut |_| Ok(()))?.to_bytes()?;
    /// // Back in the first one:
    /// let model = factorised.finish(vec![BlockStyles::from_bytes(&bytes)?], &mut |_, _| Ok(()))?;
    /// assert_eq!(model.n_demos(), 3);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Bytes that are damaged, not the styles of a block, or of another version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let (constants, crc32, mut reader) = Reader::open::<StylesConstants>(STYLES, bytes)?;
        let StylesConstants { first, has_squares, has_nominal } = constants;
        let mut matrix = |name: &str| {
            let [rows, columns] = reader.shape(name)?;
            reader.matrix(name, (rows, columns))
        };
        let (styles, starts) = (matrix("styles")?, matrix("starts")?);
        ensure(styles.nrows() == starts.nrows(), "its arrays do not agree")?;
        let squares = if has_squares { Some(matrix("squares")?) } else { None };
        let nominal = if has_nominal { Some(matrix("nominal")?) } else { None };
        reader.close(crc32)?;
        Ok(Self { first, styles, starts, squares, nominal })
    }
}
