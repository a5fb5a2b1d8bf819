//! Maximisation of a smooth, expensive function of two variables in a box: a coarse scan, then quasi-Newton ascent from
//! its best points.

use std::cmp::Ordering;

use crate::error::Result;

/// Largest number of scan points from which an ascent starts.
const MAX_STARTS: usize = 3;
/// Predicted gain below which an ascent ends.
const MIN_GAIN: f64 = 1e-5;
/// Largest number of steps of an ascent.
const MAX_STEPS: usize = 50;
/// Largest number of halvings of one step.
const MAX_HALVINGS: usize = 20;

/// Range of one variable.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    /// Points of the scan, both ends included; a fixed variable has one, the lower end.
    pub(super) points: usize,
}

impl Axis {
    /// Returns the axis of a variable with a fixed value.
    pub(super) fn fixed(value: f64) -> Self {
        Self { low: value, high: value, points: 1 }
    }

    fn step(&self) -> f64 {
        (self.high - self.low) / (self.points - 1).max(1) as f64
    }
}

/// Value of the function, −∞ where it is undefined, and its gradient.
#[derive(Clone, Copy, Debug)]
pub(super) struct Score {
    pub(super) value: f64,
    pub(super) gradient: [f64; 2],
}

impl Score {
    pub(super) const INFEASIBLE: Self = Self { value: f64::NEG_INFINITY, gradient: [0.0; 2] };
}

/// Function to maximise.
pub(super) trait Objective {
    /// Returns an approximate value that suffices to locate the neighbourhood of a maximum.
    fn estimate(&mut self, at: [f64; 2]) -> Result<f64>;

    /// Returns the value and the gradient.
    fn score(&mut self, at: [f64; 2]) -> Result<Score>;
}

/// Returns the point of the box where the function is largest.
///
/// The scan avoids local maxima and plateaus. An ascent never ends below its start; for a constant function the first
/// point is returned.
pub(super) fn maximise(axes: &[Axis; 2], objective: &mut impl Objective) -> Result<[f64; 2]> {
    let [rows, columns] = axes.map(|axis| axis.points);
    let mut scan = Scan { axes, objective };
    let cell = |index: usize| [index / columns, index % columns].map(|k| k as f64);
    let estimates: Vec<f64> =
        (0..rows * columns).map(|index| scan.objective.estimate(scan.point(cell(index)))).collect::<Result<_>>()?;
    let mut starts: Vec<usize> =
        (0..estimates.len()).filter(|&index| is_local_maximum(&estimates, columns, index)).collect();
    starts.sort_by(|&a, &b| estimates[b].total_cmp(&estimates[a]));
    let mut best: Option<([f64; 2], f64)> = None;
    for &start in starts.iter().take(MAX_STARTS) {
        let (at, value) = scan.ascend(cell(start))?;
        if best.is_none_or(|(_, most)| value > most) {
            best = Some((at, value));
        }
    }
    Ok(scan.point(best.map_or([0.0; 2], |(at, _)| at)))
}

/// Returns true if no neighbour of a cell is higher, and none that precedes it is as high within [`MIN_GAIN`].
fn is_local_maximum(values: &[f64], columns: usize, cell: usize) -> bool {
    let (row, column) = ((cell / columns) as isize, (cell % columns) as isize);
    let rows = (values.len() / columns) as isize;
    (-1..=1).flat_map(|i| (-1..=1).map(move |j| (row + i, column + j))).all(|(i, j)| {
        let inside = (0..rows).contains(&i) && (0..columns as isize).contains(&j);
        let other = (i * columns as isize + j) as usize;
        // Two infeasible points are equal: −∞ − (−∞) is not a number.
        let gain = if inside && values[cell] != values[other] { values[cell] - values[other] } else { 0.0 };
        !inside || other == cell || gain > MIN_GAIN || (gain >= -MIN_GAIN && cell < other)
    })
}

/// Box in units of the scan's cells, in which both variables have comparable scales.
struct Scan<'a, O> {
    axes: &'a [Axis; 2],
    objective: &'a mut O,
}

