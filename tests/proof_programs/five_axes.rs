//! A program for five axes: the flank of the tool along a tilted contour, and a way past the pole of the table.

use std::fmt::Write as _;

/// The whole program; `tilt`: the letter of the axis that tilts, beside C, which turns the work.
pub(crate) fn flank(tilt: char) -> String {
    let mut text = format!(
        "(five axes)\nG21 G90 G17 G94 G40 G49 G80\nG54\nG64 P0.01\nG0 X0 Y0 Z0 {tilt}0 C0\nF3000\nG43.4\nG0 Z8\n\
         G1 X20 Y0 Z5 {tilt}-25\n"
    );
    // Around a cone whose flank changes its slope, the work turning along.
    for k in 1..=90 {
        let degrees = 4.0 * f64::from(k);
        let angle = degrees.to_radians();
        let (x, y, z) = (20.0 * angle.cos(), 20.0 * angle.sin(), 5.0 + 2.0 * (3.0 * angle).sin());
        let slope = -25.0 + 10.0 * (2.0 * angle).sin();
        let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4} {tilt}{slope:.4} C{degrees:.4}");
    }
    // Straight across: near the middle the tool stands nearly along the axis of C, which must turn by half a turn there.
    for k in 0..=80 {
        let x = 20.0 - 0.5 * f64::from(k);
        let (across, turn) = (x.hypot(0.6), 0.6_f64.atan2(x).to_degrees());
        let _ = writeln!(text, "G1 X{x:.4} Y0.6 Z5 {tilt}{:.4} C{:.4}", -across, 360.0 + turn);
    }
    let _ = writeln!(text, "G1 Z20\nG0 {tilt}0\nG49\nM2");
    text
}
