//! Normalised Gaussian network: regression by Gaussian basis functions that sum to one.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, MatMut, MatRef, Par, Side};
use ndarray::{ArrayView2, Axis};

use super::{Domain, Regression, magnitude};
use crate::dynamics::canonical::turn;
use crate::error::{Error, Result};
use crate::validate::check_range;

/// Margin of the centres beyond either end of an interval, in centre spacings.
///
/// Without a margin the slope at the ends is inaccurate: 50 functions reproduce a minimum-jerk movement to 4e-5 of its
/// range without one, 6e-6 with one spacing and 5e-7 with two, and handwriting at worst to 1.7e-3, 9e-4 and 6e-4.
const MARGIN: f64 = 2.0;

/// Ridge penalty on the weights, relative to the scale of the design matrix.
///
/// With about equal numbers of samples and functions, weights that alternate in sign hardly change the values at the
/// samples: with noise of 1e-3 on 50 samples, the error of 50 functions was 0.35 of the range at a penalty of 1e-8, and 5e-4 at 1e-5
/// and at 1e-4. A penalty of up to 1e-4 does not affect a well-posed fit: handwriting 4e-4, minimum jerk 1e-6.
///
/// The penalty also bounds the condition number of the normal equations by 1e8. Their rounding then changes the outputs
/// by about 1e-12; a QR decomposition of the design matrix would take five times as long.
const RIDGE: f64 = 1e-4;

/// Distance from a centre, in widths, beyond which a basis function is negligible: exp(−8.5²/2) = 2e-16.
const REACH: f64 = 8.5;

/// Points at which the basis functions are evaluated together.
const PORTION: usize = 64;

/// Normalised Gaussian network.
///
/// b(u) = Σₖ wₖψₖ(u) / Σᵢψᵢ(u), with N basis functions at equal spacings h on the clock u. On an interval
/// ψₖ = exp(−(u − cₖ)²/2s²), and the outermost centres lie 2h beyond the ends; on the circle ψₖ is the von Mises
/// function exp((cos(u − cₖ) − 1)/s²). Their width is s = `overlap`·h. Functions far from u are skipped. The weights
/// are fitted in O(C·N² + N³).
///
/// Moody and Darken, Neural Computation 1 (1989) 281–294; as the basis of movement primitives: Ijspeert, Nakanishi,
/// Hoffmann, Pastor and Schaal, Neural Computation 25 (2013) 328–373, <https://doi.org/10.1162/NECO_a_00393>.
///
/// ```
/// # use ndarray::Array2;
/// use pdmp_core::learning::regression::{Domain, NGnet, Regression};
///
/// let u: Vec<f64> = (0..50).map(|i| f64::from(i) / 49.0).collect();
/// let targets = Array2::from_shape_fn((50, 1), |(i, _)| (3.0 * u[i]).sin());
/// let network = NGnet::new(30, 1.2)?.regress(Domain::Interval { end: 1.0 }, &u, targets.view())?;
/// let (mut value, mut slope) = ([0.0], [0.0]);
/// network.evaluate(0.5, &mut value, &mut slope);
/// assert!((value[0] - 1.5f64.sin()).abs() < 1e-3);
/// # Ok::<(), pdmp_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct NGnet {
    /// Number of basis functions N, from 2 to 1000.
    pub n_basis: usize,
    /// Width s of a basis function in centre spacings, from 0.3 to 3.
    ///
    /// Narrow functions ripple between their centres; wide ones are nearly linearly dependent. Between 1 and 1.5 the fit
    /// hardly changes.
    pub overlap: f64,
}

impl Default for NGnet {
    /// Returns a network of 50 functions, 1.2 spacings wide.
    fn default() -> Self {
        Self { n_basis: 50, overlap: 1.2 }
    }
}

impl NGnet {
    /// Returns a network of `n_basis` functions, `overlap` centre spacings wide.
    ///
    /// # Errors
    /// A number outside 2 to 1000, or a width outside 0.3 to 3.
    pub fn new(n_basis: usize, overlap: f64) -> Result<Self> {
        let ngnet = Self { n_basis, overlap };
        ngnet.check()?;
        Ok(ngnet)
    }

