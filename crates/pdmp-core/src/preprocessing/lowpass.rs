//! Low-pass filter of recordings, and its residuals.

use ndarray::{Array2, ArrayView1, Zip};

use crate::demonstration::Demonstration;
use crate::error::{Error, Result};
use crate::numerics::smoothing_spline::{Smoothing, smooth};
use crate::preprocessing::clock;

/// Filters a recording by the cubic smoothing spline, a low-pass of fourth order without phase lag.
///
/// The gain at frequency f is 1/(1 + (f/`cut_off`)⁴), one half at the cut-off frequency in Hz.
///
/// ```
/// # use ndarray::Array2;
/// # use pdmp_core::{Demonstration, Sampling, preprocessing::lowpass};
/// # fn main() -> pdmp_core::Result<()> {
/// let position = Array2::from_shape_fn((200, 1), |(c, _)| (0.05 * c as f64).sin() + 0.01 * (3.0 * c as f64).sin());
/// let recording = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?;
/// let smooth = lowpass(&recording, 6.0)?;
/// # assert!((smooth.position()[[100, 0]] - 5.0f64.sin()).abs() < 1e-3);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// A cut-off frequency that is not positive, not below half the sampling rate, or too low for the recording; a recording
/// without times.
pub fn lowpass(demo: &Demonstration, cut_off: f64) -> Result<Demonstration> {
    demo.sampled(filtered(demo, &clock(demo)?, cut_off)?, demo.sampling().clone())
}

/// Computes the residuals of [`lowpass`] at each of K cut-off frequencies in Hz (residual analysis).
///
/// R_kd = √(1/T Σ_c (y_cd − ŷ_cd)²), (K, D), in the unit of each DoF. Noise makes R a straight line at high cut-offs; below
/// the frequency at which R leaves that line the filter removes movement, too (D. A. Winter, Biomechanics and Motor Control
/// of Human Movement, Wiley 2009, section 3.4.4).
///
/// ```
/// # use ndarray::Array2;
/// # use pdmp_core::{Demonstration, Sampling, preprocessing::residuals};
/// # fn main() -> pdmp_core::Result<()> {
/// # let position = Array2::from_shape_fn((200, 1), |(c, _)| (0.05 * c as f64).sin() + 0.01 * (3.0 * c as f64).sin());
/// let recording = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?;
/// let r = residuals(&recording, &[2.0, 6.0, 40.0])?;
/// assert!(r[[0, 0]] > r[[1, 0]] && r[[1, 0]] > r[[2, 0]]);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// As for [`lowpass`].
pub fn residuals(demo: &Demonstration, cut_offs: &[f64]) -> Result<Array2<f64>> {
    let time = clock(demo)?;
    let mut residuals = Array2::zeros((cut_offs.len(), demo.n_coordinates()));
    for (mut row, &cut_off) in residuals.rows_mut().into_iter().zip(cut_offs) {
        let residual = filtered(demo, &time, cut_off)? - demo.position();
        Zip::from(&mut row).and(residual.columns()).for_each(|r, column| *r = rms(column));
    }
    Ok(residuals)
}

/// Returns the root mean square, scaled by the largest magnitude so that no square overflows or underflows.
fn rms(values: ArrayView1<f64>) -> f64 {
    let largest = values.fold(0.0, |largest: f64, x| largest.max(x.abs()));
    if largest == 0.0 {
        return 0.0;
    }
    largest * (values.iter().map(|x| (x / largest).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

/// Returns the filtered positions (T, D).
fn filtered(demo: &Demonstration, time: &[f64], hz: f64) -> Result<Array2<f64>> {
    smooth(Smoothing::CutOff { hz }, time, None, demo.position(), &[]).map_err(|error| match error {
        Error::Range { value, allowed, .. } => Error::Range { name: "cut_off", value, allowed },
        Error::CutOff { hz, allowed, rate, .. } => Error::CutOff { name: "cut_off", hz, allowed, rate },
        other => other,
    })
}
