//! A control that stands by: the network is up, drives are off, nothing moves until a client asks for it.
//!
//! In:  a machine, a wire; orders of clients over the inbox.
//! Out: programs checked, begun, held, stopped; answers; the journal on the terminal.
//!
//! A program is checked as a whole before it is accepted; stopped meanwhile, or forsaken by the client that wants it, it
//! never begins. Then drives are switched on, all joints are homed, the program runs, and drives are switched off again:
//! also behind a program that was stopped or that failed. A fault waits for an acknowledge and lets no program begin before.

use super::progress::told;
use crate::api::orders::{Order, OrderInbox, Shown, ShownProgram, Source};
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
use crate::machine::sequence::{Outcome, Step};
use crate::machine::state::State;
use crate::machine::tables::{Tables, lock};
use crate::operator::console::Operator;
use crate::operator::manual_mode;
use crate::operator::operator_loop::{LoopTask, Running};
use crate::operator::session;
use crate::operator::session::{Session, Task, Wire};
use crate::program::text::Text;
use crate::program::{Overview, check};
use crate::rt::shared::Command;
use motion::cancel::Cancel;
use serde_json::{Value, json};
use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::thread::{Scope, ScopedJoinHandle};

/// A program that was accepted.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) name: String,
    pub(super) text: Text,
    overview: Overview,
}

type Checked = Result<Part, String>;

/// Serves the clients of one session.
pub(super) struct Clients<'scope, 'env> {
    scope: &'scope Scope<'scope, 'env>,
    config: &'env Config,
    tables: &'env Mutex<Tables>,
    /// The session waits for programs; else it has its own.
    stands_by: bool,
    inbox: OrderInbox,
    checking: Option<Checking<'scope>>,
    part: Option<Arc<Part>>,
}

/// A program that is being checked.
struct Checking<'scope> {
    /// Who waits for it to begin; `None`: nobody any more, and it does not begin.
    wanted: Option<Ticket>,
    cancel: Cancel,
    thread: ScopedJoinHandle<'scope, Checked>,
}

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
        }
    }

    /// The program under way, or the last one.
    pub(super) fn part(&self) -> Option<&Arc<Part>> {
        self.part.as_ref()
    }

    /// Carries out what clients want. Waits for nothing.
    pub(super) fn serve(&mut self, operator: &mut Operator, now_ns: u64) -> std::io::Result<()> {
        // Orders first: a stop reaches a program that would begin in this turn.
        let mut answers = Vec::new();
        while let Some((ticket, order)) = self.inbox.next() {
            let done = match order {
                Order::Withdraw => {
                    self.withdraw(ticket);
                    continue;
                }
                // Whatever it is: nothing can be done any more.
                _ if operator.live().state == State::Silenced => Err(SILENCED.to_owned()),
                Order::Run(source) => match self.may_begin(operator) {
                    Ok(()) => {
                        let cancel = Cancel::default();
                        self.checking = Some(Checking {
                            wanted: Some(ticket),
                            thread: self.check(source, cancel.clone())?,
                            cancel,
                        });
                        continue;
                    }
                    Err(what) => Err(what),
                },
                Order::Jog(jog) => {
                    let begun = manual_mode::jog(&jog, self.config, operator);
                    answers.push((ticket, begun.map_err(|what| RpcError::new(code::REFUSED, what))));
                    continue;
                }
                Order::Stop if self.give_up_check() => Ok(()),
                Order::Enable => self
                    .may_begin(operator)
                    .and_then(|()| manual_mode::enable(operator, now_ns)),
                // During set-up it is the machine that decides.
                Order::Home if operator.step() != Step::SetUp => self
                    .may_begin(operator)
                    .and_then(|()| manual_mode::home(operator, now_ns)),
                Order::Home => manual_mode::home(operator, now_ns),
                Order::Hold
                | Order::Resume
                | Order::Reverse(_)
                | Order::SingleBlock(_)
                | Order::Stop
                | Order::Acknowledge => obey(&order, operator, now_ns),
            };
            let done = done
                .map(|()| json!({}))
                .map_err(|what| RpcError::new(code::REFUSED, what));
            answers.push((ticket, done));
        }
        if self
            .checking
            .as_ref()
            .is_some_and(|checking| checking.thread.is_finished())
            && let Some(Checking { wanted, thread, .. }) = self.checking.take()
        {
            let checked = thread
                .join()
                .unwrap_or_else(|_| Err("the check of the program panicked".into()));
            if let Some(ticket) = wanted {
                let answer = checked.and_then(|part| self.begin(part, operator, now_ns));
                answers.push((ticket, answer.map_err(|what| RpcError::new(code::REFUSED, what))));
            }
        }
        // Whoever has an answer sees what came of the order.
        let shown = self.shown(operator);
        self.inbox.show(shown);
        for (ticket, answer) in answers {
            self.inbox.answer(ticket, answer);
        }
        Ok(())
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
        if let Some(checking) = &mut self.checking
            && checking.wanted == Some(ticket)
        {
            checking.wanted = None;
            checking.cancel.cancel();
        }
    }

    fn may_begin(&self, operator: &Operator) -> Result<(), String> {
        if !self.stands_by {
            return Err("this control was started for one program; start it without a program to run others".into());
        }
        if self.checking.is_some() {
            return Err("another program is being checked".into());
        }
        if self.config.joints.is_empty() {
            return Err(self.config.without_joints());
        }
        match (operator.step(), operator.live().state) {
            (Step::StandBy, State::Disabled) => Ok(()),
            (Step::StandBy, State::Faulted) => {
                let cause = operator.alarm().map_or("a fault", |alarm| alarm.cause.as_str());
                Err(format!("{cause}; acknowledge it first: isocnc alarm acknowledge"))
            }
            (Step::StandBy, State::Booting) => Err("the network is not operational yet: isocnc bus state".into()),
            (step, state) => Err(format!("not while the machine is {} ({})", state.name(), step.name())),
        }
    }

    /// Reads and checks a program in a thread of its own: that may take seconds.
    fn check(&self, source: Source, cancel: Cancel) -> std::io::Result<ScopedJoinHandle<'scope, Checked>> {
        let (config, tables) = (self.config, self.tables);
        let work = move || {
            capabilities::give_up_or_warn(Work::Ordinary);
            let (name, text) = read(source)?;
            // Whoever edited a table while nothing ran wants it to count.
            let tables = {
                let mut tables = lock(tables);
                tables.refresh(config).map_err(|error| error.to_string())?;
                tables.clone()
            };
            let overview = check(config, &tables, &name, &text, &cancel).map_err(|errors| errors.to_string())?;
            Ok(Part { name, text, overview })
        };
        std::thread::Builder::new()
            .name("check".into())
            .spawn_scoped(self.scope, work)
    }

    fn begin(&mut self, part: Part, operator: &mut Operator, now_ns: u64) -> Result<Value, String> {
        // Things may have changed during the check.
        self.may_begin(operator)?;
        if !operator.begin(now_ns) {
            return Err("the machine is not ready for a program".into());
        }
        let warning = (part.overview.real_time.warning()).map(|(line, what)| format!("{}:{line}: {what}", part.name));
        if let Some(warning) = &warning {
            operator.add_entry(format!("warning: {warning}"));
        }
        let begun = json!({
            "program": part.name,
            "lines": part.overview.lines,
            "planned_time_s": part.overview.time_s,
            "real_time_factor": part.overview.real_time,
            "warning": warning,
        });
        self.part = Some(Arc::new(part));
        Ok(begun)
    }

    fn shown(&self, operator: &Operator) -> Shown {
        Shown {
            step: operator.step().name(),
            program: self.part.as_ref().map(|part| ShownProgram {
                name: part.name.clone(),
                lines: part.overview.lines,
                planned_time_s: part.overview.time_s,
                result: operator.program_outcome().map(|outcome| match outcome {
                    Outcome::Completed => "completed",
                    Outcome::Stopped => "stopped",
                    Outcome::Faulted => "faulted",
                    Outcome::TimedOut(_) => "timed out",
                }),
            }),
            alarm: operator.alarm().map(|alarm| alarm.cause.clone()),
            obstruction: operator.obstruction().map(str::to_owned),
        }
    }
}

