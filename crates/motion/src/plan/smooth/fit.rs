//! One smooth curve along many short straight moves.
//!
//! In:  chords with their place on a common parameter, the state at both ends, knots to begin with, the tolerance.
//! Out: position and derivatives at the knots: between two of them the curve is one quintic. Or the chord near which no
//! curve was found.
//!
//! A spline of degree 5 is fitted to the ends of the chords by least squares, weighted by length, and pays for its third
//! derivative. What is much shorter than a span, such as the rounding of programmed numbers, is averaged out; of a wave of
//! angular frequency w, the part (w SMOOTH span)^6 is lost. Where the result leaves the tolerance, spans are halved and
//! the fit is repeated.
//!
//! The curve and the polygon are compared at equal places (all quarters of every chord and of every span), which
//! bounds the distance in both directions.

use super::bspline::{Band, DEGREE, ORDER, basis};
use crate::canon::AXES;

/// Weight of the third derivative: the length, as a part of the span, below which waves are lost.
const SMOOTH: f64 = 0.35;
/// Widths of neighbouring spans differ by this factor at most.
const GRADE: f64 = 2.0;
/// Fits before giving up.
const ROUNDS: usize = 9;
/// Part of the tolerance that may be used where curve and polygon are compared; the rest is for what lies between.
const TOLERANCE_PART: f64 = 0.93;

/// Position and derivatives by the parameter, in the axes of a [`Track`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct State {
    pub(super) q: [f64; AXES],
    pub(super) d1: [f64; AXES],
    pub(super) d2: [f64; AXES],
    pub(super) d3: [f64; AXES],
}

/// A straight stretch of the polygon.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chord {
    /// Parameter at its ends.
    pub(super) t: [f64; 2],
    pub(super) q: [[f64; AXES]; 2],
    /// Whether the curve is to be near its inside, too, and not only near its end.
    pub(super) sampled: bool,
}

impl Chord {
    fn at(&self, x: f64, axes: usize) -> [f64; AXES] {
        let mut q = self.q[0];
        for axis in 0..axes {
            q[axis] += x * (self.q[1][axis] - self.q[0][axis]);
        }
        q
    }
}

/// The polygon in the axes that move, relative to its beginning.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    pub(super) chords: Vec<Chord>,
    /// Number of axes in use.
    pub(super) axes: usize,
    pub(super) tolerance: f64,
    pub(super) start: State,
    /// `None`: the curve goes on behind the track.
    pub(super) end: Option<State>,
    /// Low and high, by axis: where they are known, the curve aims for nothing beyond them.
    pub(super) walls: Option<[[f64; 2]; AXES]>,
}

/// Work space and result.
#[derive(Clone, Debug, Default)]
pub(super) struct Fit {
    /// Borders of the spans, first and last included.
    pub(super) borders: Vec<f64>,
    /// The curve at the borders.
    pub(super) states: Vec<State>,
    knots: Vec<f64>,
    x: Vec<[f64; AXES]>,
    band: Band,
    polynomials: Vec<[[f64; AXES]; ORDER]>,
    bad: Vec<bool>,
}

impl Fit {
    /// Fits; the spans to begin with are in `borders`. On failure, the number of the chord in trouble.
    pub(super) fn run(&mut self, track: &mut Track) -> Result<(), usize> {
        let mut worst = 0;
        for _ in 0..ROUNDS {
            self.solve(track);
            self.expand(track);
            match self.compare(track) {
                None => return Ok(()),
                Some(chord) => worst = chord,
            }
            if !self.split(track) {
                break;
            }
        }
        Err(worst)
    }

