//! Controls without a machine, for tests and figures: the methods that the link uses, over programs that take a while and do nothing.
//!
//! In:  a name, a folder. Out: ways to it; what it has run.
//!
//! A program takes the seconds of its first line, as of `(takes 0.2)`, at once without it; `(wrong)` on a line is refused there, and
//! `(faults)` ends it with an alarm. Journal and runs lie in the folder, so a control that was killed knows them again.

use crate::control::{Control, Refused};
use protocol::params::Hex;
use protocol::{
    Acknowledged, Activity, AlarmRecord, Control as Holder, Described, DescribedAxis, DescribedJoint, Entry, EntryKind,
    Journal, Message, Mode, Outcome, Outlook, Parts, Pin, PinDirection, PinType, Pins, Power, ProgramRecord, State,
    Status, StatusProgram, Tool, Tools, UploadBegun, UploadGrown,
};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Octets of a part of an upload.
const PART: usize = 24 * 1024;

/// A control.
#[derive(Clone)]
pub struct Simulated(Arc<(Mutex<Machine>, Condvar)>);

struct Machine {
    name: String,
    journal: Vec<Entry>,
    journal_file: File,
    runs_file: File,
    is_homed: bool,
    alarm: Option<String>,
    mode: Mode,
    holder: Option<u64>,
    uploads: HashMap<u64, (String, Vec<u8>)>,
    last: u64,
    loaded: Option<(String, Vec<u8>)>,
    running: Option<Running>,
    is_held: bool,
    /// Lines of MDI.
    lines: Vec<String>,
    parts: u64,
    /// Goes on with every change that clients are told of.
    revision: u64,
    /// When a client waited last, and the longest time between two such moments.
    waited: Option<Instant>,
    gap: Duration,
}

struct Running {
    name: String,
    begun: Instant,
    end: Instant,
    faults: bool,
}

fn now() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0.0, |since| since.as_secs_f64())
}

fn refused(why: impl Into<String>) -> Refused {
    Refused::ByControl(why.into())
}

impl Machine {
    fn tell(&mut self, text: &str, more: Entry) {
        let entry = Entry {
            seq: self.journal.len() as u64 + 1,
            unix_s: now(),
            text: text.to_owned(),
            ..more
        };
        // A simulation without its file is none.
        writeln!(self.journal_file, "{}", json!(entry)).expect("the journal can be written");
        self.journal.push(entry);
        self.revision += 1;
    }

    fn end(&mut self, result: Outcome) {
        let Some(running) = self.running.take() else { return };
        let took_s = running.begun.elapsed().as_secs_f64();
        let text = format!("program {} {result}", running.name);
        let program = Some(ProgramRecord {
            name: running.name,
            begun_unix_s: now() - took_s,
            result: Some(result),
            took_s: Some(took_s),
            ..ProgramRecord::default()
        });
        let more = Entry {
            program,
            ..Entry::default()
        };
        self.tell(&text, more);
        self.parts += u64::from(result == Outcome::Completed);
        self.is_held = false;
    }

    fn look(&mut self) {
        let is_over = self
            .running
            .as_ref()
            .is_some_and(|running| !self.is_held && Instant::now() >= running.end);
        match is_over {
            true if self.running.as_ref().is_some_and(|running| running.faults) => {
                self.end(Outcome::Faulted);
                self.raise("it was to fault");
            }
            true => self.end(Outcome::Completed),
            false => {}
        }
    }

    fn raise(&mut self, text: &str) {
        self.alarm = Some(text.to_owned());
        let alarm = Some(AlarmRecord {
            code: "T-1".into(),
            ..AlarmRecord::default()
        });
        let more = Entry {
            kind: EntryKind::Alarm,
            alarm,
            ..Entry::default()
        };
        self.tell(text, more);
    }

