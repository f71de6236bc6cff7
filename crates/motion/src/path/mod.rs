//! Geometry of the path: nine axes over arc length.
//!
//! In:  end points, circles and corner legs in machine coordinates, from [`crate::plan`].
//! Out: positions and derivatives by arc length, to the planner and, one position per cycle, to the cycle thread.
//!
//! A [`Piece`] is plain data of fixed size. Its `s` runs from 0 to [`Piece::length`]: millimetres along XYZ if one of
//! them moves, else millimetres along UVW, else degrees along ABC. That is the length to which a feed rate refers, but for straight
//! moves of which that part is next to nothing ([`Group::from_delta`]). The axes outside that group turn evenly along.

mod arc;
mod blend;
mod line;

use crate::canon::{AXES, Position};
use crate::kinematics::ToolFrame;

pub use arc::{Arc, Circle};
pub use blend::{Blend, BlendEnd};
pub use line::Line;

/// Position and its first three derivatives by arc length, one value per axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jet {
    /// Position, mm or degrees.
    pub q: [f64; AXES],
    /// q', per unit of length.
    pub d1: [f64; AXES],
    /// q'', per unit of length squared.
    pub d2: [f64; AXES],
    /// q''', per unit of length cubed.
    pub d3: [f64; AXES],
}

/// The three axes along which length is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// X Y Z, mm.
    Main,
    /// U V W, mm.
    Parallel,
    /// A B C, degrees.
    Rotary,
}

/// An axis that is to move no farther than this does not move, mm or degrees: what computing a position leaves behind is below it, and
/// any step of a drive far above. It is also what LinuxCNC's canonical layer takes for no motion.
pub const NO_MOVE: f64 = 1e-8;

/// How far axes outside of the group that measures a piece may move for each unit of its length. Steeper, and a length that a number can
/// just tell apart would be motion of theirs.
const STEEPEST: f64 = 1e4;

impl Group {
    const ALL: [Group; 3] = [Group::Main, Group::Parallel, Group::Rotary];

    /// The group to which the feed of a straight move by `delta` refers: the first of which an axis moves, see [`NO_MOVE`]. `None` when
    /// nothing moves.
    pub fn of_feed(delta: &[f64; AXES]) -> Option<Group> {
        let moves = |group: &Group| group.pick(delta).iter().any(|x| x.abs() > NO_MOVE);
        let least = |group: &Group| group.norm(delta) > 0.0;
        Group::ALL
            .into_iter()
            .find(moves)
            .or_else(|| Group::ALL.into_iter().find(least))
    }

    /// The group that measures a straight move by `delta`: that of the feed, unless another one moves so much farther that its motion
    /// could not be told by the length of that. `None` when nothing moves.
    pub fn from_delta(delta: &[f64; AXES]) -> Option<Group> {
        // Nearly all moves.
        if delta[3..].iter().all(|x| *x == 0.0) {
            return (Group::Main.norm(delta) > 0.0).then_some(Group::Main);
        }
        let of_feed = Group::of_feed(delta)?;
        let length = of_feed.norm(delta);
        let steeper = |group: &Group| group.norm(delta) > STEEPEST * length;
        Some(Group::ALL.into_iter().find(steeper).unwrap_or(of_feed))
    }

    /// The first of its three axes. RT.
    pub const fn first(self) -> usize {
        match self {
            Group::Main => 0,
            Group::Rotary => 3,
            Group::Parallel => 6,
        }
    }

    /// The part of a nine-axis vector that belongs to this group. RT.
    pub const fn pick(self, vector: &[f64; AXES]) -> [f64; 3] {
        let first = self.first();
        [vector[first], vector[first + 1], vector[first + 2]]
    }

    /// Length of the part that belongs to this group. RT.
    pub fn norm(self, vector: &[f64; AXES]) -> f64 {
        let part = self.pick(vector);
        dot3(&part, &part).sqrt()
    }
}

/// One stretch of path.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// Where the piece begins on its shape.
    from: f64,
    length: f64,
    shape: Shape,
    /// How its axes are meant.
    frame: ToolFrame,
}

