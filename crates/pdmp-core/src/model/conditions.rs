//! Conditions under which a movement starts.

use std::sync::Arc;

use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::dynamics::canonical::turn;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::primitive::Primitive;
use crate::numerics::state::clone_in_place;
use crate::validate::{check_length, check_positive, check_range, check_vector};

/// Conditions under which a movement starts. A condition that is `None` is that of the nominal demonstration.
///
/// ```
/// use pdmp_core::Conditions;
///
/// let near = Conditions { goal: Some(vec![0.2, 0.0]), tau: Some(1.0), ..Conditions::default() };
/// let far = Conditions { goal: Some(vec![0.4, 0.2]), tau: Some(2.0), ..Conditions::default() };
/// assert_eq!(near.blend(&far, 0.5)?.tau, Some(1.5));
/// # Ok::<(), pdmp_core::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Conditions {
    /// Style s (J,).
    pub style: Option<Vec<f64>>,
    /// Goal g (D,), discrete.
    pub goal: Option<Vec<f64>>,
    /// Anchor y_a (D,), rhythmic.
    pub anchor: Option<Vec<f64>>,
    /// Start position (D,); a rhythmic movement otherwise starts on its cycle.
    pub start: Option<Vec<f64>>,
    /// Start velocity (D,), per second; otherwise that of the demonstrations.
    pub velocity: Option<Vec<f64>>,
    /// Final velocity (D,), per second, with which a discrete movement passes its goal at the end; otherwise that of the
    /// demonstrations.
    pub goal_velocity: Option<Vec<f64>>,
    /// Amplitude r₀, rhythmic; otherwise 1.
    pub amplitude: Option<f64>,
    /// Time constant τ, in seconds.
    pub tau: Option<f64>,
    /// Time in each segment of the movement (K,), in seconds, in place of τ. A rollout follows it; a controller, whose τ
    /// can be set at any tick, takes its sum: see [`Primitive::tau_at`].
    pub segment_durations: Option<Vec<f64>>,
    /// Phase φ at which a rhythmic movement starts, in rad: on its limit cycle, with nothing to die away; otherwise 0.
    pub phase: Option<f64>,
    /// Additional forcing, which displaces the movement; otherwise none.
    pub forcing: Option<Arc<AdditionalForcing>>,
}

impl Conditions {
    /// Returns these conditions, with those of `other` where one is `None`. A time constant and segment durations stand
    /// for each other: one of them is taken as given where either is.
    pub fn or(self, other: Self) -> Self {
        let paced = self.tau.is_some() || self.segment_durations.is_some();
        let (tau, segment_durations) =
            if paced { (self.tau, self.segment_durations) } else { (other.tau, other.segment_durations) };
        Self {
            style: self.style.or(other.style),
            goal: self.goal.or(other.goal),
            anchor: self.anchor.or(other.anchor),
            start: self.start.or(other.start),
            velocity: self.velocity.or(other.velocity),
            goal_velocity: self.goal_velocity.or(other.goal_velocity),
            amplitude: self.amplitude.or(other.amplitude),
            tau,
            segment_durations,
            phase: self.phase.or(other.phase),
            forcing: self.forcing.or(other.forcing),
        }
    }

