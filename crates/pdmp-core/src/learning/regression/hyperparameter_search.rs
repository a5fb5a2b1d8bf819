//! Maximum of a smooth, expensive function of two variables in a box: a coarse scan, then ascent from its best places.

use std::cmp::Ordering;

use crate::error::Result;

/// Most places from which the ascent starts.
const STARTS: usize = 3;
/// The ascent ends where the next step promises to gain less.
const GAIN: f64 = 1e-5;
/// Most steps of an ascent, and most times that one of them is halved.
const STEPS: usize = 50;
const HALVINGS: usize = 20;

/// The range of one variable.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    /// Points of the scan, ends included; one, the lower end, if the variable is given.
    pub(super) points: usize,
}

impl Axis {
    /// Of a variable that has one value.
    pub(super) fn given(value: f64) -> Self {
        Self { low: value, high: value, points: 1 }
    }

    fn step(&self) -> f64 {
        (self.high - self.low) / (self.points - 1).max(1) as f64
    }
}

/// A value of the function, −∞ where it does not exist, and its gradient.
#[derive(Clone, Copy, Debug)]
pub(super) struct Score {
    pub(super) value: f64,
    pub(super) gradient: [f64; 2],
}

impl Score {
    pub(super) const IMPOSSIBLE: Self = Self { value: f64::NEG_INFINITY, gradient: [0.0; 2] };
}

/// What is to be maximised.
pub(super) trait Objective {
    /// A guess at the value, good enough to find the neighbourhood of a maximum.
    fn glance(&mut self, at: [f64; 2]) -> Result<f64>;

    /// The function and its gradient.
    fn score(&mut self, at: [f64; 2]) -> Result<Score>;
}

/// Where in the box the function is largest.
///
/// The scan avoids local maxima and plateaus, and the ascent never ends below a start: of a flat function the first
/// point is returned.
pub(super) fn maximise(axes: &[Axis; 2], objective: &mut impl Objective) -> Result<[f64; 2]> {
    let [rows, columns] = axes.map(|axis| axis.points);
    let mut scan = Scan { axes, objective };
    let cell = |index: usize| [index / columns, index % columns].map(|k| k as f64);
    let glances: Vec<f64> =
        (0..rows * columns).map(|index| scan.objective.glance(scan.place(cell(index)))).collect::<Result<_>>()?;
    let mut starts: Vec<usize> = (0..glances.len()).filter(|&index| is_summit(&glances, columns, index)).collect();
    starts.sort_by(|&a, &b| glances[b].total_cmp(&glances[a]));
    let mut best: Option<([f64; 2], f64)> = None;
    for &start in starts.iter().take(STARTS) {
        let (at, value) = scan.climb(cell(start))?;
        if best.is_none_or(|(_, most)| value > most) {
            best = Some((at, value));
        }
    }
    Ok(scan.place(best.map_or([0.0; 2], |(at, _)| at)))
}

/// Whether no neighbour of a cell is higher, nor as high and before it; what rounding makes of a plateau is as high.
fn is_summit(values: &[f64], columns: usize, cell: usize) -> bool {
    let (row, column) = ((cell / columns) as isize, (cell % columns) as isize);
    let rows = (values.len() / columns) as isize;
    (-1..=1).flat_map(|i| (-1..=1).map(move |j| (row + i, column + j))).all(|(i, j)| {
        let inside = (0..rows).contains(&i) && (0..columns as isize).contains(&j);
        let other = (i * columns as isize + j) as usize;
        // Nothing is gained between two places where nothing exists.
        let gain = if inside && values[cell] != values[other] { values[cell] - values[other] } else { 0.0 };
        !inside || other == cell || gain > GAIN || (gain >= -GAIN && cell < other)
    })
}

/// The box in cells of the scan, in which the variables weigh alike.
struct Scan<'a, O> {
    axes: &'a [Axis; 2],
    objective: &'a mut O,
}

