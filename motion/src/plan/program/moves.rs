//! Lines, arcs and probing moves: pieces within the travel, with their feed and what may happen at their end.
//!
//! In:  ends and centres in work coordinates.
//! Out: moves in machine coordinates.

use std::f64::consts::TAU;

use super::{Corner, Entry, Move, Program};
use crate::canon::{PathMode, Plane, Position, ProbeMode};
use crate::element::{Element, Enables, Probing};
use crate::path::{Circle, Group, Piece};
use crate::plan::{PlanErrorKind, Settings, probing, travel};

/// Most turns of an arc: its knots, some dozens a turn, are in memory together.
const TURNS_MAX: u32 = 1000;

impl Program {
    /// A straight move until a contact changes, from rest to rest.
    pub(super) fn probe(
        &mut self,
        to: &Position,
        mode: ProbeMode,
        line: u32,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        match self.straight(to, line, false, settings)? {
            Some(Entry::Move(Move { piece, feed, line, .. })) => {
                let limits = probing::limits_along(&piece, settings)?;
                Ok(Some(Entry::Rest(Element::Probing(Probing {
                    piece,
                    mode,
                    feed,
                    limits,
                    line,
                }))))
            }
            // A caller would wait for a move that never comes.
            None => Err(PlanErrorKind::Unsupported("a probing move of no length")),
            other => Ok(other),
        }
    }

    pub(super) fn straight(
        &mut self,
        to: &Position,
        line: u32,
        rapid: bool,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        let end = self.frame.machine(to);
        if end.0.iter().any(|x| !x.is_finite()) {
            return Err(PlanErrorKind::NotFinite);
        }
        match Piece::line(self.position, end) {
            Some(piece) => self
                .accept(piece, end, line, rapid, settings)
                .map(Entry::Move)
                .map(Some),
            None => Ok(None),
        }
    }

    pub(super) fn accept(
        &mut self,
        piece: Piece,
        end: Position,
        line: u32,
        rapid: bool,
        settings: &Settings,
    ) -> Result<Move, PlanErrorKind> {
        let piece = piece.in_frame(self.tool_frame);
        travel::check(&piece, settings)?;
        let feed = if rapid {
            f64::INFINITY
        } else {
            let feed = self.feed.ok_or(PlanErrorKind::NoFeedRate)?;
            let per_s = if self.per_turn { self.turns_s(settings)? } else { 1.0 };
            let delta = std::array::from_fn(|i| end.0[i] - self.position.0[i]);
            match Group::from_delta(&delta) {
                Some(Group::Rotary) => feed.degrees_s * per_s,
                Some(Group::Main | Group::Parallel) | None => feed.mm_s * per_s,
            }
        };
        self.position = end;
        self.take_outputs();
        let corner = match self.mode {
            PathMode::ExactPath => Corner::Exact,
            PathMode::ExactStop => Corner::Stop,
            PathMode::Continuous { tolerance_mm, .. } => {
                let tolerance = tolerance_mm.unwrap_or(settings.tolerance_mm);
                if tolerance > 0.0 {
                    Corner::Round(tolerance)
                } else {
                    Corner::Exact
                }
            }
        };
        let naive_cam_mm = match self.mode {
            PathMode::Continuous {
                naive_cam_tolerance_mm, ..
            } => naive_cam_tolerance_mm.unwrap_or(0.0),
            PathMode::ExactPath | PathMode::ExactStop => 0.0,
        };
        Ok(Move {
            piece,
            feed,
            line,
            rapid,
            enables: Enables {
                spindle_speed: self.per_turn,
                ..self.enables
            },
            auxiliary: self.auxiliary,
            corner,
            naive_cam_mm,
        })
    }

    pub(super) fn arc(
        &self,
        to: &Position,
        plane: Plane,
        centre_mm: [f64; 2],
        turns: i32,
    ) -> Result<Piece, PlanErrorKind> {
        if let Plane::Uv | Plane::Wu | Plane::Vw = plane {
            return Err(PlanErrorKind::Unsupported(
                "an arc in the planes of U, V and W (G17.1 to G19.1)",
            ));
        }
        if turns.unsigned_abs() > TURNS_MAX {
            return Err(PlanErrorKind::Unsupported("an arc of more than 1000 turns"));
        }
        let [first, second, normal] = plane.axes();
        let mut centre = *to;
        centre[first] = centre_mm[0];
        centre[second] = centre_mm[1];
        let centre = Group::Main.pick(&self.frame.machine(&centre).0);
        let [first, second, normal] = [first, second, normal].map(|axis| self.frame.direction(axis));
        let end = self.frame.machine(to);
        if end.0.iter().chain(&centre).any(|x| !x.is_finite()) {
            return Err(PlanErrorKind::NotFinite);
        }
        let angle_and_radius = |q: &Position| {
            let arm = [0, 1, 2].map(|i| q.0[i] - centre[i]);
            let part = |unit: &[f64; 3]| arm[0] * unit[0] + arm[1] * unit[1] + arm[2] * unit[2];
            let (x, y) = (part(&first), part(&second));
            (libm::atan2(y, x), libm::hypot(x, y))
        };
        let ((from, radius), (until, _)) = (angle_and_radius(&self.position), angle_and_radius(&end));
        let mut sweep = if turns > 0 { until - from } else { from - until }.rem_euclid(TAU);
        // Equal end points are a full turn; so are those that differ by the rounding of a computed program.
        if sweep * radius < 1e-9 || (TAU - sweep) * radius < 1e-9 {
            sweep = TAU;
        }
        sweep += TAU * f64::from(turns.unsigned_abs().saturating_sub(1));
        let circle = Circle {
            start: self.position,
            end,
            centre_mm: centre,
            normal,
            sweep_rad: if turns > 0 { sweep } else { -sweep },
        };
        Piece::arc(&circle).filter(|_| turns != 0).ok_or(PlanErrorKind::BadArc)
    }
}
