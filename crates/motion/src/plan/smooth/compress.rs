//! Runs of short straight moves become few long pieces.
//!
//! In:  moves.
//! Out: moves; where many short ones followed each other with small angles there are quintics instead, joined with
//! continuous position, direction and curvature, within the tolerance of what they replace. Corners that need not be
//! touched are left to [`super::corners`].
//!
//! A corner belongs to a run where rounding it alone would be short of room ([`soft`]). A run of one corner, unless that is flat,
//! is no run: beside a very short leg, a stop may take less time. A run begins and ends on a straight move, part of which is left
//! as it is. Runs of any length pass through a window: when it is full, a curve is
//! fitted through all of it and all but its last spans are let go; the next fit goes on from there with equal position and
//! derivatives. Windows are cut by the moves alone, so that equal programs give equal bits.
//!
//! A quintic has the line of the move in which it ends, and the least feed of those that it covers.

use std::collections::VecDeque;

use super::Leg;
use super::corners::FLAT;
use super::fit::{Chord, Fit, State, Track};
use super::round::{curve, distance, reach, turning};
use super::steps::SHARP;
use crate::canon::{AXES, Position};
use crate::path::{BlendEnd, Group, Jet, NO_MOVE, Piece, Shape};
use crate::plan::Settings;
use crate::plan::program::{Corner, Move};
use crate::plan::travel::{Walls, inside};

/// Moves in a window at first; as long as they make too few spans, twice as many.
const WINDOW: usize = 256;
const WINDOW_MAX: usize = 2048;
/// Spans that are worth a fit.
const SPANS: usize = 40;
/// Spans at the end of a window that may still change when more is known.
const OVERLAP: usize = 10;
/// Moves in one span at most.
const SPAN_MOVES: usize = 64;
/// Height of a span over its width; on a circle, the span turns by eight times as many radians.
const HEIGHT: f64 = 0.0375;
/// Greatest ratio of tolerances in a run.
const TOLERANCES: f64 = 2.0;
/// How often a curve may be drawn in where it leaves the travel.
const DRAWINGS_IN: u32 = 3;

/// Where a run begins.
#[derive(Clone, Copy, Debug)]
enum Start {
    /// On the first move, which is left as it is up to this length. `room`: what a corner before it may use of that; `run`: length
    /// of the curve before.
    Line { from: f64, room: f64, run: f64 },
    /// Where the curve before ends, about at the beginning of the first move.
    Curve(Jet),
}

/// Makes runs and compresses them.
#[derive(Debug)]
pub(super) struct Compressor {
    moves: VecDeque<Box<Move>>,
    start: Start,
    /// Moves at which the window is looked at.
    full: usize,
    axes: Moving,
    track: Track,
    fit: Fit,
    /// Where on the first move the curve begins, and where on the last it ends.
    begins: f64,
    taken: f64,
}

impl Default for Compressor {
    fn default() -> Compressor {
        Compressor {
            moves: VecDeque::new(),
            start: FRESH,
            full: WINDOW,
            axes: Moving::default(),
            begins: 0.0,
            taken: 0.0,
            track: Track::default(),
            fit: Fit::default(),
        }
    }
}

/// No run has begun.
const FRESH: Start = Start::Line {
    from: 0.0,
    room: f64::INFINITY,
    run: 0.0,
};

impl Compressor {
    pub(super) fn push(&mut self, part: Box<Move>, settings: &Settings, out: &mut Vec<Leg>) {
        if let Some(last) = self.moves.back() {
            if !soft(last, &part) {
                self.flush(settings, out);
            } else if self.moves.len() > 1 && long(&self.moves) {
                self.close(settings, out);
            }
        }
        self.moves.push_back(part);
        if self.moves.len() >= self.full {
            self.pass_some(settings, out);
        }
    }

    /// The run ends with its last move, all of which is let go.
    pub(super) fn flush(&mut self, settings: &Settings, out: &mut Vec<Leg>) {
        if self.moves.len() > 1 {
            self.close(settings, out);
        }
        self.let_go_first(settings, out);
        self.full = WINDOW;
    }
}

