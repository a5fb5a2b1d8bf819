//! Pointers paired with the length of the memory that they point to.

use std::ffi::{CStr, c_char, c_void};
use std::fmt::{self, Display, Write};
use std::io::ErrorKind;
use std::path::Path;
use std::ptr;

use pdmp_core::Error;

use crate::fault::Fault;

/// Read-only array of numbers, owned by the caller; `{NULL, 0}` if it is not given.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_vector {
    /// Pointer to the first number.
    pub data: *const f64,
    /// Number of elements.
    pub length: usize,
}

/// Writable array of numbers, owned by the caller; `{NULL, 0}` if the output is not needed. Elements beyond those that
/// are written keep their value.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_buffer {
    /// Pointer to the first number.
    pub data: *mut f64,
    /// Number of elements; at least the number of elements that are written.
    pub length: usize,
}

/// Writable buffer for a UTF-8 string, owned by the caller; `{NULL, 0}` if the string is not needed. A longer string is
/// truncated between characters; the result ends in a zero byte whenever `size` > 0.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_text {
    /// Pointer to the first byte.
    pub data: *mut c_char,
    /// Size in bytes, terminating zero included.
    pub size: usize,
}

/// Writable memory, owned by the caller; `{NULL, 0}` if the library allocates.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_memory {
    /// Pointer to the first byte.
    pub data: *mut c_void,
    /// Size in bytes.
    pub size: usize,
}

/// Returns the length of an array, or `None` for `{NULL, 0}`.
pub(crate) fn length_of<T>(data: *const T, length: usize, name: &'static str) -> Result<Option<usize>, Fault> {
    match (data.is_null(), length) {
        (true, 0) => Ok(None),
        (true, _) => Err(Fault::Null(name)),
        (false, length) => Ok(Some(length)),
    }
}

/// Returns the path of a file.
///
/// # Safety
/// `path` is NULL or a zero-terminated string that stays valid and unchanged for `'a`.
pub(crate) unsafe fn path_of<'a>(path: *const c_char) -> Result<&'a Path, Fault> {
    if path.is_null() {
        return Err(Fault::Null("path"));
    }
    // SAFETY: `path` is not NULL, so the caller guarantees a zero-terminated string.
    let path = unsafe { CStr::from_ptr(path) };
    let invalid =
        |_| Error::Io { path: path.to_string_lossy().into_owned().into(), source: ErrorKind::InvalidFilename.into() };
    Ok(Path::new(path.to_str().map_err(invalid)?))
}

/// Returns the contents of a file.
///
/// # Safety
/// `bytes` is NULL or points to `size` bytes that stay valid and unchanged for `'a`.
pub(crate) unsafe fn bytes_of<'a>(bytes: *const c_void, size: usize) -> Result<&'a [u8], Fault> {
    if bytes.is_null() {
        return Err(Fault::Null("bytes"));
    }
    // SAFETY: `bytes` is not NULL, so the caller guarantees `size` readable bytes.
    Ok(unsafe { std::slice::from_raw_parts(bytes.cast(), size) })
}

impl pdmp_vector {
    pub(crate) const NONE: Self = Self { data: ptr::null(), length: 0 };

    /// Returns a pointer to numbers, which must outlive its use.
    pub(crate) fn of(numbers: &[f64]) -> Self {
        Self { data: numbers.as_ptr(), length: numbers.len() }
    }

