//! Instruction count of one tick, measured by callgrind and independent of other load on the machine.
//!
//! The bench starts itself under valgrind, which collects inside [`counted_ticks`] only: neither the fit before it nor the
//! environment of the process affects the count. For a profile, set `--callgrind-out-file` in [`per_tick`].
#![allow(missing_docs)]

mod control_loop;

use std::env;
use std::process::Command;

use control_loop::{CommandLoad, ControlLoop, N_DOFS, N_STYLES, is_benchmark, model};

/// Ticks before the count begins.
const N_WARM_UP: u64 = 100;
/// Ticks that are counted. They end before the movement and its transitions.
const N_TICKS: u64 = 700;

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

/// Returns the mean instruction count of one tick.
fn per_tick(n_dofs: usize, n_styles: usize, load: CommandLoad) -> u64 {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .args(["--collect-atstart=no", "--toggle-collect=*counted_ticks*"])
        .arg(env::current_exe().expect("the path of this bench"))
        .args([n_dofs.to_string(), n_styles.to_string(), load.name().to_string()])
        .output()
        .expect("valgrind starts");
    let report = String::from_utf8_lossy(&output.stderr);
    let collected = report.lines().find_map(|line| line.split_once("Collected :")?.1.trim().parse::<u64>().ok());
    match collected {
        Some(instructions) if instructions > 0 => instructions / N_TICKS,
        _ => panic!("callgrind reports no count:\n{report}"),
    }
}

/// Prints the table of all sizes and loads.
fn print_table() {
    println!("Instructions per tick\n");
    let names: Vec<&str> = CommandLoad::ALL.into_iter().map(CommandLoad::name).collect();
    println!("| D  | J | {} |", names.join(" | "));
    println!("|---:|--:|{}", "--:|".repeat(names.len()));
    for n_dofs in N_DOFS {
        for n_styles in N_STYLES {
            let counts = CommandLoad::ALL.map(|load| per_tick(n_dofs, n_styles, load).to_string());
            println!("| {n_dofs} | {n_styles} | {} |", counts.join(" | "));
        }
    }
}

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    if let [n_dofs, n_styles, name] = &arguments[..] {
        let number = |text: &String| text.parse::<usize>().expect("a number");
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
