//! Pointers with the length they reach.

use std::ffi::{c_char, c_void};
use std::fmt::{self, Display, Write};
use std::ptr;

use pdmp_core::Error;

use crate::status::Fault;

/// Numbers to read; `{NULL, 0}` is nothing told.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_vector {
    /// The first number.
    pub data: *const f64,
    /// How many there are.
    pub length: usize,
}

/// Room for numbers; `{NULL, 0}` if they are not wanted. More room than needed is left as it is.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_buffer {
    /// Where the first number goes.
    pub data: *mut f64,
    /// How many there is room for, at least as many as are written.
    pub length: usize,
}

/// Room for a text in UTF-8 with its closing zero; `{NULL, 0}` if it is not wanted. A longer text is cut to fit.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_text {
    /// Where the first byte goes.
    pub data: *mut c_char,
    /// Bytes there is room for.
    pub size: usize,
}

/// Memory of the caller's; `{NULL, 0}` to have it allocated.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_memory {
    /// The first byte.
    pub data: *mut c_void,
    /// How many there are.
    pub size: usize,
}

/// Whether a pair is given: `Some` length, or none for `{NULL, 0}`.
fn given<T>(data: *const T, length: usize, name: &'static str) -> Result<Option<usize>, Fault> {
    match (data.is_null(), length) {
        (true, 0) => Ok(None),
        (true, _) => Err(Fault::Null(name)),
        (false, found) => Ok(Some(found)),
    }
}

impl pdmp_vector {
    pub(crate) const NONE: Self = Self { data: ptr::null(), length: 0 };

    /// The numbers, one per `per`, if they are told.
    ///
    /// # Safety
    /// `data` is NULL or points to `length` numbers, which outlive `'a`.
    pub(crate) unsafe fn get<'a>(
        self,
        name: &'static str,
        expected: usize,
        per: &'static str,
    ) -> Result<Option<&'a [f64]>, Fault> {
        // Checked before anything is read: a wrong length reaches memory that is not the caller's.
        match given(self.data, self.length, name)? {
            None => Ok(None),
            Some(found) if found != expected => Err(Error::Length { name, expected, found, per }.into()),
            // SAFETY: it is not NULL, and the caller promises the rest.
            Some(length) => Ok(Some(unsafe { std::slice::from_raw_parts(self.data, length) })),
        }
    }

    /// The numbers, which must be told.
    ///
    /// # Safety
    /// As for [`pdmp_vector::get`].
    pub(crate) unsafe fn need<'a>(
        self,
        name: &'static str,
        expected: usize,
        per: &'static str,
    ) -> Result<&'a [f64], Fault> {
        // SAFETY: the caller's promise is the same.
        unsafe { self.get(name, expected, per) }?.ok_or(Fault::Null(name))
    }
}

impl pdmp_buffer {
    /// Checks that there is room for one number per `per`, if they are wanted.
    pub(crate) fn check(self, name: &'static str, expected: usize, per: &'static str) -> Result<(), Fault> {
        match given(self.data, self.length, name)? {
            Some(found) if found < expected => Err(Error::Length { name, expected, found, per }.into()),
            _ => Ok(()),
        }
    }

    /// Writes the numbers, if they are wanted.
    ///
    /// # Safety
    /// `data` is NULL or has room for the numbers.
    pub(crate) unsafe fn put(self, numbers: &[f64]) {
        if !self.data.is_null() {
            // SAFETY: there is room, and the numbers are the library's own.
            unsafe { self.data.copy_from_nonoverlapping(numbers.as_ptr(), numbers.len()) };
        }
    }
}

impl pdmp_text {
    /// Writes a text, cut to fit, and returns the length of the whole, without its closing zero.
    ///
    /// # Safety
    /// `data` is NULL or has room for `size` bytes.
    pub(crate) unsafe fn put(self, text: &impl Display) -> usize {
        let mut writer = Writer { room: self, written: 0, length: 0 };
        // Its own `write_str` does not fail, nor does a text of ours.
        let _ = write!(writer, "{text}");
        if !self.data.is_null() && self.size > 0 {
            // SAFETY: a place was left for it.
            unsafe { self.data.add(writer.written).write(0) };
        }
        writer.length
    }
}

/// Fills a text from its start, without allocating.
struct Writer {
    room: pdmp_text,
    written: usize,
    length: usize,
}

impl Write for Writer {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // After a cut nothing follows.
        let whole = self.written == self.length && !self.room.data.is_null();
        let left = if whole { self.room.size.saturating_sub(self.written + 1) } else { 0 };
        let cut = (0..=text.len().min(left)).rev().find(|&cut| text.is_char_boundary(cut)).unwrap_or(0);
        if cut > 0 {
            // SAFETY: `cut` bytes and the closing zero still fit.
            unsafe { self.room.data.add(self.written).cast::<u8>().copy_from_nonoverlapping(text.as_ptr(), cut) };
        }
        self.written += cut;
        self.length += text.len();
        Ok(())
    }
}
