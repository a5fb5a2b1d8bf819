//! Sampled movements: rollouts of a model and forecasts of a controller.

use pdmp_core::motion::{TimeGrid, Trajectory};
use pdmp_core::{Error, Primitive, rollout};

use crate::buffers::pdmp_text;
use crate::command::{pdmp_conditions, pdmp_motion};
use crate::controller::{call_on, pdmp_controller};
use crate::fault::Fault;
use crate::guard::guard_with_text;
use crate::model::pdmp_model;
use crate::status::pdmp_status;

use pdmp_status::PDMP_OK;

/// Computes the movement under constant conditions at the times 0, dt, ..., (n_samples - 1) dt, in seconds. `conditions` may
/// be NULL: those of the nominal demonstration. The movement lasts pdmp_info.duration, or that times tau / pdmp_info.tau for
/// another tau.
///
/// The buffers of `motion` take n_samples rows, one after the other: n_samples * n_coordinates positions, and n_samples *
/// n_dofs velocities and accelerations.
///
/// This function allocates. Errors: PDMP_NULL, PDMP_LENGTH, PDMP_RANGE; PDMP_ABSENT if a condition does not apply to the kind
/// of model.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_model_rollout(
    model: Option<&pdmp_model>,
    conditions: Option<&pdmp_conditions>,
    dt: f64,
    n_samples: usize,
    motion: Option<&pdmp_motion>,
    error: pdmp_text,
) -> pdmp_status {
    let call = || {
        let model = &model.ok_or(Fault::Null("model"))?.inner;
        let motion = motion.ok_or(Fault::Null("motion"))?;
        motion.check_samples(model, n_samples)?;
        // SAFETY: the contract of the C ABI covers the pointers of this argument.
        let conditions = conditions.map(|conditions| unsafe { conditions.get(model) }).transpose()?.unwrap_or_default();
        let grid = TimeGrid { dt, duration: Some(duration(dt, n_samples)) };
        let trajectory = rollout(model.primitive(), &conditions, grid)?;
        // SAFETY: `check_samples` has checked the buffers, and the contract of the C ABI covers their pointers.
        unsafe { motion.write_samples(&trajectory) };
        Ok(PDMP_OK)
    };
    // SAFETY: the contract of the C ABI covers `error`.
    unsafe { guard_with_text(error, call) }
}

/// Computes the future of a movement under the present commands at the times 0, dt, ..., (n_samples - 1) dt from now, in
/// seconds, without disturbing it. The rows are those that ticks of `dt` seconds yield; the first one is the present motion.
///
/// The buffers of `motion` are as those of pdmp_model_rollout. This function allocates. Errors: PDMP_NULL, PDMP_LENGTH,
/// PDMP_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_forecast(
    controller: Option<&mut pdmp_controller>,
    dt: f64,
    n_samples: usize,
    motion: Option<&pdmp_motion>,
) -> pdmp_status {
    call_on(controller, |controller| {
        let motion = motion.ok_or(Fault::Null("motion"))?;
        motion.check_samples(controller.inner.primitive(), n_samples)?;
        let trajectory = controller.inner.forecast(duration(dt, n_samples), Some(dt))?;
        // SAFETY: `check_samples` has checked the buffers, and the contract of the C ABI covers their pointers.
        unsafe { motion.write_samples(&trajectory) };
        Ok(PDMP_OK)
    })
}

/// Returns the time of the last sample.
fn duration(dt: f64, n_samples: usize) -> f64 {
    dt * (n_samples - 1) as f64
}

impl pdmp_motion {
    /// Checks that there is a sample, and that each given buffer holds the numbers of every one.
    fn check_samples(&self, primitive: &Primitive, n_samples: usize) -> Result<(), Fault> {
        if n_samples == 0 {
            return Err(Error::Range { name: "n_samples", value: 0.0, allowed: "must be at least 1" }.into());
        }
        self.check_rows(primitive, n_samples, ["coordinate of each sample", "DoF of each sample"])
    }

    /// Writes the samples.
    ///
    /// # Safety
    /// Every pointer is NULL or valid for writes of the numbers of every sample.
    unsafe fn write_samples(&self, Trajectory { position, velocity, acceleration, .. }: &Trajectory) {
        let buffers = [self.position, self.velocity, self.acceleration];
        for (buffer, numbers) in buffers.into_iter().zip([position, velocity, acceleration]) {
            // SAFETY: this function has the same contract, and the arrays of a trajectory are its own.
            unsafe { buffer.write(numbers.as_slice().expect("a trajectory is contiguous")) };
        }
    }
}
