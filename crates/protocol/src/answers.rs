//! Answers of methods and what they are made of.
//!
//! Lengths are in mm and angles in degrees unless a field says that they are in the unit of the machine; times are in seconds. Lists
//! with a number for each letter have them in the order X Y Z A B C U V W.

use crate::limits::LETTERS;
use crate::role::Role;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Fields of the status, by name: as a notification brings them.
pub type Fields = Map<String, Value>;

/// Carried out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Nothing {}

/// The methods that there are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Methods(pub Vec<MethodInfo>);

/// A method.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MethodInfo {
    /// Its name.
    pub name: String,
    /// Names of its parameters.
    pub params: Vec<String>,
    /// What it does.
    pub does: String,
}

/// An OpenRPC document.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OpenRpc(#[schemars(with = "Fields")] pub Value);

/// Who a client is to the control.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Identified {
    /// Number of its connection.
    pub client: u64,
    /// What it may do.
    pub role: Role,
    /// Name of the machine.
    pub machine: String,
    /// Version of the control.
    pub version: String,
    /// Version of the methods.
    pub api: String,
}

// ---------------------------------------------------------------------------------------------------------------- status

/// How everything is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Status {
    /// Version of the methods.
    pub api: String,
    /// Version of the control.
    pub version: String,
    /// Name of the machine.
    pub machine: String,
    /// Its machine file; empty: there is none.
    pub file: String,
    /// Process of the control.
    pub pid: u32,
    /// State of the cycle: `disabled`, `ready`, `running`, ...
    pub state: String,
    /// Cycles since the start.
    pub cycles: u64,
    /// Cycles whose date had passed before they began.
    pub cycles_skipped: u64,
    /// Greatest lateness of a cycle, us.
    pub late_max_us: f64,
    /// Joints that know where they are.
    pub homed: Vec<usize>,
    /// Line of the block that is executed.
    pub line: u32,
    /// Which way along its path the program runs.
    pub direction: Direction,
    /// The program rests at the end of each block.
    pub single_block: bool,
    /// M1 stops.
    pub optional_stop: bool,
    /// Lines that begin with / are skipped.
    pub block_delete: bool,
    /// Speed along the path, mm/s.
    pub velocity_mm_s: f64,
    /// Axes of the machine.
    pub axes: Vec<StatusAxis>,
    /// Where the machine is, in machine coordinates, mm and degrees.
    #[schemars(length(max = LETTERS.len()))]
    pub position_mm: Vec<f64>,
    /// What is left to the end of the piece of path under way, mm and degrees.
    #[schemars(length(max = LETTERS.len()))]
    pub to_go_mm: Option<Vec<f64>>,
    /// The first spindle; null: the machine has none.
    pub spindle: Option<Spindle>,
    /// What the pumps are told.
    pub coolant: Coolant,
    /// Components of other processes.
    pub external: Vec<External>,
    /// Where the overrides stand.
    #[serde(rename = "override")]
    pub overrides: Overrides,
    /// Step of the sequence, in words.
    pub step: String,
    /// Whether the machine can move: `starting`, `off`, `on`, ...
    pub power: String,
    /// Whose orders the machine follows, or followed last: those given by hand, typed lines, or those of a program.
    #[schemars(extend("enum" = ["manual", "mdi", "auto"]))]
    pub mode: String,
    /// What is under way: `idle`, `running`, ...
    pub activity: String,
    /// How the last order that takes time ended: `completed`, `stopped`, `faulted` or `timed out`; null: it has not.
    pub job: Option<String>,
    /// The program that runs or is about to; otherwise the one that was loaded last.
    pub program: Option<StatusProgram>,
    /// The line of MDI under way, and those that wait after it.
    pub mdi: Vec<String>,
    /// What a machine that waits waits for.
    pub waiting: Option<Waiting>,
    /// Active G and M codes, with S, F and T.
    pub codes: Vec<String>,
    /// Tool in the spindle; 0: none.
    pub tool: u32,
    /// What is to be subtracted from `position_mm` for work coordinates, mm and degrees.
    #[schemars(length(max = LETTERS.len()))]
    pub work_offset_mm: Vec<f64>,
    /// By how much X and Y are then to be turned back, degrees.
    pub work_rotation_degrees: f64,
    /// Time since the program began, s.
    pub elapsed_s: f64,
    /// Time that it still needs, s; null: not known.
    pub remaining_s: Option<f64>,
    /// Share of it that is done, percent; null: not known.
    pub done_percent: Option<f64>,
    /// Why the time is not known, or on what it rests.
    pub remaining_note: Option<String>,
    /// The chain of the emergency stop is open.
    pub estop_chain_open: bool,
    /// Where the program is held from which a hand has moved the machine away, mm and degrees.
    #[schemars(length(max = LETTERS.len()))]
    pub held_at_mm: Option<Vec<f64>>,
    /// Limit switches that are closed.
    pub limit_switches: LimitSwitches,
    /// Why the machine stopped by itself; stands until it is acknowledged or another program begins.
    pub alarm: Option<String>,
    /// Variables that are forced.
    pub forced: Vec<Forced>,
    /// What to do next for a program to run; null: it could be started.
    pub next: Option<String>,
    /// What ended the last jog, if something was in its way.
    pub obstruction: Option<String>,
    /// The last entries of the journal, the newest last.
    pub messages: Vec<Entry>,
    /// Parts made, and wanted.
    pub parts: Parts,
    /// How often the program under way begins again after this time.
    pub runs_left: u32,
    /// The program that was loaded or begun last, by an earlier control as well.
    pub last_program: Option<LastProgram>,
    /// Who has control; null: no one.
    pub control: Option<Control>,
}

