//! What a control and a supervisor say to each other: keys, envelope, bodies. `docs/cell.md` has the same for readers.
//!
//! In:  octets of the other side. Out: a body, or in words why it is none.
//!
//! Every message is a JSON object, the [`Envelope`]; the content of a program travels beside it as it is.

use protocol::{Activity, Mode, Power};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::fmt;

pub use protocol::Remote;

/// Version of the messages.
pub const VERSION: u32 = 1;
/// Longest message, octets; that of a program comes beside it.
pub const MESSAGE_MAX: usize = 4 << 20;
/// Longest program, octets.
pub const PROGRAM_MAX: usize = 64 << 20;
/// Longest name of a machine, octets.
pub const MACHINE_MAX: usize = 32;
/// Longest name of a program, octets.
pub const NAME_MAX: usize = 64;
/// Longest id of an order, octets.
pub const ID_MAX: usize = 64;
/// Entries of a journal in one answer.
pub const ENTRIES_MAX: usize = 500;

/// What a key of a machine stands for: `cell/MACHINE/TOPIC`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Topic {
    /// Liveliness token: there while the link of the control is.
    Alive,
    /// Put at a change, and once a second: [`State`].
    State,
    /// Put with new entries: [`Journal`]. Asked with [`Since`]: the entries behind a number.
    Journal,
    /// Asked: what does not change, as `machine.describe` of the control, with its tools.
    Describe,
    /// Asked with [`Upload`] and the content: stores a program and checks it. Nothing runs by that.
    Program,
    /// Asked with [`Order`]: hold, stop, how an order is. Answered at once.
    Order,
    /// Asked with [`Order`]: runs a program, or a line of MDI.
    Run,
    /// Asked by the control, with nothing: the supervisor answers with nothing.
    Heard,
}

impl Topic {
    /// All of them.
    pub const ALL: [Topic; 8] = [
        Topic::Alive,
        Topic::State,
        Topic::Journal,
        Topic::Describe,
        Topic::Program,
        Topic::Order,
        Topic::Run,
        Topic::Heard,
    ];

    /// As it is written.
    pub const fn word(self) -> &'static str {
        match self {
            Topic::Alive => "alive",
            Topic::State => "state",
            Topic::Journal => "journal",
            Topic::Describe => "describe",
            Topic::Program => "program",
            Topic::Order => "order",
            Topic::Run => "run",
            Topic::Heard => "heard",
        }
    }

    /// Its key for a machine; `*`: for all of them.
    pub fn key(self, machine: &str) -> String {
        format!("cell/{machine}/{}", self.word())
    }
}

/// The machine and the topic of a key; `None`: it is no key of a cell.
pub fn parse_key(key: &str) -> Option<(&str, Topic)> {
    let (machine, word) = key.strip_prefix("cell/")?.split_once('/')?;
    let topic = Topic::ALL.into_iter().find(|topic| topic.word() == word)?;
    is_machine(machine).then_some((machine, topic))
}

/// Whether this can name a machine: small letters, digits and `-`, 1 to 32 of them, no `-` at its ends.
pub fn is_machine(name: &str) -> bool {
    let letter = |octet: u8| octet.is_ascii_lowercase() || octet.is_ascii_digit() || octet == b'-';
    (1..=MACHINE_MAX).contains(&name.len())
        && name.bytes().all(letter)
        && !name.starts_with('-')
        && !name.ends_with('-')
}

/// Whether this can name a program: letters, digits, `.`, `_` and `-`, 1 to 64 of them, no dot at the beginning.
pub fn is_program(name: &str) -> bool {
    let letter = |octet: u8| octet.is_ascii_alphanumeric() || b"._-".contains(&octet);
    (1..=NAME_MAX).contains(&name.len()) && name.bytes().all(letter) && !name.starts_with('.')
}

/// Whether this can be the id of an order.
pub fn is_id(id: &str) -> bool {
    (1..=ID_MAX).contains(&id.len()) && id.bytes().all(|octet| octet.is_ascii_alphanumeric() || octet == b'-')
}

/// SHA-256 as small hexadecimal digits.
pub fn sum(octets: &[u8]) -> String {
    Sha256::digest(octets)
        .iter()
        .map(|octet| format!("{octet:02x}"))
        .collect()
}

/// Why a message is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("not a message of a cell: {0}")]
pub struct BadMessage(String);

/// What every message is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Envelope<B> {
    /// [`VERSION`] of whoever says it.
    pub v: u32,
    /// Number of the message among those of its sender since it began.
    pub seq: u64,
    /// When it was said, seconds since 1970, UTC.
    pub t: f64,
    /// What is said.
    pub body: B,
}

impl<B: Serialize> Envelope<B> {
    /// A message of this moment.
    pub fn new(seq: u64, body: B) -> Envelope<B> {
        let t = std::time::SystemTime::now()
            .duration_since(std::time::UNIX_EPOCH)
            .map_or(0.0, |since| since.as_secs_f64());
        Envelope {
            v: VERSION,
            seq,
            t,
            body,
        }
    }

