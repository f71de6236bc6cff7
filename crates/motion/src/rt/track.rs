//! The plan as a track: one element after the other, forward, and backward over those that have been run.
//!
//! In:  elements of the ring. Out: the current one, those that follow, and how far there is a way back.
//!
//! Passed elements are kept in memory that [`Track::new`] takes. There is no way back over an action, a move in step with
//! the spindle, a probing move, or a place at which the spindle, say, was told something on the way: what a tool changer or a tap
//! has done is not undone by going back. RT.

use crate::element::{Action, Auxiliary, Element, Span};
use crate::ring::{Consumer, Timed};

#[derive(Clone, Copy, Debug)]
struct Passed {
    element: Element,
    /// Plan time of all spans before it, s: dwells take no time on the way back.
    moved_s: f64,
}

/// Where the machine is among the elements of the plan; they are numbered from 0 in the order in which they come.
#[derive(Debug)]
pub(super) struct Track {
    consumer: Consumer<Element>,
    /// The element of a number is at its remainder.
    passed: Box<[Passed]>,
    /// Elements taken from the ring.
    taken: u64,
    /// Plan time of all spans taken, s.
    moved_s: f64,
    /// The first element over which there is a way back.
    floor: u64,
    /// The element behind the current one.
    next: u64,
    /// There is no current element: at rest behind the one before `next`.
    between: bool,
    /// Auxiliary functions of the last span taken.
    auxiliary: Auxiliary,
}

impl Track {
    /// Before the first element; keeps this many for the way back.
    pub(super) fn new(consumer: Consumer<Element>, kept: usize) -> Track {
        let nothing = Passed {
            element: Element::Dwell { seconds: 0.0, line: 0 },
            moved_s: 0.0,
        };
        Track {
            consumer,
            passed: vec![nothing; kept.max(1)].into_boxed_slice(),
            taken: 0,
            moved_s: 0.0,
            floor: 0,
            next: 0,
            between: true,
            auxiliary: Auxiliary::INITIAL,
        }
    }

    /// The element that the machine is at.
    pub(super) fn current(&self) -> Option<&Element> {
        match self.between {
            true => None,
            false => self.last(),
        }
    }

    /// The current element, or the one behind which the machine rests.
    pub(super) fn last(&self) -> Option<&Element> {
        self.get(self.next.checked_sub(1)?)
    }

    /// Number of the element behind the current one.
    pub(super) fn next(&self) -> u64 {
        self.next
    }

    /// Leaves the current element, at rest behind it.
    pub(super) fn leave(&mut self) {
        self.between = true;
    }

    /// Goes on to the next element; where there is none, the current one is left.
    pub(super) fn forward(&mut self) -> Option<&Element> {
        if self.next == self.taken {
            match self.consumer.advance() {
                Some(element) => self.append(element),
                None => {
                    self.between = true;
                    return None;
                }
            }
        }
        self.next += 1;
        self.between = false;
        self.current()
    }

    /// Goes back to the element before; `None`: there is no way back.
    pub(super) fn back(&mut self) -> Option<&Element> {
        let next = if self.between { self.next } else { self.next - 1 };
        if next <= self.floor {
            return None;
        }
        self.next = next;
        self.between = false;
        self.current()
    }

    /// What follows, as things are now.
    pub(super) fn following(&self) -> impl Iterator<Item = &Element> {
        let kept = (self.next..self.taken).filter_map(|number| self.get(number));
        kept.chain(self.consumer.ahead())
    }

    /// What lies before the current element, or before the place between two, with its number: the nearest first, as far as
    /// there is a way back.
    pub(super) fn preceding(&self) -> impl Iterator<Item = (u64, &Element)> {
        let end = if self.between { self.next } else { self.next - 1 };
        let numbers = self.floor.min(end)..end;
        numbers.rev().filter_map(|number| Some((number, self.get(number)?)))
    }

    /// Plan time until the end of the way back, s; `time_s`: since the beginning of the current element.
    pub(super) fn way_back_s(&self, time_s: f64) -> f64 {
        let (number, time_s) = match self.current() {
            Some(Element::Span(_)) => (self.next - 1, time_s),
            Some(Element::Dwell { .. }) => (self.next - 1, 0.0),
            // What lies behind the machine then is below the floor, or all of the element before.
            Some(Element::Action { .. } | Element::Synced(_) | Element::Probing(_)) | None => (self.next, 0.0),
        };
        if number < self.floor {
            return 0.0;
        }
        self.moved_before(number) - self.moved_before(self.floor) + time_s
    }

    /// Whether the plan is at rest at the end of the way back.
    pub(super) fn rests_at_floor(&self) -> bool {
        match self.get(self.floor) {
            Some(Element::Span(span)) => begins_at_rest(span),
            Some(Element::Dwell { .. } | Element::Action { .. } | Element::Synced(_) | Element::Probing(_)) | None => {
                true
            }
        }
    }

    /// Seconds of everything planned so far.
    pub(super) fn published_s(&self) -> f64 {
        self.consumer.published_s()
    }

    fn append(&mut self, element: Element) {
        let place = self.place(self.taken);
        self.passed[place] = Passed {
            element,
            moved_s: self.moved_s,
        };
        if let Element::Span(span) = &element
            && std::mem::replace(&mut self.auxiliary, span.auxiliary) != span.auxiliary
        {
            self.floor = self.taken;
        }
        self.taken += 1;
        match element {
            Element::Span(_) => self.moved_s += element.duration_s(),
            Element::Dwell { .. }
            | Element::Action {
                action: Action::Modes { .. },
                ..
            } => {}
            Element::Action { .. } | Element::Synced(_) | Element::Probing(_) => self.floor = self.taken,
        }
        self.floor = self.floor.max(self.taken.saturating_sub(self.passed.len() as u64));
    }

    fn get(&self, number: u64) -> Option<&Element> {
        let kept = number < self.taken && self.taken - number <= self.passed.len() as u64;
        kept.then(|| &self.passed[self.place(number)].element)
    }

    /// Plan time of all spans before an element that is kept, or before the next one to be taken.
    fn moved_before(&self, number: u64) -> f64 {
        if number == self.taken {
            self.moved_s
        } else {
            self.passed[self.place(number)].moved_s
        }
    }

    fn place(&self, number: u64) -> usize {
        (number % self.passed.len() as u64) as usize
    }
}

/// Whether the plan is at rest where a span begins.
pub(super) fn begins_at_rest(span: &Span) -> bool {
    span.v0 == 0.0 && span.a0 == 0.0
}
