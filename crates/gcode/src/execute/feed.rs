//! Feed: G93, G94, G95 and F.

use crate::block::Block;
use crate::code::FeedUnit;
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::{Calls, State, minus};
use motion::canon::{Axis, Call, FeedMode, Position};

/// Length along which F counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PathLength {
    /// Of XYZ if one of them moves, else of UVW.
    Mm(f64),
    /// Of ABC: nothing else moves.
    Degrees(f64),
}

impl PathLength {
    /// Of a straight move.
    pub(super) fn straight(from: Position, to: Position) -> PathLength {
        let delta = minus(to, from);
        let length = |axes: [Axis; 3]| {
            let moved = axes.map(|axis| delta[axis]).into_iter();
            moved.filter(|way| way.abs() >= AXIS_MOVES).fold(0.0, libm::hypot)
        };
        let xyz = length([Axis::X, Axis::Y, Axis::Z]);
        if xyz > 0.0 {
            return PathLength::Mm(xyz);
        }
        let uvw = length([Axis::U, Axis::V, Axis::W]);
        let abc = length([Axis::A, Axis::B, Axis::C]);
        if uvw > 0.0 || abc == 0.0 {
            PathLength::Mm(uvw)
        } else {
            PathLength::Degrees(abc)
        }
    }
}

/// A way of an axis below this is none, mm or degrees: LinuxCNC's, and that of the planner. Such a rest of a sum of decimals
/// would have F count along it instead of the degrees that the rotary axes turn.
const AXIS_MOVES: f64 = 1e-8;

/// Rate of a move in G93 that goes nowhere, units per minute: LinuxCNC's, for its feed may not be 0.
const INVERSE_TIME_RATE_OF_NO_WAY: f64 = 0.1;

impl State {
    pub(super) fn feed_unit(&mut self, block: &Block, calls: &mut Calls) {
        let Some(code) = block.codes.feed_unit else { return };
        self.use_feed_unit(code.value, self.named_spindle(block), calls);
    }

    /// Tells what F means from here on; it has to be written again, but for G93, where it is on each line.
    pub(super) fn use_feed_unit(&mut self, unit: FeedUnit, spindle: u8, calls: &mut Calls) {
        let (remark, mode) = match unit {
            FeedUnit::InverseTime => ("interpreter: feed mode set to inverse time", FeedMode::PerTime),
            FeedUnit::UnitsPerMinute => ("interpreter: feed mode set to units per minute", FeedMode::PerTime),
            FeedUnit::UnitsPerTurn => (
                "interpreter: feed mode set to units per revolution",
                FeedMode::PerTurn { spindle },
            ),
        };
        if let FeedMode::PerTurn { spindle } = mode {
            self.spindle = spindle;
        }
        calls.push_back(Call::Comment(remark.into()));
        calls.push_back(Call::SetFeedMode(mode));
        self.modal.feed_unit = unit;
        self.modal.feed_spindle = match unit {
            FeedUnit::UnitsPerTurn => spindle,
            FeedUnit::InverseTime | FeedUnit::UnitsPerMinute => 0,
        };
        if unit != FeedUnit::InverseTime {
            self.feed_cleared |= self.modal.feed > 0.0;
            self.modal.feed = 0.0;
            self.feed_zero_line = None;
            self.push_feed(calls);
        }
    }

    pub(super) fn feed(&mut self, block: &Block, calls: &mut Calls) {
        let Some(number) = block.word_value(b'F') else { return };
        match self.modal.feed_unit {
            FeedUnit::InverseTime => {} // belongs to the move of this line alone
            FeedUnit::UnitsPerMinute | FeedUnit::UnitsPerTurn => {
                self.modal.feed = number;
                self.feed_zero_line = (number == 0.0).then_some(self.source.line);
                self.push_feed(calls);
            }
        }
    }

    pub(crate) fn push_feed(&self, calls: &mut Calls) {
        let [linear, angular] = self.canonical_feed();
        calls.push_back(Call::SetFeedRate { linear, angular });
    }

    /// F as [`Call::SetFeedRate`] tells it: linear and angular.
    pub(crate) fn canonical_feed(&self) -> [f64; 2] {
        let per = match self.modal.feed_unit {
            FeedUnit::UnitsPerTurn => 1.0,
            FeedUnit::UnitsPerMinute | FeedUnit::InverseTime => 60.0,
        };
        [self.modal.feed * self.modal.unit.mm() / per, self.modal.feed / per]
    }

