//! Models: a learnt primitive with the parameters of its demonstrations, the summary of the fit and the context map.

pub(crate) mod conditions;
pub(crate) mod coordinate_conditions;
pub(crate) mod coordinates;
pub(crate) mod file;
pub(crate) mod finding;
mod inside;
mod moments;
pub(crate) mod prediction;
pub(crate) mod primitive;
pub(crate) mod responses;
pub(crate) mod sensitivity;
mod tangent;
pub(crate) mod template;

use std::ops::Deref;
use std::ops::RangeInclusive;
use std::sync::Arc;

use ndarray::{Array2, Axis};

use crate::context::{ContextMap, outputs};
use crate::demonstration::ContextValue;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::numerics::smoothing_spline::Noise;
pub use conditions::Conditions;
pub use coordinates::{Coordinates, Frame};
pub use finding::Finding;
pub(crate) use moments::Moments;
pub use prediction::Prediction;
use primitive::Nominal;
pub use primitive::Primitive;
pub use responses::Derivative;
pub use tangent::{from_tangent, mean_positions, to_tangent};
pub use template::{TimeWarp, WarpTemplate};

/// Parameters of each demonstration, in absolute coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct DemonstrationParameters {
    /// Styles S (M, J).
    pub styles: Array2<f64>,
    /// Goals (M, D).
    pub goals: Array2<f64>,
    /// Starts (M, D).
    pub starts: Array2<f64>,
    /// Means of the positions (M, D), the anchors of rhythmic movements.
    pub anchors: Array2<f64>,
    /// Durations of the K segments between breaks (M, K), in seconds.
    pub segment_durations: Array2<f64>,
    /// Durations or periods (M,), in seconds: the sums of the segment durations.
    pub durations: Vec<f64>,
    /// Contexts (M, Q); a label is its index in [`ContextMap::columns`].
    pub contexts: Option<Array2<f64>>,
    /// Index of the nominal demonstration.
    pub nominal: usize,
}

/// Summary of a fit, with the settings that apply to new demonstrations.
#[derive(Clone, Debug, PartialEq)]
pub struct FitSummary {
    /// Samples C of the aligned demonstrations.
    pub n_samples: usize,
    /// Measurement noise of the demonstrations, and the cut-off frequencies of their smoothing.
    pub noise: Noise,
    /// Template of the time warp; `None` without one.
    pub template: Option<WarpTemplate>,
    /// Unit of each DoF in the factorisation (D,).
    pub dof_scale: Vec<f64>,
    /// Singular values of the targets in decreasing order: all of them, or the first J if the factorisation computed no
    /// others.
    pub singular_values: Vec<f64>,
    /// Truncation error of J styles relative to the targets, by root mean square.
    pub truncation_error: f64,
    /// Residual variance of the demonstrations over the phase (S, D), in the squared unit of each DoF; `None` without
    /// contexts.
    pub residual_variance: Option<Array2<f64>>,
    /// Description of the regression in one line.
    pub regression: String,
    /// Implausible properties of the demonstrations or the fit; empty in a model read from a file.
    pub findings: Vec<Finding>,
}

/// Maximum factor by which a predicted duration exceeds the range of the demonstrations. The map predicts its logarithm,
/// whose extrapolation is unbounded.
const MAX_DURATION_RATIO: f64 = 3.0;

/// Parametric dynamic movement primitive with the parameters of its demonstrations and the map from contexts to conditions.
///
/// A model dereferences to its [`Primitive`], which has the constants of the movement.
///
/// ```
/// # use pdmp_core::{Demonstration, FitOptions, Kind, Model, fit, rollout};
/// # use pdmp_core::motion::TimeGrid;
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// // Reaches over obstacles of height 0.1, 0.2 and 0.3 m, which are their contexts.
/// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let prediction = model.predict(&[0.25])?;
/// let grid = TimeGrid { dt: 0.01, duration: None };
/// let trajectory = rollout(model.primitive(), &prediction.conditions, grid)?;
/// assert_eq!(trajectory.position.ncols(), model.n_dofs());
///
/// let same = Model::from_bytes(&model.to_bytes()?)?;
/// assert_eq!(same.predict(&[0.25])?, prediction);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) primitive: Arc<Primitive>,
    pub(crate) demonstrated: DemonstrationParameters,
    pub(crate) learnt: FitSummary,
    pub(crate) map: Option<ContextMap>,
    pub(crate) moments: Moments,
}

impl Deref for Model {
    type Target = Primitive;

    fn deref(&self) -> &Primitive {
        &self.primitive
    }
}

impl Model {
    /// Returns the primitive, which rollouts and controllers share.
    pub fn primitive(&self) -> &Arc<Primitive> {
        &self.primitive
    }

    /// Returns the number of demonstrations M.
    pub fn n_demos(&self) -> usize {
        self.demonstrated.durations.len()
    }

    /// Returns the parameters of the demonstrations.
    pub fn demonstrated(&self) -> &DemonstrationParameters {
        &self.demonstrated
    }

    /// Returns the summary of the fit.
    pub fn learnt(&self) -> &FitSummary {
        &self.learnt
    }

    /// Returns the conditions of one demonstration, or the mean of several: style, goal and start or anchor, and segment
    /// durations.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let second = model.conditions(&[1])?;
    /// assert_eq!(second.style, Some(model.demonstrated().styles.row(1).to_vec()));
    /// let mean = model.conditions(&[0, 1, 2])?;
    /// assert!(mean.goal.is_some() && mean.anchor.is_none());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// No demonstration, or an index that is not below their number.
    pub fn conditions(&self, demonstrations: &[usize]) -> Result<Conditions> {
        self.conditions_inside(demonstrations).map(|conditions| self.outside(conditions))
    }

