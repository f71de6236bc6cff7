//! Keeps RETAIN variables of programs in Structured Text, in a thread of its own, because a disk takes its time.
//!
//! In:  values behind scans. Out: a file for each program in the state folder, where something has changed, once a second at the
//! most. What cannot be written is tried again, and told once.

use crate::console::Operator;
use host::capabilities;
use host::capabilities::Work;
use machine::retain_file::{self, Kept, Retained};
use machine::safe_file::{Disk, Files};
use rt::logic::{Desk, Ports};
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Acquire};
use std::time::Duration;

/// Between two looks.
const LOOK: Duration = Duration::from_millis(100);
/// Looks from one writing to the next.
const LOOKS: u32 = 10;

/// Gives programs what the last session has left; what cannot be taken is told.
pub(super) fn recall(folder: &Path, machine: &str, ports: &mut Ports, operator: &mut Operator) {
    let desk = ports.desk();
    for (number, name) in desk.names().into_iter().enumerate() {
        match retain_file::open(folder, machine, name) {
            Err(why) => operator.add_warning(why),
            Ok(Kept { variables, .. }) if variables.is_empty() => {}
            Ok(Kept { time_ns, variables, .. }) => {
                for why in ports.recall(number, time_ns, &variables) {
                    operator.add_warning(format!("{}: {why}", desk.file(number)));
                }
            }
        }
    }
}

/// What is on the disk.
pub(super) struct Keeper {
    machine: String,
    /// Of each program.
    written: Vec<Vec<Retained>>,
    /// The last attempt failed.
    fails: bool,
}

impl Keeper {
    pub(super) fn new(machine: &str, desk: &Desk) -> Keeper {
        Keeper {
            machine: machine.to_owned(),
            written: desk.names().iter().map(|_| Vec::new()).collect(),
            fails: false,
        }
    }

    /// Writes what has changed.
    pub(super) fn keep(&mut self, disk: &mut impl Files, folder: &Path, desk: &Desk) -> io::Result<()> {
        let mut failed = Ok(());
        for (number, (name, written)) in desk.names().into_iter().zip(&mut self.written).enumerate() {
            let Some((time_ns, variables)) = desk.retained(number) else {
                continue;
            };
            if variables == *written {
                continue;
            }
            let kept = Kept {
                machine: self.machine.clone(),
                time_ns,
                variables,
            };
            match retain_file::save(disk, folder, name, &kept) {
                Ok(()) => *written = kept.variables,
                Err(error) => failed = Err(error),
            }
        }
        failed
    }
}

/// The loop of the thread; ends behind `stop`, when all is written that can be.
pub(super) fn run(folder: &Path, machine: &str, desk: &Desk, stop: &AtomicBool) {
    capabilities::give_up_or_warn(Work::Ordinary);
    let mut keeper = Keeper::new(machine, desk);
    loop {
        let ends = stop.load(Acquire);
        let failed_before = keeper.fails;
        let kept = keeper.keep(&mut Disk, folder, desk);
        keeper.fails = kept.is_err();
        if let (Err(error), false) = (kept, failed_before) {
            let what =
                format!("RETAIN variables are not kept: {error}; the programs know them until this process ends");
            if ends {
                // The journal is over.
                let _ = writeln!(files::printed::stderr(), "warning: {what}");
            } else {
                desk.warn(what);
            }
        }
        if ends {
            return;
        }
        for _ in 0..LOOKS {
            if !stop.load(Acquire) {
                std::thread::sleep(LOOK);
            }
        }
    }
}
