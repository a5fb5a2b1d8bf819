//! Recognition of movements: no allocation, bounded time, refusals, and estimates of synthetic movements.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/counting.rs"]
mod counting;

use common::*;
use counting::{Random, allocations};
use pdmp_core::inference::{Prior, Recogniser, Timing};
use pdmp_core::learning::{Blocks, Truncation, fit_blocks, learn_prior};
use pdmp_core::numerics::Threads;
use pdmp_core::{Demonstration, Error, Kind, Model, Sampling};

fn recordings() -> Vec<Demonstration> {
    (0..12).map(|k| reach(0.05 * f64::from(k), 0.8 + 0.05 * f64::from((7 * k) % 12), 0.01)).collect()
}

fn learnt(demos: &[Demonstration], kind: Kind) -> (Model, Prior) {
    let model = (*learn(demos, &options(kind))).clone();
    let prior = learn_prior(&model, demos, None, Threads::ONE).unwrap();
    (model, prior)
}

/// Observations, estimates and continuations do not allocate, with samples missing, gaps, and after a reset.
#[test]
fn observations_allocate_nothing() {
    let (model, prior) = learnt(&recordings(), Kind::Discrete);
    let mut recogniser = Recogniser::new(&model, &prior, Timing { starts: [-0.2, 0.3], duration: None }).unwrap();
    let mut random = Random(2);
    let (mut ahead, mut deviation) = ([0.0; 6], [0.0; 6]);
    let before = allocations();
    let mut time = 0.0;
    for _ in 0..40 {
        time += random.scale(1e-3, 0.2);
        let mut place = || if random.rarely() { f64::NAN } else { random.next() };
        let position = [place(), place(), place()];
        recogniser.update(time, &position).unwrap();
        if position.iter().any(|y| !y.is_nan()) {
            recogniser.estimate().unwrap();
            recogniser.write_continuation(&[time, time + 0.1], &mut ahead, &mut deviation).unwrap();
        }
    }
    assert_eq!(allocations() - before, 0);
    let whole = recogniser.continuation(&[time, time + 0.1]).unwrap();
    assert!(whole.position.iter().eq(&ahead) && whole.deviation.iter().eq(&deviation));
    assert!(recogniser.write_continuation(&[time], &mut ahead, &mut deviation).is_err(), "a wrong length");
}

/// Shows a reach that pauses for a time in seconds after its first samples, and calls `look` after each sample with the time,
/// and whether it pauses.
fn watched(
    recogniser: &mut Recogniser,
    movement: &Demonstration,
    (from, pause): (usize, usize),
    mut look: impl FnMut(&mut Recogniser, f64, bool),
) {
    let mut random = Random(7);
    for k in 0..movement.n_samples() + pause {
        let paused = (from..from + pause).contains(&k);
        let own = if k < from { k } else { from.max(k - pause.min(k)) };
        let noise = if paused { 0.002 } else { 0.0 };
        let position = [0, 1, 2].map(|d| movement.position()[[own, d]] + noise * (random.next() - 0.5));
        recogniser.update(0.01 * k as f64, &position).unwrap();
        look(recogniser, 0.01 * k as f64, paused);
    }
}

/// In a pause the clock rests; afterwards it goes on, and nothing allocates.
#[test]
fn a_pause_holds_the_clock() {
    let (model, prior) = learnt(&recordings(), Kind::Discrete);
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    for (from, pause) in [(45, 100), (60, 300)] {
        recogniser.reset();
        let new = reach(0.33, 1.1, 0.01);
        let (mut held, mut later, mut n_stopped) = (0, 0, 0);
        let before = allocations();
        watched(&mut recogniser, &new, (from, pause), |recogniser, time, paused| {
            let estimate = recogniser.estimate().unwrap();
            n_stopped += usize::from(estimate.stopped > 0.5);
            let since = time - 0.01 * from as f64;
            // It is noticed after up to a third of the movement.
            if paused && since > 0.35 {
                assert!(estimate.stopped > 0.9, "{from} {pause} {time}: {}", estimate.stopped);
                assert!((estimate.fraction - from as f64 / 110.0).abs() < 0.1, "{from} {time}: {}", estimate.fraction);
                held += 1;
            }
            if since > 0.01 * pause as f64 + 0.2 && estimate.fraction < 0.9 {
                let arrival = 1.1 + 0.01 * pause as f64;
                assert!((estimate.arrival - arrival).abs() < 0.15, "{from} {time}: {} {arrival}", estimate.arrival);
                later += 1;
            }
        });
        assert_eq!(allocations() - before, 0);
        assert!(held > pause / 2 && later > 10 && n_stopped < pause + 20, "{held} {later} {n_stopped}");
    }
}

