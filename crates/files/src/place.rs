//! Where a path leads, step by step, without following a link that somebody else has put there.
//!
//! In:  a path. Out: an open folder and a name in it, which nobody can make mean another folder any more.
//!
//! A link counts if it belongs to root or to the user of this process. Where everybody may make links (`/tmp`) no other one does,
//! which is the kernel's rule, too (`fs.protected_symlinks`); for root none does anywhere.

use nix::errno::Errno;
use nix::fcntl::{AT_FDCWD, AtFlags, OFlag, openat, readlinkat};
use nix::sys::stat::{FileStat, Mode, SFlag, fstat, fstatat, mkdirat};
use nix::unistd::geteuid;
use std::collections::VecDeque;
use std::ffi::{OsStr, OsString};
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Component, Path, PathBuf};

/// Links on one way: as many as the kernel follows.
const LINKS_MAX: usize = 40;
/// Owner of files whose owner has no number in this namespace of users.
const OVERFLOW_UID: u32 = 65534;

/// What a path names.
pub(crate) enum Place {
    /// A name in a folder: of a file, or of nothing yet. A link with that name is somebody else's.
    Name { folder: OwnedFd, name: OsString },
    /// Something in /dev or /proc: the kernel's own, where nobody makes links.
    Kernel(PathBuf),
}

/// What is to be done where a folder on the way is missing.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Missing {
    Refuse,
    Make,
}

/// Goes to the folder of the last name of a path.
pub(crate) fn find(path: &Path) -> io::Result<Place> {
    match walk(path, Missing::Refuse, true)? {
        Walked::At(place) => Ok(place),
        Walked::Folder(_) => Err(io::Error::new(io::ErrorKind::IsADirectory, "is a folder, no file")),
    }
}

/// Opens a folder.
pub(crate) fn folder(path: &Path, missing: Missing) -> io::Result<OwnedFd> {
    match walk(path, missing, false)? {
        Walked::Folder(folder) => Ok(folder),
        Walked::At(_) => Err(io::Error::from(io::ErrorKind::NotADirectory)),
    }
}

enum Walked {
    Folder(OwnedFd),
    At(Place),
}

fn walk(path: &Path, missing: Missing, to_a_file: bool) -> io::Result<Walked> {
    let whole = OFlag::O_PATH | OFlag::O_DIRECTORY | OFlag::O_CLOEXEC;
    let start = |path: &Path| {
        openat(
            AT_FDCWD,
            if path.is_absolute() { "/" } else { "." },
            whole,
            Mode::empty(),
        )
    };
    if is_the_kernels(path) {
        return Ok(Walked::At(Place::Kernel(path.to_owned())));
    }
    let mut at = start(path)?;
    let mut left: VecDeque<OsString> = names(path);
    let mut links = 0;
    while let Some(name) = left.pop_front() {
        let is_last = to_a_file && left.is_empty();
        let found = openat(
            &at,
            name.as_os_str(),
            OFlag::O_PATH | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC,
            Mode::empty(),
        );
        let found = match found {
            Ok(found) => found,
            Err(Errno::ENOENT) if is_last => return Ok(Walked::At(Place::Name { folder: at, name })),
            Err(Errno::ENOENT) if missing == Missing::Make => {
                match mkdirat(&at, name.as_os_str(), Mode::from_bits_truncate(0o777)) {
                    Ok(()) | Err(Errno::EEXIST) => {}
                    Err(errno) => return Err(errno.into()),
                }
                left.push_front(name);
                continue;
            }
            Err(errno) => return Err(errno.into()),
        };
        let stat = fstat(&found)?;
        match kind(&stat) {
            SFlag::S_IFDIR => at = found,
            SFlag::S_IFLNK if is_trusted(stat.st_uid) || !has_more_rights() && !is_everybodys(&fstat(&at)?) => {
                links += 1;
                if links > LINKS_MAX {
                    return Err(Errno::ELOOP.into());
                }
                let target = PathBuf::from(readlinkat(&found, "")?);
                let rest = left.iter().fold(target.clone(), |path, name| path.join(name));
                if is_the_kernels(&rest) {
                    return Ok(Walked::At(Place::Kernel(rest)));
                }
                if target.is_absolute() {
                    at = start(&target)?;
                }
                for name in names(&target).into_iter().rev() {
                    left.push_front(name);
                }
            }
            SFlag::S_IFLNK if !is_last => {
                let what = format!(
                    "{}: is a link of user {}, which is not followed",
                    name.display(),
                    stat.st_uid
                );
                return Err(io::Error::new(io::ErrorKind::PermissionDenied, what));
            }
            _ if is_last => return Ok(Walked::At(Place::Name { folder: at, name })),
            _ => return Err(Errno::ENOTDIR.into()),
        }
    }
    Ok(Walked::Folder(at))
}

fn names(path: &Path) -> VecDeque<OsString> {
    let name = |component: Component<'_>| match component {
        Component::Normal(_) | Component::ParentDir => Some(component.as_os_str().to_owned()),
        Component::RootDir | Component::CurDir | Component::Prefix(_) => None,
    };
    path.components().filter_map(name).collect()
}

/// `/dev/stdout` is a link to what has no name anywhere.
fn is_the_kernels(path: &Path) -> bool {
    let is_plain = !path.components().any(|component| component == Component::ParentDir);
    is_plain && ["/dev", "/proc"].iter().any(|folder| path.starts_with(folder)) && !path.starts_with("/dev/shm")
}

pub(crate) fn kind(stat: &FileStat) -> SFlag {
    SFlag::from_bits_truncate(stat.st_mode & SFlag::S_IFMT.bits())
}

/// What stands in a folder under a name, a link as a link; `None`: nothing.
pub(crate) fn look(folder: impl AsFd, name: &OsStr) -> io::Result<Option<FileStat>> {
    match fstatat(folder, name, AtFlags::AT_SYMLINK_NOFOLLOW) {
        Ok(stat) => Ok(Some(stat)),
        Err(Errno::ENOENT) => Ok(None),
        Err(errno) => Err(errno.into()),
    }
}

/// Whether what this user has made does us no harm: root, and whoever started this process.
pub(crate) fn is_trusted(uid: u32) -> bool {
    uid == 0 || uid == geteuid().as_raw() || uid == OVERFLOW_UID && has_own_users()
}

/// Whether this process may do more to files than an ordinary user.
fn has_more_rights() -> bool {
    geteuid().is_root() && !has_own_users()
}

/// Whether everybody may make names in a folder and nobody may take away those of others.
fn is_everybodys(folder: &FileStat) -> bool {
    let both = Mode::S_ISVTX | Mode::S_IWOTH;
    Mode::from_bits_truncate(folder.st_mode).contains(both)
}

/// Whether this process is in a namespace in which the users outside, root among them, have no numbers. Nothing there can be
/// done to files of others with more rights than the one who started it has.
fn has_own_users() -> bool {
    let map = std::fs::read_to_string("/proc/self/uid_map").unwrap_or_default();
    !map.is_empty() && map.split_whitespace().next_back() != Some("4294967295")
}
