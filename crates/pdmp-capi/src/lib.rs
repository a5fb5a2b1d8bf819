//! The C ABI of the run time: load a model, make a controller, command it, step it, read it.
//!
//! `include/pdmp.h` is made from these sources, and what C sees bears its C name here too. A reference in a signature is
//! a pointer that C may give as NULL wherever it is an `Option`, and that must be valid otherwise. Only where a function
//! follows a pointer inside a struct, or one to a text, is it `unsafe`.
//!
//! No panic crosses the border, and nothing that a loop calls allocates.

#![allow(unsafe_code, reason = "C hands over pointers and lengths apart")]
#![allow(non_camel_case_types, reason = "types and constants have their C names")]

mod buffers;
mod command;
mod controller;
mod model;
mod status;

pub use buffers::*;
pub use command::*;
pub use controller::*;
pub use model::*;
pub use status::{pdmp_status, pdmp_version};
