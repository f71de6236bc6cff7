//! Where the knots of the spline are: about evenly in time.
//!
//! In:  parts of a section, with the speed that geometry allows.
//! Out: spans between knots, each on one piece, with estimated times.
//!
//! Speeds are estimated from what every place allows on its own and from what acceleration and jerk let it rise, by a forward
//! and a backward pass. What has not been passed backward from a place where the estimate is at its cap may still change when
//! more of the path comes; it waits. So knots depend on the path alone, not on how much of it was known when.

use std::collections::VecDeque;

use super::joints::{Allowed, Joints};
use super::sections::{Log, Part};
use super::solver::{JointJet, State, rise};
use crate::path::Piece;

/// Time between knots as part of the time in which acceleration builds up, and its bounds in s.
const STEP: f64 = 0.16;
const STEP_S: [f64; 2] = [0.003, 0.010];
/// Cells of a curved piece: so many in the time of a step, and at the most.
const CELLS_PER_STEP: f64 = 1.0;
const CELLS: f64 = 12.0;
/// Greatest change of b over a span, as a part of it, about.
const CHANGE: f64 = 0.6;
/// The same on straight stretches, where nothing but the speed changes. Spans grow by this part of the way to the nearer end there,
/// up to so many times the even ones.
const STRAIGHT_CHANGE: f64 = 0.3;
const STRAIGHT_GROWTH: f64 = 0.3;
const STRAIGHT_MOST: f64 = 3.0;
/// How often a span is shortened for a change.
const SHORTENINGS: u32 = 40;
/// Spans of even time at both ends of a cell; farther inside they grow by this part from one to the next. So there are no more of
/// them where motion takes hours, as it takes these because nothing changes.
const EVEN: f64 = 400.0;
const GROWTH: f64 = 0.05;
/// Fewest spans of a section, about.
const LEAST_SPANS: f64 = 60.0;
/// Part of the acceleration limit that a new plan takes at least to come down to an override, and of the jerk limit.
const EASE: [f64; 2] = [0.4, 0.5];
/// b that it may have beyond what it comes from: room for the solver, and for a speed that is the feed without its margin.
const EASE_ROOM: f64 = 1.0005;
/// Cells of the way down: time of each, as part of that in which this acceleration builds up.
const EASE_STEP: f64 = 0.4;
/// Least length of such a cell, over that of the way down to rest.
const EASE_LEAST: f64 = 2e-3;
/// Cells that wait before the passes are worth their time.
const BATCH: usize = 64;

/// A stretch of a section over which what is allowed is taken to be the same.
#[derive(Clone, Copy, Debug)]
struct Cell {
    item: u64,
    from: f64,
    to: f64,
    near: [bool; 2],
    allowed: Allowed,
    /// What b may still be for the sake of what it was, at both ends.
    ease: [f64; 2],
    /// Whether its spans may grow: joints move evenly on it.
    grows: bool,
    /// Number of the part it belongs to, counted in the section.
    part: u64,
}

impl Cell {
    fn length(&self) -> f64 {
        self.to - self.from
    }

    /// Greatest b expected after `length` of it, beginning with `b`; at most `cap`.
    fn rise(&self, b: f64, length: f64, cap: f64) -> f64 {
        rise(b, length, [self.allowed.a, self.allowed.j], cap)
    }

    /// b at a place, between known b at both ends.
    fn expected(&self, [begin, end]: [f64; 2], x: f64) -> f64 {
        let cap = self.allowed.b.max(begin.min(end));
        self.rise(end, self.length() - x, self.rise(begin, x, cap))
    }
}

/// A span between two knots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knotted {
    pub(super) item: u64,
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) near: [bool; 2],
    /// Estimated time, s.
    pub(super) time_s: f64,
    /// What b may be here even where the feed is below it, as it is at the end: motion that was faster comes down.
    pub(super) ease: f64,
}

impl Knotted {
    pub(super) fn part(&self) -> Part {
        Part {
            item: self.item,
            from: self.from,
            to: self.to,
            near: self.near,
        }
    }
}

/// The motion of another plan, where a section takes over from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TakenOver {
    /// Where the section begins.
    pub(super) state: State,
    /// Greatest b that the other plan comes to from there on before it slows down: at least that of the state.
    pub(super) crest: f64,
}

/// How motion that has been handed over comes down to the feed, however low that is.
#[derive(Clone, Copy, Debug)]
struct Ease {
    b: f64,
    /// Length before b falls: acceleration has to turn round first.
    held: f64,
    /// Length of a cell at the least: a small part of the whole way down.
    least: f64,
}

