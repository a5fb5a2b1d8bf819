//! Alignment of demonstrations (step 1 of Section 3.2): linear time scaling to a nominal one, resampled to C samples.

use ndarray::{Array2, Array3, Axis, s};

use crate::demo::{Demonstration, LEAST_SAMPLES, Sampling, zeros};
use crate::error::{Error, Result, check_positive};
use crate::phase::Kind;
use crate::smooth::{Smoothing, smooth};
use crate::spline::Spline;

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
    /// Samples C; otherwise as many as the nominal demonstration has.
    pub n_samples: Option<usize>,
}

/// Demonstrations as samples of one phase.
#[derive(Clone, Debug)]
pub(crate) struct Aligned {
    /// Positions (M, C, D), absolute.
    pub(crate) position: Array3<f64>,
    /// Durations or periods (M,), in seconds.
    pub(crate) durations: Vec<f64>,
    /// Index of the nominal demonstration.
    pub(crate) nominal: usize,
}

/// A demonstration with its clock: sample times from 0 and the duration, in seconds.
struct Timed {
    time: Vec<f64>,
    duration: f64,
}

impl Alignment {
    /// Aligns all demonstrations; `proceed` is told the share that is done.
    ///
    /// # Errors
    /// No demonstration, different DoFs, a missing rate or period, too few samples, a bad smoothing or nominal index, or
    /// whatever `proceed` returns.
    pub(crate) fn align(&self, demos: &[Demonstration], proceed: &mut dyn FnMut(f64) -> Result<()>) -> Result<Aligned> {
        let first = demos.first().ok_or(Error::NoDemonstrations)?;
        let n_dofs = first.n_dofs();
        if !(self.period.len() <= 1 || self.period.len() == demos.len()) {
            let (expected, found) = (demos.len(), self.period.len());
            return Err(Error::Length { name: "period", expected, found, per: "demonstration" });
        }
        let mut timed = Vec::with_capacity(demos.len());
        for (m, demo) in demos.iter().enumerate() {
            if demo.n_dofs() != n_dofs {
                return Err(Error::Dofs { expected: n_dofs, found: demo.n_dofs() }.in_demo(m));
            }
            if self.kind == Kind::Rhythmic && demo.goal().is_some() {
                let (kind, instead) = (self.kind, ": it moves about the mean of its cycle");
                return Err(Error::Kind { name: "goal", kind, instead }.in_demo(m));
            }
            let period = self.period.get(if self.period.len() == 1 { 0 } else { m }).copied();
            timed.push(self.time(demo, period).map_err(|error| error.in_demo(m))?);
        }
        let durations: Vec<f64> = timed.iter().map(|timed| timed.duration).collect();
        let nominal = self.nominal_of(&durations)?;
        let n_samples = self.n_samples.unwrap_or(demos[nominal].n_samples());
        if !(LEAST_SAMPLES..=MOST_SAMPLES).contains(&n_samples) {
            let value = n_samples as f64;
            return Err(Error::Range { name: "n_samples", value, allowed: "must lie between 4 and 1e6" });
        }
        let mut position = zeros("aligned demonstrations", (demos.len(), n_samples, n_dofs))?;
        for (m, (demo, timed)) in demos.iter().zip(&timed).enumerate() {
            proceed(m as f64 / demos.len() as f64)?;
            let resampled = self.resample(demo, timed, n_samples).map_err(|error| error.in_demo(m))?;
            position.slice_mut(s![m, .., ..]).assign(&resampled);
        }
        Ok(Aligned { position, durations, nominal })
    }

