//! Codes, their modal groups, and the state that lasts from line to line.
//!
//! In:  numbers of G and M words.
//! Out: typed codes, to `block`; [`Modal`], kept by `execute`.

use crate::error::ErrorKind;
use motion::canon::{LengthUnit, PathMode, Plane, SpindleDirection};

/// Group 1: what axis words do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    /// G0
    Traverse,
    /// G1
    Feed,
    /// G2
    ArcClockwise,
    /// G3
    ArcCounterclockwise,
}

impl Motion {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Motion::Traverse => "G0",
            Motion::Feed => "G1",
            Motion::ArcClockwise => "G2",
            Motion::ArcCounterclockwise => "G3",
        }
    }

    pub(crate) fn is_arc(self) -> bool {
        match self {
            Motion::Traverse | Motion::Feed => false,
            Motion::ArcClockwise | Motion::ArcCounterclockwise => true,
        }
    }
}

/// Group 0: acts on its own line only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NonModal {
    /// G4
    Dwell,
    /// G28, G30
    Return(StoredPoint),
    /// G53
    MachineCoordinates,
}

/// Machine positions that the control remembers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StoredPoint {
    G28,
    G30,
}

impl StoredPoint {
    pub(crate) fn name(self) -> &'static str {
        match self {
            StoredPoint::G28 => "G28",
            StoredPoint::G30 => "G30",
        }
    }
}

/// Groups 3 and 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Distance {
    /// G90, G90.1
    Absolute,
    /// G91, G91.1
    Incremental,
}

/// Group 5: what F means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FeedMode {
    /// G93: one over the minutes of a move.
    InverseTime,
    /// G94
    UnitsPerMinute,
}

/// Group 13.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PathCode {
    /// G61
    ExactPath,
    /// G61.1
    ExactStop,
    /// G64
    Continuous,
}

/// A G word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GCode {
    NonModal(NonModal),
    /// `None`: G80.
    Motion(Option<Motion>),
    Plane(Plane),
    Distance(Distance),
    ArcDistance(Distance),
    FeedMode(FeedMode),
    Unit(LengthUnit),
    /// 1 for G54 to 9 for G59.3.
    System(u8),
    Path(PathCode),
    /// G40: there is no cutter compensation to switch off.
    NoCutterCompensation,
    /// G49: there is no tool length offset to switch off.
    NoToolLengthOffset,
}

/// M group 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    /// M0
    Program,
    /// M1
    Optional,
    /// M2, M30
    End,
}

/// M group 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Coolant {
    /// M7
    Mist,
    /// M8
    Flood,
    /// M9
    Off,
}

/// An M word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MCode {
    Stop(Stop),
    ToolChange,
    /// `None`: M5.
    Spindle(Option<SpindleDirection>),
    Coolant(Coolant),
}

/// Supported G codes in ascending order of ten times their number.
const G_CODES: [(u16, GCode); 34] = [
    (0, GCode::Motion(Some(Motion::Traverse))),
    (10, GCode::Motion(Some(Motion::Feed))),
    (20, GCode::Motion(Some(Motion::ArcClockwise))),
    (30, GCode::Motion(Some(Motion::ArcCounterclockwise))),
    (40, GCode::NonModal(NonModal::Dwell)),
    (170, GCode::Plane(Plane::Xy)),
    (180, GCode::Plane(Plane::Zx)),
    (190, GCode::Plane(Plane::Yz)),
    (200, GCode::Unit(LengthUnit::Inch)),
    (210, GCode::Unit(LengthUnit::Millimetre)),
    (280, GCode::NonModal(NonModal::Return(StoredPoint::G28))),
    (300, GCode::NonModal(NonModal::Return(StoredPoint::G30))),
    (400, GCode::NoCutterCompensation),
    (490, GCode::NoToolLengthOffset),
    (530, GCode::NonModal(NonModal::MachineCoordinates)),
    (540, GCode::System(1)),
    (550, GCode::System(2)),
    (560, GCode::System(3)),
    (570, GCode::System(4)),
    (580, GCode::System(5)),
    (590, GCode::System(6)),
    (591, GCode::System(7)),
    (592, GCode::System(8)),
    (593, GCode::System(9)),
    (610, GCode::Path(PathCode::ExactPath)),
    (611, GCode::Path(PathCode::ExactStop)),
    (640, GCode::Path(PathCode::Continuous)),
    (800, GCode::Motion(None)),
    (900, GCode::Distance(Distance::Absolute)),
    (901, GCode::ArcDistance(Distance::Absolute)),
    (910, GCode::Distance(Distance::Incremental)),
    (911, GCode::ArcDistance(Distance::Incremental)),
    (930, GCode::FeedMode(FeedMode::InverseTime)),
    (940, GCode::FeedMode(FeedMode::UnitsPerMinute)),
];

