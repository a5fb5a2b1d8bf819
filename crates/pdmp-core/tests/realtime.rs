//! Real-time safety of the control loop: no allocation, lock or blocking system call in a million ticks of random commands.
//!
//! A counting allocator detects allocations. `make rtsan` compiles the same ticks with the real-time sanitizer of a nightly
//! compiler, which ends the process at an allocation, a lock or any other system call that may block.
#![cfg(feature = "learning")]
#![allow(missing_docs)]
#![cfg_attr(rtsan, feature(sanitize))]

mod common;
#[path = "common/counting.rs"]
mod counting;
#[path = "common/poses.rs"]
mod poses;

use std::hint::black_box;

use common::*;
use counting as random;
use counting::{Random, allocations};
use pdmp_core::motion::{Compliance, Coupling, Limits};
use pdmp_core::{Command, Conditions, Controller, Demonstration, Kind, Motion};
use poses::{pose, screws, turning, wobbles};

/// A controller with the memory of its caller.
struct Loop {
    controller: Controller,
    /// Limits that are set in turn: none, tight ones, and others that are loose or absent.
    limits: [Limits; 3],
    limits_set: usize,
    limited: usize,
    random: Random,
    values: Vec<f64>,
    /// Random position, with unit quaternions.
    place: Vec<f64>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

impl Loop {
    fn new(kind: Kind) -> Self {
        let demos = if kind == Kind::Discrete { reaches() } else { cycles() };
        Self::of(&demos, kind)
    }

    /// Returns the loop of a model of poses.
    fn of_poses(kind: Kind) -> Self {
        let demos: Vec<_> = match kind {
            Kind::Discrete => screws(5, 4.0, 0.5, 101, 1).into_iter().map(pose).collect(),
            Kind::Rhythmic => wobbles(4, 1.0, 100).iter().map(turning).collect(),
        };
        Self::of(&demos, kind)
    }

    fn of(demos: &[Demonstration], kind: Kind) -> Self {
        let model = learn(demos, &options(kind));
        let (n_dofs, n_coordinates) = (model.n_dofs(), model.n_coordinates());
        let turns = |dof: usize| n_coordinates > n_dofs && dof + 3 >= n_dofs;
        // The limits of a rotation are those of its angular velocity and acceleration.
        let limits = |share: f64, of_turn: f64| {
            let ranges = model.ranges().iter().enumerate();
            Some(ranges.map(|(dof, range)| if turns(dof) { of_turn } else { share * range }).collect::<Vec<f64>>())
        };
        let share = |share: f64| limits(share, share * f64::INFINITY);
        let mut tight = Limits { lower: share(-0.3), upper: share(0.6), ..Limits::default() };
        tight.velocity = limits(1.0, 1.0);
        tight.acceleration = limits(5.0, 5.0);
        tight.jerk = share(200.0);
        tight.synchronous = false;
        let mut other = Limits { upper: share(5.0), ..Limits::default() };
        other.acceleration = limits(100.0, 100.0);
        other.synchronous = false;
        Self {
            limits: [Limits::default(), tight, other],
            limits_set: 0,
            limited: 0,
            random: Random(1),
            values: vec![0.0; n_coordinates.max(model.n_styles())],
            place: vec![0.0; n_coordinates],
            position: vec![0.0; n_coordinates],
            velocity: vec![0.0; n_dofs],
            acceleration: vec![0.0; n_dofs],
            controller: Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap(),
        }
    }

