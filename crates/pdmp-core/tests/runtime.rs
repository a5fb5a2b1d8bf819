//! A build without learning loads a model file, predicts from a context and moves as the build that learnt it.
//!
//! `PDMP_WRITE_MODEL=1 cargo test --package pdmp-core --test runtime` writes the model file and the expected numbers,
//! after a change of the file's format.

use ndarray::Array2;
use pdmp_core::motion::TimeGrid;
use pdmp_core::{Conditions, Controller, Model, Status, rollout};

const MODEL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/reach.safetensors");
const EXPECTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/reach.txt");
/// Heights of the obstacle in m: between two demonstrations, and beyond the last.
const CONTEXTS: [f64; 2] = [0.17, 0.7];

/// Returns the predicted conditions, duration and extrapolation for each context, and positions of its rollout.
fn numbers(model: &Model) -> Vec<f64> {
    let of = |height: &f64| {
        let prediction = model.predict(&[*height]).unwrap();
        let grid = TimeGrid { dt: 0.1 * prediction.duration, duration: None };
        let positions: Array2<f64> = rollout(model.primitive(), &prediction.conditions, grid).unwrap().position;
        let Conditions { style, goal, start, .. } = prediction.conditions;
        let mut numbers = [style, goal, start].into_iter().flatten().flatten().collect::<Vec<f64>>();
        numbers.extend(prediction.covariance.unwrap().diag().iter().map(|variance| variance.sqrt()));
        numbers.push(prediction.duration);
        numbers.extend(positions);
        numbers
    };
    CONTEXTS.iter().flat_map(of).collect()
}

#[test]
fn a_model_predicts_and_moves_alike_in_every_build() {
    #[cfg(feature = "learning")]
    if std::env::var_os("PDMP_WRITE_MODEL").is_some() {
        write();
    }
    let model = Model::load(MODEL.as_ref()).unwrap();
    let text = std::fs::read_to_string(EXPECTED).unwrap();
    let expected: Vec<f64> = text.lines().map(|line| line.parse().unwrap()).collect();
    let found = numbers(&model);
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{found} is not {expected}");
    }
}

#[test]
fn a_controller_runs_to_its_goal() {
    let model = Model::load(MODEL.as_ref()).unwrap();
    let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
    controller.set_goal(&[1.2, 0.1]).unwrap();
    while controller.step().unwrap() == Status::Working {}
    assert!((controller.position()[0] - 1.2).abs() < 2e-3 && (controller.position()[1] - 0.1).abs() < 2e-3);
}

#[cfg(feature = "learning")]
fn write() {
    use pdmp_core::learning::regression::{Basis, NGnet};
    use pdmp_core::{Demonstration, FitOptions, Sampling, fit};

    let demos: Vec<Demonstration> = [0.0, 0.1, 0.25, 0.4, 0.6]
        .map(|height: f64| {
            let position = Array2::from_shape_fn((101, 2), |(c, d)| {
                let s = c as f64 / 100.0;
                if d == 0 { s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s) } else { 64.0 * height * (s - s * s).powi(3) }
            });
            let dt = 0.01 * (1.0 + 0.2 * height);
            Demonstration::new(position, Sampling::Uniform { dt }).unwrap().with_context(vec![height]).unwrap()
        })
        .to_vec();
    let model = fit(&demos, &FitOptions::discrete().basis(Basis::NGnet(NGnet::default()))).unwrap();
    model.save(MODEL.as_ref()).unwrap();
    let lines: Vec<String> = numbers(&model).iter().map(|number| format!("{number:?}\n")).collect();
    std::fs::write(EXPECTED, lines.concat()).unwrap();
}
