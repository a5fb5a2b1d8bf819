//! Random cases whose calls are mostly accepted: where everything is refused, nothing is tested.

use std::cell::Cell;

use pdmp_core::Result;
use proptest::prelude::*;
use proptest::test_runner::{TestCaseResult, TestRunner};

/// Counts of calls that were accepted, and of all.
#[derive(Default)]
pub(crate) struct Tally {
    accepted: Cell<usize>,
    calls: Cell<usize>,
}

impl Tally {
    /// Counts a call; returns whether it was accepted.
    pub(crate) fn count<T>(&self, result: Result<T>) -> bool {
        self.calls.set(self.calls.get() + 1);
        self.accepted.set(self.accepted.get() + usize::from(result.is_ok()));
        result.is_ok()
    }
}

/// Tests a property on random cases, and that at least half of the calls that it counts were accepted.
pub(crate) fn mostly_accepted<S: Strategy>(cases: S, property: impl Fn(S::Value, &Tally) -> TestCaseResult) {
    let tally = Tally::default();
    // A failure is printed, and found again by the same seed.
    let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::default() };
    if let Err(failure) = TestRunner::new(config).run(&cases, |case| property(case, &tally)) {
        panic!("{failure}");
    }
    let (accepted, calls) = (tally.accepted.get(), tally.calls.get());
    println!("{accepted} of {calls} calls accepted");
    assert!(2 * accepted >= calls, "{accepted} of {calls} calls accepted");
}
