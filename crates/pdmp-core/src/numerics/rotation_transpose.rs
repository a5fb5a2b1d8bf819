//! Transposes of the maps of [`super::rotation`]: derivatives of a function by a rotation and its motion, and by the rotation
//! vector.
//!
//! A change of δ turns q = q̄ ⊗ exp(δ) by ε = J(δ)dδ in the body frame. Along a path, whose q̄ may turn, angular velocity and
//! acceleration in that frame change by
//!
//! ```text
//! dω = ε̇ + ω×ε,   dω̇ = ε̈ + ω×ε̇ + ω̇×ε,   ε̇ = J dδ̇ + J̇ dδ,   ε̈ = J dδ̈ + 2J̇ dδ̇ + J̈ dδ,
//! ```
//!
//! and those in the world frame by Rε̇ and R(ε̈ + ω×ε̇). The derivative of J by δ has both orders of its two vectors:
//! dJ(δ; dδ)v = dJ(δ; v)dδ + Jv×J dδ.

// Functions outside of the control loop stay calls, so that the library stays small.
use super::rotation::{
    Quaternion, Vector, add_scaled, cross, dot, inverse, jacobian_bends, jacobian_coefficients, product, shrinkage,
    unbounded_inverse_jacobian, vector,
};

/// J(δ) along a path, J(δ)v = (1 − h)v − a×v + b(δ·v) with a = c₁δ, b = c₂δ and h = b·δ, which is given with two derivatives.
pub(crate) struct JacobianPath {
    delta: [Vector; 3],
    a: [Vector; 3],
    b: [Vector; 3],
    h: [f64; 3],
}

impl JacobianPath {
    /// Returns the path for δ, δ̇ and δ̈.
    #[inline(never)]
    pub(crate) fn new(delta: [Vector; 3]) -> Self {
        let [place, slope, bend] = delta;
        let square = dot(place, place);
        let [c, d, c_slope, d_slope] = jacobian_coefficients(square);
        let [c_bend, d_bend] = jacobian_bends(square, [c, d, c_slope, d_slope]);
        // Half the derivatives of θ².
        let [growth, change] = [dot(place, slope), dot(slope, slope) + dot(place, bend)];
        let scaled = |c: f64, by_growth: f64, by_square: f64| {
            let (rate, curve) = (by_growth * growth, by_square * growth * growth + by_growth * change);
            [
                place.map(|x| c * x),
                std::array::from_fn(|i| c * slope[i] + rate * place[i]),
                std::array::from_fn(|i| c * bend[i] + 2.0 * rate * slope[i] + curve * place[i]),
            ]
        };
        let (a, b) = (scaled(c, c_slope, c_bend), scaled(d, d_slope, d_bend));
        let h = [
            dot(b[0], place),
            dot(b[1], place) + dot(b[0], slope),
            dot(b[2], place) + 2.0 * dot(b[1], slope) + dot(b[0], bend),
        ];
        Self { delta, a, b, h }
    }

    /// Returns the product of the transpose of the derivative of an order of J, up to 2, with a vector.
    #[inline(never)]
    fn transposed(&self, order: usize, v: Vector) -> Vector {
        let Self { delta, a, b, h } = self;
        let [x, y, z] = match order {
            0 => [dot(b[0], v), 0.0, 0.0],
            1 => [dot(b[1], v), dot(b[0], v), 0.0],
            _ => [dot(b[2], v), 2.0 * dot(b[1], v), dot(b[0], v)],
        };
        let across = cross(a[order], v);
        let own = if order == 0 { 1.0 - h[0] } else { -h[order] };
        std::array::from_fn(|i| own * v[i] + across[i] + x * delta[0][i] + y * delta[1][i] + z * delta[2][i])
    }

    /// Returns the cotangents of δ, δ̇ and δ̈ for those of ε, ε̇ and ε̈.
    pub(crate) fn pull_back(&self, [turn, flow, bend]: [Vector; 3]) -> [Vector; 3] {
        let [by_turn, by_flow, by_bend] = [turn, flow, bend].map(|v| self.transposed(0, v));
        let moved = add_scaled(self.transposed(1, flow), 1.0, self.transposed(2, bend));
        [add_scaled(by_turn, 1.0, moved), add_scaled(by_flow, 2.0, self.transposed(1, bend)), by_bend]
    }
}

/// Returns the cotangent of small rotations in the body frame for that of the components of a unit quaternion, ½ vec(q* ⊗ g).
#[inline(always)]
pub(crate) fn turn_cotangent(q: Quaternion, by_components: Quaternion) -> Vector {
    vector(product(inverse(q), by_components)).map(|x| 0.5 * x)
}

/// Returns the gradient of a function of q/|q| by the components of q for its cotangent of small rotations in the body frame.
pub(crate) fn quaternion_gradient(q: Quaternion, turn: Vector) -> Quaternion {
    let scale = 2.0 / dot(q, q);
    product(q, [0.0, turn[0], turn[1], turn[2]]).map(|x| scale * x)
}

/// Returns the cotangent of small rotations of exp(δ) in the body frame for that of δ.
pub(crate) fn log_pull_back(delta: Vector, by_delta: Vector) -> Vector {
    unbounded_inverse_jacobian(delta.map(|x| -x), by_delta)
}

