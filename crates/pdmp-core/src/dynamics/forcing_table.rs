//! The attractor landscape, compiled to a table that is read in constant time.
//!
//! Whatever regression learnt it, the forcing of each style dimension and DoF is stored as a piecewise cubic (Hermite)
//! on a uniform grid of the clock.

use crate::dynamics::canonical::{Canonical, faded, turn};
use crate::dynamics::hermite_table::KnotTable;
use crate::dynamics::output_system::CubicSample;
use crate::numerics::simd::{F64x4, Real, Register, WIDTH, groups};

/// Forcing w of unit styles over the clock: discrete x·b(x; W), rhythmic b(φ; W).
#[derive(Clone, Debug, PartialEq)]
pub struct ForcingTable {
    canonical: Canonical,
    n_styles: usize,
    n_dofs: usize,
    /// Cubics at a knot, of all groups of DoFs and styles.
    at_knot: usize,
    cells: usize,
    /// Width of a cell, and how many there are per unit of the clock.
    width: f64,
    per_clock: f64,
    /// By knots, groups of DoFs and styles, so that a step reads one stretch of memory from end to end. After the last
    /// knot comes what follows: a and b of w = r·(a + b·p) past the end.
    cubics: Vec<Cubic>,
    /// What is past the end of a discrete movement.
    ending: Ending,
    /// Error between the knots, relative to the largest forcing.
    error: f64,
}

/// How the forcing goes on at v = u − u_end past the end of a discrete movement.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ending {
    /// It fades with the phase, w = w_end·exp(−α_x v), as in the paper.
    Phase,
    /// w = −z_end·exp(−α_z v) + v_end·exp(−κv): the first part fades as z itself, so that what ends at rest on its goal stays
    /// there, and the second brakes.
    Braked { alpha_z: f64, braking: f64 },
}

/// The forcing past the end, r·(a + b·p): what multiplies it, and its derivatives with respect to the clock.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fade {
    /// r.
    pub(crate) value: f64,
    /// r′.
    pub(crate) growth: f64,
    /// p and p′.
    share: f64,
    pub(crate) along: f64,
    braked: bool,
}

impl Fade {
    /// Magnitude of what still pushes where z has settled, for a + b·p as value and b as slope.
    pub(crate) fn push(&self, CubicSample { value, slope }: CubicSample<F64x4>) -> F64x4 {
        let push = if self.braked { slope * (self.share * self.value) } else { value * self.value };
        push.abs()
    }
}

/// Coefficients of a cubic from a knot on, over the clock; the first two are value and slope at the knot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
struct Cubic([F64x4; 4]);

/// A place on the clock: the first cubic at a knot, and how far beyond it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TableIndex {
    first: usize,
    t: f64,
}

impl Cubic {
    /// The cubic with given values and slopes at both ends of a cell.
    fn hermite(from: CubicSample<F64x4>, to: CubicSample<F64x4>, width: f64) -> Self {
        let scale = 1.0 / width;
        let rise = (to.value - from.value) * scale;
        let square = (rise * 3.0 - from.slope * 2.0 - to.slope) * scale;
        let cube = (from.slope + to.slope - rise * 2.0) * (scale * scale);
        Self([from.value, from.slope, square, cube])
    }

    #[inline(always)]
    fn load<T: Register>(&self) -> [T; 4] {
        let [value, slope, square, cube] = &self.0;
        [T::load(value), T::load(slope), T::load(square), T::load(cube)]
    }

    fn at(&self, t: f64) -> CubicSample<F64x4> {
        evaluate(self.load(), t)
    }
}

/// A cubic of given coefficients.
#[inline(always)]
fn evaluate<T: Real>([value, slope, square, cube]: [T; 4], t: f64) -> CubicSample<T> {
    let rest = cube * t;
    let bend = square + rest;
    CubicSample { value: value + (slope + bend * t) * t, slope: slope + (bend + bend + rest) * t }
}

