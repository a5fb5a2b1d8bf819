//! What a condition is described by: numbers, and labels such as the name of a style.

use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::demonstration::ContextValue;
use crate::demonstration::check_context;
use crate::error::{Error, Result};
use crate::validate::check_finite;

/// What one value of every context means.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContextColumn {
    /// A number.
    Number,
    /// One of these labels, in alphabetical order.
    Label(Vec<String>),
}

impl ContextColumn {
    /// Reads one value of all contexts.
    fn of(column: usize, values: &[&ContextValue]) -> Result<Self> {
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

    /// A value as a number: labels as their index.
    fn number(&self, column: usize, value: &ContextValue) -> Result<f64> {
        match (self, value) {
            (Self::Number, ContextValue::Number(number)) => Ok(*number),
            (Self::Label(known), ContextValue::Label(label)) => {
                let found = known.binary_search(label).ok();
                found.map(|index| index as f64).ok_or_else(|| unknown(column, format!("{label:?}"), known))
            }
            (Self::Label(known), ContextValue::Number(number)) => Err(unknown(column, number.to_string(), known)),
            (Self::Number, ContextValue::Label(label)) => Err(Error::NoNumber { column, label: label.clone() }),
        }
    }

    /// Number of features that it gives: one, or one per label.
    pub(crate) fn n_features(&self) -> usize {
        match self {
            Self::Number => 1,
            Self::Label(labels) => labels.len(),
        }
    }

    /// The value that a number stands for.
    pub(crate) fn value(&self, column: usize, number: f64) -> Result<ContextValue> {
        match self {
            Self::Number => Ok(ContextValue::Number(number)),
            Self::Label(known) => {
                let label = if number >= 0.0 && number.fract() == 0.0 { known.get(number as usize) } else { None };
                label.cloned().map(ContextValue::Label).ok_or_else(|| unknown(column, number.to_string(), known))
            }
        }
    }
}

fn unknown(column: usize, value: String, known: &[String]) -> Error {
    Error::Label { column, value, known: known.join(", ") }
}

/// Contexts of demonstrations as numbers (M, Q), labels as their index, with what each column means.
pub(crate) fn tabulate(contexts: &[&[ContextValue]]) -> Result<(Vec<ContextColumn>, Array2<f64>)> {
    if contexts.is_empty() {
        return Err(Error::Arguments("contexts is empty: pass one row per movement"));
    }
    let width = contexts.iter().map(|context| context.len()).find(|&width| width > 0).unwrap_or(0);
    if let Some(m) = contexts.iter().position(|context| context.len() != width) {
        let (found, per) = (contexts[m].len(), "context value, as in the other demonstrations");
        return Err(Error::Length { name: "context", expected: width, found, per }.in_demo(m));
    }
    for (m, context) in contexts.iter().enumerate() {
        check_context(context).map_err(|error| error.in_demo(m))?;
    }
    let columns = (0..width)
        .map(|q| ContextColumn::of(q, &contexts.iter().map(|context| &context[q]).collect::<Vec<_>>()))
        .collect::<Result<Vec<_>>>()?;
    let mut table = Array2::zeros((contexts.len(), width));
    for (context, mut row) in contexts.iter().zip(table.rows_mut()) {
        for (q, value) in context.iter().enumerate() {
            row[q] = columns[q].number(q, value)?;
        }
    }
    Ok((columns, table))
}

/// One context as numbers (Q,), labels as their index.
pub(crate) fn numbers(columns: &[ContextColumn], context: &[ContextValue]) -> Result<Vec<f64>> {
    if context.len() != columns.len() {
        let (expected, found) = (columns.len(), context.len());
        return Err(Error::Length { name: "context", expected, found, per: "context value" });
    }
    let numbers: Vec<f64> = columns
        .iter()
        .zip(context)
        .enumerate()
        .map(|(q, (column, value))| column.number(q, value))
        .collect::<Result<_>>()?;
    check_finite("context", &numbers)?;
    Ok(numbers)
}

/// The scale on which contexts are compared: every number by its spread, every label by itself.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scale {
    columns: Vec<Entry>,
    n_features: usize,
}

/// Where the features of a column begin, and how they come about.
#[derive(Clone, Debug, PartialEq)]
enum Entry {
    /// (h − centre)/spread, and the range that was shown.
    Number { first: usize, centre: f64, spread: f64, range: [f64; 2] },
    /// One of so many: one where the label is, zero elsewhere.
    Label { first: usize, count: usize },
}