/// G codes of LinuxCNC that are refused by name, times ten.
const G_REFUSED: [u16; 56] = [
    50, 51, 52, 53, 62, 63, 70, 80, 100, 171, 181, 191, 281, 301, 330, 331, 382, 383, 384, 385, 410, 411, 420, 421,
    430, 431, 432, 520, 700, 710, 711, 712, 720, 721, 722, 730, 740, 760, 810, 820, 830, 840, 850, 860, 870, 880, 890,
    920, 921, 922, 923, 950, 960, 970, 980, 990,
];

/// Supported M codes in ascending order.
const M_CODES: [(u16, MCode); 11] = [
    (0, MCode::Stop(Stop::Program)),
    (1, MCode::Stop(Stop::Optional)),
    (2, MCode::Stop(Stop::End)),
    (3, MCode::Spindle(Some(SpindleDirection::Clockwise))),
    (4, MCode::Spindle(Some(SpindleDirection::Counterclockwise))),
    (5, MCode::Spindle(None)),
    (6, MCode::ToolChange),
    (7, MCode::Coolant(Coolant::Mist)),
    (8, MCode::Coolant(Coolant::Flood)),
    (9, MCode::Coolant(Coolant::Off)),
    (30, MCode::Stop(Stop::End)),
];

/// Whether LinuxCNC knows this M code, which we refuse.
fn is_refused_m(code: u16) -> bool {
    matches!(code, 19 | 48..=53 | 60..=68 | 70..=73 | 98..=199)
}

impl GCode {
    /// The code of a number, with ten times that number.
    pub(crate) fn of(number: f64) -> Result<(u16, GCode), ErrorKind> {
        let tenths = number * 10.0;
        let code = tenths.round();
        let exact = number >= 0.0 && code <= 65535.0 && (tenths - code).abs() < 1e-3;
        let code = code as u16; // saturates; not looked at unless exact
        if exact && let Ok(at) = G_CODES.binary_search_by_key(&code, |(code, _)| *code) {
            return Ok(G_CODES[at]);
        }
        let nearest = g_name(nearest(&G_CODES, tenths));
        Err(if exact && G_REFUSED.contains(&code) {
            ErrorKind::UnsupportedG {
                code: g_name(code),
                nearest,
            }
        } else {
            ErrorKind::UnknownG { number, nearest }
        })
    }
}

impl MCode {
    /// The code of a number, with that number.
    pub(crate) fn of(number: f64) -> Result<(u16, MCode), ErrorKind> {
        let exact = (0.0..=65535.0).contains(&number) && integer(number).is_some();
        let code = number.round() as u16; // saturates; not looked at unless exact
        if exact && let Ok(at) = M_CODES.binary_search_by_key(&code, |(code, _)| *code) {
            return Ok(M_CODES[at]);
        }
        let nearest = m_name(nearest(&M_CODES, number));
        Err(if exact && is_refused_m(code) {
            ErrorKind::UnsupportedM {
                code: m_name(code),
                nearest,
            }
        } else {
            ErrorKind::UnknownM { number, nearest }
        })
    }
}

/// Number of the code nearest to `wanted`.
fn nearest<T>(codes: &[(u16, T)], wanted: f64) -> u16 {
    let distance = |code: u16| (f64::from(code) - wanted).abs();
    codes
        .iter()
        .map(|(code, _)| *code)
        .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
        .unwrap_or(0)
}

