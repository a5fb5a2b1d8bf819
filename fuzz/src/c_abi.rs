//! Sequences of calls of the C ABI with edge-case numbers, lengths, pointers and memory.
//!
//! Every vector and buffer is a separate allocation of exactly its stated length, so that AddressSanitizer detects each
//! access past the end.

use std::ffi::{CStr, c_char, c_void};
use std::mem::MaybeUninit;
use std::ptr;
use std::sync::LazyLock;

use pdmp::pdmp_status::*;
use pdmp::*;

use crate::input::{Input, MODELS};

/// Maximum number of calls of one input.
const MAX_CALLS: usize = 64;
/// Number of controllers that exist at the same time.
const N_SLOTS: usize = 3;
/// Size of the memory for a controller, in bytes: at least twice that of a controller plus its alignment.
const MEMORY_SIZE: usize = 1 << 15;

const NO_VECTOR: pdmp_vector = pdmp_vector { data: ptr::null(), length: 0 };

/// Executes the calls of an input, and checks that none returns PDMP_INTERNAL and that every motion is finite.
///
/// # Panics
/// Panics if the check fails.
pub fn check(data: &[u8]) {
    let mut input = Input::new(data);
    let model = &C_MODELS[input.below(C_MODELS.len())];
    let mut caller = Caller { model, info: info(model), slots: Default::default() };
    for _ in 0..MAX_CALLS {
        let Some(call) = input.next() else { break };
        caller.call(call, &mut input);
    }
}

static C_MODELS: LazyLock<Vec<pdmp_model>> =
    LazyLock::new(|| MODELS.iter().map(|bytes| *load(bytes, 0).expect("a saved model cannot be loaded")).collect());

/// Loads a model, with an error text of `text_size` bytes.
fn load(bytes: &[u8], text_size: usize) -> Option<Box<pdmp_model>> {
    let mut model = MaybeUninit::uninit();
    let status = with_text(text_size, |error| {
        // SAFETY: every pointer is valid.
        unsafe { pdmp_model_from_bytes(bytes.as_ptr().cast(), bytes.len(), Some(&mut model), error) }
    });
    assert_no_panic(status);
    // SAFETY: the model is written on success and on error.
    let model = unsafe { model.assume_init() };
    assert_eq!(model.is_null(), status != PDMP_OK);
    // SAFETY: the library allocates a model as a `Box`.
    (!model.is_null()).then(|| unsafe { Box::from_raw(model) })
}

fn info(model: &pdmp_model) -> pdmp_info {
    let mut info = MaybeUninit::uninit();
    assert_eq!(pdmp_model_describe(Some(model), Some(&mut info)), PDMP_OK);
    // SAFETY: the call has succeeded, so it is written.
    unsafe { info.assume_init() }
}

/// Checks that a status is not PDMP_INTERNAL.
///
/// # Panics
/// Panics if it is.
fn assert_no_panic(status: pdmp_status) {
    assert_ne!(status, PDMP_INTERNAL, "a call panicked");
}

/// Executes a call with a text of `size` bytes, and checks that the text is terminated and valid UTF-8.
fn with_text<T>(size: usize, call: impl FnOnce(pdmp_text) -> T) -> T {
    let mut text = vec![0 as c_char; size];
    let data = if size == 0 { ptr::null_mut() } else { text.as_mut_ptr() };
    let result = call(pdmp_text { data, size });
    if size > 0 {
        // SAFETY: the last byte is zero.
        assert_eq!(text[size - 1], 0, "a text is not terminated");
        assert!(unsafe { CStr::from_ptr(text.as_ptr()) }.to_str().is_ok(), "a text is not UTF-8");
    }
    result
}

/// Separate allocation of numbers, passed as a pair of pointer and length with edge cases that the ABI permits.
struct Numbers {
    data: Vec<f64>,
    variant: u8,
}

