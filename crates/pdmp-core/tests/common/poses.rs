//! Quaternions and synthetic poses of the tests, by formulas of their own: rotations act as 3×3 matrices.
#![allow(dead_code, missing_docs)]

use std::f64::consts::{PI, TAU};

use ndarray::{Array1, Array2, ArrayView1, s};
use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
use pdmp_core::{Demonstration, Sampling};

use super::minimum_jerk;
use super::random::Random;

pub(crate) type Quaternion = [f64; 4];
pub(crate) type Matrix = [[f64; 3]; 3];

/// Quaternion of a turn about an axis, which need not have unit length.
pub(crate) fn turn(axis: [f64; 3], angle: f64) -> Quaternion {
    let norm = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [x, y, z] = axis.map(|x| if norm > 0.0 { x / norm * (angle / 2.0).sin() } else { 0.0 });
    [(angle / 2.0).cos(), x, y, z]
}

/// Quaternion of a rotation vector.
pub(crate) fn of_vector(v: [f64; 3]) -> Quaternion {
    turn(v, v.iter().map(|x| x * x).sum::<f64>().sqrt())
}

/// Hamilton product, by the multiplication table of 1, i, j and k.
pub(crate) fn times(a: Quaternion, b: Quaternion) -> Quaternion {
    const TABLE: [[(usize, f64); 4]; 4] = [
        [(0, 1.0), (1, 1.0), (2, 1.0), (3, 1.0)],
        [(1, 1.0), (0, -1.0), (3, 1.0), (2, -1.0)],
        [(2, 1.0), (3, -1.0), (0, -1.0), (1, 1.0)],
        [(3, 1.0), (2, 1.0), (1, -1.0), (0, -1.0)],
    ];
    let mut product = [0.0; 4];
    for (i, row) in TABLE.iter().enumerate() {
        for (j, (k, sign)) in row.iter().enumerate() {
            product[*k] += sign * a[i] * b[j];
        }
    }
    product
}

pub(crate) fn back([w, x, y, z]: Quaternion) -> Quaternion {
    [w, -x, -y, -z]
}

/// Angle between two rotations.
pub(crate) fn angle(a: Quaternion, b: Quaternion) -> f64 {
    let [w, x, y, z] = times(back(a), b);
    2.0 * (x * x + y * y + z * z).sqrt().atan2(w.abs())
}

/// Rotation matrix of a unit quaternion.
pub(crate) fn matrix([w, x, y, z]: Quaternion) -> Matrix {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

pub(crate) fn apply(m: Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row.iter().zip(v).map(|(m, v)| m * v).sum())
}

/// Angular velocity in the body frame of a rotation that turns from `a` to `b` within `dt`: the axial vector of
/// (R_aᵀR_b − R_bᵀR_a)/2dt, exact to second order.
pub(crate) fn angular_velocity(a: Quaternion, b: Quaternion, dt: f64) -> [f64; 3] {
    let (a, b) = (matrix(a), matrix(b));
    let at = |i: usize, j: usize| (0..3).map(|k| a[k][i] * b[k][j] - b[k][i] * a[k][j]).sum::<f64>() / (2.0 * dt);
    [at(2, 1), at(0, 2), at(1, 0)]
}

/// Quaternion [w, x, y, z] in four columns of a row.
pub(crate) fn rotation(row: ArrayView1<f64>, column: usize) -> Quaternion {
    std::array::from_fn(|i| row[column + i])
}

pub(crate) fn random_rotation(random: &mut Random) -> Quaternion {
    let axis = loop {
        let axis: [f64; 3] = std::array::from_fn(|_| random.between(-1.0, 1.0));
        let square = axis.iter().map(|x| x * x).sum::<f64>();
        if (0.01..1.0).contains(&square) {
            break axis;
        }
    };
    turn(axis, random.between(-PI, PI))
}

pub(crate) const COLUMNS: RotationColumns = RotationColumns { column: 3, order: QuaternionOrder::Wxyz };

/// Demonstration with three positions and a rotation (T, 7), every 0.01 s.
pub(crate) fn pose(position: Array2<f64>) -> Demonstration {
    Demonstration::new(position, Sampling::Uniform { dt: 0.01 }).unwrap().with_rotations(vec![COLUMNS]).unwrap()
}

