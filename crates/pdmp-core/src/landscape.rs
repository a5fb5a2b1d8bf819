//! The attractor landscape, compiled to a table that is read in constant time.
//!
//! Whatever regression learnt it, the forcing of each style dimension and DoF is stored as a piecewise cubic (Hermite)
//! on a uniform grid of the clock.

use crate::attractor::Jet;
use crate::basis::Regression;
use crate::error::Result;
use crate::lanes::{Lanes, Real, Register, WIDTH, groups};
use crate::phase::{Canonical, faded, turn};
use crate::tabulate::{Jets, tabulate};
use crate::threads::Threads;

/// Forcing w of unit styles over the clock: discrete x·b(x; W), rhythmic b(φ; W).
#[derive(Clone, Debug, PartialEq)]
pub struct Landscape {
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
    pub(crate) fn push(&self, Jet { value, slope }: Jet<Lanes>) -> Lanes {
        let push = if self.braked { slope * (self.share * self.value) } else { value * self.value };
        push.abs()
    }
}

/// Coefficients of a cubic from a knot on, over the clock; the first two are value and slope at the knot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
struct Cubic([Lanes; 4]);

/// A place on the clock: the first cubic at a knot, and how far beyond it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    first: usize,
    t: f64,
}

impl Cubic {
    /// The cubic with given values and slopes at both ends of a cell.
    fn hermite(from: Jet<Lanes>, to: Jet<Lanes>, width: f64) -> Self {
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

    fn at(&self, t: f64) -> Jet<Lanes> {
        evaluate(self.load(), t)
    }
}

/// A cubic of given coefficients.
#[inline(always)]
fn evaluate<T: Real>([value, slope, square, cube]: [T; 4], t: f64) -> Jet<T> {
    let rest = cube * t;
    let bend = square + rest;
    Jet { value: value + (slope + bend * t) * t, slope: slope + (bend + bend + rest) * t }
}

impl Landscape {
    /// Compiles a regression of J·D outputs on so many samples.
    ///
    /// # Errors
    /// Whatever `proceed` returns, which is told the share of the finest possible table that is done.
    pub(crate) fn compile(
        canonical: Canonical,
        (n_styles, n_dofs): (usize, usize),
        n_samples: usize,
        regression: &dyn Regression,
        threads: Threads,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Self> {
        let steps = canonical.kind().steps(n_samples);
        let (mut knots, error) = tabulate(canonical.extent(), steps, n_styles * n_dofs, regression, threads, proceed)?;
        if let Canonical::Rhythmic { .. } = canonical {
            knots.close();
        }
        Ok(Self::from_knots(canonical, n_dofs, &knots, error))
    }

    /// A table from values and slopes of J·D outputs at its knots, two at least.
    pub(crate) fn from_knots(canonical: Canonical, n_dofs: usize, knots: &Jets, error: f64) -> Self {
        let (cells, n_styles, extent) = (knots.len() - 1, knots.n_outputs / n_dofs, canonical.extent());
        let width = extent / cells as f64;
        let mut cubics = Vec::with_capacity((cells + 2) * groups(n_dofs) * n_styles);
        for k in 0..=cells {
            for first in (0..n_dofs).step_by(WIDTH) {
                let n = WIDTH.min(n_dofs - first);
                cubics.extend((0..n_styles).map(|j| {
                    let from = knots.jet(k, j * n_dofs + first, n);
                    if k == cells {
                        return Cubic([from.value, from.slope, Lanes::ZERO, Lanes::ZERO]);
                    }
                    Cubic::hermite(from, knots.jet(k + 1, j * n_dofs + first, n), width)
                }));
            }
        }
        let at_knot = groups(n_dofs) * n_styles;
        for i in cells * at_knot..(cells + 1) * at_knot {
            cubics.push(Cubic([cubics[i].0[0], Lanes::ZERO, Lanes::ZERO, Lanes::ZERO]));
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
    pub(crate) fn braked(mut self, alpha_z: f64, braking: f64, z: &[Lanes]) -> Self {
        let [end, beyond] = [self.cells, self.cells + 1].map(|row| row * self.at_knot);
        for (i, z) in z.iter().enumerate() {
            let value = self.cubics[end + i].0[0];
            self.cubics[beyond + i] = Cubic([-*z, value + *z, Lanes::ZERO, Lanes::ZERO]);
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
    pub(crate) fn knots(&self) -> Jets {
        let mut knots = Jets::zeros(self.cells + 1, self.n_outputs());
        for (k, (values, slopes)) in knots.rows_mut(1).enumerate() {
            self.scatter(|group, j| self.knot(k, group, j), values, slopes);
        }
        knots
    }

    /// The forcing of a style at a knot, for one group of DoFs.
    pub(crate) fn knot(&self, k: usize, group: usize, j: usize) -> Jet<Lanes> {
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
                let faded = |Jet { value, slope }: Jet<Lanes>| Jet {
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
    fn scatter(&self, jet: impl Fn(usize, usize) -> Jet<Lanes>, value: &mut [f64], slope: &mut [f64]) {
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
    pub(crate) fn place(&self, u: f64) -> Place {
        match self.fading(u) {
            Some(Fade { share, .. }) => Place { first: (self.cells + 1) * self.at_knot, t: share },
            None => self.place_within(u),
        }
    }

    /// A place of the demonstrated stretch, its end for all that lies beyond.
    #[inline(always)]
    pub(crate) fn place_within(&self, u: f64) -> Place {
        let u = if let Canonical::Rhythmic { .. } = self.canonical { turn(u) } else { u };
        let position = u * self.per_clock;
        // A saturating cast: what lies below the table is read in its first cell.
        let cell = position as u32;
        if cell < self.cells as u32 {
            Place { first: cell as usize * self.at_knot, t: (position - f64::from(cell)) * self.width }
        } else {
            Place { first: self.cells * self.at_knot, t: 0.0 }
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
    pub(crate) fn blend<T: Register>(&self, place: Place, group: usize, style: &[f64]) -> Jet<T> {
        let mut sum = [T::default(); 4];
        for (s, cubic) in style.iter().zip(self.cubics(place.first, group)) {
            accumulate(&mut sum, cubic.load(), *s);
        }
        evaluate(sum, place.t)
    }

    /// Forcings of two styles, which take no more reading than one.
    #[inline(always)]
    pub(crate) fn blend_both<T: Register>(&self, place: Place, group: usize, styles: [&[f64]; 2]) -> [Jet<T>; 2] {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tabulate::TOLERANCE;

    #[derive(Debug)]
    struct Waves(f64);

    impl Regression for Waves {
        fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
            for (o, (value, slope)) in value.iter_mut().zip(slope).enumerate() {
                let omega = self.0 * (o + 1) as f64;
                (*value, *slope) = ((omega * u).sin(), omega * (omega * u).cos());
            }
        }

        fn describe(&self) -> String {
            "waves".into()
        }
    }

    /// Nowhere between the knots is the table further from the regression than the error it states.
    #[test]
    fn stated_error_bounds_the_table() {
        for (canonical, omega) in
            [(Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 }, 9.0), (Canonical::Rhythmic { mu: 1.0 }, 5.0)]
        {
            let regression = Waves(omega);
            let table = Landscape::compile(canonical, (1, 3), 2, &regression, Threads::ONE, &mut |_| Ok(())).unwrap();
            assert!(table.error() <= TOLERANCE);
            let (mut value, mut slope, mut exact, mut rise) = ([0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]);
            for k in 0..10_007 {
                let u = canonical.extent() * f64::from(k) / 10_007.0;
                table.evaluate(u, &mut value, &mut slope);
                regression.evaluate(u, &mut exact, &mut rise);
                for o in 0..3 {
                    assert!((value[o] - exact[o]).abs() <= table.error() + 1e-13);
                    assert!((slope[o] - rise[o]).abs() <= 1e-4 * rise[o].abs().max(1.0));
                }
            }
        }
    }

    #[derive(Debug)]
    struct Kink(f64);

    impl Regression for Kink {
        fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
            let d = u - self.0;
            (value[0], slope[0]) = (d.abs().powi(3), 3.0 * d * d.abs());
        }

        fn describe(&self) -> String {
            "kink".into()
        }
    }

    /// Where the third derivative jumps, wherever that lies in its cell, the table is about as close as it is to be.
    #[test]
    fn table_is_close_at_a_kink() {
        for k in 0..100 {
            let kink = Kink((0.5f64.sqrt() + f64::from(k) * 0.618_033_988_75).fract());
            let canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
            let table = Landscape::compile(canonical, (1, 1), 2, &kink, Threads::ONE, &mut |_| Ok(())).unwrap();
            for u in (0..=400).map(|i| kink.0 + 1e-5 * f64::from(i - 200)).filter(|u| (0.0..1.0).contains(u)) {
                let (mut value, mut slope, mut exact, mut rise) = ([0.0], [0.0], [0.0], [0.0]);
                table.evaluate(u, &mut value, &mut slope);
                kink.evaluate(u, &mut exact, &mut rise);
                assert!((value[0] - exact[0]).abs() <= 2.0 * TOLERANCE, "{k}: {:e}", value[0] - exact[0]);
            }
        }
    }

    /// Where it jumps at a sample, as a Matérn process does, the cubics on either side are exact.
    #[test]
    fn table_is_coarse_where_kinks_are_at_samples() {
        let canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
        let cells = |n_samples| {
            Landscape::compile(canonical, (1, 1), n_samples, &Kink(0.3), Threads::ONE, &mut |_| Ok(())).unwrap().cells()
        };
        assert!(cells(11) == 160 && cells(12) > 600, "{} {}", cells(11), cells(12));
    }

    /// Past the demonstrated end the forcing is continuous and fades with the phase.
    #[test]
    fn forcing_fades_with_the_phase_after_the_end() {
        let canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
        let table = Landscape::compile(canonical, (1, 1), 2, &Waves(9.0), Threads::ONE, &mut |_| Ok(())).unwrap();
        let at = |u: f64| {
            let (mut value, mut slope) = ([0.0], [0.0]);
            table.evaluate(u, &mut value, &mut slope);
            value[0]
        };
        assert!((at(1.0) - at(1.0 - 1e-12)).abs() < 1e-10);
        assert!((at(1.7) / at(1.0) - canonical.phase(1.7) / canonical.phase(1.0)).abs() < 1e-14);
    }
}
