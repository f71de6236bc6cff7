//! Keeps what a program left behind: for the next program at once, in the files of the machine as soon as the disk has them.
//!
//! In:  parameters and tools of a program that is over, however it ended.
//! Out: the tables of the session; their files, written by a thread of its own, because a disk takes its time.
//!
//! The interpreter is ahead of the machine: a program that was stopped leaves behind what its lines said that had been
//! interpreted, as in LinuxCNC. The tool in the spindle is the one that the machine itself told last.

use crate::console::Operator;
use crate::memory::Memory;
use crate::remembered;
use gcode::ToolChanger;
use host::capabilities;
use machine::safe_file::Disk;
use machine::state::State;
use machine::tables::{self, LifeChange, Tables, lock};
use protocol::{Message, message};
use std::collections::BTreeSet;
use std::sync::Mutex;
use std::thread::{Scope, ScopedJoinHandle};

/// What has to be on the disk for something to count as kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mark {
    tables: u64,
    memory: u64,
    journal: u64,
}

/// Between two attempts to write what could not be written, ns.
const AGAIN_NS: u64 = 1_000_000_000;

/// Use of tools that is lost where the power fails, min.
const UNWRITTEN_MAX_MIN: f64 = 1.0;

/// Waits for programs to end.
pub(super) struct Keeper<'scope, 'env> {
    scope: &'scope Scope<'scope, 'env>,
    tables: &'env Mutex<Tables>,
    /// What else is known again after a restart.
    pub(super) memory: Memory<'env>,
    /// How often something was handed in, what of that is being written, and what has been or cannot be.
    handed_in: u64,
    writing: u64,
    treated: u64,
    /// Why they could not be written.
    failed: Option<String>,
    writer: Option<ScopedJoinHandle<'scope, Result<(), String>>>,
    /// When that is tried once more.
    again_ns: u64,
    /// Tools that the program under way has used, when the last use was counted, and how much of it is not in the file, min.
    used: BTreeSet<u32>,
    counted_ns: u64,
    unwritten_min: f64,
}

impl<'scope, 'env> Keeper<'scope, 'env> {
    pub(super) fn new(
        scope: &'scope Scope<'scope, 'env>,
        tables: &'env Mutex<Tables>,
        memory: Memory<'env>,
    ) -> Keeper<'scope, 'env> {
        Keeper {
            scope,
            tables,
            memory,
            handed_in: 0,
            writing: 0,
            treated: 0,
            failed: None,
            writer: None,
            again_ns: 0,
            used: BTreeSet::new(),
            counted_ns: 0,
            unwritten_min: 0.0,
        }
    }

    /// Takes what a program left behind; the next one finds it.
    ///
    /// What is otherwise than before, for the journal.
    pub(super) fn hand_in(&mut self, left: gcode::Settings) -> Vec<Message> {
        let mut tables = lock(self.tables);
        let before = tables.clone();
        tables.adopt(left);
        self.handed_in += u64::from(tables.has_files());
        remembered::changes(&before, &tables)
    }

    /// Somebody says how long a tool may be used, or has been.
    pub(super) fn set_life(&mut self, tool: u32, change: &LifeChange, operator: &mut Operator) {
        if *change == LifeChange::default() {
            return;
        }
        let mut tables = lock(self.tables);
        let before = tables.life(tool);
        tables.set_life(tool, change);
        for what in remembered::life_changes(tool, &before, &tables.life(tool)) {
            operator.add_entry(what);
            self.handed_in += u64::from(tables.has_files());
        }
    }

    /// A program begins that calls these tools.
    pub(super) fn begin_program(&mut self, tools: &[u32], operator: &mut Operator) {
        self.used.clear();
        let tables = lock(self.tables);
        for (tool, sister) in tables.sisters() {
            if tools.contains(&sister) {
                operator.add_entry(message!(
                    "tool.sister",
                    "T{sister} is used where T{tool} is called, whose life is over",
                    sister = sister,
                    tool = tool
                ));
            }
        }
        let over = tools.iter().filter(|tool| tables.life(**tool).is_over());
        for tool in over {
            operator.add_warning(remembered::life_over(*tool, &tables));
        }
    }

    /// A program came to its end, and made a part.
    pub(super) fn made_part(&mut self, operator: &mut Operator) {
        for tool in std::mem::take(&mut self.used) {
            self.use_up(tool, 0.0, 1, operator);
        }
        self.unwritten_min = UNWRITTEN_MAX_MIN;
    }

    fn use_up(&mut self, tool: u32, minutes: f64, parts: u32, operator: &mut Operator) {
        let mut tables = lock(self.tables);
        if tables.use_up(tool, minutes, parts) {
            operator.add_warning(remembered::life_over(tool, &tables));
        }
    }

