//! What the solver knows of the path: derivatives at checkpoints of every span, scaled by the limits.

use crate::plan::limits::PathLimits;
use crate::plan::roots::cube_root;

/// Part of the acceleration limit that is planned with. Second differences of set-points are means over two cycles
/// and never above the greatest value between; the rest covers what lies between two checkpoints.
pub const ACCELERATION_USE: f64 = 0.995;
/// Part of the jerk limit that is planned with where it varies most between checkpoints.
pub const JERK_USE: f64 = 0.965;
/// The same of acceleration and jerk where joints move evenly: between checkpoints nothing changes but the speed.
const EVEN_USE: [f64; 2] = [0.9985, 0.985];
/// Part of the speed limits, programmed feed included, that is planned with: room for rounding.
pub const SPEED_USE: f64 = 0.9999;

/// Limits of one joint, each greater than 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Greatest speed, unit/s.
    pub velocity: f64,
    /// Greatest acceleration, unit/s².
    pub acceleration: f64,
    /// Greatest jerk, unit/s³.
    pub jerk: f64,
}

/// What a jump of direction or curvature takes of the limits of a joint while it is passed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Taken {
    /// Acceleration, at most, unit/s².
    pub acceleration: f64,
    /// Jerk at any speed, at most, unit/s³.
    pub jerk: f64,
    /// Further jerk over the speed along the path, at most, unit/s³ per mm/s.
    pub jerk_by_speed: f64,
}

impl Taken {
    /// What the greater of two takes.
    pub fn max(self, other: Taken) -> Taken {
        Taken {
            acceleration: self.acceleration.max(other.acceleration),
            jerk: self.jerk.max(other.jerk),
            jerk_by_speed: self.jerk_by_speed.max(other.jerk_by_speed),
        }
    }
}

/// Derivatives of one joint by path length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointJet {
    /// q', mm (degrees) per mm of path.
    pub d1: f64,
    /// q'', the same per mm.
    pub d2: f64,
    /// q''', the same per mm².
    pub d3: f64,
}

/// Derivatives of one joint at one checkpoint, over its limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Row {
    /// q' / A.
    pub(super) a1: f64,
    /// q'' / A.
    pub(super) a2: f64,
    /// q' / J.
    pub(super) j1: f64,
    /// 3 q'' / J.
    pub(super) j2: f64,
    /// q''' / J.
    pub(super) j3: f64,
    /// Jerk beside a kink, over speed and J.
    pub(super) kink: f64,
}

/// Caps of b over one span, each greater than 0; infinite where nothing caps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Caps {
    pub(super) begin: f64,
    /// Of the middle Bézier ordinate of b.
    pub(super) middle: f64,
    pub(super) end: f64,
}

/// A path on knots: lengths of spans, and what bounds b, u and w at the beginning, middle and end of each.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    limits: Vec<JointLimits>,
    lengths: Vec<f64>,
    /// Estimated time of every span, s.
    times_s: Vec<f64>,
    caps: Vec<Caps>,
    /// Index of the first row of every span, and whether it has checkpoints at its quarters too.
    first: Vec<(usize, bool)>,
    /// By span, checkpoint, joint.
    rows: Vec<Row>,
}

/// Where checkpoints are, as parts of the span, and their weights in the integral over it (Simpson).
pub(super) const CHECKPOINTS: [(f64, f64); 3] = [(0.0, 1.0 / 6.0), (0.5, 4.0 / 6.0), (1.0, 1.0 / 6.0)];
/// The same for spans on which derivatives change much.
pub(super) const FINE_CHECKPOINTS: [(f64, f64); 5] = [
    (0.0, 1.0 / 12.0),
    (0.25, 4.0 / 12.0),
    (0.5, 2.0 / 12.0),
    (0.75, 4.0 / 12.0),
    (1.0, 1.0 / 12.0),
];
/// What jerk may stray from the chord between two checkpoints without further ones, over the limit.
const STRAY: f64 = 0.006;
/// The same of acceleration.
const STRAY_ACCELERATION: f64 = 0.003;
/// Crest of jerk between two checkpoints, over the limit, from which further ones are needed.
pub const CREST: f64 = 0.02;
/// The same where it comes from the greatest speed in a span.
const PEAK: f64 = 0.01;

