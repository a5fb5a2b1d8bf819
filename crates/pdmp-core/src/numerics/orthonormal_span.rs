//! Span of vectors by an orthonormal basis (Gram–Schmidt).

use ndarray::{Array1, ArrayView1};

/// Smallest norm of a vector orthogonal to those before it, relative to its largest element, that exceeds rounding.
const ROUNDING: f64 = 1e-9;

/// Orthonormal basis of the vectors added so far.
#[derive(Default)]
pub(crate) struct OrthonormalSpan(pub(crate) Vec<Array1<f64>>);

impl OrthonormalSpan {
    /// Adds a vector, unless it depends linearly on those before.
    pub(crate) fn add(&mut self, vector: ArrayView1<f64>) {
        let scale = vector.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        if scale == 0.0 {
            return;
        }
        let rest = self.rest((&vector / scale).view());
        let size = rest.dot(&rest).sqrt();
        if size > ROUNDING {
            self.0.push(rest / size);
        }
    }

    /// Returns the part of a vector that is orthogonal to the basis; projected twice, to full accuracy.
    pub(crate) fn rest(&self, vector: ArrayView1<f64>) -> Array1<f64> {
        let mut rest = vector.to_owned();
        for unit in self.0.iter().chain(&self.0) {
            let share = unit.dot(&rest);
            rest.scaled_add(-share, unit);
        }
        rest
    }
}
