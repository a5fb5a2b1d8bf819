//! Conditions nearest to requested ones whose movement keeps limits.
//!
//! With a fixed start and τ, a movement is affine in style s and goal g, so that limits of y, ẏ and ÿ at one time are half-spaces.
//! In the units of the demonstrations, x = L⁻¹(Δs, Δg) with LLᵀ = diag(Σ_s, Σ_g), the nearest point within them solves
//!
//! ```text
//! min ½|x|²   subject to   aᵢᵀx ≤ bᵢ.
//! ```
//!
//! Of all times only the worst one of each limit joins the program per round, until the movement keeps every limit.
//!
//! J. E. Kelley, *The cutting-plane method for solving convex programs*, Journal of the Society for Industrial and Applied
//! Mathematics 8(4), 1960. P. J. Goulart, Y. Chen, *Clarabel: an interior-point solver for conic programs with quadratic
//! objectives*, 2024, arXiv:2405.12762.

use std::sync::Arc;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::DMatrix;
use ndarray::Array2;

use crate::error::{Error, LimitError, Result};
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::model::responses::Derivative;
use crate::model::{DemonstrationParameters, Model};
use crate::motion::feasibility::{Bound, Place, TOLERANCE, bounds, ranges, sampled};
use crate::motion::limits::Limits;
use crate::motion::trajectory::Trajectory;

/// Maximum number of rounds; three to twenty suffice on recordings.
const MAX_ROUNDS: usize = 50;
/// Distance that conditions keep from each half-space, in units of the demonstrations or, if larger, its distance from the request:
/// above the accuracy of the solver.
const MARGIN: f64 = 1e-6;
/// Standard deviation that conditions have at least, relative to the range of the demonstrated styles or the positions.
const MIN_DEVIATION: f64 = 1e-3;
/// Change of a limited quantity per unit of x, relative to its limit, below which conditions cannot change it.
const MIN_SENSITIVITY: f64 = 1e-9;
/// Weight of |x|² against the excess in the search for the smallest excess.
const MIN_WEIGHT: f64 = 1e-6;

/// Conditions that the search changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vary {
    /// Style and goal, or anchor of a rhythmic movement.
    Both,
    /// Style.
    Style,
    /// Goal, or anchor of a rhythmic movement.
    Goal,
}

/// Computes the conditions nearest to the requested ones with which the movement keeps limits of position, velocity and
/// acceleration over its demonstrated duration, or one period, scaled by τ.
///
/// The distance of a change Δs of the style and Δg of the goal, or anchor, is Δsᵀ Σ_s⁻¹ Δs + Δgᵀ Σ_g⁻¹ Δg with the covariances of
/// the demonstrations, to which squares of a thousandth of the range of styles and positions are added. The limits are kept within
/// 1e-6 of them. Start, τ and the other
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
    if let Some(coordinates) = model.primitive().coordinates() {
        limits.check_rotations(model.primitive())?;
        let inside = Model { primitive: Arc::clone(coordinates.dofs()), ..model.clone() };
        let found = nearest_feasible(&inside, limits, &coordinates.constant_in_dofs(conditions)?, vary)?;
        let (velocity, goal_velocity) = (conditions.velocity.clone(), conditions.goal_velocity.clone());
        return Ok(Conditions { velocity, goal_velocity, ..coordinates.of_dofs(found) });
    }
    let primitive = model.primitive();
    let ranges = ranges(primitive)?;
    let bounds = bounds(limits, &ranges)?;
    let mut movement = sampled(primitive, conditions)?;
    if bounds.iter().all(|bound| bound.is_kept(&movement)) {
        return Ok(conditions.clone());
    }
    let search = Search::new(model, conditions, &movement, &ranges, vary)?;
    let mut program = Program::default();
    let mut x = vec![0.0; search.n_variables()];
    for _ in 0..MAX_ROUNDS {
        for bound in &bounds {
            let (place, excess) = bound.worst(&movement);
            if excess > TOLERANCE && !program.add(search.row(bound, place), excess, &x) {
                return Err(search.infeasible(bound, &movement));
            }
        }
        x = match program.nearest() {
            Some(x) => x,
            None => return Err(search.least_excess(primitive, program, &bounds)?),
        };
        let found = search.conditions(&x);
        movement = sampled(primitive, &found)?;
        if bounds.iter().all(|bound| bound.is_kept(&movement)) {
            return Ok(found);
        }
    }
    Err(Error::Fit(
        "no conditions within the limits were found in 50 rounds; widen the limits or enlarge tau".to_string(),
    ))
}

