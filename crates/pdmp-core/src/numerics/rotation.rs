//! Rotations as unit quaternions and rotation vectors: product, exponential and logarithm map, and the motion of
//! q = q̄ ⊗ exp(δ).
//!
//! A quaternion is [w, x, y, z]; q and −q are the same rotation, which maps a vector of the body frame to the world frame.
//! exp(δ) turns by |δ| about δ. With θ = |δ|, and angular velocities ω in the body frame,
//!
//! ```text
//! q = q̄ ⊗ exp(δ),   ω = exp(δ)ᵀω̄ + J(δ)δ̇,   ω̇ = exp(δ)ᵀω̄˙ + (exp(δ)ᵀω̄) × J(δ)δ̇ + J(δ)δ̈ + J̇δ̇,
//! J(δ)v = v − c₁δ×v + c₂δ×(δ×v),   c₁ = (1 − cos θ)/θ²,   c₂ = (θ − sin θ)/θ³,
//! J⁻¹(δ)v = v + ½δ×v + c₃δ×(δ×v),  c₃ = (1 − θ/2·cot(θ/2))/θ²,
//! ```
//!
//! J is the right Jacobian of the exponential map. It exists for every δ, its inverse for θ < 2π.
//!
//! J. Solà, J. Deray, D. Atchuthan, A micro Lie theory for state estimation in robotics, arXiv:1812.01537.

use std::f64::consts::{PI, TAU};

use crate::numerics::simd::F64x4;

/// Unit quaternion [w, x, y, z].
pub(crate) type Quaternion = [f64; 4];
/// Vector of three components, such as a rotation vector in rad.
pub(crate) type Vector = [f64; 3];

/// Square of the angle up to which power series replace the closed forms, which lose digits at small angles.
const MAX_SERIES_SQUARE: f64 = 4.0;
/// Square of the angle up to which eight terms suffice: the next one is below 3e-17 of the first.
const MAX_SHORT_SQUARE: f64 = 0.75;
/// Number of terms of the series: the next one is below 1e-17 of the first at θ = 2.
const N_TERMS: usize = 12;
/// Angle below which the axis of a rotation is unknown.
const MIN_ANGLE: f64 = 1e-12;
/// Largest number of iterations of a mean; its residuals halve at least twice each in practice.
const MAX_MEAN_ITERATIONS: usize = 100;
/// Change of the mean in rad that ends the iteration.
const MEAN_CONVERGED: f64 = 1e-15;
/// Largest angle for the inverse Jacobian, which is at most 3.4 there, and singular at 2π.
const MAX_INVERTIBLE: f64 = 1.5 * PI;

/// Coefficients of the power series in θ² of cos(θ/2), sin(θ/2)/θ, (c₁′/θ)′/θ and (c₂′/θ)′/θ, and of c₁, c₂, c₁′/θ and c₂′/θ.
struct Series {
    half: [F64x4; N_TERMS],
    jacobian: [F64x4; N_TERMS],
}

const SERIES: Series = Series::new();

impl Series {
    const fn new() -> Self {
        let mut half = [[0.0; 4]; N_TERMS];
        let mut jacobian = [[0.0; 4]; N_TERMS];
        // 1/(2k)!, 1/4ᵏ and the sign of the terms.
        let (mut factorial, mut quarter, mut sign, mut k) = (1.0, 1.0, 1.0, 0);
        while k < N_TERMS {
            let n = 2.0 * k as f64;
            let odd = factorial / (n + 1.0);
            let (first, second) = (odd / (n + 2.0), odd / ((n + 2.0) * (n + 3.0)));
            // As the slopes below, from the terms after the next.
            let bend = (n + 2.0) / ((n + 3.0) * (n + 5.0) * (n + 6.0));
            let curl = (n + 2.0) / ((n + 5.0) * (n + 6.0) * (n + 7.0));
            let cosine = sign * quarter * factorial;
            half[k] = [cosine, 0.5 * sign * quarter * odd, sign * first * bend, sign * second * curl];
            // The derivative of (−1)ᵏθ²ᵏ/(2k + 2)! divided by θ is the next term's (−1)ᵏ⁺¹(2k + 2)θ²ᵏ/(2k + 4)!.
            let slope = -(n + 2.0) / ((n + 3.0) * (n + 4.0));
            let twist = -(n + 2.0) / ((n + 4.0) * (n + 5.0));
            jacobian[k] = [sign * first, sign * second, sign * first * slope, sign * second * twist];
            factorial /= (n + 1.0) * (n + 2.0);
            (quarter, sign, k) = (quarter / 4.0, -sign, k + 1);
        }
        Self { half: lanes(half), jacobian: lanes(jacobian) }
    }
}

