//! Matérn processes in state-space form: likelihood, gradient and posterior in O(C).

use std::f64::consts::TAU;

use super::interpolation::StatePosterior;
use super::kalman_filter::{FilterSteps, Intervals, States, Transitions, means, product};
use super::matern_sde::{Square, drift, rate, stationary};
use super::periodic::{CircularProcess, PeriodicBoundary};
use super::rts_smoother::Smoother;
use super::{Gradient, Hyperparameters, PORTION, Profile, Progress, Samples};
use crate::error::Result;
use crate::learning::regression::Domain;
use crate::numerics::simd::{F64x4, WIDTH, groups};

/// Samples of a Matérn process of order D − ½, sorted by the clock.
pub(super) struct StateSpace<const D: usize> {
    domain: Domain,
    u: Vec<f64>,
    intervals: Intervals,
    /// Outputs (C, groups); on the circle followed by D columns of zeros for the boundary.
    targets: Vec<F64x4>,
    n_outputs: usize,
}

impl<const D: usize> StateSpace<D> {
    pub(super) fn new(domain: Domain, samples: &Samples) -> Self {
        let (u, end) = match domain {
            Domain::Interval { .. } => (samples.u.clone(), None),
            Domain::Circle => (samples.u.iter().map(|u| u.rem_euclid(TAU)).collect(), Some(TAU)),
        };
        let mut order: Vec<usize> = (0..u.len()).collect();
        order.sort_by(|&i, &j| u[i].total_cmp(&u[j]));
        let n_outputs = samples.targets.ncols();
        let groups = groups(n_outputs + end.map_or(0, |_| D));
        let mut targets = vec![F64x4::ZERO; order.len() * groups];
        let rows: &mut [f64] = bytemuck::cast_slice_mut(&mut targets);
        for (k, &i) in order.iter().enumerate() {
            let row = &mut rows[k * groups * WIDTH..];
            row.iter_mut().zip(samples.targets.row(i)).for_each(|(to, from)| *to = *from);
        }
        let u: Vec<f64> = order.iter().map(|&i| u[i]).collect();
        Self { domain, intervals: Intervals::new(&u, end.map(|turn| u[0] + turn)), u, targets, n_outputs }
    }

