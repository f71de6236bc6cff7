//! Tools: T, M6, M61, G43 to G49, G10 L0, L1, L10, L11.

use super::Calls;
use crate::Tool;
use crate::block::Block;
use crate::code::{LengthOffset, ToolCode, integer_in};
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::{Question, State, plus};
use motion::canon::{Axis, Call, Position};

impl State {
    pub(super) fn select_tool(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(number) = block.word_value(b'T') else {
            return Ok(());
        };
        let tool = self.tool_of(number).map_err(|kind| (block.span(b'T'), kind))?;
        self.tools.selected = Some(tool.number);
        calls.push_back(Call::SelectTool { tool: tool.number });
        Ok(())
    }

    /// The table's entry of a tool number; 0: no tool.
    pub(super) fn tool_of(&self, number: f64) -> Result<Tool, ErrorKind> {
        let number = integer_in(number, 0..=i64::from(u32::MAX)).unwrap_or(0) as u32; // checked by `Block::read`
        if number == 0 {
            return Ok(self.tools.table.by_number(0).cloned().unwrap_or_default());
        }
        let found = self.tools.table.by_number(number).cloned();
        found.ok_or(ErrorKind::NoSuchTool { number })
    }

    pub(super) fn change_tool(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.tool else { return Ok(()) };
        match code.value {
            ToolCode::Change => {
                let number = self.tools.selected.unwrap_or(0);
                let tool = self.tool_of(f64::from(number)).map_err(|kind| (code.span, kind))?;
                calls.extend([
                    Call::StartChange,
                    Call::StopSpindle { spindle: 0 },
                    Call::ChangeTool {
                        tool: tool.number,
                        pocket: tool.pocket,
                    },
                ]);
                self.modal.spindles[0].turning = None;
                self.question = Some(Question::Tool { tool: tool.number });
                self.tool_changed(tool.number);
            }
            ToolCode::SetNumber => {
                let missing = || (code.span, ErrorKind::ToolNumberMissing);
                let number = block.word_value(b'Q').ok_or_else(missing)?;
                let integer = integer_in(number, 0..=i64::from(u32::MAX)).ok_or((
                    block.span(b'Q'),
                    ErrorKind::NotInteger {
                        letter: 'Q',
                        value: number,
                    },
                ))?;
                let tool = self.tool_of(integer as f64).map_err(|kind| (block.span(b'Q'), kind))?;
                self.tool_changed(tool.number);
                calls.push_back(Call::SetToolNumber {
                    tool: tool.number,
                    pocket: tool.pocket,
                });
            }
        }
        Ok(())
    }

    /// The spindle holds another tool.
    pub(super) fn tool_changed(&mut self, number: u32) {
        self.tools.in_spindle = number;
        self.tools.pocket = self.tools.table.by_number(number).map_or(0, |tool| tool.pocket);
    }

    pub(super) fn length_offset(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.length_offset else {
            return Ok(());
        };
        let of_words = |state: &State, mut offset: Position, add: bool| {
            for axis in Axis::ALL {
                if let Some(number) = block.axis(axis) {
                    let value = state.length(axis, number);
                    offset[axis] = if add { offset[axis] + value } else { value };
                }
            }
            offset
        };
        let of_tool = |state: &State| match block.word_value(b'H') {
            Some(number) => state
                .tool_of(number)
                .map(|tool| tool.offset)
                .map_err(|kind| (block.span(b'H'), kind)),
            None => Ok(state.tool().offset),
        };
        let offset = match code.value {
            LengthOffset::Off => Position::ZERO,
            LengthOffset::Tool => of_tool(self)?,
            LengthOffset::Dynamic => of_words(self, self.offsets.tool, false),
            LengthOffset::Additional if block.has_axes() => of_words(self, self.offsets.tool, true),
            LengthOffset::Additional => plus(self.offsets.tool, of_tool(self)?),
        };
        let mut offsets = self.offsets;
        offsets.tool = offset;
        self.set_offsets(offsets);
        calls.push_back(Call::SetToolLengthOffset { offset });
        Ok(())
    }
}
