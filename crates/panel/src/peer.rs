//! Which user of this PC is at the other end of a TCP connection.
//!
//! In:  tables of connections as the kernel shows them (`/proc/net/tcp`, `/proc/net/tcp6`); both addresses of a connection.
//! Out: the user who made its far end, if that is on this PC.
//!
//! 127.0.0.1 is open to every user of the PC, and to every program of theirs. A Unix socket knows who connects; a TCP connection of
//! this PC does so as well, by the row of its far end. The tables are opened when the panel begins to listen, as they show the network
//! namespace and the users of whoever opens them: a control that moves to a namespace of its own still sees those who connect.

use std::fs::File;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::os::unix::fs::FileExt;

/// State of a row: the connection is there and both ends are open.
const ESTABLISHED: &str = "01";
/// Most that is read of a table, octets: 100,000 connections.
const TABLE_MAX: usize = 16 << 20;

/// A row of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Row {
    pub(crate) near: SocketAddr,
    pub(crate) far: SocketAddr,
    /// As the kernel writes it: "01" is a connection, "0A" a listener.
    pub(crate) state: String,
    pub(crate) uid: u32,
    /// 0: no process has it any more, and then nobody knows its user.
    pub(crate) inode: u64,
}

/// Reads one line of a table; `None` for its heading and for whatever is no row.
pub(crate) fn row(line: &str) -> Option<Row> {
    let mut words = line.split_ascii_whitespace();
    let near = address(words.nth(1)?)?;
    let far = address(words.next()?)?;
    let state = words.next()?.to_owned();
    // Queues, timers, resends.
    let uid = words.nth(3)?.parse().ok()?;
    let inode = words.nth(1)?.parse().ok()?;
    Some(Row {
        near,
        far,
        state,
        uid,
        inode,
    })
}

/// An address as the kernel writes it: words of 32 bits in the order of octets of this PC, and a port.
fn address(text: &str) -> Option<SocketAddr> {
    let (ip, port) = text.split_once(':')?;
    let port = u16::from_str_radix(port, 16).ok()?;
    let word = |at: usize| -> Option<[u8; 4]> {
        let digits = ip.get(8 * at..8 * at + 8)?;
        Some(u32::from_str_radix(digits, 16).ok()?.to_ne_bytes())
    };
    let ip = match ip.len() {
        8 => IpAddr::V4(Ipv4Addr::from(word(0)?)),
        32 => {
            let octets = [word(0)?, word(1)?, word(2)?, word(3)?].concat();
            IpAddr::V6(Ipv6Addr::from(<[u8; 16]>::try_from(octets).ok()?))
        }
        _ => return None,
    };
    Some(SocketAddr::new(ip, port))
}

/// The tables of the network namespace in which this was made.
#[derive(Debug)]
pub(crate) struct Peers {
    tables: Vec<File>,
    /// Who made this.
    uid: u32,
}

impl Peers {
    pub(crate) fn open() -> Peers {
        let tables = ["/proc/self/net/tcp", "/proc/self/net/tcp6"];
        Peers {
            // Without IPv6 the second is not there; without both, nobody is known.
            tables: tables.iter().filter_map(|table| File::open(table).ok()).collect(),
            uid: nix::unistd::geteuid().as_raw(),
        }
    }

    /// Whether the far end of a connection belongs to the user who made this.
    pub(crate) fn is_own(&self, near: SocketAddr, far: SocketAddr) -> bool {
        self.uid_of(near, far) == Some(self.uid)
    }

    /// The user at the far end of a connection whose near end is ours.
    fn uid_of(&self, near: SocketAddr, far: SocketAddr) -> Option<u32> {
        let rows = self.tables.iter().filter_map(|table| text(table).ok());
        let found = rows.flat_map(|text| {
            let rows = text.lines().filter_map(row);
            // The other end's row: its near end is our far one.
            let its = rows.filter(|row| row.near == far && row.far == near);
            its.collect::<Vec<Row>>()
        });
        let open = |row: &Row| row.state == ESTABLISHED && row.inode != 0;
        found.filter(open).map(|row| row.uid).next()
    }

    /// The listener of an address: its user and file number.
    pub(crate) fn listener(&self, address: SocketAddr) -> Option<Row> {
        let rows = self.tables.iter().filter_map(|table| text(table).ok());
        let takes = |row: &Row| {
            let same = row.near.ip() == address.ip() || row.near.ip().is_unspecified() || address.ip().is_unspecified();
            row.state == "0A" && row.near.port() == address.port() && same
        };
        rows.flat_map(|text| text.lines().filter_map(row).collect::<Vec<Row>>())
            .find(takes)
    }
}

