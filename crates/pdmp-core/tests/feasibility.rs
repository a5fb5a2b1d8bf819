//! Comparison with limits, and the nearest conditions that keep them.
#![cfg(feature = "learning")]
#![allow(missing_docs, clippy::needless_range_loop)]

mod common;
#[path = "common/random.rs"]
mod random;

use std::sync::LazyLock;

use common::*;
use pdmp_core::model::Prediction;
use pdmp_core::motion::{
    Limits, TimeGrid, Trajectory, Vary, fastest_tau, feasible, feasible_prediction, nearest_feasible,
};
use pdmp_core::{Conditions, Error, FitOptions, Kind, LimitError, Model, fit, rollout};
use random::Random;

static REACH: LazyLock<Model> = LazyLock::new(|| fit(&reaches(), &FitOptions::new(Kind::Discrete)).unwrap());
static CYCLE: LazyLock<Model> = LazyLock::new(|| fit(&cycles(), &FitOptions::new(Kind::Rhythmic)).unwrap());

/// Returns the movement over its demonstrated duration or period in n steps.
fn movement(model: &Model, conditions: &Conditions, n: usize) -> Trajectory {
    let duration = model.duration() * conditions.time_constant(model.primitive()).unwrap() / model.tau();
    rollout(model.primitive(), conditions, TimeGrid { dt: duration / n as f64, duration: None }).unwrap()
}

/// Returns the movement until it rests, or over a period, in steps ten times finer than those of the search.
fn fine(model: &Model, conditions: &Conditions) -> Trajectory {
    let duration = model.duration() * conditions.time_constant(model.primitive()).unwrap() / model.tau();
    let n_durations = if model.kind() == Kind::Discrete { 3.0 } else { 1.0 };
    let grid = TimeGrid { dt: duration / 20_000.0, duration: Some(n_durations * duration) };
    rollout(model.primitive(), conditions, grid).unwrap()
}

fn extreme(values: ndarray::ArrayView1<f64>) -> f64 {
    values.iter().fold(0.0f64, |most, value| most.max(value.abs()))
}

/// Returns limits at a share of the extremes of a movement.
fn share_of(movement: &Trajectory, share: f64) -> Limits {
    let of = |curve: &ndarray::Array2<f64>| Some(curve.columns().into_iter().map(|c| share * extreme(c)).collect());
    Limits { velocity: of(&movement.velocity), acceleration: of(&movement.acceleration), ..Limits::default() }
}

/// Returns the largest excess over the limits at the samples of a movement, relative to the limits.
fn excess(limits: &Limits, movement: &Trajectory) -> f64 {
    let mut most = f64::NEG_INFINITY;
    for d in 0..movement.position.ncols() {
        for (limit, curve) in [(&limits.velocity, &movement.velocity), (&limits.acceleration, &movement.acceleration)] {
            if let Some(limit) = limit {
                most = most.max(extreme(curve.column(d)) / limit[d] - 1.0);
            }
        }
        if let (Some(lower), Some(upper)) = (&limits.lower, &limits.upper) {
            let range = upper[d] - lower[d];
            movement.position.column(d).iter().for_each(|y| most = most.max((y - upper[d]).max(lower[d] - y) / range));
        }
    }
    most
}

/// Returns the distance of two conditions in the units of the demonstrations, by elimination on the covariances.
fn distance(model: &Model, from: &Conditions, to: &Conditions) -> f64 {
    let demonstrated = model.demonstrated();
    let (centres, [a, b]) = match model.kind() {
        Kind::Discrete => (&demonstrated.goals, [from, to].map(|c| c.goal.clone().unwrap())),
        Kind::Rhythmic => (&demonstrated.anchors, [from, to].map(|c| c.anchor.clone().unwrap())),
    };
    let widest = model.ranges().iter().fold(0.0f64, |widest, range| widest.max(*range));
    let ranges: Vec<f64> = model.ranges().iter().map(|range| range.max(1e-6 * widest)).collect();
    let largest = demonstrated.styles.iter().fold(0.0f64, |m, s| m.max(s.abs()));
    let style = quadratic(
        &demonstrated.styles,
        &vec![largest; model.n_styles()],
        &difference(from.style.as_ref(), to.style.as_ref()),
    );
    style + quadratic(centres, &ranges, &difference(Some(&a), Some(&b)))
}

