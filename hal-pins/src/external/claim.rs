//! The process's side of an external component.

use super::exchange::{HEADER_WORDS, at};
use super::{EXTERNAL_PINS_MAX, ExternalPin, Layout, MAGIC, PIN_WORDS, VERSION, described, file_name, index_of};
use crate::file::{directories, is_locked, map, open};
use crate::mapped::Mapped;
use crate::name::check_machine;
use crate::{AnyValue, Attached, HalError, Kind, check_name};
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::{Duration, Instant};

/// How long a claim waits for the control to show values.
const FIRST_LOOK: Duration = Duration::from_secs(2);

/// Why a process writes its outputs no more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Lost {
    /// The control has not heard of it in time: outputs have their safe values. Claim it anew.
    #[error("the heartbeat was late: the control has ended the session; claim the component anew")]
    Ended,
    /// Another process has written over its session. Claim it anew.
    #[error("another process has written over the session; claim the component anew")]
    Overwritten,
    /// The control has ended.
    #[error("the control has ended")]
    Gone,
}

/// The one writer of an external component. Dropping it gives the component up: outputs fall to their safe values.
pub struct Claim {
    machine: String,
    mapped: Mapped,
    file: File,
    layout: Layout,
    pins: Vec<ExternalPin>,
    /// How many of the pins are inputs: they come first.
    inputs: usize,
    /// Values of all pins: as inputs were last seen, as outputs will be written.
    values: Vec<u64>,
    scratch: Vec<u64>,
    session: u64,
    written: u64,
    seen: u64,
    heartbeat: Duration,
}

impl Claim {
    /// Claims a component of the running control of a machine. Outputs begin as they are in the control now.
    ///
    /// # Errors
    /// No such control or component, [`HalError::Claimed`] while another process has it, a damaged file.
    pub fn of(machine: &str, component: &str) -> Result<Claim, HalError> {
        Claim::of_in(&directories(), machine, component)
    }

    /// As [`Claim::of`], looking in these directories.
    ///
    /// # Errors
    /// As [`Claim::of`].
    pub fn of_in(directories: &[PathBuf], machine: &str, component: &str) -> Result<Claim, HalError> {
        check_machine(machine)?;
        check_name(component)?;
        for directory in directories {
            let path = directory.join(file_name(machine, component));
            let file = match open(&path) {
                Ok(file) => file,
                Err(HalError::System { cause, .. }) if cause.kind() == std::io::ErrorKind::NotFound => continue,
                Err(error) => return Err(error),
            };
            let system = |doing| {
                let path = path.clone();
                move |cause| HalError::System { path, doing, cause }
            };
            if is_locked(&file).map_err(system("ask for the lock of"))? {
                return Claim::open(file, &path, machine, component);
            }
        }
        // Says so where there is no such control at all.
        Attached::attach_in(directories, machine)?;
        Err(HalError::NoExternal {
            machine: machine.to_owned(),
            name: component.to_owned(),
        })
    }

