//! A program through the planner: once against the clock, once through ring and interpolation.
//!
//! An element that takes long is not run in every one of its cycles, of which there may be millions that differ in nothing: its
//! beginning, its end and many places between them are. What was run is counted, and nothing else is judged.

use super::ideal_spindle::IdealSpindle;
use super::judge::{Judge, Judged};
use super::script::{Manner, Operator, Script, ScriptReport};
use config::Config;
use host::wait::thread_cpu_s;
use machine::motion_settings::{ring_capacity, stop_ramp};
use machine::tables::Tables;
use motion::canon::Axis;
use motion::element::Element;
use motion::kinematics::Kinematics;
use motion::path::{Piece, Shape};
use motion::plan::timeline::{Record, Timeline};
use motion::ring::{self, Producer, Publish, Sink, Timed as _};
use motion::rt::{Interpolator, Sample, SampleState, Shares, SyncFault};
use program::real_time::{Measure, Pace, RealTimeFactor};
use program::text::Reader;
use program::{FeedError, Feeder, Progress, Threads, home};
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
    pub(super) planned: Planned,
    pub(super) judged: Judged,
    /// Everything planned, by the cycle-independent clock of the plan, s; where the spindle leads a move, as it was run down.
    pub(super) motion_time_s: f64,
    /// How much quicker than motion one thread plans it.
    pub(super) real_time: RealTimeFactor,
    pub(super) lines: u32,
    /// Greatest deviation that the program allows, mm; 0: none.
    pub(super) tolerance_mm: f64,
    /// Cycles in which the machine stood because nothing was planned yet.
    pub(super) starved_cycles: u64,
    /// Line of a move in step with the spindle that was given up, and why: nothing behind it was run down.
    pub(super) given_up: Option<(u32, SyncFault)>,
    pub(super) script: Option<ScriptReport>,
    pub(super) timeline: Option<Record>,
}

/// A program, planned against the clock.
pub(super) struct Planned {
    /// From text to committed profile, s.
    pub(super) wall_time_s: f64,
    /// Of all that was planned, s.
    motion_time_s: f64,
    /// Elements that went through the ring.
    pub(super) elements: usize,
    /// That planned.
    pub(super) threads: usize,
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
    let threads = threads.or(config.program.threads);
    let threads = threads.unwrap_or_else(|| available_parallelism().map_or(1, NonZero::get));
    let timeline = wanted.timeline.then(Timeline::default);
    let planned = plan(config, tables, (name, text), threads, timeline.as_ref())?;
    let mut run = Run::new(config, tables, (name, text), wanted);
    run.run_to_end()?;
    Ok(run.finish(planned, timeline))
}

/// Plans a whole program in as many threads as on the machine, against the clock.
fn plan(
    config: &Config,
    tables: &Tables,
    (name, text): (&str, Reader<'_>),
    threads: usize,
    timeline: Option<&Timeline>,
) -> Result<Planned, FeedError> {
    std::thread::scope(|scope| {
        let mut planning = Threads::new(threads, scope);
        if let Some(timeline) = timeline {
            planning = planning.recorded(timeline.clone());
        }
        let began = Instant::now();
        let measure = Measure::new(thread_cpu_s);
        let mut feeder = Feeder::in_threads((config, tables), text, home(config), measure, planning).beside(name);
        whole(&mut feeder)?;
        let wall_time_s = began.elapsed().as_secs_f64();
        let measure = feeder.sink();
        Ok(Planned {
            wall_time_s,
            motion_time_s: measure.time_s(),
            elements: measure.elements(),
            threads,
        })
    })
}

/// A program on its way through ring and interpolation.
struct Run<'a> {
    feeder: Feeder<'a, Followed>,
    /// Whether all of it is planned.
    is_planned: bool,
    /// The cycle in which the planner goes on.
    plan_at: u64,
    /// Of the path, for the planner.
    passed: Arc<AtomicU64>,
    pace: Pace,
    planning_s: f64,
    operator: Option<Operator>,
    kinematics: Kinematics,
    interpolator: Interpolator,
    spindle: IdealSpindle,
    judge: Judge,
    /// Whether every cycle is run; else how many were run since the last gap.
    every_cycle: bool,
    in_a_row: u64,
    sample: Sample,
    starved_cycles: u64,
    given_up: Option<(u32, SyncFault)>,
}

