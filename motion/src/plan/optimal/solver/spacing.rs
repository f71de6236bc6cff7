//! Where to put knots: about evenly in time, at the speed that a quick pass over the path expects.
//!
//! In:  the path as cells, stretches on which one cap of speed and one acceleration will do.
//! Out: for each cell the lengths of its spans.

use super::grid::{JointJet, JointLimits};
use super::roots::cube_root;

/// A stretch of path within one piece of geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Length of path.
    pub length: f64,
    /// Greatest b at constant speed, finite.
    pub cap: f64,
    /// Acceleration along the path, greater than 0.
    pub acceleration: f64,
    /// Fewest spans to cut it into, at least 1.
    pub least: u32,
}

/// Fewest spans between two rests.
const LEAST_SPANS: f64 = 40.0;
/// Most spans of one cell: beyond, memory runs out before anyone waits that long.
const MOST_SPANS: f64 = 1e6;
/// Part of the acceleration limit by which the expected speed rises: jerk allows no more on average.
const ACCELERATION_PART: f64 = 0.6;

impl Cell {
    /// A cell from some places on it; `cap` is the greatest b by feed.
    pub fn new<'a>(
        limits: &[JointLimits],
        length: f64,
        cap: f64,
        least: u32,
        places: impl IntoIterator<Item = &'a [JointJet]>,
    ) -> Cell {
        let mut cell = Cell {
            length,
            cap: cap.min(1e12),
            acceleration: 1e12,
            least,
        };
        for jets in places {
            for (jet, limits) in jets.iter().zip(limits) {
                let v = limits.velocity / jet.d1.abs();
                let root = cube_root(limits.jerk / jet.d3.abs());
                let curved = limits.acceleration / jet.d2.abs();
                cell.cap = cell.cap.min(v * v).min(curved).min(root * root);
                cell.acceleration = cell.acceleration.min(limits.acceleration / jet.d1.abs());
            }
        }
        cell.acceleration *= ACCELERATION_PART;
        cell
    }
}

/// Lengths of spans for cells between two ends with known b (at a rest, that at the end of the launch), about `dt`
/// seconds each. Calls `span(cell, length)` for every span in order; the lengths of a cell add up to its own.
pub fn spacing(cells: &[Cell], from: f64, to: f64, dt: f64, mut span: impl FnMut(usize, f64)) {
    // Greatest b at the borders of cells, backward then forward.
    let mut borders = vec![to; cells.len() + 1];
    for (index, cell) in cells.iter().enumerate().rev() {
        let before = if index > 0 { cells[index - 1].cap } else { from };
        let reach = borders[index + 1] + 2.0 * cell.acceleration * cell.length;
        borders[index] = reach.min(cell.cap).min(before);
    }
    for (index, cell) in cells.iter().enumerate() {
        let reach = borders[index] + 2.0 * cell.acceleration * cell.length;
        borders[index + 1] = borders[index + 1].min(reach);
    }
    let slopes: Vec<Slope> = cells
        .iter()
        .enumerate()
        .map(|(index, cell)| Slope::new(cell, borders[index], borders[index + 1]))
        .collect();
    let total: f64 = slopes.iter().map(Slope::time).sum();
    let dt = dt.min(total / LEAST_SPANS);
    for (index, (cell, slope)) in cells.iter().zip(&slopes).enumerate() {
        let spans = (slope.time() / dt)
            .ceil()
            .clamp(f64::from(cell.least.max(1)), MOST_SPANS) as u32;
        let mut last = 0.0;
        for k in 1..=spans {
            let place = if k < spans {
                slope
                    .place(slope.time() * f64::from(k) / f64::from(spans))
                    .clamp(last, cell.length)
            } else {
                cell.length
            };
            // Only where a cell is so short that the difference drowns in rounding.
            if place > last {
                span(index, place - last);
            }
            last = place;
        }
    }
}

/// Speed over a cell: up, on, down.
struct Slope {
    from: f64,
    peak: f64,
    a: f64,
    up: f64,
    on: f64,
    down: f64,
}

impl Slope {
    fn new(cell: &Cell, from: f64, to: f64) -> Slope {
        let a = cell.acceleration;
        let peak = (0.5 * (from + to) + a * cell.length).min(cell.cap).max(from).max(to);
        let on = (cell.length - (2.0 * peak - from - to) / (2.0 * a)).max(0.0);
        let (v0, v, v1) = (from.sqrt(), peak.sqrt(), to.sqrt());
        Slope {
            from: v0,
            peak: v,
            a,
            up: (v - v0) / a,
            on: if v > 0.0 { on / v } else { 0.0 },
            down: (v - v1) / a,
        }
    }

    fn time(&self) -> f64 {
        self.up + self.on + self.down
    }

    fn place(&self, t: f64) -> f64 {
        let up = t.min(self.up);
        let on = (t - self.up).clamp(0.0, self.on);
        let down = (t - self.up - self.on).max(0.0);
        up * (self.from + 0.5 * self.a * up) + self.peak * on + down * (self.peak - 0.5 * self.a * down)
    }
}
