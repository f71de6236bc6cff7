//! What a whole program takes, by how far along its way the machine is.
//!
//! In:  the plan of a check, as it is made. Out: time still to come from any place on, with any setting of the overrides.
//!
//! Places are told by [`Element::way`], which overrides do not change, as they change the plan's times. Memory does not grow with the
//! program: where the table is full, every second row goes.

use motion::element::Element;
use motion::ring::Timed;
use std::sync::Arc;

/// Rows at the most; even.
const ROWS: usize = 2048;
/// Way beyond the end that is rounding, as a share of the whole: corners that wait for an override are run exactly.
const BEYOND: f64 = 0.01;

/// Times up to a place, s, without overrides.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Row {
    way: f64,
    /// Moves at feed, and rapid moves, which overrides act on.
    feed_s: f64,
    rapid_s: f64,
    /// What they do not act on: dwells, threads, probing moves, moves behind M49.
    fixed_s: f64,
}

impl Row {
    fn all_s(&self) -> f64 {
        self.feed_s + self.rapid_s + self.fixed_s
    }

    fn add(&mut self, element: &Element) {
        let duration_s = element.duration_s();
        self.way += element.way();
        match element {
            Element::Span(span) if !span.enables.feed_override => self.fixed_s += duration_s,
            Element::Span(span) if span.rapid => self.rapid_s += duration_s,
            Element::Span(_) => self.feed_s += duration_s,
            Element::Synced(_) | Element::Probing(_) | Element::Dwell { .. } | Element::Action { .. } => {
                self.fixed_s += duration_s;
            }
        }
    }
}

/// What is left of a program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Left {
    /// Share of the time without overrides that is done, 0 to 1.
    pub done: f64,
    /// With the overrides of the moment, s; `None`: one of them is at 0 and moves wait for it.
    pub time_s: Option<f64>,
}

/// The times of one program.
#[derive(Clone, Debug, Default)]
pub struct Outline {
    rows: Arc<Vec<Row>>,
    /// Length of the programmed path behind each of its first pieces.
    lead: Arc<[f64]>,
    /// Why it may take another time, whatever the overrides.
    assumes: Option<Arc<str>>,
}

impl PartialEq for Outline {
    /// Whether they are of the same check.
    fn eq(&self, other: &Outline) -> bool {
        Arc::ptr_eq(&self.rows, &other.rows) && self.assumes == other.assumes && self.lead == other.lead
    }
}

impl Outline {
    /// The same that says what it takes for granted.
    pub(super) fn assuming(self, assumes: Option<String>) -> Outline {
        Outline {
            assumes: assumes.map(Into::into),
            ..self
        }
    }

    /// The same of a program that begins so.
    pub(super) fn leading(self, lead: &Lead) -> Outline {
        Outline {
            lead: lead.lengths.clone().into(),
            ..self
        }
    }

    /// What it takes for granted: how inputs read, what programs of the user leave; `None`: nothing.
    pub fn assumes(&self) -> Option<&str> {
        self.assumes.as_deref()
    }

    /// How much longer the way of a run is than the one that was checked: it begins elsewhere, and is the same behind its first
    /// pieces. `pieces` of them are known of the run, with their length.
    fn longer(&self, (pieces, length): (u32, f64)) -> f64 {
        let checked = (pieces as usize).checked_sub(1).and_then(|at| self.lead.get(at));
        checked.map_or(0.0, |checked| length - checked)
    }

    /// What is left behind a place of a run whose path has begun so (pieces and their length), by the overrides of feed and of
    /// rapid moves (shares); `None`: the program goes on beyond its end as it was checked.
    pub fn left(&self, way: f64, lead: (u32, f64), [feed, rapid]: [f64; 2]) -> Option<Left> {
        let end = self.rows.last()?;
        let way = (way - self.longer(lead)).max(0.0);
        if way > end.way * (1.0 + BEYOND) + 1.0 {
            return None;
        }
        let here = self.at(way);
        let part = |end_s: f64, here_s: f64, share: f64| match end_s - here_s {
            left_s if left_s < 1e-9 => Some(0.0),
            left_s => (share > 0.0).then(|| left_s / share),
        };
        let moves_s = part(end.feed_s, here.feed_s, feed).zip(part(end.rapid_s, here.rapid_s, rapid));
        let done = match end.all_s() {
            0.0 => 1.0,
            all_s => (here.all_s() / all_s).clamp(0.0, 1.0),
        };
        Some(Left {
            done,
            time_s: moves_s.map(|(feed_s, rapid_s)| feed_s + rapid_s + (end.fixed_s - here.fixed_s).max(0.0)),
        })
    }

