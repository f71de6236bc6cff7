//! The optimal planner as a whole, and what is handed over when.
//!
//! In:  stretches and halts, one after the other.
//! Out: publications to a ring.
//!
//! A publication ends at a border between windows, where the solution around the border shows how to stop, or at rest.

mod publication;

use std::collections::VecDeque;

use super::checkpoints::Checkpoints;
use super::joints::Joints;
use super::knots::{Knots, Knotted, step_s};
use super::sections::{Found, Item, Log, Part, Place, Sections};
use super::slopes::{Emission, Made, Side, launch, steady_limits};
use super::solver::{Grid, JointJet, Knotting, Launch, State};
use super::windows::{Answer, Border, States, Times, Uncut, WINDOW_SPANS, Window};
use crate::element::Element;
use crate::plan::limits::PathLimits;
use crate::plan::profile::{Phase, change_length, profile};
use crate::plan::smooth::Passed;
use crate::plan::workers::{Ordered, Workers};
use crate::plan::{Pumped, Settings};
use crate::ring::{Publish, Sink};
use publication::Changes;
pub(in crate::plan) use publication::Override;

/// Elements of a publication beyond those of its windows: what lies between sections.
const PUBLICATION: usize = 1024;
/// Parts that are planned without the solver, from rest to rest, where it found no way; then it is tried again.
const CAREFUL_PARTS: usize = 8;
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

/// Which job an answer belongs to.
#[derive(Debug)]
enum Asked {
    /// The border at the right end of this window.
    Border {
        window: u64,
        before: usize,
    },
    Window(u64),
}

