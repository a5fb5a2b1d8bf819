//! Snapshots: the state of a controller as numbers, from which it continues to the bit.
//!
//! One function, `walk`, visits every number of the state; it serves for saving and for restoring. Quantities that follow
//! from the primitive, the tick length and the transition are computed again, and so are cached solutions over a tick.

use std::f64::consts::TAU;
use std::sync::Arc;

use super::group::Gate;
use super::turning::walk_turning;
use super::{Controller, Status};
use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::dynamics::command_filter::FilterStep;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::{Conditions, MAX_STYLE_MAGNITUDE, ResolvedConditions, check_tau, reject_goal_velocity};
use crate::model::primitive::Primitive;
use crate::motion::perturbation::MAX_PHASE_RATE;
use crate::numerics::rotation::{Quaternion, dot};
use crate::numerics::simd::F64x4;
use crate::numerics::state::{Visitor, visit_flag, visit_number};
use crate::validate::MAX_MAGNITUDE;

/// Version of the snapshot; a change of `walk` increments it.
const VERSION: f64 = 3.0;
/// Length of the header: version, numbers of the primitive, tick length and transition.
const HEADER: usize = 10;
/// Bounds of a quantity in units of a DoF. Its products with every gain and rate stay finite.
const QUANTITY: [f64; 2] = [-1e200, 1e200];
/// Bounds of a time, finite under any further tick.
const TIME: [f64; 2] = [0.0, 1e300];
/// Maximum clock of a discrete movement, relative to its extent; a transition from there still has a length.
const MAX_CLOCK: f64 = 1e9;
/// Maximum error of the square of a quaternion's norm, far above rounding.
const MAX_NORM_ERROR: f64 = 1e-9;
/// Maximum rate, relative to the nominal one: the product of the largest speed and the largest 1/τ, with a margin for rounding.
const MAX_RATE: f64 = 1.001e12;

impl Controller {
    /// Returns the state as numbers, from which [`Controller::restore`] continues the movement to the bit.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
    /// controller.step()?;
    /// let mut restored = Controller::restore(model.primitive(), &controller.snapshot())?;
    /// controller.step()?;
    /// restored.step()?;
    /// assert_eq!(restored.position(), controller.position());
    /// # Ok(())
    /// # }
    /// ```
    pub fn snapshot(&self) -> Vec<f64> {
        let mut numbers = header(&self.primitive).to_vec();
        numbers.extend([self.dt, self.transition]);
        let saved = self.clone().walk(&mut |quantity, _| {
            numbers.extend_from_slice(quantity);
            Ok(())
        });
        debug_assert!(saved.is_ok(), "saving refuses no number");
        numbers
    }

    /// Returns a controller in the state of a [`Controller::snapshot`], for the primitive of the snapshot.
    ///
    /// # Errors
    /// A snapshot of another version, primitive or length, or with a number that is not finite or that no state has.
    pub fn restore(primitive: &Arc<Primitive>, snapshot: &[f64]) -> Result<Self> {
        let length =
            |expected| Error::Length { name: "snapshot", expected, found: snapshot.len(), per: "number of the state" };
        let Some((head, mut rest)) = snapshot.split_at_checked(HEADER) else { return Err(length(HEADER)) };
        if head[0] != VERSION {
            return Err(Error::Range { name: "snapshot version", value: head[0], allowed: "must be 3" });
        }
        if head[..HEADER - 2] != header(primitive) {
            return Err(unsuitable("belongs to another model: restore it with the model of its controller"));
        }
        let mut controller = Self::new(primitive, head[HEADER - 2], &Conditions::default(), Some(head[HEADER - 1]))?;
        let mut expected = HEADER;
        controller.walk(&mut |quantity, [least, greatest]| {
            expected += quantity.len();
            let (saved, remaining) = rest.split_at_checked(quantity.len()).ok_or_else(|| length(expected))?;
            if let Some(index) = saved.iter().position(|number| !(least..=greatest).contains(number)) {
                let (value, index) = (saved[index], snapshot.len() - rest.len() + index);
                return Err(match value.is_finite() {
                    true => {
                        Error::Range { name: "snapshot", value, allowed: "no state of a controller has this number" }
                    }
                    false => Error::NotFinite { name: "snapshot", index, value },
                });
            }
            quantity.copy_from_slice(saved);
            rest = remaining;
            Ok(())
        })?;
        if !rest.is_empty() {
            return Err(length(expected));
        }
        controller.check_restored()?;
        controller.publish_centre(None);
        Ok(controller)
    }

    /// Visits every number of the state, in the order of the snapshot.
    fn walk(&mut self, visit: &mut Visitor) -> Result<()> {
        self.walk_motion(visit)?;
        self.walk_governor(visit)
    }

