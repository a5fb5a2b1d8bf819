//! Future of a movement under its present commands.

use super::Controller;
use crate::error::Result;
use crate::motion::command::Command;
use crate::motion::trajectory::{Trajectory, step_count};

impl Controller {
    /// Computes the motion over the next `horizon` seconds under the present commands: n + 1 samples at 0, dt, …, n·dt from
    /// now, the first being the present motion. The controller is not changed.
    ///
    /// `dt` is the length of a tick, by default [`Controller::dt`]; with the ticks of the loop, the samples are those of the
    /// loop to the bit. Commands in transition continue, and a measured position remains in force, as its error, as in
    /// [`Controller::update`]; coupling terms and a measured phase, which apply to one tick, do not. Ticks are exact for any
    /// length, so that a coarse `dt` is as accurate as a fine one, except for a measured position, whose terms are
    /// constant over a tick.
    ///
    /// This function allocates. A real-time thread copies the controller by `clone_from`, which reuses the memory of its
    /// destination, and advances the copy:
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
    /// let mut ahead = controller.clone();
    /// controller.set_goal(&[1.2, 0.1])?;
    /// controller.step()?;
    ///
    /// ahead.clone_from(&controller);
    /// (0..500).try_for_each(|_| ahead.step().map(drop))?;
    /// let forecast = controller.forecast(0.5, None)?;
    /// assert_eq!(forecast.position.row(500).as_slice(), Some(ahead.position()));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A horizon that is negative or not finite, a `dt` that is not positive or longer than 1000 τ, more than 1e7 samples, or
    /// a trajectory that does not fit into memory.
    pub fn forecast(&self, horizon: f64, dt: Option<f64>) -> Result<Trajectory> {
        self.forecast_with(horizon, dt, &mut |_| Ok(()))
    }

    /// Computes a [`Controller::forecast`] and reports progress as [`crate::motion::rollout_with`] does.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, Error, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let controller = Controller::new(model.primitive(), 0.01, &Conditions::default(), None)?;
    /// let cancelled = controller.forecast_with(0.5, None, &mut |_| Err(Error::Interrupted));
    /// assert!(matches!(cancelled, Err(Error::Interrupted)));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As for [`Controller::forecast`], or the error of `progress`.
    pub fn forecast_with(
        &self,
        horizon: f64,
        dt: Option<f64>,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Trajectory> {
        let dt = dt.unwrap_or(self.dt);
        let steps = step_count(Some("horizon"), horizon, dt)?;
        self.check_tick_length(dt, None)?;
        let mut controller = self.clone();
        let tick = Command { dt: Some(dt), ..Command::default() };
        Trajectory::record("forecast", &self.primitive, steps, dt, progress, |k, _, motion| {
            if k > 0 {
                controller.step_with(&tick)?;
            }
            controller.read(motion);
            Ok(())
        })
    }
}