/// How a section begins.
#[derive(Clone, Copy, Debug)]
enum Entry {
    /// At this steady speed, or at rest.
    Speed(f64),
    /// In the middle of another plan.
    TakenOver(State),
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
    /// How the next section begins.
    entry: Entry,
    /// Whether it is planned without the solver.
    careful: bool,
    steps: VecDeque<Step>,
    pending: VecDeque<Pending>,
    /// Number of the next window.
    windows: u64,
    /// What is known of the left border of a window that has not been cut off yet.
    left_over: Option<(u64, States, Option<Tail>)>,
    jobs: Ordered<Answer>,
    asked: VecDeque<Asked>,
    workers: Workers,
    /// Where the tail in the ring comes to rest.
    tail: Option<Place>,
    finished: bool,
    /// How often planning has begun anew at some place.
    begun_anew: u64,
    jets: Vec<JointJet>,
    /// Number of the item up to which everything has been handed over.
    handed: u64,
    /// How a change of the override is carried out.
    changes: Changes,
    /// Elements of the tail in the ring.
    tail_length: usize,
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
            entry: Entry::Speed(0.0),
            careful: false,
            steps: VecDeque::new(),
            pending: VecDeque::new(),
            windows: 0,
            left_over: None,
            jobs: Ordered::new(workers),
            asked: VecDeque::new(),
            workers: workers.clone(),
            tail: None,
            finished: false,
            begun_anew: 0,
            jets: Vec::new(),
            handed: 0,
            changes: Changes::default(),
            tail_length: 0,
        }
    }

    /// The path goes on.
    pub(in crate::plan) fn push(&mut self, passed: Passed) {
        self.finished = false;
        match passed {
            Passed::Stretch(stretch) => {
                let rapid = if stretch.rapid {
                    self.joints.fastest(&stretch.piece, &mut self.jets)
                } else {
                    f64::INFINITY
                };
                self.log.push(Item::Stretch(stretch), rapid);
            }
            Passed::Stop => self.log.push(Item::Rest(None), f64::INFINITY),
        }
    }

    /// What is known ends at rest, where `element` happens if there is one.
    pub(in crate::plan) fn rest(&mut self, element: Option<Element>) {
        self.finished = false;
        self.log.push(Item::Rest(element), f64::INFINITY);
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
    pub(in crate::plan) fn pump<S: Sink<Element>>(&mut self, settings: &Settings, sink: &mut S) -> Pumped {
        loop {
            let begun_anew = self.begun_anew;
            self.begin_change(sink);
            self.advance(settings);
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
                    self.tail_length = 0;
                    let Some(rest) = self.tail.take() else { continue };
                    self.steps.clear();
                    self.pending.clear();
                    self.restart(rest, Entry::Speed(0.0), false);
                }
                None if self.is_done() => return Pumped::Done,
                None if self.changes.withholds() => return Pumped::Blocked,
                None if self.finished && self.jobs.under_way() > 0 => {}
                None if self.begun_anew != begun_anew => {}
                None => return Pumped::Hungry,
            }
        }
    }

    /// Sends what is new through the stages.
    fn advance(&mut self, settings: &Settings) {
        let mut found = Vec::new();
        // Jobs wait in memory: no more of them than keep all threads busy.
        while self.jobs.under_way() <= 4 * (self.workers.threads() + 1)
            && !self.has_urgent()
            && self.sections.step(&self.log, settings, &mut found)
        {
            let begun_anew = self.begun_anew;
            for found in found.drain(..) {
                self.take(found);
                if self.begun_anew != begun_anew {
                    // The rest of it comes again.
                    break;
                }
            }
        }
    }

    fn take(&mut self, found: Found) {
        match found {
            Found::Part(part) => match &mut self.section {
                None => {
                    self.section = Some(Section {
                        begin: Place {
                            item: part.item,
                            s: part.from,
                        },
                        entry: self.entry,
                        parts: vec![part],
                        open: None,
                    });
                }
                Some(_) => self.go_on(part),
            },
            Found::End { speed } => self.end(speed),
            Found::Zone { part, speed, behind } => self.zone(part, speed, behind),
            Found::Rest { item } => {
                let elements = match self.log.get(item) {
                    Some(Item::Rest(element)) => element.iter().map(|element| still(*element, item)).collect(),
                    Some(Item::Stretch(_)) | None => Vec::new(),
                };
                self.steps.push_back(Step::Ready(Ready {
                    elements,
                    end: Place { item: item + 1, s: 0.0 },
                    after: After::Rest,
                }));
            }
        }
    }

    /// The section under construction goes on with another part.
    fn go_on(&mut self, part: Part) {
        if self.section.as_ref().is_some_and(|section| section.open.is_none()) {
            self.open();
        }
        let Some(section) = &mut self.section else { return };
        match &mut section.open {
            Some(open) => {
                open.knots.push(
                    part,
                    &self.log,
                    &self.joints,
                    self.times.knotting.step_s,
                    &mut self.jets,
                );
                self.add_spans(None);
                self.cut(false);
            }
            None => {
                section.parts.push(part);
                if section.parts.len() >= CAREFUL_PARTS {
                    self.phases(0.0);
                }
            }
        }
    }

    /// Begins with knots in a section of which one part is known. Where that cannot be, the section stays closed, and is
    /// planned without them.
    fn open(&mut self) {
        let Some(section) = &mut self.section else { return };
        let (false, &[part]) = (self.careful, &section.parts[..]) else {
            return;
        };
        let grid = Grid::new(self.joints.limits());
        let mut start = None;
        let mut first = part;
        let (mut knots, uncut) = match section.entry {
            Entry::TakenOver(state) => (Knots::taken_over(state), Uncut::taken_over(state, grid, self.times)),
            Entry::Speed(0.0) => {
                let Some(launch) = launch(part, Side::Start, &self.log, &self.joints, &mut self.jets) else {
                    return;
                };
                first.from += launch.length();
                start = Some((part, launch));
                let state = launch.start();
                let knots = Knots::new(state.b.sqrt());
                (knots, Uncut::new(state, grid, self.times))
            }
            Entry::Speed(speed) => {
                let state = State {
                    b: speed * speed,
                    u: 0.0,
                };
                (Knots::new(speed), Uncut::new(state, grid, self.times))
            }
        };
        knots.push(
            first,
            &self.log,
            &self.joints,
            self.times.knotting.step_s,
            &mut self.jets,
        );
        section.open = Some(Open { knots, uncut, start });
    }

    /// Takes the spans of which the knots are certain into the grid.
    fn add_spans(&mut self, exit: Option<f64>) {
        let Some(open) = self.section.as_mut().and_then(|section| section.open.as_mut()) else {
            return;
        };
        let mut spans = Vec::new();
        open.knots.take(exit, self.times.knotting.step_s, &mut spans);
        for span in spans {
            let Some(stretch) = self.log.stretch(span.item) else {
                continue;
            };
            let checkpoints = Checkpoints {
                joints: &self.joints,
                stretch,
                feed: self.log.feed(span.item),
            };
            checkpoints.add(span, &mut open.uncut);
        }
    }

    /// Cuts off all windows that are certain.
    fn cut(&mut self, ended: bool) {
        loop {
            let Some(section) = &mut self.section else { return };
            let Some(open) = &mut section.open else { return };
            let Some((window, border)) = open.uncut.cut(ended) else {
                return;
            };
            let start = open.start.take();
            let begin = (section.begin, section.entry);
            self.add_window(window, start, None, begin, Some(border), None);
        }
    }

    fn add_window(
        &mut self,
        mut window: Window,
        start: Option<(Part, Launch)>,
        stop: Option<(Part, Launch)>,
        section: (Place, Entry),
        border: Option<Border>,
        speed_after: Option<f64>,
    ) {
        let number = self.windows;
        self.windows += 1;
        let mut behind = Vec::new();
        if let Some(Border {
            job,
            before,
            behind: spans,
        }) = border
        {
            behind = spans;
            self.order_job(Asked::Border { window: number, before }, job);
        }
        let mut left_tail = None;
        if self
            .left_over
            .as_ref()
            .is_some_and(|(for_window, ..)| *for_window == number)
            && let Some((_, states, tail)) = self.left_over.take()
        {
            window.set_left(states);
            left_tail = tail;
        }
        self.steps.push_back(Step::Window(number));
        self.pending.push_back(Pending {
            number,
            window,
            start,
            stop,
            behind,
            tail: None,
            left_tail,
            section,
            rests: speed_after == Some(0.0),
        });
        self.ask(number);
    }

    /// Hands in the job of a window if both its ends are known.
    fn ask(&mut self, number: u64) {
        let Some(index) = self.index(number) else { return };
        match self.pending[index].window.job() {
            None => {}
            Some(Ok(job)) => {
                self.order_job(Asked::Window(number), job);
            }
            Some(Err(_)) => self.give_up(index),
        }
    }

    fn index(&self, number: u64) -> Option<usize> {
        self.pending.iter().position(|pending| pending.number == number)
    }

    /// The section ends.
    fn end(&mut self, speed: f64) {
        if self
            .section
            .as_ref()
            .is_some_and(|section| section.open.is_none() && !self.is_phased(section))
        {
            self.open();
        }
        let stop = self.stop(speed);
        if matches!((&self.section, self.entry), (None, Entry::TakenOver(_))) {
            // A zone begins before the place from which this would go on.
            self.changes.fail();
            return;
        }
        let Some(section) = &mut self.section else { return };
        let Some(open) = &mut section.open else {
            self.phases(speed);
            return;
        };
        let failed = stop.is_err();
        let stop = stop.unwrap_or(None);
        if let Some((_, launch)) = stop {
            open.knots.trim(launch.length());
        }
        self.add_spans(Some(stop.map_or(speed, |(_, launch)| launch.stop().b.sqrt())));
        self.cut(true);
        let Some(section) = self.section.take() else { return };
        let Some(open) = section.open else { return };
        let mut state = stop.map_or(
            State {
                b: speed * speed,
                u: 0.0,
            },
            |(_, launch)| launch.stop(),
        );
        if failed {
            // Nothing leads to a state that is none: the window is given up as soon as it is clear where it begins.
            state.b = f64::NAN;
        }
        let window = open.uncut.last(state);
        self.entry = Entry::Speed(speed);
        self.careful = false;
        self.add_window(
            window,
            open.start,
            stop,
            (section.begin, section.entry),
            None,
            Some(speed),
        );
    }

    /// The launch of the stop at the end of the open section, if it ends at rest.
    fn stop(&mut self, speed: f64) -> Result<Option<(Part, Launch)>, ()> {
        if speed > 0.0 {
            return Ok(None);
        }
        let Some(Section { open: Some(open), .. }) = &self.section else {
            return Err(());
        };
        let part = open.knots.last_part().ok_or(())?;
        let launch = launch(part, Side::Stop, &self.log, &self.joints, &mut self.jets).ok_or(())?;
        Ok(Some((part, launch)))
    }

    /// Whether seven phases run a closed section in the shortest time: one straight part.
    fn is_phased(&self, section: &Section) -> bool {
        let even = |part: &Part| {
            self.log
                .stretch(part.item)
                .is_some_and(|stretch| self.joints.are_even(&stretch.piece))
        };
        matches!(section.entry, Entry::Speed(_)) && matches!(&section.parts[..], [part] if even(part))
    }
}

