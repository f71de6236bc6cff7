//! How round a circle is that a machine has run: what a ball bar shows, from the positions that its drives tell.
//!
//! In:  samples of a program with turns one way and turns the other way.
//! Out: deviations of the radius in each direction, and what they say of the machine.
//!
//! Of each direction one whole turn counts, in the middle of the others, so that starting and stopping are left out. With the angle
//! φ from the first axis, the error of the radius is taken apart as `a0 + a1 cos φ + b1 sin φ + a2 cos 2φ + b2 sin 2φ`; of `b2`, the part
//! that turns its sign with the direction is a lag of one axis behind the other, the part that keeps it is squareness.
//! Positions are those of the drives: what is between motor and tool only a measuring instrument sees.

use plot::PathSample;
use serde::Serialize;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Beside a change of direction, where a peak is looked for, and behind that, with what it is compared, rad.
const PEAK_RAD: f64 = 0.06;
const BESIDE_RAD: f64 = 0.15;
/// Samples of a turn at the least.
const SAMPLES_MIN: usize = 100;

/// What one direction shows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Direction {
    /// Least and greatest deviation of the radius, um; circles around the programmed middle.
    pub radial_um: [f64; 2],
    /// Distance of two circles around the middle that fits best, with all points between them, um.
    pub circular_um: f64,
    /// Mean deviation of the radius, um.
    pub mean_um: f64,
    /// Peaks where an axis turns round: towards +, + of the second axis, -, - of the second axis; outward above 0, um.
    pub peaks_um: [f64; 4],
    /// Angle, rad, and deviation of the radius, um, in their order.
    #[serde(skip)]
    pub points: Vec<(f64, f64)>,
    /// `b2`, um.
    #[serde(skip)]
    skew_um: f64,
}

/// What both directions show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Circularity {
    /// Middle, as commanded, machine coordinates, mm.
    pub middle_mm: [f64; 2],
    /// As commanded, mm.
    pub radius_mm: f64,
    /// Counter-clockwise, then clockwise, in the plane of the two axes.
    pub directions: [Direction; 2],
    /// As `circular_um`, of both directions together.
    pub both_um: f64,
    /// By how much the angle between the axes is more than a right angle, um/m, as the drives see it.
    pub squareness_um_m: f64,
    /// Lag of the first axis behind the second, ms.
    pub lag_ms: f64,
}

/// Why there is no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoCircle {
    /// A direction was not run to its end.
    #[error("the circle was not run to its end")]
    Incomplete,
    /// Too few samples for its size and speed.
    #[error("there are too few positions of a turn: a slower or a larger circle has more")]
    TooFew,
}

/// Samples of the two lines that turn, both axes: commanded and actual.
fn turning(samples: &[PathSample], line: u32, axes: [usize; 2]) -> Vec<[[f64; 2]; 2]> {
    let of_line = samples.iter().filter(|sample| sample.line == line);
    of_line
        .map(|sample| [sample.command, sample.actual].map(|place| axes.map(|axis| place[axis])))
        .collect()
}

/// Judges the circles that were run on `lines`, `turns` each way, in the plane of `axes` (0 to 2), at a speed of `feed_mm_s`.
///
/// # Errors
/// [`NoCircle`]
pub fn circularity(
    samples: &[PathSample],
    lines: [u32; 2],
    turns: u32,
    axes: [usize; 2],
    feed_mm_s: f64,
) -> Result<Circularity, NoCircle> {
    let ways = lines.map(|line| turning(samples, line, axes));
    let commanded = || ways.iter().flatten().map(|[command, _]| *command);
    // Whole turns: the middle of what was commanded is that of the circle.
    let ends = |axis: usize| {
        let places = commanded().map(|command| command[axis]);
        places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| {
            [low.min(at), high.max(at)]
        })
    };
    let [across, up] = [0, 1].map(ends);
    let middle_mm = [across, up].map(|[low, high]| f64::midpoint(low, high));
    let radius_mm = (across[1] - across[0] + up[1] - up[0]) / 4.0;
    if !(radius_mm > 0.0 && radius_mm.is_finite()) {
        return Err(NoCircle::Incomplete);
    }
    let mut directions = Vec::new();
    for way in &ways {
        directions.push(direction(way, middle_mm, radius_mm, turns)?);
    }
    let Ok([(first, forward), (second, backward)]) = <[_; 2]>::try_from(directions) else {
        return Err(NoCircle::Incomplete);
    };
    if forward == backward {
        return Err(NoCircle::Incomplete);
    }
    let directions = match forward {
        true => [first, second],
        false => [second, first],
    };
    let [one, other] = &directions;
    let both: Vec<(f64, f64)> = one.points.iter().chain(&other.points).copied().collect();
    let both_um = width_um(&both, &fit(&both));
    Ok(Circularity {
        middle_mm,
        radius_mm,
        both_um,
        squareness_um_m: (one.skew_um + other.skew_um) / radius_mm * 1e3,
        lag_ms: (one.skew_um - other.skew_um) / feed_mm_s,
        directions,
    })
}

