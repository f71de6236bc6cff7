//! The file of an oscilloscope: made whole at the start of a control, gone with it.

use super::layout::{FILE_LEN, Segment};
use crate::file::{Folder, lock_octet, same_file};
use crate::{Hal, HalError};
use memmap2::MmapOptions;
use nix::fcntl::{FallocateFlags, fallocate};
use std::fs::{File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// A file of this process. Dropping it removes the file and gives the lock back.
pub(super) struct OwnFile {
    file: File,
    path: PathBuf,
}

/// The file of an oscilloscope, beside that of the pins.
pub(super) fn path_beside(pins: &Path) -> Option<PathBuf> {
    let machine = pins.file_name()?.to_str()?.strip_prefix(crate::file::PREFIX)?;
    Some(pins.with_file_name(format!("isocnc-scope.{machine}")))
}

impl OwnFile {
    /// Makes the file, as large as it will ever be, and maps it.
    pub(super) fn create(hal: &Hal, period_ns: u64) -> Result<(OwnFile, Segment), HalError> {
        let corrupt = |what: &str| HalError::Corrupt {
            path: hal.path().to_owned(),
            what: what.to_owned(),
        };
        let path = path_beside(hal.path()).ok_or_else(|| corrupt("is no name of a file of pins"))?;
        let around = path.parent().ok_or_else(|| corrupt("lies in no folder"))?;
        // Until it has its name, nobody sweeps it away.
        let folder = Folder::open(around, "create")?;
        folder.lock()?;
        let draft = around.join(format!("{}scope.{}", crate::file::DRAFT_PREFIX, std::process::id()));
        let failed = |doing| {
            let path = path.clone();
            move |cause| HalError::System { path, doing, cause }
        };
        let made = || -> Result<(File, Segment), HalError> {
            // One that a process of the same number has left.
            let _ = std::fs::remove_file(&draft);
            let file = OpenOptions::new()
                .read(true)
                .write(true)
                .create_new(true)
                .mode(0o600)
                .custom_flags(libc::O_NOFOLLOW)
                .open(&draft)
                .map_err(failed("create"))?;
            // All of it, now: no cycle is to find that there is no memory.
            fallocate(&file, FallocateFlags::empty(), 0, FILE_LEN as i64)
                .map_err(std::io::Error::from)
                .map_err(failed("find memory for"))?;
            let map = MmapOptions::new()
                .len(FILE_LEN)
                .populate()
                .map_raw(&file)
                .map_err(failed("map"))?;
            let segment = Segment::format(map, &file, period_ns);
            lock_octet(&file, 0).map_err(failed("lock"))?;
            // What a killed control of this machine has left goes: the lock of the pins says that it is dead.
            std::fs::rename(&draft, &path).map_err(failed("name"))?;
            Ok((file, segment))
        };
        let (file, segment) = made().inspect_err(|_| _ = std::fs::remove_file(&draft))?;
        Ok((OwnFile { file, path }, segment))
    }
}

impl Drop for OwnFile {
    fn drop(&mut self) {
        if same_file(&self.file, &self.path) {
            // Nothing can be done about a failure: the lost lock marks the file as left over.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}
