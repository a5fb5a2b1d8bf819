//! Preprocessing of recordings.

#![cfg(feature = "learning")]

use std::f64::consts::{PI, TAU};

use approx::{assert_abs_diff_eq, assert_relative_eq};
use ndarray::{Array1, Array2, Axis, concatenate, s};
use pdmp_core::numerics::Smoothing;
use pdmp_core::preprocessing::{self, CycleOutput, Cycles, RejectionReason};
use pdmp_core::{Demonstration, FitOptions, Kind, Result, Sampling};
use proptest::prelude::*;

const DT: f64 = 0.01;

/// Uniform random numbers in [−1, 1) by Knuth's linear congruential generator.
fn noise(mut state: u64) -> impl FnMut() -> f64 {
    move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Standard normal random numbers by the Box–Muller transform.
fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut uniform = noise(seed);
    move || (-2.0 * (0.5 - 0.5 * uniform()).ln()).sqrt() * (PI * uniform()).cos()
}

/// `position` with white noise whose standard deviation is the fraction `share` of the range of each DoF.
fn noisy(mut position: Array2<f64>, share: f64, seed: u64) -> Array2<f64> {
    let mut normal = normal(seed);
    for mut column in position.columns_mut() {
        let range = column.iter().fold(f64::MIN, |m, y| m.max(*y)) - column.iter().fold(f64::MAX, |m, y| m.min(*y));
        column.mapv_inplace(|y| y + share * range * normal());
    }
    position
}

/// Lag-one autocorrelation of the second differences of a column; −2/3 for white noise.
fn roughness(column: &[f64]) -> f64 {
    let bends: Vec<f64> = column.windows(3).map(|y| y[0] - 2.0 * y[1] + y[2]).collect();
    bends.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / bends.iter().map(|b| b * b).sum::<f64>()
}

/// Number of styles of a fit with smoothing.
fn n_styles(kind: Kind, demos: &[Demonstration]) -> usize {
    let mut options = FitOptions::new(kind);
    options.smoothing = Smoothing::Auto;
    pdmp_core::fit(demos, &options).unwrap().n_styles()
}

/// Angles of both hips and a knee in rad, and height of the pelvis in m, at a phase of a walk.
fn pose(phi: f64) -> [f64; 4] {
    let knee = 0.5 - 0.4 * phi.cos() + 0.3 * (2.0 * phi + 1.0).sin();
    [0.4 * phi.sin(), -0.4 * phi.sin(), knee, 0.9 + 0.02 * (2.0 * phi).cos()]
}

/// A walk whose phase is `phi` at time t.
fn walk(time: &[f64], phi: impl Fn(f64) -> f64) -> Array2<f64> {
    Array2::from_shape_fn((time.len(), 4), |(c, d)| pose(phi(time[c]))[d])
}

fn even(n: usize) -> Vec<f64> {
    (0..n).map(|c| c as f64 * DT).collect()
}

fn recorded(position: Array2<f64>) -> Demonstration {
    Demonstration::new(position, Sampling::Uniform { dt: DT }).unwrap()
}

fn one(recording: Demonstration) -> Result<Cycles> {
    preprocessing::cycles(&[recording], None, CycleOutput::Each)
}

/// Step from the last sample of a cycle to the first, relative to the largest step within the cycle.
fn seam(cycle: &Demonstration) -> f64 {
    let y = cycle.position();
    let step = |a: usize, b: usize| (&y.row(b) - &y.row(a)).iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let n = y.nrows();
    step(n - 1, 0) / (1..n).map(|c| step(c - 1, c)).fold(0.0, f64::max)
}

/// Both legs together repeat after a stride, although the pelvis repeats after each step.
#[test]
fn the_period_of_a_walk_is_a_stride_rather_than_a_step() {
    for period in [0.713, 1.0, 1.377] {
        let recording = recorded(walk(&even(400), |t| TAU * t / period + 1.0));
        assert_relative_eq!(preprocessing::period(&recording).unwrap(), period, max_relative = 1e-3);
    }
}

/// A harmonic much larger than the fundamental does not determine the period.
#[test]
fn the_period_is_not_that_of_a_harmonic() {
    for harmonic in [2.0, 3.0, 5.0] {
        let y = |t: f64| 0.3 * (TAU * t).sin() + (TAU * harmonic * t).sin();
        let recording = recorded(Array1::from_iter(even(450).into_iter().map(y)).insert_axis(Axis(1)));
        assert_relative_eq!(preprocessing::period(&recording).unwrap(), 1.0, max_relative = 1e-3);
    }
}

