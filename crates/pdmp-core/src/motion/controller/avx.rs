//! The tick with four degrees of freedom in one register of AVX2.
//!
//! The intrinsics must be inlined into a function that may use them, hence `inline(always)` down to the last of them.
#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m256d, _mm256_add_pd, _mm256_load_pd, _mm256_mul_pd, _mm256_set1_pd, _mm256_setzero_pd, _mm256_store_pd,
    _mm256_sub_pd,
};
use std::ops::{Add, Mul, Sub};

use super::Controller;
use crate::numerics::simd::{Lanes, Real, Register};

/// Moves on as [`Controller::advance_in`] does, if the processor has AVX2.
#[inline(always)]
pub(super) fn advance(controller: &mut Controller, dt: f64, h: f64) -> bool {
    let found = std::arch::is_x86_feature_detected!("avx2");
    if found {
        // SAFETY: it was found.
        unsafe { advance_found(controller, dt, h) };
    }
    found
}

#[target_feature(enable = "avx2")]
fn advance_found(controller: &mut Controller, dt: f64, h: f64) {
    controller.advance_in::<Avx>(dt, h);
}

/// Four DoFs. Only `advance_found` names this type, so that AVX2 was found wherever there is one.
#[derive(Clone, Copy)]
struct Avx(__m256d);

impl Default for Avx {
    #[inline(always)]
    fn default() -> Self {
        // SAFETY: AVX2 was found, as for all that follows.
        Self(unsafe { _mm256_setzero_pd() })
    }
}

impl Add for Avx {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_add_pd(self.0, other.0) })
    }
}

impl Sub for Avx {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_sub_pd(self.0, other.0) })
    }
}

impl Mul<f64> for Avx {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        // SAFETY: see `default`.
        Self(unsafe { _mm256_mul_pd(self.0, _mm256_set1_pd(factor)) })
    }
}

impl Real for Avx {}

impl Register for Avx {
    #[inline(always)]
    fn load(lanes: &Lanes) -> Self {
        // SAFETY: see `default`; lanes are four doubles, aligned to 32 bytes.
        Self(unsafe { _mm256_load_pd(std::ptr::from_ref(lanes).cast()) })
    }

    #[inline(always)]
    fn store(self) -> Lanes {
        let mut lanes = Lanes::default();
        // SAFETY: see `load`.
        unsafe { _mm256_store_pd(std::ptr::from_mut(&mut lanes).cast(), self.0) };
        lanes
    }
}
