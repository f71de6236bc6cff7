//! The port for senders of Grbl: one sender at a time, a client of the control like any other.
//!
//! In:  a TCP connection of this PC; what the control answers. Out: the crate `grbl` has the protocol, this its orders as requests.
//!
//! What takes several requests (homing to its end, an unlock) goes on as the status, which is asked for ten times a second, shows that the
//! one before is done.

use crate::ask::{ask, connect};
use crate::listen::Listener;
use crate::serve::Panel;
use grbl::{Activity, Answer, Axis, Machine, Offsets, Order, Overrides, Session, Spindle, Status, TAKE_MAX};
use protocol::params::{self, NoParams};
use protocol::with_tokio::Client;
use protocol::{ClientError, Described, Entry, Method, Outcome, Power, Received, Role, WaitingFor, method};
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{MissedTickBehavior, interval, timeout};

/// What others are told of it.
const NAME: &str = "Grbl sender";
/// Between two looks at the control.
const TICK: Duration = Duration::from_millis(100);
/// A sender that does not read for so long is gone.
const UNREAD: Duration = Duration::from_secs(5);
/// Octets that a sender has not read, with which nothing more of it is taken.
const UNREAD_MAX: usize = 64 * 1024;
/// Requests that the control has not answered yet, at which a sender waits in its socket: each of its octets may be one, and two that only
/// write to each other would wait for ever.
const ASKED_MAX: usize = 64;
/// One that goes makes room for the next one within this.
const GONE: Duration = Duration::from_millis(300);
/// Turns that an unlock may take.
const UNLOCK_TICKS: u32 = 200;
/// Percent of feed and spindle that the control takes.
const FEED_PERCENT: [u16; 2] = [10, 120];
const SPINDLE_PERCENT: [u16; 2] = [50, 120];
/// What the message behind a probing move begins with.
const PROBED: &str = "PRB ";

/// Serves senders, one after the other.
pub(crate) async fn serve(listener: Listener, panel: Arc<Panel>) -> io::Result<()> {
    let peers = listener.peers;
    let socket = TcpListener::from_std(listener.socket)?;
    let mut under_way: Option<tokio::task::JoinHandle<()>> = None;
    loop {
        let Ok((mut stream, far)) = socket.accept().await else {
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        let is_own = stream.local_addr().is_ok_and(|near| peers.is_own(near, far));
        if let Some(task) = &mut under_way
            && timeout(GONE, task).await.is_ok()
        {
            under_way = None;
        }
        let refused = match &under_way {
            _ if !is_own => Some("only the user of the control may connect"),
            Some(_) => Some("another sender is connected"),
            _ => None,
        };
        if let Some(why) = refused {
            // It has gone, or reads it.
            let told = format!("[MSG:{why}]\r\n");
            let _ = timeout(GONE, stream.write_all(told.as_bytes())).await;
            let _ = stream.shutdown().await;
            tracing::warn!(%far, why, "a sender of Grbl was refused");
            continue;
        }
        let panel = Arc::clone(&panel);
        under_way = Some(tokio::spawn(async move {
            if let Err(why) = serve_one(stream, &panel).await {
                tracing::info!(%far, why, "a sender of Grbl has gone");
            }
        }));
    }
}

async fn serve_one(mut stream: TcpStream, panel: &Panel) -> Result<(), String> {
    let words = |cause: io::Error| cause.to_string();
    let _ = stream.set_nodelay(true);
    let mut ending = panel.ending.clone();
    let mut port = Port::open(panel).await?;
    let mut ticks = interval(TICK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let (mut sent, mut reads) = stream.split();
    let mut buffer = [0; TAKE_MAX];
    // What the sender has not taken yet, and when it took something last.
    let (mut unread, mut took) = (Vec::new(), Instant::now());
    loop {
        port.give_orders().await?;
        if unread.is_empty() {
            took = Instant::now();
        }
        unread.extend(port.session.output());
        let has_room = port.session.has_room() && unread.len() < UNREAD_MAX && port.asked.len() < ASKED_MAX;
        tokio::select! {
            read = sent.read(&mut buffer), if has_room => match read.map_err(words)? {
                0 => return Ok(()),
                count => port.session.take(&buffer[..count]),
            },
            // Holds are heard meanwhile.
            written = reads.write(&unread), if !unread.is_empty() => {
                unread.drain(..written.map_err(words)?);
                took = Instant::now();
            }
            message = port.client.message() => port.heard(message.map_err(ended)?)?,
            _ = ticks.tick() => {
                if took.elapsed() > UNREAD {
                    return Err("it does not read".into());
                }
                port.tick(unread.is_empty());
            }
            _ = ending.changed() => return Ok(()),
        }
    }
}

/// What a request belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Asked {
    /// An order, which this answers.
    Order(u32),
    Status(u32),
    Offsets(u32),
    /// A probing move, whose end the next status tells.
    Probe(u32),
    /// A part of homing or of an unlock has begun.
    Begun(u32),
    Control,
    /// Nobody waits for it.
    Nothing,
}

/// What is under way for longer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Long {
    Home,
    /// How far an unlock is: turns that it has taken.
    Unlock {
        ticks: u32,
        is_on_ordered: bool,
    },
    Probe,
}

