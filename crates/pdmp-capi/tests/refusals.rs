//! Invalid calls return an error status and a message, and change nothing.
#![allow(missing_docs, unsafe_code)]

#[path = "../../pdmp-core/tests/common/mod.rs"]
mod common;
#[path = "../../pdmp-core/tests/common/poses.rs"]
mod poses;
#[path = "../../pdmp-core/tests/common/random.rs"]
mod random;

use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::ptr;

use common::*;
use pdmp::pdmp_status::*;
use pdmp::*;
use pdmp_core::context::{ContextMapKind, MapSelection};
use pdmp_core::learning::{TimeScaling, learn_prior};
use pdmp_core::model::TimeWarp;
use pdmp_core::motion::{TimeGrid, TwoArms};
use pdmp_core::numerics::Threads;
use pdmp_core::{Error, Kind, rollout};

const NO_VECTOR: pdmp_vector = pdmp_vector { data: ptr::null(), length: 0 };
const NO_TEXT: pdmp_text = pdmp_text { data: ptr::null_mut(), size: 0 };
const NO_BUFFER: pdmp_buffer = pdmp_buffer { data: ptr::null_mut(), length: 0 };
const NO_COMMAND: pdmp_command = pdmp_command {
    style: NO_VECTOR,
    goal: NO_VECTOR,
    goal_velocity: NO_VECTOR,
    anchor: NO_VECTOR,
    tau: ptr::null(),
    amplitude: ptr::null(),
    dt: ptr::null(),
    measured: NO_VECTOR,
    coupling: pdmp_coupling { velocity: NO_VECTOR, acceleration: NO_VECTOR },
    phase: ptr::null(),
};
const NO_CONDITIONS: pdmp_conditions = pdmp_conditions {
    style: NO_VECTOR,
    goal: NO_VECTOR,
    anchor: NO_VECTOR,
    start: NO_VECTOR,
    velocity: NO_VECTOR,
    goal_velocity: NO_VECTOR,
    amplitude: ptr::null(),
    tau: ptr::null(),
    phase: ptr::null(),
    forcing: ptr::null(),
};
const SETTINGS: pdmp_settings =
    pdmp_settings { dt: 1e-3, transition: ptr::null(), memory: pdmp_memory { data: ptr::null_mut(), size: 0 } };

const NO_LIMITS: pdmp_limits = pdmp_limits {
    lower: NO_VECTOR,
    upper: NO_VECTOR,
    velocity: NO_VECTOR,
    acceleration: NO_VECTOR,
    jerk: NO_VECTOR,
    independent: 0,
};

fn vector(numbers: &[f64]) -> pdmp_vector {
    pdmp_vector { data: numbers.as_ptr(), length: numbers.len() }
}

fn buffer(numbers: &mut [f64]) -> pdmp_buffer {
    pdmp_buffer { data: numbers.as_mut_ptr(), length: numbers.len() }
}

/// Returns a point at a time without position or velocity.
fn point_at(time: &f64) -> pdmp_point {
    pdmp_point {
        time,
        phase: ptr::null(),
        position: NO_VECTOR,
        velocity: NO_VECTOR,
        dofs: ptr::null(),
        n_dofs: 0,
        tolerance: 0.0,
    }
}

/// Returns the result of a call, and the string that it writes to a text of `size` bytes.
fn with_text<T>(size: usize, call: impl FnOnce(pdmp_text) -> T) -> (T, String) {
    // Bytes that are not zero, so that a missing terminator is detected.
    let mut text = vec![b'?' as c_char; size];
    let result = call(pdmp_text { data: text.as_mut_ptr(), size });
    let text = match text.contains(&0) {
        // SAFETY: the text contains a zero byte.
        true => unsafe { CStr::from_ptr(text.as_ptr()) }.to_str().unwrap().to_string(),
        false => String::new(),
    };
    (result, text)
}

fn load(bytes: &[u8]) -> (pdmp_status, *mut pdmp_model, String) {
    let mut model = MaybeUninit::uninit();
    let (status, text) = with_text(256, |error| {
        // SAFETY: every pointer is valid.
        unsafe { pdmp_model_from_bytes(bytes.as_ptr().cast(), bytes.len(), Some(&mut model), error) }
    });
    // SAFETY: the model is written on success and on error.
    (status, unsafe { model.assume_init() }, text)
}

fn loaded(kind: Kind) -> Box<pdmp_model> {
    let demos = if kind == Kind::Discrete { reaches() } else { cycles() };
    let (status, model, _) = load(&learn(&demos, &options(kind)).to_bytes().unwrap());
    assert_eq!(status, PDMP_OK);
    // SAFETY: the model is new, and the library allocates it as a `Box`.
    unsafe { Box::from_raw(model) }
}

fn info(model: &pdmp_model) -> pdmp_info {
    let mut info = MaybeUninit::uninit();
    assert_eq!(pdmp_model_describe(Some(model), Some(&mut info)), PDMP_OK);
    // SAFETY: the call has succeeded, so it is written.
    unsafe { info.assume_init() }
}

fn start(
    model: &pdmp_model,
    settings: &pdmp_settings,
    conditions: Option<&pdmp_conditions>,
) -> (pdmp_status, *mut pdmp_controller, String) {
    let mut controller = MaybeUninit::uninit();
    let (status, text) = with_text(256, |error| {
        // SAFETY: every pointer is NULL or valid.
        unsafe { pdmp_controller_new(Some(model), Some(settings), conditions, Some(&mut controller), error) }
    });
    // SAFETY: the controller is written on success and on error.
    (status, unsafe { controller.assume_init() }, text)
}

/// A controller that is freed at the end of the test.
struct Running(*mut pdmp_controller);

impl Running {
    fn new(model: &pdmp_model) -> Self {
        let (status, controller, _) = start(model, &SETTINGS, None);
        assert_eq!(status, PDMP_OK);
        Self(controller)
    }

    fn handle(&mut self) -> Option<&mut pdmp_controller> {
        // SAFETY: the controller is alive until `self` is dropped.
        unsafe { self.0.as_mut() }
    }

    fn update(&mut self, command: &pdmp_command) -> pdmp_status {
        // SAFETY: the pointers of the tests' commands are NULL or valid.
        unsafe { pdmp_controller_update(self.handle(), Some(command), None) }
    }

    fn error(&mut self) -> String {
        // SAFETY: the text is valid over its size.
        with_text(256, |text| unsafe { pdmp_controller_error(self.handle().as_deref(), text) }).1
    }

    /// Returns position, velocity, acceleration, time and phase.
    fn state(&mut self, n_dofs: usize) -> Vec<f64> {
        let mut motion = vec![f64::NAN; 3 * n_dofs];
        let buffers: Vec<_> = motion.chunks_mut(n_dofs).map(buffer).collect();
        let outputs = pdmp_motion { position: buffers[0], velocity: buffers[1], acceleration: buffers[2] };
        let (mut time, mut phase) = (MaybeUninit::uninit(), MaybeUninit::uninit());
        pdmp_controller_progress(self.handle().as_deref(), Some(&mut time), Some(&mut phase));
        // SAFETY: the buffers hold n_dofs numbers each, and time and phase have been written.
        unsafe {
            assert!(pdmp_controller_read(self.handle(), Some(&outputs)) as i32 > 0);
            motion.extend([time.assume_init(), phase.assume_init()]);
        }
        motion
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // SAFETY: the controller is alive and not used again.
        unsafe { pdmp_controller_free(self.0) };
    }
}

