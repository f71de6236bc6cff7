//! The control socket of a control as a process: subscribers, who has control, programs that come in parts, what its document says.

use crate::common;

use common::{Control, PATIENCE};
use isocnc::api::client::{self, Client, ClientError};
use isocnc::api::methods::table::METHODS;
use isocnc::api::openrpc;
use isocnc::api::rpc::code;
use isocnc::protocol::schema::Param;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Instant;

fn up(name: &str) -> Control {
    let control = Control::start(name, Stdio::null());
    control.wait_for("the network", |status| {
        status["power"] == "off" && status["step"] == "standing_by"
    });
    control
}

fn client(control: &Control) -> Client {
    client::connect(Some(&control.machine)).unwrap()
}

fn raw(control: &Control) -> UnixStream {
    let name = format!("isocnc-control.{}", control.machine);
    let places = hal_pins::directories().into_iter().map(|folder| folder.join(&name));
    let path: PathBuf = places.into_iter().find(|path| path.exists()).expect("a socket");
    let stream = UnixStream::connect(path).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream.set_write_timeout(Some(PATIENCE)).unwrap();
    stream
}

fn refusal<A: std::fmt::Debug>(answer: Result<A, ClientError>) -> (i32, String) {
    match answer {
        Err(ClientError::Refused(error)) => (error.code, error.message.text),
        other => panic!("{other:?}"),
    }
}

/// Reads until what was told of a state is as wanted.
fn listen(client: &mut Client, mine: &mut Value, mut wanted: impl FnMut(&Value) -> bool) {
    let give_up = Instant::now() + PATIENCE;
    while !wanted(mine) {
        assert!(Instant::now() < give_up, "never: {mine}");
        let told = client.notification().unwrap();
        assert_eq!(told.method, "state");
        for (name, value) in told.params["changed"].as_object().unwrap() {
            assert_ne!(&mine[name], value, "{name} was told before");
            mine[name] = value.clone();
        }
    }
}

#[test]
fn a_subscriber_follows_the_machine_without_asking() {
    let control = up("subscribed");
    let mut watcher = client(&control);
    let answer = watcher.call("subscribe", json!({})).unwrap();
    let mut mine = answer["state"].clone();
    assert_eq!(mine["power"], "off");
    let mut hand = client(&control);
    hand.call("on", json!({})).unwrap();
    listen(&mut watcher, &mut mine, |mine| {
        mine["power"] == "on" && mine["job"] == "completed"
    });
    hand.call("home", json!({})).unwrap();
    listen(&mut watcher, &mut mine, |mine| {
        mine["homed"] == json!([0, 1, 2]) && mine["job"] == "completed"
    });
    hand.call("mdi", json!({ "line": "G53 G0 X7.5" })).unwrap();
    listen(&mut watcher, &mut mine, |mine| {
        (mine["position_mm"][0].as_f64().unwrap() - 7.5).abs() < 1e-6 && mine["job"] == "completed"
    });
    // The journal tells of it, too.
    let told = mine["messages"].as_array().unwrap();
    assert!(told.iter().any(|entry| entry["text"] == "MDI: G53 G0 X7.5"), "{told:?}");
    hand.call("estop", json!({})).unwrap();
    listen(&mut watcher, &mut mine, |mine| {
        mine["state"] == "estop" && mine["power"] == "estop"
    });
    // What was told, put together, is what is.
    listen(&mut watcher, &mut mine, |mine| {
        let is = hand.call("status", json!({})).unwrap();
        let moving = ["cycles", "late_max_us", "cycles_skipped", "messages", "control"];
        let fields = is.as_object().unwrap().iter();
        fields
            .filter(|(name, _)| !moving.contains(&name.as_str()))
            .all(|(name, value)| mine[name] == *value)
    });
    watcher.call("unsubscribe", json!({})).unwrap();
    assert_eq!(
        refusal(watcher.call("subscribe", json!({ "rate_hz": 21 }))).0,
        code::INVALID_PARAMS
    );
}

