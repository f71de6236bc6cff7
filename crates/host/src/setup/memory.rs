//! No page fault in a cycle: memory is locked, heap and stacks are touched before the first one.

use super::findings::{Finding, Item, RIGHTS};
use super::priority::{CAP_IPC_LOCK, has_capability};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};

/// How much of the stack is touched before the first cycle.
const STACK_PREFAULT: usize = 256 * 1024;
/// Memory that the allocator gets and keeps from the start.
const HEAP_RESERVE: usize = 4 * 1024 * 1024;
const PAGE: usize = 4096;

/// Locks all memory of the process, now and to come, and has the allocator keep a reserve of it.
pub(super) fn lock() -> Option<Finding> {
    keep_one_heap();
    keep_heap();
    // Huge pages are put together behind a running thread's back, which then faults. No right is needed to go without.
    // SAFETY: PR_SET_THP_DISABLE takes numbers and touches no memory; kernels without it refuse.
    unsafe {
        libc::prctl(
            libc::PR_SET_THP_DISABLE,
            1 as libc::c_ulong,
            0 as libc::c_ulong,
            0 as libc::c_ulong,
            0 as libc::c_ulong,
        )
    };
    // Without the right to lock all of it, MCL_FUTURE would let later allocations fail; so ask first.
    let unlimited = getrlimit(Resource::RLIMIT_MEMLOCK).is_ok_and(|(soft, _)| soft == RLIM_INFINITY);
    let missing = if !unlimited && !has_capability(CAP_IPC_LOCK) {
        Some("memory may not be locked: a page fault can stop a cycle".to_owned())
    } else {
        // Never MCL_ONFAULT: each page would fault once, later, in a cycle.
        let locked = mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE);
        locked.err().map(|errno| format!("memory cannot be locked ({errno})"))
    };
    touch_heap();
    missing.map(|what| Finding::new(Item::Memory, what, RIGHTS))
}

/// One heap for all threads of a process that will lock its memory; to be called before the first thread. A second heap, which
/// the allocator makes when two threads want memory at once, is 64 MB of addresses that count as locked.
pub fn keep_one_heap() {
    #[cfg(target_env = "gnu")]
    // SAFETY: mallopt sets a number of the allocator and touches no memory of ours.
    unsafe {
        libc::mallopt(libc::M_ARENA_MAX, 1);
    }
}

/// Never give memory back and never map per allocation: mapping faults later, and giving back interrupts every core on
/// which the process runs (TLB shoot-down).
#[cfg(target_env = "gnu")]
fn keep_heap() {
    // SAFETY: mallopt sets numbers of the allocator and touches no memory of ours.
    unsafe {
        libc::mallopt(libc::M_TRIM_THRESHOLD, -1);
        libc::mallopt(libc::M_MMAP_MAX, 0);
    }
}

/// The allocator of musl has no such switches: it maps large pieces one by one and gives them back. Locked memory is filled
/// when it is mapped and the real-time threads allocate nothing, so what is left are the interrupts when another thread
/// gives a large piece back.
#[cfg(not(target_env = "gnu"))]
fn keep_heap() {}

/// Has the allocator take its reserve from the kernel, and every page of it filled.
fn touch_heap() {
    let mut reserve = vec![0u8; HEAP_RESERVE];
    reserve.iter_mut().step_by(PAGE).for_each(|octet| *octet = 1);
    std::hint::black_box(&reserve);
}

/// Writes one octet per page of the stack that the thread will use.
#[inline(never)]
pub(super) fn prefault_stack() {
    let mut stack = [0u8; STACK_PREFAULT];
    for page in stack.chunks_mut(PAGE) {
        page[0] = 1;
        std::hint::black_box(&*page);
    }
}
