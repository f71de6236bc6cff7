//! `/mtconnect/probe`, `current`, `sample`, `asset`: the crate `mtconnect` has the standard, this what the control tells.
//!
//! In:  requests; changes of the state, which the control tells its subscribers. Out: documents, and parts of streams.
//!
//! Nothing is observed before somebody asks for the first time; from then on, as long as the panel is served.

use crate::ask::{ask, connect};
use crate::guard::{Visitor, refuse};
use crate::serve::Panel;
use ::mtconnect::{
    Agent, Alarm, Axis, AxisFacts, Errors, Execution, Facts, Machine, Mode, Motion, Reply, Settings, Spindle, Stream,
    Subject, Tool, WaitFor,
};
use axum::Extension;
use axum::body::{Body, Bytes};
use axum::extract::{RawQuery, State};
use axum::http::header::{CACHE_CONTROL, CONNECTION, CONTENT_TYPE};
use axum::http::{HeaderValue, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use protocol::limits::{LETTERS, WORK_SYSTEMS};
use protocol::params::{self, NoParams};
use protocol::with_tokio::Client;
use protocol::{
    Activity, ClientError, Described, Entry, Followed, Outcome, Power, Received, Role, Severity, StateChange, Status,
    StatusAxis, Subscribed, Tools, WaitingFor, method,
};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::time::{MissedTickBehavior, interval, sleep};

/// Observations that are kept: minutes of a machine that moves.
const BUFFER: usize = 1 << 15;
/// States a second that the control is asked for.
const RATE_HZ: u64 = 10;
/// Between two looks at the tool table.
const TOOLS_EVERY: Duration = Duration::from_secs(5);
/// Shortest time between two parts of a stream.
const PART_PAUSE: Duration = Duration::from_millis(20);

/// The agent, once somebody has asked for it.
#[derive(Debug, Default)]
pub(crate) struct Shared(Mutex<Option<Agent>>);

impl Shared {
    pub(crate) fn with<T>(&self, work: impl FnOnce(&mut Agent) -> T) -> Option<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).as_mut().map(work)
    }
}

fn now() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// Answers a request; what stands before it in the path is left out.
pub(crate) async fn answer(
    State(panel): State<Arc<Panel>>,
    Extension(visitor): Extension<Visitor>,
    RawQuery(query): RawQuery,
    uri: Uri,
) -> Response {
    if let Err(refusal) = visitor.permit(Role::Watch) {
        return *refusal;
    }
    if let Err(why) = begin(&panel).await {
        return refuse(StatusCode::SERVICE_UNAVAILABLE, why);
    }
    let path = uri.path();
    let path = path.strip_prefix("/mtconnect").unwrap_or(path);
    let query = query.unwrap_or_default();
    let reply = panel.mtconnect.with(|agent| agent.answer(path, &query, now()));
    match reply {
        None => refuse(StatusCode::SERVICE_UNAVAILABLE, "nothing is known yet"),
        Some(Reply::Document(document)) => {
            let status = StatusCode::from_u16(document.status).unwrap_or(StatusCode::OK);
            let kind = HeaderValue::from_static("text/xml");
            (status, [(CONTENT_TYPE, kind)], document.xml).into_response()
        }
        Some(Reply::Stream(parts)) => streamed(&panel, parts),
    }
}

fn streamed(panel: &Arc<Panel>, parts: Stream) -> Response {
    let state = (Arc::clone(panel), parts);
    let parts = stream::unfold(state, |(panel, mut parts)| async move {
        loop {
            if parts.is_over() || *panel.ending.borrow() {
                return None;
            }
            if let Some(part) = panel.mtconnect.with(|agent| parts.part(agent, now())).flatten() {
                return Some((Ok::<_, Infallible>(Bytes::from(part)), (panel, parts)));
            }
            sleep(PART_PAUSE).await;
        }
    });
    let kind = HeaderValue::try_from(Stream::content_type()).unwrap_or(HeaderValue::from_static("multipart/mixed"));
    let fresh = HeaderValue::from_static("no-cache, no-store, max-age=0");
    let close = HeaderValue::from_static("close");
    (
        [(CONTENT_TYPE, kind), (CACHE_CONTROL, fresh), (CONNECTION, close)],
        Body::from_stream(parts),
    )
        .into_response()
}

