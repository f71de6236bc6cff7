//! What is handed over, and what takes its place when an override changes.
//!
//! In:  planned motion; orders to change the override.
//! Out: publications to a ring.
//!
//! A changed override means a new plan from a place a little ahead of the machine, the end of an element in the ring. There
//! the new plan begins with the speed and acceleration of the old one, and from there on it keeps the limits as any plan
//! does. Where the machine is faster than the new override allows, the cap of its speed comes down with a part of the
//! acceleration (see [`Knots::taken_over`](super::super::knots::Knots::taken_over)). Where no way on is found, or the
//! machine was there first, the old plan stays in force and another place farther on is tried, the last one being the rest
//! at its end.
//!
//! Which place it is depends on where the machine is, that is on time; nothing else here does.

use std::collections::VecDeque;

use super::{
    AHEAD, After, Asked, Entry, Made, PUBLICATION, Place, RESERVE, Ready, State, Step, Stream, Tail, TakenOver,
};
use crate::element::{Element, Span};
use crate::plan::optimal::sections::Shares;
use crate::plan::optimal::windows::Job;
use crate::ring::{Publish, Sink, Timed};

/// Time between the end of the element that the machine is at and the place from which a new plan is made, s; where that
/// fails, it grows by the factor, and by the step.
const LEAD_S: f64 = 0.022;
const LEAD_GROWTH: (f64, f64) = (1.25, 0.005);
/// What an override of 0 is planned with: the machine creeps to where it can stop.
const LEAST: f64 = 0.01;
/// With so many elements, parts of those that take long end a publication.
const PARTS: usize = 4096;
/// Slower than this, mm/s, nothing takes over from motion.
const SLOWEST: f64 = 0.1;

/// An override, both as shares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::plan) struct Override {
    /// Of the programmed feed.
    pub(in crate::plan) feed: f64,
    /// Of the speed limits of the joints on rapid moves.
    pub(in crate::plan) rapid: f64,
    /// Whether moves at feed, and rapid ones, are held by the interpolation.
    pub(in crate::plan) held: [bool; 2],
}

/// An element in the ring that the machine has not passed.
#[derive(Clone, Copy, Debug)]
struct Live {
    number: u64,
    seconds: f64,
    /// Item on which it ends.
    item: u64,
    line: u32,
    /// The state at its end, if it moves.
    motion: Option<State>,
    /// The place of its end, if a plan may begin there; in motion, or at rest.
    opens: Option<(Place, bool)>,
}

impl Live {
    fn new(number: u64, made: &Made, rest: Option<Place>) -> Live {
        let (line, state) = match &made.element {
            Element::Span(span) => (span.line, Some(state_behind(span))),
            // From rest to rest.
            Element::Synced(synced) => (synced.line, None),
            Element::Probing(probing) => (probing.line, None),
            Element::Dwell { line, .. } | Element::Action { line, .. } => (*line, None),
        };
        let passed = state.filter(|state| made.opens && state.b > SLOWEST * SLOWEST);
        Live {
            number,
            seconds: made.element.duration_s(),
            item: made.end.item,
            line,
            motion: state,
            opens: match rest {
                Some(rest) => Some((rest, false)),
                None => passed.map(|_| (made.end, true)),
            },
        }
    }
}

/// State at the end of a span.
fn state_behind(span: &Span) -> State {
    let t = span.duration_s;
    let v = span.speed(t);
    State {
        b: v * v,
        u: span.a0 + span.jerk * t + span.gradient * (span.place(t) - span.s0),
    }
}

/// A new plan that has not been published.
#[derive(Debug)]
struct Change {
    /// The element behind which it comes.
    number: u64,
    /// Whether the machine moves there.
    moving: bool,
    lead_s: f64,
    failed: bool,
    /// What is to be solved for it, in this thread.
    urgent: VecDeque<(Asked, Job)>,
}

/// What is in the ring, and how it changes.
#[derive(Debug, Default)]
pub(super) struct Changes {
    wanted: Option<Override>,
    /// Whether feed and rapid moves are to stand still.
    zero: [bool; 2],
    withholds: bool,
    live: VecDeque<Live>,
    under_way: Option<Change>,
}

