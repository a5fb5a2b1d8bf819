//! What C can get wrong is answered with a status and a text, and changes nothing.
#![allow(missing_docs, unsafe_code)]

#[path = "../../pdmp-core/tests/common/mod.rs"]
mod common;

use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::ptr;

use common::*;
use pdmp::pdmp_status::*;
use pdmp::*;
use pdmp_core::Kind;

const NOTHING: pdmp_vector = pdmp_vector { data: ptr::null(), length: 0 };
const UNWANTED: pdmp_text = pdmp_text { data: ptr::null_mut(), size: 0 };
const NO_ROOM: pdmp_buffer = pdmp_buffer { data: ptr::null_mut(), length: 0 };
const NO_COMMAND: pdmp_command = pdmp_command {
    style: NOTHING,
    goal: NOTHING,
    anchor: NOTHING,
    tau: ptr::null(),
    amplitude: ptr::null(),
    dt: ptr::null(),
    measured: NOTHING,
    coupling: pdmp_coupling { velocity: NOTHING, acceleration: NOTHING },
};
const NO_CONDITIONS: pdmp_conditions = pdmp_conditions {
    style: NOTHING,
    goal: NOTHING,
    anchor: NOTHING,
    start: NOTHING,
    velocity: NOTHING,
    amplitude: ptr::null(),
    tau: ptr::null(),
    phase: std::ptr::null(),
};
const SETTINGS: pdmp_settings =
    pdmp_settings { dt: 1e-3, transition: ptr::null(), memory: pdmp_memory { data: ptr::null_mut(), size: 0 } };

fn vector(numbers: &[f64]) -> pdmp_vector {
    pdmp_vector { data: numbers.as_ptr(), length: numbers.len() }
}

fn buffer(numbers: &mut [f64]) -> pdmp_buffer {
    pdmp_buffer { data: numbers.as_mut_ptr(), length: numbers.len() }
}

/// What a call writes into a text of `size` bytes, and what it answers.
fn told<T>(size: usize, call: impl FnOnce(pdmp_text) -> T) -> (T, String) {
    // Bytes that a text must not leave standing.
    let mut text = vec![b'?' as c_char; size];
    let answer = call(pdmp_text { data: text.as_mut_ptr(), size });
    // SAFETY: a text ends in a zero byte, or is not written at all; the check below sees to that.
    let text = match text.contains(&0) {
        true => unsafe { CStr::from_ptr(text.as_ptr()) }.to_str().unwrap().to_string(),
        false => String::new(),
    };
    (answer, text)
}

fn load(bytes: &[u8]) -> (pdmp_status, *mut pdmp_model, String) {
    let mut model = MaybeUninit::uninit();
    let (status, text) = told(256, |error| {
        // SAFETY: every pointer is valid.
        unsafe { pdmp_model_from_bytes(bytes.as_ptr().cast(), bytes.len(), Some(&mut model), error) }
    });
    // SAFETY: the model is written whatever the answer.
    (status, unsafe { model.assume_init() }, text)
}

fn loaded(kind: Kind) -> Box<pdmp_model> {
    let demos = if kind == Kind::Discrete { reaches() } else { cycles() };
    let (status, model, _) = load(&learn(&demos, &options(kind)).to_bytes().unwrap());
    assert_eq!(status, PDMP_OK);
    // SAFETY: it was just made, and `Box` is what `pdmp_model_free` takes.
    unsafe { Box::from_raw(model) }
}

fn info(model: &pdmp_model) -> pdmp_info {
    let mut info = MaybeUninit::uninit();
    assert_eq!(pdmp_model_describe(Some(model), Some(&mut info)), PDMP_OK);
    // SAFETY: it is written where the answer is good.
    unsafe { info.assume_init() }
}

fn start(
    model: &pdmp_model,
    settings: &pdmp_settings,
    conditions: Option<&pdmp_conditions>,
) -> (pdmp_status, *mut pdmp_controller, String) {
    let mut controller = MaybeUninit::uninit();
    let (status, text) = told(256, |error| {
        // SAFETY: every pointer is NULL or valid.
        unsafe { pdmp_controller_new(Some(model), Some(settings), conditions, Some(&mut controller), error) }
    });
    // SAFETY: the controller is written whatever the answer.
    (status, unsafe { controller.assume_init() }, text)
}

