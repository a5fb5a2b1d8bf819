//! Time of a tick of 4096 movements, D = 7 and J = 3: together, and as single controllers.
//!
//! The movements are at one clock, as environments that were reset together, at clocks over the whole movement, or have durations
//! of their own, between 0.8 and 1.5 of the model's.
#![allow(missing_docs)]

mod control_loop;

use std::time::{Duration, Instant};

use control_loop::model;
use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::Array2;
use pdmp_core::motion::{Commands, Controllers, Motions};
use pdmp_core::numerics::Threads;
use pdmp_core::{Command, Conditions, Controller, Model, Motion};

const N: usize = 4096;
const D: usize = 7;
/// Ticks between two restarts: the middle of a movement of a thousand.
const TICKS: usize = 300;

/// Returns the ticks before the measured ones, of movement `b`.
fn warm_up(b: usize, spread: bool) -> usize {
    if spread { 5 + 600 * b / N } else { 300 }
}

/// Returns the conditions of movement `b`: durations of neighbours differ, as the golden section spreads them.
fn conditions(b: usize, model: &Model, has_own_tau: bool) -> Conditions {
    let tau = model.tau() * (0.8 + 0.7 * (b as f64 * 0.618_033_988_749_895).fract());
    Conditions { tau: has_own_tau.then_some(tau), ..Conditions::default() }
}

/// Movements that can be stepped and restarted.
trait Movements: Clone {
    fn tick(&mut self, goals: Option<&Array2<f64>>);
}

#[derive(Clone)]
struct Together {
    controllers: Controllers,
    rows: [Vec<f64>; 3],
}

impl Movements for Together {
    fn tick(&mut self, goals: Option<&Array2<f64>>) {
        let [position, velocity, acceleration] = &mut self.rows;
        let mut motions = Motions { position, velocity, acceleration };
        match goals {
            None => self.controllers.step(None, &mut motions).expect("a tick"),
            Some(goals) => {
                let commands = Commands { goal: Some(goals.view()), ..Commands::default() };
                self.controllers.update(&commands, None, &mut motions).expect("a tick");
            }
        }
    }
}

#[derive(Clone)]
struct Alone {
    controllers: Vec<Controller>,
    rows: [Vec<f64>; 3],
}

impl Movements for Alone {
    fn tick(&mut self, goals: Option<&Array2<f64>>) {
        let [position, velocity, acceleration] = &mut self.rows;
        for (b, controller) in self.controllers.iter_mut().enumerate() {
            let row = b * D..(b + 1) * D;
            let mut motion = Motion {
                position: &mut position[row.clone()],
                velocity: &mut velocity[row.clone()],
                acceleration: &mut acceleration[row],
            };
            let goal = goals.map(|goals| &goals.as_slice().expect("rows")[b * D..(b + 1) * D]);
            controller.update(&Command { goal, ..Command::default() }, &mut motion).expect("a tick");
        }
    }
}

/// Returns the time of `n` ticks, with a copy of the movements every [`TICKS`].
fn time<M: Movements>(movements: &M, goals: Option<&Array2<f64>>, n: u64) -> Duration {
    let (mut time, mut remaining) = (Duration::ZERO, n);
    while remaining > 0 {
        let ticks = remaining.min(TICKS as u64);
        let mut movements = movements.clone();
        movements.tick(goals);
        let begin = Instant::now();
        (0..ticks).for_each(|_| movements.tick(None));
        time += begin.elapsed();
        remaining -= ticks;
    }
    time
}

fn controllers(criterion: &mut Criterion) {
    let model = model(D, 3);
    let rows = || [(); 3].map(|()| vec![0.0; N * D]);
    let goals = Array2::from_shape_fn((N, D), |(b, d)| 1.0 + 1e-4 * b as f64 + 0.1 * d as f64);
    let mut group = criterion.benchmark_group("tick of 4096 movements, D=7 J=3");
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    for (clocks, spread, has_own_tau) in
        [("one clock", false, false), ("spread clocks", true, false), ("own durations", false, true)]
    {
        let conditions: Vec<_> = (0..N).map(|b| conditions(b, &model, has_own_tau)).collect();
        let mut controllers = Controllers::new(model.primitive(), 1e-3, &conditions, None).expect("some");
        let mut together = rows();
        for k in 0..warm_up(N, spread) {
            let mask: Vec<bool> = (0..N).map(|b| k < warm_up(b, spread)).collect();
            let [position, velocity, acceleration] = &mut together;
            controllers.step(Some(&mask), &mut Motions { position, velocity, acceleration }).expect("a tick");
        }
        let several = Threads::new(2).expect("some");
        let on_two = Together { controllers: controllers.clone().with_threads(several), rows: together.clone() };
        let together = Together { controllers, rows: together };
        let mut alone: Vec<_> = conditions
            .iter()
            .map(|conditions| Controller::new(model.primitive(), 1e-3, conditions, None).expect("one"))
            .collect();
        for (b, controller) in alone.iter_mut().enumerate() {
            (0..warm_up(b, spread)).for_each(|_| {
                controller.step().expect("a tick");
            });
        }
        let alone = Alone { controllers: alone, rows: rows() };
        for (load, goals) in [("settled", None), ("to new goals", Some(&goals))] {
            group.bench_function(format!("together, {load}, {clocks}"), |bench| {
                bench.iter_custom(|n| time(&together, goals, n));
            });
            group.bench_function(format!("together, {load}, {clocks}, two threads"), |bench| {
                bench.iter_custom(|n| time(&on_two, goals, n));
            });
            group.bench_function(format!("single, {load}, {clocks}"), |bench| {
                bench.iter_custom(|n| time(&alone, goals, n));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, controllers);
criterion_main!(benches);
