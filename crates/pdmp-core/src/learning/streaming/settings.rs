//! Settings that all blocks of demonstrations share, and that must be known before the first one is converted to targets.

use std::borrow::Cow;

use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::demonstration::{ContextValue, Demonstration, Sampling, check_labels, turn_of};
use crate::dynamics::canonical::Canonical;
use crate::dynamics::output_system::Attractor;
use crate::error::{Error, Result};
use crate::learning::alignment::{Aligned, Alignment, TimeScaling};
use crate::learning::constants::Constants;
use crate::learning::fit::{contexts_of, labels_of};
use crate::learning::options::{CanonicalOptions, FitOptions};
use crate::learning::targets::Targets;
use crate::numerics::smoothing_spline::{Noise, Smoothing};
use crate::numerics::threads::Threads;
use crate::preprocessing::inspection::{REFERENCE_SAMPLES, reference, unwound, unwound_from};

/// Settings that all blocks share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Settings {
    pub(super) canonical: Canonical,
    pub(super) alpha_z: f64,
    pub(super) beta_z: f64,
    /// Sampling interval in seconds of demonstrations that carry none.
    pub(super) dt: Option<f64>,
    /// Period in seconds of time-stamped cycles.
    pub(super) period: Option<f64>,
    pub(super) smoothing: Smoothing,
    /// Standard deviations of the measurement noise (D,).
    pub(super) levels: Vec<f64>,
    /// Cut-offs in Hz (D,).
    pub(super) cut_offs: Vec<Option<f64>>,
    /// Ends at rest (D,).
    pub(super) ends: Vec<[bool; 2]>,
    /// Number of samples C after alignment.
    pub(super) n_samples: usize,
    pub(super) names: Vec<String>,
    pub(super) units: Vec<String>,
    /// Unit of each DoF (D,) in which arc lengths are measured, of the size of the movement.
    pub(super) unit: Vec<f64>,
    /// Powers of two (D,) near multiples of the unit, by which targets are divided so that their squares neither overflow nor
    /// underflow.
    pub(super) sizes: Vec<f64>,
    /// Types of the context values (Q,); empty without contexts.
    pub(super) contexts: Vec<ContextScale>,
    /// Samples of a demonstration (9, D), from which the whole turns of others are counted; empty without angles.
    pub(super) reference: Vec<Vec<f64>>,
}

/// Type of one context value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum ContextScale {
    /// A number, with an offset and a scale that bring it near 1.
    Number { offset: f64, scale: f64 },
    /// A label.
    Label,
}

impl Settings {
    /// Chooses the settings from a sample of the demonstrations.
    ///
    /// # Errors
    /// Options that need all demonstrations at once, or as for a fit of the sample.
    pub(super) fn of(sample: &[Demonstration], options: &FitOptions) -> Result<Self> {
        check_options(options)?;
        let sample = unwound(sample);
        refuse_rotations(&sample)?;
        let alignment = options.alignment();
        let aligned = alignment.align(&sample, options.threads)?;
        let constants = Constants::of(options, &aligned)?;
        let (names, units) = labels_of(&sample)?;
        options.dof_scale.given(names.len())?;
        let contexts = contexts_of(&sample, None)?.is_some().then(|| sample[0].context().unwrap_or_default());
        let scales = contexts.unwrap_or_default().iter().enumerate().map(|(q, _)| ContextScale::of(&sample, q));
        let reference = match units.iter().any(|unit| turn_of(unit).is_some()) {
            true => reference(&sample[0]).rows().into_iter().map(|row| row.to_vec()).collect(),
            false => Vec::new(),
        };
        let mut settings = Self {
            canonical: constants.canonical,
            alpha_z: constants.attractor.alpha_z,
            beta_z: constants.attractor.beta_z,
            dt: options.dt,
            period: alignment.period.first().copied(),
            smoothing: options.smoothing,
            levels: aligned.noise.levels().to_vec(),
            cut_offs: aligned.noise.cut_offs().to_vec(),
            ends: aligned.noise.ends().to_vec(),
            n_samples: aligned.n_samples,
            unit: vec![1.0; names.len()],
            sizes: vec![1.0; names.len()],
            contexts: scales.collect(),
            names,
            units,
            reference,
        };
        let (attractor, canonical) = (settings.attractor(), settings.canonical);
        let targets = Targets::of(&aligned, attractor, canonical, options.threads, &mut |_| Ok(()))?;
        let ranges = targets.ranges();
        settings.unit = settings.unit_of(&options.dof_scale.of(&ranges, &settings.units), &ranges);
        let units: Vec<f64> = settings.unit.iter().map(|unit| power_of_two(*unit)).collect();
        let scaled = targets.forcing.iter().zip(units.iter().cycle()).map(|(f, unit)| f.abs() / unit);
        let largest = power_of_two(scaled.fold(0.0, f64::max));
        settings.sizes = units.iter().map(|unit| unit * largest).collect();
        Ok(settings)
    }

