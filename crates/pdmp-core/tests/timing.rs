//! Claims about time warps and landmarks: estimation, reproduction in time, prediction, files, errors.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;

use std::f64::consts::TAU;
use std::sync::Arc;

use common::*;
use ndarray::{Array2, Axis, array};
use pdmp_core::learning::{StyleOptions, TimeScaling, Truncation, style_of};
use pdmp_core::model::{Derivative, TimeWarp};
use pdmp_core::motion::{BatchConditions, TimeGrid, batch, jacobian};
use pdmp_core::numerics::Threads;
use pdmp_core::rollout;
use pdmp_core::{Conditions, Controller, Demonstration, Error, FitOptions, Kind, Model, Sampling, Status, fit};
use proptest::prelude::*;

/// Returns the position at phase `p` of a movement of amplitude `a` with distinct phases; a cycle is periodic.
fn shape(kind: Kind, a: f64, p: f64) -> [f64; 2] {
    match kind {
        Kind::Discrete => [a * minimum_jerk(p) + a * 0.3 * (9.0 * p).sin(), 0.5 * a * (5.0 * p).cos()],
        Kind::Rhythmic => [a * (TAU * p).sin() + 0.4 * a * (2.0 * TAU * p).cos(), a * (TAU * p).cos()],
    }
}

/// Returns the phase at a share of the duration, for K segments with slopes of mean one.
fn phase_at(slopes: &[f64], share: f64) -> f64 {
    let n = slopes.len() as f64;
    let mut start = 0.0;
    for (k, slope) in slopes.iter().enumerate() {
        if share * n <= start + slope || k + 1 == slopes.len() {
            return (k as f64 + (share * n - start) / slope) / n;
        }
        start += slope;
    }
    share
}

/// Returns a demonstration that spends `slopes` times the linear duration in each segment.
fn warped(kind: Kind, a: f64, slopes: &[f64], duration: f64) -> Demonstration {
    let n = 201;
    let steps = if kind == Kind::Discrete { n - 1 } else { n };
    let position = Array2::from_shape_fn((n, 2), |(c, d)| shape(kind, a, phase_at(slopes, c as f64 / steps as f64))[d]);
    Demonstration::new(position, Sampling::Uniform { dt: duration / steps as f64 }).unwrap()
}

fn with(kind: Kind, time_scaling: TimeScaling) -> FitOptions {
    let mut options = options(kind);
    options.nominal = Some(0);
    options.time_scaling = time_scaling;
    options
}

fn by_warp(kind: Kind) -> FitOptions {
    with(kind, TimeScaling::Warp(TimeWarp::default()))
}

const KINDS: [Kind; 2] = [Kind::Discrete, Kind::Rhythmic];
const EVEN: [f64; 8] = [1.0; 8];
const UNEVEN: [f64; 8] = [1.4, 0.7, 0.5, 0.6, 1.9, 1.4, 0.9, 0.6];
const SLOWER: [f64; 8] = [0.6, 0.8, 1.5, 1.6, 1.2, 0.7, 0.6, 1.0];

/// Warps within the bounds are recovered to a step of the grid for any amplitude and duration.
#[test]
fn known_warps_are_recovered() {
    for kind in KINDS {
        for a in [1.0, 0.3, 2.5] {
            let demos = [warped(kind, 1.0, &EVEN, 1.0), warped(kind, a, &UNEVEN, 1.3), warped(kind, a, &SLOWER, 0.8)];
            let model = learn(&demos, &by_warp(kind));
            let segment_durations = &model.demonstrated().segment_durations;
            for (m, (slopes, duration)) in [(EVEN, 1.0), (UNEVEN, 1.3), (SLOWER, 0.8)].iter().enumerate() {
                let (mut found, mut true_time) = (0.0, 0.0);
                for k in 0..8 {
                    found += segment_durations[[m, k]] / duration;
                    true_time += slopes[k] / 8.0;
                    assert!((found - true_time).abs() < 1.01 / 80.0, "{kind} {a} {m} {k}: {found} {true_time}");
                }
            }
        }
    }
}

