//! Response of the output system to coupling terms in the control loop.

use super::Controller;
use super::step::first_element;
use crate::dynamics::output_system::{Attractor, CubicSample, State};
use crate::motion::perturbation::PerturbationTerms;

impl Controller {
    /// Adds the response to the perturbation, by superposition; `before` are the unit inputs at the start of the substep.
    pub(super) fn add_perturbation(&mut self, before: [CubicSample; 2]) {
        let after = self.unit_inputs();
        let by_velocity = self.propagator.advance(State::default(), [before[0], after[0]]);
        let by_acceleration = self.propagator.follow([before[1], after[1]]);
        let Some(PerturbationTerms { velocity, acceleration }) = self.perturbation.terms() else { return };
        for (index, group) in self.groups.iter_mut().enumerate() {
            let (v, a) = (velocity[index], acceleration[index]);
            self.position[index] += v * by_velocity.e + a * by_acceleration.e;
            group.z += v * by_velocity.z + a * by_acceleration.z;
        }
    }

    /// Returns the inputs of the output system for unit coupling terms: the forcing τ for c_v, and the displacement
    /// τ²/(α_zβ_z) of the centre for c_a, which adds τ² to the right-hand side of Eq. (1).
    ///
    /// τ = 1/ρ up to the largest commanded one. At a lower speed the terms fade with it, c_v by the speed and c_a by its
    /// square: z would otherwise keep an acceleration during a pause, and return it at the full rate.
    pub(super) fn unit_inputs(&self) -> [CubicSample; 2] {
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        let [tau, slope] = self.coupling_tau();
        let centre = tau / (alpha_z * beta_z);
        [CubicSample { value: tau, slope }, CubicSample { value: tau * centre, slope: 2.0 * slope * centre }]
    }

    /// Returns τ of the coupling terms and dτ/du.
    pub(super) fn coupling_tau(&self) -> [f64; 2] {
        let (rate, rate_change) = (first_element(self.rate.value()), first_element(self.rate.rate()));
        if rate * self.max_tau < 1.0 {
            return [self.max_tau, 0.0];
        }
        // dτ/du = τ·dτ/dt.
        [1.0 / rate, -rate_change / (rate * rate * rate)]
    }
}
