//! A control loop through the C ABI matches Rust to the bit and allocates nothing, as counted by the allocator.
#![allow(missing_docs, unsafe_code)]

#[path = "../../pdmp-core/tests/common/mod.rs"]
mod common;
#[path = "../../pdmp-core/tests/common/counting.rs"]
mod counting;
#[path = "../../pdmp-core/tests/common/poses.rs"]
mod poses;
mod random {
    pub(crate) use super::counting::Random;
}

use std::mem::MaybeUninit;
use std::ptr;

use common::*;
use counting::{Random, allocations};
use pdmp::*;
use pdmp_core::inference::{Recogniser, Timing};
use pdmp_core::learning::learn_prior;
use pdmp_core::motion::Compliance;
use pdmp_core::motion::Coupling;
use pdmp_core::motion::Limits;
use pdmp_core::numerics::Threads;
use pdmp_core::{Command, Conditions, Controller, Kind, Motion};

fn vector(numbers: Option<&[f64]>) -> pdmp_vector {
    numbers.map_or(pdmp_vector { data: ptr::null(), length: 0 }, |v| pdmp_vector { data: v.as_ptr(), length: v.len() })
}

fn pointer(number: &Option<f64>) -> *const f64 {
    number.as_ref().map_or(ptr::null(), ptr::from_ref)
}

/// Returns the command in the layout of C.
fn to_c(command: &Command) -> pdmp_command {
    pdmp_command {
        style: vector(command.style),
        goal: vector(command.goal),
        goal_velocity: vector(command.goal_velocity),
        anchor: vector(command.anchor),
        tau: pointer(&command.tau),
        amplitude: pointer(&command.amplitude),
        dt: pointer(&command.dt),
        measured: vector(command.measured),
        coupling: pdmp_coupling {
            velocity: vector(command.coupling.map(|terms| terms.velocity)),
            acceleration: vector(command.coupling.map(|terms| terms.acceleration)),
        },
        phase: pointer(&command.phase),
    }
}

fn bits(numbers: &[f64]) -> impl Iterator<Item = u64> {
    numbers.iter().map(|number| number.to_bits())
}

#[test]
fn random_commands_match_rust_to_the_bit_and_allocate_nothing() {
    for kind in [Kind::Discrete, Kind::Rhythmic] {
        matches_rust(kind, &Limits::default(), 200_000);
    }
}

#[test]
fn random_commands_within_limits_match_rust_to_the_bit_and_allocate_nothing() {
    let independent = Limits {
        lower: Some(vec![-0.5]),
        upper: Some(vec![0.75]),
        velocity: Some(vec![1.5]),
        acceleration: Some(vec![20.0]),
        jerk: Some(vec![500.0]),
        synchronous: false,
    };
    // Every command looks ahead along the path.
    let synchronous = Limits { jerk: None, synchronous: true, ..independent.clone() };
    for kind in [Kind::Discrete, Kind::Rhythmic] {
        matches_rust(kind, &independent, 200_000);
        matches_rust(kind, &synchronous, 4000);
    }
}

