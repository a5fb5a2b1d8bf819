//! The control loop does not allocate: a counting allocator watches a million ticks of random commands.
#![allow(missing_docs, unsafe_code)]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::*;
use pdmp_core::{Conditions, Controller, Coupling, Kind, Perturbation};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A small generator of numbers in [0, 1), so that the loop itself allocates nothing.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[test]
fn a_million_ticks_of_random_commands_allocate_nothing() {
    for (kind, demos) in [(Kind::Discrete, reaches()), (Kind::Rhythmic, cycles())] {
        let model = learn(&demos, &options(kind));
        let (n_dofs, n_styles, own) = (model.n_dofs(), model.n_styles(), model.tau());
        let mut controller = Controller::new(Arc::clone(&model), 1e-3, &Conditions::default(), None).unwrap();
        let mut random = Random(1);
        let mut values = vec![0.0; n_dofs.max(n_styles)];
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        for _ in 0..500_000 {
            values.iter_mut().for_each(|v| *v = 2.0 * random.next() - 1.0);
            // Refused commands are part of a loop too.
            if random.next() < 0.01 {
                values[0] = f64::NAN;
            }
            let _ = black_box(match (random.next() * 8.0) as u8 {
                0 => controller.set_style(&values[..n_styles]),
                1 => controller.set_goal(&values[..n_dofs]),
                2 => controller.set_anchor(&values[..n_dofs]),
                3 => controller.set_tau(own * (0.5 + random.next())),
                4 => controller.set_amplitude(values[0]),
                _ => Ok(()),
            });
            let dt = 1e-3 * (0.1 + random.next());
            let given = &values[..n_dofs];
            let coupling = Some(Coupling { velocity: given, acceleration: given });
            let refused = given[0].is_nan();
            let (done, perturbed) = match (random.next() * 4.0) as u8 {
                0 => (controller.step_with(dt, &Perturbation { measured: Some(given), coupling: None }), true),
                1 => (controller.step_with(dt, &Perturbation { measured: None, coupling }), true),
                2 => (controller.step_with(dt, &Perturbation { measured: Some(given), coupling }), true),
                _ => (controller.step_by(dt), false),
            };
            assert_eq!(black_box(done).is_err(), perturbed && refused);
        }
        assert_eq!(ALLOCATIONS.load(Ordering::Relaxed) - before, 0);
        assert!(controller.position().iter().all(|y| y.is_finite()));
    }
}
