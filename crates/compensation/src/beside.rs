//! The tool on its way beside the contour: what is held, and what the next move makes of it.
//!
//! In:  moves of the contour and what happens between them.
//! Out: moves of the tool's centre, in the same order.

use motion::canon::{Call, Event, Plane, Position, Source};

use super::contour::{Contour, Shape};
use super::geometry::{Curve, Point, add, dot, left, scale, sub};
use super::held::{Held, Start};
use super::join::{Join, SMOOTH_RAD, join};
use super::window::{Mark, Part};
use super::{
    CompensationErrorKind as Kind, Gouge, HELD_LIMIT, NEGLIGIBLE_MM, Settings, Tool, end_of, end_of_mut, with_plane,
};

/// Events that are made, each with what it is to the look-ahead.
pub(super) type Made = Vec<(Event, Part)>;

/// See the [module](self).
#[derive(Clone, Debug)]
pub(super) struct Beside {
    pub(super) tool: Tool,
    pub(super) settings: Settings,
    /// Unit vector from the end of the last programmed move in the plane to the centre beside it.
    pub(super) normal: Point,
    /// Whether that move is an arc with the tool on its outside.
    pub(super) before_tool: bool,
    /// Path of the centre beside that move.
    pub(super) held: Held,
    /// That move and what came behind it. All moves but the first stay where they are in the plane.
    pub(super) queue: Vec<(Event, Part)>,
    /// Of that move.
    pub(super) mark: Mark,
}

/// The next move in the plane.
pub(super) struct Next<'a> {
    pub(super) contour: &'a Contour,
    pub(super) event: Event,
    /// Without its chain, which follows from the corner.
    pub(super) mark: Mark,
    /// Where the programmed path is before it.
    pub(super) at: &'a Position,
    pub(super) plane: Plane,
}

impl Beside {
    /// Where the centre is if no inner corner follows.
    pub(super) fn centre(&self) -> Point {
        self.held.end
    }

    pub(super) fn held_events(&self) -> usize {
        self.queue.len()
    }

    pub(super) fn last_source(&self) -> Source {
        self.queue.last().map_or(Source::default(), |(event, _)| event.source)
    }

    /// Holds something back until the next move in the plane.
    pub(super) fn hold(&mut self, event: Event, part: Part) -> Result<(), Kind> {
        if self.queue.len() >= HELD_LIMIT {
            return Err(Kind::TooManyHeld { limit: HELD_LIMIT });
        }
        self.queue.push((event, part));
        Ok(())
    }

    /// Takes the next move in the plane.
    pub(super) fn follow(&mut self, step: Next<'_>, out: &mut Made) -> Result<Mark, Kind> {
        let Next {
            contour: next,
            mut event,
            mut mark,
            at,
            plane,
        } = step;
        let Tool { side, radius, .. } = self.tool;
        let drops = self.settings.gouge == Gouge::DropLoop;
        if let Some(arc_mm) = next
            .radius()
            .filter(|&arc_mm| !drops && next.is_around_tool(side) && arc_mm <= radius)
        {
            return Err(Kind::ArcTooTight {
                arc_mm,
                radius_mm: radius,
            });
        }
        let curve = next.beside(side * radius);
        let arriving = scale(left(self.normal), -side); // the normal is a quarter turn to `side` of the tangent
        let begin = add(next.from, scale(left(next.tangent_at_start()), side * radius));
        let normal = scale(left(next.tangent_at_end()), side);
        let end = add(next.to, scale(normal, radius));

        let (mut join, bend) = join(arriving, self.before_tool, next, side);
        if join == Join::Cut && drops && !self.held.is_entry() {
            join = Join::Inside;
        }
        (mark.chain, mark.bend) = match join {
            Join::Smooth => (self.mark.chain, self.mark.bend.max(bend.abs())),
            Join::Around | Join::Cut | Join::Inside => (self.mark.chain.wrapping_add(1), 0.0),
        };
        let (leave, start, start_kind) = match join {
            Join::Cut => {
                let cut = self
                    .held
                    .curve
                    .moved_if_line(next.start_to_curve())
                    .crossing(&curve, side)
                    .map_err(|apart| Kind::CornerUnreachable {
                        first: self.first_source(),
                        gap_mm: apart.gap_mm,
                        radius_mm: radius,
                    })?;
                self.check(cut, false)?;
                let cut = self.held.settled(cut);
                (cut, cut, Start::Cut)
            }
            Join::Around | Join::Inside => {
                self.check(self.held.end, false)?;
                (self.held.settled(self.held.end), begin, Start::Beside)
            }
            Join::Smooth => {
                self.check(self.held.end, true)?;
                let leave = self.held.settled(self.held.end);
                let slack_mm = radius * SMOOTH_RAD;
                (leave, leave, Start::Flat { slack_mm })
            }
        };
        let corner = Corner {
            tool: self.tool,
            plane,
            at,
            vertex: next.from,
            next: &event,
            mark,
        };
        let mut leave = leave;
        let mut start = start;
        if join == Join::Around
            && let Some(tip) = self.tip(next.from, begin, bend)
            && !matches!(event.call, Call::StraightTraverse { .. })
        {
            // Lines go on to the tip; beside arcs, and behind the entry, a line of its own does.
            let goes_on = matches!(self.held.curve, Curve::Line { .. }) && !self.held.is_entry();
            leave = if goes_on { tip } else { leave };
            start = if matches!(curve, Curve::Line { .. }) {
                tip
            } else {
                begin
            };
            self.release(plane, leave, out);
            if leave != tip {
                out.push(corner.straight(tip));
            }
            if start != tip {
                out.push(corner.straight(start));
            }
        } else {
            self.release(plane, leave, out);
            match join {
                Join::Around => out.push(corner.around(begin, -side)),
                Join::Inside => out.push(corner.around(begin, side)),
                Join::Smooth | Join::Cut => {}
            }
        }
        self.held = match (next.shape, curve) {
            // The centre stands still in the middle of an arc of the tool's own radius.
            (Shape::Arc { .. }, Curve::Circle { radius, .. }) if radius < NEGLIGIBLE_MM => {
                if let Some(to) = end_of(&event.call) {
                    event.call = Call::StraightFeed { to: *to };
                }
                let tangent = next.tangent_at_end();
                Held::line(Curve::Line { through: end, tangent }, start, start_kind, end)
            }
            (Shape::Line, _) => Held::line(curve, start, start_kind, end),
            (Shape::Arc { turns, .. }, _) => Held::arc(curve, begin, start, start_kind, end, turns),
        };
        self.normal = normal;
        self.before_tool = next.is_before_tool(side);
        self.mark = mark;
        let part = part_of(&event.call, mark);
        self.queue.push((event, part));
        Ok(mark)
    }

