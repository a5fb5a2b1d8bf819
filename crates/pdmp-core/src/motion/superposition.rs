//! Superposition of unit responses: the inner loop of a batch.
//!
//! The loops run over contiguous memory, across samples and DoFs. Each element is summed in the same order regardless of
//! its position, so that results do not depend on the division of a batch.

use std::ops::Range;

use ndarray::{ArrayViewMut3, Axis};

use crate::model::responses::{Curves, Derivative};
use crate::validate::row_major;

/// Minimum length to which the coefficients of the DoFs are repeated, for loops that fill vector registers.
const MIN_PATTERN: usize = 64;
/// Number of elements of a tile: its responses are read from cache for all movements of a block.
const TILE: usize = 1024;

/// Returns the number of elements of a tile for coefficients of a period: whole periods, and so whole samples.
pub(crate) fn tile_size(period: usize) -> usize {
    period * (TILE / period).max(1)
}

/// Coefficients of a movement y = g + s·R + Δy(0)·E + Δẏ(0)·V + ẏ_g·G.
pub(crate) struct Combination {
    pub(crate) style: Vec<f64>,
    /// Coefficients g of the DoFs, repeated to at least [`MIN_PATTERN`] elements, as are the following.
    pub(crate) centre: Vec<f64>,
    pub(crate) start: Vec<f64>,
    pub(crate) velocity: Vec<f64>,
    pub(crate) goal_velocity: Option<Vec<f64>>,
}

impl Combination {
    /// Returns the combination of the styles (J,) with centre, start and velocity coefficients and final velocity (D,).
    pub(crate) fn new(style: Vec<f64>, coefficients: [&[f64]; 3], goal_velocity: Option<&[f64]>) -> Self {
        let [centre, start, velocity] = coefficients.map(pattern);
        Self { style, centre, start, velocity, goal_velocity: goal_velocity.map(pattern) }
    }
}

/// Repeats values (D,) to at least [`MIN_PATTERN`] elements.
fn pattern(values: &[f64]) -> Vec<f64> {
    values.repeat(MIN_PATTERN.div_ceil(values.len()))
}

/// Writes one derivative of movements (B, T, D).
pub(crate) fn write(
    combinations: &[Combination],
    curves: &Curves,
    derivative: Derivative,
    mut output: ArrayViewMut3<f64>,
) {
    let Some(period) = combinations.first().map(|first| first.centre.len()) else { return };
    // The centre is constant: its derivatives are zero.
    let zeros = vec![0.0; period];
    let (n_dofs, length) = (output.len_of(Axis(2)), curves.start.len());
    let tile = tile_size(period);
    let mut buffer = vec![0.0; tile];
    for from in (0..length).step_by(tile) {
        let at = from..(from + tile).min(length);
        let part = Tile::new(curves, at.clone());
        for (combination, mut movement) in combinations.iter().zip(output.outer_iter_mut()) {
            let centre = if derivative == Derivative::Position { &combination.centre } else { &zeros };
            match movement.as_slice_mut() {
                Some(movement) => part.sum(combination, centre, &mut movement[at.clone()]),
                None => {
                    let buffer = &mut buffer[..at.len()];
                    part.sum(combination, centre, buffer);
                    let mut samples = movement.slice_mut(ndarray::s![at.start / n_dofs..at.end / n_dofs, ..]);
                    samples.iter_mut().zip(buffer).for_each(|(to, from)| *to = *from);
                }
            }
        }
    }
}

/// Unit responses over a range of elements.
pub(crate) struct Tile<'a> {
    pub(crate) styles: Vec<&'a [f64]>,
    pub(crate) start: &'a [f64],
    pub(crate) velocity: &'a [f64],
    pub(crate) goal_velocity: Option<&'a [f64]>,
}

impl<'a> Tile<'a> {
    pub(crate) fn new(curves: &'a Curves, at: Range<usize>) -> Self {
        let part = |curve: &'a ndarray::Array2<f64>| &row_major(curve)[at.clone()];
        Self {
            styles: curves.styles.iter().map(part).collect(),
            start: part(&curves.start),
            velocity: part(&curves.velocity),
            goal_velocity: curves.goal_velocity.as_ref().map(part),
        }
    }

    /// Writes the tile of one movement, with the repeated coefficients `centre` of g.
    pub(crate) fn sum(&self, combination: &Combination, centre: &[f64], out: &mut [f64]) {
        let Combination { style, start, velocity, .. } = combination;
        let period = centre.len();
        let responses = self.start.chunks(period).zip(self.velocity.chunks(period));
        for (out, (e, v)) in out.chunks_mut(period).zip(responses) {
            let coefficients = centre.iter().zip(start).zip(velocity);
            for (((out, ((g, start), velocity)), e), v) in out.iter_mut().zip(coefficients).zip(e).zip(v) {
                *out = g + start * e + velocity * v;
            }
        }
        if let (Some(velocity), Some(responses)) = (&combination.goal_velocity, self.goal_velocity) {
            for (out, responses) in out.chunks_mut(period).zip(responses.chunks(period)) {
                out.iter_mut().zip(velocity).zip(responses).for_each(|((out, velocity), g)| *out += velocity * g);
            }
        }
        // Four styles per pass over the output reduce its loads and stores.
        for (s, curves) in style.chunks(4).zip(self.styles.chunks(4)) {
            match (s, curves) {
                (&[a, b, c, d], [r, s, t, u]) => add([a, b, c, d], [r, s, t, u], out),
                (&[a, b, c], [r, s, t]) => add([a, b, c], [r, s, t], out),
                (&[a, b], [r, s]) => add([a, b], [r, s], out),
                _ => s.iter().zip(curves).for_each(|(&s, curve)| add([s], [curve], out)),
            }
        }
    }
}

/// Adds curves, multiplied by their coefficients, to `out`.
#[inline(always)]
fn add<const N: usize>(coefficients: [f64; N], curves: [&[f64]; N], out: &mut [f64]) {
    let curves = curves.map(|curve| &curve[..out.len()]);
    for (i, out) in out.iter_mut().enumerate() {
        *out += (0..N).fold(0.0, |sum, j| sum + coefficients[j] * curves[j][i]);
    }
}