impl ForcingTable {
    /// A table from values and slopes of J·D outputs at its knots, two at least.
    pub(crate) fn from_knots(canonical: Canonical, n_dofs: usize, knots: &KnotTable, error: f64) -> Self {
        let (cells, n_styles, extent) = (knots.len() - 1, knots.n_outputs / n_dofs, canonical.extent());
        let width = extent / cells as f64;
        let mut cubics = Vec::with_capacity((cells + 2) * groups(n_dofs) * n_styles);
        for k in 0..=cells {
            for first in (0..n_dofs).step_by(WIDTH) {
                let n = WIDTH.min(n_dofs - first);
                cubics.extend((0..n_styles).map(|j| {
                    let from = knots.jet(k, j * n_dofs + first, n);
                    if k == cells {
                        return Cubic([from.value, from.slope, F64x4::ZERO, F64x4::ZERO]);
                    }
                    Cubic::hermite(from, knots.jet(k + 1, j * n_dofs + first, n), width)
                }));
            }
        }
        let at_knot = groups(n_dofs) * n_styles;
        for i in cells * at_knot..(cells + 1) * at_knot {
            cubics.push(Cubic([cubics[i].0[0], F64x4::ZERO, F64x4::ZERO, F64x4::ZERO]));
        }
        let ending = Ending::Phase;
        Self {
            canonical,
            n_styles,
            n_dofs,
            at_knot,
            cells,
            width,
            per_clock: cells as f64 / extent,
            cubics,
            ending,
            error,
        }
    }

    /// The same with a forcing that brakes past the end, for `z` of unit styles there, by groups of DoFs and styles.
    pub(crate) fn braked(mut self, alpha_z: f64, braking: f64, z: &[F64x4]) -> Self {
        let [end, beyond] = [self.cells, self.cells + 1].map(|row| row * self.at_knot);
        for (i, z) in z.iter().enumerate() {
            let value = self.cubics[end + i].0[0];
            self.cubics[beyond + i] = Cubic([-*z, value + *z, F64x4::ZERO, F64x4::ZERO]);
        }
        self.ending = Ending::Braked { alpha_z, braking };
        self
    }

    /// The canonical system whose clock the table is read at.
    pub fn canonical(&self) -> Canonical {
        self.canonical
    }

    /// Error between the knots, relative to the largest forcing, measured in their middles or estimated from that of a
    /// table half as fine: 1e-9 at most where 4096 cells suffice.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Values and slopes at the knots.
    pub(crate) fn knots(&self) -> KnotTable {
        let mut knots = KnotTable::zeros(self.cells + 1, self.n_outputs());
        for (k, (values, slopes)) in knots.rows_mut(1).enumerate() {
            self.scatter(|group, j| self.knot(k, group, j), values, slopes);
        }
        knots
    }

    /// The forcing of a style at a knot, for one group of DoFs.
    pub(crate) fn knot(&self, k: usize, group: usize, j: usize) -> CubicSample<F64x4> {
        self.cubics(k * self.at_knot, group)[j].at(0.0)
    }

    /// The cubics of all styles for one group of DoFs, from a knot on whose first cubic is given.
    #[inline(always)]
    fn cubics(&self, first: usize, group: usize) -> &[Cubic] {
        let start = first + group * self.n_styles;
        &self.cubics[start..start + self.n_styles]
    }

    /// Number of outputs J·D.
    pub fn n_outputs(&self) -> usize {
        self.n_styles * self.n_dofs
    }

    /// Number of cells of the table.
    pub fn cells(&self) -> usize {
        self.cells
    }

