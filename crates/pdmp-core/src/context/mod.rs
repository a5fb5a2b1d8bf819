//! From a condition to a movement (Section 4.1.2): the map U from contexts to all that a movement needs.
//!
//! The paper predicts the style alone, by least squares. Goal, start, anchor and duration vary with the condition too,
//! so one map predicts them together. The duration enters by its logarithm and so stays positive. Demonstrations of
//! one context are averaged, and every context counts once: what they share beyond their context must not weigh by
//! how often it was shown.

mod axes;
mod choice;
mod kernel;
mod kriging;
mod prediction;
mod space;
#[cfg(test)]
mod tests;

use std::collections::HashMap;

use ndarray::{Array2, ArrayView2, Axis};

pub use choice::{MapChoice, MapKind};
pub(crate) use kernel::Kernel;
pub use prediction::Prediction;
pub(crate) use prediction::{outputs, relative_changes};
pub use space::ContextColumn;
pub(crate) use space::tabulate;

use axes::Axes;
use choice::{Candidate, MOST, Shown, choose};
use kriging::{Kriging, Place};
use space::{Scale, numbers};

use crate::demo::{ContextValue, check_matrix};
use crate::error::{Error, Result};

/// Most multiplications n·f² that a linear map of n contexts with f inputs may take: a second or two.
const MAX_WORK: f64 = 4e9;

/// A map from contexts of Q values to P outputs, with the covariance of what it predicts.
#[derive(Clone, Debug, PartialEq)]
pub struct ContextMap {
    columns: Vec<ContextColumn>,
    scale: Scale,
    kind: MapKind,
    kernel: Option<Kernel>,
    axes: Axes,
    /// The ratio of signal to noise of each component (P,), as all that follows is of components.
    ratios: Vec<f64>,
    errors: Vec<(MapKind, f64)>,
    kriging: Kriging,
    /// Coefficients (q, P) and (r, P) of a place's two kinds of coordinates.
    flat: Array2<f64>,
    rest: Array2<f64>,
    /// Covariance (P, P) of the contexts' noise, where more contexts than coefficients leave any.
    noise: Option<Array2<f64>>,
    /// Covariance (P, P) that a new movement adds to it: that within a context, as far as it is not averaged away.
    within: Option<Array2<f64>>,
    freedom: usize,
}

/// What a map is determined by, besides the data: enough to have it again.
#[derive(Clone, Debug)]
pub(crate) struct Recipe {
    pub(crate) kind: MapKind,
    pub(crate) kernel: Option<Kernel>,
    pub(crate) directions: Array2<f64>,
    pub(crate) ratios: Vec<f64>,
    pub(crate) errors: Vec<(MapKind, f64)>,
}

/// What a map says of a context.
#[derive(Clone, Debug, PartialEq)]
pub struct Expected {
    /// Expected outputs (P,).
    pub mean: Vec<f64>,
    /// Covariance (P, P) of new outputs; `None` where no context is left over to estimate it.
    pub covariance: Option<Array2<f64>>,
    /// How far each value of the context lies outside of those that were shown, in their range (Q,).
    pub outside: Vec<f64>,
}

impl ContextMap {
    /// Learns a map from contexts (M rows of Q) to outputs (M, P), all of which have one unit where one is chosen.
    ///
    /// # Errors
    /// Contexts and outputs that do not fit together, numbers that are not finite, labels beside numbers in one
    /// column, or more contexts than the kind of map can have.
    pub fn fit(contexts: &[Vec<ContextValue>], outputs: ArrayView2<f64>, choice: MapChoice) -> Result<Self> {
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
        choice: MapChoice,
    ) -> Result<Self> {
        let data = Data::of(columns, contexts, outputs)?;
        data.check_count(matches!(choice, MapChoice::Given(MapKind::Gp | MapKind::Polynomial)))?;
        let axes = Axes::principal(data.means.view(), metric)?;
        let data = data.along(&axes);
        let (candidate, errors) = choose(choice, &data.shown())?;
        Ok(data.map(axes, candidate, errors))
    }