    /// Returns the conditions (1 − share)·self + share·other; a share outside [0, 1] extrapolates.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit, rollout};
    /// # use pdmp_core::motion::TimeGrid;
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let (low, high) = (model.conditions(&[0])?, model.conditions(&[2])?);
    /// let between = low.blend(&high, 0.5)?;
    /// let trajectory = rollout(model.primitive(), &between, TimeGrid { dt: 0.01, duration: None })?;
    /// assert_eq!(trajectory.position.nrows(), 101);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A condition that one of the two lacks, lengths that differ, or a share that is not finite.
    pub fn blend(&self, other: &Self, share: f64) -> Result<Self> {
        check_range("share", share, share.is_finite(), "must be finite")?;
        let mix = |a: f64, b: f64| (1.0 - share) * a + share * b;
        let number = |name, a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => Ok(Some(mix(a, b))),
            (None, None) => Ok(None),
            _ => Err(Error::Single { name }),
        };
        let vector = |name, a: &Option<Vec<f64>>, b: &Option<Vec<f64>>| match (a, b) {
            (Some(a), Some(b)) => check_length(name, b.len(), a.len(), "element of the other conditions")
                .map(|()| Some(a.iter().zip(b).map(|(a, b)| mix(*a, *b)).collect())),
            (None, None) => Ok(None),
            _ => Err(Error::Single { name }),
        };
        Ok(Self {
            style: vector("style", &self.style, &other.style)?,
            goal: vector("goal", &self.goal, &other.goal)?,
            anchor: vector("anchor", &self.anchor, &other.anchor)?,
            start: vector("start", &self.start, &other.start)?,
            velocity: vector("velocity", &self.velocity, &other.velocity)?,
            goal_velocity: vector("goal_velocity", &self.goal_velocity, &other.goal_velocity)?,
            amplitude: number("amplitude", self.amplitude, other.amplitude)?,
            tau: number("tau", self.tau, other.tau)?,
            segment_durations: vector("segment_durations", &self.segment_durations, &other.segment_durations)?,
            phase: number("phase", self.phase, other.phase)?,
            forcing: blend_forcing(&self.forcing, &other.forcing, share)?,
        })
    }

    /// Checks every number against the model, and fills in the nominal demonstration's where none is given.
    ///
    /// # Errors
    /// A wrong length, a number that is not finite, τ that is not positive, or a condition of the other kind.
    pub(crate) fn complete(&self, primitive: &Primitive) -> Result<ResolvedConditions> {
        if let Some(coordinates) = primitive.coordinates() {
            return coordinates.complete(self);
        }
        let nominal = &primitive.nominal;
        let centre = |name, given: &Option<Vec<f64>>| match given {
            Some(value) => check_vector(name, value, nominal.centre.len(), "DoF").map(|()| value.clone()),
            None => Ok(nominal.centre.clone()),
        };
        let kind = primitive.kind();
        let centre = match kind {
            Kind::Discrete => {
                reject_for_kind(kind, "anchor", self.anchor.is_some())?;
                reject_for_kind(kind, "amplitude", self.amplitude.is_some())?;
                centre("goal", &self.goal)?
            }
            Kind::Rhythmic => {
                reject_for_kind(kind, "goal", self.goal.is_some())?;
                centre("anchor", &self.anchor)?
            }
        };
        reject_goal_velocity(primitive, self.goal_velocity.is_some())?;
        let vectors = [("start", &self.start), ("velocity", &self.velocity), ("goal_velocity", &self.goal_velocity)];
        for (name, value) in vectors {
            if let Some(value) = value {
                check_vector(name, value, primitive.n_dofs(), "DoF")?;
            }
        }
        let tau = self.time_constant(primitive)?;
        let amplitude = self.amplitude.unwrap_or(1.0);
        check_amplitude(amplitude)?;
        let start = match (&self.start, kind) {
            (None, Kind::Discrete) => Some(nominal.start.clone()),
            (start, _) => start.clone(),
        };
        let style = match &self.style {
            Some(style) => check_style(style, primitive.n_styles()).map(|()| style.clone())?,
            None => nominal.style.clone(),
        };
        self.phase.map_or(Ok(()), |phase| check_phase(kind, phase))?;
        if let Some(forcing) = &self.forcing {
            forcing.check(primitive.canonical(), primitive.n_dofs())?;
        }
        Ok(ResolvedConditions {
            style,
            centre,
            start,
            velocity: self.velocity.clone(),
            drift: None,
            goal_velocity: self.goal_velocity.clone().unwrap_or_else(|| vec![0.0; primitive.n_dofs()]),
            has_goal_velocity: self.goal_velocity.is_some(),
            amplitude,
            tau,
            phase: turn(self.phase.unwrap_or(0.0)),
            forcing: self.forcing.clone(),
        })
    }

    /// Returns τ in seconds: the given one, that of a movement as long as the sum of the segment durations, or the nominal demonstration's.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let slow = Conditions { segment_durations: Some(vec![2.0]), ..Conditions::default() };
    /// assert!((slow.time_constant(model.primitive())? - 2.0 * model.tau()).abs() < 1e-12);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Both of them, a τ that is not positive, or segment durations that do not fit the primitive.
    pub fn time_constant(&self, primitive: &Primitive) -> Result<f64> {
        let tau = match (self.tau, &self.segment_durations) {
            (Some(_), Some(_)) => {
                return Err(Error::Conflict {
                    names: ["tau", "segment_durations"],
                    reason: "segment durations add up to the duration",
                });
            }
            (None, Some(segment_durations)) => {
                primitive.check_segment_durations(segment_durations)?;
                primitive.tau * segment_durations.iter().sum::<f64>() / primitive.duration()
            }
            (tau, None) => tau.unwrap_or(primitive.tau),
        };
        check_tau(tau, primitive.tau).map(|()| tau)
    }
}

