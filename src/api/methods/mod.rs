//! What a running control can be asked for: the table of methods.
//!
//! In:  requests of clients; records and replies of the cycle thread; answers of the operator.
//! Out: answers, at once or when the bus or the operator has carried an order out.
//!
//! To add a method: a line in [`METHODS`] and its function.

mod arguments;

use super::rpc::{Params, Request, RpcError, code, from_hex, to_hex};
use super::server::{Serve, Ticket};
use crate::api::network_view::NetworkView;
use crate::api::orders::{Jog, Order, OrderClient};
use crate::bus::SDO_VALUE_MAX;
use crate::bus::service::{BusService, MailboxError, MailboxRequest};
use crate::config::JOINTS_MAX;
use crate::machine::faults::SILENCED;
use crate::machine::state::State;
use crate::rt::joint_jog::JogMotion;
use crate::rt::overrides::Overridden;
use crate::rt::shared::RtStatus;
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
        name: "on",
        params: &[],
        does: "switches drives on; moves nothing, and homes nothing",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::On),
    },
    Method {
        name: "off",
        params: &[],
        does: "brings the machine to rest and switches drives off",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::Off),
    },
    Method {
        name: "estop",
        params: &[],
        does: "emergency stop: quick stop of all drives, spindle and coolant off, until \"estop.reset\". Not a safety function",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::Estop),
    },
    Method {
        name: "estop.reset",
        params: &[],
        does: "the emergency stop is over, once its chain is closed; switches nothing on",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::EstopReset),
    },
    Method {
        name: "home",
        params: &["joints"],
        does: "homes the \"joints\" of a list of numbers, all without it, in the order of their \"sequence\"; switches drives on if \
               they are off, and leaves them on",
        looks: false,
        call: |methods, params, ticket| match params.numbers("joints", 0, JOINTS_MAX as u64 - 1) {
            Ok(joints) => methods.order(
                ticket,
                Order::Home(joints.into_iter().map(|joint| joint as usize).collect()),
            ),
            Err(error) => Some(Err(error)),
        },
    },
    Method {
        name: "program.load",
        params: &["path", "name", "text"],
        does: "checks a program and keeps it for \"program.start\". A file that the control may read (\"path\", absolute), or \
               \"text\" and its \"name\"",
        looks: false,
        call: |methods, params, ticket| methods.order_of(ticket, arguments::source(params).map(Order::Load)),
    },
    Method {
        name: "program.start",
        params: &["from_line", "yes"],
        does: "runs the program that is loaded; drives are on and joints homed before. Before a line (\"from_line\"): refused with what \
               that means, one sentence a line, until \"yes\" is true",
        looks: false,
        call: |methods, params, ticket| methods.order_of(ticket, arguments::start(params)),
    },
    Method {
        name: "program.run",
        params: &["path", "name", "text"],
        does: "checks a program, switches drives on if they are off, homes joints that are not, runs it; drives stay on. \
               Parameters as of \"program.load\"",
        looks: false,
        call: |methods, params, ticket| methods.order_of(ticket, arguments::source(params).map(Order::Run)),
    },
    Method {
        name: "mdi",
        params: &["line"],
        does: "runs a \"line\" of G-code in the modes that the one before has left, behind those that wait; answered when it begins",
        looks: false,
        call: |methods, params, ticket| methods.order_of(ticket, arguments::line(params).map(Order::Mdi)),
    },
    Method {
        name: "touch_off",
        params: &["axis", "value", "system", "tool"],
        does: "the \"axis\" reads \"value\" (unit of the machine) where it stands: in a work \"system\" (G54 to G59.3, else the one in \
               force), or once the length of a \"tool\" is in force",
        looks: false,
        call: |methods, params, ticket| methods.order_of(ticket, arguments::touch_off(params).map(Order::Change)),
    },
    Method {
        name: "offset.list",
        params: &[],
        does: "origins of G54 to G59.3 and G92",
        looks: true,
        call: |methods, _, ticket| methods.order(ticket, Order::Offsets),
    },
    Method {
        name: "offset.set",
        params: &["system", "axis", "value"],
        does: "puts the origin of a work \"system\" (else the one in force) on an \"axis\" to this \"value\", machine coordinates",
        looks: false,
        call: |methods, params, ticket| methods.order_of(ticket, arguments::offset(params).map(Order::Change)),
    },
    Method {
        name: "tool.list",
        params: &[],
        does: "the tool table, and the tool in the spindle",
        looks: true,
        call: |methods, _, ticket| methods.order(ticket, Order::Tools),
    },
    Method {
        name: "tool.set",
        params: &["tool", "length", "diameter"],
        does: "\"length\" or \"diameter\" of a \"tool\", or both, in the unit of the machine; one that the table lacks is added",
        looks: false,
        call: |methods, params, ticket| methods.order_of(ticket, arguments::tool(params).map(Order::Change)),
    },
    Method {
        name: "tool.changed",
        params: &[],
        does: "the tool that the program waits for is in the spindle",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::ToolChanged),
    },
    Method {
        name: "jog",
        params: &["axis", "joint", "velocity_mm_s", "distance_mm"],
        does: "moves an \"axis\" (letter) or a \"joint\" (number) by hand: at a velocity, whose sign is the direction, as far \
               as the soft limit; or by \"distance_mm\", which adds up. Holds for 0.2 s: renew it with \"jog.keep\"",
        looks: false,
        call: |methods, params, ticket| methods.order_of(ticket, arguments::jog(params).map(Order::Jog)),
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
        does: "brings the program to rest on its path and keeps it: it may be jogged away then; a jog or a way back is over",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::Hold),
    },
    Method {
        name: "resume",
        params: &[],
        does: "goes on after a hold, and forward after \"reverse\"; in single block, runs the next block. Of a machine that was jogged \
               away: returns to where the program is held, Z up first (\"returns\": the legs), and waits there for the next one",
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
        call: |methods, params, ticket| methods.order_of(ticket, arguments::reverse_share(params).map(Order::Reverse)),
    },
    Method {
        name: "single_block",
        params: &["on"],
        does: "\"on\" (true or false): the program rests at the end of each block, \"resume\" runs the next one; what is planned \
               from now on stops at the end of each block exactly",
        looks: false,
        call: |methods, params, ticket| methods.order_of(ticket, params.flag("on").map(Order::SingleBlock)),
    },
    Method {
        name: "stop",
        params: &[],
        does: "brings the machine to rest, a program on its path, and gives it up; spindle and coolant go off, drives stay on",
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
        name: "journal.since",
        params: &["seq"],
        does: "entries of the journal behind number \"seq\" (0: all that are known), the oldest first, up to 500; \"more\": there are \
               others behind them",
        looks: true,
        call: |methods, params, ticket| {
            let since = if params.has("seq") {
                params.number("seq", 0, u64::MAX)
            } else {
                Ok(0)
            };
            methods.order_of(ticket, since.map(Order::Journal))
        },
    },
    Method {
        name: "alarm.acknowledge",
        params: &[],
        does: "allows motion again after a fault whose cause is gone; moves nothing and switches nothing on",
        looks: false,
        call: |methods, _, ticket| methods.order(ticket, Order::Acknowledge),
    },
];

