//! A second link to a network interface, on libpnet: what a user may choose who wants every frame to pass a library that
//! others keep, and what keeps the first one honest.
//!
//! In:  whole Ethernet frames to send. Out: POWERLINK frames without a VLAN tag that arrive at the interface, unstamped.
//! RT after [`PnetLink::open`], at two system calls to send a frame and three to receive one, where
//! [`raw`](super::raw) makes one and none. libpnet allocates an error at each of its own time-outs and waits in whole
//! milliseconds: so this link waits by itself, and lets libpnet read only what is there. What is left is the error of a transmit
//! queue without room.

use std::boxed::Box;
use std::io;
use std::os::fd::{IntoRawFd, OwnedFd};
use std::time::Duration;

use pnet::datalink::{self, Channel, ChannelType, Config, DataLinkReceiver, DataLinkSender};

use super::clock::monotonic_ns;
use super::raw::{Heard, OpenError, RawConfig, Socket, error, socket_error, wait};
use super::{Link, LinkError, Received};
use crate::wire::{FRAME_LEN_MAX, Mac};

/// One network interface, through libpnet.
pub struct PnetLink {
    sender: Box<dyn DataLinkSender>,
    receiver: Box<dyn DataLinkReceiver>,
    /// The socket once more: libpnet does not say which error it met.
    socket: OwnedFd,
    mac: Mac,
    spin_ns: u64,
}

impl PnetLink {
    /// Opens an interface by its name. `spin_ns`: look for frames this long before sleeping; 0: sleep at once.
    ///
    /// # Errors
    /// [`OpenError`]: there is no such interface, or the process may not open it.
    pub fn open(interface: &str, spin_ns: u64) -> Result<PnetLink, OpenError> {
        let failed = |what, source| OpenError::new(interface, what, source);
        let found = datalink::interfaces()
            .into_iter()
            .find(|found| found.name == interface)
            .ok_or_else(|| failed("find it", io::Error::from_raw_os_error(libc::ENODEV)))?;
        // Our own socket: libpnet's hears its own frames, and those of other networks on the cable as if they were of this one.
        let socket = Socket::open(interface, RawConfig::default())?;
        socket.bind(interface, Heard::UntaggedPowerlink)?;
        let Socket { fd, mac, .. } = socket;
        let socket = fd.try_clone().map_err(|error| failed("keep its socket", error))?;
        let config = Config {
            // libpnet closes it.
            socket_fd: Some(fd.into_raw_fd()),
            // It binds once more: to all EtherTypes still, or the tag would be gone before the filter looks for it.
            channel_type: ChannelType::Layer3(libc::ETH_P_ALL as u16),
            promiscuous: false,
            // Do not wait.
            read_timeout: Some(Duration::ZERO),
            write_timeout: Some(Duration::ZERO),
            read_buffer_size: 2048,
            write_buffer_size: 2048,
            ..Config::default()
        };
        match datalink::channel(&found, config).map_err(|error| failed("open a channel", error))? {
            Channel::Ethernet(sender, receiver) => Ok(PnetLink {
                sender,
                receiver,
                socket,
                mac,
                spin_ns,
            }),
            _ => Err(failed(
                "open a channel",
                io::Error::from_raw_os_error(libc::EPROTONOSUPPORT),
            )),
        }
    }

    /// MAC of the interface.
    pub fn mac(&self) -> Mac {
        self.mac
    }

    fn link_error(&self, failed: &io::Error) -> LinkError {
        match (failed.raw_os_error(), socket_error(&self.socket)) {
            _ if failed.kind() == io::ErrorKind::TimedOut => LinkError::NoBuffers,
            (Some(errno), _) => error(errno),
            (None, Err(waiting)) => waiting,
            (None, Ok(())) => error(libc::EIO),
        }
    }
}

impl Link for PnetLink {
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
            match self.sender.send_to(frame, None) {
                Some(Err(failed)) if failed.kind() == io::ErrorKind::Interrupted => {}
                Some(sent) => return sent.map_err(|failed| self.link_error(&failed)),
                // Never: it copies nothing of a frame, so it has no buffer that is too small.
                None => return Err(error(libc::EINVAL)),
            }
        }
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        let mut spin_until_ns = None;
        loop {
            let now_ns = monotonic_ns();
            let spins = now_ns < *spin_until_ns.get_or_insert(now_ns.saturating_add(self.spin_ns));
            let span_ns = if spins { 0 } else { deadline_ns.saturating_sub(now_ns) };
            if wait(&self.socket, span_ns)? {
                match self.receiver.next() {
                    Ok(frame) => {
                        let length = frame.len().min(buffer.len());
                        buffer[..length].copy_from_slice(&frame[..length]);
                        return Ok(Some(Received { length, stamp_ns: None }));
                    }
                    Err(none) if matches!(none.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => {}
                    Err(failed) => return Err(self.link_error(&failed)),
                }
            } else if now_ns >= deadline_ns {
                return Ok(None);
            }
        }
    }
}