/// A sender, and its way to the control.
struct Port {
    session: Session,
    client: Client,
    asked: HashMap<u64, Asked>,
    /// The order of it, and whether its first request is answered.
    long: Option<(u32, Long, bool)>,
    has_control: bool,
    joints: usize,
    unit_mm: f64,
    /// Joints of X, Y and Z.
    joints_of: [Vec<usize>; 3],
}

/// The control is there no more, or cannot be understood.
fn ended(error: ClientError) -> String {
    format!("the control has ended: {error}")
}

impl Port {
    async fn open(panel: &Panel) -> Result<Port, String> {
        let mut client = connect(panel, Role::SetUp, NAME)?;
        let described = ask::<method::Describe>(&mut client, &NoParams {}).await?;
        let mut port = Port {
            session: Session::new(Machine::default()),
            client,
            asked: HashMap::new(),
            long: None,
            has_control: false,
            joints: 0,
            unit_mm: 1.0,
            joints_of: Default::default(),
        };
        port.describe(&described);
        // Its first order, the status: a sender that is greeted before finds a machine locked that is not.
        port.give_orders().await?;
        let message = port.client.message().await.map_err(ended)?;
        port.heard(message)?;
        Ok(port)
    }

    fn describe(&mut self, machine: &Described) {
        self.joints = machine.joints.len();
        self.unit_mm = if machine.unit == "inch" { 25.4 } else { 1.0 };
        let mut axes = [None; 3];
        for (place, letter) in ["X", "Y", "Z"].into_iter().enumerate() {
            let found = machine.axes.iter().find(|axis| axis.axis == letter);
            let Some(axis) = found else { continue };
            axes[place] = Some(Axis {
                travel_mm: axis.travel.unwrap_or_default(),
                velocity_mm_min: axis.velocity_per_s.unwrap_or_default() * 60.0,
                acceleration_mm_s2: axis.acceleration_per_s2.unwrap_or_default(),
            });
            self.joints_of[place].clone_from(&axis.joints);
        }
        self.session = Session::new(Machine {
            axes,
            rpm_max: machine.spindle_rpm_max,
            feed_percent: FEED_PERCENT,
            spindle_percent: SPINDLE_PERCENT,
        });
    }

    fn ask<M: Method>(&mut self, params: &M::Params, asked: Asked) {
        let id = self.client.put::<M>(params);
        self.asked.insert(id, asked);
    }

    async fn give_orders(&mut self) -> Result<(), String> {
        while let Some((number, order)) = self.session.order() {
            self.order(number, order);
        }
        self.client.send().await.map_err(ended)
    }

