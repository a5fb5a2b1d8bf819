//! Times of one tick within limits beside rsruckig, in one run: medians, tails and ratios. Times of the fastest movement along a
//! path.
//!
//! The loops alternate, so that a machine that slows down slows all of them. rsruckig differs in kind: it follows no learnt
//! movement, but computes a trajectory within limits of position, velocity, acceleration and jerk when its target changes,
//! and samples it at all other ticks.
#![allow(missing_docs)]

mod control_loop;

use std::cell::RefCell;
use std::hint::black_box;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

use control_loop::{is_benchmark, model};
use hdrhistogram::Histogram;
use pdmp_core::motion::{Limits, fastest};
use pdmp_core::{Command, Conditions, Controller, Model};
use rsruckig::prelude::*;

const N_DOFS: usize = 7;
const N_STYLES: usize = 3;
const DT: f64 = 1e-3;
/// Ticks of a batch, within the duration of the movement of one second.
const N_TICKS: usize = 800;
/// Ticks timed together for the median, so that reading the clock is negligible.
const TOGETHER: usize = 20;
/// Limits that bind: the movement needs up to 15 /s and 50 /s².
const VELOCITY: f64 = 4.0;
const ACCELERATION: f64 = 15.0;
const JERK: f64 = 400.0;
const POSITION: [f64; 2] = [-1.5, 7.5];

/// A loop to time.
struct Timed {
    name: &'static str,
    restart: Box<dyn FnMut()>,
    tick: Box<dyn FnMut()>,
}

/// Returns limits that bind, or that do not.
fn limits(bind: bool) -> Limits {
    let size = |tight: f64| Some(vec![if bind { tight } else { 1e3 * tight }]);
    let mut limits =
        Limits { lower: size(POSITION[0]), upper: size(POSITION[1]), velocity: size(VELOCITY), ..Limits::default() };
    limits.acceleration = size(ACCELERATION);
    limits
}

/// Returns the loop of a controller, with a new goal at every tick or none.
fn controlled(name: &'static str, model: &Arc<Model>, limits: Option<Limits>, new_goals: bool) -> Timed {
    let mut controller = Controller::new(model.primitive(), DT, &Conditions::default(), None).expect("a controller");
    if let Some(limits) = &limits {
        controller.set_limits(limits).expect("limits");
    }
    let goals = targets(model);
    let controller = Rc::new(RefCell::new(controller));
    let shared = Rc::clone(&controller);
    let mut count = 0;
    Timed {
        name,
        restart: Box::new(move || {
            let mut controller = shared.borrow_mut();
            controller.reset(&Conditions::default()).expect("a reset");
            // A command before the first tick takes effect without a transition.
            controller.step().expect("a tick");
        }),
        tick: Box::new(move || {
            count += 1;
            let goal = new_goals.then_some(&goals[count % 2][..]);
            let command = Command { goal, ..Command::default() };
            black_box(controller.borrow_mut().step_with(&command).expect("a tick"));
        }),
    }
}

/// Returns two goals, to alternate between.
fn targets(model: &Model) -> [Vec<f64>; 2] {
    let goal = model.demonstrated().goals.row(0).to_vec();
    [goal.clone(), goal.iter().map(|g| g + 0.1).collect()]
}

/// Returns positions (D,) as those of rsruckig, without an allocation.
fn joints(position: &[f64]) -> DataArrayOrVec<f64, N_DOFS> {
    let mut joints = DataArrayOrVec::new(None, 0.0);
    position.iter().enumerate().for_each(|(dof, y)| joints[dof] = *y);
    joints
}