/// Demonstrations of equal shape but different duration and size are not warped.
#[test]
fn demonstrations_of_equal_shape_are_not_warped() {
    for kind in KINDS {
        let demos: Vec<_> = [1.0, 0.5, 2.0].iter().map(|&a| warped(kind, a, &EVEN, 1.0 + a)).collect();
        let (model, linear) = (learn(&demos, &by_warp(kind)), learn(&demos, &with(kind, TimeScaling::Linear)));
        for (segment_durations, duration) in
            model.demonstrated().segment_durations.rows().into_iter().zip([2.0, 1.5, 3.0])
        {
            assert!(segment_durations.iter().all(|seconds| (seconds - duration / 8.0).abs() < 1e-12));
        }
        assert_eq!(model.demonstrated().styles, linear.demonstrated().styles);
        let (grid, nominal) = (TimeGrid { dt: 0.01, duration: None }, Conditions::default());
        assert_eq!(
            rollout(model.primitive(), &nominal, grid).unwrap(),
            rollout(linear.primitive(), &nominal, grid).unwrap()
        );
    }
}

/// A warp of one segment equals linear scaling bit for bit.
#[test]
fn a_warp_of_one_segment_is_linear_scaling() {
    for (kind, demos) in [(Kind::Discrete, reaches()), (Kind::Rhythmic, cycles())] {
        let one = learn(&demos, &with(kind, TimeScaling::Warp(TimeWarp::new(1, 2.5).unwrap())));
        let linear = learn(&demos, &with(kind, TimeScaling::Linear));
        assert_eq!(one.demonstrated(), linear.demonstrated());
        let grid = TimeGrid { dt: 0.01, duration: None };
        let nominal = Conditions::default();
        assert_eq!(
            rollout(one.primitive(), &nominal, grid).unwrap(),
            rollout(linear.primitive(), &nominal, grid).unwrap()
        );
        assert_eq!(linear.breaks(), [0.0, 1.0]);
        assert_eq!(linear.demonstrated().segment_durations.column(0).to_vec(), linear.demonstrated().durations);
        let timed = Conditions { segment_durations: Some(vec![1.7]), ..Default::default() };
        let scaled = Conditions { tau: Some(linear.tau() * 1.7 / linear.duration()), ..Default::default() };
        assert_eq!(
            rollout(linear.primitive(), &timed, grid).unwrap(),
            rollout(linear.primitive(), &scaled, grid).unwrap()
        );
    }
}

/// With its own segment durations every demonstration is reproduced as accurately as with linear scaling.
#[test]
fn every_demonstration_is_reproduced_in_its_own_timing() {
    for kind in KINDS {
        // Smooth warps, as of recordings; the piecewise linear ones above have corners.
        let demos: Vec<_> = [(1.0, 0.0), (0.8, 0.08), (1.3, -0.1), (0.9, 0.05)]
            .iter()
            .map(|&(a, bend)| {
                let position = Array2::from_shape_fn((401, 2), |(c, d)| {
                    let s = c as f64 / if kind == Kind::Discrete { 400.0 } else { 401.0 };
                    shape(kind, a, s + bend * (TAU * s).sin())[d]
                });
                Demonstration::new(position, Sampling::Uniform { dt: 0.004 * a }).unwrap()
            })
            .collect();
        let landmarks = Array2::from_shape_fn((4, 2), |(m, e)| {
            let duration = demos[m].n_samples() as f64 * 0.004 * [1.0, 0.8, 1.3, 0.9][m];
            duration * [0.3 + 0.02 * m as f64, 0.7 - 0.05 * m as f64][e]
        });
        let error = |time_scaling| {
            let model = learn(&demos, &with(kind, time_scaling).n_styles(Truncation::Rank(4)));
            (0..demos.len()).map(|m| reproduction_error(&model, &demos, m)).fold(0.0, f64::max)
        };
        let (linear, warp) = (error(TimeScaling::Linear), error(TimeScaling::Warp(TimeWarp::default())));
        let landmarks = error(TimeScaling::Landmarks(landmarks));
        assert!(linear <= 1e-4 && warp <= 1e-4 && landmarks <= 1e-4, "{kind}: {linear:e} {warp:e} {landmarks:e}");
    }
}