/// Which way along its path a program runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// To its end.
    #[default]
    Forward,
    /// Back.
    Reverse,
}

/// An axis, in the status.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StatusAxis {
    /// Its letter.
    pub axis: String,
    /// Its joints.
    pub joints: Vec<usize>,
    /// `mm` or `degrees`.
    pub unit: String,
}

/// What a spindle is told.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Spindle {
    /// It turns.
    pub on: bool,
    /// Speed, rpm; below 0: counter-clockwise.
    pub speed_rpm: f64,
}

/// What the pumps are told.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Coolant {
    /// M8.
    pub flood: bool,
    /// M7.
    pub mist: bool,
}

/// A component of another process.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct External {
    /// Its name.
    pub name: String,
    /// Its process writes its outputs.
    pub alive: bool,
    /// How often it has stayed away since the start.
    pub losses: u64,
}

/// Where the overrides stand, and whether the program lets them act at the moment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Overrides {
    /// Of the programmed feed, percent.
    pub feed_percent: f64,
    /// Of rapid moves, percent.
    pub rapid_percent: f64,
    /// Of the programmed speed of the spindle, percent.
    pub spindle_percent: f64,
    /// The one of the feed acts (M48, M50).
    pub feed_acts: bool,
    /// The one of the spindle acts (M48, M51).
    pub spindle_acts: bool,
    /// Adaptive feed acts (M52).
    pub adaptive_feed_acts: bool,
    /// The pin that holds the feed acts (M53).
    pub feed_hold_acts: bool,
}

impl Default for Overrides {
    /// What is programmed.
    fn default() -> Overrides {
        Overrides {
            feed_percent: 100.0,
            rapid_percent: 100.0,
            spindle_percent: 100.0,
            feed_acts: true,
            spindle_acts: true,
            adaptive_feed_acts: false,
            feed_hold_acts: true,
        }
    }
}

/// A program, in the status.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StatusProgram {
    /// Its path, or the name that its client gave it.
    pub name: String,
    /// Another one for each text that is loaded; 0: there is no text.
    pub revision: u64,
    /// Its last line with something to do.
    pub lines: u32,
    /// Planned time, s.
    pub planned_time_s: f64,
    /// It runs dry, or has.
    pub dry_run: bool,
    /// How it ended: `completed`, `stopped`, `faulted` or `timed out`; null: it has not.
    pub result: Option<String>,
}

/// What a machine that waits waits for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Waiting {
    /// `operator`, `tool-change`, `spindle-speed`, ...
    #[serde(rename = "for")]
    pub what: String,
    /// The same in words.
    pub text: String,
    /// What releases it.
    pub release: String,
}

