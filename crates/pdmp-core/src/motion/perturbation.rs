//! Perturbation of a movement by the measured position ỹ of the robot and by coupling terms c_v and c_a of the user.
//!
//! ```text
//! τẏ = z + w(u) + k_t d + τc_v                      Eq. (2)
//! τż = α_z(β_z(g − y) − z) + τ²c_a                   Eq. (1)
//! τu̇ = κ = 1/(1 + k_s‖d/range‖²)                    phase stopping: τẋ = −κα_x x, or τφ̇ = κ
//! τȯ = λκ(e − o)                                    expected error
//! ```
//!
//! The coupling terms add c_v to ẏ and c_a to ÿ. Of the tracking error e = ỹ − y only the excess over the expected
//! error o counts: per DoF, d = e − min(max(o, min(e, 0)), max(e, 0)), which has the sign of e and is not larger. A
//! constant error (sag, friction) thus passes from d into o, and neither shifts the goal nor stops the phase
//! permanently; the error before the first tick is expected at once. The expected error adapts on the clock of the
//! phase: a blocked robot stops this clock, so that its error remains unexpected. Between two measurements the robot
//! is assumed to keep its distance: e is that of the last measurement, and the pull is distributed over the ticks
//! such that their sum does not overshoot ỹ. The error of an angle is wrapped to half a turn. A blocked robot holds
//! the movement at its position and almost stops the phase; after its release the movement continues from there.
//!
//! Phase stopping and the tracking term in Eq. (2) are those of Ijspeert, Nakanishi and Schaal, ICRA 2002,
//! [doi:10.1109/ROBOT.2002.1014739], and of Schaal, Mohajerian and Ijspeert, Progress in Brain Research 165, 2007,
//! [doi:10.1016/S0079-6123(06)65027-9]; terms in Eq. (1) those of Pastor, Hoffmann, Asfour and Schaal, ICRA 2009,
//! [doi:10.1109/ROBOT.2009.5152385].
//!
//! All terms are evaluated at the start of a tick and constant over it, so that its propagation stays exact.
//!
//! [doi:10.1109/ROBOT.2002.1014739]: https://doi.org/10.1109/ROBOT.2002.1014739
//! [doi:10.1016/S0079-6123(06)65027-9]: https://doi.org/10.1016/S0079-6123(06)65027-9
//! [doi:10.1109/ROBOT.2009.5152385]: https://doi.org/10.1109/ROBOT.2009.5152385

use crate::demonstration::turn_of;
use crate::error::{Error, Result};
use crate::model::Primitive;
use crate::motion::command::{Command, Coupling};
use crate::numerics::simd::{F64x4, groups, pack, repack};
use crate::numerics::state::{Visitor, clone_in_place, visit_flag, visit_number};

/// Default k_s: an error of a tenth of the range slows the phase elevenfold.
const STOPPING_GAIN: f64 = 1000.0;
/// Default k_t times the demonstrated clock interval. While a robot is blocked for long, a larger gain lets the phase creep
/// and the movement leap after the release; a smaller one leaves the robot farther behind.
const TRACKING_GAIN: f64 = 10.0;
/// λ times the demonstrated clock interval. A larger rate takes a blocked robot for one that sags; a smaller one adapts
/// later to an error that is present from the start.
const ADAPTATION_RATE: f64 = 5.0;
/// Bound of κ, above the sum of 1 and the largest gain of a measured phase.
pub(crate) const MAX_PHASE_RATE: f64 = 1e4;
/// Factor of κ due to limits from which it counts as 1 again.
const FULL_RATE: f64 = 1.0 - 1e-6;
/// Maximum gain. It keeps products finite.
const MAX_GAIN: f64 = 1e100;
/// Range, relative to the largest one, up to which a DoF is stationary.
pub(crate) const MIN_RANGE_RATIO: f64 = 1e-6;
/// Range up to which a DoF is stationary, since the square of its inverse may overflow.
const MIN_RANGE: f64 = 1e-140;

/// Gains of a measured position; a gain of 0 disables its term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance {
    /// k_s of phase stopping, from 0 to 1e100.
    pub stopping: f64,
    /// k_t of tracking, per unit of the clock, from 0 to 1e100.
    pub tracking: f64,
}

