//! The one sender of an interface: whoever sends POWERLINK frames from this PC claims its interface first.
//!
//! In:  the name of an interface.
//! Out: a claim that lasts as long as the process, or who has it already.
//!
//! A packet socket hears nothing of what its own PC sends, so two managing nodes on one interface do not hear each other: the
//! second one would reset the nodes of a machine that moves.
//!
//! The claim is itself a packet socket, with an EtherType of its own that nothing sends (0x88B5, IEEE 802 local experimental).
//! The kernel lists it in `/proc/net/packet` for every user of the network namespace, and ends it with the process. It takes
//! the right that sending takes (CAP_NET_RAW): whoever may not send cannot hold it either. A lock file or a Unix socket could
//! be held by any user, or lie in a folder of one user where the others do not see it.

use nix::net::if_::if_nametoindex;
use powerlink::link::raw::OpenError;
use std::fmt;
use std::io;
use std::mem::{size_of, zeroed};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::time::Duration;

/// EtherType of claims.
const CLAIM: u16 = 0x88B5;
/// Sockets of this namespace.
const SOCKETS: &str = "/proc/self/net/packet";
/// Two that claim at the same moment see each other and both step back: they try again, each after a pause of its own.
const ATTEMPTS: u32 = 5;
/// Characters of a command that are told.
const COMMAND_MAX: usize = 80;

/// The right to send on an interface, for as long as it lives.
#[derive(Debug)]
pub struct SoleSender {
    _socket: OwnedFd,
}

/// Why an interface cannot be claimed.
#[derive(Debug)]
pub enum ClaimError {
    /// The interface or the right to send on it is missing.
    Open(OpenError),
    /// Somebody sends on it.
    Taken { interface: String, by: Holder },
}

/// Who has claimed an interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holder {
    /// User id of the process.
    pub user: u32,
    /// Process and its command; `None`: it is another user's, or in a container of its own.
    pub process: Option<(u32, String)>,
}

impl fmt::Display for ClaimError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClaimError::Open(error) => error.fmt(f),
            ClaimError::Taken { interface, by } => {
                write!(f, "interface {interface}: ")?;
                match &by.process {
                    Some((pid, command)) => write!(f, "process {pid} ({command})")?,
                    None => write!(f, "a process of user {}", by.user)?,
                }
                f.write_str(" sends on it already, and one wire bears one sender of a PC: nothing was sent")
            }
        }
    }
}

impl std::error::Error for ClaimError {}

impl SoleSender {
    /// Claims an interface.
    ///
    /// # Errors
    /// Another process has it; there is no such interface; raw sockets are not allowed.
    pub fn claim(interface: &str) -> Result<SoleSender, ClaimError> {
        let failed = |what| {
            move |source| {
                ClaimError::Open(OpenError {
                    interface: interface.to_owned(),
                    what,
                    source,
                })
            }
        };
        let index = if_nametoindex(interface)
            .map_err(io::Error::from)
            .map_err(failed("find its index"))?;
        let mut attempt = 1;
        loop {
            let socket = open(index).map_err(failed("open a raw socket"))?;
            let own = inode(&socket).map_err(failed("look at its socket"))?;
            let sockets = std::fs::read_to_string(SOCKETS).map_err(failed("see who sends on it (/proc/net/packet)"))?;
            let Some((user, inode)) = claims(&sockets, index).find(|(_, inode)| *inode != own) else {
                return Ok(SoleSender { _socket: socket });
            };
            drop(socket);
            if attempt == ATTEMPTS {
                let interface = interface.to_owned();
                let process = owner(inode);
                let by = Holder { user, process };
                return Err(ClaimError::Taken { interface, by });
            }
            attempt += 1;
            std::thread::sleep(Duration::from_millis(5 + u64::from(std::process::id() % 16)));
        }
    }
}