    /// Returns the profile likelihood; `None` if rounding makes the covariance indefinite.
    pub(super) fn profile(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<Profile>> {
        Ok(self.filter(at, progress)?.map(|filtered| filtered.profile()))
    }

    /// Returns the profile likelihood and its gradient; `None` if rounding makes the covariance indefinite.
    pub(super) fn gradient(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<(Profile, Gradient)>> {
        self.filter(at, progress)?.map(|filtered| filtered.gradient(progress)).transpose()
    }

    /// Returns the profile likelihood and the posterior; `None` if rounding makes the covariance indefinite.
    pub(super) fn fit(
        &self,
        at: Hyperparameters,
        progress: &mut Progress,
    ) -> Result<Option<(Profile, StatePosterior<D>)>> {
        let Some(filtered) = self.filter(at, progress)? else { return Ok(None) };
        Ok(Some((filtered.profile(), filtered.smooth(progress)?)))
    }

    /// Runs the filter over all samples; `None` if rounding makes the covariance indefinite.
    fn filter(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<Filtered<'_, D>>> {
        let circle = (self.domain == Domain::Circle).then(|| CircularProcess::new::<D>(at.length));
        // The state-space kernel is not divided by the norm of the wrapped kernel, so the noise is multiplied by it.
        let (rate, norm) = circle.map_or((rate::<D>(at.length), 1.0), |circle| (circle.rate, circle.norm));
        let (transitions, noise) = (Transitions::new(&self.intervals, rate), at.noise * norm);
        let start = if circle.is_some() { Square::zeros() } else { stationary() };
        let steps = FilterSteps::new(&transitions, start, noise, progress)?;
        let mut means = means(&transitions, &steps, &self.targets, progress)?;
        let mut log_determinant = steps.log_variances(self.u.len());
        let mut boundary = None;
        if let Some(circle) = circle {
            let found =
                PeriodicBoundary::new(&transitions, &steps, &self.targets, &mut means, self.n_outputs, progress)?;
            let Some(found) = found else { return Ok(None) };
            log_determinant += found.log_determinant - 2.0 * circle.log_determinant::<D>().0;
            boundary = Some((circle, found));
        }
        Ok(Some(Filtered { process: self, rate, norm, noise, transitions, steps, means, boundary, log_determinant }))
    }

    fn groups(&self) -> usize {
        self.targets.len() / self.u.len()
    }

    /// Stores equal intervals as if they were uneven.
    #[cfg(test)]
    pub(super) fn forget_evenness(&mut self) {
        if let Intervals::Even { interval, n_samples } = self.intervals {
            self.intervals = Intervals::Uneven(vec![interval; n_samples]);
        }
    }
}

/// Result of the filter.
struct Filtered<'a, const D: usize> {
    process: &'a StateSpace<D>,
    rate: f64,
    /// Value of the state-space kernel at 0.
    norm: f64,
    /// Noise ratio ν in units of the state-space kernel.
    noise: f64,
    transitions: Transitions<D>,
    steps: FilterSteps<D>,
    /// Predicted states (C + 1, groups).
    means: Vec<States<D>>,
    boundary: Option<(CircularProcess, PeriodicBoundary<D>)>,
    /// ln|K|.
    log_determinant: f64,
}

impl<const D: usize> Filtered<'_, D> {
    /// Returns the signal variance Σ fᵀK⁻¹f/(CP) in units of the state-space kernel.
    fn variance(&self) -> f64 {
        let groups = self.process.groups();
        let mut misfit = vec![F64x4::ZERO; groups];
        for i in 0..self.process.u.len() {
            let (inverse, row) = (1.0 / self.steps.at(i).variance, i * groups..(i + 1) * groups);
            for ((misfit, x), y) in misfit.iter_mut().zip(&self.means[row.clone()]).zip(&self.process.targets[row]) {
                let innovation = *y - x[0];
                *misfit += innovation * innovation * inverse;
            }
        }
        if let Some((_, boundary)) = &self.boundary {
            let ends = boundary.initial.iter().zip(&self.means[self.process.u.len() * groups..]);
            for (misfit, (first, last)) in misfit.iter_mut().zip(ends) {
                let gap: States<D> = std::array::from_fn(|k| first[k] - last[k]);
                let weighted = product(&boundary.precision, &gap);
                (0..D).for_each(|k| *misfit += gap[k] * weighted[k]);
            }
        }
        let misfits: &[f64] = bytemuck::cast_slice(&misfit);
        let n_values = self.process.u.len() * self.process.n_outputs;
        misfits[..self.process.n_outputs].iter().sum::<f64>() / n_values.max(1) as f64
    }

    /// Returns the profile likelihood; the state-space covariance is that of the process times the norm.
    fn profile(&self) -> Profile {
        let (n_samples, n_outputs) = (self.process.u.len() as f64, self.process.n_outputs as f64);
        let log_determinant = n_outputs * (self.log_determinant - n_samples * self.norm.ln());
        Profile { n_values: n_samples * n_outputs, variance: self.variance() * self.norm, log_determinant }
    }

