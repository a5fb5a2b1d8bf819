//! The control loop does not allocate: a counting allocator watches a million ticks of random commands.
#![allow(missing_docs, unsafe_code)]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::*;
use pdmp_core::{Command, Conditions, Controller, Coupling, Kind, Motion};

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
        let (mut position, mut velocity, mut acceleration) = (vec![0.0; n_dofs], vec![0.0; n_dofs], vec![0.0; n_dofs]);
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        for _ in 0..500_000 {
            values.iter_mut().for_each(|v| *v = 2.0 * random.next() - 1.0);
            // Refused commands are part of a loop too.
            let refused = random.next() < 0.01;
            if refused {
                values[0] = f64::NAN;
            }
            let (given, tau, amplitude) = (&values[..n_dofs], own * (0.5 + random.next()), values[0].abs());
            let _ = black_box(match (random.next() * 8.0) as u8 {
                0 => controller.set_style(&values[..n_styles]),
                1 => controller.set_goal(given),
                2 => controller.set_anchor(given),
                3 => controller.set_tau(tau),
                4 => controller.set_amplitude(amplitude),
                _ => Ok(()),
            });
            let mut rarely = || random.next() < 0.2;
            let command = Command {
                dt: rarely().then_some(1e-3 * (0.1 + values[n_dofs - 1].abs())),
                style: rarely().then_some(&values[..n_styles]),
                goal: (rarely() && kind == Kind::Discrete).then_some(given),
                anchor: (rarely() && kind == Kind::Rhythmic).then_some(given),
                tau: rarely().then_some(tau),
                amplitude: (rarely() && kind == Kind::Rhythmic).then_some(amplitude),
                measured: rarely().then_some(given),
                coupling: rarely().then_some(Coupling { velocity: given, acceleration: given }),
            };
            let mut motion =
                Motion { position: &mut position, velocity: &mut velocity, acceleration: &mut acceleration };
            let vectors = [command.style, command.goal, command.anchor, command.measured];
            let told = vectors.iter().any(Option::is_some) || command.amplitude.is_some() || command.coupling.is_some();
            assert_eq!(black_box(controller.update(&command, &mut motion)).is_err(), told && refused);
        }
        assert_eq!(ALLOCATIONS.load(Ordering::Relaxed) - before, 0);
        assert!(position.iter().chain(&velocity).chain(&acceleration).all(|x| x.is_finite()));
    }
}
