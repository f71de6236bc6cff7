//! What a program writes: `(PRINT, ..)`, `(LOG, ..)` and the points of its probing moves.
//!
//! In:  records of the program and contacts of its probe, as it is read.
//! Out: lines on standard error; files in the one folder of the machine file, none longer than a limit.
//!
//! The program is read ahead of the machine, so that a line may be written before the moves in front of it are run, as with
//! LinuxCNC; behind M66, a probing move and M100 to M199, it has waited for them.

use motion::canon::{Axis, LengthUnit, Position, Record};
use std::fs::File;
use std::io::Write;
use std::path::{Component, Path, PathBuf};

/// Octets of a file that a program writes: a loop without end is not to fill the disk.
const FILE_MAX: u64 = 64 << 20;

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

    /// Does what a record asks for. A line without an open log goes nowhere, as with LinuxCNC.
    ///
    /// # Errors
    /// A file that may not or cannot be written, in words.
    pub(super) fn record(&mut self, record: &Record) -> Result<(), String> {
        match record {
            Record::Print(text) => {
                // Nobody need be there to read it.
                let _ = writeln!(std::io::stderr(), "{text}");
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

    fn open(&self, name: &str, open: impl Fn(&Path) -> std::io::Result<File>) -> Result<Written, String> {
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
