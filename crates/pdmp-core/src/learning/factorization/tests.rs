use ndarray::{Array1, Axis};
use proptest::prelude::*;

use super::*;
use crate::learning::factorization::gram::Gram;
use crate::learning::factorization::small_svd::Svd;

fn go(_: f64) -> Result<()> {
    Ok(())
}

fn of(targets: &Array2<f64>, styles: Truncation) -> Factors {
    Factors::of(targets.view(), styles, &mut go).unwrap()
}

/// Computes every factor to full accuracy.
fn exact(targets: &Array2<f64>) -> Factors {
    let scaled = ScaledTargets::of(targets.view(), targets.nrows()).unwrap().unwrap();
    scaled.exact(Truncation::Rank(targets.nrows().min(targets.ncols())), &mut go).unwrap()
}

fn norm(a: &Array2<f64>) -> f64 {
    let largest = a.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    if largest == 0.0 { 0.0 } else { largest * a.iter().map(|x| (x / largest).powi(2)).sum::<f64>().sqrt() }
}

/// Returns columns that are orthonormal to rounding, by modified Gram-Schmidt, twice.
fn orthonormal(rows: usize, columns: usize, seed: f64) -> Array2<f64> {
    let mut q = Array2::from_shape_fn((rows, columns), |(i, j)| {
        ((i as f64 + seed) * 12.9898 + (j as f64 + 1.0) * 78.233).sin() * 43758.5453 % 1.0
    });
    for _ in 0..2 {
        for j in 0..columns {
            for i in 0..j {
                let other = q.column(i).to_owned();
                let share = other.dot(&q.column(j));
                q.column_mut(j).scaled_add(-share, &other);
            }
            let length = q.column(j).dot(&q.column(j)).sqrt();
            q.column_mut(j).mapv_inplace(|x| x / length);
        }
    }
    q
}

/// Returns Q₁·diag(σ)·Q₂ᵀ.
fn matrix(rows: usize, columns: usize, sigma: &[f64]) -> Array2<f64> {
    let right = orthonormal(columns, sigma.len(), 0.7);
    (orthonormal(rows, sigma.len(), 0.3) * Array1::from_vec(sigma.to_vec())).dot(&right.t())
}

fn decaying(n: usize, ratio: f64) -> Vec<f64> {
    (0..n).map(|k| ratio.powi(k as i32)).collect()
}

/// Asserts the claims about all factors: S is orthonormal with fixed signs, the rows of F_basis = SᵀF are orthogonal and
/// as long as the singular values, and the stated error bounds the truncation error closely.
fn check(targets: &Array2<f64>, factors: &Factors) {
    let Factors { styles, basis_targets: basis, singular_values, error } = factors;
    let n_styles = styles.ncols();
    assert_eq!((styles.nrows(), basis.dim()), (targets.nrows(), (n_styles, targets.ncols())));
    assert!(singular_values.windows(2).all(|pair| pair[0] >= pair[1]));
    let gram = styles.t().dot(styles);
    assert!(norm(&(gram - Array2::<f64>::eye(n_styles))) < 1e-12 * n_styles as f64);
    let first = singular_values[0];
    if first == 0.0 {
        assert!(*error == 0.0 && basis.iter().all(|&x| x == 0.0));
        return;
    }
    let scaled = basis / first;
    let products = scaled.dot(&scaled.t());
    for (i, j) in (0..n_styles).flat_map(|j| (0..=j).map(move |i| (i, j))) {
        let expected = if i == j { (singular_values[i] / first).powi(2) } else { 0.0 };
        assert!((products[[i, j]] - expected).abs() < 2e-11, "{i} {j} {} {expected}", products[[i, j]]);
    }
    for column in styles.columns() {
        assert!(column.iter().fold(0.0f64, |p, &x| if x.abs() > p.abs() { x } else { p }) > 0.0);
    }
    let left = norm(&(&(targets / first) - &styles.dot(&scaled))) * first;
    let size = norm(targets);
    assert!(left <= error + 1e-13 * size && *error <= left + 1e-6 * size, "{left:e} {error:e}");
}

