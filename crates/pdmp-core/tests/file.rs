//! The model file gives back what was saved, and nothing else.
#![allow(missing_docs)]

mod common;

use std::sync::{Arc, LazyLock};

use common::*;
use pdmp_core::motion::Timing;
use pdmp_core::rollout;
use pdmp_core::{Conditions, Error, Kind, Model};
use proptest::prelude::*;

static BYTES: LazyLock<Vec<u8>> = LazyLock::new(|| learn(&reaches(), &options(Kind::Discrete)).to_bytes().unwrap());

/// Save, load: the same trajectory to the last bit, for both kinds, with contexts and without.
#[test]
fn a_saved_model_moves_alike() {
    let folder = tempfile::tempdir().unwrap();
    for (kind, demos) in [(Kind::Discrete, reaches()), (Kind::Rhythmic, cycles())] {
        let model = learn(&demos, &options(kind));
        let path = folder.path().join("model.safetensors");
        model.save(&path).unwrap();
        let loaded = Arc::new(Model::load(&path).unwrap());
        let timing = Timing { dt: 0.003, duration: Some(2.0) };
        let conditions = match model.predict(&[0.2]) {
            Ok(prediction) => {
                assert_eq!(prediction, loaded.predict(&[0.2]).unwrap());
                prediction.conditions
            }
            Err(_) => Conditions::default(),
        };
        assert_eq!(
            rollout(model.primitive(), &conditions, timing).unwrap(),
            rollout(loaded.primitive(), &conditions, timing).unwrap()
        );
        assert_eq!(model.demonstrated(), loaded.demonstrated());
        assert_eq!(model.learnt(), loaded.learnt());
        assert_eq!(model.to_bytes().unwrap(), loaded.to_bytes().unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    }
}

proptest! {
    /// One flipped bit, anywhere, is noticed.
    #[test]
    fn a_flipped_bit_is_refused(place in any::<prop::sample::Index>(), bit in 0..8u8) {
        let mut bytes = BYTES.clone();
        let place = place.index(bytes.len());
        bytes[place] ^= 1 << bit;
        prop_assert!(matches!(Model::from_bytes(&bytes), Err(Error::File(_))), "byte {place}, bit {bit}");
    }

    /// In the header too, where every byte means something.
    #[test]
    fn a_flipped_bit_in_the_header_is_refused(place in 0..2000usize, bit in 0..8u8) {
        let mut bytes = BYTES.clone();
        bytes[place] ^= 1 << bit;
        prop_assert!(matches!(Model::from_bytes(&bytes), Err(Error::File(_))), "byte {place}, bit {bit}");
    }

    /// A truncated file is refused, wherever it was cut.
    #[test]
    fn a_truncated_file_is_refused(place in any::<prop::sample::Index>()) {
        let place = place.index(BYTES.len());
        prop_assert!(matches!(Model::from_bytes(&BYTES[..place]), Err(Error::File(_))));
    }

    /// Noise is not a model.
    #[test]
    fn noise_is_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(matches!(Model::from_bytes(&bytes), Err(Error::File(_))));
    }
}

/// A header that announces more than any model holds is refused before it is read.
#[test]
fn a_bomb_of_a_header_is_refused() {
    for size in [u64::MAX, 1 << 40, (1 << 26) + 1] {
        let mut bytes = BYTES.clone();
        bytes[..8].copy_from_slice(&size.to_le_bytes());
        let error = Model::from_bytes(&bytes).unwrap_err().to_string();
        assert!(error.contains("announces a header larger"), "{error}");
    }
}

/// Another version is refused by its number.
#[test]
fn another_version_is_refused_by_number() {
    let schema = br#"schema\":"#;
    let place = BYTES.windows(schema.len()).position(|text| text == schema).unwrap();
    let mut bytes = BYTES.clone();
    bytes[place + schema.len()] = b'7';
    let message = Model::from_bytes(&bytes).unwrap_err().to_string();
    assert!(message.contains("version 7") && message.contains("reads version 5"), "{message}");
}

/// What cannot be written or read is told with its path, and an older file survives.
#[test]
fn unusable_paths_are_named() {
    let model = learn(&reaches(), &options(Kind::Discrete));
    let message = model.save(std::path::Path::new("/nowhere/model.safetensors")).unwrap_err().to_string();
    assert!(message.contains("/nowhere/model.safetensors"), "{message}");
    assert!(matches!(Model::load(std::path::Path::new("/nowhere/model.safetensors")), Err(Error::Io { .. })));
}