/// One direction, and whether it is counter-clockwise.
fn direction(
    way: &[[[f64; 2]; 2]],
    middle_mm: [f64; 2],
    radius_mm: f64,
    turns: u32,
) -> Result<(Direction, bool), NoCircle> {
    let polar = |place: [f64; 2]| {
        let [across, up] = [0, 1].map(|axis| place[axis] - middle_mm[axis]);
        (up.atan2(across), across.hypot(up))
    };
    let mut turned = 0.0_f64;
    let mut before = None;
    let mut points = Vec::new();
    // The turn in the midst of the others.
    let from = TAU * f64::from(turns - 1) / 2.0;
    for [command, actual] in way {
        let (at, _) = polar(*command);
        let step = before.map_or(0.0, |before: f64| (at - before + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0);
        before = Some(at);
        turned += step;
        if (from..from + TAU).contains(&turned.abs()) {
            let (angle, radius) = polar(*actual);
            points.push((angle.rem_euclid(TAU), (radius - radius_mm) * 1e3));
        }
    }
    if turned.abs() < TAU * (f64::from(turns) - 0.01) {
        return Err(NoCircle::Incomplete);
    }
    if points.len() < SAMPLES_MIN {
        return Err(NoCircle::TooFew);
    }
    let parts = fit(&points);
    // A shifted middle, or an ellipse, is no peak.
    let left: Vec<(f64, f64)> = points
        .iter()
        .map(|(angle, error)| (*angle, error - value(&parts, *angle)))
        .collect();
    let errors = || points.iter().map(|(_, error)| *error);
    let direction = Direction {
        radial_um: [
            errors().fold(f64::INFINITY, f64::min),
            errors().fold(f64::NEG_INFINITY, f64::max),
        ],
        circular_um: width_um(&points, &parts),
        mean_um: parts[0],
        peaks_um: [0.0, 1.0, 2.0, 3.0].map(|quarter| peak_um(&left, quarter * FRAC_PI_2)),
        skew_um: parts[4],
        points,
    };
    Ok((direction, turned > 0.0))
}

/// `a0, a1, b1, a2, b2` of points that lie evenly around.
fn fit(points: &[(f64, f64)]) -> [f64; 5] {
    let count = points.len() as f64;
    let mut sums = [0.0; 5];
    for (angle, error) in points {
        let (sin, cos) = angle.sin_cos();
        let (sin2, cos2) = (2.0 * angle).sin_cos();
        for (sum, with) in sums.iter_mut().zip([1.0, 2.0 * cos, 2.0 * sin, 2.0 * cos2, 2.0 * sin2]) {
            *sum += error * with / count;
        }
    }
    sums
}

/// What [`fit`] has found, at an angle.
fn value([mean, cosine, sine, cosine2, sine2]: &[f64; 5], angle: f64) -> f64 {
    let ((sin, cos), (sin2, cos2)) = (angle.sin_cos(), (2.0 * angle).sin_cos());
    mean + cosine * cos + sine * sin + cosine2 * cos2 + sine2 * sin2
}

/// Width of the ring around the best middle, um.
fn width_um(points: &[(f64, f64)], [_, cosine, sine, ..]: &[f64; 5]) -> f64 {
    let left = points.iter().map(|(angle, error)| {
        let (sin, cos) = angle.sin_cos();
        error - cosine * cos - sine * sin
    });
    let [low, high] = left.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], error| {
        [low.min(error), high.max(error)]
    });
    high - low
}