    /// Returns the smoother at the end of the process, where only the circle adds information: ξ − x ~ N(0, P).
    fn smoother(&self) -> Smoother<'_, D> {
        let groups = self.process.groups();
        let (adjoint, precision) = match &self.boundary {
            Some((_, boundary)) => {
                let last = &self.means[self.process.u.len() * groups..];
                let gaps =
                    boundary.initial.iter().zip(last).map(|(first, last)| std::array::from_fn(|k| first[k] - last[k]));
                (gaps.map(|gap| product(&boundary.precision, &gap)).collect(), boundary.precision)
            }
            None => (vec![[F64x4::ZERO; D]; groups], Square::zeros()),
        };
        Smoother::new(&self.transitions, &self.steps, adjoint, precision)
    }

    /// Returns the profile likelihood and its gradient.
    ///
    /// With G = Σ rrᵀ/σ̂² − P·N at the sample after a transition, the log likelihood changes by
    /// ½tr(dP·G) + Σ rᵀdx/σ̂² with the prediction of that sample: dx = Fx·da, dP = (FM + MFᵀ + qqᵀ)·da, M = P − Q. With
    /// the noise it changes by ½Σα²/σ̂² − P/2·tr K⁻¹, α = K⁻¹f.
    fn gradient(&self, progress: &mut Progress) -> Result<(Profile, Gradient)> {
        let profile = self.profile();
        if profile.variance == 0.0 {
            return Ok((profile, Gradient { data_fit: [0.0; 2], complexity: [0.0; 2] }));
        }
        let (n_outputs, groups) = (self.process.n_outputs as f64, self.process.groups());
        let mut smoother = self.smoother();
        let (mut by_length, mut by_noise) = (vec![F64x4::ZERO; groups], vec![F64x4::ZERO; groups]);
        let (mut shared_length, mut shared_noise) = (0.0, 0.0);
        let mut half_change = Square::zeros();
        for i in (0..self.process.u.len()).rev() {
            if (i + 1) % PORTION == 0 {
                progress.report()?;
            }
            let transition = self.transitions.after(i);
            let covariance = &self.steps.at(i + 1).covariance;
            if i < self.steps.settled() || i + 1 == self.process.u.len() {
                let moved = drift(&(covariance - transition.noise));
                half_change =
                    0.5 * (moved + moved.transpose() + transition.diffusion * transition.diffusion.transpose());
            }
            let means = &self.means[(i + 1) * groups..(i + 2) * groups];
            for ((sum, r), x) in by_length.iter_mut().zip(&smoother.adjoint).zip(means) {
                let change = product(&half_change, r);
                for k in 0..D {
                    let moved = if k + 1 < D { x[k + 1] - x[k] } else { -x[k] };
                    *sum += r[k] * (moved + change[k]) * transition.a;
                }
            }
            shared_length += half_change.dot(&smoother.precision) * transition.a;
            smoother.back(i, &self.means, &self.process.targets, |group, weight| by_noise[group] += weight * weight);
            shared_noise += smoother.inverse;
        }
        // The columns of the uncertain initial state on the circle count once for every output.
        let total = |sums: &[F64x4], shared: f64| {
            let sums: &[f64] = bytemuck::cast_slice(sums);
            let (outputs, columns) = sums.split_at(self.process.n_outputs);
            (outputs.iter().sum::<f64>() / self.variance(), n_outputs * (shared - columns.iter().sum::<f64>()))
        };
        let (by_length, by_noise) = (total(&by_length, shared_length), total(&by_noise, shared_noise));
        let mut data_fit = [-by_length.0, 0.5 * self.noise * by_noise.0];
        let mut complexity = [-by_length.1, 0.5 * self.noise * by_noise.1];
        if let Some((circle, _)) = &self.boundary {
            // K and ν in state-space form are those of the process times the norm, which depends on the length.
            let half = 0.5 * profile.n_values;
            data_fit[0] += circle.log_norm_slope * (data_fit[1] - half);
            complexity[0] +=
                circle.log_norm_slope * (complexity[1] - half) - n_outputs * circle.log_determinant::<D>().1;
        }
        Ok((profile, Gradient { data_fit, complexity }))
    }

    /// Returns the posterior at every point of the clock.
    fn smooth(mut self, progress: &mut Progress) -> Result<StatePosterior<D>> {
        let (n_samples, groups) = (self.process.u.len(), self.process.groups());
        let mut adjoints = vec![[F64x4::ZERO; D]; (n_samples + 1) * groups];
        let mut precisions = vec![Square::zeros(); n_samples + 1];
        let mut smoother = self.smoother();
        adjoints[n_samples * groups..].copy_from_slice(&smoother.adjoint);
        precisions[n_samples] = smoother.precision;
        for i in (0..n_samples).rev() {
            if (i + 1) % PORTION == 0 {
                progress.report()?;
            }
            smoother.back(i, &self.means, &self.process.targets, |_, _| ());
            adjoints[i * groups..(i + 1) * groups].copy_from_slice(&smoother.adjoint);
            precisions[i] = smoother.precision;
        }
        self.means.truncate(n_samples * groups);
        for i in 0..n_samples {
            let (step, row) = (self.steps.at(i), i * groups..(i + 1) * groups);
            for (x, r) in self.means[row.clone()].iter_mut().zip(&adjoints[row]) {
                let correction = product(&step.covariance, r);
                (0..D).for_each(|k| x[k] += correction[k]);
            }
        }
        Ok(StatePosterior {
            circle: self.boundary.is_some(),
            rate: self.rate,
            norm: self.norm,
            u: self.process.u.clone(),
            covariances: self.steps.updated(n_samples, self.noise),
            precisions,
            states: self.means,
            adjoints,
            n_outputs: self.process.n_outputs,
        })
    }
}
