//! About how fast a run will be passed.
//!
//! In:  lengths with the speed that each allows, speeds at their ends.
//! Out: place, speed and acceleration by time.
//!
//! Speed changes with one acceleration everywhere. That is rough, but only the shape of the curve depends on it: where
//! motion is slow the path can turn on a shorter length.

/// A place, the speed there, and when it is passed.
#[derive(Clone, Copy, Debug)]
struct Node {
    s: f64,
    v: f64,
    t: f64,
}

/// Place, speed and acceleration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) s: f64,
    pub(super) v: f64,
    pub(super) a: f64,
}

/// Slowest speed, so that no time becomes infinite.
const LEAST: f64 = 0.01;

/// Speed over length.
#[derive(Clone, Debug, Default)]
pub(super) struct Pace {
    nodes: Vec<Node>,
}

impl Pace {
    /// Begins at place 0 with the speed `v`.
    pub(super) fn begin(&mut self, v: f64) {
        self.nodes.clear();
        self.nodes.push(Node { s: 0.0, v, t: 0.0 });
    }

    /// A stretch of this length that allows the speed `cap`, and what its end allows.
    pub(super) fn push(&mut self, length: f64, cap: f64, end: f64) {
        const CELL: f64 = 0.1;
        const CELLS: f64 = 100.0;
        let Some(last) = self.nodes.last_mut() else { return };
        last.v = last.v.min(cap);
        let from = last.s;
        let count = (length / CELL).ceil().clamp(4.0, CELLS);
        for k in 1..=count as u32 {
            self.nodes.push(Node {
                s: from + length * f64::from(k) / count,
                v: cap,
                t: 0.0,
            });
        }
        if let Some(last) = self.nodes.last_mut() {
            last.v = cap.min(end);
        }
    }

    /// Nothing follows: speeds come down to what acceleration allows, and get their times.
    pub(super) fn finish(&mut self, acceleration: f64) {
        let mut last = Node {
            s: 0.0,
            v: f64::INFINITY,
            t: 0.0,
        };
        for node in &mut self.nodes {
            node.v = node
                .v
                .min((last.v * last.v + 2.0 * acceleration * (node.s - last.s)).sqrt());
            last = *node;
        }
        let mut after = last;
        for node in self.nodes.iter_mut().rev() {
            node.v = node
                .v
                .min((after.v * after.v + 2.0 * acceleration * (after.s - node.s)).sqrt())
                .max(LEAST);
            after = *node;
        }
        let mut last = after;
        for node in &mut self.nodes[1..] {
            node.t = last.t + 2.0 * (node.s - last.s) / (node.v + last.v);
            last = *node;
        }
    }

    /// When a place is passed.
    pub(super) fn time_at(&self, s: f64) -> f64 {
        let k = self
            .nodes
            .partition_point(|node| node.s <= s)
            .clamp(1, self.nodes.len() - 1);
        let [a, b] = [self.nodes[k - 1], self.nodes[k]];
        let x = s - a.s;
        let change = (b.v * b.v - a.v * a.v) / (b.s - a.s);
        a.t + 2.0 * x / (a.v + (a.v * a.v + change * x).max(0.0).sqrt())
    }

    /// Where motion is at a time.
    pub(super) fn at(&self, t: f64) -> Moment {
        let k = self
            .nodes
            .partition_point(|node| node.t <= t)
            .clamp(1, self.nodes.len() - 1);
        let [from, to] = [self.nodes[k - 1], self.nodes[k]];
        let a = (to.v - from.v) / (to.t - from.t);
        let x = (t - from.t).clamp(0.0, to.t - from.t);
        Moment {
            s: (from.s + x * (from.v + 0.5 * a * x)).min(to.s),
            v: from.v + a * x,
            a,
        }
    }
}