/// The landmarks of all demonstrations coincide with the breaks, which are those of the nominal one.
#[test]
fn landmarks_coincide_with_the_breaks() {
    for (kind, demos) in [(Kind::Discrete, reaches()), (Kind::Rhythmic, cycles())] {
        let linear = learn(&demos, &with(kind, TimeScaling::Linear));
        let durations = &linear.demonstrated().durations;
        let landmarks = Array2::from_shape_fn((demos.len(), 2), |(m, e)| {
            durations[m] * [0.25 + 0.03 * m as f64, 0.6 + 0.02 * m as f64][e]
        });
        let model = learn(&demos, &with(kind, TimeScaling::Landmarks(landmarks.clone())));
        let breaks = model.breaks();
        assert!((breaks[1] - 0.25).abs() < 1e-14 && (breaks[2] - 0.6).abs() < 1e-14);
        for m in 0..demos.len() {
            assert!((model.demonstrated().segment_durations[[m, 0]] - landmarks[[m, 0]]).abs() < 1e-14);
            assert!(
                (model.demonstrated().segment_durations[[m, 0]] + model.demonstrated().segment_durations[[m, 1]]
                    - landmarks[[m, 1]])
                .abs()
                    < 1e-14
            );
            assert!((model.demonstrated().durations[m] - durations[m]).abs() < 1e-14);
            // The landmark is at its time in the recording, and at the phase of the break in the movement.
            let at = TimeGrid { dt: landmarks[[m, 0]], duration: Some(landmarks[[m, 0]]) };
            let conditions = conditions_of(&model, m);
            let there = rollout(model.primitive(), &conditions, at).unwrap().position.row(1).to_vec();
            let still = Conditions { segment_durations: None, ..conditions };
            let at = 0.25 * model.duration();
            let same = rollout(model.primitive(), &still, TimeGrid { dt: at, duration: Some(at) })
                .unwrap()
                .position
                .row(1)
                .to_vec();
            assert!(there.iter().zip(&same).all(|(a, b)| (a - b).abs() < 1e-9));
        }
    }
}

/// Velocity and acceleration of a rollout with segment durations are the derivatives of its position.
#[test]
fn derivatives_of_a_warped_rollout_are_consistent() {
    for kind in KINDS {
        let demos = [warped(kind, 1.0, &EVEN, 1.0), warped(kind, 0.9, &UNEVEN, 1.3), warped(kind, 1.1, &SLOWER, 0.8)];
        let model = learn(&demos, &by_warp(kind));
        let segment_durations: Vec<f64> = SLOWER.iter().map(|slope| slope * 0.2).collect();
        for velocity in [None, Some(vec![0.7, -0.2])] {
            let start = (kind == Kind::Rhythmic).then(|| vec![0.1, 0.2]);
            let timed = Conditions {
                segment_durations: Some(segment_durations.clone()),
                velocity,
                start,
                ..Default::default()
            };
            // Also past the end; except at the breaks, where the acceleration jumps.
            let dt = 1e-3;
            let made = rollout(model.primitive(), &timed, TimeGrid { dt, duration: Some(1.9) }).unwrap();
            let scale = made.acceleration.iter().fold(0.0f64, |most, a| most.max(a.abs()));
            let mut worst = 0.0f64;
            for k in 1..made.time.len() - 1 {
                for d in 0..2 {
                    let [before, here, after] = [k - 1, k, k + 1].map(|k| made.position[[k, d]]);
                    let slope = (after - before) / (2.0 * dt);
                    assert!((slope - made.velocity[[k, d]]).abs() < 1e-3 * scale, "{kind} {k} {d}");
                    let near_break = (0..=16).any(|i| {
                        let at = segment_durations.iter().cycle().take(i).sum::<f64>();
                        (made.time[k] - at).abs() < 1.5 * dt
                    });
                    if !near_break {
                        let bend = (after - 2.0 * here + before) / (dt * dt);
                        worst = worst.max((bend - made.acceleration[[k, d]]).abs() / scale);
                    }
                }
            }
            assert!(worst < 2e-2, "{kind}: {worst:e}");
            if let Some(velocity) = &timed.velocity {
                assert!((made.velocity[[0, 0]] - velocity[0]).abs() < 1e-12);
                assert!((made.velocity[[0, 1]] - velocity[1]).abs() < 1e-12);
            }
        }
        // The default duration is the sum of the segment durations.
        let timed = Conditions { segment_durations: Some(segment_durations.clone()), ..Default::default() };
        assert_eq!(rollout(model.primitive(), &timed, TimeGrid { dt: 0.01, duration: None }).unwrap().time.len(), 161);
    }
}

