//! The table of methods.
//!
//! To add one: a row here and its function. [`API_VERSION`] goes on with it.

use super::pin_values::VALUES_MAX;
use super::{Answer, Call, Methods, arguments, done};
use crate::control::Needs;
use crate::errands::Errand;
use crate::orders::Order;
use crate::repeats::REQUEST_ID;
use crate::roles::Role;
use crate::rpc::RpcError;
use crate::scopes;
use crate::server::subscription::RATE_MAX_HZ;
use crate::text_lines::LINES_MAX;
use crate::uploads::PART_MAX;
use bus::SDO_VALUE_MAX;
use cia402::profile::AXES_MAX;
use config::JOINTS_MAX;
use files::read::PROGRAM_MAX;
use hal_pins::scope::CHANNELS_MAX;
use rt::joint_jog::JogMotion;
use rt::shared::AtOnce;
use serde_json::Value;

/// Version of what is served here: the first number changes when something is gone or means something else, the second when
/// something is new.
pub const API_VERSION: &str = "2.6";

/// What can be asked for.
pub struct Method {
    pub name: &'static str,
    pub params: &'static [Param],
    /// What it does.
    pub does: &'static str,
    /// What it answers.
    pub gives: Gives,
    /// Whether its caller must have control.
    pub needs: Needs,
    /// What its caller must be allowed to do.
    pub role: Role,
    /// Looks and changes nothing: answered also where the network is silenced.
    pub(super) looks: bool,
    /// Where, and how.
    pub(super) runs: Runs,
}

