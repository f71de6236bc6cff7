//! Probing: G38.2 to G38.5.

use super::{Calls, motion_span};
use crate::block::Block;
use crate::error::ErrorKind;
use crate::machine::Probed;
use crate::scan::Fault;
use crate::state::State;
use motion::canon::ProbeMode;

impl State {
    pub(super) fn probe(&mut self, _mode: ProbeMode, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        self.not_supported_probe(block)
    }

    /// Takes over how a probing move ended.
    pub(super) fn probed(&mut self, _probed: Probed) -> Result<(), ErrorKind> {
        Ok(())
    }

    fn not_supported_probe(&self, block: &Block) -> Result<(), Fault> {
        let code = self.motion_name(block);
        Err((motion_span(block), ErrorKind::NotSupported { code }))
    }
}
