//! What clients want of the machine: each order is judged by the table of [`machine::permission`], then carried out.

mod executed;
mod given_up;
mod obey;
mod shown;

use executed::Executed;

use super::check::{Checked, Part, Subject, examine};
use super::pins::PIN_TICKET;
use super::streamed::Streamed;
use super::wishes::wish;
use crate::console::Operator;
use crate::table_writer::{Keeper, Mark};
use api::orders::{Order, OrderInbox, Source};
use api::paths::PathOrder;
use api::rpc::{RpcError, code};
use api::server::Ticket;
use config::Config;
use gcode::{InForce, Modes};
use host::capabilities;
use host::capabilities::Work;
use machine::permission::{Activity, Next, Power, Wish, permit};
use machine::sequence::{Job, Step};
use machine::state::State;
use machine::tables::{Tables, lock};
use motion::cancel::Cancel;
use motion::canon::Position;
use program::text::{Reader, Text};
use program::tool_path::{record_octets, trace};
use program::{Begin, Doubt, Overview, home};
use protocol::{Kept, Message, Mode, Outlook, PathBegun, RealTimeFactor, SlowStretch, message};
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, mpsc};
use std::thread::{Scope, ScopedJoinHandle};
use std::time::Duration;

/// Lines of MDI that wait for their turn.
const MDI_MAX: usize = 64;
/// Motion of lines of a stream that has to lie before the machine when its end is planned, s.
const END_KNOWN_S: f64 = 1.0;
const _: () = assert!(MDI_MAX < api::server::PENDING_MAX, "a stop behind them must be read");
/// Programs that are only looked at, at the same time.
const INSPECTED_MAX: usize = 2;
/// An order counts as carried out once what it changed is on the disk; one that takes longer than this is not waited for, ns.
const DISK_NS: u64 = 2_000_000_000;
/// How long drives may take to be off behind an acknowledge until an order that switches them on is refused.
const SETTLES_NS: u64 = 5_000_000_000;

/// What becomes of a program behind its check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Then {
    /// It is kept.
    Load,
    /// It runs so many times.
    Start { runs: u32 },
    /// It runs, once drives are on and joints are home.
    Run,
    /// It runs while it grows.
    Stream,
}

/// What was typed.
enum Typed {
    Line(String),
    /// Lines for a text that grows, and whether they are to have been executed.
    Lines(String, bool),
}

/// Serves the clients of one session.
pub(crate) struct Clients<'scope, 'env> {
    pub(super) scope: &'scope Scope<'scope, 'env>,
    pub(super) config: &'env Config,
    pub(super) tables: &'env Mutex<Tables>,
    /// The session waits for programs; else it has its own.
    stands_by: bool,
    pub(super) inbox: OrderInbox,
    pub(super) checking: Option<Checking<'scope>>,
    /// What runs, or ran last.
    part: Option<Arc<Part>>,
    /// The one program of a session that does not stand by, and its name.
    given: Option<(&'env str, &'env Overview)>,
    /// The program to start.
    loaded: Option<Arc<Part>>,
    pub(super) mode: Mode,
    /// Lines of MDI that wait for their turn, and who wants them.
    mdi: VecDeque<(Ticket, Typed, Option<String>)>,
    /// The text that grows, while it runs or is about to.
    streamed: Option<Streamed>,
    /// It is over.
    is_streamed_over: bool,
    /// Those in force for the next line of MDI; `None`: as at the start of a program.
    modes: Option<Arc<Modes>>,
    /// Those of what runs.
    executed: Option<Executed>,
    /// Those at the start of a program, and what they were taken of.
    initial: Option<(Tables, Modes)>,
    /// How often the machine had switched spindle and coolant off by the last look, and when the last program began.
    switched_off: [u64; 2],
    /// Some planner still works for the program that was the last one.
    is_planning: bool,
    /// Who has changed what the machine remembers, and hears once that is on the disk.
    unsettled: Vec<(Ticket, Unsettled)>,
    /// Orders that came before the cycle had taken the one in front of them.
    pub(super) early: VecDeque<(Ticket, Order, Option<String>)>,
    /// Since when drives go off behind an acknowledge or a reset, if they do.
    settles_since_ns: Option<u64>,
    /// Programs that are only looked at.
    inspected: Vec<(Ticket, Cancel, ScopedJoinHandle<'scope, Checked>)>,
    /// Ways of programs that are being drawn.
    drawn: Vec<(Cancel, ScopedJoinHandle<'scope, ()>)>,
    /// The last job has ended, and counts once what came of it is on the disk.
    ended: Option<Unsettled>,
}

/// A program that is being checked.
pub(super) struct Checking<'scope> {
    /// Who waits for it to begin; `None`: nobody any more, and it does not begin.
    pub(super) wanted: Option<Ticket>,
    then: Then,
    /// Who wanted it, for the journal.
    by: Option<String>,
    cancel: Cancel,
    pub(super) thread: ScopedJoinHandle<'scope, Checked>,
}

type Answer = Result<Value, Message>;

/// What is on its way to the disk, and since when.
#[derive(Clone, Copy, Debug)]
struct Unsettled {
    mark: Mark,
    since_ns: u64,
}

impl Unsettled {
    fn new(keeper: &Keeper<'_, '_>, operator: &Operator, now_ns: u64) -> Unsettled {
        Unsettled {
            mark: keeper.mark(operator),
            since_ns: now_ns,
        }
    }

