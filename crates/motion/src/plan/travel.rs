//! Whether a piece of path stays inside travel and reach.
//!
//! In:  pieces, as they are programmed or as a stage of smoothing would have them; travel of axes and joints.
//! Out: nothing, or the axis or joint that would leave its travel.
//!
//! A programmed move that leaves the travel is an error. A stage of smoothing asks of every piece that it makes: what is not
//! [`inside`] is not taken, and the stage does with less of the tolerance, with fewer moves, or leaves them as they are. So
//! what is run is inside, and known to be before anything moves.
//!
//! Axes are judged by the extremes of their polynomials; far from a limit, which is nearly always, by their Bézier points.
//! Joints that are not axes are [`JointSpace`](super::JointSpace)'s.

use super::{AxisLimits, JointSpace, PlanErrorKind, Settings};
use crate::canon::{AXES, Axis};
use crate::kinematics::ToolFrame;
use crate::path::{Piece, Shape};

/// What rounding adds to a position programmed at the limit is no excess, mm or degrees: half of the last digit that is shown, more
/// than the last one of inches that post-processors write.
pub const TRAVEL_TOLERANCE: f64 = 0.0005;
/// The same of what smoothing makes. It begins and ends on what is programmed.
const SMOOTHED_ROUNDING: f64 = 5e-10;

/// Whether every axis of a programmed piece exists, and all axes and joints stay inside their travel along it; it begins inside.
pub(super) fn check(piece: &Piece, settings: &Settings) -> Result<(), PlanErrorKind> {
    check_axes(piece, &settings.axes)?;
    if axes_count(piece.frame(), settings) {
        check_travel(piece, &settings.axes)?;
    }
    joints(piece.frame(), settings).map_or(Ok(()), |joints| joints.check(piece, TRAVEL_TOLERANCE))
}

/// Whether all axes and joints stay inside their travel along a piece that smoothing has made. Its frame is that of the moves
/// from which it was made.
pub(super) fn inside(piece: &Piece, settings: &Settings) -> bool {
    beyond(piece, settings).is_none()
        && joints(piece.frame(), settings).is_none_or(|joints| joints.check(piece, SMOOTHED_ROUNDING).is_ok())
}

/// By how much each axis is below and above its travel along a piece; `None`: not at all.
fn beyond(piece: &Piece, settings: &Settings) -> Option<[[f64; 2]; AXES]> {
    if !axes_count(piece.frame(), settings) {
        return None;
    }
    let moving = match piece.shape() {
        Shape::Blend(blend) => blend.axes(),
        Shape::Line(_) | Shape::Arc(_) => AXES,
    };
    let mut beyond = [[0.0; 2]; AXES];
    let mut any = false;
    for (axis, limits) in settings.axes[..moving].iter().enumerate() {
        let Some(AxisLimits {
            travel: [low, high], ..
        }) = limits
        else {
            continue;
        };
        let of = |(least, most): (f64, f64)| [low - least, most - high];
        let is_beyond = |excess: [f64; 2]| excess.iter().any(|excess| *excess > SMOOTHED_ROUNDING);
        if !is_beyond(of(hull(piece, axis))) {
            continue;
        }
        let excess = of(reach(piece, axis));
        if is_beyond(excess) {
            beyond[axis] = excess.map(|excess| excess.max(0.0));
            any = true;
        }
    }
    any.then_some(beyond)
}

/// Bounds of the position of an axis on the whole of the shape of a piece, at next to no cost.
fn hull(piece: &Piece, axis: usize) -> (f64, f64) {
    match piece.shape() {
        Shape::Line(_) => reach(piece, axis),
        Shape::Arc(arc) => arc.hull(axis),
        Shape::Blend(blend) => blend.hull(axis),
    }
}

/// Least and greatest position of an axis on the whole of the shape of a piece.
pub(super) fn reach(piece: &Piece, axis: usize) -> (f64, f64) {
    match piece.shape() {
        Shape::Line(_) => {
            let [from, to] = [0.0, piece.length()].map(|s| piece.position(s).0[axis]);
            (from.min(to), from.max(to))
        }
        Shape::Arc(arc) => arc.reach(axis),
        Shape::Blend(blend) => blend.reach(axis),
    }
}

/// The travel of the axes as a stage aims for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Walls(
    /// Low and high, by axis.
    pub(super) [[f64; 2]; AXES],
);

impl Walls {
    pub(super) fn new(settings: &Settings) -> Walls {
        Walls(
            settings
                .axes
                .map(|limits| limits.map_or([f64::NEG_INFINITY, f64::INFINITY], |limits| limits.travel)),
        )
    }

    /// Draws them in by what pieces are beyond the travel, and some more; `false`: none is beyond that of an axis.
    pub(super) fn draw_in<'p>(&mut self, pieces: impl Iterator<Item = &'p Piece>, settings: &Settings) -> bool {
        /// What is aimed for is not all that a fit looks at.
        const MORE: f64 = 1.25;
        let mut by = [[0.0f64; 2]; AXES];
        let mut any = false;
        for beyond in pieces.filter_map(|piece| beyond(piece, settings)) {
            any = true;
            by = std::array::from_fn(|axis| [0, 1].map(|end| by[axis][end].max(MORE * beyond[axis][end])));
        }
        for ([low, high], [below, above]) in self.0.iter_mut().zip(by) {
            *low += below;
            *high -= above;
        }
        any
    }

    /// The same, all of them drawn in by so much.
    pub(super) fn drawn_in(&self, by: f64) -> Walls {
        Walls(self.0.map(|[low, high]| [low + by, high - by]))
    }

    /// The place between them next to `q`.
    pub(super) fn between(&self, q: &[f64; AXES]) -> [f64; AXES] {
        std::array::from_fn(|axis| q[axis].max(self.0[axis][0]).min(self.0[axis][1]))
    }
}

