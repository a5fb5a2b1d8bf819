//! Fit of a sequence of blocks that can be read more than once.

use std::hash::{DefaultHasher, Hash, Hasher};

use super::factorised_fit::{FactorisedFit, different_blocks};
use super::partial_fit::{PartialFit, in_all};
use super::settings::Settings;
use crate::demonstration::{Demonstration, Sampling};
use crate::error::{Error, Result};
use crate::learning::alignment::Alignment;
use crate::learning::constants::Constants;
use crate::learning::options::{CanonicalOptions, FitOptions, Stage, TransportSelection};
use crate::model::Model;
use crate::numerics::smoothing_spline::{Noise, Smoothing, pool_stride, pooled};
use crate::numerics::threads::Threads;

/// Blocks of demonstrations in one pass.
pub type Blocks<'a> = Box<dyn Iterator<Item = Result<Vec<Demonstration>>> + 'a>;

/// Fits a model to blocks of demonstrations, in memory for one block, a triangular factor of C·D columns, and O(D + J) numbers
/// of each demonstration. The model is that of [`fit`](crate::fit) for all demonstrations in one slice, but for rounding.
///
/// `blocks` returns an iterator over the same blocks at every call. There are two passes, the second for the styles, where
/// the first block suggests the settings that suit all: number of samples, and no smoothing. Otherwise another pass
/// precedes, from which the nominal demonstration and the noise are chosen; one more is needed if the scales of the degrees
/// of freedom follow from their ranges.
///
/// # Errors
/// As for [`fit`](crate::fit); options that need all demonstrations at once, which are time warps, landmarks, rotations, the
/// number of styles by cross-validation, and contexts or periods of all demonstrations; other demonstrations in a later pass;
/// or an error of a block.
///
/// ```
/// # use pdmp_core::{Demonstration, FitOptions, fit};
/// use pdmp_core::learning::fit_blocks;
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// let options = FitOptions::discrete();
/// let mut blocks = || -> pdmp_core::learning::Blocks<'_> { Box::new(demos.chunks(2).map(|block| Ok(block.to_vec()))) };
/// let model = fit_blocks(&mut blocks, &options, &mut |_, _| Ok(()))?;
/// assert_eq!(model.n_styles(), fit(&demos, &options)?.n_styles());
/// # Ok(())
/// # }
/// ```
pub fn fit_blocks<'a>(
    blocks: &mut dyn FnMut() -> Blocks<'a>,
    options: &FitOptions,
    progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
) -> Result<Model> {
    let mut passes = Passes { blocks, first: Vec::new(), is_repeated: false };
    let (partial, noise) = first_pass(&mut passes, options, progress)?;
    let partial = PartialFit { settings: partial.settings.with_noise(&noise), ..partial };
    let factorised = partial.factorise(options, progress)?;
    drop(partial);
    factorised.finish_blocks(passes.next(), progress)
}

impl FactorisedFit {
    /// Returns the model, given all blocks once more in the order of the first pass.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions};
    /// # use pdmp_core::learning::PartialFit;
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// let options = FitOptions::discrete();
    /// let mut partial = PartialFit::new(&demos, &options)?;
    /// demos.chunks(2).try_for_each(|block| partial.update(block))?;
    /// let factorised = partial.factorise(&options, &mut |_, _| Ok(()))?;
    /// let blocks = Box::new(demos.chunks(2).map(|block| Ok(block.to_vec())));
    /// let model = factorised.finish_blocks(blocks, &mut |_, _| Ok(()))?;
    /// assert_eq!(model.n_demos(), 3);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Blocks that differ from those of the first pass, an error of a block, or that which `progress` returned.
    pub fn finish_blocks(
        self,
        blocks: Blocks<'_>,
        progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
    ) -> Result<Model> {
        let n_demos = self.n_demos();
        let (mut styles, mut first) = (Vec::new(), 0);
        for block in blocks {
            let block = block?;
            let size = block.len();
            let share = |share: f64| ((first as f64 + share * size as f64) / n_demos as f64).min(1.0);
            if size > 0 {
                let mut projecting = |done: f64| progress(Stage::Factorise, share(done));
                styles.push(self.projection().styles(&block, first, &mut projecting)?);
            }
            first += size;
        }
        self.finish(styles, progress)
    }
}

