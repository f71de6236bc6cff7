//! Overrides that change while a machine runs: limits, reaction, and that the path is run to its end.

use super::random::{Step, program, step};
use super::*;
use crate::element::Element;
use crate::ring::{Producer, channel};
use crate::rt::{Interpolator, Monitor, MonitorLimits, MotionLimits, SampleState, ScaleRamp, StopLimits};
use proptest::prelude::*;
use std::collections::VecDeque;

/// From the order to the first set-point that differs.
const REACTION_CYCLES: usize = 50;

/// A planner, a ring and the interpolation; between two cycles the planner does all that it can.
struct Rig {
    planner: Planner<Producer<Element>>,
    interpolator: Interpolator,
    events: VecDeque<Event>,
    finished: bool,
    ideal: Vec<Programmed>,
    samples: Vec<Position>,
    speeds: Vec<f64>,
    share: f64,
}

impl Rig {
    fn new(events: Vec<Event>) -> Rig {
        let settings = Settings {
            planner_kind: PlannerKind::Optimal,
            ..settings()
        };
        let (producer, consumer) = channel(settings.largest_publication());
        let axes = settings.axes.iter().flatten().map(|axis| {
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
        let ramp = ScaleRamp::new(&axes.collect::<Vec<_>>(), settings.cycle_s);
        Rig {
            planner: Planner::new(settings, producer),
            interpolator: Interpolator::new(consumer, settings.start, ramp),
            events: events.into(),
            finished: false,
            ideal: Vec::new(),
            samples: vec![settings.start],
            speeds: vec![0.0],
            share: 1.0,
        }
    }

    fn plan(&mut self) {
        while self.planner.pump() == Pumped::Hungry {
            match self.events.pop_front() {
                Some(event) => self.planner.push(&event).unwrap(),
                None if !self.finished => {
                    self.planner.finish();
                    self.finished = true;
                }
                None => break,
            }
            self.ideal.extend(self.planner.ideal_path());
        }
    }

    /// One cycle; whether anything is still to come.
    fn cycle(&mut self) -> bool {
        self.plan();
        let sample = self.interpolator.step(self.share);
        self.samples.push(sample.position);
        self.speeds.push(sample.velocity_mm_s);
        if sample.action.is_some() {
            self.interpolator.acknowledge_action();
        }
        let rests = matches!(sample.state, SampleState::Starved | SampleState::Finished);
        !(rests && self.finished && self.planner.is_done())
    }

    fn cycles(&mut self, count: usize) {
        for _ in 0..count {
            self.cycle();
        }
    }

    fn run(&mut self) {
        for _ in 0..400_000 {
            if !self.cycle() {
                return;
            }
        }
        panic!("the program does not end");
    }

    /// Asserts what must hold for any run.
    fn proven(&self, tolerance: f64) {
        let settings = settings();
        let peaks = check(&self.samples, settings.cycle_s, &settings.axes);
        assert_eq!(peaks.over(), 0, "{peaks:?}");
        let found = deviation(&self.samples, &self.ideal, tolerance);
        assert!(found.off_mm <= tolerance + 1e-9, "{found:?}");
        if let (Some(last), Some(end)) = (self.ideal.last(), self.samples.last()) {
            assert!(distance(&last.piece.position(last.piece.length()).0, &end.0) < 1e-9);
        }
    }
}

/// Watches what a machine that may go backward is told: where it is when, and the limits, those of stops while its pace changes.
struct Watch(Monitor);

impl Watch {
    fn new() -> Watch {
        let settings = settings();
        let limits = settings.axes.iter().flatten().map(|axis| MonitorLimits {
            of_order: [axis.velocity, axis.acceleration, axis.jerk],
            scaling: [axis.velocity, 2.0 * axis.acceleration, 4.0 * axis.jerk],
            travel: axis.travel,
        });
        Watch(Monitor::new(&limits.collect::<Vec<_>>(), settings.cycle_s))
    }

    fn check(&mut self, rig: &Rig) {
        let at = rig.samples.last().unwrap();
        let joints: Vec<f64> = settings()
            .axes
            .iter()
            .zip(at.0)
            .filter_map(|(axis, at)| axis.map(|_| at))
            .collect();
        let trip = self.0.check(&joints, rig.interpolator.is_scaling());
        assert_eq!(trip, None, "in cycle {}", rig.samples.len());
    }

    /// No limit was passed, all of it was on the path that is run without orders, and its end was reached.
    fn proven(&self, rig: &Rig, undisturbed: &[Position]) {
        /// What the chord of a millisecond takes of a curve, and of a small kink that is passed at speed.
        const ARROW_MM: f64 = 2e-3;
        /// Chords around the last place among which the next one is looked for.
        const AROUND: usize = 200;
        for (_, peaks) in self.0.peaks() {
            assert_eq!(peaks.over, [0; 3], "{peaks:?}");
        }
        let mut near = 0_usize;
        for (cycle, at) in rig.samples.iter().enumerate() {
            let chords = undisturbed.len() - 1;
            let off = |k: usize| (to_chord(&at.0, &undisturbed[k].0, &undisturbed[k + 1].0), k);
            let nearest = |range: std::ops::Range<usize>| {
                let nearest = range.map(off).min_by(|a, b| a.0.total_cmp(&b.0));
                nearest.unwrap_or((distance(&at.0, &undisturbed[0].0), 0))
            };
            let (mut off_mm, mut place) = nearest(near.saturating_sub(AROUND)..(near + AROUND).min(chords));
            if off_mm > ARROW_MM {
                // The path may have come by here twice, and the other time was taken for this one.
                (off_mm, place) = nearest(0..chords);
            }
            assert!(off_mm <= ARROW_MM, "cycle {cycle}: {off_mm} mm off the path");
            near = place;
        }
        let (last, end) = (undisturbed.last().unwrap(), rig.samples.last().unwrap());
        assert!(distance(&last.0, &end.0) < 1e-9);
    }
}

fn to_chord(at: &[f64; AXES], from: &[f64; AXES], to: &[f64; AXES]) -> f64 {
    let mut along = [0.0; AXES];
    let (mut dot, mut length2) = (0.0, 0.0);
    for axis in 0..AXES {
        along[axis] = to[axis] - from[axis];
        dot += (at[axis] - from[axis]) * along[axis];
        length2 += along[axis] * along[axis];
    }
    let share = if length2 > 0.0 {
        (dot / length2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let mut foot = *from;
    for axis in 0..AXES {
        foot[axis] += share * along[axis];
    }
    distance(at, &foot)
}

/// Set-points of a program without any orders, each once: where it waits takes no time on the way back.
fn undisturbed(events: Vec<Event>) -> Vec<Position> {
    let mut rig = Rig::new(events);
    rig.run();
    rig.samples.dedup();
    rig.samples
}

/// Cycles from now to the first set-point that is different because of this override.
fn reaction(rig: &mut Rig, events: &[Event], before: impl Fn(&mut Rig), feed: f64, rapid: f64) -> usize {
    let mut other = Rig::new(events.to_vec());
    before(&mut other);
    let since = rig.samples.len();
    rig.planner.set_override(feed, rapid);
    rig.cycles(120);
    other.cycles(120);
    let pairs = rig.samples[since..].iter().zip(&other.samples[since..]);
    let differs = |(a, b): (&Position, &Position)| distance(&a.0, &b.0) > 1e-9;
    pairs.map(differs).position(|differs| differs).unwrap() + 1
}

/// What must hold of speeds behind an order that lowers the feed from one to another: never faster than before, down and not
/// up again, then even.
fn assert_comes_down(speeds: &[f64], [from, to]: [f64; 2], what: &str) {
    /// Part of a speed by which the way down may go up again in between.
    const EVEN: f64 = 0.005;
    let fastest = speeds.iter().fold(0.0f64, |most, speed| most.max(*speed));
    assert!(fastest <= from * 1.0005, "{what}: {fastest} after {from}");
    let crest = speeds.iter().position(|speed| *speed == fastest).unwrap();
    let mut least = fastest;
    for (k, &speed) in speeds.iter().enumerate().skip(crest) {
        least = least.min(speed);
        assert!(
            speed <= least * (1.0 + EVEN),
            "{what}: from {least} up to {speed} at {k}"
        );
    }
    assert!(least >= to * (1.0 - EVEN), "{what}: down to {least} on the way to {to}");
    for speed in &speeds[450..] {
        // What the solver leaves is below the feed, never above it.
        assert!(*speed > 0.998 * to && *speed < 1.0005 * to, "{what}: {speed}, not {to}");
    }
}

fn circle_of_chords() -> Vec<Event> {
    let chords = (1..=1257).map(|k| {
        let (sin, cos) = (f64::from(k) * 0.005).sin_cos();
        feed(20.0 * cos - 20.0, 20.0 * sin, 0.0)
    });
    events([F, ROUND].into_iter().chain(chords))
}

fn long_line() -> Vec<Event> {
    events([
        Call::SetFeedRate {
            linear: 80.0,
            angular: 80.0,
        },
        feed(300.0, 100.0, 0.0),
    ])
}

#[test]
fn a_line_follows_the_override_soon_and_within_limits() {
    let events = long_line();
    let mut rig = Rig::new(events.clone());
    let before = |rig: &mut Rig| rig.cycles(500);
    before(&mut rig);
    let cycles = reaction(&mut rig, &events, before, 0.5, 1.0);
    assert!(cycles <= REACTION_CYCLES, "{cycles}");
    rig.cycles(400);
    let at = rig.samples.len();
    rig.cycles(200);
    for speed in &rig.speeds[at..] {
        assert!((speed / 40.0 - 1.0).abs() < 0.002, "{speed}");
    }
    rig.planner.set_override(1.2, 1.0);
    rig.cycles(500);
    let speed = rig.speeds.last().unwrap();
    assert!((speed / 96.0 - 1.0).abs() < 0.002, "{speed}");
    rig.run();
    rig.proven(0.0);
}

#[test]
fn whenever_the_override_comes_the_feed_comes_down_to_it_and_nothing_runs_faster_than_before() {
    for (name, events, top) in [("line", long_line(), 80.0), ("circle", circle_of_chords(), 100.0)] {
        let mut undisturbed = Rig::new(events.clone());
        undisturbed.cycles(300);
        let at_full_speed = |speed: &f64| *speed > 0.999 * top;
        let full_speed = undisturbed.speeds.iter().position(at_full_speed).unwrap();
        for share in [0.2, 0.5, 0.9] {
            // Speeding up, above and below what is ordered, and at full speed.
            for order_at in [20, 44, 57, 70, 83, 96, 109, 140, 200, 251, 300] {
                let what = format!("{name}, {share} after {order_at} cycles");
                let mut rig = Rig::new(events.clone());
                let before = |rig: &mut Rig| rig.cycles(order_at);
                before(&mut rig);
                let since = rig.speeds.len();
                let cycles = reaction(&mut rig, &events, before, share, 1.0);
                // As long as acceleration is being taken back as quickly as can be, there is nothing else to be done.
                let turning = (full_speed + 20).saturating_sub(order_at);
                assert!(cycles <= REACTION_CYCLES.max(turning), "{what}: {cycles}");
                rig.cycles(480);
                assert_comes_down(&rig.speeds[since..], [top, share * top], &what);
                rig.run();
                rig.proven(if name == "line" { 0.0 } else { 0.01 });
            }
        }
    }
}

#[test]
fn an_override_of_nothing_rests_on_the_path() {
    for events in [long_line(), circle_of_chords()] {
        let mut rig = Rig::new(events.clone());
        let before = |rig: &mut Rig| rig.cycles(450);
        before(&mut rig);
        let cycles = reaction(&mut rig, &events, before, 0.0, 1.0);
        assert!(cycles <= REACTION_CYCLES, "{cycles}");
        rig.cycles(1500);
        assert_eq!(rig.speeds.last(), Some(&0.0));
        rig.planner.set_override(0.7, 1.0);
        rig.cycles(20);
        assert!(rig.speeds.last().unwrap() > &0.0);
        rig.run();
        rig.proven(0.01);
    }
}

#[test]
fn a_dense_curve_follows_the_override_soon_and_within_limits() {
    let events = circle_of_chords();
    for share in [0.1, 0.5, 0.9] {
        let mut rig = Rig::new(events.clone());
        let before = |rig: &mut Rig| rig.cycles(450);
        before(&mut rig);
        let cycles = reaction(&mut rig, &events, before, share, 1.0);
        assert!(cycles <= REACTION_CYCLES, "{share}: {cycles}");
        rig.cycles(600);
        let at = rig.samples.len();
        rig.cycles(150);
        for speed in &rig.speeds[at..] {
            assert!(*speed < 100.0 * share * 1.002, "{speed}");
        }
        rig.planner.set_override(1.0, 1.0);
        rig.run();
        rig.proven(0.01);
    }
}

#[test]
fn rapid_moves_have_an_override_of_their_own() {
    let events = events([
        F,
        Call::StraightTraverse {
            to: Position::xyz(200.0, 50.0, 0.0),
        },
        feed(250.0, 50.0, 0.0),
    ]);
    let mut rig = Rig::new(events.clone());
    let before = |rig: &mut Rig| rig.cycles(600);
    before(&mut rig);
    let cycles = reaction(&mut rig, &events, before, 1.0, 0.25);
    assert!(cycles <= REACTION_CYCLES, "{cycles}");
    rig.cycles(500);
    // X is the first joint at its limit, 100 mm/s.
    let speed = rig.speeds.last().unwrap() * 200.0 / 200.0_f64.hypot(50.0);
    assert!((speed / 25.0 - 1.0).abs() < 0.002, "{speed}");
    rig.run();
    rig.proven(0.0);
    assert!(rig.speeds.iter().fold(0.0_f64, |most, speed| most.max(*speed)) > 99.0);
}

#[test]
fn where_the_program_switches_overrides_off_they_have_no_effect() {
    let events = events([
        ROUND,
        Call::SetFeedRate {
            linear: 60.0,
            angular: 60.0,
        },
        feed(60.0, 0.0, 0.0),
        Call::EnableFeedOverride(false),
        feed(120.0, 0.0, 0.0),
        feed(120.0, 60.0, 0.0),
        Call::StraightTraverse {
            to: Position::xyz(60.0, 60.0, 0.0),
        },
        Call::EnableFeedOverride(true),
        Call::StraightTraverse {
            to: Position::xyz(0.0, 60.0, 0.0),
        },
    ]);
    for order_at in [0, 300, 900] {
        let mut rig = Rig::new(events.clone());
        rig.cycles(order_at);
        rig.planner.set_override(0.3, 0.2);
        rig.run();
        rig.proven(0.011);
        let fastest = |x: [f64; 2], y: [f64; 2]| {
            let places = rig.samples.iter().zip(&rig.speeds);
            let inside = places.filter(|(at, _)| (x[0]..x[1]).contains(&at.0[0]) && (y[0]..y[1]).contains(&at.0[1]));
            inside.fold(0.0_f64, |most, (_, speed)| most.max(*speed))
        };
        let near = |got: f64, want: f64| assert!((got / want - 1.0).abs() < 0.001, "{order_at}: {got}, not {want}");
        // On the path up to the order as fast as before.
        near(
            fastest([-1.0, 59.9], [-1.0, 1.0]),
            if order_at == 0 { 18.0 } else { 60.0 },
        );
        near(fastest([60.1, 119.0], [-1.0, 1.0]), 60.0);
        near(fastest([119.5, 121.0], [1.0, 59.0]), 60.0);
        near(fastest([61.0, 119.0], [59.5, 61.0]), 100.0);
        near(fastest([-1.0, 59.9], [59.5, 61.0]), 20.0);
    }
}

#[test]
fn an_override_that_changes_on_the_way_back_acts_on_what_has_not_been_run() {
    for events in [long_line(), circle_of_chords()] {
        let path = undisturbed(events.clone());
        let mut rig = Rig::new(events);
        let mut watch = Watch::new();
        let mut run = |rig: &mut Rig, cycles: usize| {
            for _ in 0..cycles {
                rig.cycle();
                watch.check(rig);
            }
        };
        run(&mut rig, 600);
        rig.share = -1.0;
        run(&mut rig, 300);
        let turned = rig.samples[..rig.samples.len() - 200].to_vec();
        rig.planner.set_override(0.5, 1.0);
        run(&mut rig, 100);
        let back = *rig.samples.last().unwrap();
        rig.share = 1.0;
        run(&mut rig, 700);
        // Forward again beyond where it turned: at half the feed behind the elements that were in the machine's hands.
        let last = rig.samples.last().unwrap();
        let farthest = turned
            .iter()
            .map(|at| distance(&at.0, &[0.0; AXES]))
            .fold(0.0, f64::max);
        assert!(distance(&back.0, &[0.0; AXES]) < farthest - 5.0, "{back:?}");
        assert!(distance(&last.0, &back.0) > 5.0, "{last:?}");
        let speed = *rig.speeds.last().unwrap();
        let full = rig.speeds.iter().fold(0.0f64, |most, speed| most.max(*speed));
        assert!((speed / (0.5 * full) - 1.0).abs() < 0.002, "{speed} of {full}");
        rig.run();
        watch.proven(&rig, &path);
    }
}

#[test]
fn a_hold_while_the_override_changes_goes_on_to_the_end() {
    let mut rig = Rig::new(circle_of_chords());
    rig.cycles(450);
    rig.share = 0.0;
    rig.cycles(30);
    rig.planner.set_override(0.3, 1.0);
    rig.cycles(1000);
    assert_eq!(rig.speeds.last(), Some(&0.0));
    rig.share = 1.0;
    rig.run();
    let found = deviation(&rig.samples, &rig.ideal, 0.01);
    assert!(found.off_mm <= 0.01 + 1e-9, "{found:?}");
    let end = rig.samples.last().unwrap();
    assert!(distance(&rig.ideal.last().unwrap().piece.position(1e9).0, &end.0) < 1e-2);
}

/// Figures, not proof: `cargo test --release -p isocnc-motion --lib override_figures -- --ignored --nocapture`.
#[test]
#[ignore = "prints times"]
fn override_figures() {
    for (name, events) in [("line", long_line()), ("circle of chords", circle_of_chords())] {
        for share in [0.1, 0.5, 0.9] {
            let mut rig = Rig::new(events.clone());
            let before = |rig: &mut Rig| rig.cycles(450);
            before(&mut rig);
            let cycles = reaction(&mut rig, &events, before, share, 1.0);
            let mut rig = Rig::new(events.clone());
            before(&mut rig);
            rig.planner.set_override(share, 1.0);
            let begin = std::time::Instant::now();
            rig.planner.pump();
            println!(
                "{name}, to {share}: {cycles} cycles to reaction, planned in {:?}",
                begin.elapsed()
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Whatever the program and whatever is ordered when: limits hold, the path is kept, the end is reached.
    #[test]
    fn any_orders_keep_the_limits(
        steps in prop::collection::vec(step(), 1..14),
        orders in prop::collection::vec((1_usize..400, prop_oneof![1 => Just(0.0), 8 => 0.1f64..1.2], prop_oneof![3 => Just(1.0), 1 => 0.1f64..1.0]), 1..16),
        exact in prop::bool::ANY,
    ) {
        let steps: Vec<Step> = steps;
        let mut rig = Rig::new(program(&steps, exact));
        for (wait, feed, rapid) in orders {
            rig.cycles(wait);
            rig.planner.set_override(feed, rapid);
        }
        rig.cycles(5);
        rig.planner.set_override(1.0, 1.0);
        rig.run();
        rig.proven(0.051);
    }
    /// The same backward and forward, held and let go: the plan may change while the machine goes back over what it has run.
    #[test]
    fn any_orders_keep_the_limits_and_the_path_on_the_way_back(
        steps in prop::collection::vec(step(), 1..10),
        orders in prop::collection::vec(
            (
                1_usize..300,
                prop_oneof![3 => Just(1.0), 1 => 0.2f64..1.0, 3 => Just(-1.0), 1 => -1.0f64..-0.2, 1 => Just(0.0)],
                prop::option::of((0.1f64..1.2, prop_oneof![2 => Just(1.0), 1 => 0.1f64..1.0])),
            ),
            1..16,
        ),
        exact in prop::bool::ANY,
    ) {
        let steps: Vec<Step> = steps;
        let mut rig = Rig::new(program(&steps, exact));
        let mut watch = Watch::new();
        for (cycles, share, feeds) in orders {
            rig.share = share;
            if let Some((feed, rapid)) = feeds {
                rig.planner.set_override(feed, rapid);
            }
            for _ in 0..cycles {
                rig.cycle();
                watch.check(&rig);
            }
        }
        rig.share = 1.0;
        rig.planner.set_override(1.0, 1.0);
        for _ in 0..400_000 {
            if !rig.cycle() {
                break;
            }
            watch.check(&rig);
        }
        watch.proven(&rig, &undisturbed(program(&steps, exact)));
    }
}
