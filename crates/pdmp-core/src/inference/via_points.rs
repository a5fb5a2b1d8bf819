//! Via-points: conditions whose movement passes given points, as probable as possible under the demonstrations.

use std::sync::Arc;

use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::constraints::{Request, share_at};
use super::linear_path::{LinearPath, path_responses};
use super::passage::{Passed, Prior};
use super::residual::{CELLS, Residual};
use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::dynamics::time_warp::WarpingFunction;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::{Conditions, ResolvedConditions};
use crate::model::primitive::Primitive;
use crate::model::{Model, Prediction};
use crate::motion::perturbation::{MIN_RANGE_RATIO, largest_range};
use crate::numerics::simd::{F64x4, groups, unpack};
use crate::validate::check_range;

/// Default standard deviation of what the styles leave of a movement, relative to the range. Geometric mean over eight sets of
/// recordings of the error of held-out movements with one, two or four points given, relative to that of the mean movement, by
/// deviation and length scale:
///
/// | deviation | 0.1 | 0.2 | 0.3 | 0.4 |
/// |----:|-----:|------:|-----:|-----:|
/// | 0.01 | 0.416 | 0.420 | 0.434 | 0.451 |
/// | 0.02 | 0.406 | 0.407 | 0.413 | 0.427 |
/// | 0.03 | 0.410 | 0.409 | 0.409 | 0.415 |
/// | 0.05 | 0.422 | 0.418 | 0.413 | 0.411 |
const DEVIATION: f64 = 0.03;
/// Length scale of the residual, relative to the movement or period.
const LENGTH: f64 = 0.2;
/// Smallest standard deviation of the residual: with it the parameters carry all that they can.
const MIN_DEVIATION: f64 = 1e-4;
/// Largest number of scalar constraints; the time grows with its cube.
const MAX_CONSTRAINTS: usize = 500;
/// Error of a passage relative to the range, above which points count as contradictory.
const MAX_ERROR: f64 = 1e-9;
/// Probability with which a movement of the demonstrators is farther away than one that is called far.
const FAR: f64 = 1e-3;

/// Place of a point on a movement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum At {
    /// Time since the start, in seconds.
    Time(f64),
    /// Phase x of a discrete movement, φ in rad of a rhythmic one.
    Phase(f64),
}

/// Point that a movement passes.
#[derive(Clone, Debug, PartialEq)]
pub struct ViaPoint {
    /// Place on the movement.
    pub at: At,
    /// Position, one number for each of `dofs`; none for a velocity alone.
    pub position: Option<Vec<f64>>,
    /// Velocity per second, one number for each of `dofs`. A rotation has three in place of its four coordinates: its angular
    /// velocity in rad/s, in the frame of the model ([`crate::model::Frame`]), at the orientation that `position` gives.
    pub velocity: Option<Vec<f64>>,
    /// Indices of the DoFs, or of the coordinates of a primitive with rotations; all of them if none are given.
    pub dofs: Option<Vec<usize>>,
    /// Standard deviation of the position relative to the range of each DoF; 0 is a point that is passed exactly.
    pub tolerance: f64,
}

impl ViaPoint {
    /// Returns a position of all DoFs that is passed exactly.
    ///
    /// ```
    /// use pdmp_core::inference::{At, ViaPoint};
    ///
    /// let height = ViaPoint { dofs: Some(vec![1]), ..ViaPoint::new(At::Time(0.4), vec![0.2]) };
    /// assert_eq!(height.tolerance, 0.0);
    /// ```
    pub fn new(at: At, position: Vec<f64>) -> Self {
        Self { at, position: Some(position), velocity: None, dofs: None, tolerance: 0.0 }
    }
}

/// Options of [`through`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PassageOptions {
    /// Prediction for a context, in place of the mean and the covariance of the demonstrations.
    pub prediction: Option<Prediction>,
    /// Phase from which on a movement that is under way under the conditions departs from them, x or φ in rad. Its
    /// parameters then remain, and the additional forcing alone leads it through the points.
    pub from_phase: Option<f64>,
    /// Standard deviation of what the styles leave of a movement, relative to the range of each DoF. With 0 the parameters carry
    /// all that they can, and the forcing the least.
    pub deviation: Option<f64>,
}

/// Movement through points.
#[derive(Clone, Debug, PartialEq)]
pub struct Passage {
    /// Conditions of the movement, with its additional forcing.
    pub conditions: Conditions,
    /// Additional forcing without one that was given.
    pub forcing: Arc<AdditionalForcing>,
    /// Mahalanobis distance of the points from the movements of the demonstrators.
    pub distance: f64,
    /// Number of positions and velocities; the square of the distance of a movement of the demonstrators is chi-squared with it.
    pub n_constraints: usize,
    /// Largest displacement of each DoF by the additional forcing (D,), relative to its range.
    pub displacement: Vec<f64>,
}

