//! The check of a program or of a line of MDI, before it is accepted.

use api::orders::Source;
use api::rpc::{RpcError, code};
use api::uploads::Uploaded;
use config::Config;
use gcode::Modes;
use host::capabilities;
use host::capabilities::Work;
use machine::tables::{Tables, lock};
use motion::cancel::Cancel;
use motion::canon::Position;
use program::text::{Reader, Text};
use program::{Begin, Doubt, Overview, approach, check, doubts, preview};
use protocol::message;
use std::io::ErrorKind;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Number of the next text.
static REVISIONS: AtomicU64 = AtomicU64::new(1);

/// A program that was accepted, or a line that was typed.
#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) name: String,
    /// Another one for each text.
    pub(super) revision: u64,
    /// The line that was typed, for the journal; of a program nothing.
    pub(super) line: String,
    pub(crate) text: Arc<Text>,
    pub(crate) begin: Begin,
    pub(crate) overview: Overview,
    /// What is doubtful in a program that was just read.
    pub(super) doubts: Vec<Doubt>,
    /// What it was checked with.
    tables: Tables,
    /// How often spindle and coolant had been switched off when it was checked.
    pub(super) switched_off: u64,
}

impl Part {
    pub(crate) fn is_mdi(&self) -> bool {
        matches!(self.begin, Begin::Mdi { .. })
    }

    /// The feed of a dry run, mm/min.
    pub(crate) fn dry_feed_min(&self) -> Option<f64> {
        match self.begin {
            Begin::Dry { feed_s, .. } => Some(feed_s * 60.0),
            Begin::Program { .. } | Begin::Mdi { .. } | Begin::FromLine { .. } => None,
        }
    }
}

/// What is to be checked.
pub(super) enum Subject {
    Program(Source),
    Mdi {
        line: String,
        modes: Option<Arc<Modes>>,
    },
    /// Lines that come one after the other, of which nobody knows the end.
    Lines {
        text: Arc<Text>,
        modes: Option<Arc<Modes>>,
    },
    /// The program that is loaded: tables may have changed since. `dry_feed_s`: to be run dry, mm/s.
    Loaded {
        part: Arc<Part>,
        dry_feed_s: Option<f64>,
    },
    /// The same before a line; `yes`: the operator has agreed to what that means.
    FromLine {
        part: Arc<Part>,
        line: u32,
        yes: bool,
        dry_feed_s: Option<f64>,
    },
}

/// The part, or why it cannot run.
pub(super) type Checked = Result<Arc<Part>, RpcError>;

/// Reads and checks what is to run from `at`, in a thread of its own: that may take seconds.
pub(super) fn examine(
    config: &Config,
    tables: &Mutex<Tables>,
    at: Position,
    subject: Subject,
    switched_off: u64,
    given_up: &Cancel,
) -> Checked {
    capabilities::give_up_or_warn(Work::Ordinary);
    // Whoever edited a table while nothing ran wants it to count.
    let tables = {
        let mut tables = lock(tables);
        tables.refresh(config).map_err(|error| error.to_string())?;
        tables.clone()
    };
    let mut typed = String::new();
    let revision = match &subject {
        Subject::Loaded { part, .. } | Subject::FromLine { part, .. } => part.revision,
        Subject::Program(_) | Subject::Mdi { .. } | Subject::Lines { .. } => REVISIONS.fetch_add(1, Ordering::Relaxed),
    };
    let can_be_checked = !matches!(subject, Subject::Lines { .. });
    let is_new = matches!(subject, Subject::Program(_));
    let (name, text, begin) = match subject {
        Subject::Loaded { part, dry_feed_s: None } if part.tables == tables => return Ok(part),
        Subject::Loaded { part, dry_feed_s } => {
            let begin = dry(Begin::Program { at }, dry_feed_s);
            (part.name.clone(), Arc::clone(&part.text), begin)
        }
        Subject::Program(source) => {
            let (name, text) = read(source)?;
            (name, text, Begin::Program { at })
        }
        Subject::Mdi { line, modes } => {
            typed = line.trim().to_owned();
            (
                "MDI".to_owned(),
                Arc::new(line.into_bytes().into()),
                Begin::Mdi { at, modes },
            )
        }
        Subject::Lines { text, modes } => {
            typed = "lines, one after the other".to_owned();
            ("MDI".to_owned(), text, Begin::Mdi { at, modes })
        }
        Subject::FromLine {
            part,
            line,
            yes,
            dry_feed_s,
        } => {
            if !yes {
                let text = Reader::from(&*part.text);
                let told = preview(config, &tables, &part.name, text, (at, line), given_up)?.join("\n");
                return Err(message!(
                    "refused.start_at_line",
                    "{means}\nif that is right: isocnc program start --from-line {line} --yes",
                    means = told,
                    line = line
                )
                .into());
            }
            let approach = approach(config);
            let begin = dry(Begin::FromLine { at, line, approach }, dry_feed_s);
            (part.name.clone(), Arc::clone(&part.text), begin)
        }
    };
    let overview = match can_be_checked {
        true => check(config, &tables, &name, &*text, &begin, given_up).map_err(|errors| errors.to_string())?,
        false => Overview::default(),
    };
    let doubts = match is_new {
        true => doubts(config, &tables, (&name, Reader::from(&*text)), at, given_up),
        false => Vec::new(),
    };
    Ok(Arc::new(Part {
        name,
        revision,
        line: typed,
        text,
        begin,
        overview,
        doubts,
        tables,
        switched_off,
    }))
}

/// The same run dry, with a feed if there is one.
fn dry(begin: Begin, feed_s: Option<f64>) -> Begin {
    match feed_s {
        None => begin,
        Some(feed_s) => Begin::Dry {
            begin: Box::new(begin),
            feed_s,
        },
    }
}

fn read(source: Source) -> Result<(String, Arc<Text>), RpcError> {
    match source {
        Source::Text { name, text } => Ok((name, Arc::new(text.into_bytes().into()))),
        Source::Uploaded(Uploaded { name, text }) => Ok((name, text)),
        Source::File(path) => {
            let name = path.display().to_string();
            let text = Text::read(&path).map_err(|cause| {
                let code = match cause.kind() {
                    ErrorKind::NotFound | ErrorKind::PermissionDenied => code::UNREADABLE,
                    _ => code::REFUSED,
                };
                RpcError::new(code, format!("{name}: {cause}"))
            })?;
            Ok((name, Arc::new(text)))
        }
    }
}
