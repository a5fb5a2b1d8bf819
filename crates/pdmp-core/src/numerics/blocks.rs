//! Registers of one or two groups of DoFs, for loops over many movements.

use std::ops::Mul;

use crate::numerics::simd::{F64x4, Real, Register, WIDTH};

/// Two groups in one line of the cache.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct Line(pub(crate) [F64x4; 2]);

/// Register of consecutive groups.
pub(crate) trait Block: Real + Mul<Output = Self> {
    /// Register of one group.
    type Group: Block + Register;

    /// Number of groups, one or two.
    const GROUPS: usize;
    /// Number of lanes.
    const LANES: usize = Self::GROUPS * WIDTH;

    /// Loads one of the groups of a line, or both if there are two.
    fn load(line: &Line, group: usize) -> Self;
    /// Writes one of the groups of a line, or both.
    fn store(self, line: &mut Line, group: usize);
    /// Loads four numbers of each lane of a group, and those of another if there are two, in an order for sums.
    fn load_four(first: &[F64x4; 4], second: &[F64x4; 4]) -> [Self; 4];
    /// Returns the four numbers of all lanes from what `load_four` loads, or from sums of it.
    fn in_order(four: [Self; 4]) -> [Self; 4];
    /// Returns a register with the same value in all lanes.
    fn splat(value: f64) -> Self;
    /// Writes the lanes to a slice of that length or less.
    fn write(self, numbers: &mut [f64]);
    /// Returns the first numbers of a slice, zero if there are fewer than lanes.
    fn read_all(numbers: &[f64]) -> Self;
    /// Returns the largest integers that are not larger than the lanes.
    fn floor(self) -> Self;
    /// Writes all lanes to the first numbers of a slice.
    fn write_all(self, numbers: &mut [f64]);
}

/// Implements blocks of one group by registers.
macro_rules! blocks_of_one_group {
    ($register:ty) => {
        impl $crate::numerics::blocks::Block for $register {
            type Group = Self;

            const GROUPS: usize = 1;

            #[inline(always)]
            fn load(line: &$crate::numerics::blocks::Line, group: usize) -> Self {
                $crate::numerics::simd::Register::load(&line.0[group % 2])
            }

            #[inline(always)]
            fn store(self, line: &mut $crate::numerics::blocks::Line, group: usize) {
                line.0[group % 2] = $crate::numerics::simd::Register::store(self);
            }

            #[inline(always)]
            fn load_four(
                [a, b, c, d]: &[$crate::numerics::simd::F64x4; 4],
                _: &[$crate::numerics::simd::F64x4; 4],
            ) -> [Self; 4] {
                $crate::numerics::simd::Register::load_all([a, b, c, d])
            }

            #[inline(always)]
            fn in_order(four: [Self; 4]) -> [Self; 4] {
                four
            }

            #[inline(always)]
            fn splat(value: f64) -> Self {
                $crate::numerics::simd::Register::splat(value)
            }

            #[inline(always)]
            fn write(self, numbers: &mut [f64]) {
                $crate::numerics::simd::unpad($crate::numerics::simd::Register::store(self), numbers);
            }

            #[inline(always)]
            fn read_all(numbers: &[f64]) -> Self {
                match numbers.first_chunk() {
                    Some(four) => $crate::numerics::simd::Register::load_numbers(four),
                    None => Self::default(),
                }
            }

            #[inline(always)]
            fn floor(self) -> Self {
                self.floor()
            }

            #[inline(always)]
            fn write_all(self, numbers: &mut [f64]) {
                if let Some(four) = numbers.first_chunk_mut() {
                    $crate::numerics::simd::Register::store_numbers(self, four);
                }
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
pub(super) use blocks_of_one_group;

blocks_of_one_group!(F64x4);

/// Formula in registers of one or two groups; see `Kernel`.
pub(crate) trait BlockKernel {
    /// Computes the formula, in an implementation that is `inline(always)`.
    fn run<B: Block>(self);
}

/// Computes a formula of many steps for `n_groups` groups in the largest registers of the processor: two groups to a register
/// where it has such registers and the number is even.
#[inline(always)]
#[allow(unsafe_code)]
pub(crate) fn compute_blocks<K: BlockKernel>(kernel: K, n_groups: usize) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        let has_more =
            std::arch::is_x86_feature_detected!("avx512f") && std::arch::is_x86_feature_detected!("avx512vl");
        // SAFETY: the processor has the features of each.
        return unsafe {
            match (has_more, n_groups % 2) {
                (true, 0) => super::avx::compute_pairs(kernel),
                (true, _) => super::avx::compute_blocks_by_more_registers(kernel),
                (false, _) => super::avx::compute_blocks(kernel),
            }
        };
    }
    let _ = n_groups;
    kernel.run::<F64x4>();
}