/// What a [`Piece`] is made of.
// The blend is by far the largest; boxing it would put an allocation into data that the cycle thread copies.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// Straight.
    Line(Line),
    /// Circle, helix or spiral.
    Arc(Arc),
    /// Rounded corner.
    Blend(Blend),
}

impl Piece {
    /// Straight from `start` to `end`; `None` when they are equal.
    pub fn line(start: Position, end: Position) -> Option<Piece> {
        let line = Line::new(start, end)?;
        Some(Piece {
            from: 0.0,
            length: line.length(),
            shape: Shape::Line(line),
            frame: ToolFrame::OFF,
        })
    }

    /// Circle, helix or spiral; `None` when its radius or its turn is zero or a number is not finite.
    pub fn arc(circle: &Circle) -> Option<Piece> {
        let arc = Arc::new(circle)?;
        Some(Piece {
            from: 0.0,
            length: arc.length(),
            shape: Shape::Arc(arc),
            frame: ToolFrame::OFF,
        })
    }

    /// Rounded corner between two states of motion; `None` when the curve would nearly stop on its way.
    pub fn blend(from: &BlendEnd, to: &BlendEnd, group: Group) -> Option<Piece> {
        let blend = Blend::new(from, to, group)?;
        Some(Piece {
            from: 0.0,
            length: blend.length(),
            shape: Shape::Blend(blend),
            frame: ToolFrame::OFF,
        })
    }

    /// Length in mm, or in degrees when only rotary axes move. RT.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Axes along which the length is counted. RT.
    pub fn group(&self) -> Group {
        match &self.shape {
            Shape::Line(line) => line.group(),
            Shape::Arc(_) => Group::Main,
            Shape::Blend(blend) => blend.group(),
        }
    }

    /// Position at `s`, which is clamped to the piece; at the end of a line or an arc, and nearer to it than sums of lengths are exact, the end
    /// that was programmed, to the last bit. RT: bounded, no allocation, no panic.
    pub fn position(&self, s: f64) -> Position {
        let s = self.from + s.clamp(0.0, self.length);
        match &self.shape {
            Shape::Line(line) => line.position(s),
            Shape::Arc(arc) => arc.position(s),
            Shape::Blend(blend) => blend.position(s),
        }
    }

    /// Position and derivatives at `s`, which is clamped to the piece. RT: bounded, no allocation, no panic.
    pub fn jet(&self, s: f64) -> Jet {
        let s = self.from + s.clamp(0.0, self.length);
        match &self.shape {
            Shape::Line(line) => line.jet(s),
            Shape::Arc(arc) => arc.jet(s),
            Shape::Blend(blend) => blend.jet(s),
        }
    }

    /// The part of the curve of an arc on which the piece lies: parts of its turn; nothing to know of other shapes.
    pub fn turn_range(&self) -> [f64; 2] {
        match &self.shape {
            Shape::Arc(arc) => [self.from, self.from + self.length].map(|s| arc.parameter(s)),
            Shape::Line(_) | Shape::Blend(_) => [0.0, 1.0],
        }
    }

    /// Position and its first derivative at `s`, which is clamped to the piece: less work than a whole jet.
    pub fn tangent(&self, s: f64) -> ([f64; AXES], [f64; AXES]) {
        match &self.shape {
            Shape::Arc(arc) => arc.tangent(self.from + s.clamp(0.0, self.length)),
            Shape::Line(_) | Shape::Blend(_) => {
                let jet = self.jet(s);
                (jet.q, jet.d1)
            }
        }
    }

    /// Distance of `q` over all nine axes (a degree counts as a millimetre) from the stretch between two lengths, and where it
    /// is nearest, if there is a closed form for that: on lines and on flat arcs that are circles but for rounding. Of places
    /// on a circle that are several turns apart, that next to `guess`.
    pub fn nearest(&self, q: &[f64; AXES], stretch: [f64; 2], guess: f64) -> Option<(f64, f64)> {
        let of_shape = stretch.map(|s| self.from + s);
        let (distance, s) = match &self.shape {
            Shape::Line(line) => Some(line.nearest(q, of_shape)),
            Shape::Arc(arc) => arc.nearest(q, of_shape, self.from + guess),
            Shape::Blend(_) => None,
        }?;
        // Rounding must not lead beyond.
        Some((distance, (s - self.from).clamp(stretch[0], stretch[1])))
    }

