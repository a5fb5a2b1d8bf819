//! Conditions nearest to requested ones whose movement keeps limits.
//!
//! With a fixed start and τ, a movement is affine in style s and goal g, so that limits of y, ẏ and ÿ at one time are half-spaces.
//! In standard deviations, x = L⁻¹(Δs, Δg) with LLᵀ = Σ, the nearest point within them solves
//!
//! ```text
//! min ½|x|²   subject to   aᵢᵀx ≤ bᵢ.
//! ```
//!
//! Per round, the worst time of each stretch outside a limit joins the program, until the movement keeps every limit.
//!
//! J. E. Kelley, *The cutting-plane method for solving convex programs*, Journal of the Society for Industrial and Applied
//! Mathematics 8(4), 1960.

use std::sync::Arc;

use ndarray::Array2;

use super::Margins;
use super::bounds::{Bound, Excess, TOLERANCE, bounds};
use super::extremes::Movement;
use super::quadratic_program::HalfSpaces;
use super::sampling::sampled;
use super::variables::{Variables, Vary};
use crate::error::{Error, LimitError, Result};
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::model::responses::Derivative;
use crate::model::{Model, Prediction};
use crate::motion::limits::Limits;

/// Maximum number of rounds; three to thirty suffice on recordings.
const MAX_ROUNDS: usize = 100;
/// Excess, relative to the limits, by which the smallest excess of an error may be missed.
const EXCESS_TOLERANCE: f64 = 1e-3;

/// Computes the conditions nearest to the requested ones with which the whole movement keeps limits of position, velocity and
/// acceleration; see [`feasible`](super::feasible).
///
/// The distance of a change Δs of the style and Δg of the goal, or anchor, is Δsᵀ Σ_s⁻¹ Δs + Δgᵀ Σ_g⁻¹ Δg with the covariances of
/// the demonstrations, to which squares of a thousandth of the range of styles and positions are added. Start, τ and the other
/// conditions remain. Conditions that keep the limits are returned unchanged. A limit of the jerk does not count.
///
/// ```
/// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
/// # use pdmp_core::motion::{Limits, Vary, feasible, nearest_feasible};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// // The ceiling is lower than the demonstrated height of the path.
/// let limits = Limits { upper: Some(vec![2.0, 0.25]), ..Limits::default() };
/// let high = model.conditions(&[2])?;
/// let lower = nearest_feasible(&model, &limits, &high, Vary::Style)?;
/// assert!(!feasible(model.primitive(), &limits, &high)?.is_feasible());
/// assert!(feasible(model.primitive(), &limits, &lower)?.is_feasible());
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Conditions or limits that do not fit the primitive, or limits that no change of the varied conditions keeps.
pub fn nearest_feasible(model: &Model, limits: &Limits, conditions: &Conditions, vary: Vary) -> Result<Conditions> {
    nearest(model, limits, conditions, vary, None)
}

/// Computes the prediction whose conditions are the most probable ones with which the whole movement keeps limits of position,
/// velocity and acceleration.
///
/// The distance of a change Δ of style and goal, or anchor, is Δᵀ Σ⁻¹ Δ with their covariance in the prediction, to which a
/// hundredth of the standard deviations of [`nearest_feasible`] is added; without a covariance it is the distance of
/// [`nearest_feasible`]. What the context determines thus remains as far as the limits allow. Start, durations and the other
/// conditions remain, too, and so do the covariance and its degrees of freedom: they describe demonstrators without these
/// limits.
///
/// ```
/// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
/// # use pdmp_core::motion::{Limits, Vary, feasible, feasible_prediction};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let limits = Limits { upper: Some(vec![2.0, 0.25]), ..Limits::default() };
/// let prediction = feasible_prediction(&model, &limits, model.predict(&[0.4])?, Vary::Both)?;
/// assert!(feasible(model.primitive(), &limits, &prediction.conditions)?.is_feasible());
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Conditions or limits that do not fit the primitive, or limits that no change of the varied conditions keeps.
pub fn feasible_prediction(model: &Model, limits: &Limits, prediction: Prediction, vary: Vary) -> Result<Prediction> {
    let conditions = nearest(model, limits, &prediction.conditions, vary, prediction.covariance.as_ref())?;
    Ok(Prediction { conditions, ..prediction })
}

fn nearest(
    model: &Model,
    limits: &Limits,
    request: &Conditions,
    vary: Vary,
    predicted: Option<&Array2<f64>>,
) -> Result<Conditions> {
    let primitive = model.primitive();
    let bounds = bounds(primitive, limits)?;
    let movement = sampled(primitive, request)?;
    let margins = Margins::of(&movement, &bounds);
    if margins.is_feasible() {
        return Ok(request.clone());
    }
    let variables = Variables::new(model, request, vary, predicted, &movement)?;
    let mut search =
        Search { primitive, bounds: &bounds, requested: &movement, variables, half_spaces: HalfSpaces::default() };
    let (bound, at_best) = match search.nearest()? {
        Outcome::Found(conditions) => return Ok(conditions),
        Outcome::Fixed(bound) => (bound, movement.clone()),
        Outcome::Infeasible => search.least_excess()?,
    };
    Err(infeasible(&bound, &at_best, vary, model.kind(), slower(&margins, request)))
}

