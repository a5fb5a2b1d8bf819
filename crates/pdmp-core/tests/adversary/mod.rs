//! Adversarial movements within limits: random models, limits, commands, perturbations and ticks, and an oracle that sees only
//! the published motion.
//!
//! Shared by the tests `limits_proof` and `slack_limits` and by the bench `limits_proof`. A case is determined by its seed.
// Each of them uses only some of the items.
#![allow(dead_code, missing_docs, unreachable_pub)]

pub(crate) mod attack;
pub(crate) mod models;
pub(crate) mod oracle;
pub(crate) mod random;
pub(crate) mod report;
pub(crate) mod settings;
pub(crate) mod slack;

use std::sync::Arc;

use pdmp_core::Model;

use attack::{Attack, Observer, Tally};
use oracle::{Findings, Oracle};
use random::Random;
use report::Report;
use settings::Settings;

/// Joint-ticks of a case, about.
const JOINT_TICKS: usize = 4000;

/// Runs the case of a seed and adds it to the report.
pub(crate) fn run_case(models: &[Arc<Model>], seed: u64, report: &mut Report) {
    let (findings, tally) = case(models, seed, true, |oracle| oracle);
    report.add(seed, findings, tally);
}

/// Runs the case of a seed and prints every violation.
pub(crate) fn trace_case(models: &[Arc<Model>], seed: u64) {
    case(models, seed, true, |oracle| {
        println!("case {seed}");
        oracle.traced()
    });
}

/// Runs the case of a seed without limits, judged as if it had them, and adds it to the report.
pub(crate) fn run_control(models: &[Arc<Model>], seed: u64, report: &mut Report) {
    let (findings, tally) = case(models, seed, false, |oracle| oracle);
    report.add(seed, findings, tally);
}

fn case(models: &[Arc<Model>], seed: u64, sets_limits: bool, judge: impl Fn(Oracle) -> Oracle) -> (Findings, Tally) {
    let mut random = Random::new(seed);
    let model = random.choose(models);
    let settings = Settings::new(model, &mut random);
    let mut controller = settings.controller(&mut random);
    let mut oracle = judge(Oracle::new(settings.model.ranges()));
    oracle.restarted(&controller);
    let n_ticks = JOINT_TICKS / settings.model.n_dofs() + 20;
    let mut attack = Attack::new(settings, random);
    attack.sets_limits = sets_limits;
    attack.limit(&mut controller, &mut oracle);
    for _ in 0..n_ticks {
        attack.between_ticks(&mut controller, &mut oracle);
        attack.tick(&mut controller, &mut oracle);
    }
    (oracle.finish(), attack.tally)
}
