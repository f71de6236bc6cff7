//! A sender, from its greeting to its end.
//!
//! In:  its octets; answers of the control. Out: octets for it; orders for the control.
//!
//! Lines are taken one after the other. One that must be answered only when the machine has come to it keeps those behind it waiting,
//! in the sender's own 128 octets; real-time octets go on meanwhile.

mod dollar;
mod jog;
mod lines;
mod real_time;

use crate::modes::Modes;
use crate::number::{AlarmNumber, ErrorNumber};
use crate::octets::{Input, Inputs};
use crate::reports::{self, Offsets, VERSION};
use crate::status::{Activity, Machine, Reporter, Seen, Status};
use jog::Jog;
use std::collections::VecDeque;
use std::fmt::Display;

/// Lines that wait here for the control to have room for them, octets; beyond that, `ok` waits.
pub const WAITING_MAX: usize = 4096;
/// Octets that are taken at once, at the most: each of them may be a line.
pub const TAKE_MAX: usize = 1024;
/// Inputs that wait behind a line that is not answered yet, before what is taken at once. A sender that counts its octets never has more
/// than fit into 128.
const INPUTS_MAX: usize = 512;
/// What Grbl has room for: lines, octets.
const ROOM: [usize; 2] = [15, 128];
/// What the control is to do. Each is answered once, by [`Session::answered`].
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Tell how the machine is: [`Answer::Status`].
    Status,
    /// Tell the offsets: [`Answer::Offsets`].
    Offsets,
    /// Run these lines behind those before them, without a stop between them. Answered when the control has read so far that more can
    /// come; with `wait`, when all of them have been executed. Without text, with `wait`: answered when all before it has been executed.
    Lines {
        /// Lines with their ends.
        text: String,
        /// Answered once they have been executed.
        wait: bool,
    },
    /// Run a line that probes: answered when it is over, by [`Answer::Probed`].
    Probe {
        /// The line with its end.
        text: String,
    },
    /// Move by hand, on top of what is still to go: mm, mm/s along each axis. Answered when it has begun.
    Jog {
        /// Along X, Y and Z.
        distance_mm: [f64; 3],
        /// The same sign as the distance.
        velocity_mm_s: [f64; 3],
    },
    /// Let what is jogged come to rest.
    StopJog,
    /// To rest on the path.
    Hold,
    /// On after a hold, or what somebody was waited for is done.
    Resume,
    /// To rest; what runs is given up.
    Stop,
    /// Home all joints: answered when they are, or when that has failed.
    Home,
    /// Acknowledge an alarm, switch drives on if they are off.
    Unlock,
    /// Switch drives off.
    Off,
    /// Moves at feed run at this many percent of what is programmed.
    Feed(u16),
    /// The same for rapid moves.
    Rapid(u16),
    /// The same for the spindle.
    Spindle(u16),
}

/// What came of an order.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// It is carried out, or has begun.
    Done,
    /// How the machine is.
    Status(Box<Status>),
    /// Its offsets.
    Offsets(Box<Offsets>),
    /// A probing move is over.
    Probed {
        /// Where it touched something, machine coordinates, mm.
        place_mm: [f64; 3],
        /// Whether it did.
        touched: bool,
    },
}

/// Why nothing is taken for the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Busy {
    /// This order has to be answered, and how then.
    On(u32, Then),
    /// The line that was taken last has no room yet.
    Room,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Then {
    Ok,
    Unlocked,
    Offsets,
    Probed,
}

/// Why lines are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lock {
    /// An alarm of the control, told to the sender.
    Alarm,
    /// Reset while something moved: until `$X` or `$H`.
    Reset,
    /// `$SLP`, until reset.
    Sleep,
}

/// A hold of the sender, until it resumes.
#[derive(Debug, Default)]
struct Hold {
    is_on: bool,
    /// A door was opened.
    is_door: bool,
    /// The order, while it is not answered.
    order: Option<u32>,
}

impl Hold {
    /// Nothing is held any more; the answer may be under way.
    fn end(&mut self) {
        (self.is_on, self.is_door) = (false, false);
    }
}

/// One sender.
#[derive(Debug)]
pub struct Session {
    machine: Machine,
    inputs: Inputs,
    waiting_inputs: VecDeque<Input>,
    output: Vec<u8>,
    orders: VecDeque<(u32, Order)>,
    number: u32,
    status: Status,
    /// Orders of the status under way, and whether the sender waits for it.
    asked: VecDeque<(u32, bool)>,
    reporter: Reporter,
    modes: Modes,
    /// The control must be put into these modes before the next line.
    modes_unknown: bool,
    /// Text that the control has no room for yet.
    text: String,
    /// Lines that are under way to the control.
    sent: Option<u32>,
    /// All lines are to be executed once this is answered; whether there have been others since.
    settling: Option<(u32, bool)>,
    /// Lines may still have to be executed.
    is_under_way: bool,
    /// The last number given when all lines had been executed.
    idle_since: Option<u32>,
    busy: Option<Busy>,
    lock: Option<Lock>,
    is_check: bool,
    hold: Hold,
    jog: Jog,
    homing: bool,
    /// The sender has been told what the machine waits for.
    is_wait_told: bool,
    probed: ([f64; 3], bool),
}

