//! Tools: T, M6, M61, G43 to G49, and the tool table (G10 L0, L1, L10, L11).

use crate::block::Block;
use crate::code::{LengthOffset, Motion, ToolCode, integer_in};
use crate::error::{ErrorKind, SetDataError};
use crate::scan::{Fault, Span};
use crate::state::{Calls, Offsets, Question, State, plus, turned};
use crate::{SetToolError, Tool, ToolChanger};
use motion::canon::{Axis, Call, Position};

impl State {
    pub(super) fn select_tool(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(number) = block.word_value(b'T') else {
            return Ok(());
        };
        let tool = self.tool_of(number).map_err(|kind| block.span(b'T').fault(kind))?;
        self.tools.selected = Some(tool.number);
        calls.push_back(Call::SelectTool { tool: tool.number });
        Ok(())
    }

    /// The tool of H and D: 0 is the one in the spindle, unless a random tool changer has a tool 0.
    pub(super) fn tool_or_spindle(&self, number: f64) -> Result<Tool, ErrorKind> {
        match self.tools.table.changer() {
            ToolChanger::Fixed if number == 0.0 => Ok(self.tool()),
            ToolChanger::Fixed | ToolChanger::Random => self.tool_of(number),
        }
    }

    /// The tool that a number calls, with its wear. 0 is no tool, but of a random tool changer.
    pub(super) fn tool_of(&self, number: f64) -> Result<Tool, ErrorKind> {
        let wanted = integer_in(number, 0..=i64::from(u32::MAX)).map(|number| number as u32);
        let table = &self.tools.table;
        let found = wanted.and_then(|number| table.with_wear(table.called(number)));
        self.found(found, wanted, number)
    }

    /// The table's entry of just that number.
    fn entry_of(&self, number: f64) -> Result<Tool, ErrorKind> {
        let wanted = integer_in(number, 0..=i64::from(u32::MAX)).map(|number| number as u32);
        let found = wanted.and_then(|number| self.tools.table.by_number(number).cloned());
        self.found(found, wanted, number)
    }

    fn found(&self, found: Option<Tool>, wanted: Option<u32>, number: f64) -> Result<Tool, ErrorKind> {
        match (found, wanted, self.tools.table.changer()) {
            (Some(tool), _, _) => Ok(tool),
            (None, Some(0), ToolChanger::Fixed) => Ok(Tool::default()),
            (None, _, ToolChanger::Fixed | ToolChanger::Random) => {
                let lathe = wanted.and_then(|wanted| self.lathe_tool(wanted));
                Err(ErrorKind::NoSuchTool { number, lathe })
            }
        }
    }

    /// Tool and offset of a T word of other lathes, T0101, if there is such a tool.
    fn lathe_tool(&self, number: u32) -> Option<[u32; 2]> {
        let [tool, offset] = [number / 100, number % 100];
        let is_one = (1..=99).contains(&tool) && offset > 0 && self.tools.table.by_number(tool).is_some();
        is_one.then_some([tool, offset])
    }

    pub(super) fn change_tool(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.tool else { return Ok(()) };
        match code.value {
            ToolCode::Change => {
                let number = self.tools.selected.unwrap_or(0);
                let tool = self.tool_of(f64::from(number)).map_err(|kind| (code.span, kind))?;
                let place = self.settings.tool_change;
                if self.tool_centre_point && (place.quill_up || place.at_g30) {
                    return Err(code
                        .span
                        .fault(ErrorKind::MachineUnderToolCentrePoint { code: "M6".into() }));
                }
                self.go_to_tool_change(calls);
                calls.push_back(Call::ChangeTool {
                    tool: tool.number,
                    pocket: tool.pocket,
                });
                self.questions.push(Question::Tool {
                    tool: tool.number,
                    before: None,
                });
                self.tool_changed(tool.number);
                if self.settings.keep_tool_offset && self.tools.offset_on {
                    self.use_tool_offset(self.tool().offset, calls);
                    self.tools.offset_on = tool.number != 0;
                    self.tools.offset_of = self.tools.offset_on.then_some(tool.number);
                }
            }
            ToolCode::SetNumber => {
                let missing = || (code.span, ErrorKind::ToolNumberMissing);
                let number = block.word_value(b'Q').ok_or_else(missing)?;
                block.check_not_negative(b'Q')?;
                let tool = self
                    .entry_of(number.round())
                    .map_err(|kind| block.span(b'Q').fault(kind))?;
                self.tool_changed(tool.number);
                calls.push_back(Call::SetToolNumber {
                    tool: tool.number,
                    pocket: tool.pocket,
                });
            }
        }
        Ok(())
    }

