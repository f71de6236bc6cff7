//! A control that stands by: the network is up, and the machine does what clients ask for.
//!
//! In:  a machine, a wire; orders of clients over the inbox.
//! Out: what is carried out; answers; the journal on the terminal.
//!
//! Each order is judged by the table of [`crate::machine::permission`]. A program is checked as a whole before it is accepted;
//! stopped meanwhile, or forsaken by the client that wants it, it never begins. Drives that were switched on stay on, and joints
//! that are homed stay so: jogging, MDI and programs follow each other. A fault waits for an acknowledge and lets nothing begin
//! before.

use super::progress::told;
use super::remembered;
use super::table_writer::Keeper;
use crate::api::orders::{Jogged, Order, OrderInbox, Shown, ShownProgram, Source, Waiting};
use crate::api::rpc::{RpcError, code};
use crate::api::server::Ticket;
use crate::config::Config;
use crate::host::capabilities;
use crate::host::capabilities::Work;
use crate::host::logging;
use crate::host::signals;
use crate::host::signals::StopSignal;
use crate::host::terminal::{is_heard, say};
use crate::machine::faults::SILENCED;
use crate::machine::permission::{Activity, Condition, Power, Wish, permit};
use crate::machine::sequence::{Job, Outcome, Step};
use crate::machine::state::State;
use crate::machine::tables::{Tables, lock};
use crate::operator::console::{Operator, level};
use crate::operator::manual_mode;
use crate::operator::operator_loop::{LoopTask, Running};
use crate::operator::session;
use crate::operator::session::{Session, Task, Wire};
use crate::program::text::{Reader, Text};
use crate::program::{Begin, Change, Overview, approach, changed, check, home, preview};
use crate::rt::shared::Command;
use crate::rt::waiting;
use gcode::Modes;
use motion::cancel::Cancel;
use motion::canon::Axis;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::thread::{Scope, ScopedJoinHandle};

/// Lines of MDI that wait for their turn.
const MDI_MAX: usize = 64;

/// A program that was accepted, or a line that was typed.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) name: String,
    /// The line that was typed, for the journal; of a program nothing.
    line: String,
    pub(super) text: Arc<Text>,
    pub(super) begin: Begin,
    overview: Overview,
    /// What it was checked with.
    tables: Tables,
    /// How often spindle and coolant had been switched off when it was checked.
    switched_off: u64,
}

impl Part {
    pub(super) fn is_mdi(&self) -> bool {
        matches!(self.begin, Begin::Mdi { .. })
    }
}

type Checked = Result<Part, String>;

/// What becomes of a program behind its check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Then {
    /// It is kept.
    Load,
    /// It runs.
    Start,
    /// It runs, once drives are on and joints are home.
    Run,
}

/// Whose orders the machine follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Mode {
    #[default]
    Manual,
    Mdi,
    Auto,
}

impl Mode {
    const fn name(self) -> &'static str {
        match self {
            Mode::Manual => "manual",
            Mode::Mdi => "mdi",
            Mode::Auto => "auto",
        }
    }
}

/// Serves the clients of one session.
pub(super) struct Clients<'scope, 'env> {
    scope: &'scope Scope<'scope, 'env>,
    config: &'env Config,
    tables: &'env Mutex<Tables>,
    /// The session waits for programs; else it has its own.
    stands_by: bool,
    inbox: OrderInbox,
    checking: Option<Checking<'scope>>,
    /// What runs, or ran last.
    part: Option<Arc<Part>>,
    /// The program to start.
    loaded: Option<Arc<Part>>,
    mode: Mode,
    /// Lines of MDI that wait for their turn, and who wants them.
    mdi: VecDeque<(Ticket, String)>,
    /// Those in force for the next line of MDI; `None`: as at the start of a program.
    modes: Option<Arc<Modes>>,
    /// How often the machine had switched spindle and coolant off by the last look, and when the last program began.
    switched_off: [u64; 2],
    /// Some planner still works for the program that was the last one.
    is_planning: bool,
}

/// A program that is being checked.
struct Checking<'scope> {
    /// Who waits for it to begin; `None`: nobody any more, and it does not begin.
    wanted: Option<Ticket>,
    then: Then,
    cancel: Cancel,
    thread: ScopedJoinHandle<'scope, Checked>,
}

/// What is to be checked.
enum Subject {
    Source(Source),
    /// The program that is loaded, since the tables have changed.
    Again(Arc<Part>),
    /// The same before a line; `yes`: the operator has agreed to what that means.
    FromLine {
        part: Arc<Part>,
        line: u32,
        yes: bool,
    },
}

type Answer = Result<Value, String>;

