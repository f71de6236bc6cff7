//! The operator panel in the browser, served by the control itself.
//!
//! In:  HTTP/1.1 of browsers and programs; a way to the control as one of its clients ([`Control`]).
//! Out: the pages of the panel, `/rpc` (JSON-RPC over a WebSocket, one message a text frame), files, metrics.
//!
//! One ordinary thread with a current-thread runtime does all of it. It knows nothing of real time: whatever it wants it asks for
//! as a client, which the control serves or refuses like any other. A read or a write of the disk is done by a second thread, so that
//! no stop waits for a slow disk.
//!
//! | to learn | file |
//! |---|---|
//! | who listens, who connects, limits of both | `listen.rs`, `serve.rs` |
//! | who may do what | `guard.rs` (pages of others), `peer.rs` (users of this PC), `tokens.rs` (everybody else), `tls.rs` (whoever listens) |
//! | a client of `/rpc`, from its first message to its end | `rpc.rs` |
//! | the same without a socket, for fuzzing | `play.rs` |
//! | senders of Grbl; MTConnect | `grbl.rs`; `mtconnect.rs` |
//! | a machine file where there is no control yet | `setup.rs` |
//! | pages; programs; the way of a program; figures; measurements; a backup | `pages.rs`; `programs.rs`; `path.rs`; `figures.rs`; `measurements.rs`; `backup.rs` |

mod ask;
mod backup;
mod counts;
mod figures;
mod grbl;
mod guard;
mod listen;
mod measurements;
mod mtconnect;
mod pages;
mod path;
mod peer;
#[cfg(feature = "testing")]
pub mod play;
mod programs;
mod rpc;
mod serve;
mod setup;
mod shdr;
mod tls;
mod tokens;

pub use backup::Backup;
pub use counts::Counts;
pub use listen::{BindError, DEFAULT_ADDRESS, Listener};
pub use protocol::Role;
pub use serve::{Settings, serve};
pub use setup::Setup;
pub use tls::{Tls, TlsError};
pub use tokens::{FileError, Token, TokenFile, Tokens};

use std::io;
use std::os::unix::net::UnixStream;

/// Somebody who wants to be a client of the control.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Guest {
    /// What he may do.
    pub role: Role,
    /// What others are told of him.
    pub name: String,
}

/// The control behind the panel.
pub trait Control: Send + Sync {
    /// A connection of this guest: JSON-RPC 2.0, one message a line. It ends with either end of it.
    ///
    /// # Errors
    /// The control is ending, or serves as many as it can.
    fn connect(&self, guest: &Guest) -> io::Result<UnixStream>;
}

/// The tests that see it from outside, which are linked no second time.
#[cfg(test)]
#[path = "../tests/all.rs"]
mod from_outside;
