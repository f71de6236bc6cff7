//! A sender, from its greeting to its end.
//!
//! In:  its octets; answers of the control. Out: octets for it; orders for the control.
//!
//! Lines are taken one after the other. One that must be answered only when the machine has come to it keeps those behind it waiting,
//! in the sender's own 128 octets; real-time octets go on meanwhile.

use crate::block::{Block, JogBlock, Modes, block, jog};
use crate::number::{AlarmNumber, ErrorNumber};
use crate::octets::{Input, Inputs};
use crate::reports::{self, Offsets, VERSION};
use crate::status::{Activity, Machine, Overrides, Reporter, Seen, Status, modes_line};
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
/// Jogs ahead of where the machine stands can be told only so well, mm.
const TRAVEL_TOLERANCE_MM: f64 = 1e-6;
/// So many statuses in a row without motion end a jog: more than it takes one to begin.
const JOG_RESTS: u8 = 5;

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
    /// A door was opened, and nothing resumed since.
    is_door: bool,
    holds: bool,
    /// A hold that is not answered yet.
    hold: Option<u32>,
    /// Where jogs lead, machine coordinates, mm.
    jog_to: Option<[f64; 3]>,
    /// A status may still be older than the last jog: so many of them.
    jog_unseen: u8,
    /// Statuses in a row in which a jog rests: the control takes one for over only when nobody keeps it any more.
    jog_rests: u8,
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
            is_door: false,
            holds: false,
            hold: None,
            jog_to: None,
            jog_unseen: 0,
            jog_rests: 0,
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
        self.jog_to.is_some()
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
        if self.hold.take_if(|hold| *hold == number).is_some() && self.is_under_way {
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

    // -- how the machine is ------------------------------------------------------------------------------------------------------

    fn see(&mut self, status: Status) {
        let before = self.status.alarm.take();
        self.status = status;
        match self.status.activity {
            Activity::Jogging => self.jog_unseen = 0,
            _ => self.jog_unseen = self.jog_unseen.saturating_sub(1),
        }
        let is_jogging = self.status.activity == Activity::Jogging;
        self.jog_rests = match is_jogging && self.status.feed_mm_min == 0.0 {
            true => self.jog_rests.saturating_add(1),
            false => 0,
        };
        if !is_jogging && self.jog_unseen == 0 || self.jog_rests >= JOG_RESTS {
            self.jog_to = None;
        }
        if !self.is_under_way && self.status.activity == Activity::Idle {
            (self.holds, self.is_door) = (false, false);
        }
        // A hold that came before the first line had begun was refused: it counts for what runs now.
        if self.holds && self.status.activity == Activity::Running && self.hold.is_none() {
            self.hold = Some(self.give(Order::Hold));
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
            (_, Activity::Held) if self.is_door => "Door:0",
            (_, Activity::Held) => "Hold:0",
            _ if self.is_locked() => "Alarm",
            (_, Activity::Running) if self.is_door => "Door:2",
            (_, Activity::Running) if self.holds => "Hold:1",
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

    // -- real-time octets --------------------------------------------------------------------------------------------------------

    fn real_time(&mut self, command: &Input) {
        let Overrides { feed, spindle, .. } = self.status.overrides;
        match command {
            Input::Status => {
                // One that asks faster than it is answered gets as many answers as it can be told.
                if self.asked.len() < 8 {
                    let number = self.give(Order::Status);
                    self.asked.push_back((number, true));
                }
            }
            Input::Hold => self.hold(false),
            Input::Door => self.hold(true),
            Input::Resume => {
                // The last status may be older than a hold.
                if self.holds || matches!(self.status.activity, Activity::Held | Activity::Running) {
                    self.give(Order::Resume);
                }
                (self.holds, self.is_door) = (false, false);
            }
            Input::Reset => self.reset(),
            Input::CancelJog => self.cancel_jog(),
            Input::Feed(by) => {
                let percent = overridden(feed, *by, self.machine.feed_percent);
                self.status.overrides.feed = percent;
                self.give(Order::Feed(percent));
            }
            Input::Rapid(percent) => {
                self.give(Order::Rapid(u16::from(*percent)));
            }
            Input::Spindle(by) => {
                let percent = overridden(spindle, *by, self.machine.spindle_percent);
                self.status.overrides.spindle = percent;
                self.give(Order::Spindle(percent));
            }
            Input::StopSpindle => self.message("the spindle cannot be stopped in a hold from here"),
            Input::Flood => self.coolant("M8", self.status.flood),
            Input::Mist => self.coolant("M7", self.status.mist),
            Input::Line(_) | Input::LongLine => {}
        }
    }

    fn hold(&mut self, by_door: bool) {
        if self.is_jogging() {
            self.cancel_jog();
        }
        if self.is_under_way || matches!(self.status.activity, Activity::Running) {
            self.hold = Some(self.give(Order::Hold));
            self.holds = true;
        }
        self.is_door |= by_door;
    }

    fn cancel_jog(&mut self) {
        if self.is_jogging() {
            self.give(Order::StopJog);
            self.waiting_inputs
                .retain(|input| !matches!(input, Input::Line(line) if line.starts_with("$J=")));
        }
    }

    fn reset(&mut self) {
        let moves = self.is_under_way || self.status.activity != Activity::Idle || self.is_jogging();
        let homes = self.homing || self.status.activity == Activity::Homing;
        self.inputs.clear();
        self.waiting_inputs.clear();
        // Nobody waits for these answers any more.
        (self.busy, self.sent, self.settling) = (None, None, None);
        self.text.clear();
        (self.is_under_way, self.is_check, self.holds, self.is_door, self.homing) = (false, false, false, false, false);
        self.jog_to = None;
        self.modes = Modes::default();
        self.modes_unknown = true;
        if self.lock == Some(Lock::Sleep) {
            self.lock = None;
        }
        if moves {
            self.give(Order::Stop);
            self.lock = Some(Lock::Reset);
            self.say(if homes {
                AlarmNumber::HomingReset
            } else {
                AlarmNumber::Stopped
            });
        }
        self.greet();
        if self.is_locked() {
            self.say("[MSG:'$H'|'$X' to unlock]");
        }
    }

    /// Coolant goes on and off by lines; while lines run, nothing gets between them.
    fn coolant(&mut self, on: &str, is_on: bool) {
        if self.is_under_way || self.is_locked() || self.status.activity != Activity::Idle {
            return self.message("coolant can be switched from here only while the machine is idle");
        }
        // The other kind stays.
        let other = match on {
            "M8" if self.status.mist => "M7",
            "M7" if self.status.flood => "M8",
            _ => "",
        };
        let line = match is_on {
            false => on.to_owned(),
            true => format!("M9{other}"),
        };
        if let Ok(block) = block(&line, &self.modes) {
            self.accept(block);
        }
    }

    // -- lines -------------------------------------------------------------------------------------------------------------------

    /// Takes lines as long as nothing has to be waited for.
    fn go_on(&mut self) {
        self.send_lines();
        while self.busy.is_none()
            && let Some(input) = self.waiting_inputs.pop_front()
        {
            match input {
                Input::Line(line) => self.line(&line),
                _ => self.say(ErrorNumber::LineLong),
            }
            self.send_lines();
        }
        self.settle();
    }

    /// Hands the control what it has room for.
    fn send_lines(&mut self) {
        if self.sent.is_none() && !self.text.is_empty() {
            let text = std::mem::take(&mut self.text);
            self.sent = Some(self.give(Order::Lines { text, wait: false }));
            if let Some((_, others)) = &mut self.settling {
                *others = true;
            }
        }
        if self.busy == Some(Busy::Room) && self.text.len() <= WAITING_MAX {
            self.busy = None;
            self.say("ok");
        }
    }

    /// Finds out when all lines have been executed.
    fn settle(&mut self) {
        if self.is_under_way && self.settling.is_none() && self.sent.is_none() && self.text.is_empty() {
            let order = Order::Lines {
                text: String::new(),
                wait: true,
            };
            self.settling = Some((self.give(order), false));
        }
    }

    fn line(&mut self, line: &str) {
        match line.strip_prefix('$') {
            Some(rest) => self.dollar(rest),
            None if line.is_empty() || line.chars().all(|c| c == '%') => self.say("ok"),
            None if self.is_locked() && !self.is_check => self.say(ErrorNumber::Locked),
            None => match block(line, &self.modes) {
                Err(error) => self.say(error),
                Ok(block) if self.is_check => {
                    self.modes = block.modes;
                    self.say("ok");
                }
                Ok(block) => self.accept_line(block),
            },
        }
    }

    fn accept_line(&mut self, block: Block) {
        let (waits, probes, ends) = (block.waits, block.probes, block.ends);
        if !waits {
            self.accept(block);
            match self.text.len() <= WAITING_MAX {
                true => self.say("ok"),
                false => self.busy = Some(Busy::Room),
            }
            return;
        }
        let text = self.with_modes(&block);
        self.modes = block.modes;
        // Behind an end, the control is in modes of its own.
        self.modes_unknown |= ends;
        self.is_under_way = true;
        let before = std::mem::take(&mut self.text);
        if let Some((_, others)) = &mut self.settling {
            *others = true;
        }
        let (order, then) = match probes {
            true => {
                if !before.is_empty() {
                    self.give(Order::Lines {
                        text: before,
                        wait: false,
                    });
                }
                (Order::Probe { text }, Then::Probed)
            }
            false => (
                Order::Lines {
                    text: before + &text,
                    wait: true,
                },
                Then::Ok,
            ),
        };
        let number = self.give(order);
        self.busy = Some(Busy::On(number, then));
        // Then all before it has been executed, too.
        if !probes {
            self.settling = Some((number, false));
        }
    }

    fn accept(&mut self, block: Block) {
        let text = self.with_modes(&block);
        self.modes = block.modes;
        if !text.is_empty() {
            self.text.push_str(&text);
            self.is_under_way = true;
        }
        self.jog_to = None;
        self.send_lines();
    }

    /// The text of a line, behind the modes that it counts on where the control may be in others.
    fn with_modes(&mut self, block: &Block) -> String {
        match self.modes_unknown && !block.text.is_empty() {
            true => {
                self.modes_unknown = false;
                self.modes.line() + &block.text
            }
            false => block.text.clone(),
        }
    }

    // -- lines that begin with $ -------------------------------------------------------------------------------------------------

    fn dollar(&mut self, line: &str) {
        let is_idle = !self.is_under_way && self.status.activity == Activity::Idle;
        match line {
            "" => {
                self.say("[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]");
                self.say("ok");
            }
            "$" => {
                let text = reports::settings(&self.machine);
                self.output.extend(text.into_bytes());
                self.say("ok");
            }
            "G" => {
                let text = modes_line(&self.modes);
                self.output.extend(text.into_bytes());
                self.say("ok");
            }
            "I" => {
                self.output.extend(reports::build().into_bytes());
                self.say("ok");
            }
            "N" => {
                self.say("$N0=");
                self.say("$N1=");
                self.say("ok");
            }
            "#" => {
                let number = self.give(Order::Offsets);
                self.busy = Some(Busy::On(number, Then::Offsets));
            }
            "C" if self.is_check => {
                self.say("[MSG:Disabled]");
                self.say("ok");
                self.reset();
            }
            "C" if !is_idle || self.is_locked() => self.say(ErrorNumber::NotIdle),
            "C" => {
                self.is_check = true;
                self.say("[MSG:Enabled]");
                self.say("ok");
            }
            "X" if !is_idle => self.say(ErrorNumber::NotIdle),
            // Nothing is locked.
            "X" if !self.is_locked() => self.say("ok"),
            "X" => {
                let number = self.give(Order::Unlock);
                self.busy = Some(Busy::On(number, Then::Unlocked));
            }
            "H" if !is_idle || self.is_check || self.lock == Some(Lock::Sleep) => self.say(ErrorNumber::NotIdle),
            "H" => {
                self.lock = self.lock.filter(|lock| *lock != Lock::Reset);
                self.homing = true;
                self.modes.forget_place();
                self.modes_unknown = true;
                let number = self.give(Order::Home);
                self.busy = Some(Busy::On(number, Then::Ok));
            }
            "SLP" if !is_idle => self.say(ErrorNumber::NotIdle),
            "SLP" => {
                self.lock = Some(Lock::Sleep);
                self.say("[MSG:Sleeping]");
                let number = self.give(Order::Off);
                self.busy = Some(Busy::On(number, Then::Ok));
            }
            _ => match line.strip_prefix("J=") {
                Some(rest) => self.jog(rest),
                None => self.say(ErrorNumber::BadDollar),
            },
        }
    }

    fn jog(&mut self, line: &str) {
        let is_free = !self.is_under_way && matches!(self.status.activity, Activity::Idle | Activity::Jogging);
        if !is_free || self.is_check {
            return self.say(ErrorNumber::NotIdle);
        }
        if self.is_locked() {
            return self.say(ErrorNumber::Locked);
        }
        let asked = match jog(line, &self.modes) {
            Ok(asked) => asked,
            Err(error) => return self.say(error),
        };
        let from = self.jog_to.unwrap_or(self.status.position_mm);
        let to = self.jog_end(&asked, from);
        let is_inside = (0..3).all(|axis| match (asked.axes[axis], self.machine.axes[axis]) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(_), Some(limits)) => {
                let [low, high] = limits.travel_mm;
                (low - TRAVEL_TOLERANCE_MM..=high + TRAVEL_TOLERANCE_MM).contains(&to[axis])
            }
        });
        if !is_inside {
            return self.say(ErrorNumber::Travel);
        }
        let distance_mm = [0, 1, 2].map(|axis| to[axis] - from[axis]);
        let length_mm = distance_mm.iter().map(|part| part * part).sum::<f64>().sqrt();
        if length_mm == 0.0 {
            return self.say("ok");
        }
        let velocity_mm_s = distance_mm.map(|part| part / length_mm * asked.feed_mm_min / 60.0);
        self.jog_to = Some(to);
        // One may be under way, and the cycle has to take the order.
        self.jog_unseen = 3;
        self.jog_rests = 0;
        self.modes.forget_place();
        self.give(Order::Jog {
            distance_mm,
            velocity_mm_s,
        });
        self.say("ok");
    }

    fn jog_end(&self, asked: &JogBlock, from: [f64; 3]) -> [f64; 3] {
        let mut to = from;
        for (axis, to) in to.iter_mut().enumerate() {
            let Some(value) = asked.axes[axis] else { continue };
            *to = match (asked.relative, asked.of_machine) {
                (true, _) => *to + value,
                (false, true) => value,
                (false, false) => value + self.status.work_offset_mm[axis],
            };
        }
        to
    }
}

/// An override that goes on by so many percent.
fn overridden(now: u16, by: Option<i8>, [low, high]: [u16; 2]) -> u16 {
    match by {
        None => 100,
        Some(by) => now.saturating_add_signed(i16::from(by)).clamp(low, high),
    }
}

#[cfg(test)]
mod tests;
