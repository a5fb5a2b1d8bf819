//! Model files restore the saved model, and other files are rejected.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/random.rs"]
mod random;

use std::sync::{Arc, LazyLock};

use common::*;
use ndarray::Array2;
use pdmp_core::inference::{Prior, Recogniser, Timing};
use pdmp_core::learning::learn_prior;
use pdmp_core::motion::TimeGrid;
use pdmp_core::numerics::Threads;
use pdmp_core::rollout;
use pdmp_core::{Conditions, Demonstration, Error, FitOptions, Kind, Model, Sampling};
use proptest::prelude::*;
use random::Random;

static BYTES: LazyLock<Vec<u8>> = LazyLock::new(|| learn(&reaches(), &options(Kind::Discrete)).to_bytes().unwrap());
static WITH_PRIOR: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let (model, prior) = with_prior(&reaches(), Kind::Discrete);
    prior.to_bytes(&model).unwrap()
});

fn with_prior(demos: &[Demonstration], kind: Kind) -> (Arc<Model>, Prior) {
    let model = learn(demos, &options(kind));
    let prior = learn_prior(&model, demos, None, Threads::ONE).unwrap();
    (model, prior)
}

/// A loaded model is bitwise the saved one, for both kinds, with and without contexts.
#[test]
fn a_loaded_model_moves_like_the_saved_one() {
    let folder = tempfile::tempdir().unwrap();
    for (kind, demos) in [(Kind::Discrete, reaches()), (Kind::Rhythmic, cycles())] {
        let model = learn(&demos, &options(kind));
        let path = folder.path().join("model.safetensors");
        model.save(&path).unwrap();
        let loaded = Arc::new(Model::load(&path).unwrap());
        let grid = TimeGrid { dt: 0.003, duration: Some(2.0) };
        let conditions = match model.predict(&[0.2]) {
            Ok(prediction) => {
                assert_eq!(prediction, loaded.predict(&[0.2]).unwrap());
                prediction.conditions
            }
            Err(_) => Conditions::default(),
        };
        assert_eq!(
            rollout(model.primitive(), &conditions, grid).unwrap(),
            rollout(loaded.primitive(), &conditions, grid).unwrap()
        );
        assert_eq!(model.demonstrated(), loaded.demonstrated());
        assert_eq!(model.learnt(), loaded.learnt());
        assert_eq!(model.to_bytes().unwrap(), loaded.to_bytes().unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    }
}

/// The cut-offs of noisy recordings and their ends at rest are kept.
#[test]
fn a_file_keeps_the_treatment_of_noise() {
    let (mut random, steps) = (Random(4), 120);
    let mut recording = |size: f64| {
        let position = Array2::from_shape_fn((steps + 1, 1), |(c, _)| {
            let noise = (0..12).map(|_| random.next() - 0.5).sum::<f64>();
            size * (std::f64::consts::FRAC_PI_2 * c as f64 / steps as f64).sin() + 0.01 * noise
        });
        Demonstration::new(position, Sampling::Uniform { dt: 0.01 }).unwrap()
    };
    let demos: Vec<_> = [0.8, 0.9, 1.0, 1.1, 1.2].map(&mut recording).into();
    let model = learn(&demos, &FitOptions::new(Kind::Discrete));
    assert_eq!(model.learnt().noise.ends(), [[false, true]]);
    let loaded = Model::from_bytes(&model.to_bytes().unwrap()).unwrap();
    assert_eq!(model.learnt(), loaded.learnt());
}

/// A prior is kept in the file of its model, bit for bit, and both are read from it.
#[test]
fn a_file_keeps_the_prior_with_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    for (kind, demos) in [(Kind::Discrete, reaches()), (Kind::Rhythmic, cycles())] {
        let (model, prior) = with_prior(&demos, kind);
        prior.save(&model, &path).unwrap();
        let (same, loaded) = (Model::load(&path).unwrap(), Prior::load(&path).unwrap());
        assert_eq!(loaded, prior);
        assert_eq!(loaded.to_bytes(&same).unwrap(), std::fs::read(&path).unwrap());
        assert_eq!(same.to_bytes().unwrap(), model.to_bytes().unwrap());
        let estimates = [(&*model, &prior), (&same, &loaded)].map(|(model, prior)| {
            let mut recogniser = Recogniser::new(model, prior, Timing::default()).unwrap();
            for (k, position) in demos[2].position().rows().into_iter().enumerate().take(40) {
                recogniser.update(0.01 * k as f64, &position.to_vec()).unwrap();
            }
            recogniser.estimate().unwrap().clone()
        });
        assert_eq!(estimates[0], estimates[1]);
        // The model alone replaces both.
        model.save(&path).unwrap();
        let message = Prior::load(&path).unwrap_err().to_string();
        assert!(message.contains("model.safetensors") && message.contains("no prior"), "{message}");
    }
    let (other, (_, prior)) = (learn(&cycles(), &options(Kind::Rhythmic)), with_prior(&reaches(), Kind::Discrete));
    assert_eq!(prior.to_bytes(&other).unwrap_err().argument(), Some("prior"));
    assert!(matches!(Prior::load(std::path::Path::new("/nowhere/model.safetensors")), Err(Error::Io { .. })));
}

