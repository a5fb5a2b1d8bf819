//! Limits of all groups of DoFs in the control loop.

use super::pose::place;
use super::turning::{LimitedTurn, walk_turning};
use crate::error::Result;
use crate::model::Primitive;
use crate::motion::angular::AngularLimits;
use crate::motion::limits::{Limit, Limits, limit_of_dof};
use crate::motion::perturbation::{MIN_RANGE_RATIO, largest_range};
use crate::motion::viability::Bounds;
use crate::numerics::simd::{F64x4, WIDTH, groups, padded, unpad};
use crate::numerics::state::{Visitor, clone_in_place, visit_flag, visit_number};

/// Maximum number of parts in which a tick that is longer than the default one is limited.
pub(super) const MAX_SUBSTEPS: f64 = 1000.0;
/// Without a limit of the acceleration, a DoF brakes over this share of the range between its limits.
const BRAKING_SHARE: f64 = 0.01;
/// Velocity, in demonstrated ranges per duration, from which a DoF without limits of velocity and acceleration can brake.
const FREE_VELOCITY: f64 = 10.0;

/// Limits of all groups of DoFs, and the motion at the start of the tick that they apply to.
#[derive(Debug)]
pub(super) struct Limiter {
    active: bool,
    /// True if the rate of the clock is limited before single DoFs are.
    synchronous: bool,
    /// True if no DoF was limited in the last tick.
    pub(super) is_free: bool,
    /// True if `limited` names limits that slowed the clock.
    pub(super) slows: bool,
    pub(super) bounds: Vec<Bounds>,
    /// Limits of the jerk (D,), infinite where there are none.
    pub(super) jerk: Vec<f64>,
    has_jerk: bool,
    /// Position, velocity and acceleration at the start of the tick.
    pub(super) before: Vec<[F64x4; 3]>,
    /// Limits of the rotations, and their motion at the start of the tick; the DoFs of a rotation have none of their own.
    pub(super) turns: Vec<LimitedTurn>,
    /// Time for which `before` was kept without limits, negative if it was not.
    kept_at: f64,
    /// Limit that determined the acceleration of each DoF in the last tick.
    pub(super) limited: Vec<Option<Limit>>,
    /// Displacement of the goal that is equivalent to the excess of the acceleration over its limit in the last tick.
    pub(super) excess: Vec<F64x4>,
    /// Demonstrated range of each DoF, of stationary ones a small share of the others'.
    ranges: Vec<f64>,
    /// Commanded goal or anchor (D,), moved inside the limits.
    centre: Vec<f64>,
    /// max 2B/V and max √(B/(u − l)) with the braking B, in 1/s: a tick of length h needs h·max parts, of up to dt one.
    pub(super) substep_rate: f64,
}

clone_in_place!(Limiter {
    active,
    synchronous,
    is_free,
    slows,
    bounds,
    jerk,
    has_jerk,
    before,
    turns,
    kept_at,
    limited,
    excess,
    ranges,
    centre,
    substep_rate
});

impl Limiter {
    /// Returns no limits for a primitive.
    pub(super) fn none(primitive: &Primitive) -> Self {
        let (ranges, n_dofs) = (primitive.ranges(), primitive.n_dofs());
        let min_range = MIN_RANGE_RATIO * largest_range(ranges);
        let infinite = F64x4::splat(f64::INFINITY);
        let none =
            Bounds { lower: -infinite, upper: infinite, velocity: infinite, acceleration: infinite, braking: infinite };
        Self {
            active: false,
            synchronous: true,
            is_free: true,
            slows: false,
            bounds: vec![none; groups(n_dofs)],
            jerk: vec![f64::INFINITY; n_dofs],
            has_jerk: false,
            before: vec![[F64x4::ZERO; 3]; groups(n_dofs)],
            turns: primitive.rotation_dofs().map(LimitedTurn::none).collect(),
            kept_at: -1.0,
            limited: vec![None; n_dofs],
            excess: vec![F64x4::ZERO; groups(n_dofs)],
            ranges: ranges.iter().map(|range| range.max(min_range).max(f64::MIN_POSITIVE)).collect(),
            centre: vec![0.0; n_dofs],
            substep_rate: 0.0,
        }
    }