/// The whole of a table as it is now.
fn text(table: &File) -> io::Result<String> {
    let mut octets = Vec::new();
    let mut chunk = [0; 32 * 1024];
    while octets.len() < TABLE_MAX {
        match table.read_at(&mut chunk, octets.len() as u64)? {
            0 => break,
            count => octets.extend_from_slice(&chunk[..count]),
        }
    }
    Ok(String::from_utf8_lossy(&octets).into_owned())
}

/// The process that has a socket, if this user may see it: its name and number.
pub(crate) fn process_of(inode: u64) -> Option<(String, u32)> {
    let wanted = format!("socket:[{inode}]");
    for process in std::fs::read_dir("/proc").ok()?.flatten() {
        let Some(number) = process.file_name().to_str().and_then(|name| name.parse::<u32>().ok()) else {
            continue;
        };
        // Those of others cannot be read.
        let files = std::fs::read_dir(process.path().join("fd"))
            .into_iter()
            .flatten()
            .flatten();
        let mut links = files.filter_map(|file| std::fs::read_link(file.path()).ok());
        if links.any(|link| link.to_str() == Some(&wanted)) {
            let name = std::fs::read_to_string(process.path().join("comm")).unwrap_or_default();
            return Some((name.trim_end().to_owned(), number));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::net::{TcpListener, TcpStream};

    #[test]
    fn rows_of_the_kernel_are_read() {
        let line =
            "   2: 0100007F:20D2 0100007F:C350 01 00000000:00000000 00:00000000 00000000  1000        0 4711 1 x";
        let expected = Row {
            near: "127.0.0.1:8402".parse().unwrap(),
            far: "127.0.0.1:50000".parse().unwrap(),
            state: "01".into(),
            uid: 1000,
            inode: 4711,
        };
        assert_eq!(row(line), Some(expected));
        assert_eq!(
            row("  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid"),
            None
        );
        let six = "0: 00000000000000000000000001000000:1F90 00000000000000000000000000000000:0000 0A 0:0 0:0 0 0 0 9";
        assert_eq!(row(six).unwrap().near, "[::1]:8080".parse().unwrap());
    }

    proptest! {
        #[test]
        fn no_line_panics(line in "\\PC*", words in proptest::collection::vec("[0-9A-Fa-f:]{0,34}", 0..14)) {
            let _ = row(&line);
            let _ = row(&words.join(" "));
        }
    }

    #[test]
    fn whoever_connects_is_known_while_both_ends_are_open() {
        let peers = Peers::open();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (server, far) = listener.accept().unwrap();
        let near = server.local_addr().unwrap();
        assert_eq!(peers.uid_of(near, far), Some(nix::unistd::geteuid().as_raw()));
        assert!(peers.is_own(near, far));
        // The wrong way round is another connection.
        assert_eq!(peers.uid_of(near, "127.0.0.1:1".parse().unwrap()), None);
        let listening = peers.listener(near).unwrap();
        assert_eq!(process_of(listening.inode).unwrap().1, std::process::id());
        // Rows of what is closed have user 0, which must not count as root's.
        drop(client);
        assert_eq!(peers.uid_of(near, far), None);
    }

    #[test]
    fn another_user_is_another_one() {
        const NOBODY: libc_long = 65_534;
        if !nix::unistd::geteuid().is_root() {
            println!("SKIPPED: only root can become another user");
            return;
        }
        let peers = Peers::open();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let connect = || {
            become_user(NOBODY);
            TcpStream::connect(address).unwrap()
        };
        let _client = std::thread::scope(|scope| scope.spawn(connect).join().unwrap());
        let (server, far) = listener.accept().unwrap();
        let near = server.local_addr().unwrap();
        assert_eq!(peers.uid_of(near, far), Some(65_534));
        assert!(!peers.is_own(near, far));
    }

    #[allow(non_camel_case_types)]
    type libc_long = nix::libc::c_long;

    /// This thread alone.
    fn become_user(user: libc_long) {
        // SAFETY: takes three numbers; without the C library it acts on this thread alone.
        let became = unsafe { nix::libc::syscall(nix::libc::SYS_setresuid, user, user, user) };
        assert_eq!(became, 0);
    }
}
