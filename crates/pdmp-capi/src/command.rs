//! Conditions, commands and motions: the core's structs in the layout of C.

use std::ptr;

use pdmp_core::motion::Coupling;
use pdmp_core::{Command, Conditions, Controller, Primitive};

use crate::buffers::{pdmp_buffer, pdmp_vector};
use crate::fault::Fault;
use crate::passage::pdmp_passage;

/// Conditions of a movement. A member that is `{NULL, 0}` or NULL takes the value of the nominal demonstration.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_conditions {
    /// Style parameter s (n_styles).
    pub style: pdmp_vector,
    /// Goal g (n_coordinates), in the unit of each DoF; discrete models only.
    pub goal: pdmp_vector,
    /// Anchor y_a (n_coordinates), in the unit of each DoF; rhythmic models only.
    pub anchor: pdmp_vector,
    /// Start position y_0 (n_coordinates), in the unit of each DoF. A rhythmic movement starts on its limit cycle by default.
    pub start: pdmp_vector,
    /// Start velocity (n_dofs), in the unit of each DoF per second; that of the demonstrations by default.
    pub velocity: pdmp_vector,
    /// Final velocity (n_dofs) at the goal, in the unit of each DoF per second; that of the demonstrations by default;
    /// discrete models with learnt transport only.
    pub goal_velocity: pdmp_vector,
    /// Amplitude r_0 >= 0; 1 by default, the only value that a discrete model accepts.
    pub amplitude: *const f64,
    /// Time constant tau > 0, in seconds.
    pub tau: *const f64,
    /// Phase phi, in rad, at which the movement starts on its limit cycle; 0 by default; rhythmic models only.
    pub phase: *const f64,
    /// Additional forcing of a movement through points, see pdmp_model_through; none by default.
    pub forcing: *const pdmp_passage,
}

/// Coupling terms, constant over a tick; both or neither.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_coupling {
    /// c_v (n_dofs), added to the velocity, in the unit of each DoF per second.
    pub velocity: pdmp_vector,
    /// c_a (n_dofs), added to the acceleration, in the unit of each DoF per second squared.
    pub acceleration: pdmp_vector,
}

/// Command of one tick. A member that is `{NULL, 0}` or NULL leaves the present value unchanged.
///
/// Style, goal, final velocity, anchor, tau and amplitude stay in force until the next command, and a measurement until
/// the next one or until pdmp_controller_release. dt, the coupling terms and the phase hold for this tick only.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_command {
    /// Style parameter s (n_styles).
    pub style: pdmp_vector,
    /// Goal g (n_coordinates), in the unit of each DoF; discrete models only.
    pub goal: pdmp_vector,
    /// Final velocity (n_dofs) at the goal, in the unit of each DoF per second; discrete models with learnt transport
    /// only.
    pub goal_velocity: pdmp_vector,
    /// Anchor y_a (n_coordinates), in the unit of each DoF; rhythmic models only.
    pub anchor: pdmp_vector,
    /// Time constant tau > 0, in seconds.
    pub tau: *const f64,
    /// Amplitude r_0 >= 0; rhythmic models only.
    pub amplitude: *const f64,
    /// Length of this tick, in seconds, at least 0; pdmp_settings.dt by default.
    pub dt: *const f64,
    /// Measured position of the robot (n_coordinates), in the unit of each DoF; not given if there is no new measurement.
    pub measured: pdmp_vector,
    /// Coupling terms.
    pub coupling: pdmp_coupling,
    /// Measured phase, in rad, which pulls the phase, see pdmp_controller_set_phase_gain; rhythmic models only.
    pub phase: *const f64,
}

/// Outputs of a motion. A member that is `{NULL, 0}` is not written. The buffers may overlap with the arrays of the
/// command.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_motion {
    /// Position y (n_coordinates), in the unit of each DoF.
    pub position: pdmp_buffer,
    /// Velocity (n_dofs), in the unit of each DoF per second.
    pub velocity: pdmp_buffer,
    /// Acceleration (n_dofs), in the unit of each DoF per second squared.
    pub acceleration: pdmp_buffer,
}

/// Returns the owner of an element of a position, in an error text.
pub(crate) fn per_coordinate(primitive: &Primitive) -> &'static str {
    if primitive.coordinates().is_some() { "coordinate" } else { "DoF" }
}

impl pdmp_conditions {
    /// Returns the conditions as the core takes them.
    ///
    /// # Safety
    /// Every pointer is NULL or valid for reads, a vector's over its length.
    pub(crate) unsafe fn get(&self, primitive: &Primitive) -> Result<Conditions, Fault> {
        // SAFETY: this function has the same contract for every vector.
        let owned = |name, vector: pdmp_vector, expected, per| unsafe {
            vector.get(name, expected, per).map(|numbers| numbers.map(<[f64]>::to_vec))
        };
        let per_dof = |name, vector| owned(name, vector, primitive.n_dofs(), "DoF");
        let position = |name, vector| owned(name, vector, primitive.n_coordinates(), per_coordinate(primitive));
        Ok(Conditions {
            style: owned("style", self.style, primitive.n_styles(), "style dimension")?,
            goal: position("goal", self.goal)?,
            anchor: position("anchor", self.anchor)?,
            start: position("start", self.start)?,
            velocity: per_dof("velocity", self.velocity)?,
            goal_velocity: per_dof("goal_velocity", self.goal_velocity)?,
            // SAFETY: the caller guarantees that the pointer is NULL or valid.
            amplitude: unsafe { self.amplitude.as_ref() }.copied(),
            // SAFETY: the caller guarantees that the pointer is NULL or valid.
            tau: unsafe { self.tau.as_ref() }.copied(),
            segment_durations: None,
            // SAFETY: the caller guarantees that the pointer is NULL or valid.
            phase: unsafe { self.phase.as_ref() }.copied(),
            // SAFETY: the caller guarantees that the pointer is NULL or valid.
            forcing: unsafe { self.forcing.as_ref() }.and_then(|passage| passage.inner.conditions.forcing.clone()),
        })
    }