/// A controller that ends with the test.
struct Running(*mut pdmp_controller);

impl Running {
    fn new(model: &pdmp_model) -> Self {
        let (status, controller, _) = start(model, &SETTINGS, None);
        assert_eq!(status, PDMP_OK);
        Self(controller)
    }

    fn handle(&mut self) -> Option<&mut pdmp_controller> {
        // SAFETY: it is alive until it is dropped.
        unsafe { self.0.as_mut() }
    }

    fn update(&mut self, command: &pdmp_command) -> pdmp_status {
        // SAFETY: what the tests command is NULL or valid.
        unsafe { pdmp_controller_update(self.handle(), Some(command), None) }
    }

    fn error(&mut self) -> String {
        // SAFETY: the text is valid.
        told(256, |text| unsafe { pdmp_controller_error(self.handle().as_deref(), text) }).1
    }

    /// Time, phase and motion.
    fn state(&mut self, n_dofs: usize) -> Vec<f64> {
        let mut motion = vec![f64::NAN; 3 * n_dofs];
        let places: Vec<_> = motion.chunks_mut(n_dofs).map(buffer).collect();
        let places = pdmp_motion { position: places[0], velocity: places[1], acceleration: places[2] };
        let (mut time, mut phase) = (MaybeUninit::uninit(), MaybeUninit::uninit());
        pdmp_controller_progress(self.handle().as_deref(), Some(&mut time), Some(&mut phase));
        // SAFETY: the motion has room, and time and phase were just written.
        unsafe {
            assert!(pdmp_controller_read(self.handle(), Some(&places)) as i32 > 0);
            motion.extend([time.assume_init(), phase.assume_init()]);
        }
        motion
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // SAFETY: it is not used again.
        unsafe { pdmp_controller_free(self.0) };
    }
}

#[test]
fn null_is_a_status_everywhere() {
    let model = loaded(Kind::Discrete);
    let (mut made, mut out) = (MaybeUninit::uninit(), MaybeUninit::uninit());
    let mut conditions = MaybeUninit::uninit();
    let mut numbers = vec![0.0; info(&model).n_conditions];
    let room = buffer(&mut numbers);
    let mut running = Running::new(&model);
    // SAFETY: NULL is what is tried; all else is valid.
    unsafe {
        for status in [
            pdmp_model_load(ptr::null(), Some(&mut made), UNWANTED),
            pdmp_model_load(c"absent".as_ptr(), None, UNWANTED),
            pdmp_model_from_bytes(ptr::null(), 0, Some(&mut made), UNWANTED),
            pdmp_model_from_bytes(ptr::null(), 8, Some(&mut made), UNWANTED),
            pdmp_model_from_bytes([0u8; 8].as_ptr().cast(), 8, None, UNWANTED),
            pdmp_model_describe(None, None),
            pdmp_model_describe(Some(&model), None),
            pdmp_model_demonstration(None, 0, Some(&mut conditions), room, UNWANTED),
            pdmp_model_demonstration(Some(&model), 0, None, room, UNWANTED),
            pdmp_model_demonstration(Some(&model), 0, Some(&mut conditions), NO_ROOM, UNWANTED),
            pdmp_model_predict(None, NOTHING, Some(&mut conditions), room, UNWANTED),
            pdmp_model_predict(Some(&model), NOTHING, Some(&mut conditions), room, UNWANTED),
            pdmp_model_predict(Some(&model), vector(&[0.2]), None, room, UNWANTED),
            pdmp_model_predict(Some(&model), vector(&[0.2]), Some(&mut conditions), NO_ROOM, UNWANTED),
            pdmp_controller_new(None, Some(&SETTINGS), None, Some(&mut out), UNWANTED),
            pdmp_controller_new(Some(&model), None, None, Some(&mut out), UNWANTED),
            pdmp_controller_new(Some(&model), Some(&SETTINGS), None, None, UNWANTED),
            pdmp_controller_reset(None, None),
            pdmp_controller_set_style(None, NOTHING),
            pdmp_controller_set_goal(None, NOTHING),
            pdmp_controller_set_anchor(None, NOTHING),
            pdmp_controller_set_tau(None, 1.0),
            pdmp_controller_set_amplitude(None, 1.0),
            pdmp_controller_set_compliance(None, 1.0, 1.0),
            pdmp_controller_set_style(running.handle(), NOTHING),
            pdmp_controller_set_goal(running.handle(), NOTHING),
            pdmp_controller_set_goal(running.handle(), pdmp_vector { data: ptr::null(), length: 3 }),
            pdmp_controller_step(None),
            pdmp_controller_update(None, None, None),
            pdmp_controller_read(None, None),
            pdmp_controller_read(running.handle(), None),
            pdmp_controller_progress(None, None, None),
        ] {
            assert_eq!(status, PDMP_NULL);
        }
        assert_eq!(pdmp_controller_error(None, UNWANTED), 0);
        assert!(pdmp_model_name(None, 0).is_null());
        pdmp_controller_free(ptr::null_mut());
    }
    pdmp_model_free(None);
    assert_eq!(running.error(), "motion is NULL");
}

