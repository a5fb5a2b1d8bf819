//! Whole trajectories.
//!
//! A rollout is the control loop run at once. For constant style, goal and τ it is linear in the style,
//! y = y₀ + Σⱼ sⱼRⱼ, where Rⱼ is itself a rollout: that of the j-th unit style about a goal, start and velocity of zero.
//! A batch and the Jacobian with respect to the style follow from these J + 1 curves.

use std::sync::Arc;

use ndarray::{Array2, Array3, ArrayView2, Axis};

use crate::controller::Controller;
use crate::demo::{Trajectory, check_matrix, zeros};
use crate::error::{Error, Result, check_positive};
use crate::model::{Conditions, Model, check_style, check_tau};
use crate::phase::Kind;

/// Samples between two questions whether to go on.
const PORTION: usize = 4096;
/// Most samples of a rollout.
const MOST_STEPS: f64 = 1e7;

/// Times of a rollout, in seconds.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Interval between samples.
    pub dt: f64,
    /// Length of the rollout; otherwise the demonstrated duration scaled by τ, or one period.
    pub duration: Option<f64>,
}

impl Timing {
    /// Number of steps n = ⌊duration/dt·(1 + 1e-12) + 1e-9⌋: a whole multiple of dt keeps its last sample.
    fn steps(&self, model: &Model, conditions: &Conditions) -> Result<usize> {
        check_positive("dt", self.dt)?;
        let tau = conditions.tau.unwrap_or(model.tau);
        check_tau(tau, model.tau)?;
        let duration = match self.duration {
            Some(duration) if duration.is_finite() && duration >= 0.0 => duration,
            Some(value) => {
                return Err(Error::Range { name: "duration", value, allowed: "must be finite and not negative" });
            }
            None => model.duration() * tau / model.tau,
        };
        let steps = (duration / self.dt * (1.0 + 1e-12) + 1e-9).floor();
        if steps > MOST_STEPS {
            return Err(Error::Range {
                name: "dt",
                value: self.dt,
                allowed: "gives more than 1e7 samples: enlarge it",
            });
        }
        Ok(steps as usize)
    }
}

impl Model {
    /// The movement under constant conditions: n + 1 samples at t = 0, dt, …, start included.
    ///
    /// # Errors
    /// Conditions or times that do not fit the model.
    pub fn rollout(self: &Arc<Self>, conditions: &Conditions, timing: Timing) -> Result<Trajectory> {
        self.rollout_with(conditions, timing, &mut |_| Ok(()))
    }

    /// [`Model::rollout`] that can be stopped: `proceed` is told the share that is done.
    ///
    /// # Errors
    /// Conditions or times that do not fit the model, or whatever `proceed` returns.
    pub fn rollout_with(
        self: &Arc<Self>,
        conditions: &Conditions,
        timing: Timing,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Trajectory> {
        let steps = timing.steps(self, conditions)?;
        let mut controller = Controller::new(Arc::clone(self), timing.dt, conditions, Some(0.0))?;
        let shape = (steps + 1, self.n_dofs());
        let mut trajectory = Trajectory {
            time: (0..=steps).map(|k| k as f64 * timing.dt).collect(),
            position: zeros("rollout", shape)?,
            velocity: zeros("rollout", shape)?,
            acceleration: zeros("rollout", shape)?,
        };
        for k in 0..=steps {
            if k % PORTION == 0 {
                proceed(k as f64 / (steps + 1) as f64)?;
            }
            if k > 0 {
                controller.step()?;
            }
            for d in 0..self.n_dofs() {
                trajectory.position[[k, d]] = controller.position()[d];
                trajectory.velocity[[k, d]] = controller.velocity()[d];
                trajectory.acceleration[[k, d]] = controller.acceleration()[d];
            }
        }
        Ok(trajectory)
    }

    /// Movements of many styles (B, J) under otherwise equal conditions: positions and velocities, each (B, T, D).
    ///
    /// `proceed` is told now and then the share that is done of the part at work.
    ///
    /// # Errors
    /// Styles, conditions or times that do not fit the model, or whatever `proceed` returns.
    pub fn rollouts(
        self: &Arc<Self>,
        styles: ArrayView2<f64>,
        conditions: &Conditions,
        timing: Timing,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<(Array3<f64>, Array3<f64>)> {
        check_matrix("styles", styles)?;
        if styles.ncols() != self.n_styles() {
            let (expected, found) = (self.n_styles(), styles.ncols());
            return Err(Error::Length { name: "styles", expected, found, per: "style dimension" });
        }
        for style in styles.rows() {
            check_style(&style.to_vec(), self.n_styles())?;
        }
        let still = Conditions { style: Some(vec![0.0; self.n_styles()]), ..conditions.clone() };
        let base = self.rollout_with(&still, timing, proceed)?;
        let responses = self.style_responses(conditions, timing, proceed)?;
        let mut batch = |base: &Array2<f64>, response: fn(&Trajectory) -> &Array2<f64>| {
            let mut curves = zeros("rollouts", (styles.nrows(), base.nrows(), base.ncols()))?;
            for (b, (mut curve, style)) in curves.outer_iter_mut().zip(styles.rows()).enumerate() {
                proceed(b as f64 / styles.nrows() as f64)?;
                curve.assign(base);
                for (s, trajectory) in style.iter().zip(&responses) {
                    curve.scaled_add(*s, response(trajectory));
                }
            }
            Ok(curves)
        };
        Ok((batch(&base.position, |r| &r.position)?, batch(&base.velocity, |r| &r.velocity)?))
    }

    /// Jacobian ∂y/∂s (T, D, J) of a rollout's positions; exact, and the same for every style.
    ///
    /// `proceed` is told now and then the share that is done of the part at work.
    ///
    /// # Errors
    /// Conditions or times that do not fit the model, or whatever `proceed` returns.
    pub fn style_jacobian(
        self: &Arc<Self>,
        conditions: &Conditions,
        timing: Timing,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Array3<f64>> {
        let responses = self.style_responses(conditions, timing, proceed)?;
        let (steps, n_dofs) = responses.first().map_or((0, 0), |response| response.position.dim());
        let mut jacobian = zeros("style_jacobian", (steps, n_dofs, responses.len()))?;
        for (j, response) in responses.iter().enumerate() {
            jacobian.index_axis_mut(Axis(2), j).assign(&response.position);
        }
        Ok(jacobian)
    }

    /// Rollouts of the unit styles with all else zero. A start or start velocity that is given stays given, at zero:
    /// whether it is decides how the start depends on the style.
    fn style_responses(
        self: &Arc<Self>,
        conditions: &Conditions,
        timing: Timing,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Vec<Trajectory>> {
        conditions.complete(self)?;
        let zeros = || vec![0.0; self.n_dofs()];
        let discrete = self.kind() == Kind::Discrete;
        // The length of all is that of the conditions, whatever τ they carry.
        let unit = |j: usize| Conditions {
            style: Some((0..self.n_styles()).map(|i| if i == j { 1.0 } else { 0.0 }).collect()),
            goal: discrete.then(zeros),
            anchor: (!discrete).then(zeros),
            start: (discrete || conditions.start.is_some()).then(zeros),
            velocity: conditions.velocity.as_ref().map(|_| zeros()),
            amplitude: conditions.amplitude,
            tau: conditions.tau,
        };
        (0..self.n_styles()).map(|j| self.rollout_with(&unit(j), timing, proceed)).collect()
    }
}
