//! Superposition of unit responses: the inner loop of a batch.
//!
//! The loops run over contiguous memory, across samples and DoFs. Each element is summed in the same order regardless of
//! its position, so that results do not depend on the division of a batch.
// Closures of iterators stay calls, into which the instructions of larger registers are not inlined.
#![allow(clippy::needless_range_loop)]

use std::ops::Range;

use ndarray::{ArrayViewMut3, Axis};

use crate::model::responses::{Curves, Derivative};
use crate::numerics::simd::{Kernel, Register, WIDTH, compute};
use crate::validate::row_major;

/// Number of elements that are summed at once.
const BLOCK: usize = 4 * WIDTH;
/// Minimum length to which the coefficients of the DoFs are repeated, to a multiple of [`BLOCK`].
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

/// Repeats values (D,) to at least [`MIN_PATTERN`] elements, a multiple of [`BLOCK`].
fn pattern(values: &[f64]) -> Vec<f64> {
    values.repeat(MIN_PATTERN.div_ceil(values.len()).next_multiple_of(BLOCK))
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
        compute(Sum { tile: self, combination, centre, out });
    }
}

/// Kernel of [`Tile::sum`].
struct Sum<'a> {
    tile: &'a Tile<'a>,
    combination: &'a Combination,
    centre: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { tile, combination, centre, out } = self;
        let Combination { style, start, velocity, goal_velocity, .. } = combination;
        let period = centre.len();
        let n_whole = out.len() - out.len() % BLOCK;
        let (mut at, mut within) = (0, 0);
        while at < n_whole {
            let mut sums = load::<T>(centre, within);
            add_products(&mut sums, load(start, within), load(tile.start, at));
            add_products(&mut sums, load(velocity, within), load(tile.velocity, at));
            if let (Some(velocity), Some(curve)) = (goal_velocity, tile.goal_velocity) {
                add_products(&mut sums, load(velocity, within), load(curve, at));
            }
            for j in 0..style.len() {
                add_products(&mut sums, [T::splat(style[j]); BLOCK / WIDTH], load(tile.styles[j], at));
            }
            store(sums, &mut out[at..]);
            at += BLOCK;
            within = if within + BLOCK == period { 0 } else { within + BLOCK };
        }
        for (i, out) in out.iter_mut().enumerate().skip(n_whole) {
            let within = i % period;
            *out = centre[within] + start[within] * tile.start[i] + velocity[within] * tile.velocity[i];
            if let (Some(velocity), Some(curve)) = (goal_velocity, tile.goal_velocity) {
                *out += velocity[within] * curve[i];
            }
            for j in 0..style.len() {
                *out += style[j] * tile.styles[j][i];
            }
        }
    }
}

/// Loads a block of numbers from one on.
#[inline(always)]
fn load<T: Register>(numbers: &[f64], at: usize) -> [T; BLOCK / WIDTH] {
    let mut registers = [T::default(); BLOCK / WIDTH];
    if let Some(block) = numbers[at..].first_chunk::<BLOCK>() {
        let (fours, _) = block.as_chunks();
        for k in 0..BLOCK / WIDTH {
            registers[k] = T::load_numbers(&fours[k]);
        }
    }
    registers
}

/// Adds the products of two blocks.
#[inline(always)]
fn add_products<T: Register>(sums: &mut [T; BLOCK / WIDTH], factors: [T; BLOCK / WIDTH], values: [T; BLOCK / WIDTH]) {
    for k in 0..BLOCK / WIDTH {
        sums[k] = sums[k] + factors[k] * values[k];
    }
}

/// Writes a block to the first numbers.
#[inline(always)]
fn store<T: Register>(sums: [T; BLOCK / WIDTH], numbers: &mut [f64]) {
    if let Some(block) = numbers.first_chunk_mut::<BLOCK>() {
        let (fours, _) = block.as_chunks_mut();
        for k in 0..BLOCK / WIDTH {
            sums[k].store_numbers(&mut fours[k]);
        }
    }
}