#[test]
fn null_is_nothing_told_where_nothing_must_be() {
    let model = loaded(Kind::Discrete);
    let (mut a, mut b) = (Running::new(&model), Running::new(&model));
    assert_eq!(pdmp_controller_step(a.handle()), PDMP_WORKING);
    // SAFETY: NULL is nothing told, and not wanted.
    assert_eq!(unsafe { pdmp_controller_update(b.handle(), None, None) }, PDMP_WORKING);
    assert_eq!(a.state(3), b.state(3));
    // SAFETY: as above.
    assert_eq!(unsafe { pdmp_controller_reset(a.handle(), None) }, PDMP_OK);
    assert_eq!(a.state(3), Running::new(&model).state(3));
    assert_eq!(a.error(), "");
}

#[test]
fn a_refused_command_changes_nothing_and_says_why() {
    let model = loaded(Kind::Discrete);
    let mut running = Running::new(&model);
    assert_eq!(pdmp_controller_step(running.handle()), PDMP_WORKING);
    let before = running.state(3);
    let (three, two, nan) = ([0.5; 3], [0.5; 2], [0.5, f64::NAN, 0.5]);
    let (huge, before_now) = (usize::MAX, -1e-3);
    let none = NO_COMMAND;
    let half = pdmp_coupling { velocity: vector(&three), acceleration: NOTHING };
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
        (pdmp_command { dt: &before_now, ..none }, PDMP_RANGE, "dt = -0.001: must be finite and not negative"),
        (
            pdmp_command { anchor: vector(&three), ..none },
            PDMP_ABSENT,
            "anchor does not apply to a discrete primitive: it moves to a goal; set goal",
        ),
        (pdmp_command { coupling: half, ..none }, PDMP_NULL, "coupling acceleration is NULL"),
        // What is right beside what is wrong takes no effect.
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
    let short = pdmp_motion { position: buffer(&mut two), velocity: NO_ROOM, acceleration: NO_ROOM };
    // SAFETY: the room is as long as it tells.
    unsafe {
        assert_eq!(pdmp_controller_update(running.handle(), None, Some(&short)), PDMP_LENGTH);
        assert_eq!(pdmp_controller_read(running.handle(), Some(&short)), PDMP_LENGTH);
        let conditions = pdmp_conditions { start: vector(&two), ..NO_CONDITIONS };
        assert_eq!(pdmp_controller_reset(running.handle(), Some(&conditions)), PDMP_LENGTH);
        assert_eq!(pdmp_controller_set_anchor(running.handle(), vector(&three)), PDMP_ABSENT);
    }
    assert_eq!(pdmp_controller_set_amplitude(running.handle(), 1.0), PDMP_ABSENT);
    assert_eq!(pdmp_controller_set_tau(running.handle(), -1.0), PDMP_RANGE);
    assert_eq!(pdmp_controller_set_compliance(running.handle(), -1.0, 0.0), PDMP_RANGE);
    assert_eq!(running.state(3), before);
}

#[test]
fn a_command_may_lie_where_the_motion_goes() {
    let model = loaded(Kind::Discrete);
    let (mut apart, mut same) = (Running::new(&model), Running::new(&model));
    let (mut from, mut to) = (vec![0.3; 3], vec![0.0; 3]);
    for _ in 0..100 {
        let motion = pdmp_motion { position: buffer(&mut to), velocity: NO_ROOM, acceleration: NO_ROOM };
        let command = pdmp_command { measured: vector(&from), ..NO_COMMAND };
        // SAFETY: both have three numbers.
        assert_eq!(unsafe { pdmp_controller_update(apart.handle(), Some(&command), Some(&motion)) }, PDMP_WORKING);
        let place = buffer(&mut from);
        let command = pdmp_command { measured: pdmp_vector { data: place.data, length: 3 }, ..NO_COMMAND };
        let motion = pdmp_motion { position: place, velocity: NO_ROOM, acceleration: NO_ROOM };
        // SAFETY: as above.
        assert_eq!(unsafe { pdmp_controller_update(same.handle(), Some(&command), Some(&motion)) }, PDMP_WORKING);
        assert_eq!(from, to);
    }
}

