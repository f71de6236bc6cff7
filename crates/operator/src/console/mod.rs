//! The operator's side of the cycle thread: orders in, notices out, records kept.
//!
//! In:  [`RtStatus`] values, notices and trace records of the cycle thread; wishes to stop.
//! Out: orders, a journal, alarms, and the records that the report is made of.
//!
//! Polled every few milliseconds by an ordinary thread, or by a test on virtual time.

pub mod actions;
mod log;
mod names;
mod notices;

pub use log::Log;
pub(crate) use notices::changed;

use super::recorder::Recorder;
use bus::{BusEvent, BusState};
use config::{Config, Identity};
use log::More;
use machine::faults::{Fault, PROGRAM_CODE, Reaction, UNWATCHED_CODE};
use machine::journal::{AlarmRecord, Entry, Kind, ProgramRecord};
use machine::modules::Modules;
use machine::sequence::{Job, Outcome, Sequence, Step};
use machine::state::State;
use motion::canon::{Axis, Position};
use motion::element::Action;
use motion::rt::Interpolator;
use motion::rt::jog::{Obstacle, Obstruction};
use names::Names;
use protocol::{Message, message};
use rt::overrides::Overridden;
use rt::shared::{AtOnce, Command, Notice, OperatorEndpoints, RtStatus, Snapshot, TimedNotice};
use rt::timeout;
use serde::{Deserialize, Serialize};
use std::mem::{Discriminant, discriminant};
use std::sync::{Arc, mpsc};
use tracing::Level;

/// What to do where nobody knows which tool is in the spindle.
pub fn look_at_tool() -> Message {
    message!(
        "tool.look",
        "look which tool is in the spindle, and which are in the pockets; isocnc mdi \"M61 Q5\" says that it is tool 5"
    )
}

/// Something that is wrong and stops nothing, as an entry of the journal.
fn warning(cause: impl Into<Message>) -> Message {
    message!("warning", "warning: {cause}", cause = cause.into())
}

/// What an order of a client gives the cycle at the most, and some for the sequence beside it.
const ORDER_COMMANDS_MAX: usize = 8;

/// Stalls of the cycle thread are told of no more often, ns.
const STALLS_TOLD_NS: u64 = 1_000_000_000;
/// The alarm of a control whose time-out thread hung.
pub fn unwatched() -> Message {
    message!(
        "control.unwatched",
        "the time-out thread hung: nothing watches the cycle any more; this control comes to rest, ends and is to be restarted"
    )
}

/// How grave an entry of the journal is.
pub fn level(entry: &Entry) -> Level {
    match entry.kind {
        Kind::Alarm => Level::ERROR,
        Kind::Warning => Level::WARN,
        Kind::Note => Level::INFO,
    }
}

/// What counts as the same warning: the fault, and the input or external component that it is about.
type WarningKind = (Discriminant<Fault>, Option<(usize, (u16, u8))>, Option<usize>);

/// What is wrong without stopping the machine. Told when it comes first, and again the 10th, 100th time and so on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Warning {
    /// Seconds from the first cycle to the first time.
    pub time_s: f64,
    pub times: u64,
    /// What, as it was the last time.
    #[serde(with = "protocol::message::as_text")]
    pub cause: Message,
    #[serde(skip)]
    kind: Option<WarningKind>,
}

/// Why the machine stopped by itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alarm {
    /// Seconds since the first cycle.
    pub time_s: f64,
    /// First cause, with the name of the node or joint.
    #[serde(with = "protocol::message::as_text")]
    pub cause: Message,
}

/// A program, as it began.
#[derive(Clone, Debug)]
struct ProgramBegun {
    name: String,
    unix_s: f64,
    /// Alarms there were, and warnings.
    alarms: usize,
    warnings: Vec<Warning>,
}

/// Alarms, the first cause first.
#[derive(Default)]
struct Alarms {
    list: Vec<Alarm>,
    /// How many of them somebody has acknowledged, or begun another program after.
    over: usize,
    /// Number of the entry of the first cause, and those of all that waits to be acknowledged.
    first_cause: u64,
    unacknowledged: Vec<u64>,
}