    /// Visits every number of the state without the governor.
    pub(super) fn walk_motion(&mut self, visit: &mut Visitor) -> Result<()> {
        // The pattern names every field, so that a new one is saved or listed as derived.
        let Self {
            primitive,
            conditions,
            started,
            status,
            time,
            clock,
            r,
            command_gains,
            style,
            rate_gains,
            rate,
            centre,
            goal_transition,
            approaching,
            arrival_slope,
            amplitude,
            max_tau,
            speed,
            tolerance,
            groups,
            forcing_phase_rate,
            frame_lag,
            transport_segment,
            position,
            velocity,
            acceleration,
            perturbation,
            limiter,
            governor: _,
            idle_governor: _,
            rate_slope: _,
            phase_gain,
            command_step,
            min_durations: _,
            dt,
            transition: _,
            flush_level: _,
            max_clock_step: _,
            rate_step: _,
            propagator: _,
            series: _,
            prefetch_ticks: _,
            pose,
        } = self;
        let (turn, n_dofs) = (TAU.next_down(), primitive.n_dofs());
        let rhythmic = primitive.kind() == Kind::Rhythmic;
        let distance = if rhythmic { 0.0 } else { 2.0 * MAX_MAGNITUDE };
        let clocks = [0.0, if rhythmic { turn } else { MAX_CLOCK * primitive.canonical().extent() }];

        let ResolvedConditions {
            style: s,
            centre: g,
            start,
            velocity: v,
            drift,
            goal_velocity,
            has_goal_velocity,
            amplitude: r_0,
            tau,
            phase: phi,
            forcing,
        } = conditions;
        visit(s, [-MAX_STYLE_MAGNITUDE, MAX_STYLE_MAGNITUDE])?;
        visit(g, [-MAX_MAGNITUDE, MAX_MAGNITUDE])?;
        visit_optional(visit, start, n_dofs)?;
        visit_optional(visit, v, n_dofs)?;
        if primitive.coordinates().is_some() {
            visit_optional(visit, drift, n_dofs)?;
        }
        visit(goal_velocity, [-MAX_MAGNITUDE, MAX_MAGNITUDE])?;
        visit_flag(visit, has_goal_velocity)?;
        visit_number(visit, r_0, [0.0, MAX_MAGNITUDE])?;
        visit_number(visit, tau, [f64::MIN_POSITIVE, f64::MAX])?;
        visit_number(visit, phi, [0.0, turn])?;
        walk_forcing(visit, forcing, primitive)?;

        visit_flag(visit, started)?;
        let mut finished = *status == Status::Finished;
        visit_flag(visit, &mut finished)?;
        *status = if finished { Status::Finished } else { Status::Working };
        time.walk(visit, TIME)?;
        clock.walk(visit, clocks)?;
        visit_number(visit, r, [0.0, MAX_MAGNITUDE])?;
        visit_number(visit, speed, [0.0, f64::INFINITY])?;
        visit_number(visit, tolerance, [f64::MIN_POSITIVE, 1.0])?;
        visit_number(visit, phase_gain, [0.0, super::phase::MAX_PHASE_GAIN])?;

        style.walk(visit, command_gains, [-MAX_STYLE_MAGNITUDE, MAX_STYLE_MAGNITUDE])?;
        rate.walk(visit, rate_gains, [0.0, MAX_RATE / primitive.tau()])?;
        centre.walk(visit, command_gains, [-MAX_MAGNITUDE, MAX_MAGNITUDE])?;
        goal_transition.walk(visit, clocks, QUANTITY)?;
        visit_flag(visit, approaching)?;
        amplitude.walk(visit, command_gains, [0.0, MAX_MAGNITUDE])?;

        visit_number(visit, forcing_phase_rate, [0.0, MAX_PHASE_RATE])?;
        visit_number(visit, frame_lag, [-2.0, 2.0])?;
        let mut cell = primitive.transport.cell(transport_segment) as f64;
        visit_number(visit, &mut cell, [0.0, 1e6])?;
        *transport_segment = primitive.transport.segment_of_cell(cell as usize);

        groups.iter_mut().try_for_each(|group| group.walk(visit, QUANTITY, distance))?;
        visit_number(visit, max_tau, [f64::MIN_POSITIVE, f64::MAX])?;
        for lanes in [position, velocity, acceleration, arrival_slope] {
            visit(bytemuck::cast_slice_mut::<F64x4, f64>(lanes), QUANTITY)?;
        }
        perturbation.walk(visit, QUANTITY)?;
        limiter.walk(visit, QUANTITY, primitive.duration(), *dt)?;
        *command_step = FilterStep::IDENTITY;
        if let Some(pose) = pose {
            // The sign of a quaternion depends on the past, and so does a motion that limits have changed.
            visit(&mut pose.position, QUANTITY)?;
            visit(&mut pose.velocity, QUANTITY)?;
            visit(&mut pose.acceleration, QUANTITY)?;
            pose.turns.iter_mut().try_for_each(|turn| walk_turning(visit, turn, QUANTITY))?;
            visit(&mut pose.goal_velocity, [-MAX_MAGNITUDE, MAX_MAGNITUDE])?;
        }
        Ok(())
    }

