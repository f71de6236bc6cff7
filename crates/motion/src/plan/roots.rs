//! Roots by basic arithmetic only, so that every machine finds the same bits.

/// Cube root of x >= 0 to the last few bits; 0 below 1e-200 and infinite above 1e200, where nothing real is.
pub(super) fn cube_root(x: f64) -> f64 {
    if x <= 1e-200 {
        return 0.0;
    }
    // Not a number goes on as infinite: no limit is derived from it, and the check of the profile refuses it.
    if x.is_nan() || x >= 1e200 {
        return f64::INFINITY;
    }
    // A third of the exponent gives the root to some per cent, Halley's method the rest: it triples the digits each time.
    let mut root = f64::from_bits(x.to_bits() / 3 + 0x3ff0_0000_0000_0000 / 3 * 2);
    for _ in 0..3 {
        let cube = root * root * root;
        root -= root * (cube - x) / (cube + cube + x);
    }
    root
}

/// Part of a root by which what is found may lie below it.
const SHORT: f64 = 1e-12;

/// Greatest x in `low..=high`, or all but [`SHORT`] of it, with f(x) <= bound; `f` rises, is not above the bound at `low`,
/// and gives its value and its slope.
///
/// Newton's method, which halves the bracket where it would leave it; the result is never above the bound.
pub(super) fn greatest(low: f64, high: f64, bound: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut low, mut high) = (low, high);
    let mut x = high;
    for _ in 0..64 {
        let (value, slope) = f(x);
        let step = (bound - value) / slope;
        if value <= bound {
            low = x;
            if step <= SHORT * x {
                break;
            }
        } else {
            high = x;
        }
        // A little short of the root: else all steps of a convex function would end above it.
        let aim = x + step - 0.5 * SHORT * x;
        x = if aim > low && aim < high {
            aim
        } else {
            0.5 * (low + high)
        };
    }
    low
}

/// Greatest x >= 0 with c1 x + c2 x^2 + c3 x^3 <= bound, or all but [`SHORT`] of it; coefficients and bound are not negative.
/// Infinite where all coefficients are 0.
pub(super) fn cubic(c1: f64, c2: f64, c3: f64, bound: f64) -> f64 {
    if c1 == 0.0 && c2 == 0.0 {
        return cube_root(bound / c3);
    }
    // Every term alone is an upper bound; so is this, of the first two.
    let first_two = 2.0 * bound / (c1 + (c1 * c1 + 4.0 * c2 * bound).sqrt());
    if c3 == 0.0 {
        return first_two;
    }
    let high = first_two.min(cube_root(bound / c3));
    greatest(0.0, high, bound, |x| {
        (x * (c1 + x * (c2 + x * c3)), c1 + x * (2.0 * c2 + x * 3.0 * c3))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_cubic_meets_its_bound(c1 in 0.0f64..10.0, c2 in 0.0f64..10.0, c3 in 0.0f64..10.0, e in -9f64..9.0) {
            let bound = 10f64.powf(e);
            for (c1, c2, c3) in [(c1, c2, c3), (0.0, c2, c3), (c1, 0.0, c3), (c1, c2, 0.0), (0.0, 0.0, c3), (0.0, c2, 0.0)] {
                let x = cubic(c1, c2, c3, bound);
                let value = x * (c1 + x * (c2 + x * c3));
                prop_assert!(value <= bound * (1.0 + 1e-14) && value >= bound * (1.0 - 1e-11), "{c1} {c2} {c3}: {value}");
            }
        }

        #[test]
        fn the_greatest_place_lies_at_the_bound_or_at_the_end(bound in 0.0f64..3.0) {
            // Concave, then convex, with an infinite slope at 1.
            let f = |x: f64| ((x - 1.0).cbrt() + 1.0, (x - 1.0).powi(2).cbrt().recip() / 3.0);
            let x = greatest(0.0, 5.0, bound, f);
            prop_assert!(f(x).0 <= bound);
            prop_assert!(x == 5.0 || f(x * (1.0 + 1e-11)).0 > bound, "{x}");
        }
    }

    #[test]
    fn nothing_to_bound_is_infinite() {
        assert_eq!(cubic(0.0, 0.0, 0.0, 1.0), f64::INFINITY);
        // Nothing but the lower end is good.
        assert_eq!(greatest(2.0, 3.0, 1.0, |_| (5.0, 0.0)), 2.0);
        assert_eq!(greatest(2.0, 3.0, 1.0, |_| (f64::NAN, f64::NAN)), 2.0);
    }
}
