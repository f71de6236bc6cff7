//! What a running control can be asked for: the table of methods.
//!
//! In:  requests of clients; records and replies of the cycle thread; answers of the operator.
//! Out: answers, at once or when the bus or the operator has carried an order out.
//!
//! To add a method: a row of [`table`](mod@table) and its function.

mod arguments;
pub mod table;

pub use arguments::WORK_SYSTEMS;

use super::control::{Control, NAME_MAX, Needs, Who};
use super::paths::Paths;
use super::rpc::{Params, Request, RpcError, code, from_hex, to_hex};
use super::server::subscription::{self, RATE_MAX_HZ, Subscription};
use super::server::{Caller, ClientId, Serve, Ticket};
use super::uploads::{PART_MAX, Uploads};
use crate::api::network_view::NetworkView;
use crate::api::orders::{Jog, Order, OrderClient, Shown, Source};
use crate::bus::SDO_VALUE_MAX;
use crate::bus::service::{BusService, MailboxError, MailboxRequest};
use crate::config::{Config, JOINTS_MAX};
use crate::machine::faults::SILENCED;
use crate::machine::state::State;
use crate::program::outline::Left;
use crate::rt::joint_jog::JogMotion;
use crate::rt::logic::Desk as LogicDesk;
use crate::rt::overrides::Overridden;
use crate::rt::shared::RtStatus;
use files::read::PROGRAM_MAX;
use nix::sys::eventfd::EventFd;
use obd::AbortCode;
use serde_json::{Map, Value, json};
use std::sync::Arc;
use table::METHODS;

/// Values of pins, by name.
type Pins = dyn Fn(&str) -> Option<f64> + Send;

/// `None`: comes when the bus or the operator has done it.
type Answer = Option<Result<Value, RpcError>>;

/// A request that is being served.
struct Call<'a> {
    caller: &'a mut Caller,
    params: &'a Params,
    ticket: Ticket,
}

/// How far the program under way is; nothing where none is.
#[derive(Debug, Default)]
struct Progress {
    /// Of the whole program, at the overrides of the moment; `None`: nobody knows.
    remaining_s: Option<f64>,
    done_percent: Option<f64>,
    /// Why nobody knows, or what the time takes for granted.
    note: Option<String>,
}

/// Carried out.
fn done() -> Answer {
    Some(Ok(json!({})))
}

/// Numbers of the joints of a set.
fn numbers(joints: u64) -> Vec<usize> {
    (0..JOINTS_MAX).filter(|joint| joints >> joint & 1 == 1).collect()
}

fn table() -> Value {
    let methods = METHODS.iter().map(|method| {
        let params: Vec<&str> = method.params.iter().map(|param| param.name).collect();
        json!({ "name": method.name, "params": params, "does": method.does })
    });
    methods.collect()
}

/// Everything that methods can reach.
pub struct Methods {
    live: Arc<RtStatus>,
    bus: Box<dyn BusService>,
    /// What the machine file says.
    network: NetworkView,
    /// Orders under way that read: the others answer without a value.
    reading: Vec<Ticket>,
    /// Way to the operator.
    operator: OrderClient,
    control: Control,
    uploads: Uploads,
    paths: Paths,
    time_of_day: fn() -> f64,
    /// Its axes: what does not change.
    axes: Value,
    pins: Box<Pins>,
    logic: Arc<LogicDesk>,
    now_ns: fn() -> u64,
}

impl Methods {
    /// Methods of a control; `now_ns`: the clock of its bus.
    pub fn new(
        network: NetworkView,
        live: Arc<RtStatus>,
        bus: Box<dyn BusService>,
        operator: OrderClient,
        now_ns: fn() -> u64,
    ) -> Methods {
        Methods {
            live,
            bus,
            network,
            reading: Vec::new(),
            operator,
            control: Control::default(),
            uploads: Uploads::default(),
            paths: Paths::default(),
            time_of_day: || 0.0,
            axes: json!([]),
            pins: Box::new(|_| None),
            logic: Arc::default(),
            now_ns,
        }
    }

