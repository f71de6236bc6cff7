//! What a running control can be asked for: the table of methods.
//!
//! In:  requests of clients; records and replies of the cycle thread; answers of the operator.
//! Out: answers, at once or when the bus or the operator has carried an order out.
//!
//! To add a method: a line in [`METHODS`] and its function.

use super::rpc::{Params, Request, RpcError, code, from_hex, to_hex};
use super::server::{Serve, Ticket};
use crate::api::network_view::NetworkView;
use crate::api::orders::{Jog, Jogged, Order, OrderClient, Source};
use crate::bus::SDO_VALUE_MAX;
use crate::bus::service::{BusService, MailboxError, MailboxRequest};
use crate::config::JOINTS_MAX;
use crate::machine::faults::SILENCED;
use crate::machine::state::State;
use crate::rt::joint_jog::JogMotion;
use crate::rt::overrides::Overridden;
use crate::rt::shared::RtStatus;
use motion::canon::Axis;
use obd::AbortCode;
use serde_json::{Value, json};
use std::sync::Arc;

pub struct Method {
    pub name: &'static str,
    /// Names of its parameters.
    pub params: &'static [&'static str],
    /// What it does.
    pub does: &'static str,
    /// Looks and changes nothing: answered also where the network is silenced.
    looks: bool,
    call: fn(&mut Methods, &Params, Ticket) -> Answer,
}

/// `None`: comes when the bus has done it.
type Answer = Option<Result<Value, RpcError>>;

pub const METHODS: &[Method] = &[
    Method {
        name: "methods",
        params: &[],
        does: "this table",
        looks: true,
        call: |_, _, _| Some(Ok(table())),
    },
    Method {
        name: "status",
        params: &[],
        does: "machine, process, state, cycles, position, program, alarm",
        looks: true,
        call: |methods, _, _| Some(Ok(methods.status())),
    },
    Method {
        name: "bus.network",
        params: &[],
        does: "the network and its nodes: what they are, how they are, why they are not operational",
        looks: true,
        call: |methods, _, _| Some(methods.network()),
    },
    Method {
        name: "bus.sdo_read",
        params: &["node", "index", "sub"],
        does: "reads an object of a node; its octets as hexadecimal digits in \"value\"",
        looks: false,
        call: |methods, params, ticket| methods.sdo(params, ticket, false),
    },
    Method {
        name: "bus.sdo_write",
        params: &["node", "index", "sub", "value"],
        does: "writes an object of a node; \"value\" holds its octets as hexadecimal digits",
        looks: false,
        call: |methods, params, ticket| methods.sdo(params, ticket, true),
    },
    Method {
        name: "program.run",
        params: &["path", "name", "text"],
        does: "checks a program, switches drives on, homes, runs it, switches drives off; only while standing by. A file \
               that the control may read (\"path\", absolute), or \"text\" and its \"name\"",
        looks: false,
        call: |methods, params, ticket| match source(params) {
            Ok(source) => methods.order(ticket, Order::Run(source)),
            Err(error) => Some(Err(error)),
        },
    },
    Method {
        name: "enable",
        params: &[],
        does: "switches drives on, to home and jog by hand; moves nothing; only while standing by. \"stop\" switches them off",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::Enable),
    },
    Method {
        name: "home",
        params: &[],
        does: "homes all joints, Z first; switches drives on if they are off, and leaves them on",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::Home),
    },
    Method {
        name: "jog",
        params: &["axis", "joint", "velocity_mm_s", "distance_mm"],
        does: "moves an \"axis\" (letter) or a \"joint\" (number) by hand: at a velocity, whose sign is the direction, as far \
               as the soft limit; or by \"distance_mm\", which adds up. Holds for 0.2 s: renew it with \"jog.keep\"",
        looks: false,
        call: |methods, params, ticket| match jog(params) {
            Ok(jog) => methods.order(ticket, Order::Jog(jog)),
            Err(error) => Some(Err(error)),
        },
    },
    Method {
        name: "jog.keep",
        params: &["axis", "joint"],
        does: "the hand is still on the key: what is being jogged goes on for another 0.2 s; begins nothing",
        looks: false,
        call: |methods, params, ticket| methods.jogging(params, ticket, JogMotion::Keep),
    },
    Method {
        name: "jog.stop",
        params: &["axis", "joint"],
        does: "lets an axis, a joint or all that is being jogged come to rest",
        looks: false,
        call: |methods, params, ticket| methods.jogging(params, ticket, JogMotion::Release),
    },
    Method {
        name: "hold",
        params: &[],
        does: "brings the program to rest on its path and keeps it; a jog is over",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::Hold),
    },
    Method {
        name: "resume",
        params: &[],
        does: "goes on after a hold, and forward after \"reverse\"; in single block, runs the next block",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::Resume),
    },
    Method {
        name: "reverse",
        params: &["percent"],
        does: "runs the program that runs or is held back along the path it has run, at \"percent\" (above 0 to 100, usually 100) \
               of its speed, as far as the last block that moves nothing or turns with the spindle; \"hold\" rests, \"resume\" \
               goes forward again",
        looks: false,
        call: |methods, params, ticket| match reverse_share(params) {
            Ok(share) => methods.order(ticket, Order::Reverse(share)),
            Err(error) => Some(Err(error)),
        },
    },
    Method {
        name: "single_block",
        params: &["on"],
        does: "\"on\" (true or false): the program rests at the end of each block, \"resume\" runs the next one; what is planned \
               from now on stops at the end of each block exactly",
        looks: false,
        call: |methods, params, ticket| match params.flag("on") {
            Ok(on) => methods.order(ticket, Order::SingleBlock(on)),
            Err(error) => Some(Err(error)),
        },
    },
    Method {
        name: "stop",
        params: &[],
        does: "brings the machine to rest, a program on its path, gives it up and switches drives off",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::Stop),
    },
    Method {
        name: "override",
        params: &["feed", "rapid", "spindle"],
        does: "from now on feed (0 to 120), rapid moves (0 to 100) and the spindle (50 to 120) run at this many percent of what \
               is programmed; 0 holds these moves. At any time, for all programs; one that has switched overrides off (M49) \
               is not changed there",
        looks: false,
        call: |methods, params, _| Some(methods.set_overrides(params)),
    },
    Method {
        name: "alarm.acknowledge",
        params: &[],
        does: "allows motion again after a fault whose cause is gone; moves nothing and switches nothing on",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::Acknowledge),
    },
];

