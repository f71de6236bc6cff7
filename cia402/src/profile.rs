//! The tables of the profile: states, commands, bits and modes.
//!
//! In:  statuswords (6041) and controlwords (6040).
//! Out: what they mean. Pure functions; nothing here keeps a state.

use core::fmt;

/// Axes that one device may have.
pub const AXES_MAX: u8 = 8;
/// From an object of one axis to that of the next.
const AXIS_STEP: u16 = 0x0800;
/// The first object of the profile.
const AXES_BEGIN: u16 = 0x6000;

/// The axis of an object, and the object of the first axis that it stands for.
pub const fn axis_of(index: u16) -> (u8, u16) {
    match index.checked_sub(AXES_BEGIN) {
        Some(beyond) if beyond < AXIS_STEP * AXES_MAX as u16 => {
            ((beyond / AXIS_STEP) as u8, AXES_BEGIN + beyond % AXIS_STEP)
        }
        _ => (0, index),
    }
}

/// The object of an axis that stands for `index` of the first axis; objects outside of 6000 to 67FF are of the whole device.
pub const fn object_of(axis: u8, index: u16) -> u16 {
    match index {
        AXES_BEGIN..0x6800 if axis < AXES_MAX => index + AXIS_STEP * axis as u16,
        _ => index,
    }
}

/// State of the drive's power state machine, as the statusword (6041) shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Self-test; moves on by itself.
    NotReadyToSwitchOn,
    /// Initialised, power must not be switched on yet.
    SwitchOnDisabled,
    /// Power may be switched on.
    ReadyToSwitchOn,
    /// Power stage ready, no torque.
    SwitchedOn,
    /// Torque is on and set-points are followed.
    OperationEnabled,
    /// Stops, or holds after a quick stop.
    QuickStopActive,
    /// Stops because of a fault; moves on by itself.
    FaultReactionActive,
    /// Off because of a fault.
    Fault,
}

/// (mask, value, state) of object 6041: the statusword shows `state` when `word & mask == value`. No two overlap.
const PATTERNS: [(u16, u16, State); 8] = [
    (0x004F, 0x0000, State::NotReadyToSwitchOn),
    (0x004F, 0x0040, State::SwitchOnDisabled),
    (0x006F, 0x0021, State::ReadyToSwitchOn),
    (0x006F, 0x0023, State::SwitchedOn),
    (0x006F, 0x0027, State::OperationEnabled),
    (0x006F, 0x0007, State::QuickStopActive),
    (0x004F, 0x000F, State::FaultReactionActive),
    (0x004F, 0x0008, State::Fault),
];

/// The state that a statusword shows; `None` for a pattern that the profile does not define.
///
/// RT: eight comparisons at most.
pub fn state(statusword: u16) -> Option<State> {
    PATTERNS
        .iter()
        .find(|(mask, value, _)| statusword & mask == *value)
        .map(|pattern| pattern.2)
}

impl State {
    /// The state's bits of the statusword (0 to 3, 5 and 6); where the profile leaves bit 5 open it is 0.
    pub const fn statusword(self) -> u16 {
        match self {
            State::NotReadyToSwitchOn => 0x0000,
            State::SwitchOnDisabled => 0x0040,
            State::ReadyToSwitchOn => 0x0021,
            State::SwitchedOn => 0x0023,
            State::OperationEnabled => 0x0027,
            State::QuickStopActive => 0x0007,
            State::FaultReactionActive => 0x000F,
            State::Fault => 0x0008,
        }
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            State::NotReadyToSwitchOn => "NOT READY TO SWITCH ON",
            State::SwitchOnDisabled => "SWITCH ON DISABLED",
            State::ReadyToSwitchOn => "READY TO SWITCH ON",
            State::SwitchedOn => "SWITCHED ON",
            State::OperationEnabled => "OPERATION ENABLED",
            State::QuickStopActive => "QUICK STOP ACTIVE",
            State::FaultReactionActive => "FAULT REACTION ACTIVE",
            State::Fault => "FAULT",
        })
    }
}