impl Numbers {
    /// Returns numbers, in most cases `expected` of them.
    fn new(expected: usize, input: &mut Input) -> Self {
        let variant = input.byte();
        let length = match variant {
            0..160 => expected,
            160..176 => 0,
            176..192 => expected + 1 + input.below(5),
            192..208 => expected.saturating_sub(1),
            _ => 0,
        };
        Self { data: (0..length).map(|_| input.number()).collect(), variant }
    }

    fn vector(&self) -> pdmp_vector {
        match self.variant {
            208..248 => NO_VECTOR,
            // NULL with a length is an error.
            248.. => pdmp_vector { data: ptr::null(), length: usize::from(self.variant) },
            _ => pdmp_vector { data: self.data.as_ptr(), length: self.data.len() },
        }
    }

    fn buffer(&mut self) -> pdmp_buffer {
        let pdmp_vector { data, length } = self.vector();
        match data.is_null() {
            true => pdmp_buffer { data: ptr::null_mut(), length },
            false => pdmp_buffer { data: self.data.as_mut_ptr(), length },
        }
    }
}

/// Returns a number or `None`.
fn scalar(input: &mut Input) -> Option<Box<f64>> {
    let given = input.byte().is_multiple_of(2);
    given.then(|| Box::new(input.number()))
}

fn pointer(number: &Option<Box<f64>>) -> *const f64 {
    number.as_deref().map_or(ptr::null(), ptr::from_ref)
}

/// Controller, with the memory that it occupies if the caller provided it.
struct Running {
    controller: *mut pdmp_controller,
    _memory: Option<Vec<u64>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        // SAFETY: the controller is alive, its memory is dropped after it, and it is not used again.
        unsafe { pdmp_controller_free(self.controller) };
    }
}

/// State of a sequence of calls.
struct Caller<'a> {
    model: &'a pdmp_model,
    info: pdmp_info,
    slots: [Option<Running>; N_SLOTS],
}

