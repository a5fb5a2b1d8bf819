//! Rotations in demonstrations: their mean path, and the residual rotations about it as degrees of freedom.

use std::ops::Range;
use std::sync::Arc;

use ndarray::{Array2, ArrayView1};

use super::alignment::{Alignment, Timing};
use super::constants::Constants;
use super::fit::labels_of;
use super::mean_path::{Recording, mean_path};
use super::options::{DofScaling, FitOptions};
use super::rotation_timing::largest_distance;
use crate::demonstration::{Demonstration, RotationColumns, check_rotations, points};
use crate::dynamics::mean_rotation::{MAX_CELLS, MeanRotation};
use crate::error::{Error, Result, RotationError};
use crate::model::Primitive;
use crate::model::coordinates::{Coordinates, Frame, layout};
use crate::model::finding::Finding;
use crate::numerics::rotation::{Quaternion, Vector, add_scaled, distance, dot, inverse, log, log_near, product};
use crate::numerics::smoothing_spline::Smoothing;

/// Residual rotation that is reported: beyond it the residuals are distorted by a tenth or more.
const MAX_PLAIN_RESIDUAL: f64 = std::f64::consts::FRAC_PI_2;
/// Residual rotation that is refused, near half a turn.
const MAX_RESIDUAL: f64 = std::f64::consts::PI - 1e-6;
/// Number of phases at which deviations from the mean are compared.
const COMPARED: usize = 64;

/// Demonstrations in degrees of freedom, with the mean of each rotation.
pub(super) struct Residuals {
    /// Demonstrations whose columns are the degrees of freedom.
    pub(super) demos: Vec<Demonstration>,
    pub(super) findings: Vec<Finding>,
    names: Vec<String>,
    units: Vec<String>,
    means: Vec<(RotationColumns, MeanRotation)>,
    /// First DoF of each rotation.
    dofs: Vec<usize>,
    /// Largest angle of each rotation from the start of a demonstration.
    ranges: Vec<f64>,
    /// Point of each pose, and its largest distance from the start of a demonstration.
    points: Vec<(Range<usize>, f64)>,
    /// Phases of the samples of each demonstration.
    phases: Vec<Vec<f64>>,
}

impl Residuals {
    /// Returns the demonstrations in degrees of freedom; `None` if they have no rotations.
    ///
    /// # Errors
    /// A rotation of more than 50° between samples, or a residual rotation of half a turn.
    pub(super) fn of(demos: &[Demonstration], options: &FitOptions, timing: Option<&Timing>) -> Result<Option<Self>> {
        let columns = demos.first().map_or(&[][..], Demonstration::rotations);
        if columns.is_empty() {
            return Ok(None);
        }
        let alignment = Alignment { smoothing: Smoothing::Interpolate, ..options.alignment() };
        let mut aligned = alignment.align(demos, options.threads)?;
        if let Some(timing) = timing {
            aligned.set_timing(timing.clone());
        }
        let canonical = Constants::of(options, &aligned)?.canonical;
        let durations = aligned.durations();
        let seconds: Vec<Vec<f64>> = (0..demos.len()).map(|m| aligned.seconds(m)).collect();
        let parts = canonical.kind().steps(aligned.n_samples).min(MAX_CELLS);
        let mut means = Vec::with_capacity(columns.len());
        let mut ranges = Vec::with_capacity(columns.len());
        for &rotation in columns {
            let recordings: Vec<Recording> = demos
                .iter()
                .enumerate()
                .map(|(m, demo)| {
                    let (rotations, warp) = (rotations(demo, rotation), aligned.warp_of(m).cloned());
                    Recording { time: seconds[m].clone(), duration: durations[m], rotations, warp }
                })
                .collect();
            let range = |recording: &Recording| {
                recording.rotations.iter().map(|&q| distance(recording.rotations[0], q)).fold(0.0f64, f64::max)
            };
            ranges.push(recordings.iter().map(range).fold(0.0f64, f64::max));
            let duration = durations[aligned.nominal];
            means.push((
                rotation,
                mean_path(&recordings, canonical, duration, parts, options.smoothing, options.threads)?,
            ));
        }
        let (names, units) = labels_of(demos)?;
        let (plain, dofs) = layout(names.len(), columns);
        let labels = dof_labels(&names, &units, &plain, columns);
        let phases: Vec<Vec<f64>> = (0..demos.len()).map(|m| aligned.phases(m)).collect();
        let extent = canonical.extent();
        let converted = demos.iter().enumerate().map(|(m, demo)| {
            let clock: Vec<f64> = phases[m].iter().map(|phase| phase * extent).collect();
            let converted = in_dofs(demo, &clock, extent, &means, &plain, &dofs).map_err(|error| error.in_demo(m))?;
            converted.with_names(labels.0.clone())?.with_units(labels.1.clone())
        });
        let demos = converted.collect::<Result<Vec<_>>>()?;
        let findings =
            dofs.iter().zip(columns).filter_map(|(&dof, rotation)| far(&demos, dof, &names[rotation.column]));
        let findings = findings.collect();
        let range = |point: Range<usize>| {
            let largest = demos.iter().map(|demo| largest_distance(demo.position(), &point)).fold(0.0, f64::max);
            (point, largest)
        };
        let points = points(&units, columns).into_iter().map(range).collect();
        Ok(Some(Self { demos, findings, names, units, means, dofs, ranges, points, phases }))
    }

