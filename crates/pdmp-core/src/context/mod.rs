//! Context map U: context ↦ style, goal, start or anchor, and duration (Section 4.1.2 of the paper).
//!
//! The paper predicts the style alone, by least squares. Goal, start, anchor and duration depend on the context as well, so
//! that one map predicts all of them, the duration by its logarithm. Demonstrations of equal contexts are averaged, and
//! each context has the same weight: errors common to the demonstrations of a context do not average out, however many
//! there are.

mod deviations;
mod encoding;
mod kernel;
mod kriging;
mod model_selection;
mod names;
mod outputs;
mod principal_axes;
pub(crate) mod stacking;
#[cfg(test)]
mod tests;
mod training_data;

use ndarray::{Array1, Array2, ArrayView2, Axis};

pub use encoding::ContextColumn;
pub(crate) use encoding::tabulate;
pub(crate) use kernel::Kernel;
pub use model_selection::{ContextMapKind, MapSelection};
pub(crate) use outputs::{log_duration_jacobian, log_durations, outputs};
pub(crate) use stacking::StackingWeights;
pub(crate) use training_data::group_equal_contexts;

use encoding::{Encoder, to_numbers};
use kriging::Kriging;
use model_selection::{KrigingModel, SelectedMap, StackedLine, select};
use principal_axes::PrincipalAxes;
use stacking::{MemberWeight, dispersion_beyond};
use training_data::GroupedData;

use crate::demonstration::ContextValue;
use crate::error::{Error, Result};
use crate::validate::{check_length, check_matrix};

/// Degrees of freedom that the estimated signal-to-noise ratio leaves at least; with fewer, it costs none.
///
/// In simulations of lines, curves and constants with much noise, 90 % bands within the range of 5 to 12 contexts cover 81 to
/// 89 % of new values if the ratio costs no degree of freedom, 85 to 93 % if it costs one and 88 to 97 % if it costs two.
/// Within the range of 3 contexts they cover 82 to 96 % with none, and 97 to 99 % with one, where they are three times as
/// wide.
const MIN_DEGREES_OF_FREEDOM: usize = 2;

/// Map from contexts of Q values to P outputs, with the covariance of its predictions.
///
/// For each principal component of the outputs, y = φ(h)ᵀβ + f(h) + ε: a trend φᵀβ, a Gaussian process f and noise ε.
///
/// ```
/// use ndarray::array;
/// use pdmp_core::context::{ContextMap, ContextMapKind, MapSelection};
///
/// # fn main() -> pdmp_core::Result<()> {
/// let contexts: Vec<Vec<_>> = [0.1, 0.2, 0.4].map(|height| vec![height.into()]).to_vec();
/// let outputs = array![[1.0], [2.0], [4.0]];
/// let map = ContextMap::fit(&contexts, outputs.view(), MapSelection::Given(ContextMapKind::Linear))?;
/// let prediction = map.predict(&[0.55])?;
/// assert!((prediction.mean[0] - 5.5).abs() < 1e-9);
/// assert!((prediction.extrapolation[0] - 0.5).abs() < 1e-9);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ContextMap {
    columns: Vec<ContextColumn>,
    /// Names of the columns (Q,); empty where unknown.
    names: Vec<String>,
    encoder: Encoder,
    axes: PrincipalAxes,
    /// Parameters of the components, to which all following fields refer too.
    parameters: MapParameters,
    /// Least squares, ridge regression or Gaussian process.
    predictor: Predictor,
    /// Line of a stacked map.
    line: Option<Predictor>,
    /// Mean over the contexts (P,).
    mean: Array1<f64>,
    /// Weights of the process, the line and the mean in the variance beyond the demonstrated contexts.
    dispersion: [f64; 3],
    /// Covariance (P, P) of the noise of the contexts' means; `None` without degrees of freedom.
    noise: Option<Array2<f64>>,
    /// Covariance (P, P) that one movement adds to it: the part of the covariance within contexts that means average out.
    within: Option<Array2<f64>>,
    degrees_of_freedom: usize,
}

/// Kriging predictor of the components.
#[derive(Clone, Debug, PartialEq)]
struct Predictor {
    kriging: Kriging,
    /// Trend coefficients (q, P).
    trend: Array2<f64>,
    /// Kriging weights (r, P).
    weights: Array2<f64>,
}