/// Conditions with nothing left open but a start on the cycle and a demonstrated start velocity.
#[derive(Debug)]
pub(crate) struct ResolvedConditions {
    pub(crate) style: Vec<f64>,
    /// Goal or anchor.
    pub(crate) centre: Vec<f64>,
    pub(crate) start: Option<Vec<f64>>,
    pub(crate) velocity: Option<Vec<f64>>,
    /// Velocity of the DoFs per unit of the clock that offsets the motion of the mean rotations at the start; only with a
    /// start velocity.
    pub(crate) drift: Option<Vec<f64>>,
    /// Final velocity; zero if none is in force.
    pub(crate) goal_velocity: Vec<f64>,
    pub(crate) has_goal_velocity: bool,
    pub(crate) amplitude: f64,
    pub(crate) tau: f64,
    /// φ in [0, 2π); 0 where discrete.
    pub(crate) phase: f64,
    pub(crate) forcing: Option<Arc<AdditionalForcing>>,
}

clone_in_place!(ResolvedConditions {
    style,
    centre,
    start,
    velocity,
    drift,
    goal_velocity,
    has_goal_velocity,
    amplitude,
    tau,
    phase,
    forcing,
});

/// Returns the displacement (1 − share)·a + share·b; an absent forcing is zero.
fn blend_forcing(
    a: &Option<Arc<AdditionalForcing>>,
    b: &Option<Arc<AdditionalForcing>>,
    share: f64,
) -> Result<Option<Arc<AdditionalForcing>>> {
    let part = |forcing: &Option<Arc<AdditionalForcing>>, share: f64| {
        forcing.as_deref().filter(|_| share != 0.0).map(|forcing| forcing.clone().scaled(share))
    };
    Ok(match (part(a, 1.0 - share), part(b, share)) {
        (Some(a), Some(b)) => Some(Arc::new(a.plus(&b)?)),
        (one, other) => one.or(other).map(Arc::new),
    })
}

/// Refuses an argument that this kind of primitive does not have.
pub(crate) fn reject_for_kind(kind: Kind, name: &'static str, given: bool) -> Result<()> {
    let instead = match (kind, name) {
        (Kind::Discrete, "anchor") => ": it moves to a goal; set goal",
        (Kind::Discrete, "phase") => ": its state depends on its past; it starts at the start of its path",
        (Kind::Rhythmic, "goal") => ": it moves about an anchor; set anchor",
        _ => "",
    };
    if given { Err(Error::Kind { name, kind, instead }) } else { Ok(()) }
}

/// Refuses a final velocity where the frame cannot carry it.
pub(crate) fn reject_goal_velocity(primitive: &Primitive, given: bool) -> Result<()> {
    let kind = primitive.kind();
    reject_for_kind(kind, "goal_velocity", kind == Kind::Rhythmic && given)?;
    if given && primitive.transport.is_immediate() {
        return Err(Error::Argument {
            name: "goal_velocity",
            problem: "needs learnt transport: immediate transport ends with the velocity of the demonstrations",
        });
    }
    Ok(())
}

/// Largest magnitude of a style. Demonstrated ones are at most 1: the bound only keeps products finite.
pub(crate) const MAX_STYLE_MAGNITUDE: f64 = 1e100;

/// Checks a style (J,).
pub(crate) fn check_style(style: &[f64], n_styles: usize) -> Result<()> {
    check_vector("style", style, n_styles, "style dimension")?;
    match style.iter().position(|s| s.abs() > MAX_STYLE_MAGNITUDE) {
        Some(index) => Err(Error::TooLarge { name: "style", index, value: style[index], limit: MAX_STYLE_MAGNITUDE }),
        None => Ok(()),
    }
}

/// Checks a time constant against the model's own, in seconds.
pub(crate) fn check_tau(tau: f64, own: f64) -> Result<()> {
    check_positive("tau", tau)?;
    check_range("tau", tau, (1e-6..=1e6).contains(&(tau / own)), "must lie within a millionfold of the model's tau")
}

/// Checks a phase, in rad, of a rhythmic primitive.
pub(crate) fn check_phase(kind: Kind, phase: f64) -> Result<()> {
    reject_for_kind(kind, "phase", kind == Kind::Discrete)?;
    check_range("phase", phase, phase.is_finite(), "must be a finite angle in rad")
}

/// Checks an amplitude: zero is rest.
pub(crate) fn check_amplitude(value: f64) -> Result<()> {
    let valid = (0.0..=crate::validate::MAX_MAGNITUDE).contains(&value);
    check_range("amplitude", value, valid, "must lie between 0, which is rest, and 1e150")
}
