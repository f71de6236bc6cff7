//! Circle, helix and spiral.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::{Group, Jet, LengthTable, by_length, distance, dot3, snapped};
use crate::canon::{AXES, Position};

/// Places of a spiral at which its farthest positions are looked for, a turn.
const SPIRAL_SAMPLES: f64 = 256.0;

/// How an arc is told: two end points, a centre and a turn about an axis.
#[derive(Clone, Copy, Debug)]
pub struct Circle {
    /// First point, machine coordinates, mm or degrees.
    pub start: Position,
    /// Last point, machine coordinates, mm or degrees.
    pub end: Position,
    /// A point on the axis, XYZ in mm.
    pub centre_mm: [f64; 3],
    /// Unit vector of the axis.
    pub normal: [f64; 3],
    /// Turn about the normal, radians, positive by the right-hand rule.
    pub sweep_rad: f64,
}

/// Circle, helix or spiral in XYZ; all other axes, and the height, go evenly with the angle.
#[derive(Clone, Copy, Debug)]
pub struct Arc {
    start: [f64; AXES],
    /// To the last bit, which trigonometry would miss.
    end: [f64; AXES],
    /// What goes evenly with the angle, over the whole arc: height along the normal and the other axes.
    even: [f64; AXES],
    /// Unit vector from the axis to the start point, and the one a quarter turn further in the direction of motion.
    radial: [f64; 3],
    tangential: [f64; 3],
    radius: f64,
    radius_change: f64,
    /// Radians, greater than 0.
    sweep: f64,
    length: f64,
    /// Length per part of the turn, less at the end than at the beginning by so much, where it changes evenly.
    slowing: f64,
    /// Only needed where the radius changes so much that length per angle does not change evenly.
    table: Option<LengthTable>,
}

impl Arc {
    pub(super) fn is(&self, other: &Arc) -> bool {
        self.start == other.start && self.end == other.end && self.sweep == other.sweep && self.radial == other.radial
    }

    pub(super) fn new(circle: &Circle) -> Option<Arc> {
        let (start, end, normal) = (circle.start.0, circle.end.0, circle.normal);
        let main = |q: &[f64; AXES]| Group::Main.pick(q);
        let arm = |q: &[f64; AXES]| {
            let q = main(q);
            let arm = [0, 1, 2].map(|i| q[i] - circle.centre_mm[i]);
            let height = dot3(&arm, &normal);
            ([0, 1, 2].map(|i| arm[i] - height * normal[i]), height)
        };
        let ((first, first_height), (last, last_height)) = (arm(&start), arm(&end));
        let radius = dot3(&first, &first).sqrt();
        let end_radius = dot3(&last, &last).sqrt();
        if !(radius > 0.0 && end_radius > 0.0 && circle.sweep_rad != 0.0) {
            return None;
        }
        let radial = first.map(|x| x / radius);
        let side = circle.sweep_rad.signum();
        let tangential = [
            side * (normal[1] * radial[2] - normal[2] * radial[1]),
            side * (normal[2] * radial[0] - normal[0] * radial[2]),
            side * (normal[0] * radial[1] - normal[1] * radial[0]),
        ];
        let mut even = [0.0; AXES];
        for axis in 0..AXES {
            even[axis] = if axis < 3 {
                (last_height - first_height) * normal[axis]
            } else {
                end[axis] - start[axis]
            };
        }
        // Differences that come from rounding are no spiral; any other would be a jump at the end.
        let change = end_radius - radius;
        let radius_change = if change.abs() < ROUNDING_MM { 0.0 } else { change };
        let sweep = circle.sweep_rad.abs();
        Arc {
            start,
            end,
            even,
            radial,
            tangential,
            radius,
            radius_change,
            sweep,
            length: 0.0,
            slowing: 0.0,
            table: None,
        }
        .measured()
    }

    /// Fills in the length.
    fn measured(mut self) -> Option<Arc> {
        let (begin, end) = (self.speed(0.0), self.speed(1.0));
        // Part of the length by which it differs from that of an even change of speed: speed² is a parabola.
        let height = Group::Main.norm(&self.even);
        let across = (self.radius_change * self.sweep).powi(2) * (self.radius_change.powi(2) + height * height);
        self.table = None;
        self.slowing = begin - end;
        self.length = 0.5 * (begin + end);
        if across.is_nan() || across >= 1e-13 * begin.powi(4) {
            let speed = |u: f64| self.speed(u);
            let table = LengthTable::new(speed).refined([begin.min(end), begin.max(end)], speed);
            self.length = table.length();
            self.table = Some(table);
        }
        (self.length.is_finite() && self.length > 0.0).then_some(self)
    }