/// Affine map from changes x of the conditions to movements.
struct Search {
    kind: Kind,
    vary: Vary,
    request: Conditions,
    style: Vec<f64>,
    centre: Vec<f64>,
    /// Cholesky factors of the covariances of styles and goals.
    factors: [DMatrix<f64>; 2],
    /// Movements per unit of each style.
    styles: Vec<Trajectory>,
    /// Movement per unit of the goal of each DoF, which moves this DoF alone.
    goal: Trajectory,
}

impl Search {
    fn new(model: &Model, request: &Conditions, movement: &Trajectory, ranges: &[f64], vary: Vary) -> Result<Self> {
        let (primitive, kind) = (model.primitive(), model.kind());
        let resolved = request.complete(primitive)?;
        let DemonstrationParameters { styles, goals, anchors, .. } = model.demonstrated();
        let centres = match kind {
            Kind::Discrete => goals,
            Kind::Rhythmic => anchors,
        };
        let largest = styles.iter().fold(0.0f64, |largest, s| largest.max(s.abs()));
        let floors = vec![if largest > 0.0 { largest } else { 1.0 }; primitive.n_styles()];
        let factors = [factor(styles, &floors)?, factor(centres, ranges)?];
        let mut search = Self {
            kind,
            vary,
            request: request.clone(),
            style: resolved.style,
            centre: resolved.centre,
            factors,
            styles: Vec::with_capacity(primitive.n_styles()),
            goal: movement.clone(),
        };
        let zero = vec![0.0; primitive.n_dofs()];
        for j in 0..primitive.n_styles() {
            let mut change = vec![0.0; primitive.n_styles()];
            change[j] = floors[j];
            let unit = search.response(primitive, movement, &change, &zero, &vec![floors[j]; zero.len()])?;
            search.styles.push(unit);
        }
        search.goal = search.response(primitive, movement, &vec![0.0; floors.len()], ranges, ranges)?;
        Ok(search)
    }

    /// Returns the change of the movement with a change of style and goal, divided by `scale` (D,).
    fn response(
        &self,
        primitive: &Arc<Primitive>,
        movement: &Trajectory,
        style: &[f64],
        centre: &[f64],
        scale: &[f64],
    ) -> Result<Trajectory> {
        let mut changed = sampled(primitive, &self.changed(style, centre))?;
        let scale = ndarray::ArrayView1::from(scale);
        let Trajectory { position, velocity, acceleration, .. } = &mut changed;
        for (to, from) in
            [(position, &movement.position), (velocity, &movement.velocity), (acceleration, &movement.acceleration)]
        {
            *to -= from;
            *to /= &scale;
        }
        Ok(changed)
    }

    /// Returns the number of variables x.
    fn n_variables(&self) -> usize {
        match self.vary {
            Vary::Both => self.style.len() + self.centre.len(),
            Vary::Style => self.style.len(),
            Vary::Goal => self.centre.len(),
        }
    }

    /// Returns the requested conditions with a change of style (J,) and goal or anchor (D,).
    fn changed(&self, style: &[f64], centre: &[f64]) -> Conditions {
        let sum = |values: &[f64], changes: &[f64]| values.iter().zip(changes).map(|(v, change)| v + change).collect();
        let mut conditions = self.request.clone();
        if self.vary != Vary::Goal || style.iter().any(|change| *change != 0.0) {
            conditions.style = Some(sum(&self.style, style));
        }
        if self.vary != Vary::Style || centre.iter().any(|change| *change != 0.0) {
            let centre = Some(sum(&self.centre, centre));
            match self.kind {
                Kind::Discrete => conditions.goal = centre,
                Kind::Rhythmic => conditions.anchor = centre,
            }
        }
        conditions
    }

    /// Returns the conditions of x.
    fn conditions(&self, x: &[f64]) -> Conditions {
        let n_styles = if self.vary == Vary::Goal { 0 } else { self.style.len() };
        let (style, centre) = x.split_at(n_styles);
        let change = |factor: &DMatrix<f64>, x: &[f64]| -> Vec<f64> {
            let columns = x.len();
            (0..factor.nrows()).map(|i| (0..columns).map(|j| factor[(i, j)] * x[j]).sum()).collect()
        };
        self.changed(&change(&self.factors[0], style), &change(&self.factors[1], centre))
    }

