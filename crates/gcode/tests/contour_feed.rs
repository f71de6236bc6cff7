//! Feed under cutter compensation: inside of arcs and beside inside corners.

use ::compensation::{FeedSettings, InsideCorners};
use gcode::{Interpreter, Settings};
use motion::canon::{Call, Position};

/// A pocket of 40 x 40 mm with corners of 6 mm radius, but one sharp one, cut from the inside by a tool of 8 mm, climbing; and a
/// move behind compensation.
const POCKET: &str = "G21 G17 G90 G64
F600 G0 X10 Y4
G41.1 D8
G1 X20 Y0
G1 X34
G3 X40 Y6 J6
G1 Y34
G3 X34 Y40 I-6
G1 X6
G3 X0 Y34 J-6
G1 Y0
G1 X20
G40
G1 X20 Y20
M8
G1 Z5
M2
";

/// Length and feed of each move at feed, mm and mm/s.
fn moves(contour_feed: FeedSettings) -> Vec<(f64, f64)> {
    let settings = Settings {
        contour_feed,
        ..Settings::default()
    };
    let mut found = Vec::new();
    let (mut at, mut feed) = (Position::ZERO, 0.0);
    for event in Interpreter::new(settings).run(POCKET.as_bytes()) {
        match event.unwrap().call {
            Call::SetFeedRate { linear, .. } => feed = linear,
            Call::StraightTraverse { to } => at = to,
            Call::StraightFeed { to } => {
                let mm =
                    to.0.iter()
                        .zip(at.0)
                        .map(|(a, b)| (a - b) * (a - b))
                        .sum::<f64>()
                        .sqrt();
                found.push((mm, feed));
                at = to;
            }
            Call::ArcFeed { to, .. } => {
                // Quarters of a circle on a radius of 2 mm.
                found.push((std::f64::consts::PI, feed));
                at = to;
            }
            _ => {}
        }
    }
    found
}

#[test]
fn a_tool_in_a_pocket_keeps_its_chip() {
    let plain = moves(FeedSettings::default());
    assert!(plain.iter().all(|&(_, feed)| feed == 10.0), "{plain:?}");
    let slow = moves(FeedSettings {
        arcs: true,
        inside_corners: Some(InsideCorners {
            share: 0.5,
            distance_mm: None,
            bend_degrees: 30.0,
        }),
    });
    let length = |of: &[(f64, f64)]| of.iter().map(|(mm, _)| mm).sum::<f64>();
    assert!((length(&plain) - length(&slow)).abs() < 1e-9);
    let at = |wanted: f64| {
        let of: Vec<_> = slow
            .iter()
            .copied()
            .filter(|(_, feed)| (feed - wanted).abs() < 1e-9)
            .collect();
        length(&of)
    };
    // Three arcs on 2 of 6 mm; 4 mm on either side of the sharp corner.
    assert!((at(10.0 / 3.0) - 3.0 * std::f64::consts::PI).abs() < 1e-9, "{slow:?}");
    assert!((at(5.0) - 8.0).abs() < 1e-9, "{slow:?}");
    assert!(
        (at(10.0) + at(5.0) + at(10.0 / 3.0) - length(&slow)).abs() < 1e-9,
        "{slow:?}"
    );
    // Off again behind it.
    assert_eq!(slow.last().map(|&(_, feed)| feed), Some(10.0));
}
