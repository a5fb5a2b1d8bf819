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

use super::bounds::{Bound, Excess, TOLERANCE, bounds};
use super::extremes::{Movement, Place};
use super::quadratic_program::HalfSpaces;
use super::sampling::sampled;
use super::turn_cuts::{Cut, TurnCuts};
use super::turning::compare;
use super::variables::{Variables, Vary};
use super::{Extreme, Margins, feasible};
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
/// the demonstrations, to which squares of a tenth of the range of styles and positions are added. Start, τ and the other
/// conditions remain. The sizes of angular velocities and accelerations are linearised: within limits of rotations the conditions are
/// the nearest ones up to their curvature. Conditions that keep the limits are returned unchanged. A limit of the jerk does not count.
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
/// The distance of a change Δ of style and goal, or anchor, is Δᵀ Σ⁻¹ Δ with their covariance in the prediction, to which
/// squares of a hundredth of the standard deviations of [`nearest_feasible`] are added; without a covariance it is the distance
/// of [`nearest_feasible`]. What the context determines thus remains as far as the limits allow. Start, durations and the other
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
    if let Some(coordinates) = model.primitive().coordinates() {
        limits.check_rotations(model.primitive())?;
        if feasible(model.primitive(), limits, request)?.is_feasible() {
            return Ok(request.clone());
        }
        let inside = Model { primitive: Arc::clone(coordinates.dofs()), ..model.clone() };
        let turns = TurnCuts { primitive: model.primitive(), limits, request };
        let turns = limits.bound_rotations(model.primitive()).then_some(turns);
        let plain = limits.of_plain_dofs(model.primitive());
        let of_dofs = coordinates.constant_in_dofs(request)?;
        let found = search(&inside, &plain, &of_dofs, vary, predicted, turns)?;
        let (velocity, goal_velocity) = (request.velocity.clone(), request.goal_velocity.clone());
        return Ok(Conditions { velocity, goal_velocity, ..coordinates.of_dofs(found) });
    }
    search(model, limits, request, vary, predicted, None)
}

/// Searches conditions of the DoFs within limits of DoFs and of rotations.
fn search(
    model: &Model,
    limits: &Limits,
    request: &Conditions,
    vary: Vary,
    predicted: Option<&Array2<f64>>,
    turns: Option<TurnCuts>,
) -> Result<Conditions> {
    let primitive = model.primitive();
    let bounds = bounds(primitive, limits)?;
    let movement = sampled(primitive, request)?;
    let mut margins = Margins::of(&movement, &bounds);
    match &turns {
        Some(turns) => compare(turns.primitive, turns.limits, turns.request, &mut margins)?,
        None if margins.is_feasible() => return Ok(request.clone()),
        None => {}
    }
    let variables = Variables::new(model, request, vary, predicted, &movement)?;
    let half_spaces = HalfSpaces::default();
    let turns = turns.as_ref();
    let search = Search { primitive, bounds: &bounds, turns, request, requested: &movement, variables, half_spaces };
    match search.run()? {
        Outcome::Feasible(conditions) => Ok(conditions),
        Outcome::Infeasible(obstacle) => Err(obstacle.error(vary, model.kind(), slower(&margins, request))),
    }
}

/// Limit that the movement with the smallest excess exceeds most.
struct Obstacle {
    bound: Bound,
    value: f64,
    time: f64,
}

/// Conditions with the smallest excess, or the limit that they exceed.
enum Outcome {
    Feasible(Conditions),
    Infeasible(Obstacle),
}

/// Numbers of stretches outside limits: of those that became half-spaces, and of those that do not depend on x.
struct Cuts {
    n_added: usize,
    n_fixed: usize,
}

/// Search by cutting planes.
struct Search<'a> {
    primitive: &'a Arc<Primitive>,
    bounds: &'a [Bound],
    /// Limits of rotations, if there are any.
    turns: Option<&'a TurnCuts<'a>>,
    request: &'a Conditions,
    requested: &'a Movement,
    variables: Variables,
    half_spaces: HalfSpaces,
}

