//! Inspection finds implausible samples with their location, and nothing in plausible movements.

#![cfg(feature = "learning")]

use std::f64::consts::TAU;

use ndarray::{Array2, s};
use pdmp_core::learning::{CanonicalOptions, TransportSelection};
use pdmp_core::preprocessing::inspection::{Finding, Padding, cycle_ends, inspect, unwound};
use pdmp_core::{Demonstration, FitOptions, Kind, Sampling, fit};

/// Five reaches over bumps of different height, with two degrees of freedom that stay away from zero.
fn reaches() -> Vec<Array2<f64>> {
    let reach = |h: f64| {
        Array2::from_shape_fn((101, 2), |(c, d)| {
            let s = c as f64 / 100.0;
            if d == 0 {
                0.5 + s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
            } else {
                0.2 + 64.0 * h * (s - s * s).powi(3)
            }
        })
    };
    [0.1, 0.2, 0.3, 0.4, 0.5].map(reach).to_vec()
}

fn demos(positions: Vec<Array2<f64>>) -> Vec<Demonstration> {
    positions.into_iter().map(|y| Demonstration::new(y, Sampling::Uniform { dt: 0.01 }).unwrap()).collect()
}

fn with_units(demos: Vec<Demonstration>, units: &[&str]) -> Vec<Demonstration> {
    let units: Vec<String> = units.iter().map(ToString::to_string).collect();
    demos.into_iter().map(|demo| demo.with_units(units.clone()).unwrap()).collect()
}

/// Uniform random numbers in [−1, 1), reproducible.
fn noise(n: usize) -> impl Iterator<Item = f64> {
    let mut state = n as u64 + 1;
    std::iter::repeat_with(move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    })
}

#[test]
fn nothing_is_found_in_movements_clean_noisy_or_at_rest() {
    for size in [0.0, 1e-4, 1e-2, 0.1] {
        let noisy = reaches().into_iter().enumerate().map(|(m, y)| {
            let added: Vec<f64> = noise(m).take(y.len()).map(|x| size * x).collect();
            y + Array2::from_shape_vec((101, 2), added).unwrap()
        });
        assert_eq!(inspect(&demos(noisy.collect()), None), []);
    }
    // Movements from and through zero, with a joint at rest, a gripper that closes, and rest at the end.
    let through = reaches().into_iter().map(|y| {
        let dwell = |c: usize| c.min(80);
        Array2::from_shape_fn((101, 4), |(c, d)| match d {
            0 => y[[dwell(c), 0]] - 0.5,
            1 => (y[[dwell(c), 1]] * 50.0).round() - 12.0,
            2 => 0.0,
            _ => f64::from(u8::from((30..60).contains(&c))),
        })
    });
    let through: Vec<_> = through.collect();
    let found = inspect(&demos(through), None);
    let unexpected = |finding: &Finding| {
        matches!(
            finding,
            Finding::Zeros { .. } | Finding::Outlier { .. } | Finding::Jump { .. } | Finding::Stuck { .. }
        )
    };
    assert!(!found.iter().any(unexpected), "{found:?}");
}

#[test]
fn rounding_errors_of_a_constant_are_not_reported() {
    // An angle in degrees, and a column that drifts, jumps to zero where samples were lost, and stops in motion.
    let cycle = |size: f64, lost: usize, at_rest: usize| {
        Array2::from_shape_fn((100 + at_rest, 2), |(c, d)| match d {
            0 => 180.0 + 90.0 * (c.min(99) as f64 * TAU / 100.0).sin(),
            _ if (50..50 + lost).contains(&c) => 0.0,
            _ => size * (1.0 + 0.01 * c.min(99) as f64),
        })
    };
    let found = |size: f64| {
        let [drifts, drops, stops] = [(0, 0), (2, 0), (0, 10)].map(|(lost, rest)| demos(vec![cycle(size, lost, rest)]));
        [cycle_ends(&drifts).len(), inspect(&drops, None).len(), inspect(&stops, None).len()]
    };
    assert_eq!(found(1.0), [1, 1, 1]);
    assert_eq!(found(5e-14), [0, 0, 1]); // the angle stops as well
}

