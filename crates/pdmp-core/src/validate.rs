//! Argument checks and array helpers that several modules share.

use ndarray::{Array, ArrayBase, ArrayView2, Data, DataMut, Dimension, IntoDimension};

use crate::error::{Error, Result};

/// Largest magnitude of a position: its square, summed over a recording, stays finite.
pub const MAX_MAGNITUDE: f64 = 1e150;

/// Checks that an argument has `expected` elements, one per `per`.
pub(crate) fn check_length(name: &'static str, found: usize, expected: usize, per: &'static str) -> Result<()> {
    if found == expected { Ok(()) } else { Err(Error::Length { name, expected, found, per }) }
}

/// Checks that a value meets a condition, which `allowed` states as the end of a sentence.
pub(crate) fn check_range(name: &'static str, value: f64, valid: bool, allowed: &'static str) -> Result<()> {
    if valid { Ok(()) } else { Err(Error::Range { name, value, allowed }) }
}

/// Checks that `value` has `expected` elements, one per `per`, and passes [`check_finite`].
pub(crate) fn check_vector(name: &'static str, value: &[f64], expected: usize, per: &'static str) -> Result<()> {
    check_length(name, value.len(), expected, per)?;
    check_finite(name, value)
}

/// Checks that every element is finite and no larger than [`MAX_MAGNITUDE`].
pub(crate) fn check_finite(name: &'static str, value: &[f64]) -> Result<()> {
    value.iter().enumerate().try_for_each(|(index, &value)| check_number(name, index, value))
}

/// Checks that the element `value` at `index` is finite and no larger than [`MAX_MAGNITUDE`].
pub(crate) fn check_number(name: &'static str, index: usize, value: f64) -> Result<()> {
    match value.abs() {
        size if size <= MAX_MAGNITUDE => Ok(()),
        size if size.is_finite() => Err(Error::TooLarge { name, index, value, limit: MAX_MAGNITUDE }),
        _ => Err(Error::NotFinite { name, index, value }),
    }
}

/// Checks that `value` is positive and finite.
pub(crate) fn check_positive(name: &'static str, value: f64) -> Result<()> {
    check_range(name, value, value.is_finite() && value > 0.0, "must be positive and finite")
}

/// Returns an array of zeros, or [`Error::Memory`] if the allocation fails.
pub(crate) fn zeros<D: IntoDimension>(name: &'static str, shape: D) -> Result<Array<f64, D::Dim>> {
    let shape = shape.into_dimension();
    let numbers: f64 = shape.slice().iter().map(|&n| n as f64).product();
    let out_of_memory = || Error::Memory { name, numbers };
    // Rust limits an allocation to isize::MAX bytes.
    if numbers * 8.0 >= isize::MAX as f64 {
        return Err(out_of_memory());
    }
    // The operating system hands out zeroed pages, so that large arrays need no pass over their memory.
    let data = bytemuck::allocation::try_zeroed_vec(numbers as usize).map_err(|()| out_of_memory())?;
    Array::from_shape_vec(shape, data).map_err(|_| out_of_memory())
}

/// Message of the panic on an array that breaks the invariant of [`row_major`].
const NOT_ROW_MAJOR: &str = "arrays that this crate allocates are contiguous in row-major order";

/// Returns the elements of an array by rows.
///
/// # Panics
/// If the array is not contiguous in row-major order. Every array passed here was allocated by this crate in that order,
/// so that a violation is a defect of the crate, which must not turn into an empty slice.
#[track_caller]
pub(crate) fn row_major<S: Data, D: Dimension>(array: &ArrayBase<S, D>) -> &[S::Elem] {
    array.as_slice().expect(NOT_ROW_MAJOR)
}

/// Returns the elements of an array by rows, mutably.
///
/// # Panics
/// As for [`row_major`].
#[track_caller]
pub(crate) fn row_major_mut<S: DataMut, D: Dimension>(array: &mut ArrayBase<S, D>) -> &mut [S::Elem] {
    array.as_slice_mut().expect(NOT_ROW_MAJOR)
}

/// Checks that every element of a matrix is finite and no larger than [`MAX_MAGNITUDE`].
pub(crate) fn check_matrix(name: &'static str, matrix: ArrayView2<f64>) -> Result<()> {
    // A pass without branches runs in vector registers; the bad element is located only if there is one.
    if matrix.fold(true, |valid, value| valid & (value.abs() <= MAX_MAGNITUDE)) {
        return Ok(());
    }
    for ((row, column), &value) in matrix.indexed_iter() {
        if !value.is_finite() {
            return Err(Error::NotFiniteAt { name, row, column, value });
        }
        if value.abs() > MAX_MAGNITUDE {
            return Err(Error::Magnitude { name, row, column, value, limit: MAX_MAGNITUDE });
        }
    }
    Ok(())
}

/// Checks `n_samples` time stamps in seconds: they must increase by more than 1e-12 of the duration.
pub(crate) fn check_time(time: &[f64], n_samples: usize) -> Result<()> {
    check_vector("time", time, n_samples, "sample")?;
    // The slope of a spline between two closer stamps may overflow.
    let min_interval = 1e-12 * (time[n_samples - 1] - time[0]).max(0.0);
    for (index, pair) in time.windows(2).enumerate() {
        if pair[1] - pair[0] <= min_interval {
            return Err(Error::Time { index: index + 1, time: pair[1], previous: pair[0] });
        }
    }
    Ok(())
}

/// Checks that a duration in seconds lies within 1e-9 to 1e9, where the squares of rates stay finite.
pub(crate) fn check_duration(value: f64) -> Result<()> {
    let allowed = "seconds from start to end must lie between 1e-9 and 1e9; check dt or time";
    check_range("duration", value, (1e-9..=1e9).contains(&value), allowed)
}

/// Maximum length of the name of a DoF or context column, or of a unit, in bytes: it bounds the header of a model file.
pub(crate) const MAX_NAME_LENGTH: usize = 1000;
/// Largest number of characters of a name in an error text.
const MAX_QUOTED_LENGTH: usize = 60;

/// Checks the number of names, that they differ, and their lengths.
pub(crate) fn check_names(name: &'static str, names: &[String], expected: usize, per: &'static str) -> Result<()> {
    if names.len() != expected {
        return Err(Error::Length { name, expected, found: names.len(), per });
    }
    for (index, value) in names.iter().enumerate() {
        let allowed = match value {
            value if names[..index].contains(value) => "repeats a name: the names must differ from each other",
            value if value.len() > MAX_NAME_LENGTH => "must have at most 1000 bytes",
            _ => continue,
        };
        return Err(Error::Name { name, index, value: value.chars().take(MAX_QUOTED_LENGTH).collect(), allowed });
    }
    Ok(())
}