impl Alarms {
    /// First cause since the last acknowledge.
    fn first(&self) -> Option<&Alarm> {
        self.list.get(self.over)
    }
}

/// What the cycle thread lost.
#[derive(Default)]
struct Lateness {
    /// Cycles that began late enough to be noticed, or were skipped.
    cycles: u64,
    /// Stalls since the last one that was told of, and when that was.
    stalls: u64,
    told_ns: u64,
}

impl Lateness {
    /// One more stall; how many there were by now where it is time to tell of them.
    fn add_stall(&mut self, at_ns: u64) -> Option<u64> {
        self.stalls += 1;
        if at_ns - self.told_ns < STALLS_TOLD_NS {
            return None;
        }
        self.told_ns = at_ns;
        Some(std::mem::take(&mut self.stalls))
    }
}

/// What notices have said and nobody has looked at yet.
#[derive(Default)]
struct Signals {
    program_ended: bool,
    /// Somebody has pressed the stop pin.
    stop_pressed: bool,
    /// The last order could not begin.
    not_begun: bool,
}

/// Changes of tools.
#[derive(Default)]
struct ToolChanges {
    /// The tool whose change has begun and is not done.
    under_way: Option<u32>,
    /// Those that were done since somebody asked.
    done: Vec<u32>,
}

/// The operator's side of the cycle thread.
pub struct Operator {
    endpoints: OperatorEndpoints,
    sequence: Sequence,
    /// Sets of joints in the order in which they are homed.
    homing: Vec<u64>,
    orders_given: u64,
    /// Whether trace records are kept.
    records: bool,
    programs: u64,
    signals: Signals,
    cycle_s: f64,
    names: Names,
    modules: Modules,
    operational_s: Option<f64>,
    log: Log,
    alarms: Alarms,
    warnings: Vec<Warning>,
    /// The program under way, but no line of MDI.
    program: Option<ProgramBegun>,
    /// State of the machine as the notices tell it.
    state: State,
    lateness: Lateness,
    /// The control cannot go on and has to be restarted.
    needs_restart: bool,
    /// Overrides at the last look, and those of the journal, percent.
    overrides: [[f64; 2]; 3],
    /// The client that has turned them since.
    turned_by: Option<String>,
    /// Axes of the machine, where it has rested last, and who jogs it away from there.
    axes: Vec<Axis>,
    rested_at: Position,
    jogged_by: Option<String>,
    /// What ended the last jog.
    obstruction: Option<Message>,
    tool_changes: ToolChanges,
    /// Texts of the messages of the program (MSG, DEBUG) in their order, and how many have been shown.
    messages: Option<(mpsc::Receiver<Option<String>>, u32)>,
    /// What the report is made of.
    pub recorder: Recorder,
}

impl Operator {
    /// An operator who runs one program from power-on to power-off.
    pub fn new(config: &Config, endpoints: OperatorEndpoints, now_ns: u64) -> Operator {
        // Its drive is switched off once it stands.
        let run_down_s = config.spindle.axis.map_or(0.0, |_| config.spindle.speed_timeout_s);
        let run_down_ns = (run_down_s * 1e9) as u64;
        Operator {
            endpoints,
            sequence: Sequence::new(now_ns, &config.homing_order()).with_run_down(run_down_ns),
            homing: config.homing_order(),
            records: true,
            orders_given: 0,
            signals: Signals::default(),
            cycle_s: f64::from(config.cycle_us) * 1e-6,
            modules: Modules::new(config),
            names: Names::new(config),
            operational_s: None,
            log: Log::default(),
            alarms: Alarms::default(),
            warnings: Vec::new(),
            program: None,
            state: State::Booting,
            lateness: Lateness::default(),
            needs_restart: false,
            overrides: [[100.0; 2]; 3],
            turned_by: None,
            axes: config.axes.iter().map(|map| map.axis).collect(),
            rested_at: Position::ZERO,
            jogged_by: None,
            obstruction: None,
            tool_changes: ToolChanges::default(),
            messages: None,
            recorder: Recorder::default(),
            programs: 0,
        }
    }

