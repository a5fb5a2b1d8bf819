//! Factor R (K, N) of a tall matrix A (M, N), RᵀR = AᵀA, updated by blocks of rows.
//!
//! Movements of a planner or a simulation vary in few ways. While the rows of A lie, to rounding, in the span of a few
//! orthonormal columns Q (N, K), R = T·Qᵀ with the triangular factor T of their coordinates AQ: a row takes 2·K·N + K²
//! multiplications. Noise fills all N dimensions; T is then the factor of the rows themselves, at N² multiplications a row.

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, Mat, MatMut, MatRef, Par};
use ndarray::{Array2, ArrayView2, s};

use super::triangle::{Triangle, chunks, dot};
use crate::error::Result;
use crate::numerics::threads::Threads;

/// Largest part of a row outside the span, relative to the largest row: a tenth of the accuracy of the factors. Rounding of
/// the positions leaves about 4e-14 in the targets of 200 samples, and less than 1e-12 in those of 1000.
const TOLERANCE: f64 = 1e-12;
/// Rows that are projected before they are reflected.
const ROWS: usize = 512;
/// Rows that a thread projects at a time: those of a thousand values stay in the second-level cache.
const PART: usize = 64;
/// Smallest ratio of N to the dimension of a span. A row of 1400 values takes 5 to 22 µs with 27 to 150 dimensions, and 105 µs
/// with N; rows of noise take 70 ms more in all, as much as 700 of them (120 ms at a ratio of 6, 220 at 4).
const MIN_RATIO: usize = 8;

/// Factor R (K, N).
#[derive(Clone, Debug)]
pub(super) struct RowFactor {
    n_columns: usize,
    /// Span of the rows; none if it has too many dimensions.
    span: Option<Span>,
    /// Factor T of the coordinates of the rows in the span, or of the rows.
    triangle: Triangle,
}

/// Span of rows.
#[derive(Clone, Debug)]
pub(super) struct Span {
    /// Orthonormal vectors (K, N).
    pub(super) vectors: Vec<f64>,
    /// Largest norm of a row.
    pub(super) largest: f64,
}

impl RowFactor {
    /// Returns the factor of a matrix of N columns without rows.
    pub(super) fn zero(n_columns: usize) -> Self {
        let span = Span { vectors: Vec::new(), largest: 0.0 };
        Self { n_columns, span: Some(span), triangle: Triangle::zero(0) }
    }

    /// Returns the factor with a span and the elements of T on and above the diagonal, by rows.
    pub(super) fn from_parts(n_columns: usize, span: Option<Span>, elements: &[f64]) -> Self {
        let n = span.as_ref().map_or(n_columns, |span| span.vectors.len() / n_columns);
        Self { n_columns, span, triangle: Triangle::from_elements(n, elements) }
    }

    /// Returns the span, and the elements of T on and above the diagonal, by rows.
    pub(super) fn parts(&self) -> (Option<&Span>, Vec<f64>) {
        (self.span.as_ref(), self.triangle.elements())
    }

    /// Returns the number of columns N.
    pub(super) fn n_columns(&self) -> usize {
        self.n_columns
    }

    /// Returns true if all elements are finite.
    pub(super) fn has_finite_elements(&self) -> bool {
        self.triangle.has_finite_elements()
    }

    /// Returns R, with rows of zeros after the others if they are fewer than `min_rows`, of which N suffice.
    pub(super) fn matrix(&self, min_rows: usize) -> Array2<f64> {
        let rank = self.triangle.n_columns();
        let mut matrix = Array2::zeros((rank.max(min_rows.min(self.n_columns)), self.n_columns));
        let mut rows = matrix.slice_mut(s![..rank, ..]);
        let triangle = self.triangle.matrix();
        match &self.span {
            Some(span) => {
                let vectors = ArrayView2::from_shape((rank, self.n_columns), &span.vectors[..rank * self.n_columns]);
                rows.assign(&triangle.dot(&vectors.expect("K rows")))
            }
            None => rows.assign(&triangle),
        }
        matrix
    }

