//! Controllers stepped together move as single controllers do, to the bit, and allocate nothing.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/counting.rs"]
mod counting;
#[path = "common/poses.rs"]
mod poses;

use std::sync::Arc;

use common::*;
use counting as random;
use counting::{Random, allocations};
use ndarray::Array2;
use pdmp_core::motion::{Commands, Controllers, Limits, Motions};
use pdmp_core::numerics::Threads;
use pdmp_core::{Command, Conditions, Controller, Demonstration, Kind, Model, Sampling, Status};
use poses::{pose, screws, turning, wobbles};

/// More than one block of the steady tick, and a rest.
const N: usize = 37;
const DT: f64 = 1.5e-3;

/// Output of all movements.
struct Rows {
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

impl Rows {
    fn new(model: &Model) -> Self {
        let zeros = |n: usize| vec![0.0; N * n];
        Self {
            position: zeros(model.n_coordinates()),
            velocity: zeros(model.n_dofs()),
            acceleration: zeros(model.n_dofs()),
        }
    }

    fn motions(&mut self) -> Motions<'_> {
        let Self { position, velocity, acceleration } = self;
        Motions { position, velocity, acceleration }
    }
}

/// Random commands of all movements.
struct Load {
    style: Array2<f64>,
    centre: Array2<f64>,
    goal_velocity: Array2<f64>,
    tau: Vec<f64>,
    amplitude: Vec<f64>,
    speed: Vec<f64>,
    phase: Vec<f64>,
    mask: Vec<bool>,
}

impl Load {
    fn new(model: &Model) -> Self {
        let zeros = |n: usize| Array2::zeros((N, n));
        Self {
            style: zeros(model.n_styles()),
            centre: zeros(model.n_coordinates()),
            goal_velocity: zeros(model.n_dofs()),
            tau: vec![0.0; N],
            amplitude: vec![0.0; N],
            speed: vec![0.0; N],
            phase: vec![0.0; N],
            mask: vec![true; N],
        }
    }

    /// Draws new commands.
    fn draw(&mut self, model: &Model, random: &mut Random) {
        self.style.iter_mut().for_each(|x| *x = random.between(-1.0, 1.0));
        self.centre.iter_mut().for_each(|x| *x = random.between(-1.0, 1.0));
        self.goal_velocity.iter_mut().for_each(|x| *x = random.between(-1.0, 1.0));
        if model.n_coordinates() > model.n_dofs() {
            for mut row in self.centre.rows_mut() {
                let first = row.len() - 4;
                let norm = row.iter().skip(first).map(|x| x * x).sum::<f64>().sqrt();
                row.iter_mut().skip(first).for_each(|x| *x /= norm);
            }
        }
        self.tau.iter_mut().for_each(|tau| *tau = model.tau() * random.scale(0.4, 2.0));
        self.amplitude.iter_mut().for_each(|amplitude| *amplitude = random.between(0.0, 2.0));
        self.speed.iter_mut().for_each(|speed| *speed = random.between(0.2, 2.0).round().max(0.3));
        self.phase.iter_mut().for_each(|phase| *phase = random.between(0.0, 6.0));
    }

    fn mask(&mut self, random: &mut Random) {
        self.mask.iter_mut().for_each(|selected| *selected = random.next() < 0.8);
    }
}

/// Random fields of a command.
#[derive(Clone, Copy)]
struct Given([bool; 8]);

impl Given {
    fn draw(random: &mut Random, model: &Model, has_transport: bool) -> Self {
        let discrete = model.kind() == Kind::Discrete;
        let mut given = [(); 8].map(|()| random.next() < 0.3);
        given[2] &= discrete && has_transport;
        given[4] &= !discrete;
        given[6] &= !discrete;
        given[5] &= random.next() < 0.3;
        Self(given)
    }

