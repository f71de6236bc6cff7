//! Locks of the network of a core under PREEMPT_RT: waited for before the date of a frame, not after it.
//!
//! In:  nothing. Out: after [`NetworkLocks::pass`], nobody of lower priority on this core stands between a frame and the wire
//!      until the thread sleeps.
//!
//! Under PREEMPT_RT two things that a frame needs on its way are sections of code of a core that one thread at a time may be in,
//! and that a thread of higher priority can interrupt: the soft interrupts (network, timers), and the store from which the
//! kernel takes the memory of packets and to which it gives it back. A cycle thread that wakes while another thread of its core
//! is in such a section finds it locked when it sends: the kernel first lets the other one finish, some 10 µs. On a core of its
//! own there is rarely any; on a shared one it is the timer thread of the kernel or any program that uses the network, be it
//! only that it reads a frame. To pass both sections once, before the last microseconds are spun, moves that wait ahead of
//! the date: a thread that spins lets nobody of lower priority in again.

use nix::sys::socket::{AddressFamily, NetlinkAddr, SockFlag, SockProtocol, SockType, connect, socket};
use std::fs::read_to_string;
use std::os::fd::{AsRawFd, OwnedFd};

/// A netlink port that nobody has: ids of processes are smaller, those that the kernel gives are negative.
const NOBODY: u32 = 0x7FFF_FFF0;
/// Octets of a packet whose memory comes from the same store as that of a SoC.
static OCTETS: [u8; 60] = [0; 60];

/// A way through the sections: sockets of which nothing is wanted.
#[derive(Debug)]
pub struct NetworkLocks {
    /// `None`: there is no such section, or no socket, and [`NetworkLocks::pass`] leaves it out.
    softirqs: Option<OwnedFd>,
    memory: Option<OwnedFd>,
}

impl NetworkLocks {
    /// Opens the sockets where the kernel is PREEMPT_RT. Other kernels disable interrupts instead of locking these sections:
    /// there is nobody to wait for.
    pub fn open() -> NetworkLocks {
        let realtime = read_to_string("/sys/kernel/realtime").is_ok_and(|text| text.trim() == "1");
        NetworkLocks::open_if(realtime)
    }

    fn open_if(realtime: bool) -> NetworkLocks {
        let open = |family, kind, protocol: Option<SockProtocol>| {
            let flags = SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK;
            let socket = || socket(family, kind, flags, protocol).ok();
            realtime.then(socket).flatten()
        };
        let netlink = open(
            AddressFamily::Netlink,
            SockType::Raw,
            SockProtocol::NetlinkUserSock.into(),
        );
        NetworkLocks {
            // Without an address it never gets anything.
            softirqs: open(AddressFamily::Inet, SockType::Datagram, None),
            memory: netlink.filter(|netlink| connect(netlink.as_raw_fd(), &NetlinkAddr::new(NOBODY, 0)).is_ok()),
        }
    }

    /// RT: enters and leaves the sections, after whoever is in them. Two system calls, or none.
    pub fn pass(&self) {
        if let Some(socket) = &self.memory {
            // A packet is made, and given up as there is nobody to get it.
            // SAFETY: the octets are of the length that is given and live through the call.
            unsafe { libc::write(socket.as_raw_fd(), OCTETS.as_ptr().cast(), OCTETS.len()) };
        }
        if let Some(socket) = &self.softirqs {
            let mut octets: libc::c_int = 0;
            // How many octets have come is asked with soft interrupts locked. The answer is 0 and nobody's concern.
            // SAFETY: FIONREAD writes one int, to `octets`, which lives through the call.
            unsafe { libc::ioctl(socket.as_raw_fd(), libc::FIONREAD, &raw mut octets) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::errno::Errno;

    #[test]
    fn the_calls_are_those_that_the_kernel_knows() {
        let locks = NetworkLocks::open_if(true);
        assert!(locks.softirqs.is_some() && locks.memory.is_some());
        Errno::clear();
        locks.pass();
        // The packet was made, and refused by nobody.
        assert_eq!(Errno::last(), Errno::ECONNREFUSED);
        let softirqs = NetworkLocks { memory: None, ..locks };
        Errno::clear();
        softirqs.pass();
        assert_eq!(Errno::last_raw(), 0);
    }

    #[test]
    fn other_kernels_get_no_call() {
        let locks = NetworkLocks::open_if(false);
        assert!(locks.softirqs.is_none() && locks.memory.is_none());
        locks.pass();
    }
}
