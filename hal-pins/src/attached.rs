//! The side of every other process: look at all pins, set inputs that nothing writes.

use crate::file::{self, directories, find_in, open_alive, path_in};
use crate::layout::{Entry, Words, target};
use crate::{AnyValue, HalError, Kind, Type, nearest};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// A pin or net and its value at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct PinInfo {
    /// Name of the pin or net.
    pub name: String,
    /// Output, input or net.
    pub kind: Kind,
    /// Its value, which also tells its type.
    pub value: AnyValue,
    /// The net that a pin is on.
    pub net: Option<String>,
    /// The output that gives a linked input or a net its value.
    pub source: Option<String>,
    /// The pin of which this is another name.
    pub alias_of: Option<String>,
    /// Unit of the value; empty: none is known.
    pub unit: String,
}

impl PinInfo {
    /// Type of its value.
    pub fn value_type(&self) -> Type {
        self.value.kind()
    }

    /// What is known of an entry, for both sides.
    pub(crate) fn of(words: &Words, entries: &[Entry], index: usize) -> PinInfo {
        let entry = &entries[index];
        let pin_index = target(entries, index);
        let pin = &entries[pin_index];
        let name = |index: usize| entries[index].name.clone();
        PinInfo {
            name: entry.name.clone(),
            kind: pin.kind,
            value: words.value(pin_index, pin),
            net: pin.net.map(name),
            source: pin.source.map(name),
            alias_of: entry.alias.map(name),
            unit: if entry.unit.is_empty() { &pin.unit } else { &entry.unit }.clone(),
        }
    }
}

/// The pins of a control in another process.
pub struct Attached {
    words: Words,
    file: File,
    path: PathBuf,
}

impl Attached {
    /// Attaches to the running control of a machine.
    ///
    /// # Errors
    /// [`HalError::NotRunning`], or what is wrong with its file.
    pub fn attach(machine: &str) -> Result<Attached, HalError> {
        Attached::attach_in(&directories(), machine)
    }

    /// As [`Attached::attach`], looking in these directories.
    ///
    /// # Errors
    /// As [`Attached::attach`].
    pub fn attach_in(directories: &[PathBuf], machine: &str) -> Result<Attached, HalError> {
        crate::name::check_machine(machine)?;
        for directory in directories {
            let path = path_in(directory, machine);
            if let Some((file, words)) = open_alive(&path)? {
                return Ok(Attached { words, file, path });
            }
        }
        let running = find_in(directories);
        let hint = nearest(machine, running.iter().map(|found| found.machine.as_str())).map(str::to_owned);
        Err(HalError::NotRunning {
            machine: machine.to_owned(),
            hint,
        })
    }

    /// Whether the control still runs.
    pub fn is_running(&self) -> bool {
        file::is_locked(&self.file).unwrap_or(false)
    }

    /// Process of the control.
    pub fn pid(&self) -> u32 {
        self.words.pid()
    }

    /// The file in shared memory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// All pins and nets with their values, in the order in which they were made.
    ///
    /// # Errors
    /// [`HalError::Corrupt`]
    pub fn list(&self) -> Result<Vec<PinInfo>, HalError> {
        let entries = self.entries()?;
        Ok((0..entries.len())
            .map(|index| PinInfo::of(&self.words, &entries, index))
            .collect())
    }

    /// One pin or net.
    ///
    /// # Errors
    /// [`HalError::Unknown`] with the nearest name, [`HalError::Corrupt`].
    pub fn get(&self, name: &str) -> Result<PinInfo, HalError> {
        let entries = self.entries()?;
        Ok(PinInfo::of(&self.words, &entries, index_of(&entries, name)?))
    }

    /// Sets an input that no net reaches.
    ///
    /// # Errors
    /// Unknown pins, other types, pins that have a writer, [`HalError::Corrupt`].
    pub fn set(&self, name: &str, value: AnyValue) -> Result<(), HalError> {
        let entries = self.entries()?;
        let index = target(&entries, index_of(&entries, name)?);
        let net = entries[index].net.map(|net| entries[net].name.as_str());
        set_cell(&self.words, index, &entries[index], net, value)
    }

    pub(crate) fn entries(&self) -> Result<Vec<Entry>, HalError> {
        let read = || -> Result<Vec<Entry>, String> {
            let count = self.words.count()?;
            (0..count).map(|index| self.words.read(index, count)).collect()
        };
        let entries = match read() {
            _ if self.words.is_lost() => Err("was cut short by another process".into()),
            entries => entries,
        };
        entries.map_err(|what| HalError::Corrupt {
            path: self.path.clone(),
            what,
        })
    }
}

pub(crate) fn index_of(entries: &[Entry], name: &str) -> Result<usize, HalError> {
    entries
        .iter()
        .position(|entry| entry.name == name)
        .ok_or_else(|| HalError::Unknown {
            name: name.to_owned(),
            hint: nearest(name, entries.iter().map(|entry| entry.name.as_str())).map(str::to_owned),
        })
}

/// Sets the own value of an input, for both sides.
pub(crate) fn set_cell(
    words: &Words,
    index: usize,
    entry: &Entry,
    net: Option<&str>,
    value: AnyValue,
) -> Result<(), HalError> {
    let refused = |why: String| {
        Err(HalError::NotSettable {
            name: entry.name.clone(),
            why,
        })
    };
    match (entry.kind, net) {
        (Kind::Output, _) => refused("it is an output, written by the control".into()),
        (Kind::Net, _) => refused("it is a net, written by its source".into()),
        (Kind::Input, Some(net)) => refused(format!("it is on net '{net}'")),
        (Kind::Input, None) if value.kind() != entry.value_type => Err(HalError::TypeMismatch {
            name: entry.name.clone(),
            is: entry.value_type,
            expected: value.kind(),
            by: "the new value".into(),
        }),
        (Kind::Input, None) => {
            words.cell(index).store(value.to_cell(), Ordering::Release);
            Ok(())
        }
    }
}
