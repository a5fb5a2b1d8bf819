//! Limits of a robot in the control loop.

use pdmp_core::Error;
use pdmp_core::motion::{Limit, Limits};

use crate::buffers::pdmp_vector;
use crate::controller::{call_on, pdmp_controller};
use crate::fault::Fault;
use crate::status::pdmp_status;

/// Limits of position, velocity, acceleration and jerk. Each member is one number for all DoFs or n_dofs numbers; `{NULL, 0}` and
/// infinity are no limit. The three DoFs of a rotation have equal limits, in rad/s and rad/s^2, of the sizes of its angular velocity
/// and acceleration, which depend on no frame; its position and jerk have none.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_limits {
    /// Lower limits of the position (1) or (n_dofs), in the unit of each DoF; below the upper ones.
    pub lower: pdmp_vector,
    /// Upper limits of the position (1) or (n_dofs), in the unit of each DoF.
    pub upper: pdmp_vector,
    /// Limits of |y'| (1) or (n_dofs), in the unit of each DoF per second; positive.
    pub velocity: pdmp_vector,
    /// Limits of |y''| (1) or (n_dofs), in the unit of each DoF per second squared; positive.
    pub acceleration: pdmp_vector,
    /// Limits of |y'''| (1) or (n_dofs), in the unit of each DoF per second cubed; positive, for DoFs with a limit of the
    /// acceleration.
    pub jerk: pdmp_vector,
    /// 0, the default: what one DoF cannot follow slows all of them along the path, and only then single ones are limited.
    /// Otherwise every DoF is limited on its own.
    pub independent: std::ffi::c_int,
}

/// Limit that determines the acceleration of a DoF.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum pdmp_limit {
    /// None: the DoF is free.
    PDMP_LIMIT_NONE = 0,
    /// The lower or upper limit of the position: the DoF brakes in front of it, or rests on it.
    PDMP_LIMIT_POSITION = 1,
    /// The limit of the velocity.
    PDMP_LIMIT_VELOCITY = 2,
    /// The limit of the acceleration.
    PDMP_LIMIT_ACCELERATION = 3,
    /// The limit of the jerk.
    PDMP_LIMIT_JERK = 4,
}

use pdmp_limit::*;

impl From<Option<Limit>> for pdmp_limit {
    fn from(limit: Option<Limit>) -> Self {
        match limit {
            None => PDMP_LIMIT_NONE,
            Some(Limit::Position) => PDMP_LIMIT_POSITION,
            Some(Limit::Velocity) => PDMP_LIMIT_VELOCITY,
            Some(Limit::Acceleration) => PDMP_LIMIT_ACCELERATION,
            Some(Limit::Jerk) => PDMP_LIMIT_JERK,
        }
    }
}

impl pdmp_limits {
    /// No limits.
    const NONE: Self = {
        let none = pdmp_vector { data: std::ptr::null(), length: 0 };
        Self { lower: none, upper: none, velocity: none, acceleration: none, jerk: none, independent: 0 }
    };

    /// Writes the limits to those that the core takes, without allocation.
    ///
    /// # Safety
    /// Every pointer is NULL or valid for reads over its length.
    unsafe fn write(&self, limits: &mut Limits, n_dofs: usize) -> Result<(), Fault> {
        let infinity = f64::INFINITY;
        let members = [
            ("lower", self.lower, &mut limits.lower, -infinity),
            ("upper", self.upper, &mut limits.upper, infinity),
            ("velocity", self.velocity, &mut limits.velocity, infinity),
            ("acceleration", self.acceleration, &mut limits.acceleration, infinity),
            ("jerk", self.jerk, &mut limits.jerk, infinity),
        ];
        limits.synchronous = self.independent == 0;
        for (name, vector, written, none) in members {
            let expected = if vector.length == 1 { 1 } else { n_dofs };
            // SAFETY: this function has the same contract.
            let numbers = unsafe { vector.get(name, expected, "DoF") }?;
            let written = written.get_or_insert_default();
            written.clear();
            written.extend_from_slice(numbers.unwrap_or(&[none]));
        }
        Ok(())
    }
}

/// Returns memory for the limits of each DoF.
pub(crate) fn memory_of_limits(n_dofs: usize) -> Limits {
    let memory = || Some(Vec::with_capacity(n_dofs.max(1)));
    Limits {
        lower: memory(),
        upper: memory(),
        velocity: memory(),
        acceleration: memory(),
        jerk: memory(),
        ..Limits::default()
    }
}

/// Sets the limits of the robot; NULL removes them.
///
/// From then on every tick keeps them, for any commands, measurements, coupling terms and tick lengths: at its end
/// lower <= y <= upper, |y'| <= velocity, |y''| <= acceleration, and |change of y'| <= dt acceleration; between its ends
/// lower <= y <= upper on the cubic through position and velocity at both, by which a robot interpolates. The mean
/// velocity of a tick is within its limit, too. A DoF brakes with the limit of the acceleration, or with velocity / (2 dt) or
/// (upper - lower) / dt^2 for the default tick if that is less. A longer tick is limited in parts of constant acceleration, and
/// is no single cubic. A motion inside the limits is not changed. With a limit of the jerk, the change of y'' is at most dt jerk, the DoF can always stop inside, and the
/// cubic may pass the limit by dt^3 jerk / 150 where it comes to rest within a tick. A goal or anchor outside is moved to the limit, where a movement is finished as at any goal. A
/// movement outside, after limits that shrink or at a start outside, brakes with the limit of the acceleration and
/// returns at the limit of the velocity or below. The angular velocity of a rotation changes by at most dt acceleration in
/// the frame of the tool and in that of the world, and it turns by at most dt velocity. The
/// limits stay in force after pdmp_controller_reset.
///
/// This function allocates the first time, unless every DoF is limited on its own. Errors: PDMP_NULL, PDMP_LENGTH; PDMP_RANGE. The
/// present limits then stay in force.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_set_limits(
    controller: Option<&mut pdmp_controller>,
    limits: Option<&pdmp_limits>,
) -> pdmp_status {
    call_on(controller, |controller| {
        let n_dofs = controller.inner.primitive().n_dofs();
        // SAFETY: the contract of the C ABI covers the pointers of this argument.
        unsafe { limits.unwrap_or(&pdmp_limits::NONE).write(&mut controller.limits, n_dofs) }?;
        controller.inner.set_limits(&controller.limits)?;
        Ok(pdmp_status::PDMP_OK)
    })
}

/// Writes for each DoF the limit that determined its acceleration in the last tick. `limited` has `length` >= n_dofs
/// elements; those beyond n_dofs keep their value. Returns PDMP_WORKING, PDMP_FINISHED or an error: PDMP_NULL, PDMP_LENGTH.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_limited(
    controller: Option<&mut pdmp_controller>,
    limited: *mut pdmp_limit,
    length: usize,
) -> pdmp_status {
    call_on(controller, |controller| {
        let limits = controller.inner.limited();
        if limited.is_null() {
            return Err(Fault::Null("limited"));
        }
        if length < limits.len() {
            let (expected, found) = (limits.len(), length);
            return Err(Error::Length { name: "limited", expected, found, per: "DoF" }.into());
        }
        for (dof, limit) in limits.iter().enumerate() {
            // SAFETY: the contract of the C ABI guarantees `length` writable elements, and there are no more limits.
            unsafe { limited.add(dof).write((*limit).into()) };
        }
        Ok(controller.inner.status().into())
    })
}