impl Compressor {
    /// The window is full: lets go what cannot change any more.
    fn pass_some(&mut self, settings: &Settings, out: &mut Vec<Leg>) {
        let count = self.moves.len();
        if self.lay_out(count, false) < SPANS && count < WINDOW_MAX {
            self.full = 2 * count;
            return;
        }
        self.full = WINDOW;
        // What is let go ends with a move: at a border that is the end of a chord.
        let borders = &self.fit.borders;
        let mut ends = self.track.chords.iter().enumerate().rev().peekable();
        let mut found = None;
        for border in borders[1..borders.len() - OVERLAP].iter().rev() {
            while ends.next_if(|(_, chord)| chord.t[1] > *border).is_some() {}
            if let Some((last, _)) = ends.peek().filter(|(_, chord)| chord.t[1] == *border) {
                found = Some((*last, *border));
                break;
            }
        }
        let Some((last, until)) = found else {
            self.close(settings, out);
            return;
        };
        match self.curve(until, settings) {
            Ok((pieces, jet)) => {
                self.leave_line(out);
                out.extend(pieces);
                self.moves.drain(..=last);
                self.start = Start::Curve(jet);
            }
            Err(_) => self.close(settings, out),
        }
    }

    /// The run ends on its last move, which stays, from some length on.
    fn close(&mut self, settings: &Settings, out: &mut Vec<Leg>) {
        // Left to be compared with a stop.
        if self.moves.len() == 2 && matches!(self.start, Start::Line { .. }) && self.turns() >= FLAT {
            self.let_go_first(settings, out);
        }
        // Near a place where no curve is found, shorter attempts, so that the work stays in proportion.
        let mut limit = usize::MAX;
        while self.moves.len() > 1 {
            let count = self.moves.len().min(limit);
            self.lay_out(count, true);
            match self.curve(f64::INFINITY, settings) {
                Ok((pieces, _)) => {
                    self.leave_line(out);
                    out.extend(pieces);
                    let from = self.taken;
                    self.moves.drain(..count - 1);
                    let run = self.run();
                    self.start = Start::Line { from, room: 0.0, run };
                    limit = limit.saturating_mul(2);
                }
                Err(_) if count == 2 => {
                    self.let_go_first(settings, out);
                    limit = 8;
                }
                Err(chord) => limit = chord.clamp(2, count - 1).min((count / 2).max(8)),
            }
        }
        self.full = WINDOW;
    }

    /// By how much the path turns behind the first move, radians.
    fn turns(&self) -> f64 {
        let [a, b] = [0, 1].map(|k| &self.moves[k].piece);
        turning(a.group(), &a.jet(a.length()), &b.jet(0.0))
    }

    /// Lets go what is left of the first move, as it is.
    fn let_go_first(&mut self, settings: &Settings, out: &mut Vec<Leg>) {
        if let Some(mut part) = self.moves.pop_front() {
            match self.start {
                Start::Line { from, room, run } => {
                    let length = part.piece.length();
                    // Behind a curve all that is left may be used by a corner, else half.
                    let end = if from > 0.0 { length - from } else { length / 2.0 };
                    if let Some(piece) = part.piece.cut(from, length) {
                        part.piece = piece;
                        out.push(Leg {
                            part,
                            room: [room.min(length / 2.0), end],
                            whole: run + length,
                        });
                    }
                }
                Start::Curve(jet) => out.extend(bridge(&jet, &part, settings)),
            }
        }
        self.start = FRESH;
    }

    /// The part of the first move that lies before the curve.
    fn leave_line(&self, out: &mut Vec<Leg>) {
        if let (Start::Line { from, room, run }, Some(part)) = (self.start, self.moves.front()) {
            let whole = run + self.begins + self.run();
            let room = room.min(part.piece.length() / 2.0);
            out.extend(part.piece.cut(from, self.begins).map(|piece| Leg {
                part: Box::new(Move {
                    piece,
                    corner: Corner::Exact,
                    ..**part
                }),
                room: [room, 0.0],
                whole,
            }));
        }
    }

    /// About the length of the curve that has been laid out.
    fn run(&self) -> f64 {
        self.track.chords.last().map_or(0.0, |chord| chord.t[1])
    }

