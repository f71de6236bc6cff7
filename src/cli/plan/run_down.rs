//! A program through the planner: once against the clock, once through ring and interpolation.
//!
//! An element that takes long is not run in every one of its cycles, of which there may be millions that differ in nothing: its
//! beginning, its end and many places between them are. What was run is counted, and nothing else is judged.

use super::ideal_spindle::IdealSpindle;
use super::joints::Joints;
use crate::config::Config;
use crate::machine::motion_settings::{ring_capacity, stop_ramp};
use crate::machine::tables::Tables;
use crate::program::{FeedError, Feeder, Progress, home};
use motion::canon::{Axis, Position};
use motion::element::{Action, Element};
use motion::kinematics::Kinematics;
use motion::path::{Piece, Shape};
use motion::plan::Programmed;
use motion::plan::workers::Workers;
use motion::ring::{self, Producer, Publish, Sink, Timed};
use motion::rt::{Interpolator, Sample, SampleState, Shares, SyncFault};
use std::num::NonZero;
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
    /// How far a tap is behind its depth, mm; else 0.
    pub(super) over_run_mm: f64,
}

/// Something that happens at rest.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    pub(super) cycle: u64,
    pub(super) what: Event,
}

/// What happens there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Event {
    Dwell,
    /// To this tool.
    ToolChange(u32),
    /// M0, M1.
    Stop,
}

/// A program, planned and run down.
pub(super) struct Work {
    pub(super) cycle_s: f64,
    /// Those that were run; the first stands at the start.
    pub(super) cycles: Vec<Cycle>,
    pub(super) joints: Joints,
    /// What the program asks for.
    pub(super) path: Vec<Programmed>,
    pub(super) marks: Vec<Mark>,
    /// Everything planned, by the cycle-independent clock of the plan, s.
    pub(super) motion_time_s: f64,
    /// From text to committed profile, s.
    pub(super) wall_time_s: f64,
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
    dwelling: bool,
    /// Of the cycle that comes.
    number: u64,
}

/// The ring, for a planner that follows nobody: no override changes what is in it, so that what takes long stays whole.
struct Followed(Producer<Element>);

impl Sink<Element> for Followed {
    fn free(&self) -> usize {
        self.0.free()
    }

    fn is_full(&self, count: usize) -> bool {
        self.0.is_full(count)
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        self.0.publish(committed, tail)
    }
}

/// Takes a plan for its size and its duration only.
#[derive(Default)]
struct Measure {
    elements: usize,
    time_s: f64,
    tail_s: f64,
}

impl Sink<Element> for Measure {
    fn free(&self) -> usize {
        usize::MAX / 2
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        self.elements += committed.len();
        self.time_s += committed.iter().map(Timed::duration_s).sum::<f64>();
        self.tail_s = tail.iter().map(Timed::duration_s).sum();
        Publish::Done
    }
}

