//! Targets of the demonstrations (step 2 of Section 3.2).
//!
//! Each demonstration is resampled and converted to its target in one go, so that the aligned positions of all
//! demonstrations are never in memory together.

use std::f64::consts::TAU;

use ndarray::{Array2, Array3, ArrayViewMut1, ArrayViewMut2, Axis, aview1};

use crate::dynamics::canonical::Canonical;
use crate::dynamics::output_system::{Attractor, Inverse};
use crate::dynamics::transport::Transport;
use crate::error::Result;
use crate::kind::Kind;
use crate::learning::alignment::Aligned;
use crate::learning::transport_profile::{ProfileSums, profile_samples, transport_profile};
use crate::numerics::simd::{F64x4, gather, groups, pack, scatter, unpack};
use crate::numerics::spline::Knots;
use crate::numerics::threads::Threads;
use crate::validate::{row_major_mut, zeros};

/// Number of vectors (D,) of each demonstration: start, goal, anchor, range and largest acceleration.
const N_VECTORS: usize = 5;

/// Targets and other quantities that a fit takes from the demonstrations, one row per demonstration.
#[derive(Debug)]
pub(crate) struct Targets {
    /// Targets F (M, C·D), in the unit of each DoF.
    pub(crate) forcing: Array2<f64>,
    /// First samples (M, D).
    pub(crate) starts: Array2<f64>,
    /// Goals (M, D): those of the demonstrations, or the last samples.
    pub(crate) goals: Array2<f64>,
    /// Means over the phase (M, D): the anchors y_a of cycles.
    pub(crate) anchors: Array2<f64>,
    /// Peak-to-peak ranges (M, D).
    ranges: Array2<f64>,
    /// Largest |y″| (M, D) with respect to the clock.
    accelerations: Array2<f64>,
    /// Displacements from the start (M, S, D), from which the transport profile is learnt; empty for rhythmic movements.
    displacements: Array3<f64>,
}

impl Targets {
    /// Computes the targets of all demonstrations about their goals or anchors.
    ///
    /// `progress` is called periodically with the completed fraction.
    ///
    /// # Errors
    /// Too little memory, or the error that `progress` returned.
    pub(crate) fn of(
        aligned: &Aligned,
        attractor: Attractor,
        canonical: Canonical,
        threads: Threads,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Self> {
        let (n_demos, n_dofs) = (aligned.n_demos(), aligned.demo(0).n_dofs());
        let n_profile = match canonical.kind() {
            Kind::Discrete => profile_samples(aligned.n_samples).len(),
            Kind::Rhythmic => 0,
        };
        let mut forcing = zeros("targets", (n_demos, aligned.n_samples * n_dofs))?;
        let mut vectors = Array3::zeros((n_demos, N_VECTORS, n_dofs));
        let mut displacements = Array3::zeros((n_demos, n_profile, n_dofs));
        let inversion = TargetComputation::new(attractor, canonical, aligned.n_samples);
        let columns = || [0, 1].map(|_| vec![F64x4::ZERO; aligned.n_samples]);
        let rows = forcing.rows_mut().into_iter().zip(vectors.outer_iter_mut()).zip(displacements.outer_iter_mut());
        let compute =
            |columns: &mut _, (m, ((mut forcing, vectors), displacement)): (usize, ((ArrayViewMut1<f64>, _), _))| {
                let forcing = row_major_mut(&mut forcing);
                aligned.sample(m, forcing);
                inversion.compute(forcing, vectors, displacement, aligned.demo(m).goal(), columns);
                Ok(())
            };
        threads.try_for_each_with_progress(rows.enumerate().collect(), columns, compute, progress)?;
        let [starts, goals, anchors, ranges, accelerations] =
            std::array::from_fn::<_, N_VECTORS, _>(|k| vectors.index_axis(Axis(1), k).to_owned());
        Ok(Self { forcing, starts, goals, anchors, ranges, accelerations, displacements })
    }

    /// Returns the largest peak-to-peak range of each DoF within one demonstration (D,).
    pub(crate) fn ranges(&self) -> Vec<f64> {
        largest(&self.ranges)
    }

    /// Learns the transport profile of discrete movements, with DoFs scaled by the given units (D,).
    ///
    /// # Errors
    /// A profile that cannot be computed.
    pub(crate) fn transport(&mut self, canonical: Canonical, unit: &[f64]) -> Result<Transport> {
        let mut displacements = std::mem::take(&mut self.displacements);
        let mut reaches = &self.goals - &self.starts;
        displacements.iter_mut().zip(unit.iter().cycle()).for_each(|(x, unit)| *x /= unit);
        reaches.iter_mut().zip(unit.iter().cycle()).for_each(|(x, unit)| *x /= unit);
        transport_profile(displacements, reaches, canonical)
    }

    /// Returns the sums for the transport profile of these movements, with DoFs in the given units (D,).
    pub(crate) fn profile_sums(&self, unit: &[f64]) -> ProfileSums {
        let unit = aview1(unit);
        ProfileSums::of((&self.displacements / &unit).view(), (&self.goals - &self.starts) / unit)
    }

    /// Returns the largest |y″| of each DoF with respect to the clock (D,).
    pub(crate) fn largest_accelerations(&self) -> Vec<f64> {
        largest(&self.accelerations)
    }

    /// Converts the targets to those about the moving frame c, f = y′ − c′ − z with z driven by y − c.
    ///
    /// As a target is linear in its movement, that of (g − y₀)·lag, interpolated by the same spline, is subtracted.
    pub(crate) fn carry(&mut self, transport: &Transport, attractor: Attractor, canonical: Canonical) {
        let n_dofs = self.starts.ncols();
        let Some(lag) = lag_target(transport, attractor, canonical, self.forcing.ncols() / n_dofs) else { return };
        let rows = self.forcing.rows_mut().into_iter().zip(self.goals.rows()).zip(self.starts.rows());
        for ((mut row, goal), start) in rows {
            let reach = &goal - &start;
            let samples = row_major_mut(&mut row).chunks_exact_mut(n_dofs);
            for (forcing, lag) in samples.zip(&lag) {
                forcing.iter_mut().zip(&reach).for_each(|(f, reach)| *f -= reach * lag);
            }
        }
    }

    /// Divides the targets by the scale of each DoF.
    pub(crate) fn scale(&mut self, dof_scale: &[f64]) {
        if dof_scale.iter().any(|&scale| scale != 1.0) {
            self.forcing.iter_mut().zip(dof_scale.iter().cycle()).for_each(|(f, scale)| *f /= scale);
        }
    }
}

/// Returns the target (C,) of the lag of the moving frame; `None` if it does not lag.
pub(crate) fn lag_target(
    transport: &Transport,
    attractor: Attractor,
    canonical: Canonical,
    n_samples: usize,
) -> Option<Vec<f64>> {
    if transport.is_immediate() {
        return None;
    }
    let inversion = TargetComputation::new(attractor, canonical, n_samples);
    let mut lag: Vec<f64> = inversion.clock.iter().map(|&u| transport.lag(u).value).collect();
    let mut slopes = vec![0.0; lag.len()];
    inversion.knots.slopes(&lag, &mut slopes);
    inversion.inverse.target(&mut lag, &slopes, 0.0, false);
    Some(lag)
}

/// Computation of targets, with the quantities that all demonstrations share.
struct TargetComputation {
    kind: Kind,
    clock: Vec<f64>,
    inverse: Inverse,
    knots: Knots,
}

impl TargetComputation {
    fn new(attractor: Attractor, canonical: Canonical, n_samples: usize) -> Self {
        let clock = canonical.clock(n_samples);
        let inverse = attractor.inverse(clock[1]);
        let kind = canonical.kind();
        let knots = match kind {
            Kind::Discrete => Knots::not_a_knot(clock.clone()),
            Kind::Rhythmic => Knots::periodic(clock.clone(), TAU),
        };
        Self { kind, clock, inverse, knots }
    }

