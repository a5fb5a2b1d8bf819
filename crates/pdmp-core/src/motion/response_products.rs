//! Inner products of cotangents with the unit responses.
// Closures of iterators stay calls, into which the instructions of larger registers are not inlined.
#![allow(clippy::needless_range_loop)]

use crate::motion::superposition::{Combination, Tile};
use crate::numerics::simd::{Kernel, Register, WIDTH, compute};

/// Inner products ⟨v, ·⟩ of the cotangents of one movement with the unit responses.
#[derive(Clone, Debug)]
pub(super) struct Product {
    /// Those with the styles (J,), summed over the DoFs.
    pub(super) styles: Vec<f64>,
    /// c, e, n and q (D,); in sums over tiles, of each coefficient of a [`Combination`].
    pub(super) centre: Vec<f64>,
    pub(super) start: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) goal_velocity: Vec<f64>,
    /// Σₖ k⟨v⁽ᵏ⁾, y⁽ᵏ⁾⟩ + Σₖ⟨t·v⁽ᵏ⁾, y⁽ᵏ⁺¹⁾⟩, if τ is a variable.
    pub(super) scaled_time: f64,
}

impl Product {
    pub(super) fn zeros(n_styles: usize, n: usize) -> Self {
        let [centre, start, velocity, goal_velocity] = [(); 4].map(|()| vec![0.0; n]);
        Self { styles: vec![0.0; n_styles], centre, start, velocity, goal_velocity, scaled_time: 0.0 }
    }

    /// Returns ⟨v, y⟩ for the velocities or accelerations of a combination.
    pub(super) fn with(&self, combination: &Combination) -> f64 {
        let Combination { style, start, velocity, goal_velocity, .. } = combination;
        let last = goal_velocity.as_ref().map_or(0.0, |velocity| dot(&self.goal_velocity, velocity));
        dot(&self.styles, style) + dot(&self.start, start) + dot(&self.velocity, velocity) + last
    }

    /// Adds the products of a tile with the cotangents `v`.
    pub(super) fn add(&mut self, tile: &Tile, v: &[f64], is_position: bool, has_velocity: bool) {
        if is_position {
            let period = self.centre.len();
            v.chunks(period).for_each(|v| self.centre.iter_mut().zip(v).for_each(|(sum, v)| *sum += v));
        }
        let goal_velocity = tile.goal_velocity.map(|responses| (&mut self.goal_velocity, responses));
        let velocity = has_velocity.then_some((&mut self.velocity, tile.velocity));
        for (sums, responses) in [Some((&mut self.start, tile.start)), velocity, goal_velocity].into_iter().flatten() {
            compute(AddProducts { sums, responses, v });
        }
        for (sums, curves) in self.styles.chunks_mut(4).zip(tile.styles.chunks(4)) {
            match (sums, curves) {
                ([a, b, c, d], &[r, s, t, u]) => add([a, b, c, d], [r, s, t, u], v),
                ([a, b, c], &[r, s, t]) => add([a, b, c], [r, s, t], v),
                ([a, b], &[r, s]) => add([a, b], [r, s], v),
                (sums, curves) => sums.iter_mut().zip(curves).for_each(|(sum, curve)| *sum += dot(curve, v)),
            }
        }
    }

    /// Adds the products of another order.
    pub(super) fn add_all(&mut self, other: &Self) {
        let Self { styles, centre, start, velocity, goal_velocity, scaled_time } = self;
        let pairs = [
            (styles, &other.styles),
            (centre, &other.centre),
            (start, &other.start),
            (velocity, &other.velocity),
            (goal_velocity, &other.goal_velocity),
        ];
        for (sums, products) in pairs {
            sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        }
        *scaled_time += other.scaled_time;
    }

