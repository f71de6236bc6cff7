//! Writing: a new file takes the place of an old one; nothing is ever written through a link of somebody else.
//!
//! In:  a path, octets. Out: the file with its old content or the new one.
//!
//! The new content goes to a file of its own in the same folder, made for this (O_EXCL), is forced to the disk, and takes the
//! name of the old one. So a full disk spoils nothing. A link of somebody else in the place of the file is replaced, not
//! followed; behind a link of one's own, the file that it leads to is replaced. What is a device or pipe, as `/dev/null` and
//! `/dev/stdout`, is written as it is.

use crate::place::{self, Missing, Place};
use nix::errno::Errno;
use nix::fcntl::{FcntlArg, OFlag, fcntl, openat, renameat};
use nix::sys::stat::{Mode, SFlag, fchmod, fstat};
use nix::unistd::{UnlinkatFlags, unlinkat};
use std::ffi::{OsStr, OsString};
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// A new file before it has its name.
struct New {
    folder: OwnedFd,
    name: OsString,
    own_name: OsString,
    file: File,
}

/// Gives a file its content, as a whole.
///
/// # Errors
/// Of the file system; the file is then what it was.
pub fn write(path: &Path, octets: impl AsRef<[u8]>) -> io::Result<()> {
    match begin(path)? {
        Begun::Stream(mut stream) => stream.write_all(octets.as_ref()),
        Begun::New(mut new) => {
            let written = new.file.write_all(octets.as_ref()).and_then(|()| new.file.sync_all());
            new.finish(written).map(drop)
        }
    }
}

/// Whether a file of this name could be written, for whoever works long before it is. What stands there stays as it is.
///
/// # Errors
/// As those of [`write()`], but for what a full disk says.
pub fn check(path: &Path) -> io::Result<()> {
    let Place::Name { folder, name } = place::find(path)? else {
        return Ok(());
    };
    match place::look(&folder, &name)?.as_ref().map(place::kind) {
        Some(SFlag::S_IFDIR) => return Err(io::Error::from(io::ErrorKind::IsADirectory)),
        None | Some(SFlag::S_IFREG | SFlag::S_IFLNK) => {}
        // Opening a pipe for this would end what is read from it.
        Some(_) => return Ok(()),
    }
    let (own_name, _) = new_file(&folder, &name)?;
    unlinkat(&folder, own_name.as_os_str(), UnlinkatFlags::NoRemoveDir).map_err(io::Error::from)
}

/// An empty file of this name, to be written bit by bit.
///
/// # Errors
/// Of the file system; what stood there is then still there.
pub fn create(path: &Path) -> io::Result<File> {
    match begin(path)? {
        Begun::Stream(stream) => Ok(stream),
        Begun::New(new) => new.finish(Ok(())),
    }
}

/// The file of this name to be written behind its end, or a new one.
///
/// # Errors
/// Of the file system; [`io::ErrorKind::PermissionDenied`]: there is a link of another user.
pub fn append(path: &Path) -> io::Result<File> {
    let Place::Name { folder, name } = place::find(path)? else {
        return create(path);
    };
    match place::look(&folder, &name)? {
        Some(stat) if place::kind(&stat) == SFlag::S_IFREG => {
            let flags = OFlag::O_WRONLY | OFlag::O_APPEND | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC;
            let file = openat(&folder, name.as_os_str(), flags, Mode::empty())?;
            Ok(File::from(file))
        }
        Some(stat) if place::kind(&stat) == SFlag::S_IFLNK => Err(io::Error::new(
            io::ErrorKind::PermissionDenied,
            format!("is a link of user {}, which is not followed", stat.st_uid),
        )),
        Some(_) | None => create(path),
    }
}

/// The folder in which a file stands or will, its links followed once and for all.
pub struct Held {
    path: PathBuf,
    _folder: Option<OwnedFd>,
}

