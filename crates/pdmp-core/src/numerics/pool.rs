//! Threads that wait for work between the ticks of a control loop.
//!
//! A job is a number of tasks that threads claim one by one, the calling one among them. A call waits for claimed tasks only: if
//! the others do not run, as on a busy machine or in the child of a fork, the calling thread performs all tasks. Nothing is locked
//! or allocated. A thread without work spins for [`SPIN_TIME`] and then sleeps; the next call wakes it, by a system call.
#![allow(unsafe_code)]

use std::cell::UnsafeCell;
use std::fmt;
use std::hint::spin_loop;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::*};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::numerics::threads::Threads;

/// Maximum number of tasks of a job.
pub(crate) const MAX_TASKS: usize = 64;
/// Time for which a thread without work spins before it sleeps: longer than the work between two ticks of a loop that does not
/// wait. To wake a thread takes as long, on a virtual machine more.
const SPIN_TIME: Duration = Duration::from_micros(50);
/// Number of spins between two readings of the time.
const SPINS: u32 = 32;
/// Bits of the number of tasks, and of the next one.
const BITS: u32 = 16;

/// Threads that perform tasks with the calling one.
pub(crate) struct Pool {
    shared: Arc<Shared>,
    workers: Vec<JoinHandle<()>>,
    threads: Threads,
    /// Process of the threads, which a fork does not copy.
    process: u32,
}

/// State that all threads share.
struct Shared {
    /// Number of the job, of its tasks and of those claimed: 32, 16 and 16 bits.
    claims: AtomicU64,
    job: UnsafeCell<Job>,
    n_done: AtomicUsize,
    has_panicked: AtomicBool,
    is_closed: AtomicBool,
    is_asleep: Vec<AtomicBool>,
}

// SAFETY: `job` is written by `Pool::for_each` alone, while no task is claimed, and read by threads that have claimed a task.
unsafe impl Sync for Shared {}
// SAFETY: as above; its pointer is that to a value whose use by other threads `Pool::for_each` permits.
unsafe impl Send for Shared {}

/// Function of the index of a task, and its data.
#[derive(Clone, Copy)]
struct Job {
    call: unsafe fn(*const (), usize),
    data: *const (),
}

/// Tasks and the work of a call of [`Pool::for_each`].
struct Tasks<'a, T, F> {
    first: *mut T,
    work: &'a F,
}

/// Performs a task.
///
/// # Safety
/// `data` points to `Tasks<T, F>` with more than `index` tasks, of which no other thread has this one.
unsafe fn perform<T, F: Fn(&mut T)>(data: *const (), index: usize) {
    // SAFETY: by the contract of this function.
    let tasks = unsafe { &*data.cast::<Tasks<T, F>>() };
    // SAFETY: as above.
    (tasks.work)(unsafe { &mut *tasks.first.add(index) });
}

impl Shared {
    /// Claims the next task, and returns its index.
    fn claim(&self) -> Option<usize> {
        let mut claims = self.claims.load(Acquire);
        while is_open(claims) {
            match self.claims.compare_exchange_weak(claims, claims + 1, AcqRel, Acquire) {
                Ok(claims) => return Some((claims & ((1 << BITS) - 1)) as usize),
                Err(present) => claims = present,
            }
        }
        None
    }

    /// Performs tasks until none is left.
    fn perform(&self) {
        while let Some(index) = self.claim() {
            // SAFETY: the task is claimed, so that the job lasts until it is done, and no other thread has it.
            let performed = catch_unwind(AssertUnwindSafe(|| unsafe {
                let Job { call, data } = *self.job.get();
                call(data, index);
            }));
            if performed.is_err() {
                self.has_panicked.store(true, Relaxed);
            }
            self.n_done.fetch_add(1, Release);
        }
    }

    /// Performs tasks of all jobs until the pool is closed.
    fn serve(&self, worker: usize) {
        loop {
            self.perform();
            if !spin_until(|| self.has_news(Relaxed)) {
                self.is_asleep[worker].store(true, SeqCst);
                while self.is_asleep[worker].load(SeqCst) && !self.has_news(SeqCst) {
                    thread::park();
                }
                self.is_asleep[worker].store(false, SeqCst);
            }
            if self.is_closed.load(Acquire) {
                return;
            }
        }
    }

    /// Returns whether there is a task or the pool is closed.
    fn has_news(&self, order: std::sync::atomic::Ordering) -> bool {
        is_open(self.claims.load(order)) || self.is_closed.load(order)
    }
}

/// Waits for a condition, up to [`SPIN_TIME`], and returns whether it holds.
fn spin_until(condition: impl Fn() -> bool) -> bool {
    let begin = Instant::now();
    loop {
        for _ in 0..SPINS {
            if condition() {
                return true;
            }
            spin_loop();
        }
        if begin.elapsed() > SPIN_TIME {
            return false;
        }
    }
}

/// Returns whether a task is unclaimed.
fn is_open(claims: u64) -> bool {
    let mask = (1 << BITS) - 1;
    claims & mask < claims >> BITS & mask
}

