//! Where work coordinates lie: G10 L2 L20, G52, G54 to G59.3, G92; stored points: G28, G30.

use super::Calls;
use crate::block::Block;
use crate::code::{NonModal, StoredPoint};
use crate::error::ErrorKind;
use crate::parameter::{self, G28_POINT, G30_POINT, G92_ACTIVE, G92_OFFSET};
use crate::scan::Fault;
use crate::state::{Offsets, State};
use motion::canon::{Axis, Call, Position};

impl State {
    pub(super) fn g5x_call(&self) -> Call {
        Call::SetG5xOffset {
            system: self.offsets.system,
            origin: self.offsets.g5x,
        }
    }

    pub(super) fn g92_call(&self) -> Call {
        Call::SetG92Offset {
            offset: self.offsets.g92,
        }
    }

    pub(super) fn rotation_call(&self) -> Call {
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
        let mut offsets = self.offsets;
        offsets.system = code.value;
        self.load_system(&mut offsets);
        self.set_offsets(offsets);
        self.parameters.set(parameter::SYSTEM, f64::from(code.value));
        calls.extend([self.g5x_call(), self.g92_call(), self.rotation_call()]);
    }

    pub(super) fn non_modal(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.non_modal else {
            return Ok(());
        };
        match code.value {
            NonModal::Dwell | NonModal::MachineCoordinates => Ok(()),
            NonModal::SetData => self.set_data(block, calls),
            NonModal::Return(point) => self.return_to(point, block, calls),
            NonModal::Store(point) => {
                let first = stored_point(point);
                self.parameters
                    .set_position(first, self.machine(), self.settings.machine_unit);
                Ok(())
            }
            NonModal::LocalOffset => {
                let mut offset = self.offsets.g92;
                for axis in Axis::ALL {
                    if let Some(number) = block.axis(axis) {
                        offset[axis] = self.length(axis, number);
                    }
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
    fn set_position(&mut self, block: &Block, span: crate::scan::Span, calls: &mut Calls) -> Result<(), Fault> {
        if !block.has_axes() {
            return Err((span, ErrorKind::AxisMissing { code: "G92".into() }));
        }
        let mut offset = self.offsets.g92;
        for axis in Axis::ALL {
            if let Some(number) = block.axis(axis) {
                let mut value = self.length(axis, number);
                if axis == Axis::X && self.modal.diameter {
                    value /= 2.0;
                }
                offset[axis] += self.at[axis] - value;
            }
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

    fn set_data(&mut self, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        Err((
            block.codes.non_modal.map(|code| code.span).unwrap_or_default(),
            ErrorKind::NotSupported { code: "G10".into() },
        ))
    }

    /// G28, G30: through the programmed point to the stored one; with axis words only the named axes go there.
    fn return_to(&mut self, point: StoredPoint, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let stored = self
            .parameters
            .position(stored_point(point), self.settings.machine_unit);
        self.at = self.end(block)?;
        calls.push_back(Call::StraightTraverse { to: self.at });
        let mut machine = self.machine();
        for axis in Axis::ALL {
            if !block.has_axes() || block.axis(axis).is_some() {
                machine[axis] = stored[axis];
            }
        }
        self.at = self.offsets.work(machine);
        calls.push_back(Call::StraightTraverse { to: self.at });
        Ok(())
    }
}

fn stored_point(point: StoredPoint) -> u32 {
    match point {
        StoredPoint::G28 => G28_POINT,
        StoredPoint::G30 => G30_POINT,
    }
}