/// State command in bits 0 to 3 and 7 of the controlword (6040).
///
/// *Switch on* and *disable operation* are the same bits; which one they are depends on the state of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Command {
    /// Power off, motor coasts.
    DisableVoltage = 0x0000,
    /// Quick stop (605A says how).
    QuickStop = 0x0002,
    /// To READY TO SWITCH ON.
    Shutdown = 0x0006,
    /// To SWITCHED ON, from below (*switch on*) or from OPERATION ENABLED (*disable operation*).
    SwitchOn = 0x0007,
    /// To OPERATION ENABLED.
    EnableOperation = 0x000F,
    /// Leaves FAULT; acts on the rising edge of bit 7.
    FaultReset = 0x0080,
}

impl Command {
    /// The command in a controlword. Bit 7 alone makes a fault reset; its edge is the receiver's to watch.
    ///
    /// RT: a few comparisons.
    pub fn from_controlword(controlword: u16) -> Command {
        if controlword & 0x0080 != 0 {
            Command::FaultReset
        } else if controlword & 0x0002 == 0 {
            Command::DisableVoltage
        } else if controlword & 0x0004 == 0 {
            Command::QuickStop
        } else if controlword & 0x0001 == 0 {
            Command::Shutdown
        } else if controlword & 0x0008 == 0 {
            Command::SwitchOn
        } else {
            Command::EnableOperation
        }
    }
}

/// Bits of the controlword (6040) beside the state commands.
pub mod controlword {
    /// Bit 4: *start homing* (HM), *enable interpolation* (IP), *new set-point* (PP), *enable ramp* (VL).
    pub const MODE_START: u16 = 1 << 4;
    /// Bit 5: *change set immediately* (PP), *unlock ramp* (VL).
    pub const MODE_5: u16 = 1 << 5;
    /// Bit 6: *relative* (PP), *reference ramp* (VL).
    pub const MODE_6: u16 = 1 << 6;
    /// Bit 8: halt.
    pub const HALT: u16 = 1 << 8;
    /// Bit 9: *change on set-point* (PP): pass through it without stopping.
    pub const MODE_9: u16 = 1 << 9;
}

/// Bits of the statusword (6041) beside the state.
pub mod statusword {
    /// Power stage is supplied.
    pub const VOLTAGE_ENABLED: u16 = 1 << 4;
    /// A warning is present; the drive goes on.
    pub const WARNING: u16 = 1 << 7;
    /// 0: the controlword is not obeyed (local control).
    pub const REMOTE: u16 = 1 << 9;
    /// Target reached; HM: at rest.
    pub const TARGET_REACHED: u16 = 1 << 10;
    /// A limit inside the drive acts.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// CSP, CSV, CST: *drive follows the command*; IP: *interpolation active*; HM: *homing attained*; PP: *set-point
    /// acknowledge*; PV: *speed is zero*.
    pub const MODE_ACK: u16 = 1 << 12;
    /// CSP, PP: *following error*; HM: *homing error*; PV: *slip limit*.
    pub const MODE_ERROR: u16 = 1 << 13;
}

/// Modes of operation (6060, 6061), by their codes.
pub mod mode {
    use super::{controlword as control, statusword as status};
    use core::fmt;

    /// No mode, no change.
    pub const NONE: i8 = 0;
    /// Profile position (PP).
    pub const PROFILE_POSITION: i8 = 1;
    /// Velocity (VL), of frequency converters.
    pub const VELOCITY: i8 = 2;
    /// Profile velocity (PV).
    pub const PROFILE_VELOCITY: i8 = 3;
    /// Profile torque (TQ).
    pub const PROFILE_TORQUE: i8 = 4;
    /// Homing (HM).
    pub const HOMING: i8 = 6;
    /// Interpolated position (IP).
    pub const INTERPOLATED_POSITION: i8 = 7;
    /// Cyclic synchronous position (CSP).
    pub const CYCLIC_SYNCHRONOUS_POSITION: i8 = 8;
    /// Cyclic synchronous velocity (CSV).
    pub const CYCLIC_SYNCHRONOUS_VELOCITY: i8 = 9;
    /// Cyclic synchronous torque (CST).
    pub const CYCLIC_SYNCHRONOUS_TORQUE: i8 = 10;