    fn time(&self, demo: &Demonstration, period: Option<f64>) -> Result<Timed> {
        let n = demo.n_samples();
        let uniform = |dt: f64| {
            let time: Vec<f64> = (0..n).map(|c| c as f64 * dt).collect();
            let steps = if self.kind == Kind::Discrete { n - 1 } else { n };
            Timed { time, duration: steps as f64 * dt }
        };
        let mut timed = match (demo.sampling(), self.dt) {
            (Sampling::Uniform { dt }, _) => uniform(*dt),
            (Sampling::Unknown, Some(dt)) => {
                check_positive("dt", dt)?;
                uniform(dt)
            }
            (Sampling::Unknown, None) => {
                return Err(Error::Arguments(
                    "no sampling interval: pass dt= in seconds, or demonstrations with time=",
                ));
            }
            (Sampling::Stamped { time }, _) => {
                let time: Vec<f64> = time.iter().map(|t| t - time[0]).collect();
                let duration = time[n - 1];
                if self.kind == Kind::Rhythmic && period.is_none() {
                    return Err(Error::Arguments(
                        "a time-stamped cycle does not tell when the next one begins: pass period= in seconds",
                    ));
                }
                Timed { time, duration }
            }
        };
        if let Some(period) = period {
            if self.kind == Kind::Discrete {
                let (name, kind) = ("period", self.kind);
                return Err(Error::Kind { name, kind, instead: "; its duration follows from dt or time" });
            }
            check_positive("period", period)?;
            if period <= timed.time[n - 1] {
                return Err(Error::Range { name: "period", value: period, allowed: "must exceed the last time stamp" });
            }
            timed.duration = period;
        }
        // Far outside, squares of rates would leave the range of numbers.
        if !(1e-9..=1e9).contains(&timed.duration) {
            let allowed = "seconds from start to end must lie between 1e-9 and 1e9; check dt or time";
            return Err(Error::Range { name: "duration", value: timed.duration, allowed });
        }
        Ok(timed)
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

    /// Time scaling by Tⁿ/Tᵐ puts sample c at the share c/(C−1) of the duration, or c/C of the period.
    fn resample(&self, demo: &Demonstration, timed: &Timed, n_samples: usize) -> Result<Array2<f64>> {
        let Timed { time, duration } = timed;
        let period = (self.kind == Kind::Rhythmic).then_some(*duration);
        let values = smooth(self.smoothing, time, period, demo.position())?;
        let steps = if period.is_some() { n_samples } else { n_samples - 1 };
        let at: Vec<f64> = (0..n_samples).map(|c| duration * (c as f64 / steps as f64)).collect();
        Ok(match period {
            None => Spline::not_a_knot(time, values.view()),
            Some(period) => Spline::periodic(time, period, values.view()),
        }
        .sample(&at))
    }
}

impl Aligned {
    /// First samples (M, D).
    pub(crate) fn starts(&self) -> Array2<f64> {
        self.position.slice(s![.., 0, ..]).to_owned()
    }

    /// Goals (M, D): those given with the demonstrations, otherwise the last samples.
    pub(crate) fn goals(&self, demos: &[Demonstration]) -> Array2<f64> {
        let mut goals = self.position.slice(s![.., -1, ..]).to_owned();
        for (mut goal, demo) in goals.rows_mut().into_iter().zip(demos) {
            if let Some(given) = demo.goal() {
                goal.assign(&ndarray::aview1(given));
            }
        }
        goals
    }

    /// Means over the phase (M, D), the anchors y_a of cycles.
    pub(crate) fn anchors(&self) -> Array2<f64> {
        // Relative to the first sample, so that a DoF at rest has its own position as its mean, to the last digit.
        let starts = self.starts();
        let rise = &self.position - &starts.view().insert_axis(Axis(1));
        let n = self.position.len_of(Axis(1)) as f64;
        starts + rise.sum_axis(Axis(1)) / n
    }

    /// Largest peak-to-peak range of each DoF within one demonstration (D,).
    pub(crate) fn ranges(&self) -> Vec<f64> {
        let peak = |d: usize| {
            self.position.index_axis(Axis(2), d).rows().into_iter().fold(0.0f64, |range, row| {
                let (low, high) = row.iter().fold((f64::MAX, f64::MIN), |(l, h), &y| (l.min(y), h.max(y)));
                range.max(high - low)
            })
        };
        (0..self.position.len_of(Axis(2))).map(peak).collect()
    }
}
