use approx::assert_relative_eq;
use ndarray::{Array2, Axis, array};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::model_selection::TrainingSet;
use super::*;

fn contexts(numbers: &[f64]) -> Vec<Vec<ContextValue>> {
    numbers.iter().map(|&h| vec![h.into()]).collect()
}

fn linear(numbers: &[f64], outputs: &Array2<f64>) -> ContextMap {
    ContextMap::fit(&contexts(numbers), outputs.view(), MapSelection::Given(ContextMapKind::Linear)).unwrap()
}

/// Linear data are predicted exactly by least squares and to 1e-6 by `Auto`, in interpolation and extrapolation.
#[test]
fn linear_data_are_predicted_exactly() {
    let h = [0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9];
    let outputs = Array2::from_shape_fn((7, 1), |(m, _)| h[m]).dot(&array![[2.0, -1.0, 0.5, 0.1]]) + 0.7;
    let maps = [MapSelection::Given(ContextMapKind::Linear), MapSelection::Auto]
        .map(|selection| ContextMap::fit(&contexts(&h), outputs.view(), selection).unwrap());
    assert_eq!(maps[1].kind(), ContextMapKind::Stacked);
    for (map, accuracy) in maps.iter().zip([1e-12, 1e-6]) {
        for at in [0.6, 2.0] {
            let prediction = map.predict(&[at]).unwrap();
            for (p, slope) in [2.0, -1.0, 0.5, 0.1].into_iter().enumerate() {
                assert_relative_eq!(prediction.mean[p], slope * at + 0.7, epsilon = accuracy);
            }
        }
    }
    assert!(maps[0].predict(&[2.0]).unwrap().covariance.unwrap().iter().all(|c| c.abs() < 1e-20));
}

/// The number of context values includes labels and constant values.
#[test]
fn the_number_of_inputs_is_that_of_the_context_values() {
    let outputs = array![[0.0], [1.0], [2.0], [3.5]];
    assert_eq!(linear(&[0.0, 0.1, 0.2, 0.3], &outputs).columns().len(), 1);
    let row = |height: f64, name: &str| vec![height.into(), name.into(), 7.0.into()];
    let rows = [row(0.0, "a"), row(0.1, "b"), row(0.2, "c"), row(0.3, "a")];
    let map = ContextMap::fit(&rows, outputs.view(), Default::default()).unwrap();
    assert_eq!(map.columns().len(), 3);
    assert!(map.predict(&row(0.1, "b")).is_ok());
    assert!(map.predict(&row(0.1, "b")[..2]).is_err());
}

/// The error for empty contexts or NaN names the demonstration, for every kind of map.
#[test]
fn empty_contexts_and_nan_are_rejected() {
    let message = |contexts: &[Vec<ContextValue>], selection| {
        let outputs = Array2::zeros((contexts.len(), 2));
        ContextMap::fit(contexts, outputs.view(), selection).unwrap_err().to_string()
    };
    for selection in [ContextMapKind::Linear, ContextMapKind::Polynomial, ContextMapKind::Gp].map(MapSelection::Given) {
        assert!(message(&[], selection).contains("contexts is empty"));
        assert!(message(&[vec![], vec![]], selection).contains("context is empty"));
        assert!(message(&contexts(&[0.0, f64::NAN, 1.0]), selection).contains("demo 1: context[0] = NaN"));
    }
}

/// Mean and covariance equal those of the normal equations, solved by Cramer's rule.
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
    let prediction = map.predict(&[at]).unwrap();
    assert_relative_eq!(prediction.mean[0], intercept + slope * at, epsilon = 1e-12);
    assert_relative_eq!(prediction.covariance.unwrap()[[0, 0]], variance, epsilon = 1e-12);
}

/// A context value that does not vary, or a single demonstration, predicts the mean; another value extrapolates infinitely.
#[test]
fn constant_contexts_predict_the_mean() {
    let outputs = array![[1.0, 0.0], [3.0, 0.0]];
    let prediction = linear(&[0.5, 0.5], &outputs).predict(&[9.0]).unwrap();
    assert_relative_eq!(prediction.mean[0], 2.0, epsilon = 1e-12);
    // The variance 2 of the two, times 1/2 for their mean and 1 for a new movement.
    assert_relative_eq!(prediction.covariance.unwrap()[[0, 0]], 3.0, epsilon = 1e-12);
    assert_eq!(prediction.extrapolation, [f64::INFINITY]);
    let prediction = linear(&[0.5], &outputs.select(Axis(0), &[0])).predict(&[9.0]).unwrap();
    assert_relative_eq!(prediction.mean[0], 1.0, epsilon = 1e-12);
    assert!(prediction.covariance.is_none());
}

