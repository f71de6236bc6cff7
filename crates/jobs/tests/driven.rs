//! What a program does, read by the interpreter: moves in points.

use gcode::{Interpreter, Settings, Tool, ToolTable};
use motion::canon::Call;
use std::f64::consts::TAU;

/// A move.
#[derive(Debug)]
pub(crate) struct Way {
    pub(crate) line: u32,
    pub(crate) rapid: bool,
    /// X, Y, Z from its beginning to its end, no more than [`POINT_MM`] apart on lines, [`POINTS`] on a turn.
    pub(crate) points: Vec<[f64; 3]>,
}

const POINT_MM: f64 = 0.5;
const POINTS: f64 = 180.0;

fn tools() -> ToolTable {
    let mut tools = ToolTable::default();
    tools
        .set(Tool {
            number: 1,
            pocket: 1,
            ..Tool::default()
        })
        .expect("a tool");
    tools
}

/// The moves of a program, from Z0 on; a panic if the interpreter refuses it.
pub(crate) fn ways(text: &str) -> Vec<Way> {
    let settings = Settings {
        tools: tools(),
        ..Settings::default()
    };
    let mut ways = Vec::new();
    let mut at = [0.0; 3];
    for event in Interpreter::new(settings).run(text.as_bytes()) {
        let event = event.unwrap_or_else(|error| panic!("{error}\n{text}"));
        let (rapid, to, arc) = match event.call {
            Call::StraightTraverse { to } => (true, to, None),
            Call::StraightFeed { to } => (false, to, None),
            Call::ArcFeed {
                to, centre_mm, turns, ..
            } => (false, to, Some((centre_mm, turns))),
            _ => continue,
        };
        let to = [to.0[0], to.0[1], to.0[2]];
        let points = match arc {
            None => {
                let way = at.iter().zip(to).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
                let count = (way / POINT_MM).ceil().max(1.0);
                let share = |index: f64| std::array::from_fn(|axis| at[axis] + (to[axis] - at[axis]) * index / count);
                (0..=count as u32).map(|index| share(f64::from(index))).collect()
            }
            Some((centre, turns)) => {
                let radius = (at[0] - centre[0]).hypot(at[1] - centre[1]);
                let angle = |[x, y, _]: [f64; 3]| (y - centre[1]).atan2(x - centre[0]);
                let (from, mut sweep) = (angle(at), angle(to) - angle(at));
                match turns > 0 {
                    true if sweep <= 1e-9 => sweep += TAU,
                    false if sweep >= -1e-9 => sweep -= TAU,
                    _ => {}
                }
                assert_eq!(turns.abs(), 1);
                let count = (sweep.abs() / TAU * POINTS).ceil().max(1.0);
                let place = |index: f64| {
                    let angle = from + sweep * index / count;
                    [
                        centre[0] + radius * angle.cos(),
                        centre[1] + radius * angle.sin(),
                        at[2] + (to[2] - at[2]) * index / count,
                    ]
                };
                (0..=count as u32).map(|index| place(f64::from(index))).collect()
            }
        };
        ways.push(Way {
            line: event.source.line,
            rapid,
            points,
        });
        at = to;
    }
    ways
}
