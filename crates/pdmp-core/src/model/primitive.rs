//! The primitive: all that a rollout or a control loop needs.

use std::f64::consts::TAU;

use crate::dynamics::canonical::Canonical;
use crate::dynamics::forcing_table::Landscape;
use crate::dynamics::output_system::{Attractor, State};
use crate::dynamics::time_warp::WarpingFunction;
use crate::dynamics::transport::Transport;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::responses::Cache;
use crate::numerics::simd::{Lanes, groups};
use crate::validate::check_vector;

/// Largest rate α_z, β_z, α_x or μ, and the inverse of the smallest: products of several stay finite.
pub(crate) const MAX_RATE: f64 = 1e6;
/// Largest time constant, in seconds, and the inverse of the smallest: rates and their squares stay finite.
pub(crate) const MAX_TAU: f64 = 1e12;

/// Conditions of the nominal demonstration, from which a movement starts unless others are given.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Nominal {
    /// Style s (J,).
    pub(crate) style: Vec<f64>,
    /// Goal g where discrete, anchor y_a where rhythmic (D,).
    pub(crate) centre: Vec<f64>,
    /// Start y₀ (D,), discrete.
    pub(crate) start: Vec<f64>,
    /// Time in each segment between two breaks (K,), in seconds.
    pub(crate) timing: Vec<f64>,
}

/// A parametric dynamic movement primitive: immutable, but for a cache of responses behind a lock, which the control
/// loop never touches.
#[derive(Clone, Debug)]
pub struct Primitive {
    pub(crate) attractor: Attractor,
    pub(crate) landscape: Landscape,
    pub(crate) transport: Transport,
    pub(crate) braking: Option<f64>,
    pub(crate) tau: f64,
    pub(crate) names: Vec<String>,
    pub(crate) units: Vec<String>,
    pub(crate) ranges: Vec<f64>,
    pub(crate) breaks: Vec<f64>,
    pub(crate) nominal: Nominal,
    /// Periodic steady state at φ = 0 per unit of style and amplitude, by groups of DoFs and styles; zero where discrete,
    /// which starts at rest in z.
    pub(crate) cycle: Vec<State<Lanes>>,
    pub(crate) responses: Cache,
}

/// The parts of a primitive, from which [`Primitive::new`] computes the rest.
pub(crate) struct Parts {
    pub(crate) attractor: Attractor,
    /// The forcing term without its braking past the end.
    pub(crate) landscape: Landscape,
    pub(crate) transport: Transport,
    /// κ, per unit of the clock, at which a movement brakes past its end; none where transport is immediate, and rhythmic.
    pub(crate) braking: Option<f64>,
    /// Time constant τ of the nominal demonstration, in seconds.
    pub(crate) tau: f64,
    pub(crate) names: Vec<String>,
    pub(crate) units: Vec<String>,
    /// Largest range of each DoF within one demonstration (D,).
    pub(crate) ranges: Vec<f64>,
    /// Phases (K+1,) from 0 to 1 that divide the movement into segments; K = 1 where time is scaled linearly.
    pub(crate) breaks: Vec<f64>,
    pub(crate) nominal: Nominal,
}

impl Primitive {
    /// Returns the primitive of these parts, with its braking past the end or its limit cycle.
    pub(crate) fn new(parts: Parts) -> Self {
        let Parts { attractor, mut landscape, transport, braking, tau, names, units, ranges, breaks, nominal } = parts;
        let shape = (names.len(), nominal.style.len());
        let cycle = match landscape.canonical().kind() {
            Kind::Discrete => {
                if let Some(braking) = braking {
                    let end = from_rest(attractor, &landscape, shape);
                    let z: Vec<Lanes> = end.iter().map(|state| state.z).collect();
                    landscape = landscape.braked(attractor.alpha_z, braking, &z);
                }
                vec![State::default(); groups(shape.0) * shape.1]
            }
            Kind::Rhythmic => steady_cycle(attractor, &landscape, shape),
        };
        let responses = Cache::default();
        Self { attractor, landscape, transport, braking, tau, names, units, ranges, breaks, nominal, cycle, responses }
    }

    /// Discrete or rhythmic.
    pub fn kind(&self) -> Kind {
        self.canonical().kind()
    }

    /// The canonical system and its constants.
    pub fn canonical(&self) -> Canonical {
        self.landscape.canonical()
    }

    /// The constants of the output system.
    pub fn attractor(&self) -> Attractor {
        self.attractor
    }

    /// The attractor landscape, gated, per style dimension and DoF.
    pub fn landscape(&self) -> &Landscape {
        &self.landscape
    }

    /// Number of degrees of freedom D.
    pub fn n_dofs(&self) -> usize {
        self.names.len()
    }

    /// Dimension J of the style parameter.
    pub fn n_styles(&self) -> usize {
        self.nominal.style.len()
    }

    /// Time constant τ of the nominal demonstration, in seconds.
    pub fn tau(&self) -> f64 {
        self.tau
    }

    /// Names of the DoFs (D,).
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Units of the DoFs (D,); "" where one is not known.
    pub fn units(&self) -> &[String] {
        &self.units
    }

    /// Largest range of each DoF within one demonstration (D,).
    pub fn ranges(&self) -> &[f64] {
        &self.ranges
    }

    /// Duration or period of the nominal demonstration, in seconds.
    pub fn duration(&self) -> f64 {
        self.nominal.timing.iter().sum()
    }

