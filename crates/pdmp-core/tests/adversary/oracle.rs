//! Judgement of the published motion.
//!
//! For each DoF with limits l ≤ y ≤ u, |ẏ| ≤ V, |ÿ| ≤ A, |y⃛| ≤ J the oracle follows quantities that no permitted motion increases
//! above zero, and that a motion which starts above may only decrease: the speed in excess of V, and the distances beyond u and
//! l at which the DoF would come to rest under A and J. The violation of a tick is the rise above the smallest value since the limits
//! changed, or above zero.

use pdmp_core::Controller;
use pdmp_core::motion::{Limit, Limits};

use super::attack::Observer;

/// Judged properties.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Property {
    /// y after a tick, relative to u − l.
    Position,
    /// y at the turning point of the cubic between two states, relative to u − l.
    Between,
    /// Point of rest under A after a tick, relative to u − l or to its excess.
    Stop,
    /// |ẏ| after a tick, relative to V.
    Velocity,
    /// |Δẏ|/Δt, beyond the last digit of ẏ, relative to A.
    Acceleration,
    /// |Δy|/Δt, relative to V.
    MeanVelocity,
    /// Δy within the bounds of any motion from ẏ to ẏ under A, relative to u − l.
    Consistency,
    /// |ÿ| as published, relative to A.
    Published,
    /// |Δÿ|/Δt, beyond the last digits of ÿ, relative to J.
    Jerk,
    /// Time until a DoF outside has come back, beyond a multiple of that of braking and returning, relative to it.
    Return,
    /// Goal or anchor in force, relative to u − l.
    Goal,
    /// Position after a command without a tick: its change, relative to the range.
    Call,
    /// Velocity and point of rest after a command without a tick.
    CallVelocity,
}

impl Property {
    pub(crate) const ALL: [Self; 13] = [
        Self::Position,
        Self::Between,
        Self::Stop,
        Self::Velocity,
        Self::Acceleration,
        Self::MeanVelocity,
        Self::Consistency,
        Self::Published,
        Self::Jerk,
        Self::Return,
        Self::Goal,
        Self::Call,
        Self::CallVelocity,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Between => "position between ticks",
            Self::Stop => "point of rest",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::MeanVelocity => "mean velocity of a tick",
            Self::Consistency => "position beside velocity",
            Self::Published => "published acceleration",
            Self::Jerk => "jerk",
            Self::Return => "time of return",
            Self::Goal => "goal in force",
            Self::Call => "position after a command",
            Self::CallVelocity => "velocity after a command",
        }
    }
}

/// Largest violation of a property.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Worst {
    pub(crate) violation: f64,
    pub(crate) tick: usize,
    pub(crate) dof: usize,
    pub(crate) dt: f64,
}

/// Findings of a case.
#[derive(Clone, Debug, Default)]
pub(crate) struct Findings {
    pub(crate) worst: [Worst; Property::ALL.len()],
    pub(crate) joint_ticks: usize,
    /// Joint-ticks outside the limits.
    pub(crate) outside: usize,
    /// Joint-ticks limited by position, velocity, acceleration and jerk.
    pub(crate) limited: [usize; 4],
    pub(crate) not_finite: usize,
}

/// Limits and state of a DoF.
#[derive(Clone, Copy, Debug)]
struct Dof {
    lower: f64,
    upper: f64,
    velocity: f64,
    acceleration: f64,
    jerk: f64,
    /// Deceleration with which a DoF can stop inside in ticks of the default length: min(A, V/2Δt, (u − l)/Δt²).
    braking: f64,
    /// Default length of a tick.
    dt: f64,
    /// Range between the limits of the position, of the demonstrations where there is none.
    range: f64,
    demonstrated_range: f64,
    y: f64,
    v: f64,
    a: f64,
    /// Smallest excesses since the limits changed: of the speed, and beyond the upper and the lower limit.
    excess: [f64; 3],
    /// Time outside, and the time allowed for it.
    time: [f64; 2],
}

