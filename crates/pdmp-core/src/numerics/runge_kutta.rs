//! Classical Runge–Kutta method, an independent reference for tests.

use std::array::from_fn;

/// Returns the state at `t + h` of y′ = f(t, y) from the state `y` at `t`.
pub(crate) fn rk4<const N: usize>(f: impl Fn(f64, [f64; N]) -> [f64; N], t: f64, y: [f64; N], h: f64) -> [f64; N] {
    let along = |k: [f64; N], h: f64| from_fn(|i| y[i] + h * k[i]);
    let a = f(t, y);
    let b = f(t + h / 2.0, along(a, h / 2.0));
    let c = f(t + h / 2.0, along(b, h / 2.0));
    let d = f(t + h, along(c, h));
    from_fn(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
}