#[test]
fn memory_of_the_callers_serves_if_it_is_large_enough_and_aligned() {
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
    let nowhere = pdmp_memory { data: ptr::null_mut(), size };
    assert_eq!(start(&model, &pdmp_settings { memory: nowhere, ..SETTINGS }, None).0, PDMP_NULL);

    let (status, controller, _) = attempt(0, size);
    assert_eq!(status, PDMP_OK);
    let (mut given, mut own) = (Running(controller), Running::new(&model));
    for _ in 0..100 {
        assert_eq!(pdmp_controller_step(given.handle()), PDMP_WORKING);
        pdmp_controller_step(own.handle());
    }
    assert_eq!(given.state(2), own.state(2));
}

#[test]
fn damaged_bytes_and_wrong_settings_leave_null_and_a_text() {
    let bytes = learn(&reaches(), &options(Kind::Discrete)).to_bytes().unwrap();
    let mut flipped = bytes.clone();
    *flipped.last_mut().unwrap() ^= 1;
    for damaged in [&bytes[..bytes.len() / 2], b"not a model", &[], &flipped] {
        let (status, model, text) = load(damaged);
        assert_eq!((status, model), (PDMP_FILE, ptr::null_mut()));
        assert!(text.starts_with("not a usable model file: "), "{text}");
    }
    let mut made = MaybeUninit::uninit();
    // SAFETY: the path ends in a zero byte.
    assert_eq!(unsafe { pdmp_model_load(c"absent/\xff".as_ptr(), Some(&mut made), UNWANTED) }, PDMP_IO);

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
fn a_text_is_cut_to_fit_and_its_whole_length_told() {
    let model = loaded(Kind::Discrete);
    let mut running = Running::new(&model);
    assert_eq!(pdmp_controller_set_tau(running.handle(), -1.0), PDMP_RANGE);
    let whole = "tau = -1: must be positive and finite";
    for size in 0..2 * whole.len() {
        // SAFETY: the text has `size` bytes.
        let (length, text) = told(size, |text| unsafe { pdmp_controller_error(running.handle().as_deref(), text) });
        assert_eq!((length, text.as_str()), (whole.len(), &whole[..size.saturating_sub(1).min(whole.len())]));
    }
    // A character that does not fit is left out whole.
    let mut made = MaybeUninit::uninit();
    // SAFETY: the path ends in a zero byte.
    let texts =
        (1..6).map(|size| told(size, |text| unsafe { pdmp_model_load(c"aßb".as_ptr(), Some(&mut made), text) }).1);
    assert_eq!(texts.collect::<Vec<_>>(), ["", "a", "a", "aß", "aßb"]);
}

#[test]
fn conditions_of_demonstrations_and_contexts_are_those_of_rust() {
    for (kind, demos) in [(Kind::Discrete, reaches()), (Kind::Rhythmic, cycles())] {
        let (rust, model) = (learn(&demos, &options(kind)), loaded(kind));
        let mut numbers = vec![f64::NAN; info(&model).n_conditions];
        let room = buffer(&mut numbers);
        let read = |vector: pdmp_vector| {
            // SAFETY: vectors that are told lie in `numbers`.
            (!vector.data.is_null()).then(|| unsafe { std::slice::from_raw_parts(vector.data, vector.length) }.to_vec())
        };
        let read = |told: pdmp_conditions| pdmp_core::Conditions {
            style: read(told.style),
            goal: read(told.goal),
            anchor: read(told.anchor),
            start: read(told.start),
            velocity: read(told.velocity),
            // SAFETY: NULL or in `numbers`.
            amplitude: unsafe { told.amplitude.as_ref() }.copied(),
            // SAFETY: as above.
            tau: unsafe { told.tau.as_ref() }.copied(),
            segment_durations: None,
            // SAFETY: as above.
            phase: unsafe { told.phase.as_ref() }.copied(),
        };
        // In C a movement has one time constant.
        let by_tau = |conditions: pdmp_core::Conditions| {
            let tau = Some(conditions.time_constant(&rust).unwrap());
            pdmp_core::Conditions { tau, segment_durations: None, ..conditions }
        };
        for m in 0..demos.len() {
            let mut told = MaybeUninit::uninit();
            // SAFETY: the room is as long as it tells, and what is told is written where the answer is good.
            let told = unsafe {
                assert_eq!(pdmp_model_demonstration(Some(&model), m, Some(&mut told), room, UNWANTED), PDMP_OK);
                told.assume_init()
            };
            assert_eq!(read(told), by_tau(conditions_of(&rust, m)));
        }
        let mut told = MaybeUninit::uninit();
        // SAFETY: as above.
        unsafe {
            let place = Some(&mut told);
            assert_eq!(pdmp_model_demonstration(Some(&model), demos.len(), place, room, UNWANTED), PDMP_RANGE);
            let mut more = vec![f64::NAN; room.length + 3];
            assert_eq!(
                pdmp_model_demonstration(Some(&model), 0, Some(&mut told), buffer(&mut more), UNWANTED),
                PDMP_OK
            );
            assert!(more[room.length..].iter().all(|number| number.is_nan()));
            let short = pdmp_buffer { length: room.length - 1, ..room };
            assert_eq!(pdmp_model_demonstration(Some(&model), 0, Some(&mut told), short, UNWANTED), PDMP_LENGTH);
            let predicted = pdmp_model_predict(Some(&model), vector(&[0.2]), Some(&mut told), room, UNWANTED);
            match rust.predict(&[0.2]) {
                Ok(prediction) => {
                    assert_eq!(predicted, PDMP_OK);
                    assert_eq!(read(told.assume_init()), by_tau(prediction.conditions));
                    let two = vector(&[0.2, 0.2]);
                    assert_eq!(pdmp_model_predict(Some(&model), two, Some(&mut told), room, UNWANTED), PDMP_LENGTH);
                }
                Err(_) => assert_eq!(predicted, PDMP_ABSENT),
            }
        }
    }
}

/// Labels are told in order, and stand in a context by their index.
#[test]
fn labels_of_contexts_are_told_and_taken_by_index() {
    let manners = ["shy", "proud", "shy", "tired", "proud"];
    let contexts = manners.iter().zip([0.0, 0.1, 0.2, 0.3, 0.4]).map(|(&m, h)| vec![m.into(), h.into()]).collect();
    let rust = learn(&reaches(), &options(Kind::Discrete).contexts(contexts));
    let (status, model, _) = load(&rust.to_bytes().unwrap());
    assert_eq!(status, PDMP_OK);
    // SAFETY: it was just made, and `Box` is what `pdmp_model_free` takes.
    let model = unsafe { Box::from_raw(model) };
    let label = |value, label| {
        let text = pdmp_model_label(Some(&model), value, label);
        // SAFETY: NULL, or a text that lives as long as the model.
        (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_str().unwrap())
    };
    assert_eq!([0, 1, 2, 3].map(|k| label(0, k)), [Some("proud"), Some("shy"), Some("tired"), None]);
    assert_eq!([label(1, 0), label(2, 0)], [None; 2]);
    assert!(pdmp_model_label(None, 0, 0).is_null());

    let mut numbers = vec![f64::NAN; info(&model).n_conditions];
    let (room, mut told) = (buffer(&mut numbers), MaybeUninit::uninit());
    let context = vector(&[2.0, 0.25]);
    // SAFETY: the room is as long as it tells.
    let mut predict = |context| unsafe { pdmp_model_predict(Some(&model), context, Some(&mut told), room, UNWANTED) };
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
    // SAFETY: a constant that ends in a zero byte.
    assert_eq!(unsafe { CStr::from_ptr(pdmp_version()) }.to_str(), Ok(env!("CARGO_PKG_VERSION")));

    let mut running = Running::new(&model);
    pdmp_model_free(Some(model));
    while pdmp_controller_step(running.handle()) == PDMP_WORKING {}
    assert_eq!(pdmp_controller_progress(running.handle().as_deref(), None, None), PDMP_FINISHED);
}
