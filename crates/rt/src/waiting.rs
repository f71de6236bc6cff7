//! What a program that stands still waits for.
//!
//! In:  the action under way, the shares of the speed. Out: one word that any thread may read, and sentences for the operator.

use motion::canon::Input;
use motion::element::Action;
use protocol::{Message, WaitingFor, message};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// What a program waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waiting {
    /// M0, or M1 with its switch on: whoever looks after the machine.
    Operator,
    /// M6: the tool changer, or whoever changes the tool by hand.
    ToolChange { tool: u32 },
    /// The spindle has yet to reach its speed.
    SpindleSpeed,
    /// M19: the spindle has yet to come to its angle.
    SpindleOrient,
    /// M66: an input.
    Input { input: Input },
    /// M100 to M199: a program of the user runs.
    UserCommand { number: u8 },
    /// G38.2 to G38.5: the probe.
    Probe,
    /// G4: its time.
    Dwell,
    /// An override at 0 %, or a switch for hold.
    Feed,
    /// More of the plan.
    Queue,
    /// The operator, who has moved the machine away from the path by hand.
    Return,
}

impl Waiting {
    /// Of an action that is not done yet; `None`: it is done at once.
    pub fn of(action: Action) -> Option<Waiting> {
        match action {
            Action::ProgramStop | Action::OptionalStop => Some(Waiting::Operator),
            Action::ChangeTool { tool } => Some(Waiting::ToolChange { tool }),
            Action::AwaitSpindle => Some(Waiting::SpindleSpeed),
            Action::AwaitInput { input, .. } => Some(Waiting::Input { input }),
            Action::AwaitOriented { .. } => Some(Waiting::SpindleOrient),
            Action::UserCode { number, .. } => Some(Waiting::UserCommand { number }),
            Action::SpindleOn { .. }
            | Action::SpindleOff
            | Action::OrientSpindle { .. }
            | Action::TurnSpindle { .. }
            | Action::Mist(_)
            | Action::Flood(_)
            | Action::SelectTool { .. }
            | Action::SetTool { .. }
            | Action::Message { .. }
            | Action::SetDigital { .. }
            | Action::SetAnalog { .. }
            | Action::ProgramEnd
            | Action::TextEnd
            | Action::Modes { .. } => None,
        }
    }

    /// Whether it can be given up without anything being where, or in a state in which, the program does not expect it.
    pub fn can_be_skipped(self) -> bool {
        match self {
            Waiting::Operator | Waiting::Input { .. } | Waiting::Dwell => true,
            Waiting::ToolChange { .. }
            | Waiting::SpindleSpeed
            | Waiting::SpindleOrient
            | Waiting::UserCommand { .. }
            | Waiting::Probe
            | Waiting::Feed
            | Waiting::Queue
            | Waiting::Return => false,
        }
    }

    /// One word for programs.
    pub fn code(self) -> WaitingFor {
        match self {
            Waiting::Operator | Waiting::Return => WaitingFor::Operator,
            Waiting::ToolChange { .. } => WaitingFor::ToolChange,
            Waiting::SpindleSpeed => WaitingFor::SpindleSpeed,
            Waiting::Input { .. } => WaitingFor::Input,
            Waiting::SpindleOrient => WaitingFor::SpindleOrient,
            Waiting::UserCommand { .. } => WaitingFor::UserCommand,
            Waiting::Probe => WaitingFor::Probe,
            Waiting::Dwell => WaitingFor::Dwell,
            Waiting::Feed => WaitingFor::Feed,
            Waiting::Queue => WaitingFor::Queue,
        }
    }

    /// What the operator is told.
    pub fn message(self) -> Message {
        match self {
            Waiting::Operator => message!("waiting.operator", "the program has stopped (M0, M1)"),
            Waiting::ToolChange { tool: 0 } => message!("waiting.tool_out", "take the tool out of the spindle"),
            Waiting::ToolChange { tool } => {
                message!("waiting.tool_in", "put tool {tool} into the spindle", tool = tool)
            }
            Waiting::SpindleSpeed => message!("waiting.spindle_speed", "the spindle comes to its speed"),
            Waiting::Input { input } => {
                message!(
                    "waiting.input",
                    "{input} is to come (M66)",
                    input = input_message(input)
                )
            }
            Waiting::SpindleOrient => message!("waiting.spindle_orient", "the spindle comes to its angle (M19)"),
            Waiting::UserCommand { number } => {
                message!("waiting.user_command", "the command M{number} runs", number = number)
            }
            Waiting::Probe => message!("waiting.probe", "a probing move is under way (G38)"),
            Waiting::Dwell => message!("waiting.dwell", "a dwell is under way (G4)"),
            Waiting::Feed => message!(
                "waiting.feed",
                "feed is held by an override at 0 %, motion.feed-hold or motion.adaptive-feed"
            ),
            Waiting::Queue => message!("waiting.queue", "the plan is behind"),
            Waiting::Return => message!(
                "waiting.return",
                "the machine is away from the path on which the program is held"
            ),
        }
    }

