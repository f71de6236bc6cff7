//! Curves: G5 (cubic), G5.1 (quadratic), G5.2 and G5.3 (NURBS), G6.2 (NURBS with knots).
//!
//! In:  control points in words: those of a Bézier curve on one line, those of a NURBS on lines of their own.
//! Out: the curve itself ([`Call::NurbsFeed`]) or arcs that follow it, as [`Settings::splines`](crate::Settings) says.
//!
//! LinuxCNC's rules: G5 and G5.1 in the XY plane only, NURBS in those of X, Y and Z; G5 and G5.1 leave the modal motion as
//! it was; while a NURBS is open the current point stays at its start, so that in G91 every control point counts from
//! there.
//!
//! G6.2 has a knot K on each line, control points with their weights R first, then as many lines with K alone as the order
//! P of the first line says. The knots end it: the last is there as often as the order. Q, which of LinuxCNC's three ways
//! to follow the curve is meant, is of no effect: all of them are within our tolerance.

mod biarc;
mod curve;

use super::feed::PathLength;
use crate::Splines;
use crate::block::{Block, letters};
use crate::code::{FeedUnit, Motion, integer_in, plane_name};
use crate::error::{ErrorKind, SplineError};
use crate::scan::Fault;
use crate::state::{Calls, Nurbs, State};
use biarc::{PIECES_MAX, Piece};
use curve::Curve;
use motion::canon::{Axis, Call, Plane, Position};

/// Order of a NURBS without L.
const NURBS_ORDER: u32 = 3;

/// Most control points of a NURBS.
pub(crate) const NURBS_POINTS_MAX: usize = 10_000;

/// Arcs by which a curve is measured follow it so nearly, mm.
const LENGTH_TOLERANCE_MM: f64 = 0.001;

impl State {
    pub(super) fn spline(&mut self, motion: Motion, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        if self.modal.plane != Plane::Xy {
            let plane = plane_name(self.modal.plane);
            return Err(block.motion_span().fault(SplineError::Plane { plane }));
        }
        self.check_curve(block)?;
        if block.first_axis().is_none() {
            let code = self.motion_name(block);
            return Err((block.motion_span(), ErrorKind::AxisMissing { code }));
        }
        self.check_curve_feed(block)?;
        let to = self.end(block)?;
        let (start, end) = (in_plane(self.at, Plane::Xy), in_plane(to, Plane::Xy));
        let points = if motion == Motion::QuadraticSpline {
            let first = self.pair(block, *b"IJ", |missing| SplineError::FirstPoint {
                code: "G5.1",
                missing,
            })?;
            vec![start, sum(start, first), end]
        } else {
            let first = if block.has(letters(b"IJ")) {
                self.pair(block, *b"IJ", |missing| SplineError::FirstPoint { code: "G5", missing })?
            } else {
                self.spline_leaves // goes on smoothly behind another G5
            };
            let last = self.pair(block, *b"PQ", |missing| SplineError::LastPoint { missing })?;
            self.spline_leaves = last.map(|mm| -mm);
            vec![start, sum(start, first), sum(end, last), end]
        };
        let order = points.len() as u32;
        let points = points.into_iter().map(|point| (point, 1.0)).collect();
        self.curve(points, order, Vec::new(), to, block, calls)
    }

    /// Refuses what would leave control points of an open NURBS behind.
    pub(crate) fn check_nurbs_closed(&self, motion: Option<Motion>) -> Result<(), ErrorKind> {
        let Some(nurbs) = &self.nurbs else { return Ok(()) };
        let points = nurbs.points.len();
        let error = match (&nurbs.knots, motion) {
            (None, Some(Motion::Nurbs | Motion::NurbsEnd)) => return Ok(()),
            (Some(_), Some(Motion::NurbsKnot | Motion::NurbsKnotEnd)) => return Ok(()),
            (None, _) => SplineError::NotClosed { points },
            (Some(_), _) => SplineError::KnotsMissing {
                points,
                order: nurbs.order,
            },
        };
        Err(ErrorKind::Spline(error))
    }

