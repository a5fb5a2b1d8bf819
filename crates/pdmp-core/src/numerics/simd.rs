//! SIMD over degrees of freedom, four to a register.
//!
//! The control loop keeps its vectors in groups of four DoFs, padded with zeros: each formula is written once and runs in
//! full registers for every D. An operation rounds each lane as it rounds a scalar, so that results do not depend on the
//! register width of the machine.

use std::ops::{Add, BitAnd, Div, Mul, Neg, Range, Sub};

/// Group of four DoFs in memory, and the portable register type.
pub(crate) type F64x4 = wide::f64x4;

/// Number of DoFs in a group.
pub(crate) const WIDTH: usize = 4;

/// Operand of a formula: a scalar, or a register of several.
pub(crate) trait Real:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f64, Output = Self>
{
}

impl Real for f64 {}
impl Real for F64x4 {}

/// Register of four DoFs. Comparisons return masks, lanes of ones or zeros in all bits.
pub(crate) trait Register:
    Real + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self> + BitAnd<Output = Self>
{
    /// Loads a group from memory.
    fn load(lanes: &F64x4) -> Self;
    /// Returns the lanes as a group.
    fn store(self) -> F64x4;
    /// Loads four numbers from anywhere in memory.
    fn load_numbers(numbers: &[f64; WIDTH]) -> Self;
    /// Writes the lanes to four numbers anywhere in memory.
    fn store_numbers(self, numbers: &mut [f64; WIDTH]);
    /// Returns the magnitudes.
    fn abs(self) -> Self;
    /// Returns the square roots.
    fn sqrt(self) -> Self;
    /// Returns the smaller lanes, those of `other` where one is no number.
    fn fast_min(self, other: Self) -> Self;
    /// Returns the larger lanes, those of `other` where one is no number.
    fn fast_max(self, other: Self) -> Self;
    /// Returns the lanes that are at most those of `limit`.
    fn simd_le(self, limit: Self) -> Self;
    /// Returns the lanes that are less than those of `limit`.
    fn simd_lt(self, limit: Self) -> Self;
    /// Returns a mask as bits, the first lane as the lowest one.
    fn to_bitmask(self) -> u32;
    /// Returns the smallest lane.
    fn smallest(self) -> f64;
    /// Returns the columns of four rows.
    fn transpose(rows: [Self; WIDTH]) -> [Self; WIDTH];

    /// Loads several groups.
    #[inline(always)]
    fn load_all<const N: usize>(lanes: [&F64x4; N]) -> [Self; N] {
        let (mut registers, mut i) = ([Self::default(); N], 0);
        while i < N {
            registers[i] = Self::load(lanes[i]);
            i += 1;
        }
        registers
    }

    /// Returns a register with the same value in all lanes.
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self::load(&F64x4::splat(value))
    }

    /// Returns whether a mask holds in every lane.
    #[inline(always)]
    fn all(self) -> bool {
        self.to_bitmask() == (1 << WIDTH) - 1
    }
}

impl Register for F64x4 {
    #[inline(always)]
    fn load(lanes: &F64x4) -> Self {
        *lanes
    }

    #[inline(always)]
    fn store(self) -> F64x4 {
        self
    }

    #[inline(always)]
    fn load_numbers(numbers: &[f64; WIDTH]) -> Self {
        Self::new(*numbers)
    }

    #[inline(always)]
    fn store_numbers(self, numbers: &mut [f64; WIDTH]) {
        *numbers = self.to_array();
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self::abs(self)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }

    #[inline(always)]
    fn fast_min(self, other: Self) -> Self {
        Self::fast_min(self, other)
    }

    #[inline(always)]
    fn fast_max(self, other: Self) -> Self {
        Self::fast_max(self, other)
    }

    #[inline(always)]
    fn simd_le(self, limit: Self) -> Self {
        Self::simd_le(self, limit)
    }

    #[inline(always)]
    fn simd_lt(self, limit: Self) -> Self {
        Self::simd_lt(self, limit)
    }

    #[inline(always)]
    fn to_bitmask(self) -> u32 {
        Self::to_bitmask(self)
    }

    #[inline(always)]
    fn smallest(self) -> f64 {
        let lesser = |a: f64, b: f64| if a < b { a } else { b };
        let [a, b, c, d] = self.to_array();
        lesser(lesser(a, c), lesser(b, d))
    }

    #[inline(always)]
    fn transpose(rows: [Self; WIDTH]) -> [Self; WIDTH] {
        Self::transpose(rows)
    }
}

/// Formula in registers of any type.
///
/// No closure in it computes with registers, as in `[a, b].map(|x| x * y)`, and no iterator passes them: these are functions
/// of their own, which lack the target feature, so that operations remain calls in them. A tick then takes six times as long.
pub(crate) trait Kernel {
    type Output;

    /// Computes the formula. Implementations are `inline(always)`, as is all that they call with registers.
    fn run<T: Register>(self) -> Self::Output;
}

/// Computes a formula in the largest registers of the processor.
#[inline(always)]
#[allow(unsafe_code)]
pub(crate) fn compute<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { super::avx::compute(kernel) };
    }
    compute_portable(kernel)
}

/// Computes a formula of many steps in the largest registers of the processor, with code of its own for more processors than
/// [`compute`].
#[inline(always)]
#[allow(unsafe_code)]
pub(crate) fn compute_many<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2")
        && std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512vl")
    {
        // SAFETY: the processor has these features.
        return unsafe { super::avx::compute_by_more_registers(kernel) };
    }
    compute(kernel)
}

/// Computes a formula with the instructions of every processor. It stays a call, so that its callers stay small.
#[inline(never)]
fn compute_portable<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<F64x4>()
}

