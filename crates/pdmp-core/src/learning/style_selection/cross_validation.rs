//! How many styles: as few as foresee movements in contexts held out about as well as any number does.
//!
//! No landscape is learnt for that. With F = S·Σ·Vᵀ of all demonstrations, the factors of some of them are those of
//! their rows of S·Σ; and as movements are linear in their styles and SᵀS = I, what each style moves is Rⱼ = Σ sᵐⱼ yᵐ,
//! summed over the demonstrations, of what goal and start, or anchor, leave of their positions y.

use ndarray::{Array1, Array2, Array3, ArrayView1, ArrayView2, Axis, Zip, s};

use crate::context::{ContextColumn, ContextMap, MapSelection, group_equal_contexts, outputs};
use crate::dynamics::canonical::Canonical;
use crate::dynamics::output_system::{Attractor, State};
use crate::dynamics::transport::Transport;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::alignment::Aligned;
use crate::learning::factorization::{Factors, Truncation};
use crate::learning::targets::Targets;
use crate::model::responses::Curves;
use crate::model::sensitivity::{STEPS, Sensitivity};

/// Most folds that contexts are dealt to, and the fewest different ones.
const FOLDS: usize = 10;
const FEWEST: usize = 3;

/// Demonstrations, of which some are to be foreseen from the others.
pub(crate) struct StyleSelection<'a> {
    kind: Kind,
    shown: &'a Targets,
    factors: &'a Factors,
    segment_durations: ArrayView2<'a, f64>,
    /// The way back from a start of one, over the phase (S,).
    start: Array1<f64>,
    /// Positions (M, S, D) less what goal and start, or anchor, make of them.
    moved: Array3<f64>,
}

impl<'a> StyleSelection<'a> {
    /// `factors` are all factors of the targets of the demonstrations shown.
    pub(crate) fn new(
        aligned: &'a Aligned,
        shown: &'a Targets,
        factors: &'a Factors,
        transport: &Transport,
        attractor: Attractor,
        canonical: Canonical,
    ) -> Result<Self> {
        let kind = canonical.kind();
        let n_samples = kind.samples(STEPS);
        let step = attractor.propagator(canonical.extent() / STEPS as f64).transition;
        let back = |State { e, z }| State { e: step[0][0] * e + step[0][1] * z, z: step[1][0] * e + step[1][1] * z };
        let way = std::iter::successors(Some(State { e: 1.0, z: 0.0 }), |state| Some(back(*state)));
        let start: Array1<f64> = match kind {
            Kind::Discrete => {
                // What the frame does not carry comes back as the paper has it.
                let free = 1.0 + transport.lag(0.0).value;
                let clock = canonical.clock(n_samples).into_iter();
                way.zip(clock).map(|(state, u)| free * state.e - transport.lag(u).value).collect()
            }
            Kind::Rhythmic => Array1::zeros(n_samples),
        };
        let sampled = aligned.clone().resampled(n_samples);
        let mut moved = Array3::zeros((shown.starts.nrows(), n_samples, shown.starts.ncols()));
        for (m, mut moved) in moved.outer_iter_mut().enumerate() {
            sampled.sample(m, crate::validate::row_major_mut(&mut moved));
        }
        let mut foresight =
            Self { kind, shown, factors, segment_durations: aligned.segment_durations.view(), start, moved };
        for m in 0..shown.starts.nrows() {
            let places = foresight.places(foresight.centres().row(m).to_vec(), shown.starts.row(m).to_vec());
            let mut moved = foresight.moved.index_axis_mut(Axis(0), m);
            moved -= &places;
        }
        Ok(foresight)
    }

