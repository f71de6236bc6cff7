//! Cycles of a lathe along a profile: G70, G71, G72.

use super::{Calls, motion_span};
use crate::block::Block;
use crate::code::Roughing;
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::State;

impl State {
    pub(super) fn finish(&mut self, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        self.not_supported_turning(block)
    }
    pub(super) fn rough(&mut self, _roughing: Roughing, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        self.not_supported_turning(block)
    }
    fn not_supported_turning(&self, block: &Block) -> Result<(), Fault> {
        let code = self.motion_name(block);
        Err((motion_span(block), ErrorKind::NotSupported { code }))
    }
}