/// Returns the cotangents of v and δ for that of J⁻¹(δ)v, with the limit of [`super::rotation::inverse_jacobian`].
pub(crate) fn inverse_jacobian_pull_back(delta: Vector, v: Vector, by_slope: Vector) -> [Vector; 2] {
    let shrinkage = shrinkage(delta);
    let near = delta.map(|x| shrinkage * x);
    let by_v = log_pull_back(near, by_slope);
    let path = JacobianPath::new([near, unbounded_inverse_jacobian(near, v), [0.0; 3]]);
    let change = add_scaled(path.transposed(1, by_v), 1.0, path.transposed(0, cross(by_v, v)));
    let by_delta = change.map(|x| -shrinkage * x);
    // The length of a shortened δ is fixed.
    let along = if shrinkage < 1.0 { dot(by_delta, delta) / dot(delta, delta) } else { 0.0 };
    [by_v, add_scaled(by_delta, -along, delta)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::rotation::{Turning, exp, inverse_jacobian, log, normalised};
    use crate::random::Random;

    fn vector_of(random: &mut Random, size: f64) -> Vector {
        std::array::from_fn(|_| size * (2.0 * random.next() - 1.0))
    }

    /// Central differences of a function of several vectors.
    fn differences<const N: usize>(at: [Vector; N], of: impl Fn([Vector; N]) -> f64) -> [Vector; N] {
        let moved = |k: usize, i: usize, step: f64| {
            let mut moved = at;
            moved[k][i] += step;
            of(moved)
        };
        let slope = |k, i, step| (moved(k, i, step) - moved(k, i, -step)) / (2.0 * step);
        let step = 2e-4;
        std::array::from_fn(|k| std::array::from_fn(|i| (4.0 * slope(k, i, step) - slope(k, i, 2.0 * step)) / 3.0))
    }

    fn assert_close<const N: usize>(found: [Vector; N], expected: [Vector; N], tolerance: f64) {
        let size = expected.as_flattened().iter().fold(1.0f64, |size, x| size.max(x.abs()));
        for (a, b) in found.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((a - b).abs() < tolerance * size, "{found:?} {expected:?}");
        }
    }

    /// Angles about zero, on both sides of the limits of the series, and beyond half a turn.
    fn delta_of(random: &mut Random, case: usize) -> Vector {
        let axis = vector_of(random, 1.0);
        let angle = [0.0, 1e-9, 1e-4, 0.5, 1.5, 2.5, 3.5, 4.6, 5.5][case % 9];
        let norm = dot(axis, axis).sqrt().max(1e-3);
        axis.map(|x| x / norm * angle)
    }

    /// The cotangents of δ, δ̇ and δ̈ are the derivatives of a function of rotation, angular velocity and acceleration.
    #[test]
    fn cotangents_of_motions_are_derivatives() {
        let mut random = Random(3);
        for case in 0..900 {
            let at = [delta_of(&mut random, case), vector_of(&mut random, 2.0), vector_of(&mut random, 2.0)];
            let [base, velocity, acceleration, flow, bend] = [(); 5].map(|()| vector_of(&mut random, 2.0));
            let by_components: Quaternion = std::array::from_fn(|_| random.next() - 0.5);
            let mean = Turning { rotation: exp(base), velocity, acceleration };
            let expected = differences(at, |at| {
                let moved = mean.times_exp(at);
                dot(by_components, moved.rotation) + dot(flow, moved.velocity) + dot(bend, moved.acceleration)
            });
            let Turning { rotation, velocity, acceleration } = mean.times_exp(at);
            let turn = turn_cotangent(rotation, by_components);
            let turn = add_scaled(add_scaled(turn, 1.0, cross(flow, velocity)), 1.0, cross(bend, acceleration));
            let flow = add_scaled(flow, 1.0, cross(bend, velocity));
            assert_close(JacobianPath::new(at).pull_back([turn, flow, bend]), expected, 1e-9);
        }
    }

    /// The cotangents of v and δ are the derivatives of a function of J⁻¹(δ)v.
    #[test]
    fn cotangents_of_the_inverse_are_derivatives() {
        let mut random = Random(5);
        for case in 0..900 {
            let (delta, v) = (delta_of(&mut random, case), vector_of(&mut random, 2.0));
            let by_slope = vector_of(&mut random, 1.0);
            let expected = differences([v, delta], |[v, delta]| dot(by_slope, inverse_jacobian(delta, v)));
            assert_close(inverse_jacobian_pull_back(delta, v, by_slope), expected, 1e-9);
        }
    }

    /// The gradient by the components of a quaternion of any length is that of the rotation vector, and orthogonal to it.
    #[test]
    fn gradients_by_quaternions_are_derivatives() {
        let mut random = Random(7);
        for case in 0..900 {
            let norm = 0.9 + 0.2 * random.next();
            let q = exp(delta_of(&mut random, case % 7)).map(|x| norm * x);
            let by_delta = vector_of(&mut random, 1.0);
            let found = quaternion_gradient(q, log_pull_back(log(normalised(q)), by_delta));
            assert!(dot(found, q).abs() < 1e-14);
            let ([w, x, y, z], [a, b, c, d]) = (q, found);
            let of = |[[w, _, _], [x, y, z]]: [Vector; 2]| dot(by_delta, log(normalised([w, x, y, z])));
            let [[first, ..], rest] = differences([[w, 0.0, 0.0], [x, y, z]], of);
            assert_close([[a, 0.0, 0.0], [b, c, d]], [[first, 0.0, 0.0], rest], 1e-8);
        }
    }
}
