//! From the state of a control to values of items.

use crate::model::{Category, Model};
use crate::ring::{Condition, Ring, Value};
use std::time::Duration;

/// Whose orders the machine follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// The operator's hand.
    #[default]
    Manual,
    /// Lines that are typed.
    Mdi,
    /// A program.
    Automatic,
    /// A program, block by block.
    SemiAutomatic,
}

/// What a program does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Execution {
    /// Nothing runs.
    #[default]
    Ready,
    /// It runs.
    Active,
    /// It is held by the operator, a pin or an override at 0.
    FeedHold,
    /// The machine was moved away or returns, or rests between two blocks.
    Interrupted,
    /// It waits for something.
    Wait(WaitFor),
    /// M0, M60.
    ProgramStopped,
    /// M1.
    OptionalStop,
    /// Given up, or ended by a fault or an emergency stop.
    Stopped,
    /// It has come to its end.
    Completed,
}

/// What is waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitFor {
    /// A tool.
    ToolLoad,
    /// Coming to a hold.
    Pausing,
    /// Going on.
    Resuming,
    /// Something else.
    Other,
}

/// What an axis does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// Nothing.
    #[default]
    Stopped,
    /// It moves.
    Travel,
    /// It homes.
    Home,
}

/// How an axis is: machine coordinates, mm or degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisFacts {
    /// Where it is to be.
    pub commanded: f64,
    /// Where it is.
    pub actual: Option<f64>,
    /// How far it is behind.
    pub following_error: Option<f64>,
    /// Of what its drive can, percent.
    pub load_percent: Option<f64>,
    /// What it does.
    pub motion: Motion,
}

/// A spindle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spindle {
    /// Clockwise above 0; 0: off.
    pub speed_rpm: f64,
    /// As it is measured.
    pub actual_rpm: Option<f64>,
    /// Percent.
    pub speed_override: f64,
}

/// What an alarm is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// The drive of this axis.
    Drive(usize),
    /// Where this axis stands: limits, following error.
    Travel(usize),
    /// The program.
    Program,
    /// Logic in Structured Text.
    Logic,
    /// The bus.
    Communications,
    /// Anything else.
    System,
}

/// Something is wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Alarm {
    /// What it is about.
    pub subject: Subject,
    /// Stays the same from version to version.
    pub code: String,
    /// In words.
    pub text: String,
    /// It stops nothing.
    pub is_warning: bool,
}

/// How a machine is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Emergency stop.
    pub is_emergency_stop: bool,
    /// Drives are on.
    pub is_powered: bool,
    /// Whose orders it follows.
    pub mode: Mode,
    /// What a program does.
    pub execution: Execution,
    /// Rests at the end of each block.
    pub single_block: bool,
    /// M1 stops.
    pub optional_stop: bool,
    /// The program runs dry.
    pub dry_run: bool,
    /// Name of the program.
    pub program: Option<String>,
    /// Its line.
    pub line: Option<u32>,
    /// Tool in the spindle, 0: none.
    pub tool: u32,
    /// G54 to G59.3: 1 to 9.
    pub work_system: Option<u8>,
    /// Parts made.
    pub parts: u64,
    /// Parts wanted.
    pub parts_wanted: Option<u64>,
    /// Percent.
    pub feed_override: f64,
    /// Percent.
    pub rapid_override: f64,
    /// mm/s.
    pub feed_mm_s: f64,
    /// X, Y and Z in work coordinates, mm.
    pub place_mm: [f64; 3],
    /// Time that the program has run, s.
    pub program_s: Option<f64>,
    /// Axes, as the machine has them.
    pub axes: Vec<AxisFacts>,
    /// The first spindle.
    pub spindle: Option<Spindle>,
    /// What is wrong.
    pub alarms: Vec<Alarm>,
    /// The last message of the program.
    pub message: Option<String>,
}

/// Six digits behind the point, and no more than are needed.
fn number(value: f64) -> Value {
    let text = format!("{value:.6}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    match value.is_finite() {
        true => Value::Text(if short == "-0" { "0".into() } else { short.into() }),
        false => Value::Unavailable,
    }
}

fn measured(value: Option<f64>) -> Value {
    value.map_or(Value::Unavailable, number)
}

fn word(word: &str) -> Value {
    Value::Text(word.to_owned())
}

fn switch(on: bool, [yes, no]: [&str; 2]) -> Value {
    word(if on { yes } else { no })
}

fn maybe(value: Option<impl ToString>) -> Value {
    value.map_or(Value::Unavailable, |value| Value::Text(value.to_string()))
}

fn execution(execution: Execution) -> &'static str {
    match execution {
        Execution::Ready => "READY",
        Execution::Active => "ACTIVE",
        Execution::FeedHold => "FEED_HOLD",
        Execution::Interrupted => "INTERRUPTED",
        Execution::Wait(_) => "WAIT",
        Execution::ProgramStopped => "PROGRAM_STOPPED",
        Execution::OptionalStop => "PROGRAM_OPTIONAL_STOP",
        Execution::Stopped => "STOPPED",
        Execution::Completed => "PROGRAM_COMPLETED",
    }
}

/// Work system by its code, as a work offset is told.
fn work_offset(system: u8) -> String {
    match system {
        7..=9 => format!("G59.{}", system - 6),
        _ => format!("G{}", 53 + u16::from(system)),
    }
}

