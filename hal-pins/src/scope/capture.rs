//! The reader's side: claiming a ring, reading it.

use super::file::path_beside;
use super::layout::{CAPTURES, FILE_LEN, MAGIC, RING_WORDS, Segment, VERSION, head};
use super::ring::{CHANNELS_MAX, RECORD_HEAD, Reader, of};
use crate::file::{is_octet_locked, lock_octet, open};
use crate::layout::target;
use crate::{AnyValue, Attached, HalError, Type};
use memmap2::MmapOptions;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// A pin or net that is captured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Its name, as it was asked for.
    pub name: String,
    /// Type of its values.
    pub value_type: Type,
    /// Their unit; empty: none is known.
    pub unit: String,
    cell: usize,
}

impl Channel {
    /// The value that a word of a record stands for.
    pub fn value(&self, word: u64) -> AnyValue {
        AnyValue::from_cell(self.value_type, word)
    }
}

/// The values of one cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record<'a> {
    /// Cycles of the control before it; a number that is left out was lost.
    pub cycle: u64,
    /// Date of the cycle, ns on the clock of the cycle.
    pub time_ns: u64,
    /// A word for each channel; [`Channel::value`] says what it means.
    pub words: &'a [u64],
}

/// Reads pins of a control cycle by cycle. Dropping it gives the ring back.
pub struct Capture {
    segment: Segment,
    file: File,
    path: PathBuf,
    at: usize,
    reader: Reader,
    channels: Vec<Channel>,
    /// The record that is being read.
    words: Vec<u64>,
}

impl Capture {
    /// Asks for pins and nets, up to [`CHANNELS_MAX`]; records begin with the next cycle.
    ///
    /// # Errors
    /// Unknown names with the nearest one, too many, all [`CAPTURES`] in use, a control without an oscilloscope, a damaged file.
    pub fn begin<S: AsRef<str>>(pins: &Attached, names: &[S]) -> Result<Capture, HalError> {
        if !(1..=CHANNELS_MAX).contains(&names.len()) {
            return Err(HalError::Channels { count: names.len() });
        }
        let entries = pins.entries()?;
        let channel = |name: &S| {
            let index = crate::attached::index_of(&entries, name.as_ref())?;
            let at = target(&entries, index);
            let pin = &entries[at];
            Ok(Channel {
                name: name.as_ref().to_owned(),
                value_type: pin.value_type,
                unit: pin.unit.clone(),
                cell: pin.source.unwrap_or(at),
            })
        };
        let channels = names.iter().map(channel).collect::<Result<Vec<_>, HalError>>()?;
        let path = path_beside(pins.path()).ok_or(HalError::NoScope)?;
        let (file, segment) = attach(&path)?;
        let claimed = (0..CAPTURES).find(|at| lock_octet(&file, 1 + *at as i64).is_ok());
        let Some(at) = claimed else {
            let reader = |at| segment.capture(at)[of::READER].load(Ordering::Relaxed).to_string();
            return Err(HalError::CapturesInUse {
                readers: (0..CAPTURES).map(reader).collect::<Vec<_>>().join(", "),
            });
        };
        let cells = channels.iter().map(|channel| channel.cell);
        let reader = Reader::ask(segment.capture(at), cells, std::process::id());
        let words = vec![0; RECORD_HEAD + channels.len()];
        Ok(Capture {
            segment,
            file,
            path,
            at,
            reader,
            channels,
            words,
        })
    }

    /// What is captured, in the order in which it was asked for.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Time of a cycle, ns; at least 1.
    pub fn period_ns(&self) -> u64 {
        self.segment.head(head::PERIOD_NS).load(Ordering::Relaxed).max(1)
    }

    /// Whether the control still runs.
    pub fn is_running(&self) -> bool {
        is_octet_locked(&self.file, 0).unwrap_or(false)
    }

    /// Records that found the ring full, since the beginning.
    pub fn lost(&self) -> u64 {
        self.reader.lost(self.segment.capture(self.at))
    }

    /// Hands out what has come since the last call, at most `most` records; gives their number. Never waits.
    ///
    /// # Errors
    /// [`HalError::Corrupt`]: the file was cut short, or another process writes where it may not.
    pub fn read(&mut self, most: usize, mut take: impl FnMut(Record<'_>)) -> Result<usize, HalError> {
        let corrupt = |path: &Path, what: &str| {
            Err(HalError::Corrupt {
                path: path.to_owned(),
                what: what.to_owned(),
            })
        };
        if self.segment.is_lost() {
            return corrupt(&self.path, "was cut short or overwritten by another process");
        }
        let (capture, ring) = (self.segment.capture(self.at), self.segment.ring(self.at));
        let taken = self.reader.take(capture, ring, most, &mut self.words, |record| {
            take(Record {
                cycle: record[0],
                time_ns: record[1],
                words: &record[RECORD_HEAD..],
            });
        });
        let count = match taken {
            Ok(count) => count,
            Err(what) => return corrupt(&self.path, what),
        };
        match self.segment.is_lost() {
            true => corrupt(&self.path, "was cut short or overwritten by another process"),
            false => Ok(count),
        }
    }
}

impl Drop for Capture {
    fn drop(&mut self) {
        self.reader.give_back(self.segment.capture(self.at));
    }
}

/// Opens the oscilloscope of a running control.
fn attach(path: &Path) -> Result<(File, Segment), HalError> {
    let system = |doing| {
        move |cause| HalError::System {
            path: path.to_owned(),
            doing,
            cause,
        }
    };
    let file = match open(path) {
        Ok(file) => file,
        Err(HalError::System { cause, .. }) if cause.kind() == std::io::ErrorKind::NotFound => {
            return Err(HalError::NoScope);
        }
        Err(error) => return Err(error),
    };
    if !is_octet_locked(&file, 0).map_err(system("ask for the lock of"))? {
        return Err(HalError::NoScope);
    }
    let segment = map(&file).map_err(system("map"))?.map_err(|what| HalError::Corrupt {
        path: path.to_owned(),
        what,
    })?;
    Ok((file, segment))
}

fn map(file: &File) -> std::io::Result<Result<Segment, String>> {
    let len = file.metadata()?.len();
    if len != FILE_LEN as u64 {
        return Ok(Err(format!("{len} octets, expected {FILE_LEN} of an oscilloscope")));
    }
    let map = MmapOptions::new().len(FILE_LEN).map_raw(file)?;
    let segment = Segment::unchecked(map, file);
    let word = |index| segment.head(index).load(Ordering::Acquire);
    let header = [head::MAGIC, head::VERSION, head::CAPTURES, head::RING_WORDS].map(word);
    Ok(check_header(header).map(|()| segment))
}

/// The first four words.
fn check_header([magic, version, captures, ring_words]: [u64; 4]) -> Result<(), String> {
    if magic != MAGIC {
        return Err(format!(
            "not the oscilloscope of a control: begins with {magic:#018x}, not {MAGIC:#018x}"
        ));
    }
    if version != VERSION {
        return Err(format!(
            "layout {version} of another version of isocnc; this one knows {VERSION}"
        ));
    }
    if (captures, ring_words) != (CAPTURES as u64, RING_WORDS as u64) {
        return Err(format!(
            "damaged: {captures} captures of {ring_words} words, expected {CAPTURES} of {RING_WORDS}"
        ));
    }
    Ok(())
}

/// Whether a file would be read as the oscilloscope of a control, for tests of damaged ones.
///
/// # Errors
/// What is wrong with it.
pub fn check(file: &File) -> Result<(), String> {
    map(file).map_err(|cause| cause.to_string())?.map(drop)
}