/// Outcome of a search.
enum Outcome {
    Found(Conditions),
    /// A limit is exceeded where the varied conditions do not change the movement.
    Fixed(Bound),
    Infeasible,
}

/// Search by cutting planes.
struct Search<'a> {
    primitive: &'a Arc<Primitive>,
    bounds: &'a [Bound],
    requested: &'a Movement,
    variables: Variables,
    half_spaces: HalfSpaces,
}

impl Search<'_> {
    /// Adds the half-spaces of the stretches in which a movement at x exceeds limits by more than `tolerance`; returns their
    /// number.
    ///
    /// # Errors
    /// A limit whose excess does not depend on x.
    fn cut(&mut self, movement: &Movement, x: &[f64], tolerance: f64) -> std::result::Result<usize, Bound> {
        let mut n_cuts = 0;
        for bound in self.bounds {
            for Excess { excess, place } in bound.excesses(movement, tolerance) {
                if !self.half_spaces.add(self.variables.gradient(bound, place), excess, x) {
                    return Err(*bound);
                }
                n_cuts += 1;
            }
        }
        Ok(n_cuts)
    }

    /// Searches the nearest feasible conditions.
    ///
    /// # Errors
    /// A movement that overflows, or too many rounds.
    fn nearest(&mut self) -> Result<Outcome> {
        let mut x = vec![0.0; self.variables.len()];
        let mut cuts = self.cut(self.requested, &x, TOLERANCE);
        for _ in 0..MAX_ROUNDS {
            if let Err(bound) = cuts {
                return Ok(Outcome::Fixed(bound));
            }
            let Some(nearest) = self.half_spaces.nearest() else { return Ok(Outcome::Infeasible) };
            x = nearest;
            cuts = self.cut(&self.variables.movement(self.requested, &x), &x, TOLERANCE);
            if cuts == Ok(0) {
                // The sum has rounding errors: the movement itself decides.
                let conditions = self.variables.conditions(&x);
                cuts = self.cut(&sampled(self.primitive, &conditions)?, &x, TOLERANCE);
                if cuts == Ok(0) {
                    return Ok(Outcome::Found(conditions));
                }
            }
        }
        Err(unsolved())
    }

    /// Returns the limit that the movement with the smallest excess exceeds most, and this movement.
    ///
    /// # Errors
    /// A movement that overflows, or too many rounds.
    fn least_excess(&mut self) -> Result<(Bound, Movement)> {
        for _ in 0..MAX_ROUNDS {
            let (x, least) = self.half_spaces.least_excess().ok_or_else(unsolved)?;
            let movement = self.variables.movement(self.requested, &x);
            if self.cut(&movement, &x, least.max(0.0) + EXCESS_TOLERANCE).is_ok_and(|n_cuts| n_cuts > 0) {
                continue;
            }
            let excesses = self.bounds.iter().map(|bound| (bound.excess(&movement).excess, bound));
            let largest = excesses.max_by(|(a, _), (b, _)| a.total_cmp(b)).filter(|(excess, _)| *excess > TOLERANCE);
            let (_, bound) = largest.ok_or_else(unsolved)?;
            return Ok((*bound, movement));
        }
        Err(unsolved())
    }
}

fn unsolved() -> Error {
    Error::Fit(format!(
        "no conditions within the limits were found in {MAX_ROUNDS} rounds; widen the limits, or enlarge tau"
    ))
}

/// Returns the factor of its duration with which the requested movement keeps the limits; `None` if it leaves those of the
/// position, or if velocities are given: they are per second and bend the path of a slower movement.
fn slower(margins: &Margins, request: &Conditions) -> Option<f64> {
    let keeps_positions = Margins { velocity: None, acceleration: None, ..*margins }.is_feasible();
    let is_on_path = request.velocity.is_none() && request.goal_velocity.is_none();
    (keeps_positions && is_on_path).then(|| margins.slowdown())
}

/// Returns the error of a movement that exceeds a limit.
fn infeasible(bound: &Bound, movement: &Movement, vary: Vary, kind: Kind, slower: Option<f64>) -> Error {
    let place = bound.excess(movement).place;
    let quantity = match bound.derivative {
        Derivative::Position => "position",
        Derivative::Velocity => "velocity",
        Derivative::Acceleration => "acceleration",
    };
    Error::Limits(LimitError::Infeasible {
        dof: bound.dof,
        varied: vary.name(kind),
        quantity,
        value: movement.value(bound.derivative, bound.dof, place),
        limit: bound.value,
        time: movement.time(place),
        varies_all: vary == Vary::Both,
        slower,
    })
}