impl Predictor {
    fn new(model: KrigingModel) -> Self {
        let weights = model.kriging.weights(&model.observations, &model.ratios);
        Self { kriging: model.kriging, trend: model.observations.trend, weights }
    }

    /// Computes the components (P,) for features (F,).
    fn mean(&self, features: &[f64]) -> Array1<f64> {
        let location = self.kriging.location(features);
        location.trend.dot(&self.trend) + location.covariance.dot(&self.weights)
    }
}

/// Parameters of a map, which determine it together with the training data and the axes of the outputs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MapParameters {
    pub(crate) kind: ContextMapKind,
    pub(crate) kernel: Option<Kernel>,
    /// Signal-to-noise ratio of each component (P,).
    pub(crate) ratios: Vec<f64>,
    /// Signal-to-noise ratios (P,) of the line of a stacked map, and the weights of the stack.
    pub(crate) line: Option<(Vec<f64>, StackingWeights)>,
    /// Mean squared leave-one-out errors.
    pub(crate) errors: Vec<(ContextMapKind, f64)>,
}

/// Prediction of a [`ContextMap`] for one context.
#[derive(Clone, Debug, PartialEq)]
pub struct ContextPrediction {
    /// Mean of the outputs (P,).
    pub mean: Vec<f64>,
    /// Covariance (P, P) of new outputs; `None` where no degrees of freedom remain to estimate it.
    pub covariance: Option<Array2<f64>>,
    /// Distance of each context value (Q,) from the demonstrated range, in units of that range.
    ///
    /// It is 0 within the range and for labels, and infinite for a new value in a column that did not vary.
    pub extrapolation: Vec<f64>,
}

impl ContextMap {
    /// Fits a map from contexts (M rows of Q values) to outputs (M, P).
    ///
    /// The kind is selected by the errors of all outputs together, which therefore need a common unit.
    ///
    /// # Errors
    /// Contexts and outputs of different lengths, numbers that are not finite, a column with both labels and numbers, or
    /// more than 1024 distinct contexts for a kind other than [`ContextMapKind::Linear`].
    pub fn fit(contexts: &[Vec<ContextValue>], outputs: ArrayView2<f64>, selection: MapSelection) -> Result<Self> {
        check_matrix("outputs", outputs)?;
        check_length("contexts", contexts.len(), outputs.nrows(), "row of the outputs")?;
        let contexts: Vec<&[ContextValue]> = contexts.iter().map(Vec::as_slice).collect();
        let (columns, table) = tabulate(&contexts)?;
        Self::learn(columns, &table, outputs, Array2::eye(outputs.ncols()).view(), selection)
    }

    /// Fits a map to tabulated contexts (M, Q). An error e of the outputs displaces the movement by √(eᵀGe) with the
    /// `metric` G (P, P).
    pub(crate) fn learn(
        columns: Vec<ContextColumn>,
        contexts: &Array2<f64>,
        outputs: ArrayView2<f64>,
        metric: ArrayView2<f64>,
        selection: MapSelection,
    ) -> Result<Self> {
        let data = GroupedData::new(columns, contexts, outputs)?;
        if matches!(selection, MapSelection::Given(kind) if kind != ContextMapKind::Linear) {
            data.check_kernel_size()?;
        }
        let axes = PrincipalAxes::fit(data.means.view(), metric)?;
        let data = data.along(&axes);
        let only_labels = data.columns.iter().all(|column| matches!(column, ContextColumn::Label(_)));
        let selected = select(selection, only_labels, &data.training_set())?;
        Ok(Self::new(data, axes, selected))
    }

    /// Restores a map from its training data, the outputs per unit of each component, as rows (P, P), and its parameters.
    pub(crate) fn restore(
        columns: Vec<ContextColumn>,
        contexts: &Array2<f64>,
        outputs: ArrayView2<f64>,
        directions: Array2<f64>,
        parameters: MapParameters,
    ) -> Result<Self> {
        let MapParameters { kind, kernel, ratios, line, errors } = parameters;
        let axes = PrincipalAxes::from_directions(directions)?;
        let data = GroupedData::new(columns, contexts, outputs)?;
        if kernel.is_some() || kind != ContextMapKind::Linear {
            data.check_kernel_size()?;
        }
        let data = data.along(&axes);
        let training = data.training_set();
        let model = KrigingModel::with_ratios(kernel, &training, ratios)?;
        let line = line.map(|(ratios, weights)| StackedLine::with_ratios(&training, ratios, weights)).transpose()?;
        Ok(Self::new(data, axes, SelectedMap { kind, model, line, errors }))
    }

