//! The frequency response of a joint, from strokes to and fro of one frequency after the other.
//!
//! In:  limits of a joint, a [`Record`]. Out: strokes to be run; what came of them at each frequency, bandwidth, resonance.

use super::complex::Complex;
use super::record::{Move, Record};
use super::stability::{Margins, feedback, margins_of};
use motion::rt::PidGains;
use serde::Serialize;
use std::f64::consts::TAU;

/// Strokes there and back at each frequency: at the least, and for at least so long, s.
const PERIODS_MIN: u32 = 5;
const TIME_S: f64 = 0.8;
/// The first of them are left out: the joint is not yet in its stride.
const PERIODS_LEFT_OUT: f64 = 2.0;
/// Frequencies for each tenfold.
const PER_DECADE: f64 = 12.0;

/// Strokes of one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strokes {
    pub frequency_hz: f64,
    /// From end to end, mm.
    pub length_mm: f64,
    /// Greatest speed of a stroke, mm/s.
    pub velocity_mm_s: f64,
    /// There and back.
    pub periods: u32,
}

/// What one joint may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub velocity_mm_s: f64,
    pub acceleration_mm_s2: f64,
    pub jerk_mm_s3: f64,
    /// Longest and shortest stroke, mm.
    pub stroke_mm: [f64; 2],
}

impl Bounds {
    /// Least time of a move from rest to rest, s.
    pub fn time_s(&self, length_mm: f64) -> f64 {
        let Bounds {
            velocity_mm_s: v,
            acceleration_mm_s2: a,
            jerk_mm_s3: j,
            ..
        } = *self;
        // Time and way of speeding up to a speed: with jerk alone, or with the acceleration held for a while.
        let speeding_s = |speed: f64| {
            if speed * j <= a * a {
                2.0 * (speed / j).sqrt()
            } else {
                speed / a + a / j
            }
        };
        let way_mm = |speed: f64| speed * speeding_s(speed);
        if way_mm(v) <= length_mm {
            return 2.0 * speeding_s(v) + (length_mm - way_mm(v)) / v;
        }
        let (mut low, mut high) = (0.0, v);
        for _ in 0..60 {
            let middle = f64::midpoint(low, high);
            if way_mm(middle) < length_mm {
                low = middle
            } else {
                high = middle
            }
        }
        2.0 * speeding_s(high)
    }

    /// Strokes from slow to fast between two frequencies, as far as the limits let a joint swing visibly.
    pub fn strokes(&self, from_hz: f64, to_hz: f64) -> Vec<Strokes> {
        let steps = ((to_hz / from_hz).log10() * PER_DECADE).ceil().max(1.0) as u32;
        let frequencies = (0..=steps).map(|step| from_hz * (to_hz / from_hz).powf(f64::from(step) / f64::from(steps)));
        let of = |frequency_hz: f64| {
            let [longest_mm, shortest_mm] = self.stroke_mm;
            let half_s = 0.5 / frequency_hz;
            // A longest stroke that would take less time is run more slowly.
            let (length_mm, velocity_mm_s) = if self.time_s(longest_mm) < half_s {
                let at = |velocity_mm_s| Bounds { velocity_mm_s, ..*self };
                let velocity_mm_s = last(self.velocity_mm_s, |velocity| at(velocity).time_s(longest_mm) > half_s);
                (longest_mm, velocity_mm_s)
            } else {
                let length_mm = last(longest_mm, |length| self.time_s(length) < half_s);
                (length_mm, self.velocity_mm_s)
            };
            (length_mm >= shortest_mm).then_some(Strokes {
                frequency_hz,
                length_mm,
                velocity_mm_s,
                periods: PERIODS_MIN.max((TIME_S * frequency_hz).ceil() as u32),
            })
        };
        frequencies.filter_map(of).collect()
    }
}

