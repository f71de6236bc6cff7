//! The numbers of G and M codes.
//!
//! In:  numbers of G and M words.
//! Out: the code of each, or what was probably meant.

use super::{
    Compensation, Coolant, Cycle, Distance, FeedUnit, GCode, InputOutput, LengthOffset, MCode, ModalCode, Motion,
    NonModal, Override, PathCode, Pockets, Retract, Roughing, SpindleAction, SpindleCode, Stop, StoredPoint, ToolCode,
    integer,
};
use crate::error::ErrorKind;
use crate::foreign;
use crate::near_miss::distance;
use motion::canon::{LengthUnit, Plane, ProbeMode, Side, SpindleDirection};

const fn rough(along_x: bool, pockets: Pockets) -> GCode {
    GCode::Motion(Some(Motion::Rough(Roughing { along_x, pockets })))
}

const fn probe(towards: bool, must_trip: bool) -> GCode {
    GCode::Motion(Some(Motion::Probe(ProbeMode { towards, must_trip })))
}

const fn digital(on: bool, with_motion: bool) -> MCode {
    MCode::InputOutput(InputOutput::Digital { on, with_motion })
}

/// All G codes in ascending order of ten times their number.
const G_CODES: &[(u16, GCode)] = &[
    (0, GCode::Motion(Some(Motion::Traverse))),
    (10, GCode::Motion(Some(Motion::Feed))),
    (20, GCode::Motion(Some(Motion::ArcClockwise))),
    (30, GCode::Motion(Some(Motion::ArcCounterclockwise))),
    (40, GCode::NonModal(NonModal::Dwell)),
    (50, GCode::Motion(Some(Motion::CubicSpline))),
    (51, GCode::Motion(Some(Motion::QuadraticSpline))),
    (52, GCode::Motion(Some(Motion::Nurbs))),
    (53, GCode::Motion(Some(Motion::NurbsEnd))),
    (62, GCode::Motion(Some(Motion::NurbsKnot))),
    (63, GCode::Motion(Some(Motion::NurbsKnotEnd))),
    (70, GCode::Diameter(true)),
    (80, GCode::Diameter(false)),
    (100, GCode::NonModal(NonModal::SetData)),
    (170, GCode::Plane(Plane::Xy)),
    (171, GCode::Plane(Plane::Uv)),
    (180, GCode::Plane(Plane::Zx)),
    (181, GCode::Plane(Plane::Wu)),
    (190, GCode::Plane(Plane::Yz)),
    (191, GCode::Plane(Plane::Vw)),
    (200, GCode::Unit(LengthUnit::Inch)),
    (210, GCode::Unit(LengthUnit::Millimetre)),
    (280, GCode::NonModal(NonModal::Return(StoredPoint::G28))),
    (281, GCode::NonModal(NonModal::Store(StoredPoint::G28))),
    (300, GCode::NonModal(NonModal::Return(StoredPoint::G30))),
    (301, GCode::NonModal(NonModal::Store(StoredPoint::G30))),
    (330, GCode::Motion(Some(Motion::SpindleSynchronised))),
    (331, GCode::Motion(Some(Motion::RigidTap))),
    (382, probe(true, true)),
    (383, probe(true, false)),
    (384, probe(false, true)),
    (385, probe(false, false)),
    (400, GCode::Compensation(Compensation::Off)),
    (410, GCode::Compensation(Compensation::Tool(Side::Left))),
    (411, GCode::Compensation(Compensation::Dynamic(Side::Left))),
    (420, GCode::Compensation(Compensation::Tool(Side::Right))),
    (421, GCode::Compensation(Compensation::Dynamic(Side::Right))),
    (430, GCode::LengthOffset(LengthOffset::Tool)),
    (431, GCode::LengthOffset(LengthOffset::Dynamic)),
    (432, GCode::LengthOffset(LengthOffset::Additional)),
    (434, GCode::LengthOffset(LengthOffset::ToolCentrePoint)),
    (490, GCode::LengthOffset(LengthOffset::Off)),
    (520, GCode::NonModal(NonModal::LocalOffset)),
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
    (700, GCode::Motion(Some(Motion::Finish))),
    (710, rough(false, Pockets::With)),
    (711, rough(false, Pockets::Without)),
    (712, rough(false, Pockets::After)),
    (720, rough(true, Pockets::With)),
    (721, rough(true, Pockets::Without)),
    (722, rough(true, Pockets::After)),
    (730, GCode::Motion(Some(Motion::Cycle(Cycle::ChipBreaking)))),
    (740, GCode::Motion(Some(Motion::Cycle(Cycle::LeftTapping)))),
    (760, GCode::Motion(Some(Motion::Thread))),
    (800, GCode::Motion(None)),
    (810, GCode::Motion(Some(Motion::Cycle(Cycle::Drilling)))),
    (820, GCode::Motion(Some(Motion::Cycle(Cycle::DwellDrilling)))),
    (830, GCode::Motion(Some(Motion::Cycle(Cycle::PeckDrilling)))),
    (840, GCode::Motion(Some(Motion::Cycle(Cycle::RightTapping)))),
    (850, GCode::Motion(Some(Motion::Cycle(Cycle::Boring)))),
    (860, GCode::Motion(Some(Motion::Cycle(Cycle::StopBoring)))),
    (870, GCode::Motion(Some(Motion::Cycle(Cycle::BackBoring)))),
    (880, GCode::Motion(Some(Motion::Cycle(Cycle::ManualBoring)))),
    (890, GCode::Motion(Some(Motion::Cycle(Cycle::DwellBoring)))),
    (900, GCode::Distance(Distance::Absolute)),
    (901, GCode::ArcDistance(Distance::Absolute)),
    (910, GCode::Distance(Distance::Incremental)),
    (911, GCode::ArcDistance(Distance::Incremental)),
    (920, GCode::NonModal(NonModal::SetPosition)),
    (921, GCode::NonModal(NonModal::ClearPosition)),
    (922, GCode::NonModal(NonModal::SuspendPosition)),
    (923, GCode::NonModal(NonModal::RestorePosition)),
    (930, GCode::FeedUnit(FeedUnit::InverseTime)),
    (940, GCode::FeedUnit(FeedUnit::UnitsPerMinute)),
    (950, GCode::FeedUnit(FeedUnit::UnitsPerTurn)),
    (960, GCode::Spindle(SpindleCode::ConstantSurfaceSpeed)),
    (970, GCode::Spindle(SpindleCode::Rpm)),
    (980, GCode::Retract(Retract::OldZ)),
    (990, GCode::Retract(Retract::R)),
];