impl<O: Objective> Scan<'_, O> {
    fn place(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.axes[k].low + at[k] * self.axes[k].step())
    }

    fn score(&mut self, at: [f64; 2]) -> Result<Score> {
        let Score { value, gradient } = self.objective.score(self.place(at))?;
        Ok(Score { value, gradient: [0, 1].map(|k| gradient[k] * self.axes[k].step()) })
    }

    /// The last cell of each axis.
    fn ends(&self) -> [f64; 2] {
        [0, 1].map(|k| (self.axes[k].points - 1) as f64)
    }

    /// Ascent from `start`, never to a point below it: the quasi-Newton method of Broyden, Fletcher, Goldfarb and Shanno
    /// on the variables that are free to move, one cell at a time.
    ///
    /// Nocedal and Wright, Numerical Optimization (2006), Sections 6.1 and 16.7.
    fn climb(&mut self, start: [f64; 2]) -> Result<([f64; 2], f64)> {
        let (mut at, ends) = (start, self.ends());
        let mut here = self.score(at)?;
        let mut curvature: Option<Curvature> = None;
        for _ in 0..STEPS {
            let g = here.gradient;
            let free = [0, 1].map(|k| if g[k] > 0.0 { at[k] < ends[k] } else { g[k] < 0.0 && at[k] > 0.0 });
            let most = |v: [f64; 2]| (0..2).filter(|&k| free[k]).map(|k| v[k].abs()).fold(0.0, f64::max);
            let mut step = match &curvature {
                Some(curvature) => curvature.step(g, free),
                // Half a cell, along the gradient.
                None => [0, 1].map(|k| if free[k] { 0.5 * g[k] / most(g) } else { 0.0 }),
            };
            let cells = most(step).max(1.0);
            step = step.map(|s| s / cells);
            if (step[0] * g[0] + step[1] * g[1]).partial_cmp(&GAIN) != Some(Ordering::Greater) {
                break;
            }
            let Some((next, there)) = self.advance(at, here, step)? else { break };
            let moved = [0, 1].map(|k| next[k] - at[k]);
            let bent = [0, 1].map(|k| g[k] - there.gradient[k]);
            curvature = Curvature::updated(curvature, moved, bent);
            (at, here) = (next, there);
        }
        Ok((at, here.value))
    }

    /// The first point along a step, clamped to the box and halved until it pays, if there is one.
    fn advance(&mut self, at: [f64; 2], here: Score, mut step: [f64; 2]) -> Result<Option<([f64; 2], Score)>> {
        let ends = self.ends();
        for _ in 0..HALVINGS {
            let next = [0, 1].map(|k| (at[k] + step[k]).clamp(0.0, ends[k]));
            let promised: f64 = (0..2).map(|k| here.gradient[k] * (next[k] - at[k])).sum();
            let there = self.score(next)?;
            if there.value > here.value && there.value >= here.value + 1e-4 * promised {
                return Ok(Some((next, there)));
            }
            step = step.map(|s| 0.5 * s);
        }
        Ok(None)
    }
}

/// Estimate of minus the second derivatives, positive definite.
#[derive(Clone, Copy)]
struct Curvature {
    first: f64,
    mixed: f64,
    second: f64,
}

impl Curvature {
    /// To the top of the parabola, as far as the variables are free.
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

