//! What stands in the way of real time on this PC, line by line, and what to do about each.
//!
//! In:  /proc, /sys and files of the boot loader below a root folder ([`Pc`]), and what can only be told by trying it
//!      ([`Tries`]): SCHED_FIFO, locked memory, a raw socket, the network interface, two measurements.
//! Out: a [`Finding`] for each entry of [`LINES`], in that order: found, wanted, how much it matters, how to change it.
//!
//! Nothing is changed on the PC. Not RT. A new line is one entry of [`LINES`], its function, and its cases in the tests,
//! which refuse a line without a good and a bad case.

mod background;
mod checks;
mod core;
pub mod cpus;
mod ethtool;
mod experiments;
mod fixes;
pub mod isolcpus;
mod kernel;
mod measure;
mod memory;
mod nic;
mod pc;
mod power;
mod report;
mod rights;
mod this_pc;

#[cfg(test)]
mod tests;

pub use checks::LINES;
pub use cpus::Cpus;
pub use experiments::{Coalescing, Latency, NoAnswer, Offload, TimeStamps, Tries};
pub use nic::is_interface_name;
pub use pc::{Pc, Target, Unread};
pub use report::Report;
pub use this_pc::ThisPc;

/// How much a line matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Without it the control refuses to run or warns loudly.
    Must,
    /// Without it lateness has no useful bound, or a worse one.
    Should,
    /// Good to know; may help a little.
    Info,
}

impl Level {
    /// All, the one that matters most first.
    pub const ALL: [Level; 3] = [Level::Must, Level::Should, Level::Info];

    /// As it is printed.
    pub const fn name(self) -> &'static str {
        match self {
            Level::Must => "must",
            Level::Should => "should",
            Level::Info => "info",
        }
    }
}

/// What a look has told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// As it is wanted.
    Ok,
    /// Not as it is wanted.
    Missing,
    /// It cannot be told; what was found is the reason.
    Unknown,
}

impl State {
    /// As it is printed in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            State::Ok => "ok",
            State::Missing => "missing",
            State::Unknown => "unknown",
        }
    }
}

/// What lines stand together under.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    Kernel,
    /// Virtual machine and clock.
    Machine,
    /// The core of the real-time threads.
    Core,
    /// Clock frequency and idle states.
    Power,
    /// What the process may do.
    Rights,
    Memory,
    /// The interface of the field bus.
    Network,
    /// Work that the kernel does by itself.
    Background,
    /// What all of it comes to.
    Measured,
}

impl Group {
    /// As it is printed.
    pub const fn name(self) -> &'static str {
        match self {
            Group::Kernel => "kernel",
            Group::Machine => "machine and clock",
            Group::Core => "core of the real-time threads",
            Group::Power => "frequency and idle states",
            Group::Rights => "scheduler and rights",
            Group::Memory => "memory",
            Group::Network => "network interface of the field bus",
            Group::Background => "background work of the kernel",
            Group::Measured => "measured",
        }
    }
}

/// One line: what is wanted, and the function that looks.
#[derive(Debug)]
pub struct Line {
    /// Short name; stands once.
    pub name: &'static str,
    /// What it stands under.
    pub group: Group,
    /// How much it matters.
    pub level: Level,
    /// What is wanted.
    pub wanted: &'static str,
    /// Looks; `None` where there is nothing to look at (no interface was named).
    look: fn(&Pc<'_>) -> Option<Look>,
}

/// What one look has told.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    state: State,
    found: String,
    fix: Option<String>,
    latency: Option<Latency>,
}

impl Look {
    fn ok(found: impl Into<String>) -> Look {
        Look {
            state: State::Ok,
            found: found.into(),
            fix: None,
            latency: None,
        }
    }

    fn missing(found: impl Into<String>, fix: impl Into<String>) -> Look {
        Look {
            state: State::Missing,
            found: found.into(),
            fix: Some(fix.into()),
            latency: None,
        }
    }

    fn unknown(reason: impl Into<String>) -> Look {
        Look {
            state: State::Unknown,
            found: reason.into(),
            fix: None,
            latency: None,
        }
    }

    /// A file is not there: good, where the kernel has not been built with what it switches. Otherwise nothing is told.
    fn unread(pc: &Pc<'_>, why: &Unread) -> Look {
        match why {
            Unread::Absent(path) if pc.has_folder_of(path) => Look::ok("not in this kernel"),
            Unread::Absent(_) | Unread::Refused(_) => Look::unknown(why.to_string()),
        }
    }

    /// How it could be told.
    fn with_fix(self, fix: impl Into<String>) -> Look {
        Look {
            fix: Some(fix.into()),
            ..self
        }
    }

    /// [`Look::ok`] or [`Look::missing`].
    fn judge(good: bool, found: impl Into<String>, fix: impl Into<String>) -> Look {
        if good {
            Look::ok(found)
        } else {
            Look::missing(found, fix)
        }
    }
}

/// One line and what it has told.
#[derive(Clone, Debug)]
pub struct Finding {
    pub line: &'static Line,
    /// What it has told.
    pub state: State,
    /// The value found; the reason where it cannot be told.
    pub found: String,
    /// How to change it, or how to tell: a command to paste where there is one.
    pub fix: Option<String>,
    /// The figures of a measurement.
    pub latency: Option<Latency>,
}

/// Looks at everything, in the order of [`LINES`].
pub fn examine(pc: &Pc<'_>) -> Vec<Finding> {
    let finding = |line: &'static Line| {
        let look = (line.look)(pc)?;
        Some(Finding {
            line,
            state: look.state,
            found: look.found,
            fix: look.fix,
            latency: look.latency,
        })
    };
    LINES.iter().filter_map(finding).collect()
}
