//! What can be chosen about compensation.

/// How the tool goes around outer corners.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Corner {
    /// It rolls around the vertex by an arc, as in LinuxCNC.
    #[default]
    Arc,
    /// It goes straight on to where the paths beside the two moves meet, or their tangents where these are arcs; the vertex
    /// stays sharp, as the tool leaves it.
    Intersection {
        /// Corners that bend by more than this are passed by an arc all the same, degrees, below 180: the point of a sharp
        /// corner is far away.
        limit_degrees: f64,
    },
}

impl Corner {
    /// Bend up to which an intersection is sensible: a square corner with room for rounding; the way to its point and back is
    /// 2.4 radii.
    pub const LIMIT_DEGREES: f64 = 100.0;
}

/// What happens where the tool would cut into another part of the contour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Gouge {
    /// An error that names both moves. A cut less deep than the tolerance of G64 (a tenth of the tool's radius at the most) is
    /// none, and among closed rings inside each other, all followed in the same direction, only the last one outwards in a
    /// pocket, or inwards around an island, is a wall: the others are steps of clearing.
    #[default]
    Error,
    /// The tool leaves out what it cannot reach: its path goes on where it crosses itself. Material remains there.
    DropLoop,
    /// Only neighbouring moves are compared, as in LinuxCNC: for a comparison with it, not for a machine.
    NeighboursOnly,
}

/// How compensation treats corners and what the tool cannot reach.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// How the tool goes round outer corners.
    pub corner: Corner,
    /// Cuts into the contour.
    pub gouge: Gouge,
    /// Events that were held back get the N-word of the block that lets them go, which is what LinuxCNC's `rs274` prints.
    pub number_by_release: bool,
}