/// The clock of a movement without a pause does not rest.
#[test]
fn movements_without_pauses_are_not_stopped() {
    let (model, prior) = learnt(&recordings(), Kind::Discrete);
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    for k in 0..20 {
        recogniser.reset();
        let new = reach(0.03 * f64::from(k), 0.75 + 0.04 * f64::from((7 * k) % 20), 0.01);
        watched(&mut recogniser, &new, (0, 0), |recogniser, time, _| {
            let stopped = recogniser.estimate().unwrap().stopped;
            assert!(stopped < 0.9, "{k} {time}: {stopped}");
        });
    }
}

/// From half of a new movement, goal and duration are known to a few hundredths of their range.
#[test]
fn half_a_movement_gives_the_whole() {
    let demos = recordings();
    let (model, prior) = learnt(&demos, Kind::Discrete);
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    let new = reach(0.33, 1.1, 0.01);
    for k in 0..55 {
        // One DoF is missing in every third sample.
        let mut position = new.position().row(k).to_vec();
        if k % 3 == 1 {
            position[0] = f64::NAN;
        }
        recogniser.update(5.0 + 0.01 * k as f64, &position).unwrap();
    }
    let estimate = recogniser.estimate().unwrap();
    assert!((estimate.duration / 1.1).ln().abs() < 0.05, "{}", estimate.duration);
    assert!((estimate.arrival - 6.1).abs() < 0.06 && (estimate.fraction - 0.49).abs() < 0.04);
    let last = new.position().row(new.n_samples() - 1).to_vec();
    assert!(estimate.goal().iter().zip(&last).all(|(a, b)| (a - b).abs() < 0.02), "{:?} {last:?}", estimate.goal());
    assert!(estimate.surprise < 2.0);
    let conditions = estimate.conditions();
    assert_eq!(conditions.style.map(|style| style.len()), Some(model.n_styles()));
    let time: Vec<f64> = (55..111).map(|k| 5.0 + 0.01 * f64::from(k)).collect();
    let rest = recogniser.continuation(&time).unwrap();
    let error =
        (&rest.position - &new.position().slice(ndarray::s![55..111, ..])).mapv(f64::abs).fold(0.0, |a, b| b.max(a));
    assert!(error < 0.04, "{error}");
}

/// A movement that differs from all demonstrations is surprising.
#[test]
fn another_movement_is_surprising() {
    let (model, prior) = learnt(&recordings(), Kind::Discrete);
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    for k in 0..50 {
        let s = 0.02 * f64::from(k);
        recogniser.update(0.01 * f64::from(k), &[0.2 + (9.0 * s).sin() * 0.3, -s, s]).unwrap();
    }
    let surprise = recogniser.estimate().unwrap().surprise;
    assert!(surprise > 5.0, "{surprise}");
}

/// Returns the distance of two phases, in cycles.
fn apart(a: f64, b: f64) -> f64 {
    ((a - b + 0.5).rem_euclid(1.0) - 0.5).abs()
}

/// Period and phase of a cycle are known from less than one period.
#[test]
fn part_of_a_cycle_gives_period_and_phase() {
    let demos: Vec<_> =
        (0..10).map(|k| cycle(0.04 * f64::from(k), 0.9 + 0.04 * f64::from((3 * k) % 10), 120)).collect();
    let (model, prior) = learnt(&demos, Kind::Rhythmic);
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    let new = cycle(0.22, 1.1, 110);
    for k in 0..80 {
        recogniser.update(0.01 * k as f64, &new.position().row((k + 30) % 110).to_vec()).unwrap();
    }
    let estimate = recogniser.estimate().unwrap();
    assert!((estimate.duration / 1.1).ln().abs() < 0.08, "{}", estimate.duration);
    assert!(apart(estimate.fraction, 109.0 / 110.0) < 0.03, "{}", estimate.fraction);
}

