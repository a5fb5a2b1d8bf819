//! Vector-Jacobian products of batches agree with Jacobians and with differences of rollouts.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;

use std::sync::Arc;

use common::*;
use ndarray::{Array2, Array3, ArrayView3, Axis, s};
use pdmp_core::inference::{At, PassageOptions, ViaPoint, through};
use pdmp_core::learning::{TimeScaling, Truncation};
use pdmp_core::model::{Derivative, TimeWarp};
use pdmp_core::motion::{self, Batch, BatchConditions, PerMovement, TimeGrid, WithRespectTo, batch};
use pdmp_core::numerics::Threads;
use pdmp_core::{Conditions, Demonstration, Error, Kind, Model, rollout};
use proptest::prelude::*;

fn prepared(model: &Arc<Model>, conditions: &BatchConditions, grid: TimeGrid) -> Batch {
    batch(model.primitive(), conditions.clone(), grid, &mut |_| Ok(())).unwrap()
}

fn gradients(batch: &Batch, variables: &[WithRespectTo], cotangents: &[Array3<f64>]) -> Vec<Array2<f64>> {
    let cotangents: Vec<ArrayView3<f64>> = cotangents.iter().map(|array| array.view()).collect();
    batch.vector_jacobian(0..batch.shape().0, variables, &cotangents, Threads::ONE, &mut |_| Ok(())).unwrap()
}

/// Numbers in [-1, 1] without a pattern.
fn noise(shape: (usize, usize, usize), seed: u64) -> Array3<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    Array3::from_shape_simple_fn(shape, || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    })
}

fn rows(rows: &Option<PerMovement>, b: usize) -> Option<Vec<f64>> {
    rows.as_ref().map(|rows| match rows {
        PerMovement::All(row) => row.clone(),
        PerMovement::Each(rows) => rows.row(b).to_vec(),
    })
}

fn condition(conditions: &BatchConditions, b: usize) -> Conditions {
    Conditions {
        style: rows(&conditions.style, b),
        goal: rows(&conditions.goal, b),
        anchor: rows(&conditions.anchor, b),
        start: rows(&conditions.start, b),
        velocity: rows(&conditions.velocity, b),
        goal_velocity: rows(&conditions.goal_velocity, b),
        amplitude: rows(&conditions.amplitude, b).map(|r| r[0]),
        tau: rows(&conditions.tau, b).map(|tau| tau[0]),
        ..Conditions::default()
    }
}

