//! Transpose of a rollout: inner products of cotangents with the unit responses of one movement, without the responses.
//!
//! Over a substep the state x = [e; z] relative to the frame and the forcing w obey x⁺ = P·x + F·[w, w⁺, w′, w′⁺]. With the
//! cotangents λ of x, added up from the last sample to the first,
//!
//! ```text
//! λ = Pᵀλ⁺ + ∂L/∂x,     ŵ = Fᵀλ⁺ + ∂L/∂w,     ⟨v, Rⱼ⟩ = Σ ŵ·wⱼ + λ(0)·xⱼ(0)
//! ```
//!
//! for unit styles with forcing wⱼ and initial states xⱼ(0), those of the limit cycle. Within a cell of the forcing table ŵ is
//! added up by powers of the clock, so that its cubics are read once. A start and a start velocity take the place of the
//! state of the style: their cotangents are those of e and z. With a final velocity the frame is displaced by q (`goal` of the
//! controller), whose end depends on all of them.

mod schedule;

use crate::dynamics::forcing_table::TableIndex;
use crate::dynamics::forcing_transpose::add_sample;
use crate::dynamics::output_system::{Attractor, RestingPropagator, State};
use crate::dynamics::transport::TransportSample;
use crate::error::Result;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::motion::response_products::Product;
use crate::motion::rollout::{Clock, TimeGrid};
use crate::numerics::simd::{F64x4, Kernel, Register, WIDTH, compute_many, groups, padded, unpad};
use schedule::{NO_SAMPLE, Point, Schedule, Substep};

/// Returns the products of the cotangents (T·D,) of positions and, as far as there are more, of velocities and accelerations
/// of a movement. Those with the styles are net of a start and a start velocity.
///
/// # Errors
/// Conditions that do not fit the primitive.
pub(super) fn products(
    primitive: &Primitive,
    conditions: &Conditions,
    grid: TimeGrid,
    cotangents: &[&[f64]],
) -> Result<Product> {
    let mut clock = Clock::of(primitive, conditions)?;
    let units = clock.velocity_units();
    let resolved = clock.conditions(conditions).complete(primitive)?;
    let n_samples = cotangents[0].len() / primitive.n_dofs();
    let ticks = Schedule::of_ticks(primitive, &resolved, &mut clock, grid.dt, n_samples);
    let mut sums = Sums::new(primitive);
    compute_many(Backward { primitive, schedule: &ticks, cotangents, sums: &mut sums });
    let mut product = Product::zeros(primitive.n_styles(), primitive.n_dofs());
    if resolved.has_goal_velocity {
        sums.arrive(primitive);
    }
    let (lag, tau) = (primitive.transport.lag(0.0).value, resolved.tau);
    for (index, group) in sums.groups.iter_mut().enumerate() {
        let [e, z] = group.state;
        for (to, lanes) in [
            (&mut product.centre, group.centre),
            (&mut product.start, group.start + e * (1.0 + lag)),
            (&mut product.velocity, z * (tau / units[0])),
            (&mut product.goal_velocity, group.arrival * (tau / units[1])),
        ] {
            let end = to.len().min((index + 1) * WIDTH);
            unpad(lanes, &mut to[index * WIDTH..end]);
        }
        if resolved.start.is_some() {
            group.state[0] = F64x4::ZERO;
        }
        if resolved.velocity.is_some() {
            // z(0) = τẏ(0) − w(0).
            group.forcing[0] -= z;
            group.state[1] = F64x4::ZERO;
        }
    }
    // The limit cycle is followed from phase 0 on.
    let lead_in = Schedule::of_phase(primitive, resolved.phase);
    compute_many(Backward { primitive, schedule: &lead_in, cotangents: &[], sums: &mut sums });
    sums.add_forcing(primitive, lead_in.first);
    for (group, GroupSums { state: [e, z], .. }) in sums.groups.iter().enumerate() {
        for (sum, cycle) in sums.styles.iter_mut().zip(&primitive.cycle[group * primitive.n_styles()..]) {
            *sum += *e * cycle.e + *z * cycle.z;
        }
    }
    product.styles.iter_mut().zip(&sums.styles).for_each(|(to, sum)| *to = sum.reduce_add());
    Ok(product)
}