    fn is_over(&self, keeper: &Keeper<'_, '_>, operator: &Operator, now_ns: u64) -> bool {
        keeper.is_settled(&self.mark, operator) || now_ns.saturating_sub(self.since_ns) > DISK_NS
    }
}

impl<'scope, 'env> Clients<'scope, 'env> {
    pub(crate) fn new(
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
            given: None,
            loaded: None,
            mode: Mode::default(),
            mdi: VecDeque::new(),
            streamed: None,
            is_streamed_over: false,
            modes: None,
            executed: None,
            initial: None,
            switched_off: [0; 2],
            is_planning: false,
            unsettled: Vec::new(),
            early: VecDeque::new(),
            settles_since_ns: None,
            inspected: Vec::new(),
            drawn: Vec::new(),
            ended: None,
        }
    }

    /// Of a session that runs this program and no other.
    pub(crate) fn of_program(self, name: &'env str, overview: &'env Overview) -> Clients<'scope, 'env> {
        let given = Some((name, overview));
        Clients { given, ..self }
    }

    /// What is under way, or was last.
    pub(crate) fn part(&self) -> Option<&Arc<Part>> {
        self.part.as_ref()
    }

    /// What runs from now on tells the modes of its blocks there.
    pub(crate) fn follow_modes(&mut self, heard: mpsc::Receiver<(u32, InForce)>) {
        let is_dry = self.part.as_ref().is_some_and(|part| part.dry_feed_min().is_some());
        self.executed = Some(Executed::new(heard, is_dry));
    }

    /// A program is over, and has left these modes if it came to its end. What follows the stop of a program begins as a program
    /// does; a line of MDI that was given up leaves those before it.
    pub(crate) fn adopt_modes(&mut self, modes: Option<Modes>) {
        self.executed = None;
        let [now, at_begin] = self.switched_off;
        let is_given_up = modes.is_none();
        let is_dry = self.part.as_ref().is_some_and(|part| part.dry_feed_min().is_some());
        if !is_given_up || !self.part.as_ref().is_some_and(|part| part.is_mdi()) {
            self.modes = modes.map(Arc::new);
        }
        // A dry run has not switched on what its text says.
        if now != at_begin || is_dry {
            self.switch_modes_off();
        }
        if is_given_up {
            self.refuse_queue(&message!("refused.line_given_up", "the line before it was given up"));
        } else if let Some(streamed) = &self.streamed {
            // Also where its reader has not come to its end: behind M2.
            streamed.text().close();
            self.is_streamed_over = true;
        }
    }