    /// Regresses `targets` (C, outputs) on the clock `u` (C,), which must not decrease.
    ///
    /// # Errors
    /// Settings out of range, arrays that do not match, or values that are not finite.
    pub fn regress(&self, domain: Domain, u: &[f64], targets: ArrayView2<f64>) -> Result<NGnetRegression> {
        self.check()?;
        super::check(domain, u, targets)?;
        let (n_samples, n_outputs) = targets.dim();
        let functions = Functions::new(self, domain);
        let scale: Vec<f64> = targets.columns().into_iter().map(magnitude).collect();

        // The normal equations ΦᵀΦ and Φᵀy.
        let n_basis = self.n_basis;
        let (mut system, mut right) = (Mat::<f64>::zeros(n_basis, n_basis), Mat::<f64>::zeros(n_basis, n_outputs));
        let mut rows = Design::new(n_basis);
        for (u, targets) in u.chunks(PORTION).zip(targets.axis_chunks_iter(Axis(0), PORTION)) {
            functions.fill(&mut rows, u);
            let (phi, _) = rows.matrices(n_basis);
            let (lower, dense) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
            triangular::matmul(&mut system, lower, Accum::Add, phi.transpose(), dense, phi, dense, 1.0, Par::Seq);
            let y = Mat::from_fn(u.len(), n_outputs, |i, o| targets[[i, o]] / scale[o]);
            matmul(&mut right, Accum::Add, phi.transpose(), &y, 1.0, Par::Seq);
        }
        for k in 0..n_basis {
            system[(k, k)] += RIDGE * RIDGE * n_samples as f64 / n_basis as f64;
        }
        let factor = system
            .llt(Side::Lower)
            .map_err(|_| Error::Fit("the basis functions of the network are linearly dependent".into()))?;
        let solution = factor.solve(right);
        let weights = (0..n_basis * n_outputs).map(|at| (at / n_outputs, at % n_outputs));
        let weights = weights.map(|(k, o)| solution[(k, o)] * scale[o]).collect();
        Ok(NGnetRegression { functions, weights })
    }

    fn check(&self) -> Result<()> {
        let Self { n_basis, overlap } = *self;
        check_range("n_basis", n_basis as f64, (2..=1000).contains(&n_basis), "must lie between 2 and 1000")?;
        check_range("overlap", overlap, (0.3..=3.0).contains(&overlap), "must lie between 0.3 and 3")
    }
}

/// Basis functions ψₖ.
#[derive(Clone, Debug)]
struct Functions {
    settings: NGnet,
    domain: Domain,
    /// First centre.
    first: f64,
    /// Centre spacing h.
    spacing: f64,
    /// Number of functions on either side of the nearest one that are not negligible.
    reach: usize,
    /// Ratios exp(−(2i + 1)h²/2s²) of the functions i + 1 and i from the nearest one, at its centre; on an interval.
    ratios: Vec<f64>,
}

impl Functions {
    fn new(ngnet: &NGnet, domain: Domain) -> Self {
        let gaps = (ngnet.n_basis - 1) as f64;
        let (first, spacing, reach) = match domain {
            Domain::Interval { end } => {
                // At least half of the spacings of a small network lie inside.
                let margin = MARGIN.min(gaps / 4.0);
                let spacing = end / (gaps - 2.0 * margin);
                (-margin * spacing, spacing, REACH * ngnet.overlap)
            }
            Domain::Circle => {
                let spacing = domain.extent() / ngnet.n_basis as f64;
                // 1 − cos r = (REACH·s)²/2; wide functions reach around the whole circle.
                let angle = 2.0 * (REACH * ngnet.overlap * spacing / 2.0).min(1.0).asin();
                (0.0, spacing, angle / spacing)
            }
        };
        // The nearest centre lies up to half a spacing away.
        let reach = (reach + 0.5).ceil() as usize;
        let ratio = |i: usize| (-0.5 * (2 * i + 1) as f64 / ngnet.overlap.powi(2)).exp();
        let ratios = (0..reach).map(ratio).collect();
        Self { settings: ngnet.clone(), domain, first, spacing, reach, ratios }
    }

    /// Returns the largest number of functions that are not negligible at one point.
    fn window(&self) -> usize {
        self.settings.n_basis.min(2 * self.reach + 1)
    }