impl<'a> Run<'a> {
    fn new(config: &'a Config, tables: &'a Tables, (name, text): (&'a str, Reader<'a>), wanted: Wanted) -> Run<'a> {
        let start = home(config);
        let (producer, consumer) = ring::channel(ring_capacity(config));
        let script = wanted.script.clone();
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        let operator = script.map(|script| Operator::new(script, config.program.planner, cycle_s));
        let followed = Followed {
            ring: producer,
            overridden: operator.is_some(),
        };
        let passed = Arc::new(AtomicU64::new(0));
        // Alone, so that what it takes can be told from what others do meanwhile.
        let mut feeder = Feeder::new(config, tables, text, start, followed)
            .beside(name)
            .keeping_near(Arc::clone(&passed));
        if let Some(operator) = &operator {
            feeder = feeder.following(operator.live());
        }
        let every_cycle = wanted.samples;
        let mut judge = Judge::new(config, tables, text, wanted);
        let sample = Sample::resting(start);
        judge.push(&sample, None, 0.0, Manner::PLAIN);
        Run {
            feeder,
            is_planned: false,
            plan_at: 0,
            passed,
            pace: Pace::new(0.0),
            planning_s: 0.0,
            operator,
            kinematics: config.kinematics(),
            interpolator: Interpolator::new(consumer, start, stop_ramp(config)),
            spindle: IdealSpindle::new(cycle_s, config.spindle.rpm_max),
            judge,
            every_cycle,
            in_a_row: 0,
            sample,
            starved_cycles: 0,
            given_up: None,
        }
    }

    fn run_to_end(&mut self) -> Result<(), FeedError> {
        loop {
            self.plan_on()?;
            let (wanted, skip_max) = self.ask_operator();
            let turning = self.spindle.feed_share();
            self.skip_even(skip_max);
            if !self.step(&wanted, turning) {
                return Ok(());
            }
        }
    }

    /// Plans as much as there is room for, if it is time to.
    fn plan_on(&mut self) -> Result<(), FeedError> {
        // The last elements may be in the ring, and an override changes them yet.
        let looks = self.operator.is_some() && self.judge.number.is_multiple_of(LOOK_CYCLES);
        let mut once = looks && !self.feeder.is_over();
        while (!self.is_planned && self.judge.number >= self.plan_at) || once {
            once = false;
            let began_s = thread_cpu_s();
            let progress = self.feeder.pump()?;
            self.planning_s += thread_cpu_s() - began_s;
            let planning_s = self.planning_s;
            let published_s = self.feeder.sink().ring.published_s().unwrap_or(0.0);
            self.pace.planned(published_s, self.feeder.line(), || planning_s);
            self.judge.deviation.allow(self.feeder.tolerance_mm());
            self.feeder.ideal_path().for_each(|part| self.judge.push_path(&part));
            self.passed.store(self.judge.deviation.passed(), Ordering::Relaxed);
            match progress {
                Progress::Working => {}
                Progress::RingFull => self.plan_at = self.judge.number + FULL_CYCLES,
                Progress::Waiting => break,
                Progress::Done => self.is_planned = true,
            }
        }
        Ok(())
    }

    /// The shares that the operator wants, and how many cycles may be skipped before his next order.
    fn ask_operator(&mut self) -> (Shares, u64) {
        let Some(operator) = &mut self.operator else {
            return (Shares::FULL, u64::MAX);
        };
        let number = self.judge.number;
        operator.act(number, &self.sample, &mut self.interpolator);
        self.spindle.set_override(operator.spindle(&self.sample));
        let (wanted, skip_max) = (operator.shares(), operator.may_skip(number));
        let is_still = operator.is_still(number as f64 * self.judge.cycle_s);
        if self.every_cycle || skip_max == u64::MAX || !is_still {
            return (wanted, skip_max);
        }
        // Nothing moves until then.
        operator.skip_rest(skip_max);
        self.judge.number += skip_max;
        self.in_a_row = 0;
        (wanted, 0)
    }

    /// Skips cycles of a long element that differ in nothing.
    fn skip_even(&mut self, skip_max: u64) {
        self.in_a_row += 1;
        if self.every_cycle || self.in_a_row <= AT_PLACE || !self.spindle.keeps(&self.sample) {
            return;
        }
        let skipped = cycles_to_skip(&self.interpolator, &self.kinematics, self.judge.cycle_s).min(skip_max);
        if skipped > AT_PLACE {
            self.interpolator.skip(skipped);
            self.spindle.skip(skipped);
            self.judge.number += skipped;
            self.in_a_row = 0;
        }
    }

    /// Runs a cycle and judges it; whether others follow. `turning`: the share of the planned feed that goes by the spindle.
    fn step(&mut self, wanted: &Shares, turning: f64) -> bool {
        self.judge.turning = turning;
        let shares = Shares { turning, ..*wanted };
        let sample = self.interpolator.step_shares(&shares, &self.spindle.place());
        self.sample = sample;
        self.spindle.step(&sample);
        if let Some(action) = sample.on_the_way {
            self.spindle.act(action, sample.position[Axis::X]);
        }
        if let Some(action) = sample.action
            && !wanted.hold(sample.enables)
            && self.spindle.act(action, sample.position[Axis::X])
        {
            self.interpolator.acknowledge_action();
        }
        let (manner, goes_on) = match &mut self.operator {
            Some(operator) => operator.see(self.judge.number, &sample, &self.interpolator),
            None => (Manner::PLAIN, true),
        };
        let (element, over_run_mm) = (self.interpolator.element(), self.interpolator.over_run_mm());
        self.judge.push(&sample, element, over_run_mm, manner);
        if let Some(fault) = sample.fault {
            self.given_up = Some((sample.line, fault));
            return false;
        }
        match sample.state {
            _ if !goes_on => false,
            SampleState::Finished => false,
            SampleState::Starved if sample.action.is_none() => {
                let is_over = self.is_planned && self.interpolator.remaining_s() == 0.0;
                self.starved_cycles += u64::from(!is_over);
                !is_over
            }
            SampleState::Moving | SampleState::Dwelling | SampleState::Acting | SampleState::Starved => true,
        }
    }

    fn finish(mut self, planned: Planned, timeline: Option<Timeline>) -> Work {
        let led = self.judge.led;
        let judged = self.judge.finish();
        let motion_time_s = match led {
            true => {
                let of_tools = judged.times.tools.iter().map(|of_tool| &of_tool.times);
                of_tools.map(|times| times.time_s - times.waiting_s).sum()
            }
            false => planned.motion_time_s,
        };
        let published_s = self.feeder.sink().ring.published_s().unwrap_or(0.0);
        Work {
            script: self.operator.map(|operator| operator.finish(judged.cycles)),
            motion_time_s,
            real_time: self.pace.finish(published_s, self.feeder.line(), self.planning_s),
            timeline: timeline.map(|timeline| timeline.record()),
            lines: self.feeder.line(),
            tolerance_mm: self.feeder.tolerance_mm(),
            starved_cycles: self.starved_cycles,
            given_up: self.given_up,
            planned,
            judged,
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Report;
    use motion::canon::Position;
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
            assert_eq!(all.judged.cycles_judged, all.judged.cycles);
            assert!(
                some.judged.cycles_judged < all.judged.cycles_judged * 3 / 4,
                "{planner:?}: {}",
                some.judged.cycles_judged
            );
            // Long elements are cut otherwise where every cycle is run: by rounding.
            assert!(
                all.judged.cycles.abs_diff(some.judged.cycles) <= 2,
                "{planner:?}: {}",
                some.judged.cycles
            );
            for (all, some) in all.judged.joints.all.iter().zip(&some.judged.joints.all) {
                let [all, some] = [all.peaks, some.peaks];
                assert_eq!((all.over, some.over), ([0; 3], [0; 3]));
                for (all, some) in all.greatest.iter().zip(some.greatest) {
                    assert!(
                        (all - some).abs() <= 1e-3 * all.abs() + 1e-2,
                        "{planner:?}: {all} {some}"
                    );
                }
            }
            for found in [all.judged.deviation, some.judged.deviation] {
                assert!(
                    found.off_mm <= 0.01 && found.missed_mm <= 0.0101,
                    "{planner:?}: {found:?}"
                );
                assert!(found.length_mm - found.reached_mm < 1e-3, "{planner:?}: {found:?}");
            }
            let lines = all.judged.samples.expect("set-points").lines().count() as u64;
            assert_eq!(lines, 1 + all.judged.cycles);
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
        assert!(
            after.judged.feed.at_feed_share > 0.9,
            "{}",
            after.judged.feed.at_feed_share
        );
        assert_eq!(after.judged.feed.limited_by[0].what, "feed");
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
                        work.judged.cycles_judged, work.judged.cycles
                    );
                    work
                });
                assert!(days.judged.cycles > 100_000_000, "{text} {planner:?}");
                let most = 2 * minutes.judged.cycles_judged.max(60_000);
                assert!(
                    days.judged.cycles_judged < most,
                    "{text} {planner:?}: {} {most}",
                    days.judged.cycles_judged
                );
            }
        }
    }

    #[test]
    fn a_limit_that_is_not_kept_is_told_with_its_line_and_a_rapid_before_a_probing_move_keeps_it() {
        let text = "G21 G90\nG0 X10 Y10\nG38.3 X30 F100\nG0 X10\nG38.3 X-2\nG61\nG0 Z5\nG38.3 Z-3\nM2\n";
        for planner in [PlannerKind::Optimal, PlannerKind::Classic] {
            let config = machine(planner);
            let mut work = run(&config, text, false);
            assert_eq!(Report::new(&config, &work).wrong(), []);
            // A jump in the fourth line.
            let mut judge = Judge::new(&config, &Tables::read(&config).unwrap(), text.into(), Wanted::default());
            for cycle in 0..1000 {
                let mut sample = Sample::resting(Position::ZERO);
                (sample.line, sample.position[Axis::X]) = (cycle / 200, if cycle == 900 { 1e-3 } else { 0.0 });
                judge.push(&sample, None, 0.0, Manner::PLAIN);
            }
            work.judged = judge.finish();
            let wrong = Report::new(&config, &work).wrong();
            let told = |what: &str| wrong.iter().any(|(line, text)| *line == 4 && text.contains(what));
            assert!(told("joint 0 (X) passes its jerk limit: "), "{wrong:?}");
            assert!(told("of 30000.0, ") && told(" s after the start; "), "{wrong:?}");
        }
    }
}