    /// Control is kept from the first order that needs it until the sender goes.
    fn take_control(&mut self) {
        if !self.has_control {
            let taken = params::TakeControl {
                name: Some(NAME.to_owned()),
                force: None,
            };
            self.ask::<method::TakeControl>(&taken, Asked::Control);
        }
    }

    fn order(&mut self, number: u32, order: Order) {
        if matches!(
            order,
            Order::Lines { .. } | Order::Probe { .. } | Order::Jog { .. } | Order::Home | Order::Unlock | Order::Off
        ) {
            self.take_control();
        }
        let none = NoParams {};
        let turned = params::Override::default;
        match order {
            Order::Status => self.ask::<method::Status>(&none, Asked::Status(number)),
            Order::Offsets => self.ask::<method::OffsetList>(&none, Asked::Offsets(number)),
            Order::Lines { text, wait } => {
                let wait = Some(wait);
                self.ask::<method::MdiStream>(&params::MdiStream { text, wait }, Asked::Order(number));
            }
            Order::Probe { text } => {
                // Where the contact was, in the unit of the program.
                let text = format!("{text}(DEBUG,PRB #5061 #5062 #5063 #5070 #<_metric>)\n");
                self.long = Some((number, Long::Probe, false));
                let wait = Some(true);
                self.ask::<method::MdiStream>(&params::MdiStream { text, wait }, Asked::Probe(number));
            }
            Order::Jog {
                distance_mm,
                velocity_mm_s,
            } => self.jog(number, distance_mm, velocity_mm_s),
            Order::StopJog => self.ask::<method::JogStop>(&params::Jogging::default(), Asked::Order(number)),
            Order::Hold => self.ask::<method::Hold>(&none, Asked::Order(number)),
            Order::Resume => self.ask::<method::Resume>(&none, Asked::Order(number)),
            Order::Stop => self.ask::<method::Stop>(&none, Asked::Order(number)),
            Order::Off => self.ask::<method::Off>(&none, Asked::Order(number)),
            Order::Feed(percent) => {
                let feed = Some(f64::from(percent));
                self.ask::<method::Override>(&params::Override { feed, ..turned() }, Asked::Order(number));
            }
            Order::Rapid(percent) => {
                let rapid = Some(f64::from(percent));
                self.ask::<method::Override>(&params::Override { rapid, ..turned() }, Asked::Order(number));
            }
            Order::Spindle(percent) => {
                let spindle = Some(f64::from(percent));
                self.ask::<method::Override>(&params::Override { spindle, ..turned() }, Asked::Order(number));
            }
            Order::Home => {
                self.long = Some((number, Long::Home, false));
                self.ask::<method::Home>(&params::Home::default(), Asked::Begun(number));
            }
            Order::Unlock => {
                let ticks = 0;
                let is_on_ordered = false;
                self.long = Some((number, Long::Unlock { ticks, is_on_ordered }, true));
            }
        }
    }

    /// Each axis by itself: they set out together, and their speeds make the straight line.
    fn jog(&mut self, number: u32, distance_mm: [f64; 3], velocity_mm_s: [f64; 3]) {
        let mut axes = ["X", "Y", "Z"]
            .into_iter()
            .zip(distance_mm)
            .zip(velocity_mm_s)
            .filter(|((_, way), _)| *way != 0.0)
            .peekable();
        while let Some(((axis, distance_mm), velocity_mm_s)) = axes.next() {
            let jog = params::Jog {
                axis: Some(axis.to_owned()),
                joint: None,
                velocity_mm_s: velocity_mm_s.abs(),
                distance_mm: Some(distance_mm),
            };
            let asked = if axes.peek().is_none() {
                Asked::Order(number)
            } else {
                Asked::Nothing
            };
            self.ask::<method::Jog>(&jog, asked);
        }
    }

    /// `reads`: the sender takes what it is told; one that hangs does not go on with a jog.
    fn tick(&mut self, reads: bool) {
        self.session.tick();
        if self.session.is_jogging() && reads {
            self.ask::<method::JogKeep>(&params::Jogging::default(), Asked::Nothing);
        }
    }

