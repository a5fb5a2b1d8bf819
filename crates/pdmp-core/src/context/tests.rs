use approx::assert_relative_eq;
use ndarray::{Array2, Axis, array};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::model_selection::Shown;
use super::*;

fn contexts(numbers: &[f64]) -> Vec<Vec<ContextValue>> {
    numbers.iter().map(|&h| vec![h.into()]).collect()
}

fn linear(numbers: &[f64], outputs: &Array2<f64>) -> ContextMap {
    ContextMap::fit(&contexts(numbers), outputs.view(), MapSelection::Given(ContextMapKind::Linear)).unwrap()
}

/// Data on a line are predicted exactly by least squares and to a millionth by `Auto`, inside the range and outside.
#[test]
fn linear_data_are_predicted_exactly() {
    let h = [0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9];
    let outputs = Array2::from_shape_fn((7, 1), |(m, _)| h[m]).dot(&array![[2.0, -1.0, 0.5, 0.1]]) + 0.7;
    let maps = [MapSelection::Given(ContextMapKind::Linear), MapSelection::Auto]
        .map(|choice| ContextMap::fit(&contexts(&h), outputs.view(), choice).unwrap());
    assert_eq!(maps[1].kind(), ContextMapKind::Stacked);
    for (map, accuracy) in maps.iter().zip([1e-12, 1e-6]) {
        for at in [0.6, 2.0] {
            let found = map.predict(&[at]).unwrap();
            for (p, slope) in [2.0, -1.0, 0.5, 0.1].into_iter().enumerate() {
                assert_relative_eq!(found.mean[p], slope * at + 0.7, epsilon = accuracy);
            }
        }
    }
    assert!(maps[0].predict(&[2.0]).unwrap().covariance.unwrap().iter().all(|c| c.abs() < 1e-20));
}

/// A context has as many values as each context of the demonstrations, labels and numbers alike, be they constant.
#[test]
fn inputs_are_the_values_of_a_context() {
    let outputs = array![[0.0], [1.0], [2.0], [3.5]];
    assert_eq!(linear(&[0.0, 0.1, 0.2, 0.3], &outputs).n_inputs(), 1);
    let row = |height: f64, name: &str| vec![height.into(), name.into(), 7.0.into()];
    let rows = [row(0.0, "a"), row(0.1, "b"), row(0.2, "c"), row(0.3, "a")];
    let map = ContextMap::fit(&rows, outputs.view(), Default::default()).unwrap();
    assert_eq!((map.n_inputs(), map.columns().len()), (3, 3));
    assert!(map.predict(&row(0.1, "b")).is_ok());
    assert!(map.predict(&row(0.1, "b")[..2]).is_err());
}

/// What no map can be learnt from is refused with its place, whatever the map.
#[test]
fn contexts_that_are_none_are_refused() {
    let bad = |contexts: &[Vec<ContextValue>], choice| {
        let outputs = Array2::zeros((contexts.len(), 2));
        ContextMap::fit(contexts, outputs.view(), choice).unwrap_err().to_string()
    };
    for choice in [ContextMapKind::Linear, ContextMapKind::Polynomial, ContextMapKind::Gp].map(MapSelection::Given) {
        assert!(bad(&[], choice).contains("contexts is empty"));
        assert!(bad(&[vec![], vec![]], choice).contains("context is empty"));
        assert!(bad(&contexts(&[0.0, f64::NAN, 1.0]), choice).contains("demo 1: context[0] = NaN"));
    }
}