impl Pool {
    /// Starts the threads besides the calling one, fewer if the system refuses one.
    pub(crate) fn new(threads: Threads) -> Self {
        let shared = Arc::new(Shared {
            claims: AtomicU64::new(0),
            job: UnsafeCell::new(Job { call: |_, _| {}, data: std::ptr::null() }),
            n_done: AtomicUsize::new(0),
            has_panicked: AtomicBool::new(false),
            is_closed: AtomicBool::new(false),
            is_asleep: (1..threads.get()).map(|_| AtomicBool::new(false)).collect(),
        });
        let start = |worker| {
            let shared = Arc::clone(&shared);
            thread::Builder::new().name("pdmp".to_string()).spawn(move || shared.serve(worker)).ok()
        };
        let workers = (0..threads.get() - 1).map_while(start).collect();
        Self { shared, workers, threads, process: process::id() }
    }

    /// Returns the number of threads, with the calling one.
    pub(crate) fn threads(&self) -> Threads {
        self.threads
    }

    /// Calls `work` with every task, [`MAX_TASKS`] at most, and returns when all are done.
    ///
    /// # Panics
    /// More tasks, or `work` panics.
    pub(crate) fn for_each<T: Send, F: Fn(&mut T) + Sync>(&mut self, tasks: &mut [T], work: &F) {
        assert!(tasks.len() <= MAX_TASKS);
        let shared = &*self.shared;
        let data = Tasks { first: tasks.as_mut_ptr(), work };
        // SAFETY: all tasks of earlier calls are done, so that no thread reads the job. `data` and the tasks outlive this call,
        // which returns when all tasks are done. They may be used by other threads, since T is Send and F is Sync.
        unsafe { *shared.job.get() = Job { call: perform::<T, F>, data: std::ptr::from_ref(&data).cast() } };
        shared.n_done.store(0, Relaxed);
        let number = (shared.claims.load(Relaxed) >> (2 * BITS)).wrapping_add(1);
        shared.claims.store(number << (2 * BITS) | (tasks.len() as u64) << BITS, SeqCst);
        for (worker, is_asleep) in self.workers.iter().zip(&shared.is_asleep) {
            if is_asleep.load(SeqCst) && is_asleep.swap(false, SeqCst) {
                worker.thread().unpark();
            }
        }
        shared.perform();
        while !spin_until(|| shared.n_done.load(Acquire) == tasks.len()) {
            thread::yield_now();
        }
        if shared.has_panicked.swap(false, Relaxed) {
            resume_unwind(Box::new("a task of a pool panicked"));
        }
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.shared.is_closed.store(true, SeqCst);
        let are_here = self.process == process::id();
        for worker in self.workers.drain(..) {
            if are_here {
                worker.thread().unpark();
                // A thread that panicked has ended as well.
                let _ = worker.join();
            } else {
                std::mem::forget(worker);
            }
        }
    }
}

impl Clone for Pool {
    /// Returns a pool with the same number of threads, of its own.
    fn clone(&self) -> Self {
        Self::new(self.threads)
    }
}

impl fmt::Debug for Pool {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Pool({})", self.threads.get())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every task of many jobs is performed once, whether threads spin or sleep between the jobs.
    #[test]
    fn every_task_is_performed_once() {
        for n in [1, 2, 5] {
            let mut pool = Pool::new(Threads::new(n).unwrap());
            for job in 0..2000 {
                let mut tasks = vec![0; job % (MAX_TASKS + 1)];
                pool.for_each(&mut tasks, &|task| *task += job);
                assert!(tasks.iter().all(|task| *task == job));
                if job % 200 == 0 {
                    thread::sleep(std::time::Duration::from_millis(1));
                }
            }
        }
    }

    /// A panic of a task reaches the caller after all other tasks, and leaves the pool usable.
    #[test]
    fn panics_reach_the_caller() {
        let mut pool = Pool::new(Threads::new(3).unwrap());
        let mut tasks = [0; 20];
        let panicking = |task: &mut usize| {
            *task += 1;
            assert!(*task > 1, "on purpose");
        };
        assert!(catch_unwind(AssertUnwindSafe(|| pool.for_each(&mut tasks, &panicking))).is_err());
        assert_eq!(tasks, [1; 20]);
        pool.for_each(&mut tasks, &panicking);
        assert_eq!(tasks, [2; 20]);
    }

    /// Pools end with their threads, and clones have threads of their own.
    #[test]
    fn pools_are_dropped_and_cloned() {
        for _ in 0..50 {
            let pool = Pool::new(Threads::new(4).unwrap());
            let (shared, mut other) = (Arc::downgrade(&pool.shared), pool.clone());
            drop(pool);
            assert!(shared.upgrade().is_none(), "a thread still runs");
            let mut tasks = [1; 7];
            other.for_each(&mut tasks, &|task| *task *= 2);
            assert_eq!((tasks, other.threads().get()), ([2; 7], 4));
        }
    }
}