    /// The same map again, from the data that it was learnt from.
    pub(crate) fn restore(
        columns: Vec<ContextColumn>,
        contexts: &Array2<f64>,
        outputs: ArrayView2<f64>,
        recipe: Recipe,
    ) -> Result<Self> {
        let Recipe { kind, kernel, directions, ratios, errors } = recipe;
        let axes = Axes::new(directions)?;
        let data = Data::of(columns, contexts, outputs)?;
        data.check_count(kernel.is_some() || kind != MapKind::Linear)?;
        let data = data.along(&axes);
        let candidate = Candidate::with(kind, kernel, &data.shown(), |_, _| ratios)?;
        Ok(data.map(axes, candidate, errors))
    }

    pub(crate) fn recipe(&self) -> Recipe {
        let (directions, ratios, errors) = (self.axes.directions.clone(), self.ratios.clone(), self.errors.clone());
        Recipe { kind: self.kind, kernel: self.kernel, directions, ratios, errors }
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
    pub fn kind(&self) -> MapKind {
        self.kind
    }

    /// Mean squared error of each map that was tried, at contexts left out: in closed form, with the constants of all.
    pub fn errors(&self) -> &[(MapKind, f64)] {
        &self.errors
    }

    /// Degrees of freedom from which the covariance is known.
    pub fn freedom(&self) -> usize {
        self.freedom
    }

    /// The outputs for a context (Q,), with their covariance: that of the mean, of what the context does not tell, and
    /// of one movement among those of a context.
    ///
    /// # Errors
    /// A context of another length, a label never shown, or a number that is not finite.
    pub fn predict<V: Clone + Into<ContextValue>>(&self, context: &[V]) -> Result<Expected> {
        let context: Vec<ContextValue> = context.iter().cloned().map(Into::into).collect();
        let context = numbers(&self.columns, &context)?;
        let place = self.kriging.place(&self.scale.features(&context));
        let mean = self.mean(&place);
        let covariance = self.noise.as_ref().map(|noise| {
            let spread: Vec<f64> =
                self.ratios.iter().map(|&ratio| (1.0 + self.kriging.variance(&place, ratio)).sqrt()).collect();
            let grown = Array2::from_shape_fn(noise.dim(), |(i, j)| noise[[i, j]] * spread[i] * spread[j]);
            self.axes.covariance(&match &self.within {
                Some(within) => grown + within,
                None => grown,
            })
        });
        if mean.iter().chain(covariance.iter().flatten()).any(|x| !x.is_finite()) {
            return Err(Error::Arguments("context is so far from the demonstrations that the prediction overflows"));
        }
        Ok(Expected { mean, covariance, outside: self.scale.outside(&context) })
    }
}

impl ContextMap {
    /// The outputs (P,) for a context as numbers (Q,), labels as their index.
    pub(crate) fn expect(&self, numbers: &[f64]) -> Vec<f64> {
        self.mean(&self.kriging.place(&self.scale.features(numbers)))
    }

    fn mean(&self, place: &Place) -> Vec<f64> {
        (place.flat.dot(&self.flat) + place.rest.dot(&self.rest)).dot(&self.axes.directions).to_vec()
    }
}

/// Demonstrations of equal contexts (M, Q), in the order of the first of each.
pub(crate) fn alike(contexts: &Array2<f64>) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut known = HashMap::new();
    for (m, row) in contexts.rows().into_iter().enumerate() {
        // Zero of either sign is one context.
        let key: Vec<u64> = row.iter().map(|value| (value + 0.0).to_bits()).collect();
        let group = *known.entry(key).or_insert(groups.len());
        if group == groups.len() {
            groups.push(Vec::new());
        }
        groups[group].push(m);
    }
    groups
}

impl std::fmt::Display for ContextMap {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}", self.kind)?;
        if let Some(Kernel::Matern { length }) = self.kernel {
            write!(f, " of length {length:.2}")?;
        }
        for (k, (kind, error)) in self.errors.iter().filter(|(_, error)| error.is_finite()).enumerate() {
            let before = if k == 0 { "; left-out error of" } else { "," };
            write!(f, "{before} {} {error:.3e}", kind.name())?;
        }
        Ok(())
    }
}