/// The last value from 0 to `most` that still holds.
fn last(most: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, most);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// A frequency response at one frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    pub frequency_hz: f64,
    /// Actual place by command.
    pub gain_db: f64,
    pub phase_deg: f64,
    #[serde(skip)]
    pub closed: Complex,
    /// Open loop; `None`: the drive closes it.
    #[serde(skip)]
    pub open: Option<Complex>,
}

/// What a sweep has shown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sweep {
    pub points: Vec<Point>,
    /// Where the response comes down to -3 dB, Hz; `None`: beyond what was swept.
    pub bandwidth_hz: Option<f64>,
    /// Highest point of the response: Hz and dB.
    pub peak: [f64; 2],
    /// Of the loop that the control closes; what lies beyond what was swept is not a number.
    pub margins: Option<Margins>,
}

/// What came of strokes, by the moves that a record has of them; `gains`: of the loop, where the control closes it.
pub fn sweep(record: &Record, moves: &[Move], periods: &[u32], gains: Option<&PidGains>) -> Sweep {
    let mut points: Vec<Point> = moves
        .iter()
        .zip(periods)
        .map(|(of, periods)| point(record, of, f64::from(*periods), gains))
        .collect();
    points.sort_by(|one, other| one.frequency_hz.total_cmp(&other.frequency_hz));
    // The phase goes on where it has passed -180 degrees.
    for at in 1..points.len() {
        let before = points[at - 1].phase_deg;
        while points[at].phase_deg > before + 180.0 {
            points[at].phase_deg -= 360.0;
        }
    }
    let below = points
        .windows(2)
        .find(|pair| pair[0].gain_db >= -3.0 && pair[1].gain_db < -3.0);
    let bandwidth_hz = below.map(|pair| {
        let share = (pair[0].gain_db + 3.0) / (pair[0].gain_db - pair[1].gain_db);
        pair[0].frequency_hz * (pair[1].frequency_hz / pair[0].frequency_hz).powf(share)
    });
    let peak = points.iter().max_by(|one, other| one.gain_db.total_cmp(&other.gain_db));
    let open: Vec<(f64, Complex)> = points
        .iter()
        .filter_map(|it| Some((it.frequency_hz, it.open?)))
        .collect();
    Sweep {
        bandwidth_hz,
        peak: peak.map_or([0.0; 2], |peak| [peak.frequency_hz, peak.gain_db]),
        margins: gains.map(|_| margins_of(&open)),
        points,
    }
}

/// The response at the frequency of one set of strokes.
fn point(record: &Record, of: &Move, periods: f64, gains: Option<&PidGains>) -> Point {
    let cycles = of.motion.len() as f64;
    let about_hz = periods / (cycles * record.cycle_s);
    // Whole periods, of which the first ones do not count.
    let begin = of.motion.start + (cycles * PERIODS_LEFT_OUT / periods) as usize;
    let wave = |hz: f64, value: &dyn Fn(usize) -> f64| wave_of(record, begin..of.motion.end, hz, value);
    let command = |at: usize| record.cycles[at].command_mm;
    let nearby = (-20..=20).map(|step| about_hz * (1.0 + f64::from(step) * 0.05 / periods));
    let sizes = nearby.map(|hz| (hz, wave(hz, &command).size()));
    let (frequency_hz, _) = sizes
        .max_by(|one, other| one.1.total_cmp(&other.1))
        .unwrap_or((about_hz, 0.0));
    let [command, actual, output] = [
        wave(frequency_hz, &command),
        wave(frequency_hz, &|at| record.cycles[at].actual_mm),
        wave(frequency_hz, &|at| record.cycles[at].output),
    ];
    let closed = actual / command;
    let open = gains.map(|gains| feedback(gains, frequency_hz, record.cycle_s) * actual / output);
    Point {
        frequency_hz,
        gain_db: 20.0 * closed.size().log10(),
        phase_deg: closed.angle().to_degrees(),
        closed,
        open,
    }
}

