//! The learnt primitive: immutable, and all that a rollout or a control loop needs.

pub(crate) mod conditions;
pub(crate) mod file;
pub(crate) mod finding;
pub(crate) mod responses;
pub(crate) mod sensitivity;
pub(crate) mod template;

use std::f64::consts::TAU;

use ndarray::Array2;

use crate::context::{ContextMap, Prediction};
use crate::demonstration::ContextValue;
use crate::dynamics::canonical::Canonical;
use crate::dynamics::forcing_table::Landscape;
use crate::dynamics::output_system::{Attractor, State};
use crate::dynamics::time_warp::WarpingFunction;
use crate::dynamics::transport::Transport;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::finding::Finding;
use crate::model::responses::Cache;
use crate::model::template::Template;
use crate::numerics::simd::{Lanes, groups};
use crate::numerics::smoothing_spline::Noise;
use crate::validate::check_vector;

/// Largest rate α_z, β_z, α_x or μ, and the inverse of the smallest: products of several stay finite.
pub(crate) const MAX_RATE: f64 = 1e6;
/// Largest time constant, in seconds, and the inverse of the smallest: rates and their squares stay finite.
pub(crate) const MAX_TAU: f64 = 1e12;

/// What was learnt from each demonstration, in absolute coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Demonstrated {
    /// Styles S (M, J).
    pub styles: Array2<f64>,
    /// Goals (M, D).
    pub goals: Array2<f64>,
    /// Starts (M, D).
    pub starts: Array2<f64>,
    /// Means (M, D), about which a cycle oscillates.
    pub anchors: Array2<f64>,
    /// Phases (K+1,) from 0 to 1 that divide the movement into segments; K = 1 where time is scaled linearly.
    pub breaks: Vec<f64>,
    /// Timings (M, K): the time spent in each segment, in seconds.
    pub timings: Array2<f64>,
    /// Durations or periods (M,), in seconds: the sums of the timings.
    pub durations: Vec<f64>,
    /// Contexts (M, Q), labels as their index among [`ContextMap::columns`].
    pub contexts: Option<Array2<f64>>,
    /// Index of the nominal demonstration.
    pub nominal: usize,
}

/// How the model was learnt, as far as a new demonstration must be treated alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Learnt {
    /// Samples C of the aligned demonstrations.
    pub n_samples: usize,
    /// Measurement noise of the demonstrations, and the cut-offs that take it off.
    pub noise: Noise,
    /// What time was warped to, if it was.
    pub template: Option<Template>,
    /// Unit of each DoF in the factorisation (D,).
    pub dof_scale: Vec<f64>,
    /// Singular values of the targets, in decreasing order: all, or the first J alone, where [`crate::Factors`] did not
    /// compute the others.
    pub singular_values: Vec<f64>,
    /// Share of the targets, by root mean square, that J styles leave out.
    pub left_out: f64,
    /// Variance over the phase (S, D) of what J styles leave out of the demonstrations, where contexts are known.
    pub left_over: Option<Array2<f64>>,
    /// The basis functions, in one line.
    pub basis: String,
    /// What was implausible about the demonstrations or the fit; empty in a model that was read from a file.
    pub findings: Vec<Finding>,
}

/// Most by which a predicted duration may leave the range of the demonstrations': far outside of their contexts its
/// logarithm may be anything.
const MAX_DURATION_RATIO: f64 = 3.0;

/// A parametric dynamic movement primitive.
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) attractor: Attractor,
    pub(crate) landscape: Landscape,
    pub(crate) transport: Transport,
    /// κ, per unit of the clock, at which a movement brakes past its end; none where transport is immediate, and rhythmic.
    pub(crate) braking: Option<f64>,
    pub(crate) tau: f64,
    pub(crate) names: Vec<String>,
    pub(crate) units: Vec<String>,
    pub(crate) ranges: Vec<f64>,
    pub(crate) demonstrated: Demonstrated,
    pub(crate) learnt: Learnt,
    pub(crate) map: Option<ContextMap>,
    /// Periodic steady state at φ = 0 per unit of style and amplitude, by groups of DoFs and styles; zero where discrete,
    /// which starts at rest in z.
    pub(crate) cycle: Vec<State<Lanes>>,
    /// What whole movements are made of, kept for the next ones; the control loop never looks at it.
    pub(crate) responses: Cache,
}

impl Model {
    /// Adds what follows from the rest.
    pub(crate) fn with_cycle(mut self) -> Self {
        let shape = (self.n_dofs(), self.n_styles());
        self.cycle = match self.kind() {
            Kind::Discrete => {
                if let Some(braking) = self.braking {
                    let end = from_rest(self.attractor, &self.landscape, shape);
                    let z: Vec<Lanes> = end.iter().map(|state| state.z).collect();
                    self.landscape = self.landscape.braked(self.attractor.alpha_z, braking, &z);
                }
                vec![State::default(); groups(shape.0) * shape.1]
            }
            Kind::Rhythmic => steady_cycle(self.attractor, &self.landscape, shape),
        };
        self
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

    /// Number of demonstrations M.
    pub fn n_demos(&self) -> usize {
        self.demonstrated.durations.len()
    }

    /// Number of degrees of freedom D.
    pub fn n_dofs(&self) -> usize {
        self.names.len()
    }

    /// Dimension J of the style parameter.
    pub fn n_styles(&self) -> usize {
        self.demonstrated.styles.ncols()
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

    /// What was learnt from each demonstration.
    pub fn demonstrated(&self) -> &Demonstrated {
        &self.demonstrated
    }

    /// How the model was learnt.
    pub fn learnt(&self) -> &Learnt {
        &self.learnt
    }

    /// Duration or period of the nominal demonstration, in seconds.
    pub fn duration(&self) -> f64 {
        self.demonstrated.durations[self.demonstrated.nominal]
    }

    /// The map from contexts to style, goal and start or anchor, and logarithm of the duration, where contexts are
    /// known.
    pub fn map(&self) -> Option<&ContextMap> {
        self.map.as_ref()
    }

    /// The movement for a context (Q,), as in Section 4.1.2. Its duration is at least a third of the shortest
    /// demonstration's and at most three times the longest one's.
    ///
    /// # Errors
    /// A model without contexts, a context of another length, a label never shown, or a number that is not finite.
    pub fn predict<V: Clone + Into<ContextValue>>(&self, context: &[V]) -> Result<Prediction> {
        let map = self.map.as_ref().ok_or(Error::Arguments(
            "the model knows no contexts: fit it with contexts=, or with demonstrations that carry one",
        ))?;
        let demonstrated = self.demonstrated.durations.iter();
        let [shortest, longest] =
            [f64::min, f64::max].map(|of| demonstrated.clone().copied().reduce(of).unwrap_or(1.0));
        let durations = shortest / MAX_DURATION_RATIO..=longest * MAX_DURATION_RATIO;
        Prediction::of(map.predict(context)?, map.freedom(), self.kind(), self.n_styles(), self.n_dofs(), durations)
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
        Ok(WarpingFunction::new(self.kind(), &self.demonstrated.breaks, timing))
    }

    pub(crate) fn check_timing(&self, timing: &[f64]) -> Result<()> {
        let nominal = self.demonstrated.timings.row(self.demonstrated.nominal);
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
