//! The first move behind G41 or G42: from where the tool is to a point beside the end of the move.
//!
//! In:  the first programmed move.
//! Out: the move of the centre, held.

use motion::canon::{Call, Event, Plane};

use super::beside::Beside;
use super::contour::{Contour, Shape};
use super::geometry::{Curve, add, dot, left, length, scale, sub, unit};
use super::held::{Held, Start};
use super::window::{Mark, Part};
use super::{CompensationErrorKind as Kind, Settings, Tool};

/// Leads the tool to the contour.
///
/// ```text
///              o  end: beside the end of the move, square to it
///        . '   |
///   o----------x-------   programmed move
///   start
/// ```
pub(super) fn enter(
    tool: Tool,
    settings: Settings,
    plane: Plane,
    first: &Contour,
    mut event: Event,
    mark: Mark,
) -> Result<Beside, Kind> {
    let Tool { side, radius, .. } = tool;
    let distance = length(sub(first.to, first.from));
    if distance <= radius {
        return Err(Kind::EntryTooShort {
            length_mm: distance,
            radius_mm: radius,
            plane,
        });
    }
    let tangent = first.tangent_at_end();
    let normal = scale(left(tangent), side);
    let end = add(first.to, scale(normal, radius));
    let held = match first.shape {
        Shape::Line => Held::line(Curve::Line { through: end, tangent }, first.from, Start::Entry, end),
        Shape::Arc { centre, turns } => {
            let arc_mm = length(sub(first.from, centre));
            if first.is_around_tool(side) && arc_mm <= radius {
                return Err(Kind::ArcTooTight {
                    arc_mm,
                    radius_mm: radius,
                });
            }
            // The centre's arc ends along the contour, so that its own centre lies on the programmed radius through the end,
            // as far from there as from the start: |start - end - d towards|² = d²
            let (chord, towards) = (sub(first.from, end), unit(sub(centre, end)));
            let radius_mm = dot(chord, chord) / (2.0 * dot(chord, towards));
            // The start has to lie on the tool's side of the line along which the tool ends: `height` above it.
            //
            //       .  start                 the arc ends here, to the right
            //        '-._
            //            '--o--------
            if !(radius_mm > 0.0 && radius_mm < MAX_RADIUS_MM) {
                return Err(Kind::EntryArcTooFlat {
                    height_mm: dot(sub(first.from, first.to), normal),
                    radius_mm: radius,
                });
            }
            let centre = add(end, scale(towards, radius_mm));
            if let Call::ArcFeed { centre_mm, .. } = &mut event.call {
                *centre_mm = centre;
            }
            let curve = Curve::Circle {
                centre,
                radius: radius_mm,
                turn: first.shape.turn_sign(),
            };
            Held::arc(curve, first.from, first.from, Start::Entry, end, turns)
        }
    };
    let part = match event.call {
        Call::StraightFeed { .. } | Call::ArcFeed { .. } => Part::Link(mark, first.to),
        _ => Part::Free,
    };
    Ok(Beside {
        tool,
        settings,
        normal,
        before_tool: first.is_before_tool(side),
        held,
        queue: vec![(event, part)],
        mark,
    })
}

/// An entry arc flatter than this is none, mm.
const MAX_RADIUS_MM: f64 = 1e9;