impl<'scope, 'env> Clients<'scope, 'env> {
    pub(super) fn new(
        scope: &'scope Scope<'scope, 'env>,
        config: &'env Config,
        tables: &'env Mutex<Tables>,
        stands_by: bool,
        inbox: OrderInbox,
    ) -> Clients<'scope, 'env> {
        Clients {
            scope,
            config,
            tables,
            stands_by,
            inbox,
            checking: None,
            part: None,
            loaded: None,
            mode: Mode::default(),
            mdi: VecDeque::new(),
            modes: None,
            switched_off: [0; 2],
            is_planning: false,
        }
    }

    /// What is under way, or was last.
    pub(super) fn part(&self) -> Option<&Arc<Part>> {
        self.part.as_ref()
    }

    /// A program is over, and has left these modes if it came to its end: what follows a stop begins as a program does.
    pub(super) fn adopt_modes(&mut self, modes: Option<Modes>) {
        let [now, at_begin] = self.switched_off;
        self.modes = modes.map(Arc::new);
        if now != at_begin {
            self.switch_modes_off();
        }
        if self.modes.is_none() {
            self.refuse_queue("the line before it was given up");
        }
    }

    /// What has been switched off stays off until a line names it again.
    fn switch_modes_off(&mut self) {
        if let Some(modes) = &mut self.modes {
            Arc::make_mut(modes).switch_off();
        }
    }

    fn refuse_queue(&mut self, why: &str) {
        for (ticket, _) in self.mdi.drain(..) {
            self.inbox.answer(ticket, Err(RpcError::new(code::REFUSED, why)));
        }
    }

    /// Carries out what clients want. Waits for nothing. `is_planning`: a planner still works for the last program.
    pub(super) fn serve(
        &mut self,
        operator: &mut Operator,
        keeper: &mut Keeper<'_, '_>,
        is_planning: bool,
        now_ns: u64,
    ) -> std::io::Result<()> {
        self.is_planning = is_planning;
        let switched_off = operator.live().switched_off;
        if std::mem::replace(&mut self.switched_off[0], switched_off) != switched_off {
            self.switch_modes_off();
        }
        // Orders first: a stop reaches a program that would begin in this turn.
        let mut answers = Vec::new();
        while let Some((ticket, order)) = self.inbox.next() {
            if order == Order::Withdraw {
                self.withdraw(ticket);
                continue;
            }
            if let Some(answer) = self.obey(ticket, order, operator, keeper, now_ns)? {
                answers.push((ticket, answer));
            }
        }
        if self
            .checking
            .as_ref()
            .is_some_and(|checking| checking.thread.is_finished())
            && let Some(Checking {
                wanted, then, thread, ..
            }) = self.checking.take()
        {
            let checked = thread
                .join()
                .unwrap_or_else(|_| Err("the check of the program panicked".into()));
            if let Some(ticket) = wanted {
                let answer = checked.and_then(|part| self.accept(part, then, operator, now_ns));
                answers.push((ticket, answer));
            }
        }
        if self.condition(operator).activity == Activity::Idle
            && let Some((ticket, line)) = self.mdi.pop_front()
        {
            match self.may(Wish::Mdi, operator) {
                Ok(()) => {
                    let name = "MDI".into();
                    let source = Source::Text { name, text: line };
                    self.check(ticket, Subject::Source(source), Then::Start, Mode::Mdi, operator)?;
                }
                Err(why) => answers.push((ticket, Err(why))),
            }
        }
        // Whoever has an answer sees what came of the order.
        let shown = self.shown(operator);
        self.inbox.show(shown);
        for (ticket, answer) in answers {
            let answer = answer.map_err(|what| RpcError::new(code::REFUSED, what));
            self.inbox.answer(ticket, answer);
        }
        Ok(())
    }