impl Caller<'_> {
    /// Executes one call.
    fn call(&mut self, call: u8, input: &mut Input) {
        let slot = usize::from(call >> 6) % N_SLOTS;
        let (n_dofs, n_styles) = (self.info.n_dofs, self.info.n_styles);
        let n_coordinates = self.info.n_coordinates;
        // SAFETY: the slot's controller is alive, or NULL.
        let controller = unsafe { self.slots[slot].as_ref().map_or(ptr::null_mut(), |x| x.controller).as_mut() };
        // SAFETY: every pointer is valid over its stated length, or NULL.
        let status = unsafe {
            match call & 15 {
                0 | 1 => return self.start(slot, input),
                2 => pdmp_controller_set_style(controller, Numbers::new(n_styles, input).vector()),
                3 => pdmp_controller_set_goal(controller, Numbers::new(n_coordinates, input).vector()),
                4 => pdmp_controller_set_anchor(controller, Numbers::new(n_coordinates, input).vector()),
                5 => pdmp_controller_set_tau(controller, input.number()),
                6 => pdmp_controller_set_amplitude(controller, input.number()),
                7 => pdmp_controller_set_compliance(controller, input.number(), input.number()),
                8 => return self.reset(slot, input),
                9 => return self.update(slot, input),
                10 => return self.call_model(input),
                11 => match input.byte() % 4 {
                    0 => {
                        let source = usize::from(input.byte()) % N_SLOTS;
                        let source = self.slots[source].as_ref().map_or(ptr::null_mut(), |x| x.controller);
                        pdmp_controller_copy(source, controller.map_or(ptr::null_mut(), ptr::from_mut))
                    }
                    1 => pdmp_controller_set_phase(controller, input.number()),
                    3 => pdmp_controller_set_phase_gain(controller, input.number()),
                    _ => {
                        self.slots[slot] = None;
                        return;
                    }
                },
                13 => return self.set_limits(slot, input),
                14 => return self.sample(slot, input),
                12 => pdmp_controller_set_goal_velocity(controller, Numbers::new(n_dofs, input).vector()),
                _ => {
                    let mut status = PDMP_OK;
                    let mut controller = controller;
                    for _ in 0..=input.byte() % 32 {
                        status = pdmp_controller_step(controller.as_deref_mut());
                    }
                    status
                }
            }
        };
        self.check(slot, status, input);
    }

    fn start(&mut self, slot: usize, input: &mut Input) {
        let (dt, transition) = (input.number(), scalar(input));
        let variant = input.byte();
        let (needed, alignment) = (pdmp_controller_size(), pdmp_controller_alignment());
        let mut memory = vec![0u64; if variant < 128 { 0 } else { MEMORY_SIZE / 8 }];
        assert!(2 * needed + alignment <= MEMORY_SIZE, "MEMORY_SIZE is too small");
        let start = memory.as_mut_ptr().cast::<u8>();
        let memory_argument = match variant {
            0..128 => pdmp_memory { data: ptr::null_mut(), size: 0 },
            128..192 => {
                let data = start.wrapping_add(start.align_offset(alignment));
                pdmp_memory { data: data.cast::<c_void>(), size: needed }
            }
            192..224 => pdmp_memory { data: start.cast(), size: needed - 1 - usize::from(variant % 32) },
            _ => pdmp_memory { data: start.wrapping_add(1 + usize::from(variant % 32)).cast(), size: needed },
        };
        let settings = pdmp_settings { dt, transition: pointer(&transition), memory: memory_argument };
        let mut made = MaybeUninit::uninit();
        let conditions = Conditions::of(&self.info, input);
        let conditions = conditions.as_ref().map(Conditions::get);
        let text_size = usize::from(input.byte());
        let status = with_text(text_size, |error| {
            // SAFETY: every pointer is valid over its stated length, or NULL.
            unsafe {
                pdmp_controller_new(Some(self.model), Some(&settings), conditions.as_ref(), Some(&mut made), error)
            }
        });
        assert_no_panic(status);
        // SAFETY: the controller is written on success and on error.
        let controller = unsafe { made.assume_init() };
        assert_eq!(controller.is_null(), status != PDMP_OK);
        if !controller.is_null() {
            self.slots[slot] = Some(Running { controller, _memory: Some(memory) });
            self.check(slot, status, input);
        }
    }

    fn reset(&mut self, slot: usize, input: &mut Input) {
        let conditions = Conditions::of(&self.info, input);
        let conditions = conditions.as_ref().map(Conditions::get);
        // SAFETY: every pointer is valid over its stated length, or NULL.
        let status = unsafe { pdmp_controller_reset(self.handle(slot), conditions.as_ref()) };
        self.check(slot, status, input);
    }

    fn set_limits(&mut self, slot: usize, input: &mut Input) {
        let vectors: [Numbers; 5] = std::array::from_fn(|_| {
            let n = if input.byte() < 64 { 1 } else { self.info.n_dofs };
            Numbers::new(n, input)
        });
        let [lower, upper, velocity, acceleration, jerk] = vectors.each_ref().map(Numbers::vector);
        let independent = i32::from(input.byte() % 2);
        let limits = pdmp_limits { lower, upper, velocity, acceleration, jerk, independent };
        let given = !input.byte().is_multiple_of(8);
        // SAFETY: every pointer is valid over its stated length, or NULL.
        let status = unsafe { pdmp_controller_set_limits(self.handle(slot), given.then_some(&limits)) };
        self.check(slot, status, input);
    }

    fn update(&mut self, slot: usize, input: &mut Input) {
        let (n_dofs, n_styles) = (self.info.n_dofs, self.info.n_styles);
        let n_coordinates = self.info.n_coordinates;
        let style = Numbers::new(n_styles, input);
        let [goal, anchor, measured] = std::array::from_fn(|_| Numbers::new(n_coordinates, input));
        let [velocity, acceleration, goal_velocity] = std::array::from_fn(|_| Numbers::new(n_dofs, input));
        let [tau, amplitude, dt] = std::array::from_fn(|_| scalar(input));
        let command = pdmp_command {
            style: style.vector(),
            goal: goal.vector(),
            goal_velocity: goal_velocity.vector(),
            anchor: anchor.vector(),
            tau: pointer(&tau),
            amplitude: pointer(&amplitude),
            dt: pointer(&dt),
            measured: measured.vector(),
            coupling: pdmp_coupling { velocity: velocity.vector(), acceleration: acceleration.vector() },
            phase: pointer(&amplitude),
        };
        let mut outputs = [n_coordinates, n_dofs, n_dofs].map(|length| Numbers::new(length, input));
        let [position, velocity, acceleration] = outputs.each_mut().map(Numbers::buffer);
        let motion = pdmp_motion { position, velocity, acceleration };
        let commanded = !input.byte().is_multiple_of(4);
        // SAFETY: every pointer is valid over its stated length, or NULL.
        let status = unsafe { pdmp_controller_update(self.handle(slot), commanded.then_some(&command), Some(&motion)) };
        if status as i32 > 0 {
            for output in outputs.iter().filter(|output| output.variant < 160) {
                assert!(output.data.iter().all(|x| x.is_finite()), "a motion is not finite");
            }
        }
        self.check(slot, status, input);
    }

    /// Computes a rollout, or a forecast of a controller, into buffers with one row per sample.
    fn sample(&mut self, slot: usize, input: &mut Input) {
        let (n_samples, dt) = (input.below(40), input.number());
        let widths = [self.info.n_coordinates, self.info.n_dofs, self.info.n_dofs];
        let mut outputs = widths.map(|width| Numbers::new(n_samples * width, input));
        let [position, velocity, acceleration] = outputs.each_mut().map(Numbers::buffer);
        let motion = pdmp_motion { position, velocity, acceleration };
        // SAFETY: every pointer is valid over its stated length, or NULL.
        let status = unsafe {
            if input.byte().is_multiple_of(2) {
                pdmp_controller_forecast(self.handle(slot), dt, n_samples, Some(&motion))
            } else {
                let conditions = Conditions::of(&self.info, input);
                let conditions = conditions.as_ref().map(Conditions::get);
                with_text(usize::from(input.byte()), |error| {
                    pdmp_model_rollout(Some(self.model), conditions.as_ref(), dt, n_samples, Some(&motion), error)
                })
            }
        };
        assert_no_panic(status);
        if status == PDMP_OK {
            for output in outputs.iter().filter(|output| output.variant < 160) {
                assert!(output.data.iter().all(|x| x.is_finite()), "a sample is not finite");
            }
        }
    }

    /// Executes a call on the model (names, labels, demonstrations, predictions), or loads a model file with one byte
    /// changed.
    fn call_model(&mut self, input: &mut Input) {
        let call = input.byte();
        let index = input.below(16);
        let mut conditions = MaybeUninit::uninit();
        let mut numbers = Numbers::new(self.info.n_conditions, input);
        // Elements that are not written keep this value, which is finite.
        numbers.data.fill(0.0);
        let status = match call % 5 {
            0 => {
                pdmp_model_name(Some(self.model), index);
                pdmp_model_unit(Some(self.model), index);
                pdmp_model_label(Some(self.model), input.below(4), index);
                return;
            }
            1 => with_text(usize::from(input.byte()), |error| {
                // SAFETY: every pointer is valid over its stated length, or NULL.
                unsafe {
                    let (model, storage) = (Some(self.model), numbers.buffer());
                    pdmp_model_demonstration(model, index, Some(&mut conditions), storage, error)
                }
            }),
            2 | 3 => {
                let context = Numbers::new(self.info.n_contexts, input);
                with_text(usize::from(input.byte()), |error| {
                    // SAFETY: every pointer is valid over its stated length, or NULL.
                    unsafe {
                        let (model, storage) = (Some(self.model), numbers.buffer());
                        pdmp_model_predict(model, context.vector(), Some(&mut conditions), storage, error)
                    }
                })
            }
            _ => {
                let mut bytes = MODELS[input.below(MODELS.len())].clone();
                let index = input.index(bytes.len());
                bytes[index] = input.byte();
                let end = if input.byte() < 128 { bytes.len() } else { input.index(bytes.len()) };
                load(&bytes[..end], usize::from(input.byte()));
                return;
            }
        };
        assert_no_panic(status);
        if status == PDMP_OK {
            assert!(numbers.data.iter().all(|x| x.is_finite()), "conditions are not finite");
        }
    }

    /// Returns the controller of a slot.
    fn handle(&mut self, slot: usize) -> Option<&mut pdmp_controller> {
        // SAFETY: the slot's controller is alive, or NULL.
        unsafe { self.slots[slot].as_ref().map_or(ptr::null_mut(), |x| x.controller).as_mut() }
    }

    /// Checks that a call did not panic, that the error text is valid, and that the state of the controller is finite.
    fn check(&mut self, slot: usize, status: pdmp_status, input: &mut Input) {
        assert_no_panic(status);
        let n_dofs = self.info.n_dofs;
        let text_size = usize::from(input.byte());
        // SAFETY: the text is valid over its size.
        with_text(text_size, |text| unsafe { pdmp_controller_error(self.handle(slot).as_deref(), text) });
        let mut motion = vec![0.0; 3 * self.info.n_coordinates];
        let mut parts = motion
            .chunks_exact_mut(self.info.n_coordinates)
            .map(|part| pdmp_buffer { data: part.as_mut_ptr(), length: part.len() });
        let mut part = || parts.next().unwrap_or(pdmp_buffer { data: ptr::null_mut(), length: 0 });
        let outputs = pdmp_motion { position: part(), velocity: part(), acceleration: part() };
        let mut limited = vec![pdmp_limit::PDMP_LIMIT_NONE; n_dofs];
        // SAFETY: the array has the stated length.
        assert_no_panic(unsafe { pdmp_controller_limited(self.handle(slot), limited.as_mut_ptr(), n_dofs) });
        let (mut time, mut phase) = (MaybeUninit::new(0.0), MaybeUninit::new(0.0));
        // SAFETY: every pointer is valid over its stated length.
        assert_no_panic(unsafe { pdmp_controller_read(self.handle(slot), Some(&outputs)) });
        assert_no_panic(pdmp_controller_progress(self.handle(slot).as_deref(), Some(&mut time), Some(&mut phase)));
        // SAFETY: both are initialised.
        let progress = unsafe { [time.assume_init(), phase.assume_init()] };
        for x in motion.iter().chain(&progress) {
            assert!(x.is_finite(), "after {status:?} the motion is {motion:?}, time and phase are {progress:?}");
        }
    }
}

/// Conditions of a movement with the memory of their vectors.
struct Conditions {
    vectors: [Numbers; 6],
    amplitude: Option<Box<f64>>,
    tau: Option<Box<f64>>,
    phase: Option<Box<f64>>,
}

impl Conditions {
    fn of(info: &pdmp_info, input: &mut Input) -> Option<Self> {
        if input.byte() < 64 {
            return None;
        }
        let n_dofs = info.n_dofs;
        let n_coordinates = info.n_coordinates;
        let lengths = [info.n_styles, n_coordinates, n_coordinates, n_coordinates, n_dofs, n_dofs];
        let vectors = lengths.map(|length| Numbers::new(length, input));
        Some(Self { vectors, amplitude: scalar(input), tau: scalar(input), phase: scalar(input) })
    }

    fn get(&self) -> pdmp_conditions {
        let [style, goal, anchor, start, velocity, goal_velocity] = self.vectors.each_ref().map(Numbers::vector);
        let [amplitude, tau, phase] = [&self.amplitude, &self.tau, &self.phase].map(pointer);
        let forcing = ptr::null();
        pdmp_conditions { style, goal, anchor, start, velocity, goal_velocity, amplitude, tau, phase, forcing }
    }
}
