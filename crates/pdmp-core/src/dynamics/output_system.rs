//! Exact propagation of the output system, and its inverse.
//!
//! With the clock u (u̇ = 1/τ), e = y − g₀ and a forcing w the output system (Eqs. 1, 2 and 5) is linear:
//!
//! ```text
//! d/du [e; z] = A [e; z] + [w(u); α_zβ_z γ(u)],     A = [0, 1; −α_zβ_z, −α_z]
//! ```
//!
//! where γ = g − g₀ is the displacement of the goal since the start of the step. Relative to a moving frame (`transport`),
//! e obeys the same system. For cubic w and γ the solution over a step h is a combination of φ-functions of Ah (Hochbruck
//! and Ostermann, Acta Numerica 19, 2010), so that a step is stable and exact for every h. The inverse system drives z by a
//! given y, which is the same problem in one dimension.

use crate::numerics::simd::Real;

/// Gains of the output system z′ = α_z(β_z(g − y) − z), y′ = z + w.
///
/// ```
/// use pdmp_core::dynamics::Attractor;
///
/// let critically_damped = Attractor { alpha_z: 25.0, beta_z: 25.0 / 4.0 };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attractor {
    /// Gain α_z, per unit of the clock.
    pub alpha_z: f64,
    /// Gain β_z, per unit of the clock; β_z = α_z/4 is critically damped.
    pub beta_z: f64,
}

/// Hermite data of a cubic at one end: its value, and its derivative with respect to the clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct CubicSample<T = f64> {
    pub(crate) value: T,
    pub(crate) slope: T,
}

/// State of a degree of freedom relative to its attractor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct State<T = f64> {
    /// Displacement y − g, in the unit of the DoF.
    pub(crate) e: T,
    /// Auxiliary state z of Eq. (1), in the unit of the DoF.
    pub(crate) z: T,
}

/// Weights of the Hermite data of a cubic at both ends of a step: of its two values, then of its two slopes.
type HermiteWeights = [f64; 4];

/// Returns the weighted sum of the Hermite data of a cubic.
#[inline(always)]
fn hermite_dot<T: Real>(weights: &HermiteWeights, [from, to]: [CubicSample<T>; 2]) -> T {
    from.value * weights[0] + to.value * weights[1] + (from.slope * weights[2] + to.slope * weights[3])
}

/// Propagator of the output system over a step of fixed length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Propagator {
    /// Length of the step on the clock.
    pub(crate) h: f64,
    /// The part of a goal at rest.
    pub(crate) resting: RestingPropagator,
    /// Response of e and z to the goal's displacement γ.
    pub(crate) goal: [HermiteWeights; 2],
}

/// Propagator of the output system about a goal at rest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RestingPropagator {
    /// exp(Ah), by rows.
    pub(crate) transition: [[f64; 2]; 2],
    /// Response of e and z to the forcing w.
    pub(crate) forcing: [HermiteWeights; 2],
}

impl Attractor {
    /// Returns ω = √(α_zβ_z) and exp(−ζa) with the damping ratio ζ = α_z/2ω and a = arccos(ζ)/√(1 − ζ²).
    ///
    /// After a step of the goal by 1 the peak velocity is ω·exp(−ζa); after a step of z by 1 the peak displacement is
    /// exp(−ζa)/ω.
    fn peak(&self) -> (f64, f64) {
        let omega = (self.alpha_z * self.beta_z).sqrt();
        let damping = 0.5 * self.alpha_z / omega;
        let root = (damping * damping - 1.0).abs().sqrt();
        let angle = if root < 1e-6 {
            1.0
        } else if damping < 1.0 {
            damping.acos() / root
        } else {
            damping.acosh() / root
        };
        (omega, (-damping * angle).exp())
    }

    /// Returns the peak velocity on the clock after a step of the goal by 1.
    pub(crate) fn step_peak(&self) -> f64 {
        let (omega, decay) = self.peak();
        omega * decay
    }

    /// Returns the peak displacement after a step of z by 1.
    pub(crate) fn impulse_peak(&self) -> f64 {
        let (omega, decay) = self.peak();
        decay / omega
    }

