//! Limits of the angular velocity and acceleration of rotations.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/poses.rs"]
mod poses;
#[path = "common/random.rs"]
mod random;
#[path = "common/rare_commands.rs"]
mod rare_commands;

use std::sync::{Arc, LazyLock};

use common::*;
use ndarray::{Array1, Array2, s};
use pdmp_core::model::Frame;
use pdmp_core::motion::{Limit, Limits, Margins, TimeGrid, Vary, fastest, fastest_tau, feasible, nearest_feasible};
use pdmp_core::{Command, Conditions, Controller, Error, FitOptions, Kind, LimitError, Model, Status, fit, rollout};
use poses::*;
use random::Random;
use rare_commands::*;

/// Screws of a tool: three positions and a rotation.
static SCREW: LazyLock<Arc<Model>> = LazyLock::new(|| Arc::new(model_of_screws(IDENTITY, IDENTITY, Frame::Body)));
/// Wobbling cycles of a rotation alone, whose angular velocity is in the world frame.
static WOBBLE: LazyLock<Arc<Model>> = LazyLock::new(|| {
    let options = FitOptions::new(Kind::Rhythmic).frame(Frame::World);
    Arc::new(fit(&wobbles(4, 1.0, 100).iter().map(turning).collect::<Vec<_>>(), &options).unwrap())
});

const IDENTITY: Quaternion = [1.0, 0.0, 0.0, 0.0];