/// Contexts that differ, what was shown in each on average, and how much that scattered.
struct Data {
    columns: Vec<ContextColumn>,
    scale: Scale,
    inputs: Array2<f64>,
    means: Array2<f64>,
    /// Pooled covariance of demonstrations of one context, with its degrees of freedom; the mean of one over their
    /// number is the share of it that an average keeps.
    within: Option<(Array2<f64>, usize)>,
    kept: f64,
}

impl Data {
    fn of(columns: Vec<ContextColumn>, contexts: &Array2<f64>, outputs: ArrayView2<f64>) -> Result<Self> {
        let groups = alike(contexts);
        // Each label is an input of its own.
        let n_inputs: usize = columns.iter().map(ContextColumn::n_features).sum();
        let work = groups.len() as f64 * (n_inputs as f64).powi(2);
        if work > MAX_WORK {
            let allowed = "labels and numbers of a context: too many for so many contexts; merge labels";
            return Err(Error::Range { name: "contexts", value: n_inputs as f64, allowed });
        }
        let firsts: Vec<usize> = groups.iter().map(|group| group[0]).collect();
        let distinct = contexts.select(Axis(0), &firsts);
        let scale = Scale::of(&columns, &distinct)?;
        let features: Vec<f64> = distinct.rows().into_iter().flat_map(|row| scale.features(&row.to_vec())).collect();
        let inputs =
            Array2::from_shape_fn((groups.len(), scale.n_features()), |(i, f)| features[i * scale.n_features() + f]);
        let mut means = Array2::zeros((groups.len(), outputs.ncols()));
        let mut scatter = Array2::zeros((outputs.ncols(), outputs.ncols()));
        for (group, mut mean) in groups.iter().zip(means.rows_mut()) {
            let shown = outputs.select(Axis(0), group);
            mean.assign(&shown.mean_axis(Axis(0)).unwrap_or_default());
            if group.len() > 1 {
                let deviations = &shown - &mean;
                scatter += &deviations.t().dot(&deviations);
            }
        }
        let freedom = contexts.nrows() - groups.len();
        let within = (freedom > 0).then(|| (scatter / freedom as f64, freedom));
        let kept = groups.iter().map(|group| 1.0 / group.len() as f64).sum::<f64>() / groups.len() as f64;
        Ok(Self { columns, scale, inputs, means, within, kept })
    }

    /// Checks the number of contexts of a map whose cost grows with its cube.
    fn check_count(&self, cubic: bool) -> Result<()> {
        if cubic && self.inputs.nrows() > MOST {
            let (name, value) = ("contexts", self.inputs.nrows() as f64);
            let allowed = "different contexts: at most 1024 for this map; round them, or take map=\"linear\"";
            return Err(Error::Range { name, value, allowed });
        }
        Ok(())
    }

    /// The same, of components along axes.
    fn along(self, axes: &Axes) -> Self {
        let within = self.within.map(|(within, freedom)| (axes.scatter(&within), freedom));
        Self { means: axes.components(&self.means), within, ..self }
    }

    fn shown(&self) -> Shown<'_> {
        Shown { inputs: self.inputs.view(), n_inputs: self.scale.n_inputs(), outputs: self.means.view() }
    }

    fn map(self, axes: Axes, candidate: Candidate, errors: Vec<(MapKind, f64)>) -> ContextMap {
        let Candidate { kind, kernel, kriging, values, ratios } = candidate;
        let (noise, freedom) = match (kriging.freedom(), &self.within) {
            // As many coefficients as contexts: what is left is the noise of the averages.
            (0, None) => (None, 0),
            (0, Some((within, freedom))) => (Some(within * self.kept), *freedom),
            (freedom, _) => {
                let innovations = kriging.innovations(&values, &ratios);
                (Some(innovations.t().dot(&innovations) / freedom as f64), freedom)
            }
        };
        let within = self.within.map(|(within, _)| within * (1.0 - self.kept));
        let rest = kriging.coefficients(&values, &ratios);
        let (columns, scale, flat) = (self.columns, self.scale, values.flat);
        ContextMap { columns, scale, kind, kernel, axes, ratios, errors, kriging, flat, rest, noise, within, freedom }
    }
}
