//! Posterior of the mixture under four hypotheses of the time.
// Closures of iterators stay calls, into which the instructions of larger registers are not inlined.
#![allow(clippy::needless_range_loop)]

use super::movement_table::{MAX_DIRECTIONS, MovementTable};
use super::prior::{Moments, Prior};
use super::triangle::{add_squares, backward, factorise, forward, gram, invert, product, row, size};
use crate::numerics::simd::{F64x4, Kernel, Register, WIDTH, exp};

/// Components at a time: their sums fill the registers.
const N_TOGETHER: usize = 8;
/// Logarithm below which the share of a component, relative to the largest, is zero.
const MIN_LOG_SHARE: f64 = -40.0;
/// Four hypotheses of smaller weights do not count.
const MIN_WEIGHT: f64 = 1e-4;
/// Components of a smaller share of all hypotheses do not count in covariances.
const MIN_SHARE: f64 = 1e-7;

/// Kernels of a prior in the coordinates x of a [`MovementTable`].
#[derive(Clone, Debug)]
pub(crate) struct Kernels {
    /// Number q of coordinates.
    n_directions: usize,
    /// Number M of components, a multiple of four: those in excess have no share.
    n_components: usize,
    /// Centres x₀/c² (q, M) at the mean logarithm of the duration.
    centres: Vec<f64>,
    /// Change (q,) of every x₀/c² with the logarithm of the duration.
    slope: Vec<f64>,
    /// Logarithms (M,) of the prior at log T, less ½|x₀|²/c²: constant, and factor of log T less its mean.
    logs: Vec<[f64; 2]>,
    /// Terms of every component: constant, and factor of the square.
    common: [f64; 2],
    /// Precision 1/c² of every coordinate.
    precision: f64,
    /// Exponent β of the likelihood.
    tempering: f64,
}

impl Kernels {
    /// Returns the kernels on the demonstrations of a prior.
    pub(crate) fn new(prior: &Prior, moments: &Moments, table: &MovementTable) -> Self {
        let settings = prior.settings();
        let precision = settings.bandwidth.powi(-2);
        let kept = (1.0 - settings.bandwidth.powi(2)).sqrt();
        let slope = table.inverse.dot(&ndarray::aview1(&moments.slope));
        let deviations = &prior.parameters() - &ndarray::aview1(&moments.mean);
        let x = table.inverse.dot(&deviations.t());
        // Without a centre of its own, every component is the same.
        let n = if kept > 0.0 { prior.n_demos() } else { 1 };
        let n_components = n.next_multiple_of(WIDTH);
        let log_precision = precision / moments.log_deviation.powi(2);
        let mut centres = vec![0.0; table.n_directions * n_components];
        let mut logs = vec![[f64::NEG_INFINITY, 0.0]; n_components];
        for (m, logs) in logs.iter_mut().enumerate().take(n) {
            let own = kept * (prior.log_durations()[m] - moments.log_mean);
            let centre = &x.column(m) * kept - &slope * own;
            (0..table.n_directions).for_each(|i| centres[i * n_components + m] = precision * centre[i]);
            let square = log_precision * own * own + precision * centre.dot(&centre);
            *logs = [-0.5 * square, log_precision * own - precision * centre.dot(&slope)];
        }
        let constant = 0.5 * table.n_directions as f64 * precision.ln() + (prior.n_demos() as f64 / n as f64).ln();
        let common = [constant, -0.5 * (log_precision + precision * slope.dot(&slope))];
        let (slope, tempering) = ((slope * precision).to_vec(), settings.tempering);
        Self { n_directions: table.n_directions, n_components, centres, slope, logs, common, precision, tempering }
    }
}

/// Posterior of four hypotheses: mixtures of Gaussians of the covariance (FFᵀ)⁻¹ with the lower triangle F.
#[derive(Clone, Debug)]
pub(crate) struct Belief {
    /// Logarithm of the evidence, then the weights of the hypotheses.
    pub(crate) weight: F64x4,
    /// Vector βΣΦᵀy + x₀/c² (q,) without the centres, then the mean.
    pub(crate) mean: Vec<F64x4>,
    /// Covariance (q, q) of the mixture.
    pub(crate) covariance: Vec<F64x4>,
    /// Factor F (q, q).
    factor: Vec<F64x4>,
    /// Logarithms of the shares of the components (M,), then the shares.
    shares: Vec<F64x4>,
    /// Mean of the centres x₀/c² (q,).
    centre: Vec<F64x4>,
}

impl Belief {
    pub(crate) fn new(kernels: &Kernels) -> Self {
        let (q, m) = (kernels.n_directions, kernels.n_components);
        let lanes = |n: usize| vec![F64x4::ZERO; n];
        Self {
            weight: F64x4::ZERO,
            mean: lanes(q),
            covariance: lanes(size(q)),
            factor: lanes(size(q)),
            shares: lanes(m),
            centre: lanes(q),
        }
    }

