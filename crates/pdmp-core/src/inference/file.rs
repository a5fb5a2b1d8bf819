//! Priors in model files.

use std::path::Path;

use ndarray::Array2;

use super::calibration::{BandFactors, Calibration, SHARES};
use super::prior::{Mixture, Prior, Settings, frame_size};
use crate::error::Result;
use crate::model::Model;
use crate::model::file::section::Section;
use crate::model::file::{ensure, read_file, unreadable, write_atomically};

/// Version of the format of a prior.
const SCHEMA: u32 = 1;
/// Prefix of the names of deviations.
const DEVIATIONS: &str = "deviations.";

impl Prior {
    /// Writes a model file with this prior, atomically, as [`Model::save`] does. [`Model::load`] reads the model from it.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, Model, fit};
    /// # use pdmp_core::inference::{Prior, Recogniser, Timing};
    /// # use pdmp_core::learning::learn_prior;
    /// # use pdmp_core::numerics::Threads;
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let demos = [demos.clone(), demos].concat();
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("reach.safetensors");
    /// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let prior = learn_prior(&model, &demos, None, Threads::ONE)?;
    /// prior.save(&model, &path)?;
    ///
    /// let (model, loaded) = (Model::load(&path)?, Prior::load(&path)?);
    /// assert_eq!(loaded, prior);
    /// assert_eq!(Prior::from_bytes(&prior.to_bytes(&model)?)?, prior);
    /// let recogniser = Recogniser::new(&model, &loaded, Timing::default())?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A prior of another model, or a path that cannot be written, or whose folder does not exist.
    pub fn save(&self, model: &Model, path: &Path) -> Result<()> {
        write_atomically(path, &self.to_bytes(model)?)
    }

    /// Reads the prior of a model file.
    ///
    /// # Errors
    /// A path that cannot be read, or a file that is damaged, not a model, without a prior, or of another version.
    pub fn load(path: &Path) -> Result<Self> {
        read_file(path, Self::from_bytes)
    }

    /// Returns the bytes of a model file with this prior.
    ///
    /// # Errors
    /// A prior of another model, or a model that exceeds the limits of the format.
    pub fn to_bytes(&self, model: &Model) -> Result<Vec<u8>> {
        self.check_model(model)?;
        model.to_bytes_with(Some(&self.section()))
    }

    fn section(&self) -> Section {
        let section = Section::new(SCHEMA).with_array("residual", &[self.residual().len()], self.residual().to_vec());
        let section = self.mixture().write(section, "");
        self.deviations().into_iter().fold(section, |section, deviations| deviations.write(section, DEVIATIONS))
    }

    /// Reads the prior from the bytes of a model file.
    ///
    /// # Errors
    /// Bytes that are damaged, not a model, without a prior, or of another version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let (model, section) = Model::from_bytes_with_prior(bytes)?;
        let mut section = section.ok_or_else(|| unreadable("it has no prior: save the model with one"))?;
        let found = section.version;
        ensure(found == SCHEMA, &format!("a prior of version {found}, while this library reads version {SCHEMA}"))?;
        let n_parameters = model.n_styles() + frame_size(model.kind()) * model.n_dofs();
        let residual = section.take_array("residual", &[model.n_dofs()])?;
        let mixture = Mixture::take(&mut section, "", n_parameters)?;
        let has_deviations = section.shape_of(&format!("{DEVIATIONS}parameters")).is_ok();
        let deviations = has_deviations.then(|| Mixture::take(&mut section, DEVIATIONS, n_parameters)).transpose()?;
        section.close()?;
        let prior = Self::new(model.kind(), mixture, residual).map_err(unreadable)?.of_model(&model);
        deviations.map_or(Ok(prior.clone()), |deviations| prior.with_deviations(deviations)).map_err(unreadable)
    }
}

impl Mixture {
    /// Adds the arrays of a mixture, with names that begin with a prefix.
    fn write(&self, section: Section, prefix: &str) -> Section {
        let Self { parameters, log_durations, settings, calibration } = self;
        let &Settings { bandwidth, tempering, correlation_time } = settings;
        let factors = calibration.0.into_iter().flat_map(<[f64; 4]>::from).collect();
        let name = |name: &str| format!("{prefix}{name}");
        section
            .with_array(&name("parameters"), parameters.shape(), parameters.iter().copied().collect())
            .with_array(&name("log_durations"), &[log_durations.len()], log_durations.clone())
            .with_array(&name("settings"), &[3], vec![bandwidth, tempering, correlation_time])
            .with_array(&name("calibration"), &[SHARES.len(), 4], factors)
    }

