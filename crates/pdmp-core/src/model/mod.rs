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

use ndarray::Array2;

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
pub use template::{Template, Warp};

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
    /// Singular values of the targets, in decreasing order: all, or the first J alone, where the factorization did not
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

/// A parametric dynamic movement primitive with its demonstrations' conditions and the map from contexts to conditions.
///
/// It dereferences to its [`Primitive`], which carries the constants of the movement.
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) primitive: Arc<Primitive>,
    pub(crate) demonstrated: Demonstrated,
    pub(crate) learnt: Learnt,
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
    pub fn demonstrated(&self) -> &Demonstrated {
        &self.demonstrated
    }

    /// How the model was learnt.
    pub fn learnt(&self) -> &Learnt {
        &self.learnt
    }

    /// Conditions of demonstration `m`: style, goal and start or anchor, and timing.
    ///
    /// # Errors
    /// `m` that is not below the number of demonstrations.
    pub fn conditions(&self, m: usize) -> Result<Conditions> {
        if m >= self.n_demos() {
            let allowed = "must be below the number of demonstrations";
            return Err(Error::Range { name: "demonstration", value: m as f64, allowed });
        }
        let of = |matrix: &Array2<f64>| Some(matrix.row(m).to_vec());
        let Demonstrated { styles, goals, starts, anchors, timings, .. } = &self.demonstrated;
        let (goal, start, anchor) = match self.kind() {
            Kind::Discrete => (of(goals), of(starts), None),
            Kind::Rhythmic => (None, None, of(anchors)),
        };
        Ok(Conditions { style: of(styles), goal, start, anchor, timing: of(timings), ..Conditions::default() })
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
}

impl Demonstrated {
    /// Outputs of the context map (M, P): style, goal and start or anchor, and timing.
    pub(crate) fn outputs(&self, kind: Kind) -> Array2<f64> {
        let places = [self.goals.view(), self.starts.view(), self.anchors.view()];
        outputs(kind, self.styles.view(), places, self.timings.view())
    }

    /// Conditions of the nominal demonstration.
    pub(crate) fn nominal(&self, kind: Kind) -> Nominal {
        let of = |matrix: &Array2<f64>| matrix.row(self.nominal).to_vec();
        let centre = match kind {
            Kind::Discrete => &self.goals,
            Kind::Rhythmic => &self.anchors,
        };
        Nominal { style: of(&self.styles), centre: of(centre), start: of(&self.starts), timing: of(&self.timings) }
    }
}