/// By how much jerk, over its limit, may rise between two checkpoints above what they show, where the curvature of a joint and
/// the acceleration along the path both change: with both linear in s, the second derivative of q''' v³ + 3 q'' v a + q' s...
/// by s is 7 q''' v ds.../dv, and a parabola rises above its ends by an eighth of that. The jerk along the path is taken as
/// high as the joints allow it.
pub fn crest(limits: &[JointLimits], length: f64, [begin, middle, end]: [&[JointJet]; 3]) -> f64 {
    let mut along = f64::INFINITY;
    for (joint, limits) in limits.iter().enumerate() {
        let d1 = [begin, middle, end].map(|jets| jets[joint].d1.abs());
        along = along.min(JERK_USE * limits.jerk / d1[0].max(d1[1]).max(d1[2]));
    }
    let joints = limits.iter().enumerate();
    let over = joints.map(|(joint, limits)| {
        let (first, second) = (
            (middle[joint].d2 - begin[joint].d2).abs(),
            (end[joint].d2 - middle[joint].d2).abs(),
        );
        0.875 * first.max(second) * along * 0.5 * length / limits.jerk
    });
    over.fold(0.0, f64::max)
}

/// By how much jerk, over its limit, may rise between two checkpoints where the speed has its greatest value between them, at a
/// quarter of the span from the nearest: b is a parabola.
fn peak(limits: &[JointLimits], length: f64, time_s: f64, jets: &[JointJet]) -> f64 {
    let along = limits.iter().zip(jets).fold(f64::INFINITY, |least, (limits, jet)| {
        least.min(limits.jerk / jet.d1.abs())
    });
    along * time_s * time_s * time_s / (32.0 * length)
}

/// Time of a span over the estimated one, for the greatest speed in it.
const SLOWER: f64 = 1.5;

/// Whether joints with these derivatives move evenly.
fn are_even(jets: &[JointJet]) -> bool {
    jets.iter().all(|jet| jet.d2 == 0.0 && jet.d3 == 0.0)
}

/// Parts of the limits of acceleration and jerk that are planned with where joints have these derivatives, and jerk may rise by
/// `crest` over its limit between checkpoints.
pub(super) fn uses(jets: &[JointJet], crest: f64) -> [f64; 2] {
    let acceleration = if are_even(jets) { EVEN_USE[0] } else { ACCELERATION_USE };
    [acceleration, (EVEN_USE[1] - crest).max(JERK_USE)]
}

/// Limits that are planned with along a straight stretch on which joints have these derivatives, for speeds up to `feed`.
pub(in crate::plan) fn even_limits(limits: &[JointLimits], jets: &[JointJet], feed: f64) -> PathLimits {
    let mut along = PathLimits {
        v: feed,
        a: f64::INFINITY,
        j: f64::INFINITY,
    };
    for (limits, jet) in limits.iter().zip(jets) {
        let d1 = jet.d1.abs();
        along.v = along.v.min(limits.velocity / d1);
        along.a = along.a.min(limits.acceleration / d1);
        along.j = along.j.min(limits.jerk / d1);
    }
    PathLimits {
        v: SPEED_USE * along.v,
        a: EVEN_USE[0] * along.a,
        j: EVEN_USE[1] * along.j,
    }
}

impl Grid {
    /// No spans yet.
    pub fn new(limits: &[JointLimits]) -> Grid {
        Grid {
            limits: limits.to_vec(),
            ..Grid::default()
        }
    }