    /// `None`: the answer comes later.
    fn obey(
        &mut self,
        ticket: Ticket,
        order: Order,
        operator: &mut Operator,
        keeper: &mut Keeper<'_, '_>,
        now_ns: u64,
    ) -> std::io::Result<Option<Answer>> {
        // Whatever it is: nothing can be done any more.
        if operator.live().state == State::Silenced {
            return Ok(Some(Err(SILENCED.to_owned())));
        }
        let Some(wish) = wish(&order) else {
            let tables = lock(self.tables);
            return Ok(Some(Ok(match order {
                Order::Tools => remembered::tools(&tables, self.config.unit),
                Order::Journal(since) => remembered::journal(operator.journal(), since),
                _ => remembered::offsets(&tables, self.config),
            })));
        };
        if moves(wish) && self.config.joints.is_empty() {
            return Ok(Some(Err(self.config.without_joints())));
        }
        if let Err(why) = self.may(wish, operator) {
            // Lines of MDI wait behind those that run.
            let waits = matches!(order, Order::Mdi(_)) && self.is_mdi_under_way(operator);
            if !waits {
                return Ok(Some(Err(why)));
            }
        }
        if is_told(&order) {
            operator.add_entry(format!("order: {}", wish.command()));
        }
        let done = match order {
            Order::Withdraw | Order::Offsets | Order::Tools | Order::Journal(_) => return Ok(None),
            Order::On => self.begin(Job::On, Mode::Manual, operator, now_ns),
            Order::Off => {
                self.give_up_check();
                self.refuse_queue("drives are switched off");
                operator.off(now_ns);
                Ok(())
            }
            Order::Home(joints) => {
                self.joints_to_home(&joints)
                    .and_then(|joints| match operator.homing_order(joints) {
                        order if order.is_empty() => Err("none of these joints has a home".into()),
                        order => self.begin(Job::Home(order), Mode::Manual, operator, now_ns),
                    })
            }
            Order::Load(source) => {
                self.check(ticket, Subject::Source(source), Then::Load, Mode::Auto, operator)?;
                return Ok(None);
            }
            Order::Run(source) => {
                self.check(ticket, Subject::Source(source), Then::Run, Mode::Auto, operator)?;
                return Ok(None);
            }
            Order::Start {
                from_line: Some(line),
                yes,
            } => {
                if let Some(part) = self.loaded.clone() {
                    let subject = Subject::FromLine { part, line, yes };
                    self.check(ticket, subject, Then::Start, Mode::Auto, operator)?;
                }
                return Ok(None);
            }
            Order::Start { .. } => {
                let Some(part) = self.loaded.clone() else {
                    return Ok(Some(Err("no program is loaded".into())));
                };
                let known = part.tables == *lock(self.tables);
                if !known {
                    self.check(ticket, Subject::Again(part), Then::Start, Mode::Auto, operator)?;
                    return Ok(None);
                }
                return Ok(Some(self.start(part, Then::Start, operator, now_ns)));
            }
            Order::Mdi(_) if self.mdi.len() >= MDI_MAX => Err(format!("{MDI_MAX} lines wait already")),
            Order::Mdi(line) => {
                self.mdi.push_back((ticket, line));
                return Ok(None);
            }
            Order::Change(change) => {
                if let Some(axis) = change.axis()
                    && let Err(why) = manual_mode::joints(Jogged::Axis(axis), self.config)
                {
                    return Ok(Some(Err(why)));
                }
                let at = operator.live().position;
                let changed = changed(self.config, &lock(self.tables), at, self.modes.as_deref(), &change);
                changed.map(|left| keeper.hand_in(left))
            }
            Order::Jog(jog) => {
                self.mode = Mode::Manual;
                return Ok(Some(manual_mode::jog(&jog, self.config, operator)));
            }
            Order::Hold => {
                operator.give(Command::Hold);
                Ok(())
            }
            Order::Resume => {
                operator.give(Command::Resume);
                Ok(())
            }
            Order::Reverse(share) => {
                operator.give(Command::Reverse(share));
                Ok(())
            }
            // Of a program that has not begun yet as well.
            Order::SingleBlock(on) => {
                operator.give(Command::SingleBlock(on));
                Ok(())
            }
            Order::ToolChanged => match operator.live().waiting {
                Some(waiting::Waiting::ToolChange { .. }) => {
                    operator.give(Command::ToolChanged);
                    Ok(())
                }
                _ => Err("nothing waits for a tool: isocnc status tells how the machine is".into()),
            },
            Order::Stop => {
                self.refuse_queue("stopped before it began");
                if !self.give_up_check() {
                    operator.stop(now_ns);
                }
                Ok(())
            }
            Order::Estop => {
                self.give_up_check();
                self.refuse_queue("emergency stop");
                operator.give(Command::Estop);
                Ok(())
            }
            Order::EstopReset => {
                operator.reset_estop();
                Ok(())
            }
            Order::Acknowledge => {
                operator.acknowledge();
                Ok(())
            }
        };
        Ok(Some(done.map(|()| json!({}))))
    }

    /// Whoever wants a stop while a program is being checked does not want it to begin behind that. False: there is none.
    pub(super) fn give_up_check(&mut self) -> bool {
        let Some(checking) = &mut self.checking else {
            return false;
        };
        checking.cancel.cancel();
        let Some(ticket) = checking.wanted.take() else {
            return false;
        };
        let what = "stopped before it began";
        self.inbox.answer(ticket, Err(RpcError::new(code::REFUSED, what)));
        true
    }

    /// A machine must not begin to move for somebody who has given up waiting for it.
    fn withdraw(&mut self, ticket: Ticket) {
        self.mdi.retain(|(wanted, _)| *wanted != ticket);
        if let Some(checking) = &mut self.checking
            && checking.wanted == Some(ticket)
        {
            checking.wanted = None;
            checking.cancel.cancel();
        }
    }

