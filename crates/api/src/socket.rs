//! The socket of a running control: found by the machine's name, for its user alone.
//!
//! In:  the name of the machine and the file of its pins, whose lock makes this process the only control of that name.
//! Out: a listening Unix stream socket with mode 0600, which goes with the process; connections to it. It lies beside the pins,
//! in a folder that no other user can enter, and both ends ask the kernel who is at the other one.

use nix::errno::Errno;
use nix::sys::socket::sockopt::PeerCredentials;
use nix::sys::socket::{
    AddressFamily, SockFlag, SockType, UnixAddr, UnixCredentials, bind, getsockopt, listen, socket,
};
use nix::sys::stat::{Mode, fchmod};
use std::fmt;
use std::io::{self, ErrorKind};
use std::os::fd::{AsFd, AsRawFd};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const PREFIX: &str = "isocnc-control.";
/// Connections that wait to be taken.
const BACKLOG: i32 = 16;
/// A control whose queue of connections stays full for this long takes none.
const CONNECT_WAIT: Duration = Duration::from_secs(2);

/// Why a control cannot be reached from outside.
#[derive(Debug)]
pub enum BindError {
    /// Another process serves the same machine.
    Running { path: PathBuf },
    /// Something else has this name.
    NoSocket {
        /// What stands there.
        path: PathBuf,
    },
    /// The system does not allow it.
    System {
        path: PathBuf,
        /// What was tried.
        doing: &'static str,
        /// Why it failed.
        cause: io::Error,
    },
}

impl fmt::Display for BindError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BindError::Running { path } => {
                write!(f, "{}: another control of this machine is running", path.display())
            }
            BindError::NoSocket { path } => {
                write!(f, "{}: is no socket; remove it if nobody needs it", path.display())
            }
            BindError::System { path, doing, cause } => write!(f, "{}: cannot {doing}: {cause}", path.display()),
        }
    }
}

impl std::error::Error for BindError {}

/// The socket's place: in the folder of the pins.
pub fn path_beside(pins: &Path, machine: &str) -> PathBuf {
    pins.with_file_name(format!("{PREFIX}{machine}"))
}

/// Sockets of controls, by machine; whether somebody serves them is found by connecting.
pub fn find_in(directories: &[PathBuf]) -> Vec<(String, PathBuf)> {
    let mut found: Vec<(String, PathBuf)> = directories
        .iter()
        .filter_map(|directory| std::fs::read_dir(directory).ok())
        .flatten()
        .flatten()
        .filter_map(|entry| {
            let machine = entry.file_name().to_str()?.strip_prefix(PREFIX)?.to_owned();
            Some((machine, entry.path()))
        })
        .collect();
    found.sort();
    found
}

/// Connects to a control of this user, or of root.
///
/// # Errors
/// Nobody listens; the queue of connections stays full; another user listens.
pub fn connect(path: &Path) -> io::Result<UnixStream> {
    let give_up = Instant::now() + CONNECT_WAIT;
    let address = UnixAddr::new(path)?;
    let flags = SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK;
    let fd = socket(AddressFamily::Unix, SockType::Stream, flags, None)?;
    // A connection that waits would wait for ever where nobody takes it.
    while let Err(errno) = nix::sys::socket::connect(fd.as_raw_fd(), &address) {
        match errno {
            Errno::EAGAIN if Instant::now() < give_up => std::thread::sleep(Duration::from_millis(10)),
            Errno::EAGAIN => return Err(io::Error::new(ErrorKind::TimedOut, "takes no connection")),
            errno => return Err(errno.into()),
        }
    }
    check_peer(&fd)?;
    let stream = UnixStream::from(fd);
    stream.set_nonblocking(false)?;
    Ok(stream)
}

