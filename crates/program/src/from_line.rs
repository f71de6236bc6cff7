//! A start in the middle of a program, on the machine: what will be, in words, and the way there.
//!
//! In:  a program, a line of it, the place where the machine stands.
//! Out: what the operator has to agree to. The interpreter hands out the way itself ([`gcode::Run::begin_at_line`]).

use super::{folder, planned_settings};
use crate::text::Reader;
use config::Config;
use gcode::{Approach, CheckLimits, Interpreter};
use machine::tables::Tables;
use motion::cancel::Cancel;
use motion::canon::{Axis, Position};

/// The last piece of the way down, and its feed.
const CLEARANCE_MM: f64 = 5.0;
const FEED_MM_PER_MINUTE: f64 = 100.0;

/// The way to the place: Z to the upper end of its travel first.
pub fn approach(config: &Config) -> Approach {
    let z = config.axes.iter().find(|map| map.axis == Axis::Z);
    let ends = z.map(|map| map.joints.iter().map(|joint| config.joints[*joint].travel_mm[1]));
    let top = ends.map_or(f64::NEG_INFINITY, |ends| ends.fold(f64::INFINITY, f64::min));
    Approach {
        retract_mm: top,
        clearance_mm: CLEARANCE_MM,
        feed_mm_per_minute: FEED_MM_PER_MINUTE,
    }
}

/// What a start at a line will do and take for granted, one sentence each.
///
/// # Errors
/// The first error before that line; that the line cannot be a beginning.
pub fn preview(
    config: &Config,
    tables: &Tables,
    name: &str,
    text: Reader<'_>,
    (at, line): (Position, u32),
    cancel: &Cancel,
) -> Result<Vec<String>, String> {
    let mut settings = planned_settings(config, tables, at);
    if let Some(folder) = folder(name) {
        settings.subroutine_folders.insert(0, folder.to_owned());
    }
    let limits = CheckLimits {
        cancel: cancel.clone(),
        ..CheckLimits::default()
    };
    let mut run = Interpreter::new(settings).run_reader(text).within(limits);
    let resume = run.start_at_line(line).map_err(|error| error.render(name))?;
    let (modes, left) = (run.modes(), run.snapshot());
    let place = |axes: &mut dyn Iterator<Item = Axis>| {
        let values = axes.map(|axis| format!("{}{:.3}", axis.letter(), resume.from[axis]));
        values.collect::<Vec<_>>().join(" ")
    };
    let axes = || config.axes.iter().map(|map| map.axis);
    let beside = place(&mut axes().filter(|axis| *axis != Axis::Z));
    let down = place(&mut axes().filter(|axis| *axis == Axis::Z));
    let mut told = vec![
        format!(
            "first moves: Z to the upper end of its travel; {beside}; {down}, the last {CLEARANCE_MM} mm at {FEED_MM_PER_MINUTE} mm/min"
        ),
        format!("in force then: {}", modes.words().join(" ")),
    ];
    let [now, then] = [tables.tool_in_spindle(), left.tool_in_spindle];
    if now != then {
        told.push(format!("tool {then} is asked for; in the spindle is {now}"));
    }
    told.extend(
        resume
            .assumptions
            .iter()
            .map(|assumed| format!("taken for granted: {assumed}")),
    );
    Ok(told)
}