    /// A line of a NURBS: its first one may tell the weight of the start, all others are control points.
    pub(super) fn nurbs_point(&mut self, block: &Block) -> Result<(), Fault> {
        self.check_curve(block)?;
        if self.modal.feed_unit != FeedUnit::InverseTime {
            self.check_curve_feed(block)?;
        }
        let span = block.motion_span();
        let weight = block.word_value(b'P');
        let order = match block.word_value(b'L') {
            None => None,
            Some(value) => match integer_in(value, 0..=NURBS_POINTS_MAX as i64) {
                Some(order) => Some(order as u32),
                None => return Err(block.span(b'L').fault(SplineError::Order { value })),
            },
        };
        if let Some(value) = weight
            && value <= 0.0
        {
            return Err(block.span(b'P').fault(SplineError::Weight { value }));
        }
        let first = self.nurbs.is_none();
        let point = self.control_point(block, "G5.2")?;
        if !first && point.is_none() {
            return Err(span.fault(SplineError::StartWeightLate));
        }
        if !first && weight.is_none() {
            return Err(span.fault(SplineError::WeightMissing));
        }
        let plane = self.modal.plane;
        let start = in_plane(self.at, plane);
        let weight = weight.unwrap_or(1.0);
        let nurbs = self.nurbs.get_or_insert_with(|| Nurbs {
            order: NURBS_ORDER,
            plane,
            knots: None,
            points: vec![(start, if point.is_none() { weight } else { 1.0 })],
        });
        if let Some(order) = order {
            nurbs.order = nurbs.order.max(order);
        }
        if let Some(point) = point {
            if nurbs.points.len() >= NURBS_POINTS_MAX {
                return Err(span.fault(SplineError::TooManyPoints { max: NURBS_POINTS_MAX }));
            }
            nurbs.points.push((point, weight));
        }
        Ok(())
    }

    /// The control point of a line, if it has one.
    fn control_point(&self, block: &Block, code: &'static str) -> Result<Option<[f64; 2]>, Fault> {
        let [first, second, _] = self.modal.plane.axes();
        let missing = match [first, second].map(|axis| block.axis(axis).is_some()) {
            [true, true] => return Ok(Some(in_plane(self.end(block)?, self.modal.plane))),
            [false, false] => return Ok(None),
            [true, false] => second.letter(),
            [false, true] => first.letter(),
        };
        Err(block
            .motion_span()
            .fault(SplineError::PointIncomplete { code, missing }))
    }

    pub(super) fn end_nurbs(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let span = block.motion_span();
        self.modal.motion = None;
        let Some(Nurbs { order, points, .. }) = self.nurbs.take() else {
            return Err(span.fault(SplineError::NotOpen));
        };
        if let Some(letter) = block.first_axis() {
            return Err(block.span(letter).fault(SplineError::EndWithPoint));
        }
        if points.len() < order as usize {
            let points = points.len();
            return Err(span.fault(SplineError::TooFewPoints { order, points }));
        }
        let to = self.end_of_points(&points);
        self.curve(points, order, Vec::new(), to, block, calls)
    }

    /// Where a curve with these control points ends.
    fn end_of_points(&self, points: &[([f64; 2], f64)]) -> Position {
        let [first, second, _] = self.modal.plane.axes();
        let mut to = self.at;
        if let Some((last, _)) = points.last() {
            [to[first], to[second]] = *last;
        }
        to
    }