    /// How the machine is, for the table of orders.
    fn condition(&self, operator: &Operator) -> Condition {
        let live = operator.live();
        let (step, state) = (operator.step(), live.state);
        let power = match state {
            State::Booting => Power::Starting,
            State::Disabled => Power::Off,
            State::Enabling | State::Disabling => Power::Switching,
            State::Faulted => Power::Alarm,
            State::Estop if live.chain_open => Power::EstopOpen,
            State::Estop => Power::Estop,
            State::Ready | State::Homing | State::Jogging | State::Running | State::Held | State::Stopping => Power::On,
            State::ShuttingDown | State::Down | State::Silenced => Power::Ending,
        };
        let is_checked = self.checking.is_some();
        let activity = match (step, state) {
            (_, State::Held) => Activity::Held,
            (Step::Stop, _) | (_, State::Stopping) => Activity::Stopping,
            (Step::Home, _) | (_, State::Homing) => Activity::Homing,
            (Step::Program, _) | (_, State::Running) => Activity::Running,
            (_, State::Jogging) => Activity::Jogging,
            _ if is_checked => Activity::Checking,
            // What is left of the last program is being put away, or an order has yet to be taken.
            (Step::StandBy, _) if self.is_planning || !operator.is_up_to_date() => Activity::Stopping,
            (Step::StandBy, _) => Activity::Idle,
            (Step::Network | Step::Enable | Step::Disable | Step::ShutDown | Step::Done, _) => Activity::Idle,
        };
        let power = match (step, power) {
            (Step::Enable | Step::Disable, Power::Off | Power::On) => Power::Switching,
            (_, power) => power,
        };
        Condition {
            stands_by: self.stands_by,
            power,
            homed: operator.not_homed() == 0,
            on_limit: live.limits != [0; 2],
            activity,
            loaded: self.loaded.is_some(),
        }
    }

    fn may(&self, wish: Wish, operator: &Operator) -> Result<(), String> {
        let mut condition = self.condition(operator);
        // Orders of a hand come faster than the cycle takes them; it looks itself whether each can be.
        let is_settling = operator.step() == Step::StandBy && !self.is_planning && !operator.is_up_to_date();
        if wish == Wish::Jog && is_settling {
            condition.activity = Activity::Jogging;
        }
        permit(wish, &condition).map_err(|refusal| match operator.alarm() {
            // The first cause says more than that there is one.
            Some(alarm) if operator.live().state == State::Faulted => format!("{}; {}", alarm.cause, refusal.next),
            _ => refusal.to_string(),
        })
    }

    fn is_mdi_under_way(&self, operator: &Operator) -> bool {
        let condition = self.condition(operator);
        let is_busy = matches!(
            condition.activity,
            Activity::Checking | Activity::Running | Activity::Held
        ) || self.is_planning && condition.activity == Activity::Stopping;
        self.mode == Mode::Mdi && condition.power == Power::On && is_busy
    }

    fn joints_to_home(&self, joints: &[usize]) -> Result<u64, String> {
        if joints.is_empty() {
            return Ok(u64::MAX);
        }
        joints.iter().try_fold(0, |all, joint| {
            Ok(all | manual_mode::joints(Jogged::Joint(*joint), self.config)?)
        })
    }

    fn begin(&mut self, job: Job, mode: Mode, operator: &mut Operator, now_ns: u64) -> Result<(), String> {
        match operator.begin(now_ns, job) {
            true => {
                self.mode = mode;
                Ok(())
            }
            false => Err("the machine is not ready for it: isocnc status tells how it is".into()),
        }
    }

    /// Reads and checks a program in a thread of its own: that may take seconds.
    fn check(
        &mut self,
        ticket: Ticket,
        subject: Subject,
        then: Then,
        mode: Mode,
        operator: &Operator,
    ) -> std::io::Result<()> {
        let (config, tables) = (self.config, self.tables);
        let at = match operator.not_homed() {
            0 => operator.live().position,
            _ => home(config),
        };
        let begin = match mode {
            Mode::Mdi => Begin::Mdi {
                at,
                modes: self.modes.clone(),
            },
            Mode::Manual | Mode::Auto => Begin::Program { at },
        };
        let cancel = Cancel::default();
        let given_up = cancel.clone();
        let switched_off = operator.live().switched_off;
        let work = move || {
            capabilities::give_up_or_warn(Work::Ordinary);
            // Whoever edited a table while nothing ran wants it to count.
            let tables = {
                let mut tables = lock(tables);
                tables.refresh(config).map_err(|error| error.to_string())?;
                tables.clone()
            };
            let begin = match subject {
                Subject::FromLine { line, .. } => Begin::FromLine {
                    at,
                    line,
                    approach: approach(config),
                },
                _ => begin,
            };
            if let Subject::FromLine { part, line, yes: false } = &subject {
                let text = Reader::from(&*part.text);
                let told = preview(config, &tables, &part.name, text, (at, *line), &given_up)?;
                return Err(format!(
                    "{}\nif that is right: isocnc program start --from-line {line} --yes",
                    told.join("\n")
                ));
            }
            let line = match &subject {
                Subject::Source(Source::Text { text, .. }) if matches!(begin, Begin::Mdi { .. }) => {
                    text.trim().to_owned()
                }
                _ => String::new(),
            };
            let (name, text) = match subject {
                Subject::Source(source) => read(source)?,
                Subject::Again(part) | Subject::FromLine { part, .. } => (part.name.clone(), Arc::clone(&part.text)),
            };
            let checked = check(config, &tables, &name, &*text, &begin, &given_up);
            let overview = checked.map_err(|errors| errors.to_string())?;
            Ok(Part {
                name,
                line,
                text,
                begin,
                overview,
                tables,
                switched_off,
            })
        };
        let thread = std::thread::Builder::new()
            .name("check".into())
            .spawn_scoped(self.scope, work)?;
        self.mode = mode;
        self.checking = Some(Checking {
            wanted: Some(ticket),
            then,
            cancel,
            thread,
        });
        Ok(())
    }

