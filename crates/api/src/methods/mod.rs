//! What a running control can be asked for: the table of methods.
//!
//! In:  requests of clients; records and replies of the cycle thread; answers of the operator.
//! Out: answers, at once or when the bus or the operator has carried an order out.
//!
//! To add a method: a row of [`table`](mod@table) and its function.

mod arguments;
mod described;
mod held;
mod jobs;
mod logic;
mod machine;
mod pin_values;
mod pins;
pub mod table;

pub use pins::{pin, value_json};

use super::buttons;
use super::control::{Control, NAME_MAX, Needs, Who};
use super::errands::Errands;
use super::metrics;
use super::paths::Paths;
use super::repeats::{self, Repeats, Seen};
use super::rpc::{self, Params, Request, RpcError, code};
use super::scopes::Scopes;
use super::server::subscription::{self, Subscription};
use super::server::{Caller, ClientId, Serve, Ticket};
use super::text_lines::{Place, lines};
use super::uploads::Uploads;
use crate::network_view::NetworkView;
use crate::orders::{Jog, Order, OrderClient, Shown, Source};
use ::machine::fault_order::FAULT;
use ::machine::faults::silenced;
use ::machine::state::State;
use bus::SDO_VALUE_MAX;
use bus::service::{BusService, MailboxError, MailboxRequest};
use config::{Config, JOINTS_MAX, OnLostControl, PanelButton};
use files::read::PROGRAM_MAX;
use nix::sys::eventfd::EventFd;
use obd::AbortCode;
use program::outline::Left;
use protocol::limits::{LINES_MAX, PART_MAX, STATE_RATE_MAX_HZ};
use protocol::params::Hex;
use protocol::{
    Coolant, Described, Direction, External, Identified, LimitSwitches, MethodInfo, Nothing, Octets, Overrides, Role,
    Spindle, Status, StatusAxis, StatusProgram, Subscribed, Text, UploadBegun, UploadGrown,
};
use rt::joint_jog::JogMotion;
use rt::logic::Desk as LogicDesk;
use rt::overrides::Overridden;
use rt::shared::{AtOnce, RtStatus};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use table::{METHODS, Method, Runs};

pub(crate) use table::value;

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
fn done() -> Result<Nothing, RpcError> {
    Ok(Nothing {})
}

/// Numbers of the joints of a set.
fn numbers(joints: u64) -> Vec<usize> {
    (0..JOINTS_MAX).filter(|joint| joints >> joint & 1 == 1).collect()
}

fn table() -> protocol::Methods {
    let methods = METHODS.iter().map(|method| MethodInfo {
        name: method.name.to_owned(),
        params: method.names().map(str::to_owned).collect(),
        does: method.does.to_owned(),
    });
    protocol::Methods(methods.collect())
}

