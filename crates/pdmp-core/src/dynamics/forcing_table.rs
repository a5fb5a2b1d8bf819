//! Table of the forcing term, evaluated in constant time.
//!
//! The forcing of each style dimension and DoF is stored as a piecewise cubic Hermite interpolant on a uniform grid of the
//! clock, independently of the regressor that it was learnt by.

use crate::dynamics::braking::{BrakedMotion, Braking};
use crate::dynamics::canonical::{Canonical, faded, turn};
use crate::dynamics::hermite_table::KnotTable;
use crate::dynamics::output_system::{Attractor, CubicSample};
use crate::numerics::simd::{F64x4, Real, Register, WIDTH, groups};

/// Forcing w of unit styles over the clock: x·b(x; W) for a discrete movement, b(φ; W) for a rhythmic one.
///
/// ```
/// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let table = model.forcing_table();
/// let (mut value, mut slope) = (vec![0.0; table.n_outputs()], vec![0.0; table.n_outputs()]);
/// table.evaluate(0.5 * table.canonical().extent(), &mut value, &mut slope);
/// assert!(table.error() <= 1e-9);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ForcingTable {
    canonical: Canonical,
    pub(super) n_styles: usize,
    n_dofs: usize,
    /// Number of cubics at a knot: one for each group of DoFs and style.
    pub(super) knot_stride: usize,
    cells: usize,
    /// Width of a cell on the clock.
    pub(super) cell_width: f64,
    /// Number of cells per unit of the clock.
    pub(super) cells_per_clock: f64,
    /// By knots, groups of DoFs and styles, so that a tick reads contiguous memory. After the last knot, a and b of
    /// w = r·(a + b·p) past the end.
    pub(super) cubics: Vec<Cubic>,
    /// Form of the forcing past the end of a discrete movement.
    pub(super) ending: Ending,
    /// Interpolation error, relative to the largest forcing.
    error: f64,
}

/// Form of the forcing at v = u − u_end past the end of a discrete movement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ending {
    /// Decay with the phase, w = w_end·exp(−α_x v), as in the paper.
    Phase,
    /// w = −z_end·exp(−α_z v) + v_end·p(v). The first part decays as z does, so that a movement which ends at rest on its
    /// goal stays there. The second part brakes.
    Braked { alpha_z: f64, braking: Braking },
}

/// Factors of the forcing past the end, w = r·(a + b·p), and their derivatives with respect to the clock.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fade {
    pub(crate) r: f64,
    /// r′.
    pub(crate) r_slope: f64,
    p: f64,
    /// p′.
    pub(crate) p_slope: f64,
}

/// Upper bound of |w|, without the part that decays as z does, from a clock past the end on: of a + b·p and of b.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ForcingBound {
    value: f64,
    slope: f64,
}

impl ForcingBound {
    /// Returns the bound for a + b·p as value and b as slope.
    pub(crate) fn of(&self, CubicSample { value, slope }: CubicSample<F64x4>) -> F64x4 {
        value.abs() * self.value + slope.abs() * self.slope
    }
}

/// Coefficients of a cubic in powers of the clock since a knot; the first two are value and slope at the knot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub(super) struct Cubic(pub(super) [F64x4; 4]);

/// Position in the table: the index of the first cubic at a knot, and the argument of the cubics: the clock since that knot,
/// or p past the end.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TableIndex {
    pub(super) first: usize,
    pub(crate) t: f64,
}

impl TableIndex {
    /// Position in no cell.
    pub(crate) const NONE: Self = Self { first: usize::MAX, t: 0.0 };

    /// Returns whether both lie in one cell.
    #[inline(always)]
    pub(crate) fn is_in_cell_of(self, other: Self) -> bool {
        self.first == other.first
    }
}

impl Cubic {
    /// Returns the cubic with given values and slopes at both ends of a cell.
    fn hermite(from: CubicSample<F64x4>, to: CubicSample<F64x4>, cell_width: f64) -> Self {
        let scale = 1.0 / cell_width;
        let rise = (to.value - from.value) * scale;
        let square = (rise * 3.0 - from.slope * 2.0 - to.slope) * scale;
        let cube = (from.slope + to.slope - rise * 2.0) * (scale * scale);
        Self([from.value, from.slope, square, cube])
    }