    /// What releases it.
    pub fn release(self) -> Message {
        match self {
            Waiting::Operator => message!("release.operator", "isocnc resume"),
            Waiting::ToolChange { .. } => message!(
                "release.tool_change",
                "isocnc tool-changed, or iocontrol.0.tool-changed"
            ),
            Waiting::SpindleSpeed => message!("release.spindle_speed", "spindle.0.at-speed"),
            Waiting::Input { .. } => message!("release.input", "the input, its time-out, or isocnc skip"),
            Waiting::SpindleOrient => message!("release.spindle_orient", "spindle.0.is-oriented, or its time-out"),
            Waiting::UserCommand { .. } => message!("release.user_command", "its end, or its time limit"),
            Waiting::Probe => message!("release.probe", "the probe, or the end of the move"),
            Waiting::Dwell => message!("release.dwell", "its time, or isocnc skip"),
            Waiting::Feed => message!("release.feed", "the override, or the switch"),
            Waiting::Queue => message!("release.queue", "by itself"),
            Waiting::Return => message!(
                "release.return",
                "isocnc resume returns, Z up first; isocnc resume again goes on"
            ),
        }
    }

    fn bits(self) -> u64 {
        match self {
            Waiting::Operator => 1,
            Waiting::ToolChange { tool } => 2 | u64::from(tool) << 32,
            Waiting::SpindleSpeed => 3,
            Waiting::Feed => 4,
            Waiting::Queue => 5,
            Waiting::Return => 10,
            Waiting::Probe => 11,
            Waiting::Dwell => 12,
            Waiting::SpindleOrient => 8,
            Waiting::UserCommand { number } => 9 | u64::from(number) << 32,
            Waiting::Input {
                input: Input::Digital(index),
            } => 6 | u64::from(index) << 32,
            Waiting::Input {
                input: Input::Analog(index),
            } => 7 | u64::from(index) << 32,
        }
    }

    fn from_bits(bits: u64) -> Option<Waiting> {
        let number = (bits >> 32) as u32;
        match bits & 0xFFFF_FFFF {
            1 => Some(Waiting::Operator),
            2 => Some(Waiting::ToolChange { tool: number }),
            3 => Some(Waiting::SpindleSpeed),
            4 => Some(Waiting::Feed),
            11 => Some(Waiting::Probe),
            12 => Some(Waiting::Dwell),
            5 => Some(Waiting::Queue),
            10 => Some(Waiting::Return),
            8 => Some(Waiting::SpindleOrient),
            9 => Some(Waiting::UserCommand { number: number as u8 }),
            6 => Some(Waiting::Input {
                input: Input::Digital(number as u8),
            }),
            7 => Some(Waiting::Input {
                input: Input::Analog(number as u8),
            }),
            _ => None,
        }
    }
}

/// An input of M66.
pub fn input_message(input: Input) -> Message {
    match input {
        Input::Digital(index) => message!("input.digital", "digital input {index}", index = index),
        Input::Analog(index) => message!("input.analog", "analog input {index}", index = index),
    }
}

/// The latest of it, for any thread.
#[derive(Debug, Default)]
pub struct WaitingCell(AtomicU64);

impl WaitingCell {
    /// RT.
    pub fn set(&self, waiting: Option<Waiting>) {
        self.0.store(waiting.map_or(0, Waiting::bits), Relaxed);
    }

    /// The latest.
    pub fn get(&self) -> Option<Waiting> {
        Waiting::from_bits(self.0.load(Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_wait_comes_through_the_cell_and_says_what_ends_it() {
        let cell = WaitingCell::default();
        assert_eq!(cell.get(), None);
        let all = [
            Waiting::Operator,
            Waiting::Probe,
            Waiting::ToolChange { tool: u32::MAX },
            Waiting::SpindleSpeed,
            Waiting::Feed,
            Waiting::Queue,
            Waiting::Return,
            Waiting::SpindleOrient,
            Waiting::UserCommand { number: 199 },
            Waiting::Input {
                input: Input::Digital(63),
            },
            Waiting::Input {
                input: Input::Analog(15),
            },
        ];
        for waiting in all {
            cell.set(Some(waiting));
            assert_eq!(cell.get(), Some(waiting));
            assert!(!waiting.message().text.is_empty() && !waiting.release().text.is_empty());
        }
        cell.set(None);
        assert_eq!(cell.get(), None);
    }
}
