//! The rules that join words and codes of a line: every word is used, and by one code only.

use crate::block::{Block, letters};
use crate::code::{
    Compensation, Cycle, Distance, FeedUnit, InputOutput, LengthOffset, Motion, NonModal, Override, PathCode,
    SpindleAction, SpindleCode, Stop, ToolCode,
};
use crate::error::ErrorKind;
use crate::scan::{Fault, number_with_exponent};
use crate::state::State;

/// Letters that nothing uses unless a code on the line does.
const OPTIONAL: u32 = letters(b"DEHIJKLPQR$");

/// Whether axis words of the line belong to G43.1 or G43.2.
pub(super) fn length_offset_takes_axes(block: &Block) -> bool {
    matches!(
        block.codes.length_offset.map(|code| code.value),
        Some(LengthOffset::Dynamic | LengthOffset::Additional)
    )
}

/// Whether the modal motion moves on a line without axis words.
pub(super) fn moves_without_axes(modal: Motion, block: &Block) -> bool {
    match modal {
        Motion::ArcClockwise | Motion::ArcCounterclockwise => block.has(letters(b"IJK")),
        Motion::NurbsKnot => block.has(letters(b"K")),
        _ => false,
    }
}

impl State {
    pub(super) fn check_usage(&self, block: &Block, line: &[u8], motion: Option<Motion>) -> Result<(), Fault> {
        let takes_axes = block.codes.non_modal.filter(|code| code.value.takes_axes());
        if let (Some(code), Some(other)) = (takes_axes, block.codes.motion)
            && let Some(motion) = other.value
        {
            let (non_modal, motion) = (code.name(), motion.name());
            return Err((other.span, ErrorKind::AxisConflict { non_modal, motion }));
        }
        if let Some(axis) = block.first_axis()
            && motion.is_none()
            && takes_axes.is_none()
            && !length_offset_takes_axes(block)
        {
            let letter = axis.into();
            let kind = if block.codes.motion.is_some() {
                ErrorKind::AxisWordWithG80 { letter }
            } else {
                ErrorKind::NoMotion { letter }
            };
            return Err((block.span(axis), kind));
        }
        if let Some(code) = block.codes.non_modal
            && code.value == NonModal::MachineCoordinates
        {
            if !matches!(motion, Some(Motion::Traverse | Motion::Feed)) {
                return Err((code.span, ErrorKind::MachineCoordinatesNeedStraight));
            }
            let distance = block.codes.distance.map_or(self.modal.distance, |code| code.value);
            if distance == Distance::Incremental {
                return Err((code.span, ErrorKind::MachineCoordinatesIncremental));
            }
        }
        if self.tool_centre_point
            && let Some(code) = block.codes.non_modal
            && let NonModal::MachineCoordinates | NonModal::Return(_) | NonModal::Store(_) = code.value
        {
            let code_name = code.name();
            return Err((code.span, ErrorKind::MachineUnderToolCentrePoint { code: code_name }));
        }
        if let (Some(dwell), Some(arc)) = (block.codes.non_modal, block.codes.motion)
            && dwell.value == NonModal::Dwell
            && let Some(motion) = arc.value.filter(|motion| motion.is_arc())
        {
            let motion = motion.name();
            return Err((arc.span, ErrorKind::DwellWithArc { motion }));
        }
        if let (Some(path), Some(spindle)) = (block.codes.path, block.codes.spindle)
            && path.value == PathCode::Continuous
            && spindle.value == SpindleAction::Orient
            && block.word_value(b'R').is_some()
        {
            return Err((block.span(b'R'), ErrorKind::PlannerWithOrient));
        }
        if let Some(letter) = block.first_of(b"@^")
            && motion.is_none()
        {
            let code = takes_axes.map(|code| code.name());
            let code = code.or(block.codes.length_offset.map(|code| code.name()));
            let code = code.unwrap_or_default();
            return Err((block.span(letter), ErrorKind::PolarWithoutMotion { code }));
        }
        if block.has(OPTIONAL) {
            return check_letters(block, line, motion);
        }
        Ok(())
    }
}

/// Every letter of [`OPTIONAL`] that is there has a code that uses it.
fn check_letters(block: &Block, line: &[u8], motion: Option<Motion>) -> Result<(), Fault> {
    let used = used_letters(block, motion);
    let unused = block.present() & OPTIONAL & !used;
    if unused == 0 {
        return Ok(());
    }
    let (letter, users) = USERS
        .iter()
        .find(|(letter, _)| unused & letters(&[*letter]) != 0)
        .expect("every optional letter has its users");
    if *letter == b'E'
        && let Some(fault) = number_with_exponent(line, block.span(b'E').start.into())
    {
        return Err(fault);
    }
    Err(block.span(*letter).fault(ErrorKind::UnusedWord {
        letter: (*letter).into(),
        users,
    }))
}

