//! The file behind the shared memory: found by the machine's name, owned by one user, alive as long as it is locked.
//!
//! A new file is filled under another name and then linked to its own, so half a file is never seen. The owner holds a
//! lock on it that the kernel takes away with the process; a file without that lock is left over and is replaced.
//!
//! All of it lies in a folder that only the user can enter: another one can neither put a file or a socket there under
//! the name of a control, nor take one away.

use crate::HalError;
use crate::layout::{Words, file_len};
use crate::mapped::Mapped;
use crate::name::check_machine;
use memmap2::{MmapOptions, MmapRaw};
use nix::fcntl::{FallocateFlags, FcntlArg, fallocate, fcntl};
use nix::sys::statfs::{TMPFS_MAGIC, statfs};
use std::fs::{DirBuilder, File, OpenOptions};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

pub(crate) const PREFIX: &str = "isocnc-hal.";
/// What is being made has no name yet; whoever makes it holds the lock of the folder.
pub(crate) const DRAFT_PREFIX: &str = ".isocnc-hal.";
/// Tries of taking a name over from dead processes while others do the same.
const ATTEMPTS: u32 = 16;

/// A control that is running now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Name of its machine.
    pub machine: String,
    /// Process id of the control.
    pub pid: u32,
    /// File of its pins.
    pub path: PathBuf,
}

/// Folders that hold files of this user's controls, each of them his alone; those that exist.
pub fn directories() -> Vec<PathBuf> {
    let mut found = candidate_folders();
    found.retain(|place| Folder::private(place).is_ok());
    found
}

/// The same, made where they are not there yet; at least one.
pub(crate) fn own_directories() -> Result<Vec<PathBuf>, HalError> {
    let mut refused = HalError::NoDirectory;
    let mut own = Vec::new();
    for place in candidate_folders() {
        match Folder::make(&place) {
            Ok(()) => own.push(place),
            Err(error) => refused = error,
        }
    }
    match own.is_empty() {
        true => Err(refused),
        false => Ok(own),
    }
}

/// Where such a folder may be, best first: `/run/isocnc` (made by root or by a service manager), in `$XDG_RUNTIME_DIR`, in
/// `/dev/shm` for everybody else. What is looked for by the user's number is so by the one that he had at first: in a user
/// namespace of its own, every process is root.
fn candidate_folders() -> Vec<PathBuf> {
    static PLACES: OnceLock<Vec<PathBuf>> = OnceLock::new();
    let find = || {
        let user = nix::unistd::geteuid();
        let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(|folder| PathBuf::from(folder).join("isocnc"));
        let mut places = vec![PathBuf::from("/run/isocnc")];
        places.extend(runtime.filter(|place| place.is_absolute()));
        places.push(format!("/run/user/{user}/isocnc").into());
        places.push(format!("/dev/shm/isocnc-{user}").into());
        places.retain(|place| place.parent().is_some_and(is_memory));
        let mut seen = Vec::new();
        places.retain(|place| {
            !seen.contains(place) && {
                seen.push(place.clone());
                true
            }
        });
        places
    };
    PLACES.get_or_init(find).clone()
}

/// Whether files of a folder lie in memory: pages of a disk are written back, and a cycle that writes one meanwhile waits.
fn is_memory(folder: &Path) -> bool {
    statfs(folder).is_ok_and(|system| system.filesystem_type() == TMPFS_MAGIC)
}

/// A folder and its lock: one process at a time makes and sweeps files there.
pub(crate) struct Folder {
    file: File,
    path: PathBuf,
}

impl Folder {
    /// Makes a private one where there is none yet.
    fn make(path: &Path) -> Result<(), HalError> {
        match DirBuilder::new().mode(0o700).create(path) {
            Err(cause) if cause.kind() != std::io::ErrorKind::AlreadyExists => Err(HalError::System {
                path: path.to_owned(),
                doing: "make the folder",
                cause,
            }),
            _ => Folder::private(path),
        }
    }

    /// Makes sure that only this user can enter it.
    fn private(path: &Path) -> Result<(), HalError> {
        let folder = Folder::open(path, "open")?;
        let found = folder.file.metadata().map_err(|cause| HalError::System {
            path: path.to_owned(),
            doing: "look at the folder",
            cause,
        })?;
        if found.uid() != nix::unistd::geteuid().as_raw() {
            return Err(HalError::Foreign {
                path: path.to_owned(),
                owner: found.uid(),
            });
        }
        if found.mode() & 0o077 != 0 {
            return Err(HalError::Folder {
                path: path.to_owned(),
                what: format!("others may enter (mode {:o}, wanted is 700)", found.mode() & 0o7777),
            });
        }
        Ok(())
    }

