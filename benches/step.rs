//! Time of one tick, for 1 to 32 degrees of freedom.
//!
//! `cargo bench --bench step -- 'settled/D=7'` runs the benches whose names contain the quoted text.
#![allow(missing_docs)]

mod control_loop;

use std::time::{Duration, Instant};

use control_loop::{CommandLoad, ControlLoop, N_DOFS, N_STYLES, TICKS_PER_BATCH, model};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};

/// Returns the time of `n` ticks.
fn time(control_loop: &mut ControlLoop, n: u64) -> Duration {
    let mut time = Duration::ZERO;
    let mut remaining = n;
    while remaining > 0 {
        let batch = remaining.min(TICKS_PER_BATCH as u64);
        control_loop.prepare();
        let begin = Instant::now();
        (0..batch).for_each(|_| control_loop.tick());
        time += begin.elapsed();
        remaining -= batch;
    }
    time
}

fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step");
    group.sample_size(20).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    for n_dofs in N_DOFS {
        for n_styles in N_STYLES {
            let model = model(n_dofs, n_styles);
            for load in CommandLoad::ALL {
                let mut control_loop = ControlLoop::new(&model, load);
                let id = BenchmarkId::new(load.name(), format!("D={n_dofs} J={n_styles}"));
                group.bench_function(id, |bench| bench.iter_custom(|n| time(&mut control_loop, n)));
            }
        }
    }
    group.finish();
}

criterion_group!(benches, steps);
criterion_main!(benches);
