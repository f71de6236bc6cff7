//! The planner's own gate: looks at every seam of what is about to be handed over.
//!
//! In:  elements, final ones and the stop behind them.
//! Out: nothing, or the line at which a joint would jump: in position, in speed or in acceleration; or would be above a limit.
//!
//! Between two elements on one piece it is the same law of motion that goes on or not: place, speed and acceleration along the path. Where
//! the piece changes, the joints are asked: what set-points show of a jump must stay within their limits, as at a corner that is passed
//! at speed. A seam that does not is a defect of the planner; what it belongs to is planned anew, and nothing of it is published.

use super::{AxisLimits, Settings};
use crate::canon::AXES;
use crate::element::{Element, Span};
use crate::kinematics::{JOINTS, Jet3, Kinematics};
use crate::path::Piece;
use crate::rt::Order;

/// A jump of position that is rounding, mm (degrees).
const ROUNDING: f64 = 1e-7;
/// The same of a speed and an acceleration along one piece, for each unit of them and beside them.
const ROUNDING_OF_SPEED: f64 = 1e-6;
const ROUNDING_OF_ACCELERATION: f64 = 1e-3;
/// Parts of the limits of speed and acceleration up to which they are kept.
const KEPT: f64 = 1.01;
/// Part of the jerk that a jump of acceleration between two pieces may take of a cycle: differences of set-points see 3/4 of it.
const BEND: f64 = 1.5;

/// How all joints move.
#[derive(Clone, Copy, Debug)]
struct Motion {
    q: [f64; JOINTS],
    v: [f64; JOINTS],
    a: [f64; JOINTS],
}

impl Motion {
    /// The same place at rest.
    fn at_rest(self) -> Motion {
        Motion {
            v: [0.0; JOINTS],
            a: [0.0; JOINTS],
            ..self
        }
    }
}

/// What is known of the end of what has been looked at.
#[derive(Clone, Copy, Debug)]
enum End<'e> {
    /// Nothing: what follows takes the place of motion under way.
    Unknown,
    /// It is at rest, wherever.
    Rest,
    /// The joints' motion.
    Motion(Motion),
    /// That of a span: place, speed and acceleration along its piece.
    Span(&'e Span, [f64; 3]),
}

/// Looks at publications, one after the other.
#[derive(Debug)]
pub(super) struct Gate {
    kinematics: Option<Kinematics>,
    limits: Vec<AxisLimits>,
    /// Axes in the place of joints, where there are no others.
    axes: Vec<usize>,
    cycle_s: f64,
    /// Where what is final ends, and where the stop behind it does.
    ends: [Option<Motion>; 2],
    /// The same of what was looked at last.
    next: [Option<Motion>; 2],
    refused: u64,
}

impl Gate {
    pub(super) fn new(settings: &Settings) -> Gate {
        let existing = || (settings.axes.iter().enumerate()).filter_map(|(axis, limits)| Some((axis, (*limits)?)));
        let limits = match &settings.joints {
            Some(space) => space.limits[..space.count()].to_vec(),
            None => existing().map(|(_, limits)| limits).collect(),
        };
        Gate {
            kinematics: settings.joints.map(|space| space.kinematics),
            limits,
            axes: existing().map(|(axis, _)| axis).collect(),
            cycle_s: settings.cycle_s,
            ends: [None; 2],
            next: [None; 2],
            refused: 0,
        }
    }

    /// Publications that were refused.
    pub(super) fn refused(&self) -> u64 {
        self.refused
    }

