//! Look-ahead: does the tool, beside one part of the contour, cut into another part?
//!
//! In:  the contour, move by move as programmed, and what is made of it: events, among them the moves of the centre.
//! Out: the same events, in the same order, as soon as enough of the contour behind them is known; or the first gouge.
//!
//! ```text
//!   out   <---  [ moves of the centre that wait ]  <---  moves made from the corners
//!                    ^ compared with ^
//!   gone  <---  [ contour behind | contour ahead ]  <---  programmed
//! ```
//!
//! **What is compared.** Each move of the centre with each move of the contour in the window: it must not come closer than the
//! radius, less the path's tolerance (G64 P, or [`PATH_TOLERANCE_MM`]; a tenth of the radius at the most). Contour that the tool touches on both sides at once, slots exactly as wide as the tool and
//! contours that end along their own start are no gouges.
//!
//! **How far.** A move waits until the contour behind it is 2 radii long, which is what the tool can reach without leaving
//! its place, *and* has [`AHEAD`] moves, which finds slots, islands and combs; or until compensation ends. The contour
//! behind a move is kept as long. Memory is bounded by that, and a start waits for as many lines to be read.
//!
//! **At which depth.** Moves count whose ways along the plane's normal overlap or come closer than [`DEPTH_TOLERANCE_MM`],
//! with the other axes in the same place. Of slanted moves and helices only what comes too close counts, where the end of the
//! tool is not above the wall, and not what a later contour has above the tool: both are in the air. A mill is a cylinder, and would cut a wall above its end too; but whether there is
//! a wall at another depth the contour does not tell: a pocket in the floor of a pocket, a boss on a boss and roughing in
//! steps are programs that look the same as a collision.
//!
//! **What is no contour.** What leads to a closed contour and away from it is no wall (`lead.rs`). Whether a move is such a lead
//! shows later, so that a gouge is a suspicion until compensation ends or its first move has to go. Traverses cut nothing: they are no wall, and are not compared. The entry and exit moves are no
//! walls; at feed they are compared with the contour, but for what of it is within 2 radii of the point where they join
//! it: LinuxCNC's entry is slanted there and its exit leaves from beside the end, whatever corner a closed contour has there.
//!
//! **One contour after the other**, with a traverse or a change of depth between them, are passes: what a later one cuts off an earlier
//! one was left for it, as roughing does and passes of a lathe cycle (G70 P). Where both cross, or the earlier pass cuts into the
//! later contour, it is a gouge: the later one is what is to stay.
//!
//! **Rings inside each other** that go round in the same direction are steps of clearing but for the last, which alone keeps
//! something (`rings.rs`).
//!
//! **Corners that count as flat** (`join.rs`) bring the tool a little closer, by less than 1.3 thousandths of the radius;
//! twice that is allowed between moves with nothing but such corners between them.

mod conflict;
mod lead;
mod loops;
mod rings;
mod store;

use std::collections::{BTreeMap, VecDeque};

use motion::canon::{Event, Plane, Source};

use super::CompensationErrorKind as Kind;
use super::element::{Closest, Element};
use super::geometry::{Point, length, sub};
use super::{Gouge, Tool};
use conflict::conflict;
use lead::Leads;
use rings::Rings;
use store::Store;

/// How much closer than the radius rounding may bring the contour, mm.
pub(super) const TOLERANCE_MM: f64 = 1e-6;

/// Least tolerance of a path: what the numbers of programs are rounded to, mm.
pub(super) const PATH_TOLERANCE_MM: f64 = 1e-3;

/// Depths that differ by no more than this are the same, mm.
pub(super) const DEPTH_TOLERANCE_MM: f64 = 1e-3;

/// Moves of the contour known ahead of a move that goes out.
pub const AHEAD: usize = 1 << 14;

/// Most events that wait. Only a contour with more events within 2 radii gets there.
pub(super) const WAITING_LIMIT: usize = 1 << 18;

/// What moves have in common with the moves of the contour that they belong to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Mark {
    pub(super) source: Source,
    /// Numbers of the moves of the contour: the same twice, or the two at a corner.
    pub(super) walls: [u64; 2],
    /// Coordinate on the plane's normal at the start and at the end, mm.
    pub(super) depth: [f64; 2],
    /// How far the path may be from the programmed one: a cut no deeper is none, mm.
    pub(super) tolerance_mm: f64,
    /// Differs where axes out of the three of the plane stand elsewhere.
    pub(super) pose: u32,
    /// Moves with nothing but flat corners between them have the same.
    pub(super) chain: u32,
    /// Greatest bend of a flat corner in the chain up to here, rad.
    pub(super) bend: f64,
}

impl Mark {
    /// Those at the corner before the move.
    pub(super) fn walls_at_corner(&self) -> [u64; 2] {
        let [next, _] = self.walls;
        [next.saturating_sub(1), next]
    }
}