    /// Returns whether the weight of one of the hypotheses counts.
    pub(crate) fn counts(&self) -> bool {
        self.weight.to_array().iter().any(|weight| *weight > MIN_WEIGHT)
    }
}

/// Kernel that computes evidence and shares.
///
/// `information` (q + 1, q + 1) is the sum of the outer products of the whitened rows [Φ, y]; `log` the logarithm of the
/// duration, less the mean. With Λ = I/c² + βΣΦᵀΦ = FFᵀ and b = x₀/c² + βΣΦᵀy of a component with centre x₀, its mean is
/// Λ⁻¹b and its evidence exp(½|F⁻¹b|² − ½|x₀|²/c² − ½βΣy²) / √|c²Λ|.
pub(crate) struct Weigh<'a> {
    pub(crate) belief: &'a mut Belief,
    pub(crate) information: &'a [F64x4],
    pub(crate) log: F64x4,
    pub(crate) kernels: &'a Kernels,
}

impl Kernel for Weigh<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { belief: Belief { weight, mean, factor, shares, .. }, information, log, kernels } = self;
        let (q, beta, own) = (kernels.n_directions, kernels.tempering, T::load(&log));
        for i in 0..q {
            let (to, from) = (&mut factor[row(i)..][..i + 1], &information[row(i)..][..i + 1]);
            for j in 0..=i {
                to[j] = (T::load(&from[j]) * beta).store();
            }
            factor[row(i) + i] += F64x4::splat(kernels.precision);
        }
        let determinant = factorise::<T>(factor, q);
        let observed = &information[row(q)..=row(q) + q];
        for i in 0..q {
            mean[i] = (T::load(&observed[i]) * beta + own * kernels.slope[i]).store();
        }
        let (eights, rest) = shares.as_chunks_mut::<N_TOGETHER>();
        let mut memory = [[T::default(); N_TOGETHER]; MAX_DIRECTIONS];
        for k in 0..eights.len() {
            components(kernels, N_TOGETHER * k, own, mean, factor, &mut memory[..q], &mut eights[k]);
        }
        if let Some(four) = rest.first_chunk_mut::<WIDTH>() {
            let mut memory = [[T::default(); WIDTH]; MAX_DIRECTIONS];
            let first = kernels.n_components - WIDTH;
            components(kernels, first, own, mean, factor, &mut memory[..q], four);
        }
        let (mut largest, mut sum) = (T::splat(f64::NEG_INFINITY), T::default());
        for m in 0..shares.len() {
            largest = largest.fast_max(T::load(&shares[m]));
        }
        for m in 0..shares.len() {
            let relative = T::load(&shares[m]) - largest;
            let counts = !relative.simd_lt(T::splat(MIN_LOG_SHARE)).all();
            // The exponential of the limit itself is below the rounding errors of a sum.
            let share = exp(relative.fast_max(T::splat(MIN_LOG_SHARE)));
            shares[m] = if counts { share.store() } else { F64x4::ZERO };
            sum = sum + T::load(&shares[m]);
        }
        let scale = T::splat(1.0) / sum;
        for m in 0..shares.len() {
            shares[m] = (T::load(&shares[m]) * scale).store();
        }
        let [constant, of_square] = kernels.common;
        let common = observed[q] * F64x4::splat(-0.5 * beta) + log * log * F64x4::splat(of_square) - determinant;
        *weight += common + F64x4::splat(constant) + largest.store() + sum.store().ln();
    }
}

/// Computes the logarithms of the shares of N components from the first one on.
#[inline(always)]
fn components<T: Register, const N: usize>(
    kernels: &Kernels,
    first: usize,
    log: T,
    observed: &[F64x4],
    factor: &[F64x4],
    memory: &mut [[T; N]],
    shares: &mut [F64x4; N],
) {
    for i in 0..memory.len() {
        let observed = T::load(&observed[i]);
        let centres = &kernels.centres[i * kernels.n_components + first..][..N];
        for k in 0..N {
            memory[i][k] = observed + T::splat(centres[k]);
        }
    }
    forward(factor, memory);
    let mut squares = [T::default(); N];
    for i in 0..memory.len() {
        for k in 0..N {
            squares[k] = squares[k] + memory[i][k] * memory[i][k];
        }
    }
    let logs = &kernels.logs[first..][..N];
    for k in 0..N {
        let [constant, of_log] = logs[k];
        shares[k] = (squares[k] * 0.5 + (log * of_log + T::splat(constant))).store();
    }
}

/// Kernel that computes means after [`Weigh`].
pub(crate) struct Mean<'a> {
    pub(crate) belief: &'a mut Belief,
    pub(crate) kernels: &'a Kernels,
}