/// Where a method runs, which is its kind: what it may cost follows from that.
#[derive(Clone, Copy)]
pub(super) enum Runs {
    /// Brings the machine to rest: the cycle takes it as soon as it is read from the socket, whatever other threads do; then the
    /// operator as an order.
    AtOnce(AtOnce),
    /// On the service thread, which serves nobody else meanwhile: looks at what lies in memory or puts something there. Compiles
    /// nothing and waits for nobody; of files, it takes parts of an upload.
    Quick(fn(&mut Methods, &mut Call<'_>) -> Result<Value, RpcError>),
    /// The same, for something that others do: its answer comes once they have.
    Later(fn(&mut Methods, &mut Call<'_>) -> Answer),
    /// By the operator, in his turn.
    Order(fn(&mut Methods, &mut Call<'_>) -> Result<Order, RpcError>),
    /// In a thread of its own: may take as long as it likes.
    Errand(fn(&mut Methods, &mut Call<'_>) -> Result<Errand, RpcError>),
}

impl Method {
    /// What it orders of the cycle at once, if that is its kind.
    pub fn at_once(&self) -> Option<AtOnce> {
        match self.runs {
            Runs::AtOnce(what) => Some(what),
            Runs::Quick(_) | Runs::Later(_) | Runs::Order(_) | Runs::Errand(_) => None,
        }
    }

    /// Whether it changes nothing.
    pub fn only_looks(&self) -> bool {
        self.looks
    }

    /// Names of its parameters: those of its own, and the id of an order.
    pub(super) fn names(&self) -> impl Iterator<Item = &'static str> {
        let has_id = (!self.looks).then_some(REQUEST_ID);
        self.params.iter().map(|param| param.name).chain(has_id)
    }

    /// Whether it can be refused because another client has control.
    pub fn asks_for_control(&self) -> bool {
        self.needs != Needs::Nothing || matches!(self.gives, Gives::Overrides | Gives::Control)
    }
}

/// A parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Param {
    pub name: &'static str,
    pub kind: Kind,
    pub required: bool,
}

/// What a parameter is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A whole number from the first to the second.
    Whole(u64, u64),
    /// A list of them.
    Wholes(u64, u64),
    /// A list of so many texts at the most.
    Texts(usize),
    Number,
    /// A number from the first to the second.
    Percent(u32, u32),
    Flag,
    Text,
    /// So many octets at the most, as hexadecimal digits.
    Octets(usize),
    /// A letter.
    Axis,
    /// G54 to G59.3.
    WorkSystem,
    /// A kind of `[[sim.fault]]`, or "none".
    SimFault,
}

/// What a method answers; [`crate::openrpc`] says what these are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gives {
    /// An object without members.
    Nothing,
    Methods,
    OpenRpc,
    Status,
    Identified,
    Described,
    Metrics,
    Text,
    Subscribed,
    Control,
    Network,
    Octets,
    Outlook,
    UploadBegun,
    UploadGrown,
    PathBegun,
    PathPart,
    Offsets,
    Tools,
    Jog,
    Overrides,
    Journal,
    Resumed,
    Skipped,
    /// Nothing, or a warning that the disk has not taken it.
    Kept,
    Lines,
    Report,
    Pins,
    ScopeBegun,
    ScopePart,
    LogicTasks,
    LogicVariables,
    LogicForced,
    LogicReleased,
    LogicReloaded,
    MachineFile,
    Errors,
    FileWritten,
    Doctor,
    Times,
}

const fn needed(name: &'static str, kind: Kind) -> Param {
    Param {
        name,
        kind,
        required: true,
    }
}

const fn optional(name: &'static str, kind: Kind) -> Param {
    Param {
        name,
        kind,
        required: false,
    }
}

const JOINT: Kind = Kind::Whole(0, JOINTS_MAX as u64 - 1);
const NUMBER_32: Kind = Kind::Whole(0, u32::MAX as u64);
const OBJECT: [Param; 3] = [
    needed("node", Kind::Whole(1, 239)),
    needed("index", Kind::Whole(0, 0xFFFF)),
    needed("sub", Kind::Whole(0, 0xFF)),
];
const PROGRAM: [Param; 5] = [
    optional("file", Kind::Text),
    optional("path", Kind::Text),
    optional("upload", NUMBER_32),
    optional("name", Kind::Text),
    optional("text", Kind::Text),
];
const LOGIC: Param = optional("program", Kind::Text);
const JOGGED: [Param; 2] = [optional("axis", Kind::Axis), optional("joint", JOINT)];

/// A method that only asks, for all.
const LOOK: Method = Method {
    name: "",
    params: &[],
    does: "",
    gives: Gives::Nothing,
    needs: Needs::Nothing,
    role: Role::Watch,
    looks: true,
    runs: Runs::Quick(|_, _| done()),
};

/// An order of whoever has control.
const ORDER: Method = Method {
    needs: Needs::Control,
    role: Role::Operate,
    looks: false,
    ..LOOK
};

pub const METHODS: &[Method] = &[
    Method {
        name: "methods",
        does: "this table",
        gives: Gives::Methods,
        runs: Runs::Quick(|_, _| Ok(super::table())),
        ..LOOK
    },
    Method {
        name: "rpc.discover",
        does: "the same with types, as an OpenRPC document",
        gives: Gives::OpenRpc,
        runs: Runs::Quick(|_, _| Ok(crate::openrpc::document())),
        ..LOOK
    },
    Method {
        name: "client.identify",
        params: &[
            optional("name", Kind::Text),
            optional("version", Kind::Text),
            optional("kind", Kind::Text),
            optional("token", Kind::Text),
        ],
        does: "says what this client is called, for whoever wonders who has control, and answers what it may do: its \"role\" (\"watch\", \
               \"operate\", \"set-up\") and its number. A \"token\" is for the panel, which takes it in the first message; here it is not \
               looked at",
        gives: Gives::Identified,
        runs: Runs::Quick(|methods, call| methods.identify(call)),
        ..LOOK
    },
    Method {
        name: "status",
        does: "machine, process, state, cycles, position, program, alarm",
        gives: Gives::Status,
        runs: Runs::Quick(|methods, _| Ok(methods.status())),
        ..LOOK
    },
    Method {
        name: "subscribe",
        params: &[optional("rate_hz", Kind::Whole(1, RATE_MAX_HZ))],
        does: "answers the whole \"state\", as of \"status\"; from then on, notifications \"state\" bring the fields that have \
               \"changed\": positions and the like at most so often (20 times a second without it), all else at once. Another \
               one takes the place of the first",
        gives: Gives::Subscribed,
        runs: Runs::Quick(|methods, call| methods.subscribe(call)),
        ..LOOK
    },
    Method {
        name: "unsubscribe",
        does: "no more notifications",
        runs: Runs::Quick(|_, call| {
            call.caller.subscription = None;
            done()
        }),
        ..LOOK
    },
    Method {
        name: "control.take",
        params: &[optional("name", Kind::Text), optional("force", Kind::Flag)],
        does: "gives this client control under a \"name\": orders of all others are refused until it is released, its client goes or \
               is silent for 30 s. With \"force\", even where another has taken it, which the journal tells. Without it, an order \
               takes control where nobody has",
        gives: Gives::Control,
        role: Role::Operate,
        looks: false,
        runs: Runs::Quick(|methods, call| methods.take_control(call)),
        ..LOOK
    },
    Method {
        name: "control.release",
        does: "lets control go",
        runs: Runs::Quick(|methods, call| {
            let now_ns = (methods.now_ns)();
            methods.control.release(call.caller.client, now_ns);
            done()
        }),
        ..LOOK
    },
    Method {
        name: "ping",
        does: "nothing: its answer shows that the control lives",
        runs: Runs::Quick(|_, _| done()),
        ..LOOK
    },
    Method {
        name: "machine.describe",
        does: "what does not change: axes with their travel and joints, limits, spindle, cycle, whether programs can be sent",
        gives: Gives::Described,
        runs: Runs::Quick(|methods, _| Ok(methods.described.clone())),
        ..LOOK
    },
    Method {
        name: "metrics",
        does: "figures for Prometheus, as the \"text\" of its exposition format",
        gives: Gives::Metrics,
        runs: Runs::Quick(|methods, _| Ok(methods.metrics())),
        ..LOOK
    },
    Method {
        name: "bus.network",
        does: "the network and its nodes: what they are, how they are, why they are not operational",
        gives: Gives::Network,
        runs: Runs::Quick(|methods, _| methods.network()),
        ..LOOK
    },
    Method {
        name: "bus.sdo_read",
        params: &OBJECT,
        does: "reads an object of a node; its octets as hexadecimal digits in \"value\"",
        gives: Gives::Octets,
        role: Role::Operate,
        looks: false,
        runs: Runs::Later(|methods, call| methods.sdo(call, false)),
        ..LOOK
    },
    Method {
        name: "bus.sdo_write",
        params: &[
            OBJECT[0],
            OBJECT[1],
            OBJECT[2],
            needed("value", Kind::Octets(SDO_VALUE_MAX)),
        ],
        does: "writes an object of a node; \"value\" holds its octets as hexadecimal digits",
        role: Role::SetUp,
        runs: Runs::Later(|methods, call| methods.sdo(call, true)),
        ..ORDER
    },
    Method {
        name: "sim.fault",
        params: &[
            needed("node", Kind::Whole(1, 239)),
            needed("kind", Kind::SimFault),
            optional("axis", Kind::Whole(0, AXES_MAX as u64 - 1)),
            optional("for_s", Kind::Number),
        ],
        does: "lets something go wrong with an \"axis\" (without it 0) of the simulated drive of a node: a \"kind\" of [[sim.fault]] of \
               the machine file, for so many seconds, or until \"none\" mends all; \"overcurrent\" without a time can be acknowledged at \
               once, \"power-off\" without one stays. A drive that is no simulated one refuses",
        role: Role::SetUp,
        runs: Runs::Later(|methods, call| methods.sim_fault(call)),
        ..ORDER
    },
    Method {
        name: "on",
        does: "switches drives on; moves nothing, and homes nothing",
        runs: Runs::Order(|_, _| Ok(Order::On)),
        ..ORDER
    },
    Method {
        name: "off",
        does: "brings the machine to rest and switches drives off",
        runs: Runs::Order(|_, _| Ok(Order::Off)),
        ..ORDER
    },
    Method {
        name: "estop",
        does: "emergency stop: quick stop of all drives, spindle and coolant off, until \"estop.reset\". Not a safety function",
        needs: Needs::Nothing,
        role: Role::Watch,
        runs: Runs::AtOnce(AtOnce::Estop),
        ..ORDER
    },
    Method {
        name: "estop.reset",
        does: "the emergency stop is over, once its chain is closed; switches nothing on",
        runs: Runs::Order(|_, _| Ok(Order::EstopReset)),
        ..ORDER
    },
    Method {
        name: "home",
        params: &[optional("joints", Kind::Wholes(0, JOINTS_MAX as u64 - 1))],
        does: "homes the \"joints\" of a list of numbers, all without it, in the order of their \"sequence\"; switches drives on if \
               they are off, and leaves them on",
        runs: Runs::Order(|_, call| {
            let joints = call.params.numbers("joints", 0, JOINTS_MAX as u64 - 1);
            joints.map(|joints| Order::Home(joints.into_iter().map(|joint| joint as usize).collect()))
        }),
        ..ORDER
    },
    Method {
        name: "program.upload.begin",
        params: &[
            needed("name", Kind::Text),
            needed("octets", Kind::Whole(0, PROGRAM_MAX)),
        ],
        does: "makes room for a program of so many \"octets\", for \"program.load\" or \"program.run\"; given up when its client goes \
               or is silent about it for a minute. At most four at a time",
        gives: Gives::UploadBegun,
        needs: Needs::Nothing,
        runs: Runs::Quick(|methods, call| methods.begin_upload(call)),
        ..ORDER
    },
    Method {
        name: "program.upload.append",
        params: &[
            needed("upload", NUMBER_32),
            needed("at", Kind::Whole(0, PROGRAM_MAX)),
            needed("value", Kind::Octets(PART_MAX)),
        ],
        does: "takes the octets that follow those that have come, which \"at\" counts",
        gives: Gives::UploadGrown,
        needs: Needs::Nothing,
        runs: Runs::Quick(|methods, call| methods.append_upload(call)),
        ..ORDER
    },
    Method {
        name: "program.upload.commit",
        params: &[needed("upload", NUMBER_32), needed("sha256", Kind::Octets(32))],
        does: "all has come, and this is its SHA-256: another one gives it up",
        needs: Needs::Nothing,
        runs: Runs::Quick(|methods, call| methods.commit_upload(call)),
        ..ORDER
    },
    Method {
        name: "program.load",
        params: &PROGRAM,
        does: "checks a program and keeps it for \"program.start\". A \"file\" of the folder of programs, one that the control may \
               read (\"path\", absolute), an \"upload\", or \"text\" and its \"name\"",
        gives: Gives::Outlook,
        runs: Runs::Order(|methods, call| methods.source(call).map(Order::Load)),
        ..ORDER
    },
    Method {
        name: "program.start",
        params: &[
            optional("from_line", Kind::Whole(1, u32::MAX as u64)),
            optional("yes", Kind::Flag),
            optional("repeat", Kind::Whole(1, u32::MAX as u64)),
            optional("dry_run_feed_mm_min", Kind::Number),
            optional("revision", Kind::Whole(0, u64::MAX)),
        ],
        does: "runs the program that is loaded; drives are on and joints homed before. \"revision\": of the program that is meant, as \
               \"program.load\" and \"status\" tell it; refused where another one is loaded. Before a line (\"from_line\"): refused with what \
               that means, one sentence a line, until \"yes\" is true. \"repeat\": so many times in all, each behind the end of the \
               one before. \"dry_run_feed_mm_min\": dry, all moves at feed at this one (degrees/min where only rotary axes move), \
               spindles and coolant off, no part counted",
        gives: Gives::Outlook,
        runs: Runs::Order(|_, call| arguments::start(call.params)),
        ..ORDER
    },
    Method {
        name: "program.check",
        params: &PROGRAM,
        does: "checks a program as \"program.load\" does and keeps nothing of it; at any time, two at the most. Parameters as of \
               \"program.load\"",
        gives: Gives::Outlook,
        needs: Needs::Nothing,
        runs: Runs::Order(|methods, call| methods.source(call).map(Order::Inspect)),
        ..ORDER
    },
    Method {
        name: "program.run",
        params: &PROGRAM,
        does: "checks a program, switches drives on if they are off, homes joints that are not, runs it; drives stay on. \
               Parameters as of \"program.load\"",
        gives: Gives::Outlook,
        runs: Runs::Order(|methods, call| methods.source(call).map(Order::Run)),
        ..ORDER
    },
    Method {
        name: "program.report",
        params: &[optional("number", Kind::Whole(0, u64::MAX))],
        does: "the report of a program that was run, by its \"number\" (the journal has it), without it the last one; the last 50 are \
               kept",
        gives: Gives::Report,
        runs: Runs::Order(|_, call| {
            match call.params.has("number") {
                true => call.params.number("number", 0, u64::MAX).map(Some),
                false => Ok(None),
            }
            .map(Order::Report)
        }),
        ..LOOK
    },
    Method {
        name: "program.text",
        params: &[
            optional("from_line", Kind::Whole(1, u32::MAX as u64)),
            optional("lines", Kind::Whole(1, LINES_MAX)),
        ],
        does: "\"lines\" of the program that \"status\" shows, so many (50 without it) from line \"from_line\" on (1 without it), each cut at 256 \
               octets; \"more\": there are others behind them. \"revision\" as in \"status\": another one is another text",
        gives: Gives::Text,
        runs: Runs::Quick(|methods, call| methods.program_text(call)),
        ..LOOK
    },
    Method {
        name: "program.path.begin",
        params: &[optional("tolerance_mm", Kind::Number)],
        does: "draws the way of the program that is loaded, in machine coordinates with the offsets of the moment, no more than \
               \"tolerance_mm\" off (0.01 without it, degrees count as mm); its parts are fetched with \"program.path.next\". Another \
               one takes the place of the first; given up when its client goes or asks for nothing for a minute",
        gives: Gives::PathBegun,
        runs: Runs::Order(|methods, call| methods.begin_path(call)),
        ..LOOK
    },
    Method {
        name: "program.path.next",
        params: &[needed("path", NUMBER_32)],
        does: "the next records of a way, answered once they are there; with \"end\" it is over, by an \"error\" of the program if \
               there is one",
        gives: Gives::PathPart,
        runs: Runs::Later(|methods, call| methods.next_of_path(call)),
        ..LOOK
    },
    Method {
        name: "program.path.end",
        does: "nobody wants more of the way that this client fetches",
        runs: Runs::Quick(|methods, call| {
            methods.paths.left(call.caller.client);
            done()
        }),
        ..LOOK
    },
    Method {
        name: "hal.list",
        params: &[optional("pattern", Kind::Text), optional("from", NUMBER_32)],
        does: "pins and nets with their values, those that a \"pattern\" with * and ? fits, up to 500, from number \"from\" of them on; \
               \"more\": there are others behind them",
        gives: Gives::Pins,
        runs: Runs::Quick(|methods, call| methods.list_pins(call)),
        ..LOOK
    },
    Method {
        name: "scope.begin",
        params: &[
            needed("pins", Kind::Texts(CHANNELS_MAX)),
            optional("trigger", Kind::Text),
            optional("mode", Kind::Text),
            optional("seconds", Kind::Number),
            optional("before_percent", Kind::Percent(0, 100)),
            optional("cycles_per_row", Kind::Whole(1, u32::MAX as u64)),
            optional("rate_hz", Kind::Whole(1, scopes::RATE_MAX_HZ)),
        ],
        does: "an oscilloscope: samples up to 32 \"pins\" or nets in every cycle, from now on. A row has the least and the greatest value \
               of \"cycles_per_row\" cycles (1 without it). With a \"trigger\", records of so many \"seconds\" (1) around it, of which \
               \"before_percent\" (0) lie before; \"mode\" is auto, normal, single or roll (single with a trigger or seconds, else \
               roll). With \"rate_hz\", rows come at most so often as notifications \"scope\", \
               as \"scope.next\" would answer, while their client reads; else they are fetched with \"scope.next\". Given up when its \
               client goes, or takes nothing for a minute. Two of a client, three of all",
        gives: Gives::ScopeBegun,
        runs: Runs::Quick(|methods, call| methods.begin_scope(call)),
        ..LOOK
    },
    Method {
        name: "scope.next",
        params: &[needed("scope", NUMBER_32)],
        does: "the rows that have come since the last call, at once, of one record, 24 KiB at the most; \"more\": others are there \
               already. \"lost\": cycles since the beginning that nobody fetched in time",
        gives: Gives::ScopePart,
        runs: Runs::Quick(|methods, call| {
            let scope = call.params.number("scope", 0, u64::from(u32::MAX))?;
            methods.scopes.next(call.caller.client, scope, (methods.now_ns)())
        }),
        ..LOOK
    },
    Method {
        name: "scope.end",
        params: &[needed("scope", NUMBER_32)],
        does: "nobody wants more of it",
        runs: Runs::Quick(|methods, call| {
            let scope = call.params.number("scope", 0, u64::from(u32::MAX))?;
            methods.scopes.end(call.caller.client, scope);
            done()
        }),
        ..LOOK
    },
    Method {
        name: "mdi",
        params: &[needed("line", Kind::Text)],
        does: "runs a \"line\" of G-code in the modes that the one before has left, behind those that wait; answered when it begins",
        gives: Gives::Outlook,
        runs: Runs::Order(|_, call| arguments::line(call.params).map(Order::Mdi)),
        ..ORDER
    },
    Method {
        name: "mdi.stream",
        params: &[needed("text", Kind::Text), optional("wait", Kind::Flag)],
        does: "runs the lines of a \"text\" as \"mdi\" does, but those that come in time as one program: nothing stops between them. Answered when there is room for more; with \"wait\" once all of them and those before have been executed, also without any; the program ends behind lines that are waited for. They are not checked before: what is wrong is an alarm at its line",
        runs: Runs::Order(|_, call| arguments::lines(call.params)),
        ..ORDER
    },
    Method {
        name: "mdi.history",
        does: "the \"lines\" of MDI that were typed last, up to 100, the latest last",
        gives: Gives::Lines,
        runs: Runs::Order(|_, _| Ok(Order::MdiHistory)),
        ..LOOK
    },
    Method {
        name: "touch_off",
        params: &[
            needed("axis", Kind::Axis),
            needed("value", Kind::Number),
            optional("system", Kind::WorkSystem),
            optional("tool", NUMBER_32),
        ],
        does: "the \"axis\" reads \"value\" (unit of the machine) where it stands: in a work \"system\" (G54 to G59.3, else the one in \
               force), or once the length of a \"tool\" is in force",
        gives: Gives::Kept,
        runs: Runs::Order(|_, call| arguments::touch_off(call.params).map(Order::Change)),
        ..ORDER
    },
    Method {
        name: "offset.list",
        does: "origins and rotations of G54 to G59.3, and G92",
        gives: Gives::Offsets,
        runs: Runs::Order(|_, _| Ok(Order::Offsets)),
        ..LOOK
    },
    Method {
        name: "offset.set",
        params: &[
            optional("system", Kind::WorkSystem),
            optional("axis", Kind::Axis),
            optional("value", Kind::Number),
            optional("rotation_degrees", Kind::Number),
        ],
        does: "puts the origin of a work \"system\" (else the one in force) on an \"axis\" to this \"value\", machine coordinates; or \
               turns it about Z of its origin, counter-clockwise from above (G10 L2 R)",
        gives: Gives::Kept,
        runs: Runs::Order(|_, call| arguments::offset(call.params).map(Order::Change)),
        ..ORDER
    },
    Method {
        name: "tool.list",
        does: "the tool table, and the tool in the spindle",
        gives: Gives::Tools,
        runs: Runs::Order(|_, _| Ok(Order::Tools)),
        ..LOOK
    },
    Method {
        name: "tool.set",
        params: &[
            needed("tool", NUMBER_32),
            optional("length", Kind::Number),
            optional("diameter", Kind::Number),
        ],
        does: "\"length\" or \"diameter\" of a \"tool\", or both, in the unit of the machine; one that the table lacks is added. A length \
               whose G43 is in force counts at once",
        gives: Gives::Kept,
        runs: Runs::Order(|_, call| arguments::tool(call.params).map(Order::Change)),
        ..ORDER
    },
    Method {
        name: "tool.changed",
        does: "the tool that the program waits for is in the spindle",
        runs: Runs::Order(|_, _| Ok(Order::ToolChanged)),
        ..ORDER
    },
    Method {
        name: "jog",
        params: &[
            JOGGED[0],
            JOGGED[1],
            needed("velocity_mm_s", Kind::Number),
            optional("distance_mm", Kind::Number),
        ],
        does: "moves an \"axis\" (letter) or a \"joint\" (number) by hand: at a velocity, whose sign is the direction, as far \
               as the soft limit; or by \"distance_mm\", which adds up. Holds for 0.2 s: renew it with \"jog.keep\"",
        gives: Gives::Jog,
        needs: Needs::ControlForJog,
        runs: Runs::Order(|_, call| arguments::jog(call.params).map(Order::Jog)),
        ..ORDER
    },
    Method {
        name: "jog.keep",
        params: &JOGGED,
        does: "the hand is still on the key: what is being jogged goes on for another 0.2 s; begins nothing",
        gives: Gives::Jog,
        needs: Needs::ControlForJog,
        runs: Runs::Order(|_, call| arguments::jogging(call.params, JogMotion::Keep)),
        ..ORDER
    },
    Method {
        name: "jog.stop",
        params: &JOGGED,
        does: "lets an axis, a joint or all that is being jogged come to rest",
        gives: Gives::Jog,
        needs: Needs::Nothing,
        role: Role::Watch,
        runs: Runs::Order(|_, call| arguments::jogging(call.params, JogMotion::Release)),
        ..ORDER
    },
    Method {
        name: "hold",
        does: "brings the program to rest on its path and keeps it: it may be jogged away then; a jog or a way back is over",
        needs: Needs::Nothing,
        role: Role::Watch,
        runs: Runs::AtOnce(AtOnce::Hold),
        ..ORDER
    },
    Method {
        name: "resume",
        does: "goes on after a hold, and forward after \"reverse\"; in single block, runs the next block. Of a machine that was jogged \
               away: returns to where the program is held, Z up first (\"returns\": the legs), and waits there for the next one",
        gives: Gives::Resumed,
        runs: Runs::Order(|_, _| Ok(Order::Resume)),
        ..ORDER
    },
    Method {
        name: "skip",
        does: "gives up the block that the program waits in without moving (a dwell, M66 as if its time had run out, M0, M1) and goes \
               on with the next one; refused in any other, as what follows would begin elsewhere than it was programmed",
        gives: Gives::Skipped,
        runs: Runs::Order(|_, _| Ok(Order::Skip)),
        ..ORDER
    },
    Method {
        name: "reverse",
        params: &[optional("percent", Kind::Percent(0, 100))],
        does: "runs the program that runs or is held back along the path it has run, at \"percent\" (above 0 to 100, usually 100) \
               of its speed, as far as the last block that moves nothing or turns with the spindle; \"hold\" rests, \"resume\" \
               goes forward again",
        runs: Runs::Order(|_, call| arguments::reverse_share(call.params).map(Order::Reverse)),
        ..ORDER
    },
    Method {
        name: "single_block",
        params: &[needed("on", Kind::Flag)],
        does: "\"on\" (true or false): the program rests at the end of each block, \"resume\" runs the next one; what is planned \
               from now on stops at the end of each block exactly",
        runs: Runs::Order(|_, call| call.params.flag("on").map(Order::SingleBlock)),
        ..ORDER
    },
    Method {
        name: "optional_stop",
        params: &[needed("on", Kind::Flag)],
        does: "\"on\" (true or false): the program stops at M1 and waits for \"resume\"; counts as an M1 is reached",
        runs: Runs::Order(|_, call| call.params.flag("on").map(Order::OptionalStop)),
        ..ORDER
    },
    Method {
        name: "block_delete",
        params: &[needed("on", Kind::Flag)],
        does: "\"on\" (true or false): lines that begin with / are skipped in programs and lines of MDI; refused while one runs, as \
               it was checked with the lines that it has",
        runs: Runs::Order(|_, call| call.params.flag("on").map(Order::BlockDelete)),
        ..ORDER
    },
    Method {
        name: "stop",
        does: "brings the machine to rest, a program on its path, and gives it up; spindle and coolant go off, drives stay on",
        needs: Needs::Nothing,
        role: Role::Watch,
        runs: Runs::AtOnce(AtOnce::Stop),
        ..ORDER
    },
    Method {
        name: "override",
        params: &[
            optional("feed", Kind::Percent(0, 120)),
            optional("rapid", Kind::Percent(0, 100)),
            optional("spindle", Kind::Percent(50, 120)),
        ],
        does: "from now on feed (0 to 120), rapid moves (0 to 100) and the spindle (50 to 120) run at this many percent of what \
               is programmed; 0 holds these moves. At any time, for all programs; one that has switched overrides off (M49) \
               is not changed there. Without control, feed and rapid moves can be slowed down",
        gives: Gives::Overrides,
        // It looks itself: slower is for everyone.
        needs: Needs::Nothing,
        role: Role::Watch,
        runs: Runs::Quick(|methods, call| methods.set_overrides(call)),
        ..ORDER
    },
    Method {
        name: "journal.since",
        params: &[optional("seq", Kind::Whole(0, u64::MAX))],
        does: "entries of the journal behind number \"seq\" (0: all that are known), the oldest first, up to 500; \"more\": there are \
               others behind them; \"last\": the number of the last one of all, \"on_disk\": of the last one that outlasts this \
               control, or that a full disk does not take",
        gives: Gives::Journal,
        runs: Runs::Order(|_, call| {
            match call.params.has("seq") {
                true => call.params.number("seq", 0, u64::MAX),
                false => Ok(0),
            }
            .map(Order::Journal)
        }),
        ..LOOK
    },
    Method {
        name: "parts.set",
        params: &[optional("count", NUMBER_32), optional("target", NUMBER_32)],
        does: "sets the counter of parts to \"count\", how many are wanted to \"target\" (0: nobody says), or both; a program that \
               comes to its end (M2, M30) adds one",
        gives: Gives::Kept,
        runs: Runs::Order(|_, call| arguments::parts(call.params)),
        ..ORDER
    },
    Method {
        name: "alarm.acknowledge",
        does: "allows motion again after a fault whose cause is gone; moves nothing and switches nothing on",
        runs: Runs::Order(|_, _| Ok(Order::Acknowledge)),
        ..ORDER
    },
    Method {
        name: "logic.list",
        does: "programs in Structured Text: periods, scans, how many were skipped because the one before was not over, what a scan takes",
        gives: Gives::LogicTasks,
        runs: Runs::Quick(|methods, _| Ok(methods.logic_tasks())),
        ..LOOK
    },
    Method {
        name: "logic.look",
        params: &[
            LOGIC,
            optional("variable", Kind::Text),
            optional("search", Kind::Text),
            optional("from", NUMBER_32),
        ],
        does: "variables of a \"program\" (its name or file; left out: the only one) as they were behind one scan: all, or those of a \
               \"variable\", which may be a structure, an array or a block; of these, those that have all words of \"search\" in their \
               name or pin; up to 500, from number \"from\" of them on; \"more\": there are others behind them",
        gives: Gives::LogicVariables,
        runs: Runs::Quick(|methods, call| methods.logic_look(call)),
        ..LOOK
    },
    Method {
        name: "logic.force",
        params: &[LOGIC, needed("variable", Kind::Text), needed("value", Kind::Text)],
        does: "a \"variable\" has this \"value\" from the next scan on, whatever pins and the program make of it, until it is released, \
               the program is changed or the control ends; the journal tells it",
        gives: Gives::LogicForced,
        role: Role::SetUp,
        runs: Runs::Quick(|methods, call| methods.logic_force(call)),
        ..ORDER
    },
    Method {
        name: "logic.release",
        params: &[LOGIC, optional("variable", Kind::Text)],
        does: "a \"variable\" that was forced, or without it all of them, are again what pins and the program make of them",
        gives: Gives::LogicReleased,
        role: Role::SetUp,
        runs: Runs::Quick(|methods, call| methods.logic_release(call)),
        ..ORDER
    },
    Method {
        name: "logic.reload",
        params: &[LOGIC],
        does: "reads the file of a program anew and lets it take the place of the one that runs, between two scans, with the values of \
               all variables that have the same name and type; only while the machine rests and no program of parts is under way",
        gives: Gives::LogicReloaded,
        role: Role::SetUp,
        runs: Runs::Errand(|methods, call| methods.logic_reload(call)),
        ..ORDER
    },
    Method {
        name: "machine.file",
        does: "the \"text\" of the machine file, its \"sha256\", and its \"errors\", each with its place; up to 48 KiB",
        gives: Gives::MachineFile,
        role: Role::Operate,
        runs: Runs::Errand(|methods, _| methods.read_machine_file()),
        ..LOOK
    },
    Method {
        name: "machine.check",
        params: &[needed("text", Kind::Text)],
        does: "what is wrong with a \"text\" as the machine file: \"errors\", each with its place; none if it is right",
        gives: Gives::Errors,
        role: Role::SetUp,
        runs: Runs::Errand(|methods, call| methods.check_machine_file(call)),
        ..LOOK
    },
    Method {
        name: "machine.write",
        params: &[needed("text", Kind::Text), needed("sha256", Kind::Octets(32))],
        does: "puts a \"text\" in the place of the machine file whose SHA-256 is \"sha256\", and keeps that one beside it (\"before\"); \
               refused where it is wrong, where another has changed the file, and where the machine does not rest. Takes effect at \
               the next start",
        gives: Gives::FileWritten,
        role: Role::SetUp,
        runs: Runs::Errand(|methods, call| methods.write_machine_file(call)),
        ..ORDER
    },
    Method {
        name: "machine.doctor",
        does: "what on this PC stands in the way of real time, as isocnc doctor --no-tests --json says",
        gives: Gives::Doctor,
        runs: Runs::Errand(|methods, _| methods.doctor()),
        ..LOOK
    },
    Method {
        name: "hal.values",
        params: &[needed("pins", Kind::Texts(VALUES_MAX))],
        does: "\"pins\" of a list, as \"hal.list\" tells them",
        gives: Gives::Pins,
        runs: Runs::Quick(|methods, call| methods.pin_values(call)),
        ..LOOK
    },
    Method {
        name: "hal.set",
        params: &[needed("pin", Kind::Text), needed("value", Kind::Text)],
        does: "gives a \"pin\" that no net reaches a \"value\": a number, 0, 1, false or true; the journal tells it",
        role: Role::SetUp,
        runs: Runs::Quick(|methods, call| methods.set_pin(call)),
        ..ORDER
    },
    Method {
        name: "cycle.times",
        does: "how many cycles since the start took how long, \"counts\" up to each of \"edges_us\" and beyond: \"period\" (what the \
               distance of two SoCs differs from the cycle), \"lateness\" of the SoC, \"exchange\", \"compute\"; how many \"orders\" the cycle \
               has taken, and when the last of them",
        gives: Gives::Times,
        runs: Runs::Quick(|methods, _| Ok(methods.cycle_times())),
        ..LOOK
    },
];
