//! What can be wrong with pins; every message says what was expected.

use crate::kind::{Kind, Type};
use std::path::PathBuf;

/// A pin, net or file that cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum HalError {
    /// A name that breaks the rules.
    #[error("pin name '{name}': {rule}")]
    Name {
        /// Name that was asked for.
        name: String,
        /// Rule of names that it breaks.
        rule: &'static str,
    },
    /// A machine name that cannot be part of a file name.
    #[error("machine name '{name}': expected 1 to 64 letters, digits, dots, dashes or underscores, no dot first")]
    Machine {
        /// Name that was asked for.
        name: String,
    },
    /// A pin or net of that name is there already.
    #[error("'{name}' exists already, as {kind}: a pin has one writer and a name is used once")]
    Taken {
        /// Name that was asked for.
        name: String,
        /// What has it.
        kind: Kind,
    },
    /// No room for more pins.
    #[error("no room for '{name}': all {capacity} pins and nets are taken")]
    Full {
        /// The pin that did not fit.
        name: String,
        /// Places there are.
        capacity: usize,
    },
    /// A capacity outside the range.
    #[error("capacity {capacity}: expected 1 to {max} pins and nets")]
    Capacity {
        /// What was asked for.
        capacity: usize,
        /// Greatest legal value.
        max: usize,
    },
    /// A name that nothing has.
    #[error("no pin or net '{name}'{}", did_you_mean(.hint))]
    Unknown {
        /// Name that was asked for.
        name: String,
        /// The nearest name.
        hint: Option<String>,
    },
    /// Types that do not fit together.
    #[error("'{name}' is of type {is}, but {expected} is needed{}", needed_by(.by))]
    TypeMismatch {
        /// Name of the pin.
        name: String,
        /// Type that it has.
        is: Type,
        /// The needed type.
        expected: Type,
        /// Who needs it; empty: the caller.
        by: String,
    },
    /// A net whose source writes nothing.
    #[error("net '{net}': source '{name}' is {kind}; the source of a net must be an output")]
    SourceNotOutput {
        /// Name of the net.
        net: String,
        /// Name of the pin.
        name: String,
        /// What it is.
        kind: Kind,
    },
    /// A net that would give a value a second writer.
    #[error("net '{net}': target '{name}' is {kind} and has its own writer; targets must be inputs")]
    TargetNotInput {
        /// Name of the net.
        net: String,
        /// Name of the pin.
        name: String,
        /// What it is.
        kind: Kind,
    },
    /// A pin that is on a net already.
    #[error("net '{net}': '{name}' is on net '{other}' already")]
    Linked {
        /// Name of the net.
        net: String,
        /// Name of the pin.
        name: String,
        /// Net that it is linked to.
        other: String,
    },
    /// A value that is not for the caller to set.
    #[error("'{name}' cannot be set: {why}")]
    NotSettable {
        /// Name of the pin.
        name: String,
        /// Who writes it.
        why: String,
    },
    /// Text that is no value of the type.
    #[error("'{text}' is no {kind}: expected {expected}")]
    Text {
        /// Type that was wanted.
        kind: Type,
        /// Text that was given.
        text: String,
        /// What would be one.
        expected: &'static str,
    },
    /// A control of this name runs already.
    #[error("a control for machine '{machine}' is running (process {pid}); stop it or give the machine another name")]
    Running {
        /// Name of the machine.
        machine: String,
        /// Its process, 0 if it is just starting.
        pid: u32,
    },
    /// Nothing to attach to.
    #[error("no control for machine '{machine}' is running{}", did_you_mean(.hint))]
    NotRunning {
        /// Name of the machine.
        machine: String,
        /// A running machine of a similar name.
        hint: Option<String>,
    },
    /// More channels than a capture has, or none.
    #[error("{count} channels: a capture has 1 to {}", crate::scope::CHANNELS_MAX)]
    Channels {
        /// What was asked for.
        count: usize,
    },
    /// Nobody can have one more.
    #[error(
        "all {} captures of the oscilloscope are in use, by the processes {readers}: end one of them",
        crate::scope::CAPTURES
    )]
    CapturesInUse {
        /// Processes that have them.
        readers: String,
    },
    /// A control that samples nothing.
    #[error(
        "the control has no oscilloscope: it has ended, or had no memory for one when it started, which its log says"
    )]
    NoScope,
    /// The control has no external component of this name.
    #[error(
        "the control of machine '{machine}' has no external component '{name}': [[hal.external]] of its machine file declares them"
    )]
    NoExternal {
        /// Name of the machine.
        machine: String,
        /// Name that was asked for.
        name: String,
    },
    /// Another process writes the outputs of an external component.
    #[error(
        "external component '{name}' is claimed by process {pid}: it has one writer at a time; end that process first"
    )]
    Claimed {
        /// Name of the component.
        name: String,
        /// The process, 0 if it has only just begun.
        pid: u32,
    },
    /// A file of somebody else.
    #[error("{} belongs to user {owner}: run as that user, or as root", .path.display())]
    Foreign {
        /// Path of the file.
        path: PathBuf,
        /// User id of its owner.
        owner: u32,
    },
    /// A folder that others may enter, or that is none.
    #[error("{}: {what}: the files of a control lie in a folder of its user alone", .path.display())]
    Folder {
        /// Path of the folder.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// A file that is not what this version writes.
    #[error("{}: {what}", .path.display())]
    Corrupt {
        /// Path of the file.
        path: PathBuf,
        /// What was found and what was expected.
        what: String,
    },
    /// No directory for the file.
    #[error("neither /run, $XDG_RUNTIME_DIR nor /dev/shm is a tmpfs that can be written: mount one on /dev/shm")]
    NoDirectory,
    /// The system refused.
    #[error("{}: {doing}: {cause}", .path.display())]
    System {
        /// Path of the file.
        path: PathBuf,
        /// What was tried.
        doing: &'static str,
        /// What the system answered.
        cause: std::io::Error,
    },
}

fn did_you_mean(hint: &Option<String>) -> String {
    hint.as_ref()
        .map(|hint| format!("; did you mean '{hint}'?"))
        .unwrap_or_default()
}

fn needed_by(by: &str) -> String {
    if by.is_empty() {
        String::new()
    } else {
        format!(" by {by}")
    }
}

impl HalError {
    /// The pin that is meant, if it is one.
    pub fn pin(&self) -> Option<&str> {
        match self {
            HalError::Name { name, .. }
            | HalError::Taken { name, .. }
            | HalError::Full { name, .. }
            | HalError::Unknown { name, .. }
            | HalError::TypeMismatch { name, .. }
            | HalError::SourceNotOutput { name, .. }
            | HalError::TargetNotInput { name, .. }
            | HalError::Linked { name, .. }
            | HalError::NotSettable { name, .. } => Some(name),
            _ => None,
        }
    }
}