#[test]
fn null_for_a_required_argument_is_an_error() {
    let model = loaded(Kind::Discrete);
    let (mut made, mut out) = (MaybeUninit::uninit(), MaybeUninit::uninit());
    let (mut passed, mut watching) = (MaybeUninit::uninit(), MaybeUninit::uninit());
    let mut conditions = MaybeUninit::uninit();
    let mut numbers = vec![0.0; info(&model).n_conditions];
    let storage = buffer(&mut numbers);
    let mut running = Running::new(&model);
    // SAFETY: every pointer is NULL or valid.
    unsafe {
        for status in [
            pdmp_model_load(ptr::null(), Some(&mut made), NO_TEXT),
            pdmp_model_load(c"absent".as_ptr(), None, NO_TEXT),
            pdmp_model_from_bytes(ptr::null(), 0, Some(&mut made), NO_TEXT),
            pdmp_model_from_bytes(ptr::null(), 8, Some(&mut made), NO_TEXT),
            pdmp_model_from_bytes([0u8; 8].as_ptr().cast(), 8, None, NO_TEXT),
            pdmp_model_describe(None, None),
            pdmp_model_describe(Some(&model), None),
            pdmp_model_demonstration(None, 0, Some(&mut conditions), storage, NO_TEXT),
            pdmp_model_demonstration(Some(&model), 0, None, storage, NO_TEXT),
            pdmp_model_demonstration(Some(&model), 0, Some(&mut conditions), NO_BUFFER, NO_TEXT),
            pdmp_model_predict(None, NO_VECTOR, Some(&mut conditions), storage, NO_TEXT),
            pdmp_model_predict(Some(&model), NO_VECTOR, Some(&mut conditions), storage, NO_TEXT),
            pdmp_model_predict(Some(&model), vector(&[0.2]), None, storage, NO_TEXT),
            pdmp_model_predict(Some(&model), vector(&[0.2]), Some(&mut conditions), NO_BUFFER, NO_TEXT),
            pdmp_controller_new(None, Some(&SETTINGS), None, Some(&mut out), NO_TEXT),
            pdmp_controller_new(Some(&model), None, None, Some(&mut out), NO_TEXT),
            pdmp_controller_new(Some(&model), Some(&SETTINGS), None, None, NO_TEXT),
            pdmp_controller_reset(None, None),
            pdmp_controller_set_style(None, NO_VECTOR),
            pdmp_controller_set_goal(None, NO_VECTOR),
            pdmp_controller_set_anchor(None, NO_VECTOR),
            pdmp_controller_set_tau(None, 1.0),
            pdmp_controller_set_amplitude(None, 1.0),
            pdmp_controller_set_compliance(None, 1.0, 1.0),
            pdmp_controller_set_speed(None, 1.0),
            pdmp_controller_set_phase(None, 1.0),
            pdmp_controller_set_phase_gain(None, 1.0),
            pdmp_controller_set_tolerance(None, 0.1),
            pdmp_controller_release(None),
            pdmp_controller_clone(None, SETTINGS.memory, Some(&mut out), NO_TEXT),
            pdmp_controller_clone(running.handle().as_deref(), SETTINGS.memory, None, NO_TEXT),
            pdmp_controller_copy(ptr::null(), ptr::null_mut()),
            pdmp_controller_copy(ptr::null(), running.0),
            pdmp_controller_copy(running.0, ptr::null_mut()),
            pdmp_controller_set_style(running.handle(), NO_VECTOR),
            pdmp_controller_set_goal(running.handle(), NO_VECTOR),
            pdmp_controller_set_goal(running.handle(), pdmp_vector { data: ptr::null(), length: 3 }),
            pdmp_controller_set_goal_velocity(running.handle(), pdmp_vector { data: ptr::null(), length: 3 }),
            pdmp_controller_set_limits(None, None),
            pdmp_controller_limited(None, ptr::null_mut(), 0),
            pdmp_controller_limited(running.handle(), ptr::null_mut(), 3),
            pdmp_controller_step(None),
            pdmp_controller_update(None, None, None),
            pdmp_controller_read(None, None),
            pdmp_controller_read(running.handle(), None),
            pdmp_controller_progress(None, None, None),
            pdmp_model_rollout(None, None, 0.01, 2, None, NO_TEXT),
            pdmp_model_rollout(Some(&model), None, 0.01, 2, None, NO_TEXT),
            pdmp_controller_forecast(None, 0.01, 2, None),
            pdmp_controller_forecast(running.handle(), 0.01, 2, None),
            pdmp_model_through(None, ptr::null(), 0, None, None, Some(&mut passed), NO_TEXT),
            pdmp_model_through(Some(&model), ptr::null(), 0, None, None, Some(&mut passed), NO_TEXT),
            pdmp_model_through(Some(&model), ptr::null(), 2, None, None, Some(&mut passed), NO_TEXT),
            pdmp_model_through(Some(&model), [point_at(&0.4)].as_ptr(), 1, None, None, None, NO_TEXT),
            pdmp_passage_describe(None, None),
            pdmp_controller_add_forcing(None, None),
            pdmp_controller_add_forcing(running.handle(), None),
            pdmp_recogniser_load(ptr::null(), NO_VECTOR, None, Some(&mut watching), NO_TEXT),
            pdmp_recogniser_load(c"absent".as_ptr(), NO_VECTOR, None, None, NO_TEXT),
            pdmp_recogniser_from_bytes(ptr::null(), 8, NO_VECTOR, None, Some(&mut watching), NO_TEXT),
            pdmp_recogniser_update(None, 0.0, NO_VECTOR),
            pdmp_recogniser_estimate(None, None),
            pdmp_recogniser_continuation(None, NO_VECTOR, NO_BUFFER, NO_BUFFER),
            pdmp_recogniser_reset(None),
            pdmp_controller_read(running.handle(), None),
        ] {
            assert_eq!(status, PDMP_NULL);
        }
        assert_eq!(pdmp_controller_error(None, NO_TEXT) + pdmp_recogniser_error(None, NO_TEXT), 0);
        assert!(pdmp_model_name(None, 0).is_null() && pdmp_model_unit(None, 0).is_null());
        pdmp_controller_free(ptr::null_mut());
    }
    pdmp_model_free(None);
    pdmp_passage_free(None);
    pdmp_recogniser_free(None);
    assert_eq!(running.error(), "motion is NULL");
}

#[test]
fn null_for_an_optional_argument_is_its_default() {
    let model = loaded(Kind::Discrete);
    let (mut a, mut b) = (Running::new(&model), Running::new(&model));
    assert_eq!(pdmp_controller_step(a.handle()), PDMP_WORKING);
    // SAFETY: both pointers are NULL.
    assert_eq!(unsafe { pdmp_controller_update(b.handle(), None, None) }, PDMP_WORKING);
    assert_eq!(a.state(3), b.state(3));
    // SAFETY: as above.
    assert_eq!(unsafe { pdmp_controller_reset(a.handle(), None) }, PDMP_OK);
    assert_eq!(a.state(3), Running::new(&model).state(3));
    assert_eq!(a.error(), "");
}