/// Numbers of the joints of a set.
fn numbers(joints: u64) -> Vec<usize> {
    (0..JOINTS_MAX).filter(|joint| joints >> joint & 1 == 1).collect()
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
            "homed": numbers(live.homed),
            "line": live.line,
            "direction": if live.reversing { "reverse" } else { "forward" },
            "single_block": live.single_block,
            "velocity_mm_s": live.velocity_mm_s,
            "position_mm": live.position.0,
            "override": self.overrides(),
            "step": shown.step,
            "power": shown.power,
            "mode": shown.mode,
            "activity": shown.activity,
            "job": shown.job,
            "program": shown.program,
            "mdi": shown.mdi,
            "waiting": shown.waiting,
            "codes": shown.codes,
            "tool": shown.tool,
            "work_offset_mm": shown.work_offset,
            "remaining_s": live.remaining_s,
            "elapsed_s": live.elapsed_s,
            "estop_chain_open": live.chain_open,
            "held_at_mm": live.held_at.map(|place| place.0),
            "limit_switches": { "lower": numbers(live.limits[0]), "upper": numbers(live.limits[1]) },
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

    fn order_of(&mut self, ticket: Ticket, order: Result<Order, RpcError>) -> Answer {
        match order {
            Ok(order) => self.order(ticket, order),
            Err(error) => Some(Err(error)),
        }
    }

    fn order(&mut self, ticket: Ticket, order: Order) -> Answer {
        match self.operator.put(ticket, order) {
            Ok(()) => None,
            Err(what) => Some(Err(RpcError::new(code::REFUSED, what))),
        }
    }

    /// What concerns jogs under way: of one axis or joint, or all.
    fn jogging(&mut self, params: &Params, ticket: Ticket, motion: JogMotion) -> Answer {
        self.order_of(
            ticket,
            arguments::jogged(params).map(|what| Order::Jog(Jog { what, motion })),
        )
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