    fn status(&self) -> Status {
        let (state, activity) = match (&self.running, self.is_held) {
            (Some(_), true) => (State::Held, Activity::Held),
            (Some(_), false) => (State::Running, Activity::Running),
            (None, _) => (State::Ready, Activity::Idle),
        };
        Status {
            machine: self.name.clone(),
            state,
            power: Power::On,
            activity,
            mode: self.mode,
            homed: if self.is_homed { vec![0] } else { Vec::new() },
            alarm: self.alarm.as_deref().map(Message::from),
            parts: Parts {
                count: self.parts,
                target: None,
            },
            program: self.loaded.as_ref().map(|(name, _)| StatusProgram {
                name: name.clone(),
                ..StatusProgram::default()
            }),
            messages: self.journal.last().cloned().into_iter().collect(),
            control: self.holder.map(|client| Holder {
                client,
                name: "somebody".into(),
                taken: true,
                ..Holder::default()
            }),
            ..Status::default()
        }
    }

    fn ask(&mut self, client: u64, method: &str, params: &Value) -> Result<Value, Refused> {
        self.look();
        let text = |key: &str| params[key].as_str().unwrap_or_default().to_owned();
        match method {
            "machine.describe" => {
                let axis = |axis: &str, end| DescribedAxis {
                    axis: axis.into(),
                    travel: Some([0.0, end]),
                    ..DescribedAxis::default()
                };
                Ok(json!(Described {
                    machine: self.name.clone(),
                    axes: vec![axis("X", 300.0), axis("Y", 200.0)],
                    joints: vec![DescribedJoint::default()],
                    ..Described::default()
                }))
            }
            "tool.list" => {
                let tool = |tool| Tool {
                    tool,
                    ..Tool::default()
                };
                Ok(json!(Tools {
                    tools: vec![tool(1), tool(4)],
                    ..Tools::default()
                }))
            }
            "hal.list" => {
                let pin = |name: &str, channel: Option<&str>| Pin {
                    name: name.into(),
                    kind: PinType::Bit,
                    direction: PinDirection::Out,
                    value: json!(false),
                    net: None,
                    source: None,
                    alias_of: channel.map(str::to_owned),
                    unit: None,
                };
                let all = [pin("motion.enable", None), pin("door", Some("io.20.in-00"))];
                Ok(json!(Pins {
                    pins: all.into(),
                    more: false,
                }))
            }
            "journal.since" => {
                let since = params["seq"].as_u64().unwrap_or(0) as usize;
                let behind = self.journal.get(since..).unwrap_or_default();
                Ok(json!(Journal {
                    entries: behind.iter().take(500).cloned().collect(),
                    more: behind.len() > 500,
                    last: self.journal.len() as u64,
                    on_disk: u64::MAX,
                }))
            }
            "control.take" => match self.holder {
                Some(holder) if holder != client => Err(refused("somebody has had control for 1 s")),
                _ => {
                    self.holder = Some(client);
                    Ok(Value::Null)
                }
            },
            "control.release" => {
                self.holder.take_if(|holder| *holder == client);
                Ok(json!({}))
            }
            "program.upload.begin" => {
                self.last += 1;
                self.uploads.insert(self.last, (text("name"), Vec::new()));
                Ok(json!(UploadBegun {
                    upload: self.last,
                    part_octets: PART,
                }))
            }
            "program.upload.append" => {
                let value = Hex::parse(&text("value")).ok_or_else(|| refused("no digits"))?;
                let (_, content) = (self.uploads.get_mut(&params["upload"].as_u64().unwrap_or(0)))
                    .ok_or_else(|| refused("no upload"))?;
                content.extend(value.0);
                Ok(json!(UploadGrown {
                    received: content.len() as u64,
                }))
            }
            "program.upload.commit" => {
                let (_, content) =
                    (self.uploads.get(&params["upload"].as_u64().unwrap_or(0))).ok_or_else(|| refused("no upload"))?;
                match crate::message::sum(content) == text("sha256") {
                    true => Ok(json!({})),
                    false => Err(refused("another sum")),
                }
            }
            "program.check" => self.take_program(params, false),
            "program.load" => self.take_program(params, true),
            "program.start" => self.start(params),
            "mdi" if self.running.is_none() => {
                let line = text("line");
                let more = Entry {
                    by: Some("supervisor".into()),
                    ..Entry::default()
                };
                self.tell(&format!("MDI: {line}"), more);
                self.lines.push(line);
                self.mode = Mode::Mdi;
                self.revision += 1;
                Ok(json!({}))
            }
            "hold" if self.running.is_some() => {
                self.is_held = true;
                self.revision += 1;
                Ok(json!({}))
            }
            "stop" => {
                self.end(Outcome::Stopped);
                self.revision += 1;
                Ok(json!({}))
            }
            _ => Err(refused(format!("{method} is refused"))),
        }
    }

