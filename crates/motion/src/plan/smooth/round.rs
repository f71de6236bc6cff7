//! One rounded corner.
//!
//! In:  the two legs, how much of each may be used, the tolerance.
//! Out: a blend with continuous direction and curvature that stays within the tolerance, and where it begins and ends.

use super::overlap::Overlap;
use crate::canon::AXES;
use crate::path::{BlendEnd, Group, Jet, Piece, Shape};

/// A corner, rounded.
#[derive(Clone, Copy, Debug)]
pub(in crate::plan) struct Rounded {
    /// What is taken from the end of the first leg.
    pub(in crate::plan) before: f64,
    pub(in crate::plan) blend: Piece,
    /// Its second half, where it has two.
    pub(in crate::plan) second: Option<Piece>,
    /// What is taken from the beginning of the second leg.
    pub(in crate::plan) after: f64,
}

/// Where the inner control points lie on the legs, as parts of the distance from the vertex, by interior angle in
/// degrees. Found by search for the shortest time under limits of acceleration and jerk.
const SHAPES: [(f64, f64, f64); 5] = [
    (45.0, 0.72, 0.48),
    (90.0, 0.60, 0.28),
    (135.0, 0.58, 0.18),
    (171.0, 0.60, 0.14),
    (180.0, 0.60, 0.14),
];

/// The same for corners that are passed slowly: nearly cubic, which is constant jerk where the parameter grows evenly in time.
const SLOW_SHAPES: [(f64, f64, f64); 5] = [
    (60.0, 0.354, 0.096),
    (90.0, 0.40, 0.10),
    (120.0, 0.44, 0.12),
    (135.0, 0.462, 0.156),
    (160.0, 0.53, 0.166),
];

/// Where the inner control points lie on the legs of a corner that turns by so much, radians.
pub(super) fn fast_ratios(turning: f64) -> (f64, f64) {
    shape(&SHAPES, 180.0 - turning.to_degrees())
}

/// The same where it is passed slowly.
pub(super) fn slow_ratios(turning: f64) -> (f64, f64) {
    shape(&SLOW_SHAPES, 180.0 - turning.to_degrees())
}

fn shape(shapes: &[(f64, f64, f64)], interior_deg: f64) -> (f64, f64) {
    let mut at = shapes[0];
    for &next in shapes {
        if interior_deg <= next.0 {
            let x = if next.0 > at.0 {
                ((interior_deg - at.0) / (next.0 - at.0)).max(0.0)
            } else {
                0.0
            };
            return (at.1 + x * (next.1 - at.1), at.2 + x * (next.2 - at.2));
        }
        at = next;
    }
    (at.1, at.2)
}

/// By how much the blend of size `d` of tangent legs is off, per `d²` and jump of curvature; a little more than it is, so
/// that the first try is good.
const TANGENT: f64 = 0.025;

/// A smaller corner is not rounded and a shorter stretch is no curve, mm: on it, rounding of numbers would be motion.
const SIZE_MIN: f64 = 1e-6;

/// The curve between two states of motion; `None` where it is too short for one, or would nearly stop on its way.
pub(super) fn curve(from: &BlendEnd, to: &BlendEnd, group: Group) -> Option<Piece> {
    Piece::blend(from, to, group).filter(|piece| piece.length() >= SIZE_MIN)
}

/// A blend of bent legs that is not off by enough is at most so much larger in the next try.
const GROWTH: f64 = 2.0;