/// A claim as the kernel shows it.
fn open(index: u32) -> io::Result<OwnedFd> {
    // SAFETY: no memory is touched; the descriptor is checked below.
    let fd = unsafe {
        libc::socket(
            libc::AF_PACKET,
            libc::SOCK_DGRAM | libc::SOCK_NONBLOCK | libc::SOCK_CLOEXEC,
            0,
        )
    };
    if fd < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the descriptor is open and nobody else's.
    let socket = unsafe { OwnedFd::from_raw_fd(fd) };
    // SAFETY: all zeros is a sockaddr_ll.
    let mut address: libc::sockaddr_ll = unsafe { zeroed() };
    address.sll_family = libc::AF_PACKET as u16;
    address.sll_protocol = CLAIM.to_be();
    address.sll_ifindex = index as i32;
    let length = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
    // SAFETY: `address` is a sockaddr_ll of that length and lives through the call.
    match unsafe { libc::bind(socket.as_raw_fd(), (&raw const address).cast(), length) } {
        0 => Ok(socket),
        _ => Err(io::Error::last_os_error()),
    }
}

fn inode(socket: &OwnedFd) -> io::Result<u64> {
    Ok(nix::sys::stat::fstat(socket)?.st_ino)
}

/// User and inode of the claims of an interface. Columns: sk, RefCnt, Type, Proto, Iface, R, Rmem, User, Inode.
fn claims(sockets: &str, index: u32) -> impl Iterator<Item = (u32, u64)> {
    sockets.lines().skip(1).filter_map(move |line| {
        let columns: Vec<&str> = line.split_whitespace().collect();
        let [_, _, kind, protocol, interface, _, _, user, inode] = columns[..] else {
            return None;
        };
        let is_claim = kind.parse() == Ok(libc::SOCK_DGRAM)
            && u16::from_str_radix(protocol, 16) == Ok(CLAIM)
            && interface.parse() == Ok(index);
        is_claim.then_some((user.parse().ok()?, inode.parse().ok()?))
    })
}

/// The process that has a socket, and its command.
fn owner(inode: u64) -> Option<(u32, String)> {
    let link = format!("socket:[{inode}]");
    let has_it = |pid: &u32| {
        let Ok(files) = std::fs::read_dir(format!("/proc/{pid}/fd")) else {
            return false;
        };
        files
            .flatten()
            .any(|file| std::fs::read_link(file.path()).is_ok_and(|target| target.as_os_str() == link.as_str()))
    };
    let processes = std::fs::read_dir("/proc").ok()?.flatten();
    let mut pids = processes.filter_map(|process| process.file_name().to_str()?.parse().ok());
    let pid = pids.find(has_it)?;
    let command = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    Some((pid, shown(&command)))
}

/// A command line for a message: one line, of no great length, that steers no terminal.
fn shown(command: &[u8]) -> String {
    let text = String::from_utf8_lossy(command);
    let printable = text.trim_end_matches('\0').chars().map(|c| match c {
        '\0' => ' ',
        c if c.is_control() => '?',
        c => c,
    });
    printable.take(COMMAND_MAX).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOCKETS: &str = "\
sk               RefCnt Type Proto  Iface R Rmem   User   Inode
0000000000000000 3      3    88ab   4     1 0      0      100
0000000000000000 3      2    88b5   5     1 0      0      101
0000000000000000 3      3    88b5   4     1 0      0      102
0000000000000000 3      2    88b5   4     1 0      1000   103
nonsense
";

    #[test]
    fn claims_are_told_from_other_sockets_and_other_interfaces() {
        assert_eq!(claims(SOCKETS, 4).collect::<Vec<_>>(), [(1000, 103)]);
        assert_eq!(claims(SOCKETS, 5).collect::<Vec<_>>(), [(0, 101)]);
        assert_eq!(claims(SOCKETS, 6).next(), None);
    }

    #[test]
    fn a_command_is_shown_on_one_line_and_steers_no_terminal() {
        assert_eq!(shown(b"isocnc\0run\0mill.toml\0"), "isocnc run mill.toml");
        assert_eq!(shown(b"a\x1b[2J\nb\0"), "a?[2J?b");
        assert_eq!(shown(&[b'x'; 4096]).len(), COMMAND_MAX);
    }

    #[test]
    fn a_holder_that_cannot_be_seen_is_told_by_its_user() {
        let taken = |process| ClaimError::Taken {
            interface: "eth1".into(),
            by: Holder { user: 1000, process },
        };
        let behind = " sends on it already, and one wire bears one sender of a PC: nothing was sent";
        assert_eq!(
            taken(None).to_string(),
            format!("interface eth1: a process of user 1000{behind}")
        );
        assert_eq!(
            taken(Some((7, "isocnc run m.toml".into()))).to_string(),
            format!("interface eth1: process 7 (isocnc run m.toml){behind}")
        );
    }
}