    /// An upload as a program, which is checked, and loaded or not.
    fn take_program(&mut self, params: &Value, is_loaded: bool) -> Result<Value, Refused> {
        let number = params["upload"].as_u64().unwrap_or(0);
        let (name, content) = self.uploads.remove(&number).ok_or_else(|| refused("no upload"))?;
        let lines = String::from_utf8_lossy(&content)
            .lines()
            .position(|line| line.contains("(wrong)"));
        if let Some(line) = lines {
            return Err(refused(format!("{name}:{}: this is wrong", line + 1)));
        }
        if is_loaded {
            self.loaded = Some((name.clone(), content));
            self.revision += 1;
        }
        Ok(json!(Outlook {
            program: name,
            lines: 1,
            planned_time_s: 1.0,
            ..Outlook::default()
        }))
    }

    /// Starts the program that is loaded.
    fn start(&mut self, params: &Value) -> Result<Value, Refused> {
        if self.running.is_some() || self.alarm.is_some() || !self.is_homed {
            return Err(refused("the machine is not ready"));
        }
        let (name, content) = self.loaded.clone().ok_or_else(|| refused("no program is loaded"))?;
        let text = String::from_utf8_lossy(&content);
        let takes = text
            .strip_prefix("(takes ")
            .and_then(|rest| rest.split_once(')')?.0.parse().ok());
        let takes = Duration::from_secs_f64(takes.unwrap_or(0.0));
        writeln!(self.runs_file, "{}", params["request_id"].as_str().unwrap_or("-")).expect("runs can be written");
        let begun = Instant::now();
        self.running = Some(Running {
            faults: text.contains("(faults)"),
            name: name.clone(),
            begun,
            end: begun + takes,
        });
        self.mode = Mode::Auto;
        let program = Some(ProgramRecord {
            name: name.clone(),
            begun_unix_s: now(),
            ..ProgramRecord::default()
        });
        let more = Entry {
            program,
            ..Entry::default()
        };
        self.tell(&format!("program {name} begins"), more);
        Ok(json!(Outlook {
            program: name,
            ..Outlook::default()
        }))
    }
}

impl Simulated {
    /// Lines of MDI that it was given.
    pub fn lines(&self) -> Vec<String> {
        self.machine().lines.clone()
    }

    /// A line of MDI of somebody at the machine.
    pub fn type_line(&self, line: &str) {
        let mut machine = self.machine();
        machine.tell(&format!("MDI: {line}"), Entry::default());
        machine.mode = Mode::Mdi;
        machine.revision += 1;
        drop(machine);
        self.0.1.notify_all();
    }

    /// A control of this folder, homed and with drives on, as after an earlier one there.
    ///
    /// # Errors
    /// Of the folder.
    pub fn new(name: &str, folder: &Path) -> io::Result<Simulated> {
        let open = |name: &str| {
            OpenOptions::new()
                .read(true)
                .append(true)
                .create(true)
                .open(folder.join(name))
        };
        let journal_file = open("sim-journal.jsonl")?;
        let lines = BufReader::new(File::open(folder.join("sim-journal.jsonl"))?).lines();
        let journal = lines.map_while(|line| serde_json::from_str(&line.ok()?).ok()).collect();
        let mut machine = Machine {
            name: name.to_owned(),
            journal,
            journal_file,
            runs_file: open("sim-runs")?,
            is_homed: true,
            alarm: None,
            mode: Mode::Manual,
            holder: None,
            uploads: HashMap::new(),
            last: 0,
            loaded: None,
            running: None,
            is_held: false,
            lines: Vec::new(),
            parts: 0,
            revision: 0,
            waited: None,
            gap: Duration::ZERO,
        };
        machine.tell("the control begins", Entry::default());
        Ok(Simulated(Arc::new((Mutex::new(machine), Condvar::new()))))
    }

