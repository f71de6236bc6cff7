//! Points, directions and curves in the plane of compensation.
//!
//! In:  points on the first and second axis of the plane, mm.
//! Out: the contour's moves as curves, the curves of the tool's centre beside them, and where two of these cross.
//!
//! A side is a sign: +1 for a tool left of the path, -1 for one right of it. A turn is one too: +1 counter-clockwise.

use std::f64::consts::{PI, TAU};

/// First and second coordinate in the plane, mm; or a direction.
pub(super) type Point = [f64; 2];

pub(super) fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1]]
}

pub(super) fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn scale(a: Point, by: f64) -> Point {
    [a[0] * by, a[1] * by]
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Positive where `b` points to the left of `a`.
pub(super) fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// A quarter turn to the left.
pub(super) fn left(a: Point) -> Point {
    [-a[1], a[0]]
}

pub(super) fn length(a: Point) -> f64 {
    libm::hypot(a[0], a[1])
}

/// `a` with length 1. The caller has made sure that it has a length.
pub(super) fn unit(a: Point) -> Point {
    scale(a, 1.0 / length(a))
}

/// Angle from `a` to `b`, positive to the left, from -pi to pi.
pub(super) fn angle(a: Point, b: Point) -> f64 {
    libm::atan2(cross(a, b), dot(a, b))
}

/// An endless line or a circle, with the direction in which it is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Curve {
    Line {
        through: Point,
        /// Unit vector.
        tangent: Point,
    },
    Circle {
        centre: Point,
        radius: f64,
        /// +1 counter-clockwise, -1 clockwise.
        turn: f64,
    },
}

/// Why two curves do not meet, with the distance that they lack to touch, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Apart {
    pub(super) gap_mm: f64,
}

impl Curve {
    /// A line beside itself, a circle as it is: a line meets an arc where the arc's curve begins.
    pub(super) fn moved_if_line(self, by: Point) -> Curve {
        match self {
            Curve::Line { through, tangent } => Curve::Line {
                through: add(through, by),
                tangent,
            },
            Curve::Circle { .. } => self,
        }
    }

    /// Unit vector in which the curve is followed at `at`, a point on it.
    pub(super) fn tangent(&self, at: Point) -> Point {
        match *self {
            Curve::Line { tangent, .. } => tangent,
            Curve::Circle { centre, turn, .. } => scale(left(unit(sub(at, centre))), turn),
        }
    }

    /// The point at which one changes from this curve to `next` with a turn towards the tool, which goes on `side`.
    ///
    /// Two curves of the tool's centre cross in up to two points. At one of them the path turns towards the tool, as it does
    /// at a concave corner of the contour, so that the centre comes from the allowed side of `next`; at the other it turns away.
    ///
    /// ```text
    ///        next            tool on the left, coming from the left on a line:
    ///       .---.            at p the path turns left, towards the tool: the corner
    ///  ----p-----q---->      at q it turns right
    ///       '---'
    /// ```
    pub(super) fn crossing(&self, next: &Curve, side: f64) -> Result<Point, Apart> {
        let towards_tool = |at: Point| side * cross(self.tangent(at), next.tangent(at)) >= 0.0;
        let pick = |candidates: [Point; 2]| candidates[usize::from(!towards_tool(candidates[0]))];
        match (*self, *next) {
            (
                Curve::Line { through, tangent },
                Curve::Line {
                    through: through_next,
                    tangent: tangent_next,
                },
            ) => {
                // through + t * tangent lies on the next line: cross((through + t * tangent) - through_next, tangent_next) = 0
                let t = cross(sub(through_next, through), tangent_next) / cross(tangent, tangent_next);
                Ok(add(through, scale(tangent, t)))
            }
            (Curve::Line { through, tangent }, Curve::Circle { centre, radius, .. })
            | (Curve::Circle { centre, radius, .. }, Curve::Line { through, tangent }) => {
                let foot = add(through, scale(tangent, dot(sub(centre, through), tangent)));
                let half = half_chord(radius, length(sub(centre, foot)))?;
                Ok(pick([add(foot, scale(tangent, half)), sub(foot, scale(tangent, half))]))
            }
            (
                Curve::Circle { centre, radius, .. },
                Curve::Circle {
                    centre: centre_next,
                    radius: radius_next,
                    ..
                },
            ) => {
                let apart = length(sub(centre_next, centre));
                let inside = (radius - radius_next).abs() - apart;
                if inside > TOUCH_MM || apart == 0.0 {
                    return Err(Apart { gap_mm: inside });
                }
                if apart - radius - radius_next > TOUCH_MM {
                    return Err(Apart {
                        gap_mm: apart - radius - radius_next,
                    });
                }
                // Both crossings lie on the common chord, `along` from the first centre: r^2 - along^2 = r_next^2 - (apart - along)^2
                let axis = unit(sub(centre_next, centre));
                let along = (radius * radius - radius_next * radius_next + apart * apart) / (2.0 * apart);
                let half = (radius * radius - along * along).max(0.0).sqrt();
                let foot = add(centre, scale(axis, along));
                Ok(pick([
                    add(foot, scale(left(axis), half)),
                    sub(foot, scale(left(axis), half)),
                ]))
            }
        }
    }
}

/// Curves that miss each other by no more than this still touch: what rounding makes of tangent ones.
const TOUCH_MM: f64 = 1e-9;

/// Half the length of the chord at `distance` from the centre of a circle.
fn half_chord(radius: f64, distance: f64) -> Result<f64, Apart> {
    if distance - radius > TOUCH_MM {
        return Err(Apart {
            gap_mm: distance - radius,
        });
    }
    Ok(((radius - distance) * (radius + distance)).max(0.0).sqrt())
}

/// How far one turns about `centre` from `from` to `to`, in the direction of `turn`; 0 to 2 pi.
pub(super) fn sweep(centre: Point, turn: f64, from: Point, to: Point) -> f64 {
    (turn * angle(sub(from, centre), sub(to, centre))).rem_euclid(TAU)
}

/// The same angle from -pi to pi.
pub(super) fn wrapped(angle: f64) -> f64 {
    let within = angle.rem_euclid(TAU);
    if within > PI { within - TAU } else { within }
}
