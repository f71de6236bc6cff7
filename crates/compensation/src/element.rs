//! A line or an arc with two ends, and how close two of them come to each other.
//!
//! In:  moves in the plane of compensation, mm.
//! Out: points on them by the part of the way done, 0 to 1; distances; crossings.

use std::f64::consts::TAU;

use super::contour::{Contour, Shape};
use super::geometry::{Point, add, angle, cross, dot, length, scale, sub};

/// See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Element {
    pub(super) from: Point,
    pub(super) to: Point,
    pub(super) arc: Option<Arc>,
}

/// What makes an element an arc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arc {
    pub(super) centre: Point,
    /// Of the end.
    pub(super) radius: f64,
    /// From the start to the end, rad, positive counter-clockwise; more than a full turn for a helix of several.
    pub(super) sweep: f64,
}

/// How close two elements come to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Closest {
    pub(super) distance: f64,
    /// The point on the second element.
    pub(super) other: Point,
}

impl Element {
    pub(super) fn line(from: Point, to: Point) -> Element {
        Element { from, to, arc: None }
    }

    /// An arc by its ends and the number of turns begun, with a sign, as a call tells it.
    pub(super) fn arc(from: Point, to: Point, centre: Point, turns: i32) -> Element {
        let radius = length(sub(to, centre));
        let turn = f64::from(turns.signum());
        let seen = (turn * angle(sub(from, centre), sub(to, centre))).rem_euclid(TAU);
        // No angle at all between the ends is a full turn.
        let seen = if seen * radius < 1e-9 { seen + TAU } else { seen };
        let full = f64::from(turns.unsigned_abs().saturating_sub(1)) * TAU;
        let arc = Arc {
            centre,
            radius,
            sweep: turn * (seen + full),
        };
        Element {
            from,
            to,
            arc: Some(arc),
        }
    }

    /// A programmed move.
    pub(super) fn new(contour: &Contour) -> Element {
        match contour.shape {
            Shape::Line => Element::line(contour.from, contour.to),
            Shape::Arc { centre, turns } => Element::arc(contour.from, contour.to, centre, turns),
        }
    }

    /// By how much the radius at the start of an arc differs from that at its end, which the element has; what the numbers
    /// of a program are rounded to.
    pub(super) fn mismatch(&self) -> f64 {
        self.arc
            .map_or(0.0, |arc| (length(sub(self.from, arc.centre)) - arc.radius).abs())
    }

    pub(super) fn length(&self) -> f64 {
        match self.arc {
            None => length(sub(self.to, self.from)),
            Some(arc) => arc.radius * arc.sweep.abs(),
        }
    }

    /// The point where `part` of the way is done.
    pub(super) fn at(&self, part: f64) -> Point {
        match self.arc {
            None => add(self.from, scale(sub(self.to, self.from), part)),
            Some(arc) => {
                // From the end backwards: that is where the radius is.
                let (sin, cos) = libm::sincos(arc.sweep * (part - 1.0));
                let arm = sub(self.to, arc.centre);
                add(arc.centre, [arm[0] * cos - arm[1] * sin, arm[0] * sin + arm[1] * cos])
            }
        }
    }

    /// The part between two points of the way.
    pub(super) fn between(&self, part: [f64; 2]) -> Element {
        let mut element = *self;
        (element.from, element.to) = (
            if part[0] == 0.0 { self.from } else { self.at(part[0]) },
            if part[1] == 1.0 { self.to } else { self.at(part[1]) },
        );
        if let Some(arc) = &mut element.arc {
            arc.sweep *= part[1] - part[0];
        }
        element
    }

    /// The way at which the element passes a point of it.
    pub(super) fn part_at(&self, point: Point) -> f64 {
        match self.arc {
            None => {
                let way = sub(self.to, self.from);
                let part = dot(sub(point, self.from), way) / dot(way, way);
                if part > 0.0 { part.min(1.0) } else { 0.0 }
            }
            Some(arc) => match self.part_towards(&arc, point) {
                Some(part) => part,
                None if length(sub(point, self.from)) < length(sub(point, self.to)) => 0.0,
                None => 1.0,
            },
        }
    }

    /// The way at which an arc passes the direction of `point` from its centre, 0 to 1; the first time if several.
    pub(super) fn part_towards(&self, arc: &Arc, point: Point) -> Option<f64> {
        let whole = arc.sweep.abs();
        let back = (arc.sweep.signum() * angle(sub(point, arc.centre), sub(self.to, arc.centre))).rem_euclid(TAU);
        // Rounding puts a point at the very end just behind it.
        let back = if back > whole && TAU - back < 1e-12 { 0.0 } else { back };
        (back <= whole).then(|| 1.0 - (back + ((whole - back) / TAU).floor() * TAU) / whole)
    }

    /// The nearest point to `point`.
    pub(super) fn nearest(&self, point: Point) -> Point {
        match self.arc {
            None => {
                let way = sub(self.to, self.from);
                let part = dot(sub(point, self.from), way) / dot(way, way);
                if part > 0.0 && part < 1.0 {
                    add(self.from, scale(way, part))
                } else {
                    // Also where the line has no length and `part` is NaN.
                    self.nearer_end(point)
                }
            }
            Some(arc) => match self.part_towards(&arc, point) {
                Some(_) => on_circle(&arc, point),
                None => self.nearer_end(point),
            },
        }
    }

