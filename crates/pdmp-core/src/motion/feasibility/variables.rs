//! Style and goal, or anchor, as variables of a search, in standard deviations.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, Axis, s};

use super::bounds::{Bound, ranges};
use super::extremes::{Movement, Place};
use super::sampling::sampled;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::Model;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;

/// Standard deviation whose square is added to the variances of the demonstrations, relative to the range of their styles or
/// positions: conditions that they share can change, too. On recordings of fourteen sets, a tenth changes paths less than a
/// hundredth or a thousandth.
const DEVIATION: f64 = 0.1;
/// Share of these standard deviations whose square is added to a predicted covariance, which may be singular.
const PREDICTED_SHARE: f64 = 1e-2;
/// Share of each variance that is added to it: more than the rounding errors of a singular covariance.
const ROUNDING: f64 = 1e-9;

/// Conditions that the search changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vary {
    /// Style and goal, or anchor of a rhythmic movement.
    Both,
    /// Style.
    Style,
    /// Goal, or anchor of a rhythmic movement.
    Goal,
}

impl Vary {
    /// Returns the name of the conditions.
    pub(super) fn name(self, kind: Kind) -> &'static str {
        match (self, kind) {
            (Self::Style, _) => "style",
            (Self::Goal, Kind::Discrete) => "goal",
            (Self::Goal, Kind::Rhythmic) => "anchor",
            (Self::Both, Kind::Discrete) => "style and goal",
            (Self::Both, Kind::Rhythmic) => "style and anchor",
        }
    }
}

/// Affine map from variables x to conditions (s, g) = (s, g)₀ + Lx and their movement, with LLᵀ = Σ.
pub(super) struct Variables {
    request: Conditions,
    kind: Kind,
    /// Requested styles and centres, goal or anchor (J + D,).
    values: Vec<f64>,
    n_styles: usize,
    /// Values that vary.
    varied: Range<usize>,
    /// L (n, n).
    factor: DMatrix<f64>,
    /// Responses to each style and to all centres, as far as they vary.
    responses: Vec<Response>,
}

/// Change of the movement per unit of some values: one style, or all centres, each of which moves its own DoF alone.
struct Response {
    values: Range<usize>,
    movement: Movement,
}

impl Response {
    /// Returns the index of the value that moves a DoF.
    fn value_of(&self, dof: usize) -> usize {
        if self.values.len() == 1 { self.values.start } else { self.values.start + dof }
    }
}

impl Variables {
    /// Returns the variables about a request and its movement. Σ is the covariance of a prediction, if given, or that of the
    /// demonstrations.
    ///
    /// # Errors
    /// Conditions that do not fit the primitive, or a covariance that overflows.
    pub(super) fn new(
        model: &Model,
        request: &Conditions,
        vary: Vary,
        predicted: Option<&Array2<f64>>,
        movement: &Movement,
    ) -> Result<Self> {
        let primitive = model.primitive();
        let resolved = request.complete(primitive)?;
        let (n_styles, n) = (model.n_styles(), model.n_styles() + model.n_dofs());
        let mut covariance = demonstrated_covariance(model);
        let steps: Vec<f64> = covariance.diag().iter().map(|variance| variance.sqrt()).collect();
        if let Some(predicted) = predicted {
            covariance *= PREDICTED_SHARE * PREDICTED_SHARE;
            covariance += &predicted.slice(s![..n, ..n]);
        }
        let varied = match vary {
            Vary::Both => 0..n,
            Vary::Style => 0..n_styles,
            Vary::Goal => n_styles..n,
        };
        let mut variables = Self {
            request: request.clone(),
            kind: model.kind(),
            values: [resolved.style, resolved.centre].concat(),
            n_styles,
            factor: conditional_factor(&covariance, &varied)?,
            varied,
            responses: Vec::new(),
        };
        let each_style = (0..n_styles).map(|j| j..j + 1);
        for values in
            each_style.chain(std::iter::once(n_styles..n)).filter(|values| variables.varied.contains(&values.start))
        {
            let response = variables.response(primitive, movement, values, &steps)?;
            variables.responses.push(response);
        }
        Ok(variables)
    }

    /// Returns the number of variables.
    pub(super) fn len(&self) -> usize {
        self.varied.len()
    }

    /// Computes the response to some values by a step of each.
    fn response(
        &self,
        primitive: &Arc<Primitive>,
        movement: &Movement,
        values: Range<usize>,
        steps: &[f64],
    ) -> Result<Response> {
        let mut stepped = self.values.clone();
        values.clone().for_each(|i| stepped[i] += steps[i]);
        let changed = sampled(primitive, &self.with(&stepped))?;
        let mut response = Response { values, movement: changed };
        let scale: Vec<f64> = (0..primitive.n_dofs()).map(|dof| steps[response.value_of(dof)]).collect();
        response.movement = response.movement.difference(movement, &scale);
        Ok(response)
    }