    /// The same with the program begun again whenever it has ended, until there is a wish to stop; in constant memory, so
    /// without records.
    pub fn repeating(self) -> Operator {
        Operator {
            sequence: self.sequence.repeating(),
            records: false,
            ..self
        }
    }

    /// The same that waits for programs, without records: it may run for months.
    pub fn standing_by(self) -> Operator {
        Operator {
            sequence: self.sequence.standing_by(),
            records: false,
            ..self
        }
    }

    /// Begins a job while standing by; where it is a program, [`Operator::poll`] tells when to plan it. False: the machine is not
    /// ready for one.
    pub fn begin(&mut self, now_ns: u64, job: Job) -> bool {
        let state = self.live().state;
        let free = self.sequence.step() == Step::StandBy && matches!(state, State::Disabled | State::Ready);
        if free {
            self.take_for_acknowledged("the next order");
            self.sequence.begin(now_ns, state, job);
        }
        free
    }

    /// The sets of joints to be homed, in their order, for these joints (bit n: joint n) to be homed.
    pub fn homing_order(&self, joints: u64) -> Vec<u64> {
        let groups = self.homing.iter().map(|group| group & joints);
        groups.filter(|group| *group != 0).collect()
    }

    /// Those that are not homed.
    pub fn not_homed(&self) -> u64 {
        let all = self.homing.iter().fold(0, |all, group| all | group);
        all & !self.live().homed
    }

    /// Allows motion again after a fault.
    pub fn acknowledge(&mut self) {
        self.take_for_acknowledged("alarm acknowledge");
        self.give(Command::Acknowledge);
    }

    /// The emergency stop is over; switches nothing on.
    pub fn reset_estop(&mut self) {
        self.give(Command::EstopReset);
    }

    /// Somebody knows of all alarms up to now, and has said so by this order.
    fn take_for_acknowledged(&mut self, by: &str) {
        self.alarms.over = self.alarms.list.len();
        let seqs = std::mem::take(&mut self.alarms.unacknowledged);
        if !seqs.is_empty() {
            let time_s = self.now_s();
            self.log.acknowledge(time_s, seqs, by);
        }
    }

    /// A program begins, and records of it.
    pub fn begin_program(&mut self, name: &str) {
        let unix_s = self.log.unix_s();
        self.program = Some(ProgramBegun {
            name: name.to_owned(),
            unix_s,
            alarms: self.alarms.list.len(),
            warnings: self.warnings.clone(),
        });
        self.recorder = Recorder::default();
        self.records = true;
        let more = More {
            program: Some(ProgramRecord {
                name: name.to_owned(),
                begun_unix_s: unix_s,
                result: None,
                took_s: None,
                line: None,
                deviation_max_mm: None,
                report: None,
            }),
            ..More::default()
        };
        let time_s = self.now_s();
        self.log.write(
            time_s,
            message!("program.begun", "program {name}: begun", name = name),
            more,
        );
    }

    /// When the program under way began, s since 1970.
    pub fn program_begun_unix_s(&self) -> f64 {
        self.program.as_ref().map_or(0.0, |program| program.unix_s)
    }

    /// It is over. `report`: number of its report.
    pub fn end_program(&mut self, result: protocol::Outcome, took_s: f64, report: Option<u64>) {
        let Some(ProgramBegun { name, unix_s, .. }) = self.program.take() else {
            return;
        };
        let more = More {
            program: Some(ProgramRecord {
                name: name.clone(),
                begun_unix_s: unix_s,
                result: Some(result),
                took_s: Some(took_s),
                line: Some(self.recorder.last_line()),
                deviation_max_mm: self.recorder.deviation().map(|deviation| deviation.actual_max_mm),
                report,
            }),
            ..More::default()
        };
        let time_s = self.now_s();
        let message = message!(
            "program.ended",
            "program {name}: {outcome}, {took:.1} s",
            name = name,
            outcome = result.message(),
            took = took_s
        );
        self.log.write(time_s, message, more);
    }

    /// Alarms since the program under way began; all, where none is.
    pub fn alarms_of_program(&self) -> &[Alarm] {
        let before = self.program.as_ref().map_or(0, |program| program.alarms);
        &self.alarms.list[before..]
    }