fn difference(a: Option<&Vec<f64>>, b: Option<&Vec<f64>>) -> Vec<f64> {
    a.unwrap().iter().zip(b.unwrap()).map(|(a, b)| b - a).collect()
}

/// Returns vᵀΣ⁻¹v with the covariance of the rows and a tenth of the ranges.
fn quadratic(rows: &ndarray::Array2<f64>, ranges: &[f64], v: &[f64]) -> f64 {
    let (m, n) = rows.dim();
    let mean = rows.mean_axis(ndarray::Axis(0)).unwrap();
    let mut a: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            let entry = |j: usize| {
                (0..m).map(|k| (rows[[k, i]] - mean[i]) * (rows[[k, j]] - mean[j])).sum::<f64>() / (m - 1) as f64
            };
            let floor = |j: usize| if i == j { (0.1 * ranges[i]).powi(2) } else { 0.0 };
            (0..n).map(|j| entry(j) + floor(j)).chain([v[i]]).collect()
        })
        .collect();
    for i in 0..n {
        let pivot = a[i].clone();
        for row in a.iter_mut().enumerate().filter(|(k, _)| *k != i).map(|(_, row)| row) {
            let factor = row[i] / pivot[i];
            row.iter_mut().zip(&pivot).for_each(|(value, pivot)| *value -= factor * pivot);
        }
    }
    (0..n).map(|i| v[i] * a[i][n] / a[i][i]).sum()
}

/// Requests that leave their limits: a movement of each kind, its limits, and its conditions in full.
fn requests() -> Vec<(&'static Model, Limits, Conditions)> {
    let mut requests = Vec::new();
    for model in [&*REACH, &*CYCLE] {
        let mut conditions = model.conditions(&[model.n_demos() - 1]).unwrap();
        if model.kind() == Kind::Rhythmic {
            conditions.start = None;
        }
        let curves = movement(model, &conditions, 2000);
        requests.push((model, share_of(&curves, 0.95), conditions.clone()));
        let edges = |share: f64| {
            let of = |c: ndarray::ArrayView1<f64>| {
                let [least, most] = [f64::min, f64::max].map(|f| c.iter().copied().fold(c[0], f));
                least + share * (most - least)
            };
            Some(curves.position.columns().into_iter().map(of).collect())
        };
        let lower = if model.kind() == Kind::Discrete { edges(-0.1) } else { edges(0.05) };
        requests.push((model, Limits { lower, upper: edges(0.93), ..Limits::default() }, conditions));
    }
    requests
}

#[test]
fn nearest_conditions_keep_the_limits_on_a_ten_times_finer_grid_until_rest() {
    for (model, limits, request) in requests() {
        assert!(!feasible(model.primitive(), &limits, &request).unwrap().is_feasible());
        let near = nearest_feasible(model, &limits, &request, Vary::Both).unwrap();
        assert!(feasible(model.primitive(), &limits, &near).unwrap().is_feasible());
        let found = excess(&limits, &fine(model, &near));
        assert!(found < 2e-9, "{:?}: {found:e}", model.kind());
        assert_eq!(nearest_feasible(model, &limits, &near, Vary::Both).unwrap(), near);
    }
}

#[test]
fn no_random_feasible_conditions_are_nearer() {
    let mut random = Random(1);
    let mut uniform = || random.next() * 2.0 - 1.0;
    for (model, limits, request) in requests() {
        let near = nearest_feasible(model, &limits, &request, Vary::Both).unwrap();
        let nearest = distance(model, &request, &near);
        let mut n_feasible = 0;
        for trial in 0..600 {
            // Near the result, where nearer feasible conditions would be if there were any.
            let size = 0.3 * 0.5f64.powi(trial % 12);
            let mut moved = near.clone();
            for vector in [&mut moved.style, &mut moved.goal, &mut moved.anchor] {
                vector.iter_mut().flatten().for_each(|value| *value += size * uniform());
            }
            if excess(&limits, &movement(model, &moved, 2000)) <= 0.0 {
                n_feasible += 1;
                let other = distance(model, &request, &moved);
                assert!(other >= nearest * (1.0 - 1e-4), "{:?}: {other} < {nearest}", model.kind());
            }
        }
        assert!(n_feasible > 5, "{:?}: {n_feasible}", model.kind());
    }
}