    /// Returns the unit of arc lengths (D,) for scales and ranges of the DoFs (D,).
    pub(super) fn unit_of(&self, dof_scale: &[f64], ranges: &[f64]) -> Vec<f64> {
        let largest = ranges.iter().zip(dof_scale).fold(0.0f64, |most, (range, scale)| most.max(range / scale));
        dof_scale.iter().map(|scale| scale * power_of_two(largest)).collect()
    }

    /// Checks settings that were read from a file.
    ///
    /// # Errors
    /// The name of a setting out of range.
    pub(super) fn check(&self) -> std::result::Result<(), &'static str> {
        let n_dofs = self.n_dofs();
        let lengths = [
            self.units.len(),
            self.levels.len(),
            self.cut_offs.len(),
            self.ends.len(),
            self.unit.len(),
            self.sizes.len(),
        ];
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let numbers =
            || self.cut_offs.iter().flatten().chain(&self.unit).chain(&self.sizes).chain([&self.alpha_z, &self.beta_z]);
        let scales = self.contexts.iter().all(|scale| match scale {
            ContextScale::Number { offset, scale } => offset.is_finite() && positive(*scale),
            ContextScale::Label => true,
        });
        let referenced = self.reference.is_empty()
            || self.reference.len() == REFERENCE_SAMPLES && self.reference.iter().all(|row| row.len() == n_dofs);
        let given = self.dt.iter().chain(&self.period).all(|x| positive(*x));
        let levels = self.levels.iter().all(|x| *x >= 0.0 && x.is_finite());
        match () {
            () if n_dofs == 0 || lengths.iter().any(|n| *n != n_dofs) => Err("its degrees of freedom do not agree"),
            () if !(4..=1_000_000).contains(&self.n_samples) => Err("n_samples is out of range"),
            () if !numbers().all(|x| positive(*x)) || !levels || !given => Err("a setting is out of range"),
            () if !positive(self.canonical.extent()) || !scales || !referenced => Err("a setting is out of range"),
            () => Ok(()),
        }
    }

    /// Returns the settings with the noise of other demonstrations.
    pub(super) fn with_noise(self, noise: &Noise) -> Self {
        let (levels, cut_offs, ends) = (noise.levels().to_vec(), noise.cut_offs().to_vec(), noise.ends().to_vec());
        Self { levels, cut_offs, ends, ..self }
    }

    pub(super) fn noise(&self) -> Noise {
        Noise { levels: self.levels.clone(), cut_offs: self.cut_offs.clone(), ends: self.ends.clone() }
    }

    pub(super) fn attractor(&self) -> Attractor {
        Attractor { alpha_z: self.alpha_z, beta_z: self.beta_z }
    }

    /// Returns the number of degrees of freedom D.
    pub(super) fn n_dofs(&self) -> usize {
        self.names.len()
    }

    /// Checks the labels of a block, and subtracts whole turns of angles.
    pub(super) fn prepared<'a>(&self, block: &'a [Demonstration]) -> Result<Cow<'a, [Demonstration]>> {
        refuse_rotations(block)?;
        for (m, demo) in block.iter().enumerate() {
            if demo.n_coordinates() != self.n_dofs() {
                return Err(Error::Dofs { expected: self.n_dofs(), found: demo.n_coordinates() }.in_demo(m));
            }
            for (name, labels, own) in [("names", demo.names(), &self.names), ("units", demo.units(), &self.units)] {
                check_labels(name, labels, own, "the first block").map_err(|error| error.in_demo(m))?;
            }
        }
        if self.reference.is_empty() {
            return Ok(Cow::Borrowed(block));
        }
        let position = Array2::from_shape_fn((REFERENCE_SAMPLES, self.n_dofs()), |(k, d)| self.reference[k][d]);
        let reference = Demonstration::new(position, Sampling::Unknown)?.with_units(self.units.clone())?;
        Ok(unwound_from(&reference, block))
    }

    /// Aligns a prepared block.
    pub(super) fn aligned<'a>(&self, block: &'a [Demonstration], threads: Threads) -> Result<Aligned<'a>> {
        let alignment = Alignment {
            kind: self.canonical.kind(),
            dt: self.dt,
            period: self.period.into_iter().collect(),
            smoothing: Smoothing::Interpolate,
            nominal: Some(0),
            n_samples: Some(self.n_samples),
            vectors: Vec::new(),
        };
        let mut aligned = alignment.align(block, threads)?;
        aligned.noise = self.noise();
        Alignment { smoothing: self.smoothing, ..alignment }.check_cut_off(&aligned)?;
        Ok(aligned)
    }
}