/// The singular values are those of the construction for any shape and scale, also where they span sixteen decades,
/// vanish or coincide.
#[test]
fn singular_values_are_those_of_the_construction() {
    let cases =
        [vec![1.0; 6], decaying(6, 0.5), decaying(6, 1e-3), decaying(3, 0.1), vec![2.0, 1.0, 1e-8, 1e-12], vec![1.0]];
    for (rows, columns) in [(6, 300), (300, 6), (7, 7), (6, 6), (8, 9), (20, 3000)] {
        for sigma in &cases {
            for scale in [1e-150, 1e-30, 1.0, 1e30, 1e149] {
                let targets = matrix(rows, columns, sigma) * scale;
                let (default, exact) = (of(&targets, Truncation::Rank(sigma.len())), exact(&targets));
                for (factors, digits) in [(default, 1e-11f64), (exact, 1e-14)] {
                    check(&targets, &factors);
                    for (k, found) in factors.singular_values.iter().enumerate() {
                        let expected = sigma.get(k).copied().unwrap_or(0.0);
                        // Beyond J the Gram matrix gives half the digits.
                        let digits = if k < sigma.len() { digits } else { digits.max(1e-8) };
                        assert!(
                            (found / scale - expected).abs() < digits * sigma[0] * 4.0,
                            "{rows} {columns} {sigma:?} {k} {found:e}"
                        );
                    }
                }
            }
        }
    }
}

/// Few long rows, many short ones, one row and one column are factorised.
#[test]
fn all_shapes_are_factorised() {
    for (rows, columns) in [(1, 1), (1, 9), (9, 1), (2, 1), (5, 4000), (4000, 5), (70, 80), (80, 70), (130, 900)] {
        let k = rows.min(columns);
        let targets = Array2::from_shape_fn((rows, columns), |(i, j)| ((i * i * 7 + j * 3 + i * j + 1) as f64).sin());
        check(&targets, &exact(&targets));
        for styles in [Truncation::Rank(1), Truncation::Rank(k), Truncation::Share(0.9), Truncation::Share(1.0)] {
            check(&targets, &of(&targets, styles));
        }
    }
}

/// Repeated demonstrations have one style, and DoFs at rest keep targets of exactly zero.
#[test]
fn degenerate_targets_are_factorised() {
    let row = Array1::from_shape_fn(500, |j| if j % 7 == 3 { 0.0 } else { (j as f64).sin() });
    for rows in [1, 2, 30, 600] {
        let targets = row.broadcast((rows, 500)).unwrap().to_owned();
        for factors in
            [of(&targets, Truncation::Share(0.9)), of(&targets, Truncation::Rank(rows.min(500))), exact(&targets)]
        {
            check(&targets, &factors);
            let rounding = (factors.singular_values.len() as f64 * f64::EPSILON).sqrt();
            assert!(factors.singular_values.iter().skip(1).all(|&s| s < rounding * factors.singular_values[0]));
            assert!(
                factors
                    .basis_targets
                    .axis_iter(Axis(1))
                    .skip(3)
                    .step_by(7)
                    .all(|column| column.iter().all(|&x| x == 0.0))
            );
        }
        assert_eq!(of(&targets, Truncation::Share(1.0)).styles.ncols(), 1);
        let still = of(&Array2::zeros((rows, 500)), Truncation::Share(0.9));
        check(&Array2::zeros((rows, 500)), &still);
        assert_eq!(still.styles.ncols(), 1);
    }
}

