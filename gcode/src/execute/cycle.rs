//! Canned cycles: G73, G74, G81 to G89.

use super::{Calls, motion_span};
use crate::block::Block;
use crate::code::Cycle;
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::State;

impl State {
    pub(super) fn cycle(&mut self, _cycle: Cycle, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        self.not_supported_cycle(block)
    }
    fn not_supported_cycle(&self, block: &Block) -> Result<(), Fault> {
        let code = self.motion_name(block);
        Err((motion_span(block), ErrorKind::NotSupported { code }))
    }
}
/// What the words of a cycle said on the lines before.
#[derive(Clone, Debug, Default)]
pub(crate) struct CycleWords {}
