//! Elastic time warp of a demonstration to a template, by dynamic programming.
//!
//! Movements are compared by their square-root velocity functions q = ẏ/√|ẏ|, scaled to unit norm. A warp γ of time maps
//! q to (q∘γ)√γ̇, which preserves the norm, so that differences cannot be hidden by compressing a part of a movement:
//!
//! ```text
//! E(γ) = ∫ |q₀ − (q∘γ)√γ̇|² + λ ln²γ̇ dp = 2 − 2∫ q₀·(q∘γ)√γ̇ dp + λ∫ ln²γ̇ dp
//! ```
//!
//! γ is linear in each segment of the phase, with segment ends on a grid of the demonstration's time. The search returns
//! the global optimum among all such warps with bounded slopes, because the cost of a segment depends only on its start
//! and slope. The penalty keeps noise from warping time; a demonstration equal to the template is not warped.
//!
//! - A. Srivastava, E. Klassen, S. H. Joshi, I. H. Jermyn, Shape analysis of elastic curves in Euclidean spaces, IEEE
//!   TPAMI 33, 2011, doi:10.1109/TPAMI.2010.184 (the cost, and the mean of aligned functions as the template);
//! - N.-P. V. Nielsen, J. M. Carstensen, J. Smedsgaard, Aligning of single and multiple wavelength chromatographic
//!   profiles for chemometric data analysis using correlation optimised warping, Journal of Chromatography A 805, 1998,
//!   doi:10.1016/S0021-9673(98)00021-1 (the search).

use ndarray::{Array2, Axis};

use super::{Aligned, WarpingFunction};
use crate::error::Result;
use crate::model::template::{STEPS, TimeWarp, WarpTemplate};
use crate::numerics::statistics::range;
use crate::numerics::threads::Threads;
use crate::validate::{row_major, row_major_mut, zeros};

/// Largest number of segments; the search then takes some 160 MB per thread, and grows with the square of the number.
const MAX_SEGMENTS: usize = 1000;
/// Weight λ of the warp penalty.
const PENALTY: f64 = 0.05;

impl Aligned<'_> {
    /// Warps the time of all demonstrations to that of the nominal one, and returns the template.
    ///
    /// The first pass aligns to the shape of the nominal demonstration, the second to the mean of the aligned shapes.
    ///
    /// # Errors
    /// Settings out of range, too little memory, or the error that `progress` returned.
    pub(super) fn warp(
        &mut self,
        warp: &TimeWarp,
        unit: Option<&[f64]>,
        threads: Threads,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<WarpTemplate> {
        warp.check(self.max_segments())?;
        let (n_demos, n_dofs) = (self.n_demos(), self.demo(0).n_dofs());
        let unit = unit.map_or_else(|| ranges(self), <[f64]>::to_vec);
        let search = Search::new(warp.n_segments, warp.max_slope, n_dofs);
        let mut shapes: Array2<f64> = zeros("warp", (n_demos, search.cells() * n_dofs))?;
        let mut paths = Array2::from_elem((n_demos, warp.n_segments), STEPS);

        let aligned: &Self = self;
        threads.try_for_each_with_progress(
            shapes.axis_iter_mut(Axis(0)).enumerate().collect(),
            || (),
            |(), (m, mut shape)| {
                aligned.shape(m, &unit, row_major_mut(&mut shape));
                Ok(())
            },
            &mut |share| progress(share / 3.0),
        )?;
        let nominal = self.nominal;
        let mut template = shapes.row(nominal).to_vec();
        for pass in 1..=2 {
            let rows = shapes.rows().into_iter().zip(paths.rows_mut()).enumerate();
            threads.try_for_each_with_progress(
                rows.filter(|(m, _)| *m != nominal).map(|(_, rows)| rows).collect(),
                || Scratch::new(&search),
                |scratch, (shape, mut path)| {
                    search.run(&template, row_major(&shape), row_major_mut(&mut path), scratch);
                    Ok(())
                },
                &mut |share| progress((f64::from(pass) + share) / 3.0),
            )?;
            if pass == 1 {
                template = search.mean(&shapes, &paths);
            }
        }

        self.breaks = search.breaks();
        let seconds = self.durations();
        self.segment_durations = Array2::from_shape_fn(paths.dim(), |(m, k)| search.seconds(paths[[m, k]], seconds[m]));
        for (m, (path, segment_durations)) in paths.rows().into_iter().zip(self.segment_durations.rows()).enumerate() {
            let warped = path.iter().any(|&steps| steps != STEPS);
            self.warps[m] = warped.then(|| WarpingFunction::new(self.kind, &self.breaks, &segment_durations.to_vec()));
        }
        let shape = Array2::from_shape_vec((search.cells(), n_dofs), template)
            .expect("a template has one row per cell and one column per DoF");
        Ok(WarpTemplate { slope: warp.max_slope, unit, shape })
    }

    /// Returns the largest number of segments, half the smallest number of samples.
    pub(super) fn max_segments(&self) -> usize {
        let fewest = self.demos.iter().map(|demo| demo.n_samples()).min().unwrap_or(0).min(self.n_samples);
        (fewest / 2).min(MAX_SEGMENTS)
    }

    /// Warps the only demonstration to a template.
    pub(crate) fn warp_to(&mut self, template: &WarpTemplate) {
        let (cells, n_dofs) = template.shape.dim();
        let search = Search::new(cells / STEPS, template.slope, n_dofs);
        let (mut shape, mut path) = (vec![0.0; cells * n_dofs], vec![STEPS; search.segments]);
        self.shape(0, &template.unit, &mut shape);
        let onto = row_major(&template.shape);
        search.run(onto, &shape, &mut path, &mut Scratch::new(&search));
        let segment_durations: Vec<f64> =
            path.iter().map(|&steps| search.seconds(steps, self.clocks[0].duration)).collect();
        self.warps[0] = Some(WarpingFunction::new(self.kind, &search.breaks(), &segment_durations));
    }

    /// Writes the square-root velocities (N·D) of demonstration `m` in N equal cells of its time, with unit norm.
    fn shape(&self, m: usize, unit: &[f64], shape: &mut [f64]) {
        let n_dofs = unit.len();
        let cells = shape.len() / n_dofs;
        let mut edges = vec![0.0; shape.len() + n_dofs];
        let extent = self.clocks[m].extent;
        self.read(m, (0..=cells).map(|j| extent * (j as f64 / cells as f64)), &mut edges);
        for (i, difference) in shape.iter_mut().enumerate() {
            *difference = (edges[i + n_dofs] - edges[i]) / unit[i % n_dofs];
        }
        // Division by the largest magnitude prevents overflow and underflow of the squares.
        let largest = shape.iter().fold(0.0f64, |most, difference| most.max(difference.abs()));
        if largest > 0.0 {
            shape.iter_mut().for_each(|difference| *difference /= largest);
            for velocity in shape.chunks_exact_mut(n_dofs) {
                let speed = norm(velocity);
                let root = if speed > 0.0 { speed.sqrt() } else { 1.0 };
                velocity.iter_mut().for_each(|component| *component /= root);
            }
            normalise(shape, cells);
        }
    }
}