impl Ease {
    fn new(TakenOver { state, crest }: TakenOver, allowed: &Allowed) -> Ease {
        let [a, j] = [EASE[0] * allowed.a, EASE[1] * allowed.j];
        let (v, u) = (state.b.sqrt(), state.u);
        // Speed gained until acceleration is gone; no more than the other plan gains.
        let risen = (v + 0.5 * u.max(0.0) * u.max(0.0) / j).min(crest.sqrt());
        let b = EASE_ROOM * risen * risen;
        Ease {
            b,
            held: risen * ((u + a).max(0.0) / j + 0.01),
            least: EASE_LEAST * b / (2.0 * a),
        }
    }

    /// Over a length on which b is to come down to `cap`: b at both ends. Where it is there, it goes on down, for the sake of
    /// what follows with a lower cap.
    fn over(&mut self, length: f64, allowed: &Allowed, cap: f64) -> [f64; 2] {
        let begin = self.b;
        let [a, j] = [EASE[0] * allowed.a, EASE[1] * allowed.j];
        let held = self.held.min(length);
        self.held -= held;
        let mut left = length - held;
        let mut fall = |until: f64| {
            let part = left.min(((self.b - until) / (2.0 * a)).max(0.0));
            self.b -= 2.0 * a * part;
            left -= part;
            left
        };
        if cap < begin {
            // Acceleration comes back to nothing just as the cap is reached.
            let least = cap.sqrt();
            let landing = least + 0.5 * a * a / j;
            let left = fall(landing * landing);
            let v = self.b.sqrt();
            let excess = ((v - least).max(0.0).sqrt() - (0.5 * j).sqrt() * left / v).max(0.0);
            let v = least + excess * excess;
            self.b = (v * v).min(self.b);
            if left > 0.0 && excess == 0.0 {
                self.b = cap;
            }
        } else {
            fall(0.0);
        }
        [begin, self.b]
    }

    /// A length over which b changes little.
    fn step(&self, allowed: &Allowed) -> f64 {
        let turning_s = EASE[0] * allowed.a / (EASE[1] * allowed.j);
        let step = if self.held > self.least {
            self.held
        } else {
            self.b.sqrt() * EASE_STEP * turning_s
        };
        step.max(self.least)
    }
}

/// Places knots, section by section.
#[derive(Debug)]
pub(super) struct Knots {
    /// How the section takes over from another plan, and what follows from it.
    taken_over: Option<TakenOver>,
    /// Whether spans may grow on straight stretches: what brakes from the middle of another plan needs all of them.
    grows: bool,
    ease: Option<Ease>,
    cells: VecDeque<Cell>,
    /// Estimated b before the first cell: certain.
    begin: f64,
    /// Estimated b before each cell and behind the last.
    nodes: Vec<f64>,
    /// Whether spans have been given out.
    begun: bool,
    /// Cells from which on the passes are worth their time.
    due: usize,
    parts: u64,
}

impl Knots {
    /// A section that begins with this speed: at the end of a launch from rest.
    pub(super) fn new(speed: f64) -> Knots {
        Knots {
            taken_over: None,
            grows: true,
            ease: None,
            cells: VecDeque::new(),
            begin: speed * speed,
            nodes: Vec::new(),
            begun: false,
            due: BATCH,
            parts: 0,
        }
    }

    /// A section that takes over from another plan, which may be faster than the feed.
    pub(super) fn taken_over(from: TakenOver) -> Knots {
        Knots {
            taken_over: Some(from),
            grows: false,
            ..Knots::new(from.state.b.sqrt())
        }
    }

