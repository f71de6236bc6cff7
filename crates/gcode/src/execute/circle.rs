//! Geometry of G2 and G3 in their plane: centre and turns from I J K or R.
//!
//! In:  start and end in the plane, the words of the line; all lengths mm.
//! Out: [`Arc`], or the rule that it breaks (texts in program units).
//!
//! Tolerances are those of LinuxCNC.

use crate::error::ArcError;
use motion::canon::LengthUnit;

/// Most turns of one arc.
pub(crate) const TURNS_MAX: i32 = 1_000_000;

/// Relative difference of start and end radius up to which an arc is run, whatever its size.
const RADIUS_TOLERANCE_RELATIVE: f64 = 0.001;

/// How much smaller than half the chord a radius may be, mm; such an arc becomes a half circle.
const HALF_CHORD_TOLERANCE_MM: f64 = 0.00127;

/// Difference of start and end radius up to which an arc is run, mm.
fn radius_tolerance_mm(unit: LengthUnit) -> f64 {
    // 2 * sqrt(2) times the last digit that programs in this unit usually have.
    let units = match unit {
        LengthUnit::Millimetre => 0.01,
        LengthUnit::Inch => 0.001,
    };
    2.0 * std::f64::consts::SQRT_2 * units * unit.mm()
}

/// A circle in a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Arc {
    /// Centre on the first and second axis, mm.
    pub(crate) centre_mm: [f64; 2],
    /// As in `motion::canon::Call::ArcFeed`.
    pub(crate) turns: i32,
}

/// Direction and number of turns of an arc: `count` of P, at least 1.
pub(crate) fn signed_turns(clockwise: bool, count: i32) -> i32 {
    if clockwise { -count } else { count }
}

/// The number of turns that P names.
pub(crate) fn turns_of(p: f64) -> Result<i32, ArcError> {
    crate::code::integer(p)
        .and_then(|turns| i32::try_from(turns).ok())
        .filter(|turns| (1..=TURNS_MAX).contains(turns))
        .ok_or(ArcError::Turns {
            value: p,
            max: TURNS_MAX,
        })
}

/// Centre form. Start and end differ in radius by less than the tolerance; what remains the path must spiral off.
pub(crate) fn by_centre(
    start_mm: [f64; 2],
    end_mm: [f64; 2],
    centre_mm: [f64; 2],
    turns: i32,
    unit: LengthUnit,
    tolerance_mm: Option<f64>,
) -> Result<Arc, ArcError> {
    let start_radius_mm = distance_mm(start_mm, centre_mm);
    let end_radius_mm = distance_mm(end_mm, centre_mm);
    if start_radius_mm == 0.0 || end_radius_mm == 0.0 {
        return Err(ArcError::RadiusZero);
    }
    // abs > 100 * tolerance, or abs > tolerance and abs > 0.1 % of the greater radius: refused.
    let difference_mm = (start_radius_mm - end_radius_mm).abs();
    let relative_mm = RADIUS_TOLERANCE_RELATIVE * start_radius_mm.max(end_radius_mm);
    let absolute_mm = tolerance_mm.unwrap_or_else(|| radius_tolerance_mm(unit));
    let tolerance_mm = relative_mm.clamp(absolute_mm, 100.0 * absolute_mm);
    if difference_mm > tolerance_mm {
        return Err(ArcError::RadiiDiffer {
            start: start_radius_mm / unit.mm(),
            end: end_radius_mm / unit.mm(),
            tolerance: tolerance_mm / unit.mm(),
            centre: centre_mm.map(|mm| mm / unit.mm()),
            end_at: end_mm.map(|mm| mm / unit.mm()),
        });
    }
    Ok(Arc { centre_mm, turns })
}

/// R form: at most half a circle for a positive radius, more for a negative one. `start_mm` and `end_mm` differ.
///
/// The centre lies on the perpendicular bisector of the chord, `sqrt(r² - h²)` from its middle (`h` half the chord):
/// to the left of the way for a counter-clockwise arc of at most half a circle.
pub(crate) fn by_radius(
    start_mm: [f64; 2],
    end_mm: [f64; 2],
    radius_mm: f64,
    turns: i32,
    unit: LengthUnit,
) -> Result<Arc, ArcError> {
    let half = [(end_mm[0] - start_mm[0]) / 2.0, (end_mm[1] - start_mm[1]) / 2.0];
    let half_chord_mm = libm::hypot(half[0], half[1]);
    let magnitude_mm = radius_mm.abs();
    if half_chord_mm - magnitude_mm > HALF_CHORD_TOLERANCE_MM {
        return Err(ArcError::RadiusTooSmall {
            radius: magnitude_mm / unit.mm(),
            half_chord: half_chord_mm / unit.mm(),
        });
    }
    // (r - h)(r + h) loses no digits where r² - h² would.
    let offset_mm = ((magnitude_mm - half_chord_mm).max(0.0) * (magnitude_mm + half_chord_mm)).sqrt();
    let left = (turns > 0) == (radius_mm > 0.0);
    let share = if left { offset_mm } else { -offset_mm } / half_chord_mm;
    let middle = [start_mm[0] + half[0], start_mm[1] + half[1]];
    Ok(Arc {
        centre_mm: [middle[0] - share * half[1], middle[1] + share * half[0]],
        turns,
    })
}