/// Begins to observe, if nobody does yet.
///
/// # Errors
/// The control does not answer.
pub(crate) async fn begin(panel: &Arc<Panel>) -> Result<(), String> {
    if panel.mtconnect.with(|_| ()).is_some() {
        return Ok(());
    }
    let mut client = connect(panel, Role::Watch, "MTConnect")?;
    let machine = ask::<method::Describe>(&mut client, &NoParams {}).await?;
    let tools = ask::<method::ToolList>(&mut client, &NoParams {}).await?;
    let pins = Pins::of(&machine, &mut client).await?;
    let measured = match pins.names.is_empty() {
        true => Measured::new(),
        false => read(&ask::<method::PinValues>(&mut client, &pins.values()).await?),
    };
    let status = ask::<method::Status>(&mut client, &NoParams {}).await?;
    let errors = match panel.settings.mtconnect_old_errors {
        true => Errors::Coded,
        false => Errors::Typed,
    };
    let is_new = {
        let mut agent = panel.mtconnect.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_new = agent.is_none();
        agent.get_or_insert_with(|| {
            let mut agent = new_agent(&machine, &pins, errors);
            agent.tools(tool_table(&tools), now());
            agent.observe(&facts(&status, &[], &measured), now());
            agent
        });
        is_new
    };
    if is_new {
        tokio::spawn(observe(Arc::clone(panel), pins));
    }
    Ok(())
}

/// Pins that tell what is measured: by their name, where the machine has them.
#[derive(Debug, Default)]
struct Pins {
    names: Vec<String>,
}

/// What pins measure, by their names.
type Measured = HashMap<String, f64>;

/// Of a joint that is an axis: where it is, how far it is behind, torque in 1/1000 of the rated one.
fn pins_of(joint: usize) -> [String; 3] {
    [
        format!("joint.{joint}.motor-pos-fb"),
        format!("joint.{joint}.f-error"),
        format!("cia402.{joint}.drv-actual-torque"),
    ]
}

/// Turns a second.
const SPINDLE: &str = "spindle.0.speed-in";

impl Pins {
    async fn of(described: &Described, client: &mut Client) -> Result<Pins, String> {
        let joints = described.axes.iter().filter_map(|axis| axis.joint);
        let mut wanted: Vec<String> = joints.flat_map(pins_of).collect();
        wanted.push(SPINDLE.to_owned());
        let mut names = Vec::new();
        for name in wanted {
            let wanted = params::PinList {
                pattern: Some(name.clone()),
                from: None,
            };
            let found = ask::<method::PinList>(client, &wanted).await?;
            if !found.pins.is_empty() {
                names.push(name);
            }
        }
        Ok(Pins { names })
    }

    fn has(&self, name: &str) -> bool {
        self.names.iter().any(|known| known == name)
    }

    fn values(&self) -> params::PinValues {
        params::PinValues {
            pins: self.names.clone(),
        }
    }
}

/// Values of pins that are numbers.
fn read(told: &protocol::Pins) -> Measured {
    let pins = told.pins.iter();
    pins.filter_map(|pin| Some((pin.name.clone(), pin.value.as_f64()?)))
        .collect()
}

fn new_agent(described: &Described, pins: &Pins, errors: Errors) -> Agent {
    let name = described.machine.clone();
    let axes = described.axes.iter().filter_map(|axis| {
        let joint = axis.joint.map(pins_of);
        let has = |place: usize| joint.as_ref().is_some_and(|names| pins.has(&names[place]));
        Some(Axis {
            letter: axis.axis.chars().next()?,
            is_rotary: axis.unit == "degrees",
            is_measured: has(0),
            has_load: has(2),
        })
    });
    let machine = Machine {
        uuid: uuid(&name),
        description: format!("{name}, controlled by isocnc"),
        name,
        axes: axes.collect(),
        has_spindle: described.spindles > 0,
        measures_spindle: pins.has(SPINDLE),
    };
    let sender = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let settings = Settings {
        sender: sender.trim().to_owned(),
        instance: now().as_secs(),
        buffer: BUFFER,
        errors,
    };
    Agent::new(&machine, settings, now())
}

