//! From a condition to a movement (Section 4.1.2): the map U from contexts to all that a movement needs.
//!
//! The paper predicts the style alone, by least squares. Goal, start, anchor and duration vary with the condition too,
//! so one map predicts them together. The duration enters by its logarithm and so stays positive. Demonstrations of
//! one context are averaged, and every context counts once: what they share beyond their context must not weigh by
//! how often it was shown.

mod encoding;
mod kernel;
mod kriging;
mod model_selection;
mod outputs;
mod principal_axes;
mod stacking;
#[cfg(test)]
mod tests;
mod training_data;

use ndarray::{Array1, Array2, ArrayView2, Axis};

pub use encoding::ContextColumn;
pub(crate) use encoding::tabulate;
pub(crate) use kernel::Kernel;
pub use model_selection::{ContextMapKind, MapSelection};
pub(crate) use outputs::{outputs, relative_changes};

use encoding::{Scale, numbers};
use kriging::Kriging;
use model_selection::{Candidate, Choice, choose};
use principal_axes::Axes;
pub(crate) use stacking::Stack;
use training_data::Data;
pub(crate) use training_data::group_equal_contexts;

use crate::demonstration::ContextValue;
use crate::error::{Error, Result};
use crate::validate::check_matrix;

/// A map from contexts of Q values to P outputs, with the covariance of what it predicts.
#[derive(Clone, Debug, PartialEq)]
pub struct ContextMap {
    columns: Vec<ContextColumn>,
    scale: Scale,
    kind: ContextMapKind,
    kernel: Option<Kernel>,
    axes: Axes,
    /// The ratio of signal to noise of each component (P,), as all that follows is of components.
    ratios: Vec<f64>,
    /// The same of the line (P,), if there is one.
    slopes: Vec<f64>,
    errors: Vec<(ContextMapKind, f64)>,
    process: Part,
    /// The line beside the process, and their weights.
    trend: Option<(Part, Stack)>,
    /// Mean of the components over the contexts (P,).
    centre: Array1<f64>,
    /// Covariance (P, P) of the contexts' noise, where more contexts than coefficients leave any.
    noise: Option<Array2<f64>>,
    /// Covariance (P, P) that a new movement adds to it: that within a context, as far as it is not averaged away.
    within: Option<Array2<f64>>,
    degrees_of_freedom: usize,
}

/// One prediction of the components: coefficients (q, P) and (r, P) of the two kinds of coordinates of a place.
#[derive(Clone, Debug, PartialEq)]
struct Part {
    kriging: Kriging,
    flat: Array2<f64>,
    rest: Array2<f64>,
}

impl Part {
    fn of(candidate: Candidate) -> Self {
        let Candidate { kriging, values, ratios, .. } = candidate;
        let rest = kriging.coefficients(&values, &ratios);
        Self { kriging, flat: values.flat, rest }
    }

    /// Components (P,) for features (F,).
    fn mean(&self, features: &[f64]) -> Array1<f64> {
        let place = self.kriging.place(features);
        place.flat.dot(&self.flat) + place.rest.dot(&self.rest)
    }
}

/// Constants of a map, which determine it together with the data.
#[derive(Clone, Debug)]
pub(crate) struct Recipe {
    pub(crate) kind: ContextMapKind,
    pub(crate) kernel: Option<Kernel>,
    pub(crate) directions: Array2<f64>,
    pub(crate) ratios: Vec<f64>,
    pub(crate) trend: Option<(Vec<f64>, Stack)>,
    pub(crate) errors: Vec<(ContextMapKind, f64)>,
}

/// What a map says of a context.
#[derive(Clone, Debug, PartialEq)]
pub struct ContextPrediction {
    /// Expected outputs (P,).
    pub mean: Vec<f64>,
    /// Covariance (P, P) of new outputs; `None` where no context is left over to estimate it.
    pub covariance: Option<Array2<f64>>,
    /// How far each value of the context lies outside of those that were shown, in their range (Q,).
    pub extrapolation: Vec<f64>,
}