    /// Shows its axes, and its spindle and coolant as the pins have them; states are stamped with this time of day, too, s since
    /// 1970.
    pub fn of_machine(
        self,
        config: &Config,
        pins: impl Fn(&str) -> Option<f64> + Send + 'static,
        time_of_day: fn() -> f64,
    ) -> Methods {
        let axes = config.axes.iter().map(|map| {
            let (letter, unit) = (
                map.axis.letter().to_string(),
                if map.axis.is_rotary() { "degrees" } else { "mm" },
            );
            json!({ "axis": letter, "joints": map.joints, "unit": unit })
        });
        Methods {
            axes: axes.collect(),
            pins: Box::new(pins),
            time_of_day,
            ..self
        }
    }

    /// Shows its programs in Structured Text.
    pub fn with_logic(self, logic: Arc<LogicDesk>) -> Methods {
        Methods { logic, ..self }
    }

    fn logic_tasks(&self) -> Value {
        let tasks = self.logic.told().into_iter().map(|told| {
            json!({
                "name": told.name, "file": told.file, "period_ms": told.period_ms, "steps_max": told.steps_max,
                "scans": told.scans, "overruns": told.overruns, "overflows": told.overflows, "scan_us": told.scan_us,
                "scan_max_us": told.scan_max_us, "stands": told.stands, "forced": told.forced,
            })
        });
        json!({ "programs": tasks.collect::<Value>() })
    }

    /// The program that a call means.
    fn logic_task(&self, call: &Call<'_>) -> Result<usize, RpcError> {
        let name = call.params.text("program")?;
        self.logic
            .find(name)
            .map_err(|what| RpcError::new(code::INVALID_PARAMS, what))
    }

    fn logic_look(&self, call: &Call<'_>) -> Result<Value, RpcError> {
        let task = self.logic_task(call)?;
        let names: Vec<String> = call.params.text("variable")?.map(str::to_owned).into_iter().collect();
        let invalid = |what| RpcError::new(code::INVALID_PARAMS, what);
        let (time_ns, shown) = self.logic.look(task, &names).map_err(invalid)?;
        let variables = shown.into_iter().map(|shown| {
            let role = match shown.role {
                logic::Role::Input => "input",
                logic::Role::Output => "output",
                logic::Role::Internal => "internal",
            };
            json!({
                "name": shown.name, "type": shown.ty, "value": shown.value, "line": shown.line, "role": role,
                "retain": shown.retain, "pin": shown.pin, "forced": shown.forced,
            })
        });
        let name = self.logic.names()[task];
        Ok(json!({ "program": name, "time_ms": time_ns as f64 / 1e6, "variables": variables.collect::<Value>() }))
    }

    fn logic_force(&mut self, call: &Call<'_>) -> Result<Value, RpcError> {
        let task = self.logic_task(call)?;
        let variable = arguments::needed(call.params.text("variable")?, "variable", "a text")?;
        let value = arguments::needed(call.params.text("value")?, "value", "a text")?;
        let invalid = |what| RpcError::new(code::INVALID_PARAMS, what);
        let forced = self.logic.force(task, variable, value).map_err(invalid)?;
        self.note_logic(task, &format!("forced: {forced}"));
        Ok(json!({ "forced": forced }))
    }

    fn logic_release(&mut self, call: &Call<'_>) -> Result<Value, RpcError> {
        let task = self.logic_task(call)?;
        let variable = call.params.text("variable")?;
        let invalid = |what| RpcError::new(code::INVALID_PARAMS, what);
        let released = self.logic.release(task, variable).map_err(invalid)?;
        self.note_logic(task, &format!("released: {}", variable.unwrap_or("all that was forced")));
        Ok(json!({ "released": released }))
    }

    fn logic_reload(&mut self, call: &Call<'_>) -> Answer {
        let begun = self.logic_task(call).and_then(|task| {
            let refused = |what| RpcError::new(code::REFUSED, what);
            let state = self.live.snapshot().state;
            if !state.may_replace_logic() {
                let what = format!("the machine is {}: a program is only replaced while it rests", state.name());
                return Err(refused(what));
            }
            self.logic.replace(task, call.ticket).map_err(refused)
        });
        begun.err().map(Err)
    }

    /// For the journal; nobody waits for its answer.
    fn note_logic(&mut self, task: usize, what: &str) {
        let name = self.logic.names()[task].to_owned();
        let _ = self.operator.put(0, Order::Note(format!("warning: logic {name}: {what}")));
    }