    /// Fills in the coefficients and the states at the borders.
    fn solve(&mut self, track: &Track) {
        let spans = self.borders.len() - 1;
        let (first, last) = (self.borders[0], self.borders[spans]);
        self.knots.clear();
        self.knots.extend([first; DEGREE]);
        self.knots.extend_from_slice(&self.borders);
        self.knots.extend([last; DEGREE]);
        let unknowns = spans + DEGREE;
        self.band.clear(unknowns, track.axes);
        self.x.clear();
        self.x.resize(unknowns, [0.0; AXES]);
        let mut span = DEGREE;
        let mut before = first;
        let count = track.chords.len();
        for (k, chord) in track.chords.iter().enumerate() {
            let parts = if chord.sampled { 4 } else { 1 };
            let next = track.chords.get(k + 1).map_or(0.0, |next| {
                (next.t[1] - next.t[0]) / if next.sampled { 4.0 } else { 1.0 }
            });
            let step = (chord.t[1] - chord.t[0]) / f64::from(parts);
            for part in 1..=parts {
                let last_one = part == parts;
                if last_one && k + 1 == count && track.end.is_some() {
                    break;
                }
                let (t, q) = if last_one {
                    (chord.t[1], chord.q[1])
                } else {
                    let x = f64::from(part) / f64::from(parts);
                    (chord.t[0] + x * (chord.t[1] - chord.t[0]), chord.at(x, track.axes))
                };
                let after = if last_one { next } else { step };
                while span + 1 < spans + DEGREE && self.knots[span + 1] <= t {
                    span += 1;
                }
                let n = basis(&self.knots, span, t, 0);
                let aim = track.walls.map_or(q, |walls| {
                    core::array::from_fn(|axis| q[axis].max(walls[axis][0]).min(walls[axis][1]))
                });
                self.band.ask(span - DEGREE, &n, &aim, 0.5 * (t - before + after));
                before = t;
            }
        }
        // The third derivative is quadratic in a span: its square is integrated exactly by three points.
        const GAUSS: [(f64, f64); 3] = [
            (0.112_701_665_379_258_3, 5.0 / 18.0),
            (0.5, 8.0 / 18.0),
            (0.887_298_334_620_741_7, 5.0 / 18.0),
        ];
        for span in DEGREE..spans + DEGREE {
            let (from, width) = (self.knots[span], self.knots[span + 1] - self.knots[span]);
            let price = (SMOOTH * width).powi(6) * width;
            for (x, weight) in GAUSS {
                let n = basis(&self.knots, span, from + x * width, 3);
                self.band.ask_zero(span - DEGREE, &n, price * weight);
            }
        }
        let given = self.give_ends(track, spans);
        self.band.solve(&mut self.x, given[0], given[1]);
        self.states.clear();
        for k in 0..=spans {
            let span = DEGREE + k.min(spans - 1);
            let t = self.borders[k];
            let part = |derivative: usize| {
                let n = basis(&self.knots, span, t, derivative);
                let mut sum = [0.0; AXES];
                for (n, x) in n.iter().zip(&self.x[span - DEGREE..]) {
                    for axis in 0..track.axes {
                        sum[axis] += n * x[axis];
                    }
                }
                sum
            };
            self.states.push(State {
                q: part(0),
                d1: part(1),
                d2: part(2),
                d3: part(3),
            });
        }
        // To the last bit, as what comes before or after is joined to it.
        let d3 = self.states[0].d3;
        self.states[0] = State { d3, ..track.start };
        if let Some(end) = track.end {
            self.states[spans] = end;
        }
    }

    /// Coefficients that the ends decide; their numbers.
    fn give_ends(&mut self, track: &Track, spans: usize) -> [usize; 2] {
        let end = |state: &State| [state.q, state.d1, state.d2];
        let (first, last) = (self.borders[0], self.borders[spans]);
        for (order, value) in end(&track.start).iter().enumerate() {
            let n = basis(&self.knots, DEGREE, first, order);
            for axis in 0..track.axes {
                let known: f64 = (0..order).map(|k| n[k] * self.x[k][axis]).sum();
                self.x[order][axis] = (value[axis] - known) / n[order];
            }
        }
        let Some(state) = &track.end else { return [3, 0] };
        let top = self.x.len() - 1;
        for (order, value) in end(state).iter().enumerate() {
            let n = basis(&self.knots, spans + DEGREE - 1, last, order);
            for axis in 0..track.axes {
                let known: f64 = (0..order).map(|k| n[DEGREE - k] * self.x[top - k][axis]).sum();
                self.x[top - order][axis] = (value[axis] - known) / n[DEGREE - order];
            }
        }
        [3, 3]
    }

    /// Polynomials of the spans, by the part of the span.
    fn expand(&mut self, track: &Track) {
        self.polynomials.clear();
        for (k, pair) in self.states.windows(2).enumerate() {
            let h = self.borders[k + 1] - self.borders[k];
            let mut c = [[0.0; AXES]; ORDER];
            for axis in 0..track.axes {
                let (v0, v1) = (pair[0].d1[axis] * h, pair[1].d1[axis] * h);
                let (a0, a1) = (pair[0].d2[axis] * h * h, pair[1].d2[axis] * h * h);
                let rise = pair[1].q[axis] - pair[0].q[axis];
                c[0][axis] = pair[0].q[axis];
                c[1][axis] = v0;
                c[2][axis] = a0 / 2.0;
                c[3][axis] = 10.0 * rise - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
                c[4][axis] = -15.0 * rise + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
                c[5][axis] = 6.0 * rise - 3.0 * (v0 + v1) + 0.5 * (a1 - a0);
            }
            self.polynomials.push(c);
        }
    }

