//! When the samples of a demonstration were taken.

use super::Alignment;
use crate::demonstration::{Demonstration, Sampling};
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::validate::{check_duration, check_positive};

/// When the samples of a demonstration were taken, and how long it lasts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock<'a> {
    pub(super) ticks: Ticks<'a>,
    /// Seconds from start to end, or to the next cycle.
    pub(super) duration: f64,
    /// The same in the unit of the ticks.
    pub(super) extent: f64,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Ticks<'a> {
    /// Intervals of `dt` seconds, which are counted: what falls on a sample does so to the last bit.
    Even { dt: f64 },
    /// Stamps in seconds, counted from the first.
    Stamps(&'a [f64]),
}

impl<'a> Clock<'a> {
    /// The clock of a demonstration, whose rate and period are told where it does not know them.
    pub(super) fn of(demo: &'a Demonstration, alignment: &Alignment, period: Option<f64>) -> Result<Self> {
        let n = demo.n_samples();
        let even = |dt: f64| {
            let extent = alignment.kind.steps(n) as f64;
            Clock { ticks: Ticks::Even { dt }, duration: extent * dt, extent }
        };
        let mut clock = match (demo.sampling(), alignment.dt) {
            (Sampling::Uniform { dt }, _) => even(*dt),
            (Sampling::Unknown, Some(dt)) => {
                check_positive("dt", dt)?;
                even(dt)
            }
            (Sampling::Unknown, None) => {
                return Err(Error::Arguments(
                    "no sampling interval: pass dt= in seconds, or demonstrations with time=",
                ));
            }
            (Sampling::Stamped { .. }, _) if alignment.kind == Kind::Rhythmic && period.is_none() => {
                return Err(Error::Arguments(
                    "a time-stamped cycle does not tell when the next one begins: pass period= in seconds",
                ));
            }
            (Sampling::Stamped { time }, _) => {
                let duration = time[n - 1] - time[0];
                Clock { ticks: Ticks::Stamps(time), duration, extent: duration }
            }
        };
        if let Some(period) = period {
            if alignment.kind == Kind::Discrete {
                let (name, kind) = ("period", alignment.kind);
                return Err(Error::Kind { name, kind, instead: "; its duration follows from dt or time" });
            }
            check_positive("period", period)?;
            if period <= clock.ticks.at(n - 1) * clock.ticks.unit() {
                return Err(Error::Range { name: "period", value: period, allowed: "must exceed the last time stamp" });
            }
            clock = Clock { duration: period, extent: period / clock.ticks.unit(), ..clock };
        }
        check_duration(clock.duration)?;
        Ok(clock)
    }
}

impl Ticks<'_> {
    /// Seconds that make one tick.
    pub(super) fn unit(&self) -> f64 {
        match *self {
            Ticks::Even { dt } => dt,
            Ticks::Stamps(_) => 1.0,
        }
    }

    /// The tick of sample `c`.
    pub(super) fn at(&self, c: usize) -> f64 {
        match self {
            Ticks::Even { .. } => c as f64,
            Ticks::Stamps(time) => time[c] - time[0],
        }
    }
}