impl Kernel for Mean<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { belief: Belief { mean, factor, shares, centre, .. }, kernels } = self;
        let mut memory = [[T::default(); 1]; MAX_DIRECTIONS];
        let vector = &mut memory[..mean.len()];
        let shares = shares.as_chunks::<WIDTH>().0;
        for i in 0..vector.len() {
            let centres = &kernels.centres[i * kernels.n_components..].as_chunks::<WIDTH>().0[..shares.len()];
            let mut sums = [T::default(); WIDTH];
            for m in 0..shares.len() {
                for k in 0..WIDTH {
                    sums[k] = sums[k] + T::load(&shares[m][k]) * centres[m][k];
                }
            }
            let sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
            centre[i] = sum.store();
            vector[i][0] = T::load(&mean[i]) + sum;
        }
        forward(factor, vector);
        backward(factor, vector);
        for i in 0..vector.len() {
            mean[i] = vector[i][0].store();
        }
    }
}

/// Memory of [`Spread`].
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    /// Triangular matrix (q, q).
    root: Vec<F64x4>,
    /// Symmetric matrix Λ⁻¹ (q, q).
    inverse: Vec<F64x4>,
    /// Vectors (q,) of components, padded to a multiple of four.
    vectors: Vec<F64x4>,
    /// Components that count.
    chosen: Vec<usize>,
    /// Sum of the second moments (q, q) of the hypotheses by their weights.
    second: Vec<F64x4>,
    /// Mean (q,) and covariance (q, q) over all hypotheses.
    mean: Vec<f64>,
    covariance: Vec<f64>,
}

impl Scratch {
    pub(crate) fn new(kernels: &Kernels) -> Self {
        let q = kernels.n_directions;
        let lanes = |n: usize| vec![F64x4::ZERO; n];
        Self {
            root: lanes(size(q)),
            inverse: lanes(size(q)),
            vectors: lanes(N_TOGETHER * q.next_multiple_of(WIDTH)),
            chosen: Vec::with_capacity(kernels.n_components),
            second: lanes(size(q)),
            mean: vec![0.0; q],
            covariance: vec![0.0; size(q)],
        }
    }

    /// Begins a sum of second moments.
    pub(crate) fn begin(&mut self) {
        self.second.fill(F64x4::ZERO);
    }

    /// Returns mean (q,) and covariance (q, q), its lower triangle, over the hypotheses that count.
    pub(crate) fn moments(&mut self, beliefs: &[Belief]) -> (&[f64], &[f64]) {
        let Self { second, mean, covariance, .. } = self;
        let counting = beliefs.iter().filter(|belief| belief.counts());
        let scale = counting.clone().map(|belief| belief.weight.reduce_add()).sum::<f64>().recip();
        for (i, entry) in mean.iter_mut().enumerate() {
            *entry = scale * counting.clone().map(|belief| (belief.weight * belief.mean[i]).reduce_add()).sum::<f64>();
        }
        for i in 0..mean.len() {
            let entries = row(i)..=row(i) + i;
            for ((entry, second), other) in covariance[entries.clone()].iter_mut().zip(&second[entries]).zip(&*mean) {
                *entry = scale * second.reduce_add() - mean[i] * other;
            }
        }
        (mean, covariance)
    }
}

/// Kernel that computes covariances after [`Mean`], and adds the second moments to those of the other hypotheses.
pub(crate) struct Spread<'a> {
    pub(crate) belief: &'a mut Belief,
    pub(crate) kernels: &'a Kernels,
    pub(crate) scratch: &'a mut Scratch,
}

impl Kernel for Spread<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { belief, kernels, scratch: Scratch { root, inverse, vectors, chosen, second, .. } } = self;
        let Belief { weight, mean, covariance, factor, shares, centre } = belief;
        let (q, weight) = (mean.len(), T::load(weight));
        let width = q.next_multiple_of(WIDTH);
        invert::<T>(factor, root, q);
        gram::<T>(root, inverse, q);
        covariance.copy_from_slice(inverse);
        chosen.clear();
        for m in 0..shares.len() {
            if !(T::load(&shares[m]) * weight).simd_lt(T::splat(MIN_SHARE)).all() {
                chosen.push(m);
            }
        }
        // A single component has no other mean.
        if chosen.len() == 1 {
            chosen.clear();
        }
        let mut deviations = [[T::default(); N_TOGETHER]; MAX_DIRECTIONS];
        for chosen in chosen.chunks(N_TOGETHER) {
            for k in 0..chosen.len() {
                let scale = T::load(&shares[chosen[k]]).sqrt();
                for i in 0..q {
                    let own = T::splat(kernels.centres[i * kernels.n_components + chosen[k]]);
                    deviations[i][k] = (own - T::load(&centre[i])) * scale;
                }
            }
            for i in 0..q {
                let moved = product(inverse, &deviations[..q], i);
                for k in 0..N_TOGETHER {
                    vectors[k * width + i] = moved[k].store();
                }
            }
            add_squares::<T>(covariance, &vectors[..chosen.len() * width], width, q);
        }
        for i in 0..q {
            let (moments, entries) = (&mut second[row(i)..][..i + 1], &covariance[row(i)..][..i + 1]);
            let own = T::load(&mean[i]);
            for j in 0..=i {
                let square = T::load(&entries[j]) + own * T::load(&mean[j]);
                moments[j] = (T::load(&moments[j]) + weight * square).store();
            }
        }
    }
}
