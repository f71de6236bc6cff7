//! Where work coordinates lie: G10 L2 L20, G52, G54 to G59.3, G92; stored points: G28, G30.

use super::straight::turned_to;
use super::tool::SetTool;
use crate::block::Block;
use crate::code::{NonModal, StoredPoint, integer_in};
use crate::error::{ErrorKind, SetDataError};
use crate::parameter::{self, G28_POINT, G30_POINT, G92_ACTIVE, G92_OFFSET};
use crate::scan::{Fault, Span};
use crate::state::{Calls, Offsets, State, minus};
use motion::canon::{Axis, Call, Position};

impl State {
    pub(crate) fn g5x_call(&self) -> Call {
        Call::SetG5xOffset {
            system: self.offsets.system,
            origin: self.offsets.g5x,
        }
    }

    pub(crate) fn g92_call(&self) -> Call {
        Call::SetG92Offset {
            offset: self.offsets.g92,
        }
    }

    pub(crate) fn rotation_call(&self) -> Call {
        Call::SetXyRotation {
            degrees: self.offsets.rotation_degrees,
        }
    }

    /// Takes origin and rotation of `offsets.system` from the parameters.
    pub(super) fn load_system(&self, offsets: &mut Offsets) {
        let unit = self.settings.machine_unit;
        offsets.g5x = self.parameters.position(parameter::system_origin(offsets.system), unit);
        offsets.rotation_degrees = self.parameters.get(parameter::system_rotation(offsets.system));
    }

    pub(super) fn system(&mut self, block: &Block, calls: &mut Calls) {
        let Some(code) = block.codes.system else { return };
        if code.value == self.offsets.system {
            let remark = "interpreter: continuing to use same coordinate system";
            calls.push_back(Call::Comment(remark.into()));
            return;
        }
        self.use_system(code.value, calls);
    }

    /// Makes a work system the active one.
    pub(super) fn use_system(&mut self, system: u8, calls: &mut Calls) {
        let mut offsets = Offsets { system, ..self.offsets };
        self.load_system(&mut offsets);
        self.set_offsets(offsets);
        calls.extend([self.g5x_call(), self.g92_call(), self.rotation_call()]);
    }

    pub(super) fn non_modal(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.non_modal else {
            return Ok(());
        };
        match code.value {
            NonModal::Dwell | NonModal::MachineCoordinates => Ok(()),
            NonModal::SetData => self.set_data(block, code.span, calls),
            NonModal::Return(point) => self.return_to(point, block, calls),
            NonModal::Store(point) => {
                let first = stored_point(point);
                self.parameters
                    .set_position(first, self.machine(), self.settings.machine_unit);
                Ok(())
            }
            NonModal::LocalOffset => {
                if !block.has_axes() {
                    return Err((code.span, ErrorKind::AxisMissing { code: "G52".into() }));
                }
                let mut offset = self.offsets.g92;
                for (axis, value) in self.axis_values(block) {
                    offset[axis] = value;
                }
                self.set_g92(offset, true, calls);
                Ok(())
            }
            NonModal::SetPosition => self.set_position(block, code.span, calls),
            NonModal::ClearPosition => {
                self.set_g92(Position::ZERO, false, calls);
                Ok(())
            }
            NonModal::SuspendPosition => {
                let mut offsets = self.offsets;
                offsets.g92 = Position::ZERO;
                self.set_offsets(offsets);
                self.parameters.set(G92_ACTIVE, 0.0);
                calls.push_back(self.g92_call());
                Ok(())
            }
            NonModal::RestorePosition => {
                let offset = self.parameters.position(G92_OFFSET, self.settings.machine_unit);
                self.set_g92(offset, true, calls);
                Ok(())
            }
        }
    }

    /// G92: the present point reads as the words say.
    fn set_position(&mut self, block: &Block, span: Span, calls: &mut Calls) -> Result<(), Fault> {
        if !block.has_axes() {
            return Err((span, ErrorKind::AxisMissing { code: "G92".into() }));
        }
        let mut offset = self.offsets.g92;
        for (axis, value) in self.axis_values(block) {
            offset[axis] += self.at[axis] - value;
        }
        self.set_g92(offset, true, calls);
        Ok(())
    }

    /// Puts an offset of G92 in force and keeps it.
    fn set_g92(&mut self, offset: Position, active: bool, calls: &mut Calls) {
        let mut offsets = self.offsets;
        offsets.g92 = offset;
        self.set_offsets(offsets);
        self.parameters
            .set_position(G92_OFFSET, offset, self.settings.machine_unit);
        self.parameters.set(G92_ACTIVE, f64::from(active));
        calls.push_back(self.g92_call());
    }

