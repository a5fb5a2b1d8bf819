//! Time of each stage of a fit, as its progress callback reports them, and peak memory of a large fit.
#![allow(missing_docs)]

mod movements;

use std::env;
use std::fs;
use std::time::{Duration, Instant};

use movements::movements;
use pdmp_core::learning::fit_with;
use pdmp_core::learning::regression::{Basis, NGnet};
use pdmp_core::learning::{Stage, TimeScaling, Truncation};
use pdmp_core::model::TimeWarp;
use pdmp_core::numerics::Smoothing;
use pdmp_core::{Demonstration, FitOptions};

const STAGES: [Stage; 5] = [Stage::Align, Stage::Targets, Stage::Factorise, Stage::Regress, Stage::Compile];

/// Returns the time of each stage of one fit, from its first report to that of the next stage. The first stage begins
/// with the call, and the last ends with its return.
fn stages(demos: &[Demonstration], options: &FitOptions) -> [Duration; 5] {
    let mut marks = vec![Instant::now()];
    let mut progress = |stage, _| {
        if STAGES.get(marks.len()) == Some(&stage) {
            marks.push(Instant::now());
        }
        Ok(())
    };
    let model = fit_with(demos, options, &mut progress).expect("a fit");
    marks.push(Instant::now());
    drop(model);
    std::array::from_fn(|stage| marks[stage + 1] - marks[stage])
}

/// Prints the median time of each stage over `n` fits, and the median of their sum.
fn print_row(name: &str, n: usize, demos: &[Demonstration], options: &FitOptions) {
    let runs: Vec<[Duration; 5]> = (0..n).map(|_| stages(demos, options)).collect();
    let median = |of: &dyn Fn(&[Duration; 5]) -> Duration| {
        let mut times: Vec<Duration> = runs.iter().map(of).collect();
        times.sort();
        format!("{:>9.3}", 1e3 * times[n / 2].as_secs_f64())
    };
    let columns: Vec<String> = (0..STAGES.len()).map(|stage| median(&|times| times[stage])).collect();
    println!("| {name:<21} | {} | {} |", columns.join(" | "), median(&|times| times.iter().sum()));
}

/// Prints a title and the head of a table.
fn print_heading(title: &str) {
    println!("\n{title}\n");
    println!("|                       |     align |   targets | factorise |   regress |   compile |     total |");
    println!("|-----------------------|----------:|----------:|----------:|----------:|----------:|----------:|");
}

/// Returns the peak resident memory of this process, on Linux.
fn peak_memory() -> Option<String> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = peak.trim().trim_end_matches(" kB").parse().ok()?;
    Some(format!("{:.0} MB", kilobytes / 1e3))
}

fn main() {
    // `cargo test --benches` only checks that the bench starts.
    if !env::args().any(|argument| argument == "--bench") {
        return;
    }
    let network = FitOptions::discrete().n_styles(Truncation::Rank(3)).basis(Basis::NGnet(NGnet::default()));
    let interpolated = network.clone().smoothing(Smoothing::Interpolate);
    let warped = network.clone().time_scaling(TimeScaling::Warp(TimeWarp::default()));
    let process = FitOptions::discrete().n_styles(Truncation::Rank(3));

    let demos = movements(20, 1001);
    print_heading("Milliseconds of a fit, M = 20, C = 1001, D = 7, J = 3");
    print_row("NGnet", 21, &demos, &network);
    print_row("NGnet, no smoothing", 101, &demos, &interpolated);
    print_row("NGnet, time warp", 21, &demos, &warped);
    print_row("GP", 11, &demos, &process);

    let demos = movements(5000, 200);
    let before = peak_memory();
    print_heading("Milliseconds of a fit, M = 5000, C = 200, D = 7");
    print_row("NGnet, J = 5", 3, &demos, &network.clone().n_styles(Truncation::Rank(5)));
    print_row("NGnet, J from singular values", 3, &demos, &network.n_styles(Truncation::Share(0.9)));
    if let (Some(before), Some(after)) = (before, peak_memory()) {
        println!("\nPeak memory: {after}; {before} before these fits.");
    }
}
