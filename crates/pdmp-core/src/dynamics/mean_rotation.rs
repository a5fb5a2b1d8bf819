//! Mean rotation q̄(u) of a group of demonstrations over the clock, about which a primitive models rotations.
//!
//! The components of unit quaternions at equidistant knots are interpolated by a cubic spline and normalised. A rotation of
//! the world or of the body frame multiplies all knots by a constant, which is a linear map of the components that keeps
//! norms: the curve turns with it. With p for the spline,
//!
//! ```text
//! q̄ = p/|p|,   ω̄ = 2 vec(p* ⊗ p′)/|p|²,   ω̄′ = 2 vec(p* ⊗ p″)/|p|² − 2ω̄ p·p′/|p|².
//! ```
//!
//! q̄ is twice continuously differentiable. That of a discrete movement is at rest at the end and past it; that of a rhythmic
//! one is periodic as a rotation, while its quaternion may change its sign over a cycle.

use std::f64::consts::TAU;

use crate::dynamics::canonical::Canonical;
use crate::kind::Kind;
use crate::numerics::rotation::{Quaternion, Turning, Vector, add_scaled, dot, inverse, product, vector};
use crate::numerics::simd::F64x4;
use crate::numerics::spline::Knots;

/// Maximum number of cells.
pub(crate) const MAX_CELLS: usize = 2048;
/// Minimum number of cells: a cubic spline with not-a-knot ends needs four knots.
pub(crate) const MIN_CELLS: usize = 3;
/// Smallest scalar product of neighbouring knots, a turn of 50°: the spline stays away from zero.
pub(crate) const MIN_COSINE: f64 = 0.9;

/// Curve of unit quaternions over the clock.
#[derive(Clone, Debug)]
pub(crate) struct MeanRotation {
    /// Unit quaternions at the knots (N + 1,); the last one of a cycle is the first, or its negative.
    knots: Vec<Quaternion>,
    /// Coefficients of a polynomial of degree five in each cell, in units of cells.
    cells: Vec<[F64x4; 6]>,
    /// Cells per unit of the clock.
    per_unit: f64,
    kind: Kind,
}

impl MeanRotation {
    /// Returns the curve through unit quaternions (N + 1,) at equidistant knots from the start to the end of the clock; those
    /// of a cycle end where they start. The caller ensures [`Self::are_valid`].
    pub(crate) fn through(knots: Vec<Quaternion>, canonical: Canonical) -> Self {
        let (n, kind) = (knots.len() - 1, canonical.kind());
        let values: Vec<F64x4> = knots.iter().map(|q| F64x4::new(*q)).collect();
        let mut slopes = vec![F64x4::ZERO; n + 1];
        let time = |n: usize| (0..n).map(|k| k as f64).collect::<Vec<f64>>();
        match kind {
            Kind::Discrete => Knots::not_a_knot(time(n + 1)).slopes(&values, &mut slopes),
            Kind::Rhythmic => {
                // Over two cycles the quaternion is periodic, with either sign.
                let sign = if dot(knots[0], knots[n]) < 0.0 { -1.0 } else { 1.0 };
                let cycle = values[..n].iter();
                let twice: Vec<F64x4> = cycle.clone().copied().chain(cycle.map(|q| *q * sign)).collect();
                let mut doubled = vec![F64x4::ZERO; 2 * n];
                Knots::periodic(time(2 * n), 2.0 * n as f64).slopes(&twice, &mut doubled);
                slopes.copy_from_slice(&doubled[..=n]);
            }
        }
        let mut bends: Vec<F64x4> =
            (0..n).map(|k| (values[k + 1] - values[k]) * 6.0 - slopes[k] * 4.0 - slopes[k + 1] * 2.0).collect();
        bends.push((values[n] - values[n - 1]) * -6.0 + slopes[n - 1] * 2.0 + slopes[n] * 4.0);
        if kind == Kind::Discrete {
            (slopes[n], bends[n]) = (F64x4::ZERO, F64x4::ZERO);
        }
        let cell = |k: usize| {
            let (from, rise) = (values[k], values[k + 1] - values[k]);
            let (slope, bend) = (slopes[k], bends[k] * 0.5);
            let d = rise - slope - bend;
            let e = slopes[k + 1] - slope - bends[k];
            let f = (bends[k + 1] - bends[k]) * 0.5;
            [from, slope, bend, d * 10.0 - e * 4.0 + f, d * -15.0 + e * 7.0 - f * 2.0, d * 6.0 - e * 3.0 + f]
        };
        let cells = (0..n).map(cell).collect();
        Self { knots, cells, per_unit: n as f64 / canonical.extent(), kind }
    }