/// The leading factors of many demonstrations by Krylov subspaces are those of the full decomposition.
#[test]
fn few_leading_factors_are_those_of_all() {
    for (rows, columns) in [(300, 500), (500, 300), (260, 2000)] {
        for sigma in [decaying(260, 0.8), decaying(260, 0.2), vec![3.0, 2.0, 1.0, 0.5, 0.2], decaying(12, 1e-3)] {
            let targets = matrix(rows, columns, &sigma);
            let (few, all) = (of(&targets, Truncation::Rank(5)), exact(&targets));
            assert_eq!(few.singular_values.len(), 5, "not by Krylov subspaces");
            check(&targets, &few);
            for j in 0..5 {
                assert!((few.singular_values[j] - all.singular_values[j]).abs() < 1e-10 * sigma[0]);
                assert!((few.singular_values[j] - sigma[j]).abs() < 1e-10 * sigma[0]);
                let gap = if j == 0 { 1.0 } else { sigma[j - 1] - sigma[j] }
                    .min(sigma[j] - sigma[j + 1..].first().copied().unwrap_or(0.0));
                let aligned = few.styles.column(j).dot(&all.styles.column(j)).abs();
                let sine = (1.0 - aligned * aligned).max(0.0).sqrt();
                assert!(sine < 1e-7 + 1e-10 * sigma[0] / gap, "{j} {sine:e}");
                // Residuals as claimed, with F itself: F·f_j = σ_j²·s_j.
                let row = few.basis_targets.row(j);
                let residual = targets.dot(&row) - &few.styles.column(j) * row.dot(&row);
                let length = residual.dot(&residual).sqrt();
                assert!(length <= 1e-11 * sigma[0] * sigma[0], "{length:e}");
            }
        }
    }
}

/// For spectra that decay slowly or have no gap after J, a slower method is used and the error stays correct.
#[test]
fn slow_and_clustered_spectra_are_factorised() {
    let (rows, columns) = (300, 400);
    let slow: Vec<f64> = (0..300).map(|k| 1.0 - k as f64 * 1e-3).collect();
    let flat = vec![1.0; 300];
    let pair: Vec<f64> = (0..300)
        .map(|k| {
            if k < 5 {
                1.0
            } else if k < 40 {
                0.5
            } else {
                0.01
            }
        })
        .collect();
    let near: Vec<f64> = (0..300)
        .map(|k| {
            if k < 4 {
                1.0
            } else if k < 30 {
                0.5 + 1e-9 * k as f64
            } else {
                0.3
            }
        })
        .collect();
    for sigma in [slow, flat, pair, near] {
        let targets = matrix(rows, columns, &sigma);
        let mut sorted = sigma.clone();
        sorted.sort_by(|a, b| b.total_cmp(a));
        for n_styles in [1, 4, 6] {
            let factors = of(&targets, Truncation::Rank(n_styles));
            check(&targets, &factors);
            let least = sorted[n_styles..].iter().map(|s| s * s).sum::<f64>().sqrt();
            assert!((factors.error - least).abs() < 1e-6 * norm(&targets));
            for (found, expected) in factors.singular_values.iter().zip(&sorted) {
                assert!((found - expected).abs() < 1e-8, "{found} {expected}");
            }
        }
    }
}

/// The share rule keeps the number of styles that the exact singular values require, and they are accurate.
#[test]
fn the_share_rule_follows_the_exact_singular_values() {
    for (rows, columns) in [(100, 700), (400, 90)] {
        for ratio in [0.1, 0.5, 0.9, 0.99] {
            let sigma = decaying(90, ratio);
            let targets = matrix(rows, columns, &sigma);
            for share in [0.5, 0.9, 0.999] {
                let factors = of(&targets, Truncation::Share(share));
                check(&targets, &factors);
                assert_eq!(factors.styles.ncols(), Truncation::Share(share).among(&sigma, rows));
                assert_eq!(factors.singular_values.len(), rows.min(columns));
                for (found, expected) in factors.singular_values.iter().zip(&sigma) {
                    assert!((found - expected).abs() < 2e-8);
                }
            }
        }
    }
}

