//! Cutter radius compensation: G40 to G42.1, and what is forbidden while it is on. Its geometry is in
//! `motion::compensation`.

use super::Calls;
use crate::block::Block;
use crate::code::{Compensation, Motion, integer_in};
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::State;
use motion::canon::{Call, Cutter};

impl State {
    /// Refuses what is forbidden while compensation is on.
    #[inline]
    pub(super) fn check_compensation(&self, _block: &Block, _motion: Option<Motion>) -> Result<(), Fault> {
        Ok(())
    }

    pub(super) fn compensation(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.compensation else {
            return Ok(());
        };
        let (side, diameter_mm, orientation) = match code.value {
            Compensation::Off => {
                let remark = "interpreter: cutter radius compensation off";
                calls.push_back(Call::Comment(remark.into()));
                self.cutter_ended |= self.cutter.take().is_some();
                calls.push_back(Call::SetCutterCompensation(None));
                return Ok(());
            }
            Compensation::Tool(side) => {
                let tool = match block.word_value(b'D') {
                    Some(number) => self.tool_of(number).map_err(|kind| (block.span(b'D'), kind))?,
                    None => self.tool(),
                };
                (side, tool.diameter_mm, tool.orientation)
            }
            Compensation::Dynamic(side) => {
                let missing = || (code.span, ErrorKind::DiameterMissing { code: code.name() });
                let number = block.word_value(b'D').ok_or_else(missing)?;
                let orientation = block.word_value(b'L').unwrap_or(0.0);
                let orientation = integer_in(orientation, 0..=9)
                    .ok_or_else(|| (block.span(b'L'), ErrorKind::Orientation { value: orientation }))?;
                (side, number * self.modal.unit.mm(), orientation as u8)
            }
        };
        let cutter = Cutter {
            side,
            radius_mm: diameter_mm / 2.0,
            orientation,
        };
        self.cutter = Some(cutter);
        self.cutter_dynamic = matches!(code.value, Compensation::Dynamic(_));
        self.cutter_from = self.at;
        calls.push_back(Call::SetCutterCompensation(Some(cutter)));
        Ok(())
    }
}