    /// Returns the products of `n_dofs` DoFs, from those of their repeated coefficients.
    pub(super) fn folded(&self, n_dofs: usize) -> Self {
        let fold = |sums: &Vec<f64>| (0..n_dofs).map(|d| sums[d..].iter().step_by(n_dofs).sum()).collect();
        let Self { styles, centre, start, velocity, goal_velocity, scaled_time } = self;
        let [centre, start, velocity, goal_velocity] = [centre, start, velocity, goal_velocity].map(fold);
        Self { styles: styles.clone(), centre, start, velocity, goal_velocity, scaled_time: *scaled_time }
    }
}

/// Adds inner products with the same vector.
fn add<const N: usize>(sums: [&mut f64; N], curves: [&[f64]; N], v: &[f64]) {
    sums.into_iter().zip(compute(Dots { curves, v })).for_each(|(sum, product)| *sum += product);
}

fn dot(curve: &[f64], v: &[f64]) -> f64 {
    let [product] = compute(Dots { curves: [curve], v });
    product
}

/// Returns Σ curve·v·time.
pub(super) fn timed_dot(curve: &[f64], v: &[f64], time: &[f64]) -> f64 {
    compute(TimedDot { curve, v, time })
}

/// Kernel of [`timed_dot`].
struct TimedDot<'a> {
    curve: &'a [f64],
    v: &'a [f64],
    time: &'a [f64],
}

impl Kernel for TimedDot<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<T: Register>(self) -> f64 {
        let Self { curve, v, time } = self;
        let mut sum = T::default();
        let n_whole = v.len() - v.len() % WIDTH;
        let mut at = 0;
        while at < n_whole {
            sum = sum + load::<T>(curve, at) * load::<T>(v, at) * load::<T>(time, at);
            at += WIDTH;
        }
        let [a, b, c, d] = sum.store().to_array();
        let mut product = (a + b) + (c + d);
        for i in n_whole..v.len() {
            product += curve[i] * v[i] * time[i];
        }
        product
    }
}

/// Kernel of inner products with the same vector.
struct Dots<'a, const N: usize> {
    curves: [&'a [f64]; N],
    v: &'a [f64],
}

impl<const N: usize> Kernel for Dots<'_, N> {
    type Output = [f64; N];

    #[inline(always)]
    fn run<T: Register>(self) -> [f64; N] {
        let Self { curves, v } = self;
        let mut sums = [[T::default(); 2]; N];
        let n_whole = v.len() - v.len() % (2 * WIDTH);
        let mut at = 0;
        while at < n_whole {
            for k in 0..2 {
                let factors = load::<T>(v, at + k * WIDTH);
                for j in 0..N {
                    sums[j][k] = sums[j][k] + load::<T>(curves[j], at + k * WIDTH) * factors;
                }
            }
            at += 2 * WIDTH;
        }
        let mut products = [0.0; N];
        for j in 0..N {
            let [a, b, c, d] = (sums[j][0] + sums[j][1]).store().to_array();
            products[j] = (a + b) + (c + d);
            for i in n_whole..v.len() {
                products[j] += curves[j][i] * v[i];
            }
        }
        products
    }
}

/// Kernel that adds products of elements to the sums of a period.
struct AddProducts<'a> {
    sums: &'a mut [f64],
    responses: &'a [f64],
    v: &'a [f64],
}

impl Kernel for AddProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { sums, responses, v } = self;
        let n_whole = v.len() - v.len() % WIDTH;
        let (mut at, mut within) = (0, 0);
        while at < n_whole {
            let sum = load::<T>(sums, within) + load::<T>(v, at) * load::<T>(responses, at);
            if let Some(four) = sums[within..].first_chunk_mut() {
                sum.store_numbers(four);
            }
            at += WIDTH;
            within = if within + WIDTH == sums.len() { 0 } else { within + WIDTH };
        }
        for i in n_whole..v.len() {
            sums[i % sums.len()] += v[i] * responses[i];
        }
    }
}

/// Loads four numbers from one on.
#[inline(always)]
fn load<T: Register>(numbers: &[f64], at: usize) -> T {
    numbers[at..].first_chunk().map_or(T::default(), T::load_numbers)
}