/// Both methods for small matrices return sound decompositions.
#[test]
fn both_methods_decompose_small_matrices() {
    for k in [1, 2, 3, 17, 60] {
        for sigma in [vec![1.0; k], decaying(k, 0.3), decaying(k.div_ceil(2), 1e-2), vec![0.0; k]] {
            let square = matrix(k, k, &sigma);
            let a = Mat::from_fn(k, k, |i, j| square[[i, j]]);
            for Svd { u, sigma: values, v } in [Svd::of(a.as_ref()), Svd::rotated(a.clone())] {
                let close = |a: &Mat<f64>, b: &Mat<f64>| (a - b).norm_l2() < 1e-13 * k as f64;
                let eye = Mat::<f64>::identity(k, k);
                assert!(close(&(u.transpose() * &u), &eye) && close(&(v.transpose() * &v), &eye));
                let product = Mat::from_fn(k, k, |i, j| (0..k).map(|m| u[(i, m)] * values[m] * v[(j, m)]).sum::<f64>());
                assert!(close(&product, &a));
                assert!(values.windows(2).all(|pair| pair[0] >= pair[1]));
            }
        }
    }
}

/// The triangle R by blocks of columns has RᵀR = A·Aᵀ, and Q·R is the matrix.
#[test]
fn reflections_keep_the_products() {
    for (k, length) in [(1, 1), (1, 5000), (3, 3), (20, 7000), (33, 2049), (64, 64)] {
        let a = Mat::from_fn(k, length, |i, j| ((i * i * 7 + j * 3 + i * j + 1) as f64).sin());
        let r = householder::triangle(a.as_ref(), &mut go).unwrap();
        assert!((r.transpose() * &r - &a * a.transpose()).norm_l2() < 1e-13 * a.norm_l2().powi(2));
        let (q, r) = householder::orthonormal(a.transpose().to_owned());
        assert!((&q * &r - a.transpose()).norm_l2() < 1e-13 * a.norm_l2());
        assert!((q.transpose() * &q - Mat::<f64>::identity(k, k)).norm_l2() < 1e-13 * k as f64);
    }
}

/// The Gram matrix is not used for singular values that it cannot resolve.
#[test]
fn small_singular_values_are_not_taken_from_the_gram_matrix() {
    let a = matrix(10, 200, &decaying(10, 0.1));
    let a = Mat::from_fn(10, 200, |i, j| a[[i, j]]);
    let gram = Gram::of(a.as_ref(), &mut go).unwrap().unwrap();
    assert!(gram.leading(3, 10).is_some() && gram.leading(5, 10).is_none());
}

/// Every method can be cancelled between any two passes.
#[test]
fn a_factorisation_can_be_cancelled() {
    let targets = matrix(300, 400, &decaying(300, 0.99));
    for styles in [Truncation::Rank(5), Truncation::Rank(300), Truncation::Share(0.9)] {
        let mut reports = 0;
        Factors::of(targets.view(), styles, &mut |share| {
            assert!((0.0..=1.0).contains(&share));
            reports += 1;
            Ok(())
        })
        .unwrap();
        assert!(reports > 0);
        for last in 0..reports {
            let mut count = 0;
            let mut stop = |_| {
                count += 1;
                if count > last { Err(Error::Interrupted) } else { Ok(()) }
            };
            assert!(matches!(Factors::of(targets.view(), styles, &mut stop), Err(Error::Interrupted)));
        }
    }
}

/// Results are equal bit for bit in every run and for every memory order of the targets.
#[test]
fn results_are_reproducible() {
    for sigma in [decaying(300, 0.7), decaying(300, 0.99)] {
        let targets = matrix(300, 400, &sigma);
        let transposed = targets.t().as_standard_layout().into_owned();
        for styles in [Truncation::Rank(5), Truncation::Share(0.9)] {
            let first = of(&targets, styles);
            for again in [of(&targets, styles), Factors::of(transposed.t(), styles, &mut go).unwrap()] {
                assert_eq!(
                    (&first.styles, &first.basis_targets, &first.singular_values),
                    (&again.styles, &again.basis_targets, &again.singular_values)
                );
            }
        }
    }
}

#[test]
fn numbers_of_styles_out_of_range_are_rejected() {
    let targets = matrix(5, 40, &decaying(5, 0.5));
    for count in [Truncation::Rank(0), Truncation::Rank(6), Truncation::Share(0.0), Truncation::Share(f64::NAN)] {
        assert!(Factors::of(targets.view(), count, &mut go).is_err());
    }
}