/// Limit switches that are closed, by joint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LimitSwitches {
    /// At the lower ends.
    pub lower: Vec<usize>,
    /// At the upper ends.
    pub upper: Vec<usize>,
}

/// A variable that has the value that someone gave it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Forced {
    /// Name of its program.
    pub program: String,
    /// Its name.
    pub variable: String,
    /// Its value.
    pub value: String,
}

/// The counter of parts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Parts {
    /// Parts made.
    pub count: u64,
    /// Parts wanted, if someone has said so.
    pub target: Option<u64>,
}

/// The program that was loaded or begun last.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LastProgram {
    /// Its path, or the name that its client gave it.
    pub name: String,
    /// Line that it had reached.
    pub line: u32,
    /// `loaded`, `completed`, `stopped`, `faulted`, `timed out` or `interrupted`; null: it is under way.
    pub result: Option<String>,
}

/// Who has control.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Control {
    /// Number of its connection.
    pub client: u64,
    /// Its process; 0: not known.
    pub process: u32,
    /// What it is called.
    pub name: String,
    /// Taken by `control.take`, and kept until it is released.
    pub taken: bool,
}

/// The whole state, for a new subscriber.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Subscribed {
    /// When, CLOCK_MONOTONIC, s.
    pub monotonic_s: f64,
    /// When, seconds since 1970, UTC.
    pub unix_s: f64,
    /// How everything is.
    pub state: Status,
}

/// The notification `state`: what has changed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StateChange {
    /// When, CLOCK_MONOTONIC, s.
    pub monotonic_s: f64,
    /// When, seconds since 1970, UTC.
    pub unix_s: f64,
    /// Fields of the status that differ from what was told last, each as a whole.
    #[schemars(schema_with = "changed")]
    pub changed: Fields,
}

fn changed(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "object", "minProperties": 1, "additionalProperties": true })
}

// --------------------------------------------------------------------------------------------------------------- journal

/// An entry of the journal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Entry {
    /// Number, from 1 on; it goes on where the last control of this machine ended.
    pub seq: u64,
    /// When, seconds since 1970, UTC.
    pub unix_s: f64,
    /// When, seconds since the first cycle.
    pub time_s: f64,
    /// What kind of thing happened.
    pub kind: EntryKind,
    /// What, in words.
    pub text: String,
    /// More of an alarm or a warning.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "AlarmRecord")]
    pub alarm: Option<AlarmRecord>,
    /// More of a program that begins or is over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "ProgramRecord")]
    pub program: Option<ProgramRecord>,
    /// Alarms that were acknowledged (numbers of their entries), and how.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "(Vec<u64>, Acknowledged)")]
    pub acknowledges: Option<(Vec<u64>, Acknowledged)>,
}

/// What kind of thing happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EntryKind {
    /// The machine stopped by itself.
    Alarm,
    /// Something is wrong and stops nothing.
    Warning,
    /// Anything else.
    #[default]
    Note,
}

/// What an alarm or a warning is about.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AlarmRecord {
    /// Stays the same from version to version, like `J-203`.
    pub code: String,
    /// `warning`, `stop`, `quick stop`, `emergency stop` or `silenced`.
    pub severity: String,
    /// What the machine does about it.
    pub reaction: String,
    /// Number of the entry of the first cause; its own if it is that.
    pub first_cause: u64,
    /// Number of the joint.
    pub joint: Option<usize>,
    /// Name of the node.
    pub node: Option<String>,
    /// The program that was under way.
    pub program: Option<String>,
    /// Its line.
    pub line: Option<u32>,
    /// State of the machine before it.
    pub state: String,
    /// When someone has acknowledged it, and how.
    pub acknowledged: Option<Acknowledged>,
}

/// Who has acknowledged an alarm.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Acknowledged {
    /// When, seconds since 1970, UTC.
    pub unix_s: f64,
    /// The order that did it.
    pub by: String,
}

