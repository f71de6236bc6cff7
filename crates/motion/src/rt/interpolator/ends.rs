//! Where plan time is to end: at the end of a block, on the way back at its beginning or where there is no way back.

use super::Interpolator;
use crate::element::Element;
use crate::ring::Timed;
use crate::rt::track::begins_at_rest;

/// Elements ahead among which the end of a block is looked for in one cycle.
const BLOCK_ELEMENTS: usize = 256;

/// At rest, at the end of what was to be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrived {
    /// At the end of a block, on the way back at its beginning.
    Block,
    /// Where there is no way back.
    WayBack,
}

/// Where plan time is to end for now.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    pub(super) what: Arrived,
    /// Number of the element behind it.
    pub(super) next: u64,
    /// Plan time until there, s.
    pub(super) way_s: f64,
    /// Whether the plan itself is at rest there.
    pub(super) rests: bool,
}

impl Interpolator {
    /// Where plan time is to end for now, if that is near.
    pub(super) fn end(&self) -> Option<End> {
        let way_back = || {
            Some(End {
                what: Arrived::WayBack,
                next: 0,
                way_s: self.track.way_back_s(self.time_s),
                rests: self.track.rests_at_floor(),
            })
        };
        match (self.backward, self.single_block) {
            (true, true) => self.block_begin().or_else(way_back),
            (true, false) => way_back(),
            (false, true) => self.block_end(),
            (false, false) => None,
        }
    }

    /// The end of the block under way: the next change of line at which there can be a stop.
    fn block_end(&self) -> Option<End> {
        let mut following = self.track.following();
        let mut next = self.track.next();
        let (mut before, mut way_s) = match self.track.current().filter(|_| !self.leaves) {
            Some(element) => (element, element.duration_s() - self.time_s),
            None => {
                let begun = following.next()?;
                let before = self.track.last().filter(|_| !self.leaves);
                if before.is_some_and(|before| before.line() != begun.line()) {
                    return Some(End {
                        what: Arrived::Block,
                        next,
                        way_s: 0.0,
                        rests: true,
                    });
                }
                next += 1;
                (begun, begun.duration_s())
            }
        };
        for element in following.take(BLOCK_ELEMENTS) {
            if element.line() != before.line() {
                let rests = match (before, element) {
                    (Element::Span(_), Element::Span(span)) => begins_at_rest(span),
                    _ => true,
                };
                if rests || self.ramp.can_rest_in(way_s) {
                    return Some(End {
                        what: Arrived::Block,
                        next,
                        way_s,
                        rests,
                    });
                }
            }
            // There the share may change at once, and the rest of the way is looked at again. Nor is what is far of interest.
            let stands = !matches!(element, Element::Span(_) | Element::Dwell { .. });
            if stands || way_s > 2.0 * self.ramp.ramp_s() {
                return None;
            }
            way_s += element.duration_s();
            next += 1;
            before = element;
        }
        None
    }

    /// The same on the way back: the last change of line, between spans, at which there can be a stop.
    fn block_begin(&self) -> Option<End> {
        let span = |(number, element): (u64, &Element)| match element {
            Element::Span(span) => Some((number, *span)),
            // It takes no time on the way back; beyond the others there is none.
            Element::Dwell { .. } | Element::Action { .. } | Element::Synced(_) | Element::Probing(_) => None,
        };
        let mut preceding = self.track.preceding().filter_map(span);
        let current = self.track.current().filter(|_| !self.leaves);
        let under_way = current.and_then(|current| span((self.track.next() - 1, current)));
        let (mut way_s, (mut next, mut begun)) = match under_way {
            Some(begun) => (self.time_s, begun),
            None => {
                let (number, begun) = preceding.next()?;
                (begun.duration_s, (number, begun))
            }
        };
        for (number, before) in preceding.take(BLOCK_ELEMENTS) {
            if before.line != begun.line {
                let rests = begins_at_rest(&begun);
                if rests || self.ramp.can_rest_in(way_s) {
                    return Some(End {
                        what: Arrived::Block,
                        next,
                        way_s,
                        rests,
                    });
                }
            }
            if way_s > 2.0 * self.ramp.ramp_s() {
                return None;
            }
            way_s += before.duration_s;
            (next, begun) = (number, before);
        }
        None
    }
}