    /// Adds a span behind the last one.
    ///
    /// `cap` is the greatest b by programmed feed (infinite: none), `checkpoints` the derivatives of every joint at the
    /// beginning, middle and end, seen from within the span. q' and q'' must go on continuously from span to span, but beside
    /// kinks that have been passed: `taken` says what they take of the limits of every joint there, and is empty elsewhere.
    ///
    /// `time_s` is about how long the span takes.
    pub fn push_span(&mut self, length: f64, time_s: f64, cap: f64, checkpoints: [&[JointJet]; 3], taken: &[Taken]) {
        let mut speeds = Caps {
            begin: cap,
            middle: cap,
            end: cap,
        };
        for (joint, limits) in self.limits.iter().enumerate() {
            // b q'² <= V²: the Bézier ordinates of the quadratic through the three values bound b between checkpoints.
            let cap_at = |at: usize| {
                let speed = limits.velocity / checkpoints[at][joint].d1.abs();
                speed * speed
            };
            // Where a joint turns round its cap is infinite. A quadratic follows caps that are not too far apart.
            const APART: f64 = 1.5;
            let middle = cap_at(1).min(APART * cap_at(0).max(cap_at(2)));
            let (begin, end) = (cap_at(0).min(APART * middle), cap_at(2).min(APART * middle));
            let ordinate = if middle.is_finite() {
                2.0 * middle - 0.5 * (begin + end)
            } else {
                f64::INFINITY
            };
            speeds.begin = speeds.begin.min(begin);
            speeds.middle = speeds.middle.min(ordinate);
            speeds.end = speeds.end.min(end);
        }
        let margin = SPEED_USE * SPEED_USE;
        speeds.begin *= margin;
        speeds.middle *= margin;
        speeds.end *= margin;
        self.lengths.push(length);
        self.times_s.push(time_s);
        self.caps.push(speeds);
        let bent = crest(&self.limits, length, checkpoints);
        let peak = peak(&self.limits, length, SLOWER * time_s, checkpoints[1]);
        let even = checkpoints.iter().all(|jets| are_even(jets));
        let fine = bent > CREST || (even && peak > PEAK) || self.strays(cap, checkpoints);
        let crest = bent + peak;
        self.first.push((self.rows.len(), fine));
        // Beside a kink, the direction turns while acceleration along the path changes: little, but not nothing.
        let uses = |jets: &[JointJet], crest: f64| match taken {
            [] => uses(jets, crest),
            _ => [ACCELERATION_USE, JERK_USE],
        };
        let [begin, middle, end] = checkpoints;
        if fine {
            // At the quarters, derivatives are those of the parabola through the three.
            let quarter = |near: &[JointJet], far: &[JointJet], joint: usize| {
                let mix = |f: fn(&JointJet) -> f64| {
                    0.375 * f(&near[joint]) + 0.75 * f(&middle[joint]) - 0.125 * f(&far[joint])
                };
                JointJet {
                    d1: mix(|jet| jet.d1),
                    d2: mix(|jet| jet.d2),
                    d3: mix(|jet| jet.d3),
                }
            };
            let joints = 0..self.limits.len();
            let first: Vec<JointJet> = joints.clone().map(|joint| quarter(begin, end, joint)).collect();
            let third: Vec<JointJet> = joints.map(|joint| quarter(end, begin, joint)).collect();
            for jets in [begin, &first, middle, &third, end] {
                // Half as far apart.
                self.push_rows(jets, uses(jets, 0.25 * crest), taken);
            }
        } else {
            for jets in checkpoints {
                self.push_rows(jets, uses(jets, crest), taken);
            }
        }
    }

    fn push_rows(&mut self, jets: &[JointJet], [acceleration_use, jerk_use]: [f64; 2], taken: &[Taken]) {
        for (joint, (jet, limits)) in jets.iter().zip(&self.limits).enumerate() {
            let taken = taken.get(joint).copied().unwrap_or_default();
            let a = 1.0 / (acceleration_use * limits.acceleration - taken.acceleration);
            let j = 1.0 / (jerk_use * limits.jerk - taken.jerk);
            self.rows.push(Row {
                a1: jet.d1 * a,
                a2: jet.d2 * a,
                j1: jet.d1 * j,
                j2: 3.0 * jet.d2 * j,
                j3: jet.d3 * j,
                kink: taken.jerk_by_speed * j,
            });
        }
    }

