//! What the tool does at the corner between two moves of the contour.
//!
//! In:  the directions of the contour before and behind the corner, and what goes on there.
//! Out: on smoothly, around the vertex, or cut at the crossing of the two paths of the centre.
//!
//! ```text
//!   outer corner, bend > 0       inner corner, bend < 0        (tool on the left, o: its centre)
//!
//!   o-----o.                          |   o
//!  -------. \                         |   |
//!         |  o                   o----+---o  cut where the paths of the centre cross
//!         |  |                   -----.   |
//! ```

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::contour::{Contour, Shape};
use super::geometry::{Point, angle};

/// Corners that bend by no more than this are passed as if they were none, rad. LinuxCNC's value.
pub(super) const SMOOTH_RAD: f64 = 0.05;

/// Kind of a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Join {
    /// No corner worth the name.
    Smooth,
    /// Outer corner: the tool rolls around the vertex.
    Around,
    /// Inner corner: the path before it ends where the path behind it begins.
    Cut,
    /// Inner corner passed by both paths to their ends, with an arc about the vertex between them: a loop to be dropped.
    Inside,
}

/// Judges the corner between a move that arrives along `tangent` and the move `next`; `arriving_before_tool`: the one that
/// arrives is an arc with the tool on its outside.
/// Second: by how much the contour bends away from the tool there, rad.
pub(super) fn join(tangent: Point, arriving_before_tool: bool, next: &Contour, side: f64) -> (Join, f64) {
    // How far the contour bends away from the tool. A turn towards it by more than a right angle cannot be told from a turn
    // away by the rest of a full one; it counts from -90 to 270 degrees, so that a reversal is an outer corner.
    let bend = (-side * angle(tangent, next.tangent_at_start()) + FRAC_PI_2).rem_euclid(TAU) - FRAC_PI_2;
    // Where an arc that bulges towards the tool meets its neighbour in a cusp, rolling around the point of the cusp would be a
    // loop through the material behind; there is an inner corner between the arc and the neighbour instead.
    //    __
    //   /  \ |     tool above: over the top from the left, then up along the wall
    //  |    \|
    let cusp = match next.shape {
        Shape::Line => arriving_before_tool,
        Shape::Arc { .. } => next.is_before_tool(side),
    };
    let join = if !(-SMOOTH_RAD..=PI + SMOOTH_RAD).contains(&bend) || (cusp && bend > PI - SMOOTH_RAD) {
        Join::Cut
    } else if bend > SMOOTH_RAD {
        Join::Around
    } else {
        Join::Smooth
    };
    (join, bend)
}
