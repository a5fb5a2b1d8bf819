//! Limits under adversarial commands: ten million joint-ticks of random models, limits and movements.
//!
//! The bench `limits_proof` runs more of the same cases.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod adversary;

use adversary::models::models;
use adversary::oracle::Property;
use adversary::report::Report;
use adversary::run_control;
use adversary::slack::SlackReport;

/// No sequence of commands, perturbations, limits and ticks leads out of the limits, and a state outside returns.
#[test]
fn limits_hold_in_ten_million_joint_ticks() {
    let report = Report::run(&models(), 1, 10_000_000);
    report.print();
    assert!(report.holds(), "see the table; the bench limits_proof prints the violations of a seed");
}

/// Without limits every property is violated: the oracle sees it.
#[test]
fn oracle_finds_every_violation() {
    let (models, mut report) = (models(), Report::default());
    (1..=100).for_each(|seed| run_control(&models, seed, &mut report));
    report.print();
    let seen = |property: Property| report.findings.worst[property as usize].violation > 0.01;
    // A command without a tick does not move the position, with or without limits.
    let unseen: Vec<_> = Property::ALL.into_iter().filter(|property| !seen(*property)).collect();
    assert_eq!(unseen, [Property::Call]);
}

/// Limits that do not bind leave the motion as it is, to the last bit.
#[test]
fn limits_that_do_not_bind_change_nothing() {
    let report = SlackReport::run(&models(), 1, 10_000);
    report.print();
    assert!(report.refused < report.rollouts, "{report:?}");
    assert!(report.holds(), "{report:?}");
}
