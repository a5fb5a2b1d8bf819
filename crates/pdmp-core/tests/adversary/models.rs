//! Models of synthetic demonstrations: discrete and rhythmic, of 1 to 32 DoFs and 1 to 5 styles.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use ndarray::Array2;
use pdmp_core::learning::regression::{Basis, NGnet};
use pdmp_core::learning::{CanonicalOptions, TransportSelection, Truncation};
use pdmp_core::{Demonstration, FitOptions, Kind, Model, Sampling, fit};

use super::random::Random;

/// Numbers of degrees of freedom.
const N_DOFS: [usize; 10] = [1, 2, 3, 4, 5, 7, 8, 11, 16, 32];
/// Durations or periods, in seconds.
const DURATIONS: [f64; 4] = [1.0, 0.2, 4.0, 20.0];
const N_SAMPLES: usize = 81;
const N_DEMOS: usize = 6;

/// Fits every model.
pub(crate) fn models() -> Vec<Arc<Model>> {
    let immediate = CanonicalOptions::Discrete { tau: None, alpha_x: None, transport: TransportSelection::Immediate };
    let mut random = Random::new(1);
    let mut models = Vec::new();
    for (index, n_dofs) in N_DOFS.into_iter().enumerate() {
        for (offset, kind) in [Kind::Discrete, Kind::Discrete, Kind::Rhythmic].into_iter().enumerate() {
            let options = if offset == 1 { FitOptions::new(immediate.clone()) } else { FitOptions::new(kind) };
            let n_styles = 1 + (index + offset) % 5;
            let options = options.n_styles(Truncation::Rank(n_styles)).basis(Basis::NGnet(NGnet::default()));
            let duration = DURATIONS[(index + 2 * offset) % DURATIONS.len()];
            let demos = demonstrations(kind, n_dofs, duration, &mut random);
            models.push(Arc::new(fit(&demos, &options).expect("a fit")));
        }
    }
    models
}

/// Returns smooth random movements. Some DoFs do not move, and some are angles.
fn demonstrations(kind: Kind, n_dofs: usize, duration: f64, random: &mut Random) -> Vec<Demonstration> {
    let scales: Vec<f64> =
        (0..n_dofs).map(|dof| if dof > 0 && random.chance(0.1) { 0.0 } else { random.scale(0.01, 100.0) }).collect();
    let units: Vec<String> = (0..n_dofs).map(|_| random.choose(&["rad", "m", "deg"]).to_string()).collect();
    let shapes: Vec<[f64; 4]> = (0..n_dofs).map(|_| [(); 4].map(|()| random.between(-1.0, 1.0))).collect();
    let demonstration = |_| {
        let variations: Vec<[f64; 4]> = (0..n_dofs).map(|_| [(); 4].map(|()| random.between(-0.4, 0.4))).collect();
        let position = Array2::from_shape_fn((N_SAMPLES, n_dofs), |(sample, dof)| {
            let [a, b, c, d] = std::array::from_fn(|k| shapes[dof][k] + variations[dof][k]);
            let path = match kind {
                Kind::Discrete => {
                    let s = sample as f64 / (N_SAMPLES - 1) as f64;
                    let reach = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
                    a + b * reach + (PI * s).sin().powi(2) * (c + d * (TAU * s).cos())
                }
                Kind::Rhythmic => {
                    let phi = TAU * sample as f64 / N_SAMPLES as f64;
                    a + (phi + b).sin() + c * (2.0 * phi + d).cos()
                }
            };
            scales[dof] * path
        });
        let intervals = if kind == Kind::Discrete { N_SAMPLES - 1 } else { N_SAMPLES };
        Demonstration::new(position, Sampling::Uniform { dt: duration / intervals as f64 })
            .and_then(|demonstration| demonstration.with_units(units.clone()))
            .expect("finite numbers")
    };
    (0..N_DEMOS).map(demonstration).collect()
}
