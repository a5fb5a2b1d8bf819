//! Limits under adversarial commands: a thousand million joint-ticks of random models, limits and movements.
//!
//! `cargo bench --bench limits_proof -- joint_ticks=1e8 seed=5` runs another number of joint-ticks, from another seed on, and
//! `cargo bench --bench limits_proof -- case=17` prints every violation in the case of one seed.
#![allow(missing_docs)]

#[path = "../crates/pdmp-core/tests/adversary/mod.rs"]
mod adversary;

use std::env;
use std::process::ExitCode;
use std::time::Instant;

use adversary::models::models;
use adversary::report::Report;
use adversary::trace_case;

/// Joint-ticks of the proof.
const JOINT_TICKS: f64 = 1e9;

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
    let report = Report::run(&models, argument("seed").unwrap_or(1.0) as u64, joint_ticks as usize);
    report.print();
    println!("\n{:.0} s", begin.elapsed().as_secs_f64());
    ExitCode::from(u8::from(!report.holds()))
}