/// High-frequency noise, irregular time stamps and drift do not affect the period.
#[test]
fn the_period_is_found_through_noise_drift_and_irregular_stamps() {
    let (n, mut random) = (2000, noise(3));
    let time: Vec<f64> = (0..n).map(|c| 5.0 + (c as f64 + 0.4 * random()) * 0.002).collect();
    let mut position = walk(&time, |t| TAU * t / 1.1);
    for (mut row, t) in position.rows_mut().into_iter().zip(&time) {
        row.iter_mut().for_each(|y| *y += 0.03 * random() + 0.5 * t);
    }
    let recording = Demonstration::new(position, Sampling::Stamped { time }).unwrap();
    assert_relative_eq!(preprocessing::period(&recording).unwrap(), 1.1, max_relative = 5e-3);
}

/// Recordings without a period are rejected with the largest autocorrelation.
#[test]
fn aperiodic_recordings_are_rejected_with_their_autocorrelation() {
    let mut random = noise(1);
    let reach = |s: f64| s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
    let reaching = Array2::from_shape_fn((200, 2), |(c, d)| reach(c as f64 / 199.0) * [1.0, -0.3][d]);
    let noisy = Array2::from_shape_fn((200, 3), |_| random());
    for position in [reaching, noisy] {
        let message = one(recorded(position)).unwrap_err().to_string();
        assert!(message.starts_with("demo 0: no period") && message.contains(", below 0."), "{message}");
    }
    let message = preprocessing::period(&recorded(Array2::ones((50, 2)))).unwrap_err().to_string();
    assert!(message.contains("stands still"), "{message}");
}

/// At most two of fifty recordings of white or coloured noise have a period.
#[test]
fn noise_has_no_period() {
    // White noise, filtered twice by a first-order filter with this pole, and then summed `n_sums` times.
    for (pole, n_sums) in [(0.0, 0), (0.5, 0), (0.8, 0), (0.9, 0), (0.97, 0), (0.0, 1), (0.0, 2)] {
        let periodic = (0..50).filter(|&seed| {
            let (mut normal, n, n_dofs) =
                (normal(seed + 1), [60, 100, 200, 400][seed as usize % 4], 1 + seed as usize % 3);
            let mut position = Array2::from_shape_fn((n, n_dofs), |_| normal());
            for mut column in position.columns_mut() {
                for pole in [pole, pole].into_iter().chain(vec![1.0; n_sums]) {
                    let mut last = 0.0;
                    column.mapv_inplace(|y| {
                        last = pole * last + y;
                        last
                    });
                }
            }
            preprocessing::period(&recorded(position)).is_ok()
        });
        let n_periodic = periodic.count();
        assert!(n_periodic <= 2, "filter {pole}, {n_sums} sums: {n_periodic} of 50");
    }
}

/// Two periods suffice with little noise, and many periods with much noise.
#[test]
fn short_and_noisy_recordings_have_their_period() {
    for (n, share) in [(200, 0.0), (200, 0.02), (200, 0.05), (250, 0.1), (300, 0.2), (3000, 0.4)] {
        for seed in 1..6 {
            let position = noisy(walk(&even(n), |t| TAU * t + seed as f64), share, seed);
            let period = preprocessing::period(&recorded(position)).unwrap();
            assert_relative_eq!(period, 1.0, max_relative = 0.05);
        }
    }
}

/// Bounds of strides whose cadence varies by 7 % are accurate to 2 % of a stride; equal cycles would be off by a fifth.
#[test]
fn bounds_of_cycles_follow_a_varying_cadence() {
    // Phase of a cadence that varies by 7 % over seventeen strides.
    let phi = |t: f64| TAU * t + 1.2 * (TAU * t / 17.0).sin();
    let found = one(recorded(walk(&even(1000), phi))).unwrap();
    assert_eq!((found.kept.len(), found.rejected.len()), (9, 0));
    let mut start = 0.0;
    for cycle in &found.kept {
        let end = start + cycle.period;
        assert_abs_diff_eq!(phi(end) - phi(start), TAU, epsilon = 0.02 * TAU);
        start = end;
    }
}

