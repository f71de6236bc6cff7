//! What a machine knows again when it is started anew: where its joints stood, the tool in the spindle, parts made, lines of MDI,
//! the last program.
//!
//! In:  `state.json` in the state folder. Out: its content; a new one in its place, as a whole (see [`super::safe_file`]).
//!
//! The first line is `isocnc-state VERSION OCTETS CRC32`, of the JSON object behind it. A file that is cut short, changed, of
//! another version or of another machine is never believed in part: it is kept aside under another name, and the machine begins
//! without it.

use super::safe_file::{self, Files};
use protocol::LastResult;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Version of the format that is written, and the only one that is read.
const VERSION: u32 = 1;
/// First word of the file.
const MARK: &str = "isocnc-state";
const NAME: &str = "state.json";
/// Longest file that is read, octets; a full one has a twentieth of it.
const FILE_MAX: u64 = 1 << 20;
/// Files kept aside at the most.
const ASIDE_MAX: usize = 1000;
/// Lines of MDI that are kept.
pub const MDI_MAX: usize = 100;

/// What is kept.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Remembered {
    /// Name of the machine.
    pub machine: String,
    /// One for each joint.
    pub joints: Vec<Place>,
    /// Tool in the spindle, 0: none.
    pub tool: u32,
    /// Tool whose change had begun and was not done.
    #[serde(default)]
    pub changing: Option<u32>,
    pub parts: Parts,
    /// Programs that were run so far: the number of the last report.
    pub programs: u64,
    /// Lines of MDI, the latest last.
    pub mdi: Vec<String>,
    /// The program that was begun last.
    pub program: Option<LastProgram>,
}

/// Where a joint stood when it was last seen at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    pub homed: bool,
    /// Position that its motor had then, mm (degrees): what the drive counted, from where the joint was homed.
    pub motor_mm: f64,
    /// What the drive counted, as it sends it.
    pub counts: i32,
    /// Counts per mm (degree) at that time.
    pub counts_per_mm: f64,
}

/// Parts made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parts {
    /// Programs that came to their end since the counter was set.
    pub count: u64,
    /// How many are wanted, if somebody has said so.
    pub target: Option<u64>,
}

impl fmt::Display for Parts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.target {
            Some(target) => write!(f, "{} of {target}", self.count),
            None => write!(f, "{}", self.count),
        }
    }
}

/// The program that was loaded or begun last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LastProgram {
    pub name: String,
    /// Line that it had reached.
    pub line: u32,
    /// What became of it; `None`: it is under way.
    pub result: Option<LastResult>,
}

/// A state folder that was looked into.
#[derive(Debug, Default)]
pub struct Opened {
    pub remembered: Remembered,
    /// What the operator should know of it.
    pub warning: Option<String>,
}

/// Reads what the last control of this machine has left. What cannot be used is kept aside and told.
pub fn open(folder: &Path, machine: &str) -> Opened {
    let path = folder.join(NAME);
    let why = match files::read(&path, FILE_MAX) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return fresh(machine, None),
        Err(error) => error.to_string(),
        Ok(content) => match parse(&content) {
            Ok(remembered) if remembered.machine == machine => {
                return Opened {
                    remembered,
                    warning: None,
                };
            }
            Ok(other) => format!(
                "it is that of the machine \"{}\", this one is \"{machine}\"",
                other.machine
            ),
            Err(why) => why,
        },
    };
    let begins = "joints are to be homed, tool in the spindle, parts and history of MDI begin anew";
    let aside = match put_aside(&path) {
        Ok(aside) => format!("the file is kept as {}", aside.display()),
        Err(error) => format!("it cannot be kept aside: {error}"),
    };
    let older = folder.join(format!("{NAME}.bak"));
    let back = match older.is_file() {
        true => format!(
            "; {} is what it was before: to go on with that, end this control and give it the name {NAME}",
            older.display()
        ),
        false => String::new(),
    };
    fresh(
        machine,
        Some(format!("{}: {why}; {aside}; {begins}{back}", path.display())),
    )
}

/// Puts a new file in place of the old one, which stays as `state.json.bak`.
///
/// # Errors
/// Of the file system.
pub fn save(disk: &mut impl Files, folder: &Path, remembered: &Remembered) -> io::Result<()> {
    safe_file::replace(disk, &folder.join(NAME), &write(remembered)?).map(|_| ())
}

fn fresh(machine: &str, warning: Option<String>) -> Opened {
    Opened {
        remembered: Remembered {
            machine: machine.to_owned(),
            ..Remembered::default()
        },
        warning,
    }
}

