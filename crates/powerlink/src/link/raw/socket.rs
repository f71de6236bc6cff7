//! The socket behind a raw link: opened, told what to hear, bound; what the system says when it cannot be.

use std::ffi::CString;
use std::fmt;
use std::io;
use std::mem;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};
use std::string::String;
use std::thread::sleep;
use std::time::Duration;

use crate::link::LinkError;
use crate::wire::{ETHER_TYPE, Mac, multicast};

/// How a socket is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawConfig {
    /// Look for frames this long before sleeping, in ns; 0: sleep at once.
    pub spin_ns: u64,
    /// Look instead of sleeping where the deadline is nearer than this, in ns: what waking up takes on this PC. 0: never.
    pub near_ns: u64,
    /// Frames must carry receive stamps. Through a ring they always do.
    pub receive_stamps: bool,
    /// Receive frames for other stations too: for a process that is several nodes, each with a MAC of its own, on one real
    /// interface. A veth passes them anyway.
    pub promiscuous: bool,
    /// Receive frames of every EtherType, not only of POWERLINK: for other traffic in the asynchronous slot.
    pub every_ether_type: bool,
    /// Frames that may wait in memory shared with the kernel, 2 KiB each, rounded up to whole pages; 0: read each by a
    /// system call. A node reads each frame as it comes: a small ring stays in the cache, which a large one does not (a tenth
    /// of the whole way of a frame over a veth pair). A recorder that may be late wants thousands.
    pub ring_frames: usize,
}

impl Default for RawConfig {
    fn default() -> Self {
        RawConfig {
            spin_ns: 0,
            near_ns: 0,
            receive_stamps: false,
            promiscuous: false,
            every_ether_type: false,
            ring_frames: 64,
        }
    }
}

/// `PACKET_IGNORE_OUTGOING`, since Linux 4.20; not in the libc crate.
const PACKET_IGNORE_OUTGOING: libc::c_int = 23;
/// Where a frame has its EtherType.
const ETHER_TYPE_AT: u32 = 12;
/// `sll_pkttype` of a frame that this host sent.
pub(super) const PACKET_OUTGOING: libc::c_uchar = 4;

/// Which frames a socket hears.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::link) enum Heard {
    /// All.
    Everything,
    /// Those of POWERLINK's EtherType, also with a VLAN tag.
    Powerlink,
    /// Those without a tag, and none that this PC sent: for a reader who is told neither.
    #[cfg_attr(not(feature = "pnet"), allow(dead_code, reason = "libpnet's socket is the reader"))]
    UntaggedPowerlink,
}

/// Time in which the kernel has switched stamping on.
const STAMPS_ON_TIMEOUT: Duration = Duration::from_millis(20);

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

impl OpenError {
    pub(in crate::link) fn new(interface: &str, what: &'static str, source: io::Error) -> OpenError {
        OpenError {
            interface: interface.into(),
            what,
            source,
        }
    }
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "interface {}: {}: {}", self.interface, self.what, self.source)?;
        match self.source.raw_os_error() {
            Some(libc::EPERM | libc::EACCES) => f.write_str(
                " (raw sockets need CAP_NET_RAW: run as root, or \
                     'setcap cap_sys_nice,cap_ipc_lock,cap_net_raw+ep' on the program)",
            ),
            Some(libc::ENODEV) => f.write_str(" (no interface has this name)"),
            _ => Ok(()),
        }
    }
}

// Its text holds that of `source`: given as the source as well, it would be printed twice.
impl std::error::Error for OpenError {}

/// A socket for one interface, before it is used by a link.
pub(in crate::link) struct Socket {
    pub(in crate::link) fd: OwnedFd,
    pub(in crate::link) mac: Mac,
    index: libc::c_int,
}

impl Socket {
    /// Opens. Deaf until bound, so that nothing of other interfaces is ever received.
    pub(in crate::link) fn open(interface: &str, config: RawConfig) -> Result<Socket, OpenError> {
        let failed = |what, source| OpenError::new(interface, what, source);
        let flags = libc::SOCK_RAW | libc::SOCK_NONBLOCK | libc::SOCK_CLOEXEC;
        // SAFETY: takes no pointers.
        let fd = unsafe { libc::socket(libc::AF_PACKET, flags, 0) };
        if fd < 0 {
            return Err(failed("open a raw socket", io::Error::last_os_error()));
        }
        // SAFETY: `fd` was just opened and nothing else owns it.
        let fd = unsafe { OwnedFd::from_raw_fd(fd) };
        let raw = fd.as_raw_fd();
        let index = interface_index(raw, interface).map_err(|error| failed("find its index", error))?;
        let mac = interface_mac(raw, interface).map_err(|error| failed("read its MAC", error))?;

        // Older kernels do not know it; then `receive` drops our own frames by their packet type.
        let _ = set_option(raw, libc::SOL_PACKET, PACKET_IGNORE_OUTGOING, &1i32);
        set_option(raw, libc::SOL_PACKET, libc::PACKET_QDISC_BYPASS, &1i32)
            .map_err(|error| failed("bypass the queueing discipline", error))?;
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

        Ok(Socket { fd, mac, index })
    }