    /// G10: what is set, L tells.
    fn set_data(&mut self, block: &Block, span: Span, calls: &mut Calls) -> Result<(), Fault> {
        let value = block.word_value(b'L').ok_or((span, SetDataError::UseMissing.into()))?;
        match integer_in(value, 0..=20) {
            Some(0) => self.reload_tools(span, calls),
            Some(1) => self.set_tool(SetTool::Words, block, span, calls),
            Some(10) => self.set_tool(SetTool::Place, block, span, calls),
            Some(11) => self.set_tool(SetTool::PlaceInFixture, block, span, calls),
            Some(2) => self.set_system(SetSystem::Words, block, span, calls),
            Some(20) => self.set_system(SetSystem::Place, block, span, calls),
            Some(_) | None => Err((block.span(b'L'), SetDataError::Use { value }.into())),
        }
    }

    /// G10 L2: the words are the origin. G10 L20: the present point is to read as they say.
    fn set_system(&mut self, how: SetSystem, block: &Block, span: Span, calls: &mut Calls) -> Result<(), Fault> {
        let code = how.name();
        let value = block
            .word_value(b'P')
            .ok_or((span, SetDataError::SystemMissing { code }.into()))?;
        let system = match value.trunc() {
            whole if !(0.0..=9.0).contains(&whole) || value < 0.0 => {
                return Err((block.span(b'P'), SetDataError::System { code, value }.into()));
            }
            0.0 => self.offsets.system,
            whole => whole as u8,
        };
        if let Some(letter) = block.first_of(b"IJ") {
            return Err(block.span(letter).fault(SetDataError::AngleOfSystem {
                code,
                letter: letter.into(),
            }));
        }
        let mut offsets = Offsets { system, ..self.offsets };
        self.load_system(&mut offsets);
        match (how, block.word_value(b'R')) {
            (SetSystem::Place, Some(_)) => {
                return Err((block.span(b'R'), SetDataError::RotationByPlace.into()));
            }
            (SetSystem::Place, None) => self.origin_for_place(&mut offsets, block),
            (SetSystem::Words, degrees) => {
                for (axis, value) in self.axis_values(block) {
                    offsets.g5x[axis] = value;
                }
                offsets.rotation_degrees = degrees.unwrap_or(offsets.rotation_degrees);
            }
        }
        let unit = self.settings.machine_unit;
        self.parameters
            .set_position(parameter::system_origin(system), offsets.g5x, unit);
        self.parameters
            .set(parameter::system_rotation(system), offsets.rotation_degrees);
        if system == self.offsets.system {
            self.set_offsets(offsets);
            calls.extend([self.g5x_call(), self.rotation_call()]);
        } else {
            calls.push_back(Call::Comment("interpreter: setting coordinate system origin".into()));
        }
        Ok(())
    }

    /// Moves the origin so that the named axes read as the words say.
    fn origin_for_place(&self, offsets: &mut Offsets, block: &Block) {
        let machine = self.machine();
        let mut reads = offsets.work(machine);
        for (axis, value) in self.axis_values(block) {
            reads[axis] = value;
        }
        let shift = minus(machine, offsets.machine(reads));
        let coupled =
            offsets.rotation_degrees != 0.0 && (block.axis(Axis::X).is_some() || block.axis(Axis::Y).is_some());
        for axis in Axis::ALL {
            if block.axis(axis).is_some() || (coupled && matches!(axis, Axis::X | Axis::Y)) {
                offsets.g5x[axis] += shift[axis];
            }
        }
    }

    /// G28, G30: through the programmed point to the stored one; with axis words only the named axes go there.
    fn return_to(&mut self, point: StoredPoint, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let stored = self
            .parameters
            .position(stored_point(point), self.settings.machine_unit);
        self.at = self.end(block)?;
        calls.push_back(Call::StraightTraverse { to: self.at });
        let stored = self.offsets.work(stored);
        for axis in Axis::ALL {
            if !block.has_axes() || block.axis(axis).is_some() {
                self.at[axis] = if self.settings.wrapped_rotary[axis as usize] {
                    turned_to(self.at[axis], stored[axis], false)
                } else {
                    stored[axis]
                };
            }
        }
        calls.push_back(Call::StraightTraverse { to: self.at });
        Ok(())
    }
}

/// Where the numbers of G10 for a work system come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SetSystem {
    /// L2: from the words.
    Words,
    /// L20: from the place of the axes.
    Place,
}

impl SetSystem {
    fn name(self) -> &'static str {
        match self {
            SetSystem::Words => "G10 L2",
            SetSystem::Place => "G10 L20",
        }
    }
}

fn stored_point(point: StoredPoint) -> u32 {
    match point {
        StoredPoint::G28 => G28_POINT,
        StoredPoint::G30 => G30_POINT,
    }
}