/// Everything that methods can reach.
pub struct Methods {
    live: Arc<RtStatus>,
    bus: Box<dyn BusService>,
    /// What the machine file says.
    network: NetworkView,
    /// Orders under way that read: the others answer without a value.
    reading: Vec<Ticket>,
    /// Faults that simulated drives are asked for: of which drive, and which.
    faults: Vec<(Ticket, arguments::Fault)>,
    /// Way to the operator.
    operator: OrderClient,
    control: Control,
    uploads: Uploads,
    paths: Paths,
    errands: Errands,
    /// Orders that carry an id.
    repeats: Repeats,
    scopes: Scopes,
    time_of_day: fn() -> f64,
    /// Its axes: what does not change.
    axes: Vec<StatusAxis>,
    /// The machine as its file has it.
    described: Described,
    /// Letters of its axes, and whether they count degrees.
    letters: Vec<(char, bool)>,
    /// Joint of each axis, where it has one of its own and is the same.
    joint_of: Vec<Option<usize>>,
    joints: usize,
    /// A client that had taken control and is lost holds the program.
    holds_on_lost_control: bool,
    /// Who has held the program.
    holder: held::Holder,
    /// Machine files that are being written, and by whom.
    writing: Vec<(Ticket, String)>,
    /// What drives the pins that hold the feed.
    feed_nets: held::FeedNets,
    /// Where the text of a program was last read.
    text_place: Place,
    /// Folder of programs.
    programs: Option<PathBuf>,
    /// Buttons of the user.
    buttons: Vec<PanelButton>,
    pins: Box<Pins>,
    /// Names of external components.
    external: Vec<String>,
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
        let (paths, errands) = (Paths::new(operator.wake()), Errands::new(operator.wake()));
        Methods {
            live,
            bus,
            network,
            reading: Vec::new(),
            faults: Vec::new(),
            operator,
            control: Control::default(),
            uploads: Uploads::default(),
            paths,
            scopes: Scopes::default(),
            errands,
            repeats: Repeats::default(),
            time_of_day: || 0.0,
            axes: Vec::new(),
            described: Described::default(),
            letters: Vec::new(),
            joint_of: Vec::new(),
            joints: 0,
            holds_on_lost_control: false,
            holder: held::Holder::default(),
            writing: Vec::new(),
            feed_nets: held::FeedNets::default(),
            text_place: Place::default(),
            programs: None,
            buttons: Vec::new(),
            pins: Box::new(|_| None),
            external: Vec::new(),
            logic: Arc::default(),
            now_ns,
        }
    }

    /// Shows its axes, and its spindle and coolant as the pins have them; states are stamped with this time of day, too, s since
    /// 1970. `file`: that of its pins.
    pub fn of_machine(
        self,
        config: &Config,
        pins: impl Fn(&str) -> Option<f64> + Send + 'static,
        time_of_day: fn() -> f64,
        file: &Path,
    ) -> Methods {
        let axes = config.axes.iter().map(|map| StatusAxis {
            axis: map.axis.letter().to_string(),
            joints: map.joints.clone(),
            unit: described::unit(map).to_owned(),
        });
        Methods {
            axes: axes.collect(),
            described: described::machine(config),
            letters: config
                .axes
                .iter()
                .map(|map| (map.axis.letter(), map.axis.is_rotary()))
                .collect(),
            joint_of: (config.axes.iter())
                .map(|map| described::joint_of(config, map))
                .collect(),
            joints: config.joints.len(),
            holds_on_lost_control: (config.panel.as_ref())
                .is_some_and(|panel| panel.on_lost_control == OnLostControl::Hold),
            feed_nets: held::FeedNets::of(config),
            buttons: (config.panel.as_ref()).map_or_else(Vec::new, |panel| panel.buttons.clone()),
            pins: Box::new(pins),
            external: config.external.iter().map(|of| of.name.clone()).collect(),
            time_of_day,
            scopes: match file.parent() {
                Some(folder) => Scopes::new(folder.to_owned(), &config.name),
                None => Scopes::default(),
            },
            ..self
        }
    }

    /// Lets clients name programs of this folder.
    pub fn with_programs(self, folder: Option<PathBuf>) -> Methods {
        let described = Described {
            programs: folder.is_some(),
            ..self.described
        };
        Methods {
            programs: folder,
            described,
            ..self
        }
    }

    fn metrics(&mut self) -> protocol::Metrics {
        let shown = self.operator.shown();
        let now_ns = (self.now_ns)();
        for (place, node) in self.network.nodes.iter_mut().enumerate() {
            node.live = self.bus.node(place, now_ns);
        }
        let facts = metrics::Facts {
            machine: &self.network.machine,
            axes: &self.letters,
            joint_of: &self.joint_of,
            joints: self.joints,
            cycle_s: f64::from(self.network.cycle_us) * 1e-6,
            network: &self.network,
            parts: shown.parts.count,
            tool: shown.tool,
            is_alarm: shown.alarm.is_some(),
            forced: self.logic.forced().len(),
            controlled: self.control.shown(now_ns).is_some(),
        };
        protocol::Metrics {
            text: metrics::text(&facts, &self.live, |name| (self.pins)(name)),
        }
    }

    fn program_text(&mut self, call: &Call<'_>) -> Result<Text, RpcError> {
        let number = |name: &str, most, default| match call.params.has(name) {
            true => call.params.number(name, 1, most),
            false => Ok(default),
        };
        let range = (
            number("from_line", u64::from(u32::MAX), 1)?,
            number("lines", LINES_MAX, 50)?,
        );
        let shown = self.operator.shown();
        let (Some(program), Some(text)) = (shown.program, shown.text) else {
            return Err(RpcError::new(
                code::REFUSED,
                "no program is loaded: isocnc program load FILE",
            ));
        };
        let found = lines(&text.text, text.revision, range, &mut self.text_place);
        let found = found.map_err(|cause| RpcError::new(code::REFUSED, format!("{}: {cause}", program.name)))?;
        let Some((lines, more)) = found else {
            let what = format!("line {} lies far on and is being looked for: ask again", range.0);
            return Err(RpcError::new(code::REFUSED, what));
        };
        Ok(Text {
            name: program.name,
            revision: text.revision,
            first_line: range.0,
            lines,
            more,
        })
    }

    /// Shows its programs in Structured Text.
    pub fn with_logic(self, logic: Arc<LogicDesk>) -> Methods {
        Methods { logic, ..self }
    }

    /// What the first spindle is told, if there is one.
    fn spindle(&self) -> Option<Spindle> {
        Some(Spindle {
            speed_rpm: (self.pins)("spindle.0.speed-out")?,
            on: (self.pins)("spindle.0.on") == Some(1.0),
        })
    }

    fn coolant(&self) -> Coolant {
        let is_on = |name: &str| (self.pins)(name) == Some(1.0);
        Coolant {
            flood: is_on("iocontrol.0.coolant-flood"),
            mist: is_on("iocontrol.0.coolant-mist"),
        }
    }

    /// Whether processes write the outputs of external components.
    fn external(&self) -> Vec<External> {
        let shown = self.external.iter().map(|name| {
            let pin = |of: &str| (self.pins)(&format!("{name}.{of}")).unwrap_or_default();
            External {
                name: name.clone(),
                alive: pin("alive") == 1.0,
                losses: pin("losses") as u64,
            }
        });
        shown.collect()
    }

    fn status(&mut self) -> Status {
        let live = self.live.snapshot();
        let shown = self.operator.shown();
        let Progress {
            remaining_s,
            done_percent,
            note,
        } = self.progress(&shown, live.way);
        let text = |word: &'static str| word.to_owned();
        Status {
            api: text(table::API_VERSION),
            version: text(env!("CARGO_PKG_VERSION")),
            machine: self.network.machine.clone(),
            file: self.network.file.clone(),
            pid: std::process::id(),
            state: live.state,
            cycles: live.cycles,
            cycles_skipped: live.cycles_skipped,
            late_max_us: live.late_max_ns as f64 / 1e3,
            homed: numbers(live.homed),
            line: live.line,
            direction: match live.reversing {
                true => Direction::Reverse,
                false => Direction::Forward,
            },
            single_block: live.single_block,
            optional_stop: live.optional_stop,
            block_delete: shown.block_delete,
            velocity_mm_s: live.velocity_mm_s,
            axes: self.axes.clone(),
            position_mm: live.position.0.to_vec(),
            to_go_mm: live.piece_end.map(|end| {
                let left = end.0.iter().zip(live.position.0).map(|(end, position)| end - position);
                left.collect()
            }),
            spindle: self.spindle(),
            coolant: self.coolant(),
            external: self.external(),
            overrides: self.overrides(),
            step: shown.step,
            power: shown.power,
            next: shown.next,
            mode: shown.mode,
            activity: shown.activity,
            job: shown.job,
            program: shown.program.map(StatusProgram::from),
            mdi: shown.mdi,
            held_by: self.held_by(&live),
            waiting: shown.waiting,
            codes: shown.codes,
            tool: shown.tool,
            work_offset_mm: shown.work_offset,
            work_rotation_degrees: shown.work_rotation_degrees,
            elapsed_s: live.elapsed_s,
            remaining_s,
            done_percent,
            remaining_note: note,
            estop_chain_open: live.chain_open,
            held_at_mm: live.held_at.map(|place| place.0.to_vec()),
            limit_switches: LimitSwitches {
                lower: numbers(live.limits[0]),
                upper: numbers(live.limits[1]),
            },
            alarm: shown.alarm,
            alarms: shown.alarms,
            forced: self.forced(),
            obstruction: shown.obstruction,
            messages: shown.messages,
            control: self.control.shown((self.now_ns)()),
            parts: described::parts(shown.parts),
            runs_left: shown.runs_left,
            last_program: shown.last_program.map(described::last_program),
        }
    }

    /// A status of this moment, field by field.
    fn stamped(&self, status: &Status) -> subscription::State {
        let fields = match value(status) {
            Ok(Value::Object(fields)) => fields,
            Ok(_) | Err(_) => Map::new(),
        };
        subscription::State {
            monotonic_ns: (self.now_ns)(),
            unix_s: (self.time_of_day)(),
            fields,
        }
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
    fn overrides(&self) -> Overrides {
        let percent = |what| self.live.overrides.percent(what);
        let enables = self.live.snapshot().enables;
        Overrides {
            feed_percent: percent(Overridden::Feed),
            rapid_percent: percent(Overridden::Rapid),
            spindle_percent: percent(Overridden::Spindle),
            feed_acts: enables.feed_override,
            spindle_acts: enables.spindle_override,
            adaptive_feed_acts: enables.adaptive_feed,
            feed_hold_acts: enables.feed_hold,
        }
    }

    fn subscribe(&mut self, call: &mut Call<'_>) -> Result<Subscribed, RpcError> {
        let rate_hz = match call.params.has("rate_hz") {
            true => call.params.number("rate_hz", 1, STATE_RATE_MAX_HZ)?,
            false => STATE_RATE_MAX_HZ,
        };
        let status = self.status();
        let state = self.stamped(&status);
        call.caller.subscription = Some(Subscription::begin(&state, rate_hz));
        Ok(Subscribed {
            monotonic_s: state.monotonic_s(),
            unix_s: state.unix_s,
            state: status,
        })
    }

    fn identify(&mut self, call: &mut Call<'_>) -> Result<Identified, RpcError> {
        if let Some(name) = client_name(call.params)? {
            call.caller.name = Some(name.to_owned());
        }
        Ok(Identified {
            client: call.caller.client,
            role: call.caller.role,
            machine: self.network.machine.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            api: table::API_VERSION.to_owned(),
        })
    }

    fn take_control(&mut self, call: &mut Call<'_>) -> Result<Option<protocol::Control>, RpcError> {
        let force = call.params.has("force") && call.params.flag("force")?;
        let mut who = who(call.caller);
        if let Some(name) = client_name(call.params)? {
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

    fn begin_upload(&mut self, call: &Call<'_>) -> Result<UploadBegun, RpcError> {
        let octets = call.params.number("octets", 0, u64::MAX)?;
        let name = call.params.text("name")?;
        let name = arguments::needed(name, "name", "a text")?;
        let upload = self.uploads.begin(call.caller.client, name, octets, (self.now_ns)())?;
        Ok(UploadBegun {
            upload,
            part_octets: PART_MAX,
        })
    }

    fn append_upload(&mut self, call: &Call<'_>) -> Result<UploadGrown, RpcError> {
        let (upload, part) = (upload(call.params)?, call.params.octets("value", PART_MAX)?);
        let at = call.params.number("at", 0, PROGRAM_MAX)?;
        let received = (self.uploads).append(call.caller.client, upload, at, &part, (self.now_ns)())?;
        Ok(UploadGrown { received })
    }

    fn commit_upload(&mut self, call: &Call<'_>) -> Result<Nothing, RpcError> {
        let (upload, sum) = (upload(call.params)?, call.params.octets("sha256", 32)?);
        (self.uploads).commit(call.caller.client, upload, &sum, (self.now_ns)())?;
        done()
    }

    fn begin_path(&mut self, call: &Call<'_>) -> Result<Order, RpcError> {
        let tolerance_mm = arguments::tolerance_mm(call.params)?;
        let begun = self.paths.begin(call.caller.client, tolerance_mm, (self.now_ns)());
        begun.map(Order::Path)
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
        if let Some(name) = call.params.text("file")? {
            if let Some(other) = ["path", "upload", "name", "text"]
                .iter()
                .find(|name| call.params.has(name))
            {
                let what = format!("expected \"file\" alone, got \"{other}\", too");
                return Err(RpcError::new(code::INVALID_PARAMS, what));
            }
            return buttons::stored(self.programs.as_deref(), name);
        }
        if call.params.has("path") {
            // Any file that the control may read.
            call.caller.role.permit(Role::SetUp)?;
        }
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

    /// What a button of the user orders.
    fn press(&self, call: &Call<'_>) -> Result<Order, RpcError> {
        let name = arguments::needed(call.params.text("name")?, "name", "the name of a button")?;
        let Some(button) = self.buttons.iter().find(|button| button.name == name) else {
            let what =
                format!("parameter \"name\": this machine has no button \"{name}\"; \"machine.describe\" has them all");
            return Err(RpcError::new(code::INVALID_PARAMS, what));
        };
        if button.set_up {
            call.caller.role.permit(Role::SetUp)?;
        }
        let none = Map::new();
        let answers = match call.params.0.get("answers") {
            None => &none,
            Some(Value::Object(answers)) => answers,
            Some(_) => {
                let what = "parameter \"answers\": expected an object, a number for each question";
                return Err(RpcError::new(code::INVALID_PARAMS, what));
            }
        };
        buttons::pressed(button, answers, self.programs.as_deref())
    }

    /// Turns overrides: all that are given, or none where one of them cannot be. No way over the operator's inbox: whoever
    /// cuts turns the feed down because he hears something.
    fn set_overrides(&mut self, call: &mut Call<'_>) -> Result<Overrides, RpcError> {
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
            call.caller.role.permit(Role::Operate)?;
            self.permit(call.caller, Needs::Control)?;
        }
        for (what, percent) in wanted {
            self.live.overrides.order(what, percent).map_err(invalid)?;
        }
        // Nobody waits for its answer.
        let _ = self.operator.put_by(0, Order::Turned, Some(who(call.caller).name));
        Ok(self.overrides())
    }

    fn permit(&mut self, caller: &Caller, needs: Needs) -> Result<(), RpcError> {
        let now_ns = (self.now_ns)();
        self.control.permit(caller.client, || who(caller), needs, now_ns)
    }

    /// Runs a method where its kind runs.
    fn run(&mut self, method: &Method, call: &mut Call<'_>) -> Answer {
        let begun = match method.runs {
            Runs::Quick(ref quick) => return Some(quick(self, call)),
            Runs::Later(later) => return later(self, call),
            Runs::AtOnce(what) => self.order(
                call,
                match what {
                    AtOnce::Hold => Order::Hold,
                    AtOnce::Stop => Order::Stop,
                    AtOnce::Estop => Order::Estop,
                },
            ),
            Runs::Order(order) => order(self, call).and_then(|order| self.order(call, order)),
            Runs::Errand(errand) => errand(self, call).and_then(|errand| self.errands.begin(call.ticket, errand)),
        };
        begun.err().map(Err)
    }

    fn order(&mut self, call: &Call<'_>, order: Order) -> Result<(), RpcError> {
        // What a hand says many times a second needs no name.
        let is_kept = matches!(
            order,
            Order::Jog(Jog {
                motion: JogMotion::Keep | JogMotion::Release,
                ..
            })
        );
        let who = (!is_kept).then(|| who(call.caller));
        self.holder.follow(&order, who.as_ref());
        let put = self.operator.put_by(call.ticket, order, who.map(|who| who.name));
        put.map_err(|what| RpcError::new(code::REFUSED, what))
    }

    /// What is done with a request where it is read.
    pub fn at_once(&self) -> impl Fn(&Request) + Send + use<> {
        let live = Arc::clone(&self.live);
        move |request| {
            let method = METHODS.iter().find(|method| method.name == request.method);
            if let Some((method, what)) = method.and_then(|method| Some((method, method.at_once()?)))
                && request.params.only(&method.names().collect::<Vec<_>>()).is_ok()
            {
                live.order(what);
            }
        }
    }

    fn network(&mut self) -> Result<protocol::Network, RpcError> {
        let now_ns = (self.now_ns)();
        let mut view = self.network.clone();
        view.live = self.bus.network(now_ns);
        for (place, node) in view.nodes.iter_mut().enumerate() {
            node.live = self.bus.node(place, now_ns);
        }
        value(&view).map(protocol::Network)
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
        let request = MailboxRequest {
            ticket,
            node: self.node_of(id)?,
            index,
            sub,
            value: write.then_some(value),
        };
        self.ask(request)?;
        if !write {
            self.reading.push(ticket);
        }
        Ok(())
    }

    /// The place of a node.
    fn node_of(&self, id: u64) -> Result<usize, RpcError> {
        let node = self.network.nodes.iter().position(|node| u64::from(node.id) == id);
        node.ok_or_else(|| {
            let ids: Vec<String> = self.network.nodes.iter().map(|node| node.id.to_string()).collect();
            let what = format!("no node has the id {id}; nodes are {}", ids.join(", "));
            RpcError::new(code::INVALID_PARAMS, what)
        })
    }

    fn ask(&mut self, request: MailboxRequest) -> Result<(), RpcError> {
        self.bus.request(request).map_err(|_| {
            let what = "as many objects as possible are being read or written already";
            RpcError::new(code::REFUSED, what)
        })
    }

    fn sim_fault(&mut self, call: &Call<'_>) -> Answer {
        match self.order_fault(call) {
            Ok(()) => None,
            Err(error) => Some(Err(error)),
        }
    }

    fn order_fault(&mut self, call: &Call<'_>) -> Result<(), RpcError> {
        let (id, mut fault) = arguments::sim_fault(call.params)?;
        let node = self.node_of(id)?;
        let found = &self.network.nodes[node];
        if found.profile != "drive" {
            let what = format!("node {id} ({}) is no drive", found.name);
            return Err(RpcError::new(code::INVALID_PARAMS, what));
        }
        fault.drive = format!("{} (node {id})", found.name);
        self.ask(MailboxRequest {
            ticket: call.ticket,
            node,
            index: FAULT,
            sub: fault.axis + 1,
            value: Some(fault.order.octets().to_vec()),
        })?;
        // Nobody waits for its answer.
        let _ = self.operator.put(0, Order::Note(fault.to_string().into()));
        self.faults.push((call.ticket, fault));
        Ok(())
    }

    /// An answer that is ready, to whoever ordered it.
    fn first_time(&mut self) -> Option<(Ticket, Result<Value, RpcError>)> {
        if let Some((ticket, result)) = self.operator.answer() {
            if let Err(error) = &result {
                tracing::info!(ticket, error = error.message.text, "refused");
            }
            return Some((ticket, result));
        }
        self.scopes.pump((self.now_ns)());
        if let Some(replaced) = self.logic.replaced() {
            return Some(self.logic_replaced(replaced));
        }
        if let Some(part) = self.paths.later() {
            return Some(part);
        }
        if let Some((ticket, answer)) = self.errands.later() {
            self.note_machine_file(ticket, &answer);
            return Some((ticket, answer));
        }
        let reply = self.bus.reply()?;
        let read = self.reading.iter().position(|ticket| *ticket == reply.ticket);
        if let Some(at) = read {
            self.reading.swap_remove(at);
        }
        let fault = self.faults.iter().position(|(ticket, _)| *ticket == reply.ticket);
        if let Some(at) = fault {
            let (_, fault) = self.faults.swap_remove(at);
            return Some((reply.ticket, fault.answer(reply.result)));
        }
        let result = match reply.result {
            Ok(octets) if read.is_some() => value(&Octets { value: Hex(octets) }),
            Ok(_) => value(&Nothing {}),
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
        let params: Vec<&str> = method.names().collect();
        if let Err(error) = request
            .params
            .only(&params)
            .and_then(|()| caller.role.permit(method.role))
        {
            return Some(Err(error));
        }
        if !method.looks && self.live.snapshot().state == State::Silenced {
            return Some(Err(silenced(false, false).into()));
        }
        let seen = match repeats::id(&request.params) {
            Ok(None) => Ok(Seen::New),
            Ok(Some(id)) => (self.repeats).see(id, method.name, &request.params, ticket, now_ns),
            Err(error) => Err(error),
        };
        match seen {
            Ok(Seen::New) => {}
            Ok(Seen::Answered(answer)) => return Some(answer),
            Ok(Seen::UnderWay) => return None,
            Err(error) => return Some(Err(error)),
        }
        let permitted = self.permit(caller, method.needs);
        let mut call = Call {
            caller,
            params: &request.params,
            ticket,
        };
        let answer = match permitted {
            Ok(()) => self.run(method, &mut call),
            Err(error) => Some(Err(error)),
        };
        if let Some(answer) = &answer {
            self.repeats.answered(ticket, answer);
        }
        match &answer {
            Some(Err(error)) => tracing::info!(ticket, method = method.name, error = error.message.text, "refused"),
            _ if method.looks => tracing::trace!(ticket, method = method.name),
            _ => tracing::info!(ticket, method = method.name),
        }
        answer
    }

    fn later(&mut self) -> Option<(Ticket, Result<Value, RpcError>)> {
        if let Some(again) = self.repeats.ready() {
            return Some(again);
        }
        let (ticket, answer) = self.first_time()?;
        self.repeats.answered(ticket, &answer);
        Some((ticket, answer))
    }

    fn gone(&mut self, ticket: Ticket) -> bool {
        self.paths.gone(ticket);
        // What a node was asked goes its way.
        self.repeats.gone(ticket) || self.operator.withdraw(ticket)
    }

    fn keeps(&self, client: ClientId) -> bool {
        self.control.is_taken_by(client) || self.scopes.tells(client)
    }

    fn news(&mut self, client: ClientId) -> Option<String> {
        let rows = self.scopes.news(client, (self.now_ns)())?;
        Some(rpc::notification("scope", &rows))
    }

    fn left(&mut self, client: ClientId) {
        if self.holds_on_lost_control && self.control.is_taken_by(client) {
            // Of no effect where nothing runs.
            let _ = self.operator.put(0, Order::Hold);
            let now_ns = (self.now_ns)();
            self.holder.lose(self.control.shown(now_ns).map(|control| control.name));
        }
        if self.control.release(client, (self.now_ns)()) {
            let motion = JogMotion::Release;
            // Nobody waits for its answer; without room, what moves comes to rest as nobody renews it.
            let _ = self.operator.put(0, Order::Jog(Jog { what: None, motion }));
        }
        self.uploads.left(client);
        self.paths.left(client);
        self.scopes.left(client);
    }

    fn state(&mut self) -> subscription::State {
        let status = self.status();
        self.stamped(&status)
    }

    fn wake(&self) -> Option<Arc<EventFd>> {
        self.operator.wake()
    }
}

/// What a client says that it is called.
fn client_name(params: &Params) -> Result<Option<&str>, RpcError> {
    match params.text("name")? {
        Some(name) if name.is_empty() || name.len() > NAME_MAX || name.contains(char::is_control) => {
            let what = format!("parameter \"name\": expected one to {NAME_MAX} octets that can be printed");
            Err(RpcError::new(code::INVALID_PARAMS, what))
        }
        name => Ok(name),
    }
}

fn upload(params: &Params) -> Result<u64, RpcError> {
    params.number("upload", 0, u64::from(u32::MAX))
}

/// Who somebody is, as far as the system tells.
fn who(caller: &Caller) -> Who {
    let of_process = || std::fs::read_to_string(format!("/proc/{}/comm", caller.process)).unwrap_or_default();
    let name = caller.name.clone().unwrap_or_else(of_process);
    let name = name.trim_end();
    Who {
        client: caller.client,
        process: caller.process,
        name: if name.is_empty() { "a client" } else { name }.to_owned(),
    }
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod golden;
