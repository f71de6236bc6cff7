//! Small files that a power cut must not spoil: tool table, parameters.
//!
//! In:  a path and the new content of the file.
//! Out: the file with its old content or the new one, at any moment and after any crash, never a part or a mixture; what it
//! held before stands in a second file, `NAME.bak`.
//!
//! The new content goes to a file of its own in the same folder, is forced to the disk, and takes the name of the old one
//! (rename, which is atomic); then the folder is forced to the disk, so that the new name lasts.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest wait for another process that writes in the same folder.
const LOCK_WAIT: Duration = Duration::from_secs(2);

/// What is asked of a file system; a test has one that fails or crashes at any step.
pub trait Files {
    /// An open file that is being written.
    type Writer;
    /// What keeps others from writing in a folder meanwhile.
    type Lock;

    /// Waits for a while until nobody else writes tables in the folder.
    fn lock(&mut self, folder: &Path) -> io::Result<Self::Lock>;
    /// The whole content; `None`: there is no such file.
    fn read(&mut self, path: &Path) -> io::Result<Option<Vec<u8>>>;
    /// Makes a new file in place of one that is there; with the rights of the file `like`, if there is one.
    fn create(&mut self, path: &Path, like: &Path) -> io::Result<Self::Writer>;
    /// Appends to it.
    fn write(&mut self, writer: &mut Self::Writer, octets: &[u8]) -> io::Result<()>;
    /// Returns when all that was written is on the disk.
    fn sync(&mut self, writer: &mut Self::Writer) -> io::Result<()>;
    /// Gives a file another name; one that has it already is gone.
    fn rename(&mut self, from: &Path, to: &Path) -> io::Result<()>;
    /// Returns when all names of the folder are on the disk.
    fn sync_folder(&mut self, folder: &Path) -> io::Result<()>;
    /// Removes a file.
    fn remove(&mut self, path: &Path) -> io::Result<()>;
}

/// Gives a file a new content, and `NAME.bak` the old one. False: it has that content already, and nothing was touched.
///
/// # Errors
/// Of the file system; the file has its old content then, or, if only the last forcing of the folder failed, the new one.
pub fn replace(files: &mut impl Files, path: &Path, content: &[u8]) -> io::Result<bool> {
    let folder = folder_of(path);
    let _lock = files.lock(folder)?;
    let before = files.read(path)?;
    match before {
        Some(before) if before == content => return Ok(false),
        Some(before) => put_like(files, &named(path, "", ".bak"), path, &before)?,
        None => {}
    }
    put_like(files, path, path, content)?;
    Ok(true)
}

/// Gives a file this content; what it held before is gone.
///
/// # Errors
/// As [`replace`].
pub fn put(files: &mut impl Files, path: &Path, content: &[u8]) -> io::Result<()> {
    let _lock = files.lock(folder_of(path))?;
    put_like(files, path, path, content)
}

/// One file, atomically.
fn put_like(files: &mut impl Files, path: &Path, like: &Path, content: &[u8]) -> io::Result<()> {
    let new = named(path, ".", ".new");
    let written = write_synced(files, &new, like, content).and_then(|()| files.rename(&new, path));
    if written.is_err() {
        let _ = files.remove(&new); // what went wrong before says more
    }
    written?;
    files.sync_folder(folder_of(path))
}

fn write_synced(files: &mut impl Files, path: &Path, like: &Path, content: &[u8]) -> io::Result<()> {
    let mut writer = files.create(path, like)?;
    files.write(&mut writer, content)?;
    files.sync(&mut writer)
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        Some(_) | None => Path::new("."),
    }
}

/// `path` with something before and behind its last part.
fn named(path: &Path, before: &str, behind: &str) -> PathBuf {
    let mut name = OsString::from(before);
    name.push(path.file_name().unwrap_or_default());
    name.push(behind);
    path.with_file_name(name)
}

/// The files of the PC.
#[derive(Debug)]
pub struct Disk;

impl Files for Disk {
    type Writer = File;
    type Lock = File;

    fn lock(&mut self, folder: &Path) -> io::Result<File> {
        let lock = File::open(folder)?;
        let give_up = Instant::now() + LOCK_WAIT;
        loop {
            match lock.try_lock() {
                Ok(()) => return Ok(lock),
                Err(std::fs::TryLockError::Error(error)) => return Err(error),
                Err(std::fs::TryLockError::WouldBlock) if Instant::now() > give_up => {
                    let what = "another process is writing in this folder";
                    return Err(io::Error::new(io::ErrorKind::WouldBlock, what));
                }
                Err(std::fs::TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(10)),
            }
        }
    }

    fn read(&mut self, path: &Path) -> io::Result<Option<Vec<u8>>> {
        match files::read(path, files::read::TEXT_MAX) {
            Ok(content) => Ok(Some(content)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn create(&mut self, path: &Path, like: &Path) -> io::Result<File> {
        // One that an earlier crash left, or a link that somebody else has put there.
        if let Err(error) = std::fs::remove_file(path)
            && error.kind() != io::ErrorKind::NotFound
        {
            return Err(error);
        }
        let file = File::create_new(path)?;
        if let Ok(metadata) = std::fs::symlink_metadata(like)
            && metadata.is_file()
        {
            file.set_permissions(metadata.permissions())?;
        }
        Ok(file)
    }

    fn write(&mut self, writer: &mut File, octets: &[u8]) -> io::Result<()> {
        writer.write_all(octets)
    }

    fn sync(&mut self, writer: &mut File) -> io::Result<()> {
        writer.sync_all()
    }

    fn rename(&mut self, from: &Path, to: &Path) -> io::Result<()> {
        std::fs::rename(from, to)
    }

    fn sync_folder(&mut self, folder: &Path) -> io::Result<()> {
        File::open(folder)?.sync_all()
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        std::fs::remove_file(path)
    }
}

#[cfg(test)]
mod tests;