    pub(crate) fn open(path: &Path, doing: &'static str) -> Result<Folder, HalError> {
        let system = |cause| HalError::System {
            path: path.to_owned(),
            doing,
            cause,
        };
        let file = OpenOptions::new()
            .read(true)
            .custom_flags(libc::O_DIRECTORY | libc::O_NOFOLLOW | libc::O_NONBLOCK)
            .open(path)
            .map_err(system)?;
        Ok(Folder {
            file,
            path: path.to_owned(),
        })
    }

    /// Until it is dropped, no other process makes or sweeps files here. It is held for moments.
    pub(crate) fn lock(&self) -> Result<(), HalError> {
        self.file.lock().map_err(|cause| HalError::System {
            path: self.path.clone(),
            doing: "lock the folder",
            cause,
        })
    }

    /// Removes what dead controls have left: their pins, drafts of pins, and what else carries their name, like sockets.
    /// `own`: the machine for which all this is done.
    fn sweep(&self, own: &str) {
        let Ok(entries) = std::fs::read_dir(&self.path) else {
            return;
        };
        for entry in entries.flatten() {
            let name = entry.file_name();
            let is_dead = |machine: &str| {
                machine != own
                    && check_machine(machine).is_ok()
                    && matches!(open_alive(&path_in(&self.path, machine)), Ok(None))
            };
            let left_over = match name.to_str() {
                // Whoever makes one holds the lock.
                Some(name) if name.starts_with(DRAFT_PREFIX) => true,
                Some(name) if name.starts_with("isocnc-") => {
                    name.split_once('.').is_some_and(|(_, machine)| is_dead(machine))
                }
                Some(_) | None => false,
            };
            if left_over {
                // What cannot be removed does no harm.
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// The controls of this user that are running, by name.
pub fn find() -> Vec<Found> {
    find_in(&directories())
}

pub(crate) fn find_in(directories: &[PathBuf]) -> Vec<Found> {
    let mut found = Vec::new();
    for path in directories
        .iter()
        .filter_map(|dir| std::fs::read_dir(dir).ok())
        .flatten()
        .flatten()
        .map(|entry| entry.path())
    {
        let Some(machine) = path
            .file_name()
            .and_then(|name| name.to_str())
            .and_then(|name| name.strip_prefix(PREFIX))
        else {
            continue;
        };
        // A file that is damaged, foreign or left over is not a running control.
        if check_machine(machine).is_ok()
            && let Ok(Some((_, words))) = open_alive(&path)
        {
            found.push(Found {
                machine: machine.to_owned(),
                pid: words.pid(),
                path: path.clone(),
            });
        }
    }
    found.sort_by(|a, b| a.machine.cmp(&b.machine));
    found
}

pub(crate) fn path_in(directory: &Path, machine: &str) -> PathBuf {
    directory.join(format!("{PREFIX}{machine}"))
}

/// A file of this process. Dropping it removes the file and gives the lock back.
pub(crate) struct OwnFile {
    path: PathBuf,
    file: File,
}

impl OwnFile {
    /// Makes the file in the first of the directories that takes it.
    pub(crate) fn create(
        directories: &[PathBuf],
        machine: &str,
        capacity: usize,
    ) -> Result<(OwnFile, Words), HalError> {
        check_machine(machine)?;
        // In whichever folder: a machine is run by one control.
        for directory in directories {
            if let Ok(Some((_, words))) = open_alive(&path_in(directory, machine)) {
                return Err(HalError::Running {
                    machine: machine.to_owned(),
                    pid: words.pid(),
                });
            }
        }
        let mut refused = HalError::NoDirectory;
        for directory in directories {
            match OwnFile::create_at(directory, machine, capacity) {
                Err(error @ HalError::System { .. }) => refused = error,
                done => return done,
            }
        }
        Err(refused)
    }

    fn create_at(directory: &Path, machine: &str, capacity: usize) -> Result<(OwnFile, Words), HalError> {
        let folder = Folder::open(directory, "create")?;
        folder.lock()?;
        let path = path_in(directory, machine);
        // Hidden, so that `find` passes it by; unique, so that processes and threads do not meet.
        let unique = format!(
            "{DRAFT_PREFIX}{machine}.{}.{:?}",
            std::process::id(),
            std::thread::current().id()
        );
        let draft = Draft(directory.join(unique));
        let failed = |doing| {
            let path = draft.0.clone();
            move |cause| HalError::System { path, doing, cause }
        };
        let file = new_file(&draft.0).map_err(failed("create"))?;
        let len = file_len(capacity);
        file.set_len(len as u64).map_err(failed("set the length of"))?;
        let map = map(&file, len).map_err(failed("map"))?;
        let words = Words::format(map, &file, capacity);
        lock(&file).map_err(failed("lock"))?;

        for _ in 0..ATTEMPTS {
            match std::fs::hard_link(&draft.0, &path) {
                Ok(()) => {
                    drop(draft);
                    folder.sweep(machine);
                    return Ok((OwnFile { path, file }, words));
                }
                Err(cause) if cause.kind() == std::io::ErrorKind::AlreadyExists => remove_left_over(&path, machine)?,
                Err(cause) => {
                    return Err(HalError::System {
                        path,
                        doing: "link",
                        cause,
                    });
                }
            }
        }
        Err(HalError::Running {
            machine: machine.to_owned(),
            pid: 0,
        })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for OwnFile {
    fn drop(&mut self) {
        if same_file(&self.file, &self.path) {
            // Nothing can be done about a failure: the lost lock will mark the file as left over.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Makes a file of this length beside the pins of a machine, of which this process is the control; in place of what an earlier one has
/// left there. The name of the machine stands behind the first dot of `name`, so that it is swept with what else is that machine's.
pub(crate) fn create_beside(pins: &Path, name: &str, len: usize) -> Result<(OwnFile, Mapped), HalError> {
    let directory = pins.parent().unwrap_or(Path::new("/"));
    // Nobody sweeps drafts meanwhile.
    let folder = Folder::open(directory, "create")?;
    folder.lock()?;
    let draft = Draft(directory.join(format!("{DRAFT_PREFIX}{name}.{}", std::process::id())));
    let failed = |doing| {
        let path = draft.0.clone();
        move |cause| HalError::System { path, doing, cause }
    };
    let file = new_file(&draft.0).map_err(failed("create"))?;
    // All of it, now: no cycle is to find that there is no memory.
    fallocate(&file, FallocateFlags::empty(), 0, len as i64)
        .map_err(std::io::Error::from)
        .map_err(failed("find memory for"))?;
    let mapped = Mapped::new(map(&file, len).map_err(failed("map"))?, &file);
    lock(&file).map_err(failed("lock"))?;
    let path = directory.join(name);
    std::fs::rename(&draft.0, &path).map_err(failed("rename"))?;
    Ok((OwnFile { path, file }, mapped))
}

fn new_file(path: &Path) -> std::io::Result<File> {
    OpenOptions::new()
        .read(true)
        .write(true)
        .create_new(true)
        .mode(0o600)
        .custom_flags(libc::O_NOFOLLOW)
        .open(path)
}

/// Maps a file with all its pages.
pub(crate) fn map(file: &File, len: usize) -> std::io::Result<MmapRaw> {
    MmapOptions::new().len(len).populate().map_raw(file)
}

/// Removes the name under which a file was filled, whatever came of it.
struct Draft(PathBuf);

impl Drop for Draft {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Removes `path` if its process is dead.
fn remove_left_over(path: &Path, machine: &str) -> Result<(), HalError> {
    let file = match open(path) {
        Ok(file) => file,
        Err(HalError::System { cause, .. }) if cause.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error),
    };
    // Holding the lock of the dead owner makes sure that no other new control is doing the same with this very file.
    if lock(&file).is_err() {
        let pid = open_alive(path).ok().flatten().map_or(0, |(_, words)| words.pid());
        return Err(HalError::Running {
            machine: machine.to_owned(),
            pid,
        });
    }
    if same_file(&file, path) {
        std::fs::remove_file(path).map_err(|cause| HalError::System {
            path: path.to_owned(),
            doing: "remove",
            cause,
        })?;
    }
    Ok(())
}

/// Opens and checks the file of a control; `None` if none is running behind it.
pub(crate) fn open_alive(path: &Path) -> Result<Option<(File, Words)>, HalError> {
    let file = match open(path) {
        Ok(file) => file,
        Err(HalError::System { cause, .. }) if cause.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    if !is_locked(&file).map_err(|cause| HalError::System {
        path: path.to_owned(),
        doing: "ask for the lock of",
        cause,
    })? {
        return Ok(None);
    }
    map_checked(&file, path).map(|words| Some((file, words)))
}

/// Maps a file after checking its header.
pub(crate) fn map_checked(file: &File, path: &Path) -> Result<Words, HalError> {
    let system = |doing| {
        move |cause| HalError::System {
            path: path.to_owned(),
            doing,
            cause,
        }
    };
    let corrupt = |what| HalError::Corrupt {
        path: path.to_owned(),
        what,
    };
    let len = file.metadata().map_err(system("ask for the length of"))?.len();
    let longest = file_len(crate::CAPACITY_MAX) as u64;
    if len < file_len(1) as u64 || len > longest {
        return Err(corrupt(format!(
            "{len} octets are no pins of a control: expected {} to {longest}",
            file_len(1)
        )));
    }
    let map = map(file, len as usize).map_err(system("map"))?;
    Words::check(map, file).map_err(corrupt)
}

pub(crate) fn open(path: &Path) -> Result<File, HalError> {
    let system = |doing| {
        move |cause| HalError::System {
            path: path.to_owned(),
            doing,
            cause,
        }
    };
    let found = std::fs::symlink_metadata(path).map_err(system("open"))?;
    let me = nix::unistd::geteuid();
    if found.uid() != me.as_raw() && !me.is_root() {
        return Err(HalError::Foreign {
            path: path.to_owned(),
            owner: found.uid(),
        });
    }
    if !found.is_file() {
        return Err(HalError::Corrupt {
            path: path.to_owned(),
            what: "not a regular file".into(),
        });
    }
    OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(libc::O_NOFOLLOW)
        .open(path)
        .map_err(system("open"))
}

fn whole_file(lock_type: i32) -> libc::flock {
    libc::flock {
        l_type: lock_type as i16,
        l_whence: libc::SEEK_SET as i16,
        l_start: 0,
        l_len: 0,
        l_pid: 0,
    }
}

fn lock(file: &File) -> std::io::Result<()> {
    fcntl(file, FcntlArg::F_OFD_SETLK(&whole_file(libc::F_WRLCK)))?;
    Ok(())
}

/// Whether somebody holds the lock; takes none itself, so readers never get in the way of an owner.
pub(crate) fn is_locked(file: &File) -> std::io::Result<bool> {
    let mut answer = whole_file(libc::F_WRLCK);
    fcntl(file, FcntlArg::F_OFD_GETLK(&mut answer))?;
    Ok(i32::from(answer.l_type) != libc::F_UNLCK)
}

/// The same of one octet.
pub(crate) fn lock_octet(file: &File, octet: i64) -> std::io::Result<()> {
    fcntl(file, FcntlArg::F_OFD_SETLK(&one_octet(octet)))?;
    Ok(())
}

pub(crate) fn is_octet_locked(file: &File, octet: i64) -> std::io::Result<bool> {
    let mut answer = one_octet(octet);
    fcntl(file, FcntlArg::F_OFD_GETLK(&mut answer))?;
    Ok(i32::from(answer.l_type) != libc::F_UNLCK)
}

fn one_octet(octet: i64) -> libc::flock {
    libc::flock {
        l_start: octet,
        l_len: 1,
        ..whole_file(libc::F_WRLCK)
    }
}

pub(crate) fn same_file(file: &File, path: &Path) -> bool {
    match (file.metadata(), std::fs::symlink_metadata(path)) {
        (Ok(a), Ok(b)) => (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{Permissions, create_dir, set_permissions, write};
    use std::os::unix::fs::{PermissionsExt, symlink};

    #[test]
    fn a_folder_is_made_for_one_user_alone_and_no_other_is_taken() {
        let base = tempfile::tempdir().unwrap();
        let at = |name: &str| base.path().join(name);
        Folder::make(&at("new")).unwrap();
        assert_eq!(std::fs::metadata(at("new")).unwrap().mode() & 0o7777, 0o700);
        Folder::make(&at("new")).unwrap();
        create_dir(at("open")).unwrap();
        set_permissions(at("open"), Permissions::from_mode(0o777)).unwrap();
        let open = Folder::make(&at("open")).unwrap_err().to_string();
        assert!(open.contains("others may enter (mode 777, wanted is 700)"), "{open}");
        // Not where another one points either.
        symlink(at("new"), at("link")).unwrap();
        assert!(matches!(Folder::make(&at("link")), Err(HalError::System { .. })));
        write(at("file"), "").unwrap();
        assert!(matches!(Folder::make(&at("file")), Err(HalError::System { .. })));
        if nix::unistd::geteuid().is_root() {
            std::os::unix::fs::chown(at("new"), Some(65_534), None).unwrap();
            assert!(matches!(
                Folder::make(&at("new")),
                Err(HalError::Foreign { owner: 65_534, .. })
            ));
        }
    }

    #[test]
    fn places_lie_in_memory_and_each_is_of_one_user() {
        for place in candidate_folders() {
            assert!(is_memory(place.parent().unwrap()), "{}", place.display());
            assert!(place.file_name().unwrap().to_str().unwrap().starts_with("isocnc"));
        }
    }
}