/// An element at rest, which is item `item` of the log.
fn still(element: Element, item: u64) -> Made {
    Made {
        element,
        end: Place { item: item + 1, s: 0.0 },
        opens: false,
    }
}

impl Stream {
    /// Plans the section under construction without knots: one part from speed to speed, several from rest to rest.
    fn phases(&mut self, speed: f64) {
        self.careful = false;
        let Some(section) = self.section.take() else {
            self.entry = Entry::Speed(speed);
            return;
        };
        let Entry::Speed(begin_speed) = section.entry else {
            self.changes.fail();
            return;
        };
        self.entry = Entry::Speed(speed);
        let mut elements = Vec::new();
        let mut end = section.begin;
        let last = section.parts.len() - 1;
        for (k, part) in section.parts.iter().enumerate() {
            let v0 = if k == 0 { begin_speed } else { 0.0 };
            let v1 = if k == last { speed } else { 0.0 };
            let limits = steady_limits(*part, &self.log, &self.joints, &mut self.jets);
            for phase in profile(v0, v1, part.to - part.from, &limits) {
                self.cruise(*part, phase, &limits, &mut elements);
            }
            end = Place {
                item: part.item,
                s: part.to,
            };
        }
        if speed > 0.0
            && let Some(last) = elements.last_mut()
        {
            last.opens = false;
        }
        self.steps.push_back(Step::Ready(Ready {
            elements,
            end,
            after: if speed > 0.0 { After::More } else { After::Rest },
        }));
    }