/// What "jog" is to do.
fn jog(params: &Params) -> Result<Jog, RpcError> {
    let invalid = |what: &str| Err(RpcError::new(code::INVALID_PARAMS, what));
    let Some(what) = jogged(params)? else {
        return invalid("expected \"axis\" or \"joint\"");
    };
    let velocity_mm_s = params.real("velocity_mm_s")?;
    let motion = match (velocity_mm_s, params.real("distance_mm")?) {
        (None, _) => return invalid("parameter \"velocity_mm_s\": expected a number, it is missing"),
        (Some(0.0), _) => return invalid("parameter \"velocity_mm_s\": expected a velocity, got 0"),
        (Some(velocity_mm_s), None) => JogMotion::Run { velocity_mm_s },
        (Some(velocity_mm_s), Some(distance_mm)) => JogMotion::Advance {
            distance_mm,
            velocity_mm_s,
        },
    };
    Ok(Jog {
        what: Some(what),
        motion,
    })
}

/// The share of "reverse".
fn reverse_share(params: &Params) -> Result<f64, RpcError> {
    let percent = params.real("percent")?.unwrap_or(100.0);
    if percent > 0.0 && percent <= 100.0 {
        return Ok(percent / 100.0);
    }
    let what = format!("parameter \"percent\": expected a number above 0 and up to 100, got {percent}");
    Err(RpcError::new(code::INVALID_PARAMS, what))
}

/// The axis or joint of a jog, if one is given.
fn jogged(params: &Params) -> Result<Option<Jogged>, RpcError> {
    let invalid = |what: String| RpcError::new(code::INVALID_PARAMS, what);
    let axis = match params.text("axis")? {
        None => None,
        Some(text) => {
            let mut letters = text.chars();
            let axis = letters.next().filter(|_| letters.as_str().is_empty());
            let axis = axis.and_then(Axis::from_letter);
            let wrong = || {
                invalid(format!(
                    "parameter \"axis\": expected one of X Y Z A B C U V W, got \"{text}\""
                ))
            };
            Some(Jogged::Axis(axis.ok_or_else(wrong)?))
        }
    };
    if !params.has("joint") {
        return Ok(axis);
    }
    let joint = params.number("joint", 0, JOINTS_MAX as u64 - 1)? as usize;
    match axis {
        None => Ok(Some(Jogged::Joint(joint))),
        Some(_) => Err(invalid("expected \"axis\" or \"joint\", not both".into())),
    }
}