    fn machine(&self) -> MutexGuard<'_, Machine> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Another client of it.
    pub fn connect(&self) -> Box<dyn Control> {
        let mut machine = self.machine();
        machine.last += 1;
        Box::new(Guest {
            of: self.clone(),
            client: machine.last,
            status: Status::default(),
            seen: None,
        })
    }

    /// An alarm; gives its number.
    pub fn alarm(&self, text: &str) -> u64 {
        let mut machine = self.machine();
        machine.raise(text);
        let last = machine.journal.len() as u64;
        drop(machine);
        self.0.1.notify_all();
        last
    }

    /// Somebody at the machine has acknowledged all alarms.
    pub fn acknowledge(&self) {
        let mut machine = self.machine();
        machine.alarm = None;
        let alarms = machine
            .journal
            .iter()
            .filter(|entry| entry.kind == EntryKind::Alarm)
            .map(|entry| entry.seq);
        let how = Acknowledged {
            unix_s: now(),
            by: "somebody".into(),
        };
        let more = Entry {
            acknowledges: Some((alarms.collect(), how)),
            ..Entry::default()
        };
        machine.tell("acknowledged", more);
        drop(machine);
        self.0.1.notify_all();
    }

    /// The longest time that its link has spent on anything but waiting for it, since the last call.
    pub fn longest_gap(&self) -> Duration {
        std::mem::take(&mut self.machine().gap)
    }

    /// A number of notes.
    pub fn notes(&self, count: usize) {
        let mut machine = self.machine();
        for number in 0..count {
            machine.tell(&format!("note {number}"), Entry::default());
        }
        drop(machine);
        self.0.1.notify_all();
    }
}

/// Ids of orders that a control of this folder has carried out, in their order.
///
/// # Errors
/// Of the folder.
pub fn runs(folder: &Path) -> io::Result<Vec<String>> {
    let text = std::fs::read_to_string(folder.join("sim-runs"))?;
    Ok(text.lines().map(str::to_owned).collect())
}

struct Guest {
    of: Simulated,
    client: u64,
    status: Status,
    seen: Option<u64>,
}

impl Control for Guest {
    fn call(&mut self, method: &str, params: Value) -> Result<Value, Refused> {
        let answer = self.of.machine().ask(self.client, method, &params);
        self.of.0.1.notify_all();
        answer
    }

    fn wait(&mut self, longest: Duration) -> Result<&Status, Refused> {
        let until = Instant::now() + longest;
        let mut machine = self.of.machine();
        let gap = machine.waited.map_or(Duration::ZERO, |waited| waited.elapsed());
        machine.gap = machine.gap.max(gap);
        loop {
            machine.look();
            let left = until.saturating_duration_since(Instant::now());
            if self.seen != Some(machine.revision) || left.is_zero() {
                break;
            }
            let end = machine
                .running
                .as_ref()
                .map(|running| running.end.saturating_duration_since(Instant::now()));
            // What is held ends only by an order.
            let nap = left
                .min(end.filter(|_| !machine.is_held).unwrap_or(left))
                .max(Duration::from_millis(1));
            machine = self
                .of
                .0
                .1
                .wait_timeout(machine, nap)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
        self.seen = Some(machine.revision);
        machine.waited = Some(Instant::now());
        self.status = machine.status();
        drop(machine);
        Ok(&self.status)
    }
}