    /// What has been switched off stays off until a line names it again.
    fn switch_modes_off(&mut self) {
        if let Some(modes) = &mut self.modes {
            Arc::make_mut(modes).switch_off();
        }
    }

    /// Hands take over where they move something, and what is held has its orders again once it is on its way back.
    fn follow_mode(&mut self, operator: &Operator) {
        self.mode = match self.condition(operator).activity {
            Activity::Jogging | Activity::Away => Mode::Manual,
            Activity::Running | Activity::Held | Activity::Returning => match &self.part {
                Some(part) if part.is_mdi() => Mode::Mdi,
                _ => Mode::Auto,
            },
            Activity::Idle | Activity::Checking | Activity::Homing | Activity::Stopping => self.mode,
        };
    }

    /// Waits for an order of a client, this long at the most.
    pub(crate) fn wait(&mut self, longest: Duration) {
        self.inbox.wait(longest);
    }

    /// Carries out what clients want. Waits for nothing. `is_planning`: a planner still works for the last program.
    pub(crate) fn serve(
        &mut self,
        operator: &mut Operator,
        keeper: &mut Keeper<'_, '_>,
        is_planning: bool,
        now_ns: u64,
    ) {
        self.is_planning = is_planning;
        let switched_off = operator.live().switched_off;
        if std::mem::replace(&mut self.switched_off[0], switched_off) != switched_off {
            self.switch_modes_off();
        }
        if operator.take_stop_pressed() {
            self.stop(operator, now_ns);
        }
        let settles = operator.live().state == State::Disabling && operator.step() == Step::StandBy;
        self.settles_since_ns = settles.then(|| self.settles_since_ns.unwrap_or(now_ns));
        // Before the cycle has taken the start of a program, it shows where the one before was.
        if let Some(executed) = &mut self.executed {
            let live = operator.live();
            executed.follow(if operator.is_up_to_date() { live.modes } else { 0 });
        }
        self.follow_mode(operator);
        // Orders first: a stop reaches a program that would begin in this turn.
        let mut answers = Vec::new();
        self.follow_pins(operator, keeper);
        let mut early = std::mem::take(&mut self.early);
        // What the cycle has no room for waits here: it would be lost, a resume after its hold.
        while operator.has_room()
            && let Some((ticket, order, by)) = early.pop_front().or_else(|| {
                let (ticket, order) = self.inbox.take()?;
                Some((ticket, order, self.inbox.by()))
            })
        {
            if self.is_too_early(&order, operator, now_ns) {
                self.early.push_back((ticket, order, by));
                continue;
            }
            match order {
                Order::Withdraw => {
                    self.withdraw(ticket);
                    continue;
                }
                // What somebody else had ordered does not begin under the hand of another.
                Order::TakenOver(_) => {
                    self.refuse_queue(&message!("refused.control_lost", "another client has taken control"));
                    self.give_up_check();
                }
                _ => {}
            }
            operator.log_mut().set_by(by);
            let answer = self.obey(ticket, order, operator, keeper, now_ns);
            operator.log_mut().set_by(None);
            if let Some(answer) = answer {
                answers.push((ticket, answer.map_err(RpcError::from)));
            }
        }
        self.early.extend(early);
        self.finish_checks(operator, keeper, now_ns, &mut answers);
        self.serve_streamed(operator, &mut answers);
        if self.condition(operator).activity == Activity::Idle
            && self.streamed.is_none()
            && let Some((ticket, typed, by)) = self.mdi.pop_front()
        {
            operator.log_mut().set_by(by);
            match self.may(Wish::Mdi, operator) {
                Ok(()) => self.begin_typed(ticket, typed, operator, &mut answers),
                Err(why) => answers.push((ticket, Err(why.into()))),
            }
            operator.log_mut().set_by(None);
        }
        let (over, wait) = self
            .unsettled
            .drain(..)
            .partition::<Vec<_>, _>(|(_, order)| order.is_over(keeper, operator, now_ns));
        self.unsettled = wait;
        let warning = keeper.failure(operator).map(|why| format!("not kept: {why}"));
        let kept = json!(Kept { warning });
        answers.extend(over.into_iter().map(|(ticket, _)| (ticket, Ok(kept.clone()))));
        let has_ended = operator.job_outcome().is_some()
            && self.checking.is_none()
            && !self.is_planning
            && operator.is_up_to_date();
        self.ended = match self.ended {
            _ if !has_ended => None,
            None => Some(Unsettled::new(keeper, operator, now_ns)),
            ended => ended,
        };
        let is_settled = self.ended.is_some_and(|ended| ended.is_over(keeper, operator, now_ns));
        // Whoever has an answer sees what came of the order.
        let shown = self.shown(operator, keeper, is_settled);
        self.inbox.show(shown);
        for (ticket, answer) in answers {
            match answer {
                Err(why) if ticket == PIN_TICKET => {
                    operator.add_entry(message!("pin.refused", "pin: refused: {why}", why = *why.message));
                }
                answer => self.inbox.answer(ticket, answer),
            }
        }
    }

