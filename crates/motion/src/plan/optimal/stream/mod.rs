//! The optimal planner as a whole, and what is handed over when.
//!
//! In:  stretches and halts, one after the other.
//! Out: publications to a ring.
//!
//! A publication ends at a border between windows, where the solution around the border shows how to stop, or at rest.
//!
//! ```text
//! section      parts -> spans between knots -> windows, as jobs
//! phases       what needs no knots: straight sections
//! answers      solved windows -> elements; what to do where there is no way
//! jobs         windows and borders that are being solved
//! publication  what is handed over when
//! changes      what takes its place when an override changes
//! ```

mod answers;
mod changes;
mod jobs;
mod phases;
mod publication;
mod section;

use std::collections::VecDeque;

use super::joints::Joints;
use super::knots::{Knots, Knotted, TakenOver, step_s};
use super::sections::{Item, Kept, Log, Part, Place, Sections};
use super::slopes::Made;
use super::solver::{JointJet, Knotting, Launch, State};
use super::windows::{States, Times, Uncut, WINDOW_SPANS, Window};
use crate::element::Element;
use crate::plan::gate::Gate;
use crate::plan::junctions::{Meeting, meeting};
use crate::plan::smooth::{Passed, Stretch};
use crate::plan::workers::Workers;
use crate::plan::{Pumped, Settings};
use crate::ring::{Publish, Sink};
use changes::Changes;
pub(in crate::plan) use changes::Override;
use jobs::{Asked, Jobs};

/// Elements of a publication beyond those of its windows: what lies between sections.
const PUBLICATION: usize = 1024;
/// Parts that are planned without the solver, from rest to rest, where it found no way; then it is tried again.
const CAREFUL_PARTS: usize = 8;
/// Elements ahead of the machine from which on nothing is handed over: a window. More would only take memory.
const AHEAD: u64 = WINDOW_SPANS as u64;
/// Room that is kept in the ring for motion in place of motion that is in it already.
const RESERVE: usize = 2048;
/// Elements into which a span may be divided, on the mean of a window.
const PER_SPAN: usize = 2;

/// Elements that the largest publication may have.
pub(in crate::plan) fn largest_publication() -> usize {
    // A window and the stop behind it, and what is kept free.
    PUBLICATION + 2 * PER_SPAN * WINDOW_SPANS + RESERVE
}

/// Where the motion stops if nothing follows.
#[derive(Clone, Debug)]
struct Tail {
    elements: Vec<Made>,
    /// Where it is at rest then.
    rest: Place,
}

/// Motion that has been planned.
#[derive(Clone, Debug)]
struct Ready {
    elements: Vec<Made>,
    /// Where it ends.
    end: Place,
    after: After,
}

/// What is at the end of motion that has been planned.
#[derive(Clone, Debug)]
enum After {
    Rest,
    /// It goes on, but could stop.
    Stop(Tail),
    /// It goes on.
    More,
}

/// One thing after the other.
#[derive(Debug)]
enum Step {
    Ready(Ready),
    /// A window that is being solved.
    Window(u64),
}

/// A window on its way, and what is needed once it is solved.
#[derive(Debug)]
struct Pending {
    number: u64,
    window: Window,
    /// Parts and launch at the beginning or end of the section, if that is where the window begins or ends.
    start: Option<(Part, Launch)>,
    stop: Option<(Part, Launch)>,
    /// Spans behind its right border, and how to stop on them.
    behind: Vec<Knotted>,
    tail: Option<Tail>,
    /// How to stop behind its left border.
    left_tail: Option<Tail>,
    /// Where its section begins, and how.
    section: (Place, Entry),
    /// Whether it ends at rest.
    rests: bool,
}

/// How a section begins.
#[derive(Clone, Copy, Debug)]
enum Entry {
    Rest,
    /// In the middle of another plan.
    TakenOver(TakenOver),
}

/// How the next section begins, and whether it is planned without the solver.
#[derive(Clone, Copy, Debug)]
struct Next {
    entry: Entry,
    careful: bool,
}

