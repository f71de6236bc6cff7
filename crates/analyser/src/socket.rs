//! The analyser's own packet socket: every frame of one interface, with its receive stamps.
//!
//! In:  the name of an interface.
//! Out: frames as they lie in the buffers of a [`Batch`], many with one system call.

use super::stamps::{self, Stamps};
use super::{AnalyserError, socket_error};
use bus::FRAME_OCTETS_MAX;
use nix::errno::Errno;
use std::io;
use std::mem::{size_of, zeroed};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};

/// Room of the socket: more than a second of frames.
const RECEIVE_BUFFER: libc::c_int = 8 * 1024 * 1024;
/// Frames taken with one system call.
const BATCH: usize = 64;
/// Most frames taken with one look; more than the room of the socket holds, so that only a flood is interrupted.
const LOOK_MAX: usize = 16_384;

/// Opens a socket that hears an interface and nothing else.
pub(super) fn open(interface: &str) -> Result<OwnedFd, AnalyserError> {
    let failed = |doing| move |cause| socket_error(interface, doing, cause);
    let index = nix::net::if_::if_nametoindex(interface)
        .map_err(io::Error::from)
        .map_err(failed("find"))?;
    // Protocol 0 hears nothing until it is bound to the interface, so no frame of another one slips in.
    // SAFETY: no memory is touched; the descriptor is checked below.
    let fd = unsafe {
        libc::socket(
            libc::AF_PACKET,
            libc::SOCK_RAW | libc::SOCK_NONBLOCK | libc::SOCK_CLOEXEC,
            0,
        )
    };
    if fd < 0 {
        return Err(failed("open a packet socket")(io::Error::last_os_error()));
    }
    // SAFETY: the descriptor is open and nobody else's.
    let socket = unsafe { OwnedFd::from_raw_fd(fd) };
    // Not SO_TIMESTAMPNS: that gives a frame without a stamp the time of reading, which looks like one. The kernel begins to
    // stamp only some time after the first socket asks for it. The card's stamps come if it is set to take them.
    let stamps = (libc::SOF_TIMESTAMPING_RX_SOFTWARE
        | libc::SOF_TIMESTAMPING_SOFTWARE
        | libc::SOF_TIMESTAMPING_RX_HARDWARE
        | libc::SOF_TIMESTAMPING_RAW_HARDWARE) as libc::c_int;
    set_option(&socket, libc::SOL_SOCKET, libc::SO_TIMESTAMPING, &stamps).map_err(failed("ask for receive stamps"))?;
    if set_option(&socket, libc::SOL_SOCKET, libc::SO_RCVBUFFORCE, &RECEIVE_BUFFER).is_err() {
        // Without the right to more, as much as the system allows; what does not fit is counted.
        set_option(&socket, libc::SOL_SOCKET, libc::SO_RCVBUF, &RECEIVE_BUFFER).map_err(failed("ask for room"))?;
    }
    // SAFETY: all zeros is a sockaddr_ll.
    let mut address: libc::sockaddr_ll = unsafe { zeroed() };
    address.sll_family = libc::AF_PACKET as u16;
    address.sll_protocol = (libc::ETH_P_ALL as u16).to_be();
    address.sll_ifindex = index as i32;
    let length = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
    // SAFETY: `address` is a sockaddr_ll of that length and lives through the call.
    if unsafe { libc::bind(socket.as_raw_fd(), (&raw const address).cast(), length) } != 0 {
        return Err(failed("listen")(io::Error::last_os_error()));
    }
    // For as long as the socket is open the card hands over frames for anybody: SoC are for a group that nobody here is in,
    // poll requests for single nodes.
    // SAFETY: all zeros is a packet_mreq.
    let mut membership: libc::packet_mreq = unsafe { zeroed() };
    membership.mr_ifindex = index as i32;
    membership.mr_type = libc::PACKET_MR_PROMISC as u16;
    set_option(&socket, libc::SOL_PACKET, libc::PACKET_ADD_MEMBERSHIP, &membership)
        .map_err(failed("hear frames for others"))?;
    Ok(socket)
}