    /// Computes the target, vectors (6, D) and displacements (S, D) of a demonstration.
    ///
    /// `samples` are its positions on entry and its target on return. The output system is invariant to translation, except
    /// for rounding. Demonstrations are therefore translated to start at 0: a DoF at rest has a target of exactly zero, and
    /// its exact position as its mean.
    fn compute(
        &self,
        samples: &mut [f64],
        mut vectors: ArrayViewMut2<f64>,
        mut displacements: ArrayViewMut2<f64>,
        given: Option<&[f64]>,
        [column, slopes]: &mut [Vec<F64x4>; 2],
    ) {
        let n_dofs = vectors.ncols();
        let start = samples[..n_dofs].to_vec();
        for (mut x, c) in displacements.rows_mut().into_iter().zip(profile_samples(column.len())) {
            x.assign(&aview1(&samples[c * n_dofs..][..n_dofs]));
            x -= &aview1(&start);
        }
        let goal = given.unwrap_or(&samples[samples.len() - n_dofs..]).to_vec();
        let n_samples = F64x4::splat(column.len() as f64);
        let goals = pack(&goal);
        let [mut means, mut ranges, mut accelerations] = [(); 3].map(|()| vec![F64x4::ZERO; goals.len()]);
        let per_step = 1.0 / self.clock[1];
        for group in 0..groups(n_dofs) {
            gather(samples, n_dofs, group, column);
            let start = column[0];
            let [mut low, mut high, mut sum] = [F64x4::ZERO; 3];
            for y in column.iter_mut() {
                *y -= start;
                (low, high, sum) = (low.fast_min(*y), high.fast_max(*y), sum + *y);
            }
            (means[group], ranges[group]) = (start + sum / n_samples, high - low);
            let centre = if self.kind == Kind::Discrete { goals[group] } else { means[group] };
            self.knots.slopes(column, slopes);
            let difference = |pair: &[F64x4]| (pair[1] - pair[0]).abs() * per_step;
            accelerations[group] =
                slopes.windows(2).fold(F64x4::ZERO, |largest, pair| largest.fast_max(difference(pair)));
            self.inverse.target(column, slopes, centre - start, self.kind == Kind::Rhythmic);
            scatter(column, n_dofs, group, samples);
        }
        let computed = [&means, &ranges, &accelerations].map(|packed| unpack(packed, n_dofs));
        for (mut row, vector) in vectors.rows_mut().into_iter().zip([&*start, &*goal].into_iter().chain(computed)) {
            row.assign(&aview1(vector));
        }
    }
}

/// Returns the largest element of each column.
fn largest(matrix: &Array2<f64>) -> Vec<f64> {
    matrix.fold_axis(Axis(0), 0.0f64, |largest, x| largest.max(*x)).to_vec()
}
