//! A fit of blocks of demonstrations is that of all of them in one slice.

#[path = "common/random.rs"]
mod random;

use ndarray::{Array2, ArrayBase, Data, Dimension};
use pdmp_core::demonstration::ContextValue;
use pdmp_core::learning::{
    BlockStyles, Blocks, DofScaling, FactorisedFit, NStyles, PartialFit, StyleProjection, Truncation, fit_blocks,
};
use pdmp_core::motion::TimeGrid;
use pdmp_core::numerics::Smoothing;
use pdmp_core::{Conditions, Demonstration, Error, FitOptions, Kind, Model, Sampling, fit, rollout};
use random::Random;

/// Number of the demonstrations.
const N_DEMOS: usize = 60;

/// Recordings of a kind with three styles, starts and goals that vary, and a little or much noise.
fn recordings(kind: Kind, noise: f64, seed: u64) -> Vec<Demonstration> {
    let mut random = Random(seed);
    let demo = |_| {
        let [a, b, c, from, to] = std::array::from_fn(|_| random.between(-1.0, 1.0));
        let n = 150 + (random.next() * 60.0) as usize;
        let dt = random.between(0.009, 0.011);
        let mut normal = || (0..12).map(|_| random.next()).sum::<f64>() - 6.0;
        let steps = if kind == Kind::Discrete { n - 1 } else { n };
        let position = Array2::from_shape_fn((n, 3), |(k, d)| {
            let s = k as f64 / steps as f64;
            let turn = std::f64::consts::TAU * s;
            let waves = a * turn.sin() + b * (2.0 * turn + d as f64).cos() + c * c * (3.0 * turn).sin() * d as f64;
            let exact = match kind {
                Kind::Discrete => from + (to - from) * s * s * (3.0 - 2.0 * s) + waves * (s * (1.0 - s)).powi(2) * 9.0,
                Kind::Rhythmic => from + waves,
            };
            exact * [1.0, 0.01, 30.0][d] + noise * normal() * [1.0, 0.01, 30.0][d]
        });
        Demonstration::new(position, Sampling::Uniform { dt }).unwrap().with_context(vec![a, b]).unwrap()
    };
    (0..N_DEMOS).map(demo).collect()
}

fn with_samples(options: &FitOptions, n_samples: usize) -> FitOptions {
    let mut options = options.clone();
    options.n_samples = Some(n_samples);
    options
}

fn streamed(demos: &[Demonstration], size: usize, options: &FitOptions) -> (Model, usize) {
    let mut passes = 0;
    let mut blocks = || -> Blocks<'_> {
        passes += 1;
        Box::new(demos.chunks(size).map(|block| Ok(block.to_vec())))
    };
    let model = fit_blocks(&mut blocks, options, &mut |_, _| Ok(())).unwrap();
    (model, passes)
}

fn difference<S: Data<Elem = f64>, T: Dimension>(a: &ArrayBase<S, T>, b: &ArrayBase<S, T>) -> f64 {
    let size = a.iter().fold(f64::MIN_POSITIVE, |most, x| most.max(x.abs()));
    a.iter().zip(b.iter()).fold(0.0, |most, (a, b)| f64::max(most, (a - b).abs())) / size
}