/// The closed form equals the errors of fits without each context in turn, with equal hyperparameters.
#[test]
fn leave_one_out_errors_equal_those_of_repeated_fits() {
    let h = [0.0, 0.2, 0.5, 0.6, 0.9, 1.3];
    let y = Array2::from_shape_fn((6, 2), |(m, p)| (3.0 * h[m] + p as f64).sin() + 0.1 * (17.0 * h[m]).cos());
    for kernel in [None, Some(Kernel::Quadratic), Some(Kernel::Matern { length: 0.8 })] {
        let features = Array2::from_shape_fn((6, 1), |(m, _)| h[m]);
        let ratios = if kernel.is_some() { [2.0, 0.3] } else { [0.0; 2] };
        let model = |features: ArrayView2<f64>, outputs: ArrayView2<f64>| {
            let training = TrainingSet { features, n_inputs: 1, outputs };
            KrigingModel::with_ratios(kernel, &training, ratios.to_vec()).unwrap()
        };
        let errors = model(features.view(), y.view()).leave_one_out_errors();
        for m in 0..6 {
            let others: Vec<usize> = (0..6).filter(|&k| k != m).collect();
            let (features, outputs) = (features.select(Axis(0), &others), y.select(Axis(0), &others));
            let mean = Predictor::new(model(features.view(), outputs.view())).mean(&[h[m]]);
            for p in 0..2 {
                assert_relative_eq!(errors[[m, p]], y[[m, p]] - mean[p], epsilon = 1e-10);
            }
        }
    }
}

/// Mean and variance are those of a Gaussian process whose constant has a very large prior variance.
#[test]
fn kriging_is_the_limit_of_a_vague_prior() {
    let h = [0.0, 0.2, 0.5, 0.6, 1.3];
    let y = array![[0.3], [0.9], [0.1], [-0.4], [0.7]];
    let (kernel, ratio, vague) = (Kernel::Matern { length: 0.7 }, 1.7, 1e6);
    let features = Array2::from_shape_fn((5, 1), |(m, _)| h[m]);
    let training = TrainingSet { features: features.view(), n_inputs: 1, outputs: y.view() };
    let predictor = Predictor::new(KrigingModel::with_ratios(Some(kernel), &training, vec![ratio]).unwrap());
    let k = |a: f64, b: f64| ratio * kernel.covariance(&[a], &[b], 1) + vague;
    let covariance = nalgebra::DMatrix::from_fn(5, 5, |i, j| k(h[i], h[j]) + f64::from(i == j));
    let factor = covariance.cholesky().unwrap();
    for at in [0.4, 3.0] {
        let cross = nalgebra::DVector::from_fn(5, |i, _| k(at, h[i]));
        let weights = factor.solve(&cross);
        let mean: f64 = (0..5).map(|i| weights[i] * y[[i, 0]]).sum();
        let kriging = &predictor.kriging;
        assert_relative_eq!(predictor.mean(&[at])[0], mean, epsilon = 1e-5);
        let variance = kriging.variance(&kriging.location(&[at]), ratio);
        assert_relative_eq!(variance, k(at, at) - cross.dot(&weights), epsilon = 1e-5);
    }
}

