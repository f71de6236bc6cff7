//! Quintics along a NURBS.
//!
//! In:  the spans of a curve.
//! Out: lines and quintics, each of which goes on where the one before ended, with the direction and curvature that the curve
//! has there: where the curve has no jump of these, neither have they.
//!
//! A span is halved until the quintic with its ends, and with its first two derivatives there, is proven to be near enough
//! and turns little. Polynomials of degree 5 or less (G5 and G5.1, and G5.2 of order 6 or less without weights) are thus
//! kept as they are. Where the curve stops as a function of its parameter (control points on each other, a cusp) or turns
//! within next to nothing, what is smaller than the tolerance becomes a point, at which direction may jump.

use super::bezier::{Bezier, Contact, minus};

/// Greatest distance between a curve and what is run, mm.
pub(super) const TOLERANCE_MM: f64 = 1e-4;
/// The part of it for quintics; the rest is for what becomes a point.
const QUINTIC_MM: f64 = TOLERANCE_MM / 2.0;
/// A part of the curve of this size, of which no quintic is found, becomes a point, mm.
const POINT_MM: f64 = TOLERANCE_MM / 16.0;
/// Parts around a point that do not fit it are taken into it up to this size, mm.
const POINTS_MM: f64 = TOLERANCE_MM / 2.0;
/// Cosine of the angle between a quintic's chord and its direction anywhere: 0.45 rad.
const TURN_COS: f64 = 0.9;
/// Least pace of a quintic, as part of its greatest.
const PACE_MIN: f64 = 0.2;
/// How often a span may be halved.
const HALVINGS: u32 = 48;
/// Most parts of a curve.
const PARTS_MAX: usize = 200_000;

/// One end of a quintic.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    pub(super) q: [f64; 2],
    /// q' by length.
    pub(super) d1: [f64; 2],
    /// q'' by length.
    pub(super) d2: [f64; 2],
    /// Length per parameter, and its derivative by the parameter.
    pub(super) pace: f64,
    pub(super) pace_change: f64,
}

/// A part of what is run.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part {
    Line { from: [f64; 2], to: [f64; 2] },
    Quintic { from: End, to: End },
}

/// A part of the curve, and what it comes to.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    from: [f64; 2],
    to: [f64; 2],
    /// Size, mm.
    extent: f64,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Line,
    Quintic(End, End),
    /// So small that it may become a point: a place of it, and the pace there.
    Point {
        middle: [f64; 2],
        pace: f64,
    },
}

/// Follows a curve, whose spans come with the number of derivatives that go on into them. `None`: it takes too many parts.
pub(super) fn follow(spans: impl Iterator<Item = (usize, Bezier)>) -> Option<Vec<Part>> {
    let mut leaves = Vec::new();
    let mut before: Option<Shared> = None;
    for (continuity, span) in spans {
        let start = Shared::new(&span.start());
        let start = match (before, start) {
            // Equal but for rounding, which must not look like a corner.
            (Some(before), Some(_)) if continuity >= 2 => Some(before),
            (Some(before), Some(own)) if continuity == 1 => Some(Shared { d1: before.d1, ..own }),
            (_, own) => own,
        };
        let end = Shared::new(&span.end());
        divide(span, start, end, HALVINGS, &mut leaves)?;
        before = end;
    }
    Some(joined(&leaves))
}

/// Direction and curvature of the curve at a place, shared by both sides.
#[derive(Clone, Copy)]
struct Shared {
    d1: [f64; 2],
    d2: [f64; 2],
}

impl Shared {
    /// `None` where the curve stops as a function of its parameter.
    fn new(at: &Contact) -> Option<Shared> {
        let pace = length(&at.first);
        let d1 = at.first.map(|x| x / pace);
        let change = dot(&d1, &at.second);
        let d2 = [0, 1].map(|axis| (at.second[axis] - change * d1[axis]) / (pace * pace));
        let finite = d1.iter().chain(&d2).all(|x| x.is_finite());
        finite.then_some(Shared { d1, d2 })
    }