/// Compares the controllers of Rust and C over a number of ticks of random commands within limits, of one number for all DoFs.
fn matches_rust(kind: Kind, limits: &Limits, n_ticks: usize) {
    let is_limited = *limits != Limits::default();
    let demos = if kind == Kind::Discrete { reaches() } else { cycles() };
    let model = learn(&demos, &options(kind));
    let (n_dofs, n_styles, own) = (model.n_dofs(), model.n_styles(), model.tau());
    let mut rust = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
    let none = pdmp_text { data: ptr::null_mut(), size: 0 };
    let bytes = model.to_bytes().unwrap();
    let (mut loaded, mut made) = (MaybeUninit::uninit(), MaybeUninit::uninit());
    let memory = pdmp_memory { data: ptr::null_mut(), size: 0 };
    let settings = pdmp_settings { dt: 1e-3, transition: ptr::null(), memory };
    // SAFETY: every pointer is NULL or valid.
    let c = unsafe {
        pdmp_model_from_bytes(bytes.as_ptr().cast(), bytes.len(), Some(&mut loaded), none);
        let model = Box::from_raw(loaded.assume_init());
        pdmp_controller_new(Some(&model), Some(&settings), None, Some(&mut made), none);
        made.assume_init()
    };
    let each = |limit: &Option<Vec<f64>>| limit.as_ref().map(|limit| vec![limit[0]; n_dofs]);
    let Limits { lower, upper, velocity, acceleration, jerk, synchronous } = limits;
    let [lower, upper, velocity, acceleration, jerk] = [lower, upper, velocity, acceleration, jerk].map(each);
    let independent = i32::from(!synchronous);
    let [lower, upper, velocity, acceleration, jerk] =
        [&lower, &upper, &velocity, &acceleration, &jerk].map(|limits| vector(limits.as_deref()));
    let c_limits = pdmp_limits { lower, upper, velocity, acceleration, jerk, independent };
    rust.set_limits(limits).unwrap();
    // SAFETY: the controller is alive, and the vectors are valid.
    assert_eq!(unsafe { pdmp_controller_set_limits(c.as_mut(), Some(&c_limits)) }, pdmp_status::PDMP_OK);
    let mut cloned = MaybeUninit::uninit();
    // SAFETY: the controller is alive.
    let copy = unsafe {
        assert_eq!(pdmp_controller_clone(c.as_ref(), memory, Some(&mut cloned), none), pdmp_status::PDMP_OK);
        cloned.assume_init()
    };

    let mut random = Random(1);
    let mut values = vec![0.0; n_dofs.max(n_styles)];
    let zeros = || vec![0.0; n_dofs];
    let (mut position, mut velocity, mut acceleration) = (zeros(), zeros(), zeros());
    let mut written = [zeros(), zeros(), zeros()];
    let buffers = written.each_mut().map(|output| pdmp_buffer { data: output.as_mut_ptr(), length: n_dofs });
    let out = pdmp_motion { position: buffers[0], velocity: buffers[1], acceleration: buffers[2] };
    let mut message = [0; 256];
    let mut limited = vec![pdmp_limit::PDMP_LIMIT_NONE; n_dofs];
    let mut ticks_limited = 0;
    let (mut accepted, before) = (0, allocations());
    for _ in 0..n_ticks {
        values.iter_mut().for_each(|v| *v = 2.0 * random.next() - 1.0);
        // Errors must not allocate either.
        if random.next() < 0.01 {
            values[0] = f64::NAN;
        }
        let per_dof = &values[..n_dofs];
        let command = Command {
            dt: random.rarely().then_some(1e-3 * (0.1 + values[n_dofs - 1].abs())),
            style: random.rarely().then_some(&values[..n_styles]),
            goal: (random.rarely() && kind == Kind::Discrete).then_some(per_dof),
            goal_velocity: (random.rarely() && kind == Kind::Discrete).then_some(per_dof),
            anchor: (random.rarely() && kind == Kind::Rhythmic).then_some(per_dof),
            tau: random.rarely().then_some(own * (0.5 + random.next())),
            amplitude: (random.rarely() && kind == Kind::Rhythmic).then_some(values[0].abs()),
            measured: random.rarely().then_some(per_dof),
            coupling: random.rarely().then_some(Coupling { velocity: per_dof, acceleration: per_dof }),
            phase: (random.rarely() && kind == Kind::Rhythmic).then_some(10.0 * values[0]),
        };
        let mut motion = Motion { position: &mut position, velocity: &mut velocity, acceleration: &mut acceleration };
        let expected = rust.update(&command, &mut motion);
        // SAFETY: the controller is alive, and the command and the motion are valid.
        let status = unsafe { pdmp_controller_update(c.as_mut(), Some(&to_c(&command)), Some(&out)) };
        let updated = expected.is_ok();
        assert_eq!(status, expected.map_or(pdmp_status::PDMP_RANGE, pdmp_status::from));
        let (style, tau) = (&values[..n_styles], own * (0.5 + random.next()));
        // SAFETY: the controller is alive, and vectors and text are valid.
        let (expected, status) = unsafe {
            match (random.next() * 20.0) as u8 {
                0 => (rust.set_style(style), pdmp_controller_set_style(c.as_mut(), vector(Some(style)))),
                1 => (rust.set_goal(per_dof), pdmp_controller_set_goal(c.as_mut(), vector(Some(per_dof)))),
                6 => {
                    let velocity = (tau > own).then_some(per_dof);
                    let rust = rust.set_goal_velocity(velocity);
                    (rust, pdmp_controller_set_goal_velocity(c.as_mut(), vector(velocity)))
                }
                2 => (rust.set_anchor(per_dof), pdmp_controller_set_anchor(c.as_mut(), vector(Some(per_dof)))),
                3 => (rust.set_tau(tau), pdmp_controller_set_tau(c.as_mut(), tau)),
                4 => (rust.set_amplitude(tau), pdmp_controller_set_amplitude(c.as_mut(), tau)),
                5 => (
                    rust.set_compliance(Compliance { stopping: tau, tracking: tau }),
                    pdmp_controller_set_compliance(c.as_mut(), tau, tau),
                ),
                7 => (rust.set_phase(tau), pdmp_controller_set_phase(c.as_mut(), tau)),
                8 => (rust.set_phase_gain(tau), pdmp_controller_set_phase_gain(c.as_mut(), tau)),
                9 => (rust.set_tolerance(tau - own), pdmp_controller_set_tolerance(c.as_mut(), tau - own)),
                10 => (rust.set_limits(limits), pdmp_controller_set_limits(c.as_mut(), Some(&c_limits))),
                _ => (Ok(()), pdmp_status::PDMP_OK),
            }
        };
        assert_eq!(expected.is_ok(), status == pdmp_status::PDMP_OK);
        accepted += usize::from(updated && expected.is_ok());
        if expected.is_err() {
            let text = pdmp_text { data: message.as_mut_ptr(), size: message.len() };
            // SAFETY: the text is valid over its size.
            assert!(unsafe { pdmp_controller_error(c.as_ref(), text) } > 0);
        }
        let pairs = [(&position, &written[0]), (&velocity, &written[1]), (&acceleration, &written[2])];
        assert!(pairs.into_iter().all(|(rust, c)| bits(rust).eq(bits(c))));
        // SAFETY: the controller is alive, and the array has an element for each DoF.
        let status = unsafe { pdmp_controller_limited(c.as_mut(), limited.as_mut_ptr(), n_dofs) };
        assert_eq!(status, rust.status().into());
        assert!(rust.limited().iter().zip(&limited).all(|(rust, c)| pdmp_limit::from(*rust) == *c));
        ticks_limited += usize::from(rust.limited().iter().any(Option::is_some));
        if random.rarely() {
            // SAFETY: both controllers are alive.
            unsafe {
                assert_eq!(pdmp_controller_copy(c, copy), pdmp_status::PDMP_OK);
                assert_eq!(pdmp_controller_step(copy.as_mut()), pdmp_controller_step(c.as_mut()));
                pdmp_controller_read(copy.as_mut(), Some(&out));
                assert!(rust.step().is_ok() && bits(rust.position()).eq(bits(&written[0])));
                pdmp_controller_read(c.as_mut(), Some(&out));
                assert!(bits(rust.position()).eq(bits(&written[0])));
            }
            position.copy_from_slice(rust.position());
            velocity.copy_from_slice(rust.velocity());
            acceleration.copy_from_slice(rust.acceleration());
        }
    }
    assert_eq!(allocations() - before, 0);
    println!("{kind}: {accepted} of {n_ticks} commands accepted, {ticks_limited} ticks limited");
    assert_eq!(ticks_limited > n_ticks / 20, is_limited, "{kind}: {ticks_limited}");
    assert!(accepted >= n_ticks / 2, "{kind}: {accepted} of {n_ticks} commands accepted");
    // SAFETY: the controllers are alive and not used again.
    unsafe {
        pdmp_controller_free(c);
        pdmp_controller_free(copy);
    };
}

