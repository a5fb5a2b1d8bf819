//! Interpolating cubic splines through the samples of a recording, by their values and slopes at the knots.
//!
//! On the interval from knot k to its neighbour o, with H = t_o − t_k, r = (t − t_k)/H and the chord δ = (y_o − y_k)/H,
//!
//! ```text
//! y(t) = y_k + (t − t_k)[ṡ_k + r(3δ − 2ṡ_k − ṡ_o) + r²(ṡ_k + ṡ_o − 2δ)]
//! ```
//!
//! and the slopes ṡ follow from the continuity of the second derivative: one tridiagonal system for all splines over the
//! same knots, solved in O(n), for one DoF or for four side by side. Every coefficient is a ratio of intervals, and no
//! value is squared: neither the unit of time nor that of the values matters.
//!
//! C. de Boor, A Practical Guide to Splines, Springer 1978, chapter IV.

use ndarray::Array2;

use crate::numerics::simd::{Lanes, Real, gather, groups, scatter};

/// Knots of cubic splines, with the system that the slopes solve, factorised.
#[derive(Clone, Debug)]
pub(crate) struct Knots {
    /// Times of the n knots; those of periodic splines repeat the first a period later.
    time: Vec<f64>,
    /// An equation for the slope at each knot.
    equations: Vec<Equation>,
    /// What joins the ends of periodic splines.
    seam: Option<Seam>,
}

/// A row of the tridiagonal system before it is factorised: what the slopes before, at and after the knot weigh, and the
/// rises over two neighbouring intervals.
struct Condition {
    slopes: [f64; 3],
    rises: [f64; 2],
}

/// A row of the factorised system, divided by its pivot: either substitution is a multiplication and a subtraction a row,
/// for which the next row waits.
#[derive(Clone, Copy, Debug)]
struct Equation {
    /// Weights of the rises over two neighbouring intervals.
    rises: [f64; 2],
    /// How much of the slope before is taken off in the forward substitution.
    lower: f64,
    /// How much of the slope after is taken off in the backward substitution.
    upper: f64,
    /// Inverse of the pivot.
    scale: f64,
}

/// Sherman–Morrison: the cyclic matrix is a tridiagonal one plus u·vᵀ, u = (−2, 0, …, bottom), v = (1, 0, …, last).
#[derive(Clone, Debug)]
struct Seam {
    last: f64,
    /// The tridiagonal system's solution x for u, as x/(1 + vᵀx).
    correction: Vec<f64>,
}

impl Knots {
    /// Knots of splines whose third derivative is continuous at the second knot and the last but one. They reproduce
    /// cubics.
    ///
    /// The caller has checked that n is at least 4 and that the times increase.
    pub(crate) fn not_a_knot(time: Vec<f64>) -> Self {
        let (n, h) = (time.len(), intervals(&time));
        let mut conditions = Vec::with_capacity(n);
        let ([end, next], rises) = end_condition(h[0], h[1]);
        conditions.push(Condition { slopes: [0.0, end, next], rises });
        conditions.extend(h.windows(2).map(|h| inner_condition(h[0], h[1])));
        let ([end, next], [outer, inner]) = end_condition(h[n - 2], h[n - 3]);
        conditions.push(Condition { slopes: [next, end, 0.0], rises: [inner, outer] });
        Self { time, equations: factorise(&conditions), seam: None }
    }

    /// Knots of splines of the given period, t_0 < … < t_{n−1} < t_0 + period.
    ///
    /// The caller has checked that n is at least 3 and that the times increase.
    pub(crate) fn periodic(mut time: Vec<f64>, period: f64) -> Self {
        let n = time.len();
        time.push(time[0] + period);
        let h = intervals(&time);
        let mut conditions: Vec<_> = (0..n).map(|i| inner_condition(h[(i + n - 1) % n], h[i])).collect();
        let (top, bottom) = (conditions[0].slopes[0], conditions[n - 1].slopes[2]);
        conditions[0].slopes[1] += 2.0;
        conditions[n - 1].slopes[1] += top * bottom / 2.0;
        let equations = factorise(&conditions);

        let last = -top / 2.0;
        let mut correction = vec![0.0; n];
        (correction[0], correction[n - 1]) = (-2.0 * equations[0].scale, bottom * equations[n - 1].scale);
        for i in 1..n {
            correction[i] -= equations[i].lower * correction[i - 1];
        }
        substitute_back(&equations, &mut correction);
        let size = 1.0 + correction[0] + last * correction[n - 1];
        correction.iter_mut().for_each(|x| *x /= size);
        Self { time, equations, seam: Some(Seam { last, correction }) }
    }

    /// Number of knots n.
    fn len(&self) -> usize {
        self.equations.len()
    }