    /// The control has answered.
    fn heard(&mut self, message: Received) -> Result<(), String> {
        let Received::Answer { id: Some(id), result } = message else {
            return Ok(());
        };
        let Some(asked) = self.asked.remove(&id) else {
            return Ok(());
        };
        match (asked, result.map_err(|error| error.message.text)) {
            (Asked::Nothing, _) => {}
            (Asked::Control, result) => self.has_control = result.is_ok(),
            (Asked::Status(number), Ok(result)) => {
                let told: protocol::Status = protocol::client::read(result).map_err(ended)?;
                let status = Box::new(self.status(&told));
                self.go_on(&told);
                self.session.answered(number, Ok(Answer::Status(status)));
            }
            (Asked::Offsets(number), Ok(result)) => {
                let told: protocol::Offsets = protocol::client::read(result).map_err(ended)?;
                let offsets = Box::new(self.offsets(&told));
                self.session.answered(number, Ok(Answer::Offsets(offsets)));
            }
            (Asked::Probe(number) | Asked::Begun(number), Ok(_)) => {
                if let Some((_, _, has_begun)) = self.long.as_mut().filter(|(of, ..)| *of == number) {
                    *has_begun = true;
                }
            }
            (Asked::Order(number), Ok(_)) => self.session.answered(number, Ok(Answer::Done)),
            (
                Asked::Order(number)
                | Asked::Status(number)
                | Asked::Offsets(number)
                | Asked::Probe(number)
                | Asked::Begun(number),
                Err(why),
            ) => {
                // Whoever takes control away has it.
                self.has_control &= !why.contains("control");
                self.long.take_if(|(of, ..)| *of == number);
                self.session.answered(number, Err(why));
            }
        }
        Ok(())
    }

    /// What is under way for longer goes on, as the machine is now.
    fn go_on(&mut self, status: &protocol::Status) {
        let Some((number, long, true)) = self.long else { return };
        let job = status.job;
        let alarm = || {
            let alarm = status.alarm.as_ref().map(ToString::to_string);
            alarm.unwrap_or_else(|| "it was stopped".into())
        };
        let answer = match long {
            Long::Home => match job {
                None => return,
                Some(Outcome::Completed) => Ok(Answer::Done),
                Some(_) => Err(alarm()),
            },
            Long::Probe => {
                let probed = |entry: &Entry| entry.told_by_program()?.strip_prefix(PROBED).map(str::to_owned);
                let told = status.messages.iter().rev().find_map(probed);
                match told.and_then(|told| self.probed(&told, status)) {
                    Some(answer) => Ok(answer),
                    None => Err("where the probe touched is not known".into()),
                }
            }
            Long::Unlock { ticks, is_on_ordered } => {
                let power = status.power;
                let has_alarm = status.alarm.is_some();
                let next = match power {
                    _ if ticks >= UNLOCK_TICKS => Some(Err(alarm())),
                    Power::On if !has_alarm => Some(Ok(Answer::Done)),
                    // Someone has to close it first.
                    Power::EstopOpen => Some(Err("the chain of the emergency stop is open".into())),
                    _ => None,
                };
                match next {
                    Some(answer) => answer,
                    None => return self.unlock(number, ticks, is_on_ordered, power, has_alarm),
                }
            }
        };
        self.long = None;
        self.session.answered(number, answer);
    }

    /// The next step of an unlock.
    fn unlock(&mut self, number: u32, ticks: u32, is_on_ordered: bool, power: Power, has_alarm: bool) {
        let (none, asked) = (NoParams {}, Asked::Begun(number));
        let mut is_on = is_on_ordered;
        let waits = match power {
            Power::Estop => {
                self.ask::<method::EstopReset>(&none, asked);
                true
            }
            Power::Alarm | Power::On | Power::Off if power == Power::Alarm || has_alarm => {
                self.ask::<method::Acknowledge>(&none, asked);
                true
            }
            Power::Off if !is_on_ordered => {
                self.ask::<method::On>(&none, asked);
                is_on = true;
                true
            }
            _ => false,
        };
        let long = Long::Unlock {
            ticks: ticks + 1,
            is_on_ordered: is_on,
        };
        self.long = Some((number, long, !waits));
    }