    /// Returns the propagator over a clock interval `h`.
    pub(crate) fn propagator(&self, h: f64) -> Propagator {
        let stiffness = self.alpha_z * self.beta_z;
        let phi = phi_functions(-self.alpha_z * h, stiffness * h * h);
        // Entries of the 2 × 2 matrix a·I + b·Ah.
        let e_to_e = |[a, _]: [f64; 2]| a;
        let e_to_z = |[_, b]: [f64; 2]| -b * (h * stiffness);
        let z_to_e = |[_, b]: [f64; 2]| b * h;
        let z_to_z = |[a, b]: [f64; 2]| a - b * (h * self.alpha_z);
        let shift = |[a, b]: [f64; 2]| [a * stiffness, b * stiffness];
        Propagator {
            h,
            resting: RestingPropagator {
                transition: [[e_to_e(phi[0]), z_to_e(phi[0])], [e_to_z(phi[0]), z_to_z(phi[0])]],
                forcing: [hermite_weights(h, phi.map(e_to_e)), hermite_weights(h, phi.map(e_to_z))],
            },
            goal: [hermite_weights(h, phi.map(shift).map(z_to_e)), hermite_weights(h, phi.map(shift).map(z_to_z))],
        }
    }

    /// Returns z′ = α_z(β_z(g − y) − z) at a state relative to the goal.
    #[inline(always)]
    pub(crate) fn z_slope<T: Real>(&self, State { e, z }: State<T>) -> T {
        (e * self.beta_z + z) * -self.alpha_z
    }

    /// Returns the inverse of the output system for movements sampled at clock intervals `h`.
    pub(crate) fn inverse(&self, h: f64) -> Inverse {
        let m = -self.alpha_z * h;
        // The scalar m is treated as a 2 × 2 matrix with eigenvalues m and 0.
        let phi = phi_functions(m, 0.0).map(|[a, b]| a + b * m);
        let stiffness = self.alpha_z * self.beta_z;
        Inverse { m, decay: phi[0], weights: hermite_weights(h, phi).map(|weight| stiffness * weight) }
    }
}

/// Inverse of the output system over steps of fixed length: a given movement y drives z.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inverse {
    /// −α_zh.
    m: f64,
    /// exp(−α_zh).
    decay: f64,
    /// Response of z to g − y.
    weights: HermiteWeights,
}

impl Inverse {
    /// Computes the target f = y′ − z, the forcing under which the output system reproduces a movement (step 2 of Section
    /// 3.2), and overwrites the positions with it.
    ///
    /// `position` and `slope` = dy/du (C,) are samples of one cubic spline, and `attractor` is the goal or anchor. z is the
    /// exact solution of Eq. (1) driven by that spline, with z(0) = 0 or, for a `periodic` movement of which the C samples
    /// are one cycle, in the periodic steady state.
    pub(crate) fn target<T: Real>(&self, position: &mut [T], slope: &[T], attractor: T, periodic: bool) {
        let n = position.len();
        let distance = |y: T, dy: T| CubicSample { value: attractor - y, slope: T::default() - dy };
        let mut z = T::default();
        if periodic {
            for (c, next) in (0..n).zip((1..n).chain([0])) {
                z = self.step(z, [c, next].map(|c| distance(position[c], slope[c])));
            }
            z = z * (1.0 / -(self.m * n as f64).exp_m1());
        }
        let mut from = distance(position[0], slope[0]);
        for c in 1..n {
            let to = distance(position[c], slope[c]);
            position[c - 1] = slope[c - 1] - z;
            z = self.step(z, [from, to]);
            from = to;
        }
        position[n - 1] = slope[n - 1] - z;
    }

    /// Returns z after one step, given g − y at both ends of the step.
    #[inline(always)]
    fn step<T: Real>(&self, z: T, distances: [CubicSample<T>; 2]) -> T {
        z * self.decay + hermite_dot(&self.weights, distances)
    }
}

impl Propagator {
    /// Returns the length of the step on the clock.
    pub(crate) fn step(&self) -> f64 {
        self.h
    }

    /// Returns the state after the step under the forcing w.
    #[inline(always)]
    pub(crate) fn advance<T: Real>(&self, state: State<T>, forcing: [CubicSample<T>; 2]) -> State<T> {
        self.resting.advance(state, forcing)
    }

    /// Returns the response of the state to the displacement γ of the goal, relative to the goal at the start of the step.
    #[inline(always)]
    pub(crate) fn follow<T: Real>(&self, goal: [CubicSample<T>; 2]) -> State<T> {
        State { e: hermite_dot(&self.goal[0], goal), z: hermite_dot(&self.goal[1], goal) }
    }
}

impl RestingPropagator {
    /// Returns the state after the step under the forcing w.
    #[inline(always)]
    pub(crate) fn advance<T: Real>(&self, state: State<T>, forcing: [CubicSample<T>; 2]) -> State<T> {
        let [[ee, ez], [ze, zz]] = self.transition;
        State {
            e: (state.e * ee + state.z * ez) + hermite_dot(&self.forcing[0], forcing),
            z: (state.e * ze + state.z * zz) + hermite_dot(&self.forcing[1], forcing),
        }
    }
}