/// The program of "program.run".
fn source(params: &Params) -> Result<Source, RpcError> {
    let invalid = |what: &str| Err(RpcError::new(code::INVALID_PARAMS, what));
    match (params.text("path")?, params.text("name")?, params.text("text")?) {
        (Some(path), None, None) if path.starts_with('/') => Ok(Source::File(path.into())),
        (Some(path), None, None) => {
            let what = format!("parameter \"path\": expected an absolute path, got \"{path}\"");
            Err(RpcError::new(code::INVALID_PARAMS, what))
        }
        (None, name, Some(text)) => {
            let name = name.unwrap_or("program").to_owned();
            let text = text.to_owned();
            Ok(Source::Text { name, text })
        }
        (None, _, None) => invalid("expected \"path\", or \"text\" and \"name\""),
        (Some(_), _, _) => invalid("expected \"path\" alone, or \"text\" and \"name\""),
    }
}

fn table() -> Value {
    let methods = METHODS
        .iter()
        .map(|method| json!({ "name": method.name, "params": method.params, "does": method.does }));
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
            now_ns,
        }
    }

    fn status(&self) -> Value {
        let live = self.live.snapshot();
        let shown = self.operator.shown();
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "machine": self.network.machine,
            "file": self.network.file,
            "pid": std::process::id(),
            "state": format!("{:?}", live.state).to_lowercase(),
            "cycles": live.cycles,
            "cycles_skipped": live.cycles_skipped,
            "late_max_us": live.late_max_ns as f64 / 1e3,
            "homed": (0..JOINTS_MAX).filter(|joint| live.homed >> joint & 1 == 1).collect::<Vec<_>>(),
            "line": live.line,
            "direction": if live.reversing { "reverse" } else { "forward" },
            "single_block": live.single_block,
            "velocity_mm_s": live.velocity_mm_s,
            "position_mm": live.position.0,
            "override": self.overrides(),
            "step": shown.step,
            "program": shown.program,
            "alarm": shown.alarm,
            "obstruction": shown.obstruction,
        })
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

    /// Turns overrides: all that are given, or none where one of them cannot be. No way over the operator's inbox: whoever
    /// cuts turns the feed down because he hears something.
    fn set_overrides(&self, params: &Params) -> Result<Value, RpcError> {
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
        for (what, percent) in wanted {
            self.live.overrides.order(what, percent).map_err(invalid)?;
        }
        Ok(self.overrides())
    }

    fn order(&mut self, ticket: Ticket, order: Order) -> Answer {
        match self.operator.put(ticket, order) {
            Ok(()) => None,
            Err(what) => Some(Err(RpcError::new(code::REFUSED, what))),
        }
    }

    /// What concerns jogs under way: of one axis or joint, or all.
    fn jogging(&mut self, params: &Params, ticket: Ticket, motion: JogMotion) -> Answer {
        match jogged(params) {
            Ok(what) => self.order(ticket, Order::Jog(Jog { what, motion })),
            Err(error) => Some(Err(error)),
        }
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

    fn sdo(&mut self, params: &Params, ticket: Ticket, write: bool) -> Answer {
        match self.sdo_order(params, ticket, write) {
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
    fn call(&mut self, request: &Request, ticket: Ticket) -> Option<Result<Value, RpcError>> {
        let Some(method) = METHODS.iter().find(|method| method.name == request.method) else {
            let known: Vec<&str> = METHODS.iter().map(|method| method.name).collect();
            let what = format!("no method \"{}\"; there are {}", request.method, known.join(", "));
            return Some(Err(RpcError::new(code::METHOD_NOT_FOUND, what)));
        };
        if let Err(error) = request.params.only(method.params) {
            return Some(Err(error));
        }
        if !method.looks && self.live.snapshot().state == State::Silenced {
            return Some(Err(RpcError::new(code::REFUSED, SILENCED)));
        }
        let answer = (method.call)(self, &request.params, ticket);
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
        // What a node was asked goes its way.
        self.operator.withdraw(ticket)
    }
}

/// The value of an answer to "bus.sdo_read".
pub fn value_of(answer: &Value) -> Option<Vec<u8>> {
    from_hex(answer.get("value")?.as_str()?)
}

#[cfg(test)]
mod tests;
