//! Numbers that are kept of each demonstration: O(D + Q) of them.

use ndarray::{Array2, ArrayView2, Axis};

use super::settings::ContextScale;
use crate::context::ContextColumn;
use crate::demonstration::{ContextValue, Demonstration};
use crate::error::{Error, Result};
use crate::learning::targets::Targets;
use crate::validate::check_length;

/// Start, goal, anchor, duration, number of samples, ranges and context of each demonstration.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Summaries {
    pub(super) n_dofs: usize,
    pub(super) starts: Vec<f64>,
    pub(super) goals: Vec<f64>,
    pub(super) anchors: Vec<f64>,
    pub(super) durations: Vec<f64>,
    pub(super) n_recorded: Vec<usize>,
    /// Ranges and duration as recorded (M, D + 1).
    pub(super) magnitudes: Vec<f64>,
    pub(super) contexts: Vec<Values>,
}

/// One value of the context of each demonstration.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Numbers(Vec<f64>),
    /// Different labels in the order of their first appearance, and the index of each demonstration's.
    Labels(Vec<String>, Vec<usize>),
}

impl Summaries {
    /// Returns the summaries of no demonstration.
    pub(super) fn none(n_dofs: usize, contexts: &[ContextScale]) -> Self {
        let contexts = contexts.iter().map(|scale| match scale {
            ContextScale::Number { .. } => Values::Numbers(Vec::new()),
            ContextScale::Label => Values::Labels(Vec::new(), Vec::new()),
        });
        let contexts = contexts.collect();
        let [starts, goals, anchors, durations, magnitudes] = [(); 5].map(|()| Vec::new());
        Self { n_dofs, starts, goals, anchors, durations, n_recorded: Vec::new(), magnitudes, contexts }
    }

    /// Returns the number of demonstrations M.
    pub(super) fn len(&self) -> usize {
        self.durations.len()
    }

    /// Returns vectors (M, D) of the demonstrations, such as their starts.
    pub(super) fn matrix(&self, vectors: &[f64]) -> Array2<f64> {
        Array2::from_shape_fn((self.len(), self.n_dofs), |(m, d)| vectors[m * self.n_dofs + d])
    }

    /// Adds demonstrations with their targets and durations; on an error nothing is added.
    pub(super) fn add(&mut self, demos: &[Demonstration], targets: &Targets, durations: &[f64]) -> Result<()> {
        let width = self.contexts.len();
        for (m, demo) in demos.iter().enumerate() {
            let context = demo.context().unwrap_or_default();
            check_length("context", context.len(), width, "context value, as in the other demonstrations")
                .map_err(|error| error.in_demo(m))?;
            let mismatch = context.iter().zip(&self.contexts).position(|(value, column)| {
                matches!(value, ContextValue::Number(_)) != matches!(column, Values::Numbers(_))
            });
            if let Some(column) = mismatch {
                let labels = usize::from(matches!(context[column], ContextValue::Label(_)));
                return Err(Error::Mixed { column, labels, numbers: 1 - labels }.in_demo(m));
            }
        }
        for (m, demo) in demos.iter().enumerate() {
            for (value, column) in demo.context().unwrap_or_default().iter().zip(&mut self.contexts) {
                column.add_value(value);
            }
            self.durations.push(durations[m]);
            self.n_recorded.push(demo.n_samples());
        }
        self.starts.extend(targets.starts.iter());
        self.goals.extend(targets.goals.iter());
        self.anchors.extend(targets.anchors.iter());
        Ok(())
    }

    /// Adds the demonstrations of others after these.
    pub(super) fn merge(&mut self, other: &Self) {
        self.starts.extend(&other.starts);
        self.goals.extend(&other.goals);
        self.anchors.extend(&other.anchors);
        self.durations.extend(&other.durations);
        self.n_recorded.extend(&other.n_recorded);
        self.magnitudes.extend(&other.magnitudes);
        for (own, others) in self.contexts.iter_mut().zip(&other.contexts) {
            match (own, others) {
                (Values::Numbers(own), Values::Numbers(others)) => own.extend(others),
                (own @ Values::Labels(..), Values::Labels(labels, indices)) => {
                    indices.iter().for_each(|&index| own.add_label(&labels[index]));
                }
                // Settings are equal, and with them the types.
                _ => {}
            }
        }
    }

    /// Returns the ranges and the duration of each demonstration as recorded.
    pub(super) fn magnitudes(&self) -> Vec<Vec<f64>> {
        self.magnitudes.chunks(self.n_dofs + 1).map(<[f64]>::to_vec).collect()
    }

    /// Returns the types of the contexts (Q,) and the contexts as numbers (M, Q); `None` without contexts.
    pub(super) fn tabulated(&self) -> Option<(Vec<ContextColumn>, Array2<f64>)> {
        if self.contexts.is_empty() {
            return None;
        }
        let mut numbers = Array2::zeros((self.len(), self.contexts.len()));
        let columns = self.contexts.iter().zip(numbers.columns_mut()).map(|(values, mut column)| match values {
            Values::Numbers(values) => {
                column.iter_mut().zip(values).for_each(|(number, value)| *number = *value);
                ContextColumn::Number
            }
            Values::Labels(labels, indices) => {
                let mut sorted = labels.clone();
                sorted.sort();
                let position = |label: &String| sorted.partition_point(|other| other < label) as f64;
                let positions: Vec<f64> = labels.iter().map(position).collect();
                column.iter_mut().zip(indices).for_each(|(number, index)| *number = positions[*index]);
                ContextColumn::Label(sorted)
            }
        });
        let columns = columns.collect();
        Some((columns, numbers))
    }

    /// Returns the first of `rows` that is not the start of the demonstration of its index, counted from `first`.
    pub(super) fn differ(&self, first: usize, rows: ArrayView2<f64>) -> Option<usize> {
        let own = |m: usize| self.starts.get((first + m) * self.n_dofs..(first + m + 1) * self.n_dofs);
        rows.axis_iter(Axis(0)).enumerate().position(|(m, row)| own(m).is_none_or(|own| row != ndarray::aview1(own)))
    }
}

impl Values {
    fn add_value(&mut self, value: &ContextValue) {
        match (&mut *self, value) {
            (Self::Numbers(numbers), ContextValue::Number(number)) => numbers.push(*number),
            (Self::Labels(..), ContextValue::Label(label)) => self.add_label(label),
            // The types were compared before.
            _ => {}
        }
    }

    fn add_label(&mut self, label: &String) {
        if let Self::Labels(labels, indices) = self {
            let index = labels.iter().position(|other| other == label).unwrap_or(labels.len());
            if index == labels.len() {
                labels.push(label.clone());
            }
            indices.push(index);
        }
    }
}
