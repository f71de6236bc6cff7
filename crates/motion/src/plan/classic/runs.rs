//! Runs: consecutive pieces under common limits.
//!
//! In:  stretches with bounds, and halts.
//! Out: runs. Acceleration is 0 where runs meet, so they must not be too short; all their pieces share the limits of the
//! worst, so they must not differ too much. Both are decided by the data alone.

use crate::element::{Element, Span};
use crate::plan::Settings;
use crate::plan::junctions::{Bounded, Joined};
use crate::plan::limits::{Bounds, PathLimits};
use crate::plan::profile::{Phase, brakeable, duration, end_speed, profile};
use crate::plan::smooth::Stretch;

/// Pieces in one run at most, which bounds the number of elements that must be published together.
pub(super) const RUN_PIECES: usize = 512;

/// Pieces that are passed in one cycle at most, on the mean of a run; a bound for the work of the cycle.
const PIECES_PER_CYCLE: f64 = 16.0;

/// What sums of lengths and times may leave, as a part of the length of a run.
const ROUNDING: f64 = 1e-12;

/// Consecutive pieces under common limits.
#[derive(Clone, Debug)]
pub(super) struct Run {
    parts: Vec<Box<Stretch>>,
    pub(super) length: f64,
    pub(super) limits: PathLimits,
    bounds: Bounds,
    feed: f64,
    /// Speed that the fastest part would have on its own.
    fastest: f64,
}

/// What comes out.
#[derive(Clone, Debug)]
pub(super) enum Built {
    Run(Run),
    Stop,
}

/// Builds runs.
#[derive(Debug, Default)]
pub(super) struct Runs {
    open: Option<Run>,
    /// Speed of the run before, 0 at rest.
    before: f64,
}

impl Runs {
    pub(super) fn push(&mut self, joined: Joined, settings: &Settings, out: &mut Vec<Built>) {
        let next = match joined {
            Joined::Stretch(next) => next,
            Joined::Stop => {
                self.flush(settings, out);
                out.push(Built::Stop);
                return;
            }
        };
        let limits = next.bounds.limits(next.stretch.feed, settings);
        if let Some(open) = &mut self.open {
            if open.joins(&next, &limits, settings) {
                open.parts.push(next.stretch);
                return;
            }
            let before = self.before;
            self.before = open.choose_speed(before, limits.v, settings);
        }
        out.extend(self.open.replace(Run::new(next, limits)).map(Built::Run));
    }

    /// What is open ends at rest.
    pub(super) fn flush(&mut self, settings: &Settings, out: &mut Vec<Built>) {
        if let Some(open) = &mut self.open {
            open.choose_speed(self.before, 0.0, settings);
        }
        out.extend(self.open.take().map(Built::Run));
        self.before = 0.0;
    }
}

impl Run {
    fn new(one: Bounded, limits: PathLimits) -> Run {
        Run {
            length: one.stretch.piece.length(),
            limits,
            bounds: one.bounds,
            feed: one.stretch.feed,
            fastest: limits.v,
            parts: vec![one.stretch],
        }
    }

    /// Pieces of path.
    pub(super) fn pieces(&self) -> usize {
        self.parts.len()
    }

    /// Goes on under the limits that `next` needs, which has the given ones on its own, where that loses little; the caller appends it.
    fn joins(&mut self, next: &Bounded, own: &PathLimits, settings: &Settings) -> bool {
        /// Speeds that differ by less are alike.
        const ALIKE: f64 = 0.85;
        let next_length = next.stretch.piece.length();
        let bounds = self.bounds.union(&next.bounds);
        let mean = (self.length + next_length) / (self.pieces() + 1) as f64;
        let mut feed = self.feed.min(next.stretch.feed);
        if self.pieces() as f64 > PIECES_PER_CYCLE {
            feed = feed.min(PIECES_PER_CYCLE * mean / settings.cycle_s);
        }
        let limits = bounds.limits(feed, settings);
        let fastest = self.fastest.max(own.v);
        let PathLimits { v, a, j } = limits;
        // Over this length, speed can change by about a quarter; two runs shorter than it are no better than one.
        let short = v * (v / j).sqrt();
        // Braking and accelerating fit into this; a longer run gains nothing.
        let long = 2.0 * v * (v / a + a / j);
        let alike = v >= ALIKE * fastest && self.length < long;
        let both_short = self.length < short && next_length < short;
        if !(alike || both_short) || self.pieces() >= RUN_PIECES {
            return false;
        }
        self.length += next_length;
        self.fastest = if alike { fastest } else { v };
        (self.bounds, self.feed, self.limits) = (bounds, feed, limits);
        true
    }

    /// On a curve, less speed leaves more for changing it: chooses what takes the least time between the given speeds
    /// at both ends. Nothing is appended any more. Returns the speed.
    fn choose_speed(&mut self, before: f64, after: f64, settings: &Settings) -> f64 {
        let time = |limits: &PathLimits| {
            let v0 = before.min(brakeable(after.min(limits.v), limits.v, self.length, limits));
            let v1 = end_speed(v0, after.min(limits.v), self.length, limits);
            duration(v0, v1, self.length, limits)
        };
        // Of a straight run, curvature takes nothing.
        if self.bounds.is_straight() {
            return self.limits.v;
        }
        let mut best = (time(&self.limits), self.limits);
        for curved in [0.9, 0.75, 0.5, 0.35, 0.25] {
            let v = self.bounds.speed_with(curved, self.feed, settings);
            if self.length >= best.0 * v {
                continue;
            }
            let limits = self.bounds.limits_at(v, settings);
            if limits == best.1 {
                continue;
            }
            let time = time(&limits);
            if time < best.0 {
                best = (time, limits);
            }
        }
        self.limits = best.1;
        self.limits.v
    }

    /// The motion from speed `v0` to `v1`, one span per phase and piece.
    pub(super) fn spans(&self, v0: f64, v1: f64, out: &mut Vec<Element>) {
        let phases = profile(v0, v1, self.length, &self.limits);
        let mut part = 0;
        let mut part_start = 0.0;
        for (place, phase) in phases.iter().enumerate() {
            let phase_end = phases.get(place + 1).map_or(f64::INFINITY, |next| next.s);
            let mut t = 0.0;
            loop {
                let border = part_start + self.parts[part].piece.length();
                let last_part = part + 1 == self.parts.len();
                let until = if last_part || border > phase_end {
                    phase.duration
                } else {
                    phase.time_at(border, t)
                };
                self.span(part, part_start, phase, t, until, out);
                t = until;
                if last_part || border > phase_end {
                    break;
                }
                part_start = border;
                part += 1;
            }
        }
    }

    fn span(&self, part: usize, part_start: f64, phase: &Phase, from: f64, until: f64, out: &mut Vec<Element>) {
        if until <= from {
            return;
        }
        let is_last = part + 1 == self.parts.len();
        let part = &self.parts[part];
        let mut span = Span {
            s0: phase.place(from) - part_start,
            v0: phase.speed(from).max(0.0),
            a0: phase.a + from * phase.jerk,
            jerk: phase.jerk,
            duration_s: until - from,
            ..part.span()
        };
        if is_last && until == phase.duration {
            // The sum of the lengths before it has its rounding; its own end has none.
            let missed = part.piece.length() - span.place(span.duration_s);
            if missed.abs() <= ROUNDING * self.length {
                span.s0 += missed;
            }
        }
        out.push(Element::Span(span));
    }
}