    /// As it travels.
    pub fn to_octets(&self) -> Vec<u8> {
        // Bodies are plain data: strings, numbers, lists.
        serde_json::to_vec(self).unwrap_or_default()
    }
}

impl<B: DeserializeOwned> Envelope<B> {
    /// Reads a message.
    ///
    /// # Errors
    /// It is too long, no JSON, another version's, or lacks something; with the place.
    pub fn from_octets(octets: &[u8]) -> Result<Envelope<B>, BadMessage> {
        #[derive(Deserialize)]
        struct Versioned {
            v: u32,
        }
        let bad = |error: serde_json::Error| BadMessage(error.to_string());
        if octets.len() > MESSAGE_MAX {
            return Err(BadMessage(format!(
                "{} octets, and {MESSAGE_MAX} are the most",
                octets.len()
            )));
        }
        let Versioned { v } = serde_json::from_slice(octets).map_err(bad)?;
        if v != VERSION {
            return Err(BadMessage(format!(
                "version {v}, and this side speaks {VERSION}: control and supervisor must be of the same isocnc"
            )));
        }
        serde_json::from_slice(octets).map_err(bad)
    }
}

/// How a machine is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Number of the run of this control: another one after each start.
    pub boot: u64,
    /// As `status` of the control has it: `state`, `power`, `activity`, `mode`.
    pub state: protocol::State,
    /// As `power` of `status`.
    pub power: Power,
    /// As `activity` of `status`.
    pub activity: Activity,
    /// As `mode` of `status`.
    pub mode: Mode,
    /// Whether a run would be accepted now; why not, in words.
    pub is_ready: bool,
    /// In words, where it would not.
    pub why_not: Option<String>,
    /// What the supervisor may do here.
    pub remote: Remote,
    /// Name of the program.
    pub program: Option<String>,
    /// How much of the program lies behind the machine, percent.
    pub done_percent: Option<f64>,
    /// What is left of it, s.
    pub remaining_s: Option<f64>,
    /// Why the machine stopped by itself.
    pub alarm: Option<String>,
    /// Parts made, as the control counts them.
    pub parts: u64,
    /// Number of the last entry of the journal.
    pub journal: u64,
    /// The last order of the supervisor that was begun.
    pub order: Option<OrderState>,
}

impl State {
    /// How the time counts that is spent so.
    pub fn use_of_time(&self) -> Use {
        match (self.alarm.is_some(), self.state) {
            (true, _) => Use::Alarm,
            (false, protocol::State::Running) => Use::Running,
            (false, protocol::State::Held) => Use::Held,
            _ => Use::Idle,
        }
    }
}

/// What a machine's time is spent on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Use {
    /// A program runs.
    Running,
    /// A program is held or waits for somebody.
    Held,
    /// Nothing is under way.
    Idle,
    /// An alarm stands.
    Alarm,
    /// Nobody knows: no link.
    Unknown,
}

impl Use {
    /// All of them, and the columns of the supervisor's table.
    pub const ALL: [Use; 5] = [Use::Running, Use::Held, Use::Idle, Use::Alarm, Use::Unknown];

    /// As it is written.
    pub const fn word(self) -> &'static str {
        match self {
            Use::Running => "running",
            Use::Held => "held",
            Use::Idle => "idle",
            Use::Alarm => "alarm",
            Use::Unknown => "unknown",
        }
    }
}

/// New entries of a journal, or those behind a number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Journal {
    /// The number that was asked for; of new entries: that of the one before them.
    pub since: u64,
    /// As the control has them, the oldest first.
    pub entries: Vec<Value>,
    /// There are others behind these.
    pub more: bool,
    /// Number of the last entry that there is. Below `since`: the journal has begun anew.
    pub last: u64,
}

/// A question for entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Since {
    /// The last number that the asker has.
    pub since: u64,
}

/// A program that is sent; its content comes beside it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Upload {
    /// Name of the program.
    pub name: String,
    /// Octets.
    pub size: u64,
    /// As [`sum`] writes it.
    pub sha256: String,
}

impl Upload {
    /// Of this program.
    pub fn of(name: &str, content: &[u8]) -> Upload {
        Upload {
            name: name.to_owned(),
            size: content.len() as u64,
            sha256: sum(content),
        }
    }

    /// Whether this content is the one announced.
    ///
    /// # Errors
    /// It is not, or cannot be taken; in words.
    pub fn verify(&self, content: &[u8]) -> Result<(), String> {
        if !is_program(&self.name) {
            return Err(format!(
                "{:?} cannot name a program: letters, digits, '.', '_' and '-', up to {NAME_MAX}",
                self.name
            ));
        }
        if content.len() > PROGRAM_MAX {
            return Err(format!("{} octets, and {PROGRAM_MAX} are the most", content.len()));
        }
        if content.len() as u64 != self.size {
            return Err(format!(
                "{} octets have come, and {} were announced",
                content.len(),
                self.size
            ));
        }
        match sum(content) == self.sha256 {
            true => Ok(()),
            false => Err("its SHA-256 is another one than announced".into()),
        }
    }
}

