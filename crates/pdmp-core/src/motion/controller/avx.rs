//! The tick with four degrees of freedom in one AVX2 register, chosen at run time.
//!
//! Intrinsics are inlined only into functions with their target feature, hence `inline(always)` on every operation.
//!
//! Instructions per tick at D = 7, J = 3 (`cargo bench --bench instructions`):
//!
//! | registers                       | settled | in transition | commanded |
//! |---------------------------------|--------:|--------------:|----------:|
//! | these                           |     790 |          1313 |      2277 |
//! | [`F64x4`], compiled for AVX2    |    1070 |          2078 |      3125 |
//! | [`F64x4`], baseline of x86-64   |    1187 |          2466 |      3596 |
//!
//! The time of a tick is less than a third of that of the baseline (`cargo bench --bench step`).
#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m256d, _mm256_add_pd, _mm256_load_pd, _mm256_mul_pd, _mm256_set1_pd, _mm256_setzero_pd, _mm256_store_pd,
    _mm256_sub_pd,
};
use std::ops::{Add, Mul, Sub};

use super::Controller;
use crate::numerics::simd::{F64x4, Real, Register};

/// Advances as [`Controller::advance_with`] if the processor has AVX2. Returns whether it has.
#[inline(always)]
pub(super) fn advance(controller: &mut Controller, dt: f64, h: f64) -> bool {
    let detected = std::arch::is_x86_feature_detected!("avx2");
    if detected {
        // SAFETY: the processor has AVX2, the only requirement of `advance_avx2`.
        unsafe { advance_avx2(controller, dt, h) };
    }
    detected
}

/// Converts the motion to coordinates as [`Controller::publish_pose_with`] if the processor has AVX2. Returns whether it has.
#[inline(always)]
pub(super) fn publish_pose(controller: &mut Controller) -> bool {
    let detected = std::arch::is_x86_feature_detected!("avx2");
    if detected {
        // SAFETY: the processor has AVX2, the only requirement of `publish_pose_avx2`.
        unsafe { publish_pose_avx2(controller) };
    }
    detected
}

#[target_feature(enable = "avx2")]
fn publish_pose_avx2(controller: &mut Controller) {
    controller.publish_pose_with();
}

#[target_feature(enable = "avx2")]
fn advance_avx2(controller: &mut Controller, dt: f64, h: f64) {
    controller.advance_with::<Avx2>(dt, h);
}

/// Register of four DoFs. Only `advance_avx2` instantiates it, which runs only on processors with AVX2.
#[derive(Clone, Copy)]
struct Avx2(__m256d);

impl Default for Avx2 {
    #[inline(always)]
    fn default() -> Self {
        // SAFETY: values of this type exist only inside `advance_avx2`, so the processor has AVX2.
        Self(unsafe { _mm256_setzero_pd() })
    }
}

impl Add for Avx2 {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_add_pd(self.0, other.0) })
    }
}

impl Sub for Avx2 {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_sub_pd(self.0, other.0) })
    }
}

impl Mul<f64> for Avx2 {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_mul_pd(self.0, _mm256_set1_pd(factor)) })
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
}