/// The hypotheses that a known or common period leaves free are of the phase, which is then known better.
#[test]
fn phases_are_finer_where_the_period_is_known() {
    let demos: Vec<_> = (0..10).map(|k| cycle(0.04 * f64::from(k), 1.1, 110)).collect();
    let (model, prior) = learnt(&demos, Kind::Rhythmic);
    let new = cycle(0.22, 1.1, 110);
    for duration in [None, Some(1.1)] {
        let mut recogniser = Recogniser::new(&model, &prior, Timing { duration, ..Timing::default() }).unwrap();
        for k in 0..37 {
            recogniser.update(0.01 * k as f64, &new.position().row((k + 30) % 110).to_vec()).unwrap();
        }
        let estimate = recogniser.estimate().unwrap();
        assert!(apart(estimate.fraction, 66.0 / 110.0) < 0.006, "{}", estimate.fraction);
        assert!(recogniser.n_hypotheses() <= 384, "{}", recogniser.n_hypotheses());
    }
}

/// Bad input is refused, and the recogniser then remains as it was.
#[test]
fn bad_observations_are_refused() {
    let demos = recordings();
    let (model, prior) = learnt(&demos, Kind::Discrete);
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    assert!(recogniser.estimate().is_err(), "nothing was observed");
    recogniser.update(0.0, &[f64::NAN; 3]).unwrap();
    assert!(recogniser.estimate().is_err(), "every sample is missing");
    recogniser.update(0.1, &[0.2, 0.0, 0.0]).unwrap();
    let before = recogniser.estimate().unwrap().clone();
    for (time, position) in [(0.1, vec![0.2; 3]), (0.05, vec![0.2; 3]), (f64::NAN, vec![0.2; 3]), (0.2, vec![0.2; 2])] {
        assert!(recogniser.update(time, &position).is_err());
    }
    assert!(recogniser.update(0.2, &[f64::INFINITY, 0.0, 0.0]).is_err());
    assert_eq!(*recogniser.estimate().unwrap(), before);
    assert!(recogniser.continuation(&[0.05]).is_err(), "a time before the last observation");
    assert!(recogniser.continuation(&[f64::NAN]).is_err());

    let threads = Threads::ONE;
    assert!(learn_prior(&model, &demos[..5], None, threads).is_err(), "other demonstrations");
    assert!(learn_prior(&model, &demos, Some(&[0; 12]), threads).is_err(), "one group");
    assert!(learn_prior(&model, &demos, Some(&[0; 3]), threads).is_err(), "too few groups");
    let few = learn(&demos[..3], &options(Kind::Discrete));
    assert!(learn_prior(&few, &demos[..3], None, threads).is_err(), "too few demonstrations");
    let other = learn(&cycles(), &options(Kind::Rhythmic));
    assert!(Recogniser::new(&other, &prior, Timing::default()).is_err(), "a prior of another model");
    for timing in [[0.1, 0.0], [f64::NAN, 0.0]] {
        assert!(Recogniser::new(&model, &prior, Timing { starts: timing, duration: None }).is_err());
    }
    assert!(Recogniser::new(&model, &prior, Timing { duration: Some(0.0), ..Timing::default() }).is_err());
}

/// Positions with every number changed.
fn changed(demos: &[Demonstration], change: impl Fn(f64) -> f64) -> Vec<Demonstration> {
    let of = |demo: &Demonstration| Demonstration::new(demo.position().mapv(&change), demo.sampling().clone()).unwrap();
    demos.iter().map(of).collect()
}

