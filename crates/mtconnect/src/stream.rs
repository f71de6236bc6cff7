//! An answer that goes on: parts of `multipart/mixed`, when there is something to tell, and now and then as a sign of life.

use crate::agent::{Agent, Filter};
use crate::document::Document;
use std::time::Duration;

/// What stands between two parts.
const BOUNDARY: &str = "isocnc-mtconnect-part";

/// When parts come.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Every {
    interval: Duration,
    heartbeat: Duration,
}

impl Every {
    pub(crate) fn of(interval_ms: u64, heartbeat_ms: u64) -> Every {
        Every {
            interval: Duration::from_millis(interval_ms),
            heartbeat: Duration::from_millis(heartbeat_ms),
        }
    }
}

/// A stream, between two parts.
#[derive(Debug)]
pub struct Stream {
    filter: Filter,
    every: Every,
    /// The next observation, and how many a part has; `None`: how everything is, each time.
    from: Option<(u64, u64)>,
    told: Option<Duration>,
    is_over: bool,
}

impl Stream {
    pub(crate) fn current(filter: Filter, every: Every) -> Stream {
        Stream {
            filter,
            every,
            from: None,
            told: None,
            is_over: false,
        }
    }

    pub(crate) fn sample(filter: Filter, every: Every, from: u64, count: u64) -> Stream {
        let from = Some((from, count));
        Stream {
            from,
            ..Stream::current(filter, every)
        }
    }

    /// `Content-Type` of the whole answer.
    pub fn content_type() -> String {
        format!("multipart/mixed;boundary={BOUNDARY}")
    }

    /// Whether nothing more comes: a client that reads too slowly has lost what was next.
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    /// The next part, if there is one now; to be asked for as often as parts may come. `now`: since 1970.
    pub fn part(&mut self, agent: &Agent, now: Duration) -> Option<Vec<u8>> {
        let since = self.told.map(|told| now.saturating_sub(told));
        if self.is_over || since.is_some_and(|since| since < self.every.interval) {
            return None;
        }
        let Some((from, count)) = self.from else {
            // An interval of 0 is that of whoever asks.
            self.told = Some(now);
            return Some(part(&agent.now(&self.filter, now)));
        };
        if let Some(error) = agent.lost(from, now) {
            self.is_over = true;
            return Some(part(&error));
        }
        let (document, next, found) = agent.sample(from, None, count, &self.filter, now);
        // Others have been passed over.
        self.from = Some((next, count));
        if found == 0 && since.is_some_and(|since| since < self.every.heartbeat) {
            return None;
        }
        self.told = Some(now);
        Some(part(&document))
    }
}

fn part(document: &Document) -> Vec<u8> {
    let Document { xml, .. } = document;
    let length = xml.len();
    format!("--{BOUNDARY}\r\nContent-type: text/xml\r\nContent-length: {length}\r\n\r\n{xml}\r\n").into_bytes()
}
