//! A network interface through an AF_PACKET socket.
//!
//! In:  whole Ethernet frames to send. Out: POWERLINK frames that arrive at the interface, with the kernel's stamp.
//! RT after [`RawLink::open`]: `send` is one system call, `receive` reads without waiting, spins if told to, then waits in
//! `ppoll`; no allocation, no lock.
//!
//! Needs the right to open raw sockets (CAP_NET_RAW) in the network namespace of the interface.

use std::ffi::CString;
use std::fmt;
use std::io;
use std::mem;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};
use std::string::String;

use super::clock::{from_timespec, monotonic_ns, to_timespec};
use super::{Link, LinkError, Received};
use crate::wire::{ETHER_TYPE, FRAME_LEN_MAX, Mac, multicast};

/// `PACKET_IGNORE_OUTGOING`, since Linux 4.20; not in the libc crate.
const PACKET_IGNORE_OUTGOING: libc::c_int = 23;
/// `sll_pkttype` of a frame that this host sent.
const PACKET_OUTGOING: libc::c_uchar = 4;

/// How a socket is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct RawConfig {
    /// Look for frames this long before sleeping, in ns; 0: sleep at once.
    pub spin_ns: u64,
    /// Ask the kernel for receive stamps.
    pub receive_stamps: bool,
    /// Receive frames for other stations too: for a process that is several nodes, each with a MAC of its own, on one real
    /// interface. A veth passes them anyway.
    pub promiscuous: bool,
}

/// What could not be done with which interface, and why.
#[derive(Debug)]
pub struct OpenError {
    /// Name of the interface.
    pub interface: String,
    /// What was tried.
    pub what: &'static str,
    /// Why it failed.
    pub source: io::Error,
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "interface {}: {}: {}", self.interface, self.what, self.source)?;
        match self.source.raw_os_error() {
            Some(libc::EPERM | libc::EACCES) => {
                f.write_str(" (raw sockets need CAP_NET_RAW: run as root or in a private namespace)")
            }
            Some(libc::ENODEV) => f.write_str(" (no interface has this name)"),
            _ => Ok(()),
        }
    }
}

// Its text holds that of `source`: given as the source as well, it would be printed twice.
impl std::error::Error for OpenError {}

/// A socket that hears POWERLINK on one interface, before it is used by a link.
pub(super) struct Socket {
    pub(super) fd: OwnedFd,
    pub(super) mac: Mac,
}

impl Socket {
    /// Opens and binds. Deaf until bound, so that nothing of other interfaces is ever received.
    pub(super) fn open(interface: &str, config: RawConfig) -> Result<Socket, OpenError> {
        let failed = |what, source| OpenError {
            interface: interface.into(),
            what,
            source,
        };
        let flags = libc::SOCK_RAW | libc::SOCK_NONBLOCK | libc::SOCK_CLOEXEC;
        // SAFETY: takes no pointers.
        let fd = unsafe { libc::socket(libc::AF_PACKET, flags, 0) };
        if fd < 0 {
            return Err(failed("open a raw socket", io::Error::last_os_error()));
        }
        // SAFETY: `fd` was just opened and nobody else owns it.
        let fd = unsafe { OwnedFd::from_raw_fd(fd) };
        let raw = fd.as_raw_fd();
        let index = interface_index(raw, interface).map_err(|error| failed("find its index", error))?;
        let mac = interface_mac(raw, interface).map_err(|error| failed("read its MAC", error))?;

        // Older kernels do not know it; then `receive` drops our own frames by their packet type.
        let _ = set_option(raw, libc::SOL_PACKET, PACKET_IGNORE_OUTGOING, &1i32);
        set_option(raw, libc::SOL_PACKET, libc::PACKET_QDISC_BYPASS, &1i32)
            .map_err(|error| failed("bypass the queueing discipline", error))?;
        if config.receive_stamps {
            set_option(raw, libc::SOL_SOCKET, libc::SO_TIMESTAMPNS, &1i32)
                .map_err(|error| failed("ask for receive stamps", error))?;
        }
        for address in [
            multicast::SOC,
            multicast::PRES,
            multicast::SOA,
            multicast::ASND,
            multicast::AMNI,
        ] {
            join(raw, index, libc::PACKET_MR_MULTICAST, &address)
                .map_err(|error| failed("join the POWERLINK multicast groups", error))?;
        }
        if config.promiscuous {
            join(raw, index, libc::PACKET_MR_PROMISC, &[0; 6])
                .map_err(|error| failed("switch to promiscuous", error))?;
        }

        // SAFETY: all-zero is a valid sockaddr_ll.
        let mut address: libc::sockaddr_ll = unsafe { mem::zeroed() };
        address.sll_family = libc::AF_PACKET as libc::c_ushort;
        address.sll_protocol = ETHER_TYPE.to_be();
        address.sll_ifindex = index;
        // SAFETY: the address lives through the call and its length is given.
        let bound = unsafe {
            libc::bind(
                raw,
                (&raw const address).cast(),
                mem::size_of::<libc::sockaddr_ll>() as libc::socklen_t,
            )
        };
        if bound < 0 {
            return Err(failed("bind to it", io::Error::last_os_error()));
        }
        Ok(Socket { fd, mac })
    }
}

