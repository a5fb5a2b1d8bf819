//! Independent work on several threads.
//!
//! Threads live for one call. A pool that outlives the call would be dead in a forked process, as Python's
//! multiprocessing makes them, and whoever waits for it there would wait forever.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;

use crate::error::{Error, Result};

/// Most threads that can be asked for.
const MOST: usize = 1024;

/// How many threads may work at once. The result never depends on it, to the last bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threads(NonZeroUsize);

impl Threads {
    /// The calling thread alone.
    pub const ONE: Self = Self(NonZeroUsize::MIN);

    /// So many threads, the calling one among them.
    ///
    /// # Errors
    /// None, or more than 1024.
    pub fn new(n: usize) -> Result<Self> {
        NonZeroUsize::new(n).filter(|n| n.get() <= MOST).map(Self).ok_or(Error::Range {
            name: "threads",
            value: n as f64,
            allowed: "must lie between 1 and 1024",
        })
    }

    /// As many as the system lets this process run at once.
    pub fn available() -> Self {
        thread::available_parallelism().map_or(Self::ONE, |n| Self(n.min(NonZeroUsize::new(MOST).unwrap_or(n))))
    }

    /// How many.
    pub fn get(self) -> usize {
        self.0.get()
    }

    /// Does `work` on every item; whoever is free takes the next one.
    ///
    /// # Errors
    /// That of the first item that has one; what comes after it may be left undone.
    pub(crate) fn try_for_each<T: Send>(self, items: Vec<T>, work: impl Fn(T) -> Result<()> + Sync) -> Result<()> {
        self.try_for_each_told(items, || (), |(), item| work(item), &mut |_| Ok(()))
    }

    /// [`Self::try_for_each`] that asks `progress` whether to go on, with the share of the items that have been taken.
    /// The calling thread asks, which alone may: at first, and before each item of its own. It also makes the `scratch`
    /// of each thread beforehand: the system takes back the memory of threads that end, and is slow to give it again.
    ///
    /// # Errors
    /// Whatever `progress` returns; otherwise that of the first item that has one.
    pub(crate) fn try_for_each_told<T: Send, S: Send>(
        self,
        items: Vec<T>,
        scratch: impl Fn() -> S,
        work: impl Fn(&mut S, T) -> Result<()> + Sync,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<()> {
        // Asked once at least, also where others are quick to take all that there is.
        progress(0.0)?;
        let n_items = items.len();
        let others = self.get().min(n_items).saturating_sub(1);
        let queue = Mutex::new(items.into_iter().enumerate());
        let failed: Mutex<Option<(usize, Error)>> = Mutex::new(None);
        let stopped = AtomicBool::new(false);
        // Works on the next item, if there is one and the work goes on.
        let labour = |scratch: &mut S| {
            if stopped.load(Relaxed) {
                return false;
            }
            // In a statement of its own: the queue is free again while the work is done.
            let next = held(&queue).next();
            let Some((index, item)) = next else { return false };
            if let Err(error) = work(scratch, item) {
                stopped.store(true, Relaxed);
                let mut failed = held(&failed);
                if failed.as_ref().is_none_or(|(first, _)| index < *first) {
                    *failed = Some((index, error));
                }
            }
            true
        };
        let told = thread::scope(|scope| {
            let labour = &labour;
            for _ in 0..others {
                let mut scratch = scratch();
                // A system without threads to spare leaves the work to those that run.
                let _ = thread::Builder::new().spawn_scoped(scope, move || while labour(&mut scratch) {});
            }
            let mut scratch = scratch();
            loop {
                let left = held(&queue).len();
                if left == 0 {
                    return Ok(());
                }
                let told = progress((n_items - left) as f64 / n_items as f64);
                stopped.fetch_or(told.is_err(), Relaxed);
                if told.is_err() || !labour(&mut scratch) {
                    return told;
                }
            }
        });
        match (told, failed.into_inner().unwrap_or_else(PoisonError::into_inner)) {
            (Ok(()), Some((_, error))) => Err(error),
            (told, _) => told,
        }
    }
}

/// A panic elsewhere is on its way to the caller already.
fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every item is worked on once, whatever the number of threads.
    #[test]
    fn all_items_are_done() {
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

    /// Of several errors the first item's is told, as a single thread would.
    #[test]
    fn the_first_error_is_told() {
        for n in [1, 2, 5] {
            let work = |i: usize| if i % 7 == 6 { Err(Error::Interrupted.in_demo(i)) } else { Ok(()) };
            let error = Threads::new(n).unwrap().try_for_each((0..30).collect(), work).unwrap_err();
            assert!(matches!(error, Error::Demo { demo: 6, .. }), "{error}");
        }
    }

    #[test]
    fn numbers_of_threads_out_of_range_are_refused() {
        for n in [0, 1025, usize::MAX] {
            assert!(matches!(Threads::new(n), Err(Error::Range { name: "threads", .. })));
        }
    }

    /// All that the system lets this process run at once, so that these too can be asked for.
    #[test]
    fn available_threads_are_those_of_the_system() {
        let n = Threads::available().get();
        assert_eq!(n, thread::available_parallelism().map_or(1, |n| n.get().min(1024)));
        assert_eq!(Threads::new(n).unwrap().get(), n);
    }
}