/// Returns the loop of rsruckig, with a new target at every tick or one.
fn ruckig(name: &'static str, model: &Arc<Model>, new_targets: bool) -> Timed {
    struct State {
        generator: Ruckig<N_DOFS, ThrowErrorHandler>,
        input: InputParameter<N_DOFS>,
        output: OutputParameter<N_DOFS>,
    }

    let start = model.demonstrated().starts.row(0).to_vec();
    let goals = targets(model);
    let mut input = InputParameter::new(None);
    input.target_position = joints(&goals[0]);
    input.max_velocity = DataArrayOrVec::new(None, VELOCITY);
    input.max_acceleration = DataArrayOrVec::new(None, ACCELERATION);
    input.max_jerk = DataArrayOrVec::new(None, JERK);
    input.min_position = Some(DataArrayOrVec::new(None, POSITION[0]));
    input.max_position = Some(DataArrayOrVec::new(None, POSITION[1]));
    let state = State { generator: Ruckig::new(None, DT), input, output: OutputParameter::new(None) };
    let state = Rc::new(RefCell::new(state));
    let (shared, mut count) = (Rc::clone(&state), 0);
    let update = |state: &mut State| {
        black_box(state.generator.update(&state.input, &mut state.output).expect("a trajectory"));
        state.output.pass_to_input(&mut state.input);
    };
    Timed {
        name,
        restart: Box::new(move || {
            let state = &mut *shared.borrow_mut();
            state.input.current_position = joints(&start);
            state.input.current_velocity = DataArrayOrVec::new(None, 0.0);
            state.input.current_acceleration = DataArrayOrVec::new(None, 0.0);
            // The first update computes the trajectory.
            update(state);
        }),
        tick: Box::new(move || {
            let state = &mut *state.borrow_mut();
            if new_targets {
                count += 1;
                state.input.target_position = joints(&goals[count % 2]);
            }
            update(state);
        }),
    }
}

fn main() {
    let n_rounds = if is_benchmark() { 300 } else { 2 };
    let model = model(N_DOFS, N_STYLES);
    let mut loops = [
        controlled("pdmp, limits that bind", &model, Some(limits(true)), false),
        controlled("pdmp, limits that do not bind", &model, Some(limits(false)), false),
        controlled("pdmp, no limits", &model, None, false),
        ruckig("rsruckig, sampling its trajectory", &model, false),
        controlled("pdmp, limits that bind, new goal", &model, Some(limits(true)), true),
        controlled("pdmp, limits that do not bind, new goal", &model, Some(limits(false)), true),
        controlled("pdmp, no limits, new goal", &model, None, true),
        ruckig("rsruckig, new target", &model, true),
    ];
    let histogram = || Histogram::<u64>::new_with_max(10_000_000_000, 3).expect("three digits up to ten seconds");
    let mut times: Vec<_> = loops.iter().map(|_| [histogram(), histogram()]).collect();
    for _ in 0..n_rounds {
        for (timed, [singly, together]) in loops.iter_mut().zip(&mut times) {
            (timed.restart)();
            for _ in 0..N_TICKS {
                let begin = Instant::now();
                (timed.tick)();
                singly.saturating_record(begin.elapsed().as_nanos() as u64);
            }
            (timed.restart)();
            for _ in 0..N_TICKS / TOGETHER {
                let begin = Instant::now();
                (0..TOGETHER).for_each(|_| (timed.tick)());
                // In picoseconds, which three digits resolve.
                together.saturating_record(begin.elapsed().as_nanos() as u64 * 1000 / TOGETHER as u64);
            }
        }
    }
    println!("One tick, D={N_DOFS} J={N_STYLES}, {} ticks each, in nanoseconds\n", n_rounds * N_TICKS);
    println!("| loop                                    | median | per joint |  p99.9 |  maximum | ratio |");
    println!("|-----------------------------------------|-------:|----------:|-------:|---------:|------:|");
    let median = |[_, together]: &[Histogram<u64>; 2]| together.value_at_quantile(0.5) as f64 / 1000.0;
    let first = median(&times[0]);
    for (timed, times) in loops.iter().zip(&times) {
        let (name, tick, joint) = (timed.name, median(times), median(times) / N_DOFS as f64);
        let (often, worst, ratio) = (times[0].value_at_quantile(0.999), times[0].max(), tick / first);
        println!("| {name:<39} | {tick:>6.0} | {joint:>9.1} | {often:>6} | {worst:>8} | {ratio:>5.2} |");
    }
    print_fastest(&model, n_rounds);
}

/// Prints the time of the fastest movement within limits that bind, of a thousand samples.
fn print_fastest(model: &Model, n_rounds: usize) {
    let (limits, conditions) = (limits(true), Conditions::default());
    let limits = Limits { lower: None, upper: None, ..limits };
    let movement = |dt: f64| fastest(model.primitive(), &limits, &conditions, dt).expect("a movement");
    let dt = movement(DT).time.last().expect("a sample") / 1000.0;
    let mut times: Vec<u128> = (0..n_rounds)
        .map(|_| {
            let begin = Instant::now();
            black_box(movement(dt));
            begin.elapsed().as_micros()
        })
        .collect();
    times.sort_unstable();
    println!("\nFastest movement of 1000 samples: median {} µs, minimum {} µs", times[n_rounds / 2], times[0]);
}