    /// Warnings that came while the program under way ran.
    pub fn warnings_of_program(&self) -> Vec<Warning> {
        let before: &[Warning] = self.program.as_ref().map_or(&[], |program| &program.warnings);
        let fresh = self.warnings.iter().filter_map(|warning| {
            let earlier = before.iter().find(|earlier| earlier.kind == warning.kind);
            let times = warning.times - earlier.map_or(0, |earlier| earlier.times);
            (times > 0).then(|| Warning {
                times,
                ..warning.clone()
            })
        });
        fresh.collect()
    }

    fn now_s(&self) -> f64 {
        self.live().cycles as f64 * self.cycle_s
    }

    /// What is known of an alarm, which is the next entry; `first`: it is the first cause.
    fn alarm_record(&mut self, code: &str, reaction: Reaction, first: bool) -> AlarmRecord {
        let seq = self.log.last() + 1;
        self.endpoints.live.desk.count_alarm(reaction);
        if first {
            self.alarms.first_cause = seq;
        }
        if reaction >= Reaction::ControlledStop {
            self.alarms.unacknowledged.push(seq);
        }
        let stands = self.alarm().is_some();
        let line = self.live().line;
        AlarmRecord {
            code: code.to_owned(),
            severity: reaction.severity(),
            reaction,
            first_cause: if first || !stands { seq } else { self.alarms.first_cause },
            joint: None,
            node: None,
            program: self.program.as_ref().map(|program| program.name.clone()),
            line: Some(line).filter(|line| *line > 0 && self.program.is_some()),
            state: self.state,
            acknowledged: None,
        }
    }

    fn note_alarm(&mut self, time_s: f64, cause: Message, alarm: AlarmRecord) {
        let more = More {
            alarm: Some(alarm),
            ..More::default()
        };
        self.alarms.list.push(Alarm {
            time_s,
            cause: cause.clone(),
        });
        self.log
            .write(time_s, message!("alarm", "alarm: {cause}", cause = cause), more);
    }

    /// Takes in what came, gives the next order. `now_ns`: any monotonic clock.
    ///
    /// A machine position: the caller is to plan the program from there, which takes threads and files, and to call
    /// [`Operator::start`].
    pub fn poll(&mut self, now_ns: u64) -> Option<Position> {
        while let Ok(notice) = self.endpoints.notices.pop() {
            self.apply_notice(notice);
        }
        let live = self.live();
        if live.state == State::Ready && self.state == State::Ready {
            self.rested_at = live.position;
        }
        while let Ok(record) = self.endpoints.trace.pop() {
            if self.records {
                self.recorder.add(&record);
            }
        }
        while self.endpoints.finished.pop().is_ok() {}
        for what in self.endpoints.logic.warnings() {
            self.add_warning(what);
        }
        self.note_overrides();
        let now_s = self.now_s();
        self.log.note_bursts(now_s, now_s);
        let live = self.live();
        // The state counts only once it is that of the last order; a thread that hangs takes none.
        if std::mem::take(&mut self.signals.not_begun) && self.sequence.not_begun(now_ns) {
            self.add_warning(message!(
                "order.not_begun",
                "not begun, for the machine was not ready for it: isocnc status"
            ));
        }
        let step = match live.orders_taken < self.orders_given && live.state != State::Silenced {
            // There must be room for it: it is given once.
            true if self.endpoints.commands.is_full() => None,
            // Nobody keeps the machine from an end by orders of his own.
            true => self.sequence.order_end(),
            false => self.sequence.poll(now_ns, live.state, self.signals.program_ended),
        };
        let command = match step? {
            Step::Program => return Some(live.position),
            Step::Enable => Command::Enable,
            Step::Home => Command::Home(self.sequence.joints_to_home()),
            Step::Stop => Command::Stop,
            Step::Disable => Command::Disable,
            Step::ShutDown => Command::ShutDown,
            Step::Network | Step::StandBy | Step::Done => return None,
        };
        self.give(command);
        None
    }

    /// Hands the program to the cycle thread, or (`mdi`) a line that was typed.
    pub fn start(&mut self, program: Box<Interpolator>, mdi: bool) {
        self.records &= !mdi;
        self.signals.program_ended = false;
        self.programs += u64::from(!mdi);
        self.give(Command::Start { program, mdi });
    }

