//! When each cycle of a recording begins.
//!
//! A cycle is looked for about a period after the one before, where a template of one cycle, repeated without end,
//! agrees best with the recording: by the mean over all traits of Pearson's correlation within half a period on either
//! side, weighted by nearness. The first template is the first cycle; the second, by which the bounds are found for good,
//! is the mean of all, turned to the phase of the nominal recording by circular cross-correlation with its mean cycle.

use std::f64::consts::TAU;

use ndarray::{Array2, ArrayView1, ArrayView2, Axis, s};

use super::periodicity::vertex;

/// How far from where it is expected a cycle is looked for, in periods.
const REACH: f64 = 0.25;

/// How far outside the recording a bound is one at its very end, in samples.
const SLACK: f64 = 1.0;

/// A cyclic recording: traits (n, F) and its period in samples.
pub(super) struct Track<'a> {
    pub(super) traits: ArrayView2<'a, f64>,
    pub(super) period: f64,
}

impl Track<'_> {
    /// Bounds of successive cycles, in samples, and their mean (W, F): in phase with `nominal` (W₀, F), or from the first
    /// sample on.
    pub(super) fn bounds(&self, nominal: Option<&Array2<f64>>) -> (Vec<f64>, Array2<f64>) {
        let width = self.period.round() as usize;
        let first = self.search(self.traits.slice(s![..width, ..]), 0.0);
        let mean = self.mean(&first, width);
        let shift = nominal.map_or(0.0, |nominal| shift(nominal.view(), mean.view()));
        let turned = turned(mean.view(), shift, width);
        let bounds = self.search(turned.view(), shift * self.period / width as f64);
        let mean = self.mean(&bounds, width);
        (bounds, mean)
    }

    /// Where cycles such as the template (W, F) begin, about each period after `from`.
    fn search(&self, template: ArrayView2<f64>, from: f64) -> Vec<f64> {
        let end = (self.traits.nrows() - 1) as f64;
        let (mut bounds, mut expected) = (Vec::new(), from);
        loop {
            let found = self.locate(template, expected);
            if found > end + SLACK {
                return bounds;
            }
            if found >= -SLACK {
                bounds.push(found.clamp(0.0, end));
            }
            expected = found + self.period;
        }
    }

    /// Where near `expected` the template agrees best, to a part of a sample.
    fn locate(&self, template: ArrayView2<f64>, expected: f64) -> f64 {
        let reach = (REACH * self.period).max(1.0);
        let from = (expected - reach).ceil() as isize;
        let scores: Vec<f64> = (from..=(expected + reach) as isize).map(|at| self.score(template, at)).collect();
        let best = (0..scores.len()).max_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0);
        if best == 0 || best + 1 == scores.len() {
            // Nothing agrees best within reach: time goes on as it did.
            return expected;
        }
        from as f64 + vertex(best, [scores[best - 1], scores[best], scores[best + 1]]).0
    }

    /// How well the template agrees with the recording if it begins at sample `at`.
    fn score(&self, template: ArrayView2<f64>, at: isize) -> f64 {
        let (width, n_traits) = template.dim();
        let half = (width / 2) as isize;
        // Of each trait: both sums, both sums of squares, and the sum of products.
        let (mut n, mut sums) = (0.0, vec![[0.0; 5]; n_traits]);
        for j in -half..width as isize - half {
            let Some(row) = usize::try_from(at + j).ok().filter(|&row| row < self.traits.nrows()) else { continue };
            // Hann's window: what is near the bound tells most about it.
            let weight = 0.5 + 0.5 * (TAU * j as f64 / width as f64).cos();
            n += weight;
            let pair = template.row(j.rem_euclid(width as isize) as usize);
            for (sums, (a, b)) in sums.iter_mut().zip(pair.iter().zip(self.traits.row(row))) {
                for (sum, x) in sums.iter_mut().zip([*a, *b, a * a, b * b, a * b]) {
                    *sum += weight * x;
                }
            }
        }
        let correlation = |[a, b, aa, bb, ab]: [f64; 5]| {
            let variances = (aa - a * a / n) * (bb - b * b / n);
            if variances > 1e-18 { (ab - a * b / n) / variances.sqrt() } else { 0.0 }
        };
        if n > 0.0 { sums.into_iter().map(correlation).sum() } else { 0.0 }
    }

    /// The mean (W, F) of the cycles between successive bounds, at `width` phases.
    fn mean(&self, bounds: &[f64], width: usize) -> Array2<f64> {
        let mut mean = Array2::zeros((width, self.traits.ncols()));
        for pair in bounds.windows(2) {
            for (c, mut row) in mean.rows_mut().into_iter().enumerate() {
                let at = pair[0] + (pair[1] - pair[0]) * c as f64 / width as f64;
                let (before, share) = (at.floor() as usize, at.fract());
                let after = (before + 1).min(self.traits.nrows() - 1);
                row.scaled_add(1.0 - share, &self.traits.row(before));
                row.scaled_add(share, &self.traits.row(after));
            }
        }
        mean / (bounds.len().max(2) - 1) as f64
    }
}

/// The cycle (W, F) from sample `shift` on, at `width` phases.
fn turned(cycle: ArrayView2<f64>, shift: f64, width: usize) -> Array2<f64> {
    let n = cycle.nrows();
    Array2::from_shape_fn((width, cycle.ncols()), |(c, f)| {
        let at = (shift + c as f64 * n as f64 / width as f64).rem_euclid(n as f64);
        let (before, share) = (at as usize % n, at.fract());
        cycle[[before, f]] * (1.0 - share) + cycle[[(before + 1) % n, f]] * share
    })
}

/// The sample of `cycle` (W, F) at which it is in the phase in which `nominal` (W₀, F) begins.
fn shift(nominal: ArrayView2<f64>, cycle: ArrayView2<f64>) -> f64 {
    let n = cycle.nrows();
    let nominal = turned(nominal, 0.0, n);
    let centred = |column: ArrayView1<f64>| -> Vec<f64> {
        let mean = column.sum() / n as f64;
        column.iter().map(|y| y - mean).collect()
    };
    let mut scores = vec![0.0; n];
    for (a, b) in nominal.axis_iter(Axis(1)).zip(cycle.axis_iter(Axis(1))) {
        let (a, b) = (centred(a), centred(b));
        let size = a.iter().map(|a| a * a).sum::<f64>().sqrt() * b.iter().map(|b| b * b).sum::<f64>().sqrt();
        if size > 1e-9 {
            for (s, score) in scores.iter_mut().enumerate() {
                *score += a.iter().enumerate().map(|(c, a)| a * b[(c + s) % n]).sum::<f64>() / size;
            }
        }
    }
    let best = (0..n).max_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0);
    vertex(best, [scores[(best + n - 1) % n], scores[best], scores[(best + 1) % n]]).0
}