/// Slopes and covariance are those of the normal equations, solved here by Cramer's rule.
#[test]
fn regression_agrees_with_the_normal_equations() {
    let h: [f64; 5] = [0.1, 0.5, 0.7, 1.1, 1.9];
    let y = [1.0, 0.2, 0.9, -0.3, -1.0];
    let map = linear(&h, &Array2::from_shape_fn((5, 2), |(m, p)| if p == 0 { y[m] } else { 0.0 }));
    let (n, sh, shh): (f64, f64, f64) = (5.0, h.iter().sum(), h.iter().map(|h| h * h).sum());
    let (sy, shy): (f64, f64) = (y.iter().sum(), h.iter().zip(y).map(|(h, y)| h * y).sum());
    let det = n * shh - sh * sh;
    let (slope, intercept) = ((n * shy - sh * sy) / det, (shh * sy - sh * shy) / det);
    let rss: f64 = h.iter().zip(y).map(|(h, y)| (y - intercept - slope * h).powi(2)).sum();
    let at = 0.85;
    let variance = rss / 3.0 * (1.0 + (shh - 2.0 * sh * at + n * at * at) / det);
    let found = map.predict(&[at]).unwrap();
    assert_relative_eq!(found.mean[0], intercept + slope * at, epsilon = 1e-12);
    assert_relative_eq!(found.covariance.unwrap()[[0, 0]], variance, epsilon = 1e-12);
}

/// One context value for all demonstrations, or one demonstration, predicts their mean; every other is outside.
#[test]
fn unvaried_contexts_predict_the_mean() {
    let outputs = array![[1.0, 0.0], [3.0, 0.0]];
    let found = linear(&[0.5, 0.5], &outputs).predict(&[9.0]).unwrap();
    assert_relative_eq!(found.mean[0], 2.0, epsilon = 1e-12);
    // The mean of two, and a third one: 1/2 + 1 of their variance, 2.
    assert_relative_eq!(found.covariance.unwrap()[[0, 0]], 3.0, epsilon = 1e-12);
    assert_eq!(found.extrapolation, [f64::INFINITY]);
    let found = linear(&[0.5], &outputs.select(Axis(0), &[0])).predict(&[9.0]).unwrap();
    assert_relative_eq!(found.mean[0], 1.0, epsilon = 1e-12);
    assert!(found.covariance.is_none());
}

/// Fits without one context after another, with the same constants, miss it by the errors in closed form.
#[test]
fn errors_left_out_are_those_of_fits_without() {
    let h = [0.0, 0.2, 0.5, 0.6, 0.9, 1.3];
    let y = Array2::from_shape_fn((6, 2), |(m, p)| (3.0 * h[m] + p as f64).sin() + 0.1 * (17.0 * h[m]).cos());
    for kernel in [None, Some(Kernel::Quadratic), Some(Kernel::Matern { length: 0.8 })] {
        let inputs = Array2::from_shape_fn((6, 1), |(m, _)| h[m]);
        let ratios = if kernel.is_some() { [2.0, 0.3] } else { [0.0; 2] };
        let shown = Shown { inputs: inputs.view(), n_inputs: 1, outputs: y.view() };
        let whole = Candidate::with(ContextMapKind::Gp, kernel, &shown, |_, _| ratios.to_vec()).unwrap();
        let errors = whole.kriging.leave_one_out_errors(&whole.values, &ratios);
        for m in 0..6 {
            let others: Vec<usize> = (0..6).filter(|&k| k != m).collect();
            let (inputs, outputs) = (inputs.select(Axis(0), &others), y.select(Axis(0), &others));
            let shown = Shown { inputs: inputs.view(), n_inputs: 1, outputs: outputs.view() };
            let part = Candidate::with(ContextMapKind::Gp, kernel, &shown, |_, _| ratios.to_vec()).unwrap();
            let place = part.kriging.place(&[h[m]]);
            let mean =
                place.flat.dot(&part.values.flat) + place.rest.dot(&part.kriging.coefficients(&part.values, &ratios));
            for p in 0..2 {
                assert_relative_eq!(errors[[m, p]], y[[m, p]] - mean[p], epsilon = 1e-10);
            }
        }
    }
}

