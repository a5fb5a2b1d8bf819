//! The banded matrices of the smoothing spline, for four penalties side by side.

use std::ops::Range;

use crate::numerics::simd::{F64x4, Real};

/// Columns of Q, and the upper bands of R and QᵀQ: (diagonal, first, second) in each row. Two columns of zeros follow
/// those of Q, so that there are as many as knots.
pub(super) struct Roughness {
    q: Vec<[f64; 3]>,
    r: Vec<[f64; 2]>,
    qq: Vec<[f64; 3]>,
}

/// M = LDLᵀ: in row i, 1/d_i and the elements of L in rows i + 1 and i + 2 of column i.
pub(super) struct Factor(Vec<[F64x4; 3]>);

impl Roughness {
    /// The matrices of splines with these knots (n,), at least three.
    pub(super) fn new(knots: &[f64]) -> Self {
        let h: Vec<f64> = knots.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let inverse: Vec<f64> = h.iter().map(|h| 1.0 / h).collect();
        let columns = inverse.windows(2).map(|inverse| [inverse[0], -inverse[0] - inverse[1], inverse[1]]);
        let q: Vec<[f64; 3]> = columns.chain([[0.0; 3]; 2]).collect();
        let r = h.windows(2).map(|h| [(h[0] + h[1]) / 3.0, h[1] / 6.0]).collect();
        let product = |q: &[[f64; 3]]| {
            let [[a, b, c], [a1, b1, _], [a2, ..]] = [q[0], q[1], q[2]];
            [a * a + b * b + c * c, b * a1 + c * b1, c * a2]
        };
        let qq = q.windows(3).map(product).collect();
        Self { q, r, qq }
    }

    /// M = R + λQᵀQ, factorised.
    pub(super) fn factor(&self, lambda: F64x4) -> Factor {
        // Of the two rows before: L's elements, and these times d.
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
        Factor(self.r.iter().zip(&self.qq).map(row).collect())
    }

    /// Qᵀy of samples (n,), in their place; the last two become zero.
    pub(super) fn bend<T: Real>(&self, y: &mut [T]) {
        let n_bends = self.r.len();
        for (i, q) in self.q[..n_bends].iter().enumerate() {
            y[i] = (y[i] - y[i + 1]) * q[0] + (y[i + 2] - y[i + 1]) * q[2];
        }
        y[n_bends..].fill(T::default());
    }

    /// Qγ (n,) of γ = M⁻¹Qᵀy, which ends in two zeros: λ times it is taken off the samples.
    pub(super) fn residuals(&self, gamma: &[F64x4]) -> impl Iterator<Item = F64x4> {
        let [mut next, mut after] = [F64x4::ZERO; 2];
        gamma.iter().zip(&self.q).map(move |(&here, q)| {
            let residual = here * q[0] + next;
            (next, after) = (here * q[1] + after, here * q[2]);
            residual
        })
    }

    /// tr(QᵀQ M⁻¹) = tr(I − A)/λ, the terms of some columns of Q, from the elements (i, i), (i, i + 1) and (i, i + 2) of M⁻¹ = L⁻ᵀD⁻¹ + M⁻¹(I − L)
    /// (Hutchinson and de Hoog).
    pub(super) fn trace(&self, factor: &Factor, columns: Range<usize>) -> F64x4 {
        let [mut next, mut after] = [[F64x4::ZERO; 3]; 2];
        let mut trace = F64x4::ZERO;
        for (i, (q, &[inverse, first, second])) in self.qq.iter().zip(&factor.0).enumerate().rev() {
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

impl Factor {
    /// M⁻¹b, in place (n−2, at least).
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
