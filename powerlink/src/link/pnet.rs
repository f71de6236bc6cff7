//! A second link to a network interface, on libpnet: keeps the first one honest, and serves tools.
//!
//! In and out as [`raw`](super::raw). Not RT: libpnet allocates at every time-out and waits in whole milliseconds, so this
//! link looks for frames and sleeps in short steps. It has no receive stamps, and does not see the VLAN tags that the kernel takes
//! off.

use std::boxed::Box;
use std::io;
use std::os::fd::{IntoRawFd, OwnedFd};
use std::thread::sleep;
use std::time::Duration;

use pnet::datalink::{self, Channel, ChannelType, Config, DataLinkReceiver, DataLinkSender};

use super::clock::monotonic_ns;
use super::raw::{OpenError, RawConfig, Socket, error, socket_error};
use super::{Link, LinkError, Received};
use crate::wire::{ETHER_TYPE, FRAME_LEN_MAX, Mac};

/// Longest sleep between two looks.
const STEP_NS: u64 = 50_000;

/// One network interface, through libpnet.
pub struct PnetLink {
    sender: Box<dyn DataLinkSender>,
    receiver: Box<dyn DataLinkReceiver>,
    /// The socket once more: libpnet does not say which error it met.
    socket: OwnedFd,
    mac: Mac,
}

impl PnetLink {
    /// Opens an interface by its name.
    ///
    /// # Errors
    /// [`OpenError`]: there is no such interface, or the process may not open it.
    pub fn open(interface: &str) -> Result<PnetLink, OpenError> {
        let failed = |what, source| OpenError {
            interface: interface.into(),
            what,
            source,
        };
        let found = datalink::interfaces()
            .into_iter()
            .find(|found| found.name == interface)
            .ok_or_else(|| failed("find it", io::Error::from_raw_os_error(libc::ENODEV)))?;
        // Our own socket: libpnet's hears its own frames.
        let options = RawConfig::default();
        let socket = Socket::open(interface, options)?;
        socket.bind(interface, options)?;
        let Socket { fd, mac, .. } = socket;
        let socket = fd.try_clone().map_err(|error| failed("keep its socket", error))?;
        let config = Config {
            // libpnet closes it.
            socket_fd: Some(fd.into_raw_fd()),
            channel_type: ChannelType::Layer3(ETHER_TYPE),
            promiscuous: false,
            // Cut to whole milliseconds by libpnet, so this means "do not wait".
            read_timeout: Some(Duration::ZERO),
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
        match self.sender.send_to(frame, None) {
            Some(sent) => sent.map_err(|failed| self.link_error(&failed)),
            None => Err(LinkError::FrameLength {
                got: frame.len(),
                max: FRAME_LEN_MAX,
            }),
        }
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        loop {
            match self.receiver.next() {
                Ok(frame) => {
                    let length = frame.len().min(buffer.len());
                    buffer[..length].copy_from_slice(&frame[..length]);
                    return Ok(Some(Received { length, stamp_ns: None }));
                }
                Err(none) if matches!(none.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) => {}
                Err(none) if none.kind() == io::ErrorKind::Interrupted => {}
                Err(failed) => return Err(self.link_error(&failed)),
            }
            let now_ns = monotonic_ns();
            if now_ns >= deadline_ns {
                return Ok(None);
            }
            sleep(Duration::from_nanos((deadline_ns - now_ns).min(STEP_NS)));
        }
    }
}