    fn nearer_end(&self, point: Point) -> Point {
        let [to_start, to_end] = [self.start(), self.to].map(|end| length(sub(point, end)));
        if to_start < to_end { self.start() } else { self.to }
    }

    /// The start as the circle has it.
    fn start(&self) -> Point {
        if self.arc.is_some() { self.at(0.0) } else { self.from }
    }

    /// The closest points of two elements: at an end of one, where a normal of one is a normal of the other, or at a crossing.
    pub(super) fn closest(&self, other: &Element) -> Closest {
        let mut best = Closest {
            distance: f64::INFINITY,
            other: other.from,
        };
        self.candidates(other, |at, other| {
            let distance = length(sub(at, other));
            if distance < best.distance {
                best = Closest { distance, other };
            }
        });
        best
    }

    /// Shows pairs of points, on this element and on the other, among which are the closest ones, and the ends of all that
    /// the two have in common.
    pub(super) fn candidates(&self, other: &Element, mut take: impl FnMut(Point, Point)) {
        for end in [self.start(), self.to] {
            take(end, other.nearest(end));
        }
        for end in [other.start(), other.to] {
            take(self.nearest(end), end);
        }
        match (self.arc, other.arc) {
            (None, None) => {}
            (Some(arc), None) => {
                let foot = other.nearest(arc.centre);
                take(self.nearest(foot), foot);
            }
            (None, Some(arc)) => {
                let foot = self.nearest(arc.centre);
                take(foot, other.nearest(foot));
            }
            (Some(arc), Some(arc_other)) => {
                for at in on_axis(&arc, arc_other.centre) {
                    if self.part_towards(&arc, at).is_some() {
                        take(at, other.nearest(at));
                    }
                }
            }
        }
        for at in self.crossings(other) {
            take(at, at);
        }
    }

    /// Points that lie on both, two at most. Elements that lie on each other have none.
    pub(super) fn crossings(&self, other: &Element) -> impl Iterator<Item = Point> {
        let points = match (self.arc, other.arc) {
            (None, None) => [self.line_line(other), None],
            (None, Some(arc)) => self.line_circle(&arc),
            (Some(arc), None) => other.line_circle(&arc),
            (Some(arc), Some(other)) => circle_circle(&arc, &other),
        };
        let (a, b) = (*self, *other);
        points
            .into_iter()
            .flatten()
            .filter(move |point| a.passes(*point) && b.passes(*point))
    }

    /// Whether a point of the endless curve lies between the ends, or at one.
    fn passes(&self, point: Point) -> bool {
        match self.arc {
            None => {
                let way = sub(self.to, self.from);
                let whole = dot(way, way);
                (-1e-12 * whole..=(1.0 + 1e-12) * whole).contains(&dot(sub(point, self.from), way))
            }
            Some(arc) => self.part_towards(&arc, point).is_some(),
        }
    }

    fn line_line(&self, other: &Element) -> Option<Point> {
        let (way, way_other) = (sub(self.to, self.from), sub(other.to, other.from));
        let part = cross(sub(other.from, self.from), way_other) / cross(way, way_other);
        part.is_finite().then(|| add(self.from, scale(way, part)))
    }

    fn line_circle(&self, arc: &Arc) -> [Option<Point>; 2] {
        let way = sub(self.to, self.from);
        let whole = length(way);
        if whole == 0.0 {
            return [None; 2];
        }
        let tangent = scale(way, 1.0 / whole);
        let foot = add(self.from, scale(tangent, dot(sub(arc.centre, self.from), tangent)));
        let away = length(sub(foot, arc.centre));
        let square = (arc.radius - away) * (arc.radius + away);
        if square < 0.0 {
            return [None; 2];
        }
        let half = square.sqrt();
        [
            Some(add(foot, scale(tangent, half))),
            Some(sub(foot, scale(tangent, half))),
        ]
    }
}

/// The point of the circle in the direction of `point`.
fn on_circle(arc: &Arc, point: Point) -> Point {
    let arm = sub(point, arc.centre);
    let away = length(arm);
    if away == 0.0 {
        // All points are as near.
        return add(arc.centre, [arc.radius, 0.0]);
    }
    add(arc.centre, scale(arm, arc.radius / away))
}

/// Both points of a circle on the line through its centre and `point`.
fn on_axis(arc: &Arc, point: Point) -> [Point; 2] {
    let near = on_circle(arc, point);
    [near, sub(scale(arc.centre, 2.0), near)]
}

fn circle_circle(a: &Arc, b: &Arc) -> [Option<Point>; 2] {
    let axis = sub(b.centre, a.centre);
    let apart = length(axis);
    if apart == 0.0 {
        return [None; 2];
    }
    let axis = scale(axis, 1.0 / apart);
    let along = (a.radius * a.radius - b.radius * b.radius + apart * apart) / (2.0 * apart);
    let square = (a.radius - along) * (a.radius + along);
    if square < 0.0 {
        return [None; 2];
    }
    let foot = add(a.centre, scale(axis, along));
    let across = scale([-axis[1], axis[0]], square.sqrt());
    [Some(add(foot, across)), Some(sub(foot, across))]
}
