//! Primitives: the constants of a movement that rollouts and control loops need.

use std::f64::consts::TAU;
use std::sync::Arc;

use ndarray::Array2;

use crate::dynamics::canonical::Canonical;
use crate::dynamics::forcing_table::{ForcingTable, TableIndex};
use crate::dynamics::output_system::{Attractor, Propagator, State};
use crate::dynamics::time_warp::WarpingFunction;
use crate::dynamics::transport::Transport;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::coordinates::Coordinates;
use crate::model::responses::Cache;
use crate::numerics::simd::{F64x4, WIDTH, groups};
use crate::validate::{check_range, check_vector};

/// Maximum of the rates α_z, β_z, α_x and μ, and inverse of their minimum: products of several stay finite.
pub(crate) const MAX_RATE: f64 = 1e6;
/// Maximum time constant in seconds, and inverse of the minimum: rates and their squares stay finite.
pub(crate) const MAX_TAU: f64 = 1e12;

/// Conditions of the nominal demonstration, the defaults of a movement.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Nominal {
    /// Style s (J,).
    pub(crate) style: Vec<f64>,
    /// Goal g of a discrete movement, anchor y_a of a rhythmic one (D,).
    pub(crate) centre: Vec<f64>,
    /// Start y₀ of a discrete movement (D,).
    pub(crate) start: Vec<f64>,
    /// Durations of the segments between breaks (K,), in seconds.
    pub(crate) segment_durations: Vec<f64>,
}

/// Parametric dynamic movement primitive.
///
/// It is immutable except for a cache of unit responses behind a lock, which the control loop does not use.
///
/// ```
/// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let primitive = model.primitive();
/// assert_eq!((primitive.kind(), primitive.n_dofs()), (Kind::Discrete, 2));
/// assert!(primitive.transport(primitive.canonical().extent())? == 1.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Primitive {
    pub(crate) attractor: Attractor,
    pub(crate) forcing_table: ForcingTable,
    pub(crate) transport: Transport,
    pub(crate) braking: Option<f64>,
    pub(crate) tau: f64,
    pub(crate) names: Vec<String>,
    pub(crate) units: Vec<String>,
    pub(crate) ranges: Vec<f64>,
    pub(crate) breaks: Vec<f64>,
    pub(crate) nominal: Nominal,
    /// State of the limit cycle at φ = 0 per unit of style and amplitude, by groups of DoFs and styles; zero for a discrete
    /// movement, which starts with z = 0.
    pub(crate) cycle: Vec<State<F64x4>>,
    /// States at the knots of the forcing table for unit styles from rest, by knots, groups of DoFs and styles; only for
    /// learnt transport.
    unit_states: Vec<State<F64x4>>,
    pub(crate) responses: Cache,
    /// Coordinates of a primitive with rotations.
    pub(crate) coordinates: Option<Arc<Coordinates>>,
}

/// Independent parts of a primitive, from which [`Primitive::new`] computes the others.
pub(crate) struct Parts {
    pub(crate) attractor: Attractor,
    /// Forcing term without the braking past the end.
    pub(crate) forcing_table: ForcingTable,
    pub(crate) transport: Transport,
    /// Braking rate κ past the end, per unit of the clock; `None` for immediate transport and rhythmic movements.
    pub(crate) braking: Option<f64>,
    /// Time constant τ of the nominal demonstration, in seconds.
    pub(crate) tau: f64,
    pub(crate) names: Vec<String>,
    pub(crate) units: Vec<String>,
    /// Largest range of each DoF within one demonstration (D,).
    pub(crate) ranges: Vec<f64>,
    /// Breaks between segments (K+1,), phases from 0 to 1; K = 1 for linear time.
    pub(crate) breaks: Vec<f64>,
    pub(crate) nominal: Nominal,
}

impl Primitive {
    /// Builds a primitive from its parts: adds the braking past the end of a discrete movement and computes the limit cycle
    /// of a rhythmic one.
    pub(crate) fn new(parts: Parts) -> Self {
        let Parts { attractor, mut forcing_table, transport, braking, tau, names, units, ranges, breaks, nominal } =
            parts;
        let n_outputs = groups(names.len()) * nominal.style.len();
        let mut unit_states = Vec::new();
        let cycle = match forcing_table.canonical().kind() {
            Kind::Discrete => {
                if let Some(braking) = braking {
                    unit_states = from_rest(attractor, &forcing_table);
                    let end = &unit_states[unit_states.len() - n_outputs..];
                    let z: Vec<F64x4> = end.iter().map(|state| state.z).collect();
                    forcing_table = forcing_table.with_braking(attractor, braking, &z);
                }
                vec![State::default(); n_outputs]
            }
            Kind::Rhythmic => steady_cycle(attractor, &forcing_table, n_outputs),
        };
        let responses = Cache::default();
        Self {
            attractor,
            forcing_table,
            transport,
            braking,
            tau,
            names,
            units,
            ranges,
            breaks,
            nominal,
            cycle,
            unit_states,
            responses,
            coordinates: None,
        }
    }