    /// Sends one valid or invalid command by a setter, and performs one tick under another.
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    fn tick(&mut self) {
        let Self { controller, limits, limits_set, limited, random, values, place, position, velocity, acceleration } =
            self;
        let (n_dofs, n_styles) = (controller.primitive().n_dofs(), controller.primitive().n_styles());
        let (kind, nominal_tau) = (controller.primitive().kind(), controller.primitive().tau());
        values.iter_mut().for_each(|v| *v = 2.0 * random.next() - 1.0);
        // Rejected commands must be real-time safe too.
        let invalid = random.next() < 0.01;
        if invalid {
            values[0] = f64::NAN;
        }
        let n = place.len();
        place.copy_from_slice(&values[..n]);
        if let Some(coordinates) = controller.primitive().coordinates() {
            let column = coordinates.n_coordinates() - 4;
            let norm = place[column..].iter().map(|x| x * x).sum::<f64>().sqrt();
            place[column..].iter_mut().for_each(|x| *x /= norm);
        }
        let (place, vector, style, size) = (&place[..], &values[..n_dofs], &values[..n_styles], values[0].abs());
        let tau = nominal_tau * (0.5 + random.next());
        let _ = black_box(match (random.next() * 12.0) as u8 {
            0 => controller.set_style(style),
            1 => controller.set_goal(place),
            2 => controller.set_anchor(place),
            3 => controller.set_tau(tau),
            4 => controller.set_amplitude(size),
            5 => controller.set_compliance(Compliance { stopping: 1e3 * size, tracking: 10.0 * size }),
            6 => controller.step().map(drop),
            7 => controller.set_phase(10.0 * size),
            8 => controller.set_phase_gain(10.0 * size),
            9 => controller.set_goal_velocity((size < 0.5).then_some(vector)),
            10 => {
                *limits_set += 1;
                controller.set_limits(&limits[*limits_set % limits.len()])
            }
            _ => Ok(()),
        });
        if random.rarely() {
            controller.release();
            let _ = black_box(controller.set_speed(size));
        }
        let command = Command {
            dt: random.rarely().then_some(1e-3 * (0.1 + values[n_dofs - 1].abs())),
            style: random.rarely().then_some(style),
            goal: (random.rarely() && kind == Kind::Discrete).then_some(place),
            goal_velocity: (random.rarely() && kind == Kind::Discrete).then_some(vector),
            anchor: (random.rarely() && kind == Kind::Rhythmic).then_some(place),
            tau: random.rarely().then_some(tau),
            amplitude: (random.rarely() && kind == Kind::Rhythmic).then_some(size),
            measured: random.rarely().then_some(place),
            coupling: random.rarely().then_some(Coupling { velocity: vector, acceleration: vector }),
            phase: (random.rarely() && kind == Kind::Rhythmic).then_some(10.0 * values[0]),
        };
        let vectors = [command.style, command.goal, command.goal_velocity, command.anchor, command.measured];
        let uses_values = vectors.iter().any(Option::is_some)
            || command.amplitude.or(command.phase).is_some()
            || command.coupling.is_some();
        let mut motion = Motion { position, velocity, acceleration };
        assert_eq!(black_box(controller.update(&command, &mut motion)).is_err(), uses_values && invalid);
        *limited += controller.limited().iter().flatten().count();
    }
}

/// A million ticks of random commands, with and without limits, allocate nothing, and the motion stays finite.
#[test]
fn a_million_ticks_of_random_commands_allocate_nothing() {
    for kind in [Kind::Discrete, Kind::Rhythmic] {
        let mut control = Loop::new(kind);
        let before = allocations();
        for _ in 0..500_000 {
            control.tick();
        }
        assert_eq!(allocations() - before, 0);
        assert!(control.limited > 100_000, "limits bind in {} joint-ticks alone", control.limited);
        assert!([control.position, control.velocity, control.acceleration].iter().flatten().all(|x| x.is_finite()));
    }
}

/// Random commands within limits along the path allocate nothing once the first limits have been set, even while limits are
/// removed and set again.
#[test]
fn commands_within_limits_along_the_path_allocate_nothing() {
    let kinds = [Kind::Discrete, Kind::Rhythmic];
    for mut control in kinds.map(Loop::new).into_iter().chain(kinds.map(Loop::of_poses)) {
        for limits in &mut control.limits {
            (limits.synchronous, limits.jerk) = (true, None);
        }
        control.controller.set_limits(&control.limits[1]).unwrap();
        let before = allocations();
        let mut n_pending = 0;
        for _ in 0..4000 {
            control.tick();
            n_pending += usize::from(control.controller.is_pending());
        }
        assert_eq!(allocations() - before, 0);
        assert!(n_pending > 400 && control.limits_set > 100, "{n_pending} {}", control.limits_set);
    }
}

/// A million ticks of poses, whose rotations are converted in every tick, allocate nothing.
#[test]
fn a_million_ticks_of_poses_allocate_nothing() {
    for kind in [Kind::Discrete, Kind::Rhythmic] {
        let mut control = Loop::of_poses(kind);
        let before = allocations();
        for _ in 0..500_000 {
            control.tick();
            let n = control.position.len();
            let norm: f64 = control.position[n - 4..].iter().map(|x| x * x).sum();
            assert!((norm - 1.0).abs() < 1e-12, "{norm}");
        }
        assert_eq!(allocations() - before, 0);
        assert!(control.limited > 100_000, "limits bind in {} DoF-ticks alone", control.limited);
        assert!([control.position, control.velocity, control.acceleration].iter().flatten().all(|x| x.is_finite()));
    }
}

/// Extreme numbers in any field of a command are rejected without effect, or the motion stays finite.
#[test]
fn extreme_numbers_are_rejected_or_bounded() {
    const EXTREMES: [f64; 12] =
        [f64::NAN, f64::INFINITY, -f64::INFINITY, f64::MAX, -1e200, 1e150, 1e-150, 1e-300, 5e-324, -5e-324, 0.0, -0.0];
    for kind in [Kind::Discrete, Kind::Rhythmic] {
        let Loop { controller: fresh, .. } = Loop::new(kind);
        for (field, &value) in (0..11).flat_map(|field| EXTREMES.iter().map(move |value| (field, value))) {
            let mut controller = fresh.clone();
            let values = [value; 8];
            let (vector, style) = (&values[..fresh.primitive().n_dofs()], &values[..fresh.primitive().n_styles()]);
            let none = Command::default();
            let command = match field {
                0 => Command { dt: Some(value), ..none },
                1 => Command { tau: Some(value), ..none },
                2 => Command { amplitude: Some(value), ..none },
                3 => Command { style: Some(style), ..none },
                4 => Command { goal: Some(vector), ..none },
                5 => Command { anchor: Some(vector), ..none },
                6 => Command { measured: Some(vector), ..none },
                7 => Command { coupling: Some(Coupling { velocity: vector, acceleration: vector }), ..none },
                8 => Command { phase: Some(value), ..none },
                _ => none,
            };
            controller.step().unwrap();
            let set = match field {
                9 => controller.set_phase(value),
                10 => controller.set_phase_gain(value),
                _ => Ok(()),
            };
            assert!(field < 9 || set.is_err() || value.is_finite());
            let before = controller.clone();
            for _ in 0..100 {
                match tick(&mut controller, &command) {
                    Ok(_) => _ = controller.step().unwrap(),
                    Err(_) => assert_eq!(controller.position(), before.position()),
                }
            }
            let motion = [controller.position(), controller.velocity(), controller.acceleration()];
            assert!(motion.into_iter().flatten().all(|x| x.is_finite()), "{kind} {field} {value:e}: {motion:?}");
            assert!(field > 8 || value.is_finite() || controller.time() == before.time());
        }
    }
}

/// Extreme limits are rejected, or the motion within them stays finite, also under extreme commands.
#[test]
fn extreme_limits_are_rejected_or_obeyed() {
    const EXTREMES: [f64; 10] =
        [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e300, -1e200, 1e150, 1e-150, 1e-300, 5e-324, 0.0];
    let kinds = [Kind::Discrete, Kind::Rhythmic];
    for Loop { controller: fresh, limits: [_, tight, _], .. } in
        kinds.map(Loop::new).into_iter().chain(kinds.map(Loop::of_poses))
    {
        let kind = fresh.primitive().kind();
        let n_dofs = fresh.primitive().n_dofs();
        let mut accepted = 0;
        let cases = (0..4).flat_map(|field| EXTREMES.iter().map(move |value| (field, value)));
        for ((field, &value), started) in cases.flat_map(|case| [(case, false), (case, true)]) {
            let mut controller = fresh.clone();
            let mut limits = tight.clone();
            let changed = match field {
                0 => &mut limits.lower,
                1 => &mut limits.upper,
                2 => &mut limits.velocity,
                _ => &mut limits.acceleration,
            };
            *changed = Some(vec![value; n_dofs]);
            if started {
                controller.step().unwrap();
            }
            if controller.set_limits(&limits).is_err() {
                continue;
            }
            accepted += 1;
            let large = vec![if value.abs() < 1e100 { value } else { 1e100 }; n_dofs];
            for dt in [1e-3, 1e-6, 0.1, 1e-300, 5e-324, 1.0] {
                for _ in 0..20 {
                    let coupling = Coupling { velocity: &large, acceleration: &large };
                    let command = Command { dt: Some(dt), coupling: Some(coupling), ..Command::default() };
                    tick(&mut controller, &command).unwrap();
                    let motion = [controller.position(), controller.velocity(), controller.acceleration()];
                    let finite = motion.into_iter().flatten().all(|x| x.is_finite());
                    assert!(finite, "{kind} {limits:?} {dt:e}: {motion:?}");
                }
            }
        }
        assert!(accepted >= 20, "{accepted} accepted");
    }
}

/// Decaying states are flushed to zero: arithmetic on subnormal numbers takes tens of times as long.
#[test]
fn motion_at_rest_has_no_subnormal_numbers() {
    for kind in [Kind::Discrete, Kind::Rhythmic] {
        let Loop { mut controller, .. } = Loop::new(kind);
        if kind == Kind::Rhythmic {
            controller.set_amplitude(0.0).unwrap();
        }
        let normal = |x: &f64| *x == 0.0 || x.is_normal();
        for dt in [1e-3, 0.1, 10.0] {
            for _ in 0..20_000 {
                let command = Command { dt: Some(dt), ..Command::default() };
                tick(&mut controller, &command).unwrap();
                let motion = [controller.position(), controller.velocity(), controller.acceleration()];
                assert!(motion.into_iter().flatten().all(normal), "{kind} at {}: {motion:?}", controller.time());
                assert!(normal(&controller.phase()), "{kind} at {}: {:e}", controller.time(), controller.phase());
            }
        }
    }
}

/// Controls of the sanitizer: an inactive one would accept every loop.
#[cfg(rtsan)]
mod sanitizer {
    use std::hint::black_box;
    use std::process::Command;

    #[test]
    #[ignore = "ends the process; the test below runs it"]
    #[sanitize(realtime = "nonblocking")]
    fn allocates() {
        black_box(vec![0.0; black_box(3)]);
    }

    #[test]
    fn ends_a_loop_that_allocates() {
        let test = std::env::current_exe().unwrap();
        let output = Command::new(test).args(["--exact", "--ignored", "sanitizer::allocates"]).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success());
        assert!(message.contains("RealtimeSanitizer: unsafe-library-call"), "{message}");
    }
}