impl Held {
    /// Where the file is, as long as this lives: whoever moves folders and links meanwhile does not move this.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Holds on to the folder of a file, to replace that in several steps.
///
/// # Errors
/// Of the file system; [`io::ErrorKind::PermissionDenied`] also where a link of another user is on the way.
pub fn hold(path: &Path) -> io::Result<Held> {
    Ok(match place::find(path)? {
        Place::Name { folder, name } => Held {
            path: Path::new("/proc/self/fd")
                .join(folder.as_raw_fd().to_string())
                .join(name),
            _folder: Some(folder),
        },
        Place::Kernel(path) => Held { path, _folder: None },
    })
}

/// Makes a folder, and those around it that are missing.
///
/// # Errors
/// Of the file system; [`io::ErrorKind::PermissionDenied`] also where a link of another user is on the way.
pub fn make_folder(path: &Path) -> io::Result<()> {
    place::folder(path, Missing::Make).map(drop)
}

/// Removes a file, or a link instead of what it leads to. That there is none is no error.
///
/// # Errors
/// Of the file system.
pub fn remove(path: &Path) -> io::Result<()> {
    let Some(name) = path.file_name() else {
        return Err(io::Error::from(io::ErrorKind::InvalidInput));
    };
    let around = path.parent().unwrap_or(Path::new(""));
    let folder = place::folder(around, Missing::Refuse)?;
    match unlinkat(&folder, name, UnlinkatFlags::NoRemoveDir) {
        Ok(()) | Err(Errno::ENOENT) => Ok(()),
        Err(errno) => Err(errno.into()),
    }
}

enum Begun {
    New(New),
    /// What has no content that could be replaced.
    Stream(File),
}

fn begin(path: &Path) -> io::Result<Begun> {
    let (folder, name) = match place::find(path)? {
        Place::Name { folder, name } => (folder, name),
        Place::Kernel(path) => return OpenOptions::new().write(true).open(path).map(Begun::Stream),
    };
    let before = place::look(&folder, &name)?;
    let mut mode = None;
    if let Some(stat) = before {
        match place::kind(&stat) {
            SFlag::S_IFREG if place::is_trusted(stat.st_uid) => mode = Some(stat.st_mode & 0o777),
            SFlag::S_IFREG | SFlag::S_IFLNK => {}
            _ => return stream(&folder, &name).map(Begun::Stream),
        }
    }
    let (own_name, file) = new_file(&folder, &name)?;
    let new = New {
        folder,
        name,
        own_name,
        file,
    };
    if let Some(mode) = mode {
        fchmod(&new.file, Mode::from_bits_truncate(mode))?;
    }
    Ok(Begun::New(new))
}

/// A device or a pipe, if it is root's or our own.
fn stream(folder: impl AsFd, name: &OsStr) -> io::Result<File> {
    // Without O_NONBLOCK this would wait for a reader of a pipe.
    let flags = OFlag::O_WRONLY | OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC | OFlag::O_NOCTTY;
    let file = openat(folder, name, flags, Mode::empty()).map_err(|errno| match errno {
        Errno::ENXIO => io::Error::new(io::ErrorKind::InvalidInput, "is a pipe that nobody reads, no file"),
        errno => errno.into(),
    })?;
    let stat = fstat(&file)?;
    if !place::is_trusted(stat.st_uid) {
        let what = format!("is no file, and of user {}", stat.st_uid);
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, what));
    }
    fcntl(&file, FcntlArg::F_SETFL(OFlag::empty()))?;
    Ok(File::from(file))
}

/// A file that was not there before, beside that of a name.
fn new_file(folder: impl AsFd, name: &OsStr) -> io::Result<(OsString, File)> {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let flags = OFlag::O_WRONLY | OFlag::O_CREAT | OFlag::O_EXCL | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC;
    let mut tries_left = 100;
    loop {
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let mut own_name = OsString::from(".");
        own_name.push(name);
        own_name.push(format!(".{}-{number}.new", std::process::id()));
        match openat(&folder, own_name.as_os_str(), flags, Mode::from_bits_truncate(0o666)) {
            Ok(file) => return Ok((own_name, File::from(file))),
            Err(Errno::EEXIST) if tries_left > 0 => tries_left -= 1,
            Err(errno) => return Err(errno.into()),
        }
    }
}

impl New {
    /// Gives it its name, or takes it away if something went wrong.
    fn finish(self, written: io::Result<()>) -> io::Result<File> {
        let named = written.and_then(|()| {
            renameat(
                &self.folder,
                self.own_name.as_os_str(),
                &self.folder,
                self.name.as_os_str(),
            )
            .map_err(io::Error::from)
        });
        if let Err(error) = named {
            let _ = unlinkat(&self.folder, self.own_name.as_os_str(), UnlinkatFlags::NoRemoveDir);
            return Err(error);
        }
        Ok(self.file)
    }
}

#[cfg(test)]
mod tests;