impl Session {
    /// A sender of this machine; it is greeted at once.
    pub fn new(machine: Machine) -> Session {
        let mut session = Session {
            machine,
            inputs: Inputs::default(),
            waiting_inputs: VecDeque::new(),
            output: Vec::new(),
            orders: VecDeque::new(),
            number: 0,
            status: Status::default(),
            asked: VecDeque::new(),
            reporter: Reporter::default(),
            modes: Modes::default(),
            modes_unknown: true,
            text: String::new(),
            sent: None,
            settling: None,
            is_under_way: false,
            idle_since: None,
            busy: None,
            lock: None,
            is_check: false,
            hold: Hold::default(),
            jog: Jog::default(),
            homing: false,
            is_wait_told: false,
            probed: ([0.0; 3], false),
        };
        session.greet();
        session.tick();
        session
    }

    /// Takes what the sender has sent, up to [`TAKE_MAX`] octets while there is [room](Session::has_room).
    pub fn take(&mut self, octets: &[u8]) {
        for octet in octets {
            match self.inputs.take(*octet) {
                None => {}
                Some(input @ (Input::Line(_) | Input::LongLine)) => {
                    if self.waiting_inputs.len() < INPUTS_MAX + TAKE_MAX {
                        self.waiting_inputs.push_back(input);
                    }
                    self.go_on();
                }
                Some(command) => self.real_time(&command),
            }
        }
    }

    /// Whether more can be taken: a sender that does not wait for answers is to wait in its socket.
    pub fn has_room(&self) -> bool {
        self.waiting_inputs.len() < INPUTS_MAX
    }

    /// What is to be sent to the sender.
    pub fn output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    /// The next order, and the number of its answer.
    pub fn order(&mut self) -> Option<(u32, Order)> {
        self.orders.pop_front()
    }

    /// To be called now and then, some ten times a second: alarms come to light so.
    pub fn tick(&mut self) {
        if self.asked.is_empty() {
            let number = self.give(Order::Status);
            self.asked.push_back((number, false));
        }
    }

    /// Whether something is moved by hand: the control wants to hear that the sender is still there.
    pub fn is_jogging(&self) -> bool {
        self.jog.to.is_some()
    }

    /// What came of an order; `Err`: why the control has not carried it out.
    pub fn answered(&mut self, number: u32, answer: Result<Answer, String>) {
        if let Some(at) = self.asked.iter().position(|(asked, _)| *asked == number) {
            let is_wanted = self.asked.remove(at).is_some_and(|(_, is_wanted)| is_wanted);
            if let Ok(Answer::Status(status)) = answer
                && self
                    .idle_since
                    .is_none_or(|since| number.wrapping_sub(since).cast_signed() > 0)
            {
                self.see(*status);
            }
            if is_wanted {
                self.report();
            }
            return self.go_on();
        }
        if let Some((_, others)) = self.settling.take_if(|(settling, _)| *settling == number) {
            self.is_under_way = others && answer.is_ok();
            if answer.is_ok() && !others {
                // A status that was asked for before does not know it.
                self.status.activity = Activity::Idle;
                self.idle_since = Some(self.number);
            }
        }
        if self.hold.order.take_if(|hold| *hold == number).is_some() && self.is_under_way {
            // Where it was refused, the next status sees whether there is something to hold by then.
            return self.go_on();
        }
        let is_sent = self.sent.take_if(|sent| *sent == number).is_some();
        match (self.busy, answer) {
            (Some(Busy::On(wanted, then)), answer) if wanted == number => self.done(then, answer),
            (_, Ok(_)) => {}
            (_, Err(why)) => {
                self.message(&why);
                if is_sent {
                    self.forget_lines();
                }
            }
        }
        self.go_on();
    }