/// Cotangents of a group of DoFs, added up from the last sample on.
#[derive(Clone, Copy, Default)]
struct GroupSums {
    /// Those of e and z.
    state: [F64x4; 2],
    /// Those of w and w′ at the clock.
    forcing: [F64x4; 2],
    /// Those of the coefficients of the present cubic.
    cubic: [F64x4; 4],
    centre: F64x4,
    start: F64x4,
    /// Those of q(u_end) and q′(u_end), from the motion before.
    transition: [F64x4; 2],
    /// That of q′(u_end) in all.
    arrival: F64x4,
    /// Those of e and z at u_end.
    end: [F64x4; 2],
}

/// Cotangents of a movement.
struct Sums {
    groups: Vec<GroupSums>,
    /// Position of the present cubics.
    index: TableIndex,
    /// Products with unit styles, by lanes.
    styles: Vec<F64x4>,
}

impl Sums {
    fn new(primitive: &Primitive) -> Self {
        let groups = vec![GroupSums::default(); groups(primitive.n_dofs())];
        Self { groups, index: TableIndex::default(), styles: vec![F64x4::ZERO; primitive.n_styles()] }
    }

    /// Adds the cotangents of the end of the transition to those of the state at the start and of the styles.
    ///
    /// q(u_end) = −e and q′(u_end) = τẏ_g − z − w for the state that would arrive.
    fn arrive(&mut self, primitive: &Primitive) {
        let [[ee, ez], [ze, zz]] = primitive.attractor().propagator(primitive.canonical().extent()).resting.transition;
        for (index, group) in self.groups.iter_mut().enumerate() {
            let [value, slope] = group.transition;
            let (e, z) = (-(value + group.end[0]), -(slope + group.end[1]));
            group.arrival = -z;
            group.state = [group.state[0] + e * ee + z * ze, group.state[1] + e * ez + z * zz];
            for (sum, (state, w)) in self.styles.iter_mut().zip(primitive.arrivals(index)) {
                let State { e: own, z: own_z } = state;
                *sum += e * own + z * (own_z + w);
            }
        }
    }

    /// Adds the products with the cubics of the present cell, and goes to another.
    #[inline(always)]
    fn enter<T: Register>(&mut self, primitive: &Primitive, index: TableIndex) {
        if !index.is_in_cell_of(self.index) {
            for group in 0..self.groups.len() {
                let cubic = std::mem::take(&mut self.groups[group].cubic);
                primitive.forcing_table().contract::<T>(self.index, group, &cubic, &mut self.styles);
            }
        }
        self.index = index;
    }

    /// Adds the cotangents of w and w′ at a point, which is the last one.
    fn add_forcing(&mut self, primitive: &Primitive, point: Point) {
        self.enter::<F64x4>(primitive, point.index);
        for group in &mut self.groups {
            group.cubic = add_gated(group.cubic, &point, std::mem::take(&mut group.forcing));
        }
        self.enter::<F64x4>(primitive, TableIndex::NONE);
    }
}

/// Adds the cotangents of w and w′ at a point to those of the coefficients of its cubic.
#[inline(always)]
fn add_gated<T: Register>(cubic: [T; 4], point: &Point, [w, slope]: [T; 2]) -> [T; 4] {
    let [r, r_slope, phase_rate] = point.gate;
    add_sample(cubic, point.index.t, [w * r + slope * r_slope, slope * (r * phase_rate)])
}

/// Kernel of [`products`].
struct Backward<'a> {
    primitive: &'a Primitive,
    schedule: &'a Schedule,
    cotangents: &'a [&'a [f64]],
    sums: &'a mut Sums,
}

impl Kernel for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(mut self) {
        let attractor = self.primitive.attractor();
        for i in (0..self.schedule.substeps.len()).rev() {
            let Substep { to, propagator, sample, leaves_end } = &self.schedule.substeps[i];
            if *sample != NO_SAMPLE {
                self.add_motion::<T>(attractor, *sample, to);
            }
            self.step_back::<T>(*propagator, to);
            if *leaves_end {
                self.leave_end::<T>();
            }
        }
        if !self.cotangents.is_empty() {
            self.add_motion::<T>(attractor, 0, &self.schedule.first);
        }
    }
}