#[test]
fn an_invalid_command_changes_nothing_and_leaves_a_message() {
    let model = loaded(Kind::Discrete);
    let mut running = Running::new(&model);
    assert_eq!(pdmp_controller_step(running.handle()), PDMP_WORKING);
    let before = running.state(3);
    let (three, two, nan) = ([0.5; 3], [0.5; 2], [0.5, f64::NAN, 0.5]);
    let (huge, negative) = (usize::MAX, -1e-3);
    let none = NO_COMMAND;
    let half = pdmp_coupling { velocity: vector(&three), acceleration: NO_VECTOR };
    for (command, status, text) in [
        (pdmp_command { goal: vector(&two), ..none }, PDMP_LENGTH, "goal has length 2, expected 3: one value per DoF"),
        (
            pdmp_command { measured: pdmp_vector { data: three.as_ptr(), length: huge }, ..none },
            PDMP_LENGTH,
            &format!("measured has length {huge}, expected 3: one value per DoF"),
        ),
        (
            pdmp_command { style: vector(&[0.0; 9]), goal: vector(&three), ..none },
            PDMP_LENGTH,
            &format!("style has length 9, expected {}: one value per style dimension", info(&model).n_styles),
        ),
        (pdmp_command { goal: vector(&nan), ..none }, PDMP_RANGE, "goal[1] = NaN: every number must be finite"),
        (pdmp_command { dt: &negative, ..none }, PDMP_RANGE, "dt = -0.001: must be finite and not negative"),
        (
            pdmp_command { anchor: vector(&three), ..none },
            PDMP_ABSENT,
            "anchor does not apply to a discrete primitive: it moves to a goal; set goal",
        ),
        (
            pdmp_command { phase: &1.0, ..none },
            PDMP_ABSENT,
            "phase does not apply to a discrete primitive: its state depends on its past; it starts at the start of its path",
        ),
        (pdmp_command { coupling: half, ..none }, PDMP_NULL, "coupling acceleration is NULL"),
        // The valid part of an invalid command takes no effect either.
        (
            pdmp_command { goal: vector(&three), tau: &f64::NAN, ..none },
            PDMP_RANGE,
            "tau = NaN: must be positive and finite",
        ),
    ] {
        assert_eq!(running.update(&command), status, "{text}");
        assert_eq!(running.error(), text);
        assert_eq!(running.state(3), before);
    }
    let mut two = [0.0; 2];
    let short = pdmp_motion { position: buffer(&mut two), velocity: NO_BUFFER, acceleration: NO_BUFFER };
    // SAFETY: every pointer is NULL or valid over its length.
    unsafe {
        assert_eq!(pdmp_controller_update(running.handle(), None, Some(&short)), PDMP_LENGTH);
        assert_eq!(pdmp_controller_read(running.handle(), Some(&short)), PDMP_LENGTH);
        let conditions = pdmp_conditions { start: vector(&two), ..NO_CONDITIONS };
        assert_eq!(pdmp_controller_reset(running.handle(), Some(&conditions)), PDMP_LENGTH);
        assert_eq!(pdmp_controller_set_anchor(running.handle(), vector(&three)), PDMP_ABSENT);
    }
    assert_eq!(pdmp_controller_set_amplitude(running.handle(), 1.0), PDMP_ABSENT);
    assert_eq!(pdmp_controller_set_tau(running.handle(), -1.0), PDMP_RANGE);
    assert_eq!(pdmp_controller_set_phase(running.handle(), 1.0), PDMP_ABSENT);
    assert_eq!(pdmp_controller_set_phase_gain(running.handle(), -1.0), PDMP_RANGE);
    assert_eq!(pdmp_controller_set_compliance(running.handle(), -1.0, 0.0), PDMP_RANGE);
    assert_eq!(pdmp_controller_set_tolerance(running.handle(), 0.0), PDMP_RANGE);
    assert_eq!(running.state(3), before);
}

/// Returns the limits that determined the accelerations of the last tick, in a buffer of four elements.
fn limited(running: &mut Running) -> [pdmp_limit; 4] {
    // An element beyond the DoFs keeps this value.
    let mut limited = [pdmp_limit::PDMP_LIMIT_VELOCITY; 4];
    // SAFETY: the array has four elements.
    let status = unsafe { pdmp_controller_limited(running.handle(), limited.as_mut_ptr(), limited.len()) };
    assert_eq!(status, pdmp_controller_progress(running.handle().as_deref(), None, None));
    limited
}

#[test]
fn invalid_limits_leave_the_present_ones_and_a_message() {
    let model = loaded(Kind::Discrete);
    let mut running = Running::new(&model);
    let set = |running: &mut Running, limits: &pdmp_limits| {
        // SAFETY: the pointers of the tests' limits are NULL or valid.
        unsafe { pdmp_controller_set_limits(running.handle(), Some(limits)) }
    };
    assert_eq!(set(&mut running, &pdmp_limits { velocity: vector(&[0.25; 3]), ..NO_LIMITS }), PDMP_OK);
    let (three, two) = ([0.5; 3], [0.5; 2]);
    let null = pdmp_vector { data: ptr::null(), length: 3 };
    let huge = pdmp_vector { data: three.as_ptr(), length: usize::MAX };
    for (limits, status, text) in [
        (pdmp_limits { lower: vector(&two), ..NO_LIMITS }, PDMP_LENGTH, "lower has length 2, expected 3"),
        (pdmp_limits { upper: huge, ..NO_LIMITS }, PDMP_LENGTH, "upper has length"),
        (pdmp_limits { velocity: vector(&[]), ..NO_LIMITS }, PDMP_LENGTH, "velocity has length 0, expected 3"),
        (pdmp_limits { acceleration: null, ..NO_LIMITS }, PDMP_NULL, "acceleration is NULL"),
        (pdmp_limits { velocity: vector(&[1.0, f64::NAN, 1.0]), ..NO_LIMITS }, PDMP_RANGE, "velocity[1] = NaN"),
        (pdmp_limits { velocity: vector(&[1.0, 0.0, 1.0]), ..NO_LIMITS }, PDMP_RANGE, "velocity = 0: "),
        (pdmp_limits { acceleration: vector(&[-1.0]), ..NO_LIMITS }, PDMP_RANGE, "acceleration = -1: "),
        (
            pdmp_limits { lower: vector(&[0.0, 1.0, 0.0]), upper: vector(&[1.0; 3]), ..NO_LIMITS },
            PDMP_RANGE,
            "limits of DoF 1: the lower limit 1 must be below the upper limit 1",
        ),
        (
            pdmp_limits { jerk: vector(&[1e3; 3]), ..NO_LIMITS },
            PDMP_RANGE,
            "limits of DoF 0: a jerk of 1000 needs a limit of the acceleration",
        ),
    ] {
        assert_eq!(set(&mut running, &limits), status, "{text}");
        assert!(running.error().starts_with(text), "{}", running.error());
    }
    let mut short = [pdmp_limit::PDMP_LIMIT_NONE; 2];
    // SAFETY: the array has two elements.
    assert_eq!(unsafe { pdmp_controller_limited(running.handle(), short.as_mut_ptr(), 2) }, PDMP_LENGTH);
    assert_eq!(running.error(), "limited has length 2, expected 3: one value per DoF");

    let mut slowed = 0;
    while pdmp_controller_step(running.handle()) == PDMP_WORKING {
        assert!(running.state(3)[3..6].iter().all(|velocity| velocity.abs() <= 0.25));
        slowed += limited(&mut running)[..3].iter().filter(|limit| **limit == pdmp_limit::PDMP_LIMIT_VELOCITY).count();
    }
    assert!(slowed > 0);
}

#[test]
fn limits_of_one_number_are_those_of_all_dofs_and_null_removes_them() {
    let model = loaded(Kind::Discrete);
    let (mut one, mut each, mut free) = (Running::new(&model), Running::new(&model), Running::new(&model));
    let limits = |velocity, acceleration| pdmp_limits { velocity, acceleration, ..NO_LIMITS };
    // SAFETY: the vectors are valid over their lengths.
    unsafe {
        let (by_dof, by_number) = (vector(&[0.5; 3]), vector(&[0.5]));
        assert_eq!(pdmp_controller_set_limits(each.handle(), Some(&limits(by_dof, vector(&[4.0; 3])))), PDMP_OK);
        assert_eq!(pdmp_controller_set_limits(one.handle(), Some(&limits(by_number, vector(&[4.0])))), PDMP_OK);
    }
    for _ in 0..300 {
        assert_eq!(pdmp_controller_step(one.handle()), pdmp_controller_step(each.handle()));
        assert_eq!(one.state(3), each.state(3));
        assert_eq!(limited(&mut one), limited(&mut each));
        assert_eq!(limited(&mut one)[3], pdmp_limit::PDMP_LIMIT_VELOCITY);
    }
    // SAFETY: NULL is valid.
    unsafe {
        assert_eq!(pdmp_controller_set_limits(one.handle(), None), PDMP_OK);
        assert_eq!(pdmp_controller_reset(one.handle(), None), PDMP_OK);
    }
    for _ in 0..300 {
        assert_eq!(pdmp_controller_step(one.handle()), pdmp_controller_step(free.handle()));
        assert_eq!(one.state(3), free.state(3));
        assert_eq!(limited(&mut one)[..3], [pdmp_limit::PDMP_LIMIT_NONE; 3]);
    }
}