/// Codes that use a letter, for messages.
const USERS: [(u8, &str); 11] = [
    (b'D', "G41, G42, G41.1, G42.1, G96, G70 to G73 and G83"),
    (b'E', "M66, M67, M68, G70 and G76"),
    (b'H', "G43, G43.2, G43.4 and G76"),
    (b'I', "G2, G3, G5, G5.1, G10 L1, G33.1, G70 to G72.2, G76 and G87"),
    (b'J', "G2, G3, G5, G5.1, G10 L1, G76 and G87"),
    (b'K', "G2, G3, G6.2, G33, G33.1, G76 and G87"),
    (b'L', "G10, G5.2, G41.1, G42.1, G73 to G89, M66 and M98"),
    (
        b'P',
        "G2, G3, G4, G5, G5.2, G6.2, G10, G64, G70, G74, G76, G82, G84, G86, G88, G89, M19, M50 to M53, M62 to M66, M98 and M100 to M199",
    ),
    (
        b'Q',
        "G5, G6.2, G10, G64, G70 to G73, G76, G83, M19, M61, M66 to M68 and M100 to M199",
    ),
    (b'R', "G2, G3, G6.2, G10, G64, G70 to G76, G81 to G89, M19"),
    (
        b'$',
        "S, M3, M4, M5, M19, M51, G33, G33.1, G74, G76, G84, G95, G96 and G97",
    ),
];

/// Optional letters that the codes of a line use.
fn used_letters(block: &Block, motion: Option<Motion>) -> u32 {
    let codes = &block.codes;
    let mut used = motion.map_or(0, letters_of_motion);
    if let Some(code) = codes.non_modal {
        used |= match code.value {
            NonModal::Dwell => letters(b"P"),
            NonModal::SetData => letters(b"LPRIJQ"),
            NonModal::Return(_)
            | NonModal::Store(_)
            | NonModal::LocalOffset
            | NonModal::MachineCoordinates
            | NonModal::SetPosition
            | NonModal::ClearPosition
            | NonModal::SuspendPosition
            | NonModal::RestorePosition => 0,
        };
    }
    if let Some(code) = codes.compensation {
        used |= match code.value {
            Compensation::Off => 0,
            Compensation::Tool(_) => letters(b"DL"),
            Compensation::Dynamic(_) => letters(b"DLR"),
        };
    }
    if let Some(code) = codes.length_offset {
        used |= match code.value {
            LengthOffset::Tool | LengthOffset::Additional | LengthOffset::ToolCentrePoint => letters(b"H"),
            LengthOffset::Dynamic | LengthOffset::Off => 0,
        };
    }
    if let Some(code) = codes.path {
        used |= match code.value {
            PathCode::Continuous => letters(b"PQR"),
            PathCode::ExactPath | PathCode::ExactStop => 0,
        };
    }
    if let Some(code) = codes.spindle_mode {
        used |= match code.value {
            SpindleCode::ConstantSurfaceSpeed => letters(b"D$"),
            SpindleCode::Rpm => letters(b"$"),
        };
    }
    if codes.feed_unit.is_some_and(|code| code.value == FeedUnit::UnitsPerTurn) || block.has(letters(b"S")) {
        used |= letters(b"$");
    }
    if let Some(code) = codes.stop {
        used |= match code.value {
            Stop::Call => letters(b"PL"),
            Stop::Program | Stop::Optional | Stop::End | Stop::PalletEnd | Stop::Pallet | Stop::Return => 0,
        };
    }
    if let Some(code) = codes.input_output {
        used |= match code.value {
            InputOutput::Digital { .. } => letters(b"P"),
            InputOutput::Wait => letters(b"PELQ"),
            InputOutput::Analog { .. } => letters(b"EQ"),
        };
    }
    if let Some(code) = codes.tool {
        used |= match code.value {
            ToolCode::Change => 0,
            ToolCode::SetNumber => letters(b"Q"),
        };
    }
    if let Some(code) = codes.spindle {
        used |= match code.value {
            SpindleAction::Start(_) | SpindleAction::Stop => letters(b"$"),
            SpindleAction::Orient => letters(b"PQR$"),
        };
    }
    if let Some(code) = codes.overrides {
        used |= match code.value {
            Override::Both(_) => 0,
            Override::Speed => letters(b"P$"),
            Override::Feed | Override::Adaptive | Override::Hold => letters(b"P"),
        };
    }
    if codes.user.is_some() {
        used |= letters(b"PQ");
    }
    used
}

fn letters_of_motion(motion: Motion) -> u32 {
    match motion {
        Motion::Traverse | Motion::Feed | Motion::Probe(_) | Motion::NurbsEnd | Motion::NurbsKnotEnd => 0,
        Motion::ArcClockwise | Motion::ArcCounterclockwise => letters(b"IJKRP"),
        Motion::CubicSpline => letters(b"IJPQ"),
        Motion::QuadraticSpline => letters(b"IJ"),
        Motion::Nurbs => letters(b"PL"),
        Motion::NurbsKnot => letters(b"PQRK"),
        Motion::SpindleSynchronised => letters(b"K$"),
        Motion::RigidTap => letters(b"KI$"),
        Motion::Finish => letters(b"QEDP"),
        Motion::Rough(_) => letters(b"QDIR"),
        Motion::Thread => letters(b"PIJKRQHEL$"),
        Motion::Cycle(cycle) => match cycle {
            Cycle::Drilling | Cycle::Boring => letters(b"RL"),
            Cycle::DwellDrilling | Cycle::StopBoring | Cycle::ManualBoring | Cycle::DwellBoring => letters(b"RLP"),
            Cycle::ChipBreaking | Cycle::PeckDrilling => letters(b"RLQD"),
            Cycle::LeftTapping | Cycle::RightTapping => letters(b"RLP$"),
            Cycle::BackBoring => letters(b"RLIJK"),
        },
    }
}
