//! Formulas with four degrees of freedom in one AVX2 register, chosen at run time.
//!
//! Intrinsics are inlined only into functions with their target feature, hence `inline(always)` on every operation.
//!
//! At D = 7 and J = 3 a tick takes 0.53 to 0.67 of the instructions of [`F64x4`] on the baseline of x86-64, and 0.63 to 0.74 of
//! those of [`F64x4`] compiled for AVX2, in less than a third of the time of the baseline (`cargo bench --bench instructions` and
//! `--bench step`).
#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m256d, __m512d, _CMP_LE_OQ, _CMP_LT_OQ, _MM_FROUND_NO_EXC, _MM_FROUND_TO_NEG_INF, _mm_cvtsd_f64, _mm_min_pd,
    _mm_min_sd, _mm_unpackhi_pd, _mm256_add_pd, _mm256_and_pd, _mm256_andnot_pd, _mm256_castpd256_pd128, _mm256_cmp_pd,
    _mm256_div_pd, _mm256_extractf128_pd, _mm256_floor_pd, _mm256_load_pd, _mm256_loadu_pd, _mm256_max_pd,
    _mm256_min_pd, _mm256_movemask_pd, _mm256_mul_pd, _mm256_permute2f128_pd, _mm256_set1_pd, _mm256_setzero_pd,
    _mm256_sqrt_pd, _mm256_store_pd, _mm256_storeu_pd, _mm256_sub_pd, _mm256_unpackhi_pd, _mm256_unpacklo_pd,
    _mm256_xor_pd, _mm512_add_pd, _mm512_castpd512_pd256, _mm512_extractf64x4_pd, _mm512_load_pd, _mm512_loadu_pd,
    _mm512_mul_pd, _mm512_roundscale_pd, _mm512_set1_pd, _mm512_setzero_pd, _mm512_shuffle_f64x2, _mm512_store_pd,
    _mm512_storeu_pd, _mm512_sub_pd,
};
use std::ops::{Add, BitAnd, Div, Mul, Neg, Sub};

use super::blocks::{Block, BlockKernel, Line, blocks_of_one_group};
use super::simd::{F64x4, Kernel, Real, Register, WIDTH, unpad};

/// Computes a formula.
///
/// # Safety
/// The processor has AVX2.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn compute<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

/// Computes a formula with twice the registers, and with factors from memory that an instruction repeats in all lanes.
///
/// # Safety
/// The processor has AVX2 and the 256-bit instructions of AVX-512.
#[target_feature(enable = "avx2,avx512f,avx512vl")]
pub(super) unsafe fn compute_by_more_registers<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

/// Computes a formula of blocks of one group.
///
/// # Safety
/// The processor has AVX2.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn compute_blocks<K: BlockKernel>(kernel: K) {
    kernel.run::<Avx2>();
}

/// Computes a formula of blocks of one group, with the registers of [`compute_by_more_registers`].
///
/// # Safety
/// The processor has AVX2 and the 256-bit instructions of AVX-512.
#[target_feature(enable = "avx2,avx512f,avx512vl")]
pub(super) unsafe fn compute_blocks_by_more_registers<K: BlockKernel>(kernel: K) {
    kernel.run::<Avx2>();
}

/// Computes a formula of blocks of two groups.
///
/// # Safety
/// The processor has AVX2, AVX-512F and the 256-bit instructions of AVX-512.
#[target_feature(enable = "avx2,avx512f,avx512vl")]
pub(super) unsafe fn compute_pairs<K: BlockKernel>(kernel: K) {
    kernel.run::<Avx512>();
}

/// Register of four DoFs. Only the functions above instantiate it, which run only on processors with AVX2.
#[derive(Clone, Copy)]
struct Avx2(__m256d);

impl Default for Avx2 {
    #[inline(always)]
    fn default() -> Self {
        // SAFETY: values of this type exist only inside the functions above, so the processor has AVX2.
        Self(unsafe { _mm256_setzero_pd() })
    }
}

blocks_of_one_group!(Avx2);

