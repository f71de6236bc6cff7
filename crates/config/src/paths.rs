//! Files and folders that keys name, relative to the folder of the machine file.

use super::section::Section;
use std::path::{Path, PathBuf};

/// Folders that are searched for one file.
const FOLDERS_MAX: usize = 10;

/// Whether a file may be made later.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum MayBeMissing {
    Yes,
    No,
}

impl Section<'_, '_> {
    /// A file; left out: `Some(None)`.
    pub(super) fn file(
        &mut self,
        key: &'static str,
        base: &Path,
        may_be_missing: MayBeMissing,
    ) -> Option<Option<PathBuf>> {
        let Some(path) = self.path(key, base)? else {
            return Some(None);
        };
        let rule = match std::fs::metadata(&path) {
            Ok(metadata) if metadata.is_file() => return Some(Some(path)),
            Ok(_) => format!("is no file: {}", path.display()),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound && may_be_missing == MayBeMissing::Yes => {
                let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
                match folder {
                    Some(folder) if !folder.is_dir() => format!("there is no folder {}", folder.display()),
                    Some(_) | None => return Some(Some(path)),
                }
            }
            Err(error) => format!("{}: {error}", path.display()),
        };
        self.refused(key, rule)
    }

    /// A folder that is there; left out: `Some(None)`.
    pub(super) fn folder(&mut self, key: &'static str, base: &Path) -> Option<Option<PathBuf>> {
        let Some(path) = self.path(key, base)? else {
            return Some(None);
        };
        if !path.is_dir() {
            return self.refused(key, format!("there is no folder {}", path.display()));
        }
        Some(Some(path))
    }

    /// A folder that is made if it is missing, in one that is there.
    pub(super) fn new_folder(&mut self, key: &'static str, base: &Path) -> Option<Option<PathBuf>> {
        let Some(path) = self.path(key, base)? else {
            return Some(None);
        };
        let is_folder = path.is_dir();
        // A path of one word lies where the process runs.
        let beside = |parent: &Path| parent.as_os_str().is_empty() || parent.is_dir();
        let can_be_made = !path.exists() && path.parent().is_some_and(beside);
        if !is_folder && !can_be_made {
            return self.refused(key, format!("{} is no folder and cannot be made", path.display()));
        }
        Some(Some(path))
    }

    pub(super) fn path(&mut self, key: &'static str, base: &Path) -> Option<Option<PathBuf>> {
        let Some(text) = self.optional_text(key)? else {
            return Some(None);
        };
        if text.is_empty() {
            return self.refused(key, "must be a path");
        }
        Some(Some(base.join(text)))
    }

    /// Folders in the order in which they are searched; left out: none.
    pub(super) fn folders(&mut self, key: &'static str, base: &Path) -> Option<Vec<PathBuf>> {
        let Some(item) = self.optional(key) else {
            return Some(Vec::new());
        };
        let path = self.key(key);
        let count = item.items(&path)?.len();
        if count > FOLDERS_MAX {
            return self.refused(key, format!("must not be more than {FOLDERS_MAX} folders, are {count}"));
        }
        item.list(&path, |item, path| {
            let folder = base.join(item.text(path)?);
            if !folder.is_dir() {
                return item.refused(path, format!("there is no folder {}", folder.display()));
            }
            Some(folder)
        })
    }
}
