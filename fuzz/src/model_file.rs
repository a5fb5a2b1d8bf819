//! Model files with changed numbers, shapes and constants, and a valid checksum.
//!
//! An input is a list of edits to a small model instead of a file, so that the corpus survives changes of the format.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock};

use ndarray::Array2;
use pdmp_core::model::Derivative;
use pdmp_core::motion::{BatchConditions, PerMovement, TimeGrid, WithRespectTo};
use pdmp_core::motion::{PredictionBand, prediction_band};
use pdmp_core::motion::{batch, jacobian};
use pdmp_core::numerics::Threads;
use pdmp_core::rollout;
use pdmp_core::{Conditions, Controller, Model};
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde_json::Value;

use crate::input::{Input, MODELS};

/// Maximum number of edits of one file.
const MAX_EDITS: usize = 12;
/// Arrays in the order of the checksum. The positions of arrays that are not listed are found by trial.
const CHECKSUM_ORDER: [&str; 19] = [
    "styles",
    "goals",
    "starts",
    "anchors",
    "breaks",
    "segment_durations",
    "singular_values",
    "dof_scale",
    "ranges",
    "noise.levels",
    "noise.cut_offs",
    "forcing_table.values",
    "forcing_table.slopes",
    "template.unit",
    "template.shape",
    "contexts",
    "map.directions",
    "map.ratios",
    "residual_variance",
];

/// Checks that an edited file is rejected, or loads to a model that moves in finite numbers and can be saved and loaded
/// again.
///
/// # Panics
/// Panics if the check fails.
pub fn check(data: &[u8]) {
    let mut input = Input::new(data);
    let mut file = FILES[input.below(FILES.len())].clone();
    for _ in 0..MAX_EDITS {
        let Some(edit) = input.next() else { break };
        file.edit(edit, &mut input);
    }
    if let Ok(model) = Model::from_bytes(&file.serialize()) {
        exercise(&Arc::new(model));
    }
}

static FILES: LazyLock<Vec<EditableFile>> =
    LazyLock::new(|| MODELS.iter().map(|bytes| EditableFile::parse(bytes)).collect());

#[derive(Clone)]
/// Array of a model file.
struct Array {
    name: String,
    shape: Vec<usize>,
    data: Vec<f64>,
}

/// Parts of a model file.
#[derive(Clone)]
struct EditableFile {
    schema: Value,
    /// JSON of the constants, byte for byte as the library writes it: the checksum covers it.
    constants: String,
    /// Arrays in the order of the checksum.
    arrays: Vec<Array>,
}

impl EditableFile {
    /// Parses a model file.
    fn parse(bytes: &[u8]) -> Self {
        let (_, header) = SafeTensors::read_metadata(bytes).unwrap();
        let json = &header.metadata().as_ref().unwrap()["pdmp"];
        let metadata: Value = serde_json::from_str(json).unwrap();
        let start = json.find("\"model\":").unwrap() + "\"model\":".len();
        let constants = json[start..json.len() - 1].to_string();
        let tensors = SafeTensors::deserialize(bytes).unwrap();
        let array = |(name, tensor): (&str, TensorView)| {
            let data = tensor.data().chunks_exact(8).map(|x| f64::from_le_bytes(x.try_into().unwrap())).collect();
            Array { name: name.to_string(), shape: tensor.shape().to_vec(), data }
        };
        let (mut arrays, rest): (Vec<_>, Vec<_>) =
            tensors.iter().map(array).partition(|array| CHECKSUM_ORDER.contains(&array.name.as_str()));
        arrays.sort_by_key(|array| CHECKSUM_ORDER.iter().position(|name| *name == array.name));
        let crc32 = metadata["crc32"].as_u64().unwrap();
        let arrays = ordered(&constants, arrays, &rest, crc32).expect("no order of the arrays matches the checksum");
        let file = Self { schema: metadata["schema"].clone(), constants, arrays };
        assert!(file.serialize() == bytes, "an unedited file differs from that of the library");
        file
    }

