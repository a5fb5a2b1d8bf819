//! Model files whose numbers, shapes and constants are forged, but whose checksum holds.
//!
//! An input is a list of edits to a small model, not a file: it stays of use when the format changes.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock};

use ndarray::Array2;
use pdmp_core::model::Derivative;
use pdmp_core::motion::jacobian;
use pdmp_core::motion::prediction_band;
use pdmp_core::motion::rollouts;
use pdmp_core::motion::{BatchConditions, TimeGrid, WithRespectTo};
use pdmp_core::numerics::Threads;
use pdmp_core::rollout;
use pdmp_core::{Conditions, Controller, Model};
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde_json::Value;

use crate::input::{Input, MODELS};

/// Most edits of one file.
const MAX_EDITS: usize = 12;
/// Arrays in the order of the checksum; the places of others are found by trial.
const ORDER: [&str; 19] = [
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

/// Loads a forged file; what loads must move in finite numbers, and be saved and loaded again.
///
/// # Panics
/// The claim does not hold.
pub fn check(data: &[u8]) {
    let mut input = Input::new(data);
    let mut forged = FILES[input.choice(FILES.len())].clone();
    for _ in 0..MAX_EDITS {
        let Some(edit) = input.next() else { break };
        forged.edit(edit, &mut input);
    }
    if let Ok(model) = Model::from_bytes(&forged.seal()) {
        exercise(&Arc::new(model));
    }
}

static FILES: LazyLock<Vec<Forged>> = LazyLock::new(|| MODELS.iter().map(|bytes| Forged::open(bytes)).collect());

#[derive(Clone)]
struct Array {
    name: String,
    shape: Vec<usize>,
    data: Vec<f64>,
}

/// A model file taken apart.
#[derive(Clone)]
struct Forged {
    schema: Value,
    /// JSON of the constants, as the library writes it: only that text is accepted.
    constants: String,
    /// In the order of the checksum.
    arrays: Vec<Array>,
}

impl Forged {
    fn open(bytes: &[u8]) -> Self {
        let (_, header) = SafeTensors::read_metadata(bytes).unwrap();
        let json = &header.metadata().as_ref().unwrap()["pdmp"];
        let sealed: Value = serde_json::from_str(json).unwrap();
        let start = json.find("\"model\":").unwrap() + "\"model\":".len();
        let constants = json[start..json.len() - 1].to_string();
        let tensors = SafeTensors::deserialize(bytes).unwrap();
        let array = |(name, tensor): (&str, TensorView)| {
            let data = tensor.data().chunks_exact(8).map(|x| f64::from_le_bytes(x.try_into().unwrap())).collect();
            Array { name: name.to_string(), shape: tensor.shape().to_vec(), data }
        };
        let (mut arrays, rest): (Vec<_>, Vec<_>) =
            tensors.iter().map(array).partition(|array| ORDER.contains(&array.name.as_str()));
        arrays.sort_by_key(|array| ORDER.iter().position(|name| *name == array.name));
        let crc32 = sealed["crc32"].as_u64().unwrap();
        let arrays = ordered(&constants, arrays, &rest, crc32).expect("no order of the arrays gives the checksum");
        let forged = Self { schema: sealed["schema"].clone(), constants, arrays };
        assert!(forged.seal() == bytes, "an untouched model is not sealed as the library does");
        forged
    }

    fn seal(&self) -> Vec<u8> {
        let crc32 = checksum(&self.constants, &self.arrays);
        let json = format!(r#"{{"schema":{},"crc32":{crc32},"model":{}}}"#, self.schema, self.constants);
        let bytes: Vec<Vec<u8>> = self.arrays.iter().map(bytes).collect();
        let views = self.arrays.iter().zip(&bytes).map(|(array, bytes)| {
            (array.name.as_str(), TensorView::new(Dtype::F64, array.shape.clone(), bytes).unwrap())
        });
        serialize(views, Some(HashMap::from([("pdmp".to_string(), json)]))).unwrap()
    }

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
                // More or fewer demonstrations, up to a thousand times as many.
                let n = self.arrays[0].shape[0];
                let wanted = match input.byte() {
                    0 => n.saturating_sub(1),
                    1 => n + 1,
                    double => n << (double % 11),
                };
                for array in self.arrays.iter_mut().filter(|array| array.shape[0] == n) {
                    array.resize(wanted);
                    if array.name == "contexts" {
                        array.data.iter_mut().enumerate().skip(n).for_each(|(k, x)| *x += k as f64 * 1e-5);
                    }
                }
            }
            10 => {
                let (by, array) = (input.byte(), self.array(input));
                let n = array.shape[0];
                array.resize(if by % 2 == 0 { n + usize::from(by / 2) } else { n.saturating_sub(usize::from(by / 2)) });
            }
            _ => {
                let from = self.array(input).clone();
                let into = self.array(input);
                match from.data.len() == into.data.len() {
                    true => into.data = from.data,
                    false => into.shape.reverse(),
                }
            }
        }
    }

    /// An array chosen by its name, so that the choice outlives others that come and go.
    fn array(&mut self, input: &mut Input) -> &mut Array {
        let key = input.byte();
        self.arrays.iter_mut().min_by_key(|array| crc32fast::hash(array.name.as_bytes()) as u8 ^ key).unwrap()
    }

    /// Puts another number, nothing, or another constant in place of a constant.
    fn constant(&mut self, input: &mut Input) {
        let scalars = scalars(&self.constants);
        let key = input.byte();
        let nearest = |(name, _): &&(String, _)| crc32fast::hash(name.as_bytes()) as u8 ^ key;
        let Some(name) = scalars.iter().min_by_key(nearest).map(|(name, _)| name) else { return };
        let places: Vec<_> =
            scalars.iter().filter(|(other, _)| other == name).map(|(_, place)| place.clone()).collect();
        let place = places[input.choice(places.len())].clone();
        let whole = self.constants[place.clone()].bytes().all(|c| c.is_ascii_digit());
        let text = match input.byte() {
            0..32 => "null".to_string(),
            32..64 => self.constants[scalars[input.choice(scalars.len())].1.clone()].to_string(),
            _ if whole => (input.number() as u64).to_string(),
            _ => serde_json::to_string(&input.number()).unwrap(),
        };
        self.constants.replace_range(place, &text);
    }
}