    /// Returns pointers to the numbers of the conditions; durations of segments have none.
    pub(crate) fn view(conditions: &Conditions) -> Self {
        let vector = |vector: &Option<Vec<f64>>| vector.as_deref().map_or(pdmp_vector::NONE, pdmp_vector::of);
        let number = |number: &Option<f64>| number.as_ref().map_or(ptr::null(), ptr::from_ref);
        Self {
            style: vector(&conditions.style),
            goal: vector(&conditions.goal),
            anchor: vector(&conditions.anchor),
            start: vector(&conditions.start),
            velocity: vector(&conditions.velocity),
            goal_velocity: vector(&conditions.goal_velocity),
            amplitude: number(&conditions.amplitude),
            tau: number(&conditions.tau),
            phase: number(&conditions.phase),
            forcing: ptr::null(),
        }
    }

    /// Copies the numbers of the conditions to `storage`, one vector after the other, and returns pointers to them.
    ///
    /// # Safety
    /// `storage` is valid for writes of all numbers.
    pub(crate) unsafe fn store(conditions: &Conditions, storage: *mut f64) -> Self {
        let mut next = storage;
        let mut append = |vector: &[f64]| {
            let (data, length) = (next, vector.len());
            // SAFETY: the caller guarantees that this vector and the remaining ones fit.
            unsafe { data.copy_from_nonoverlapping(vector.as_ptr(), length) };
            // SAFETY: the result lies within `storage` or one past its end.
            next = unsafe { data.add(length) };
            pdmp_vector { data, length }
        };
        let mut optional = |vector: &Option<Vec<f64>>| vector.as_deref().map_or(pdmp_vector::NONE, &mut append);
        Self {
            style: optional(&conditions.style),
            goal: optional(&conditions.goal),
            anchor: optional(&conditions.anchor),
            start: optional(&conditions.start),
            velocity: optional(&conditions.velocity),
            goal_velocity: optional(&conditions.goal_velocity),
            amplitude: ptr::null(),
            tau: conditions.tau.map_or(ptr::null(), |tau| append(&[tau]).data),
            phase: ptr::null(),
            forcing: ptr::null(),
        }
    }
}

impl pdmp_command {
    /// Returns the command as the core takes it.
    ///
    /// # Safety
    /// Every pointer is NULL or valid for reads, a vector's over its length, for the lifetime of the result.
    pub(crate) unsafe fn get(&self, primitive: &Primitive) -> Result<Command<'_>, Fault> {
        // SAFETY: this function has the same contract for every vector.
        let vector = |name, vector: pdmp_vector, expected, per| unsafe { vector.get(name, expected, per) };
        let per_dof = |name, numbers| vector(name, numbers, primitive.n_dofs(), "DoF");
        let position = |name, numbers| vector(name, numbers, primitive.n_coordinates(), per_coordinate(primitive));
        let coupling = match (
            per_dof("coupling velocity", self.coupling.velocity)?,
            per_dof("coupling acceleration", self.coupling.acceleration)?,
        ) {
            (Some(velocity), Some(acceleration)) => Some(Coupling { velocity, acceleration }),
            (None, None) => None,
            (None, Some(_)) => return Err(Fault::Null("coupling velocity")),
            (Some(_), None) => return Err(Fault::Null("coupling acceleration")),
        };
        // SAFETY: the caller guarantees that the pointer is NULL or valid.
        let [dt, tau, amplitude, phase] =
            [self.dt, self.tau, self.amplitude, self.phase].map(|number| unsafe { number.as_ref() }.copied());
        Ok(Command {
            dt,
            style: vector("style", self.style, primitive.n_styles(), "style dimension")?,
            goal: position("goal", self.goal)?,
            goal_velocity: per_dof("goal_velocity", self.goal_velocity)?,
            anchor: position("anchor", self.anchor)?,
            tau,
            amplitude,
            measured: position("measured", self.measured)?,
            coupling,
            phase,
        })
    }
}

impl pdmp_motion {
    /// Checks that each given buffer holds at least one number per coordinate or DoF.
    pub(crate) fn check(&self, primitive: &Primitive) -> Result<(), Fault> {
        self.check_rows(primitive, 1, [per_coordinate(primitive), "DoF"])
    }

    /// Checks that each given buffer holds `n` rows of at least one number per coordinate or DoF, as `per` names them.
    pub(crate) fn check_rows(&self, primitive: &Primitive, n: usize, per: [&'static str; 2]) -> Result<(), Fault> {
        let [n_coordinates, n_dofs] = [primitive.n_coordinates(), primitive.n_dofs()].map(|row| n.saturating_mul(row));
        self.position.check("position", n_coordinates, per[0])?;
        self.velocity.check("velocity", n_dofs, per[1])?;
        self.acceleration.check("acceleration", n_dofs, per[1])
    }

    /// Writes the present motion of a controller.
    ///
    /// # Safety
    /// Every pointer is NULL or valid for writes of one number per coordinate or DoF.
    pub(crate) unsafe fn write(&self, controller: &Controller) {
        // SAFETY: this function has the same contract, and a controller's arrays are its own.
        unsafe {
            self.position.write(controller.position());
            self.velocity.write(controller.velocity());
            self.acceleration.write(controller.acceleration());
        }
    }
}
