//! Where the knots of the spline are: about evenly in time.
//!
//! In:  parts of a section, with the speed that geometry allows.
//! Out: spans between knots, each on one piece, with estimated times.
//!
//! Speeds are estimated from what every place allows on its own and from a part of the acceleration limit, by a forward and
//! a backward pass. What has not been passed backward from a place where the estimate is at its cap may still change when
//! more of the path comes; it waits. So knots depend on the path alone, not on how much of it was known when.

use std::collections::VecDeque;

use super::joints::{Allowed, Joints};
use super::sections::{Log, Part};
use super::solver::JointJet;
use crate::path::Piece;

/// Time between knots as part of the time in which acceleration builds up, and its bounds in s.
const STEP: f64 = 0.16;
const STEP_S: [f64; 2] = [0.001, 0.010];
/// Part of the acceleration limit with which speeds are estimated: less than all, for there is jerk as well.
const PACE: f64 = 0.6;
/// Cells of a curved piece: so many in the time of a step, and at the most.
const CELLS_PER_STEP: f64 = 1.5;
const CELLS: f64 = 12.0;
/// A span is longer than the one before by this factor at the most.
const GROWTH: f64 = 1.7;
/// A span next to a rest is at most this part of its distance from it.
const FROM_REST: f64 = 0.6;
/// Cells that wait before the passes are worth their time.
const BATCH: usize = 64;

/// A stretch of a section over which what is allowed is taken to be the same.
#[derive(Clone, Copy, Debug)]
struct Cell {
    item: u64,
    from: f64,
    to: f64,
    allowed: Allowed,
    /// Number of the part it belongs to, counted in the section.
    part: u64,
}

impl Cell {
    fn length(&self) -> f64 {
        self.to - self.from
    }

    fn gain(&self) -> f64 {
        2.0 * PACE * self.allowed.a * self.length()
    }
}

/// A span between two knots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knotted {
    pub(super) item: u64,
    pub(super) from: f64,
    pub(super) to: f64,
    /// Estimated time, s.
    pub(super) time_s: f64,
}

impl Knotted {
    pub(super) fn part(&self) -> Part {
        Part {
            item: self.item,
            from: self.from,
            to: self.to,
        }
    }
}

/// How a section ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exit {
    pub(super) speed: f64,
    /// Length of the stop behind its end, if it ends in one.
    pub(super) stop: Option<f64>,
}

/// Places knots, section by section.
#[derive(Debug)]
pub(super) struct Knots {
    cells: VecDeque<Cell>,
    /// Estimated b before the first cell: certain.
    begin: f64,
    /// Estimated b before each cell and behind the last.
    nodes: Vec<f64>,
    /// Length run from a rest at the beginning; infinite where there is none.
    from_rest: f64,
    /// Length of the last span.
    last: f64,
    /// Cells from which on the passes are worth their time.
    due: usize,
    parts: u64,
}

/// Estimated b at a distance from a rest: constant jerk.
fn launched(distance: f64, jerk: f64) -> f64 {
    let speed = 0.5 * jerk * (6.0 * distance / jerk).cbrt().powi(2);
    speed * speed
}

impl Knots {
    /// A section that begins with this speed, at the end of a launch of length `launch` from rest or at a steady speed.
    pub(super) fn new(speed: f64, launch: Option<f64>) -> Knots {
        Knots {
            cells: VecDeque::new(),
            begin: speed * speed,
            nodes: Vec::new(),
            from_rest: launch.unwrap_or(f64::INFINITY),
            last: f64::INFINITY,
            due: BATCH,
            parts: 0,
        }
    }

