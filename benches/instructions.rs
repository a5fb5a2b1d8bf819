//! Instructions of one tick, counted by callgrind: a figure that no other load on the machine moves.
//!
//! The bench starts itself under valgrind, twice a row: the counts of a short and of a long loop differ by the ticks
//! alone. For where they go, add `--callgrind-out-file` to the command that [`count`] puts together.
#![allow(missing_docs)]

mod control_loop;

use std::env;
use std::process::Command;

use control_loop::{ControlLoop, N_DOFS, N_STYLES, Told, benching, primitive};

/// Ticks of the two loops: both end before the movement and its transitions do.
const SHORT: u64 = 100;
const LONG: u64 = 800;

/// Runs `n` ticks; this is what is counted.
fn run(n_dofs: usize, n_styles: usize, told: Told, n: u64) {
    let mut control_loop = ControlLoop::new(&primitive(n_dofs, n_styles), told);
    control_loop.renew();
    (0..n).for_each(|_| control_loop.tick());
}

/// Instructions of the whole process that runs `n` ticks.
fn count(n_dofs: usize, n_styles: usize, told: Told, n: u64) -> u64 {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(env::current_exe().expect("the path of this bench"))
        .args([n_dofs.to_string(), n_styles.to_string(), told.name().to_string(), n.to_string()])
        .output()
        .expect("valgrind starts");
    let report = String::from_utf8_lossy(&output.stderr);
    let collected = report.lines().find_map(|line| line.split_once("Collected :")?.1.trim().parse().ok());
    collected.unwrap_or_else(|| panic!("callgrind reports no count:\n{report}"))
}

fn per_tick(n_dofs: usize, n_styles: usize, told: Told) -> u64 {
    let [short, long] = [SHORT, LONG].map(|n| count(n_dofs, n_styles, told, n));
    (long - short) / (LONG - SHORT)
}

fn table() {
    println!("Instructions of one tick\n");
    println!("| D  | J | settled |    live | commanded |");
    println!("|---:|--:|--------:|--------:|----------:|");
    for n_dofs in N_DOFS {
        for n_styles in N_STYLES {
            let [settled, live, commanded] = Told::ALL.map(|told| per_tick(n_dofs, n_styles, told));
            println!("| {n_dofs:>2} | {n_styles} | {settled:>7} | {live:>7} | {commanded:>9} |");
        }
    }
}

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    if let [n_dofs, n_styles, name, n] = &arguments[..] {
        let number = |text: &String| text.parse::<usize>().expect("a number");
        let told = Told::ALL.into_iter().find(|told| told.name() == name).expect("a name from Told");
        return run(number(n_dofs), number(n_styles), told, number(n) as u64);
    }
    if !benching() {
        return;
    }
    match Command::new("valgrind").arg("--version").output() {
        Ok(_) => table(),
        Err(reason) => println!("Instructions are not counted: valgrind does not start ({reason})."),
    }
}
