//! Onsets of the cycles of a recording, by template matching.
//!
//! The onset of a cycle is searched about one period after the previous onset, where a periodic template of one cycle
//! agrees best with the recording: by the mean over all traits of Pearson's correlation within half a period on either
//! side, weighted by a Hann window. The first template is the first cycle. The second template, which gives the final
//! onsets, is the mean cycle, shifted to the phase of the nominal recording by circular cross-correlation with its mean
//! cycle.

use std::f64::consts::TAU;

use ndarray::{Array2, ArrayView1, ArrayView2, Axis, s};

use super::periodicity::vertex;

/// Search range about the expected onset, in periods.
const SEARCH_RANGE: f64 = 0.25;

/// Distance outside of the recording within which an onset counts as one at its end, in samples.
const END_TOLERANCE: f64 = 1.0;

/// Search for the cycles of a recording with traits (n, F) and a period in samples.
pub(super) struct CycleSearch<'a> {
    pub(super) traits: ArrayView2<'a, f64>,
    pub(super) period: f64,
}

impl CycleSearch<'_> {
    /// Returns the bounds of successive cycles in samples, and their mean cycle (W, F). The cycles are in phase with
    /// `nominal` (W₀, F), or begin at the first sample.
    pub(super) fn bounds(&self, nominal: Option<&Array2<f64>>) -> (Vec<f64>, Array2<f64>) {
        let width = self.period.round() as usize;
        let first = self.search(self.traits.slice(s![..width, ..]), 0.0);
        let mean = self.mean(&first, width);
        let shift = nominal.map_or(0.0, |nominal| phase_shift(nominal.view(), mean.view()));
        let template = shifted(mean.view(), shift, width);
        let bounds = self.search(template.view(), shift * self.period / width as f64);
        let mean = self.mean(&bounds, width);
        (bounds, mean)
    }

    /// Returns the onsets of cycles that match the template (W, F), searched about `from` and each period after an onset.
    fn search(&self, template: ArrayView2<f64>, from: f64) -> Vec<f64> {
        let end = (self.traits.nrows() - 1) as f64;
        let (mut onsets, mut expected) = (Vec::new(), from);
        loop {
            let onset = self.locate(template, expected);
            if onset > end + END_TOLERANCE {
                return onsets;
            }
            if onset >= -END_TOLERANCE {
                onsets.push(onset.clamp(0.0, end));
            }
            expected = onset + self.period;
        }
    }

    /// Returns the onset near `expected` at which the template agrees best, to a fraction of a sample.
    fn locate(&self, template: ArrayView2<f64>, expected: f64) -> f64 {
        let range = (SEARCH_RANGE * self.period).max(1.0);
        let from = (expected - range).ceil() as isize;
        let scores: Vec<f64> = (from..=(expected + range) as isize).map(|onset| self.score(template, onset)).collect();
        let best = (0..scores.len()).max_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0);
        if best == 0 || best + 1 == scores.len() {
            // Without a maximum inside the range the period continues unchanged.
            return expected;
        }
        from as f64 + vertex(best, [scores[best - 1], scores[best], scores[best + 1]]).0
    }

    /// Returns the sum over traits of the weighted correlation between the template and the recording for an onset.
    fn score(&self, template: ArrayView2<f64>, onset: isize) -> f64 {
        let (width, n_traits) = template.dim();
        let half = (width / 2) as isize;
        // For each trait the weighted Σa, Σb, Σa², Σb² and Σab.
        let (mut n, mut sums) = (0.0, vec![[0.0; 5]; n_traits]);
        for j in -half..width as isize - half {
            let Some(row) = usize::try_from(onset + j).ok().filter(|&row| row < self.traits.nrows()) else { continue };
            // Hann window about the onset.
            let weight = 0.5 + 0.5 * (TAU * j as f64 / width as f64).cos();
            n += weight;
            let pattern = template.row(j.rem_euclid(width as isize) as usize);
            for (sums, (a, b)) in sums.iter_mut().zip(pattern.iter().zip(self.traits.row(row))) {
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

    /// Returns the mean (W, F) of the cycles between successive bounds at `width` phases, by linear interpolation.
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

/// Returns the cycle (W, F), circularly shifted to begin at sample `shift`, at `width` phases.
fn shifted(cycle: ArrayView2<f64>, shift: f64, width: usize) -> Array2<f64> {
    let n = cycle.nrows();
    Array2::from_shape_fn((width, cycle.ncols()), |(c, f)| {
        let at = (shift + c as f64 * n as f64 / width as f64).rem_euclid(n as f64);
        let (before, share) = (at as usize % n, at.fract());
        cycle[[before, f]] * (1.0 - share) + cycle[[(before + 1) % n, f]] * share
    })
}

/// Returns the sample at which `cycle` (W, F) is in the phase in which `nominal` (W₀, F) begins, by circular
/// cross-correlation.
fn phase_shift(nominal: ArrayView2<f64>, cycle: ArrayView2<f64>) -> f64 {
    let n = cycle.nrows();
    let nominal = shifted(nominal, 0.0, n);
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
