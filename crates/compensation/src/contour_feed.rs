//! Feed where the tool cuts: less where its edge runs faster than its centre, and in inside corners, where more of it is in the
//! work.
//!
//! In:  events with the moves of the tool's centre, in program order; which tool, and when it is compensated.
//! Out: the same with the feed of these moves, which are cut where it changes.
//!
//! On the inside of an arc of radius R a tool of radius r has its centre on R - r: at the same feed of the centre, each tooth takes
//! R / (R - r) as much as on a straight line. With [`FeedSettings::arcs`] the feed of the centre is (R - r) / R of the programmed one, so
//! that the edge moves at the programmed feed along the contour.
//!
//! While compensation is on, one move is held back: how its end is run depends on the corner to the next one.

use motion::canon::{Call, Cutter, Event, Plane, Position, Side};
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::mem;

/// What the feed under compensation depends on besides F.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FeedSettings {
    /// Inside of arcs the programmed feed is that of the contour and not that of the tool's centre.
    pub arcs: bool,
    /// Inside corners are run slower.
    pub inside_corners: Option<InsideCorners>,
}

/// A lower feed before and behind inside corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InsideCorners {
    /// Share of the programmed feed there, above 0 to 1.
    pub share: f64,
    /// How long before and behind the corner, mm; `None`: the radius of the tool.
    pub distance_mm: Option<f64>,
    /// Corners that bend by less are none, degrees.
    pub bend_degrees: f64,
}

/// Feeds within so much of each other are one.
const SAME: f64 = 1e-9;
/// Parts of a move are no shorter than this, mm.
const PART_MIN_MM: f64 = 1e-3;

/// The stage, and what has come out of it: [`Extend`] takes events in, [`ContourFeed::pop`] gives them out.
#[derive(Debug, Default)]
pub struct ContourFeed {
    settings: FeedSettings,
    /// While compensation is on.
    tool: Option<Tool>,
    held: Option<Held>,
    /// What stands behind the move that is held.
    behind: Vec<Event>,
    out: VecDeque<Event>,
}

#[derive(Clone, Copy, Debug)]
struct Tool {
    /// Of the contour on which it is: 1 left, -1 right.
    side: f64,
    radius_mm: f64,
    plane: Plane,
    /// Where the last move ends.
    at: Position,
    /// F as programmed: linear, angular; none before the first one is known.
    feed: Option<[f64; 2]>,
    /// Share of it that was told last.
    told: f64,
}

#[derive(Debug)]
struct Held {
    event: Event,
    way: Way,
    /// Share of the feed on all of it.
    share: f64,
    /// Length at its beginning that is run as a corner.
    slow_mm: f64,
}

/// A move at feed.
#[derive(Clone, Copy, Debug)]
struct Way {
    from: Position,
    to: Position,
    length_mm: f64,
    /// Directions in the plane where it begins and ends; `None`: it does not move there.
    tangents: Option<[[f64; 2]; 2]>,
    arc: Option<Arc>,
}

#[derive(Clone, Copy, Debug)]
struct Arc {
    plane: Plane,
    centre_mm: [f64; 2],
    turns: i32,
    radius_mm: f64,
    /// Positive counter-clockwise.
    sweep_rad: f64,
}

impl ContourFeed {
    /// With compensation off, when all passes as it is.
    pub fn new(settings: FeedSettings) -> ContourFeed {
        ContourFeed {
            settings,
            ..ContourFeed::default()
        }
    }

    /// Compensation is on from here: the tool stands at `at`; `feed`: F as [`Call::SetFeedRate`] would tell it.
    pub fn begin(&mut self, cutter: &Cutter, plane: Plane, at: Position, feed: [f64; 2]) {
        self.end();
        if self.settings == FeedSettings::default() {
            return;
        }
        let side = match cutter.side {
            Side::Left => 1.0,
            Side::Right => -1.0,
        };
        self.tool = Some(Tool {
            side: side * cutter.radius_mm.signum(),
            radius_mm: cutter.radius_mm.abs(),
            plane,
            at,
            feed: Some(feed),
            told: 1.0,
        });
    }

    /// Compensation is off from here.
    pub fn end(&mut self) {
        self.let_go();
        if let Some(mut tool) = self.tool.take() {
            let source = self.out.back().map(|event| event.source);
            tool.tell(1.0, source.unwrap_or_default(), &mut self.out);
        }
    }