    /// What the first spindle is told, if there is one.
    fn spindle(&self) -> Value {
        match (self.pins)("spindle.0.speed-out") {
            None => Value::Null,
            Some(speed_rpm) => json!({ "on": (self.pins)("spindle.0.on") == Some(1.0), "speed_rpm": speed_rpm }),
        }
    }

    fn coolant(&self) -> Value {
        let is_on = |name: &str| (self.pins)(name) == Some(1.0);
        json!({ "flood": is_on("iocontrol.0.coolant-flood"), "mist": is_on("iocontrol.0.coolant-mist") })
    }

    fn status(&mut self) -> Value {
        let live = self.live.snapshot();
        let shown = self.operator.shown();
        let Progress {
            remaining_s,
            done_percent,
            note,
        } = self.progress(&shown, live.way);
        json!({
            "api": table::API_VERSION,
            "version": env!("CARGO_PKG_VERSION"),
            "machine": self.network.machine,
            "file": self.network.file,
            "pid": std::process::id(),
            "state": format!("{:?}", live.state).to_lowercase(),
            "cycles": live.cycles,
            "cycles_skipped": live.cycles_skipped,
            "late_max_us": live.late_max_ns as f64 / 1e3,
            "homed": numbers(live.homed),
            "line": live.line,
            "direction": if live.reversing { "reverse" } else { "forward" },
            "single_block": live.single_block,
            "optional_stop": live.optional_stop,
            "block_delete": shown.block_delete,
            "velocity_mm_s": live.velocity_mm_s,
            "axes": self.axes,
            "position_mm": live.position.0,
            "spindle": self.spindle(),
            "coolant": self.coolant(),
            "override": self.overrides(),
            "step": shown.step,
            "power": shown.power,
            "next": shown.next,
            "mode": shown.mode,
            "activity": shown.activity,
            "job": shown.job,
            "program": shown.program,
            "mdi": shown.mdi,
            "waiting": shown.waiting,
            "codes": shown.codes,
            "tool": shown.tool,
            "work_offset_mm": shown.work_offset,
            "work_rotation_degrees": shown.work_rotation_degrees,
            "elapsed_s": live.elapsed_s,
            "remaining_s": remaining_s,
            "done_percent": done_percent,
            "remaining_note": note,
            "estop_chain_open": live.chain_open,
            "held_at_mm": live.held_at.map(|place| place.0),
            "limit_switches": { "lower": numbers(live.limits[0]), "upper": numbers(live.limits[1]) },
            "alarm": shown.alarm,
            "obstruction": shown.obstruction,
            "messages": shown.messages,
            "control": self.control.shown((self.now_ns)()),
            "parts": shown.parts,
            "runs_left": shown.runs_left,
            "last_program": shown.last_program,
        })
    }

    /// How far the program is.
    fn progress(&self, shown: &Shown, way: f64) -> Progress {
        let outline = shown.program.as_ref().and_then(|program| program.outline.as_ref());
        let Some(outline) = outline else {
            return Progress::default();
        };
        let shares = [Overridden::Feed, Overridden::Rapid].map(|what| self.live.overrides.share(what));
        let assumes = outline.assumes().map(str::to_owned);
        match outline.left(way, self.live.lead(), shares) {
            Some(Left { done, time_s }) => Progress {
                remaining_s: time_s,
                done_percent: Some(100.0 * done),
                note: match time_s {
                    None => Some("not known while an override is at 0 %".into()),
                    Some(_) => assumes,
                },
            },
            None => Progress {
                note: Some("not known: it has gone on beyond its end as it was checked".into()),
                ..Progress::default()
            },
        }
    }

    /// Where the overrides stand, and whether the program lets them act at the moment.
    fn overrides(&self) -> Value {
        let percent = |what| self.live.overrides.percent(what);
        let enables = self.live.snapshot().enables;
        json!({
            "feed_percent": percent(Overridden::Feed),
            "rapid_percent": percent(Overridden::Rapid),
            "spindle_percent": percent(Overridden::Spindle),
            "feed_acts": enables.feed_override,
            "spindle_acts": enables.spindle_override,
            "adaptive_feed_acts": enables.adaptive_feed,
            "feed_hold_acts": enables.feed_hold,
        })
    }