    /// The section goes on.
    pub(super) fn push(&mut self, part: Part, log: &Log, joints: &Joints, step_s: f64, jets: &mut Vec<JointJet>) {
        let Some(stretch) = log.stretch(part.item) else { return };
        let feed = log.feed(part.item);
        let cap = feed * feed;
        let slowest = log
            .kinks(part.item, part.near)
            .fold(f64::INFINITY, |least, kink| least.min(kink.speed));
        // By what the joints and kinks allow only.
        let mut allowed = |piece: &Piece, s: f64| {
            joints.jets(piece, s, jets);
            joints.allowed(jets, slowest)
        };
        let first = allowed(&stretch.piece, part.from);
        if let Some(from) = self.taken_over.take() {
            self.ease = Some(Ease::new(from, &first));
        }
        self.ease = self.ease.filter(|ease| ease.b > 0.0);
        let length = part.to - part.from;
        if joints.are_even(&stretch.piece) {
            let mut from = part.from;
            while let Some(ease) = self.ease.filter(|ease| ease.b > cap)
                && from < part.to
            {
                let step = ease.step(&first);
                let to = if part.to - from < 1.5 * step {
                    part.to
                } else {
                    from + step
                };
                self.cell(part, [from, to], first, cap, true);
                from = to;
            }
            if from < part.to {
                self.cell(part, [from, part.to], first, cap, true);
            }
        } else {
            let mut last = first;
            let middle = allowed(&stretch.piece, part.from + 0.5 * length);
            let end = allowed(&stretch.piece, part.to);
            let b = last.b.min(middle.b).min(end.b).min(cap);
            // At least one, also for what is not a number.
            let cells = (CELLS_PER_STEP * length / (b.sqrt() * step_s)).ceil().clamp(1.0, CELLS);
            let place = stretch.piece.by_parameter(part.from, part.to);
            let (cells, mut k) = (cells as u32, 0);
            // Where a cell has been divided.
            let mut divided = None;
            while k < cells {
                let [begin, end] = [k, k + 1].map(|k| place(f64::from(k) / f64::from(cells)));
                let end = if k + 1 == cells { part.to } else { end };
                let from = divided.unwrap_or(begin);
                // On the way down the feed changes sooner than the path.
                let eased = self.ease.filter(|ease| ease.b > cap).map(|ease| ease.step(&last));
                let to = match eased {
                    Some(eased) if end - from > 1.5 * eased => from + eased,
                    Some(_) | None => end,
                };
                divided = (to < end).then_some(to);
                k += u32::from(divided.is_none());
                let next = allowed(&stretch.piece, to);
                let least = Allowed {
                    b: last.b.min(next.b),
                    a: last.a.min(next.a),
                    j: last.j.min(next.j),
                };
                self.cell(part, [from, to], least, cap, false);
                last = next;
            }
        }
        self.parts += 1;
    }

    /// Adds a cell of a part, of which the joints allow so much and the feed b up to `cap`.
    fn cell(&mut self, part: Part, [from, to]: [f64; 2], allowed: Allowed, cap: f64, even: bool) {
        let ease = self
            .ease
            .as_mut()
            .map_or([0.0; 2], |ease| ease.over(to - from, &allowed, cap));
        self.cells.push_back(Cell {
            item: part.item,
            from,
            to,
            near: part.near,
            allowed: Allowed {
                b: allowed.b.min(cap.max(ease[0])),
                ..allowed
            },
            ease,
            grows: even && self.grows,
            part: self.parts,
        });
    }

    /// Where the last part that waits begins and ends; it waits as long as nothing follows it.
    pub(super) fn last_part(&self) -> Option<Part> {
        let last = self.cells.back()?;
        let first = self
            .cells
            .iter()
            .rev()
            .take_while(|cell| cell.part == last.part)
            .last()?;
        Some(Part {
            item: last.item,
            from: first.from,
            to: last.to,
            near: last.near,
        })
    }

    /// The section ends with this speed, a stop of length `stop` before its end.
    pub(super) fn trim(&mut self, stop: f64) {
        let Some(last) = self.last_part() else { return };
        let end = last.to - stop;
        while self.cells.back().is_some_and(|cell| cell.from >= end) {
            self.cells.pop_back();
        }
        if let Some(cell) = self.cells.back_mut() {
            cell.to = end;
        }
    }

    /// Gives out the spans of all cells that are certain; of all if the section ends, with the speed `exit`.
    pub(super) fn drain(&mut self, exit: Option<f64>, step_s: f64, out: &mut Vec<Knotted>) {
        if self.cells.is_empty() || (exit.is_none() && self.cells.len() < self.due) {
            return;
        }
        let certain = self.pass(exit);
        let mut step_s = step_s;
        if exit.is_some() && !self.begun {
            // All of the section is known.
            let ends = self.nodes.windows(2);
            let time_s: f64 = self
                .cells
                .iter()
                .zip(ends)
                .map(|(cell, ends)| cell.time_s([ends[0], ends[1]]))
                .sum();
            step_s = step_s.min(time_s / LEAST_SPANS);
        }
        self.begun |= certain > 0;
        for k in 0..certain {
            let Some(cell) = self.cells.pop_front() else { break };
            cell.divide([self.nodes[k], self.nodes[k + 1]], step_s, out);
        }
        self.begin = self.nodes[certain];
        self.due = 2 * self.cells.len() + BATCH;
    }

