//! Report of many cases.

use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::thread;

use pdmp_core::Model;

use super::attack::Tally;
use super::oracle::{Findings, Property, Worst};
use super::run_case;

/// Largest permitted violation: that of rounding.
pub(crate) const MAX_VIOLATION: f64 = 1e-12;

/// Runs seeds from the first on, on all processors, until `run` returns false, and merges the reports of the processors.
pub(crate) fn parallel<R: Default + Send>(
    first_seed: u64,
    run: impl Fn(u64, &mut R) -> bool + Sync,
    merge: impl Fn(&mut R, R) + Sync,
) -> R {
    let (next, total) = (AtomicU64::new(first_seed), Mutex::new(R::default()));
    let n_threads = thread::available_parallelism().map_or(1, |n| n.get());
    thread::scope(|scope| {
        for _ in 0..n_threads {
            scope.spawn(|| {
                let mut report = R::default();
                while run(next.fetch_add(1, Ordering::Relaxed), &mut report) {}
                merge(&mut *total.lock().expect("no case panics"), report);
            });
        }
    });
    total.into_inner().expect("no case panics")
}

/// Sums and maxima of many cases.
#[derive(Clone, Debug, Default)]
pub(crate) struct Report {
    pub(crate) cases: usize,
    pub(crate) findings: Findings,
    seeds: [u64; Property::ALL.len()],
    violated: [usize; Property::ALL.len()],
    pub(crate) tally: Tally,
    not_finite: Option<u64>,
}

impl Report {
    pub(crate) fn add(&mut self, seed: u64, findings: Findings, tally: Tally) {
        let case = Self { cases: 1, seeds: [seed; Property::ALL.len()], tally, ..Self::default() };
        let violated = findings.worst.map(|worst| usize::from(worst.violation > MAX_VIOLATION));
        let not_finite = (findings.not_finite > 0).then_some(seed);
        self.merge(Self { findings, violated, not_finite, ..case });
    }

    fn merge(&mut self, other: Self) {
        self.cases += other.cases;
        for property in 0..Property::ALL.len() {
            self.violated[property] += other.violated[property];
            if other.findings.worst[property].violation > self.findings.worst[property].violation {
                self.findings.worst[property] = other.findings.worst[property];
                self.seeds[property] = other.seeds[property];
            }
        }
        self.findings.joint_ticks += other.findings.joint_ticks;
        self.findings.outside += other.findings.outside;
        self.findings.not_finite += other.findings.not_finite;
        for (sum, count) in self.findings.limited.iter_mut().zip(other.findings.limited) {
            *sum += count;
        }
        self.not_finite = self.not_finite.or(other.not_finite);
        self.tally.commands += other.tally.commands;
        self.tally.limits += other.tally.limits;
        self.tally.refused_limits += other.tally.refused_limits;
        self.tally.refused_ticks += other.tally.refused_ticks;
        self.tally.restarts += other.tally.restarts;
        self.tally.lost += other.tally.lost;
    }

    /// Runs cases from a seed on, on all processors, until the given number of joint-ticks is reached.
    pub(crate) fn run(models: &[Arc<Model>], first_seed: u64, joint_ticks: usize) -> Self {
        let done = AtomicUsize::new(0);
        let run = |seed: u64, report: &mut Self| {
            let before = report.findings.joint_ticks;
            run_case(models, seed, report);
            done.fetch_add(report.findings.joint_ticks - before, Ordering::Relaxed) < joint_ticks
        };
        parallel(first_seed, run, Self::merge)
    }

    /// Returns true if every property holds.
    pub(crate) fn holds(&self) -> bool {
        (self.findings.not_finite, self.tally.lost) == (0, 0)
            && self.findings.worst.iter().all(|worst| worst.violation <= MAX_VIOLATION)
    }

    pub(crate) fn print(&self) {
        let Self { cases, findings, tally, .. } = self;
        let Findings { joint_ticks, outside, limited, not_finite, .. } = findings;
        let [position, velocity, acceleration, jerk] = limited;
        println!("{joint_ticks} joint-ticks in {cases} cases");
        println!(
            "{} limited: {position} by position, {velocity} by velocity, {acceleration} by acceleration, {jerk} by jerk",
            limited.iter().sum::<usize>()
        );
        println!("{outside} outside, braking or returning; {not_finite} not finite {:?}", self.not_finite);
        let Tally { commands, limits, refused_limits, refused_ticks, restarts, lost } = tally;
        println!(
            "{commands} commands; {limits} limits set, {refused_limits} of them refused as too tight for the tick; {restarts} restarts; {refused_ticks} ticks refused; {lost} snapshots rejected"
        );
        println!("\n| property | worst violation | cases | seed | tick | DoF | dt |");
        println!("|---|---:|---:|---:|---:|---:|---:|");
        for (property, name) in Property::ALL.iter().map(|property| property.name()).enumerate() {
            let Worst { violation, tick, dof, dt } = findings.worst[property];
            let (violated, seed) = (self.violated[property], self.seeds[property]);
            println!("| {name} | {violation:.1e} | {violated} | {seed} | {tick} | {dof} | {dt:.1e} |");
        }
    }
}
