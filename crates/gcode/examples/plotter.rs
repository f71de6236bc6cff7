//! Draws a program of two axes by digital differential analysers alone, as controls did that had no numbers with fractions:
//! `cargo run -p isocnc-gcode --example plotter [part.ngc [steps per mm]]`
//!
//! Every line is a [`LineDda`], every arc an [`ArcDda`]: end points are all that they are told. Prints how many steps that makes, and
//! how far the worst of them is beside the programmed path, in steps; ends with an error where that is more than one. The control
//! itself knows where the path is in every cycle, and has its pulses follow that: docs/steps.md.

use dda::{ArcDda, LineDda, Method, Turn};
use gcode::{Interpreter, Settings};
use motion::canon::{Axis, Call, Plane, Position};
use std::error::Error;

const PROGRAM: &str = include_str!("../../../configs/plotter-part.ngc");

/// The pen, in steps.
struct Pen {
    at: [i32; 2],
    steps_per_mm: f64,
    steps: u64,
    worst: f64,
}

impl Pen {
    fn place(&self, to: Position) -> [f64; 2] {
        [to[Axis::X] * self.steps_per_mm, to[Axis::Y] * self.steps_per_mm]
    }

    fn step(&mut self, pulses: [i8; 2], off: impl Fn([f64; 2]) -> f64) {
        for (at, pulse) in self.at.iter_mut().zip(pulses) {
            *at += i32::from(pulse);
        }
        self.steps += u64::from(pulses != [0, 0]);
        self.worst = self.worst.max(off(self.at.map(f64::from)).abs());
    }

    fn line(&mut self, from: [f64; 2], to: [f64; 2]) {
        let [x, y] = [to[0] - from[0], to[1] - from[1]];
        let length = libm::hypot(x, y).max(f64::MIN_POSITIVE);
        let end = to.map(|steps| steps.round() as i32);
        for pulses in LineDda::new([end[0] - self.at[0], end[1] - self.at[1]]) {
            self.step(pulses, |at| (x * (at[1] - from[1]) - y * (at[0] - from[0])) / length);
        }
    }

    fn arc(&mut self, from: [f64; 2], to: [f64; 2], centre: [f64; 2], turn: Turn) -> Result<(), Box<dyn Error>> {
        let radius = libm::hypot(from[0] - centre[0], from[1] - centre[1]);
        let middle = centre.map(|steps| steps.round() as i32);
        let about = |place: [i32; 2]| [place[0] - middle[0], place[1] - middle[1]];
        let end = to.map(|steps| steps.round() as i32);
        let mut arc = ArcDda::new(about(self.at), about(end), turn, Method::LeastError)?;
        while let Some(pulses) = arc.clock() {
            self.step(pulses, |at| libm::hypot(at[0] - centre[0], at[1] - centre[1]) - radius);
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let text = match arguments.next() {
        Some(path) => std::fs::read(path)?,
        None => PROGRAM.into(),
    };
    let mut pen = Pen {
        at: [0; 2],
        steps_per_mm: arguments.next().map_or(Ok(80.0), |number| number.parse())?,
        steps: 0,
        worst: 0.0,
    };
    let (mut from, mut lines, mut arcs) = ([0.0; 2], 0, 0);
    for event in Interpreter::new(Settings::default()).run(&text) {
        let event = event.map_err(|error| error.render("program"))?;
        match event.call {
            Call::StraightTraverse { to } | Call::StraightFeed { to } => {
                let to = pen.place(to);
                pen.line(from, to);
                (from, lines) = (to, lines + 1);
            }
            Call::ArcFeed {
                to,
                plane: Plane::Xy,
                centre_mm,
                turns: turns @ (1 | -1),
            } => {
                let to = pen.place(to);
                let centre = centre_mm.map(|mm| mm * pen.steps_per_mm);
                let turn = if turns > 0 {
                    Turn::CounterClockwise
                } else {
                    Turn::Clockwise
                };
                pen.arc(from, to, centre, turn)?;
                (from, arcs) = (to, arcs + 1);
            }
            Call::ArcFeed { .. } => {
                return Err(format!("line {}: a plotter has arcs of one turn in XY", event.source.line).into());
            }
            _ => {} // modes, tools, spindles, inputs and outputs
        }
    }
    println!(
        "{lines} lines and {arcs} arcs in {} steps, at most {:.3} steps beside the path",
        pen.steps, pen.worst
    );
    match pen.worst <= 1.0 {
        true => Ok(()),
        false => Err("a step is more than one beside the path".into()),
    }
}
