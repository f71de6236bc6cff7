//! Trigonometry in degrees.
//!
//! In:  angles in degrees, or ratios.
//! Out: ratios, or angles in degrees, as near to the true value as a few more digits than an `f64` has can tell: the
//!      sine of 30 is 0.5 and that of 180 is 0, as programs expect that round down or compare.
//!
//! An angle is reduced to -45..=45 degrees, which is exact, before it is turned into radians.

/// π/180, as the sum of two numbers.
const RADIANS_PER_DEGREE: [f64; 2] = [0.017453292519943295, 2.9486522708701687e-19];
/// 1/π, as the sum of two numbers.
const ONE_OVER_PI: [f64; 2] = [std::f64::consts::FRAC_1_PI, -1.9678676675182486e-17];

/// The sine of an angle.
pub(crate) fn sin(degrees: f64) -> f64 {
    let (quadrant, rest) = reduce(degrees);
    match quadrant {
        0 => sin_of_rest(rest),
        1 => cos_of_rest(rest),
        2 => -sin_of_rest(rest),
        _ => -cos_of_rest(rest),
    }
}

/// The cosine of an angle.
pub(crate) fn cos(degrees: f64) -> f64 {
    let (quadrant, rest) = reduce(degrees);
    match quadrant {
        0 => cos_of_rest(rest),
        1 => -sin_of_rest(rest),
        2 => -cos_of_rest(rest),
        _ => sin_of_rest(rest),
    }
}

/// The tangent of an angle; infinite at 90 and 270 degrees.
pub(crate) fn tan(degrees: f64) -> f64 {
    let (quadrant, rest) = reduce(degrees);
    let (angle, error) = radians(rest);
    let tangent = libm::tan(angle);
    let tangent = tangent + error * (1.0 + tangent * tangent);
    if quadrant % 2 == 0 { tangent } else { -tangent.recip() }
}

/// The angle of a sine, from -90 to 90.
pub(crate) fn asin(sine: f64) -> f64 {
    in_degrees(libm::asin(sine))
}

/// The angle of a cosine, from 0 to 180.
pub(crate) fn acos(cosine: f64) -> f64 {
    in_degrees(libm::acos(cosine))
}

/// The angle of the direction (x, y), from -180 to 180.
pub(crate) fn atan2(y: f64, x: f64) -> f64 {
    in_degrees(libm::atan2(y, x))
}

/// Quarter turns, 0 to 3, and what is left of the angle, -45 to 45 degrees.
fn reduce(degrees: f64) -> (u8, f64) {
    let within_turn = degrees % 360.0;
    let quarters = (within_turn / 90.0).round();
    let rest = within_turn - quarters * 90.0;
    // -4 to 4, or NaN, which the rest keeps.
    (((quarters as i8) & 3) as u8, rest)
}

/// An angle in radians, and what its rounding left out.
fn radians(degrees: f64) -> (f64, f64) {
    let angle = degrees * RADIANS_PER_DEGREE[0];
    let error = degrees.mul_add(RADIANS_PER_DEGREE[0], -angle) + degrees * RADIANS_PER_DEGREE[1];
    (angle, error)
}

fn sin_of_rest(rest: f64) -> f64 {
    let (angle, error) = radians(rest);
    let sine = libm::sin(angle);
    sine + error * (1.0 - sine * sine).sqrt()
}

fn cos_of_rest(rest: f64) -> f64 {
    let (angle, error) = radians(rest);
    libm::cos(angle) - error * libm::sin(angle)
}

fn in_degrees(radians: f64) -> f64 {
    // The product is rounded, so that the nearest number to π/3 is 60 degrees.
    let half_turns = radians * 180.0;
    half_turns.mul_add(ONE_OVER_PI[0], half_turns * ONE_OVER_PI[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_angles_have_round_values() {
        for turn in [-720.0, -360.0, 0.0, 360.0, 3600.0] {
            for (angle, sine) in [
                (0.0, 0.0),
                (30.0, 0.5),
                (90.0, 1.0),
                (150.0, 0.5),
                (180.0, 0.0),
                (270.0, -1.0),
            ] {
                assert_eq!(sin(turn + angle), sine, "{turn} + {angle}");
                assert_eq!(sin(-turn - angle), -sine, "-{turn} - {angle}");
                assert_eq!(cos(turn + angle - 90.0), sine, "{turn} + {angle} - 90");
            }
            assert_eq!(
                (tan(turn + 45.0), tan(turn - 45.0), tan(turn + 180.0)),
                (1.0, -1.0, 0.0)
            );
            assert!(tan(turn + 90.0).is_infinite());
        }
        assert_eq!(
            [asin(1.0), asin(-0.5), acos(0.0), acos(0.5), acos(-1.0)],
            [90.0, -30.0, 90.0, 60.0, 180.0]
        );
        assert_eq!(
            [atan2(1.0, 1.0), atan2(0.0, -1.0), atan2(-1.0, 0.0)],
            [45.0, 180.0, -90.0]
        );
    }

    #[test]
    fn any_angle_is_near_to_the_value_in_radians() {
        for step in -20_000..20_000_i32 {
            let angle = f64::from(step) * 0.037;
            let radians = angle.to_radians();
            assert!((sin(angle) - radians.sin()).abs() < 3e-15, "{angle}");
            assert!((cos(angle) - radians.cos()).abs() < 3e-15, "{angle}");
            let tangent = radians.tan();
            assert!(
                (tan(angle) - tangent).abs() < 1e-12 * (1.0 + tangent * tangent),
                "{angle}"
            );
        }
        assert!(sin(f64::NAN).is_nan() && cos(f64::NAN).is_nan() && tan(f64::NAN).is_nan());
    }
}