/// Segment durations in the proportions of the nominal ones are equivalent to a τ.
#[test]
fn nominal_proportions_are_linear_time() {
    for kind in KINDS {
        let demos = [warped(kind, 1.0, &EVEN, 1.0), warped(kind, 0.9, &UNEVEN, 1.3)];
        let model = learn(&demos, &by_warp(kind));
        let timed = Conditions { segment_durations: Some(vec![0.2; 8]), ..Default::default() };
        let scaled = Conditions { tau: Some(1.6 * model.tau()), ..Default::default() };
        let [timed, scaled] = [timed, scaled]
            .map(|conditions| rollout(model.primitive(), &conditions, TimeGrid { dt: 0.01, duration: None }).unwrap());
        for (a, b) in [(timed.position, scaled.position), (timed.velocity, scaled.velocity)] {
            assert!((a - b).iter().all(|difference| difference.abs() < 1e-9));
        }
    }
}

/// A controller whose τ is set from the segment durations at every step reproduces the warped movement.
#[test]
fn a_controller_follows_segment_durations_by_its_tau() {
    for kind in KINDS {
        let demos = [warped(kind, 1.0, &EVEN, 1.0), warped(kind, 0.9, &UNEVEN, 1.3)];
        let model = learn(&demos, &by_warp(kind));
        let conditions = conditions_of(&model, 1);
        let segment_durations = conditions.segment_durations.clone().unwrap();
        let made = rollout(model.primitive(), &conditions, TimeGrid { dt: 1e-3, duration: None }).unwrap().position;
        let at = |phase: f64| model.tau_at(phase, &segment_durations).unwrap();
        let tau = Some(at(if kind == Kind::Discrete { 1.0 } else { 0.0 }));
        let conditions = Conditions { tau, segment_durations: None, ..conditions };
        let mut controller = Controller::new(model.primitive(), 1e-3, &conditions, Some(0.0)).unwrap();
        for k in 1..made.nrows() {
            assert!(controller.step().unwrap() == Status::Working || k + 100 > made.nrows());
            controller.set_tau(at(controller.phase())).unwrap();
            let off = (0..2).map(|d| (controller.position()[d] - made[[k, d]]).abs()).fold(0.0, f64::max);
            assert!(off < 2e-2, "{kind} {k}: {off}");
        }
    }
}

