//! Values and slopes at the knots of a table.

use crate::dynamics::output_system::Jet;
use crate::numerics::simd::{Lanes, padded};

/// Error of the table, relative to the largest forcing, at which cells are halved no more.
pub(crate) const TOLERANCE: f64 = 1e-9;
/// Cells beyond which a table is not refined.
pub(crate) const MOST_CELLS: usize = 8192;

/// Values and slopes of several outputs at increasing places on the clock, each by rows (places, outputs).
#[derive(Clone, Debug)]
pub(crate) struct Jets {
    pub(crate) n_outputs: usize,
    pub(crate) values: Vec<f64>,
    pub(crate) slopes: Vec<f64>,
}

impl Jets {
    /// Room for `n` places.
    pub(crate) fn zeros(n: usize, n_outputs: usize) -> Self {
        let [values, slopes] = [0, 1].map(|_| vec![0.0; n * n_outputs]);
        Self { n_outputs, values, slopes }
    }

    /// Number of places.
    pub(crate) fn len(&self) -> usize {
        self.values.len() / self.n_outputs
    }

    /// Values and slopes of `n` places at a time.
    pub(crate) fn rows_mut(&mut self, n: usize) -> impl Iterator<Item = (&mut [f64], &mut [f64])> {
        let size = n * self.n_outputs;
        self.values.chunks_mut(size).zip(self.slopes.chunks_mut(size))
    }

    /// Up to four outputs at a place.
    pub(crate) fn jet(&self, place: usize, first: usize, n: usize) -> Jet<Lanes> {
        let [value, slope] =
            [&self.values, &self.slopes].map(|table| padded(&table[place * self.n_outputs + first..][..n]));
        Jet { value, slope }
    }

    /// These knots with room for the middles of their cells between them.
    pub(crate) fn spread(&self) -> Self {
        let mut spread = Self::zeros(2 * self.len() - 1, self.n_outputs);
        for (to, from) in [(&mut spread.values, &self.values), (&mut spread.slopes, &self.slopes)] {
            let rows = to.chunks_exact_mut(self.n_outputs).step_by(2);
            rows.zip(from.chunks_exact(self.n_outputs)).for_each(|(to, from)| to.copy_from_slice(from));
        }
        spread
    }

    /// Largest distance of the cubics between every second knot from the value at the knot between them, `width` from
    /// either.
    pub(crate) fn error_of_every_second(&self, width: f64) -> f64 {
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

    /// Makes the last knot of a turn the first, which they are but for rounding.
    pub(crate) fn close(&mut self) {
        let last = self.values.len() - self.n_outputs;
        for table in [&mut self.values, &mut self.slopes] {
            table.copy_within(..self.n_outputs, last);
        }
    }
}