/// Plans a whole program and runs it down; on demand every cycle of it.
///
/// # Errors
/// The first thing of the program that cannot be planned.
pub(super) fn run_down(
    config: &Config,
    tables: &Tables,
    (name, text): (&str, &[u8]),
    threads: Option<usize>,
    every_cycle: bool,
) -> Result<Work, FeedError> {
    let start = home(config);
    let threads = threads.unwrap_or_else(|| available_parallelism().map_or(1, NonZero::get));
    let workers = Workers::new(threads - 1, || ());
    let began = Instant::now();
    let mut feeder = Feeder::with_workers(config, tables, text, start, Measure::default(), &workers).beside(name);
    whole(&mut feeder)?;
    let wall_time_s = began.elapsed().as_secs_f64();
    let measure = feeder.sink();
    let (motion_time_s, elements) = (measure.time_s + measure.tail_s, measure.elements);

    let (producer, consumer) = ring::channel(ring_capacity(config));
    let mut feeder = Feeder::with_workers(config, tables, text, start, Followed(producer), &workers).beside(name);
    let kinematics = config.kinematics();
    let mut interpolator = Interpolator::new(consumer, start, stop_ramp(config));
    let mut work = Work {
        cycle_s: f64::from(config.cycle_us) * 1e-6,
        cycles: Vec::new(),
        joints: Joints::new(config),
        path: Vec::new(),
        marks: Vec::new(),
        motion_time_s,
        wall_time_s,
        threads,
        lines: 0,
        elements,
        tolerance_mm: 0.0,
        starved_cycles: 0,
        given_up: None,
        dwelling: false,
        number: 0,
    };
    let mut spindle = IdealSpindle::new(work.cycle_s, config.spindle.rpm_max);
    let mut sample = Sample::resting(start);
    work.push(&sample, 0.0);
    let (mut done, mut in_a_row) = (false, 0);
    loop {
        while !done {
            let progress = feeder.pump()?;
            work.path.extend(feeder.ideal_path());
            match progress {
                Progress::Working => {}
                Progress::RingFull | Progress::Probing => break,
                Progress::Done => done = true,
            }
        }
        let shares = Shares {
            turning: spindle.feed_share(),
            ..Shares::FULL
        };
        in_a_row += 1;
        if !every_cycle && in_a_row > AT_PLACE && spindle.keeps(&sample) {
            let skipped = cycles_to_skip(&interpolator, &kinematics, work.cycle_s);
            if skipped > 0 {
                interpolator.skip(skipped);
                spindle.skip(skipped);
                work.number += skipped;
                in_a_row = 0;
            }
        }
        sample = interpolator.step_shares(&shares, &spindle.place());
        spindle.step(&sample);
        if let Some(action) = sample.action
            && spindle.act(action, sample.position[Axis::X])
        {
            interpolator.acknowledge_action();
        }
        work.push(&sample, interpolator.over_run_mm());
        if let Some(fault) = sample.fault {
            work.given_up = Some((sample.line, fault));
            break;
        }
        match sample.state {
            SampleState::Finished => break,
            SampleState::Starved if done && sample.action.is_none() && interpolator.remaining_s() == 0.0 => break,
            SampleState::Starved if sample.action.is_none() => work.starved_cycles += 1,
            SampleState::Moving | SampleState::Dwelling | SampleState::Acting | SampleState::Starved => {}
        }
    }
    work.lines = feeder.line();
    work.tolerance_mm = feeder.tolerance_mm();
    Ok(work)
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

impl Work {
    /// Where the machine is in each cycle as far as the program says: where a tap is behind its depth, at its depth.
    pub(super) fn programmed_positions(&self) -> Vec<Position> {
        let mut positions: Vec<Position> = Vec::with_capacity(self.cycles.len());
        let mut depth = None;
        for cycle in &self.cycles {
            let over_mm = cycle.over_run_mm;
            // A tap is straight: the depth lies back on the way of the first cycle behind it.
            depth = match (positions.last(), depth) {
                (_, _) if over_mm <= 0.0 => None,
                (Some(before), None) => Some(back_towards(&cycle.position, before, over_mm)),
                (_, depth) => depth,
            };
            positions.push(depth.unwrap_or(cycle.position));
        }
        positions
    }

    /// Cycles of the whole program, run or not.
    pub(super) fn cycle_count(&self) -> u64 {
        self.number
    }

    fn push(&mut self, sample: &Sample, over_run_mm: f64) {
        let cycle = self.number;
        let follows = self.cycles.last().is_none_or(|last| last.number + 1 == cycle);
        self.number += 1;
        let what = match (sample.state, sample.action) {
            (_, Some(Action::ChangeTool { tool })) => Some(Event::ToolChange(tool)),
            (_, Some(Action::ProgramStop | Action::OptionalStop)) => Some(Event::Stop),
            (SampleState::Dwelling, _) => Some(Event::Dwell),
            (_, _) => None,
        };
        // A wait is marked where it begins.
        let goes_on = what == Some(Event::Dwell) && self.dwelling;
        self.dwelling = what == Some(Event::Dwell);
        if let Some(what) = what.filter(|_| !goes_on) {
            self.marks.push(Mark { cycle, what });
        }
        self.joints.push(&sample.position, &sample.frame, follows);
        self.cycles.push(Cycle {
            number: cycle,
            position: sample.position,
            speed_mm_s: sample.velocity_mm_s,
            line: sample.line,
            rapid: sample.rapid,
            moving: sample.state == SampleState::Moving,
            over_run_mm,
        });
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
    use crate::cli::plan::report::Report;
    use crate::config;
    use motion::plan::{PlannerKind, deviation};
    use std::path::Path;

    fn machine(planner: PlannerKind) -> Config {
        let text = include_str!("../../../configs/mill3-demo.toml");
        let mut config = config::parse(text, Path::new("demo.toml")).unwrap();
        config.program.planner = planner;
        config
    }

    fn run(config: &Config, text: &str, every_cycle: bool) -> Work {
        let tables = Tables::read(config).unwrap();
        run_down(config, &tables, ("part.ngc", text.as_bytes()), Some(1), every_cycle)
            .unwrap_or_else(|error| panic!("{error:?}"))
    }

    #[test]
    fn what_is_not_run_changes_nothing_of_what_is_found() {
        let text = "G21 G90 G64 P0.01\nG1 X30 F20\nY20\nG2 I10 F60\nG1 X60 F200\nG4 P7\nG38.3 X70 F60\nG0 X0\nM2\n";
        for planner in [PlannerKind::Optimal, PlannerKind::Classic] {
            let config = machine(planner);
            let [all, some] = [true, false].map(|every_cycle| run(&config, text, every_cycle));
            assert_eq!(all.cycles.len() as u64, all.cycle_count());
            assert!(
                some.cycles.len() < all.cycles.len() * 3 / 4,
                "{planner:?}: {}",
                some.cycles.len()
            );
            // Long elements are cut otherwise where every cycle is run: by rounding.
            assert!(
                all.cycle_count().abs_diff(some.cycle_count()) <= 2,
                "{planner:?}: {}",
                some.cycle_count()
            );
            for (all, some) in all.joints.all.iter().zip(&some.joints.all) {
                let [all, some] = [all.peaks(), some.peaks()];
                assert_eq!((all.over, some.over), ([0; 3], [0; 3]));
                for (all, some) in all.greatest.iter().zip(some.greatest) {
                    assert!(
                        (all - some).abs() <= 1e-3 * all.abs() + 1e-2,
                        "{planner:?}: {all} {some}"
                    );
                }
            }
            let found = deviation(&some.programmed_positions(), &some.path, some.tolerance_mm);
            assert!(
                found.off_mm <= 0.01 && found.missed_mm <= 0.0101,
                "{planner:?}: {found:?}"
            );
            assert!(found.length_mm - found.reached_mm < 1e-3, "{planner:?}: {found:?}");
        }
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
                        work.cycles.len(),
                        work.cycle_count()
                    );
                    work
                });
                assert!(days.cycle_count() > 100_000_000, "{text} {planner:?}");
                let most = 2 * minutes.cycles.len().max(60_000);
                assert!(
                    days.cycles.len() < most,
                    "{text} {planner:?}: {} {most}",
                    days.cycles.len()
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
            let place = work.cycles.iter().position(|cycle| cycle.line == 4).unwrap() + 5;
            work.joints.all[0].positions[place] += 1e-3;
            let wrong = Report::new(&config, &work).wrong();
            let told = |what: &str| wrong.iter().any(|(line, text)| *line == 4 && text.contains(what));
            assert!(told("joint 0 (X) passes its jerk limit: "), "{wrong:?}");
            assert!(told("of 30000.0, ") && told(" s after the start; "), "{wrong:?}");
        }
    }
}