/// Asserts that two models are equal to rounding: settings, styles, singular values, transport, movements and predictions.
fn assert_equal(streamed: &Model, whole: &Model, what: &str) {
    let (a, b) = (streamed.demonstrated(), whole.demonstrated());
    assert_eq!(streamed.n_styles(), whole.n_styles(), "{what}");
    assert_eq!((a.nominal, &a.durations, &a.goals), (b.nominal, &b.durations, &b.goals), "{what}");
    assert_eq!((&a.starts, &a.anchors, &a.contexts), (&b.starts, &b.anchors, &b.contexts), "{what}");
    assert_eq!(streamed.learnt().n_samples, whole.learnt().n_samples, "{what}");
    assert_eq!(streamed.learnt().noise, whole.learnt().noise, "{what}");
    assert_eq!(streamed.learnt().dof_scale, whole.learnt().dof_scale, "{what}");
    assert_eq!(streamed.learnt().findings, whole.learnt().findings, "{what}");
    assert_eq!(streamed.ranges(), whole.ranges(), "{what}");
    // The error of a singular vector is the residual, at most 1e-11·σ₁, over the gap to the next singular value.
    let sigma = &streamed.learnt().singular_values;
    for (j, (own, other)) in a.styles.columns().into_iter().zip(b.styles.columns()).enumerate() {
        let gap = |k: usize| sigma.get(k).zip(sigma.get(k + 1)).map_or(sigma[j], |(this, next)| this - next);
        let gap = if j > 0 { gap(j).min(gap(j - 1)) } else { gap(j) };
        let (error, bound) = (difference(&own, &other), 1e-10 + 1e-10 * sigma[0] / gap);
        assert!(error < bound, "{what}: style {j} {error:e} {bound:e}");
    }
    let [own, other] = [streamed, whole].map(|model| &model.learnt().singular_values[..model.n_styles()]);
    let [own, other] = [own, other].map(|values| ndarray::Array1::from(values.to_vec()));
    assert!(difference(&own, &other) < 1e-10, "{what}");
    // `Factors::error` is an upper bound, up to 1e-6·‖F‖ above the error.
    assert!((streamed.learnt().truncation_error - whole.learnt().truncation_error).abs() < 1e-6, "{what}");
    let grid = TimeGrid { dt: 0.01, duration: None };
    for m in [0, 17, N_DEMOS - 1] {
        let [own, other] =
            [streamed, whole].map(|model| rollout(model.primitive(), &model.conditions(&[m]).unwrap(), grid).unwrap());
        // The search for the hyperparameters of the landscape ends elsewhere by rounding, which changes the movement between
        // samples.
        for (own, other, tolerance) in [
            (&own.position, &other.position, 1e-9),
            (&own.velocity, &other.velocity, 1e-6),
            (&own.acceleration, &other.acceleration, 1e-4),
        ] {
            assert!(difference(own, other) < tolerance, "{what}: {:e} {tolerance:e}", difference(own, other));
        }
    }
    match (&streamed.learnt().residual_variance, &whole.learnt().residual_variance) {
        (Some(own), Some(other)) => {
            for ((_, d), change) in (own - other).indexed_iter() {
                assert!(change.abs() < 1e-9 * whole.ranges()[d].powi(2), "{what}: {change:e}");
            }
            let [own, other] = [streamed, whole].map(|model| model.predict(&[0.3, -0.2]).unwrap());
            let position = |conditions: &Conditions| {
                rollout(whole.primitive(), conditions, TimeGrid { dt: 0.01, duration: Some(1.5) }).unwrap().position
            };
            assert!(difference(&position(&own.conditions), &position(&other.conditions)) < 1e-9, "{what}");
        }
        (own, other) => assert!(own.is_none() && other.is_none(), "{what}"),
    }
}

