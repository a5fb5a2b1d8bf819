//! Times of a movement through points, and of a tick with additional forcing, for D = 7 and J = 6.
//!
//! `cargo bench --bench via_points -- 'through/1'` runs the benches whose names contain the quoted text.
#![allow(missing_docs)]

mod control_loop;

use control_loop::model;
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use pdmp_core::inference::{At, PassageOptions, ViaPoint, through};
use pdmp_core::{Conditions, Controller};

fn through_points(criterion: &mut Criterion) {
    let model = model(7, 6);
    let given = Conditions::default();
    let points = |n: usize| -> Vec<ViaPoint> {
        let time = |i: usize| model.duration() * (i + 1) as f64 / (n + 1) as f64;
        (0..n).map(|i| ViaPoint::new(At::Time(time(i)), vec![0.1; 7])).collect()
    };
    let mut group = criterion.benchmark_group("through");
    for n in [1, 2, 4] {
        let points = points(n);
        for (name, from_phase) in [("planned", None), ("under way", Some(model.canonical().phase(0.1)))] {
            let options = PassageOptions { from_phase, ..PassageOptions::default() };
            group.bench_function(BenchmarkId::new(name, n), |bench| {
                bench.iter(|| through(&model, &points, &given, &options).expect("the points can be passed"));
            });
        }
    }
    group.finish();

    let passed = through(&model, &points(1), &given, &PassageOptions::default()).expect("the point can be passed");
    let mut group = criterion.benchmark_group("step with forcing");
    for (name, conditions) in [("without", given.or(passed.conditions.clone())), ("with", passed.conditions)] {
        let forcing = if name == "with" { conditions.forcing.clone() } else { None };
        let conditions = Conditions { forcing, ..conditions };
        let tick = model.duration() / 1000.0;
        let mut controller = Controller::new(model.primitive(), tick, &conditions, None).expect("valid conditions");
        group.bench_function(name, |bench| {
            bench.iter(|| {
                if controller.time() > 0.99 * model.duration() {
                    controller.reset(&conditions).expect("valid conditions");
                }
                controller.step()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, through_points);
criterion_main!(benches);