impl Next {
    const REST: Next = Next {
        entry: Entry::Rest,
        careful: false,
    };
}

/// The stop behind what has been handed over last.
#[derive(Debug)]
struct Stop {
    /// Empty: what has been handed over ends at rest.
    elements: Vec<Element>,
    /// Where its elements end.
    ends: Vec<Place>,
    /// Where the machine is at rest behind it.
    rest: Place,
    /// Whether it is in the ring, as a tail.
    is_in_ring: bool,
    /// Elements of it that a machine may be at.
    live: usize,
}

impl Stop {
    /// None: it rests here.
    fn at_rest(rest: Place) -> Stop {
        Stop {
            elements: Vec::new(),
            ends: Vec::new(),
            rest,
            is_in_ring: false,
            live: 0,
        }
    }
}

/// The section under construction.
#[derive(Debug)]
struct Section {
    begin: Place,
    entry: Entry,
    /// Parts until it is clear whether there is more than one.
    parts: Vec<Part>,
    /// From the second part on.
    open: Option<Open>,
}

#[derive(Debug)]
struct Open {
    knots: Knots,
    uncut: Uncut,
    start: Option<(Part, Launch)>,
}

/// Plans sections and hands them over.
#[derive(Debug)]
pub(in crate::plan) struct Stream {
    joints: Joints,
    times: Times,
    log: Log,
    sections: Sections,
    section: Option<Section>,
    next: Next,
    steps: VecDeque<Step>,
    pending: VecDeque<Pending>,
    /// Number of the next window.
    windows: u64,
    /// What is known of the left border of a window that has not been cut off yet.
    left_over: Option<(u64, States, Option<Tail>)>,
    jobs: Jobs,
    finished: bool,
    /// How often planning has restarted at some place.
    begun_anew: u64,
    jets: Vec<JointJet>,
    /// Number of the item up to which everything has been handed over.
    handed: u64,
    /// How a change of the override is carried out.
    changes: Changes,
    /// Elements of the publication that found no room; 0: none is waiting. What is waiting only grows.
    refused: usize,
    gate: Gate,
    stop: Stop,
    /// From where it is planned anew because the gate has refused what was planned first; and the line, where that was refused, too.
    anew: Option<Place>,
    closed: Option<u32>,
    #[cfg(test)]
    pub(in crate::plan) spoil: Option<fn(&mut [Element]) -> bool>,
}

impl Stream {
    /// At rest at the beginning of a path that comes.
    pub(in crate::plan) fn new(settings: &Settings, workers: &Workers) -> Stream {
        let joints = Joints::new(settings);
        let log = Log::new();
        let begin = Place { item: 0, s: 0.0 };
        Stream {
            times: times(&joints),
            joints,
            sections: Sections::new(begin, &log),
            log,
            section: None,
            next: Next::REST,
            steps: VecDeque::new(),
            pending: VecDeque::new(),
            windows: 0,
            left_over: None,
            jobs: Jobs::new(workers),
            finished: false,
            begun_anew: 0,
            jets: Vec::new(),
            handed: 0,
            changes: Changes::default(),
            refused: 0,
            gate: Gate::new(settings),
            stop: Stop::at_rest(begin),
            anew: None,
            closed: None,
            #[cfg(test)]
            spoil: None,
        }
    }

    /// Publications that the gate has refused.
    pub(in crate::plan) fn planned_anew(&self) -> u64 {
        self.gate.refused()
    }

    /// The path goes on.
    pub(in crate::plan) fn push(&mut self, passed: Passed, settings: &Settings) {
        self.finished = false;
        let (joints, jets) = (&self.joints, &mut self.jets);
        match passed {
            Passed::Stretch(stretch) => {
                let kept = kept(stretch, self.log.last(), settings, joints, jets);
                self.log.push(kept);
            }
            Passed::Seam(seam) => {
                let before = self.log.last();
                let ways = [seam.rounded, seam.exact].map(|[first, second]| {
                    let first = kept(first, before, settings, joints, jets);
                    let second = kept(second, Some(&first.item), settings, joints, jets);
                    [first, second]
                });
                self.log.push_seam(ways);
            }
            Passed::Stop => self.log.push(Kept::rest(None)),
        }
    }

