//! Axes, positions and planes.

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
    /// The origin: every axis at 0.
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
    /// G17.1: U first, V second, W normal.
    Uv,
    /// G18.1: W first, U second, V normal.
    Wu,
    /// G19.1: V first, W second, U normal.
    Vw,
}

impl Plane {
    /// First, second and normal axis; an angle counts from the first towards the second.
    pub const fn axes(self) -> [Axis; 3] {
        match self {
            Plane::Xy => [Axis::X, Axis::Y, Axis::Z],
            Plane::Zx => [Axis::Z, Axis::X, Axis::Y],
            Plane::Yz => [Axis::Y, Axis::Z, Axis::X],
            Plane::Uv => [Axis::U, Axis::V, Axis::W],
            Plane::Wu => [Axis::W, Axis::U, Axis::V],
            Plane::Vw => [Axis::V, Axis::W, Axis::U],
        }
    }
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
        for plane in [Plane::Xy, Plane::Zx, Plane::Yz, Plane::Uv, Plane::Wu, Plane::Vw] {
            let [first, second, normal] = plane.axes().map(|axis| axis as usize % 6);
            assert_eq!(((first + 1) % 3, (first + 2) % 3), (second % 3, normal % 3));
        }
    }
}