/// Velocity and acceleration that are added over a tick, by groups of DoFs.
#[derive(Debug)]
pub(crate) struct PerturbationTerms {
    pub(crate) velocity: Vec<F64x4>,
    pub(crate) acceleration: Vec<F64x4>,
}

clone_in_place!(PerturbationTerms { velocity, acceleration });

/// Perturbation of the current tick, and the gains of the movement's response.
#[derive(Debug)]
pub(crate) struct Perturbation {
    terms: PerturbationTerms,
    /// True if the terms apply to the tick.
    active: bool,
    /// κ.
    phase_rate: f64,
    /// Factor of κ due to the limits that bound the last tick.
    limited_rate: f64,
    /// k_s and k_t.
    compliance: Compliance,
    /// True while a measurement is in force.
    measured: bool,
    /// Tracking error e of the last measurement, by groups of DoFs.
    error: Vec<F64x4>,
    /// Expected error o, by groups of DoFs.
    expected_error: Vec<F64x4>,
    /// Velocity of the tracking term in the last tick, by groups of DoFs.
    pull: Vec<F64x4>,
    /// λ, per unit of the clock.
    adaptation_rate: f64,
    /// Share of the last measured error that the ticks since then have not yet corrected.
    remaining_pull: f64,
    /// Full turn of an angular DoF in its unit; zero for other DoFs.
    turn: Vec<F64x4>,
    /// Inverse of the full turn; zero for other DoFs.
    inverse_turn: Vec<F64x4>,
    /// Inverse of the range; zero for a stationary DoF, whose error does not stop the phase.
    inverse_range: Vec<F64x4>,
    /// First DoF of each vector: a rotation, or the point of a pose.
    vectors: Vec<usize>,
}

clone_in_place!(Perturbation {
    terms,
    active,
    phase_rate,
    limited_rate,
    compliance,
    measured,
    error,
    expected_error,
    pull,
    adaptation_rate,
    remaining_pull,
    turn,
    inverse_turn,
    inverse_range,
    vectors,
});

/// Returns the largest range of a DoF.
pub(crate) fn largest_range(ranges: &[f64]) -> f64 {
    ranges.iter().fold(0.0, |largest, range| largest.max(*range))
}

impl Perturbation {
    /// Returns no perturbation, with default gains for a primitive.
    pub(crate) fn new(primitive: &Primitive) -> Self {
        let (ranges, units, extent) = (primitive.ranges(), primitive.units(), primitive.canonical().extent());
        let min_range = (MIN_RANGE_RATIO * largest_range(ranges)).max(MIN_RANGE);
        let inverse = |&range: &f64| if range > min_range { 1.0 / range } else { 0.0 };
        let zeros = vec![F64x4::ZERO; groups(ranges.len())];
        let inverse_range: Vec<f64> = ranges.iter().map(inverse).collect();
        // The error of a rotation is already by the shorter way.
        let turns = |d: &usize| !primitive.rotation_dofs().any(|first| (first..first + 3).contains(d));
        let turn_of_dof = |d| Some(d).filter(turns).and_then(|d| units.get(d)).and_then(|unit| turn_of(unit));
        let turn: Vec<f64> = (0..ranges.len()).map(|d| turn_of_dof(d).unwrap_or(0.0)).collect();
        let inverse_turn: Vec<f64> = turn.iter().map(|&turn| if turn > 0.0 { 1.0 / turn } else { 0.0 }).collect();
        Self {
            terms: PerturbationTerms { velocity: zeros.clone(), acceleration: zeros.clone() },
            active: false,
            phase_rate: 1.0,
            limited_rate: 1.0,
            compliance: Compliance { stopping: STOPPING_GAIN, tracking: TRACKING_GAIN / extent },
            measured: false,
            error: zeros.clone(),
            expected_error: zeros.clone(),
            pull: zeros,
            adaptation_rate: ADAPTATION_RATE / extent,
            remaining_pull: 1.0,
            turn: pack(&turn),
            inverse_turn: pack(&inverse_turn),
            inverse_range: pack(&inverse_range),
            vectors: primitive.vector_dofs(),
        }
    }

