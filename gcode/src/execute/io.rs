//! Switches: coolant, overrides (M48 to M53), inputs and outputs (M62 to M68), codes of the user (M100 to M199).

use super::Calls;
use crate::block::Block;
use crate::code::{Coolant, Override};
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::State;
use motion::canon::Call;

impl State {
    pub(super) fn coolant(&mut self, block: &Block, calls: &mut Calls) {
        let Some(code) = block.codes.coolant else { return };
        match code.value {
            Coolant::Mist => {
                self.modal.mist = true;
                calls.push_back(Call::Mist(true));
            }
            Coolant::Flood => {
                self.modal.flood = true;
                calls.push_back(Call::Flood(true));
            }
            Coolant::Off => {
                self.modal.mist = false;
                self.modal.flood = false;
                calls.extend([Call::Mist(false), Call::Flood(false)]);
            }
        }
    }

    pub(super) fn overrides(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.overrides else {
            return Ok(());
        };
        // P0 switches off, any other P and none on.
        let on = block.word_value(b'P').is_none_or(|number| number != 0.0);
        match code.value {
            Override::Both(on) => {
                self.modal.overrides.feed = on;
                self.modal.overrides.speed[0] = on;
                calls.extend([
                    Call::EnableFeedOverride(on),
                    Call::EnableSpeedOverride { spindle: 0, on },
                ]);
            }
            Override::Feed => {
                self.modal.overrides.feed = on;
                calls.push_back(Call::EnableFeedOverride(on));
            }
            Override::Speed => {
                let spindle = self.named_spindle(block);
                self.modal.overrides.speed[usize::from(spindle)] = on;
                calls.push_back(Call::EnableSpeedOverride { spindle, on });
            }
            Override::Adaptive => {
                self.modal.overrides.adaptive = on;
                calls.push_back(Call::EnableAdaptiveFeed(on));
            }
            Override::Hold => {
                self.modal.overrides.hold = on;
                calls.push_back(Call::EnableFeedHold(on));
            }
        }
        Ok(())
    }

    pub(super) fn inputs_and_outputs(&mut self, block: &Block, _calls: &mut Calls) -> Result<(), Fault> {
        match block.codes.input_output {
            None => Ok(()),
            Some(code) => Err((
                code.span,
                ErrorKind::NotSupported {
                    code: "M62 to M68".into(),
                },
            )),
        }
    }

    pub(super) fn user_code(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.user else { return Ok(()) };
        let known = self.settings.user_codes.as_ref();
        if known.is_some_and(|known| !known.contains(&code.value)) {
            return Err((code.span, ErrorKind::NoSuchUserCode { number: code.value }));
        }
        calls.push_back(Call::UserCode {
            number: code.value,
            p: block.word_value(b'P').unwrap_or(-1.0),
            q: block.word_value(b'Q').unwrap_or(-1.0),
        });
        Ok(())
    }

    /// What M2 and M30 do with overrides.
    pub(super) fn end_overrides(&mut self, calls: &mut Calls) {
        if !self.modal.overrides.feed {
            self.modal.overrides.feed = true;
            calls.push_back(Call::EnableFeedOverride(true));
        }
    }

    /// What M2 and M30 do with coolant.
    pub(super) fn end_coolant(&mut self, calls: &mut Calls) {
        if self.modal.mist {
            self.modal.mist = false;
            calls.push_back(Call::Mist(false));
        }
        if self.modal.flood {
            self.modal.flood = false;
            calls.push_back(Call::Flood(false));
        }
    }
}