    /// The texts of the messages of the next program come here, each before the machine comes to it; `None`: not for the journal.
    pub fn hear_messages(&mut self, texts: mpsc::Receiver<Option<String>>) {
        self.messages = Some((texts, 0));
    }

    /// The tool whose change has begun and is not done.
    pub fn changing_tool(&self) -> Option<u32> {
        self.tool_changes.under_way
    }

    /// Changes that were done since the last call, in their order.
    pub(super) fn take_changed_tools(&mut self) -> Vec<u32> {
        std::mem::take(&mut self.tool_changes.done)
    }

    /// The text of a message; `None`: it has been shown before, on the way forward, or is none for the journal.
    fn message(&mut self, number: u32) -> Option<String> {
        let (texts, shown) = self.messages.as_mut()?;
        let mut text = None;
        while *shown <= number {
            text = texts.try_recv().ok()?;
            *shown += 1;
        }
        text
    }

    /// Wants an end of everything; may be called again and again.
    pub fn end(&mut self, now_ns: u64) {
        self.sequence.end(now_ns);
    }

    /// Wants the machine at rest, spindle and coolant off; may be called again and again. Whoever stands by waits for the next job
    /// then, drives on.
    pub fn stop(&mut self, now_ns: u64) {
        self.sequence.stop(now_ns);
        if self.sequence.step() == Step::StandBy && matches!(self.live().state, State::Ready | State::Jogging) {
            self.give(Command::Stop);
        }
    }

    /// Wants the machine at rest and drives off; may be called again and again.
    pub fn off(&mut self, now_ns: u64) {
        self.sequence.off(now_ns);
    }

    /// Takes in what the time-out thread saw. `evidence`: what the system says of the cycle thread's last time.
    pub fn hear(&mut self, report: &timeout::Report, evidence: impl FnOnce() -> String) {
        match report.event {
            // These are counted where they happen, and judged by the managing node.
            timeout::Event::PresTimeout { .. }
            | timeout::Event::AsyncTimeout { .. }
            | timeout::Event::CycleLate { .. } => {}
            timeout::Event::CycleStarved {
                cycle,
                overdue_ns,
                ran_ns,
            } => {
                let more = match self.lateness.add_stall(report.at_ns) {
                    None => return,
                    Some(1) => String::new(),
                    Some(stalls) => format!(", {stalls} times"),
                };
                let what = format!(
                    "the cycle thread did not get its core for {:.1} ms{more}, and computed {:.1} ms of them: {}",
                    overdue_ns as f64 * 1e-6,
                    ran_ns as f64 * 1e-6,
                    evidence()
                );
                self.log.note(cycle as f64 * self.cycle_s, warning(what));
            }
            timeout::Event::CycleHung { cycle, overdue_ns } => {
                let cause = message!(
                    "control.hung",
                    "{silenced}. It hung for {ms:.1} ms: {evidence}",
                    silenced = self.names.silenced.clone(),
                    ms = overdue_ns as f64 * 1e-6,
                    evidence = evidence()
                );
                self.enter_silenced(cycle, cause);
            }
        }
    }

    /// Nothing can be steered any more.
    fn enter_silenced(&mut self, cycle: u64, cause: Message) {
        self.endpoints.live.show_silenced();
        self.needs_restart = true;
        let time_s = cycle as f64 * self.cycle_s;
        let record = self.alarm_record(Fault::CycleHung.code(), Reaction::Silence, true);
        self.note_alarm(time_s, cause, record);
    }

    /// The time-out thread does not look any more: the machine comes to rest and the control ends.
    pub fn is_unwatched(&mut self, now_ns: u64) {
        if !std::mem::replace(&mut self.needs_restart, true) {
            self.fail_with(now_ns, UNWATCHED_CODE, unwatched());
        }
        self.end(now_ns);
    }

    /// Whether this control cannot go on and has to be restarted.
    pub fn needs_restart(&self) -> bool {
        self.needs_restart
    }