/// Demonstration of a rotation (T, 4) alone, every 0.01 s.
pub(crate) fn turning(position: &Array2<f64>) -> Demonstration {
    let columns = RotationColumns { column: 0, order: QuaternionOrder::Wxyz };
    let demo = Demonstration::new(position.clone(), Sampling::Uniform { dt: 0.01 }).unwrap();
    demo.with_rotations(vec![columns]).unwrap()
}

/// Poses (M of (T, 7)) of three styles: a screw that turns by `angle` in all, whose tool swings by up to `spread` rad in each
/// style.
pub(crate) fn screws(n: usize, angle: f64, spread: f64, samples: usize, seed: u64) -> Vec<Array2<f64>> {
    let random = &mut Random(seed);
    (0..n).map(|_| screw(angle, std::array::from_fn(|_| random.between(-spread, spread)), samples)).collect()
}

fn screw(angle: f64, style: [f64; 3], samples: usize) -> Array2<f64> {
    const AXES: [[f64; 3]; 3] = [[0.8, 0.6, 0.0], [-0.36, 0.48, 0.8], [0.48, -0.64, 0.6]];
    Array2::from_shape_fn((samples, 7), |(c, d)| {
        let t = c as f64 / (samples - 1) as f64;
        let m = minimum_jerk(t);
        let shapes = [(PI * t).sin().powi(2), (TAU * t).sin() * (PI * t).sin(), m];
        let residual: [f64; 3] = std::array::from_fn(|i| (0..3).map(|j| style[j] * shapes[j] * AXES[j][i]).sum());
        let bent = of_vector([0.3 * (PI * t).sin().powi(2), 0.0, 0.2 * (TAU * t).sin().powi(2)]);
        let q = times(times(turn([0.6, 0.0, 0.8], angle * m), bent), of_vector(residual));
        match d {
            0..3 => 0.1 * [4.0, 1.0, 2.0][d] * m + 0.1 * (0..3).map(|j| style[j] * shapes[(j + d) % 3]).sum::<f64>(),
            _ => q[d - 3],
        }
    })
}

/// Cycles (M of (T, 4)) of a rotation that turns `turns` times about an axis, and wobbles.
pub(crate) fn wobbles(n: usize, turns: f64, samples: usize) -> Vec<Array2<f64>> {
    let random = &mut Random(7);
    let one = |a: [f64; 3]| {
        let rows = (0..samples).flat_map(|c| {
            let phi = TAU * c as f64 / samples as f64;
            let wobble = of_vector([0.3 * phi.sin(), 0.2 * phi.cos(), 0.0]);
            let own = of_vector([a[0] * (2.0 * phi).sin(), a[1] * phi.cos(), a[2]]);
            times(times(turn([0.0, 0.6, 0.8], turns * phi), wobble), own)
        });
        Array1::from_iter(rows).into_shape_with_order((samples, 4)).unwrap()
    };
    (0..n).map(|_| one(std::array::from_fn(|_| random.between(-0.4, 0.4)))).collect()
}

/// A pose, or a rotation alone, in another world and with another tool frame: world ⊗ q ⊗ tool, and the point turned by the
/// world.
pub(crate) fn in_frame(place: &[f64], world: Quaternion, tool: Quaternion) -> Vec<f64> {
    let (point, q) = place.split_at(place.len() - 4);
    let turned = times(times(world, std::array::from_fn(|i| q[i])), tool);
    let point = (!point.is_empty()).then(|| apply(matrix(world), std::array::from_fn(|i| point[i])));
    point.into_iter().flatten().chain(turned).collect()
}

/// Poses in another world and with another tool frame, whose quaternions have random signs.
pub(crate) fn in_frames(poses: &Array2<f64>, world: Quaternion, tool: Quaternion, random: &mut Random) -> Array2<f64> {
    let (mut turned, column) = (poses.clone(), poses.ncols() - 4);
    for mut row in turned.rows_mut() {
        let place = in_frame(&row.to_vec(), world, tool);
        row.assign(&Array1::from_vec(place));
        if random.next() < 0.5 {
            row.slice_mut(s![column..]).mapv_inplace(|x| -x);
        }
    }
    turned
}
