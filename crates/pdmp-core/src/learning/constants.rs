//! Constants of a primitive, given or derived from the demonstrations.

use std::f64::consts::TAU;

use super::{CanonicalOptions, FitOptions};
use crate::dynamics::canonical::Canonical;
use crate::dynamics::output_system::Attractor;
use crate::error::Result;
use crate::learning::alignment::Aligned;
use crate::learning::regression::Domain;
use crate::model::primitive::{MAX_RATE, MAX_TAU};
use crate::validate::{check_positive, check_range};

/// Constants of a primitive.
#[derive(Clone, Copy)]
pub(crate) struct Constants {
    pub(super) attractor: Attractor,
    pub(super) canonical: Canonical,
    pub(super) tau: f64,
}

impl Constants {
    /// Returns the constants for the given options and the nominal demonstration.
    ///
    /// # Errors
    /// As for [`Self::for_duration`].
    pub(super) fn of(options: &FitOptions, aligned: &Aligned) -> Result<Self> {
        Self::for_duration(options, aligned.durations()[aligned.nominal])
    }

    /// Returns the constants for the given options and the nominal duration, in seconds.
    ///
    /// # Errors
    /// A constant out of range, or one that the kind of movement does not have.
    pub(super) fn for_duration(options: &FitOptions, duration: f64) -> Result<Self> {
        let attractor = Attractor { alpha_z: options.alpha_z, beta_z: options.beta_z.unwrap_or(options.alpha_z / 4.0) };
        if let Some(length) = options.rotation_length {
            let allowed = "must lie between 1e-6 and 1e6, in the unit of the positions";
            check_range("rotation_length", length, (1e-6..=1e6).contains(&length), allowed)?;
        }
        check_rate("alpha_z", attractor.alpha_z)?;
        check_rate("beta_z", attractor.beta_z)?;
        let (canonical, tau) = match options.canonical {
            CanonicalOptions::Discrete { tau, alpha_x, .. } => {
                let tau = tau.unwrap_or(duration);
                check_positive("tau", tau)?;
                let u_end = duration / tau;
                let allowed = "must lie within a thousandfold of the nominal duration";
                check_range("tau", tau, (1e-3..=1e3).contains(&u_end), allowed)?;
                let alpha_x = alpha_x.unwrap_or(100f64.ln() / u_end);
                check_rate("alpha_x", alpha_x)?;
                let allowed = "must not exceed 300 tau / T, or the phase vanishes before the end";
                check_range("alpha_x", alpha_x, alpha_x * u_end <= 300.0, allowed)?;
                (Canonical::Discrete { alpha_x, u_end }, tau)
            }
            CanonicalOptions::Rhythmic { mu, .. } => {
                check_rate("mu", mu)?;
                (Canonical::Rhythmic { mu }, duration / TAU)
            }
        };
        let allowed = "seconds: must lie between 1e-12 and 1e12; check the unit of time";
        check_range("tau", tau, (1.0 / MAX_TAU..=MAX_TAU).contains(&tau), allowed)?;
        Ok(Self { attractor, canonical, tau })
    }

    /// Returns the domain of the clock on which the landscape is learnt.
    pub(super) fn domain(&self) -> Domain {
        match self.canonical {
            Canonical::Discrete { u_end, .. } => Domain::Interval { end: u_end },
            Canonical::Rhythmic { .. } => Domain::Circle,
        }
    }
}

/// Checks a rate; the bounds keep products of rates far from overflow and underflow.
fn check_rate(name: &'static str, value: f64) -> Result<()> {
    check_range(name, value, (1.0 / MAX_RATE..=MAX_RATE).contains(&value), "must lie between 1e-6 and 1e6")
}