    /// Programs whose check is over are begun, loaded or told of.
    fn finish_checks(
        &mut self,
        operator: &mut Operator,
        keeper: &mut Keeper<'_, '_>,
        now_ns: u64,
        answers: &mut Vec<(Ticket, Result<Value, RpcError>)>,
    ) {
        if self
            .checking
            .as_ref()
            .is_some_and(|checking| checking.thread.is_finished())
            && let Some(Checking {
                wanted,
                then,
                by,
                thread,
                ..
            }) = self.checking.take()
        {
            let checked = thread
                .join()
                .unwrap_or_else(|_| Err("the check of the program panicked".to_owned().into()));
            if let Some(ticket) = wanted {
                operator.log_mut().set_by(by);
                let answer = checked.and_then(|part| Ok(self.accept(part, then, operator, keeper, now_ns)?));
                operator.log_mut().set_by(None);
                match (then, &answer) {
                    (Then::Stream, Err(why)) => self.refuse_queue(&why.message),
                    (Then::Stream, Ok(_)) => {}
                    _ => answers.push((ticket, answer)),
                }
            }
        }
        while let Some(at) = self.inspected.iter().position(|(_, _, thread)| thread.is_finished()) {
            let (ticket, _, thread) = self.inspected.swap_remove(at);
            let checked = thread
                .join()
                .unwrap_or_else(|_| Err("the check of the program panicked".to_owned().into()));
            answers.push((ticket, checked.map(|part| outlook(&part))));
        }
    }

    /// Hands lines to the text that grows, and answers who can be answered.
    fn serve_streamed(&mut self, operator: &Operator, answers: &mut Vec<(Ticket, Result<Value, RpcError>)>) {
        let activity = self.condition(operator).activity;
        if let Some(streamed) = self
            .streamed
            .take_if(|_| activity == Activity::Idle && self.is_streamed_over)
        {
            answers.extend(streamed.end(None));
        }
        let Some(streamed) = &mut self.streamed else { return };
        let is_at_rest = matches!(activity, Activity::Held | Activity::Away | Activity::Returning);
        streamed
            .text()
            .keep_open(is_at_rest || operator.live().remaining_s > END_KNOWN_S);
        while let Some((ticket, Typed::Lines(lines, wait), _)) = self.mdi.front() {
            match streamed.take(*ticket, lines, *wait) {
                Ok(true) => {}
                // It is the next text.
                Ok(false) => break,
                Err(cause) => answers.push((*ticket, Err(not_kept(&cause)))),
            }
            self.mdi.pop_front();
        }
        answers.extend(streamed.answers());
    }