/// Mean and variance are those of the joint normal density, in which the constant has a variance without bound.
#[test]
fn kriging_agrees_with_the_joint_density() {
    let h = [0.0, 0.2, 0.5, 0.6, 1.3];
    let y = array![[0.3], [0.9], [0.1], [-0.4], [0.7]];
    let (kernel, ratio, wide) = (Kernel::Matern { length: 0.7 }, 1.7, 1e6);
    let inputs = Array2::from_shape_fn((5, 1), |(m, _)| h[m]);
    let shown = Shown { inputs: inputs.view(), n_inputs: 1, outputs: y.view() };
    let found = Candidate::with(ContextMapKind::Gp, Some(kernel), &shown, |_, _| vec![ratio]).unwrap();
    let k = |a: f64, b: f64| ratio * kernel.of(&[a], &[b], 1) + wide;
    let covariance = nalgebra::DMatrix::from_fn(5, 5, |i, j| k(h[i], h[j]) + f64::from(i == j));
    let factor = covariance.cholesky().unwrap();
    for at in [0.4, 3.0] {
        let cross = nalgebra::DVector::from_fn(5, |i, _| k(at, h[i]));
        let weights = factor.solve(&cross);
        let mean: f64 = (0..5).map(|i| weights[i] * y[[i, 0]]).sum();
        let place = found.kriging.place(&[at]);
        let predicted = place.flat.dot(&found.values.flat)
            + place.rest.dot(&found.kriging.coefficients(&found.values, &found.ratios));
        assert_relative_eq!(predicted[0], mean, epsilon = 1e-5);
        assert_relative_eq!(found.kriging.variance(&place, ratio), k(at, at) - cross.dot(&weights), epsilon = 1e-5);
    }
}

/// A curve is followed by `Auto` where a line cannot, and noise without a trend is met by its mean.
#[test]
fn auto_follows_a_curve_and_leaves_noise_alone() {
    let h: Vec<f64> = (0..15).map(|k| k as f64 / 14.0).collect();
    let noise = |m: usize| 0.02 * ((m * m * 7 + 3 * m) as f64).sin();
    let curve = Array2::from_shape_fn((15, 1), |(m, _)| (6.0 * h[m]).sin() + noise(m));
    let map = ContextMap::fit(&contexts(&h), curve.view(), MapSelection::Auto).unwrap();
    for at in [0.11, 0.5, 0.83] {
        assert_relative_eq!(map.predict(&[at]).unwrap().mean[0], (6.0 * at).sin(), epsilon = 0.05);
    }
    let flat = Array2::from_shape_fn((15, 1), |(m, _)| 1.0 + noise(m));
    let map = ContextMap::fit(&contexts(&h), flat.view(), MapSelection::Auto).unwrap();
    for at in [0.5, 3.0] {
        assert_relative_eq!(map.predict(&[at]).unwrap().mean[0], 1.0, epsilon = 0.02);
    }
}

/// Each label has its own movement, shrunk towards the mean of all; between them there is nothing.
#[test]
fn labels_are_told_apart() {
    let shown = [("old", 1.0), ("old", 1.2), ("proud", 3.0), ("proud", 3.2), ("young", 5.0), ("young", 5.2)];
    let contexts: Vec<Vec<ContextValue>> = shown.iter().map(|(label, _)| vec![(*label).into()]).collect();
    let outputs = Array2::from_shape_fn((6, 1), |(m, _)| shown[m].1);
    for kind in [ContextMapKind::Linear, ContextMapKind::Gp] {
        let map = ContextMap::fit(&contexts, outputs.view(), MapSelection::Given(kind)).unwrap();
        for (label, expected) in [("old", 1.1), ("proud", 3.1), ("young", 5.1)] {
            let found = map.predict(&[label]).unwrap();
            match kind {
                ContextMapKind::Linear => assert_relative_eq!(found.mean[0], expected, epsilon = 1e-12),
                // Three labels know little of their spread: each is halfway to the mean of all, and no further.
                _ => {
                    assert!((found.mean[0] - 3.1).abs() >= 0.3 * (expected - 3.1f64).abs(), "{label} {:?}", found.mean)
                }
            }
        }
    }
}