    /// Sets the limits, for movements of a `duration` and ticks of `dt` seconds.
    ///
    /// # Errors
    /// Limits that [`Limits::check`] rejects. They then remain unchanged.
    pub(super) fn set(&mut self, limits: &Limits, duration: f64, dt: f64) -> Result<()> {
        let n_dofs = self.centre.len();
        limits.check(n_dofs)?;
        let infinity = f64::INFINITY;
        let distance =
            |dof: usize| limit_of_dof(&limits.upper, dof, infinity) - limit_of_dof(&limits.lower, dof, -infinity);
        for turn in &mut self.turns {
            turn.limits = limits.of_rotation(turn.dof);
        }
        let turns = &self.turns;
        let plain = |limits: &Option<Vec<f64>>, dof: usize| {
            let is_turn = turns.iter().any(|turn| turn.dofs().contains(&dof));
            if is_turn { infinity } else { limit_of_dof(limits, dof, infinity) }
        };
        let velocity = |dof: usize| plain(&limits.velocity, dof);
        let acceleration = |dof: usize| plain(&limits.acceleration, dof);
        let braking = |dof: usize| {
            let possible = if acceleration(dof) < infinity {
                acceleration(dof)
            } else {
                let velocity = velocity(dof).min(FREE_VELOCITY * self.ranges[dof] / duration);
                velocity * velocity / (2.0 * BRAKING_SHARE * distance(dof).min(self.ranges[dof]))
            };
            // Harder braking would turn a DoF round within a tick.
            possible.min(0.5 * velocity(dof) / dt).min(distance(dof) / (dt * dt))
        };
        let rate = |dof: usize| (2.0 * braking(dof) / velocity(dof)).max((braking(dof) / distance(dof)).sqrt());
        let substep_rate = (0..n_dofs).map(rate).fold(0.0, f64::max);
        for (group, bounds) in self.bounds.iter_mut().enumerate() {
            let lanes = |number: &dyn Fn(usize) -> f64, none: f64| {
                F64x4::new(std::array::from_fn(|lane| {
                    let dof = group * WIDTH + lane;
                    if dof < n_dofs { number(dof) } else { none }
                }))
            };
            *bounds = Bounds {
                lower: lanes(&|dof| limit_of_dof(&limits.lower, dof, -infinity), -infinity),
                upper: lanes(&|dof| limit_of_dof(&limits.upper, dof, infinity), infinity),
                velocity: lanes(&velocity, infinity),
                acceleration: lanes(&acceleration, infinity),
                braking: lanes(&braking, infinity),
            };
        }
        let Limits { lower, upper, velocity, acceleration, jerk, synchronous } = limits;
        let is_finite = |vector: &Option<Vec<f64>>| vector.iter().flatten().any(|limit| limit.is_finite());
        self.active = [lower, upper, velocity, acceleration].into_iter().any(is_finite);
        self.synchronous = *synchronous;
        for (dof, limit) in self.jerk.iter_mut().enumerate() {
            *limit = limit_of_dof(jerk, dof, infinity);
        }
        self.has_jerk = is_finite(jerk);
        self.substep_rate = substep_rate;
        Ok(())
    }

    /// Returns whether there are limits.
    #[inline(always)]
    pub(super) fn is_active(&self) -> bool {
        self.active
    }

    /// Returns whether limits of velocity or acceleration bound the rate of the clock.
    pub(super) fn limits_rate(&self) -> bool {
        let finite = |limit: F64x4| limit.to_array().iter().any(|limit| limit.is_finite());
        let by_bounds = self.bounds.iter().any(|bounds| finite(bounds.velocity) || finite(bounds.acceleration));
        self.synchronous && (by_bounds || self.limits_turns())
    }

    /// Returns whether a rotation has limits.
    pub(super) fn limits_turns(&self) -> bool {
        self.turns.iter().any(|turn| turn.limits.are_finite())
    }

    /// Returns whether a jerk is limited.
    #[inline(always)]
    pub(super) fn has_jerk(&self) -> bool {
        self.has_jerk
    }

    /// Returns the DoFs of a group whose jerk is limited.
    pub(super) fn jerk_limited(&self, group: usize) -> F64x4 {
        if self.has_jerk { self.mask(group, |dof| self.jerk[dof].is_finite()) } else { F64x4::ZERO }
    }

    /// Returns the DoFs of a group that `test` holds for.
    pub(super) fn mask(&self, group: usize, test: impl Fn(usize) -> bool) -> F64x4 {
        let lanes = std::array::from_fn(|lane| {
            let dof = group * WIDTH + lane;
            f64::from(u8::from(dof < self.jerk.len() && test(dof)))
        });
        F64x4::new(lanes).simd_gt(F64x4::ZERO)
    }

    /// Returns the limit that determined the acceleration of each DoF in the last tick.
    pub(super) fn limited(&self) -> &[Option<Limit>] {
        &self.limited
    }