/// A program that begins, or is over.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProgramRecord {
    /// Its path, or the name that its client gave it.
    pub name: String,
    /// When it began, seconds since 1970, UTC.
    pub begun_unix_s: f64,
    /// How it ended; null: it begins here.
    pub result: Option<String>,
    /// From begin to end, s.
    pub took_s: Option<f64>,
    /// Line that it had reached.
    pub line: Option<u32>,
    /// Greatest distance of the actual path from the programmed one, mm.
    pub deviation_max_mm: Option<f64>,
    /// Number of its report.
    pub report: Option<u64>,
}

/// Entries of the journal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Journal {
    /// The oldest first.
    pub entries: Vec<Entry>,
    /// There are others after them.
    pub more: bool,
    /// Number of the last one of all.
    pub last: u64,
    /// Number of the last one that outlasts this control, or that a full disk does not take.
    pub on_disk: u64,
}

// -------------------------------------------------------------------------------------------------------------- programs

/// What is known of a program before it runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Outlook {
    /// Its path, or the name that its client gave it.
    pub program: String,
    /// As `revision` of the status.
    pub revision: u64,
    /// Its last line with something to do.
    pub lines: u32,
    /// Planned time, s.
    pub planned_time_s: f64,
    /// How much quicker than motion it was planned.
    pub real_time_factor: RealTimeFactor,
    /// What whoever starts it should know, a line each.
    pub warning: Option<String>,
}

/// How much quicker than motion a program is planned.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RealTimeFactor {
    /// Seconds of motion per second of planning; null: there is no motion.
    pub whole: Option<f64>,
    /// The stretch where it is least; null: the program is shorter than a stretch.
    pub least: Option<SlowStretch>,
}

/// A stretch of a program.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SlowStretch {
    /// Seconds of motion per second of planning.
    pub factor: f64,
    /// Its first line.
    pub from_line: u32,
    /// Its last line.
    pub to_line: u32,
    /// Where it begins, s of motion.
    pub from_s: f64,
    /// Where it ends, s of motion.
    pub to_s: f64,
}

/// Room for a program.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UploadBegun {
    /// Number of the upload.
    pub upload: u64,
    /// Octets of its longest part.
    pub part_octets: usize,
}

/// How much of a program has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UploadGrown {
    /// Octets.
    pub received: u64,
}

/// Lines of a program.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Text {
    /// Its path, or the name that its client gave it.
    pub name: String,
    /// As `revision` of the status.
    pub revision: u64,
    /// Number of the first of the lines.
    pub first_line: u64,
    /// Each cut at 256 octets.
    pub lines: Vec<String>,
    /// There are others after them.
    pub more: bool,
}

/// A way that is being drawn.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PathBegun {
    /// Its number.
    pub path: u64,
    /// Name of the program.
    pub program: String,
    /// Letters of the axes of a record.
    pub axes: Vec<String>,
    /// Octets of a record.
    pub record_octets: usize,
}

/// Some of a way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PathPart {
    /// Records.
    #[schemars(extend("contentEncoding" = "base64"))]
    pub base64: String,
    /// There is no more.
    pub end: bool,
    /// What is wrong with the program where the way ends.
    pub error: Option<String>,
}

/// Lines of MDI.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Lines {
    /// The latest last.
    pub lines: Vec<String>,
}

/// What a program did.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Counts the programs of this machine.
    pub number: u64,
    /// Name of the machine.
    pub machine: String,
    /// When it began, seconds since 1970, UTC.
    pub begun_unix_s: f64,
    /// From begin to end, s.
    pub took_s: f64,
    /// Parts after it.
    pub parts: Parts,
    /// Cycles that were skipped meanwhile.
    pub cycles_skipped: u64,
    /// Its path, or the name that its client gave it.
    pub program: String,
    /// `completed`, `stopped`, `faulted` or `timed out`.
    pub result: String,
    /// The step that took too long, if one did.
    pub timed_out_step: Option<String>,
    /// Why, if it did not complete.
    pub alarms: Vec<ReportAlarm>,
    /// What was wrong without stopping it.
    pub warnings: Vec<ReportWarning>,
    /// Last line that was run.
    pub line_reached: u32,
    /// Last line with something to do.
    pub lines: u32,
    /// Planned time, s; of probing moves, and what follows them, as far as they really went.
    pub planned_time_s: f64,
    /// How much quicker than motion it was planned when it was checked.
    pub real_time_factor: RealTimeFactor,
    /// Time that it took, holds and waits included, s.
    pub motion_time_s: f64,
    /// Cycles of this in which the machine stood because its plan came late.
    pub starved_cycles: u64,
    /// Greatest distance between commanded and actual position of any joint, mm.
    pub following_error_max_mm: f64,
    /// Line where that was.
    pub following_error_max_line: u32,
    /// Distance from the programmed path; null: no path was recorded.
    pub deviation: Option<Deviation>,
}

