//! Moves in step with the spindle: G33, G33.1, G76.

use super::{Calls, motion_span};
use crate::block::Block;
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::State;

impl State {
    pub(super) fn spindle_synchronised(&mut self, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        self.not_supported_thread(block)
    }
    pub(super) fn rigid_tap(&mut self, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        self.not_supported_thread(block)
    }
    pub(super) fn thread(&mut self, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        self.not_supported_thread(block)
    }
    fn not_supported_thread(&self, block: &Block) -> Result<(), Fault> {
        let code = self.motion_name(block);
        Err((motion_span(block), ErrorKind::NotSupported { code }))
    }
}