    /// Counts for how long tools are used. The file is not written for every turn of the loop.
    fn count(&mut self, tool: u32, operator: &mut Operator, now_ns: u64) {
        let minutes = now_ns.saturating_sub(std::mem::replace(&mut self.counted_ns, now_ns)) as f64 / 60e9;
        let live = operator.live();
        if tool != 0 && live.state == State::Running && live.spindle_on {
            self.used.insert(tool);
            self.use_up(tool, minutes, 0, operator);
            self.unwritten_min += minutes;
        } else if self.unwritten_min > 0.0 && live.state != State::Running {
            self.unwritten_min = UNWRITTEN_MAX_MIN;
        }
        if self.unwritten_min >= UNWRITTEN_MAX_MIN {
            self.unwritten_min = 0.0;
            self.handed_in += u64::from(lock(self.tables).has_files());
        }
    }

    /// What was handed in last is of a program that was given up: the work system in force is the one before it, for the program was
    /// read ahead of the machine.
    pub(super) fn give_up(&mut self, system_before: u8) {
        let mut tables = lock(self.tables);
        if tables.work_system() != system_before {
            tables.set_work_system(system_before);
            self.handed_in += u64::from(tables.has_files());
        }
    }

    /// All that is handed in and noted up to now.
    pub(super) fn mark(&self, operator: &Operator) -> Mark {
        Mark {
            tables: self.handed_in,
            memory: self.memory.mark(),
            journal: operator.log().last(),
        }
    }

    /// Whether that has been written, or cannot be.
    pub(super) fn is_settled(&self, mark: &Mark, operator: &Operator) -> bool {
        self.treated >= mark.tables && self.memory.is_settled(mark.memory) && operator.log().is_kept(mark.journal)
    }

    /// Why what was handed in last is not on the disk.
    pub(super) fn failure(&self, operator: &Operator) -> Option<&str> {
        let journal = operator.log().fails().then_some("the journal cannot be written");
        self.failed.as_deref().or(self.memory.failure()).or(journal)
    }

    /// Called in every turn of the loop. Waits for nothing.
    pub(super) fn look(&mut self, operator: &mut Operator, now_ns: u64) {
        let changed = operator.take_changed_tools();
        let tool = {
            let mut tables = lock(self.tables);
            for tool in &changed {
                tables.tool_changed(*tool);
            }
            let is_kept = tables.has_files() && tables.tools().changer() == ToolChanger::Random;
            self.handed_in += u64::from(is_kept && !changed.is_empty());
            tables.tool_in_spindle()
        };
        self.count(tool, operator, now_ns);
        // Where tools are is not to wait for the end of the program. What could not be written is tried again: there may be room.
        let again = self.failed.is_some() && now_ns >= self.again_ns;
        if self.treated < self.handed_in || again {
            self.again_ns = now_ns + AGAIN_NS;
            self.write(operator, again);
        }
        operator.shared().desk.show_tool(tool);
        self.memory.look(operator, tool, now_ns);
    }

    /// Called while no program is under way. Waits for nothing.
    pub(super) fn poll(&mut self, operator: &mut Operator) {
        if let Some(tool) = operator.tool() {
            lock(self.tables).set_tool_in_spindle(tool);
        }
        self.write(operator, false);
    }

    fn write(&mut self, operator: &mut Operator, again: bool) {
        if self.writer.as_ref().is_some_and(ScopedJoinHandle::is_finished) {
            self.join(operator);
        }
        if (self.treated < self.handed_in || again) && self.writer.is_none() {
            self.writing = self.handed_in;
            let tables = self.tables;
            let spawned = std::thread::Builder::new()
                .name("tables".into())
                .spawn_scoped(self.scope, move || write(tables));
            match spawned {
                Ok(writer) => self.writer = Some(writer),
                Err(cause) => self.add_result(operator, Err(format!("no thread writes the tables: {cause}"))),
            }
        }
    }

    /// Called when all is over; waits for the disk.
    pub(super) fn finish(&mut self, operator: &mut Operator) {
        self.join(operator);
        if self.treated < self.handed_in || self.failed.is_some() {
            self.writing = self.handed_in;
            let written = write(self.tables);
            self.add_result(operator, written);
        }
        self.memory.finish(operator);
    }

    /// Whether the files hold all that was handed in, as far as they can.
    pub(super) fn is_written(&self) -> bool {
        self.writer.is_none() && self.treated == self.handed_in
    }

    fn join(&mut self, operator: &mut Operator) {
        let written = self.writer.take().map(ScopedJoinHandle::join);
        if let Some(written) = written {
            let panicked = |_| Err("the thread that writes the tables panicked".into());
            self.add_result(operator, written.unwrap_or_else(panicked));
        }
    }

    fn add_result(&mut self, operator: &mut Operator, written: Result<(), String>) {
        self.treated = self.writing;
        match &written {
            Err(cause) if self.failed.as_ref() != Some(cause) => {
                operator.add_warning(format!("not kept: {cause}"));
            }
            Ok(()) if self.failed.is_some() => operator.add_entry("offsets and tools are kept again"),
            Ok(()) | Err(_) => {}
        }
        self.failed = written.err();
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
