//! A program through the planner: once against the clock, once through ring and interpolation.
//!
//! An element that takes long is not run in every one of its cycles, of which there may be millions that differ in nothing: its
//! beginning, its end and many places between them are. What was run is counted, and nothing else is judged.

use super::ahead::Ahead;
use super::export;
use super::ideal_spindle::IdealSpindle;
use super::joints::{Joints, ORDERS};
use super::picture::recording::Recording;
use super::rests::{RestWatch, Rests};
use super::script::{Manner, Operator, Script, ScriptReport};
use super::slow_places::{FeedKept, FeedWatch, On};
use super::times::{TimeTable, TimeWatch};
use config::Config;
use host::wait::thread_cpu_s;
use machine::motion_settings::{ring_capacity, stop_ramp};
use machine::tables::Tables;
use motion::canon::{Axis, Position};
use motion::element::Element;
use motion::kinematics::Kinematics;
use motion::path::{Piece, Shape};
use motion::plan::Programmed;
use motion::plan::deviation::{Deviation, DeviationJudge};
use motion::plan::timeline::{Record, Timeline};
use motion::ring::{self, Producer, Publish, Sink, Timed as _};
use motion::rt::{Interpolator, Sample, SampleState, Shares, SyncFault};
use program::real_time::{Measure, Pace, RealTimeFactor};
use program::text::Reader;
use program::{FeedError, Feeder, Progress, Threads, home};
use std::collections::HashMap;
use std::num::NonZero;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::available_parallelism;
use std::time::Instant;

/// An element that takes longer is not run in every cycle, s.
const LONG_S: f64 = 1.0;
/// Its cycles that are run at both ends, and at each place between them: all that a difference of third order takes.
const AT_ENDS: u64 = 16;
const AT_PLACE: u64 = 4;
/// Places between its ends, at the least; and for each radian by which it turns: chords between them are within 0.1 um of an arc
/// of 300 mm.
const PLACES: f64 = 16.0;
const PLACES_PER_RAD: f64 = 650.0;
/// As much as a piece is taken to turn that is neither a line nor an arc, or whose joints are no linear function of the axes.
const TURN_RAD: f64 = 2.0;

/// Cycles after which a full ring is looked at again: it holds thousands of them.
const FULL_CYCLES: u64 = 64;
/// Cycles after which the planner looks for an override that was turned.
const LOOK_CYCLES: u64 = 5;

/// What there is to know of one cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cycle {
    /// Its number; the first is 0.
    pub(super) number: u64,
    /// Axes, machine coordinates.
    pub(super) position: Position,
    /// On the path.
    pub(super) speed_mm_s: f64,
    pub(super) line: u32,
    pub(super) rapid: bool,
    /// On the way, neither waiting nor acting.
    pub(super) moving: bool,
}

/// What is to be kept of a run besides its figures: it takes memory with the length of the program, but for a picture.
#[derive(Clone, Debug, Default)]
pub(super) struct Wanted {
    /// Every cycle, as lines of set-points.
    pub(super) samples: bool,
    /// The programmed path, as lines.
    pub(super) path: bool,
    /// The feed of each line.
    pub(super) feeds: bool,
    pub(super) picture: bool,
    /// Which thread planned what, and when.
    pub(super) timeline: bool,
    /// What the operator does meanwhile.
    pub(super) script: Option<Script>,
}