    fn new(data: GroupedData, axes: PrincipalAxes, selected: SelectedMap) -> Self {
        let SelectedMap { kind, model, line, errors } = selected;
        let (noise, degrees_of_freedom) = match (model.kriging.degrees_of_freedom(), &data.within) {
            (0, None) => (None, 0),
            // With one coefficient per context, repetitions alone have noise.
            (0, Some((within, n))) => (Some(within * data.averaged_share), *n),
            (n, _) => {
                let n = n - usize::from(model.kernel.is_some() && n > MIN_DEGREES_OF_FREEDOM);
                let innovations = model.kriging.innovations(&model.observations, &model.ratios);
                (Some(innovations.t().dot(&innovations) / n as f64), n)
            }
        };
        let mean = data.means.mean_axis(Axis(0)).unwrap_or_default();
        let error = |kind: ContextMapKind| errors.iter().find(|(own, _)| *own == kind).map(|(_, error)| *error);
        // The mean of the other contexts, from which one is n/(n − 1) times as far as from that of all.
        let n = data.means.nrows().max(2) as f64;
        let of_mean = (&data.means - &mean).mapv(|deviation| deviation * deviation).sum() * n / (n - 1.0).powi(2);
        let of_members = [ContextMapKind::Gp, ContextMapKind::Linear].map(|kind| error(kind).unwrap_or(of_mean));
        Self {
            dispersion: dispersion_beyond([of_members[0], of_members[1], of_mean]),
            mean,
            within: data.within.map(|(within, _)| within * (1.0 - data.averaged_share)),
            columns: data.columns,
            names: Vec::new(),
            encoder: data.encoder,
            axes,
            parameters: MapParameters {
                kind,
                kernel: model.kernel,
                ratios: model.ratios.clone(),
                line: line.as_ref().map(|line| (line.model.ratios.clone(), line.weights)),
                errors,
            },
            predictor: Predictor::new(model),
            line: line.map(|line| Predictor::new(line.model)),
            noise,
            degrees_of_freedom,
        }
    }

    /// Returns the parameters from which [`ContextMap::restore`] reproduces the map, with its directions.
    pub(crate) fn parameters(&self) -> &MapParameters {
        &self.parameters
    }

    /// Returns the outputs per unit of each component, as rows (P, P).
    pub(crate) fn directions(&self) -> &Array2<f64> {
        &self.axes.directions
    }

    /// Returns the type of each context value (Q,).
    pub fn columns(&self) -> &[ContextColumn] {
        &self.columns
    }

    /// Returns the context that numbers (Q,) encode, where a label is its index in [`ContextMap::columns`].
    ///
    /// ```
    /// # use ndarray::array;
    /// # use pdmp_core::context::{ContextMap, MapSelection};
    /// # fn main() -> pdmp_core::Result<()> {
    /// let contexts = [vec!["left".into()], vec!["right".into()], vec!["left".into()]];
    /// let outputs = array![[1.0], [2.0], [1.2]];
    /// let map = ContextMap::fit(&contexts, outputs.view(), MapSelection::Auto)?;
    /// assert_eq!(map.context(&[1.0])?, contexts[1]);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A number that is not the index of a label.
    pub fn context(&self, numbers: &[f64]) -> Result<Vec<ContextValue>> {
        let columns = self.columns.iter().enumerate();
        columns.zip(numbers).map(|((q, column), &number)| column.value(q, number)).collect()
    }

    /// Returns the kind of the map.
    pub fn kind(&self) -> ContextMapKind {
        self.parameters.kind
    }

    /// Returns the mean squared leave-one-out error of the map and of its members, in closed form.
    ///
    /// Hyperparameters are those of all contexts. An error is infinite where the other contexts do not determine the
    /// prediction.
    pub fn errors(&self) -> &[(ContextMapKind, f64)] {
        &self.parameters.errors
    }

    /// Returns the degrees of freedom of the covariance.
    pub fn degrees_of_freedom(&self) -> usize {
        self.degrees_of_freedom
    }