/// The same for the same machine at the same PC, for ever.
fn uuid(machine: &str) -> String {
    let pc = std::fs::read_to_string("/etc/machine-id").unwrap_or_default();
    let sum = Sha256::digest(format!("isocnc {} {machine}", pc.trim()));
    let digits: String = sum.iter().take(16).map(|octet| format!("{octet:02x}")).collect();
    let [a, b, c, d, e] = [
        &digits[..8],
        &digits[8..12],
        &digits[12..16],
        &digits[16..20],
        &digits[20..],
    ];
    format!("{a}-{b}-{c}-{d}-{e}")
}

/// Observes until the panel ends, also over a control that serves too many for a while.
async fn observe(panel: Arc<Panel>, pins: Pins) {
    let mut ending = panel.ending.clone();
    loop {
        tokio::select! {
            () = follow(&panel, &pins) => {}
            _ = ending.changed() => return,
        }
        panel.mtconnect.with(|agent| agent.lose(now()));
        sleep(Duration::from_secs(1)).await;
    }
}

/// Follows the control as long as it tells anything.
async fn follow(panel: &Arc<Panel>, pins: &Pins) {
    // It has ended, or something of it cannot be understood: it is asked anew.
    let Ok(client) = connect(panel, Role::Watch, "MTConnect") else {
        return;
    };
    if let Err(cause) = observed(panel, pins, client).await {
        tracing::debug!(%cause, "MTConnect");
    }
}

async fn observed(panel: &Arc<Panel>, pins: &Pins, mut client: Client) -> Result<(), ClientError> {
    let rate_hz = Some(RATE_HZ);
    let subscribed = client.put::<method::Subscribe>(&params::Subscribe { rate_hz });
    client.send().await?;
    let mut tools = interval(TOOLS_EVERY);
    // What is measured changes where the state does not.
    let mut looks = interval(Duration::from_millis(1000 / RATE_HZ));
    looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let (mut asked_tools, mut asked_pins) = (None, None);
    let (mut state, mut before) = (None::<Followed>, Vec::new());
    let mut measured = Measured::new();
    loop {
        let at = tokio::select! {
            message = client.message() => match message? {
                Received::Answer { id, result: Err(refused) } if id == Some(subscribed) => {
                    return Err(ClientError::Refused(refused));
                }
                Received::Answer { id, result: Ok(tools) } if id == asked_tools => {
                    let tools = protocol::client::read(tools)?;
                    panel.mtconnect.with(|agent| agent.tools(tool_table(&tools), now()));
                    continue;
                }
                Received::Answer { id, result: Ok(values) } if id == asked_pins => {
                    measured = read(&protocol::client::read(values)?);
                    now()
                }
                Received::Answer { id, result: Ok(whole) } if id == Some(subscribed) => {
                    let whole: Subscribed = protocol::client::read(whole)?;
                    state = Some(Followed::new(whole.state));
                    moment(whole.unix_s)
                }
                Received::Answer { .. } => continue,
                Received::Notification(news) => {
                    let StateChange { unix_s, changed, .. } = protocol::client::read(news.params)?;
                    let Some(state) = &mut state else { continue };
                    before.clone_from(&state.status().position_mm);
                    state.change(changed)?;
                    moment(unix_s)
                }
            },
            _ = looks.tick(), if !pins.names.is_empty() => {
                asked_pins = Some(client.put::<method::PinValues>(&pins.values()));
                client.send().await?;
                continue;
            }
            _ = tools.tick() => {
                asked_tools = Some(client.put::<method::ToolList>(&NoParams {}));
                client.send().await?;
                continue;
            }
        };
        // Measured values come in a moment: nothing that was known is unavailable meanwhile.
        if measured.is_empty() && !pins.names.is_empty() {
            continue;
        }
        if let Some(state) = &state {
            let facts = facts(state.status(), &before, &measured);
            panel.mtconnect.with(|agent| agent.observe(&facts, at));
        }
    }
}

/// A time of day, s since 1970.
fn moment(unix_s: f64) -> Duration {
    Duration::try_from_secs_f64(unix_s).unwrap_or_else(|_| now())
}

