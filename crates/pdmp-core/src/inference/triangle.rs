//! Symmetric and triangular matrices of four hypotheses at once, a hypothesis to a lane.
//!
//! Stored is the lower triangle by rows, each padded to a multiple of four columns, so that loops run over blocks of four
//! columns. The padding of a triangular matrix is zero.
// Closures of iterators stay calls, into which the instructions of larger registers are not inlined.
#![allow(clippy::needless_range_loop)]

use std::cmp::Ordering;

use crate::numerics::simd::{F64x4, Register, WIDTH};

/// Returns the place of a row.
pub(crate) const fn row(i: usize) -> usize {
    let block = i / WIDTH;
    WIDTH * (block + 1) * (2 * block + i % WIDTH)
}

/// Returns the number of stored elements of a matrix (n, n), with its rows padded to a multiple of four.
pub(crate) const fn size(n: usize) -> usize {
    row(n.next_multiple_of(WIDTH))
}

/// Returns a block of four columns.
#[inline(always)]
fn load<T: Register>(blocks: &[[F64x4; WIDTH]], block: usize) -> [T; WIDTH] {
    let block = &blocks[block];
    [T::load(&block[0]), T::load(&block[1]), T::load(&block[2]), T::load(&block[3])]
}

#[inline(always)]
fn store<T: Register>(values: &mut [F64x4], block: usize, columns: [T; WIDTH]) {
    let block = &mut values.as_chunks_mut::<WIDTH>().0[block];
    for k in 0..WIDTH {
        block[k] = columns[k].store();
    }
}

/// Returns the blocks of four columns.
#[inline(always)]
fn blocks(values: &[F64x4]) -> &[[F64x4; WIDTH]] {
    values.as_chunks::<WIDTH>().0
}

/// Adds the outer products of vectors (n,), padded to `width`, to a symmetric matrix (n, n).
#[inline(always)]
pub(crate) fn add_squares<T: Register>(matrix: &mut [F64x4], vectors: &[F64x4], width: usize, n: usize) {
    for pair in 0..n.div_ceil(2) {
        for block in 0..=2 * pair / WIDTH {
            let (first, second) = (row(2 * pair) / WIDTH + block, row(2 * pair + 1) / WIDTH + block);
            let (mut above, mut below) = (load::<T>(blocks(matrix), first), load::<T>(blocks(matrix), second));
            for vector in vectors.chunks_exact(width) {
                let own = &vector.as_chunks::<2>().0[pair];
                let (own, next) = (T::load(&own[0]), T::load(&own[1]));
                let other = load::<T>(blocks(vector), block);
                for k in 0..WIDTH {
                    above[k] = above[k] + own * other[k];
                    below[k] = below[k] + next * other[k];
                }
            }
            store(matrix, first, above);
            store(matrix, second, below);
        }
    }
}

/// Replaces a positive definite matrix (n, n) by its Cholesky factor F with the reciprocals of its diagonal; returns the sum
/// of the logarithms of the diagonal.
#[inline(always)]
pub(crate) fn factorise<T: Register>(matrix: &mut [F64x4], n: usize) -> F64x4 {
    let (mut log, mut product) = (F64x4::ZERO, T::splat(1.0));
    for j in 0..n {
        let own = row(j);
        let mut inverse = T::default();
        for block in j / WIDTH..n.div_ceil(WIDTH) {
            let (start, width) = (row(WIDTH * block), WIDTH * (block + 1));
            let mut column = [T::default(); WIDTH];
            for k in 0..WIDTH {
                column[k] = T::load(&matrix[start + k * width + j]);
            }
            let (pivots, rows) = (&matrix[own..own + j], &matrix[start..][..WIDTH * width]);
            let (a, b) = (&rows[..j], &rows[width..][..j]);
            let (c, d) = (&rows[2 * width..][..j], &rows[3 * width..][..j]);
            for k in 0..j {
                let factor = T::load(&pivots[k]);
                column[0] = column[0] - factor * T::load(&a[k]);
                column[1] = column[1] - factor * T::load(&b[k]);
                column[2] = column[2] - factor * T::load(&c[k]);
                column[3] = column[3] - factor * T::load(&d[k]);
            }
            if block == j / WIDTH {
                // Rounding alone could make it negative: the prior precision is part of it.
                let pivot = column[j % WIDTH].fast_max(T::splat(f64::MIN_POSITIVE)).sqrt();
                product = product * pivot;
                inverse = T::splat(1.0) / pivot;
            }
            for k in 0..WIDTH {
                match (WIDTH * block + k).cmp(&j) {
                    Ordering::Less => {}
                    Ordering::Equal => matrix[own + j] = inverse.store(),
                    Ordering::Greater => matrix[start + k * width + j] = (column[k] * inverse).store(),
                }
            }
        }
        // A product of four neither overflows nor underflows.
        if j % WIDTH == WIDTH - 1 || j == n - 1 {
            log += product.store().ln();
            product = T::splat(1.0);
        }
    }
    log
}

/// Solves F z = b in place, for N vectors b (n,).
#[inline(always)]
pub(crate) fn forward<T: Register, const N: usize>(factor: &[F64x4], vectors: &mut [[T; N]]) {
    for i in 0..vectors.len() {
        let entries = &factor[row(i)..][..i + 1];
        let mut values = vectors[i];
        for j in 0..i {
            let entry = T::load(&entries[j]);
            for k in 0..N {
                values[k] = values[k] - entry * vectors[j][k];
            }
        }
        let inverse = T::load(&entries[i]);
        for k in 0..N {
            vectors[i][k] = values[k] * inverse;
        }
    }
}