impl Changes {
    /// Whether an order has not been carried out.
    pub(super) fn is_wanted(&self) -> bool {
        self.wanted.is_some()
    }

    /// Whether a new plan has been begun and not published.
    pub(super) fn is_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// Whether there is motion that the override forbids.
    pub(super) fn withholds(&self) -> bool {
        self.withholds
    }

    pub(super) fn has_failed(&self) -> bool {
        self.under_way.as_ref().is_some_and(|change| change.failed)
    }

    /// Nothing leads on from where the new plan begins.
    pub(super) fn fail(&mut self) {
        if let Some(change) = &mut self.under_way {
            change.failed = true;
        }
    }

    /// Greatest b from the end of an element on, where this is the state, until the machine slows down.
    fn crest(&self, index: usize, state: State) -> f64 {
        let mut last = state;
        for live in self.live.range(index + 1..) {
            let Some(next) = live.motion.filter(|_| last.u > 0.0) else {
                break;
            };
            if next.u <= 0.0 {
                // Between the two, acceleration passes 0; it changes about evenly.
                let rising_s = live.seconds * last.u / (last.u - next.u);
                let crest = last.b.sqrt() + 0.5 * last.u * rising_s;
                return last.b.max(next.b).max(crest * crest);
            }
            last = next;
        }
        last.b
    }

    /// The same if the new plan begins in motion; whether it does.
    pub(super) fn fails(&mut self) -> bool {
        let moving = self.under_way.as_ref().is_some_and(|change| change.moving);
        if moving {
            self.fail();
        }
        moving
    }
}

impl Stream {
    /// From now on, or as soon as can be, these overrides hold.
    pub(in crate::plan) fn set_override(&mut self, wanted: Override) {
        self.changes.wanted = Some(wanted);
    }

    /// Begins a new plan if the override is to change.
    pub(super) fn begin_change<S: Sink<Element>>(&mut self, sink: &mut S) {
        self.forget_passed(sink);
        let Some(wanted) = self.changes.wanted else { return };
        // Without a consumer, what was handed in is final: it counts from the next rest on.
        let idle = self.steps.is_empty() && self.section.is_none() && matches!(self.next.entry, Entry::Rest);
        if sink.consumer_at().is_none() && !idle {
            return;
        }
        self.changes.wanted = None;
        self.changes.zero = [wanted.feed <= 0.0, wanted.rapid <= 0.0];
        self.log.shares = Shares {
            feed: wanted.feed.max(LEAST),
            rapid: wanted.rapid.clamp(LEAST, 1.0),
        };
        let [feed, rapid] = self.changes.zero;
        self.log.held = [wanted.held[0] || feed, wanted.held[1] || rapid];
        if idle {
            self.log.choose_ways(Place {
                item: self.handed,
                s: 0.0,
            });
        }
        if sink.consumer_at().is_some() {
            self.changes.under_way = None;
            self.take_over(sink, false);
        }
    }

    /// Forgets what the machine has passed.
    fn forget_passed<S: Sink<Element>>(&mut self, sink: &S) {
        let Some(at) = sink.consumer_at() else { return };
        let live = &mut self.changes.live;
        while live.len() > 1 && live.front().is_some_and(|first| first.number < at) {
            live.pop_front();
        }
        if let Some(first) = live.front() {
            self.log.drop_before(first.item);
        }
    }