    fn end(&self, at: &Contact) -> End {
        End {
            q: at.q,
            d1: self.d1,
            d2: self.d2,
            pace: length(&at.first),
            pace_change: dot(&self.d1, &at.second),
        }
    }
}

/// Adds what follows a part of the curve.
fn divide(
    curve: Bezier,
    start: Option<Shared>,
    end: Option<Shared>,
    halvings: u32,
    leaves: &mut Vec<Leaf>,
) -> Option<()> {
    let (from, to) = (curve.start(), curve.end());
    let extent = curve.extent();
    let kind = if halvings == HALVINGS && curve.is_straight() {
        Some(Kind::Line)
    } else if let Some(quintic) = quintic(&curve, start, end) {
        Some(quintic)
    } else if extent <= POINT_MM {
        let middle = curve.halves()[0].end();
        Some(Kind::Point {
            middle: middle.q,
            pace: length(&middle.first),
        })
    } else {
        None
    };
    if let Some(kind) = kind {
        leaves.push(Leaf {
            from: from.q,
            to: to.q,
            extent,
            kind,
        });
        return (leaves.len() <= PARTS_MAX).then_some(());
    }
    let halvings = halvings.checked_sub(1)?;
    let [first, second] = curve.halves();
    let middle = Shared::new(&first.end());
    divide(first, start, middle, halvings, leaves)?;
    divide(second, middle, end, halvings, leaves)
}

/// The quintic with the ends of the curve, if it is near enough.
fn quintic(curve: &Bezier, start: Option<Shared>, end: Option<Shared>) -> Option<Kind> {
    let (from, to) = (start?.end(&curve.start()), end?.end(&curve.end()));
    let points = control_points(&from, &to);
    (is_even(&points) && curve.off(&points) <= QUINTIC_MM).then_some(Kind::Quintic(from, to))
}

/// Bézier points of the quintic between two ends.
fn control_points(from: &End, to: &End) -> [[f64; 2]; 6] {
    let mut points = [[0.0; 2]; 6];
    // One axis at a time; the points lie across the rows.
    #[allow(clippy::needless_range_loop)]
    for axis in 0..2 {
        let first = |end: &End| end.d1[axis] * end.pace;
        let second = |end: &End| end.d2[axis] * end.pace * end.pace + end.d1[axis] * end.pace_change;
        let (a, b) = (from.q[axis], to.q[axis]);
        points[0][axis] = a;
        points[1][axis] = a + first(from) / 5.0;
        points[2][axis] = a + 2.0 * first(from) / 5.0 + second(from) / 20.0;
        points[3][axis] = b - 2.0 * first(to) / 5.0 + second(to) / 20.0;
        points[4][axis] = b - first(to) / 5.0;
        points[5][axis] = b;
    }
    points
}

/// Whether a quintic turns little and never gets slow: so do the steps between its Bézier points, of which its derivative is
/// a mean everywhere.
fn is_even(points: &[[f64; 2]; 6]) -> bool {
    let chord = minus(&points[5], &points[0]);
    let size = length(&chord);
    let (mut least, mut greatest) = (f64::INFINITY, 0.0f64);
    for pair in points.windows(2) {
        let step = minus(&pair[1], &pair[0]);
        let along = dot(&step, &chord) / size;
        // Not so for NaN.
        let turns_little = along >= TURN_COS * length(&step);
        if !turns_little {
            return false;
        }
        least = least.min(along);
        greatest = greatest.max(length(&step));
    }
    least > PACE_MIN * greatest
}

