//! Transport: the moving frame that carries a discrete movement from start to goal.
//!
//! The output system moves about
//!
//! ```text
//! c(u) = y₀ + (g − y₀)·m(u) = g + (g − y₀)·ℓ(u),     ℓ = m − 1,
//! ```
//!
//! and e = y − c obeys the paper's equations, so that y′ = z + w + c′. The profile m rises from 0 at the start to 1 at
//! u_end and stays there. With m ≡ 1 the frame rests at the goal, and these are the paper's equations themselves.
//!
//! A learnt profile is a uniform cubic B-spline: C², non-decreasing as its coefficients are, and constant to second order
//! at both ends, where three coefficients are equal.

use std::ops::Mul;

use crate::dynamics::canonical::Canonical;
use crate::error::{Error, Result};
use crate::numerics::blocks::Block;
use crate::numerics::simd::{Real, Register, WIDTH};

/// Minimum number of cells: three coefficients are 0, three are 1, and at least one lies between them.
pub(crate) const MIN_CELLS: usize = 4;
/// Maximum number of cells of a profile in a model file; it bounds the memory of a forged one.
const MAX_CELLS: usize = 1 << 12;
/// Degree of the B-spline: the surplus of coefficients over cells, and the number of equal coefficients at either end.
pub(crate) const DEGREE: usize = 3;

/// Transport profile m.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Transport {
    /// B-spline coefficients, three more than cells; empty if m ≡ 1.
    coefficients: Vec<f64>,
    /// Width of a cell on the clock.
    width: f64,
    /// Number of cells per unit of the clock.
    cells_per_clock: f64,
    /// Coefficients of ℓ in each cell, in powers of the clock since its first knot.
    cubics: Vec<[f64; 4]>,
}

/// Interval of the clock on which ℓ is one cubic. A control loop keeps it and seldom needs the next one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TransportSegment {
    from: f64,
    to: f64,
    /// Coefficients in powers of u − `from`.
    cubic: [f64; 4],
}

/// Lag ℓ = m − 1 of the frame with its first and second derivative with respect to the clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TransportSample<T = f64> {
    pub(crate) value: T,
    pub(crate) slope: T,
    pub(crate) bend: T,
}

/// Cells of N clocks, and the clocks at their ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TransportCells<const N: usize> {
    cell: [u32; N],
    from: [f64; N],
    to: [f64; N],
}

impl<const N: usize> TransportCells<N> {
    pub(crate) const FIRST: Self = Self { cell: [0; N], from: [0.0; N], to: [f64::INFINITY; N] };

    /// Returns a cell.
    pub(crate) fn get(&self, i: usize) -> usize {
        self.cell[i] as usize
    }

    /// Sets a cell to that of an interval.
    pub(crate) fn set(&mut self, i: usize, segment: &TransportSegment, transport: &Transport) {
        // A profile has far fewer cells.
        self.cell[i] = transport.cell(segment) as u32;
        (self.from[i], self.to[i]) = (segment.from, segment.to);
    }
}

impl<B: Block> TransportSample<B> {
    /// Writes the lanes to arrays of values, slopes and bends from `first` on.
    #[inline(always)]
    fn write_all<const N: usize>(self, [values, slopes, bends]: &mut [&mut [f64; N]; 3], first: usize) {
        self.value.write_all(&mut values[first..]);
        self.slope.write_all(&mut slopes[first..]);
        self.bend.write_all(&mut bends[first..]);
    }
}

impl Transport {
    /// Returns the profile m ≡ 1.
    pub(crate) fn immediate() -> Self {
        Self { coefficients: Vec::new(), width: 1.0, cells_per_clock: 1.0, cubics: Vec::new() }
    }

    /// Returns the profile with the given B-spline coefficients over [0, u_end]; no coefficients mean m ≡ 1.
    ///
    /// # Errors
    /// Coefficients that do not increase from three zeros to three ones, too few or too many of them, or coefficients for
    /// a rhythmic movement.
    pub(crate) fn from_coefficients(coefficients: Vec<f64>, canonical: Canonical) -> Result<Self> {
        let n = coefficients.len();
        if n == 0 {
            return Ok(Self::immediate());
        }
        let Canonical::Discrete { u_end, .. } = canonical else {
            return Err(Error::Argument {
                name: "transport",
                problem: "must be empty: a rhythmic movement has no transport profile",
            });
        };
        let constant = |end: &[f64], value: f64| end.iter().all(|c| *c == value);
        if !(MIN_CELLS + DEGREE..=MAX_CELLS + DEGREE).contains(&n)
            || !constant(&coefficients[..DEGREE], 0.0)
            || !constant(&coefficients[n - DEGREE..], 1.0)
            || !coefficients.windows(2).all(|pair| pair[0] <= pair[1])
        {
            return Err(Error::Argument {
                name: "transport",
                problem: "must increase from 0 to 1 and be constant at both ends",
            });
        }
        let cells = n - DEGREE;
        let width = u_end / cells as f64;
        let scale = 1.0 / width;
        let cubic = |p: &[f64]| {
            let bend = (p[0] - p[1]) + (p[2] - p[1]);
            // The value at the knot is (p₀ + 4p₁ + p₂)/6.
            let value = (p[1] - 1.0) + bend / 6.0;
            let cube = (p[3] - p[0]) + 3.0 * (p[1] - p[2]);
            [value, 0.5 * (p[2] - p[0]) * scale, 0.5 * bend * scale * scale, cube / 6.0 * scale * scale * scale]
        };
        let cubics = coefficients.windows(DEGREE + 1).map(cubic).collect();
        Ok(Self { coefficients, width, cells_per_clock: cells as f64 / u_end, cubics })
    }

