//! Matérn processes as Markov chains: likelihood, its gradient and the posterior in O(C).

use std::f64::consts::TAU;

use super::interpolation::Trajectory;
use super::kalman_filter::{Gaps, Path, States, Steps, means, product};
use super::matern_sde::{Square, drift, rate, stationary};
use super::periodic::{Closure, Turn};
use super::posterior::Form;
use super::rts_smoother::Smoother;
use super::{Fitted, Hyperparameters, PORTION, Process, Profile, Progress, Samples, Slope};
use crate::error::Result;
use crate::learning::regression::Domain;
use crate::numerics::simd::{Lanes, WIDTH, groups};

/// Samples of a Matérn process of order D − ½, in the order of the chain.
pub(super) struct Chain<const D: usize> {
    domain: Domain,
    u: Vec<f64>,
    gaps: Gaps,
    /// (C, groups): the outputs, and on the circle D columns of zeros.
    targets: Vec<Lanes>,
    n_outputs: usize,
}

impl<const D: usize> Chain<D> {
    /// The filter's way along the chain; none if rounding makes the covariance indefinite.
    fn filter(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<Filtered<'_, D>>> {
        let turn = (self.domain == Domain::Circle).then(|| Turn::new::<D>(at.length));
        // The chain's kernel is not divided by the wrapped kernel's norm: the noise is multiplied by it.
        let (rate, norm) = turn.map_or((rate::<D>(at.length), 1.0), |turn| (turn.rate, turn.norm));
        let (path, noise) = (Path::new(&self.gaps, rate), at.noise * norm);
        let start = if turn.is_some() { Square::zeros() } else { stationary() };
        let steps = Steps::new(&path, start, noise, progress)?;
        let mut means = means(&path, &steps, &self.targets, progress)?;
        let mut log_determinant = steps.log_spreads(self.u.len());
        let mut closure = None;
        if let Some(turn) = turn {
            let Some(close) = Closure::new(&path, &steps, &self.targets, &mut means, self.n_outputs, progress)? else {
                return Ok(None);
            };
            log_determinant += close.log_determinant - 2.0 * turn.log_determinant::<D>().0;
            closure = Some((turn, close));
        }
        Ok(Some(Filtered { chain: self, rate, norm, noise, path, steps, means, closure, log_determinant }))
    }

    fn groups(&self) -> usize {
        self.targets.len() / self.u.len()
    }

    /// Treats equal distances as if they were not.
    #[cfg(test)]
    pub(super) fn forget_evenness(&mut self) {
        if let Gaps::Even { gap, n_samples } = self.gaps {
            self.gaps = Gaps::Uneven(vec![gap; n_samples]);
        }
    }
}

