//! Part programs that ship: free of errors, with the moves they promise, inside the machine they are made for.

use gcode::{Interpreter, Settings, Tool, ToolTable, check};
use motion::canon::{Axis, Call, Position};
use std::path::Path;

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");

/// A machine with two tools without measures.
fn settings() -> Settings {
    let mut tools = ToolTable::default();
    for number in 1..=2 {
        let pocket = number;
        tools
            .set(Tool {
                number,
                pocket,
                ..Tool::default()
            })
            .expect("a free pocket");
    }
    Settings {
        tools,
        ..Settings::default()
    }
}

/// Straight feeds, arcs and traverses of a program without errors, all of whose ends the demo machine can reach.
fn moves(text: &str) -> [usize; 3] {
    let errors = check(text.as_bytes(), settings());
    assert!(errors.is_empty(), "{errors:?}");
    let machine = isocnc::config::parse(MACHINE, Path::new("mill3-demo.toml")).expect("a good machine file");
    let g54 = machine.work_offsets[0];
    let reach = |line: u32, to: Position| {
        for (axis, joint) in [Axis::X, Axis::Y, Axis::Z].into_iter().zip(&machine.joints) {
            let at_mm = to[axis] + g54[axis];
            let [low_mm, high_mm] = joint.travel_mm;
            assert!((low_mm..=high_mm).contains(&at_mm), "line {line}: {axis:?} {at_mm}");
        }
    };
    let mut count = [0; 3];
    let mut at = Position::ZERO;
    for event in Interpreter::new(settings()).run(text.as_bytes()) {
        let event = event.expect("no errors");
        let line = event.source.line;
        let (kind, to) = match event.call {
            Call::StraightFeed { to } => (0, to),
            Call::ArcFeed {
                to,
                centre_mm: [x, y],
                turns,
                ..
            } => {
                // Start and end lie on one circle, to a digit more than the program is written with.
                let [from_mm, to_mm] = [at, to].map(|point| (point[Axis::X] - x).hypot(point[Axis::Y] - y));
                assert!((from_mm - to_mm).abs() < 5e-5, "line {line}: radius {from_mm}, {to_mm}");
                assert_eq!(turns.abs(), 1, "line {line}");
                (1, to)
            }
            Call::StraightTraverse { to } => (2, to),
            _ => continue,
        };
        count[kind] += 1;
        reach(line, to);
        at = to;
    }
    count
}

#[test]
fn the_sample_part_is_whole() {
    assert_eq!(moves(include_str!("../configs/sample-part.ngc")), [88, 49, 20]);
}

#[test]
fn the_short_part_is_whole() {
    assert_eq!(moves(include_str!("../configs/short-part.ngc")), [13, 12, 5]);
}
