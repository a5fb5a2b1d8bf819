//! The control loop agrees with an accurate numerical solution of its equations, and with closed forms after many ticks.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;

use std::f64::consts::TAU;
use std::sync::Arc;

use common::*;
use ndarray::Array2;
use pdmp_core::dynamics::Canonical;
use pdmp_core::learning::{CanonicalOptions, Truncation};
use pdmp_core::{Command, Conditions, Controller, Demonstration, Kind, Model, Sampling};

/// ω of a filter that has settled to 1 % after `transition` seconds: (1 + s)exp(−s) = 0.01.
fn omega(transition: f64) -> f64 {
    6.638_352_067_993_813 / transition
}

/// Reference solution of the equations by RK4.
///
/// The state is y relative to the frame, z, u and r, then the filtered style, rate 1/τ, centre and r₀, then the derivatives of
/// these: that of the rate with respect to time, of the others with respect to the clock in seconds at the τ of the model.
struct Reference<'a> {
    model: &'a Model,
    /// g − y₀ at the start.
    displacement: Vec<f64>,
    state: Vec<f64>,
    /// Targets of the filters of style, rate, centre and r₀.
    target: Vec<f64>,
    /// ω of the filters.
    omega: f64,
    /// Clock and displacement of a goal that the frame moves to with minimum jerk until the end.
    goal_change: Option<(f64, Vec<f64>)>,
}

impl Reference<'_> {
    fn slope(&self, state: &[f64]) -> Vec<f64> {
        let (n, n_styles) = (self.model.n_dofs(), self.model.n_styles());
        let pdmp_core::dynamics::Attractor { alpha_z, beta_z } = self.model.attractor();
        let (y, rest) = state.split_at(n);
        let (z, rest) = rest.split_at(n);
        let (u, r, filters) = (rest[0], rest[1], &rest[2..]);
        let (style, rate, centre) = (&filters[..n_styles], filters[n_styles], &filters[n_styles + 1..]);
        let amplitude = filters[n_styles + 1 + n];
        let (mut outputs, mut rises) = ([0.0; 16], [0.0; 16]);
        self.model.forcing_table().evaluate(u, &mut outputs[..n * n_styles], &mut rises[..n * n_styles]);
        let w = |d: usize| r * style.iter().enumerate().map(|(j, s)| s * outputs[j * n + d]).sum::<f64>();
        let growth = match self.model.canonical() {
            Canonical::Discrete { .. } => 0.0,
            Canonical::Rhythmic { mu } => mu * (amplitude - r),
        };
        let mut slope: Vec<f64> = (0..n).map(|d| rate * (z[d] + w(d))).collect();
        slope.extend((0..n).map(|d| rate * alpha_z * (beta_z * (centre[d] - y[d]) - z[d])));
        slope.extend([rate, rate * growth]);
        let (value, speed) = filters.split_at(self.target.len());
        let clock_rate = |i: usize| if i == n_styles { 1.0 } else { rate * self.model.tau() };
        slope.extend(speed.iter().enumerate().map(|(i, v)| clock_rate(i) * v));
        slope.extend(
            value.iter().zip(speed).zip(&self.target).enumerate().map(|(i, ((x, v), target))| {
                clock_rate(i) * (-2.0 * self.omega * v - self.omega.powi(2) * (x - target))
            }),
        );
        slope
    }

    /// Position y; the state is relative to the frame, in which the goal is at rest.
    fn position(&self, d: usize) -> f64 {
        let u = self.state[2 * self.model.n_dofs()];
        let lag = if self.model.kind() == Kind::Discrete { self.model.transport(u).unwrap() - 1.0 } else { 0.0 };
        let moved = self.goal_change.as_ref().map_or(0.0, |(from, change)| {
            let s = ((u - from) / (self.model.canonical().extent() - from)).min(1.0);
            change[d] * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
        });
        self.state[d] + self.displacement[d] * lag + moved
    }

    fn rk4(&mut self, dt: f64) {
        let add = |k: &[f64], t: f64| self.state.iter().zip(k).map(|(x, k)| x + t * k).collect::<Vec<_>>();
        let a = self.slope(&self.state);
        let b = self.slope(&add(&a, dt / 2.0));
        let c = self.slope(&add(&b, dt / 2.0));
        let d = self.slope(&add(&c, dt));
        for (i, x) in self.state.iter_mut().enumerate() {
            *x += dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
        }
    }
}

