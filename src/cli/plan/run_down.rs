//! A program through the planner: once against the clock, once through ring and interpolation.

use super::ideal_spindle::IdealSpindle;
use super::joints::Joints;
use crate::config::Config;
use crate::machine::tables::Tables;
use crate::program::{FeedError, Feeder, Progress, home, ring_capacity, stop_ramp};
use motion::canon::{Axis, Position};
use motion::element::{Action, Element};
use motion::plan::Programmed;
use motion::plan::workers::Workers;
use motion::ring::{self, Publish, Sink, Timed};
use motion::rt::{Interpolator, Sample, SampleState, Shares, SyncFault};
use std::num::NonZero;
use std::thread::available_parallelism;
use std::time::Instant;

/// What there is to know of one cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cycle {
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
    pub(super) cycle: usize,
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
    /// The first stands at the start.
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

/// Plans a whole program and runs it down.
///
/// # Errors
/// The first thing of the program that cannot be planned.
pub(super) fn run_down(
    config: &Config,
    tables: &Tables,
    text: &[u8],
    threads: Option<usize>,
) -> Result<Work, FeedError> {
    let start = home(config);
    let threads = threads.unwrap_or_else(|| available_parallelism().map_or(1, NonZero::get));
    let workers = Workers::new(threads - 1, || ());
    let began = Instant::now();
    let mut feeder = Feeder::with_workers(config, tables, text, start, Measure::default(), &workers);
    whole(&mut feeder)?;
    let wall_time_s = began.elapsed().as_secs_f64();
    let measure = feeder.sink();
    let (motion_time_s, elements) = (measure.time_s + measure.tail_s, measure.elements);

    let (producer, consumer) = ring::channel(ring_capacity(config));
    let mut feeder = Feeder::with_workers(config, tables, text, start, producer, &workers);
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
    };
    let mut spindle = IdealSpindle::new(work.cycle_s, config.spindle.rpm_max);
    work.push(&Sample::resting(start), 0.0);
    let mut done = false;
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
        let sample = interpolator.step_shares(&shares, &spindle.place());
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

    fn push(&mut self, sample: &Sample, over_run_mm: f64) {
        let cycle = self.cycles.len();
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
        self.joints.push(&sample.position, &sample.frame);
        self.cycles.push(Cycle {
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
