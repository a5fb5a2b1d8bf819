//! Interpolating cubic splines through the samples of a recording, kept as values and slopes at the knots.
//!
//! On the interval from knot k to its neighbour o, with H = t_o − t_k, r = (t − t_k)/H and the chord δ = (y_o − y_k)/H,
//!
//! ```text
//! y(t) = y_k + (t − t_k)[ṡ_k + r(3δ − 2ṡ_k − ṡ_o) + r²(ṡ_k + ṡ_o − 2δ)]
//! ```
//!
//! and the slopes ṡ follow from the continuity of the second derivative: one tridiagonal system for all columns,
//! solved in O(n). Every coefficient is a ratio of intervals, and no value is squared: neither the unit of time nor
//! that of the values matters.
//!
//! C. de Boor, A Practical Guide to Splines, Springer 1978, chapter IV.

use ndarray::{Array2, ArrayView1, ArrayView2, s};

/// A twice continuously differentiable piecewise cubic in D dimensions.
#[derive(Clone, Debug)]
pub(crate) struct Spline {
    /// Knots; a periodic spline repeats the first one a period later.
    knots: Vec<f64>,
    /// Values at the knots.
    values: Array2<f64>,
    /// Slopes at the knots.
    slopes: Array2<f64>,
    /// Period, in the unit of the knots.
    period: Option<f64>,
}

/// Where a time lies: `x` after knot `near`, which is the fraction `r` of the signed interval `width` to knot `far`.
struct Place {
    near: usize,
    far: usize,
    width: f64,
    x: f64,
    r: f64,
}

impl Spline {
    /// The spline through `values` (n, D) at `time` (n,) whose third derivative is continuous at the second knot and
    /// the last but one. It reproduces cubics.
    ///
    /// The caller has checked that n is at least 4 and that the times increase.
    pub(crate) fn not_a_knot(time: &[f64], values: ArrayView2<f64>) -> Self {
        let (n, h, chords) = (time.len(), intervals(time), chords(time, values));
        let mut rows = vec![[0.0; 3]; n];
        let mut slopes = Array2::zeros(values.dim());
        let mut set = |i: usize, row: [f64; 3], inner: usize, [left, right]: [f64; 2]| {
            rows[i] = row;
            slopes.row_mut(i).scaled_add(left, &chords.row(inner - 1));
            slopes.row_mut(i).scaled_add(right, &chords.row(inner));
        };
        let ([end, next], [outer, inner]) = end_condition(h[0], h[1]);
        set(0, [0.0, end, next], 1, [outer, inner]);
        for i in 1..n - 1 {
            let (row, weights) = inner_condition(h[i - 1], h[i]);
            set(i, row, i, weights);
        }
        let ([end, next], [outer, inner]) = end_condition(h[n - 2], h[n - 3]);
        set(n - 1, [next, end, 0.0], n - 2, [inner, outer]);
        solve_tridiagonal(&rows, &mut slopes);
        Self { knots: time.to_vec(), values: values.to_owned(), slopes, period: None }
    }

    /// The spline of the given period through `values` (n, D) at `time` (n,), t_0 < … < t_{n−1} < t_0 + period.
    ///
    /// The caller has checked that n is at least 3 and that the times increase.
    pub(crate) fn periodic(time: &[f64], period: f64, values: ArrayView2<f64>) -> Self {
        let (n, n_dofs) = values.dim();
        let knots: Vec<f64> = time.iter().copied().chain([time[0] + period]).collect();
        let values = close(values);
        let (h, chords) = (intervals(&knots), chords(&knots, values.view()));
        let mut rows = vec![[0.0; 3]; n];
        let mut rhs = Array2::zeros((n, n_dofs + 1));
        for i in 0..n {
            let before = (i + n - 1) % n;
            let (row, [a, b]) = inner_condition(h[before], h[i]);
            rows[i] = row;
            let mut rhs = rhs.slice_mut(s![i, ..n_dofs]);
            rhs.scaled_add(a, &chords.row(before));
            rhs.scaled_add(b, &chords.row(i));
        }
        // Sherman–Morrison: the cyclic matrix is a tridiagonal one plus u·vᵀ, u = (−2, 0, …, bottom) in the last column
        // of the right-hand side, v = (1, 0, …, −top/2).
        let (top, bottom) = (rows[0][0], rows[n - 1][2]);
        rows[0][1] += 2.0;
        rows[n - 1][1] += top * bottom / 2.0;
        rhs[[0, n_dofs]] = -2.0;
        rhs[[n - 1, n_dofs]] = bottom;
        solve_tridiagonal(&rows, &mut rhs);
        let along_v = &rhs.row(0) - &(&rhs.row(n - 1) * (top / 2.0));
        let mut slopes = rhs.slice(s![.., ..n_dofs]).to_owned();
        for (mut slope, u) in slopes.rows_mut().into_iter().zip(rhs.column(n_dofs)) {
            slope.scaled_add(-u / (1.0 + along_v[n_dofs]), &along_v.slice(s![..n_dofs]));
        }
        Self { knots, values, slopes: close(slopes.view()), period: Some(period) }
    }