#[test]
fn outputs_may_overlap_with_the_command() {
    let model = loaded(Kind::Discrete);
    let (mut apart, mut same) = (Running::new(&model), Running::new(&model));
    let (mut from, mut to) = (vec![0.3; 3], vec![0.0; 3]);
    for _ in 0..100 {
        let motion = pdmp_motion { position: buffer(&mut to), velocity: NO_BUFFER, acceleration: NO_BUFFER };
        let command = pdmp_command { measured: vector(&from), ..NO_COMMAND };
        // SAFETY: both arrays have three numbers.
        assert_eq!(unsafe { pdmp_controller_update(apart.handle(), Some(&command), Some(&motion)) }, PDMP_WORKING);
        let shared = buffer(&mut from);
        let command = pdmp_command { measured: pdmp_vector { data: shared.data, length: 3 }, ..NO_COMMAND };
        let motion = pdmp_motion { position: shared, velocity: NO_BUFFER, acceleration: NO_BUFFER };
        // SAFETY: as above.
        assert_eq!(unsafe { pdmp_controller_update(same.handle(), Some(&command), Some(&motion)) }, PDMP_WORKING);
        assert_eq!(from, to);
    }
}

#[test]
fn a_controller_accepts_memory_that_is_large_enough_and_aligned() {
    let model = loaded(Kind::Rhythmic);
    let (size, alignment) = (pdmp_controller_size(), pdmp_controller_alignment());
    let mut bytes = vec![0u8; size + 2 * alignment];
    let aligned = bytes.as_ptr().align_offset(alignment);
    let mut attempt = |offset: usize, size: usize| {
        let memory = pdmp_memory { data: bytes[aligned + offset..].as_mut_ptr().cast(), size };
        start(&model, &pdmp_settings { memory, ..SETTINGS }, None)
    };
    for (offset, size) in [(0, size - 1), (0, 0), (1, size)] {
        let (status, controller, text) = attempt(offset, size);
        assert_eq!((status, controller), (PDMP_MEMORY, ptr::null_mut()));
        assert!(text.starts_with(&format!("memory has {size} bytes at 0x")), "{text}");
    }
    let null = pdmp_memory { data: ptr::null_mut(), size };
    assert_eq!(start(&model, &pdmp_settings { memory: null, ..SETTINGS }, None).0, PDMP_NULL);

    let (status, controller, _) = attempt(0, size);
    assert_eq!(status, PDMP_OK);
    let (mut in_place, mut allocated) = (Running(controller), Running::new(&model));
    for _ in 0..100 {
        assert_eq!(pdmp_controller_step(in_place.handle()), PDMP_WORKING);
        pdmp_controller_step(allocated.handle());
    }
    assert_eq!(in_place.state(2), allocated.state(2));
}

#[test]
fn damaged_files_and_invalid_settings_leave_null_and_a_message() {
    let bytes = learn(&reaches(), &options(Kind::Discrete)).to_bytes().unwrap();
    let mut flipped = bytes.clone();
    *flipped.last_mut().unwrap() ^= 1;
    for damaged in [&bytes[..bytes.len() / 2], b"not a model", &[], &flipped] {
        let (status, model, text) = load(damaged);
        assert_eq!((status, model), (PDMP_FILE, ptr::null_mut()));
        assert!(text.starts_with("not a usable file: "), "{text}");
    }
    let mut made = MaybeUninit::uninit();
    // SAFETY: the path ends in a zero byte.
    assert_eq!(unsafe { pdmp_model_load(c"absent/\xff".as_ptr(), Some(&mut made), NO_TEXT) }, PDMP_IO);

    let model = loaded(Kind::Discrete);
    for settings in [
        pdmp_settings { dt: 0.0, ..SETTINGS },
        pdmp_settings { dt: f64::NAN, ..SETTINGS },
        pdmp_settings { transition: &-1.0, ..SETTINGS },
    ] {
        let (status, controller, text) = start(&model, &settings, None);
        assert_eq!((status, controller), (PDMP_RANGE, ptr::null_mut()));
        assert!(text.contains(" = "), "{text}");
    }
    let amplitude = pdmp_conditions { amplitude: &2.0, ..NO_CONDITIONS };
    assert_eq!(start(&model, &SETTINGS, Some(&amplitude)).0, PDMP_ABSENT);
}

#[test]
fn a_message_is_truncated_to_fit_and_its_full_length_returned() {
    let model = loaded(Kind::Discrete);
    let mut running = Running::new(&model);
    assert_eq!(pdmp_controller_set_tau(running.handle(), -1.0), PDMP_RANGE);
    let whole = "tau = -1: must be positive and finite";
    for size in 0..2 * whole.len() {
        // SAFETY: the text has `size` bytes.
        let (length, text) =
            with_text(size, |text| unsafe { pdmp_controller_error(running.handle().as_deref(), text) });
        assert_eq!((length, text.as_str()), (whole.len(), &whole[..size.saturating_sub(1).min(whole.len())]));
    }
    // Truncation does not split a character.
    let mut made = MaybeUninit::uninit();
    // SAFETY: the path ends in a zero byte.
    let texts =
        (1..6).map(|size| with_text(size, |text| unsafe { pdmp_model_load(c"aßb".as_ptr(), Some(&mut made), text) }).1);
    assert_eq!(texts.collect::<Vec<_>>(), ["", "a", "a", "aß", "aßb"]);
}

#[test]
fn conditions_of_demonstrations_and_contexts_are_those_of_rust() {
    for (kind, demos) in [(Kind::Discrete, reaches()), (Kind::Rhythmic, cycles())] {
        let (rust, model) = (learn(&demos, &options(kind)), loaded(kind));
        let mut numbers = vec![f64::NAN; info(&model).n_conditions];
        let storage = buffer(&mut numbers);
        let read = |vector: pdmp_vector| {
            // SAFETY: a vector that is not NULL lies in `numbers`.
            (!vector.data.is_null()).then(|| unsafe { std::slice::from_raw_parts(vector.data, vector.length) }.to_vec())
        };
        let conditions_in = |c: pdmp_conditions| pdmp_core::Conditions {
            style: read(c.style),
            goal: read(c.goal),
            anchor: read(c.anchor),
            start: read(c.start),
            velocity: read(c.velocity),
            goal_velocity: read(c.goal_velocity),
            // SAFETY: NULL or in `numbers`.
            amplitude: unsafe { c.amplitude.as_ref() }.copied(),
            // SAFETY: as above.
            tau: unsafe { c.tau.as_ref() }.copied(),
            segment_durations: None,
            // SAFETY: as above.
            phase: unsafe { c.phase.as_ref() }.copied(),
            forcing: None,
        };
        // Conditions in C have a time constant in place of durations of segments.
        let by_tau = |conditions: pdmp_core::Conditions| {
            let tau = Some(conditions.time_constant(&rust).unwrap());
            pdmp_core::Conditions { tau, segment_durations: None, ..conditions }
        };
        for m in 0..demos.len() {
            let mut written = MaybeUninit::uninit();
            // SAFETY: every pointer is valid over its length, and the conditions are written on success.
            let written = unsafe {
                assert_eq!(pdmp_model_demonstration(Some(&model), m, Some(&mut written), storage, NO_TEXT), PDMP_OK);
                written.assume_init()
            };
            assert_eq!(conditions_in(written), by_tau(conditions_of(&rust, m)));
        }
        let mut written = MaybeUninit::uninit();
        // SAFETY: as above.
        unsafe {
            let output = Some(&mut written);
            assert_eq!(pdmp_model_demonstration(Some(&model), demos.len(), output, storage, NO_TEXT), PDMP_RANGE);
            let mut more = vec![f64::NAN; storage.length + 3];
            assert_eq!(
                pdmp_model_demonstration(Some(&model), 0, Some(&mut written), buffer(&mut more), NO_TEXT),
                PDMP_OK
            );
            assert!(more[storage.length..].iter().all(|number| number.is_nan()));
            let short = pdmp_buffer { length: storage.length - 1, ..storage };
            assert_eq!(pdmp_model_demonstration(Some(&model), 0, Some(&mut written), short, NO_TEXT), PDMP_LENGTH);
            let predicted = pdmp_model_predict(Some(&model), vector(&[0.2]), Some(&mut written), storage, NO_TEXT);
            match rust.predict(&[0.2]) {
                Ok(prediction) => {
                    assert_eq!(predicted, PDMP_OK);
                    assert_eq!(conditions_in(written.assume_init()), by_tau(prediction.conditions));
                    let two = vector(&[0.2, 0.2]);
                    assert_eq!(
                        pdmp_model_predict(Some(&model), two, Some(&mut written), storage, NO_TEXT),
                        PDMP_LENGTH
                    );
                }
                Err(_) => assert_eq!(predicted, PDMP_ABSENT),
            }
        }
    }
}