/// Fastest motion to rest within limits of acceleration and jerk.
struct Stop {
    /// Least and greatest displacement.
    least: f64,
    greatest: f64,
    /// Largest speed.
    peak: f64,
}

impl Stop {
    /// Returns the motion from a velocity and an acceleration whose magnitude is `most` at most.
    fn new(v: f64, a: f64, most: f64, jerk: f64) -> Self {
        // The velocity at which the acceleration would vanish gives the direction of the motion.
        let sign = if v + a * a.abs() / (2.0 * jerk) < 0.0 { -1.0 } else { 1.0 };
        let (start, rise) = (sign * v, sign * a);
        let deepest = (jerk * start + 0.5 * rise * rise).max(0.0).sqrt().min(most);
        let hold = (start + (0.5 * rise * rise - deepest * deepest) / jerk) / deepest;
        let phases =
            [((rise + deepest) / jerk, -jerk), (if deepest > 0.0 { hold } else { 0.0 }, 0.0), (deepest / jerk, jerk)];
        let (mut y, mut speed, mut change) = (0.0, start, rise);
        for (t, jerk) in phases.map(|(t, jerk)| (t.max(0.0), jerk)) {
            y += t * (speed + t * (0.5 * change + t * jerk / 6.0));
            speed += t * (change + 0.5 * t * jerk);
            change += t * jerk;
        }
        // A DoF that accelerates against its velocity turns round first.
        let back = if start < 0.0 {
            let t = -2.0 * start / (rise + (rise * rise + 2.0 * jerk * start).max(0.0).sqrt());
            t * (start + t * (0.5 * rise - t * jerk / 6.0))
        } else {
            0.0
        };
        let ends = [sign * back, sign * y.max(0.0)];
        let coasting = if rise > 0.0 { start + rise * rise / (2.0 * jerk) } else { start };
        Self { least: ends[0].min(ends[1]), greatest: ends[0].max(ends[1]), peak: v.abs().max(coasting.abs()) }
    }
}

/// Judge of one case.
pub(crate) struct Oracle {
    dofs: Vec<Dof>,
    findings: Findings,
    tick: usize,
    /// Last command without a tick.
    command: &'static str,
    /// Motion after the tick that is judged, for the trace.
    after: [f64; 3],
    limit: Option<Limit>,
    trace: bool,
}

impl Dof {
    /// Returns the excesses of a state: of the speed, and of the point of rest beyond the upper and the lower limit.
    fn excess(&self, y: f64, v: f64, a: f64) -> [f64; 3] {
        if self.has_jerk() {
            let Stop { least, greatest, peak } = Stop::new(v, a, self.acceleration, self.jerk);
            return [peak - self.velocity, y + greatest - self.upper, self.lower - (y + least)].map(|x| x.max(0.0));
        }
        let way = v * v / (2.0 * self.braking);
        let above = if v > 0.0 { y - self.upper + way } else { y - self.upper };
        let below = if v < 0.0 { self.lower - y + way } else { self.lower - y };
        [v.abs() - self.velocity, above, below].map(|excess| excess.max(0.0))
    }

    fn has_jerk(&self) -> bool {
        self.jerk.is_finite()
    }

    /// Sets the state without judging it.
    fn set(&mut self, y: f64, v: f64, a: f64) {
        (self.y, self.v, self.a) = (y, v, a);
        self.excess = self.excess(y, v, a);
        if self.has_jerk() {
            // It does not brake less in long ticks.
        } else if self.braking < self.acceleration || self.acceleration.is_infinite() {
            let way = 0.5 * v.abs() * self.dt;
            let [above, below] = [y + way - self.upper, self.lower - (y - way)];
            self.excess[1] = if v > 0.0 { self.excess[1].max(above) } else { self.excess[1] };
            self.excess[2] = if v < 0.0 { self.excess[2].max(below) } else { self.excess[2] };
        }
        let beyond = self.excess[1].max(self.excess[2]);
        let (a, speed) = (self.braking, self.velocity);
        let reversal = if self.has_jerk() { 2.0 * self.acceleration / self.jerk } else { 0.0 };
        // A limited jerk alternates between two accelerations where one tick with A exceeds V, at a fraction of V on average.
        let multiple = if self.has_jerk() && speed < a * self.dt { 8.0 } else { 4.0 };
        self.time = [0.0, multiple * (v.abs() / a + 2.0 * (2.0 * beyond / a).sqrt() + beyond / speed + reversal)];
    }