impl<O: Objective> Scan<'_, O> {
    fn point(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.axes[k].low + at[k] * self.axes[k].step())
    }

    fn score(&mut self, at: [f64; 2]) -> Result<Score> {
        let Score { value, gradient } = self.objective.score(self.point(at))?;
        Ok(Score { value, gradient: [0, 1].map(|k| gradient[k] * self.axes[k].step()) })
    }

    /// Returns the last cell of each axis.
    fn ends(&self) -> [f64; 2] {
        [0, 1].map(|k| (self.axes[k].points - 1) as f64)
    }

    /// Ascends from `start` by the BFGS method, projected to the box, by at most one cell a step.
    ///
    /// Nocedal and Wright, Numerical Optimization (2006), Sections 6.1 and 16.7.
    fn ascend(&mut self, start: [f64; 2]) -> Result<([f64; 2], f64)> {
        let (mut at, ends) = (start, self.ends());
        let mut here = self.score(at)?;
        let mut hessian: Option<NegativeHessian> = None;
        for _ in 0..MAX_STEPS {
            let g = here.gradient;
            let free = [0, 1].map(|k| if g[k] > 0.0 { at[k] < ends[k] } else { g[k] < 0.0 && at[k] > 0.0 });
            let largest = |v: [f64; 2]| (0..2).filter(|&k| free[k]).map(|k| v[k].abs()).fold(0.0, f64::max);
            let mut step = match &hessian {
                Some(hessian) => hessian.step(g, free),
                // Half a cell along the gradient.
                None => [0, 1].map(|k| if free[k] { 0.5 * g[k] / largest(g) } else { 0.0 }),
            };
            let cells = largest(step).max(1.0);
            step = step.map(|s| s / cells);
            if (step[0] * g[0] + step[1] * g[1]).partial_cmp(&MIN_GAIN) != Some(Ordering::Greater) {
                break;
            }
            let Some((next, there)) = self.line_search(at, here, step)? else { break };
            let moved = [0, 1].map(|k| next[k] - at[k]);
            let gradient_drop = [0, 1].map(|k| g[k] - there.gradient[k]);
            hessian = NegativeHessian::updated(hessian, moved, gradient_drop);
            (at, here) = (next, there);
        }
        Ok((at, here.value))
    }

    /// Returns the first point along a step, clamped to the box and halved, that gains enough (Armijo's condition).
    fn line_search(&mut self, at: [f64; 2], here: Score, mut step: [f64; 2]) -> Result<Option<([f64; 2], Score)>> {
        let ends = self.ends();
        for _ in 0..MAX_HALVINGS {
            let next = [0, 1].map(|k| (at[k] + step[k]).clamp(0.0, ends[k]));
            let predicted: f64 = (0..2).map(|k| here.gradient[k] * (next[k] - at[k])).sum();
            let there = self.score(next)?;
            if there.value > here.value && there.value >= here.value + 1e-4 * predicted {
                return Ok(Some((next, there)));
            }
            step = step.map(|s| 0.5 * s);
        }
        Ok(None)
    }
}

/// Estimate of the negative Hessian, positive definite.
#[derive(Clone, Copy)]
struct NegativeHessian {
    first: f64,
    mixed: f64,
    second: f64,
}

impl NegativeHessian {
    /// Returns the Newton step in the variables that are free to move.
    fn step(&self, g: [f64; 2], free: [bool; 2]) -> [f64; 2] {
        let Self { first, mixed, second } = *self;
        match free {
            [true, true] => {
                let determinant = first * second - mixed * mixed;
                [(second * g[0] - mixed * g[1]) / determinant, (first * g[1] - mixed * g[0]) / determinant]
            }
            [true, false] => [g[0] / first, 0.0],
            [false, true] => [0.0, g[1] / second],
            [false, false] => [0.0, 0.0],
        }
    }