/// Returns the largest peak-to-peak range of each DoF within one demonstration (D,); 1 for a DoF at rest.
fn ranges(aligned: &Aligned) -> Vec<f64> {
    let widest = |d: usize| {
        let widest = aligned.demos.iter().map(|demo| range(demo.position().column(d))).fold(0.0, f64::max);
        if widest > 0.0 { widest } else { 1.0 }
    };
    (0..aligned.demo(0).n_dofs()).map(widest).collect()
}

/// Returns the Euclidean norm.
fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Scales square-root velocities to a mean square of 1, unless all are zero.
fn normalise(shape: &mut [f64], cells: usize) {
    let size = norm(shape) / (cells as f64).sqrt();
    if size > 0.0 {
        shape.iter_mut().for_each(|q| *q /= size);
    }
}

/// Search space of warps with K segments whose ends lie on a grid of N = 10·K steps of time.
struct Search {
    segments: usize,
    n_dofs: usize,
    slopes: Vec<Slope>,
}

/// Admissible slope of a segment.
struct Slope {
    /// Steps of time that the segment covers.
    steps: usize,
    /// √γ̇/N, weight of the products of shapes.
    weight: f64,
    /// λ ln²γ̇/K.
    penalty: f64,
    /// For each phase cell of the segment, the time cell to interpolate from, counted from the segment's start plus one,
    /// and the fraction towards the next time cell.
    cells: [(usize, f64); STEPS],
}

/// Work space of a search, reused between demonstrations.
struct Scratch {
    /// Products q₀·q of the phase cells of a segment with all time cells, of which the first and last are repeated.
    products: Vec<f64>,
    /// Lowest cost of a path to each segment start and time step, (K+1)·(N+1).
    costs: Vec<f64>,
    /// Index of the slope that leads to it.
    predecessors: Vec<usize>,
    /// Sums of products along a slope for every start.
    sums: Vec<f64>,
}

impl Scratch {
    fn new(search: &Search) -> Self {
        let (cells, nodes) = (search.cells(), (search.segments + 1) * (search.cells() + 1));
        Self {
            products: vec![0.0; STEPS * (cells + 2)],
            costs: vec![0.0; nodes],
            predecessors: vec![0; nodes],
            sums: vec![0.0; cells + 1],
        }
    }
}

impl Search {
    fn new(segments: usize, slope: f64, n_dofs: usize) -> Self {
        // The tolerance includes a bound on the grid despite rounding.
        let fewest_steps = (STEPS as f64 / slope - 1e-9).ceil() as usize;
        let most_steps = (STEPS as f64 * slope + 1e-9).floor() as usize;
        let slopes = (fewest_steps..=most_steps)
            .map(|steps| {
                let slope = steps as f64 / STEPS as f64;
                let cells = std::array::from_fn(|i| {
                    let cell = slope * (i as f64 + 0.5) + 0.5;
                    (cell as usize, cell.fract())
                });
                let (weight, penalty) = (slope.sqrt() / (segments * STEPS) as f64, slope.ln().powi(2));
                Slope { steps, weight, penalty: PENALTY * penalty / segments as f64, cells }
            })
            .collect();
        Self { segments, n_dofs, slopes }
    }