/// A recording that ends with its last cycle loses none of its cycles.
#[test]
fn a_recording_of_whole_cycles_loses_none() {
    let found = one(recorded(walk(&even(301), |t| TAU * t))).unwrap();
    assert_eq!(found.kept.len(), 3);
    for cycle in found.kept {
        assert_relative_eq!(cycle.period, 1.0, max_relative = 1e-3);
        let Sampling::Uniform { dt } = cycle.demo.sampling() else { panic!("no interval") };
        assert_relative_eq!(dt * cycle.demo.n_samples() as f64, cycle.period, max_relative = 1e-12);
    }
}

/// A drift of half the range per cycle is removed without a jump or a change of the mean.
#[test]
fn drifting_cycles_are_closed_without_a_jump() {
    let mut position = walk(&even(500), |t| TAU * t);
    for (c, mut row) in position.rows_mut().into_iter().enumerate() {
        row.mapv_inplace(|y| y + 0.4 * c as f64 * DT);
    }
    let found = one(recorded(position)).unwrap();
    assert_eq!(found.kept.len(), 4);
    for (k, cycle) in found.kept.iter().enumerate() {
        assert!(seam(&cycle.demo) < 1.1, "{}", seam(&cycle.demo));
        let mean = cycle.demo.position().mean_axis(Axis(0)).unwrap();
        assert_abs_diff_eq!(mean[0], 0.4 * (k as f64 + 0.5), epsilon = 5e-3);
    }
}

/// Cycles of recordings that begin in different phases begin in the phase of the first recording.
#[test]
fn cycles_of_all_recordings_begin_in_the_same_phase() {
    let recordings: Vec<_> = [(1.0, 0.4), (1.2, 3.0), (0.9, 5.5)]
        .map(|(period, phase)| recorded(walk(&even(450), |t| TAU * t / period + phase)))
        .into();
    let found = preprocessing::cycles(&recordings, None, CycleOutput::Mean).unwrap();
    assert_eq!(found.kept.len(), 3);
    for cycle in &found.kept {
        for (d, y) in pose(0.4).into_iter().enumerate() {
            assert_abs_diff_eq!(cycle.demo.position()[[0, d]], y, epsilon = 0.02);
        }
    }
}

/// Cycles of noisy equal strides have one style, because their noise is as white as it was recorded.
#[test]
fn noise_of_cycles_stays_white_and_adds_no_style() {
    for (period, share) in [(1.035, 0.005), (1.0037, 0.005), (2.002, 0.01)] {
        let n = (20.5 * period / DT) as usize;
        let position = noisy(walk(&even(n), |t| TAU * t / period), share, 7);
        let as_recorded = roughness(&position.column(0).to_vec());
        let demos: Vec<_> = one(recorded(position)).unwrap().kept.into_iter().map(|cycle| cycle.demo).collect();
        let mean = demos.iter().map(|demo| roughness(&demo.position().column(0).to_vec())).sum::<f64>() / 20.0;
        assert_abs_diff_eq!(mean, as_recorded, epsilon = 0.1);
        assert_eq!(n_styles(Kind::Rhythmic, &demos), 1);
    }
}

/// Cycles have the sampling rate of their own recording.
#[test]
fn cycles_are_no_denser_than_their_recording() {
    let fast = recorded(walk(&even(450), |t| TAU * t));
    let time: Vec<f64> = (0..150).map(|c| f64::from(c) * 0.03).collect();
    let slow = Demonstration::new(walk(&time, |t| TAU * t), Sampling::Uniform { dt: 0.03 }).unwrap();
    let found = preprocessing::cycles(&[fast, slow], None, CycleOutput::Each).unwrap();
    for cycle in &found.kept {
        assert_eq!(cycle.demo.n_samples(), [100, 33][cycle.recording]);
    }
    assert!(found.kept.iter().any(|cycle| cycle.recording == 1));
}

/// A reach and a recording at rest are rejected among walks; alone, they are errors.
#[test]
fn recordings_without_a_period_are_rejected_among_others() {
    let reach = |s: f64| s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
    let reaching = recorded(Array2::from_shape_fn((200, 4), |(c, d)| reach(c as f64 / 199.0) * (d as f64 - 1.5)));
    let still = recorded(Array2::ones((80, 4)));
    let walking = recorded(walk(&even(500), |t| TAU * t));
    let found = preprocessing::cycles(&[reaching.clone(), walking, still.clone()], None, CycleOutput::Each).unwrap();
    assert!(found.kept.len() >= 4 && found.kept.iter().all(|cycle| cycle.recording == 1));
    let [first, second] = &found.rejected[..] else { panic!("{:?}", found.rejected) };
    assert!(
        matches!(first.reason, RejectionReason::Aperiodic { .. }) && first.reason.to_string().contains("no period")
    );
    assert_eq!((first.recording, first.start, first.period), (0, 0.0, 1.99));
    assert_eq!((second.recording, second.reason), (2, RejectionReason::Still));
    assert!(
        preprocessing::cycles(&[still, reaching], None, CycleOutput::Each)
            .unwrap_err()
            .to_string()
            .contains("stands still")
    );
}

