//! Counts moves and cutting time per tool: `cargo run -p isocnc-gcode --example tool_times -- part.ngc tools.tbl`
//!
//! Splines, threads and feeds per turn are counted without their time. Shows the three parts of the library: settings, events, and a machine that answers.

#![allow(
    clippy::disallowed_methods,
    reason = "a rough time need not be the same to the bit everywhere"
)]

use gcode::{Interpreter, Machine, Probed, Settings, ToolChanger, ToolTable};
use motion::canon::{Axis, Call, FeedMode, LengthUnit, Position, ProbeEnd, ProbeMode};
use std::collections::BTreeMap;
use std::error::Error;
use std::f64::consts::TAU;
use std::fs::File;
use std::process::ExitCode;

/// A machine whose probe touches half-way.
struct Simulated;

impl Machine for Simulated {
    fn probed(&mut self, from: Position, to: Position, _: ProbeMode) -> Option<Probed> {
        let at = half_way(from, to);
        Some(Probed {
            end: ProbeEnd::Tripped,
            at,
            rest: at,
        })
    }
}

fn half_way(from: Position, to: Position) -> Position {
    Position(std::array::from_fn(|axis| (from.0[axis] + to.0[axis]) / 2.0))
}

/// What one tool does.
#[derive(Default)]
struct Use {
    rapids: u32,
    feeds: u32,
    feed_s: f64,
}

/// Adds up calls.
#[derive(Default)]
struct Times {
    tool: u32,
    at: Position,
    mm_s: f64,
    per_time: bool,
    uses: BTreeMap<u32, Use>,
}

impl Times {
    fn add(&mut self, call: &Call) {
        let tool = self.uses.entry(self.tool).or_default();
        match call {
            Call::ChangeTool { tool, .. } | Call::SetToolNumber { tool, .. } => self.tool = *tool,
            Call::SetFeedMode(mode) => self.per_time = *mode == FeedMode::PerTime,
            Call::SetFeedRate { linear, .. } => self.mm_s = *linear,
            Call::StraightTraverse { to } => {
                tool.rapids += 1;
                self.at = *to;
            }
            Call::StraightFeed { to } => {
                tool.feeds += 1;
                let delta = |axis: Axis| to[axis] - self.at[axis];
                let mm = delta(Axis::X).hypot(delta(Axis::Y)).hypot(delta(Axis::Z));
                if self.per_time && self.mm_s > 0.0 {
                    tool.feed_s += mm / self.mm_s;
                }
                self.at = *to;
            }
            Call::ArcFeed {
                to,
                plane,
                centre_mm,
                turns,
            } => {
                tool.feeds += 1;
                let [first, second, normal] = plane.axes();
                let [x, y] = [self.at[first] - centre_mm[0], self.at[second] - centre_mm[1]];
                let [end_x, end_y] = [to[first] - centre_mm[0], to[second] - centre_mm[1]];
                let part = (end_y.atan2(end_x) - y.atan2(x)) * f64::from(turns.signum());
                let part = if part > 1e-9 { part } else { part + TAU };
                let angle = part + TAU * f64::from(turns.abs() - 1);
                let mm = (angle * x.hypot(y)).hypot(to[normal] - self.at[normal]);
                if self.per_time && self.mm_s > 0.0 {
                    tool.feed_s += mm / self.mm_s;
                }
                self.at = *to;
            }
            // The event says where the move would end at most; the machine knows where it did.
            Call::StraightProbe { to, .. } => self.at = half_way(self.at, *to),
            _ => {}
        }
    }
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("which program? and which tool table?")?;
    let mut settings = Settings::default();
    if let Some(table) = arguments.next() {
        let text = std::fs::read(table)?;
        settings.tools = ToolTable::parse(&text, LengthUnit::Millimetre, ToolChanger::Fixed)
            .map_err(|mut errors| errors.remove(0))?;
    }
    // Reads the file as it goes: a program of any length needs the same memory.
    let run = Interpreter::new(settings)
        .with_machine(Simulated)
        .run_reader(File::open(&path)?);
    let mut times = Times {
        per_time: true,
        ..Times::default()
    };
    for event in run {
        match event {
            Ok(event) => times.add(&event.call),
            Err(error) => {
                eprintln!("{}", error.render(&path)); // place, text, rule and remedy
                return Ok(ExitCode::FAILURE);
            }
        }
    }
    for (tool, used) in &times.uses {
        println!(
            "T{tool}: {} rapid moves, {} at feed, {:.1} s of cutting",
            used.rapids, used.feeds, used.feed_s
        );
    }
    Ok(ExitCode::SUCCESS)
}
