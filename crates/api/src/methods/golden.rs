//! What the socket answers, to the octet: a change of it shows in `golden.txt`.
//!
//! `GOLDEN=write cargo test -p isocnc-api golden` writes that.

use super::*;
use crate::orders::{self, MESSAGES, OrderInbox, Shown, ShownProgram, ShownText};
use crate::rpc::to_hex;
use crate::server::subscription::State as Told;
use ::machine::journal::{Acknowledged, AlarmRecord, Entry, Kind, ProgramRecord};
use ::machine::state_file::{LastProgram, Parts};
use bus::service::{Diagnose, Mailbox, MailboxFull, MailboxReply, NetworkLive, NodeLive};
use hal_pins::scope::Sampler;
use hal_pins::{Hal, Output};
use program::text::Text as ProgramText;
use protocol::{
    Activity, LastResult, Message, Mode, Next, Outcome, Power, Reaction, Severity, Step, Waiting, WaitingFor, message,
};
use serde_json::json;
use std::fmt::Write;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

const DEMO: &str = include_str!("../../../../configs/mill3-demo.toml");

/// The clock of the bus, ns.
static NOW_NS: AtomicU64 = AtomicU64::new(5_000_000_000);

/// A bus that answers each request at once.
#[derive(Default)]
struct Bus(Vec<MailboxReply>);

impl Mailbox for Bus {
    fn request(&mut self, request: MailboxRequest) -> Result<(), MailboxFull> {
        let result = match request.value {
            None => Ok(vec![0x01, 0xAB]),
            Some(_) => Ok(Vec::new()),
        };
        self.0.push(MailboxReply {
            ticket: request.ticket,
            result,
        });
        Ok(())
    }

    fn reply(&mut self) -> Option<MailboxReply> {
        self.0.pop()
    }
}

impl Diagnose for Bus {
    fn network(&mut self, _now_ns: u64) -> Option<NetworkLive> {
        Some(NetworkLive::default())
    }

    fn node(&mut self, _node: bus::NodeIndex, _now_ns: u64) -> Option<NodeLive> {
        None
    }
}

fn sum(text: &str) -> String {
    to_hex(&<sha2::Sha256 as sha2::Digest>::digest(text))
}

struct Rig {
    methods: Methods,
    inbox: OrderInbox,
    sampler: Sampler,
    count: Output<u32>,
    caller: Caller,
    told: String,
    /// What is not written down, and how it is called.
    hidden: Vec<(String, &'static str)>,
    _folder: tempfile::TempDir,
    _hal: Hal,
}

fn rig() -> Rig {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.toml");
    std::fs::write(&path, DEMO).unwrap();
    let text = json!(DEMO).to_string();
    let config = config::read(&path).unwrap();
    let mut hal = Hal::create_in(&[folder.path().to_owned()], &config.name, 64).unwrap();
    let count = hal.output::<u32>("a.count").unwrap();
    hal.output::<f64>("a.float").unwrap().set(f64::NAN);
    hal.input("a.on", true).unwrap();
    let (client, inbox) = orders::order_channel();
    let pins = |name: &str| match name {
        "spindle.0.speed-out" => Some(-1500.0),
        "spindle.0.on" | "iocontrol.0.coolant-mist" => Some(1.0),
        _ => None,
    };
    let methods = Methods::new(
        NetworkView::from_config(&config),
        Arc::new(RtStatus::default()),
        Box::new(Bus::default()),
        client,
        || NOW_NS.load(Relaxed),
    )
    .of_machine(&config, pins, || 1e9, &path)
    .with_programs(Some(folder.path().to_owned()));
    Rig {
        methods,
        inbox,
        sampler: Sampler::new(&hal, 1_000_000).unwrap(),
        count,
        caller: Caller {
            client: 1,
            process: 0,
            role: Role::SetUp,
            name: None,
            subscription: None,
        },
        told: String::new(),
        hidden: vec![
            (folder.path().display().to_string(), "FOLDER"),
            (format!("\"pid\":{},", std::process::id()), "\"pid\":PID,"),
            (text.trim_matches('"').to_owned(), "FILE"),
            (sum(DEMO), "SUM"),
            (sum(&format!("{DEMO}\n# changed\n")), "CHANGED"),
        ],
        _folder: folder,
        _hal: hal,
    }
}

impl Rig {
    fn line(&mut self, what: &str, line: &str) {
        let hide = |text: &str| {
            let hidden = self.hidden.iter();
            hidden.fold(text.to_owned(), |text, (what, name)| text.replace(what, name))
        };
        let (what, line) = (hide(what), hide(line));
        writeln!(self.told, "{what}\n  {}", line.trim_end()).unwrap();
    }