/// One interface.
pub struct RawLink {
    socket: Socket,
    spin_ns: u64,
}

impl RawLink {
    /// Opens an interface by its name.
    pub fn open(interface: &str, config: RawConfig) -> Result<RawLink, OpenError> {
        Ok(RawLink {
            socket: Socket::open(interface, config)?,
            spin_ns: config.spin_ns,
        })
    }

    /// MAC of the interface.
    pub fn mac(&self) -> Mac {
        self.socket.mac
    }

    /// Reads one frame if there is one. RT.
    fn read(&self, buffer: &mut [u8]) -> Result<Option<Received>, LinkError> {
        let mut control = Control([0; CONTROL_LEN]);
        // SAFETY: all-zero is a valid sockaddr_ll and a valid msghdr.
        let (mut from, mut message): (libc::sockaddr_ll, libc::msghdr) = unsafe { (mem::zeroed(), mem::zeroed()) };
        let mut octets = libc::iovec {
            iov_base: buffer.as_mut_ptr().cast(),
            iov_len: buffer.len(),
        };
        loop {
            message.msg_name = (&raw mut from).cast();
            message.msg_namelen = mem::size_of::<libc::sockaddr_ll>() as libc::socklen_t;
            message.msg_iov = &raw mut octets;
            message.msg_iovlen = 1;
            message.msg_control = (&raw mut control).cast();
            message.msg_controllen = CONTROL_LEN as _;
            // SAFETY: `message` points to `from`, `octets`, `buffer` and `control`, which all live through the call, with
            // their lengths.
            let length = unsafe { libc::recvmsg(self.socket.fd.as_raw_fd(), &raw mut message, libc::MSG_DONTWAIT) };
            if length < 0 {
                match errno() {
                    libc::EINTR => continue,
                    libc::EAGAIN => return Ok(None),
                    errno => return Err(error(errno)),
                }
            }
            if from.sll_pkttype == PACKET_OUTGOING {
                continue;
            }
            return Ok(Some(Received {
                length: length as usize,
                stamp_ns: stamp(&message),
            }));
        }
    }
}

impl Link for RawLink {
    fn now_ns(&mut self) -> u64 {
        monotonic_ns()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        if !(14..=FRAME_LEN_MAX).contains(&frame.len()) {
            return Err(LinkError::FrameLength {
                got: frame.len(),
                max: FRAME_LEN_MAX,
            });
        }
        loop {
            // SAFETY: pointer and length are those of `frame`.
            let sent = unsafe { libc::send(self.socket.fd.as_raw_fd(), frame.as_ptr().cast(), frame.len(), 0) };
            if sent >= 0 {
                return Ok(());
            }
            match errno() {
                libc::EINTR => {}
                errno => return Err(error(errno)),
            }
        }
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        let mut spin_until_ns = None;
        loop {
            if let Some(received) = self.read(buffer)? {
                return Ok(Some(received));
            }
            let now_ns = monotonic_ns();
            if now_ns >= deadline_ns {
                return Ok(None);
            }
            if now_ns < *spin_until_ns.get_or_insert(now_ns.saturating_add(self.spin_ns)) {
                core::hint::spin_loop();
                continue;
            }
            wait(&self.socket.fd, deadline_ns - now_ns)?;
        }
    }
}

/// Waits for a frame, a signal, or the end of the span. RT.
fn wait(fd: &OwnedFd, span_ns: u64) -> Result<(), LinkError> {
    let mut poll = libc::pollfd {
        fd: fd.as_raw_fd(),
        events: libc::POLLIN,
        revents: 0,
    };
    let span = to_timespec(span_ns);
    // SAFETY: one pollfd and one timespec, both live through the call; no signal mask.
    let ready = unsafe { libc::ppoll(&raw mut poll, 1, &raw const span, core::ptr::null()) };
    match ready {
        -1 if errno() != libc::EINTR => Err(error(errno())),
        _ => Ok(()),
    }
}