/// The model is that of all demonstrations in one slice, for both kinds, with and without noise, contexts and units, for every
/// rule for the number of styles and every size of the blocks.
#[test]
fn blocks_give_the_model_of_all_demonstrations() {
    let labelled = |demos: Vec<Demonstration>| -> Vec<Demonstration> {
        let context =
            |m: usize| -> Vec<ContextValue> { vec![(m as f64).sin().into(), ["cup", "jug", "pan"][m % 3].into()] };
        demos.into_iter().enumerate().map(|(m, demo)| demo.with_context(context(m)).unwrap()).collect()
    };
    let with_units = |demos: Vec<Demonstration>| -> Vec<Demonstration> {
        let units = || ["m", "m", "N"].map(String::from).to_vec();
        demos.into_iter().map(|demo| demo.with_units(units()).unwrap()).collect()
    };
    let (discrete, rhythmic) = (FitOptions::discrete(), FitOptions::rhythmic());
    let cases: [(&str, Vec<Demonstration>, FitOptions, usize); 9] = [
        ("plain", recordings(Kind::Discrete, 0.0, 1), discrete.clone(), 3),
        ("given", recordings(Kind::Discrete, 0.0, 2), with_samples(&discrete, 160), 2),
        ("noise", recordings(Kind::Discrete, 0.02, 3), discrete.clone(), 3),
        ("units", with_units(recordings(Kind::Discrete, 0.02, 4)), discrete.clone(), 4),
        ("range", recordings(Kind::Discrete, 0.0, 5), discrete.clone().dof_scale(DofScaling::Range), 4),
        ("rank", recordings(Kind::Discrete, 0.0, 6), discrete.clone().n_styles(Truncation::Rank(2)), 3),
        ("share", recordings(Kind::Rhythmic, 0.02, 7), rhythmic.clone().n_styles(Truncation::Share(0.9)), 3),
        ("cut-off", recordings(Kind::Rhythmic, 0.02, 8), rhythmic.smoothing(Smoothing::CutOff { hz: 6.0 }), 3),
        (
            "tau",
            recordings(Kind::Discrete, 0.0, 9),
            {
                let transport = pdmp_core::learning::TransportSelection::Immediate;
                let canonical =
                    pdmp_core::learning::CanonicalOptions::Discrete { tau: Some(0.7), alpha_x: None, transport };
                FitOptions::new(canonical)
            },
            3,
        ),
    ];
    for (what, demos, options, most) in cases {
        let whole = fit(&demos, &options).unwrap();
        for size in [7, N_DEMOS] {
            let (model, passes) = streamed(&demos, size, &options);
            assert_equal(&model, &whole, what);
            assert!(passes <= most, "{what}: {passes}");
        }
    }
    let demos = labelled(recordings(Kind::Discrete, 0.02, 10));
    let (model, whole) = (streamed(&demos, 7, &discrete).0, fit(&demos, &discrete).unwrap());
    assert_eq!(model.n_styles(), whole.n_styles());
    assert!(difference(&model.demonstrated().styles, &whole.demonstrated().styles) < 1e-10);
    assert_eq!(model.map().unwrap().columns(), whole.map().unwrap().columns());
}

/// Styles beyond the dimensions in which the demonstrations vary are zero in all of them.
#[test]
fn styles_may_exceed_the_dimensions_of_the_demonstrations() {
    let demos = |scales: &[f64]| -> Vec<Demonstration> {
        let s = Array2::from_shape_fn((101, 2), |(k, d)| (k as f64 / 100.0).powi(2 + d as i32));
        let demo = |scale: &f64| Demonstration::new(&s * *scale, Sampling::Uniform { dt: 0.01 }).unwrap();
        scales.iter().map(demo).collect()
    };
    let options = FitOptions::discrete().n_styles(Truncation::Rank(4));
    for scales in [[1.0, 2.0, 3.0, 1.5, 2.5], [1.0; 5]] {
        let demos = demos(&scales);
        let (model, whole) = (streamed(&demos, 2, &options).0, fit(&demos, &options).unwrap());
        assert_eq!(model.n_styles(), 4);
        let values = &model.learnt().singular_values;
        assert!(difference(&ndarray::arr1(&values[..1]), &ndarray::arr1(&whole.learnt().singular_values[..1])) < 1e-10);
        assert!(values[1..].iter().all(|value| *value <= 1e-12 * values[0]));
        let grid = TimeGrid { dt: 0.01, duration: None };
        for m in 0..5 {
            let [own, other] = [&model, &whole]
                .map(|model| rollout(model.primitive(), &model.conditions(&[m]).unwrap(), grid).unwrap().position);
            assert!(difference(&own, &other) < 1e-9);
        }
    }
}