/// Demonstrations in another order, unit or with another clock are refused, with the index of the first, its quantity and
/// both numbers; those of the fit are accepted as single precision, with four digits, and without a clock.
#[test]
fn a_prior_is_learnt_from_the_demonstrations_of_the_fit() {
    // Noise differs from movement to movement, so that starts and goals do; without it, reaches have one start and one goal.
    let mut random = Random(5);
    let noisy = changed(&recordings(), |y| y).into_iter().map(|demo| {
        let position = demo.position().mapv(|y| y + 0.002 * random.between(-1.0, 1.0));
        Demonstration::new(position, demo.sampling().clone()).unwrap()
    });
    let (noisy, exact) = (noisy.collect::<Vec<_>>(), changed(&recordings(), |y| y));
    let rhythmic: Vec<_> = (0..6).map(|k| cycle(0.06 * f64::from(k), 1.0 + 0.02 * f64::from(k), 120)).collect();
    let unclocked = |demos: &[Demonstration]| -> Vec<_> {
        demos.iter().map(|demo| Demonstration::new(demo.position().to_owned(), Sampling::Unknown).unwrap()).collect()
    };
    for (demos, kind) in [(noisy, Kind::Discrete), (exact, Kind::Discrete), (rhythmic, Kind::Rhythmic)] {
        let model = learn(&demos, &options(kind));
        let error = |demos: &[Demonstration]| learn_prior(&model, demos, None, Threads::ONE).unwrap_err();
        let mut reversed = demos.clone();
        reversed.reverse();
        let mut twice = demos.clone();
        twice[3] = demos[0].clone();
        let slower = demos.iter().map(|demo| {
            let Sampling::Uniform { dt } = demo.sampling() else { unreachable!() };
            Demonstration::new(demo.position().to_owned(), Sampling::Uniform { dt: 1.02 * dt }).unwrap()
        });
        let mut swapped = unclocked(&demos);
        swapped.swap(1, 4);
        for (given, first) in [
            (reversed, None),
            (twice, Some(3)),
            (slower.collect(), Some(0)),
            (swapped, None),
            (changed(&demos, |y| -2.0 * y), Some(0)),
            (changed(&demos, f64::to_degrees), Some(0)),
            (changed(&demos, |y| y + 0.01), Some(0)),
        ] {
            let Error::Demo { demo, source } = error(&given) else { panic!("{}", error(&given)) };
            assert!(first.is_none_or(|first| demo == first), "{demo}: {source}");
            let Error::Mismatch(ref mismatch) = *source else { panic!("{source}") };
            assert!(["duration", "start", "goal", "anchor", "style"].contains(&mismatch.name), "{source}");
            let [found, expected] = [&mismatch.found, &mismatch.expected].map(|x| x.parse::<f64>().unwrap());
            assert!((found - expected).abs() > 1e-3 * expected.abs(), "{source}");
        }
        let named = demos[0].clone().with_units(vec!["deg".to_string(); model.n_dofs()]).unwrap();
        let renamed: Vec<_> = std::iter::once(named).chain(demos[1..].iter().cloned()).collect();
        assert!(error(&renamed).to_string().contains("units[0] = \"deg\", but the model has"), "{}", error(&renamed));

        let prior = learn_prior(&model, &demos, None, Threads::ONE).unwrap();
        let digits = |y: f64| (1e4 * y).round() / 1e4;
        for same in [changed(&demos, |y| f64::from(y as f32)), changed(&demos, digits), unclocked(&demos)] {
            let again = learn_prior(&model, &same, None, Threads::ONE).unwrap();
            assert_eq!(again.parameters(), prior.parameters());
        }
        let loaded = Model::from_bytes(&model.to_bytes().unwrap()).unwrap();
        assert_eq!(learn_prior(&loaded, &demos, None, Threads::ONE).unwrap(), prior);
    }
}