/// Joins what has become points: one place for those that follow each other, at which the parts beside them end and begin.
fn joined(leaves: &[Leaf]) -> Vec<Part> {
    let (Some(first), Some(last)) = (leaves.first(), leaves.last()) else {
        return Vec::new();
    };
    let (first, last) = (first.from, last.to);
    let mut parts: Vec<Measured> = Vec::new();
    let mut k = 0;
    // Where the last part ends, and the size of the point there, if it is one.
    let (mut at, mut point) = (first, None);
    while let Some(leaf) = leaves.get(k) {
        if let Kind::Point { .. } = leaf.kind {
            let run = gather(leaves, k);
            let place = if run.to == leaves.len() { last } else { run.place };
            let beside_point = point.is_some();
            (at, point) = if k == 0 {
                (first, Some(run.extent))
            } else if beside_point {
                parts.extend(Measured::line(at, place, run.extent));
                (place, Some(run.extent))
            } else {
                end_at(&mut parts, place, run.extent, first)
            };
            k = run.to;
        } else {
            let extent = leaf.extent + point.take().unwrap_or(0.0);
            match begun(leaf, at) {
                Some(part) => parts.push(Measured { part, extent }),
                None => {
                    parts.extend(Measured::line(at, leaf.from, extent));
                    parts.extend(begun(leaf, leaf.from).map(|part| Measured { part, extent }));
                }
            }
            at = leaf.to;
            k += 1;
        }
    }
    parts.extend(Measured::line(at, last, 0.0));
    parts.into_iter().map(|measured| measured.part).collect()
}

/// A part and the size of that of the curve which it stands for.
struct Measured {
    part: Part,
    extent: f64,
}

impl Measured {
    fn line(from: [f64; 2], to: [f64; 2], extent: f64) -> Option<Measured> {
        (from != to).then_some(Measured {
            part: Part::Line { from, to },
            extent,
        })
    }
}

/// Leaves that become one point.
struct Run {
    /// The one behind the last of them.
    to: usize,
    /// Where the curve is slowest in it: the tip of a cusp.
    place: [f64; 2],
    extent: f64,
}

/// The point that begins with a leaf: it takes what follows if that is small, too, and would be spoilt by beginning at the
/// point.
fn gather(leaves: &[Leaf], from: usize) -> Run {
    let mut run = Run {
        to: from,
        place: leaves[from].from,
        extent: 0.0,
    };
    let mut slowest = f64::INFINITY;
    while let Some(leaf) = leaves.get(run.to) {
        if run.to > from && run.extent + leaf.extent > POINTS_MM {
            break;
        }
        match leaf.kind {
            Kind::Point { middle, pace } if pace < slowest => (slowest, run.place) = (pace, middle),
            Kind::Point { .. } => {}
            Kind::Line | Kind::Quintic(..) if begun(leaf, run.place).is_some() => break,
            Kind::Line | Kind::Quintic(..) => {}
        }
        run.extent += leaf.extent;
        run.to += 1;
    }
    run
}

/// What a leaf comes to if it begins at a place near its beginning; `None`: nothing, or a curve that is spoilt by this.
fn begun(leaf: &Leaf, q: [f64; 2]) -> Option<Part> {
    match leaf.kind {
        Kind::Quintic(from, to) => {
            let from = End { q, ..from };
            is_even(&control_points(&from, &to)).then_some(Part::Quintic { from, to })
        }
        Kind::Line => (q != leaf.to).then_some(Part::Line { from: q, to: leaf.to }),
        Kind::Point { .. } => None,
    }
}

/// Lets the parts so far end at a point; small ones that would be spoilt by this become part of it. Where it is then, which
/// is the beginning of the curve if none is left, and its size.
fn end_at(parts: &mut Vec<Measured>, q: [f64; 2], size: f64, first: [f64; 2]) -> ([f64; 2], Option<f64>) {
    let mut sum = size;
    while let Some(last) = parts.last_mut() {
        let (ended, end) = match last.part {
            Part::Quintic { from, to } => {
                let moved = End { q, ..to };
                let even = is_even(&control_points(&from, &moved));
                (even.then_some(Part::Quintic { from, to: moved }), to.q)
            }
            Part::Line { from, to } => ((from != q).then_some(Part::Line { from, to: q }), to),
        };
        if let Some(part) = ended {
            last.part = part;
            return (q, Some(sum));
        }
        if sum + last.extent > POINTS_MM {
            parts.extend(Measured::line(end, q, sum));
            return (q, Some(sum));
        }
        sum += last.extent;
        parts.pop();
    }
    (first, Some(sum))
}

fn dot(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn length(vector: &[f64; 2]) -> f64 {
    libm::hypot(vector[0], vector[1])
}
