//! The journal on the disk: what happened, one entry a line, numbered for good.
//!
//! In:  entries as they come. Out: `journal.jsonl` in the state folder, and the part before it, `journal.1.jsonl`.
//!
//! Each line is one JSON object. A line that a power cut has cut short is taken away at the next start; a file that is no
//! journal is set aside as `journal.bad.jsonl`, and a new one is begun. Numbers go on over all of that.

pub use protocol::{Acknowledged, AlarmRecord, Entry, EntryKind as Kind, ProgramRecord};
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// From this length on a new file is begun, octets.
const FILE_MAX: u64 = 4 << 20;
/// Longest file that is read.
const READ_MAX: u64 = 2 * FILE_MAX;
/// Entries that are written at once, at the most.
const CHUNK: usize = 1_000;

/// Puts what was acknowledged later into the entries of alarms.
pub fn acknowledge(entries: &mut [Entry], seqs: &[u64], how: &Acknowledged) {
    for seq in seqs {
        if let Ok(at) = entries.binary_search_by_key(seq, |entry| entry.seq)
            && let Some(alarm) = &mut entries[at].alarm
        {
            alarm.acknowledged.get_or_insert_with(|| how.clone());
        }
    }
}

/// The open file.
#[derive(Debug)]
pub struct Journal {
    folder: PathBuf,
    file: File,
    octets: u64,
}

/// A journal that was opened.
#[derive(Debug)]
pub struct Opened {
    /// To write on.
    pub journal: Journal,
    /// Entries that it holds, the newest file only.
    pub entries: Vec<Entry>,
    /// Greatest number that was given so far, 0: none.
    pub last: u64,
    /// What the operator should know of it.
    pub warning: Option<String>,
}

impl Journal {
    /// Opens the journal of a folder, which is made if it is missing.
    ///
    /// # Errors
    /// Of the file system.
    pub fn open(folder: &Path) -> io::Result<Opened> {
        std::fs::create_dir_all(folder)?;
        let path = folder.join(NAME);
        let mut warning = None;
        let (mut entries, mut whole) = match read(&path)? {
            Content::Missing => (Vec::new(), 0),
            Content::Journal { entries, octets } => (entries, octets),
            Content::Other { line } => {
                let aside = folder.join(BAD);
                std::fs::rename(&path, &aside)?;
                warning = Some(format!(
                    "{}:{line}: is no entry of a journal; the file is kept as {} and a new one is begun",
                    path.display(),
                    aside.display()
                ));
                (Vec::new(), 0)
            }
        };
        let mut last = entries.last().map_or(0, |entry| entry.seq);
        if entries.is_empty()
            && let Content::Journal { entries: before, .. } = read(&folder.join(BEFORE))?
        {
            last = before.last().map_or(0, |entry| entry.seq);
            entries = before;
        }
        let acknowledged: Vec<_> = entries.iter().filter_map(|entry| entry.acknowledges.clone()).collect();
        for (seqs, how) in acknowledged {
            acknowledge(&mut entries, &seqs, &how);
        }
        let file = OpenOptions::new()
            .create(true)
            .append(true)
            .mode(0o600)
            .custom_flags(nix::libc::O_NOFOLLOW)
            .open(&path)?;
        let found = file.metadata()?.len();
        whole = whole.min(found);
        if whole < found {
            // What a power cut has left of the last line.
            file.set_len(whole)?;
        }
        file.sync_all()?;
        File::open(folder)?.sync_all()?;
        Ok(Opened {
            journal: Journal {
                folder: folder.to_owned(),
                file,
                octets: whole,
            },
            entries,
            last,
            warning,
        })
    }

    /// Appends entries; they are on the disk when it returns.
    ///
    /// # Errors
    /// Of the file system: a part of them may be written, and the next call begins with a line of its own.
    pub fn append(&mut self, entries: &[Entry]) -> io::Result<()> {
        // Many that have waited for room are more than one file is to hold.
        entries.chunks(CHUNK).try_for_each(|entries| self.append_few(entries))
    }

    fn append_few(&mut self, entries: &[Entry]) -> io::Result<()> {
        if self.octets > FILE_MAX {
            self.begin_file()?;
        }
        let mut lines = Vec::new();
        for entry in entries {
            serde_json::to_writer(&mut lines, entry)?;
            lines.push(b'\n');
        }
        let written = self.file.write_all(&lines).and_then(|()| self.file.sync_data());
        match written {
            Ok(()) => {
                self.octets += lines.len() as u64;
                Ok(())
            }
            Err(error) => {
                // Nothing of a line that is not whole may stay before the next one.
                let _ = self.file.set_len(self.octets);
                Err(error)
            }
        }
    }

    fn begin_file(&mut self) -> io::Result<()> {
        let path = self.folder.join(NAME);
        match std::fs::rename(&path, self.folder.join(BEFORE)) {
            // Done by an attempt that found no room for the new one.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            renamed => renamed?,
        }
        self.file = OpenOptions::new()
            .create(true)
            .append(true)
            .mode(0o600)
            .custom_flags(nix::libc::O_NOFOLLOW)
            .open(&path)?;
        self.octets = 0;
        File::open(&self.folder)?.sync_all()
    }
}

const NAME: &str = "journal.jsonl";
const BEFORE: &str = "journal.1.jsonl";
const BAD: &str = "journal.bad.jsonl";

enum Content {
    Missing,
    /// Its whole lines, and how many octets they are.
    Journal {
        entries: Vec<Entry>,
        octets: u64,
    },
    /// This line is no entry, and others follow it.
    Other {
        line: usize,
    },
}

