//! A counting allocator in front of the system's: what a thread asks of it while it is told to count. For tests that prove that
//! something asks nothing; each includes this file by its path.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Whether this thread counts now.
    pub(crate) static COUNTING: Cell<bool> = const { Cell::new(false) };
    /// Calls of the allocator, frees included, that this thread has counted.
    pub(crate) static CALLS: Cell<u64> = const { Cell::new(0) };
}

/// Counts what asks the system's allocator for something or gives it back.
struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn count() {
    if COUNTING.get() {
        CALLS.set(CALLS.get() + 1);
    }
}

// SAFETY: every call goes to the system's allocator as it came; counting touches two cells that need no allocation.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of this very method.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of this very method.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of this very method.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller keeps the contract of this very method.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Calls of the allocator, frees included, while `work` runs.
#[allow(dead_code)] // some count in pieces
pub(crate) fn calls(work: impl FnOnce()) -> u64 {
    CALLS.set(0);
    COUNTING.set(true);
    work();
    COUNTING.set(false);
    CALLS.get()
}

/// Runs `work` without counting.
#[allow(dead_code)] // not every test has such
pub(crate) fn aside<T>(work: impl FnOnce() -> T) -> T {
    let counting = COUNTING.replace(false);
    let done = work();
    COUNTING.set(counting);
    done
}