/// Fits screws seen from another world with another tool.
fn model_of_screws(world: Quaternion, tool: Quaternion, frame: Frame) -> Model {
    let options = FitOptions::new(Kind::Discrete).frame(frame);
    let turned = |poses| pose(in_frames(&poses, world, tool, &mut Random(1)));
    fit(&screws(5, 4.0, 0.5, 101, 1).into_iter().map(turned).collect::<Vec<_>>(), &options).unwrap()
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn transposed(m: Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// Published motion of the rotation: the quaternion, and the angular velocity and acceleration in the body frame and in the world
/// frame.
#[derive(Clone, Copy, Debug)]
struct Turn {
    q: Quaternion,
    omega: [[f64; 3]; 2],
    acceleration: [[f64; 3]; 2],
}

impl Turn {
    fn of(controller: &Controller, frame: Frame) -> Self {
        let n = controller.position().len();
        let q: Quaternion = std::array::from_fn(|i| controller.position()[n - 4 + i]);
        let n = controller.velocity().len();
        let in_frames = |vector: &[f64]| {
            let own: [f64; 3] = std::array::from_fn(|i| vector[n - 3 + i]);
            match frame {
                Frame::Body => [own, apply(matrix(q), own)],
                Frame::World => [apply(transposed(matrix(q)), own), own],
            }
        };
        Self { q, omega: in_frames(controller.velocity()), acceleration: in_frames(controller.acceleration()) }
    }

    /// Returns by how much a tick of length `h` to another motion exceeds the limits, relative to them.
    fn excess(&self, to: &Self, h: f64, velocity: f64, acceleration: f64) -> f64 {
        let rounding = 4e-15 * (norm(self.omega[0]) + norm(to.omega[0]));
        let change = |frame: usize| {
            let change = norm(minus(to.omega[frame], self.omega[frame])) - rounding;
            change / (acceleration * h) - 1.0
        };
        // The sine of half an angle is below half of it; a command may move a rotation by rounding errors.
        let turned = 2.0 * times(back(self.q), to.q)[1..].iter().map(|x| x * x).sum::<f64>().sqrt().min(1.0);
        let angle = (turned - 1e-13) / (velocity * h) - 1.0;
        let size = norm(to.omega[0]) / velocity - 1.0;
        let bend = norm(to.acceleration[0]) / acceleration - 1.0;
        change(0).max(change(1)).max(angle).max(size).max(bend)
    }
}

/// Limits of the rotation, which has the last three DoFs, alone.
fn angular(model: &Model, velocity: f64, acceleration: f64) -> Limits {
    let vector = |limit: f64| {
        let n = model.n_dofs();
        Some((0..n).map(|dof| if dof + 3 >= n { limit } else { f64::INFINITY }).collect())
    };
    Limits { velocity: vector(velocity), acceleration: vector(acceleration), ..Limits::default() }
}

fn frame(model: &Model) -> Frame {
    model.primitive().coordinates().unwrap().frame()
}

/// Random position with a unit quaternion.
fn random_place(model: &Model, scale: f64, random: &mut Random) -> Vec<f64> {
    let n = model.n_coordinates();
    let rotation = random_rotation(random);
    (0..n - 4).map(|_| scale * random.between(-1.0, 1.0)).chain(rotation).collect()
}

/// No sequence of commands, measurements, coupling terms and tick lengths leaves the limits of a rotation, in any frame.
#[test]
fn no_command_leaves_the_limits() {
    let mut random = Random(7);
    let (mut ticks, mut limited) = (0, 0);
    for case in 0..60 {
        let model = [&*SCREW, &*WOBBLE][case % 2];
        let (n, j, frame) = (model.n_dofs(), model.n_styles(), frame(model));
        let discrete = model.kind() == Kind::Discrete;
        let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
        let (velocity, acceleration) = (random.scale(0.1, 30.0), random.scale(1.0, 1000.0));
        let mut limits = angular(model, velocity, acceleration);
        limits.synchronous = case % 4 < 2;
        controller.set_limits(&limits).unwrap();
        controller.step().unwrap();
        let mut before = Turn::of(&controller, frame);
        let mut inside = norm(before.omega[0]) <= velocity;
        for tick in 0..2000 {
            let h = if case % 3 == 0 { 1e-3 } else { random.scale(1e-6, 0.1) };
            let scale = random.scale(0.1, 100.0);
            let (goal, measured) = (random_place(model, 0.3, &mut random), random_place(model, 0.3, &mut random));
            let terms: Vec<f64> = (0..n).map(|_| scale * random.between(-1.0, 1.0)).collect();
            let style: Vec<f64> = (0..j).map(|_| random.between(-2.0, 2.0)).collect();
            let numbers = Numbers { centre: &goal, style: &style, measured: &measured, terms: &terms };
            let command = rare_command(model, h, &numbers, &mut random);
            let phase = (!discrete && rare(&mut random)).then(|| random.between(0.0, 6.0));
            let command = Command { phase, ..command };
            controller.step_with(&command).unwrap();
            let after = Turn::of(&controller, frame);
            let motion = [controller.position(), controller.velocity(), controller.acceleration()];
            assert!(motion.into_iter().flatten().all(|x| x.is_finite()), "{case} {tick}");
            // A rhythmic movement may start faster than its limits, and is inside them once it has braked.
            let most = if inside { velocity } else { f64::INFINITY };
            let excess = before.excess(&after, h, most, acceleration);
            assert!(excess <= 1e-9, "{case} {tick}: {excess}, {before:?} to {after:?} in {h}");
            inside |= norm(after.omega[0]) <= velocity;
            before = after;
            ticks += 1;
            limited += usize::from(controller.limited()[n - 1].is_some());
            if rare(&mut random) {
                controller.set_speed(random.between(0.0, 2.0).floor()).unwrap();
            }
            if rare(&mut random) {
                controller.release();
            }
            if rare(&mut random) && !discrete {
                controller.set_phase(random.between(0.0, 6.0)).unwrap();
            }
            let now = Turn::of(&controller, frame);
            assert!(norm(minus(now.omega[1], before.omega[1])) <= 1e-12 * velocity, "{case} {tick}");
        }
        assert!(inside);
    }
    assert!(limited > ticks / 10, "{limited} of {ticks}");
}

/// Limits that do not bind leave the motion as it is, to the last bit.
#[test]
fn wide_limits_change_nothing() {
    for model in [&*SCREW, &*WOBBLE] {
        let controller = || Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
        let (mut free, mut limited) = (controller(), controller());
        limited.set_limits(&angular(model, 1e3, 1e6)).unwrap();
        let goal = random_place(model, 0.3, &mut Random(2));
        for tick in 0..3000 {
            let command = match model.kind() {
                Kind::Discrete => Command { goal: (tick == 300).then_some(&goal), ..Command::default() },
                Kind::Rhythmic => Command { anchor: (tick == 300).then_some(&goal), ..Command::default() },
            };
            assert_eq!(free.step_with(&command).unwrap(), limited.step_with(&command).unwrap());
            assert_eq!(
                (free.position(), free.velocity(), free.acceleration()),
                (limited.position(), limited.velocity(), limited.acceleration())
            );
            assert!(limited.limited().iter().all(Option::is_none));
        }
    }
}

/// Limits without slack stretch a movement in time, on its path, and it ends at its goal; the rotation is named.
#[test]
fn limits_slow_the_movement_on_its_path() {
    let model = &*SCREW;
    let mut free = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
    let (mut path, mut peaks) = (Vec::new(), [0.0f64; 2]);
    while free.step().unwrap() == Status::Working {
        let turn = Turn::of(&free, Frame::Body);
        peaks = [peaks[0].max(norm(turn.omega[0])), peaks[1].max(norm(turn.acceleration[0]))];
        path.push((free.phase(), turn.q));
    }
    let mut limited = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
    let (velocity, acceleration) = (0.5 * peaks[0], 0.3 * peaks[1]);
    limited.set_limits(&angular(model, velocity, acceleration)).unwrap();
    let mut before = Turn::of(&limited, Frame::Body);
    let (mut named, mut off, mut k, mut fastest) = ([0, 0], 0.0f64, 0, 0.0f64);
    while limited.step().unwrap() == Status::Working {
        let turn = Turn::of(&limited, Frame::Body);
        assert!(before.excess(&turn, 1e-3, velocity, acceleration) <= 1e-9);
        fastest = fastest.max(norm(turn.omega[0]) / velocity);
        before = turn;
        match limited.limited()[5] {
            Some(Limit::Velocity) => named[0] += 1,
            Some(Limit::Acceleration) => named[1] += 1,
            _ => {}
        }
        while k + 2 < path.len() && path[k + 1].0 > limited.phase() {
            k += 1;
        }
        // The chord between neighbours on the free path.
        let (from, to) = (path[k], path[k + 1]);
        if from.0 - to.0 > 1e-9 && k > 0 && k + 2 < path.len() {
            let share = (from.0 - limited.phase()) / (from.0 - to.0);
            let between = times(from.1, turn_by(times(back(from.1), to.1), share));
            off = off.max(angle(between, turn.q));
        }
        assert!(limited.time() < 10.0);
    }
    assert!(named[0] > 100 && named[1] > 100, "{named:?}");
    assert!(off < 1e-4, "{off}");
    assert!(limited.time() > 1.4 * free.time());
    let goal = model.rollout_end();
    assert!(angle(before.q, goal) < 0.02);
}

/// Returns the largest |ω| and |ω̇| of a rotation that has the last three DoFs.
fn peaks(velocity: &Array2<f64>, acceleration: &Array2<f64>) -> [f64; 2] {
    [velocity, acceleration].map(|rows| {
        let own = rows.slice(s![.., -3..]);
        own.rows().into_iter().map(|row| row.dot(&row).sqrt()).fold(0.0, f64::max)
    })
}

/// The smallest constant τ reaches one of the limits, and a sampled movement confirms it; so do the margins.
#[test]
fn fastest_tau_reaches_a_limit() {
    let mut random = Random(4);
    let model = &*SCREW;
    for case in 0..12 {
        let style: Vec<f64> = (0..model.n_styles()).map(|_| random.between(-1.0, 1.0)).collect();
        let conditions = Conditions {
            style: Some(style),
            goal: (case % 2 == 1).then(|| random_place(model, 0.3, &mut random)),
            ..Conditions::default()
        };
        let (velocity, acceleration) = (random.scale(0.5, 5.0), random.scale(3.0, 100.0));
        let mut limits = angular(model, velocity, acceleration);
        if case % 3 == 0 {
            limits.velocity.as_mut().unwrap()[0] = 0.1;
        }
        let tau = fastest_tau(model.primitive(), &limits, &conditions).unwrap();
        let at = |tau: f64| Conditions { tau: Some(tau), ..conditions.clone() };
        let grid =
            TimeGrid { dt: 2e-4 * tau / model.tau(), duration: Some(1.5 * model.duration() * tau / model.tau()) };
        let movement = rollout(model.primitive(), &at(tau), grid).unwrap();
        let [fast, hard] = peaks(&movement.velocity, &movement.acceleration);
        let other = movement.velocity.column(0).fold(0.0f64, |most, v| most.max(v.abs())) / 0.1;
        let ratio = (fast / velocity).max(hard / acceleration).max(if case % 3 == 0 { other } else { 0.0 });
        assert!((ratio - 1.0).abs() < 1e-5, "{case}: {ratio}");
        let margins: Margins = feasible(model.primitive(), &limits, &at(tau)).unwrap();
        assert!(margins.is_feasible());
        assert!(!feasible(model.primitive(), &limits, &at(0.999 * tau)).unwrap().is_feasible());
        if fast > (1.0 - 1e-6) * velocity {
            assert_eq!(margins.velocity.unwrap().dof, model.n_dofs() - 3);
        }
    }
}

/// Conditions nearest to infeasible ones keep the limits, and those between both do not; hopeless limits are named.
#[test]
fn nearest_feasible_conditions_keep_the_limits() {
    let mut random = Random(6);
    let model = &*SCREW;
    let mut n_changed = 0;
    for case in 0..12 {
        let style: Vec<f64> = (0..model.n_styles()).map(|_| random.between(-2.0, 2.0)).collect();
        let conditions = Conditions { style: Some(style.clone()), ..Conditions::default() };
        let grid = TimeGrid { dt: 1e-3, duration: None };
        let movement = rollout(model.primitive(), &conditions, grid).unwrap();
        let [fast, hard] = peaks(&movement.velocity, &movement.acceleration);
        let share = [random.between(0.9, 1.0), random.between(0.85, 1.1)];
        let limits = angular(model, share[0] * fast, share[1] * hard);
        let vary = [Vary::Style, Vary::Both, Vary::Goal][case % 3];
        let found = match nearest_feasible(model, &limits, &conditions, vary) {
            Ok(found) => found,
            Err(error) => {
                assert!(matches!(error, Error::Limits(LimitError::Infeasible { dof: 3, .. })), "{error}");
                continue;
            }
        };
        assert!(feasible(model.primitive(), &limits, &found).unwrap().is_feasible());
        n_changed += 1;
        if vary != Vary::Style {
            continue;
        }
        let new = found.style.clone().unwrap();
        for part in [0.5, 0.9, 0.99] {
            let between = style.iter().zip(&new).map(|(from, to)| from + part * (to - from)).collect();
            let between = Conditions { style: Some(between), ..Conditions::default() };
            assert!(!feasible(model.primitive(), &limits, &between).unwrap().is_feasible(), "{case} {part}");
        }
    }
    assert!(n_changed > 6, "{n_changed}");
    let hopeless = angular(model, 0.01, 100.0);
    let error = nearest_feasible(model, &hopeless, &Conditions::default(), Vary::Both).unwrap_err();
    assert!(error.to_string().contains("DoF 3") && error.to_string().contains("velocity reaches"), "{error}");
    assert!(error.to_string().contains("times as long"), "{error}");
}

/// The fastest movement keeps the limits, follows the path, and uses them: at almost every sample one of them is nearly reached.
#[test]
fn fastest_movement_keeps_and_uses_the_limits() {
    let mut random = Random(9);
    let model = &*SCREW;
    let end = |rows: &Array2<f64>| rotation(rows.row(rows.nrows() - 1), 3);
    for _ in 0..8 {
        let style: Vec<f64> = (0..model.n_styles()).map(|_| random.between(-1.0, 1.0)).collect();
        let conditions = Conditions { style: Some(style), ..Conditions::default() };
        let (velocity, acceleration) = (random.scale(0.5, 5.0), random.scale(3.0, 100.0));
        let limits = angular(model, velocity, acceleration);
        let movement = fastest(model.primitive(), &limits, &conditions, 1e-3).unwrap();
        let [fast, hard] = peaks(&movement.velocity, &movement.acceleration);
        assert!(fast <= 1.005 * velocity && hard <= 1.01 * acceleration, "{} {}", fast / velocity, hard / acceleration);
        let size = |rows: &Array2<f64>, k: usize| norm(std::array::from_fn(|i| rows[[k, 3 + i]]));
        let n = movement.time.len();
        let used = (1..n - 1).filter(|&k| {
            size(&movement.velocity, k) > 0.97 * velocity || size(&movement.acceleration, k) > 0.95 * acceleration
        });
        assert!(used.count() as f64 > 0.9 * (n - 2) as f64);
        let tau = fastest_tau(model.primitive(), &limits, &conditions).unwrap();
        let constant = model.duration() * tau / model.tau();
        assert!(movement.time[n - 1] < constant, "{} {constant}", movement.time[n - 1]);
        let grid = TimeGrid { dt: model.duration() / 1000.0, duration: None };
        let nominal = rollout(model.primitive(), &conditions, grid).unwrap();
        assert!(angle(end(&movement.position), end(&nominal.position)) < 1e-4);
    }
}

/// The limited motion of a model fitted in another world with another tool is the same movement seen from there, whichever frame
/// its angular velocities are in: along the path, and where each DoF is limited on its own and measured. A measurement within
/// limits along the path is not compared, as the rate at which it is left there amplifies rounding errors.
#[test]
fn limited_motion_does_not_depend_on_the_frames() {
    let mut random = Random(11);
    let [world, tool] = [(); 2].map(|()| random_rotation(&mut random));
    let other = Arc::new(model_of_screws(world, tool, Frame::World));
    for synchronous in [true, false] {
        let start = |model: &Arc<Model>| {
            let mut controller = Controller::new(model.primitive(), 2e-3, &Conditions::default(), None).unwrap();
            controller.set_limits(&Limits { synchronous, ..angular(model, 2.0, 12.0) }).unwrap();
            controller
        };
        let (mut here, mut there) = (start(&SCREW), start(&other));
        let (mut off, mut n_limited) = (0.0f64, 0);
        for tick in 0..1500 {
            let mut goal = vec![0.1, 0.2, 0.1];
            let present = rotation(Array1::from(here.position().to_vec()).view(), 3);
            goal.extend(times(present, turn([1.0, 0.3, -0.6], 1.0)));
            let turned = in_frame(&goal, world, tool);
            let command = |place| Command {
                goal: (tick == 200).then_some(place),
                measured: (!synchronous && tick % 300 == 250).then_some(place),
                tau: (tick == 500).then(|| 0.4 * SCREW.tau()),
                ..Command::default()
            };
            here.step_with(&command(&goal)).unwrap();
            there.step_with(&command(&turned)).unwrap();
            let [a, b] = [Turn::of(&here, Frame::Body), Turn::of(&there, Frame::World)];
            let expected = apply(matrix(world), a.omega[1]);
            off = off.max(angle(times(times(world, a.q), tool), b.q)).max(norm(minus(expected, b.omega[1])));
            let expected = in_frame(here.position(), world, tool);
            off = (0..3).map(|i| (expected[i] - there.position()[i]).abs()).fold(off, f64::max);
            n_limited += usize::from(here.limited()[3].is_some());
            assert_eq!(here.limited(), there.limited(), "{tick}");
        }
        assert!(off < 1e-9, "{synchronous} {off:e}");
        assert!(n_limited > 300, "{synchronous} {n_limited}");
    }
}

/// Limits without meaning are refused by one clear error, and leave the last ones in force.
#[test]
fn bad_limits_of_rotations_are_refused() {
    let model = &*SCREW;
    let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
    let kept = angular(model, 2.0, 10.0);
    controller.set_limits(&kept).unwrap();
    assert_eq!(controller.limits().velocity, kept.velocity);
    let infinity = f64::INFINITY;
    let unequal = Some(vec![infinity, infinity, infinity, 2.0, 2.5, 2.0]);
    for (limits, text) in [
        (
            Limits { velocity: unequal.clone(), ..Limits::default() },
            "DoF 4: a limit of 2.5 for the velocity, of DoF 3 2;",
        ),
        (
            Limits { acceleration: unequal, ..Limits::default() },
            "DoF 4: a limit of 2.5 for the acceleration, of DoF 3 2;",
        ),
        (Limits { upper: Some(vec![3.0]), ..Limits::default() }, "DoF 3: a rotation has no limit of the position"),
        (
            Limits { acceleration: Some(vec![9.0]), jerk: Some(vec![1e3]), ..Limits::default() },
            "DoF 3: a rotation has no limit of the jerk",
        ),
    ] {
        let error = controller.set_limits(&limits).unwrap_err();
        assert!(error.to_string().contains(text), "{error}");
        assert!(matches!(error, Error::Limits(LimitError::OfRotation { .. } | LimitError::UnequalOfRotation { .. })));
        assert!(fastest_tau(model.primitive(), &limits, &Conditions::default()).is_err());
        assert!(feasible(model.primitive(), &limits, &Conditions::default()).is_err());
    }
    assert_eq!(controller.limits().velocity, kept.velocity);
    // One number serves all DoFs.
    let one = Limits { velocity: Some(vec![1.0]), ..Limits::default() };
    controller.set_limits(&one).unwrap();
    assert_eq!(controller.limits().velocity, Some(vec![1.0; 6]));
}

/// Limits count from the angular velocity of the last tick, though a command has changed the motion at once since then; a movement
/// restored from a snapshot continues to the bit while it is limited.
#[test]
fn limited_motion_continues_across_commands_and_snapshots() {
    for model in [&*SCREW, &*WOBBLE] {
        let frame = frame(model);
        let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), Some(0.0)).unwrap();
        for _ in 0..400 {
            controller.step().unwrap();
        }
        let before = Turn::of(&controller, frame);
        controller.set_tau(0.3 * model.tau()).unwrap();
        assert!(norm(minus(Turn::of(&controller, frame).omega[1], before.omega[1])) > 0.5);
        controller.set_limits(&angular(model, 20.0, 5.0)).unwrap();
        controller.step().unwrap();
        let mut after = Turn::of(&controller, frame);
        assert!(before.excess(&after, 1e-3, 20.0, 5.0) <= 1e-9);
        let mut moving = f64::NAN;
        for tick in 0..600 {
            let mut restored = Controller::restore(model.primitive(), &controller.snapshot()).unwrap();
            if tick == 300 {
                controller.set_speed(0.0).unwrap();
                restored.set_speed(0.0).unwrap();
                moving = norm(after.omega[0]);
            }
            controller.step().unwrap();
            restored.step().unwrap();
            assert_eq!(
                (controller.position(), controller.velocity(), controller.acceleration()),
                (restored.position(), restored.velocity(), restored.acceleration()),
            );
            let now = Turn::of(&controller, frame);
            assert!(after.excess(&now, 1e-3, 20.0, 5.0) <= 1e-9, "{tick}");
            after = now;
        }
        // In the pause the rotation slows with its limit.
        let rest = (moving - 5.0 * 0.3).max(0.0);
        assert!(moving > 0.5 && (norm(after.omega[0]) - rest).abs() < 1e-6, "{moving} {}", norm(after.omega[0]));
    }
}

fn turn_by(q: Quaternion, share: f64) -> Quaternion {
    let half = q[1..].iter().map(|x| x * x).sum::<f64>().sqrt().atan2(q[0].abs());
    let sign = q[0].signum();
    turn([sign * q[1], sign * q[2], sign * q[3]], 2.0 * half * share)
}

trait End {
    fn rollout_end(&self) -> Quaternion;
}

impl End for Model {
    fn rollout_end(&self) -> Quaternion {
        let grid = TimeGrid { dt: 1e-3, duration: Some(3.0 * self.duration()) };
        let movement = rollout(self.primitive(), &Conditions::default(), grid).unwrap();
        rotation(movement.position.row(movement.time.len() - 1), self.n_coordinates() - 4)
    }
}
