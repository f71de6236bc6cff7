//! Prints the canonical moves of a program: `cargo run -p isocnc-gcode --example canonical_moves [part.ngc]`
//!
//! In work coordinates, mm and degrees, loops and subroutines run, cycles told as their moves. Without a file it runs the
//! program below.

use gcode::{Interpreter, Settings};
use motion::canon::Call;
use std::process::ExitCode;

/// Three holes in a row, then a half circle.
const PROGRAM: &str = "G21 G90 G17 F300
#<hole> = 1
o100 repeat [3]
  G81 X[20 * #<hole>] Y0 Z-5 R2
  #<hole> = [#<hole> + 1]
o100 endrepeat
G0 X10 Y0
G1 Z-1
G3 X-10 I-10
G0 Z10
M2
";

fn main() -> std::io::Result<ExitCode> {
    let path = std::env::args().nth(1);
    let text = match &path {
        Some(path) => std::fs::read(path)?,
        None => PROGRAM.into(),
    };
    for event in Interpreter::new(Settings::default()).run(&text) {
        let event = match event {
            Ok(event) => event,
            Err(error) => {
                eprintln!("{}", error.render(path.as_deref().unwrap_or("example")));
                return Ok(ExitCode::FAILURE);
            }
        };
        let line = event.source.line;
        match event.call {
            Call::StraightTraverse { to } => println!("line {line}: rapid to {:?}", to.0),
            Call::StraightFeed { to } => println!("line {line}: feed to {:?}", to.0),
            Call::ArcFeed { to, centre_mm, .. } => println!("line {line}: arc around {centre_mm:?} to {:?}", to.0),
            _ => {} // modes, tools, spindles, inputs and outputs
        }
    }
    Ok(ExitCode::SUCCESS)
}