/// 1/k!.
pub(crate) const INVERSE_FACTORIAL: [f64; 19] = {
    let mut inverse = [1.0; 19];
    let mut k = 1;
    while k < 19 {
        inverse[k] = inverse[k - 1] / k as f64;
        k += 1;
    }
    inverse
};

/// Returns φ₀ … φ₄ of a 2 × 2 matrix M, each as [a, b] for a·I + b·M; `trace` and `determinant` are those of M.
///
/// By the Cayley–Hamilton theorem M² = trace·M − determinant·I, so that every power of M has this form, for complex,
/// repeated (critical damping) and real eigenvalues alike.
fn phi_functions(trace: f64, determinant: f64) -> [[f64; 2]; 5] {
    let size = trace.abs().max(determinant.abs().sqrt());
    let (mut trace, mut determinant, mut doublings) = (trace, determinant, 0);
    if size > 0.5 {
        doublings = (size / 0.5).log2().ceil() as i32;
        let shrink = 0.5f64.powi(doublings);
        (trace, determinant) = (trace * shrink, determinant * shrink * shrink);
    }

    // φ₄ by its Taylor series Σ Mʲ/(j+4)!, the others by φₖ = Mφₖ₊₁ + I/k!. The eigenvalues are at most 1.62 times the
    // size, so that the truncation error lies below 1e-18.
    let terms = if size < 0.0625 { 9 } else { 15 };
    let times_m = |[a, b]: [f64; 2]| [-determinant * b, a + trace * b];
    let mut phi = [[0.0; 2]; 5];
    for inverse_factorial in INVERSE_FACTORIAL[4..4 + terms].iter().rev() {
        phi[4] = times_m(phi[4]);
        phi[4][0] += inverse_factorial;
    }
    for k in (0..4).rev() {
        phi[k] = times_m(phi[k + 1]);
        phi[k][0] += INVERSE_FACTORIAL[k];
    }

    // φₖ(2M) = 2⁻ᵏ (φ₀φₖ + Σⱼ₌₁ᵏ φⱼ/(k−j)!), and a + bM = a + (b/2)(2M).
    for _ in 0..doublings {
        let [a, b] = phi[0];
        let small = phi;
        for k in 0..5 {
            let [c, d] = small[k];
            let mut doubled = [a * c - determinant * b * d, a * d + b * c + trace * b * d];
            for j in 1..=k {
                doubled[0] += small[j][0] * INVERSE_FACTORIAL[k - j];
                doubled[1] += small[j][1] * INVERSE_FACTORIAL[k - j];
            }
            let scale = 0.5f64.powi(k as i32);
            phi[k] = [doubled[0] * scale, doubled[1] * scale / 2.0];
        }
        trace *= 2.0;
        determinant *= 4.0;
    }
    phi
}

