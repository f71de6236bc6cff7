//! Cuts the path into sections: stretches of continuous direction and curvature between places of known speed.
//!
//! In:  the smoothed path, item by item, kept in a [`Log`] until it has been handed over.
//! Out: the same as [`Found`]: parts of sections, and what lies between sections.
//!
//! At a rest the speed is 0. Where direction or curvature jumps a little, the machine passes at a speed that is slow enough
//! for the jump, constant over a short zone on both sides (see [`junctions`](crate::plan::junctions)).

use std::collections::VecDeque;

use crate::element::Element;
use crate::plan::Settings;
use crate::plan::junctions::{Meeting, meeting};
use crate::plan::smooth::Stretch;

/// One thing after the other, as it came.
#[derive(Clone, Copy, Debug)]
pub(super) enum Item {
    Stretch(Stretch),
    /// The machine comes to rest, and does something there or not.
    Rest(Option<Element>),
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
    pub(super) shares: Shares,
}

/// An item, and the speed that joints allow on it if it is a rapid move.
#[derive(Clone, Copy, Debug)]
struct Kept {
    item: Item,
    rapid: f64,
}

impl Log {
    pub(super) fn new() -> Log {
        Log {
            first: 0,
            items: VecDeque::new(),
            shares: Shares { feed: 1.0, rapid: 1.0 },
        }
    }

    /// Takes the next item; `rapid`: the least speed along it at which a joint reaches its speed limit.
    pub(super) fn push(&mut self, item: Item, rapid: f64) {
        self.items.push_back(Kept { item, rapid });
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
            Some(&Kept {
                item: Item::Stretch(stretch),
                rapid,
            }) => match (stretch.rapid, stretch.enables.feed_override) {
                (_, false) => stretch.feed,
                (true, true) if self.shares.rapid < 1.0 => rapid * self.shares.rapid,
                (true, true) => stretch.feed,
                (false, true) => stretch.feed * self.shares.feed,
            },
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) item: u64,
    pub(super) from: f64,
    pub(super) to: f64,
}

/// What there is between two sections.
#[derive(Clone, Copy, Debug)]
pub(super) enum Found {
    /// The section goes on.
    Part(Part),
    /// The section ends at this speed; the next one begins with it.
    End { speed: f64 },
    /// Between two sections: constant speed.
    Zone {
        part: Part,
        speed: f64,
        /// Whether it lies behind the kink.
        behind: bool,
    },
    /// Between two sections that end and begin at rest: item `item` happens.
    Rest { item: u64 },
}

/// What is shorter is left out: no position of a drive is as fine, and knots so near to each other mean nothing.
const SLIVER_MM: f64 = 1e-9;

/// Finds sections, with one stretch of delay.
#[derive(Debug)]
pub(super) struct Sections {
    /// Next item to look at.
    next: u64,
    /// What is not yet known to be part of the section up to its end.
    last: Option<Part>,
    /// Whether parts have been given out since the last end.
    open: bool,
    /// Path of `last` before the place from which it is planned: it was there when the zone at its end was laid out.
    before: f64,
}

impl Sections {
    /// Begins at a place at rest.
    pub(super) fn new(from: Place, log: &Log) -> Sections {
        let last = log.stretch(from.item).map(|stretch| Part {
            item: from.item,
            from: from.s,
            to: stretch.piece.length(),
        });
        Sections {
            next: from.item + u64::from(last.is_some()),
            last: last.filter(|part| part.to > part.from),
            open: false,
            before: 0.0,
        }
    }

    /// Begins at a place that is passed in motion.
    pub(super) fn in_motion(from: Place, log: &Log) -> Sections {
        Sections {
            before: from.s,
            ..Sections::new(from, log)
        }
    }

    /// Goes on to the next item; false where there is none.
    pub(super) fn step(&mut self, log: &Log, settings: &Settings, out: &mut Vec<Found>) -> bool {
        let Some(item) = log.get(self.next) else {
            return false;
        };
        match item {
            Item::Stretch(stretch) => {
                let mut next = Part {
                    item: self.next,
                    from: 0.0,
                    to: stretch.piece.length(),
                };
                if let Some(last) = self.last.take()
                    && let Some(before) = log.stretch(last.item)
                {
                    let feeds = [log.feed(last.item), log.feed(self.next)];
                    let [before, stretch] =
                        [(before, feeds[0]), (stretch, feeds[1])].map(|(stretch, feed)| Stretch { feed, ..*stretch });
                    self.meet(last, &before, &mut next, &stretch, settings, out);
                }
                self.last = Some(next);
            }
            Item::Rest(_) => {
                self.close(0.0, out);
                out.push(Found::Rest { item: self.next });
            }
        }
        self.next += 1;
        self.before = 0.0;
        true
    }

    fn part(&mut self, part: Part, out: &mut Vec<Found>) {
        if part.to - part.from > SLIVER_MM {
            self.open = true;
            out.push(Found::Part(part));
        }
    }

    fn close(&mut self, speed: f64, out: &mut Vec<Found>) {
        if let Some(last) = self.last.take() {
            self.part(last, out);
        }
        if self.open {
            self.open = false;
            out.push(Found::End { speed });
        }
    }

    fn meet(
        &mut self,
        last: Part,
        before: &Stretch,
        next: &mut Part,
        after: &Stretch,
        settings: &Settings,
        out: &mut Vec<Found>,
    ) {
        let lengths = [last.to - last.from + self.before, next.to - next.from];
        match meeting(before, after, lengths, settings) {
            Meeting::Smooth => self.part(last, out),
            Meeting::Slow { speed, zone } => {
                let (end, begin) = (last.to - zone, next.from + zone);
                self.part(Part { to: end, ..last }, out);
                self.open = true;
                self.close(speed, out);
                out.push(Found::Zone {
                    part: Part { from: end, ..last },
                    speed,
                    behind: false,
                });
                out.push(Found::Zone {
                    part: Part { to: begin, ..*next },
                    speed,
                    behind: true,
                });
                next.from = begin;
            }
            Meeting::Stop => {
                self.part(last, out);
                self.close(0.0, out);
            }
        }
    }
}
