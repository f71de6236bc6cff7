//! Lines and arcs in a plane, and what turning asks of them.
//!
//! In:  points `[p, q]`, mm.
//! Out: the same beside, crossings, tangents.

use crate::execute::circle::Arc;

pub(super) type Point = [f64; 2];

/// Points closer than this are one, mm.
pub(super) const SAME_MM: f64 = 1e-6;

/// A line or an arc of less than a full circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) start: Point,
    pub(super) end: Point,
    /// `turns` is 1 or -1; `None`: a line.
    pub(super) arc: Option<Arc>,
    /// Number of the move of the profile that it is of, from 1 on; 0: of none.
    pub(super) of: u32,
}

impl Segment {
    pub(super) fn line(start: Point, end: Point) -> Segment {
        Segment {
            start,
            end,
            arc: None,
            of: 0,
        }
    }

    pub(super) fn arc(start: Point, end: Point, centre_mm: Point, turns: i32) -> Segment {
        let arc = Some(Arc { centre_mm, turns });
        Segment { start, end, arc, of: 0 }
    }

    /// Direction at a point of it, length 1.
    pub(super) fn direction(&self, at: Point) -> Point {
        let along = match self.arc {
            None => minus(self.end, self.start),
            Some(arc) => {
                let radius = minus(at, arc.centre_mm);
                let turns = f64::from(arc.turns);
                [-turns * radius[1], turns * radius[0]]
            }
        };
        scaled(along, 1.0 / length(along).max(f64::MIN_POSITIVE))
    }

    /// The same so far to the right of the way; `None`: an arc whose radius is used up.
    pub(super) fn beside(&self, right_mm: f64) -> Option<Segment> {
        let moved = |point: Point| {
            let along = self.direction(point);
            [point[0] + right_mm * along[1], point[1] - right_mm * along[0]]
        };
        if let Some(arc) = self.arc {
            let radius = length(minus(self.start, arc.centre_mm)) + right_mm * f64::from(arc.turns);
            if radius < SAME_MM {
                return None;
            }
        }
        Some(Segment {
            start: moved(self.start),
            end: moved(self.end),
            ..*self
        })
    }

    /// Where lines without ends and whole circles meet.
    pub(super) fn meets(&self, other: &Segment) -> Vec<Point> {
        match (self.arc, other.arc) {
            (None, None) => {
                let (a, b) = (minus(self.end, self.start), minus(other.end, other.start));
                let across = cross(a, b);
                if across.abs() < 1e-12 * length(a) * length(b) {
                    return Vec::new();
                }
                let share = cross(minus(other.start, self.start), b) / across;
                vec![plus(self.start, scaled(a, share))]
            }
            (None, Some(arc)) => line_and_circle(self, arc.centre_mm, length(minus(other.start, arc.centre_mm))),
            (Some(_), None) => other.meets(self),
            (Some(one), Some(two)) => {
                let (r1, r2) = (
                    length(minus(self.start, one.centre_mm)),
                    length(minus(other.start, two.centre_mm)),
                );
                let between = minus(two.centre_mm, one.centre_mm);
                let distance = length(between);
                if distance < SAME_MM {
                    return Vec::new();
                }
                // The common chord stands on the way between the centres.
                let along = (distance * distance + r1 * r1 - r2 * r2) / (2.0 * distance);
                let square = r1 * r1 - along * along;
                if square < -SAME_MM * r1 {
                    return Vec::new();
                }
                let unit = scaled(between, 1.0 / distance);
                let foot = plus(one.centre_mm, scaled(unit, along));
                let half = square.max(0.0).sqrt();
                [half, -half]
                    .map(|half| plus(foot, [-half * unit[1], half * unit[0]]))
                    .to_vec()
            }
        }
    }

    /// How far along a point of the carrier is: 0 at the start, 1 at the end.
    pub(super) fn share(&self, point: Point) -> f64 {
        match self.arc {
            None => {
                let way = minus(self.end, self.start);
                dot(minus(point, self.start), way) / dot(way, way)
            }
            Some(arc) => {
                let angle = |point: Point| {
                    let [x, y] = minus(point, arc.centre_mm);
                    libm::atan2(y, x)
                };
                let turn = |from: f64, to: f64| ((to - from) * f64::from(arc.turns)).rem_euclid(std::f64::consts::TAU);
                let whole = turn(angle(self.start), angle(self.end));
                let mut part = turn(angle(self.start), angle(point));
                // What is nearer behind the start than behind the end counts as before it.
                if part > whole && part - whole > std::f64::consts::TAU - part {
                    part -= std::f64::consts::TAU;
                }
                part / whole.max(f64::MIN_POSITIVE)
            }
        }
    }