    /// Returns the change of the excess over a limit at a place per unit of x.
    fn row(&self, bound: &Bound, place: Place) -> Vec<f64> {
        let at = |unit: &Trajectory| bound.side * place.value(unit, bound.derivative, bound.dof) / bound.scale;
        let mut row = Vec::with_capacity(self.n_variables());
        if self.vary != Vary::Goal {
            let by_style: Vec<f64> = self.styles.iter().map(at).collect();
            let factor = &self.factors[0];
            row.extend(
                (0..by_style.len()).map(|j| by_style.iter().enumerate().map(|(i, r)| r * factor[(i, j)]).sum::<f64>()),
            );
        }
        if self.vary != Vary::Style {
            let (by_goal, factor) = (at(&self.goal), &self.factors[1]);
            row.extend((0..factor.ncols()).map(|d| by_goal * factor[(bound.dof, d)]));
        }
        row
    }

    /// Returns the error of the movement whose largest excess is smallest.
    ///
    /// # Errors
    /// Conditions that do not fit the primitive.
    fn least_excess(&self, primitive: &Arc<Primitive>, mut program: Program, bounds: &[Bound]) -> Result<Error> {
        let mut movement = sampled(primitive, &self.request)?;
        for _ in 0..MAX_ROUNDS {
            let Some((x, least)) = program.least_excess() else { break };
            movement = sampled(primitive, &self.conditions(&x))?;
            let mut is_least = true;
            for bound in bounds {
                let (place, excess) = bound.worst(&movement);
                if excess > 1.01 * least + TOLERANCE && program.add(self.row(bound, place), excess, &x) {
                    is_least = false;
                }
            }
            if is_least {
                break;
            }
        }
        let excess = |bound: &&Bound| bound.worst(&movement).1;
        let worst = bounds.iter().max_by(|a, b| excess(a).total_cmp(&excess(b)));
        Ok(self.infeasible(worst.expect("a movement outside its limits has limits"), &movement))
    }

    /// Returns the error of a movement that exceeds a limit.
    fn infeasible(&self, bound: &Bound, movement: &Trajectory) -> Error {
        let (place, _) = bound.worst(movement);
        let centre = if self.kind == Kind::Discrete { "goal" } else { "anchor" };
        let varied = match (self.vary, self.kind) {
            (Vary::Both, Kind::Discrete) => "style and goal",
            (Vary::Both, Kind::Rhythmic) => "style and anchor",
            (Vary::Style, _) => "style",
            (Vary::Goal, _) => centre,
        };
        let is_position = bound.derivative == Derivative::Position;
        let quantity = match bound.derivative {
            Derivative::Position => "position",
            Derivative::Velocity => "velocity",
            Derivative::Acceleration => "acceleration",
        };
        let time = place.time(movement);
        let is_given = !is_position && time == 0.0 && self.request.velocity.is_some();
        let remedy = match (is_position, self.kind, self.vary == Vary::Both) {
            _ if is_given => "give a lower start velocity or widen the limits",
            (true, _, true) => "move the start or widen the limits",
            (true, _, false) => "vary both, move the start or widen the limits",
            (false, Kind::Discrete, true) => "enlarge tau, see fastest_tau, or widen the limits",
            (false, Kind::Discrete, false) => "vary both, enlarge tau, see fastest_tau, or widen the limits",
            (false, Kind::Rhythmic, true) => "enlarge tau or widen the limits",
            (false, Kind::Rhythmic, false) => "vary both, enlarge tau or widen the limits",
        };
        Error::Limits(LimitError::Infeasible {
            dof: bound.dof,
            varied,
            quantity,
            value: place.value(movement, bound.derivative, bound.dof),
            limit: bound.value,
            time,
            remedy,
        })
    }
}