#[test]
fn samples_lost_as_zeros_are_found_with_their_place() {
    for lost in [40..46, 70..71] {
        let mut positions = reaches();
        positions[2].slice_mut(s![lost.clone(), ..]).fill(0.0);
        positions[4].slice_mut(s![lost.clone(), 1]).fill(0.0);
        let found = inspect(&demos(positions), None);
        let places: Vec<_> = found
            .iter()
            .map(|finding| match finding {
                Finding::Zeros { demo, dofs, from, to, .. } => (*demo, dofs.len(), from.sample, to.sample, from.time),
                other => panic!("{other}"),
            })
            .collect();
        let time = Some(0.01 * lost.start as f64);
        assert_eq!(places, [(2, 2, lost.start, lost.end - 1, time), (4, 1, lost.start, lost.end - 1, time)]);
        assert!(found[1].to_string().contains("demo 4: \"y1\" is exactly 0"), "{}", found[1]);
    }
}

#[test]
fn rows_that_pad_a_stack_are_found() {
    for zeros in [true, false] {
        let mut positions = reaches();
        for (m, from) in [(1, 80), (3, 95)] {
            // A shorter movement that is padded to the length of the others.
            let whole = positions[m].clone();
            let last = whole.row(100).to_owned();
            for c in 0..101 {
                let row = if c < from { whole.row(c * 100 / (from - 1)).to_owned() } else { last.clone() };
                positions[m].row_mut(c).assign(&(if zeros && c >= from { row * 0.0 } else { row }));
            }
        }
        let found = inspect(&demos(positions), None);
        let padded: Vec<_> = found
            .iter()
            .map(|finding| match finding {
                Finding::Padded { demo, from, rows, padding } => (*demo, from.sample, *rows, *padding),
                other => panic!("{other}"),
            })
            .collect();
        let padding = if zeros { Padding::Zeros } else { Padding::LastRow };
        assert_eq!(padded, [(1, 80, 21, padding), (3, 95, 6, padding)]);
    }
}

#[test]
fn counters_and_clocks_among_the_columns_are_found() {
    let times: Vec<f64> = noise(7).take(101).enumerate().map(|(c, x)| 0.01 * c as f64 + 1e-3 * x).collect();
    let counted = |first: f64| {
        let times = times.clone();
        let columns = |y: Array2<f64>| {
            let time = times.clone();
            let table = Array2::from_shape_fn((101, 3), |(c, d)| match d {
                0 => first + c as f64,
                1 => time[c] - 2.0,
                _ => y[[c, 1]],
            });
            Demonstration::new(table, Sampling::Stamped { time }).unwrap()
        };
        reaches().into_iter().map(columns).collect::<Vec<_>>()
    };
    for first in [0.0, 1.0, 5417.0] {
        let found = inspect(&counted(first), None);
        assert_eq!(found, [Finding::Counter { dof: "y0".into() }, Finding::Clock { dof: "y1".into() }]);
    }
    let mut other = counted(0.0);
    other[3] =
        demos(vec![ndarray::concatenate![ndarray::Axis(1), reaches()[3], reaches()[0].slice(s![.., ..1])]]).remove(0);
    assert_eq!(inspect(&other, None), []);
}

#[test]
fn stamps_far_closer_than_the_others_are_found_where_noise_makes_them_steep() {
    let stamped = |close: f64, scatter: f64| {
        let position = reaches()[2].clone()
            + Array2::from_shape_vec((101, 2), noise(1).take(202).map(|x| scatter * x).collect()).unwrap();
        let time = (0..101).map(|c| if c == 50 { 0.49 + close } else { 0.01 * c as f64 }).collect();
        inspect(&[Demonstration::new(position, Sampling::Stamped { time }).unwrap()], None)
    };
    assert_eq!(stamped(0.01, 1e-4), []);
    assert_eq!(stamped(5e-3, 1e-2), []);
    let found = stamped(1e-6, 1e-4);
    let [Finding::CloseStamps { demo: 0, place, interval, usual, ratio, .. }] = &found[..] else { panic!("{found:?}") };
    assert_eq!(place.sample, 50);
    assert!((interval - 1e-6).abs() < 1e-9 && (usual - 0.01).abs() < 1e-9 && *ratio > 5.0);
}