/// The angle of a crank gains turns per cycle: all its closed cycles have a common mean, and the turns are reported.
#[test]
fn turns_per_cycle_are_subtracted_and_reported() {
    for (unit, turn) in [("rad", TAU), ("deg", -360.0), ("", TAU), ("rad", -2.0 * TAU)] {
        let crank = |t: f64| turn * (t + 0.02 * (TAU * t).sin());
        let position = concatenate![
            Axis(1),
            walk(&even(620), |t| TAU * t),
            Array1::from_iter(even(620).into_iter().map(crank)).insert_axis(Axis(1))
        ];
        let units = ["rad", "rad", "rad", "m", unit].map(String::from).to_vec();
        let found = one(recorded(position).with_units(units).unwrap()).unwrap();
        assert_eq!(found.kept.len(), 6);
        let [growth] = &found.growths[..] else { panic!("{:?}", found.growths) };
        let turns = if unit == "deg" { turn / 360.0 } else { turn / TAU };
        assert_eq!((growth.dof, f64::from(growth.turns)), (4, turns));
        for cycle in &found.kept {
            assert_relative_eq!(cycle.gain[4], turn, max_relative = 1e-2);
            let deviation = &cycle.demo.position().column(4) - 0.5 * turn;
            assert!(deviation.iter().all(|y| y.abs() < 0.05 * turn.abs()), "{unit}: {deviation}");
            assert!(seam(&cycle.demo) < 1.1);
        }
    }
}

/// Gains per cycle are reported if they exceed the movement within a cycle.
#[test]
fn gains_that_exceed_the_movement_are_reported() {
    for (gain, reported) in [(0.5, false), (1.4, true), (5.0, true)] {
        let mut position = walk(&even(500), |t| TAU * t);
        position.column_mut(0).iter_mut().zip(even(500)).for_each(|(y, t)| *y += gain * t);
        // A column at rest gains nothing but rounding.
        position = concatenate![Axis(1), position, Array2::from_elem((500, 1), 0.1 + gain)];
        let found = one(recorded(position)).unwrap();
        assert_eq!(found.growths.len(), usize::from(reported), "{gain}: {:?}", found.growths);
        for growth in found.growths {
            assert_relative_eq!(growth.gain, gain, max_relative = 0.02);
            assert_eq!((growth.recording, growth.dof, growth.turns), (0, 0, 0));
        }
    }
}

/// A stride of different shape and one of different duration are rejected, each with its reason.
#[test]
fn outliers_among_the_cycles_are_rejected_with_a_reason() {
    let limp = |t: f64| if (3.0..4.0).contains(&t) { 0.5 * (TAU * t).sin().powi(3) } else { 0.0 };
    let mut position = walk(&even(801), |t| TAU * t);
    position.column_mut(2).iter_mut().zip(even(801)).for_each(|(y, t)| *y += limp(t));
    let found = one(recorded(position)).unwrap();
    assert_eq!((found.kept.len(), found.rejected.len()), (7, 1));
    assert_abs_diff_eq!(found.rejected[0].start, 3.0, epsilon = 0.02);
    assert!(matches!(found.rejected[0].reason, RejectionReason::Shape { .. }));

    // The fourth stride takes a fifth longer.
    let phi = |t: f64| TAU * if t < 3.0 { t } else { f64::max(3.0 + (t - 3.0) / 1.2, t - 0.2) };
    let found = one(recorded(walk(&even(821), phi))).unwrap();
    assert_eq!(found.rejected.len(), 1);
    assert_relative_eq!(found.rejected[0].period, 1.2, max_relative = 0.03);
    assert!(matches!(found.rejected[0].reason, RejectionReason::Period { .. }));
    assert!(found.rejected[0].reason.to_string().contains("median period is 1.0"));
}

