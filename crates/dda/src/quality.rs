//! How well a stepped path follows a circle.

/// Path variance: mean square of the distance from the circle, in steps², over the points reached by steps.
///
/// `points` are those after each step, without the start point; the divisor is their number less one. Not a number for
/// fewer than two points.
pub fn path_variance(points: impl IntoIterator<Item = [i32; 2]>, radius: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u32);
    for [x, y] in points {
        let off = libm::hypot(f64::from(x), f64::from(y)) - radius;
        sum += off * off;
        count += 1;
    }
    if count < 2 {
        return f64::NAN;
    }
    sum / f64::from(count - 1)
}

/// How often a step of one axis alone is followed at once by one of the other axis alone.
pub fn sawteeth(steps: impl IntoIterator<Item = [i8; 2]>) -> u32 {
    let (mut count, mut before) = (0, [0, 0]);
    for step in steps {
        let alone = |step: [i8; 2]| (step[0] == 0) != (step[1] == 0);
        count += u32::from(alone(before) && alone(step) && (before[0] == 0) != (step[0] == 0));
        before = step;
    }
    count
}
