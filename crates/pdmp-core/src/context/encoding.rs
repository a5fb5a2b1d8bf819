//! Encoding of contexts, which consist of numbers and labels, as features.

use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::demonstration::ContextValue;
use crate::demonstration::check_context;
use crate::error::{Error, Result};
use crate::numerics::statistics::extremes;
use crate::validate::{check_finite, check_length, check_range};

/// Type of one context value, common to all contexts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContextColumn {
    /// A number.
    Number,
    /// One of these labels, in alphabetical order.
    Label(Vec<String>),
}

impl ContextColumn {
    /// Infers the type of a column from its values.
    fn infer(column: usize, values: &[&ContextValue]) -> Result<Self> {
        let mut labels: Vec<String> = values
            .iter()
            .filter_map(|value| if let ContextValue::Label(label) = value { Some(label.clone()) } else { None })
            .collect();
        match labels.len() {
            0 => Ok(Self::Number),
            n if n == values.len() => {
                labels.sort();
                labels.dedup();
                Ok(Self::Label(labels))
            }
            n => Err(Error::Mixed { column, labels: n, numbers: values.len() - n }),
        }
    }

    /// Returns a value as a number; a label becomes its index.
    fn number(&self, column: usize, value: &ContextValue) -> Result<f64> {
        match (self, value) {
            (Self::Number, ContextValue::Number(number)) => Ok(*number),
            (Self::Label(labels), ContextValue::Label(label)) => match labels.binary_search(label) {
                Ok(index) => Ok(index as f64),
                Err(_) => Err(unknown_label(column, format!("{label:?}"), labels)),
            },
            (Self::Label(labels), ContextValue::Number(number)) => {
                Err(unknown_label(column, number.to_string(), labels))
            }
            (Self::Number, ContextValue::Label(label)) => {
                Err(Error::NoNumber { column, name: None, label: label.clone() })
            }
        }
    }

    /// Returns the number of features: one for a number, one per label otherwise.
    pub(super) fn n_features(&self) -> usize {
        match self {
            Self::Number => 1,
            Self::Label(labels) => labels.len(),
        }
    }

    /// Returns the value that a number encodes, the inverse of `number`.
    pub(crate) fn value(&self, column: usize, number: f64) -> Result<ContextValue> {
        match self {
            Self::Number => Ok(ContextValue::Number(number)),
            Self::Label(labels) => {
                let label = if number >= 0.0 && number.fract() == 0.0 { labels.get(number as usize) } else { None };
                let label = label.cloned().map(ContextValue::Label);
                label.ok_or_else(|| unknown_label(column, number.to_string(), labels))
            }
        }
    }
}

fn unknown_label(column: usize, value: String, labels: &[String]) -> Error {
    Error::Label { column, name: None, value, known: labels.join(", ") }
}

/// Returns the column types (Q,) of contexts and the contexts as numbers (M, Q), with labels as their indices.
pub(crate) fn tabulate(contexts: &[&[ContextValue]]) -> Result<(Vec<ContextColumn>, Array2<f64>)> {
    if contexts.is_empty() {
        return Err(Error::Argument { name: "contexts", problem: "is empty: pass one row per movement" });
    }
    let width = contexts.iter().map(|context| context.len()).find(|&width| width > 0).unwrap_or(0);
    let per = "context value, as in the other demonstrations";
    for (m, context) in contexts.iter().enumerate() {
        check_length("context", context.len(), width, per).map_err(|error| error.in_demo(m))?;
    }
    for (m, context) in contexts.iter().enumerate() {
        check_context(context).map_err(|error| error.in_demo(m))?;
    }
    let columns = (0..width)
        .map(|q| ContextColumn::infer(q, &contexts.iter().map(|context| &context[q]).collect::<Vec<_>>()))
        .collect::<Result<Vec<_>>>()?;
    let mut table = Array2::zeros((contexts.len(), width));
    for (context, mut row) in contexts.iter().zip(table.rows_mut()) {
        for (q, value) in context.iter().enumerate() {
            row[q] = columns[q].number(q, value)?;
        }
    }
    Ok((columns, table))
}

/// Returns one context as numbers (Q,), with labels as their indices.
pub(super) fn to_numbers(columns: &[ContextColumn], context: &[ContextValue]) -> Result<Vec<f64>> {
    check_length("context", context.len(), columns.len(), "context value")?;
    let numbers: Vec<f64> = columns
        .iter()
        .zip(context)
        .enumerate()
        .map(|(q, (column, value))| column.number(q, value))
        .collect::<Result<_>>()?;
    check_finite("context", &numbers)?;
    Ok(numbers)
}

/// Encoder of contexts as features: numbers are standardised, labels one-hot.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Encoder {
    columns: Vec<ColumnEncoder>,
    n_features: usize,
}

