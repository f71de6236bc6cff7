//! Events that wait until the caller fetches them.
//!
//! In:  events. Out: the same, in order; a count of those that found no room.
//! RT: no allocation, no locks, bounded.

use super::super::event::Event;

/// Events that wait.
const MAX: usize = 128;

/// A ring of events.
#[derive(Clone, Debug)]
pub(super) struct Events {
    ring: [Option<Event>; MAX],
    first: usize,
    count: usize,
    /// Those that found no room.
    pub(super) dropped: u32,
}

impl Events {
    pub(super) const NONE: Events = Events {
        ring: [None; MAX],
        first: 0,
        count: 0,
        dropped: 0,
    };

    pub(super) fn push(&mut self, event: Event) {
        if self.count == MAX {
            self.dropped = self.dropped.saturating_add(1);
            return;
        }
        self.ring[(self.first + self.count) % MAX] = Some(event);
        self.count += 1;
    }

    /// What others send at will leaves half of the room to what the main device finds.
    pub(super) fn push_unasked(&mut self, event: Event) {
        if self.count < MAX / 2 {
            self.push(event);
        } else {
            self.dropped = self.dropped.saturating_add(1);
        }
    }

    pub(super) fn pop(&mut self) -> Option<Event> {
        let event = self.ring[self.first].take()?;
        self.first = (self.first + 1) % MAX;
        self.count -= 1;
        Some(event)
    }
}