    /// Adds columns that are zero in all rows so far.
    pub(super) fn extend(&mut self, n_columns: usize) {
        match &mut self.span {
            Some(span) => {
                let zeros = vec![0.0; n_columns - self.n_columns];
                let vectors = span.vectors.chunks_exact(self.n_columns);
                span.vectors = vectors.flat_map(|vector| [vector, &zeros].concat()).collect();
            }
            None => self.triangle.extend(n_columns),
        }
        self.n_columns = n_columns;
    }

    /// Adds rows (m, N), given as blocks of columns.
    ///
    /// # Errors
    /// The first error of a thread.
    pub(super) fn update(&mut self, rows: &[ArrayView2<f64>], threads: Threads) -> Result<()> {
        let n_rows = rows.first().map_or(0, |columns| columns.nrows());
        let (mut start, mut grows) = (0, false);
        while start < n_rows {
            let Some(span) = &mut self.span else {
                let rest: Vec<_> = rows.iter().map(|columns| columns.slice(s![start.., ..])).collect();
                return self.triangle.update(&rest, threads);
            };
            let part = start..n_rows.min(start + PART);
            let inside = if grows { None } else { span.project(rows, start..n_rows.min(start + ROWS), threads)? };
            let Some(coordinates) = inside.or_else(|| span.widen(block(rows, part.clone()), part.len())) else {
                self.leave_span(threads)?;
                continue;
            };
            start += coordinates.ncols();
            grows = coordinates.nrows() > self.triangle.n_columns();
            if grows {
                self.triangle.extend(coordinates.nrows());
            }
            self.triangle.reflect(coordinates.transpose().to_owned().as_mut(), 0, threads)?;
        }
        Ok(())
    }

    /// Adds the rows of another factor, whose column k is the column `places[k]` of this one.
    ///
    /// # Errors
    /// The first error of a thread.
    pub(super) fn merge(&mut self, other: &Self, places: &[usize], threads: Threads) -> Result<()> {
        let are_in_order = places.iter().enumerate().all(|(k, place)| k == *place);
        if other.span.is_none() && are_in_order {
            self.leave_span(threads)?;
            return self.triangle.merge(&other.triangle, threads);
        }
        let rows = other.matrix(0);
        let mut placed = Array2::zeros((rows.nrows(), self.n_columns));
        for (column, place) in rows.columns().into_iter().zip(places) {
            placed.column_mut(*place).assign(&column);
        }
        // Rows of the factor stand for many, and are larger than any of them.
        let largest = |factor: &Self| factor.span.as_ref().map_or(0.0, |span| span.largest);
        let largest = largest(self).max(largest(other));
        self.update(&[placed.view()], threads)?;
        if let Some(span) = &mut self.span {
            span.largest = largest;
        }
        Ok(())
    }

    /// Replaces T by the factor of the rows.
    fn leave_span(&mut self, threads: Threads) -> Result<()> {
        if self.span.is_some() {
            let rows = self.matrix(0);
            (self.span, self.triangle) = (None, Triangle::zero(self.n_columns));
            self.triangle.update(&[rows.view()], threads)?;
        }
        Ok(())
    }
}

/// Returns rows as the columns of a matrix (N, m).
fn block(rows: &[ArrayView2<f64>], range: Range<usize>) -> Vec<f64> {
    let mut block = Vec::new();
    fill(&mut block, rows, range);
    block
}

fn fill(block: &mut Vec<f64>, rows: &[ArrayView2<f64>], range: Range<usize>) {
    block.clear();
    for i in range {
        for columns in rows {
            match columns.row(i).to_slice() {
                Some(row) => block.extend_from_slice(row),
                None => block.extend(columns.row(i)),
            }
        }
    }
}

/// Returns the index and the norm of the largest column; a norm that is not a number is the largest.
fn largest(matrix: MatRef<f64>) -> (usize, f64) {
    let norms = matrix.col_iter().map(|column| dot(column, column).sqrt().abs()).enumerate();
    norms.max_by(|(_, norm), (_, other)| norm.total_cmp(other)).unwrap_or((0, 0.0))
}

