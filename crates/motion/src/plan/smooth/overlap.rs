//! Corners that are passed slowly: motion on one leg comes to rest while that on the other begins.
//!
//! In:  directions of the legs at the corner, tolerance, limits.
//! Out: shapes, how long each takes, and the blends.
//!
//! A shape is a curve r(w) = corner + a p(w) + b q(w) over w from -1 to 1, with the directions a and b of the legs and
//! q(w) = -p(-w): what leads to the corner on the one leg leads away from it on the other. Where w grows evenly in time, p is
//! the end of a motion with limited jerk, and q the beginning of one. Motion turns in less time where it swings out before it
//! turns in, as far as the tolerance lets it, and swings out again behind the corner.

use crate::canon::AXES;
use crate::path::{BlendEnd, Group, Jet, Piece};
use crate::plan::Settings;
use crate::plan::limits::PathLimits;
use crate::plan::profile::time_lost;

/// Samples of each half, less one.
const STEPS: usize = 16;

/// p and its first and second derivative at w = -1 and 0, of a shape of size 1: p(-1) = -1. At w = 1 it is at rest on the corner.
type States = [[f64; 3]; 2];

/// Turning, degrees; size, slope and bend at w = -1, place, slope and bend at w = 0, all in units of about the tolerance.
/// The place at w = 0 is before the corner.
type Row = (f64, [f64; 6]);

/// Shapes of the greatest swing. Found by IPOPT, with the shape and the motion along it unknown, for the shortest time of two
/// legs of 10 mm at 100 mm/s, 1000 mm/s², 20,000 mm/s³ within 0.007 mm.
const LONG: [Row; 9] = [
    (10.0, [181.208, 216.545, 107.276, -5.737, 81.850, -356.987]),
    (20.0, [101.854, 141.777, 130.060, -2.879, 41.542, -182.675]),
    (30.0, [78.204, 131.233, 196.168, -1.932, 27.910, -120.693]),
    (60.0, [70.608, 125.762, 106.596, -1.000, 16.790, -83.406]),
    (90.0, [56.032, 111.104, 140.746, -0.707, 12.672, -57.372]),
    (120.0, [65.290, 127.014, 135.415, -0.577, 13.685, -67.191]),
    (135.0, [82.206, 162.591, 166.333, -0.541, 15.987, -81.641]),
    (150.0, [81.942, 163.484, 167.971, -0.518, 15.905, -79.707]),
    (172.0, [81.981, 163.008, 166.126, -0.501, 26.859, -80.274]),
];
/// Those of a size of at most 20 tolerances, within 0.007 mm.
const MIDDLE: [Row; 8] = [
    (20.0, [20.000, 27.502, 24.444, -0.597, 8.216, -33.794]),
    (30.0, [20.000, 29.139, 30.521, -0.775, 7.850, -31.499]),
    (45.0, [20.000, 32.005, 42.012, -0.840, 7.242, -27.854]),
    (60.0, [20.000, 33.233, 27.691, -0.668, 5.842, -22.814]),
    (90.0, [19.999, 37.308, 45.502, -0.599, 5.208, -20.508]),
    (120.0, [20.000, 38.574, 50.333, -0.455, 4.753, -20.593]),
    (135.0, [20.000, 39.403, 51.554, -0.344, 4.542, -20.576]),
    (150.0, [20.000, 40.649, 56.084, -0.128, 4.261, -21.116]),
];

/// A shape, and p with three derivatives at even steps of w in both halves.
#[derive(Clone, Debug)]
pub(super) struct Overlap {
    states: States,
    p: [[[f64; 4]; STEPS + 1]; 2],
}

/// Where in between the bounds of its time a corner is expected. Found by planning corners of all kinds.
const EVEN_PART: f64 = 0.25;

/// Where two legs meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex<'a> {
    /// By length, at the corner.
    pub(super) directions: [&'a [f64; AXES]; 2],
    /// Angle between them, radians.
    pub(super) turning: f64,
    /// Greatest speed through the corner.
    pub(super) feed: f64,
    pub(super) legs: [Pace; 2],
}

/// How fast a leg can be run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    pub(super) limits: PathLimits,
    /// What it allows in its middle, coming from rest.
    pub(super) speed: f64,
}

impl Overlap {
    /// The shapes with a swing for this turning, radians.
    pub(super) fn swings(turning: f64) -> [Overlap; 2] {
        [&MIDDLE[..], &LONG[..]].map(|table| Overlap::of_table(table, turning.to_degrees()))
    }