/// Why a program did not complete.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReportAlarm {
    /// When, seconds since the first cycle.
    pub time_s: f64,
    /// Why, in words.
    pub cause: String,
}

/// What was wrong without stopping a program.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReportWarning {
    /// When for the first time, seconds since the first cycle.
    pub time_s: f64,
    /// How often.
    pub times: u64,
    /// What, in words.
    pub cause: String,
}

/// Distance from the programmed path, mm.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Deviation {
    /// Greatest one of the commanded path.
    pub command_max_mm: f64,
    /// Greatest one of the actual path.
    pub actual_max_mm: f64,
    /// What the program allows.
    pub tolerance_mm: f64,
}

/// What a resume does first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Resumed {
    /// The way back to the path, one leg each, if the machine is not where the program is held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Vec<String>")]
    pub returns: Option<Vec<String>>,
}

/// The block that is skipped.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Skipped {
    /// What it waited for.
    pub skips: String,
}

/// What comes of a jog; empty if one goes on or ends.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Jog")]
pub struct JogOutlook {
    /// Letter of the axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String")]
    pub axis: Option<String>,
    /// `mm` or `degrees`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String")]
    pub unit: Option<String>,
    /// Greatest speed, mm/s or degrees/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64")]
    pub velocity_mm_s: Option<f64>,
    /// Where the motion ends if that is the soft limit; null: it ends before.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "some")]
    #[schemars(with = "Option<f64>")]
    pub soft_limit_mm: Option<Option<f64>>,
}

/// A field that is there, null or not.
fn some<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<Option<f64>>, D::Error> {
    Option::deserialize(deserializer).map(Some)
}

// --------------------------------------------------------------------------------------------------------------- machine

/// What of a machine does not change.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Described {
    /// Its name.
    pub machine: String,
    /// Its unit of length: `mm` or `inch`.
    pub unit: String,
    /// Length of a cycle, us.
    pub cycle_us: u32,
    /// Its axes.
    pub axes: Vec<DescribedAxis>,
    /// Its joints.
    pub joints: Vec<DescribedJoint>,
    /// How many spindles it has.
    pub spindles: usize,
    /// Greatest speed of a spindle, rpm.
    pub spindle_rpm_max: f64,
    /// There is a folder of programs.
    pub programs: bool,
}

/// An axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DescribedAxis {
    /// Its letter.
    pub axis: String,
    /// `mm` or `degrees`.
    pub unit: String,
    /// Its joints.
    pub joints: Vec<usize>,
    /// The joint that is this axis alone.
    pub joint: Option<usize>,
    /// Lower and upper end.
    #[schemars(with = "Option<Vec<f64>>")]
    pub travel: Option<[f64; 2]>,
    /// Greatest speed, per second.
    pub velocity_per_s: Option<f64>,
    /// Greatest acceleration, per second squared.
    pub acceleration_per_s2: Option<f64>,
}

/// A joint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DescribedJoint {
    /// Its number.
    pub joint: usize,
    /// Lower and upper end.
    #[schemars(with = "Vec<f64>")]
    pub travel: [f64; 2],
    /// Greatest speed, per second.
    pub velocity_per_s: f64,
    /// Following error at which the machine stops.
    pub following_error: f64,
}

/// Figures for Prometheus.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Metrics {
    /// In its exposition format.
    pub text: String,
}

/// The network and its nodes, as `isocnc bus status --json` prints them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Network(#[schemars(with = "Fields")] pub Value);

/// The value of an object.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Octets {
    /// Its octets.
    #[schemars(with = "String")]
    pub value: crate::params::Hex,
}

