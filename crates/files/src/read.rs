//! Reading: what a path names and how long that is, before anything of it is read.
//!
//! In:  a path. Out: a file that can be read, or what stands there instead.

use std::fs::{File, FileType, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

/// Longest text that people write or a tool makes for a machine: machine file, tool table, parameters, pitch errors, octets.
pub const TEXT_MAX: u64 = 16 << 20;
/// Longest part program that is kept in memory, octets.
pub const PROGRAM_MAX: u64 = 1 << 30;

/// Opens a file for reading. Waits for nobody: anything but a file is an error that says what it is.
///
/// # Errors
/// Of the file system; [`io::ErrorKind::InvalidInput`]: there is something else.
pub fn open(path: &Path) -> io::Result<File> {
    // Without O_NONBLOCK, opening a pipe waits for a writer, and some devices for their line.
    let file = OpenOptions::new()
        .read(true)
        .custom_flags(libc::O_NONBLOCK | libc::O_CLOEXEC | libc::O_NOCTTY)
        .open(path);
    let file = file.map_err(|error| match error.raw_os_error() {
        Some(libc::ENXIO) => no_file("a socket or a device without a driver"),
        _ => error,
    })?;
    match what(file.metadata()?.file_type()) {
        None => Ok(file),
        Some(what) => Err(no_file(what)),
    }
}

/// What is no file; `None`: it is one.
pub(crate) fn what(kind: FileType) -> Option<&'static str> {
    Some(match kind {
        _ if kind.is_file() => return None,
        _ if kind.is_dir() => "a folder",
        _ if kind.is_fifo() => "a pipe",
        _ if kind.is_socket() => "a socket",
        _ if kind.is_symlink() => "a link",
        _ => "a device",
    })
}

fn no_file(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, format!("is {what}, no file"))
}

/// The whole content of a file of `octets_max` octets at most.
///
/// # Errors
/// As [`open`]; [`io::ErrorKind::FileTooLarge`]: the file is longer.
pub fn read(path: &Path, octets_max: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let length = file.metadata()?.len();
    let too_long = |length: u64| {
        let what = format!("is {length} octets long, {octets_max} at the most can be read");
        Err(io::Error::new(io::ErrorKind::FileTooLarge, what))
    };
    if length > octets_max {
        return too_long(length);
    }
    let mut octets = Vec::new();
    // A file that does not fit into memory is an error, not the end of the process. It may grow while it is read.
    octets
        .try_reserve_exact(length as usize + 1)
        .map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
    file.take(octets_max + 1).read_to_end(&mut octets)?;
    match octets.len() as u64 {
        length if length > octets_max => too_long(length),
        _ => Ok(octets),
    }
}

/// A mark at the beginning of a text that says it is UTF-8: some editors write it, and it is no part of the text.
pub const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

/// A text without the mark of its encoding.
pub fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text)
}

/// The same of a file that must be UTF-8; without the mark that says so.
///
/// # Errors
/// As [`read`]; [`io::ErrorKind::InvalidData`]: it is no text.
pub fn read_text(path: &Path, octets_max: u64) -> io::Result<String> {
    let mut octets = read(path, octets_max)?;
    octets.drain(..octets.len() - without_mark(&octets).len());
    String::from_utf8(octets).map_err(|error| {
        let good = error.utf8_error().valid_up_to();
        let line = error.as_bytes()[..good].iter().filter(|octet| **octet == b'\n').count() + 1;
        let what = format!("must be UTF-8 text: line {line} is not (of Latin-1 or Windows-1252, iconv -f WINDOWS-1252 -t UTF-8 makes it)");
        io::Error::new(io::ErrorKind::InvalidData, what)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::sys::stat::Mode;
    use nix::unistd::mkfifo;
    use std::os::unix::net::UnixListener;

    /// Each of these made the process wait for ever, or fill the memory, when it was read first.
    #[test]
    fn what_is_no_file_is_told_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        mkfifo(&path("pipe"), Mode::S_IRWXU).unwrap();
        let _socket = UnixListener::bind(path("socket")).unwrap();
        std::os::unix::fs::symlink("/dev/zero", path("link")).unwrap();
        let said = |path: &Path| read(path, 100).unwrap_err().to_string();
        assert_eq!(said(&path("pipe")), "is a pipe, no file");
        assert_eq!(said(folder.path()), "is a folder, no file");
        assert_eq!(said(Path::new("/dev/zero")), "is a device, no file");
        assert_eq!(said(&path("link")), "is a device, no file");
        assert_eq!(
            said(&path("socket")),
            "is a socket or a device without a driver, no file"
        );
        assert_eq!(read(&path("none"), 1).unwrap_err().kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn a_file_is_read_up_to_the_limit_and_not_beyond() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"12345");
        let error = read(&path, 4).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(error.to_string(), "is 5 octets long, 4 at the most can be read");
        // One of a terabyte that takes no room on the disk is not begun.
        File::create(&path).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(
            read(&path, PROGRAM_MAX).unwrap_err().kind(),
            io::ErrorKind::FileTooLarge
        );
        // The mark is no part of the text, but of the octets.
        std::fs::write(&path, "\u{feff}\u{feff}é").unwrap();
        assert_eq!(read_text(&path, 8).unwrap(), "\u{feff}é");
        assert_eq!(read(&path, 8).unwrap(), "\u{feff}\u{feff}é".as_bytes());
        std::fs::write(&path, "\u{feff}").unwrap();
        assert_eq!(read_text(&path, 8).unwrap(), "");
        std::fs::write(&path, b"one\ntwo\nr\xF6t\n").unwrap();
        let error = read_text(&path, 20).unwrap_err().to_string();
        assert!(error.starts_with("must be UTF-8 text: line 3 is not"), "{error}");
        // The length that the kernel tells of its own files is 0.
        assert!(!read(Path::new("/proc/self/status"), 1 << 16).unwrap().is_empty());
        assert_eq!(
            read(Path::new("/proc/self/status"), 3).unwrap_err().kind(),
            io::ErrorKind::FileTooLarge
        );
    }
}
