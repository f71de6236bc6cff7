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
//! - a lathe tool's entry arc begins where the tip is, whatever follows;
//! - what cuts into a part of the contour that is no neighbour is an error, or is dropped: `window/` has the rules. LinuxCNC does
//!   not see it; [`Gouge::NeighboursOnly`] gives its path.
//!
//! ```text
//!   events -> corners, move by move (beside.rs, entry.rs, join.rs, held.rs)      moves of the centre
//!          -> look-ahead over the contour (window/)                              the same, or without loops
//!          -> feed at the contour (contour_feed.rs)                              with another feed on some of them
//! ```

#![cfg_attr(
    test,
    allow(clippy::disallowed_methods, reason = "tests may use the PC's own functions")
)]

mod beside;
mod class;
mod contour;
mod contour_feed;
mod element;
mod entry;
mod error;
mod geometry;
mod held;
mod join;
mod settings;
mod tip;
mod window;

use beside::{Beside, Made, Next};
use class::Class;
use contour::{Contour, Shape};
pub use contour_feed::{ContourFeed, FeedSettings, InsideCorners};
use element::Element;
pub use error::{CompensationError, CompensationErrorKind};
use geometry::{Point, length, sub};
use motion::canon::{Axis, Call, Cutter, Event, PathMode, Plane, Position, Side, Source};
pub use settings::{Corner, Gouge, Settings};
pub use window::AHEAD;
use window::{Mark, PATH_TOLERANCE_MM, Part, Window};

use CompensationErrorKind as Kind;

/// Greatest number of events held between two moves in the plane.
pub const HELD_LIMIT: usize = 1 << 16;

/// Coordinates and radii beyond this are refused, mm.
const FAR_MM: f64 = 1e9;

/// A move that gets no further than this in the plane is a move of the other axes, mm.
const NEGLIGIBLE_MM: f64 = 1e-7;

/// The stage; see the [crate](self).
#[derive(Clone, Debug)]
pub struct Compensator {
    plane: Plane,
    /// End of the last programmed move.
    at: Position,
    mode: Mode,
    /// G40 was, and no move since.
    straight_exit_due: bool,
    settings: Settings,
    /// Of the path mode, and no less than programs are rounded to.
    tolerance_mm: f64,
    /// From G41 or G42 to the first move behind G40.
    window: Option<Window>,
    /// Where the machine's point is behind the events that went to the window.
    path_at: Position,
    /// Number of the place of the axes that are none of the plane's three.
    pose: u32,
    /// Kept for its memory.
    made: Made,
}

#[derive(Clone, Debug)]
enum Mode {
    Off,
    /// On, and no move in the plane since.
    Entry(Tool),
    Beside(Box<Beside>),
}

