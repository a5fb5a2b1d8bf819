//! Sequences of calls of the C ABI with odd numbers, lengths, pointers and memory.
//!
//! Every vector and buffer is an allocation of its own of just the length that it announces, so that AddressSanitizer
//! sees each access past its end.

use std::ffi::{CStr, c_char, c_void};
use std::mem::MaybeUninit;
use std::ptr;
use std::sync::LazyLock;

use pdmp::pdmp_status::*;
use pdmp::*;

use crate::input::{Input, MODELS};

/// Most calls of one input.
const MAX_CALLS: usize = 64;
/// Controllers that live at the same time.
const SLOTS: usize = 3;
/// Bytes of the memory in which controllers are placed: twice what one takes and room to misalign it.
const ROOM: usize = 1 << 15;

const NO_NUMBERS: pdmp_vector = pdmp_vector { data: ptr::null(), length: 0 };

/// Calls in the order of the input; no answer is a defect, and every motion that is answered is finite.
///
/// # Panics
/// The claim does not hold.
pub fn check(data: &[u8]) {
    let mut input = Input::new(data);
    let model = &MODELS_IN_C[input.choice(MODELS_IN_C.len())];
    let mut caller = Caller { model, info: info(model), slots: Default::default() };
    for _ in 0..MAX_CALLS {
        let Some(call) = input.next() else { break };
        caller.call(call, &mut input);
    }
}

static MODELS_IN_C: LazyLock<Vec<pdmp_model>> = LazyLock::new(|| {
    MODELS.iter().map(|bytes| *load(bytes, 0).expect("a model of the library's own cannot be loaded")).collect()
});

fn load(bytes: &[u8], room: usize) -> Option<Box<pdmp_model>> {
    let mut model = MaybeUninit::uninit();
    let status = with_text(room, |error| {
        // SAFETY: every pointer is valid.
        unsafe { pdmp_model_from_bytes(bytes.as_ptr().cast(), bytes.len(), Some(&mut model), error) }
    });
    sound(status);
    // SAFETY: it is written whatever the answer.
    let model = unsafe { model.assume_init() };
    assert_eq!(model.is_null(), status != PDMP_OK);
    // SAFETY: it is a `Box` of the library's.
    (!model.is_null()).then(|| unsafe { Box::from_raw(model) })
}

fn info(model: &pdmp_model) -> pdmp_info {
    let mut info = MaybeUninit::uninit();
    assert_eq!(pdmp_model_describe(Some(model), Some(&mut info)), PDMP_OK);
    // SAFETY: it is written where the answer is good.
    unsafe { info.assume_init() }
}

/// No answer may be that the library has a defect.
fn sound(status: pdmp_status) {
    assert_ne!(status, PDMP_INTERNAL, "a call panicked");
}

/// Makes a call with room for a text of `size` bytes, and checks what is written there.
fn with_text<T>(size: usize, call: impl FnOnce(pdmp_text) -> T) -> T {
    let mut text = vec![0 as c_char; size];
    let data = if size == 0 { ptr::null_mut() } else { text.as_mut_ptr() };
    let answer = call(pdmp_text { data, size });
    if size > 0 {
        // SAFETY: the text was zero before, and its last byte is checked first.
        assert_eq!(text[size - 1], 0, "a text is not closed");
        assert!(unsafe { CStr::from_ptr(text.as_ptr()) }.to_str().is_ok(), "a text is not UTF-8");
    }
    answer
}

/// Numbers, an allocation of their own, as a pair of pointer and length that may lie within what the ABI allows.
struct Numbers {
    data: Vec<f64>,
    form: u8,
}

impl Numbers {
    /// Of the length `expected`, mostly.
    fn of(expected: usize, input: &mut Input) -> Self {
        let form = input.byte();
        let length = match form {
            0..160 => expected,
            160..176 => 0,
            176..192 => expected + 1 + input.choice(5),
            192..208 => expected.saturating_sub(1),
            _ => 0,
        };
        Self { data: (0..length).map(|_| input.number()).collect(), form }
    }

