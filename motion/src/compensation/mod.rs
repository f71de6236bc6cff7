//! Cutter radius compensation, G40 to G42.1: from the programmed contour to the path of the tool's centre.
//!
//! In:  events of the programmed path, in program order; [`Call::SetCutterCompensation`] switches compensation on and off.
//! Out: events whose moves are those of the tool's centre. While compensation is off they are what came in.
//!
//! Where a move of the centre ends depends on the corner to the next move, so that the last one is held back, with all that
//! happens behind it, until the next move in the plane is known:
//!
//! ```text
//!   G41 ... move 1     entry: the centre goes from where it is to a point beside the end of the move
//!           move 2     outer corner: move 1 goes out, then an arc around the corner; move 2 is held
//!           M8, Z move at the corner: held behind move 2
//!           move 3     inner corner: move 2 is cut at the crossing, goes out with M8 and Z; move 3 is held
//!   G40                move 3 goes out whole
//!           move 4     straight: from beside the end of move 3 to the programmed end
//! ```
//!
//! The rules, tolerances and the order of events are LinuxCNC's, move by move. Where its path would cut into the contour or
//! could be misread, this stage differs:
//! - a move that its neighbours' inner corners shorten to less than nothing is an error wherever it shows; LinuxCNC goes
//!   back along it without a word if the next move is in line with it, or is an arc behind an outer corner;
//! - a program stop at an inner corner waits for the corner, so that the tool does not stop in the wall behind it;
//! - full circles count the turns that are made: the tool may get on them a little before their end, see `held.rs`;
//! - an entry arc whose start lies on the wrong side of its end's tangent is an error, not almost a full circle;
//! - a lathe tool's entry arc begins where the tip is, whatever follows.
//!
//! No look-ahead goes beyond the next move: contours whose inner features are smaller than the tool are errors where this
//! shows at a corner, and are cut into where features far apart on the contour lie close to each other in space.

mod beside;
mod class;
mod contour;
mod entry;
mod error;
mod geometry;
mod held;
mod join;

use crate::canon::{Call, Cutter, Event, Plane, Position, Side, Source};
use beside::Beside;
use class::Class;
use contour::{Contour, Shape};
pub use error::{CompensationError, CompensationErrorKind};
use geometry::{Point, add, length, sub};

use CompensationErrorKind as Kind;

/// Greatest number of events held between two moves in the plane.
pub const HELD_LIMIT: usize = 1 << 16;

/// Coordinates and radii beyond this are refused, mm.
const FAR_MM: f64 = 1e9;

/// A move that gets no further than this in the plane is a move of the other axes, mm.
const NEGLIGIBLE_MM: f64 = 1e-7;

/// The stage; see the [module](self).
#[derive(Clone, Debug)]
pub struct Compensator {
    plane: Plane,
    /// End of the last programmed move.
    at: Position,
    mode: Mode,
    /// G40 was, and no move since.
    straight_exit_due: bool,
}

#[derive(Clone, Debug)]
enum Mode {
    Off,
    /// On, and no move in the plane since.
    Entry(Tool),
    Beside(Beside),
}

/// The tool as the plane sees it.
#[derive(Clone, Copy, Debug)]
struct Tool {
    /// +1 left, -1 right.
    side: f64,
    radius: f64,
    /// From the centre to the point that the machine controls.
    shift: Point,
}

impl Default for Compensator {
    fn default() -> Self {
        Self::new()
    }
}

impl Compensator {
    /// Off, in the XY plane, at zero.
    pub fn new() -> Compensator {
        Compensator {
            plane: Plane::Xy,
            at: Position::ZERO,
            mode: Mode::Off,
            straight_exit_due: false,
        }
    }

    /// Tells where the tool is in work coordinates. Needed before compensation is switched on if something else than the
    /// moves that were pushed determined it: another work offset, a probe, or moves that went past this stage.
    pub fn set_position(&mut self, at: Position) {
        self.at = at;
    }

    /// Tells the plane, needed like [`set_position`](Self::set_position).
    pub fn set_plane(&mut self, plane: Plane) {
        self.plane = plane;
    }

    /// Whether events pass through unchanged, so that the stage can be left out until the next G41 or G42.
    pub fn is_idle(&self) -> bool {
        matches!(self.mode, Mode::Off) && !self.straight_exit_due
    }

    /// Whether compensation is on, with a radius that is not zero.
    pub fn is_on(&self) -> bool {
        !matches!(self.mode, Mode::Off)
    }

    /// Number of events held back, the last move among them.
    pub fn held(&self) -> usize {
        match &self.mode {
            Mode::Off | Mode::Entry(_) => 0,
            Mode::Beside(beside) => beside.held_events(),
        }
    }