    fn is_outside(&self) -> bool {
        let tolerance = if self.has_jerk() { 1e-6 } else { 1e-9 };
        self.excess[0] > tolerance * self.velocity || self.excess[1].max(self.excess[2]) > tolerance * self.range
    }

    /// Returns the scale of the excess of a point of rest.
    fn scale(&self) -> f64 {
        self.range.max(self.excess[1]).max(self.excess[2])
    }
}

/// Returns the displacements from the start at which the cubic of a tick turns round, by its velocity's roots.
fn turning_points(dy: f64, v: f64, v_end: f64, h: f64) -> impl Iterator<Item = f64> {
    let mean = dy / h;
    let (b, c) = (6.0 * mean - 4.0 * v - 2.0 * v_end, 3.0 * (v + v_end - 2.0 * mean));
    let discriminant = b * b - 4.0 * c * v;
    let sum = -0.5 * (b + discriminant.max(0.0).sqrt().copysign(b));
    let roots = if discriminant < 0.0 { [f64::NAN; 2] } else { [sum / c, v / sum] };
    roots.into_iter().filter(|s| *s > 0.0 && *s < 1.0).map(move |s| (v + (0.5 * b + c * s / 3.0) * s) * s * h)
}

impl Oracle {
    pub(crate) fn new(ranges: &[f64]) -> Self {
        let infinity = f64::INFINITY;
        let dof = |range: &f64| Dof {
            lower: -infinity,
            upper: infinity,
            velocity: infinity,
            acceleration: infinity,
            jerk: infinity,
            braking: infinity,
            dt: 0.0,
            range: *range,
            demonstrated_range: if *range > 0.0 { *range } else { 1.0 },
            y: 0.0,
            v: 0.0,
            a: 0.0,
            excess: [0.0; 3],
            time: [0.0; 2],
        };
        Self {
            dofs: ranges.iter().map(dof).collect(),
            findings: Findings::default(),
            tick: 0,
            command: "",
            after: [0.0; 3],
            limit: None,
            trace: false,
        }
    }

    /// Prints every violation above 1e-12 from now on.
    pub(crate) fn traced(mut self) -> Self {
        self.trace = true;
        self
    }

    pub(crate) fn finish(self) -> Findings {
        self.findings
    }

    fn note(&mut self, property: Property, dof: usize, dt: f64, violation: f64) {
        let worst = &mut self.findings.worst[property as usize];
        if violation > worst.violation {
            *worst = Worst { violation, tick: self.tick, dof, dt };
        }
        if self.trace && violation > 1e-12 {
            let (tick, name) = (self.tick, property.name());
            let command = if dt == 0.0 { self.command } else { "" };
            println!(
                "tick {tick} DoF {dof} dt {dt:e}: {name} by {violation:e} {command}; {:?}, {:?} after {:?}",
                self.limit, self.after, self.dofs[dof]
            );
        }
    }

    /// Judges the goal in force.
    fn judge_goal(&mut self, controller: &Controller) {
        for (dof, centre) in controller.centre().iter().enumerate() {
            let limits = self.dofs[dof];
            self.note(Property::Goal, dof, 0.0, (centre - limits.upper).max(limits.lower - centre) / limits.range);
        }
    }