    /// Returns the numbers, one per `per`, or `None` if they are not given.
    ///
    /// # Safety
    /// `data` is NULL or points to `length` numbers that stay valid and unchanged for `'a`.
    pub(crate) unsafe fn get<'a>(
        self,
        name: &'static str,
        expected: usize,
        per: &'static str,
    ) -> Result<Option<&'a [f64]>, Fault> {
        // Checked before any number is read: a wrong length may reach past the caller's memory.
        match length_of(self.data, self.length, name)? {
            None => Ok(None),
            Some(found) if found != expected => Err(Error::Length { name, expected, found, per }.into()),
            // SAFETY: `data` is not NULL, so the caller guarantees `length` readable numbers for `'a`.
            Some(length) => Ok(Some(unsafe { std::slice::from_raw_parts(self.data, length) })),
        }
    }

    /// Returns the numbers, which are required.
    ///
    /// # Safety
    /// As for [`pdmp_vector::get`].
    pub(crate) unsafe fn require<'a>(
        self,
        name: &'static str,
        expected: usize,
        per: &'static str,
    ) -> Result<&'a [f64], Fault> {
        // SAFETY: this function has the same contract as `get`.
        unsafe { self.get(name, expected, per) }?.ok_or(Fault::Null(name))
    }
}

impl pdmp_buffer {
    /// Checks that a given buffer holds at least one number per `per`.
    pub(crate) fn check(self, name: &'static str, expected: usize, per: &'static str) -> Result<(), Fault> {
        match length_of(self.data, self.length, name)? {
            Some(found) if found < expected => Err(Error::Length { name, expected, found, per }.into()),
            _ => Ok(()),
        }
    }

    /// Returns the first `expected` numbers of the buffer, one per `per`, which is required.
    ///
    /// # Safety
    /// `data` is NULL or points to `length` writable numbers, which nothing else uses for `'a`.
    pub(crate) unsafe fn require<'a>(
        self,
        name: &'static str,
        expected: usize,
        per: &'static str,
    ) -> Result<&'a mut [f64], Fault> {
        self.check(name, expected, per)?;
        if self.data.is_null() {
            return Err(Fault::Null(name));
        }
        // SAFETY: `data` is not NULL and has at least `expected` numbers, which the caller guarantees.
        Ok(unsafe { std::slice::from_raw_parts_mut(self.data, expected) })
    }

    /// Writes the numbers if the buffer is given.
    ///
    /// # Safety
    /// `data` is NULL or points to at least `numbers.len()` writable numbers, disjoint from `numbers`.
    pub(crate) unsafe fn write(self, numbers: &[f64]) {
        if !self.data.is_null() {
            // SAFETY: `data` is not NULL, so the caller guarantees the length and that the ranges do not overlap.
            unsafe { self.data.copy_from_nonoverlapping(numbers.as_ptr(), numbers.len()) };
        }
    }
}

impl pdmp_text {
    /// Writes a string, truncated to fit, and returns the full length without the terminating zero.
    ///
    /// # Safety
    /// `data` is NULL or points to at least `size` writable bytes.
    pub(crate) unsafe fn write(self, text: &impl Display) -> usize {
        let mut writer = TruncatingWriter { buffer: self, written: 0, length: 0 };
        // Neither `write_str` below nor the `Display` of an error fails.
        let _ = write!(writer, "{text}");
        if !self.data.is_null() && self.size > 0 {
            // SAFETY: `write_str` keeps `written` below `size`, so this byte lies within the buffer.
            unsafe { self.data.add(writer.written).write(0) };
        }
        writer.length
    }
}

/// Writer that fills a buffer without allocating and counts the bytes of the whole string.
struct TruncatingWriter {
    buffer: pdmp_text,
    written: usize,
    length: usize,
}

impl Write for TruncatingWriter {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // Nothing is written after a truncation.
        let complete = self.written == self.length && !self.buffer.data.is_null();
        let free = if complete { self.buffer.size.saturating_sub(self.written + 1) } else { 0 };
        let end = (0..=text.len().min(free)).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
        if end > 0 {
            // SAFETY: `written + end + 1 <= size`, so `end` bytes and the terminating zero lie within the buffer, which
            // is the caller's and cannot overlap a string of the library.
            unsafe { self.buffer.data.add(self.written).cast::<u8>().copy_from_nonoverlapping(text.as_ptr(), end) };
        }
        self.written += end;
        self.length += text.len();
        Ok(())
    }
}