/// The prior of a model of the same kind, styles and degrees of freedom is refused, also in a given context; those of the model
/// as it was saved, and of a fit of the same demonstrations in blocks, are accepted.
#[test]
fn a_prior_of_another_model_is_refused() {
    let demos = recordings();
    let (model, prior) = learnt(&demos, Kind::Discrete);
    let mirrored: Vec<_> = changed(&demos, |y| -2.0 * y)
        .into_iter()
        .zip(&demos)
        .map(|(mirrored, demo)| mirrored.with_context(demo.context().unwrap().to_vec()).unwrap())
        .collect();
    let fewer = learn(&demos[..11], &options(Kind::Discrete).n_styles(Truncation::Rank(model.n_styles())));
    let mirrored = learn(&mirrored, &options(Kind::Discrete).n_styles(Truncation::Rank(model.n_styles())));
    let given = prior.given(&model, &[0.3]).unwrap();
    for other in [&fewer, &mirrored] {
        for prior in [&prior, &given] {
            let errors = [
                Recogniser::new(other, prior, Timing::default()).unwrap_err(),
                prior.to_bytes(other).unwrap_err(),
                prior.given(other, &[0.3]).unwrap_err(),
            ];
            assert!(errors.iter().all(|error| error.to_string().contains("prior is of another model")), "{errors:?}");
        }
    }
    let bytes = prior.to_bytes(&model).unwrap();
    let (loaded, read) = (Model::from_bytes(&bytes).unwrap(), Prior::from_bytes(&bytes).unwrap());
    let mut blocks = || -> Blocks<'_> { Box::new(demos.chunks(5).map(|block| Ok(block.to_vec()))) };
    let streamed = fit_blocks(&mut blocks, &options(Kind::Discrete), &mut |_, _| Ok(())).unwrap();
    assert!(learn_prior(&streamed, &demos, None, Threads::ONE).is_ok());
    for model in [&model, &loaded, &streamed] {
        for prior in [&prior, &read, &given] {
            Recogniser::new(model, prior, Timing::default()).unwrap();
        }
    }
}

/// In a given context, a movement is known before it begins, and its prior is another one than without.
#[test]
fn a_context_says_where_a_movement_goes() {
    // The context is the height.
    let (model, prior) = learnt(&recordings(), Kind::Discrete);
    let new = reach(0.33, 1.1, 0.01);
    let error = |prior: &Prior| {
        let mut recogniser =
            Recogniser::new(&model, prior, Timing { duration: Some(1.1), ..Timing::default() }).unwrap();
        for k in 0..3 {
            recogniser.update(0.01 * f64::from(k), &new.position().row(k as usize).to_vec()).unwrap();
        }
        let time: Vec<f64> = (3..new.n_samples()).map(|k| 0.01 * k as f64).collect();
        let rest = recogniser.continuation(&time).unwrap().position;
        (&rest - &new.position().slice(ndarray::s![3.., ..])).iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    let (given, other) = (prior.given(&model, &[0.33]).unwrap(), prior.given(&model, &[0.05]).unwrap());
    assert!(error(&given) < 0.3 * error(&prior), "{} {}", error(&given), error(&prior));
    assert!(error(&given) < 0.1 * error(&other), "{} {}", error(&given), error(&other));
    // Kernels are about the prediction plus the deviations.
    let (prediction, deviations) = (model.predict(&[0.33]).unwrap(), prior.deviations().unwrap());
    let style = prediction.conditions.style.unwrap();
    for (own, deviation) in given.parameters().rows().into_iter().zip(deviations.parameters.rows()) {
        assert!(style.iter().enumerate().all(|(j, s)| (own[j] - s - deviation[j]).abs() < 1e-12));
    }
    let restored = Prior::from_bytes(&prior.to_bytes(&model).unwrap()).unwrap();
    assert_eq!(restored.given(&model, &[0.33]).unwrap(), given);
    assert!(given.given(&model, &[0.33]).unwrap_err().to_string().contains("no contexts"));
    assert!(prior.given(&model, &[0.33, 0.1]).is_err(), "two numbers");
    let bare = |demo: Demonstration| Demonstration::new(demo.position().to_owned(), demo.sampling().clone()).unwrap();
    let (bare, without) = learnt(&recordings().into_iter().map(bare).collect::<Vec<_>>(), Kind::Discrete);
    assert!(without.deviations().is_none() && without.given(&bare, &[0.33]).is_err(), "a model without contexts");
}

/// Labels of which each has one movement say nothing of a new one, so that the prior has none for them; of two movements
/// each they do.
#[test]
fn labels_need_two_movements_each() {
    let labelled = |n: usize| -> Vec<Demonstration> {
        let of = |(k, demo): (usize, Demonstration)| demo.with_context(vec![format!("{}", k % n).as_str()]).unwrap();
        recordings().into_iter().enumerate().map(of).collect()
    };
    let (_, alone) = learnt(&labelled(12), Kind::Discrete);
    assert!(alone.deviations().is_none());
    let (model, several) = learnt(&labelled(3), Kind::Discrete);
    assert!(several.given(&model, &["1"]).is_ok());
    assert!(several.given(&model, &["7"]).unwrap_err().to_string().contains("labels are"), "a label that is not shown");
}