/// Cycles begin at the onsets that are given, to the last bit.
#[test]
fn cycles_begin_at_given_onsets() {
    let onsets = vec![0.25, 1.26, 2.24, 3.25];
    let recording = recorded(walk(&even(400), |t| TAU * t));
    let found = preprocessing::cycles(std::slice::from_ref(&recording), Some(&[onsets]), CycleOutput::Each).unwrap();
    let periods: Vec<f64> = found.kept.iter().map(|cycle| cycle.period).collect();
    assert_abs_diff_eq!(&periods[..], &[1.01, 0.98, 1.01][..], epsilon = 1e-12);

    for (onsets, wrong) in [(vec![0.5], "at least"), (vec![1.0, 0.5], "must increase"), (vec![1.0, 9.0], "within")] {
        let message = preprocessing::cycles(std::slice::from_ref(&recording), Some(&[onsets]), CycleOutput::Each)
            .unwrap_err()
            .to_string();
        assert!(message.starts_with("demo 0: onsets") && message.contains(wrong), "{message}");
    }
}

/// A rhythmic primitive can be learnt from the cycles of a raw recording, which keep units and context.
#[test]
fn a_rhythmic_primitive_is_learnt_from_a_raw_recording() {
    let labels = |of: [&str; 4]| of.map(String::from).to_vec();
    let recording = recorded(walk(&even(520), |t| TAU * t / 1.3))
        .with_names(labels(["hip", "other hip", "knee", "height"]))
        .and_then(|demo| demo.with_units(labels(["rad", "rad", "rad", "m"])))
        .and_then(|demo| demo.with_context(vec![1.4]))
        .and_then(|demo| demo.with_goal(vec![0.0; 4]))
        .unwrap();
    let demos: Vec<_> = one(recording).unwrap().kept.into_iter().map(|cycle| cycle.demo).collect();
    let model = pdmp_core::fit(&demos, &FitOptions::new(Kind::Rhythmic)).unwrap();
    assert_relative_eq!(model.duration(), 1.3, max_relative = 1e-2);
    assert_eq!(model.units(), ["rad", "rad", "rad", "m"]);
    assert_eq!(demos[0].context(), Some(&[1.4.into()][..]));
    let loaded = pdmp_core::Model::from_bytes(&model.to_bytes().unwrap()).unwrap();
    assert_eq!(loaded.units(), model.units());
}

/// A cubic with irregular time stamps is resampled exactly, up to the last time if dt divides the duration.
#[test]
fn resampling_is_exact_for_cubics_at_irregular_stamps() {
    let time: Vec<f64> =
        (0..41).map(|c| 2.0 + c as f64 * 0.05 + 0.01 * (c as f64).sin() * f64::from(c % 40 != 0)).collect();
    let cubic = |t: f64| t * t * t - 3.0 * t;
    let position = Array1::from_iter(time.iter().map(|&t| cubic(t))).insert_axis(Axis(1));
    let recording = Demonstration::new(position, Sampling::Stamped { time }).unwrap();
    let even = preprocessing::resample(&recording, 0.02).unwrap();
    assert_eq!((even.n_samples(), even.sampling()), (101, &Sampling::Uniform { dt: 0.02 }));
    for (c, y) in even.position().column(0).iter().enumerate() {
        assert_abs_diff_eq!(*y, cubic(2.0 + c as f64 * 0.02), epsilon = 1e-9);
    }
    for (dt, wrong) in [(0.0, "positive"), (1.0, "fewer than 4"), (1e-300, "memory")] {
        let message = preprocessing::resample(&recording, dt).unwrap_err().to_string();
        assert!(message.contains(wrong), "{message}");
    }
}

/// Noisy reaches at a higher or lower rate, or split between samples, have one style, as the clean ones.
#[test]
fn resampling_of_noisy_reaches_adds_no_style() {
    let reach = |s: f64| s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
    for share in [0.0, 0.001, 0.003] {
        let demos: Vec<_> = (0..40)
            .map(|seed| {
                let path = |(c, d): (usize, usize)| reach(c as f64 / 100.0) * [1.0, -0.4][d];
                recorded(noisy(Array2::from_shape_fn((101, 2), path), share, seed + 1))
            })
            .collect();
        let resampled = |f: &dyn Fn(&Demonstration) -> Demonstration| demos.iter().map(f).collect::<Vec<_>>();
        for demos in [
            resampled(&|demo| preprocessing::resample(demo, 0.5 * DT).unwrap()),
            resampled(&|demo| preprocessing::resample(demo, 0.3 * DT).unwrap()),
            resampled(&|demo| preprocessing::resample(demo, 2.0 * DT).unwrap()),
            resampled(&|demo| preprocessing::split_at(demo, &[0.0037, 0.9962]).unwrap().remove(0)),
        ] {
            assert_eq!(n_styles(Kind::Discrete, &demos), 1, "noise {share}, {} samples", demos[0].n_samples());
        }
    }
}