#[test]
fn whole_turns_between_demonstrations_are_subtracted_if_the_unit_is_one_of_angles() {
    for (unit, turn) in [("rad", TAU), ("deg", 360.0), ("°", 360.0)] {
        let angles = |turns: [f64; 5]| {
            let positions = reaches().into_iter().zip(turns).map(|(mut y, turns)| {
                y *= turn / TAU;
                y.column_mut(0).map_inplace(|y| *y += turns * turn);
                y
            });
            demos(positions.collect())
        };
        let apart = with_units(angles([0.0, 1.0, 0.0, -2.0, 0.0]), &[unit, unit]);
        let found = inspect(&apart, None);
        let turns: Vec<_> = found
            .iter()
            .map(|finding| match finding {
                Finding::TurnsApart { demo, turns, mended: true, .. } => (*demo, *turns),
                other => panic!("{other}"),
            })
            .collect();
        assert_eq!(turns, [(1, 1.0), (3, -2.0)]);
        for (demo, together) in unwound(&apart).iter().zip(angles([0.0; 5])) {
            assert!((&demo.position() - &together.position()).iter().all(|y| y.abs() < 1e-12 * turn));
        }
        let model = fit(&apart, &FitOptions::new(Kind::Discrete)).unwrap();
        assert!(model.demonstrated().goals.column(0).iter().all(|goal| (goal - 1.5 * turn / TAU).abs() < 1e-9 * turn));
        assert_eq!(model.learnt().findings, found);
        // Without units the offsets are only reported; lengths in metres are accepted.
        let unknown = inspect(&angles([0.0, 1.0, 0.0, -2.0, 0.0]), None);
        assert!(
            matches!(unknown[..], [Finding::TurnsApart { mended: false, .. }, Finding::TurnsApart { .. }]),
            "{unknown:?}"
        );
        assert_eq!(inspect(&with_units(angles([0.0, 1.0, 0.0, -2.0, 0.0]), &["m", "m"]), None), []);
    }
}

/// A joint that turns further in some demonstrations is not offset by whole turns.
#[test]
fn movements_that_turn_further_are_unchanged() {
    let spins = [0.0, 1.0, 2.0].map(|turns| reaches()[0].mapv(|y| y * TAU * turns)).to_vec();
    let spins = with_units(demos(spins), &["rad", "rad"]);
    assert_eq!(unwound(&spins).as_ref(), &spins[..]);
    assert!(inspect(&spins, None).iter().all(|finding| !matches!(finding, Finding::TurnsApart { .. })));
}

#[test]
fn angles_that_wrap_are_found() {
    for (units, turn) in [(Some("rad"), TAU), (None, TAU), (None, 360.0), (Some("deg"), 360.0)] {
        let wrapped = Array2::from_shape_fn((200, 1), |(c, _)| {
            let angle = turn * (0.3 + 0.6 * (c as f64 / 199.0));
            angle - turn * (angle / turn).round()
        });
        // An angle of unknown unit that covers nearly the full circle.
        let full_circle = Array2::from_shape_fn((200, 1), |(c, _)| {
            let angle = turn * (0.2 + 1.1 * (c as f64 / 199.0));
            angle - turn * (angle / turn).round()
        });
        let mut demo = demos(vec![if units.is_some() { wrapped } else { full_circle }]);
        if let Some(unit) = units {
            demo = with_units(demo, &[unit]);
        }
        let found = inspect(&demo, None);
        assert!(matches!(found[..], [Finding::Wrap { demo: 0, .. }]), "{found:?}");
    }
}