    /// Where the tool's centre is at the end of the last programmed move, work coordinates, as long as no inner corner cuts
    /// this move. It is the programmed point while compensation is off.
    pub fn position(&self) -> Position {
        match &self.mode {
            Mode::Off | Mode::Entry(_) => self.at,
            Mode::Beside(beside) => with_plane(self.at, self.plane, beside.centre()),
        }
    }

    /// Takes the next event of the programmed path and gives to `out` what is known by now.
    ///
    /// After an error nothing of the event has happened; what is held back remains so.
    #[inline]
    pub fn push(&mut self, event: Event, out: &mut impl Extend<Event>) -> Result<(), CompensationError> {
        if let Mode::Off = self.mode {
            self.push_off(event, out)
        } else {
            let source = event.source;
            self.push_on(event, out)
                .map_err(|kind| CompensationError { source, kind })
        }
    }

    /// Ends compensation, if it is on, where the program ends: what is held back goes out.
    pub fn finish(&mut self, out: &mut impl Extend<Event>) -> Result<(), CompensationError> {
        let source = match &self.mode {
            Mode::Off | Mode::Entry(_) => Source::default(),
            Mode::Beside(beside) => beside.last_source(),
        };
        self.switch_off(out)
            .map_err(|kind| CompensationError { source, kind })?;
        self.straight_exit_due = false;
        Ok(())
    }

    fn push_off(&mut self, event: Event, out: &mut impl Extend<Event>) -> Result<(), CompensationError> {
        match (&event.call, Class::of(&event.call)) {
            (Call::ArcFeed { .. }, Class::Move) if self.straight_exit_due => {
                return Err(CompensationError {
                    source: event.source,
                    kind: Kind::ExitArc,
                });
            }
            (call, Class::Move) => {
                if let Some(to) = end_of(call) {
                    self.at = *to;
                }
                self.straight_exit_due = false;
            }
            (Call::SelectPlane(plane), Class::Plane) => self.plane = *plane,
            (Call::SetCutterCompensation(cutter), Class::Switch) => {
                let switched = cutter.map_or(Ok(()), |cutter| self.switch_on(cutter));
                return switched.map_err(|kind| CompensationError {
                    source: event.source,
                    kind,
                });
            }
            (_, Class::InOrder | Class::AtOnce | Class::Plane | Class::Switch | Class::Refused(_)) => {}
        }
        out.extend(Some(event));
        Ok(())
    }

    fn switch_on(&mut self, cutter: Cutter) -> Result<(), Kind> {
        if !matches!(self.plane, Plane::Xy | Plane::Zx) {
            return Err(Kind::Plane(self.plane));
        }
        let radius = cutter.radius_mm.abs();
        if !is_near(cutter.radius_mm) || !self.at.0.into_iter().all(is_near) {
            return Err(Kind::NotFinite);
        }
        let side = match cutter.side {
            Side::Left => 1.0,
            Side::Right => -1.0,
        } * cutter.radius_mm.signum();
        // A tool without a radius follows the contour itself.
        if radius > 0.0 {
            self.mode = Mode::Entry(Tool {
                side,
                radius,
                shift: lathe_shift(cutter.orientation, radius, self.plane),
            });
        }
        Ok(())
    }

    fn push_on(&mut self, event: Event, out: &mut impl Extend<Event>) -> Result<(), Kind> {
        match Class::of(&event.call) {
            Class::Move => self.push_move(event, out),
            Class::InOrder => match &mut self.mode {
                Mode::Off | Mode::Entry(_) => {
                    out.extend(Some(event));
                    Ok(())
                }
                Mode::Beside(beside) => beside.hold(event),
            },
            Class::Plane if event.call != Call::SelectPlane(self.plane) => Err(Kind::PlaneChange),
            Class::AtOnce | Class::Plane => {
                out.extend(Some(event));
                Ok(())
            }
            Class::Switch if event.call == Call::SetCutterCompensation(None) => self.switch_off(out),
            Class::Switch => Err(Kind::AlreadyOn),
            Class::Refused(what) => Err(Kind::NotAllowed { what }),
        }
    }