impl Array {
    /// Sets the length of the first axis, by repetition from the start.
    fn resize(&mut self, n: usize) {
        let row = self.shape[1..].iter().product::<usize>();
        if self.data.is_empty() || n * row > 1 << 20 {
            return;
        }
        self.data = self.data.iter().copied().cycle().take(n * row).collect();
        self.shape[0] = n;
    }
}

/// Places of the numbers, texts and words of a JSON text, by the key that stands before them.
fn scalars(json: &str) -> Vec<(String, std::ops::Range<usize>)> {
    let (mut found, mut key, mut place) = (Vec::new(), String::new(), 0);
    let bytes = json.as_bytes();
    while place < bytes.len() {
        let start = place;
        match bytes[place] {
            b'"' => {
                place += 1;
                while bytes[place] != b'"' {
                    place += if bytes[place] == b'\\' { 2 } else { 1 };
                }
                place += 1;
                match bytes.get(place) {
                    Some(b':') => key = json[start + 1..place - 1].to_string(),
                    _ => found.push((key.clone(), start..place)),
                }
            }
            b'{' | b'}' | b'[' | b']' | b',' | b':' => place += 1,
            _ => {
                place += bytes[place..].iter().take_while(|c| !b",]}".contains(c)).count();
                found.push((key.clone(), start..place));
            }
        }
    }
    found
}

