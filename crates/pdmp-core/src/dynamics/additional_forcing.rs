//! Additional forcing of one movement: what leads it through points that no parameters reach.
//!
//! A displacement δ(u) moves the frame of the movement, as transport does (`transport`): with e = y − c − δ,
//!
//! ```text
//! y′ = z + w + c′ + δ′,     z′ = α_z(β_z(c + δ − y) − z),
//! ```
//!
//! which is the forcing δ′ with the attractor moved by δ. Under constant conditions the movement then is y(u) + δ(u), exactly
//! and for ticks of any length, and a perturbed one returns to it. δ is C² and piecewise of degree 5; that of a discrete
//! movement is zero from its end on, so that the goal remains, and that of a rhythmic one is periodic.

use crate::dynamics::canonical::{Canonical, turn};
use crate::dynamics::goal_transition::FrameSample;
use crate::error::{Error, Result};
use crate::numerics::simd::{F64x4, Register, WIDTH, groups, padded};
use crate::validate::check_finite;

/// Maximum number of forcings with different beginnings in a sum.
const MAX_TABLES: usize = 8;
/// Maximum number of cells of a table; it bounds the memory of a forged one.
const MAX_CELLS: usize = 1 << 12;
/// Numbers before the tables in [`AdditionalForcing::to_numbers`].
const HEADER: usize = 5;

/// Displacement δ(u) of a movement (D,) over the clock, by an additional forcing.
///
/// [`crate::inference::through`] computes one, and [`crate::Conditions::forcing`] and [`crate::Controller::add_forcing`] take it.
///
/// ```
/// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
/// # use pdmp_core::dynamics::AdditionalForcing;
/// # use pdmp_core::inference::{At, PassageOptions, ViaPoint, through};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let points = [ViaPoint::new(At::Time(0.4), vec![0.5, 0.2])];
/// let forcing = through(&model, &points, &Conditions::default(), &PassageOptions::default())?.forcing;
/// // The movement begins and ends as without it.
/// assert_eq!(forcing.displacement(0.0)[0], [0.0; 2]);
/// assert_eq!(AdditionalForcing::from_numbers(&forcing.to_numbers())?, *forcing);
/// assert_eq!(forcing.plus(&forcing)?.n_dofs(), 2);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct AdditionalForcing {
    canonical: Canonical,
    n_dofs: usize,
    tables: Vec<Table>,
}

/// Piecewise polynomial on a uniform grid of the clock.
#[derive(Clone, Debug, PartialEq)]
struct Table {
    /// Clock at which it begins; it ends with the movement, or a period later.
    from: f64,
    cells: usize,
    cells_per_clock: f64,
    /// Coefficients in powers of the position in a cell, from 0 to 1, by cells and groups of DoFs.
    quintics: Vec<[F64x4; 6]>,
}

impl Table {
    fn new(canonical: Canonical, from: f64, cells: usize, quintics: Vec<[F64x4; 6]>) -> Self {
        let length = if let Canonical::Discrete { u_end, .. } = canonical { u_end - from } else { canonical.extent() };
        Self { from, cells, cells_per_clock: cells as f64 / length, quintics }
    }

    /// Returns the polynomial of a group at clock `u` and the position in its cell, `None` where there is none.
    #[inline(always)]
    fn quintic(&self, canonical: Canonical, group: usize, u: f64) -> Option<(&[F64x4; 6], f64)> {
        let since = u - self.from;
        let since = if let Canonical::Rhythmic { .. } = canonical { turn(since) } else { since };
        let position = since * self.cells_per_clock;
        // The cast saturates; the comparison is false for a clock before the beginning.
        let cell = position as usize;
        if !(position >= 0.0 && cell < self.cells) {
            return None;
        }
        Some((&self.quintics[cell * (self.quintics.len() / self.cells) + group], position - cell as f64))
    }