    /// Ends compensation: the held move goes out whole.
    pub(super) fn leave(&mut self, plane: Plane, out: &mut Made) -> Result<(), Kind> {
        self.check(self.held.end, false)?;
        self.release(plane, self.held.settled(self.held.end), out);
        Ok(())
    }

    /// Where the paths beside the two moves of an outer corner meet, or their tangents; `None`: the tool rolls around it.
    fn tip(&self, vertex: Point, begin: Point, bend: f64) -> Option<Point> {
        let super::Corner::Intersection { limit_degrees } = self.settings.corner else {
            return None;
        };
        // Both paths are `radius` from the vertex: the tip is as far along the sum of the normals n1, n2 as puts it on both,
        // r (n1 + n2) / (1 + n1 n2). At a reversal there is none.
        let (n1, n2) = (self.normal, scale(sub(begin, vertex), 1.0 / self.tool.radius));
        (bend <= limit_degrees.to_radians() && dot(n1, n2) > -0.99)
            .then(|| add(vertex, scale(add(n1, n2), self.tool.radius / (1.0 + dot(n1, n2)))))
    }

    /// Whether the held move can end at `leave`. `lenient`: a step back that a flat corner causes is none.
    fn check(&self, leave: Point, lenient: bool) -> Result<(), Kind> {
        match self.held.lacks_mm(leave, lenient) {
            // Loops are looked for later.
            Some(_) if self.settings.gouge == Gouge::DropLoop && !self.held.is_entry() => Ok(()),
            None => Ok(()),
            Some(short_mm) => Err(Kind::MoveTooShort {
                first: self.first_source(),
                short_mm,
                radius_mm: self.tool.radius,
            }),
        }
    }

    fn first_source(&self) -> Source {
        self.queue.first().map_or(Source::default(), |(event, _)| event.source)
    }

    /// Sends out what is held, its moves ending at `leave`.
    fn release(&mut self, plane: Plane, leave: Point, out: &mut Made) {
        if let Some((event, _)) = self.queue.first_mut() {
            self.held.shape(&mut event.call, leave);
        }
        let at = add(leave, self.tool.shift);
        for (event, _) in &mut self.queue {
            if let Some(to) = end_of_mut(&mut event.call) {
                *to = with_plane(*to, plane, at);
            }
            if let Call::ArcFeed { centre_mm, .. } = &mut event.call {
                *centre_mm = add(*centre_mm, self.tool.shift);
            }
        }
        out.append(&mut self.queue);
    }
}

/// What a move beside the contour is to the look-ahead: traverses cut nothing.
pub(super) fn part_of(call: &Call, mark: Mark) -> Part {
    match call {
        Call::StraightFeed { .. } | Call::ArcFeed { .. } => Part::Beside(mark),
        _ => Part::Free,
    }
}

/// What moves at a corner are made of.
struct Corner<'a> {
    tool: Tool,
    plane: Plane,
    /// Where the programmed path is.
    at: &'a Position,
    vertex: Point,
    next: &'a Event,
    mark: Mark,
}

impl Corner<'_> {
    /// The move of the centre around the vertex, to `to`. Traverses know no arcs; they cut straight across, so that the main
    /// part of the next one is parallel to the contour.
    fn around(&self, to: Point, turn: f64) -> (Event, Part) {
        let to = self.end(to);
        self.made(match self.next.call {
            Call::StraightTraverse { .. } => Call::StraightTraverse { to },
            _ => Call::ArcFeed {
                to,
                plane: self.plane,
                centre_mm: add(self.vertex, self.tool.shift),
                turns: if turn > 0.0 { 1 } else { -1 },
            },
        })
    }

    fn straight(&self, to: Point) -> (Event, Part) {
        self.made(Call::StraightFeed { to: self.end(to) })
    }

    /// Axes out of the plane wait for the move itself, but rotary axes and UVW turn here, as in LinuxCNC.
    fn end(&self, to: Point) -> Position {
        let [.., normal] = self.plane.axes();
        let end = end_of(&self.next.call).unwrap_or(self.at);
        let mut end = with_plane(*end, self.plane, add(to, self.tool.shift));
        end[normal] = self.at[normal];
        end
    }

    fn made(&self, call: Call) -> (Event, Part) {
        let [.., normal] = self.plane.axes();
        let depth = [self.at[normal]; 2];
        let walls = self.mark.walls_at_corner();
        let part = part_of(
            &call,
            Mark {
                depth,
                walls,
                ..self.mark
            },
        );
        let source = self.next.source;
        (Event { source, call }, part)
    }
}
