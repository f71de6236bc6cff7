//! M70 to M73: the modal state saved and restored.

use super::Calls;
use crate::block::Block;
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::State;

impl State {
    pub(super) fn saved_modes(&mut self, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        match block.codes.modal {
            None => Ok(()),
            Some(code) => Err((
                code.span,
                ErrorKind::NotSupported {
                    code: "M70 to M73".into(),
                },
            )),
        }
    }
}
