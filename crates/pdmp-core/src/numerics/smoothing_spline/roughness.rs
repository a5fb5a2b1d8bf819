//! Banded matrices of the smoothing spline, factorised for four values of λ at once.

use std::ops::Range;

use super::Rest;
use crate::numerics::simd::{F64x4, Real};

/// Matrices of the roughness penalty ∫f̈² of splines with n knots, to which an end at rest adds one of no weight.
pub(super) struct Roughness {
    /// Nonzero elements of each column of Q (n, n−2), padded to n columns with zeros.
    q: Vec<[f64; 3]>,
    /// Diagonal and superdiagonal of R (n−2, n−2).
    r: Vec<[f64; 2]>,
    /// Diagonal and two superdiagonals of QᵀQ (n−2, n−2).
    qq: Vec<[f64; 3]>,
    rest: Rest,
}

/// Factorisation M = LDLᵀ: 1/d_i, and the elements (i+1, i) and (i+2, i) of L.
pub(super) struct Factorization(Vec<[F64x4; 3]>);

impl Roughness {
    /// Computes the matrices for at least three increasing knots and ends that are at rest, ḟ = 0, or natural, f̈ = 0.
    ///
    /// At rest, the difference with a sample before the end has no weight: ḟ(t₀) = (f₁ − f₀)/h₀ − h₀(2γ₀ + γ₁)/6 = 0 is the
    /// equation of an interval of length zero whose inverse is zero, too.
    pub(super) fn new(knots: &[f64], rest: Rest) -> Self {
        let [before, after] = rest.map(|is_at_rest| is_at_rest.then_some(0.0));
        let own: Vec<f64> = knots.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let padded = |own: Vec<f64>| before.into_iter().chain(own).chain(after).collect::<Vec<f64>>();
        let (inverse, h) = (padded(own.iter().map(|h| 1.0 / h).collect()), padded(own));
        let columns = inverse.windows(2).map(|inverse| [inverse[0], -inverse[0] - inverse[1], inverse[1]]);
        let q: Vec<[f64; 3]> = columns.chain([[0.0; 3]; 2]).collect();
        let r = h.windows(2).map(|h| [(h[0] + h[1]) / 3.0, h[1] / 6.0]).collect();
        let product = |q: &[[f64; 3]]| {
            let [[a, b, c], [a1, b1, _], [a2, ..]] = [q[0], q[1], q[2]];
            [a * a + b * b + c * c, b * a1 + c * b1, c * a2]
        };
        let qq = q.windows(3).map(product).collect();
        Self { q, r, qq, rest }
    }

    /// Returns the number of second differences.
    pub(super) fn n_differences(&self) -> usize {
        self.r.len()
    }

    /// Adds the samples beyond ends at rest, which have no weight.
    pub(super) fn extend<T: Copy>(&self, y: &mut Vec<T>) {
        let (first, last) = (y[0], y[y.len() - 1]);
        if self.rest[0] {
            y.push(first);
            y.rotate_right(1);
        }
        if self.rest[1] {
            y.push(last);
        }
    }

    /// Factorises M = R + λQᵀQ.
    pub(super) fn factorize(&self, lambda: F64x4) -> Factorization {
        // Elements of L in the two previous columns, alone and times d.
        let ([mut first, mut second, mut earlier], [mut first_d, mut second_d, mut earlier_d]) =
            ([F64x4::ZERO; 3], [F64x4::ZERO; 3]);
        let row = |(r, qq): (&[f64; 2], &[f64; 3])| {
            let d = lambda * qq[0] + r[0] - first * first_d - earlier * earlier_d;
            let inverse = F64x4::splat(1.0) / d;
            let next_d = lambda * qq[1] + r[1] - first_d * second;
            let after_d = lambda * qq[2];
            (earlier, earlier_d) = (second, second_d);
            (first, second, first_d, second_d) = (next_d * inverse, after_d * inverse, next_d, after_d);
            [inverse, first, second]
        };
        Factorization(self.r.iter().zip(&self.qq).map(row).collect())
    }

    /// Replaces extended samples y (n,) by their second divided differences Qᵀy (n−2,), followed by two zeros.
    pub(super) fn second_differences<T: Real>(&self, y: &mut [T]) {
        let n_differences = self.n_differences();
        for (i, q) in self.q[..n_differences].iter().enumerate() {
            y[i] = (y[i] - y[i + 1]) * q[0] + (y[i + 2] - y[i + 1]) * q[2];
        }
        y[n_differences..].fill(T::default());
    }

    /// Returns Qγ = (y − f)/λ from the first sample on, for γ = M⁻¹Qᵀy padded with two zeros.
    pub(super) fn residuals(&self, gamma: &[F64x4]) -> impl Iterator<Item = F64x4> {
        let [mut next, mut after] = [F64x4::ZERO; 2];
        let residual = move |(&here, q): (&F64x4, &[f64; 3])| {
            let residual = here * q[0] + next;
            (next, after) = (here * q[1] + after, here * q[2]);
            residual
        };
        gamma.iter().zip(&self.q).map(residual).skip(usize::from(self.rest[0]))
    }

    /// Computes tr(QᵀQM⁻¹) = tr(I − A)/λ, restricted to the terms of some columns of Q.
    ///
    /// The elements (i, i), (i, i + 1) and (i, i + 2) of M⁻¹ follow from M⁻¹ = L⁻ᵀD⁻¹ + M⁻¹(I − L) (Hutchinson and de Hoog).
    pub(super) fn trace(&self, factors: &Factorization, columns: Range<usize>) -> F64x4 {
        let [mut next, mut after] = [[F64x4::ZERO; 3]; 2];
        let mut trace = F64x4::ZERO;
        for (i, (q, &[inverse, first, second])) in self.qq.iter().zip(&factors.0).enumerate().rev() {
            let one = F64x4::ZERO - first * next[0] - second * next[1];
            let two = F64x4::ZERO - first * next[1] - second * after[0];
            let here = [inverse - first * one - second * two, one, two];
            if columns.contains(&i) {
                trace += here[0] * q[0] + (one * q[1] + two * q[2]) * 2.0;
            }
            (next, after) = (here, next);
        }
        trace
    }
}

impl Factorization {
    /// Replaces the first n−2 elements of b by M⁻¹b.
    pub(super) fn solve(&self, b: &mut [F64x4]) {
        let [mut before, mut last, mut beyond] = [F64x4::ZERO; 3];
        for (x, [_, first, second]) in b.iter_mut().zip(&self.0) {
            let here = *x - last - before;
            (before, last) = (beyond, here * *first);
            beyond = here * *second;
            *x = here;
        }
        let [mut next, mut after] = [F64x4::ZERO; 2];
        for (x, [inverse, first, second]) in b.iter_mut().zip(&self.0).rev() {
            let here = *x * *inverse - *first * next - *second * after;
            (next, after) = (here, next);
            *x = here;
        }
    }
}
