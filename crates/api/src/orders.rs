//! The operator's inbox: what clients of the control socket want of him, his answers, and what lies open there to read.
//!
//! In:  orders, from the service thread. Out: one answer for each, some when it is carried out; [`Shown`], at any time.
//!
//! Neither side waits for the other. The lock around [`Shown`] is between two ordinary threads.

use crate::paths::PathOrder;
use crate::rpc::RpcError;
use crate::server::door::GUESTS_MAX;
use crate::server::{CLIENTS_MAX, PENDING_MAX, Ticket};
use crate::uploads::Uploaded;
use machine::journal::Entry;
use machine::state_file::{LastProgram, Parts};
use motion::canon::Axis;
use nix::sys::eventfd::{EfdFlags, EventFd};
use program::Change;
use program::outline::Outline;
use program::text::Text;
use protocol::{Activity, Message, Mode, Next, Outcome, Power, Step, Waiting};
use rt::joint_jog::JogMotion;
use serde::Serialize;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Orders that can wait: all that all clients can have under way, and that each of them has gone. A stop always has room.
const ORDERS: usize = 2 * (CLIENTS_MAX + GUESTS_MAX) * PENDING_MAX;
/// Between two looks of the operator, however many orders come.
const LEAST_PAUSE: Duration = Duration::from_millis(1);

/// What a client wants.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Switch drives on; nothing moves.
    On,
    /// Come to rest, then switch drives off.
    Off,
    /// Home these joints, all if none is named; drives are switched on first if they are off, and stay on.
    Home(Vec<usize>),
    /// Check a program and keep it.
    Load(Source),
    /// Run the program that is loaded so many times: from its beginning, or once before a line, if that was agreed to.
    Start {
        from_line: Option<u32>,
        yes: bool,
        runs: u32,
        /// Dry, with this feed, mm/min or degrees/min.
        dry_feed_min: Option<f64>,
        /// Only if the program that is loaded is the one of this [`ShownProgram::revision`].
        revision: Option<u64>,
    },
    /// Switch drives on, home what is not homed, load and run a program.
    Run(Source),
    /// Check a program and keep nothing of it.
    Inspect(Source),
    /// Run a line that was typed, behind those that wait.
    Mdi(String),
    /// Run lines behind those that wait, with nothing that stops between them; answered when there is room for more, or with `wait`
    /// once all of them have been executed.
    Lines { text: String, wait: bool },
    /// Change what the machine remembers.
    Change(Change),
    /// Move joints by hand.
    Jog(Jog),
    /// Come to rest on the path, keep the program.
    Hold,
    /// Go on after a hold; in single block, with the next block.
    Resume,
    /// Run back along the path, at this share of its speed.
    Reverse(f64),
    /// Turn the spindle, 1/min, counter-clockwise below 0; 0: stop it.
    Spindle(f64),
    /// Flood and mist, where they are to change.
    Coolant { flood: Option<bool>, mist: Option<bool> },
    /// Whether to rest at the end of each block.
    SingleBlock(bool),
    /// Whether M1 stops.
    OptionalStop(bool),
    /// Whether lines that begin with / are left out, of what is begun from now on.
    BlockDelete(bool),
    /// Give up the block that the program waits in without moving, and go on with the next one.
    Skip,
    /// The tool that the program waits for is in the spindle.
    ToolChanged,
    /// Come to rest on the path and give the program up; drives stay on.
    Stop,
    /// Emergency stop.
    Estop,
    /// The emergency stop is over.
    EstopReset,
    /// Allow motion again after a fault whose cause is gone.
    Acknowledge,
    /// Show the work offsets.
    Offsets,
    /// Show the tools.
    Tools,
    /// Show the journal behind this number.
    Journal(u64),
    /// Write this into the journal.
    Note(Message),
    /// Overrides have been turned by the client that gives this, which the journal tells once they rest.
    Turned,
    /// Show the report of a program by its number, or the last one.
    Report(Option<u64>),
    /// Draw the way of the program that is loaded.
    Path(PathOrder),
    /// Show the lines of MDI that were typed last.
    MdiHistory,
    /// Set the counter of parts, and how many are wanted (0: nobody says).
    Parts { count: Option<u64>, target: Option<u64> },
    /// Another client has taken control by force, as this entry of the journal says: what waits of the one before shall not begin.
    TakenOver(String),
    /// Whoever gave the order of this ticket has gone: what has not begun shall not begin. Has no answer.
    Withdraw,
}

/// What to move by hand, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jog {
    /// What is to move; `None`: whatever moves, for [`JogMotion::Keep`] and [`JogMotion::Release`].
    pub what: Option<Jogged>,
    pub motion: JogMotion,
}

/// What can be moved by hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Jogged {
    /// All joints of an axis.
    Axis(Axis),
    /// One joint, and those that cannot but move with it.
    Joint(usize),
}