/// Labels are listed in order, and a context refers to them by index.
#[test]
fn labels_of_contexts_are_listed_and_accepted_by_index() {
    let manners = ["shy", "proud", "shy", "tired", "proud"];
    let contexts = manners.iter().zip([0.0, 0.1, 0.2, 0.3, 0.4]).map(|(&m, h)| vec![m.into(), h.into()]).collect();
    let rust = learn(&reaches(), &options(Kind::Discrete).contexts(contexts));
    let (status, model, _) = load(&rust.to_bytes().unwrap());
    assert_eq!(status, PDMP_OK);
    // SAFETY: the model is new, and the library allocates it as a `Box`.
    let model = unsafe { Box::from_raw(model) };
    let label = |value, label| {
        let text = pdmp_model_label(Some(&model), value, label);
        // SAFETY: NULL, or a string that lives as long as the model.
        (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_str().unwrap())
    };
    assert_eq!([0, 1, 2, 3].map(|k| label(0, k)), [Some("proud"), Some("shy"), Some("tired"), None]);
    assert_eq!([label(1, 0), label(2, 0)], [None; 2]);
    assert!(pdmp_model_label(None, 0, 0).is_null());

    let mut numbers = vec![f64::NAN; info(&model).n_conditions];
    let (storage, mut written) = (buffer(&mut numbers), MaybeUninit::uninit());
    let context = vector(&[2.0, 0.25]);
    // SAFETY: every pointer is valid over its length.
    let mut predict =
        |context| unsafe { pdmp_model_predict(Some(&model), context, Some(&mut written), storage, NO_TEXT) };
    assert_eq!(predict(vector(&[3.0, 0.25])), PDMP_RANGE);
    assert_eq!(predict(context), PDMP_OK);
    let expected = rust.predict(&["tired".into(), pdmp_core::demonstration::ContextValue::from(0.25)]).unwrap();
    assert_eq!(numbers[..rust.n_styles()], expected.conditions.style.unwrap()[..]);
}

#[test]
fn a_model_is_described_and_its_controllers_outlive_it() {
    let rust = learn(&reaches(), &options(Kind::Discrete));
    let model = loaded(Kind::Discrete);
    let expected = pdmp_info {
        kind: pdmp_kind::PDMP_DISCRETE,
        n_dofs: 3,
        n_coordinates: 3,
        n_styles: rust.n_styles(),
        n_demos: 5,
        n_contexts: 1,
        n_conditions: rust.n_styles() + 7,
        tau: rust.tau(),
        duration: rust.duration(),
    };
    assert_eq!(info(&model), expected);
    // SAFETY: names live as long as the model.
    let names: Vec<_> = (0..3).map(|d| unsafe { CStr::from_ptr(pdmp_model_name(Some(&model), d)) }).collect();
    assert!(names.iter().zip(rust.names()).all(|(c, rust)| c.to_str() == Ok(rust)));
    assert!(pdmp_model_name(Some(&model), 3).is_null());
    // SAFETY: a static string that ends in a zero byte.
    assert_eq!(unsafe { CStr::from_ptr(pdmp_version()) }.to_str(), Ok(env!("CARGO_PKG_VERSION")));

    let mut running = Running::new(&model);
    pdmp_model_free(Some(model));
    while pdmp_controller_step(running.handle()) == PDMP_WORKING {}
    assert_eq!(pdmp_controller_progress(running.handle().as_deref(), None, None), PDMP_FINISHED);
}

/// The shares of the segments in the duration are normalised exponentials, which underflow far from the demonstrations.
#[test]
fn a_prediction_that_overflows_is_out_of_range() {
    let warped = options(Kind::Discrete)
        .map(MapSelection::Given(ContextMapKind::Linear))
        .time_scaling(TimeScaling::Warp(TimeWarp { n_segments: 4, max_slope: 1.5 }));
    let (status, model, _) = load(&learn(&reaches(), &warped).to_bytes().unwrap());
    assert_eq!(status, PDMP_OK);
    // SAFETY: the model is new, and the library allocates it as a `Box`.
    let model = unsafe { Box::from_raw(model) };
    let mut numbers = vec![0.0; info(&model).n_conditions];
    let storage = buffer(&mut numbers);
    for context in [1e149, 1e6, 1e3] {
        let (status, text) = with_text(256, |error| {
            // SAFETY: every pointer is valid over its length.
            unsafe {
                let mut written = MaybeUninit::uninit();
                pdmp_model_predict(Some(&model), vector(&[context]), Some(&mut written), storage, error)
            }
        });
        assert_eq!(status, PDMP_RANGE, "{text}");
        assert!(text.contains("the prediction overflows"), "{text}");
    }
}

#[test]
fn every_kind_of_core_error_has_its_status() {
    let io = || std::io::ErrorKind::NotFound.into();
    for (error, status) in [
        (Error::Length { name: "goal", expected: 3, found: 2, per: "DoF" }, PDMP_LENGTH),
        (Error::Range { name: "tau", value: -1.0, allowed: "must be positive" }, PDMP_RANGE),
        (Error::NotFinite { name: "goal", index: 0, value: f64::NAN }, PDMP_RANGE),
        (Error::Argument { name: "dt", problem: "is missing" }, PDMP_RANGE),
        (Error::Conflict { names: ["tau", "segment_durations"], reason: "they exclude each other" }, PDMP_RANGE),
        (Error::Still { consequence: "it has no cycles" }, PDMP_RANGE),
        (Error::Kind { name: "anchor", kind: Kind::Discrete, instead: "" }, PDMP_ABSENT),
        (Error::Memory { name: "outputs", numbers: 1e18 }, PDMP_MEMORY),
        (Error::Io { path: "absent".into(), source: io() }, PDMP_IO),
        (Error::File("damaged".into()), PDMP_FILE),
        (Error::Fit("did not converge".into()), PDMP_NUMERICAL),
        (Error::Interrupted, PDMP_INTERNAL),
    ] {
        assert_eq!(pdmp_status::from(&error), status, "{error}");
        assert_eq!(pdmp_status::from(&error.in_demo(1)), status);
    }
}

/// Poses move in coordinates as in Rust; vectors of another length and quaternions that are none are refused.
#[test]
fn poses_are_moved_in_coordinates() {
    let demos: Vec<_> = poses::screws(4, 2.0, 0.4, 101, 1).into_iter().map(poses::pose).collect();
    let rust = learn(&demos, &options(Kind::Discrete));
    let (status, model, _) = load(&rust.to_bytes().unwrap());
    assert_eq!(status, PDMP_OK);
    // SAFETY: the model is new, and the library allocates it as a `Box`.
    let model = unsafe { Box::from_raw(model) };
    assert_eq!((info(&model).n_coordinates, info(&model).n_dofs), (7, 6));
    let mut order = MaybeUninit::new(7);
    assert_eq!(pdmp_model_rotation(Some(&model), 0, Some(&mut order)), 3);
    // SAFETY: the number is written.
    assert_eq!(unsafe { order.assume_init() }, 0);
    assert_eq!(pdmp_model_rotation(Some(&model), 1, None), 7);
    assert_eq!(pdmp_model_rotation(None, 0, None), 0);

    let mut running = Running::new(&model);
    let mut own = pdmp_core::Controller::new(rust.primitive(), 1e-3, &pdmp_core::Conditions::default(), None).unwrap();
    let goal: Vec<f64> = [0.3, 0.2, 0.1].into_iter().chain(poses::turn([1.0, 0.5, 0.0], 2.0)).collect();
    let (mut position, mut velocity) = ([0.0; 7], [0.0; 6]);
    let outputs =
        pdmp_motion { position: buffer(&mut position), velocity: buffer(&mut velocity), acceleration: NO_BUFFER };
    for k in 0..300 {
        if k == 100 {
            own.set_goal(&goal).unwrap();
            // SAFETY: the vector is valid over its length.
            assert_eq!(unsafe { pdmp_controller_set_goal(running.handle(), vector(&goal)) }, PDMP_OK);
        }
        own.step().unwrap();
        // SAFETY: the buffers are valid over their lengths.
        assert!(unsafe { pdmp_controller_update(running.handle(), None, Some(&outputs)) } as i32 > 0);
    }
    assert_eq!((own.position(), own.velocity()), (&position[..], &velocity[..]));

    // SAFETY: the vectors are valid over their lengths.
    let refused =
        [&goal[..6], &[0.0; 7]].map(|goal| unsafe { pdmp_controller_set_goal(running.handle(), vector(goal)) });
    assert_eq!(refused, [PDMP_LENGTH, PDMP_RANGE]);
    assert!(running.error().contains("goal[3:7] has norm 0"), "{}", running.error());
    let small = pdmp_motion { position: buffer(&mut velocity), ..outputs };
    // SAFETY: the buffers are valid over their lengths.
    assert_eq!(unsafe { pdmp_controller_read(running.handle(), Some(&small)) }, PDMP_LENGTH);
}