impl Avx2 {
    #[inline(always)]
    fn floor(self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_floor_pd(self.0) })
    }
}

/// Register of eight DoFs, which only [`compute_pairs`] instantiates.
#[derive(Clone, Copy)]
struct Avx512(__m512d);

impl Default for Avx512 {
    #[inline(always)]
    fn default() -> Self {
        // SAFETY: values of this type exist only inside `compute_pairs`, so the processor has AVX-512F.
        Self(unsafe { _mm512_setzero_pd() })
    }
}

impl Mul<f64> for Avx512 {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm512_mul_pd(self.0, _mm512_set1_pd(factor)) })
    }
}

impl Real for Avx512 {}

impl Block for Avx512 {
    type Group = Avx2;

    const GROUPS: usize = 2;

    #[inline(always)]
    fn load(line: &Line, _: usize) -> Self {
        // SAFETY: see `default`. A `Line` is eight doubles, aligned to 64 bytes, and the reference makes them readable.
        Self(unsafe { _mm512_load_pd(std::ptr::from_ref(line).cast()) })
    }

    #[inline(always)]
    fn store(self, line: &mut Line, _: usize) {
        // SAFETY: see `load`. The exclusive reference makes them writable.
        unsafe { _mm512_store_pd(std::ptr::from_mut(line).cast(), self.0) };
    }

    #[inline(always)]
    fn load_four(first: &[F64x4; 4], second: &[F64x4; 4]) -> [Self; 4] {
        let (first, second): (*const f64, *const f64) =
            (std::ptr::from_ref(first).cast(), std::ptr::from_ref(second).cast());
        // SAFETY: see `default`. The references make sixteen doubles each readable, and they need no alignment.
        unsafe {
            [
                Self(_mm512_loadu_pd(first)),
                Self(_mm512_loadu_pd(first.add(8))),
                Self(_mm512_loadu_pd(second)),
                Self(_mm512_loadu_pd(second.add(8))),
            ]
        }
    }

    #[inline(always)]
    fn in_order([a, b, c, d]: [Self; 4]) -> [Self; 4] {
        // SAFETY: see `default`.
        unsafe {
            [
                Self(_mm512_shuffle_f64x2::<0x44>(a.0, c.0)),
                Self(_mm512_shuffle_f64x2::<0xee>(a.0, c.0)),
                Self(_mm512_shuffle_f64x2::<0x44>(b.0, d.0)),
                Self(_mm512_shuffle_f64x2::<0xee>(b.0, d.0)),
            ]
        }
    }

    #[inline(always)]
    fn splat(value: f64) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm512_set1_pd(value) })
    }

    #[inline(always)]
    fn write(self, numbers: &mut [f64]) {
        // SAFETY: see `default`.
        let first = Avx2(unsafe { _mm512_castpd512_pd256(self.0) });
        // SAFETY: see `default`.
        let second = Avx2(unsafe { _mm512_extractf64x4_pd::<1>(self.0) });
        if let Some((four, rest)) = numbers.split_first_chunk_mut() {
            first.store_numbers(four);
            unpad(Register::store(second), rest);
        } else {
            unpad(Register::store(first), numbers);
        }
    }

    #[inline(always)]
    fn read_all(numbers: &[f64]) -> Self {
        match numbers.first_chunk::<8>() {
            // SAFETY: see `default`. The reference makes eight doubles readable, and they need no alignment.
            Some(eight) => Self(unsafe { _mm512_loadu_pd(eight.as_ptr()) }),
            None => Self::default(),
        }
    }

    #[inline(always)]
    fn floor(self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm512_roundscale_pd::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(self.0) })
    }

    #[inline(always)]
    fn write_all(self, numbers: &mut [f64]) {
        if let Some(eight) = numbers.first_chunk_mut::<8>() {
            // SAFETY: see `default`. The exclusive reference makes eight doubles writable, and they need no alignment.
            unsafe { _mm512_storeu_pd(eight.as_mut_ptr(), self.0) };
        }
    }
}