/// The order in which partial fits are merged does not matter, but for rounding; labels may appear in any order.
#[test]
fn merging_is_associative() {
    let mut demos = recordings(Kind::Discrete, 0.0, 11);
    let labels = ["a", "b", "c", "d"];
    for (m, demo) in demos.iter_mut().enumerate() {
        *demo = demo.clone().with_context(vec![labels[(m * m + m / 7) % 4]]).unwrap();
    }
    let options = FitOptions::discrete();
    let empty = PartialFit::new(&demos[..20], &options).unwrap();
    let part = |range: std::ops::Range<usize>| {
        let mut partial = empty.empty();
        partial.update(&demos[range]).unwrap();
        partial
    };
    let finished = |factorised: FactorisedFit| {
        let styles: Vec<_> =
            [(40, 60), (0, 15), (15, 40)].map(|(from, to)| factorised.styles(&demos[from..to], from).unwrap()).to_vec();
        factorised.finish(styles, &mut |_, _| Ok(())).unwrap()
    };
    let merged = |mut left: PartialFit, right: PartialFit| {
        left.merge(&right).unwrap();
        left
    };
    let parts = || (part(0..11), part(11..37), part(37..60));
    let ((a, b, c), (d, e, f)) = (parts(), parts());
    let orders = [merged(merged(a, b), c), merged(d, merged(e, f)), part(0..60)];
    let models = orders.map(|partial| {
        assert_eq!(partial.n_demos(), N_DEMOS);
        finished(partial.factorise(&options, &mut |_, _| Ok(())).unwrap())
    });
    let whole = fit(&demos, &with_samples(&options, empty.n_samples())).unwrap();
    for model in models {
        assert_eq!(model.n_styles(), whole.n_styles());
        assert!(difference(&model.demonstrated().styles, &whole.demonstrated().styles) < 1e-10);
    }
}

/// Partial fits, projections and styles survive their bytes; damaged bytes are refused.
#[test]
fn bytes_keep_every_part() {
    let demos = recordings(Kind::Discrete, 0.0, 13);
    let options = FitOptions::discrete();
    let mut partial = PartialFit::new(&demos[..20], &options).unwrap();
    partial.update(&demos[..20]).unwrap();
    let mut copy = PartialFit::from_bytes(&partial.to_bytes().unwrap()).unwrap();
    for partial in [&mut partial, &mut copy] {
        partial.update(&demos[20..]).unwrap();
    }
    assert_eq!(partial.to_bytes().unwrap(), copy.to_bytes().unwrap());
    let factorised = copy.factorise(&options, &mut |_, _| Ok(())).unwrap();
    let projection = StyleProjection::from_bytes(&factorised.projection().to_bytes().unwrap()).unwrap();
    let styles = [(0, 25), (25, N_DEMOS)].map(|(from, to)| {
        let styles = projection.styles(&demos[from..to], from, &mut |_| Ok(())).unwrap();
        BlockStyles::from_bytes(&styles.to_bytes().unwrap()).unwrap()
    });
    let model = factorised.finish(styles.to_vec(), &mut |_, _| Ok(())).unwrap();
    let whole = fit(&demos, &with_samples(&options, partial.n_samples())).unwrap();
    assert_equal(&model, &whole, "bytes");
    let bytes = partial.to_bytes().unwrap();
    assert!(StyleProjection::from_bytes(&bytes).is_err() && Model::from_bytes(&bytes).is_err());
    let mut random = Random(14);
    for _ in 0..200 {
        let mut damaged = bytes.clone();
        let at = (random.next() * damaged.len() as f64) as usize;
        damaged[at] ^= 1 << (random.next() * 8.0) as u32;
        assert!(PartialFit::from_bytes(&damaged).is_err(), "{at}");
        assert!(PartialFit::from_bytes(&bytes[..at]).is_err(), "{at}");
    }
}

