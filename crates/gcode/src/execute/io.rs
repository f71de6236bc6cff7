//! Switches: coolant, overrides (M48 to M53), inputs and outputs (M62 to M68), codes of the user (M100 to M199).

use crate::block::Block;
use crate::code::{Coolant, InputOutput, Override, integer_in};
use crate::error::ErrorKind;
use crate::scan::{Fault, Span};
use crate::state::{Calls, Modal, Overrides, Question, State};
use motion::canon::{Call, Input, SPINDLES, WaitMode};

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
                calls.push_back(Call::EnableFeedOverride(on));
                for spindle in 0..self.settings.spindles {
                    self.modal.overrides.speed[usize::from(spindle)] = on;
                    calls.push_back(Call::EnableSpeedOverride { spindle, on });
                }
            }
            Override::Feed => {
                self.modal.overrides.feed = on;
                calls.push_back(Call::EnableFeedOverride(on));
            }
            Override::Speed => {
                let spindle = self.one_spindle(block)?;
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

    pub(super) fn inputs_and_outputs(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.input_output else {
            return Ok(());
        };
        let needed = |letter: u8| -> Result<u8, Fault> {
            let missing = || {
                let letter = letter.into();
                (code.span, ErrorKind::OutputMissing { letter })
            };
            self.pin(block, letter)?.ok_or_else(missing)
        };
        match code.value {
            InputOutput::Digital { on, with_motion } => {
                let index = needed(b'P')?;
                calls.push_back(Call::SetDigitalOutput { index, on, with_motion });
            }
            InputOutput::Analog { with_motion } => {
                let index = needed(b'E')?;
                calls.push_back(Call::SetAnalogOutput {
                    index,
                    value: block.word_value(b'Q').unwrap_or(-1.0), // LinuxCNC's value of a Q that is not there
                    with_motion,
                });
            }
            InputOutput::Wait => return self.wait_input(block, code.span, calls),
        }
        Ok(())
    }

    /// M66
    fn wait_input(&mut self, block: &Block, span: Span, calls: &mut Calls) -> Result<(), Fault> {
        let input = match (self.pin(block, b'P')?, self.pin(block, b'E')?) {
            (Some(index), None) => Input::Digital(index),
            (None, Some(index)) => Input::Analog(index),
            (Some(_), Some(_)) => return Err((block.span(b'E'), ErrorKind::TwoInputs)),
            (None, None) => return Err((span, ErrorKind::InputMissing)),
        };
        let value = block.word_value(b'L').unwrap_or(0.0);
        let mode = match integer_in(value, 0..=4) {
            Some(0) => WaitMode::Immediate,
            Some(1) => WaitMode::Rise,
            Some(2) => WaitMode::Fall,
            Some(3) => WaitMode::High,
            Some(4) => WaitMode::Low,
            Some(_) | None => return Err((block.span(b'L'), ErrorKind::WaitMode { value })),
        };
        let timeout_s = block.word_value(b'Q').unwrap_or(0.0);
        if mode != WaitMode::Immediate {
            if let Input::Analog(_) = input {
                return Err((block.span(b'L'), ErrorKind::AnalogWait { value }));
            }
            if timeout_s <= 0.0 {
                return Err((block.span(b'L'), ErrorKind::WaitTime { value }));
            }
        }
        calls.push_back(Call::WaitInput { input, mode, timeout_s });
        self.questions.push(Question::Input { input, mode, timeout_s });
        Ok(())
    }

    /// Number of an input or output, rounded as LinuxCNC does: P names a digital one, E an analog one.
    fn pin(&self, block: &Block, letter: u8) -> Result<Option<u8>, Fault> {
        let Some(value) = block.word_value(letter) else {
            return Ok(None);
        };
        let count = match letter {
            b'E' => self.settings.analog_pins,
            _ => self.settings.digital_pins,
        };
        let max = count.saturating_sub(1).min(u8::MAX.into()) as u8;
        match integer_in(value.round(), 0..=i64::from(max)) {
            Some(index) => Ok(Some(index as u8)),
            None => {
                let letter_of = letter.into();
                Err(block.span(letter).fault(ErrorKind::PinNumber {
                    letter: letter_of,
                    value,
                    max,
                }))
            }
        }
    }

    /// Brings back coolant and overrides as far as they differ.
    pub(super) fn restore_switches(&mut self, saved: &Modal, calls: &mut Calls) {
        match (saved.mist || saved.flood, self.modal.mist || self.modal.flood) {
            (false, true) => calls.extend([Call::Mist(false), Call::Flood(false)]),
            (true, _) => {
                if saved.mist != self.modal.mist {
                    calls.push_back(Call::Mist(saved.mist));
                }
                if saved.flood != self.modal.flood {
                    calls.push_back(Call::Flood(saved.flood));
                }
            }
            (false, false) => {}
        }
        (self.modal.mist, self.modal.flood) = (saved.mist, saved.flood);
        let now = self.modal.overrides;
        self.modal.overrides = saved.overrides;
        let Overrides {
            feed,
            speed,
            adaptive,
            hold,
        } = saved.overrides;
        if feed != now.feed {
            calls.push_back(Call::EnableFeedOverride(feed));
        }
        for (spindle, (on, now)) in (0..).zip(speed.into_iter().zip(now.speed)) {
            if on != now {
                calls.push_back(Call::EnableSpeedOverride { spindle, on });
            }
        }
        if adaptive != now.adaptive {
            calls.push_back(Call::EnableAdaptiveFeed(adaptive));
        }
        if hold != now.hold {
            calls.push_back(Call::EnableFeedHold(hold));
        }
    }

    pub(super) fn user_code(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.user else { return Ok(()) };
        let known = self.settings.user_codes.as_ref();
        if known.is_some_and(|known| !known.contains(&code.value)) {
            return Err((code.span, ErrorKind::NoSuchUserCode { number: code.value }));
        }
        let number = code.value;
        let p = block.word_value(b'P').unwrap_or(-1.0);
        let q = block.word_value(b'Q').unwrap_or(-1.0);
        calls.push_back(Call::UserCode { number, p, q });
        self.questions.push(Question::UserCode { number, p, q });
        Ok(())
    }

    /// What M2 and M30 do with overrides.
    pub(super) fn end_overrides(&mut self, calls: &mut Calls) {
        if !self.modal.overrides.feed {
            self.modal.overrides.feed = true;
            calls.push_back(Call::EnableFeedOverride(true));
        }
        // LinuxCNC tells nobody; the text behind begins with it.
        self.modal.overrides.speed = [true; SPINDLES];
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