    /// Something outside the cycle thread went wrong: stop and say why.
    pub fn fail(&mut self, now_ns: u64, cause: String) {
        let cause = message!("program.error", "{text}", text = cause);
        self.fail_with(now_ns, PROGRAM_CODE, cause);
    }

    fn fail_with(&mut self, now_ns: u64, code: &str, cause: Message) {
        let is_first = self.alarm().is_none();
        let record = self.alarm_record(code, Reaction::ControlledStop, is_first);
        let time_s = self.now_s();
        self.note_alarm(time_s, cause, record);
        self.sequence.fail(now_ns);
    }

    /// Something that the operator ought to know and that stops nothing.
    pub fn add_entry(&mut self, what: impl Into<Message>) {
        let time_s = self.now_s();
        self.log.note(time_s, what.into());
    }

    /// The same, of something that is wrong.
    pub fn add_warning(&mut self, what: impl Into<Message>) {
        self.add_entry(warning(what));
    }

    /// Gives an order that does not belong to the sequence.
    pub fn give(&mut self, command: Command) {
        self.is_given(command);
    }

    /// Whether the cycle has room for what one more order of a client may give. One that takes no orders any more refuses them all.
    pub fn has_room(&self) -> bool {
        self.endpoints.commands.slots() >= ORDER_COMMANDS_MAX
            || matches!(self.live().state, State::Silenced | State::Down)
    }

    /// Whether there was room for it: orders of clients wait until there is, see [`Operator::has_room`].
    fn is_given(&mut self, command: Command) -> bool {
        let given = self.endpoints.commands.push(command).is_ok();
        self.orders_given += u64::from(given);
        given
    }

    /// Orders an emergency stop, for which there is always room.
    pub fn estop(&mut self) {
        if !self.is_given(Command::Estop) {
            self.endpoints.live.order(AtOnce::Estop);
        }
    }

    /// Whether somebody has pressed the stop pin since the last call: an end of all that is under way or about to begin.
    pub fn take_stop_pressed(&mut self) -> bool {
        std::mem::take(&mut self.signals.stop_pressed)
    }

    /// What is under way, as clients are told.
    pub fn step_code(&self) -> protocol::Step {
        self.step().code(self.names.has_network)
    }

    /// Whether what the machine shows is what came of all orders given.
    pub fn is_up_to_date(&self) -> bool {
        self.live().orders_taken >= self.orders_given
    }

    pub fn live(&self) -> Snapshot {
        self.endpoints.live.snapshot()
    }

    /// The latest values themselves, and the overrides.
    pub fn shared(&self) -> Arc<RtStatus> {
        Arc::clone(&self.endpoints.live)
    }

    /// The tool that the last change brought; `None`: there was no change.
    pub fn tool(&self) -> Option<u32> {
        self.endpoints.live.tool()
    }

    /// Name of a joint, for messages.
    pub fn joint_name(&self, joint: usize) -> &Message {
        &self.names.joints[joint]
    }

    /// Entries of alarms that nobody has acknowledged, the first cause first.
    pub fn unacknowledged(&self) -> impl Iterator<Item = &Entry> {
        self.alarms.unacknowledged.iter().filter_map(|seq| self.log.entry(*seq))
    }

    /// Overrides have been turned by this client.
    pub(super) fn turned(&mut self, by: Option<String>) {
        self.turned_by = by;
    }

    /// A jog of this client begins.
    pub(super) fn jogged(&mut self, by: Option<String>) {
        self.jogged_by = by;
    }

    /// What ended the last jog, if something was in its way.
    pub fn obstruction(&self) -> Option<&Message> {
        self.obstruction.as_ref()
    }

    /// Another jog begins.
    pub fn forget_obstruction(&mut self) {
        self.obstruction = None;
    }

    /// Step of the sequence.
    pub fn step(&self) -> Step {
        self.sequence.step()
    }

    /// How it ended, once it has. A program that was never run to its end because of an alarm counts as faulted.
    pub fn outcome(&self) -> Option<Outcome> {
        let outcome = self.sequence.outcome()?;
        Some(if self.alarms.list.is_empty() {
            outcome
        } else {
            Outcome::Faulted
        })
    }

