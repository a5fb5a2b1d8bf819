//! The recogniser against dense Gaussian computations, and its bands on movements drawn from the prior.

use nalgebra::{DMatrix, DVector};
use ndarray::Array2;

use super::evidence::{Belief, Kernels, Weigh};
use super::movement_table::MovementTable;
use super::noise_filter::NoiseFilter;
use super::prior::Moments;
use super::triangle::square;
use super::{Calibration, Mixture, Prior, Recogniser, Settings, Timing};
use crate::numerics::simd::{F64x4, Kernel};
use crate::random::Random;
use crate::{Demonstration, FitOptions, Kind, Model, Sampling, fit};

/// Reaches over obstacles of several heights, places and durations.
fn reaches() -> Vec<Demonstration> {
    let mut random = Random(3);
    let reach = |h: f64, duration: f64, goal: f64| {
        let position = Array2::from_shape_fn((61, 2), |(c, d)| {
            let s = c as f64 / 60.0;
            let rise = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            if d == 0 { 0.2 + goal * rise } else { 0.5 * rise + h * (4.0 * s * (1.0 - s)).powi(3) }
        });
        Demonstration::new(position, Sampling::Uniform { dt: duration / 60.0 }).unwrap()
    };
    (0..12).map(|_| reach(random.between(0.1, 0.5), random.scale(0.8, 1.3), random.between(0.4, 0.8))).collect()
}

pub(super) fn model() -> Model {
    fit(&reaches(), &FitOptions::new(Kind::Discrete)).unwrap()
}

pub(super) fn prior(model: &Model, bandwidth: f64) -> Prior {
    let demonstrated = model.demonstrated();
    let parts = [demonstrated.styles.view(), demonstrated.goals.view(), demonstrated.starts.view()];
    let parameters = ndarray::concatenate(ndarray::Axis(1), &parts).unwrap();
    let log_durations = demonstrated.durations.iter().map(|duration| duration.ln()).collect();
    let settings = Settings { bandwidth, tempering: 1.0, correlation_time: 0.1 };
    let mixture = Mixture { parameters, log_durations, settings, calibration: Calibration::NONE };
    Prior::new(Kind::Discrete, mixture, vec![0.004, 0.006]).unwrap()
}

/// Parameters and durations of movements that are drawn from a prior.
pub(super) struct Draws<'a> {
    prior: &'a Prior,
    moments: Moments,
    /// Cholesky factor of the covariance.
    factor: DMatrix<f64>,
}

impl<'a> Draws<'a> {
    pub(super) fn new(prior: &'a Prior, vectors: &[usize]) -> Self {
        let moments = prior.moments(vectors);
        let n = moments.mean.len();
        let factor = DMatrix::from_fn(n, n, |i, j| moments.covariance[[i, j]]).cholesky().unwrap().l();
        Self { prior, moments, factor }
    }

    /// Returns parameters (K,), and the duration in seconds.
    pub(super) fn draw(&self, random: &mut Random) -> (Vec<f64>, f64) {
        let Self { prior, moments, factor } = self;
        let bandwidth = prior.settings().bandwidth;
        let (n, kept) = (moments.mean.len(), (1.0 - bandwidth * bandwidth).sqrt());
        let m = (random.next() * prior.n_demos() as f64) as usize;
        let own = kept * (prior.log_durations()[m] - moments.log_mean);
        let log = own + bandwidth * moments.log_deviation * normal(random);
        let noise = factor * DVector::from_fn(n, |_, _| normal(random)) * bandwidth;
        let parameter = |k: usize| {
            let deviation = kept * (prior.parameters()[[m, k]] - moments.mean[k]);
            moments.mean[k] + deviation + moments.slope[k] * (log - own) + noise[k]
        };
        ((0..n).map(parameter).collect(), (log + moments.log_mean).exp())
    }
}

/// Normal random number, the sum of twelve uniform ones.
pub(super) fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.next()).sum::<f64>() - 6.0
}

/// Covariance of the residual: e^(−|Δt|/ℓ) for nine tenths of its variance, and white noise.
fn residual_covariance(times: &[f64], deviation: f64, correlation_time: f64) -> DMatrix<f64> {
    DMatrix::from_fn(times.len(), times.len(), |i, j| {
        let process = 0.9 * (-(times[i] - times[j]).abs() / correlation_time).exp();
        deviation * deviation * (process + if i == j { 0.1 } else { 0.0 })
    })
}