    /// Lets the move go that is held back, as if it met the next one without a corner.
    pub fn let_go(&mut self) {
        self.emit(0.0);
        for event in mem::take(&mut self.behind) {
            self.pass(event);
        }
    }

    /// The next event, if it is known.
    pub fn pop(&mut self) -> Option<Event> {
        self.out.pop_front()
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        *self = ContourFeed::new(self.settings);
    }

    fn push(&mut self, event: Event) {
        let Some(tool) = &mut self.tool else {
            self.out.push_back(event);
            return;
        };
        if let Call::SelectPlane(plane) = event.call {
            tool.plane = plane;
        }
        let Some(way) = tool.way(&event.call) else {
            let moves = match event.call {
                Call::StraightTraverse { to } => Some(to),
                _ => None,
            };
            match moves {
                Some(to) => {
                    tool.at = to;
                    self.let_go();
                    self.out.push_back(event);
                }
                None if self.held.is_some() => self.behind.push(event),
                None => self.pass(event),
            }
            return;
        };
        tool.at = way.to;
        let tool = *tool;
        let slow_mm = match &self.held {
            Some(held) => self.corner_mm(&tool, &held.way, &way),
            None => 0.0,
        };
        self.emit(slow_mm);
        for event in mem::take(&mut self.behind) {
            self.pass(event);
        }
        let share = match way.arc {
            // Radius of the contour: that of the centre and the tool's.
            Some(arc) if self.settings.arcs && tool.side * arc.sweep_rad > 0.0 => {
                arc.radius_mm / (arc.radius_mm + tool.radius_mm)
            }
            _ => 1.0,
        };
        self.held = Some(Held {
            event,
            way,
            share,
            slow_mm,
        });
    }

    /// Length beside the corner between two moves on which the tool is slower.
    fn corner_mm(&self, tool: &Tool, before: &Way, behind: &Way) -> f64 {
        let (Some(corners), Some([_, a]), Some([b, _])) =
            (self.settings.inside_corners, before.tangents, behind.tangents)
        else {
            return 0.0;
        };
        let bend = libm::atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
        if tool.side * bend <= corners.bend_degrees.to_radians() {
            return 0.0;
        }
        corners.distance_mm.unwrap_or(tool.radius_mm)
    }

    /// Lets the held move go in parts of one feed each; its last `end_mm` belong to a corner.
    fn emit(&mut self, end_mm: f64) {
        let (Some(held), Some(tool)) = (self.held.take(), &mut self.tool) else {
            return;
        };
        let Held { event, way, share, .. } = &held;
        let length_mm = way.length_mm;
        let corner = share.min(self.settings.inside_corners.map_or(1.0, |corners| corners.share));
        let (mut first, mut last) = (held.slow_mm, length_mm - end_mm);
        if first + PART_MIN_MM > last {
            // Slow all along.
            (first, last) = (length_mm, length_mm);
        }
        let parts = [(first, corner), (last, *share), (length_mm, corner)];
        let mut from_mm = 0.0;
        for (to_mm, share) in parts {
            if to_mm < from_mm + PART_MIN_MM && !(from_mm == 0.0 && to_mm == length_mm) {
                continue;
            }
            let to_mm = if length_mm - to_mm < PART_MIN_MM {
                length_mm
            } else {
                to_mm
            };
            tool.tell(share, event.source, &mut self.out);
            self.out.push_back(Event {
                call: way.part(from_mm, to_mm),
                source: event.source,
            });
            from_mm = to_mm;
        }
    }

    fn pass(&mut self, event: Event) {
        if let (Call::SetFeedRate { linear, angular }, Some(tool)) = (&event.call, &mut self.tool) {
            tool.feed = Some([*linear, *angular]);
            tool.told = 1.0;
        }
        self.out.push_back(event);
    }
}

impl Extend<Event> for ContourFeed {
    fn extend<I: IntoIterator<Item = Event>>(&mut self, events: I) {
        events.into_iter().for_each(|event| self.push(event));
    }
}

impl Tool {
    /// Tells the feed if it is another one than before.
    fn tell(&mut self, share: f64, source: motion::canon::Source, out: &mut VecDeque<Event>) {
        let Some([linear, angular]) = self.feed else { return };
        if (share - self.told).abs() <= SAME {
            return;
        }
        self.told = share;
        out.push_back(Event {
            source,
            call: Call::SetFeedRate {
                linear: linear * share,
                angular: angular * share,
            },
        });
    }

