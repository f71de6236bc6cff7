//! Leads: how a contour begins and ends.
//!
//! In:  the moves of the contour in the window.
//! Out: which of them is a wall, and where it ends.
//!
//! Contours are entered and left by moves that are compensated like the rest, but bound nothing: tangent lines and arcs, and
//! edges that go on past a corner.
//!
//! ```text
//!               |     |            o: first place at which the contour comes to where it is again later, and the last one
//!               |     |
//!   lead-in ----o-----'            The moves before the first and behind the last are no walls. The tool may cut through
//!               |                  them; beside them it must not cut into the rest.
//!            lead-out
//! ```
//!
//! A contour that never comes back to itself is a wall from end to end, and one of several loops between its first and
//! last meeting. Each contour between two traverses or changes of depth is judged by itself.

use super::super::element::Element;
use super::super::geometry::{length, sub};
use super::conflict::meet;
use super::store::Store;
use super::{Suspect, Wall};

/// Points no further apart than this are the same to who wrote the program, mm.
const TOUCH_MM: f64 = 1e-3;

/// Moves with less of the contour between them than this are neighbours, mm.
const NEIGHBOUR_MM: f64 = 0.1;

/// A place of the contour: number of its wall, and part of this.
type Place = (u64, f64);

/// The first and the last place at which a contour meets itself.
#[derive(Clone, Copy, Debug)]
struct Meeting {
    first: Place,
    last: Place,
}

/// Whether the wall of a suspect is one at the place in question.
pub(super) fn is_wall(walls: &mut Store<Wall>, suspect: &Suspect, still_cuts: impl FnOnce(&Wall) -> bool) -> bool {
    let wall = suspect.wall;
    let Some(Meeting { first, last }) = meeting(walls, wall.run) else {
        return true;
    };
    if wall.number < first.0 || wall.number > last.0 {
        return false;
    }
    let from = if wall.number == first.0 { first.1 } else { 0.0 };
    let to = if wall.number == last.0 { last.1 } else { 1.0 };
    if from == 0.0 && to == 1.0 {
        return true;
    }
    let element = wall.element.between([from, to.max(from)]);
    still_cuts(&Wall { element, ..wall })
}

/// Where the contour that begins with wall number `run` meets itself.
fn meeting(walls: &mut Store<Wall>, run: u64) -> Option<Meeting> {
    let numbers = walls.numbers();
    let range = run.max(numbers.start)..numbers.end;
    let mut find = |number: u64| {
        let wall = *walls.get(number)?;
        (wall.run == run).then(|| touches(walls, &wall)).flatten()
    };
    let (number, parts) = range.clone().find_map(|number| Some((number, find(number)?)))?;
    // What has left the window was not told to meet anything; the start is no lead any more.
    let first = if run < numbers.start {
        (0, 0.0)
    } else {
        (number, parts[0])
    };
    let (number, parts) = range.rev().find_map(|number| Some((number, find(number)?)))?;
    Some(Meeting {
        first,
        last: (number, parts[1]),
    })
}

/// The first and the last part of the way of a wall at which its contour is there again.
fn touches(walls: &mut Store<Wall>, wall: &Wall) -> Option<[f64; 2]> {
    let mut parts = [f64::INFINITY, f64::NEG_INFINITY];
    let element = wall.element;
    if is_closed(&element) {
        parts = [0.0, 1.0];
    }
    walls.near(&element, |other| {
        let (earlier, later) = if other.number < wall.number {
            (other, wall)
        } else {
            (wall, other)
        };
        let between = later.at_mm - later.element.length() - earlier.at_mm;
        if other.run == wall.run && between > NEIGHBOUR_MM && meet(&other.mark, &wall.mark) {
            element.candidates(&other.element, |at, there| {
                if length(sub(at, there)) <= TOUCH_MM {
                    let part = element.part_at(at);
                    parts = [parts[0].min(part), parts[1].max(part)];
                }
            });
        }
        None::<()>
    });
    (parts[0] <= parts[1]).then_some(parts)
}

/// Whether an element is a circle, or more.
fn is_closed(element: &Element) -> bool {
    element.arc.is_some_and(|arc| arc.sweep.abs() > 1.0) && length(sub(element.from, element.to)) <= TOUCH_MM
}