    /// Learns that the gradient fell by `bent` over a step. Where it rose, the function is not yet a hill, and nothing
    /// is learnt.
    ///
    /// Not inlined, and entry by entry: inlined, the optimiser of Rust 1.95 was seen to square bent₁ in place of bent₀·bent₁,
    /// and the ascent ended where the estimate was no longer positive definite.
    #[inline(never)]
    fn updated(old: Option<Self>, moved: [f64; 2], bent: [f64; 2]) -> Option<Self> {
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let fall = dot(moved, bent);
        let least = 1e-8 * (dot(moved, moved) * dot(bent, bent)).sqrt();
        if fall.partial_cmp(&least) != Some(Ordering::Greater) {
            return None;
        }
        let scale = dot(bent, bent) / fall;
        let b = old.unwrap_or(Self { first: scale, mixed: 0.0, second: scale });
        let lost = [b.first * moved[0] + b.mixed * moved[1], b.mixed * moved[0] + b.second * moved[1]];
        let share = dot(moved, lost);
        let first = b.first - lost[0] * (lost[0] / share) + bent[0] * (bent[0] / fall);
        let second = b.second - lost[1] * (lost[1] / share) + bent[1] * (bent[1] / fall);
        let mixed = b.mixed - lost[0] * (lost[1] / share) + bent[0] * (bent[1] / fall);
        Some(Self { first, mixed, second })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use approx::assert_abs_diff_eq;

    struct Hill<F>(F);

    impl<F: FnMut([f64; 2]) -> Result<Score>> Objective for Hill<F> {
        fn glance(&mut self, at: [f64; 2]) -> Result<f64> {
            Ok((self.0)(at)?.value)
        }

        fn score(&mut self, at: [f64; 2]) -> Result<Score> {
            (self.0)(at)
        }
    }

    #[test]
    fn curvature_explains_the_last_step() {
        let mut curvature = None;
        for (moved, bent) in
            [([0.5, 0.28], [17.0, 27.6]), ([-0.15, -0.21], [-10.7, -19.1]), ([0.13, -0.05], [3.3, -0.9])]
        {
            curvature = Curvature::updated(curvature, moved, bent);
            let Curvature { first, mixed, second } = curvature.unwrap();
            assert_abs_diff_eq!(first * moved[0] + mixed * moved[1], bent[0], epsilon = 1e-9);
            assert_abs_diff_eq!(mixed * moved[0] + second * moved[1], bent[1], epsilon = 1e-9);
            assert!(first > 0.0 && first * second > mixed * mixed);
        }
    }

    const SQUARE: [Axis; 2] = [Axis { low: -4.0, high: 4.0, points: 6 }, Axis { low: -10.0, high: 0.0, points: 6 }];

    fn top(f: impl Fn([f64; 2]) -> (f64, [f64; 2])) -> [f64; 2] {
        let score = |at| {
            let (value, gradient) = f(at);
            Ok(Score { value, gradient })
        };
        maximise(&SQUARE, &mut Hill(score)).unwrap()
    }

    #[test]
    fn finds_the_top_of_a_slanting_ridge() {
        let top = top(|[x, y]| {
            let across = y + 5.0 * x - 0.3;
            (-(x - 0.7).powi(2) - 30.0 * across * across, [-2.0 * (x - 0.7) - 300.0 * across, -60.0 * across])
        });
        assert_abs_diff_eq!(top[0], 0.7, epsilon = 0.05);
        assert_abs_diff_eq!(top[1], -3.2, epsilon = 0.25);
    }

    #[test]
    fn finds_the_top_on_an_edge_and_in_a_corner() {
        let edge = top(|[x, y]| (y - (x - 1.1).powi(2), [-2.0 * (x - 1.1), 1.0]));
        assert_abs_diff_eq!(edge[0], 1.1, epsilon = 0.05);
        assert_eq!(edge[1], 0.0);
        assert_eq!(top(|[x, y]| (x - y, [1.0, -1.0])), [4.0, -10.0]);
    }

    #[test]
    fn crosses_a_plateau_and_avoids_where_the_function_does_not_exist() {
        let found = top(|[x, _]| {
            let bell = 100.0 * (-9.0 * (x - 3.0).powi(2)).exp();
            if x < 0.0 { (f64::NEG_INFINITY, [0.0; 2]) } else { (bell, [-18.0 * (x - 3.0) * bell, 0.0]) }
        });
        assert_abs_diff_eq!(found[0], 3.0, epsilon = 0.01);
    }

    #[test]
    fn the_higher_of_two_tops_is_found_though_the_scan_prefers_the_other() {
        let found = top(|[x, y]| {
            // Cells of the scan lie at ±0.8, ±2.4, ±4: the top at −1.6 is between them.
            let bell = |centre: f64, height: f64, width: f64| {
                let e = height * (-((x - centre) / width).powi(2)).exp();
                (e, -2.0 * (x - centre) / (width * width) * e)
            };
            let ((a, da), (b, db)) = (bell(2.4, 10.0, 0.5), bell(-1.6, 20.0, 0.8));
            (a + b - 0.01 * y * y, [da + db, -0.02 * y])
        });
        assert_abs_diff_eq!(found[0], -1.6, epsilon = 0.01);
    }

    #[test]
    fn given_variables_stay() {
        let axes = [SQUARE[0], Axis::given(7.0)];
        let score = |[x, y]: [f64; 2]| Ok(Score { value: -x * x + y, gradient: [-2.0 * x, 1.0] });
        let top = maximise(&axes, &mut Hill(score)).unwrap();
        assert_abs_diff_eq!(top[0], 0.0, epsilon = 0.05);
        assert_eq!(top[1], 7.0);
    }

    #[test]
    fn stays_in_the_box_and_ends_on_any_function() {
        // Flat, without a value, and with a gradient that lies.
        for (constant, slope) in [(0.0, 0.0), (f64::NEG_INFINITY, 0.0), (1.0, 1e9), (1.0, f64::NAN)] {
            let mut n = 0;
            let score = |at: [f64; 2]| {
                n += 1;
                assert!((-4.0..=4.0).contains(&at[0]) && (-10.0..=0.0).contains(&at[1]));
                Ok(Score { value: constant, gradient: [slope; 2] })
            };
            assert_eq!(maximise(&SQUARE, &mut Hill(score)).unwrap(), [-4.0, -10.0]);
            assert!(n < 100);
        }
    }

    #[test]
    fn hands_an_interruption_on() {
        let mut stopped = Hill(|_| Err(Error::Interrupted));
        assert!(matches!(maximise(&SQUARE, &mut stopped), Err(Error::Interrupted)));
    }
}
