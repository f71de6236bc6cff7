//! How everything is, and how it changes.

use super::*;

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
    /// State of the cycle.
    pub state: State,
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
    /// Step of the sequence.
    pub step: Step,
    /// Whether the machine can move.
    pub power: Power,
    /// Whose orders the machine follows, or followed last.
    pub mode: Mode,
    /// What is under way.
    pub activity: Activity,
    /// How the last order that takes time ended; null: it has not.
    pub job: Option<Outcome>,
    /// The program that runs or is about to; otherwise the one that was loaded last.
    pub program: Option<StatusProgram>,
    /// The line of MDI under way, and those that wait after it.
    pub mdi: Vec<String>,
    /// What a machine that waits waits for.
    pub waiting: Option<Waiting>,
    /// What holds a program or its feed: who has held it, a pin and its net, an override.
    pub held_by: Vec<Message>,
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
    pub alarm: Option<Message>,
    /// Entries of alarms that no one has acknowledged, the first cause first, up to eight.
    pub alarms: Vec<Entry>,
    /// Variables that are forced.
    pub forced: Vec<Forced>,
    /// What to do next for a program to run; null: it could be started.
    pub next: Option<Next>,
    /// What ended the last jog, if something was in its way.
    pub obstruction: Option<Message>,
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
    /// Tools that it changes to, each once, in the order of their first use.
    #[serde(default)]
    pub tools: Vec<u32>,
    /// It runs dry, or has.
    pub dry_run: bool,
    /// How it ended; null: it has not.
    pub result: Option<Outcome>,
}

/// What a machine that waits waits for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Waiting {
    /// What.
    pub r#for: WaitingFor,
    /// The same in words.
    pub what: Message,
    /// What releases it.
    pub release: Message,
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
    /// What became of it; null: it is under way.
    pub result: Option<LastResult>,
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
