//! Programs in Structured Text while they run.

use super::*;

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