    /// Begins what was typed.
    fn begin_typed(
        &mut self,
        ticket: Ticket,
        typed: Typed,
        operator: &Operator,
        answers: &mut Vec<(Ticket, Result<Value, RpcError>)>,
    ) {
        let modes = self.modes.clone();
        let (lines, wait) = match typed {
            Typed::Line(line) => {
                let subject = Subject::Mdi { line, modes };
                return self.check(ticket, subject, Then::Start { runs: 1 }, operator);
            }
            // All before it is over.
            Typed::Lines(lines, _) if lines.is_empty() => return answers.push((ticket, Ok(json!({})))),
            Typed::Lines(lines, wait) => (lines, wait),
        };
        let begun = Streamed::new().and_then(|mut streamed| {
            streamed.take(ticket, &lines, wait)?;
            Ok(streamed)
        });
        match begun {
            Ok(streamed) => {
                let text = Arc::new(Text::from(Arc::clone(streamed.text())));
                (self.streamed, self.is_streamed_over) = (Some(streamed), false);
                // Whoever waits for room or for the end is answered then.
                self.check(0, Subject::Lines { text, modes }, Then::Stream, operator);
            }
            Err(cause) => answers.push((ticket, Err(not_kept(&cause)))),
        }
    }

    /// Has the way of the program that is loaded drawn in a thread of its own.
    fn draw(&mut self, path: PathOrder, operator: &Operator) -> Answer {
        self.drawn.retain(|(_, thread)| !thread.is_finished());
        let Some(part) = self.loaded.clone().filter(|_| !self.config.joints.is_empty()) else {
            path.cancel.cancel();
            return Err(not_loaded());
        };
        let (config, tables) = (self.config, lock(self.tables).clone());
        let at = self.begin_of_programs(operator);
        let axes: Vec<String> = config.axes.iter().map(|map| map.axis.letter().to_string()).collect();
        let answer = json!(PathBegun {
            path: path.number,
            program: part.name.clone(),
            record_octets: record_octets(axes.len()),
            axes,
        });
        let cancel = path.cancel.clone();
        let spawned = std::thread::Builder::new()
            .name("path".into())
            .spawn_scoped(self.scope, move || {
                capabilities::give_up_or_warn(Work::Ordinary);
                let text = Reader::from(&*part.text);
                let how = (at, path.tolerance_mm);
                let ended = trace(config, &tables, &part.name, text, how, &path.cancel, |records| {
                    path.send(api::paths::Part::Records(records))
                });
                path.send(api::paths::Part::End(ended));
            });
        match spawned {
            Ok(thread) => {
                self.drawn.push((cancel, thread));
                Ok(answer)
            }
            // A PC that has no room for a picture goes on with the part.
            Err(cause) => {
                cancel.cancel();
                Err(format!("the path cannot be drawn now: {cause}").into())
            }
        }
    }

    /// Where a program would begin: where the machine stands, or as behind homing.
    fn begin_of_programs(&self, operator: &Operator) -> Position {
        match operator.not_homed() {
            0 => operator.live().position,
            _ => home(self.config),
        }
    }

    /// Whether nothing is under way but an order that the cycle has yet to take.
    pub(super) fn is_settling(&self, operator: &Operator) -> bool {
        let is_lost = operator.live().state == State::Silenced;
        operator.step() == Step::StandBy && !self.is_planning && !operator.is_up_to_date() && !is_lost
    }

    /// Whether an order can be judged once the cycle has taken the one before it, within a cycle or two; or, where it switches
    /// drives on, once they are off behind an acknowledge. What a hand orders does not wait for that.
    fn is_too_early(&self, order: &Order, operator: &Operator, now_ns: u64) -> bool {
        let switches_on = matches!(
            wish(order),
            Some(Wish::On | Wish::Home | Wish::Mdi | Wish::Start | Wish::Run)
        );
        let since_ns = self.settles_since_ns.filter(|_| switches_on);
        let waits = self.is_settling(operator) || since_ns.is_some_and(|since_ns| now_ns - since_ns < SETTLES_NS);
        waits && wish(order).is_some_and(|wish| self.may(wish, operator).is_err())
    }