    /// Judges one DoF after a tick.
    fn judge(&mut self, index: usize, dt: f64, y: f64, v: f64, a: f64) {
        let dof = self.dofs[index];
        if !(y.is_finite() && v.is_finite() && a.is_finite()) {
            if self.trace && self.findings.not_finite == 0 {
                println!("tick {} DoF {index} dt {dt:e}: {y} {v} {a}; before {dof:?}", self.tick);
            }
            self.findings.not_finite += 1;
            return;
        }
        let rise = |excess: f64, k: usize| excess - dof.excess[k];
        // Inside, the position has no roundings to spare.
        // A DoF with a limited jerk approaches the limit from outside ever closer.
        let inside = if dof.has_jerk() { 0.0 } else { 1e-9 * dof.range };
        let beyond = |excess: f64, k: usize| if dof.excess[k] > inside { rise(excess, k) } else { excess };
        let excess = dof.excess(y, v, a);
        // Where the point of rest was outside, the position may go as far.
        let [above, below] = [(y - dof.upper).max(0.0), (dof.lower - y).max(0.0)];
        // From outside, a DoF whose limits of velocity and position allow less than A in a tick stops within one, and one that
        // turns round brakes less than with A, as it then returns.
        let is_outside = dof.excess[1].max(dof.excess[2]) > inside;
        let is_unbraked =
            !dof.has_jerk() && (dof.braking < dof.acceleration || dof.acceleration.is_infinite() || dof.v * v < 0.0);
        let grace = if is_outside && is_unbraked { 0.5 * dof.v.abs() * dt } else { 0.0 };
        // Roundings of the position add up while a DoF brakes; those of one tick are allowed for.
        let digits = 16.0 * f64::EPSILON * (y.abs() + dt * dof.v.abs());
        self.note(Property::Position, index, dt, (beyond(above, 1).max(beyond(below, 2)) - grace) / dof.scale());
        self.note(
            Property::Stop,
            index,
            dt,
            (rise(excess[1], 1).max(rise(excess[2], 2)) - grace - digits) / dof.scale(),
        );
        self.note(Property::Velocity, index, dt, rise(excess[0], 0) / dof.velocity.max(dof.excess[0]));
        for turning in turning_points(y - dof.y, dof.v, v, dt) {
            let above = turning - (dof.upper - dof.y) - dof.excess[1];
            let below = (dof.lower - dof.y) - turning - dof.excess[2];
            // A limited jerk may end within a tick, and the cubic then differs from the motion.
            let deviation = if dof.has_jerk() { dof.jerk * dt * dt * dt / 150.0 } else { 0.0 };
            self.note(Property::Between, index, dt, (above.max(below) - digits - grace - deviation) / dof.scale());
        }
        let digit = f64::EPSILON * v.abs().max(dof.v.abs());
        let step = dof.acceleration * dt;
        self.note(Property::Acceleration, index, dt, ((v - dof.v).abs() - step - digit) / step);
        let mean = ((y - dof.y).abs() - 6.0 * f64::EPSILON * y.abs()) / dt;
        self.note(
            Property::MeanVelocity,
            index,
            dt,
            (mean - dof.velocity - dof.excess[0]) / dof.velocity.max(dof.excess[0]),
        );
        let (way, free) = (y - dof.y - 0.5 * dt * (dof.v + v), 0.25 * step * dt);
        let digit = 2.0 * f64::EPSILON * (y.abs() + dt * v.abs());
        self.note(Property::Consistency, index, dt, (way.abs() - free - digit) / dof.scale());
        self.note(Property::Published, index, dt, a.abs() / dof.acceleration - 1.0);
        if dof.has_jerk() {
            let (step, digits) = (dof.jerk * dt, 2.0 * f64::EPSILON * a.abs().max(dof.a.abs()));
            self.note(Property::Jerk, index, dt, ((a - dof.a).abs() - step - digits) / step);
        }
        let dof = &mut self.dofs[index];
        (dof.y, dof.v, dof.a) = (y, v, a);
        dof.excess[0] = dof.excess[0].min(excess[0]);
        for (least, excess) in dof.excess.iter_mut().zip(excess).skip(1) {
            *least = if grace > 0.0 { excess } else { least.min(excess).max(excess.min(*least + digits)) };
        }
        if self.dofs[index].is_outside() {
            self.findings.outside += 1;
            let dof = &mut self.dofs[index];
            dof.time[0] += dt;
            let [time, allowed] = dof.time;
            // A limited jerk returns in ticks of the default length.
            let tick = if dof.has_jerk() { dof.dt } else { dt };
            if dof.acceleration.is_finite() && allowed > 0.0 && time > allowed + 10.0 * tick {
                self.note(Property::Return, index, dt, time / allowed - 1.0);
            }
        }
    }
}

