//! Closed rings of the contour, and which of them are steps of clearing.
//!
//! In:  the moves of the contour in the window.
//! Out: whether a move is a wall for a move of the centre, as far as rings decide it.
//!
//! What a contour keeps lies on its side away from the tool. A ring all of whose tool's side lies on the tool's side of another
//! ring keeps nothing: what is behind it goes when the tool is beside the other one. It is a step of clearing:
//!
//! ```text
//!    pocket, tool inside          island, tool outside
//!    ___________                  ___________
//!   | R  _____  |                | W  _____  |      W: step of clearing, R: wall
//!   |   |  W  | |                |   |  R  | |
//!   |   |_____| |                |   |_____| |      R and W go round in the same direction. A pocket and its island go round in
//!   |___________|                |___________|      opposite ones, and both are walls.
//! ```
//!
//! A step of clearing is a wall for the tool beside itself, whose way it is, and for no other as long as that is no deeper than
//! the ring around it. Moves from one ring to the next, one of which is such a step, are no walls. Rings that cross each other
//! are walls, as are spirals and all that does not close.
//!
//! Rings are found by following the contour: where it comes to a place of the way so far, what lies between is a ring, and
//! the way goes on without it.

use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::{FRAC_PI_2, TAU};

use super::super::element::Element;
use super::super::geometry::{Point, angle, cross, length, sub};
use super::conflict::{depth_between, meet};
use super::lead::{NEIGHBOUR_MM, TOUCH_MM, is_closed};
use super::store::Store;
use super::{DEPTH_TOLERANCE_MM, Track, Wall};

/// A part of a wall on the way.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    wall: Wall,
    part: [f64; 2],
    /// Length of the way, without its rings, at the start.
    at_mm: f64,
}

impl Stretch {
    /// Length of the way at a part of the wall.
    fn mm(&self, part: f64) -> f64 {
        self.at_mm + (part - self.part[0]) * self.wall.element.length()
    }
}

/// Where the way comes to itself.
#[derive(Clone, Copy, Debug)]
struct Touch {
    part: f64,
    /// Index of the stretch that was there before, and the part of its wall.
    earlier: (usize, f64),
}

#[derive(Clone, Debug)]
struct Ring {
    /// Number of its last wall.
    last: u64,
    /// Number of the first wall of its contour.
    run: u64,
    pose: u32,
    elements: Vec<Element>,
    /// Positive counter-clockwise.
    area_mm2: f64,
    length_mm: f64,
    /// Highest of its ways along the plane's normal.
    top_mm: f64,
    /// Number of the first ring that was not asked yet whether it makes this one a step of clearing.
    asked: u64,
    /// The lowest top of the rings that do.
    cleared_mm: f64,
}

/// See the [module](self).
#[derive(Clone, Debug)]
pub(super) struct Rings {
    /// +1: the tool is on the left, -1: on the right.
    side: f64,
    /// Number of the next wall to be followed.
    next: u64,
    way: Vec<Stretch>,
    /// Number of rings that left the window.
    gone: u64,
    /// In the order in which they closed.
    rings: VecDeque<Ring>,
    /// Numbers of the rings of each wall that has any.
    owners: BTreeMap<u64, Vec<u64>>,
}

impl Rings {
    pub(super) fn new(side: f64) -> Rings {
        Rings {
            side,
            next: 0,
            way: Vec::new(),
            gone: 0,
            rings: VecDeque::new(),
            owners: BTreeMap::new(),
        }
    }

    /// Whether a wall is one of a step of clearing, or leads to it or away, and the tool is not beside that.
    pub(super) fn is_cleared(&mut self, walls: &mut Store<Wall>, track: &Track, wall: &Wall) -> bool {
        self.follow(walls);
        let depth_mm = track.mark.depth[0].min(track.mark.depth[1]);
        let Some(owners) = self.owners.get(&wall.number) else {
            let behind = self.rings.partition_point(|ring| ring.last < wall.number);
            let is_between = |ring: &usize| self.rings.get(*ring).is_some_and(|ring| ring.run == wall.run);
            let around = behind.checked_sub(1).map(|before| [before, behind]);
            let around = around.filter(|rings| rings.iter().all(is_between));
            return around.is_some_and(|rings| rings.into_iter().any(|ring| self.is_step(ring, depth_mm)));
        };
        let is_beside = |ring: &u64| {
            let owners = track.mark.walls.map(|number| self.owners.get(&number));
            owners
                .iter()
                .all(|owners| owners.is_some_and(|rings| rings.contains(ring)))
        };
        if owners.iter().any(is_beside) {
            return false;
        }
        let owners = owners.clone();
        owners
            .iter()
            .all(|ring| self.is_step((ring - self.gone) as usize, depth_mm))
    }