    fn vector(&self) -> pdmp_vector {
        match self.form {
            208..248 => NO_NUMBERS,
            // NULL with a length is refused before it is read.
            248.. => pdmp_vector { data: ptr::null(), length: usize::from(self.form) },
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

/// A number that is told or not.
fn scalar(input: &mut Input) -> Option<Box<f64>> {
    let told = input.byte().is_multiple_of(2);
    told.then(|| Box::new(input.number()))
}

fn pointer(number: &Option<Box<f64>>) -> *const f64 {
    number.as_deref().map_or(ptr::null(), ptr::from_ref)
}

/// A controller, and the caller's memory if it is placed there.
struct Running {
    controller: *mut pdmp_controller,
    _memory: Option<Vec<u64>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        // SAFETY: it was made by the library, is not used again, and its memory outlives it.
        unsafe { pdmp_controller_free(self.controller) };
    }
}

struct Caller<'a> {
    model: &'a pdmp_model,
    info: pdmp_info,
    slots: [Option<Running>; SLOTS],
}

impl Caller<'_> {
    fn call(&mut self, call: u8, input: &mut Input) {
        let slot = usize::from(call >> 6) % SLOTS;
        let (n_dofs, n_styles) = (self.info.n_dofs, self.info.n_styles);
        // SAFETY: the slot's controller is alive, or NULL.
        let controller = unsafe { self.slots[slot].as_ref().map_or(ptr::null_mut(), |x| x.controller).as_mut() };
        // SAFETY: every pointer is valid over the length that it announces, or NULL.
        let status = unsafe {
            match call & 15 {
                0 | 1 => return self.start(slot, input),
                2 => pdmp_controller_set_style(controller, Numbers::of(n_styles, input).vector()),
                3 => pdmp_controller_set_goal(controller, Numbers::of(n_dofs, input).vector()),
                4 => pdmp_controller_set_anchor(controller, Numbers::of(n_dofs, input).vector()),
                5 => pdmp_controller_set_tau(controller, input.number()),
                6 => pdmp_controller_set_amplitude(controller, input.number()),
                7 => pdmp_controller_set_compliance(controller, input.number(), input.number()),
                8 => return self.reset(slot, input),
                9 => return self.update(slot, input),
                10 => return self.model(input),
                11 => {
                    if input.byte().is_multiple_of(2) {
                        self.slots[slot] = None;
                    }
                    return;
                }
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
        self.answered(slot, status, input);
    }

    fn start(&mut self, slot: usize, input: &mut Input) {
        let (dt, transition) = (input.number(), scalar(input));
        let form = input.byte();
        let (needed, alignment) = (pdmp_controller_size(), pdmp_controller_alignment());
        let mut memory = vec![0u64; if form < 128 { 0 } else { ROOM / 8 }];
        assert!(2 * needed + alignment <= ROOM, "ROOM is too small");
        let start = memory.as_mut_ptr().cast::<u8>();
        let place = match form {
            0..128 => pdmp_memory { data: ptr::null_mut(), size: 0 },
            128..192 => {
                let data = start.wrapping_add(start.align_offset(alignment));
                pdmp_memory { data: data.cast::<c_void>(), size: needed }
            }
            192..224 => pdmp_memory { data: start.cast(), size: needed - 1 - usize::from(form % 32) },
            _ => pdmp_memory { data: start.wrapping_add(1 + usize::from(form % 32)).cast(), size: needed },
        };
        let settings = pdmp_settings { dt, transition: pointer(&transition), memory: place };
        let mut made = MaybeUninit::uninit();
        let conditions = Conditions::of(&self.info, input);
        let conditions = conditions.as_ref().map(Conditions::get);
        let room = usize::from(input.byte());
        let status = with_text(room, |error| {
            // SAFETY: every pointer is valid over the length that it announces, or NULL.
            unsafe {
                pdmp_controller_new(Some(self.model), Some(&settings), conditions.as_ref(), Some(&mut made), error)
            }
        });
        sound(status);
        // SAFETY: it is written whatever the answer.
        let controller = unsafe { made.assume_init() };
        assert_eq!(controller.is_null(), status != PDMP_OK);
        if !controller.is_null() {
            self.slots[slot] = Some(Running { controller, _memory: Some(memory) });
            self.answered(slot, status, input);
        }
    }

    fn reset(&mut self, slot: usize, input: &mut Input) {
        let conditions = Conditions::of(&self.info, input);
        let conditions = conditions.as_ref().map(Conditions::get);
        // SAFETY: every pointer is valid over the length that it announces, or NULL.
        let status = unsafe { pdmp_controller_reset(self.handle(slot), conditions.as_ref()) };
        self.answered(slot, status, input);
    }

    fn update(&mut self, slot: usize, input: &mut Input) {
        let (n_dofs, n_styles) = (self.info.n_dofs, self.info.n_styles);
        let style = Numbers::of(n_styles, input);
        let [goal, anchor, measured, velocity, acceleration] = std::array::from_fn(|_| Numbers::of(n_dofs, input));
        let [tau, amplitude, dt] = std::array::from_fn(|_| scalar(input));
        let command = pdmp_command {
            style: style.vector(),
            goal: goal.vector(),
            anchor: anchor.vector(),
            tau: pointer(&tau),
            amplitude: pointer(&amplitude),
            dt: pointer(&dt),
            measured: measured.vector(),
            coupling: pdmp_coupling { velocity: velocity.vector(), acceleration: acceleration.vector() },
        };
        let mut places: [Numbers; 3] = std::array::from_fn(|_| Numbers::of(n_dofs, input));
        let [position, velocity, acceleration] = places.each_mut().map(Numbers::buffer);
        let motion = pdmp_motion { position, velocity, acceleration };
        let told = !input.byte().is_multiple_of(4);
        // SAFETY: every pointer is valid over the length that it announces, or NULL.
        let status = unsafe { pdmp_controller_update(self.handle(slot), told.then_some(&command), Some(&motion)) };
        if status as i32 > 0 {
            for place in places.iter().filter(|place| place.form < 160) {
                assert!(place.data.iter().all(|x| x.is_finite()), "a motion was written that is not finite");
            }
        }
        self.answered(slot, status, input);
    }

    /// Calls on the model: names, labels, demonstrations, predictions, and bytes that were changed.
    fn model(&mut self, input: &mut Input) {
        let which = input.byte();
        let index = input.choice(16);
        let mut conditions = MaybeUninit::uninit();
        let mut numbers = Numbers::of(self.info.n_conditions, input);
        // What is not written stays as it is.
        numbers.data.fill(0.0);
        let status = match which % 5 {
            0 => {
                pdmp_model_name(Some(self.model), index);
                pdmp_model_label(Some(self.model), input.choice(4), index);
                return;
            }
            1 => with_text(usize::from(input.byte()), |error| {
                // SAFETY: every pointer is valid over the length that it announces, or NULL.
                unsafe {
                    let (model, room) = (Some(self.model), numbers.buffer());
                    pdmp_model_demonstration(model, index, Some(&mut conditions), room, error)
                }
            }),
            2 | 3 => {
                let context = Numbers::of(self.info.n_contexts, input);
                with_text(usize::from(input.byte()), |error| {
                    // SAFETY: every pointer is valid over the length that it announces, or NULL.
                    unsafe {
                        let (model, room) = (Some(self.model), numbers.buffer());
                        pdmp_model_predict(model, context.vector(), Some(&mut conditions), room, error)
                    }
                })
            }
            _ => {
                let mut bytes = MODELS[input.choice(MODELS.len())].clone();
                let place = input.index(bytes.len());
                bytes[place] = input.byte();
                let end = if input.byte() < 128 { bytes.len() } else { input.index(bytes.len()) };
                load(&bytes[..end], usize::from(input.byte()));
                return;
            }
        };
        sound(status);
        if status == PDMP_OK {
            assert!(numbers.data.iter().all(|x| x.is_finite()), "conditions were written that are not finite");
        }
    }

    fn handle(&mut self, slot: usize) -> Option<&mut pdmp_controller> {
        // SAFETY: the slot's controller is alive, or NULL.
        unsafe { self.slots[slot].as_ref().map_or(ptr::null_mut(), |x| x.controller).as_mut() }
    }

    /// Checks an answer: it is no defect, its reason is a text, and the motion is finite.
    fn answered(&mut self, slot: usize, status: pdmp_status, input: &mut Input) {
        sound(status);
        let n_dofs = self.info.n_dofs;
        let room = usize::from(input.byte());
        // SAFETY: the text has the room that it tells.
        with_text(room, |text| unsafe { pdmp_controller_error(self.handle(slot).as_deref(), text) });
        let mut motion = vec![0.0; 3 * n_dofs];
        let mut parts =
            motion.chunks_exact_mut(n_dofs).map(|part| pdmp_buffer { data: part.as_mut_ptr(), length: part.len() });
        let mut part = || parts.next().unwrap_or(pdmp_buffer { data: ptr::null_mut(), length: 0 });
        let places = pdmp_motion { position: part(), velocity: part(), acceleration: part() };
        let (mut time, mut phase) = (MaybeUninit::new(0.0), MaybeUninit::new(0.0));
        // SAFETY: every pointer is valid over the length that it announces.
        sound(unsafe { pdmp_controller_read(self.handle(slot), Some(&places)) });
        sound(pdmp_controller_progress(self.handle(slot).as_deref(), Some(&mut time), Some(&mut phase)));
        // SAFETY: both were set before.
        let progress = unsafe { [time.assume_init(), phase.assume_init()] };
        for x in motion.iter().chain(&progress) {
            assert!(x.is_finite(), "after {status:?} a motion is {motion:?} at {progress:?}");
        }
    }
}

/// What a movement starts with, and the memory of its vectors.
struct Conditions {
    vectors: [Numbers; 5],
    amplitude: Option<Box<f64>>,
    tau: Option<Box<f64>>,
    phase: Option<Box<f64>>,
}

impl Conditions {
    fn of(info: &pdmp_info, input: &mut Input) -> Option<Self> {
        if input.byte() < 64 {
            return None;
        }
        let lengths = [info.n_styles, info.n_dofs, info.n_dofs, info.n_dofs, info.n_dofs];
        let vectors = lengths.map(|length| Numbers::of(length, input));
        Some(Self { vectors, amplitude: scalar(input), tau: scalar(input), phase: scalar(input) })
    }

    fn get(&self) -> pdmp_conditions {
        let [style, goal, anchor, start, velocity] = self.vectors.each_ref().map(Numbers::vector);
        let [amplitude, tau, phase] = [&self.amplitude, &self.tau, &self.phase].map(pointer);
        pdmp_conditions { style, goal, anchor, start, velocity, amplitude, tau, phase }
    }
}