const fn lanes(numbers: [[f64; 4]; N_TERMS]) -> [F64x4; N_TERMS] {
    let mut lanes = [F64x4::new([0.0; 4]); N_TERMS];
    let mut k = 0;
    while k < N_TERMS {
        lanes[k] = F64x4::new(numbers[k]);
        k += 1;
    }
    lanes
}

/// Evaluates a series at θ², by Estrin's scheme: its sums of four terms do not wait for each other.
#[inline(always)]
fn sum(series: &[F64x4; N_TERMS], square: f64) -> [f64; 4] {
    let (x, second) = (F64x4::splat(square), F64x4::splat(square * square));
    let fourth = second * second;
    let four = |k: usize| (series[k] + series[k + 1] * x) + (series[k + 2] + series[k + 3] * x) * second;
    let tail = if square <= MAX_SHORT_SQUARE { four(4) } else { four(8) * fourth + four(4) };
    (tail * fourth + four(0)).to_array()
}

/// Returns cos(θ/2) and sin(θ/2)/θ.
#[inline(always)]
fn half_angle(square: f64) -> [f64; 2] {
    if square <= MAX_SERIES_SQUARE {
        let [cosine, sine, ..] = sum(&SERIES.half, square);
        return [cosine, sine];
    }
    let angle = square.sqrt();
    let (sine, cosine) = (0.5 * angle).sin_cos();
    [cosine, sine / angle]
}

/// Returns c₁, c₂, c₁′/θ and c₂′/θ.
#[inline(always)]
pub(super) fn jacobian_coefficients(square: f64) -> [f64; 4] {
    if square <= MAX_SERIES_SQUARE {
        return sum(&SERIES.jacobian, square);
    }
    let angle = square.sqrt();
    let (sine, cosine) = angle.sin_cos();
    let (first, second) = ((1.0 - cosine) / square, (angle - sine) / (square * angle));
    let slope = (angle * sine - 2.0 * (1.0 - cosine)) / (square * square);
    let twist = (3.0 * sine - angle * cosine - 2.0 * angle) / (square * square * angle);
    [first, second, slope, twist]
}

/// Returns (c₁′/θ)′/θ and (c₂′/θ)′/θ.
#[inline(always)]
pub(super) fn jacobian_bends(square: f64, [first, second, slope, twist]: [f64; 4]) -> [f64; 2] {
    if square <= MAX_SERIES_SQUARE {
        let [_, _, bend, curl] = sum(&SERIES.half, square);
        return [bend, curl];
    }
    // sin θ/θ = 1 − c₂θ², and its derivative divided by θ is c₂ − c₁.
    let change = second - first;
    let sine = 1.0 - second * square;
    [(change - 4.0 * slope) / square, ((sine + 3.0 * change) / square - 4.0 * twist) / square]
}

/// Returns a×b.
#[inline(always)]
pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns a·b.
#[inline(always)]
pub(crate) fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    (0..N).map(|i| a[i] * b[i]).sum()
}

/// Returns a + s·b.
#[inline(always)]
pub(crate) fn add_scaled<const N: usize>(a: [f64; N], s: f64, b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] + s * b[i])
}