    /// A program has passed its check.
    fn accept(&mut self, part: Part, then: Then, operator: &mut Operator, now_ns: u64) -> Answer {
        let part = Arc::new(part);
        if matches!(part.begin, Begin::Program { .. }) {
            self.loaded = Some(Arc::clone(&part));
        }
        match then {
            Then::Load => Ok(self.outlook(&part, operator)),
            Then::Start | Then::Run => self.start(part, then, operator, now_ns),
        }
    }

    /// What is to be known of a program before it runs.
    fn outlook(&self, part: &Part, operator: &mut Operator) -> Value {
        let warning = (part.overview.real_time.warning()).map(|(line, what)| format!("{}:{line}: {what}", part.name));
        if let Some(warning) = &warning {
            operator.add_entry(format!("warning: {warning}"));
        }
        json!({
            "program": part.name,
            "lines": part.overview.lines,
            "planned_time_s": part.overview.time_s,
            "real_time_factor": part.overview.real_time,
            "warning": warning,
        })
    }

    fn start(&mut self, part: Arc<Part>, then: Then, operator: &mut Operator, now_ns: u64) -> Answer {
        let (wish, mode) = match (then, part.is_mdi()) {
            (_, true) => (Wish::Mdi, Mode::Mdi),
            (Then::Run, false) => (Wish::Run, Mode::Auto),
            (Then::Start | Then::Load, false) => (Wish::Start, Mode::Auto),
        };
        // Things may have changed during the check.
        self.may(wish, operator)?;
        let switched_off = operator.live().switched_off;
        if part.is_mdi() && part.switched_off != switched_off {
            return Err("stopped before it began".into());
        }
        let missing = match then {
            Then::Run => operator.not_homed(),
            Then::Load | Then::Start => 0,
        };
        let home = operator.homing_order(missing);
        self.begin(Job::Program { home }, mode, operator, now_ns)?;
        let begun = self.outlook(&part, operator);
        if part.is_mdi() {
            operator.add_entry(format!("MDI: {}", part.line));
        }
        self.switched_off[1] = switched_off;
        self.part = Some(part);
        Ok(begun)
    }

    fn shown(&self, operator: &Operator) -> Shown {
        let condition = self.condition(operator);
        let live = operator.live();
        let program = match &self.part {
            Some(part) if !part.is_mdi() => Some(part),
            _ => self.loaded.as_ref(),
        };
        // Of the one that is loaded, once it has run.
        let has_run = |part: &Arc<Part>| self.part.as_ref().is_some_and(|last| Arc::ptr_eq(last, part));
        let result = |part| {
            operator
                .program_outcome()
                .filter(|_| has_run(part) && !operator.has_program())
        };
        let mut mdi = Vec::new();
        if let Some(part) = self.part.as_ref().filter(|part| part.is_mdi())
            && condition.activity != Activity::Idle
            && self.mode == Mode::Mdi
        {
            mdi.push(part.line.clone());
        }
        mdi.extend(self.mdi.iter().map(|(_, line)| line.clone()));
        Shown {
            step: operator.step().name(),
            power: condition.power.name(),
            activity: condition.activity.name(),
            mode: self.mode.name(),
            program: program.map(|part| ShownProgram {
                name: part.name.clone(),
                lines: part.overview.lines,
                planned_time_s: part.overview.time_s,
                result: result(part).map(outcome_word),
            }),
            job: operator
                .job_outcome()
                .filter(|_| self.checking.is_none() && !self.is_planning && operator.is_up_to_date())
                .map(outcome_word),
            mdi,
            waiting: live.waiting.map(|waiting| Waiting {
                what: waiting.word(),
                text: waiting.text(),
                release: waiting.release(),
            }),
            codes: self.modes.as_deref().map(Modes::words).unwrap_or_default(),
            work_offset: self.work_offset(),
            tool: lock(self.tables).tool_in_spindle(),
            alarm: operator.alarm().map(|alarm| alarm.cause.clone()),
            obstruction: operator.obstruction().map(str::to_owned),
        }
    }