    /// Asks, and writes down what comes of it; of an order, what the operator is to do.
    fn ask(&mut self, method: &str, params: Value) -> Option<Value> {
        let what = format!("{method} {params}");
        let line = json!({ "jsonrpc": "2.0", "id": 1, "method": method, "params": params }).to_string();
        let request = rpc::parse(line.as_bytes()).unwrap();
        let mut answer = self.methods.call(&mut self.caller, &request, 7);
        answer = answer.or_else(|| self.methods.later().map(|(_, answer)| answer));
        if answer.is_none()
            && let Some((_, order)) = self.inbox.take()
        {
            let order = format!("{order:?}");
            // What belongs to this process only.
            let order = order.split(", to: ").next().unwrap_or_default().to_owned();
            self.line(&what, &order);
            return None;
        }
        let give_up = std::time::Instant::now() + std::time::Duration::from_secs(60);
        while answer.is_none() && std::time::Instant::now() < give_up {
            answer = self.methods.later().map(|(_, answer)| answer);
        }
        let answer = answer.unwrap_or_else(|| panic!("{method}: no answer"));
        self.line(&what, &rpc::answer(&json!(1), answer.clone()));
        answer.ok()
    }

    /// Something goes on, and shows.
    fn show(&mut self) {
        let entry = |seq, kind, text: &str| Entry {
            seq,
            unix_s: 1e9 + 0.25,
            time_s: 3.5,
            kind,
            ..Entry::new(text.into())
        };
        let how = Acknowledged {
            unix_s: 1e9 + 1.0,
            by: "alarm acknowledge".into(),
        };
        let mut messages = vec![
            entry(1, Kind::Note, "the control begins"),
            Entry {
                alarm: Some(AlarmRecord {
                    code: "J-203".into(),
                    severity: Severity::Stop,
                    reaction: Reaction::ControlledStop,
                    first_cause: 2,
                    joint: Some(1),
                    node: Some("y-drive".into()),
                    program: Some("part.ngc".into()),
                    line: Some(7),
                    state: State::Running,
                    acknowledged: Some(how.clone()),
                }),
                ..entry(2, Kind::Alarm, "alarm: joint 1")
            },
            Entry {
                program: Some(ProgramRecord {
                    name: "part.ngc".into(),
                    begun_unix_s: 1e9,
                    result: Some(Outcome::Faulted),
                    took_s: Some(12.0),
                    line: Some(7),
                    deviation_max_mm: None,
                    report: Some(3),
                }),
                ..entry(3, Kind::Warning, "program part.ngc faulted")
            },
            Entry {
                acknowledges: Some((vec![2], how)),
                ..entry(4, Kind::Note, "acknowledged")
            },
        ];
        messages.truncate(MESSAGES);
        self.inbox.show(Shown {
            step: Step::Program,
            power: Power::On,
            activity: Activity::Running,
            mode: Mode::Auto,
            program: Some(ShownProgram {
                name: "part.ngc".into(),
                revision: 5,
                lines: 90,
                planned_time_s: 61.5,
                tools: vec![7, 2],
                dry_run: true,
                outline: None,
                result: Some(Outcome::Stopped),
            }),
            text: Some(ShownText {
                revision: 5,
                text: Arc::new(ProgramText::from("G21\nG0 X1\n(last)\nM2\n".as_bytes().to_vec())),
            }),
            job: Some(Outcome::Completed),
            mdi: vec!["G0 X1".into(), "G0 X2".into()],
            waiting: Some(Waiting {
                r#for: WaitingFor::ToolChange,
                what: Message::new("waiting.tool_in", "put in tool 7", [("tool", 7.into())]),
                release: "isocnc tool-changed".into(),
            }),
            codes: vec!["G0".into(), "G54".into()],
            work_offset: vec![1.0, -2.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            work_rotation_degrees: 0.5,
            next: Some(Next::Home),
            block_delete: true,
            tool: 7,
            alarm: Some(message!("node.lost", "{node} lost", node = "x-drive")),
            obstruction: Some("jog ended".into()),
            alarms: messages
                .iter()
                .filter(|entry| entry.kind == Kind::Alarm)
                .cloned()
                .collect(),
            messages,
            parts: Parts {
                count: 3,
                target: Some(10),
            },
            runs_left: 2,
            last_program: Some(LastProgram {
                name: "part.ngc".into(),
                line: 7,
                result: Some(LastResult::Interrupted),
            }),
        });
    }
}

#[test]
fn answers_are_the_same_to_the_octet() {
    let mut rig = rig();
    let none = || json!({});
    rig.ask("methods", none());
    rig.ask(
        "client.identify",
        json!({ "name": "test", "version": "1", "kind": "x", "token": "y" }),
    );
    rig.ask("status", none());
    rig.show();
    rig.ask("status", none());
    rig.ask("subscribe", json!({ "rate_hz": 5 }));
    let state: Told = rig.methods.state();
    let subscription = rig.caller.subscription.as_mut().unwrap();
    assert_eq!(subscription.notification(&state), None);
    NOW_NS.fetch_add(1_000_000_000, Relaxed);
    rig.methods.live.overrides.order(Overridden::Feed, 50.0).unwrap();
    let state: Told = rig.methods.state();
    let told = rig.caller.subscription.as_mut().unwrap().notification(&state).unwrap();
    rig.line("state", &told);
    rig.ask("unsubscribe", none());
    rig.ask("control.take", json!({ "name": "test", "force": true }));
    rig.ask("status", none());
    rig.ask("control.release", none());
    rig.ask("ping", none());
    rig.ask("machine.describe", none());
    rig.ask("bus.network", none());
    rig.ask("bus.sdo_read", json!({ "node": 1, "index": 0x1018, "sub": 1 }));
    rig.ask(
        "bus.sdo_write",
        json!({ "node": 1, "index": 0x6065, "sub": 0, "value": "10270000" }),
    );
    for kind in ["overcurrent", "none"] {
        rig.ask("sim.fault", json!({ "node": 1, "kind": kind, "axis": 0 }));
        // A note for the journal.
        assert!(rig.inbox.take().is_some());
    }
    orders(&mut rig);
    rig.ask("override", json!({ "feed": 80, "rapid": 25.5, "spindle": 110 }));
    // For the journal, as behind the others.
    assert!(matches!(rig.inbox.take(), Some((0, Order::Turned))));
    upload(&mut rig);
    rig.ask("program.text", json!({ "from_line": 2, "lines": 2 }));
    rig.ask("program.text", none());
    path(&mut rig);
    rig.ask("hal.list", none());
    rig.ask("hal.list", json!({ "pattern": "a.c*", "from": 0 }));
    rig.ask("hal.values", json!({ "pins": ["a.count", "a.on", "a.float"] }));
    rig.ask("hal.set", json!({ "pin": "a.on", "value": "false" }));
    assert!(rig.inbox.take().is_some());
    scope(&mut rig);
    rig.ask("logic.list", none());
    rig.ask("machine.file", none());
    rig.ask("machine.check", json!({ "text": "cycle_ms = 1\n" }));
    rig.show_idle();
    let changed = format!("{DEMO}\n# changed\n");
    rig.ask("machine.write", json!({ "text": changed, "sha256": sum(DEMO) }));
    assert!(rig.inbox.take().is_some());
    rig.ask(
        "machine.write",
        json!({ "text": "cycle_ms = 1\n", "sha256": sum(DEMO) }),
    );
    rig.ask("cycle.times", none());
    refusals(&mut rig);

    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/src/methods/golden.txt");
    if std::env::var_os("GOLDEN").is_some_and(|value| value == "write") {
        std::fs::write(file, &rig.told).unwrap();
    }
    let golden = std::fs::read_to_string(file).unwrap();
    for (golden, told) in golden.lines().zip(rig.told.lines()) {
        assert_eq!(told, golden);
    }
    assert_eq!(rig.told.lines().count(), golden.lines().count());
}

impl Rig {
    fn show_idle(&mut self) {
        self.inbox.show(Shown {
            activity: Activity::Idle,
            power: Power::Off,
            ..Shown::default()
        });
    }
}

/// Orders to the machine: those without parameters, then one of each form.
fn orders(rig: &mut Rig) {
    for order in [
        "on",
        "off",
        "estop",
        "estop.reset",
        "hold",
        "resume",
        "skip",
        "stop",
        "tool.changed",
        "alarm.acknowledge",
    ] {
        rig.ask(order, json!({}));
    }
    for order in [
        "mdi.history",
        "offset.list",
        "tool.list",
        "journal.since",
        "program.report",
        "home",
        "program.start",
        "reverse",
        "jog.keep",
        "jog.stop",
    ] {
        rig.ask(order, json!({}));
    }
    for (method, params) in [
        ("home", json!({ "joints": [0, 2] })),
        ("program.load", json!({ "name": "a", "text": "M2\n" })),
        ("program.load", json!({ "file": "demo.toml" })),
        ("program.check", json!({ "path": "/p.ngc" })),
        ("program.run", json!({ "text": "M2\n" })),
        (
            "program.start",
            json!({ "from_line": 7, "yes": true, "dry_run_feed_mm_min": 500, "revision": 5 }),
        ),
        ("program.start", json!({ "repeat": 3 })),
        ("program.report", json!({ "number": 3 })),
        ("mdi", json!({ "line": "G0 X1" })),
        ("mdi.stream", json!({ "text": "G0 X1\n", "wait": true })),
        ("touch_off", json!({ "axis": "X", "value": 1.5 })),
        ("touch_off", json!({ "axis": "z", "value": 1, "tool": 7 })),
        ("touch_off", json!({ "axis": "Z", "value": 1, "system": "g59.3" })),
        ("offset.set", json!({ "axis": "X", "value": 0, "system": "G55" })),
        ("offset.set", json!({ "rotation_degrees": 30 })),
        ("tool.set", json!({ "tool": 5, "length": 12.3 })),
        ("tool.set", json!({ "tool": 5, "diameter": 6 })),
        ("jog", json!({ "axis": "X", "velocity_mm_s": -10 })),
        ("jog", json!({ "joint": 1, "velocity_mm_s": 10, "distance_mm": -0.5 })),
        ("jog.keep", json!({ "axis": "X" })),
        ("jog.stop", json!({ "joint": 2 })),
        ("reverse", json!({ "percent": 25 })),
        ("single_block", json!({ "on": true })),
        ("optional_stop", json!({ "on": false })),
        ("block_delete", json!({ "on": true })),
        ("journal.since", json!({ "seq": 12 })),
        ("parts.set", json!({ "count": 3, "target": 0 })),
    ] {
        rig.ask(method, params);
    }
}

fn upload(rig: &mut Rig) {
    let begun = rig
        .ask("program.upload.begin", json!({ "name": "part.ngc", "octets": 3 }))
        .unwrap();
    let upload = &begun["upload"];
    rig.ask(
        "program.upload.append",
        json!({ "upload": upload, "at": 0, "value": "6162" }),
    );
    rig.ask(
        "program.upload.append",
        json!({ "upload": upload, "at": 2, "value": "63" }),
    );
    let sha256 = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    rig.ask("program.upload.commit", json!({ "upload": upload, "sha256": sha256 }));
}

fn path(rig: &mut Rig) {
    let line = json!({ "jsonrpc": "2.0", "id": 1, "method": "program.path.begin", "params": { "tolerance_mm": 0.5 } });
    let request = rpc::parse(line.to_string().as_bytes()).unwrap();
    assert!(rig.methods.call(&mut rig.caller, &request, 7).is_none());
    let Some((_, Order::Path(order))) = rig.inbox.take() else {
        panic!("no order for a path");
    };
    assert_eq!(order.tolerance_mm, 0.5);
    assert!(order.send(crate::paths::Part::Records(vec![1, 2, 3])));
    rig.ask("program.path.next", json!({ "path": order.number }));
    assert!(order.send(crate::paths::Part::End(Err("line 7: wrong".into()))));
    rig.ask("program.path.next", json!({ "path": order.number }));
    rig.ask("program.path.next", json!({ "path": order.number }));
    rig.ask("program.path.end", json!({}));
}

fn scope(rig: &mut Rig) {
    let begun = rig.ask(
        "scope.begin",
        json!({
            "pins": ["a.count", "a.on"], "trigger": "a.count>3", "mode": "single", "seconds": 0.005, "before_percent": 20,
            "cycles_per_row": 2,
        }),
    );
    let scope = begun.unwrap()["scope"].clone();
    rig.ask("scope.next", json!({ "scope": scope }));
    for cycle in 0..20 {
        rig.count.set(cycle);
        rig.sampler.sample(u64::from(cycle) * 1_000_000);
    }
    rig.ask("scope.next", json!({ "scope": scope }));
    rig.ask("scope.begin", json!({ "pins": ["a.on"], "rate_hz": 10 }));
    rig.count.set(99);
    rig.sampler.sample(21_000_000);
    NOW_NS.fetch_add(1_000_000_000, Relaxed);
    let news = rig.methods.news(1).unwrap();
    rig.line("scope", &news);
    rig.ask("scope.end", json!({ "scope": 2 }));
}

/// Every parameter of every method, missing and of another type; and what is beyond its bounds.
fn refusals(rig: &mut Rig) {
    for method in METHODS.iter() {
        if method.at_once().is_some() {
            continue;
        }
        for wrong in [
            json!(true),
            json!("\u{7f}é"),
            json!(-1),
            json!(1.5),
            json!([]),
            json!([99]),
            json!({}),
            Value::Null,
        ] {
            for param in &method.params {
                rig.ask_if_refused(method.name, json!({ param.name: wrong }));
            }
        }
        rig.ask_if_refused(method.name, json!({ "nobody": 1 }));
        rig.ask_if_refused(method.name, json!({ "request_id": "" }));
        rig.ask_if_refused(method.name, json!({}));
    }
    for (method, params) in [
        ("subscribe", json!({ "rate_hz": 21 })),
        ("bus.sdo_read", json!({ "node": 240, "index": 0, "sub": 0 })),
        ("bus.sdo_read", json!({ "node": 1, "index": 65536, "sub": 0 })),
        ("bus.sdo_read", json!({ "node": 1, "index": 0, "sub": 256 })),
        (
            "bus.sdo_write",
            json!({ "node": 1, "index": 0, "sub": 0, "value": "0g" }),
        ),
        ("sim.fault", json!({ "node": 1, "kind": "flood" })),
        ("sim.fault", json!({ "node": 1, "kind": "none", "axis": 8 })),
        ("sim.fault", json!({ "node": 1, "kind": "none", "for_s": 1 })),
        ("sim.fault", json!({ "node": 1, "kind": "sto", "for_s": 0 })),
        ("home", json!({ "joints": [0, 16] })),
        (
            "program.upload.begin",
            json!({ "name": "x", "octets": 1_073_741_825_u64 }),
        ),
        ("program.upload.begin", json!({ "name": "", "octets": 1 })),
        (
            "program.upload.append",
            json!({ "upload": 4_294_967_296_u64, "at": 0, "value": "" }),
        ),
        ("program.load", json!({ "file": "a", "text": "M2" })),
        ("program.load", json!({ "file": "../a" })),
        ("program.load", json!({ "upload": 1, "text": "M2" })),
        ("program.load", json!({ "path": "/a", "text": "M2" })),
        ("program.load", json!({ "path": "a" })),
        ("program.load", json!({ "name": "a" })),
        ("program.start", json!({ "from_line": 0 })),
        ("program.start", json!({ "from_line": 1, "repeat": 2 })),
        ("program.start", json!({ "dry_run_feed_mm_min": 0 })),
        ("program.text", json!({ "lines": 501 })),
        ("program.path.begin", json!({ "tolerance_mm": 0 })),
        ("hal.list", json!({ "pattern": "[" })),
        ("scope.begin", json!({ "pins": ["a.on"], "mode": "x" })),
        ("scope.begin", json!({ "pins": ["a.on"], "rate_hz": 51 })),
        ("mdi", json!({ "line": " " })),
        ("mdi", json!({ "line": "a\nb" })),
        ("mdi", json!({ "line": "x".repeat(257) })),
        ("mdi.stream", json!({ "text": "G0" })),
        ("touch_off", json!({ "axis": "Q", "value": 1 })),
        ("touch_off", json!({ "axis": "X", "value": 1, "system": "G53" })),
        (
            "touch_off",
            json!({ "axis": "X", "value": 1, "system": "G54", "tool": 1 }),
        ),
        ("offset.set", json!({ "axis": "X" })),
        ("offset.set", json!({ "value": 1 })),
        ("offset.set", json!({ "axis": "X", "rotation_degrees": 1 })),
        ("tool.set", json!({ "tool": 1 })),
        ("jog", json!({ "velocity_mm_s": 1 })),
        ("jog", json!({ "axis": "X", "joint": 1, "velocity_mm_s": 1 })),
        ("jog", json!({ "joint": 16, "velocity_mm_s": 1 })),
        ("jog", json!({ "axis": "X", "velocity_mm_s": 0 })),
        ("reverse", json!({ "percent": 0 })),
        ("override", json!({ "feed": 121 })),
        ("override", json!({})),
        ("parts.set", json!({})),
        ("logic.look", json!({})),
        ("control.take", json!({ "name": "" })),
        ("machine.write", json!({ "text": "x", "sha256": "00" })),
        ("hal.set", json!({ "pin": "a.on", "value": "maybe" })),
        ("hal.values", json!({ "pins": [] })),
    ] {
        rig.ask_if_refused(method, params);
    }
}

impl Rig {
    fn ask_if_refused(&mut self, method: &str, params: Value) {
        let what = format!("{method} {params}");
        let line = json!({ "jsonrpc": "2.0", "id": 1, "method": method, "params": params }).to_string();
        let request = rpc::parse(line.as_bytes()).unwrap();
        let answer = self.methods.call(&mut self.caller, &request, 8);
        if let Some(Err(error)) = answer {
            self.line(&what, &rpc::answer(&json!(1), Err(error)));
        }
        while self.inbox.take().is_some() {}
        while let Some((_, answer)) = self.methods.later() {
            drop(answer);
        }
    }
}