    /// Begins a new plan behind an element that the machine reaches soon, or, after a failure, later than tried before.
    pub(super) fn take_over<S: Sink<Element>>(&mut self, sink: &mut S, later: bool) {
        self.forget_passed(sink);
        self.forget_plans();
        let lead_s = match (self.changes.under_way.take(), later) {
            (Some(change), true) => LEAD_GROWTH.0 * change.lead_s + LEAD_GROWTH.1,
            (Some(_) | None, _) => LEAD_S,
        };
        let Some(&last) = self.changes.live.back() else {
            // Nothing has been handed over yet.
            let begin = Place {
                item: self.log.begin(),
                s: 0.0,
            };
            self.log.choose_ways(begin);
            self.restart(begin, Entry::Rest, false);
            return;
        };
        let mut ahead_s = 0.0;
        let mut found = None;
        for (k, live) in self.changes.live.iter().enumerate() {
            if k > 0 {
                ahead_s += live.seconds;
            }
            let waits = k == 0 && live.motion.is_none();
            if let Some(opens) = live.opens
                && (ahead_s >= lead_s || waits || live.number == last.number)
            {
                found = Some((k, *live, opens));
                break;
            }
        }
        let Some((index, live, (place, moving))) = found else {
            return;
        };
        let state = live.motion.filter(|_| moving);
        self.changes.under_way = Some(Change {
            number: live.number,
            moving: state.is_some(),
            lead_s,
            failed: false,
            urgent: VecDeque::new(),
        });
        self.handed = place.item;
        let entry = state.map_or(Entry::Rest, |state| {
            let crest = self.changes.crest(index, state);
            Entry::TakenOver(TakenOver { state, crest })
        });
        self.log.choose_ways(place);
        self.restart(place, entry, false);
        if state.is_none() && live.number != last.number && self.changes.zero.contains(&true) {
            // What followed must not happen yet: an end takes its place.
            let element = Element::Dwell {
                seconds: 0.0,
                line: live.line,
            };
            self.steps.push_back(Step::Ready(Ready {
                elements: vec![Made {
                    element,
                    end: place,
                    opens: false,
                }],
                end: place,
                after: After::Rest,
            }));
        }
    }

    /// Hands in a job.
    pub(super) fn order_job(&mut self, asked: Asked, job: Job) {
        if let Some(change) = &mut self.changes.under_way {
            change.urgent.push_back((asked, job));
            return;
        }
        self.jobs.order(asked, job);
    }

    /// Whether there is work for a new plan that goes before looking farther ahead.
    pub(super) fn has_urgent(&self) -> bool {
        let change = self.changes.under_way.as_ref();
        change.is_some_and(|change| change.failed || !change.urgent.is_empty() || self.next_publication(true) > 0)
    }

    /// Solves the first windows of a new plan, until it can be handed over.
    pub(super) fn do_urgent(&mut self) {
        while self.next_publication(true) == 0 {
            let Some(change) = &mut self.changes.under_way else {
                return;
            };
            // Windows in their order, each after the border at its end.
            let order = |(asked, _): &(Asked, Job)| match asked {
                Asked::Border { window, .. } => (*window, 0),
                Asked::Window(window) => (*window, 1),
            };
            let first = (0..change.urgent.len()).min_by_key(|&k| order(&change.urgent[k]));
            let Some((asked, job)) = first.and_then(|k| change.urgent.remove(k)) else {
                return;
            };
            let states = job.run().ok();
            self.solved(asked, states);
            if self.changes.has_failed() {
                return;
            }
        }
    }

    /// Steps that make one publication; 0 if none can be made.
    fn next_publication(&self, urgent: bool) -> usize {
        let (mut count, mut steps) = (0, 0);
        let changing = self.changes.under_way.as_ref().is_some_and(|change| change.moving);
        for (k, step) in self.steps.iter().enumerate() {
            let Step::Ready(ready) = step else { break };
            // What comes to rest from motion must be handed over; with an override of 0, nothing else.
            let first = changing && steps == 0;
            if (steps > 0 && (urgent || count + ready.elements.len() > PUBLICATION))
                || (!first && self.is_forbidden(&ready.elements))
            {
                break;
            }
            count += ready.elements.len();
            if !matches!(ready.after, After::More) {
                steps = k + 1;
            }
        }
        steps
    }

    /// Whether elements move on where the override is 0.
    fn is_forbidden(&self, elements: &[Made]) -> bool {
        let [feed, rapid] = self.changes.zero;
        (feed || rapid)
            && elements.iter().any(|made| match &made.element {
                Element::Span(span) => span.enables.feed_override && [feed, rapid][usize::from(span.rapid)],
                // It keeps its own feed, but does not begin.
                Element::Probing(_) => feed,
                // Overrides do not act on motion in step with the spindle.
                Element::Synced(_) | Element::Dwell { .. } | Element::Action { .. } => false,
            })
    }

