//! Times of an observation and an estimate for D = 7, J = 6 and 64 hypotheses of the duration, beside 64 dense Kalman filters
//! of the same parameters in plain loops.
//!
//! The three are measured in turn, sample by sample, so that other load on the machine falls on each of them: the ratios are
//! steadier than the times.
#![allow(missing_docs)]

mod control_loop;
#[path = "../crates/pdmp-core/tests/common/random.rs"]
mod random;

use std::hint::black_box;
use std::time::Instant;

use control_loop::is_benchmark;
use ndarray::{Array2, Axis, concatenate};
use pdmp_core::inference::{Calibration, Mixture, Prior, Recogniser, Settings, Timing};
use pdmp_core::learning::Truncation;
use pdmp_core::{Demonstration, FitOptions, Kind, Model, Sampling, fit};
use random::Random;

const N_DOFS: usize = 7;
const N_STYLES: usize = 6;
const N_DEMOS: usize = 30;
/// Observations of each movement.
const N_SAMPLES: usize = 80;

/// Reaches with random goals, shapes and durations.
fn demonstrations() -> Vec<Demonstration> {
    let mut random = Random(1);
    let mut demo = |_| {
        let goals: Vec<f64> = (0..N_DOFS).map(|_| random.between(-1.0, 1.0)).collect();
        let bumps: Vec<f64> = (0..N_DOFS * N_STYLES).map(|_| random.between(-0.2, 0.2)).collect();
        let position = Array2::from_shape_fn((101, N_DOFS), |(c, d)| {
            let s = c as f64 / 100.0;
            let rise = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            let bump = |k: usize| bumps[k * N_DOFS + d] * ((k + 1) as f64 * std::f64::consts::PI * s).sin().powi(2);
            goals[d] * rise + (0..N_STYLES).map(bump).sum::<f64>() + random.between(-0.002, 0.002)
        });
        Demonstration::new(position, Sampling::Uniform { dt: 0.01 * random.between(0.8, 1.2) }).expect("finite")
    };
    (0..N_DEMOS).map(&mut demo).collect()
}

fn prior(model: &Model, bandwidth: f64) -> Prior {
    let shown = model.demonstrated();
    let parameters = [shown.styles.view(), shown.goals.view(), shown.starts.view()];
    let parameters = concatenate(Axis(1), &parameters).expect("rows of the demonstrations");
    let log_durations = shown.durations.iter().map(|duration| duration.ln()).collect();
    let settings = Settings { bandwidth, tempering: 0.1, correlation_time: 0.15 };
    let mixture = Mixture { parameters, log_durations, settings, calibration: Calibration::NONE };
    Prior::new(Kind::Discrete, mixture, vec![0.05; N_DOFS]).expect("valid")
}

/// Kalman filters of one vector of parameters (K,) for each hypothesis, with the gain of the textbook.
struct Filters {
    covariances: Vec<Vec<f64>>,
    means: Vec<Vec<f64>>,
}

impl Filters {
    fn new(n: usize, k: usize) -> Self {
        let identity: Vec<f64> = (0..k * k).map(|i| f64::from(i % (k + 1) == 0)).collect();
        Self { covariances: vec![identity; n], means: vec![vec![0.0; k]; n] }
    }

    /// Includes one value of every DoF, with the same row of each.
    fn update(&mut self, rows: &[Vec<f64>], values: &[f64]) {
        for (covariance, mean) in self.covariances.iter_mut().zip(&mut self.means) {
            for (row, value) in rows.iter().zip(values) {
                let dot = |a: &[f64]| a.iter().zip(row).map(|(a, b)| a * b).sum::<f64>();
                let along: Vec<f64> = covariance.chunks_exact(row.len()).map(dot).collect();
                let variance = dot(&along) + 1.0;
                let error = (value - dot(mean)) / variance;
                for ((entries, own), mean) in covariance.chunks_exact_mut(row.len()).zip(&along).zip(mean.iter_mut()) {
                    *mean += own * error;
                    let factor = own / variance;
                    entries.iter_mut().zip(&along).for_each(|(entry, other)| *entry -= factor * other);
                }
            }
        }
    }
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() {
    let rounds = if is_benchmark() { 20 } else { 1 };
    let demos = demonstrations();
    let model = fit(&demos, &FitOptions::new(Kind::Discrete).n_styles(Truncation::Rank(N_STYLES))).expect("a model");
    let n_parameters = N_STYLES + 2 * N_DOFS;
    let rows: Vec<Vec<f64>> =
        (0..N_DOFS).map(|d| (0..n_parameters).map(|k| 0.1 * ((k + 3 * d) % 7) as f64).collect()).collect();
    for bandwidth in [0.6, 1.0] {
        let mut recogniser =
            Recogniser::new(&model, &prior(&model, bandwidth), Timing::default()).expect("a prior of the model");
        let mut filters = Filters::new(recogniser.n_hypotheses(), n_parameters);
        let mut times = [const { Vec::new() }; 3];
        for demo in demos.iter().cycle().take(rounds) {
            recogniser.reset();
            for k in 0..N_SAMPLES {
                let position = demo.position().row(k).to_vec();
                let begin = Instant::now();
                recogniser.update(0.01 * k as f64, black_box(&position)).expect("a finite position");
                let observed = Instant::now();
                black_box(recogniser.estimate().expect("an estimate"));
                let estimated = Instant::now();
                filters.update(black_box(&rows), &position);
                let filtered = Instant::now();
                for (times, span) in
                    times.iter_mut().zip([observed - begin, estimated - observed, filtered - estimated])
                {
                    times.push(1e6 * span.as_secs_f64());
                }
            }
        }
        let [sample, estimate, peer] = times.each_mut().map(|times| median(times));
        println!(
            "bandwidth {bandwidth}: a sample takes {sample:.1} µs, an estimate {estimate:.1} µs, {} dense Kalman \
             filters {peer:.1} µs: {:.3} and {:.3} of these",
            recogniser.n_hypotheses(),
            sample / peer,
            estimate / peer
        );
    }
}
