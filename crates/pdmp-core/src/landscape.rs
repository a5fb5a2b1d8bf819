//! The attractor landscape, compiled to a table that is read in constant time.
//!
//! Whatever regression learnt it, the forcing of each style dimension and DoF is stored as a piecewise cubic (Hermite)
//! on a uniform grid of the clock. Between knots a cubic is off by h⁴/384·|w⁗| at most, and most in the middle of a cell.

use std::f64::consts::TAU;

use ndarray::{Array2, aview1};

use crate::basis::Regression;
use crate::demo::zeros;
use crate::error::Result;
use crate::phase::Canonical;

/// Error of the table, relative to the largest forcing, at which cells are halved no more.
const TOLERANCE: f64 = 1e-9;
/// Cells of the first table.
const FEWEST_CELLS: usize = 128;
/// Cells beyond which a table is not refined.
pub(crate) const MOST_CELLS: usize = 8192;
/// Knots between two questions whether to go on.
const PORTION: usize = 64;

/// Forcing w of unit styles over the clock: discrete x·b(x; W), rhythmic b(φ; W).
#[derive(Clone, Debug, PartialEq)]
pub struct Landscape {
    canonical: Canonical,
    n_outputs: usize,
    /// Values at the knots (cells + 1, J·D) by rows, in the unit of each DoF.
    values: Vec<f64>,
    /// Slopes with respect to the clock at the knots (cells + 1, J·D) by rows.
    slopes: Vec<f64>,
    /// Largest error found in the middle of a cell, relative to the largest forcing.
    error: f64,
}

impl Landscape {
    /// Tabulates a regression, halving the cells until their midpoints agree.
    ///
    /// # Errors
    /// Whatever `proceed` returns, which is told the share of the finest possible table that is done.
    pub(crate) fn compile(
        canonical: Canonical,
        n_outputs: usize,
        regression: &dyn Regression,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Self> {
        let extent = canonical.extent();
        let mut done = 0;
        let mut tabulate = |n: usize, at: &dyn Fn(usize) -> f64| {
            let (mut values, mut slopes) = (zeros("landscape", (n, n_outputs))?, zeros("landscape", (n, n_outputs))?);
            let (mut value, mut slope) = (vec![0.0; n_outputs], vec![0.0; n_outputs]);
            for k in 0..n {
                if k % PORTION == 0 {
                    proceed(done as f64 / (MOST_CELLS + 1) as f64)?;
                }
                regression.evaluate(at(k), &mut value, &mut slope);
                values.row_mut(k).assign(&aview1(&value));
                slopes.row_mut(k).assign(&aview1(&slope));
                done += 1;
            }
            Ok((values, slopes))
        };
        let mut knots = tabulate(FEWEST_CELLS + 1, &|k| extent * k as f64 / FEWEST_CELLS as f64)?;
        loop {
            let (values, slopes) = &knots;
            let cells = values.nrows() - 1;
            let width = extent / cells as f64;
            let middles = tabulate(cells, &|k| width * (k as f64 + 0.5))?;
            let largest = values.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
            let mut error = 0.0f64;
            for ((k, o), exact) in middles.0.indexed_iter() {
                let cubic =
                    0.5 * (values[[k, o]] + values[[k + 1, o]]) + width / 8.0 * (slopes[[k, o]] - slopes[[k + 1, o]]);
                error = error.max((cubic - exact).abs() / largest);
            }
            // The midpoints are paid for: they become knots, and what was measured bounds the finer table.
            knots = (interleave(values, &middles.0), interleave(slopes, &middles.1));
            if error <= TOLERANCE || 2 * cells >= MOST_CELLS {
                let (mut values, mut slopes) = knots;
                if let Canonical::Rhythmic { .. } = canonical {
                    close(&mut values);
                    close(&mut slopes);
                }
                return Ok(Self::from_knots(canonical, values, slopes, error));
            }
        }
    }

    /// A table from values and slopes at its knots, two arrays of one shape with two rows at least.
    pub(crate) fn from_knots(canonical: Canonical, values: Array2<f64>, slopes: Array2<f64>, error: f64) -> Self {
        let n_outputs = values.ncols();
        let by_rows = |knots: Array2<f64>| knots.as_standard_layout().iter().copied().collect();
        Self { canonical, n_outputs, values: by_rows(values), slopes: by_rows(slopes), error }
    }

    /// The canonical system whose clock the table is read at.
    pub fn canonical(&self) -> Canonical {
        self.canonical
    }

    /// Largest error measured in the middle of the cells, relative to the largest forcing, before the cells were halved
    /// once more: 1e-9 at most where 8192 cells suffice.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Values and slopes at the knots, each (cells + 1, J·D) by rows.
    pub(crate) fn knots(&self) -> (&[f64], &[f64]) {
        (&self.values, &self.slopes)
    }

    /// Number of outputs J·D.
    pub fn n_outputs(&self) -> usize {
        self.n_outputs
    }

    /// Number of cells of the table.
    pub fn cells(&self) -> usize {
        self.values.len() / self.n_outputs - 1
    }

    /// The forcing of all J·D outputs and its slope with respect to the clock.
    ///
    /// Past the end of a discrete movement it fades with the phase, w(u) = w(u_end)·x(u)/x(u_end).
    pub fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        match self.canonical {
            Canonical::Discrete { alpha_x, u_end } if u >= u_end => {
                let fade = (-alpha_x * (u - u_end)).exp();
                let last = self.row(&self.values, self.cells());
                for ((value, slope), &end) in value.iter_mut().zip(slope).zip(last) {
                    *value = fade * end;
                    *slope = -alpha_x * *value;
                }
            }
            Canonical::Discrete { .. } => self.read(u, value, slope),
            Canonical::Rhythmic { .. } => self.read(u.rem_euclid(TAU), value, slope),
        }
    }

