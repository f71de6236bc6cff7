//! The script that keeps a core free, `scripts/isolcpus.sh`: where it is on this PC; it is a part of the program, too.
//!
//! In:  the path of the running program. Out: a path that a cure can name, or the files themselves.

use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

const NAME: &str = "isolcpus.sh";
/// Where packages and `isolcpus.sh persist` put it.
const FOLDERS: [&str; 2] = ["/usr/share/isocnc", "/usr/local/lib/isocnc"];
/// From the program upwards, the folder of a source tree that holds it.
const IN_SOURCES: &str = "scripts";

/// The script and the folder with its parts.
const FILES: [(&str, &str); 7] = [
    (NAME, include_str!("../../../../scripts/isolcpus.sh")),
    ("isolcpus/boot.sh", include_str!("../../../../scripts/isolcpus/boot.sh")),
    ("isolcpus/cpus.sh", include_str!("../../../../scripts/isolcpus/cpus.sh")),
    (
        "isolcpus/files.sh",
        include_str!("../../../../scripts/isolcpus/files.sh"),
    ),
    (
        "isolcpus/items.sh",
        include_str!("../../../../scripts/isolcpus/items.sh"),
    ),
    (
        "isolcpus/persist.sh",
        include_str!("../../../../scripts/isolcpus/persist.sh"),
    ),
    (
        "isolcpus/runtime.sh",
        include_str!("../../../../scripts/isolcpus/runtime.sh"),
    ),
];

/// Where the script is: in the source tree that the program was built in, or where it is installed.
pub fn find(program: &Path) -> Option<PathBuf> {
    let sources = program.ancestors().skip(1).map(|folder| folder.join(IN_SOURCES));
    let installed = FOLDERS.iter().map(PathBuf::from);
    let whole = |folder: &PathBuf| FILES.iter().all(|(name, _)| folder.join(name).is_file());
    Some(sources.chain(installed).find(whole)?.join(NAME))
}

/// Writes the script and its parts into a folder; gives the path of the script. Files that are there already are left alone.
///
/// # Errors
/// What the file system refuses.
pub fn write(folder: &Path) -> io::Result<PathBuf> {
    std::fs::create_dir_all(folder.join("isolcpus"))?;
    for (name, text) in FILES {
        // Never through a link that somebody has put there: root will run it.
        let mut file = std::fs::OpenOptions::new()
            .write(true)
            .create_new(true)
            .mode(0o755)
            .open(folder.join(name))?;
        io::Write::write_all(&mut file, text.as_bytes())?;
    }
    Ok(folder.join(NAME))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_whole_runs_and_is_found() {
        let parts = std::fs::read_dir("../../scripts/isolcpus").unwrap().count();
        assert_eq!(parts + 1, FILES.len(), "every part is written");
        let folder = tempfile::tempdir().unwrap();
        let script = write(&folder.path().join("scripts")).unwrap();
        let said = std::process::Command::new(&script).arg("--help").output().unwrap();
        let said = String::from_utf8_lossy(&said.stdout).into_owned() + &String::from_utf8_lossy(&said.stderr);
        assert!(said.contains("usage: isolcpus.sh status|apply|persist|undo"), "{said}");
        assert_eq!(find(&folder.path().join("target/debug/isocnc")), Some(script));
        // What is there already stays.
        let refused = write(&folder.path().join("scripts")).unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::AlreadyExists);
    }
}