    /// Prepares the fit of the first `count` moves; the number of spans. `closed`: the curve ends on the last of them.
    fn lay_out(&mut self, count: usize, closed: bool) -> usize {
        let moves = self.moves.make_contiguous();
        let first = &moves[0].piece;
        let last = &moves[count - 1].piece;
        let begin = match self.start {
            Start::Curve(jet) => jet,
            Start::Line { from, .. } => {
                let available = if from > 0.0 {
                    first.length() - from
                } else {
                    first.length() / 2.0
                };
                let wanted = extent(&moves[0], moves[1..count].iter());
                self.begins = if wanted > 0.8 * available {
                    first.length() - available
                } else {
                    first.length() - wanted
                };
                on_line(first, self.begins)
            }
        };
        self.taken = (last.length() / 2.0).min(extent(&moves[count - 1], moves[..count - 1].iter().rev()));
        let end = on_line(last, self.taken);
        let until = if closed { end.q } else { last.position(last.length()).0 };
        self.axes.choose(&begin, &until, &moves[..count]);
        let axes = &self.axes;
        let track = &mut self.track;
        track.axes = axes.count;
        track.tolerance = moves[..count]
            .iter()
            .filter_map(|part| tolerance(part))
            .fold(f64::INFINITY, f64::min);
        track.start = axes.state(&begin);
        track.end = closed.then(|| axes.state(&end));
        track.chords.clear();
        let mut t = 0.0;
        let mut q = match self.start {
            Start::Line { .. } => track.start.q,
            Start::Curve(_) => axes.relative(&first.position(0.0).0),
        };
        for (k, part) in moves[..count].iter().enumerate() {
            let piece = &part.piece;
            let next = if closed && k + 1 == count {
                axes.state(&end).q
            } else {
                axes.relative(&piece.position(piece.length()).0)
            };
            let width = distance(&q, &next);
            track.chords.push(Chord {
                t: [t, t + width],
                q: [q, next],
                sampled: false,
            });
            (t, q) = (t + width, next);
        }
        // The ends of a run on long moves.
        for (k, near) in [(0, 1), (count - 1, count - 2)] {
            let width = |k: usize| track.chords[k].t[1] - track.chords[k].t[0];
            track.chords[k].sampled = width(k) > width(near);
        }
        let borders = &mut self.fit.borders;
        borders.clear();
        borders.push(0.0);
        let mut from = 0;
        while from < count {
            let fits = |moves_in: usize| {
                moves[from].feed == moves[from + moves_in - 1].feed
                    && moves[from + moves_in / 2].feed == moves[from].feed
                    && flat(&track.chords[from..from + moves_in], track.axes, track.tolerance)
            };
            let most = (count - from).min(SPAN_MOVES);
            let mut good = 1;
            while 2 * good <= most && fits(2 * good) {
                good *= 2;
            }
            let mut bad = (2 * good).min(most + 1);
            while good + 1 < bad {
                let middle = good.midpoint(bad);
                if fits(middle) {
                    good = middle;
                } else {
                    bad = middle;
                }
            }
            from += good;
            borders.push(track.chords[from - 1].t[1]);
        }
        let spans = borders.len() - 1;
        self.fit.grade();
        spans
    }

    /// The quintics up to parameter `until`, and the state there. On failure, the number of the chord in trouble.
    fn curve(&mut self, until: f64, settings: &Settings) -> Result<(Vec<Leg>, Jet), usize> {
        let mut walls = Walls::new(settings);
        let mut drawings_in = 0;
        self.track.walls = None;
        loop {
            self.fit.run(&mut self.track)?;
            let (pieces, jet) = self.pieces(until)?;
            let Some(first) = pieces.iter().position(|leg| !inside(&leg.part.piece, settings)) else {
                return Ok((pieces, jet));
            };
            // The curve swings out beyond the ends of its chords: what it aims for, a little further inside, and not at all
            // where it still does.
            drawings_in += 1;
            if drawings_in > DRAWINGS_IN || !walls.draw_in(pieces.iter().map(|leg| &leg.part.piece), settings) {
                let from = self.fit.borders[first];
                return Err(self.track.chords.partition_point(|chord| chord.t[1] <= from));
            }
            self.track.walls = Some(self.axes.walls(&walls));
        }
    }

