//! Splines: G5, G5.1, NURBS: G5.2, G5.3.

use super::{Calls, motion_span};
use crate::block::Block;
use crate::code::Motion;
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::State;

impl State {
    pub(super) fn spline(&mut self, _motion: Motion, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        self.not_supported_spline(block)
    }
    pub(super) fn nurbs(&mut self, _motion: Motion, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        self.not_supported_spline(block)
    }
    fn not_supported_spline(&self, block: &Block) -> Result<(), Fault> {
        let code = self.motion_name(block);
        Err((motion_span(block), ErrorKind::NotSupported { code }))
    }
}
