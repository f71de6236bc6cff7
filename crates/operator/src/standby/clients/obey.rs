//! Orders of clients, carried out.
//!
//! In:  an order. Out: its answer, or nothing where that comes later.

use super::super::check::Subject;
use super::super::wishes::{is_told, moves, wish};
use super::executed::Executed;
use super::{Answer, Clients, MDI_MAX, Then, Typed, Unsettled};
use crate::console::Operator;
use crate::console::changed as changed_from;
use crate::manual_mode;
use crate::remembered;
use crate::table_writer::Keeper;
use api::orders::{Jogged, Order, Source};
use api::server::Ticket;
use config::Config;
use machine::permission::Wish;
use machine::sequence::Job;
use machine::state::State;
use machine::tables::lock;
use motion::canon::Axis;
use program::{Change, changed};
use protocol::{Lines, Message, Mode, Nothing, Offsets, Resumed, Skipped, message};
use rt::joint_jog::JogMotion;
use rt::shared::{ByHand, Command, Snapshot};
use rt::waiting::Waiting;
use rt::way_back::SLOW_MM;
use serde_json::json;
use std::sync::Arc;

impl Clients<'_, '_> {
    /// `None`: the answer comes later.
    pub(super) fn obey(
        &mut self,
        ticket: Ticket,
        order: Order,
        operator: &mut Operator,
        keeper: &mut Keeper<'_, '_>,
        now_ns: u64,
    ) -> Option<Answer> {
        if let Err(why) = self.admit(&order, operator) {
            return Some(Err(why));
        }
        let done = match order {
            // It has no answer.
            Order::Withdraw => return None,
            Order::Note(what) => noted(operator, what),
            Order::TakenOver(text) => noted(operator, text.into()),
            Order::Turned => {
                let by = operator.log().by();
                operator.turned(by);
                Ok(())
            }
            Order::Inspect(source) => return later(self.inspect(ticket, source, operator)),
            Order::Path(path) => return Some(self.draw(path, operator)),
            Order::Tools => return Some(Ok(json!(remembered::tools(&lock(self.tables), self.config.unit)))),
            Order::Offsets => return Some(Ok(json!(self.offsets()))),
            Order::Report(number) => return Some(report(number, keeper)),
            Order::MdiHistory => return Some(Ok(typed_before(keeper))),
            Order::Journal(since) => return Some(Ok(json!(remembered::journal(operator, since)))),
            Order::Parts { count, target } => {
                set_parts(count, target, operator, keeper);
                self.unsettled.push((ticket, Unsettled::new(keeper, operator, now_ns)));
                return None;
            }
            Order::On => self.begin(Job::On, Mode::Manual, operator, now_ns),
            Order::Off => {
                self.give_up_check();
                self.refuse_queue(&message!("refused.switched_off", "drives are switched off"));
                operator.off(now_ns);
                Ok(())
            }
            Order::Home(joints) => self.home(&joints, operator, now_ns),
            Order::Load(source) => return later(self.load(ticket, source, operator)),
            Order::Run(source) => {
                self.check(ticket, Subject::Program(source), Then::Run, operator);
                return None;
            }
            Order::Start {
                from_line,
                yes,
                runs,
                dry_feed_min,
                revision,
            } => {
                let subject = self.loaded_subject(from_line, yes, dry_feed_min, revision);
                let begin = |subject| self.check(ticket, subject, Then::Start { runs }, operator);
                return later(subject.map(begin));
            }
            Order::Mdi(_) | Order::Lines { .. } if self.mdi.len() >= MDI_MAX => Err(message!(
                "refused.lines_wait",
                "{lines} lines wait already",
                lines = MDI_MAX
            )),
            Order::Mdi(line) => {
                keeper.memory.add_mdi(&line);
                return self.queue(ticket, Typed::Line(line), operator);
            }
            Order::Lines { text, wait } => return self.queue(ticket, Typed::Lines(text, wait), operator),
            Order::Change(change) => {
                let changed = self.change(&change, operator, keeper);
                let settle = |()| self.unsettled.push((ticket, Unsettled::new(keeper, operator, now_ns)));
                return later(changed.map(settle));
            }
            Order::Jog(jog) => {
                self.mode = Mode::Manual;
                if matches!(jog.motion, JogMotion::Run { .. } | JogMotion::Advance { .. }) {
                    let by = operator.log().by();
                    operator.jogged(by);
                }
                return Some(manual_mode::jog(&jog, self.config, operator).map(|outlook| json!(outlook)));
            }
            Order::Resume => {
                let returns = way_back(&operator.live(), self.config);
                operator.give(Command::Resume);
                return Some(Ok(json!(Resumed { returns })));
            }
            Order::Skip => return Some(skip(operator)),
            Order::ToolChanged => tool_changed(operator),
            Order::BlockDelete(on) => {
                lock(self.tables).block_delete = on;
                Ok(())
            }
            Order::Spindle(rpm) => by_hand(operator, [Some(ByHand::Spindle(rpm)), None]),
            Order::Coolant { flood, mist } => by_hand(operator, [flood.map(ByHand::Flood), mist.map(ByHand::Mist)]),
            Order::Hold => given(operator, Command::Hold),
            Order::Reverse(share) => given(operator, Command::Reverse(share)),
            // Of a program that has not begun yet as well.
            Order::SingleBlock(on) => given(operator, Command::SingleBlock(on)),
            Order::OptionalStop(on) => given(operator, Command::OptionalStop(on)),
            Order::Stop => {
                self.stop(operator, now_ns);
                Ok(())
            }
            Order::Estop => {
                self.give_up_check();
                self.refuse_queue(&message!("refused.emergency_stop", "emergency stop"));
                operator.estop();
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
        Some(done.map(|()| json!(Nothing {})))
    }

    /// Lines behind those that wait.
    fn queue(&mut self, ticket: Ticket, typed: Typed, operator: &Operator) -> Option<Answer> {
        self.mdi.push_back((ticket, typed, operator.log().by()));
        None
    }

    /// Whether an order may be carried out now. One that the machine does is told in the journal.
    fn admit(&self, order: &Order, operator: &mut Operator) -> Result<(), Message> {
        // Whatever it is: nothing can be done any more.
        if operator.live().state == State::Silenced {
            return Err(operator.silenced().clone());
        }
        let Some(wish) = wish(order) else { return Ok(()) };
        self.permits(order, wish, operator)?;
        if is_told(order) {
            operator.add_entry(wish.message());
        }
        Ok(())
    }

    /// Whether the machine may do this now.
    fn permits(&self, order: &Order, wish: Wish, operator: &Operator) -> Result<(), Message> {
        if moves(wish) && self.config.joints.is_empty() {
            return Err(self.config.without_joints().into());
        }
        self.may(wish, operator).or_else(|why| {
            // Lines of MDI wait behind those that run.
            let waits = matches!(order, Order::Mdi(_) | Order::Lines { .. }) && self.is_mdi_under_way(operator);
            if waits { Ok(()) } else { Err(why) }
        })
    }

    fn offsets(&self) -> Offsets {
        let tables = lock(self.tables);
        let executed = self.executed.as_ref().and_then(Executed::now);
        let system = executed.map_or(tables.work_system(), |modes| modes.work_system());
        remembered::offsets(&tables, self.config, system)
    }

    fn home(&mut self, joints: &[usize], operator: &mut Operator, now_ns: u64) -> Result<(), Message> {
        let joints = self.joints_to_home(joints)?;
        match operator.homing_order(joints) {
            order if order.is_empty() => Err("none of these joints has a home".into()),
            order => self.begin(Job::Home(order), Mode::Manual, operator, now_ns),
        }
    }

    fn joints_to_home(&self, joints: &[usize]) -> Result<u64, Message> {
        if joints.is_empty() {
            return Ok(u64::MAX);
        }
        joints.iter().try_fold(0, |all, joint| {
            Ok(all | manual_mode::joints(Jogged::Joint(*joint), self.config)?)
        })
    }

    fn load(&mut self, ticket: Ticket, source: Source, operator: &Operator) -> Result<(), Message> {
        // It would be shown in the place of what is about to run.
        if operator.has_program() {
            return Err(message!(
                "refused.about_to_run",
                "a program is about to run: wait for it, or isocnc stop"
            ));
        }
        // Beside homing and jogs, too.
        if self.checking.is_some() {
            return Err(message!(
                "refused.other_check",
                "another program is being checked: wait for it, or isocnc stop"
            ));
        }
        self.check(ticket, Subject::Program(source), Then::Load, operator);
        Ok(())
    }

    /// The program that is loaded, as it is to be started.
    fn loaded_subject(
        &self,
        from_line: Option<u32>,
        yes: bool,
        dry_feed_min: Option<f64>,
        revision: Option<u64>,
    ) -> Result<Subject, Message> {
        let loaded = self.loaded.clone();
        let part = loaded.ok_or_else(|| message!("refused.nothing_loaded", "no program is loaded"))?;
        if revision.is_some_and(|revision| revision != part.revision) {
            return Err(message!(
                "refused.other_program",
                "another program is loaded by now: {name}: look at it, then start it",
                name = &part.name
            ));
        }
        let dry_feed_s = dry_feed_min.map(|feed| feed / 60.0);
        Ok(match from_line {
            Some(line) => Subject::FromLine {
                part,
                line,
                yes,
                dry_feed_s,
            },
            None => Subject::Loaded { part, dry_feed_s },
        })
    }

    /// Changes what the machine remembers.
    fn change(&mut self, change: &Change, operator: &mut Operator, keeper: &mut Keeper<'_, '_>) -> Result<(), Message> {
        if let Some(axis) = change.axis() {
            manual_mode::joints(Jogged::Axis(axis), self.config)?;
        }
        // What somebody else has written into the files meanwhile stays.
        if keeper.is_written() {
            lock(self.tables)
                .refresh(self.config)
                .map_err(|error| error.to_string())?;
        }
        let at = operator.live().position;
        let left = changed(self.config, &lock(self.tables), at, self.modes.as_deref(), change)?;
        // Reading and motion follow the length that is in force.
        if let (Some(tool), Some(modes)) = (change.tool(), &mut self.modes) {
            Arc::make_mut(modes).use_offset_of(tool, &left.tools);
        }
        for what in keeper.hand_in(left) {
            operator.add_entry(what);
        }
        if let Change::Tool(tool) = change {
            keeper.set_life(tool.number, &tool.life, operator);
        }
        Ok(())
    }
}

/// Into the journal.
fn noted(operator: &mut Operator, what: Message) -> Result<(), Message> {
    operator.add_entry(what);
    Ok(())
}

/// The report of a program by its number, or the last one.
fn report(number: Option<u64>, keeper: &Keeper<'_, '_>) -> Answer {
    let report = keeper.memory.reports().find(number);
    report.map(|report| json!(report)).map_err(Message::from)
}

/// The lines of MDI that were typed last.
fn typed_before(keeper: &Keeper<'_, '_>) -> serde_json::Value {
    json!(Lines {
        lines: keeper.memory.now().mdi.clone()
    })
}

/// Sets the counter of parts, and how many are wanted; 0: nobody says.
fn set_parts(count: Option<u64>, target: Option<u64>, operator: &mut Operator, keeper: &mut Keeper<'_, '_>) {
    let mut parts = keeper.memory.now().parts;
    let before = parts;
    parts.count = count.unwrap_or(parts.count);
    parts.target = target.map_or(parts.target, |target| Some(target).filter(|target| *target > 0));
    keeper.memory.set_parts(parts);
    operator.add_entry(message!(
        "order.parts",
        "order: parts {parts}",
        parts = parts.to_string()
    ));
    let number = |value: u64| value as f64;
    if parts.count != before.count {
        let what = message!("changed.parts", "parts");
        operator.add_entry(changed_from(what, number(before.count), number(parts.count)));
    }
    if parts.target != before.target {
        let what = message!("changed.parts_target", "parts wanted");
        let [from, to] = [before.target, parts.target].map(|target| number(target.unwrap_or(0)));
        operator.add_entry(changed_from(what, from, to));
    }
}

/// The answer comes later, where the order is not refused.
fn later(begun: Result<(), Message>) -> Option<Answer> {
    begun.err().map(Err)
}

fn given(operator: &mut Operator, command: Command) -> Result<(), Message> {
    operator.give(command);
    Ok(())
}

/// Switches spindle or coolant; of a program that runs, only where it waits for the operator.
fn by_hand(operator: &mut Operator, all: [Option<ByHand>; 2]) -> Result<(), Message> {
    let live = operator.live();
    if live.state == State::Running && live.waiting != Some(Waiting::Operator) {
        return Err(message!(
            "refused.not_by_hand",
            "a program runs: isocnc hold first, or a pause of its own (M0)"
        ));
    }
    for what in all.into_iter().flatten() {
        operator.give(Command::ByHand(what));
    }
    Ok(())
}

/// Gives up the block that the program waits in.
fn skip(operator: &mut Operator) -> Answer {
    match operator.live().waiting {
        Some(waiting) if waiting.can_be_skipped() => {
            operator.give(Command::Skip(waiting));
            let skips = waiting.message();
            Ok(json!(Skipped { skips }))
        }
        Some(waiting) => Err(message!(
            "refused.not_skippable",
            "{what}: that cannot be left out; what releases it: {release}",
            what = waiting.message(),
            release = waiting.release()
        )),
        None => Err(message!(
            "refused.in_motion",
            "a move is under way: what follows would begin elsewhere than it was programmed; isocnc stop, then isocnc program start \
             --from-line N tells the way to another block and goes it"
        )),
    }
}

/// The tool that the program waits for is in the spindle.
fn tool_changed(operator: &mut Operator) -> Result<(), Message> {
    match operator.live().waiting {
        Some(Waiting::ToolChange { .. }) => given(operator, Command::ToolChanged),
        _ => Err(message!(
            "refused.no_tool_change",
            "nothing waits for a tool: isocnc status tells how the machine is"
        )),
    }
}

/// How the machine returns to where the program is held, if it is elsewhere: one sentence a leg.
fn way_back(live: &Snapshot, config: &Config) -> Option<Vec<Message>> {
    let (at, to) = (live.position, live.held_at?);
    let axes = || config.axes.iter().map(|map| map.axis);
    let beside = axes().filter(|axis| *axis != Axis::Z && at[*axis] != to[*axis]);
    let beside: Vec<String> = beside.map(|axis| format!("{}{:.3}", axis.letter(), to[axis])).collect();
    let mut way = Vec::new();
    if axes().any(|axis| axis == Axis::Z) && at[Axis::Z] < to[Axis::Z] {
        way.push(message!("way.up", "Z up to {z:.3}", z = to[Axis::Z]));
    }
    if !beside.is_empty() {
        way.push(beside.join(" ").into());
    }
    if axes().any(|axis| axis == Axis::Z) && at[Axis::Z] > to[Axis::Z] {
        way.push(message!(
            "way.down",
            "Z down to {z:.3}, the last {slowly} mm slowly",
            z = to[Axis::Z],
            slowly = SLOW_MM
        ));
    }
    Some(way)
}
