//! The port for senders of Grbl: one sender at a time, a client of the control like any other.
//!
//! In:  a TCP connection of this PC; what the control answers. Out: the crate `grbl` has the protocol, this its orders as requests.
//!
//! What takes several requests (homing to its end, an unlock) goes on as the status, which is asked for ten times a second, shows that the
//! one before is done.

use crate::Guest;
use crate::listen::Listener;
use crate::serve::Panel;
use crate::tokens::Role;
use grbl::{Activity, Answer, Axis, Machine, Offsets, Order, Overrides, Session, Spindle, Status, TAKE_MAX};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader, Lines};
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream, UnixStream};
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
const PROBED: &str = "message: PRB ";

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
        port.give_orders().await.map_err(words)?;
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
            line = port.line() => port.heard(&line?),
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
    answers: Lines<BufReader<OwnedReadHalf>>,
    requests: OwnedWriteHalf,
    id: u64,
    asked: HashMap<u64, Asked>,
    /// The order of it, and whether its first request is answered.
    long: Option<(u32, Long, bool)>,
    has_control: bool,
    joints: usize,
    unit_mm: f64,
    /// Joints of X, Y and Z.
    joints_of: [Vec<u64>; 3],
    /// Requests that are to be written.
    to_send: String,
}

impl Port {
    async fn open(panel: &Panel) -> Result<Port, String> {
        let guest = Guest {
            role: Role::SetUp,
            name: NAME.to_owned(),
        };
        let connected = panel.control.connect(&guest).and_then(|stream| {
            stream.set_nonblocking(true)?;
            UnixStream::from_std(stream)
        });
        let (answers, requests) = connected.map_err(|cause| cause.to_string())?.into_split();
        let mut port = Port {
            session: Session::new(Machine::default()),
            answers: BufReader::new(answers).lines(),
            requests,
            id: 0,
            asked: HashMap::new(),
            long: None,
            has_control: false,
            joints: 0,
            unit_mm: 1.0,
            joints_of: Default::default(),
            to_send: String::new(),
        };
        port.ask("machine.describe", &json!({}), Asked::Nothing);
        port.send().await.map_err(|cause| cause.to_string())?;
        let answer: Value = serde_json::from_str(&port.line().await?).unwrap_or_default();
        port.describe(&answer["result"]);
        // Its first order, the status: a sender that is greeted before finds a machine locked that is not.
        port.give_orders().await.map_err(|cause| cause.to_string())?;
        let line = port.line().await?;
        port.heard(&line);
        Ok(port)
    }

    /// The next answer of the control.
    async fn line(&mut self) -> Result<String, String> {
        let line = self.answers.next_line().await.map_err(|cause| cause.to_string())?;
        line.ok_or_else(|| "the control has ended".to_owned())
    }

    fn describe(&mut self, machine: &Value) {
        self.joints = machine["joints"].as_array().map_or(0, Vec::len);
        self.unit_mm = unit_mm(machine);
        let mut axes = [None; 3];
        for (place, letter) in ["X", "Y", "Z"].into_iter().enumerate() {
            let found = list(&machine["axes"]).iter().find(|axis| axis["axis"] == letter);
            let Some(axis) = found else { continue };
            let numbers = numbers(&axis["travel"]);
            axes[place] = Some(Axis {
                travel_mm: [numbers.first(), numbers.get(1)].map(|end| end.copied().unwrap_or_default()),
                velocity_mm_min: number(&axis["velocity_per_s"]) * 60.0,
                acceleration_mm_s2: number(&axis["acceleration_per_s2"]),
            });
            self.joints_of[place] = list(&axis["joints"]).iter().filter_map(Value::as_u64).collect();
        }
        self.session = Session::new(Machine {
            axes,
            rpm_max: number(&machine["spindle_rpm_max"]),
            feed_percent: FEED_PERCENT,
            spindle_percent: SPINDLE_PERCENT,
        });
    }

    fn ask(&mut self, method: &str, params: &Value, asked: Asked) {
        self.id += 1;
        self.asked.insert(self.id, asked);
        let request = json!({ "jsonrpc": "2.0", "id": self.id, "method": method, "params": params });
        self.to_send.push_str(&format!("{request}\n"));
    }

    async fn send(&mut self) -> io::Result<()> {
        let text = std::mem::take(&mut self.to_send);
        self.requests.write_all(text.as_bytes()).await
    }

    async fn give_orders(&mut self) -> io::Result<()> {
        while let Some((number, order)) = self.session.order() {
            self.order(number, order);
        }
        match self.to_send.is_empty() {
            true => Ok(()),
            false => self.send().await,
        }
    }

    /// Control is kept from the first order that needs it until the sender goes.
    fn take_control(&mut self) {
        if !self.has_control {
            self.ask("control.take", &json!({ "name": NAME }), Asked::Control);
        }
    }