/// Distance of two points over all nine axes; a degree counts as a millimetre.
pub(in crate::plan) fn distance(a: &[f64; AXES], b: &[f64; AXES]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Angle between two directions, radians.
pub(in crate::plan) fn turning(group: Group, a: &Jet, b: &Jet) -> f64 {
    let (a, b) = (group.pick(&a.d1), group.pick(&b.d1));
    let (mut less, mut more) = (0.0, 0.0);
    for i in 0..3 {
        less += (a[i] - b[i]) * (a[i] - b[i]);
        more += (a[i] + b[i]) * (a[i] + b[i]);
    }
    2.0 * libm::atan2(less.sqrt(), more.sqrt())
}

/// Distance from the vertex at which a corner of two straight legs must begin for its crest to be `tolerance` away.
pub(in crate::plan) fn reach(group: Group, a: &Jet, b: &Jet, tolerance: f64) -> f64 {
    let ratios = fast_ratios(turning(group, a, b));
    tolerance / off_per_size(ratios, distance(&a.d1, &b.d1))
}

/// How far the blend of two straight legs is off, by its size; `gap` is the length of the difference of their directions.
fn off_per_size((p1, p2): (f64, f64), gap: f64) -> f64 {
    gap * (1.0 + 5.0 * p1 + 10.0 * p2) / 32.0
}

/// Rounds a corner that is passed fast, using up to `room` of each leg. `None`: nothing to round, or no curve found.
#[cfg(test)]
pub(in crate::plan) fn round(a: &Piece, room_a: f64, b: &Piece, room_b: f64, tolerance: f64) -> Option<Rounded> {
    let ratios = fast_ratios(turning(a.group(), &a.jet(a.length()), &b.jet(0.0)));
    round_as(ratios, a, room_a, b, room_b, tolerance)
}

/// The same with inner control points at these parts of the size.
///
/// How far the blend of two straight legs is off is known, and proportional to its size `d`; bent legs add what goes about
/// with its square. These two factors are found from the blends themselves, and `d` is chosen so that the tolerance is used up.
pub(super) fn round_as(
    ratios: (f64, f64),
    a: &Piece,
    room_a: f64,
    b: &Piece,
    room_b: f64,
    tolerance: f64,
) -> Option<Rounded> {
    let (end, start) = (a.jet(a.length()), b.jet(0.0));
    let straight = matches!((a.shape(), b.shape()), (Shape::Line(_), Shape::Line(_)));
    let (gap, bend) = (distance(&end.d1, &start.d1), distance(&end.d2, &start.d2));
    if gap < 1e-9 && (straight || bend < 1e-9) {
        return None;
    }
    let room = room_a.min(room_b);
    // Off by linear d + square d².
    let mut linear = off_per_size(ratios, gap);
    let rounded = |d, blend| Rounded {
        before: d,
        blend,
        second: None,
        after: d,
    };
    if straight {
        let d = room.min(tolerance / linear);
        return try_size(a, b, d, ratios).map(|blend| rounded(d, blend));
    }
    let mut square = TANGENT * bend;
    let (mut best, mut most) = (None, room);
    // Size, and by how much off per size: of the last blend within the tolerance, and of the last one beyond it.
    let (mut within, mut beyond): (Option<[f64; 2]>, Option<[f64; 2]>) = (None, None);
    for _ in 0..10 {
        let aim = 0.95 * tolerance;
        // Not a number where the legs bend towards each other and the blend is never so much off.
        let root = 2.0 * aim / (linear + (linear * linear + 4.0 * square * aim).sqrt());
        let d = within.map_or(most, |[d, _]| most.min(GROWTH * d));
        let d = if root < d { root } else { d };
        let Some(blend) = try_size(a, b, d, ratios) else {
            most = 0.5 * d;
            continue;
        };
        let off = deviation(&blend, a, b, d);
        if off <= tolerance {
            best = Some(rounded(d, blend));
            within = Some([d, off / d]);
            if off > 0.85 * tolerance || d >= 0.98 * most {
                break;
            }
        } else {
            most = 0.98 * d;
            beyond = Some([d, off / d]);
        }
        if let (Some([low, less]), Some([high, more])) = (within, beyond) {
            square = (more - less) / (high - low);
            linear = less - square * low;
        } else {
            square = (off / d - linear) / d;
        }
    }
    best
}

/// The blend that begins and ends `d` from the vertex.
fn try_size(a: &Piece, b: &Piece, d: f64, (p1, p2): (f64, f64)) -> Option<Piece> {
    if d < SIZE_MIN {
        return None;
    }
    let (pace, pace_change) = (5.0 * (1.0 - p1) * d, 20.0 * (2.0 * p1 - p2 - 1.0) * d);
    let from = BlendEnd {
        leg: a.jet(a.length() - d),
        pace,
        pace_change,
    };
    let to = BlendEnd {
        leg: b.jet(d),
        pace,
        pace_change: -pace_change,
    };
    Piece::blend(&from, &to, a.group())
}

/// Steps in which each half of a corner of this size is compared with its leg: so many a radian by which the more bent of the legs
/// turns on the way, and at least for one. Between two places that are too far apart a curve about a small arc leaves the tolerance.
fn steps(a_radian: f64, legs: [&Piece; 2], size: f64) -> usize {
    /// Bounds the work: only of arcs far smaller than the tolerance a blend takes so many radians.
    const TURN_MAX: f64 = 100.0;
    let [a, b] = legs;
    let ends = [(a, a.length() - size), (a, a.length()), (b, 0.0), (b, size)];
    let bend = |(leg, s): (&Piece, f64)| distance(&leg.jet(s).d2, &[0.0; AXES]);
    let turn = size * ends.map(bend).into_iter().fold(0.0, f64::max);
    (a_radian * turn.clamp(1.0, TURN_MAX)).ceil() as usize
}

/// Greatest distance between a blend and the legs that it replaces, both ways, a little on the safe side: the first half
/// is compared with the first leg, the second with the second. It takes `size` of both.
fn deviation(blend: &Piece, a: &Piece, b: &Piece, size: f64) -> f64 {
    let vertex = b.position(0.0).0;
    let length = blend.length();
    let Shape::Blend(curve) = blend.shape() else {
        return f64::INFINITY;
    };
    let half = steps(6.0, [a, b], size);
    let (mut off, mut missed) = (0.0f64, f64::INFINITY);
    for k in 1..2 * half {
        let x = k as f64 / (2 * half) as f64;
        let q = curve.position_at(x);
        let near = if k <= half {
            let end = a.length();
            nearest(a, &q, end - size, end, end - 0.5 * length * (1.0 - 2.0 * x))
        } else {
            nearest(b, &q, 0.0, size, 0.5 * length * (2.0 * x - 1.0))
        };
        off = off.max(near.0);
        if 3 * k.abs_diff(half) < half {
            missed = missed.min(distance(&q, &vertex));
        }
    }
    1.01 * off.max(missed)
}

/// The same of two blends that meet about at the corner, each of which is near its leg only.
fn deviation_of_halves(halves: &[Piece; 2], legs: [&Piece; 2], size: f64) -> f64 {
    let steps = steps(24.0, legs, size);
    let vertex = legs[1].position(0.0).0;
    let mut off = distance(&halves[1].position(0.0).0, &vertex);
    for (side, (half, leg)) in halves.iter().zip(legs).enumerate() {
        let Shape::Blend(curve) = half.shape() else {
            return f64::INFINITY;
        };
        let (from, to) = if side == 0 {
            (leg.length() - size, leg.length())
        } else {
            (0.0, size)
        };
        for k in 0..=steps {
            let x = k as f64 / steps as f64;
            off = off.max(nearest(leg, &curve.position_at(x), from, to, from + x * size).0);
        }
    }
    1.02 * off
}

/// Passes a corner in this shape, whose size for straight legs is given.
pub(super) fn overlap(shape: &Overlap, a: &Piece, b: &Piece, size: f64, tolerance: f64) -> Option<Rounded> {
    const TRIES: usize = 4;
    let straight = matches!((a.shape(), b.shape()), (Shape::Line(_), Shape::Line(_)));
    let mut size = size;
    for _ in 0..TRIES {
        if size < SIZE_MIN {
            return None;
        }
        let halves = shape.blends(a, b, size, a.group())?;
        let off = if straight {
            0.0
        } else {
            deviation_of_halves(&halves, [a, b], size)
        };
        if off <= tolerance {
            let [blend, second] = halves;
            return Some(Rounded {
                before: size,
                blend,
                second: Some(second),
                after: size,
            });
        }
        size *= 0.95 * tolerance / off;
    }
    None
}

/// Distance of `q` from the stretch of a leg, and where, found from a first guess by steps along the tangent.
pub(in crate::plan) fn nearest(leg: &Piece, q: &[f64; AXES], from: f64, to: f64, guess: f64) -> (f64, f64) {
    if let Some(nearest) = leg.nearest(q, [from, to], guess) {
        return nearest;
    }
    let mut s = guess.clamp(from, to);
    for _ in 0..4 {
        let (here, tangent) = leg.tangent(s);
        let (mut along, mut square) = (0.0, 0.0);
        for (d1, (q, here)) in tangent.iter().zip(q.iter().zip(&here)) {
            along += (q - here) * d1;
            square += d1 * d1;
        }
        let next = (s + along / square).clamp(from, to);
        // So near, the distance is the same to the last digits that matter.
        if (next - s).abs() * square.sqrt() < 1e-10 {
            return (distance(q, &here), s);
        }
        s = next;
    }
    (distance(q, &leg.position(s).0), s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canon::Position;
    use crate::path::Circle;

    #[test]
    fn the_crest_of_a_straight_corner_is_the_tolerance_away() {
        let corner = Position::xyz(10.0, 0.0, 0.0);
        let a = Piece::line(Position::ZERO, corner).unwrap();
        for degrees in [5.0f64, 30.0, 60.0, 90.0, 120.0, 150.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let b = Piece::line(corner, Position::xyz(10.0 + 10.0 * cos, 10.0 * sin, 0.0)).unwrap();
            let rounded = round(&a, 5.0, &b, 5.0, 0.01).unwrap();
            let crest = rounded.blend.position(rounded.blend.length() / 2.0);
            assert!((distance(&crest.0, &corner.0) - 0.01).abs() < 1e-9, "{degrees}");
        }
        // 90 degrees: eps/d = 0.3005 for the ratios 0.60 and 0.28.
        let b = Piece::line(corner, Position::xyz(10.0, 10.0, 0.0)).unwrap();
        assert!((round(&a, 5.0, &b, 5.0, 0.01).unwrap().before - 0.01 / 0.3005).abs() < 1e-5);
    }

    #[test]
    fn a_tangent_arc_is_entered_with_continuous_curvature() {
        let a = Piece::line(Position::xyz(-20.0, 0.0, 0.0), Position::ZERO).unwrap();
        let circle = Circle {
            start: Position::ZERO,
            end: Position::xyz(5.0, 5.0, 0.0),
            centre_mm: [0.0, 5.0, 0.0],
            normal: [0.0, 0.0, 1.0],
            sweep_rad: std::f64::consts::FRAC_PI_2,
        };
        let b = Piece::arc(&circle).unwrap();
        let rounded = round(&a, 10.0, &b, b.length() / 2.0, 0.01).unwrap();
        assert!(rounded.before > 0.5, "{}", rounded.before);
        let (first, last) = (rounded.blend.jet(0.0), rounded.blend.jet(rounded.blend.length()));
        assert!(distance(&first.d2, &[0.0; AXES]) < 1e-9);
        assert!(distance(&last.d2, &b.jet(rounded.after).d2) < 1e-9);
        // Every point within the tolerance of the line before the arc or of the circle.
        for k in 0..=1000 {
            let q = rounded.blend.position(rounded.blend.length() * f64::from(k) / 1000.0).0;
            let off = if q[0] < 0.0 {
                q[1].abs()
            } else {
                (q[0].hypot(q[1] - 5.0) - 5.0).abs()
            };
            assert!(off <= 0.01, "{off}");
        }
    }

    #[test]
    fn nothing_is_rounded_where_nothing_turns() {
        let a = Piece::line(Position::ZERO, Position::xyz(1.0, 1.0, 0.0)).unwrap();
        let b = Piece::line(Position::xyz(1.0, 1.0, 0.0), Position::xyz(3.0, 3.0, 0.0)).unwrap();
        assert!(round(&a, 0.5, &b, 1.0, 0.01).is_none());
    }
}