impl Observer for Oracle {
    fn limited(&mut self, controller: &Controller, limits: &Limits) {
        let infinity = f64::INFINITY;
        for (index, dof) in self.dofs.iter_mut().enumerate() {
            let of = |vector: &Option<Vec<f64>>, none: f64| vector.as_ref().map_or(none, |vector| vector[index]);
            (dof.lower, dof.upper) = (of(&limits.lower, -infinity), of(&limits.upper, infinity));
            (dof.velocity, dof.acceleration) = (of(&limits.velocity, infinity), of(&limits.acceleration, infinity));
            dof.jerk = of(&limits.jerk, infinity);
            dof.range = dof.upper - dof.lower;
            dof.dt = controller.dt();
            let within_tick = if dof.has_jerk() {
                infinity
            } else {
                (0.5 * dof.velocity / dof.dt).min(dof.range / (dof.dt * dof.dt))
            };
            dof.braking = dof.acceleration.min(within_tick);
            if dof.range.is_infinite() {
                dof.range = dof.demonstrated_range;
            }
            // The state of the last tick, which limits do not change.
            let a = if dof.has_jerk() { controller.acceleration()[index] } else { dof.a };
            dof.set(dof.y, dof.v, a);
        }
        self.judge_goal(controller);
    }

    fn restarted(&mut self, controller: &Controller) {
        let motion = controller.position().iter().zip(controller.velocity()).zip(controller.acceleration());
        for (dof, ((&y, &v), &a)) in self.dofs.iter_mut().zip(motion) {
            dof.set(y, v, a);
        }
    }

    fn called(&mut self, controller: &Controller, command: &'static str) {
        self.command = command;
        let motion = controller.position().iter().zip(controller.velocity()).zip(controller.acceleration());
        for (index, ((&y, &v), &a)) in motion.enumerate() {
            let dof = self.dofs[index];
            if !(y.is_finite() && v.is_finite()) {
                if self.trace && self.findings.not_finite == 0 {
                    println!("tick {} DoF {index}: {y} {v} after {command}; before {dof:?}", self.tick);
                }
                self.findings.not_finite += 1;
                return;
            }
            self.note(Property::Call, index, 0.0, (y - dof.y).abs() / dof.range);
            let [speed, above, below] = dof.excess(y, v, a);
            self.note(Property::CallVelocity, index, 0.0, (speed - dof.excess[0]) / dof.velocity.max(dof.excess[0]));
            let digits = 16.0 * f64::EPSILON * y.abs();
            let rise = (above - dof.excess[1]).max(below - dof.excess[2]) - digits;
            self.note(Property::CallVelocity, index, 0.0, rise / dof.scale());
        }
        self.judge_goal(controller);
    }

    fn ticked(&mut self, controller: &Controller, dt: f64) {
        self.tick += 1;
        let motion = controller.position().iter().zip(controller.velocity()).zip(controller.acceleration());
        for (index, ((&y, &v), &a)) in motion.enumerate() {
            (self.after, self.limit) = ([y, v, a], controller.limited()[index]);
            self.judge(index, dt, y, v, a);
        }
        self.findings.joint_ticks += self.dofs.len();
        for limit in controller.limited().iter().flatten() {
            self.findings.limited[match limit {
                Limit::Position => 0,
                Limit::Velocity => 1,
                Limit::Acceleration => 2,
                Limit::Jerk => 3,
            }] += 1;
        }
    }
}
