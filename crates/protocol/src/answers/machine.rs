//! The machine: described, its file, its bus, its times.

use super::*;

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
    /// Buttons of the user.
    #[serde(default)]
    pub buttons: Vec<DescribedButton>,
    /// Pins that the user wants to see.
    #[serde(default)]
    pub values: Vec<DescribedValue>,
    /// Pages of the user, by their names below `/own/` of the panel.
    #[serde(default)]
    pub pages: Vec<String>,
}

/// A button of the user.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DescribedButton {
    /// By which it is pressed.
    pub name: String,
    /// What stands on it.
    pub label: String,
    /// What is to be asked before it is pressed.
    pub ask: Option<String>,
    /// Lines that it runs; an answer takes the place of `{name}`.
    pub mdi: Vec<String>,
    /// The program that it loads.
    pub program: Option<String>,
    /// Who may press it.
    pub role: Role,
    /// The pin that lights it.
    pub lamp: Option<String>,
    /// Numbers that it asks for.
    pub questions: Vec<DescribedQuestion>,
}

/// A number that a button asks for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DescribedQuestion {
    /// Its name.
    pub name: String,
    /// What stands before its field.
    pub label: String,
    /// What it is if it is not given.
    pub default: f64,
    /// Min.
    pub min: Option<f64>,
    /// Max.
    pub max: Option<f64>,
}

/// A pin that the user wants to see.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DescribedValue {
    /// What stands before it.
    pub label: String,
    /// The pin.
    pub pin: String,
    /// What stands behind it.
    pub unit: Option<String>,
    /// Digits behind the point.
    pub decimals: u32,
}

/// What a button has done: one with lines has begun them, one with a program has loaded it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pressed {
    /// The program that is loaded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String")]
    pub program: Option<String>,
    /// Its planned time, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64")]
    pub planned_time_s: Option<f64>,
    /// What whoever starts it should know, a line each.
    #[serde(default)]
    pub warning: Option<String>,
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