    #[inline(always)]
    fn sample<T: Register>(&self, canonical: Canonical, group: usize, u: f64) -> FrameSample<T> {
        let Some(([a, b, c, d, e, f], t)) = self.quintic(canonical, group, u) else { return FrameSample::default() };
        let ([a, b, c, d, e, f], scale) = (T::load_all([a, b, c, d, e, f]), self.cells_per_clock);
        FrameSample {
            value: a + (b + (c + (d + (e + f * t) * t) * t) * t) * t,
            slope: (b + (c * 2.0 + (d * 3.0 + (e * 4.0 + f * (5.0 * t)) * t) * t) * t) * scale,
            bend: (c * 2.0 + (d * 6.0 + (e * 12.0 + f * (20.0 * t)) * t) * t) * (scale * scale),
        }
    }
}

impl AdditionalForcing {
    /// Returns an upper bound of the length of [`Self::to_numbers`].
    pub(crate) fn max_numbers(n_dofs: usize) -> usize {
        HEADER + MAX_TABLES * (2 + MAX_CELLS * groups(n_dofs) * 6 * WIDTH)
    }

    /// Returns the displacement with given values, slopes and second derivatives with respect to the clock, by knots and groups.
    /// The knots are equidistant from clock `from` to the end of the movement, or over a period.
    ///
    /// The caller ensures that they are zero at both ends of a discrete movement, and equal at both ends of a rhythmic one.
    pub(crate) fn from_knots(canonical: Canonical, n_dofs: usize, from: f64, knots: &[[F64x4; 3]]) -> Self {
        let n_groups = groups(n_dofs);
        let cells = knots.len() / n_groups - 1;
        let mut table = Table::new(canonical, from, cells, Vec::with_capacity(cells * n_groups));
        let h = 1.0 / table.cells_per_clock;
        for (start, end) in knots.iter().zip(&knots[n_groups..]) {
            let [value, slope, bend] = [start[0], start[1] * h, start[2] * (0.5 * h * h)];
            let [end, end_slope, end_bend] = [end[0], end[1] * h, end[2] * (0.5 * h * h)];
            let rest = end - value - slope - bend;
            let rest_slope = end_slope - slope - bend * 2.0;
            let rest_bend = end_bend - bend;
            table.quintics.push([
                value,
                slope,
                bend,
                rest * 10.0 - rest_slope * 4.0 + rest_bend,
                rest * -15.0 + rest_slope * 7.0 - rest_bend * 2.0,
                rest * 6.0 - rest_slope * 3.0 + rest_bend,
            ]);
        }
        Self { canonical, n_dofs, tables: vec![table] }
    }

    /// Returns the number of degrees of freedom D.
    pub fn n_dofs(&self) -> usize {
        self.n_dofs
    }

    /// Returns the clock u at which the displacement begins; that of a rhythmic movement then acts in every period.
    pub fn begins(&self) -> f64 {
        self.tables.iter().map(|table| table.from).fold(f64::INFINITY, f64::min)
    }

    /// Returns δ, δ′ and δ″ (D,) at clock `u`, in the unit of each DoF and per unit of the clock.
    pub fn displacement(&self, u: f64) -> [Vec<f64>; 3] {
        let mut jets = [(); 3].map(|()| vec![0.0; self.n_dofs]);
        for group in 0..groups(self.n_dofs) {
            let FrameSample { value, slope, bend } = self.sample::<F64x4>(group, u);
            for (jet, lanes) in jets.iter_mut().zip([value, slope, bend]) {
                let dofs = group * WIDTH..self.n_dofs.min((group + 1) * WIDTH);
                let n = dofs.len();
                jet[dofs].copy_from_slice(&lanes.as_array()[..n]);
            }
        }
        jets
    }

    /// Returns the displacement of a group at clock `u`.
    #[inline(always)]
    pub(crate) fn sample<T: Register>(&self, group: usize, u: f64) -> FrameSample<T> {
        let mut sum = FrameSample::<T>::default();
        for table in &self.tables {
            let FrameSample { value, slope, bend } = table.sample::<T>(self.canonical, group, u);
            sum = FrameSample { value: sum.value + value, slope: sum.slope + slope, bend: sum.bend + bend };
        }
        sum
    }

