//! RETAIN variables of a program in Structured Text, from one session of a control to the next.
//!
//! In:  `logic-NAME.retain` in the state folder. Out: its content; a new one in its place, as a whole (see [`super::safe_file`]).
//!
//! Framed as the state of the machine is (see [`super::state_file`]): a file that is cut short, changed, of another machine or
//! program is never believed in part, but kept aside.

use super::safe_file::{self, Files};
use super::state_file::{frame, put_aside, unframe};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};

/// First word of the file.
const MARK: &str = "isocnc-retain";
/// Longest file that is read, octets: 65,536 values with long names.
const FILE_MAX: u64 = 64 << 20;

/// What is kept of a program.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kept {
    /// Name of the machine.
    pub machine: String,
    /// Time of the program, ns: its timers go on from there.
    pub time_ns: i64,
    pub variables: Vec<Retained>,
}

/// A RETAIN variable: an enumeration by the name of its value, all others by the number that stands for it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Retained {
    /// With the name of its program.
    pub name: String,
    #[serde(rename = "type")]
    pub ty: String,
    pub value: String,
}

fn path(folder: &Path, program: &str) -> PathBuf {
    folder.join(format!("logic-{program}.retain"))
}

/// What the last session of this machine has left of a program; `Err`: why it cannot be believed.
///
/// # Errors
/// A file that is spoiled, another machine's, or cannot be read.
pub fn open(folder: &Path, machine: &str, program: &str) -> Result<Kept, String> {
    let path = path(folder, program);
    let why = match files::read(&path, FILE_MAX) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Kept::default()),
        Err(error) => error.to_string(),
        Ok(content) => match parse(&content) {
            Ok(kept) if kept.machine == machine => return Ok(kept),
            Ok(other) => format!(
                "it is that of the machine \"{}\", this one is \"{machine}\"",
                other.machine
            ),
            Err(why) => why,
        },
    };
    let aside = match put_aside(&path) {
        Ok(aside) => format!("the file is kept as {}", aside.display()),
        Err(error) => format!("it cannot be kept aside: {error}"),
    };
    Err(format!(
        "{}: {why}; {aside}; RETAIN variables begin anew",
        path.display()
    ))
}

/// Puts a new file in place of the old one.
///
/// # Errors
/// Of the file system.
pub fn save(disk: &mut impl Files, folder: &Path, program: &str, kept: &Kept) -> io::Result<()> {
    let content = serde_json::to_vec_pretty(kept)?;
    safe_file::put(disk, &path(folder, program), &frame(MARK, &content))
}

/// What a file holds.
///
/// # Errors
/// Why it cannot be believed.
pub fn parse(text: &[u8]) -> Result<Kept, String> {
    let content = unframe(MARK, text)?;
    serde_json::from_slice(content).map_err(|error| format!("it is not understood: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::safe_file::Disk;

    fn kept() -> Kept {
        Kept {
            machine: "mill".into(),
            time_ns: 5_000_000_000,
            variables: vec![Retained {
                name: "p.parts".into(),
                ty: "DINT".into(),
                value: "-17".into(),
            }],
        }
    }

    #[test]
    fn what_is_saved_is_opened_again_and_another_machine_s_is_kept_aside() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(open(folder.path(), "mill", "cell"), Ok(Kept::default()));
        save(&mut Disk, folder.path(), "cell", &kept()).unwrap();
        assert_eq!(open(folder.path(), "mill", "cell"), Ok(kept()));
        assert_eq!(open(folder.path(), "mill", "door"), Ok(Kept::default()));
        let why = open(folder.path(), "lathe", "cell").unwrap_err();
        assert!(
            why.contains("that of the machine \"mill\"") && why.contains("logic-cell.retain.bad-1"),
            "{why}"
        );
        assert_eq!(open(folder.path(), "lathe", "cell"), Ok(Kept::default()));
    }

    #[test]
    fn a_file_is_believed_as_a_whole_or_not_at_all() {
        let whole = frame(MARK, &serde_json::to_vec_pretty(&kept()).unwrap());
        assert_eq!(parse(&whole), Ok(kept()));
        for end in 0..whole.len() {
            assert!(parse(&whole[..end]).is_err(), "{end}");
        }
        for at in 0..whole.len() {
            let mut changed = whole.clone();
            changed[at] ^= 1;
            assert!(parse(&changed).is_err(), "{at}");
        }
    }
}