    /// Sees to it that a move has a feed; in G93 tells the one that makes it take the time on its line.
    #[inline]
    pub(super) fn need_feed(
        &self,
        block: &Block,
        length: impl FnOnce() -> PathLength,
        calls: &mut Calls,
    ) -> Result<(), Fault> {
        match self.modal.feed_unit {
            FeedUnit::UnitsPerMinute if self.modal.feed > 0.0 => Ok(()),
            FeedUnit::UnitsPerTurn if self.modal.feed > 0.0 => self.need_turns(block),
            FeedUnit::UnitsPerMinute | FeedUnit::UnitsPerTurn => Err(self.feed_missing(block)),
            FeedUnit::InverseTime => self.inverse_time_feed(block, length(), calls),
        }
    }

    /// Sees to it that the spindle that G95 counts has a speed.
    fn need_turns(&self, block: &Block) -> Result<(), Fault> {
        let spindle = self.named_spindle(block);
        if self.modal.spindles[usize::from(spindle)].speed != 0.0 {
            return Ok(());
        }
        let motion = self.motion_name(block);
        Err((block.motion_span(), ErrorKind::FeedWithoutTurns { motion, spindle }))
    }

    #[cold]
    fn feed_missing(&self, block: &Block) -> Fault {
        let motion = self.motion_name(block);
        let (cleared, zero_line) = (self.feed_cleared, self.feed_zero_line);
        block.motion_span().fault(ErrorKind::FeedMissing {
            motion,
            cleared,
            zero_line,
        })
    }

    fn inverse_time_feed(&self, block: &Block, length: PathLength, calls: &mut Calls) -> Result<(), Fault> {
        let motion = || self.motion_name(block);
        let number = block.word_value(b'F').ok_or_else(|| {
            block
                .motion_span()
                .fault(ErrorKind::InverseTimeFeedMissing { motion: motion() })
        })?;
        let mm = self.modal.unit.mm();
        let units = match length {
            PathLength::Mm(length) => length / mm,
            PathLength::Degrees(length) => length,
        };
        if number == 0.0 {
            return Err(block
                .span(b'F')
                .fault(ErrorKind::InverseTimeFeedZero { motion: motion() }));
        }
        let per_minute = if units == 0.0 {
            INVERSE_TIME_RATE_OF_NO_WAY
        } else {
            number * units
        };
        calls.push_back(Call::SetFeedRate {
            linear: per_minute * mm / 60.0,
            angular: per_minute / 60.0,
        });
        Ok(())
    }

    /// Name of the motion that a line runs.
    pub(super) fn motion_name(&self, block: &Block) -> String {
        let motion = block.codes.motion.map_or(self.modal.motion, |code| code.value);
        motion.map_or_else(|| "a move".into(), |motion| motion.name())
    }

    /// What M2 and M30 do with the feed.
    pub(super) fn end_feed(&mut self, calls: &mut Calls) {
        self.modal.feed_unit = FeedUnit::UnitsPerMinute;
        self.modal.feed_spindle = 0;
        self.modal.feed = 0.0;
        calls.push_back(Call::SetFeedMode(FeedMode::PerTime));
        self.push_feed(calls);
    }
}

#[cfg(test)]
mod tests {
    use crate::{Interpreter, Settings};
    use motion::canon::Call;

    /// Linear and angular feed of the last feed move of a program, units per minute.
    fn feed(program: &str) -> [f64; 2] {
        let (mut feed, mut of_move) = ([0.0; 2], [0.0; 2]);
        for event in Interpreter::new(Settings::default()).run(program.as_bytes()) {
            match event.unwrap().call {
                Call::SetFeedRate { linear, angular } => feed = [linear * 60.0, angular * 60.0],
                Call::StraightFeed { .. } => of_move = feed,
                _ => {}
            }
        }
        of_move
    }

    #[test]
    fn a_rest_of_rounding_is_no_length_for_inverse_time() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * b;
        for (line, per_minute) in [
            ("G1 X0.300000005 C90 F6", 540.0),
            ("G1 X0.3 U0.000000005 C90 F6", 540.0),
            ("G1 X0.300000005 U2 C90 F6", 12.0),
            ("G1 X0.30000002 C90 F6", 1.2e-7),
            ("G1 X0.3 C90 Z-0.0002 F6", 0.0012),
        ] {
            let [linear, angular] = feed(&format!("G93 G0 X0.3\n{line}\nM2\n"));
            assert!(
                near(linear, per_minute) && near(angular, per_minute),
                "{line}: {linear}"
            );
        }
    }
}