    /// Stops the spindles and goes where tools are changed, as far as the machine wants this.
    fn go_to_tool_change(&mut self, calls: &mut Calls) {
        let place = self.settings.tool_change;
        calls.push_back(Call::StartChange);
        if !place.spindle_on {
            for (number, spindle) in (0..self.settings.spindles).zip(&mut self.modal.spindles) {
                spindle.turning = None;
                calls.push_back(Call::StopSpindle { spindle: number });
            }
        }
        if place.quill_up || place.at_g30 {
            calls.push_back(Call::Comment("AXIS,hide".into()));
            if place.quill_up {
                let mut machine = self.machine();
                machine[Axis::Z] = 0.0;
                self.traverse_to_machine(machine, calls);
            }
            if place.at_g30 {
                let unit = self.settings.machine_unit;
                self.traverse_to_machine(self.parameters.position(crate::parameter::G30_POINT, unit), calls);
            }
            calls.push_back(Call::Comment("AXIS,show".into()));
        }
    }

    fn traverse_to_machine(&mut self, machine: Position, calls: &mut Calls) {
        self.at = self.offsets.work(machine);
        calls.push_back(Call::StraightTraverse { to: self.at });
    }

    /// The spindle holds another tool.
    pub(super) fn tool_changed(&mut self, number: u32) {
        let tools = &mut self.tools;
        if tools.table.changer() == ToolChanger::Random
            && let Some(pocket) = tools.table.by_number(number).map(|tool| tool.pocket)
        {
            tools.table.swap_pockets(0, pocket);
        }
        tools.in_spindle = number;
        tools.line = tools.line_of(number);
    }
}

/// Length offsets.
impl State {
    pub(super) fn length_offset(
        &mut self,
        motion: Option<Motion>,
        block: &Block,
        calls: &mut Calls,
    ) -> Result<(), Fault> {
        let Some(code) = block.codes.length_offset else {
            return Ok(());
        };
        let of_tool = |state: &State| match block.word_value(b'H') {
            // H0 is the tool in the spindle.
            None | Some(0.0) => Ok(state.tool()),
            Some(number) => state
                .tool_or_spindle(number)
                .map_err(|kind| block.span(b'H').fault(kind)),
        };
        let mut offset_of = None;
        let offset = match code.value {
            LengthOffset::Off => Position::ZERO,
            LengthOffset::Tool => {
                let tool = of_tool(self)?;
                offset_of = Some(tool.number);
                tool.offset
            }
            LengthOffset::ToolCentrePoint if !self.settings.kinematics.has_tcp() => {
                return Err((code.span, ErrorKind::NoToolCentrePoint));
            }
            LengthOffset::ToolCentrePoint => {
                let tool = of_tool(self)?;
                offset_of = Some(tool.number);
                let offset = tool.offset;
                let across = Axis::ALL
                    .into_iter()
                    .find(|&axis| axis != Axis::Z && offset[axis] != 0.0);
                if let Some(axis) = across {
                    return Err(code.span.fault(ErrorKind::OffsetUnderToolCentrePoint {
                        letter: axis.letter(),
                        value: offset[axis],
                    }));
                }
                offset
            }
            LengthOffset::Dynamic => {
                let mut offset = self.offsets.tool;
                for (axis, value) in self.axis_values(block) {
                    offset[axis] = value;
                }
                offset
            }
            LengthOffset::Additional => match (block.has_axes(), block.word_value(b'H')) {
                (true, None) => {
                    let mut offset = self.offsets.tool;
                    for (axis, value) in self.axis_values(block) {
                        offset[axis] += value;
                    }
                    offset
                }
                (false, Some(_)) => plus(self.offsets.tool, of_tool(self)?.offset),
                (true, Some(_)) => return Err((block.span(b'H'), ErrorKind::AddedOffsetTwice)),
                (false, None) => return Err((code.span, ErrorKind::AddedOffsetMissing)),
            },
        };
        if let Some(Question::Tool { before, .. }) = self.questions.last_mut()
            && motion.is_none()
        {
            *before = Some(self.at);
        }
        self.use_tool_frame(offset, code.value == LengthOffset::ToolCentrePoint, calls);
        self.tools.offset_on = code.value != LengthOffset::Off;
        self.tools.offset_of = offset_of;
        Ok(())
    }