/// Resampling preserves the samples at the times of the recording, and interpolates clean samples to 1e-6.
#[test]
fn resampling_preserves_recorded_samples() {
    let clean = walk(&even(301), |t| TAU * t / 1.3);
    let rough = noisy(clean.clone(), 0.02, 3);
    let same = preprocessing::resample(&recorded(rough.clone()), DT).unwrap();
    let every = preprocessing::resample(&recorded(clean), 0.5 * DT).unwrap();
    let finer: Vec<f64> = (0..601).map(|c| 0.5 * DT * f64::from(c)).collect();
    for (found, expected, tolerance) in [(same, rough, 1e-12), (every, walk(&finer, |t| TAU * t / 1.3), 1e-6)] {
        assert_eq!(found.n_samples(), expected.nrows());
        for (a, b) in found.position().iter().zip(&expected) {
            assert_abs_diff_eq!(a, b, epsilon = tolerance);
        }
    }
}

/// Parts begin and end at the given times, where their samples are equal.
#[test]
fn parts_meet_at_the_times_of_the_split() {
    let recording = recorded(walk(&even(300), |t| TAU * t)).with_goal(vec![0.0; 4]).unwrap();
    let parts = preprocessing::split_at(&recording, &[0.333, 1.0, 2.7]).unwrap();
    let [first, second] = &parts[..] else { panic!("{} parts", parts.len()) };
    assert_abs_diff_eq!(first.position().row(0)[0], 0.4 * (TAU * 0.333).sin(), epsilon = 1e-6);
    assert_eq!(first.position().row(first.n_samples() - 1), second.position().row(0));
    assert_eq!(first.goal(), None);
    let message = preprocessing::split_at(&recording, &[0.5, 0.51]).unwrap_err().to_string();
    assert!(message.contains("times = 0.51: a part must last"), "{message}");
}

/// Rest before and after a reach is removed up to the sample at which the speed reaches the threshold.
#[test]
fn trimming_removes_rest() {
    let share = |t: f64| ((t - 1.0) / 1.5).clamp(0.0, 1.0);
    let reach = |s: f64| s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
    // Both DoFs move equally relative to their ranges, so that the threshold is that of each.
    let position = Array2::from_shape_fn((400, 2), |(c, d)| [1.0, 1e-3][d] * reach(share(c as f64 * DT)));
    let trimmed = preprocessing::trim(&recorded(position.clone()), 0.05).unwrap();
    // Speed 30 s²(1 − s)² is at 5 % of its peak 1.875 where s(1 − s) = √0.003125.
    let edge = 0.5 - (0.25 - 0.003125f64.sqrt()).sqrt();
    let expected = 1.5 * (1.0 - 2.0 * edge) / DT;
    assert_abs_diff_eq!(trimmed.n_samples() as f64, expected, epsilon = 2.0);
    assert!(preprocessing::trim(&recorded(position), 1.0).unwrap_err().to_string().contains("threshold = 1"));
    let step = Array2::from_shape_fn((30, 1), |(c, _)| f64::from(u8::from(c > 15)));
    let message = preprocessing::trim(&recorded(step), 0.9).unwrap_err().to_string();
    assert!(message.contains("threshold = 0.9: leaves fewer than 4 samples"), "{message}");
    assert!(
        preprocessing::trim(&recorded(Array2::zeros((9, 2))), 0.05).unwrap_err().to_string().contains("stands still")
    );
}