    /// Returns whether knots describe a curve: their number, unit norms, short steps, and a closed cycle.
    pub(crate) fn are_valid(knots: &[Quaternion], kind: Kind) -> bool {
        let unit = |q: &Quaternion| (dot(*q, *q) - 1.0).abs() < 1e-9;
        (MIN_CELLS + 1..=MAX_CELLS + 1).contains(&knots.len())
            && knots.iter().all(unit)
            && knots.windows(2).all(|pair| dot(pair[0], pair[1]) > MIN_COSINE)
            && (kind == Kind::Discrete || dot(knots[0], knots[knots.len() - 1]).abs() > 1.0 - 1e-9)
    }

    /// Returns the knots (N + 1,).
    pub(crate) fn knots(&self) -> &[Quaternion] {
        &self.knots
    }

    /// Returns q̄ times a positive number at a clock that is not negative: the value of the spline, without its derivatives.
    #[inline(always)]
    pub(crate) fn direction(&self, u: f64) -> F64x4 {
        let last = self.cells.len() - 1;
        let x = (u * self.per_unit).min(self.cells.len() as f64);
        let k = (x as usize).min(last);
        let (t, [a, b, c, d, e, f]) = (F64x4::splat(x - k as f64), self.cells[k]);
        ((((f * t + e) * t + d) * t + c) * t + b) * t + a
    }

    /// Returns q̄ with its velocity and acceleration with respect to the clock, in the body frame.
    #[inline(always)]
    pub(crate) fn at(&self, u: f64) -> Turning {
        let x = match self.kind {
            Kind::Discrete => u.max(0.0) * self.per_unit,
            Kind::Rhythmic if u >= TAU => (u % TAU) * self.per_unit,
            Kind::Rhythmic => u.max(0.0) * self.per_unit,
        };
        let last = self.cells.len() - 1;
        if x >= self.cells.len() as f64 && self.kind == Kind::Discrete {
            return Turning { rotation: self.knots[last + 1], velocity: [0.0; 3], acceleration: [0.0; 3] };
        }
        let k = (x as usize).min(last);
        let (t, [a, b, c, d, e, f]) = (F64x4::splat(x - k as f64), self.cells[k]);
        // Horner's scheme for the value, the slope and half the bend.
        let (mut value, mut slope, mut half_bend) = (f * t + e, f, f);
        slope = slope * t + value;
        value = value * t + d;
        half_bend = half_bend * t + slope;
        slope = slope * t + value;
        value = value * t + c;
        half_bend = half_bend * t + slope;
        slope = slope * t + value;
        value = value * t + b;
        half_bend = half_bend * t + slope;
        slope = slope * t + value;
        value = value * t + a;
        let bend = half_bend + half_bend;
        let [p, slope, bend] = [value, slope, bend].map(F64x4::to_array);
        let inverse_square = 1.0 / dot(p, p);
        let scale = 2.0 * self.per_unit * inverse_square;
        let back = inverse(p);
        let velocity = vector(product(back, slope)).map(|x| x * scale);
        let acceleration = add_scaled(
            vector(product(back, bend)).map(|x| x * scale * self.per_unit),
            -scale * dot(p, slope),
            velocity,
        );
        let norm = inverse_square.sqrt();
        Turning { rotation: p.map(|x| x * norm), velocity, acceleration }
    }
}

