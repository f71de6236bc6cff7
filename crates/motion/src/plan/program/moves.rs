//! Lines, arcs and probing moves: pieces within the travel, with their feed and what may happen at their end.
//!
//! In:  ends and centres in work coordinates.
//! Out: moves in machine coordinates.

use std::f64::consts::TAU;

use super::{Corner, Entry, Feed, Move, Program};
use crate::canon::{PathMode, Plane, Position, ProbeMode};
use crate::element::{Element, Enables, Probing};
use crate::path::{Circle, Group, NO_MOVE, Piece};
use crate::plan::{PlanErrorKind, Settings, probing, travel};

/// Ends of an arc that are nearer to each other are equal, mm.
const ROUNDING_MM: f64 = 1e-9;
/// Most turns of an arc: its knots, some dozens a turn, are in memory together.
const TURNS_MAX: u32 = 1000;

/// Whether no axis moves from one place to the other: the one place where that is decided.
pub(super) fn is_no_move(from: &Position, to: &Position) -> bool {
    from.0.iter().zip(&to.0).all(|(from, to)| (to - from).abs() <= NO_MOVE)
}

impl Feed {
    /// Along a piece that begins at `start`, in units of its length per second.
    fn along(&self, piece: &Piece, start: &Position) -> f64 {
        // What XYZ measure goes by their feed.
        if piece.group() == Group::Main {
            return self.mm_s;
        }
        let end = piece.position(piece.length());
        let delta = std::array::from_fn(|axis| end.0[axis] - start.0[axis]);
        let group = Group::of_feed(&delta).unwrap_or(piece.group());
        let feed = match group {
            Group::Main | Group::Parallel => self.mm_s,
            Group::Rotary => self.degrees_s,
        };
        feed * (piece.length() / group.norm(&delta))
    }
}

/// Longest time of one move, s: a year. What takes longer is mistyped, and planning it would never end either.
const MOVE_S_MAX: f64 = 365.0 * 86_400.0;

/// Whether a move of a length comes to its end in a time that anybody waits for.
pub(super) fn check_time(length: f64, feed: f64) -> Result<(), PlanErrorKind> {
    let seconds = length / feed;
    if seconds > MOVE_S_MAX {
        return Err(PlanErrorKind::TooSlow { seconds });
    }
    Ok(())
}

