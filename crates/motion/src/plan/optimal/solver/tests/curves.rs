//! Two smooth closed curves with known best times, by arc length.

use super::super::JointJet;

/// Position and three derivatives by the parameter.
pub(super) type Parametric = fn(f64) -> [[f64; 3]; 4];

/// Radius 30 (1 + 0.35 cos 5t).
pub(super) fn star(t: f64) -> [[f64; 3]; 4] {
    let r = |k: i32| {
        let wave = 30.0 * 0.35 * 5f64.powi(k);
        match k {
            0 => 30.0 + wave * (5.0 * t).cos(),
            1 => -wave * (5.0 * t).sin(),
            2 => -wave * (5.0 * t).cos(),
            _ => wave * (5.0 * t).sin(),
        }
    };
    let (sin, cos) = t.sin_cos();
    let (r0, r1, r2, r3) = (r(0), r(1), r(2), r(3));
    [
        [r0 * cos, r0 * sin, 0.0],
        [r1 * cos - r0 * sin, r1 * sin + r0 * cos, 0.0],
        [
            r2 * cos - 2.0 * r1 * sin - r0 * cos,
            r2 * sin + 2.0 * r1 * cos - r0 * sin,
            0.0,
        ],
        [
            r3 * cos - 3.0 * r2 * sin - 3.0 * r1 * cos + r0 * sin,
            r3 * sin + 3.0 * r2 * cos - 3.0 * r1 * sin - r0 * cos,
            0.0,
        ],
    ]
}

/// (60 sin 2t, 40 sin 3t, 3 sin t).
pub(super) fn lissajous(t: f64) -> [[f64; 3]; 4] {
    let mut out = [[0.0; 3]; 4];
    for (axis, (size, n)) in [(60.0, 2.0), (40.0, 3.0), (3.0, 1.0)].into_iter().enumerate() {
        let (sin, cos) = f64::sin_cos(n * t);
        for (k, value) in [sin, n * cos, -n * n * sin, -n * n * n * cos].into_iter().enumerate() {
            out[k][axis] = size * value;
        }
    }
    out
}

/// A parametric curve over t in 0..2π, by arc length.
pub(super) struct Curve {
    at: Parametric,
    /// Length up to each of evenly spaced parameters.
    table: Vec<f64>,
}

fn speed(d1: &[f64; 3]) -> f64 {
    d1.iter().map(|x| x * x).sum::<f64>().sqrt()
}

impl Curve {
    pub(super) fn new(at: Parametric) -> Curve {
        let steps = 4000;
        let dt = std::f64::consts::TAU / f64::from(steps);
        let mut table = vec![0.0];
        for k in 0..steps {
            let t = f64::from(k) * dt;
            table.push(table[k as usize] + Curve::stretch(at, t, t + dt));
        }
        Curve { at, table }
    }

    /// Length between two near parameters, Gauss of order 10.
    fn stretch(at: Parametric, from: f64, to: f64) -> f64 {
        let nodes = [
            (0.0, 0.568_888_888_888_888_9),
            (0.538_469_310_105_683, 0.478_628_670_499_366_47),
            (0.906_179_845_938_664, 0.236_926_885_056_189_08),
        ];
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let f = |t: f64| speed(&at(t)[1]);
        let mut sum = nodes[0].1 * f(middle);
        for (x, weight) in &nodes[1..] {
            sum += weight * (f(middle - half * x) + f(middle + half * x));
        }
        sum * half
    }

    pub(super) fn length(&self) -> f64 {
        *self.table.last().unwrap()
    }

    fn parameter(&self, s: f64) -> f64 {
        let steps = self.table.len() - 1;
        let dt = std::f64::consts::TAU / steps as f64;
        let cell = self.table.partition_point(|&length| length <= s).clamp(1, steps) - 1;
        let start = cell as f64 * dt;
        let mut t = start + dt * (s - self.table[cell]) / (self.table[cell + 1] - self.table[cell]);
        for _ in 0..4 {
            let wrong = self.table[cell] + Curve::stretch(self.at, start, t) - s;
            t -= wrong / speed(&(self.at)(t)[1]);
        }
        t
    }

    pub(super) fn place(&self, s: f64) -> [f64; 3] {
        (self.at)(self.parameter(s))[0]
    }

    pub(super) fn jets(&self, s: f64) -> [JointJet; 3] {
        let [_, q1, q2, q3] = (self.at)(self.parameter(s));
        let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let v = speed(&q1);
        let a = dot(&q1, &q2) / v;
        let j = (dot(&q2, &q2) + dot(&q1, &q3) - a * a) / v;
        let (t1, t2, t3) = (1.0 / v, -a / v.powi(3), (3.0 * a * a / v - j) / v.powi(4));
        std::array::from_fn(|k| JointJet {
            d1: q1[k] * t1,
            d2: q2[k] * t1 * t1 + q1[k] * t2,
            d3: q3[k] * t1.powi(3) + 3.0 * q2[k] * t1 * t2 + q1[k] * t3,
        })
    }
}
