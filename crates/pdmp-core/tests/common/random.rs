//! Random numbers of the tests.
#![allow(dead_code)]

/// Linear congruential generator of numbers in [0, 1) (Knuth's MMIX).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn rarely(&mut self) -> bool {
        self.next() < 0.2
    }

    pub(crate) fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.next()
    }

    /// Returns a number between `a` and `b`, uniform in its logarithm.
    pub(crate) fn scale(&mut self, a: f64, b: f64) -> f64 {
        a * (b / a).powf(self.next())
    }
}