    fn subscribe(&mut self, call: &mut Call<'_>) -> Result<Value, RpcError> {
        let rate_hz = match call.params.has("rate_hz") {
            true => call.params.number("rate_hz", 1, RATE_MAX_HZ)?,
            false => RATE_MAX_HZ,
        };
        let (subscription, answer) = Subscription::begin(&self.state(), rate_hz);
        call.caller.subscription = Some(subscription);
        Ok(answer)
    }

    fn take_control(&mut self, call: &mut Call<'_>) -> Result<Value, RpcError> {
        let force = call.params.has("force") && call.params.flag("force")?;
        let mut who = who(call.caller);
        if let Some(name) = call.params.text("name")? {
            if name.is_empty() || name.len() > NAME_MAX || name.contains(char::is_control) {
                let what = format!("parameter \"name\": expected one to {NAME_MAX} octets that can be printed");
                return Err(RpcError::new(code::INVALID_PARAMS, what));
            }
            name.clone_into(&mut who.name);
        }
        let now_ns = (self.now_ns)();
        if let Some(before) = self.control.take(who.clone(), force, now_ns)? {
            let [new, old] = [&who, &before].map(|who| format!("{} (process {})", who.name, who.process));
            // Nobody waits for its answer.
            let _ = self
                .operator
                .put(0, Order::TakenOver(format!("control: {new} has taken it from {old}")));
        }
        Ok(self.control.shown(now_ns))
    }

    fn begin_upload(&mut self, call: &Call<'_>) -> Result<Value, RpcError> {
        let octets = call.params.number("octets", 0, u64::MAX)?;
        let name = call.params.text("name")?;
        let name = arguments::needed(name, "name", "a text")?;
        let upload = self.uploads.begin(call.caller.client, name, octets, (self.now_ns)())?;
        Ok(json!({ "upload": upload, "part_octets": PART_MAX }))
    }

    fn append_upload(&mut self, call: &Call<'_>) -> Result<Value, RpcError> {
        let (upload, part) = (upload(call.params)?, call.params.octets("value", PART_MAX)?);
        let at = call.params.number("at", 0, PROGRAM_MAX)?;
        let received = (self.uploads).append(call.caller.client, upload, at, &part, (self.now_ns)())?;
        Ok(json!({ "received": received }))
    }

    fn commit_upload(&mut self, call: &Call<'_>) -> Result<Value, RpcError> {
        let (upload, sum) = (upload(call.params)?, call.params.octets("sha256", 32)?);
        (self.uploads).commit(call.caller.client, upload, &sum, (self.now_ns)())?;
        Ok(json!({}))
    }

    fn begin_path(&mut self, call: &Call<'_>) -> Answer {
        let begun = arguments::tolerance_mm(call.params)
            .and_then(|tolerance_mm| self.paths.begin(call.caller.client, tolerance_mm, (self.now_ns)()));
        self.order_of(call, begun.map(Order::Path))
    }

    fn next_of_path(&mut self, call: &Call<'_>) -> Answer {
        let number = match call.params.number("path", 0, u64::from(u32::MAX)) {
            Ok(number) => number,
            Err(error) => return Some(Err(error)),
        };
        (self.paths).next(call.caller.client, number, call.ticket, (self.now_ns)())
    }

    /// The program of "program.load" and "program.run".
    fn source(&mut self, call: &Call<'_>) -> Result<Source, RpcError> {
        if !call.params.has("upload") {
            return arguments::source(call.params);
        }
        if let Some(other) = ["path", "name", "text"].iter().find(|name| call.params.has(name)) {
            let what = format!("expected \"upload\" alone, got \"{other}\", too");
            return Err(RpcError::new(code::INVALID_PARAMS, what));
        }
        let whole = (self.uploads).whole(call.caller.client, upload(call.params)?, (self.now_ns)())?;
        Ok(Source::Uploaded(whole))
    }