    /// Frames of the interface arrive from now on: of every EtherType, but for what the filter leaves out. The kernel takes a
    /// VLAN tag off and tells of it only those who hear every EtherType; to others a frame of another network on the same cable
    /// would look like one of this.
    pub(in crate::link) fn bind(&self, interface: &str, heard: Heard) -> Result<(), OpenError> {
        self.filter(heard)
            .map_err(|error| OpenError::new(interface, "choose POWERLINK frames", error))?;
        let protocol = libc::ETH_P_ALL as u16;
        // SAFETY: all-zero is a valid sockaddr_ll.
        let mut address: libc::sockaddr_ll = unsafe { mem::zeroed() };
        address.sll_family = libc::AF_PACKET as libc::c_ushort;
        address.sll_protocol = protocol.to_be();
        address.sll_ifindex = self.index;
        // SAFETY: the address lives through the call and its length is given.
        let bound = unsafe {
            libc::bind(
                self.fd.as_raw_fd(),
                (&raw const address).cast(),
                mem::size_of::<libc::sockaddr_ll>() as libc::socklen_t,
            )
        };
        if bound < 0 {
            return Err(OpenError::new(interface, "bind to it", io::Error::last_os_error()));
        }
        Ok(())
    }

    /// Has the kernel hand over these frames only.
    fn filter(&self, heard: Heard) -> io::Result<()> {
        let statement = |code: u32, jump_if: u8, jump_else: u8, k: u32| libc::sock_filter {
            code: code as u16,
            jt: jump_if,
            jf: jump_else,
            k,
        };
        let of_frame = |what: libc::c_int| {
            let at = (libc::SKF_AD_OFF + what) as u32;
            statement(libc::BPF_LD | libc::BPF_W | libc::BPF_ABS, 0, 0, at)
        };
        let mut program = [
            of_frame(libc::SKF_AD_VLAN_TAG_PRESENT),
            statement(libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K, 0, 5, 0),
            of_frame(libc::SKF_AD_PKTTYPE),
            statement(
                libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K,
                3,
                0,
                PACKET_OUTGOING.into(),
            ),
            statement(libc::BPF_LD | libc::BPF_H | libc::BPF_ABS, 0, 0, ETHER_TYPE_AT),
            statement(libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K, 0, 1, ETHER_TYPE.into()),
            statement(libc::BPF_RET | libc::BPF_K, 0, 0, u32::MAX),
            statement(libc::BPF_RET | libc::BPF_K, 0, 0, 0),
        ];
        let program = match heard {
            Heard::Everything => return Ok(()),
            Heard::Powerlink => &mut program[4..],
            Heard::UntaggedPowerlink => &mut program[..],
        };
        // The kernel reads the program behind the pointer while it is set, and keeps a copy.
        let filter = libc::sock_fprog {
            len: program.len() as libc::c_ushort,
            filter: program.as_mut_ptr(),
        };
        set_option(self.fd.as_raw_fd(), libc::SOL_SOCKET, libc::SO_ATTACH_FILTER, &filter)
    }

    /// Has the VLAN tags of frames that are read by system calls told.
    pub(super) fn enable_vlan_tags(&self, interface: &str) -> Result<(), OpenError> {
        set_option(self.fd.as_raw_fd(), libc::SOL_PACKET, libc::PACKET_AUXDATA, &1i32)
            .map_err(|error| OpenError::new(interface, "ask for VLAN tags", error))
    }

    /// Has frames that are read by system calls stamped as they arrive.
    pub(super) fn switch_stamps_on(&self, interface: &str) -> Result<(), OpenError> {
        set_option(self.fd.as_raw_fd(), libc::SOL_SOCKET, libc::SO_TIMESTAMPNS, &1i32)
            .map_err(|error| OpenError::new(interface, "ask for receive stamps", error))?;
        // The kernel switches stamping on a little later, by a work item of its own. A frame that arrives before carries
        // no stamp, and the kernel fills in the time at which it is read: plausible, and wrong.
        sleep(STAMPS_ON_TIMEOUT);
        Ok(())
    }

    /// Frames dropped for lack of room since the last question.
    pub(super) fn dropped_since_last(&self) -> Result<u32, i32> {
        // SAFETY: all-zero is a valid tpacket_stats.
        let mut counted: libc::tpacket_stats = unsafe { mem::zeroed() };
        let mut length = mem::size_of::<libc::tpacket_stats>() as libc::socklen_t;
        // SAFETY: the kernel writes at most `length` octets into `counted`; both live through the call.
        let done = unsafe {
            libc::getsockopt(
                self.fd.as_raw_fd(),
                libc::SOL_PACKET,
                libc::PACKET_STATISTICS,
                (&raw mut counted).cast(),
                &raw mut length,
            )
        };
        if done < 0 { Err(errno()) } else { Ok(counted.tp_drops) }
    }
}

/// The error that waits at the socket, as after the interface went down; told once. RT.
pub(in crate::link) fn socket_error(fd: &OwnedFd) -> Result<(), LinkError> {
    let mut waiting: libc::c_int = 0;
    let mut length = mem::size_of::<libc::c_int>() as libc::socklen_t;
    // SAFETY: the kernel writes at most `length` octets into `waiting`; both live through the call.
    let done = unsafe {
        libc::getsockopt(
            fd.as_raw_fd(),
            libc::SOL_SOCKET,
            libc::SO_ERROR,
            (&raw mut waiting).cast(),
            &raw mut length,
        )
    };
    match (done, waiting) {
        (0, 0) => Ok(()),
        (0, errno) => Err(error(errno)),
        _ => Err(error(errno())),
    }
}

pub(super) fn errno() -> i32 {
    io::Error::last_os_error().raw_os_error().unwrap_or(0)
}

pub(in crate::link) fn error(errno: i32) -> LinkError {
    match errno {
        libc::ENETDOWN | libc::ENXIO | libc::ENODEV => LinkError::Down,
        libc::ENOBUFS | libc::EAGAIN => LinkError::NoBuffers,
        errno => LinkError::Os { errno },
    }
}

pub(super) fn set_option<T>(fd: RawFd, level: libc::c_int, name: libc::c_int, value: &T) -> io::Result<()> {
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
