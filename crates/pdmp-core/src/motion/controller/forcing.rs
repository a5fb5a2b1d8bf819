//! Additional forcing of a movement under way.

use std::sync::Arc;

use super::{Controller, Status};
use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::dynamics::goal_transition::FrameSample;
use crate::error::Result;

impl Controller {
    /// Returns the additional forcing in force, if there is one.
    pub fn forcing(&self) -> Option<&Arc<AdditionalForcing>> {
        self.conditions.forcing.as_ref()
    }

    /// Adds an additional forcing to that in force.
    ///
    /// Position and velocity stay continuous, and the acceleration too if the forcing begins at the present clock or later
    /// ([`crate::inference::PassageOptions::from_phase`]). One that began earlier is joined as a goal that has moved: the
    /// distance decays with the output system. Before the first tick it acts from the start.
    ///
    /// Memory is allocated only if a forcing is in force already. Limits hold as for every other movement.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, fit};
    /// # use pdmp_core::inference::{At, PassageOptions, ViaPoint, through};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let conditions = model.conditions(&[0])?;
    /// let mut controller = Controller::new(model.primitive(), 0.01, &conditions, None)?;
    /// (0..20).try_for_each(|_| controller.step().map(drop))?;
    /// // From here on, the movement departs for a point.
    /// let points = [ViaPoint::new(At::Time(0.6), vec![0.6, 0.2])];
    /// let options = PassageOptions { from_phase: Some(controller.phase()), ..PassageOptions::default() };
    /// let passage = through(&model, &points, &conditions, &options)?;
    /// controller.add_forcing(&passage.forcing)?;
    /// (0..40).try_for_each(|_| controller.step().map(drop))?;
    /// assert!((controller.position()[1] - 0.2).abs() < 1e-6);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A forcing of another model, or more than eight of different beginnings. The movement then remains unchanged.
    pub fn add_forcing(&mut self, forcing: &Arc<AdditionalForcing>) -> Result<()> {
        forcing.check(self.primitive.canonical(), self.primitive.n_dofs())?;
        let sum = match &self.conditions.forcing {
            Some(present) => Arc::new(present.plus(forcing)?),
            None => Arc::clone(forcing),
        };
        if !self.started {
            self.conditions.forcing = Some(sum);
            self.begin();
            return Ok(());
        }
        // z takes up the velocity of the displacement.
        let phase_rate = self.perturbation.phase_rate();
        self.add_additional_slope(phase_rate);
        self.conditions.forcing = Some(sum);
        self.read_frame();
        self.add_additional_slope(-phase_rate);
        self.status = Status::Working;
        self.look_ahead();
        self.publish();
        Ok(())
    }

    /// Returns the displacement of a group by an additional forcing at the clock.
    pub(super) fn additional_frame(&self, index: usize) -> FrameSample {
        let forcing = self.conditions.forcing.as_deref();
        forcing.map_or_else(FrameSample::default, |forcing| forcing.sample(index, self.clock.value()))
    }

    /// Adds the velocity of an additional displacement at the clock, times a factor, to z of every group.
    pub(super) fn add_additional_slope(&mut self, factor: f64) {
        for index in 0..self.groups.len() {
            let slope = self.additional_frame(index).slope;
            self.groups[index].z += slope * factor;
        }
    }
}
