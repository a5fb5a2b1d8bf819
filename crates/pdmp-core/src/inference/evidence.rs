//! Posterior of the mixture under each hypothesis of the time.

use super::movement_table::MovementTable;
use super::prior::{Moments, Prior};

/// Kernels of a prior in the coordinates x of a [`MovementTable`].
#[derive(Clone, Debug)]
pub(crate) struct Kernels {
    /// Centres (q, M) at the mean logarithm of the duration.
    centres: Vec<f64>,
    /// Logarithms of the durations of the centres (M,), less the mean.
    logs: Vec<f64>,
    /// Change (q,) of every centre with the logarithm of the duration.
    slope: Vec<f64>,
    /// Precision 1/c² of every coordinate.
    precision: f64,
    /// Precision of the logarithm of the duration.
    log_precision: f64,
    /// Exponent β of the likelihood.
    tempering: f64,
}

impl Kernels {
    /// Returns the kernels on the demonstrations of a prior.
    pub(crate) fn new(prior: &Prior, moments: &Moments, table: &MovementTable) -> Self {
        let settings = prior.settings();
        let precision = settings.bandwidth.powi(-2);
        let kept = (1.0 - settings.bandwidth.powi(2)).sqrt();
        let slope = table.inverse.dot(&ndarray::aview1(&moments.slope)).to_vec();
        let logs: Vec<f64> = prior.log_durations().iter().map(|log| kept * (log - moments.log_mean)).collect();
        let deviations = &prior.parameters() - &ndarray::aview1(&moments.mean);
        let x = table.inverse.dot(&deviations.t());
        let centres = x.indexed_iter().map(|((i, m), x)| kept * x - slope[i] * logs[m]).collect();
        let log_precision = precision / moments.log_deviation.powi(2);
        Self { centres, logs, slope, precision, log_precision, tempering: settings.tempering }
    }
}

/// Posterior of one hypothesis: a mixture of Gaussians of the covariance (FFᵀ)⁻¹ with the lower triangle F.
#[derive(Clone, Debug)]
pub(crate) struct Belief {
    /// Logarithm of the evidence, then the weight of the hypothesis.
    pub(crate) weight: f64,
    /// Mean (q,).
    pub(crate) mean: Vec<f64>,
    /// Factor F (q, q) by rows.
    factor: Vec<f64>,
    /// Covariance (q, q) of the vectors z = Fᵀx over the means x of the components.
    spread: Vec<f64>,
}

/// Memory of [`Belief::update`].
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    /// Vectors z = Fᵀx (q, M) of the means x of the components: loops over components run in vector registers.
    means: Vec<f64>,
    /// Logarithms of the weights (M,) of the components, then the weights.
    weights: Vec<f64>,
    /// Memory (q,) of a row.
    pub(crate) row: Vec<f64>,
}

impl Scratch {
    pub(crate) fn new(kernels: &Kernels) -> Self {
        let (m, q) = (kernels.logs.len(), kernels.slope.len());
        Self { means: vec![0.0; m * q], weights: vec![0.0; m], row: vec![0.0; q] }
    }
}

impl Belief {
    pub(crate) fn new(q: usize) -> Self {
        let square = || vec![0.0; q * q];
        Self { weight: 0.0, mean: vec![0.0; q], factor: square(), spread: square() }
    }

    /// Computes mean and evidence.
    ///
    /// `information` (q + 1, w) is the sum of the outer products of the whitened rows [Φ, y], its lower triangle;
    /// `log` the logarithm of the duration, less the mean. With Λ = I/c² + βΣΦᵀΦ = FFᵀ and b = x₀/c² + βΣΦᵀy of a component
    /// with centre x₀, its mean is Λ⁻¹b and its evidence exp(½|F⁻¹b|² − ½|x₀|²/c² − ½βΣy²) / √|c²Λ|.
    pub(crate) fn update(&mut self, information: &[f64], log: f64, kernels: &Kernels, scratch: &mut Scratch) {
        let (q, beta) = (self.mean.len(), kernels.tempering);
        let width = information.len() / (q + 1);
        for i in 0..q {
            for j in 0..=i {
                self.factor[i * q + j] = beta * information[i * width + j];
            }
            self.factor[i * q + i] += kernels.precision;
        }
        factorise(&mut self.factor, q);
        self.weight = self.components(information, log, kernels, scratch);
        for (mean, z) in self.mean.iter_mut().zip(scratch.means.chunks_exact(scratch.weights.len())) {
            *mean = dot(z, &scratch.weights);
        }
        backward(&self.factor, &mut self.mean);
    }

