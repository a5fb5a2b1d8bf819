//! Latency distribution of ten million ticks, each timed individually; of a million whose command a governor admits.
//!
//! The row "empty" is the baseline of two clock readings without a tick between them: the cost of the clock, and the
//! interruptions of the process by the system.
#![allow(missing_docs)]

mod control_loop;

use std::time::{Duration, Instant};

use control_loop::{CommandLoad, ControlLoop, TICKS_PER_BATCH, is_benchmark, model};
use hdrhistogram::Histogram;

const N_DOFS: usize = 7;
const N_STYLES: usize = 3;

/// Returns the histogram of the times of `n` calls, in nanoseconds. `prepare` runs before each batch and is not timed.
fn histogram<S>(n: usize, state: &mut S, prepare: impl Fn(&mut S), call: impl Fn(&mut S)) -> Histogram<u64> {
    let max_time = Duration::from_secs(10).as_nanos() as u64;
    let mut times = Histogram::new_with_max(max_time, 3).expect("three digits up to ten seconds");
    for k in 0..n {
        if k % TICKS_PER_BATCH == 0 {
            prepare(state);
        }
        let begin = Instant::now();
        call(state);
        times.saturating_record(begin.elapsed().as_nanos() as u64);
    }
    times
}

fn print(name: &str, times: &Histogram<u64>) {
    let [median, p99_9, p99_999] = [0.5, 0.999, 0.999_99].map(|quantile| times.value_at_quantile(quantile));
    println!("| {name:<16} | {median:>6} | {p99_9:>6} | {p99_999:>7} | {:>8} |", times.max());
}

fn main() {
    let n = if is_benchmark() { 10_000_000 } else { 1_000 };
    let model = model(N_DOFS, N_STYLES);
    println!("Latency of {n} ticks, D={N_DOFS} J={N_STYLES}, in nanoseconds\n");
    println!("| ticks            | median |  p99.9 | p99.999 |  maximum |");
    println!("|------------------|-------:|-------:|--------:|---------:|");
    print("empty", &histogram(n, &mut (), |()| (), |()| ()));
    for load in CommandLoad::ALL {
        let mut control_loop = ControlLoop::new(&model, load);
        let governed = matches!(load, CommandLoad::Governed | CommandLoad::GovernedSlowed);
        let n = if governed { n / 10 } else { n };
        print(load.name(), &histogram(n, &mut control_loop, ControlLoop::prepare, ControlLoop::tick));
    }
}