/// An order of the supervisor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Order {
    /// The same order that comes again is answered, not carried out again.
    pub id: String,
    /// What is to be done.
    pub what: What,
    /// The run of the control that is meant, as its [`State`] tells it: another one with the same certificate keeps silent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boot: Option<u64>,
}

/// What is ordered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    /// Runs a stored program, if it still has this sum.
    Run {
        /// Name of the program.
        program: String,
        /// SHA-256 of its content, as [`sum`] writes it.
        sha256: String,
    },
    /// Runs a line of MDI.
    Mdi {
        /// The line.
        line: String,
    },
    /// How the order of this id is; changes nothing.
    Status,
    /// Holds what runs.
    Hold,
    /// Gives up what runs.
    Stop,
}

/// What became of an order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrderState {
    /// Of the order.
    pub id: String,
    /// How far it is.
    pub phase: Phase,
    /// Why it was refused, or how the program ended; in words.
    pub note: String,
    /// From begin to end, s.
    pub took_s: Option<f64>,
}

/// How far an order is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// It has never come, or was refused before it began: nothing was done.
    Unknown,
    /// It was refused before it began.
    Refused,
    /// A program runs.
    Running,
    /// The program came to its end.
    Completed,
    /// The program ended otherwise: stopped, faulted.
    Failed,
    /// The control ended while it ran: nobody knows what became of the part.
    Interrupted,
}

impl Phase {
    /// Nothing more comes of it.
    pub fn is_over(self) -> bool {
        !matches!(self, Phase::Running | Phase::Unknown)
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Phase::Unknown => "unknown",
            Phase::Refused => "refused",
            Phase::Running => "running",
            Phase::Completed => "completed",
            Phase::Failed => "failed",
            Phase::Interrupted => "interrupted",
        })
    }
}

/// What an upload came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stored {
    /// SHA-256 of its content, as [`sum`] writes it.
    pub sha256: String,
    /// What the check of the control says: its time, its warning; or with its place what is wrong, and then nothing is stored.
    pub outlook: Result<Value, String>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn keys_are_read_as_they_are_made() {
        for topic in Topic::ALL {
            assert_eq!(parse_key(&topic.key("mill-1")), Some(("mill-1", topic)));
        }
        for key in [
            "cell/mill",
            "cell//state",
            "cell/Mill/state",
            "cell/-a/state",
            "cell/a/b/state",
            "x/a/state",
        ] {
            assert_eq!(parse_key(key), None, "{key}");
        }
        assert!(!is_machine(&"m".repeat(MACHINE_MAX + 1)));
        for name in ["", ".x", "a/b", "..", "a b", "a\0", &"n".repeat(NAME_MAX + 1)] {
            assert!(!is_program(name), "{name:?}");
        }
        assert!(is_program("Part_1.ngc"));
    }

    #[test]
    fn a_message_comes_out_as_it_went_in_and_another_version_is_told() {
        let order = Order {
            id: "a-1".into(),
            what: What::Run {
                program: "p.ngc".into(),
                sha256: sum(b""),
            },
            boot: Some(3),
        };
        let mut sent = Envelope::new(7, order);
        sent.t = 1.5;
        assert_eq!(Envelope::from_octets(&sent.to_octets()), Ok(sent.clone()));
        let mut other = sent;
        other.v = 2;
        let error = Envelope::<Order>::from_octets(&other.to_octets()).unwrap_err();
        assert!(error.to_string().contains("version 2"), "{error}");
        let error = Envelope::<Order>::from_octets(b"{\"v\":1,\"seq\":1}").unwrap_err();
        assert!(error.to_string().contains("line 1 column"), "{error}");
        assert!(Envelope::<Order>::from_octets(&vec![b' '; MESSAGE_MAX + 1]).is_err());
    }

    #[test]
    fn content_that_is_another_one_is_told() {
        let upload = Upload::of("p.ngc", b"G0 X1\n");
        assert_eq!(upload.verify(b"G0 X1\n"), Ok(()));
        assert!(upload.verify(b"G0 X1").unwrap_err().contains("5 octets"));
        assert!(upload.verify(b"G0 X2\n").unwrap_err().contains("SHA-256"));
        assert!(Upload::of("../p", b"").verify(b"").unwrap_err().contains("cannot name"));
    }

    proptest! {
        #[test]
        fn no_octets_panic(octets in proptest::collection::vec(any::<u8>(), 0..200), text in "[\\[\\]{}\":,a-z0-9.e+-]{0,80}") {
            for octets in [&octets[..], text.as_bytes()] {
                let _ = Envelope::<State>::from_octets(octets);
                let _ = Envelope::<Journal>::from_octets(octets);
                let _ = Envelope::<Order>::from_octets(octets);
                let _ = Envelope::<Upload>::from_octets(octets);
            }
            let _ = parse_key(&text);
        }
    }
}