/// Returns the angular velocity and acceleration at the end of a path through equidistant rotations (N + 1,), per cell.
pub(crate) fn end_motion(rotations: &[Quaternion]) -> [Vector; 2] {
    let n = rotations.len() - 1;
    let values: Vec<F64x4> = rotations.iter().map(|q| F64x4::new(*q)).collect();
    let mut slopes = vec![F64x4::ZERO; n + 1];
    Knots::not_a_knot((0..=n).map(|k| k as f64).collect()).slopes(&values, &mut slopes);
    let bend = (values[n] - values[n - 1]) * -6.0 + slopes[n - 1] * 2.0 + slopes[n] * 4.0;
    let [slope, bend] = [slopes[n], bend].map(F64x4::to_array);
    let back = inverse(rotations[n]);
    let velocity = vector(product(back, slope)).map(|x| 2.0 * x);
    let acceleration = vector(product(back, bend)).map(|x| 2.0 * x);
    [velocity, add_scaled(acceleration, -2.0 * dot(rotations[n], slope), velocity)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::rotation::{exp, log, rotate};

    /// Path from rest to rest.
    fn path(n: usize) -> Vec<Quaternion> {
        let turned = |t: f64| product(exp([2.0 * t * t, 0.0, 0.3]), exp([0.1, (3.0 * t).sin(), t]));
        let eased = |t: f64| t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
        (0..=n).map(|k| turned(eased(k as f64 / n as f64))).collect()
    }

    fn cycle(n: usize, turns: f64) -> Vec<Quaternion> {
        let at = |phase: f64| product(exp([0.0, 0.0, turns * phase]), exp([0.4 * phase.sin(), 0.2 * phase.cos(), 0.0]));
        (0..=n).map(|k| at(TAU * k as f64 / n as f64)).collect()
    }

    const DISCRETE: Canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.5 };
    const RHYTHMIC: Canonical = Canonical::Rhythmic { mu: 1.0 };

    /// Velocity and acceleration are derivatives everywhere, across knots, the end and the turn of a cycle.
    #[test]
    fn motion_is_consistent_with_the_curve() {
        for (mean, extent) in [
            (MeanRotation::through(path(60), DISCRETE), 1.6),
            (MeanRotation::through(cycle(90, 0.0), RHYTHMIC), TAU),
            (MeanRotation::through(cycle(90, 1.0), RHYTHMIC), TAU),
        ] {
            let (h, mut largest) = (1e-5, 0.0f64);
            for k in 1..2000 {
                let u = f64::from(k) / 2000.0 * extent;
                let [before, now, after] = [u - h, u, u + h].map(|u| mean.at(u));
                let step = log(product(inverse(before.rotation), after.rotation)).map(|x| x / (2.0 * h));
                let change = add_scaled(after.velocity, -1.0, before.velocity).map(|x| x / (2.0 * h));
                for i in 0..3 {
                    assert!((step[i] - now.velocity[i]).abs() < 1e-6, "{u}: {step:?} {:?}", now.velocity);
                    assert!((change[i] - now.acceleration[i]).abs() < 2e-2, "{u}: {change:?} {:?}", now.acceleration);
                    largest = largest.max(now.acceleration[i].abs());
                }
            }
            assert!(largest > 0.1);
        }
    }

    #[test]
    fn curve_passes_its_knots_and_rests_past_the_end() {
        let mean = MeanRotation::through(path(60), DISCRETE);
        for (k, knot) in path(60).into_iter().enumerate() {
            let at = mean.at(1.5 * k as f64 / 60.0).rotation;
            assert!((0..4).all(|i| (at[i] - knot[i]).abs() < 1e-15));
        }
        let [before, after] = [1.5 - 1e-9, 2.0].map(|u| mean.at(u));
        assert!(after.velocity == [0.0; 3] && dot(before.velocity, before.velocity) < 1e-10);
        assert!(dot(before.acceleration, before.acceleration) < 1e-3);
    }

    /// Other world and body frames turn the curve, and change its body velocity by the turn of the body frame alone.
    #[test]
    fn curve_turns_with_its_frames() {
        let (world, body) = (exp([0.3, -1.2, 0.7]), exp([-2.0, 0.1, 0.4]));
        for (knots, canonical) in [(path(60), DISCRETE), (cycle(90, 1.0), RHYTHMIC)] {
            let mean = MeanRotation::through(knots.clone(), canonical);
            let turned = knots.into_iter().map(|q| product(product(world, q), body)).collect();
            let turned = MeanRotation::through(turned, canonical);
            for k in 0..500 {
                let u = f64::from(k) * 0.0031 * canonical.extent();
                let (a, b) = (mean.at(u), turned.at(u));
                let expected = product(product(world, a.rotation), body);
                assert!((0..4).all(|i| (expected[i] - b.rotation[i]).abs() < 1e-14));
                for (a, b) in [(a.velocity, b.velocity), (a.acceleration, b.acceleration)] {
                    let expected = rotate(inverse(body), a);
                    assert!((0..3).all(|i| (expected[i] - b[i]).abs() < 1e-10));
                }
            }
        }
    }
}