    /// Estimates b at all nodes, forward and then backward; returns how many cells are certain.
    ///
    /// As long as the end is not known, the backward pass begins with 0. Both passes are monotone in what they begin with,
    /// so where the backward pass meets the result of the forward pass nevertheless, it would do so with any other end.
    fn pass(&mut self, exit: Option<f64>) -> usize {
        let count = self.cells.len();
        self.nodes.clear();
        self.nodes.push(self.begin);
        let mut b = self.begin;
        for (k, cell) in self.cells.iter().enumerate() {
            let next = self.cells.get(k + 1).map_or(cell.allowed.b, |next| next.allowed.b);
            b = cell.rise(b, cell.length(), cell.allowed.b.min(next));
            self.nodes.push(b);
        }
        let mut certain = 0;
        let mut after = 0.0;
        if let Some(exit) = exit {
            certain = count;
            after = (exit * exit).min(self.nodes[count]);
            self.nodes[count] = after;
        } else {
            // The last part may have to give up its end for a stop.
            let last = self.cells.back().map_or(0, |cell| cell.part);
            let kept = self.cells.iter().rev().take_while(|cell| cell.part == last).count();
            let most = count - kept;
            for (k, cell) in self.cells.iter().enumerate().rev() {
                after = cell.rise(after, cell.length(), self.nodes[k]);
                if after >= self.nodes[k] && k <= most {
                    certain = k;
                    break;
                }
            }
        }
        for k in (0..certain).rev() {
            after = self.cells[k].rise(after, self.cells[k].length(), self.nodes[k]);
            self.nodes[k] = after;
        }
        certain
    }
}

impl Cell {
    /// Estimated time between known b at both ends, s.
    fn time_s(&self, ends: [f64; 2]) -> f64 {
        let middle = self.expected(ends, 0.5 * self.length());
        let speeds = [ends[0], middle, middle, ends[1]].map(f64::sqrt);
        4.0 * self.length() / speeds.iter().sum::<f64>().max(1e-9)
    }

    /// Its spans.
    fn divide(&self, ends: [f64; 2], step_s: f64, out: &mut Vec<Knotted>) {
        let length = self.length();
        // What comes down to its feed, and what lies beside a kink, stays on its spans: see `slopes`.
        let straight = self.grows && self.near == [false; 2] && self.ease == [0.0; 2];
        let (change, most) = if straight {
            (STRAIGHT_CHANGE, STRAIGHT_MOST)
        } else {
            (CHANGE, 1.0)
        };
        let mut x = 0.0;
        while x < length {
            let here = self.expected(ends, x);
            let left = length - x;
            let even = here.sqrt() * step_s;
            let grown = GROWTH * (x.min(left) - EVEN * even).max(0.0);
            let most = (1.0 + STRAIGHT_GROWTH * x.min(left) / even).min(most);
            let mut h = most * even + grown;
            for _ in 0..SHORTENINGS {
                let there = self.expected(ends, (x + h).min(length));
                let (low, high) = (here.min(there), here.max(there));
                if high <= (1.0 + change) * low {
                    h = h.min(most * low.sqrt() * step_s + grown);
                    break;
                }
                h *= 0.7;
            }
            // Never so short that it makes no progress; rounding must not leave a sliver.
            h = h.max(1e-7 * length);
            if left <= 1.25 * h {
                h = left;
            } else if left < 2.0 * h {
                h = 0.5 * left;
            }
            let to = if h >= left { length } else { x + h };
            out.push(Knotted {
                item: self.item,
                from: self.from + x,
                to: if h >= left { self.to } else { self.from + to },
                near: self.near,
                time_s: h / self.expected(ends, x + 0.5 * h).sqrt(),
                ease: self.ease[0] + (self.ease[1] - self.ease[0]) * (to.min(length) / length),
            });
            x = to;
        }
    }
}

/// Time between knots for these limits, s.
pub(super) fn step_s(joints: &Joints) -> f64 {
    let build_up = joints
        .limits()
        .iter()
        .map(|limits| limits.acceleration / limits.jerk)
        .fold(f64::INFINITY, f64::min);
    (STEP * build_up).clamp(STEP_S[0], STEP_S[1])
}