    /// Values at the knots (n, D).
    #[cfg(test)]
    pub(crate) fn values(&self) -> ArrayView2<'_, f64> {
        self.values.slice(s![..self.n_knots(), ..])
    }

    /// Slopes at the knots (n, D).
    pub(crate) fn slopes(&self) -> ArrayView2<'_, f64> {
        self.slopes.slice(s![..self.n_knots(), ..])
    }

    /// Writes the value at `t` to `out` (D,). Beyond the knots the end cubics continue, or the period repeats.
    pub(crate) fn value(&self, t: f64, out: &mut [f64]) {
        let at = self.place(t);
        for (d, out) in out.iter_mut().enumerate() {
            let [y, slope, bend, twist] = self.coefficients(&at, d);
            *out = y + at.x * (slope + at.r * (bend + at.r * twist));
        }
    }

    /// Writes the slope at `t` to `out` (D,).
    #[cfg(test)]
    pub(crate) fn slope(&self, t: f64, out: &mut [f64]) {
        let at = self.place(t);
        for (d, out) in out.iter_mut().enumerate() {
            let [_, slope, bend, twist] = self.coefficients(&at, d);
            *out = slope + at.r * (2.0 * bend + 3.0 * at.r * twist);
        }
    }

    /// Values (k, D) at `times` (k,).
    pub(crate) fn sample(&self, times: &[f64]) -> Array2<f64> {
        self.tabulate(times, Self::value)
    }

    /// Slopes (k, D) at `times` (k,).
    #[cfg(test)]
    pub(crate) fn sample_slopes(&self, times: &[f64]) -> Array2<f64> {
        self.tabulate(times, Self::slope)
    }

    fn tabulate(&self, times: &[f64], evaluate: impl Fn(&Self, f64, &mut [f64])) -> Array2<f64> {
        let n_dofs = self.values.ncols();
        let mut table = Array2::zeros((times.len(), n_dofs));
        let mut row = vec![0.0; n_dofs];
        for (mut out, &t) in table.rows_mut().into_iter().zip(times) {
            evaluate(self, t, &mut row);
            out.assign(&ArrayView1::from(&row));
        }
        table
    }

    fn n_knots(&self) -> usize {
        self.knots.len() - usize::from(self.period.is_some())
    }

    /// Expands about the nearer knot, so that values and slopes at the knots come out bit for bit.
    fn place(&self, t: f64) -> Place {
        let (first, last) = (self.knots[0], self.knots[self.knots.len() - 1]);
        let t = match self.period {
            Some(period) if !(first..last).contains(&t) => first + (t - first).rem_euclid(period),
            _ => t,
        };
        let right = self.knots.partition_point(|&knot| knot <= t).clamp(1, self.knots.len() - 1);
        let left = right - 1;
        let (near, far) = if t - self.knots[left] < self.knots[right] - t { (left, right) } else { (right, left) };
        let (x, width) = (t - self.knots[near], self.knots[far] - self.knots[near]);
        Place { near, far, width, x, r: x / width }
    }

    /// y_k, ṡ_k, 3δ − 2ṡ_k − ṡ_o and ṡ_k + ṡ_o − 2δ of column `d`.
    fn coefficients(&self, at: &Place, d: usize) -> [f64; 4] {
        let [y, y_far] = [at.near, at.far].map(|k| self.values[[k, d]]);
        let [slope, slope_far] = [at.near, at.far].map(|k| self.slopes[[k, d]]);
        let chord = (y_far - y) / at.width;
        [y, slope, 3.0 * chord - 2.0 * slope - slope_far, slope + slope_far - 2.0 * chord]
    }
}

