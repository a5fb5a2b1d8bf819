//! A regression read at the knots of a table, as many as a piecewise cubic through them needs.
//!
//! Between knots a cubic is off by h⁴/384·|w⁗| at most, and most in the middle of a cell. A Matérn process is smooth
//! between its samples and has a kink at each: where all samples are knots, a cell or two from one to the next suffice.

use crate::dynamics::canonical::Canonical;
use crate::dynamics::forcing_table::ForcingTable;
use crate::dynamics::hermite_table::{KnotTable, MAX_CELLS, TOLERANCE};
use crate::error::Result;
use crate::learning::regression::Regression;
use crate::numerics::threads::Threads;

/// Fewest cells of the first table.
const MIN_CELLS: usize = 128;
/// Knots between two questions whether to go on, which one thread reads.
const PORTION: usize = 1024;
/// Knots that are read at once.
const BLOCK: usize = 64;

/// Compiles a regression of J·D outputs on so many samples.
///
/// # Errors
/// Whatever `progress` returns, which is told the share of the finest possible table that is done.
pub(super) fn compile(
    canonical: Canonical,
    (n_styles, n_dofs): (usize, usize),
    n_samples: usize,
    regression: &dyn Regression,
    threads: Threads,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<ForcingTable> {
    let steps = canonical.kind().steps(n_samples);
    let (mut knots, error) = tabulate(canonical.extent(), steps, n_styles * n_dofs, regression, threads, progress)?;
    if let Canonical::Rhythmic { .. } = canonical {
        knots.close();
    }
    Ok(ForcingTable::from_knots(canonical, n_dofs, &knots, error))
}

/// Values and slopes (cells + 1, outputs) at both ends of cells that are halved until their midpoints agree, and the error
/// between the knots, relative to the largest forcing. What was learnt from samples at equal `steps` is read there too.
///
/// # Errors
/// Whatever `progress` returns, which is told the share of the finest possible table that is done.
fn tabulate(
    extent: f64,
    steps: usize,
    n_outputs: usize,
    regression: &dyn Regression,
    threads: Threads,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<(KnotTable, f64)> {
    let mut done = 0;
    // Reads the rows of `jets` from one to the next in steps, the place of each being a multiple of the width.
    let mut read = |jets: &mut KnotTable, (first, step): (usize, usize), width: f64| {
        let n = (jets.len() - first).div_ceil(step);
        let scratch = || (Vec::with_capacity(BLOCK), KnotTable::zeros(BLOCK, n_outputs));
        let evaluate = |(u, jets): &mut (Vec<f64>, KnotTable), (portion, rows): (usize, (&mut [f64], &mut [f64]))| {
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
        let mut telling = |share: f64| progress((done as f64 + share * n as f64) / (MAX_CELLS + 1) as f64);
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
    let mut knots = KnotTable::zeros(cells + 1, n_outputs);
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
        if 2 * cells > MAX_CELLS {
            return Ok((finer, error));
        }
        knots = finer;
    }
}

/// Cells of the first table, whose halves have a knot at every sample sooner or later, if a table can.
fn coarsest(steps: usize) -> usize {
    let mut cells = steps >> steps.trailing_zeros();
    if 2 * cells > MAX_CELLS {
        return MIN_CELLS;
    }
    while cells < MIN_CELLS {
        cells *= 2;
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::hermite_table::TOLERANCE;

    #[derive(Debug)]
    struct Waves(f64);

    impl Regression for Waves {
        fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
            for (o, (value, slope)) in value.iter_mut().zip(slope).enumerate() {
                let omega = self.0 * (o + 1) as f64;
                (*value, *slope) = ((omega * u).sin(), omega * (omega * u).cos());
            }
        }

        fn describe(&self) -> String {
            "waves".into()
        }
    }

    /// Nowhere between the knots is the table further from the regression than the error it states.
    #[test]
    fn stated_error_bounds_the_table() {
        for (canonical, omega) in
            [(Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 }, 9.0), (Canonical::Rhythmic { mu: 1.0 }, 5.0)]
        {
            let regression = Waves(omega);
            let table = compile(canonical, (1, 3), 2, &regression, Threads::ONE, &mut |_| Ok(())).unwrap();
            assert!(table.error() <= TOLERANCE);
            assert_eq!(table.n_outputs(), 3);
            let (mut value, mut slope, mut exact, mut rise) = ([0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]);
            for k in 0..10_007 {
                let u = canonical.extent() * f64::from(k) / 10_007.0;
                table.evaluate(u, &mut value, &mut slope);
                regression.evaluate(u, &mut exact, &mut rise);
                for o in 0..3 {
                    assert!((value[o] - exact[o]).abs() <= table.error() + 1e-13);
                    assert!((slope[o] - rise[o]).abs() <= 1e-4 * rise[o].abs().max(1.0));
                }
            }
        }
    }

    /// Cubics of values and slopes are off by (ωh)⁴/384: four times the frequency takes four times the cells.
    #[test]
    fn cells_are_as_many_as_the_error_needs() {
        let canonical = Canonical::Rhythmic { mu: 1.0 };
        let [slow, fast] = [5.0, 20.0]
            .map(|omega| compile(canonical, (1, 1), 1, &Waves(omega), Threads::ONE, &mut |_| Ok(())).unwrap().cells());
        assert_eq!(fast, 4 * slow);
        let width = canonical.extent() / slow as f64;
        assert!((5.0 * width).powi(4) / 384.0 < TOLERANCE);
    }

    #[derive(Debug)]
    struct Kink(f64);

    impl Regression for Kink {
        fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
            let d = u - self.0;
            (value[0], slope[0]) = (d.abs().powi(3), 3.0 * d * d.abs());
        }

        fn describe(&self) -> String {
            "kink".into()
        }
    }

    /// Where the third derivative jumps, wherever that lies in its cell, the table is about as close as it is to be.
    #[test]
    fn table_is_close_at_a_kink() {
        for k in 0..100 {
            let kink = Kink((0.5f64.sqrt() + f64::from(k) * 0.618_033_988_75).fract());
            let canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
            let table = compile(canonical, (1, 1), 2, &kink, Threads::ONE, &mut |_| Ok(())).unwrap();
            for u in (0..=400).map(|i| kink.0 + 1e-5 * f64::from(i - 200)).filter(|u| (0.0..1.0).contains(u)) {
                let (mut value, mut slope, mut exact, mut rise) = ([0.0], [0.0], [0.0], [0.0]);
                table.evaluate(u, &mut value, &mut slope);
                kink.evaluate(u, &mut exact, &mut rise);
                assert!((value[0] - exact[0]).abs() <= 2.0 * TOLERANCE, "{k}: {:e}", value[0] - exact[0]);
            }
        }
    }

    /// Where it jumps at a sample, as a Matérn process does, the cubics on either side are exact.
    #[test]
    fn table_is_coarse_where_kinks_are_at_samples() {
        let canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
        let cells = |n_samples| {
            compile(canonical, (1, 1), n_samples, &Kink(0.3), Threads::ONE, &mut |_| Ok(())).unwrap().cells()
        };
        assert!(cells(11) == 160 && cells(12) > 600, "{} {}", cells(11), cells(12));
    }

    /// Past the demonstrated end the forcing is continuous and fades with the phase.
    #[test]
    fn forcing_fades_with_the_phase_after_the_end() {
        let canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
        let table = compile(canonical, (1, 1), 2, &Waves(9.0), Threads::ONE, &mut |_| Ok(())).unwrap();
        let at = |u: f64| {
            let (mut value, mut slope) = ([0.0], [0.0]);
            table.evaluate(u, &mut value, &mut slope);
            value[0]
        };
        assert!((at(1.0) - at(1.0 - 1e-12)).abs() < 1e-10);
        assert!((at(1.7) / at(1.0) - canonical.phase(1.7) / canonical.phase(1.0)).abs() < 1e-14);
    }
}