    fn way(&self, call: &Call) -> Option<Way> {
        let [first, second, _] = self.plane.axes();
        let from = self.at;
        match *call {
            Call::StraightFeed { to } => {
                let by: Vec<f64> = to.0.iter().zip(from.0).map(|(to, from)| to - from).collect();
                let in_plane = [first, second].map(|axis| to[axis] - from[axis]);
                let mm = libm::hypot(in_plane[0], in_plane[1]);
                Some(Way {
                    from,
                    to,
                    length_mm: by.iter().map(|x| x * x).sum::<f64>().sqrt(),
                    tangents: (mm > 1e-9).then(|| [in_plane.map(|x| x / mm); 2]),
                    arc: None,
                })
            }
            Call::ArcFeed {
                to,
                plane,
                centre_mm,
                turns,
            } => {
                let [first, second, _] = plane.axes();
                let arm = |at: &Position| [at[first] - centre_mm[0], at[second] - centre_mm[1]];
                let (a, b) = (arm(&from), arm(&to));
                let radius_mm = libm::hypot(a[0], a[1]);
                let sign = f64::from(turns.signum());
                let angle = sign * (libm::atan2(b[1], b[0]) - libm::atan2(a[1], a[0]));
                let less_than_one = angle.rem_euclid(TAU);
                let less_than_one = if less_than_one * radius_mm < 1e-9 {
                    TAU
                } else {
                    less_than_one
                };
                let sweep_rad = sign * (less_than_one + TAU * f64::from(turns.unsigned_abs().saturating_sub(1)));
                let tangent = |arm: [f64; 2]| {
                    let mm = libm::hypot(arm[0], arm[1]);
                    [-sign * arm[1] / mm, sign * arm[0] / mm]
                };
                Some(Way {
                    from,
                    to,
                    length_mm: radius_mm * sweep_rad.abs(),
                    tangents: (radius_mm > 1e-9).then(|| [tangent(a), tangent(b)]),
                    arc: Some(Arc {
                        plane,
                        centre_mm,
                        turns,
                        radius_mm,
                        sweep_rad,
                    }),
                })
            }
            _ => None,
        }
    }
}

impl Way {
    /// The call that goes from one place to another.
    fn part(&self, from_mm: f64, to_mm: f64) -> Call {
        let to = self.at(to_mm);
        let Some(arc) = self.arc else {
            return Call::StraightFeed { to };
        };
        let turned = (to_mm - from_mm) / self.length_mm * arc.sweep_rad;
        let whole = from_mm == 0.0 && to_mm == self.length_mm;
        let turns = ((turned.abs() / TAU - 1e-12).floor() as i32 + 1) * arc.turns.signum();
        Call::ArcFeed {
            to,
            plane: arc.plane,
            centre_mm: arc.centre_mm,
            turns: if whole { arc.turns } else { turns },
        }
    }

