//! Limits under adversarial commands: a thousand million joint-ticks of random models, limits and movements, and a million
//! rollouts within limits that do not bind.
//!
//! `cargo bench --bench limits_proof -- joint_ticks=1e8 rollouts=1e5 seed=5` runs other numbers from another seed on, and
//! `cargo bench --bench limits_proof -- case=17` prints every violation in the case of one seed.
#![allow(missing_docs)]

#[path = "../crates/pdmp-core/tests/adversary/mod.rs"]
mod adversary;

use std::env;
use std::process::ExitCode;
use std::time::Instant;

use adversary::models::models;
use adversary::report::Report;
use adversary::slack::SlackReport;
use adversary::trace_case;

/// Joint-ticks of the proof.
const JOINT_TICKS: f64 = 1e9;
/// Rollouts within limits that do not bind.
const ROLLOUTS: f64 = 1e6;

/// Returns the number of an argument `name=number`.
fn argument(name: &str) -> Option<f64> {
    env::args().find_map(|argument| argument.strip_prefix(name)?.strip_prefix('=')?.parse().ok())
}

fn main() -> ExitCode {
    // `cargo test --benches` only checks that the bench runs.
    let is_benchmark = env::args().any(|argument| argument == "--bench");
    let models = models();
    if let Some(seed) = argument("case") {
        trace_case(&models, seed as u64);
        return ExitCode::SUCCESS;
    }
    let joint_ticks = argument("joint_ticks").unwrap_or(if is_benchmark { JOINT_TICKS } else { 1e5 });
    let begin = Instant::now();
    let seed = argument("seed").unwrap_or(1.0) as u64;
    let report = Report::run(&models, seed, joint_ticks as usize);
    report.print();
    println!("\n{:.0} s\n", begin.elapsed().as_secs_f64());
    let rollouts = argument("rollouts").unwrap_or(if is_benchmark { ROLLOUTS } else { 1e3 });
    let slack = SlackReport::run(&models, seed, rollouts as usize);
    slack.print();
    ExitCode::from(u8::from(!(report.holds() && slack.holds())))
}