    /// A phase on a part; where the speed stays the same for long, the machine could stop now and then.
    fn cruise(&mut self, part: Part, phase: Phase, limits: &PathLimits, elements: &mut Vec<Made>) {
        /// Time between such places.
        const STEADY_S: f64 = 3.0;
        let steady = phase.jerk == 0.0 && phase.a == 0.0;
        let count = if steady {
            (phase.duration / STEADY_S).ceil().max(1.0)
        } else {
            1.0
        };
        let step = phase.duration / count;
        let stop = change_length(phase.v, 0.0, limits);
        let mut done = 0.0;
        while done < count {
            let begin = step * done;
            done += 1.0;
            let mut piece = Phase {
                duration: step,
                s: phase.place(begin),
                ..phase
            };
            if done >= count {
                piece.duration = phase.duration - begin;
            }
            let end = Emission {
                log: &self.log,
                out: elements,
            }
            .phases(&[part], &[piece]);
            if done >= count || end.s + stop >= part.to {
                continue;
            }
            let mut tail = Vec::new();
            let rest = Emission {
                log: &self.log,
                out: &mut tail,
            }
            .phases(&[Part { from: end.s, ..part }], &profile(phase.v, 0.0, stop, limits));
            self.steps.push_back(Step::Ready(Ready {
                elements: std::mem::take(elements),
                end,
                after: After::Stop(Tail { elements: tail, rest }),
            }));
        }
    }