impl ContextMap {
    /// Learns a map from contexts (M rows of Q) to outputs (M, P), all of which have one unit where one is chosen.
    ///
    /// # Errors
    /// Contexts and outputs that do not fit together, numbers that are not finite, labels beside numbers in one
    /// column, or more contexts than the kind of map can have.
    pub fn fit(contexts: &[Vec<ContextValue>], outputs: ArrayView2<f64>, choice: MapSelection) -> Result<Self> {
        check_matrix("outputs", outputs)?;
        if contexts.len() != outputs.nrows() {
            let (expected, found) = (outputs.nrows(), contexts.len());
            return Err(Error::Length { name: "contexts", expected, found, per: "row of the outputs" });
        }
        let contexts: Vec<&[ContextValue]> = contexts.iter().map(Vec::as_slice).collect();
        let (columns, table) = tabulate(&contexts)?;
        Self::learn(columns, &table, outputs, Array2::eye(outputs.ncols()).view(), choice)
    }

    /// Learns a map from tabulated contexts (M, Q). `metric` (P, P) turns errors of the outputs into that of a movement.
    pub(crate) fn learn(
        columns: Vec<ContextColumn>,
        contexts: &Array2<f64>,
        outputs: ArrayView2<f64>,
        metric: ArrayView2<f64>,
        choice: MapSelection,
    ) -> Result<Self> {
        let data = Data::of(columns, contexts, outputs)?;
        data.check_count(matches!(choice, MapSelection::Given(kind) if kind != ContextMapKind::Linear))?;
        let axes = Axes::principal(data.means.view(), metric)?;
        let data = data.along(&axes);
        let labels_alone = data.columns.iter().all(|column| matches!(column, ContextColumn::Label(_)));
        let choice = choose(choice, labels_alone, &data.shown())?;
        Ok(data.map(axes, choice))
    }

    /// The same map again, from the data that it was learnt from.
    pub(crate) fn restore(
        columns: Vec<ContextColumn>,
        contexts: &Array2<f64>,
        outputs: ArrayView2<f64>,
        recipe: Recipe,
    ) -> Result<Self> {
        let Recipe { kind, kernel, directions, ratios, trend, errors } = recipe;
        let axes = Axes::new(directions)?;
        let data = Data::of(columns, contexts, outputs)?;
        data.check_count(kernel.is_some() || kind != ContextMapKind::Linear)?;
        let data = data.along(&axes);
        let candidate = Candidate::with(kind, kernel, &data.shown(), |_, _| ratios)?;
        let trend = trend.map(|(ratios, stack)| model_selection::trend(&data.shown(), ratios, stack)).transpose()?;
        Ok(data.map(axes, Choice { candidate, trend, errors }))
    }

    pub(crate) fn recipe(&self) -> Recipe {
        Recipe {
            kind: self.kind,
            kernel: self.kernel,
            directions: self.axes.directions.clone(),
            ratios: self.ratios.clone(),
            trend: self.trend.as_ref().map(|(_, stack)| (self.slopes.clone(), *stack)),
            errors: self.errors.clone(),
        }
    }

    /// What each value of a context means.
    pub fn columns(&self) -> &[ContextColumn] {
        &self.columns
    }

    /// The context that numbers (Q,) stand for, labels given by their index among the [`ContextMap::columns`].
    ///
    /// # Errors
    /// A number that is no index of a label.
    pub fn context(&self, numbers: &[f64]) -> Result<Vec<ContextValue>> {
        let columns = self.columns.iter().enumerate();
        columns.zip(numbers).map(|((q, column), &number)| column.value(q, number)).collect()
    }

    /// Number of context values Q.
    pub fn n_inputs(&self) -> usize {
        self.columns.len()
    }

    /// What kind of map it is.
    pub fn kind(&self) -> ContextMapKind {
        self.kind
    }

    /// Mean squared error of each map that was tried, at contexts left out: in closed form, with the constants of all.
    pub fn errors(&self) -> &[(ContextMapKind, f64)] {
        &self.errors
    }

    /// Degrees of freedom from which the covariance is known.
    pub fn degrees_of_freedom(&self) -> usize {
        self.degrees_of_freedom
    }