/// What a file is to hold.
///
/// # Errors
/// A number that JSON has not.
pub fn write(remembered: &Remembered) -> io::Result<Vec<u8>> {
    let mut content = serde_json::to_vec_pretty(remembered)?;
    content.push(b'\n');
    Ok(framed(&content))
}

/// The first line, and content behind it.
pub fn framed(content: &[u8]) -> Vec<u8> {
    frame(MARK, content)
}

/// A first line `MARK VERSION OCTETS CRC32`, and content behind it.
pub(super) fn frame(mark: &str, content: &[u8]) -> Vec<u8> {
    let head = format!("{mark} {VERSION} {} {:08x}\n", content.len(), crc32fast::hash(content));
    [head.as_bytes(), content].concat()
}

/// What a file holds.
///
/// # Errors
/// Why it cannot be believed.
pub fn parse(text: &[u8]) -> Result<Remembered, String> {
    let content = unframe(MARK, text)?;
    serde_json::from_slice(content).map_err(|error| format!("it is not understood: {error}"))
}

/// The content behind the first line.
pub(super) fn unframe<'t>(mark: &str, text: &'t [u8]) -> Result<&'t [u8], String> {
    let no_state = || "this is no state of a machine".to_owned();
    let end = text.iter().position(|octet| *octet == b'\n').ok_or_else(no_state)?;
    let (head, content) = (&text[..end], &text[end + 1..]);
    let head = std::str::from_utf8(head).map_err(|_| no_state())?;
    let words: Vec<&str> = head.split(' ').collect();
    let [first, version, octets, sum] = words[..] else {
        return Err(no_state());
    };
    if first != mark {
        return Err(no_state());
    }
    match version.parse() {
        Ok(VERSION) => {}
        Ok(version) if version > VERSION => {
            return Err(format!(
                "it is of format {version}, of a newer isocnc; this one reads format {VERSION}"
            ));
        }
        Ok(version) => {
            return Err(format!(
                "it is of the older format {version}; this isocnc reads format {VERSION}"
            ));
        }
        Err(_) => return Err(no_state()),
    }
    let octets: usize = octets.parse().map_err(|_| no_state())?;
    let sum = u32::from_str_radix(sum, 16).map_err(|_| no_state())?;
    if content.len() < octets {
        return Err(format!("it is cut short: {} of {octets} octets", content.len()));
    }
    if content.len() > octets || crc32fast::hash(content) != sum {
        return Err("it was changed since it was written: its checksum is another one".into());
    }
    Ok(content)
}