impl Program {
    /// A straight move until a contact changes, from rest to rest.
    pub(super) fn probe(
        &mut self,
        to: &Position,
        mode: ProbeMode,
        line: u32,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        // A caller would wait for a move that never comes.
        if is_no_move(&self.start(), &self.frame.machine(to)) {
            return Err(PlanErrorKind::Unsupported("a probing move of no length"));
        }
        match self.straight(to, line, false, settings)? {
            Some(Entry::Move(part)) => {
                let limits = probing::limits_along(&part.piece, settings)?;
                Ok(Some(Entry::rest(Element::Probing(Probing {
                    piece: part.piece,
                    mode,
                    feed: part.feed,
                    limits,
                    line,
                }))))
            }
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
        let start = self.start();
        if is_no_move(&start, &end) {
            self.owe(end, line, rapid, settings)?;
            return Ok(None);
        }
        let Some(mut piece) = Piece::line(start, end) else {
            return Ok(None);
        };
        self.accept(&mut piece, end, line, rapid, settings)
            .map(Entry::Move)
            .map(Some)
    }

    /// A straight move at feed, in step with the spindle where a pitch is set.
    pub(super) fn straight_feed(
        &mut self,
        to: &Position,
        line: u32,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        match self.pitch_mm {
            Some(pitch_mm) => self.synced(to, pitch_mm, None, line, settings),
            None => self.straight(to, line, false, settings),
        }
    }

    pub(super) fn arc_feed(
        &mut self,
        to: &Position,
        plane: Plane,
        centre_mm: [f64; 2],
        turns: i32,
        line: u32,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        if self.pitch_mm.is_some() {
            return Err(PlanErrorKind::Unsupported("an arc in step with the spindle"));
        }
        let mut piece = self.arc(to, plane, centre_mm, turns)?;
        let end = self.frame.machine(to);
        if piece.length() <= NO_MOVE && is_no_move(&self.start(), &end) {
            return self.owe(end, line, false, settings).map(|()| None);
        }
        self.accept(&mut piece, end, line, false, settings)
            .map(Entry::Move)
            .map(Some)
    }

    /// Where the next move begins: the last one may have been none.
    pub(super) fn start(&self) -> Position {
        self.owed
            .as_ref()
            .map_or(self.position, |owed| owed.piece.position(0.0))
    }

    /// The program goes on from `end`, so near to where the axes are that this is no move. What follows begins where they are; at a rest
    /// they come here.
    pub(super) fn owe(
        &mut self,
        end: Position,
        line: u32,
        rapid: bool,
        settings: &Settings,
    ) -> Result<(), PlanErrorKind> {
        let start = self.start();
        self.owed = match Piece::line(start, end) {
            Some(piece) => {
                let piece = piece.in_frame(self.tool_frame);
                let feed = self.allowed(&piece, &start, rapid, settings)?;
                let mut owed = self.part(&piece, feed, line, rapid, settings);
                owed.corner = Corner::Stop;
                Some(owed)
            }
            None => None,
        };
        self.position = end;
        Ok(())
    }

    /// What is left of the way to where the program is, from rest to rest: no move has led there.
    pub(in crate::plan) fn take_owed(&mut self) -> Option<Box<Move>> {
        let mut owed = self.owed.take()?;
        self.take_outputs();
        (owed.auxiliary, owed.modes) = (self.auxiliary, self.modes);
        Some(owed)
    }

    pub(super) fn accept(
        &mut self,
        piece: &mut Piece,
        end: Position,
        line: u32,
        rapid: bool,
        settings: &Settings,
    ) -> Result<Box<Move>, PlanErrorKind> {
        piece.set_frame(self.tool_frame);
        let feed = self.allowed(piece, &self.start(), rapid, settings)?;
        self.position = end;
        self.owed = None;
        self.take_outputs();
        Ok(self.part(piece, feed, line, rapid, settings))
    }

    /// The feed along a piece that begins at `start`, if it may be run.
    fn allowed(&self, piece: &Piece, start: &Position, rapid: bool, settings: &Settings) -> Result<f64, PlanErrorKind> {
        travel::check(piece, settings)?;
        if rapid {
            return Ok(f64::INFINITY);
        }
        let feed = self.feed.ok_or(PlanErrorKind::NoFeedRate)?;
        let per_s = if self.per_turn { self.turns_s(settings)? } else { 1.0 };
        let feed = per_s * feed.along(piece, start);
        check_time(piece.length(), feed)?;
        Ok(feed)
    }

    /// A piece with all that holds for it.
    fn part(&self, piece: &Piece, feed: f64, line: u32, rapid: bool, settings: &Settings) -> Box<Move> {
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
        Box::new(Move {
            piece: *piece,
            feed,
            line,
            rapid,
            enables: Enables {
                spindle_speed: self.per_turn,
                ..self.enables
            },
            auxiliary: self.auxiliary,
            modes: self.modes,
            corner,
            naive_cam_mm,
        })
    }

    fn arc(&self, to: &Position, plane: Plane, centre_mm: [f64; 2], turns: i32) -> Result<Piece, PlanErrorKind> {
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
        if sweep * radius < ROUNDING_MM {
            sweep += TAU;
        }
        // The axes may be a little beside where the program is.
        if self.owed.is_some() {
            let ahead = angle_and_radius(&self.start()).0 - from;
            let ahead = ahead - TAU * (ahead / TAU).round();
            sweep -= if turns > 0 { ahead } else { -ahead };
        }
        sweep += TAU * f64::from(turns.unsigned_abs().saturating_sub(1));
        let circle = Circle {
            start: self.start(),
            end,
            centre_mm: centre,
            normal,
            sweep_rad: if turns > 0 { sweep } else { -sweep },
        };
        Piece::arc(&circle).filter(|_| turns != 0).ok_or(PlanErrorKind::BadArc)
    }
}
