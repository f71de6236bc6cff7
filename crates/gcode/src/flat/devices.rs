//! Spindles, coolant, tools, inputs and the codes of users.
//!
//! In:  what a device shall do; the tool table that the reader of the text has.
//! Out: G96 and G97, M19, M9, G10 L1, M66, M100 to M199. Those of a code and one word stand in the table of
//!      `FlatWriter::call`.

use super::{FlatWriter, Unwritable, Waiting};
use motion::canon::{Input, OrientDirection, Position, SpindleMode, ToolEntry, WaitMode};

impl FlatWriter {
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

    /// Mist or flood was switched off; `other`: the other one is on.
    pub(super) fn coolant_off(&mut self, other: bool) -> Result<(), Unwritable> {
        if other {
            self.waiting = Some(Waiting::Coolant);
            return Ok(());
        }
        self.plain("M9")
    }

    pub(super) fn tool_entry(&mut self, entry: &ToolEntry) -> Result<(), Unwritable> {
        let old = self.tools.insert(entry.tool, *entry);
        // A table names the tool in the spindle twice.
        let told = self.entry.replace(*entry);
        if told.is_some_and(|told| ToolEntry { pocket: 0, ..told } == ToolEntry { pocket: 0, ..*entry }) {
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