    /// Replaces the ranges of residual rotations by the angles that the demonstrations turn, and those of the coordinates of
    /// a point by its distance, which depends on no frame.
    pub(super) fn set_ranges(&self, ranges: &mut [f64]) {
        for (&dof, &range) in self.dofs.iter().zip(&self.ranges) {
            ranges[dof..dof + 3].fill(range);
        }
        for (point, range) in &self.points {
            ranges[point.clone()].fill(*range);
        }
    }

    /// Returns the scale of each DoF in the factorisation: that of rotations is the inverse of the length that weighs as
    /// much as 1 rad.
    ///
    /// # Errors
    /// Given scales that differ within a rotation.
    pub(super) fn dof_scale(&self, options: &FitOptions, ranges: &[f64], units: &[String]) -> Result<Vec<f64>> {
        if let DofScaling::Given(scale) = &options.dof_scale {
            let uneven = |dof: &&usize| scale[**dof..**dof + 3].iter().any(|s| *s != scale[**dof]);
            if self.dofs.iter().find(uneven).is_some() {
                let problem = "differs between the three DoFs of a rotation: they need one scale";
                return Err(Error::Argument { name: "dof_scale", problem });
            }
            return Ok(scale.clone());
        }
        let is_rotation = |d: usize| self.dofs.iter().any(|&dof| (dof..dof + 3).contains(&d));
        let others: Vec<usize> = (0..ranges.len()).filter(|&d| !is_rotation(d)).collect();
        let of_others: (Vec<f64>, Vec<String>) = others.iter().map(|&d| (ranges[d], units[d].clone())).unzip();
        let mut scale = vec![1.0; ranges.len()];
        if others.is_empty() {
            return Ok(scale);
        }
        for (&d, own) in others.iter().zip(options.dof_scale.of(&of_others.0, &of_others.1)) {
            scale[d] = own;
        }
        let turning = |range: f64| if range > 0.0 { range } else { 1.0 };
        for (&dof, &range) in self.dofs.iter().zip(&self.ranges) {
            let own = match (options.rotation_length, &options.dof_scale) {
                (Some(length), _) => 1.0 / length,
                (None, DofScaling::Range) => turning(range),
                (None, DofScaling::Unit) => 1.0,
                (None, _) => 1.0 / self.default_length(&scale, &others),
            };
            scale[dof..dof + 3].fill(own);
        }
        Ok(scale)
    }

