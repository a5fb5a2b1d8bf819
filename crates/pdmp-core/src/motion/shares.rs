//! Shares of many movements, each advanced by one thread at a time.

use crate::error::Result;
use crate::motion::command::Motion;
use crate::motion::commands::Motions;
use crate::motion::controller::steady::{Rows, SteadyMovements};
use crate::motion::controller::{Controller, Status};
use crate::numerics::pool::{MAX_TASKS, Pool};
use crate::numerics::threads::Threads;

/// Number of shares for each thread: one that the system stops delays the others by little.
const SHARES_PER_THREAD: usize = 4;

/// Steady movements by shares.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    /// Number of movements of a share but the last.
    size: usize,
    shares: Vec<Share>,
    /// Threads, if there are several.
    pool: Option<Pool>,
}

/// Steady movements of a share.
#[derive(Clone, Debug)]
struct Share {
    steady: SteadyMovements,
    /// Memory for the movements that a tick brings to their end.
    ending: Vec<u32>,
}

/// Movements of a share, or all.
pub(super) struct Part<'a> {
    /// Index of the first of them.
    first: usize,
    controllers: &'a mut [Controller],
    statuses: &'a mut [Status],
    mask: Option<&'a [bool]>,
    rows: Rows<'a>,
}

impl<'a> Part<'a> {
    /// Returns all movements, with outputs of their size.
    pub(super) fn new(
        controllers: &'a mut [Controller],
        statuses: &'a mut [Status],
        mask: Option<&'a [bool]>,
        motions: &'a mut Motions,
    ) -> Self {
        let Motions { position, velocity, acceleration } = motions;
        Self { first: 0, controllers, statuses, mask, rows: Rows { position, velocity, acceleration } }
    }

    /// Removes the first `n` movements, or all if there are fewer, and returns them.
    fn split_first(&mut self, n: usize) -> Self {
        let n = n.min(self.controllers.len());
        let primitive = self.controllers[0].primitive();
        let (n_coordinates, n_dofs) = (primitive.n_coordinates(), primitive.n_dofs());
        let first = self.first;
        self.first += n;
        let mask = self.mask.map(|mask| mask.split_at(n));
        self.mask = mask.map(|(_, rest)| rest);
        Self {
            first,
            controllers: split_off(&mut self.controllers, n),
            statuses: split_off(&mut self.statuses, n),
            mask: mask.map(|(first, _)| first),
            rows: Rows {
                position: split_off(&mut self.rows.position, n * n_coordinates),
                velocity: split_off(&mut self.rows.velocity, n * n_dofs),
                acceleration: split_off(&mut self.rows.acceleration, n * n_dofs),
            },
        }
    }
}

/// Removes the first `n` elements and returns them.
fn split_off<'a, T>(slice: &mut &'a mut [T], n: usize) -> &'a mut [T] {
    let (first, rest) = std::mem::take(slice).split_at_mut(n);
    *slice = rest;
    first
}

impl Shares {
    /// Returns shares of `n` movements, none of which is steady.
    pub(super) fn new(controller: &Controller, n: usize, threads: Threads) -> Self {
        let pool = (threads != Threads::ONE).then(|| Pool::new(threads));
        let n_shares = if pool.is_some() { (SHARES_PER_THREAD * threads.get()).min(MAX_TASKS) } else { 1 };
        let size = n.div_ceil(n_shares);
        let of = |first: usize| {
            let n = size.min(n - first);
            Share { steady: SteadyMovements::new(controller, n), ending: Vec::with_capacity(n) }
        };
        Self { size, shares: (0..n).step_by(size).map(of).collect(), pool }
    }

    /// Returns the number of threads.
    pub(super) fn threads(&self) -> Threads {
        self.pool.as_ref().map_or(Threads::ONE, Pool::threads)
    }

    /// Returns the number of steady movements.
    pub(super) fn n_steady(&self) -> usize {
        self.shares.iter().map(|share| share.steady.len()).sum()
    }

    /// Returns whether a movement is steady.
    pub(super) fn holds(&self, b: usize) -> bool {
        self.shares[b / self.size].steady.holds(b % self.size)
    }

    /// Takes a movement over if it is steady.
    pub(super) fn admit(&mut self, b: usize, controller: &Controller) {
        self.shares[b / self.size].steady.admit(b % self.size, controller);
    }

    /// Gives a movement up; [`Self::write`] has the state.
    pub(super) fn release(&mut self, b: usize) {
        self.shares[b / self.size].steady.release(b % self.size);
    }

    /// Writes the state of a movement to its controller.
    pub(super) fn write(&self, b: usize, controller: &mut Controller) {
        self.shares[b / self.size].steady.write(b % self.size, controller);
    }

    /// Advances the selected movements: the steady ones together, the others by `tick`, and writes their motion.
    ///
    /// # Errors
    /// The first error of `tick`, by movements.
    pub(super) fn advance(
        &mut self,
        mut part: Part,
        tick: &(impl Fn(&mut Controller, usize) -> Result<Status> + Sync),
    ) -> Result<()> {
        let Self { size, shares, pool } = self;
        let (Some(pool), 2..) = (pool, shares.len()) else {
            return shares.iter_mut().try_for_each(|share| share.advance(&mut part.split_first(*size), tick));
        };
        let (mut tasks, n) = ([const { None }; MAX_TASKS], shares.len());
        for (task, share) in tasks.iter_mut().zip(shares) {
            *task = Some((share, part.split_first(*size), Ok(())));
        }
        pool.for_each(&mut tasks[..n], &|task| {
            if let Some((share, part, result)) = task {
                *result = share.advance(part, tick);
            }
        });
        tasks.into_iter().flatten().try_for_each(|(_, _, result)| result)
    }
}

impl Share {
    /// Advances the selected movements of this share.
    fn advance(&mut self, part: &mut Part, tick: &impl Fn(&mut Controller, usize) -> Result<Status>) -> Result<()> {
        let Self { steady, ending } = self;
        let Part { first, controllers, statuses, mask, rows } = part;
        ending.clear();
        let any = &controllers[0];
        steady.step(any.primitive(), any.steady_tick(), *mask, rows, ending);
        for place in ending.iter().map(|place| *place as usize) {
            steady.write(place, &mut controllers[place]);
            steady.release(place);
        }
        if steady.len() == controllers.len() {
            return Ok(());
        }
        let (n_coordinates, n_dofs) = (controllers[0].primitive().n_coordinates(), controllers[0].primitive().n_dofs());
        for (place, controller) in controllers.iter_mut().enumerate() {
            if steady.holds(place) || !is_selected(*mask, place) {
                continue;
            }
            statuses[place] = tick(controller, *first + place)?;
            controller.read(&mut Motion {
                position: &mut rows.position[place * n_coordinates..][..n_coordinates],
                velocity: &mut rows.velocity[place * n_dofs..][..n_dofs],
                acceleration: &mut rows.acceleration[place * n_dofs..][..n_dofs],
            });
            steady.admit(place, controller);
        }
        Ok(())
    }
}

/// Returns whether a mask selects a movement.
pub(super) fn is_selected(mask: Option<&[bool]>, b: usize) -> bool {
    mask.is_none_or(|mask| mask[b])
}