    /// Returns the B-spline coefficients; empty if m ≡ 1.
    pub(crate) fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Returns the number of cells; 0 if m ≡ 1.
    pub(crate) fn n_cells(&self) -> usize {
        self.cubics.len()
    }

    /// Returns whether m ≡ 1.
    pub(crate) fn is_immediate(&self) -> bool {
        self.coefficients.is_empty()
    }

    /// Returns the interval that contains clock `u`.
    pub(crate) fn segment_at(&self, u: f64) -> TransportSegment {
        // The cast saturates: a negative clock is evaluated in the first cell.
        self.segment_of_cell((u * self.cells_per_clock) as usize)
    }

    /// Returns the index of the cell of an interval, the number of cells for that past the end.
    pub(crate) fn cell(&self, segment: &TransportSegment) -> usize {
        (segment.from * self.cells_per_clock).round() as usize
    }

    /// Returns the interval of a cell.
    pub(crate) fn segment_of_cell(&self, cell: usize) -> TransportSegment {
        let at = |knot: usize| self.width * knot as f64;
        match self.cubics.get(cell) {
            Some(&cubic) => TransportSegment { from: at(cell), to: at(cell + 1), cubic },
            None => TransportSegment { from: at(self.cubics.len()), to: f64::INFINITY, cubic: [0.0; 4] },
        }
    }

    /// Computes the lags ℓ at clocks `u` and their derivatives. Each clock is in its cell, or has passed on from it to another,
    /// which the cell then is.
    #[inline(always)]
    pub(crate) fn lags_from<B: Block, const N: usize>(
        &self,
        cells: &mut TransportCells<N>,
        u: &[f64; N],
        mut lags: [&mut [f64; N]; 3],
    ) {
        for first in (0..N).step_by(WIDTH) {
            let (now, to) = (B::Group::read_all(&u[first..]), B::Group::read_all(&cells.to[first..]));
            if to.simd_le(now).to_bitmask() != 0 {
                for (i, &u) in u.iter().enumerate().skip(first).take(WIDTH) {
                    if u >= cells.to[i] {
                        cells.set(i, &self.segment_at(u), self);
                    }
                }
            }
        }
        let cubic = |cell: u32| self.cubics.get(cell as usize).unwrap_or(&[0.0; 4]);
        if cells.cell == [cells.cell[0]; N] {
            let &[value, slope, square, cube] = cubic(cells.cell[0]);
            let (cubic, from) =
                ([B::splat(value), B::splat(slope), B::splat(square), B::splat(cube)], B::splat(cells.from[0]));
            for first in (0..N).step_by(B::LANES) {
                sample(&cubic, B::read_all(&u[first..]) - from).write_all(&mut lags, first);
            }
        } else {
            for (first, cell) in (0..N).step_by(WIDTH).zip(cells.cell.as_chunks().0) {
                let &[a, b, c, d]: &[u32; WIDTH] = cell;
                let cubic = B::Group::transpose([
                    B::Group::load_numbers(cubic(a)),
                    B::Group::load_numbers(cubic(b)),
                    B::Group::load_numbers(cubic(c)),
                    B::Group::load_numbers(cubic(d)),
                ]);
                let t = B::Group::read_all(&u[first..]) - B::Group::read_all(&cells.from[first..]);
                sample(&cubic, t).write_all(&mut lags, first);
            }
        }
    }

    /// Returns the lag ℓ at clock `u`.
    pub(crate) fn lag(&self, u: f64) -> TransportSample {
        self.segment_at(u).lag(u)
    }
}

impl TransportSegment {
    /// Returns whether the interval still contains a clock that has advanced to `u`.
    #[inline(always)]
    pub(crate) fn reaches(&self, u: f64) -> bool {
        u < self.to
    }

    /// Returns the lag ℓ at clock `u`.
    #[inline(always)]
    pub(crate) fn lag(&self, u: f64) -> TransportSample {
        sample(&self.cubic, u - self.from)
    }

    /// Returns ℓ‴, which is constant.
    pub(crate) fn third(&self) -> f64 {
        6.0 * self.cubic[3]
    }
}

/// Evaluates a cubic and its derivatives.
#[inline(always)]
fn sample<T: Real + Mul<Output = T>>(&[value, slope, square, cube]: &[T; 4], t: T) -> TransportSample<T> {
    let rest = cube * t;
    let bend = square + rest;
    let twice = bend + bend;
    TransportSample {
        value: value + t * (slope + t * bend),
        slope: slope + t * (twice + rest),
        bend: twice + rest * 4.0f64,
    }
}
