//! The reader's side: claiming a ring, reading it.

use super::file::path_beside;
use super::layout::{
    CAPTURES, CHANNELS_MAX, FILE_LEN, MAGIC, RECORD_HEAD, RING_WORDS, Segment, VERSION, depth, head, of,
};
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
    request: u64,
    channels: Vec<Channel>,
    read: u64,
    is_served: bool,
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
            let reader = |at| segment.of(at, of::READER).load(Ordering::Relaxed).to_string();
            return Err(HalError::CapturesInUse {
                readers: (0..CAPTURES).map(reader).collect::<Vec<_>>().join(", "),
            });
        };
        let word = |word| segment.of(at, word);
        let last = |of: usize| word(of).load(Ordering::Acquire);
        // Another one than is served, whatever was asked for before.
        let request = match last(of::REQUEST).max(last(of::SERVED)).wrapping_add(1) {
            0 => 1,
            request => request,
        };
        word(of::CHANNELS).store(channels.len() as u64, Ordering::Relaxed);
        word(of::READ).store(0, Ordering::Relaxed);
        word(of::READER).store(u64::from(std::process::id()), Ordering::Relaxed);
        for (number, channel) in channels.iter().enumerate() {
            word(of::CELLS + number).store(channel.cell as u64, Ordering::Relaxed);
        }
        word(of::REQUEST).store(request, Ordering::Release);
        let words = vec![0; RECORD_HEAD + channels.len()];
        Ok(Capture {
            segment,
            file,
            path,
            at,
            request,
            channels,
            read: 0,
            is_served: false,
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
        match self.segment.of(self.at, of::SERVED).load(Ordering::Acquire) == self.request {
            true => self.segment.of(self.at, of::LOST).load(Ordering::Relaxed),
            false => 0,
        }
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
        let served = self.segment.of(self.at, of::SERVED).load(Ordering::Acquire);
        if served != self.request {
            return match self.is_served {
                false => Ok(0),
                true => corrupt(&self.path, "another process has taken this capture away"),
            };
        }
        self.is_served = true;
        if self.segment.of(self.at, of::REFUSED).load(Ordering::Relaxed) != 0 {
            return corrupt(
                &self.path,
                "the control has refused the channels: another process has changed them",
            );
        }
        let written = self.segment.of(self.at, of::WRITTEN).load(Ordering::Acquire);
        let depth = depth(self.channels.len());
        let waiting = written.wrapping_sub(self.read);
        if waiting > depth {
            return corrupt(&self.path, "damaged: more records than its ring holds");
        }
        let count = usize::try_from(waiting).unwrap_or(usize::MAX).min(most);
        let length = self.words.len();
        for _ in 0..count {
            let place = (self.read % depth) as usize * length;
            let record = self.segment.ring(self.at, place, length);
            for (word, from) in self.words.iter_mut().zip(record) {
                *word = from.load(Ordering::Relaxed);
            }
            take(Record {
                cycle: self.words[0],
                time_ns: self.words[1],
                words: &self.words[RECORD_HEAD..],
            });
            self.read = self.read.wrapping_add(1);
        }
        self.segment.of(self.at, of::READ).store(self.read, Ordering::Release);
        match self.segment.is_lost() {
            true => corrupt(&self.path, "was cut short or overwritten by another process"),
            false => Ok(count),
        }
    }
}

impl Drop for Capture {
    fn drop(&mut self) {
        // Not where it is somebody else's meanwhile.
        let _ = self.segment.of(self.at, of::REQUEST).compare_exchange(
            self.request,
            0,
            Ordering::AcqRel,
            Ordering::Relaxed,
        );
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
