//! What the process gives back once it runs: capabilities, and the way to gain new ones by starting a program.
//!
//! In:  a thread that has been given all that takes rights: its sockets and files, locked memory, its priority.
//! Out: the same thread without rights. A defect in what reads frames or serves clients can then do no more than an
//!      ordinary program of the same user.
//!
//! Capabilities belong to threads: each thread calls [`give_up`] for itself, and those that it starts inherit what is left.
//! What stays is in the table of [`Work`].

use caps::errors::CapsError;
use caps::{CapSet, Capability, CapsHashSet};
use nix::sys::prctl::set_no_new_privs;
use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit, setrlimit};
use std::io::Write;

/// What a thread does from now on, and so what it keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Real time: allocates nothing, opens nothing. Keeps nothing.
    RealTime,
    /// Anything else beside the cycle. Keeps CAP_IPC_LOCK where memory beyond a limit could not be had without it, because
    /// all memory is locked.
    Ordinary,
    /// The thread that writes the report at the end, and removes the files of the run. As root it keeps CAP_DAC_OVERRIDE in
    /// reserve, for folders that belong to a user; [`use_files`] makes it effective.
    Closing,
}

/// Gives up all rights of the calling thread that `work` does not need, for good. Allocates.
///
/// # Errors
/// If the system refuses, which it does to nobody.
pub fn give_up(work: Work) -> Result<(), CapsError> {
    let held = caps::read(None, CapSet::Permitted)?;
    let only = |wanted: &[Capability]| -> CapsHashSet {
        let wanted = wanted.iter().copied();
        wanted.filter(|capability| held.contains(capability)).collect()
    };
    let memory: &[Capability] = match memory_is_unlimited() {
        true => &[],
        false => &[Capability::CAP_IPC_LOCK],
    };
    let (effective, reserve) = match work {
        Work::RealTime => (only(&[]), only(&[])),
        Work::Ordinary => (only(memory), only(&[])),
        Work::Closing => (only(memory), only(&[Capability::CAP_DAC_OVERRIDE])),
    };
    // The bounding set first: emptying it takes a right itself. The effective set before the permitted one, of which it is
    // a part.
    if caps::has_cap(None, CapSet::Effective, Capability::CAP_SETPCAP)? {
        caps::clear(None, CapSet::Bounding)?;
    }
    // Kernels before 4.3 have no ambient set, and then nothing is in it.
    let _ = caps::clear(None, CapSet::Ambient);
    caps::clear(None, CapSet::Inheritable)?;
    caps::set(None, CapSet::Effective, &effective)?;
    caps::set(None, CapSet::Permitted, &effective.union(&reserve).copied().collect())?;
    // A program that is started from here gets no more either, whatever its file says.
    set_no_new_privs().map_err(|errno| CapsError::from(format!("PR_SET_NO_NEW_PRIVS: {errno}")))
}

/// As [`give_up`], for a thread that does its work all the same where that fails.
pub fn give_up_or_warn(work: Work) {
    if let Err(cause) = give_up(work) {
        // Nobody need be there to read it.
        let _ = writeln!(
            files::printed::stderr(),
            "warning: rights that are no longer needed cannot be given up: {cause}"
        );
    }
}

/// Makes the right effective that [`Work::Closing`] keeps for the report. Without effect for an ordinary user.
///
/// # Errors
/// If the system refuses, which it does to nobody.
pub fn use_files() -> Result<(), CapsError> {
    let file_access = Capability::CAP_DAC_OVERRIDE;
    match caps::has_cap(None, CapSet::Permitted, file_access)? {
        true => caps::raise(None, CapSet::Effective, file_access),
        false => Ok(()),
    }
}

/// Whether memory can be had and locked without a right; makes it so where the process may.
fn memory_is_unlimited() -> bool {
    let unlimited = || getrlimit(Resource::RLIMIT_MEMLOCK).is_ok_and(|(soft, _)| soft == RLIM_INFINITY);
    unlimited() || setrlimit(Resource::RLIMIT_MEMLOCK, RLIM_INFINITY, RLIM_INFINITY).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    const DAC_OVERRIDE: u64 = 1 << 1;
    const IPC_LOCK: u64 = 1 << 14;

    /// Sets of capabilities of the calling thread, and `NoNewPrivs`, as the kernel shows them.
    fn shown() -> BTreeMap<String, u64> {
        let status = std::fs::read_to_string("/proc/thread-self/status").unwrap();
        let number = |name: &str, text: &str| match name {
            "NoNewPrivs" => text.parse().unwrap(),
            _ => u64::from_str_radix(text, 16).unwrap(),
        };
        status
            .lines()
            .filter_map(|line| line.split_once(":\t"))
            .filter(|(name, _)| name.starts_with("Cap") || *name == "NoNewPrivs")
            .map(|(name, text)| (name.to_owned(), number(name, text)))
            .collect()
    }

    /// What is shown in a thread of its own, before and after `act`.
    fn in_a_thread(act: impl FnOnce() + Send) -> [BTreeMap<String, u64>; 2] {
        std::thread::scope(|scope| {
            let thread = scope.spawn(|| {
                let before = shown();
                act();
                [before, shown()]
            });
            thread.join().unwrap()
        })
    }

    #[test]
    fn a_real_time_thread_keeps_nothing_and_the_others_all() {
        let this = shown();
        let [before, after] = in_a_thread(|| give_up(Work::RealTime).unwrap());
        assert_eq!(before, this);
        let bounding = match before["CapEff"] >> Capability::CAP_SETPCAP.index() & 1 {
            1 => 0,
            _ => before["CapBnd"],
        };
        for (set, left) in [
            ("CapInh", 0),
            ("CapPrm", 0),
            ("CapEff", 0),
            ("CapAmb", 0),
            ("CapBnd", bounding),
        ] {
            assert_eq!(after[set], left, "{set}");
        }
        assert_eq!(after["NoNewPrivs"], 1);
        assert_eq!(shown(), this, "rights belong to threads");
    }

    #[test]
    fn the_closing_thread_keeps_file_access_in_reserve() {
        let [before, running] = in_a_thread(|| give_up(Work::Closing).unwrap());
        let reserve = before["CapPrm"] & DAC_OVERRIDE;
        assert_eq!(running["CapEff"] & !IPC_LOCK, 0);
        assert_eq!(running["CapPrm"], running["CapEff"] | reserve);
        let [_, closing] = in_a_thread(|| {
            give_up(Work::Closing).unwrap();
            use_files().unwrap();
        });
        assert_eq!(closing["CapEff"], running["CapEff"] | reserve);
        // What it starts meanwhile has no use for that.
        let [_, started] = in_a_thread(|| {
            give_up(Work::Closing).unwrap();
            give_up(Work::Ordinary).unwrap();
            use_files().unwrap();
        });
        assert_eq!(started["CapPrm"], running["CapEff"]);
    }

    #[test]
    fn the_right_to_lock_stays_only_where_memory_is_limited() {
        let [before, after] = in_a_thread(|| give_up(Work::Ordinary).unwrap());
        let expected = match memory_is_unlimited() {
            true => 0,
            false => before["CapPrm"] & IPC_LOCK,
        };
        assert_eq!(after["CapEff"], expected);
    }

    #[test]
    fn giving_up_twice_is_no_error() {
        let [_, after] = in_a_thread(|| {
            give_up(Work::RealTime).unwrap();
            give_up(Work::RealTime).unwrap();
            use_files().unwrap();
        });
        assert_eq!(after["CapPrm"], 0);
    }
}
