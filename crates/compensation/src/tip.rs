//! The tip of a lathe tool: where its centre is, seen from the point that the machine controls.
//!
//! In:  the orientation of the cutting edge, the nose radius, the plane.
//! Out: the shift between both points.
//!
//! A lathe tool is measured by touching the part along X and along Z. That makes the controlled point the corner of the square
//! around the round nose, or the middle of one of its sides, as the orientation says; orientation 9 and 0 (no lathe tool) have it
//! at the nose's centre:
//!
//! ```text
//!        2 6 1     ^ X   6: the tip's -X side, 5: +Z side, and so on; 0, 9: the centre itself
//!        7 9 5     |
//!        3 8 4     +--> Z
//! ```
//!
//! Without compensation the controlled point goes along the contour, so that cylinders and faces come out right, cones and arcs
//! too large. With G41 or G42 the *centre of the nose* goes beside the contour at the distance of its radius, and the events
//! tell the controlled point, the same shift away everywhere. The entry begins and the exit ends with the controlled point
//! on the programmed point, as in LinuxCNC.

use motion::canon::{Call, Plane, Position};

use super::geometry::{Point, add};
use super::{in_plane, with_plane};

/// From the nose's centre to the controlled point, on the plane's axes. Only in the ZX plane: lathes do not turn in XY.
pub(super) fn shift(orientation: u8, radius: f64, plane: Plane) -> Point {
    if plane != Plane::Zx {
        return [0.0; 2];
    }
    let z = match orientation {
        1 | 4 | 5 => radius,
        2 | 3 | 7 => -radius,
        _ => 0.0,
    };
    let x = match orientation {
        3 | 4 | 8 => radius,
        1 | 2 | 6 => -radius,
        _ => 0.0,
    };
    [z, x]
}

/// The move that brings the controlled point to where the nose's centre stands, at `at`, so that an entry arc is one.
/// Rotary axes and UVW turn here already to where the arc goes, as in LinuxCNC.
pub(super) fn start_of_arc(at: &Position, arc_to: &Position, plane: Plane, shift: Point) -> Call {
    let mut to = *arc_to;
    for axis in plane.axes() {
        to[axis] = at[axis];
    }
    let tip = add(in_plane(&to, plane), shift);
    Call::StraightFeed {
        to: with_plane(to, plane, tip),
    }
}
