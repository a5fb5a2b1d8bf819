//! Checks of arguments that several modules share.

use ndarray::{Array, ArrayView2, Dimension, IntoDimension};

use crate::error::{Error, Result};

/// Largest magnitude whose square, summed over a recording, stays finite.
pub const LARGEST: f64 = 1e150;

/// Checks that `value` has one finite number per `per`.
pub(crate) fn check_vector(name: &'static str, value: &[f64], expected: usize, per: &'static str) -> Result<()> {
    if value.len() != expected {
        return Err(Error::Length { name, expected, found: value.len(), per });
    }
    check_finite(name, value)
}

/// Checks that every element is finite and no larger than [`LARGEST`].
pub(crate) fn check_finite(name: &'static str, value: &[f64]) -> Result<()> {
    value.iter().enumerate().try_for_each(|(index, &value)| check_number(name, index, value))
}

/// Checks that the element `value` at `index` is finite and no larger than [`LARGEST`].
pub(crate) fn check_number(name: &'static str, index: usize, value: f64) -> Result<()> {
    match value.abs() {
        size if size <= LARGEST => Ok(()),
        size if size.is_finite() => Err(Error::TooLarge { name, index, value, limit: LARGEST }),
        _ => Err(Error::NotFinite { name, index, value }),
    }
}

/// Checks that `value` is positive and finite.
pub(crate) fn check_positive(name: &'static str, value: f64) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(Error::Range { name, value, allowed: "must be positive and finite" })
    }
}

/// An array of zeros, or an error where memory does not hold it.
pub(crate) fn zeros<D: IntoDimension>(name: &'static str, shape: D) -> Result<Array<f64, D::Dim>> {
    let shape = shape.into_dimension();
    let numbers: f64 = shape.slice().iter().map(|&n| n as f64).product();
    let none = || Error::Memory { name, numbers };
    // An allocation may hold isize::MAX bytes. The system's memory is zero as it comes.
    if numbers * 8.0 >= isize::MAX as f64 {
        return Err(none());
    }
    let data = bytemuck::allocation::try_zeroed_vec(numbers as usize).map_err(|()| none())?;
    Array::from_shape_vec(shape, data).map_err(|_| none())
}

/// Checks that every element of a matrix is finite and no larger than [`LARGEST`].
pub(crate) fn check_matrix(name: &'static str, matrix: ArrayView2<f64>) -> Result<()> {
    // Without a branch for each: the bad one is looked for where there is one.
    if matrix.fold(true, |sound, value| sound & (value.abs() <= LARGEST)) {
        return Ok(());
    }
    for ((row, column), &value) in matrix.indexed_iter() {
        if !value.is_finite() {
            return Err(Error::NotFiniteAt { name, row, column, value });
        }
        if value.abs() > LARGEST {
            return Err(Error::Magnitude { name, row, column, value, limit: LARGEST });
        }
    }
    Ok(())
}

pub(crate) fn check_time(time: &[f64], n_samples: usize) -> Result<()> {
    check_vector("time", time, n_samples, "sample")?;
    // Stamps closer than this are one instant to a spline: slopes between them would leave the range of numbers.
    let least = 1e-12 * (time[n_samples - 1] - time[0]).max(0.0);
    for (index, pair) in time.windows(2).enumerate() {
        if pair[1] - pair[0] <= least {
            return Err(Error::Time { index: index + 1, time: pair[1], previous: pair[0] });
        }
    }
    Ok(())
}

/// Checks a duration in seconds: far outside, squares of rates would leave the range of numbers.
pub(crate) fn check_duration(value: f64) -> Result<()> {
    if (1e-9..=1e9).contains(&value) {
        return Ok(());
    }
    let allowed = "seconds from start to end must lie between 1e-9 and 1e9; check dt or time";
    Err(Error::Range { name: "duration", value, allowed })
}