    /// Returns the conditions of the degrees of freedom of demonstrations.
    fn conditions_inside(&self, demonstrations: &[usize]) -> Result<Conditions> {
        let allowed = "must be below the number of demonstrations";
        if let Some(&m) = demonstrations.iter().find(|m| **m >= self.n_demos()) {
            return Err(Error::Range { name: "demonstration", value: m as f64, allowed });
        }
        if demonstrations.is_empty() {
            return Err(Error::Argument { name: "demonstrations", problem: "is empty: pass at least one index" });
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

    /// Converts conditions of the degrees of freedom to those of the coordinates.
    fn outside(&self, conditions: Conditions) -> Conditions {
        match self.primitive.coordinates() {
            Some(coordinates) => coordinates.of_dofs(conditions),
            None => conditions,
        }
    }

    /// Returns the goals (M, nq) of the demonstrations, in coordinates.
    pub fn goals(&self) -> Array2<f64> {
        self.positions(&self.demonstrated.goals, self.canonical().extent())
    }

    /// Returns the starts (M, nq) of the demonstrations, in coordinates.
    pub fn starts(&self) -> Array2<f64> {
        self.positions(&self.demonstrated.starts, 0.0)
    }

    /// Returns the anchors (M, nq) of the demonstrations, in coordinates: a rotation is relative to the mean at phase 0.
    pub fn anchors(&self) -> Array2<f64> {
        self.positions(&self.demonstrated.anchors, 0.0)
    }

    fn positions(&self, dofs: &Array2<f64>, u: f64) -> Array2<f64> {
        self.primitive.coordinates().map_or_else(|| dofs.clone(), |coordinates| coordinates.positions(u, dofs))
    }

    /// Returns the model with angular velocities and accelerations in another frame; it moves alike.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # use pdmp_core::model::Frame;
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// // Without rotations there is nothing to express.
    /// assert!(model.in_frame(Frame::World).is_err());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A model without rotations.
    pub fn in_frame(&self, frame: Frame) -> Result<Self> {
        let coordinates = self
            .primitive
            .coordinates()
            .ok_or(Error::Argument { name: "frame", problem: "does not apply: the model has no rotations" })?;
        let primitive = Primitive::clone(&self.primitive).with_coordinates(coordinates.in_frame(frame));
        Ok(Self { primitive: Arc::new(primitive), ..self.clone() })
    }

    /// Returns the map from contexts to style, goal and start or anchor, and logarithm of the duration; `None` if the
    /// demonstrations have no contexts.
    pub fn map(&self) -> Option<&ContextMap> {
        self.map.as_ref()
    }

    /// Predicts the movement for a context (Q,), as in Section 4.1.2. Its duration lies between a third of the shortest and
    /// three times the longest demonstrated duration.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let prediction = model.predict(&[0.25])?;
    /// assert_eq!(prediction.conditions.style.as_ref().map(Vec::len), Some(model.n_styles()));
    /// assert_eq!(prediction.extrapolation, [0.0]);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A model without a context map, a context of another length, an unknown label, or a number that is not finite.
    pub fn predict<V: Clone + Into<ContextValue>>(&self, context: &[V]) -> Result<Prediction> {
        let map = self.map_of_context()?;
        let (outputs, degrees_of_freedom) = (map.predict(context)?, map.degrees_of_freedom());
        let (n_styles, n_dofs, durations) = (self.n_styles(), self.n_dofs(), self.predicted_durations());
        let prediction = Prediction::of(outputs, degrees_of_freedom, self.kind(), n_styles, n_dofs, durations)?;
        Ok(Prediction { conditions: self.outside(prediction.conditions), ..prediction })
    }

    /// Returns the context map.
    ///
    /// # Errors
    /// The model has none.
    pub(crate) fn map_of_context(&self) -> Result<&ContextMap> {
        let problem =
            "does not apply: the model has no context map; fit it with contexts, or with demonstrations that have one";
        self.map.as_ref().ok_or(Error::Argument { name: "context", problem })
    }

    /// Returns the range of predicted durations, in seconds.
    pub(crate) fn predicted_durations(&self) -> RangeInclusive<f64> {
        let demonstrated = self.demonstrated.durations.iter();
        let [shortest, longest] =
            [f64::min, f64::max].map(|extreme| demonstrated.clone().copied().reduce(extreme).unwrap_or(1.0));
        shortest / MAX_DURATION_RATIO..=longest * MAX_DURATION_RATIO
    }
}

impl DemonstrationParameters {
    /// Returns the training outputs of the context map (M, P): style, goal and start or anchor, and duration and its
    /// division into segments.
    pub(crate) fn outputs(&self, kind: Kind) -> Array2<f64> {
        let positions = [self.goals.view(), self.starts.view(), self.anchors.view()];
        outputs(kind, self.styles.view(), positions, self.segment_durations.view())
    }

    /// Returns the conditions of the nominal demonstration.
    pub(crate) fn nominal_conditions(&self, kind: Kind) -> Nominal {
        let row = |matrix: &Array2<f64>| matrix.row(self.nominal).to_vec();
        let centre = match kind {
            Kind::Discrete => &self.goals,
            Kind::Rhythmic => &self.anchors,
        };
        Nominal {
            style: row(&self.styles),
            centre: row(centre),
            start: row(&self.starts),
            segment_durations: row(&self.segment_durations),
        }
    }
}