/// What an event is to the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    /// Nothing to compare: no move, or one that cuts nothing.
    Free,
    /// A move beside the contour, around a corner, or at one in other axes.
    Beside(Mark),
    /// Entry or exit at feed, with the programmed point at which it joins the contour.
    Link(Mark, Point),
}

/// A move of the contour.
#[derive(Clone, Copy, Debug)]
struct Wall {
    number: u64,
    /// Number of the first one of its contour.
    run: u64,
    element: Element,
    mark: Mark,
    /// Length of the contour at its end.
    at_mm: f64,
}

/// A move of the centre.
#[derive(Clone, Copy, Debug)]
struct Track {
    element: Element,
    mark: Mark,
    joint: Option<Point>,
    /// That of the contour.
    run: u64,
    /// Number of its event.
    event: u64,
    /// Length of the contour at which it came.
    at_mm: f64,
    /// Number of walls at which it came.
    walls: u64,
}

/// An event that waits.
#[derive(Clone, Debug)]
struct Waiting {
    event: Event,
    at_mm: f64,
    walls: u64,
}

/// See the [module](self).
#[derive(Clone, Debug)]
pub(super) struct Window {
    plane: Plane,
    radius: f64,
    shift: Point,
    walls: Store<Wall>,
    tracks: Store<Track>,
    waiting: VecDeque<Waiting>,
    /// Number of events that went.
    gone: u64,
    /// Moves of the centre that come too close to a move of the contour, if that is a wall, by the numbers of their events.
    suspects: BTreeMap<u64, Track>,
    leads: Leads,
    rings: Rings,
    /// All waits until the end of compensation, when loops are dropped.
    collects: bool,
    /// Number of the first wall of the contour under way.
    run: u64,
    /// Length of the contour so far, mm.
    at_mm: f64,
}

impl Window {
    pub(super) fn new(plane: Plane, tool: Tool, gouge: Gouge) -> Window {
        let Tool { side, radius, shift } = tool;
        Window {
            plane,
            radius,
            shift,
            walls: Store::new(radius),
            tracks: Store::new(radius),
            waiting: VecDeque::new(),
            gone: 0,
            suspects: BTreeMap::new(),
            leads: Leads::default(),
            rings: Rings::new(side),
            collects: gouge == Gouge::DropLoop,
            run: 0,
            at_mm: 0.0,
        }
    }

    pub(super) fn plane(&self) -> Plane {
        self.plane
    }

    pub(super) fn shift(&self) -> Point {
        self.shift
    }

    /// Number of the next move of the contour.
    pub(super) fn next_wall(&self) -> u64 {
        self.walls.end()
    }

    /// Number of events that wait.
    pub(super) fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Another contour begins: a traverse or a change of depth lies between.
    pub(super) fn separate(&mut self) {
        self.run = self.walls.end();
    }

    /// Takes a move of the contour.
    pub(super) fn wall(&mut self, element: Element, mark: Mark) {
        self.at_mm += element.length();
        let wall = Wall {
            number: self.walls.end(),
            run: self.run,
            element,
            mark,
            at_mm: self.at_mm,
        };
        if self.collects {
            self.walls.push(&element, wall);
            return;
        }
        let (radius, suspects) = (self.radius, &mut self.suspects);
        self.tracks.near(&element, |track| {
            if !suspects.contains_key(&track.event) && conflict(track, &wall, radius).is_some() {
                suspects.insert(track.event, *track);
            }
            None::<()>
        });
        self.walls.push(&element, wall);
        self.forget();
    }

    /// Takes an event.
    pub(super) fn push_event(&mut self, event: Event) -> Result<(), Kind> {
        let (at_mm, walls) = (self.at_mm, self.walls.end());
        self.waiting.push_back(Waiting { event, at_mm, walls });
        if self.waiting.len() > WAITING_LIMIT {
            return Err(Kind::TooManyHeld { limit: WAITING_LIMIT });
        }
        Ok(())
    }

    /// Takes the way of the centre of the event taken last.
    pub(super) fn compare(&mut self, part: Part, element: Element) {
        let (at_mm, walls) = (self.at_mm, self.walls.end());
        let (mark, joint) = match part {
            Part::Free => return,
            Part::Beside(mark) => (mark, None),
            Part::Link(mark, joint) => (mark, Some(joint)),
        };
        // That of the event taken last.
        let event = (self.gone + self.waiting.len() as u64).saturating_sub(1);
        let track = Track {
            element,
            mark,
            joint,
            run: self.run,
            event,
            at_mm,
            walls,
        };
        if !self.collects {
            let radius = self.radius;
            let meets = |wall: &Wall| conflict(&track, wall, radius).map(|_| ());
            if self.walls.near(&element, meets).is_some() {
                self.suspects.insert(event, track);
            }
        }
        self.tracks.push(&element, track);
    }

