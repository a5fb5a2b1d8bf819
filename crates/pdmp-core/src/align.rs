//! Alignment of demonstrations (step 1 of Section 3.2): linear time scaling to a nominal one, resampled to C samples.

use std::borrow::Cow;

use crate::demo::{Demonstration, LEAST_SAMPLES, Sampling};
use crate::error::{Error, Result, check_positive};
use crate::phase::Kind;
use crate::smooth::{Smoothing, smooth};
use crate::spline::Knots;

/// Fewest steps of the aligned demonstrations, unless their number is given: each step of the nominal one is divided into
/// as many as it takes. The target between a few samples, where a movement turns sharply, is more than they show.
const FINE: usize = 150;
/// Most samples after alignment.
const MOST_SAMPLES: usize = 1_000_000;

/// How demonstrations are read as samples of one movement.
#[derive(Clone, Debug)]
pub struct Alignment {
    /// From start to goal, or one cycle.
    pub kind: Kind,
    /// Sampling interval in seconds of demonstrations that carry none.
    pub dt: Option<f64>,
    /// Periods in seconds of time-stamped cycles: one for all, or one each; empty where the intervals give them.
    pub period: Vec<f64>,
    /// What is done about measurement noise.
    pub smoothing: Smoothing,
    /// Index of the nominal demonstration; otherwise the one of median duration.
    pub nominal: Option<usize>,
    /// Samples C; otherwise as many as the nominal demonstration has, and the same with equal parts of its steps where
    /// these are fewer than 150.
    pub n_samples: Option<usize>,
}

/// Checks a duration in seconds: far outside, squares of rates would leave the range of numbers.
pub(crate) fn check_duration(value: f64) -> Result<()> {
    if (1e-9..=1e9).contains(&value) {
        return Ok(());
    }
    let allowed = "seconds from start to end must lie between 1e-9 and 1e9; check dt or time";
    Err(Error::Range { name: "duration", value, allowed })
}

/// Demonstrations that can be read as samples of one phase, each when it is asked for.
#[derive(Debug)]
pub(crate) struct Aligned<'a> {
    demos: &'a [Demonstration],
    clocks: Vec<Clock<'a>>,
    kind: Kind,
    smoothing: Smoothing,
    /// Durations or periods (M,), in seconds.
    pub(crate) durations: Vec<f64>,
    /// Index of the nominal demonstration.
    pub(crate) nominal: usize,
    /// Samples C of each after alignment.
    pub(crate) n_samples: usize,
}

/// When the samples of a demonstration were taken, and how long it lasts.
#[derive(Clone, Copy, Debug)]
struct Clock<'a> {
    ticks: Ticks<'a>,
    /// Seconds from start to end, or to the next cycle.
    duration: f64,
    /// The same in the unit of the ticks.
    extent: f64,
}

#[derive(Clone, Copy, Debug)]
enum Ticks<'a> {
    /// Intervals of `dt` seconds, which are counted: what falls on a sample does so to the last bit.
    Even { dt: f64 },
    /// Stamps in seconds, counted from the first.
    Stamps(&'a [f64]),
}

