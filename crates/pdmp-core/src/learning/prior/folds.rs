//! Folds of demonstrations for simulated recognition.

use crate::error::{Error, Result};
use crate::inference::prior::MIN_DEMOS;
use crate::validate::check_length;

/// Largest number of folds.
const MAX_FOLDS: usize = 10;
/// Largest number of held-out demonstrations: more refine the factors of the bands little.
const MAX_HELD_OUT: usize = 40;

/// Demonstrations of one fold, by index.
pub(super) struct Fold {
    pub(super) training: Vec<usize>,
    pub(super) held_out: Vec<usize>,
}

/// Divides M demonstrations into at most ten folds, with each group in one of them.
///
/// # Errors
/// A number of groups other than M, a single one, or one that leaves fewer than three demonstrations.
pub(super) fn folds(n_demos: usize, groups: Option<&[usize]>) -> Result<Vec<Fold>> {
    let own: Vec<usize> = (0..n_demos).collect();
    let groups = groups.unwrap_or(&own);
    check_length("groups", groups.len(), n_demos, "demonstration")?;
    let mut names = groups.to_vec();
    names.sort_unstable();
    names.dedup();
    let n_folds = names.len().min(MAX_FOLDS);
    if n_folds < 2 {
        return Err(Error::Argument { name: "groups", problem: "are one: pass at least two, or none" });
    }
    let step = n_demos.div_ceil(MAX_HELD_OUT);
    let fold = |k: usize| {
        let is_held_out =
            |m: &usize| names.iter().position(|name| *name == groups[*m]).is_some_and(|n| n % n_folds == k);
        let (held_out, training): (Vec<usize>, Vec<usize>) = (0..n_demos).partition(is_held_out);
        Fold { training, held_out: held_out.into_iter().step_by(step).collect() }
    };
    let folds: Vec<Fold> = (0..n_folds).map(fold).collect();
    if folds.iter().any(|fold| fold.training.len() < MIN_DEMOS) {
        let problem = "leave fewer than three demonstrations to learn from: pass smaller groups";
        return Err(Error::Argument { name: "groups", problem });
    }
    Ok(folds)
}