    /// Hands over as much as makes one publication; `None` if nothing can be.
    pub(super) fn publish<S: Sink<Element>>(&mut self, sink: &mut S) -> Option<Publish> {
        let steps = self.next_publication(self.changes.is_under_way());
        let next = self.steps.get(steps);
        self.changes.withholds = matches!(next, Some(Step::Ready(ready)) if self.is_forbidden(&ready.elements));
        if steps == 0 {
            return None;
        }
        // Asked again and again while the machine runs what is there: it would be put together each time.
        if !self.changes.is_under_way() && self.refused > 0 && !has_room(sink, self.refused) {
            return Some(Publish::Full);
        }
        let mut publication = Publication::gather(&self.steps, steps, sink)?;
        if !publication.lives.is_empty() {
            let result = self.hand_in(&mut publication, sink)?;
            if result != Publish::Done {
                return Some(result);
            }
        }
        self.handed = publication.end.item;
        if !publication.consumed {
            self.log.drop_before(publication.end.item);
        }
        match publication.cut {
            None => drop(self.steps.drain(..publication.steps)),
            Some(Cut { step, element, left }) => {
                self.steps.drain(..step);
                if let Some(Step::Ready(ready)) = self.steps.front_mut() {
                    ready.elements.drain(..element);
                    ready.elements[0] = left;
                }
            }
        }
        self.stop.elements = publication.tail;
        self.stop.ends = publication.ends;
        self.stop.is_in_ring = publication.rest.is_some();
        self.stop.rest = publication.rest.unwrap_or(publication.end);
        Some(Publish::Done)
    }

    /// A publication passes the gate and goes to the ring; `None`: the gate has refused it.
    fn hand_in<S: Sink<Element>>(&mut self, publication: &mut Publication, sink: &mut S) -> Option<Publish> {
        #[cfg(test)]
        if self.spoil.is_some_and(|spoil| spoil(&mut publication.committed)) {
            self.spoil = None;
        }
        let (committed, tail) = (&publication.committed, &publication.tail);
        if let Err(line) = self.gate.check(committed, tail, self.changes.is_under_way()) {
            self.plan_anew(line);
            return None;
        }
        let count = publication.lives.len();
        let result = match &self.changes.under_way {
            Some(change) => sink.publish_after(change.number, committed, tail),
            None if !has_room(sink, count) => Publish::Full,
            None => sink.publish(committed, tail),
        };
        self.refused = if result == Publish::Full { count } else { 0 };
        if result == Publish::Done {
            self.gate.handed_over();
            self.published(publication);
        }
        Some(result)
    }

    /// The gate has refused what was to be handed over, at this line: it is planned once more from the next rest on, from rest to rest and
    /// without the solver. A new plan for another override is tried from elsewhere.
    fn plan_anew(&mut self, line: u32) {
        if self.changes.is_under_way() {
            self.changes.fail();
            return;
        }
        let rest = self.stop.rest;
        if self.anew.replace(rest) == Some(rest) {
            self.closed = Some(line);
            return;
        }
        self.forget_plans();
        if !self.stop.elements.is_empty() {
            let stop = self.stop.elements.iter().zip(&self.stop.ends);
            let made = |(&element, &end): (&Element, &Place)| Made {
                element,
                end,
                opens: false,
            };
            self.steps.push_back(Step::Ready(Ready {
                elements: stop.map(made).collect(),
                end: rest,
                after: After::Rest,
            }));
        }
        self.restart(rest, Entry::Rest, true);
    }

    /// What is planned and not handed over is of no use any more.
    fn forget_plans(&mut self) {
        self.steps.clear();
        self.pending.clear();
        self.jobs.forget();
    }

    /// Keeps in mind what is in the ring now.
    fn published(&mut self, publication: &mut Publication) {
        let live = &mut self.changes.live;
        match self.changes.under_way.take() {
            Some(change) => {
                let kept = live.partition_point(|live| live.number <= change.number);
                live.truncate(kept);
                for (asked, job) in change.urgent {
                    self.jobs.order(asked, job);
                }
            }
            None => live.truncate(live.len() - self.stop.live.min(live.len())),
        }
        self.log.hand_over();
        if publication.consumed {
            live.append(&mut publication.lives);
            self.stop.live = publication.tail.len();
        }
    }
}

