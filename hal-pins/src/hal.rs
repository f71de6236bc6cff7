//! The owner's side: claiming pins, connecting them, and the handles that the cycle uses.

use crate::attached::{self, Attached, PinInfo};
use crate::cell;
use crate::file::{OwnFile, PREFIX, own_directories};
use crate::layout::{CAPACITY_MAX, Entry, UNIT_LEN_MAX, Words, target};
use crate::{AnyValue, HalError, Kind, Type, Value, check_name, nearest};
use std::collections::HashMap;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// All pins and nets of one control. Dropping it removes the file; handles stay usable.
pub struct Hal {
    pub(crate) shared: Arc<Shared>,
    /// What the descriptors say, kept here so that nothing is ever believed that another process could have changed.
    entries: Vec<Entry>,
    /// Where each name is among them: with tens of thousands, each would be looked for among all.
    names: HashMap<String, usize>,
    file: OwnFile,
}

/// What handles hold.
pub(crate) struct Shared {
    pub(crate) words: Words,
    /// Per entry: the entry whose cell an input reads. In this process's own memory.
    source: Box<[AtomicU32]>,
}

impl Hal {
    /// Makes the shared memory of a machine with room for `capacity` pins and nets.
    ///
    /// # Errors
    /// [`HalError::Running`] if a control of that name is running, and whatever the system refuses.
    pub fn create(machine: &str, capacity: usize) -> Result<Hal, HalError> {
        Hal::create_in(&own_directories()?, machine, capacity)
    }

    /// As [`Hal::create`], in the first of these directories that takes the file.
    ///
    /// # Errors
    /// As [`Hal::create`].
    pub fn create_in(directories: &[PathBuf], machine: &str, capacity: usize) -> Result<Hal, HalError> {
        if !(1..=CAPACITY_MAX).contains(&capacity) {
            return Err(HalError::Capacity {
                capacity,
                max: CAPACITY_MAX,
            });
        }
        let (file, words) = OwnFile::create(directories, machine, capacity)?;
        let source = (0..capacity as u32).map(AtomicU32::new).collect();
        Ok(Hal {
            shared: Arc::new(Shared { words, source }),
            entries: Vec::new(),
            names: HashMap::new(),
            file,
        })
    }

    /// Attaches to a running control; see [`Attached::attach`].
    ///
    /// # Errors
    /// [`HalError::NotRunning`], or what is wrong with its file.
    pub fn attach(machine: &str) -> Result<Attached, HalError> {
        Attached::attach(machine)
    }

    /// The file in shared memory.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Name of the machine.
    pub fn machine(&self) -> &str {
        let name = self.path().file_name().and_then(|name| name.to_str());
        name.and_then(|name| name.strip_prefix(PREFIX)).unwrap_or_default()
    }

    /// Claims a pin to write. Its value is 0 or false until it is set.
    ///
    /// # Errors
    /// A name that breaks the rules, is taken, or for which there is no room.
    pub fn output<T: Value>(&mut self, name: &str) -> Result<Output<T>, HalError> {
        let index = self.add(name, Kind::Output, T::TYPE, None)?;
        Ok(Output {
            shared: self.shared.clone(),
            index,
            value: PhantomData,
        })
    }

    /// Claims a pin to read. Until a net reaches it, it has a value of its own, first `default`.
    ///
    /// # Errors
    /// As [`Hal::output`].
    pub fn input<T: Value>(&mut self, name: &str, default: T) -> Result<Input<T>, HalError> {
        let index = self.add(name, Kind::Input, T::TYPE, None)?;
        self.shared
            .words
            .cell(index)
            .store(default.to_cell(), Ordering::Release);
        Ok(Input {
            shared: self.shared.clone(),
            index,
            value: PhantomData,
        })
    }

    /// Gives a pin one more name, which stands for it everywhere.
    ///
    /// # Errors
    /// No such pin; as [`Hal::output`].
    pub fn alias(&mut self, name: &str, pin: &str) -> Result<(), HalError> {
        let of = self.index(pin)?;
        let Entry { kind, value_type, .. } = self.entries[of];
        self.add(name, kind, value_type, Some(of))?;
        Ok(())
    }

    /// Says in which unit the value of a pin is; shown beside it. Longer ones than [`UNIT_LEN_MAX`] octets are cut.
    ///
    /// # Errors
    /// No such pin.
    pub fn set_unit(&mut self, pin: &str, unit: &str) -> Result<(), HalError> {
        let index = self.index(pin)?;
        let fits = |at: &usize| unit.is_char_boundary(*at);
        let length = (0..=unit.len().min(UNIT_LEN_MAX)).rev().find(fits).unwrap_or(0);
        self.entries[index].unit = unit[..length].to_owned();
        self.shared.words.write(index, &self.entries[index]);
        Ok(())
    }