/// Octets of control messages: one stamp needs 32.
const CONTROL_LEN: usize = 64;

#[repr(C, align(8))]
struct Control([u8; CONTROL_LEN]);

/// The kernel's receive stamp of a message, if it has one.
fn stamp(message: &libc::msghdr) -> Option<u64> {
    // SAFETY: the kernel has filled the control buffer of `message`, which is aligned and still lives; the macros walk
    // it by the lengths in it.
    unsafe {
        let mut header = libc::CMSG_FIRSTHDR(message);
        while !header.is_null() {
            if (*header).cmsg_level == libc::SOL_SOCKET && (*header).cmsg_type == libc::SCM_TIMESTAMPNS {
                return Some(from_timespec(
                    libc::CMSG_DATA(header).cast::<libc::timespec>().read_unaligned(),
                ));
            }
            header = libc::CMSG_NXTHDR(message, header);
        }
    }
    None
}

fn errno() -> i32 {
    io::Error::last_os_error().raw_os_error().unwrap_or(0)
}

pub(super) fn error(errno: i32) -> LinkError {
    match errno {
        libc::ENETDOWN | libc::ENXIO | libc::ENODEV => LinkError::Down,
        libc::ENOBUFS | libc::EAGAIN => LinkError::NoBuffers,
        errno => LinkError::Os { errno },
    }
}

fn set_option<T>(fd: RawFd, level: libc::c_int, name: libc::c_int, value: &T) -> io::Result<()> {
    // SAFETY: pointer and length are those of `value`, which lives through the call.
    let done = unsafe {
        libc::setsockopt(
            fd,
            level,
            name,
            (value as *const T).cast(),
            mem::size_of::<T>() as libc::socklen_t,
        )
    };
    if done < 0 {
        Err(io::Error::last_os_error())
    } else {
        Ok(())
    }
}

fn join(fd: RawFd, index: libc::c_int, kind: libc::c_int, address: &Mac) -> io::Result<()> {
    // SAFETY: all-zero is a valid packet_mreq.
    let mut membership: libc::packet_mreq = unsafe { mem::zeroed() };
    membership.mr_ifindex = index;
    membership.mr_type = kind as libc::c_ushort;
    membership.mr_alen = address.len() as libc::c_ushort;
    membership.mr_address[..address.len()].copy_from_slice(address);
    set_option(fd, libc::SOL_PACKET, libc::PACKET_ADD_MEMBERSHIP, &membership)
}

/// An ioctl on an interface by its name.
fn interface_ioctl(fd: RawFd, interface: &str, request: libc::c_ulong) -> io::Result<libc::ifreq> {
    let name = CString::new(interface).map_err(|_| io::Error::from_raw_os_error(libc::ENODEV))?;
    let name = name.as_bytes();
    // SAFETY: all-zero is a valid ifreq.
    let mut query: libc::ifreq = unsafe { mem::zeroed() };
    if name.is_empty() || name.len() >= query.ifr_name.len() {
        return Err(io::Error::from_raw_os_error(libc::ENODEV));
    }
    for (to, from) in query.ifr_name.iter_mut().zip(name) {
        *to = *from as libc::c_char;
    }
    // SAFETY: both requests used here read the name and write the union of this ifreq, which lives through the call.
    if unsafe { libc::ioctl(fd, request as _, &raw mut query) } < 0 {
        return Err(io::Error::last_os_error());
    }
    Ok(query)
}

fn interface_index(fd: RawFd, interface: &str) -> io::Result<libc::c_int> {
    let query = interface_ioctl(fd, interface, libc::SIOCGIFINDEX)?;
    // SAFETY: SIOCGIFINDEX has filled this field.
    Ok(unsafe { query.ifr_ifru.ifru_ifindex })
}

fn interface_mac(fd: RawFd, interface: &str) -> io::Result<Mac> {
    let query = interface_ioctl(fd, interface, libc::SIOCGIFHWADDR)?;
    // SAFETY: SIOCGIFHWADDR has filled this field.
    let octets = unsafe { query.ifr_ifru.ifru_hwaddr }.sa_data;
    Ok(core::array::from_fn(|at| octets[at] as u8))
}