/// Wrong-looking samples and magnitudes are reported as by a fit of all demonstrations, with indices among all.
#[test]
fn findings_are_those_of_all_demonstrations() {
    let mut demos = recordings(Kind::Discrete, 0.0, 17);
    let mut change = |m: usize, time: f64, change: &dyn Fn(usize, f64) -> f64| {
        let Sampling::Uniform { dt } = *demos[m].sampling() else { unreachable!() };
        let position =
            Array2::from_shape_fn(demos[m].position().dim(), |(c, d)| change(c, demos[m].position()[[c, d]]));
        let changed = Demonstration::new(position, Sampling::Uniform { dt: dt * time }).unwrap();
        let context = demos[m].context().unwrap().to_vec();
        demos[m] = changed.with_context(context).unwrap();
    };
    change(23, 1.0, &|c, y| if c == 60 { y + 30.0 } else { y });
    change(41, 1.0, &|_, y| y * 57.3);
    change(55, 1000.0, &|_, y| y);
    let options = FitOptions::discrete().smoothing(Smoothing::Interpolate);
    let whole = fit(&demos, &options).unwrap().learnt().findings.clone();
    let text: Vec<String> = whole.iter().map(ToString::to_string).collect();
    assert_eq!(
        text.iter().map(|text| text.split(':').next().unwrap()).collect::<Vec<_>>(),
        ["demo 23", "demo 41", "demo 55"]
    );
    for size in [7, N_DEMOS] {
        assert_eq!(streamed(&demos, size, &options).0.learnt().findings, whole);
    }
}

/// Options and demonstrations that blocks do not allow are refused with the argument, and leave a partial fit as it is.
#[test]
fn unsuitable_arguments_are_named() {
    let demos = recordings(Kind::Discrete, 0.0, 12);
    let options = FitOptions::discrete();
    let named = |error: Error| match error {
        Error::Argument { name, .. } | Error::Range { name, .. } => name,
        Error::Demo { demo, source } => {
            assert_eq!(demo, 21);
            if matches!(*source, Error::Dofs { .. }) { "position" } else { "context" }
        }
        other => panic!("{other}"),
    };
    let landmarks = pdmp_core::learning::TimeScaling::Landmarks(Array2::zeros((N_DEMOS, 1)));
    let scaled = options.clone().time_scaling(landmarks);
    assert_eq!(named(PartialFit::new(&demos, &scaled).unwrap_err()), "alignment");
    let contexts = options.clone().contexts(vec![vec![1.0.into()]; N_DEMOS]);
    assert_eq!(named(PartialFit::new(&demos, &contexts).unwrap_err()), "contexts");
    let mut partial = PartialFit::new(&demos, &options).unwrap();
    partial.update(&demos[..20]).unwrap();
    let narrow = Demonstration::new(Array2::zeros((20, 2)), Sampling::Uniform { dt: 0.01 }).unwrap();
    let plain = Demonstration::new(Array2::zeros((20, 3)), Sampling::Uniform { dt: 0.01 }).unwrap();
    assert_eq!(named(partial.update(&[demos[20].clone(), narrow]).unwrap_err()), "position");
    assert_eq!(named(partial.update(&[demos[20].clone(), plain]).unwrap_err()), "context");
    assert_eq!(partial.n_demos(), 20);
    let other = PartialFit::new(&demos, &with_samples(&options, 100)).unwrap();
    assert_eq!(named(partial.merge(&other).unwrap_err()), "other");
    let validated = options.clone().n_styles(NStyles::CrossValidated);
    assert_eq!(named(partial.factorise(&validated, &mut |_, _| Ok(())).err().unwrap()), "n_styles");
    let factorised = partial.factorise(&options, &mut |_, _| Ok(())).unwrap();
    let others = factorised.styles(&demos[1..21], 0).unwrap();
    assert_eq!(named(factorised.finish(vec![others], &mut |_, _| Ok(())).unwrap_err()), "blocks");
}