fn tool_table(told: &Tools) -> Vec<Tool> {
    let unit_mm = if told.unit == "inch" { 25.4 } else { 1.0 };
    let tools = told.tools.iter().map(|tool| Tool {
        number: tool.tool,
        pocket: tool.pocket,
        length_mm: tool.length * unit_mm,
        diameter_mm: tool.diameter * unit_mm,
        remark: tool.remark.clone(),
    });
    tools.collect()
}

/// The state of the control in the words of MTConnect; `were`: positions of a moment ago, none where they are not known.
fn facts(status: &Status, were: &[f64], measured: &Measured) -> Facts {
    let homing = status.activity == Activity::Homing;
    let axes_now = status.axes.iter().map(|axis| {
        let place = LETTERS
            .iter()
            .position(|letter| *letter == axis.axis)
            .unwrap_or_default();
        let position = status.position_mm.get(place).copied().unwrap_or_default();
        let moves = were.get(place).is_some_and(|was| *was != position);
        let motion = match (homing, moves) {
            (true, _) => Motion::Home,
            (false, true) => Motion::Travel,
            (false, false) => Motion::Stopped,
        };
        // An axis that is one joint alone has its pins: those of another one say nothing of it.
        let pins = match axis.joints[..] {
            [joint] => Some(pins_of(joint)),
            _ => None,
        };
        let of = |place: usize| pins.as_ref().and_then(|names| measured.get(&names[place]).copied());
        AxisFacts {
            commanded: position,
            actual: of(0),
            following_error: of(1),
            load_percent: of(2).map(|thousandths| thousandths / 10.0),
            motion,
        }
    });
    let mode = match status.mode {
        protocol::Mode::Auto if status.single_block => Mode::SemiAutomatic,
        protocol::Mode::Auto => Mode::Automatic,
        protocol::Mode::Mdi => Mode::Mdi,
        protocol::Mode::Manual => Mode::Manual,
    };
    let program = status.program.as_ref();
    Facts {
        is_emergency_stop: status.power.is_estop(),
        is_powered: status.power == Power::On,
        mode,
        execution: execution(status),
        single_block: status.single_block,
        optional_stop: status.optional_stop,
        dry_run: program.is_some_and(|program| program.dry_run),
        program: program.map(|program| program.name.clone()),
        line: Some(status.line),
        tool: status.tool,
        work_system: work_system(&status.codes),
        parts: status.parts.count,
        parts_wanted: status.parts.target,
        feed_override: status.overrides.feed_percent,
        rapid_override: status.overrides.rapid_percent,
        feed_mm_s: status.velocity_mm_s,
        place_mm: work_place(status),
        program_s: Some(status.elapsed_s),
        axes: axes_now.collect(),
        spindle: status.spindle.as_ref().map(|spindle| Spindle {
            speed_rpm: if spindle.on { spindle.speed_rpm } else { 0.0 },
            actual_rpm: measured.get(SPINDLE).map(|turns_s| turns_s * 60.0),
            speed_override: status.overrides.spindle_percent,
        }),
        alarms: alarm(status).into_iter().collect(),
        message: message(&status.messages),
    }
}

fn execution(status: &Status) -> Execution {
    match status.activity {
        Activity::Held if status.single_block => Execution::Interrupted,
        Activity::Held => Execution::FeedHold,
        Activity::Away | Activity::Returning => Execution::Interrupted,
        Activity::Stopping => Execution::Stopped,
        Activity::Running => match status.waiting.as_ref().map(|waiting| waiting.r#for) {
            None => Execution::Active,
            // M1 counts where it stops at all; which of both it is the text of the program knows.
            Some(WaitingFor::Operator) => Execution::ProgramStopped,
            Some(WaitingFor::ToolChange) => Execution::Wait(WaitFor::ToolLoad),
            Some(WaitingFor::Feed) => Execution::FeedHold,
            Some(WaitingFor::Dwell | WaitingFor::Probe) => Execution::Active,
            Some(_) => Execution::Wait(WaitFor::Other),
        },
        _ if status.alarm.is_some() || status.power.is_estop() => Execution::Stopped,
        Activity::Idle if status.mode == protocol::Mode::Auto => {
            match status.program.as_ref().and_then(|program| program.result) {
                Some(Outcome::Completed) => Execution::Completed,
                Some(_) => Execution::Stopped,
                None => Execution::Ready,
            }
        }
        _ => Execution::Ready,
    }
}