/// Returns the product a ⊗ b.
#[inline(always)]
pub(crate) fn product(a: Quaternion, b: Quaternion) -> Quaternion {
    let ([v, w], c) = (vectors(a, b), cross(vector(a), vector(b)));
    let scalar = a[0] * b[0] - dot(v, w);
    [scalar, a[0] * w[0] + b[0] * v[0] + c[0], a[0] * w[1] + b[0] * v[1] + c[1], a[0] * w[2] + b[0] * v[2] + c[2]]
}

#[inline(always)]
fn vectors(a: Quaternion, b: Quaternion) -> [Vector; 2] {
    [vector(a), vector(b)]
}

/// Returns the vector part.
#[inline(always)]
pub(crate) fn vector(q: Quaternion) -> Vector {
    [q[1], q[2], q[3]]
}

/// Returns the inverse of a unit quaternion.
#[inline(always)]
pub(crate) fn inverse(q: Quaternion) -> Quaternion {
    [q[0], -q[1], -q[2], -q[3]]
}

/// Returns the quaternion divided by its norm, which is positive.
#[inline(always)]
pub(crate) fn normalised(q: Quaternion) -> Quaternion {
    let norm = dot(q, q).sqrt();
    q.map(|x| x / norm)
}

/// Returns q or −q, that closer to a reference.
#[inline(always)]
pub(crate) fn on_side_of(q: Quaternion, reference: Quaternion) -> Quaternion {
    if dot(q, reference) < 0.0 { q.map(|x| -x) } else { q }
}

/// Rotates a vector from the body frame to the world frame.
#[inline(always)]
pub(crate) fn rotate(q: Quaternion, v: Vector) -> Vector {
    let twice = cross(vector(q), v).map(|x| 2.0 * x);
    add_scaled(add_scaled(v, q[0], twice), 1.0, cross(vector(q), twice))
}

/// Returns exp(δ).
#[inline(always)]
pub(crate) fn exp(delta: Vector) -> Quaternion {
    let [cosine, sine] = half_angle(dot(delta, delta));
    [cosine, sine * delta[0], sine * delta[1], sine * delta[2]]
}

/// Returns the rotation vector of at most π of a unit quaternion.
pub(crate) fn log(q: Quaternion) -> Vector {
    let sine = dot(vector(q), vector(q)).sqrt();
    let sign = if q[0] < 0.0 { -1.0 } else { 1.0 };
    // Below the series' last digit atan(x)/x is 1.
    let factor = if sine > 0.0 { 2.0 * sine.atan2(q[0].abs()) / sine } else { 2.0 };
    vector(q).map(|x| sign * factor * x)
}

/// Returns the angle of the rotation between two unit quaternions, at most π.
pub(crate) fn distance(a: Quaternion, b: Quaternion) -> f64 {
    let delta = log(product(inverse(a), b));
    dot(delta, delta).sqrt()
}

/// Returns the Karcher mean of rotations that is closest to `start`: the residuals log(q̄⁻¹q_m) about it add up to zero.
pub(crate) fn mean(start: Quaternion, rotations: impl ExactSizeIterator<Item = Quaternion> + Clone) -> Quaternion {
    let (mut mean, weight) = (start, 1.0 / rotations.len() as f64);
    for _ in 0..MAX_MEAN_ITERATIONS {
        let residuals = rotations.clone().map(|q| log(product(inverse(mean), q)));
        let step = residuals.fold([0.0; 3], |sum, residual| add_scaled(sum, weight, residual));
        mean = normalised(product(mean, exp(step)));
        if dot(step, step) <= MEAN_CONVERGED * MEAN_CONVERGED {
            break;
        }
    }
    mean
}

/// Returns the rotation vector of a unit quaternion that is closest to a reference: that of [`log`], or one with whole
/// turns about the same axis added.
pub(crate) fn log_near(q: Quaternion, reference: Vector) -> Vector {
    let delta = log(q);
    let angle = dot(delta, delta).sqrt();
    let size = dot(reference, reference).sqrt();
    if size <= PI - angle {
        return delta;
    }
    let axis = if angle > MIN_ANGLE { delta.map(|x| x / angle) } else { reference.map(|x| x / size) };
    let turns = ((dot(axis, reference) - angle) / TAU).round();
    add_scaled(delta, turns * TAU, axis)
}