/// A program, planned and run down.
pub(super) struct Work {
    pub(super) cycle_s: f64,
    /// Cycles of the whole program, and how many of them were run and judged.
    pub(super) cycles: u64,
    pub(super) cycles_judged: u64,
    pub(super) joints: Joints,
    /// Programmed moves.
    pub(super) blocks: usize,
    pub(super) deviation: Deviation,
    /// Greatest way of a tap behind its depth, mm.
    pub(super) over_run_mm: f64,
    pub(super) feed: FeedKept,
    pub(super) rests: Vec<Rests>,
    pub(super) times: TimeTable,
    /// Everything planned, by the cycle-independent clock of the plan, s; where the spindle leads a move, as it was run down.
    pub(super) motion_time_s: f64,
    /// From text to committed profile, s.
    pub(super) wall_time_s: f64,
    /// How much quicker than motion one thread plans it.
    pub(super) real_time: RealTimeFactor,
    /// That planned.
    pub(super) threads: usize,
    pub(super) lines: u32,
    /// Elements that went through the ring.
    pub(super) elements: usize,
    /// Greatest deviation that the program allows, mm; 0: none.
    pub(super) tolerance_mm: f64,
    /// Cycles in which the machine stood because nothing was planned yet.
    pub(super) starved_cycles: u64,
    /// Line of a move in step with the spindle that was given up, and why: nothing behind it was run down.
    pub(super) given_up: Option<(u32, SyncFault)>,
    pub(super) script: Option<ScriptReport>,
    /// What was wanted besides.
    pub(super) samples: Option<String>,
    pub(super) path: Option<String>,
    pub(super) feeds: HashMap<u32, f64>,
    pub(super) recording: Option<Recording>,
    pub(super) timeline: Option<Record>,
}

/// The ring. Where nobody turns overrides, what is in it stays as it is: what takes long need not be cut into parts.
struct Followed {
    ring: Producer<Element>,
    overridden: bool,
}

impl Sink<Element> for Followed {
    fn free(&self) -> usize {
        self.ring.free()
    }

    fn is_full(&self, count: usize) -> bool {
        self.ring.is_full(count)
    }

    fn ahead_s(&self) -> Option<f64> {
        self.ring.ahead_s()
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        self.ring.publish(committed, tail)
    }

    fn next_number(&self) -> u64 {
        if self.overridden { self.ring.next_number() } else { 0 }
    }

    fn consumer_at(&self) -> Option<u64> {
        self.ring.consumer_at().filter(|_| self.overridden)
    }

    fn published_s(&self) -> Option<f64> {
        self.ring.published_s().filter(|_| self.overridden)
    }

    fn publish_after(&mut self, number: u64, committed: &[Element], tail: &[Element]) -> Publish {
        if self.overridden {
            self.ring.publish_after(number, committed, tail)
        } else {
            Publish::Passed
        }
    }
}

