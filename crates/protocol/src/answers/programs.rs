//! Programs: checked, read, drawn, uploaded.

use super::*;

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
    /// How it ended.
    pub result: Outcome,
    /// The step that took too long, if one did.
    pub timed_out_step: Option<Step>,
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
    #[schemars(with = "Vec<Message>")]
    pub returns: Option<Vec<Message>>,
}

/// The block that is skipped.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Skipped {
    /// What it waited for.
    pub skips: Message,
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
