//! The tool changer: what it is asked for, and which tool is in the spindle.
//!
//! In:  T, M6 and M61 of the program; pins of the changer; what the operator's loop knows.
//! Out: pins, as LinuxCNC's `iocontrol` has them.
//!
//! RT: nothing allocates but what makes the pins.

use crate::desk::Desk;
use config::Config;
use hal_pins::{Hal, HalError, Input, Output};

/// `iocontrol.0.tool-number`: the tool in the spindle, 0: none.
pub struct ToolInSpindle {
    number: Output<u32>,
    /// A program has put it there, of which the operator's loop has not heard yet.
    changed_to: Option<u32>,
}

impl ToolInSpindle {
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal) -> Result<ToolInSpindle, HalError> {
        Ok(ToolInSpindle {
            number: hal.output("iocontrol.0.tool-number")?,
            changed_to: None,
        })
    }

    fn set(&mut self, tool: u32) {
        self.number.set(tool);
        self.changed_to = Some(tool);
    }

    fn follow(&mut self, desk: &Desk) {
        let tool = desk.tool();
        if self.changed_to.is_none_or(|changed_to| changed_to == tool) {
            self.changed_to = None;
            self.number.set(tool);
        }
    }
}

/// The changer of a machine.
pub struct ToolChanger {
    in_spindle: ToolInSpindle,
    /// Pocket 0 is the spindle.
    is_random: bool,
    prepare: Output<bool>,
    prep_number: Output<u32>,
    prep_pocket: Output<i32>,
    prepared: Input<bool>,
    change: Output<bool>,
    changed: Input<bool>,
    /// The change under way has been asked for.
    is_asked: bool,
}

impl ToolChanger {
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config, in_spindle: ToolInSpindle) -> Result<ToolChanger, HalError> {
        Ok(ToolChanger {
            in_spindle,
            is_random: config.tools.changer == gcode::ToolChanger::Random,
            prepare: hal.output("iocontrol.0.tool-prepare")?,
            prep_number: hal.output("iocontrol.0.tool-prep-number")?,
            prep_pocket: hal.output("iocontrol.0.tool-prep-pocket")?,
            // A changer that prepares nothing is always ready.
            prepared: hal.input("iocontrol.0.tool-prepared", true)?,
            change: hal.output("iocontrol.0.tool-change")?,
            changed: hal.input("iocontrol.0.tool-changed", false)?,
            is_asked: false,
        })
    }

    /// Once in every cycle: another tool in the spindle, as the operator's loop knows.
    pub fn follow(&mut self, desk: &Desk) {
        self.in_spindle.follow(desk);
    }

    /// M61: this tool is in the spindle.
    pub fn set_tool(&mut self, tool: u32) {
        self.in_spindle.set(tool);
    }

    /// T: asks the changer to have a tool ready, while the program goes on. `pocket`: where it is, as far as anybody knows.
    pub fn prepare(&mut self, tool: u32, pocket: Option<u32>) {
        self.prep_number.set(tool);
        self.prep_pocket
            .set(pocket.and_then(|pocket| i32::try_from(pocket).ok()).unwrap_or(-1));
        // Where pocket 0 is the spindle, there is nothing to fetch.
        self.prepare.set(!(self.is_random && self.is_there(tool)));
    }

    /// Once in every cycle: the tool may be ready, so that the change can begin.
    pub fn look(&mut self) {
        if self.prepare.get() && self.prepared.get() {
            self.prepare.set(false);
        }
    }

    /// M6 begins.
    pub fn begin_change(&mut self) {
        self.is_asked = false;
    }

    /// Whether the tool of an M6 is in the spindle; once in every cycle, until it is.
    pub fn is_changed(&mut self, tool: u32) -> bool {
        // The magazine still turns.
        if self.prepare.get() {
            return false;
        }
        if !self.is_asked {
            // A tool that is there is asked for by nobody; that there is none, somebody has to see.
            if self.is_there(tool) {
                return true;
            }
            // `tool-changed` still up from the change before must not answer for this one: it has to fall first.
            self.is_asked = !self.changed.get();
            self.change.set(self.is_asked);
            return false;
        }
        let done = self.changed.get();
        if done {
            // Whoever sees the request fall reads the new one.
            self.in_spindle.set(tool);
            self.change.set(false);
        }
        done
    }

    /// Asks for nothing any more: the operator says that the tool is changed, or the program is over.
    pub fn end(&mut self) {
        self.prepare.set(false);
        self.change.set(false);
    }

    fn is_there(&self, tool: u32) -> bool {
        tool != 0 && self.in_spindle.number.get() == tool
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tool_in_the_spindle_is_never_the_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let mut hal = Hal::create_in(&[folder.path().to_owned()], "tool", 64).unwrap();
        let mut tool = ToolInSpindle::new(&mut hal).unwrap();
        let desk = Desk::default();
        desk.show_tool(3);
        tool.follow(&desk);
        assert_eq!(tool.number.get(), 3, "as it was kept");
        tool.set(5);
        assert_eq!(tool.number.get(), 5);
        tool.follow(&desk);
        assert_eq!(tool.number.get(), 5, "the loop has not heard of it yet");
        tool.set(7);
        desk.show_tool(5);
        tool.follow(&desk);
        assert_eq!(tool.number.get(), 7, "nor of that");
        desk.show_tool(7);
        tool.follow(&desk);
        desk.show_tool(2);
        tool.follow(&desk);
        assert_eq!(tool.number.get(), 2, "the table of a random changer was set by hand");
    }
}