impl Alignment {
    /// Reads the clocks of all demonstrations.
    ///
    /// # Errors
    /// No demonstration, different DoFs, a missing rate or period, a bad nominal index or number of samples.
    pub(crate) fn align<'a>(&self, demos: &'a [Demonstration]) -> Result<Aligned<'a>> {
        let n_dofs = demos.first().ok_or(Error::NoDemonstrations)?.n_dofs();
        if !(self.period.len() <= 1 || self.period.len() == demos.len()) {
            let (expected, found) = (demos.len(), self.period.len());
            return Err(Error::Length { name: "period", expected, found, per: "demonstration" });
        }
        let mut clocks = Vec::with_capacity(demos.len());
        for (m, demo) in demos.iter().enumerate() {
            if demo.n_dofs() != n_dofs {
                return Err(Error::Dofs { expected: n_dofs, found: demo.n_dofs() }.in_demo(m));
            }
            if self.kind == Kind::Rhythmic && demo.goal().is_some() {
                let (kind, instead) = (self.kind, ": it moves about the mean of its cycle");
                return Err(Error::Kind { name: "goal", kind, instead }.in_demo(m));
            }
            let period = self.period.get(if self.period.len() == 1 { 0 } else { m }).copied();
            clocks.push(self.clock(demo, period).map_err(|error| error.in_demo(m))?);
        }
        let durations: Vec<f64> = clocks.iter().map(|clock| clock.duration).collect();
        let nominal = self.nominal_of(&durations)?;
        let steps = self.kind.steps(demos[nominal].n_samples());
        let n_samples = self.n_samples.unwrap_or(self.kind.samples(steps * FINE.div_ceil(steps)));
        if !(LEAST_SAMPLES..=MOST_SAMPLES).contains(&n_samples) {
            let value = n_samples as f64;
            return Err(Error::Range { name: "n_samples", value, allowed: "must lie between 4 and 1e6" });
        }
        let Self { kind, smoothing, .. } = *self;
        Ok(Aligned { demos, clocks, kind, smoothing, durations, nominal, n_samples })
    }

    fn clock<'a>(&self, demo: &'a Demonstration, period: Option<f64>) -> Result<Clock<'a>> {
        let n = demo.n_samples();
        let even = |dt: f64| {
            let extent = self.kind.steps(n) as f64;
            Clock { ticks: Ticks::Even { dt }, duration: extent * dt, extent }
        };
        let mut clock = match (demo.sampling(), self.dt) {
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
            (Sampling::Stamped { .. }, _) if self.kind == Kind::Rhythmic && period.is_none() => {
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
            if self.kind == Kind::Discrete {
                let (name, kind) = ("period", self.kind);
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

    /// The demonstration of median duration: the lower one of two, the earlier one of equals.
    fn nominal_of(&self, durations: &[f64]) -> Result<usize> {
        match self.nominal {
            Some(nominal) if nominal < durations.len() => Ok(nominal),
            Some(nominal) => {
                let value = nominal as f64;
                Err(Error::Range { name: "nominal", value, allowed: "must be the index of a demonstration, from 0" })
            }
            None => {
                let mut order: Vec<usize> = (0..durations.len()).collect();
                order.sort_by(|&a, &b| durations[a].total_cmp(&durations[b]));
                Ok(order[(durations.len() - 1) / 2])
            }
        }
    }
}

impl Ticks<'_> {
    /// Seconds that make one tick.
    fn unit(&self) -> f64 {
        match *self {
            Ticks::Even { dt } => dt,
            Ticks::Stamps(_) => 1.0,
        }
    }

    /// The tick of sample `c`.
    fn at(&self, c: usize) -> f64 {
        match self {
            Ticks::Even { .. } => c as f64,
            Ticks::Stamps(time) => time[c] - time[0],
        }
    }
}

impl Aligned<'_> {
    /// The same, read at another number of samples.
    pub(crate) fn resampled(self, n_samples: usize) -> Self {
        Self { n_samples, ..self }
    }

    /// Demonstration `m` as it was given.
    pub(crate) fn demo(&self, m: usize) -> &Demonstration {
        &self.demos[m]
    }

    /// Writes the positions of demonstration `m` (C·D, by rows), absolute.
    ///
    /// Time scaling by Tⁿ/Tᵐ puts sample c at the share c/(C−1) of the duration, or c/C of the period.
    ///
    /// # Errors
    /// A bad smoothing.
    pub(crate) fn sample(&self, m: usize, position: &mut [f64]) -> Result<()> {
        let (demo, Clock { ticks, duration, extent }) = (&self.demos[m], self.clocks[m]);
        let n = demo.n_samples();
        let own = demo.position();
        let values = if self.smoothing == Smoothing::Interpolate {
            own.as_slice().map_or_else(|| Cow::Owned(own.iter().copied().collect()), Cow::Borrowed)
        } else {
            let seconds: Vec<f64> = (0..n).map(|c| ticks.at(c) * ticks.unit()).collect();
            let period = (self.kind == Kind::Rhythmic).then_some(duration);
            let smoothed = smooth(self.smoothing, &seconds, period, own).map_err(|error| error.in_demo(m))?;
            Cow::Owned(smoothed.iter().copied().collect())
        };
        let steps = self.kind.steps(self.n_samples) as f64;
        if matches!(ticks, Ticks::Even { .. }) && n == self.n_samples && extent == steps {
            position.copy_from_slice(&values);
            return Ok(());
        }
        let time = (0..n).map(|c| ticks.at(c)).collect();
        let knots = match self.kind {
            Kind::Discrete => Knots::not_a_knot(time),
            Kind::Rhythmic => Knots::periodic(time, extent),
        };
        let mut slopes = vec![0.0; values.len()];
        knots.slopes(&values, &mut slopes);
        knots.sample(&values, &slopes, (0..self.n_samples).map(|c| c as f64 * extent / steps), position);
        Ok(())
    }
}