    /// Returns the number of cells N of the time grid.
    fn cells(&self) -> usize {
        self.segments * STEPS
    }

    /// Returns the phases (K+1,) of the segment ends.
    fn breaks(&self) -> Vec<f64> {
        (0..=self.segments).map(|k| k as f64 / self.segments as f64).collect()
    }

    /// Converts steps of the time grid to seconds.
    fn seconds(&self, steps: usize, duration: f64) -> f64 {
        duration * (steps as f64 / self.cells() as f64)
    }

    /// Returns the first and last time step at which segment `k` can start so that the warp ends with the demonstration.
    fn starts(&self, k: usize) -> [usize; 2] {
        let [fewest_steps, most_steps] = [0, self.slopes.len() - 1].map(|i| self.slopes[i].steps);
        let (n, remaining) = (self.cells(), self.segments - k);
        [
            (k * fewest_steps).max(n.saturating_sub(remaining * most_steps)),
            (k * most_steps).min(n - remaining * fewest_steps),
        ]
    }

    /// Writes the steps of time (K,) of each segment of the warp of `shape` with the lowest cost to the `template`.
    fn run(&self, template: &[f64], shape: &[f64], path: &mut [usize], scratch: &mut Scratch) {
        let width = self.cells() + 1;
        scratch.costs.fill(f64::INFINITY);
        scratch.costs[0] = 0.0;
        for (k, template) in template.chunks_exact(STEPS * self.n_dofs).enumerate() {
            self.multiply(template, shape, &mut scratch.products);
            let ([first, last], [first_end, last_end]) = (self.starts(k), self.starts(k + 1));
            let (costs, next) = scratch.costs[k * width..].split_at_mut(width);
            let predecessors = &mut scratch.predecessors[(k + 1) * width..];
            for (index, slope) in self.slopes.iter().enumerate() {
                let start = first.max(first_end.saturating_sub(slope.steps));
                let end = (last + 1).min((last_end + 1).saturating_sub(slope.steps));
                if start >= end {
                    continue;
                }
                let sums = &mut scratch.sums[..end - start];
                sums.fill(0.0);
                for (products, &(cell, share)) in scratch.products.chunks_exact(width + 1).zip(&slope.cells) {
                    let products = &products[start + cell..][..sums.len() + 1];
                    for (sum, pair) in sums.iter_mut().zip(products.windows(2)) {
                        *sum += (1.0 - share) * pair[0] + share * pair[1];
                    }
                }
                let ends = start + slope.steps;
                let nodes = next[ends..].iter_mut().zip(&mut predecessors[ends..]);
                for ((sum, cost_so_far), (lowest, predecessor)) in sums.iter().zip(&costs[start..]).zip(nodes) {
                    let cost = cost_so_far + slope.penalty - 2.0 * slope.weight * sum;
                    if cost < *lowest {
                        (*lowest, *predecessor) = (cost, index);
                    }
                }
            }
        }
        let mut end = self.cells();
        for (k, steps) in path.iter_mut().enumerate().rev() {
            *steps = self.slopes[scratch.predecessors[(k + 1) * width + end]].steps;
            end -= *steps;
        }
    }

    /// Writes the products of the phase cells of a template segment (10·D) with all time cells of a shape (N·D).
    fn multiply(&self, template: &[f64], shape: &[f64], products: &mut [f64]) {
        let cells = self.cells();
        for (phase_cell, products) in template.chunks_exact(self.n_dofs).zip(products.chunks_exact_mut(cells + 2)) {
            for (product, cell) in products[1..].iter_mut().zip(shape.chunks_exact(self.n_dofs)) {
                *product = phase_cell.iter().zip(cell).map(|(a, b)| a * b).sum();
            }
            (products[0], products[cells + 1]) = (products[1], products[cells]);
        }
    }

    /// Returns the mean of the warped shapes (q∘γ)√γ̇, scaled to unit norm.
    fn mean(&self, shapes: &Array2<f64>, paths: &Array2<usize>) -> Vec<f64> {
        let (cells, n_dofs) = (self.cells(), self.n_dofs);
        let mut mean = vec![0.0; cells * n_dofs];
        for (shape, path) in shapes.rows().into_iter().zip(paths.rows()) {
            let mut start = 0;
            for (&steps, mean) in path.iter().zip(mean.chunks_exact_mut(STEPS * n_dofs)) {
                let slope = &self.slopes[steps - self.slopes[0].steps];
                let root = (steps as f64 / STEPS as f64).sqrt();
                for (mean, &(cell, share)) in mean.chunks_exact_mut(n_dofs).zip(&slope.cells) {
                    let [near, far] = [0, 1].map(|next| (start + cell + next).clamp(1, cells) - 1);
                    for (d, mean) in mean.iter_mut().enumerate() {
                        let (near, far) = (shape[near * n_dofs + d], shape[far * n_dofs + d]);
                        *mean += root * ((1.0 - share) * near + share * far);
                    }
                }
                start += steps;
            }
        }
        normalise(&mut mean, cells);
        mean
    }
}