    /// Removes the terms of the tick; a measurement remains in force.
    pub(crate) fn clear_terms(&mut self) {
        (self.active, self.phase_rate) = (false, self.limited_rate);
    }

    /// Discards terms, measurement, expected error and the effect of limits.
    pub(crate) fn clear(&mut self) {
        self.limited_rate = 1.0;
        self.release();
    }

    /// Discards terms, measurement and expected error.
    pub(crate) fn release(&mut self) {
        self.clear_terms();
        self.measured = false;
        self.expected_error.fill(F64x4::ZERO);
        self.pull.fill(F64x4::ZERO);
    }

    /// Returns the velocity of the tracking term in the last tick, by groups of DoFs.
    pub(crate) fn pull(&self) -> &[F64x4] {
        &self.pull
    }

    /// Returns whether a measurement is in force.
    pub(crate) fn has_measurement(&self) -> bool {
        self.measured
    }

    /// Sets the perturbation of a tick that starts at `position`, of `h` on the clock and a pull over `dt` seconds. The command
    /// is valid.
    ///
    /// The error of a measurement before the first tick is expected: nothing has moved, so that the robot is not blocked.
    pub(crate) fn set(&mut self, command: &Command, position: &[F64x4], dt: f64, h: f64, started: bool) {
        self.clear_terms();
        if let Some(measured) = command.measured {
            (self.measured, self.remaining_pull) = (true, 1.0);
            repack(&mut self.error, measured);
            for (group, error) in self.error.iter_mut().enumerate() {
                let difference = *error - position[group];
                *error = difference - (difference * self.inverse_turn[group]).round() * self.turn[group];
            }
            if !started {
                self.expected_error.copy_from_slice(&self.error);
            }
        }
        self.active = self.measured || command.coupling.is_some();
        if !self.active {
            return;
        }
        if let Some(Coupling { velocity, acceleration }) = command.coupling {
            repack(&mut self.terms.velocity, velocity);
            repack(&mut self.terms.acceleration, acceleration);
        } else {
            self.terms.velocity.fill(F64x4::ZERO);
            self.terms.acceleration.fill(F64x4::ZERO);
        }
        if self.measured {
            self.add_tracking(dt, h);
        }
    }

    /// Adds the tracking term, computes the phase rate and adapts the expected error.
    fn add_tracking(&mut self, dt: f64, h: f64) {
        let Compliance { stopping, tracking } = self.compliance;
        // The share of the error that k_t alone would correct over the tick, so that the pull does not overshoot ỹ. It is
        // stable for every tick and gain up to β_z = 4α_z at least, far above the critical damping of α_z/4.
        let share = -(-tracking * h).exp_m1();
        let pull = if dt > 0.0 { self.remaining_pull * share / dt } else { 0.0 };
        self.remaining_pull *= 1.0 - share;
        for ((unexpected, &error), expected) in self.pull.iter_mut().zip(&self.error).zip(&self.expected_error) {
            *unexpected = error - expected.max(error.min(F64x4::ZERO)).min(error.max(F64x4::ZERO));
        }
        self.expect_vectors();
        let mut squares = F64x4::ZERO;
        for (group, velocity) in self.terms.velocity.iter_mut().enumerate() {
            let unexpected = self.pull[group];
            self.pull[group] = unexpected * pull;
            *velocity += self.pull[group];
            let scaled = unexpected * self.inverse_range[group];
            squares += scaled * scaled;
        }
        self.phase_rate = self.limited_rate * stopped(squares * stopping);
        let adapted = -(-self.adaptation_rate * self.phase_rate * h).exp_m1();
        for (expected_error, &error) in self.expected_error.iter_mut().zip(&self.error) {
            *expected_error += (error - *expected_error) * adapted;
        }
    }

    /// Sets the unexpected error of each vector: of its expected error, the part along its error counts.
    fn expect_vectors(&mut self) {
        let Self { pull, error, expected_error, vectors, .. } = self;
        let unexpected = bytemuck::cast_slice_mut::<F64x4, f64>(pull);
        let [error, expected] = [error, expected_error].map(|lanes| bytemuck::cast_slice::<F64x4, f64>(lanes));
        for dof in vectors.iter().map(|&first| first..first + 3) {
            let products = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let (error, expected) = (&error[dof.clone()], &expected[dof.clone()]);
            let square = products(error, error);
            let share = if square > 0.0 { (products(expected, error) / square).clamp(0.0, 1.0) } else { 0.0 };
            unexpected[dof].iter_mut().zip(error).for_each(|(unexpected, error)| *unexpected = error * (1.0 - share));
        }
    }

