//! Steps 1 and 2 of Section 3.2, demonstration by demonstration: aligned, and turned into its target at once, so that the
//! aligned demonstrations never lie in memory together.

use std::f64::consts::TAU;

use ndarray::{Array2, Array3, Axis};

use crate::dynamics::canonical::Canonical;
use crate::dynamics::output_system::{Attractor, Inverse};
use crate::dynamics::transport::Transport;
use crate::error::Result;
use crate::kind::Kind;
use crate::learning::alignment::Aligned;
use crate::learning::transport_profile::{profile_samples, transport_profile};
use crate::numerics::simd::{F64x4, gather, groups, pack, scatter, unpack};
use crate::numerics::spline::Knots;
use crate::numerics::threads::Threads;
use crate::validate::zeros;

/// κ/α_z of a movement that ends all but at rest.
const BRISK: f64 = 4.0;

/// What a fit takes from the demonstrations, one a row.
#[derive(Debug)]
pub(crate) struct Targets {
    /// Targets F (M, C·D), in the unit of each DoF.
    pub(crate) forcing: Array2<f64>,
    /// First samples (M, D).
    pub(crate) starts: Array2<f64>,
    /// Goals (M, D): those given with the demonstrations, otherwise the last samples.
    pub(crate) goals: Array2<f64>,
    /// Means over the phase (M, D), the anchors y_a of cycles.
    pub(crate) anchors: Array2<f64>,
    /// Peak-to-peak ranges (M, D).
    ranges: Array2<f64>,
    /// Largest |y″| and |y′| at the end (M, D), with respect to the clock.
    bends: Array2<f64>,
    ends: Array2<f64>,
    /// Some samples (M, S, D) less the first, from which a transport profile is learnt; none where rhythmic.
    moved: Array3<f64>,
}

/// The rows of one demonstration.
struct Rows<'a> {
    forcing: &'a mut [f64],
    start: &'a mut [f64],
    goal: &'a mut [f64],
    anchor: &'a mut [f64],
    range: &'a mut [f64],
    bend: &'a mut [f64],
    end: &'a mut [f64],
    moved: &'a mut [f64],
}

impl Targets {
    /// The targets of all demonstrations about their goals or anchors; `progress` is told the share that is done.
    ///
    /// # Errors
    /// No memory, or whatever `progress` returns.
    pub(crate) fn of(
        aligned: &Aligned,
        attractor: Attractor,
        canonical: Canonical,
        threads: Threads,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Self> {
        let (n_demos, n_dofs) = (aligned.n_demos(), aligned.demo(0).n_dofs());
        let kept = match canonical.kind() {
            Kind::Discrete => profile_samples(aligned.n_samples).len(),
            Kind::Rhythmic => 0,
        };
        let mut targets = Self {
            forcing: zeros("targets", (n_demos, aligned.n_samples * n_dofs))?,
            starts: Array2::zeros((n_demos, n_dofs)),
            goals: Array2::zeros((n_demos, n_dofs)),
            anchors: Array2::zeros((n_demos, n_dofs)),
            ranges: Array2::zeros((n_demos, n_dofs)),
            bends: Array2::zeros((n_demos, n_dofs)),
            ends: Array2::zeros((n_demos, n_dofs)),
            moved: Array3::zeros((n_demos, kept, n_dofs)),
        };
        let work = Work::new(attractor, canonical, aligned.n_samples);
        let columns = || [0, 1].map(|_| vec![F64x4::ZERO; aligned.n_samples]);
        let learn = |columns: &mut [Vec<F64x4>; 2], (m, rows): (usize, Rows)| {
            aligned.sample(m, rows.forcing);
            work.learn(rows, aligned.demo(m).goal(), columns);
            Ok(())
        };
        threads.try_for_each_told(targets.rows().enumerate().collect(), columns, learn, progress)?;
        Ok(targets)
    }

    /// Largest peak-to-peak range of each DoF within one demonstration (D,).
    pub(crate) fn ranges(&self) -> Vec<f64> {
        self.ranges.fold_axis(Axis(0), 0.0f64, |most, range| most.max(*range)).to_vec()
    }

    /// Learns the transport profile of the movements, whose DoFs are comparable in the given units (D,).
    ///
    /// # Errors
    /// None for a canonical system of discrete movements.
    pub(crate) fn transport(&mut self, canonical: Canonical, unit: &[f64]) -> Result<Transport> {
        let mut moved = std::mem::take(&mut self.moved);
        let mut ways = &self.goals - &self.starts;
        moved.iter_mut().zip(unit.iter().cycle()).for_each(|(x, unit)| *x /= unit);
        ways.iter_mut().zip(unit.iter().cycle()).for_each(|(x, unit)| *x /= unit);
        transport_profile(moved, ways, canonical)
    }

    /// The rate κ at which movements brake past their ends: y″ = −κy′ there is to be no harder than the hardest acceleration
    /// demonstrated of the DoF, as long as κ is at least α_z, and four times that where nothing needs to brake.
    pub(crate) fn braking(&self, attractor: Attractor) -> f64 {
        let most = |matrix: &Array2<f64>| matrix.fold_axis(Axis(0), 0.0f64, |most, x| most.max(*x));
        let ratio = |(bend, end): (f64, f64)| if end > 0.0 { bend / end } else { f64::INFINITY };
        let hardest = most(&self.bends).into_iter().zip(most(&self.ends)).map(ratio).fold(f64::INFINITY, f64::min);
        hardest.clamp(attractor.alpha_z, BRISK * attractor.alpha_z)
    }

    /// Makes the targets those about the moving frame, f = y′ − c′ − z with z driven by y − c.
    ///
    /// A target is linear in its movement: that of (g − y₀)ℓ, read from the same spline, is taken away.
    pub(crate) fn carry(&mut self, transport: &Transport, attractor: Attractor, canonical: Canonical) {
        if transport.is_immediate() {
            return;
        }
        let n_dofs = self.starts.ncols();
        let work = Work::new(attractor, canonical, self.forcing.ncols() / n_dofs);
        let mut lag: Vec<f64> = work.clock.iter().map(|&u| transport.lag(u).value).collect();
        let mut slopes = vec![0.0; lag.len()];
        work.knots.slopes(&lag, &mut slopes);
        work.inverse.target(&mut lag, &slopes, 0.0, false);
        let rows = self.forcing.rows_mut().into_iter().zip(self.goals.rows()).zip(self.starts.rows());
        for ((mut row, goal), start) in rows {
            let way = &goal - &start;
            let samples = crate::validate::row_major_mut(&mut row).chunks_exact_mut(n_dofs);
            for (forcing, lag) in samples.zip(&lag) {
                forcing.iter_mut().zip(&way).for_each(|(f, way)| *f -= way * lag);
            }
        }
    }

    /// Counts the targets in the given unit of each DoF.
    pub(crate) fn scale(&mut self, dof_scale: &[f64]) {
        if dof_scale.iter().any(|&scale| scale != 1.0) {
            self.forcing.iter_mut().zip(dof_scale.iter().cycle()).for_each(|(f, scale)| *f /= scale);
        }
    }

    fn rows(&mut self) -> impl Iterator<Item = Rows<'_>> {
        let n_dofs = self.starts.ncols();
        let n_values = self.forcing.ncols();
        fn chunks(matrix: &mut Array2<f64>, n: usize) -> std::slice::ChunksExactMut<'_, f64> {
            crate::validate::row_major_mut(matrix).chunks_exact_mut(n)
        }
        let [starts, goals, anchors, ranges] = [&mut self.starts, &mut self.goals, &mut self.anchors, &mut self.ranges]
            .map(|matrix| chunks(matrix, n_dofs));
        let [bends, ends] = [&mut self.bends, &mut self.ends].map(|matrix| chunks(matrix, n_dofs));
        let places = starts.zip(goals).zip(anchors.zip(ranges)).zip(bends.zip(ends));
        let moved = self
            .moved
            .outer_iter_mut()
            .map(|moved| moved.into_slice().expect("blocks of a row-major array are contiguous"));
        chunks(&mut self.forcing, n_values).zip(places).zip(moved).map(
            |((forcing, (((start, goal), (anchor, range)), (bend, end))), moved)| Rows {
                forcing,
                start,
                goal,
                anchor,
                range,
                bend,
                end,
                moved,
            },
        )
    }
}

