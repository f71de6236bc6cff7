//! Cuts the path into sections: stretches between rests.
//!
//! In:  the smoothed path, item by item, kept in a [`Log`] until it has been handed over.
//! Out: the same as [`Found`]: parts of sections, and what lies between sections.
//!
//! Sections begin and end at rest. Where direction or curvature jumps a little, a section goes on, with parts of their own for
//! the zones in which the jump takes some of the limits (see [`junctions`](crate::plan::junctions)).

use std::collections::VecDeque;

use crate::element::Element;
use crate::plan::junctions::{Kink, Meeting};
use crate::plan::smooth::Stretch;
use crate::plan::smooth::round::distance;

/// One thing after the other, as it came.
#[derive(Debug)]
pub(super) enum Item {
    Stretch(Box<Stretch>),
    /// The machine comes to rest, and does something there or not.
    Rest(Option<Box<Element>>),
}

/// What a speed that is programmed is multiplied by, each greater than 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shares {
    /// Feed of all but rapid moves.
    pub(super) feed: f64,
    /// Speed limits of the joints on rapid moves; at most 1.
    pub(super) rapid: f64,
}

/// A place on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Number of the item.
    pub(super) item: u64,
    /// Where on its piece, mm.
    pub(super) s: f64,
}

/// What came, as long as it may have to be planned or planned again.
#[derive(Debug)]
pub(super) struct Log {
    /// Number of the first item that is kept.
    first: u64,
    items: VecDeque<Kept>,
    seams: VecDeque<Seam>,
    pub(super) shares: Shares,
    /// Whether moves at feed, and rapid ones, wait until they may begin, where overrides act on them.
    pub(super) held: [bool; 2],
}

/// What came.
#[derive(Debug)]
pub(super) struct Kept {
    pub(super) item: Item,
    /// Least speed along it at which a joint reaches its speed limit, where the override of rapid moves acts; else infinite.
    pub(super) rapid: f64,
    /// With the item before, if both are stretches.
    pub(super) meeting: Meeting,
}

impl Kept {
    pub(super) fn rest(element: Option<Box<Element>>) -> Kept {
        Kept {
            item: Item::Rest(element),
            rapid: f64::INFINITY,
            meeting: Meeting::Smooth,
        }
    }
}

/// A corner between a rapid move and one at feed: two items, which are rounded, or the way over the corner itself.
#[derive(Debug)]
struct Seam {
    /// Number of the first.
    item: u64,
    /// The way that is not taken.
    other: [Kept; 2],
    /// Whether the way over the corner itself is taken: in what is planned, and in what has been handed over.
    exact: bool,
    handed_exact: bool,
}

impl Log {
    pub(super) fn new() -> Log {
        Log {
            first: 0,
            items: VecDeque::new(),
            seams: VecDeque::new(),
            shares: Shares { feed: 1.0, rapid: 1.0 },
            held: [false; 2],
        }
    }

    /// Takes the next item.
    pub(super) fn push(&mut self, kept: Kept) {
        self.items.push_back(kept);
    }

    /// Takes a seam: both ways over it.
    pub(super) fn push_seam(&mut self, [rounded, exact]: [[Kept; 2]; 2]) {
        let item = self.end();
        let waits = self.waits_between(&exact[0], &exact[1]);
        let (taken, other) = if waits { (exact, rounded) } else { (rounded, exact) };
        self.items.extend(taken);
        self.seams.push_back(Seam {
            item,
            other,
            exact: waits,
            handed_exact: false,
        });
    }

    /// What follows this place is planned anew: the machine goes to a corner itself if it waits there. What lies before it, and
    /// a seam that has begun there, are as they were handed over.
    pub(super) fn choose_ways(&mut self, from: Place) {
        for k in 0..self.seams.len() {
            let seam = &self.seams[k];
            let ahead = seam.item > from.item || (seam.item == from.item && from.s <= 0.0);
            let wanted = if ahead {
                self.waits_between(&seam.other[0], &seam.other[1])
            } else {
                seam.handed_exact
            };
            if wanted == seam.exact {
                continue;
            }
            let seam = &mut self.seams[k];
            seam.exact = wanted;
            for (item, other) in (seam.item..).zip(&mut seam.other) {
                // The first one may have been passed.
                let index = item
                    .checked_sub(self.first)
                    .and_then(|index| usize::try_from(index).ok());
                if let Some(kept) = index.and_then(|index| self.items.get_mut(index)) {
                    std::mem::swap(kept, other);
                }
            }
        }
    }