/// Observations of random parts at random times, of positions and of poses, give the estimates of Rust to the bit, and
/// allocate nothing.
#[test]
fn recognition_matches_rust_to_the_bit_and_allocates_nothing() {
    let turning = poses::screws(5, 2.0, 0.4, 101, 1).into_iter().map(poses::pose).collect();
    for (kind, demos) in [(Kind::Discrete, reaches()), (Kind::Rhythmic, cycles()), (Kind::Discrete, turning)] {
        let model = learn(&demos, &options(kind));
        let prior = learn_prior(&model, &demos, None, Threads::ONE).unwrap();
        let timing = Timing { starts: [-0.1, 0.2], duration: None };
        let mut rust = Recogniser::new(&model, &prior, timing).unwrap();
        let bytes = prior.to_bytes(&model).unwrap();
        let none = pdmp_text { data: ptr::null_mut(), size: 0 };
        let c_timing = pdmp_timing { earliest: -0.1, latest: 0.2, duration: ptr::null() };
        let mut made = MaybeUninit::uninit();
        // SAFETY: every pointer is valid, and the library allocates a recogniser as a `Box`.
        let mut c = unsafe {
            let (data, size) = (bytes.as_ptr().cast(), bytes.len());
            let status = pdmp_recogniser_from_bytes(data, size, vector(None), Some(&c_timing), Some(&mut made), none);
            assert_eq!(status, pdmp_status::PDMP_OK);
            Box::from_raw(made.assume_init())
        };
        let (n_coordinates, n_dofs) = (model.n_coordinates(), model.n_dofs());
        let (mut position, mut random, mut time) = (vec![0.0; n_coordinates], Random(4), 3.0);
        let zeros = || [vec![0.0; 2 * n_coordinates], vec![0.0; 2 * n_dofs]];
        let ([mut mean, mut deviation], mut written) = (zeros(), zeros());
        let buffers =
            written.each_mut().map(|numbers| pdmp_buffer { data: numbers.as_mut_ptr(), length: numbers.len() });
        let (mut estimates, before) = (0, allocations());
        for k in 0..60 {
            time += random.scale(1e-3, 0.05);
            if k == 40 {
                rust.reset();
                assert_eq!(pdmp_recogniser_reset(Some(&mut c)), pdmp_status::PDMP_OK);
            }
            position.iter_mut().for_each(|y| *y = if random.rarely() { f64::NAN } else { random.next() });
            if n_coordinates > n_dofs {
                let norm = position[3..].iter().map(|x| x * x).sum::<f64>().sqrt();
                position[3..].iter_mut().for_each(|x| *x /= norm);
            }
            let mut estimate = MaybeUninit::uninit();
            let ahead = [time, time + 0.1];
            // SAFETY: the vectors and buffers are valid.
            unsafe {
                let status = pdmp_recogniser_update(Some(&mut c), time, vector(Some(&position)));
                assert_eq!(rust.update(time, &position).is_ok(), status == pdmp_status::PDMP_OK);
                let status = pdmp_recogniser_continuation(Some(&mut c), vector(Some(&ahead)), buffers[0], buffers[1]);
                let done = rust.write_continuation(&ahead, &mut mean, &mut deviation);
                assert_eq!(done.is_ok(), status == pdmp_status::PDMP_OK);
                assert!(bits(&mean).eq(bits(&written[0])) && bits(&deviation).eq(bits(&written[1])));
            }
            let status = pdmp_recogniser_estimate(Some(&mut c), Some(&mut estimate));
            let Ok(expected) = rust.estimate() else {
                assert_eq!(status, pdmp_status::PDMP_RANGE);
                continue;
            };
            assert_eq!(status, pdmp_status::PDMP_OK);
            // SAFETY: the call has succeeded, so it is written.
            let found = unsafe { estimate.assume_init() };
            let conditions = found.conditions;
            // SAFETY: the members point into the recogniser, which is not used until the end of this block.
            let same = |vector: pdmp_vector, numbers: &[f64]| unsafe {
                bits(std::slice::from_raw_parts(vector.data, vector.length)).eq(bits(numbers))
            };
            let n_styles = expected.n_styles;
            let discrete = kind == Kind::Discrete;
            assert!(same(conditions.style, expected.style()));
            assert!(same(if discrete { conditions.goal } else { conditions.anchor }, expected.goal()));
            assert!(!discrete || same(conditions.start, expected.start()));
            assert!(same(found.style_deviation, &expected.deviations[..n_styles]));
            assert!(same(found.goal_deviation, expected.goal_deviation()));
            assert_eq!(conditions.phase.is_null(), discrete);
            // SAFETY: as above.
            let tau = unsafe { *conditions.tau };
            assert!((tau / (model.tau() * expected.duration / model.duration()) - 1.0).abs() < 1e-12);
            let numbers = [found.duration, found.duration_deviation, found.arrival, found.fraction];
            let rust = [expected.duration, expected.duration_deviation, expected.arrival, expected.fraction];
            assert!(bits(&[found.stopped, found.surprise]).eq(bits(&[expected.stopped, expected.surprise])));
            assert!(bits(&numbers).eq(bits(&rust)));
            estimates += 1;
        }
        assert_eq!(allocations() - before, 0);
        assert!(estimates > 50, "{estimates}");
    }
}