    fn commands<'a>(&self, load: &'a Load, kind: Kind) -> Commands<'a> {
        let Self([style, centre, goal_velocity, tau, amplitude, measured, phase, speed]) = *self;
        let discrete = kind == Kind::Discrete;
        Commands {
            style: style.then(|| load.style.view()),
            goal: (centre && discrete).then(|| load.centre.view()),
            anchor: (centre && !discrete).then(|| load.centre.view()),
            goal_velocity: goal_velocity.then(|| load.goal_velocity.view()),
            tau: tau.then_some(&load.tau[..]),
            amplitude: amplitude.then_some(&load.amplitude[..]),
            speed: speed.then_some(&load.speed[..]),
            measured: measured.then(|| load.centre.view()),
            phase: phase.then_some(&load.phase[..]),
        }
    }

    fn command<'a>(&self, load: &'a Load, kind: Kind, b: usize) -> Command<'a> {
        let commands = self.commands(load, kind);
        let row = |rows: Option<ndarray::ArrayView2<'a, f64>>| {
            rows.map(|rows| rows.index_axis_move(ndarray::Axis(0), b).to_slice().unwrap())
        };
        let number = |numbers: Option<&[f64]>| numbers.map(|numbers| numbers[b]);
        Command {
            style: row(commands.style),
            goal: row(commands.goal),
            anchor: row(commands.anchor),
            goal_velocity: row(commands.goal_velocity),
            tau: number(commands.tau),
            amplitude: number(commands.amplitude),
            measured: row(commands.measured),
            phase: number(commands.phase),
            ..Command::default()
        }
    }
}

fn poses_of(kind: Kind) -> Arc<Model> {
    let demos: Vec<_> = match kind {
        Kind::Discrete => screws(5, 4.0, 0.5, 101, 1).into_iter().map(pose).collect(),
        Kind::Rhythmic => wobbles(4, 1.0, 100).iter().map(turning).collect(),
    };
    learn(&demos, &options(kind))
}

/// Returns a model of more degrees of freedom, those of the demonstrations in turn: of two, three and four groups of registers.
fn wide(demos: &[Demonstration], n_dofs: usize) -> Arc<Model> {
    let widened = |demo: &Demonstration| {
        let (rows, columns) = demo.position().dim();
        let of = |(c, d): (usize, usize)| demo.position()[[c, d % columns]] * (1.0 + 0.1 * d as f64);
        let position = Array2::from_shape_fn((rows, n_dofs), of);
        Demonstration::new(position, Sampling::Uniform { dt: 0.01 }).unwrap()
    };
    let kind = if demos[0].n_dofs() == 3 { Kind::Discrete } else { Kind::Rhythmic };
    learn(&demos.iter().map(widened).collect::<Vec<_>>(), &options(kind))
}

fn limits(model: &Model) -> Limits {
    let scaled = |scale: f64| Some(model.ranges().iter().map(|range| scale * range).collect::<Vec<_>>());
    Limits { velocity: scaled(3.0), acceleration: scaled(30.0), synchronous: false, ..Limits::default() }
}

