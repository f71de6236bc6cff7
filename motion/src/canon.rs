//! Canonical moves: the vocabulary in which a part program is told to the planner.
//!
//! In:  from the interpreter (`gcode`), in program order.
//! Out: to [`crate::plan`].
//!
//! Lengths are millimetres, angles degrees, speeds per second, whatever units the program text used. Positions are
//! those of the *work* coordinate system; the offset calls tell how it lies in the machine:
//! `machine = rotate_xy(work + g92) + g5x + tool`.

/// Number of program axes: X Y Z A B C U V W.
pub const AXES: usize = 9;

/// A letter of the program that can move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Axis {
    /// Linear, mm.
    X,
    /// Linear, mm.
    Y,
    /// Linear, mm.
    Z,
    /// Rotary about X, degrees.
    A,
    /// Rotary about Y, degrees.
    B,
    /// Rotary about Z, degrees.
    C,
    /// Linear parallel to X, mm.
    U,
    /// Linear parallel to Y, mm.
    V,
    /// Linear parallel to Z, mm.
    W,
}

impl Axis {
    /// All axes in the order of [`Position`].
    pub const ALL: [Axis; AXES] = [
        Axis::X,
        Axis::Y,
        Axis::Z,
        Axis::A,
        Axis::B,
        Axis::C,
        Axis::U,
        Axis::V,
        Axis::W,
    ];

    /// Capital letter as in the program.
    pub const fn letter(self) -> char {
        b"XYZABCUVW"[self as usize] as char
    }

    /// The axis of a letter, upper or lower case.
    pub fn from_letter(letter: char) -> Option<Axis> {
        let letter = letter.to_ascii_uppercase();
        Axis::ALL.into_iter().find(|axis| axis.letter() == letter)
    }

    /// Whether positions of this axis are degrees and not millimetres.
    pub const fn is_rotary(self) -> bool {
        matches!(self, Axis::A | Axis::B | Axis::C)
    }
}

/// One value per axis: mm for linear, degrees for rotary axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Position(pub [f64; AXES]);

impl Position {
    /// All zero.
    pub const ZERO: Position = Position([0.0; AXES]);

    /// A position of the three main linear axes, the others zero.
    pub const fn xyz(x_mm: f64, y_mm: f64, z_mm: f64) -> Position {
        Position([x_mm, y_mm, z_mm, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    }
}

impl core::ops::Index<Axis> for Position {
    type Output = f64;
    fn index(&self, axis: Axis) -> &f64 {
        &self.0[axis as usize]
    }
}

impl core::ops::IndexMut<Axis> for Position {
    fn index_mut(&mut self, axis: Axis) -> &mut f64 {
        &mut self.0[axis as usize]
    }
}

/// Plane of arcs, of tool compensation and of cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// G17: X first, Y second, Z normal.
    Xy,
    /// G18: Z first, X second, Y normal.
    Zx,
    /// G19: Y first, Z second, X normal.
    Yz,
}

impl Plane {
    /// First, second and normal axis; an angle counts from the first towards the second.
    pub const fn axes(self) -> [Axis; 3] {
        match self {
            Plane::Xy => [Axis::X, Axis::Y, Axis::Z],
            Plane::Zx => [Axis::Z, Axis::X, Axis::Y],
            Plane::Yz => [Axis::Y, Axis::Z, Axis::X],
        }
    }
}

/// How exactly the path is followed between moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathMode {
    /// G61: on the programmed path; slows down as far as corners demand, stops where they are sharp.
    ExactPath,
    /// G61.1: comes to rest at the end of every move.
    ExactStop,
    /// G64: corners may be rounded.
    Continuous {
        /// P: greatest distance from the programmed path, mm; `None`: best speed, no bound named by the program.
        tolerance_mm: Option<f64>,
        /// Q: tolerance of joining nearly collinear moves, mm; 0 switches it off.
        naive_cam_tolerance_mm: Option<f64>,
    },
}

/// Direction of spindle rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpindleDirection {
    /// M3.
    Clockwise,
    /// M4.
    Counterclockwise,
}

/// Units in which the program speaks; canonical calls are in mm all the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LengthUnit {
    /// G21.
    Millimetre,
    /// G20.
    Inch,
}

