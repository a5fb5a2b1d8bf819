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
use crate::model::responses::{Derivative, Responses};
use crate::motion::rollout::TimeGrid;
use crate::motion::unit_responses::responses;

/// Number of intervals of the samples. Movements learnt from the recordings of `docs/transport.md` then deviate from their
/// rollouts by at most 1e-10 of the range.
const INTERVALS: usize = 512;

/// Coefficients in powers of t in [0, 1] of the polynomials of degree 5 whose value, slope or second derivative at one end is
/// 1, and the others zero.
const HERMITE: [[f64; 6]; 6] = [
    [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
    [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
    [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
    [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
    [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
    [0.0, 0.0, 0.0, 0.5, -1.0, 0.5],
];

/// Movement under given conditions as a function of its parameters.
pub(super) struct LinearPath {
    kind: Kind,
    n_styles: usize,
    n_dofs: usize,
    amplitude: f64,
    /// Slopes dy/dv at start and end where the conditions give them.
    start_slope: Option<Vec<f64>>,
    end_slope: Option<Vec<f64>>,
    responses: Arc<Responses>,
    /// Duration of the responses, in seconds.
    duration: f64,
}

/// Weights of the samples at both ends of an interval for one derivative at a place in it.
pub(super) struct Place {
    interval: usize,
    weights: [f64; 6],
}

impl LinearPath {
    /// Returns the movement of a primitive of degrees of freedom; the slopes are those of its conditions per unit of v.
    pub(super) fn new(
        primitive: &Arc<Primitive>,
        conditions: &ResolvedConditions,
        start_slope: Option<Vec<f64>>,
        end_slope: Option<Vec<f64>>,
    ) -> Result<Self> {
        let (kind, duration) = (primitive.kind(), primitive.duration());
        let grid = TimeGrid { dt: duration / INTERVALS as f64, duration: None };
        Ok(Self {
            kind,
            n_styles: primitive.n_styles(),
            n_dofs: primitive.n_dofs(),
            amplitude: conditions.amplitude,
            responses: responses(primitive, primitive.tau, end_slope.is_some(), grid, &mut |_| Ok(()))?,
            start_slope,
            end_slope,
            duration,
        })
    }

    /// Returns the number of parameters.
    pub(super) fn n_parameters(&self) -> usize {
        self.n_styles + self.n_dofs * if self.kind == Kind::Discrete { 2 } else { 1 }
    }

    /// Returns the place of the derivative of order `order` at `v` in [0, 1].
    pub(super) fn place(v: f64, order: usize) -> Place {
        let position = v * INTERVALS as f64;
        let interval = (position as usize).min(INTERVALS - 1);
        let t = position - interval as f64;
        let weights = std::array::from_fn(|i| {
            // Horner's rule for the derivative of the polynomial.
            let factor = |power: usize| (power + 1 - order..=power).map(|p| p as f64).product::<f64>();
            let value = (order..6).rev().fold(0.0, |sum, power| sum * t + HERMITE[i][power] * factor(power));
            // Derivatives with respect to v of samples with respect to v.
            value * (INTERVALS as f64).powi(order as i32 - (i % 3) as i32)
        });
        Place { interval, weights }
    }

    /// Writes the coefficients a (P,) of a DoF at a place of a derivative, and returns c.
    pub(super) fn row(&self, place: &Place, order: usize, dof: usize, row: &mut [f64]) -> f64 {
        let curves = Derivative::ALL.map(|derivative| self.responses.of(derivative));
        let scales = [1.0, self.duration, self.duration * self.duration];
        let sample = |of: &dyn Fn(usize, usize) -> f64| -> f64 {
            let ends = [place.interval, place.interval + 1];
            let terms = (0..6).map(|i| place.weights[i] * scales[i % 3] * of(i % 3, ends[i / 3]));
            terms.sum()
        };
        row.fill(0.0);
        for (j, coefficient) in row[..self.n_styles].iter_mut().enumerate() {
            *coefficient = self.amplitude * sample(&|k, t| curves[k].styles[j][[t, dof]]);
        }
        let constant = if order == 0 { 1.0 } else { 0.0 };
        if self.kind == Kind::Rhythmic {
            row[self.n_styles + dof] = constant;
            return 0.0;
        }
        let start = sample(&|k, t| curves[k].start[[t, dof]]);
        row[self.n_styles + dof] = constant - start;
        row[self.n_styles + self.n_dofs + dof] = start;
        let mut rest = 0.0;
        if let Some(slope) = &self.start_slope {
            let response = sample(&|k, t| curves[k].velocity[[t, dof]]) / self.duration;
            for (j, coefficient) in row[..self.n_styles].iter_mut().enumerate() {
                *coefficient -= curves[1].styles[j][[0, dof]] * self.duration * response;
            }
            rest += slope[dof] * response;
        }
        if let Some(slope) = &self.end_slope {
            let response = |k: usize, t: usize| curves[k].goal_velocity.as_ref().map_or(0.0, |curve| curve[[t, dof]]);
            rest += slope[dof] / self.duration * sample(&response);
        }
        rest
    }
}
