//! The two clocks of a link: CLOCK_MONOTONIC for deadlines, CLOCK_REALTIME for receive stamps.

/// CLOCK_MONOTONIC, in ns. RT: one call without a system call on common machines.
pub(super) fn monotonic_ns() -> u64 {
    read_ns(libc::CLOCK_MONOTONIC)
}

/// CLOCK_REALTIME, in ns since 1970. RT.
pub(super) fn realtime_ns() -> u64 {
    read_ns(libc::CLOCK_REALTIME)
}

fn read_ns(clock: libc::clockid_t) -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is a valid timespec that lives through the call. Both clocks exist on every Linux.
    unsafe { libc::clock_gettime(clock, &mut time) };
    from_timespec(time)
}

/// Nanoseconds of a time that is not before its epoch.
pub(super) fn from_timespec(time: libc::timespec) -> u64 {
    (time.tv_sec as u64)
        .wrapping_mul(1_000_000_000)
        .wrapping_add(time.tv_nsec as u64)
}

/// A time or a span as the system calls want it.
pub(super) fn to_timespec(ns: u64) -> libc::timespec {
    libc::timespec {
        tv_sec: (ns / 1_000_000_000) as libc::time_t,
        tv_nsec: (ns % 1_000_000_000) as libc::c_long,
    }
}