impl<const D: usize> Process for Chain<D>
where
    Form: From<Trajectory<D>>,
{
    const SEARCHED: usize = usize::MAX;

    fn new(domain: Domain, samples: &Samples) -> Self {
        let (u, end) = match domain {
            Domain::Interval { .. } => (samples.u.clone(), None),
            Domain::Circle => (samples.u.iter().map(|u| u.rem_euclid(TAU)).collect(), Some(TAU)),
        };
        let mut order: Vec<usize> = (0..u.len()).collect();
        order.sort_by(|&i, &j| u[i].total_cmp(&u[j]));
        let n_outputs = samples.targets.ncols();
        let groups = groups(n_outputs + end.map_or(0, |_| D));
        let mut targets = vec![Lanes::ZERO; order.len() * groups];
        let rows: &mut [f64] = bytemuck::cast_slice_mut(&mut targets);
        for (k, &i) in order.iter().enumerate() {
            let row = &mut rows[k * groups * WIDTH..];
            row.iter_mut().zip(samples.targets.row(i)).for_each(|(to, from)| *to = *from);
        }
        let u: Vec<f64> = order.iter().map(|&i| u[i]).collect();
        Self { domain, gaps: Gaps::new(&u, end.map(|turn| u[0] + turn)), u, targets, n_outputs }
    }

    fn profile(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<Profile>> {
        Ok(self.filter(at, progress)?.map(|filtered| filtered.profile()))
    }

    fn slope(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<(Profile, Slope)>> {
        self.filter(at, progress)?.map(|filtered| filtered.slope(progress)).transpose()
    }

    fn fit(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<Fitted>> {
        let Some(filtered) = self.filter(at, progress)? else { return Ok(None) };
        Ok(Some(Fitted { profile: filtered.profile(), form: filtered.smooth(progress)?.into() }))
    }
}

/// A chain that the filter has gone along.
struct Filtered<'a, const D: usize> {
    chain: &'a Chain<D>,
    rate: f64,
    /// What the chain's kernel is at 0.
    norm: f64,
    /// ν in units of the chain's kernel.
    noise: f64,
    path: Path<D>,
    steps: Steps<D>,
    /// (C + 1, groups).
    means: Vec<States<D>>,
    closure: Option<(Turn, Closure<D>)>,
    /// ln|K|.
    log_determinant: f64,
}

impl<const D: usize> Filtered<'_, D> {
    /// The signal variance, in units of the chain's kernel: Σ fᵀK⁻¹f/(CP).
    fn variance(&self) -> f64 {
        let groups = self.chain.groups();
        let mut misfit = vec![Lanes::ZERO; groups];
        for i in 0..self.chain.u.len() {
            let (certainty, all) = (1.0 / self.steps.at(i).spread, i * groups..(i + 1) * groups);
            for ((misfit, x), y) in misfit.iter_mut().zip(&self.means[all.clone()]).zip(&self.chain.targets[all]) {
                let innovation = *y - x[0];
                *misfit += innovation * innovation * certainty;
            }
        }
        if let Some((_, close)) = &self.closure {
            let ends = close.first.iter().zip(&self.means[self.chain.u.len() * groups..]);
            for (misfit, (first, last)) in misfit.iter_mut().zip(ends) {
                let gap: States<D> = std::array::from_fn(|k| first[k] - last[k]);
                let weighted = product(&close.precision, &gap);
                (0..D).for_each(|k| *misfit += gap[k] * weighted[k]);
            }
        }
        let misfits: &[f64] = bytemuck::cast_slice(&misfit);
        let n_values = self.chain.u.len() * self.chain.n_outputs;
        misfits[..self.chain.n_outputs].iter().sum::<f64>() / n_values.max(1) as f64
    }

    /// K of the chain is that of the process times the norm.
    fn profile(&self) -> Profile {
        let (n_samples, n_outputs) = (self.chain.u.len() as f64, self.chain.n_outputs as f64);
        let log_determinant = n_outputs * (self.log_determinant - n_samples * self.norm.ln());
        Profile { n_values: n_samples * n_outputs, variance: self.variance() * self.norm, log_determinant }
    }

    /// The smoother at the end of the path, where only a circle has more to say: ξ − x ~ N(0, P).
    fn smoother(&self) -> Smoother<'_, D> {
        let groups = self.chain.groups();
        let (adjoint, precision) = match &self.closure {
            Some((_, close)) => {
                let last = &self.means[self.chain.u.len() * groups..];
                let gaps =
                    close.first.iter().zip(last).map(|(first, last)| std::array::from_fn(|k| first[k] - last[k]));
                (gaps.map(|gap| product(&close.precision, &gap)).collect(), close.precision)
            }
            None => (vec![[Lanes::ZERO; D]; groups], Square::zeros()),
        };
        Smoother::new(&self.path, &self.steps, adjoint, precision)
    }

    /// The profile and its derivatives.
    ///
    /// With G = Σ rrᵀ/σ̂² − P·N at the sample after a step, the log likelihood changes by ½tr(dP·G) + Σ rᵀdx/σ̂² with
    /// what the step says of that sample: dx = Fx·da, dP = (FM + MFᵀ + qqᵀ)·da, M = P − Q; and with the noise by
    /// ½Σα²/σ̂² − P/2·tr K⁻¹, α = K⁻¹f.
    fn slope(&self, progress: &mut Progress) -> Result<(Profile, Slope)> {
        let profile = self.profile();
        if profile.variance == 0.0 {
            return Ok((profile, Slope { pull: [0.0; 2], spread: [0.0; 2] }));
        }
        let (n_outputs, groups) = (self.chain.n_outputs as f64, self.chain.groups());
        let mut smoother = self.smoother();
        let (mut by_length, mut by_noise) = (vec![Lanes::ZERO; groups], vec![Lanes::ZERO; groups]);
        let (mut shared_length, mut shared_noise) = (0.0, 0.0);
        let mut half_rise = Square::zeros();
        for i in (0..self.chain.u.len()).rev() {
            if (i + 1) % PORTION == 0 {
                progress.ask()?;
            }
            let transition = self.path.after(i);
            let covariance = &self.steps.at(i + 1).covariance;
            if i < self.steps.settled() || i + 1 == self.chain.u.len() {
                let moved = drift(&(covariance - transition.noise));
                half_rise = 0.5 * (moved + moved.transpose() + transition.drive * transition.drive.transpose());
            }
            let means = &self.means[(i + 1) * groups..(i + 2) * groups];
            for ((sum, r), x) in by_length.iter_mut().zip(&smoother.adjoint).zip(means) {
                let rise = product(&half_rise, r);
                for k in 0..D {
                    let moved = if k + 1 < D { x[k + 1] - x[k] } else { -x[k] };
                    *sum += r[k] * (moved + rise[k]) * transition.a;
                }
            }
            shared_length += half_rise.dot(&smoother.precision) * transition.a;
            smoother.back(i, &self.means, &self.chain.targets, |group, weight| by_noise[group] += weight * weight);
            shared_noise += smoother.inverse;
        }
        // The directions in which a circle's first state stays uncertain count once an output.
        let total = |sums: &[Lanes], shared: f64| {
            let sums: &[f64] = bytemuck::cast_slice(sums);
            let (outputs, directions) = sums.split_at(self.chain.n_outputs);
            (outputs.iter().sum::<f64>() / self.variance(), n_outputs * (shared - directions.iter().sum::<f64>()))
        };
        let (by_length, by_noise) = (total(&by_length, shared_length), total(&by_noise, shared_noise));
        let mut pull = [-by_length.0, 0.5 * self.noise * by_noise.0];
        let mut spread = [-by_length.1, 0.5 * self.noise * by_noise.1];
        if let Some((turn, _)) = &self.closure {
            // K and ν of the chain are those of the process times the norm, which goes with the length.
            let half = 0.5 * profile.n_values;
            pull[0] += turn.rise * (pull[1] - half);
            spread[0] += turn.rise * (spread[1] - half) - n_outputs * turn.log_determinant::<D>().1;
        }
        Ok((profile, Slope { pull, spread }))
    }

    /// The posterior everywhere.
    fn smooth(mut self, progress: &mut Progress) -> Result<Trajectory<D>> {
        let (n_samples, groups) = (self.chain.u.len(), self.chain.groups());
        let mut adjoints = vec![[Lanes::ZERO; D]; (n_samples + 1) * groups];
        let mut precisions = vec![Square::zeros(); n_samples + 1];
        let mut smoother = self.smoother();
        adjoints[n_samples * groups..].copy_from_slice(&smoother.adjoint);
        precisions[n_samples] = smoother.precision;
        for i in (0..n_samples).rev() {
            if (i + 1) % PORTION == 0 {
                progress.ask()?;
            }
            smoother.back(i, &self.means, &self.chain.targets, |_, _| ());
            adjoints[i * groups..(i + 1) * groups].copy_from_slice(&smoother.adjoint);
            precisions[i] = smoother.precision;
        }
        self.means.truncate(n_samples * groups);
        for i in 0..n_samples {
            let (step, all) = (self.steps.at(i), i * groups..(i + 1) * groups);
            for (x, r) in self.means[all.clone()].iter_mut().zip(&adjoints[all]) {
                let moved = product(&step.covariance, r);
                (0..D).for_each(|k| x[k] += moved[k]);
            }
        }
        Ok(Trajectory {
            circle: self.closure.is_some(),
            rate: self.rate,
            norm: self.norm,
            u: self.chain.u.clone(),
            covariances: self.steps.updated(n_samples, self.noise),
            precisions,
            states: self.means,
            adjoints,
            n_outputs: self.chain.n_outputs,
        })
    }
}