#[test]
fn targets_that_are_not_finite_are_rejected() {
    for value in [f64::NAN, f64::INFINITY, -1e151] {
        let mut targets = Array2::ones((5, 40));
        targets[[3, 7]] = value;
        let error = Factors::of(targets.view(), Truncation::Rank(1), &mut go).unwrap_err().to_string();
        assert!(error.contains("targets[3, 7]"), "{error}");
    }
    assert!(Factors::of(Array2::zeros((0, 4)).view(), Truncation::Share(0.9), &mut go).is_err());
}

proptest! {
    /// The claims hold for any shape, rank, decay and scale.
    #[test]
    fn factors_of_any_matrix_are_sound(
        rows in 1usize..40, columns in 1usize..60, rank in 1usize..20, decay in 0.0f64..4.0,
        exponent in -150i32..148, values in prop::collection::vec(-1.0f64..1.0, 2048), share in 0.01f64..1.0,
    ) {
        let pick = |i: usize| values[i % values.len()];
        let left = Array2::from_shape_fn((rows, rank), |(i, r)| pick(i * rank + r) * 10f64.powf(-decay * r as f64));
        let right = Array2::from_shape_fn((rank, columns), |(r, j)| pick(1021 + r * columns + j));
        let targets = left.dot(&right) * 10f64.powi(exponent);
        let k = rows.min(columns);
        for styles in [Truncation::Rank(1 + rank % k), Truncation::Rank(k), Truncation::Share(share)] {
            check(&targets, &of(&targets, styles));
        }
        if targets.iter().any(|&x| x != 0.0) {
            check(&targets, &exact(&targets));
        }
    }
}

/// The triangle of the second Gram pass has the singular values of the construction, and its factors are as accurate as
/// those of reflections; singular values that fall too far may have none.
#[test]
fn second_gram_pass_is_as_accurate_as_reflections() {
    let cases = [
        vec![1.0; 6],
        decaying(6, 0.1),
        decaying(12, 0.3),
        decaying(20, 0.5),
        decaying(6, 1e-3),
        vec![1.0, 0.5, 0.25, 0.0, 0.0, 0.0],
    ];
    for sigma in cases {
        let targets = matrix(sigma.len(), 3000, &sigma);
        let scaled = ScaledTargets::of(targets.view(), targets.nrows()).unwrap().unwrap();
        let gram = Gram::of(scaled.wide(), &mut go).unwrap().unwrap();
        let Some(triangle) = gram.triangle(scaled.wide(), &mut go).unwrap() else {
            assert!(sigma[sigma.len() - 1] < 1e-8, "{sigma:?}");
            continue;
        };
        let n_styles = Truncation::Rank(sigma.len());
        let factors = scaled.of_triangle(n_styles, triangle.as_ref(), Some(gram.vectors.as_ref())).unwrap();
        check(&targets, &factors);
        for (j, sigma) in sigma.iter().enumerate() {
            assert!((factors.singular_values[j] - sigma).abs() < 1e-14);
            let residual = targets.dot(&factors.basis_targets.row(j)) - &factors.styles.column(j) * (sigma * sigma);
            assert!(residual.dot(&residual).sqrt() < 1e-14);
        }
    }
}

/// A row of zeros has no direction, and so no triangle by the second Gram pass.
#[test]
fn vanishing_rows_have_no_triangle_of_products() {
    let mut targets = matrix(6, 3000, &[1.0; 6]);
    targets.row_mut(2).fill(0.0);
    let scaled = ScaledTargets::of(targets.view(), targets.nrows()).unwrap().unwrap();
    let gram = Gram::of(scaled.wide(), &mut go).unwrap().unwrap();
    assert!(gram.triangle(scaled.wide(), &mut go).unwrap().is_none());
    check(&targets, &of(&targets, Truncation::Rank(6)));
}