fn bytes(array: &Array) -> Vec<u8> {
    array.data.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn checksum(constants: &str, arrays: &[Array]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(constants.as_bytes());
    for array in arrays {
        hasher.update(array.name.as_bytes());
        hasher.update(&bytes(array));
    }
    hasher.finalize()
}

/// The arrays with the others among them, each where the checksum holds.
fn ordered(constants: &str, arrays: Vec<Array>, others: &[Array], crc32: u64) -> Option<Vec<Array>> {
    let Some((other, others)) = others.split_first() else {
        return (u64::from(checksum(constants, &arrays)) == crc32).then_some(arrays);
    };
    (0..=arrays.len()).find_map(|place| {
        let mut arrays = arrays.clone();
        arrays.insert(place, other.clone());
        ordered(constants, arrays, others, crc32)
    })
}

/// Moves a model in every way, each of which gives finite numbers or an error.
fn exercise(model: &Arc<Model>) {
    let again = Model::from_bytes(&model.to_bytes().expect("a loaded model cannot be saved"));
    assert!(again.is_ok(), "a loaded and saved model cannot be loaded: {again:?}");
    let nominal = Conditions::default();
    let grid = TimeGrid { dt: model.duration() / 50.0, duration: None };
    if let Ok(trajectory) = rollout(model.primitive(), &nominal, grid) {
        finite("rollout", trajectory.position.iter().chain(&trajectory.velocity).chain(&trajectory.acceleration));
    }
    if let Ok(jacobian) =
        jacobian(model.primitive(), WithRespectTo::Style, Derivative::Position, &nominal, grid, &mut |_| Ok(()))
    {
        finite("Jacobian", &jacobian);
    }
    let styles = Array2::zeros((2, model.n_styles()));
    let batch = BatchConditions { styles, ..Default::default() };
    if let Ok(outputs) =
        rollouts(model.primitive(), batch, grid, Derivative::Acceleration, Threads::ONE, &mut |_| Ok(()))
    {
        outputs.iter().for_each(|output| finite("batch", output));
    }
    control(model);
    let demonstrated = model.demonstrated();
    let (Some(map), Some(contexts)) = (model.map(), &demonstrated.contexts) else { return };
    for row in contexts.rows().into_iter().take(2) {
        let Ok(prediction) = map.context(&row.to_vec()).and_then(|context| model.predict(&context)) else { continue };
        let Conditions { style, segment_durations: times, .. } = &prediction.conditions;
        finite("prediction", style.iter().chain(times).flatten().chain([&prediction.duration]));
        finite("covariance", prediction.covariance.iter().flatten());
        finite("distance", &prediction.extrapolation);
        if let Ok([lower, upper]) = prediction_band(model, &prediction, 0.9, grid) {
            finite("band", lower.iter().chain(&upper));
        }
        if let Ok(trajectory) = rollout(model.primitive(), &prediction.conditions, grid) {
            finite("predicted rollout", &trajectory.position);
        }
    }
}

fn control(model: &Arc<Model>) {
    let dt = model.duration() / 40.0;
    let Ok(mut controller) = Controller::new(model.primitive(), dt, &Conditions::default(), None) else { return };
    let demonstrated = model.demonstrated();
    let last = model.n_demos() - 1;
    for tick in 0..60 {
        if tick == 10 {
            // Those that do not fit the kind or the range are refused.
            let _ = controller.set_style(&demonstrated.styles.row(last).to_vec());
            let _ = controller.set_goal(&demonstrated.goals.row(last).to_vec());
            let _ = controller.set_anchor(&demonstrated.anchors.row(last).to_vec());
            let _ = controller.set_tau(2.0 * model.tau());
        }
        if controller.step().is_err() {
            break;
        }
        let motion = [controller.position(), controller.velocity(), controller.acceleration()];
        finite("controller", motion.into_iter().flatten());
    }
    finite("progress", &[controller.time(), controller.phase(), controller.tau(), controller.amplitude()]);
}

fn finite<'a>(what: &str, numbers: impl IntoIterator<Item = &'a f64>) {
    if let Some(odd) = numbers.into_iter().find(|x| !x.is_finite()) {
        panic!("{what} of a model that was accepted holds {odd}");
    }
}
