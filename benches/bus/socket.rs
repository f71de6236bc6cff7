//! A raw socket as a C program would use it: `send` and a `recv` that waits.

use std::ffi::CString;
use std::io;
use std::mem;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};

const ETHER_TYPE: u16 = 0x88AB;
const PACKET_IGNORE_OUTGOING: libc::c_int = 23;

pub(crate) struct Socket(OwnedFd);

impl Socket {
    /// Bound to an interface. `recv` waits for at most a tenth of a second.
    pub(crate) fn open(interface: &str) -> io::Result<Socket> {
        // SAFETY: takes no pointers.
        let fd = unsafe { libc::socket(libc::AF_PACKET, libc::SOCK_RAW | libc::SOCK_CLOEXEC, 0) };
        if fd < 0 {
            return Err(io::Error::last_os_error());
        }
        // SAFETY: just opened, nobody else owns it.
        let socket = Socket(unsafe { OwnedFd::from_raw_fd(fd) });
        socket.option(libc::SOL_PACKET, PACKET_IGNORE_OUTGOING, &1i32)?;
        socket.option(libc::SOL_PACKET, libc::PACKET_QDISC_BYPASS, &1i32)?;
        let wait = libc::timeval {
            tv_sec: 0,
            tv_usec: 100_000,
        };
        socket.option(libc::SOL_SOCKET, libc::SO_RCVTIMEO, &wait)?;
        let name = CString::new(interface)?;
        // SAFETY: all-zero is a valid sockaddr_ll.
        let mut address: libc::sockaddr_ll = unsafe { mem::zeroed() };
        address.sll_family = libc::AF_PACKET as libc::c_ushort;
        address.sll_protocol = ETHER_TYPE.to_be();
        // SAFETY: the name ends with a zero and lives through the call.
        address.sll_ifindex = unsafe { libc::if_nametoindex(name.as_ptr()) } as libc::c_int;
        let length = mem::size_of::<libc::sockaddr_ll>() as libc::socklen_t;
        // SAFETY: the address lives through the call and its length is given.
        match unsafe { libc::bind(fd, (&raw const address).cast(), length) } {
            0 => Ok(socket),
            _ => Err(io::Error::last_os_error()),
        }
    }

    fn option<T>(&self, level: libc::c_int, name: libc::c_int, value: &T) -> io::Result<()> {
        let length = mem::size_of::<T>() as libc::socklen_t;
        // SAFETY: pointer and length are those of `value`, which lives through the call.
        match unsafe { libc::setsockopt(self.0.as_raw_fd(), level, name, (&raw const *value).cast(), length) } {
            0 => Ok(()),
            _ => Err(io::Error::last_os_error()),
        }
    }

    pub(crate) fn send(&self, frame: &[u8]) -> bool {
        // SAFETY: pointer and length are those of `frame`.
        unsafe { libc::send(self.0.as_raw_fd(), frame.as_ptr().cast(), frame.len(), 0) >= 0 }
    }

    /// Octets of the next frame; `None`: none came.
    pub(crate) fn recv(&self, buffer: &mut [u8]) -> Option<usize> {
        // SAFETY: pointer and length are those of `buffer`.
        let length = unsafe { libc::recv(self.0.as_raw_fd(), buffer.as_mut_ptr().cast(), buffer.len(), 0) };
        usize::try_from(length).ok()
    }
}
