//! Landmark registration: the time between given landmarks is scaled to that of the nominal demonstration.
//!
//! J. O. Ramsay, B. W. Silverman, Functional Data Analysis, Springer 2005, section 7.3.

use ndarray::{Array2, ArrayView1, ArrayView2};

use super::sample_times::Ticks;
use super::{Aligned, WarpingFunction};
use crate::error::{Error, Result};
use crate::validate::{check_length, check_vector};

/// Shortest segment as a share of the duration.
const MIN_SEGMENT: f64 = 1e-6;

impl Aligned<'_> {
    /// Divides the phase axis at the landmarks of the nominal demonstration, and registers all demonstrations to it.
    ///
    /// `landmarks` (M, E) are the times of the landmarks in seconds.
    ///
    /// # Errors
    /// Another number of rows than demonstrations, no column, landmarks out of order or outside a demonstration.
    pub(super) fn register(&mut self, landmarks: ArrayView2<f64>) -> Result<()> {
        check_length("landmarks", landmarks.nrows(), self.n_demos(), "demonstration")?;
        if landmarks.ncols() == 0 {
            return Err(Error::Argument {
                name: "landmarks",
                problem: "has no columns: pass their times (M, E) in seconds, with E of at least 1",
            });
        }
        let mut segment_durations = Array2::zeros((landmarks.nrows(), landmarks.ncols() + 1));
        for (m, (row, mut segment_durations)) in
            landmarks.rows().into_iter().zip(segment_durations.rows_mut()).enumerate()
        {
            segment_durations.assign(&ArrayView1::from(
                &self.segment_durations(m, &row.to_vec()).map_err(|error| error.in_demo(m))?,
            ));
        }
        let nominal = segment_durations.row(self.nominal);
        let total = nominal.sum();
        self.breaks = nominal.iter().scan(0.0, |t, seconds| Some(std::mem::replace(t, *t + seconds) / total)).collect();
        self.breaks.push(1.0);
        for (m, segment_durations) in segment_durations.rows().into_iter().enumerate() {
            let warp = || WarpingFunction::new(self.kind, &self.breaks, &segment_durations.to_vec());
            self.warps[m] = (m != self.nominal).then(warp);
        }
        self.segment_durations = segment_durations;
        Ok(())
    }

    /// Registers the only demonstration by its landmarks (E,) to the given breaks (E+2,).
    ///
    /// # Errors
    /// Another number of landmarks than breaks between segments, landmarks out of order or outside the demonstration.
    pub(crate) fn register_to(&mut self, breaks: &[f64], landmarks: &[f64]) -> Result<()> {
        check_vector("landmarks", landmarks, breaks.len() - 2, "break between segments")?;
        let segment_durations = self.segment_durations(0, landmarks)?;
        self.warps[0] = Some(WarpingFunction::new(self.kind, breaks, &segment_durations));
        Ok(())
    }

    /// Returns the segment durations (E+1,) of demonstration `m` in seconds.
    fn segment_durations(&self, m: usize, landmarks: &[f64]) -> Result<Vec<f64>> {
        let clock = self.clocks[m];
        let start = match clock.ticks {
            Ticks::Even { .. } => 0.0,
            Ticks::Stamps(time) => time[0],
        };
        let end = start + clock.duration;
        let mut previous = start;
        let mut segment_durations = Vec::with_capacity(landmarks.len() + 1);
        for (index, &time) in landmarks.iter().enumerate() {
            // NaN compares as out of order.
            let in_order = time - previous > MIN_SEGMENT * clock.duration && end - time > MIN_SEGMENT * clock.duration;
            if !in_order {
                return Err(Error::Landmark { index, time, before: previous, end });
            }
            segment_durations.push(time - previous);
            previous = time;
        }
        segment_durations.push(end - previous);
        Ok(segment_durations)
    }
}
