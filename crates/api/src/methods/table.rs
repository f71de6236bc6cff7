//! The table of methods: what each does, who may ask for it, and where it runs.
//!
//! To add one: its types in `protocol`, a row here and its function. [`API_VERSION`] goes on with it.

use super::{Answer, Call, Methods, arguments, done, jobs};
use crate::control::Needs;
use crate::errands::Errand;
use crate::orders::Order;
use crate::rpc::RpcError;
use config::JOINTS_MAX;
use protocol::limits::REQUEST_ID;
use protocol::schema::{Param, params};
use protocol::{OpenRpc, Role, method};
use rt::joint_jog::JogMotion;
use rt::shared::AtOnce;
use schemars::{Schema, SchemaGenerator};
use serde::Serialize;
use serde_json::Value;
use std::marker::PhantomData;
use std::sync::LazyLock;

pub use protocol::API_VERSION;

/// What can be asked for.
pub struct Method {
    pub name: &'static str,
    pub params: Vec<Param>,
    /// What it does.
    pub does: &'static str,
    /// Whether its caller must have control.
    pub needs: Needs,
    /// What its caller must be allowed to do.
    pub role: Role,
    /// Schema of what it answers.
    pub(crate) answer: fn(&mut SchemaGenerator) -> Schema,
    /// Looks and changes nothing: answered also where the network is silenced.
    pub(super) looks: bool,
    /// Where, and how.
    pub(super) runs: Runs,
}

/// What is asked of the service thread.
type Quick = dyn Fn(&mut Methods, &mut Call<'_>) -> Result<Value, RpcError> + Send + Sync;

/// Where a method runs, which is its kind: what it may cost follows from that.
pub(super) enum Runs {
    /// Brings the machine to rest: the cycle takes it as soon as it is read from the socket, whatever other threads do; then the
    /// operator as an order.
    AtOnce(AtOnce),
    /// On the service thread, which serves nobody else meanwhile: looks at what lies in memory or puts something there. Compiles
    /// nothing and waits for nobody; of files, it takes parts of an upload.
    Quick(Box<Quick>),
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
        self.needs != Needs::Nothing || matches!(self.name, "override" | "control.take")
    }
}

/// A row whose method has these parameters and this answer.
struct Row<M> {
    does: &'static str,
    needs: Needs,
    role: Role,
    looks: bool,
    of: PhantomData<M>,
}

/// A method that only asks, for all.
fn look<M: protocol::Method>(does: &'static str) -> Row<M> {
    Row {
        does,
        needs: Needs::Nothing,
        role: Role::Watch,
        looks: true,
        of: PhantomData,
    }
}

/// An order of whoever has control.
fn order<M: protocol::Method>(does: &'static str) -> Row<M> {
    Row {
        needs: Needs::Control,
        role: Role::Operate,
        looks: false,
        ..look(does)
    }
}

impl<M: protocol::Method> Row<M> {
    fn needs(self, needs: Needs) -> Row<M> {
        Row { needs, ..self }
    }

    fn role(self, role: Role) -> Row<M> {
        Row { role, ..self }
    }

    /// It does not only look.
    fn changes(self) -> Row<M> {
        Row { looks: false, ..self }
    }

