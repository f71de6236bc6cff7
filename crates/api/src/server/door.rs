//! Clients of this process: whoever speaks for people elsewhere comes in here, and not through the socket.
//!
//! In:  what they may do and what they are called. Out: the far end of a connection, one message a line as over the socket.

use nix::sys::eventfd::EventFd;
use protocol::Role;
use std::io::{self, ErrorKind};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

/// Guests at the same time. They never take the place of a client of the socket.
pub const GUESTS_MAX: usize = 64;
/// Guests that wait to be let in.
const WAITING_MAX: usize = GUESTS_MAX;

/// Somebody who wants to come in.
#[derive(Debug)]
pub(super) struct Guest {
    pub(super) stream: UnixStream,
    pub(super) role: Role,
    pub(super) name: String,
}

/// The way in.
#[derive(Clone, Debug)]
pub struct Door {
    guests: SyncSender<Guest>,
    /// Ends a wait of whoever takes guests in; `None`: it looks now and then.
    wake: Option<Arc<EventFd>>,
}

/// Where they are taken in.
#[derive(Debug)]
pub(super) struct Guests(pub(super) Receiver<Guest>);

/// A door, and its inner side; `wake`: ends a wait of whoever takes guests in.
pub(super) fn door(wake: Option<Arc<EventFd>>) -> (Door, Guests) {
    let (guests, inside) = sync_channel(WAITING_MAX);
    (Door { guests, wake }, Guests(inside))
}

impl Door {
    /// A connection of somebody who may do this; ends at once where [`GUESTS_MAX`] are there.
    ///
    /// # Errors
    /// The service has ended, too many wait to be let in, or the system has no more of them.
    pub fn enter(&self, role: Role, name: &str) -> io::Result<UnixStream> {
        let (inside, outside) = UnixStream::pair()?;
        inside.set_nonblocking(true)?;
        let guest = Guest {
            stream: inside,
            role,
            name: name.to_owned(),
        };
        self.guests.try_send(guest).map_err(|error| match error {
            TrySendError::Full(_) => io::Error::new(ErrorKind::WouldBlock, "too many come in at once"),
            TrySendError::Disconnected(_) => io::Error::new(ErrorKind::BrokenPipe, "the control is ending"),
        })?;
        if let Some(wake) = &self.wake {
            // It can fail only where it is full, and then it wakes, too.
            let _ = wake.write(1);
        }
        Ok(outside)
    }
}
