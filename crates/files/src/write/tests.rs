//! Folders in which somebody else makes links, and disks that are full.

use super::*;
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown, symlink};
use std::path::PathBuf;

/// Any user that is neither root nor the one who runs the tests.
const STRANGER: u32 = 54321;

fn names_in(folder: &Path) -> Vec<OsString> {
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    names.sort();
    names
}

/// A link from a stranger's folder to a file that a stranger may not write; `None`: only root can make one for a test.
fn trap(folder: &Path) -> Option<(PathBuf, PathBuf)> {
    if !nix::unistd::geteuid().is_root() {
        eprintln!("skipped: links of another user can only be made as root");
        return None;
    }
    let (precious, strange) = (folder.join("precious"), folder.join("strange"));
    std::fs::write(&precious, "precious").unwrap();
    std::fs::create_dir(&strange).unwrap();
    chown(&strange, Some(STRANGER), None).unwrap();
    let link = strange.join("run.json");
    symlink(&precious, &link).unwrap();
    nix::unistd::fchownat(
        nix::fcntl::AT_FDCWD,
        &link,
        Some(STRANGER.into()),
        None,
        nix::fcntl::AtFlags::AT_SYMLINK_NOFOLLOW,
    )
    .unwrap();
    Some((precious, link))
}

#[test]
fn whether_a_file_could_be_written_is_known_before_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("old"), "old").unwrap();
    std::fs::create_dir(path("folder")).unwrap();
    check(&path("new")).unwrap();
    check(&path("old")).unwrap();
    assert_eq!(check(&path("folder")).unwrap_err().kind(), io::ErrorKind::IsADirectory);
    assert_eq!(check(&path("none/file")).unwrap_err().kind(), io::ErrorKind::NotFound);
    assert!(check(&path("old/file")).is_err());
    let mut left: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    left.sort();
    assert_eq!(left, ["folder", "old"]);
    assert_eq!(std::fs::read(path("old")).unwrap(), b"old");
}

#[test]
fn a_strangers_link_is_replaced_and_never_followed() {
    let folder = tempfile::tempdir().unwrap();
    let Some((precious, link)) = trap(folder.path()) else {
        return;
    };
    assert_eq!(append(&link).unwrap_err().kind(), io::ErrorKind::PermissionDenied);
    write(&link, "report").unwrap();
    assert_eq!(std::fs::read(&precious).unwrap(), b"precious");
    assert!(link.symlink_metadata().unwrap().is_file());
    assert_eq!(std::fs::read(&link).unwrap(), b"report");
}

#[test]
fn a_strangers_link_gets_no_stream_and_can_be_removed() {
    let folder = tempfile::tempdir().unwrap();
    let Some((precious, link)) = trap(folder.path()) else {
        return;
    };
    remove(&link).unwrap();
    assert!(!link.exists() && precious.exists());
    let Some((precious, link)) = tempfile::tempdir_in(folder.path())
        .ok()
        .and_then(|inner| trap(&inner.keep()))
    else {
        return;
    };
    create(&link).unwrap().write_all(b"capture").unwrap();
    assert_eq!(std::fs::read(&precious).unwrap(), b"precious");
    assert_eq!(std::fs::read(&link).unwrap(), b"capture");
}

#[test]
fn a_strangers_link_on_the_way_is_refused_and_nothing_is_made_behind_it() {
    let folder = tempfile::tempdir().unwrap();
    let Some((_, link)) = trap(folder.path()) else { return };
    let inside = folder.path().join("inside");
    std::fs::create_dir(&inside).unwrap();
    std::fs::remove_file(&link).unwrap();
    symlink(&inside, &link).unwrap();
    // Root's own link is followed.
    write(&link.join("file"), "1").unwrap();
    nix::unistd::fchownat(
        nix::fcntl::AT_FDCWD,
        &link,
        Some(STRANGER.into()),
        None,
        nix::fcntl::AtFlags::AT_SYMLINK_NOFOLLOW,
    )
    .unwrap();
    for refused in [
        make_folder(&link.join("a/b")),
        write(&link.join("c"), ""),
        remove(&link.join("file")),
    ] {
        let error = refused.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::PermissionDenied);
        assert_eq!(
            error.to_string(),
            "run.json: is a link of user 54321, which is not followed"
        );
    }
    assert_eq!(names_in(&inside), ["file"]);
}

#[test]
fn a_link_of_ones_own_stays_and_the_file_behind_it_gets_the_content() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::create_dir(path("real")).unwrap();
    std::fs::write(path("real/file"), "old").unwrap();
    symlink("real/../real/file", path("link")).unwrap();
    write(&path("link"), "new").unwrap();
    assert!(path("link").is_symlink());
    assert_eq!(std::fs::read(path("real/file")).unwrap(), b"new");
    symlink("round", path("round")).unwrap();
    assert!(write(&path("round"), "").is_err());
}

#[test]
fn a_file_keeps_its_mode_and_nothing_is_left_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    write(&path, "1").unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o640)).unwrap();
    write(&path, "2").unwrap();
    assert_eq!(path.metadata().unwrap().mode() & 0o777, 0o640);
    append(&path).unwrap().write_all(b"3").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"23");
    assert_eq!(names_in(folder.path()), ["file"]);
    assert_eq!(
        write(folder.path(), "").unwrap_err().kind(),
        io::ErrorKind::IsADirectory
    );
    assert_eq!(names_in(folder.path()), ["file"]);
}

/// As root, a file beside it would take the place of `/dev/null` for the whole PC.
#[test]
fn a_device_is_written_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    write(Path::new("/dev/null"), "nothing").unwrap();
    let link = folder.path().join("null");
    symlink("/dev/null", &link).unwrap();
    write(&link, "nothing").unwrap();
    assert!(std::fs::metadata("/dev/null").unwrap().rdev() != 0);
    assert!(link.is_symlink());
    let pipe = folder.path().join("pipe");
    nix::unistd::mkfifo(&pipe, Mode::S_IRWXU).unwrap();
    let error = write(&pipe, "nothing").unwrap_err().to_string();
    assert_eq!(error, "is a pipe that nobody reads, no file");
}

#[test]
fn a_full_disk_spoils_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    write(&path, "old").unwrap();
    let Ok(Begun::New(new)) = begin(&path) else { panic!() };
    let full = io::Error::from(Errno::ENOSPC);
    assert!(new.finish(Err(full)).is_err());
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    assert_eq!(names_in(folder.path()), ["file"]);
}

#[test]
fn folders_are_made_where_they_are_missing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a/b/c");
    make_folder(&path).unwrap();
    make_folder(&path).unwrap();
    write(&path.join("file"), "1").unwrap();
    assert!(make_folder(&path.join("file")).is_err());
    assert!(make_folder(&path.join("file/d")).is_err());
    remove(&path.join("file")).unwrap();
    remove(&path.join("file")).unwrap();
    assert_eq!(names_in(&path), Vec::<OsString>::new());
}