#[test]
fn one_client_has_control_and_the_others_watch() {
    let control = up("controlled");
    let (mut one, mut two) = (client(&control), client(&control));
    // Nobody has taken it: each order is that of whoever gives it.
    one.call("on", json!({})).unwrap();
    control.wait_for("on", |status| status["power"] == "on");
    two.call("off", json!({})).unwrap();
    control.wait_for("off", |status| status["power"] == "off" && status["job"] == "completed");
    let taken = one.call("control.take", json!({ "name": "the panel" })).unwrap();
    assert_eq!(
        (&taken["name"], &taken["process"]),
        (&json!("the panel"), &json!(std::process::id()))
    );
    let (number, why) = refusal(two.call("on", json!({})));
    assert_eq!(number, code::NO_CONTROL);
    let expected = format!("the panel (process {}) has had control for", std::process::id());
    assert!(why.starts_with(&expected), "{why}");
    // What stops is for everyone; that there is nothing to stop is another matter.
    two.call("estop", json!({})).unwrap();
    for always in ["stop", "hold"] {
        assert_eq!(refusal(two.call(always, json!({}))).0, code::REFUSED);
    }
    one.call("estop.reset", json!({})).unwrap();
    let (exit, said) = control.words(&["on"]);
    assert!(
        exit == Some(1) && said.contains("the panel") && said.contains("--take-over"),
        "{said}"
    );
    assert!(control.words(&["status"]).1.contains("\ncontrol   the panel (process "));
    // By force, which the journal tells.
    control.wait_for("reset", |status| status["power"] == "off");
    let (exit, said) = control.words(&["on", "--take-over"]);
    assert_eq!((exit, said.lines().last()), (Some(0), Some("drives are on")));
    let entries = two.call("journal.since", json!({})).unwrap();
    let entries = entries["entries"].as_array().unwrap();
    let note = |entry: &&Value| entry["text"].as_str().unwrap().starts_with("control: isocnc (process ");
    assert_eq!(entries.iter().filter(note).count(), 1, "{entries:?}");
    // Whoever has it goes: it is free at once.
    drop(one);
    let mut three = client(&control);
    three.call("control.take", json!({})).unwrap();
    assert_eq!(refusal(two.call("off", json!({}))).0, code::NO_CONTROL);
    drop(three);
    control.wait_for("free", |status| status["control"].is_null());
    two.call("off", json!({})).unwrap();
}

/// Half a line, no line, rubbish, deep nesting, a subscriber that never reads, a thousand connections: whoever asks for something
/// in good order is answered, and a stop gets through.
#[test]
fn nobody_outside_keeps_a_stop_out() {
    let control = up("besieged");
    let mut deaf = raw(&control);
    deaf.write_all(b"{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"subscribe\"}\n")
        .unwrap();
    let mut half = raw(&control);
    half.write_all(b"{\"jsonrpc\":\"2.0\",\"id\":1,").unwrap();
    let mut bomb = raw(&control);
    // What has "stop" in it is parsed by the socket thread, too.
    bomb.write_all(&[b"[".repeat(60_000), b"\"stop\"\n".to_vec()].concat())
        .unwrap();
    let mut line = String::new();
    BufReader::new(bomb.try_clone().unwrap()).read_line(&mut line).unwrap();
    assert!(line.contains("-32700"), "{line}");
    let mut wide = raw(&control);
    let members: Vec<String> = (0..4000).map(|k| format!("\"k{k}\":{k}")).collect();
    let request = format!(
        "{{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"status\",\"params\":{{{}}}}}\n",
        members.join(",")
    );
    wide.write_all(request.as_bytes()).unwrap();
    line.clear();
    BufReader::new(wide.try_clone().unwrap()).read_line(&mut line).unwrap();
    assert!(line.contains("-32602"), "{line}");
    let mut idle = Vec::new();
    for number in 0..1000 {
        idle.push(raw(&control));
        if number % 100 == 0 {
            client(&control).call("estop", json!({})).unwrap();
        }
    }
    let status = client(&control).call("status", json!({})).unwrap();
    assert_eq!(status["power"], "estop");
    let mut rest = Vec::new();
    idle[0].read_to_end(&mut rest).unwrap();
    assert!(String::from_utf8_lossy(&rest).contains("silent for the longest time"));
}