    /// The memory behind all of it.
    pub fn memory(&self) -> Memory {
        Memory {
            shared: self.shared.clone(),
        }
    }

    /// All pins and nets that there are, for looking at their values from other threads.
    pub fn view(&self) -> View {
        View {
            shared: self.shared.clone(),
            entries: self.entries.clone(),
        }
    }

    /// One more reader of any pin or net.
    ///
    /// # Errors
    /// Unknown names and other types.
    pub fn reader<T: Value>(&self, name: &str) -> Result<Input<T>, HalError> {
        let index = self.index(name)?;
        self.check_type(index, T::TYPE, "")?;
        Ok(Input {
            shared: self.shared.clone(),
            index,
            value: PhantomData,
        })
    }

    /// Connects an output with inputs under the name of a net. Nothing is changed if anything is wrong.
    ///
    /// # Errors
    /// Unknown pins (with the nearest name), other types, a source that is no output, a target that is no input,
    /// a pin that is on another net, a name that is taken.
    pub fn link<S: AsRef<str>>(&mut self, net: &str, source: &str, targets: &[S]) -> Result<(), HalError> {
        let source = self.index(source)?;
        let from = &self.entries[source];
        if from.kind != Kind::Output {
            return Err(HalError::SourceNotOutput {
                net: net.to_owned(),
                name: from.name.clone(),
                kind: from.kind,
            });
        }
        self.check_unlinked(net, source)?;
        let mut readers: Vec<usize> = Vec::with_capacity(targets.len());
        for target in targets {
            let target = self.free_reader(net, target.as_ref())?;
            self.check_type(target, from.value_type, &format!("net '{net}' from '{}'", from.name))?;
            if readers.contains(&target) {
                return Err(HalError::Linked {
                    net: net.to_owned(),
                    name: self.entries[target].name.clone(),
                    other: net.to_owned(),
                });
            }
            readers.push(target);
        }
        let index = self.add(net, Kind::Net, self.entries[source].value_type, None)?;
        self.connect(index, None, Some(source));
        self.connect(source, Some(index), None);
        for target in readers {
            self.connect(target, Some(index), Some(source));
        }
        Ok(())
    }

    /// Whether a pin could be read by a net of this name.
    ///
    /// # Errors
    /// As those of targets in [`Hal::link`], but for their types.
    pub fn check_reader(&self, net: &str, target: &str) -> Result<(), HalError> {
        self.free_reader(net, target).map(drop)
    }

    fn free_reader(&self, net: &str, target: &str) -> Result<usize, HalError> {
        let target = self.index(target)?;
        let to = &self.entries[target];
        if to.kind != Kind::Input {
            return Err(HalError::TargetNotInput {
                net: net.to_owned(),
                name: to.name.clone(),
                kind: to.kind,
            });
        }
        self.check_unlinked(net, target)?;
        Ok(target)
    }

    /// Sets an input that no net reaches.
    ///
    /// # Errors
    /// Unknown pins, other types, pins that have a writer.
    pub fn set<T: Value + Into<AnyValue>>(&self, name: &str, value: T) -> Result<(), HalError> {
        let index = self.index(name)?;
        let net = self.entries[index].net.map(|net| self.entries[net].name.as_str());
        attached::set_cell(&self.shared.words, index, &self.entries[index], net, value.into())
    }

    /// All pins and nets with their values, in the order in which they were made.
    pub fn list(&self) -> Vec<PinInfo> {
        let of = |index| PinInfo::of(&self.shared.words, &self.entries, index);
        (0..self.entries.len()).map(of).collect()
    }

    fn add(&mut self, name: &str, kind: Kind, value_type: Type, alias: Option<usize>) -> Result<usize, HalError> {
        check_name(name)?;
        if let Some(other) = self.names.get(name) {
            return Err(HalError::Taken {
                name: name.to_owned(),
                kind: self.entries[*other].kind,
            });
        }
        let index = self.entries.len();
        if index == self.shared.words.capacity() {
            return Err(HalError::Full {
                name: name.to_owned(),
                capacity: index,
            });
        }
        let entry = Entry {
            name: name.to_owned(),
            kind,
            value_type,
            net: None,
            source: None,
            alias,
            unit: String::new(),
        };
        self.shared.words.write(index, &entry);
        self.entries.push(entry);
        self.names.insert(name.to_owned(), index);
        self.shared.words.publish(self.entries.len());
        Ok(index)
    }