    /// Returns δ‴ of a group at clock `u`, at a knot, where it jumps, that of a later clock.
    pub(crate) fn third(&self, group: usize, u: f64) -> F64x4 {
        self.tables.iter().fold(F64x4::ZERO, |sum, table| match table.quintic(self.canonical, group, u) {
            Some(([_, _, _, d, e, f], t)) => {
                sum + (*d * 6.0 + (*e * 24.0 + *f * (60.0 * t)) * t) * table.cells_per_clock.powi(3)
            }
            None => sum,
        })
    }

    /// Returns the sum of both displacements.
    ///
    /// # Errors
    /// Forcings of different models, or more than eight of different beginnings.
    pub fn plus(&self, other: &Self) -> Result<Self> {
        if (self.canonical, self.n_dofs) != (other.canonical, other.n_dofs) {
            return Err(foreign());
        }
        let mut sum = self.clone();
        for table in &other.tables {
            let same = |own: &Table| own.from == table.from && own.cells == table.cells;
            match sum.tables.iter().position(same) {
                Some(index) => {
                    for (to, from) in sum.tables[index].quintics.iter_mut().zip(&table.quintics) {
                        to.iter_mut().zip(from).for_each(|(to, from)| *to += *from);
                    }
                }
                None if sum.tables.len() < MAX_TABLES => sum.tables.push(table.clone()),
                None => {
                    let problem = "is the ninth that begins elsewhere: start the movement again with fewer";
                    return Err(Error::Argument { name: "forcing", problem });
                }
            }
        }
        Ok(sum)
    }

    /// Returns the displacement multiplied by a number.
    pub(crate) fn scaled(mut self, factor: f64) -> Self {
        self.tables.iter_mut().flat_map(|table| table.quintics.iter_mut().flatten()).for_each(|a| *a *= factor);
        self
    }

    /// Checks that the displacement is one of movements with this canonical system and number of DoFs.
    pub(crate) fn check(&self, canonical: Canonical, n_dofs: usize) -> Result<()> {
        if (self.canonical, self.n_dofs) == (canonical, n_dofs) { Ok(()) } else { Err(foreign()) }
    }

    /// Returns all numbers, from which [`Self::from_numbers`] restores the forcing.
    pub fn to_numbers(&self) -> Vec<f64> {
        let [kind, rate] = match self.canonical {
            Canonical::Discrete { alpha_x, .. } => [0.0, alpha_x],
            Canonical::Rhythmic { mu } => [1.0, mu],
        };
        let counts = [self.n_dofs, self.tables.len()].map(|n| n as f64);
        let mut numbers = vec![kind, rate, self.canonical.extent(), counts[0], counts[1]];
        for Table { from, cells, quintics, .. } in &self.tables {
            numbers.extend([*from, *cells as f64]);
            numbers.extend(quintics.iter().flatten().flat_map(|lanes| lanes.to_array()));
        }
        numbers
    }

    /// Restores a forcing from [`Self::to_numbers`].
    ///
    /// # Errors
    /// Numbers that are not finite, or that describe no forcing.
    pub fn from_numbers(numbers: &[f64]) -> Result<Self> {
        const DAMAGED: Error = Error::Argument { name: "forcing", problem: "is damaged: its numbers describe none" };
        check_finite("forcing", numbers)?;
        let Some((&[kind, rate, extent, n_dofs, n_tables], mut rest)) = numbers.split_first_chunk::<HEADER>() else {
            return Err(DAMAGED);
        };
        let canonical = match kind {
            0.0 => Canonical::Discrete { alpha_x: rate, u_end: extent },
            _ => Canonical::Rhythmic { mu: rate },
        };
        let count = |n: f64, limit: usize| (n >= 1.0 && n <= limit as f64 && n.fract() == 0.0).then_some(n as usize);
        let (n_dofs, n_tables) = (count(n_dofs, rest.len()), count(n_tables, MAX_TABLES));
        let (Some(n_dofs), Some(n_tables)) = (n_dofs, n_tables) else { return Err(DAMAGED) };
        let mut tables = Vec::with_capacity(n_tables);
        for _ in 0..n_tables {
            let Some((&[from, cells], after)) = rest.split_first_chunk::<2>() else { return Err(DAMAGED) };
            let Some(cells) = count(cells, MAX_CELLS) else { return Err(DAMAGED) };
            let size = cells.saturating_mul(groups(n_dofs)).saturating_mul(6 * WIDTH);
            let Some((coefficients, after)) = after.split_at_checked(size) else { return Err(DAMAGED) };
            if !(0.0..canonical.extent()).contains(&from) || canonical.extent() != extent {
                return Err(DAMAGED);
            }
            let mut lanes = coefficients.chunks_exact(WIDTH).map(padded);
            let quintic = |_| std::array::from_fn(|_| lanes.next().unwrap_or(F64x4::ZERO));
            let quintics = (0..cells * groups(n_dofs)).map(quintic).collect();
            tables.push(Table::new(canonical, from, cells, quintics));
            rest = after;
        }
        if rest.is_empty() { Ok(Self { canonical, n_dofs, tables }) } else { Err(DAMAGED) }
    }
}