    fn at(&self, way: f64) -> Row {
        let behind = self.rows.partition_point(|row| row.way <= way);
        let before = behind.checked_sub(1).map_or(Row::default(), |at| self.rows[at]);
        let Some(next) = self.rows.get(behind) else {
            return before;
        };
        let share = ((way - before.way) / (next.way - before.way)).clamp(0.0, 1.0);
        let between = |from: f64, to: f64| from + share * (to - from);
        Row {
            way,
            feed_s: between(before.feed_s, next.feed_s),
            rapid_s: between(before.rapid_s, next.rapid_s),
            fixed_s: between(before.fixed_s, next.fixed_s),
        }
    }
}

/// Pieces of the programmed path behind which it is the same from wherever the program begins.
const LEAD_PIECES: usize = 32;

/// How a program's path begins: it may do so elsewhere than where it was checked from.
#[derive(Debug, Default)]
pub(super) struct Lead {
    lengths: Vec<f64>,
}

impl Lead {
    /// The next piece of the path.
    pub(super) fn add(&mut self, length: f64) {
        if self.lengths.len() < LEAD_PIECES {
            self.lengths.push(self.now().1 + length);
        }
    }

    /// Pieces so far, and their length.
    pub(super) fn now(&self) -> (u32, f64) {
        (self.lengths.len() as u32, self.lengths.last().copied().unwrap_or(0.0))
    }
}

/// An outline that is being made.
#[derive(Debug, Default)]
pub(super) struct Draft {
    now: Row,
    rows: Vec<Row>,
    /// Elements from row to row, and since the last one.
    every: u32,
    since: u32,
}

impl Draft {
    /// What comes next and is final.
    pub(super) fn add(&mut self, element: &Element) {
        self.now.add(element);
        self.since += 1;
        if self.since < self.every.max(1) {
            return;
        }
        self.since = 0;
        if self.rows.len() == ROWS {
            let mut number = 0_usize;
            self.rows.retain(|_| {
                number += 1;
                number.is_multiple_of(2)
            });
            self.every = 2 * self.every.max(1);
        }
        self.rows.push(self.now);
    }

    /// All of it, with the end of the plan.
    pub(super) fn finish(&self, tail: &[Element]) -> Outline {
        let mut end = self.now;
        tail.iter().for_each(|element| end.add(element));
        let mut rows = self.rows.clone();
        rows.push(end);
        Outline {
            rows: Arc::new(rows),
            lead: Arc::default(),
            assumes: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dwell(seconds: f64) -> Element {
        Element::Dwell { seconds, line: 1 }
    }

    #[test]
    fn a_million_elements_take_a_table_that_is_as_good_and_no_longer() {
        let mut draft = Draft::default();
        for _ in 0..1_000_000 {
            draft.add(&dwell(0.01));
        }
        let outline = draft.finish(&[dwell(5.0)]);
        assert!(
            outline.rows.len() <= ROWS + 1 && outline.rows.len() > ROWS / 2,
            "{}",
            outline.rows.len()
        );
        for at in [0.0, 1234.5, 9_999.0, 10_005.0] {
            let left = outline.left(at, (0, 0.0), [1.0, 1.0]).unwrap();
            assert!((left.time_s.unwrap() - (10_005.0 - at)).abs() < 1e-3, "{at}: {left:?}");
            assert!((left.done - at / 10_005.0).abs() < 1e-6, "{at}: {left:?}");
        }
        assert_eq!(outline.left(10_200.0, (0, 0.0), [1.0, 1.0]), None);
    }

    #[test]
    fn a_program_without_motion_is_done() {
        let left = Draft::default().finish(&[]).left(0.0, (0, 0.0), [0.0, 0.0]).unwrap();
        assert_eq!((left.done, left.time_s), (1.0, Some(0.0)));
    }
}
