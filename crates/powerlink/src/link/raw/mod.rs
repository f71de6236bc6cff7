//! A network interface through an AF_PACKET socket.
//!
//! In:  whole Ethernet frames to send. Out: POWERLINK frames that arrive at the interface, with the kernel's stamp, and with
//! their VLAN tag if they have one: as they were on the wire.
//! RT after [`RawLink::open`]: `send` is one system call. `receive` looks into memory shared with the kernel, without a
//! system call; where the system refuses that memory, it reads by `recvmsg` ([`RawLink::reception`] says which and why).
//! With nothing there it spins if told to, then waits in `ppoll`. No allocation, no lock.
//!
//! Needs the right to open raw sockets (CAP_NET_RAW) in the network namespace of the interface.

mod ring;
mod socket;
mod tag;

use std::fmt;
use std::format;
use std::mem;
use std::os::fd::{AsRawFd, OwnedFd};
use std::string::String;

use super::clock::{from_timespec, monotonic_ns, to_timespec};
use super::{Link, LinkError, Received};
use crate::wire::{FRAME_LEN_MAX, Mac};
use ring::Ring;
pub(super) use socket::{Heard, Socket, error, socket_error};
pub use socket::{OpenError, RawConfig};
use socket::{PACKET_OUTGOING, errno};
use tag::Tag;

/// How often a look that finds nothing asks for the state of the interface.
const STATE_LOOK_NS: u64 = 1_000_000;

/// How frames come from the kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reception {
    /// Through memory shared with the kernel.
    Ring {
        /// Frames that it holds.
        frames: usize,
    },
    /// Each by a system call.
    Calls {
        /// What refused the ring.
        why: String,
    },
}

impl fmt::Display for Reception {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reception::Ring { frames } => write!(f, "frames are received through a ring of {frames}"),
            Reception::Calls { why } => write!(f, "each frame is received by a system call: {why}"),
        }
    }
}

/// One network interface, through a packet socket.
pub struct RawLink {
    /// Unmapped before the socket is closed.
    ring: Option<Ring>,
    socket: Socket,
    reception: Reception,
    spin_ns: u64,
    near_ns: u64,
    /// When the state of the interface is asked for again.
    state_look_ns: u64,
    dropped: u64,
}

impl RawLink {
    /// Opens an interface by its name.
    ///
    /// # Errors
    /// [`OpenError`]: there is no such interface, or the process may not open it.
    pub fn open(interface: &str, config: RawConfig) -> Result<RawLink, OpenError> {
        let socket = Socket::open(interface, config)?;
        let calls = |why| (None, Reception::Calls { why });
        let (ring, reception) = match config.ring_frames {
            0 => calls(String::from("no ring is wanted")),
            frames => match Ring::map(&socket.fd, frames) {
                Ok(ring) => {
                    let frames = ring.capacity_frames();
                    (Some(ring), Reception::Ring { frames })
                }
                Err((what, error)) => calls(format!("{what}: {error}")),
            },
        };
        if ring.is_none() {
            socket.enable_vlan_tags(interface)?;
            if config.receive_stamps {
                socket.switch_stamps_on(interface)?;
            }
        }
        let heard = if config.every_ether_type {
            Heard::Everything
        } else {
            Heard::Powerlink
        };
        socket.bind(interface, heard)?;
        Ok(RawLink {
            ring,
            socket,
            reception,
            spin_ns: config.spin_ns,
            near_ns: config.near_ns,
            state_look_ns: 0,
            dropped: 0,
        })
    }

    /// MAC of the interface.
    pub fn mac(&self) -> Mac {
        self.socket.mac
    }

    /// How frames come from the kernel, and why not through a ring if they do not; for one line to the user.
    pub fn reception(&self) -> &Reception {
        &self.reception
    }

