//! Motion that takes hours: what a plan costs follows from the shape of the path, not from the time it takes; and it follows
//! orders as soon as any other.

use super::*;
use crate::element::{Element, Span};
use crate::ring::{Producer, Publish, Sink, Timed, channel};
use crate::rt::{Interpolator, MotionLimits, SampleState, ScaleRamp, StopLimits};

/// Counts what is handed over and dropped, and looks at how it joins.
#[derive(Debug, Default)]
struct Counter {
    elements: usize,
    publications: usize,
    largest: usize,
    time_s: f64,
    last: Option<Span>,
    /// Greatest jumps of place and speed, mm and mm/s.
    jumps: [f64; 2],
}

impl Counter {
    fn count(&mut self, element: &Element) {
        self.elements += 1;
        self.time_s += element.duration_s();
        let Element::Span(span) = element else { return };
        if let Some(last) = self.last.replace(*span) {
            let (t, place) = (last.duration_s, |span: &Span, t| span.piece.position(span.place(t)));
            let jump = distance(&place(&last, t).0, &place(span, 0.0).0);
            self.jumps[0] = self.jumps[0].max(jump);
            self.jumps[1] = self.jumps[1].max((last.speed(t) - span.v0).abs());
        }
    }
}

impl Sink<Element> for Counter {
    fn free(&self) -> usize {
        usize::MAX
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        self.publications += 1;
        self.largest = self.largest.max(committed.len() + tail.len());
        committed.iter().for_each(|element| self.count(element));
        Publish::Done
    }
}

fn counted(calls: &[Call], settings: Settings) -> Counter {
    let mut planner = Planner::new(settings, Counter::default());
    for event in events(calls.iter().cloned()) {
        planner.push(&event).unwrap();
        planner.pump();
    }
    planner.finish();
    assert_eq!(planner.pump(), Pumped::Done);
    std::mem::take(planner.sink())
}

fn at_feed(mm_s: f64, calls: &[Call]) -> Vec<Call> {
    let feed = Call::SetFeedRate {
        linear: mm_s,
        angular: mm_s,
    };
    std::iter::once(feed).chain(calls.iter().cloned()).collect()
}

fn arc(x: f64, y: f64, centre: [f64; 2], turns: i32) -> Call {
    Call::ArcFeed {
        to: Position::xyz(x, y, 0.0),
        plane: Plane::Xy,
        centre_mm: centre,
        turns,
    }
}

/// A line; lines with rounded corners; two full circles between lines, which turn smoothly into them.
fn shapes() -> Vec<(&'static str, Vec<Call>, f64)> {
    let square = [feed(40.0, 0.0, 0.0), feed(40.0, 30.0, 0.0), feed(0.0, 30.0, 0.0)];
    let circles = [
        feed(40.0, 0.0, 0.0),
        arc(40.0, 0.0, [40.0, 20.0], 2),
        feed(80.0, 0.0, 0.0),
    ];
    let round = |calls: &[Call]| std::iter::once(ROUND).chain(calls.iter().cloned()).collect::<Vec<_>>();
    vec![
        ("line", vec![feed(41.0, 0.0, 0.0)], 41.0),
        ("square", round(&square), 110.0),
        ("circles", round(&circles), 80.0 + 80.0 * std::f64::consts::PI),
    ]
}

#[test]
fn what_a_plan_costs_does_not_depend_on_how_long_it_takes() {
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        let settings = Settings {
            planner_kind,
            ..settings()
        };
        for (name, calls, length_mm) in shapes() {
            // From a minute or so to a day.
            let [first, .., last] = [1.0, 0.1, 0.01, 0.001].map(|mm_s| {
                let counter = counted(&at_feed(mm_s, &calls), settings);
                let time_s = length_mm / mm_s;
                println!("{name} {planner_kind:?} {mm_s} mm/s: {counter:?}");
                assert!(
                    (counter.time_s / time_s - 1.0).abs() < 2e-3,
                    "{name} {planner_kind:?}: {} of {time_s} s",
                    counter.time_s
                );
                assert!(
                    counter.jumps[0] < 1e-7 && counter.jumps[1] < 1e-7,
                    "{name} {planner_kind:?}: {counter:?}"
                );
                counter
            });
            assert!(
                last.elements < 2 * first.elements.max(30_000),
                "{name} {planner_kind:?}: {} {}",
                first.elements,
                last.elements
            );
            assert!(
                last.publications <= 2 * first.publications.max(10),
                "{name} {planner_kind:?}"
            );
        }
    }
}

