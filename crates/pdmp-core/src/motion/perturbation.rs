//! What happens to a movement on its way: the robot's measured position ỹ, and terms c_v and c_a of the user's own.
//!
//! ```text
//! τẏ = z + w(u) + k_t d + τc_v                      Eq. (2)
//! τż = α_z(β_z(g − y) − z) + τ²c_a                   Eq. (1)
//! τu̇ = κ = 1/(1 + k_s‖d/range‖²)                    phase stopping: τẋ = −κα_x x, or τφ̇ = κ
//! τȯ = λκ(e − o)                                    expected error
//! ```
//!
//! so that ẏ gains c_v and ÿ gains c_a. Of the tracking error e = ỹ − y only what lies beyond the expected error o counts:
//! per DoF, d = e − min(max(o, min(e, 0)), max(e, 0)), never larger than e nor of another sign. A constant error (sag,
//! friction) so passes from d into o, and neither moves the goal nor stops the phase for ever; o follows on the clock of
//! the phase, so that a robot held fast, which stops that clock, stays unexpected. Between two measurements the robot is
//! taken to keep its distance: e is that of the last one, and the pull is spread over the ticks so that all of them
//! together pull no further than ỹ. The error of an angle is taken the short way round. A robot that is held fast holds the position with it and all but stops the
//! phase; let go, the movement goes on from there. Phase stopping and the term in the row of Eq. (2) are those of
//! Ijspeert, Nakanishi and Schaal, ICRA 2002, [doi:10.1109/ROBOT.2002.1014739], and of Schaal, Mohajerian and Ijspeert,
//! Progress in Brain Research 165, 2007, [doi:10.1016/S0079-6123(06)65027-9]; terms in the row of Eq. (1) those of
//! Pastor, Hoffmann, Asfour and Schaal, ICRA 2009, [doi:10.1109/ROBOT.2009.5152385].
//!
//! All three are evaluated at the start of a tick and held over it, so that its propagation stays exact.
//!
//! [doi:10.1109/ROBOT.2002.1014739]: https://doi.org/10.1109/ROBOT.2002.1014739
//! [doi:10.1016/S0079-6123(06)65027-9]: https://doi.org/10.1016/S0079-6123(06)65027-9
//! [doi:10.1109/ROBOT.2009.5152385]: https://doi.org/10.1109/ROBOT.2009.5152385

use crate::error::{Error, Result};
use crate::motion::command::{Command, Coupling};
use crate::numerics::simd::{Lanes, groups, pack, repack};

/// Default k_s: an error of a tenth of the range slows the phase elevenfold.
const STOPPING: f64 = 1000.0;
/// Default k_t, over the demonstrated stretch of the clock: held for long, a stronger pull would let the phase creep on
/// and the movement leap once let go, a weaker one would leave the robot farther behind.
const TRACKING: f64 = 10.0;
/// λ, over the demonstrated stretch of the clock. A larger one lets a robot that is held fast pass for one that sags, a
/// smaller one takes longer over an error that is there from the start.
const EXPECTING: f64 = 5.0;
/// Largest gain; it only keeps products finite.
const LARGEST_GAIN: f64 = 1e100;
/// A DoF whose range is no more than this share of the widest stands still.
pub(crate) const STILL: f64 = 1e-6;

/// A range below which its inverse would leave what can be squared.
const LEAST: f64 = 1e-140;

/// What is added over a tick, by groups of DoFs.
#[derive(Clone, Debug)]
pub(crate) struct Push {
    pub(crate) velocity: Vec<Lanes>,
    pub(crate) acceleration: Vec<Lanes>,
}

/// The perturbation of the tick at work, and how much the movement gives way to it.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    push: Push,
    pushed: bool,
    pace: f64,
    /// k_s and k_t.
    compliance: (f64, f64),
    /// Whether a measurement is in force.
    followed: bool,
    /// e of the last measurement, by groups of DoFs.
    error: Vec<Lanes>,
    /// o by groups of DoFs.
    expected: Vec<Lanes>,
    /// λ, per unit of the clock.
    expecting: f64,
    /// Share of the way to ỹ that the ticks since the last measurement have not pulled yet.
    left: f64,
    /// A full turn of a DoF that is an angle and its inverse; zero of any other.
    turn: Vec<Lanes>,
    per_turn: Vec<Lanes>,
    /// 1/range by groups of DoFs; zero where a DoF stands still, so that an error there does not stop the phase.
    per_range: Vec<Lanes>,
}

/// The widest of the DoFs' ranges.
pub(crate) fn widest(ranges: &[f64]) -> f64 {
    ranges.iter().fold(0.0, |widest, range| widest.max(*range))
}

