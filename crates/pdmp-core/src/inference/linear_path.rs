//! A movement as a linear function of its parameters θ: y⁽ᵏ⁾(v) = c + aᵀθ for each DoF and derivative of order k with respect
//! to v = u/extent, the share of the movement or period.
//!
//! θ is style, goal and start of a discrete movement, style and anchor of a rhythmic one on its limit cycle. The coefficients
//! are the unit responses of the primitive (`unit_responses`), interpolated by polynomials of degree 5 between samples of
//! value and two derivatives.

use std::sync::Arc;

use crate::error::Result;
use crate::kind::Kind;
use crate::model::conditions::ResolvedConditions;
use crate::model::primitive::Primitive;
use crate::model::responses::{Curves, Responses};
use crate::motion::rollout::TimeGrid;
use crate::motion::unit_responses::responses;
use crate::numerics::simd::{F64x4, Register, WIDTH, pack, padded};

/// Number of intervals of the samples. Movements learnt from the recordings of `docs/transport.md` then deviate from their
/// rollouts by at most 1e-10 of the range.
const INTERVALS: usize = 512;

/// Coefficients in powers of t in [0, 1] of the polynomials of degree 5 whose value, slope or second derivative at one end is
/// 1, and the others zero, and of their first and second derivatives.
const HERMITE: [[[f64; 6]; 6]; 3] = {
    let values = [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
        [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
        [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
        [0.0, 0.0, 0.0, 0.5, -1.0, 0.5],
    ];
    let (mut derivatives, mut order) = ([values; 3], 1);
    while order < 3 {
        let mut i = 0;
        while i < 36 {
            let (curve, power) = (i / 6, i % 6);
            let above = if power < 5 { derivatives[order - 1][curve][power + 1] } else { 0.0 };
            derivatives[order][curve][power] = (power + 1) as f64 * above;
            i += 1;
        }
        order += 1;
    }
    derivatives
};

/// Returns the weights of value, slope and second derivative at both ends of an interval in a derivative of order `order`
/// at `t` in [0, 1] of it; `per_unit` is the number of intervals per unit of the argument.
pub(super) fn hermite(t: f64, order: usize, per_unit: f64) -> [f64; 6] {
    let scales = match order {
        0 => [1.0, per_unit.recip(), (per_unit * per_unit).recip()],
        1 => [per_unit, 1.0, per_unit.recip()],
        _ => [per_unit * per_unit, per_unit, 1.0],
    };
    let mut weights = [0.0; 6];
    for (i, [a, b, c, d, e, f]) in HERMITE[order].iter().enumerate() {
        weights[i] = (a + t * (b + t * (c + t * (d + t * (e + t * f))))) * scales[i % 3];
    }
    weights
}

/// Movement under given conditions as a function of its parameters.
pub(super) struct LinearPath<'a> {
    kind: Kind,
    n_styles: usize,
    n_dofs: usize,
    amplitude: f64,
    /// Slopes dy/dv at start and end where the conditions give them.
    start_slope: Option<Vec<f64>>,
    end_slope: Option<Vec<f64>>,
    /// Responses (T, D) by order of the derivative with respect to v: those to the styles, to the start, to the velocity and, if
    /// one is in force, to the final velocity.
    curves: [Vec<&'a [f64]>; 3],
    /// Duration of the responses, in seconds, by powers from 0 to 2.
    scales: [f64; 3],
}

/// Derivative of a movement as a sum of samples of its curve and two derivatives of that, in units of the share v.
pub(super) struct Samples {
    /// That of a curve of constant 1.
    constant: f64,
    /// Sample, order of its derivative and weight.
    terms: Vec<(usize, usize, f64)>,
}

impl Samples {
    /// Returns the derivative of order `order` at `v` in [0, 1].
    pub(super) fn at(v: f64, order: usize) -> Self {
        let mut samples = Self { constant: if order == 0 { 1.0 } else { 0.0 }, terms: Vec::with_capacity(6) };
        samples.add(v, order, 1.0);
        samples
    }

    /// Returns that of a curve that interpolates value and two derivatives at knots, with their weights.
    pub(super) fn between(knots: &[(f64, [f64; 3])]) -> Self {
        let constant = knots.iter().map(|(_, weights)| weights[0]).sum();
        let mut samples = Self { constant, terms: Vec::with_capacity(6 * knots.len()) };
        for (v, weights) in knots {
            weights.iter().enumerate().for_each(|(order, weight)| samples.add(*v, order, *weight));
        }
        samples
    }

    /// Adds a derivative multiplied by a number.
    fn add(&mut self, v: f64, order: usize, factor: f64) {
        let (interval, t) = interval(v);
        for (i, weight) in hermite(t, order, INTERVALS as f64).into_iter().enumerate() {
            let term = (interval + i / 3, i % 3);
            match self.terms.iter_mut().find(|(sample, order, _)| (*sample, *order) == term) {
                Some((.., sum)) => *sum += factor * weight,
                None => self.terms.push((term.0, term.1, factor * weight)),
            }
        }
    }
}

/// Returns the interval of samples around `v` in [0, 1], and the place in it.
fn interval(v: f64) -> (usize, f64) {
    let position = v * INTERVALS as f64;
    let interval = (position as usize).min(INTERVALS - 1);
    (interval, position - interval as f64)
}

/// Returns the responses of a primitive of degrees of freedom on which movements with or without a final velocity depend.
pub(super) fn path_responses(primitive: &Arc<Primitive>, has_goal_velocity: bool) -> Result<Arc<Responses>> {
    let grid = TimeGrid { dt: primitive.duration() / INTERVALS as f64, duration: None };
    responses(primitive, primitive.tau, has_goal_velocity, grid, &mut |_| Ok(()))
}

impl<'a> LinearPath<'a> {
    /// Returns the movement of a primitive of degrees of freedom; the slopes are those of its conditions per unit of v.
    pub(super) fn new(
        primitive: &Primitive,
        conditions: &ResolvedConditions,
        [start_slope, end_slope]: [Option<Vec<f64>>; 2],
        responses: &'a Responses,
    ) -> Self {
        let duration = primitive.duration();
        let curves = responses.orders.each_ref().map(|curves| {
            let Curves { styles, start, velocity, goal_velocity } = curves;
            let all = styles.iter().chain([start, velocity]).chain(goal_velocity);
            all.map(|curve| curve.as_slice().unwrap_or_default()).collect()
        });
        Self {
            kind: primitive.kind(),
            n_styles: primitive.n_styles(),
            n_dofs: primitive.n_dofs(),
            amplitude: conditions.amplitude,
            start_slope,
            end_slope,
            curves,
            scales: [1.0, duration, duration * duration],
        }
    }

    /// Returns the number of parameters.
    pub(super) fn n_parameters(&self) -> usize {
        self.n_styles + self.n_dofs * (self.width() - self.n_styles)
    }

    /// Returns the number of parameters on which a DoF depends: the styles, its own goal and start, or its anchor.
    pub(super) fn width(&self) -> usize {
        self.n_styles + if self.kind == Kind::Discrete { 2 } else { 1 }
    }

    /// Returns the index of a parameter on which a DoF depends.
    pub(super) fn parameter(&self, index: usize, dof: usize) -> usize {
        if index < self.n_styles { index } else { self.n_styles + (index - self.n_styles) * self.n_dofs + dof }
    }

    /// Returns the scalar product of the coefficients (width,) of a DoF with parameters (P,).
    pub(super) fn row_product(&self, row: &[f64], dof: usize, parameters: &[f64]) -> f64 {
        let (styles, rest) = row.split_at(self.n_styles);
        let sum: f64 = styles.iter().zip(parameters).map(|(a, x)| a * x).sum();
        let own = rest.iter().enumerate();
        own.fold(sum, |sum, (k, a)| sum + a * parameters[self.n_styles + k * self.n_dofs + dof])
    }

    /// Returns the scalar products of coefficients (width, D) of all DoFs with parameters (P,).
    pub(super) fn products(&self, rows: &[f64], parameters: &[f64], products: &mut [f64]) {
        for (c, row) in rows.chunks(self.n_dofs).enumerate() {
            for (dof, (product, a)) in products.iter_mut().zip(row).enumerate() {
                *product += a * parameters[self.parameter(c, dof)];
            }
        }
    }

    /// Adds a curve, multiplied by a number.
    fn add(&self, curve: usize, Samples { terms, .. }: &Samples, factor: f64, to: &mut [f64]) {
        for &(sample, order, weight) in terms {
            let weight = weight * self.scales[order] * factor;
            let row = self.row(curve, order, sample);
            to.iter_mut().zip(row).for_each(|(to, x)| *to += weight * x);
        }
    }

    /// Returns a sample (D,) of a curve, which is empty if there is no such curve.
    fn row(&self, curve: usize, order: usize, sample: usize) -> &[f64] {
        let curve = self.curves[order].get(curve).and_then(|curve| curve.get(sample * self.n_dofs..));
        curve.map_or(&[], |rest| &rest[..self.n_dofs.min(rest.len())])
    }

    /// Returns the coefficients a (width, D) of all DoFs in a derivative, and c (D,).
    pub(super) fn rows(&self, samples: &Samples) -> (Vec<f64>, Vec<f64>) {
        let n = self.n_dofs;
        let (mut rows, mut rest) = (vec![0.0; n * self.width()], vec![0.0; n]);
        for (j, row) in rows.chunks_mut(n).take(self.n_styles).enumerate() {
            self.add(j, samples, self.amplitude, row);
        }
        let constant = samples.constant;
        let (styles, centres) = rows.split_at_mut(n * self.n_styles);
        let (centres, starts) = centres.split_at_mut(n);
        if self.kind == Kind::Rhythmic {
            centres.fill(constant);
            return (rows, rest);
        }
        self.add(self.n_styles, samples, 1.0, starts);
        centres.iter_mut().zip(starts).for_each(|(centre, start)| *centre = constant - *start);
        let mut end = |slope: &[f64], curve: usize| {
            let mut response = vec![0.0; n];
            self.add(curve, samples, 1.0 / self.scales[1], &mut response);
            rest.iter_mut().zip(slope.iter().zip(&response)).for_each(|(rest, (slope, x))| *rest += slope * x);
            response
        };
        if let Some(slope) = &self.start_slope {
            let response = end(slope, self.n_styles + 1);
            for (j, row) in styles.chunks_mut(n).enumerate() {
                let changed = row.iter_mut().zip(self.row(j, 1, 0)).zip(&response);
                changed.for_each(|((x, slope), response)| *x -= slope * self.scales[1] * response);
            }
        }
        if let Some(slope) = &self.end_slope {
            end(slope, self.n_styles + 2);
        }
        (rows, rest)
    }

    /// Returns the change aᵀΔθ of a movement.
    pub(super) fn change(&self, change: &[f64]) -> Change<'_> {
        let n = self.n_dofs;
        let (styles, positions) = change.split_at(self.n_styles);
        let (centre, start) = positions.split_at(n);
        let mut weights: Vec<F64x4> = styles.iter().flat_map(|x| pack(&vec![self.amplitude * x; n])).collect();
        if self.kind == Kind::Discrete {
            weights.extend(pack(&centre.iter().zip(start).map(|(centre, start)| start - centre).collect::<Vec<_>>()));
        }
        if self.start_slope.is_some() {
            let mut slope = vec![0.0; n];
            for (j, x) in styles.iter().enumerate() {
                slope.iter_mut().zip(self.row(j, 1, 0)).for_each(|(slope, response)| *slope -= x * response);
            }
            weights.extend(pack(&slope));
        }
        Change { path: self, weights, constant: pack(centre) }
    }
}

/// Change of a movement, as a sum of curves (T, D) with a weight for each DoF.
pub(super) struct Change<'a> {
    path: &'a LinearPath<'a>,
    /// Weights by curve and group.
    weights: Vec<F64x4>,
    constant: Vec<F64x4>,
}