    fn push_move(&mut self, event: Event, out: &mut impl Extend<Event>) -> Result<(), Kind> {
        let Some(&to) = end_of(&event.call) else {
            return Ok(());
        };
        let contour = self.contour(&event.call, to)?;
        if self.straight_exit_due && matches!(contour.shape, Shape::Arc { .. }) {
            return Err(Kind::ExitArc);
        }
        match &mut self.mode {
            Mode::Off => out.extend(Some(event)),
            Mode::Entry(tool) => {
                let tool = *tool;
                let source = event.source;
                let arc = matches!(event.call, Call::ArcFeed { .. });
                let beside = entry::enter(tool, self.plane, &contour, event)?;
                if arc && tool.shift != [0.0; 2] {
                    out.extend(Some(self.shift_to_tip(&to, tool, source)));
                }
                self.mode = Mode::Beside(beside);
            }
            Mode::Beside(beside) if contour.is_still() => {
                // The others move while the tool stays at the corner; it stands at the same point however far that was off.
                beside.hold(event)?;
                self.at = with_plane(to, self.plane, contour.from);
                return Ok(());
            }
            Mode::Beside(beside) => beside.follow(self.plane, &self.at, &contour, event, out)?,
        }
        self.at = to;
        self.straight_exit_due = false;
        Ok(())
    }

    /// A move that brings the controlled point of a lathe tool to where the tip's centre stands, so that an entry arc is one.
    /// Rotary axes and UVW turn here already, as in LinuxCNC.
    fn shift_to_tip(&self, to: &Position, tool: Tool, source: Source) -> Event {
        let [first, second, normal] = self.plane.axes();
        let mut to = *to;
        for axis in [first, second, normal] {
            to[axis] = self.at[axis];
        }
        let tip = add(in_plane(&to, self.plane), tool.shift);
        Event {
            source,
            call: Call::StraightFeed {
                to: with_plane(to, self.plane, tip),
            },
        }
    }

    /// The move in the plane.
    fn contour(&self, call: &Call, to: Position) -> Result<Contour, Kind> {
        let shape = match *call {
            Call::ArcFeed {
                plane,
                centre_mm: centre,
                turns,
                ..
            } => {
                if plane != self.plane {
                    return Err(Kind::PlaneChange);
                }
                Shape::Arc { centre, turns }
            }
            _ => Shape::Line,
        };
        let contour = Contour {
            from: in_plane(&self.at, self.plane),
            to: in_plane(&to, self.plane),
            shape,
        };
        if !to.0.into_iter().all(is_near) {
            return Err(Kind::NotFinite);
        }
        if let Shape::Arc { centre, turns } = shape {
            if !centre.into_iter().all(is_near) {
                return Err(Kind::NotFinite);
            }
            let radius = |at: Point| length(sub(at, centre));
            if turns == 0 || radius(contour.from) < NEGLIGIBLE_MM || radius(contour.to) < NEGLIGIBLE_MM {
                return Err(Kind::BadArc);
            }
        }
        Ok(contour)
    }

    fn switch_off(&mut self, out: &mut impl Extend<Event>) -> Result<(), Kind> {
        match &mut self.mode {
            Mode::Off => return Ok(()),
            Mode::Entry(_) => {}
            Mode::Beside(beside) => {
                beside.leave(self.plane, out)?;
            }
        }
        self.mode = Mode::Off;
        self.straight_exit_due = true;
        Ok(())
    }
}

/// End of a move that can be compensated.
fn end_of(call: &Call) -> Option<&Position> {
    match call {
        Call::StraightTraverse { to } | Call::StraightFeed { to } | Call::ArcFeed { to, .. } => Some(to),
        _ => None,
    }
}

/// The same for a change.
fn end_of_mut(call: &mut Call) -> Option<&mut Position> {
    match call {
        Call::StraightTraverse { to } | Call::StraightFeed { to } | Call::ArcFeed { to, .. } => Some(to),
        _ => None,
    }
}

/// From the centre of a lathe tool's tip to the point that the machine controls, in the plane.
///
/// This point is the corner of the square around the tip, or the middle of one of its sides, as the orientation says:
///
/// ```text
///        2 6 1     ^ X   6: the tip's -X side, 5: +Z side, and so on; 0, 9: the centre itself
///        7 9 5     |
///        3 8 4     +--> Z
/// ```
fn lathe_shift(orientation: u8, radius: f64, plane: Plane) -> Point {
    if plane != Plane::Zx {
        return [0.0; 2];
    }
    let z = match orientation {
        1 | 4 | 5 => radius,
        2 | 3 | 7 => -radius,
        _ => 0.0,
    };
    let x = match orientation {
        3 | 4 | 8 => radius,
        1 | 2 | 6 => -radius,
        _ => 0.0,
    };
    [z, x]
}

/// Whether a coordinate is one that a machine could have.
fn is_near(mm: f64) -> bool {
    mm.abs() <= FAR_MM
}

/// The coordinates of the plane.
fn in_plane(at: &Position, plane: Plane) -> Point {
    let [first, second, _] = plane.axes();
    [at[first], at[second]]
}

fn with_plane(mut at: Position, plane: Plane, point: Point) -> Position {
    let [first, second, _] = plane.axes();
    (at[first], at[second]) = (point[0], point[1]);
    at
}

#[cfg(test)]
mod tests;