proptest! {
    /// A flipped bit of a file with a prior is detected at any place, by both readers.
    #[test]
    fn a_flipped_bit_of_a_file_with_a_prior_is_rejected(place in any::<prop::sample::Index>(), bit in 0..8u8) {
        let mut bytes = WITH_PRIOR.clone();
        let place = place.index(bytes.len());
        bytes[place] ^= 1 << bit;
        prop_assert!(matches!(Model::from_bytes(&bytes), Err(Error::File(_))), "byte {place}, bit {bit}");
        prop_assert!(matches!(Prior::from_bytes(&bytes), Err(Error::File(_))), "byte {place}, bit {bit}");
    }

    /// A flipped bit in the header of a file with a prior is detected, too.
    #[test]
    fn a_flipped_bit_in_the_header_with_a_prior_is_rejected(place in 0..2500usize, bit in 0..8u8) {
        let mut bytes = WITH_PRIOR.clone();
        bytes[place] ^= 1 << bit;
        prop_assert!(matches!(Model::from_bytes(&bytes), Err(Error::File(_))), "byte {place}, bit {bit}");
        prop_assert!(matches!(Prior::from_bytes(&bytes), Err(Error::File(_))), "byte {place}, bit {bit}");
    }

    /// A file with a prior that is truncated at any place is rejected, and random bytes are.
    #[test]
    fn a_truncated_file_with_a_prior_is_rejected(
        place in any::<prop::sample::Index>(),
        bytes in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let place = place.index(WITH_PRIOR.len());
        prop_assert!(matches!(Prior::from_bytes(&WITH_PRIOR[..place]), Err(Error::File(_))));
        prop_assert!(matches!(Prior::from_bytes(&bytes), Err(Error::File(_))));
    }

    /// A flipped bit is detected at any place.
    #[test]
    fn a_flipped_bit_is_rejected(place in any::<prop::sample::Index>(), bit in 0..8u8) {
        let mut bytes = BYTES.clone();
        let place = place.index(bytes.len());
        bytes[place] ^= 1 << bit;
        prop_assert!(matches!(Model::from_bytes(&bytes), Err(Error::File(_))), "byte {place}, bit {bit}");
    }

    /// A flipped bit is detected in the header, too.
    #[test]
    fn a_flipped_bit_in_the_header_is_rejected(place in 0..2000usize, bit in 0..8u8) {
        let mut bytes = BYTES.clone();
        bytes[place] ^= 1 << bit;
        prop_assert!(matches!(Model::from_bytes(&bytes), Err(Error::File(_))), "byte {place}, bit {bit}");
    }

    /// A file that is truncated at any place is rejected.
    #[test]
    fn a_truncated_file_is_rejected(place in any::<prop::sample::Index>()) {
        let place = place.index(BYTES.len());
        prop_assert!(matches!(Model::from_bytes(&BYTES[..place]), Err(Error::File(_))));
    }

    /// Random bytes are rejected.
    #[test]
    fn random_bytes_are_rejected(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(matches!(Model::from_bytes(&bytes), Err(Error::File(_))));
    }
}

/// A header that announces more bytes than a model can have is rejected before it is read.
#[test]
fn an_oversized_header_is_rejected() {
    for size in [u64::MAX, 1 << 40, (1 << 26) + 1] {
        let mut bytes = BYTES.clone();
        bytes[..8].copy_from_slice(&size.to_le_bytes());
        let error = Model::from_bytes(&bytes).unwrap_err().to_string();
        assert!(error.contains("announces a header larger"), "{error}");
    }
}

/// Another version is rejected with its number.
#[test]
fn another_version_is_rejected_with_its_number() {
    let schema = br#"schema\":"#;
    let place = BYTES.windows(schema.len()).position(|text| text == schema).unwrap();
    let mut bytes = BYTES.clone();
    bytes[place + schema.len()] = b'8';
    let message = Model::from_bytes(&bytes).unwrap_err().to_string();
    assert!(message.contains("version 8") && message.contains("reads version 6"), "{message}");
}

/// A file keeps the names of context columns; a file of a model without them does not mention any.
#[test]
fn names_of_context_columns_are_kept() {
    let named = options(Kind::Discrete).context_names(vec!["height".to_string()]);
    let model = learn(&reaches(), &named);
    let loaded = Model::from_bytes(&model.to_bytes().unwrap()).unwrap();
    assert_eq!(loaded.map().unwrap(), model.map().unwrap());
    assert_eq!(loaded.map().unwrap().names(), ["height"]);
    let plain = Model::from_bytes(&BYTES).unwrap();
    assert!(plain.map().unwrap().names().is_empty());
    assert_eq!(loaded.predict(&[0.2]).unwrap(), plain.predict(&[0.2]).unwrap());
    let named = options(Kind::Discrete).context_names(vec!["a".to_string(), "b".to_string()]);
    assert_eq!(pdmp_core::fit(&reaches(), &named).unwrap_err().argument(), Some("context_names"));
}

/// Errors of writing and reading name the path.
#[test]
fn unusable_paths_are_named() {
    let model = learn(&reaches(), &options(Kind::Discrete));
    let message = model.save(std::path::Path::new("/nowhere/model.safetensors")).unwrap_err().to_string();
    assert_eq!(message, "/nowhere: no such folder; create it first");
    assert!(matches!(Model::load(std::path::Path::new("/nowhere/model.safetensors")), Err(Error::Io { .. })));
}
