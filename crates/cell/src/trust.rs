//! Folders and files of the supervisor are nobody else's: who could write there could make machines, orders, or have it write elsewhere.
//!
//! In:  a path. Out: in words, what another user could have done there.

use nix::unistd::geteuid;
use std::fs::Metadata;
use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

fn refused(what: String) -> io::Error {
    io::Error::new(ErrorKind::PermissionDenied, what)
}

fn is_own(found: &Metadata) -> io::Result<()> {
    let (uid, own) = (found.uid(), geteuid().as_raw());
    match uid == own || uid == 0 {
        true => Ok(()),
        false => Err(refused(format!(
            "belongs to user {uid}, who could change it: it must be of user {own}"
        ))),
    }
}

/// A folder of this user, in which nobody else can write.
///
/// # Errors
/// It is not, or cannot be looked at.
pub(crate) fn folder(path: &Path) -> io::Result<()> {
    let found = std::fs::metadata(path)?;
    is_own(&found)?;
    match found.mode() & 0o022 {
        0 => Ok(()),
        _ => Err(refused("others can write there: chmod go-w it".into())),
    }
}

/// A file of this user that is no link, or none yet.
///
/// # Errors
/// Something else stands there.
pub(crate) fn file(path: &Path) -> io::Result<()> {
    let found = match std::fs::symlink_metadata(path) {
        Err(cause) if cause.kind() == ErrorKind::NotFound => return Ok(()),
        found => found?,
    };
    is_own(&found)?;
    match found.is_file() {
        true => Ok(()),
        false if found.is_symlink() => Err(refused("is a link, which is not followed".into())),
        false => Err(refused("is no file".into())),
    }
}

/// A file that nobody else may read.
///
/// # Errors
/// Others may, or it is not there.
pub(crate) fn secret(path: &Path) -> io::Result<()> {
    let found = std::fs::metadata(path)?;
    is_own(&found)?;
    match found.mode() & 0o077 {
        0 => Ok(()),
        _ => Err(refused(
            "others may read or write this key: chmod 600 it, and have a new one made".into(),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::Permissions;
    use std::os::unix::fs::{PermissionsExt, symlink};

    #[test]
    fn what_others_could_have_changed_is_refused_in_words() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let told = |result: io::Result<()>| result.unwrap_err().to_string();
        std::fs::create_dir(at("open")).unwrap();
        std::fs::set_permissions(at("open"), Permissions::from_mode(0o777)).unwrap();
        assert!(told(folder(&at("open"))).contains("others can write"));
        assert!(folder(place.path()).is_ok() && folder(&at("none")).is_err());
        std::fs::write(at("key"), "x").unwrap();
        std::fs::set_permissions(at("key"), Permissions::from_mode(0o640)).unwrap();
        assert!(told(secret(&at("key"))).contains("chmod 600"));
        std::fs::set_permissions(at("key"), Permissions::from_mode(0o600)).unwrap();
        assert!(secret(&at("key")).is_ok() && file(&at("key")).is_ok() && file(&at("none")).is_ok());
        symlink(at("key"), at("link")).unwrap();
        assert!(told(file(&at("link"))).contains("is a link"));
        assert!(told(file(&at("open"))).contains("is no file"));
        if geteuid().is_root() {
            std::os::unix::fs::chown(at("key"), Some(12_345), None).unwrap();
            assert!(told(file(&at("key"))).contains("belongs to user 12345"));
        }
    }
}