/// The whitened squares and the predictions of the filter equal those of the dense covariance, with samples missing.
#[test]
fn noise_filter_equals_the_dense_covariance() {
    let mut random = Random(5);
    for _ in 0..20 {
        let mut filter = NoiseFilter::new(&[0.3], 0.2);
        let (mut time, mut estimate, mut square, mut log) = (0.0, 0.0, 0.0, 0.0);
        let (mut times, mut values) = (Vec::new(), Vec::new());
        for k in 0..12 {
            let interval = if k == 0 { 0.0 } else { random.scale(1e-3, 1.0) };
            time += interval;
            let value = if random.rarely() { f64::NAN } else { normal(&mut random) };
            filter.advance(interval, &[value]);
            estimate *= filter.decay;
            if let Some((gain, scale)) = filter.gains[0] {
                let innovation: f64 = value - estimate;
                estimate += gain * innovation;
                square += (scale * innovation).powi(2);
                log -= scale.ln();
                times.push(time);
                values.push(value);
            }
        }
        let covariance = residual_covariance(&times, 0.3, 0.2).cholesky().unwrap();
        let y = DVector::from_vec(values);
        let solved = covariance.solve(&y);
        assert!((square - y.dot(&solved)).abs() < 1e-9 * square);
        assert!((log - covariance.l().diagonal().map(f64::ln).sum()).abs() < 1e-9);
        let ahead = 0.15;
        let to = DVector::from_iterator(times.len(), times.iter().map(|t| 0.081 * (-(time + ahead - t) / 0.2).exp()));
        let (decay, variance) = filter.ahead(ahead, 0);
        assert!((decay * estimate - to.dot(&solved)).abs() < 1e-9);
        assert!((variance - (0.09 - to.dot(&covariance.solve(&to)))).abs() < 1e-9);
    }
}

/// Mean, covariance and evidence of a hypothesis equal those of the mixture that is conditioned densely.
#[test]
fn a_hypothesis_equals_dense_conditioning_of_the_mixture() {
    let model = model();
    for (bandwidth, timing) in [(0.4, 0.95), (1.0, 1.1)] {
        let prior = prior(&model, bandwidth);
        let moments = prior.moments(&[]);
        let table = MovementTable::new(model.primitive(), &prior, &moments).unwrap();
        let kernels = Kernels::new(&prior, &moments, &table);
        let timing = Timing { duration: Some(timing), ..Timing::default() };
        let mut recogniser = Recogniser::new(&model, &prior, timing).unwrap();
        let times: Vec<f64> = (0..9).map(|k| 0.06 * f64::from(k)).collect();
        let observed = |t: f64| [0.2 + 0.3 * t, 0.4 * t * t];
        for &t in &times {
            recogniser.update(t, &observed(t)).unwrap();
        }
        recogniser.estimate().unwrap();

        // Rows of both DoFs, one after the other.
        let (q, n) = (table.n_directions, 2 * times.len());
        let (mut rows, mut y) = (DMatrix::zeros(n, q), DVector::zeros(n));
        let mut noise = DMatrix::zeros(n, n);
        let mut row = vec![F64x4::ZERO; table.width];
        let first = |lanes: &F64x4| lanes.to_array()[0];
        for d in 0..2 {
            let block = residual_covariance(&times, prior.residual()[d], prior.settings().correlation_time);
            noise.view_mut((d * times.len(), d * times.len()), (times.len(), times.len())).copy_from(&block);
            for (k, &t) in times.iter().enumerate() {
                let places = table.places([recogniser.hypotheses[0].fraction(t); 4]);
                table.rows::<F64x4>(&places, d, &mut row);
                (0..q).for_each(|j| rows[(d * times.len() + k, j)] = first(&row[j]));
                y[d * times.len() + k] = observed(t)[d] - first(&row[q]);
            }
        }
        // Conditioning of each component by the covariance of the observations.
        let (kept, log) = ((1.0 - bandwidth * bandwidth).sqrt(), recogniser.hypotheses[0].log);
        let slope = DVector::from_vec(table.inverse.dot(&ndarray::aview1(&moments.slope)).to_vec());
        let gain = {
            let covariance = &rows * rows.transpose() * (bandwidth * bandwidth) + &noise;
            rows.transpose() * (bandwidth * bandwidth) * covariance.try_inverse().unwrap()
        };
        let covariance = &rows * rows.transpose() * (bandwidth * bandwidth) + &noise;
        let factor = covariance.cholesky().unwrap();
        let (mut means, mut logs) = (Vec::new(), Vec::new());
        for (m, parameters) in prior.parameters().rows().into_iter().enumerate() {
            let x = DVector::from_vec(table.inverse.dot(&(&parameters - &ndarray::aview1(&moments.mean))).to_vec());
            let own = kept * (prior.log_durations()[m] - moments.log_mean);
            let centre = x * kept + &slope * (log - own);
            let error = &y - &rows * &centre;
            let prior_log = -0.5 * ((log - own) / (bandwidth * moments.log_deviation)).powi(2);
            logs.push(prior_log - 0.5 * error.dot(&factor.solve(&error)));
            means.push(&centre + &gain * error);
        }
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = logs.iter().map(|l| (l - largest).exp()).sum();
        let mean = means
            .iter()
            .zip(&logs)
            .fold(DVector::zeros(q), |sum_of, (mean, l)| sum_of + mean * ((l - largest).exp() / sum));
        let own = DVector::from_iterator(q, recogniser.beliefs[0].mean.iter().map(first));
        assert!((&own - &mean).norm() < 1e-7 * mean.norm().max(1.0), "{own} {mean}");

        // Evidence up to the whitening, which is that of every hypothesis.
        let mut belief = Belief::new(&kernels);
        let information = &recogniser.sums[0].information;
        Weigh { belief: &mut belief, information, log: F64x4::splat(log), kernels: &kernels }.run::<F64x4>();
        let evidence = first(&belief.weight);
        let white = noise.cholesky().unwrap().l().diagonal().map(f64::ln).sum();
        let dense = largest + sum.ln() - factor.l().diagonal().map(f64::ln).sum() + white;
        assert!((evidence - dense).abs() < 1e-6 * dense.abs().max(1.0), "{evidence} {dense}");

        let direction = DVector::from_fn(q, |j, _| (j as f64 + 1.0).recip());
        let within = direction.dot(&direction) * bandwidth * bandwidth
            - bandwidth * bandwidth * direction.dot(&(&gain * (&rows * &direction)));
        let spread: f64 =
            means.iter().zip(&logs).map(|(m, l)| (l - largest).exp() / sum * (m - &mean).dot(&direction).powi(2)).sum();
        let lanes: Vec<F64x4> = direction.iter().map(|x| F64x4::splat(*x)).collect();
        let variance = first(&square(&recogniser.beliefs[0].covariance, &lanes));
        assert!((variance - within - spread).abs() < 1e-6 * variance, "{variance} {within} {spread}");
    }
}