fn read(source: Source) -> Result<(String, Text), String> {
    match source {
        Source::Text { name, text } => Ok((name, text.into_bytes().into())),
        Source::File(path) => {
            let name = path.display().to_string();
            let failed = |cause: std::io::Error| format!("{name}: {cause}");
            let text = Text::read(&path).map_err(failed)?;
            Ok((name, text))
        }
    }
}

fn obey(order: &Order, operator: &mut Operator, now_ns: u64) -> Result<(), String> {
    let state = operator.live().state;
    let refused = |wanted: &str| Err(format!("{wanted}; the machine is {}", state.name()));
    match order {
        Order::Run(_) | Order::Withdraw | Order::Enable | Order::Home | Order::Jog(_) => {
            refused("this is done elsewhere")
        }
        Order::Hold if matches!(state, State::Running | State::Jogging) => {
            operator.give(Command::Hold);
            Ok(())
        }
        Order::Hold => refused("nothing runs that could be held"),
        // Running: a program may wait for it (M0). Not one that was stopped in this turn: the machine has yet to hear of that.
        Order::Resume if matches!(state, State::Held | State::Running) && operator.step() == Step::Program => {
            operator.give(Command::Resume);
            Ok(())
        }
        Order::Resume => refused("nothing is held"),
        Order::Reverse(share) if matches!(state, State::Held | State::Running) && operator.step() == Step::Program => {
            operator.give(Command::Reverse(*share));
            Ok(())
        }
        Order::Reverse(_) => refused("no program runs or is held"),
        // Of a program that has not begun yet as well.
        Order::SingleBlock(on) => {
            operator.give(Command::SingleBlock(*on));
            Ok(())
        }
        Order::Stop => match operator.step() {
            Step::Enable | Step::Home | Step::SetUp | Step::Program | Step::Stop => {
                operator.stop(now_ns);
                Ok(())
            }
            Step::Network | Step::StandBy | Step::Disable | Step::ShutDown | Step::Done => {
                refused("there is no program to stop")
            }
        },
        Order::Acknowledge if operator.step() == Step::StandBy && operator.alarm().is_some() => {
            operator.acknowledge();
            Ok(())
        }
        Order::Acknowledge => refused("there is nothing to acknowledge"),
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
                false if self.to_journal => say(&format!("{}{}", logging::priority(entry.level()), told(entry))),
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
        clients.serve(&mut run.operator, now_ns).unwrap();
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
            for order in [Order::Acknowledge, Order::Enable, Order::Stop, run_order()] {
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
                for (ticket, order) in [run_order(), Order::Enable, Order::Home, Order::Jog(jog)]
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