    /// Returns the factor of κ due to limits, 1 without any.
    pub(crate) fn limited_rate(&self) -> f64 {
        self.limited_rate
    }

    /// Sets the displacements (D,) of the goal that are equivalent to the accelerations beyond the limits, over a tick of `h`
    /// time constants of the filter of κ.
    ///
    /// The excess depends on κ at once, with a gain that would make an unfiltered κ alternate between its bounds.
    pub(crate) fn set_excess(&mut self, excess: impl Iterator<Item = F64x4>, h: f64) {
        let scaled = excess.zip(&self.inverse_range).map(|(excess, inverse_range)| excess * *inverse_range);
        let squares = scaled.fold(F64x4::ZERO, |sum, scaled| sum + scaled * scaled);
        let rate = stopped(squares * self.compliance.stopping);
        self.limited_rate += (rate - self.limited_rate) * -(-h).exp_m1();
        if rate == 1.0 && self.limited_rate > FULL_RATE {
            self.limited_rate = 1.0;
        }
    }

    /// Returns the terms of the tick, `None` without a perturbation.
    pub(crate) fn terms(&self) -> Option<&PerturbationTerms> {
        self.active.then_some(&self.terms)
    }

    /// Returns κ, the rate of the phase's clock relative to that of the output system.
    pub(crate) fn phase_rate(&self) -> f64 {
        self.phase_rate
    }

    /// Adds the pull of a measured phase to the phase rate, which stays at least 0.
    pub(crate) fn add_phase_pull(&mut self, pull: f64) {
        self.phase_rate = (self.phase_rate + pull).max(0.0);
    }

    /// Visits the state, with the bounds of a quantity in units of a DoF.
    pub(crate) fn walk(&mut self, visit: &mut Visitor, quantity: [f64; 2]) -> Result<()> {
        let Self {
            terms: PerturbationTerms { velocity, acceleration },
            active,
            phase_rate,
            limited_rate,
            compliance: Compliance { stopping, tracking },
            measured,
            error,
            expected_error,
            pull,
            remaining_pull,
            adaptation_rate: _,
            turn: _,
            inverse_turn: _,
            inverse_range: _,
            vectors: _,
        } = self;
        for lanes in [velocity, acceleration, error, expected_error, pull] {
            visit(bytemuck::cast_slice_mut::<F64x4, f64>(lanes), quantity)?;
        }
        visit_flag(visit, active)?;
        visit_flag(visit, measured)?;
        visit_number(visit, phase_rate, [0.0, MAX_PHASE_RATE])?;
        visit_number(visit, limited_rate, [0.0, 1.0])?;
        visit_number(visit, stopping, [0.0, MAX_GAIN])?;
        visit_number(visit, tracking, [0.0, MAX_GAIN])?;
        visit_number(visit, remaining_pull, [0.0, 1.0])
    }

    /// Returns k_s and k_t.
    pub(crate) fn compliance(&self) -> Compliance {
        self.compliance
    }

    /// Sets k_s and k_t.
    ///
    /// # Errors
    /// A gain outside [0, 1e100]. Both then remain unchanged.
    pub(crate) fn set_compliance(&mut self, compliance: Compliance) -> Result<()> {
        for (name, value) in [("stopping", compliance.stopping), ("tracking", compliance.tracking)] {
            if !(0.0..=MAX_GAIN).contains(&value) {
                return Err(Error::Range {
                    name,
                    value,
                    allowed: "must lie between 0, which disables the term, and 1e100",
                });
            }
        }
        self.compliance = compliance;
        Ok(())
    }
}
/// Returns 1/(1 + Σ) for the squares of a group of DoFs.
fn stopped(squares: F64x4) -> f64 {
    1.0 / (1.0 + squares.to_array().iter().sum::<f64>())
}