/// Variables of a batch: those of its kind whose conditions it has.
fn variables(kind: Kind, conditions: &BatchConditions) -> Vec<WithRespectTo> {
    let discrete = kind == Kind::Discrete;
    [
        (WithRespectTo::Style, true),
        (WithRespectTo::Goal, discrete),
        (WithRespectTo::Anchor, !discrete),
        (WithRespectTo::Start, discrete || conditions.start.is_some()),
        (WithRespectTo::Velocity, conditions.velocity.is_some()),
        (WithRespectTo::GoalVelocity, conditions.goal_velocity.is_some()),
        (WithRespectTo::Amplitude, !discrete),
        (WithRespectTo::Tau, true),
    ]
    .into_iter()
    .filter_map(|(variable, present)| present.then_some(variable))
    .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// The products are sums of cotangents times the Jacobians, whose columns are differences of rollouts, for every
    /// variable and set of conditions, and do not depend on the division into ranges and threads.
    #[test]
    fn products_are_those_with_the_jacobians(
        (start, velocity, goal_velocity) in (any::<bool>(), any::<bool>(), any::<bool>()),
        amplitude in prop_oneof![Just(0.0), 0.1..3.0f64],
        factor in 0.4..2.5f64,
        (orders, samples, n, seed) in (1usize..4, 2usize..400, 1usize..5, any::<u64>()),
    ) {
        for model in [&*REACH, &*CYCLE] {
            let (n_dofs, discrete) = (model.n_dofs(), model.kind() == Kind::Discrete);
            let vectors = |columns: usize, seed| PerMovement::Each(noise((1, n, columns), seed).index_axis_move(Axis(0), 0));
            let conditions = BatchConditions {
                style: Some(vectors(2, seed)),
                goal: discrete.then(|| vectors(n_dofs, seed + 1)),
                anchor: (!discrete).then(|| vectors(n_dofs, seed + 1)),
                start: start.then(|| vectors(n_dofs, seed + 2)),
                velocity: velocity.then(|| vectors(n_dofs, seed + 3)),
                goal_velocity: (discrete && goal_velocity).then(|| vectors(n_dofs, seed + 4)),
                amplitude: (!discrete).then(|| amplitude.into()),
                tau: Some((factor * model.tau()).into()),
                ..BatchConditions::default()
            };
            let grid = grid(0.01, 0.01 * (samples - 1) as f64);
            let variables = variables(model.kind(), &conditions);
            let prepared = prepared(model, &conditions, grid);
            let cotangents: Vec<_> = (0..orders).map(|k| noise(prepared.shape(), seed + 9 + k as u64)).collect();
            let found = gradients(&prepared, &variables, &cotangents);
            for b in 0..n {
                let one = condition(&conditions, b);
                for (variable, found) in variables.iter().zip(&found) {
                    let mut expected = vec![0.0; found.ncols()];
                    let mut size = 1.0f64;
                    for (order, cotangents) in Derivative::ALL.into_iter().zip(&cotangents) {
                        let jacobian =
                            motion::jacobian(model.primitive(), *variable, order, &one, grid, &mut |_| Ok(())).unwrap();
                        for ((t, d, column), entry) in jacobian.indexed_iter() {
                            expected[column] += entry * cotangents[[b, t, d]];
                            size = size.max(entry.abs());
                        }
                    }
                    for (found, expected) in found.row(b).iter().zip(&expected) {
                        let error = (found - expected).abs();
                        prop_assert!(error < 1e-12 * size * samples as f64, "{variable:?} {found} {expected}");
                    }
                }
            }
            let views: Vec<_> = cotangents.iter().map(|array| array.slice(s![n - 1.., .., ..])).collect();
            let threads = Threads::new(3).unwrap();
            let last = prepared.vector_jacobian(n - 1..n, &variables, &views, threads, &mut |_| Ok(())).unwrap();
            for (last, all) in last.iter().zip(&found) {
                prop_assert_eq!(last.row(0), all.row(n - 1));
            }
        }
    }
}

/// Movements whose derivatives by τ the tests compare: both kinds and both transports, with and without given velocities,
/// phase and additional forcing, at a τ of their own.
fn cases_by_tau() -> Vec<(Arc<Model>, Conditions)> {
    let mut cases = Vec::new();
    for model in [REACH.clone(), CYCLE.clone(), at_once()] {
        let (n, discrete) = (model.n_dofs(), model.kind() == Kind::Discrete);
        let own = Conditions {
            style: Some(vec![0.2, -0.3]),
            tau: Some(1.3171 * model.tau()),
            amplitude: (!discrete).then_some(0.7),
            ..Conditions::default()
        };
        let moved = Conditions {
            goal: discrete.then(|| vec![1.4; n]),
            start: Some(vec![0.4; n]),
            velocity: Some(vec![0.7; n]),
            ..own.clone()
        };
        let points = [ViaPoint::new(At::Time(0.4 * model.duration()), vec![0.5; n])];
        let forced = through(&model, &points, &own, &PassageOptions::default()).unwrap();
        let both = Conditions { forcing: Some(forced.forcing), ..moved.clone() };
        if model.kind() == Kind::Rhythmic {
            cases.push((model.clone(), Conditions { phase: Some(4.0), ..moved.clone() }));
            cases.push((model.clone(), Conditions { phase: Some(0.3), ..both.clone() }));
        } else if model.primitive().braking().is_some() {
            let last = Some(vec![-0.6; n]);
            cases.push((model.clone(), Conditions { goal_velocity: last.clone(), ..own.clone() }));
            cases.push((model.clone(), Conditions { goal_velocity: last.clone(), ..moved.clone() }));
            cases.push((model.clone(), Conditions { goal_velocity: last, ..both.clone() }));
        }
        cases.extend([own, moved, both].map(|one| (model.clone(), one)));
    }
    cases
}

