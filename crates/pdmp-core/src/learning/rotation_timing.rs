//! Time scaling of demonstrations with rotations.
//!
//! The residual rotations depend on the phase of each sample, so that time is scaled before they are known, by integrals of the
//! angular velocity in the body frame in their place,
//!
//! ```text
//! θ_c = Σ_{k ≤ c} log(q_{k−1}⁻¹ ⊗ q_k).
//! ```
//!
//! Products of angular velocities of two demonstrations do not depend on the world frame, nor on the tool frame, which turns
//! all of them alike. The mean angular velocity of a cycle is removed, which closes θ.

use std::ops::Range;

use ndarray::{Array2, ArrayView1, ArrayView2};

use super::alignment::Alignment;
use super::fit::labels_of;
use super::rotations::dof_labels;
use crate::demonstration::{Demonstration, layout};
use crate::error::Result;
use crate::kind::Kind;
use crate::numerics::rotation::{Quaternion, Vector, add_scaled, inverse, log, product};
use crate::numerics::smoothing_spline::Smoothing;
use crate::numerics::statistics::range;

/// Returns demonstrations whose columns are the degrees of freedom, with the integrals θ in place of rotations.
pub(super) fn integrated(demos: &[Demonstration], kind: Kind) -> Result<Vec<Demonstration>> {
    let (names, units) = labels_of(demos)?;
    let columns = demos.first().map_or(&[][..], Demonstration::rotations);
    let (plain, dofs) = layout(names.len(), columns);
    let (names, units) = dof_labels(&names, &units, &plain, columns);
    let integrate = |demo: &Demonstration| {
        let mut position = Array2::zeros((demo.n_samples(), names.len()));
        for &[column, dof] in &plain {
            position.column_mut(dof).assign(&demo.position().column(column));
        }
        for (rotation, &dof) in columns.iter().zip(&dofs) {
            let rows = demo.position();
            let path: Vec<Quaternion> = rows.rows().into_iter().map(|row| rotation.read(&row.to_vec())).collect();
            for (c, theta) in angles(&path, kind).into_iter().enumerate() {
                (0..3).for_each(|i| position[[c, dof + i]] = theta[i]);
            }
        }
        Demonstration::new(position, demo.sampling().clone())?.with_names(names.clone())?.with_units(units.clone())
    };
    demos.iter().map(integrate).collect()
}

/// Returns θ at each sample of a path.
fn angles(path: &[Quaternion], kind: Kind) -> Vec<Vector> {
    let step = |from: Quaternion, to: Quaternion| log(product(inverse(from), to));
    let mut thetas = vec![[0.0; 3]];
    for pair in path.windows(2) {
        thetas.push(add_scaled(thetas[thetas.len() - 1], 1.0, step(pair[0], pair[1])));
    }
    if kind == Kind::Rhythmic {
        let n = path.len();
        let total = add_scaled(thetas[n - 1], 1.0, step(path[n - 1], path[0]));
        thetas =
            thetas.iter().enumerate().map(|(c, &theta)| add_scaled(theta, -(c as f64) / n as f64, total)).collect();
    }
    thetas
}

/// Returns settings of the alignment of [`integrated`] demonstrations, whose noise is estimated from themselves.
pub(super) fn alignment(alignment: &Alignment, vectors: Vec<Range<usize>>) -> Alignment {
    let smoothing = match alignment.smoothing {
        Smoothing::Interpolate => Smoothing::Auto,
        given => given,
    };
    Alignment { vectors, smoothing, ..alignment.clone() }
}

/// Returns the scales of the DoFs in the comparison of [`integrated`] demonstrations: their ranges, and for the components of a
/// vector its largest distance from the start, which depends on no frame.
pub(super) fn scales(demos: &[Demonstration], vectors: &[Range<usize>]) -> Vec<f64> {
    let largest = |of: &dyn Fn(ArrayView2<f64>) -> f64| {
        let most = demos.iter().map(|demo| of(demo.position())).fold(0.0, f64::max);
        if most > 0.0 { most } else { 1.0 }
    };
    let mut scales: Vec<f64> = (0..demos[0].n_coordinates())
        .map(|d| largest(&|position: ArrayView2<f64>| range(position.column(d))))
        .collect();
    for vector in vectors {
        scales[vector.clone()].fill(largest(&|position: ArrayView2<f64>| largest_distance(position, vector)));
    }
    scales
}

/// Returns the largest distance of a vector, given its columns of `position`, from its first value.
pub(super) fn largest_distance(position: ArrayView2<f64>, vector: &Range<usize>) -> f64 {
    let distance =
        |row: ArrayView1<f64>| vector.clone().map(|d| (row[d] - position[[0, d]]).powi(2)).sum::<f64>().sqrt();
    position.rows().into_iter().map(distance).fold(0.0, f64::max)
}
