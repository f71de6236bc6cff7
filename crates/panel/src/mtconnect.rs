//! `/mtconnect/probe`, `current`, `sample`, `asset`: the crate `mtconnect` has the standard, this what the control tells.
//!
//! In:  requests; changes of the state, which the control tells its subscribers. Out: documents, and parts of streams.
//!
//! Nothing is observed before somebody asks for the first time; from then on, as long as the panel is served.

use crate::Guest;
use crate::ask::Asker;
use crate::guard::{Visitor, refuse};
use crate::serve::Panel;
use crate::tokens::Role;
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
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::UnixStream;
use tokio::time::{MissedTickBehavior, interval, sleep};

/// Observations that are kept: minutes of a machine that moves.
const BUFFER: usize = 1 << 15;
/// States a second that the control is asked for.
const RATE_HZ: u32 = 10;
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
    let mut asker = Asker::new(panel, Role::Watch, "MTConnect")?;
    let machine = asker.ask("machine.describe", json!({})).await?;
    let tools = asker.ask("tool.list", json!({})).await?;
    let pins = Pins::of(&machine, &mut asker).await?;
    let measured = match pins.names.is_empty() {
        true => Value::Null,
        false => asker.ask("hal.values", json!({ "pins": pins.names })).await?,
    };
    let state = asker.ask("status", json!({})).await?;
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
            agent.observe(&facts(&state, &Map::new(), &pins.read(&measured)), now());
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
fn pins_of(joint: u64) -> [String; 3] {
    [
        format!("joint.{joint}.motor-pos-fb"),
        format!("joint.{joint}.f-error"),
        format!("cia402.{joint}.drv-actual-torque"),
    ]
}

/// Turns a second.
const SPINDLE: &str = "spindle.0.speed-in";

impl Pins {
    async fn of(described: &Value, asker: &mut Asker) -> Result<Pins, String> {
        let joints = list(&described["axes"])
            .iter()
            .filter_map(|axis| axis["joint"].as_u64());
        let mut wanted: Vec<String> = joints.flat_map(pins_of).collect();
        wanted.push(SPINDLE.to_owned());
        let mut names = Vec::new();
        for name in wanted {
            let found = asker.ask("hal.list", json!({ "pattern": name })).await?;
            if !list(&found["pins"]).is_empty() {
                names.push(name);
            }
        }
        Ok(Pins { names })
    }

    fn has(&self, name: &str) -> bool {
        self.names.iter().any(|known| known == name)
    }

    fn read(&self, told: &Value) -> Measured {
        let one = |pin: &Value| Some((pin["name"].as_str()?.to_owned(), pin["value"].as_f64()?));
        list(&told["pins"]).iter().filter_map(one).collect()
    }
}

