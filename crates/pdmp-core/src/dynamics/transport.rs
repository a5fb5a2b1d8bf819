//! Transport of start and goal: the moving frame of a discrete movement.
//!
//! The output system moves about
//!
//! ```text
//! c(u) = y₀ + (g − y₀)·m(u) = g + (g − y₀)·ℓ(u),     ℓ = m − 1,
//! ```
//!
//! and e = y − c obeys the paper's equations, so that y′ = z + w + c′. The profile m rises from 0 at the start to 1 at
//! u_end and stays there. With m ≡ 1 the frame stands on the goal, and these are the paper's equations themselves.
//!
//! A learnt profile is a uniform cubic B-spline: C², increasing where its coefficients increase, and level where three of
//! them are equal, as they are at both ends.

use crate::dynamics::canonical::Canonical;
use crate::error::{Error, Result};

/// Fewest cells: three coefficients lie on either level, and one between.
pub(crate) const MIN_CELLS: usize = 4;
/// Most cells that are read from a file.
const MAX_CELLS: usize = 1 << 12;
/// Coefficients more than there are cells, and how many of them are level at either end.
pub(crate) const DEGREE: usize = 3;

/// The profile m.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Transport {
    /// Coefficients of the B-spline, three more than there are cells; none where m ≡ 1.
    coefficients: Vec<f64>,
    /// Width of a cell, and how many there are per unit of the clock.
    width: f64,
    per_clock: f64,
    /// Cubics of ℓ in each cell, over the clock from its first knot on.
    cubics: Vec<[f64; 4]>,
}

/// A stretch of the clock on which ℓ is one cubic. Whoever reads ℓ at a clock that runs seeks a new one seldom.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    from: f64,
    to: f64,
    /// Coefficients over the clock from `from` on.
    cubic: [f64; 4],
}

/// ℓ = m − 1 with its first and second derivative with respect to the clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Lag {
    pub(crate) value: f64,
    pub(crate) slope: f64,
    pub(crate) bend: f64,
}

impl Transport {
    /// m ≡ 1.
    pub(crate) fn immediate() -> Self {
        Self { coefficients: Vec::new(), width: 1.0, per_clock: 1.0, cubics: Vec::new() }
    }

    /// The profile with these coefficients, if there are any, over a movement that ends at `u_end`.
    ///
    /// # Errors
    /// Coefficients that are not those of a profile.
    pub(crate) fn from_coefficients(coefficients: Vec<f64>, canonical: Canonical) -> Result<Self> {
        let n = coefficients.len();
        if n == 0 {
            return Ok(Self::immediate());
        }
        let Canonical::Discrete { u_end, .. } = canonical else {
            return Err(Error::Arguments("only a discrete movement has a transport profile"));
        };
        let level = |ends: &[f64], at: f64| ends.iter().all(|c| *c == at);
        if !(MIN_CELLS + DEGREE..=MAX_CELLS + DEGREE).contains(&n)
            || !level(&coefficients[..DEGREE], 0.0)
            || !level(&coefficients[n - DEGREE..], 1.0)
            || !coefficients.windows(2).all(|pair| pair[0] <= pair[1])
        {
            return Err(Error::Arguments("a transport profile must increase from 0 to 1, level at both ends"));
        }
        let cells = n - DEGREE;
        let width = u_end / cells as f64;
        let scale = 1.0 / width;
        let cubic = |p: &[f64]| {
            let bend = (p[0] - p[1]) + (p[2] - p[1]);
            // About the value at the knot, whose three coefficients weigh 1, 4 and 1 sixths.
            let value = (p[1] - 1.0) + bend / 6.0;
            let cube = (p[3] - p[0]) + 3.0 * (p[1] - p[2]);
            [value, 0.5 * (p[2] - p[0]) * scale, 0.5 * bend * scale * scale, cube / 6.0 * scale * scale * scale]
        };
        let cubics = coefficients.windows(DEGREE + 1).map(cubic).collect();
        Ok(Self { coefficients, width, per_clock: cells as f64 / u_end, cubics })
    }

    /// The coefficients of the B-spline, none where m ≡ 1.
    pub(crate) fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Whether m ≡ 1.
    pub(crate) fn is_immediate(&self) -> bool {
        self.coefficients.is_empty()
    }

    /// The stretch that clock `u` lies on.
    pub(crate) fn stretch(&self, u: f64) -> Stretch {
        // A saturating cast: what lies before the start is read in the first cell.
        let cell = (u * self.per_clock) as usize;
        let at = |knot: usize| self.width * knot as f64;
        match self.cubics.get(cell) {
            Some(&cubic) => Stretch { from: at(cell), to: at(cell + 1), cubic },
            None => Stretch { from: at(self.cubics.len()), to: f64::INFINITY, cubic: [0.0; 4] },
        }
    }

    /// ℓ at clock `u`.
    pub(crate) fn lag(&self, u: f64) -> Lag {
        self.stretch(u).lag(u)
    }
}

impl Stretch {
    /// Whether a clock that was on it and has run on to `u` is on it still.
    #[inline(always)]
    pub(crate) fn reaches(&self, u: f64) -> bool {
        u < self.to
    }

    /// ℓ at clock `u`.
    #[inline(always)]
    pub(crate) fn lag(&self, u: f64) -> Lag {
        let ([value, slope, square, cube], t) = (self.cubic, u - self.from);
        let rest = cube * t;
        let bend = square + rest;
        let twice = bend + bend;
        Lag { value: value + t * (slope + t * bend), slope: slope + t * (twice + rest), bend: twice + 4.0 * rest }
    }
}