    /// Takes the arrays of a mixture out.
    ///
    /// # Errors
    /// An array that is missing or of another shape.
    fn take(section: &mut Section, prefix: &str, n_parameters: usize) -> Result<Self> {
        let n_demos = section.shape_of(&format!("{prefix}log_durations"))?.first().copied().unwrap_or_default();
        let mut take = |name: &str, shape: &[usize]| section.take_array(&format!("{prefix}{name}"), shape);
        let settings = take("settings", &[3])?;
        let factors = take("calibration", &[SHARES.len(), 4])?;
        let parameters = take("parameters", &[n_demos, n_parameters])?;
        let factors = |share: usize| BandFactors::from([0, 1, 2, 3].map(|k| factors[4 * share + k]));
        Ok(Self {
            parameters: Array2::from_shape_vec((n_demos, n_parameters), parameters).map_err(unreadable)?,
            log_durations: take("log_durations", &[n_demos])?,
            settings: Settings { bandwidth: settings[0], tempering: settings[1], correlation_time: settings[2] },
            calibration: Calibration(std::array::from_fn(factors)),
        })
    }
}

#[cfg(all(test, feature = "learning"))]
mod tests {
    use std::sync::LazyLock;

    use super::super::tests::{model, prior};
    use super::super::{Recogniser, Timing};
    use super::*;
    use crate::error::Error;
    use crate::random::Random;

    static MODEL: LazyLock<Model> = LazyLock::new(model);

    fn refusal(section: &Section) -> String {
        let bytes = MODEL.to_bytes_with(Some(section)).unwrap();
        assert!(Model::from_bytes(&bytes).is_ok(), "the model of a file with a prior that is not readable");
        match Prior::from_bytes(&bytes) {
            Err(Error::File(reason)) => reason,
            other => panic!("{other:?}"),
        }
    }

    /// A prior of a newer version, or with other arrays, is refused; the model of the same file is read.
    #[test]
    fn sections_of_other_forms_are_refused() {
        let prior = prior(&MODEL, 0.5).with_deviations(prior(&MODEL, 0.3).mixture().clone()).unwrap();
        let mut newer = prior.section();
        newer.version = 2;
        assert_eq!(refusal(&newer), "a prior of version 2, while this library reads version 1");
        assert!(refusal(&prior.section().with_array("other", &[1], vec![1.0])).contains("do not belong to a prior"));
        let names = ["parameters", "log_durations", "settings", "calibration"];
        let of_deviations = names[1..].iter().map(|name| format!("{DEVIATIONS}{name}"));
        for name in names.into_iter().chain(["residual"]).map(str::to_string).chain(of_deviations) {
            let name = name.as_str();
            let mut less = prior.section();
            let shape = less.shape_of(name).unwrap();
            let mut data = less.take_array(name, &shape).unwrap();
            assert_eq!(refusal(&less), format!("no array prior.{name}"));
            data.push(1.0);
            let longer = less.with_array(name, &[data.len()], data);
            assert!(refusal(&longer).contains("expected"), "{name}: {}", refusal(&longer));
        }
        let bytes = MODEL.to_bytes().unwrap();
        let error = Prior::from_bytes(&bytes).unwrap_err().to_string();
        assert!(error.contains("no prior"), "{error}");
    }

    /// Forged numbers with a valid checksum are refused, or the recogniser gives finite numbers or an error.
    #[test]
    fn forged_numbers_are_refused_or_give_finite_estimates() {
        let extremes = [0.0, -1.0, 1.0, 1e-300, 1e-100, 1e-9, 1e-3, 1e3, 1e9, 20.5, -20.5, 1e100, -1e100, 1e149, 1e150];
        let names = ["parameters", "log_durations", "residual", "settings", "calibration"];
        let whole = prior(&MODEL, 0.5).section();
        let (mut random, mut accepted, mut estimated) = (Random(8), 0, 0);
        let mut below = |n: usize| (random.next() * n as f64) as usize;
        for _ in 0..400 {
            let mut section = prior(&MODEL, 0.5).section();
            for _ in 0..=below(2) {
                let name = names[below(names.len())];
                let shape = whole.shape_of(name).unwrap();
                let mut data = section.take_array(name, &shape).unwrap();
                let (index, all) = (below(data.len()), below(4) == 0);
                let number = extremes[below(extremes.len())];
                data.iter_mut().enumerate().filter(|(k, _)| all || *k == index).for_each(|(_, x)| *x = number);
                section = section.with_array(name, &shape, data);
            }
            let bytes = MODEL.to_bytes_with(Some(&section)).unwrap();
            let Ok(prior) = Prior::from_bytes(&bytes) else { continue };
            accepted += 1;
            assert_eq!(prior.to_bytes(&MODEL).unwrap(), bytes);
            let Ok(mut recogniser) = Recogniser::new(&MODEL, &prior, Timing::default()) else { continue };
            for k in 0..10 {
                let s = 0.05 * f64::from(k);
                recogniser.update(s, &[0.2 + 0.4 * s, 0.3 * s]).unwrap();
            }
            let Ok(estimate) = recogniser.estimate() else { continue };
            let rest = [estimate.duration, estimate.duration_deviation, estimate.arrival, estimate.fraction];
            let numbers = estimate.parameters.iter().chain(&estimate.deviations).chain(&rest);
            assert!(numbers.clone().all(|x| x.is_finite()), "{estimate:?} {prior:?}");
            estimated += 1;
        }
        assert!(accepted > 100 && estimated > 50, "{accepted} accepted, {estimated} estimated");
    }
}