/// Samples fill rows of the caller's memory, and no call writes past it, or more samples than a rollout may have.
#[test]
fn trajectories_fill_rows_of_the_right_number() {
    let demos: Vec<_> = poses::screws(4, 2.0, 0.4, 101, 1).into_iter().map(poses::pose).collect();
    let rust = learn(&demos, &options(Kind::Discrete));
    let (_, model, _) = load(&rust.to_bytes().unwrap());
    // SAFETY: the model is new, and the library allocates it as a `Box`.
    let model = unsafe { Box::from_raw(model) };
    let mut running = Running::new(&model);
    let (mut position, mut velocity) = (vec![0.0; 50 * 7], vec![0.0; 50 * 6]);
    let outputs =
        pdmp_motion { position: buffer(&mut position), velocity: buffer(&mut velocity), acceleration: NO_BUFFER };
    // SAFETY: every pointer is valid over its length, or NULL.
    let rolled = |n, outputs: &pdmp_motion| unsafe {
        with_text(200, |error| pdmp_model_rollout(Some(&model), None, 0.02, n, Some(outputs), error))
    };
    let refusals = [(0, PDMP_RANGE, "n_samples = 0"), (51, PDMP_LENGTH, "350"), (usize::MAX, PDMP_LENGTH, "350")];
    for (n, status, text) in refusals {
        let (found, said) = rolled(n, &outputs);
        assert_eq!(found, status);
        assert!(said.contains(text), "{said}");
        // SAFETY: as above.
        assert_eq!(unsafe { pdmp_controller_forecast(running.handle(), 0.02, n, Some(&outputs)) }, status);
    }
    let none = pdmp_motion { position: NO_BUFFER, velocity: NO_BUFFER, acceleration: NO_BUFFER };
    assert_eq!(rolled(usize::MAX, &none).0, PDMP_RANGE);
    assert_eq!(rolled(10, &none).0, PDMP_OK);

    assert_eq!(rolled(50, &outputs).0, PDMP_OK);
    let grid = TimeGrid { dt: 0.02, duration: Some(0.98) };
    let expected = rollout(rust.primitive(), &pdmp_core::Conditions::default(), grid).unwrap();
    assert_eq!(expected.position.as_slice().unwrap(), position);
    assert_eq!(expected.velocity.as_slice().unwrap(), velocity);

    // SAFETY: as above.
    assert_eq!(unsafe { pdmp_controller_forecast(running.handle(), 0.02, 50, Some(&outputs)) }, PDMP_OK);
    let own = pdmp_core::Controller::new(rust.primitive(), 1e-3, &pdmp_core::Conditions::default(), None).unwrap();
    assert_eq!(own.forecast(0.98, Some(0.02)).unwrap().position.as_slice().unwrap(), position);
}

/// Poses of two arms are those of Rust, and what the core refuses has a status and a message.
#[test]
fn poses_of_two_arms_are_those_of_rust() {
    let (left, right) = ([0.5, 0.2, 0.3, 0.8, 0.6, 0.0, 0.0], [0.5, -0.2, 0.3, 0.0, 0.0, 0.6, 0.8]);
    let reference = [0.0, 0.0, 0.0, 1.0];
    let arms = TwoArms::about(reference).unwrap();
    let expected = arms.absolute_relative(&left, &right).unwrap();
    let [mut absolute, mut relative, mut again, mut other] = [[0.0; 7]; 4];
    // SAFETY: every pointer is valid over its length.
    unsafe {
        let outputs = [buffer(&mut absolute), buffer(&mut relative)];
        let inputs = [vector(&left), vector(&right), vector(&reference)];
        let [l, r, about] = inputs;
        assert_eq!(pdmp_absolute_relative(l, r, about, outputs[0], outputs[1], NO_TEXT), PDMP_OK);
        assert_eq!([absolute, relative], expected);
        let halves = [buffer(&mut again), buffer(&mut other)];
        let status = pdmp_left_right(vector(&absolute), vector(&relative), about, halves[0], halves[1], NO_TEXT);
        assert_eq!(status, PDMP_OK);
        assert_eq!([again, other], arms.left_right(&absolute, &relative).unwrap());
        assert_eq!(pdmp_absolute_relative(l, r, about, outputs[0], NO_BUFFER, NO_TEXT), PDMP_OK);

        let refused = |left, right, about, output, expected, part: &str| {
            let call = |text| pdmp_absolute_relative(left, right, about, output, NO_BUFFER, text);
            let (status, text) = with_text(200, call);
            assert!(status == expected && text.contains(part), "{status:?} {text}");
        };
        refused(NO_VECTOR, r, about, NO_BUFFER, PDMP_NULL, "left");
        refused(l, vector(&right[..6]), about, NO_BUFFER, PDMP_LENGTH, "right");
        refused(l, r, vector(&right), NO_BUFFER, PDMP_LENGTH, "reference");
        refused(l, r, about, buffer(&mut absolute[..6]), PDMP_LENGTH, "absolute");
        refused(l, vector(&[0.0; 7]), about, NO_BUFFER, PDMP_RANGE, "right");
        refused(l, vector(&[-0.5, 0.0, 0.0, 0.0, 0.0, -0.6, 0.8]), vector(&left[3..]), NO_BUFFER, PDMP_RANGE, "right");
    }
}

fn passage(
    model: &pdmp_model,
    points: &[pdmp_point],
    conditions: Option<&pdmp_conditions>,
    options: Option<&pdmp_passage_options>,
) -> Result<Box<pdmp_passage>, (pdmp_status, String)> {
    let mut made = MaybeUninit::uninit();
    let (status, text) = with_text(256, |error| {
        // SAFETY: every pointer is NULL or valid.
        unsafe {
            pdmp_model_through(Some(model), points.as_ptr(), points.len(), conditions, options, Some(&mut made), error)
        }
    });
    // SAFETY: the passage is written on success and on error, and the library allocates it as a `Box`.
    let made = unsafe { made.assume_init() };
    assert_eq!(made.is_null(), status != PDMP_OK);
    // SAFETY: as above.
    if made.is_null() { Err((status, text)) } else { Ok(unsafe { Box::from_raw(made) }) }
}

fn describe(passage: &pdmp_passage) -> pdmp_passage_info {
    let mut info = MaybeUninit::uninit();
    assert_eq!(pdmp_passage_describe(Some(passage), Some(&mut info)), PDMP_OK);
    // SAFETY: the call has succeeded, so it is written.
    unsafe { info.assume_init() }
}

