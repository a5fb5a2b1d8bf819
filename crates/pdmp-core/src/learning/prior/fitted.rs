//! Comparison of demonstrations with those of a fit.

use std::sync::Arc;

use ndarray::{Array1, Array2, ArrayView2, Axis};

use crate::demonstration::check_labels;
use crate::demonstration::{Demonstration, Sampling};
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::alignment::Alignment;
use crate::learning::rotations::about_means;
use crate::learning::targets::Targets;
use crate::model::Model;
use crate::numerics::smoothing_spline::Smoothing;
use crate::numerics::threads::Threads;

/// Largest difference of durations, and of starts, goals and anchors relative to the range of the DoF. Numbers rounded to
/// three digits differ less.
const MAX_DIFFERENCE: f64 = 5e-3;
/// Largest difference of the forcing of a style from that of the fit, relative to the deviation of the forcing of the
/// demonstrations from their mean. Two neighbours of fourteen demonstrations that cover a range evenly differ by 0.27.
const MAX_STYLE_DIFFERENCE: f64 = 0.2;
/// Least deviation of the forcing from its mean, relative to the forcing: equal demonstrations have none.
const MIN_DEVIATION: f64 = 1e-3;

/// Returns the demonstrations of a fit with what a fit of some of them needs: positions, sampling, goals and rotations.
///
/// # Errors
/// Demonstrations other than those of the model, in their order.
pub(super) fn fitted(model: &Model, demos: &[Demonstration], threads: Threads) -> Result<Vec<Demonstration>> {
    let bare = |(m, demo): (usize, &Demonstration)| bare(model, m, demo).map_err(|error| error.in_demo(m));
    let bare = demos.iter().enumerate().map(bare).collect::<Result<Vec<_>>>()?;
    let inside = Model { primitive: Arc::clone(model.primitive().inside()), ..model.clone() };
    let in_dofs = in_dofs(model, &bare)?;
    let periods = match model.kind() {
        Kind::Discrete => Vec::new(),
        Kind::Rhythmic => model.demonstrated().durations.clone(),
    };
    let alignment = Alignment {
        kind: model.kind(),
        dt: None,
        period: periods,
        smoothing: Smoothing::Interpolate,
        nominal: None,
        n_samples: Some(model.learnt.n_samples),
        vectors: Vec::new(),
    };
    let mut aligned = alignment.align(in_dofs.as_deref().unwrap_or(&bare), threads)?;
    aligned.noise = model.learnt.noise.clone();
    let mut targets = Targets::of(&aligned, inside.attractor, inside.canonical(), threads, &mut |_| Ok(()))?;
    let demonstrated = model.demonstrated();
    let positions = match model.kind() {
        Kind::Discrete => {
            vec![("start", &targets.starts, &demonstrated.starts), ("goal", &targets.goals, &demonstrated.goals)]
        }
        Kind::Rhythmic => vec![("anchor", &targets.anchors, &demonstrated.anchors)],
    };
    for (name, found, expected) in positions {
        check_positions(name, found, expected, inside.ranges())?;
    }
    targets.carry(&inside.transport, inside.attractor, inside.canonical());
    targets.scale(&inside.learnt.dof_scale);
    check_styles(targets.forcing.view(), &demonstrated.styles, &model.learnt.singular_values)?;
    Ok(bare)
}

/// Returns demonstration `m` with a sampling interval, the rotations and units of the model, and its goal.
///
/// # Errors
/// Other names or units than those of the model, or another duration than in the fit.
fn bare(model: &Model, m: usize, demo: &Demonstration) -> Result<Demonstration> {
    let own = [model.primitive().coordinate_names(), model.primitive().coordinate_units()];
    check_labels("names", demo.names(), own[0], "the model")?;
    check_labels("units", demo.units(), own[1], "the model")?;
    let expected = model.demonstrated().durations[m];
    let n_steps = model.kind().steps(demo.n_samples()) as f64;
    let other = |found: f64| Err(Error::other_demonstration("duration", None, [found, expected]));
    let sampling = match demo.sampling() {
        Sampling::Unknown => Sampling::Uniform { dt: expected / n_steps },
        known => known.clone(),
    };
    let last = match &sampling {
        Sampling::Stamped { time } => time[time.len() - 1] - time[0],
        Sampling::Uniform { dt } => dt * (demo.n_samples() - 1) as f64,
        Sampling::Unknown => expected,
    };
    match model.kind() {
        Kind::Discrete if (last - expected).abs() > MAX_DIFFERENCE * expected => return other(last),
        // A period is not part of the recording, but longer.
        Kind::Rhythmic if last >= expected => return other(last),
        _ => {}
    }
    let mut bare = Demonstration::new(demo.position().to_owned(), sampling)?;
    if let Some(coordinates) = model.primitive().coordinates() {
        bare = bare.with_rotations(coordinates.columns())?.with_units(coordinates.units().to_vec())?;
    }
    demo.goal().map_or(Ok(bare.clone()), |goal| bare.with_goal(goal.to_vec()))
}