    fn order(&mut self, number: u32, order: Order) {
        if matches!(
            order,
            Order::Lines { .. } | Order::Probe { .. } | Order::Jog { .. } | Order::Home | Order::Unlock | Order::Off
        ) {
            self.take_control();
        }
        let none = json!({});
        match order {
            Order::Status => self.ask("status", &none, Asked::Status(number)),
            Order::Offsets => self.ask("offset.list", &none, Asked::Offsets(number)),
            Order::Lines { text, wait } => {
                let params = json!({ "text": text, "wait": wait });
                self.ask("mdi.stream", &params, Asked::Order(number));
            }
            Order::Probe { text } => {
                // Where the contact was, in the unit of the program.
                let text = format!("{text}(DEBUG,PRB #5061 #5062 #5063 #5070 #<_metric>)\n");
                self.long = Some((number, Long::Probe, false));
                self.ask(
                    "mdi.stream",
                    &json!({ "text": text, "wait": true }),
                    Asked::Probe(number),
                );
            }
            Order::Jog {
                distance_mm,
                velocity_mm_s,
            } => self.jog(number, distance_mm, velocity_mm_s),
            Order::StopJog => self.ask("jog.stop", &none, Asked::Order(number)),
            Order::Hold => self.ask("hold", &none, Asked::Order(number)),
            Order::Resume => self.ask("resume", &none, Asked::Order(number)),
            Order::Stop => self.ask("stop", &none, Asked::Order(number)),
            Order::Off => self.ask("off", &none, Asked::Order(number)),
            Order::Feed(percent) => self.ask("override", &json!({ "feed": percent }), Asked::Order(number)),
            Order::Rapid(percent) => self.ask("override", &json!({ "rapid": percent }), Asked::Order(number)),
            Order::Spindle(percent) => self.ask("override", &json!({ "spindle": percent }), Asked::Order(number)),
            Order::Home => {
                self.long = Some((number, Long::Home, false));
                self.ask("home", &none, Asked::Begun(number));
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
            let params = json!({ "axis": axis, "distance_mm": distance_mm, "velocity_mm_s": velocity_mm_s.abs() });
            let asked = if axes.peek().is_none() {
                Asked::Order(number)
            } else {
                Asked::Nothing
            };
            self.ask("jog", &params, asked);
        }
    }

    /// `reads`: the sender takes what it is told; one that hangs does not go on with a jog.
    fn tick(&mut self, reads: bool) {
        self.session.tick();
        if self.session.is_jogging() && reads {
            self.ask("jog.keep", &json!({}), Asked::Nothing);
        }
    }

    /// The control has answered.
    fn heard(&mut self, line: &str) {
        let answer: Value = serde_json::from_str(line).unwrap_or_default();
        let Some(asked) = answer["id"].as_u64().and_then(|id| self.asked.remove(&id)) else {
            return;
        };
        let result = match answer.get("error") {
            Some(error) => Err(error["message"].as_str().unwrap_or("refused").to_owned()),
            None => Ok(&answer["result"]),
        };
        match (asked, result) {
            (Asked::Nothing, _) => {}
            (Asked::Control, result) => self.has_control = result.is_ok(),
            (Asked::Status(number), Ok(result)) => {
                let status = Box::new(self.status(result));
                self.go_on(result);
                self.session.answered(number, Ok(Answer::Status(status)));
            }
            (Asked::Offsets(number), Ok(result)) => {
                let offsets = Box::new(self.offsets(result));
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
    }

    /// What is under way for longer goes on, as the machine is now.
    fn go_on(&mut self, status: &Value) {
        let Some((number, long, true)) = self.long else { return };
        let job = status["job"].as_str();
        let alarm = || status["alarm"].as_str().unwrap_or("it was stopped").to_owned();
        let answer = match long {
            Long::Home => match job {
                None => return,
                Some("completed") => Ok(Answer::Done),
                Some(_) => Err(alarm()),
            },
            Long::Probe => {
                let texts = list(&status["messages"])
                    .iter()
                    .rev()
                    .filter_map(|entry| entry["text"].as_str());
                let told = texts.filter_map(|text| text.strip_prefix(PROBED)).next();
                match told.and_then(|told| self.probed(told, status)) {
                    Some(answer) => Ok(answer),
                    None => Err("where the probe touched is not known".into()),
                }
            }
            Long::Unlock { ticks, is_on_ordered } => {
                let power = status["power"].as_str().unwrap_or_default();
                let next = match power {
                    _ if ticks >= UNLOCK_TICKS => Some(Err(alarm())),
                    "on" if status["alarm"].is_null() => Some(Ok(Answer::Done)),
                    // Someone has to close it first.
                    "estop, chain open" => Some(Err("the chain of the emergency stop is open".into())),
                    _ => None,
                };
                let method = match power {
                    "estop" => Some("estop.reset"),
                    "alarm" => Some("alarm.acknowledge"),
                    "on" | "off" if !status["alarm"].is_null() => Some("alarm.acknowledge"),
                    "off" if !is_on_ordered => Some("on"),
                    _ => None,
                };
                match (next, method) {
                    (Some(answer), _) => answer,
                    (None, method) => {
                        let is_on_ordered = is_on_ordered || method == Some("on");
                        let ticks = ticks + 1;
                        let long = Long::Unlock { ticks, is_on_ordered };
                        self.long = Some((number, long, method.is_none()));
                        if let Some(method) = method {
                            self.ask(method, &json!({}), Asked::Begun(number));
                        }
                        return;
                    }
                }
            }
        };
        self.long = None;
        self.session.answered(number, answer);
    }

    /// What the message behind a probing move says: work coordinates in the unit of the program, whether it touched, whether that is mm.
    fn probed(&self, told: &str, status: &Value) -> Option<Answer> {
        let values: Vec<f64> = told
            .split_whitespace()
            .map(|word| word.parse().ok())
            .collect::<Option<_>>()?;
        let [x, y, z, touched, metric] = values.try_into().ok()?;
        let unit_mm = if metric == 1.0 { 1.0 } else { 25.4 };
        let offset = numbers(&status["work_offset_mm"]);
        let machine = |axis: usize, value: f64| value * unit_mm + offset.get(axis).copied().unwrap_or_default();
        Some(Answer::Probed {
            place_mm: [machine(0, x), machine(1, y), machine(2, z)],
            touched: touched == 1.0,
        })
    }

    fn status(&self, status: &Value) -> Status {
        let power = status["power"].as_str().unwrap_or_default();
        let alarm = status["alarm"].as_str().map(str::to_owned);
        let alarm = alarm.or_else(|| power.starts_with("estop").then(|| "emergency stop".to_owned()));
        let waiting = &status["waiting"];
        // What goes on by itself is no wait of somebody.
        let is_asked = matches!(waiting["for"].as_str(), Some("operator" | "tool-change"));
        let activity = match status["activity"].as_str().unwrap_or_default() {
            "running" if is_asked => Activity::Held,
            "running" | "checking" => Activity::Running,
            "held" | "away" | "returning" => Activity::Held,
            "homing" => Activity::Homing,
            "jogging" => Activity::Jogging,
            "stopping" => Activity::Stopping,
            _ => Activity::Idle,
        };
        let three = |name: &str| {
            let values = numbers(&status[name]);
            [0, 1, 2].map(|axis| values.get(axis).copied().unwrap_or_default())
        };
        let percent = |name: &str| number(&status["override"][name]).round().clamp(0.0, 999.0) as u16;
        let closed: Vec<u64> = ["lower", "upper"]
            .iter()
            .flat_map(|end| list(&status["limit_switches"][end]).iter().filter_map(Value::as_u64))
            .collect();
        let homed = list(&status["homed"]).len();
        Status {
            is_ready: power == "on" && homed >= self.joints && alarm.is_none(),
            alarm,
            activity,
            position_mm: three("position_mm"),
            work_offset_mm: three("work_offset_mm"),
            feed_mm_min: number(&status["velocity_mm_s"]) * 60.0,
            spindle: Spindle {
                on: status["spindle"]["on"] == true,
                speed_rpm: number(&status["spindle"]["speed_rpm"]),
            },
            flood: status["coolant"]["flood"] == true,
            mist: status["coolant"]["mist"] == true,
            overrides: Overrides {
                feed: percent("feed_percent"),
                rapid: percent("rapid_percent"),
                spindle: percent("spindle_percent"),
            },
            limits: [0, 1, 2].map(|axis| self.joints_of[axis].iter().any(|joint| closed.contains(joint))),
            probe: false,
            waiting: is_asked.then(|| waiting["text"].as_str().unwrap_or_default().to_owned()),
        }
    }

    fn offsets(&self, told: &Value) -> Offsets {
        let three = |place: &Value| ["X", "Y", "Z"].map(|axis| number(&place[axis]) * self.unit_mm);
        let mut offsets = Offsets::default();
        for (place, system) in offsets.systems.iter_mut().zip(list(&told["systems"])) {
            *place = three(&system["origin"]);
        }
        if told["g92_active"] == true {
            offsets.g92 = three(&told["g92"]);
        }
        offsets
    }
}

/// Length of the unit of the machine, mm.
fn unit_mm(told: &Value) -> f64 {
    if told["unit"] == "inch" { 25.4 } else { 1.0 }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_default()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn numbers(value: &Value) -> Vec<f64> {
    list(value).iter().map(number).collect()
}