/// The Jacobian by τ of positions, velocities and accelerations is the central difference of rollouts at fixed times, beyond the
/// end too. Where the slope of the acceleration jumps within the step, at a knot, the difference lies between both slopes.
#[test]
fn jacobian_by_tau_is_a_difference_of_rollouts() {
    let (mut compared, mut at_jumps) = (0, 0);
    for (case, (model, conditions)) in cases_by_tau().iter().enumerate() {
        if conditions.phase.is_some() {
            continue;
        }
        let (tau, step, grid) = (conditions.tau.unwrap(), 1e-6, grid(3.7e-3, 1.7 * model.duration()));
        let [behind, here, ahead] = [-step, 0.0, step].map(|step| {
            let moved = Conditions { tau: Some(tau * (1.0 + step)), ..conditions.clone() };
            let movement = rollout(model.primitive(), &moved, grid).unwrap();
            [movement.position, movement.velocity, movement.acceleration]
        });
        for (k, order) in Derivative::ALL.into_iter().enumerate() {
            let variable = WithRespectTo::Tau;
            let found =
                motion::jacobian(model.primitive(), variable, order, conditions, grid, &mut |_| Ok(())).unwrap();
            let size = found.iter().fold(0.0f64, |size, entry| size.max(entry.abs()));
            for ((t, d, _), found) in found.indexed_iter() {
                let [a, b, c] = [&behind, &here, &ahead].map(|movement| movement[k][[t, d]]);
                let [before, after] = [(b - a) / (step * tau), (c - b) / (step * tau)];
                let (error, jump) = ((found - 0.5 * (before + after)).abs(), 0.5 * (after - before).abs());
                assert!(error < jump + 1e-5 * size, "{case} {order:?} at {t}, {d}: {found} {before} {after}");
                compared += 1;
                at_jumps += usize::from(jump > 1e-3 * size);
            }
        }
    }
    assert!(compared > 30_000 && at_jumps * 200 < compared, "{at_jumps} of {compared}");
}

/// At samples on the knots of the forcing table and of the transport profile, where the slope of the acceleration jumps, the
/// derivative by τ is the mean of the slopes on both sides.
#[test]
fn derivative_by_tau_at_a_knot_is_the_mean_of_both_sides() {
    let (model, mut jumps) = (&*REACH, 0);
    let tau = 1.3 * model.tau();
    let grid = grid(model.duration() * 1.3 / 64.0, model.duration() * 1.5);
    let conditions = Conditions { start: Some(vec![0.5; 3]), tau: Some(tau), ..Conditions::default() };
    let (order, variable) = (Derivative::Acceleration, WithRespectTo::Tau);
    let found = motion::jacobian(model.primitive(), variable, order, &conditions, grid, &mut |_| Ok(())).unwrap();
    let at = |step: f64| {
        let moved = Conditions { tau: Some(tau * (1.0 + step)), ..conditions.clone() };
        rollout(model.primitive(), &moved, grid).unwrap().acceleration
    };
    let step = 1e-6;
    let movements = [-2.0 * step, -step, step, 2.0 * step].map(at);
    let size = found.iter().fold(0.0f64, |size, entry| size.max(entry.abs()));
    for ((t, d, _), found) in found.indexed_iter().filter(|((t, ..), _)| *t != 64) {
        // Slopes on both sides, each from two movements on it.
        let [a, b, c, e] = movements.each_ref().map(|movement| movement[[t, d]]);
        let [before, after] = [(b - a) / (step * tau), (e - c) / (step * tau)];
        assert!((found - 0.5 * (before + after)).abs() < 3e-4 * size, "{t} {d}: {found} {before} {after}");
        jumps += usize::from((after - before).abs() > 1e-2 * size);
    }
    assert!(jumps > 10, "{jumps}");
}

