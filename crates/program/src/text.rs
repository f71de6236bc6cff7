//! The text of a part program as it was when it was read: whoever writes to its file meanwhile changes nothing of what runs.
//!
//! In:  a file, or octets.
//! Out: readers of it, any number at a time.
//!
//! Memory is locked, so a long text does not lie there but in a temporary file without a name, of which readers see a window.

use super::growing::Growing;
use files::read::PROGRAM_MAX;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Longest text that is kept in memory where there is a temporary file to be had, octets.
const IN_MEMORY_MAX: u64 = 1 << 20;

/// A text that stays as it is.
#[derive(Debug)]
pub struct Text(Kept);

#[derive(Debug)]
enum Kept {
    InMemory(Vec<u8>),
    InFile(File),
    /// There may be more of it.
    Growing(Arc<Growing>),
}

impl Text {
    /// Reads a file.
    ///
    /// # Errors
    /// As [`files::read()`], of a file longer than [`PROGRAM_MAX`] too.
    pub fn read(path: &Path) -> io::Result<Text> {
        let file = files::open(path)?;
        let copied = match file.metadata()?.len() {
            length @ IN_MEMORY_MAX..=PROGRAM_MAX => copied(file, length),
            _ => None,
        };
        match copied {
            Some(copy) => Ok(Text(Kept::InFile(copy))),
            None => files::read(path, PROGRAM_MAX).map(|octets| Text(Kept::InMemory(octets))),
        }
    }
}

impl From<Vec<u8>> for Text {
    fn from(octets: Vec<u8>) -> Text {
        let length = octets.len() as u64;
        let copied = (length >= IN_MEMORY_MAX).then(|| copied(octets.as_slice(), length));
        Text(copied.flatten().map_or(Kept::InMemory(octets), Kept::InFile))
    }
}

impl From<File> for Text {
    /// Of a temporary file that nobody writes to any more.
    fn from(file: File) -> Text {
        Text(Kept::InFile(file))
    }
}

impl From<Arc<Growing>> for Text {
    fn from(growing: Arc<Growing>) -> Text {
        Text(Kept::Growing(growing))
    }
}

/// A temporary file without a name.
///
/// # Errors
/// None can be made.
pub fn temporary_file() -> io::Result<File> {
    // What is long belongs on a disk, and /tmp may be memory.
    let folders = [std::env::var_os("TMPDIR").map(PathBuf::from), Some("/var/tmp".into())];
    let mut folders = folders.into_iter().flatten();
    let file = folders.find_map(|folder| tempfile::tempfile_in(folder).ok());
    file.map_or_else(|| tempfile::tempfile_in("/tmp"), Ok)
}

/// A temporary file with this content; `None` where there is no room for one, or the content is longer than it was said to be.
fn copied(content: impl Read, length: u64) -> Option<File> {
    let mut file = temporary_file().ok()?;
    let count = io::copy(&mut content.take(length + 1), &mut file).ok()?;
    file.flush().ok()?;
    (count == length).then_some(file)
}

/// Reads a text.
#[derive(Clone, Copy, Debug)]
pub struct Reader<'t> {
    source: Source<'t>,
    at: u64,
}

#[derive(Clone, Copy, Debug)]
enum Source<'t> {
    Memory(&'t [u8]),
    File(&'t File),
    Growing(&'t Growing),
}

impl<'t> From<&'t Text> for Reader<'t> {
    fn from(text: &'t Text) -> Reader<'t> {
        let source = match &text.0 {
            Kept::InMemory(octets) => Source::Memory(octets),
            Kept::InFile(file) => Source::File(file),
            Kept::Growing(growing) => Source::Growing(growing),
        };
        Reader { source, at: 0 }
    }
}

impl<'t, T: AsRef<[u8]> + ?Sized> From<&'t T> for Reader<'t> {
    fn from(octets: &'t T) -> Reader<'t> {
        let source = Source::Memory(octets.as_ref());
        Reader { source, at: 0 }
    }
}

impl Read for Reader<'_> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let count = match self.source {
            Source::Memory(octets) => {
                let at = octets.len().min(self.at as usize);
                (&octets[at..]).read(to)?
            }
            // Several readers have one file: none of them moves its place.
            Source::File(file) => file.read_at(to, self.at)?,
            Source::Growing(growing) => growing.read_at(to, self.at)?,
        };
        self.at += count as u64;
        Ok(count)
    }
}

impl Seek for Reader<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let (from, by) = match to {
            SeekFrom::Start(at) => (at, 0),
            SeekFrom::Current(by) => (self.at, by),
            SeekFrom::End(by) => match self.source {
                Source::Memory(octets) => (octets.len() as u64, by),
                Source::File(file) => (file.metadata()?.len(), by),
                // Nobody knows where it ends.
                Source::Growing(_) => return Err(io::ErrorKind::Unsupported.into()),
            },
        };
        let at = from.checked_add_signed(by);
        self.at = at.ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_what_it_was_when_it_was_read_and_a_long_one_is_not_in_memory() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.ngc");
        for octets in [1000, IN_MEMORY_MAX as usize + 1000] {
            let content: Vec<u8> = (0..octets).map(|k| (k % 251) as u8).collect();
            std::fs::write(&path, &content).unwrap();
            for text in [Text::read(&path).unwrap(), Text::from(content.clone())] {
                std::fs::write(&path, "G0 X1").unwrap();
                assert_eq!(
                    matches!(text.0, Kept::InFile(_)),
                    octets as u64 > IN_MEMORY_MAX,
                    "{octets}"
                );
                let mut readers = [Reader::from(&text); 2];
                let mut read = Vec::new();
                readers[0].seek(SeekFrom::Start(500)).unwrap();
                readers[0].read_to_end(&mut read).unwrap();
                assert_eq!(read, content[500..]);
                read.clear();
                readers[1].read_to_end(&mut read).unwrap();
                assert_eq!(read, content);
                assert_eq!(readers[0].seek(SeekFrom::End(-2)).unwrap(), octets as u64 - 2);
                assert_eq!(readers[0].seek(SeekFrom::Current(1)).unwrap(), octets as u64 - 1);
                assert_eq!(readers[0].read(&mut [0; 9]).unwrap(), 1);
                assert!(readers[0].seek(SeekFrom::End(-(octets as i64) - 1)).is_err());
            }
        }
        assert_eq!(
            Text::read(folder.path()).unwrap_err().kind(),
            io::ErrorKind::InvalidInput
        );
    }
}
