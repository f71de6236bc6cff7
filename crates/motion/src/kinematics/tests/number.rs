use super::differences;
use crate::kinematics::{Jet3, Number};
use proptest::prelude::*;

/// A jet as the polynomial that has it at 0.
fn polynomial(jet: Jet3, s: f64) -> f64 {
    jet.q + s * (jet.d1 + s * (jet.d2 / 2.0 + s * jet.d3 / 6.0))
}

fn jet(value: std::ops::Range<f64>) -> impl Strategy<Value = Jet3> {
    (value, -1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(|(q, d1, d2, d3)| Jet3::new(q, d1, d2, d3))
}

/// The jet of a function of two jets must be what differences of the plain function say.
fn check(got: Jet3, a: Jet3, b: Jet3, f: impl Fn(f64, f64) -> f64) -> Result<(), TestCaseError> {
    let of_s = |s: f64| f(polynomial(a, s), polynomial(b, s));
    let wanted = differences(of_s, 0.01);
    prop_assert!((got.q - of_s(0.0)).abs() <= 1e-14 * (1.0 + got.q.abs()));
    for (got, (wanted, tolerance)) in [got.d1, got.d2, got.d3]
        .into_iter()
        .zip(wanted.into_iter().zip([1e-9, 1e-8, 1e-6]))
    {
        prop_assert!(
            (got - wanted).abs() <= tolerance * (1.0 + wanted.abs()),
            "{got} for {wanted}"
        );
    }
    Ok(())
}

proptest! {
    #[test]
    fn sums_products_and_quotients(a in jet(-3.0..3.0), b in jet(1.0..4.0), c in -5.0..5.0) {
        check(a + b, a, b, |a, b| a + b)?;
        check(a - b, a, b, |a, b| a - b)?;
        check(-a * b, a, b, |a, b| -a * b)?;
        check(a / b, a, b, |a, b| a / b)?;
        check((a + c) * c - c, a, b, |a, _| (a + c) * c - c)?;
        check(Jet3::constant(c) * b, a, b, |_, b| c * b)?;
    }

    #[test]
    fn roots_and_circular_functions(a in jet(0.5..4.0), b in jet(-3.0..3.0)) {
        check(Number::sqrt(a), a, b, |a, _| a.sqrt())?;
        let (sin, cos) = Number::sin_cos(b);
        check(sin, a, b, |_, b| b.sin())?;
        check(cos, a, b, |_, b| b.cos())?;
        check(Number::hypot(a, b), a, b, f64::hypot)?;
        check(Number::to_degrees(Number::to_radians(a)), a, b, |a, _| a)?;
    }

    #[test]
    fn inverse_circular_functions(a in jet(-0.7..0.7), x in jet(0.5..4.0), turn in 0_usize..4) {
        check(Number::asin(a), a, x, |a, _| a.asin())?;
        check(Number::acos(a), a, x, |a, _| a.acos())?;
        // All four quadrants, away from the jump at the negative x axis.
        let (y, x) = [(a, x), (x, a), (-x, a), (a + 2.0, -x)][turn];
        let plain = |s: f64| polynomial(y, s).atan2(polynomial(x, s));
        let wanted = differences(plain, 0.01);
        let got = Number::atan2(y, x);
        prop_assert!((got.q - plain(0.0)).abs() < 1e-15, "{} for {}", got.q, plain(0.0));
        for (got, wanted) in [got.d1, got.d2, got.d3].into_iter().zip(wanted) {
            prop_assert!((got - wanted).abs() <= 1e-6 * (1.0 + wanted.abs()), "{} for {}", got, wanted);
        }
    }

    #[test]
    fn identities_hold_in_all_derivatives(a in jet(-3.0..3.0), b in jet(0.5..2.0)) {
        let (sin, cos) = Number::sin_cos(a);
        let near = |got: Jet3, wanted: Jet3| {
            let apart = got - wanted;
            [apart.q, apart.d1, apart.d2, apart.d3].iter().all(|x| x.abs() < 1e-10)
        };
        prop_assert!(near(sin * sin + cos * cos, Jet3::constant(1.0)));
        prop_assert!(near(Number::atan2(b * sin, b * cos), a));
        prop_assert!(near(Number::hypot(b * sin, b * cos), b));
        let root = Number::sqrt(b);
        prop_assert!(near(root * root, b));
        prop_assert!(near(a / b * b, a));
    }
}

#[test]
fn outside_its_domain_a_function_says_so_and_does_not_panic() {
    let moving = |q| Jet3::new(q, 1.0, 0.0, 0.0);
    assert!(!Number::sqrt(moving(0.0)).is_finite());
    assert!(Number::sqrt(moving(-1.0)).q.is_nan());
    assert!(!Number::acos(moving(1.0)).is_finite());
    assert!(Number::asin(moving(2.0)).q.is_nan());
    assert!(!(moving(1.0) / Jet3::ZERO).is_finite());
}