    /// Returns the bytes of the file, with a valid checksum.
    fn serialize(&self) -> Vec<u8> {
        let crc32 = checksum(&self.constants, &self.arrays);
        let json = format!(r#"{{"schema":{},"crc32":{crc32},"model":{}}}"#, self.schema, self.constants);
        let bytes: Vec<Vec<u8>> = self.arrays.iter().map(bytes).collect();
        let views = self.arrays.iter().zip(&bytes).map(|(array, bytes)| {
            (array.name.as_str(), TensorView::new(Dtype::F64, array.shape.clone(), bytes).unwrap())
        });
        serialize(views, Some(HashMap::from([("pdmp".to_string(), json)]))).unwrap()
    }

    /// Applies one edit.
    fn edit(&mut self, edit: u8, input: &mut Input) {
        if self.arrays.is_empty() {
            return;
        }
        match edit % 12 {
            0..4 => {
                let array = self.array(input);
                let index = input.index(array.data.len());
                if let Some(x) = array.data.get_mut(index) {
                    *x = input.number();
                }
            }
            4 => {
                let number = input.number();
                self.array(input).data.fill(number);
            }
            5 => {
                let factor = input.number();
                self.array(input).data.iter_mut().for_each(|x| *x *= factor);
            }
            6..9 => self.constant(input),
            9 => {
                // Another number of demonstrations, up to 1024-fold.
                let n = self.arrays[0].shape[0];
                let resized = match input.byte() {
                    0 => n.saturating_sub(1),
                    1 => n + 1,
                    doublings => n << (doublings % 11),
                };
                for array in self.arrays.iter_mut().filter(|array| array.shape[0] == n) {
                    array.resize(resized);
                    if array.name == "contexts" {
                        array.data.iter_mut().enumerate().skip(n).for_each(|(k, x)| *x += k as f64 * 1e-5);
                    }
                }
            }
            10 => {
                let (change, array) = (input.byte(), self.array(input));
                let n = array.shape[0];
                let count = usize::from(change / 2);
                array.resize(if change % 2 == 0 { n + count } else { n.saturating_sub(count) });
            }
            _ => {
                let source = self.array(input).clone();
                let target = self.array(input);
                match source.data.len() == target.data.len() {
                    true => target.data = source.data,
                    false => target.shape.reverse(),
                }
            }
        }
    }

    /// Returns the array whose name has the hash closest to a byte, which new arrays rarely change.
    fn array(&mut self, input: &mut Input) -> &mut Array {
        let key = input.byte();
        self.arrays.iter_mut().min_by_key(|array| crc32fast::hash(array.name.as_bytes()) as u8 ^ key).unwrap()
    }

    /// Replaces a constant by a number, by null or by another constant.
    fn constant(&mut self, input: &mut Input) {
        let scalars = scalars(&self.constants);
        let key = input.byte();
        let nearest = |(name, _): &&(String, _)| crc32fast::hash(name.as_bytes()) as u8 ^ key;
        let Some(name) = scalars.iter().min_by_key(nearest).map(|(name, _)| name) else { return };
        let ranges: Vec<_> =
            scalars.iter().filter(|(other, _)| other == name).map(|(_, range)| range.clone()).collect();
        let range = ranges[input.below(ranges.len())].clone();
        let is_integer = self.constants[range.clone()].bytes().all(|c| c.is_ascii_digit());
        let text = match input.byte() {
            0..32 => "null".to_string(),
            32..64 => self.constants[scalars[input.below(scalars.len())].1.clone()].to_string(),
            _ if is_integer => (input.number() as u64).to_string(),
            _ => serde_json::to_string(&input.number()).unwrap(),
        };
        self.constants.replace_range(range, &text);
    }
}

impl Array {
    /// Sets the length of the first axis, repeating the data if necessary.
    fn resize(&mut self, n: usize) {
        let row = self.shape[1..].iter().product::<usize>();
        if self.data.is_empty() || n * row > 1 << 20 {
            return;
        }
        self.data = self.data.iter().copied().cycle().take(n * row).collect();
        self.shape[0] = n;
    }
}

/// Returns the key and the byte range of each scalar of a JSON text.
fn scalars(json: &str) -> Vec<(String, std::ops::Range<usize>)> {
    let (mut found, mut key, mut position) = (Vec::new(), String::new(), 0);
    let bytes = json.as_bytes();
    while position < bytes.len() {
        let start = position;
        match bytes[position] {
            b'"' => {
                position += 1;
                while bytes[position] != b'"' {
                    position += if bytes[position] == b'\\' { 2 } else { 1 };
                }
                position += 1;
                match bytes.get(position) {
                    Some(b':') => key = json[start + 1..position - 1].to_string(),
                    _ => found.push((key.clone(), start..position)),
                }
            }
            b'{' | b'}' | b'[' | b']' | b',' | b':' => position += 1,
            _ => {
                position += bytes[position..].iter().take_while(|c| !b",]}".contains(c)).count();
                found.push((key.clone(), start..position));
            }
        }
    }
    found
}

/// Returns the data of an array, little-endian.
fn bytes(array: &Array) -> Vec<u8> {
    array.data.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// Returns the CRC-32 of the constants and of the names and data of the arrays.
fn checksum(constants: &str, arrays: &[Array]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(constants.as_bytes());
    for array in arrays {
        hasher.update(array.name.as_bytes());
        hasher.update(&bytes(array));
    }
    hasher.finalize()
}

/// Returns all arrays in the order that matches the checksum, `others` inserted by trial.
fn ordered(constants: &str, arrays: Vec<Array>, others: &[Array], crc32: u64) -> Option<Vec<Array>> {
    let Some((other, others)) = others.split_first() else {
        return (u64::from(checksum(constants, &arrays)) == crc32).then_some(arrays);
    };
    (0..=arrays.len()).find_map(|position| {
        let mut arrays = arrays.clone();
        arrays.insert(position, other.clone());
        ordered(constants, arrays, others, crc32)
    })
}

/// Checks that each way to move a model returns finite numbers or an error.
fn exercise(model: &Arc<Model>) {
    let reloaded = Model::from_bytes(&model.to_bytes().expect("a loaded model cannot be saved"));
    assert!(reloaded.is_ok(), "a saved model cannot be loaded: {reloaded:?}");
    let nominal = Conditions::default();
    let grid = TimeGrid { dt: model.duration() / 50.0, duration: None };
    if let Ok(trajectory) = rollout(model.primitive(), &nominal, grid) {
        assert_finite(
            "rollout",
            trajectory.position.iter().chain(&trajectory.velocity).chain(&trajectory.acceleration),
        );
    }
    if let Ok(jacobian) =
        jacobian(model.primitive(), WithRespectTo::Style, Derivative::Position, &nominal, grid, &mut |_| Ok(()))
    {
        assert_finite("Jacobian", &jacobian);
    }
    let styles = Array2::zeros((2, model.n_styles()));
    let conditions = BatchConditions { style: Some(PerMovement::Each(styles)), ..Default::default() };
    let batch = batch(model.primitive(), conditions, grid, &mut |_| Ok(()));
    if let Ok(trajectories) =
        batch.and_then(|batch| batch.rollouts(0..2, Derivative::Acceleration, Threads::ONE, &mut |_| Ok(())))
    {
        trajectories.iter().for_each(|output| assert_finite("batch", output));
    }
    control(model);
    let demonstrated = model.demonstrated();
    let (Some(map), Some(contexts)) = (model.map(), &demonstrated.contexts) else { return };
    for row in contexts.rows().into_iter().take(2) {
        let Ok(prediction) = map.context(&row.to_vec()).and_then(|context| model.predict(&context)) else { continue };
        let Conditions { style, segment_durations: times, .. } = &prediction.conditions;
        assert_finite("prediction", style.iter().chain(times).flatten().chain([&prediction.duration]));
        assert_finite("covariance", prediction.covariance.iter().flatten());
        assert_finite("distance", &prediction.extrapolation);
        if let Ok(PredictionBand { lower, upper }) = prediction_band(model, &prediction, 0.9, grid) {
            assert_finite("band", lower.iter().chain(&upper));
        }
        if let Ok(trajectory) = rollout(model.primitive(), &prediction.conditions, grid) {
            assert_finite("predicted rollout", &trajectory.position);
        }
    }
}

/// Checks that a controller under commands writes finite numbers.
fn control(model: &Arc<Model>) {
    let dt = model.duration() / 40.0;
    let Ok(mut controller) = Controller::new(model.primitive(), dt, &Conditions::default(), None) else { return };
    let demonstrated = model.demonstrated();
    let last = model.n_demos() - 1;
    for tick in 0..60 {
        if tick == 10 {
            // Commands that do not match the kind or the range return an error.
            let _ = controller.set_style(&demonstrated.styles.row(last).to_vec());
            let _ = controller.set_goal(&demonstrated.goals.row(last).to_vec());
            let _ = controller.set_anchor(&demonstrated.anchors.row(last).to_vec());
            let _ = controller.set_tau(2.0 * model.tau());
        }
        if controller.step().is_err() {
            break;
        }
        let motion = [controller.position(), controller.velocity(), controller.acceleration()];
        assert_finite("controller", motion.into_iter().flatten());
    }
    assert_finite("progress", &[controller.time(), controller.phase(), controller.tau(), controller.amplitude()]);
}

/// Checks that all numbers are finite.
///
/// # Panics
/// Panics if one is not.
fn assert_finite<'a>(name: &str, numbers: impl IntoIterator<Item = &'a f64>) {
    if let Some(number) = numbers.into_iter().find(|x| !x.is_finite()) {
        panic!("{name} of an accepted model contains {number}");
    }
}