    /// Constant speed beside a kink; behind it, the machine could stop on what is left of the stretch.
    fn zone(&mut self, part: Part, speed: f64, behind: bool) {
        let mut elements = Vec::new();
        Emission {
            log: &self.log,
            out: &mut elements,
        }
        .steady(part, speed);
        let count = elements.len();
        for (k, made) in elements.iter_mut().enumerate() {
            // Only from its end on, all is as it is planned anew.
            made.opens = behind && k + 1 == count;
        }
        let end = Place {
            item: part.item,
            s: part.to,
        };
        let after = match self.log.stretch(part.item) {
            Some(stretch) if behind => {
                let rest = Part {
                    from: part.to,
                    to: stretch.piece.length(),
                    ..part
                };
                let limits = steady_limits(rest, &self.log, &self.joints, &mut self.jets);
                let phases = profile(speed, 0.0, change_length(speed, 0.0, &limits), &limits);
                let mut elements = Vec::new();
                let rest = Emission {
                    log: &self.log,
                    out: &mut elements,
                }
                .phases(&[rest], &phases);
                After::Stop(Tail { elements, rest })
            }
            Some(_) | None => After::More,
        };
        self.steps.push_back(Step::Ready(Ready { elements, end, after }));
    }

    /// Begins anew at a place.
    fn restart(&mut self, place: Place, entry: Entry, careful: bool) {
        self.begun_anew += 1;
        self.sections = match entry {
            Entry::Speed(_) => Sections::new(place, &self.log),
            Entry::TakenOver(_) => Sections::in_motion(place, &self.log),
        };
        self.section = None;
        self.left_over = None;
        self.entry = entry;
        self.careful = careful;
    }

    /// A window has no solution: what follows the last known place is planned anew, its beginning without the solver.
    fn give_up(&mut self, index: usize) {
        if self.changes.fails() {
            return;
        }
        let Some(failed) = self.pending.drain(index..).next() else {
            return;
        };
        while let Some(step) = self.steps.pop_back() {
            if matches!(step, Step::Window(number) if number == failed.number) {
                break;
            }
        }
        match failed.left_tail {
            Some(tail) => {
                self.steps.push_back(Step::Ready(Ready {
                    elements: tail.elements,
                    end: tail.rest,
                    after: After::Rest,
                }));
                self.restart(tail.rest, Entry::Speed(0.0), true);
            }
            None => self.restart(failed.section.0, failed.section.1, true),
        }
    }

    /// Takes the answers that are there; waits for one where nothing else is left to do.
    fn collect(&mut self) {
        if self.changes.is_under_way() {
            self.do_urgent();
            return;
        }
        loop {
            let wait = self.finished || self.jobs.under_way() > 4 * (self.workers.threads() + 1);
            let answer = if wait {
                self.jobs.wait_next()
            } else {
                self.jobs.try_next()
            };
            // Only an answer takes its question away: one that is not there yet comes later.
            let Some(answer) = answer else { return };
            let Some(asked) = self.asked.pop_front() else {
                return;
            };
            self.solved(asked, answer.ok().and_then(Result::ok));
        }
    }

    fn solved(&mut self, asked: Asked, states: Option<States>) {
        match asked {
            Asked::Border { window, before } => self.border_solved(window, before, states),
            Asked::Window(number) => self.window_solved(number, states),
        }
    }

    fn border_solved(&mut self, number: u64, before: usize, states: Option<States>) {
        let Some(index) = self.index(number) else { return };
        let Some(mut states) = states else {
            self.give_up(index);
            return;
        };
        let behind = states.split_off(before);
        states.push(behind[0]);
        let pending = &mut self.pending[index];
        pending.window.set_right(states);
        let tail = self.tail_behind(index, &behind);
        self.pending[index].tail = tail.clone();
        match self.pending.get_mut(index + 1) {
            Some(next) => {
                next.window.set_left(behind);
                next.left_tail = tail;
                self.ask(number + 1);
            }
            None => self.left_over = Some((number + 1, behind, tail)),
        }
        self.ask(number);
    }

    /// The stop behind the right border of a window: the solution there down to crawl, and from there to rest.
    fn tail_behind(&mut self, index: usize, states: &[State]) -> Option<Tail> {
        let spans = &self.pending[index].behind;
        let mut elements = Vec::new();
        let mut out = Emission {
            log: &self.log,
            out: &mut elements,
        };
        for (span, states) in spans.iter().zip(states.windows(2)) {
            out.spline(span.part(), states[0], states[1]);
        }
        let (last, state) = (spans.last()?, states.last()?);
        let place = Place {
            item: last.item,
            s: last.to,
        };
        let rest = stop_from(place, *state, &mut out, &self.joints, &mut self.jets)?;
        Some(Tail { elements, rest })
    }

