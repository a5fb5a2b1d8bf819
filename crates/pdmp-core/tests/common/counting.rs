//! Allocation counter and allocation-free random numbers for tests of the control loop.
#![allow(dead_code, missing_docs, unsafe_code)]

mod random;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

pub(crate) use random::Random;

/// Allocator of the system that counts the allocations of each thread.
struct Counting;

thread_local! {
    /// Count per thread, because tests run in parallel.
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is forwarded unchanged to `System`, whose contract is that of `GlobalAlloc`. The counter is a constant
// initialised thread-local without a destructor, so that counting neither allocates nor unwinds.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller guarantees a layout of non-zero size.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller guarantees that `alloc`, hence `System`, returned the pointer for this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Returns the number of allocations of this thread.
pub(crate) fn allocations() -> usize {
    ALLOCATIONS.get()
}