/// Encoder of one column, whose features begin at index `first`.
#[derive(Clone, Debug, PartialEq)]
enum ColumnEncoder {
    /// One feature (h − mean)/deviation, and the demonstrated range of h.
    Standardised { first: usize, mean: f64, deviation: f64, range: [f64; 2] },
    /// One feature per label, which is 1 for that label and 0 for the others.
    OneHot { first: usize, n_labels: usize },
}

impl Encoder {
    /// Fits the encoder to distinct contexts (n, Q), each with equal weight.
    ///
    /// # Errors
    /// A number whose variation is so small or so large that its square underflows or overflows.
    pub(super) fn fit(columns: &[ContextColumn], contexts: &Array2<f64>) -> Result<Self> {
        let mut n_features = 0;
        let encoders = columns.iter().zip(contexts.columns()).map(|(column, values)| {
            let first = n_features;
            n_features += column.n_features();
            match column {
                ContextColumn::Label(labels) => Ok(ColumnEncoder::OneHot { first, n_labels: labels.len() }),
                ContextColumn::Number => {
                    let mean = values.mean().unwrap_or(0.0);
                    let largest = values.fold(0.0f64, |max, value| max.max((value - mean).abs()));
                    let valid = largest == 0.0 || (1e-100..=1e100).contains(&largest);
                    let allowed = "each must vary by 1e-100 to 1e100; give them in another unit";
                    check_range("contexts", largest, valid, allowed)?;
                    let variance = values.map(|value| ((value - mean) / largest.max(1e-100)).powi(2)).mean();
                    let deviation = if largest > 0.0 { largest * variance.unwrap_or(1.0).sqrt() } else { 1.0 };
                    let range = extremes(values.iter().copied());
                    Ok(ColumnEncoder::Standardised { first, mean, deviation, range })
                }
            }
        });
        let columns = encoders.collect::<Result<_>>()?;
        Ok(Self { columns, n_features })
    }

    /// Returns the number of context values Q.
    pub(super) fn n_inputs(&self) -> usize {
        self.columns.len()
    }

    /// Computes the features (F,) of a context (Q,).
    pub(super) fn features(&self, context: &[f64]) -> Vec<f64> {
        let mut features = vec![0.0; self.n_features];
        for (column, &value) in self.columns.iter().zip(context) {
            match *column {
                ColumnEncoder::Standardised { first, mean, deviation, .. } => {
                    features[first] = (value - mean) / deviation;
                }
                ColumnEncoder::OneHot { first, n_labels } => {
                    features[first + (value as usize).min(n_labels - 1)] = 1.0;
                }
            }
        }
        features
    }

    /// Computes the distance of each value (Q,) from the demonstrated range, in units of that range.
    ///
    /// It is 0 within the range and for labels, and infinite for a new value in a column that did not vary.
    pub(super) fn extrapolation(&self, context: &[f64]) -> Vec<f64> {
        let distance = |column: &ColumnEncoder, value: f64| match *column {
            ColumnEncoder::OneHot { .. } => 0.0,
            ColumnEncoder::Standardised { range: [low, high], .. } => {
                let excess = (low - value).max(value - high).max(0.0);
                if excess > 0.0 { excess / (high - low) } else { 0.0 }
            }
        };
        self.columns.iter().zip(context).map(|(column, &value)| distance(column, value)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn context(label: &str, number: f64) -> Vec<ContextValue> {
        vec![label.into(), number.into()]
    }

    /// Labels are encoded one-hot, and numbers are centred; only numbers extrapolate.
    #[test]
    fn contexts_are_encoded_as_features() {
        let demonstrated = [context("old", 1.0), context("young", 3.0), context("old", 5.0)];
        let (columns, table) = tabulate(&demonstrated.each_ref().map(Vec::as_slice)).unwrap();
        let encoder = Encoder::fit(&columns, &table).unwrap();
        let numbers = to_numbers(&columns, &context("young", 3.0)).unwrap();
        assert_eq!(encoder.features(&numbers), [0.0, 1.0, 0.0]);
        assert_eq!(encoder.extrapolation(&[0.0, 7.0]), [0.0, 0.5]);
        assert_eq!(encoder.extrapolation(&[1.0, 1.0]), [0.0, 0.0]);
    }

    /// The error for an unknown label lists the known ones.
    #[test]
    fn contexts_of_another_type_are_rejected() {
        let (columns, _) = tabulate(&[&context("old", 1.0), &context("young", 3.0)]).unwrap();
        let message = |context: &[ContextValue]| to_numbers(&columns, context).unwrap_err().to_string();
        assert!(message(&context("proud", 1.0)).contains("\"proud\": not demonstrated; the labels are old, young"));
        assert!(message(&[1.0.into(), 1.0.into()]).contains("context[0] = 1: not demonstrated"));
        assert!(message(&["old".into(), "young".into()]).contains("context[1] = \"young\": a number is expected"));
        assert!(message(&["old".into()]).contains("length 1, expected 2"));
        let mixed = tabulate(&[&context("old", 1.0), &[1.0.into(), 1.0.into()]]).unwrap_err().to_string();
        assert!(mixed.contains("1 label and 1 number"), "{mixed}");
    }
}
