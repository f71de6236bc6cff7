//! Figures of lines and arcs, as drawn by hand or by simple CAM.

use super::Size;
use super::random::{Random, count};
use std::f64::consts::{FRAC_PI_3, TAU};
use std::fmt::Write as _;

/// A square, sharp corners.
pub(super) fn square(size: Size) -> String {
    let (side, laps) = match size {
        Size::Small => (10.0, 1),
        Size::Full => (50.0, 3),
    };
    format!("G1 X{side} Y0\nG1 X{side} Y{side}\nG1 X0 Y{side}\nG1 X0 Y0\n").repeat(laps)
}

/// Teeth of 5 mm with tips of 7 degrees, then with ever shorter flanks.
pub(super) fn zigzag(size: Size) -> String {
    let mut text = String::new();
    let mut x = 0.0;
    for k in 0..count(size, 12, 400) {
        x += 0.3;
        let height = if k % 2 == 0 { 5.0 } else { 0.0 };
        let _ = writeln!(text, "G1 X{x:.4} Y{height:.4}");
    }
    let mut height = 5.0;
    while height > 0.003 {
        x += 0.06 * height;
        let _ = writeln!(text, "G1 X{x:.5} Y{height:.5}\nG1 X{:.5} Y0", x + 0.06 * height);
        x += 0.06 * height;
        height *= 0.7;
    }
    text
}

/// Lines of 2 to 12 mm and clockwise arcs in turn; half of the joints are tangential, the others turn by up to 60
/// degrees. The full one has 500 of each.
pub(super) fn mixed(size: Size) -> String {
    let mut random = Random(11);
    let mut text = String::new();
    let (mut x, mut y, mut heading) = (0.0_f64, 0.0_f64, 0.3_f64);
    let round = |value: f64| (value * 1e4).round() / 1e4;
    for k in 0..count(size, 12, 500) {
        if x.hypot(y) > 80.0 {
            heading = (-y).atan2(-x);
        } else if k % 2 == 1 {
            heading += random.within(-FRAC_PI_3, FRAC_PI_3);
        }
        let length = random.within(2.0, 12.0);
        (x, y) = (round(x + length * heading.cos()), round(y + length * heading.sin()));
        let _ = writeln!(text, "G1 X{x:.4} Y{y:.4}");
        let (radius, sweep) = (random.within(1.0, 8.0), random.within(20.0, 160.0).to_radians());
        if k % 4 >= 2 {
            heading += random.within(-FRAC_PI_3, FRAC_PI_3);
        }
        // Clockwise: the centre is to the right.
        let (i, j) = (radius * heading.sin(), -radius * heading.cos());
        let end = (-j).atan2(-i) - sweep;
        (x, y) = (round(x + i + radius * end.cos()), round(y + j + radius * end.sin()));
        let _ = writeln!(text, "G2 X{x:.4} Y{y:.4} I{i:.5} J{j:.5}");
        heading -= sweep;
    }
    text.push_str("G1 X0 Y0\n");
    text
}

/// Threads as they are milled: helices with tangential arcs in and out, and a helix in another plane.
pub(super) fn helices(size: Size) -> String {
    let mut text = String::new();
    for k in 0..count(size, 2, 12) {
        let x = 20.0 * (k % 4) as f64;
        let y = 20.0 * (k / 4) as f64;
        let (radius, turns) = (3.0 + (k % 3) as f64, 2 + k % 2);
        let _ = writeln!(text, "G0 X{x:.4} Y{y:.4} Z2\nG1 Z-2");
        // In on a half circle from the centre, up the thread, out on another.
        let _ = writeln!(text, "G3 X{:.4} Y{y:.4} I{:.4} J0", x + radius, radius / 2.0);
        for turn in 1..=turns {
            let z = -2.0 + 1.5 * turn as f64;
            let _ = writeln!(text, "G3 X{:.4} Y{y:.4} Z{z:.4} I{:.4} J0", x + radius, -radius);
        }
        let _ = writeln!(text, "G3 X{x:.4} Y{y:.4} I{:.4} J0", -radius / 2.0);
        // A ramp that is all helix, in the XZ plane.
        let z = -2.0 + 1.5 * turns as f64;
        let _ = writeln!(text, "G18 G2 X{:.4} Z{z:.4} Y{:.4} I2 K0", x + 4.0, y + 1.0);
        let _ = writeln!(text, "G17 G0 Z{:.4}", z + TAU.recip());
    }
    text
}