    /// The outputs for a context (Q,), with their covariance: that of the mean, of what the context does not tell, and
    /// of one movement among those of a context.
    ///
    /// # Errors
    /// A context of another length, a label never shown, or a number that is not finite.
    pub fn predict<V: Clone + Into<ContextValue>>(&self, context: &[V]) -> Result<ContextPrediction> {
        let context: Vec<ContextValue> = context.iter().cloned().map(Into::into).collect();
        let context = numbers(&self.columns, &context)?;
        let features = self.scale.features(&context);
        let outside = self.scale.outside(&context);
        let (components, dispersion) = self.components(&features, &outside);
        let mean = components.dot(&self.axes.directions).to_vec();
        let covariance = self.noise.as_ref().map(|noise| {
            let kriging = &self.process.kriging;
            let place = kriging.place(&features);
            let spread: Vec<f64> =
                self.ratios.iter().map(|&ratio| (1.0 + kriging.variance(&place, ratio)).sqrt()).collect();
            let mut grown = Array2::from_shape_fn(noise.dim(), |(i, j)| noise[[i, j]] * spread[i] * spread[j]);
            for (weight, deviation) in dispersion {
                let column = deviation.view().insert_axis(Axis(1));
                grown.scaled_add(weight, &column.dot(&column.t()));
            }
            self.axes.covariance(&match &self.within {
                Some(within) => grown + within,
                None => grown,
            })
        });
        if mean.iter().chain(covariance.iter().flatten()).any(|x| !x.is_finite()) {
            return Err(too_far(&context, &outside));
        }
        Ok(ContextPrediction { mean, covariance, extrapolation: outside })
    }
}

/// The error of a context (Q,) whose prediction overflows: that names the value that is farthest outside.
pub(crate) fn too_far(context: &[f64], outside: &[f64]) -> Error {
    let farthest = (0..context.len()).max_by(|&a, &b| outside[a].total_cmp(&outside[b]));
    let value = farthest.map_or(f64::NAN, |q| context[q]);
    Error::Range {
        name: "context",
        value,
        allowed: "is so far from those of the demonstrations that the prediction overflows",
    }
}

impl ContextMap {
    /// The outputs (P,) for a context as numbers (Q,), labels as their index.
    pub(crate) fn expect(&self, numbers: &[f64]) -> Vec<f64> {
        let (components, _) = self.components(&self.scale.features(numbers), &self.scale.outside(numbers));
        components.dot(&self.axes.directions).to_vec()
    }

    /// Components (P,) for features (F,), and the deviations from them of the predictions that they combine, with the
    /// share in which each may be right: the variance of a mixture.
    fn components(&self, features: &[f64], outside: &[f64]) -> (Array1<f64>, Vec<(f64, Array1<f64>)>) {
        let process = self.process.mean(features);
        let Some((line, stack)) = &self.trend else { return (process, Vec::new()) };
        let weights = stack.at(outside.iter().fold(0.0, |most, share| share.max(most)));
        let members = [process, line.mean(features), self.centre.clone()];
        let combined =
            members.iter().zip(weights).fold(Array1::zeros(self.centre.len()), |mut sum, (mean, (weight, _))| {
                sum.scaled_add(weight, mean);
                sum
            });
        let dispersion = members.into_iter().zip(weights).map(|(mean, (_, share))| (share, mean - &combined)).collect();
        (combined, dispersion)
    }
}

impl std::fmt::Display for ContextMap {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}", self.kind)?;
        if let Some(Kernel::Matern { length }) = self.kernel {
            write!(f, ", length {length:.2} of the contexts' spread")?;
        }
        if let Some((_, Stack { inside, outside })) = &self.trend {
            write!(f, "; weights {:.2} and {:.2} inside the contexts of the demonstrations", inside[0], inside[1])?;
            let mean = (1.0 - outside[0] - outside[1]).max(0.0);
            write!(f, ", {:.2}, {:.2} and {mean:.2} for the mean outside", outside[0], outside[1])?;
        }
        for (k, (kind, error)) in self.errors.iter().filter(|(_, error)| error.is_finite()).enumerate() {
            let before = if k == 0 { "; leave-one-out error" } else { "," };
            write!(f, "{before} {error:.3e} ({})", kind.name())?;
        }
        Ok(())
    }
}