/// Returns the largest error of a control loop at `dt` over 1.5 durations, relative to the range of each DoF; `live` changes
/// all conditions during the movement.
fn error(model: &Arc<Model>, tau: f64, dt: f64, live: bool) -> f64 {
    let row = |matrix: &Array2<f64>| matrix.row(model.demonstrated().nominal).to_vec();
    let discrete = model.kind() == Kind::Discrete;
    let demonstrated = model.demonstrated();
    let centre = row(if discrete { &demonstrated.goals } else { &demonstrated.anchors });
    let (style, start, n) = (row(&demonstrated.styles), row(&demonstrated.starts), model.n_dofs());
    let conditions = Conditions {
        start: Some(start.clone()),
        velocity: (!discrete).then(|| vec![0.0; n]),
        tau: Some(tau),
        ..Conditions::default()
    };
    // The default transition, scaled to the duration of this movement.
    let transition = if discrete { 0.1 } else { 0.25 } * model.duration() * tau / model.tau();
    let mut controller = Controller::new(model.primitive(), dt, &conditions, Some(transition)).unwrap();
    let target: Vec<f64> = style.iter().copied().chain([1.0 / tau]).chain(centre.clone()).chain([1.0]).collect();
    // ẏ = ρ(z + w): at rest, or with z = 0.
    let z = controller.velocity().iter().map(|v| v * tau);
    let displacement: Vec<f64> = centre.iter().zip(&start).map(|(g, y)| if discrete { g - y } else { 0.0 }).collect();
    let lag = if discrete { model.transport(0.0).unwrap() - 1.0 } else { 0.0 };
    let state = start.iter().zip(&displacement).map(|(y, displacement)| y - displacement * lag).collect();
    let omega = omega(transition);
    let goal_change = None;
    let mut reference = Reference { model, displacement, state, target: target.clone(), omega, goal_change };
    reference.state.extend(vec![0.0; n]);
    reference.state.extend([0.0, 1.0]);
    reference.state.extend(&target);
    reference.state.extend(vec![0.0; target.len()]);
    let flow = reference.slope(&reference.state);
    let z: Vec<f64> = z.zip(&flow).map(|(v, w)| v - w * tau).collect();
    reference.state[n..2 * n].copy_from_slice(&z);

    let ticks = (1.5 * model.duration() * tau / model.tau() / dt).round() as usize;
    let mut worst = 0.0f64;
    for k in 0..ticks {
        if live && k == ticks / 4 {
            let style = [0.4, -0.3];
            // About the range of the movement.
            let offsets = [0.4, -0.5, 0.3];
            let centre: Vec<f64> = centre.iter().zip(offsets.iter().cycle()).map(|(centre, by)| centre + by).collect();
            controller.set_style(&style).unwrap();
            controller.set_tau(1.3 * tau).unwrap();
            if discrete {
                controller.set_goal(&centre).unwrap();
            } else {
                controller.set_anchor(&centre).unwrap();
                controller.set_amplitude(1.4).unwrap();
            }
            let mut centre = centre;
            if discrete && model.transport(0.0).unwrap() == 0.0 {
                let goal = row(&demonstrated.goals);
                let change = centre.iter().zip(&goal).map(|(to, from)| to - from).collect();
                reference.goal_change = Some((reference.state[2 * n], change));
                centre = goal;
            }
            let amplitude = if discrete { 1.0 } else { 1.4 };
            reference.target =
                style.iter().copied().chain([1.0 / (1.3 * tau)]).chain(centre).chain([amplitude]).collect();
        }
        controller.step().unwrap();
        // Substeps that make the error of the reference negligible, including that of the kink at u_end.
        let n_substeps = (dt / 2e-5 * model.tau() / tau).ceil() as usize;
        (0..n_substeps).for_each(|_| reference.rk4(dt / n_substeps as f64));
        for (d, y) in controller.position().iter().enumerate() {
            worst = worst.max((y - reference.position(d)).abs() / model.ranges()[d]);
        }
    }
    worst
}