    /// Frames that found no room in the ring or queue since the link was opened. A system call, not for every cycle.
    ///
    /// # Errors
    /// [`LinkError`]: the `errno` of the system call.
    pub fn dropped(&mut self) -> Result<u64, LinkError> {
        // The kernel counts from the last question on.
        self.dropped += u64::from(self.socket.dropped_since_last().map_err(error)?);
        Ok(self.dropped)
    }

    /// Takes one frame if there is one. RT.
    fn pop_frame(&mut self, buffer: &mut [u8]) -> Result<Option<Received>, LinkError> {
        match &mut self.ring {
            Some(ring) => Ok(ring.pop_frame(buffer)),
            None => read(&self.socket.fd, buffer),
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

    /// An interface that went down is reported once: at the next wait, or by looks alone within a millisecond.
    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        let mut spin_until_ns = None;
        loop {
            if let Some(received) = self.pop_frame(buffer)? {
                return Ok(Some(received));
            }
            let now_ns = monotonic_ns();
            if now_ns >= self.state_look_ns && self.ring.is_some() {
                // A ring says nothing about the interface.
                self.state_look_ns = now_ns.saturating_add(STATE_LOOK_NS);
                socket_error(&self.socket.fd)?;
            }
            if now_ns >= deadline_ns {
                return Ok(None);
            }
            let span_ns = deadline_ns - now_ns;
            if span_ns <= self.near_ns || now_ns < *spin_until_ns.get_or_insert(now_ns.saturating_add(self.spin_ns)) {
                core::hint::spin_loop();
                continue;
            }
            wait(&self.socket.fd, span_ns - self.near_ns)?;
        }
    }
}

/// Waits for a frame, a signal, or the end of the span; whether there is a frame. RT.
pub(super) fn wait(fd: &OwnedFd, span_ns: u64) -> Result<bool, LinkError> {
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
        1 if poll.revents & libc::POLLERR != 0 => socket_error(fd).map(|()| false),
        ready => Ok(ready == 1),
    }
}

/// Reads one frame by a system call, if there is one. RT.
fn read(fd: &OwnedFd, buffer: &mut [u8]) -> Result<Option<Received>, LinkError> {
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
        let length = unsafe { libc::recvmsg(fd.as_raw_fd(), &raw mut message, libc::MSG_DONTWAIT) };
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
        let (stamp_ns, tag) = ancillary_data(&message);
        let length = length as usize;
        return Ok(Some(Received {
            length: tag.map_or(length, |tag| tag.put_back(buffer, length)),
            stamp_ns,
        }));
    }
}

/// Octets of control messages: a stamp needs 32, what is told of the frame 40.
const CONTROL_LEN: usize = 128;

#[repr(C, align(8))]
struct Control([u8; CONTROL_LEN]);

/// The kernel's receive stamp of a message, and the VLAN tag that it took off, as far as there are any.
fn ancillary_data(message: &libc::msghdr) -> (Option<u64>, Option<Tag>) {
    let (mut stamp_ns, mut tag) = (None, None);
    // SAFETY: the kernel has filled the control buffer of `message`, which is aligned and still lives; the macros walk
    // it by the lengths in it.
    unsafe {
        let mut header = libc::CMSG_FIRSTHDR(message);
        while !header.is_null() {
            match ((*header).cmsg_level, (*header).cmsg_type) {
                (libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS) => {
                    let stamp = libc::CMSG_DATA(header).cast::<libc::timespec>().read_unaligned();
                    stamp_ns = Some(from_timespec(stamp));
                }
                (libc::SOL_PACKET, libc::PACKET_AUXDATA) => {
                    let frame = libc::CMSG_DATA(header).cast::<libc::tpacket_auxdata>().read_unaligned();
                    tag = Tag::from_status(frame.tp_status, frame.tp_vlan_tpid, frame.tp_vlan_tci);
                }
                _ => {}
            }
            header = libc::CMSG_NXTHDR(message, header);
        }
    }
    (stamp_ns, tag)
}