    /// Point at a share of the way.
    pub(super) fn at(&self, share: f64) -> Point {
        match self.arc {
            None => plus(self.start, scaled(minus(self.end, self.start), share)),
            Some(arc) => {
                let radius = minus(self.start, arc.centre_mm);
                let end = minus(self.end, arc.centre_mm);
                let turns = f64::from(arc.turns);
                let whole = libm::atan2(turns * cross(radius, end), dot(radius, end)).rem_euclid(std::f64::consts::TAU);
                let (sin, cos) = libm::sincos(turns * share * whole);
                let turned = [radius[0] * cos - radius[1] * sin, radius[0] * sin + radius[1] * cos];
                plus(arc.centre_mm, turned)
            }
        }
    }

    /// Nearest distance of a point from it.
    pub(super) fn distance(&self, point: Point) -> f64 {
        let ends = length(minus(point, self.start)).min(length(minus(point, self.end)));
        let across = match self.arc {
            None => {
                let way = minus(self.end, self.start);
                cross(way, minus(point, self.start)).abs() / length(way).max(f64::MIN_POSITIVE)
            }
            Some(arc) => {
                let radius = length(minus(self.start, arc.centre_mm));
                (length(minus(point, arc.centre_mm)) - radius).abs()
            }
        };
        if (0.0..=1.0).contains(&self.share(point)) {
            across.min(ends)
        } else {
            ends
        }
    }

    /// The p values at which it has a q, in the order of its way.
    pub(super) fn crossings(&self, q: f64) -> Vec<f64> {
        let (low, high) = (self.start[1].min(self.end[1]), self.start[1].max(self.end[1]));
        match self.arc {
            None if q < low - SAME_MM || q > high + SAME_MM => Vec::new(),
            None if high - low < SAME_MM => vec![self.start[0], self.end[0]],
            None => {
                let share = (q - self.start[1]) / (self.end[1] - self.start[1]);
                vec![self.start[0] + share * (self.end[0] - self.start[0])]
            }
            Some(arc) => {
                let radius = length(minus(self.start, arc.centre_mm));
                let height = q - arc.centre_mm[1];
                let square = (radius - height) * (radius + height);
                if square < -SAME_MM {
                    return Vec::new();
                }
                let half = square.max(0.0).sqrt();
                let tolerance = SAME_MM / radius;
                [arc.centre_mm[0] + half, arc.centre_mm[0] - half]
                    .into_iter()
                    .filter(|p| (-tolerance..=1.0 + tolerance).contains(&self.share([*p, q])))
                    .collect()
            }
        }
    }
}

fn line_and_circle(line: &Segment, centre: Point, radius: f64) -> Vec<Point> {
    let way = minus(line.end, line.start);
    let unit = scaled(way, 1.0 / length(way).max(f64::MIN_POSITIVE));
    let foot = plus(line.start, scaled(unit, dot(minus(centre, line.start), unit)));
    let away = length(minus(centre, foot));
    let square = (radius - away) * (radius + away);
    if square < -SAME_MM * radius {
        return Vec::new();
    }
    let half = square.max(0.0).sqrt();
    [half, -half].map(|half| plus(foot, scaled(unit, half))).to_vec()
}

pub(super) fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn plus(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1]]
}

pub(super) fn scaled(a: Point, factor: f64) -> Point {
    [a[0] * factor, a[1] * factor]
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Above 0: `b` is to the left of `a`.
pub(super) fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn length(a: Point) -> f64 {
    libm::hypot(a[0], a[1])
}

impl Segment {
    /// The same elsewhere.
    pub(super) fn moved(&self, way: Point) -> Segment {
        Segment {
            start: plus(self.start, way),
            end: plus(self.end, way),
            arc: self.arc.map(|arc| Arc {
                centre_mm: plus(arc.centre_mm, way),
                turns: arc.turns,
            }),
            ..*self
        }
    }
}