/// `Auto` fits a nonlinear function, and predicts the mean of noise without a trend.
#[test]
fn auto_fits_a_curve_and_averages_noise() {
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

/// Least squares predicts the mean of each label; a Gaussian process shrinks it towards the mean of all.
#[test]
fn each_label_has_its_own_prediction() {
    let rows = [("old", 1.0), ("old", 1.2), ("proud", 3.0), ("proud", 3.2), ("young", 5.0), ("young", 5.2)];
    let contexts: Vec<Vec<ContextValue>> = rows.iter().map(|(label, _)| vec![(*label).into()]).collect();
    let outputs = Array2::from_shape_fn((6, 1), |(m, _)| rows[m].1);
    for kind in [ContextMapKind::Linear, ContextMapKind::Gp] {
        let map = ContextMap::fit(&contexts, outputs.view(), MapSelection::Given(kind)).unwrap();
        for (label, expected) in [("old", 1.1), ("proud", 3.1), ("young", 5.1)] {
            let prediction = map.predict(&[label]).unwrap();
            match kind {
                ContextMapKind::Linear => assert_relative_eq!(prediction.mean[0], expected, epsilon = 1e-12),
                // Three labels determine their variance poorly: the shrinkage is strong, but at most 70 %.
                _ => assert!(
                    (prediction.mean[0] - 3.1).abs() >= 0.3 * (expected - 3.1f64).abs(),
                    "{label} {prediction:?}"
                ),
            }
        }
    }
}

/// Repetitions of a context leave the mean unchanged, and add the variance within contexts to that of a new movement.
#[test]
fn repetitions_of_a_context_are_averaged() {
    let once = linear(&[0.0, 1.0, 2.0], &array![[0.0], [2.0], [1.0]]);
    let often = linear(&[0.0, 0.0, 0.0, 1.0, 2.0], &array![[-0.3], [0.3], [0.0], [2.0], [1.0]]);
    let [once, often] = [once, often].map(|map| map.predict(&[1.5]).unwrap());
    assert_relative_eq!(once.mean[0], often.mean[0], epsilon = 1e-12);
    // The variance within is 0.09; the mean of 1/n over the contexts, with n = 3, 1 and 1, is the share of it in the means.
    let added = 0.09 * (1.0 - (1.0 / 3.0 + 2.0) / 3.0);
    assert_relative_eq!(often.covariance.unwrap()[[0, 0]], once.covariance.unwrap()[[0, 0]] + added, epsilon = 1e-12);
}

/// Predictions do not depend on the units of the outputs.
#[test]
fn units_of_outputs_do_not_matter() {
    let h: Vec<f64> = (0..9).map(|k| k as f64 / 8.0).collect();
    let (columns, table) = tabulate(&contexts(&h).iter().map(Vec::as_slice).collect::<Vec<_>>()).unwrap();
    let outputs = Array2::from_shape_fn((9, 2), |(m, p)| (4.0 * h[m] + p as f64).sin() + 0.1 * (31.0 * h[m]).cos());
    let metric = array![[2.0, 0.6], [0.6, 1.0]];
    let predict_in = |units: [f64; 2]| {
        let outputs = &outputs * &ndarray::Array1::from(units.to_vec());
        let metric = Array2::from_shape_fn((2, 2), |(p, q)| metric[[p, q]] / units[p] / units[q]);
        let map =
            ContextMap::learn(columns.clone(), &table, outputs.view(), metric.view(), MapSelection::Auto).unwrap();
        std::array::from_fn::<_, 2, _>(|p| map.predict_mean(&[0.4])[p] / units[p])
    };
    let plain = predict_in([1.0, 1.0]);
    for units in [[1e-3, 1e6], [1.0, 1e140], [1e140, 1e-140]] {
        for (p, value) in predict_in(units).into_iter().enumerate() {
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

/// 90 % bands within the range of five contexts cover 85 to 95 % of new values; without a degree of freedom for the ratio,
/// they would cover 78 %.
#[test]
fn bands_of_few_contexts_have_their_nominal_coverage() {
    let mut noise = white_noise(3);
    let (mut n_covered, mut n_trials) = (0, 0);
    for _ in 0..600 {
        let h: Vec<f64> = (0..5).map(|m| 0.25 * m as f64 + 0.02 * noise()).collect();
        let outputs = Array2::from_shape_fn((5, 1), |_| noise());
        let map = ContextMap::fit(&contexts(&h), outputs.view(), MapSelection::Auto).unwrap();
        let quantile = StudentsT::new(0.0, 1.0, map.degrees_of_freedom() as f64).unwrap().inverse_cdf(0.95);
        for at in [0.3, 0.45, 0.7] {
            let prediction = map.predict(&[at]).unwrap();
            let width = quantile * prediction.covariance.unwrap()[[0, 0]].sqrt();
            n_covered += usize::from((noise() - prediction.mean[0]).abs() < width);
            n_trials += 1;
        }
    }
    let coverage = n_covered as f64 / n_trials as f64;
    assert!((0.85..0.95).contains(&coverage), "{coverage}");
}

/// Just beyond contexts that determine the outputs, deviations are hardly larger than within, and larger than the errors; beyond
/// contexts without effect, they are those of the outputs.
#[test]
fn deviations_grow_gradually_beyond_the_contexts() {
    let curves: [fn(f64) -> f64; 4] = [|h| h, |h| 2.0 * h * h, |h| (3.0 * h).sin(), |h| (3.0 * h).tanh()];
    for curve in curves {
        let mut noise = white_noise(5);
        let h: Vec<f64> = (0..9).map(|m| m as f64 / 8.0).collect();
        let outputs = Array2::from_shape_fn((9, 1), |(m, _)| curve(h[m]) + 0.002 * noise());
        let map = ContextMap::fit(&contexts(&h), outputs.view(), MapSelection::Auto).unwrap();
        let deviation = |at: f64| map.predict(&[at]).unwrap().covariance.unwrap()[[0, 0]].sqrt();
        let border = deviation(1.0);
        assert!(deviation(1.0 + 1e-9) < 1.0001 * border);
        for (at, most) in [(1.01, 2.0), (1.07, 6.0)] {
            let error = (map.predict(&[at]).unwrap().mean[0] - curve(at)).abs();
            assert!(deviation(at) < most * border, "{at}: {} at the border, {}", border, deviation(at));
            assert!(error < 2.0 * deviation(at), "{at}: {error} above {}", deviation(at));
        }
        assert!(deviation(2.0) > 10.0 * border, "{border} at the border, {} far beyond", deviation(2.0));
    }
    let mut noise = white_noise(8);
    let h: Vec<f64> = (0..40).map(|m| m as f64 / 39.0).collect();
    let outputs = Array2::from_shape_fn((40, 1), |_| noise());
    let map = ContextMap::fit(&contexts(&h), outputs.view(), MapSelection::Auto).unwrap();
    let deviation = map.predict(&[1.05]).unwrap().covariance.unwrap()[[0, 0]].sqrt();
    assert!((0.7..1.6).contains(&deviation), "{deviation}");
}

/// Deviations are those from the prediction by the other contexts: of a line, from one fitted to them, with a context that was
/// repeated; of every kind, with the mean square that the map states.
#[test]
fn deviations_are_those_from_the_other_contexts() {
    let h = [0.0, 0.1, 0.25, 0.25, 0.4, 0.7, 1.0];
    let outputs = Array2::from_shape_fn((7, 2), |(m, p)| (3.0 * h[m] + p as f64).sin() + 0.05 * (7.0 * m as f64).cos());
    let table = Array2::from_shape_fn((7, 1), |(m, _)| h[m]);
    let deviations = linear(&h, &outputs).deviations(&table, outputs.view()).unwrap();
    for m in 0..7 {
        let others: Vec<usize> = (0..7).filter(|&k| h[k] != h[m]).collect();
        let known: Vec<f64> = others.iter().map(|&k| h[k]).collect();
        let prediction = linear(&known, &outputs.select(Axis(0), &others)).predict(&[h[m]]).unwrap().mean;
        for p in 0..2 {
            assert_relative_eq!(deviations[[m, p]], outputs[[m, p]] - prediction[p], epsilon = 1e-9);
        }
    }
    for kind in ContextMapKind::ALL {
        let map = ContextMap::fit(&contexts(&h), outputs.view(), MapSelection::Given(kind)).unwrap();
        let deviations = map.deviations(&table, outputs.view()).unwrap();
        let repeated = (&deviations.row(2) + &deviations.row(3)) / 2.0;
        let squares: f64 = [0, 1, 4, 5, 6].iter().map(|&m| deviations.row(m).dot(&deviations.row(m))).sum();
        assert_relative_eq!((squares + repeated.dot(&repeated)) / 6.0, map.errors()[0].1, max_relative = 1e-9);
    }
}

/// The deviation of a movement with a label is that from the others of the label; of the only one, from all others.
#[test]
fn deviations_of_labels_are_those_from_the_others_of_the_label() {
    let labels = ["a", "b", "a", "a", "c"].map(|label| vec![label.into()]);
    let outputs = array![[1.0], [5.0], [2.0], [6.0], [8.0]];
    let map = ContextMap::fit(&labels, outputs.view(), MapSelection::Auto).unwrap();
    let numbers = array![[0.0], [1.0], [0.0], [0.0], [2.0]];
    let deviations = map.deviations(&numbers, outputs.view()).unwrap();
    // The mean of each label counts once: (3 + 8)/2 and (3 + 5)/2 without "b" and "c".
    let expected = array![[1.0 - 4.0], [5.0 - 5.5], [2.0 - 3.5], [6.0 - 1.5], [8.0 - 4.0]];
    assert!((&deviations - &expected).iter().all(|error| error.abs() < 1e-12), "{deviations}");
}