/// All M codes below 100 in ascending order.
const M_CODES: &[(u16, MCode)] = &[
    (0, MCode::Stop(Stop::Program)),
    (1, MCode::Stop(Stop::Optional)),
    (2, MCode::Stop(Stop::End)),
    (3, MCode::Spindle(SpindleAction::Start(SpindleDirection::Clockwise))),
    (
        4,
        MCode::Spindle(SpindleAction::Start(SpindleDirection::Counterclockwise)),
    ),
    (5, MCode::Spindle(SpindleAction::Stop)),
    (6, MCode::Tool(ToolCode::Change)),
    (7, MCode::Coolant(Coolant::Mist)),
    (8, MCode::Coolant(Coolant::Flood)),
    (9, MCode::Coolant(Coolant::Off)),
    (19, MCode::Spindle(SpindleAction::Orient)),
    (30, MCode::Stop(Stop::PalletEnd)),
    (48, MCode::Override(Override::Both(true))),
    (49, MCode::Override(Override::Both(false))),
    (50, MCode::Override(Override::Feed)),
    (51, MCode::Override(Override::Speed)),
    (52, MCode::Override(Override::Adaptive)),
    (53, MCode::Override(Override::Hold)),
    (60, MCode::Stop(Stop::Pallet)),
    (61, MCode::Tool(ToolCode::SetNumber)),
    (62, digital(true, true)),
    (63, digital(false, true)),
    (64, digital(true, false)),
    (65, digital(false, false)),
    (66, MCode::InputOutput(InputOutput::Wait)),
    (67, MCode::InputOutput(InputOutput::Analog { with_motion: true })),
    (68, MCode::InputOutput(InputOutput::Analog { with_motion: false })),
    (70, MCode::Modal(ModalCode::Save)),
    (71, MCode::Modal(ModalCode::Forget)),
    (72, MCode::Modal(ModalCode::Restore)),
    (73, MCode::Modal(ModalCode::SaveForReturn)),
    (98, MCode::Stop(Stop::Call)),
    (99, MCode::Stop(Stop::Return)),
];

/// No G code has a number of this many tenths or more.
const G_TENTHS_END: usize = 1000;

/// Place in [`G_CODES`] by ten times the number; 255: no such code.
static G_INDEX: [u8; G_TENTHS_END] = {
    let mut index = [u8::MAX; G_TENTHS_END];
    let mut at = 0;
    while at < G_CODES.len() {
        index[G_CODES[at].0 as usize] = at as u8;
        at += 1;
    }
    index
};

impl Motion {
    /// Ten times the number of its G word.
    pub(crate) fn code(self) -> u16 {
        G_CODES
            .iter()
            .find(|(_, code)| *code == GCode::Motion(Some(self)))
            .map_or(800, |(code, _)| *code)
    }

    pub(crate) fn name(self) -> String {
        g_name(self.code())
    }
}

