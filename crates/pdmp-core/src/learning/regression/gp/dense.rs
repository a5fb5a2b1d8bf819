//! The squared exponential, whose process is not Markov: a dense covariance matrix, in O(C³).

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, Mat, Par, Side};
use ndarray::Array2;

use super::posterior::Form;
use super::squared_exponential::Bell;
use super::{Fitted, Hyperparameters, Process, Profile, Progress, Samples, Slope};
use crate::error::Result;
use crate::learning::regression::Domain;

/// Columns that are factorised at once.
const PANEL: usize = 512;

/// Samples of a process with a squared-exponential kernel.
pub(super) struct Dense {
    domain: Domain,
    u: Vec<f64>,
    /// (C, P).
    outputs: Mat<f64>,
}

impl Dense {
    /// Factorises K = LLᵀ and whitens the outputs; nothing if K is not positive definite.
    fn factorise(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<Factors>> {
        let (n_samples, bell) = (self.u.len(), Bell::new(self.domain, at.length));
        let mut k = Mat::zeros(n_samples, n_samples);
        for j in 0..n_samples {
            k[(j, j)] = 1.0 + at.noise;
            for i in j + 1..n_samples {
                k[(i, j)] = bell.at(self.u[i] - self.u[j]).0;
            }
        }
        let Some(lower) = cholesky(k, progress)? else { return Ok(None) };
        let mut whitened = self.outputs.clone();
        lower.solve_lower_triangular_in_place(&mut whitened);
        Ok(Some(Factors { bell, lower, whitened }))
    }
}

/// L with K = LLᵀ, from the lower triangle of K, panel by panel.
fn cholesky(mut k: Mat<f64>, progress: &mut Progress) -> Result<Option<Mat<f64>>> {
    let n = k.nrows();
    for from in (0..n).step_by(PANEL) {
        let to = n.min(from + PANEL);
        let (done, mut rest) = k.as_mut().split_at_col_mut(from);
        let done = done.as_ref();
        let mut panel = rest.as_mut().subcols_mut(0, to - from).subrows_mut(from, n - from);
        matmul(
            panel.as_mut(),
            Accum::Add,
            done.subrows(from, n - from),
            done.subrows(from, to - from).transpose(),
            -1.0,
            Par::Seq,
        );
        let (mut top, below) = panel.split_at_row_mut(to - from);
        let Ok(factor) = top.as_ref().llt(Side::Lower) else { return Ok(None) };
        top.copy_from(factor.L());
        solve_lower_triangular_in_place(top.as_ref(), below.transpose_mut(), Par::Seq);
        rest.subrows_mut(0, from).fill(0.0);
        if to < n {
            progress.ask()?;
        }
    }
    Ok(Some(k))
}

impl Process for Dense {
    const SEARCHED: usize = 400;

    fn new(domain: Domain, samples: &Samples) -> Self {
        let outputs = Mat::from_fn(samples.targets.nrows(), samples.targets.ncols(), |i, o| samples.targets[[i, o]]);
        Self { domain, u: samples.u.clone(), outputs }
    }

    fn profile(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<Profile>> {
        Ok(self.factorise(at, progress)?.map(|factors| factors.profile()))
    }

    fn slope(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<(Profile, Slope)>> {
        let Some(factors) = self.factorise(at, progress)? else { return Ok(None) };
        let profile = factors.profile();
        let (mut pull, mut spread) = ([0.0; 2], [0.0; 2]);
        if profile.variance > 0.0 {
            let (n_samples, n_outputs) = factors.whitened.shape();
            let weights = factors.weights();
            let products = &weights * weights.transpose() * faer::Scale(1.0 / profile.variance);
            let mut root = Mat::<f64>::identity(n_samples, n_samples);
            factors.lower.solve_lower_triangular_in_place(&mut root);
            let inverse = root.transpose() * &root * faer::Scale(n_outputs as f64);
            for (sum, matrix) in [(&mut pull, &products), (&mut spread, &inverse)] {
                for j in 0..n_samples {
                    sum[1] += 0.5 * at.noise * matrix[(j, j)];
                    for i in j + 1..n_samples {
                        sum[0] += matrix[(i, j)] * factors.bell.by_length(self.u[i] - self.u[j]).1;
                    }
                }
            }
        }
        Ok(Some((profile, Slope { pull, spread })))
    }

    fn fit(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<Fitted>> {
        let Some(factors) = self.factorise(at, progress)? else { return Ok(None) };
        let (profile, weights) = (factors.profile(), factors.weights());
        let weights = Array2::from_shape_fn(weights.shape(), |(i, o)| weights[(i, o)]);
        let expansion = Expansion { bell: factors.bell, u: self.u.clone(), lower: factors.lower, weights };
        Ok(Some(Fitted { profile, form: Form::SquaredExponential(expansion) }))
    }
}

/// The samples under one choice of hyperparameters.
struct Factors {
    bell: Bell,
    /// L, K = LLᵀ.
    lower: Mat<f64>,
    /// L⁻¹f, (C, P).
    whitened: Mat<f64>,
}

impl Factors {
    fn profile(&self) -> Profile {
        let (n_samples, n_outputs) = self.whitened.shape();
        let n_values = (n_samples * n_outputs) as f64;
        let log_determinant = 2.0 * n_outputs as f64 * (0..n_samples).map(|i| self.lower[(i, i)].ln()).sum::<f64>();
        Profile { n_values, variance: self.whitened.squared_norm_l2() / n_values.max(1.0), log_determinant }
    }

    /// K⁻¹f.
    fn weights(&self) -> Mat<f64> {
        let mut weights = self.whitened.clone();
        self.lower.transpose().solve_upper_triangular_in_place(&mut weights);
        weights
    }
}

/// The posterior mean as a sum of kernels, kᵀK⁻¹f.
#[derive(Clone, Debug)]
pub(super) struct Expansion {
    bell: Bell,
    /// Clock of the samples (C,).
    u: Vec<f64>,
    /// L, K = LLᵀ.
    lower: Mat<f64>,
    /// K⁻¹f, (C, P).
    weights: Array2<f64>,
}

impl Expansion {
    pub(super) fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        value.fill(0.0);
        slope.fill(0.0);
        for (sample, weights) in self.u.iter().zip(self.weights.rows()) {
            let (k, dk) = self.bell.at(u - sample);
            for ((value, slope), weight) in value.iter_mut().zip(slope.iter_mut()).zip(weights) {
                *value += k * weight;
                *slope += dk * weight;
            }
        }
    }

    /// 1 − kᵀK⁻¹k at each point.
    pub(super) fn variances(&self, points: &[f64]) -> Vec<f64> {
        let mut whitened = Mat::from_fn(self.u.len(), points.len(), |i, j| self.bell.at(points[j] - self.u[i]).0);
        self.lower.solve_lower_triangular_in_place(&mut whitened);
        // Rounding may take a variance of nearly zero below it.
        whitened.col_iter().map(|column| (1.0 - column.squared_norm_l2()).max(0.0)).collect()
    }
}