#[test]
fn gains_whose_transients_the_samples_do_not_resolve_are_found() {
    let found = |alpha_z: f64, n_samples: Option<usize>| {
        // With immediate transport a movement starts with a transient at the rate of the gains.
        let transport = TransportSelection::Immediate;
        let canonical = CanonicalOptions::Discrete { tau: None, alpha_x: None, transport };
        let mut options = FitOptions::new(canonical).alpha_z(alpha_z);
        options.n_samples = n_samples;
        fit(&demos(reaches()), &options).unwrap().learnt().findings.clone()
    };
    assert_eq!(found(25.0, None), []);
    assert_eq!(found(100.0, Some(4001)), []);
    for alpha_z in [200.0, 3000.0] {
        let findings = found(alpha_z, None);
        let [Finding::Stiff { shown, reproduced, .. }] = &findings[..] else { panic!("{findings:?}") };
        assert!((5.0..15.0).contains(shown) && *reproduced > 3.0 * shown);
    }
}

/// Movements of different amplitude at 100 Hz with noise of a given size, away from zero.
fn noisy(noise_size: f64) -> Vec<Array2<f64>> {
    let movement = |(m, y): (usize, Array2<f64>)| {
        let mut added = noise(m);
        Array2::from_shape_fn((201, 2), |(c, d)| {
            let s = c as f64 / 2.0;
            let (before, share) = (s.floor() as usize, s.fract());
            let curve = (1.0 - share) * y[[before, d]] + share * y[[(before + 1).min(100), d]];
            curve + noise_size * added.next().unwrap()
        })
    };
    reaches().into_iter().enumerate().map(movement).collect()
}

#[test]
fn outliers_jumps_and_stuck_sensors_are_found_with_their_place() {
    for (noise, size) in [(0.0, 0.3), (0.005, 0.3), (0.005, -3.0), (0.005, 30.0)] {
        for length in [1, 2, 5] {
            let mut positions = noisy(noise);
            positions[3].slice_mut(s![60..60 + length, 1]).map_inplace(|y| *y += size);
            let found = inspect(&demos(positions), None);
            let [Finding::Outlier { demo: 3, dof, from, to, step, ratio, others: 0 }] = &found[..] else {
                panic!("{found:?}")
            };
            assert_eq!((dof.as_str(), from.sample, to.sample, from.time), ("y1", 60, 59 + length, Some(0.6)));
            assert!((step - size).abs() < 0.03 && *ratio > 8.0);
        }
        let mut positions = noisy(noise);
        positions[3].slice_mut(s![60.., 1]).map_inplace(|y| *y += size);
        let found = inspect(&demos(positions), None);
        assert!(
            matches!(&found[..], [Finding::Jump { demo: 3, dof, place, others: 0, .. }] if dof == "y1" && place.sample == 60),
            "{found:?}"
        );
    }
    // One finding per demonstration counts all outliers.
    let mut positions = noisy(0.005);
    [30, 60, 100, 101, 170].iter().for_each(|&c| positions[0][[c, 0]] += 0.3);
    let found = inspect(&demos(positions), None);
    assert!(matches!(found[..], [Finding::Outlier { demo: 0, others: 3, .. }]), "{found:?}");
    // A sensor that repeats its value for 30 samples of a movement.
    for noise in [0.0, 0.005] {
        let mut positions = noisy(noise);
        let held = positions[2][[70, 0]];
        positions[2].slice_mut(s![71..100, 0]).fill(held);
        let found = inspect(&demos(positions), None);
        let [Finding::Stuck { demo: 2, from, to, step, .. }] = &found[..] else { panic!("{found:?}") };
        assert_eq!((from.sample, to.sample), (70, 99));
        assert!(*step > 0.2);
    }
}

#[test]
fn ten_spikes_in_every_demonstration_are_found_in_all() {
    let mut positions = noisy(0.003);
    for (m, y) in positions.iter_mut().enumerate() {
        for (k, sign) in noise(100 + m).take(10).enumerate() {
            y[[12 + 18 * k, k % 2]] += 0.3 * sign.signum();
        }
    }
    let found = inspect(&demos(positions), None);
    let places: Vec<_> = found
        .iter()
        .map(|finding| match finding {
            Finding::Outlier { demo, others, .. } => (*demo, *others),
            other => panic!("{other}"),
        })
        .collect();
    assert_eq!(places, [0, 1, 2, 3, 4].map(|demo| (demo, 9)));
}

