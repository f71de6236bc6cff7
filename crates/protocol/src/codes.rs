//! What fields of answers can say: a code each, with its word for a terminal.
//!
//! In:  how the machine is. Out: what travels, `snake_case`; for people, the word that [`std::fmt::Display`] writes.

use crate::message::Message;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Enums of codes, each with its word for the operator beside it.
macro_rules! codes {
    ($($(#[$about:meta])* $name:ident $group:literal { $($(#[$doc:meta])* $variant:ident = $word:literal,)+ })+) => {$(
        $(#[$about])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum $name {
            $(
                $(#[$doc])*
                // Files of an older control have the word.
                #[serde(alias = $word)]
                $variant,
            )+
        }

        impl $name {
            /// All of them, in their order.
            pub const ALL: [$name; [$($name::$variant),+].len()] = [$($name::$variant),+];

            /// As it travels.
            pub fn code(self) -> String {
                serde_json::to_value(self).ok().and_then(|code| Some(code.as_str()?.to_owned())).unwrap_or_default()
            }

            /// As a part of a sentence: its code is that of the enum, a dot and its own.
            pub fn message(self) -> Message {
                Message::new(&format!("{}.{}", $group, self.code()), self.name(), [])
            }

            /// Word for the operator.
            pub const fn name(self) -> &'static str {
                match self {
                    $($name::$variant => $word,)+
                }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.name())
            }
        }
    )+};
}

