//! Hermite data of a table of cubics: values and slopes at its knots.

use crate::dynamics::output_system::CubicSample;
use crate::numerics::simd::{F64x4, padded};

/// Error of the table, relative to the largest forcing, at which the refinement stops.
pub(crate) const TOLERANCE: f64 = 1e-9;
/// Maximum number of cells of a table.
pub(crate) const MAX_CELLS: usize = 8192;

/// Values and slopes of several outputs at equidistant knots of the clock, each by rows (knots, outputs).
#[derive(Clone, Debug)]
pub(crate) struct KnotTable {
    pub(crate) n_outputs: usize,
    pub(crate) values: Vec<f64>,
    pub(crate) slopes: Vec<f64>,
}

impl KnotTable {
    /// Returns a table of `n` knots, filled with zeros.
    pub(crate) fn zeros(n: usize, n_outputs: usize) -> Self {
        let [values, slopes] = [0, 1].map(|_| vec![0.0; n * n_outputs]);
        Self { n_outputs, values, slopes }
    }

    /// Returns the number of knots.
    pub(crate) fn len(&self) -> usize {
        self.values.len() / self.n_outputs
    }

    /// Returns the values and slopes of consecutive blocks of `n` knots, mutably.
    pub(crate) fn rows_mut(&mut self, n: usize) -> impl Iterator<Item = (&mut [f64], &mut [f64])> {
        let size = n * self.n_outputs;
        self.values.chunks_mut(size).zip(self.slopes.chunks_mut(size))
    }

    /// Returns value and slope of the `n` outputs from `first` on at a knot, four at most.
    pub(crate) fn jet(&self, knot: usize, first: usize, n: usize) -> CubicSample<F64x4> {
        let [value, slope] =
            [&self.values, &self.slopes].map(|table| padded(&table[knot * self.n_outputs + first..][..n]));
        CubicSample { value, slope }
    }

    /// Returns a table with a knot, filled with zeros, inserted in the middle of each cell.
    pub(crate) fn spread(&self) -> Self {
        let mut finer = Self::zeros(2 * self.len() - 1, self.n_outputs);
        for (to, from) in [(&mut finer.values, &self.values), (&mut finer.slopes, &self.slopes)] {
            let rows = to.chunks_exact_mut(self.n_outputs).step_by(2);
            rows.zip(from.chunks_exact(self.n_outputs)).for_each(|(to, from)| to.copy_from_slice(from));
        }
        finer
    }

    /// Returns the largest deviation of the cubics over every second knot from the values at the knots between them;
    /// `width` is the distance of neighbouring knots.
    pub(crate) fn midpoint_error(&self, width: f64) -> f64 {
        let n = self.n_outputs;
        let cells = self.values.windows(3 * n).zip(self.slopes.windows(3 * n)).step_by(2 * n);
        let mut error = 0.0f64;
        for (values, slopes) in cells {
            for o in 0..n {
                let cubic = 0.5 * (values[o] + values[2 * n + o]) + 0.25 * width * (slopes[o] - slopes[2 * n + o]);
                error = error.max((cubic - values[n + o]).abs());
            }
        }
        error
    }

    /// Copies the first knot to the last one, which equals it up to rounding in a periodic table.
    pub(crate) fn close(&mut self) {
        let last = self.values.len() - self.n_outputs;
        for table in [&mut self.values, &mut self.slopes] {
            table.copy_within(..self.n_outputs, last);
        }
    }
}
