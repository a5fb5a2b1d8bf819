//! Matérn-5/2 covariance function with its derivatives, on a line or a circle.
//!
//! ```text
//! k(r) = (1 + a + a²/3)·exp(−a),     a = √5|r|/ℓ
//! ```
//!
//! A process y with this covariance is twice differentiable, and cov(y⁽ⁱ⁾(v), y⁽ʲ⁾(w)) = (−1)ʲ k⁽ⁱ⁺ʲ⁾(v − w) for i, j ≤ 2. On a
//! circle of circumference 1, k is the sum over all images, divided by its value at r = 0.

/// Scaled distance from which exp(−a) vanishes in rounding.
const MAX_DISTANCE: f64 = 40.0;

/// Covariance function of unit variance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matern52 {
    /// λ = √5/ℓ.
    rate: f64,
    /// Number of images on either side; 0 on a line.
    images: i32,
    scale: f64,
}

impl Matern52 {
    /// Returns the function of length scale ℓ on a line.
    pub(crate) fn on_line(length: f64) -> Self {
        Self { rate: 5f64.sqrt() / length, images: 0, scale: 1.0 }
    }

    /// Returns the function of length scale ℓ on a circle of circumference 1.
    pub(crate) fn on_circle(length: f64) -> Self {
        let rate = 5f64.sqrt() / length;
        let plain = Self { rate, images: (MAX_DISTANCE / rate).ceil() as i32 + 1, scale: 1.0 };
        Self { scale: 1.0 / plain.derivatives(0.0)[0], ..plain }
    }

    /// Returns k, k′, …, k⁗ at `r`, on a circle at |r| < 1.
    pub(crate) fn derivatives(&self, r: f64) -> [f64; 5] {
        let mut sum = [0.0; 5];
        for image in -self.images..=self.images {
            let r = r + f64::from(image);
            let a = self.rate * r.abs();
            if a > MAX_DISTANCE {
                continue;
            }
            let third = (-a).exp() * self.scale / 3.0;
            let odd = self.rate * third * r.signum();
            let even = self.rate * self.rate * third;
            sum[0] += third * (3.0 + a * (3.0 + a));
            sum[1] -= odd * a * (1.0 + a);
            sum[2] -= even * (1.0 + a - a * a);
            sum[3] += odd * self.rate * self.rate * a * (3.0 - a);
            sum[4] += even * self.rate * self.rate * (3.0 - a * (5.0 - a));
        }
        sum
    }
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