/// Movements under random commands, masks, restarts, speeds and limits have the motion, the status, the time and the phase of
/// single controllers to the bit: discrete and rhythmic ones, with learnt and immediate transport, of positions and poses, on one
/// thread and on several.
#[test]
fn controllers_move_as_single_ones_to_the_bit() {
    let mut paper = options(Kind::Discrete);
    paper.canonical = common::immediate();
    let immediate = learn(&reaches(), &paper);
    let models = [
        Arc::clone(&REACH),
        Arc::clone(&CYCLE),
        immediate,
        poses_of(Kind::Discrete),
        poses_of(Kind::Rhythmic),
        wide(&reaches(), 7),
        wide(&cycles(), 10),
        wide(&reaches(), 14),
    ];
    for (number, model) in models.iter().enumerate() {
        let (kind, primitive) = (model.kind(), model.primitive());
        let is_pose = model.n_coordinates() > model.n_dofs();
        let mut random = Random(7 + number as u64);
        let start = |random: &mut Random| Conditions {
            style: Some((0..model.n_styles()).map(|_| random.between(-1.0, 1.0)).collect()),
            tau: Some(model.tau() * random.scale(0.5, 2.0)),
            ..Conditions::default()
        };
        let conditions: Vec<_> = (0..N).map(|_| start(&mut random)).collect();
        // With the long tick, a movement takes several substeps.
        for (dt, threads) in [(DT, 1), (7.0 * DT, 1), (7.0 * DT, 3)] {
            let together = Controllers::new(primitive, dt, &conditions, None).unwrap();
            let mut together = together.with_threads(Threads::new(threads).unwrap());
            let mut alone: Vec<_> =
                conditions.iter().map(|one| Controller::new(primitive, dt, one, None).unwrap()).collect();
            let (mut rows, mut load, mut statuses) = (Rows::new(model), Load::new(model), vec![Status::Working; N]);
            let mut expected = Rows::new(model);
            let (mut commanded, mut finished, mut steady) = (0, 0, 0);
            for _ in 0..2000 {
                load.mask(&mut random);
                let is_masked = random.next() < 0.5;
                let mask = is_masked.then_some(&load.mask.clone()[..]).map(<[bool]>::to_vec);
                let mask = mask.as_deref();
                let given = (random.next() < 0.01).then(|| {
                    load.draw(model, &mut random);
                    Given::draw(&mut random, model, number != 2)
                });
                // A repeated command has no effect.
                match given {
                    Some(given) => {
                        commanded += 1;
                        together.update(&given.commands(&load, kind), mask, &mut rows.motions()).unwrap();
                    }
                    None => together.step(mask, &mut rows.motions()).unwrap(),
                }
                for (b, controller) in alone.iter_mut().enumerate() {
                    if mask.is_some_and(|mask| !mask[b]) {
                        continue;
                    }
                    if let Some(speed) = given.and_then(|given| given.commands(&load, kind).speed)
                        && speed[b] != controller.speed()
                    {
                        controller.set_speed(speed[b]).unwrap();
                    }
                    statuses[b] = match given {
                        Some(given) => controller.step_with(&given.command(&load, kind, b)).unwrap(),
                        None => controller.step().unwrap(),
                    };
                    let (n, d) = (model.n_coordinates(), model.n_dofs());
                    expected.position[b * n..][..n].copy_from_slice(controller.position());
                    expected.velocity[b * d..][..d].copy_from_slice(controller.velocity());
                    expected.acceleration[b * d..][..d].copy_from_slice(controller.acceleration());
                }
                assert_eq!(rows.position, expected.position);
                assert_eq!(rows.velocity, expected.velocity);
                assert_eq!(rows.acceleration, expected.acceleration);
                assert_eq!(together.statuses(), statuses);
                steady += together.n_steady();
                finished += statuses.iter().filter(|status| **status == Status::Finished).count();
                let b = (random.next() * N as f64) as usize;
                if random.next() < 1e-3 {
                    // A copy, and one with other shares, move on as the original would.
                    let threads = Threads::new(if threads == 1 { 1 } else { 2 + b % 3 }).unwrap();
                    together = if b < 4 { together.clone() } else { together.with_threads(threads) };
                }
                match (random.next() * 400.0) as usize {
                    0..4 => {
                        let conditions = start(&mut random);
                        together.reset(&[b], std::slice::from_ref(&conditions)).unwrap();
                        alone[b].reset(&conditions).unwrap();
                        statuses[b] = Status::Working;
                    }
                    4 => {
                        let speed = random.between(0.0, 2.0);
                        together.set_speed(b, speed).unwrap();
                        alone[b].set_speed(speed).unwrap();
                    }
                    5 if !is_pose => {
                        let limits = if random.next() < 0.3 { limits(model) } else { Limits::default() };
                        together.set_limits(b, &limits).unwrap();
                        alone[b].set_limits(&limits).unwrap();
                    }
                    6 => {
                        together.release(b).unwrap();
                        alone[b].release();
                    }
                    7..50 => {
                        let (found, controller) = (together.get(b).unwrap(), &alone[b]);
                        assert_eq!(found.snapshot(), controller.snapshot());
                        assert_eq!((found.time(), found.phase()), (controller.time(), controller.phase()));
                    }
                    _ => {}
                }
            }
            assert!(commanded > 5, "{commanded}");
            assert!(kind == Kind::Rhythmic || finished > 1000, "{finished}");
            assert!(rows.position.iter().all(|x| x.is_finite()));
            assert!(is_pose || steady > 1000, "{steady}");
        }
    }
}

/// Between commands most movements are steady ones: the others would hide an error of those.
#[test]
fn movements_become_steady() {
    for (model, dt) in [(&*REACH, DT), (&*CYCLE, DT), (&*REACH, 0.02), (&*CYCLE, 0.02)] {
        let mut together = Controllers::new(model.primitive(), dt, &vec![Conditions::default(); N], None).unwrap();
        let mut rows = Rows::new(model);
        for _ in 0..10 {
            together.step(None, &mut rows.motions()).unwrap();
        }
        assert_eq!(together.n_steady(), N);
        let tau = [0.7 * model.tau(); N];
        together.update(&Commands { tau: Some(&tau), ..Commands::default() }, None, &mut rows.motions()).unwrap();
        assert_eq!(together.n_steady(), 0);
        together.update(&Commands { tau: Some(&tau), ..Commands::default() }, None, &mut rows.motions()).unwrap();
    }
}