    /// Whether these may follow what was handed over last; `anew`: they take the place of some of it. Else the line of the first that
    /// may not.
    pub(super) fn check(&mut self, committed: &[Element], tail: &[Element], anew: bool) -> Result<(), u32> {
        let mut end = match self.ends[0] {
            _ if anew => End::Unknown,
            Some(motion) => End::Motion(motion),
            None => End::Rest,
        };
        self.next = [None; 2];
        for (part, elements) in [committed, tail].into_iter().enumerate() {
            for element in elements {
                if let (End::Span(before, at), Element::Span(span)) = (&end, element)
                    && goes_on(*at, span)
                    && before.piece.is(&span.piece)
                    && let Some(here) = at_end(span)
                {
                    end = End::Span(span, here);
                    continue;
                }
                end = self.follow(end, element).ok_or_else(|| {
                    self.refused += 1;
                    element.line()
                })?;
            }
            self.next[part] = match end {
                End::Unknown | End::Rest => None,
                End::Motion(motion) => Some(motion),
                End::Span(span, end) => self.end_of(span, end),
            };
        }
        Ok(())
    }

    /// What was looked at last has been handed over.
    pub(super) fn handed_over(&mut self) {
        self.ends = self.next;
    }

    /// The machine runs down the stop: what follows begins at its end.
    pub(super) fn tail_taken(&mut self) {
        self.ends[0] = self.ends[1];
    }

    /// The end of an element, if it may follow what ends so: another piece, or another motion on it.
    fn follow<'e>(&self, end: End<'_>, element: &'e Element) -> Option<End<'e>> {
        let begins = match element {
            Element::Span(span) => {
                at_end(span)?;
                let begins = self.motion(&span.piece, span.s0, span.v0, span.a0)?;
                self.is_within(&begins).then_some(())?;
                begins
            }
            Element::Synced(synced) => self.motion(&synced.piece, 0.0, 0.0, 0.0)?,
            Element::Probing(probing) => self.motion(&probing.piece, 0.0, 0.0, 0.0)?,
            Element::Dwell { .. } | Element::Action { .. } => match self.motion_of(end)? {
                Some(rests) => rests.at_rest(),
                None => return Some(End::Rest),
            },
        };
        let before = match end {
            End::Rest => Some(begins.at_rest()),
            End::Unknown | End::Motion(_) | End::Span(..) => self.motion_of(end)?,
        };
        if let Some(before) = before {
            (self.is_within(&before) && self.meet(&before, &begins)).then_some(())?;
        }
        Some(match element {
            Element::Span(span) => End::Span(span, at_end(span)?),
            Element::Synced(synced) if synced.tap.is_none() => {
                End::Motion(self.motion(&synced.piece, synced.piece.length(), 0.0, 0.0)?)
            }
            // A tap comes back to where it began; nobody knows where a probe does.
            Element::Synced(_) | Element::Dwell { .. } | Element::Action { .. } => End::Motion(begins),
            Element::Probing(_) => End::Rest,
        })
    }

    /// The motion at an end; the inner `None`: it is not known. The outer one: there is none.
    fn motion_of(&self, end: End<'_>) -> Option<Option<Motion>> {
        Some(match end {
            End::Unknown | End::Rest => None,
            End::Motion(motion) => Some(motion),
            End::Span(span, end) => Some(self.end_of(span, end)?),
        })
    }

    fn end_of(&self, span: &Span, [s, v, a]: [f64; 3]) -> Option<Motion> {
        self.motion(&span.piece, s, v, a)
    }

    /// How the joints move at a place of a piece with this speed and acceleration along it; `None`: it cannot be said.
    fn motion(&self, piece: &Piece, s: f64, v: f64, a: f64) -> Option<Motion> {
        let jet = piece.jet(s);
        let mut joints = [Jet3::ZERO; JOINTS];
        match &self.kinematics {
            Some(kinematics) => {
                kinematics
                    .jets(piece.frame(), &jet, &mut joints[..self.limits.len()])
                    .ok()?;
            }
            None => {
                for (joint, &axis) in joints.iter_mut().zip(&self.axes) {
                    *joint = Jet3::new(jet.q[axis], jet.d1[axis], jet.d2[axis], 0.0);
                }
            }
        }
        let mut motion = Motion {
            q: [0.0; JOINTS],
            v: [0.0; JOINTS],
            a: [0.0; JOINTS],
        };
        for (k, joint) in joints[..self.limits.len()].iter().enumerate() {
            motion.q[k] = joint.q;
            motion.v[k] = joint.d1 * v;
            motion.a[k] = joint.d2 * v * v + joint.d1 * a;
        }
        Some(motion)
    }