    /// Whether a ring is a step of clearing for a tool that is so deep.
    fn is_step(&mut self, index: usize, depth_mm: f64) -> bool {
        let Some(ring) = self.rings.get(index) else {
            return false;
        };
        let (mut asked, mut cleared_mm) = (ring.asked.max(self.gone), ring.cleared_mm);
        while depth_mm < cleared_mm - DEPTH_TOLERANCE_MM
            && let Some(other) = self.rings.get((asked - self.gone) as usize)
        {
            asked += 1;
            if other.top_mm < cleared_mm && ring.is_step_of(other, self.side) {
                cleared_mm = other.top_mm;
            }
        }
        let ring = &mut self.rings[index];
        (ring.asked, ring.cleared_mm) = (asked, cleared_mm);
        depth_mm >= cleared_mm - DEPTH_TOLERANCE_MM
    }

    /// Follows the contour to its end, and lets go of what is out of the window.
    fn follow(&mut self, walls: &mut Store<Wall>) {
        let numbers = walls.numbers();
        if self.next == numbers.end {
            return;
        }
        while self.rings.front().is_some_and(|ring| ring.last < numbers.start) {
            self.rings.pop_front();
            self.gone += 1;
        }
        while self
            .owners
            .first_key_value()
            .is_some_and(|(number, _)| *number < numbers.start)
        {
            self.owners.pop_first();
        }
        let old = self.way.partition_point(|stretch| stretch.wall.number < numbers.start);
        if 2 * old > self.way.len() {
            self.way.drain(..old);
        }
        for number in self.next.max(numbers.start)..numbers.end {
            if let Some(wall) = walls.get(number).copied() {
                self.go_on(walls, wall);
            }
        }
        self.next = numbers.end;
    }

    fn go_on(&mut self, walls: &mut Store<Wall>, wall: Wall) {
        if self.way.last().is_some_and(|last| last.wall.run != wall.run) {
            self.way.clear();
        }
        let mut stretch = Stretch {
            wall,
            part: [0.0, 1.0],
            at_mm: self.way.last().map_or(0.0, |last| last.mm(last.part[1])),
        };
        if is_closed(&wall.element) {
            return self.close(vec![stretch]);
        }
        while let Some(touch) = self.touch(walls, &stretch) {
            let (index, part) = touch.earlier;
            let mut ring = self.way.split_off(index);
            let before = Stretch {
                part: [ring[0].part[0], part],
                ..ring[0]
            };
            ring[0].part[0] = part;
            ring.push(Stretch {
                part: [stretch.part[0], touch.part],
                ..stretch
            });
            self.close(ring);
            stretch.at_mm = before.mm(part);
            stretch.part[0] = touch.part;
            self.way.push(before);
        }
        self.way.push(stretch);
    }

    /// Where a stretch first comes to the way, further along it than neighbours do.
    fn touch(&self, walls: &mut Store<Wall>, stretch: &Stretch) -> Option<Touch> {
        let element = stretch.wall.element;
        let mut first: Option<Touch> = None;
        walls.near(&element, |other| {
            let found = self
                .way
                .binary_search_by_key(&other.number, |earlier| earlier.wall.number);
            let (index, earlier) = found.ok().map(|index| (index, &self.way[index]))?;
            if !meet(&other.mark, &stretch.wall.mark) {
                return None;
            }
            element.candidates(&other.element, |at, there| {
                let (part, part_there) = (element.part_at(at), other.element.part_at(there));
                let between_mm = stretch.mm(part) - earlier.mm(part_there);
                if length(sub(at, there)) <= TOUCH_MM
                    && part >= stretch.part[0]
                    && (earlier.part[0]..=earlier.part[1]).contains(&part_there)
                    && between_mm > NEIGHBOUR_MM
                    && first.is_none_or(|first| part < first.part)
                {
                    let earlier = (index, part_there);
                    first = Some(Touch { part, earlier });
                }
            });
            None::<()>
        });
        first
    }