    /// Looks into the suspicions about events up to number `last`.
    pub(super) fn judge(&mut self, last: u64) -> Result<(), Kind> {
        while let Some(suspect) = self.suspects.first_entry().filter(|suspect| *suspect.key() <= last) {
            let track = suspect.remove();
            let wall = self.gouged(&track).into_iter().next();
            if let Some(gouge) = wall.and_then(|wall| self.gouge_of(&track, &wall)) {
                return Err(gouge);
            }
        }
        Ok(())
    }

    /// The walls into which the tool cuts, in the order of the program.
    fn gouged(&mut self, track: &Track) -> Vec<Wall> {
        let (mut close, radius) = (Vec::new(), self.radius);
        self.walls.near(&track.element, |wall| {
            if conflict(track, wall, radius).is_some() {
                close.push(*wall);
            }
            None::<()>
        });
        close.sort_by_key(|wall| wall.number);
        close.retain(|wall| !self.is_of_an_earlier_pass(track, wall) && !self.begins_where_it_came_from(track, wall));
        close.retain(|wall| !self.rings.is_cleared(&mut self.walls, track, wall));
        let walls = close.into_iter();
        let walls = walls.filter_map(|wall| self.leads.wall(&mut self.walls, wall));
        walls.filter(|wall| conflict(track, wall, radius).is_some()).collect()
    }

    /// Whether a wall belongs to a contour before that of a move, and both do not cross: what the later one cuts off there was left
    /// for it.
    fn is_of_an_earlier_pass(&self, track: &Track, wall: &Wall) -> bool {
        let [own, _] = track.mark.walls;
        // The last move of a contour is made when the next one has begun.
        let run = self.walls.get(own).map_or(track.run, |own| own.run);
        // Not only at an end: passes often come from one place and end at one.
        let inside = |element: &Element, at: Point| {
            [element.from, element.to]
                .iter()
                .all(|end| length(sub(*end, at)) > PATH_TOLERANCE_MM)
        };
        let crosses = |number: &u64| {
            let own = self.walls.get(*number).map(|own| own.element);
            own.is_some_and(|own| {
                let mut crossings = own.crossings(&wall.element);
                crossings.any(|at| inside(&own, at) && inside(&wall.element, at))
            })
        };
        track.joint.is_none() && wall.run < run && !track.mark.walls.iter().any(crosses)
    }

    /// Whether a wall is how a later pass comes from where the tool stood before the first: what is there is air.
    fn begins_where_it_came_from(&self, track: &Track, wall: &Wall) -> bool {
        let from = [&track.element, &wall.element].map(|element| element.from);
        track.joint.is_some()
            && wall.number == wall.run
            && wall.run > track.run
            && length(sub(from[0], from[1])) < self.radius
    }

    fn gouge_of(&self, track: &Track, wall: &Wall) -> Option<Kind> {
        let Closest { distance, other, .. } = conflict(track, wall, self.radius)?;
        Some(Kind::Gouge {
            tool: track.mark.source,
            contour: wall.mark.source,
            missing_mm: self.radius - distance,
            radius_mm: self.radius,
            at_mm: other,
            plane: self.plane,
        })
    }

    /// Compensation ends: all that is known of the contour is known.
    pub(super) fn end(&mut self) -> Result<(), Kind> {
        if self.collects {
            self.collects = false;
            loops::drop_loops(self)?;
        }
        self.judge(u64::MAX)
    }

    /// Lets events go behind which enough of the contour is known.
    pub(super) fn release(&mut self, out: &mut impl Extend<Event>) -> Result<(), Kind> {
        while let Some(first) = self.waiting.front() {
            if self.collects || !self.is_far(first.at_mm, first.walls) {
                break;
            }
            self.judge(self.gone)?;
            self.gone += 1;
            out.extend(self.waiting.pop_front().map(|waiting| waiting.event));
        }
        Ok(())
    }

    /// Lets all go, the contour having come to its end.
    pub(super) fn release_all(&mut self, out: &mut impl Extend<Event>) {
        self.gone += self.waiting.len() as u64;
        out.extend(self.waiting.drain(..).map(|waiting| waiting.event));
    }

    /// Whether a place of the contour is out of the window.
    fn is_far(&self, at_mm: f64, walls: u64) -> bool {
        self.at_mm - at_mm >= 2.0 * self.radius && self.walls.end() - walls >= AHEAD as u64
    }

    /// Lets go of what is out of the window.
    fn forget(&mut self) {
        while self
            .tracks
            .front()
            .is_some_and(|track| self.is_far(track.at_mm, track.walls))
        {
            self.tracks.pop();
        }
        // What a suspicion needs stays until that is looked into.
        let oldest = self
            .suspects
            .values()
            .next()
            .map_or(self.walls.end(), |track| track.walls);
        while let Some(wall) = self.walls.front()
            && oldest - wall.number.min(oldest) > 2 * AHEAD as u64
            && self.at_mm - wall.at_mm >= 4.0 * self.radius
        {
            self.walls.pop();
        }
    }
}