/// Flushes values far below `rest` to zero.
///
/// Adding and subtracting `rest` leaves larger values unchanged to 16 digits and rounds values below 1e-16·`rest` to zero.
/// Products of such values would become subnormal numbers, which are slow.
#[inline(always)]
pub(crate) fn flush<T: Real>(value: T, rest: T) -> T {
    (value + rest) - rest
}

/// Returns the exponentials of lanes between −700 and 700, to 4e-16 of them.
///
/// With x = k ln 2 + r and |r| ≤ ½ ln 2, it is 2ᵏ times the Taylor polynomial of degree 13 at r.
#[inline(always)]
#[allow(clippy::needless_range_loop)]
pub(crate) fn exp<T: Register>(x: T) -> T {
    // 1/13! to 1/2!, 1 and 1.
    const TAYLOR: [f64; 14] = {
        let (mut terms, mut i) = ([1.0; 14], 1);
        while i < 14 {
            terms[13 - i] = terms[14 - i] / i as f64;
            i += 1;
        }
        terms
    };
    // A sum with 1.5·2⁵² has the nearest integer in its last bits.
    const ROUNDING: f64 = 6_755_399_441_055_744.0;
    // Two parts of ln 2, the first of which is exact in products with integers of eleven bits.
    const LN_2: [f64; 2] = [0.693_147_180_369_123_816_49, 1.908_214_929_270_587_700_02e-10];
    let shifted = x * std::f64::consts::LOG2_E + T::splat(ROUNDING);
    let k = shifted - T::splat(ROUNDING);
    let r = x - k * LN_2[0] - k * LN_2[1];
    let mut sum = T::splat(TAYLOR[0]);
    for i in 1..TAYLOR.len() {
        sum = sum * r + T::splat(TAYLOR[i]);
    }
    let mut power = shifted.store().to_array();
    for i in 0..WIDTH {
        power[i] = f64::from_bits((power[i].to_bits() << 52).wrapping_add(1023 << 52));
    }
    sum * T::load(&F64x4::new(power))
}

/// Returns the number of groups for `n` DoFs.
pub(crate) fn groups(n: usize) -> usize {
    n.div_ceil(WIDTH)
}

/// Returns a vector (D,) in groups.
pub(crate) fn pack(values: &[f64]) -> Vec<F64x4> {
    let mut lanes = vec![F64x4::ZERO; groups(values.len())];
    repack(&mut lanes, values);
    lanes
}

/// Overwrites the first elements of groups with a vector (D,).
pub(crate) fn repack(lanes: &mut [F64x4], values: &[f64]) {
    bytemuck::cast_slice_mut(lanes)[..values.len()].copy_from_slice(values);
}

/// Returns up to four numbers, padded with zeros.
///
/// The match compiles to moves; a call of `memcpy` would cost more than most formulas on the result.
#[inline(always)]
pub(crate) fn padded(numbers: &[f64]) -> F64x4 {
    F64x4::new(match *numbers {
        [] => [0.0; WIDTH],
        [a] => [a, 0.0, 0.0, 0.0],
        [a, b] => [a, b, 0.0, 0.0],
        [a, b, c] => [a, b, c, 0.0],
        [a, b, c, d, ..] => [a, b, c, d],
    })
}

/// Writes the lanes of a group to a slice of up to four numbers.
#[inline(always)]
pub(crate) fn unpad(lanes: F64x4, numbers: &mut [f64]) {
    match (numbers, lanes.to_array()) {
        ([], _) => {}
        ([a], [x, ..]) => *a = x,
        ([a, b], [x, y, ..]) => (*a, *b) = (x, y),
        ([a, b, c], [x, y, z, _]) => (*a, *b, *c) = (x, y, z),
        ([a, b, c, d, ..], lanes) => [*a, *b, *c, *d] = lanes,
    }
}

/// Writes the elements of groups to a slice (D,).
#[inline(always)]
pub(crate) fn copy(lanes: &[F64x4], numbers: &mut [f64]) {
    numbers.chunks_mut(WIDTH).zip(lanes).for_each(|(numbers, lanes)| unpad(*lanes, numbers));
}

/// Copies the DoFs of one group from rows (k, `n`) to a column of k groups.
pub(crate) fn gather(rows: &[f64], n: usize, group: usize, column: &mut [F64x4]) {
    let dofs = dof_range(n, group);
    column.iter_mut().zip(rows.chunks_exact(n)).for_each(|(lanes, row)| *lanes = padded(&row[dofs.clone()]));
}

/// Copies a column of k groups to the DoFs of one group in rows (k, `n`).
pub(crate) fn scatter(column: &[F64x4], n: usize, group: usize, rows: &mut [f64]) {
    let dofs = dof_range(n, group);
    column.iter().zip(rows.chunks_exact_mut(n)).for_each(|(lanes, row)| unpad(*lanes, &mut row[dofs.clone()]));
}

/// Returns the indices of the DoFs in one group, of `n` DoFs in all.
fn dof_range(n: usize, group: usize) -> Range<usize> {
    group * WIDTH..n.min((group + 1) * WIDTH)
}

/// Returns the first `n` elements of groups.
#[inline(always)]
pub(crate) fn unpack(lanes: &[F64x4], n: usize) -> &[f64] {
    &bytemuck::cast_slice(lanes)[..n]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exponentials agree with those of the standard library to the last digits.
    #[test]
    fn exponentials_are_exact() {
        for i in -7000..7000 {
            let x = f64::from(i) * 0.09999 + 0.001;
            let value = exp(F64x4::splat(x)).to_array()[3];
            assert!((value / x.exp() - 1.0).abs() < 4e-16, "{x}");
        }
        assert_eq!(exp(F64x4::ZERO), F64x4::ONE);
    }
}