    /// Returns the deviation of the other DoFs from their mean, in their scale, over that of the rotations; 1 where one of
    /// them does not deviate.
    fn default_length(&self, scale: &[f64], others: &[usize]) -> f64 {
        let rows = |phase: f64| -> Vec<Vec<f64>> {
            self.demos.iter().zip(&self.phases).map(|(demo, phases)| interpolated(demo, phases, phase)).collect()
        };
        let [mut of_others, mut of_rotations] = [0.0; 2];
        for k in 0..=COMPARED {
            let rows = rows(k as f64 / COMPARED as f64);
            let variance = |d: usize| {
                let mean = rows.iter().map(|row| row[d]).sum::<f64>() / rows.len() as f64;
                rows.iter().map(|row| (row[d] - mean).powi(2)).sum::<f64>()
            };
            of_others += others.iter().map(|&d| variance(d) / (scale[d] * scale[d])).sum::<f64>() / others.len() as f64;
            let turned = self.dofs.iter().flat_map(|&dof| dof..dof + 3).map(variance).sum::<f64>();
            of_rotations += turned / (3 * self.dofs.len()) as f64;
        }
        let ratio = (of_others / of_rotations).sqrt();
        if (1e-6..=1e6).contains(&ratio) { ratio } else { 1.0 }
    }

    /// Returns the primitive in coordinates.
    pub(super) fn outside(self, dofs: Arc<Primitive>, frame: Frame) -> Arc<Primitive> {
        let Self { names, units, means, .. } = self;
        let outer = Primitive::clone(&dofs);
        Arc::new(outer.with_coordinates(Coordinates::new(dofs, names, units, frame, means)))
    }
}

/// Returns a demonstration in the degrees of freedom of a model, given the phases of its samples.
///
/// # Errors
/// A residual rotation of half a turn.
pub(super) fn about_means(demo: &Demonstration, coordinates: &Coordinates, phases: &[f64]) -> Result<Demonstration> {
    let extent = coordinates.dofs().canonical().extent();
    let clock: Vec<f64> = phases.iter().map(|phase| phase * extent).collect();
    let means: Vec<_> =
        coordinates.rotations().iter().map(|rotation| (rotation.columns, rotation.mean.clone())).collect();
    let (plain, dofs) = layout(coordinates.n_coordinates(), demo.rotations());
    in_dofs(demo, &clock, extent, &means, &plain, &dofs)
}

/// Returns the DoFs of each vector of demonstrations: of each rotation, and of the point of its pose. What is estimated of their
/// components is shared, as single components depend on the frame. None without rotations.
///
/// # Errors
/// Rotations that differ between demonstrations.
pub(super) fn vectors_of(demos: &[Demonstration]) -> Result<Vec<Range<usize>>> {
    let columns = demos.first().map_or(&[][..], Demonstration::rotations);
    for (m, demo) in demos.iter().enumerate() {
        check_rotations(demo.rotations(), columns, "demo 0").map_err(|error| error.in_demo(m))?;
    }
    let (names, units) = labels_of(demos)?;
    let rotations = layout(names.len(), columns).1.into_iter().map(|dof| dof..dof + 3);
    Ok(rotations.chain(points(&units, columns)).collect())
}

/// Returns the recorded rotations of a demonstration.
fn rotations(demo: &Demonstration, columns: RotationColumns) -> Vec<Quaternion> {
    demo.position().rows().into_iter().map(|row| columns.read(&row.to_vec())).collect()
}