/// Returns the Cholesky factor of the covariance of the rows of a matrix (M, n), with [`MIN_DEVIATION`] of the ranges (n,).
///
/// # Errors
/// Numbers beyond the range of the covariance.
fn factor(rows: &Array2<f64>, ranges: &[f64]) -> Result<DMatrix<f64>> {
    let n = rows.ncols();
    let mean = rows.mean_axis(ndarray::Axis(0)).unwrap_or_else(|| ndarray::Array1::zeros(n));
    let centred = rows - &mean;
    let count = rows.nrows().saturating_sub(1).max(1) as f64;
    let covariance = centred.t().dot(&centred) / count;
    let regularised = DMatrix::from_fn(n, n, |i, j| {
        covariance[[i, j]] + if i == j { (MIN_DEVIATION * ranges[i]).powi(2) } else { 0.0 }
    });
    let cholesky = regularised.cholesky();
    let problem = "cannot be compared: the covariance of the demonstrated styles or goals is not positive definite";
    cholesky.map(|cholesky| cholesky.l()).ok_or(Error::Argument { name: "conditions", problem })
}

/// Half-spaces of x.
#[derive(Default)]
struct Program {
    /// Normals of unit length, and distances from the origin.
    rows: Vec<(Vec<f64>, f64)>,
    /// Lengths of the normals before.
    lengths: Vec<f64>,
}

impl Program {
    /// Adds the half-space in which an excess at `x` with a given gradient is not positive; returns whether the gradient is
    /// not zero.
    fn add(&mut self, mut row: Vec<f64>, excess: f64, x: &[f64]) -> bool {
        let length = row.iter().map(|r| r * r).sum::<f64>().sqrt();
        if length <= MIN_SENSITIVITY {
            return false;
        }
        row.iter_mut().for_each(|r| *r /= length);
        let here: f64 = row.iter().zip(x).map(|(r, x)| r * x).sum();
        let bound = here - excess / length;
        self.rows.push((row, bound - MARGIN * bound.abs().max(1.0)));
        self.lengths.push(length);
        true
    }

    /// Returns the point of the half-spaces nearest to the origin, or `None` if there is none.
    fn nearest(&self) -> Option<Vec<f64>> {
        let n = self.rows.first()?.0.len();
        let columns = (0..n).map(|j| self.rows.iter().map(|(row, _)| row[j]).collect()).collect();
        // The point is proportional to the bounds, which are scaled for the solver's tolerances.
        let scale = self.rows.iter().fold(1.0f64, |scale, (_, bound)| scale.max(bound.abs()));
        let bounds = self.rows.iter().map(|(_, bound)| bound / scale).collect();
        let x = solve(vec![1.0; n], vec![0.0; n], columns, bounds)?;
        Some(x.into_iter().map(|x| x * scale).collect())
    }

    /// Returns a point with the smallest maximum excess, and that excess.
    fn least_excess(&self) -> Option<(Vec<f64>, f64)> {
        let n = self.rows.first()?.0.len();
        let scaled = |j: usize| self.rows.iter().zip(&self.lengths).map(|((row, _), length)| row[j] * length).collect();
        let mut columns: Vec<Vec<f64>> = (0..n).map(scaled).collect();
        columns.push(vec![-1.0; self.rows.len()]);
        let (mut weights, mut costs) = (vec![MIN_WEIGHT; n], vec![0.0; n]);
        weights.push(0.0);
        costs.push(1.0);
        let bounds = self.rows.iter().zip(&self.lengths).map(|((_, bound), length)| bound * length).collect();
        let mut x = solve(weights, costs, columns, bounds)?;
        let least = x.pop()?;
        Some((x, least))
    }
}

/// Minimises ½Σ weightⱼxⱼ² + Σ costⱼxⱼ subject to Ax ≤ b, with A by columns; returns `None` without a solution.
fn solve(weights: Vec<f64>, costs: Vec<f64>, columns: Vec<Vec<f64>>, bounds: Vec<f64>) -> Option<Vec<f64>> {
    let (m, n) = (bounds.len(), weights.len());
    let quadratic = CscMatrix::new(n, n, (0..=n).collect(), (0..n).collect(), weights);
    let pointers = (0..=n).map(|j| j * m).collect();
    let indices = (0..n).flat_map(|_| 0..m).collect();
    let constraints = CscMatrix::new(m, n, pointers, indices, columns.concat());
    let settings = DefaultSettings { verbose: false, tol_feas: 1e-9, ..DefaultSettings::default() };
    let cones = [SupportedConeT::NonnegativeConeT(m)];
    let mut solver = DefaultSolver::new(&quadratic, &costs, &constraints, &bounds, &cones, settings).ok()?;
    solver.solve();
    let solved = matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
    (solved && solver.solution.x.iter().all(|x| x.is_finite())).then_some(solver.solution.x)
}
