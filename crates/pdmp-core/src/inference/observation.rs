//! Observations under four hypotheses of the time.
// Closures of iterators stay calls, into which the instructions of larger registers are not inlined.
#![allow(clippy::needless_range_loop)]

use super::movement_table::{MovementTable, Place};
use super::noise_filter::NoiseFilter;
use super::triangle::{add_squares, size};
use crate::numerics::simd::{F64x4, Kernel, Register, WIDTH};

/// Four hypotheses of the time of a movement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hypotheses {
    /// Durations or periods T, in seconds.
    pub(crate) duration: F64x4,
    /// Logarithms of the durations, less the mean of the demonstrations.
    pub(crate) log: F64x4,
    /// Starts from the first observation, in durations.
    pub(crate) start: F64x4,
    /// Logarithms of the weights before any observation.
    pub(crate) weight: F64x4,
}

impl Hypotheses {
    /// Returns the fractions of the movement at a time from the first observation.
    pub(crate) fn fraction(&self, time: f64) -> [f64; WIDTH] {
        (F64x4::splat(time) / self.duration - self.start).to_array()
    }
}

/// Sums over the observations.
#[derive(Clone, Debug)]
pub(crate) struct Sums {
    /// Estimates of the process of the residual of each DoF (D, w), linear in [x, 1].
    pub(crate) processes: Vec<F64x4>,
    /// Sums of the outer products of whitened rows [Φ, y] (q + 1, q + 1).
    pub(crate) information: Vec<F64x4>,
}

impl Sums {
    pub(crate) fn new(table: &MovementTable) -> Self {
        let processes = vec![F64x4::ZERO; table.n_dofs * table.width];
        Self { processes, information: vec![F64x4::ZERO; size(table.n_directions + 1)] }
    }

    /// Returns to sums of the same sizes.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.processes.copy_from_slice(&other.processes);
        self.information.copy_from_slice(&other.information);
    }

    pub(crate) fn reset(&mut self) {
        self.processes.fill(F64x4::ZERO);
        self.information.fill(F64x4::ZERO);
    }
}

/// Kernel that includes the positions (D,) at one time under four hypotheses. Missing ones have no gain.
pub(crate) struct Observe<'a> {
    pub(crate) sums: &'a mut Sums,
    pub(crate) table: &'a MovementTable,
    pub(crate) places: [Place; WIDTH],
    pub(crate) noise: &'a NoiseFilter,
    pub(crate) position: &'a [F64x4],
    /// Memory (D, w) of whitened rows, with zeros past the first q + 1 columns.
    pub(crate) rows: &'a mut [F64x4],
}

impl Kernel for Observe<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { sums, table, places, noise, position, rows } = self;
        let (q, width) = (table.n_directions, table.width);
        let decay = T::splat(noise.decay);
        let mut n_rows = 0;
        for d in 0..table.n_dofs {
            let process = &mut sums.processes[d * width..][..width];
            let Some((gain, scale)) = noise.gains[d] else {
                for k in 0..width {
                    process[k] = (T::load(&process[k]) * decay).store();
                }
                continue;
            };
            let row = &mut rows[n_rows * width..][..width];
            n_rows += 1;
            table.rows::<T>(&places, d, row);
            row[q] = (T::load(&position[d]) - T::load(&row[q])).store();
            let (gain, scale) = (T::splat(gain), T::splat(scale));
            for k in 0..width {
                let before = T::load(&process[k]) * decay;
                let innovation = T::load(&row[k]) - before;
                process[k] = (before + gain * innovation).store();
                row[k] = (scale * innovation).store();
            }
        }
        add_squares::<T>(&mut sums.information, &rows[..n_rows * width], width, q + 1);
    }
}
