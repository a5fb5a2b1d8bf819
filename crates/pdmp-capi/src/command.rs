//! What a movement and a tick are told, and where the motion goes: the core's structs as C writes them.

use std::ptr;

use pdmp_core::motion::Coupling;
use pdmp_core::{Command, Conditions, Controller, Primitive};

use crate::buffers::{pdmp_buffer, pdmp_vector};
use crate::status::Fault;

/// What a movement starts with; what is not told is that of the nominal demonstration.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_conditions {
    /// Style s (n_styles).
    pub style: pdmp_vector,
    /// Goal g (n_dofs), discrete.
    pub goal: pdmp_vector,
    /// Anchor y_a (n_dofs), rhythmic.
    pub anchor: pdmp_vector,
    /// Start position (n_dofs); a rhythmic movement otherwise starts on its cycle.
    pub start: pdmp_vector,
    /// Start velocity (n_dofs), per second; otherwise that of the demonstrations.
    pub velocity: pdmp_vector,
    /// Amplitude r_0, rhythmic; otherwise 1.
    pub amplitude: *const f64,
    /// Time constant tau, in seconds.
    pub tau: *const f64,
    /// Phase phi at which a rhythmic movement starts, in rad, on its limit cycle; otherwise 0.
    pub phase: *const f64,
}

/// Terms of the user's own, constant over a tick: both or none.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_coupling {
    /// c_v (n_dofs), added to the velocity, per second.
    pub velocity: pdmp_vector,
    /// c_a (n_dofs), added to the acceleration, per second squared.
    pub acceleration: pdmp_vector,
}

/// All that one tick is told; what is not told stays as it was.
///
/// Style, goal, anchor, tau and amplitude stay in force until they are commanded again, measured until it is measured
/// again or pdmp_controller_release; dt and coupling hold for this tick alone.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_command {
    /// Style s (n_styles) to go to.
    pub style: pdmp_vector,
    /// Goal g (n_dofs) to go to, discrete.
    pub goal: pdmp_vector,
    /// Anchor y_a (n_dofs) to go to, rhythmic.
    pub anchor: pdmp_vector,
    /// Time constant tau to go to, in seconds.
    pub tau: *const f64,
    /// Amplitude r_0 to go to, rhythmic.
    pub amplitude: *const f64,
    /// Length of this tick, in seconds, if it differs from the controller's.
    pub dt: *const f64,
    /// Position (n_dofs) at which the robot is now, in the unit of each DoF; NULL if it was not measured anew.
    pub measured: pdmp_vector,
    /// The user's own terms.
    pub coupling: pdmp_coupling,
}

/// Where a motion is written, as far as it is wanted. It may overlap with what the tick is told.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_motion {
    /// Position y (n_dofs), in the unit of each DoF.
    pub position: pdmp_buffer,
    /// Velocity (n_dofs), per second.
    pub velocity: pdmp_buffer,
    /// Acceleration (n_dofs), per second squared.
    pub acceleration: pdmp_buffer,
}

impl pdmp_conditions {
    /// The conditions as the core takes them.
    ///
    /// # Safety
    /// Every pointer is NULL or valid, each vector's over its length.
    pub(crate) unsafe fn get(&self, primitive: &Primitive) -> Result<Conditions, Fault> {
        // SAFETY: the caller's promise is the same.
        let owned = |name, vector: pdmp_vector, expected, per| unsafe {
            vector.get(name, expected, per).map(|numbers| numbers.map(<[f64]>::to_vec))
        };
        let per_dof = |name, vector| owned(name, vector, primitive.n_dofs(), "DoF");
        Ok(Conditions {
            style: owned("style", self.style, primitive.n_styles(), "style dimension")?,
            goal: per_dof("goal", self.goal)?,
            anchor: per_dof("anchor", self.anchor)?,
            start: per_dof("start", self.start)?,
            velocity: per_dof("velocity", self.velocity)?,
            // SAFETY: NULL or valid.
            amplitude: unsafe { self.amplitude.as_ref() }.copied(),
            // SAFETY: NULL or valid.
            tau: unsafe { self.tau.as_ref() }.copied(),
            timing: None,
            // SAFETY: NULL or valid.
            phase: unsafe { self.phase.as_ref() }.copied(),
        })
    }

    /// Conditions whose numbers are laid down in `numbers`, one vector behind the other.
    ///
    /// # Safety
    /// `numbers` has room for all of them.
    pub(crate) unsafe fn put(conditions: &Conditions, numbers: *mut f64) -> Self {
        let mut next = numbers;
        let mut lay = |vector: &[f64]| {
            let (data, length) = (next, vector.len());
            // SAFETY: there is room for this vector and those that follow.
            unsafe { data.copy_from_nonoverlapping(vector.as_ptr(), length) };
            // SAFETY: at most one past the end.
            next = unsafe { data.add(length) };
            pdmp_vector { data, length }
        };
        let mut told = |vector: &Option<Vec<f64>>| vector.as_deref().map_or(pdmp_vector::NONE, &mut lay);
        Self {
            style: told(&conditions.style),
            goal: told(&conditions.goal),
            anchor: told(&conditions.anchor),
            start: told(&conditions.start),
            velocity: told(&conditions.velocity),
            amplitude: ptr::null(),
            tau: conditions.tau.map_or(ptr::null(), |tau| lay(&[tau]).data),
            phase: ptr::null(),
        }
    }
}

impl pdmp_command {
    /// The command as the core takes it.
    ///
    /// # Safety
    /// Every pointer is NULL or valid, each vector's over its length, for as long as the command.
    pub(crate) unsafe fn get(&self, primitive: &Primitive) -> Result<Command<'_>, Fault> {
        // SAFETY: the caller's promise is the same.
        let vector = |name, vector: pdmp_vector, expected, per| unsafe { vector.get(name, expected, per) };
        let per_dof = |name, told| vector(name, told, primitive.n_dofs(), "DoF");
        let coupling = match (
            per_dof("coupling velocity", self.coupling.velocity)?,
            per_dof("coupling acceleration", self.coupling.acceleration)?,
        ) {
            (Some(velocity), Some(acceleration)) => Some(Coupling { velocity, acceleration }),
            (None, None) => None,
            (None, Some(_)) => return Err(Fault::Null("coupling velocity")),
            (Some(_), None) => return Err(Fault::Null("coupling acceleration")),
        };
        // SAFETY: NULL or valid.
        let [dt, tau, amplitude] =
            [self.dt, self.tau, self.amplitude].map(|number| unsafe { number.as_ref() }.copied());
        Ok(Command {
            dt,
            style: vector("style", self.style, primitive.n_styles(), "style dimension")?,
            goal: per_dof("goal", self.goal)?,
            anchor: per_dof("anchor", self.anchor)?,
            tau,
            amplitude,
            measured: per_dof("measured", self.measured)?,
            coupling,
        })
    }
}

impl pdmp_motion {
    /// Checks that there is room for what is wanted.
    pub(crate) fn check(&self, n_dofs: usize) -> Result<(), Fault> {
        self.position.check("position", n_dofs, "DoF")?;
        self.velocity.check("velocity", n_dofs, "DoF")?;
        self.acceleration.check("acceleration", n_dofs, "DoF")
    }

    /// Writes where a controller is.
    ///
    /// # Safety
    /// Every pointer is NULL or has room for a number per DoF.
    pub(crate) unsafe fn put(&self, controller: &Controller) {
        // SAFETY: the caller's promise is the same.
        unsafe {
            self.position.put(controller.position());
            self.velocity.put(controller.velocity());
            self.acceleration.put(controller.acceleration());
        }
    }
}