    fn connect(&mut self, index: usize, net: Option<usize>, source: Option<usize>) {
        let entry = &mut self.entries[index];
        (entry.net, entry.source) = (net, source);
        self.shared.words.write_links(index, entry);
        // An index is below the capacity, which fits.
        self.shared.source[index].store(source.unwrap_or(index) as u32, Ordering::Release);
    }

    fn index(&self, name: &str) -> Result<usize, HalError> {
        self.names
            .get(name)
            .map(|index| target(&self.entries, *index))
            .ok_or_else(|| HalError::Unknown {
                name: name.to_owned(),
                hint: nearest(name, self.entries.iter().map(|entry| entry.name.as_str())).map(str::to_owned),
            })
    }

    fn check_type(&self, index: usize, expected: Type, by: &str) -> Result<(), HalError> {
        let Entry {
            name, value_type: is, ..
        } = &self.entries[index];
        if *is == expected {
            return Ok(());
        }
        Err(HalError::TypeMismatch {
            name: name.clone(),
            is: *is,
            expected,
            by: by.to_owned(),
        })
    }

    fn check_unlinked(&self, net: &str, index: usize) -> Result<(), HalError> {
        let entry = &self.entries[index];
        match entry.net {
            None => Ok(()),
            Some(other) => Err(HalError::Linked {
                net: net.to_owned(),
                name: entry.name.clone(),
                other: self.entries[other].name.clone(),
            }),
        }
    }
}

/// The memory behind pins.
pub struct Memory {
    shared: Arc<Shared>,
}

impl Memory {
    /// RT: whether somebody has cut the file short: pins that were lost read as zeros until they are written again.
    pub fn is_lost(&self) -> bool {
        self.shared.words.is_lost()
    }
}

/// Pins and nets by name, to be looked at.
pub struct View {
    shared: Arc<Shared>,
    entries: Vec<Entry>,
}

impl View {
    /// The value of a pin or net now; of an input that of the net it is on. `None`: there is none of that name.
    pub fn value(&self, name: &str) -> Option<AnyValue> {
        let index = self.entries.iter().position(|entry| entry.name == name)?;
        let index = target(&self.entries, index);
        let source = self.shared.source[index].load(Ordering::Acquire) as usize;
        let entry = self.entries.get(source)?;
        Some(self.shared.words.value(source, entry))
    }
}

/// The one writer of a pin.
pub struct Output<T> {
    shared: Arc<Shared>,
    index: usize,
    value: PhantomData<fn(T)>,
}

impl<T: Value> Output<T> {
    /// RT: shows a value to all readers; they also see everything written before it.
    #[inline]
    pub fn set(&mut self, value: T) {
        cell::set(self.shared.words.cell(self.index), value.to_cell());
    }

    /// RT: the value now.
    #[inline]
    pub fn get(&self) -> T {
        T::from_cell(cell::get(self.shared.words.cell(self.index)))
    }
}

/// A reader of a pin or net.
pub struct Input<T> {
    shared: Arc<Shared>,
    index: usize,
    value: PhantomData<fn() -> T>,
}

impl<T: Value> Input<T> {
    /// RT: the value of the net it is on, or its own.
    #[inline]
    pub fn get(&self) -> T {
        let source = self.shared.source[self.index].load(Ordering::Acquire);
        T::from_cell(cell::get(self.shared.words.cell(source as usize)))
    }

    /// RT: whether a net reaches it.
    #[inline]
    pub fn is_on_net(&self) -> bool {
        self.shared.source[self.index].load(Ordering::Acquire) as usize != self.index
    }
}

impl<T: Value> Input<T> {
    /// RT: puts another value in place of one that cannot be used, so that nobody takes it for the one in force. An input on a net shows
    /// what the net has; a value that has come meanwhile stays.
    #[inline]
    pub fn correct(&self, wrong: T, right: T) {
        let source = self.shared.source[self.index].load(Ordering::Acquire);
        if source as usize == self.index {
            let cell = self.shared.words.cell(self.index);
            let _ = cell.compare_exchange(wrong.to_cell(), right.to_cell(), Ordering::AcqRel, Ordering::Relaxed);
        }
    }
}

impl<T> Clone for Input<T> {
    fn clone(&self) -> Self {
        Input {
            shared: self.shared.clone(),
            index: self.index,
            value: PhantomData,
        }
    }
}
