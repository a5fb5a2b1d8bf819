//! The low-pass filter of recordings, and what it takes off.

use ndarray::{Array2, Zip};

use crate::demonstration::Demonstration;
use crate::error::{Error, Result};
use crate::numerics::smoothing_spline::{Smoothing, smooth};
use crate::preprocessing::clock;

/// The recording through the cubic smoothing spline, a low-pass filter of fourth order without phase lag.
///
/// At the frequency f a sine keeps the share 1/(1 + (f/`cut_off`)⁴), half of its amplitude at the cut-off in Hz.
///
/// # Errors
/// A cut-off that is not positive, not below half the sampling rate, or far below any movement; a recording without
/// times.
pub fn lowpass(demo: &Demonstration, cut_off: f64) -> Result<Demonstration> {
    demo.sampled(filtered(demo, &clock(demo)?, cut_off)?, demo.sampling().clone())
}

/// What the filter takes off at each of the K `cut_offs`, in Hz: R_kd = √(1/T Σ_c (y_cd − ŷ_cd)²), (K, D), in the unit of
/// each DoF.
///
/// D. A. Winter, Biomechanics and Motor Control of Human Movement, Wiley 2009, section 3.4.4: noise makes R a straight
/// line at high cut-offs; where it leaves that line, the filter begins to take off movement.
///
/// # Errors
/// As for [`lowpass`].
pub fn residuals(demo: &Demonstration, cut_offs: &[f64]) -> Result<Array2<f64>> {
    let time = clock(demo)?;
    let mut residuals = Array2::zeros((cut_offs.len(), demo.n_dofs()));
    for (mut row, &cut_off) in residuals.rows_mut().into_iter().zip(cut_offs) {
        let off = filtered(demo, &time, cut_off)? - demo.position();
        Zip::from(&mut row).and(off.columns()).for_each(|r, off| *r = rms(off.iter().copied(), off.len()));
    }
    Ok(residuals)
}

/// Root mean square, of numbers whose squares may leave the range.
fn rms(numbers: impl Iterator<Item = f64> + Clone, n: usize) -> f64 {
    let largest = numbers.clone().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    if largest == 0.0 { 0.0 } else { largest * (numbers.map(|x| (x / largest).powi(2)).sum::<f64>() / n as f64).sqrt() }
}

fn filtered(demo: &Demonstration, time: &[f64], hz: f64) -> Result<Array2<f64>> {
    smooth(Smoothing::CutOff { hz }, time, None, demo.position()).map_err(|error| match error {
        Error::Range { value, allowed, .. } => Error::Range { name: "cut_off", value, allowed },
        other => other,
    })
}