    /// Greatest |q'|, |q''| and |q'''| of each axis, where they are known in closed form: not on blends, and not on spirals
    /// that are more than a circle with a rounded end point.
    pub fn greatest_derivatives(&self) -> Option<[[f64; AXES]; 3]> {
        match &self.shape {
            Shape::Line(line) => Some([line.jet(0.0).d1.map(f64::abs), [0.0; AXES], [0.0; AXES]]),
            Shape::Arc(arc) => arc.greatest_derivatives(self.from, self.from + self.length),
            Shape::Blend(_) => None,
        }
    }

    /// What the piece is made of.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Places from `from` to `to` by the part of the parameter of a curve between them, of lines and arcs by that of the length:
    /// a corner that is passed slowly is run about evenly by it.
    pub(crate) fn by_parameter(&self, from: f64, to: f64) -> impl Fn(f64) -> f64 + '_ {
        let ends = match &self.shape {
            Shape::Blend(blend) => Some((blend, [from, to].map(|s| blend.parameter(self.from + s)))),
            Shape::Line(_) | Shape::Arc(_) => None,
        };
        move |part| match ends {
            Some((blend, [begin, end])) => blend.length_to(begin + part * (end - begin)) - self.from,
            None => from + part * (to - from),
        }
    }

    /// The stretch from `from` to `to` of this piece; `None` when it is empty, or only rounding makes it more than that.
    pub fn cut(&self, from: f64, to: f64) -> Option<Piece> {
        /// As a part of the length.
        const ROUNDING: f64 = 1e-13;
        let (from, to) = (from.max(0.0), to.min(self.length));
        (to - from > ROUNDING * self.length).then_some(Piece {
            from: self.from + from,
            length: to - from,
            ..*self
        })
    }

    /// Whether it is the very same piece, not only another one along the same way.
    pub(crate) fn is(&self, other: &Piece) -> bool {
        let alike = self.from == other.from && self.length == other.length && self.frame == other.frame;
        alike
            && match (&self.shape, &other.shape) {
                (Shape::Line(a), Shape::Line(b)) => a.is(b),
                (Shape::Arc(a), Shape::Arc(b)) => a.is(b),
                (Shape::Blend(a), Shape::Blend(b)) => a.is(b),
                (Shape::Line(_) | Shape::Arc(_) | Shape::Blend(_), _) => false,
            }
    }

    /// The same positions of the axes, meant as `frame` says. A new piece has no tool-centre-point control.
    #[must_use]
    pub fn in_frame(self, frame: ToolFrame) -> Piece {
        Piece { frame, ..self }
    }

    /// From now on its positions of the axes are meant as `frame` says.
    pub fn set_frame(&mut self, frame: ToolFrame) {
        self.frame = frame;
    }

    /// How the axes of this piece are meant: what kinematics need besides their positions. RT.
    pub fn frame(&self) -> &ToolFrame {
        &self.frame
    }
}

/// Where a piece leads, in little memory: most are straight, and any piece has room for the largest shape. How its axes are
/// meant is left out.
#[derive(Clone, Debug)]
pub enum PackedPiece {
    /// A stretch of a straight line.
    Line {
        /// Where it begins on the line.
        from: f64,
        /// Its length.
        length: f64,
        /// The line.
        line: Line,
    },
    /// Any other.
    Other(Box<Piece>),
}

impl From<&Piece> for PackedPiece {
    fn from(piece: &Piece) -> PackedPiece {
        match piece.shape {
            Shape::Line(line) => PackedPiece::Line {
                from: piece.from,
                length: piece.length,
                line,
            },
            Shape::Arc(_) | Shape::Blend(_) => PackedPiece::Other(Box::new(*piece)),
        }
    }
}

impl From<PackedPiece> for Piece {
    fn from(packed: PackedPiece) -> Piece {
        match packed {
            PackedPiece::Line { from, length, line } => Piece {
                from,
                length,
                shape: Shape::Line(line),
                frame: ToolFrame::OFF,
            },
            PackedPiece::Other(piece) => *piece,
        }
    }
}