    /// Turns overrides: all that are given, or none where one of them cannot be. No way over the operator's inbox: whoever
    /// cuts turns the feed down because he hears something.
    fn set_overrides(&mut self, call: &mut Call<'_>) -> Result<Value, RpcError> {
        let params = call.params;
        let invalid = |what: String| RpcError::new(code::INVALID_PARAMS, what);
        let mut wanted = Vec::new();
        for what in Overridden::ALL {
            if let Some(percent) = params.real(what.name())? {
                self.live.overrides.check(what, percent).map_err(invalid)?;
                wanted.push((what, percent));
            }
        }
        if wanted.is_empty() {
            let what = "expected \"feed\", \"rapid\" or \"spindle\", in percent of what is programmed";
            return Err(invalid(what.into()));
        }
        let is_slower = |(what, percent): &(Overridden, f64)| {
            *what != Overridden::Spindle && *percent <= self.live.overrides.percent(*what)
        };
        if !wanted.iter().all(is_slower) {
            self.permit(call.caller, Needs::Control)?;
        }
        for (what, percent) in wanted {
            self.live.overrides.order(what, percent).map_err(invalid)?;
        }
        Ok(self.overrides())
    }

    fn permit(&mut self, caller: &Caller, needs: Needs) -> Result<(), RpcError> {
        let now_ns = (self.now_ns)();
        self.control.permit(caller.client, || who(caller), needs, now_ns)
    }

    fn order_of(&mut self, call: &Call<'_>, order: Result<Order, RpcError>) -> Answer {
        match order {
            Ok(order) => self.order(call, order),
            Err(error) => Some(Err(error)),
        }
    }

    fn order(&mut self, call: &Call<'_>, order: Order) -> Answer {
        match self.operator.put(call.ticket, order) {
            Ok(()) => None,
            Err(what) => Some(Err(RpcError::new(code::REFUSED, what))),
        }
    }

    /// What concerns jogs under way: of one axis or joint, or all.
    fn jogging(&mut self, call: &Call<'_>, motion: JogMotion) -> Answer {
        let what = arguments::jogged(call.params);
        self.order_of(call, what.map(|what| Order::Jog(Jog { what, motion })))
    }

    fn network(&mut self) -> Result<Value, RpcError> {
        let now_ns = (self.now_ns)();
        let mut view = self.network.clone();
        view.live = self.bus.network(now_ns);
        for (place, node) in view.nodes.iter_mut().enumerate() {
            node.live = self.bus.node(place, now_ns);
        }
        serde_json::to_value(view).map_err(|error| RpcError::new(code::REFUSED, error.to_string()))
    }

    fn sdo(&mut self, call: &Call<'_>, write: bool) -> Answer {
        match self.sdo_order(call.params, call.ticket, write) {
            Ok(()) => None,
            Err(error) => Some(Err(error)),
        }
    }

    fn sdo_order(&mut self, params: &Params, ticket: Ticket, write: bool) -> Result<(), RpcError> {
        let id = params.number("node", 1, 239)?;
        let index = params.number("index", 0, 0xFFFF)? as u16;
        let sub = params.number("sub", 0, 0xFF)? as u8;
        let value = match write {
            true => params.octets("value", SDO_VALUE_MAX)?,
            false => Vec::new(),
        };
        let node = self.network.nodes.iter().position(|node| u64::from(node.id) == id);
        let Some(node) = node else {
            let ids: Vec<String> = self.network.nodes.iter().map(|node| node.id.to_string()).collect();
            let what = format!("no node has the id {id}; nodes are {}", ids.join(", "));
            return Err(RpcError::new(code::INVALID_PARAMS, what));
        };
        let request = MailboxRequest {
            ticket,
            node,
            index,
            sub,
            value: write.then_some(value),
        };
        self.bus.request(request).map_err(|_| {
            let what = "as many objects as possible are being read or written already";
            RpcError::new(code::REFUSED, what)
        })?;
        if !write {
            self.reading.push(ticket);
        }
        Ok(())
    }
}

