//! What a program writes: `(PRINT, ..)`, `(LOG, ..)` and the points of its probing moves.
//!
//! In:  records of the program and contacts of its probe, as it is read; how many of its messages the machine has come to.
//! Out: lines on standard error; files in the one folder of the machine file, none longer than a limit.
//!
//! The program is read ahead of the machine. What it prints and logs is numbered with its messages and kept until the machine has run
//! the moves in front of it (LinuxCNC writes it as it is read); points of probing moves come as these end.

use host::terminal::takes_more;
use motion::canon::{Axis, LengthUnit, Position, Record, Source};
use std::fs::File;
use std::io::Write;
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, mpsc};

/// Octets of a file that a program writes: a loop without end is not to fill the disk.
const FILE_MAX: u64 = 64 << 20;

/// Something to be written, and where it stands.
pub(super) struct Saying {
    /// How many messages and records of the program are before it.
    number: u32,
    pub(super) source: Source,
    record: Record,
}

/// What is to be written once the machine has come to it.
pub(super) struct Sayings {
    coming: mpsc::Receiver<Saying>,
    next: Option<Saying>,
    /// Messages that the machine has come to.
    reached: Arc<AtomicU32>,
    records: Records,
}

/// Where what is to be written comes from.
pub(super) struct SayingsTo {
    to: mpsc::Sender<Saying>,
    /// Messages and records so far.
    count: u32,
}

impl SayingsTo {
    /// A message, which others tell.
    pub(super) fn pass(&mut self) {
        self.count += 1;
    }

    /// A record that is to wait.
    pub(super) fn put(&mut self, record: &Record, source: Source) {
        let number = self.count;
        self.count += 1;
        let record = record.clone();
        // Nobody may want it any more.
        let _ = self.to.send(Saying { number, source, record });
    }
}

impl Sayings {
    /// For a program whose interpolation counts its messages there.
    pub(super) fn new(folder: Option<PathBuf>, reached: Arc<AtomicU32>) -> (SayingsTo, Sayings) {
        let (to, coming) = mpsc::channel();
        let sayings = Sayings {
            coming,
            next: None,
            reached,
            records: Records::new(folder),
        };
        (SayingsTo { to, count: 0 }, sayings)
    }

    /// Writes what the machine has come to.
    ///
    /// # Errors
    /// A file that cannot be written, in words, and where it was to be.
    pub(super) fn write(&mut self) -> Result<(), (Source, String)> {
        let reached = self.reached.load(Ordering::Acquire);
        loop {
            if self.next.is_none() {
                self.next = self.coming.try_recv().ok();
            }
            let Some(saying) = self.next.take_if(|saying| saying.number < reached) else {
                return Ok(());
            };
            (self.records.record(&saying.record)).map_err(|what| (saying.source, what))?;
        }
    }
}

/// Files under way.
#[derive(Debug)]
pub(super) struct Records {
    /// `None`: the machine file names no folder.
    folder: Option<PathBuf>,
    unit: LengthUnit,
    log: Option<Written>,
    points: Option<Written>,
}

/// A file and what it has got.
#[derive(Debug)]
struct Written {
    name: String,
    file: File,
    octets: u64,
}

impl Records {
    pub(super) fn new(folder: Option<PathBuf>) -> Records {
        Records {
            folder,
            unit: LengthUnit::Millimetre,
            log: None,
            points: None,
        }
    }

    /// Whether a record could be done, as far as the program says: it may be long before it is.
    ///
    /// # Errors
    /// A file that may not be written, in words.
    pub(super) fn check(&self, record: &Record) -> Result<(), String> {
        match record {
            Record::OpenLog(name) | Record::AppendLog(name) | Record::OpenProbeLog(name) => self.path(name).map(drop),
            Record::Print(_) | Record::Log(_) | Record::CloseLog | Record::CloseProbeLog => Ok(()),
        }
    }

    /// Does what a record asks for. A line without an open log goes nowhere, as with LinuxCNC.
    ///
    /// # Errors
    /// A file that may not or cannot be written, in words.
    pub(super) fn record(&mut self, record: &Record) -> Result<(), String> {
        match record {
            Record::Print(text) => {
                // Nobody need be there to read it, and a terminal that is stopped does not stop the machine.
                if takes_more(std::io::stderr()) {
                    let _ = writeln!(files::printed::stderr(), "{text}");
                }
            }
            Record::OpenLog(name) => self.log = Some(self.open(name, files::create)?),
            Record::AppendLog(name) => self.log = Some(self.open(name, files::append)?),
            Record::Log(text) => {
                if let Some(log) = &mut self.log {
                    log.line(text)?;
                }
            }
            Record::CloseLog => self.log = None,
            Record::OpenProbeLog(name) => self.points = Some(self.open(name, files::create)?),
            Record::CloseProbeLog => self.points = None,
        }
        Ok(())
    }

    /// Unit of the points from here on: that of the program.
    pub(super) fn use_unit(&mut self, unit: LengthUnit) {
        self.unit = unit;
    }

    /// A probing move has touched something there, work coordinates.
    ///
    /// # Errors
    /// A file that cannot be written, in words.
    pub(super) fn touched(&mut self, at: &Position) -> Result<(), String> {
        let Some(points) = &mut self.points else { return Ok(()) };
        let coordinates = Axis::ALL.map(|axis| {
            let unit = if axis.is_rotary() { 1.0 } else { self.unit.mm() };
            format!("{:.6}", at[axis] / unit)
        });
        points.line(&coordinates.join(" "))
    }

    /// Where a file of a program lies.
    fn path(&self, name: &str) -> Result<PathBuf, String> {
        let folder = self.folder.as_ref().ok_or_else(|| {
            "this machine keeps no files of programs: expected program.log_directory in its machine file".to_owned()
        })?;
        let stays_inside = Path::new(name)
            .components()
            .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        if name.trim().is_empty() || !stays_inside {
            return Err(format!(
                "\"{name}\" leads out of {}: expected the name of a file in it",
                folder.display()
            ));
        }
        let path = folder.join(name);
        let is_inside = path
            .parent()
            .and_then(|parent| parent.canonicalize().ok())
            .zip(folder.canonicalize().ok())
            .is_some_and(|(parent, folder)| parent.starts_with(folder));
        if !is_inside {
            return Err(format!("{} is not in {}", path.display(), folder.display()));
        }
        Ok(path)
    }

    fn open(&self, name: &str, open: impl Fn(&Path) -> std::io::Result<File>) -> Result<Written, String> {
        let path = self.path(name)?;
        let failed = |error: std::io::Error| format!("{}: {error}", path.display());
        let file = open(&path).map_err(failed)?;
        let octets = file.metadata().map_err(failed)?.len();
        Ok(Written {
            name: name.to_owned(),
            file,
            octets,
        })
    }
}

impl Written {
    fn line(&mut self, text: &str) -> Result<(), String> {
        self.octets += text.len() as u64 + 1;
        if self.octets > FILE_MAX {
            return Err(format!("{} is longer than {} MiB", self.name, FILE_MAX >> 20));
        }
        writeln!(self.file, "{text}").map_err(|error| format!("{}: {error}", self.name))
    }
}