    /// What is planned has been handed over.
    pub(super) fn hand_over(&mut self) {
        for seam in &mut self.seams {
            seam.handed_exact = seam.exact;
        }
    }

    /// Whether the second of two items is held and the first is not.
    fn waits_between(&self, first: &Kept, second: &Kept) -> bool {
        !self.holds(first) && self.holds(second)
    }

    fn holds(&self, kept: &Kept) -> bool {
        match &kept.item {
            Item::Stretch(stretch) => stretch.enables.feed_override && self.held[usize::from(stretch.rapid)],
            Item::Rest(_) => false,
        }
    }

    /// The item that came last, while it is kept.
    pub(super) fn last(&self) -> Option<&Item> {
        self.items.back().map(|kept| &kept.item)
    }

    /// Whether the path cannot be passed at speed where this item begins.
    pub(super) fn stops_before(&self, item: u64) -> bool {
        let Some(kept) = self.kept(item) else { return false };
        let before = item.checked_sub(1).and_then(|before| self.kept(before));
        matches!(kept.meeting, Meeting::Stop) || before.is_some_and(|before| self.waits_between(before, kept))
    }

    /// The kink where this item begins, if there is one that can be passed at speed.
    pub(super) fn kink_before(&self, item: u64) -> Option<&Kink> {
        match self.kept(item) {
            Some(Kept {
                meeting: Meeting::Slow(kink),
                ..
            }) => Some(kink),
            _ => None,
        }
    }

    /// The kinks in whose zones a part of this item lies.
    pub(super) fn kinks(&self, item: u64, near: [bool; 2]) -> impl Iterator<Item = &Kink> {
        let ends = [item, item + 1].into_iter().zip(near);
        ends.filter_map(|(item, near)| if near { self.kink_before(item) } else { None })
    }

    fn kept(&self, item: u64) -> Option<&Kept> {
        let index = item.checked_sub(self.first)?;
        self.items.get(usize::try_from(index).ok()?)
    }

    pub(super) fn get(&self, item: u64) -> Option<&Item> {
        self.kept(item).map(|kept| &kept.item)
    }

    /// The stretch of this number; items of sections are always stretches.
    pub(super) fn stretch(&self, item: u64) -> Option<&Stretch> {
        match self.get(item) {
            Some(Item::Stretch(stretch)) => Some(stretch),
            Some(Item::Rest(_)) | None => None,
        }
    }

    /// Greatest speed along a stretch, override included, mm/s; infinite where only the joints limit it.
    pub(super) fn feed(&self, item: u64) -> f64 {
        match self.kept(item) {
            Some(Kept {
                item: Item::Stretch(stretch),
                rapid,
                ..
            }) => {
                let Shares {
                    feed: of_feed,
                    rapid: of_rapid,
                } = self.shares;
                let by_rapid = if of_rapid < 1.0 {
                    rapid * of_rapid
                } else {
                    f64::INFINITY
                };
                match (stretch.enables.feed_override, stretch.seam, stretch.rapid) {
                    (false, ..) => stretch.feed,
                    (true, true, _) => by_rapid.min(stretch.feed * of_feed),
                    (true, false, true) => by_rapid,
                    (true, false, false) => stretch.feed * of_feed,
                }
            }
            Some(Kept {
                item: Item::Rest(_), ..
            })
            | None => 0.0,
        }
    }

    /// Forgets what lies before this item.
    pub(super) fn drop_before(&mut self, item: u64) {
        while self.first < item && self.items.pop_front().is_some() {
            self.first += 1;
        }
        while self.seams.front().is_some_and(|seam| seam.item + 1 < self.first) {
            self.seams.pop_front();
        }
    }

    /// Number of the first item that is kept.
    pub(super) fn begin(&self) -> u64 {
        self.first
    }

