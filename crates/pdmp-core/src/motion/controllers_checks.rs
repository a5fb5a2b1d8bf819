//! Checks of the arguments of many movements.

use crate::error::Result;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::motion::commands::{Commands, Motions};
use crate::motion::controller::Controller;
use crate::motion::controllers::Controllers;
use crate::validate::{check_length, check_range, zeros};

impl Controllers {
    /// Checks that `n` movements with their conditions fit into memory, before these take a part of it.
    ///
    /// ```
    /// # use pdmp_core::motion::Controllers;
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// Controllers::check_memory(model.primitive(), 4096)?;
    /// assert!(Controllers::check_memory(model.primitive(), 1 << 50).is_err());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// More movements than fit.
    pub fn check_memory(primitive: &Primitive, n: usize) -> Result<()> {
        let (n_styles, n_dofs) = (primitive.n_styles(), primitive.n_dofs());
        // Styles have three filters and conditions have six vectors of the DoFs, controllers about thirty.
        let numbers =
            (size_of::<Controller>() + size_of::<Conditions>()) / size_of::<f64>() + 4 * n_styles + 36 * n_dofs;
        let allowed = "more movements than fit into memory: start fewer";
        check_range("n_movements", n as f64, zeros("movements", (n, numbers)).is_ok(), allowed)
    }

    /// Returns the first of the movements that `mask` (B,) selects, or of all, whose numbers among the commands
    /// [`Controllers::update`] rejects.
    pub fn first_rejected(&self, commands: &Commands, mask: Option<&[bool]>) -> Option<usize> {
        commands.check(self.len()).ok()?;
        let tick = |b: usize| self.controllers[b].check_tick_length(self.dt(), commands.of(b).tau);
        let rejects = |b: &usize| self.check_command(*b, commands).and_then(|()| tick(*b)).is_err();
        (0..self.len()).filter(|&b| mask.is_none_or(|mask| mask.get(b) == Some(&true))).find(rejects)
    }

    /// Checks the numbers of the command of one movement.
    pub(super) fn check_command(&self, b: usize, commands: &Commands) -> Result<()> {
        let controller = &self.controllers[b];
        commands.of(b).check(controller.primitive())?;
        commands.speed.map_or(Ok(()), |speed| controller.check_speed(speed[b]))
    }

    /// Checks the lengths of a mask and of outputs.
    pub(super) fn check(&self, mask: Option<&[bool]>, motions: &Motions) -> Result<()> {
        let (n, primitive) = (self.len(), self.primitive());
        if let Some(mask) = mask {
            check_length("mask", mask.len(), n, "movement")?;
        }
        let per_coordinate = "coordinate of each movement";
        check_length("position", motions.position.len(), n * primitive.n_coordinates(), per_coordinate)?;
        check_length("velocity", motions.velocity.len(), n * primitive.n_dofs(), "DoF of each movement")?;
        check_length("acceleration", motions.acceleration.len(), n * primitive.n_dofs(), "DoF of each movement")
    }

    pub(super) fn check_index(&self, b: usize) -> Result<()> {
        check_range("movement", b as f64, b < self.len(), "must be less than the number of movements")
    }
}