    /// Reads the table, which at u_end gives the slope of the demonstrated side.
    pub(crate) fn read(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        let cells = self.cells();
        let position = u / self.canonical.extent() * cells as f64;
        // A saturating cast: what lies below the table reads its first cell, what lies above its last.
        let cell = (position as usize).min(cells - 1);
        let (x, width) = (position - cell as f64, self.canonical.extent() / cells as f64);
        let (v0, v1) = (self.row(&self.values, cell), self.row(&self.values, cell + 1));
        let (s0, s1) = (self.row(&self.slopes, cell), self.row(&self.slopes, cell + 1));
        for o in 0..v0.len() {
            // p(x) = v0 + x(m0 + x(c + xd)) with p(1) = v1 and p'(1) = m1.
            let (m0, m1, rise) = (width * s0[o], width * s1[o], v1[o] - v0[o]);
            let (c, d) = (3.0 * rise - 2.0 * m0 - m1, m0 + m1 - 2.0 * rise);
            value[o] = v0[o] + x * (m0 + x * (c + x * d));
            slope[o] = (m0 + x * (2.0 * c + 3.0 * x * d)) / width;
        }
    }

    fn row<'a>(&self, knots: &'a [f64], k: usize) -> &'a [f64] {
        &knots[k * self.n_outputs..(k + 1) * self.n_outputs]
    }
}

/// Rows of `knots` with those of `middles` between them.
fn interleave(knots: &Array2<f64>, middles: &Array2<f64>) -> Array2<f64> {
    Array2::from_shape_fn((knots.nrows() + middles.nrows(), knots.ncols()), |(k, o)| {
        if k % 2 == 0 { knots[[k / 2, o]] } else { middles[[k / 2, o]] }
    })
}

/// Makes the last knot of a turn the first, which they are but for rounding.
fn close(knots: &mut Array2<f64>) {
    let first = knots.row(0).to_owned();
    let last = knots.nrows() - 1;
    knots.row_mut(last).assign(&first);
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let table = Landscape::compile(canonical, 3, &regression, &mut |_| Ok(())).unwrap();
            assert!(table.error() <= TOLERANCE);
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

    /// Past the demonstrated end the forcing is continuous and fades with the phase.
    #[test]
    fn forcing_fades_with_the_phase_after_the_end() {
        let canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
        let table = Landscape::compile(canonical, 1, &Waves(9.0), &mut |_| Ok(())).unwrap();
        let at = |u: f64| {
            let (mut value, mut slope) = ([0.0], [0.0]);
            table.evaluate(u, &mut value, &mut slope);
            value[0]
        };
        assert!((at(1.0) - at(1.0 - 1e-12)).abs() < 1e-10);
        assert!((at(1.7) / at(1.0) - canonical.phase(1.7) / canonical.phase(1.0)).abs() < 1e-14);
    }
}