    /// Whether the second or third derivatives leave the chord that is taken for them.
    fn strays(&self, cap: f64, [begin, middle, end]: [&[JointJet]; 3]) -> bool {
        // The speed that curvature allows, roughly.
        let mut v = cap.sqrt();
        for (joint, limits) in self.limits.iter().enumerate() {
            let d1 = begin[joint]
                .d1
                .abs()
                .max(middle[joint].d1.abs())
                .max(end[joint].d1.abs());
            let d3 = begin[joint]
                .d3
                .abs()
                .max(middle[joint].d3.abs())
                .max(end[joint].d3.abs());
            v = v.min(limits.velocity / d1).min(cube_root(2.0 * limits.jerk / d3));
            v = v.min((limits.acceleration / middle[joint].d2.abs()).sqrt());
        }
        let stray = |derivative: fn(&JointJet) -> f64, joint: usize| {
            let [first, second, third] = [begin, middle, end].map(|jets| derivative(&jets[joint]));
            (first - 2.0 * second + third).abs() / 8.0
        };
        let mut limits = self.limits.iter().enumerate();
        limits.any(|(joint, limits)| {
            stray(|jet| jet.d3, joint) * v * v * v > STRAY * limits.jerk
                || stray(|jet| jet.d2, joint) * v * v > STRAY_ACCELERATION * limits.acceleration
        })
    }

    /// Number of spans.
    pub fn spans(&self) -> usize {
        self.lengths.len()
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.limits.len()
    }

    /// Limits of the joints.
    pub fn limits(&self) -> &[JointLimits] {
        &self.limits
    }

    /// Length of a span.
    pub fn length(&self, span: usize) -> f64 {
        self.lengths[span]
    }

    /// Estimated time of a span, s.
    pub(super) fn time_s(&self, span: usize) -> f64 {
        self.times_s[span]
    }

    /// Some of the spans, as a grid of their own.
    pub fn part(&self, spans: std::ops::Range<usize>) -> Grid {
        let row = |span: usize| self.first.get(span).map_or(self.rows.len(), |first| first.0);
        let (begin, end) = (row(spans.start), row(spans.end));
        Grid {
            limits: self.limits.clone(),
            lengths: self.lengths[spans.clone()].to_vec(),
            times_s: self.times_s[spans.clone()].to_vec(),
            caps: self.caps[spans.clone()].to_vec(),
            first: self.first[spans]
                .iter()
                .map(|&(first, fine)| (first - begin, fine))
                .collect(),
            rows: self.rows[begin..end].to_vec(),
        }
    }

    /// Forgets the first `spans` spans; the others move to the front.
    pub fn drop_front(&mut self, spans: usize) {
        let spans = spans.min(self.spans());
        let rows = self.first.get(spans).map_or(self.rows.len(), |first| first.0);
        self.lengths.drain(..spans);
        self.times_s.drain(..spans);
        self.caps.drain(..spans);
        self.first.drain(..spans);
        self.rows.drain(..rows);
        for first in &mut self.first {
            first.0 -= rows;
        }
    }

    /// Forgets all spans.
    pub fn clear(&mut self) {
        self.lengths.clear();
        self.times_s.clear();
        self.caps.clear();
        self.first.clear();
        self.rows.clear();
    }

    pub(super) fn caps(&self, span: usize) -> Caps {
        self.caps[span]
    }

    /// Greatest b at the knot where a span begins.
    pub(super) fn knot_cap(&self, span: usize) -> f64 {
        let here = self.caps.get(span).map_or(f64::INFINITY, |caps| caps.begin);
        match span.checked_sub(1) {
            Some(before) => here.min(self.caps[before].end),
            None => here,
        }
    }

    /// Places and weights of the checkpoints of a span.
    pub(super) fn checkpoints(&self, span: usize) -> &'static [(f64, f64)] {
        if self.is_fine(span) {
            &FINE_CHECKPOINTS
        } else {
            &CHECKPOINTS
        }
    }

    pub(super) fn is_fine(&self, span: usize) -> bool {
        self.first[span].1
    }

    /// The rows of one checkpoint of a span, one per joint.
    pub(super) fn rows(&self, span: usize, checkpoint: usize) -> &[Row] {
        let joints = self.limits.len();
        let first = self.first[span].0 + checkpoint * joints;
        &self.rows[first..first + joints]
    }

    /// The rows of all checkpoints of a span.
    pub(super) fn all_rows(&self, span: usize) -> &[Row] {
        let first = self.first[span].0;
        &self.rows[first..first + self.checkpoints(span).len() * self.limits.len()]
    }
}