    fn is_within(&self, motion: &Motion) -> bool {
        self.limits.iter().enumerate().all(|(k, limits)| {
            motion.q[k].is_finite()
                && motion.v[k].abs() <= KEPT * limits.velocity + ROUNDING_OF_SPEED
                && motion.a[k].abs() <= KEPT * limits.acceleration + ROUNDING_OF_ACCELERATION
        })
    }

    fn meet(&self, before: &Motion, after: &Motion) -> bool {
        self.limits.iter().enumerate().all(|(k, limits)| {
            // A step of speed is a jump of acceleration, and one of jerk.
            let step = (limits.acceleration * self.cycle_s).min(limits.jerk * self.cycle_s * self.cycle_s);
            let jump = |of: fn(&Motion) -> &[f64; JOINTS]| (of(after)[k] - of(before)[k]).abs();
            jump(|motion| &motion.q) <= ROUNDING
                && jump(|motion| &motion.v) <= KEPT * step + ROUNDING_OF_SPEED
                && jump(|motion| &motion.a) <= BEND * limits.jerk * self.cycle_s + ROUNDING_OF_ACCELERATION
        })
    }
}

/// A limit that a plan would pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Over {
    /// Line of the program.
    pub line: u32,
    /// The joint, counted from 0.
    pub joint: usize,
    /// Of what.
    pub order: Order,
    /// Planned, in [`Order::unit`].
    pub value: f64,
    /// Allowed.
    pub limit: f64,
}

/// Judges plans in the midst of their spans, for checks before anything moves: the gate itself looks at seams.
#[derive(Debug)]
pub struct LimitJudge(Gate);

impl LimitJudge {
    /// For a machine with these settings.
    pub fn new(settings: &Settings) -> LimitJudge {
        LimitJudge(Gate::new(settings))
    }

    /// The first limit of velocity or acceleration that the element passes by more than a hundredth.
    pub fn over(&self, element: &Element) -> Option<Over> {
        /// Time between two looks, s, and how many there are in a span at the most: the long ones are steady.
        const EVERY_S: f64 = 0.005;
        const LOOKS_MAX: f64 = 64.0;
        let Element::Span(span) = element else { return None };
        let looks = (span.duration_s / EVERY_S).ceil().clamp(1.0, LOOKS_MAX);
        // Within a piece a span begins as the one before it ended.
        let first = usize::from(span.s0 > 0.0);
        (first..=looks as usize).find_map(|look| {
            let t = span.duration_s * look as f64 / looks;
            let s = span.place(t);
            let (v, a) = (span.speed(t), span.a0 + span.jerk * t + span.gradient * (s - span.s0));
            let motion = self.0.motion(&span.piece, s, v, a)?;
            self.0.limits.iter().enumerate().find_map(|(joint, limits)| {
                let kept = |order, value: f64, limit: f64, rounding: f64| {
                    let is_kept = value.abs() <= KEPT * limit + rounding;
                    (!is_kept).then_some(Over {
                        line: span.line,
                        joint,
                        order,
                        value: value.abs(),
                        limit,
                    })
                };
                kept(Order::Velocity, motion.v[joint], limits.velocity, ROUNDING_OF_SPEED).or_else(|| {
                    let rounding = ROUNDING_OF_ACCELERATION;
                    kept(Order::Acceleration, motion.a[joint], limits.acceleration, rounding)
                })
            })
        })
    }
}

/// Place, speed and acceleration along the path at the end of a span, if it has one.
fn at_end(span: &Span) -> Option<[f64; 3]> {
    let t = span.duration_s;
    let s = span.place(t);
    let end = [
        s,
        span.speed(t),
        span.a0 + span.jerk * t + span.gradient * (s - span.s0),
    ];
    (t >= 0.0 && end.iter().all(|x| x.is_finite())).then_some(end)
}