    /// Predicts the outputs for a context (Q,).
    ///
    /// The covariance is that of one new movement: of the predicted mean, of deviations that the context does not explain,
    /// and within a context.
    ///
    /// # Errors
    /// A context of another length, an unknown label, a number that is not finite, or a prediction that overflows.
    pub fn predict<V: Clone + Into<ContextValue>>(&self, context: &[V]) -> Result<ContextPrediction> {
        let context: Vec<ContextValue> = context.iter().cloned().map(Into::into).collect();
        let context = to_numbers(&self.columns, &context).map_err(|error| self.with_column_name(error))?;
        let features = self.encoder.features(&context);
        let extrapolation = self.encoder.extrapolation(&context);
        let (components, deviations) = self.components(&features, &extrapolation);
        let mean = components.dot(&self.axes.directions).to_vec();
        let covariance = self.noise.as_ref().map(|noise| {
            let kriging = &self.predictor.kriging;
            let location = kriging.location(&features);
            let growth: Vec<f64> =
                self.parameters.ratios.iter().map(|&ratio| (1.0 + kriging.variance(&location, ratio)).sqrt()).collect();
            let mut covariance = Array2::from_shape_fn(noise.dim(), |(i, j)| noise[[i, j]] * growth[i] * growth[j]);
            for (weight, deviation) in deviations {
                let column = deviation.view().insert_axis(Axis(1));
                covariance.scaled_add(weight, &column.dot(&column.t()));
            }
            if let Some(within) = &self.within {
                covariance += within;
            }
            self.axes.output_covariance(&covariance)
        });
        if mean.iter().chain(covariance.iter().flatten()).any(|x| !x.is_finite()) {
            return Err(overflow(&context, &extrapolation));
        }
        Ok(ContextPrediction { mean, covariance, extrapolation })
    }

    /// Predicts the outputs (P,) for a context of numbers (Q,), with labels as their indices, without checks.
    pub(crate) fn predict_mean(&self, numbers: &[f64]) -> Vec<f64> {
        let (components, _) = self.components(&self.encoder.features(numbers), &self.encoder.extrapolation(numbers));
        components.dot(&self.axes.directions).to_vec()
    }

    /// Computes the components (P,) for features (F,), and the deviations (P,) of the members of the stack from them, with
    /// their weights in the variance of the mixture.
    fn components(&self, features: &[f64], extrapolation: &[f64]) -> (Array1<f64>, Vec<(f64, Array1<f64>)>) {
        let process = self.predictor.mean(features);
        let (Some(line), Some((_, weights))) = (&self.line, &self.parameters.line) else {
            return (process, Vec::new());
        };
        let weights = weights.at(extrapolation.iter().fold(0.0, |max, distance| distance.max(max)), self.dispersion);
        let members = [process, line.mean(features), self.mean.clone()];
        let mut combined = Array1::zeros(self.mean.len());
        for (member, MemberWeight { mean, .. }) in members.iter().zip(weights) {
            combined.scaled_add(mean, member);
        }
        let deviations =
            members.into_iter().zip(weights).map(|(member, weight)| (weight.dispersion, member - &combined));
        let deviations = deviations.collect();
        (combined, deviations)
    }
}

/// Returns the error of a context (Q,) whose prediction overflows, which names the value of largest extrapolation.
fn overflow(context: &[f64], extrapolation: &[f64]) -> Error {
    let farthest = (0..context.len()).max_by(|&a, &b| extrapolation[a].total_cmp(&extrapolation[b]));
    Error::Range {
        name: "context",
        value: farthest.map_or(f64::NAN, |q| context[q]),
        allowed: "is so far from those of the demonstrations that the prediction overflows",
    }
}

impl std::fmt::Display for ContextMap {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let MapParameters { kind, kernel, line, errors, .. } = &self.parameters;
        write!(f, "{kind}")?;
        if let Some(Kernel::Matern { length }) = kernel {
            write!(f, ", length scale {length:.2} of the contexts' standard deviation")?;
        }
        if let Some((_, StackingWeights { interpolation, extrapolation: [g, l] })) = line {
            let mean = (1.0 - g - l).max(0.0);
            write!(f, "; interpolation weights {:.2} and {:.2}", interpolation[0], interpolation[1])?;
            write!(f, ", extrapolation weights {g:.2}, {l:.2} and {mean:.2} for the mean")?;
        }
        for (k, (kind, error)) in errors.iter().filter(|(_, error)| error.is_finite()).enumerate() {
            let before = if k == 0 { "; leave-one-out error" } else { "," };
            write!(f, "{before} {error:.3e} ({})", kind.name())?;
        }
        Ok(())
    }
}
