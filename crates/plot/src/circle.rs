//! A circle as a ball bar shows it: deviations of the radius, enlarged, around the circle that was meant.
//!
//! In:  points of some ways round. Out: SVG.

use super::lines::{number, round_up, thin_out};
use super::sheet::{Anchor, Face, Sheet};
use super::{BODY, GRID, INK, SMALL, TITLE, TOLERANCE};

const WIDTH: f64 = 760.0;
const MIDDLE: (f64, f64) = (380.0, 420.0);
/// Radius of the circle that was meant, and of the widest ring, pixels.
const MEANT: f64 = 220.0;
const WIDEST: f64 = 320.0;
const COLOURS: [&str; 2] = ["#0072b2", "#d55e00"];

/// One way round: its name, and angles (rad) with deviations of the radius, um.
pub struct Way<'a> {
    pub name: &'a str,
    pub points: &'a [(f64, f64)],
}

/// Both ways round; `axes`: names of the two axes.
pub fn circle_svg(title: &str, axes: [char; 2], ways: &[Way<'_>; 2]) -> String {
    let mut sheet = Sheet::new(WIDTH);
    sheet.text((24.0, 36.0), TITLE, title);
    let mut x = 24.0;
    for (way, colour) in ways.iter().zip(COLOURS) {
        sheet.line((x, 60.0), (x + 28.0, 60.0), colour, 2.0, "");
        sheet.text((x + 34.0, 64.0), BODY, way.name);
        x += 34.0 + BODY.width(way.name) + 30.0;
    }
    let largest = ways.iter().flat_map(|way| way.points).map(|(_, error)| error.abs());
    let largest = largest.filter(|error| error.is_finite()).fold(1e-3, f64::max);
    // Two rings on either side.
    let ring_um = round_up(largest / 2.0);
    let pixels_per_um = (WIDEST - MEANT) / (2.0 * ring_um);
    let place = |angle: f64, error_um: f64| {
        let radius = (MEANT + error_um * pixels_per_um).max(0.0);
        (MIDDLE.0 + radius * angle.cos(), MIDDLE.1 - radius * angle.sin())
    };
    let around = |error_um: f64| -> Vec<(f64, f64)> {
        (0..=180)
            .map(|step| place(f64::from(step) * std::f64::consts::PI / 90.0, error_um))
            .collect()
    };
    for ring in [-2.0, -1.0, 0.0, 1.0, 2.0] {
        let colour = if ring == 0.0 { INK } else { GRID };
        sheet.path(&around(ring * ring_um), colour, 1.0, "");
        let (x, y) = place(std::f64::consts::FRAC_PI_4, ring * ring_um);
        sheet.text((x, y), SMALL.at(Anchor::Middle), &number(ring * ring_um));
    }
    let quarters = [(0, '+'), (1, '+'), (0, '-'), (1, '-')];
    for (quarter, (axis, sign)) in quarters.into_iter().enumerate() {
        let angle = quarter as f64 * std::f64::consts::FRAC_PI_2;
        sheet.line(MIDDLE, place(angle, 2.0 * ring_um), GRID, 1.0, "");
        let (x, y) = place(angle, 2.0 * ring_um + 18.0 / pixels_per_um);
        let face: Face = BODY.at(Anchor::Middle);
        sheet.text((x, y + 4.0), face, &format!("{sign}{}", axes[axis]));
    }
    for (way, colour) in ways.iter().zip(COLOURS) {
        let points: Vec<(f64, f64)> = way.points.iter().map(|(angle, error)| place(*angle, *error)).collect();
        sheet.path(&thin_out(&points, TOLERANCE), colour, 1.5, "");
    }
    sheet.text((24.0, 784.0), BODY, "rings: deviation of the radius, um");
    sheet.finish(804.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(error_um: f64) -> Vec<(f64, f64)> {
        (0..400).map(|step| (f64::from(step) * 0.0157, error_um)).collect()
    }

    #[test]
    fn a_circle_has_rings_with_numbers_and_both_ways() {
        let [one, other] = [points(3.2), points(-1.0)];
        let ways = [
            Way {
                name: "to and",
                points: &one,
            },
            Way {
                name: "fro",
                points: &other,
            },
        ];
        let svg = circle_svg("round?", ['X', 'Y'], &ways);
        for text in [
            ">round?<",
            ">to and<",
            ">fro<",
            ">+X<",
            ">-Y<",
            ">-4<",
            ">2<",
            "deviation of the radius",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.matches("<polyline").count(), 5 + 2);
        assert!(roxmltree::Document::parse(&svg).is_ok());
    }

    #[test]
    fn what_is_no_number_makes_a_picture_all_the_same() {
        let broken = [(0.0, f64::NAN), (1.0, f64::INFINITY)];
        let ways = [
            Way {
                name: "a",
                points: &broken,
            },
            Way { name: "b", points: &[] },
        ];
        let svg = circle_svg("", ['X', 'Z'], &ways);
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(roxmltree::Document::parse(&svg).is_ok());
    }
}