/// How much of a wave of a frequency is in some cycles, beside what is constant; the ends count less, so that a part of a period does
/// not matter.
fn wave_of(record: &Record, cycles: std::ops::Range<usize>, hz: f64, value: &dyn Fn(usize) -> f64) -> Complex {
    let (begin, length) = (cycles.start, cycles.len() as f64);
    let weight = |at: usize| 1.0 - (TAU * ((at - begin) as f64 + 0.5) / length).cos();
    let weights: f64 = cycles.clone().map(weight).sum();
    let mean = cycles.clone().map(|at| weight(at) * value(at)).sum::<f64>() / weights;
    let turned = cycles.map(|at| {
        let turn = Complex::turn(-TAU * hz * (at - begin) as f64 * record.cycle_s);
        turn * (weight(at) * (value(at) - mean))
    });
    turned.fold(Complex::default(), |sum, part| sum + part) * (2.0 / weights)
}

#[cfg(test)]
mod tests {
    use super::super::record::tests::commanded;
    use super::*;

    const BOUNDS: Bounds = Bounds {
        velocity_mm_s: 150.0,
        acceleration_mm_s2: 1500.0,
        jerk_mm_s3: 30_000.0,
        stroke_mm: [10.0, 0.002],
    };

    #[test]
    fn times_of_strokes_are_those_of_limited_jerk() {
        // Jerk alone: d = 2 j (t/4)³. With velocity: v/a + a/j of speeding up.
        assert!((BOUNDS.time_s(0.06) - 0.04).abs() < 1e-9, "{}", BOUNDS.time_s(0.06));
        assert!(
            (BOUNDS.time_s(150.0) - (1.0 + 0.15)).abs() < 1e-9,
            "{}",
            BOUNDS.time_s(150.0)
        );
        let strokes = BOUNDS.strokes(1.0, 500.0);
        assert!((strokes[0].frequency_hz - 1.0).abs() < 1e-9 && strokes[0].length_mm == 10.0);
        assert!(
            strokes
                .windows(2)
                .all(|pair| pair[0].frequency_hz < pair[1].frequency_hz)
        );
        for strokes in strokes {
            assert!((0.002..=10.0).contains(&strokes.length_mm), "{strokes:?}");
            let bounds = Bounds {
                velocity_mm_s: strokes.velocity_mm_s,
                ..BOUNDS
            };
            let time_s = bounds.time_s(strokes.length_mm);
            assert!((time_s * strokes.frequency_hz - 0.5).abs() < 1e-6, "{strokes:?}");
        }
    }

    #[test]
    fn a_known_lag_is_found_at_its_frequency() {
        // A first-order lag of 8 ms, exact for a held command: 20 Hz at -3 dB.
        let lag_s = 0.008;
        let mut commands = vec![0.0; 100];
        let periods = [10, 10, 20, 40];
        for (hz, periods) in [5.0, 12.0, 19.89, 40.0].into_iter().zip(periods) {
            let cycles = (f64::from(periods) / hz * 1000.0) as u32;
            commands.extend((1..=cycles).map(|cycle| 0.5 - 0.5 * (TAU * hz * f64::from(cycle) * 0.001).cos()));
            commands.extend([*commands.last().unwrap(); 100]);
        }
        let mut record = commanded(commands);
        let share = (-record.cycle_s / lag_s).exp();
        for at in 1..record.cycles.len() {
            let before = record.cycles[at - 1];
            record.cycles[at].actual_mm = share * before.actual_mm + (1.0 - share) * before.command_mm;
        }
        let found = sweep(&record, &record.moves(), &periods, None);
        assert_eq!(found.points.len(), 4);
        for point in &found.points {
            let exact =
                Complex::from(1.0 - share) / (Complex::turn(TAU * point.frequency_hz * 0.001) - Complex::from(share));
            let off = (point.closed - exact).size() / exact.size();
            assert!(off < 0.02, "{point:?} {exact:?}");
        }
        let bandwidth_hz = found.bandwidth_hz.unwrap();
        assert!((bandwidth_hz - 19.9).abs() < 1.0, "{bandwidth_hz}");
        assert!(found.peak[1] < 0.2 && found.margins.is_none());
    }
}