    /// Checks quantities that depend on several numbers of a snapshot.
    fn check_restored(&self) -> Result<()> {
        check_tau(self.conditions.tau, self.primitive.tau())?;
        check_tau(self.max_tau, self.primitive.tau())?;
        let unit = |q: &Quaternion| (dot(*q, *q) - 1.0).abs() < MAX_NORM_ERROR;
        if let (Some(pose), Some(coordinates)) = (&self.pose, self.primitive.coordinates()) {
            coordinates.check("snapshot", &pose.position)?;
            let turns = pose.turns.iter().chain(self.limiter.turns.iter().map(|turn| &turn.before));
            if !turns.map(|turn| &turn.rotation).all(unit) {
                return Err(unsuitable("describes no state: the quaternion of a rotation has another norm than 1"));
            }
        }
        reject_goal_velocity(&self.primitive, self.conditions.has_goal_velocity)?;
        if self.goal_transition.is_active() && !self.has_frame() {
            return Err(unsuitable("describes no state: a transition of the goal needs learnt transport"));
        }
        if self.status == Status::Finished && self.primitive.kind() == Kind::Rhythmic {
            return Err(unsuitable("describes no state: a rhythmic movement never finishes"));
        }
        // The next tick may have any phase rate.
        let gate = Gate { phase_rate: MAX_PHASE_RATE, ..self.gate() };
        let at_once = !self.started || self.command_gains.is_immediate();
        // The rate is in transition then, too, after limits along the path.
        if at_once && [&self.style, &self.amplitude].iter().any(|command| command.value() != command.target()) {
            return Err(unsuitable("describes no state: a command that takes effect at once is in transition"));
        }
        let forcing = self.groups.iter().map(|group| gate.forcing::<F64x4>(&group.forcing));
        let bounded = |lanes: F64x4| lanes.to_array().iter().all(|x| (QUANTITY[0]..=QUANTITY[1]).contains(x));
        if forcing.flat_map(|w| [w.value, w.slope]).all(bounded) {
            return Ok(());
        }
        Err(unsuitable("describes no state: its style and amplitude make the forcing overflow"))
    }
}

/// Returns the numbers that identify the version and the primitive of a snapshot.
fn header(primitive: &Primitive) -> [f64; HEADER - 2] {
    let (attractor, kind) = (primitive.attractor(), primitive.kind());
    [
        VERSION,
        f64::from(u8::from(kind == Kind::Rhythmic)),
        primitive.n_dofs() as f64,
        primitive.n_styles() as f64,
        primitive.tau(),
        primitive.canonical().extent(),
        attractor.alpha_z,
        attractor.beta_z,
    ]
}

/// Returns the error of a snapshot with the given problem.
fn unsuitable(problem: &'static str) -> Error {
    Error::Argument { name: "snapshot", problem }
}

/// Visits an additional forcing that may be absent, as the number of its numbers and these.
fn walk_forcing(
    visit: &mut Visitor,
    forcing: &mut Option<Arc<AdditionalForcing>>,
    primitive: &Primitive,
) -> Result<()> {
    let mut numbers = forcing.as_ref().map(|forcing| forcing.to_numbers()).unwrap_or_default();
    let mut count = numbers.len() as f64;
    visit_number(visit, &mut count, [0.0, AdditionalForcing::max_numbers(primitive.n_dofs()) as f64])?;
    numbers.resize(count as usize, 0.0);
    visit(&mut numbers, [-MAX_MAGNITUDE, MAX_MAGNITUDE])?;
    *forcing = None;
    if !numbers.is_empty() {
        let restored = AdditionalForcing::from_numbers(&numbers)?;
        restored.check(primitive.canonical(), primitive.n_dofs())?;
        *forcing = Some(Arc::new(restored));
    }
    Ok(())
}

/// Visits a vector that may be absent, as a flag and `n` numbers.
fn visit_optional(visit: &mut Visitor, vector: &mut Option<Vec<f64>>, n: usize) -> Result<()> {
    let mut present = vector.is_some();
    visit_flag(visit, &mut present)?;
    let mut numbers = vector.take().unwrap_or_else(|| vec![0.0; n]);
    visit(&mut numbers, [-MAX_MAGNITUDE, MAX_MAGNITUDE])?;
    *vector = present.then_some(numbers);
    Ok(())
}