/// Segment durations are predicted from contexts; a controller uses their sum.
#[test]
fn segment_durations_are_predicted_from_contexts() {
    let kind = Kind::Discrete;
    let slow = |h: f64| (0..8).map(|k| if k < 4 { 1.0 + h } else { 1.0 - h }).collect::<Vec<f64>>();
    let heights = [0.0, 0.1, 0.2, 0.3, 0.4];
    let demos: Vec<_> = heights.iter().map(|&h| warped(kind, 1.0, &slow(h), 1.0 + h)).collect();
    let contexts = heights.iter().map(|&h| vec![h.into()]).collect();
    let model = learn(&demos, &by_warp(kind).contexts(contexts));
    let found = model.predict(&[0.25]).unwrap();
    let segment_durations = found.conditions.segment_durations.as_ref().unwrap();
    let first: f64 = segment_durations[..4].iter().sum();
    assert!((first - 1.25 * 1.25 / 2.0).abs() < 0.02, "{first}");
    assert!((found.duration - 1.25).abs() < 0.02);
    assert!((found.duration - segment_durations.iter().sum::<f64>()).abs() < 1e-14);
    let size = model.n_styles() + 2 * model.n_dofs() + 8;
    assert_eq!(found.covariance.as_ref().unwrap().dim(), (size, size));
    let controller = Controller::new(model.primitive(), 1e-3, &found.conditions, None).unwrap();
    assert!((controller.tau() / model.tau() - found.duration / model.duration()).abs() < 1e-12);
}

/// A new demonstration is aligned as in the fit, by the template or by its own landmarks.
#[test]
fn style_of_recovers_the_styles_of_warped_demonstrations() {
    let options = |by_landmarks, landmarks: &[f64]| match by_landmarks {
        true => StyleOptions::default().landmarks(landmarks),
        false => StyleOptions::default(),
    };
    for kind in KINDS {
        let demos = [warped(kind, 1.0, &EVEN, 1.0), warped(kind, 0.7, &UNEVEN, 1.3), warped(kind, 1.4, &SLOWER, 0.8)];
        let landmarks = array![[0.4], [0.5], [0.3]];
        for time_scaling in [TimeScaling::Warp(TimeWarp::default()), TimeScaling::Landmarks(landmarks.clone())] {
            let by_landmarks = matches!(time_scaling, TimeScaling::Landmarks(_));
            let model = learn(&demos, &with(kind, time_scaling).n_styles(Truncation::Rank(3)));
            for (m, demo) in demos.iter().enumerate() {
                let own = landmarks.row(m).to_vec();
                let style = style_of(&model, demo, &options(by_landmarks, &own)).unwrap();
                for (j, s) in style.iter().enumerate() {
                    assert!((s - model.demonstrated().styles[[m, j]]).abs() < 5e-3, "{kind} {m} {j} {s}");
                }
            }
            let wrong = style_of(&model, &demos[1], &options(!by_landmarks, &[0.5])).unwrap_err();
            assert!(wrong.to_string().contains("landmarks"), "{wrong}");
        }
    }
}