    /// What the message behind a probing move says: work coordinates in the unit of the program, whether it touched, whether that is mm.
    fn probed(&self, told: &str, status: &protocol::Status) -> Option<Answer> {
        let values: Vec<f64> = told
            .split_whitespace()
            .map(|word| word.parse().ok())
            .collect::<Option<_>>()?;
        let [x, y, z, touched, metric] = values.try_into().ok()?;
        let unit_mm = if metric == 1.0 { 1.0 } else { 25.4 };
        let machine =
            |axis: usize, value: f64| value * unit_mm + status.work_offset_mm.get(axis).copied().unwrap_or_default();
        Some(Answer::Probed {
            place_mm: [machine(0, x), machine(1, y), machine(2, z)],
            touched: touched == 1.0,
        })
    }

    fn status(&self, status: &protocol::Status) -> Status {
        let power = status.power;
        let alarm = status.alarm.as_ref().map(ToString::to_string);
        let alarm = alarm.or_else(|| power.is_estop().then(|| "emergency stop".to_owned()));
        // What goes on by itself is no wait of somebody.
        let waiting = status.waiting.as_ref();
        let waiting = waiting.filter(|waiting| matches!(waiting.r#for, WaitingFor::Operator | WaitingFor::ToolChange));
        let activity = match status.activity {
            protocol::Activity::Running if waiting.is_some() => Activity::Held,
            protocol::Activity::Running | protocol::Activity::Checking => Activity::Running,
            protocol::Activity::Held | protocol::Activity::Away | protocol::Activity::Returning => Activity::Held,
            protocol::Activity::Homing => Activity::Homing,
            protocol::Activity::Jogging => Activity::Jogging,
            protocol::Activity::Stopping => Activity::Stopping,
            protocol::Activity::Idle => Activity::Idle,
        };
        let three = |values: &[f64]| [0, 1, 2].map(|axis| values.get(axis).copied().unwrap_or_default());
        let percent = |percent: f64| percent.round().clamp(0.0, 999.0) as u16;
        let switches = &status.limit_switches;
        let is_closed = |joint: &usize| switches.lower.contains(joint) || switches.upper.contains(joint);
        let spindle = status.spindle.as_ref();
        Status {
            is_ready: power == Power::On && status.homed.len() >= self.joints && alarm.is_none(),
            alarm,
            activity,
            position_mm: three(&status.position_mm),
            work_offset_mm: three(&status.work_offset_mm),
            feed_mm_min: status.velocity_mm_s * 60.0,
            spindle: Spindle {
                on: spindle.is_some_and(|spindle| spindle.on),
                speed_rpm: spindle.map_or(0.0, |spindle| spindle.speed_rpm),
            },
            flood: status.coolant.flood,
            mist: status.coolant.mist,
            overrides: Overrides {
                feed: percent(status.overrides.feed_percent),
                rapid: percent(status.overrides.rapid_percent),
                spindle: percent(status.overrides.spindle_percent),
            },
            limits: [0, 1, 2].map(|axis| self.joints_of[axis].iter().any(is_closed)),
            probe: false,
            waiting: waiting.map(|waiting| waiting.what.to_string()),
        }
    }

    fn offsets(&self, told: &protocol::Offsets) -> Offsets {
        let value = |place: &BTreeMap<String, f64>, axis| place.get(axis).copied().unwrap_or_default();
        let three = |place: &BTreeMap<String, f64>| ["X", "Y", "Z"].map(|axis| value(place, axis) * self.unit_mm);
        let mut offsets = Offsets::default();
        for (place, system) in offsets.systems.iter_mut().zip(&told.systems) {
            *place = three(&system.origin);
        }
        if told.g92_active {
            offsets.g92 = three(&told.g92);
        }
        offsets
    }
}