#[test]
fn movements_pass_points_from_the_start_and_under_way() {
    let model = loaded(Kind::Discrete);
    let (time, dof, height) = (0.4, 1, [0.31]);
    let point = pdmp_point { position: vector(&height), dofs: &dof, n_dofs: 1, ..point_at(&time) };
    let passed = passage(&model, &[point], None, None).unwrap();
    let info = describe(&passed);
    assert!(info.distance >= 0.0 && info.n_constraints == 1 && info.displacement.length == 3 && info.far <= 1);
    let (status, controller, text) = start(&model, &SETTINGS, Some(&info.conditions));
    assert_eq!((status, text.as_str()), (PDMP_OK, ""));
    let mut running = Running(controller);
    (0..400).for_each(|_| assert_eq!(pdmp_controller_step(running.handle()), PDMP_WORKING));
    assert!((running.state(3)[1] - height[0]).abs() < 1e-9, "{:?}", running.state(3));

    // Under way, the conditions remain.
    let mut numbers = vec![0.0; self::info(&model).n_conditions];
    let mut conditions = MaybeUninit::uninit();
    // SAFETY: every pointer is valid.
    let conditions = unsafe {
        assert_eq!(
            pdmp_model_demonstration(Some(&model), 2, Some(&mut conditions), buffer(&mut numbers), NO_TEXT),
            PDMP_OK
        );
        conditions.assume_init()
    };
    let (status, controller, _) = start(&model, &SETTINGS, Some(&conditions));
    assert_eq!(status, PDMP_OK);
    let mut running = Running(controller);
    (0..200).for_each(|_| assert_eq!(pdmp_controller_step(running.handle()), PDMP_WORKING));
    let before = running.state(3);
    let options =
        pdmp_passage_options { context: NO_VECTOR, from_phase: &before[before.len() - 1], deviation: ptr::null() };
    let higher = [0.5];
    let point = pdmp_point { position: vector(&higher), ..point };
    let change = passage(&model, &[point], Some(&conditions), Some(&options)).unwrap();
    assert_eq!(pdmp_controller_add_forcing(running.handle(), Some(&change)), PDMP_OK);
    let after = running.state(3);
    assert!(before.iter().zip(&after).all(|(a, b)| (a - b).abs() < 1e-9 * a.abs().max(1.0)), "{before:?} {after:?}");
    drop(change);
    (0..200).for_each(|_| assert_eq!(pdmp_controller_step(running.handle()), PDMP_WORKING));
    assert!((running.state(3)[1] - higher[0]).abs() < 1e-6, "{:?}", running.state(3));

    let other = loaded(Kind::Rhythmic);
    let forcing =
        passage(&other, &[pdmp_point { position: vector(&[1.0, -2.0]), ..point_at(&time) }], None, None).unwrap();
    assert_eq!(pdmp_controller_add_forcing(running.handle(), Some(&forcing)), PDMP_RANGE);
    assert!(running.error().contains("forcing"), "{}", running.error());
}

#[test]
fn points_that_no_movement_passes_are_refused() {
    let model = loaded(Kind::Discrete);
    let (time, late, position) = (0.4, 9.0, [0.5, 0.3, 0.0]);
    let valid = pdmp_point { position: vector(&position), ..point_at(&time) };
    let bad = [f64::NAN, 0.0, 0.0];
    let (outside, three) = ([7usize], [0usize, 1, 2]);
    for (point, status, part) in [
        (point_at(&time), PDMP_RANGE, "points constrain nothing"),
        (pdmp_point { time: ptr::null(), ..valid }, PDMP_RANGE, "a time or a phase"),
        (pdmp_point { phase: &time, ..valid }, PDMP_RANGE, "a time or a phase"),
        (pdmp_point { time: &late, ..valid }, PDMP_RANGE, "time"),
        (pdmp_point { position: vector(&position[..2]), ..valid }, PDMP_LENGTH, "position"),
        (pdmp_point { velocity: vector(&position[..1]), ..valid }, PDMP_LENGTH, "velocity"),
        (pdmp_point { position: vector(&bad), ..valid }, PDMP_RANGE, "position"),
        (pdmp_point { tolerance: -1.0, ..valid }, PDMP_RANGE, "tolerance"),
        (pdmp_point { dofs: ptr::null(), n_dofs: 1, ..valid }, PDMP_NULL, "dofs"),
        (pdmp_point { dofs: three.as_ptr(), n_dofs: 2, ..valid }, PDMP_LENGTH, "position"),
        (
            pdmp_point { position: vector(&position[..1]), dofs: outside.as_ptr(), n_dofs: 1, ..valid },
            PDMP_RANGE,
            "dofs",
        ),
    ] {
        let (found, text) = passage(&model, &[point], None, None).err().unwrap();
        assert!(found == status && text.contains(part), "{found:?} {text}: expected {status:?} {part}");
    }
    let twice = pdmp_point { position: vector(&[0.5, 0.4, 0.0]), ..valid };
    assert!(passage(&model, &[valid, twice], None, None).is_err(), "contradictory points");
    let deviation = -1.0;
    let options = pdmp_passage_options { context: NO_VECTOR, from_phase: ptr::null(), deviation: &deviation };
    assert!(passage(&model, &[valid], None, Some(&options)).is_err());
    let context = [0.2];
    let options = pdmp_passage_options { context: vector(&context), from_phase: ptr::null(), deviation: ptr::null() };
    assert!(passage(&model, &[valid], None, Some(&options)).is_ok());
    let short = pdmp_passage_options { context: vector(&[]), ..options };
    assert!(passage(&model, &[valid], None, Some(&short)).is_err());
    let anchored = pdmp_conditions { anchor: vector(&position), ..NO_CONDITIONS };
    assert_eq!(passage(&model, &[valid], Some(&anchored), None).err().unwrap().0, PDMP_ABSENT);
}

/// An angular velocity is passed as in Rust, with three numbers in place of the four of its orientation.
#[test]
fn poses_pass_angular_velocities() {
    let demos: Vec<_> = poses::screws(4, 2.0, 0.4, 101, 1).into_iter().map(poses::pose).collect();
    let rust = learn(&demos, &options(Kind::Discrete));
    let (_, model, _) = load(&rust.to_bytes().unwrap());
    // SAFETY: the model is new, and the library allocates it as a `Box`.
    let model = unsafe { Box::from_raw(model) };
    let (time, columns) = (0.4, [3usize, 4, 5, 6]);
    let (orientation, omega) = (poses::turn([0.6, 0.0, 0.8], 0.8), [0.5, -0.2, 1.5]);
    let point = pdmp_point {
        position: vector(&orientation),
        velocity: vector(&omega),
        dofs: columns.as_ptr(),
        n_dofs: 4,
        ..point_at(&time)
    };
    let passed = passage(&model, &[point], None, None).unwrap();
    let info = describe(&passed);
    let (status, controller, _) = start(&model, &SETTINGS, Some(&info.conditions));
    assert_eq!((status, info.n_constraints), (PDMP_OK, 6));
    let mut running = Running(controller);
    (0..400).for_each(|_| assert_eq!(pdmp_controller_step(running.handle()), PDMP_WORKING));
    let (mut position, mut velocity) = ([0.0; 7], [0.0; 6]);
    let outputs =
        pdmp_motion { position: buffer(&mut position), velocity: buffer(&mut velocity), acceleration: NO_BUFFER };
    // SAFETY: the buffers are valid over their lengths.
    assert_eq!(unsafe { pdmp_controller_read(running.handle(), Some(&outputs)) }, PDMP_WORKING);
    let found = std::array::from_fn(|i| position[3 + i]);
    assert!(poses::angle(found, orientation) < 1e-8, "{position:?}");
    assert!(velocity[3..].iter().zip(omega).all(|(a, b)| (a - b).abs() < 1e-6), "{velocity:?}");

    let long = pdmp_point { velocity: vector(&orientation), ..point };
    let (status, text) = passage(&model, &[long], None, None).err().unwrap();
    assert!(status == PDMP_LENGTH && text.contains("expected 3"), "{text}");
    let alone = pdmp_point { position: NO_VECTOR, ..point };
    let (status, text) = passage(&model, &[alone], None, None).err().unwrap();
    assert!(status == PDMP_RANGE && text.contains("give the point a position, too"), "{text}");
}

