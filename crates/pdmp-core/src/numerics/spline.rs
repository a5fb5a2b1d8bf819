//! Interpolating cubic splines through the samples of a recording, in terms of values and slopes at the knots.
//!
//! On the interval from knot k to its neighbour o, with H = t_o − t_k, r = (t − t_k)/H and the chord δ = (y_o − y_k)/H,
//!
//! ```text
//! y(t) = y_k + (t − t_k)[ṡ_k + r(3δ − 2ṡ_k − ṡ_o) + r²(ṡ_k + ṡ_o − 2δ)]
//! ```
//!
//! The slopes ṡ follow from the continuity of the second derivative: one tridiagonal system for all splines over the same
//! knots, solved in O(n), for one DoF or for four in a register. Every coefficient is a ratio of intervals and no value is
//! squared, so that the accuracy depends neither on the unit of time nor on that of the values.
//!
//! C. de Boor, A Practical Guide to Splines, Springer 1978, chapter IV.

use ndarray::Array2;

use crate::numerics::simd::{F64x4, Real, gather, groups, scatter};
use crate::validate::row_major_mut;

/// Knots of cubic splines with the factorised system of their slopes.
#[derive(Clone, Debug)]
pub(crate) struct Knots {
    /// Times of the n knots; a periodic spline repeats the first knot one period later.
    time: Vec<f64>,
    /// Factorised rows (n,) of the system.
    rows: Vec<FactorisedRow>,
    /// Low-rank correction of the cyclic system of periodic splines.
    cyclic: Option<CyclicCorrection>,
}

/// Row of the tridiagonal system: coefficients of the slopes before, at and after the knot on the left-hand side, and of
/// the rises over two neighbouring intervals on the right-hand side.
struct Row {
    slopes: [f64; 3],
    rises: [f64; 2],
}

/// Row of the factorised system, divided by its pivot, which leaves one multiplication and one subtraction per row in the
/// dependent part of either substitution.
#[derive(Clone, Copy, Debug)]
struct FactorisedRow {
    /// Weights of the rises over two neighbouring intervals.
    rises: [f64; 2],
    /// Factor of the previous slope in the forward substitution.
    lower: f64,
    /// Factor of the next slope in the backward substitution.
    upper: f64,
    /// Inverse of the pivot.
    inverse_pivot: f64,
}

/// Sherman–Morrison correction: the cyclic matrix is a tridiagonal one plus u·vᵀ, u = (−2, 0, …, bottom), v = (1, 0, …, last).
#[derive(Clone, Debug)]
struct CyclicCorrection {
    last: f64,
    /// x/(1 + vᵀx) with the solution x of the tridiagonal system for u.
    solution: Vec<f64>,
}

impl Knots {
    /// Returns the knots of not-a-knot splines, whose third derivative is continuous at the second and the last but one
    /// knot. They reproduce cubics.
    ///
    /// The caller ensures that n is at least 4 and that the times increase.
    pub(crate) fn not_a_knot(time: Vec<f64>) -> Self {
        let (n, h) = (time.len(), intervals(&time));
        let mut rows = Vec::with_capacity(n);
        let ([end, next], rises) = end_condition(h[0], h[1]);
        rows.push(Row { slopes: [0.0, end, next], rises });
        rows.extend(h.windows(2).map(|h| inner_condition(h[0], h[1])));
        let ([end, next], [outer, inner]) = end_condition(h[n - 2], h[n - 3]);
        rows.push(Row { slopes: [next, end, 0.0], rises: [inner, outer] });
        Self { time, rows: factorise(&rows), cyclic: None }
    }

    /// Returns the knots of periodic splines, t_0 < … < t_{n−1} < t_0 + period.
    ///
    /// The caller ensures that n is at least 3 and that the times increase.
    pub(crate) fn periodic(mut time: Vec<f64>, period: f64) -> Self {
        let n = time.len();
        time.push(time[0] + period);
        let h = intervals(&time);
        let mut rows: Vec<_> = (0..n).map(|i| inner_condition(h[(i + n - 1) % n], h[i])).collect();
        let (top, bottom) = (rows[0].slopes[0], rows[n - 1].slopes[2]);
        rows[0].slopes[1] += 2.0;
        rows[n - 1].slopes[1] += top * bottom / 2.0;
        let rows = factorise(&rows);

        let last = -top / 2.0;
        let mut solution = vec![0.0; n];
        (solution[0], solution[n - 1]) = (-2.0 * rows[0].inverse_pivot, bottom * rows[n - 1].inverse_pivot);
        for i in 1..n {
            solution[i] -= rows[i].lower * solution[i - 1];
        }
        substitute_back(&rows, &mut solution);
        let denominator = 1.0 + solution[0] + last * solution[n - 1];
        solution.iter_mut().for_each(|x| *x /= denominator);
        Self { time, rows, cyclic: Some(CyclicCorrection { last, solution }) }
    }