/// Passes over the blocks, each of which must yield the demonstrations of the first.
struct Passes<'f, 'a> {
    blocks: &'f mut dyn FnMut() -> Blocks<'a>,
    /// Hash of each demonstration of the first pass.
    first: Vec<u64>,
    /// True from the second pass on.
    is_repeated: bool,
}

impl Passes<'_, '_> {
    /// Begins a pass. It ends with an error where it differs from the first.
    fn next(&mut self) -> Blocks<'_> {
        let (is_repeated, mut blocks, mut index) = (self.is_repeated, (self.blocks)(), 0);
        self.is_repeated = true;
        let first = &mut self.first;
        Box::new(std::iter::from_fn(move || {
            let Some(block) = blocks.next() else {
                let is_short = is_repeated && index < first.len();
                index = first.len();
                return is_short.then(|| Err(different_blocks()));
            };
            if let Ok(block) = &block {
                let hashes = block.iter().map(hash);
                if !is_repeated {
                    first.extend(hashes);
                } else if !first[index..].iter().take(block.len()).copied().eq(hashes) {
                    return Some(Err(different_blocks()));
                }
                index += block.len();
            }
            Some(block)
        }))
    }
}

/// Returns a hash of the samples of a demonstration.
fn hash(demo: &Demonstration) -> u64 {
    let mut hasher = DefaultHasher::new();
    demo.position().dim().hash(&mut hasher);
    demo.position().iter().for_each(|x| x.to_bits().hash(&mut hasher));
    if let Sampling::Stamped { time } = demo.sampling() {
        time.iter().for_each(|t| t.to_bits().hash(&mut hasher));
    }
    hasher.finish()
}

/// Returns the partial fit of all blocks with the settings that suit them, and their noise.
fn first_pass(
    passes: &mut Passes,
    options: &FitOptions,
    progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
) -> Result<(PartialFit, Noise)> {
    let (mut partial, survey) = survey(passes.next(), options, progress)?;
    let settings = survey.settings(options)?;
    let noise = settings.noise();
    let n_demos = survey.durations.len();
    if !partial.as_ref().is_some_and(|partial| partial.settings.converts_as(&settings)) {
        partial = Some(fit_all(passes.next(), settings, n_demos, options, progress)?);
    }
    let partial = partial.ok_or(Error::NoDemonstrations)?;
    match partial.suitable_settings(options) {
        None => Ok((partial, noise)),
        Some(settings) => Ok((fit_all(passes.next(), settings, n_demos, options, progress)?, noise)),
    }
}

/// Returns the partial fit of all blocks with given settings.
fn fit_all(
    blocks: Blocks,
    settings: Settings,
    n_demos: usize,
    options: &FitOptions,
    progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
) -> Result<PartialFit> {
    let mut partial = PartialFit::with(settings, options.threads)?;
    for block in blocks {
        let block = block?;
        let (first, size) = (partial.n_demos() as f64, block.len() as f64);
        let share = |share: f64| ((first + share * size) / n_demos as f64).min(1.0);
        partial.update_with(&block, &mut |done| progress(Stage::Targets, share(done)))?;
    }
    Ok(partial)
}

