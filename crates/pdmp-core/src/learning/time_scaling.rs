//! Whether a warp of time foresees movements better than linear scaling.
//!
//! The mean square of what is foreseen, over linear time, is least for movements averaged over linear time: a warp pays
//! where contexts tell of the timing, or fewer styles remain, and costs where they do not. Both are tried at contexts held
//! out, with as many principal components of the positions in place of a landscape as the fit has styles.

use ndarray::{Array2, ArrayView1, Axis, s};

use crate::context::{ContextColumn, ContextMap, MapSelection, group_equal_contexts};
use crate::dynamics::time_warp::WarpingFunction;
use crate::error::Result;
use crate::kind::Kind;
use crate::learning::alignment::Aligned;
use crate::learning::factorization::{Factors, Truncation};
use crate::model::sensitivity::STEPS;

/// Most folds that contexts are dealt to, and the fewest different ones.
const FOLDS: usize = 10;
const FEWEST: usize = 3;

/// Contexts (M, Q), how they are mapped, and what gives the number of styles of aligned demonstrations.
pub(super) struct Contexts<'a> {
    pub(super) n_styles: &'a dyn Fn(&Aligned) -> Result<usize>,
    pub(super) columns: &'a [ContextColumn],
    pub(super) numbers: &'a Array2<f64>,
    pub(super) map: MapSelection,
}

impl Contexts<'_> {
    /// Whether the warp of demonstrations lowers the error at contexts held out, by more than its standard error; true
    /// where there are too few contexts to hold one out.
    ///
    /// # Errors
    /// A map that does not suit the contexts, or whatever `progress` returns.
    pub(super) fn favour(
        &self,
        warped: &Aligned,
        linear: &Aligned,
        kind: Kind,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<bool> {
        if group_equal_contexts(self.numbers).len() < FEWEST {
            return Ok(true);
        }
        let recorded = positions(linear, kind)?;
        let mut share = 0.0;
        let mut errors = |aligned: &Aligned| {
            let errors = self.errors(aligned, &recorded, kind, &mut |done| progress(share + 0.5 * done));
            share = 0.5;
            errors
        };
        let (linear, warped) = (errors(linear)?, errors(warped)?);
        let gains: Vec<f64> = linear.iter().zip(&warped).map(|(linear, warped)| linear - warped).collect();
        let gains = ArrayView1::from(&gains);
        Ok(gains.mean().unwrap_or(0.0) > gains.std(1.0) / (gains.len() as f64).sqrt())
    }

    /// Mean squared error over linear time of each condition held out.
    fn errors(
        &self,
        aligned: &Aligned,
        recorded: &Array2<f64>,
        kind: Kind,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Vec<f64>> {
        let positions = positions(aligned, kind)?;
        let n_styles = (self.n_styles)(aligned)?;
        let conditions = group_equal_contexts(self.numbers);
        let n_folds = conditions.len().min(FOLDS);
        let mut errors = Vec::new();
        for fold in 0..n_folds {
            progress(fold as f64 / n_folds as f64)?;
            let held_out: Vec<&Vec<usize>> = conditions.iter().skip(fold).step_by(n_folds).collect();
            let kept: Vec<usize> =
                (0..positions.nrows()).filter(|m| !held_out.iter().any(|group| group.contains(m))).collect();
            let shown = positions.select(Axis(0), &kept);
            let factors = Factors::of(shown.view(), Truncation::Rank(n_styles.min(kept.len())), &mut |_| Ok(()))?;
            let (outputs, metric) = outputs(&factors, &aligned.segment_durations.select(Axis(0), &kept));
            let numbers = self.numbers.select(Axis(0), &kept);
            let map = ContextMap::learn(self.columns.to_vec(), &numbers, outputs.view(), metric.view(), self.map)?;
            for group in held_out {
                let expected = map.expect(&self.numbers.row(group[0]).to_vec());
                let foreseen = foreseen(&expected, &factors, aligned, kind);
                let error = |m: &usize| (&recorded.row(*m) - &foreseen).mapv(|x| x * x).sum();
                errors.push(group.iter().map(error).sum::<f64>() / (group.len() * recorded.ncols()) as f64);
            }
        }
        Ok(errors)
    }
}

/// Positions (M, S·D) over the phase.
fn positions(aligned: &Aligned, kind: Kind) -> Result<Array2<f64>> {
    let n_samples = kind.samples(STEPS);
    let sampled = aligned.clone().resampled(n_samples);
    let mut positions = Array2::zeros((aligned.n_demos(), n_samples * aligned.demo(0).n_dofs()));
    for (m, mut row) in positions.rows_mut().into_iter().enumerate() {
        sampled.sample(m, crate::validate::row_major_mut(&mut row));
    }
    Ok(positions)
}

/// The components and the logarithms of the segment_durations, as the map foresees them, and what errors of them weigh: those of the
/// timing as much as the movement about its mean.
fn outputs(factors: &Factors, segment_durations: &Array2<f64>) -> (Array2<f64>, Array2<f64>) {
    let (n, last) = (factors.styles.ncols(), segment_durations.ncols() - 1);
    let sizes: Vec<f64> = factors.basis.rows().into_iter().map(|row| row.dot(&row)).collect();
    let movement =
        factors.basis.var_axis(Axis(1), 0.0).sum() * factors.basis.ncols() as f64 / segment_durations.nrows() as f64;
    let outputs = Array2::from_shape_fn((segment_durations.nrows(), n + last + 1), |(m, p)| match p.checked_sub(n) {
        None => factors.styles[[m, p]],
        Some(k) if k < last => (segment_durations[[m, k]] / segment_durations[[m, last]]).ln(),
        Some(_) => segment_durations.row(m).sum().ln(),
    });
    let weight = |p: usize| if p < n { sizes[p] } else { movement };
    let weights: ndarray::Array1<f64> = (0..n + last + 1).map(weight).collect();
    let metric = Array2::from_diag(&weights);
    (outputs, metric)
}

/// The movement (S·D) over linear time that is expected.
fn foreseen(expected: &[f64], factors: &Factors, aligned: &Aligned, kind: Kind) -> ndarray::Array1<f64> {
    let (styles, segment_durations) = expected.split_at(factors.styles.ncols());
    let curve = ArrayView1::from(styles).dot(&factors.basis);
    let last = segment_durations.len() - 1;
    if last == 0 {
        return curve;
    }
    let segment_durations: Vec<f64> =
        segment_durations[..last].iter().chain(&[0.0]).map(|logarithm| logarithm.exp()).collect();
    let time = WarpingFunction::new(kind, &aligned.breaks, &segment_durations);
    let n_dofs = aligned.demo(0).n_dofs();
    let n_samples = curve.len() / n_dofs;
    let mut moved = curve.clone();
    for c in 0..n_samples {
        let place = (time.phase(time.duration() * c as f64 / STEPS as f64)[0] * STEPS as f64).max(0.0);
        let (near, share) = (place.floor() as usize, place.fract());
        let row = |c: usize| {
            let c = if kind == Kind::Rhythmic { c % n_samples } else { c.min(n_samples - 1) };
            curve.slice(s![c * n_dofs..(c + 1) * n_dofs])
        };
        moved
            .slice_mut(s![c * n_dofs..(c + 1) * n_dofs])
            .assign(&(&row(near) * (1.0 - share) + &row(near + 1) * share));
    }
    moved
}
