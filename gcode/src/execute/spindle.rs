//! Spindles: G96, G97, S, M3, M4, M5, M19.

use super::Calls;
use crate::block::Block;
use crate::code::{SpindleAction, SpindleCode, integer_in};
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::State;
use motion::canon::{Call, LengthUnit, OrientDirection, SpindleMode};

/// Metres in a foot: S of G96 is metres or feet per minute.
const FOOT_M: f64 = 0.3048;

impl State {
    /// The spindle that `$` names, 0 without it or where it names none.
    pub(super) fn named_spindle(&self, block: &Block) -> u8 {
        block
            .word_value(b'$')
            .and_then(|number| integer_in(number, 0..=7))
            .map_or(0, |number| number as u8)
    }

    /// The spindles that `$` names, all without it.
    fn named_spindles(&self, block: &Block, all: bool) -> Result<std::ops::Range<u8>, Fault> {
        let count = self.settings.spindles;
        match block.word_value(b'$') {
            None if all => Ok(0..count),
            None => Ok(0..1),
            Some(number) => match integer_in(number, -1..=i64::from(count) - 1) {
                Some(-1) => Ok(0..count),
                Some(spindle) => Ok(spindle as u8..spindle as u8 + 1),
                None => {
                    let last = count - 1;
                    Err((block.span(b'$'), ErrorKind::NoSuchSpindle { number, last }))
                }
            },
        }
    }

    pub(super) fn spindle_mode(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.spindle_mode else {
            return Ok(());
        };
        let mode = match code.value {
            SpindleCode::Rpm => SpindleMode::Rpm,
            SpindleCode::ConstantSurfaceSpeed => {
                super::not_negative(block, b'D')?;
                SpindleMode::ConstantSurfaceSpeed {
                    max_rpm: block.word_value(b'D'),
                }
            }
        };
        for spindle in self.named_spindles(block, false)? {
            self.modal.spindles[usize::from(spindle)].mode = mode;
            calls.push_back(Call::SetSpindleMode { spindle, mode });
        }
        Ok(())
    }

    pub(super) fn spindle_speed(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(number) = block.word_value(b'S') else {
            return Ok(());
        };
        for spindle in self.named_spindles(block, false)? {
            self.modal.spindles[usize::from(spindle)].speed = number;
            let speed = match (self.modal.spindles[usize::from(spindle)].mode, self.modal.unit) {
                (SpindleMode::Rpm, _) | (SpindleMode::ConstantSurfaceSpeed { .. }, LengthUnit::Millimetre) => number,
                (SpindleMode::ConstantSurfaceSpeed { .. }, LengthUnit::Inch) => number * FOOT_M,
            };
            calls.push_back(Call::SetSpindleSpeed { spindle, speed });
        }
        Ok(())
    }

    pub(super) fn spindle_action(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.spindle else {
            return Ok(());
        };
        match code.value {
            SpindleAction::Start(direction) => {
                for spindle in self.named_spindles(block, false)? {
                    self.modal.spindles[usize::from(spindle)].turning = Some(direction);
                    calls.push_back(Call::StartSpindle {
                        spindle,
                        direction,
                        wait_for_speed: true,
                    });
                }
            }
            SpindleAction::Stop => {
                for spindle in self.named_spindles(block, false)? {
                    self.modal.spindles[usize::from(spindle)].turning = None;
                    calls.push_back(Call::StopSpindle { spindle });
                }
            }
            SpindleAction::Orient => self.orient(block, calls)?,
        }
        Ok(())
    }

    fn orient(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let degrees = block.word_value(b'R').unwrap_or(0.0) + self.settings.orient_offset_degrees;
        let direction = match block.word_value(b'P').map(|number| integer_in(number, 0..=2)) {
            None | Some(Some(0)) => OrientDirection::Shortest,
            Some(Some(1)) => OrientDirection::Clockwise,
            Some(Some(_)) => OrientDirection::Counterclockwise,
            Some(None) => return Err((block.span(b'P'), ErrorKind::OrientDirection)),
        };
        if block.word_value(b'Q').is_some_and(|timeout_s| timeout_s <= 0.0) {
            return Err((block.span(b'Q'), ErrorKind::OrientTimeout));
        }
        for spindle in self.named_spindles(block, false)? {
            calls.push_back(Call::OrientSpindle {
                spindle,
                degrees,
                direction,
            });
            if let Some(timeout_s) = block.word_value(b'Q') {
                calls.push_back(Call::WaitSpindleOriented { spindle, timeout_s });
            }
        }
        Ok(())
    }

    /// What M2 and M30 do with the spindles.
    pub(super) fn end_spindles(&mut self, calls: &mut Calls) {
        for (number, spindle) in (0..self.settings.spindles).zip(&mut self.modal.spindles) {
            spindle.turning = None;
            spindle.mode = SpindleMode::Rpm;
            if number == 0 {
                calls.push_back(Call::StopSpindle { spindle: number });
                calls.push_back(Call::SetSpindleMode {
                    spindle: number,
                    mode: SpindleMode::Rpm,
                });
            }
        }
    }
}