/// Gives a file, or whatever has its name, another name that nothing has yet.
pub(super) fn put_aside(path: &Path) -> io::Result<PathBuf> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    for number in 1..=ASIDE_MAX {
        let aside = path.with_file_name(format!("{name}.bad-{number}"));
        if std::fs::symlink_metadata(&aside).is_err() {
            std::fs::rename(path, &aside)?;
            return Ok(aside);
        }
    }
    Err(io::Error::other(format!("there are {ASIDE_MAX} such files already")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::safe_file::Disk;
    use proptest::prelude::*;

    fn day() -> Remembered {
        let place = |homed, motor_mm, counts| Place {
            homed,
            motor_mm,
            counts,
            counts_per_mm: 10_000.0,
        };
        Remembered {
            machine: "mill".into(),
            joints: vec![place(true, 1.25, 12_500), place(false, -0.1, -1_000)],
            tool: 5,
            changing: Some(7),
            parts: Parts {
                count: 17,
                target: Some(50),
            },
            programs: 9,
            mdi: vec!["G0 X1".into(), "M3 S1000 (\u{e4}\n)".into()],
            program: Some(LastProgram {
                name: "/p/part.ngc".into(),
                line: 40,
                result: Some(LastResult::Stopped),
            }),
        }
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn what_was_saved_is_there_again() {
        let folder = tempfile::tempdir().unwrap();
        let first = open(folder.path(), "mill");
        assert_eq!((first.remembered.joints.len(), first.warning), (0, None));
        save(&mut Disk, folder.path(), &day()).unwrap();
        let again = open(folder.path(), "mill");
        assert_eq!((again.remembered, again.warning), (day(), None));
        assert_eq!(names(folder.path()), [NAME]);
    }

    /// Nothing of a file that was cut short or changed anywhere is believed, and nothing of it is lost.
    #[test]
    fn a_file_that_was_cut_short_is_kept_aside_at_any_length() {
        let whole = write(&day()).unwrap();
        for length in 0..whole.len() {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(NAME);
            std::fs::write(&path, &whole[..length]).unwrap();
            let opened = open(folder.path(), "mill");
            assert_eq!(opened.remembered, fresh("mill", None).remembered, "{length}");
            assert!(opened.warning.is_some(), "{length}");
            assert_eq!(names(folder.path()), ["state.json.bad-1"]);
            let kept = std::fs::read(folder.path().join("state.json.bad-1")).unwrap();
            assert_eq!(kept, whole[..length]);
        }
    }

    proptest! {
        #[test]
        fn a_bit_that_has_turned_is_seen(at in 0_usize..10_000, bit in 0_u8..8) {
            let mut text = write(&day()).unwrap();
            let at = at % text.len();
            text[at] ^= 1 << bit;
            let parsed = parse(&text);
            // The checksum says the same in capitals.
            prop_assert!(parsed.is_err() || parsed == Ok(day()) && text[at].is_ascii_alphabetic());
        }

        #[test]
        fn any_octets_are_refused(text in proptest::collection::vec(any::<u8>(), 0..200)) {
            prop_assert!(parse(&text).is_err());
        }
    }

    #[test]
    fn each_bad_file_is_told_in_words_with_the_way_back() {
        let whole = String::from_utf8(write(&day()).unwrap()).unwrap();
        let version = |number| whole.replacen("isocnc-state 1 ", &format!("isocnc-state {number} "), 1);
        let foreign = "{\"machine\":\"mill\",\"speed\":1}";
        let unknown = format!(
            "isocnc-state 1 {} {:08x}\n{foreign}",
            foreign.len(),
            crc32fast::hash(foreign.as_bytes())
        );
        for (text, why) in [
            (whole[..whole.len() / 2].to_owned(), "it is cut short: "),
            (
                whole.replace("\"count\": 17", "\"count\": 99"),
                "it was changed since it was written",
            ),
            (format!("{whole}\n"), "it was changed since it was written"),
            (
                version(2),
                "it is of format 2, of a newer isocnc; this one reads format 1",
            ),
            (version(0), "it is of the older format 0; this isocnc reads format 1"),
            ("G21\nG0 X1\n".into(), "this is no state of a machine"),
            (String::new(), "this is no state of a machine"),
            (unknown, "it is not understood: unknown field `speed`"),
        ] {
            let folder = tempfile::tempdir().unwrap();
            save(&mut Disk, folder.path(), &Remembered::default()).unwrap();
            save(&mut Disk, folder.path(), &day()).unwrap();
            std::fs::write(folder.path().join(NAME), &text).unwrap();
            let opened = open(folder.path(), "mill");
            let warning = opened.warning.expect("a warning");
            assert!(warning.contains(why), "{warning}");
            for part in [
                "state.json.bad-1; joints are to be homed",
                "end this control and give it the name state.json",
            ] {
                assert!(warning.contains(part), "{part}: {warning}");
            }
            assert_eq!(
                std::fs::read_to_string(folder.path().join("state.json.bad-1")).unwrap(),
                text
            );
            // The next one does not take its place.
            std::fs::write(folder.path().join(NAME), "x").unwrap();
            assert!(open(folder.path(), "mill").warning.is_some());
            assert_eq!(
                names(folder.path()),
                ["state.json.bad-1", "state.json.bad-2", "state.json.bak"]
            );
        }
        let folder = tempfile::tempdir().unwrap();
        save(&mut Disk, folder.path(), &day()).unwrap();
        let warning = open(folder.path(), "lathe").warning.expect("a warning");
        assert!(
            warning.contains("it is that of the machine \"mill\", this one is \"lathe\""),
            "{warning}"
        );
    }

    #[test]
    fn what_is_no_file_is_kept_aside_as_well() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        std::fs::create_dir(&path).unwrap();
        assert!(open(folder.path(), "mill").warning.is_some());
        std::os::unix::fs::symlink("/dev/zero", &path).unwrap();
        assert!(open(folder.path(), "mill").warning.is_some());
        nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRWXU).unwrap();
        assert!(open(folder.path(), "mill").warning.is_some());
        std::fs::File::create(&path).unwrap().set_len(FILE_MAX + 1).unwrap();
        assert!(open(folder.path(), "mill").warning.is_some());
        let aside = [
            "state.json.bad-1",
            "state.json.bad-2",
            "state.json.bad-3",
            "state.json.bad-4",
        ];
        assert_eq!(names(folder.path()), aside);
        assert!(Path::new("/dev/zero").exists());
        // And the machine goes on with a new one.
        save(&mut Disk, folder.path(), &day()).unwrap();
        assert_eq!(open(folder.path(), "mill").remembered, day());
    }
}