/// A parameter of this kind: as much as there may be, or what is none.
fn value_of(param: &Param, is_legal: bool) -> Value {
    if !is_legal {
        return json!("\u{7f}".repeat(1_000));
    }
    let schema = &param.schema;
    let bound = |name: &str| schema[name].as_u64();
    match schema["type"].as_str().unwrap() {
        "integer" => json!(bound("maximum").unwrap_or(u64::MAX).min(u64::from(u32::MAX))),
        "array" => match schema["items"]["maximum"].as_u64() {
            Some(most) => json!((0..=most).collect::<Vec<_>>()),
            None => json!(["motion.feed-hold"]),
        },
        "number" => schema.get("minimum").cloned().unwrap_or(json!(1e-6)),
        "boolean" => json!(true),
        // By names that nobody knows.
        "object" => json!(
            (0..50)
                .map(|number| (format!("n{number}"), json!(1e6)))
                .collect::<serde_json::Map<_, _>>()
        ),
        "string" => match (schema["enum"].as_array(), bound("maxLength")) {
            (Some(words), _) if param.name == "kind" => words[words.len() - 1].clone(),
            (Some(words), _) => words[0].clone(),
            (None, Some(most)) => json!("00".repeat((most as usize / 2).min(20_000))),
            (None, None) => json!(format!("(\"{}\")\n", "x".repeat(100)).repeat(400)),
        },
        other => panic!("{}: {other}", param.name),
    }
}

/// How long it takes is printed: with --nocapture.
#[test]
fn an_emergency_stop_acts_beside_every_method() {
    // Loops whose longest scan would take hours, and a file of the greatest length whose every line is wrong.
    let endless = "PROGRAM plc\nVAR a, b : DINT; END_VAR\nFOR a := 1 TO 40000 DO FOR b := 1 TO 40000 DO ; END_FOR; END_FOR;\nEND_PROGRAM\n";
    let wrong = format!(
        "PROGRAM plc\n{}END_PROGRAM\n",
        "nobody := knows * this;\n".repeat(2_000)
    );
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plc.st"), "PROGRAM plc\nEND_PROGRAM\n").unwrap();
    let control = Control::start_in(folder, "beside", Stdio::null(), |text| {
        format!("{text}\n[[logic]]\nfile = \"plc.st\"\nname = \"plc\"\nperiod_ms = 10\n")
    });
    control.wait_for("the network", |status| {
        status["power"] == "off" && status["step"] == "standing_by"
    });
    let mut hand = client(&control);
    let mut took = Vec::new();
    let mut beside = |method: &str, params: Value| {
        let mut busy = BufReader::new(raw(&control));
        let request = json!({ "jsonrpc": "2.0", "id": 1, "method": method, "params": params });
        busy.get_mut().write_all(format!("{request}\n").as_bytes()).unwrap();
        let begun = Instant::now();
        hand.call("estop", json!({})).unwrap();
        while hand.call("status", json!({})).unwrap()["power"] != "estop" {
            assert!(begun.elapsed() < PATIENCE, "never beside {method}");
        }
        took.push((begun.elapsed(), method.to_owned()));
        // It is answered all the same, some only once what it waits for is over.
        drop(busy);
        hand.call("control.take", json!({ "name": "hand", "force": true }))
            .unwrap();
        hand.call("estop.reset", json!({})).unwrap();
        while hand.call("status", json!({})).unwrap()["power"] == "estop" {
            assert!(begun.elapsed() < PATIENCE, "never reset beside {method}");
        }
    };
    for method in METHODS.iter().filter(|method| method.name != "estop") {
        for is_legal in [true, false] {
            let given = method.params.iter().filter(|param| param.required || is_legal);
            let params = given.map(|param| (param.name.to_owned(), value_of(param, is_legal)));
            beside(method.name, Value::Object(params.collect()));
        }
    }
    for source in [endless, &wrong] {
        std::fs::write(control.folder.path().join("plc.st"), source).unwrap();
        beside("logic.reload", json!({}));
    }
    let text = "G21 F1\n".to_owned() + &"G1 X1\nG1 X2\n".repeat(3_000);
    for method in ["program.check", "program.load", "program.run", "mdi.stream"] {
        beside(method, json!({ "name": "long", "text": text }));
    }
    took.sort();
    for (took, method) in took.iter().rev().take(10) {
        println!("{:8.2} ms  {method}", took.as_secs_f64() * 1e3);
    }
    println!("{:8.2} ms  median", took[took.len() / 2].0.as_secs_f64() * 1e3);
}