    /// Computes φₖ = ψₖ/Σᵢψᵢ and their derivatives at each `u`.
    fn fill(&self, rows: &mut Design, u: &[f64]) {
        let n_basis = self.settings.n_basis;
        for numbers in [&mut rows.values, &mut rows.slopes] {
            numbers.clear();
            numbers.resize(u.len() * n_basis, 0.0);
        }
        let both = rows.values.chunks_exact_mut(n_basis).zip(rows.slopes.chunks_exact_mut(n_basis));
        for (&u, (phi, slope)) in u.iter().zip(both) {
            // With q = Σψ: φ = ψ/q and φ′ = φ(ln ψ − ln q)′.
            let (mut q, mut dq) = (0.0, 0.0);
            self.for_each(u, |k, psi, rate| {
                (phi[k], slope[k]) = (psi, rate);
                q += psi;
                dq += psi * rate;
            });
            let (inverse, rate) = (1.0 / q, dq / q);
            for (phi, slope) in phi.iter_mut().zip(slope) {
                *phi *= inverse;
                *slope = *phi * (*slope - rate);
            }
        }
    }

    /// Calls `visit(k, ψₖ, d ln ψₖ/du)` for the functions near `u`, scaled so that the largest one is 1.
    ///
    /// The scale cancels in the network. Without it every ψ would underflow far from the centres. On an interval a
    /// single exponential yields the ratios of all neighbours.
    fn for_each(&self, u: f64, mut visit: impl FnMut(usize, f64, f64)) {
        let NGnet { n_basis, overlap } = self.settings;
        let precision = 1.0 / (overlap * self.spacing).powi(2);
        let centre = |k: usize| self.first + k as f64 * self.spacing;
        match self.domain {
            Domain::Interval { .. } => {
                let nearest = (((u - self.first) / self.spacing).round() as usize).min(n_basis - 1);
                let rate = |k: usize| (centre(k) - u) * precision;
                let growth = ((u - centre(nearest)) * self.spacing * precision).exp();
                let decay = 1.0 / growth;
                let (mut above, mut below) = (1.0, 1.0);
                visit(nearest, 1.0, rate(nearest));
                for (k, ratio) in (nearest + 1..n_basis).zip(&self.ratios) {
                    above *= growth * ratio;
                    visit(k, above, rate(k));
                }
                for (k, ratio) in (0..nearest).rev().zip(&self.ratios) {
                    below *= decay * ratio;
                    visit(k, below, rate(k));
                }
            }
            Domain::Circle => {
                let u = turn(u);
                let nearest = (u / self.spacing).round() as usize;
                let largest = (u - centre(nearest)).cos();
                let window = self.window();
                // The functions outside the window lie on the opposite side.
                let first = nearest + n_basis - window / 2;
                for k in (first..first + window).map(|k| k % n_basis) {
                    let (sin, cos) = (u - centre(k)).sin_cos();
                    visit(k, (precision * (cos - largest)).exp(), -sin * precision);
                }
            }
        }
    }
}

/// φ and φ′ at n points, (n·N) in row-major order.
struct Design {
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl Design {
    fn new(n_basis: usize) -> Self {
        let [values, slopes] = [0, 1].map(|_| Vec::with_capacity(PORTION * n_basis));
        Self { values, slopes }
    }

    fn matrices(&self, n_basis: usize) -> (MatRef<'_, f64>, MatRef<'_, f64>) {
        let matrix = |numbers| MatRef::from_row_major_slice(numbers, self.values.len() / n_basis, n_basis);
        (matrix(&self.values), matrix(&self.slopes))
    }
}

/// Fitted network.
#[derive(Clone, Debug)]
pub struct NGnetRegression {
    functions: Functions,
    /// Weights wₖ (N·outputs), in row-major order.
    weights: Vec<f64>,
}

impl Regression for NGnetRegression {
    fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        self.evaluate_all(&[u], value, slope);
    }

    fn evaluate_all(&self, u: &[f64], values: &mut [f64], slopes: &mut [f64]) {
        let n_basis = self.functions.settings.n_basis;
        let n_outputs = self.weights.len() / n_basis;
        let weights = MatRef::from_row_major_slice(&self.weights, n_basis, n_outputs);
        let mut rows = Design::new(n_basis);
        let size = PORTION * n_outputs.max(1);
        for (u, (values, slopes)) in u.chunks(PORTION).zip(values.chunks_mut(size).zip(slopes.chunks_mut(size))) {
            self.functions.fill(&mut rows, u);
            let (phi, slope) = rows.matrices(n_basis);
            for (numbers, functions) in [(values, phi), (slopes, slope)] {
                let into = MatMut::from_row_major_slice_mut(numbers, u.len(), n_outputs);
                matmul(into, Accum::Replace, functions, weights, 1.0, Par::Seq);
            }
        }
    }