    /// Returns the BFGS update after a step `s` over which the gradient dropped by `d`; none where it did not drop, as
    /// the function is not concave there.
    ///
    /// Not inlined, and entry by entry: inlined, the optimiser of Rust 1.95 was seen to square d₁ in place of d₀·d₁, and
    /// the ascent ended where the estimate was no longer positive definite.
    #[inline(never)]
    fn updated(old: Option<Self>, s: [f64; 2], d: [f64; 2]) -> Option<Self> {
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let curvature = dot(s, d);
        let least = 1e-8 * (dot(s, s) * dot(d, d)).sqrt();
        if curvature.partial_cmp(&least) != Some(Ordering::Greater) {
            return None;
        }
        let scale = dot(d, d) / curvature;
        let b = old.unwrap_or(Self { first: scale, mixed: 0.0, second: scale });
        let bs = [b.first * s[0] + b.mixed * s[1], b.mixed * s[0] + b.second * s[1]];
        let sbs = dot(s, bs);
        let first = b.first - bs[0] * (bs[0] / sbs) + d[0] * (d[0] / curvature);
        let second = b.second - bs[1] * (bs[1] / sbs) + d[1] * (d[1] / curvature);
        let mixed = b.mixed - bs[0] * (bs[1] / sbs) + d[0] * (d[1] / curvature);
        Some(Self { first, mixed, second })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use approx::assert_abs_diff_eq;

    struct Function<F>(F);

    impl<F: FnMut([f64; 2]) -> Result<Score>> Objective for Function<F> {
        fn estimate(&mut self, at: [f64; 2]) -> Result<f64> {
            Ok((self.0)(at)?.value)
        }

        fn score(&mut self, at: [f64; 2]) -> Result<Score> {
            (self.0)(at)
        }
    }

    #[test]
    fn updated_hessian_satisfies_the_secant_equation() {
        let mut hessian = None;
        for (step, drop) in
            [([0.5, 0.28], [17.0, 27.6]), ([-0.15, -0.21], [-10.7, -19.1]), ([0.13, -0.05], [3.3, -0.9])]
        {
            hessian = NegativeHessian::updated(hessian, step, drop);
            let NegativeHessian { first, mixed, second } = hessian.unwrap();
            assert_abs_diff_eq!(first * step[0] + mixed * step[1], drop[0], epsilon = 1e-9);
            assert_abs_diff_eq!(mixed * step[0] + second * step[1], drop[1], epsilon = 1e-9);
            assert!(first > 0.0 && first * second > mixed * mixed);
        }
    }

    const SQUARE: [Axis; 2] = [Axis { low: -4.0, high: 4.0, points: 6 }, Axis { low: -10.0, high: 0.0, points: 6 }];

    fn maximum(f: impl Fn([f64; 2]) -> (f64, [f64; 2])) -> [f64; 2] {
        let score = |at| {
            let (value, gradient) = f(at);
            Ok(Score { value, gradient })
        };
        maximise(&SQUARE, &mut Function(score)).unwrap()
    }

    #[test]
    fn the_maximum_of_a_slanting_ridge_is_found() {
        let found = maximum(|[x, y]| {
            let across = y + 5.0 * x - 0.3;
            (-(x - 0.7).powi(2) - 30.0 * across * across, [-2.0 * (x - 0.7) - 300.0 * across, -60.0 * across])
        });
        assert_abs_diff_eq!(found[0], 0.7, epsilon = 0.05);
        assert_abs_diff_eq!(found[1], -3.2, epsilon = 0.25);
    }

    #[test]
    fn maxima_on_an_edge_and_in_a_corner_are_found() {
        let edge = maximum(|[x, y]| (y - (x - 1.1).powi(2), [-2.0 * (x - 1.1), 1.0]));
        assert_abs_diff_eq!(edge[0], 1.1, epsilon = 0.05);
        assert_eq!(edge[1], 0.0);
        assert_eq!(maximum(|[x, y]| (x - y, [1.0, -1.0])), [4.0, -10.0]);
    }

    #[test]
    fn a_maximum_beyond_a_plateau_and_an_infeasible_region_is_found() {
        let found = maximum(|[x, _]| {
            let bump = 100.0 * (-9.0 * (x - 3.0).powi(2)).exp();
            if x < 0.0 { (f64::NEG_INFINITY, [0.0; 2]) } else { (bump, [-18.0 * (x - 3.0) * bump, 0.0]) }
        });
        assert_abs_diff_eq!(found[0], 3.0, epsilon = 0.01);
    }

    #[test]
    fn the_higher_of_two_maxima_is_found_though_the_scan_prefers_the_other() {
        let found = maximum(|[x, y]| {
            // Cells of the scan lie at ±0.8, ±2.4, ±4: the maximum at −1.6 lies between them.
            let bump = |centre: f64, height: f64, width: f64| {
                let e = height * (-((x - centre) / width).powi(2)).exp();
                (e, -2.0 * (x - centre) / (width * width) * e)
            };
            let ((a, da), (b, db)) = (bump(2.4, 10.0, 0.5), bump(-1.6, 20.0, 0.8));
            (a + b - 0.01 * y * y, [da + db, -0.02 * y])
        });
        assert_abs_diff_eq!(found[0], -1.6, epsilon = 0.01);
    }

    #[test]
    fn fixed_variables_keep_their_value() {
        let axes = [SQUARE[0], Axis::fixed(7.0)];
        let score = |[x, y]: [f64; 2]| Ok(Score { value: -x * x + y, gradient: [-2.0 * x, 1.0] });
        let found = maximise(&axes, &mut Function(score)).unwrap();
        assert_abs_diff_eq!(found[0], 0.0, epsilon = 0.05);
        assert_eq!(found[1], 7.0);
    }

    #[test]
    fn the_search_stays_in_the_box_and_ends_for_any_function() {
        // Constant, infeasible everywhere, and with a wrong gradient.
        for (constant, slope) in [(0.0, 0.0), (f64::NEG_INFINITY, 0.0), (1.0, 1e9), (1.0, f64::NAN)] {
            let mut n = 0;
            let score = |at: [f64; 2]| {
                n += 1;
                assert!((-4.0..=4.0).contains(&at[0]) && (-10.0..=0.0).contains(&at[1]));
                Ok(Score { value: constant, gradient: [slope; 2] })
            };
            assert_eq!(maximise(&SQUARE, &mut Function(score)).unwrap(), [-4.0, -10.0]);
            assert!(n < 100);
        }
    }

    #[test]
    fn an_interruption_is_returned() {
        let mut stopped = Function(|_| Err(Error::Interrupted));
        assert!(matches!(maximise(&SQUARE, &mut stopped), Err(Error::Interrupted)));
    }
}