    /// The fewest styles whose error at contexts held out is above the least by no more than its standard error.
    ///
    /// # Errors
    /// Fewer than three different contexts, a map that does not suit them, or whatever `progress` returns.
    pub(crate) fn styles(
        &self,
        columns: &[ContextColumn],
        contexts: &Array2<f64>,
        choice: MapSelection,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<usize> {
        let conditions = group_equal_contexts(contexts);
        if conditions.len() < FEWEST {
            return Err(Error::Arguments(
                "n_styles = \"auto\" needs at least three different contexts: pass a number, or None to go by the spectrum",
            ));
        }
        let n_folds = conditions.len().min(FOLDS);
        let mut errors: Vec<Vec<f64>> = Vec::new();
        for fold in 0..n_folds {
            progress(fold as f64 / n_folds as f64)?;
            let of_fold = |(i, group)| if i % n_folds == fold { Some(group) } else { None };
            let held_out: Vec<&Vec<usize>> = conditions.iter().enumerate().filter_map(of_fold).collect();
            let kept: Vec<usize> =
                (0..contexts.nrows()).filter(|m| !held_out.iter().any(|group| group.contains(m))).collect();
            errors.extend(self.errors(&kept, &held_out, columns, contexts, choice)?);
        }
        Ok(fewest(&errors))
    }

    /// Mean squared errors (J,) with one style, two, and so on, of each condition held out.
    fn errors(
        &self,
        kept: &[usize],
        held_out: &[&Vec<usize>],
        columns: &[ContextColumn],
        contexts: &Array2<f64>,
        choice: MapSelection,
    ) -> Result<Vec<Vec<f64>>> {
        let of = |rows: &Array2<f64>| rows.select(Axis(0), kept);
        let sizes = ArrayView1::from(&self.factors.singular_values[..self.factors.styles.ncols()]);
        let weights = of(&self.factors.styles) * sizes;
        let styles = Factors::of(weights.view(), Truncation::Share(1.0), &mut |_| Ok(()))?.styles;
        let moved = self.moved.select(Axis(0), kept);
        let response = |style: ArrayView1<f64>| Zip::from(moved.lanes(Axis(0))).map_collect(|lane| lane.dot(&style));
        let (n_samples, n_dofs) = (self.start.len(), self.shown.starts.ncols());
        let start = Array2::from_shape_fn((n_samples, n_dofs), |(k, _)| self.start[k]);
        let velocity = Array2::zeros(start.dim());
        let curves = Curves { styles: styles.columns().into_iter().map(response).collect(), start, velocity };

        let [goals, starts, anchors] = [&self.shown.goals, &self.shown.starts, &self.shown.anchors].map(of);
        let segment_durations = self.segment_durations.select(Axis(0), kept);
        let places = [goals.view(), starts.view(), anchors.view()];
        let outputs = outputs(self.kind, styles.view(), places, segment_durations.view());
        let metric = Sensitivity::new(self.kind, &curves, Vec::new()).metric(outputs.view(), segment_durations.view());
        let map = ContextMap::learn(columns.to_vec(), &of(contexts), outputs.view(), metric.view(), choice)?;

        let foreseen = |group: &&Vec<usize>| {
            let expected = map.expect(&contexts.row(group[0]).to_vec());
            let (style, places) = expected.split_at(curves.styles.len());
            let (centre, start) = places.split_at(n_dofs);
            // A cycle has no start: what follows its anchor is its timing, for which `places` has no use.
            let start = if self.kind == Kind::Discrete { &start[..n_dofs] } else { centre };
            let foreseen = self.places(centre.to_vec(), start.to_vec());
            let mut errors = vec![0.0; style.len()];
            for &m in *group {
                let own = self.places(self.centres().row(m).to_vec(), self.shown.starts.row(m).to_vec());
                let mut left = &self.moved.index_axis(Axis(0), m) + &own - &foreseen;
                for ((error, s), curve) in errors.iter_mut().zip(style).zip(&curves.styles) {
                    left.scaled_add(-s, curve);
                    *error += left.iter().map(|x| x * x).sum::<f64>() / (n_samples * group.len()) as f64;
                }
            }
            errors
        };
        Ok(held_out.iter().map(foreseen).collect())
    }

    fn centres(&self) -> &Array2<f64> {
        match self.kind {
            Kind::Discrete => &self.shown.goals,
            Kind::Rhythmic => &self.shown.anchors,
        }
    }

    /// Positions (S, D) of a movement without style.
    fn places(&self, centre: Vec<f64>, start: Vec<f64>) -> Array2<f64> {
        Array2::from_shape_fn((self.start.len(), centre.len()), |(k, d)| {
            centre[d] + (start[d] - centre[d]) * self.start[k]
        })
    }
}

/// The fewest of so many styles whose error is, over the conditions, above the least by no more than the standard error
/// of the difference.
fn fewest(errors: &[Vec<f64>]) -> usize {
    let (n, most) = (errors.len() as f64, errors.iter().map(Vec::len).min().unwrap_or(1));
    let errors = Array2::from_shape_fn((errors.len(), most), |(i, j)| errors[i][j]);
    let means = errors.mean_axis(Axis(0)).unwrap_or_default();
    let best = (0..most).min_by(|&i, &j| means[i].total_cmp(&means[j])).unwrap_or(0);
    let close = |j: &usize| {
        let more = &errors.slice(s![.., *j]) - &errors.slice(s![.., best]);
        more.mean().unwrap_or(0.0) <= more.std(1.0) / n.sqrt()
    };
    1 + (0..best).find(close).unwrap_or(best)
}