impl Search<'_> {
    /// Searches the nearest feasible conditions, or else those with the smallest excess.
    ///
    /// # Errors
    /// A movement that overflows.
    fn run(mut self) -> Result<Outcome> {
        if let Some(obstacle) = self.exceeded_by_start() {
            return Ok(Outcome::Infeasible(obstacle));
        }
        match self.nearest()? {
            Some(nearest) => Ok(Outcome::Feasible(nearest)),
            None => self.least_excess(),
        }
    }

    /// Returns a limit that a given start exceeds, which remains for all x.
    fn exceeded_by_start(&self) -> Option<Obstacle> {
        let Conditions { start, velocity, .. } = self.request;
        let is_given = |bound: &&Bound| match bound.derivative {
            Derivative::Position => start.is_some() || self.primitive.kind() == Kind::Discrete,
            Derivative::Velocity => velocity.is_some(),
            Derivative::Acceleration => false,
        };
        let exceeds = |bound: &&Bound| bound.start_excess(self.requested).excess > TOLERANCE;
        let bound = self.bounds.iter().filter(is_given).find(exceeds)?;
        Some(Obstacle::at(bound, self.requested, Place::START))
    }

    /// Adds the half-spaces of the stretches in which a movement at x exceeds limits by more than `tolerance`.
    fn cut(&mut self, movement: &Movement, x: &[f64], tolerance: f64) -> Cuts {
        let mut cuts = Cuts { n_added: 0, n_fixed: 0 };
        for bound in self.bounds {
            for Excess { excess, place } in bound.excesses(movement, tolerance) {
                let is_added = self.half_spaces.add(self.variables.gradient(bound, place), excess, x);
                *(if is_added { &mut cuts.n_added } else { &mut cuts.n_fixed }) += 1;
            }
        }
        cuts
    }

    /// Adds the half-spaces of the stretches in which rotations exceed limits at x by more than `tolerance`. Returns the largest excess,
    /// too.
    ///
    /// # Errors
    /// A movement that overflows.
    fn cut_turns(&mut self, x: &[f64], tolerance: f64) -> Result<(Cuts, f64)> {
        let mut cuts = Cuts { n_added: 0, n_fixed: 0 };
        let Some(turns) = self.turns else { return Ok((cuts, f64::NEG_INFINITY)) };
        let (found, largest) = turns.at(x, tolerance, |x| self.variables.conditions(x))?;
        for Cut { gradient, excess } in found {
            let is_added = self.half_spaces.add(gradient, excess, x);
            *(if is_added { &mut cuts.n_added } else { &mut cuts.n_fixed }) += 1;
        }
        Ok((cuts, largest))
    }

    /// Searches the nearest feasible conditions; returns `None` if the half-spaces have no point in common, if an excess does
    /// not depend on x, or after too many rounds.
    ///
    /// # Errors
    /// A movement that overflows.
    fn nearest(&mut self) -> Result<Option<Conditions>> {
        let mut x = vec![0.0; self.variables.len()];
        let mut cuts = self.cut(self.requested, &x, TOLERANCE);
        if cuts.n_added == 0 {
            cuts = self.cut_turns(&x, TOLERANCE)?.0;
        }
        for _ in 0..MAX_ROUNDS {
            if cuts.n_fixed > 0 {
                break;
            }
            let Some(nearest) = self.half_spaces.nearest() else { break };
            x = nearest;
            cuts = self.cut(&self.variables.movement(self.requested, &x), &x, TOLERANCE);
            if cuts.n_added + cuts.n_fixed > 0 {
                continue;
            }
            // The sum of responses has rounding errors: the movement itself decides.
            let conditions = self.variables.conditions(&x);
            cuts = self.cut(&sampled(self.primitive, &conditions)?, &x, TOLERANCE);
            if cuts.n_added + cuts.n_fixed == 0 {
                cuts = self.cut_turns(&x, TOLERANCE)?.0;
            }
            if cuts.n_added + cuts.n_fixed == 0 {
                return Ok(Some(conditions));
            }
        }
        Ok(None)
    }

    /// Searches the conditions whose largest excess is smallest. They are feasible if the feasible ones form a set that is
    /// thinner than the margins of the half-spaces.
    ///
    /// # Errors
    /// A movement that overflows.
    fn least_excess(&mut self) -> Result<Outcome> {
        let mut best = vec![0.0; self.variables.len()];
        let mut least = f64::INFINITY;
        for _ in 0..MAX_ROUNDS {
            let Some((x, expected)) = self.half_spaces.least_excess() else { break };
            let movement = self.variables.movement(self.requested, &x);
            let tolerance = expected.max(0.0) + EXCESS_TOLERANCE;
            let (cuts, of_turns) = self.cut_turns(&x, tolerance)?;
            let excess = self.bounds.iter().map(|bound| bound.excess(&movement).excess).fold(of_turns, f64::max);
            if excess < least {
                (best, least) = (x.clone(), excess);
            }
            if self.cut(&movement, &x, tolerance).n_added + cuts.n_added == 0 {
                break;
            }
        }
        let conditions = self.variables.conditions(&best);
        let movement = sampled(self.primitive, &conditions)?;
        let excesses = self.bounds.iter().map(|bound| (bound, bound.excess(&movement)));
        let worst = excesses.max_by(|(_, a), (_, b)| a.excess.total_cmp(&b.excess));
        let of_turns = self.turns.map(|turns| turns.worst(&conditions)).transpose()?.flatten();
        let exceeds = |ratio: f64| ratio - 1.0 > TOLERANCE.max(worst.map_or(f64::MIN, |(_, worst)| worst.excess));
        if let Some((bound, Extreme { ratio, time, .. })) = of_turns.filter(|(_, extreme)| exceeds(extreme.ratio)) {
            return Ok(Outcome::Infeasible(Obstacle { bound, value: ratio * bound.value, time }));
        }
        Ok(match worst.filter(|(_, worst)| worst.excess > TOLERANCE) {
            None => Outcome::Feasible(conditions),
            Some((bound, worst)) => Outcome::Infeasible(Obstacle::at(bound, &movement, worst.place)),
        })
    }
}

/// Returns the factor of its duration with which the requested movement keeps the limits; `None` if it leaves those of the
/// position, or if velocities are given: they are per second and bend the path of a slower movement.
fn slower(margins: &Margins, request: &Conditions) -> Option<f64> {
    let keeps_positions = Margins { velocity: None, acceleration: None, ..*margins }.is_feasible();
    let is_on_path = request.velocity.is_none() && request.goal_velocity.is_none();
    (keeps_positions && is_on_path).then(|| margins.slowdown())
}

impl Obstacle {
    fn at(bound: &Bound, movement: &Movement, place: Place) -> Self {
        let value = movement.value(bound.derivative, bound.dof, place);
        Self { bound: *bound, value, time: movement.time(place) }
    }

    fn error(self, vary: Vary, kind: Kind, slower: Option<f64>) -> Error {
        let Self { bound: Bound { derivative, dof, value: limit, .. }, value, time } = self;
        let quantity = match derivative {
            Derivative::Position => "position",
            Derivative::Velocity => "velocity",
            Derivative::Acceleration => "acceleration",
        };
        let (varied, varies_all) = (vary.name(kind), vary == Vary::Both);
        Error::Limits(LimitError::Infeasible { dof, varied, quantity, value, limit, time, varies_all, slower })
    }
}