/// Signals of time in seconds and of the duration of the recording, with details of at least 50 ms.
const SIGNALS: [fn(f64, f64) -> f64; 6] = [
    |t, duration| rise(t / duration),
    |t, duration| rise((t - 0.4 * duration) / 0.2), // fast, between rests
    |t, duration| 0.5 * rise(3.0 * t / duration) + 0.5 * rise(3.0 * t / duration - 2.0), // a rest within
    |t, _| 0.5 * (TAU * t / 1.1).sin() + 0.3 * (2.0 * TAU * t / 1.1 + 0.4).sin() + 0.1 * (3.0 * TAU * t / 1.1).sin(),
    |t, duration| (2.0 * t / duration - 0.4).clamp(0.0, 1.0), // constant velocity
    |t, _| {
        // Acceleration with an impact and its ringing in each step.
        let after = (t - 0.3).rem_euclid(0.55);
        0.3 * (TAU * t / 1.1).sin() + (-after / 0.05).exp() * (TAU * after / 0.1).sin()
    },
];

fn rise(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
}

#[test]
fn movements_with_noise_and_quantisation_at_any_rate_have_no_finding() {
    let mut n_cases = 0;
    for rate in [50.0, 100.0, 250.0, 1000.0] {
        for (k, signal) in SIGNALS.iter().enumerate() {
            for (size, colour) in [(0.0, 0.0), (1e-3, 0.0), (0.01, 0.0), (0.05, 0.0), (0.01, 0.95), (0.002, 1.0)] {
                for quantum in [0.0, 5e-4, 5e-3, 0.03] {
                    for jitter in [0.0, 0.3] {
                        n_cases += 1;
                        let mut random = noise(n_cases);
                        // A sum of uniform numbers is nearly normal; `colour` is its autocorrelation.
                        let mut normal = || size * random.by_ref().take(6).sum::<f64>() / 2f64.sqrt();
                        let n = (2.0 * rate) as usize;
                        let (mut time, mut added) = (Vec::new(), normal());
                        let position = Array2::from_shape_fn((n, 1), |(c, _)| {
                            let t = (c as f64 + jitter * ((7 * c) as f64).sin() / 2.0) / rate;
                            time.push(t);
                            added = colour * added + normal();
                            let y = signal(t, n as f64 / rate) + added;
                            if quantum > 0.0 { (y / quantum).round() * quantum } else { y }
                        });
                        let demo = Demonstration::new(position, Sampling::Stamped { time }).unwrap();
                        let mut found = inspect(&[demo], None);
                        // A quantised rest may look like padding.
                        found.retain(|finding| !matches!(finding, Finding::Padded { .. }));
                        assert_eq!(found, [], "signal {k}, {rate} Hz, noise {size} {colour}, quantum {quantum}");
                    }
                }
            }
        }
    }
    assert_eq!(n_cases, 4 * 6 * 6 * 4 * 2);
}

#[test]
fn a_jump_is_a_wrap_only_if_whole_turns_explain_it() {
    let found = |size: f64, at: usize| {
        let mut positions = noisy(0.003);
        positions[3].slice_mut(s![at.., 1]).map_inplace(|y| *y += size);
        inspect(&with_units(demos(positions), &["rad", "rad"]), None)
    };
    for size in [3.3, 4.0, 30.0] {
        assert!(matches!(found(size, 60)[..], [Finding::Jump { demo: 3, .. }]), "{size}: {:?}", found(size, 60));
    }
    for turns in [1.0, -1.0, 5.0] {
        let found = found(turns * TAU, 60);
        assert!(matches!(found[..], [Finding::Wrap { demo: 3, .. }]), "{found:?}");
        let text = if turns.abs() == 1.0 { "about a full turn of 6.2832" } else { "about 5 full turns of 6.2832" };
        assert!(found[0].to_string().contains(text), "{}", found[0]);
    }
}

