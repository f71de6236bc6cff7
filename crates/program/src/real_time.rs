//! How much quicker than motion planning is.
//!
//! In:  while a program is planned: how far motion is planned, up to which line, and what processor time it took so far.
//! Out: the real-time factor, seconds of motion per second of planning, of the whole program and of its slowest stretch.
//!
//! The machine never runs faster than it can stop in what is planned, so that a planner that falls behind costs stops, no fault; a
//! program with [`FACTOR_MIN`] everywhere has none, even where others want the processor. Processor time is what counts and not
//! the clock on the wall: what a preempted thread waits for is no property of the program, and a busy PC raises no false alarm.
//! A stretch is the shortest one of at least `STRETCH_S` of motion: below that, what is planned already bridges any delay, and
//! what a processor does besides (caches, page faults, its frequency) would count more than the program does. It begins where
//! something has been planned already: before that the machine stands, and only waits a little longer.

use super::outline::{Draft, Outline};
use motion::element::{Action, Element};
use motion::plan::{LimitJudge, Over, Settings};
use motion::ring::{Publish, Sink, Timed};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fmt;

/// Below this the machine may have to wait for its plan on a PC that does something else as well.
pub const FACTOR_MIN: f64 = 10.0;
/// Motion of a stretch at the least, s.
const STRETCH_S: f64 = 1.0;
/// Tools of a program that are told: more than any magazine holds.
const TOOLS_MAX: usize = 200;
/// Motion between two looks at the clock at the least, s: a look is a system call.
const LOOK_S: f64 = 0.25;

/// The stretch with the least factor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SlowStretch {
    /// Seconds of motion per second of planning.
    pub factor: f64,
    /// Lines of the program.
    pub from_line: u32,
    pub to_line: u32,
    /// Motion before it and up to its end, s.
    pub from_s: f64,
    pub to_s: f64,
}

/// How much quicker than motion planning is, on this PC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RealTimeFactor {
    /// Seconds of motion per second of planning, of the whole program; `None`: there is no motion.
    pub whole: Option<f64>,
    /// The stretch where it is least; `None`: the program is shorter than a stretch.
    pub least: Option<SlowStretch>,
}

impl RealTimeFactor {
    /// The place where planning is too slow for real time, if there is one: its line, and what is the matter.
    pub fn warning(&self) -> Option<(u32, String)> {
        let least = self.least.filter(|least| least.factor < FACTOR_MIN)?;
        Some((least.from_line, least.to_string()))
    }
}

impl fmt::Display for SlowStretch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "planning is slow for real time here: {:.1} s of motion per second of processor time up to line {}, {FACTOR_MIN} or more \
             are safe; while this PC does something else, the machine may stop and wait for its plan",
            self.factor, self.to_line,
        )
    }
}

/// Planned so far.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    motion_s: f64,
    cpu_s: f64,
    line: u32,
}

/// Follows a plan as it is made, by one thread: several work ahead of what is planned by as much as they like.
#[derive(Debug)]
pub struct Pace {
    began_cpu_s: f64,
    /// The latest, a stretch and some more of motion.
    points: VecDeque<Point>,
    least: Option<SlowStretch>,
}

impl Pace {
    /// Nothing is planned yet.
    pub fn new(cpu_s: f64) -> Pace {
        Pace {
            began_cpu_s: cpu_s,
            points: VecDeque::new(),
            least: None,
        }
    }

    /// So much motion is planned now. The clock is looked at where there is enough of it.
    pub fn planned(&mut self, motion_s: f64, line: u32, cpu_s: impl FnOnce() -> f64) {
        if (self.points.back()).is_none_or(|last| motion_s >= last.motion_s + LOOK_S) {
            self.look(Point {
                motion_s,
                cpu_s: cpu_s(),
                line,
            });
        }
    }

    fn look(&mut self, now: Point) {
        for from in self
            .points
            .iter()
            .take_while(|from| now.motion_s - from.motion_s >= STRETCH_S)
        {
            let factor = factor(now.motion_s - from.motion_s, now.cpu_s - from.cpu_s);
            if self.least.is_none_or(|least| factor < least.factor) {
                self.least = Some(SlowStretch {
                    factor,
                    from_line: from.line,
                    to_line: now.line,
                    from_s: from.motion_s,
                    to_s: now.motion_s,
                });
            }
        }
        self.points.push_back(now);
        // A stretch of twice the length has a half that is no faster.
        while (self.points.get(1)).is_some_and(|second| now.motion_s - second.motion_s > 2.0 * STRETCH_S) {
            self.points.pop_front();
        }
    }