impl LengthUnit {
    /// Millimetres in one unit.
    pub const fn mm(self) -> f64 {
        match self {
            LengthUnit::Millimetre => 1.0,
            LengthUnit::Inch => 25.4,
        }
    }
}

/// What follows from the words of a block, in the order in which it happens.
#[derive(Clone, Debug, PartialEq)]
pub enum Call {
    /// G0: move at the machine's own speed.
    StraightTraverse {
        /// End point in work coordinates.
        to: Position,
    },
    /// G1: straight move at feed.
    StraightFeed {
        /// End point in work coordinates.
        to: Position,
    },
    /// G2, G3: arc or helix at feed; other axes turn evenly along.
    ArcFeed {
        /// End point in work coordinates.
        to: Position,
        /// Plane of the circle.
        plane: Plane,
        /// Centre on the first and second axis of the plane, work coordinates, mm.
        centre_mm: [f64; 2],
        /// Turns begun: positive counter-clockwise seen against the plane's normal, never 0. 1 and -1: less than or
        /// exactly one turn; each further unit adds a full one.
        turns: i32,
    },
    /// G4.
    Dwell {
        /// Seconds, not negative.
        seconds: f64,
    },
    /// Feed of the moves that follow: mm/s along XYZ if one of them moves, else along UVW, else deg/s.
    SetFeedRate {
        /// Units per second, greater than 0.
        per_second: f64,
    },
    /// G61, G61.1, G64.
    SetPathMode(PathMode),
    /// G17, G18, G19.
    SelectPlane(Plane),
    /// G20, G21; only for those who print what the program said.
    UseLengthUnit(LengthUnit),
    /// G54 to G59.3: origin of the active system in machine coordinates.
    SetG5xOffset {
        /// 1 for G54 to 9 for G59.3.
        system: u8,
        /// Origin in machine coordinates.
        origin: Position,
    },
    /// G92, G52.
    SetG92Offset {
        /// Shift inside the rotated system.
        offset: Position,
    },
    /// R of the active system: rotation of XY, degrees.
    SetXyRotation {
        /// Degrees, counter-clockwise.
        degrees: f64,
    },
    /// G43, G49: shift by the tool, machine directions.
    SetToolLengthOffset {
        /// Shift.
        offset: Position,
    },
    /// S.
    SetSpindleSpeed {
        /// Revolutions per minute, not negative.
        rpm: f64,
    },
    /// M3, M4.
    StartSpindle(SpindleDirection),
    /// M5.
    StopSpindle,
    /// M7 on, M9 off.
    Mist(bool),
    /// M8 on, M9 off.
    Flood(bool),
    /// T: the tool that the next change brings.
    SelectTool {
        /// Tool number, 0: none.
        tool: u32,
    },
    /// M6: bring the selected tool.
    ChangeTool {
        /// Tool number, 0: none.
        tool: u32,
    },
    /// (MSG, text).
    Message(String),
    /// Any other comment; of no effect.
    Comment(String),
    /// M0.
    ProgramStop,
    /// M1.
    OptionalProgramStop,
    /// M2, M30.
    ProgramEnd,
}

/// Place in the program text from which a call comes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Source {
    /// Line, counted from 1.
    pub line: u32,
    /// N-word of the block, if it has one.
    pub n: Option<u32>,
    /// Octets of the block in the text.
    pub start: u32,
    /// One past the last octet.
    pub end: u32,
}

/// A canonical call and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Place in the program.
    pub source: Source,
    /// What happens.
    pub call: Call,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_and_axes_are_one_to_one() {
        for axis in Axis::ALL {
            assert_eq!(Axis::from_letter(axis.letter()), Some(axis));
            assert_eq!(Axis::from_letter(axis.letter().to_ascii_lowercase()), Some(axis));
        }
        assert_eq!(Axis::from_letter('F'), None);
    }

    #[test]
    fn every_plane_is_right_handed() {
        for plane in [Plane::Xy, Plane::Zx, Plane::Yz] {
            let [first, second, normal] = plane.axes().map(|axis| axis as usize);
            assert_eq!(((first + 1) % 3, (first + 2) % 3), (second, normal));
        }
    }
}