    /// Another tool, with tool-centre-point control as it is.
    pub(super) fn use_tool_offset(&mut self, offset: Position, calls: &mut Calls) {
        self.use_tool_frame(offset, self.tool_centre_point, calls);
    }

    /// Another tool or another meaning of the axes. Joints stay where they are, and the axes read otherwise.
    pub(super) fn use_tool_frame(&mut self, offset: Position, centre_point: bool, calls: &mut Calls) {
        let (before, machine) = (self.tool_frame(), self.machine());
        let switched = centre_point != self.tool_centre_point;
        if switched && !centre_point {
            calls.push_back(Call::SetToolCentrePoint(false));
        }
        calls.push_back(Call::SetToolLengthOffset { offset });
        if switched && centre_point {
            calls.push_back(Call::SetToolCentrePoint(true));
        }
        self.offsets.tool = offset;
        self.tool_centre_point = centre_point;
        let reframed = self.settings.kinematics.reframe(&machine, &before, &self.tool_frame());
        // Machines with tool-centre-point control reach every place under either meaning.
        self.at = self.offsets.work(reframed.unwrap_or(machine));
    }

    /// The axis words of a line with their values in mm and degrees; X in G7 as a radius.
    pub(super) fn axis_values<'b>(&self, block: &'b Block) -> impl Iterator<Item = (Axis, f64)> + use<'b> {
        let unit_mm = self.modal.unit.mm();
        let diameter = self.modal.diameter;
        Axis::ALL.into_iter().filter_map(move |axis| {
            let number = block.axis(axis)?;
            let value = if axis.is_rotary() { number } else { number * unit_mm };
            Some((
                axis,
                if diameter && axis == Axis::X {
                    value / 2.0
                } else {
                    value
                },
            ))
        })
    }
}

/// Greatest orientation of a lathe tool's cutting edge.
const ORIENTATION_MAX: i64 = 9;

/// The tool table.
impl State {
    /// G10 L0.
    pub(super) fn reload_tools(&mut self, span: Span, calls: &mut Calls) -> Result<(), Fault> {
        match self.tools.in_spindle {
            0 => calls.push_back(Call::ReloadToolTable),
            tool => return Err((span, SetDataError::ReloadWithTool { tool }.into())),
        }
        Ok(())
    }