impl Scale {
    /// The scale of distinct contexts (n, Q), each of which counts once.
    ///
    /// # Errors
    /// A number that varies so little or so much that its square leaves the range of numbers.
    pub(crate) fn of(columns: &[ContextColumn], contexts: &Array2<f64>) -> Result<Self> {
        let mut first = 0;
        let entries = columns.iter().zip(contexts.columns()).map(|(column, values)| {
            let begin = first;
            match column {
                ContextColumn::Label(labels) => {
                    first += labels.len();
                    Ok(Entry::Label { first: begin, count: labels.len() })
                }
                ContextColumn::Number => {
                    first += 1;
                    let centre = values.mean().unwrap_or(0.0);
                    let spread = values.fold(0.0f64, |most, value| most.max((value - centre).abs()));
                    if spread > 0.0 && !(1e-100..=1e100).contains(&spread) {
                        let allowed = "each must vary by 1e-100 to 1e100; give them in another unit";
                        return Err(Error::Range { name: "contexts", value: spread, allowed });
                    }
                    let deviation = values.map(|value| ((value - centre) / spread.max(1e-100)).powi(2)).mean();
                    let spread = if spread > 0.0 { spread * deviation.unwrap_or(1.0).sqrt() } else { 1.0 };
                    let range = [f64::INFINITY, f64::NEG_INFINITY];
                    let range = values.iter().fold(range, |[low, high], &value| [low.min(value), high.max(value)]);
                    Ok(Entry::Number { first: begin, centre, spread, range })
                }
            }
        });
        let columns = entries.collect::<Result<_>>()?;
        Ok(Self { columns, n_features: first })
    }

    /// Number of features.
    pub(crate) fn n_features(&self) -> usize {
        self.n_features
    }

    /// Number of context values Q.
    pub(crate) fn n_inputs(&self) -> usize {
        self.columns.len()
    }

    /// The features of a context (Q,).
    pub(crate) fn features(&self, context: &[f64]) -> Vec<f64> {
        let mut features = vec![0.0; self.n_features];
        for (entry, &value) in self.columns.iter().zip(context) {
            match *entry {
                Entry::Number { first, centre, spread, .. } => features[first] = (value - centre) / spread,
                Entry::Label { first, count } => features[first + (value as usize).min(count - 1)] = 1.0,
            }
        }
        features
    }

    /// How far each value lies outside of what was shown, in ranges of what was shown: 0 inside, and for a label;
    /// infinite where a value that was never varied differs.
    pub(crate) fn outside(&self, context: &[f64]) -> Vec<f64> {
        let beyond = |entry: &Entry, value: f64| match *entry {
            Entry::Label { .. } => 0.0,
            Entry::Number { range: [low, high], .. } => {
                let excess = (low - value).max(value - high).max(0.0);
                if excess > 0.0 { excess / (high - low) } else { 0.0 }
            }
        };
        self.columns.iter().zip(context).map(|(entry, &value)| beyond(entry, value)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn context(label: &str, number: f64) -> Vec<ContextValue> {
        vec![label.into(), number.into()]
    }

    /// Labels are told apart, and a number is compared by its spread.
    #[test]
    fn contexts_become_features() {
        let shown = [context("old", 1.0), context("young", 3.0), context("old", 5.0)];
        let (columns, table) = tabulate(&shown.each_ref().map(Vec::as_slice)).unwrap();
        let scale = Scale::of(&columns, &table).unwrap();
        let numbers = numbers(&columns, &context("young", 3.0)).unwrap();
        assert_eq!(scale.features(&numbers), [0.0, 1.0, 0.0]);
        assert_eq!(scale.outside(&[0.0, 7.0]), [0.0, 0.5]);
        assert_eq!(scale.outside(&[1.0, 1.0]), [0.0, 0.0]);
    }

    /// What was never shown is refused, with what was.
    #[test]
    fn strangers_are_refused() {
        let (columns, _) = tabulate(&[&context("old", 1.0), &context("young", 3.0)]).unwrap();
        let refusal = |context: &[ContextValue]| numbers(&columns, context).unwrap_err().to_string();
        assert!(refusal(&context("proud", 1.0)).contains("\"proud\": not demonstrated; the labels are old, young"));
        assert!(refusal(&[1.0.into(), 1.0.into()]).contains("context[0] = 1: not demonstrated"));
        assert!(refusal(&["old".into(), "young".into()]).contains("context[1] = \"young\": a number is expected"));
        assert!(refusal(&["old".into()]).contains("length 1, expected 2"));
        let mixed = tabulate(&[&context("old", 1.0), &[1.0.into(), 1.0.into()]]).unwrap_err().to_string();
        assert!(mixed.contains("1 labels and 1 numbers"), "{mixed}");
    }
}