/// Plans a whole program and runs it down; where set-points are wanted, every cycle of it.
///
/// # Errors
/// The first thing of the program that cannot be planned.
pub(super) fn run_down(
    config: &Config,
    tables: &Tables,
    (name, text): (&str, Reader<'_>),
    threads: Option<usize>,
    wanted: Wanted,
) -> Result<Work, FeedError> {
    let start = home(config);
    let threads = threads.or(config.program.threads);
    let threads = threads.unwrap_or_else(|| available_parallelism().map_or(1, NonZero::get));
    let timeline = wanted.timeline.then(Timeline::default);
    let (wall_time_s, motion_time_s, elements) = std::thread::scope(|scope| {
        let mut planning = Threads::new(threads, scope);
        if let Some(timeline) = &timeline {
            planning = planning.recorded(timeline.clone());
        }
        let began = Instant::now();
        let measure = Measure::new(thread_cpu_s);
        let mut feeder = Feeder::in_threads((config, tables), text, start, measure, planning).beside(name);
        whole(&mut feeder)?;
        let wall_time_s = began.elapsed().as_secs_f64();
        let measure = feeder.sink();
        Ok((wall_time_s, measure.time_s(), measure.elements()))
    })?;

    let (producer, consumer) = ring::channel(ring_capacity(config));
    let cycle_s = f64::from(config.cycle_us) * 1e-6;
    let planner = config.program.planner;
    let script = wanted.script.clone();
    let mut operator = script.map(|script| Operator::new(script, planner, cycle_s));
    let followed = Followed {
        ring: producer,
        overridden: operator.is_some(),
    };
    let passed = Arc::new(AtomicU64::new(0));
    // Alone, so that what it takes can be told from what others do meanwhile.
    let mut feeder = Feeder::new(config, tables, text, start, followed)
        .beside(name)
        .keeping_near(Arc::clone(&passed));
    let (mut pace, mut planning_s) = (Pace::new(0.0), 0.0);
    if let Some(operator) = &operator {
        feeder = feeder.following(operator.live());
    }
    let kinematics = config.kinematics();
    let mut interpolator = Interpolator::new(consumer, start, stop_ramp(config));
    let every_cycle = wanted.samples;
    let mut judge = Judge::new(config, tables, text, wanted);
    let mut spindle = IdealSpindle::new(judge.cycle_s, config.spindle.rpm_max);
    let mut sample = Sample::resting(start);
    judge.push(&sample, None, 0.0, Manner::PLAIN);
    let (mut done, mut in_a_row, mut starved_cycles, mut given_up) = (false, 0, 0, None);
    let mut feed_at = 0;
    loop {
        // The last elements may be in the ring, and an override changes them yet.
        let mut once = operator.is_some() && judge.number.is_multiple_of(LOOK_CYCLES) && !feeder.is_over();
        while (!done && judge.number >= feed_at) || once {
            once = false;
            let began_s = thread_cpu_s();
            let progress = feeder.pump()?;
            planning_s += thread_cpu_s() - began_s;
            let published_s = feeder.sink().ring.published_s().unwrap_or(0.0);
            pace.planned(published_s, feeder.line(), || planning_s);
            judge.deviation.allow(feeder.tolerance_mm());
            feeder.ideal_path().for_each(|part| judge.push_path(&part));
            passed.store(judge.deviation.passed(), Ordering::Relaxed);
            match progress {
                Progress::Working => {}
                Progress::RingFull => feed_at = judge.number + FULL_CYCLES,
                Progress::Waiting => break,
                Progress::Done => done = true,
            }
        }
        let mut wanted = Shares::FULL;
        let mut skip_max = u64::MAX;
        if let Some(operator) = &mut operator {
            operator.act(judge.number, &sample, &mut interpolator);
            spindle.set_override(operator.spindle(&sample));
            (wanted, skip_max) = (operator.shares(), operator.may_skip(judge.number));
            if !every_cycle && skip_max < u64::MAX && operator.is_still(judge.number as f64 * cycle_s) {
                operator.skip_rest(skip_max);
                judge.number += skip_max;
                in_a_row = 0;
                skip_max = 0;
            }
        }
        let shares = Shares {
            turning: spindle.feed_share(),
            ..wanted
        };
        in_a_row += 1;
        if !every_cycle && in_a_row > AT_PLACE && spindle.keeps(&sample) {
            let skipped = cycles_to_skip(&interpolator, &kinematics, judge.cycle_s).min(skip_max);
            if skipped > AT_PLACE {
                interpolator.skip(skipped);
                spindle.skip(skipped);
                judge.number += skipped;
                in_a_row = 0;
            }
        }
        judge.turning = shares.turning;
        sample = interpolator.step_shares(&shares, &spindle.place());
        spindle.step(&sample);
        if let Some(action) = sample.on_the_way {
            spindle.act(action, sample.position[Axis::X]);
        }
        if let Some(action) = sample.action
            && !wanted.hold(sample.enables)
            && spindle.act(action, sample.position[Axis::X])
        {
            interpolator.acknowledge_action();
        }
        let (manner, goes_on) = match &mut operator {
            Some(operator) => operator.see(judge.number, &sample, &interpolator),
            None => (Manner::PLAIN, true),
        };
        judge.push(&sample, interpolator.element(), interpolator.over_run_mm(), manner);
        if let Some(fault) = sample.fault {
            given_up = Some((sample.line, fault));
            break;
        }
        if !goes_on {
            break;
        }
        match sample.state {
            SampleState::Finished => break,
            SampleState::Starved if done && sample.action.is_none() && interpolator.remaining_s() == 0.0 => break,
            SampleState::Starved if sample.action.is_none() => starved_cycles += 1,
            SampleState::Moving | SampleState::Dwelling | SampleState::Acting | SampleState::Starved => {}
        }
    }
    let led = judge.led;
    let work = judge.finish();
    let motion_time_s = match led {
        true => work
            .times
            .tools
            .iter()
            .map(|of_tool| of_tool.times.time_s - of_tool.times.waiting_s)
            .sum(),
        false => motion_time_s,
    };
    let published_s = feeder.sink().ring.published_s().unwrap_or(0.0);
    Ok(Work {
        script: operator.map(|operator| operator.finish(work.cycles)),
        motion_time_s,
        wall_time_s,
        real_time: pace.finish(published_s, feeder.line(), planning_s),
        threads,
        timeline: timeline.map(|timeline| timeline.record()),
        lines: feeder.line(),
        elements,
        tolerance_mm: feeder.tolerance_mm(),
        starved_cycles,
        given_up,
        ..work
    })
}

/// How many cycles need not be run now.
fn cycles_to_skip(interpolator: &Interpolator, kinematics: &Kinematics, cycle_s: f64) -> u64 {
    let even = interpolator.even_cycles();
    let Some(element) = interpolator.element().filter(|element| element.duration_s() > LONG_S) else {
        return 0;
    };
    let cycles = (element.duration_s() / cycle_s) as u64;
    if even < AT_ENDS || cycles < even + AT_ENDS {
        return 0;
    }
    let turned_rad = match element {
        Element::Span(span) => {
            let part = (span.place(span.duration_s) - span.s0) / span.piece.length();
            part * turn_rad(&span.piece, kinematics)
        }
        Element::Probing(probing) => turn_rad(&probing.piece, kinematics),
        Element::Synced(_) | Element::Dwell { .. } | Element::Action { .. } => 0.0,
    };
    let places = PLACES + PLACES_PER_RAD * turned_rad;
    let step = (cycles as f64 / places) as u64;
    let skipped = step.min(even - AT_ENDS + AT_PLACE).saturating_sub(AT_PLACE);
    // For less it is not worth the gap.
    if skipped > AT_PLACE { skipped } else { 0 }
}

/// By how much a piece turns.
fn turn_rad(piece: &Piece, kinematics: &Kinematics) -> f64 {
    match piece.shape() {
        _ if !kinematics.is_linear(piece.frame()) => TURN_RAD,
        Shape::Line(_) => 0.0,
        Shape::Arc(arc) => arc.sweep_rad(),
        Shape::Blend(_) => TURN_RAD,
    }
}

/// Plans all of a program for a sink that never is full.
pub(super) fn whole<S: Sink<Element>>(feeder: &mut Feeder<'_, S>) -> Result<(), FeedError> {
    while feeder.pump()? != Progress::Done {
        feeder.ideal_path();
    }
    Ok(())
}

/// Judges a program cycle by cycle, in memory that does not grow with it.
pub(super) struct Judge {
    cycle_s: f64,
    /// Of the cycle that comes.
    number: u64,
    judged: u64,
    last: Option<Cycle>,
    joints: Joints,
    deviation: DeviationJudge,
    ahead: Ahead,
    feed: FeedWatch,
    rests: RestWatch,
    times: TimeWatch,
    /// Share of the planned feed that goes by the spindle.
    turning: f64,
    /// Whether the spindle has decided how long a move takes.
    led: bool,
    blocks: usize,
    over_run_mm: f64,
    /// Depth of the tap under way that its spindle has passed.
    depth: Option<Position>,
    before: Option<Position>,
    samples: Option<export::Samples>,
    path: Option<export::ProgrammedPath>,
    feeds: Option<HashMap<u32, f64>>,
    recording: Option<Recording>,
}

impl Judge {
    pub(super) fn new(config: &Config, tables: &Tables, text: Reader<'_>, wanted: Wanted) -> Judge {
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        Judge {
            cycle_s,
            number: 0,
            judged: 0,
            last: None,
            joints: Joints::new(config),
            deviation: DeviationJudge::default(),
            ahead: Ahead::default(),
            feed: FeedWatch::new(cycle_s),
            rests: RestWatch::default(),
            times: TimeWatch::new(text, tables, cycle_s),
            turning: 1.0,
            led: false,
            blocks: 0,
            over_run_mm: 0.0,
            depth: None,
            before: None,
            samples: wanted.samples.then(|| export::Samples::new(config)),
            path: wanted.path.then(export::ProgrammedPath::default),
            feeds: wanted.feeds.then(HashMap::new),
            recording: wanted.picture.then(|| Recording::new(config)),
        }
    }

    /// The programmed path goes on.
    fn push_path(&mut self, part: &Programmed) {
        self.blocks += 1;
        self.deviation.push_path(&part.piece);
        self.ahead.push_path(part);
        if let Some(path) = &mut self.path {
            path.push(part);
        }
        if let Some(feeds) = self.feeds.as_mut().filter(|_| !part.rapid) {
            let feed = feeds.entry(part.line).or_insert(part.feed);
            *feed = part.feed.max(*feed);
        }
    }

    /// The next cycle.
    pub(super) fn push(&mut self, sample: &Sample, element: Option<&Element>, over_run_mm: f64, manner: Manner) {
        let cycle = Cycle {
            number: self.number,
            position: sample.position,
            speed_mm_s: sample.velocity_mm_s,
            line: sample.line,
            rapid: sample.rapid,
            moving: sample.state == SampleState::Moving,
        };
        let follows = self.last.is_none_or(|last| last.number + 1 == cycle.number);
        self.number += 1;
        self.judged += 1;
        if manner.scaling {
            self.joints.scale();
        }
        self.joints
            .push(&sample.position, &sample.frame, (cycle.number, cycle.line), follows);
        let on = self.on(&cycle, sample, element, manner);
        self.feed.push(cycle, on, &self.joints);
        self.rests.push(sample);
        self.times.push(&cycle, sample, manner);
        self.over_run_mm = self.over_run_mm.max(over_run_mm);
        let programmed = self.programmed_position(&sample.position, over_run_mm);
        // What is run again was judged when it was run first: path and set-points are compared in their order.
        if !manner.again {
            self.deviation.push_sample(&programmed);
        }
        if let Some(samples) = &mut self.samples {
            samples.push(&cycle, self.cycle_s);
        }
        if let Some(recording) = &mut self.recording {
            recording.push(sample, &cycle, &self.joints);
        }
        self.last = Some(cycle);
    }

    /// What the machine is on.
    fn on(&mut self, cycle: &Cycle, sample: &Sample, element: Option<&Element>, manner: Manner) -> On {
        if !cycle.moving || manner.again {
            return On::default();
        }
        let times = &mut self.times;
        let Some(line) = self.ahead.reach(cycle.line, |line| times.leave(line)) else {
            return On::default();
        };
        let is_curve = matches!(element, Some(Element::Span(span)) if matches!(span.piece.shape(), Shape::Blend(_)));
        let by_turns = sample.enables.spindle_speed;
        let by_spindle = by_turns || matches!(element, Some(Element::Synced(_)));
        self.led |= by_spindle;
        // Feed by turns is planned for the greatest speed of the spindle.
        let feed = manner.feed * if by_turns { self.turning } else { 1.0 };
        On {
            feed: (line.feed.filter(|_| feed > 0.0 && !manner.scaling)).map(|programmed| programmed * feed),
            by_spindle,
            smoothed: is_curve && !line.is_curve,
            corner_degrees: self.ahead.corner_degrees(),
        }
    }

    /// Where the machine is as far as the program says: where a tap is behind its depth, at its depth.
    fn programmed_position(&mut self, position: &Position, over_run_mm: f64) -> Position {
        // A tap is straight: the depth lies back on the way of the first cycle behind it.
        self.depth = match (self.before, self.depth) {
            (_, _) if over_run_mm <= 0.0 => None,
            (Some(before), None) => Some(back_towards(position, &before, over_run_mm)),
            (_, depth) => depth,
        };
        let programmed = self.depth.unwrap_or(*position);
        self.before = Some(programmed);
        programmed
    }

    /// What was found; what only the caller knows is left open.
    pub(super) fn finish(mut self) -> Work {
        let cycles = self.number;
        let times = &mut self.times;
        self.ahead.finish(|line| times.leave(line));
        if let Some(last) = self.last {
            for behind in 0..ORDERS as u64 {
                let number = cycles + behind;
                self.joints.rest((number, last.line));
                let resting = Cycle {
                    number,
                    speed_mm_s: 0.0,
                    moving: false,
                    ..last
                };
                self.feed.push(resting, On::default(), &self.joints);
                if let Some(recording) = &mut self.recording {
                    recording.rest(number, &self.joints);
                }
            }
        }
        Work {
            cycle_s: self.cycle_s,
            cycles,
            cycles_judged: self.judged,
            feed: self.feed.finish(&self.joints),
            rests: self.rests.finish(),
            times: self.times.finish(),
            joints: self.joints,
            blocks: self.blocks,
            deviation: self.deviation.finish(),
            over_run_mm: self.over_run_mm,
            motion_time_s: 0.0,
            wall_time_s: 0.0,
            real_time: RealTimeFactor::default(),
            threads: 0,
            lines: 0,
            elements: 0,
            tolerance_mm: 0.0,
            starved_cycles: 0,
            given_up: None,
            script: None,
            samples: self.samples.map(export::Samples::finish),
            path: self.path.map(|path| path.text),
            feeds: self.feeds.unwrap_or_default(),
            recording: self.recording,
            timeline: None,
        }
    }
}

/// The place at a distance from `at` on the straight way to another one.
fn back_towards(at: &Position, to: &Position, distance_mm: f64) -> Position {
    let square = |(a, b): (&f64, &f64)| (a - b).powi(2);
    let length_mm = at.0.iter().zip(&to.0).map(square).sum::<f64>().sqrt();
    let share = if length_mm > 0.0 {
        (distance_mm / length_mm).min(1.0)
    } else {
        0.0
    };
    let mut place = *at;
    for (place, to) in place.0.iter_mut().zip(to.0) {
        *place += (to - *place) * share;
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Report;
    use motion::plan::PlannerKind;
    use std::path::Path;

    fn machine(planner: PlannerKind) -> Config {
        let text = include_str!("../../../configs/mill3-demo.toml");
        let mut config = config::parse(text, Path::new("demo.toml")).unwrap();
        config.program.planner = planner;
        config
    }

    fn run(config: &Config, text: &str, samples: bool) -> Work {
        let tables = Tables::read(config).unwrap();
        let wanted = Wanted {
            samples,
            ..Wanted::default()
        };
        run_down(config, &tables, ("part.ngc", text.as_bytes().into()), Some(1), wanted)
            .unwrap_or_else(|error| panic!("{error:?}"))
    }

    #[test]
    fn what_is_not_run_changes_nothing_of_what_is_found() {
        let text = "G21 G90 G64 P0.01\nG1 X30 F20\nY20\nG2 I10 F60\nG1 X60 F200\nG4 P7\nG38.3 X70 F60\nG0 X0\nM2\n";
        for planner in [PlannerKind::Optimal, PlannerKind::Classic] {
            let config = machine(planner);
            let [all, some] = [true, false].map(|every_cycle| run(&config, text, every_cycle));
            assert_eq!(all.cycles_judged, all.cycles);
            assert!(
                some.cycles_judged < all.cycles_judged * 3 / 4,
                "{planner:?}: {}",
                some.cycles_judged
            );
            // Long elements are cut otherwise where every cycle is run: by rounding.
            assert!(all.cycles.abs_diff(some.cycles) <= 2, "{planner:?}: {}", some.cycles);
            for (all, some) in all.joints.all.iter().zip(&some.joints.all) {
                let [all, some] = [all.peaks, some.peaks];
                assert_eq!((all.over, some.over), ([0; 3], [0; 3]));
                for (all, some) in all.greatest.iter().zip(some.greatest) {
                    assert!(
                        (all - some).abs() <= 1e-3 * all.abs() + 1e-2,
                        "{planner:?}: {all} {some}"
                    );
                }
            }
            for found in [all.deviation, some.deviation] {
                assert!(
                    found.off_mm <= 0.01 && found.missed_mm <= 0.0101,
                    "{planner:?}: {found:?}"
                );
                assert!(found.length_mm - found.reached_mm < 1e-3, "{planner:?}: {found:?}");
            }
            let lines = all.samples.expect("set-points").lines().count() as u64;
            assert_eq!(lines, 1 + all.cycles);
        }
    }

    #[test]
    fn where_the_spindle_leads_time_and_feed_are_those_that_it_gives() {
        let text = include_str!("../../../configs/lathe2-demo.toml");
        let config = config::parse(text, Path::new("lathe.toml")).unwrap();
        // At a radius of 60 mm (no offset) and 120 m/min the spindle makes 318.3 turns a minute, 40 mm of 0.2 mm a turn.
        let led = "G21 G90 G18 G53 G0 X60\nG96 S120 D2500 M3\nG95 F0.2\nG1 Z160\nM2\n";
        let before = run(&config, &led.replace("Z160", "Z200"), false);
        let after = run(&config, led, false);
        let minutes = 40.0 / (0.2 * 120.0e3 / (std::f64::consts::TAU * 60.0));
        let took_s = after.motion_time_s - before.motion_time_s;
        assert!((took_s / (60.0 * minutes) - 1.0).abs() < 0.01, "{took_s} {minutes}");
        assert!(after.feed.at_feed_share > 0.9, "{}", after.feed.at_feed_share);
        assert_eq!(after.feed.limited_by[0].what, "feed");
    }

    #[test]
    fn hours_of_motion_take_as_many_cycles_as_minutes() {
        let texts = [
            "G1 X21",
            "G64 P0.01\nG1 X20\nY20\nX0",
            "G1 X20\nG2 I10",
            "G38.3 X30",
            "G1 X1\nG4 P100000\nG1 X0",
        ];
        for planner in [PlannerKind::Optimal, PlannerKind::Classic] {
            let config = machine(planner);
            for text in texts {
                let [minutes, days] = [10.0, 0.005].map(|feed| {
                    let work = run(&config, &format!("G21 G90\nG0 X0 Y0 Z0\nF{feed}\n{text}\nM2\n"), false);
                    println!(
                        "{text} F{feed} {planner:?}: {} of {} cycles",
                        work.cycles_judged, work.cycles
                    );
                    work
                });
                assert!(days.cycles > 100_000_000, "{text} {planner:?}");
                let most = 2 * minutes.cycles_judged.max(60_000);
                assert!(
                    days.cycles_judged < most,
                    "{text} {planner:?}: {} {most}",
                    days.cycles_judged
                );
            }
        }
    }

    #[test]
    fn a_limit_that_is_not_kept_is_told_with_its_line_and_a_rapid_before_a_probing_move_keeps_it() {
        let text = "G21 G90\nG0 X10 Y10\nG38.3 X30 F100\nG0 X10\nG38.3 X-2\nG61\nG0 Z5\nG38.3 Z-3\nM2\n";
        for planner in [PlannerKind::Optimal, PlannerKind::Classic] {
            let config = machine(planner);
            assert_eq!(Report::new(&config, &run(&config, text, false)).wrong(), []);
            // A jump in the fourth line.
            let mut judge = Judge::new(&config, &Tables::read(&config).unwrap(), text.into(), Wanted::default());
            for cycle in 0..1000 {
                let mut sample = Sample::resting(Position::ZERO);
                (sample.line, sample.position[Axis::X]) = (cycle / 200, if cycle == 900 { 1e-3 } else { 0.0 });
                judge.push(&sample, None, 0.0, Manner::PLAIN);
            }
            let wrong = Report::new(&config, &judge.finish()).wrong();
            let told = |what: &str| wrong.iter().any(|(line, text)| *line == 4 && text.contains(what));
            assert!(told("joint 0 (X) passes its jerk limit: "), "{wrong:?}");
            assert!(told("of 30000.0, ") && told(" s after the start; "), "{wrong:?}");
        }
    }
}
