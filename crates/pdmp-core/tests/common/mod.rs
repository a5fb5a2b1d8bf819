//! Synthetic demonstrations by formulas that the library does not contain, and helpers of the tests.
#![allow(dead_code, missing_docs)]

use std::f64::consts::TAU;
use std::sync::{Arc, LazyLock};

use ndarray::{Array1, Array2};
use pdmp_core::learning::Truncation;
use pdmp_core::learning::regression::{Basis, Gp, NGnet};
use pdmp_core::learning::{CanonicalOptions, TransportSelection};
use pdmp_core::motion::TimeGrid;
use pdmp_core::rollout;
use pdmp_core::{Command, Controller, Demonstration, FitOptions, Kind, Model, Motion, Result, Sampling, Status, fit};

/// Minimum jerk from 0 to 1 (Flash and Hogan 1985), s in [0, 1].
pub(crate) fn minimum_jerk(s: f64) -> f64 {
    s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
}

/// Reach with D = 3: a straight DoF, one over an obstacle of height `h`, and one that ends where it starts.
pub(crate) fn reach(h: f64, duration: f64, dt: f64) -> Demonstration {
    let n = (duration / dt).round() as usize + 1;
    let position = Array2::from_shape_fn((n, 3), |(c, d)| {
        let s = c as f64 / (n - 1) as f64;
        let bump = 64.0 * (s * (1.0 - s)).powi(3);
        match d {
            0 => 0.2 + 0.6 * minimum_jerk(s),
            1 => 0.5 * minimum_jerk(s) + h * bump,
            _ => 0.3 * h * h * bump * (0.3 + s),
        }
    });
    Demonstration::new(position, Sampling::Uniform { dt }).unwrap().with_context(vec![h]).unwrap()
}

/// Reaches over obstacles of several heights and with several durations.
pub(crate) fn reaches() -> Vec<Demonstration> {
    [0.0, 0.15, 0.3, 0.45, 0.6].iter().map(|&h| reach(h, 0.9 + 0.3 * h, 0.01)).collect()
}

/// One cycle with D = 2 about (1, −2), with a style-dependent second harmonic.
pub(crate) fn cycle(style: f64, period: f64, n: usize) -> Demonstration {
    let position = Array2::from_shape_fn((n, 2), |(c, d)| {
        let phi = TAU * c as f64 / n as f64;
        match d {
            0 => 1.0 + style + (0.5 + style) * phi.sin() + 0.2 * style * (2.0 * phi).cos(),
            _ => -2.0 + 0.4 * (phi + style).cos(),
        }
    });
    Demonstration::new(position, Sampling::Uniform { dt: period / n as f64 }).unwrap()
}

pub(crate) fn cycles() -> Vec<Demonstration> {
    [0.0, 0.1, 0.25, 0.4].iter().map(|&s| cycle(s, 1.0 + 0.2 * s, 120)).collect()
}

/// Discrete movements with the paper's immediate transport.
pub(crate) fn immediate() -> CanonicalOptions {
    CanonicalOptions::Discrete { tau: None, alpha_x: None, transport: TransportSelection::Immediate }
}

/// Options with a normalised Gaussian network, which is fast to fit, and nearly all of the spectrum.
pub(crate) fn options(kind: Kind) -> FitOptions {
    FitOptions::new(kind).n_styles(Truncation::Share(0.9999)).basis(Basis::NGnet(NGnet::default()))
}

pub(crate) fn gp() -> Basis {
    Basis::Gp(Gp::default())
}

pub(crate) fn learn(demos: &[Demonstration], options: &FitOptions) -> Arc<Model> {
    Arc::new(fit(demos, options).unwrap())
}

/// Model of the reaches with two styles.
pub(crate) static REACH: LazyLock<Arc<Model>> =
    LazyLock::new(|| learn(&reaches(), &options(Kind::Discrete).n_styles(Truncation::Rank(2))));
/// Model of the cycles with two styles.
pub(crate) static CYCLE: LazyLock<Arc<Model>> =
    LazyLock::new(|| learn(&cycles(), &options(Kind::Rhythmic).n_styles(Truncation::Rank(2))));

pub(crate) fn grid(dt: f64, duration: f64) -> TimeGrid {
    TimeGrid { dt, duration: Some(duration) }
}

/// Performs one tick under a command and checks that the motion written is that of the controller.
pub(crate) fn tick(controller: &mut Controller, command: &Command) -> Result<Status> {
    let n = controller.primitive().n_dofs();
    let mut position = vec![0.0; controller.primitive().n_coordinates()];
    let (mut velocity, mut acceleration) = (vec![0.0; n], vec![0.0; n]);
    let mut motion = Motion { position: &mut position, velocity: &mut velocity, acceleration: &mut acceleration };
    let status = controller.update(command, &mut motion)?;
    assert_eq!(motion.position, controller.position());
    assert_eq!(motion.velocity, controller.velocity());
    assert_eq!(motion.acceleration, controller.acceleration());
    Ok(status)
}

/// Conditions of demonstration `m`: style, goal or anchor, start and segment durations.
pub(crate) fn conditions_of(model: &Model, m: usize) -> pdmp_core::Conditions {
    let demonstrated = model.demonstrated();
    let row = |matrix: &Array2<f64>| Some(matrix.row(m).to_vec());
    let discrete = model.kind() == Kind::Discrete;
    pdmp_core::Conditions {
        style: row(&demonstrated.styles),
        goal: row(&demonstrated.goals).filter(|_| discrete),
        anchor: row(&demonstrated.anchors).filter(|_| !discrete),
        start: row(&demonstrated.starts).filter(|_| discrete),
        segment_durations: row(&demonstrated.segment_durations),
        ..Default::default()
    }
}

/// Root mean square error of the reproduction at the samples of demonstration `m`, relative to its largest range.
pub(crate) fn reproduction_error(model: &Arc<Model>, demos: &[Demonstration], m: usize) -> f64 {
    let n = demos[m].n_samples();
    let steps = if model.kind() == Kind::Discrete { n - 1 } else { n };
    let duration = model.demonstrated().durations[m];
    let grid = TimeGrid { dt: duration / steps as f64, duration: Some(duration) };
    let found = rollout(model.primitive(), &conditions_of(model, m), grid).unwrap().position;
    let recorded = demos[m].position();
    let error = (&found.slice(ndarray::s![..n, ..]) - &recorded).mapv(|e| e * e).mean().unwrap().sqrt();
    let range = recorded.columns().into_iter().map(|y| max(&y.to_owned()) + max(&-y.to_owned())).fold(0.0, f64::max);
    error / range
}

fn max(values: &Array1<f64>) -> f64 {
    values.iter().copied().fold(f64::MIN, f64::max)
}