/// Points of extreme numbers are refused with a message, or their movement has finite numbers.
#[test]
fn random_points_are_refused_or_passed_in_finite_numbers() {
    const NUMBERS: [f64; 16] = [
        0.0,
        -0.5,
        0.3,
        0.5,
        0.8,
        1.0,
        1e-300,
        1e-9,
        1e-3,
        30.0,
        1e9,
        -1e100,
        1e150,
        f64::MAX,
        f64::INFINITY,
        f64::NAN,
    ];
    let mut random = random::Random(6);
    let mut below = |n: usize| (random.next() * n as f64) as usize;
    let mut accepted = 0;
    for kind in [Kind::Discrete, Kind::Rhythmic] {
        let model = loaded(kind);
        let n = info(&model).n_dofs;
        for _ in 0..1500 {
            let mut number = |rarely: usize| {
                let n_choices = if below(rarely) == 0 { NUMBERS.len() } else { 6 };
                NUMBERS[below(n_choices)]
            };
            let numbers: Vec<f64> = (0..4 * n + 4).map(|k| number(if k < 4 { 4 } else { 20 })).collect();
            let [time, phase, deviation, tolerance] = [0, 1, 2, 3].map(|k| &numbers[k]);
            let dofs: Vec<usize> = (0..below(n + 1)).map(|_| below(n + 1)).collect();
            let count = if dofs.is_empty() { n } else { dofs.len() };
            let either = |given: bool, number| if given { number } else { ptr::null() };
            let points: Vec<pdmp_point> = (0..=below(2))
                .map(|k| pdmp_point {
                    time: either(below(3) > 0, time),
                    phase: either(below(3) == 0, phase),
                    position: if below(5) > 0 { vector(&numbers[4 + k * n..][..count]) } else { NO_VECTOR },
                    velocity: if below(3) == 0 { vector(&numbers[4 + 2 * n..][..count]) } else { NO_VECTOR },
                    dofs: if dofs.is_empty() { ptr::null() } else { dofs.as_ptr() },
                    n_dofs: dofs.len(),
                    tolerance: if below(3) == 0 { *tolerance } else { 0.0 },
                })
                .collect();
            let conditions = pdmp_conditions {
                start: if below(4) == 0 { vector(&numbers[4 + 3 * n..]) } else { NO_VECTOR },
                tau: either(below(4) == 0, phase),
                ..NO_CONDITIONS
            };
            let options = pdmp_passage_options {
                context: NO_VECTOR,
                from_phase: either(below(4) == 0, time),
                deviation: either(below(4) == 0, deviation),
            };
            let passed = match passage(&model, &points, Some(&conditions), Some(&options)) {
                Ok(passed) => passed,
                Err((status, text)) => {
                    assert!(matches!(status, PDMP_RANGE | PDMP_ABSENT) && !text.is_empty(), "{status:?} {text}");
                    continue;
                }
            };
            let found = describe(&passed);
            // SAFETY: the vector points into the passage.
            let displacement =
                unsafe { std::slice::from_raw_parts(found.displacement.data, found.displacement.length) };
            assert!(found.distance.is_finite() && displacement.iter().all(|x| x.is_finite()), "{found:?} {points:?}");
            let (status, controller, text) = start(&model, &SETTINGS, Some(&found.conditions));
            if status != PDMP_OK {
                assert!(controller.is_null() && !text.is_empty(), "{status:?} {text}");
                continue;
            }
            let mut running = Running(controller);
            for _ in 0..20 {
                if (pdmp_controller_step(running.handle()) as i32) < 0 {
                    break;
                }
            }
            assert!(running.state(n).iter().all(|x| x.is_finite()), "{found:?} {points:?}");
            accepted += 1;
        }
    }
    assert!(accepted > 200, "{accepted}");
}

#[test]
fn bad_observations_are_refused_with_a_message() {
    let demos = reaches();
    let model = learn(&demos, &options(Kind::Discrete));
    let prior = learn_prior(&model, &demos, None, Threads::ONE).unwrap();
    let create = |bytes: &[u8], context: pdmp_vector, timing: Option<&pdmp_timing>| {
        let mut made = MaybeUninit::uninit();
        let (status, text) = with_text(256, |error| {
            // SAFETY: every pointer is valid.
            unsafe {
                let (data, made) = (bytes.as_ptr().cast(), Some(&mut made));
                pdmp_recogniser_from_bytes(data, bytes.len(), context, timing, made, error)
            }
        });
        // SAFETY: the recogniser is written on success and on error, and the library allocates it as a `Box`.
        let made = unsafe { made.assume_init() };
        assert_eq!(made.is_null(), status != PDMP_OK);
        // SAFETY: as above.
        (status, text, (!made.is_null()).then(|| unsafe { Box::from_raw(made) }))
    };
    let new = |bytes: &[u8], timing: Option<&pdmp_timing>| create(bytes, NO_VECTOR, timing);
    let (status, text, _) = new(&model.to_bytes().unwrap(), None);
    assert!(status == PDMP_FILE && text.contains("no prior"), "{status:?} {text}");
    let bytes = prior.to_bytes(&model).unwrap();
    assert_eq!(new(&bytes[..bytes.len() / 2], None).0, PDMP_FILE);
    let timing = pdmp_timing { earliest: 1.0, latest: 0.0, duration: ptr::null() };
    let (status, text, _) = new(&bytes, Some(&timing));
    assert!(status == PDMP_RANGE && text.contains("starts"), "{status:?} {text}");
    let context =
        |numbers: &[f64]| create(&bytes, pdmp_vector { data: numbers.as_ptr(), length: numbers.len() }, None).0;
    assert_eq!([context(&[0.2, 0.3]), context(&[f64::NAN])], [PDMP_LENGTH, PDMP_RANGE]);

    let mut recogniser = new(&bytes, None).2.unwrap();
    let mut estimate = MaybeUninit::uninit();
    let mut numbers = [7.0; 6];
    let outputs = numbers.each_mut().map(|x| pdmp_buffer { data: x, length: 3 });
    // SAFETY: every pointer is valid.
    unsafe {
        assert_eq!(pdmp_recogniser_estimate(Some(&mut recogniser), Some(&mut estimate)), PDMP_RANGE);
        let message =
            |recogniser: &pdmp_recogniser| with_text(200, |text| pdmp_recogniser_error(Some(recogniser), text)).1;
        assert!(message(&recogniser).contains("observations"), "{}", message(&recogniser));
        let place = [0.2, 0.0, 0.0];
        assert_eq!(pdmp_recogniser_update(Some(&mut recogniser), 0.5, vector(&place)), PDMP_OK);
        assert_eq!(pdmp_recogniser_update(Some(&mut recogniser), 0.5, vector(&place)), PDMP_RANGE);
        assert!(message(&recogniser).contains("time"), "{}", message(&recogniser));
        assert_eq!(pdmp_recogniser_update(Some(&mut recogniser), 0.6, vector(&place[..2])), PDMP_LENGTH);
        assert_eq!(pdmp_recogniser_update(Some(&mut recogniser), 0.6, NO_VECTOR), PDMP_NULL);
        assert_eq!(pdmp_recogniser_estimate(Some(&mut recogniser), None), PDMP_NULL);
        let mut ahead = |time: f64, position, deviation| {
            pdmp_recogniser_continuation(Some(&mut recogniser), vector(&[time]), position, deviation)
        };
        assert_eq!(ahead(0.4, outputs[0], outputs[3]), PDMP_RANGE);
        assert_eq!(ahead(0.6, pdmp_buffer { length: 2, ..outputs[0] }, outputs[3]), PDMP_LENGTH);
        assert_eq!(ahead(0.6, outputs[0], NO_BUFFER), PDMP_NULL);
        assert_eq!(ahead(0.6, outputs[0], outputs[3]), PDMP_OK);
    }
    assert!(numbers[..3].iter().all(|x| x.abs() < 2.0) && numbers[3..].iter().all(|sd| *sd > 0.0), "{numbers:?}");
}