    pub(super) fn may(&self, wish: Wish, operator: &Operator) -> Result<(), Message> {
        let mut condition = self.condition(operator);
        // Orders of a hand come faster than the cycle takes them; it looks itself whether each can be.
        if wish == Wish::Jog && self.is_settling(operator) {
            condition.activity = Activity::Jogging;
        }
        // That of a program that was wrong stops no drive.
        let is_powered = matches!(condition.power, Power::On | Power::Off);
        if wish == Wish::Acknowledge && is_powered && condition.activity == Activity::Idle && operator.alarm().is_some()
        {
            return Ok(());
        }
        permit(wish, &condition).map_err(|refusal| match operator.alarm() {
            // The first cause says more than that there is one.
            Some(alarm) if refusal.next == Next::Acknowledge => message!(
                "refused.alarm_stands",
                "{cause}; {next}",
                cause = alarm.cause.clone(),
                next = refusal.next.message()
            ),
            // It is told as it comes, and over only once the machine rests.
            Some(_) if wish == Wish::Acknowledge && condition.power == Power::On => {
                message!(
                    "refused.stops_for_alarm",
                    "the machine comes to rest for the alarm: wait until it has, then isocnc alarm acknowledge"
                )
            }
            _ => refusal.message(),
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

    fn begin(&mut self, job: Job, mode: Mode, operator: &mut Operator, now_ns: u64) -> Result<(), Message> {
        match operator.begin(now_ns, job) {
            true => {
                self.mode = mode;
                Ok(())
            }
            false => Err(message!(
                "refused.not_ready",
                "the machine is not ready for it: isocnc status tells how it is"
            )),
        }
    }

    /// Has it checked in a thread of its own.
    fn check(&mut self, ticket: Ticket, subject: Subject, then: Then, operator: &Operator) {
        let (config, tables) = (self.config, self.tables);
        let at = self.begin_of_programs(operator);
        self.mode = match subject {
            Subject::Mdi { .. } | Subject::Lines { .. } => Mode::Mdi,
            Subject::Program(_) | Subject::Loaded { .. } | Subject::FromLine { .. } => Mode::Auto,
        };
        let switched_off = operator.live().switched_off;
        let cancel = Cancel::default();
        let given_up = cancel.clone();
        let spawned = std::thread::Builder::new()
            .name("check".into())
            .spawn_scoped(self.scope, move || {
                examine(config, tables, at, subject, switched_off, &given_up)
            });
        match spawned {
            Ok(thread) => {
                self.checking = Some(Checking {
                    wanted: Some(ticket),
                    then,
                    by: operator.log().by(),
                    cancel,
                    thread,
                });
            }
            // Whatever runs goes on.
            Err(cause) => {
                let what = format!("it cannot be checked now: {cause}");
                self.inbox.answer(ticket, Err(RpcError::new(code::REFUSED, what)));
            }
        }
    }

    /// Checks a program and keeps nothing of it, whatever runs meanwhile.
    fn inspect(&mut self, ticket: Ticket, source: Source, operator: &Operator) -> Result<(), Message> {
        if self.config.joints.is_empty() {
            return Err(self.config.without_joints().into());
        }
        if self.inspected.len() >= INSPECTED_MAX {
            return Err(format!("{INSPECTED_MAX} programs are being checked already").into());
        }
        let (config, tables) = (self.config, self.tables);
        let at = self.begin_of_programs(operator);
        let switched_off = operator.live().switched_off;
        let cancel = Cancel::default();
        let given_up = cancel.clone();
        let thread = std::thread::Builder::new()
            .name("check".into())
            .spawn_scoped(self.scope, move || {
                examine(config, tables, at, Subject::Program(source), switched_off, &given_up)
            });
        let thread = thread.map_err(|cause| format!("it cannot be checked now: {cause}"))?;
        self.inspected.push((ticket, cancel, thread));
        Ok(())
    }

    /// A program has passed its check.
    fn accept(
        &mut self,
        part: Arc<Part>,
        then: Then,
        operator: &mut Operator,
        keeper: &mut Keeper<'_, '_>,
        now_ns: u64,
    ) -> Answer {
        if matches!(part.begin, Begin::Program { .. }) {
            self.loaded = Some(Arc::clone(&part));
        }
        if then == Then::Load {
            keeper.memory.load_program(&part.name);
        }
        match then {
            Then::Load => Ok(self.outlook(&part, operator)),
            Then::Start { .. } | Then::Run | Then::Stream => self.start(part, then, operator, now_ns),
        }
    }

    /// What is to be known of a program before it runs.
    fn outlook(&self, part: &Part, operator: &mut Operator) -> Value {
        for warning in warnings(part) {
            operator.add_warning(warning);
        }
        outlook(part)
    }

    fn start(&mut self, part: Arc<Part>, then: Then, operator: &mut Operator, now_ns: u64) -> Answer {
        let (wish, mode) = match (then, part.is_mdi()) {
            (_, true) => (Wish::Mdi, Mode::Mdi),
            (Then::Run, false) => (Wish::Run, Mode::Auto),
            (Then::Start { .. } | Then::Load | Then::Stream, false) => (Wish::Start, Mode::Auto),
        };
        // Things may have changed during the check.
        self.may(wish, operator)?;
        let switched_off = operator.live().switched_off;
        if part.is_mdi() && part.switched_off != switched_off {
            return Err(before_it_began());
        }
        let (missing, runs) = match then {
            Then::Run => (operator.not_homed(), 1),
            Then::Start { runs } => (0, runs),
            Then::Load | Then::Stream => (0, 1),
        };
        let home = operator.homing_order(missing);
        self.begin(Job::Program { home, runs }, mode, operator, now_ns)?;
        let begun = self.outlook(&part, operator);
        if part.is_mdi() {
            operator.add_entry(format!("MDI: {}", part.line));
        }
        if let Some(feed) = part.dry_feed_min() {
            operator.add_entry(format!(
                "dry run: moves at feed run at {feed} mm/min, spindle and coolant are not switched on"
            ));
        }
        self.switched_off[1] = switched_off;
        self.part = Some(part);
        Ok(begun)
    }
}

/// There is no program to do this with.
fn not_loaded() -> Message {
    let next = Next::LoadProgram.message();
    message!("refused.not_loaded", "no program is loaded: {next}", next = next)
}

/// It was given up before it began.
fn before_it_began() -> Message {
    message!("refused.before_it_began", "stopped before it began")
}

/// Lines cannot be taken, for this reason.
fn not_kept(cause: &std::io::Error) -> RpcError {
    RpcError::new(code::REFUSED, format!("the lines cannot be kept: {cause}"))
}

/// What whoever starts a program should know of it, a line each.
fn warnings(part: &Part) -> Vec<String> {
    let slow = part.overview.real_time.warning();
    let slow = slow.map(|(line, what)| format!("{}:{line}: {what}", part.name));
    slow.into_iter()
        .chain(part.doubts.iter().map(Doubt::to_string))
        .collect()
}

/// What is to be known of a program before it runs.
fn outlook(part: &Part) -> Value {
    let warning = Some(warnings(part).join("\n")).filter(|warning| !warning.is_empty());
    let real_time = &part.overview.real_time;
    json!(Outlook {
        program: part.name.clone(),
        revision: part.revision,
        lines: part.overview.lines,
        planned_time_s: part.overview.time_s,
        real_time_factor: RealTimeFactor {
            whole: real_time.whole,
            least: real_time.least.map(|least| SlowStretch {
                factor: least.factor,
                from_line: least.from_line,
                to_line: least.to_line,
                from_s: least.from_s,
                to_s: least.to_s,
            }),
        },
        warning,
    })
}