fn new_agent(described: &Value, pins: &Pins, errors: Errors) -> Agent {
    let name = described["machine"].as_str().unwrap_or("machine").to_owned();
    let axes = list(&described["axes"]).iter().filter_map(|axis| {
        let joint = axis["joint"].as_u64().map(pins_of);
        let has = |place: usize| joint.as_ref().is_some_and(|names| pins.has(&names[place]));
        Some(Axis {
            letter: axis["axis"].as_str()?.chars().next()?,
            is_rotary: axis["unit"] == "degrees",
            is_measured: has(0),
            has_load: has(2),
        })
    });
    let machine = Machine {
        uuid: uuid(&name),
        description: format!("{name}, controlled by isocnc"),
        name,
        axes: axes.collect(),
        has_spindle: described["spindles"].as_u64() > Some(0),
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
    let guest = Guest {
        role: Role::Watch,
        name: "MTConnect".into(),
    };
    let connected = panel.control.connect(&guest).and_then(|stream| {
        stream.set_nonblocking(true)?;
        UnixStream::from_std(stream)
    });
    let Ok(stream) = connected else { return };
    let (lines, mut requests) = stream.into_split();
    let mut lines = BufReader::new(lines).lines();
    let subscribe = json!({ "jsonrpc": "2.0", "id": 1, "method": "subscribe", "params": { "rate_hz": RATE_HZ } });
    if requests.write_all(format!("{subscribe}\n").as_bytes()).await.is_err() {
        return;
    }
    let mut tools = interval(TOOLS_EVERY);
    // What is measured changes where the state does not.
    let mut looks = interval(Duration::from_millis(1000 / u64::from(RATE_HZ)));
    looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let (mut state, mut before) = (Map::new(), Map::new());
    let mut measured = Measured::new();
    loop {
        tokio::select! {
            line = lines.next_line() => {
                let Ok(Some(line)) = line else { return };
                let Ok(message) = serde_json::from_str::<Value>(&line) else { return };
                if message["id"] == 2 {
                    panel.mtconnect.with(|agent| agent.tools(tool_table(&message["result"]), now()));
                    continue;
                }
                if message["id"] == 3 {
                    measured = pins.read(&message["result"]);
                    if !state.is_empty() {
                        let facts = facts(&Value::Object(state.clone()), &before, &measured);
                        panel.mtconnect.with(|agent| agent.observe(&facts, now()));
                    }
                    continue;
                }
                let (told, fields) = match message.get("method") {
                    Some(_) => (&message["params"], &message["params"]["changed"]),
                    None => (&message["result"], &message["result"]["state"]),
                };
                let Value::Object(fields) = fields else { continue };
                before.clone_from(&state);
                state.extend(fields.clone());
                if measured.is_empty() && !pins.names.is_empty() {
                    // It comes in a moment: nothing that was known is unavailable meanwhile.
                    continue;
                }
                let at = told["unix_s"].as_f64().and_then(|unix_s| Duration::try_from_secs_f64(unix_s).ok()).unwrap_or_else(now);
                let facts = facts(&Value::Object(state.clone()), &before, &measured);
                panel.mtconnect.with(|agent| agent.observe(&facts, at));
            }
            _ = looks.tick(), if !pins.names.is_empty() => {
                let ask = json!({ "jsonrpc": "2.0", "id": 3, "method": "hal.values", "params": { "pins": pins.names } });
                if requests.write_all(format!("{ask}\n").as_bytes()).await.is_err() {
                    return;
                }
            }
            _ = tools.tick() => {
                let ask = json!({ "jsonrpc": "2.0", "id": 2, "method": "tool.list", "params": {} });
                if requests.write_all(format!("{ask}\n").as_bytes()).await.is_err() {
                    return;
                }
            }
        }
    }
}

fn tool_table(told: &Value) -> Vec<Tool> {
    let unit_mm = if told["unit"] == "inch" { 25.4 } else { 1.0 };
    let tools = list(&told["tools"]).iter().map(|tool| {
        let whole = |name: &str| {
            tool[name]
                .as_u64()
                .and_then(|value| u32::try_from(value).ok())
                .unwrap_or_default()
        };
        Tool {
            number: whole("tool"),
            pocket: whole("pocket"),
            length_mm: number(&tool["length"]) * unit_mm,
            diameter_mm: number(&tool["diameter"]) * unit_mm,
            remark: tool["remark"].as_str().unwrap_or_default().to_owned(),
        }
    });
    tools.collect()
}

/// The state of the control in the words of MTConnect; `before`: as it was a moment ago.
fn facts(state: &Value, before: &Map<String, Value>, measured: &Measured) -> Facts {
    let text = |name: &str| state[name].as_str().unwrap_or_default();
    let power = text("power");
    let axes = list(&state["axes"]);
    let positions = numbers(&state["position_mm"]);
    let were = before.get("position_mm").map(numbers).unwrap_or_default();
    let homing = text("activity") == "homing";
    let axes_now = axes.iter().map(|axis| {
        let place = axis["axis"]
            .as_str()
            .and_then(|letter| "XYZABCUVW".find(letter))
            .unwrap_or_default();
        let position = positions.get(place).copied().unwrap_or_default();
        let moves = were.get(place).is_some_and(|was| *was != position);
        let motion = match (homing, moves) {
            (true, _) => Motion::Home,
            (false, true) => Motion::Travel,
            (false, false) => Motion::Stopped,
        };
        // An axis that is one joint alone has its pins: those of another one say nothing of it.
        let pins = match list(&axis["joints"]) {
            [joint] => joint.as_u64().map(pins_of),
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
    let mode = match text("mode") {
        "auto" if state["single_block"] == true => Mode::SemiAutomatic,
        "auto" => Mode::Automatic,
        "mdi" => Mode::Mdi,
        _ => Mode::Manual,
    };
    let program = &state["program"];
    let spindle = &state["spindle"];
    let percent = |name: &str| number(&state["override"][name]);
    Facts {
        is_emergency_stop: power.starts_with("estop"),
        is_powered: power == "on",
        mode,
        execution: execution(state),
        single_block: state["single_block"] == true,
        optional_stop: state["optional_stop"] == true,
        dry_run: program["dry_run"] == true,
        program: program["name"].as_str().map(str::to_owned),
        line: state["line"].as_u64().and_then(|line| u32::try_from(line).ok()),
        tool: state["tool"]
            .as_u64()
            .and_then(|tool| u32::try_from(tool).ok())
            .unwrap_or_default(),
        work_system: work_system(&state["codes"]),
        parts: state["parts"]["count"].as_u64().unwrap_or_default(),
        parts_wanted: state["parts"]["target"].as_u64(),
        feed_override: percent("feed_percent"),
        rapid_override: percent("rapid_percent"),
        feed_mm_s: number(&state["velocity_mm_s"]),
        place_mm: work_place(state),
        program_s: state["elapsed_s"].as_f64(),
        axes: axes_now.collect(),
        spindle: (!spindle.is_null()).then(|| Spindle {
            speed_rpm: if spindle["on"] == true {
                number(&spindle["speed_rpm"])
            } else {
                0.0
            },
            actual_rpm: measured.get(SPINDLE).map(|turns_s| turns_s * 60.0),
            speed_override: percent("spindle_percent"),
        }),
        alarms: alarm(state, axes).into_iter().collect(),
        message: message(&state["messages"]),
    }
}

fn execution(state: &Value) -> Execution {
    let text = |name: &str| state[name].as_str().unwrap_or_default();
    let single_block = state["single_block"] == true;
    match text("activity") {
        "held" if single_block => Execution::Interrupted,
        "held" => Execution::FeedHold,
        "away" | "returning" => Execution::Interrupted,
        "stopping" => Execution::Stopped,
        "running" => match state["waiting"]["for"].as_str() {
            None => Execution::Active,
            // M1 counts where it stops at all; which of both it is the text of the program knows.
            Some("operator") => Execution::ProgramStopped,
            Some("tool-change") => Execution::Wait(WaitFor::ToolLoad),
            Some("feed") => Execution::FeedHold,
            Some("dwell" | "probe") => Execution::Active,
            Some(_) => Execution::Wait(WaitFor::Other),
        },
        _ if !state["alarm"].is_null() || text("power").starts_with("estop") => Execution::Stopped,
        "idle" if text("mode") == "auto" => match state["program"]["result"].as_str() {
            Some("completed") => Execution::Completed,
            Some(_) => Execution::Stopped,
            None => Execution::Ready,
        },
        _ => Execution::Ready,
    }
}

/// What stands, with its entry in the journal.
fn alarm(state: &Value, axes: &[Value]) -> Option<Alarm> {
    let text = state["alarm"].as_str()?.to_owned();
    let entries = list(&state["messages"]).iter().rev();
    let record = entries
        .map(|entry| &entry["alarm"])
        .find(|record| record["severity"].as_str().is_some_and(|word| word != "warning"));
    let code = record
        .and_then(|record| record["code"].as_str())
        .unwrap_or("alarm")
        .to_owned();
    let axis = record.and_then(|record| record["joint"].as_u64()).and_then(|joint| {
        axes.iter()
            .position(|axis| list(&axis["joints"]).iter().any(|of| of.as_u64() == Some(joint)))
    });
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

fn message(entries: &Value) -> Option<String> {
    let texts = list(entries).iter().rev().filter_map(|entry| entry["text"].as_str());
    texts
        .filter_map(|text| text.strip_prefix("message: "))
        .next()
        .map(str::to_owned)
}

/// 1 for G54 to 9 for G59.3.
fn work_system(codes: &Value) -> Option<u8> {
    let systems = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
    let found = list(codes)
        .iter()
        .filter_map(Value::as_str)
        .find_map(|code| systems.iter().position(|known| *known == code));
    found.map(|at| at as u8 + 1)
}

/// X, Y and Z as the work has them.
fn work_place(state: &Value) -> [f64; 3] {
    let (at, offset) = (numbers(&state["position_mm"]), numbers(&state["work_offset_mm"]));
    let one = |axis: usize| at.get(axis).copied().unwrap_or_default() - offset.get(axis).copied().unwrap_or_default();
    let (sin, cos) = number(&state["work_rotation_degrees"]).to_radians().sin_cos();
    let (x, y) = (one(0), one(1));
    [x * cos + y * sin, y * cos - x * sin, one(2)]
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

#[cfg(test)]
mod tests {
    use super::*;

    fn state(changed: &Value) -> Value {
        let mut state = json!({
            "power": "on", "activity": "running", "mode": "auto", "single_block": false, "alarm": null, "waiting": null,
            "program": { "name": "p.ngc", "result": null, "dry_run": false },
            "axes": [{ "axis": "X", "joints": [0], "unit": "mm" }, { "axis": "Z", "joints": [2], "unit": "mm" }],
            "position_mm": [10.0, 0.0, 5.0], "work_offset_mm": [1.0, 0.0, 2.0], "work_rotation_degrees": 0.0,
            "codes": ["G0", "G55"], "messages": [],
        });
        for (name, value) in changed.as_object().unwrap() {
            state[name] = value.clone();
        }
        state
    }

    fn told(changed: Value) -> Facts {
        facts(&state(&changed), &Map::new(), &Measured::new())
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
        let waiting = |what: &str| json!({ "waiting": { "for": what } });
        assert_eq!(execution(waiting("operator")), Execution::ProgramStopped);
        assert_eq!(execution(waiting("tool-change")), Execution::Wait(WaitFor::ToolLoad));
        assert_eq!(execution(waiting("input")), Execution::Wait(WaitFor::Other));
        assert_eq!(execution(waiting("feed")), Execution::FeedHold);
        assert_eq!(execution(waiting("dwell")), Execution::Active);
        let idle = |result: Value| json!({ "activity": "idle", "program": { "result": result } });
        assert_eq!(execution(idle(json!("completed"))), Execution::Completed);
        assert_eq!(execution(idle(json!("stopped"))), Execution::Stopped);
        assert_eq!(execution(idle(Value::Null)), Execution::Ready);
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
        let facts = super::facts(&state(&spindle), &Map::new(), &measured);
        assert_eq!(facts.axes[0].actual, None);
        assert_eq!(
            (facts.axes[1].actual, facts.axes[1].load_percent),
            (Some(4.99), Some(-12.5))
        );
        assert_eq!(facts.spindle.and_then(|spindle| spindle.actual_rpm), Some(-300.0));
        let turned = told(json!({ "work_rotation_degrees": 90.0 })).place_mm;
        assert!(turned[0].abs() < 1e-9 && (turned[1] + 9.0).abs() < 1e-9, "{turned:?}");
        let mut before = Map::new();
        before.insert("position_mm".into(), json!([9.0, 0.0, 5.0]));
        let moved = super::facts(&state(&json!({})), &before, &Measured::new());
        assert_eq!(
            [moved.axes[0].motion, moved.axes[1].motion],
            [Motion::Travel, Motion::Stopped]
        );
    }

    #[test]
    fn alarms_are_of_the_axis_whose_joint_they_name() {
        let of = |code: &str, joint: Value| {
            let record = json!({ "code": code, "severity": "stop", "joint": joint });
            told(
                json!({ "alarm": "x", "messages": [{ "text": "alarm: x", "alarm": record }, { "text": "message: look" }] }),
            )
        };
        assert_eq!(of("J-201", json!(2)).alarms[0].subject, Subject::Drive(1));
        assert_eq!(of("J-203", json!(0)).alarms[0].subject, Subject::Travel(0));
        assert_eq!(of("N-101", Value::Null).alarms[0].subject, Subject::Communications);
        assert_eq!(of("P-601", Value::Null).alarms[0].code, "P-601");
        assert_eq!(of("S-301", Value::Null).message.as_deref(), Some("look"));
        assert_eq!(told(json!({})).alarms, []);
    }

    #[test]
    fn the_name_of_a_machine_gives_the_same_uuid_each_time() {
        assert_eq!(uuid("mill"), uuid("mill"));
        assert_ne!(uuid("mill"), uuid("lathe"));
        assert_eq!(uuid("mill").len(), 36);
    }
}