/// Returns the weights of the Hermite data of a cubic p over a step h in ∫₀ʰ exp(a(h−s)) p(s) ds = h Σₖ cₖ k! φₖ₊₁(ah).
fn hermite_weights(h: f64, phi: [f64; 5]) -> HermiteWeights {
    let [_, one, two, three, four] = phi;
    let end_value = 6.0 * three - 12.0 * four;
    let square = h * h;
    [
        h * (one - end_value),
        h * end_value,
        square * (two - 4.0 * three + 6.0 * four),
        square * (6.0 * four - 2.0 * three),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::runge_kutta::rk4;
    use approx::assert_relative_eq;
    use nalgebra::Matrix2;
    use ndarray::Array1;
    use proptest::prelude::*;

    /// Integrates the output system by RK4 in small steps, independently of the φ-functions.
    fn reference(system: Attractor, mut s: [f64; 2], h: f64, w: [f64; 4], g: [f64; 4]) -> [f64; 2] {
        let n = 20_000;
        let dt = h / n as f64;
        let cubic = |c: [f64; 4], u: f64| {
            let x = u / h;
            c[0] + x * (c[1] + x * (c[2] + x * c[3]))
        };
        let f = |u: f64, [e, z]: [f64; 2]| [z + cubic(w, u), system.alpha_z * (system.beta_z * (cubic(g, u) - e) - z)];
        for i in 0..n {
            s = rk4(f, i as f64 * dt, s, dt);
        }
        s
    }

    fn hermite_data(c: [f64; 4], h: f64) -> [CubicSample; 2] {
        let from = CubicSample { value: c[0], slope: c[1] / h };
        let to = CubicSample { value: c.iter().sum(), slope: (c[1] + 2.0 * c[2] + 3.0 * c[3]) / h };
        [from, to]
    }

    /// Steps of any length are exact for cubic forcing and a cubic goal, with repeated, complex and real eigenvalues.
    #[test]
    fn propagation_is_exact_for_cubic_forcing() {
        for (alpha_z, beta_z) in [(25.0, 6.25), (1.5, 1.5), (10.0, 0.7)] {
            for h in [1e-3, 0.1, 1.0] {
                let system = Attractor { alpha_z, beta_z };
                let (w, g) = ([0.3, -1.0, 2.0, 0.7], [0.0, 0.4, -0.3, 0.2]);
                let propagator = system.propagator(h);
                let mut state = propagator.advance(State { e: 0.5, z: -0.2 }, hermite_data(w, h));
                let moved = propagator.follow(hermite_data(g, h));
                state.e += moved.e;
                state.z += moved.z;
                let [e, z] = reference(system, [0.5, -0.2], h, w, g);
                assert_relative_eq!(state.e, e, max_relative = 1e-9, epsilon = 1e-11);
                assert_relative_eq!(state.z, z, max_relative = 1e-9, epsilon = 1e-11);
            }
        }
    }

    proptest! {
        /// exp(Ah) by doubling equals the matrix exponential of nalgebra.
        #[test]
        fn transition_is_the_matrix_exponential(alpha_z in 0.01..60.0f64, ratio in 0.05..2.0f64, h in 1e-6..2.0f64) {
            let system = Attractor { alpha_z, beta_z: alpha_z * ratio };
            let stiffness = system.alpha_z * system.beta_z;
            let expected = (Matrix2::new(0.0, 1.0, -stiffness, -alpha_z) * h).exp();
            let found = system.propagator(h).resting.transition;
            let size = expected.abs().max() + 1e-3;
            for row in 0..2 {
                for column in 0..2 {
                    prop_assert!((found[row][column] - expected[(row, column)]).abs() <= 1e-11 * size);
                }
            }
        }

        /// Without forcing, steps of any length keep the state bounded.
        #[test]
        fn steps_of_any_length_are_stable(h in 1e-6..1e4f64, alpha_z in 0.1..100.0f64) {
            let system = Attractor { alpha_z, beta_z: alpha_z / 4.0 };
            let mut state = State { e: 1.0, z: 0.0 };
            let propagator = system.propagator(h);
            for _ in 0..1000 {
                state = propagator.advance(state, [CubicSample::default(); 2]);
                prop_assert!(state.e.abs() <= 1.0 + 1e-12 && state.z.is_finite());
            }
        }
    }

    /// Propagation under the target of a movement reproduces the movement.
    #[test]
    fn target_and_propagation_are_inverse() {
        let system = Attractor { alpha_z: 25.0, beta_z: 6.25 };
        let n = 401;
        let h = 1.0 / (n - 1) as f64;
        let u: Array1<f64> = Array1::linspace(0.0, 1.0, n);
        let y = u.mapv(|u| (3.0 * u).sin() + 0.2 * u).to_vec();
        let dy = u.mapv(|u| 3.0 * (3.0 * u).cos() + 0.2).to_vec();
        let goal = 0.9;
        let mut w = y.clone();
        system.inverse(h).target(&mut w, &dy, goal, false);
        let propagator = system.propagator(h);
        let slope = |c: usize| {
            let (from, to) = (c.saturating_sub(1), (c + 1).min(n - 1));
            (w[to] - w[from]) / ((to - from) as f64 * h)
        };
        let sample = |c: usize| CubicSample { value: w[c], slope: slope(c) };
        let mut state = State { e: y[0] - goal, z: 0.0 };
        for c in 0..n - 1 {
            state = propagator.advance(state, [sample(c), sample(c + 1)]);
            assert_relative_eq!(state.e + goal, y[c + 1], epsilon = 2e-5);
        }
    }

    /// In the periodic steady state a sine has the target y′ − z with z the first-order low-pass of β(g − y).
    #[test]
    fn periodic_target_matches_the_frequency_response() {
        let system = Attractor { alpha_z: 8.0, beta_z: 2.0 };
        let n = 400;
        let h = std::f64::consts::TAU / n as f64;
        let u = Array1::from_iter((0..n).map(|c| c as f64 * h));
        let (mut f, dy) = (u.mapv(|u| (2.0 * u).sin()).to_vec(), u.mapv(|u| 2.0 * (2.0 * u).cos()).to_vec());
        system.inverse(h).target(&mut f, &dy, 0.0, true);
        let (alpha, beta) = (8.0, 2.0);
        for c in 0..n {
            let (sin, cos) = (2.0 * u[c]).sin_cos();
            let z = -alpha * beta * (alpha * sin - 2.0 * cos) / (alpha * alpha + 4.0);
            assert_relative_eq!(f[c], 2.0 * cos - z, epsilon = 1e-6);
        }
    }
}