    /// G6.2: a control point with its knot, or one of the knots behind the points. The last knot tells the curve.
    pub(super) fn nurbs_knot(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        self.check_curve(block)?;
        if self.modal.feed_unit != FeedUnit::InverseTime {
            self.check_curve_feed(block)?;
        }
        let span = block.motion_span();
        let order = match block.word_value(b'P') {
            None => None,
            Some(value) => match integer_in(value, 2..=NURBS_POINTS_MAX as i64) {
                Some(order) => Some(order as u32),
                None => return Err(block.span(b'P').fault(SplineError::KnotOrder { value })),
            },
        };
        if let Some(value) = block.word_value(b'Q')
            && integer_in(value, 1..=3).is_none()
        {
            return Err(block.span(b'Q').fault(SplineError::KnotWay { value }));
        }
        let weight = block.word_value(b'R').unwrap_or(1.0);
        if weight <= 0.0 {
            return Err(block.span(b'R').fault(SplineError::KnotWeight { value: weight }));
        }
        let point = self.control_point(block, "G6.2")?;
        let Some(knot) = block.word_value(b'K') else {
            return Err(span.fault(SplineError::KnotMissing));
        };
        let plane = self.modal.plane;
        let mut nurbs = match (self.nurbs.take(), order) {
            (Some(nurbs), _) => nurbs,
            (None, None) => return Err(span.fault(SplineError::KnotOrderMissing)),
            (None, Some(order)) => Nurbs {
                order,
                plane,
                knots: Some(Vec::new()),
                points: Vec::new(),
            },
        };
        nurbs.order = order.unwrap_or(nurbs.order);
        let mut knots = nurbs.knots.take().unwrap_or_default();
        if let Some(last) = knots.last()
            && knot < *last
        {
            let (value, before) = (knot, *last);
            return Err(block.span(b'K').fault(SplineError::KnotFalls { value, before }));
        }
        if point.is_some() && knots.len() > nurbs.points.len() {
            return Err(span.fault(SplineError::PointBehindKnots));
        }
        if knots.len() >= NURBS_POINTS_MAX {
            return Err(span.fault(SplineError::TooManyPoints { max: NURBS_POINTS_MAX }));
        }
        nurbs.points.extend(point.map(|point| (point, weight)));
        knots.push(knot);
        let order = nurbs.order as usize;
        let ends = knots.len() > order && knots[knots.len() - order] == knot;
        if !ends {
            nurbs.knots = Some(knots);
            self.nurbs = Some(nurbs);
            return Ok(());
        }
        self.modal.motion = None;
        let Nurbs { order, points, .. } = nurbs;
        let wanted = knots.len() - order as usize;
        if points.len() != wanted || wanted < order as usize {
            let points = points.len();
            return Err(span.fault(SplineError::KnotCount {
                points,
                knots: knots.len(),
                order,
            }));
        }
        let degree = order as usize - 1;
        let torn = (1..wanted).find(|at| knots[*at] == knots[at + degree]);
        if knots[0] != knots[degree] || torn.is_some() {
            return Err(span.fault(SplineError::KnotEnds { order }));
        }
        // LinuxCNC's curve begins at its first point, wherever the tool is.
        let mut start = self.at;
        let [first, second, _] = plane.axes();
        [start[first], start[second]] = points[0].0;
        if start != self.at {
            calls.push_back(Call::StraightFeed { to: start });
            self.at = start;
        }
        let to = self.end_of_points(&points);
        self.curve(points, order, knots, to, block, calls)
    }

    /// G6.3: of no effect behind the last knot of G6.2, which ends the curve.
    pub(super) fn end_nurbs_knots(&mut self, block: &Block) -> Result<(), Fault> {
        self.modal.motion = None;
        match (self.nurbs.take(), block.first_axis()) {
            (Some(Nurbs { points, order, .. }), _) => {
                let points = points.len();
                Err(block.motion_span().fault(SplineError::KnotsMissing { points, order }))
            }
            (None, Some(letter)) => Err(block.span(letter).fault(SplineError::EndWithPoint)),
            (None, None) => Ok(()),
        }
    }