/// Whether the process at the other end is of this user, or of root: the permissions of a file say who may connect, and not
/// who listens.
///
/// # Errors
/// It is another user's.
pub(super) fn check_peer(socket: &impl AsFd) -> io::Result<()> {
    let user = peer(socket)?.uid();
    if user == 0 || user == nix::unistd::geteuid().as_raw() {
        return Ok(());
    }
    let what = format!("the process at the other end is of user {user}");
    Err(io::Error::new(ErrorKind::PermissionDenied, what))
}

/// The process at the other end.
pub(super) fn peer(socket: &impl AsFd) -> nix::Result<UnixCredentials> {
    getsockopt(socket, PeerCredentials)
}

/// A listening socket. Dropping it removes its file.
#[derive(Debug)]
pub struct Socket {
    listener: UnixListener,
    path: PathBuf,
    /// Device and file number: what is removed at the end is ours.
    file: (u64, u64),
}

impl Socket {
    /// Makes the socket; replaces that of a dead process. The caller holds the lock of the machine's pins, so that no two
    /// controls do this at once.
    ///
    /// # Errors
    /// Somebody serves this name, something else has it, or the system refuses.
    pub fn bind(path: &Path) -> Result<Socket, BindError> {
        let failed = |doing| {
            let path = path.to_owned();
            move |cause: io::Error| BindError::System { path, doing, cause }
        };
        remove_left_over(path)?;
        let flags = SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK;
        let make = || socket(AddressFamily::Unix, SockType::Stream, flags, None);
        let fd = make().map_err(io::Error::from).map_err(failed("make a socket"))?;
        // Before it gets its name: at no moment may another user open it.
        fchmod(&fd, Mode::S_IRUSR | Mode::S_IWUSR)
            .map_err(io::Error::from)
            .map_err(failed("set the mode of the socket"))?;
        UnixAddr::new(path)
            .and_then(|address| bind(fd.as_raw_fd(), &address))
            .map_err(io::Error::from)
            .map_err(failed("bind the socket"))?;
        let file = std::fs::symlink_metadata(path).map_err(failed("look at the socket"))?;
        let socket = Socket {
            listener: UnixListener::from(fd),
            path: path.to_owned(),
            file: (file.dev(), file.ino()),
        };
        let backlog = nix::sys::socket::Backlog::new(BACKLOG).map_err(io::Error::from);
        backlog
            .and_then(|backlog| listen(&socket.listener, backlog).map_err(io::Error::from))
            .map_err(failed("listen on the socket"))?;
        Ok(socket)
    }

