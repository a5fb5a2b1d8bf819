//! Folds of a cross-validation over the contexts.

use ndarray::Array2;

use crate::context::group_equal_contexts;

/// Largest number of folds.
const MAX_FOLDS: usize = 10;
/// Smallest number of different contexts.
const MIN_CONTEXTS: usize = 3;

/// Demonstrations of one fold, by index.
pub(super) struct Fold {
    /// Demonstrations to learn from.
    pub(super) training: Vec<usize>,
    /// Held-out demonstrations, grouped by equal contexts.
    pub(super) held_out: Vec<Vec<usize>>,
}

/// Divides demonstrations with contexts (M, Q) into at most ten folds, so that equal contexts are in one fold.
///
/// Returns `None` if there are fewer than three different contexts.
pub(super) fn folds(contexts: &Array2<f64>) -> Option<Vec<Fold>> {
    let groups = group_equal_contexts(contexts);
    let n_folds = groups.len().min(MAX_FOLDS);
    let fold = |first: usize| {
        let held_out: Vec<Vec<usize>> = groups.iter().skip(first).step_by(n_folds).cloned().collect();
        let training = (0..contexts.nrows()).filter(|m| !held_out.iter().any(|group| group.contains(m))).collect();
        Fold { training, held_out }
    };
    (groups.len() >= MIN_CONTEXTS).then(|| (0..n_folds).map(fold).collect())
}
