//! Times of one tick, from one degree of freedom to two arms and more.
//!
//! `cargo bench --bench step -- 'live/D=7'` runs those whose name contains what stands in quotes.
#![allow(missing_docs)]

mod control_loop;

use std::time::{Duration, Instant};

use control_loop::{BOUT, ControlLoop, N_DOFS, N_STYLES, Told, primitive};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};

/// Time of `n` ticks.
fn time(control_loop: &mut ControlLoop, n: u64) -> Duration {
    let mut time = Duration::ZERO;
    let mut left = n;
    while left > 0 {
        let bout = left.min(BOUT as u64);
        control_loop.renew();
        let begin = Instant::now();
        (0..bout).for_each(|_| control_loop.tick());
        time += begin.elapsed();
        left -= bout;
    }
    time
}

fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step");
    group.sample_size(20).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    for n_dofs in N_DOFS {
        for n_styles in N_STYLES {
            let model = primitive(n_dofs, n_styles);
            for told in Told::ALL {
                let mut control_loop = ControlLoop::new(&model, told);
                let id = BenchmarkId::new(told.name(), format!("D={n_dofs} J={n_styles}"));
                group.bench_function(id, |bench| bench.iter_custom(|n| time(&mut control_loop, n)));
            }
        }
    }
    group.finish();
}

criterion_group!(benches, steps);
criterion_main!(benches);