    /// G10 L1: the words are the offset. G10 L10, L11: the present point is to read as they say, with the offset of the
    /// tool in effect, in the active system or, `fixture`, in the ninth without G92.
    pub(super) fn set_tool(&mut self, how: SetTool, block: &Block, span: Span, calls: &mut Calls) -> Result<(), Fault> {
        let mut tool = self.tool_to_set(block, span, how)?;
        if !block.has_axes() && !block.has(crate::block::letters(b"RIJQ")) {
            return Err((span, SetDataError::ToolValuesMissing { code: how.name() }.into()));
        }
        match how {
            SetTool::Words => {
                for (axis, value) in self.axis_values(block) {
                    tool.offset[axis] = value;
                }
            }
            SetTool::Place => self.offset_for_place(self.offsets, &mut tool.offset, block),
            SetTool::PlaceInFixture => {
                let mut offsets = self.offsets;
                offsets.system = 9;
                self.load_system(&mut offsets);
                offsets.g92 = Position::ZERO;
                self.offset_for_place(offsets, &mut tool.offset, block);
            }
        }
        if let Some(radius) = block.word_value(b'R') {
            tool.diameter_mm = 2.0 * radius * self.modal.unit.mm();
        }
        if let Some(degrees) = block.word_value(b'I') {
            tool.front_angle_deg = degrees;
        }
        if let Some(degrees) = block.word_value(b'J') {
            tool.back_angle_deg = degrees;
        }
        if let Some(value) = block.word_value(b'Q') {
            let orientation = integer_in(value, 0..=ORIENTATION_MAX);
            tool.orientation =
                orientation.ok_or((block.span(b'Q'), ErrorKind::Orientation { letter: 'Q', value }))? as u8;
        }
        self.tools.table.set(tool.clone()).map_err(|error| {
            (
                letter_of(&error, block).unwrap_or(span),
                SetDataError::ToolNotSet(error).into(),
            )
        })?;
        let line = self.tools.line_of(tool.number);
        let entry = |line| Call::SetToolEntry(tool.entry(line));
        calls.push_back(entry(line.unwrap_or(0)));
        if line == self.tools.line {
            calls.push_back(entry(0));
        }
        Ok(())
    }

    /// The tool that P of G10 names.
    fn tool_to_set(&self, block: &Block, span: Span, how: SetTool) -> Result<Tool, Fault> {
        let missing = || (span, SetDataError::ToolToSetMissing { code: how.name() }.into());
        let number = block.word_value(b'P').ok_or_else(missing)?.round();
        if number < 1.0 {
            return Err(block.span(b'P').fault(SetDataError::ToolToSetRange {
                code: how.name(),
                number,
            }));
        }
        self.entry_of(number).map_err(|kind| block.span(b'P').fault(kind))
    }

    /// The offset with which the axes that are named read in `offsets` as the words say.
    fn offset_for_place(&self, offsets: Offsets, offset: &mut Position, block: &Block) {
        let without_tool = Offsets {
            tool: Position::ZERO,
            ..offsets
        };
        let at = without_tool.work(self.machine());
        let rotated = block.axis(Axis::X).is_some() || block.axis(Axis::Y).is_some();
        let degrees = if rotated { offsets.rotation_degrees } else { 0.0 };
        *offset = turned(*offset, -degrees);
        for (axis, value) in self.axis_values(block) {
            offset[axis] = at[axis] - value;
        }
        *offset = turned(*offset, degrees);
    }
}

/// Which numbers G10 puts into the tool table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SetTool {
    /// L1
    Words,
    /// L10
    Place,
    /// L11
    PlaceInFixture,
}

impl SetTool {
    fn name(self) -> &'static str {
        match self {
            SetTool::Words => "G10 L1",
            SetTool::Place => "G10 L10",
            SetTool::PlaceInFixture => "G10 L11",
        }
    }
}

/// Where the word stands with which the table does not agree.
fn letter_of(error: &SetToolError, block: &Block) -> Option<Span> {
    match error {
        SetToolError::OutOfRange { letter } => {
            let letter = if *letter == 'D' { b'R' } else { *letter as u8 };
            block.word_value(letter).map(|_| block.span(letter))
        }
        SetToolError::Full | SetToolError::PocketTaken { .. } => None,
    }
}
