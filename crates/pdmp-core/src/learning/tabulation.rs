//! Adaptive tabulation of a regression for piecewise cubic Hermite interpolation.
//!
//! The interpolation error is at most h⁴/384·|w⁗|, and largest at the midpoint of a cell. A Matérn process is smooth
//! between its samples and has a kink at each: where all samples are knots, one or two cells between samples suffice.

use crate::dynamics::canonical::Canonical;
use crate::dynamics::forcing_table::ForcingTable;
use crate::dynamics::hermite_table::{KnotTable, MAX_CELLS, TOLERANCE};
use crate::error::Result;
use crate::learning::regression::Regression;
use crate::numerics::threads::Threads;

/// Smallest number of cells of the first table.
const MIN_CELLS: usize = 128;
/// Knots that a thread evaluates between two progress reports.
const PORTION: usize = 1024;
/// Knots that are evaluated together.
const BLOCK: usize = 64;

/// Compiles a regression with J·D outputs, fitted to `n_samples` samples, to a table.
///
/// `progress` is called periodically with the completed fraction of the finest possible table.
///
/// # Errors
/// The error that `progress` returned.
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

/// Returns values and slopes (cells + 1, outputs) at the ends of equal cells, and the interpolation error relative to the
/// largest value.
///
/// Cells are halved until interpolation matches the regression at their midpoints. The samples, at the ends of `steps`
/// equal steps, become knots, if the largest number of cells allows.
///
/// # Errors
/// The error that `progress` returned.
fn tabulate(
    extent: f64,
    steps: usize,
    n_outputs: usize,
    regression: &dyn Regression,
    threads: Threads,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<(KnotTable, f64)> {
    let mut done = 0;
    // Evaluates every `step`-th row of the knots from `first` on; row k lies at k times the width.
    let mut evaluate_rows = |knots: &mut KnotTable, (first, step): (usize, usize), width: f64| {
        let n = (knots.len() - first).div_ceil(step);
        let scratch = || (Vec::with_capacity(BLOCK), KnotTable::zeros(BLOCK, n_outputs));
        let evaluate = |(u, buffer): &mut (Vec<f64>, KnotTable), (portion, rows): (usize, (&mut [f64], &mut [f64]))| {
            let size = step * BLOCK * n_outputs;
            let blocks = rows.0.chunks_mut(size).zip(rows.1.chunks_mut(size));
            for (block, (values, slopes)) in blocks.enumerate() {
                let rows = (0..values.len() / n_outputs).skip(first).step_by(step);
                u.clear();
                u.extend(rows.map(|k| width * ((portion * PORTION + block * BLOCK) * step + k) as f64));
                let size = u.len() * n_outputs;
                regression.evaluate_all(u, &mut buffer.values[..size], &mut buffer.slopes[..size]);
                for (rows, numbers) in [(values, &buffer.values), (slopes, &buffer.slopes)] {
                    let rows = rows.chunks_exact_mut(n_outputs).skip(first).step_by(step);
                    rows.zip(numbers.chunks_exact(n_outputs)).for_each(|(row, numbers)| row.copy_from_slice(numbers));
                }
            }
            Ok(())
        };
        let mut reporting = |share: f64| progress((done as f64 + share * n as f64) / (MAX_CELLS + 1) as f64);
        threads.try_for_each_with_progress(
            knots.rows_mut(step * PORTION).enumerate().collect(),
            scratch,
            evaluate,
            &mut reporting,
        )?;
        done += n;
        Ok(())
    };
    let mut cells = first_cells(steps);
    let mut knots = KnotTable::zeros(cells + 1, n_outputs);
    evaluate_rows(&mut knots, (0, 1), extent / cells as f64)?;
    loop {
        let largest = knots.values.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
        // The midpoints, once evaluated, become knots unless the coarser table suffices.
        let mut finer = knots.spread();
        cells *= 2;
        evaluate_rows(&mut finer, (1, 2), extent / cells as f64)?;
        let error = finer.midpoint_error(extent / cells as f64) / largest;
        if error <= TOLERANCE {
            return Ok((knots, error));
        }
        // Halving reduces the error by a factor of 16 where w is smooth, and of 8 at a kink of w″, as a Matérn-3/2 process
        // has; a factor of 4 is claimed.
        if error <= 4.0 * TOLERANCE {
            return Ok((finer, error / 4.0));
        }
        if 2 * cells > MAX_CELLS {
            return Ok((finer, error));
        }
        knots = finer;
    }
}

/// Returns the number of cells of the first table, such that repeated halving puts a knot at every sample if possible.
fn first_cells(steps: usize) -> usize {
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

    /// The stated error bounds the difference between table and regression everywhere.
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

    /// A jump of the third derivative anywhere in a cell does not increase the error beyond twice the tolerance.
    #[test]
    fn table_is_accurate_at_a_kink() {
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

    /// With kinks at samples, as of a Matérn process, the cubics on either side are exact.
    #[test]
    fn table_is_coarse_where_kinks_are_at_samples() {
        let canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
        let cells = |n_samples| {
            compile(canonical, (1, 1), n_samples, &Kink(0.3), Threads::ONE, &mut |_| Ok(())).unwrap().cells()
        };
        assert!(cells(11) == 160 && cells(12) > 600, "{} {}", cells(11), cells(12));
    }

    /// After the demonstrated end the forcing is continuous and decays with the phase.
    #[test]
    fn forcing_decays_with_the_phase_after_the_end() {
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