/// How far the deviation stands out at an angle against that beside it, um.
fn peak_um(points: &[(f64, f64)], at: f64) -> f64 {
    let near = |angle: f64| ((angle - at + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0).abs();
    let beside: Vec<f64> = points
        .iter()
        .filter(|(angle, _)| (PEAK_RAD..BESIDE_RAD).contains(&near(*angle)))
        .map(|(_, error)| *error)
        .collect();
    let usual = beside.iter().sum::<f64>() / beside.len().max(1) as f64;
    let within = points.iter().filter(|(angle, _)| near(*angle) < PEAK_RAD);
    let out = within.map(|(_, error)| error - usual);
    out.fold(
        0.0,
        |most: f64, error| if error.abs() > most.abs() { error } else { most },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS_MM: f64 = 20.0;
    const FEED_MM_S: f64 = 50.0;
    const LINES: [u32; 2] = [7, 9];

    /// Three turns each way around 100, 50; `actual` of the angle and of the direction is where the machine was, as an error in mm.
    fn run(actual: impl Fn(f64, f64) -> [f64; 2]) -> Vec<PathSample> {
        let mut samples = Vec::new();
        for (line, sign) in [(7, 1.0), (9, -1.0)] {
            for step in 0..=6000 {
                let angle = sign * 3.0 * TAU * f64::from(step) / 6000.0;
                let (sin, cos) = angle.sin_cos();
                let command = [100.0 + RADIUS_MM * cos, 50.0 + RADIUS_MM * sin, -5.0];
                let [across, up] = actual(angle, sign);
                samples.push(PathSample {
                    command,
                    actual: [command[0] + across, command[1] + up, -5.0],
                    rapid: false,
                    line,
                });
            }
            samples.push(PathSample {
                line: line + 1,
                ..samples[0]
            });
        }
        samples
    }

    fn judged(samples: &[PathSample]) -> Circularity {
        circularity(samples, LINES, 3, [0, 1], FEED_MM_S).unwrap()
    }

    fn near(found: f64, wanted: f64, off: f64) {
        assert!((found - wanted).abs() <= off, "{found}, wanted {wanted}");
    }

    #[test]
    fn a_machine_that_follows_exactly_is_round() {
        let found = judged(&run(|_, _| [0.0; 2]));
        near(found.middle_mm[0], 100.0, 1e-9);
        near(found.middle_mm[1], 50.0, 1e-9);
        near(found.radius_mm, RADIUS_MM, 1e-9);
        near(found.both_um, 0.0, 1e-6);
        for direction in &found.directions {
            near(direction.circular_um, 0.0, 1e-6);
            assert!(direction.points.len() > 1900, "{}", direction.points.len());
        }
    }

    #[test]
    fn a_lag_of_one_axis_is_told_from_squareness_and_from_a_shifted_middle() {
        // The first axis is where it was told to be 2 ms ago.
        let lag_s = 0.002;
        let found = judged(&run(|angle, sign| {
            let before = angle - sign * FEED_MM_S / RADIUS_MM * lag_s;
            [RADIUS_MM * (before.cos() - angle.cos()), 0.0]
        }));
        near(found.lag_ms, 2.0, 0.01);
        near(found.squareness_um_m, 0.0, 0.5);
        // 50 mm/s for 2 ms are 100 um: the ellipse is half of that out and half of it in.
        near(found.directions[0].circular_um, 100.0, 0.5);
        near(found.both_um, 100.0, 0.5);

        let found = judged(&run(|angle, _| [1e-4 * RADIUS_MM * angle.sin(), 0.0]));
        near(found.squareness_um_m, 100.0, 0.1);
        near(found.lag_ms, 0.0, 1e-3);

        let found = judged(&run(|_, _| [0.01, -0.02]));
        near(found.both_um, 0.0, 0.05);
        near(found.directions[0].radial_um[1], 22.36, 0.1);
        assert_eq!(found.directions[0].peaks_um.map(|peak| peak.abs() < 0.6), [true; 4]);
    }

    #[test]
    fn a_peak_where_an_axis_turns_round_is_found_there() {
        // The second axis hangs for a little when it turns round, at 90 and 270 degrees.
        let found = judged(&run(|angle, _| {
            let beside = (angle.rem_euclid(TAU) - FRAC_PI_2).abs();
            [0.0, 0.004 * (1.0 - beside / 0.03).max(0.0)]
        }));
        for direction in &found.directions {
            let [right, up, left, down] = direction.peaks_um;
            near(up, 4.0, 0.05);
            assert!(right.abs() + left.abs() + down.abs() < 0.1, "{:?}", direction.peaks_um);
        }
    }

    #[test]
    fn what_was_not_run_to_its_end_is_no_circle() {
        let samples = run(|_, _| [0.0; 2]);
        assert_eq!(
            circularity(&samples[..9000], LINES, 3, [0, 1], FEED_MM_S),
            Err(NoCircle::Incomplete)
        );
        assert_eq!(circularity(&[], LINES, 3, [0, 1], FEED_MM_S), Err(NoCircle::Incomplete));
        let few: Vec<PathSample> = samples.iter().step_by(100).copied().collect();
        assert_eq!(circularity(&few, LINES, 3, [0, 1], FEED_MM_S), Err(NoCircle::TooFew));
    }
}