/// The machine file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MachineFile {
    /// Its path.
    pub file: String,
    /// SHA-256 of its text, hexadecimal.
    pub sha256: String,
    /// Its text.
    pub text: String,
    /// What is wrong with it.
    pub errors: Vec<FileError>,
}

/// What is wrong with a machine file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FileError {
    /// Line, from 1 on.
    pub line: Option<usize>,
    /// Column, from 1 on.
    pub column: Option<usize>,
    /// The key that is wrong.
    pub key: String,
    /// Its value.
    pub value: Option<String>,
    /// What it must be.
    pub rule: String,
    /// What may have been meant.
    pub hint: Option<String>,
}

/// What is wrong with the text of a machine file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Errors {
    /// Each with its place.
    pub errors: Vec<FileError>,
}

/// A machine file that was replaced.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FileWritten {
    /// Path of the one before.
    pub before: String,
    /// SHA-256 of the new text, hexadecimal.
    pub sha256: String,
}

/// What stands in the way of real time, as `isocnc doctor --no-tests --json` prints it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Doctor(#[schemars(with = "Fields")] pub Value);

/// How cycles have kept their time since the start.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Times {
    /// Length of a cycle, us.
    pub cycle_us: u32,
    /// Orders that the cycle has taken.
    pub orders: OrdersTaken,
    /// What the distance of two SoCs differs from the cycle.
    pub period: Histogram,
    /// How late the SoC was.
    pub lateness: Histogram,
    /// How long the exchange took.
    pub exchange: Histogram,
    /// How long the rest of the cycle took.
    pub compute: Histogram,
}

/// Orders that the cycle has taken.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OrdersTaken {
    /// How many.
    pub taken: u64,
    /// When the last one, seconds since 1970, UTC.
    pub last_unix_s: Option<f64>,
}

/// Counts of values.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Histogram {
    /// Upper edges of the buckets but the last, us.
    pub edges_us: Vec<f64>,
    /// Values in each bucket; the last one has those beyond all edges.
    pub counts: Vec<u64>,
}

// ------------------------------------------------------------------------------------------------------ offsets and tools

/// Nothing, or a warning that the disk has not taken it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Kept {
    /// Why it will be forgotten.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String")]
    pub warning: Option<String>,
}

/// Origins and rotations of work systems, in machine coordinates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Offsets {
    /// `mm` or `inch`; rotary axes are in degrees.
    pub unit: String,
    /// G54 to G59.3.
    pub systems: Vec<WorkSystem>,
    /// G92, by letter.
    pub g92: BTreeMap<String, f64>,
    /// G92 is active.
    pub g92_active: bool,
}

/// A work system.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorkSystem {
    /// G54 to G59.3.
    pub system: String,
    /// It is active.
    pub active: bool,
    /// Its origin, by letter.
    pub origin: BTreeMap<String, f64>,
    /// About Z of its origin, counter-clockwise from above, degrees.
    pub rotation_degrees: f64,
}

/// The tool table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tools {
    /// `mm` or `inch`.
    pub unit: String,
    /// Tool in the spindle; 0: none.
    pub in_spindle: u32,
    /// Its tools.
    pub tools: Vec<Tool>,
}

/// A tool.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tool {
    /// Its number.
    pub tool: u32,
    /// Its place in the magazine.
    pub pocket: u32,
    /// Length, in the unit of the machine.
    pub length: f64,
    /// Diameter, in the unit of the machine.
    pub diameter: f64,
    /// What is written next to it in the table.
    pub remark: String,
}

// ------------------------------------------------------------------------------------------------------------------ pins

/// Pins and nets.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pins {
    /// Some of them.
    pub pins: Vec<Pin>,
    /// There are others after them.
    pub more: bool,
}

/// A pin or net.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pin {
    /// Its name.
    pub name: String,
    /// Type of its value.
    #[serde(rename = "type")]
    pub kind: PinType,
    /// What it is.
    pub direction: PinDirection,
    /// Its value; null: not a number.
    #[schemars(schema_with = "pin_value")]
    pub value: Value,
    /// The net that reaches it.
    pub net: Option<String>,
    /// The pin that drives a net.
    pub source: Option<String>,
    /// The pin of which it is another name.
    pub alias_of: Option<String>,
    /// Unit of its value.
    pub unit: Option<String>,
}