    /// All is planned.
    pub fn finish(&mut self, motion_s: f64, line: u32, cpu_s: f64) -> RealTimeFactor {
        self.look(Point { motion_s, cpu_s, line });
        RealTimeFactor {
            whole: (motion_s > 0.0).then(|| factor(motion_s, cpu_s - self.began_cpu_s)),
            least: self.least,
        }
    }
}

/// A clock of processor time may stand still for as long as it takes to plan something.
fn factor(motion_s: f64, cpu_s: f64) -> f64 {
    motion_s / cpu_s.max(1e-6)
}

/// Takes a plan for its size, its duration and the pace at which it is made.
pub struct Measure {
    elements: usize,
    time_s: f64,
    tail: Vec<Element>,
    draft: Draft,
    line: u32,
    cpu_s: fn() -> f64,
    pace: Pace,
    /// Whether limits are looked at, and the first that is not kept.
    judge: Option<LimitJudge>,
    over: Option<Over>,
    /// Tools that it changes to, each once, in the order of their first use.
    tools: Vec<u32>,
}

impl Measure {
    /// `cpu_s`: processor time of the thread that plans, s.
    pub fn new(cpu_s: fn() -> f64) -> Measure {
        Measure {
            elements: 0,
            time_s: 0.0,
            tail: Vec::new(),
            draft: Draft::default(),
            line: 1,
            cpu_s,
            pace: Pace::new(cpu_s()),
            judge: None,
            over: None,
            tools: Vec::new(),
        }
    }

    /// The same that looks at the limits of velocity and acceleration.
    pub fn judging(self, settings: &Settings) -> Measure {
        Measure {
            judge: Some(LimitJudge::new(settings)),
            ..self
        }
    }

    /// The first limit that the plan does not keep.
    pub fn over(&self) -> Option<Over> {
        self.over
    }

    /// Tools that it changes to, each once, in the order of their first use; the first 200.
    pub fn tools(&self) -> &[u32] {
        &self.tools
    }

    fn note_tool(&mut self, element: &Element) {
        if let Element::Action {
            action: Action::ChangeTool { tool },
            ..
        } = element
            && self.tools.len() < TOOLS_MAX
            && !self.tools.contains(tool)
        {
            self.tools.push(*tool);
        }
    }

    /// Elements of the plan.
    pub fn elements(&self) -> usize {
        self.elements
    }

    /// Planned time, s.
    pub fn time_s(&self) -> f64 {
        self.time_s + self.tail_s()
    }

    fn tail_s(&self) -> f64 {
        self.tail.iter().map(Timed::duration_s).sum()
    }

    /// Once all is planned: its times by place.
    pub fn outline(&self) -> Outline {
        self.draft.finish(&self.tail)
    }

    /// Once all is planned: how much quicker than motion that was.
    pub fn real_time_factor(&mut self) -> RealTimeFactor {
        self.pace.finish(self.time_s + self.tail_s(), self.line, (self.cpu_s)())
    }
}

