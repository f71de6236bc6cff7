//! Parameters of methods. They go by name; one that is `None` is omitted.
//!
//! The order of fields is that in which the control names and checks them.

use crate::answers::JobValue;
use crate::limits::{
    CHANNELS_MAX, DRIVE_AXIS_MAX, JOINT_MAX, LETTERS, LINES_MAX, PART_MAX, PROGRAM_MAX, SCOPE_RATE_MAX_HZ,
    SDO_VALUE_MAX, SHA256, SIM_FAULTS, STATE_RATE_MAX_HZ, VALUES_MAX, WORK_SYSTEMS,
};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserializer, Error};
use serde::{Deserialize, Serialize, Serializer};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Octets, as pairs of hexadecimal digits on the wire.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Hex(pub Vec<u8>);

impl Hex {
    /// Reads pairs of hexadecimal digits; `None` for anything else.
    pub fn parse(text: &str) -> Option<Hex> {
        if !text.len().is_multiple_of(2) {
            return None;
        }
        let digit = |octet: u8| char::from(octet).to_digit(16);
        let pairs = text.as_bytes().chunks_exact(2);
        pairs
            .map(|pair| Some((digit(pair[0])? << 4 | digit(pair[1])?) as u8))
            .collect::<Option<_>>()
            .map(Hex)
    }
}

impl std::fmt::Display for Hex {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|octet| write!(f, "{octet:02x}"))
    }
}

impl Serialize for Hex {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Hex {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Hex, D::Error> {
        let text = Cow::<str>::deserialize(deserializer)?;
        Hex::parse(&text).ok_or_else(|| D::Error::custom("expected pairs of hexadecimal digits"))
    }
}

impl JsonSchema for Hex {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Hex".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^([0-9A-Fa-f]{2})*$" })
    }
}