    /// Length per part of the turn.
    fn speed(&self, u: f64) -> f64 {
        self.pace(u)[0]
    }

    /// Length per part of the turn and its derivative. RT.
    #[inline]
    fn pace(&self, u: f64) -> [f64; 2] {
        let height = Group::Main.norm(&self.even);
        let round = (self.radius + self.radius_change * u) * self.sweep;
        let speed = (round * round + self.radius_change * self.radius_change + height * height).sqrt();
        [speed, round * self.radius_change * self.sweep / speed]
    }

    /// Part of the turn, 0 to 1, at length `s` from its beginning. RT.
    pub(super) fn parameter(&self, s: f64) -> f64 {
        match &self.table {
            None if self.slowing == 0.0 => s / self.length,
            None => {
                // Within rounding of its end, the root may pass it.
                let begin = self.length + 0.5 * self.slowing;
                (2.0 * s / (begin + (begin * begin - 2.0 * self.slowing * s).sqrt())).min(1.0)
            }
            Some(table) => table.parameter(s, |u| self.speed(u), |u| self.pace(u)),
        }
    }

    pub(super) fn length(&self) -> f64 {
        self.length
    }

    /// Length of the whole arc, mm.
    pub fn length_mm(&self) -> f64 {
        self.length
    }

    /// A point on the axis of the circle, at the height of the start point.
    pub fn centre_mm(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.start[i] - self.radius * self.radial[i])
    }

    /// Unit vector about which the arc turns by the right-hand rule.
    pub fn turns_about(&self) -> [f64; 3] {
        let (a, b) = (self.radial, self.tangential);
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    }

    /// Angle of the whole arc, radians.
    pub fn sweep_rad(&self) -> f64 {
        self.sweep
    }

    /// Radius at the start, mm.
    pub fn radius_mm(&self) -> f64 {
        self.radius
    }

    /// Bounds of the position of an axis, not tight, at next to no cost.
    pub fn hull(&self, axis: usize) -> (f64, f64) {
        let (mut centre, mut out) = (self.start[axis], 0.0);
        if axis < 3 {
            centre -= self.radius * self.radial[axis];
            let farthest = self.radius.max(self.radius + self.radius_change);
            out = farthest * libm::hypot(self.radial[axis], self.tangential[axis]);
        }
        let even = self.even[axis];
        (centre + even.min(0.0) - out, centre + even.max(0.0) + out)
    }

    /// Least and greatest position of `axis` along the arc.
    pub fn reach(&self, axis: usize) -> (f64, f64) {
        let (start, end) = (self.start[axis], self.at(1.0)[axis]);
        let (mut low, mut high) = (start.min(end), start.max(end));
        if axis >= 3 {
            return (low, high);
        }
        let mut include = |q: f64| (low, high) = (low.min(q), high.max(q));
        if self.radius_change == 0.0 {
            // The position is r g cos(w u - phase) + e u and what does not change. Its slope is zero where
            // sin(w u - phase) = e / (g r w).
            let g = libm::hypot(self.radial[axis], self.tangential[axis]);
            let phase = libm::atan2(self.tangential[axis], self.radial[axis]);
            let first = libm::asin(self.even[axis] / (g * self.radius * self.sweep));
            for angle in [first, std::f64::consts::PI - first] {
                let near = angle + phase;
                // Where nothing turns along this axis, or it rises faster than it turns.
                if g == 0.0 || near.is_nan() {
                    continue;
                }
                // The first such place and the last: of those between, height only helps in one direction.
                let low_turn = near.rem_euclid(TAU) - near;
                let turns = ((self.sweep - near - low_turn) / TAU).floor();
                for turn in [-1.0, 0.0, turns, turns + 1.0].map(|turn| low_turn + turn * TAU) {
                    let u = (near + turn) / self.sweep;
                    if (0.0..=1.0).contains(&u) {
                        include(self.at(u)[axis]);
                    }
                }
            }
        } else {
            // On a spiral these places have no closed form: each lies beside a sample that is beyond its neighbours.
            let count = (SPIRAL_SAMPLES * self.sweep.abs() / TAU).ceil() + SPIRAL_SAMPLES;
            let place = |k: f64| (k / count).clamp(0.0, 1.0);
            let at = |u: f64| self.at(u)[axis];
            let mut last = [at(0.0), at(0.0)];
            for k in 0..=count as u32 + 1 {
                let k = f64::from(k);
                let next = at(place(k));
                for side in [1.0, -1.0] {
                    if side * last[1] >= side * last[0] && side * last[1] >= side * next {
                        include(self.farthest(axis, side, [place(k - 2.0), place(k)]));
                    }
                }
                last = [last[1], next];
            }
        }
        (low, high)
    }

    /// The farthest position of `axis` between two parameters, in the direction of `side`, where it rises to it and falls behind it.
    fn farthest(&self, axis: usize, side: f64, [mut from, mut to]: [f64; 2]) -> f64 {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let at = |u: f64| side * self.at(u)[axis];
        let (mut a, mut b) = (to - GOLDEN * (to - from), from + GOLDEN * (to - from));
        let (mut at_a, mut at_b) = (at(a), at(b));
        // Flat at the top: half of the digits of the place give all of the position.
        for _ in 0..40 {
            if at_a > at_b {
                (to, b, at_b) = (b, a, at_a);
                a = to - GOLDEN * (to - from);
                at_a = at(a);
            } else {
                (from, a, at_a) = (a, b, at_b);
                b = from + GOLDEN * (to - from);
                at_b = at(b);
            }
        }
        side * at_a.max(at_b)
    }

    /// RT.
    pub(super) fn position(&self, s: f64) -> Position {
        Position(self.at(snapped(self.parameter(s))))
    }

    fn at(&self, u: f64) -> [f64; AXES] {
        self.at_angle(u, libm::sincos(self.sweep * u))
    }

    fn at_angle(&self, u: f64, (sin, cos): (f64, f64)) -> [f64; AXES] {
        if u >= 1.0 {
            return self.end;
        }
        let radius = self.radius + self.radius_change * u;
        let mut q = self.start;
        for (axis, q) in q.iter_mut().enumerate() {
            *q += self.even[axis] * u;
        }
        let out = radius * cos - self.radius;
        for (q, (radial, tangential)) in q.iter_mut().zip(self.radial.iter().zip(&self.tangential)) {
            *q += out * radial + radius * sin * tangential;
        }
        q
    }

    pub(super) fn tangent(&self, s: f64) -> ([f64; AXES], [f64; AXES]) {
        let u = self.parameter(s);
        let (sin, cos) = libm::sincos(self.sweep * u);
        let around = (self.radius + self.radius_change * u) * self.sweep;
        let mut d1 = self.even;
        for (d1, (radial, tangential)) in d1.iter_mut().zip(self.radial.iter().zip(&self.tangential)) {
            *d1 += self.radius_change * (cos * radial + sin * tangential) + around * (cos * tangential - sin * radial);
        }
        let per_length = 1.0 / self.speed(u);
        (self.at_angle(u, (sin, cos)), d1.map(|x| x * per_length))
    }

    /// RT.
    pub(super) fn jet(&self, s: f64) -> Jet {
        self.jet_at(self.parameter(s))
    }

    /// Position and derivatives by length at the part `u` of the turn, 0 to 1. RT.
    pub fn jet_at(&self, u: f64) -> Jet {
        let (sin, cos) = libm::sincos(self.sweep * u);
        let (r, dr, w) = (self.radius + self.radius_change * u, self.radius_change, self.sweep);
        // r(u) times the unit vector of angle w u, derived three times by u, in radial and tangential parts.
        let mut derivatives = [self.even, [0.0; AXES], [0.0; AXES]];
        for (axis, (&out, &along)) in self.radial.iter().zip(&self.tangential).enumerate() {
            let radial = cos * out + sin * along;
            let tangential = cos * along - sin * out;
            derivatives[0][axis] += radial * dr + tangential * (r * w);
            derivatives[1][axis] = radial * (-r * w * w) + tangential * (2.0 * dr * w);
            derivatives[2][axis] = radial * (-3.0 * dr * w * w) + tangential * (-r * w * w * w);
        }
        let [d1, d2, d3] = by_length(derivatives, Group::Main.first());
        Jet {
            q: self.at_angle(u, (sin, cos)),
            d1,
            d2,
            d3,
        }
    }

    /// See [`super::Piece::nearest`].
    ///
    /// The radius is taken at the angle of `q`. On a nearly round spiral another place is a little nearer, by the square of
    /// its slope.
    pub(super) fn nearest(&self, q: &[f64; AXES], stretch: [f64; 2], guess: f64) -> Option<(f64, f64)> {
        if self.table.is_some() || !self.is_nearly_round() || self.even.iter().any(|x| *x != 0.0) {
            return None;
        }
        let mut off = [0.0; AXES];
        for axis in 0..AXES {
            off[axis] = q[axis] - self.start[axis];
        }
        let arm = [0, 1, 2].map(|i| off[i] + self.radius * self.radial[i]);
        let (x, y) = (dot3(&arm, &self.radial), dot3(&arm, &self.tangential));
        let [from, to, guess] = [stretch[0], stretch[1], guess].map(|s| self.parameter(s));
        let angle = libm::atan2(y, x);
        let turns = ((guess * self.sweep - angle) / TAU).round();
        let u = (angle + turns * TAU) / self.sweep;
        if u < from || u > to {
            let (u, s) = if u < from { (from, stretch[0]) } else { (to, stretch[1]) };
            return Some((distance(q, &self.at(u)), s));
        }
        let across = (x * x + y * y).sqrt() - (self.radius + self.radius_change * u);
        let mut square = across * across;
        for (arm, (radial, tangential)) in arm.iter().zip(self.radial.iter().zip(&self.tangential)) {
            let out = arm - x * radial - y * tangential;
            square += out * out;
        }
        square += off[3..].iter().map(|x| x * x).sum::<f64>();
        let s = u * (self.length + 0.5 * self.slowing * (1.0 - u));
        Some((square.sqrt(), s))
    }

    /// By how much it differs from a circle at the most, as parts: direction against that of the circle, angle at a length
    /// against an even turn, and radius.
    fn spread(&self) -> f64 {
        let spread = self.radius_change.abs() / self.radius.min(self.radius + self.radius_change);
        spread * (1.0 + self.sweep + 1.0 / self.sweep)
    }

    /// Whether it is a circle, or one whose end point has been rounded.
    fn is_nearly_round(&self) -> bool {
        self.spread() <= NEARLY_ROUND
    }

    /// Greatest |q'|, |q''| and |q'''| of each axis between two lengths; `None` on a spiral that is more than a circle whose
    /// end point has been rounded.
    pub(super) fn greatest_derivatives(&self, from: f64, to: f64) -> Option<[[f64; AXES]; 3]> {
        if !self.is_nearly_round() {
            return None;
        }
        // The change of curvature adds about as much to the third derivative.
        let off = self.spread();
        let per_length = self.sweep / self.length;
        let mut greatest = [[0.0; AXES]; 3];
        for axis in 0..AXES {
            let even = self.even[axis] / self.length;
            let (mut own, mut g) = ([even.abs(), 0.0, 0.0], 0.0);
            if axis < 3 {
                let (radial, tangential) = (self.radial[axis], self.tangential[axis]);
                g = self.radius * libm::hypot(radial, tangential);
                let phase = libm::atan2(tangential, radial);
                let (begin, end) = (per_length * from - phase, per_length * to - phase);
                // q = even + g cos(angle), derived three times.
                let (at_begin, at_end) = (libm::sincos(begin), libm::sincos(end));
                let sine = between(begin, end, [at_begin.0, at_end.0]);
                let cosine = between(begin + FRAC_PI_2, end + FRAC_PI_2, [at_begin.1, at_end.1]);
                let greater = |[a, b]: [f64; 2]| a.abs().max(b.abs());
                own = [
                    greater(sine.map(|sine| even - g * per_length * sine)),
                    g * per_length.powi(2) * greater(cosine),
                    g * per_length.powi(3) * greater(sine),
                ];
            }
            // Whatever goes evenly with the angle no longer does with the length.
            let mut around = g * per_length + even.abs();
            for (greatest, own) in greatest.iter_mut().zip(own) {
                greatest[axis] = own + 4.0 * off * (own + around);
                around *= per_length;
            }
        }
        Some(greatest)
    }
}

/// What rounding adds to a radius, mm.
const ROUNDING_MM: f64 = 1e-12;
/// Part by which an arc may differ from a circle for its bounds to be those of a circle, and a little.
const NEARLY_ROUND: f64 = 1e-3;

/// Least and greatest sine of the angles between two, whose sines are known.
fn between(begin: f64, end: f64, [a, b]: [f64; 2]) -> [f64; 2] {
    let passes = |angle: f64| ((begin - angle) / TAU).ceil() <= ((end - angle) / TAU).floor();
    [
        if passes(-FRAC_PI_2) { -1.0 } else { a.min(b) },
        if passes(FRAC_PI_2) { 1.0 } else { a.max(b) },
    ]
}