/// `G1` of 10, `G59.1` of 591.
pub(crate) fn g_name(tenths: u16) -> String {
    if tenths.is_multiple_of(10) {
        format!("G{}", tenths / 10)
    } else {
        format!("G{}.{}", tenths / 10, tenths % 10)
    }
}

/// `M3` of 3.
pub(crate) fn m_name(code: u16) -> String {
    format!("M{code}")
}

/// The integer that a number stands for, if it is within 0.0001 of one.
pub(crate) fn integer(number: f64) -> Option<i64> {
    let rounded = number.round();
    ((number - rounded).abs() <= 1e-4).then_some(rounded as i64)
}

/// A feed as programmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Feed {
    /// Number of the F word, units per minute.
    pub(crate) number: f64,
    /// Unit in force when it was read.
    pub(crate) unit: LengthUnit,
}

/// What lasts from line to line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Modal {
    /// `None`: G80, and at the start.
    pub(crate) motion: Option<Motion>,
    pub(crate) plane: Plane,
    pub(crate) distance: Distance,
    pub(crate) arc_distance: Distance,
    pub(crate) feed_mode: FeedMode,
    pub(crate) unit: LengthUnit,
    /// G94 only; `None` and 0 alike: no feed.
    pub(crate) feed: Option<Feed>,
    /// A feed was set and then cleared by a change of the feed mode.
    pub(crate) feed_cleared: bool,
    /// 1 for G54 to 9 for G59.3.
    pub(crate) system: u8,
    pub(crate) path_mode: PathMode,
    /// T
    pub(crate) selected_tool: u32,
}

impl Modal {
    /// The state in which a program starts.
    pub(crate) fn new(unit: LengthUnit, system: u8, path_mode: PathMode) -> Modal {
        Modal {
            motion: None,
            plane: Plane::Xy,
            distance: Distance::Absolute,
            arc_distance: Distance::Incremental,
            feed_mode: FeedMode::UnitsPerMinute,
            unit,
            feed: None,
            feed_cleared: false,
            system,
            path_mode,
            selected_tool: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_ascend_and_do_not_overlap() {
        assert!(G_CODES.is_sorted_by(|a, b| a.0 < b.0));
        assert!(M_CODES.is_sorted_by(|a, b| a.0 < b.0));
        assert!(G_CODES.iter().all(|(code, _)| !G_REFUSED.contains(code)));
        assert!(M_CODES.iter().all(|(code, _)| !is_refused_m(*code)));
    }

    #[test]
    fn codes_are_found_by_number() {
        assert_eq!(GCode::of(59.3), Ok((593, GCode::System(9))));
        assert_eq!(GCode::of(61.1), Ok((611, GCode::Path(PathCode::ExactStop))));
        assert_eq!(MCode::of(30.0), Ok((30, MCode::Stop(Stop::End))));
    }

    #[test]
    fn refusals_name_the_nearest_code() {
        assert_eq!(
            GCode::of(22.0),
            Err(ErrorKind::UnknownG {
                number: 22.0,
                nearest: "G21".into()
            })
        );
        assert_eq!(
            GCode::of(38.2),
            Err(ErrorKind::UnsupportedG {
                code: "G38.2".into(),
                nearest: "G40".into()
            })
        );
        assert_eq!(
            GCode::of(-1.0),
            Err(ErrorKind::UnknownG {
                number: -1.0,
                nearest: "G0".into()
            })
        );
        assert_eq!(
            GCode::of(1e9),
            Err(ErrorKind::UnknownG {
                number: 1e9,
                nearest: "G94".into()
            })
        );
        assert_eq!(
            MCode::of(3.5),
            Err(ErrorKind::UnknownM {
                number: 3.5,
                nearest: "M3".into()
            })
        );
        assert_eq!(
            MCode::of(48.0),
            Err(ErrorKind::UnsupportedM {
                code: "M48".into(),
                nearest: "M30".into()
            })
        );
    }
}
