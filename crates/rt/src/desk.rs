//! Switches and counters of the operator's desk that the operator's loop keeps, as pins.
//!
//! In:  what the operator's loop says they are; edges of pins.
//! Out: pins; what pins want of the operator's loop.
//!
//! RT: nothing allocates but [`DeskPins::new`].

use hal_pins::{Hal, HalError, Input, Output};
use machine::faults::Reaction;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering::Relaxed};

/// What the operator's loop and the cycle thread tell each other of it.
#[derive(Debug, Default)]
pub struct Desk {
    block_delete: AtomicBool,
    /// Made, and wanted; 0: nobody says how many.
    parts: [AtomicU64; 2],
    /// In the spindle.
    tool: AtomicU32,
    /// Alarms and warnings since the start, by their reaction.
    alarms: [AtomicU64; Reaction::ALL.len()],
    /// 0: nothing, 1: off, 2: on.
    wanted: AtomicU8,
    reset: AtomicBool,
}

impl Desk {
    /// How things are: whether lines that begin with / are left out; parts made, and wanted (0: nobody says).
    pub fn show(&self, block_delete: bool, parts: [u64; 2]) {
        self.block_delete.store(block_delete, Relaxed);
        for (cell, value) in self.parts.iter().zip(parts) {
            cell.store(value, Relaxed);
        }
    }

    /// Another alarm or warning was given. Of the operator's loop alone.
    pub fn count_alarm(&self, reaction: Reaction) {
        let count = &self.alarms[reaction as usize];
        count.store(count.load(Relaxed) + 1, Relaxed);
    }

    /// Alarms or warnings of this reaction since the start.
    pub fn alarms(&self, reaction: Reaction) -> u64 {
        self.alarms[reaction as usize].load(Relaxed)
    }

    /// Which tool is in the spindle, as far as the operator's loop knows.
    pub fn show_tool(&self, tool: u32) {
        self.tool.store(tool, Relaxed);
    }

    /// Whether a pin has asked since the last call to leave out lines that begin with /, or not to.
    pub fn take_block_delete(&self) -> Option<bool> {
        match self.wanted.swap(0, Relaxed) {
            0 => None,
            wanted => Some(wanted == 2),
        }
    }

    /// Whether a pin has asked since the last call that parts are counted from 0.
    pub fn take_reset(&self) -> bool {
        self.reset.swap(false, Relaxed)
    }
}

/// `.on` and `.off`, of which a rising edge acts, and `.is-on`.
pub struct SwitchPins {
    on: Input<bool>,
    off: Input<bool>,
    is_on: Output<bool>,
    before: [bool; 2],
}

impl SwitchPins {
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, name: &str) -> Result<SwitchPins, HalError> {
        Ok(SwitchPins {
            on: hal.input(&format!("{name}.on"), false)?,
            off: hal.input(&format!("{name}.off"), false)?,
            is_on: hal.output(&format!("{name}.is-on"))?,
            before: [false; 2],
        })
    }

    /// What is wanted, if one of them has risen since the last call; off wins.
    pub fn take(&mut self) -> Option<bool> {
        let now = [&self.on, &self.off].map(Input::get);
        let before = std::mem::replace(&mut self.before, now);
        match [0, 1].map(|pin| now[pin] && !before[pin]) {
            [_, true] => Some(false),
            [true, false] => Some(true),
            [false, false] => None,
        }
    }

    pub fn show(&mut self, on: bool) {
        self.is_on.set(on);
    }
}

/// All pins of it.
pub struct DeskPins {
    block_delete: SwitchPins,
    count: Output<u64>,
    target: Output<u64>,
    reset: Input<bool>,
    reset_before: bool,
    tool: Output<u32>,
    /// A program has put it there, of which the operator's loop has not heard yet.
    changed_to: Option<u32>,
}

impl DeskPins {
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal) -> Result<DeskPins, HalError> {
        Ok(DeskPins {
            block_delete: SwitchPins::new(hal, "halui.program.block-delete")?,
            count: hal.output("halui.parts.count")?,
            target: hal.output("halui.parts.target")?,
            reset: hal.input("halui.parts.reset", false)?,
            reset_before: false,
            tool: hal.output("iocontrol.0.tool-number")?,
            changed_to: None,
        })
    }

    /// The tool in the spindle, 0: none.
    pub fn tool(&self) -> u32 {
        self.tool.get()
    }

    /// A program has changed the tool in the spindle.
    pub fn set_tool(&mut self, tool: u32) {
        self.tool.set(tool);
        self.changed_to = Some(tool);
    }

    /// Once a cycle.
    pub fn follow(&mut self, desk: &Desk) {
        if let Some(on) = self.block_delete.take() {
            desk.wanted.store(if on { 2 } else { 1 }, Relaxed);
        }
        let reset = self.reset.get();
        if reset && !self.reset_before {
            desk.reset.store(true, Relaxed);
        }
        self.reset_before = reset;
        self.block_delete.show(desk.block_delete.load(Relaxed));
        self.count.set(desk.parts[0].load(Relaxed));
        self.target.set(desk.parts[1].load(Relaxed));
        let tool = desk.tool.load(Relaxed);
        if self.changed_to.is_none_or(|changed_to| changed_to == tool) {
            self.changed_to = None;
            self.tool.set(tool);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tool_in_the_spindle_is_never_the_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let mut hal = Hal::create_in(&[folder.path().to_owned()], "desk", 64).unwrap();
        let mut pins = DeskPins::new(&mut hal).unwrap();
        let desk = Desk::default();
        desk.show_tool(3);
        pins.follow(&desk);
        assert_eq!(pins.tool.get(), 3, "as it was kept");
        pins.set_tool(5);
        assert_eq!(pins.tool.get(), 5);
        pins.follow(&desk);
        assert_eq!(pins.tool.get(), 5, "the loop has not heard of it yet");
        pins.set_tool(7);
        desk.show_tool(5);
        pins.follow(&desk);
        assert_eq!(pins.tool.get(), 7, "nor of that");
        desk.show_tool(7);
        pins.follow(&desk);
        desk.show_tool(2);
        pins.follow(&desk);
        assert_eq!(pins.tool.get(), 2, "the table of a random changer was set by hand");
    }
}