    fn quick(self, run: fn(&mut Methods, &mut Call<'_>) -> Result<M::Answer, RpcError>) -> Method {
        self.runs(Runs::Quick(Box::new(move |methods, call| {
            run(methods, call).and_then(|answer| value(&answer))
        })))
    }

    fn later(self, run: fn(&mut Methods, &mut Call<'_>) -> Answer) -> Method {
        self.runs(Runs::Later(run))
    }

    fn order(self, run: fn(&mut Methods, &mut Call<'_>) -> Result<Order, RpcError>) -> Method {
        self.runs(Runs::Order(run))
    }

    fn errand(self, run: fn(&mut Methods, &mut Call<'_>) -> Result<Errand, RpcError>) -> Method {
        self.runs(Runs::Errand(run))
    }

    fn at_once(self, what: AtOnce) -> Method {
        self.runs(Runs::AtOnce(what))
    }

    fn runs(self, runs: Runs) -> Method {
        Method {
            name: M::NAME,
            params: params::<M>(),
            does: self.does,
            needs: self.needs,
            role: self.role,
            answer: SchemaGenerator::subschema_for::<M::Answer>,
            looks: self.looks,
            runs,
        }
    }
}

/// An answer as it travels.
pub(crate) fn value(answer: &impl Serialize) -> Result<Value, RpcError> {
    serde_json::to_value(answer).map_err(|error| RpcError::from(error.to_string()))
}

/// All methods, made at the first look at them.
pub static METHODS: LazyLock<Vec<Method>> = LazyLock::new(|| {
    vec![
        look::<method::Methods>("this table")
            .quick(|_, _| Ok(super::table())),
        look::<method::Discover>("the same with types, as an OpenRPC document")
            .quick(|_, _| Ok(OpenRpc(crate::openrpc::document()))),
        look::<method::Identify>(
            "says what this client is called, for whoever wonders who has control, and answers what it may do: its \"role\" (\"watch\", \
             \"operate\", \"set-up\") and its number. A \"token\" is for the panel, which takes it in the first message; here it is not \
             looked at",
        )
            .quick(|methods, call| methods.identify(call)),
        look::<method::Status>("machine, process, state, cycles, position, program, alarm")
            .quick(|methods, _| Ok(methods.status())),
        look::<method::Subscribe>(
            "answers the whole \"state\", as of \"status\"; from then on, notifications \"state\" bring the fields that have \
             \"changed\": positions and the like at most so often (20 times a second without it), all else at once. Another \
             one takes the place of the first",
        )
            .quick(|methods, call| methods.subscribe(call)),
        look::<method::Unsubscribe>("no more notifications")
            .quick(|_, call| {
                call.caller.subscription = None;
                done()
            }),
        look::<method::TakeControl>(
            "gives this client control under a \"name\": orders of all others are refused until it is released, its client goes or \
             is silent for 30 s. With \"force\", even where another has taken it, which the journal tells. Without it, an order \
             takes control where nobody has",
        )
            .role(Role::Operate)
            .changes()
            .quick(|methods, call| methods.take_control(call)),
        look::<method::ReleaseControl>("lets control go")
            .quick(|methods, call| {
                let now_ns = (methods.now_ns)();
                methods.control.release(call.caller.client, now_ns);
                done()
            }),
        look::<method::Ping>("nothing: its answer shows that the control lives")
            .quick(|_, _| done()),
        look::<method::Describe>(
            "what does not change: axes with their travel and joints, limits, spindle, cycle, whether programs can be sent",
        )
            .quick(|methods, _| Ok(methods.described.clone())),
        look::<method::Metrics>("figures for Prometheus, as the \"text\" of its exposition format")
            .quick(|methods, _| Ok(methods.metrics())),
        look::<method::Network>("the network and its nodes: what they are, how they are, why they are not operational")
            .quick(|methods, _| methods.network()),
        look::<method::SdoRead>("reads an object of a node; its octets as hexadecimal digits in \"value\"")
            .role(Role::Operate)
            .changes()
            .later(|methods, call| methods.sdo(call, false)),
        order::<method::SdoWrite>("writes an object of a node; \"value\" holds its octets as hexadecimal digits")
            .role(Role::SetUp)
            .later(|methods, call| methods.sdo(call, true)),
        order::<method::SimFault>(
            "lets something go wrong with an \"axis\" (without it 0) of the simulated drive of a node: a \"kind\" of [[sim.fault]] of \
             the machine file, for so many seconds, or until \"none\" mends all; \"overcurrent\" without a time can be acknowledged at \
             once, \"power-off\" without one stays. A drive that is no simulated one refuses",
        )
            .role(Role::SetUp)
            .later(|methods, call| methods.sim_fault(call)),
        order::<method::On>("switches drives on; moves nothing, and homes nothing")
            .order(|_, _| Ok(Order::On)),
        order::<method::Off>("brings the machine to rest and switches drives off")
            .order(|_, _| Ok(Order::Off)),
        order::<method::Estop>(
            "emergency stop: quick stop of all drives, spindle and coolant off, until \"estop.reset\". Not a safety function",
        )
            .needs(Needs::Nothing)
            .role(Role::Watch)
            .at_once(AtOnce::Estop),
        order::<method::EstopReset>("the emergency stop is over, once its chain is closed; switches nothing on")
            .order(|_, _| Ok(Order::EstopReset)),
        order::<method::Home>(
            "homes the \"joints\" of a list of numbers, all without it, in the order of their \"sequence\"; switches drives on if \
             they are off, and leaves them on",
        )
            .order(|_, call| {
                let joints = call.params.numbers("joints", 0, JOINTS_MAX as u64 - 1);
                joints.map(|joints| Order::Home(joints.into_iter().map(|joint| joint as usize).collect()))
            }),
        order::<method::UploadBegin>(
            "makes room for a program of so many \"octets\", for \"program.load\" or \"program.run\"; given up when its client goes \
             or is silent about it for a minute. At most four at a time",
        )
            .needs(Needs::Nothing)
            .quick(|methods, call| methods.begin_upload(call)),
        order::<method::UploadAppend>("takes the octets that follow those that have come, which \"at\" counts")
            .needs(Needs::Nothing)
            .quick(|methods, call| methods.append_upload(call)),
        order::<method::UploadCommit>("all has come, and this is its SHA-256: another one gives it up")
            .needs(Needs::Nothing)
            .quick(|methods, call| methods.commit_upload(call)),
        order::<method::ProgramLoad>(
            "checks a program and keeps it for \"program.start\". A \"file\" of the folder of programs, one that the control may \
             read (\"path\", absolute), an \"upload\", or \"text\" and its \"name\"",
        )
            .order(|methods, call| methods.source(call).map(Order::Load)),
        order::<method::ProgramStart>(
            "runs the program that is loaded; drives are on and joints homed before. \"revision\": of the program that is meant, as \
             \"program.load\" and \"status\" tell it; refused where another one is loaded. Before a line (\"from_line\"): refused with what \
             that means, one sentence a line, until \"yes\" is true. \"repeat\": so many times in all, each behind the end of the \
             one before. \"dry_run_feed_mm_min\": dry, all moves at feed at this one (degrees/min where only rotary axes move), \
             spindles and coolant off, no part counted",
        )
            .order(|_, call| arguments::start(call.params)),
        order::<method::ProgramCheck>(
            "checks a program as \"program.load\" does and keeps nothing of it; at any time, two at the most. Parameters as of \
             \"program.load\"",
        )
            .needs(Needs::Nothing)
            .order(|methods, call| methods.source(call).map(Order::Inspect)),
        order::<method::ProgramRun>(
            "checks a program, switches drives on if they are off, homes joints that are not, runs it; drives stay on. \
             Parameters as of \"program.load\"",
        )
            .order(|methods, call| methods.source(call).map(Order::Run)),
        look::<method::ProgramReport>(
            "the report of a program that was run, by its \"number\" (the journal has it), without it the last one; the last 50 are \
             kept",
        )
            .order(|_, call| {
                match call.params.has("number") {
                    true => call.params.number("number", 0, u64::MAX).map(Some),
                    false => Ok(None),
                }
                .map(Order::Report)
            }),
        look::<method::ProgramText>(
            "\"lines\" of the program that \"status\" shows, so many (50 without it) from line \"from_line\" on (1 without it), each cut at 256 \
             octets; \"more\": there are others behind them. \"revision\" as in \"status\": another one is another text",
        )
            .quick(|methods, call| methods.program_text(call)),
        look::<method::PathBegin>(
            "draws the way of the program that is loaded, in machine coordinates with the offsets of the moment, no more than \
             \"tolerance_mm\" off (0.01 without it, degrees count as mm); its parts are fetched with \"program.path.next\". Another \
             one takes the place of the first; given up when its client goes or asks for nothing for a minute",
        )
            .order(|methods, call| methods.begin_path(call)),
        look::<method::PathNext>(
            "the next records of a way, answered once they are there; with \"end\" it is over, by an \"error\" of the program if \
             there is one",
        )
            .later(|methods, call| methods.next_of_path(call)),
        look::<method::PathEnd>("nobody wants more of the way that this client fetches")
            .quick(|methods, call| {
                methods.paths.left(call.caller.client);
                done()
            }),
        look::<method::PinList>(
            "pins and nets with their values, those that a \"pattern\" with * and ? fits, up to 500, from number \"from\" of them on; \
             \"more\": there are others behind them",
        )
            .quick(|methods, call| methods.list_pins(call)),
        look::<method::ScopeBegin>(
            "an oscilloscope: samples up to 32 \"pins\" or nets in every cycle, from now on. A row has the least and the greatest value \
             of \"cycles_per_row\" cycles (1 without it). With a \"trigger\", records of so many \"seconds\" (1) around it, of which \
             \"before_percent\" (0) lie before; \"mode\" is auto, normal, single or roll (single with a trigger or seconds, else \
             roll). With \"rate_hz\", rows come at most so often as notifications \"scope\", \
             as \"scope.next\" would answer, while their client reads; else they are fetched with \"scope.next\". Given up when its \
             client goes, or takes nothing for a minute. Two of a client, three of all",
        )
            .quick(|methods, call| methods.begin_scope(call)),
        look::<method::ScopeNext>(
            "the rows that have come since the last call, at once, of one record, 24 KiB at the most; \"more\": others are there \
             already. \"lost\": cycles since the beginning that nobody fetched in time",
        )
            .quick(|methods, call| {
                let scope = call.params.number("scope", 0, u64::from(u32::MAX))?;
                methods.scopes.next(call.caller.client, scope, (methods.now_ns)())
            }),
        look::<method::ScopeEnd>("nobody wants more of it")
            .quick(|methods, call| {
                let scope = call.params.number("scope", 0, u64::from(u32::MAX))?;
                methods.scopes.end(call.caller.client, scope);
                done()
            }),
        order::<method::Mdi>(
            "runs a \"line\" of G-code in the modes that the one before has left, behind those that wait; answered when it begins",
        )
            .order(|_, call| arguments::line(call.params).map(Order::Mdi)),
        order::<method::MdiStream>(
            "runs the lines of a \"text\" as \"mdi\" does, but those that come in time as one program: nothing stops between them. Answered when there is room for more; with \"wait\" once all of them and those before have been executed, also without any; the program ends behind lines that are waited for. They are not checked before: what is wrong is an alarm at its line",
        )
            .order(|_, call| arguments::lines(call.params)),
        look::<method::MdiHistory>("the \"lines\" of MDI that were typed last, up to 100, the latest last")
            .order(|_, _| Ok(Order::MdiHistory)),
        order::<method::TouchOff>(
            "the \"axis\" reads \"value\" (unit of the machine) where it stands: in a work \"system\" (G54 to G59.3, else the one in \
             force), or once the length of a \"tool\" is in force",
        )
            .order(|_, call| arguments::touch_off(call.params).map(Order::Change)),
        look::<method::OffsetList>("origins and rotations of G54 to G59.3, G92, and where G28 and G30 go")
            .order(|_, _| Ok(Order::Offsets)),
        order::<method::OffsetSet>(
            "puts the origin of a work \"system\" (else the one in force) on an \"axis\" to this \"value\", machine coordinates; or \
             turns it about Z of its origin, counter-clockwise from above (G10 L2 R)",
        )
            .order(|_, call| arguments::offset(call.params).map(Order::Change)),
        look::<method::ToolList>("the tool table, and the tool in the spindle")
            .order(|_, _| Ok(Order::Tools)),
        order::<method::ToolSet>(
            "\"length\", \"diameter\", their wear (in the unit of the machine), \"pocket\", \"remark\" and life of a \"tool\", one or several of \
             them; a tool that the table lacks is added. A length whose G43 is in force counts at once",
        )
            .order(|_, call| arguments::tool(call.params).map(Order::Change)),
        order::<method::ToolDelete>("takes a \"tool\" out of the table; refused for the one in the spindle")
            .order(|_, call| arguments::deleted_tool(call.params).map(Order::Change)),
        order::<method::ToolChanged>("the tool that the program waits for is in the spindle")
            .order(|_, _| Ok(Order::ToolChanged)),
        order::<method::Jog>(
            "moves an \"axis\" (letter) or a \"joint\" (number) by hand: at a velocity, whose sign is the direction, as far \
             as the soft limit; or by \"distance_mm\", which adds up. Holds for 0.2 s: renew it with \"jog.keep\"",
        )
            .needs(Needs::ControlForJog)
            .order(|_, call| arguments::jog(call.params).map(Order::Jog)),
        order::<method::JogKeep>("the hand is still on the key: what is being jogged goes on for another 0.2 s; begins nothing")
            .needs(Needs::ControlForJog)
            .order(|_, call| arguments::jogging(call.params, JogMotion::Keep)),
        order::<method::JogStop>("lets an axis, a joint or all that is being jogged come to rest")
            .needs(Needs::Nothing)
            .role(Role::Watch)
            .order(|_, call| arguments::jogging(call.params, JogMotion::Release)),
        order::<method::Spindle>(
            "turns the spindle at \"speed_rpm\", counter-clockwise below 0, 0 stops it; coolant: \"coolant\". While a program runs it is \
             refused, but at M0 and while it is held: before it goes on, the spindle is again as the program had it",
        )
            .order(|methods, call| arguments::spindle(call.params, methods.described.spindle_rpm_max)),
        order::<method::Coolant>("switches \"flood\" and \"mist\" on (true) or off (false), as \"spindle\" turns the spindle")
            .order(|_, call| arguments::coolant(call.params)),
        order::<method::Hold>(
            "brings the program to rest on its path and keeps it: it may be jogged away then; a jog or a way back is over",
        )
            .needs(Needs::Nothing)
            .role(Role::Watch)
            .at_once(AtOnce::Hold),
        order::<method::Resume>(
            "goes on after a hold, and forward after \"reverse\"; in single block, runs the next block. Of a machine that was jogged \
             away: returns to where the program is held, Z up first (\"returns\": the legs), and waits there for the next one",
        )
            .order(|_, _| Ok(Order::Resume)),
        order::<method::Skip>(
            "gives up the block that the program waits in without moving (a dwell, M66 as if its time had run out, M0, M1) and goes \
             on with the next one; refused in any other, as what follows would begin elsewhere than it was programmed",
        )
            .order(|_, _| Ok(Order::Skip)),
        order::<method::Reverse>(
            "runs the program that runs or is held back along the path it has run, at \"percent\" (above 0 to 100, usually 100) \
             of its speed, as far as the last block that moves nothing or turns with the spindle; \"hold\" rests, \"resume\" \
             goes forward again",
        )
            .order(|_, call| arguments::reverse_share(call.params).map(Order::Reverse)),
        order::<method::SingleBlock>(
            "\"on\" (true or false): the program rests at the end of each block, \"resume\" runs the next one; what is planned \
             from now on stops at the end of each block exactly",
        )
            .order(|_, call| call.params.flag("on").map(Order::SingleBlock)),
        order::<method::OptionalStop>(
            "\"on\" (true or false): the program stops at M1 and waits for \"resume\"; counts as an M1 is reached",
        )
            .order(|_, call| call.params.flag("on").map(Order::OptionalStop)),
        order::<method::BlockDelete>(
            "\"on\" (true or false): lines that begin with / are skipped in programs and lines of MDI; refused while one runs, as \
             it was checked with the lines that it has",
        )
            .order(|_, call| call.params.flag("on").map(Order::BlockDelete)),
        order::<method::Stop>(
            "brings the machine to rest, a program on its path, and gives it up; spindle and coolant go off, drives stay on",
        )
            .needs(Needs::Nothing)
            .role(Role::Watch)
            .at_once(AtOnce::Stop),
        order::<method::Override>(
            "from now on feed (0 to 120), rapid moves (0 to 100) and the spindle (50 to 120) run at this many percent of what \
             is programmed; 0 holds these moves. At any time, for all programs; one that has switched overrides off (M49) \
             is not changed there. Without control, feed and rapid moves can be slowed down",
        )
            // It looks itself: slower is for everyone.
            .needs(Needs::Nothing)
            .role(Role::Watch)
            .quick(|methods, call| methods.set_overrides(call)),
        look::<method::JournalSince>(
            "entries of the journal behind number \"seq\" (0: all that are known), the oldest first, up to 500; \"more\": there are \
             others behind them; \"last\": the number of the last one of all, \"on_disk\": of the last one that outlasts this \
             control, or that a full disk does not take",
        )
            .order(|_, call| {
                match call.params.has("seq") {
                    true => call.params.number("seq", 0, u64::MAX),
                    false => Ok(0),
                }
                .map(Order::Journal)
            }),
        order::<method::PartsSet>(
            "sets the counter of parts to \"count\", how many are wanted to \"target\" (0: nobody says), or both; a program that \
             comes to its end (M2, M30) adds one",
        )
            .order(|_, call| arguments::parts(call.params)),
        order::<method::Acknowledge>(
            "allows motion again after a fault whose cause is gone; moves nothing and switches nothing on",
        )
            .order(|_, _| Ok(Order::Acknowledge)),
        look::<method::LogicList>(
            "programs in Structured Text: periods, scans, how many were skipped because the one before was not over, what a scan takes",
        )
            .quick(|methods, _| Ok(methods.logic_tasks())),
        look::<method::LogicLook>(
            "variables of a \"program\" (its name or file; left out: the only one) as they were behind one scan: all, or those of a \
             \"variable\", which may be a structure, an array or a block; of these, those that have all words of \"search\" in their \
             name or pin; up to 500, from number \"from\" of them on; \"more\": there are others behind them",
        )
            .quick(|methods, call| methods.logic_look(call)),
        order::<method::LogicForce>(
            "a \"variable\" has this \"value\" from the next scan on, whatever pins and the program make of it, until it is released, \
             the program is changed or the control ends; the journal tells it",
        )
            .role(Role::SetUp)
            .quick(|methods, call| methods.logic_force(call)),
        order::<method::LogicRelease>(
            "a \"variable\" that was forced, or without it all of them, are again what pins and the program make of them",
        )
            .role(Role::SetUp)
            .quick(|methods, call| methods.logic_release(call)),
        order::<method::LogicReload>(
            "reads the file of a program anew and lets it take the place of the one that runs, between two scans, with the values of \
             all variables that have the same name and type; only while the machine rests and no program of parts is under way",
        )
            .role(Role::SetUp)
            .errand(|methods, call| methods.logic_reload(call)),
        look::<method::MachineFile>(
            "the \"text\" of the machine file, its \"sha256\", and its \"errors\", each with its place; up to 48 KiB",
        )
            .role(Role::Operate)
            .errand(|methods, _| methods.read_machine_file()),
        look::<method::MachineCheck>(
            "what is wrong with a \"text\" as the machine file: \"errors\", each with its place; none if it is right",
        )
            .role(Role::SetUp)
            .errand(|methods, call| methods.check_machine_file(call)),
        order::<method::MachineWrite>(
            "puts a \"text\" in the place of the machine file whose SHA-256 is \"sha256\", and keeps that one beside it (\"before\"); \
             refused where it is wrong, where another has changed the file, and where the machine does not rest. Takes effect at \
             the next start",
        )
            .role(Role::SetUp)
            .errand(|methods, call| methods.write_machine_file(call)),
        look::<method::MachineDoctor>("what on this PC stands in the way of real time, as isocnc doctor --no-tests --json says")
            .errand(|methods, _| methods.doctor()),
        look::<method::PinValues>("\"pins\" of a list, as \"hal.list\" tells them")
            .quick(|methods, call| methods.pin_values(call)),
        order::<method::PinSet>(
            "gives a \"pin\" that no net reaches a \"value\": a number, 0, 1, false or true; the journal tells it",
        )
            .role(Role::SetUp)
            .quick(|methods, call| methods.set_pin(call)),
        order::<method::ButtonPress>(
            "presses a button of the user ([[panel.button]]) by its \"name\", with \"answers\" to its questions: runs its lines as \
             \"mdi.stream\" does, or loads its program. \"machine.describe\" has all buttons; a wrong answer is refused with the \
             \"field\" in the data",
        )
            .order(|methods, call| methods.press(call)),
        look::<method::JobKinds>(
            "the kinds of simple jobs (facing, pockets, holes, threads, engraving), each with its numbers: names, units, defaults and bounds",
        )
            .quick(|_, _| Ok(jobs::kinds())),
        look::<method::JobMake>(
            "writes the program of a job of a \"kind\" with its \"numbers\" and loads nothing: \"program.load\" takes the text. A number that \
             is not given has its default; what is wrong is refused with the \"field\" in the data",
        )
            .errand(|_, call| jobs::make(call)),
        look::<method::CycleTimes>(
            "how many cycles since the start took how long, \"counts\" up to each of \"edges_us\" and beyond: \"period\" (what the \
             distance of two SoCs differs from the cycle), \"lateness\" of the SoC, \"exchange\", \"compute\"; how many \"orders\" the cycle \
             has taken, and when the last of them",
        )
            .quick(|methods, _| Ok(methods.cycle_times())),
    ]
});