    /// What is known ends at rest, where `element` happens if there is one.
    pub(in crate::plan) fn rest(&mut self, element: Option<Box<Element>>) {
        self.finished = false;
        self.log.push(Kept::rest(element));
    }

    /// Nothing follows for now; the path has ended at rest.
    pub(in crate::plan) fn finish(&mut self) {
        self.finished = true;
    }

    /// Whether everything has been handed over after [`Stream::finish`].
    pub(in crate::plan) fn is_done(&self) -> bool {
        self.finished && self.handed >= self.log.end() && !self.changes.is_wanted()
    }

    /// Hands over what is final.
    pub(in crate::plan) fn pump(&mut self, sink: &mut dyn Sink<Element>) -> Pumped {
        loop {
            let begun_anew = self.begun_anew;
            self.begin_change(sink);
            self.advance();
            self.collect();
            if self.changes.has_failed() {
                self.take_over(sink, true);
                continue;
            }
            match self.publish(sink) {
                Some(Publish::Done) => {}
                Some(Publish::Full) => return Pumped::Blocked,
                Some(Publish::Passed) => self.take_over(sink, true),
                Some(Publish::TailTaken) => {
                    self.gate.tail_taken();
                    let rest = self.stop.rest;
                    if !std::mem::replace(&mut self.stop, Stop::at_rest(rest)).is_in_ring {
                        continue;
                    }
                    self.steps.clear();
                    self.pending.clear();
                    self.restart(rest, Entry::Rest, false);
                }
                None if let Some(line) = self.closed => return Pumped::Refused { line },
                None if self.is_done() => return Pumped::Done,
                None if self.changes.withholds => return Pumped::Blocked,
                None if self.finished && self.jobs.are_under_way() => {}
                None if self.begun_anew != begun_anew || self.changes.has_failed() => {}
                None => return Pumped::Hungry,
            }
        }
    }

    /// Sends what is new through the stages.
    fn advance(&mut self) {
        let mut found = Vec::new();
        while !self.jobs.are_many() && !self.has_urgent() && self.sections.step(&self.log, &mut found) {
            let begun_anew = self.begun_anew;
            for found in found.drain(..) {
                self.push_found(found);
                if self.begun_anew != begun_anew {
                    // The rest of it comes again.
                    break;
                }
            }
        }
    }
}

/// A stretch behind what came before it.
fn kept(
    stretch: Box<Stretch>,
    before: Option<&Item>,
    settings: &Settings,
    joints: &Joints,
    jets: &mut Vec<JointJet>,
) -> Kept {
    Kept {
        meeting: match before {
            Some(Item::Stretch(before)) => meeting(before, &stretch, settings),
            Some(Item::Rest(_)) | None => Meeting::Smooth,
        },
        rapid: if stretch.rapid || stretch.seam {
            joints.fastest(&stretch.piece, jets)
        } else {
            f64::INFINITY
        },
        item: Item::Stretch(stretch),
    }
}

/// By how much windows overlap, and how long they are.
fn times(joints: &Joints) -> Times {
    /// Overlap over the time of braking from full speed: beyond it, nothing is felt of how the overlap ends.
    const OVERLAP: f64 = 2.5;
    /// Window over overlap: the overlap is solved twice.
    const WINDOW: f64 = 8.0;
    /// Time for braking to the feasible profile before the first border of a new plan, over that of braking from full speed.
    const FIRST: f64 = 2.5;
    let braking_s = joints
        .limits()
        .iter()
        .map(|limits| limits.velocity / limits.acceleration + limits.acceleration / limits.jerk)
        .fold(0.0, f64::max);
    let overlap_s = OVERLAP * braking_s;
    Times {
        knotting: Knotting::new(joints.limits(), step_s(joints)),
        overlap_s,
        window_s: WINDOW * overlap_s,
        first_s: FIRST * braking_s + overlap_s,
    }
}