    fn describe(&self) -> String {
        let NGnet { n_basis, overlap } = self.functions.settings;
        format!("NGnet, {n_basis} functions, width {overlap} spacings")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::runge_kutta::rk4;
    use approx::assert_abs_diff_eq;
    use ndarray::{Array1, Array2};
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    const INTERVAL: Domain = Domain::Interval { end: 1.0 };

    fn grid(domain: Domain, n_samples: usize) -> Vec<f64> {
        let gaps = if domain == Domain::Circle { n_samples } else { n_samples - 1 };
        (0..n_samples).map(|i| domain.extent() * i as f64 / gaps as f64).collect()
    }

    fn column(u: &[f64], f: impl Fn(f64) -> f64) -> Array2<f64> {
        u.iter().map(|&u| f(u)).collect::<Array1<f64>>().insert_axis(ndarray::Axis(1))
    }

    fn at(regression: &NGnetRegression, u: f64) -> (f64, f64) {
        let (mut value, mut slope) = ([f64::NAN], [f64::NAN]);
        regression.evaluate(u, &mut value, &mut slope);
        (value[0], slope[0])
    }

    fn wave(domain: Domain) -> impl Fn(f64) -> f64 {
        move |u: f64| (TAU * u / domain.extent() + 0.4).sin().exp()
    }

    /// Integrates z′ = −25z + 25·6.25·(1 − y), and y′ = z + w if `w` is given, over [0, 1] by RK4. Returns rows (y, z).
    fn output_system(position: impl Fn(f64) -> f64, w: Option<&dyn Fn(f64) -> f64>, n_steps: usize) -> Vec<(f64, f64)> {
        let rate = |u: f64, [y, z]: [f64; 2]| {
            let y_driving = if w.is_some() { y } else { position(u) };
            [w.map_or(0.0, |w| z + w(u)), -25.0 * z + 25.0 * 6.25 * (1.0 - y_driving)]
        };
        let h = 1.0 / n_steps as f64;
        let mut states = vec![(0.0, 0.0)];
        for i in 0..n_steps {
            states.push(rk4(rate, i as f64 * h, states[i].into(), h).into());
        }
        states
    }

    #[test]
    fn fifty_functions_reproduce_a_minimum_jerk_movement_to_1e_6() {
        let position = |u: f64| u.powi(3) * (10.0 - 15.0 * u + 6.0 * u * u);
        let velocity = |u: f64| 30.0 * u * u * (1.0 - u) * (1.0 - u);
        let z = output_system(position, None, 2000);
        let u = grid(INTERVAL, 201);
        let targets = column(&u, |u| velocity(u) - z[(2000.0 * u).round() as usize].1);
        let fitted = NGnet::default().regress(INTERVAL, &u, targets.view()).unwrap();
        let reproduced = output_system(position, Some(&|u| at(&fitted, u).0), 2000);
        let squares = reproduced.iter().enumerate().map(|(i, (y, _))| (y - position(i as f64 / 2000.0)).powi(2));
        let rmse = (squares.sum::<f64>() / 2001.0).sqrt();
        assert!(rmse < 1e-6, "RMSE {rmse:e}");
    }

    #[test]
    fn smooth_functions_and_slopes_are_interpolated() {
        for domain in [INTERVAL, Domain::Circle] {
            let (u, f) = (grid(domain, 250), wave(domain));
            let fitted = NGnet::default().regress(domain, &u, column(&u, &f).view()).unwrap();
            for i in 0..777 {
                let u = domain.extent() * i as f64 / 777.0;
                let phase = TAU * u / domain.extent() + 0.4;
                let slope = phase.sin().exp() * phase.cos() * TAU / domain.extent();
                assert_abs_diff_eq!(at(&fitted, u).0, f(u), epsilon = 5e-5);
                assert_abs_diff_eq!(at(&fitted, u).1, slope, epsilon = 3e-2);
            }
        }
    }

    #[test]
    fn regressions_on_the_circle_are_periodic() {
        let u = grid(Domain::Circle, 100);
        let targets = column(&u, |u| (u / 2.0).sin());
        let fitted = NGnet::new(20, 1.2).unwrap().regress(Domain::Circle, &u, targets.view()).unwrap();
        for u in [0.0, 1.0, 5.0] {
            assert_abs_diff_eq!(at(&fitted, u).0, at(&fitted, u + TAU).0, epsilon = 1e-12);
            assert_abs_diff_eq!(at(&fitted, u).1, at(&fitted, u + TAU).1, epsilon = 1e-11);
        }
    }

    #[test]
    fn more_functions_than_samples_are_harmless() {
        for n_samples in [1, 4, 30] {
            let u: Vec<f64> = (0..n_samples).map(|i| (i as f64 + 0.5) / n_samples as f64).collect();
            let targets = column(&u, |u| u.cos());
            let fitted = NGnet::default().regress(INTERVAL, &u, targets.view()).unwrap();
            for &u in &u {
                assert_abs_diff_eq!(at(&fitted, u).0, u.cos(), epsilon = 1e-6);
            }
            assert!(fitted.weights.iter().all(|w| w.abs() < 10.0));
        }
    }

    #[test]
    fn settings_out_of_range_are_rejected() {
        for n_basis in [0, 1, 1001, usize::MAX] {
            assert!(matches!(NGnet::new(n_basis, 1.2), Err(Error::Range { name: "n_basis", .. })));
        }
        for overlap in [0.0, -1.0, 0.29, 3.01, f64::NAN, f64::INFINITY] {
            assert!(matches!(NGnet::new(50, overlap), Err(Error::Range { name: "overlap", .. })));
            let ngnet = NGnet { overlap, ..NGnet::default() };
            let error = ngnet.regress(INTERVAL, &[0.0], Array2::zeros((1, 1)).view()).unwrap_err();
            assert!(matches!(error, Error::Range { name: "overlap", .. }));
        }
    }

    #[test]
    fn the_description_states_the_settings() {
        let fitted = NGnet::default().regress(INTERVAL, &[0.0], Array2::zeros((1, 1)).view()).unwrap();
        assert_eq!(fitted.describe(), "NGnet, 50 functions, width 1.2 spacings");
    }

    proptest! {
        #[test]
        fn the_slope_is_the_derivative(
            n_basis in 2..60_usize, overlap in 0.5..2.0, u in -0.2..1.2, circle: bool,
            values in prop::collection::vec(-1.0..1.0, 30),
        ) {
            let domain = if circle { Domain::Circle } else { INTERVAL };
            let targets = Array2::from_shape_vec((30, 1), values).unwrap();
            let fitted = NGnet { n_basis, overlap }.regress(domain, &grid(domain, 30), targets.view()).unwrap();
            let (u, h) = (u * domain.extent(), 1e-6 * domain.extent());
            let difference = (at(&fitted, u + h).0 - at(&fitted, u - h).0) / (2.0 * h);
            let size = fitted.weights.iter().fold(1.0_f64, |most, w| most.max(w.abs()));
            prop_assert!((at(&fitted, u).1 - difference).abs() < 1e-4 * size * n_basis as f64);
        }

        #[test]
        fn outputs_of_different_magnitudes_are_fitted_independently(exponents in prop::array::uniform3(-150.0..150.0)) {
            let (u, f) = (grid(INTERVAL, 40), wave(INTERVAL));
            let magnitudes = exponents.map(|e: f64| 10f64.powf(e));
            // Output 3 is zero.
            let targets = Array2::from_shape_fn((40, 4), |(i, o)| magnitudes.get(o).map_or(0.0, |m| m * f(u[i])));
            let together = NGnet::default().regress(INTERVAL, &u, targets.view()).unwrap();
            let alone = NGnet::default().regress(INTERVAL, &u, column(&u, f).view()).unwrap();
            let (mut value, mut slope) = ([f64::NAN; 4], [f64::NAN; 4]);
            for u in [-0.1, 0.0, 0.33, 1.0, 1.1] {
                together.evaluate(u, &mut value, &mut slope);
                for (o, magnitude) in magnitudes.iter().enumerate() {
                    prop_assert!((value[o] / magnitude - at(&alone, u).0).abs() < 1e-7);
                    prop_assert!((slope[o] / magnitude - at(&alone, u).1).abs() < 1e-4);
                }
                prop_assert_eq!((value[3], slope[3]), (0.0, 0.0));
            }
        }
    }
}
