//! What takes the place of motion in the ring when an override changes.
//!
//! In:  orders to change the override; what is in the ring.
//! Out: a place from which to plan anew, and the jobs of that plan.
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

use super::{After, Asked, Entry, Made, Place, Ready, State, Step, Stream, TakenOver};
use crate::element::{Element, Span};
use crate::plan::optimal::sections::Shares;
use crate::plan::optimal::windows::Job;
use crate::ring::{Sink, Timed};

/// Time between the end of the element that the machine is at and the place from which a new plan is made, s; where that
/// fails, it grows by the factor, and by the step.
const LEAD_S: f64 = 0.022;
const LEAD_GROWTH: (f64, f64) = (1.25, 0.005);
/// What an override of 0 is planned with: the machine creeps to where it can stop.
const LEAST: f64 = 0.01;
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
pub(super) struct Live {
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
    /// `rest`: where it comes to rest, if it does.
    pub(super) fn new(number: u64, made: &Made, rest: Option<Place>) -> Live {
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
    pub(super) zero: [bool; 2],
    /// Whether there is motion that the override forbids.
    pub(super) withholds: bool,
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

    /// Whether the machine moves where a new plan begins.
    pub(super) fn begins_in_motion(&self) -> bool {
        self.under_way.as_ref().is_some_and(|change| change.moving)
    }

    /// The element behind which a new plan comes.
    pub(super) fn behind(&self) -> Option<u64> {
        self.under_way.as_ref().map(|change| change.number)
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
        let moving = self.begins_in_motion();
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
    pub(super) fn begin_change(&mut self, sink: &mut dyn Sink<Element>) {
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
    fn forget_passed(&mut self, sink: &dyn Sink<Element>) {
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
    pub(super) fn take_over(&mut self, sink: &mut dyn Sink<Element>, later: bool) {
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

    /// Keeps in mind what is in the ring now; the last `stop` of these are the stop behind it.
    pub(super) fn published(&mut self, lives: &mut VecDeque<Live>, stop: usize, consumed: bool) {
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
        if consumed {
            live.append(lives);
            self.stop.live = stop;
        }
    }
}