impl Span {
    fn vectors(&self, n: usize) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(&self.vectors, n, self.vectors.len() / n)
    }

    /// Returns the coordinates (K, m) of the first m rows, up to a part outside the span; none if that is the first part.
    fn project(&mut self, rows: &[ArrayView2<f64>], range: Range<usize>, threads: Threads) -> Result<Option<Mat<f64>>> {
        let n = rows.iter().map(|columns| columns.ncols()).sum();
        let vectors = self.vectors(n);
        let mut coordinates = Mat::zeros(vectors.ncols(), range.len());
        let mut norms = vec![[0.0; 2]; range.len().div_ceil(PART)];
        let project = |block: &mut Vec<f64>, (k, (mut part, norms)): (usize, (MatMut<f64>, &mut [f64; 2]))| {
            let start = range.start + k * PART;
            fill(block, rows, start..start + part.ncols());
            let mut rest = MatMut::from_column_major_slice_mut(block, n, part.ncols());
            matmul(part.rb_mut().transpose_mut(), Accum::Replace, rest.rb().transpose(), vectors, 1.0, Par::Seq);
            matmul(rest.rb_mut(), Accum::Add, vectors, part.rb(), -1.0, Par::Seq);
            *norms = [largest(part.rb()).1, largest(rest.rb()).1];
            Ok(())
        };
        // The parts do not depend on the number of threads, so that rounding does not either.
        let parts = chunks(coordinates.as_mut(), PART).into_iter().zip(&mut norms).enumerate().collect();
        threads.try_for_each_with_progress(parts, || Vec::with_capacity(n * PART), project, &mut |_| Ok(()))?;
        let mut n_inside = 0;
        for [size, outside] in norms {
            let largest = self.largest.max(size);
            let is_inside = largest.is_finite() && outside <= TOLERANCE * largest;
            if !is_inside {
                break;
            }
            self.largest = largest;
            n_inside += PART;
        }
        coordinates.truncate(coordinates.nrows(), n_inside.min(coordinates.ncols()));
        Ok((n_inside > 0).then_some(coordinates))
    }

    /// Adds the directions that a block (N, m) needs, and returns its coordinates (K, m); none if the directions are too many,
    /// or if the block is not finite.
    fn widen(&mut self, mut block: Vec<f64>, m: usize) -> Option<Mat<f64>> {
        let n = block.len() / m;
        let mut rest = MatMut::from_column_major_slice_mut(&mut block, n, m);
        self.largest = self.largest.max(largest(rest.rb()).1);
        let mut coordinates = self.vectors(n).transpose() * rest.rb();
        rest -= self.vectors(n) * &coordinates;
        loop {
            let (at, norm) = largest(rest.rb());
            if self.largest.is_finite() && norm <= TOLERANCE * self.largest {
                return Some(coordinates);
            }
            if !norm.is_finite() || (coordinates.nrows() + 1) * MIN_RATIO > n {
                return None;
            }
            let mut vector = rest.rb().subcols(at, 1) * faer::Scale(1.0 / norm);
            // Projected twice, the direction is orthogonal to the others to rounding.
            vector -= self.vectors(n) * (self.vectors(n).transpose() * &vector);
            vector *= faer::Scale(1.0 / vector.norm_l2());
            let products = vector.transpose() * rest.rb();
            matmul(rest.rb_mut(), Accum::Add, vector.as_ref(), products.as_ref(), -1.0, Par::Seq);
            self.vectors.extend(vector.col(0).iter());
            coordinates.resize_with(coordinates.nrows() + 1, m, |_, i| products[(0, i)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const N: usize = 90;

    /// Returns rows in the span of `rank` random rows.
    fn spanned(n_rows: usize, rank: usize, seed: u64) -> Array2<f64> {
        let mut random = Random(seed);
        let mut matrix = |rows, columns| Array2::from_shape_fn((rows, columns), |_| random.between(-1.0, 1.0));
        let directions = matrix(rank, N);
        matrix(n_rows, rank).dot(&directions)
    }

    fn stacked(parts: &[&Array2<f64>]) -> Array2<f64> {
        ndarray::concatenate(ndarray::Axis(0), &parts.iter().map(|part| part.view()).collect::<Vec<_>>()).unwrap()
    }

    fn factor(rows: &Array2<f64>, size: usize, threads: Threads) -> RowFactor {
        let mut factor = RowFactor::zero(N);
        for start in (0..rows.nrows()).step_by(size) {
            let part = rows.slice(s![start..(start + size).min(rows.nrows()), ..]);
            factor.update(&[part.slice(s![.., ..70]), part.slice(s![.., 70..])], threads).unwrap();
        }
        factor
    }

    /// Asserts that RᵀR = AᵀA, relative to the largest element, and returns the number of rows of R.
    fn check(factor: &RowFactor, rows: &Array2<f64>) -> usize {
        let matrix = factor.matrix(0);
        let (found, expected) = (matrix.t().dot(&matrix), rows.t().dot(rows));
        let largest = |matrix: &Array2<f64>| matrix.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let error = largest(&(found - &expected)) / largest(&expected);
        assert!(error < 1e-12, "{error:e}");
        matrix.nrows()
    }

    /// The number of rows of R is that of the dimensions, also where further ones appear late, for blocks of any size; it is N
    /// after one block of noise.
    #[test]
    fn factor_has_the_dimensions_of_the_rows() {
        let few = stacked(&[&spanned(800, 5, 1), &spanned(3, 2, 2), &spanned(700, 5, 1)]);
        let noise = stacked(&[&few, &spanned(150, N, 3)]);
        for size in [1, 97, 2000] {
            assert_eq!(check(&factor(&few, size, Threads::ONE), &few), 7);
            assert_eq!(check(&factor(&noise, size, Threads::ONE), &noise), N);
        }
        let one = factor(&few, 2000, Threads::ONE);
        assert_eq!(one.matrix(20).slice(s![7.., ..]), Array2::<f64>::zeros((13, N)));
        assert_eq!(one.matrix(usize::MAX).nrows(), N);
        assert_eq!(one.matrix(0), factor(&few, 2000, Threads::new(2).unwrap()).matrix(0));
        let (span, elements) = one.parts();
        assert_eq!(RowFactor::from_parts(N, span.cloned(), &elements).matrix(0), one.matrix(0));
    }

    /// A direction is kept however small it is beside the others, down to the tolerance.
    #[test]
    fn small_directions_are_kept() {
        let rows = |share: f64| stacked(&[&spanned(300, 4, 4), &(spanned(300, 4, 4) + spanned(300, 1, 5) * share)]);
        assert_eq!(check(&factor(&rows(1e-10), 100, Threads::ONE), &rows(1e-10)), 5);
        assert_eq!(check(&factor(&rows(1e-14), 100, Threads::ONE), &rows(1e-14)), 4);
    }

    /// Parts of few and of many dimensions are merged in any order, also after further columns and with columns in another
    /// order.
    #[test]
    fn merging_is_associative_to_rounding() {
        let parts = [spanned(200, 4, 6), spanned(300, 3, 7), spanned(250, N, 8)];
        let factors = parts.each_ref().map(|rows| factor(rows, 110, Threads::ONE));
        let places: Vec<usize> = (0..N).collect();
        for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
            let (mut merged, mut rows) = (RowFactor::zero(N), Array2::zeros((0, N)));
            for part in order {
                merged.merge(&factors[part], &places, Threads::ONE).unwrap();
                rows = stacked(&[&rows, &parts[part]]);
                check(&merged, &rows);
            }
        }
        for (first, dimensions) in [(0, 7), (2, N + 2)] {
            let mut wider = factors[first].clone();
            wider.extend(N + 2);
            let reversed: Vec<usize> = (0..N).map(|k| N + 1 - k).collect();
            wider.merge(&factors[1], &reversed, Threads::ONE).unwrap();
            let mut rows = Array2::zeros((parts[first].nrows() + 300, N + 2));
            rows.slice_mut(s![..parts[first].nrows(), ..N]).assign(&parts[first]);
            rows.slice_mut(s![parts[first].nrows().., 2..]).assign(&parts[1].slice(s![.., ..;-1]));
            assert_eq!(check(&wider, &rows), dimensions);
        }
    }

    /// Numbers that are not finite are not lost.
    #[test]
    fn overflow_is_visible() {
        for value in [f64::INFINITY, f64::NAN] {
            for mut rows in [spanned(100, 3, 9), Array2::zeros((100, N))] {
                rows[[80, 12]] = value;
                assert!(!factor(&rows, 50, Threads::ONE).has_finite_elements());
            }
        }
    }
}