/// The rows of whole blocks are those of single controllers, with registers that the degrees of freedom fill and that they do not.
#[test]
fn rows_of_whole_blocks_are_complete() {
    for n_dofs in [1, 4, 5, 7, 8, 10, 12, 14, 16, 18] {
        let model = wide(&reaches(), n_dofs);
        let (dt, all) = (1e-3 * model.tau(), vec![Conditions::default(); N]);
        let mut together = Controllers::new(model.primitive(), dt, &all, None).unwrap();
        let mut alone = Controller::new(model.primitive(), dt, &all[0], None).unwrap();
        let mut rows = Rows::new(&model);
        for _ in 0..20 {
            together.step(None, &mut rows.motions()).unwrap();
            alone.step().unwrap();
            let expected = [alone.position(), alone.velocity(), alone.acceleration()];
            for (found, expected) in [&rows.position, &rows.velocity, &rows.acceleration].into_iter().zip(expected) {
                assert!(found.chunks(n_dofs).all(|row| row == expected), "{n_dofs}");
            }
        }
        assert_eq!(together.n_steady(), N);
    }
}

/// Ticks with and without commands, masks and changed rates allocate nothing.
#[test]
fn ticks_of_controllers_allocate_nothing() {
    for (model, threads) in [(&*REACH, 1), (&*CYCLE, 1), (&*REACH, 3)] {
        let kind = model.kind();
        let mut random = Random(3);
        let together = Controllers::new(model.primitive(), DT, &vec![Conditions::default(); N], None).unwrap();
        let mut together = together.with_threads(Threads::new(threads).unwrap());
        let (mut rows, mut load) = (Rows::new(model), Load::new(model));
        let mut counted = 0;
        for _ in 0..20_000 {
            load.mask(&mut random);
            load.draw(model, &mut random);
            let given = Given::draw(&mut random, model, true);
            let before = allocations();
            if random.next() < 0.01 {
                together.update(&given.commands(&load, kind), Some(&load.mask), &mut rows.motions()).unwrap();
            } else {
                together.step(Some(&load.mask), &mut rows.motions()).unwrap();
            }
            counted += allocations() - before;
        }
        assert_eq!(counted, 0);
    }
}

/// A rejected argument changes no movement, and is named.
#[test]
fn rejected_arguments_change_nothing() {
    let mut together = Controllers::new(REACH.primitive(), DT, &vec![Conditions::default(); N], None).unwrap();
    let mut rows = Rows::new(&REACH);
    let mut goals = Array2::zeros((N, 3));
    goals[[N - 1, 2]] = f64::NAN;
    let short = Array2::zeros((N - 1, 3));
    let columns = Array2::zeros((3, N));
    let update = |together: &mut Controllers, rows: &mut Rows, commands: Commands, mask: Option<&[bool]>| {
        together.update(&commands, mask, &mut rows.motions()).unwrap_err().argument().map(str::to_string)
    };
    let none = Commands::default;
    for (commands, argument) in [
        (Commands { goal: Some(goals.view()), ..none() }, "goal"),
        (Commands { goal: Some(short.view()), ..none() }, "goal"),
        (Commands { goal: Some(columns.t()), ..none() }, "goal"),
        (Commands { anchor: Some(columns.view()), ..none() }, "anchor"),
        (Commands { tau: Some(&[-1.0; N]), ..none() }, "tau"),
        (Commands { tau: Some(&[1.0; 2]), ..none() }, "tau"),
        (Commands { speed: Some(&[-1.0; N]), ..none() }, "speed"),
    ] {
        assert_eq!(update(&mut together, &mut rows, commands, None).as_deref(), Some(argument));
    }
    assert_eq!(update(&mut together, &mut rows, none(), Some(&[true; 2])).as_deref(), Some("mask"));
    assert_eq!(together.get(0).unwrap().time(), 0.0);
    // The row that is not finite belongs to a movement that the tick leaves out.
    let mut mask = [true; N];
    mask[N - 1] = false;
    together.update(&Commands { goal: Some(goals.view()), ..none() }, Some(&mask), &mut rows.motions()).unwrap();
    assert!(together.reset(&[N], &[Conditions::default()]).is_err());
    assert!(together.reset(&[0, 1], &[Conditions::default()]).is_err());
    assert!(Controllers::new(REACH.primitive(), DT, &[], None).is_err());
    rows.velocity.pop();
    assert!(together.step(None, &mut rows.motions()).is_err());
}
