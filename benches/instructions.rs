//! Instruction count of one tick, measured by callgrind and independent of other load on the machine.
//!
//! The bench starts itself under valgrind with a short and a long loop; the difference of the counts is that of the
//! additional ticks. For a profile, set `--callgrind-out-file` in [`count`].
#![allow(missing_docs)]

mod control_loop;

use std::env;
use std::process::Command;

use control_loop::{CommandLoad, ControlLoop, N_DOFS, N_STYLES, is_benchmark, model};

/// Ticks of the short loop.
const N_SHORT: u64 = 100;
/// Ticks of the long loop, which still ends before the movement and its transitions.
const N_LONG: u64 = 800;

/// Runs the `n` ticks that are counted.
fn run(n_dofs: usize, n_styles: usize, load: CommandLoad, n: u64) {
    let mut control_loop = ControlLoop::new(&model(n_dofs, n_styles), load);
    control_loop.prepare();
    (0..n).for_each(|_| control_loop.tick());
}

/// Returns the instruction count of a process that runs `n` ticks.
fn count(n_dofs: usize, n_styles: usize, load: CommandLoad, n: u64) -> u64 {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(env::current_exe().expect("the path of this bench"))
        .args([n_dofs.to_string(), n_styles.to_string(), load.name().to_string(), n.to_string()])
        .output()
        .expect("valgrind starts");
    let report = String::from_utf8_lossy(&output.stderr);
    let collected = report.lines().find_map(|line| line.split_once("Collected :")?.1.trim().parse().ok());
    collected.unwrap_or_else(|| panic!("callgrind reports no count:\n{report}"))
}

/// Returns the instruction count of one tick.
fn per_tick(n_dofs: usize, n_styles: usize, load: CommandLoad) -> u64 {
    let [short, long] = [N_SHORT, N_LONG].map(|n| count(n_dofs, n_styles, load, n));
    (long - short) / (N_LONG - N_SHORT)
}

/// Prints the table of all sizes and loads.
fn print_table() {
    println!("Instructions per tick\n");
    println!("| D  | J | settled | in transition | commanded |");
    println!("|---:|--:|--------:|--------------:|----------:|");
    for n_dofs in N_DOFS {
        for n_styles in N_STYLES {
            let [settled, transition, commanded] = CommandLoad::ALL.map(|load| per_tick(n_dofs, n_styles, load));
            println!("| {n_dofs:>2} | {n_styles} | {settled:>7} | {transition:>13} | {commanded:>9} |");
        }
    }
}

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    if let [n_dofs, n_styles, name, n] = &arguments[..] {
        let number = |text: &String| text.parse::<usize>().expect("a number");
        let load = CommandLoad::ALL.into_iter().find(|load| load.name() == name).expect("the name of a load");
        return run(number(n_dofs), number(n_styles), load, number(n) as u64);
    }
    if !is_benchmark() {
        return;
    }
    match Command::new("valgrind").arg("--version").output() {
        Ok(_) => print_table(),
        Err(reason) => println!("Skipped: valgrind does not start ({reason})."),
    }
}
