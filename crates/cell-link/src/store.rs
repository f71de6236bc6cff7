//! Programs that have come, in the folder of programs of the control.
//!
//! In:  a name and a content. Out: a file that is there as a whole, or as it was before.

use crate::message::{PROGRAM_MAX, is_program};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

fn place(folder: &Path, name: &str) -> io::Result<PathBuf> {
    match is_program(name) {
        true => Ok(folder.join(name)),
        false => Err(io::Error::new(
            ErrorKind::InvalidInput,
            format!("{name:?} names no program"),
        )),
    }
}

/// The content of a program.
///
/// # Errors
/// It is not there, is too long, or cannot be read.
pub(crate) fn read(folder: &Path, name: &str) -> io::Result<Vec<u8>> {
    files::read::read(&place(folder, name)?, PROGRAM_MAX as u64)
}

/// Puts a program into the folder, which is made where it is not there.
///
/// # Errors
/// The disk has not taken it: what was there before is there still.
pub(crate) fn write(folder: &Path, name: &str, content: &[u8]) -> io::Result<()> {
    let place = place(folder, name)?;
    files::make_folder(folder)?;
    files::write(&place, content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_names_stay_in_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let programs = folder.path().join("programs");
        write(&programs, "a.ngc", b"G0\n").unwrap();
        write(&programs, "a.ngc", b"G1\n").unwrap();
        assert_eq!(read(&programs, "a.ngc").unwrap(), b"G1\n");
        for name in ["../a.ngc", ".a", "", "a/b"] {
            assert!(read(&programs, name).is_err() && write(&programs, name, b"").is_err());
        }
        std::fs::create_dir(programs.join("d")).unwrap();
        assert!(read(&programs, "d").is_err() && write(&programs, "d", b"").is_err());
    }
}