/// Returns J(δ)v.
#[inline(always)]
pub(crate) fn jacobian(delta: Vector, v: Vector) -> Vector {
    let [first, second, ..] = jacobian_coefficients(dot(delta, delta));
    let once = cross(delta, v);
    add_scaled(add_scaled(v, -first, once), second, cross(delta, once))
}

/// Returns J⁻¹(δ)v. For angles beyond 3π/2 it is that of 3π/2, which keeps velocities bounded.
pub(crate) fn inverse_jacobian(delta: Vector, v: Vector) -> Vector {
    unbounded_inverse_jacobian(delta.map(|x| x * shrinkage(delta)), v)
}

/// Returns the factor of δ that limits its angle to 3π/2.
pub(super) fn shrinkage(delta: Vector) -> f64 {
    let square = dot(delta, delta);
    if square > MAX_INVERTIBLE * MAX_INVERTIBLE { MAX_INVERTIBLE / square.sqrt() } else { 1.0 }
}

/// Returns J⁻¹(δ)v, which grows without bounds towards whole turns.
pub(super) fn unbounded_inverse_jacobian(delta: Vector, v: Vector) -> Vector {
    let square = dot(delta, delta);
    let [cosine, sine] = half_angle(square);
    // The difference loses at most three digits of a term that is θ²/12 of the others.
    let third = if square < 1e-4 { 1.0 / 12.0 + square / 720.0 } else { (1.0 - 0.5 * cosine / sine) / square };
    let once = cross(delta, v);
    add_scaled(add_scaled(v, 0.5, once), third, cross(delta, once))
}

/// Rotation with its angular velocity and acceleration in the body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turning {
    pub(crate) rotation: Quaternion,
    pub(crate) velocity: Vector,
    pub(crate) acceleration: Vector,
}

impl Turning {
    /// The unit rotation at rest.
    pub(crate) const REST: Self = Self { rotation: [1.0, 0.0, 0.0, 0.0], velocity: [0.0; 3], acceleration: [0.0; 3] };

    /// Returns the motion of q̄ ⊗ exp(δ) for δ, δ̇ and δ̈.
    #[inline(always)]
    pub(crate) fn times_exp(&self, [delta, slope, bend]: [Vector; 3]) -> Self {
        let square = dot(delta, delta);
        let [first, second, first_slope, second_slope] = jacobian_coefficients(square);
        let [cosine, sine] = if square <= MAX_SERIES_SQUARE {
            // c₁ = 2sin²(θ/2)/θ², and cos(θ/2) is positive.
            let half = 0.5 * first;
            [(1.0 - half * square).sqrt(), half.sqrt()]
        } else {
            half_angle(square)
        };
        let turn = [cosine, sine * delta[0], sine * delta[1], sine * delta[2]];
        // exp(δ)ᵀv = v − sin θ/θ·δ×v + c₁δ×(δ×v) with sin θ/θ = 1 − c₂θ².
        let back = 1.0 - second * square;
        let carried = through(self.velocity, delta, back, first);
        let once = cross(delta, slope);
        let twice = cross(delta, once);
        let own = add_scaled(add_scaled(slope, -first, once), second, twice);
        // exp(δ)ᵀω̄˙ + Jδ̈, of equal form.
        let inner: Vector = std::array::from_fn(|i| first * self.acceleration[i] + second * bend[i]);
        let outer: Vector = std::array::from_fn(|i| back * self.acceleration[i] + first * bend[i]);
        let sum = add_scaled(self.acceleration, 1.0, bend);
        let bent = add_scaled(sum, 1.0, cross(delta, add_scaled(cross(delta, inner), -1.0, outer)));
        let growth = dot(delta, slope);
        let (along, across) = (second_slope * growth, -first_slope * growth);
        let (coriolis, change) = (cross(carried, own), cross(slope, once));
        let acceleration =
            std::array::from_fn(|i| bent[i] + coriolis[i] + second * change[i] + along * twice[i] + across * once[i]);
        let velocity = add_scaled(carried, 1.0, own);
        Self { rotation: product(self.rotation, turn), velocity, acceleration }
    }
}