#[test]
fn a_feasible_request_is_returned_unchanged() {
    for (model, _, request) in requests() {
        let limits = share_of(&movement(model, &request, 2000), 1.01);
        for conditions in [request, Conditions::default()] {
            let limits = if conditions.style.is_some() { limits.clone() } else { Limits::default() };
            assert_eq!(nearest_feasible(model, &limits, &conditions, Vary::Both).unwrap(), conditions);
        }
    }
}

#[test]
fn only_the_varied_conditions_change() {
    let model = &*REACH;
    let request = model.conditions(&[4]).unwrap();
    let height = extreme(movement(model, &request, 2000).position.column(1));
    let limits = Limits { upper: Some(vec![5.0, 0.95 * height, 5.0]), ..Limits::default() };
    let [both, style, goal] =
        [Vary::Both, Vary::Style, Vary::Goal].map(|vary| nearest_feasible(model, &limits, &request, vary).unwrap());
    assert_eq!(Conditions { style: request.style.clone(), ..style.clone() }, request);
    assert_eq!(Conditions { goal: request.goal.clone(), ..goal.clone() }, request);
    let [nearest, by_style, by_goal] = [both, style, goal].map(|found| distance(model, &request, &found));
    assert!(nearest <= by_style.min(by_goal) * (1.0 + 1e-5), "{nearest}, {by_style}, {by_goal}");
}

#[test]
fn margins_are_the_extremes_of_a_finer_rollout() {
    let (model, limits, request) = requests().remove(0);
    let margins = feasible(model.primitive(), &limits, &request).unwrap();
    assert_eq!(margins.position, None);
    let fine = fine(model, &request);
    let most = |limit: &Option<Vec<f64>>, curve: &ndarray::Array2<f64>| {
        let ratios = limit.iter().flatten().zip(curve.columns()).map(|(limit, curve)| extreme(curve) / limit);
        ratios.fold(0.0, f64::max)
    };
    let expected = [most(&limits.velocity, &fine.velocity), most(&limits.acceleration, &fine.acceleration)];
    for (found, expected) in [margins.velocity, margins.acceleration].into_iter().zip(expected) {
        let found = found.unwrap().ratio;
        assert!((found - expected).abs() < 1e-7, "{found} != {expected}");
    }
}

#[test]
fn impossible_limits_name_dof_limit_value_and_remedy() {
    let model = &*REACH;
    let request = model.conditions(&[0]).unwrap();
    let rejected = |limits: &Limits, request: &Conditions, vary: Vary| {
        let error = nearest_feasible(model, limits, request, vary).unwrap_err();
        let Error::Limits(LimitError::Infeasible { dof, quantity, value, limit, slower, .. }) = error else {
            panic!("{error}")
        };
        (error.to_string(), dof, quantity, value, limit, slower)
    };
    // The start lies below the lower limit of the second DoF.
    let start = request.start.clone().unwrap();
    let above = Limits { lower: Some(vec![start[0], start[1] + 0.01, start[2] - 9.0]), ..Limits::default() };
    let (text, dof, quantity, value, limit, slower) = rejected(&above, &request, Vary::Both);
    assert_eq!((dof, quantity, value, limit, slower), (1, "position", start[1], start[1] + 0.01, None), "{text}");
    assert!(text.ends_with("widen the limits, or start inside them"), "{text}");
    // So does a given velocity.
    let fast = Conditions { velocity: Some(vec![0.0, 0.0, -2.0]), ..request.clone() };
    let (text, dof, quantity, value, limit, slower) =
        rejected(&Limits { velocity: Some(vec![1.5]), ..Limits::default() }, &fast, Vary::Both);
    assert_eq!((dof, quantity, value, limit, slower), (2, "velocity", -2.0, -1.5, None), "{text}");
    assert!(text.ends_with("or start with a lower velocity"), "{text}");
    // The way to the goal remains; the factor is that of the smallest constant τ.
    let limits = share_of(&movement(model, &request, 2000), 0.3);
    let (text, _, quantity, value, limit, slower) = rejected(&limits, &request, Vary::Style);
    assert!(quantity != "position" && value.abs() > limit.abs(), "{text}");
    assert!(text.contains("or vary both, or let the movement last 3.33"), "{text}");
    let tau = request.time_constant(model.primitive()).unwrap();
    let expected = fastest_tau(model.primitive(), &limits, &request).unwrap() / tau;
    assert!((slower.unwrap() / expected - 1.0).abs() < 1e-9, "{slower:?} != {expected}");
    // No limit is too tight for a clear error or an answer.
    for tight in [1e-3, 1e-9, 1e-100] {
        let limits = Limits { acceleration: Some(vec![tight]), ..Limits::default() };
        rejected(&limits, &request, Vary::Goal);
        if let Ok(near) = nearest_feasible(model, &limits, &request, Vary::Both) {
            assert!(feasible(model.primitive(), &limits, &near).unwrap().is_feasible());
        }
    }
}