/// Observes all that is another than before.
pub(crate) fn observe(ring: &mut Ring, model: &Model, letters: &[(char, bool)], facts: &Facts, now: Duration) {
    let mut see = |id: &str, value: Value| {
        if let Some(item) = model.find(id) {
            ring.see(item, value, now);
        }
    };
    see("avail", word("AVAILABLE"));
    see("estop", switch(facts.is_emergency_stop, ["TRIGGERED", "ARMED"]));
    see("power", switch(facts.is_powered, ["ON", "OFF"]));
    for (id, on) in [
        ("single_block", facts.single_block),
        ("optional_stop", facts.optional_stop),
        ("dry_run", facts.dry_run),
    ] {
        see(id, switch(on, ["ON", "OFF"]));
    }
    see(
        "mode",
        word(match facts.mode {
            Mode::Manual => "MANUAL",
            Mode::Mdi => "MANUAL_DATA_INPUT",
            Mode::Automatic => "AUTOMATIC",
            Mode::SemiAutomatic => "SEMI_AUTOMATIC",
        }),
    );
    see("execution", word(execution(facts.execution)));
    see(
        "wait",
        match facts.execution {
            Execution::Wait(WaitFor::ToolLoad) => word("TOOL_LOAD"),
            Execution::Wait(WaitFor::Pausing) => word("PAUSING"),
            Execution::Wait(WaitFor::Resuming) => word("RESUMING"),
            _ => Value::Unavailable,
        },
    );
    see("program", maybe(facts.program.as_ref()));
    see("line", maybe(facts.line));
    see("tool_number", maybe(Some(facts.tool)));
    see(
        "tool_asset",
        maybe(Some(facts.tool).filter(|tool| *tool > 0).map(tool_id)),
    );
    see("work_offset", maybe(facts.work_system.map(work_offset)));
    see("parts", maybe(Some(facts.parts)));
    see("parts_wanted", maybe(facts.parts_wanted));
    see("feed_ovr", number(facts.feed_override));
    see("rapid_ovr", number(facts.rapid_override));
    see("feed", number(facts.feed_mm_s));
    see(
        "cut_time",
        facts
            .program_s
            .map_or(Value::Unavailable, |time_s| number((time_s * 10.0).round() / 10.0)),
    );
    let place = facts.place_mm.map(|value| match number(value) {
        Value::Text(text) => text,
        _ => "0".into(),
    });
    see("place", Value::Text(place.join(" ")));
    see("message", maybe(facts.message.as_ref()));
    let moving: Vec<String> = letters.iter().map(|(letter, _)| letter.to_string()).collect();
    see("active_axes", Value::Text(moving.join(" ")));
    for ((letter, is_rotary), axis) in letters.iter().zip(&facts.axes) {
        let id = |what: &str| format!("{}_{what}", letter.to_ascii_lowercase());
        see(&id("com"), number(axis.commanded));
        see(&id("act"), measured(axis.actual));
        see(&id("error"), measured(axis.following_error));
        see(&id("load"), measured(axis.load_percent));
        see(
            &id("state"),
            word(match axis.motion {
                Motion::Stopped => "STOPPED",
                Motion::Travel => "TRAVEL",
                Motion::Home => "HOME",
            }),
        );
        if *is_rotary {
            see(&id("mode"), word("CONTOUR"));
        }
    }
    if let Some(spindle) = facts.spindle {
        see("s_com", number(spindle.speed_rpm.abs()));
        see("s_act", measured(spindle.actual_rpm.map(f64::abs)));
        see("s_ovr", number(spindle.speed_override));
        see("s_mode", word("SPINDLE"));
        see(
            "s_dir",
            match spindle.speed_rpm {
                0.0 => Value::Unavailable,
                rpm => switch(rpm > 0.0, ["CLOCKWISE", "COUNTER_CLOCKWISE"]),
            },
        );
    }
    conditions(ring, model, letters, &facts.alarms, now);
}

fn conditions(ring: &mut Ring, model: &Model, letters: &[(char, bool)], alarms: &[Alarm], now: Duration) {
    let of_axis = |axis: usize, what: &str| match letters.get(axis) {
        Some((letter, _)) => format!("{}_{what}", letter.to_ascii_lowercase()),
        None => "system".to_owned(),
    };
    let id = |subject: Subject| match subject {
        Subject::Drive(axis) => of_axis(axis, "drive"),
        Subject::Travel(axis) => of_axis(axis, "travel"),
        Subject::Program => "motion".into(),
        Subject::Logic => "logic".into(),
        Subject::Communications => "comms".into(),
        Subject::System => "system".into(),
    };
    for (number, item) in model.items.iter().enumerate() {
        if item.category != Category::Condition {
            continue;
        }
        let active: Vec<&Alarm> = alarms.iter().filter(|alarm| id(alarm.subject) == item.id).collect();
        let gone: Vec<String> = (ring.latest().of(number).iter())
            .filter_map(|known| match &known.value {
                Value::Condition(Condition::Warning { code, .. } | Condition::Fault { code, .. }) => Some(code.clone()),
                _ => None,
            })
            .filter(|code| active.iter().all(|alarm| alarm.code != *code))
            .collect();
        if active.is_empty() {
            ring.see(number, Value::Condition(Condition::Normal(None)), now);
            continue;
        }
        for alarm in active {
            let (code, text) = (alarm.code.clone(), alarm.text.clone());
            let condition = match alarm.is_warning {
                true => Condition::Warning { code, text },
                false => Condition::Fault { code, text },
            };
            ring.see(number, Value::Condition(condition), now);
        }
        for code in gone {
            ring.see(number, Value::Condition(Condition::Normal(Some(code))), now);
        }
    }
}

/// Id of the asset that a tool is.
pub(crate) fn tool_id(number: u32) -> String {
    format!("T{number}")
}
