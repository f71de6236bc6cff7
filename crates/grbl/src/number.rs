//! Numbers of errors and alarms, as senders have them in their tables.

use std::fmt;

/// Why a line is not taken: `error:n`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorNumber {
    /// A word does not begin with a letter.
    ExpectedLetter = 1,
    /// The number of a word is missing or none.
    BadNumber = 2,
    /// A `$` that is not known, or that is not served.
    BadDollar = 3,
    /// A value that must not be negative.
    Negative = 4,
    /// Homing is not set up.
    HomingOff = 5,
    /// Only while idle.
    NotIdle = 8,
    /// Locked by an alarm, or because the machine is not homed.
    Locked = 9,
    /// Line too long.
    LineLong = 11,
    /// A jog beyond the travel.
    Travel = 15,
    /// A jog without axes, or with words that it cannot have.
    Jog = 16,
    /// A word that is not supported.
    Unsupported = 20,
    /// Two words of one modal group.
    Group = 21,
    /// A feed is missing.
    Feed = 22,
    /// A code that must be a whole number.
    NotWhole = 23,
    /// Two codes that both want the axes.
    TwoAxisCodes = 24,
    /// A word that stands twice.
    Repeated = 25,
    /// A code that wants axes has none.
    NoAxis = 26,
    /// A line number that cannot be.
    LineNumber = 27,
    /// A value that a code wants (P, L) is missing.
    ValueMissing = 28,
    /// A work system that is not there.
    WorkSystem = 29,
    /// G53 with something else than G0 and G1.
    MachineMove = 30,
    /// Axes that nothing uses.
    UnusedAxis = 31,
    /// An arc without an end in its plane.
    ArcEnd = 32,
    /// An arc, or a probing move, that cannot be.
    Target = 33,
    /// An arc whose radius is too small.
    ArcRadius = 34,
    /// An arc without a centre in its plane.
    ArcCentre = 35,
    /// Words that nothing uses.
    Unused = 36,
    /// G43.1 with another axis than Z.
    ToolAxis = 37,
    /// Tool number too great.
    Tool = 38,
}

impl fmt::Display for ErrorNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error:{}", *self as u8)
    }
}

/// Why the machine is locked: `ALARM:n`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AlarmNumber {
    /// A limit switch.
    HardLimit = 1,
    /// A target beyond the travel.
    SoftLimit = 2,
    /// Reset while something moved, and every fault that has no number of its own.
    Stopped = 3,
    /// The probe was closed before it began.
    ProbeBegin = 4,
    /// A probing move ended without contact.
    ProbeEnd = 5,
    /// Reset while homing.
    HomingReset = 6,
    /// The door was opened while homing.
    HomingDoor = 7,
    /// A switch did not open again.
    PullOff = 8,
    /// No switch was found.
    NoSwitch = 9,
}

impl AlarmNumber {
    /// Of the cause that the control gives in words.
    pub fn of_cause(cause: &str) -> AlarmNumber {
        let has = |word: &str| cause.contains(word);
        if has("not homed") {
            match has("does not open") {
                true => AlarmNumber::PullOff,
                false if has("ended by the operator") => AlarmNumber::HomingReset,
                false => AlarmNumber::NoSwitch,
            }
        } else if has("limit switch") {
            AlarmNumber::HardLimit
        } else if has("probe") && (has("closed") || has("before it began")) {
            AlarmNumber::ProbeBegin
        } else if has("probe") || has("contact") {
            AlarmNumber::ProbeEnd
        } else if has("travel") {
            AlarmNumber::SoftLimit
        } else {
            AlarmNumber::Stopped
        }
    }
}

impl fmt::Display for AlarmNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ALARM:{}", *self as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_have_the_numbers_that_senders_explain() {
        for (cause, number) in [
            ("x-drive: not homed: no home switch within the search distance", 9),
            (
                "x-drive: not homed: the home switch does not open when the joint leaves it",
                8,
            ),
            ("x-drive: not homed: ended by the operator", 6),
            ("x-drive: limit switch at its upper end", 1),
            ("x-drive: command 305.200 mm beyond its travel", 2),
            ("grbl:1:3: X 400.000 mm is machine 400.000, travel ends at 305.000", 2),
            ("grbl:1:1: the probe is closed", 4),
            ("grbl:1:1: the probe did not touch anything", 5),
            ("x-drive: lost, it does not answer any more", 3),
        ] {
            assert_eq!(AlarmNumber::of_cause(cause) as u8, number, "{cause}");
        }
    }

    #[test]
    fn numbers_are_told_as_senders_read_them() {
        assert_eq!(ErrorNumber::Unsupported.to_string(), "error:20");
        assert_eq!(AlarmNumber::Stopped.to_string(), "ALARM:3");
    }
}
