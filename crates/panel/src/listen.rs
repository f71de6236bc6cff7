//! The address that the panel listens on.
//!
//! In:  an address. Out: a listener, made before the process enters any namespace; or who has the port.

use crate::peer::{Peers, process_of};
use std::fmt;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener};

/// Where the panel is if nobody says otherwise.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8402";

/// Why the panel cannot listen.
#[derive(Debug)]
pub struct BindError {
    address: SocketAddr,
    cause: io::Error,
    /// Who listens there, in words, as far as this user may know.
    by: Option<String>,
}

impl BindError {
    /// Somebody else listens there, who may end.
    pub fn is_in_use(&self) -> bool {
        self.cause.kind() == ErrorKind::AddrInUse
    }
}

impl fmt::Display for BindError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let BindError { address, cause, by } = self;
        match (by, cause.kind()) {
            (Some(by), ErrorKind::AddrInUse) => write!(f, "{address} is in use by {by}"),
            (None, ErrorKind::AddrInUse) => write!(f, "{address} is in use"),
            (_, ErrorKind::PermissionDenied) => write!(f, "{address}: {cause}; ports from 1024 on are for everybody"),
            (_, ErrorKind::AddrNotAvailable) => write!(f, "{address} is no address of this PC"),
            _ => write!(f, "{address}: {cause}"),
        }
    }
}

impl std::error::Error for BindError {}

/// A listening socket, and who connects to it.
#[derive(Debug)]
pub struct Listener {
    pub(crate) socket: TcpListener,
    pub(crate) address: SocketAddr,
    pub(crate) peers: Peers,
}

impl Listener {
    /// Listens; connections wait until [`serve`](crate::serve()) takes them.
    ///
    /// # Errors
    /// The address is in use, is none of this PC, or may not be had.
    pub fn bind(address: SocketAddr) -> Result<Listener, BindError> {
        let peers = Peers::open();
        let bound = TcpListener::bind(address).and_then(|socket| {
            socket.set_nonblocking(true)?;
            let address = socket.local_addr()?;
            Ok((socket, address))
        });
        match bound {
            Ok((socket, address)) => Ok(Listener { socket, address, peers }),
            Err(cause) => {
                let by = match cause.kind() {
                    ErrorKind::AddrInUse => peers.listener(address).map(|row| user_of(row.inode, row.uid)),
                    _ => None,
                };
                Err(BindError { address, cause, by })
            }
        }
    }

    /// Where it listens; the port that the system chose where that was 0.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Only this PC can connect.
    pub fn is_loopback(&self) -> bool {
        self.address.ip().is_loopback()
    }
}

fn user_of(inode: u64, uid: u32) -> String {
    match process_of(inode) {
        Some((name, process)) => format!("{name} (process {process})"),
        None => {
            let user = nix::unistd::User::from_uid(uid.into()).ok().flatten();
            let name = user.map_or_else(|| uid.to_string(), |user| user.name);
            format!("a process of user {name}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_in_use_is_told_with_who_has_it() {
        let first = Listener::bind("127.0.0.1:0".parse().unwrap()).unwrap();
        assert!(first.is_loopback());
        let refused = Listener::bind(first.address()).unwrap_err();
        assert!(refused.is_in_use());
        let told = refused.to_string();
        let here = format!("(process {})", std::process::id());
        assert!(
            told.starts_with(&format!("{} is in use by ", first.address())) && told.ends_with(&here),
            "{told}"
        );
    }

    #[test]
    fn an_address_of_nobody_is_told() {
        let refused = Listener::bind("192.0.2.1:8402".parse().unwrap()).unwrap_err();
        assert_eq!(refused.to_string(), "192.0.2.1:8402 is no address of this PC");
    }
}
