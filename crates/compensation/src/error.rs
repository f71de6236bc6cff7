//! What keeps a tool of its radius from following the programmed contour.

use motion::canon::{Plane, Source};

/// A move that cannot be compensated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompensationError {
    /// Block that showed it; at a corner the one behind the corner.
    pub source: Source,
    /// What is wrong.
    pub kind: CompensationErrorKind,
}

impl CompensationError {
    /// `source`: of the event that showed it; a gouge belongs to the later of its two moves.
    pub(super) fn new(source: Source, kind: CompensationErrorKind) -> CompensationError {
        let source = match kind {
            CompensationErrorKind::Gouge { tool, contour, .. } if is_later(&tool, &contour) => tool,
            CompensationErrorKind::Gouge { contour, .. } => contour,
            _ => source,
        };
        CompensationError { source, kind }
    }
}

impl CompensationErrorKind {
    /// Whether the tool would cut into the contour by what was programmed before already.
    pub fn is_gouge(&self) -> bool {
        matches!(self, CompensationErrorKind::Gouge { .. })
    }
}

/// As the text goes; in a loop or a subroutine either may come first.
fn is_later(a: &Source, b: &Source) -> bool {
    (a.file, a.line) > (b.file, b.line)
}

impl core::fmt::Display for CompensationError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.kind.fmt(f)
    }
}

impl std::error::Error for CompensationError {}

/// Why. Lengths are mm; `first` names the earlier of two moves.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CompensationErrorKind {
    /// The first move after G41 or G42 is not longer than the radius.
    #[error(
        "the first move after G41 or G42 is {length_mm:.4} mm long in the {} plane, but has to be longer than the tool's radius \
         of {radius_mm:.4} mm, so that the tool gets beside the contour without touching it: start {:.4} mm further away",
        name(*.plane), .radius_mm - .length_mm
    )]
    EntryTooShort {
        /// Length in the plane.
        length_mm: f64,
        /// Of the tool.
        radius_mm: f64,
        /// G17 or G18.
        plane: Plane,
    },
    /// The first move is an arc with the tool inside it, so short that the tool would have to come from outside.
    #[error(
        "the entry arc begins only {height_mm:.4} mm above the line along which it ends; a tool of radius {radius_mm:.4} mm inside it \
         needs more than its radius there: enter by a longer arc of smaller radius, or by a straight move"
    )]
    EntryArcTooFlat {
        /// Distance of the arc's start from the tangent at its end, towards the tool.
        height_mm: f64,
        /// Of the tool.
        radius_mm: f64,
    },
    /// The tool goes on the inner side of an arc that is too tight.
    #[error(
        "the tool's radius of {radius_mm:.4} mm does not fit inside an arc of radius {arc_mm:.4} mm: it has to be smaller; take a \
         smaller tool or a larger arc"
    )]
    ArcTooTight {
        /// Radius of the programmed arc.
        arc_mm: f64,
        /// Of the tool.
        radius_mm: f64,
    },
    /// At an inner corner the two paths of the centre do not meet.
    #[error(
        "a tool of radius {radius_mm:.4} mm does not fit into the inner corner between the move of line {} and this one: the paths of \
         its centre miss each other by {gap_mm:.4} mm; take a smaller tool, or round the corner by more than its radius",
        .first.line
    )]
    CornerUnreachable {
        /// Earlier move.
        first: Source,
        /// By how much the paths miss each other.
        gap_mm: f64,
        /// Of the tool.
        radius_mm: f64,
    },
    /// Inner corners take more from a move than it is long.
    #[error(
        "a tool of radius {radius_mm:.4} mm would cut into the contour: between its neighbours the move of line {} is {short_mm:.4} mm \
         too short for the tool to get to it; take a smaller tool, or make the move longer",
        .first.line
    )]
    MoveTooShort {
        /// The move that is too short.
        first: Source,
        /// By how much.
        short_mm: f64,
        /// Of the tool.
        radius_mm: f64,
    },
    /// Beside one part of the contour the tool cuts into another part.
    #[error(
        "beside the move of line {} a tool of radius {radius_mm:.4} mm would cut {missing_mm:.4} mm into the contour of line {}, at {}; \
         take a smaller tool, or leave out what it cannot reach; if nothing is to stay there, gouge = \"neighbours-only\" of [program] in \
         the machine file lets it pass",
        .tool.line, .contour.line, place(*.plane, *.at_mm)
    )]
    Gouge {
        /// Move beside which the tool is.
        tool: Source,
        /// Move into whose contour it cuts.
        contour: Source,
        /// How deep.
        missing_mm: f64,
        /// Of the tool.
        radius_mm: f64,
        /// Where, on the first and second axis of the plane, work coordinates.
        at_mm: [f64; 2],
        /// G17 or G18.
        plane: Plane,
    },
    /// G40 is followed by an arc.
    #[error(
        "the first move after G40 has to be straight (G0 or G1), not an arc: it leads the tool away from the contour"
    )]
    ExitArc,
    /// G41 or G42 while one is on.
    #[error("cutter compensation is on already: switch it off with G40 and a straight move before G41 or G42")]
    AlreadyOn,
    /// G41 or G42 in a plane that has no compensation.
    #[error("cutter compensation works in the XY plane (G17) and in the ZX plane (G18), not in {}", name(*.0))]
    Plane(Plane),
    /// Another plane while compensation is on.
    #[error("the plane cannot change while cutter compensation is on: switch it off with G40 first")]
    PlaneChange,
    /// Something that moves the work coordinates under the held moves, or moves along no contour.
    #[error("{what} is not possible while cutter compensation is on: switch it off with G40 first")]
    NotAllowed {
        /// What.
        what: &'static str,
    },
    /// Too much to hold back between two moves in the plane.
    #[error(
        "more than {limit} blocks lie between two moves in the plane of compensation; the tool has to wait at the corner for the \
         next one: switch compensation off with G40 before a long stay"
    )]
    TooManyHeld {
        /// Number of events that can be held.
        limit: usize,
    },
    /// An arc whose centre is one of its ends, or that does not turn.
    #[error("an arc needs a radius: its centre is at its start or end")]
    BadArc,
    /// A coordinate or radius is not a number, infinite or out of all proportion.
    #[error("a coordinate or the tool's radius is not a number that a machine could follow")]
    NotFinite,
}

/// The letters of a plane.
fn name(plane: Plane) -> &'static str {
    match plane {
        Plane::Xy => "XY",
        Plane::Zx => "ZX",
        Plane::Yz => "YZ",
        Plane::Uv => "UV",
        Plane::Wu => "WU",
        Plane::Vw => "VW",
    }
}

/// A point in words.
fn place(plane: Plane, at_mm: [f64; 2]) -> String {
    let [first, second, _] = plane.axes();
    format!("{}{:.4} {}{:.4}", first.letter(), at_mm[0], second.letter(), at_mm[1])
}