/// The error is at most 1e-8 of the range at 1 kHz and 1e-6 at 100 Hz, across the demonstrated end and for movements of 0.3 s,
/// and twice that while style, goal or anchor, τ and amplitude all change.
#[test]
fn ticks_solve_the_equations() {
    // Three DoFs partly fill one register, seven two.
    let wide = |demo: &Demonstration| {
        let position = demo.position();
        let mixed = |c: usize, d: usize| position[[c, d % 3]] + 0.3 * d as f64 * position[[c, (d + 1) % 3]];
        let position = Array2::from_shape_fn((demo.n_samples(), 7), |(c, d)| mixed(c, d));
        Demonstration::new(position, Sampling::Uniform { dt: 0.01 }).unwrap()
    };
    let seven = reaches().iter().map(wide).collect();
    let cases = [
        (Kind::Discrete.into(), reaches()),
        (immediate(), reaches()),
        (Kind::Discrete.into(), seven),
        (Kind::Rhythmic.into(), cycles()),
    ];
    for (canonical, demos) in cases {
        let kind = CanonicalOptions::kind(&canonical);
        let mut options = options(kind).n_styles(Truncation::Rank(2));
        options.canonical = canonical;
        let model = learn(&demos, &options);
        for tau in [model.tau(), 0.3 / model.duration() * model.tau()] {
            for live in [false, true] {
                for (dt, bound) in [(1e-3, 1e-8), (1e-2, 1e-6)] {
                    let error = error(&model, tau, dt, live);
                    let bound = if live { 2.0 * bound } else { bound };
                    assert!(error <= bound, "{kind} tau {tau:.3} dt {dt} live {live}: {error:e} > {bound:e}");
                }
            }
        }
    }
}

/// Phase and time of a rhythmic movement agree with the closed forms after a hundred million ticks.
#[test]
fn a_hundred_million_ticks_accumulate_no_error() {
    let model = learn(&cycles(), &options(Kind::Rhythmic));
    let (ticks, dt, tau) = (100_000_000u32, 1.1e-3, 0.37 * model.tau());
    let conditions = Conditions { tau: Some(tau), ..Conditions::default() };
    let mut controller = Controller::new(model.primitive(), dt, &conditions, None).unwrap();
    for _ in 0..ticks {
        controller.step().unwrap();
    }
    let time = f64::from(ticks) * dt;
    assert!((controller.time() - time).abs() <= 1e-9 * time, "{} {time}", controller.time());
    let error = (controller.phase() - time / tau).rem_euclid(TAU);
    assert!(error.min(TAU - error) <= 1e-6, "{error:e}");
}

/// Ticks of different lengths lead to the same position as equal ones.
#[test]
fn tick_length_may_change_at_every_tick() {
    for (kind, demos) in [(Kind::Discrete, reaches()), (Kind::Rhythmic, cycles())] {
        let model = learn(&demos, &options(kind));
        let make = || Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
        let (mut even, mut uneven) = (make(), make());
        for _ in 0..100 {
            (0..20).for_each(|_| _ = even.step().unwrap());
            for dt in [7e-4, 1e-6, 4.299e-3, 1e-2, 5e-3] {
                tick(&mut uneven, &Command { dt: Some(dt), ..Command::default() }).unwrap();
            }
            for (a, b) in even.position().iter().zip(uneven.position()) {
                assert!((a - b).abs() < 1e-7, "{kind} at {}: {:e}", even.time(), a - b);
            }
        }
    }
}
