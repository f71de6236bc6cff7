//! What is handed over when.
//!
//! In:  planned motion.
//! Out: publications to a ring.

use std::collections::VecDeque;

use super::changes::Live;
use super::{AHEAD, After, Entry, Made, PUBLICATION, Place, RESERVE, Ready, Step, Stream, Tail};
use crate::element::Element;
use crate::ring::{Publish, Sink};

/// With so many elements, parts of those that take long end a publication.
const PARTS: usize = 4096;

impl Stream {
    /// Steps that make one publication; 0 if none can be made.
    pub(super) fn next_publication(&self, urgent: bool) -> usize {
        let (mut count, mut steps) = (0, 0);
        let changing = self.changes.begins_in_motion();
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
    pub(super) fn publish(&mut self, sink: &mut dyn Sink<Element>) -> Option<Publish> {
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
    fn hand_in(&mut self, publication: &mut Publication, sink: &mut dyn Sink<Element>) -> Option<Publish> {
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
        let result = match self.changes.behind() {
            Some(number) => sink.publish_after(number, committed, tail),
            None if !has_room(sink, count) => Publish::Full,
            None => sink.publish(committed, tail),
        };
        self.refused = if result == Publish::Full { count } else { 0 };
        if result == Publish::Done {
            self.gate.handed_over();
            self.published(&mut publication.lives, publication.tail.len(), publication.consumed);
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
    pub(super) fn forget_plans(&mut self) {
        self.steps.clear();
        self.pending.clear();
        self.jobs.forget();
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
    fn gather(steps: &VecDeque<Step>, count: usize, sink: &dyn Sink<Element>) -> Option<Publication> {
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
fn has_room(sink: &dyn Sink<Element>, count: usize) -> bool {
    match sink.consumer_at() {
        Some(at) => sink.next_number() - at < AHEAD && sink.free() >= count + RESERVE && !sink.is_full(count),
        None => !sink.is_full(count),
    }
}
