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
    // A third of the exponent gives the root to some per cent, Newton the rest.
    let mut root = f64::from_bits(x.to_bits() / 3 + 0x3ff0_0000_0000_0000 / 3 * 2);
    for _ in 0..5 {
        root -= (root - x / (root * root)) / 3.0;
    }
    root
}
