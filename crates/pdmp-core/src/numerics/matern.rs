//! Matérn-5/2 covariance function with its derivatives, on a line or a circle.
//!
//! ```text
//! k(r) = (1 + a + a²/3)·exp(−a),     a = √5|r|/ℓ
//! ```
//!
//! A process y with this covariance is twice differentiable, and cov(y⁽ⁱ⁾(v), y⁽ʲ⁾(w)) = (−1)ʲ k⁽ⁱ⁺ʲ⁾(v − w) for i, j ≤ 2. On a
//! circle of circumference 1, k is the sum over all images, divided by its value at r = 0.

/// Coefficients of 1, a and a² in k⁽ⁱ⁾/λⁱ = (α + βa + γa²)·exp(−a) for r > 0 and i = 0, …, 4.
const POLYNOMIALS: [[f64; 3]; 5] = [
    [1.0, 1.0, 1.0 / 3.0],
    [0.0, -1.0 / 3.0, -1.0 / 3.0],
    [-1.0 / 3.0, -1.0 / 3.0, 1.0 / 3.0],
    [0.0, 1.0, -1.0 / 3.0],
    [1.0, -5.0 / 3.0, 1.0 / 3.0],
];

/// Covariance function of unit variance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matern52 {
    /// λ = √5/ℓ.
    rate: f64,
    is_circle: bool,
    /// Coefficients of 1, a and a² in the derivatives, of the sum over all images on one side on a circle.
    polynomials: [[f64; 3]; 5],
}

impl Matern52 {
    /// Returns the function of length scale ℓ on a line.
    pub(crate) fn on_line(length: f64) -> Self {
        let rate = 5f64.sqrt() / length;
        Self { rate, is_circle: false, polynomials: scaled(POLYNOMIALS, rate, 1.0) }
    }

    /// Returns the function of length scale ℓ on a circle of circumference 1.
    ///
    /// With q = exp(−λ), the images at a + mλ on one side add up to geometric sums:
    /// Σ qᵐ = 1/(1 − q), Σ mqᵐ = q/(1 − q)² and Σ m²qᵐ = q(1 + q)/(1 − q)³.
    pub(crate) fn on_circle(length: f64) -> Self {
        let rate = 5f64.sqrt() / length;
        let (q, rest) = ((-rate).exp(), -(-rate).exp_m1());
        let (zeroth, first, second) = (rest.recip(), q / (rest * rest), q * (1.0 + q) / (rest * rest * rest));
        let sides = POLYNOMIALS.map(|[alpha, beta, gamma]| {
            let constant = alpha * zeroth + beta * rate * first + gamma * rate * rate * second;
            [constant, beta * zeroth + 2.0 * gamma * rate * first, gamma * zeroth]
        });
        let plain = Self { rate, is_circle: true, polynomials: sides };
        Self { polynomials: scaled(sides, rate, plain.derivatives(0.0)[0].recip()), ..plain }
    }

    /// Returns k, k′, …, k⁗ at `r`.
    #[inline]
    pub(crate) fn derivatives(&self, r: f64) -> [f64; 5] {
        if !self.is_circle {
            return self.side(r.abs(), if r < 0.0 { -1.0 } else { 1.0 });
        }
        let r = r - r.floor();
        let (mut derivatives, behind) = (self.side(r, 1.0), self.side(1.0 - r, -1.0));
        derivatives.iter_mut().zip(behind).for_each(|(ahead, behind)| *ahead += behind);
        derivatives
    }

    /// Returns the derivatives at a distance on one side; odd ones have its sign.
    #[inline(always)]
    fn side(&self, distance: f64, sign: f64) -> [f64; 5] {
        let a = self.rate * distance;
        let decay = (-a).exp();
        let (odd, mut derivatives) = (sign * decay, [decay; 5]);
        (derivatives[1], derivatives[3]) = (odd, odd);
        for (derivative, [alpha, beta, gamma]) in derivatives.iter_mut().zip(&self.polynomials) {
            *derivative *= alpha + a * (beta + a * gamma);
        }
        derivatives
    }
}

/// Returns the polynomials of the derivatives with respect to r, multiplied by a number.
fn scaled(mut polynomials: [[f64; 3]; 5], rate: f64, scale: f64) -> [[f64; 3]; 5] {
    for (i, polynomial) in polynomials.iter_mut().enumerate() {
        *polynomial = polynomial.map(|x| x * rate.powi(i as i32) * scale);
    }
    polynomials
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Each derivative is that of the one before it, and the value is the textbook formula.
    #[test]
    fn derivatives_agree_with_differences() {
        for kernel in [Matern52::on_line(0.3), Matern52::on_circle(0.3), Matern52::on_circle(2.0)] {
            for r in [-0.7, -0.2, -1e-3, 0.05, 0.4, 0.9] {
                let h = 1e-5;
                let (here, [below, above]) = (kernel.derivatives(r), [r - h, r + h].map(|r| kernel.derivatives(r)));
                for order in 0..4 {
                    let difference = (above[order] - below[order]) / (2.0 * h);
                    assert_relative_eq!(here[order + 1], difference, max_relative = 1e-5, epsilon = 1e-4);
                }
            }
            assert_relative_eq!(kernel.derivatives(0.0)[0], 1.0);
        }
        let a = 5f64.sqrt() * 0.4 / 0.3;
        let expected = (1.0 + a + a * a / 3.0) * (-a).exp();
        assert_relative_eq!(Matern52::on_line(0.3).derivatives(-0.4)[0], expected, max_relative = 1e-14);
    }

    /// On a circle the function has period 1.
    #[test]
    fn circle_is_periodic() {
        let kernel = Matern52::on_circle(0.25);
        for r in [0.1, 0.5, 0.8] {
            for (a, b) in kernel.derivatives(r).into_iter().zip(kernel.derivatives(r - 1.0)) {
                assert_relative_eq!(a, b, max_relative = 1e-9, epsilon = 1e-9);
            }
        }
    }
}