/// Demonstrations of one context count as one, whose scatter a new movement repeats.
#[test]
fn repetitions_count_once() {
    let once = linear(&[0.0, 1.0, 2.0], &array![[0.0], [2.0], [1.0]]);
    let often = linear(&[0.0, 0.0, 0.0, 1.0, 2.0], &array![[-0.3], [0.3], [0.0], [2.0], [1.0]]);
    let [once, often] = [once, often].map(|map| map.predict(&[1.5]).unwrap());
    assert_relative_eq!(once.mean[0], often.mean[0], epsilon = 1e-12);
    // 0.09 is the variance within; three, one and one repetitions average 5/9 and 1/3 · 7/3 of it away.
    let added = 0.09 * (1.0 - (1.0 / 3.0 + 2.0) / 3.0);
    assert_relative_eq!(often.covariance.unwrap()[[0, 0]], once.covariance.unwrap()[[0, 0]] + added, epsilon = 1e-12);
}

/// What is foreseen does not depend on the units of the outputs, however far apart.
#[test]
fn units_of_outputs_do_not_matter() {
    let h: Vec<f64> = (0..9).map(|k| k as f64 / 8.0).collect();
    let (columns, table) = tabulate(&contexts(&h).iter().map(Vec::as_slice).collect::<Vec<_>>()).unwrap();
    let outputs = Array2::from_shape_fn((9, 2), |(m, p)| (4.0 * h[m] + p as f64).sin() + 0.1 * (31.0 * h[m]).cos());
    let metric = array![[2.0, 0.6], [0.6, 1.0]];
    let foreseen = |units: [f64; 2]| {
        let outputs = &outputs * &ndarray::Array1::from(units.to_vec());
        let metric = Array2::from_shape_fn((2, 2), |(p, q)| metric[[p, q]] / units[p] / units[q]);
        let map =
            ContextMap::learn(columns.clone(), &table, outputs.view(), metric.view(), MapSelection::Auto).unwrap();
        std::array::from_fn::<_, 2, _>(|p| map.expect(&[0.4])[p] / units[p])
    };
    let plain = foreseen([1.0, 1.0]);
    for units in [[1e-3, 1e6], [1.0, 1e140], [1e140, 1e-140]] {
        for (p, value) in foreseen(units).into_iter().enumerate() {
            assert_relative_eq!(value, plain[p], epsilon = 1e-9);
        }
    }
}

/// White noise of unit variance, the sum of twelve uniform numbers.
fn white_noise(mut state: u64) -> impl FnMut() -> f64 {
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// The ratio of signal to noise is known from the same few contexts as the noise: bands that ignore that hold 78 % here.
#[test]
fn bands_of_few_contexts_hold_as_many_new_values_as_they_say() {
    let mut noise = white_noise(3);
    let (mut held, mut tried) = (0, 0);
    for _ in 0..600 {
        let h: Vec<f64> = (0..5).map(|m| 0.25 * m as f64 + 0.02 * noise()).collect();
        let outputs = Array2::from_shape_fn((5, 1), |_| noise());
        let map = ContextMap::fit(&contexts(&h), outputs.view(), MapSelection::Auto).unwrap();
        let quantile = StudentsT::new(0.0, 1.0, map.degrees_of_freedom() as f64).unwrap().inverse_cdf(0.95);
        for at in [0.3, 0.45, 0.7] {
            let found = map.predict(&[at]).unwrap();
            let width = quantile * found.covariance.unwrap()[[0, 0]].sqrt();
            held += usize::from((noise() - found.mean[0]).abs() < width);
            tried += 1;
        }
    }
    let share = held as f64 / tried as f64;
    assert!((0.85..0.95).contains(&share), "{share}");
}
