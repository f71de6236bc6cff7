//! A program that is run down, judged cycle by cycle.
//!
//! In:  samples of the interpolation, the programmed path.
//! Out: limits of the joints, deviation from the path, feed, rests, times; what was wanted besides, as set-points and a recording.

use super::ahead::Ahead;
use super::export;
use super::joints::{Joints, ORDERS};
use super::picture::recording::Recording;
use super::rests::{RestWatch, Rests};
use super::run_down::Wanted;
use super::script::Manner;
use super::slow_places::{FeedKept, FeedWatch, On};
use super::times::{TimeTable, TimeWatch};
use config::Config;
use machine::tables::Tables;
use motion::canon::Position;
use motion::element::Element;
use motion::path::Shape;
use motion::plan::Programmed;
use motion::plan::deviation::{Deviation, DeviationJudge};
use motion::rt::{Sample, SampleState};
use program::text::Reader;
use std::collections::HashMap;

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

/// What was found of a program, cycle by cycle.
pub(super) struct Judged {
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
    /// What was wanted besides.
    pub(super) samples: Option<String>,
    pub(super) path: Option<String>,
    pub(super) feeds: HashMap<u32, f64>,
    pub(super) recording: Option<Recording>,
}

/// Judges a program cycle by cycle, in memory that does not grow with it.
pub(super) struct Judge {
    pub(super) cycle_s: f64,
    /// Of the cycle that comes.
    pub(super) number: u64,
    judged: u64,
    last: Option<Cycle>,
    joints: Joints,
    pub(super) deviation: DeviationJudge,
    ahead: Ahead,
    feed: FeedWatch,
    rests: RestWatch,
    times: TimeWatch,
    /// Share of the planned feed that goes by the spindle.
    pub(super) turning: f64,
    /// Whether the spindle has decided how long a move takes.
    pub(super) led: bool,
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
    pub(super) fn push_path(&mut self, part: &Programmed) {
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

    /// What was found.
    pub(super) fn finish(mut self) -> Judged {
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
        Judged {
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
            samples: self.samples.map(export::Samples::finish),
            path: self.path.map(|path| path.text),
            feeds: self.feeds.unwrap_or_default(),
            recording: self.recording,
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