    /// What machine coordinates are above those of the work; rotation of the system is left out.
    fn work_offset(&self) -> Vec<f64> {
        let [origin, g92] = lock(self.tables).work_offset(self.config.unit);
        let tool = self.modes.as_deref().and_then(Modes::tool_offset).unwrap_or_default();
        Axis::ALL.map(|axis| origin[axis] + g92[axis] + tool[axis]).to_vec()
    }
}

/// The row of the table of orders; `None`: it only looks.
fn wish(order: &Order) -> Option<Wish> {
    Some(match order {
        Order::Offsets | Order::Tools | Order::Journal(_) => return None,
        Order::On => Wish::On,
        Order::Off => Wish::Off,
        Order::Home(_) => Wish::Home,
        Order::Load(_) => Wish::Load,
        Order::Start { .. } => Wish::Start,
        Order::Run(_) => Wish::Run,
        Order::Mdi(_) => Wish::Mdi,
        Order::Change(Change::Offset { .. } | Change::Tool { .. }) => Wish::Set,
        Order::Change(_) => Wish::TouchOff,
        Order::Jog(_) => Wish::Jog,
        Order::Hold => Wish::Hold,
        Order::Resume | Order::ToolChanged => Wish::Resume,
        Order::Reverse(_) => Wish::Reverse,
        Order::SingleBlock(_) => Wish::SingleBlock,
        Order::Stop | Order::Withdraw => Wish::Stop,
        Order::Estop => Wish::Estop,
        Order::EstopReset => Wish::EstopReset,
        Order::Acknowledge => Wish::Acknowledge,
    })
}

pub(super) fn outcome_word(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Completed => "completed",
        Outcome::Stopped => "stopped",
        Outcome::Faulted => "faulted",
        Outcome::TimedOut(_) => "timed out",
    }
}

/// Whether the journal has it: not what a hand on a key sends many times a second, nor lines of MDI, which it has when they begin.
fn is_told(order: &Order) -> bool {
    !matches!(order, Order::Jog(_) | Order::Mdi(_))
}

/// Whether it is about motion, which a machine without joints has none of.
fn moves(wish: Wish) -> bool {
    matches!(
        wish,
        Wish::On | Wish::Home | Wish::Jog | Wish::Mdi | Wish::TouchOff | Wish::Load | Wish::Start | Wish::Run
    )
}

fn read(source: Source) -> Result<(String, Arc<Text>), String> {
    match source {
        Source::Text { name, text } => Ok((name, Arc::new(text.into_bytes().into()))),
        Source::File(path) => {
            let name = path.display().to_string();
            let failed = |cause: std::io::Error| format!("{name}: {cause}");
            let text = Text::read(&path).map_err(failed)?;
            Ok((name, Arc::new(text)))
        }
    }
}

/// Stands by until a signal ends it.
///
/// # Errors
/// What keeps it from starting.
pub fn stand_by(config: &Config, wire: Wire, as_json: bool, signal: StopSignal) -> anyhow::Result<ExitCode> {
    let tables = Mutex::new(Tables::read(config)?);
    let session = Session {
        config,
        tables: &tables,
        task: Task::StandBy,
        quiet: as_json,
        signal,
        keep_rights: false,
    };
    if !as_json {
        say(&format!(
            "isocnc: {} stands by with drives off; 'isocnc program run FILE' runs a program, Ctrl-C ends\n",
            config.name
        ));
    }
    let to_journal = logging::goes_to_journal(&std::io::stdout());
    let ended = session::run(&session, wire, &mut Journal { as_json, to_journal })?;
    let operator = &ended.operator;
    if as_json {
        let summary = json!({
            "machine": config.name,
            "signal": session.signal.caught(),
            "programs": operator.programs(),
            "alarms": operator.alarms(),
        });
        say(&format!("{summary}\n"));
    } else {
        let (programs, alarms) = (operator.programs(), operator.alarms().len());
        say(&format!("{programs} programs run, {alarms} alarms\n"));
    }
    if operator.needs_restart() {
        return Ok(ExitCode::from(session::EXIT_RESTART));
    }
    Ok(match session.signal.caught() {
        Some(signal) => ExitCode::from(signals::exit_code(signal)),
        None => ExitCode::FAILURE,
    })
}

/// Prints the journal as it comes.
struct Journal {
    as_json: bool,
    /// Standard output leads to the journal of systemd.
    to_journal: bool,
}