impl GCode {
    /// The code of a number, with ten times that number.
    #[inline]
    pub(crate) fn from_number(number: f64) -> Result<(u16, GCode), ErrorKind> {
        let tenths = number * 10.0;
        if (-0.5..G_TENTHS_END as f64 - 0.5).contains(&tenths) {
            let code = (tenths + 0.5) as usize;
            let place = usize::from(G_INDEX[code]);
            if place < G_CODES.len() && (tenths - code as f64).abs() < 1e-3 {
                return Ok(G_CODES[place]);
            }
        }
        let is_meant = |tenths: u16, code: &GCode| {
            let moves = matches!(
                code,
                GCode::Motion(Some(_)) | GCode::NonModal(NonModal::Return(_) | NonModal::MachineCoordinates)
            );
            // Of one family, such as the probing moves, one may be taken for the other.
            !moves || !tenths.is_multiple_of(10) && f64::from(tenths / 10) == number.trunc() && number.fract() != 0.0
        };
        Err(ErrorKind::UnknownG {
            number,
            nearest: nearest(G_CODES, &format!("G{number}"), g_name, tenths, is_meant).map(g_name),
            elsewhere: foreign::g_code(number),
        })
    }
}

impl MCode {
    /// The code of a number, with that number.
    pub(crate) fn from_number(number: f64) -> Result<(u16, MCode), ErrorKind> {
        match integer(number) {
            Some(code @ 100..=199) => Ok((code as u16, MCode::User(code as u8))),
            Some(code) if let Some(found) = M_CODES.iter().find(|(known, _)| i64::from(*known) == code) => Ok(*found),
            Some(_) | None => Err(ErrorKind::UnknownM {
                number,
                nearest: nearest(M_CODES, &format!("M{number}"), m_name, number, |_, code| {
                    !matches!(code, MCode::Spindle(SpindleAction::Start(_)))
                })
                .map(m_name),
                elsewhere: foreign::m_code(number),
            }),
        }
    }
}

/// Number of the code, of those that may be meant, that takes one change of what was typed; of several the one nearest to
/// `wanted`.
fn nearest<T>(
    codes: &[(u16, T)],
    typed: &str,
    name: fn(u16) -> String,
    wanted: f64,
    is_meant: impl Fn(u16, &T) -> bool,
) -> Option<u16> {
    let typed: Vec<char> = typed.to_lowercase().chars().collect();
    let far = |code: u16| (f64::from(code) - wanted).abs();
    let meant = codes
        .iter()
        .filter(|(code, what)| wanted >= 0.0 && is_meant(*code, what));
    let near = meant
        .map(|(code, _)| *code)
        .filter(|code| distance(&typed, &name(*code)) <= 1);
    near.min_by(|a, b| far(*a).total_cmp(&far(*b)))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_ascend() {
        assert!(G_CODES.is_sorted_by(|a, b| a.0 < b.0));
        assert!(M_CODES.is_sorted_by(|a, b| a.0 < b.0));
        assert!(G_CODES.len() < usize::from(u8::MAX));
    }

    #[test]
    fn codes_are_found_by_number() {
        for (tenths, code) in G_CODES {
            assert_eq!(GCode::from_number(f64::from(*tenths) / 10.0), Ok((*tenths, *code)));
        }
        for (number, code) in M_CODES {
            assert_eq!(MCode::from_number(f64::from(*number)), Ok((*number, *code)));
        }
        assert_eq!(MCode::from_number(150.0), Ok((150, MCode::User(150))));
        assert_eq!(
            GCode::from_number(0.00001),
            Ok((0, GCode::Motion(Some(Motion::Traverse))))
        );
        assert_eq!(Motion::Thread.name(), "G76");
    }

    #[test]
    fn refusals_name_what_was_meant_and_nothing_that_moves() {
        let told = |result: Result<(u16, GCode), ErrorKind>| result.unwrap_err().to_string();
        for (number, rest) in [
            (38.6, "no known G code: did you mean G38.5?"),
            (38.22, "no known G code: did you mean G38.2?"),
            (41.2, "no known G code: did you mean G41.1?"),
            (43.11, "no known G code: did you mean G43.1?"),
            (910.0, "no known G code: did you mean G91?"),
            (101.0, "no known G code: did you mean G10?"),
            (-1.0, "no known G code"),
            (1e9, "no known G code"),
            (1.05, "no known G code"),
            (
                31.0,
                "no code of this control but the skip of Fanuc and Haas: write G38.2, or G38.3 where no contact is no mistake",
            ),
        ] {
            assert_eq!(told(GCode::from_number(number)), format!("G{number} is {rest}"));
        }
        for (number, rest) in [
            (3.5, "no known M code"),
            (-1.0, "no known M code"),
            (200.0, "no known M code"),
            (300.0, "no known M code: did you mean M30?"),
            (
                13.0,
                "no code of this control but spindle and coolant at once: write M3 and M8",
            ),
        ] {
            assert_eq!(
                MCode::from_number(number).unwrap_err().to_string(),
                format!("M{number} is {rest}")
            );
        }
    }
}