    /// Writes the `slopes` (n,) at the knots of the spline through `values` (n,).
    pub(crate) fn slopes<T: Real>(&self, values: &[T], slopes: &mut [T]) {
        let n = self.len();
        let mut before = T::default();
        for (i, Equation { rises: [left, right], lower, .. }) in self.equations.iter().enumerate() {
            let [from, at, to] = match self.seam {
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
        substitute_back(&self.equations, slopes);
        if let Some(Seam { last, correction }) = &self.seam {
            let along = slopes[0] + slopes[n - 1] * *last;
            slopes.iter_mut().zip(correction).for_each(|(slope, x)| *slope = *slope - along * *x);
        }
    }

    /// Writes to `out` (k,) what the spline of such `values` and `slopes` (n,) is worth at `times` (k,), which do not
    /// decrease. At the knots the values come out bit for bit, and beyond them the end cubics continue.
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

    /// The knot `right` and the one before it, the nearer to `t` first: expanded about it, the cubic has its very values
    /// at the knots.
    fn by_distance(&self, t: f64, right: usize) -> [usize; 2] {
        let left = right - 1;
        if t - self.time[left] < self.time[right] - t { [left, right] } else { [right, left] }
    }
}

/// Splines of all DoFs of a movement, over the same knots.
#[derive(Clone, Debug)]
pub(crate) struct Splines {
    knots: Knots,
    n_dofs: usize,
    /// Values and slopes (n,) at the knots, for each group of DoFs.
    groups: Vec<[Vec<Lanes>; 2]>,
}

impl Splines {
    /// Through values (n·D) at the knots, by rows: those of all D DoFs at the first knot, then at the next.
    pub(crate) fn through(knots: Knots, rows: &[f64], n_dofs: usize) -> Self {
        let of = |group| {
            let [mut values, mut slopes] = [(); 2].map(|()| vec![Lanes::ZERO; knots.len()]);
            gather(rows, n_dofs, group, &mut values);
            knots.slopes(&values, &mut slopes);
            [values, slopes]
        };
        let groups = (0..groups(n_dofs)).map(of).collect();
        Self { knots, n_dofs, groups }
    }

    /// Number of DoFs D.
    pub(crate) fn n_dofs(&self) -> usize {
        self.n_dofs
    }

    /// Slopes (n, D) at the knots.
    pub(crate) fn slopes(&self) -> Array2<f64> {
        let mut rows = Array2::zeros((self.knots.len(), self.n_dofs));
        for (group, [_, slopes]) in self.groups.iter().enumerate() {
            scatter(slopes, self.n_dofs, group, rows.as_slice_mut().unwrap_or_default());
        }
        rows
    }

    /// Writes to `rows` (k·D) what the splines are worth at `times` (k), as [`Knots::sample`] does for one DoF.
    pub(crate) fn sample(&self, times: impl Iterator<Item = f64> + Clone, rows: &mut [f64]) {
        let mut sampled = vec![Lanes::ZERO; rows.len() / self.n_dofs];
        for (group, [values, slopes]) in self.groups.iter().enumerate() {
            self.knots.sample(values, slopes, times.clone(), &mut sampled);
            scatter(&sampled, self.n_dofs, group, rows);
        }
    }
}

fn intervals(time: &[f64]) -> Vec<f64> {
    time.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// Continuity of the second derivative between two intervals.
fn inner_condition(left: f64, right: f64) -> Condition {
    let (a, b) = (right / (left + right), left / (left + right));
    Condition { slopes: [a, 2.0, b], rises: [3.0 * a / left, 3.0 * b / right] }
}

/// Continuity of the third derivative between the two intervals at an end, less the condition on the second:
/// weights of the end slope and the next, and of the outer rise and the inner.
fn end_condition(outer: f64, inner: f64) -> ([f64; 2], [f64; 2]) {
    let (a, b) = (inner / (outer + inner), outer / (outer + inner));
    ([a, 1.0], [a * (2.0 + b) / outer, b * b / inner])
}

/// Gauss without exchanging pivots: all of these systems are diagonally dominant, those of the end conditions once the
/// end slope is eliminated.
fn factorise(conditions: &[Condition]) -> Vec<Equation> {
    let mut equations: Vec<Equation> = Vec::with_capacity(conditions.len());
    for &Condition { slopes: [below, diagonal, above], rises } in conditions {
        let eliminated = equations.last().map_or(0.0, |before| below * before.upper);
        let scale = 1.0 / (diagonal - eliminated);
        equations.push(Equation { rises: rises.map(|w| w * scale), lower: below * scale, upper: above * scale, scale });
    }
    equations
}

/// Solves the upper half of the system, in place.
fn substitute_back<T: Real>(equations: &[Equation], slopes: &mut [T]) {
    let mut after = T::default();
    for (slope, equation) in slopes.iter_mut().zip(equations).rev() {
        after = *slope - after * equation.upper;
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

    /// Splines with all that they follow from.
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
            self.splines.sample(times.iter().map(|&t| self.turned(t)), out.as_slice_mut().unwrap());
            out
        }

        /// The derivative of what is sampled, by the formula that heads this file.
        fn sample_slopes(&self, times: &[f64]) -> Array2<f64> {
            Array2::from_shape_fn((times.len(), self.values.ncols()), |(i, d)| {
                let (t, time) = (self.turned(times[i]), &self.splines.knots.time);
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

        fn turned(&self, t: f64) -> f64 {
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
                prop_assert_eq!(spline.sample_slopes(&time), spline.slopes);
            }
        }
    }

    proptest! {
        /// However many DoFs share the knots, in groups that are full or not: to the last bit.
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