impl Passage {
    /// Returns whether the points lie farther from the demonstrations than 999 of 1000 movements of the demonstrators would.
    pub fn is_far(&self) -> bool {
        let distribution = ChiSquared::new(self.n_constraints as f64);
        distribution.is_ok_and(|chi| chi.sf(self.distance * self.distance) < FAR)
    }
}

/// Computes the most probable movement through points.
///
/// A movement of the demonstrators is y(u) = Φ(u)θ + δ(u), with style, goal and start θ, or style and anchor, as scattered as those
/// of the demonstrations or as predicted for a context, and a residual δ with a Matérn-5/2 covariance of the given deviation
/// (`passage`). Conditions that are given remain; the others and the residual are the mean given the points, the residual as
/// [`Conditions::forcing`]. Points without tolerance are passed to 1e-9 of the range: of a rhythmic movement on its limit
/// cycle, in every period.
///
/// ```
/// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit, rollout};
/// # use pdmp_core::motion::TimeGrid;
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// use pdmp_core::inference::{At, PassageOptions, ViaPoint, through};
///
/// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let points = [ViaPoint::new(At::Time(0.4), vec![0.4, 0.25])];
/// let passage = through(&model, &points, &Conditions::default(), &PassageOptions::default())?;
/// let movement = rollout(model.primitive(), &passage.conditions, TimeGrid { dt: 0.1, duration: None })?;
/// assert!((movement.position[[4, 1]] - 0.25).abs() < 1e-9);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// No point; one outside of the movement or before `from_phase`; a vector of a wrong length or a number that is not finite; the
/// velocity of a rotation without its orientation; a negative tolerance or deviation; points that contradict each other or the
/// given conditions; more than 500 numbers.
pub fn through(
    model: &Model,
    points: &[ViaPoint],
    conditions: &Conditions,
    options: &PassageOptions,
) -> Result<Passage> {
    let primitive = model.primitive();
    let inside = primitive.inside();
    let canonical = inside.canonical();
    let base = conditions.clone().or(mean(model, options)?);
    let resolved = base.complete(primitive)?;
    let time = time_of(inside, &base)?;
    let responses = path_responses(inside, resolved.has_goal_velocity)?;
    let path = LinearPath::new(inside, &resolved, end_slopes(&resolved, &time), &responses);
    let deviation = options.deviation.unwrap_or(DEVIATION);
    let allowed = "must be a share of the range, from 0 to 1000";
    check_range("deviation", deviation, (0.0..=1e3).contains(&deviation), allowed)?;
    let smallest = MIN_RANGE_RATIO * largest_range(inside.ranges());
    let scales: Vec<f64> = inside.ranges().iter().map(|range| range.max(smallest)).collect();
    let discrete = inside.kind() == Kind::Discrete;
    let from = options.from_phase.map(|phase| share_at(canonical, "from_phase", phase)).transpose()?;
    let late = Error::Argument { name: "from_phase", problem: "is the end of the movement: choose an earlier one" };
    let covariance = covariance(model, path.n_parameters(), conditions, options);
    let prior = Prior {
        path: &path,
        carries: from.is_some() && covariance.iter().any(|x| *x != 0.0),
        covariance,
        residual: Residual::new(canonical, LENGTH, from).ok_or(late)?,
        variances: scales.iter().map(|scale| (scale * deviation.max(MIN_DEVIATION)).powi(2)).collect(),
        extent: canonical.extent(),
    };
    let parameters = [&resolved.style, &resolved.centre].into_iter().chain(resolved.start.iter().filter(|_| discrete));
    let parameters: Vec<f64> = parameters.flatten().copied().collect();
    let request =
        Request { primitive, conditions: &resolved, prior: &prior, scales: &scales, time: &time, from, parameters };
    let constraints = request.constraints(points)?;
    let n_constraints = constraints.rows.len();
    if n_constraints == 0 {
        return Err(Error::Argument { name: "points", problem: "are empty: pass at least one" });
    }
    let allowed = "must be at most 500: pass fewer points";
    check_range("number of constraints", n_constraints as f64, n_constraints <= MAX_CONSTRAINTS, allowed)?;
    let passed = prior.pass(&constraints);
    let passed = passed.filter(|passed| passed.error <= MAX_ERROR && passed.distance.is_finite());
    let Some(Passed { change, forcing, distance, .. }) = passed else {
        let problem = "contradict each other or the conditions: no movement passes all of them; give them a tolerance, or \
                       leave one out";
        return Err(Error::Argument { name: "points", problem });
    };
    let displacement = largest(&forcing, &scales, canonical.extent());
    let forcing = Arc::new(forcing);
    let sum = match &conditions.forcing {
        Some(present) => Arc::new(present.plus(&forcing)?),
        None => Arc::clone(&forcing),
    };
    let moved = if from.is_some() { base } else { changed(primitive, base, &request.parameters, change.as_slice()) };
    let conditions = Conditions { forcing: Some(sum), ..moved };
    Ok(Passage { conditions, forcing, distance, n_constraints, displacement })
}