    /// Returns the requested conditions with other values (J + D,) of those that vary.
    fn with(&self, values: &[f64]) -> Conditions {
        let mut conditions = self.request.clone();
        let (style, centre) = values.split_at(self.n_styles);
        if self.varied.start < self.n_styles {
            conditions.style = Some(style.to_vec());
        }
        if self.varied.end > self.n_styles {
            match self.kind {
                Kind::Discrete => conditions.goal = Some(centre.to_vec()),
                Kind::Rhythmic => conditions.anchor = Some(centre.to_vec()),
            }
        }
        conditions
    }

    /// Returns the changes of the values (J + D,) at x.
    fn changes(&self, x: &[f64]) -> Vec<f64> {
        let mut changes = vec![0.0; self.values.len()];
        changes[self.varied.clone()].copy_from_slice((&self.factor * DVector::from_column_slice(x)).as_slice());
        changes
    }

    /// Returns the conditions at x.
    pub(super) fn conditions(&self, x: &[f64]) -> Conditions {
        let sum: Vec<f64> = self.values.iter().zip(self.changes(x)).map(|(value, change)| value + change).collect();
        self.with(&sum)
    }

    /// Returns the movement at x as the sum of the requested one and the responses.
    pub(super) fn movement(&self, requested: &Movement, x: &[f64]) -> Movement {
        let (mut movement, changes) = (requested.clone(), self.changes(x));
        for response in &self.responses {
            movement.add(&response.movement, |dof| changes[response.value_of(dof)]);
        }
        movement
    }

    /// Returns the gradient of the excess over a limit at a place with respect to x.
    pub(super) fn gradient(&self, bound: &Bound, place: Place) -> Vec<f64> {
        let mut by_values = vec![0.0; self.values.len()];
        for response in &self.responses {
            by_values[response.value_of(bound.dof)] = bound.outward(&response.movement, place);
        }
        self.factor.tr_mul(&DVector::from_column_slice(&by_values[self.varied.clone()])).as_slice().to_vec()
    }
}

/// Returns the covariance (J + D, J + D) of the demonstrated styles and goals, or anchors, with [`DEVIATION`].
fn demonstrated_covariance(model: &Model) -> Array2<f64> {
    let demonstrated = model.demonstrated();
    let (styles, centres) = match model.kind() {
        Kind::Discrete => (&demonstrated.styles, &demonstrated.goals),
        Kind::Rhythmic => (&demonstrated.styles, &demonstrated.anchors),
    };
    let covariance = |rows: &Array2<f64>| {
        let deviations = rows - &rows.mean_axis(Axis(0)).unwrap_or_default();
        deviations.t().dot(&deviations) / rows.nrows().saturating_sub(1).max(1) as f64
    };
    let (j, n) = (styles.ncols(), styles.ncols() + centres.ncols());
    let mut both = Array2::zeros((n, n));
    both.slice_mut(s![..j, ..j]).assign(&covariance(styles));
    both.slice_mut(s![j.., j..]).assign(&covariance(centres));
    let largest = styles.iter().fold(0.0f64, |largest, style| largest.max(style.abs()));
    let style_range = if largest > 0.0 { largest } else { 1.0 };
    let sizes = std::iter::repeat_n(style_range, j).chain(ranges(model.primitive()));
    both.diag_mut().iter_mut().zip(sizes).for_each(|(variance, size)| *variance += (DEVIATION * size).powi(2));
    both
}

/// Returns the Cholesky factor of the covariance of some values given the others: the last block of that of all, in which they
/// come last.
///
/// # Errors
/// Numbers beyond the range of the covariance.
fn conditional_factor(covariance: &Array2<f64>, varied: &Range<usize>) -> Result<DMatrix<f64>> {
    let n = covariance.nrows();
    let order: Vec<usize> = (0..n).filter(|i| !varied.contains(i)).chain(varied.clone()).collect();
    let ordered =
        DMatrix::from_fn(n, n, |i, j| covariance[[order[i], order[j]]] * if i == j { 1.0 + ROUNDING } else { 1.0 });
    let problem = "cannot be compared: the covariance of styles and goals overflows; pass demonstrations, or a context, of \
                   moderate numbers";
    let cholesky = ordered.cholesky().ok_or(Error::Argument { name: "conditions", problem })?;
    let n_fixed = n - varied.len();
    Ok(cholesky.l().view((n_fixed, n_fixed), (varied.len(), varied.len())).into_owned())
}