#[test]
fn a_request_far_from_the_demonstrations_is_met() {
    for (model, limits, request) in requests() {
        let deviation = |style: &f64| 300.0 * style;
        let far = Conditions { style: request.style.as_ref().map(|s| s.iter().map(deviation).collect()), ..request };
        let near = nearest_feasible(model, &limits, &far, Vary::Both).unwrap();
        assert!(excess(&limits, &fine(model, &near)) < 2e-9);
    }
}

#[test]
fn predictions_within_limits_keep_what_the_context_determines() {
    let prediction = REACH.predict(&[0.7]).unwrap();
    let limits = share_of(&fine(&REACH, &prediction.conditions), 0.95);
    let inside = feasible_prediction(&REACH, &limits, prediction.clone(), Vary::Both).unwrap();
    assert!(excess(&limits, &fine(&REACH, &inside.conditions)) < 2e-9);
    assert_eq!(Prediction { conditions: prediction.conditions.clone(), ..inside.clone() }, prediction);
    let by_demonstrations = nearest_feasible(&REACH, &limits, &prediction.conditions, Vary::Both).unwrap();
    let n = REACH.n_styles() + REACH.n_dofs();
    let covariance = prediction.covariance.as_ref().unwrap();
    let precision = nalgebra::DMatrix::from_fn(n, n, |i, j| covariance[[i, j]] + if i == j { 1e-9 } else { 0.0 });
    let values = |conditions: &Conditions| {
        nalgebra::DVector::from_iterator(n, conditions.style.iter().chain(&conditions.goal).flatten().copied())
    };
    let surprise = |conditions: &Conditions| {
        let change = values(conditions) - values(&prediction.conditions);
        change.dot(&precision.clone().lu().solve(&change).unwrap())
    };
    assert!(surprise(&inside.conditions) < surprise(&by_demonstrations));
    let wide = share_of(&fine(&REACH, &prediction.conditions), 1.01);
    assert_eq!(feasible_prediction(&REACH, &wide, prediction.clone(), Vary::Both).unwrap(), prediction);
}

#[test]
fn a_movement_counts_until_it_rests_past_its_end() {
    let passing = Conditions { goal_velocity: Some(vec![1.0, 0.0, 0.0]), ..REACH.conditions(&[1]).unwrap() };
    let goal = passing.goal.clone().unwrap();
    let limits = Limits { upper: Some(vec![goal[0] + 1e-3, 9.0, 9.0]), ..Limits::default() };
    let duration = REACH.duration() * passing.time_constant(REACH.primitive()).unwrap() / REACH.tau();
    let beyond = feasible(REACH.primitive(), &limits, &passing).unwrap().position.unwrap();
    assert!(beyond.ratio > 0.0 && beyond.time > duration, "{beyond:?}");
}

#[test]
fn a_movement_may_start_on_a_limit_of_the_position() {
    let model = &*REACH;
    let request = model.conditions(&[4]).unwrap();
    let start = request.start.clone().unwrap();
    let height = extreme(movement(model, &request, 2000).position.column(1));
    let lower = Some(vec![start[0], start[1], -5.0]);
    let limits = Limits { lower, upper: Some(vec![5.0, 0.9 * height, 5.0]), ..Limits::default() };
    let near = nearest_feasible(model, &limits, &request, Vary::Both).unwrap();
    assert!(near != request && feasible(model.primitive(), &limits, &near).unwrap().is_feasible());
}

#[test]
fn the_fastest_tau_is_at_the_border_of_feasibility() {
    let (model, limits, request) = requests().remove(0);
    let tau = fastest_tau(model.primitive(), &limits, &request).unwrap();
    for (factor, expected) in [(1.0, true), (1.0 - 1e-8, false)] {
        let conditions = Conditions { tau: Some(factor * tau), segment_durations: None, ..request.clone() };
        assert_eq!(feasible(model.primitive(), &limits, &conditions).unwrap().is_feasible(), expected, "{factor}");
    }
}