    /// Returns the kind of the movement.
    pub fn kind(&self) -> Kind {
        self.canonical().kind()
    }

    /// Returns the canonical system.
    pub fn canonical(&self) -> Canonical {
        self.forcing_table.canonical()
    }

    /// Returns the gains of the output system.
    pub fn attractor(&self) -> Attractor {
        self.attractor
    }

    /// Returns the table of the forcing term, the gated attractor landscape of each style dimension and DoF.
    pub fn forcing_table(&self) -> &ForcingTable {
        &self.forcing_table
    }

    /// Returns the number of degrees of freedom D.
    pub fn n_dofs(&self) -> usize {
        self.names.len()
    }

    /// Returns the dimension J of the style parameter.
    pub fn n_styles(&self) -> usize {
        self.nominal.style.len()
    }

    /// Returns the time constant τ of the nominal demonstration, in seconds.
    pub fn tau(&self) -> f64 {
        self.tau
    }

    /// Returns the names of the DoFs (D,).
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the units of the DoFs (D,); an unknown unit is "".
    pub fn units(&self) -> &[String] {
        &self.units
    }

    /// Returns the largest range of each DoF within one demonstration (D,), in its unit. That of a rotation is its largest
    /// angle from the start, that of the coordinates of its point the largest distance.
    pub fn ranges(&self) -> &[f64] {
        &self.ranges
    }

    /// Returns the duration or period of the nominal demonstration, in seconds.
    pub fn duration(&self) -> f64 {
        self.nominal.segment_durations.iter().sum()
    }

    /// Returns the breaks between segments (K+1,), phases that increase from 0 to 1; K = 1 for linear time.
    pub fn breaks(&self) -> &[f64] {
        &self.breaks
    }

    /// Returns the time constant τ = dt/du in seconds at a phase, x or φ, of a movement with the given segment durations
    /// (K,) in seconds.
    ///
    /// A control loop that sets it at every tick reproduces the segment durations. Past the end of a discrete movement it is
    /// constant.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// // One segment of twice the nominal duration.
    /// let tau = model.tau_at(0.5, &[2.0 * model.duration()])?;
    /// assert!((tau - 2.0 * model.tau()).abs() < 1e-12);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A number of durations other than K, a duration outside of a factor of 1e6 of the nominal one, or a phase outside
    /// [0, 1] (discrete) or [0, 2π) (rhythmic).
    pub fn tau_at(&self, phase: f64, segment_durations: &[f64]) -> Result<f64> {
        let extent = self.canonical().extent();
        let clock = self.canonical().clock_at(phase);
        // Long after the end x underflows to zero, and the clock is infinite.
        let past_cycle = self.kind() == Kind::Rhythmic && phase >= TAU;
        let allowed = "must lie in [0, 1] for a discrete and in [0, 2π) for a rhythmic primitive";
        check_range("phase", phase, phase.is_finite() && clock >= 0.0 && !past_cycle, allowed)?;
        Ok(self.warping_function(segment_durations)?.slope(clock / extent) / extent)
    }

    /// Returns the warping function for segment durations (K,) in seconds.
    ///
    /// # Errors
    /// As for [`Self::check_segment_durations`].
    pub(crate) fn warping_function(&self, segment_durations: &[f64]) -> Result<WarpingFunction> {
        self.check_segment_durations(segment_durations)?;
        Ok(WarpingFunction::new(self.kind(), &self.breaks, segment_durations))
    }

    /// Checks segment durations (K,) in seconds.
    ///
    /// # Errors
    /// A number of durations other than K, or one outside of a factor of 1e6 of the nominal demonstration's.
    pub(crate) fn check_segment_durations(&self, segment_durations: &[f64]) -> Result<()> {
        let nominal = &self.nominal.segment_durations;
        check_vector("segment_durations", segment_durations, nominal.len(), "segment between breaks")?;
        let allowed = "seconds must be positive, within a factor of 1e6 of the nominal demonstration's";
        segment_durations.iter().zip(nominal).try_for_each(|(&value, nominal)| {
            check_range("segment_durations", value, (1e-6..=1e6).contains(&(value / nominal)), allowed)
        })
    }

    /// Returns the transport profile m(u) of a discrete movement at clock `u`, the position of its frame as a fraction of the
    /// displacement from start to goal. Immediate transport is m ≡ 1.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let primitive = model.primitive();
    /// assert_eq!(primitive.transport(0.0)?, 0.0);
    /// assert!((primitive.transport(1.0)? - 1.0).abs() < 1e-9);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A rhythmic primitive, or a clock that is negative or not finite.
    pub fn transport(&self, u: f64) -> Result<f64> {
        if self.kind() == Kind::Rhythmic {
            let instead = ": it moves about an anchor and has no transport profile";
            return Err(Error::Kind { name: "transport", kind: self.kind(), instead });
        }
        check_range("u", u, u.is_finite() && u >= 0.0, "must be finite and not negative")?;
        Ok(1.0 + self.transport.lag(u).value)
    }