    /// Tells a curve that begins at the current point.
    fn curve(
        &mut self,
        points: Vec<([f64; 2], f64)>,
        order: u32,
        knots: Vec<f64>,
        to: Position,
        block: &Block,
        calls: &mut Calls,
    ) -> Result<(), Fault> {
        let plane = self.modal.plane;
        let [first, second, _] = plane.axes();
        let pieces = |tolerance_mm| {
            let pieces = biarc::pieces(&Curve::new(&points, order, &knots), tolerance_mm);
            if pieces.len() > PIECES_MAX {
                let max = PIECES_MAX;
                return Err(block.motion_span().fault(SplineError::TooManyPieces { max }));
            }
            Ok(pieces)
        };
        let length_mm = |pieces: &[Piece]| PathLength::Mm(pieces.iter().map(Piece::length_mm).sum());
        match self.settings.splines {
            Splines::Nurbs | Splines::Timed => {
                if self.settings.splines == Splines::Timed && self.modal.feed_unit == FeedUnit::InverseTime {
                    let pieces = pieces(LENGTH_TOLERANCE_MM)?;
                    self.need_feed(block, || length_mm(&pieces), calls)?;
                }
                calls.push_back(Call::NurbsFeed {
                    plane,
                    points,
                    order,
                    knots,
                });
            }
            Splines::Arcs { tolerance_mm } => {
                let pieces = pieces(tolerance_mm)?;
                self.need_feed(block, || length_mm(&pieces), calls)?;
                for (index, piece) in pieces.iter().enumerate() {
                    let mut end = to;
                    if index + 1 < pieces.len() {
                        [end[first], end[second]] = piece.end;
                    }
                    calls.push_back(match piece.arc {
                        Some(arc) => Call::ArcFeed {
                            to: end,
                            plane,
                            centre_mm: arc.centre_mm,
                            turns: arc.turns,
                        },
                        None => Call::StraightFeed { to: end },
                    });
                }
            }
        }
        self.at = to;
        Ok(())
    }

    /// The rules of all curves.
    fn check_curve(&self, block: &Block) -> Result<(), Fault> {
        let span = block.motion_span();
        if self.compensation.cutter.is_some() {
            return Err(span.fault(SplineError::Compensated));
        }
        let plane = self.modal.plane;
        if let Plane::Uv | Plane::Wu | Plane::Vw = plane {
            let plane = plane_name(plane);
            return Err(span.fault(SplineError::Plane { plane }));
        }
        if self.nurbs.as_ref().is_some_and(|nurbs| nurbs.plane != plane) {
            return Err(span.fault(SplineError::PlaneChange));
        }
        let [first, second, _] = plane.axes();
        let other = |axis: &Axis| ![first, second].contains(axis) && block.axis(*axis).is_some();
        match Axis::ALL.into_iter().find(other) {
            Some(axis) => {
                let [letter, first, second] = [axis, first, second].map(Axis::letter);
                Err(block
                    .span(letter as u8)
                    .fault(SplineError::OtherAxis { letter, first, second }))
            }
            None => Ok(()),
        }
    }

    /// A curve needs a feed. In G93 that of the whole is told with its pieces; LinuxCNC tells none for the curve itself.
    fn check_curve_feed(&self, block: &Block) -> Result<(), Fault> {
        self.need_feed(block, || PathLength::Mm(0.0), &mut Calls::new())
    }

    /// Two lengths of a line, mm.
    fn pair(&self, block: &Block, names: [u8; 2], error: impl Fn(char) -> SplineError) -> Result<[f64; 2], Fault> {
        let mm = self.modal.unit.mm();
        match names.map(|letter| block.word_value(letter)) {
            [Some(first), Some(second)] => Ok([first * mm, second * mm]),
            [None, _] => Err(block.motion_span().fault(error(names[0].into()))),
            [Some(_), None] => Err(block.motion_span().fault(error(names[1].into()))),
        }
    }
}

fn in_plane(position: Position, plane: Plane) -> [f64; 2] {
    let [first, second, _] = plane.axes();
    [position[first], position[second]]
}

fn sum(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

#[cfg(test)]
mod tests;
