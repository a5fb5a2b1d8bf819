//! Limits of the jerk in the control loop.
//!
//! A DoF that does not keep its limit of the jerk, or could not stop inside its limits after the tick, follows
//! [`JerkBounds::follow`] towards the mean acceleration over the tick that the primitive wants. The primitive continues from
//! there, as from a DoF that another limit binds.

use super::Controller;
use crate::dynamics::output_system::Attractor;
use crate::motion::limits::Limit;
use crate::motion::stopping::{JerkBounds, State};
use crate::motion::viability::MIN_TICK;
use crate::numerics::simd::{F64x4, WIDTH};

impl Controller {
    /// Returns the limits of a DoF whose jerk is limited.
    fn jerk_bounds(&self, dof: usize) -> Option<JerkBounds> {
        let jerk = self.limiter.jerk[dof];
        let bounds = &self.limiter.bounds[dof / WIDTH];
        let [lower, upper, velocity, acceleration] =
            [&bounds.lower, &bounds.upper, &bounds.velocity, &bounds.acceleration]
                .map(|lanes| lanes.as_array()[dof % WIDTH]);
        jerk.is_finite().then_some(JerkBounds { lower, upper, velocity, acceleration, jerk })
    }

    /// Returns the states of a DoF at both ends of the tick that has just been computed.
    fn ends_of_tick(&self, dof: usize) -> [State; 2] {
        let (index, lane) = (dof / WIDTH, dof % WIDTH);
        let after = [self.position[index], self.velocity[index], self.acceleration[index]];
        [self.limiter.before[index], after].map(|lanes| {
            let [y, v, a] = lanes.map(|lanes| lanes.as_array()[lane]);
            State { y, v, a }
        })
    }

    /// Returns the DoFs of a group that break a limit of the jerk over a tick of `dt` seconds, or cannot stop after it.
    pub(super) fn breaks_jerk(&self, index: usize, dt: f64) -> F64x4 {
        self.limiter.mask(index, |dof| {
            let [from, to] = self.ends_of_tick(dof);
            self.jerk_bounds(dof).is_some_and(|bounds| !bounds.admits(from, to, dt))
        })
    }

    /// Limits the DoFs of a group whose jerk is limited and that are not `kept`, and returns the excess δ of those that no limit
    /// of the position binds.
    ///
    /// At the position y + (ÿ + α_zρẏ)/(α_zβ_zρ²) the acceleration ÿ that the primitive wants vanishes with the velocity.
    pub(super) fn limit_jerk(&mut self, index: usize, kept: F64x4, dt: f64) -> F64x4 {
        let rate = self.finite_rate();
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        let mut excess = [0.0; WIDTH];
        for dof in (index * WIDTH..self.limiter.jerk.len()).take(WIDTH) {
            let lane = dof % WIDTH;
            let Some(bounds) = self.jerk_bounds(dof).filter(|_| kept.to_bitmask() & (1 << lane) == 0) else { continue };
            let [from, wanted] = self.ends_of_tick(dof);
            let target = wanted.y + (wanted.a + alpha_z * rate * wanted.v) / (alpha_z * beta_z * rate * rate);
            let duration = dt.max(MIN_TICK);
            let (state, limit) = bounds.follow(from, (wanted.v - from.v) / duration, target, dt);
            self.position[index].as_mut_array()[lane] = state.y;
            self.velocity[index].as_mut_array()[lane] = state.v;
            self.acceleration[index].as_mut_array()[lane] = state.a;
            self.groups[index].z.as_mut_array()[lane] += (state.v - wanted.v) / rate;
            self.limiter.limited[dof] = Some(limit);
            if limit != Limit::Position {
                excess[lane] = (wanted.v - state.v) / duration;
            }
        }
        self.excess_of(F64x4::new(excess))
    }
}
