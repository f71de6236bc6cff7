//! Calls that share a line with the one behind them: G96 and its S, M19 and its Q, both halves of M9.
//!
//! In:  a call that waits ([`Waiting`]), and the next one.
//! Out: one line if they belong together, otherwise the line of the first alone.

use super::{FlatWriter, Unwritable, Waiting};
use motion::canon::Call;

impl FlatWriter {
    /// Writes what waits, together with `call` if they belong together, which is the answer.
    pub(super) fn write_waiting(&mut self, call: &Call) -> Result<bool, Unwritable> {
        let Some(waiting) = self.waiting.take() else {
            return Ok(false);
        };
        match (waiting, call) {
            (Waiting::SpindleMode { spindle, mode }, Call::SetSpindleSpeed { spindle: of, speed })
                if spindle == *of =>
            {
                self.spindle_mode(spindle, mode, Some(*speed))?;
                Ok(true)
            }
            (
                Waiting::Orient {
                    spindle,
                    degrees,
                    direction,
                },
                Call::WaitSpindleOriented { spindle: of, timeout_s },
            ) if spindle == *of => {
                self.orient(spindle, degrees, direction, Some(*timeout_s))?;
                Ok(true)
            }
            (Waiting::Coolant, Call::Mist(false) | Call::Flood(false)) => {
                (self.mist, self.flood) = (false, false);
                self.plain("M9")?;
                Ok(true)
            }
            (waiting, _) => {
                self.write_alone(waiting)?;
                Ok(false)
            }
        }
    }

    pub(super) fn write_alone(&mut self, waiting: Waiting) -> Result<(), Unwritable> {
        match waiting {
            Waiting::SpindleMode { spindle, mode } => self.spindle_mode(spindle, mode, None),
            Waiting::Orient {
                spindle,
                degrees,
                direction,
            } => self.orient(spindle, degrees, direction, None),
            Waiting::Coolant => {
                self.plain("M9")?;
                self.plain(if self.mist { "M7" } else { "M8" })
            }
        }
    }
}