    /// Phases (K+1,) from 0 to 1 that divide the movement into segments; K = 1 where time is scaled linearly.
    pub fn breaks(&self) -> &[f64] {
        &self.breaks
    }

    /// The time constant τ = dt/du in seconds at a phase, x or φ, of a movement with the given timing (K,).
    ///
    /// A loop that sets it at every tick follows the timing. Past its end a discrete movement goes on at the last rate.
    ///
    /// # Errors
    /// A timing that does not fit the model, or a phase outside [0, 1] or [0, 2π).
    pub fn tau_at(&self, phase: f64, timing: &[f64]) -> Result<f64> {
        let extent = self.canonical().extent();
        let clock = self.canonical().clock_at(phase);
        // Long after the end x is zero, and the clock infinite.
        let beyond = self.kind() == Kind::Rhythmic && phase >= TAU;
        if !(phase.is_finite() && clock >= 0.0) || beyond {
            let allowed = "must lie in [0, 1] where discrete, in [0, 2π) where rhythmic";
            return Err(Error::Range { name: "phase", value: phase, allowed });
        }
        Ok(self.warping_function(timing)?.slope(clock / extent) / extent)
    }

    /// Time over phase for a timing (K,).
    ///
    /// # Errors
    /// Another number of times than the movement has segments, or one that is not within a millionfold of the nominal
    /// demonstration's.
    pub(crate) fn warping_function(&self, timing: &[f64]) -> Result<WarpingFunction> {
        self.check_timing(timing)?;
        Ok(WarpingFunction::new(self.kind(), &self.breaks, timing))
    }

    pub(crate) fn check_timing(&self, timing: &[f64]) -> Result<()> {
        let nominal = &self.nominal.timing;
        check_vector("timing", timing, nominal.len(), "segment between breaks")?;
        match timing.iter().zip(nominal).find(|(time, own)| !(1e-6..=1e6).contains(&(*time / *own))) {
            Some((&value, _)) => {
                let allowed = "seconds must be positive, within a millionfold of the nominal demonstration's";
                Err(Error::Range { name: "timing", value, allowed })
            }
            None => Ok(()),
        }
    }

    /// Share m(u) of the way from start to goal that a discrete movement has covered at clock `u`: 1 throughout where
    /// transport is immediate.
    ///
    /// # Errors
    /// A rhythmic primitive, or a clock that is negative or not finite.
    pub fn transport(&self, u: f64) -> Result<f64> {
        if self.kind() == Kind::Rhythmic {
            let instead = ": it moves about an anchor, which no profile leads to";
            return Err(Error::Kind { name: "transport", kind: self.kind(), instead });
        }
        if !(u.is_finite() && u >= 0.0) {
            return Err(Error::Range { name: "u", value: u, allowed: "must be finite, and not negative" });
        }
        Ok(1.0 + self.transport.lag(u).value)
    }

    /// Rate κ, per unit of the clock, at which a discrete movement brakes past its end; none where its forcing fades with
    /// the phase, as it does where transport is immediate.
    pub fn braking(&self) -> Option<f64> {
        self.braking
    }

    /// Basis functions b (J, D) by rows at clock `u`: the landscape without its gate.
    ///
    /// # Errors
    /// A clock that is not finite, or negative for a discrete movement.
    pub fn basis(&self, u: f64) -> Result<Vec<f64>> {
        let discrete = self.kind() == Kind::Discrete;
        if !u.is_finite() || (discrete && u < 0.0) {
            return Err(Error::Range { name: "u", value: u, allowed: "must be finite, and not negative if discrete" });
        }
        // Past the end gate and forcing fade together: b stays what it was.
        let u = if discrete { u.min(self.canonical().extent()) } else { u };
        let (mut value, mut slope) = (vec![0.0; self.landscape.n_outputs()], vec![0.0; self.landscape.n_outputs()]);
        self.landscape.evaluate(u, &mut value, &mut slope);
        if discrete {
            let gate = self.canonical().phase(u);
            value.iter_mut().for_each(|w| *w /= gate);
        }
        Ok(value)
    }
}

/// The states to which the demonstrated stretch leads from rest, of unit styles, by groups of DoFs and styles.
fn from_rest(attractor: Attractor, landscape: &Landscape, (n_dofs, n_styles): (usize, usize)) -> Vec<State<Lanes>> {
    let cells = landscape.cells();
    let cell = attractor.propagator(landscape.canonical().extent() / cells as f64);
    let mut states = Vec::with_capacity(groups(n_dofs) * n_styles);
    for group in 0..groups(n_dofs) {
        states.extend((0..n_styles).map(|j| {
            let jet = |k: usize| landscape.knot(k, group, j);
            (0..cells).fold(State::default(), |state, k| cell.advance(state, [jet(k), jet(k + 1)]))
        }));
    }
    states
}

/// The states from which one turn leads back to itself, (I − exp(2πA))⁻¹ times the response of a turn from rest.
fn steady_cycle(attractor: Attractor, landscape: &Landscape, shape: (usize, usize)) -> Vec<State<Lanes>> {
    let [[a, b], [c, d]] = attractor.propagator(TAU).transition();
    // A stable system never returns to where it was unforced: the determinant is positive.
    let scale = 1.0 / ((1.0 - a) * (1.0 - d) - b * c);
    let closed =
        |State { e, z }: State<Lanes>| State { e: (e * (1.0 - d) + z * b) * scale, z: (e * c + z * (1.0 - a)) * scale };
    from_rest(attractor, landscape, shape).into_iter().map(closed).collect()
}