    /// Computes the covariance of the means of the components after [`Self::update`] with the same arguments.
    pub(crate) fn spread(&mut self, information: &[f64], log: f64, kernels: &Kernels, scratch: &mut Scratch) {
        self.components(information, log, kernels, scratch);
        let Scratch { means, weights, .. } = scratch;
        let (q, m) = (self.mean.len(), weights.len());
        for z in means.chunks_exact_mut(m) {
            let mean = dot(z, weights);
            z.iter_mut().zip(&*weights).for_each(|(z, weight)| *z = (*z - mean) * weight.sqrt());
        }
        for i in 0..q {
            for j in 0..=i {
                let entry = dot(&means[i * m..(i + 1) * m], &means[j * m..(j + 1) * m]);
                self.spread[i * q + j] = entry;
                self.spread[j * q + i] = entry;
            }
        }
    }

    /// Computes the vectors z and the weights of the components; returns the logarithm of the evidence.
    fn components(&self, information: &[f64], log: f64, kernels: &Kernels, scratch: &mut Scratch) -> f64 {
        let Scratch { means, weights, .. } = scratch;
        let (q, m, beta) = (self.mean.len(), weights.len(), kernels.tempering);
        let observed = &information[q * (information.len() / (q + 1))..];
        let mut common = -0.5 * beta * observed[q];
        for (weight, own) in weights.iter_mut().zip(&kernels.logs) {
            *weight = -0.5 * kernels.log_precision * (log - own).powi(2);
        }
        for i in 0..q {
            let (solved, rest) = means.split_at_mut(i * m);
            let z = &mut rest[..m];
            let (shift, data) = (kernels.slope[i] * log, beta * observed[i]);
            for ((z, weight), centre) in z.iter_mut().zip(&mut *weights).zip(&kernels.centres[i * m..]) {
                let centre = centre + shift;
                *weight -= 0.5 * kernels.precision * centre * centre;
                *z = data + kernels.precision * centre;
            }
            let row = &self.factor[i * q..=i * q + i];
            for (entry, other) in row.iter().zip(solved.chunks_exact(m)) {
                z.iter_mut().zip(other).for_each(|(z, other)| *z -= entry * other);
            }
            common += 0.5 * kernels.precision.ln() - row[i].ln();
            let inverse = row[i].recip();
            for (z, weight) in z.iter_mut().zip(&mut *weights) {
                *z *= inverse;
                *weight += 0.5 * *z * *z;
            }
        }
        common + normalise(weights)
    }

    /// Returns the variance of aᵀx for a row a (q,), which is overwritten.
    pub(crate) fn variance(&self, row: &mut [f64]) -> f64 {
        forward(&self.factor, row);
        let own: f64 = row.iter().map(|a| a * a).sum();
        let spread = self.spread.chunks_exact(row.len()).zip(&*row).map(|(entries, a)| a * dot(entries, row));
        own + spread.sum::<f64>()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Replaces a positive definite matrix (q, q), its lower triangle, by its Cholesky factor.
fn factorise(matrix: &mut [f64], q: usize) {
    for i in 0..q {
        let (above, rest) = matrix.split_at_mut(i * q);
        let row = &mut rest[..=i];
        for j in 0..i {
            let other = &above[j * q..=j * q + j];
            row[j] = (row[j] - dot(&row[..j], &other[..j])) / other[j];
        }
        // Rounding alone could make it negative: the prior precision is part of it.
        row[i] = (row[i] - dot(&row[..i], &row[..i])).max(f64::MIN_POSITIVE).sqrt();
    }
}

/// Solves F z = b in place.
fn forward(factor: &[f64], b: &mut [f64]) {
    let q = b.len();
    for i in 0..q {
        let row = &factor[i * q..=i * q + i];
        b[i] = (b[i] - dot(&row[..i], &b[..i])) / row[i];
    }
}

/// Solves Fᵀ x = z in place.
fn backward(factor: &[f64], z: &mut [f64]) {
    let q = z.len();
    for i in (0..q).rev() {
        let row = &factor[i * q..=i * q + i];
        z[i] /= row[i];
        let x = z[i];
        z[..i].iter_mut().zip(row).for_each(|(z, entry)| *z -= entry * x);
    }
}

/// Replaces logarithms by weights that add up to one, and returns the logarithm of the sum of their exponentials.
pub(crate) fn normalise(logs: &mut [f64]) -> f64 {
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut sum = 0.0;
    for log in logs.iter_mut() {
        *log = (*log - largest).exp();
        sum += *log;
    }
    logs.iter_mut().for_each(|weight| *weight /= sum);
    largest + sum.ln()
}