#[test]
fn what_the_control_answers_is_what_its_document_says() {
    let control = up("documented");
    let mut client = client(&control);
    let document = client.call("rpc.discover", json!({})).unwrap();
    assert_eq!(document, openrpc::document());
    let printed = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["schema", "--rpc"])
        .output()
        .unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&printed.stdout).unwrap(), document);
    client.call("on", json!({})).unwrap();
    control.wait_for("on", |status| status["power"] == "on" && status["job"] == "completed");
    client.call("home", json!({})).unwrap();
    control.wait_for("home", |status| {
        status["homed"] == json!([0, 1, 2]) && status["job"] == "completed"
    });
    let mut told = 0;
    for (name, params) in [
        ("methods", json!({})),
        ("rpc.discover", json!({})),
        ("status", json!({})),
        ("subscribe", json!({ "rate_hz": 1 })),
        ("unsubscribe", json!({})),
        ("control.take", json!({ "name": "test", "force": true })),
        ("status", json!({})),
        ("bus.network", json!({})),
        ("bus.sdo_read", json!({ "node": 1, "index": 0x1000, "sub": 0 })),
        ("touch_off", json!({ "axis": "X", "value": 1.5 })),
        ("offset.list", json!({})),
        ("offset.set", json!({ "axis": "X", "value": 0, "system": "G55" })),
        ("tool.set", json!({ "tool": 5, "length": 12.3 })),
        ("tool.list", json!({})),
        ("jog", json!({ "axis": "X", "velocity_mm_s": 10 })),
        ("jog.keep", json!({ "axis": "X" })),
        ("jog.stop", json!({})),
        ("override", json!({ "feed": 90 })),
        ("single_block", json!({ "on": false })),
        ("journal.since", json!({ "seq": 0 })),
        ("program.load", json!({ "name": "part", "text": "G21 G90 G0 X5\nM2\n" })),
        ("status", json!({})),
        ("control.release", json!({})),
        ("estop", json!({})),
    ] {
        let method = METHODS.iter().find(|method| method.name == name).unwrap();
        if name == "program.load" {
            control.wait_for("rest", |status| status["activity"] == "idle");
        }
        let answer = client
            .call(name, params)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        let schema = jsonschema::validator_for(&openrpc::result_schema(method)).unwrap();
        let wrong: Vec<String> = schema.iter_errors(&answer).map(|error| error.to_string()).collect();
        assert!(wrong.is_empty(), "{name}: {wrong:#?}\n{answer}");
        told += 1;
    }
    assert_eq!(told, 24);
}

/// A file that the control cannot read is sent to it, and standard input.
#[test]
fn programs_that_the_control_cannot_read_are_sent() {
    let control = up("uploaded");
    // More than one part.
    let program = format!(
        "G21 G90 G0 X5\n{}M2\n",
        "(a remark that makes it longer)\n".repeat(3000)
    );
    let mut client = client(&control);
    let upload = client
        .upload("part.ngc", program.as_bytes(), program.len() as u64)
        .unwrap();
    let loaded = client.call("program.load", json!({ "upload": upload })).unwrap();
    assert_eq!(
        (&loaded["program"], &loaded["lines"]),
        (&json!("part.ngc"), &json!(3002))
    );
    // Cut short on the way.
    let short = client.upload("part.ngc", &b"G21"[..], 4);
    assert!(refusal(short).1.contains("3 of 4 octets"));
    assert_eq!(
        refusal(client.call("program.load", json!({ "path": "/nowhere.ngc" }))).0,
        code::UNREADABLE
    );
    let mut load = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["program", "load", "-", "--machine", &control.machine])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    load.stdin.take().unwrap().write_all(b"G21 G90 G0 X6\nM2\n").unwrap();
    let said = load.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.starts_with("loaded: standard input, 2 lines"), "{said}");
}

/// One JSON value a line, for scripts.
#[test]
fn status_can_be_followed() {
    let control = up("followed");
    let mut follow = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["status", "--follow", "--machine", &control.machine])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(follow.stdout.take().unwrap()).lines();
    let mut next = || -> Value { serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap() };
    assert_eq!(next()["state"]["power"], "off");
    client(&control).call("estop", json!({})).unwrap();
    while next()["changed"]["state"] != "estop" {}
    follow.kill().unwrap();
    testing::end(&mut follow);
}