/// Length of the arc in its plane, mm.
pub(crate) fn length_mm(arc: Arc, start_mm: [f64; 2], end_mm: [f64; 2]) -> f64 {
    let radius_mm = distance_mm(start_mm, arc.centre_mm);
    radius_mm * sweep(arc, start_mm, end_mm)
}

/// Angle swept, radians, above 0.
fn sweep(arc: Arc, start_mm: [f64; 2], end_mm: [f64; 2]) -> f64 {
    use std::f64::consts::TAU;
    let [cx, cy] = arc.centre_mm;
    let angle = |point: [f64; 2]| libm::atan2(point[1] - cy, point[0] - cx);
    let forward = (angle(end_mm) - angle(start_mm)) * f64::from(arc.turns.signum());
    // A full turn where start and end are the same direction; a rounding error below it is not a whole turn more.
    let part = forward.rem_euclid(TAU);
    let part = if part < 1e-12 { TAU } else { part };
    part + TAU * f64::from(arc.turns.abs() - 1)
}

fn distance_mm(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MM: LengthUnit = LengthUnit::Millimetre;

    fn centre_of(result: Result<Arc, ArcError>) -> [f64; 2] {
        result.unwrap().centre_mm
    }

    #[test]
    fn radius_form_takes_the_side_that_sign_and_direction_name() {
        // Quarter circles of radius 5 from (5, 0) to (0, 5): counter-clockwise about the origin.
        let (start, end) = ([5.0, 0.0], [0.0, 5.0]);
        let near = |centre: [f64; 2], x: f64, y: f64| {
            assert!(
                (centre[0] - x).abs() < 1e-12 && (centre[1] - y).abs() < 1e-12,
                "{centre:?}"
            );
        };
        near(centre_of(by_radius(start, end, 5.0, 1, MM)), 0.0, 0.0);
        near(centre_of(by_radius(start, end, -5.0, 1, MM)), 5.0, 5.0);
        near(centre_of(by_radius(start, end, 5.0, -1, MM)), 5.0, 5.0);
        near(centre_of(by_radius(start, end, -5.0, -1, MM)), 0.0, 0.0);
    }

    #[test]
    fn a_radius_just_below_half_the_chord_makes_a_half_circle() {
        assert_eq!(
            centre_of(by_radius([0.0, 0.0], [10.0, 0.0], 4.9988, -1, MM)),
            [5.0, 0.0]
        );
        assert!(by_radius([0.0, 0.0], [10.0, 0.0], 4.9987, -1, MM).is_err());
    }

    #[test]
    fn the_radius_tolerance_grows_with_the_radius_up_to_a_hundredfold() {
        // 2 * sqrt(2) * 0.01 mm = 0.0283 mm; in inches 0.0028 inch = 0.0718 mm.
        let run = |radius: f64, difference: f64, unit| {
            by_centre([radius, 0.0], [0.0, radius + difference], [0.0, 0.0], 1, unit, None).is_ok()
        };
        assert!(run(1.0, 0.028, MM) && !run(1.0, 0.029, MM));
        assert!(run(1.0, 0.071, LengthUnit::Inch) && !run(1.0, 0.072, LengthUnit::Inch));
        assert!(run(1000.0, 1.0, MM) && !run(1000.0, 1.01, MM));
        assert!(run(10_000.0, 2.82, MM) && !run(10_000.0, 2.83, MM));
    }

    #[test]
    fn lengths_count_turns() {
        let arc = |turns| Arc {
            centre_mm: [0.0, 0.0],
            turns,
        };
        let length = |turns, end| length_mm(arc(turns), [2.0, 0.0], end);
        let tau = std::f64::consts::TAU;
        assert!((length(1, [0.0, 2.0]) - tau / 2.0).abs() < 1e-12);
        assert!((length(-1, [0.0, 2.0]) - tau * 1.5).abs() < 1e-12);
        assert!((length(-3, [0.0, 2.0]) - tau * 5.5).abs() < 1e-12);
        assert!((length(1, [2.0, 0.0]) - tau * 2.0).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn radius_form_finds_the_centre_that_made_the_end(
            centre in prop::array::uniform2(-100.0..100.0_f64),
            radius in 0.1..500.0_f64,
            from in 0.0..std::f64::consts::TAU,
            sweep in 0.05..6.2_f64,
            clockwise: bool,
        ) {
            prop_assume!((sweep - std::f64::consts::PI).abs() > 0.01);
            let at = |angle: f64| [centre[0] + radius * libm::cos(angle), centre[1] + radius * libm::sin(angle)];
            let turns = signed_turns(clockwise, 1);
            let (start, end) = (at(from), at(from + sweep * f64::from(turns)));
            let signed = if sweep > std::f64::consts::PI { -radius } else { radius };
            let found = by_radius(start, end, signed, turns, MM).unwrap();
            prop_assert!(distance_mm(found.centre_mm, centre) < 1e-6, "{:?}", found);
            let same = by_centre(start, end, centre, turns, MM, None).unwrap();
            prop_assert!((length_mm(found, start, end) - length_mm(same, start, end)).abs() < 1e-6);
            prop_assert!((length_mm(same, start, end) - radius * sweep).abs() < 1e-9 * radius.max(1.0));
        }
    }
}