/// What all demonstrations have in common.
struct Work {
    kind: Kind,
    clock: Vec<f64>,
    inverse: Inverse,
    knots: Knots,
}

impl Work {
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

    /// Fills the rows of a demonstration whose positions stand in the place of its target.
    ///
    /// The output system does not care where a movement takes place, but for rounding: demonstrations are translated to
    /// start at 0, and a DoF that does not move has a target of exactly zero, and its own position as its mean, to the
    /// last digit.
    fn learn(&self, rows: Rows, given: Option<&[f64]>, [column, slopes]: &mut [Vec<F64x4>; 2]) {
        let Rows { forcing: position, start, goal, anchor, range, bend, end, moved } = rows;
        let n_dofs = start.len();
        start.copy_from_slice(&position[..n_dofs]);
        for (moved, c) in moved.chunks_exact_mut(n_dofs).zip(profile_samples(column.len())) {
            let sample = &position[c * n_dofs..];
            moved.iter_mut().zip(sample).zip(&*start).for_each(|((moved, y), start)| *moved = y - start);
        }
        goal.copy_from_slice(given.unwrap_or(&position[position.len() - n_dofs..]));
        let n_samples = F64x4::splat(column.len() as f64);
        let goals = pack(goal);
        let [mut means, mut ranges, mut bends, mut ends] = [(); 4].map(|()| vec![F64x4::ZERO; goals.len()]);
        let per_step = 1.0 / self.clock[1];
        for group in 0..groups(n_dofs) {
            gather(position, n_dofs, group, column);
            let start = column[0];
            let [mut low, mut high, mut sum] = [F64x4::ZERO; 3];
            for y in column.iter_mut() {
                *y -= start;
                (low, high, sum) = (low.fast_min(*y), high.fast_max(*y), sum + *y);
            }
            (means[group], ranges[group]) = (start + sum / n_samples, high - low);
            let centre = if self.kind == Kind::Discrete { goals[group] } else { means[group] };
            self.knots.slopes(column, slopes);
            let bend = |pair: &[F64x4]| (pair[1] - pair[0]).abs() * per_step;
            bends[group] = slopes.windows(2).fold(F64x4::ZERO, |most, pair| most.fast_max(bend(pair)));
            ends[group] = slopes[slopes.len() - 1].abs();
            self.inverse.target(column, slopes, centre - start, self.kind == Kind::Rhythmic);
            scatter(column, n_dofs, group, position);
        }
        anchor.copy_from_slice(unpack(&means, n_dofs));
        range.copy_from_slice(unpack(&ranges, n_dofs));
        bend.copy_from_slice(unpack(&bends, n_dofs));
        end.copy_from_slice(unpack(&ends, n_dofs));
    }
}
