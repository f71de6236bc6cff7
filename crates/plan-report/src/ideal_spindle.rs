//! A spindle that does what it is told, for plans that are run down without a machine.
//!
//! In:  actions and samples of the interpolation, cycle by cycle. Out: its place, and the share of the feed that goes by it.

use motion::canon::{Axis, SpindleDirection};
use motion::element::{Action, Surface};
use motion::rt::{Sample, SpindleFeedback};

/// From rest to any speed, s: reversed for the way back of a tap it is to run down as a real one.
const RAMP_S: f64 = 0.1;

/// The spindle and what it was told.
#[derive(Clone, Copy, Debug)]
pub(super) struct IdealSpindle {
    cycle_s: f64,
    rpm_max: f64,
    told: Option<(f64, SpindleDirection, Option<Surface>)>,
    turns: f64,
    turns_s: f64,
    /// The operator's, on the programmed speed.
    factor: f64,
}

impl IdealSpindle {
    /// At rest.
    pub(super) fn new(cycle_s: f64, rpm_max: f64) -> IdealSpindle {
        IdealSpindle {
            cycle_s,
            rpm_max,
            told: None,
            turns: 0.0,
            turns_s: 0.0,
            factor: 1.0,
        }
    }

    /// From now on so much of the programmed speed.
    pub(super) fn set_override(&mut self, factor: f64) {
        self.factor = factor;
    }

    /// Where it is.
    pub(super) fn place(&self) -> SpindleFeedback {
        SpindleFeedback {
            turns: self.turns,
            indexed: true,
        }
    }

    /// Speed as a share of that for which feed by turns is planned.
    pub(super) fn feed_share(&self) -> f64 {
        let most = self.told.map_or(0.0, |(rpm, ..)| rpm / 60.0);
        if most > 0.0 {
            (self.turns_s.abs() / most).min(1.0)
        } else {
            0.0
        }
    }

    /// Does what stands between two moves; whether the plan goes on.
    pub(super) fn act(&mut self, action: Action, x_mm: f64) -> bool {
        match action {
            Action::SpindleOn {
                rpm,
                direction,
                surface,
            } => {
                self.told = Some((rpm, direction, surface));
                true
            }
            Action::SpindleOff | Action::OrientSpindle { .. } | Action::ProgramEnd => {
                self.told = None;
                true
            }
            Action::AwaitSpindle => (self.turns_s - self.wanted(x_mm, None)).abs() < 1e-9,
            Action::Mist(_)
            | Action::Flood(_)
            | Action::SelectTool { .. }
            | Action::ChangeTool { .. }
            | Action::SetTool { .. }
            | Action::Message { .. }
            | Action::SetDigital { .. }
            | Action::SetAnalog { .. }
            | Action::AwaitInput { .. }
            | Action::AwaitOriented { .. }
            | Action::TurnSpindle { .. }
            | Action::UserCode { .. }
            | Action::TextEnd
            | Action::Modes { .. }
            | Action::ProgramStop
            | Action::OptionalStop => true,
        }
    }

    /// One cycle further.
    pub(super) fn step(&mut self, sample: &Sample) {
        let wanted = self.wanted(sample.position[Axis::X], sample.reversal);
        let step = self.rpm_max / 60.0 * self.cycle_s / RAMP_S;
        let before = self.turns_s;
        self.turns_s += (wanted - before).clamp(-step, step);
        self.turns += (before + self.turns_s) / 2.0 * self.cycle_s;
    }

    /// Whether it turns as it is to: then it goes on so.
    pub(super) fn keeps(&self, sample: &Sample) -> bool {
        self.turns_s == self.wanted(sample.position[Axis::X], sample.reversal)
    }

    /// So many cycles further, at its speed.
    pub(super) fn skip(&mut self, cycles: u64) {
        self.turns += self.turns_s * cycles as f64 * self.cycle_s;
    }

    /// Turns/s, above 0 with M3.
    fn wanted(&self, x_mm: f64, reversal: Option<f64>) -> f64 {
        let Some((rpm, direction, surface)) = self.told else {
            return 0.0;
        };
        let at_surface = surface.map_or(f64::INFINITY, |surface| surface.rpm(x_mm));
        let turns_s = (rpm.min(at_surface) * self.factor).min(self.rpm_max) / 60.0;
        let turns_s = match direction {
            SpindleDirection::Clockwise => turns_s,
            SpindleDirection::Counterclockwise => -turns_s,
        };
        reversal.map_or(turns_s, |scale| -turns_s * scale)
    }
}