    fn done(&mut self, then: Then, answer: Result<Answer, String>) {
        self.busy = None;
        self.homing = false;
        let answer = match answer {
            Ok(answer) => answer,
            Err(why) => {
                self.message(&why);
                // What was lost on the way is told by an alarm.
                let number = match then {
                    Then::Offsets => ErrorNumber::NotIdle,
                    Then::Ok | Then::Unlocked | Then::Probed => ErrorNumber::Locked,
                };
                self.forget_lines();
                return self.say(number);
            }
        };
        match (then, answer) {
            (Then::Unlocked, _) => {
                self.lock = self.lock.filter(|lock| *lock == Lock::Sleep);
                self.modes_unknown = true;
                self.say("[MSG:Caution: Unlocked]");
            }
            (Then::Offsets, Answer::Offsets(told)) => {
                let text = reports::offsets(&told, self.probed);
                self.output.extend(text.into_bytes());
            }
            (Then::Probed, Answer::Probed { place_mm, touched }) => {
                self.probed = (place_mm, touched);
                self.output.extend(reports::probe(self.probed).into_bytes());
            }
            _ => {}
        }
        self.say("ok");
    }

    /// Lines that are here are not run any more.
    fn forget_lines(&mut self) {
        self.text.clear();
        self.modes_unknown = true;
        self.modes.forget_place();
        if self.busy == Some(Busy::Room) {
            self.busy = None;
            self.say(ErrorNumber::Locked);
        }
    }

    fn give(&mut self, order: Order) -> u32 {
        self.number = self.number.wrapping_add(1);
        self.orders.push_back((self.number, order));
        self.number
    }

    fn say(&mut self, what: impl Display) {
        self.output.extend(format!("{what}\r\n").into_bytes());
    }

    /// Text of the control; brackets and ends of lines would confuse senders.
    fn message(&mut self, text: &str) {
        let line = text.lines().next().unwrap_or_default();
        let plain: String = line
            .chars()
            .map(|c| {
                if matches!(c, '[' | ']' | '<' | '>') || c.is_control() {
                    ' '
                } else {
                    c
                }
            })
            .collect();
        self.say(format_args!("[MSG:{plain}]"));
    }

    fn greet(&mut self) {
        self.say("");
        self.say(format_args!("Grbl {VERSION} ['$' for help]"));
    }

    fn see(&mut self, status: Status) {
        let before = self.status.alarm.take();
        self.status = status;
        self.jog.see(&self.status);
        if !self.is_under_way && self.status.activity == Activity::Idle {
            self.hold.end();
        }
        // A hold that came before the first line had begun was refused: it counts for what runs now.
        if self.hold.is_on && self.status.activity == Activity::Running && self.hold.order.is_none() {
            self.hold.order = Some(self.give(Order::Hold));
        }
        if let Some(cause) = self.status.alarm.clone() {
            if before.is_none() {
                self.say(AlarmNumber::of_cause(&cause));
                self.message(&cause);
                self.forget_lines();
            }
            self.lock = self.lock.or(Some(Lock::Alarm));
        } else if self.lock == Some(Lock::Alarm) {
            // Somebody else has acknowledged it.
            self.lock = None;
        }
        match self.status.waiting.clone() {
            Some(text) if !self.is_wait_told => {
                self.is_wait_told = true;
                self.message(&text);
            }
            waiting => self.is_wait_told = waiting.is_some(),
        }
    }

    fn is_locked(&self) -> bool {
        self.lock.is_some() || !self.status.is_ready
    }

    fn state(&self) -> &'static str {
        match (self.lock, self.status.activity) {
            (Some(Lock::Sleep), _) => "Sleep",
            (_, Activity::Homing) => "Home",
            _ if self.homing => "Home",
            (_, Activity::Held) if self.hold.is_door => "Door:0",
            (_, Activity::Held) => "Hold:0",
            _ if self.is_locked() => "Alarm",
            (_, Activity::Running) if self.hold.is_door => "Door:2",
            (_, Activity::Running) if self.hold.is_on => "Hold:1",
            (_, Activity::Stopping) => "Hold:1",
            (_, Activity::Jogging) => "Jog",
            _ if self.is_jogging() => "Jog",
            (_, Activity::Running) => "Run",
            _ if self.is_under_way => "Run",
            _ if self.is_check => "Check",
            (_, Activity::Idle) => "Idle",
        }
    }

    fn report(&mut self) {
        let used: usize = self
            .waiting_inputs
            .iter()
            .map(|input| match input {
                Input::Line(line) => line.len() + 1,
                _ => 1,
            })
            .sum();
        let [lines, octets] = ROOM;
        let lines = if self.is_under_way {
            lines - (self.text.len() * lines / WAITING_MAX).min(lines)
        } else {
            lines
        };
        let seen = Seen {
            state: self.state(),
            room: [lines, octets.saturating_sub(used)],
        };
        let line = self.reporter.line(&self.status, &seen);
        self.output.extend(line.into_bytes());
    }
}

#[cfg(test)]
mod tests;