/// Returns v − a·δ×v + b·δ×(δ×v).
#[inline(always)]
fn through(v: Vector, delta: Vector, a: f64, b: f64) -> Vector {
    let once = cross(delta, v);
    let twice = cross(delta, once);
    std::array::from_fn(|i| v[i] - a * once[i] + b * twice[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vectors_of(size: f64) -> impl Strategy<Value = Vector> {
        prop::array::uniform3(-size..size)
    }

    /// Rotation vectors of at most the given angle, small ones as often as large ones.
    fn rotation_vectors(largest: f64) -> impl Strategy<Value = Vector> {
        (prop::array::uniform3(-1.0..1.0), -12.0..0.0).prop_filter_map("no axis", move |(axis, size): (Vector, f64)| {
            let norm = dot(axis, axis).sqrt();
            (norm > 0.1).then(|| axis.map(|x| x / norm * largest * 10f64.powf(size.max(-9.0) * size / -12.0)))
        })
    }

    fn close<const N: usize>(a: [f64; N], b: [f64; N], tolerance: f64) -> bool {
        (0..N).all(|i| (a[i] - b[i]).abs() <= tolerance)
    }

    /// Rotation matrix by Rodrigues' formula.
    fn matrix(delta: Vector) -> [Vector; 3] {
        let angle = dot(delta, delta).sqrt();
        let axis = if angle > 0.0 { delta.map(|x| x / angle) } else { [1.0, 0.0, 0.0] };
        std::array::from_fn(|column| {
            let unit: Vector = std::array::from_fn(|i| f64::from(u8::from(i == column)));
            let across = cross(axis, unit);
            let mut rotated = unit.map(|x| x * angle.cos());
            rotated = add_scaled(rotated, angle.sin(), across);
            add_scaled(rotated, (1.0 - angle.cos()) * dot(axis, unit), axis)
        })
    }

    #[test]
    fn product_follows_the_multiplication_table() {
        let [one, i, j, k] = [0, 1, 2, 3].map(|n| std::array::from_fn(|m| f64::from(u8::from(m == n))));
        let minus = |q: Quaternion| q.map(|x| -x);
        assert_eq!((product(i, j), product(j, k), product(k, i)), (k, i, j));
        assert_eq!((product(j, i), product(i, i), product(one, k)), (minus(k), minus(one), k));
    }

    proptest! {
        #[test]
        fn exponential_is_rodrigues_rotation(delta in rotation_vectors(6.0), v in vectors_of(1.0)) {
            let columns = matrix(delta);
            let expected: Vector = std::array::from_fn(|i| (0..3).map(|c| columns[c][i] * v[c]).sum());
            prop_assert!(close(rotate(exp(delta), v), expected, 4e-15));
            prop_assert!((dot(exp(delta), exp(delta)) - 1.0).abs() < 1e-15);
        }

        #[test]
        fn logarithm_inverts_the_exponential(delta in rotation_vectors(3.1)) {
            let size = dot(delta, delta).sqrt();
            prop_assert!(close(log(exp(delta)), delta, 1e-15 * size.max(1e-300) + 1e-15 * size * size));
            prop_assert!(close(log(exp(delta).map(|x| -x)), log(exp(delta)), 0.0));
        }

        /// The branch is the one of least distance among all whole turns.
        #[test]
        fn nearest_logarithm_is_nearest(delta in rotation_vectors(3.1), reference in vectors_of(6.0)) {
            let near = log_near(exp(delta), reference);
            prop_assert!(distance(exp(near), exp(delta)) < 1e-12);
            let off = |v: Vector| dot(add_scaled(v, -1.0, reference), add_scaled(v, -1.0, reference)).sqrt();
            let angle = dot(delta, delta).sqrt();
            for turns in -2..=2 {
                let other = delta.map(|x| x * (1.0 + f64::from(turns) * TAU / angle));
                prop_assert!(off(near) <= off(other) + 1e-6);
            }
        }

        #[test]
        fn inverse_jacobian_inverts_the_jacobian(delta in rotation_vectors(4.7), v in vectors_of(1.0)) {
            prop_assert!(close(inverse_jacobian(delta, jacobian(delta, v)), v, 1e-12));
        }

        /// Angular velocity and acceleration of a turning frame times exp(δ) are the derivatives of the quaternion:
        /// ω = 2q⁻¹q̇, by central differences of the rotation and of the velocity.
        #[test]
        fn motion_is_the_derivative_of_the_rotation(
            delta in rotation_vectors(6.0), slope in vectors_of(2.0), bend in vectors_of(2.0),
            base in rotation_vectors(3.0), spin in vectors_of(2.0), change in vectors_of(2.0)
        ) {
            let at = |t: f64| {
                // The base turns with angular velocity spin + t·change to second order in t.
                let velocity = add_scaled(spin, t, change);
                let angle = add_scaled(spin.map(|x| t * x), 0.5 * t * t, change);
                let twist = cross(spin, change).map(|x| x * t * t * t / 12.0);
                let base = Turning {
                    rotation: product(exp(base), exp(add_scaled(angle, 1.0, twist))),
                    velocity,
                    acceleration: change,
                };
                let delta = add_scaled(add_scaled(delta, t, slope), 0.5 * t * t, bend);
                base.times_exp([delta, add_scaled(slope, t, bend), bend])
            };
            let h = 1e-4;
            let (before, now, after) = (at(-h), at(0.0), at(h));
            let turned = log(product(inverse(before.rotation), after.rotation)).map(|x| x / (2.0 * h));
            prop_assert!(close(turned, now.velocity, 1e-5), "{turned:?} {:?}", now.velocity);
            let changed = add_scaled(after.velocity, -1.0, before.velocity).map(|x| x / (2.0 * h));
            prop_assert!(close(changed, now.acceleration, 1e-5), "{changed:?} {:?}", now.acceleration);
        }
    }

    /// The residuals about the mean add up to zero, from any start and for any signs.
    #[test]
    fn residuals_about_the_mean_add_up_to_zero() {
        let base = exp([0.4, -1.0, 2.0]);
        let spread = [[0.5, 0.2, -0.1], [-0.7, 0.4, 0.3], [0.1, -0.9, 0.2], [1.2, 0.3, -0.5]];
        let rotations: Vec<Quaternion> = spread.iter().map(|&delta| product(base, exp(delta))).collect();
        let signed = rotations.iter().enumerate().map(|(m, q)| if m % 2 == 0 { *q } else { q.map(|x| -x) });
        let centre = mean(rotations[3], signed);
        let residuals = rotations.iter().map(|q| log(product(inverse(centre), *q)));
        let sum = residuals.fold([0.0; 3], |sum, residual| add_scaled(sum, 1.0, residual));
        assert!(dot(sum, sum).sqrt() < 1e-14, "{sum:?}");
        assert!(distance(centre, mean(rotations[0], rotations.iter().copied())) < 1e-14);
    }

    /// Series and closed forms agree where one takes over from the other.
    #[test]
    fn series_meet_the_closed_forms() {
        let (below, above) = (MAX_SERIES_SQUARE, MAX_SERIES_SQUARE.next_up());
        let relative = |a: f64, b: f64| (a / b - 1.0).abs();
        for (a, b) in half_angle(below).into_iter().zip(half_angle(above)) {
            assert!(relative(a, b) < 4e-15, "{a} {b}");
        }
        for (a, b) in jacobian_coefficients(below).into_iter().zip(jacobian_coefficients(above)) {
            assert!(relative(a, b) < 4e-15, "{a} {b}");
        }
        let [a, b] = [below, above].map(|square| jacobian_bends(square, jacobian_coefficients(square)));
        assert!(relative(a[0], b[0]) < 1e-14 && relative(a[1], b[1]) < 1e-14, "{a:?} {b:?}");
    }
}
