//! A path planned from rest to rest, and what its joints do at each millisecond.

use super::super::launch::between;
use super::slow_profile::slow_profile;
use super::spacing::{Cell, spacing};
use super::*;

/// A path by arc length.
pub(super) trait Path {
    fn length(&self) -> f64;
    fn place(&self, s: f64) -> Vec<f64>;
    fn jets(&self, s: f64) -> Vec<JointJet>;
    /// Places where the third derivative may jump.
    fn borders(&self) -> Vec<f64> {
        Vec::new()
    }
}

/// From rest to rest.
pub(super) struct Planned {
    pub(super) grid: Grid,
    pub(super) profile: Vec<State>,
    pub(super) from: Launch,
    pub(super) to: Launch,
    pub(super) solved: Solved,
    /// Part of its full strength with which a launch found a way to the feasible profile.
    pub(super) vigour: f64,
}

/// Time to a place within a span: s'' = u + w s.
pub(super) fn place(v: f64, u: f64, w: f64, t: f64) -> (f64, f64) {
    let x = w * t * t;
    let (mut s, mut speed) = (0.0, 0.0);
    let (mut even, mut odd) = (1.0, t);
    for k in 0..20 {
        // even = w^k t^2k / (2k)!, odd = w^k t^(2k+1) / (2k+1)!
        s += v * odd;
        speed += v * even;
        let n = 2.0 * f64::from(k);
        s += u * odd * t / (n + 2.0);
        speed += u * odd;
        even *= x / ((n + 1.0) * (n + 2.0));
        odd *= x / ((n + 2.0) * (n + 3.0));
    }
    (s, speed)
}

/// Seconds that a span takes.
pub(super) fn duration(from: State, to: State, length: f64) -> f64 {
    let w = (to.u - from.u) / length;
    let v = from.b.sqrt();
    let mut t = 2.0 * length / (v + to.b.sqrt());
    for _ in 0..20 {
        let (s, speed) = place(v, from.u, w, t);
        t -= (s - length) / speed;
    }
    t
}

/// Knots between two distances, about `dt` apart at the expected speed; pieces are cut into cells of at most 1.
pub(super) fn knots(
    path: &dyn Path,
    limits: &[JointLimits],
    cap: f64,
    dt: f64,
    from: &Launch,
    to: &Launch,
) -> Vec<f64> {
    let (begin, end) = (from.length(), path.length() - to.length());
    let mut borders: Vec<f64> = path.borders().into_iter().filter(|s| *s > begin && *s < end).collect();
    borders.push(end);
    let mut cells = Vec::new();
    let mut s = begin;
    for border in borders {
        let count = (border - s).ceil().max(4.0);
        let size = (border - s) / count;
        for _ in 0..count as usize {
            let jets: Vec<Vec<JointJet>> = (0..=4)
                .map(|i| path.jets((s + 0.25 * f64::from(i) * size).clamp(s + 1e-6 * size, s + size * (1.0 - 1e-6))))
                .collect();
            let places: Vec<&[JointJet]> = jets.iter().map(|jets| &jets[..]).collect();
            cells.push(Cell::new(limits, size, cap, 1, &places));
            s += size;
        }
        s = border;
    }
    let mut knots = vec![begin];
    spacing(&cells, from.start().b, to.start().b, dt, |_, length| {
        knots.push(knots[knots.len() - 1] + length)
    });
    knots
}

pub(super) fn grid_of(path: &dyn Path, limits: &[JointLimits], cap: f64, knots: &[f64]) -> Grid {
    let mut grid = Grid::new(limits);
    for pair in knots.windows(2) {
        let h = pair[1] - pair[0];
        let inside = 1e-6 * h;
        let jets = [
            path.jets(pair[0] + inside),
            path.jets(pair[0] + 0.5 * h),
            path.jets(pair[1] - inside),
        ];
        grid.push_span(h, 0.0, cap, [&jets[0], &jets[1], &jets[2]], &[]);
    }
    grid
}

/// Plans a whole path at once; says what went wrong.
pub(super) fn try_plan(path: &dyn Path, limits: &[JointLimits], cap: f64, dt: f64) -> Result<Planned, String> {
    let length = path.length();
    let mut vigour = 1.0;
    loop {
        let begin = launch(limits, cap, length, vigour, |s, jets| {
            jets.copy_from_slice(&path.jets(s))
        });
        let stop = launch(limits, cap, length, vigour, |s, jets| {
            jets.copy_from_slice(&path.jets(length - s))
        });
        let (Some(begin), Some(stop)) = (begin, stop) else {
            return Err("no launch".into());
        };
        let knots = knots(path, limits, cap, dt, &begin, &stop);
        let grid = grid_of(path, limits, cap, &knots);
        let mut profile = slow_profile(&grid, 0);
        let crawling = worst(&grid, 0..grid.spans(), &profile);
        if crawling.value >= 1.0 {
            return Err(format!("feasible {crawling:?}"));
        }
        if between(&grid, &mut profile, Some(begin.start()), Some(stop.stop())).is_err() {
            vigour *= 0.5;
            if vigour < 0.01 {
                return Err("no start".into());
            }
            continue;
        }
        let starting = worst(&grid, 0..grid.spans(), &profile);
        if starting.value >= 1.0 {
            return Err(format!("start {starting:?}"));
        }
        let solved = solve(
            &grid,
            0..grid.spans(),
            &mut profile,
            &Options::default(),
            &mut Workspace::default(),
        );
        return Ok(Planned {
            grid,
            profile,
            from: begin,
            to: stop,
            solved: solved.map_err(|infeasible| format!("{infeasible:?}"))?,
            vigour,
        });
    }
}