fn set_option<T>(socket: &OwnedFd, level: libc::c_int, option: libc::c_int, value: &T) -> io::Result<()> {
    let length = size_of::<T>() as libc::socklen_t;
    // SAFETY: `value` is of that length and lives through the call.
    match unsafe { libc::setsockopt(socket.as_raw_fd(), level, option, (&raw const *value).cast(), length) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Frames that the socket had to drop since it was last asked.
pub(super) fn dropped(socket: &OwnedFd) -> u64 {
    // SAFETY: all zeros is a tpacket_stats.
    let mut stats: libc::tpacket_stats = unsafe { zeroed() };
    let mut length = size_of::<libc::tpacket_stats>() as libc::socklen_t;
    let fd = socket.as_raw_fd();
    // SAFETY: `stats` is of that length and may be written; both live through the call.
    let answer = unsafe {
        libc::getsockopt(
            fd,
            libc::SOL_PACKET,
            libc::PACKET_STATISTICS,
            (&raw mut stats).cast(),
            &raw mut length,
        )
    };
    if answer == 0 { u64::from(stats.tp_drops) } else { 0 }
}

/// Room for control messages with time stamps, aligned as the kernel wants it.
type Control = [u64; 16];

/// Buffers for many frames at once.
pub(super) struct Batch {
    octets: Vec<[u8; FRAME_OCTETS_MAX]>,
    senders: Vec<libc::sockaddr_ll>,
    controls: Vec<Control>,
    slices: Vec<libc::iovec>,
    headers: Vec<libc::mmsghdr>,
}

/// A frame as it was received.
pub(super) struct Frame<'a> {
    pub(super) stamps: Stamps,
    /// It came in by the interface; else it left by it.
    pub(super) incoming: bool,
    pub(super) octets: &'a [u8],
}

impl Batch {
    pub(super) fn new() -> Batch {
        // SAFETY: all zeros is a sockaddr_ll, an iovec and an mmsghdr.
        let (sender, slice, header) = unsafe { (zeroed(), zeroed(), zeroed()) };
        Batch {
            octets: vec![[0; FRAME_OCTETS_MAX]; BATCH],
            senders: vec![sender; BATCH],
            controls: vec![Control::default(); BATCH],
            slices: vec![slice; BATCH],
            headers: vec![header; BATCH],
        }
    }

    /// Gives everything that is there to `take`; what a flood has left over stays for the next time.
    pub(super) fn drain(&mut self, socket: &OwnedFd, mut take: impl FnMut(Frame<'_>)) -> io::Result<()> {
        for _ in 0..LOOK_MAX / BATCH {
            let received = self.receive(socket)?;
            self.frames(received).for_each(&mut take);
            if received < BATCH {
                break;
            }
        }
        Ok(())
    }

    /// Takes what is there, at most [`BATCH`] frames; 0: nothing.
    fn receive(&mut self, socket: &OwnedFd) -> io::Result<usize> {
        for i in 0..BATCH {
            self.slices[i] = libc::iovec {
                iov_base: self.octets[i].as_mut_ptr().cast(),
                iov_len: FRAME_OCTETS_MAX,
            };
            let header = &mut self.headers[i].msg_hdr;
            header.msg_name = (&raw mut self.senders[i]).cast();
            header.msg_namelen = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
            header.msg_iov = &raw mut self.slices[i];
            header.msg_iovlen = 1;
            header.msg_control = self.controls[i].as_mut_ptr().cast();
            header.msg_controllen = size_of::<Control>() as _;
            header.msg_flags = 0;
        }
        let (fd, headers) = (socket.as_raw_fd(), self.headers.as_mut_ptr());
        // SAFETY: all BATCH headers point to buffers of this batch of the lengths they state; nothing moves during the call.
        let received =
            unsafe { libc::recvmmsg(fd, headers, BATCH as _, libc::MSG_DONTWAIT as _, std::ptr::null_mut()) };
        match usize::try_from(received) {
            Ok(received) => Ok(received.min(BATCH)),
            Err(_) => match Errno::last() {
                // ENETDOWN: the interface went down under us; it may come again, and the frames so far count.
                Errno::EAGAIN | Errno::EINTR | Errno::ENETDOWN => Ok(0),
                errno => Err(errno.into()),
            },
        }
    }

    fn frames(&self, received: usize) -> impl Iterator<Item = Frame<'_>> {
        (0..received).map(|i| {
            let header = &self.headers[i];
            #[allow(clippy::unnecessary_cast, reason = "a u32 with musl")]
            let length = (header.msg_hdr.msg_controllen as usize).min(size_of::<Control>());
            // SAFETY: the octets of the control buffer, all of which were given a value when it was made.
            let control = unsafe { std::slice::from_raw_parts(self.controls[i].as_ptr().cast::<u8>(), length) };
            Frame {
                stamps: stamps::parse(control),
                incoming: self.senders[i].sll_pkttype != libc::PACKET_OUTGOING,
                octets: &self.octets[i][..(header.msg_len as usize).min(FRAME_OCTETS_MAX)],
            }
        })
    }
}