/// The gradients by τ are those of the Jacobian, by differences of rollouts for a phase, with response curves in common and
/// without.
#[test]
fn gradients_by_tau_are_those_of_rollouts() {
    for (case, (model, conditions)) in cases_by_tau().iter().enumerate() {
        let (grid, tau) = (grid(3.7e-3, 1.7 * model.duration()), conditions.tau.unwrap());
        let other = Conditions { tau: Some(0.8 * tau), ..conditions.clone() };
        let phased = conditions.phase.is_some();
        for movements in [vec![conditions.clone()], vec![conditions.clone(), other]] {
            let all = BatchConditions::each(model.primitive(), &movements).unwrap();
            let prepared = prepared(model, &all, grid);
            let cotangents: Vec<_> = (0..3).map(|k| noise(prepared.shape(), 5 + k)).collect();
            let found = &gradients(&prepared, &[WithRespectTo::Tau], &cotangents)[0];
            for (b, one) in movements.iter().enumerate() {
                let (mut expected, mut size) = (0.0, 0.0f64);
                let tau = one.tau.unwrap();
                for (k, order) in Derivative::ALL.into_iter().enumerate() {
                    let entries = match phased {
                        false => {
                            let by_tau = WithRespectTo::Tau;
                            motion::jacobian(model.primitive(), by_tau, order, one, grid, &mut |_| Ok(()))
                                .unwrap()
                                .remove_axis(Axis(2))
                        }
                        true => {
                            let [behind, ahead] = [-1e-6, 1e-6].map(|step| {
                                let moved = Conditions { tau: Some(tau * (1.0 + step)), ..one.clone() };
                                let movement = rollout(model.primitive(), &moved, grid).unwrap();
                                [movement.position, movement.velocity, movement.acceleration]
                            });
                            (&ahead[k] - &behind[k]) / (2e-6 * tau)
                        }
                    };
                    let products = &cotangents[k].index_axis(Axis(0), b) * &entries;
                    expected += products.sum();
                    size += products.mapv(f64::abs).sum();
                }
                let tolerance = if phased { 1e-5 } else { 1e-11 };
                let found = found[[b, 0]];
                assert!((found - expected).abs() < tolerance * size, "{case} {b}: {found} {expected} {size}");
            }
        }
    }
}

/// Model of the reaches with immediate transport.
fn at_once() -> Arc<Model> {
    let mut options = options(Kind::Discrete).n_styles(Truncation::Rank(2));
    options.canonical = immediate();
    learn(&reaches(), &options)
}