/// What stands, with its entry in the journal.
fn alarm(status: &Status) -> Option<Alarm> {
    let text = status.alarm.as_ref()?.to_string();
    let records = status.messages.iter().rev().filter_map(|entry| entry.alarm.as_ref());
    let record = records.into_iter().find(|record| record.severity != Severity::Warning);
    let code = record.map_or_else(|| "alarm".to_owned(), |record| record.code.clone());
    let of_joint = |joint: usize| {
        status
            .axes
            .iter()
            .position(|axis: &StatusAxis| axis.joints.contains(&joint))
    };
    let axis = record.and_then(|record| record.joint).and_then(of_joint);
    let subject = match (code.split('-').next().unwrap_or_default(), axis) {
        ("J", Some(axis)) if matches!(code.as_str(), "J-201" | "J-202") => Subject::Drive(axis),
        ("J", Some(axis)) => Subject::Travel(axis),
        ("N", _) => Subject::Communications,
        ("P", _) => Subject::Program,
        ("L", _) => Subject::Logic,
        _ => Subject::System,
    };
    Some(Alarm {
        subject,
        code,
        text,
        is_warning: false,
    })
}

fn message(entries: &[Entry]) -> Option<String> {
    entries.iter().rev().find_map(Entry::told_by_program).map(str::to_owned)
}

/// 1 for G54 to 9 for G59.3.
fn work_system(codes: &[String]) -> Option<u8> {
    let found = codes
        .iter()
        .find_map(|code| WORK_SYSTEMS.iter().position(|known| known == code));
    found.map(|at| at as u8 + 1)
}