fn intervals(knots: &[f64]) -> Vec<f64> {
    knots.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// Slopes of the chords (n − 1, D).
fn chords(knots: &[f64], values: ArrayView2<f64>) -> Array2<f64> {
    let mut chords = &values.slice(s![1.., ..]) - &values.slice(s![..-1, ..]);
    for (mut chord, h) in chords.rows_mut().into_iter().zip(intervals(knots)) {
        chord /= h;
    }
    chords
}

/// Appends the first row to the end.
fn close(rows: ArrayView2<f64>) -> Array2<f64> {
    Array2::from_shape_fn((rows.nrows() + 1, rows.ncols()), |(i, d)| rows[[i % rows.nrows(), d]])
}

/// Continuity of the second derivative between two intervals: weights of the three slopes, and of the two chords.
fn inner_condition(left: f64, right: f64) -> ([f64; 3], [f64; 2]) {
    let (a, b) = (right / (left + right), left / (left + right));
    ([a, 2.0, b], [3.0 * a, 3.0 * b])
}

/// Continuity of the third derivative between the two intervals at an end, less the condition on the second:
/// weights of the end slope and the next, and of the outer chord and the inner.
fn end_condition(outer: f64, inner: f64) -> ([f64; 2], [f64; 2]) {
    let (a, b) = (inner / (outer + inner), outer / (outer + inner));
    ([a, 1.0], [a * (2.0 + b), b * b])
}

/// Solves for all columns in place; `rows` hold (lower, diagonal, upper). No pivots are exchanged: all of these systems
/// are diagonally dominant, those of the end conditions once the end slope is eliminated.
fn solve_tridiagonal(rows: &[[f64; 3]], rhs: &mut Array2<f64>) {
    let mut pivots: Vec<f64> = Vec::with_capacity(rows.len());
    for (i, &[lower, diagonal, _]) in rows.iter().enumerate() {
        let mut pivot = diagonal;
        if i > 0 {
            let factor = lower / pivots[i - 1];
            pivot -= factor * rows[i - 1][2];
            let (above, mut row) = rhs.multi_slice_mut((s![i - 1, ..], s![i, ..]));
            row.scaled_add(-factor, &above);
        }
        pivots.push(pivot);
    }
    for (i, pivot) in pivots.iter().enumerate().rev() {
        if i + 1 < rows.len() {
            let (mut row, below) = rhs.multi_slice_mut((s![i, ..], s![i + 1, ..]));
            row.scaled_add(-rows[i][2], &below);
        }
        rhs.row_mut(i).mapv_inplace(|x| x / pivot);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{assert_abs_diff_eq, assert_relative_eq};
    use ndarray::{Axis, array, concatenate};
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    /// Increasing knots with intervals between 0.1 and 1.
    fn knots(n: std::ops::Range<usize>) -> impl Strategy<Value = Vec<f64>> {
        (-5.0..5.0, prop::collection::vec(0.1..1.0, n)).prop_map(|(start, h): (f64, Vec<f64>)| {
            h.iter().scan(start, |t, h| Some(std::mem::replace(t, *t + h))).collect()
        })
    }

    /// One column of samples of `f`.
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

    /// Second derivative at `t` from one side; exact on a cubic piece that holds `t` and `t` + 2`h`.
    fn bend_at(spline: &Spline, t: f64, h: f64) -> f64 {
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
                    let (before, after) = (bend_at(spline, t, -0.04), bend_at(spline, t, 0.04));
                    assert_abs_diff_eq!(before, after, epsilon = 1e-7 * (1.0 + before.abs()));
                }
            }
        }

        #[test]
        fn knots_come_out_bit_for_bit(time in knots(4..12), y in prop::collection::vec(-1.0..1.0, 12)) {
            let values = Array2::from_shape_fn((time.len(), 1), |(i, _)| y[i]);
            let period = 12.0 + time[0].abs();
            for spline in [
                Spline::not_a_knot(&time, values.view()),
                Spline::periodic(&time, period, values.view()),
            ] {
                prop_assert_eq!(spline.sample(&time), &values);
                prop_assert_eq!(spline.values(), &values);
                prop_assert_eq!(spline.sample_slopes(&time), spline.slopes());
            }
        }
    }

    #[test]
    fn the_third_derivative_is_continuous_next_to_the_ends() {
        let time = [0.0, 0.3, 1.0, 1.2, 2.0, 2.7];
        let spline = Spline::not_a_knot(&time, column(&time, |t| (3.0 * t).sin()).view());
        let third = |t: f64| (bend_at(&spline, t + 0.02, 0.02) - bend_at(&spline, t, 0.02)) / 0.02;
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
    fn a_period_repeats() {
        let time = [0.2, 0.9, 1.5, 2.8, 3.0];
        let spline = Spline::periodic(&time, 3.5, column(&time, |t| (t * t).cos()).view());
        for t in [0.2, 1.1, 3.3, 3.6] {
            for turns in [-3.0, -1.0, 1.0, 7.0] {
                assert_relative_eq!(at(&spline, t + turns * 3.5), at(&spline, t), epsilon = 1e-12);
                assert_relative_eq!(slope_at(&spline, t + turns * 3.5), slope_at(&spline, t), epsilon = 1e-11);
            }
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
            assert!(pair.slopes().column(0).iter().all(|&slope| slope == 0.0));
            assert_eq!(pair.slopes().column(1), alone.slopes().column(0));
            assert_eq!(pair.sample(&[-0.77, 1.234, 50.0]).column(0), array![0.1, 0.1, 0.1]);
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