    /// The section goes on.
    pub(super) fn push(&mut self, part: Part, log: &Log, joints: &Joints, step_s: f64, jets: &mut Vec<JointJet>) {
        let Some(stretch) = log.stretch(part.item) else { return };
        let feed = stretch.feed;
        let mut cell = |from: f64, to: f64, allowed: Allowed| {
            self.cells.push_back(Cell {
                item: part.item,
                from,
                to,
                allowed,
                part: self.parts,
            });
        };
        let mut allowed = |piece: &Piece, s: f64| {
            joints.jets(piece, s, jets);
            joints.allowed(jets, feed)
        };
        if joints.are_even(&stretch.piece) {
            cell(part.from, part.to, allowed(&stretch.piece, part.from));
        } else {
            let length = part.to - part.from;
            let mut last = allowed(&stretch.piece, part.from);
            let middle = allowed(&stretch.piece, part.from + 0.5 * length);
            let end = allowed(&stretch.piece, part.to);
            let b = last.b.min(middle.b).min(end.b);
            // At least one, also for what is not a number.
            let cells = (CELLS_PER_STEP * length / (b.sqrt() * step_s)).ceil().clamp(1.0, CELLS) as u32;
            let step = length / f64::from(cells);
            for k in 0..cells {
                let from = part.from + step * f64::from(k);
                let to = if k + 1 == cells { part.to } else { from + step };
                let next = allowed(&stretch.piece, to);
                cell(
                    from,
                    to,
                    Allowed {
                        b: last.b.min(next.b),
                        a: last.a.min(next.a),
                        j: last.j.min(next.j),
                    },
                );
                last = next;
            }
        }
        self.parts += 1;
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

    /// Gives out the spans of all cells that are certain; of all if `exit` says how the section ends.
    pub(super) fn take(&mut self, exit: Option<Exit>, step_s: f64, out: &mut Vec<Knotted>) {
        if self.cells.is_empty() || (exit.is_none() && self.cells.len() < self.due) {
            return;
        }
        let certain = self.pass(exit);
        let mut to_rest = match exit {
            Some(Exit { stop: Some(stop), .. }) => stop + self.cells.iter().map(Cell::length).sum::<f64>(),
            Some(Exit { stop: None, .. }) | None => f64::INFINITY,
        };
        for k in 0..certain {
            let Some(cell) = self.cells.pop_front() else { break };
            to_rest -= cell.length();
            self.spans(&cell, [self.nodes[k], self.nodes[k + 1]], to_rest, step_s, out);
        }
        self.begin = self.nodes[certain];
        self.due = 2 * self.cells.len() + BATCH;
    }

    /// Estimates b at all nodes, forward and then backward; returns how many cells are certain.
    ///
    /// As long as the end is not known, the backward pass begins with 0. Both passes are monotone in what they begin with,
    /// so where the backward pass meets the result of the forward pass nevertheless, it would do so with any other end.
    fn pass(&mut self, exit: Option<Exit>) -> usize {
        let count = self.cells.len();
        let mut from_rest = self.from_rest;
        self.nodes.clear();
        self.nodes.push(self.begin);
        let mut b = self.begin;
        for (k, cell) in self.cells.iter().enumerate() {
            from_rest += cell.length();
            let next = self.cells.get(k + 1).map_or(cell.allowed.b, |next| next.allowed.b);
            b = (b + cell.gain()).min(cell.allowed.b).min(next);
            if from_rest < f64::INFINITY {
                b = b.min(launched(from_rest, cell.allowed.j));
            }
            self.nodes.push(b);
        }
        let (mut to_rest, mut certain) = (f64::INFINITY, 0);
        let mut after = 0.0;
        if let Some(exit) = exit {
            certain = count;
            after = (exit.speed * exit.speed).min(self.nodes[count]);
            self.nodes[count] = after;
            to_rest = exit.stop.unwrap_or(f64::INFINITY);
        } else {
            // The last part may have to give up its end for a stop.
            let last = self.cells.back().map_or(0, |cell| cell.part);
            let kept = self.cells.iter().rev().take_while(|cell| cell.part == last).count();
            let most = count - kept;
            for (k, cell) in self.cells.iter().enumerate().rev() {
                let before = after + cell.gain();
                if before >= self.nodes[k] && k <= most {
                    (certain, after) = (k, self.nodes[k]);
                    break;
                }
                after = before.min(self.nodes[k]);
            }
        }
        for k in (0..certain).rev() {
            let cell = &self.cells[k];
            to_rest += cell.length();
            after = self.nodes[k].min(after + cell.gain());
            if to_rest < f64::INFINITY {
                after = after.min(launched(to_rest, cell.allowed.j));
            }
            self.nodes[k] = after;
        }
        certain
    }

    /// Divides a cell.
    fn spans(&mut self, cell: &Cell, [begin, end]: [f64; 2], to_rest: f64, step_s: f64, out: &mut Vec<Knotted>) {
        let (length, pace) = (cell.length(), 2.0 * PACE * cell.allowed.a);
        let speed = |x: f64| {
            let b = cell.allowed.b.min(begin + pace * x).min(end + pace * (length - x));
            b.max(1e-6 * cell.allowed.b).sqrt()
        };
        let mut x = 0.0;
        // Rounding must not leave a sliver.
        while x < length {
            let ahead = 0.5 * step_s * speed(x);
            let mut h = step_s * speed((x + ahead).min(length));
            h = h.min(GROWTH * self.last).min(FROM_REST * self.from_rest);
            h = h.min(0.5 * FROM_REST * (length - x + to_rest));
            let left = length - x;
            if left <= 1.25 * h {
                h = left;
            } else if left < 2.0 * h {
                h = 0.5 * left;
            }
            let to = if h >= left { length } else { x + h };
            out.push(Knotted {
                item: cell.item,
                from: cell.from + x,
                to: if h >= left { cell.to } else { cell.from + to },
                time_s: h / speed(x + 0.5 * h),
            });
            self.last = h;
            self.from_rest += h;
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
