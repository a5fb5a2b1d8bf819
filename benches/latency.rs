//! How long single ticks take, the rare ones too: ten million of them, each timed by itself.
//!
//! The clock's own row is what two readings with nothing between them show: what it costs, and what the machine itself
//! takes away from whoever runs on it.
#![allow(missing_docs)]

mod control_loop;

use std::time::{Duration, Instant};

use control_loop::{BOUT, ControlLoop, Told, benching, primitive};
use hdrhistogram::Histogram;

const N_DOFS: usize = 7;
const N_STYLES: usize = 3;

/// Times of `n` calls, in nanoseconds; `ready` comes before every bout of them and is not timed.
fn histogram<S>(n: usize, state: &mut S, ready: impl Fn(&mut S), call: impl Fn(&mut S)) -> Histogram<u64> {
    let longest = Duration::from_secs(10).as_nanos() as u64;
    let mut times = Histogram::new_with_max(longest, 3).expect("three digits up to ten seconds");
    for k in 0..n {
        if k % BOUT == 0 {
            ready(state);
        }
        let begin = Instant::now();
        call(state);
        times.saturating_record(begin.elapsed().as_nanos() as u64);
    }
    times
}

fn print(name: &str, times: &Histogram<u64>) {
    let [median, often, rarely] = [0.5, 0.999, 0.999_99].map(|share| times.value_at_quantile(share));
    println!("| {name:<9} | {median:>6} | {often:>6} | {rarely:>7} | {:>8} |", times.max());
}

fn main() {
    let n = if benching() { 10_000_000 } else { 1_000 };
    let model = primitive(N_DOFS, N_STYLES);
    println!("Latency of {n} ticks, D={N_DOFS} J={N_STYLES}, in nanoseconds\n");
    println!("| ticks     | median |  p99.9 | p99.999 |  maximum |");
    println!("|-----------|-------:|-------:|--------:|---------:|");
    print("the clock", &histogram(n, &mut (), |()| (), |()| ()));
    for told in Told::ALL {
        let mut control_loop = ControlLoop::new(&model, told);
        print(told.name(), &histogram(n, &mut control_loop, ControlLoop::renew, ControlLoop::tick));
    }
}