    /// Returns the number of knots n.
    fn len(&self) -> usize {
        self.rows.len()
    }

    /// Writes the `slopes` (n,) at the knots of the spline through `values` (n,).
    pub(crate) fn slopes<T: Real>(&self, values: &[T], slopes: &mut [T]) {
        let n = self.len();
        let mut before = T::default();
        for (i, FactorisedRow { rises: [left, right], lower, .. }) in self.rows.iter().enumerate() {
            let [from, at, to] = match self.cyclic {
                None if i == 0 => [0, 1, 2],
                None if i == n - 1 => [n - 3, n - 2, n - 1],
                Some(_) if i == 0 => [n - 1, 0, 1],
                Some(_) if i == n - 1 => [n - 2, n - 1, 0],
                _ => [i - 1, i, i + 1],
            }
            .map(|knot| values[knot]);
            before = (at - from) * *left + (to - at) * *right - before * *lower;
            slopes[i] = before;
        }
        substitute_back(&self.rows, slopes);
        if let Some(CyclicCorrection { last, solution }) = &self.cyclic {
            let projection = slopes[0] + slopes[n - 1] * *last;
            slopes.iter_mut().zip(solution).for_each(|(slope, x)| *slope = *slope - projection * *x);
        }
    }

    /// Evaluates the spline with `values` and `slopes` (n,) at non-decreasing `times` (k,), into `out` (k,).
    ///
    /// The values at the knots are reproduced bit for bit. Outside of the knots the end cubics continue.
    pub(crate) fn sample<T: Real>(
        &self,
        values: &[T],
        slopes: &[T],
        times: impl IntoIterator<Item = f64>,
        out: &mut [T],
    ) {
        let mut right = 1;
        for (t, out) in times.into_iter().zip(out) {
            while right + 1 < self.time.len() && self.time[right] <= t {
                right += 1;
            }
            let [near, far] = self.by_distance(t, right);
            let (x, per_width) = (t - self.time[near], 1.0 / (self.time[far] - self.time[near]));
            let r = x * per_width;
            let [near, far] = [near, far].map(|knot| knot % self.len());
            let (y, [slope, slope_far]) = (values[near], [near, far].map(|knot| slopes[knot]));
            let chord = (values[far] - y) * per_width;
            let (bend, twist) = (chord * 3.0 - slope * 2.0 - slope_far, slope + slope_far - chord * 2.0);
            *out = y + (slope + (bend + twist * r) * r) * x;
        }
    }

    /// Returns the knot `right` and the one before it, the nearer to `t` first. Expanded about the nearer knot, the cubic
    /// reproduces the values at both without rounding error.
    fn by_distance(&self, t: f64, right: usize) -> [usize; 2] {
        let left = right - 1;
        if t - self.time[left] < self.time[right] - t { [left, right] } else { [right, left] }
    }
}

/// Splines of all DoFs of a movement over common knots.
#[derive(Clone, Debug)]
pub(crate) struct Splines {
    knots: Knots,
    n_dofs: usize,
    /// Values and slopes (n,) at the knots of each group of DoFs.
    groups: Vec<[Vec<F64x4>; 2]>,
}

impl Splines {
    /// Returns the splines through values (n, D) at the knots, given by rows.
    pub(crate) fn through(knots: Knots, rows: &[f64], n_dofs: usize) -> Self {
        let interpolate = |group| {
            let [mut values, mut slopes] = [(); 2].map(|()| vec![F64x4::ZERO; knots.len()]);
            gather(rows, n_dofs, group, &mut values);
            knots.slopes(&values, &mut slopes);
            [values, slopes]
        };
        let groups = (0..groups(n_dofs)).map(interpolate).collect();
        Self { knots, n_dofs, groups }
    }

    /// Returns the number of DoFs D.
    pub(crate) fn n_dofs(&self) -> usize {
        self.n_dofs
    }

    /// Returns the slopes (n, D) at the knots.
    pub(crate) fn slopes(&self) -> Array2<f64> {
        let mut rows = Array2::zeros((self.knots.len(), self.n_dofs));
        for (group, [_, slopes]) in self.groups.iter().enumerate() {
            scatter(slopes, self.n_dofs, group, row_major_mut(&mut rows));
        }
        rows
    }