fn read(path: &Path) -> io::Result<Content> {
    let text = match files::read(path, READ_MAX) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Content::Missing),
        Err(error) => return Err(error),
    };
    let mut entries: Vec<Entry> = Vec::new();
    let mut octets = 0;
    for (number, line) in text.split_inclusive(|octet| *octet == b'\n').enumerate() {
        let entry = line
            .strip_suffix(b"\n")
            .and_then(|line| serde_json::from_slice::<Entry>(line).ok());
        match entry {
            Some(entry) => {
                entries.push(entry);
                octets += line.len() as u64;
            }
            // Only the last line can have been cut short.
            None if octets + line.len() as u64 == text.len() as u64 && (number > 0 || !line.ends_with(b"\n")) => break,
            None => return Ok(Content::Other { line: number + 1 }),
        }
    }
    Ok(Content::Journal { entries, octets })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(seq: u64) -> Entry {
        Entry {
            seq,
            unix_s: 1.75e9,
            time_s: seq as f64,
            ..Entry::new(format!("entry {seq}, \"quoted\"\n\u{e4}").into())
        }
    }

    fn opened(folder: &Path) -> Opened {
        Journal::open(folder).unwrap()
    }

    #[test]
    fn numbers_go_on_behind_a_restart() {
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("state");
        let mut first = opened(&state);
        assert_eq!((first.last, first.entries.len()), (0, 0));
        first.journal.append(&[entry(1), entry(2)]).unwrap();
        first.journal.append(&[entry(3)]).unwrap();
        let second = opened(&state);
        assert_eq!(second.entries, [entry(1), entry(2), entry(3)]);
        assert_eq!((second.last, second.warning), (3, None));
    }

    /// Entries are never changed on the disk: an acknowledge is an entry of its own.
    #[test]
    fn alarms_are_acknowledged_behind_a_restart_too() {
        let folder = tempfile::tempdir().unwrap();
        let how = Acknowledged {
            unix_s: 1.8e9,
            by: "alarm acknowledge".into(),
        };
        let mut alarm = entry(2);
        alarm.alarm = Some(AlarmRecord {
            code: "J-203".into(),
            ..AlarmRecord::default()
        });
        let mut later = entry(4);
        later.acknowledges = Some((vec![1, 2, 77], how.clone()));
        opened(folder.path())
            .journal
            .append(&[entry(1), alarm, entry(3), later])
            .unwrap();
        let entries = opened(folder.path()).entries;
        let found = entries[1].alarm.as_ref().expect("an alarm");
        assert_eq!((found.code.as_str(), &found.acknowledged), ("J-203", &Some(how)));
        // A journal of before there were such fields.
        std::fs::write(
            folder.path().join(NAME),
            "{\"seq\":7,\"unix_s\":1.0,\"time_s\":2.0,\"kind\":\"note\",\"text\":\"x\"}\n",
        )
        .unwrap();
        let before = opened(folder.path());
        assert_eq!((before.last, before.entries[0].code.as_str()), (7, "text"));
    }

    #[test]
    fn a_cut_at_any_octet_loses_the_last_line_at_the_most() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        opened(folder.path()).journal.append(&[entry(1), entry(2)]).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let first = whole.iter().position(|octet| *octet == b'\n').unwrap() + 1;
        for length in 0..=whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let mut again = opened(folder.path());
            let kept = usize::from(length >= first) + usize::from(length == whole.len());
            assert_eq!((again.entries.len(), again.warning), (kept, None), "{length}");
            again.journal.append(&[entry(9)]).unwrap();
            let again = opened(folder.path());
            assert_eq!((again.entries.len(), again.last), (kept + 1, 9), "{length}");
        }
    }

    #[test]
    fn what_is_no_journal_is_kept_aside_and_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        for content in [
            &b"G21\nG0 X1\n"[..],
            b"\n\n",
            b"{\"seq\":1}\n{}\n",
            &[0xFF, b'\n', b'{', b'}', b'\n'],
        ] {
            std::fs::write(&path, content).unwrap();
            let opened = opened(folder.path());
            let warning = opened.warning.expect("a warning");
            assert!(warning.contains("journal.jsonl:1: is no entry"), "{warning}");
            assert_eq!(std::fs::read(folder.path().join(BAD)).unwrap(), content);
            assert_eq!(opened.entries, []);
        }
        // A folder or a device in its place is an error in words, and a link is not followed.
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        assert!(Journal::open(folder.path()).is_err());
        std::fs::remove_dir(&path).unwrap();
        let elsewhere = folder.path().join("elsewhere");
        std::os::unix::fs::symlink(&elsewhere, &path).unwrap();
        assert!(Journal::open(folder.path()).is_err());
        assert!(!elsewhere.exists());
    }

    #[test]
    fn a_long_journal_begins_a_new_file_and_keeps_the_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let mut opened_first = opened(folder.path());
        let many: Vec<Entry> = (1..=60_000).map(entry).collect();
        // As few attempts as a disk that was full for long may need.
        for part in many.chunks(20_000) {
            opened_first.journal.append(part).unwrap();
        }
        let again = opened(folder.path());
        assert_eq!(again.last, 60_000);
        assert!(folder.path().join(BEFORE).exists());
        assert!(again.journal.octets <= FILE_MAX + 200_000);
    }

    /// The disk was full between the two steps.
    #[test]
    fn a_new_file_that_could_not_be_begun_is_begun_later() {
        let folder = tempfile::tempdir().unwrap();
        let mut first = opened(folder.path());
        first.journal.append(&[entry(1)]).unwrap();
        std::fs::rename(folder.path().join(NAME), folder.path().join(BEFORE)).unwrap();
        first.journal.octets = FILE_MAX + 1;
        first.journal.append(&[entry(2)]).unwrap();
        assert_eq!(opened(folder.path()).last, 2);
    }
}