/// Returns the conditions that the demonstrations or a prediction supply.
fn mean(model: &Model, options: &PassageOptions) -> Result<Conditions> {
    match &options.prediction {
        Some(prediction) => Ok(prediction.conditions.clone()),
        None => model.mean(),
    }
}

/// Returns time over phase under the conditions.
fn time_of(primitive: &Primitive, conditions: &Conditions) -> Result<WarpingFunction> {
    match &conditions.segment_durations {
        Some(segment_durations) => primitive.warping_function(segment_durations),
        None => {
            let duration = primitive.duration() * conditions.time_constant(primitive)? / primitive.tau();
            Ok(WarpingFunction::new(primitive.kind(), &[0.0, 1.0], &[duration]))
        }
    }
}

/// Returns the slopes dy/dv at start and end, where the conditions give velocities.
fn end_slopes(conditions: &ResolvedConditions, time: &WarpingFunction) -> [Option<Vec<f64>>; 2] {
    let slope = |velocity: &[f64], v: f64| velocity.iter().map(|x| x * time.slope(v)).collect::<Vec<f64>>();
    let start = conditions.velocity.as_ref().map(|velocity| slope(velocity, 0.0));
    let end = conditions.has_goal_velocity.then(|| slope(&conditions.goal_velocity, 1.0));
    [start, end]
}

/// Returns the covariance (P, P) of the parameters, zero for those that are given.
fn covariance(model: &Model, n: usize, given: &Conditions, options: &PassageOptions) -> DMatrix<f64> {
    let (n_styles, n_dofs) = (model.n_styles(), model.primitive().inside().n_dofs());
    let is_given = |p: usize| match p {
        p if p < n_styles => given.style.is_some(),
        p if p < n_styles + n_dofs => given.goal.is_some() || given.anchor.is_some(),
        _ => given.start.is_some(),
    };
    let predicted = options.prediction.as_ref().and_then(|prediction| prediction.covariance.as_ref());
    let covariance = predicted.unwrap_or_else(|| model.covariance());
    let given: Vec<bool> = (0..n).map(is_given).collect();
    DMatrix::from_fn(n, n, |p, q| if given[p] || given[q] { 0.0 } else { covariance[[p, q]] })
}

/// Returns the largest displacement of each DoF (D,) relative to its range, at the knots.
fn largest(forcing: &AdditionalForcing, scales: &[f64], extent: f64) -> Vec<f64> {
    let mut largest = vec![F64x4::ZERO; groups(scales.len())];
    for (group, largest) in largest.iter_mut().enumerate() {
        for k in 0..CELLS {
            let value = forcing.sample::<F64x4>(group, extent * (k as f64 / CELLS as f64)).value;
            *largest = largest.fast_max(value.abs());
        }
    }
    unpack(&largest, scales.len()).iter().zip(scales).map(|(largest, scale)| largest / scale).collect()
}

/// Returns conditions with changed parameters.
fn changed(primitive: &Primitive, base: Conditions, parameters: &[f64], change: &[f64]) -> Conditions {
    let sum: Vec<f64> = parameters.iter().zip(change).map(|(value, change)| value + change).collect();
    let inside = primitive.coordinates().map_or(primitive, |coordinates| coordinates.dofs());
    let (style, positions) = sum.split_at(inside.n_styles());
    let (centre, start) = positions.split_at(inside.n_dofs());
    let (centre, style) = (Some(centre.to_vec()), Some(style.to_vec()));
    let moved = match primitive.kind() {
        Kind::Discrete => Conditions { style, goal: centre, start: Some(start.to_vec()), ..Conditions::default() },
        Kind::Rhythmic => Conditions { style, anchor: centre, ..Conditions::default() },
    };
    let Conditions { style, goal, anchor, start, .. } = match primitive.coordinates() {
        Some(coordinates) => coordinates.of_dofs(moved),
        None => moved,
    };
    Conditions { style, goal: goal.or(base.goal), anchor: anchor.or(base.anchor), start: start.or(base.start), ..base }
}