    /// Takes what is a ring, if there is anything in it.
    fn close(&mut self, mut stretches: Vec<Stretch>) {
        stretches.retain(|stretch| stretch.mm(stretch.part[1]) - stretch.at_mm > TOUCH_MM);
        let Some(last) = stretches.last() else {
            return;
        };
        let elements: Vec<Element> = stretches
            .iter()
            .map(|stretch| one_turn(stretch.wall.element.between(stretch.part)))
            .collect();
        let ring = Ring {
            last: last.wall.number,
            run: last.wall.run,
            pose: last.wall.mark.pose,
            area_mm2: area_mm2(&elements),
            length_mm: elements.iter().map(Element::length).sum(),
            elements,
            top_mm: stretches
                .iter()
                .flat_map(|stretch| depth_between(stretch.wall.mark.depth, stretch.part))
                .fold(f64::NEG_INFINITY, f64::max),
            asked: 0,
            cleared_mm: f64::INFINITY,
        };
        if ring.area_mm2.abs() <= TOUCH_MM * ring.length_mm {
            return;
        }
        let number = self.gone + self.rings.len() as u64;
        for stretch in &stretches {
            self.owners.entry(stretch.wall.number).or_default().push(number);
        }
        self.rings.push_back(ring);
    }
}

impl Ring {
    /// Whether all of the tool's side of this ring lies on the tool's side of another one, and something between both.
    fn is_step_of(&self, other: &Ring, side: f64) -> bool {
        if self.pose != other.pose || self.area_mm2.signum() != other.area_mm2.signum() {
            return false;
        }
        let (inner, outer) = if side * self.area_mm2 > 0.0 {
            (self, other)
        } else {
            (other, self)
        };
        outer.area_mm2.abs() - inner.area_mm2.abs() > TOUCH_MM * outer.length_mm && inner.is_in(outer)
    }

    /// Whether no part of this ring is outside another one.
    fn is_in(&self, outer: &Ring) -> bool {
        let is_on = |ring: &[Element], point| {
            let distance = |element: &Element| length(sub(point, element.nearest(point)));
            ring.iter().any(|element| distance(element) <= TOUCH_MM)
        };
        let start = self.elements.first().map_or([f64::NAN; 2], |first| first.at(0.5));
        // Once inside it is inside until the other ring is near.
        let mut is_inside = outer.is_around(start);
        if !is_inside && !is_on(&outer.elements, start) {
            return false;
        }
        let mut store = Store::new(outer.length_mm / outer.elements.len() as f64);
        for element in &outer.elements {
            store.push(element, *element);
        }
        self.elements.iter().all(|element| {
            let (mut near, mut cuts) = (Vec::new(), vec![0.0, 1.0]);
            store.near(element, |other| {
                if element.closest(other).distance <= TOUCH_MM {
                    near.push(*other);
                    cuts.extend(element.crossings(other).map(|at| element.part_at(at)));
                }
                None::<()>
            });
            if near.is_empty() && is_inside {
                return true;
            }
            cuts.sort_by(f64::total_cmp);
            cuts.windows(2).all(|part| {
                let middle = element.at(0.5 * (part[0] + part[1]));
                let is_on = is_on(&near, middle);
                is_inside = !is_on && outer.is_around(middle);
                is_on || is_inside
            })
        })
    }

    /// Whether the ring goes around a point that is not on it.
    fn is_around(&self, point: Point) -> bool {
        let turned: f64 = self.elements.iter().map(|element| turning_rad(element, point)).sum();
        turned.abs() > 0.5 * TAU
    }
}

/// An arc without the turns that lead to where it was.
fn one_turn(mut element: Element) -> Element {
    if let Some(arc) = &mut element.arc {
        let more = ((arc.sweep.abs() - 1e-6) / TAU).floor().max(0.0);
        arc.sweep -= arc.sweep.signum() * more * TAU;
    }
    element
}

/// Area that a ring goes around, positive counter-clockwise.
fn area_mm2(ring: &[Element]) -> f64 {
    let Some(origin) = ring.first().map(|first| first.from) else {
        return 0.0;
    };
    ring.iter()
        .map(|element| {
            let chord = cross(sub(element.from, origin), sub(element.to, origin));
            let segment = element
                .arc
                .map_or(0.0, |arc| arc.radius * arc.radius * (arc.sweep - libm::sin(arc.sweep)));
            0.5 * (chord + segment)
        })
        .sum()
}

/// How far the direction from a point turns while it looks along an element, rad.
fn turning_rad(element: &Element, point: Point) -> f64 {
    let chord = |from: Point, to: Point| angle(sub(from, point), sub(to, point));
    let Some(arc) = element.arc else {
        return chord(element.from, element.to);
    };
    let parts = (arc.sweep.abs() / FRAC_PI_2).ceil().max(1.0);
    (0..parts as u32)
        .map(|part| {
            let [from, to] = [part, part + 1].map(|part| element.at(f64::from(part) / parts));
            // Between the chord and the arc the direction goes around the other way.
            let is_between =
                length(sub(point, arc.centre)) < arc.radius && arc.sweep * cross(sub(to, from), sub(point, from)) < 0.0;
            chord(from, to) + if is_between { arc.sweep.signum() * TAU } else { 0.0 }
        })
        .sum()
}