    /// Returns the goal or anchor closest to the commanded one inside the limits.
    pub(super) fn accept<'a>(&'a mut self, commanded: &'a [f64]) -> &'a [f64] {
        if !self.active {
            return commanded;
        }
        for (group, (accepted, commanded)) in self.centre.chunks_mut(WIDTH).zip(commanded.chunks(WIDTH)).enumerate() {
            let Bounds { lower, upper, .. } = self.bounds[group];
            unpad(padded(commanded).max(lower).min(upper), accepted);
        }
        &self.centre
    }

    /// Sets the motion at the start of a tick.
    pub(super) fn begin(&mut self, position: &[F64x4], velocity: &[F64x4], acceleration: &[F64x4]) {
        for (group, before) in self.before.iter_mut().enumerate() {
            *before = [position[group], velocity[group], acceleration[group]];
        }
    }

    /// Keeps the motion at the end of the tick that ended at a time, before the first command after it changes the motion at once.
    /// Limits that are set before the next tick count from there. Returns whether it was not kept yet.
    pub(super) fn keep(&mut self, time: f64, position: &[F64x4], velocity: &[F64x4], acceleration: &[F64x4]) -> bool {
        let is_first = self.kept_at != time;
        if is_first {
            self.begin(position, velocity, acceleration);
            self.kept_at = time;
        }
        is_first
    }

    /// Sets the residual rotations at the start of a tick, after a command has expressed the same rotations by others.
    pub(super) fn place_turns(&mut self, position: &[F64x4]) {
        for turn in &self.turns {
            for (group, lane) in turn.dofs().map(place) {
                self.before[group][0].as_mut_array()[lane] = position[group].as_array()[lane];
            }
        }
    }

    /// Reduces accelerations at the start of a tick to their limits. A limited jerk would reduce them for so long that the DoF
    /// could not stop.
    pub(super) fn reduce_accelerations(&mut self) {
        for ([_, _, acceleration], bounds) in self.before.iter_mut().zip(&self.bounds) {
            *acceleration = acceleration.max(-bounds.acceleration).min(bounds.acceleration);
        }
    }

    /// Forgets which DoFs were limited.
    pub(super) fn clear(&mut self) {
        self.is_free = true;
        self.kept_at = -1.0;
        self.limited.fill(None);
    }

    /// Returns the limits; infinite elements are none.
    pub(super) fn limits(&self) -> Limits {
        let n_dofs = self.centre.len();
        let vector = |limit: fn(&Bounds) -> F64x4| {
            let lanes = self.bounds.iter().flat_map(|bounds| limit(bounds).to_array());
            Some(lanes.take(n_dofs).collect())
        };
        let mut limits = Limits {
            lower: vector(|bounds| bounds.lower),
            upper: vector(|bounds| bounds.upper),
            velocity: vector(|bounds| bounds.velocity),
            acceleration: vector(|bounds| bounds.acceleration),
            jerk: Some(self.jerk.clone()),
            synchronous: self.synchronous,
        };
        for turn in &self.turns {
            let AngularLimits { velocity, acceleration } = turn.limits;
            for (limits, limit) in [(&mut limits.velocity, velocity), (&mut limits.acceleration, acceleration)] {
                limits.iter_mut().for_each(|limits| limits[turn.dofs()].fill(limit));
            }
        }
        limits
    }

    /// Visits the state, with the bounds of a quantity in units of a DoF, for movements of a `duration` and ticks of `dt`
    /// seconds.
    pub(super) fn walk(&mut self, visit: &mut Visitor, quantity: [f64; 2], duration: f64, dt: f64) -> Result<()> {
        let mut limits = self.limits();
        let Limits { lower, upper, velocity, acceleration, jerk, synchronous } = &mut limits;
        visit_flag(visit, synchronous)?;
        for vector in [lower, upper, velocity, acceleration, jerk].into_iter().flatten() {
            visit(vector, [f64::NEG_INFINITY, f64::INFINITY])?;
        }
        self.set(&limits, duration, dt)?;
        visit_flag(visit, &mut self.is_free)?;
        visit_flag(visit, &mut self.slows)?;
        visit_number(visit, &mut self.kept_at, [-1.0, 1e300])?;
        for lanes in self.before.iter_mut().flatten() {
            visit(lanes.as_mut_array(), quantity)?;
        }
        self.turns.iter_mut().try_for_each(|turn| walk_turning(visit, &mut turn.before, quantity))?;
        let kinds = [None, Some(Limit::Position), Some(Limit::Velocity), Some(Limit::Acceleration), Some(Limit::Jerk)];
        for limited in &mut self.limited {
            let mut index = kinds.iter().position(|kind| kind == limited).map_or(0.0, |index| index as f64);
            visit_number(visit, &mut index, [0.0, 4.0])?;
            *limited = kinds[index as usize];
        }
        Ok(())
    }
}