    fn of_table(table: &[Row], degrees: f64) -> Overlap {
        let mut rows = [table[0]; 2];
        for row in table {
            rows = [rows[1], *row];
            if row.0 >= degrees {
                break;
            }
        }
        let [(from, low), (to, high)] = rows;
        let x = if to > from {
            ((degrees - from) / (to - from)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let [size, slope, bend, place, slope_0, bend_0] = std::array::from_fn(|k| low[k] + x * (high[k] - low[k]));
        Overlap::new([[-size, slope, -bend], [place, slope_0, bend_0]].map(|state| state.map(|value| value / size)))
    }

    /// The shape of one quintic, from where its inner control points lie on the legs as parts of the size.
    pub(super) fn quintic((p1, p2): (f64, f64)) -> Overlap {
        Overlap::new([
            [-1.0, 2.5 * (1.0 - p1), -5.0 * (1.0 + p2 - 2.0 * p1)],
            [
                -(1.0 + 5.0 * p1 + 10.0 * p2) / 32.0,
                5.0 * (1.0 + 3.0 * p1 + 2.0 * p2) / 32.0,
                -0.625 * (1.0 + p1 - 2.0 * p2),
            ],
        ])
    }

    fn new(states: States) -> Overlap {
        let [begin, middle] = states;
        let half = |from: [f64; 3], to: [f64; 3]| {
            let c = quintic(from, to);
            std::array::from_fn(|k| values(&c, k as f64 / STEPS as f64))
        };
        Overlap {
            states,
            p: [half(begin, middle), half(middle, [0.0; 3])],
        }
    }

    /// p and q with their derivatives at all samples.
    fn samples(&self) -> impl Iterator<Item = ([f64; 4], [f64; 4])> + '_ {
        (0..2).flat_map(move |half| {
            (0..=STEPS).map(move |k| {
                let [x, d1, d2, d3] = self.p[1 - half][STEPS - k];
                (self.p[half][k], [-x, d1, -d2, d3])
            })
        })
    }

    /// By how much the curve of size 1 is off straight legs of these directions, both ways.
    pub(super) fn off(&self, a: &[f64; AXES], b: &[f64; AXES]) -> f64 {
        let dot = |x: &[f64; AXES], y: &[f64; AXES]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
        let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
        let square = |p: f64, q: f64| p * p * aa + 2.0 * p * q * ab + q * q * bb;
        // Symmetric as it is, it is off the second leg as it is off the first, but for the lengths of a and b.
        let sides = [(aa, bb), (bb, aa)].map(|(own, other)| (other - ab * ab / own).max(0.0).sqrt());
        let side = sides[0].max(sides[1]);
        let mut off = square(self.states[1][0], -self.states[1][0]).sqrt();
        for (p, q) in self.samples().take(STEPS + 1) {
            // The crest, if it is near.
            let [mut x, d1, d2, _] = q;
            if d1.abs() < d2.abs() / STEPS as f64 {
                x -= d1 * d1 / (2.0 * d2);
            }
            let beyond = p[0] * aa + q[0] * ab > 0.0 || p[0] * bb + q[0] * ab > 0.0;
            off = off.max(if beyond {
                square(p[0], q[0]).sqrt()
            } else {
                side * x.abs()
            });
        }
        // What the samples miss.
        1.002 * off
    }

    /// About what a corner of this size costs beside running on at the speeds of both legs, s: between an upper bound, with w
    /// growing evenly in time, and a lower one, with w growing as fast as the limits allow at each place of its own.
    pub(super) fn time_lost(&self, size: f64, corner: &Vertex<'_>, settings: &Settings) -> f64 {
        let Vertex {
            directions: [a, b],
            turning,
            feed,
            legs,
        } = corner;
        let cosine = libm::cos(*turning);
        let [_, slope, bend] = self.states[0];
        // Rate of w in amount, its square and its cube, over what is allowed: by sample.
        let mut over = [[0.0f64; 3]; 2 * (STEPS + 1)];
        for (over, (p, q)) in over.iter_mut().zip(self.samples()) {
            over[0] = (p[1] * p[1] + 2.0 * cosine * p[1] * q[1] + q[1] * q[1]).max(0.0).sqrt() * size / feed;
        }
        for (axis, limits) in settings.axes.iter().enumerate() {
            let (Some(limits), true) = (limits, a[axis] != 0.0 || b[axis] != 0.0) else {
                continue;
            };
            let parts = [limits.velocity, limits.acceleration, limits.jerk].map(|limit| size / limit);
            for (over, (p, q)) in over.iter_mut().zip(self.samples()) {
                for (order, (over, part)) in over.iter_mut().zip(parts).enumerate() {
                    *over = over.max((a[axis] * p[order + 1] + b[axis] * q[order + 1]).abs() * part);
                }
            }
        }
        let braking = -bend.min(0.0);
        let mut ends = [0.0f64; 3];
        for Pace { limits, speed } in legs {
            ends[0] = ends[0].max(slope * size / speed);
            ends[1] = ends[1].max(braking * size / limits.a);
            // No more acceleration than jerk takes away before the motion would be at rest.
            ends[2] = ends[2].max(braking * braking * size / (2.0 * slope * limits.j));
        }
        let rate = |over: &[f64; 3]| (1.0 / over[0]).min(1.0 / over[1].sqrt()).min(1.0 / libm::cbrt(over[2]));
        let at_ends = rate(&ends);
        let rates = over.map(|over| rate(&over));
        let even = rates.iter().fold(at_ends, |least, rate| least.min(*rate));
        let lost = |at_ends: f64, inside_s: f64| {
            let mut lost = inside_s;
            for Pace { limits, speed } in legs {
                let (v, a) = (slope * size * at_ends, braking * size * at_ends * at_ends);
                // As if it went on to the end of the acceleration, with what would then be left of the speed.
                let t = a / limits.j;
                let place = t * (v - t * (a / 2.0 - t * limits.j / 6.0));
                lost += time_lost(*speed, (v - a * t / 2.0).clamp(0.0, *speed), limits) - t + (place - size) / speed;
            }
            lost
        };
        // Trapezoidal rule, on both halves.
        let mut inside_s = 0.0;
        for half in rates.chunks(STEPS + 1) {
            let times: f64 = half.iter().map(|rate| 1.0 / rate).sum();
            inside_s += (times - 0.5 / half[0] - 0.5 / half[STEPS]) / STEPS as f64;
        }
        let (most, least) = (lost(even, 2.0 / even), lost(at_ends.min(rates[0]), inside_s));
        least + EVEN_PART * (most - least)
    }

    /// The two blends that begin and end `size` from the corner; `None`: the curve would nearly stop.
    pub(super) fn blends(&self, a: &Piece, b: &Piece, size: f64, group: Group) -> Option<[Piece; 2]> {
        let [[_, slope, bend], [place, slope_0, bend_0]] = self.states.map(|state| state.map(|value| value * size));
        let end = |leg, pace_change| BlendEnd {
            leg,
            pace: slope,
            pace_change,
        };
        let (from, to) = (a.jet(a.length() + place), b.jet(-place));
        let corner = b.position(0.0).0;
        let middle = Jet {
            q: std::array::from_fn(|k| from.q[k] + to.q[k] - corner[k]),
            d1: std::array::from_fn(|k| (from.d1[k] + to.d1[k]) * slope_0),
            d2: std::array::from_fn(|k| (from.d2[k] + to.d2[k]) * slope_0 * slope_0 + (from.d1[k] - to.d1[k]) * bend_0),
            d3: [0.0; AXES],
        };
        let middle = BlendEnd {
            leg: middle,
            pace: 1.0,
            pace_change: 0.0,
        };
        Some([
            Piece::blend(&end(a.jet(a.length() - size), bend), &middle, group)?,
            Piece::blend(&middle, &end(b.jet(size), -bend), group)?,
        ])
    }
}

/// Coefficients of the quintic with these values and derivatives at 0 and 1.
fn quintic([x0, v0, a0]: [f64; 3], [x1, v1, a1]: [f64; 3]) -> [f64; 6] {
    let rise = x1 - x0;
    [
        x0,
        v0,
        a0 / 2.0,
        10.0 * rise - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1,
        -15.0 * rise + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1,
        6.0 * rise - 3.0 * (v0 + v1) + 0.5 * (a1 - a0),
    ]
}

/// A polynomial and its first three derivatives.
fn values(c: &[f64; 6], u: f64) -> [f64; 4] {
    [
        c[0] + u * (c[1] + u * (c[2] + u * (c[3] + u * (c[4] + u * c[5])))),
        c[1] + u * (2.0 * c[2] + u * (3.0 * c[3] + u * (4.0 * c[4] + u * 5.0 * c[5]))),
        2.0 * c[2] + u * (6.0 * c[3] + u * (12.0 * c[4] + u * 20.0 * c[5])),
        6.0 * c[3] + u * (24.0 * c[4] + u * 60.0 * c[5]),
    ]
}