    /// What the profile says of a mode.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct Mode {
        /// In 6060 and 6061.
        pub code: i8,
        /// Its usual short name.
        pub short: &'static str,
        /// Bits of the controlword that are the mode's own, beside *halt*.
        pub controlword: u16,
        /// Bits of the statusword that are the mode's own.
        pub statusword: u16,
    }

    /// All modes that have a meaning here, in the order of their codes.
    pub const MODES: [Mode; 9] = [
        row(
            PROFILE_POSITION,
            "PP",
            control::MODE_START | control::MODE_5 | control::MODE_6 | control::MODE_9,
            status::TARGET_REACHED | status::MODE_ACK | status::MODE_ERROR,
        ),
        row(
            VELOCITY,
            "VL",
            control::MODE_START | control::MODE_5 | control::MODE_6,
            0,
        ),
        row(
            PROFILE_VELOCITY,
            "PV",
            0,
            status::TARGET_REACHED | status::MODE_ACK | status::MODE_ERROR,
        ),
        row(PROFILE_TORQUE, "TQ", 0, status::TARGET_REACHED),
        row(
            HOMING,
            "HM",
            control::MODE_START,
            status::TARGET_REACHED | status::MODE_ACK | status::MODE_ERROR,
        ),
        row(
            INTERPOLATED_POSITION,
            "IP",
            control::MODE_START,
            status::TARGET_REACHED | status::MODE_ACK,
        ),
        row(
            CYCLIC_SYNCHRONOUS_POSITION,
            "CSP",
            0,
            status::MODE_ACK | status::MODE_ERROR,
        ),
        row(CYCLIC_SYNCHRONOUS_VELOCITY, "CSV", 0, status::MODE_ACK),
        row(CYCLIC_SYNCHRONOUS_TORQUE, "CST", 0, status::MODE_ACK),
    ];

    const fn row(code: i8, short: &'static str, controlword: u16, statusword: u16) -> Mode {
        Mode {
            code,
            short,
            controlword,
            statusword,
        }
    }

    /// The bit of a mode in 6502 (supported drive modes); 0 for no mode and for codes without a bit.
    pub const fn supported_bit(code: i8) -> u32 {
        match code {
            1..=4 | 6..=11 => 1 << (code - 1),
            _ => 0,
        }
    }

    /// The modes that a value of 6502 offers, in words: `PP, HM, CSP`; `none` where it offers none of them.
    pub struct Offered(
        /// 6502.
        pub u32,
    );

    impl fmt::Display for Offered {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            let mut offered = MODES.iter().filter(|mode| self.0 & supported_bit(mode.code) != 0);
            match offered.next() {
                None => f.write_str("none"),
                Some(first) => {
                    f.write_str(first.short)?;
                    offered.try_for_each(|mode| write!(f, ", {}", mode.short))
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The profile's table spelled out as bits, most significant first, `x` where a bit takes no part.
    const TABLE: [(&str, State); 8] = [
        ("xxxxxxxxx0xx0000", State::NotReadyToSwitchOn),
        ("xxxxxxxxx1xx0000", State::SwitchOnDisabled),
        ("xxxxxxxxx01x0001", State::ReadyToSwitchOn),
        ("xxxxxxxxx01x0011", State::SwitchedOn),
        ("xxxxxxxxx01x0111", State::OperationEnabled),
        ("xxxxxxxxx00x0111", State::QuickStopActive),
        ("xxxxxxxxx0xx1111", State::FaultReactionActive),
        ("xxxxxxxxx0xx1000", State::Fault),
    ];

    fn matches(bits: &str, word: u16) -> bool {
        bits.bytes()
            .enumerate()
            .all(|(place, bit)| bit == b'x' || (bit == b'1') == (word >> (15 - place) & 1 == 1))
    }

    #[test]
    fn every_statusword_shows_the_state_of_the_table_or_none() {
        let mut unknown = 0;
        for word in 0..=u16::MAX {
            let mut hits = TABLE
                .iter()
                .filter(|(bits, _)| matches(bits, word))
                .map(|(_, state)| *state);
            let expected = hits.next();
            assert_eq!(hits.next(), None, "{word:#06x} shows two states");
            assert_eq!(state(word), expected, "{word:#06x}");
            unknown += u32::from(expected.is_none());
        }
        // Of the 64 combinations of bits 0-3, 5, 6, twelve are states: 4 x 2 (bit 5 open) and 4 x 1.
        assert_eq!(unknown, 65536 - 65536 * 12 / 64);
    }

    #[test]
    fn the_bits_of_a_state_show_that_state() {
        for (_, expected) in TABLE {
            assert_eq!(state(expected.statusword()), Some(expected));
        }
    }

    #[test]
    fn every_controlword_is_one_command_of_the_table() {
        const TABLE: [(&str, Command); 6] = [
            ("xxxxxxxx0xxxx110", Command::Shutdown),
            ("xxxxxxxx0xxx0111", Command::SwitchOn),
            ("xxxxxxxx0xxxxx0x", Command::DisableVoltage),
            ("xxxxxxxx0xxxx01x", Command::QuickStop),
            ("xxxxxxxx0xxx1111", Command::EnableOperation),
            ("xxxxxxxx1xxxxxxx", Command::FaultReset),
        ];
        for word in 0..=u16::MAX {
            let mut hits = TABLE
                .iter()
                .filter(|(bits, _)| matches(bits, word))
                .map(|(_, command)| *command);
            assert_eq!(hits.next(), Some(Command::from_controlword(word)), "{word:#06x}");
            assert_eq!(hits.next(), None, "{word:#06x} is two commands");
        }
    }

    #[test]
    fn supported_bits_follow_the_table_of_6502() {
        assert_eq!(mode::supported_bit(6), 1 << 5);
        assert_eq!(mode::supported_bit(7), 1 << 6);
        assert_eq!(mode::supported_bit(8), 1 << 7);
        assert_eq!([0, 5, 12, -1].map(mode::supported_bit), [0; 4]);
        // Bits 0 to 3 and 5 to 9, one a mode.
        let all = mode::MODES
            .iter()
            .fold(0, |all, mode| all | mode::supported_bit(mode.code));
        assert_eq!(all, 0x03EF);
    }

    #[test]
    fn modes_of_6502_are_told_by_their_short_names() {
        extern crate alloc;
        use alloc::string::ToString;
        // As a servo in the field shows it: with four modes of its maker.
        assert_eq!(mode::Offered(0x000F_03E5).to_string(), "PP, PV, HM, IP, CSP, CSV, CST");
        assert_eq!(mode::Offered(0x0000_0002).to_string(), "VL");
        assert_eq!(mode::Offered(0x000F_0000).to_string(), "none");
    }

    /// The profile's table of mode-specific bits, by their numbers.
    #[test]
    fn bits_of_the_modes_follow_the_table() {
        let bits = |numbers: &[u8]| numbers.iter().fold(0_u16, |bits, number| bits | 1 << number);
        let expected: [(&str, &[u8], &[u8]); 9] = [
            ("PP", &[4, 5, 6, 9], &[10, 12, 13]),
            ("VL", &[4, 5, 6], &[]),
            ("PV", &[], &[10, 12, 13]),
            ("TQ", &[], &[10]),
            ("HM", &[4], &[10, 12, 13]),
            ("IP", &[4], &[10, 12]),
            ("CSP", &[], &[12, 13]),
            ("CSV", &[], &[12]),
            ("CST", &[], &[12]),
        ];
        for (mode, (short, controlword, statusword)) in mode::MODES.into_iter().zip(expected) {
            assert_eq!(
                (mode.short, mode.controlword, mode.statusword),
                (short, bits(controlword), bits(statusword))
            );
        }
    }
}