/// A part of a whole, the whole where only rounding is missing. RT.
fn snapped(u: f64) -> f64 {
    /// What the sums of some dozens of lengths leave.
    const ROUNDING: f64 = 2e-14;
    if u > 1.0 - ROUNDING { 1.0 } else { u }
}

fn distance(a: &[f64; AXES], b: &[f64; AXES]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn dot3(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// First three derivatives of the first `N` axes.
pub type Derivatives<const N: usize> = [[f64; N]; 3];

/// Changes derivatives by a curve parameter into derivatives by length. RT.
///
/// `first` is the first of the three axes that measure the length.
#[inline]
fn by_length<const N: usize>(mut derivatives: Derivatives<N>, first: usize) -> Derivatives<N> {
    let [d1, d2, d3] = &mut derivatives;
    let dot =
        |a: &[f64; N], b: &[f64; N]| a[first] * b[first] + a[first + 1] * b[first + 1] + a[first + 2] * b[first + 2];
    let u1 = 1.0 / dot(d1, d1).sqrt();
    let speed_u = dot(d1, d2) * u1;
    let speed_uu = (dot(d2, d2) + dot(d1, d3) - speed_u * speed_u) * u1;
    let square = u1 * u1;
    let cube = square * u1;
    let u2 = -speed_u * cube;
    let u3 = (-speed_uu + 3.0 * speed_u * speed_u * u1) * cube * u1;
    let coupled = 3.0 * u1 * u2;
    for axis in 0..N {
        let (a, b, c) = (d1[axis], d2[axis], d3[axis]);
        d1[axis] = a * u1;
        d2[axis] = b * square + a * u2;
        d3[axis] = c * cube + b * coupled + a * u3;
    }
    derivatives
}

/// Abscissae and weights of five-point Gauss integration over 0..1.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_24),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_24),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

/// The same of two points.
const SHORT_GAUSS: [(f64, f64); 2] = [(0.211_324_865_405_187_13, 0.5), (0.788_675_134_594_812_9, 0.5)];

/// Integral of `f` over `from..to`, exact for polynomials of a degree below twice the number of points. RT.
#[inline(always)]
fn integrate<const N: usize>(points: &[(f64, f64); N], from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    let width = to - from;
    let mut sum = 0.0;
    for (x, weight) in points {
        sum += weight * f(from + width * x);
    }
    width * sum
}

/// Intervals of the table that leads from length to curve parameter.
const INTERVALS: usize = 8;
const WIDTH: f64 = 1.0 / INTERVALS as f64;

/// Least length per parameter over the greatest, from which on one panel an interval is enough whatever the curve.
const EVEN: f64 = 0.5;
/// Part of the speed that may appear where one panel goes over into the next. At 100 mm/s and 1 ms, 1e-7 is a jerk of 10 mm/s³.
const EXACT: f64 = 3e-7;
/// Panels of an interval at the most.
const PANELS: u8 = 16;

/// Length over a curve parameter in 0..1 and back.
///
/// Positions by length follow from it, derivatives by length from the curve itself. So a length that is counted wrongly is motion
/// that nobody has planned: where it jumps by a part of itself, the speed of every axis does.
#[derive(Clone, Copy, Debug)]
struct LengthTable {
    /// Length up to parameter k / INTERVALS.
    s: [f64; INTERVALS + 1],
    /// Length per parameter there.
    speed: [f64; INTERVALS + 1],
    /// Equal panels of an interval, each of them integrated by five points: a power of two.
    panels: u8,
}

impl LengthTable {
    fn new(speed: impl Fn(f64) -> f64 + Copy) -> LengthTable {
        LengthTable::of_panels(1, speed)
    }

    fn of_panels(panels: u8, speed: impl Fn(f64) -> f64 + Copy) -> LengthTable {
        let mut table = LengthTable {
            s: [0.0; INTERVALS + 1],
            speed: [speed(0.0); INTERVALS + 1],
            panels,
        };
        for k in 0..INTERVALS {
            let from = k as f64 * WIDTH;
            table.s[k + 1] = table.through(k, from + WIDTH, speed);
            table.speed[k + 1] = speed(from + WIDTH);
        }
        table
    }

    /// With as many panels as it takes where the length nearly stands still, known its least and greatest length per parameter: a root
    /// of so little has a branch point beside the curve, and five points are right only from farther away.
    fn refined(self, [slowest, fastest]: [f64; 2], speed: impl Fn(f64) -> f64 + Copy) -> LengthTable {
        let mut table = self;
        while slowest < EVEN * fastest && table.panels < PANELS && !table.is_exact(speed) {
            table = LengthTable::of_panels(2 * table.panels, speed);
        }
        table
    }

    /// Whether the last quarter of every panel is as long as it is by itself.
    fn is_exact(&self, speed: impl Fn(f64) -> f64 + Copy) -> bool {
        let width = self.panel();
        (0..INTERVALS * usize::from(self.panels)).all(|k| {
            let from = k as f64 * width;
            let (late, to) = (from + 0.75 * width, from + width);
            let quarter = integrate(&GAUSS, late, to, speed);
            let counted = integrate(&GAUSS, from, to, speed) - integrate(&GAUSS, from, late, speed);
            (counted - quarter).abs() <= EXACT * quarter
        })
    }

    fn length(&self) -> f64 {
        self.s[INTERVALS]
    }

    fn panel(&self) -> f64 {
        WIDTH / f64::from(self.panels)
    }

    /// Length up to parameter `u`, which lies in interval `k`.
    fn through(&self, k: usize, u: f64, speed: impl Fn(f64) -> f64 + Copy) -> f64 {
        let (mut s, mut from) = (self.s[k], k as f64 * WIDTH);
        for _ in 1..self.panels {
            let to = from + self.panel();
            if to >= u {
                break;
            }
            s += integrate(&GAUSS, from, to, speed);
            from = to;
        }
        s + integrate(&GAUSS, from, u, speed)
    }

    /// Length up to parameter `u`.
    fn length_to(&self, u: f64, speed: impl Fn(f64) -> f64 + Copy) -> f64 {
        let k = ((u * INTERVALS as f64) as usize).min(INTERVALS - 1);
        self.through(k, u, speed)
    }

    /// Parameter at length `s`, with `pace` the length per parameter and its derivative. RT: one scan of the table and of the panels
    /// of an interval, a cubic guess, a step of Halley's method and one of Newton's that adds what it missed; up to three more of the
    /// first where the length per parameter changes by a multiple within an interval.
    #[inline]
    fn parameter(&self, s: f64, speed: impl Fn(f64) -> f64 + Copy, pace: impl Fn(f64) -> [f64; 2]) -> f64 {
        /// Step whose own length two points tell to the last digits.
        const NEAR: f64 = 2e-3;
        if s <= 0.0 {
            return 0.0;
        }
        if s >= self.length() {
            return 1.0;
        }
        let mut k = 0;
        while k + 1 < INTERVALS && self.s[k + 1] <= s {
            k += 1;
        }
        let width = self.panel();
        let mut from = k as f64 * WIDTH;
        let mut ends = [self.s[k], self.s[k + 1]];
        let mut speeds = [self.speed[k], self.speed[k + 1]];
        if self.panels > 1 {
            for _ in 1..self.panels {
                ends[1] = ends[0] + integrate(&GAUSS, from, from + width, speed);
                if ends[1] > s {
                    break;
                }
                ends = [ends[1], self.s[k + 1]];
                from += width;
            }
            speeds = [from, from + width].map(speed);
        }
        let span = ends[1] - ends[0];
        let x = (s - ends[0]) / span;
        let [slope0, slope1] = speeds.map(|speed| span / speed);
        let guess = x * x * (3.0 - 2.0 * x) * width + x * (1.0 - x) * ((1.0 - x) * slope0 - x * slope1);
        let mut u = from + guess.clamp(0.0, width);
        for _ in 0..4 {
            let [here, change] = pace(u);
            let missing = s - ends[0] - integrate(&GAUSS, from, u, speed);
            let step = missing / here;
            let bend = (0.5 * step * change / here).clamp(-0.5, 0.5);
            let mut to = (u + step / (1.0 + bend)).clamp(from, from + width);
            if step.abs() < NEAR {
                let missed = missing - integrate(&SHORT_GAUSS, u, to, speed);
                to = (to + missed / (here + change * (to - u))).clamp(from, from + width);
                return to;
            }
            u = to;
        }
        u
    }
}

#[cfg(test)]
mod tests;