    #[inline(always)]
    pub(super) fn load<T: Register>(&self) -> [T; 4] {
        let [value, slope, square, cube] = &self.0;
        [T::load(value), T::load(slope), T::load(square), T::load(cube)]
    }

    fn at(&self, t: f64) -> CubicSample<F64x4> {
        evaluate(self.load(), t)
    }
}

/// Evaluates a cubic and its slope.
#[inline(always)]
pub(super) fn evaluate<T: Real>([value, slope, square, cube]: [T; 4], t: f64) -> CubicSample<T> {
    let cube = cube * t;
    let sum = square + cube;
    CubicSample { value: value + (slope + sum * t) * t, slope: slope + (sum + sum + cube) * t }
}

impl ForcingTable {
    /// Returns a table from values and slopes of J·D outputs at its knots, two at least.
    pub(crate) fn from_knots(canonical: Canonical, n_dofs: usize, knots: &KnotTable, error: f64) -> Self {
        let (cells, n_styles, extent) = (knots.len() - 1, knots.n_outputs / n_dofs, canonical.extent());
        let cell_width = extent / cells as f64;
        let mut cubics = Vec::with_capacity((cells + 2) * groups(n_dofs) * n_styles);
        for k in 0..=cells {
            for first in (0..n_dofs).step_by(WIDTH) {
                let n = WIDTH.min(n_dofs - first);
                cubics.extend((0..n_styles).map(|j| {
                    let from = knots.jet(k, j * n_dofs + first, n);
                    if k == cells {
                        return Cubic([from.value, from.slope, F64x4::ZERO, F64x4::ZERO]);
                    }
                    Cubic::hermite(from, knots.jet(k + 1, j * n_dofs + first, n), cell_width)
                }));
            }
        }
        let knot_stride = groups(n_dofs) * n_styles;
        for i in cells * knot_stride..(cells + 1) * knot_stride {
            cubics.push(Cubic([cubics[i].0[0], F64x4::ZERO, F64x4::ZERO, F64x4::ZERO]));
        }
        let (cells_per_clock, ending) = (cells as f64 / extent, Ending::Phase);
        Self { canonical, n_styles, n_dofs, knot_stride, cells, cell_width, cells_per_clock, cubics, ending, error }
    }

    /// Returns the table with [`Ending::Braked`], for the `z` at the end of unit styles, by groups of DoFs and styles.
    pub(crate) fn with_braking(mut self, attractor: Attractor, rate: f64, z: &[F64x4]) -> Self {
        let [end, beyond] = [self.cells, self.cells + 1].map(|row| row * self.knot_stride);
        for (i, z) in z.iter().enumerate() {
            let value = self.cubics[end + i].0[0];
            self.cubics[beyond + i] = Cubic([-*z, value + *z, F64x4::ZERO, F64x4::ZERO]);
        }
        self.ending = Ending::Braked { alpha_z: attractor.alpha_z, braking: Braking::new(attractor, rate) };
        self
    }

    /// Returns the canonical system of the clock.
    pub fn canonical(&self) -> Canonical {
        self.canonical
    }

    /// Returns the interpolation error relative to the largest forcing, measured at the middles of the cells or estimated
    /// from that of a table with half the cells. It is at most 1e-9 if 4096 cells suffice.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Returns values and slopes at the knots.
    pub(crate) fn knots(&self) -> KnotTable {
        let mut knots = KnotTable::zeros(self.cells + 1, self.n_outputs());
        for (k, (values, slopes)) in knots.rows_mut(1).enumerate() {
            self.scatter(|group, j| self.cubics(k * self.knot_stride, group)[j].at(0.0), values, slopes);
        }
        knots
    }

    /// Returns the forcing of unit styles at knot `k`, by groups of DoFs and styles.
    pub(crate) fn knot(&self, k: usize) -> impl ExactSizeIterator<Item = CubicSample<F64x4>> {
        self.cubics[k * self.knot_stride..(k + 1) * self.knot_stride].iter().map(|cubic| cubic.at(0.0))
    }

    /// Returns the index of the first unit style at a knot, by knots, groups of DoFs and styles, and the forcing of a style
    /// at the knot and at the position itself.
    pub(crate) fn cell(&self, index: TableIndex, group: usize, style: &[f64]) -> (usize, [CubicSample<F64x4>; 2]) {
        let forcing = [TableIndex { t: 0.0, ..index }, index].map(|index| self.sample(index, group, style));
        (index.first + group * self.n_styles, forcing)
    }