/// The parameters of a method: a comment for each field is its description.
macro_rules! params {
    ($($(#[$doc:meta])* $name:ident { $($fields:tt)* })*) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
            pub struct $name { $($fields)* }
        )*
    };
}

params! {
    /// No parameters.
    NoParams {}

    /// Who a client is.
    Identify {
        /// What it is called, for whoever wonders who has control.
        pub name: Option<String>,
        /// Its version.
        pub version: Option<String>,
        /// What kind of client it is.
        pub kind: Option<String>,
        /// For the panel, which takes it in the first message; the control does not look at it.
        pub token: Option<String>,
    }

    /// How often a subscriber is told.
    Subscribe {
        /// Positions and the like come at most so often, Hz; 20 without it.
        #[schemars(range(min = 1, max = STATE_RATE_MAX_HZ))]
        pub rate_hz: Option<u64>,
    }

    /// Who takes control.
    TakeControl {
        /// What others are told of the holder.
        pub name: Option<String>,
        /// Even where another client has taken it.
        pub force: Option<bool>,
    }

    /// An object of a node.
    SdoRead {
        /// Id of the node.
        #[schemars(range(min = 1, max = 239))]
        pub node: u8,
        /// Index of the object.
        pub index: u16,
        /// Sub-index.
        pub sub: u8,
    }

    /// An object of a node, and its value.
    SdoWrite {
        /// Id of the node.
        #[schemars(range(min = 1, max = 239))]
        pub node: u8,
        /// Index of the object.
        pub index: u16,
        /// Sub-index.
        pub sub: u8,
        /// Its octets.
        #[schemars(length(max = 2 * SDO_VALUE_MAX))]
        pub value: Hex,
    }

    /// What goes wrong with a simulated drive.
    SimFault {
        /// Id of the node.
        #[schemars(range(min = 1, max = 239))]
        pub node: u8,
        /// A kind of `[[sim.fault]]`, or `none`: all is mended.
        #[schemars(extend("enum" = SIM_FAULTS))]
        pub kind: String,
        /// Which axis of the drive; 0 without it.
        #[schemars(range(max = DRIVE_AXIS_MAX))]
        pub axis: Option<u8>,
        /// How long, s: 0.1 to 6553.5; without it, until `none`.
        pub for_s: Option<f64>,
    }

    /// What is homed.
    Home {
        /// Numbers of joints; all without it.
        #[schemars(inner(range(max = JOINT_MAX)))]
        pub joints: Option<Vec<u64>>,
    }

    /// A program that is to be uploaded.
    UploadBegin {
        /// Its name.
        pub name: String,
        /// Its length, octets.
        #[schemars(range(max = PROGRAM_MAX))]
        pub octets: u64,
    }

    /// The next part of an upload.
    UploadAppend {
        /// Number of the upload.
        #[schemars(range(max = u32::MAX))]
        pub upload: u64,
        /// Octets that have come before.
        #[schemars(range(max = PROGRAM_MAX))]
        pub at: u64,
        /// What follows them.
        #[schemars(length(max = 2 * PART_MAX))]
        pub value: Hex,
    }

    /// The end of an upload.
    UploadCommit {
        /// Number of the upload.
        #[schemars(range(max = u32::MAX))]
        pub upload: u64,
        /// SHA-256 of all octets.
        #[schemars(length(max = 2 * SHA256))]
        pub sha256: Hex,
    }

    /// A program: `file`, `path` or `upload` alone, or `text` and its `name`.
    Program {
        /// A file of the folder of programs.
        pub file: Option<String>,
        /// Absolute path of a file that the control may read.
        pub path: Option<String>,
        /// Number of an upload that was committed.
        #[schemars(range(max = u32::MAX))]
        pub upload: Option<u64>,
        /// What the text is called in messages.
        pub name: Option<String>,
        /// The program itself.
        pub text: Option<String>,
    }

    /// How the loaded program begins.
    ProgramStart {
        /// Before this line.
        #[schemars(range(min = 1))]
        pub from_line: Option<u32>,
        /// What a start at a line means is right.
        pub yes: Option<bool>,
        /// So many times in all; once without it.
        #[schemars(range(min = 1))]
        pub repeat: Option<u32>,
        /// Dry: all moves at feed at this one, mm/min or degrees/min, above 0.
        pub dry_run_feed_mm_min: Option<f64>,
        /// Only the program of this revision.
        pub revision: Option<u64>,
    }

    /// Which report.
    ProgramReport {
        /// Its number; the last one without it.
        pub number: Option<u64>,
    }

    /// Which lines of the text of the program.
    ProgramText {
        /// The first of them; 1 without it.
        #[schemars(range(min = 1))]
        pub from_line: Option<u32>,
        /// How many; 50 without it.
        #[schemars(range(min = 1, max = LINES_MAX))]
        pub lines: Option<u64>,
    }

    /// How the way of a program is drawn.
    PathBegin {
        /// How far it may be off, mm; 0.01 without it.
        pub tolerance_mm: Option<f64>,
    }

    /// A way that is being fetched.
    PathNext {
        /// Its number.
        #[schemars(range(max = u32::MAX))]
        pub path: u64,
    }

    /// Which pins and nets.
    PinList {
        /// Those that this fits; `*` and `?` stand for letters.
        pub pattern: Option<String>,
        /// From this number of them on.
        pub from: Option<u32>,
    }

    /// What an oscilloscope shows.
    ScopeBegin {
        /// Names of pins or nets.
        #[schemars(length(min = 1, max = CHANNELS_MAX))]
        pub pins: Vec<String>,
        /// What begins a record.
        pub trigger: Option<String>,
        /// `auto`, `normal`, `single` or `roll`.
        pub mode: Option<String>,
        /// Length of a record, s; 1 without it.
        pub seconds: Option<f64>,
        /// Share of a record before its trigger, percent; 0 without it.
        #[schemars(range(min = 0, max = 100))]
        pub before_percent: Option<f64>,
        /// Cycles of a row; 1 without it.
        #[schemars(range(min = 1))]
        pub cycles_per_row: Option<u32>,
        /// Rows come as notifications, at most so often, Hz; without it they are fetched.
        #[schemars(range(min = 1, max = SCOPE_RATE_MAX_HZ))]
        pub rate_hz: Option<u64>,
    }

    /// An oscilloscope that is open.
    ScopeOf {
        /// Its number.
        #[schemars(range(max = u32::MAX))]
        pub scope: u64,
    }

    /// A line that is typed.
    Mdi {
        /// One line of G-code, up to 256 octets.
        pub line: String,
    }

    /// Lines that follow each other without a stop.
    MdiStream {
        /// Whole lines of G-code, up to 65536 octets.
        pub text: String,
        /// Answered once all of them have been executed.
        pub wait: Option<bool>,
    }

    /// What an axis reads where it stands.
    TouchOff {
        /// Letter of the axis.
        #[schemars(extend("enum" = LETTERS))]
        pub axis: String,
        /// In the unit of the machine.
        pub value: f64,
        /// The work system that changes; without it the one in force.
        #[schemars(extend("enum" = WORK_SYSTEMS))]
        pub system: Option<String>,
        /// The length of this tool changes instead.
        pub tool: Option<u32>,
    }

    /// The origin of a work system on an axis, or how the system is turned.
    OffsetSet {
        /// Which work system; without it the one in force.
        #[schemars(extend("enum" = WORK_SYSTEMS))]
        pub system: Option<String>,
        /// Letter of the axis.
        #[schemars(extend("enum" = LETTERS))]
        pub axis: Option<String>,
        /// Machine coordinate, in the unit of the machine.
        pub value: Option<f64>,
        /// About Z of its origin, counter-clockwise from above, degrees.
        pub rotation_degrees: Option<f64>,
    }

    /// What a tool measures, and what is kept of it.
    ToolSet {
        /// Its number.
        pub tool: u32,
        /// In the unit of the machine.
        pub length: Option<f64>,
        /// In the unit of the machine.
        pub diameter: Option<f64>,
        /// Its place in the magazine.
        pub pocket: Option<u32>,
        /// What is written next to it in the table.
        pub remark: Option<String>,
        /// To be added to the length since it was measured, in the unit of the machine.
        pub length_wear: Option<f64>,
        /// The same of the diameter.
        pub diameter_wear: Option<f64>,
        /// Minutes that it may be used; 0: as long as one likes.
        pub life_minutes: Option<f64>,
        /// Parts that it may be used for; 0: as many as one likes.
        pub life_parts: Option<u32>,
        /// Minutes that it has been used; 0 for a new one.
        pub used_minutes: Option<f64>,
        /// Parts that it has been used for.
        pub used_parts: Option<u32>,
        /// The tool that is called in its place when its life is over; 0: none.
        pub sister: Option<u32>,
    }

    /// A tool of the table.
    ToolDelete {
        /// Its number.
        pub tool: u32,
    }

    /// A motion by hand, of an axis or of a joint.
    Jog {
        /// Letter of the axis.
        #[schemars(extend("enum" = LETTERS))]
        pub axis: Option<String>,
        /// Number of the joint.
        #[schemars(range(max = JOINT_MAX))]
        pub joint: Option<u64>,
        /// mm/s or degrees/s; its sign is the direction where there is no distance.
        pub velocity_mm_s: f64,
        /// mm or degrees; without it as far as the soft limit.
        pub distance_mm: Option<f64>,
    }

    /// What is being jogged: an axis, a joint, or without both all.
    Jogging {
        /// Letter of the axis.
        #[schemars(extend("enum" = LETTERS))]
        pub axis: Option<String>,
        /// Number of the joint.
        #[schemars(range(max = JOINT_MAX))]
        pub joint: Option<u64>,
    }

    /// How fast a program runs back.
    Reverse {
        /// Of its speed, above 0; 100 without it.
        #[schemars(range(min = 0, max = 100))]
        pub percent: Option<f64>,
    }

    /// How the spindle turns.
    Spindle {
        /// Counter-clockwise below 0; 0: it stops.
        pub speed_rpm: f64,
    }

    /// What the pumps do.
    Coolant {
        /// M8; stays as it is without it.
        pub flood: Option<bool>,
        /// M7; stays as it is without it.
        pub mist: Option<bool>,
    }

    /// A switch.
    Switch {
        /// Whether it is on from now on.
        pub on: bool,
    }

    /// Percent of what is programmed; at least one of them.
    Override {
        /// Of the feed.
        #[schemars(range(min = 0, max = 120))]
        pub feed: Option<f64>,
        /// Of rapid moves.
        #[schemars(range(min = 0, max = 100))]
        pub rapid: Option<f64>,
        /// Of the speed of the spindle.
        #[schemars(range(min = 50, max = 120))]
        pub spindle: Option<f64>,
    }

    /// Which entries of the journal.
    JournalSince {
        /// Those behind this number; all that are known without it.
        pub seq: Option<u64>,
    }

    /// The counter of parts; at least one of them.
    PartsSet {
        /// Parts that are there.
        pub count: Option<u32>,
        /// Parts that are wanted; 0: nobody says.
        pub target: Option<u32>,
    }

    /// Which variables of a program in Structured Text.
    LogicLook {
        /// Name or file of the program; may be left out where there is one.
        pub program: Option<String>,
        /// Only this variable, structure, array or block.
        pub variable: Option<String>,
        /// Words that name or pin have in them.
        pub search: Option<String>,
        /// From this number of them on.
        pub from: Option<u32>,
    }

    /// A value for a variable.
    LogicForce {
        /// Name or file of the program; may be left out where there is one.
        pub program: Option<String>,
        /// Name of the variable.
        pub variable: String,
        /// Its value, as it is written in Structured Text.
        pub value: String,
    }

    /// What is forced no longer.
    LogicRelease {
        /// Name or file of the program; may be left out where there is one.
        pub program: Option<String>,
        /// Name of the variable; all without it.
        pub variable: Option<String>,
    }

    /// A program in Structured Text.
    LogicReload {
        /// Its name or file; may be left out where there is one.
        pub program: Option<String>,
    }

    /// The text of a machine file.
    MachineCheck {
        /// All of it, up to 48 KiB.
        pub text: String,
    }

    /// A text that takes the place of the machine file.
    MachineWrite {
        /// All of it, up to 48 KiB.
        pub text: String,
        /// SHA-256 of the file that it replaces.
        #[schemars(length(max = 2 * SHA256))]
        pub sha256: Hex,
    }

    /// A job and its numbers.
    JobMake {
        /// Its kind.
        pub kind: String,
        /// By the names of fields; one that is missing has its default.
        pub numbers: Option<BTreeMap<String, JobValue>>,
    }

    /// A button of the user, and what was answered to its questions.
    ButtonPress {
        /// Its name.
        pub name: String,
        /// By the names of questions; one that is missing has its default.
        pub answers: Option<BTreeMap<String, f64>>,
    }

    /// Pins whose values are asked for.
    PinValues {
        /// Their names.
        #[schemars(length(min = 1, max = VALUES_MAX))]
        pub pins: Vec<String>,
    }

    /// A value for a pin that no net reaches.
    PinSet {
        /// Its name.
        pub pin: String,
        /// A number, 0, 1, false or true.
        pub value: String,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn octets_lead_there_and_back(octets in prop::collection::vec(any::<u8>(), 0..40), text in ".{0,40}") {
            let octets = Hex(octets);
            prop_assert_eq!(Hex::parse(&octets.to_string()), Some(octets));
            let _ = Hex::parse(&text);
        }
    }
}