codes! {
    /// What the machine is doing. A pin shows the numbers: a new state comes behind the others.
    #[repr(u8)]
    State "state" {
        /// The network is being brought up; no drive can be steered.
        #[default]
        Booting = "booting",
        /// Drives reachable, without power.
        Disabled = "disabled",
        /// Drives are being switched on.
        Enabling = "enabling",
        /// Drives hold their position under command.
        Ready = "ready",
        /// Some joints seek their home point.
        Homing = "homing",
        /// A program moves the machine.
        Running = "running",
        /// A program is held on its path.
        Held = "held",
        /// Coming to rest on the path; the program is given up.
        Stopping = "stopping",
        /// Drives are being switched off.
        Disabling = "disabling",
        /// A fault stopped the machine; waits for an acknowledge.
        Faulted = "faulted",
        /// The network is being brought down.
        ShuttingDown = "shutting down",
        /// Nothing is sent any more.
        Down = "down",
        /// Joints are moved by hand.
        Jogging = "jogging",
        /// Nothing may be sent any more: the cycle thread hung, and what it was about nobody knows. Drives stop by themselves for
        /// want of SoC; the control ends and has to be restarted.
        Silenced = "silenced",
        /// Emergency stop: drives are stopped and without power; waits for a reset once the chain is closed.
        Estop = "estop",
        /// A program is held, and the machine is moved by hand or rests away from its path.
        Away = "away",
        /// On the way back to where the program is held.
        Returning = "returning",
    }

    /// Whether the machine can move.
    Power "power" {
        /// The network is not up.
        #[default]
        Starting = "starting",
        /// Emergency stop, its chain still open.
        EstopOpen = "estop, chain open",
        /// Emergency stop, the chain closed again.
        Estop = "estop",
        /// A fault waits for an acknowledge.
        Alarm = "alarm",
        /// Drives off.
        Off = "off",
        /// Drives go on or off.
        Switching = "switching",
        /// Drives on.
        On = "on",
        /// The control ends.
        Ending = "ending",
    }

    /// What is going on.
    Activity "activity" {
        /// Nothing.
        #[default]
        Idle = "idle",
        /// A program is read and checked.
        Checking = "checking",
        /// Joints home.
        Homing = "homing",
        /// Something is moved by hand.
        Jogging = "jogging",
        /// A program or a line of MDI runs, or waits for something.
        Running = "running",
        /// It rests on its path.
        Held = "held",
        /// It is held, and the machine was moved away from its path by hand.
        Away = "away",
        /// The machine returns to where it is held.
        Returning = "returning",
        /// It comes to rest and is given up.
        Stopping = "stopping",
    }

    /// Whose orders the machine follows, or followed last.
    Mode "mode" {
        /// Those given by hand.
        #[default]
        Manual = "manual",
        /// Typed lines.
        Mdi = "mdi",
        /// Those of a program.
        Auto = "auto",
    }

    /// Step of the sequence from power-on to power-off.
    Step "step" {
        /// The machine starts, without a network.
        #[default]
        Start = "start",
        /// Network up to OPERATIONAL.
        NetworkBoot = "network boot",
        /// Waits for orders, drives off or on; for the network, or for an acknowledge.
        StandingBy = "standing by",
        /// Drives to OPERATION ENABLED.
        SwitchingOn = "switching drives on",
        /// Joints home, one group after the other.
        Homing = "homing",
        /// A program or a line of MDI.
        Program = "program",
        /// To rest on the path.
        Stop = "stop",
        /// Drives without power.
        SwitchingOff = "switching drives off",
        /// The network goes down.
        NetworkShutDown = "network shut-down",
        /// The machine ends, without a network.
        ShutDown = "shut-down",
        /// All is over.
        Done = "done",
    }

    /// How a program, or an order that takes time, ended.
    Outcome "outcome" {
        /// It came to its end.
        #[default]
        Completed = "completed",
        /// Someone stopped it.
        Stopped = "stopped",
        /// A fault stopped it.
        Faulted = "faulted",
        /// A step took longer than its limit.
        TimedOut = "timed out",
    }

    /// What became of the program that was loaded or begun last.
    LastResult "last_result" {
        /// It was loaded, and not begun.
        #[default]
        Loaded = "loaded",
        /// It came to its end.
        Completed = "completed",
        /// Someone stopped it.
        Stopped = "stopped",
        /// A fault stopped it.
        Faulted = "faulted",
        /// A step took longer than its limit.
        TimedOut = "timed out",
        /// The control ended in its midst.
        Interrupted = "interrupted",
    }

    /// What a machine that waits waits for.
    WaitingFor "waiting_for" {
        /// Whoever looks after it.
        #[default]
        Operator = "operator",
        /// The tool changer, or whoever changes the tool by hand.
        ToolChange = "tool-change",
        /// The spindle has yet to reach its speed.
        SpindleSpeed = "spindle-speed",
        /// An input (M66).
        Input = "input",
        /// The spindle has yet to come to its angle (M19).
        SpindleOrient = "spindle-orient",
        /// A program of the user (M100 to M199).
        UserCommand = "user-command",
        /// The probe (G38).
        Probe = "probe",
        /// Time (G4).
        Dwell = "dwell",
        /// An override at 0 %, or a switch for hold.
        Feed = "feed",
        /// More of the plan.
        Queue = "queue",
    }

    /// What the machine does about a fault, the mildest first.
    Reaction "reaction" {
        /// Counts it and goes on.
        #[default]
        Count = "counted",
        /// Tells the operator and goes on.
        Warn = "goes on",
        /// Stops all joints together within the stop limits, then quick stop of the drives; alarm, nothing moves again
        /// before it is acknowledged.
        ControlledStop = "controlled stop",
        /// Quick stop of the drives at once, from the last good set-points: there is no path on which to stop; alarm, as above.
        QuickStop = "quick stop of the drives",
        /// Quick stop of the drives at once, spindle and coolant off; nothing moves again before the chain is closed and the stop is
        /// reset. Beats every other state.
        EmergencyStop = "emergency stop",
        /// Nothing can be steered any more: no cycle is sent, the drives stop by themselves for want of it; alarm.
        Silence = "no cycle is sent any more",
    }

    /// How grave a fault is, by what the machine does about it.
    Severity "severity" {
        /// It is counted.
        #[default]
        Info = "info",
        /// The machine goes on.
        Warning = "warning",
        /// Controlled stop.
        Stop = "stop",
        /// Quick stop of the drives.
        QuickStop = "quick stop",
        /// Emergency stop.
        EmergencyStop = "emergency stop",
        /// No cycle is sent any more.
        Silenced = "silenced",
    }

    /// The next step of the operator. Its word is what to type, if a command does it.
    Next "next" {
        /// Switch drives on.
        #[default]
        PowerOn = "isocnc on",
        /// Switch drives off.
        PowerOff = "isocnc off switches drives off",
        /// Home all joints.
        Home = "isocnc home",
        /// Reset the emergency stop.
        ResetEstop = "isocnc estop reset",
        /// Close the chain of the emergency stop, then reset it.
        CloseChain = "release the button that opened it, then isocnc estop reset",
        /// Acknowledge the alarm.
        Acknowledge = "isocnc alarm acknowledge",
        /// Jog the joint off its limit switch.
        JogOffSwitch = "jog away from it; isocnc status names the joint",
        /// Load a program.
        LoadProgram = "isocnc program load FILE",
        /// Start the program that is loaded, or another one.
        StartProgram = "isocnc program start, or isocnc program run FILE",
        /// Start the program again.
        StartAgain = "start it again",
        /// Hold the program, then jog.
        HoldThenJog = "isocnc hold, then jog",
        /// Resume the program: only waits can be skipped.
        Resume = "isocnc resume; isocnc skip leaves out waits only",
        /// Resume the program, or give it up.
        ResumeOrStop = "isocnc resume, or isocnc stop",
        /// Return to the path.
        Return = "isocnc resume returns to it",
        /// Return to the path, or give the program up.
        ReturnOrStop = "isocnc resume returns to it, isocnc stop gives it up",
        /// Wait, or stop what is under way.
        WaitOrStop = "wait, or isocnc stop",
        /// Wait, or hold what is under way.
        WaitOrHold = "wait, or isocnc hold",
        /// Wait.
        Wait = "wait until that is over",
        /// Wait until the machine has come to rest.
        WaitForRest = "wait until it has",
        /// Let what is moved by hand come to rest.
        LetRest = "let it come to rest",
        /// Look how the network is.
        BusState = "isocnc bus state",
        /// Look how the machine is.
        Status = "isocnc status tells how the machine is",
        /// There is nothing to do.
        Nothing = "nothing has to be reset",
        /// Start the control again.
        RunControl = "start it again with isocnc run",
        /// Start the control again, without a program.
        RunWithoutProgram = "start it without a program to give it other orders",
    }
}