    /// Evaluates the splines at non-decreasing `times` (k,), into `rows` (k, D), as [`Knots::sample`] does for one DoF.
    pub(crate) fn sample(&self, times: impl Iterator<Item = f64> + Clone, rows: &mut [f64]) {
        let mut sampled = vec![F64x4::ZERO; rows.len() / self.n_dofs];
        for (group, [values, slopes]) in self.groups.iter().enumerate() {
            self.knots.sample(values, slopes, times.clone(), &mut sampled);
            scatter(&sampled, self.n_dofs, group, rows);
        }
    }
}

fn intervals(time: &[f64]) -> Vec<f64> {
    time.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// Returns the row for continuity of the second derivative between two intervals.
fn inner_condition(left: f64, right: f64) -> Row {
    let (a, b) = (right / (left + right), left / (left + right));
    Row { slopes: [a, 2.0, b], rises: [3.0 * a / left, 3.0 * b / right] }
}

/// Returns the condition for continuity of the third derivative between the two intervals at an end, with the condition
/// on the second derivative subtracted: coefficients of the end slope and its neighbour, and of the outer and inner rise.
fn end_condition(outer: f64, inner: f64) -> ([f64; 2], [f64; 2]) {
    let (a, b) = (inner / (outer + inner), outer / (outer + inner));
    ([a, 1.0], [a * (2.0 + b) / outer, b * b / inner])
}

/// Factorises the system by Gaussian elimination. No pivoting is needed: the systems are diagonally dominant, those with
/// end conditions after elimination of the end slope.
fn factorise(rows: &[Row]) -> Vec<FactorisedRow> {
    let mut factorised: Vec<FactorisedRow> = Vec::with_capacity(rows.len());
    for &Row { slopes: [below, diagonal, above], rises } in rows {
        let eliminated = factorised.last().map_or(0.0, |before| below * before.upper);
        let inverse_pivot = 1.0 / (diagonal - eliminated);
        let [lower, upper] = [below, above].map(|x| x * inverse_pivot);
        factorised.push(FactorisedRow { rises: rises.map(|w| w * inverse_pivot), lower, upper, inverse_pivot });
    }
    factorised
}

/// Performs the backward substitution in place.
fn substitute_back<T: Real>(rows: &[FactorisedRow], slopes: &mut [T]) {
    let mut after = T::default();
    for (slope, row) in slopes.iter_mut().zip(rows).rev() {
        after = *slope - after * row.upper;
        *slope = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{assert_abs_diff_eq, assert_relative_eq};
    use ndarray::{ArrayView2, Axis, concatenate};
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    /// Splines with their period and the values and slopes at the knots.
    struct Spline {
        splines: Splines,
        period: Option<f64>,
        values: Array2<f64>,
        slopes: Array2<f64>,
    }

    impl Spline {
        fn not_a_knot(time: &[f64], values: ArrayView2<f64>) -> Self {
            Self::over(Knots::not_a_knot(time.to_vec()), None, values)
        }

        fn periodic(time: &[f64], period: f64, values: ArrayView2<f64>) -> Self {
            Self::over(Knots::periodic(time.to_vec(), period), Some(period), values)
        }

        fn over(knots: Knots, period: Option<f64>, values: ArrayView2<f64>) -> Self {
            let values = values.as_standard_layout().to_owned();
            let splines = Splines::through(knots, values.as_slice().unwrap(), values.ncols());
            Self { period, slopes: splines.slopes(), splines, values }
        }

        fn sample(&self, times: &[f64]) -> Array2<f64> {
            let mut out = Array2::zeros((times.len(), self.values.ncols()));
            self.splines.sample(times.iter().map(|&t| self.wrapped(t)), out.as_slice_mut().unwrap());
            out
        }

        /// Derivative at `times`, by differentiation of the equation at the head of this file.
        fn sample_slopes(&self, times: &[f64]) -> Array2<f64> {
            Array2::from_shape_fn((times.len(), self.values.ncols()), |(i, d)| {
                let (t, time) = (self.wrapped(times[i]), &self.splines.knots.time);
                let right = time.partition_point(|&knot| knot <= t).clamp(1, time.len() - 1);
                let [near, far] = self.splines.knots.by_distance(t, right);
                let width = time[far] - time[near];
                let r = (t - time[near]) / width;
                let [near, far] = [near, far].map(|knot| [knot % self.splines.knots.len(), d]);
                let (chord, [s, o]) =
                    ((self.values[far] - self.values[near]) / width, [near, far].map(|k| self.slopes[k]));
                s + r * (2.0 * (3.0 * chord - 2.0 * s - o) + 3.0 * r * (s + o - 2.0 * chord))
            })
        }

        fn wrapped(&self, t: f64) -> f64 {
            let first = self.splines.knots.time[0];
            match self.period {
                Some(period) if !(first..first + period).contains(&t) => first + (t - first).rem_euclid(period),
                _ => t,
            }
        }
    }

    /// Increasing knots with intervals between 0.1 and 1.
    fn knots(n: std::ops::Range<usize>) -> impl Strategy<Value = Vec<f64>> {
        (-5.0..5.0, prop::collection::vec(0.1..1.0, n)).prop_map(|(start, h): (f64, Vec<f64>)| {
            h.iter().scan(start, |t, h| Some(std::mem::replace(t, *t + h))).collect()
        })
    }

    /// Samples of `f` as a column (n, 1).
    fn column(time: &[f64], f: impl Fn(f64) -> f64) -> Array2<f64> {
        Array2::from_shape_fn((time.len(), 1), |(i, _)| f(time[i]))
    }

    fn uniform(n: usize, step: f64) -> Vec<f64> {
        (0..n).map(|i| i as f64 * step).collect()
    }

    fn at(spline: &Spline, t: f64) -> f64 {
        spline.sample(&[t])[[0, 0]]
    }

    fn slope_at(spline: &Spline, t: f64) -> f64 {
        spline.sample_slopes(&[t])[[0, 0]]
    }

    /// One-sided second derivative at `t`; exact on a cubic piece that contains `t` and `t` + 2`h`.
    fn second_derivative_at(spline: &Spline, t: f64, h: f64) -> f64 {
        let [s0, s1, s2] = [0.0, 1.0, 2.0].map(|k| slope_at(spline, t + k * h));
        (4.0 * s1 - 3.0 * s0 - s2) / (2.0 * h)
    }

    proptest! {
        #[test]
        fn not_a_knot_reproduces_any_cubic_inside_and_beyond(
            time in knots(4..20), c in prop::array::uniform4(-1.0..1.0), share in -0.1..1.1,
        ) {
            let cubic = |t: f64| c[0] + t * (c[1] + t * (c[2] + t * c[3]));
            let spline = Spline::not_a_knot(&time, column(&time, cubic).view());
            let t = time[0] + share * (time[time.len() - 1] - time[0]);
            assert_relative_eq!(at(&spline, t), cubic(t), epsilon = 1e-8, max_relative = 1e-9);
            let slope = c[1] + t * (2.0 * c[2] + t * 3.0 * c[3]);
            assert_relative_eq!(slope_at(&spline, t), slope, epsilon = 1e-8, max_relative = 1e-9);
        }

        #[test]
        fn the_second_derivative_is_continuous_at_every_knot_and_at_the_seam(
            time in knots(3..12), y in prop::collection::vec(-1.0..1.0, 12), gap in 0.1..1.0,
        ) {
            let (n, last) = (time.len(), time[time.len() - 1]);
            let values = Array2::from_shape_fn((n, 1), |(i, _)| y[i]);
            let period = last + gap - time[0];
            let mut splines = vec![Spline::periodic(&time, period, values.view())];
            if n >= 4 {
                splines.push(Spline::not_a_knot(&time, values.view()));
            }
            for spline in &splines {
                for &t in if spline.period.is_some() { &time[..] } else { &time[1..n - 1] } {
                    let (before, after) = (second_derivative_at(spline, t, -0.04), second_derivative_at(spline, t, 0.04));
                    assert_abs_diff_eq!(before, after, epsilon = 1e-7 * (1.0 + before.abs()));
                }
            }
        }

        #[test]
        fn values_at_the_knots_are_reproduced_bit_for_bit(time in knots(4..12), y in prop::collection::vec(-1.0..1.0, 12)) {
            let values = Array2::from_shape_fn((time.len(), 1), |(i, _)| y[i]);
            let period = 12.0 + time[0].abs();
            for spline in [
                Spline::not_a_knot(&time, values.view()),
                Spline::periodic(&time, period, values.view()),
            ] {
                prop_assert_eq!(spline.sample(&time), &values);
                prop_assert_eq!(spline.sample_slopes(&time), spline.slopes);
            }
        }
    }

    proptest! {
        /// Splines of several DoFs are bitwise those of each DoF alone, in full and in partial groups.
        #[test]
        fn splines_of_many_dofs_are_those_of_each_alone(
            time in knots(4..12), n_dofs in 1..=9usize, y in prop::collection::vec(-1.0..1.0, 9 * 12), gap in 0.1..1.0,
        ) {
            let values = Array2::from_shape_fn((time.len(), n_dofs), |(i, d)| y[9 * i + d]);
            let period = time[time.len() - 1] + gap - time[0];
            let all = |values: ArrayView2<f64>| {
                [Spline::not_a_knot(&time, values), Spline::periodic(&time, period, values)]
            };
            let between: Vec<f64> = time.iter().map(|t| t + 0.03).collect();
            for (d, one) in values.axis_chunks_iter(Axis(1), 1).enumerate() {
                for (together, alone) in all(values.view()).iter().zip(all(one)) {
                    prop_assert_eq!(together.slopes.column(d), alone.slopes.column(0));
                    let [together, alone] = [together, &alone].map(|spline| spline.sample(&between));
                    prop_assert_eq!(together.column(d), alone.column(0));
                }
            }
        }
    }

    #[test]
    fn the_third_derivative_is_continuous_next_to_the_ends() {
        let time = [0.0, 0.3, 1.0, 1.2, 2.0, 2.7];
        let spline = Spline::not_a_knot(&time, column(&time, |t| (3.0 * t).sin()).view());
        let third =
            |t: f64| (second_derivative_at(&spline, t + 0.02, 0.02) - second_derivative_at(&spline, t, 0.02)) / 0.02;
        assert_relative_eq!(third(0.1), third(0.5), max_relative = 1e-8);
        assert_relative_eq!(third(1.5), third(2.3), max_relative = 1e-8);
        assert!((third(0.5) - third(1.05)).abs() > 1e-2);
    }

    #[test]
    fn the_error_falls_with_the_fourth_power_of_the_interval() {
        let error = |n: usize, periodic: bool| {
            let values = |time: &[f64]| column(time, f64::sin);
            let spline = if periodic {
                let time = uniform(n, TAU / n as f64);
                Spline::periodic(&time, TAU, values(&time).view())
            } else {
                let time = uniform(n + 1, TAU / n as f64);
                Spline::not_a_knot(&time, values(&time).view())
            };
            (0..5000).map(|i| TAU * i as f64 / 5000.0).map(|t| (at(&spline, t) - t.sin()).abs()).fold(0.0, f64::max)
        };
        for periodic in [false, true] {
            let ratio = error(50, periodic) / error(100, periodic);
            assert!((14.0..40.0).contains(&ratio), "periodic: {periodic}, ratio {ratio}");
            assert!(error(100, periodic) < 1e-6);
        }
    }

    #[test]
    fn columns_do_not_mix_and_a_constant_has_no_slope() {
        let time = uniform(30, 0.1);
        let sine = column(&time, f64::sin);
        let both = concatenate![Axis(1), Array2::from_elem((30, 1), 0.1), sine];
        for (pair, alone) in [
            (Spline::not_a_knot(&time, both.view()), Spline::not_a_knot(&time, sine.view())),
            (Spline::periodic(&time, 3.1, both.view()), Spline::periodic(&time, 3.1, sine.view())),
        ] {
            assert!(pair.slopes.column(0).iter().all(|&slope| slope == 0.0));
            assert_eq!(pair.slopes.column(1), alone.slopes.column(0));
            assert!([-0.77, 1.234, 50.0].map(|t| at(&pair, t)).iter().all(|&y| y == 0.1));
        }
    }

    #[test]
    fn neither_the_unit_of_time_nor_that_of_the_values_matters() {
        let (time, probe) = ([0.0, 0.3, 1.0, 1.2, 2.0], [0.1, 0.77, 1.99]);
        let values = column(&time, |t| (3.0 * t).sin());
        let build = |second: f64, unit: f64| {
            let time = time.map(|t| t * second);
            let values = &values * unit;
            let probe = probe.map(|t| t * second);
            [Spline::not_a_knot(&time, values.view()), Spline::periodic(&time, 2.5 * second, values.view())]
                .map(|spline| [spline.sample(&probe) / unit, spline.sample_slopes(&probe) / unit * second])
        };
        let expected = build(1.0, 1.0);
        for (second, unit) in [(1e-6, 1e150), (1e6, 1e-150), (1e-6, 1e-150), (1e6, 1e150)] {
            for (found, expected) in build(second, unit).iter().flatten().zip(expected.iter().flatten()) {
                found.iter().zip(expected).for_each(|(a, b)| assert_relative_eq!(a, b, max_relative = 1e-9));
            }
        }
    }
}