/// X, Y and Z as the work has them.
fn work_place(status: &Status) -> [f64; 3] {
    let of = |list: &[f64], axis: usize| list.get(axis).copied().unwrap_or_default();
    let one = |axis: usize| of(&status.position_mm, axis) - of(&status.work_offset_mm, axis);
    let (sin, cos) = status.work_rotation_degrees.to_radians().sin_cos();
    let (x, y) = (one(0), one(1));
    [x * cos + y * sin, y * cos - x * sin, one(2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::{AlarmRecord, StatusProgram, Waiting};
    use serde_json::{Value, json};

    /// As it runs a program, but for what has changed.
    fn state(changed: &Value) -> Status {
        let axis = |axis: &str, joint| StatusAxis {
            axis: axis.into(),
            joints: vec![joint],
            unit: "mm".into(),
        };
        let mut state = json!(Status {
            power: Power::On,
            activity: Activity::Running,
            mode: protocol::Mode::Auto,
            program: Some(StatusProgram {
                name: "p.ngc".into(),
                ..StatusProgram::default()
            }),
            axes: vec![axis("X", 0), axis("Z", 2)],
            position_mm: vec![10.0, 0.0, 5.0],
            work_offset_mm: vec![1.0, 0.0, 2.0],
            codes: vec!["G0".into(), "G55".into()],
            ..Status::default()
        });
        for (name, value) in changed.as_object().unwrap() {
            state[name] = value.clone();
        }
        serde_json::from_value(state).unwrap()
    }

    fn told(changed: Value) -> Facts {
        facts(&state(&changed), &[], &Measured::new())
    }

    #[test]
    fn states_are_those_of_the_table() {
        let execution = |changed: Value| told(changed).execution;
        assert_eq!(execution(json!({})), Execution::Active);
        assert_eq!(execution(json!({ "activity": "held" })), Execution::FeedHold);
        assert_eq!(
            execution(json!({ "activity": "held", "single_block": true })),
            Execution::Interrupted
        );
        assert_eq!(execution(json!({ "activity": "returning" })), Execution::Interrupted);
        let waiting = |what: WaitingFor| {
            let waiting = Waiting {
                r#for: what,
                ..Waiting::default()
            };
            json!({ "waiting": waiting })
        };
        assert_eq!(execution(waiting(WaitingFor::Operator)), Execution::ProgramStopped);
        assert_eq!(
            execution(waiting(WaitingFor::ToolChange)),
            Execution::Wait(WaitFor::ToolLoad)
        );
        assert_eq!(execution(waiting(WaitingFor::Input)), Execution::Wait(WaitFor::Other));
        assert_eq!(execution(waiting(WaitingFor::Feed)), Execution::FeedHold);
        assert_eq!(execution(waiting(WaitingFor::Dwell)), Execution::Active);
        let idle = |result: Option<Outcome>| {
            let program = StatusProgram {
                result,
                ..StatusProgram::default()
            };
            json!({ "activity": "idle", "program": program })
        };
        assert_eq!(execution(idle(Some(Outcome::Completed))), Execution::Completed);
        assert_eq!(execution(idle(Some(Outcome::Stopped))), Execution::Stopped);
        assert_eq!(execution(idle(None)), Execution::Ready);
        assert_eq!(
            execution(json!({ "activity": "idle", "power": "estop" })),
            Execution::Stopped
        );
        assert_eq!(
            execution(json!({ "activity": "idle", "mode": "manual" })),
            Execution::Ready
        );
    }

    #[test]
    fn values_are_in_the_units_of_the_standard() {
        let facts = told(json!({}));
        assert_eq!(facts.place_mm, [9.0, 0.0, 3.0]);
        assert_eq!((facts.work_system, facts.axes[1].commanded), (Some(2), 5.0));
        let pins = [
            ("joint.2.motor-pos-fb", 4.99),
            ("cia402.2.drv-actual-torque", -125.0),
            (SPINDLE, -5.0),
        ];
        let measured = pins.map(|(name, value)| (name.to_owned(), value)).into();
        let spindle = json!({ "spindle": { "on": true, "speed_rpm": -300.0 } });
        let facts = super::facts(&state(&spindle), &[], &measured);
        assert_eq!(facts.axes[0].actual, None);
        assert_eq!(
            (facts.axes[1].actual, facts.axes[1].load_percent),
            (Some(4.99), Some(-12.5))
        );
        assert_eq!(facts.spindle.and_then(|spindle| spindle.actual_rpm), Some(-300.0));
        let turned = told(json!({ "work_rotation_degrees": 90.0 })).place_mm;
        assert!(turned[0].abs() < 1e-9 && (turned[1] + 9.0).abs() < 1e-9, "{turned:?}");
        let moved = super::facts(&state(&json!({})), &[9.0, 0.0, 5.0], &Measured::new());
        assert_eq!(
            [moved.axes[0].motion, moved.axes[1].motion],
            [Motion::Travel, Motion::Stopped]
        );
    }

    #[test]
    fn alarms_are_of_the_axis_whose_joint_they_name() {
        let of = |code: &str, joint: Option<usize>| {
            let record = AlarmRecord {
                code: code.into(),
                severity: Severity::Stop,
                joint,
                ..AlarmRecord::default()
            };
            let stopped = Entry {
                alarm: Some(record),
                ..Entry::new("alarm: x".into())
            };
            let looked = Entry::new(protocol::message!("message", "message: {text}", text = "look"));
            told(json!({ "alarm": protocol::Message::from("x"), "messages": [stopped, looked] }))
        };
        assert_eq!(of("J-201", Some(2)).alarms[0].subject, Subject::Drive(1));
        assert_eq!(of("J-203", Some(0)).alarms[0].subject, Subject::Travel(0));
        assert_eq!(of("N-101", None).alarms[0].subject, Subject::Communications);
        assert_eq!(of("P-601", None).alarms[0].code, "P-601");
        assert_eq!(of("S-301", None).message.as_deref(), Some("look"));
        assert_eq!(told(json!({})).alarms, []);
    }

    #[test]
    fn the_name_of_a_machine_gives_the_same_uuid_each_time() {
        assert_eq!(uuid("mill"), uuid("mill"));
        assert_ne!(uuid("mill"), uuid("lathe"));
        assert_eq!(uuid("mill").len(), 36);
    }
}