    fn window_solved(&mut self, number: u64, states: Option<States>) {
        let Some(index) = self.index(number) else { return };
        let Some(states) = states else {
            self.give_up(index);
            return;
        };
        let Some(pending) = self.pending.remove(index) else {
            return;
        };
        let mut elements = Vec::new();
        let mut out = Emission {
            log: &self.log,
            out: &mut elements,
        };
        if let Some((part, launch)) = &pending.start {
            out.start(*part, launch);
        }
        let mut end = pending.section.0;
        for (span, states) in pending.window.sources.iter().zip(states.windows(2)) {
            out.spline(span.part(), states[0], states[1]);
            end = Place {
                item: span.item,
                s: span.to,
            };
        }
        if let Some((part, launch)) = &pending.stop {
            out.stop(*part, launch);
            end = Place {
                item: part.item,
                s: part.to,
            };
        }
        if pending.tail.is_none()
            && !pending.rests
            && let Some(last) = elements.last_mut()
        {
            last.opens = false;
        }
        let after = match pending.tail {
            Some(tail) => After::Stop(tail),
            None if pending.rests => After::Rest,
            None => After::More,
        };
        for step in &mut self.steps {
            if matches!(step, Step::Window(waiting) if *waiting == number) {
                *step = Step::Ready(Ready { elements, end, after });
                return;
            }
        }
    }
}

/// A stop from a slow motion at a place, on whatever part of the path follows; where it ends.
fn stop_from(
    place: Place,
    state: State,
    out: &mut Emission<'_>,
    joints: &Joints,
    jets: &mut Vec<JointJet>,
) -> Option<Place> {
    let (v, a) = (state.b.sqrt(), state.u);
    let stretch = out.log.stretch(place.item)?;
    let mut parts = Vec::new();
    let mut part = Part {
        item: place.item,
        from: place.s,
        to: stretch.piece.length(),
    };
    let (mut length, mut limits) = (0.0, None::<PathLimits>);
    // Slow as it is, it takes a few pieces at the most; more means that something is wrong.
    for _ in 0..64 {
        if part.to > part.from {
            let here = steady_limits(part, out.log, joints, jets);
            limits = Some(limits.map_or(here, |least| PathLimits {
                v: least.v.min(here.v),
                a: least.a.min(here.a),
                j: least.j.min(here.j),
            }));
            length += part.to - part.from;
            parts.push(part);
        }
        if let Some(limits) = &limits {
            // First away with the acceleration, then to rest.
            let settle = a.abs() / limits.j;
            let speed = v + 0.5 * a * settle;
            let first = settle * (v + settle * (a / 2.0 - settle * a.signum() * limits.j / 6.0));
            let rest = change_length(speed, 0.0, limits);
            if first + rest <= length {
                let mut phases = Vec::new();
                if settle > 0.0 {
                    phases.push(Phase {
                        duration: settle,
                        s: 0.0,
                        v,
                        a,
                        jerk: -a.signum() * limits.j,
                    });
                }
                phases.extend(profile(speed, 0.0, rest, limits).into_iter().map(|phase| Phase {
                    s: phase.s + first,
                    ..phase
                }));
                return Some(out.phases(&parts, &phases));
            }
        }
        let item = part.item + 1;
        part = Part {
            item,
            from: 0.0,
            to: out.log.stretch(item)?.piece.length(),
        };
    }
    None
}

/// By how much windows overlap, and how long they are.
fn times(joints: &Joints) -> Times {
    /// Overlap over the time of braking from full speed: beyond it, nothing is felt of how the overlap ends.
    const OVERLAP: f64 = 2.5;
    /// Window over overlap: the overlap is solved twice.
    const WINDOW: f64 = 8.0;
    /// Time for braking to crawl before the first border of a new plan, over that of braking from full speed.
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