impl ContextScale {
    /// Returns the type of a context value, from its values in demonstrations that all have contexts.
    fn of(sample: &[Demonstration], column: usize) -> Self {
        let values = sample.iter().filter_map(|demo| demo.context()?.get(column));
        let numbers: Vec<f64> = values
            .filter_map(|value| match value {
                ContextValue::Number(number) => Some(*number),
                ContextValue::Label(_) => None,
            })
            .collect();
        let Some(&offset) = numbers.first() else { return Self::Label };
        let scale = numbers.iter().fold(0.0f64, |most, x| most.max((x - offset).abs()));
        Self::Number { offset, scale: if scale > 0.0 { scale } else { offset.abs().max(1.0) } }
    }
}

/// Returns the largest power of two that does not exceed a number; 1 for 0.
fn power_of_two(number: f64) -> f64 {
    if number > 0.0 { number.log2().floor().exp2() } else { 1.0 }
}

fn refuse_rotations(demos: &[Demonstration]) -> Result<()> {
    let first = demos.first().ok_or(Error::NoDemonstrations)?;
    if first.rotations().is_empty() {
        return Ok(());
    }
    let problem =
        "need the mean rotation of all demonstrations: fit them in one list, or pass rotation vectors as positions";
    Err(Error::Argument { name: "rotations", problem })
}

/// Refuses the options that need all demonstrations at once.
fn check_options(options: &FitOptions) -> Result<()> {
    if options.time_scaling != TimeScaling::Linear {
        let problem =
            "needs all demonstrations at once: leave it out, or divide the time of each demonstration before the fit";
        return Err(Error::Argument { name: "alignment", problem });
    }
    if options.contexts.is_some() {
        let problem = "does not apply to blocks: give each demonstration its own context";
        return Err(Error::Argument { name: "contexts", problem });
    }
    if matches!(&options.canonical, CanonicalOptions::Rhythmic { periods, .. } if periods.len() > 1) {
        let problem = "must be one number for blocks: give demonstrations sampling intervals instead of time stamps";
        return Err(Error::Argument { name: "period", problem });
    }
    Ok(())
}