/// Solves Fᵀ x = z in place.
#[inline(always)]
pub(crate) fn backward<T: Register>(factor: &[F64x4], vector: &mut [[T; 1]]) {
    for i in (0..vector.len()).rev() {
        let entries = &factor[row(i)..][..i + 1];
        let x = vector[i][0] * T::load(&entries[i]);
        vector[i][0] = x;
        for j in 0..i {
            vector[j][0] = vector[j][0] - T::load(&entries[j]) * x;
        }
    }
}

/// Computes the inverse U (n, n) of a Cholesky factor.
#[inline(always)]
pub(crate) fn invert<T: Register>(factor: &[F64x4], inverse: &mut [F64x4], n: usize) {
    for i in 0..n {
        let entries = &factor[row(i)..][..i + 1];
        let scale = T::load(&entries[i]);
        for block in 0..=i / WIDTH {
            let mut values = [T::default(); WIDTH];
            for k in WIDTH * block..i {
                let entry = T::load(&entries[k]);
                let other = load::<T>(blocks(inverse), row(k) / WIDTH + block);
                for c in 0..WIDTH {
                    values[c] = values[c] - entry * other[c];
                }
            }
            for c in 0..WIDTH {
                values[c] = match (WIDTH * block + c).cmp(&i) {
                    Ordering::Less => values[c] * scale,
                    Ordering::Equal => scale,
                    Ordering::Greater => T::default(),
                };
            }
            store(inverse, row(i) / WIDTH + block, values);
        }
    }
}

/// Computes the symmetric matrix UᵀU (n, n) of a triangular one.
#[inline(always)]
pub(crate) fn gram<T: Register>(root: &[F64x4], matrix: &mut [F64x4], n: usize) {
    for i in 0..n {
        for block in 0..=i / WIDTH {
            let mut sums = [T::default(); WIDTH];
            for k in i..n {
                let own = T::load(&root[row(k) + i]);
                let other = load::<T>(blocks(root), row(k) / WIDTH + block);
                for c in 0..WIDTH {
                    sums[c] = sums[c] + own * other[c];
                }
            }
            store(matrix, row(i) / WIDTH + block, sums);
        }
    }
}

/// Returns element i of the products of a symmetric matrix and N vectors (n,).
#[inline(always)]
pub(crate) fn product<T: Register, const N: usize>(matrix: &[F64x4], vectors: &[[T; N]], i: usize) -> [T; N] {
    let mut sums = [T::default(); N];
    let entries = &matrix[row(i)..][..i + 1];
    for j in 0..vectors.len() {
        let entry = T::load(if j <= i { &entries[j] } else { &matrix[row(j) + i] });
        for k in 0..N {
            sums[k] = sums[k] + entry * vectors[j][k];
        }
    }
    sums
}

/// Returns aᵀCa for a symmetric matrix C (n, n).
#[inline(always)]
pub(crate) fn square<T: Register>(matrix: &[F64x4], a: &[F64x4]) -> T {
    let mut total = T::default();
    for i in 0..a.len() {
        let (entries, own) = (&matrix[row(i)..][..i + 1], T::load(&a[i]));
        let mut sum = T::default();
        for j in 0..i {
            sum = sum + T::load(&entries[j]) * T::load(&a[j]);
        }
        total = total + own * (sum + sum + T::load(&entries[i]) * own);
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Factor, inverse, products and solutions agree with the matrices they come from, for every size.
    #[test]
    fn matrices_agree_with_their_factors() {
        let mut random = Random(4);
        for n in 1..=24usize {
            let width = n.next_multiple_of(WIDTH);
            let mut number = || F64x4::new([(); 4].map(|()| random.between(-1.0, 1.0)));
            let mut vectors = vec![F64x4::ZERO; 2 * n * width];
            vectors.chunks_exact_mut(width).for_each(|row| row[..n].iter_mut().for_each(|value| *value = number()));
            let mut matrix = vec![F64x4::ZERO; size(n)];
            add_squares::<F64x4>(&mut matrix, &vectors, width, n);
            (0..n).for_each(|i| matrix[row(i) + i] += F64x4::splat(0.5));
            // The factor of the lower triangle alone.
            let mut factor = vec![F64x4::ZERO; size(n)];
            (0..n).for_each(|i| factor[row(i)..=row(i) + i].copy_from_slice(&matrix[row(i)..=row(i) + i]));
            let log = factorise::<F64x4>(&mut factor, n);
            let (mut root, mut inverse) = (vec![F64x4::ZERO; size(n)], vec![F64x4::ZERO; size(n)]);
            invert::<F64x4>(&factor, &mut root, n);
            gram::<F64x4>(&root, &mut inverse, n);
            let x: Vec<[F64x4; 1]> = (0..n).map(|_| [number()]).collect();
            let b: Vec<[F64x4; 1]> = (0..n).map(|i| product(&matrix, &x, i)).collect();
            let mut solved = b.clone();
            forward(&factor, &mut solved);
            let half: F64x4 = solved.iter().map(|z| z[0] * z[0]).fold(F64x4::ZERO, |sum, square| sum + square);
            backward(&factor, &mut solved);
            let flat: Vec<F64x4> = x.iter().map(|x| x[0]).collect();
            let whole = square::<F64x4>(&matrix, &flat);
            let logs = (0..n).fold(F64x4::ZERO, |sum, i| sum - factor[row(i) + i].ln());
            for lane in 0..WIDTH {
                let near = |a: F64x4, b: F64x4| {
                    let [a, b] = [a, b].map(|lanes| lanes.to_array()[lane]);
                    (a - b).abs() < 1e-9 * (1.0 + b.abs())
                };
                assert!(near(half, whole) && near(log, logs), "{n}");
                for i in 0..n {
                    assert!(near(solved[i][0], x[i][0]) && near(product(&inverse, &b, i)[0], x[i][0]), "{n}");
                }
            }
        }
    }
}