    /// Returns the cubics of all styles for one group of DoFs at the knot whose first cubic has index `first`.
    #[inline(always)]
    pub(super) fn cubics(&self, first: usize, group: usize) -> &[Cubic] {
        let start = first + group * self.n_styles;
        &self.cubics[start..start + self.n_styles]
    }

    /// Returns the number of outputs J·D.
    pub fn n_outputs(&self) -> usize {
        self.n_styles * self.n_dofs
    }

    /// Returns the number of cells.
    pub fn cells(&self) -> usize {
        self.cells
    }

    /// Writes the forcing of all J·D outputs, in the unit of each DoF, and its slope with respect to the clock.
    ///
    /// Past the end of a discrete movement w = −z_end·exp(−α_z v) + v_end·p(v), with v = u − u_end, z_end = z and
    /// v_end = y′ at the end, and p such that the movement continues as y = g + v_end·v·exp(−κv/2). With immediate transport
    /// the forcing decays with the phase, w(u) = w(u_end)·x(u)/x(u_end).
    /// `value` and `slope` are matrices (J, D) by rows.
    ///
    /// # Panics
    /// Slices of more than J·D elements.
    pub fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        let index = self.index(u);
        let sample = |group: usize, j: usize| self.cubics(index.first, group)[j].at(index.t);
        match self.fade(u) {
            Some(Fade { r, r_slope, p_slope, .. }) => {
                let fade = |CubicSample { value, slope }: CubicSample<F64x4>| CubicSample {
                    value: value * r,
                    slope: value * r_slope + slope * (r * p_slope),
                };
                self.scatter(|group, j| fade(sample(group, j)), value, slope);
            }
            None => self.scatter(sample, value, slope),
        }
    }

    /// Returns whether clock `u` is past the end of a discrete movement.
    #[inline(always)]
    pub(crate) fn is_past(&self, u: f64) -> bool {
        matches!(self.canonical, Canonical::Discrete { u_end, .. } if u >= u_end)
    }

    /// Returns the factors of the forcing past the end of a discrete movement, `None` before it.
    #[inline(always)]
    pub(crate) fn fade(&self, u: f64) -> Option<Fade> {
        match (self.canonical, self.ending) {
            (Canonical::Discrete { u_end, alpha_x }, ending) if u >= u_end => {
                let v = u - u_end;
                let (r_rate, braking) = match ending {
                    Ending::Phase => (alpha_x, None),
                    Ending::Braked { alpha_z, braking } => (alpha_z, Some(braking)),
                };
                let r = faded((-r_rate * v).exp());
                let [p, p_slope] = match braking.filter(|_| r > 0.0) {
                    Some(braking) => braking.forcing(v),
                    None => [1.0, 0.0],
                };
                Some(Fade { r, r_slope: -r_rate * r, p, p_slope })
            }
            _ => None,
        }
    }

    /// Returns the motion due to the forcing at clock `u` past the end of a movement that brakes.
    pub(crate) fn braked_motion(&self, u: f64) -> Option<BrakedMotion> {
        let (Some(Fade { r, p, .. }), Ending::Braked { braking, .. }) = (self.fade(u), self.ending) else {
            return None;
        };
        let v = u - self.canonical.extent();
        Some(BrakedMotion { r, p, unit: braking.state(v), max_displacement: braking.max_displacement(v) })
    }

    /// Returns the bound of the forcing from clock `u` past the end on.
    pub(crate) fn bound(&self, u: f64) -> ForcingBound {
        let v = u - self.canonical.extent();
        match (self.canonical, self.ending) {
            (_, Ending::Braked { braking, .. }) => ForcingBound { value: 0.0, slope: braking.bound(v) },
            (Canonical::Discrete { alpha_x, .. }, Ending::Phase) => {
                ForcingBound { value: (-alpha_x * v).exp(), slope: 0.0 }
            }
            (Canonical::Rhythmic { .. }, Ending::Phase) => ForcingBound { value: 1.0, slope: 0.0 },
        }
    }

    /// Writes samples of all groups and styles as (J, D) by rows.
    fn scatter(&self, sample: impl Fn(usize, usize) -> CubicSample<F64x4>, value: &mut [f64], slope: &mut [f64]) {
        let rows = value.chunks_mut(self.n_dofs).zip(slope.chunks_mut(self.n_dofs));
        for (j, (value, slope)) in rows.enumerate() {
            for (group, (value, slope)) in value.chunks_mut(WIDTH).zip(slope.chunks_mut(WIDTH)).enumerate() {
                let sample = sample(group, j);
                value.copy_from_slice(&sample.value.to_array()[..value.len()]);
                slope.copy_from_slice(&sample.slope.to_array()[..slope.len()]);
            }
        }
    }

    /// Returns the position of clock `u`. Past the end of a discrete movement the caller applies the [`Fade`].
    pub(crate) fn index(&self, u: f64) -> TableIndex {
        self.faded_index(u, self.fade(u))
    }

    /// Returns the position of clock `u` with its [`ForcingTable::fade`].
    #[inline(always)]
    pub(crate) fn faded_index(&self, u: f64, fade: Option<Fade>) -> TableIndex {
        match fade {
            Some(Fade { p, .. }) => TableIndex { first: (self.cells + 1) * self.knot_stride, t: p },
            None => self.demonstrated_index(u),
        }
    }

    /// Returns the position of clock `u` in the demonstrated interval, clamped to its end.
    #[inline(always)]
    pub(crate) fn demonstrated_index(&self, u: f64) -> TableIndex {
        let u = if let Canonical::Rhythmic { .. } = self.canonical { turn(u) } else { u };
        let (cell, t) = self.position(u);
        TableIndex { first: cell as usize * self.knot_stride, t }
    }

    /// Returns the cell of clock `u`, of a rhythmic movement below 2π, and the clock since its first knot.
    #[inline(always)]
    pub(crate) fn position(&self, u: f64) -> (u32, f64) {
        let position = u * self.cells_per_clock;
        // The cast saturates: a negative clock is evaluated in the first cell.
        let cell = position as u32;
        if cell < self.cells as u32 {
            (cell, (position - f64::from(cell)) * self.cell_width)
        } else {
            (self.cells as u32, 0.0)
        }
    }

    /// Prefetches the cubics at clock `u`, since a table may exceed the first-level cache.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub(crate) fn prefetch(&self, u: f64) {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};

            let first = self.demonstrated_index(u).first;
            for Cubic([first, _, third, _]) in &self.cubics[first..first + self.knot_stride] {
                // SAFETY: SSE is part of x86-64, and a prefetch is a hint that never faults and reads no value. The
                // addresses are those of elements of `cubics`.
                unsafe {
                    _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(first).cast());
                    _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(third).cast());
                }
            }
        }
    }

    /// Returns the forcing Σⱼ sⱼwⱼ of a style and its slope, for one group of DoFs.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    pub(crate) fn sample<T: Register>(&self, index: TableIndex, group: usize, style: &[f64]) -> CubicSample<T> {
        let cubics = self.cubics(index.first, group);
        let ([s, style @ ..], [cubic, cubics @ ..]) = (style, cubics) else { return CubicSample::default() };
        let [value, slope, square, cube] = cubic.load::<T>();
        let mut sum = [value * *s, slope * *s, square * *s, cube * *s];
        for j in 0..style.len().min(cubics.len()) {
            accumulate(&mut sum, cubics[j].load(), style[j]);
        }
        evaluate(sum, index.t)
    }

    /// Returns the forcings of two styles. Each cubic is loaded once for both.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    pub(crate) fn sample_pair<T: Register>(
        &self,
        index: TableIndex,
        group: usize,
        styles: [&[f64]; 2],
    ) -> [CubicSample<T>; 2] {
        let mut sums = [[T::default(); 4]; 2];
        let ([style, rate], cubics) = (styles, self.cubics(index.first, group));
        for j in 0..cubics.len().min(style.len()).min(rate.len()) {
            let cubic = cubics[j].load();
            accumulate(&mut sums[0], cubic, style[j]);
            accumulate(&mut sums[1], cubic, rate[j]);
        }
        [evaluate(sums[0], index.t), evaluate(sums[1], index.t)]
    }
}

#[inline(always)]
#[allow(clippy::needless_range_loop)] // See `Kernel`.
fn accumulate<T: Real>(sum: &mut [T; 4], cubic: [T; 4], weight: f64) {
    for i in 0..4 {
        sum[i] = sum[i] + cubic[i] * weight;
    }
}