#[test]
fn a_machine_that_hardly_accelerates_costs_no_more() {
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        for (name, calls, _) in shapes() {
            let [first, last] = [10.0, 1e-4].map(|acceleration| {
                let mut settings = Settings {
                    planner_kind,
                    ..settings()
                };
                for axis in settings.axes.iter_mut().flatten() {
                    axis.acceleration = acceleration;
                    axis.jerk = 20.0 * acceleration;
                }
                let counter = counted(&at_feed(100.0, &calls), settings);
                println!("{name} {planner_kind:?} {acceleration} mm/s2: {counter:?}");
                assert!(
                    counter.jumps[0] < 1e-7 && counter.jumps[1] < 1e-7,
                    "{name} {planner_kind:?}: {counter:?}"
                );
                counter
            });
            assert!(last.time_s > 100.0 * first.time_s, "{name} {planner_kind:?}");
            assert!(
                last.elements < 2 * first.elements.max(30_000),
                "{name} {planner_kind:?}: {} {}",
                first.elements,
                last.elements
            );
        }
    }
}

/// A machine that follows: planner, ring, interpolation.
struct Follower {
    planner: Planner<Producer<Element>>,
    interpolator: Interpolator,
    speed: f64,
    count: usize,
}

impl Follower {
    fn new(calls: &[Call]) -> Follower {
        let settings = Settings {
            planner_kind: PlannerKind::Optimal,
            ..settings()
        };
        let (producer, consumer) = channel(settings.largest_publication());
        let limits = settings.axes.iter().flatten().map(|axis| {
            let plan = MotionLimits {
                velocity: axis.velocity,
                acceleration: axis.acceleration,
                jerk: axis.jerk,
            };
            let stop = StopLimits {
                acceleration: 2.0 * axis.acceleration,
                jerk: 4.0 * axis.jerk,
            };
            (plan, stop)
        });
        let ramp = ScaleRamp::new(&limits.collect::<Vec<_>>(), settings.cycle_s);
        let mut planner = Planner::new(settings, producer);
        for event in events(calls.iter().cloned()) {
            planner.push(&event).unwrap();
        }
        planner.finish();
        Follower {
            planner,
            interpolator: Interpolator::new(consumer, settings.start, ramp),
            speed: 0.0,
            count: 0,
        }
    }

    fn cycles(&mut self, count: usize) {
        for _ in 0..count {
            self.cycle();
        }
    }

    fn cycle(&mut self) -> SampleState {
        if self.count.is_multiple_of(10) {
            self.planner.pump();
        }
        self.count += 1;
        let sample = self.interpolator.step(1.0);
        self.speed = sample.velocity_mm_s;
        sample.state
    }
}

#[test]
fn slow_motion_follows_an_override_as_soon_as_any_other() {
    // The first has a steady phase of minutes, the second long spans between knots.
    let round = [ROUND, feed(60.0, 0.0, 0.0), feed(60.0, 1.0, 0.0)];
    for (name, calls) in [("line", vec![feed(60.0, 0.0, 0.0)]), ("corner", round.to_vec())] {
        let mut machine = Follower::new(&at_feed(0.5, &calls));
        machine.cycles(50_000);
        assert!((machine.speed / 0.5 - 1.0).abs() < 2e-3, "{name}: {}", machine.speed);
        for share in [0.8, 1.2] {
            machine.planner.set_override(share, 1.0);
            machine.cycles(200);
            assert!(
                (machine.speed / (0.5 * share) - 1.0).abs() < 2e-3,
                "{name}: {} at {share}",
                machine.speed
            );
        }
        let cycles = (0..200_000).find(|_| machine.cycle() == SampleState::Starved && machine.planner.is_done());
        assert!(cycles.is_some(), "{name}: no end");
        let end = calls.last().map(|call| match call {
            Call::StraightFeed { to } => *to,
            other => panic!("{other:?}"),
        });
        let off = distance(&machine.interpolator.position().0, &end.unwrap().0);
        assert!(off < 1e-9, "{name}: {off}");
        assert!(
            (cycles.unwrap() as f64 * 1e-3 - 60.0 / 0.5).abs() < 250.0,
            "{name}: {cycles:?}"
        );
    }
}