/// The bands of goal, duration and positions to come hold nine tenths of movements that are drawn from the prior.
#[test]
fn bands_hold_movements_of_the_prior() {
    let model = model();
    let (prior, mut random) = (prior(&model, 0.5), Random(11));
    let draws = Draws::new(&prior, &[]);
    let responses = super::responses(model.primitive()).unwrap();
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    let (mut held, mut total) = ([0.0; 3], [0.0; 3]);
    for _ in 0..150 {
        let (theta, duration) = draws.draw(&mut random);
        let movement = responses.dot(&ndarray::aview1(&theta));
        recogniser.reset();
        let mut process = [0.0; 2];
        let mut position = |k: usize, random: &mut Random| {
            let share = f64::from(u32::try_from(k).unwrap()) / 40.0;
            let index = ((share * 200.0) as usize).min(200);
            let decay = if k == 0 { 0.0 } else { (-duration / 40.0 / 0.1f64).exp() };
            [0, 1].map(|d| {
                let sd = prior.residual()[d];
                process[d] = decay * process[d] + (0.9 * (1.0 - decay * decay)).sqrt() * sd * normal(random);
                movement[2 * index + d] + process[d] + 0.1f64.sqrt() * sd * normal(random)
            })
        };
        for k in 0..16 {
            let y = position(k, &mut random);
            recogniser.update(k as f64 * duration / 40.0, &y).unwrap();
        }
        let later: Vec<f64> = (16..40).map(|k| k as f64 * duration / 40.0).collect();
        let ahead = recogniser.continuation(&later).unwrap();
        for k in 0..later.len() {
            let y = position(16 + k, &mut random);
            for (d, y) in y.iter().enumerate() {
                held[0] += f64::from((y - ahead.position[[k, d]]).abs() < 1.645 * ahead.deviation[[k, d]]);
                total[0] += 1.0;
            }
        }
        let estimate = recogniser.estimate().unwrap();
        for d in 0..2 {
            let error = estimate.goal()[d] - theta[model.n_styles() + d];
            held[1] += f64::from(error.abs() < 1.645 * estimate.goal_deviation()[d]);
            total[1] += 1.0;
        }
        held[2] += f64::from((estimate.duration / duration).ln().abs() < 1.645 * estimate.duration_deviation);
        total[2] += 1.0;
    }
    let shares = [0, 1, 2].map(|k| held[k] / total[k]);
    assert!(shares.iter().all(|share| (0.84..=0.98).contains(share)), "{shares:?}");
}