    /// Marks the spans that are too far off; the worst chord, if any.
    fn compare(&mut self, track: &mut Track) -> Option<usize> {
        let limit = (TOLERANCE_PART * track.tolerance) * (TOLERANCE_PART * track.tolerance);
        let axes = track.axes;
        self.bad.clear();
        self.bad.resize(self.polynomials.len(), false);
        let (mut worst, mut where_worst) = (limit, None);
        let mut span = 0;
        for (k, chord) in track.chords.iter_mut().enumerate() {
            let width = chord.t[1] - chord.t[0];
            let mut along = [0.0; AXES];
            for axis in 0..axes {
                along[axis] = (chord.q[1][axis] - chord.q[0][axis]) / width;
            }
            for part in 1..=4 {
                let x = f64::from(part) * 0.25;
                let t = if part == 4 { chord.t[1] } else { chord.t[0] + x * width };
                while span + 1 < self.polynomials.len() && self.borders[span + 1] < t {
                    span += 1;
                }
                let off = self.off(span, t, chord, x, &along, axes, limit);
                if off > limit {
                    self.bad[span] = true;
                    chord.sampled |= part < 4;
                    if off > worst {
                        (worst, where_worst) = (off, Some(k));
                    }
                }
            }
        }
        let mut k = 0;
        for span in 0..self.polynomials.len() {
            let (from, h) = (self.borders[span], self.borders[span + 1] - self.borders[span]);
            for part in 0..4 {
                let t = from + f64::from(part) * 0.25 * h;
                while k + 1 < track.chords.len() && track.chords[k].t[1] < t {
                    k += 1;
                }
                let chord = &track.chords[k];
                let width = chord.t[1] - chord.t[0];
                let mut along = [0.0; AXES];
                for axis in 0..axes {
                    along[axis] = (chord.q[1][axis] - chord.q[0][axis]) / width;
                }
                let off = self.off(span, t, chord, (t - chord.t[0]) / width, &along, axes, limit);
                if off > limit {
                    self.bad[span] = true;
                    if off > worst {
                        (worst, where_worst) = (off, Some(k));
                    }
                }
            }
        }
        where_worst
    }

    /// Square of the distance between curve and chord at a common place; what is along the chord does not count where it
    /// is small.
    #[allow(clippy::too_many_arguments)] // inner loop
    fn off(&self, span: usize, t: f64, chord: &Chord, x: f64, along: &[f64; AXES], axes: usize, limit: f64) -> f64 {
        let from = self.borders[span];
        let u = (t - from) / (self.borders[span + 1] - from);
        let c = &self.polynomials[span];
        let (mut square, mut dot) = (0.0, 0.0);
        for axis in 0..axes {
            let q =
                c[0][axis] + u * (c[1][axis] + u * (c[2][axis] + u * (c[3][axis] + u * (c[4][axis] + u * c[5][axis]))));
            let e = q - chord.q[0][axis] - x * (chord.q[1][axis] - chord.q[0][axis]);
            square += e * e;
            dot += e * along[axis];
        }
        // A tenth of the tolerance along bends away from the chord by much less than what is kept back.
        if dot * dot < 0.01 * limit {
            square - dot * dot
        } else {
            square
        }
    }

    /// Halves the spans that are too far off; `false`: they are too short for that.
    fn split(&mut self, track: &Track) -> bool {
        let shortest = track.tolerance / 16.0;
        let mut borders = Vec::with_capacity(2 * self.borders.len());
        for (pair, bad) in self.borders.windows(2).zip(&self.bad) {
            borders.push(pair[0]);
            if *bad {
                let half = 0.5 * (pair[1] - pair[0]);
                if half < shortest {
                    return false;
                }
                borders.push(pair[0] + half);
            }
        }
        borders.extend(self.borders.last());
        self.borders = borders;
        self.grade();
        true
    }

    /// Splits spans until neighbours differ in width by a factor of [`GRADE`] at most, so that the curve can change its
    /// pace from one to the other.
    pub(super) fn grade(&mut self) {
        let mut to = Vec::with_capacity(self.borders.len() + 16);
        // Seen from the other end, the second time.
        for _ in 0..2 {
            let mut last = f64::INFINITY;
            to.clear();
            to.extend(self.borders.first());
            for pair in self.borders.windows(2) {
                let end = pair[1];
                let mut at = pair[0];
                while (end - at).abs() > GRADE * last * (1.0 + 1e-9) {
                    // The largest of halves, quarters ... that is allowed.
                    let mut step = 0.5 * (end - at);
                    while step.abs() > GRADE * last {
                        step *= 0.5;
                    }
                    at += step;
                    last = step.abs();
                    to.push(at);
                }
                last = (end - at).abs();
                to.push(end);
            }
            to.reverse();
            std::mem::swap(&mut to, &mut self.borders);
        }
    }
}
