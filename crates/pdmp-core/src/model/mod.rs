//! A learnt primitive with what is known of its demonstrations.

pub(crate) mod conditions;
pub(crate) mod file;
pub(crate) mod finding;
pub(crate) mod prediction;
pub(crate) mod primitive;
pub(crate) mod responses;
pub(crate) mod sensitivity;
pub(crate) mod template;

use std::ops::Deref;
use std::sync::Arc;

use ndarray::{Array2, Axis};

use crate::context::{ContextMap, outputs};
use crate::demonstration::ContextValue;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::numerics::smoothing_spline::Noise;
pub use conditions::Conditions;
pub use finding::Finding;
pub use prediction::Prediction;
use primitive::Nominal;
pub use primitive::Primitive;
pub use responses::Derivative;
pub use template::{TimeWarp, WarpTemplate};

/// What was learnt from each demonstration, in absolute coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct DemonstrationParameters {
    /// Styles S (M, J).
    pub styles: Array2<f64>,
    /// Goals (M, D).
    pub goals: Array2<f64>,
    /// Starts (M, D).
    pub starts: Array2<f64>,
    /// Means (M, D), about which a cycle oscillates.
    pub anchors: Array2<f64>,
    /// Timings (M, K): the time spent in each segment, in seconds.
    pub segment_durations: Array2<f64>,
    /// Durations or periods (M,), in seconds: the sums of the segment_durations.
    pub durations: Vec<f64>,
    /// Contexts (M, Q), labels as their index among [`ContextMap::columns`].
    pub contexts: Option<Array2<f64>>,
    /// Index of the nominal demonstration.
    pub nominal: usize,
}

/// How the model was learnt, as far as a new demonstration must be treated alike.
#[derive(Clone, Debug, PartialEq)]
pub struct FitSummary {
    /// Samples C of the aligned demonstrations.
    pub n_samples: usize,
    /// Measurement noise of the demonstrations, and the cut-offs that take it off.
    pub noise: Noise,
    /// What time was warped to, if it was.
    pub template: Option<WarpTemplate>,
    /// Unit of each DoF in the factorisation (D,).
    pub dof_scale: Vec<f64>,
    /// Singular values of the targets, in decreasing order: all, or the first J alone, where the factorization did not
    /// compute the others.
    pub singular_values: Vec<f64>,
    /// Share of the targets, by root mean square, that J styles leave out.
    pub truncation_error: f64,
    /// Variance over the phase (S, D) of what J styles leave out of the demonstrations, where contexts are known.
    pub residual_variance: Option<Array2<f64>>,
    /// The basis functions, in one line.
    pub regression: String,
    /// What was implausible about the demonstrations or the fit; empty in a model that was read from a file.
    pub findings: Vec<Finding>,
}

/// Most by which a predicted duration may leave the range of the demonstrations': far outside of their contexts its
/// logarithm may be anything.
const MAX_DURATION_RATIO: f64 = 3.0;

/// A parametric dynamic movement primitive with its demonstrations' conditions and the map from contexts to conditions.
///
/// It dereferences to its [`Primitive`], which carries the constants of the movement.
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) primitive: Arc<Primitive>,
    pub(crate) demonstrated: DemonstrationParameters,
    pub(crate) learnt: FitSummary,
    pub(crate) map: Option<ContextMap>,
}

impl Deref for Model {
    type Target = Primitive;

    fn deref(&self) -> &Primitive {
        &self.primitive
    }
}

impl Model {
    /// The primitive, which rollouts and controllers share.
    pub fn primitive(&self) -> &Arc<Primitive> {
        &self.primitive
    }

    /// Number of demonstrations M.
    pub fn n_demos(&self) -> usize {
        self.demonstrated.durations.len()
    }

    /// What was learnt from each demonstration.
    pub fn demonstrated(&self) -> &DemonstrationParameters {
        &self.demonstrated
    }

    /// How the model was learnt.
    pub fn learnt(&self) -> &FitSummary {
        &self.learnt
    }

    /// Returns the conditions of one demonstration, or the mean of several: style, goal and start or anchor, and segment
    /// durations.
    ///
    /// # Errors
    /// No demonstration, or an index that is not below their number.
    pub fn conditions(&self, demonstrations: &[usize]) -> Result<Conditions> {
        let allowed = "must be below the number of demonstrations";
        if let Some(&m) = demonstrations.iter().find(|m| **m >= self.n_demos()) {
            return Err(Error::Range { name: "demonstration", value: m as f64, allowed });
        }
        if demonstrations.is_empty() {
            return Err(Error::Arguments("demonstrations is empty: pass at least one index"));
        }
        let mean = |matrix: &Array2<f64>| {
            let rows = matrix.select(Axis(0), demonstrations);
            rows.mean_axis(Axis(0)).map(|mean| mean.to_vec())
        };
        let DemonstrationParameters { styles, goals, starts, anchors, segment_durations, .. } = &self.demonstrated;
        let (goal, start, anchor) = match self.kind() {
            Kind::Discrete => (mean(goals), mean(starts), None),
            Kind::Rhythmic => (None, None, mean(anchors)),
        };
        let (style, segment_durations) = (mean(styles), mean(segment_durations));
        Ok(Conditions { style, goal, start, anchor, segment_durations, ..Conditions::default() })
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
        Prediction::of(
            map.predict(context)?,
            map.degrees_of_freedom(),
            self.kind(),
            self.n_styles(),
            self.n_dofs(),
            durations,
        )
    }
}

impl DemonstrationParameters {
    /// Outputs of the context map (M, P): style, goal and start or anchor, and timing.
    pub(crate) fn outputs(&self, kind: Kind) -> Array2<f64> {
        let places = [self.goals.view(), self.starts.view(), self.anchors.view()];
        outputs(kind, self.styles.view(), places, self.segment_durations.view())
    }

    /// Conditions of the nominal demonstration.
    pub(crate) fn nominal(&self, kind: Kind) -> Nominal {
        let of = |matrix: &Array2<f64>| matrix.row(self.nominal).to_vec();
        let centre = match kind {
            Kind::Discrete => &self.goals,
            Kind::Rhythmic => &self.anchors,
        };
        Nominal {
            style: of(&self.styles),
            centre: of(centre),
            start: of(&self.starts),
            segment_durations: of(&self.segment_durations),
        }
    }
}