/// A warped model is saved completely, and does not depend on the number of threads bit for bit.
#[test]
fn a_warped_model_is_saved_and_independent_of_threads() {
    for kind in KINDS {
        let demos: Vec<_> = (0..7)
            .map(|m| {
                let share = m as f64 / 6.0;
                let slopes: Vec<f64> = UNEVEN.iter().map(|slope| 1.0 + share * (slope - 1.0)).collect();
                warped(kind, 1.0 - 0.5 * share, &slopes, 1.0 + share)
            })
            .collect();
        let bytes = |n| {
            let threads = Threads::new(n).unwrap();
            learn(&demos, &by_warp(kind).threads(threads)).to_bytes().unwrap()
        };
        let one = bytes(1);
        assert!([2, 3, 8].iter().all(|&n| bytes(n) == one));
        let model = Arc::new(Model::from_bytes(&one).unwrap());
        assert_eq!(model.to_bytes().unwrap(), one);
        assert_eq!(model.breaks().len(), 9);
        assert!(model.learnt().template.is_some());
        assert!(style_of(&model, &demos[3], &StyleOptions::default()).is_ok());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// For any demonstrations the slopes of the warp stay within their bounds, and rollouts are finite.
    #[test]
    fn slopes_stay_within_their_bounds(
        noise in prop::collection::vec(-1.0..1.0f64, 240), segments in 1..12usize, slope in 1.0..10.0f64,
        size in -140..140i32, rhythmic in any::<bool>(),
    ) {
        let kind = if rhythmic { Kind::Rhythmic } else { Kind::Discrete };
        let demo = |values: &[f64], scale: f64| {
            let position = Array2::from_shape_fn((values.len() / 2, 2), |(c, d)| scale * values[2 * c + d]);
            Demonstration::new(position, Sampling::Uniform { dt: 0.02 }).unwrap()
        };
        let scale = 10f64.powi(size);
        let demos = [demo(&noise[..60], scale), demo(&noise[60..140], 0.0), demo(&noise[140..], scale)];
        let warp = TimeWarp::new(segments, slope).unwrap();
        let model = learn(&demos, &with(kind, TimeScaling::Warp(warp)));
        let demonstrated = model.demonstrated();
        prop_assert_eq!(demonstrated.segment_durations.dim(), (3, segments));
        for (segment_durations, duration) in demonstrated.segment_durations.rows().into_iter().zip(&demonstrated.durations) {
            let linear = duration / segments as f64;
            for seconds in segment_durations {
                prop_assert!((1.0 / slope - 1e-9..=slope + 1e-9).contains(&(seconds / linear)), "{}", seconds / linear);
            }
        }
        let made = rollout(model.primitive(), &conditions_of(&model, 2), TimeGrid { dt: 0.01, duration: None }).unwrap();
        prop_assert!(made.position.iter().chain(&made.velocity).chain(&made.acceleration).all(|x| x.is_finite()));
    }
}

/// Jacobians are those of linear time; conditions with segment durations are rejected.
#[test]
fn the_jacobian_of_a_warped_movement_is_rejected() {
    let demos = [EVEN, UNEVEN].map(|slopes| warped(Kind::Discrete, 1.0, &slopes, 2.0));
    let model = Arc::new(fit(&demos, &by_warp(Kind::Discrete)).unwrap());
    let conditions = Conditions {
        segment_durations: Some(model.demonstrated().segment_durations.row(1).to_vec()),
        ..Conditions::default()
    };
    let grid = TimeGrid { dt: 0.01, duration: None };
    let found = jacobian(
        model.primitive(),
        pdmp_core::motion::WithRespectTo::Style,
        pdmp_core::model::Derivative::Position,
        &conditions,
        grid,
        &mut |_| Ok(()),
    );
    assert!(matches!(found, Err(Error::Argument { name: "segment_durations", .. })));
}

/// Invalid warps, landmarks and segment durations are rejected with their numbers and the remedy.
#[test]
fn invalid_timings_are_rejected() {
    let demos = reaches();
    let refused = |time_scaling| fit(&demos, &with(Kind::Discrete, time_scaling)).unwrap_err().to_string();
    for (segments, slope, message) in [
        (0, 2.5, "n_segments = 0: must be at least 1, which is linear"),
        (46, 2.5, "n_segments = 46: must lie between 1 and 45, half the fewest samples of a demonstration or 1000"),
        (8, 0.9, "max_slope = 0.9: must lie between 1, which is linear, and 10"),
        (8, f64::NAN, "max_slope = NaN: must lie between 1, which is linear, and 10"),
    ] {
        assert_eq!(refused(TimeScaling::Warp(TimeWarp { n_segments: segments, max_slope: slope })), message);
    }
    let landmarks =
        |rows: [[f64; 2]; 5]| refused(TimeScaling::Landmarks(Array2::from_shape_fn((5, 2), |(m, e)| rows[m][e])));
    let good = [0.3, 0.6];
    let message = landmarks([good, good, [0.6, 0.3], good, good]);
    assert!(message.starts_with("demo 2: landmarks[1] = 0.3 s must come after 0.6 s"), "{message}");
    let message = landmarks([good, good, good, good, [0.3, 1.08]]);
    assert!(message.starts_with("demo 4: landmarks[1] = 1.08 s must come after 0.3 s"), "{message}");
    let message = landmarks([[0.0, 0.3], good, good, good, good]);
    assert!(message.starts_with("demo 0: landmarks[0] = 0 s must come after 0 s, the start"), "{message}");
    assert!(landmarks([good, [0.1, f64::NAN], good, good, good]).starts_with("demo 1: landmarks[1] = NaN s"));
    let wrong = |shape: (usize, usize)| refused(TimeScaling::Landmarks(Array2::from_elem(shape, 0.5)));
    assert_eq!(wrong((4, 1)), "landmarks has length 4, expected 5: one value per demonstration");
    assert!(wrong((5, 0)).contains("pass their times (M, E)"));

    let model = learn(&demos, &by_warp(Kind::Discrete));
    let refused = |conditions: Conditions| {
        let error: Error = rollout(model.primitive(), &conditions, TimeGrid { dt: 0.01, duration: None }).unwrap_err();
        error.to_string()
    };
    let timed = |segment_durations: &[f64]| {
        refused(Conditions { segment_durations: Some(segment_durations.to_vec()), ..Default::default() })
    };
    assert_eq!(timed(&[0.1; 7]), "segment_durations has length 7, expected 8: one value per segment between breaks");
    for bad in [0.0, -0.1, 1e9] {
        let mut segment_durations = [0.1; 8];
        segment_durations[3] = bad;
        assert!(
            timed(&segment_durations).contains("segment_durations = ")
                && timed(&segment_durations).contains("seconds must be positive")
        );
    }
    assert!(timed(&[f64::NAN; 8]).contains("segment_durations[0] = NaN: every number must be finite"));
    let both = Conditions { segment_durations: Some(vec![0.1; 8]), tau: Some(1.0), ..Default::default() };
    assert!(refused(both).starts_with("pass tau or segment_durations, not both"));
    assert!(model.tau_at(0.0, &[0.1; 8]).unwrap() > 0.0, "long after the end");
    for phase in [-0.1, 1.1, f64::NAN] {
        assert!(model.tau_at(phase, &[0.1; 8]).unwrap_err().to_string().contains("must lie in [0, 1] for a discrete"));
    }
}

/// Movements of a batch that have segment durations of their own are rollouts in warped time, to the bit.
#[test]
fn batches_follow_the_segment_durations_of_each_movement() {
    let demos: Vec<_> = [[1.0, 1.0], [1.3, 0.7], [0.8, 1.2]]
        .iter()
        .zip([0.8, 1.0, 1.2])
        .map(|(slopes, a)| warped(Kind::Discrete, a, slopes, 2.0))
        .collect();
    let model = learn(&demos, &by_warp(Kind::Discrete));
    let movements: Vec<_> = (0..3).map(|m| model.conditions(&[m]).unwrap()).collect();
    let conditions = BatchConditions::each(model.primitive(), &movements).unwrap();
    let grid = TimeGrid { dt: 0.01, duration: Some(2.5) };
    let batch = batch(model.primitive(), conditions, grid, &mut |_| Ok(())).unwrap();
    let made = batch.rollouts(0..3, Derivative::Velocity, Threads::ONE, &mut |_| Ok(())).unwrap();
    for (b, one) in movements.iter().enumerate() {
        assert!(one.segment_durations.as_ref().is_some_and(|durations| durations.len() > 1));
        let single = rollout(model.primitive(), one, grid).unwrap();
        assert_eq!(made.position.index_axis(Axis(0), b), single.position);
        assert_eq!(made.velocity.as_ref().unwrap().index_axis(Axis(0), b), single.velocity);
    }
}