    /// How the last program ended, while none is under way.
    pub fn program_outcome(&self) -> Option<Outcome> {
        self.sequence.program_outcome()
    }

    /// How the last job ended, while none is under way.
    pub fn job_outcome(&self) -> Option<Outcome> {
        self.sequence.job_outcome()
    }

    /// How often the program under way is to be begun behind this time.
    pub fn runs_left(&self) -> u32 {
        self.sequence.runs_left()
    }

    /// Whether a program is under way, or what leads to one.
    pub fn has_program(&self) -> bool {
        self.sequence.has_program()
    }

    /// What a control of this machine says whose cycle thread hung.
    pub fn silenced(&self) -> &Message {
        &self.names.silenced
    }

    /// First cause since the last acknowledge.
    pub fn alarm(&self) -> Option<&Alarm> {
        self.alarms.first()
    }

    /// Seconds from the first cycle to OPERATIONAL of the whole network.
    pub fn operational_s(&self) -> Option<f64> {
        self.operational_s.filter(|_| self.names.has_network)
    }

    /// Programs begun so far, each repetition counted.
    pub fn programs(&self) -> u64 {
        self.programs
    }

    /// The journal: how far the disk has it.
    pub fn log(&self) -> &Log {
        &self.log
    }

    /// The journal, to be set up.
    pub fn log_mut(&mut self) -> &mut Log {
        &mut self.log
    }

    /// Nothing more is kept.
    pub fn close_journal(&mut self) {
        let now_s = self.now_s();
        self.log.note_bursts(f64::INFINITY, now_s);
        self.log.close();
    }

    /// Everything noted so far, or the latest of it.
    pub fn journal(&self) -> &[Entry] {
        self.log.entries()
    }

    /// The first entry that has not been read.
    pub fn next_entry(&mut self) -> Option<&Entry> {
        self.log.next()
    }

    /// Alarms, the first cause first.
    pub fn alarms(&self) -> &[Alarm] {
        &self.alarms.list
    }

    /// Warnings, one of each kind.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Cycles that began late enough to be noticed, or were left out.
    pub fn late_cycles(&self) -> u64 {
        self.lateness.cycles
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_warning_that_comes_again_is_counted_and_told_at_1_10_100() {
        let config = config::parse(
            include_str!("../../../../configs/mill3-demo.toml"),
            Path::new("demo.toml"),
        )
        .unwrap();
        let (mut notices, notices_out) = rtrb::RingBuffer::new(1000);
        let endpoints = OperatorEndpoints {
            commands: rtrb::RingBuffer::new(1).0,
            notices: notices_out,
            trace: rtrb::RingBuffer::new(1).1,
            finished: rtrb::RingBuffer::new(1).1,
            live: Arc::default(),
            logic: Arc::default(),
        };
        let mut operator = Operator::new(&config, endpoints, 0);
        for time in 1..=250 {
            let fault = match time {
                7 => Fault::CountsLost {
                    counts: 3,
                    in_step: false,
                },
                _ => Fault::ManyOverruns { cycles: time },
            };
            let notice = Notice::Fault { fault, first: false };
            let cycle = time * 1000;
            notices.push(TimedNotice { cycle, notice }).unwrap();
        }
        operator.poll(0);
        let told: Vec<&str> = operator.journal().iter().map(|entry| entry.text.as_str()).collect();
        assert_eq!(told.len(), 4, "{told:#?}");
        assert!(told[0].starts_with("warning: 1 of the last 1000 cycles"), "{}", told[0]);
        assert!(told[1].starts_with("warning: spindle: "), "{}", told[1]);
        assert!(
            told[2].starts_with("warning, 10 times by now: 11 of the last"),
            "{}",
            told[2]
        );
        assert!(
            told[3].starts_with("warning, 100 times by now: 101 of the last"),
            "{}",
            told[3]
        );
        let counts: Vec<_> = operator
            .warnings()
            .iter()
            .map(|warning| (warning.time_s, warning.times))
            .collect();
        assert_eq!(counts, [(1.0, 249), (7.0, 1)]);
        assert!(operator.warnings()[0].cause.text.starts_with("250 of the last"));
        assert_eq!(operator.alarms(), []);
    }
}
