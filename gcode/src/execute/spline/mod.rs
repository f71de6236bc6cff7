//! Curves: G5 (cubic), G5.1 (quadratic), G5.2 and G5.3 (NURBS).
//!
//! In:  control points in words: those of a Bézier curve on one line, those of a NURBS on lines of their own.
//! Out: the curve itself ([`Call::NurbsFeed`]) or arcs that follow it, as [`Settings::splines`](crate::Settings) says.
//!
//! LinuxCNC's rules: XY plane only; G5 and G5.1 leave the modal motion as it was; while G5.2 is open the current point
//! stays at its start, so that in G91 every control point counts from there.

mod biarc;
mod curve;

use super::feed::PathLength;
use super::{Calls, motion_span};
use crate::Splines;
use crate::block::{Block, letters};
use crate::code::{FeedUnit, Motion, integer_in};
use crate::error::{ErrorKind, SplineError};
use crate::scan::Fault;
use crate::state::{Nurbs, State};
use biarc::{PIECES_MAX, Piece};
use curve::Curve;
use motion::canon::{Axis, Call, Plane, Position};

/// Order of a NURBS without L.
const NURBS_ORDER: u32 = 3;

/// Most control points of a NURBS.
pub(crate) const NURBS_POINTS_MAX: usize = 10_000;

/// Arcs by which a curve is measured follow it so nearly, mm.
const LENGTH_TOLERANCE_MM: f64 = 0.001;

/// Letters that no curve takes.
const OTHER_AXES: &[u8] = b"ZABCUVW";

fn fault<T>(span: crate::scan::Span, error: SplineError) -> Result<T, Fault> {
    Err((span, ErrorKind::Spline(error)))
}

impl State {
    pub(super) fn spline(&mut self, motion: Motion, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        self.check_curve(block)?;
        if block.first_axis().is_none() {
            let code = self.motion_name(block);
            return Err((motion_span(block), ErrorKind::AxisMissing { code }));
        }
        self.check_curve_feed(block)?;
        let to = self.end(block)?;
        let (start, end) = (xy(self.at), xy(to));
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
        self.curve(points, order, to, block, calls)
    }

    pub(super) fn nurbs(&mut self, motion: Motion, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        match motion {
            Motion::NurbsEnd => self.end_nurbs(block, calls),
            _ => self.nurbs_point(block),
        }
    }

    /// Refuses what would leave control points of an open NURBS behind.
    pub(super) fn check_nurbs_closed(&self, motion: Option<Motion>) -> Result<(), ErrorKind> {
        match (&self.nurbs, motion) {
            (None, _) | (Some(_), Some(Motion::Nurbs | Motion::NurbsEnd)) => Ok(()),
            (Some(nurbs), _) => Err(ErrorKind::Spline(SplineError::NotClosed {
                points: nurbs.points.len(),
            })),
        }
    }

    /// A line of a NURBS: its first one may tell the weight of the start, all others are control points.
    fn nurbs_point(&mut self, block: &Block) -> Result<(), Fault> {
        self.check_curve(block)?;
        if self.modal.feed_unit != FeedUnit::InverseTime {
            self.check_curve_feed(block)?;
        }
        let span = motion_span(block);
        let weight = block.word_value(b'P');
        let order = match block.word_value(b'L') {
            None => None,
            Some(value) => match integer_in(value, 0..=NURBS_POINTS_MAX as i64) {
                Some(order) => Some(order as u32),
                None => return fault(block.span(b'L'), SplineError::Order { value }),
            },
        };
        if let Some(value) = weight
            && value <= 0.0
        {
            return fault(block.span(b'P'), SplineError::Weight { value });
        }
        let first = self.nurbs.is_none();
        let point = match [b'X', b'Y'].map(|letter| block.has(letters(&[letter]))) {
            [true, true] => Some(xy(self.end(block)?)),
            [false, false] if first => None,
            [false, false] => return fault(span, SplineError::StartWeightLate),
            [true, false] => return fault(span, SplineError::PointIncomplete { missing: 'Y' }),
            [false, true] => return fault(span, SplineError::PointIncomplete { missing: 'X' }),
        };
        if !first && weight.is_none() {
            return fault(span, SplineError::WeightMissing);
        }
        let start = xy(self.at);
        let weight = weight.unwrap_or(1.0);
        let nurbs = self.nurbs.get_or_insert_with(|| Nurbs {
            order: NURBS_ORDER,
            points: vec![(start, if point.is_none() { weight } else { 1.0 })],
        });
        if let Some(order) = order {
            nurbs.order = nurbs.order.max(order);
        }
        if let Some(point) = point {
            if nurbs.points.len() >= NURBS_POINTS_MAX {
                return fault(span, SplineError::TooManyPoints { max: NURBS_POINTS_MAX });
            }
            nurbs.points.push((point, weight));
        }
        Ok(())
    }

    fn end_nurbs(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let span = motion_span(block);
        self.modal.motion = None;
        let Some(Nurbs { order, points }) = self.nurbs.take() else {
            return fault(span, SplineError::NotOpen);
        };
        if let Some(letter) = block.first_axis() {
            return fault(block.span(letter), SplineError::EndWithPoint);
        }
        if points.len() < order as usize {
            let points = points.len();
            return fault(span, SplineError::TooFewPoints { order, points });
        }
        let mut to = self.at;
        if let Some(([x, y], _)) = points.last() {
            (to[Axis::X], to[Axis::Y]) = (*x, *y);
        }
        self.curve(points, order, to, block, calls)
    }

    /// Tells a curve that begins at the current point.
    fn curve(
        &mut self,
        points: Vec<([f64; 2], f64)>,
        order: u32,
        to: Position,
        block: &Block,
        calls: &mut Calls,
    ) -> Result<(), Fault> {
        let pieces = |tolerance_mm| {
            let pieces = biarc::pieces(&Curve::new(&points, order), tolerance_mm);
            if pieces.len() > PIECES_MAX {
                let max = PIECES_MAX;
                return fault(motion_span(block), SplineError::TooManyPieces { max });
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
                    plane: Plane::Xy,
                    points,
                    order,
                });
            }
            Splines::Arcs { tolerance_mm } => {
                let pieces = pieces(tolerance_mm)?;
                self.need_feed(block, || length_mm(&pieces), calls)?;
                for (index, piece) in pieces.iter().enumerate() {
                    let mut end = to;
                    if index + 1 < pieces.len() {
                        [end[Axis::X], end[Axis::Y]] = piece.end;
                    }
                    calls.push_back(match piece.arc {
                        Some(arc) => Call::ArcFeed {
                            to: end,
                            plane: Plane::Xy,
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
        let span = motion_span(block);
        if self.cutter.is_some() {
            return fault(span, SplineError::Compensated);
        }
        if self.modal.plane != Plane::Xy {
            let plane = super::arc::ArcWords::of(self.modal.plane).plane;
            return fault(span, SplineError::Plane { plane });
        }
        match block.first_of(OTHER_AXES) {
            Some(letter) => fault(block.span(letter), SplineError::OtherAxis { letter: letter.into() }),
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
            [None, _] => fault(motion_span(block), error(names[0].into())),
            [Some(_), None] => fault(motion_span(block), error(names[1].into())),
        }
    }
}

fn xy(position: Position) -> [f64; 2] {
    [position[Axis::X], position[Axis::Y]]
}

fn sum(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

#[cfg(test)]
mod tests;