/// Noise of up to 2 % of the range, or a jump, hardly changes the ends of the movement.
#[test]
fn trimming_is_robust_to_noise_and_jumps() {
    let share = |t: f64| ((t - 0.8) / 1.0).clamp(0.0, 1.0);
    let reach = |s: f64| s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
    let clean = Array2::from_shape_fn((261, 2), |(c, d)| [1.0, -0.4][d] * reach(share(c as f64 * DT)));
    let stamped = |position| Demonstration::new(position, Sampling::Stamped { time: even(261) }).unwrap();
    let ends = |position: Array2<f64>| {
        let trimmed = preprocessing::trim(&stamped(position), 0.05).unwrap();
        let Sampling::Stamped { time } = trimmed.sampling() else { panic!("no stamps") };
        [time[0], time[time.len() - 1]]
    };
    let [first, last] = ends(clean.clone());
    for (noise, slack) in [(0.001, 0.04), (0.003, 0.05), (0.01, 0.09), (0.02, 0.12)] {
        for seed in 1..11 {
            let found = ends(noisy(clean.clone(), noise, seed));
            assert_abs_diff_eq!(&found[..], &[first, last][..], epsilon = slack);
        }
    }
    let mut jumping = clean;
    jumping.slice_mut(s![130.., ..]).mapv_inplace(|y| y + 0.5);
    assert_abs_diff_eq!(&ends(jumping)[..], &[first, last][..], epsilon = 0.02);
}

/// A sine at the cut-off frequency keeps half of its amplitude and its phase.
#[test]
fn the_low_pass_halves_a_sine_at_the_cut_off_without_lag() {
    let sine = |t: f64| (TAU * 5.0 * t).sin();
    let position = Array1::from_iter(even(1001).into_iter().map(sine)).insert_axis(Axis(1));
    let filtered = preprocessing::lowpass(&recorded(position.clone()), 5.0).unwrap();
    for c in 100..900 {
        assert_abs_diff_eq!(filtered.position()[[c, 0]], 0.5 * sine(c as f64 * DT), epsilon = 1e-3);
    }
    let residuals = preprocessing::residuals(&recorded(position.clone()), &[0.5, 5.0, 45.0]).unwrap();
    assert_relative_eq!(residuals[[0, 0]], 0.5f64.sqrt(), max_relative = 1e-2);
    assert_relative_eq!(residuals[[1, 0]], 0.5 * 0.5f64.sqrt(), max_relative = 2e-2);
    assert!(residuals[[2, 0]] < 1e-3);
    let message = preprocessing::lowpass(&recorded(position), 80.0).unwrap_err().to_string();
    assert_eq!(message, "cut_off = 80 Hz: must lie below half the sampling rate of 100 Hz");
}

/// Gaps up to `max_gap` are interpolated, and other samples are unchanged.
#[test]
fn short_gaps_are_interpolated_and_other_samples_unchanged() {
    let time = even(100);
    let whole = walk(&time, |t| TAU * t);
    let mut holed = whole.clone();
    holed.slice_mut(s![40..44, 0]).fill(f64::NAN);
    holed[[70, 2]] = f64::NAN;
    let names = ["a", "b", "c", "d"].map(String::from);
    let filled = preprocessing::fill_gaps(holed.clone(), &time, &names, &[0.0; 4], 0.05).unwrap();
    for (index, y) in filled.indexed_iter() {
        let tolerance = if holed[index].is_nan() { 1e-4 } else { 0.0 };
        assert_abs_diff_eq!(*y, whole[index], epsilon = tolerance);
    }
    let message = preprocessing::fill_gaps(holed, &time, &names, &[0.0; 4], 0.04).unwrap_err().to_string();
    assert!(message.contains("column 'a': no sample between t = 0.39 s and t = 0.44 s"), "{message}");
}

/// Rows that are missing over more than `max_gap` are reported with their times; the usual interval may exceed it.
#[test]
fn missing_rows_are_rejected_beyond_a_positive_max_gap() {
    let time: Vec<f64> =
        even(100).into_iter().enumerate().filter(|(c, _)| !(40..60).contains(c)).map(|(_, t)| t).collect();
    let position = Array2::from_elem((80, 1), 1.0);
    let fill = |max_gap| preprocessing::fill_gaps(position.clone(), &time, &["a".into()], &[0.0], max_gap);
    assert!(fill(0.0).is_ok() && fill(0.22).is_ok());
    for max_gap in [0.001, 0.2] {
        let message = fill(max_gap).unwrap_err().to_string();
        assert!(message.starts_with("no row between t = 0.39 s and t = 0.6 s"), "{message}");
    }
    let even = even(80);
    assert!(preprocessing::fill_gaps(position.clone(), &even, &["a".into()], &[0.0], 0.001).is_ok());
}