/// Whether the motion along one piece goes on in the next span.
fn goes_on([s, v, a]: [f64; 3], next: &Span) -> bool {
    let near = |x: f64, y: f64, rounding: f64| (x - y).abs() <= rounding * (1.0 + x.abs());
    near(s, next.s0, 1e-9) && near(v, next.v0, ROUNDING_OF_SPEED) && near(a, next.a0, ROUNDING_OF_ACCELERATION)
}

const _: () = assert!(JOINTS >= AXES);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canon::Position;
    use crate::element::{Auxiliary, Enables};

    fn settings() -> Settings {
        let limits = AxisLimits {
            velocity: 100.0,
            acceleration: 1000.0,
            jerk: 20_000.0,
            travel: [-500.0, 500.0],
        };
        Settings::new([Some(limits); AXES], 1e-3)
    }

    fn line(from: [f64; 2], to: [f64; 2]) -> Piece {
        Piece::line(Position::xyz(from[0], from[1], 0.0), Position::xyz(to[0], to[1], 0.0)).expect("a line")
    }

    fn span(piece: Piece, [s0, v0, a0, jerk, duration_s]: [f64; 5], line: u32) -> Element {
        Element::Span(Span {
            piece,
            s0,
            v0,
            a0,
            jerk,
            gradient: 0.0,
            duration_s,
            line,
            rapid: false,
            enables: Enables::INITIAL,
            auxiliary: Auxiliary::INITIAL,
            modes: 0,
        })
    }

    #[test]
    fn a_limit_that_is_passed_in_the_midst_of_a_span_is_told() {
        let judge = LimitJudge::new(&settings());
        let piece = line([0.0, 0.0], [60.0, 80.0]);
        assert_eq!(judge.over(&span(piece, [0.0, 90.0, 0.0, 0.0, 0.5], 7)), None);
        // Its speed rises to 130 mm/s and falls again; Y has 8/10 of that.
        let over = judge
            .over(&span(piece, [0.0, 80.0, 1000.0, -10_000.0, 0.2], 7))
            .expect("a limit");
        assert_eq!(
            (over.line, over.joint, over.order, over.limit),
            (7, 1, Order::Velocity, 100.0)
        );
        assert!(over.value > 101.0 && over.value < 104.1, "{over:?}");
        let over = judge
            .over(&span(piece, [0.0, 50.0, 1500.0, 0.0, 0.01], 8))
            .expect("a limit");
        assert_eq!(
            (over.joint, over.order, over.value.round()),
            (1, Order::Acceleration, 1200.0)
        );
    }

    const REST: Element = Element::Dwell { seconds: 0.1, line: 9 };

    /// At 50 mm/s along a line, and on along another one.
    fn seam(next: Piece, motion: [f64; 5]) -> Result<(), u32> {
        let mut gate = Gate::new(&settings());
        let first = span(line([0.0, 0.0], [10.0, 0.0]), [5.0, 50.0, 0.0, 0.0, 0.1], 1);
        gate.check(&[first, span(next, motion, 2)], &[], true)
    }

    #[test]
    fn what_goes_on_passes_and_every_jump_is_refused_with_its_line() {
        let on = line([10.0, 0.0], [20.0, 0.0]);
        let steady = [0.0, 50.0, 0.0, 0.0, 0.1];
        assert_eq!(seam(on, steady), Ok(()));
        // A corner of less than the jerk of a cycle: 50 mm/s times 0.0003 of the direction.
        assert_eq!(seam(line([10.0, 0.0], [20.0, 0.003]), steady), Ok(()));
        for (what, next, motion) in [
            ("a sharp corner", line([10.0, 0.0], [10.0, 10.0]), steady),
            ("a small corner", line([10.0, 0.0], [20.0, 0.01]), steady),
            ("another place", line([10.000_001, 0.0], [20.0, 0.0]), steady),
            (
                "another place of another axis",
                line([10.0, -1e-5], [20.0, 0.0]),
                steady,
            ),
            ("in its midst", on, [0.001, 50.0, 0.0, 0.0, 0.1]),
            ("faster", on, [0.0, 52.0, 0.0, 0.0, 0.1]),
            ("slower", on, [0.0, 0.0, 0.0, 0.0, 0.1]),
            ("another acceleration", on, [0.0, 50.0, 40.0, 0.0, 0.1]),
            ("above a limit", on, [0.0, 50.0, 2000.0, 0.0, 0.1]),
            ("no number", on, [0.0, f64::NAN, 0.0, 0.0, 0.1]),
            ("for ever", on, [0.0, 50.0, 0.0, 0.0, f64::INFINITY]),
        ] {
            assert_eq!(seam(next, motion), Err(2), "{what}");
        }
    }

    #[test]
    fn on_one_piece_the_law_of_motion_goes_on() {
        let piece = line([0.0, 0.0], [100.0, 0.0]);
        let check = |second: [f64; 5]| {
            let first = span(piece, [5.0, 50.0, 0.0, 1000.0, 0.1], 1);
            Gate::new(&settings()).check(&[first, span(piece, second, 2)], &[], true)
        };
        let s = 5.0 + 5.0 + 1.0 / 6.0;
        assert_eq!(check([s, 55.0, 100.0, 0.0, 0.1]), Ok(()));
        assert_eq!(check([s + 1e-4, 55.0, 100.0, 0.0, 0.1]), Err(2));
        assert_eq!(check([s, 57.0, 100.0, 0.0, 0.1]), Err(2));
        assert_eq!(check([s, 55.0, 400.0, 0.0, 0.1]), Err(2));
    }

    #[test]
    fn publications_follow_each_other_and_stops_end_at_rest() {
        let piece = line([0.0, 0.0], [100.0, 0.0]);
        let mut gate = Gate::new(&settings());
        let rises = span(piece, [0.0, 0.0, 0.0, 20_000.0, 0.05], 1);
        let (s, v, a) = (20_000.0 * 0.05_f64.powi(3) / 6.0, 25.0, 1000.0);
        let settles = span(piece, [s, v, a, -20_000.0, 0.05], 1);
        let s = s + v * 0.05 + a * 0.05 * 0.05 / 2.0 - s;
        let v = 50.0;
        let stop = [
            span(piece, [s, v, 0.0, -20_000.0, 0.05], 1),
            span(
                piece,
                [
                    s + 50.0 * 0.05 - 20_000.0 * 0.05_f64.powi(3) / 6.0,
                    25.0,
                    -1000.0,
                    20_000.0,
                    0.05,
                ],
                1,
            ),
        ];
        assert_eq!(gate.check(&[rises, settles], &stop, false), Ok(()));
        gate.handed_over();
        let on = |s: f64| span(piece, [s, v, 0.0, 0.0, 0.1], 2);
        assert_eq!(gate.check(&[on(s + 0.1)], &[], false), Err(2));
        assert_eq!(gate.check(&[on(s)], &[], false), Ok(()));
        // What moves is at no rest.
        assert_eq!(gate.check(&[on(s), REST], &[], false), Err(9));
        // At the end of the stop it rests: there it may go on, and nowhere else.
        gate.tail_taken();
        assert_eq!(gate.check(&[on(s)], &[], false), Err(2));
        let end = s + 2.5;
        let again = span(piece, [end, 0.0, 0.0, 20_000.0, 0.01], 3);
        assert_eq!(gate.check(&[REST, again], &[], false), Ok(()));
        assert_eq!(gate.check(&[on(s)], &[], true), Ok(()), "in place of what was to come");
        assert_eq!(gate.refused(), 3);
        // What nothing is known of is at rest.
        assert_eq!(Gate::new(&settings()).check(&[on(s)], &[], false), Err(2));
        assert_eq!(Gate::new(&settings()).check(&[rises], &[], false), Ok(()));
    }
}