/// Surveys all blocks, and fits them with the settings that suit the first, unless it has noise: its cut-offs would not be
/// those of all.
fn survey(
    blocks: Blocks,
    options: &FitOptions,
    progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
) -> Result<(Option<PartialFit>, Survey)> {
    let (mut partial, mut survey) = (None, None);
    for block in blocks {
        let block = block?;
        // The number of blocks is unknown.
        progress(Stage::Align, 0.0)?;
        if block.is_empty() {
            continue;
        }
        if survey.is_none() {
            let settings = Settings::of(&block, options)?;
            let given = options.smoothing != Smoothing::Auto || settings.cut_offs.iter().all(Option::is_none);
            partial = given.then(|| PartialFit::with(settings.clone(), options.threads)).transpose()?;
            survey = Some(Survey { settings, durations: Vec::new(), n_recorded: Vec::new(), pool: Vec::new() });
        }
        if let Some(survey) = &mut survey {
            survey.add(&block)?;
        }
        if let Some(partial) = &mut partial {
            partial.update_with(&block, &mut |_| progress(Stage::Align, 0.0))?;
        }
    }
    survey.map(|survey| (partial, survey)).ok_or(Error::NoDemonstrations)
}

/// Numbers of all demonstrations from which the settings follow.
struct Survey {
    /// Settings that suit the first block.
    settings: Settings,
    durations: Vec<f64>,
    n_recorded: Vec<usize>,
    /// Demonstrations, with their indices, among which are those that the noise is estimated from.
    pool: Vec<(usize, Demonstration)>,
}

impl Survey {
    fn add(&mut self, block: &[Demonstration]) -> Result<()> {
        let first = self.durations.len();
        let inside = |error| in_all(error, first);
        let demos = self.settings.prepared(block).map_err(inside)?;
        let durations = self.settings.aligned(&demos, Threads::ONE).map_err(inside)?.durations();
        self.durations.extend(durations);
        self.n_recorded.extend(demos.iter().map(Demonstration::n_samples));
        let stride = pool_stride(self.durations.len());
        self.pool.retain(|(m, _)| m % stride == 0);
        let others = (first..).zip(demos.iter()).filter(|(m, _)| m % stride == 0);
        self.pool.extend(others.map(|(m, demo)| (m, demo.clone())));
        Ok(())
    }

    /// Returns the settings that suit all demonstrations, but for the units of the DoFs.
    fn settings(&self, options: &FitOptions) -> Result<Settings> {
        let alignment = options.alignment();
        let nominal = alignment.nominal_of(&self.durations)?;
        let n_samples = alignment.n_samples_for(self.n_recorded[nominal])?;
        let pool: Vec<Demonstration> = pooled(self.durations.len())
            .filter_map(|m| self.pool.iter().find(|(index, _)| *index == m).map(|(_, demo)| demo.clone()))
            .collect();
        let alignment = Alignment { nominal: Some(0), n_samples: Some(n_samples), ..alignment };
        let noise = alignment.align(&pool, options.threads)?.noise;
        let canonical = Constants::for_duration(options, self.durations[nominal])?.canonical;
        Ok(Settings { canonical, n_samples, ..self.settings.clone() }.with_noise(&noise))
    }
}

impl Settings {
    /// Returns whether other settings convert demonstrations to the same targets.
    fn converts_as(&self, other: &Self) -> bool {
        self.n_samples == other.n_samples
            && self.cut_offs == other.cut_offs
            && self.ends == other.ends
            && self.canonical == other.canonical
    }
}

impl PartialFit {
    /// Returns settings with the units of arc lengths that suit the ranges, if they are others.
    fn suitable_settings(&self, options: &FitOptions) -> Option<Settings> {
        let CanonicalOptions::Discrete { transport: TransportSelection::Learnt, .. } = options.canonical else {
            return None;
        };
        let dof_scale = options.dof_scale.of(&self.ranges, &self.settings.units);
        let (unit, own) = (self.settings.unit_of(&dof_scale, &self.ranges), &self.settings.unit);
        let first = unit[0];
        // A common factor, a power of two, does not matter.
        let same = unit.iter().zip(own).all(|(unit, other)| unit * own[0] == other * first);
        (!same).then(|| Settings { unit, ..self.settings.clone() })
    }
}
