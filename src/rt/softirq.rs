//! The network's lock of a core under PREEMPT_RT: waited for before the date of a frame, not after it.
//!
//! In:  nothing. Out: after [`SoftirqLock::pass`], nobody of lower priority on this core stands between a frame and the wire
//!      until the thread sleeps.
//!
//! Under PREEMPT_RT the soft interrupts of a core (network, timers) are a section of code that one thread at a time may be
//! in, and that a thread of higher priority can interrupt. A cycle thread that wakes while another thread of its core is in
//! that section finds it locked when it sends: the kernel first lets the other one finish, some 10 µs. On a core of its own
//! there is rarely any; on a shared one it is the timer thread of the kernel or any program that uses the network. To pass
//! the section once, before the last microseconds are spun, moves that wait ahead of the date: a thread that spins lets
//! nobody of lower priority in again.

use nix::sys::socket::{AddressFamily, SockFlag, SockType, socket};
use std::fs::read_to_string;
use std::os::fd::{AsRawFd, OwnedFd};

/// A way through the section: a socket of which nothing is wanted.
#[derive(Debug)]
pub struct SoftirqLock {
    /// `None`: there is no such section, or no socket, and [`SoftirqLock::pass`] does nothing.
    socket: Option<OwnedFd>,
}

impl SoftirqLock {
    /// Opens the socket where the kernel is PREEMPT_RT. Other kernels disable soft interrupts instead of locking them:
    /// there is nobody to wait for.
    pub fn open() -> SoftirqLock {
        let realtime = read_to_string("/sys/kernel/realtime").is_ok_and(|text| text.trim() == "1");
        SoftirqLock::open_if(realtime)
    }

    fn open_if(realtime: bool) -> SoftirqLock {
        // Without an address it never gets anything.
        let open = || socket(AddressFamily::Inet, SockType::Datagram, SockFlag::SOCK_CLOEXEC, None).ok();
        SoftirqLock {
            socket: if realtime { open() } else { None },
        }
    }

    /// RT: enters and leaves the section, after whoever is in it. One system call, or none.
    pub fn pass(&self) {
        let Some(socket) = &self.socket else { return };
        let mut octets: libc::c_int = 0;
        // How many octets have come is asked with soft interrupts locked. The answer is 0 and nobody's concern.
        // SAFETY: FIONREAD writes one int, to `octets`, which lives through the call.
        unsafe { libc::ioctl(socket.as_raw_fd(), libc::FIONREAD, &raw mut octets) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::errno::Errno;

    #[test]
    fn the_call_is_one_that_the_kernel_knows() {
        let lock = SoftirqLock::open_if(true);
        assert!(lock.socket.is_some());
        Errno::clear();
        lock.pass();
        assert_eq!(Errno::last_raw(), 0);
    }

    #[test]
    fn other_kernels_get_no_call() {
        let lock = SoftirqLock::open_if(false);
        assert!(lock.socket.is_none());
        lock.pass();
    }
}
