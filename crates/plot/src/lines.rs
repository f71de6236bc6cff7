//! Numbers and lines of pictures: short labels, round steps, lines with fewer points.

/// Points looked at together when some are left out; bounds the work for any path.
const CHUNK: usize = 4096;

/// A number as short as its value allows, to a thousandth.
pub fn number(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Leaves out points that are not needed to stay within `tolerance` of all of them (Douglas and Peucker, in chunks).
pub fn thin_out(points: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    let far = |point: &(f64, f64), from: &(f64, f64), to: &(f64, f64)| distance(*point, *from, *to);
    let mut kept: Vec<(f64, f64)> = needed(points, tolerance, far)
        .into_iter()
        .map(|at| points[at])
        .collect();
    kept.dedup();
    kept
}

/// The same for places of any kind, by their numbers; `distance`: of a point from the straight line between two others.
pub fn needed<P>(points: &[P], tolerance: f64, distance: impl Fn(&P, &P, &P) -> f64) -> Vec<usize> {
    let mut kept: Vec<usize> = (!points.is_empty()).then_some(0).into_iter().collect();
    let mut start = 0;
    while start + 1 < points.len() {
        let end = (start + CHUNK).min(points.len() - 1);
        // Sections still to be looked at, the nearest last.
        let mut sections = vec![(start, end)];
        while let Some((from, to)) = sections.pop() {
            let farthest = (from + 1..to)
                .map(|at| (distance(&points[at], &points[from], &points[to]), at))
                .max_by(|a, b| a.0.total_cmp(&b.0))
                .filter(|(distance, _)| *distance > tolerance);
            match farthest {
                Some((_, at)) => sections.extend([(at, to), (from, at)]),
                None => kept.push(to),
            }
        }
        start = end;
    }
    kept
}

/// Distance of a point from the straight line between two ends.
fn distance(point: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (along, across) = (to.0 - from.0, to.1 - from.1);
    let length2 = along * along + across * across;
    let share = ((point.0 - from.0) * along + (point.1 - from.1) * across) / length2;
    // Ends that coincide have no direction: the share is not a number and the first end is as near as any.
    let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
    (point.0 - from.0 - share * along).hypot(point.1 - from.1 - share * across)
}

/// The next of 1, 2, 5, 10, 20, 50 and so on, also below 1.
pub fn round_up(value: f64) -> f64 {
    let decade = 10f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|step| step * decade)
        .into_iter()
        .find(|step| *step >= value * 0.999_999)
        .unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_straight_line_is_two_points_and_a_corner_three() {
        let mut points: Vec<(f64, f64)> = (0..=10_000).map(|i| (f64::from(i) * 0.01, 0.0)).collect();
        // One point more for each boundary of a chunk.
        assert_eq!(
            thin_out(&points, 0.005),
            [(0.0, 0.0), (40.96, 0.0), (81.92, 0.0), (100.0, 0.0)]
        );
        points.truncate(101);
        points.push((1.0, 1.0));
        points.extend([(1.0, 1.0); 5]);
        assert_eq!(thin_out(&points, 0.005), [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]);
        assert_eq!(thin_out(&[], 0.005), []);
        assert_eq!(thin_out(&[(3.0, 4.0)], 0.005), [(3.0, 4.0)]);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [0.0, -0.0001, 12.5, 1000.0, -3.25].map(number),
            ["0", "0", "12.5", "1000", "-3.25"]
        );
    }

    proptest! {
        #[test]
        fn every_point_stays_within_the_tolerance(
            points in prop::collection::vec((-10.0f64..10.0, -10.0f64..10.0), 2..60), tolerance in 0.001f64..5.0,
        ) {
            let kept = thin_out(&points, tolerance);
            prop_assert_eq!(kept.first(), points.first());
            prop_assert_eq!(kept.last(), points.last());
            for point in &points {
                let nearest = kept.windows(2).map(|ends| distance(*point, ends[0], ends[1])).fold(f64::INFINITY, f64::min);
                prop_assert!(nearest <= tolerance + 1e-12, "{point:?} is {nearest} away");
            }
        }
    }
}