    fn pieces(&self, until: f64) -> Result<(Vec<Leg>, Jet), usize> {
        let first = &self.moves[0].piece;
        let (fit, track) = (&self.fit, &self.track);
        let mut pieces = Vec::with_capacity(fit.borders.len());
        let mut chord = 0;
        let mut from = self.axes.jet(&fit.states[0]);
        for (k, pair) in fit.borders.windows(2).enumerate() {
            if pair[0] >= until {
                break;
            }
            let to = self.axes.jet(&fit.states[k + 1]);
            let end = |leg: Jet| BlendEnd {
                leg,
                pace: pair[1] - pair[0],
                pace_change: 0.0,
            };
            let piece = curve(&end(from), &end(to), first.group()).ok_or(chord)?;
            let mut feed = self.moves[chord].feed;
            while chord + 1 < track.chords.len() && track.chords[chord].t[1] < pair[1] {
                chord += 1;
                feed = feed.min(self.moves[chord].feed);
            }
            pieces.push(Leg {
                part: Box::new(Move {
                    piece: piece.in_frame(*first.frame()),
                    feed,
                    corner: Corner::Exact,
                    ..*self.moves[chord]
                }),
                room: [0.0; 2],
                whole: piece.length(),
            });
            if chord + 1 < track.chords.len() && track.chords[chord].t[1] <= pair[1] {
                chord += 1;
            }
            from = to;
        }
        Ok((pieces, from))
    }
}

/// Whether a curve of one span may be near these chords: their ends are not far from the line between the first and the
/// last.
fn flat(chords: &[Chord], axes: usize, tolerance: f64) -> bool {
    let (Some(first), Some(last)) = (chords.first(), chords.last()) else {
        return true;
    };
    let width = last.t[1] - first.t[0];
    let mut along = [0.0; AXES];
    let mut square = 0.0;
    for axis in 0..axes {
        along[axis] = last.q[1][axis] - first.q[0][axis];
        square += along[axis] * along[axis];
    }
    if square < 0.64 * width * width {
        return chords.len() == 1;
    }
    let height = (HEIGHT * width).max(0.3 * tolerance);
    (1..8).map(|k| k * chords.len() / 8).filter(|k| *k > 0).all(|k| {
        let (mut dot, mut off) = (0.0, 0.0);
        for axis in 0..axes {
            let e = chords[k].q[0][axis] - first.q[0][axis];
            dot += e * along[axis];
            off += e * e;
        }
        off - dot * dot / square <= height * height
    })
}

/// Length of a straight move along which the curve of the moves beside it may begin: about twice that over which the
/// tolerance lets it go over from straight to bent.
fn extent<'a>(straight: &Move, beside: impl Iterator<Item = &'a Box<Move>>) -> f64 {
    let Some(tolerance) = tolerance(straight) else {
        return 0.0;
    };
    let (group, direction) = (straight.piece.group(), straight.piece.jet(0.0));
    let mut length = 0.0;
    for part in beside {
        let reach = reach(group, &direction, &part.piece.jet(0.0), tolerance);
        if reach < length + 0.5 * part.piece.length() {
            return reach.max(2.0 * length);
        }
        length += part.piece.length();
        if length > straight.piece.length() {
            break;
        }
    }
    2.0 * length
}

/// Whether the last of these moves is so long that a run ends on it and another begins.
fn long(moves: &VecDeque<Box<Move>>) -> bool {
    let mut back = moves.iter().rev();
    let (Some(last), Some(before)) = (back.next(), back.next()) else {
        return false;
    };
    let length = last.piece.length();
    length > 4.0 * before.piece.length() && length > 4.0 * extent(last, moves.iter().rev().skip(1))
}

/// State on a straight move; the parameter is the length in all axes.
fn on_line(piece: &Piece, s: f64) -> Jet {
    let jet = piece.jet(s);
    let rate = distance(&jet.d1, &[0.0; AXES]);
    Jet {
        d1: jet.d1.map(|x| x / rate),
        ..jet
    }
}

/// The axes that move, and the place from which they are counted.
#[derive(Clone, Copy, Debug, Default)]
struct Moving {
    axes: [usize; AXES],
    count: usize,
    origin: [f64; AXES],
}