pub(super) fn plan(path: &dyn Path, limits: &[JointLimits], cap: f64, dt: f64) -> Planned {
    try_plan(path, limits, cap, dt).unwrap()
}

impl Planned {
    pub(super) fn time(&self) -> f64 {
        let spans = 0..self.grid.spans();
        let on: f64 = spans
            .map(|k| duration(self.profile[k], self.profile[k + 1], self.grid.length(k)))
            .sum();
        self.from.duration_s + on + self.to.duration_s
    }

    /// Path length at multiples of `cycle`, with rest before and behind.
    pub(super) fn samples(&self, path: &dyn Path, cycle: f64) -> Vec<f64> {
        let mut out = vec![0.0; 4];
        let mut time = -cycle;
        let mut begin = 0.0;
        let mut s = 0.0;
        let mut run = |duration: f64, s: f64, place: &dyn Fn(f64) -> f64| {
            while time + cycle < begin + duration {
                time += cycle;
                out.push(s + place(time - begin));
            }
            begin += duration;
        };
        run(self.from.duration_s, 0.0, &|t| self.from.jerk * t * t * t / 6.0);
        s += self.from.length();
        for k in 0..self.grid.spans() {
            let (from, to) = (self.profile[k], self.profile[k + 1]);
            let length = self.grid.length(k);
            let w = (to.u - from.u) / length;
            run(duration(from, to, length), s, &|t| place(from.b.sqrt(), from.u, w, t).0);
            s += length;
        }
        run(self.to.duration_s, 0.0, &|t| {
            path.length() - self.to.jerk * (self.to.duration_s - t).powi(3) / 6.0
        });
        out.extend([path.length(); 4]);
        out
    }

    /// Greatest first, second and third difference of any joint at 1 ms, over its limit; and how many were above 1.
    pub(super) fn differences(&self, path: &dyn Path, limits: &[JointLimits]) -> ([f64; 3], usize) {
        let cycle = 1e-3;
        let q: Vec<Vec<f64>> = self.samples(path, cycle).iter().map(|&s| path.place(s)).collect();
        let mut greatest = [0.0f64; 3];
        let mut over = 0;
        for (joint, limits) in limits.iter().enumerate() {
            let mut values: Vec<f64> = q.iter().map(|q| q[joint]).collect();
            for (order, limit) in [limits.velocity, limits.acceleration, limits.jerk]
                .into_iter()
                .enumerate()
            {
                values = values.windows(2).map(|pair| (pair[1] - pair[0]) / cycle).collect();
                for value in &values {
                    greatest[order] = greatest[order].max(value.abs() / limit);
                    over += usize::from(value.abs() > limit);
                }
            }
        }
        (greatest, over)
    }

    /// Greatest speed, acceleration and jerk of any joint over its limit at several places within every span.
    pub(super) fn between(&self, path: &dyn Path, limits: &[JointLimits], places: u32) -> [f64; 3] {
        let mut greatest = [0.0f64; 3];
        let mut begin = self.from.length();
        for k in 0..self.grid.spans() {
            let (from, to) = (self.profile[k], self.profile[k + 1]);
            let length = self.grid.length(k);
            let w = (to.u - from.u) / length;
            for place in 0..=places {
                let s = length * f64::from(place) / f64::from(places);
                let (b, u) = (from.b + s * (2.0 * from.u + w * s), from.u + w * s);
                let v = b.sqrt();
                let inside = s.clamp(1e-6 * length, length * (1.0 - 1e-6));
                for (jet, limits) in path.jets(begin + inside).iter().zip(limits) {
                    let values = [
                        jet.d1 * v / limits.velocity,
                        (jet.d1 * u + jet.d2 * b) / limits.acceleration,
                        (jet.d1 * w + 3.0 * jet.d2 * u + jet.d3 * b) * v / limits.jerk,
                    ];
                    for (greatest, value) in greatest.iter_mut().zip(values) {
                        *greatest = greatest.max(value.abs());
                    }
                }
            }
            begin += length;
        }
        greatest
    }
}