/// Gaps at an end, empty columns and an invalid `max_gap` are rejected.
#[test]
fn gaps_that_cannot_be_filled_are_rejected() {
    let (time, names) = (even(10), [String::from("knee")]);
    let error_of = |gap: std::ops::Range<usize>, max_gap: f64| {
        let mut position = Array2::zeros((10, 1));
        position.slice_mut(s![gap, 0]).fill(f64::NAN);
        preprocessing::fill_gaps(position, &time, &names, &[0.0], max_gap).unwrap_err().to_string()
    };
    assert!(error_of(0..2, 1.0).contains("'knee': no sample before t = 0.02 s"));
    assert!(error_of(7..10, 1.0).contains("'knee': no sample after t = 0.06 s"));
    assert!(error_of(0..10, 1.0).contains("'knee': no sample at all"));
    assert!(error_of(1..8, 1.0).contains("3 samples"));
    assert!(error_of(4..5, f64::NAN).contains("max_gap"));
}

/// A gap through which an angle wraps is filled in the direction of the movement.
#[test]
fn angles_are_filled_across_the_wrap() {
    let time = even(60);
    let angle = |c: usize| 0.1 * c as f64;
    let wrapped = |c: usize| (angle(c) + PI).rem_euclid(TAU) - PI;
    let mut position = Array2::from_shape_fn((60, 1), |(c, _)| wrapped(c));
    position.slice_mut(s![29..34, 0]).fill(f64::NAN);
    let filled = preprocessing::fill_gaps(position, &time, &[String::from("yaw")], &[TAU], 0.1).unwrap();
    for c in 29..34 {
        let turns = (filled[[c, 0]] - angle(c)) / TAU;
        assert_abs_diff_eq!(turns, turns.round(), epsilon = 1e-9);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Cycles are closed and have the right period for all periods, phases, units and drifts.
    #[test]
    fn cycles_are_closed_and_as_long_as_the_period(
        period in 0.4f64..1.6, phase in 0.0f64..TAU, unit in -6..6, drift in -1.0f64..1.0,
    ) {
        let scale = 10f64.powi(unit);
        let mut position = walk(&even(400), |t| TAU * t / period + phase);
        for (c, mut row) in position.rows_mut().into_iter().enumerate() {
            row.mapv_inplace(|y| scale * (y + drift * c as f64 * DT));
        }
        let found = one(recorded(position)).unwrap();
        prop_assert!(found.kept.len() >= 2);
        let last = found.kept.len() - 1;
        for (k, cycle) in found.kept.into_iter().enumerate() {
            // Bounds at the ends of the recording are less certain.
            let tolerance = if k == 0 || k == last { 0.05 } else { 0.01 };
            prop_assert!((cycle.period / period - 1.0).abs() < tolerance, "{} of {period}", cycle.period);
            prop_assert!(seam(&cycle.demo) < 1.5, "{}", seam(&cycle.demo));
        }
    }

    /// Trimmed, split, filtered and resampled recordings are finite for arbitrary time stamps.
    #[test]
    fn results_of_preprocessing_are_finite(
        steps in prop::collection::vec(1e-3..1.0, 8..40), seed: u64, exponent in -100..100,
    ) {
        let mut random = noise(seed);
        let time: Vec<f64> = steps.iter().scan(0.0, |t, h| { *t += h; Some(*t) }).collect();
        let scale = 10f64.powi(exponent);
        let position = Array2::from_shape_fn((time.len(), 2), |_| scale * random());
        let (first, last) = (time[0], time[time.len() - 1]);
        let recording = Demonstration::new(position, Sampling::Stamped { time }).unwrap();
        let mut made = vec![preprocessing::resample(&recording, (last - first) / 20.0).unwrap()];
        made.extend(preprocessing::trim(&recording, 0.05));
        made.extend(preprocessing::split_at(&recording, &[first, last]).unwrap());
        made.extend(preprocessing::lowpass(&recording, 0.3 / ((last - first) / steps.len() as f64)));
        for demo in made {
            prop_assert!(demo.position().iter().all(|y| y.is_finite()));
        }
    }
}

/// Degrees of freedom at rest do not affect the period.
#[test]
fn columns_at_rest_do_not_affect_the_period() {
    let moving = walk(&even(400), |t| TAU * t / 1.3);
    let resting = Array2::from_elem((400, 3), 7.25);
    let position = concatenate![Axis(1), moving, resting];
    assert_relative_eq!(preprocessing::period(&recorded(position)).unwrap(), 1.3, max_relative = 1e-3);
}
