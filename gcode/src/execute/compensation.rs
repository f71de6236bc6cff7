//! Cutter radius compensation: G40 to G42.1, and what is forbidden while it is on. Its geometry is in
//! `motion::compensation`.

use super::Calls;
use crate::block::Block;
use crate::code::{Compensation, Motion};
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::State;
use motion::canon::Call;

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
        match code.value {
            Compensation::Off => {
                let remark = "interpreter: cutter radius compensation off";
                calls.push_back(Call::Comment(remark.into()));
                Ok(())
            }
            Compensation::Tool(_) | Compensation::Dynamic(_) => Err((
                code.span,
                ErrorKind::NotSupported {
                    code: "G41, G42".into(),
                },
            )),
        }
    }
}
