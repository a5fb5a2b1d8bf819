//! Sample times of a demonstration.

use super::Alignment;
use crate::demonstration::{Demonstration, Sampling};
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::validate::{check_duration, check_positive, check_range};

/// Sample times and duration of a demonstration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock<'a> {
    pub(super) ticks: Ticks<'a>,
    /// Duration or period, in seconds.
    pub(super) duration: f64,
    /// Duration or period, in ticks.
    pub(super) extent: f64,
}

/// Unit in which sample times are counted.
#[derive(Clone, Copy, Debug)]
pub(super) enum Ticks<'a> {
    /// Intervals of `dt` seconds. Samples have integer ticks, so that their times are exact.
    Even { dt: f64 },
    /// Time stamps in seconds; ticks are seconds from the first.
    Stamps(&'a [f64]),
}

impl<'a> Clock<'a> {
    /// Returns the clock of a demonstration; the alignment supplies a missing sampling interval, `period` the period.
    ///
    /// # Errors
    /// A missing or invalid sampling interval or period, or a period of a discrete movement.
    pub(super) fn of(demo: &'a Demonstration, alignment: &Alignment, period: Option<f64>) -> Result<Self> {
        let n = demo.n_samples();
        let even = |dt: f64| {
            let extent = alignment.kind.steps(n) as f64;
            Clock { ticks: Ticks::Even { dt }, duration: extent * dt, extent }
        };
        alignment.dt.map_or(Ok(()), |dt| check_positive("dt", dt))?;
        let mut clock = match (demo.sampling(), alignment.dt) {
            (Sampling::Uniform { dt }, _) => even(*dt),
            (Sampling::Unknown, Some(dt)) => even(dt),
            (Sampling::Unknown, None) => {
                return Err(Error::Argument {
                    name: "dt",
                    problem: "is missing: pass the sampling interval in seconds, or demonstrations with time stamps",
                });
            }
            (Sampling::Stamped { .. }, _) if alignment.kind == Kind::Rhythmic && period.is_none() => {
                return Err(Error::Argument {
                    name: "period",
                    problem: "is missing: pass it in seconds for a cycle with time stamps",
                });
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
            let last = clock.ticks.at(n - 1) * clock.ticks.unit();
            check_range("period", period, period > last, "must exceed the last time stamp")?;
            clock = Clock { duration: period, extent: period / clock.ticks.unit(), ..clock };
        }
        check_duration(clock.duration)?;
        Ok(clock)
    }
}

impl Ticks<'_> {
    /// Returns the seconds per tick.
    pub(super) fn unit(&self) -> f64 {
        match *self {
            Ticks::Even { dt } => dt,
            Ticks::Stamps(_) => 1.0,
        }
    }

    /// Returns the tick of sample `c`.
    pub(super) fn at(&self, c: usize) -> f64 {
        match self {
            Ticks::Even { .. } => c as f64,
            Ticks::Stamps(time) => time[c] - time[0],
        }
    }
}