fn pin_value(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": ["boolean", "number", "null"] })
}

/// Type of the value of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PinType {
    /// Off or on.
    Bit,
    /// 32-bit signed integer.
    S32,
    /// 32-bit unsigned integer.
    U32,
    /// 64-bit signed integer.
    S64,
    /// 64-bit unsigned integer.
    U64,
    /// IEEE 754 double.
    Float,
}

/// What a pin is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PinDirection {
    /// A net writes it.
    In,
    /// A component writes it.
    Out,
    /// A net.
    Net,
}

/// An oscilloscope that samples from now on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScopeBegun {
    /// Its number.
    pub scope: u64,
    /// Time between two samples, us.
    pub period_us: f64,
    /// What it samples.
    pub channels: Vec<Channel>,
}

/// A channel of an oscilloscope.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Channel {
    /// Name of the pin or net.
    pub name: String,
    /// Type of its value.
    #[serde(rename = "type")]
    pub kind: PinType,
    /// Unit of its value; empty: none.
    pub unit: String,
}

/// Rows of an oscilloscope: the answer of `scope.next`, and the notification `scope`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScopePart {
    /// Its number.
    pub scope: u64,
    /// Number of the record that they are of.
    pub record: u64,
    /// How many rows.
    pub rows: usize,
    /// The rows.
    #[schemars(extend("contentEncoding" = "base64"))]
    pub base64: String,
    /// The record ends with them.
    pub record_ends: bool,
    /// How far the oscilloscope is.
    pub state: ScopeState,
    /// Cycles that were lost as no one fetched them in time.
    pub lost: u64,
    /// There are others already.
    pub more: bool,
    /// Why it has ended.
    pub error: Option<String>,
}

/// How far an oscilloscope is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ScopeState {
    /// For a cycle, or for the trigger.
    #[default]
    Waiting,
    /// A record is under way.
    Recording,
    /// It is gone.
    Done,
}

// ----------------------------------------------------------------------------------------------------------------- logic

/// Programs in Structured Text.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogicTasks {
    /// All of them.
    pub programs: Vec<LogicTask>,
}

/// A program in Structured Text.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogicTask {
    /// Its name.
    pub name: String,
    /// Its file.
    pub file: String,
    /// Time from scan to scan, ms.
    pub period_ms: f64,
    /// Steps of its longest scan.
    pub steps_max: u64,
    /// Scans since the start.
    pub scans: u64,
    /// Scans that were skipped as the one before was not over.
    pub overruns: u64,
    /// Scans with a result that had no room.
    pub overflows: u64,
    /// The last scan, us.
    pub scan_us: f64,
    /// The longest scan, us.
    pub scan_max_us: f64,
    /// It stands, by a fault.
    pub stands: bool,
    /// Variables that are forced.
    pub forced: usize,
}

/// Variables of a program after one scan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogicVariables {
    /// Name of the program.
    pub program: String,
    /// When, ms since the first scan.
    pub time_ms: f64,
    /// Some of its variables.
    pub variables: Vec<LogicVariable>,
    /// There are others after them.
    pub more: bool,
}

/// A variable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogicVariable {
    /// Its name.
    pub name: String,
    /// Its type, in words of Structured Text.
    #[serde(rename = "type")]
    pub kind: String,
    /// Its value, as it is written in Structured Text.
    pub value: String,
    /// Line of its declaration.
    pub line: u32,
    /// What it is to pins.
    pub role: LogicRole,
    /// It keeps its value over a restart.
    pub retain: bool,
    /// Its pin.
    pub pin: Option<String>,
    /// It is forced.
    pub forced: bool,
}

/// What a variable is to pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LogicRole {
    /// A pin gives it its value.
    Input,
    /// It gives a pin its value.
    Output,
    /// It has no pin.
    Internal,
}

/// A value that was forced.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogicForced {
    /// Variable and value, in words.
    pub forced: String,
}

/// What is forced no longer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogicReleased {
    /// How many variables.
    pub released: usize,
}

/// A program that has taken the place of another.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogicReloaded {
    /// Variables that go on with their values.
    pub carried: usize,
}
