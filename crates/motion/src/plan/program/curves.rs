//! Curves (G5, G5.1, G5.2, G6.2) to moves.
//!
//! In:  control points in work coordinates, knots.
//! Out: moves along lines and quintics, of which only the last ends as the mode of the program says.

use super::moves::is_no_move;
use super::{Corner, Entry, Program};
use crate::canon::Plane;
use crate::plan::curve::{self, Fault};
use crate::plan::smooth::round::distance;
use crate::plan::{PlanErrorKind, Settings};

/// How far from where the program stands a curve may begin: what the digits of a program take.
const START_MM: f64 = 1e-6;

impl Program {
    /// `points`: control points with weights.
    pub(super) fn curve(
        &mut self,
        plane: Plane,
        points: &[([f64; 2], f64)],
        order: u32,
        knots: &[f64],
        line: u32,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        if let Plane::Uv | Plane::Wu | Plane::Vw = plane {
            let what = "a curve in the planes of U, V and W (G17.1 to G19.1)";
            return Err(PlanErrorKind::Unsupported(what));
        }
        if self.pitch_mm.is_some() {
            return Err(PlanErrorKind::Unsupported("a curve in step with the spindle"));
        }
        let [first, second, _] = plane.axes();
        let mut work = self.frame.work(&self.position);
        let mut machine = |point: [f64; 2]| {
            (work[first], work[second]) = (point[0], point[1]);
            self.frame.machine(&work)
        };
        let mut end = self.position;
        if let [(begin, _), .., (last, _)] = points {
            let begin = machine(*begin);
            // In this order, so that NaN is refused further on.
            if distance(&begin.0, &self.position.0) > START_MM {
                let place = Box::new(begin);
                return Err(PlanErrorKind::CurveStart { place });
            }
            let last = machine(*last);
            // The axes outside the plane keep their bits.
            let moved = if plane == Plane::Xy { 0..2 } else { 0..3 };
            end.0[moved.clone()].copy_from_slice(&last.0[moved]);
        }
        let start = self.start();
        let near = |(point, _): &([f64; 2], f64)| is_no_move(&start, &machine(*point));
        if points.iter().all(near) && is_no_move(&start, &end) {
            return self.owe(end, line, false, settings).map(|()| None);
        }
        let plane = curve::Plane {
            start,
            first: self.frame.direction(first),
            second: self.frame.direction(second),
        };
        let mut pieces = curve::pieces(points, order, knots, &plane, &end).map_err(|fault| match fault {
            Fault::Malformed => PlanErrorKind::BadCurve {
                order,
                points: points.len(),
            },
            Fault::NotFinite => PlanErrorKind::NotFinite,
            Fault::Wild => PlanErrorKind::WildCurve,
        })?;
        let (position, owed) = (self.position, self.owed.clone());
        let moves = pieces
            .iter_mut()
            .map(|piece| {
                let end = piece.position(piece.length());
                self.accept(piece, end, line, false, settings)
            })
            .collect::<Result<Vec<_>, _>>();
        match &moves {
            Ok(_) => self.position = end,
            Err(_) => (self.position, self.owed) = (position, owed),
        }
        let mut moves = moves?;
        // Its parts are one move of the program.
        if let Some((_, inner)) = moves.split_last_mut() {
            for part in inner.iter_mut().filter(|part| part.corner == Corner::Stop) {
                part.corner = Corner::Exact;
            }
        }
        Ok((!moves.is_empty()).then_some(Entry::Curve(moves)))
    }
}
