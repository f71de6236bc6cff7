//! Whether set-points keep the limits.
//!
//! In:  positions, one per cycle. Out: peaks of speed, acceleration and jerk per axis, and how many are over.
//!
//! Derivatives are plain differences of neighbouring set-points, which is what a drive sees. The machine rests before
//! the first and after the last.

use super::AxisLimits;
use crate::canon::{AXES, Position};

/// Differences of one order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Order {
    /// Greatest amount per axis.
    pub peak: [f64; AXES],
    /// Differences beyond the limit of their axis.
    pub over: usize,
}

/// What a series of set-points asks of the axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// mm/s or degrees/s.
    pub velocity: Order,
    /// Per s².
    pub acceleration: Order,
    /// Per s³.
    pub jerk: Order,
}

impl Peaks {
    /// Differences beyond any limit.
    pub fn over(&self) -> usize {
        self.velocity.over + self.acceleration.over + self.jerk.over
    }
}

/// Takes differences of `samples`, `cycle_s` apart. An axis without limits must not move at all.
pub fn check(samples: &[Position], cycle_s: f64, axes: &[Option<AxisLimits>; AXES]) -> Peaks {
    /// Excess that is rounding and not motion, as a part of the limit.
    const SLACK: f64 = 1e-6;
    let mut peaks = Peaks::default();
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return peaks;
    };
    for (axis, limits) in axes.iter().enumerate() {
        let limit = |f: fn(&AxisLimits) -> f64| limits.as_ref().map_or(0.0, f);
        let limit = [limit(|l| l.velocity), limit(|l| l.acceleration), limit(|l| l.jerk)];
        let mut window = [first.0[axis]; 4];
        let series = samples.iter().chain(std::iter::repeat_n(last, 3)).map(|q| q.0[axis]);
        for q in series {
            window = [window[1], window[2], window[3], q];
            let [q0, q1, q2, q3] = window;
            let differences = [
                (q3 - q2) / cycle_s,
                (q3 - 2.0 * q2 + q1) / cycle_s.powi(2),
                (q3 - 3.0 * q2 + 3.0 * q1 - q0) / cycle_s.powi(3),
            ];
            // Positions carry rounding of their own size, which differences multiply.
            let rounding = 8.0 * f64::EPSILON * q.abs().max(1.0);
            let orders = [&mut peaks.velocity, &mut peaks.acceleration, &mut peaks.jerk];
            for (k, order) in orders.into_iter().enumerate() {
                let amount = differences[k].abs();
                order.peak[axis] = order.peak[axis].max(amount);
                let noise = rounding / cycle_s.powi(k as i32 + 1);
                order.over += usize::from(amount > limit[k] * (1.0 + SLACK) + noise);
            }
        }
    }
    peaks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_and_their_excesses_are_counted() {
        let mut axes = [None; AXES];
        axes[0] = Some(AxisLimits {
            velocity: 10.0,
            acceleration: 50.0,
            jerk: 1000.0,
            travel: [-1.0, 1.0],
        });
        // 0 0 1 3 at 0.1 s: speeds 0 10 20 0, accelerations 0 100 100 -200 0, jerks 1000 0 -3000 2000.
        let samples = [0.0, 0.0, 1.0, 3.0].map(|x| Position::xyz(x, 0.0, 0.0));
        let peaks = check(&samples, 0.1, &axes);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * b;
        assert!(near(peaks.velocity.peak[0], 20.0) && near(peaks.acceleration.peak[0], 200.0));
        assert!(near(peaks.jerk.peak[0], 3000.0));
        assert_eq!(
            (peaks.velocity.over, peaks.acceleration.over, peaks.jerk.over),
            (1, 3, 2)
        );
        assert_eq!(check(&samples[..2], 0.1, &axes).over(), 0);
        assert_eq!(check(&[], 0.1, &axes), Peaks::default());
    }
}