impl Moving {
    fn choose(&mut self, begin: &Jet, until: &[f64; AXES], moves: &[Box<Move>]) {
        self.origin = begin.q;
        self.count = 0;
        for axis in 0..AXES {
            let moves_here = begin.q[axis] != until[axis]
                || begin.d1[axis] != 0.0
                || begin.d2[axis] != 0.0
                || moves
                    .iter()
                    .any(|part| part.piece.position(part.piece.length()).0[axis] != begin.q[axis]);
            if moves_here {
                self.axes[self.count] = axis;
                self.count += 1;
            }
        }
    }

    fn pick(&self, vector: &[f64; AXES]) -> [f64; AXES] {
        let mut picked = [0.0; AXES];
        for k in 0..self.count {
            picked[k] = vector[self.axes[k]];
        }
        picked
    }

    fn relative(&self, q: &[f64; AXES]) -> [f64; AXES] {
        self.pick(&core::array::from_fn(|axis| q[axis] - self.origin[axis]))
    }

    fn state(&self, jet: &Jet) -> State {
        State {
            q: self.relative(&jet.q),
            d1: self.pick(&jet.d1),
            d2: self.pick(&jet.d2),
            d3: self.pick(&jet.d3),
        }
    }

    /// The walls as the curve sees them.
    fn walls(&self, walls: &Walls) -> [[f64; 2]; AXES] {
        let mut picked = [[f64::NEG_INFINITY, f64::INFINITY]; AXES];
        for k in 0..self.count {
            let axis = self.axes[k];
            picked[k] = walls.0[axis].map(|wall| wall - self.origin[axis]);
        }
        picked
    }

    fn jet(&self, state: &State) -> Jet {
        let mut jet = Jet {
            q: self.origin,
            ..Jet::default()
        };
        for k in 0..self.count {
            let axis = self.axes[k];
            jet.q[axis] += state.q[k];
            (jet.d1[axis], jet.d2[axis], jet.d3[axis]) = (state.d1[k], state.d2[k], state.d3[k]);
        }
        jet
    }
}

/// From the end of a curve to the end of a move near which no curve was found: straight, or by the beginning of the move where
/// that would leave the travel of a joint, or be no move.
fn bridge(jet: &Jet, part: &Move, settings: &Settings) -> impl Iterator<Item = Leg> + use<> {
    let (from, corner, to) = (
        Position(jet.q),
        part.piece.position(0.0),
        part.piece.position(part.piece.length()),
    );
    let line = |from, to| Piece::line(from, to).map(|piece| piece.in_frame(*part.piece.frame()));
    let is_move = |piece: &Piece| piece.length() >= NO_MOVE;
    let pieces = match line(from, to) {
        None => [None, None],
        Some(straight) if is_move(&straight) && inside(&straight, settings) => [None, Some(straight)],
        Some(_) => [line(from, corner).filter(is_move), Some(part.piece)],
    };
    let part = *part;
    pieces.into_iter().flatten().map(move |piece| {
        let room = piece.length() / 2.0;
        Leg {
            part: Box::new(Move { piece, ..part }),
            room: [0.0, room],
            whole: piece.length(),
        }
    })
}

/// Within which the corner behind a move may be rounded.
fn tolerance(part: &Move) -> Option<f64> {
    match part.corner {
        Corner::Round(tolerance) => Some(tolerance),
        Corner::Exact | Corner::Stop => None,
    }
}

/// Whether the corner between two moves belongs to a run: a corner of short legs and small angle, so well within the
/// tolerance that a blend would take more than half of a leg.
fn soft(a: &Move, b: &Move) -> bool {
    let (Some(tolerance), Some(next), Shape::Line(_), Shape::Line(_)) =
        (tolerance(a), tolerance(b), a.piece.shape(), b.piece.shape())
    else {
        return false;
    };
    let group = a.piece.group();
    // The least of a run is that of all of it.
    let alike = tolerance <= TOLERANCES * next
        && next <= TOLERANCES * tolerance
        && b.enables == a.enables
        && b.auxiliary == a.auxiliary;
    if a.rapid || b.rapid || group != b.piece.group() || group == Group::Rotary || !alike {
        return false;
    }
    let (end, start) = (a.piece.jet(0.0), b.piece.jet(0.0));
    if turning(group, &end, &start) > SHARP {
        return false;
    }
    let gap = distance(&end.d1, &start.d1);
    gap < 1e-9 || reach(group, &end, &start, tolerance) > 0.5 * a.piece.length().min(b.piece.length())
}
