//! C ABI of the runtime: loads models, predicts, samples and recognises movements, leads them through points, and creates,
//! commands, steps and reads controllers.
//!
//! `include/pdmp.h` is generated from these sources, and every item that C sees has its C name here too. A reference in
//! a signature is a pointer in C: NULL is accepted wherever the reference is wrapped in an `Option`.
//!
//! # Safety
//! The contract of every function, also stated in the header, is that
//! - each pointer, also inside a struct, is NULL or valid: a string up to its terminating zero, an array, buffer, text
//!   or memory over the length that accompanies it, a handle until it is freed;
//! - buffers overlap with no other argument, except those of a `pdmp_motion` with the arrays of a `pdmp_command`;
//! - nothing else uses the memory of a controller until the controller is freed;
//! - no two threads use the same controller or recogniser at the same time.
//!
//! A function is `unsafe` only if it follows a pointer inside a struct, or a pointer to a string or bytes. No panic
//! unwinds into C. The functions of the control loop do not allocate.

#![allow(unsafe_code, reason = "C passes raw pointers and separate lengths")]
#![allow(clippy::missing_safety_doc, reason = "all functions share the contract above")]
#![allow(non_camel_case_types, reason = "types and constants have their C names")]

mod buffers;
mod command;
mod controller;
mod controller_copies;
mod fault;
mod guard;
mod limits;
mod model;
mod passage;
mod recogniser;
mod status;
mod trajectory;
mod two_arms;

pub use buffers::*;
pub use command::*;
pub use controller::*;
pub use controller_copies::*;
pub use limits::*;
pub use model::*;
pub use passage::*;
pub use recogniser::*;
pub use status::{pdmp_status, pdmp_version};
pub use trajectory::*;
pub use two_arms::*;