/// Returns the error of a forcing of another model.
fn foreign() -> Error {
    Error::Argument { name: "forcing", problem: "belongs to another model: compute it with this one" }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    const DISCRETE: Canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 2.0 };

    fn bump(u: f64) -> [f64; 3] {
        let (s, c) = (std::f64::consts::PI * u / 2.0).sin_cos();
        let rate = std::f64::consts::PI / 2.0;
        // sin⁴, with two derivatives that vanish at both ends.
        [s.powi(4), 4.0 * rate * s.powi(3) * c, 4.0 * rate * rate * (3.0 * s * s * c * c - s.powi(4))]
    }

    fn forcing() -> AdditionalForcing {
        let lanes = |x: f64| F64x4::new([x, 0.0, 2.0 * x, 0.0]);
        let knots: Vec<[F64x4; 3]> = (0..=40).map(|k| bump(f64::from(k) * 0.05).map(lanes)).collect();
        AdditionalForcing::from_knots(DISCRETE, 3, 0.0, &knots)
    }

    /// The polynomials interpolate a function and its derivatives, and are zero outside.
    #[test]
    fn interpolates_with_two_derivatives() {
        let forcing = forcing();
        for k in 0..=100 {
            let u = 0.02 * f64::from(k);
            let found = forcing.displacement(u);
            for (order, expected) in bump(u).into_iter().enumerate() {
                let tolerance = [1e-7, 1e-5, 1e-3][order];
                assert_relative_eq!(found[order][0], expected, epsilon = tolerance);
                assert_relative_eq!(found[order][2], 2.0 * expected, epsilon = 2.0 * tolerance);
                assert_eq!(found[order][1], 0.0);
            }
        }
        for u in [-1.0, 2.0, 3.0, 1e300, f64::INFINITY] {
            assert_eq!(forcing.displacement(u).concat(), [0.0; 9]);
        }
    }

    /// Sums are those of the displacements, and numbers restore a forcing to the bit; damaged ones are refused.
    #[test]
    fn sums_and_numbers() {
        let forcing = forcing();
        let other = AdditionalForcing::from_knots(DISCRETE, 3, 1.0, &[[F64x4::ZERO; 3]; 6]);
        let sum = forcing.plus(&other).unwrap().plus(&forcing).unwrap();
        assert_eq!(sum.tables.len(), 2);
        assert_relative_eq!(sum.displacement(0.7)[1][2], 2.0 * forcing.displacement(0.7)[1][2], epsilon = 1e-12);
        let numbers = sum.to_numbers();
        assert_eq!(AdditionalForcing::from_numbers(&numbers).unwrap(), sum);
        for n in 0..numbers.len() {
            assert!(AdditionalForcing::from_numbers(&numbers[..n]).is_err());
        }
        for (i, value) in [(0, f64::NAN), (3, 1e9), (4, 1.5), (5, -1.0), (5, 2.0), (6, 0.0)] {
            let mut damaged = numbers.clone();
            damaged[i] = value;
            assert!(AdditionalForcing::from_numbers(&damaged).is_err(), "{i}");
        }
    }
}
