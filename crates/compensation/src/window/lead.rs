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
//! A lead is no longer than what lies between both places, or than 10 radii: else it is a part of a contour that crosses itself.
//! A contour that never comes back to itself is a wall from end to end, and one of several loops between its first and
//! last meeting. Each contour between two traverses or changes of depth is judged by itself.

use super::super::element::Element;
use super::super::geometry::{length, sub};
use super::conflict::{depth_between, meet};
use super::store::Store;
use super::{Mark, Wall};

/// Points no further apart than this are the same to who wrote the program, mm.
pub(super) const TOUCH_MM: f64 = 1e-3;

/// Moves with less of the contour between them than this are neighbours, mm.
pub(super) const NEIGHBOUR_MM: f64 = 0.1;

/// A lead may be longer than its contour up to so many radii.
const LEAD_RADII: f64 = 10.0;

/// A place of the contour: number of its wall, and part of this.
type Place = (u64, f64);

/// The first and the last place at which a contour meets itself.
#[derive(Clone, Copy, Debug)]
struct Meeting {
    first: Place,
    last: Place,
}

/// Where contours meet themselves, as far as it was asked for.
#[derive(Clone, Debug, Default)]
pub(super) struct Leads {
    /// The contour by its first wall, the number of walls there were when it was asked, the answer.
    last: Option<(u64, u64, Option<Meeting>)>,
}

impl Leads {
    /// What of a move of the contour is a wall; `None`: it is a lead.
    pub(super) fn wall(&mut self, walls: &mut Store<Wall>, wall: Wall) -> Option<Wall> {
        let Some(Meeting { first, last }) = self.meeting(walls, wall.run) else {
            return Some(wall);
        };
        if wall.number < first.0 || wall.number > last.0 {
            return None;
        }
        let from = if wall.number == first.0 { first.1 } else { 0.0 };
        let to = if wall.number == last.0 { last.1 } else { 1.0 };
        if from == 0.0 && to == 1.0 {
            return Some(wall);
        }
        if to <= from {
            return None; // the end of its neighbour
        }
        let part = [from, to];
        let element = wall.element.between(part);
        let depth = depth_between(wall.mark.depth, part);
        let mark = Mark { depth, ..wall.mark };
        Some(Wall { element, mark, ..wall })
    }

    fn meeting(&mut self, walls: &mut Store<Wall>, run: u64) -> Option<Meeting> {
        let end = walls.end();
        match self.last {
            Some((known, then, meeting)) if known == run && then == end => meeting,
            Some(_) | None => {
                let meeting = meeting(walls, run);
                self.last = Some((run, end, meeting));
                meeting
            }
        }
    }
}

/// Where the contour that begins with wall number `run` meets itself, if that makes leads of its ends.
fn meeting(walls: &mut Store<Wall>, run: u64) -> Option<Meeting> {
    let numbers = walls.numbers();
    let range = run.max(numbers.start)..numbers.end;
    let mut find = |number: u64| {
        let wall = *walls.get(number)?;
        let parts = (wall.run == run).then(|| touches(walls, &wall)).flatten()?;
        Some((wall, parts))
    };
    let (first, first_parts) = range.clone().find_map(&mut find)?;
    let (last, last_parts) = range.clone().rev().find_map(&mut find)?;
    let mm = |wall: &Wall, part: f64| wall.at_mm - wall.element.length() * (1.0 - part);
    let (from, to) = (mm(&first, first_parts[0]), mm(&last, last_parts[1]));
    let longest = (to - from).max(LEAD_RADII * walls.reach_mm());
    let of_run = |number: &u64| walls.get(*number).filter(|wall| wall.run == run);
    let start = of_run(&range.start).map_or(0.0, |wall| mm(wall, 0.0));
    let end = range
        .clone()
        .rev()
        .find_map(|number| of_run(&number))
        .map_or(0.0, |wall| wall.at_mm);
    // Whether what has left the window met anything is not known: then the start is no lead any more.
    let is_lead_in = run >= numbers.start && from - start <= longest;
    let is_lead_out = end - to <= longest;
    Some(Meeting {
        first: if is_lead_in {
            (first.number, first_parts[0])
        } else {
            (0, 0.0)
        },
        last: if is_lead_out {
            (last.number, last_parts[1])
        } else {
            (u64::MAX, 1.0)
        },
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
pub(super) fn is_closed(element: &Element) -> bool {
    element.arc.is_some_and(|arc| arc.sweep.abs() > 1.0) && length(sub(element.from, element.to)) <= TOUCH_MM
}