    /// Returns the state of a style at clock `u` of a movement with learnt transport that starts at rest, for one group of
    /// DoFs. `propagator` is that over the clock since the knot before `u`.
    pub(crate) fn state(
        &self,
        index: TableIndex,
        propagator: &Propagator,
        group: usize,
        style: &[f64],
    ) -> State<F64x4> {
        let (first, forcing) = self.forcing_table.cell(index, group, style);
        let states = style.iter().zip(&self.unit_states[first..]);
        let knot = states.fold(State::<F64x4>::default(), |sum, (s, state)| State {
            e: sum.e + state.e * *s,
            z: sum.z + state.z * *s,
        });
        propagator.advance(knot, forcing)
    }

    /// Returns state and forcing of each unit style at the end of a movement with learnt transport that starts at rest, for
    /// one group of DoFs.
    pub(crate) fn arrivals(&self, group: usize) -> impl Iterator<Item = (State<F64x4>, F64x4)> {
        let end = self.forcing_table.knot(self.forcing_table.cells());
        let states = &self.unit_states[self.unit_states.len().saturating_sub(end.len())..];
        let arrivals = states.iter().zip(end).map(|(state, w)| (*state, w.value));
        arrivals.skip(group * self.n_styles()).take(self.n_styles())
    }

    /// Returns the braking rate κ of a discrete movement past its end, per unit of the clock; `None` for immediate transport,
    /// where the forcing decays with the phase, and for rhythmic movements.
    pub fn braking(&self) -> Option<f64> {
        self.braking
    }

    /// Returns the attractor landscape b (J, D) by rows at clock `u`, without its gate.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let landscape = model.primitive().landscape(0.5)?;
    /// assert_eq!(landscape.len(), model.n_styles() * model.n_dofs());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A clock that is not finite, or negative for a discrete movement.
    pub fn landscape(&self, u: f64) -> Result<Vec<f64>> {
        let discrete = self.kind() == Kind::Discrete;
        let valid = u.is_finite() && (u >= 0.0 || !discrete);
        check_range("u", u, valid, "must be finite, and not negative if discrete")?;
        // Past the end gate and forcing decay together, so that b is constant.
        let u = if discrete { u.min(self.canonical().extent()) } else { u };
        let (mut value, mut slope) =
            (vec![0.0; self.forcing_table.n_outputs()], vec![0.0; self.forcing_table.n_outputs()]);
        self.forcing_table.evaluate(u, &mut value, &mut slope);
        if discrete {
            let gate = self.canonical().phase(u);
            value.iter_mut().for_each(|w| *w /= gate);
        }
        Ok(value)
    }
}

/// Returns the velocities y′ at the end for unit styles (J, D), starting from zero.
pub(crate) fn end_velocities(attractor: Attractor, forcing_table: &ForcingTable, n_dofs: usize) -> Array2<f64> {
    let n_styles = forcing_table.n_outputs() / n_dofs;
    let states = from_rest(attractor, forcing_table);
    let end = &states[states.len() - forcing_table.knot(0).len()..];
    let flows: Vec<[f64; WIDTH]> = end
        .iter()
        .zip(forcing_table.knot(forcing_table.cells()))
        .map(|(state, w)| (state.z + w.value).to_array())
        .collect();
    Array2::from_shape_fn((n_styles, n_dofs), |(j, d)| flows[d / WIDTH * n_styles + j][d % WIDTH])
}

/// Returns the states at the knots of the forcing table for unit styles, starting from zero, by knots, groups of DoFs and
/// styles.
fn from_rest(attractor: Attractor, forcing_table: &ForcingTable) -> Vec<State<F64x4>> {
    let cells = forcing_table.cells();
    let cell = attractor.propagator(forcing_table.canonical().extent() / cells as f64);
    let n_outputs = forcing_table.knot(0).len();
    let mut states = vec![State::default(); (cells + 1) * n_outputs];
    for k in 0..cells {
        let (before, after) = states.split_at_mut((k + 1) * n_outputs);
        let ends = forcing_table.knot(k).zip(forcing_table.knot(k + 1));
        for ((state, next), (from, to)) in before[k * n_outputs..].iter().zip(after).zip(ends) {
            *next = cell.advance(*state, [from, to]);
        }
    }
    states
}

/// Returns the states of the limit cycle at φ = 0 for unit styles: (I − exp(2πA))⁻¹ times the response of one cycle from
/// zero.
fn steady_cycle(attractor: Attractor, forcing_table: &ForcingTable, n_outputs: usize) -> Vec<State<F64x4>> {
    let [[a, b], [c, d]] = attractor.propagator(TAU).resting.transition;
    // All eigenvalues of exp(2πA) lie inside the unit circle, so that the determinant is positive.
    let scale = 1.0 / ((1.0 - a) * (1.0 - d) - b * c);
    let solve =
        |State { e, z }: State<F64x4>| State { e: (e * (1.0 - d) + z * b) * scale, z: (e * c + z * (1.0 - a)) * scale };
    let states = from_rest(attractor, forcing_table);
    states[states.len() - n_outputs..].iter().copied().map(solve).collect()
}