impl Backward<'_> {
    /// Adds the cotangents of the motion at a sample.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    fn add_motion<T: Register>(&mut self, attractor: Attractor, sample: usize, at: &Point) {
        let Self { primitive, schedule, cotangents, sums } = self;
        let [rate, change, square] = schedule.rates[sample];
        let lag = primitive.transport.lag(at.u);
        let transition = schedule.transition.filter(|_| !at.is_past).map(|end| transition(at.u, end));
        let (n_dofs, stiffness) = (primitive.n_dofs(), attractor.alpha_z * attractor.beta_z);
        for index in 0..sums.groups.len() {
            let group = &mut sums.groups[index];
            let row = sample * n_dofs + index * WIDTH..sample * n_dofs + n_dofs.min((index + 1) * WIDTH);
            let position = T::load(&padded(&cotangents[0][row.clone()]));
            let (mut flow, mut bend) = (T::default(), T::default());
            if cotangents.len() > 1 {
                flow = T::load(&padded(&cotangents[1][row.clone()])) * rate;
            }
            if cotangents.len() > 2 {
                let acceleration = T::load(&padded(&cotangents[2][row]));
                flow = flow + acceleration * change;
                bend = acceleration * square;
            }
            let [e, z] = T::load_all([&group.state[0], &group.state[1]]);
            let [w, slope] = T::load_all([&group.forcing[0], &group.forcing[1]]);
            group.state = [(e + position - bend * stiffness).store(), (z + flow - bend * attractor.alpha_z).store()];
            group.forcing = [(w + flow).store(), (slope + bend).store()];
            group.centre = (T::load(&group.centre) + position).store();
            let TransportSample { value, slope, bend: curve } = lag;
            group.start = (T::load(&group.start) - (position * value + flow * slope + bend * curve)).store();
            if let Some(ends) = &transition {
                for k in 0..2 {
                    let [value, slope, curve] = ends[k];
                    let sum = T::load(&group.transition[k]) + (position * value + flow * slope + bend * curve);
                    group.transition[k] = sum.store();
                }
            }
        }
    }

    /// Passes the cotangents over a substep that ends at `to` to its begin.
    #[inline(always)]
    fn step_back<T: Register>(&mut self, propagator: usize, to: &Point) {
        let Self { primitive, schedule, sums, .. } = self;
        sums.enter::<T>(primitive, to.index);
        let RestingPropagator { transition: [[ee, ez], [ze, zz]], forcing: [by_e, by_z] } =
            &schedule.propagators[propagator].resting;
        for index in 0..sums.groups.len() {
            let group = &mut sums.groups[index];
            let [e, z] = T::load_all([&group.state[0], &group.state[1]]);
            let [w, slope] = T::load_all([&group.forcing[0], &group.forcing[1]]);
            let [a, b, c, d] = &group.cubic;
            let cubic = T::load_all([a, b, c, d]);
            let end = [w + (e * by_e[1] + z * by_z[1]), slope + (e * by_e[3] + z * by_z[3])];
            let [a, b, c, d] = add_gated(cubic, to, end);
            group.cubic = [a.store(), b.store(), c.store(), d.store()];
            group.forcing = [(e * by_e[0] + z * by_z[0]).store(), (e * by_e[2] + z * by_z[2]).store()];
            group.state = [(e * *ee + z * *ze).store(), (e * *ez + z * *zz).store()];
        }
    }

    /// Adds the cotangents of the forcing at the begin of a substep that leaves the end of a discrete movement.
    #[inline(always)]
    fn leave_end<T: Register>(&mut self) {
        let Self { primitive, sums, .. } = self;
        let end = Point::new(primitive, primitive.canonical().extent(), true);
        sums.enter::<T>(primitive, end.index);
        for index in 0..sums.groups.len() {
            let group = &mut sums.groups[index];
            group.cubic = add_gated(group.cubic, &end, std::mem::take(&mut group.forcing));
            group.end = group.state;
        }
    }
}

/// Returns q and its derivatives at clock `u` of transitions from rest to q(u_end) = 1, and to q′(u_end) = 1.
fn transition(u: f64, end: f64) -> [[f64; 3]; 2] {
    let (s, rate) = ((u / end).clamp(0.0, 1.0), 1.0 / end);
    let quintic = |c: [f64; 3], scale: f64| {
        let [a, b, c] = c.map(|c| c * scale);
        [
            s * s * s * (a + s * (b + s * c)),
            s * s * (3.0 * a + s * (4.0 * b + s * 5.0 * c)) * rate,
            s * (6.0 * a + s * (12.0 * b + s * 20.0 * c)) * (rate * rate),
        ]
    };
    [quintic([10.0, -15.0, 6.0], 1.0), quintic([-4.0, 7.0, -3.0], end)]
}