/// Returns demonstrations with rotations in the degrees of freedom of the model; `None` without rotations.
///
/// # Errors
/// A rotation half a turn from the mean.
fn in_dofs(model: &Model, demos: &[Demonstration]) -> Result<Option<Vec<Demonstration>>> {
    let Some(coordinates) = model.primitive().coordinates() else { return Ok(None) };
    let of = |(m, demo): (usize, &Demonstration)| {
        let duration = model.demonstrated().durations[m];
        let phase = |c: usize| match demo.sampling() {
            Sampling::Stamped { time } => (time[c] - time[0]) / duration,
            _ => c as f64 / model.kind().steps(demo.n_samples()) as f64,
        };
        let phases: Vec<f64> = (0..demo.n_samples()).map(phase).collect();
        about_means(demo, coordinates, &phases).map_err(|error| error.in_demo(m))
    };
    demos.iter().enumerate().map(of).collect::<Result<Vec<_>>>().map(Some)
}

/// Checks starts, goals or anchors (M, D) against those of the fit.
///
/// # Errors
/// A difference above rounding, relative to the ranges (D,).
fn check_positions(name: &'static str, found: &Array2<f64>, expected: &Array2<f64>, ranges: &[f64]) -> Result<()> {
    let widest = ranges.iter().fold(0.0f64, |widest, range| widest.max(*range));
    for ((m, d), &found) in found.indexed_iter() {
        let expected = expected[[m, d]];
        let range = ranges[d].max(MAX_DIFFERENCE * widest);
        if (found - expected).abs() > MAX_DIFFERENCE * range.max(MAX_DIFFERENCE * expected.abs()) {
            return Err(Error::other_demonstration(name, Some(d), [found, expected]).in_demo(m));
        }
    }
    Ok(())
}

/// Checks that styles S (M, J) are those of targets F (M, C·D) with the singular values σ (J,): the forcing F·vⱼ along each
/// basis target is σⱼ·Sⱼ, with the orthonormal vⱼ of FᵀS·diag(σ)⁻¹.
///
/// # Errors
/// A demonstration whose style differs from that of the fit: that with the largest difference.
fn check_styles(forcing: ArrayView2<f64>, styles: &Array2<f64>, singular_values: &[f64]) -> Result<()> {
    let sizes: Array1<f64> = singular_values[..styles.ncols()].to_vec().into();
    let directions = orthonormal(styles.t().dot(&forcing), 1e-9 * sizes.iter().fold(0.0f64, |most, s| most.max(*s)));
    let (found, expected) = (forcing.dot(&directions.t()), styles * &sizes);
    let size = |forcing: &Array2<f64>| (forcing.iter().map(|f| f * f).sum::<f64>() / forcing.nrows() as f64).sqrt();
    let deviations = &expected - &expected.mean_axis(Axis(0)).unwrap_or_default();
    let deviation = size(&deviations).max(MIN_DEVIATION * size(&expected));
    let differences = &found - &expected;
    let distances = differences.map_axis(Axis(1), |difference| difference.dot(&difference).sqrt());
    let farthest = (0..distances.len()).max_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap_or_default();
    if distances[farthest] <= MAX_STYLE_DIFFERENCE * deviation {
        return Ok(());
    }
    let difference = differences.row(farthest);
    let by_size = |a: &usize, b: &usize| difference[*a].abs().total_cmp(&difference[*b].abs());
    let j = (0..sizes.len()).max_by(by_size).unwrap_or_default();
    let numbers = [found[[farthest, j]] / sizes[j], styles[[farthest, j]]];
    Err(Error::other_demonstration("style", Some(j), numbers).in_demo(farthest))
}

/// Returns orthonormal rows (J, N) of the same spans as the first rows of a matrix, and 0 for rows that are not longer than
/// `least` outside of the span of those before.
fn orthonormal(mut rows: Array2<f64>, least: f64) -> Array2<f64> {
    for j in 0..rows.nrows() {
        let (before, mut rest) = rows.view_mut().split_at(Axis(0), j);
        let mut row = rest.row_mut(0);
        // The second pass removes the rounding errors of the first.
        for _ in 0..2 {
            for other in before.rows() {
                let along = other.dot(&row);
                row.scaled_add(-along, &other);
            }
        }
        let length = row.dot(&row).sqrt();
        row.mapv_inplace(|x| if length > least { x / length } else { 0.0 });
    }
    rows
}