/// Where a program comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A file that the control may read.
    File(PathBuf),
    /// The text itself, and its name for messages.
    Text { name: String, text: String },
    /// What a client has sent in parts.
    Uploaded(Uploaded),
}

/// What lies open on the inbox.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Shown {
    /// Step of the sequence.
    pub step: Step,
    /// Whether the machine can move.
    pub power: Power,
    /// What is going on.
    pub activity: Activity,
    /// Whose orders the machine follows, or followed last.
    pub mode: Mode,
    /// The program that is under way; else the one that is loaded, which is the one to start.
    pub program: Option<ShownProgram>,
    /// Its text.
    #[serde(skip)]
    pub text: Option<ShownText>,
    /// How the last order that takes time ended, once it has.
    pub job: Option<Outcome>,
    /// The line of MDI under way, and those that wait behind it.
    pub mdi: Vec<String>,
    /// What a machine that waits waits for.
    pub waiting: Option<Waiting>,
    /// G and M codes in force: of what runs, at the block that is executed; else for the next line of MDI.
    pub codes: Vec<String>,
    /// What is to be subtracted from machine coordinates, mm and degrees, and by how much X and Y are then to be turned back, for those
    /// of the work system in force there.
    pub work_offset: Vec<f64>,
    pub work_rotation_degrees: f64,
    /// What to do next for a program to run; `None`: it could be started.
    pub next: Option<Next>,
    /// Lines that begin with / are left out.
    pub block_delete: bool,
    /// Tool in the spindle, 0: none.
    pub tool: u32,
    /// Why the machine stopped by itself; stands until it is acknowledged or another program begins.
    pub alarm: Option<Message>,
    /// Entries of alarms that nobody has acknowledged, the first cause first.
    pub alarms: Vec<Entry>,
    /// What ended the last jog, if something was in its way.
    pub obstruction: Option<Message>,
    /// The last entries of the journal, the newest last.
    pub messages: Vec<Entry>,
    /// Parts made, and wanted.
    pub parts: Parts,
    /// How often the program under way is to be begun behind this time.
    pub runs_left: u32,
    /// The program that was loaded or begun last, by an earlier control as well, and the line that it had reached.
    pub last_program: Option<LastProgram>,
}

/// Entries of [`Shown::messages`].
pub const MESSAGES: usize = 8;

/// The text of a program of [`Shown`].
#[derive(Clone, Debug)]
pub struct ShownText {
    /// As of [`ShownProgram::revision`].
    pub revision: u64,
    pub text: Arc<Text>,
}

impl PartialEq for ShownText {
    fn eq(&self, other: &ShownText) -> bool {
        self.revision == other.revision
    }
}

/// A program of [`Shown`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShownProgram {
    pub name: String,
    /// Another one for each text that is loaded; 0: there is no text to be had.
    pub revision: u64,
    /// Its last line with something to do.
    pub lines: u32,
    /// Planned time, s.
    pub planned_time_s: f64,
    /// Tools that it changes to, in the order of their first use.
    pub tools: Vec<u32>,
    /// It runs dry, or has.
    pub dry_run: bool,
    /// What is left of it at any place, while it runs.
    #[serde(skip)]
    pub outline: Option<Outline>,
    /// How it ended, once it has.
    pub result: Option<Outcome>,
}

/// The clients' side.
#[derive(Debug)]
pub struct OrderClient {
    orders: SyncSender<Given>,
    answers: Receiver<(Ticket, Result<Value, RpcError>)>,
    shown: Arc<Mutex<Shown>>,
    wake: Option<Arc<EventFd>>,
}

/// An order as it is given: its ticket, and the name of the client that gives it.
type Given = (Ticket, Order, Option<String>);

/// The operator's side.
#[derive(Debug)]
pub struct OrderInbox {
    orders: Receiver<Given>,
    answers: Sender<(Ticket, Result<Value, RpcError>)>,
    shown: Arc<Mutex<Shown>>,
    latest: Shown,
    /// What has ended a wait.
    first: Option<Given>,
    /// Who has given the order that was taken last.
    by: Option<String>,
    /// Ends a wait of the clients' side; `None`: it looks now and then.
    wake: Option<Arc<EventFd>>,
}

pub fn order_channel() -> (OrderClient, OrderInbox) {
    let (orders, orders_out) = sync_channel(ORDERS);
    let (answers_in, answers) = channel();
    let shown = Arc::new(Mutex::new(Shown::default()));
    let flags = EfdFlags::EFD_NONBLOCK | EfdFlags::EFD_CLOEXEC;
    let wake = EventFd::from_flags(flags).ok().map(Arc::new);
    let client = OrderClient {
        orders,
        answers,
        shown: Arc::clone(&shown),
        wake: wake.clone(),
    };
    let inbox = OrderInbox {
        orders: orders_out,
        answers: answers_in,
        shown,
        latest: Shown::default(),
        first: None,
        by: None,
        wake,
    };
    (client, inbox)
}

