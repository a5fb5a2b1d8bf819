//! Transpose of the forcing term: from cotangents of the forcing to those of the style.

use crate::dynamics::forcing_table::{ForcingTable, TableIndex};
use crate::numerics::simd::{F64x4, Real, Register};

/// Adds the cotangents of the value and the slope of a cubic at `t` to those of its coefficients.
#[inline(always)]
pub(crate) fn add_sample<T: Real>(coefficients: [T; 4], t: f64, [value, slope]: [T; 2]) -> [T; 4] {
    let (scaled, twice) = (value * t, slope + slope);
    [
        coefficients[0] + value,
        coefficients[1] + (scaled + slope),
        coefficients[2] + (scaled + twice) * t,
        coefficients[3] + (scaled + (twice + slope)) * (t * t),
    ]
}

impl ForcingTable {
    /// Adds the products of cotangents of coefficients with the coefficients of each style to `sums` (J,), by lanes.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    pub(crate) fn contract<T: Register>(
        &self,
        index: TableIndex,
        group: usize,
        cotangents: &[F64x4; 4],
        sums: &mut [F64x4],
    ) {
        let cubics = self.cubics(index.first, group);
        let [a, b, c, d] = cotangents;
        let [a, b, c, d] = T::load_all([a, b, c, d]);
        for j in 0..cubics.len().min(sums.len()) {
            let [value, slope, square, cube] = cubics[j].load::<T>();
            let product = (value * a + slope * b) + (square * c + cube * d);
            sums[j] = (T::load(&sums[j]) + product).store();
        }
    }
}
