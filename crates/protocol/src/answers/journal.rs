//! Entries of the journal and records of programs.

use super::*;

/// An entry of the journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Entry {
    /// Number, from 1 on; it goes on where the last control of this machine ended.
    pub seq: u64,
    /// When, seconds since 1970, UTC.
    pub unix_s: f64,
    /// When, seconds since the first cycle.
    pub time_s: f64,
    /// What kind of thing happened.
    pub kind: EntryKind,
    /// What: its code, as of a message.
    #[serde(default = "crate::message::plain")]
    pub code: String,
    /// Values of the sentence, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub params: BTreeMap<String, Param>,
    /// The sentence, in English.
    pub text: String,
    /// The client whose order it comes from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String")]
    pub by: Option<String>,
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

impl Entry {
    /// Says this; of no time and without a number.
    pub fn new(Message { code, params, text }: Message) -> Entry {
        Entry {
            seq: 0,
            unix_s: 0.0,
            time_s: 0.0,
            kind: EntryKind::Note,
            code,
            params,
            text,
            by: None,
            alarm: None,
            program: None,
            acknowledges: None,
        }
    }

    /// What a program tells the operator (MSG, and texts in Structured Text), if it is that.
    pub fn told_by_program(&self) -> Option<&str> {
        match self.params.get("text") {
            Some(Param::Text(text)) if self.code == "message" => Some(text),
            _ => None,
        }
    }
}

impl Default for Entry {
    /// Says nothing.
    fn default() -> Entry {
        Entry::new(Message::default())
    }
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
    /// How grave it is.
    pub severity: Severity,
    /// What the machine does about it.
    pub reaction: Reaction,
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
    pub state: State,
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
    pub result: Option<Outcome>,
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
