//! A regression read at the knots of a table, as many as a piecewise cubic through them needs.
//!
//! Between knots a cubic is off by h⁴/384·|w⁗| at most, and most in the middle of a cell.

use crate::attractor::Jet;
use crate::basis::Regression;
use crate::error::Result;
use crate::lanes::{Lanes, WIDTH};
use crate::threads::Threads;

/// Error of the table, relative to the largest forcing, at which cells are halved no more.
pub(crate) const TOLERANCE: f64 = 1e-9;
/// Cells of the first table.
const FEWEST_CELLS: usize = 128;
/// Cells beyond which a table is not refined.
pub(crate) const MOST_CELLS: usize = 8192;
/// Knots between two questions whether to go on.
const PORTION: usize = 64;

/// Values and slopes of several outputs at increasing places on the clock, each by rows (places, outputs).
#[derive(Clone, Debug)]
pub(crate) struct Jets {
    pub(crate) n_outputs: usize,
    pub(crate) values: Vec<f64>,
    pub(crate) slopes: Vec<f64>,
}

/// Values and slopes (cells + 1, outputs) at both ends of cells that are halved until their midpoints agree, and the error
/// between the knots, relative to the largest forcing.
///
/// # Errors
/// Whatever `proceed` returns, which is told the share of the finest possible table that is done.
pub(crate) fn tabulate(
    extent: f64,
    n_outputs: usize,
    regression: &dyn Regression,
    threads: Threads,
    proceed: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<(Jets, f64)> {
    let mut done = 0;
    let mut read = |n: usize, at: &(dyn Fn(usize) -> f64 + Sync)| {
        let mut jets = Jets::zeros(n, n_outputs);
        let evaluate = |(portion, (values, slopes)): (usize, (&mut [f64], &mut [f64]))| {
            let rows = values.chunks_exact_mut(n_outputs).zip(slopes.chunks_exact_mut(n_outputs));
            for (k, (value, slope)) in rows.enumerate() {
                regression.evaluate(at(portion * PORTION + k), value, slope);
            }
            Ok(())
        };
        let mut telling = |share: f64| proceed((done as f64 + share * n as f64) / (MOST_CELLS + 1) as f64);
        threads.try_for_each_told(jets.rows_mut(PORTION).enumerate().collect(), evaluate, &mut telling)?;
        done += n;
        Ok(jets)
    };
    let mut knots = read(FEWEST_CELLS + 1, &|k| extent * k as f64 / FEWEST_CELLS as f64)?;
    loop {
        let cells = knots.len() - 1;
        let width = extent / cells as f64;
        let middles = read(cells, &|k| width * (k as f64 + 0.5))?;
        let largest = knots.values.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
        let error = knots.error(&middles, width) / largest;
        // The midpoints are paid for and become knots. That makes the error 16 times smaller where w is smooth, and 8
        // times at a kink of w″, as a Matérn-3/2 process has; a quarter is promised.
        knots = knots.interleaved(&middles);
        let error = if error <= 4.0 * TOLERANCE { error / 4.0 } else { error };
        if error <= TOLERANCE || 2 * cells >= MOST_CELLS {
            return Ok((knots, error));
        }
    }
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
        let [value, slope] = [&self.values, &self.slopes].map(|table| {
            let mut lanes = [0.0; WIDTH];
            lanes[..n].copy_from_slice(&table[place * self.n_outputs + first..][..n]);
            Lanes::new(lanes)
        });
        Jet { value, slope }
    }

    /// Largest distance of the cubics between these knots from the values in the middle of the cells.
    fn error(&self, middles: &Self, width: f64) -> f64 {
        let after = |table: &[f64], at: usize| table[at + self.n_outputs];
        let mut error = 0.0f64;
        for (at, exact) in middles.values.iter().enumerate() {
            let value = self.values[at] + after(&self.values, at);
            let slope = self.slopes[at] - after(&self.slopes, at);
            error = error.max((0.5 * value + width / 8.0 * slope - exact).abs());
        }
        error
    }

    /// These knots with the middles of their cells between them.
    fn interleaved(&self, middles: &Self) -> Self {
        let n_outputs = self.n_outputs;
        let [values, slopes] =
            [(&self.values, &middles.values), (&self.slopes, &middles.slopes)].map(|(knots, middles)| {
                let mut both = Vec::with_capacity(knots.len() + middles.len());
                for (knot, middle) in knots.chunks_exact(n_outputs).zip(middles.chunks_exact(n_outputs)) {
                    both.extend_from_slice(knot);
                    both.extend_from_slice(middle);
                }
                both.extend_from_slice(&knots[knots.len() - n_outputs..]);
                both
            });
        Self { n_outputs, values, slopes }
    }

    /// Makes the last knot of a turn the first, which they are but for rounding.
    pub(crate) fn close(&mut self) {
        let last = self.values.len() - self.n_outputs;
        for table in [&mut self.values, &mut self.slopes] {
            table.copy_within(..self.n_outputs, last);
        }
    }
}
