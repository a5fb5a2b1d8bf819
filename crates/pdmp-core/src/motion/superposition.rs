//! Sums of response curves: the inner loop of a batch.
//!
//! Samples of all DoFs lie side by side, so that every loop runs over one stretch of memory. Each number is summed in the
//! same order wherever it stands: results do not depend on how a batch is divided.

use std::ops::Range;

use ndarray::{ArrayViewMut3, Axis};

use crate::model::responses::{Curves, Derivative};

/// Fewest numbers of a pattern that repeats what each DoF has, and of a tile, after which the next movement is written.
const PATTERN: usize = 64;
const TILE: usize = 1024;

/// Coefficients of a movement y = g + s·R + Δy(0)·E + Δẏ(0)·V.
pub(crate) struct Combination {
    style: Vec<f64>,
    /// What each DoF has, over and over.
    centre: Vec<f64>,
    start: Vec<f64>,
    velocity: Vec<f64>,
}

impl Combination {
    /// Coefficients (J,) of the unit styles, and (D,) of the rest.
    pub(crate) fn new(style: Vec<f64>, centre: &[f64], start: &[f64], velocity: &[f64]) -> Self {
        let pattern = |values: &[f64]| values.repeat(PATTERN.div_ceil(values.len()));
        Self { style, centre: pattern(centre), start: pattern(start), velocity: pattern(velocity) }
    }
}

/// Writes movements (B, T, D) of the given derivative.
pub(crate) fn write(
    combinations: &[Combination],
    curves: &Curves,
    derivative: Derivative,
    mut output: ArrayViewMut3<f64>,
) {
    let Some(period) = combinations.first().map(|first| first.centre.len()) else { return };
    // Derivatives do not know where the centre is.
    let nowhere = vec![0.0; period];
    let (n_dofs, length) = (output.len_of(Axis(2)), curves.start.len());
    let tile = period * (TILE / period).max(1);
    let mut spare = vec![0.0; tile];
    for from in (0..length).step_by(tile) {
        let at = from..(from + tile).min(length);
        let part = Part::new(curves, at.clone());
        for (combination, mut movement) in combinations.iter().zip(output.outer_iter_mut()) {
            let centre = if derivative == Derivative::Position { &combination.centre } else { &nowhere };
            match movement.as_slice_mut() {
                Some(movement) => part.sum(combination, centre, &mut movement[at.clone()]),
                None => {
                    let spare = &mut spare[..at.len()];
                    part.sum(combination, centre, spare);
                    let mut samples = movement.slice_mut(ndarray::s![at.start / n_dofs..at.end / n_dofs, ..]);
                    samples.iter_mut().zip(spare).for_each(|(to, from)| *to = *from);
                }
            }
        }
    }
}

/// The curves over some samples.
struct Part<'a> {
    styles: Vec<&'a [f64]>,
    start: &'a [f64],
    velocity: &'a [f64],
}

impl<'a> Part<'a> {
    fn new(curves: &'a Curves, at: Range<usize>) -> Self {
        let part = |curve: &'a ndarray::Array2<f64>| &curve.as_slice().expect("in the order it was made")[at.clone()];
        Self {
            styles: curves.styles.iter().map(part).collect(),
            start: part(&curves.start),
            velocity: part(&curves.velocity),
        }
    }

    fn sum(&self, by: &Combination, centre: &[f64], out: &mut [f64]) {
        let period = centre.len();
        let rest = self.start.chunks(period).zip(self.velocity.chunks(period));
        for (out, (start, velocity)) in out.chunks_mut(period).zip(rest) {
            let coefficients = centre.iter().zip(&by.start).zip(&by.velocity);
            for (((out, ((g, s), v)), e), w) in out.iter_mut().zip(coefficients).zip(start).zip(velocity) {
                *out = g + s * e + v * w;
            }
        }
        let (styles, fours) = (by.style.chunks(4), self.styles.chunks(4));
        for (s, curves) in styles.zip(fours) {
            match (s, curves) {
                (&[a, b, c, d], [r, s, t, u]) => add([a, b, c, d], [r, s, t, u], out),
                (&[a, b, c], [r, s, t]) => add([a, b, c], [r, s, t], out),
                (&[a, b], [r, s]) => add([a, b], [r, s], out),
                _ => s.iter().zip(curves).for_each(|(&s, curve)| add([s], [curve], out)),
            }
        }
    }
}

/// Adds curves times their coefficients.
#[inline(always)]
fn add<const N: usize>(coefficients: [f64; N], curves: [&[f64]; N], out: &mut [f64]) {
    let curves = curves.map(|curve| &curve[..out.len()]);
    for (i, out) in out.iter_mut().enumerate() {
        *out += (0..N).fold(0.0, |sum, j| sum + coefficients[j] * curves[j][i]);
    }
}