    fn open(file: File, path: &Path, machine: &str, component: &str) -> Result<Claim, HalError> {
        let corrupt = |what: String| HalError::Corrupt {
            path: path.to_owned(),
            what,
        };
        let system = |doing, cause| HalError::System {
            path: path.to_owned(),
            doing,
            cause,
        };
        let longest = 8 * Layout::new(EXTERNAL_PINS_MAX, 0)
            .words
            .max(Layout::new(0, EXTERNAL_PINS_MAX).words);
        let len = file.metadata().map_err(|cause| system("look at", cause))?.len();
        let len = usize::try_from(len)
            .ok()
            .filter(|len| (8 * HEADER_WORDS..=longest).contains(len) && len % 8 == 0);
        let Some(len) = len else {
            return Err(corrupt(
                "this is no file of an external component: of another length".into(),
            ));
        };
        let mapped = Mapped::new(map(&file, len).map_err(|cause| system("map", cause))?, &file);
        let (layout, pins, inputs) = read(&mapped).map_err(corrupt)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let pid = mapped.words()[at::HOLDER].load(Relaxed);
                return Err(HalError::Claimed {
                    name: component.to_owned(),
                    pid: u32::try_from(pid).unwrap_or(0),
                });
            }
            Err(TryLockError::Error(cause)) => return Err(system("lock", cause)),
        }
        let words = mapped.words();
        let heartbeat = Duration::from_millis(words[at::HEARTBEAT_MS].load(Relaxed));
        let mut claim = Claim {
            scratch: vec![0; pins.len()],
            values: vec![0; pins.len()],
            session: 0,
            written: words[at::LATEST_OUTPUTS].load(Relaxed),
            seen: 0,
            machine: machine.to_owned(),
            mapped,
            file,
            layout,
            pins,
            inputs,
            heartbeat,
        };
        claim.begin()?;
        Ok(claim)
    }

    /// Begins another session, with outputs as they are in the control now: after [`Lost::Ended`] or [`Lost::Overwritten`].
    ///
    /// # Errors
    /// The control does not show any values, or has ended.
    pub fn begin(&mut self) -> Result<(), HalError> {
        let begun = Instant::now();
        while !self.look() {
            if begun.elapsed() > FIRST_LOOK || !is_locked(&self.file).unwrap_or(false) {
                return Err(HalError::NotRunning {
                    machine: self.machine.clone(),
                    hint: None,
                });
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.values.copy_from_slice(&self.scratch);
        let words = self.mapped.words();
        let ended = words[at::ENDED].load(Acquire);
        let mut session = words[at::CLAIMS].load(Relaxed).wrapping_add(1);
        while session == 0 || session == ended {
            session = session.wrapping_add(1);
        }
        words[at::CLAIMS].store(session, Relaxed);
        words[at::HOLDER].store(u64::from(std::process::id()), Relaxed);
        words[at::SESSION].store(session, Release);
        self.session = session;
        Ok(())
    }

    /// Takes a fresh record of inputs into `scratch`.
    fn look(&mut self) -> bool {
        let taken = self
            .layout
            .inputs
            .take(self.mapped.words(), self.seen, &mut self.scratch);
        if let Some((number, _)) = taken {
            self.seen = number;
        }
        taken.is_some()
    }

    /// Its pins: inputs, then outputs.
    pub fn pins(&self) -> &[ExternalPin] {
        &self.pins
    }

    /// Within what time [`Claim::update`] is to be called again; a third of it is a good period.
    pub fn heartbeat(&self) -> Duration {
        self.heartbeat
    }

    /// The value of a pin: of an input as the last [`Claim::update`] has seen it, of an output as it will be written.
    ///
    /// # Errors
    /// [`HalError::Unknown`]
    pub fn get(&self, pin: &str) -> Result<AnyValue, HalError> {
        let at = index_of(&self.pins, pin)?;
        Ok(AnyValue::from_cell(self.pins[at].value_type(), self.values[at]))
    }

    /// What an output is to be from the next [`Claim::update`] on.
    ///
    /// # Errors
    /// Unknown pins, inputs, other types.
    pub fn set(&mut self, pin: &str, value: impl Into<AnyValue>) -> Result<(), HalError> {
        let (at, value) = (index_of(&self.pins, pin)?, value.into());
        let of = &self.pins[at];
        if of.kind != Kind::Output {
            return Err(HalError::NotSettable {
                name: pin.to_owned(),
                why: "it is an input of this component".into(),
            });
        }
        if of.value_type() != value.kind() {
            return Err(HalError::TypeMismatch {
                name: pin.to_owned(),
                is: of.value_type(),
                expected: value.kind(),
                by: "the new value".into(),
            });
        }
        self.values[at] = value.to_cell();
        Ok(())
    }

    /// Takes inputs, writes all outputs together and renews the heartbeat. Inputs that cannot be had whole stay as they were.
    ///
    /// # Errors
    /// Why this process writes no more; nothing was written then.
    pub fn update(&mut self) -> Result<(), Lost> {
        let is_new = self.look();
        let words = self.mapped.words();
        if self.mapped.is_lost() || !is_new && !is_locked(&self.file).unwrap_or(false) {
            return Err(Lost::Gone);
        }
        if words[at::ENDED].load(Acquire) == self.session {
            return Err(Lost::Ended);
        }
        if words[at::SESSION].load(Relaxed) != self.session {
            return Err(Lost::Overwritten);
        }
        if is_new {
            self.values[..self.inputs].copy_from_slice(&self.scratch[..self.inputs]);
        }
        self.written = self.written.wrapping_add(1).max(1);
        let outputs = self.values[self.inputs..].iter().copied();
        self.layout.outputs.put(words, self.written, self.session, outputs);
        Ok(())
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let session = &self.mapped.words()[at::SESSION];
        if session.load(Relaxed) == self.session {
            session.store(0, Release);
        }
        // Closing alone would not do: a child that another thread is making has the file open as well, until it is its own program.
        let _ = self.file.unlock();
    }
}

/// What a file says of its component; it may be damaged.
fn read(mapped: &Mapped) -> Result<(Layout, Vec<ExternalPin>, usize), String> {
    let words = mapped.words();
    let header = |index: usize| words[index].load(Acquire);
    if header(at::MAGIC) != MAGIC {
        return Err("not an external component of a control that runs".into());
    }
    if header(at::VERSION) != VERSION {
        let version = header(at::VERSION);
        return Err(format!(
            "layout {version} of another version of isocnc; this one knows {VERSION}"
        ));
    }
    let count = |index| usize::try_from(header(index)).unwrap_or(usize::MAX);
    let (pins, inputs) = (count(at::PINS), count(at::INPUTS));
    if pins > EXTERNAL_PINS_MAX || inputs > pins {
        return Err(format!("damaged: {pins} pins, {inputs} of them inputs"));
    }
    let layout = Layout::new(inputs, pins - inputs);
    if mapped.len() != 8 * layout.words {
        let (len, expected) = (mapped.len(), 8 * layout.words);
        return Err(format!("damaged: {len} octets, expected {expected} for {pins} pins"));
    }
    let described = |pin: usize| {
        let first = HEADER_WORDS + pin * PIN_WORDS;
        let words: Vec<u64> = words[first..first + PIN_WORDS]
            .iter()
            .map(|word| word.load(Relaxed))
            .collect();
        let found = described(&words).map_err(|what| format!("damaged: pin {pin} has {what}"))?;
        let kind = if pin < inputs { Kind::Input } else { Kind::Output };
        match found.kind == kind {
            true => Ok(found),
            false => Err(format!("damaged: pin {pin} is {}", found.kind)),
        }
    };
    let pins = (0..pins).map(described).collect::<Result<_, String>>()?;
    Ok((layout, pins, inputs))
}
