//! Spindles: G96, G97, S, M3, M4, M5, M19.

use crate::block::{Block, letters};
use crate::code::{SpindleAction, SpindleCode, integer_in};
use crate::error::ErrorKind;
use crate::scan::{Fault, Span};
use crate::state::{Calls, Modal, State};
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

    /// The spindle that `$` names, 0 without it.
    pub(super) fn one_spindle(&self, block: &Block) -> Result<u8, Fault> {
        let spindles = self.named_spindles(block, false)?;
        match block.word_value(b'$') {
            Some(number) if number < 0.0 => Err((block.span(b'$'), ErrorKind::SpindleOfAll { number })),
            Some(_) | None => Ok(spindles.start),
        }
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
                if !block.has(letters(b"S")) {
                    return Err((code.span, ErrorKind::SurfaceSpeedMissing));
                }
                SpindleMode::ConstantSurfaceSpeed {
                    // LinuxCNC takes no notice of its sign.
                    max_rpm: block.word_value(b'D').map(f64::abs),
                }
            }
        };
        let spindle = self.one_spindle(block)?;
        self.spindle = spindle;
        self.modal.spindles[usize::from(spindle)].mode = mode;
        calls.push_back(Call::SetSpindleMode { spindle, mode });
        Ok(())
    }

    /// Speed of a spindle as calls tell it.
    pub(crate) fn spindle_speed_told(&self, spindle: u8) -> f64 {
        let spindle = &self.modal.spindles[usize::from(spindle)];
        match (spindle.mode, self.modal.unit) {
            (SpindleMode::Rpm, _) | (SpindleMode::ConstantSurfaceSpeed { .. }, LengthUnit::Millimetre) => spindle.speed,
            (SpindleMode::ConstantSurfaceSpeed { .. }, LengthUnit::Inch) => spindle.speed * FOOT_M,
        }
    }

    pub(super) fn spindle_speed(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(number) = block.word_value(b'S') else {
            return Ok(());
        };
        for spindle in self.named_spindles(block, false)? {
            if spindle == 0 && number > 0.0 {
                let told = &self.modal.spindles[0];
                let (turns, differs) = (told.turning.is_some(), told.speed != number);
                self.doubts.speed(self.source, turns, differs);
            }
            self.use_speed(spindle, number, calls);
        }
        Ok(())
    }

    fn use_speed(&mut self, spindle: u8, number: f64, calls: &mut Calls) {
        self.modal.spindles[usize::from(spindle)].speed = number;
        let speed = self.spindle_speed_told(spindle);
        calls.push_back(Call::SetSpindleSpeed { spindle, speed });
    }

    /// Brings back what S means, as far as it differs.
    pub(super) fn restore_spindle_modes(&mut self, saved: &Modal, calls: &mut Calls) {
        for (spindle, (own, saved)) in (0..).zip(self.modal.spindles.iter_mut().zip(&saved.spindles)) {
            if own.mode != saved.mode {
                own.mode = saved.mode;
                let mode = saved.mode;
                calls.push_back(Call::SetSpindleMode { spindle, mode });
            }
        }
    }

    /// Brings back speeds and turning, as far as they differ.
    pub(super) fn restore_spindles(&mut self, saved: &Modal, was: &Modal, calls: &mut Calls) {
        for (spindle, (saved, was)) in (0..).zip(saved.spindles.iter().zip(&was.spindles)) {
            if (saved.speed, saved.mode) != (was.speed, was.mode) {
                self.use_speed(spindle, saved.speed, calls);
            }
            if saved.turning != was.turning {
                self.modal.spindles[usize::from(spindle)].turning = saved.turning;
                calls.push_back(match saved.turning {
                    Some(direction) => Call::StartSpindle {
                        spindle,
                        direction,
                        wait_for_speed: true,
                    },
                    None => Call::StopSpindle { spindle },
                });
            }
        }
    }

    pub(super) fn spindle_action(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.spindle else {
            return Ok(());
        };
        match code.value {
            SpindleAction::Start(direction) => {
                self.doubts.turn();
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
            SpindleAction::Orient => self.orient(block, code.span, calls)?,
        }
        Ok(())
    }

    fn orient(&mut self, block: &Block, span: Span, calls: &mut Calls) -> Result<(), Fault> {
        let angle = block.word_value(b'R');
        if let Some(degrees) = angle.filter(|degrees| !(0.0..=360.0).contains(degrees)) {
            return Err((block.span(b'R'), ErrorKind::OrientAngle { degrees }));
        }
        let degrees = angle.unwrap_or(0.0) + self.settings.orient_offset_degrees;
        let direction = match block.word_value(b'P').map(|number| integer_in(number, 0..=2)) {
            None | Some(Some(0)) => OrientDirection::Shortest,
            Some(Some(1)) => OrientDirection::Clockwise,
            Some(Some(_)) => OrientDirection::Counterclockwise,
            Some(None) => return Err((block.span(b'P'), ErrorKind::OrientDirection)),
        };
        let timeout_s = block.word_value(b'Q');
        if self.settings.orient_needs_angle && !block.has(letters(b"RPQ")) {
            return Err((span, ErrorKind::OrientNothing));
        }
        for spindle in self.named_spindles(block, false)? {
            self.modal.spindles[usize::from(spindle)].turning = None; // it is held at the angle
            // Q alone only waits.
            if block.has(letters(b"RP")) {
                calls.push_back(Call::OrientSpindle {
                    spindle,
                    degrees,
                    direction,
                });
            }
            match timeout_s {
                Some(timeout_s) if timeout_s > 0.0 => calls.push_back(Call::WaitSpindleOriented { spindle, timeout_s }),
                Some(_) => return Err((block.span(b'Q'), ErrorKind::OrientTimeout)),
                None => {}
            }
        }
        Ok(())
    }

    /// What M2 and M30 do with the spindles.
    pub(super) fn end_spindles(&mut self, calls: &mut Calls) {
        for (number, spindle) in (0..self.settings.spindles).zip(&mut self.modal.spindles) {
            spindle.turning = None;
            spindle.mode = SpindleMode::Rpm;
            calls.push_back(Call::StopSpindle { spindle: number });
            calls.push_back(Call::SetSpindleMode {
                spindle: number,
                mode: SpindleMode::Rpm,
            });
        }
    }
}