    /// Takes connections; does not wait.
    pub fn listener(&self) -> &UnixListener {
        &self.listener
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        let ours = std::fs::symlink_metadata(&self.path).is_ok_and(|file| (file.dev(), file.ino()) == self.file);
        if ours {
            // Nothing can be done about a failure: the next control replaces it.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Removes the socket of a dead process.
fn remove_left_over(path: &Path) -> Result<(), BindError> {
    let path = path.to_owned();
    match std::fs::symlink_metadata(&path) {
        Err(cause) if cause.kind() == ErrorKind::NotFound => return Ok(()),
        Err(cause) => {
            let doing = "look at what is there";
            return Err(BindError::System { path, doing, cause });
        }
        Ok(file) if !file.file_type().is_socket() => return Err(BindError::NoSocket { path }),
        Ok(_) => {}
    }
    match connect(&path) {
        Err(cause) if cause.kind() == ErrorKind::ConnectionRefused => match std::fs::remove_file(&path) {
            Err(cause) if cause.kind() != ErrorKind::NotFound => {
                let doing = "remove the socket of a dead control";
                Err(BindError::System { path, doing, cause })
            }
            _ => Ok(()),
        },
        // No room in its queue is a sign of life, too.
        Ok(_) => Err(BindError::Running { path }),
        Err(cause) if cause.kind() == ErrorKind::TimedOut => Err(BindError::Running { path }),
        Err(cause) => Err(BindError::System {
            path,
            doing: "ask whether the control there lives",
            cause,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_socket_is_private_and_goes_with_its_owner() {
        let directory = tempfile::tempdir().unwrap();
        let path = path_beside(&directory.path().join("isocnc-hal.mill"), "mill");
        assert_eq!(path, directory.path().join("isocnc-control.mill"));
        let socket = Socket::bind(&path).unwrap();
        assert_eq!(std::fs::symlink_metadata(&path).unwrap().mode() & 0o777, 0o600);
        let found = find_in(&[directory.path().to_owned(), "/nowhere".into()]);
        assert_eq!(found, [("mill".to_owned(), path.clone())]);
        UnixStream::connect(socket.path()).unwrap();
        drop(socket);
        assert!(!path.exists());
    }

    #[test]
    fn a_second_control_is_refused_and_a_dead_one_replaced() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("isocnc-control.mill");
        let first = Socket::bind(&path).unwrap();
        let refusal = Socket::bind(&path).unwrap_err();
        let expected = format!("{}: another control of this machine is running", path.display());
        assert_eq!(refusal.to_string(), expected);
        UnixStream::connect(first.path()).unwrap();
        // A process that is killed leaves the file and nobody behind it.
        drop(first);
        drop(UnixListener::bind(&path).unwrap());
        assert!(path.exists());
        let second = Socket::bind(&path).unwrap();
        UnixStream::connect(second.path()).unwrap();
    }

    #[test]
    fn a_queue_that_stays_full_is_told_and_not_waited_for() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("isocnc-control.mill");
        let listening = Socket::bind(&path).unwrap();
        let flags = SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK;
        let address = UnixAddr::new(&path).unwrap();
        let mut queue = Vec::new();
        loop {
            let fd = socket(AddressFamily::Unix, SockType::Stream, flags, None).unwrap();
            if nix::sys::socket::connect(fd.as_raw_fd(), &address).is_err() {
                break;
            }
            queue.push(fd);
        }
        let mute = connect(&path).unwrap_err();
        assert_eq!(
            (mute.kind(), mute.to_string()),
            (ErrorKind::TimedOut, "takes no connection".into())
        );
        assert!(matches!(Socket::bind(&path), Err(BindError::Running { .. })));
        // Room again.
        listening.listener().accept().unwrap();
        connect(&path).unwrap();
    }

    #[test]
    fn a_socket_of_another_user_is_not_believed() {
        const NOBODY: libc::c_long = 65_534;
        if !nix::unistd::geteuid().is_root() {
            println!("SKIPPED: only root can become another user");
            return;
        }
        let directory = tempfile::tempdir().unwrap();
        std::fs::set_permissions(directory.path(), std::os::unix::fs::PermissionsExt::from_mode(0o777)).unwrap();
        let path = directory.path().join("isocnc-control.mill");
        let listen = || {
            // SAFETY: takes three numbers; without the C library it acts on this thread alone.
            let became = unsafe { libc::syscall(libc::SYS_setresuid, NOBODY, NOBODY, NOBODY) };
            assert_eq!(became, 0);
            UnixListener::bind(&path).unwrap()
        };
        let _listening = std::thread::scope(|scope| scope.spawn(listen).join().unwrap());
        let lie = connect(&path).unwrap_err();
        assert_eq!(
            (lie.kind(), lie.to_string()),
            (
                ErrorKind::PermissionDenied,
                "the process at the other end is of user 65534".into()
            )
        );
    }

    #[test]
    fn what_is_no_socket_stays() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("isocnc-control.mill");
        std::fs::write(&path, "precious").unwrap();
        assert!(matches!(Socket::bind(&path), Err(BindError::NoSocket { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), b"precious");
        let nowhere = directory.path().join("no/isocnc-control.mill");
        let refusal = Socket::bind(&nowhere).unwrap_err().to_string();
        assert!(refusal.contains("cannot bind the socket"), "{refusal}");
    }

    #[test]
    fn a_foreign_file_in_its_place_is_not_removed() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("isocnc-control.mill");
        let socket = Socket::bind(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, "another").unwrap();
        drop(socket);
        assert!(path.exists());
    }
}
