//! Four degrees of freedom side by side, as the processor takes them.
//!
//! The control loop keeps its vectors in groups of four, padded with zeros, so that every formula of it is written once
//! and runs in full registers whatever D is. An operation rounds each lane as it would round a number alone: results do
//! not depend on the machine's width.

use std::ops::{Add, Mul, Range, Sub};

/// Four DoFs, as they lie in memory, and as every processor can take them.
pub(crate) type Lanes = wide::f64x4;

/// Number of DoFs in a group.
pub(crate) const WIDTH: usize = 4;

/// What a formula is evaluated on: a number, or several side by side.
pub(crate) trait Real:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f64, Output = Self>
{
}

impl Real for f64 {}
impl Real for Lanes {}

/// Four DoFs in a register.
pub(crate) trait Register: Real {
    /// Takes them from memory.
    fn load(lanes: &Lanes) -> Self;
    /// Gives them back.
    fn store(self) -> Lanes;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self::load(&Lanes::splat(value))
    }
}

impl Register for Lanes {
    #[inline(always)]
    fn load(lanes: &Lanes) -> Self {
        *lanes
    }

    #[inline(always)]
    fn store(self) -> Lanes {
        self
    }
}

/// Flushes what has all but come to rest to zero: adding `rest` and taking it away leaves what lies 16 digits above it
/// as it was, and nothing of what lies below, whose products would leave the range of fast numbers.
#[inline(always)]
pub(crate) fn flush<T: Register>(value: T, rest: T) -> T {
    (value + rest) - rest
}

/// Groups that hold `n` DoFs.
pub(crate) fn groups(n: usize) -> usize {
    n.div_ceil(WIDTH)
}

/// A vector (D,) in groups.
pub(crate) fn pack(values: &[f64]) -> Vec<Lanes> {
    let mut lanes = vec![Lanes::ZERO; groups(values.len())];
    repack(&mut lanes, values);
    lanes
}

/// Writes a vector over another of its length.
pub(crate) fn repack(lanes: &mut [Lanes], values: &[f64]) {
    bytemuck::cast_slice_mut(lanes)[..values.len()].copy_from_slice(values);
}

/// Up to four numbers, padded with zeros. A call to copy so few would cost more than most of what is done with them.
#[inline(always)]
pub(crate) fn padded(numbers: &[f64]) -> Lanes {
    Lanes::new(match *numbers {
        [] => [0.0; WIDTH],
        [a] => [a, 0.0, 0.0, 0.0],
        [a, b] => [a, b, 0.0, 0.0],
        [a, b, c] => [a, b, c, 0.0],
        [a, b, c, d, ..] => [a, b, c, d],
    })
}

/// Writes the first numbers of four, as many as there is room for.
#[inline(always)]
pub(crate) fn unpad(lanes: Lanes, numbers: &mut [f64]) {
    match (numbers, lanes.to_array()) {
        ([], _) => {}
        ([a], [x, ..]) => *a = x,
        ([a, b], [x, y, ..]) => (*a, *b) = (x, y),
        ([a, b, c], [x, y, z, _]) => (*a, *b, *c) = (x, y, z),
        ([a, b, c, d, ..], lanes) => [*a, *b, *c, *d] = lanes,
    }
}

/// Writes the numbers of groups, as many as there is room for.
#[inline(always)]
pub(crate) fn copy(lanes: &[Lanes], numbers: &mut [f64]) {
    numbers.chunks_mut(WIDTH).zip(lanes).for_each(|(numbers, lanes)| unpad(*lanes, numbers));
}

/// Takes the DoFs of one group out of rows (k, `n`): what is a loop over samples for one DoF is one for four.
pub(crate) fn gather(rows: &[f64], n: usize, group: usize, column: &mut [Lanes]) {
    let dofs = dofs(n, group);
    column.iter_mut().zip(rows.chunks_exact(n)).for_each(|(lanes, row)| *lanes = padded(&row[dofs.clone()]));
}

/// Puts the DoFs of one group back into rows (k, `n`).
pub(crate) fn scatter(column: &[Lanes], n: usize, group: usize, rows: &mut [f64]) {
    let dofs = dofs(n, group);
    column.iter().zip(rows.chunks_exact_mut(n)).for_each(|(lanes, row)| unpad(*lanes, &mut row[dofs.clone()]));
}

/// The DoFs, of `n`, that one group holds.
fn dofs(n: usize, group: usize) -> Range<usize> {
    group * WIDTH..n.min((group + 1) * WIDTH)
}

/// The first `n` numbers of groups.
pub(crate) fn unpack(lanes: &[Lanes], n: usize) -> &[f64] {
    &bytemuck::cast_slice(lanes)[..n]
}