/// A publication under construction.
///
/// A machine that may have to leave its plan on the way gets what takes long in parts, a few of them at a time: what is left
/// of it follows as a tail, whole, which the next parts replace.
#[derive(Debug)]
struct Publication {
    committed: Vec<Element>,
    /// The stop behind them, and where its elements end.
    tail: Vec<Element>,
    ends: Vec<Place>,
    lives: VecDeque<Live>,
    /// Number that its first element has in the ring.
    begin: u64,
    /// Whether there is a machine that takes it.
    consumed: bool,
    /// Of how many steps it is.
    steps: usize,
    cut: Option<Cut>,
    /// Where what is final ends; where the stop behind it comes to rest, if there is one.
    end: Place,
    rest: Option<Place>,
}

/// An element of which only the beginning is final.
#[derive(Debug)]
struct Cut {
    step: usize,
    element: usize,
    left: Made,
}

impl Publication {
    /// Of so many steps or, if that is too much, of fewer.
    fn gather<S: Sink<Element>>(steps: &VecDeque<Step>, count: usize, sink: &S) -> Option<Publication> {
        let elements = |step: &Step| match step {
            Step::Ready(ready) => ready.elements.len(),
            Step::Window(_) => 0,
        };
        let elements = steps.range(..count).map(elements).sum();
        let mut publication = Publication {
            committed: Vec::with_capacity(elements),
            tail: Vec::new(),
            ends: Vec::new(),
            lives: VecDeque::with_capacity(elements),
            begin: sink.next_number(),
            consumed: sink.consumer_at().is_some(),
            steps: count,
            cut: None,
            end: Place { item: 0, s: 0.0 },
            rest: None,
        };
        for (step, ready) in steps.range(..count).enumerate() {
            let Step::Ready(ready) = ready else { break };
            for (element, made) in ready.elements.iter().enumerate() {
                let rests = matches!(ready.after, After::Rest) && element + 1 == ready.elements.len();
                publication.add([step, element], made, rests.then_some(ready.end));
            }
            if publication.cut.is_some() && !matches!(ready.after, After::More) {
                publication.steps = step + 1;
                break;
            }
        }
        let Step::Ready(last) = steps.get(publication.steps - 1)? else {
            return None;
        };
        publication.end = last.end;
        if let After::Stop(tail) = &last.after {
            publication.add_stop(tail);
        }
        if let Some(cut) = &publication.cut {
            publication.rest = publication.rest.or(Some(last.end));
            publication.end = cut.left.end;
        }
        Some(publication)
    }

    /// An element by its step and its place in it; `rest`: where it comes to rest, if it does.
    fn add(&mut self, [step, element]: [usize; 2], made: &Made, rest: Option<Place>) {
        if !self.consumed || (self.cut.is_none() && made.parts() == 1) {
            self.committed.push(made.element);
            self.live(made, rest);
            return;
        }
        let mut left = *made;
        if self.cut.is_none() {
            let parts = made.parts();
            let room = PARTS.saturating_sub(self.committed.len()).max(1);
            let mut taken = Vec::new();
            left.split_off(room.min(parts - 1), &mut taken);
            for part in &taken {
                self.live(part, None);
                self.committed.push(part.element);
            }
            if room < parts {
                self.cut = Some(Cut { step, element, left });
            }
        }
        if self.cut.is_some() {
            left.opens = false;
            self.tail.push(left.element);
            self.ends.push(left.end);
        } else {
            self.committed.push(left.element);
        }
        self.live(&left, rest);
    }

    fn add_stop(&mut self, Tail { elements, rest }: &Tail) {
        for (k, made) in elements.iter().enumerate() {
            let made = Made { opens: false, ..*made };
            self.live(&made, (k + 1 == elements.len()).then_some(*rest));
            self.tail.push(made.element);
            self.ends.push(made.end);
        }
        self.rest = Some(*rest);
    }

    fn live(&mut self, made: &Made, rest: Option<Place>) {
        let number = self.begin + self.lives.len() as u64;
        self.lives.push_back(Live::new(number, made, rest));
    }
}

/// Whether so many elements may be handed over: they fit, room for others in their place is left, and the machine has not too
/// much ahead of it already.
fn has_room<S: Sink<Element>>(sink: &S, count: usize) -> bool {
    match sink.consumer_at() {
        Some(at) => sink.next_number() - at < AHEAD && sink.free() >= count + RESERVE && !sink.is_full(count),
        None => !sink.is_full(count),
    }
}