/// Implements operators by intrinsics.
macro_rules! operators {
    ($register:ident: $($operator:ident $function:ident $intrinsic:ident,)+) => {
        $(impl $operator for $register {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                // SAFETY: see `default`.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        })+
    };
}

operators! {
    Avx512:
    Add add _mm512_add_pd,
    Sub sub _mm512_sub_pd,
    Mul mul _mm512_mul_pd,
}

operators! {
    Avx2:
    Add add _mm256_add_pd,
    Sub sub _mm256_sub_pd,
    Mul mul _mm256_mul_pd,
    Div div _mm256_div_pd,
    BitAnd bitand _mm256_and_pd,
}

impl Mul<f64> for Avx2 {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        // SAFETY: see `default`.
        self * Self(unsafe { _mm256_set1_pd(factor) })
    }
}

impl Neg for Avx2 {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_xor_pd(self.0, _mm256_set1_pd(-0.0)) })
    }
}

impl Real for Avx2 {}

impl Register for Avx2 {
    #[inline(always)]
    fn load(lanes: &F64x4) -> Self {
        // SAFETY: see `default`. An `F64x4` is four doubles, aligned to 32 bytes, and the reference makes them readable.
        Self(unsafe { _mm256_load_pd(std::ptr::from_ref(lanes).cast()) })
    }

    #[inline(always)]
    fn store(self) -> F64x4 {
        let mut lanes = F64x4::default();
        // SAFETY: see `load`. The exclusive reference makes them writable.
        unsafe { _mm256_store_pd(std::ptr::from_mut(&mut lanes).cast(), self.0) };
        lanes
    }

    #[inline(always)]
    fn load_numbers(numbers: &[f64; WIDTH]) -> Self {
        // SAFETY: see `default`. The reference makes four doubles readable, and they need no alignment.
        Self(unsafe { _mm256_loadu_pd(numbers.as_ptr()) })
    }

    #[inline(always)]
    fn store_numbers(self, numbers: &mut [f64; WIDTH]) {
        // SAFETY: see `load_numbers`. The exclusive reference makes them writable.
        unsafe { _mm256_storeu_pd(numbers.as_mut_ptr(), self.0) };
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_sqrt_pd(self.0) })
    }

    #[inline(always)]
    fn fast_min(self, other: Self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_min_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn fast_max(self, other: Self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_max_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn simd_le(self, limit: Self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_cmp_pd::<_CMP_LE_OQ>(self.0, limit.0) })
    }

    #[inline(always)]
    fn simd_lt(self, limit: Self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, limit.0) })
    }

    #[inline(always)]
    fn to_bitmask(self) -> u32 {
        // SAFETY: see `default`.
        unsafe { _mm256_movemask_pd(self.0) as u32 }
    }

    #[inline(always)]
    fn smallest(self) -> f64 {
        // SAFETY: see `default`.
        unsafe {
            let pair = _mm_min_pd(_mm256_castpd256_pd128(self.0), _mm256_extractf128_pd::<1>(self.0));
            _mm_cvtsd_f64(_mm_min_sd(pair, _mm_unpackhi_pd(pair, pair)))
        }
    }

    #[inline(always)]
    fn transpose(rows: [Self; WIDTH]) -> [Self; WIDTH] {
        let [a, b, c, d] = rows;
        // SAFETY: see `default`.
        unsafe {
            let (low, high) = (_mm256_unpacklo_pd(a.0, b.0), _mm256_unpackhi_pd(a.0, b.0));
            let (lower, higher) = (_mm256_unpacklo_pd(c.0, d.0), _mm256_unpackhi_pd(c.0, d.0));
            [
                Self(_mm256_permute2f128_pd::<0x20>(low, lower)),
                Self(_mm256_permute2f128_pd::<0x20>(high, higher)),
                Self(_mm256_permute2f128_pd::<0x31>(low, lower)),
                Self(_mm256_permute2f128_pd::<0x31>(high, higher)),
            ]
        }
    }
}
