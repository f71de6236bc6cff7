//! A file that somebody cuts short while it is mapped: whoever touches what was behind its new end gets SIGBUS, which ends the
//! process, in mid cut for a control.
//!
//! In:  the memory of every file that is mapped, and the file.
//! Out: the file is as long as before, with zeros in place of what is gone; and that it is so. The control comes to rest in its
//! own way.
//!
//! Memory could not be put in its place: once rights are given up, none may be locked any more, and all new memory would be.

use memmap2::MmapRaw;
use std::fs::File;
use std::mem::zeroed;
use std::os::fd::AsRawFd;
use std::ptr::{null, null_mut};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, AtomicUsize, Ordering};

/// Files that can be mapped and watched over at a time; those beyond are mapped all the same.
const REGIONS: usize = 64;
/// Faults after which nothing helps: where there is no room for its pages, a file that is long enough is none.
const FAULTS_MAX: u32 = 1000;

/// Memory of a file. `len` 0: free; [`CLAIMED`]: being filled in.
struct Region {
    start: AtomicUsize,
    len: AtomicUsize,
    file: AtomicI32,
    faults: AtomicU32,
    lost: AtomicBool,
}

const CLAIMED: usize = usize::MAX;

static WATCHED: [Region; REGIONS] = [const {
    Region {
        start: AtomicUsize::new(0),
        len: AtomicUsize::new(0),
        file: AtomicI32::new(-1),
        faults: AtomicU32::new(0),
        lost: AtomicBool::new(false),
    }
}; REGIONS];

/// What was done with the signal before.
static BEFORE: OnceLock<libc::sigaction> = OnceLock::new();

/// Watches over the memory of a file until it is dropped; drop it before the memory is unmapped.
#[derive(Debug)]
pub(crate) struct Guard(Option<(usize, File)>);

impl Guard {
    /// Where the system has no file to spare, nothing is watched over.
    pub(crate) fn new(map: &MmapRaw, file: &File) -> Guard {
        install();
        // Its own: the memory may be used for longer than the file is open elsewhere.
        let Ok(file) = file.try_clone() else { return Guard(None) };
        let free = WATCHED.iter().position(|region| {
            let claim = region
                .len
                .compare_exchange(0, CLAIMED, Ordering::AcqRel, Ordering::Relaxed);
            claim.is_ok()
        });
        if let Some(region) = free.map(|at| &WATCHED[at]) {
            region.lost.store(false, Ordering::Relaxed);
            region.faults.store(0, Ordering::Relaxed);
            region.file.store(file.as_raw_fd(), Ordering::Relaxed);
            region.start.store(map.as_mut_ptr() as usize, Ordering::Relaxed);
            region.len.store(map.len(), Ordering::Release);
        }
        Guard(free.map(|at| (at, file)))
    }

    /// RT: whether part of the file is gone.
    pub(crate) fn is_lost(&self) -> bool {
        let watched = self.0.as_ref().map(|(at, _)| &WATCHED[*at]);
        watched.is_some_and(|region| region.lost.load(Ordering::Acquire))
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        if let Some((at, _)) = &self.0 {
            WATCHED[*at].len.store(0, Ordering::Release);
        }
    }
}

/// Takes the signal over, once; a refusal leaves things as they were.
fn install() {
    BEFORE.get_or_init(|| {
        // SAFETY: an action of zeros is a valid one.
        let (mut ours, mut before): (libc::sigaction, libc::sigaction) = unsafe { (zeroed(), zeroed()) };
        ours.sa_sigaction = on_sigbus as *const () as usize;
        ours.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
        // SAFETY: both actions live through the call; the handler does only what a handler may.
        unsafe { libc::sigaction(libc::SIGBUS, &raw const ours, &raw mut before) };
        before
    });
}

/// Makes the file long enough again, and lets the thread go on; what is no memory of ours is not ours to say.
extern "C" fn on_sigbus(_signal: libc::c_int, info: *mut libc::siginfo_t, _context: *mut libc::c_void) {
    // SAFETY: the kernel hands over what it knows of the signal.
    let address = unsafe { (*info).si_addr() } as usize;
    for region in &WATCHED {
        let len = region.len.load(Ordering::Acquire);
        let start = region.start.load(Ordering::Relaxed);
        if len == CLAIMED || !(start..start.saturating_add(len)).contains(&address) {
            continue;
        }
        let faults = region.faults.fetch_add(1, Ordering::Relaxed);
        // SAFETY: takes two numbers, and may be called by a handler; the region holds the file open.
        let long_again = unsafe { libc::ftruncate(region.file.load(Ordering::Relaxed), len as libc::off_t) } == 0;
        if long_again && faults < FAULTS_MAX {
            region.lost.store(true, Ordering::Release);
            return;
        }
    }
    // As it was: the thread meets the same fault again.
    let before = BEFORE.get().map_or(null(), |before| before as *const libc::sigaction);
    // SAFETY: the action was given by the system; without one the call changes nothing.
    unsafe { libc::sigaction(libc::SIGBUS, before, null_mut()) };
}