    /// The forcing of all J·D outputs and its slope with respect to the clock.
    ///
    /// Past the end of a discrete movement it brakes, w(u) = −z_end·exp(−α_z(u − u_end)) + v_end·exp(−κ(u − u_end)) with z
    /// and y′ at the end, or, where transport is immediate, fades with the phase, w(u) = w(u_end)·x(u)/x(u_end). `value`
    /// and `slope` take as many numbers as there are outputs, (J, D) by rows.
    ///
    /// # Panics
    /// Slices that are longer.
    pub fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        let place = self.place(u);
        let jet = |group: usize, j: usize| self.cubics(place.first, group)[j].at(place.t);
        match self.fading(u) {
            Some(Fade { value: r, growth, along, .. }) => {
                let faded = |CubicSample { value, slope }: CubicSample<F64x4>| CubicSample {
                    value: value * r,
                    slope: value * growth + slope * (r * along),
                };
                self.scatter(|group, j| faded(jet(group, j)), value, slope);
            }
            None => self.scatter(jet, value, slope),
        }
    }

    /// Whether clock `u` is past the end of a discrete movement.
    #[inline(always)]
    pub(crate) fn is_past(&self, u: f64) -> bool {
        matches!(self.canonical, Canonical::Discrete { u_end, .. } if u >= u_end)
    }

    /// How the forcing fades past the end of a discrete movement.
    #[inline(always)]
    pub(crate) fn fading(&self, u: f64) -> Option<Fade> {
        match (self.canonical, self.ending) {
            (Canonical::Discrete { u_end, alpha_x }, ending) if u >= u_end => {
                let (rate, beyond, braked) = match ending {
                    Ending::Phase => (alpha_x, 0.0, false),
                    Ending::Braked { alpha_z, braking } => (alpha_z, braking - alpha_z, true),
                };
                let [value, share] = [rate, beyond].map(|rate| faded((-rate * (u - u_end)).exp()));
                Some(Fade { value, growth: -rate * value, share, along: -beyond * share, braked })
            }
            _ => None,
        }
    }

    /// Writes what is known by groups and styles as (J, D) by rows.
    fn scatter(&self, jet: impl Fn(usize, usize) -> CubicSample<F64x4>, value: &mut [f64], slope: &mut [f64]) {
        let rows = value.chunks_mut(self.n_dofs).zip(slope.chunks_mut(self.n_dofs));
        for (j, (value, slope)) in rows.enumerate() {
            for (group, (value, slope)) in value.chunks_mut(WIDTH).zip(slope.chunks_mut(WIDTH)).enumerate() {
                let jet = jet(group, j);
                value.copy_from_slice(&jet.value.to_array()[..value.len()]);
                slope.copy_from_slice(&jet.slope.to_array()[..slope.len()]);
            }
        }
    }

    /// A place on the clock. What lies beyond a discrete movement is faded by the reader.
    pub(crate) fn place(&self, u: f64) -> TableIndex {
        match self.fading(u) {
            Some(Fade { share, .. }) => TableIndex { first: (self.cells + 1) * self.at_knot, t: share },
            None => self.place_within(u),
        }
    }

    /// A place of the demonstrated stretch, its end for all that lies beyond.
    #[inline(always)]
    pub(crate) fn place_within(&self, u: f64) -> TableIndex {
        let u = if let Canonical::Rhythmic { .. } = self.canonical { turn(u) } else { u };
        let position = u * self.per_clock;
        // A saturating cast: what lies below the table is read in its first cell.
        let cell = position as u32;
        if cell < self.cells as u32 {
            TableIndex { first: cell as usize * self.at_knot, t: (position - f64::from(cell)) * self.width }
        } else {
            TableIndex { first: self.cells * self.at_knot, t: 0.0 }
        }
    }

    /// Fetches what a tick will read near a clock: a table larger than the nearest cache is slow to come otherwise.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub(crate) fn prefetch(&self, u: f64) {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};

            let start = self.place_within(u).first;
            for Cubic([first, _, third, _]) in &self.cubics[start..start + self.at_knot] {
                // SAFETY: a hint; every x86-64 processor has it, and nothing is read.
                unsafe {
                    _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(first).cast());
                    _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(third).cast());
                }
            }
        }
    }

    /// Forcing sᵀb at a place, for one group of DoFs, with its slope.
    #[inline(always)]
    pub(crate) fn blend<T: Register>(&self, place: TableIndex, group: usize, style: &[f64]) -> CubicSample<T> {
        let mut sum = [T::default(); 4];
        for (s, cubic) in style.iter().zip(self.cubics(place.first, group)) {
            accumulate(&mut sum, cubic.load(), *s);
        }
        evaluate(sum, place.t)
    }

    /// Forcings of two styles, which take no more reading than one.
    #[inline(always)]
    pub(crate) fn blend_both<T: Register>(
        &self,
        place: TableIndex,
        group: usize,
        styles: [&[f64]; 2],
    ) -> [CubicSample<T>; 2] {
        let mut sums = [[T::default(); 4]; 2];
        for ((s, v), cubic) in styles[0].iter().zip(styles[1]).zip(self.cubics(place.first, group)) {
            let cubic = cubic.load();
            accumulate(&mut sums[0], cubic, *s);
            accumulate(&mut sums[1], cubic, *v);
        }
        [evaluate(sums[0], place.t), evaluate(sums[1], place.t)]
    }
}

#[inline(always)]
fn accumulate<T: Real>(sum: &mut [T; 4], cubic: [T; 4], times: f64) {
    for (sum, coefficient) in sum.iter_mut().zip(cubic) {
        *sum = *sum + coefficient * times;
    }
}