impl OrderClient {
    /// Puts an order on the inbox; its answer comes with the ticket.
    ///
    /// # Errors
    /// There is no room, or nobody at the inbox.
    pub fn put(&self, ticket: Ticket, order: Order) -> Result<(), &'static str> {
        self.put_by(ticket, order, None)
    }

    /// The same, of the client of this name.
    ///
    /// # Errors
    /// As [`OrderClient::put`].
    pub fn put_by(&self, ticket: Ticket, order: Order, by: Option<String>) -> Result<(), &'static str> {
        self.orders.try_send((ticket, order, by)).map_err(|error| match error {
            TrySendError::Full(_) => "too many orders at once",
            TrySendError::Disconnected(_) => "the control is ending",
        })
    }

    /// Says that nobody waits for the answer to an order any more. False: there is no room, say it again.
    pub fn withdraw(&self, ticket: Ticket) -> bool {
        !matches!(
            self.orders.try_send((ticket, Order::Withdraw, None)),
            Err(TrySendError::Full(_))
        )
    }

    /// An answer that is ready.
    pub fn answer(&self) -> Option<(Ticket, Result<Value, RpcError>)> {
        self.answers.try_recv().ok()
    }

    /// What is written to when there is an answer or something else lies open.
    pub fn wake(&self) -> Option<Arc<EventFd>> {
        self.wake.clone()
    }

    /// What lies open.
    pub fn shown(&self) -> Shown {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl OrderInbox {
    /// The next order.
    pub fn take(&mut self) -> Option<(Ticket, Order)> {
        let (ticket, order, by) = self.first.take().or_else(|| self.orders.try_recv().ok())?;
        self.by = by;
        Some((ticket, order))
    }

    /// The client that has given the order that was taken last, where that is known.
    pub fn by(&self) -> Option<String> {
        self.by.clone()
    }

    /// Waits for an order, this long at the most, and a little even where there is one: so many that they come all the time are
    /// taken together.
    pub fn wait(&mut self, longest: Duration) {
        let least = longest.min(LEAST_PAUSE);
        std::thread::sleep(least);
        if self.first.is_none() {
            match self.orders.recv_timeout(longest - least) {
                Ok(order) => self.first = Some(order),
                Err(RecvTimeoutError::Timeout) => {}
                // Nobody is at the other end.
                Err(RecvTimeoutError::Disconnected) => std::thread::sleep(longest - least),
            }
        }
    }

    fn wake(&self) {
        if let Some(wake) = &self.wake {
            // It cannot be so full that it would have to wait.
            let _ = wake.write(1);
        }
    }

    pub fn answer(&self, ticket: Ticket, result: Result<Value, RpcError>) {
        // Nobody reads it any more where the service thread has ended.
        let _ = self.answers.send((ticket, result));
        self.wake();
    }

    /// Shows how things are.
    pub fn show(&mut self, shown: Shown) {
        if shown != self.latest {
            self.latest.clone_from(&shown);
            *self.shown.lock().unwrap_or_else(PoisonError::into_inner) = shown;
            self.wake();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_and_answers_keep_their_tickets() {
        let (client, mut inbox) = order_channel();
        client.put(7, Order::Hold).unwrap();
        client.put_by(8, Order::Stop, Some("panel".into())).unwrap();
        assert_eq!((inbox.take(), inbox.by()), (Some((7, Order::Hold)), None));
        assert_eq!(
            (inbox.take(), inbox.by()),
            (Some((8, Order::Stop)), Some("panel".into()))
        );
        assert_eq!((inbox.take(), client.answer()), (None, None));
        inbox.answer(8, Ok(Value::Null));
        assert_eq!(client.answer(), Some((8, Ok(Value::Null))));
        let shown = Shown {
            alarm: Some("x-drive lost".into()),
            obstruction: None,
            ..Shown::default()
        };
        inbox.show(shown.clone());
        assert_eq!(client.shown(), shown);
    }

    /// Else a client that floods the control with orders would keep the stop of another one out.
    #[test]
    fn there_is_room_for_all_that_clients_can_have_under_way() {
        let (client, _inbox) = order_channel();
        let all = 0..((CLIENTS_MAX + GUESTS_MAX) * PENDING_MAX) as u64;
        for ticket in all.clone() {
            client.put(ticket, Order::Hold).unwrap();
        }
        assert!(all.into_iter().all(|ticket| client.withdraw(ticket)));
    }

    #[test]
    fn neither_side_waits() {
        let (client, inbox) = order_channel();
        for ticket in 0..ORDERS as u64 {
            client.put(ticket, Order::Hold).unwrap();
        }
        assert_eq!(client.put(99, Order::Stop), Err("too many orders at once"));
        assert!(!client.withdraw(3));
        drop(inbox);
        assert!(client.withdraw(3));
        assert_eq!(client.put(99, Order::Stop), Err("the control is ending"));
    }
}
