//! Keeps what a program left behind: for the next program at once, in the files of the machine as soon as the disk has them.
//!
//! In:  parameters and tools of a program that is over, however it ended.
//! Out: the tables of the session; their files, written by a thread of its own, because a disk takes its time.
//!
//! The interpreter is ahead of the machine: a program that was stopped leaves behind what its lines said that had been
//! interpreted, as in LinuxCNC. The tool in the spindle is the one that the machine itself told last.

use crate::host::capabilities;
use crate::machine::safe_file::Disk;
use crate::machine::tables::{self, Tables, lock};
use crate::operator::console::Operator;
use std::io;
use std::sync::Mutex;
use std::thread::{Scope, ScopedJoinHandle};

/// Waits for programs to end.
pub(super) struct Keeper<'scope, 'env> {
    scope: &'scope Scope<'scope, 'env>,
    tables: &'env Mutex<Tables>,
    /// The files are behind the tables.
    behind: bool,
    writer: Option<ScopedJoinHandle<'scope, Result<(), String>>>,
}

impl<'scope, 'env> Keeper<'scope, 'env> {
    pub(super) fn new(scope: &'scope Scope<'scope, 'env>, tables: &'env Mutex<Tables>) -> Keeper<'scope, 'env> {
        Keeper {
            scope,
            tables,
            behind: false,
            writer: None,
        }
    }

    /// Takes what a program left behind; the next one finds it.
    pub(super) fn hand_in(&mut self, left: gcode::Settings) {
        lock(self.tables).adopt(left);
        self.behind = true;
    }

    /// Called while no program is under way. Waits for nothing.
    pub(super) fn poll(&mut self, operator: &mut Operator) -> io::Result<()> {
        if self.writer.as_ref().is_some_and(ScopedJoinHandle::is_finished) {
            self.join(operator);
        }
        if let Some(tool) = operator.tool() {
            lock(self.tables).set_tool_in_spindle(tool);
        }
        if self.behind && self.writer.is_none() {
            self.behind = false;
            let tables = self.tables;
            let writer = move || write(tables);
            self.writer = Some(
                std::thread::Builder::new()
                    .name("tables".into())
                    .spawn_scoped(self.scope, writer)?,
            );
        }
        Ok(())
    }

    /// Called when all is over; waits for the disk.
    pub(super) fn finish(&mut self, operator: &mut Operator) {
        self.join(operator);
        if self.behind {
            self.behind = false;
            add_result(operator, write(self.tables));
        }
    }

    fn join(&mut self, operator: &mut Operator) {
        let written = self.writer.take().map(ScopedJoinHandle::join);
        if let Some(written) = written {
            add_result(
                operator,
                written.unwrap_or_else(|_| Err("the thread that writes the tables panicked".into())),
            );
        }
    }
}

fn write(tables: &Mutex<Tables>) -> Result<(), String> {
    if let Err(cause) = capabilities::use_files() {
        return Err(format!("tables cannot be written: {cause}"));
    }
    let saved = tables::save(&mut Disk, tables);
    tracing::debug!(ok = saved.is_ok(), "tables written");
    saved
}

fn add_result(operator: &mut Operator, written: Result<(), String>) {
    if let Err(cause) = written {
        operator.add_entry(format!("warning: not kept: {cause}"));
    }
}
