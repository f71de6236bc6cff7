//! Spindles, coolant, tools, inputs and the codes of users.
//!
//! In:  what a device shall do; the tool table that the reader of the text has.
//! Out: G96 and G97, M3, M4, M19, M7 to M9, T and M6, G10 L1, M62 to M66, M100 to M199. Those of a code and its words stand in
//!      the table of `FlatWriter::call`.

use super::{FlatWriter, Unwritable, Waiting};
use crate::Settings;
use motion::canon::{Input, OrientDirection, Position, SpindleDirection, SpindleMode, ToolEntry, WaitMode};
use std::collections::BTreeMap;

/// Tools as the reader of the text has them.
#[derive(Clone, Debug)]
pub(super) struct Tools {
    entries: BTreeMap<u32, ToolEntry>,
    /// The entry that was written last.
    written: Option<ToolEntry>,
    selected: u32,
}

impl Tools {
    pub(super) fn at_start(settings: &Settings) -> Tools {
        let tools = settings.tools.tools();
        Tools {
            entries: tools.map(|tool| (tool.number, tool.entry(tool.pocket))).collect(),
            written: None,
            selected: 0,
        }
    }
}

impl FlatWriter {
    pub(super) fn start_spindle(
        &mut self,
        spindle: u8,
        direction: SpindleDirection,
        wait_for_speed: bool,
    ) -> Result<(), Unwritable> {
        if !wait_for_speed {
            return Err(Unwritable::SpindleWithoutWait);
        }
        let code = match direction {
            SpindleDirection::Clockwise => "M3",
            SpindleDirection::Counterclockwise => "M4",
        };
        self.line.begin(code).spindle(spindle);
        self.end_line()
    }

    pub(super) fn spindle_mode(
        &mut self,
        spindle: u8,
        mode: SpindleMode,
        speed: Option<f64>,
    ) -> Result<(), Unwritable> {
        match mode {
            SpindleMode::Rpm => self.line.begin("G97"),
            SpindleMode::ConstantSurfaceSpeed { max_rpm: None } => self.line.begin("G96"),
            SpindleMode::ConstantSurfaceSpeed { max_rpm: Some(max_rpm) } => self.line.begin("G96").word('D', max_rpm),
        };
        if let Some(speed) = speed {
            self.line.word('S', speed);
        }
        self.line.spindle(spindle);
        self.end_line()
    }

    pub(super) fn orient(
        &mut self,
        spindle: u8,
        degrees: f64,
        direction: OrientDirection,
        timeout_s: Option<f64>,
    ) -> Result<(), Unwritable> {
        self.line.begin("M19").word('R', degrees - self.orient_offset_degrees);
        match direction {
            OrientDirection::Shortest => {}
            OrientDirection::Clockwise => {
                self.line.word('P', 1);
            }
            OrientDirection::Counterclockwise => {
                self.line.word('P', 2);
            }
        }
        if let Some(timeout_s) = timeout_s {
            self.line.word('Q', timeout_s);
        }
        self.line.spindle(spindle);
        self.end_line()
    }

    pub(super) fn mist(&mut self, on: bool) -> Result<(), Unwritable> {
        self.mist = on;
        if on {
            self.plain("M7")
        } else {
            self.coolant_off(self.flood)
        }
    }

    pub(super) fn flood(&mut self, on: bool) -> Result<(), Unwritable> {
        self.flood = on;
        if on {
            self.plain("M8")
        } else {
            self.coolant_off(self.mist)
        }
    }

    /// Mist or flood was switched off; `other`: the other one is on.
    fn coolant_off(&mut self, other: bool) -> Result<(), Unwritable> {
        if other {
            return self.wait(Waiting::Coolant);
        }
        self.plain("M9")
    }

    pub(super) fn select_tool(&mut self, tool: u32) -> Result<(), Unwritable> {
        self.tools.selected = tool;
        self.one_word("", 'T', tool)
    }

    pub(super) fn change_tool(&mut self, tool: u32) -> Result<(), Unwritable> {
        self.line.begin("M6");
        if self.tools.selected != tool {
            self.tools.selected = tool;
            self.line.word('T', tool);
        }
        self.end_line()
    }

    pub(super) fn tool_entry(&mut self, entry: &ToolEntry) -> Result<(), Unwritable> {
        let old = self.tools.entries.insert(entry.tool, *entry);
        // A table names the tool in the spindle twice.
        let written = self.tools.written.replace(*entry);
        if written.is_some_and(|written| ToolEntry { pocket: 0, ..written } == ToolEntry { pocket: 0, ..*entry }) {
            return Ok(());
        }
        self.line.begin("G10 L1").word('P', entry.tool);
        let old_offset = old.map_or(Position::ZERO, |old| old.offset);
        self.push_changed(old_offset, entry.offset);
        self.line
            .word('R', entry.diameter_mm / 2.0)
            .word('I', entry.front_angle_degrees)
            .word('J', entry.back_angle_degrees)
            .word('Q', entry.orientation);
        self.end_line()
    }

    pub(super) fn digital_output(&mut self, index: u8, on: bool, with_motion: bool) -> Result<(), Unwritable> {
        let code = match (with_motion, on) {
            (true, true) => "M62",
            (true, false) => "M63",
            (false, true) => "M64",
            (false, false) => "M65",
        };
        self.one_word(code, 'P', index)
    }

    pub(super) fn wait_input(&mut self, input: Input, mode: WaitMode, timeout_s: f64) -> Result<(), Unwritable> {
        self.line.begin("M66");
        match input {
            Input::Digital(index) => self.line.word('P', index),
            Input::Analog(index) => self.line.word('E', index),
        };
        let mode = match mode {
            WaitMode::Immediate => 0,
            WaitMode::Rise => 1,
            WaitMode::Fall => 2,
            WaitMode::High => 3,
            WaitMode::Low => 4,
        };
        self.line.word('L', mode);
        if timeout_s != 0.0 {
            self.line.word('Q', timeout_s);
        }
        self.end_line()
    }

    pub(super) fn user_code(&mut self, number: u8, p: f64, q: f64) -> Result<(), Unwritable> {
        if !(100..=199).contains(&number) {
            return Err(Unwritable::UserCode(number));
        }
        self.line.begin("").word('M', number);
        for (letter, value) in [('P', p), ('Q', q)] {
            if value != -1.0 {
                self.line.word(letter, value);
            }
        }
        self.end_line()
    }
}