impl Sink<Element> for Measure {
    fn free(&self) -> usize {
        usize::MAX / 2
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        self.elements += committed.len();
        self.time_s += committed.iter().map(Timed::duration_s).sum::<f64>();
        committed.iter().for_each(|element| self.draft.add(element));
        committed.iter().for_each(|element| self.note_tool(element));
        if let (Some(judge), None) = (&self.judge, self.over) {
            self.over = committed.iter().find_map(|element| judge.over(element));
        }
        self.tail.clear();
        self.tail.extend_from_slice(tail);
        if let Some(last) = tail.last().or(committed.last()) {
            self.line = last.line();
            self.pace.planned(self.time_s + self.tail_s(), self.line, self.cpu_s);
        }
        Publish::Done
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::canon::{AXES, Position};
    use motion::element::{Auxiliary, Enables, Span};
    use motion::path::Piece;
    use motion::plan::AxisLimits;
    use motion::rt::Order;

    /// A plan of steps of motion, each with its cost, s; the line is the number of the step.
    fn pace(steps: &[(f64, f64)]) -> RealTimeFactor {
        let mut pace = Pace::new(0.0);
        let (mut motion_s, mut cpu_s, mut line) = (0.0, 0.0, 0);
        for (motion, cost) in steps {
            (motion_s, cpu_s, line) = (motion_s + motion, cpu_s + cost, line + 1);
            pace.planned(motion_s, line, || cpu_s);
        }
        pace.finish(motion_s, line, cpu_s)
    }

    #[test]
    fn a_limit_that_a_plan_does_not_keep_is_told_with_its_line() {
        let limits = AxisLimits {
            velocity: 100.0,
            acceleration: 1000.0,
            jerk: 20_000.0,
            travel: [-500.0, 500.0],
        };
        let settings = Settings::new([Some(limits); AXES], 1e-3);
        let piece = Piece::line(Position::ZERO, Position::xyz(100.0, 0.0, 0.0)).unwrap();
        let span = |v0: f64, line: u32| {
            Element::Span(Span {
                piece,
                s0: 0.0,
                v0,
                a0: 0.0,
                jerk: 0.0,
                gradient: 0.0,
                duration_s: 0.1,
                line,
                rapid: false,
                enables: Enables::INITIAL,
                auxiliary: Auxiliary::INITIAL,
                modes: 0,
            })
        };
        let mut measure = Measure::new(|| 0.0).judging(&settings);
        measure.publish(&[span(100.0, 3), span(99.0, 4)], &[]);
        assert_eq!(measure.over(), None);
        measure.publish(&[span(50.0, 5), span(103.0, 6), span(200.0, 7)], &[]);
        let over = measure.over().unwrap();
        assert_eq!(
            (over.line, over.joint, over.order, over.value, over.limit),
            (6, 0, Order::Velocity, 103.0, 100.0)
        );
        assert_eq!(Measure::new(|| 0.0).over(), None);
    }

    #[test]
    fn the_slowest_second_is_found_with_its_lines() {
        let mut steps = vec![(0.5, 0.01); 100];
        steps[40..44].fill((0.5, 0.1));
        let found = pace(&steps);
        assert!((found.whole.unwrap() - 50.0 / 1.36).abs() < 1e-9);
        let least = found.least.unwrap();
        assert!((least.factor - 5.0).abs() < 1e-9, "{least:?}");
        assert_eq!((least.from_line, least.to_line), (40, 42));
        assert!((least.from_s, least.to_s) == (20.0, 21.0));
        let (line, what) = found.warning().expect("it is below 10");
        assert_eq!(line, 40);
        assert!(what.contains("5.0 s of motion per second of processor time up to line 42"));
    }

    #[test]
    fn a_short_delay_and_what_comes_before_motion_are_no_slow_stretch() {
        // A look that costs half as much as the motion it gives, once; a start that costs a second.
        let mut steps = vec![(0.5, 0.01); 100];
        steps[0].1 = 1.0;
        steps[50] = (0.1, 0.05);
        let found = pace(&steps);
        assert!(found.least.unwrap().factor > FACTOR_MIN, "{found:?}");
        assert_eq!(found.warning(), None);
        // Programs without a stretch.
        assert_eq!(pace(&[(0.9, 0.5)]).warning(), None);
        assert_eq!((pace(&[]).whole, pace(&[]).least), (None, None));
    }

    #[test]
    fn a_plan_that_comes_in_one_piece_is_a_stretch_of_its_own() {
        let found = pace(&[(0.3, 0.01), (8.0, 2.0), (0.3, 0.01)]);
        assert!(
            found.least.unwrap().factor < 4.1 && found.warning().is_some(),
            "{found:?}"
        );
    }

    #[test]
    fn the_clock_is_looked_at_a_few_times_a_second_of_motion_and_little_is_kept() {
        let mut pace = Pace::new(0.0);
        let mut looks = 0;
        for step in 1..=1_000_000_u32 {
            pace.planned(f64::from(step) * 1e-4, step, || {
                looks += 1;
                0.0
            });
        }
        assert!((390..=401).contains(&looks), "{looks}");
        assert!(pace.points.len() <= 11, "{}", pace.points.len());
    }
}