impl Serve for Methods {
    fn call(&mut self, caller: &mut Caller, request: &Request, ticket: Ticket) -> Option<Result<Value, RpcError>> {
        let now_ns = (self.now_ns)();
        self.control.hear(caller.client, now_ns);
        self.uploads.forget_idle(now_ns);
        self.paths.forget_idle(now_ns);
        let Some(method) = METHODS.iter().find(|method| method.name == request.method) else {
            let known: Vec<&str> = METHODS.iter().map(|method| method.name).collect();
            let what = format!("no method \"{}\"; there are {}", request.method, known.join(", "));
            return Some(Err(RpcError::new(code::METHOD_NOT_FOUND, what)));
        };
        let params: Vec<&str> = method.params.iter().map(|param| param.name).collect();
        if let Err(error) = request.params.only(&params) {
            return Some(Err(error));
        }
        if !method.looks && self.live.snapshot().state == State::Silenced {
            return Some(Err(RpcError::new(code::REFUSED, SILENCED)));
        }
        let permitted = self.permit(caller, method.needs);
        let mut call = Call {
            caller,
            params: &request.params,
            ticket,
        };
        let answer = match permitted {
            Ok(()) => (method.call)(self, &mut call),
            Err(error) => Some(Err(error)),
        };
        match &answer {
            Some(Err(error)) => tracing::info!(ticket, method = method.name, error = error.message, "refused"),
            _ if method.looks => tracing::trace!(ticket, method = method.name),
            _ => tracing::info!(ticket, method = method.name),
        }
        answer
    }

    fn later(&mut self) -> Option<(Ticket, Result<Value, RpcError>)> {
        if let Some((ticket, result)) = self.operator.answer() {
            if let Err(error) = &result {
                tracing::info!(ticket, error = error.message, "refused");
            }
            return Some((ticket, result));
        }
        if let Some((ticket, replaced)) = self.logic.replaced() {
            let result = replaced
                .map(|(task, carried)| {
                    self.note_logic(task, "replaced by its changed file");
                    json!({ "carried": carried })
                })
                .map_err(|what| RpcError::new(code::REFUSED, what));
            return Some((ticket, result));
        }
        if let Some(part) = self.paths.later() {
            return Some(part);
        }
        let reply = self.bus.reply()?;
        let read = self.reading.iter().position(|ticket| *ticket == reply.ticket);
        if let Some(at) = read {
            self.reading.swap_remove(at);
        }
        let result = match reply.result {
            Ok(value) if read.is_some() => Ok(json!({ "value": to_hex(&value) })),
            Ok(_) => Ok(json!({})),
            Err(MailboxError::Aborted(abort)) => {
                let what = format!("{} (0x{:08X})", abort.text(), abort.0);
                let kind = match abort {
                    AbortCode::NO_OBJECT => code::NODE_NO_OBJECT,
                    _ => code::NODE_ABORT,
                };
                Err(RpcError::new(kind, what))
            }
            Err(MailboxError::Failed(what)) => Err(RpcError::new(code::NODE, what)),
        };
        Some((reply.ticket, result))
    }

    fn gone(&mut self, ticket: Ticket) -> bool {
        self.paths.gone(ticket);
        // What a node was asked goes its way.
        self.operator.withdraw(ticket)
    }

    fn keeps(&self, client: ClientId) -> bool {
        self.control.is_taken_by(client)
    }

    fn left(&mut self, client: ClientId) {
        self.control.release(client);
        self.uploads.left(client);
        self.paths.left(client);
    }

    fn state(&mut self) -> subscription::State {
        let fields = match self.status() {
            Value::Object(fields) => fields,
            _ => Map::new(),
        };
        subscription::State {
            monotonic_ns: (self.now_ns)(),
            unix_s: (self.time_of_day)(),
            fields,
        }
    }

    fn wake(&self) -> Option<Arc<EventFd>> {
        self.operator.wake()
    }
}

fn upload(params: &Params) -> Result<u64, RpcError> {
    params.number("upload", 0, u64::from(u32::MAX))
}

/// Who somebody is, as far as the system tells.
fn who(caller: &Caller) -> Who {
    let name = std::fs::read_to_string(format!("/proc/{}/comm", caller.process)).unwrap_or_default();
    let name = name.trim_end();
    Who {
        client: caller.client,
        process: caller.process,
        name: if name.is_empty() { "a client" } else { name }.to_owned(),
    }
}

/// The value of an answer to "bus.sdo_read".
pub fn value_of(answer: &Value) -> Option<Vec<u8>> {
    from_hex(answer.get("value")?.as_str()?)
}

#[cfg(test)]
mod tests;
