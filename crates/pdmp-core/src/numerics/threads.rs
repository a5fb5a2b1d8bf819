//! Parallel execution of independent tasks.
//!
//! Threads live for one call. The threads of a global pool do not survive a fork, as by Python's multiprocessing: a call in
//! the child process would wait for them forever.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;

use crate::error::{Error, Result};

/// Maximum number of threads: more than the cores of one machine, and few enough to catch a mistaken argument.
const MAX_THREADS: usize = 1024;

/// Number of threads of a call. Results do not depend on it, to the last bit.
///
/// ```
/// use pdmp_core::numerics::Threads;
///
/// assert_eq!(Threads::new(4)?.get(), 4);
/// assert!(Threads::new(0).is_err());
/// # Ok::<(), pdmp_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threads(NonZeroUsize);

impl Threads {
    /// The calling thread alone.
    pub const ONE: Self = Self(NonZeroUsize::MIN);

    /// Returns a number of threads, which includes the calling thread.
    ///
    /// # Errors
    /// A number outside 1 to 1024.
    pub fn new(n: usize) -> Result<Self> {
        let allowed = "must lie between 1 and 1024";
        let threads = NonZeroUsize::new(n).filter(|n| n.get() <= MAX_THREADS).map(Self);
        threads.ok_or(Error::Range { name: "threads", value: n as f64, allowed })
    }

    /// Returns the number of threads that the system runs in parallel for this process.
    pub fn available() -> Self {
        thread::available_parallelism().map_or(Self::ONE, |n| Self(n.min(NonZeroUsize::new(MAX_THREADS).unwrap_or(n))))
    }

    /// Returns the number.
    pub fn get(self) -> usize {
        self.0.get()
    }

    /// Calls `work` with every item; an idle thread takes the next item from a queue.
    ///
    /// # Errors
    /// The error of the first item that has one, by position; later items may remain unprocessed.
    pub(crate) fn try_for_each<T: Send>(self, items: Vec<T>, work: impl Fn(T) -> Result<()> + Sync) -> Result<()> {
        self.try_for_each_with_progress(items, || (), |(), item| work(item), &mut |_| Ok(()))
    }

    /// Calls `work` with every item and the `scratch` memory of the thread, as [`Self::try_for_each`] does, and reports
    /// progress.
    ///
    /// `progress` is called with the fraction of the items that have been taken; an error it returns cancels the call. Only
    /// the calling thread calls it, once at the start and before each item that this thread takes. The calling thread also
    /// allocates all scratch memory: the allocator returns the memory of a finished thread to the system, and allocating
    /// it again is slow.
    ///
    /// # Errors
    /// The error of `progress`; otherwise the error of the first item that has one, by position.
    pub(crate) fn try_for_each_with_progress<T: Send, S: Send>(
        self,
        items: Vec<T>,
        scratch: impl Fn() -> S,
        work: impl Fn(&mut S, T) -> Result<()> + Sync,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<()> {
        // At least one call, even if other threads take all items before this one does.
        progress(0.0)?;
        let n_items = items.len();
        let n_spawned = self.get().min(n_items).saturating_sub(1);
        let queue = Mutex::new(items.into_iter().enumerate());
        let first_failure: Mutex<Option<(usize, Error)>> = Mutex::new(None);
        let stopped = AtomicBool::new(false);
        // Processes the next item; false if there is none or the call is stopped.
        let process_next = |scratch: &mut S| {
            if stopped.load(Relaxed) {
                return false;
            }
            // The guard must be dropped before the work, or other threads would wait for it.
            let next = lock(&queue).next();
            let Some((index, item)) = next else { return false };
            if let Err(error) = work(scratch, item) {
                stopped.store(true, Relaxed);
                let mut first_failure = lock(&first_failure);
                if first_failure.as_ref().is_none_or(|(first, _)| index < *first) {
                    *first_failure = Some((index, error));
                }
            }
            true
        };
        let reported = thread::scope(|scope| {
            let process_next = &process_next;
            for _ in 0..n_spawned {
                let mut scratch = scratch();
                // If the system cannot spawn a thread, the running ones process its share.
                let _ = thread::Builder::new().spawn_scoped(scope, move || while process_next(&mut scratch) {});
            }
            let mut scratch = scratch();
            loop {
                let n_remaining = lock(&queue).len();
                if n_remaining == 0 {
                    return Ok(());
                }
                let reported = progress((n_items - n_remaining) as f64 / n_items as f64);
                stopped.fetch_or(reported.is_err(), Relaxed);
                if reported.is_err() || !process_next(&mut scratch) {
                    return reported;
                }
            }
        });
        match (reported, first_failure.into_inner().unwrap_or_else(PoisonError::into_inner)) {
            (Ok(()), Some((_, error))) => Err(error),
            (reported, _) => reported,
        }
    }
}

/// Locks a mutex. Poison is ignored: [`thread::scope`] passes the panic of a thread on to the caller.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every item is processed once, for any number of threads.
    #[test]
    fn every_item_is_processed_once() {
        for n in [1, 2, 3, 7, 40] {
            for n_items in [0, 1, 2, 6, 7, 8, 30] {
                let mut done = vec![0; n_items];
                let items: Vec<(usize, &mut usize)> = done.iter_mut().enumerate().collect();
                let work = |(i, item): (usize, &mut usize)| {
                    *item += i + 1;
                    Ok(())
                };
                Threads::new(n).unwrap().try_for_each(items, work).unwrap();
                assert!(done.iter().enumerate().all(|(i, &item)| item == i + 1));
            }
        }
    }

    /// Of several errors that of the first item is returned, as by a single thread.
    #[test]
    fn the_error_of_the_first_item_is_returned() {
        for n in [1, 2, 5] {
            let work = |i: usize| if i % 7 == 6 { Err(Error::Interrupted.in_demo(i)) } else { Ok(()) };
            let error = Threads::new(n).unwrap().try_for_each((0..30).collect(), work).unwrap_err();
            assert!(matches!(error, Error::Demo { demo: 6, .. }), "{error}");
        }
    }

    #[test]
    fn numbers_of_threads_out_of_range_are_rejected() {
        for n in [0, 1025, usize::MAX] {
            assert!(matches!(Threads::new(n), Err(Error::Range { name: "threads", .. })));
        }
    }

    /// The number of available threads is that of the system, up to the maximum, and can be requested.
    #[test]
    fn available_threads_are_those_of_the_system() {
        let n = Threads::available().get();
        assert_eq!(n, thread::available_parallelism().map_or(1, |n| n.get().min(1024)));
        assert_eq!(Threads::new(n).unwrap().get(), n);
    }
}