impl LoopTask for Journal {
    fn tick(&mut self, running: &mut Running, _now_ns: u64) {
        while is_heard()
            && let Some(entry) = running.operator.next_entry()
        {
            match self.as_json {
                true => say(&format!("{}\n", json!(entry))),
                false if self.to_journal => say(&format!("{}{}", logging::priority(level(entry)), told(entry))),
                false => say(&told(entry)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::orders::{OrderClient, order_channel};
    use crate::config;
    use crate::operator::rehearsal::{Rehearsal, rehearse_with};
    use crate::rt::timeout;
    use crate::sim::NetConfig;
    use std::path::Path;

    const PART: &str = "G21 G90 G94 G54\nG0 X5 Y5\nM2\n";

    fn run_order() -> Order {
        Order::Run(Source::Text {
            name: "part".into(),
            text: PART.into(),
        })
    }

    /// Clients of a machine that stands by, its drives off.
    fn while_standing_by(act: impl FnOnce(&mut Rehearsal<'_>, Clients<'_, '_>, &OrderClient)) {
        let machine = include_str!("../../configs/mill3-demo.toml");
        let config = config::parse(machine, Path::new("demo.toml")).unwrap();
        let tables = Mutex::new(Tables::read(&config).unwrap());
        let net = NetConfig::clean(1);
        rehearse_with(&config, PART.as_bytes(), net, Operator::standing_by, |run| {
            let up = run.run_until(60_000, |run| run.control.state() == State::Disabled)?;
            assert!(up);
            let (client, inbox) = order_channel();
            std::thread::scope(|scope| act(run, Clients::new(scope, &config, &tables, true, inbox), &client));
            Ok(())
        })
        .unwrap();
    }

    fn serve_clients(run: &mut Rehearsal<'_>, clients: &mut Clients<'_, '_>) {
        let now_ns = run.now_ns();
        let mut keeper = Keeper::new(clients.scope, clients.tables);
        clients.serve(&mut run.operator, &mut keeper, false, now_ns).unwrap();
    }

    #[test]
    fn a_silenced_machine_refuses_every_order_with_the_cause_and_ends() {
        while_standing_by(|run, mut clients, client| {
            let now_ns = run.now_ns();
            let report = timeout::Report {
                at_ns: now_ns,
                event: timeout::Event::CycleHung {
                    cycle: 3,
                    overdue_ns: 5_050_000,
                },
            };
            run.operator.hear(&report, || "it ran 5.0 ms".into());
            for order in [Order::Acknowledge, Order::On, Order::Stop, run_order()] {
                client.put(1, order).unwrap();
                serve_clients(run, &mut clients);
                let (_, answer) = client.answer().expect("an answer at once");
                assert_eq!(answer.unwrap_err().message, SILENCED);
            }
            // The thread that hung takes no order and shows nothing.
            assert_eq!(run.operator.outcome(), None);
            run.operator.poll(now_ns);
            assert_eq!(run.operator.outcome(), Some(Outcome::Faulted));
            assert!(run.operator.needs_restart());
            let [alarm] = run.operator.alarms() else {
                panic!("{:?}", run.operator.alarms());
            };
            assert_eq!(alarm.cause, format!("{SILENCED}. It hung for 5.0 ms: it ran 5.0 ms"));
            // Nor does it say so a second time where it comes back.
            run.control.inhibit_soc();
            run.cycle(0).unwrap();
            let now_ns = run.now_ns();
            run.operator.poll(now_ns);
            assert_eq!((run.control.state(), run.operator.alarms().len()), (State::Silenced, 1));
        });
    }

    #[test]
    fn a_program_that_is_stopped_or_forsaken_during_its_check_never_begins() {
        while_standing_by(|run, mut clients, client| {
            client.put(1, run_order()).unwrap();
            client.put(2, Order::Stop).unwrap();
            serve_clients(run, &mut clients);
            let (ticket, answer) = client.answer().expect("an answer");
            assert_eq!(
                (ticket, answer.unwrap_err().message.as_str()),
                (1, "stopped before it began")
            );
            assert_eq!(client.answer(), Some((2, Ok(json!({})))));
            while clients.checking.is_some() {
                std::thread::yield_now();
                serve_clients(run, &mut clients);
            }
            assert_eq!((run.operator.step(), client.answer()), (Step::StandBy, None));
            // Nor does one that nobody waits for any more; a ticket that is over changes nothing.
            client.put(4, run_order()).unwrap();
            assert!(client.withdraw(4) && client.withdraw(1));
            serve_clients(run, &mut clients);
            while clients.checking.is_some() {
                std::thread::yield_now();
                serve_clients(run, &mut clients);
            }
            assert_eq!((run.operator.step(), client.answer()), (Step::StandBy, None));
            // The next one does.
            client.put(3, run_order()).unwrap();
            let begun = loop {
                serve_clients(run, &mut clients);
                if let Some(begun) = client.answer() {
                    break begun;
                }
                std::thread::yield_now();
            };
            assert_eq!((begun.0, begun.1.is_ok()), (3, true));
            assert_eq!(run.operator.step(), Step::Enable);
        });
    }

    /// A pendant moves two axes at once: its orders lie on the inbox together.
    #[test]
    fn jogs_that_come_in_one_turn_are_all_taken() {
        while_standing_by(|run, mut clients, client| {
            let now_ns = run.now_ns();
            let home = run.operator.homing_order(u64::MAX);
            assert!(run.operator.begin(now_ns, Job::Home(home)));
            let homed = run.run_until(60_000, |run| {
                run.operator.step() == Step::StandBy && run.control.state() == State::Ready
            });
            assert!(homed.unwrap());
            let jog = |joint| {
                Order::Jog(crate::api::orders::Jog {
                    what: Some(Jogged::Joint(joint)),
                    motion: crate::rt::joint_jog::JogMotion::Run { velocity_mm_s: 10.0 },
                })
            };
            for joint in [0, 1] {
                client.put(joint as u64, jog(joint)).unwrap();
            }
            serve_clients(run, &mut clients);
            for _ in 0..2 {
                let (_, answer) = client.answer().expect("an answer at once");
                assert!(answer.is_ok(), "{answer:?}");
            }
            // Whatever needs rest waits for what becomes of them.
            client.put(9, Order::Home(Vec::new())).unwrap();
            serve_clients(run, &mut clients);
            let (_, answer) = client.answer().expect("an answer at once");
            assert!(answer.unwrap_err().message.contains("wait"));
        });
    }

    /// Else the thread goes on for as long as the limits of a check allow, and the next program is refused meanwhile.
    #[test]
    fn the_check_of_a_program_that_nobody_wants_any_more_ends_at_once() {
        let endless = || {
            Order::Run(Source::Text {
                name: "endless".into(),
                text: "G21 G90 F100\no1 while [1]\nG1 X1\nX2\no1 endwhile\nM2\n".into(),
            })
        };
        while_standing_by(|run, mut clients, client| {
            let giving_up = [
                |_: &mut Clients<'_, '_>, client: &OrderClient| client.put(2, Order::Stop).unwrap(),
                |_: &mut Clients<'_, '_>, client: &OrderClient| assert!(client.withdraw(1)),
                // As the loop does when a signal comes.
                |clients: &mut Clients<'_, '_>, _: &OrderClient| assert!(clients.give_up_check()),
            ];
            for give_up in giving_up {
                client.put(1, endless()).unwrap();
                serve_clients(run, &mut clients);
                give_up(&mut clients, client);
                while let Ok(Some((ticket, order))) = Ok::<_, ()>(clients.inbox.next()) {
                    match order {
                        Order::Withdraw => clients.withdraw(ticket),
                        order => assert_eq!((order, clients.give_up_check()), (Order::Stop, true)),
                    }
                }
                let Checking { wanted, thread, .. } = clients.checking.take().expect("it is under way");
                let said = thread.join().unwrap().unwrap_err();
                assert!(
                    wanted.is_none() && said.contains("given up here, before the end"),
                    "{said}"
                );
                while client.answer().is_some() {}
            }
        });
    }

    /// The whole control of a machine without joints, in virtual time: it comes up, moves its inputs to its outputs, and refuses
    /// whatever would move something.
    #[test]
    fn a_machine_of_inputs_and_outputs_stands_by_and_refuses_to_move() {
        let machine = include_str!("../../configs/io-only.toml");
        let config = config::parse(machine, Path::new("io-only.toml")).unwrap();
        let tables = Mutex::new(Tables::read(&config).unwrap());
        let net = NetConfig::clean(1);
        rehearse_with(&config, b"", net, Operator::standing_by, |run| {
            assert!(run.run_until(60_000, |run| run.control.state() == State::Disabled)?);
            let (client, inbox) = order_channel();
            std::thread::scope(|scope| {
                let mut clients = Clients::new(scope, &config, &tables, true, inbox);
                let jog = crate::api::orders::Jog {
                    what: Some(crate::api::orders::Jogged::Joint(0)),
                    motion: crate::rt::joint_jog::JogMotion::Release,
                };
                for (ticket, order) in [run_order(), Order::On, Order::Home(Vec::new()), Order::Jog(jog)]
                    .into_iter()
                    .enumerate()
                {
                    client.put(ticket as u64, order).unwrap();
                    serve_clients(run, &mut clients);
                    let (_, answer) = client.answer().expect("an answer at once");
                    let told = answer.unwrap_err().message;
                    assert_eq!(told, config.without_joints(), "{ticket}");
                }
            });
            assert_eq!(run.control.state(), State::Disabled);
            Ok(())
        })
        .unwrap();
    }
}