impl Change<'_> {
    /// Adds the change and its two derivatives at `v` in [0, 1] to those of all groups.
    // Closures of iterators stay calls, into which the instructions of larger registers are not inlined.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    pub(super) fn add_to<T: Register>(&self, v: f64, jets: &mut [[F64x4; 3]]) {
        let LinearPath { n_dofs, curves, scales, .. } = self.path;
        let (n_groups, (interval, t)) = (jets.len(), interval(v));
        let n_curves = self.weights.len() / n_groups;
        let mut weights = [[0.0; 6]; 3];
        for order in 0..3 {
            weights[order] = hermite(t, order, INTERVALS as f64);
            for i in 0..6 {
                weights[order][i] *= scales[i % 3];
            }
        }
        for group in 0..n_groups {
            let jet = &mut jets[group];
            let mut sums = [T::load(&jet[0]) + T::load(&self.constant[group]), T::load(&jet[1]), T::load(&jet[2])];
            for i in 0..6 {
                let place = (interval + i / 3) * n_dofs + group * WIDTH;
                let (mut sample, curves) = (T::default(), &curves[i % 3]);
                for curve in 0..n_curves {
                    let weight = T::load(&self.weights[curve * n_groups + group]);
                    sample = sample + weight * load::<T>(curves[curve], place);
                }
                for order in 0..3 {
                    sums[order] = sums[order] + sample * weights[order][i];
                }
            }
            *jet = [sums[0].store(), sums[1].store(), sums[2].store()];
        }
    }
}

/// Loads four numbers, those past the end as zeros.
#[inline(always)]
fn load<T: Register>(numbers: &[f64], place: usize) -> T {
    if place >= numbers.len() {
        return T::default();
    }
    match numbers[place..].first_chunk() {
        Some(four) => T::load_numbers(four),
        None => T::load(&padded(&numbers[place..])),
    }
}