impl Held {
    /// No perturbation, for DoFs of these ranges and units and a movement of this extent on the clock.
    pub(crate) fn new(ranges: &[f64], units: &[String], extent: f64) -> Self {
        let widest = widest(ranges);
        let inverse = |&range: &f64| if range > (STILL * widest).max(LEAST) { 1.0 / range } else { 0.0 };
        let zeros = vec![Lanes::ZERO; groups(ranges.len())];
        let per_range: Vec<f64> = ranges.iter().map(inverse).collect();
        let turn: Vec<f64> = (0..ranges.len()).map(|d| units.get(d).map_or(0.0, |unit| full_turn(unit))).collect();
        let per_turn: Vec<f64> = turn.iter().map(|&turn| if turn > 0.0 { 1.0 / turn } else { 0.0 }).collect();
        Self {
            push: Push { velocity: zeros.clone(), acceleration: zeros.clone() },
            pushed: false,
            pace: 1.0,
            compliance: (STOPPING, TRACKING / extent),
            followed: false,
            error: zeros.clone(),
            expected: zeros,
            expecting: EXPECTING / extent,
            left: 1.0,
            turn: pack(&turn),
            per_turn: pack(&per_turn),
            per_range: pack(&per_range),
        }
    }

    /// Adds nothing over the tick to come.
    pub(crate) fn rest(&mut self) {
        (self.pushed, self.pace) = (false, 1.0);
    }

    /// Forgets the robot.
    pub(crate) fn release(&mut self) {
        self.rest();
        self.followed = false;
        self.expected.fill(Lanes::ZERO);
    }

    /// Whether a measurement is in force.
    pub(crate) fn followed(&self) -> bool {
        self.followed
    }

    /// Takes the perturbation of a tick of `dt` seconds, `h` on the clock, that starts at `position`; its vectors have
    /// been checked.
    pub(crate) fn take(&mut self, command: &Command, position: &[Lanes], dt: f64, h: f64) {
        self.rest();
        if let Some(measured) = command.measured {
            (self.followed, self.left) = (true, 1.0);
            repack(&mut self.error, measured);
            for (group, error) in self.error.iter_mut().enumerate() {
                let straight = *error - position[group];
                *error = straight - (straight * self.per_turn[group]).round() * self.turn[group];
            }
        }
        self.pushed = self.followed || command.coupling.is_some();
        if !self.pushed {
            return;
        }
        if let Some(Coupling { velocity, acceleration }) = command.coupling {
            repack(&mut self.push.velocity, velocity);
            repack(&mut self.push.acceleration, acceleration);
        } else {
            self.push.velocity.fill(Lanes::ZERO);
            self.push.acceleration.fill(Lanes::ZERO);
        }
        if self.followed {
            self.follow(dt, h);
        }
    }

    /// Pulls towards the robot, and slows the phase.
    fn follow(&mut self, dt: f64, h: f64) {
        let (stopping, tracking) = self.compliance;
        // What k_t alone would take off the error over the tick, so that it pulls no further than ỹ: stable for every
        // tick and gain up to β_z = 4α_z at least, far from the critical damping of α_z/4.
        let share = -(-tracking * h).exp_m1();
        let pull = self.left * share / dt;
        self.left *= 1.0 - share;
        let mut strain = Lanes::ZERO;
        for (group, velocity) in self.push.velocity.iter_mut().enumerate() {
            let error = self.error[group];
            let unexpected = error - self.expected[group].max(error.min(Lanes::ZERO)).min(error.max(Lanes::ZERO));
            *velocity += unexpected * pull;
            let share = unexpected * self.per_range[group] * stopping.sqrt();
            strain += share * share;
        }
        self.pace = 1.0 / (1.0 + strain.to_array().iter().sum::<f64>());
        let learnt = -(-self.expecting * self.pace * h).exp_m1();
        for (expected, &error) in self.expected.iter_mut().zip(&self.error) {
            *expected += (error - *expected) * learnt;
        }
    }

    /// What is added, if anything.
    pub(crate) fn push(&self) -> Option<&Push> {
        self.pushed.then_some(&self.push)
    }

    /// κ: how fast the phase goes, per unit of the output system's clock.
    pub(crate) fn pace(&self) -> f64 {
        self.pace
    }

    /// k_s and k_t.
    pub(crate) fn compliance(&self) -> (f64, f64) {
        self.compliance
    }

    /// Sets k_s and k_t.
    pub(crate) fn set_compliance(&mut self, stopping: f64, tracking: f64) -> Result<()> {
        for (name, value) in [("stopping", stopping), ("tracking", tracking)] {
            if !(0.0..=LARGEST_GAIN).contains(&value) {
                return Err(Error::Range { name, value, allowed: "must lie between 0, which is without, and 1e100" });
            }
        }
        self.compliance = (stopping, tracking);
        Ok(())
    }
}

/// A full turn in a unit of angle, zero in any other.
fn full_turn(unit: &str) -> f64 {
    match unit.trim() {
        "rad" | "radian" | "radians" => std::f64::consts::TAU,
        "deg" | "degree" | "degrees" | "°" => 360.0,
        _ => 0.0,
    }
}
