//! A regression read at the knots of a table, as many as a piecewise cubic through them needs.
//!
//! Between knots a cubic is off by h⁴/384·|w⁗| at most, and most in the middle of a cell. A Matérn process is smooth
//! between its samples and has a kink at each: where all samples are knots, a cell or two from one to the next suffice.

use crate::attractor::Jet;
use crate::basis::Regression;
use crate::error::Result;
use crate::lanes::{Lanes, padded};
use crate::threads::Threads;

/// Error of the table, relative to the largest forcing, at which cells are halved no more.
pub(crate) const TOLERANCE: f64 = 1e-9;
/// Fewest cells of the first table.
const FEWEST_CELLS: usize = 128;
/// Cells beyond which a table is not refined.
pub(crate) const MOST_CELLS: usize = 8192;
/// Knots between two questions whether to go on, which one thread reads.
const PORTION: usize = 1024;
/// Knots that are read at once.
const BLOCK: usize = 64;

/// Values and slopes of several outputs at increasing places on the clock, each by rows (places, outputs).
#[derive(Clone, Debug)]
pub(crate) struct Jets {
    pub(crate) n_outputs: usize,
    pub(crate) values: Vec<f64>,
    pub(crate) slopes: Vec<f64>,
}

/// Values and slopes (cells + 1, outputs) at both ends of cells that are halved until their midpoints agree, and the error
/// between the knots, relative to the largest forcing. What was learnt from samples at equal `steps` is read there too.
///
/// # Errors
/// Whatever `proceed` returns, which is told the share of the finest possible table that is done.
pub(crate) fn tabulate(
    extent: f64,
    steps: usize,
    n_outputs: usize,
    regression: &dyn Regression,
    threads: Threads,
    proceed: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<(Jets, f64)> {
    let mut done = 0;
    // Reads the rows of `jets` from one to the next in steps, the place of each being a multiple of the width.
    let mut read = |jets: &mut Jets, (first, step): (usize, usize), width: f64| {
        let n = (jets.len() - first).div_ceil(step);
        let scratch = || (Vec::with_capacity(BLOCK), Jets::zeros(BLOCK, n_outputs));
        let evaluate = |(u, jets): &mut (Vec<f64>, Jets), (portion, rows): (usize, (&mut [f64], &mut [f64]))| {
            let size = step * BLOCK * n_outputs;
            let blocks = rows.0.chunks_mut(size).zip(rows.1.chunks_mut(size));
            for (block, (values, slopes)) in blocks.enumerate() {
                let places = (0..values.len() / n_outputs).skip(first).step_by(step);
                u.clear();
                u.extend(places.map(|k| width * ((portion * PORTION + block * BLOCK) * step + k) as f64));
                let size = u.len() * n_outputs;
                regression.evaluate_all(u, &mut jets.values[..size], &mut jets.slopes[..size]);
                for (rows, numbers) in [(values, &jets.values), (slopes, &jets.slopes)] {
                    let rows = rows.chunks_exact_mut(n_outputs).skip(first).step_by(step);
                    rows.zip(numbers.chunks_exact(n_outputs)).for_each(|(row, numbers)| row.copy_from_slice(numbers));
                }
            }
            Ok(())
        };
        let mut telling = |share: f64| proceed((done as f64 + share * n as f64) / (MOST_CELLS + 1) as f64);
        threads.try_for_each_told(
            jets.rows_mut(step * PORTION).enumerate().collect(),
            scratch,
            evaluate,
            &mut telling,
        )?;
        done += n;
        Ok(())
    };
    let mut cells = coarsest(steps);
    let mut knots = Jets::zeros(cells + 1, n_outputs);
    read(&mut knots, (0, 1), extent / cells as f64)?;
    loop {
        let largest = knots.values.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
        // The midpoints are paid for and become knots, unless they are not needed.
        let mut finer = knots.spread();
        cells *= 2;
        read(&mut finer, (1, 2), extent / cells as f64)?;
        let error = finer.error_of_every_second(extent / cells as f64) / largest;
        if error <= TOLERANCE {
            return Ok((knots, error));
        }
        // Halving makes the error 16 times smaller where w is smooth, and 8 times at a kink of w″ as a Matérn-3/2
        // process has; a quarter is promised.
        if error <= 4.0 * TOLERANCE {
            return Ok((finer, error / 4.0));
        }
        if 2 * cells > MOST_CELLS {
            return Ok((finer, error));
        }
        knots = finer;
    }
}

/// Cells of the first table, whose halves have a knot at every sample sooner or later, if a table can.
fn coarsest(steps: usize) -> usize {
    let mut cells = steps >> steps.trailing_zeros();
    if 2 * cells > MOST_CELLS {
        return FEWEST_CELLS;
    }
    while cells < FEWEST_CELLS {
        cells *= 2;
    }
    cells
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
    fn spread(&self) -> Self {
        let mut spread = Self::zeros(2 * self.len() - 1, self.n_outputs);
        for (to, from) in [(&mut spread.values, &self.values), (&mut spread.slopes, &self.slopes)] {
            let rows = to.chunks_exact_mut(self.n_outputs).step_by(2);
            rows.zip(from.chunks_exact(self.n_outputs)).for_each(|(to, from)| to.copy_from_slice(from));
        }
        spread
    }

    /// Largest distance of the cubics between every second knot from the value at the knot between them, `width` from
    /// either.
    fn error_of_every_second(&self, width: f64) -> f64 {
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