/// Returns a demonstration in degrees of freedom, whose samples are at the given clock.
///
/// # Errors
/// A residual rotation of half a turn.
pub(super) fn in_dofs(
    demo: &Demonstration,
    clock: &[f64],
    extent: f64,
    means: &[(RotationColumns, MeanRotation)],
    plain: &[[usize; 2]],
    dofs: &[usize],
) -> Result<Demonstration> {
    let n_dofs = plain.len() + 3 * dofs.len();
    let mut position = Array2::zeros((clock.len(), n_dofs));
    for &[column, dof] in plain {
        position.column_mut(dof).assign(&demo.position().column(column));
    }
    let mut last = vec![0.0; n_dofs];
    for ((columns, mean), &dof) in means.iter().zip(dofs) {
        let mut before: Option<Vector> = None;
        for (sample, (q, &u)) in rotations(demo, *columns).into_iter().zip(clock).enumerate() {
            let delta = log(product(inverse(mean.at(u).rotation), q));
            let angle = dot(delta, delta).sqrt();
            let step = before.map_or([0.0; 3], |before| add_scaled(delta, -1.0, before));
            if angle > MAX_RESIDUAL || dot(step, step).sqrt() > MAX_RESIDUAL {
                return Err(Error::Rotation(RotationError::HalfTurn {
                    sample,
                    column: columns.column,
                    degrees: angle.to_degrees(),
                }));
            }
            (0..3).for_each(|i| position[[sample, dof + i]] = delta[i]);
            before = Some(delta);
        }
        last[dof..dof + 3].copy_from_slice(&before.unwrap_or_default());
    }
    let mut converted = Demonstration::new(position, demo.sampling().clone())?;
    if let Some(goal) = demo.goal() {
        let mut residual = vec![0.0; n_dofs];
        plain.iter().for_each(|&[column, dof]| residual[dof] = goal[column]);
        for ((columns, mean), &dof) in means.iter().zip(dofs) {
            let off = product(inverse(mean.at(extent).rotation), columns.read(goal));
            residual[dof..dof + 3].copy_from_slice(&log_near(off, std::array::from_fn(|i| last[dof + i])));
        }
        converted = converted.with_goal(residual)?;
    }
    match demo.context() {
        Some(context) => converted.with_context(context.to_vec()),
        None => Ok(converted),
    }
}

/// Returns the names and units of the degrees of freedom. Those of a rotation are about the axes x, y and z.
pub(super) fn dof_labels(
    names: &[String],
    units: &[String],
    plain: &[[usize; 2]],
    columns: &[RotationColumns],
) -> (Vec<String>, Vec<String>) {
    let mut labels: Vec<(usize, String, String)> =
        plain.iter().map(|&[column, _]| (column, names[column].clone(), units[column].clone())).collect();
    for rotation in columns {
        let of_axis = |column: usize| (column, format!("{}_rot", names[column]), "rad".to_string());
        labels.extend(rotation.vector_columns().map(of_axis));
    }
    labels.sort_by_key(|(column, ..)| *column);
    labels.into_iter().map(|(_, name, unit)| (name, unit)).unzip()
}

/// Returns a row of a demonstration at a phase, by linear interpolation.
fn interpolated(demo: &Demonstration, phases: &[f64], phase: f64) -> Vec<f64> {
    let right = phases.partition_point(|p| *p < phase).clamp(1, phases.len() - 1);
    let share = ((phase - phases[right - 1]) / (phases[right] - phases[right - 1])).min(1.0);
    let position = demo.position();
    position.row(right - 1).iter().zip(position.row(right)).map(|(a, b)| a + share * (b - a)).collect()
}

/// Returns a finding for the largest residual of a rotation beyond 90°.
fn far(demos: &[Demonstration], dof: usize, name: &str) -> Option<Finding> {
    let angle = |row: ArrayView1<f64>| (0..3).map(|i| row[dof + i].powi(2)).sum::<f64>().sqrt();
    let largest = |demo: &Demonstration| demo.position().rows().into_iter().map(angle).fold(0.0f64, f64::max);
    let (demo, angle) = demos.iter().map(largest).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (angle > MAX_PLAIN_RESIDUAL).then(|| Finding::FarRotation {
        demo,
        column: name.to_string(),
        degrees: angle.to_degrees(),
    })
}