    /// Number of the next item that comes.
    pub(super) fn end(&self) -> u64 {
        self.first + self.items.len() as u64
    }
}

/// Part of a stretch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Part {
    pub(super) item: u64,
    pub(super) from: f64,
    pub(super) to: f64,
    /// Whether it lies in the zone of the kink at the beginning and at the end of the stretch.
    pub(super) near: [bool; 2],
}

/// What there is between two sections.
#[derive(Clone, Copy, Debug)]
pub(super) enum Found {
    /// The section goes on.
    Part(Part),
    /// The section ends, at rest.
    End,
    /// Between two sections: item `item` happens.
    Rest { item: u64 },
}

/// What is shorter is made part of what lies beside it: knots so near to each other mean nothing. Nothing of the path is left out.
const SLIVER: f64 = 1e-9;
/// What is shorter, over the zone beside it, is made part of that zone: knots are about even.
const NARROW: f64 = 0.5;

/// Finds sections, with one stretch of delay.
#[derive(Debug)]
pub(super) struct Sections {
    /// Next item to look at.
    next: u64,
    /// From where on the path has not been given out yet: what lies behind depends on how it goes on.
    last: Option<Place>,
    /// Whether parts have been given out since the last end.
    open: bool,
}

impl Sections {
    /// Begins at a place.
    pub(super) fn new(from: Place, log: &Log) -> Sections {
        let stretch = log.stretch(from.item);
        Sections {
            next: from.item + u64::from(stretch.is_some()),
            last: stretch.map(|_| from),
            open: false,
        }
    }

    /// Goes on to the next item; false where there is none.
    pub(super) fn step(&mut self, log: &Log, out: &mut Vec<Found>) -> bool {
        let Some(item) = log.get(self.next) else {
            return false;
        };
        if let Some(last) = self.last.take() {
            self.parts(last, log, out);
        }
        match item {
            Item::Stretch(_) => {
                if log.stops_before(self.next) {
                    self.close(out);
                }
                self.last = Some(Place {
                    item: self.next,
                    s: 0.0,
                });
            }
            Item::Rest(_) => {
                self.close(out);
                out.push(Found::Rest { item: self.next });
            }
        }
        self.next += 1;
        true
    }

    fn close(&mut self, out: &mut Vec<Found>) {
        if self.open {
            self.open = false;
            out.push(Found::End);
        }
    }

    /// A stretch from a place on, cut where the zones of the kinks at its ends end and begin.
    fn parts(&mut self, Place { item, s }: Place, log: &Log, out: &mut Vec<Found>) {
        let Some(stretch) = log.stretch(item) else { return };
        let length = stretch.piece.length();
        let mut zones = [item, item + 1].map(|item| log.kink_before(item).map_or(0.0, |kink| kink.zone));
        // The wider one is that of the faster kink: there, a zone that is longer than it must be costs less.
        let wide = usize::from(zones[1] > zones[0]);
        let narrow = 1 - wide;
        let between = length - zones[0] - zones[1];
        if zones[wide] > 0.0 && between < 0.0 {
            zones[wide] = length;
            if length - zones[narrow] < NARROW * zones[narrow] {
                zones[narrow] = length;
            }
        } else if between < NARROW * zones[wide] {
            zones[wide] += between;
        }
        let (begin, end) = (zones[0], length - zones[1]);
        // Of a piece of which all but what rounding leaves has been handed over nothing is left: nothing moves by that.
        let rounding = length - s <= SLIVER && s > 0.0 && {
            let [here, there] = [s, length].map(|s| stretch.piece.position(s));
            distance(&here.0, &there.0) <= SLIVER
        };
        let mut from = if rounding { length } else { s };
        for to in [begin.min(end), begin.max(end), length] {
            let is_cut = to - from > SLIVER && length - to > SLIVER;
            if is_cut || (to == length && to > from) {
                let middle = 0.5 * (from + to);
                self.open = true;
                out.push(Found::Part(Part {
                    item,
                    from,
                    to,
                    near: [middle < begin, middle > end],
                }));
                from = to;
            }
        }
    }
}