#[test]
fn another_unit_of_angle_or_time_is_found_by_the_magnitude() {
    let in_units = |factor: f64, time: f64| {
        let demo = |(m, y): (usize, Array2<f64>)| {
            let (factor, time) = if m == 2 { (factor, time) } else { (1.0, 1.0) };
            Demonstration::new(y * factor, Sampling::Uniform { dt: 0.01 * time }).unwrap()
        };
        inspect(&reaches().into_iter().enumerate().map(demo).collect::<Vec<_>>(), None)
    };
    assert_eq!(in_units(4.0, 4.0), []);
    for (factor, text) in [
        (180.0 / std::f64::consts::PI, "degrees among radians?"),
        (std::f64::consts::PI / 180.0, "radians among degrees?"),
        (1000.0, "mm among m?"),
        (1e6, "check its units"),
    ] {
        let found = in_units(factor, 1.0);
        let [Finding::OtherRange { demo: 2, ratio, .. }] = &found[..] else { panic!("{found:?}") };
        assert!((0.6..1.7).contains(&(ratio / factor)), "{ratio}");
        assert!(found[0].to_string().contains(text), "{}", found[0]);
    }
    for (factor, text) in
        [(1e3, "ms among s?"), (1e-3, "s among ms?"), (1e6, "µs among s?"), (30.0, "check its time stamps")]
    {
        let found = in_units(1.0, factor);
        let [Finding::OtherDuration { demo: 2, ratio, .. }] = &found[..] else { panic!("{found:?}") };
        assert!((ratio / factor - 1.0).abs() < 1e-9);
        assert!(found[0].to_string().contains(text), "{}", found[0]);
    }
    // A single degree of freedom at rest in one demonstration, and a column that moves in a single one, are movements.
    let mut positions: Vec<_> = reaches().into_iter().map(|y| y.slice_move(s![.., 1..])).collect();
    positions[1] *= 1e-3;
    assert_eq!(inspect(&demos(positions), None), []);
    let mut positions = reaches();
    positions.iter_mut().enumerate().for_each(|(m, y)| {
        let factor = if m == 1 { 100.0 } else { 1.0 };
        y.column_mut(1).map_inplace(|y| *y *= factor);
    });
    assert_eq!(inspect(&demos(positions), None), []);
}

#[test]
fn missing_rows_are_found_where_they_leave_the_movement_open() {
    let cut = |position: &Array2<f64>, from: usize, n_missing: usize| {
        let kept: Vec<usize> = (0..position.nrows()).filter(|c| !(from..from + n_missing).contains(c)).collect();
        let time = kept.iter().map(|&c| 0.01 * c as f64).collect();
        let demo = Demonstration::new(position.select(ndarray::Axis(0), &kept), Sampling::Stamped { time }).unwrap();
        inspect(&[demo], None)
    };
    let reach = &noisy(0.003)[3];
    for (from, n_missing) in [(50, 1), (50, 4), (90, 20), (20, 20)] {
        assert_eq!(cut(reach, from, n_missing), []);
    }
    for n_missing in [70, 110] {
        let found = cut(reach, 50, n_missing);
        let [Finding::MissingRows { demo: 0, from, to, ratio, .. }] = &found[..] else { panic!("{found:?}") };
        assert_eq!((from.sample, to.sample), (49, 50));
        assert!((ratio - (n_missing + 1) as f64).abs() < 0.1);
        assert!(found[0].to_string().contains("no samples between sample 49 (t = 0.49 s) and"), "{}", found[0]);
    }
    // A half of a cycle among ten.
    let gait = Array2::from_shape_fn((1000, 1), |(c, _)| (TAU * c as f64 / 100.0).sin());
    assert_eq!(cut(&gait, 440, 8), []);
    let found = cut(&gait, 440, 45);
    assert!(matches!(&found[..], [Finding::MissingRows { error: Some((dof, _)), .. }] if dof == "y0"), "{found:?}");
}