impl From<Outcome> for LastResult {
    fn from(outcome: Outcome) -> LastResult {
        match outcome {
            Outcome::Completed => LastResult::Completed,
            Outcome::Stopped => LastResult::Stopped,
            Outcome::Faulted => LastResult::Faulted,
            Outcome::TimedOut => LastResult::TimedOut,
        }
    }
}

impl State {
    /// The state of a number made by `as u8`.
    pub fn from_u8(number: u8) -> Option<State> {
        State::ALL.get(usize::from(number)).copied()
    }

    /// Whether drives are or should be under power.
    #[inline]
    pub fn is_under_command(self) -> bool {
        match self {
            State::Enabling
            | State::Ready
            | State::Homing
            | State::Jogging
            | State::Running
            | State::Held
            | State::Away
            | State::Returning
            | State::Stopping => true,
            State::Booting
            | State::Disabled
            | State::Disabling
            | State::Faulted
            | State::ShuttingDown
            | State::Down
            | State::Estop
            | State::Silenced => false,
        }
    }

    /// Whether programs in Structured Text may be replaced: nothing moves.
    pub fn may_replace_logic(self) -> bool {
        matches!(
            self,
            State::Booting | State::Disabled | State::Ready | State::Faulted | State::Estop
        )
    }
}

impl Power {
    /// An emergency stop stands.
    pub fn is_estop(self) -> bool {
        matches!(self, Power::Estop | Power::EstopOpen)
    }
}

impl Reaction {
    /// How grave that is.
    pub const fn severity(self) -> Severity {
        match self {
            Reaction::Count => Severity::Info,
            Reaction::Warn => Severity::Warning,
            Reaction::ControlledStop => Severity::Stop,
            Reaction::QuickStop => Severity::QuickStop,
            Reaction::EmergencyStop => Severity::EmergencyStop,
            Reaction::Silence => Severity::Silenced,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_and_states_are_one_to_one() {
        for number in 0..=u8::MAX {
            match State::from_u8(number) {
                Some(state) => assert_eq!(state as u8, number),
                None => assert!(usize::from(number) >= State::ALL.len()),
            }
        }
    }

    /// Files of an older control have words.
    #[test]
    fn words_of_an_older_control_are_read_as_codes() {
        for state in State::ALL {
            assert_eq!(serde_json::from_value::<State>(json!(state.name())).ok(), Some(state));
            assert_eq!(serde_json::from_value::<State>(json!(state)).ok(), Some(state));
        }
        for result in LastResult::ALL {
            assert_eq!(
                serde_json::from_value::<LastResult>(json!(result.name())).ok(),
                Some(result)
            );
        }
        for reaction in Reaction::ALL {
            assert_eq!(
                serde_json::from_value::<Reaction>(json!(reaction.name())).ok(),
                Some(reaction)
            );
        }
        assert_eq!(json!(State::ShuttingDown), json!("shutting_down"));
        assert_eq!(json!(Power::EstopOpen), json!("estop_open"));
    }
}