/// What an event is to the look-ahead.
enum Programmed {
    /// Part of the contour.
    Wall(Contour, Mark),
    /// The contour is interrupted.
    Gap,
    /// It has nothing to do with the contour.
    Nothing,
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
        Compensator::with_settings(Settings::default())
    }

    /// The same with other rules.
    pub fn with_settings(settings: Settings) -> Compensator {
        Compensator {
            plane: Plane::Xy,
            at: Position::ZERO,
            mode: Mode::Off,
            straight_exit_due: false,
            settings,
            tolerance_mm: PATH_TOLERANCE_MM,
            window: None,
            path_at: Position::ZERO,
            pose: 0,
            made: Vec::new(),
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

    /// Tells the path mode, needed like [`set_position`](Self::set_position). Where the path may be off by so much, a cut into
    /// the contour that is no deeper is none.
    pub fn set_path_mode(&mut self, mode: PathMode) {
        self.tolerance_mm = match mode {
            PathMode::Continuous { tolerance_mm, .. } => tolerance_mm.unwrap_or(0.0).max(PATH_TOLERANCE_MM),
            PathMode::ExactPath | PathMode::ExactStop => PATH_TOLERANCE_MM,
        };
    }

    /// Whether events pass through unchanged, so that the stage can be left out until the next G41 or G42.
    pub fn is_idle(&self) -> bool {
        matches!(self.mode, Mode::Off) && !self.straight_exit_due
    }

    /// Whether compensation is on, with a radius that is not zero.
    pub fn is_on(&self) -> bool {
        !matches!(self.mode, Mode::Off)
    }

    /// Number of events held back: the last move and what is behind it, and those that wait for the look-ahead.
    pub fn held(&self) -> usize {
        let behind = match &self.mode {
            Mode::Off | Mode::Entry(_) => 0,
            Mode::Beside(beside) => beside.held_events(),
        };
        behind + self.window.as_ref().map_or(0, Window::waiting)
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
    /// # Errors
    ///
    /// A move that a tool of this radius cannot make, or that is not allowed while compensation is on. After an error nothing of the event has happened, and what is held back remains so; but a move that shows a gouge has
    /// been taken with the others.
    #[inline]
    pub fn push(&mut self, event: Event, out: &mut impl Extend<Event>) -> Result<(), Box<CompensationError>> {
        let source = event.source;
        let result = if let Mode::Off = self.mode {
            self.push_off(event, out)
        } else {
            self.push_on(event)
                .and_then(|contour| self.look_ahead(contour, source, out))
        };
        result.map_err(|kind| Box::new(CompensationError::new(source, kind)))
    }

    /// Ends compensation, if it is on, where the program ends: what is held back goes out.
    ///
    /// # Errors
    ///
    /// The last move does not fit the tool, or a gouge shows at the end.
    pub fn finish(&mut self, out: &mut impl Extend<Event>) -> Result<(), Box<CompensationError>> {
        let source = match &self.mode {
            Mode::Off | Mode::Entry(_) => Source::default(),
            Mode::Beside(beside) => beside.last_source(),
        };
        self.switch_off()
            .and_then(|()| self.look_ahead(Programmed::Nothing, source, out))
            .map_err(|kind| Box::new(CompensationError::new(source, kind)))?;
        self.straight_exit_due = false;
        self.window = None;
        Ok(())
    }

    /// Lets go, before an error that stands behind them in the program, of the events that wait for the look-ahead alone.
    /// `false`: there are none. Where loops are dropped ([`Gouge::DropLoop`]) they are not known yet, and all goes on waiting.
    pub fn release(&mut self, out: &mut impl Extend<Event>) -> bool {
        match &mut self.window {
            Some(window) if self.settings.gouge != Gouge::DropLoop && window.waiting() > 0 => {
                window.release_all(out);
                true
            }
            Some(_) | None => false,
        }
    }

    fn push_off(&mut self, event: Event, out: &mut impl Extend<Event>) -> Result<(), Kind> {
        // Something waits only where the end of compensation showed a gouge, and the caller went on.
        self.release(out);
        match (&event.call, Class::new(&event.call)) {
            (Call::ArcFeed { .. }, Class::Move) if self.straight_exit_due => return Err(Kind::ExitArc),
            (call, Class::Move) => {
                if let Some(to) = end_of(call) {
                    if let Some(window) = self.window.take() {
                        self.check_exit(window, &event)?;
                    }
                    self.at = *to;
                }
                self.straight_exit_due = false;
            }
            (Call::SelectPlane(plane), Class::Plane) => self.plane = *plane,
            (Call::SetPathMode(mode), _) => self.set_path_mode(*mode),
            (Call::SetCutterCompensation(cutter), Class::Switch) => {
                return cutter.map_or(Ok(()), |cutter| self.switch_on(cutter));
            }
            // Work coordinates may be others from here on.
            (_, Class::Refused(_)) => self.window = None,
            (_, Class::InOrder | Class::AtOnce | Class::Plane | Class::Switch) => {}
        }
        out.extend(Some(event));
        Ok(())
    }

    /// Compares the move behind G40 with the contour.
    fn check_exit(&mut self, mut window: Window, event: &Event) -> Result<(), Kind> {
        if let Call::StraightFeed { to } = event.call {
            let mark = Mark {
                walls: [window.next_wall(); 2],
                ..self.mark(&to, event.source)
            };
            let part = Part::Link(mark, in_plane(&self.at, window.plane()));
            let way = [&self.path_at, &to].map(|at| in_plane(at, window.plane()));
            let way = way.map(|at| sub(at, window.shift()));
            window.compare(part, Element::line(way[0], way[1]));
            window.judge(u64::MAX)?;
        }
        Ok(())
    }

    /// Passes on what was made of an event with this contour. `source`: of that event.
    fn look_ahead(&mut self, contour: Programmed, source: Source, out: &mut impl Extend<Event>) -> Result<(), Kind> {
        if self.settings.number_by_release {
            for (event, _) in &mut self.made {
                (event.source.n, event.source.n_digits) = (source.n, source.n_digits);
            }
        }
        let Some(window) = &mut self.window else {
            out.extend(self.made.drain(..).map(|(event, _)| event));
            return Ok(());
        };
        if let Programmed::Wall(contour, mark) = &contour {
            window.wall(Element::new(contour), *mark);
        }
        let mut found = Ok(());
        for (event, part) in self.made.drain(..) {
            let mut element = None;
            if let Some(to) = end_of(&event.call) {
                let shifted = |at: Point| sub(at, window.shift());
                let [from, end] = [&self.path_at, to].map(|at| shifted(in_plane(at, window.plane())));
                element = Some(match event.call {
                    Call::ArcFeed { centre_mm, turns, .. } => Element::arc(from, end, shifted(centre_mm), turns),
                    _ => Element::line(from, end),
                });
                self.path_at = *to;
            }
            let taken = window.push_event(event);
            found = found.and(taken);
            if let Some(element) = element {
                window.compare(part, element);
            }
        }
        if let Programmed::Gap = contour {
            window.separate();
        }
        found?;
        if let Mode::Off = self.mode {
            window.end()?;
            window.release_all(out);
            Ok(())
        } else {
            window.release(out)
        }
    }

    /// What a move to a point has in common with its contour, but for the chain.
    fn mark(&mut self, to: &Position, source: Source) -> Mark {
        let [first, second, normal] = self.plane.axes();
        let turns = Axis::ALL
            .into_iter()
            .filter(|axis| ![first, second, normal].contains(axis))
            .any(|axis| to[axis] != self.at[axis]);
        // A move of other axes has a place of its own, and what follows has another one.
        let pose = self.pose + u32::from(turns);
        self.pose += 2 * u32::from(turns);
        let tolerance_mm = match self.settings.gouge {
            // Loops are cut where the path crosses itself.
            Gouge::DropLoop => 0.0,
            Gouge::Error | Gouge::NeighboursOnly => self.tolerance_mm,
        };
        Mark {
            source,
            walls: [self.window.as_ref().map_or(0, Window::next_wall); 2],
            depth: [self.at[normal], to[normal]],
            tolerance_mm,
            pose,
            ..Mark::default()
        }
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
            let shift = tip::shift(cutter.orientation, radius, self.plane);
            let tool = Tool { side, radius, shift };
            self.mode = Mode::Entry(tool);
            self.path_at = self.at;
            self.window = match self.settings.gouge {
                Gouge::Error | Gouge::DropLoop => Some(Window::new(self.plane, tool, self.settings.gouge)),
                Gouge::NeighboursOnly => None,
            };
        }
        Ok(())
    }

    /// Makes of an event what can be made of it by now.
    fn push_on(&mut self, event: Event) -> Result<Programmed, Kind> {
        match Class::new(&event.call) {
            Class::Move => return self.push_move(event),
            Class::InOrder => match &mut self.mode {
                Mode::Off | Mode::Entry(_) => self.made.push((event, Part::Free)),
                Mode::Beside(beside) => beside.hold(event, Part::Free)?,
            },
            Class::Plane if event.call != Call::SelectPlane(self.plane) => return Err(Kind::PlaneChange),
            Class::AtOnce | Class::Plane => self.made.push((event, Part::Free)),
            Class::Switch if event.call == Call::SetCutterCompensation(None) => self.switch_off()?,
            Class::Switch => return Err(Kind::AlreadyOn),
            Class::Refused(what) => return Err(Kind::NotAllowed { what }),
        }
        Ok(Programmed::Nothing)
    }

    fn push_move(&mut self, event: Event) -> Result<Programmed, Kind> {
        let Some(&to) = end_of(&event.call) else {
            return Ok(Programmed::Nothing);
        };
        let contour = self.contour(&event.call, to)?;
        if self.straight_exit_due && matches!(contour.shape, Shape::Arc { .. }) {
            return Err(Kind::ExitArc);
        }
        let cuts = !matches!(event.call, Call::StraightTraverse { .. });
        let mark = self.mark(&to, event.source);
        let mut programmed = Programmed::Nothing;
        match &mut self.mode {
            Mode::Off => self.made.push((event, Part::Free)),
            Mode::Entry(tool) => {
                let tool = *tool;
                let arc = matches!(event.call, Call::ArcFeed { .. });
                let beside = entry::enter(tool, self.settings, self.plane, &contour, event, mark)?;
                if arc && tool.shift != [0.0; 2] {
                    let to_tip = tip::start_of_arc(&self.at, &to, self.plane, tool.shift);
                    let source = mark.source;
                    self.made.push((Event { source, call: to_tip }, Part::Free));
                }
                self.mode = Mode::Beside(Box::new(beside));
            }
            Mode::Beside(beside) if contour.is_still() => {
                // The others move while the tool stays at the corner; it stands at the same point however far that was off.
                let (chain, bend) = (beside.mark.chain, beside.mark.bend);
                let walls = mark.walls_at_corner();
                let part = beside::part_of(
                    &event.call,
                    Mark {
                        walls,
                        chain,
                        bend,
                        ..mark
                    },
                );
                beside.hold(event, part)?;
                self.at = with_plane(to, self.plane, contour.from);
                return Ok(if mark.depth[0] != mark.depth[1] {
                    Programmed::Gap
                } else {
                    Programmed::Nothing
                });
            }
            Mode::Beside(beside) => {
                let next = Next {
                    contour: &contour,
                    event,
                    mark,
                    at: &self.at,
                    plane: self.plane,
                };
                let mark = beside.follow(next, &mut self.made)?;
                programmed = if cuts {
                    Programmed::Wall(contour, mark)
                } else {
                    Programmed::Gap
                };
            }
        }
        self.at = to;
        self.straight_exit_due = false;
        Ok(programmed)
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

    fn switch_off(&mut self) -> Result<(), Kind> {
        match &mut self.mode {
            Mode::Off => return Ok(()),
            Mode::Entry(_) => {}
            Mode::Beside(beside) => beside.leave(self.plane, &mut self.made)?,
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