/// Whether the travel of the axes counts: with tool-centre-point control it is that of joints which they are without it.
fn axes_count(frame: &ToolFrame, settings: &Settings) -> bool {
    !(frame.tcp && joints(frame, settings).is_some())
}

/// The joints where they do not just follow their axes.
fn joints<'s>(frame: &ToolFrame, settings: &'s Settings) -> Option<&'s JointSpace> {
    settings
        .joints
        .as_ref()
        .filter(|joints| !joints.kinematics.is_trivial(frame))
}

/// Whether every axis that moves along `piece` exists.
fn check_axes(piece: &Piece, limits: &[Option<AxisLimits>; AXES]) -> Result<(), PlanErrorKind> {
    let (start, end) = (piece.position(0.0), piece.position(piece.length()));
    let moved = |axis: &Axis| {
        // An arc computes its end by trigonometry, so that an axis at rest may show rounding.
        let k = *axis as usize;
        limits[k].is_none() && (end.0[k] - start.0[k]).abs() > 1e-9
    };
    match Axis::ALL.into_iter().find(moved) {
        Some(axis) => Err(PlanErrorKind::NoSuchAxis { axis }),
        None => Ok(()),
    }
}

/// Whether every axis stays inside its travel all along `piece`, which begins inside.
fn check_travel(piece: &Piece, limits: &[Option<AxisLimits>; AXES]) -> Result<(), PlanErrorKind> {
    let end = piece.position(piece.length());
    for axis in Axis::ALL {
        let k = axis as usize;
        let Some(limits) = limits[k] else { continue };
        within(axis, end.0[k], &limits)?;
        let both = |(low, high)| within(axis, low, &limits).and(within(axis, high, &limits));
        if matches!(piece.shape(), Shape::Line(_)) || both(hull(piece, k)).is_ok() {
            continue;
        }
        both(reach(piece, k))?;
    }
    Ok(())
}

fn within(axis: Axis, value: f64, limits: &AxisLimits) -> Result<(), PlanErrorKind> {
    let [low, high] = limits.travel;
    let limit = if value < low - TRAVEL_TOLERANCE {
        low
    } else if value > high + TRAVEL_TOLERANCE {
        high
    } else {
        return Ok(());
    };
    Err(PlanErrorKind::Travel { axis, value, limit })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canon::Position;
    use crate::path::Circle;

    #[test]
    fn rounding_of_the_program_is_no_excess_and_more_than_that_is_shown() {
        let limits = AxisLimits {
            velocity: 1.0,
            acceleration: 1.0,
            jerk: 1.0,
            travel: [-305.0, 305.0],
        };
        // 11.22048 inches are 285.0002 mm, 20 mm from the origin.
        for value in [20.0 + 11.22048 * 25.4, 305.000499, -305.000499] {
            assert_eq!(within(Axis::X, value, &limits), Ok(()), "{value}");
        }
        for (value, limit) in [(305.000501, 305.0), (-305.000501, -305.0)] {
            let error = within(Axis::X, value, &limits).unwrap_err();
            assert_eq!(
                error,
                PlanErrorKind::Travel {
                    axis: Axis::X,
                    value,
                    limit
                }
            );
            let (shown, end) = (format!("{value:.4}"), format!("{limit:.4}"));
            assert!(shown != end && error.to_string().contains(&shown), "{error}");
        }
    }

    #[test]
    fn an_arc_may_leave_the_travel_between_its_ends() {
        let limits = |travel| AxisLimits {
            velocity: 1.0,
            acceleration: 1.0,
            jerk: 1.0,
            travel,
        };
        let mut axes = [None; AXES];
        axes[0] = Some(limits([-20.0, 20.0]));
        axes[1] = Some(limits([-20.0, 4.9]));
        // Half a turn counter-clockwise from (5, 0) to (-5, 0) rises to Y5.
        let circle = Circle {
            start: Position::xyz(5.0, 0.0, 0.0),
            end: Position::xyz(-5.0, 0.0, 0.0),
            centre_mm: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            sweep_rad: std::f64::consts::PI,
        };
        let piece = Piece::arc(&circle).unwrap();
        let PlanErrorKind::Travel { axis, value, limit } = check_travel(&piece, &axes).unwrap_err() else {
            panic!("travel expected");
        };
        assert_eq!((axis, limit), (Axis::Y, 4.9));
        assert!((value - 5.0).abs() < 1e-12);
        axes[1] = Some(limits([-20.0, 5.0]));
        assert_eq!(check_travel(&piece, &axes), Ok(()));
        axes[0] = None;
        assert_eq!(
            check_axes(&piece, &axes),
            Err(PlanErrorKind::NoSuchAxis { axis: Axis::X })
        );
    }
}