/// Models of the tests of movements with a timing of their own: learnt and immediate transport, rhythmic, and both kinds in
/// warped time.
fn timed_models() -> Vec<Arc<Model>> {
    let warped = |demos: &[Demonstration], kind| {
        let options = options(kind).n_styles(Truncation::Rank(2)).time_scaling(TimeScaling::Warp(TimeWarp::default()));
        learn(demos, &options)
    };
    vec![REACH.clone(), CYCLE.clone(), at_once(), warped(&reaches(), Kind::Discrete), warped(&cycles(), Kind::Rhythmic)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Movements of different τ, phase or segment durations have the gradients of their own conditions: differences of their
    /// rollouts, which are linear in all conditions but τ, whose gradient is that of a batch of one where it has one.
    #[test]
    fn movements_of_their_own_timing_have_their_own_gradients(
        (start, velocity, goal_velocity) in (any::<bool>(), any::<bool>(), any::<bool>()),
        (dt, samples) in prop_oneof![(Just(0.003), 2usize..600), (Just(0.04), 2usize..50)],
        (orders, seed) in (1usize..4, any::<u64>()),
    ) {
        let mut compared = 0;
        for (case, model) in timed_models().iter().enumerate() {
            let (n, n_dofs, discrete) = (3, model.n_dofs(), model.kind() == Kind::Discrete);
            let row = |seed: u64| noise((1, 1, n_dofs), seed).into_raw_vec_and_offset().0;
            let warped = model.breaks().len() > 2;
            let durations = |b: usize| model.demonstrated().segment_durations.row(b).to_vec();
            let movements: Vec<Conditions> = (0..n as u64)
                .map(|b| Conditions {
                    style: Some(noise((1, 1, 2), seed ^ b).into_raw_vec_and_offset().0),
                    goal: discrete.then(|| row(seed ^ (b + 10))),
                    anchor: (!discrete).then(|| row(seed ^ (b + 10))),
                    start: (start || discrete).then(|| row(seed ^ (b + 20))),
                    velocity: velocity.then(|| row(seed ^ (b + 30))),
                    goal_velocity: (discrete && goal_velocity && case != 2).then(|| row(seed ^ (b + 40))),
                    amplitude: (!discrete).then_some(0.4 + b as f64),
                    tau: (!warped).then_some(model.tau() * (0.6 + 0.3 * b as f64)),
                    segment_durations: warped.then(|| durations(b as usize)),
                    phase: (!discrete && !warped).then_some(1.7 * b as f64),
                    ..Conditions::default()
                })
                .collect();
            let conditions = BatchConditions::each(model.primitive(), &movements).unwrap();
            let grid = grid(dt, dt * (samples - 1) as f64);
            let mut variables = variables(model.kind(), &conditions);
            variables.retain(|variable| !warped || *variable != WithRespectTo::Tau);
            let prepared = prepared(model, &conditions, grid);
            let cotangents: Vec<_> = (0..orders).map(|k| noise(prepared.shape(), seed + 9 + k as u64)).collect();
            let found = gradients(&prepared, &variables, &cotangents);
            let cost = |b: usize, conditions: &Conditions| {
                let moved = rollout(model.primitive(), conditions, grid).unwrap();
                let rows = [moved.position, moved.velocity, moved.acceleration];
                let sum = |(v, y): (&Array3<f64>, &Array2<f64>)| {
                    let products = &v.index_axis(Axis(0), b) * y;
                    (products.sum(), products.mapv(f64::abs).sum())
                };
                cotangents.iter().zip(&rows).map(sum).fold((0.0, 0.0), |(a, b), (c, d)| (a + c, b + d))
            };
            for (b, one) in movements.iter().enumerate() {
                let (present, mut size) = cost(b, one);
                for (variable, found) in variables.iter().zip(&found) {
                    for (column, &found) in found.row(b).iter().enumerate() {
                        if *variable == WithRespectTo::Tau {
                            if one.phase.is_none_or(|phase| phase == 0.0) {
                                let shared = BatchConditions::shared(model.primitive(), one.clone()).unwrap();
                                let views: Vec<_> = cotangents.iter().map(|v| v.slice(s![b..b + 1, .., ..])).collect();
                                let alone = batch(model.primitive(), shared, grid, &mut |_| Ok(())).unwrap();
                                let expected =
                                    alone.vector_jacobian(0..1, &[*variable], &views, Threads::ONE, &mut |_| Ok(()));
                                let expected = expected.unwrap()[0][[0, 0]];
                                prop_assert!((found - expected).abs() < 1e-9 * size, "{found} {expected}");
                                compared += 1;
                            }
                            continue;
                        }
                        let mut moved = one.clone();
                        {
                            let Conditions { style, goal, anchor, start, velocity, goal_velocity, .. } = &mut moved;
                            let vector = match variable {
                                WithRespectTo::Style => style,
                                WithRespectTo::Goal => goal,
                                WithRespectTo::Anchor => anchor,
                                WithRespectTo::Start => start,
                                WithRespectTo::Velocity => velocity,
                                _ => goal_velocity,
                            };
                            match variable {
                                WithRespectTo::Amplitude => *moved.amplitude.as_mut().unwrap() += 1.0,
                                _ => vector.as_mut().unwrap()[column] += 1.0,
                            }
                        }
                        let (value, bound) = cost(b, &moved);
                        size = size.max(bound);
                        let error = (found - (value - present)).abs();
                        prop_assert!(error < 1e-11 * size, "{case} {variable:?} {found} {}", value - present);
                        compared += 1;
                    }
                }
            }
            let views: Vec<_> = cotangents.iter().map(|array| array.slice(s![1.., .., ..])).collect();
            let threads = Threads::new(2).unwrap();
            let last = prepared.vector_jacobian(1..n, &variables, &views, threads, &mut |_| Ok(())).unwrap();
            for (last, all) in last.iter().zip(&found) {
                prop_assert_eq!(last, &all.slice(s![1.., ..]));
            }
        }
        prop_assert!(compared > 60);
    }
}

/// Cotangents of other layouts have the same gradients.
#[test]
fn cotangents_may_be_strided() {
    let style = Some(PerMovement::Each(noise((1, 9, 2), 1).index_axis_move(Axis(0), 0)));
    let prepared = prepared(&REACH, &BatchConditions { style, ..Default::default() }, grid(0.01, 1.0));
    let cotangents = noise(prepared.shape(), 2);
    let expected =
        gradients(&prepared, &[WithRespectTo::Style, WithRespectTo::Goal], std::slice::from_ref(&cotangents));
    let mut reversed = Array3::zeros((3, 101, 9));
    reversed.assign(&cotangents.view().reversed_axes());
    let found = gradients(&prepared, &[WithRespectTo::Style, WithRespectTo::Goal], &[reversed.reversed_axes()]);
    assert_eq!(found, expected);
}

/// Errors name the argument.
#[test]
fn invalid_products_are_rejected() {
    let prepared = prepared(&REACH, &BatchConditions::default(), grid(0.01, 1.0));
    let valid = noise(prepared.shape(), 2);
    let refused = |movements, variables: &[WithRespectTo], cotangents: &[&Array3<f64>]| {
        let cotangents: Vec<_> = cotangents.iter().map(|array| array.view()).collect();
        let result = prepared.vector_jacobian(movements, variables, &cotangents, Threads::ONE, &mut |_| Ok(()));
        result.unwrap_err().argument().map(str::to_string)
    };
    let style = [WithRespectTo::Style];
    let mut nan = valid.clone();
    nan[[0, 50, 1]] = f64::NAN;
    assert_eq!(refused(0..2, &style, &[&valid]).as_deref(), Some("movements"));
    assert_eq!(refused(0..1, &style, &[]).as_deref(), Some("cotangents"));
    assert_eq!(refused(0..1, &style, &[&noise((1, 101, 2), 1)]).as_deref(), Some("cotangents"));
    assert_eq!(refused(0..1, &style, &[&nan]).as_deref(), Some("cotangents"));
    assert_eq!(refused(0..1, &[WithRespectTo::Anchor], &[&valid]).as_deref(), Some("anchor"));
    assert_eq!(refused(0..1, &[WithRespectTo::Amplitude], &[&valid]).as_deref(), Some("amplitude"));
    assert_eq!(refused(0..1, &[WithRespectTo::Velocity], &[&valid]).as_deref(), Some("velocity"));
    assert_eq!(refused(0..1, &[WithRespectTo::GoalVelocity], &[&valid]).as_deref(), Some("goal_velocity"));
    let cancelled =
        prepared.vector_jacobian(0..1, &style, &[valid.view()], Threads::ONE, &mut |_| Err(Error::Interrupted));
    assert!(matches!(cancelled, Err(Error::Interrupted)));
}
