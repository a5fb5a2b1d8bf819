//! Instruction count of one tick and of the fastest movement along a path, measured by callgrind and independent of other load
//! on the machine.
//!
//! The bench starts itself under valgrind, which collects inside [`counted_ticks`] and [`counted_movements`] only: neither the
//! fit before them nor the environment of the process affects the count. For a profile, set `--callgrind-out-file` in
//! [`instructions`].
#![allow(missing_docs)]

mod control_loop;

use std::env;
use std::hint::black_box;
use std::process::Command;

use control_loop::{CommandLoad, ControlLoop, N_DOFS, N_STYLES, is_benchmark, model};
use pdmp_core::motion::{Limits, fastest};
use pdmp_core::{Conditions, Model};

/// Ticks before the count begins.
const N_WARM_UP: u64 = 100;
/// Ticks that are counted. They end before the movement and its transitions.
const N_TICKS: u64 = 700;

/// Fastest movements that are counted.
const N_MOVEMENTS: u64 = 20;
/// Number of samples of a fastest movement.
const N_SAMPLES: f64 = 1000.0;
/// Name of the fastest movements.
const FASTEST: &str = "fastest";

/// Runs the loop in the process that valgrind observes.
fn run(n_dofs: usize, n_styles: usize, load: CommandLoad) {
    let mut control_loop = ControlLoop::new(&model(n_dofs, n_styles), load);
    control_loop.prepare();
    (0..N_WARM_UP).for_each(|_| control_loop.tick());
    counted_ticks(&mut control_loop);
}

/// Runs the ticks that are counted. It must stay a call: callgrind finds it by its name.
#[inline(never)]
fn counted_ticks(control_loop: &mut ControlLoop) {
    (0..N_TICKS).for_each(|_| control_loop.tick());
}

/// Runs the movements that are counted, which velocity and acceleration limit.
fn run_fastest(n_dofs: usize, n_styles: usize) {
    let model = model(n_dofs, n_styles);
    let limits = Limits { velocity: Some(vec![4.0]), acceleration: Some(vec![15.0]), ..Limits::default() };
    let duration = fastest(model.primitive(), &limits, &Conditions::default(), 1e-3).expect("a movement").time;
    counted_movements(&model, &limits, duration[duration.len() - 1] / N_SAMPLES);
}

/// Computes fastest movements, with samples every `dt` seconds. It must stay a call, as [`counted_ticks`].
#[inline(never)]
fn counted_movements(model: &Model, limits: &Limits, dt: f64) {
    for _ in 0..N_MOVEMENTS {
        black_box(fastest(model.primitive(), limits, &Conditions::default(), dt).expect("a movement"));
    }
}

/// Returns the number of instructions that are counted.
fn instructions(n_dofs: usize, n_styles: usize, name: &str) -> u64 {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .args(["--collect-atstart=no", "--toggle-collect=*counted_ticks*", "--toggle-collect=*counted_movements*"])
        .arg(env::current_exe().expect("the path of this bench"))
        .args([n_dofs.to_string(), n_styles.to_string(), name.to_string()])
        .output()
        .expect("valgrind starts");
    let report = String::from_utf8_lossy(&output.stderr);
    let collected = report.lines().find_map(|line| line.split_once("Collected :")?.1.trim().parse::<u64>().ok());
    match collected {
        Some(instructions) if instructions > 0 => instructions,
        _ => panic!("callgrind reports no count:\n{report}"),
    }
}

/// Prints the table of all sizes and loads.
fn print_table() {
    println!("Instructions per tick, and of the fastest movement of {N_SAMPLES} samples\n");
    let names: Vec<&str> = CommandLoad::ALL.into_iter().map(CommandLoad::name).chain([FASTEST]).collect();
    println!("| D  | J | {} |", names.join(" | "));
    println!("|---:|--:|{}", "--:|".repeat(names.len()));
    for n_dofs in N_DOFS {
        for n_styles in N_STYLES {
            let count = |name: &&str| {
                instructions(n_dofs, n_styles, name) / if *name == FASTEST { N_MOVEMENTS } else { N_TICKS }
            };
            let counts: Vec<String> = names.iter().map(|name| count(name).to_string()).collect();
            println!("| {n_dofs} | {n_styles} | {} |", counts.join(" | "));
        }
    }
}

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    if let [n_dofs, n_styles, name] = &arguments[..] {
        let number = |text: &String| text.parse::<usize>().expect("a number");
        if name == FASTEST {
            return run_fastest(number(n_dofs), number(n_styles));
        }
        let load = CommandLoad::ALL.into_iter().find(|load| load.name() == name).expect("the name of a load");
        return run(number(n_dofs), number(n_styles), load);
    }
    if !is_benchmark() {
        return;
    }
    match Command::new("valgrind").arg("--version").output() {
        Ok(_) => print_table(),
        Err(reason) => println!("Skipped: valgrind does not start ({reason})."),
    }
}
