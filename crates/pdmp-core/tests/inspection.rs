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
    assert!(found.iter().all(|finding| !matches!(finding, Finding::Zeros { .. })), "{found:?}");
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