    fn at(&self, mm: f64) -> Position {
        if mm >= self.length_mm {
            return self.to;
        }
        let part = mm / self.length_mm;
        let mut at = Position(std::array::from_fn(|i| {
            self.from.0[i] + part * (self.to.0[i] - self.from.0[i])
        }));
        if let Some(arc) = self.arc {
            let [first, second, _] = arc.plane.axes();
            let (sin, cos) = libm::sincos(part * arc.sweep_rad);
            let arm = [
                self.from[first] - arc.centre_mm[0],
                self.from[second] - arc.centre_mm[1],
            ];
            at[first] = arc.centre_mm[0] + cos * arm[0] - sin * arm[1];
            at[second] = arc.centre_mm[1] + sin * arm[0] + cos * arm[1];
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::canon::Source;

    const SLOW: FeedSettings = FeedSettings {
        arcs: true,
        inside_corners: Some(InsideCorners {
            share: 0.5,
            distance_mm: None,
            bend_degrees: 30.0,
        }),
    };

    fn line(x: f64, y: f64) -> Call {
        Call::StraightFeed {
            to: Position::xyz(x, y, 0.0),
        }
    }

    fn arc(x: f64, y: f64, centre_mm: [f64; 2], turns: i32) -> Call {
        Call::ArcFeed {
            to: Position::xyz(x, y, 0.0),
            plane: Plane::Xy,
            centre_mm,
            turns,
        }
    }

    const fn feed(linear: f64) -> Call {
        Call::SetFeedRate {
            linear,
            angular: linear,
        }
    }

    /// What comes out for a tool of 2 mm radius on the left of the contour, from the origin, at a feed of 10.
    fn run(settings: FeedSettings, calls: &[Call]) -> Vec<Call> {
        let mut stage = ContourFeed::new(settings);
        let cutter = Cutter {
            side: Side::Left,
            radius_mm: 2.0,
            orientation: 0,
        };
        stage.begin(&cutter, Plane::Xy, Position::ZERO, [10.0; 2]);
        stage.extend(calls.iter().map(|call| Event {
            source: Source::default(),
            call: call.clone(),
        }));
        stage.end();
        std::iter::from_fn(|| stage.pop()).map(|event| event.call).collect()
    }

    #[test]
    fn the_edge_keeps_the_feed_on_the_inside_of_an_arc() {
        // Centre on 6 mm, contour on 8 mm; then on the outside, where nothing changes.
        let inside = arc(6.0, 6.0, [0.0, 6.0], 1);
        let outside = arc(9.0, 9.0, [9.0, 6.0], -1);
        assert_eq!(
            run(SLOW, &[inside.clone(), outside.clone()]),
            [feed(7.5), inside.clone(), feed(10.0), outside.clone()]
        );
        let plain = FeedSettings::default();
        assert_eq!(run(plain, &[inside.clone(), outside.clone()]), [inside, outside]);
    }

    #[test]
    fn an_inside_corner_is_slow_on_both_sides_and_an_outside_corner_is_not() {
        // Left of the contour: a bend to the left is an inside corner.
        let found = run(
            SLOW,
            &[line(10.0, 0.0), Call::Flood(true), line(10.0, 10.0), line(20.0, 10.0)],
        );
        let expected = [
            line(8.0, 0.0),
            feed(5.0),
            line(10.0, 0.0),
            Call::Flood(true),
            line(10.0, 2.0),
            feed(10.0),
            line(10.0, 10.0),
            line(20.0, 10.0),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn a_move_that_is_all_corner_is_slow_all_along_and_another_feed_counts_from_where_it_stands() {
        let found = run(SLOW, &[line(10.0, 0.0), feed(20.0), line(10.0, 3.0), line(0.0, 3.0)]);
        let expected = [
            line(8.0, 0.0),
            feed(5.0),
            line(10.0, 0.0),
            feed(20.0),
            feed(10.0),
            line(10.0, 3.0),
            line(8.0, 3.0),
            feed(20.0),
            line(0.0, 3.0),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn an_arc_is_cut_on_itself_and_ends_where_it_did() {
        // A corner at the end of three quarters of a turn on the inside.
        let round = arc(-6.0, 6.0, [0.0, 6.0], 1);
        let found = run(SLOW, &[line(0.0, 0.0), round, line(-6.0, 12.0), line(-20.0, 0.0)]);
        let arcs: Vec<_> = found
            .iter()
            .filter_map(|call| match call {
                Call::ArcFeed { to, turns, .. } => Some((*to, *turns)),
                _ => None,
            })
            .collect();
        let (end, turns) = arcs[arcs.len() - 1];
        assert_eq!((end, turns), (Position::xyz(-6.0, 6.0, 0.0), 1));
        for (to, _) in arcs {
            let [x, y, ..] = to.0;
            assert!((libm::hypot(x, y - 6.0) - 6.0).abs() < 1e-12);
        }
    }

    #[test]
    fn nothing_stays_behind_at_a_rapid_move_or_the_end() {
        let up = Call::StraightTraverse {
            to: Position::xyz(0.0, 0.0, 5.0),
        };
        let found = run(
            SLOW,
            &[
                arc(6.0, 6.0, [0.0, 6.0], 1),
                Call::Mist(true),
                up.clone(),
                line(3.0, 0.0),
            ],
        );
        let expected = [
            feed(7.5),
            arc(6.0, 6.0, [0.0, 6.0], 1),
            Call::Mist(true),
            up,
            feed(10.0),
            line(3.0, 0.0),
        ];
        assert_eq!(found, expected);
    }
}
