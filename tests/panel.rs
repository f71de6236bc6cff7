//! The operator panel from outside: a control with a panel as a process of its own, and clients of HTTP and WebSockets at it.

use crate::common;

use common::WithPanel;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use testing::PATIENCE;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

const DASHBOARD: &str = include_str!("../docs/panel-grafana.json");

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");

/// A control in memory with a panel.
struct Control {
    of: WithPanel,
    address: SocketAddr,
}

impl Control {
    fn start(name: &str, panel: &str) -> Control {
        let tables = format!("[panel]\n{panel}\nprograms = \"programs\"\ntokens = \"tokens.json\"\n");
        let of = WithPanel::start(&format!("panel-{name}"), &tables, &["panel"]);
        Control {
            address: of.address("panel").parse().unwrap(),
            of,
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.of.folder.path().join(name)
    }

    fn token(&self, name: &str, role: &str) -> String {
        let output = Command::new(env!("CARGO_BIN_EXE_isocnc"))
            .args(["panel", "token"])
            .arg(self.path("machine.toml"))
            .args(["--name", name, "--role", role])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    /// An address of this PC by which a client of it reaches the panel.
    fn local(&self) -> SocketAddr {
        SocketAddr::new([127, 0, 0, 1].into(), self.address.port())
    }

    /// Answers with status, head and body.
    fn http(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> (u16, String, Vec<u8>) {
        http(self.local(), method, path, headers, body)
    }

    fn json(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> (u16, Value) {
        let (status, _, body) = self.http(method, path, headers, body);
        (status, serde_json::from_slice(&body).unwrap_or(Value::Null))
    }

    fn rpc(&self) -> Rpc {
        let mut request = format!("ws://{}/rpc", self.local()).into_client_request().unwrap();
        let origin = format!("http://{}", self.local());
        request.headers_mut().insert("Origin", origin.parse().unwrap());
        let stream = TcpStream::connect(self.local()).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = tungstenite::client(request, stream).unwrap();
        Rpc { socket, last: 0 }
    }
}

/// Answers with status, head and body.
fn http(at: SocketAddr, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> (u16, String, Vec<u8>) {
    let mut stream = TcpStream::connect(at).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let mut head = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\n");
    if !headers.iter().any(|(name, _)| *name == "Host") {
        head += &format!("Host: {at}\r\n");
    }
    for (name, value) in headers {
        head += &format!("{name}: {value}\r\n");
    }
    if !body.is_empty() && !headers.iter().any(|(name, _)| *name == "Content-Length") {
        head += &format!("Content-Length: {}\r\n", body.len());
    }
    stream.write_all(format!("{head}\r\n").as_bytes()).unwrap();
    // It may answer and close before it has all.
    let _ = stream.write_all(body);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    let end = answer
        .windows(4)
        .position(|octets| octets == b"\r\n\r\n")
        .expect("a head");
    let head = String::from_utf8(answer[..end].to_vec()).unwrap().to_ascii_lowercase();
    let status = head.split(' ').nth(1).unwrap().parse().unwrap();
    let mut body = answer[end + 4..].to_vec();
    if head.contains("transfer-encoding: chunked") {
        body = unchunked(&body);
    }
    (status, head, body)
}

fn unchunked(mut body: &[u8]) -> Vec<u8> {
    let mut whole = Vec::new();
    loop {
        let end = body.windows(2).position(|octets| octets == b"\r\n").expect("a length");
        let length = usize::from_str_radix(std::str::from_utf8(&body[..end]).unwrap(), 16).unwrap();
        if length == 0 {
            return whole;
        }
        whole.extend_from_slice(&body[end + 2..end + 2 + length]);
        body = &body[end + 4 + length..];
    }
}

struct Rpc {
    socket: WebSocket<TcpStream>,
    last: u64,
}

impl Rpc {
    fn call(&mut self, method: &str, params: Value) -> Result<Value, Value> {
        self.last += 1;
        let request = json!({ "jsonrpc": "2.0", "id": self.last, "method": method, "params": params });
        self.socket.send(Message::text(request.to_string())).unwrap();
        loop {
            let message = self.message();
            if message["id"] == self.last {
                return match message.get("error") {
                    Some(error) => Err(error.clone()),
                    None => Ok(message["result"].clone()),
                };
            }
        }
    }

    fn message(&mut self) -> Value {
        loop {
            if let Message::Text(text) = self.socket.read().unwrap() {
                return serde_json::from_str(&text).unwrap();
            }
        }
    }

    /// The code and the reason with which the other end closes.
    fn closed(&mut self) -> (u16, String) {
        loop {
            match self.socket.read() {
                Ok(Message::Close(Some(frame))) => return (frame.code.into(), frame.reason.to_string()),
                Ok(_) => {}
                Err(error) => panic!("closed without a reason: {error}"),
            }
        }
    }

    /// Waits until the state is as wanted.
    fn until(&mut self, wanted: impl Fn(&Value) -> bool) -> Value {
        let give_up = Instant::now() + PATIENCE;
        loop {
            let status = self.call("status", json!({})).unwrap();
            if wanted(&status) {
                return status;
            }
            assert!(Instant::now() < give_up, "never as wanted: {status}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

const LOOPBACK: &str = "address = \"127.0.0.1:0\"";

#[test]
fn pages_are_for_whoever_started_it_and_for_no_page_of_another_site() {
    let control = Control::start("pages", LOOPBACK);
    let (status, head, _) = control.http("GET", "/", &[], b"");
    assert_eq!(status, 200);
    for header in [
        "content-security-policy: default-src 'self'; object-src 'none'",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "cross-origin-opener-policy: same-origin",
        "cross-origin-resource-policy: same-origin",
    ] {
        assert!(head.contains(header), "{header} is not in {head}");
    }
    assert!(
        !head.contains("access-control") && !head.contains("set-cookie"),
        "{head}"
    );
    let error = |headers: &[(&str, &str)], path: &str| {
        let (status, told) = control.json("GET", path, headers, b"");
        (status, told["error"].as_str().unwrap_or_default().to_owned())
    };
    let (status, told) = error(&[("Host", "evil.example:8402")], "/");
    assert_eq!(status, 421);
    assert!(told.contains("no name of this PC"), "{told}");
    let upgrade = [
        ("Upgrade", "websocket"),
        ("Connection", "Upgrade"),
        ("Sec-WebSocket-Version", "13"),
        ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
        ("Origin", "http://evil.example"),
    ];
    let foreign = (403, "a page of another site must not ask this".to_owned());
    assert_eq!(error(&upgrade, "/rpc"), foreign);
    assert_eq!(error(&[("Origin", "null")], "/files/"), foreign);
    assert_eq!(error(&[("Sec-Fetch-Site", "cross-site")], "/files/"), foreign);
    // A link to the page itself leads there.
    assert_eq!(error(&[("Sec-Fetch-Site", "cross-site")], "/").0, 200);
    assert_eq!(error(&[], "/no-such-page").0, 404);
    assert_eq!(error(&[], "/../Cargo.toml").0, 404);
    assert_eq!(error(&[], "/%2e%2e/Cargo.toml").0, 404);
}

#[test]
fn an_order_with_an_id_is_carried_out_once_and_figures_are_told() {
    let control = Control::start("orders", LOOPBACK);
    let mut rpc = control.rpc();
    let me = rpc.call("client.identify", json!({ "name": "test" })).unwrap();
    assert_eq!(me["role"], "set-up");
    let order = json!({ "count": 5, "request_id": "one" });
    assert_eq!(rpc.call("parts.set", order.clone()), Ok(json!({})));
    rpc.call("parts.set", json!({ "count": 7, "request_id": "two" }))
        .unwrap();
    // Again, also after a new connection.
    assert_eq!(rpc.call("parts.set", order.clone()), Ok(json!({})));
    let mut again = control.rpc();
    assert_eq!(again.call("parts.set", order), Ok(json!({})));
    assert_eq!(again.call("status", json!({})).unwrap()["parts"]["count"], 7);
    let other = again
        .call("parts.set", json!({ "count": 6, "request_id": "one" }))
        .unwrap_err();
    assert_eq!(other["code"], -32602);
    // One message of several lines is one, and two messages in one frame are none.
    let text = "{\"jsonrpc\":\"2.0\",\n\"id\":99,\"method\":\"ping\"}";
    again.socket.send(Message::text(text)).unwrap();
    assert_eq!(again.message()["id"], 99);
    again.socket.send(Message::text("{}\n{}")).unwrap();
    assert_eq!(again.message()["error"]["code"], -32700);

    let (status, head, body) = control.http("GET", "/metrics", &[], b"");
    let text = String::from_utf8(body).unwrap();
    assert!(status == 200 && head.contains("text/plain; version=0.0.4"), "{head}");
    assert!(
        text.ends_with('\n') && text.contains("\nisocnc_parts_total{result=\"completed\"} 7\n"),
        "{text}"
    );
    assert!(text.contains("\nisocnc_api_clients 2\n"), "{text}");
    // What the dashboard draws is there.
    let known: BTreeSet<&str> = (text.lines())
        .filter_map(|line| line.strip_prefix("# TYPE ")?.split(' ').next())
        .collect();
    let words = DASHBOARD.split(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_');
    let wanted: BTreeSet<&str> = words
        .filter(|word| word.starts_with("isocnc_") || word.starts_with("process_"))
        .map(|word| word.trim_end_matches("_bucket"))
        .collect();
    assert!(wanted.len() > 10, "{wanted:?}");
    let missing: Vec<_> = wanted.difference(&known).collect();
    assert!(
        missing.is_empty(),
        "{missing:?} of docs/panel-grafana.json are not told"
    );
    let of = |name: &str| -> f64 {
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.unwrap_or_else(|| panic!("no {name} in {text}")).parse().unwrap()
    };
    assert!(of("isocnc_cycle_lateness_seconds_count") > 0.0 && of("process_resident_memory_bytes") > 1e6);
}

#[test]
fn the_machine_file_is_read_checked_and_changed_by_whoever_may() {
    let control = Control::start("machine-file", "address = \"0.0.0.0:0\"");
    let enter = |role: &str| {
        let token = control.token(role, role);
        let mut rpc = control.rpc();
        rpc.call("client.identify", json!({ "token": token })).unwrap();
        rpc
    };
    let (mut watcher, mut operator, mut owner) = (enter("watch"), enter("operate"), enter("set-up"));
    owner.until(|status| status["power"] == "off");
    assert_eq!(watcher.call("machine.file", json!({})).unwrap_err()["code"], -32006);
    let file = operator.call("machine.file", json!({})).unwrap();
    assert_eq!(file["errors"], json!([]));
    let text = file["text"].as_str().unwrap();
    assert_eq!(text, std::fs::read_to_string(control.path("machine.toml")).unwrap());
    let changed = text.replacen("cycle_us = ", "# another word\ncycle_us = ", 1);
    let change = json!({ "text": changed, "sha256": file["sha256"] });
    assert_eq!(
        operator.call("machine.write", change.clone()).unwrap_err()["code"],
        -32006
    );
    let wrong = text.replacen("cycle_us = ", "cycle_us = \"x\" #", 1);
    let errors = owner.call("machine.check", json!({ "text": wrong })).unwrap();
    let line = 1 + text.lines().position(|line| line.starts_with("cycle_us")).unwrap();
    assert_eq!(errors["errors"][0]["line"], line);
    let refused = owner
        .call("machine.write", json!({ "text": wrong, "sha256": file["sha256"] }))
        .unwrap_err();
    assert!(
        refused["message"]
            .as_str()
            .unwrap()
            .contains(&format!("machine.toml:{line}")),
        "{refused}"
    );

    // Not while something moves.
    owner.call("home", json!({})).unwrap();
    owner.until(|status| status["state"] == "homing");
    let refused = owner.call("machine.write", change.clone()).unwrap_err();
    assert!(refused["message"].as_str().unwrap().contains("must rest"), "{refused}");
    owner.until(|status| status["job"] == "completed");
    let written = owner.call("machine.write", change.clone()).unwrap();
    assert_eq!(std::fs::read_to_string(control.path("machine.toml")).unwrap(), changed);
    assert_eq!(
        std::fs::read_to_string(written["before"].as_str().unwrap()).unwrap(),
        text
    );
    let refused = owner.call("machine.write", change).unwrap_err();
    assert!(refused["message"].as_str().unwrap().contains("meanwhile"), "{refused}");

    let report = operator.call("machine.doctor", json!({})).unwrap();
    assert!(report["lines"].as_array().unwrap().len() > 10, "{report}");
    let times = watcher.call("cycle.times", json!({})).unwrap();
    let cycles: u64 = times["compute"]["counts"]
        .as_array()
        .unwrap()
        .iter()
        .map(|count| count.as_u64().unwrap())
        .sum();
    assert!(cycles > 100, "{times}");
    // Drives on and homing were orders of the cycle thread, in the life of this control.
    let orders = &times["orders"];
    let now_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64();
    let ago_s = now_s - orders["last_unix_s"].as_f64().unwrap();
    assert!(
        orders["taken"].as_u64().unwrap() >= 2 && (0.0..600.0).contains(&ago_s),
        "{orders}"
    );
}

#[test]
fn pins_are_told_and_only_those_that_nothing_drives_are_set() {
    let control = Control::start("pins", LOOPBACK);
    let mut rpc = control.rpc();
    rpc.until(|status| status["power"] == "off");
    let pin = "halui.axis.jog-speed";
    let value = |rpc: &mut Rpc| rpc.call("hal.values", json!({ "pins": [pin] })).unwrap()["pins"][0]["value"].clone();
    assert_ne!(value(&mut rpc), 321.5);
    rpc.call("hal.set", json!({ "pin": pin, "value": "321.5" })).unwrap();
    assert_eq!(value(&mut rpc), 321.5);
    for (pin, value, word) in [
        ("joint.0.motor-pos-cmd", "1", "joint.0.motor-pos-cmd"),
        (pin, "much", "much"),
        ("halui.axis.jog-sped", "1", "jog-speed"),
    ] {
        let refused = rpc.call("hal.set", json!({ "pin": pin, "value": value })).unwrap_err();
        assert!(refused["message"].as_str().unwrap().contains(word), "{refused}");
    }
    let journal = rpc.call("journal.since", json!({})).unwrap().to_string();
    assert!(journal.contains("pin halui.axis.jog-speed set to 321.5"), "{journal}");
}

#[test]
fn a_backup_has_the_machine_file_and_no_token() {
    let control = Control::start("backup", "address = \"0.0.0.0:0\"");
    let [operate, set_up] = ["operate", "set-up"].map(|role| format!("Bearer {}", control.token(role, role)));
    assert_eq!(control.json("GET", "/backup", &[], b"").0, 401);
    assert_eq!(
        control.json("GET", "/backup", &[("Authorization", &operate)], b"").0,
        403
    );
    let (status, head, body) = control.http("GET", "/backup", &[("Authorization", &set_up)], b"");
    assert!(status == 200 && head.contains("application/x-tar"), "{status} {head}");
    let has = |text: &str| body.windows(text.len()).any(|part| part == text.as_bytes());
    assert!(has("files/machine.toml") && has("[panel]") && !has("sha256"));
}

#[test]
fn what_is_encrypted_says_so_and_does_not_begin_without_its_certificate() {
    let control = Control::start("tls", "address = \"127.0.0.1:0\"\ntls = true");
    let (status, told) = control.json("GET", "/", &[], b"");
    assert_eq!(status, 400);
    assert!(told["error"].as_str().unwrap().contains("https://"), "{told}");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("machine.toml");
    let keys = "[panel]\naddress = \"127.0.0.1:0\"\ncertificate = \"none.pem\"\nkey = \"key.pem\"";
    std::fs::write(&file, format!("{MACHINE}\n{keys}\n")).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .arg("run")
        .arg(&file)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        !output.status.success() && told.contains("none.pem: there is no such file"),
        "{told}"
    );
}

#[test]
fn nothing_that_is_compressed_is_unpacked() {
    let control = Control::start("zip", LOOPBACK);
    // An archive that says it holds 4 GB: to the control, it is a program that is none.
    let mut archive = b"PK\x03\x04\x14\x00\x00\x00\x08\x00".to_vec();
    archive.extend([0; 8]);
    archive.extend([0xFF; 8]);
    archive.resize(4096, 0);
    let (status, told) = control.json("PUT", "/files/death.ngc", &[], &archive);
    assert!(
        status == 422 && told["error"].as_str().unwrap().contains("death.ngc"),
        "{status} {told}"
    );
    // Nor are frames.
    let upgrade = [
        ("Upgrade", "websocket"),
        ("Connection", "Upgrade"),
        ("Sec-WebSocket-Version", "13"),
        ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
        ("Sec-WebSocket-Extensions", "permessage-deflate"),
    ];
    let mut stream = TcpStream::connect(control.local()).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let head: String = upgrade
        .iter()
        .map(|(name, value)| format!("{name}: {value}\r\n"))
        .collect();
    stream
        .write_all(format!("GET /rpc HTTP/1.1\r\nHost: {}\r\n{head}\r\n", control.local()).as_bytes())
        .unwrap();
    let mut answer = String::new();
    let mut lines = BufReader::new(stream);
    while !answer.ends_with("\r\n\r\n") {
        assert!(lines.read_line(&mut answer).unwrap() > 0, "{answer}");
    }
    let answer = answer.to_ascii_lowercase();
    assert!(
        answer.starts_with("http/1.1 101") && !answer.contains("extensions"),
        "{answer}"
    );
}

/// A long way at a feed that takes minutes: it is not over before the test is.
const LONG: &str = "G21 G90 G94\nG53 G1 X100 F30\nG53 G1 X0\nM2\n";

#[test]
fn a_program_goes_on_without_its_client_or_is_held_as_the_machine_file_says() {
    for (key, state) in [
        ("on_lost_control = \"hold\"", "held"),
        ("on_lost_control = \"go-on\"", "running"),
    ] {
        let control = Control::start(state, &format!("{LOOPBACK}\n{key}"));
        let mut rpc = control.rpc();
        rpc.until(|status| status["power"] == "off");
        rpc.call("control.take", json!({ "name": "whoever goes" })).unwrap();
        rpc.call("program.run", json!({ "name": "long.ngc", "text": LONG }))
            .unwrap();
        let running = rpc.until(|status| status["state"] == "running" && status["line"].as_u64() >= Some(2));
        let to_go = running["to_go_mm"][0].as_f64().unwrap();
        assert!((0.0..=200.0).contains(&to_go.abs()), "{to_go}");
        let mut other = control.rpc();
        drop(rpc);
        let gone = other.until(|status| status["control"].is_null());
        let seen = other.until(|status| status["state"] == state);
        assert_eq!(seen["state"], state, "{gone}");
        let line = seen["line"].clone();
        // Whatever comes after, a program that goes on is not held a little later.
        for _ in 0..10 {
            std::thread::sleep(Duration::from_millis(20));
            let status = other.call("status", json!({})).unwrap();
            assert_eq!((&status["state"], &status["line"]), (&json!(state), &line));
        }
    }
}

#[test]
fn programs_arrive_checked_and_nothing_else_does() {
    let control = Control::start("files", LOOPBACK);
    let mut rpc = control.rpc();
    rpc.until(|status| status["power"] == "off");
    let part = b"G21 G90 G94 G54\nG0 X5\nG1 X10 Y5 F600\nM2\n";
    let (status, told) = control.json("PUT", "/files/part.ngc", &[], part);
    assert_eq!(status, 201, "{told}");
    assert_eq!(
        (&told["name"], &told["octets"], &told["lines"]),
        (&json!("part.ngc"), &json!(part.len()), &json!(4))
    );
    let (_, list) = control.json("GET", "/files/", &[], b"");
    assert_eq!(list["files"].as_array().unwrap().len(), 1);
    assert_eq!(list["files"][0]["sha256"], told["sha256"]);
    assert_eq!(
        rpc.call("status", json!({})).unwrap()["program"],
        Value::Null,
        "nothing is loaded by its arrival"
    );
    let (status, head, body) = control.http("GET", "/files/part.ngc", &[("Range", "bytes=4-6")], b"");
    assert_eq!((status, body.as_slice()), (206, &part[4..7]));
    assert!(head.contains("content-range: bytes 4-6/"), "{head}");
    assert_eq!(control.http("GET", "/files/part.ngc", &[], b"").2, part);

    // What is refused, and with which word.
    let too_long = (10_u64 << 30).to_string();
    let sum = "0".repeat(64);
    type Headers<'a> = [(&'a str, &'a str)];
    let refused: [(&str, &Headers<'_>, &[u8], u16, &str); 7] = [
        ("/files/..%2Fmachine.toml", &[], part, 400, "without a folder"),
        ("/files/%2e%2e", &[], part, 400, "a name is one word"),
        ("/files/.hidden", &[], part, 400, "dot"),
        (
            "/files/big.ngc",
            &[("Content-Length", &too_long)],
            b"",
            413,
            "a program has up to",
        ),
        (
            "/files/zip.ngc",
            &[("Content-Encoding", "gzip")],
            part,
            415,
            "compressed",
        ),
        ("/files/sum.ngc", &[("X-SHA256", &sum)], part, 422, "SHA-256"),
        ("/files/wrong.ngc", &[], b"G21\nG0 X1Q\n", 422, "wrong.ngc:2"),
    ];
    for (path, headers, body, wanted, word) in refused {
        let (status, told) = control.json("PUT", path, headers, body);
        let why = told["error"].as_str().unwrap_or_default();
        assert!(status == wanted && why.contains(word), "{path}: {status} {told}");
    }
    std::os::unix::fs::symlink(control.path("machine.toml"), control.path("programs/link.ngc")).unwrap();
    assert_eq!(control.json("GET", "/files/link.ngc", &[], b"").0, 403);
    let left: Vec<_> = std::fs::read_dir(control.path("programs"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left.len(), 2, "{left:?}");

    // By its name.
    let loaded = rpc.call("program.load", json!({ "file": "part.ngc" })).unwrap();
    assert_eq!(loaded["lines"], 4);
    for name in ["../machine.toml", "link.ngc", "none.ngc", "/etc/passwd"] {
        assert!(rpc.call("program.load", json!({ "file": name })).is_err(), "{name}");
    }
    let (status, _, body) = control.http("GET", "/path?tolerance_mm=0.1", &[], b"");
    assert_eq!(status, 200);
    let end = body.iter().position(|octet| *octet == b'\n').unwrap();
    let head: Value = serde_json::from_slice(&body[..end]).unwrap();
    let (mut rest, mut records) = (&body[end + 1..], 0);
    loop {
        let (length, after) = rest.split_at(4);
        let length = u32::from_le_bytes(length.try_into().unwrap()) as usize;
        if length == 0 {
            assert_eq!(after, b"{\"error\":null}\n");
            break;
        }
        records += length / head["record_octets"].as_u64().unwrap() as usize;
        rest = &after[length..];
    }
    assert!(records >= 3, "{records}");

    // Under another name; none of these takes the place of another one.
    let rename = |to: &str| control.json("MOVE", "/files/part.ngc", &[("Destination", to)], b"").0;
    assert_eq!((rename("link.ngc"), rename("..%2Fa.ngc"), rename("")), (412, 400, 400));
    let only_new = [("If-None-Match", "*")];
    assert_eq!(control.json("PUT", "/files/part.ngc", &only_new, b"M2\n").0, 412);
    assert_eq!(control.json("PUT", "/files/new.ngc", &only_new, b"M2\n").0, 201);
    assert_eq!((rename("new.ngc"), rename("M%C3%BChle%20100%25.ngc")), (412, 204));
    assert_eq!(std::fs::read(control.path("programs/Mühle 100%.ngc")).unwrap(), part);
    assert_eq!(rename("b.ngc"), 404, "it has another name");

    assert_eq!(control.json("DELETE", "/files/new.ngc", &[], b"").0, 204);
    assert_eq!(control.json("DELETE", "/files/new.ngc", &[], b"").0, 404);
}

#[test]
fn buttons_values_and_pages_of_the_user_are_served_and_pressed_also_by_pins() {
    let pages = tempfile::tempdir().unwrap();
    std::fs::write(pages.path().join("own.html"), "<p>mine").unwrap();
    std::fs::write(pages.path().join("own.js"), "1").unwrap();
    std::os::unix::fs::symlink("/etc/passwd", pages.path().join("link.html")).unwrap();
    let items = format!(
        r#"{LOOPBACK}
pages = "{}"
button = [
    {{ name = "park", label = "Park", mdi = ["G53 G0 X2", "G53 G0 Y3"], lamp = "motion.in-position" }},
    {{ name = "step", label = "Step", mdi = ["G91 G0 X{{way}}", "G90"], question = [
        {{ name = "way", label = "Way, mm", default = 1, min = 0, max = 5 }} ] }},
    {{ name = "deep", label = "Deep", role = "set-up", mdi = ["G0 X9"] }},
    {{ name = "warm", label = "Warm up", program = "warm.ngc" }},
]
value = [ {{ label = "X", pin = "joint.0.pos-fb", unit = "mm", decimals = 3 }} ]
"#,
        pages.path().display()
    );
    let control = Control::start("buttons", &items);
    let mut rpc = control.rpc();
    let described = rpc.call("machine.describe", json!({})).unwrap();
    assert_eq!(described["buttons"].as_array().unwrap().len(), 4);
    assert_eq!(described["buttons"][1]["questions"][0]["max"], 5.0);
    assert_eq!(described["values"][0]["pin"], "joint.0.pos-fb");
    // A link is listed, and not followed.
    assert_eq!(described["pages"], json!(["link.html", "own.html"]));
    let page = |path: &str| control.http("GET", path, &[], b"");
    let (status, head, body) = page("/own/own.html");
    assert_eq!((status, body.as_slice()), (200, &b"<p>mine"[..]));
    assert!(
        head.contains("text/html") && head.contains("content-security-policy"),
        "{head}"
    );
    assert!(page("/own/own.js").1.contains("text/javascript"));
    for path in ["/own/link.html", "/own/none.html", "/own/..%2Fmachine.toml", "/own/"] {
        assert_eq!(page(path).0, 404, "{path}");
    }

    // As any line of MDI it is refused until joints are homed.
    let press = |rpc: &mut Rpc, name: &str, answers: Value| {
        rpc.call("button.press", json!({ "name": name, "answers": answers }))
    };
    rpc.until(|status| status["power"] == "off");
    assert!(press(&mut rpc, "park", json!({})).is_err());
    rpc.call("home", json!({})).unwrap();
    rpc.until(|status| status["job"] == "completed");
    let stands = |x: f64, y: f64| {
        move |status: &Value| {
            let at = |axis: usize| status["position_mm"][axis].as_f64().unwrap_or(f64::NAN);
            status["activity"] == "idle" && (at(0) - x).abs() < 0.002 && (at(1) - y).abs() < 0.002
        }
    };
    press(&mut rpc, "park", json!({})).unwrap();
    rpc.until(stands(2.0, 3.0));
    press(&mut rpc, "step", json!({ "way": 2.5 })).unwrap();
    rpc.until(stands(4.5, 3.0));
    let refused = press(&mut rpc, "step", json!({ "way": 6 })).unwrap_err();
    assert_eq!(refused["data"]["field"], "way");
    assert!(press(&mut rpc, "none", json!({})).is_err() && press(&mut rpc, "warm", json!({})).is_err());
    std::fs::write(control.path("programs/warm.ngc"), "G0 X1\nM2\n").unwrap();
    let loaded = press(&mut rpc, "warm", json!({})).unwrap();
    assert!(loaded["program"].as_str().unwrap().ends_with("warm.ngc"), "{loaded}");

    // A button on the desk; one that asks has no pin.
    let pin = |rpc: &mut Rpc, name: &str, value: &str| rpc.call("hal.set", json!({ "pin": name, "value": value }));
    pin(&mut rpc, "halui.button.park", "1").unwrap();
    rpc.until(stands(2.0, 3.0));
    assert!(pin(&mut rpc, "halui.button.step", "1").is_err());
}

/// Drives on, homed, in automatic, a program of the same name loaded: nothing but an order is missing.
#[test]
fn nothing_that_arrives_starts_on_a_machine_that_is_ready_for_it() {
    let control = Control::start("arrival", LOOPBACK);
    let mut rpc = control.rpc();
    rpc.until(|status| status["power"] == "off");
    rpc.call("home", json!({})).unwrap();
    rpc.until(|status| status["job"] == "completed");
    let to = |x: u32| format!("G21 G90 G94\nG53 G1 X{x} F3000\nM2\n");
    let runs = |rpc: &mut Rpc| {
        let told = rpc.call("journal.since", json!({ "seq": 0 })).unwrap();
        let entries = told["entries"].as_array().unwrap().iter();
        let ends = entries.filter_map(|entry| entry["program"]["result"].as_str().map(str::to_owned));
        ends.collect::<Vec<String>>()
    };
    assert_eq!(control.json("PUT", "/files/part.ngc", &[], to(5).as_bytes()).0, 201);
    rpc.call("program.load", json!({ "file": "part.ngc" })).unwrap();
    rpc.call("program.start", json!({})).unwrap();
    while runs(&mut rpc) != ["completed"] {
        std::thread::sleep(Duration::from_millis(20));
    }
    let ready = rpc.until(|status| status["activity"] == "idle");
    assert_eq!((&ready["power"], &ready["mode"]), (&json!("on"), &json!("auto")));

    assert_eq!(control.json("PUT", "/files/new.ngc", &[], to(20).as_bytes()).0, 201);
    assert!(control.json("PUT", "/files/part.ngc", &[], to(30).as_bytes()).0 < 300);
    std::fs::write(control.path("programs/copied.ngc"), to(40)).unwrap();
    std::fs::rename(control.path("programs/copied.ngc"), control.path("programs/moved.ngc")).unwrap();
    let (_, list) = control.json("GET", "/files/", &[], b"");
    assert_eq!(list["files"].as_array().unwrap().len(), 3, "{list}");
    let moved =
        |status: &Value| (status["position_mm"][0].as_f64().unwrap() - ready["position_mm"][0].as_f64().unwrap()).abs();
    for _ in 0..25 {
        let status = rpc.call("status", json!({})).unwrap();
        assert_eq!(
            (&status["activity"], &status["program"]),
            (&json!("idle"), &ready["program"])
        );
        assert!(moved(&status) < 1.0, "{status}");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(runs(&mut rpc), ["completed"]);

    // An order starts what was loaded, not what has come under its name.
    rpc.call("program.start", json!({})).unwrap();
    while runs(&mut rpc) != ["completed", "completed"] {
        std::thread::sleep(Duration::from_millis(20));
    }
    let end = rpc.until(|status| status["activity"] == "idle");
    assert!(moved(&end) < 1.0, "{end}");
}

#[test]
fn from_elsewhere_a_token_says_what_somebody_may_do() {
    let control = Control::start("tokens", "address = \"0.0.0.0:0\"");
    assert_eq!(control.http("GET", "/", &[], b"").0, 200, "pages hold nothing secret");
    for path in ["/files/", "/metrics", "/path"] {
        assert_eq!(control.json("GET", path, &[], b"").0, 401, "{path}");
    }
    let (watch, operate) = (control.token("wall", "watch"), control.token("tablet", "operate"));
    let mode =
        std::os::unix::fs::PermissionsExt::mode(&std::fs::metadata(control.path("tokens.json")).unwrap().permissions());
    assert_eq!(mode & 0o777, 0o600);
    let bearer = |token: &str| format!("Bearer {token}");
    let (status, _) = control.json("GET", "/files/", &[("Authorization", &bearer(&watch))], b"");
    assert_eq!(status, 200);
    let (status, told) = control.json("PUT", "/files/a.ngc", &[("Authorization", &bearer(&watch))], b"M2\n");
    assert_eq!(status, 403, "{told}");

    let mut watcher = control.rpc();
    let me = watcher
        .call("client.identify", json!({ "token": watch, "name": "wall" }))
        .unwrap();
    assert_eq!(me["role"], "watch");
    let refused = watcher.call("home", json!({})).unwrap_err();
    assert_eq!(
        (&refused["code"], &refused["data"]["needed"]),
        (&json!(-32006), &json!("operate"))
    );
    assert_eq!(
        watcher.call("override", json!({ "feed": 110 })).unwrap_err()["code"],
        -32006
    );
    assert_eq!(
        watcher.call("override", json!({ "feed": 50 })).unwrap()["feed_percent"],
        50.0
    );
    // For everybody; at rest there is nothing to stop.
    assert_eq!(watcher.call("stop", json!({})).unwrap_err()["code"], -32000);
    // Signals are for everybody, and come by themselves.
    let begun = watcher.call("scope.begin", json!({ "pins": ["motion.current-vel"], "rate_hz": 20 }));
    let scope = begun.unwrap()["scope"].clone();
    let mut rows = 0;
    while rows < 200 {
        let told = watcher.message();
        assert_eq!((&told["method"], &told["params"]["scope"]), (&json!("scope"), &scope));
        rows += told["params"]["rows"].as_u64().unwrap();
    }
    watcher.call("scope.end", json!({ "scope": scope })).unwrap();
    let force = json!({ "variable": "a", "value": "1" });
    let refused = watcher.call("logic.force", force).unwrap_err();
    assert_eq!(
        (&refused["code"], &refused["data"]["needed"]),
        (&json!(-32006), &json!("set-up"))
    );
    let mut operator = control.rpc();
    assert_eq!(
        operator.call("client.identify", json!({ "token": operate })).unwrap()["role"],
        "operate"
    );
    let write = json!({ "node": 1, "index": 0x6083, "sub": 0, "value": "01000000" });
    assert_eq!(operator.call("bus.sdo_write", write).unwrap_err()["code"], -32006);
    assert_eq!(
        operator
            .call("program.load", json!({ "path": "/etc/passwd" }))
            .unwrap_err()["code"],
        -32006
    );

    // Nobody in particular.
    let mut nobody = control.rpc();
    nobody
        .socket
        .send(Message::text(
            json!({ "jsonrpc": "2.0", "id": 1, "method": "stop" }).to_string(),
        ))
        .unwrap();
    let (code, why) = nobody.closed();
    assert!(code == 4401 && why.contains("client.identify"), "{code} {why}");
    // A token that was revoked ends what it began.
    let revoked = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["panel", "revoke"])
        .arg(control.path("machine.toml"))
        .arg("tablet")
        .status()
        .unwrap();
    assert!(revoked.success());
    assert_eq!(operator.closed(), (4401, "this token was revoked".into()));
    // Guessing is slow.
    for _ in 0..5 {
        assert_eq!(
            control
                .json("GET", "/metrics", &[("Authorization", "Bearer guess")], b"")
                .0,
            401
        );
    }
    assert_eq!(
        control
            .json("GET", "/metrics", &[("Authorization", &bearer(&watch))], b"")
            .0,
        429
    );
}

#[test]
fn a_jog_of_a_lost_client_comes_to_rest() {
    let control = Control::start("jog", LOOPBACK);
    let mut rpc = control.rpc();
    rpc.until(|status| status["power"] == "off");
    rpc.call("home", json!({})).unwrap();
    let position = |status: &Value| status["position_mm"][0].as_f64().unwrap();
    let begin = position(&rpc.until(|status| status["job"] == "completed"));
    let mut other = control.rpc();
    // Its hand is on the key for 0.2 s, and a busy PC may look later: then it presses again.
    while other.call("status", json!({})).unwrap()["activity"] != "jogging" {
        rpc.call("jog", json!({ "axis": "X", "velocity_mm_s": 5 })).unwrap();
    }
    drop(rpc);
    let rest = other.until(|status| status["state"] == "ready" && status["control"].is_null());
    // Without that it would come to rest at the end of the travel only.
    assert!((begin + 1e-6..290.0).contains(&position(&rest)), "{begin}: {rest}");
    let later = other.call("status", json!({})).unwrap();
    assert_eq!(
        (&later["state"], &later["position_mm"]),
        (&json!("ready"), &rest["position_mm"])
    );
}

#[test]
fn a_machine_file_is_made_on_a_page_whose_place_the_control_takes() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mill.toml");
    let mut process = testing::command(env!("CARGO_BIN_EXE_isocnc"))
        .arg("init")
        .arg(&file)
        .args(["--panel", "127.0.0.1:0"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut output = BufReader::new(process.stdout.take().unwrap());
    let mut line = String::new();
    output.read_line(&mut line).unwrap();
    let told = line
        .trim()
        .strip_prefix("a machine file is made at http://")
        .expect("an address");
    let at: SocketAddr = told.trim_end_matches('/').parse().unwrap();
    let ask = |method: &str, path: &str, body: &Value| {
        let body = if body.is_null() {
            Vec::new()
        } else {
            body.to_string().into_bytes()
        };
        let (status, _, body) = http(at, method, path, &[], &body);
        (status, serde_json::from_slice::<Value>(&body).unwrap_or(Value::Null))
    };
    let (status, begin) = ask("GET", "/init", &Value::Null);
    assert_eq!(
        (status, &begin["exists"], &begin["name"]),
        (200, &json!(false), &json!("mill"))
    );
    assert_eq!(begin["file"], file.display().to_string());
    let page = http(at, "GET", "/", &[], &[]).2;
    assert_eq!(
        page,
        http(at, "GET", "/init.html", &[], &[]).2,
        "the page is the first one"
    );
    let answers = json!({
        "name": format!("init-{}", std::process::id()), "interface": "lo", "scan": false, "axes": "XYZ", "drives": [1, 2, 3],
        "io": [20], "scales": ["10000/5", "10000/5", "10000/5"], "travels": ["-5:205", "-5:205", "-105:5"],
        "speeds": ["1000", "1000", "1000"], "to_try": true, "cycle_us": 1000,
    });
    let with = |key: &str, value: Value| {
        let mut answers = answers.clone();
        answers[key] = value;
        answers
    };
    for (what, asked, status, why) in [
        ("start", json!({}), 409, "no machine file is written yet"),
        ("scan", json!({ "interface": "nowhere0" }), 502, "nowhere0"),
        ("check", with("scan", json!(true)), 422, "lo has not been scanned"),
        (
            "check",
            with("scales", json!(["10000/0"])),
            422,
            "10000/0: expected increments",
        ),
        ("check", with("axes", json!("XQZ")), 422, "Q"),
        ("check", with("nobody", json!(1)), 422, "unknown field `nobody`"),
        ("write", with("name", json!("1st")), 422, "name"),
        ("anything", json!({}), 404, "/init knows no anything"),
    ] {
        let (found, answer) = ask("POST", &format!("/init/{what}"), &asked);
        let said = answer["error"].as_str().unwrap_or_default();
        assert!(
            found == status && said.contains(why),
            "{what} {asked}: {found} {answer}"
        );
    }
    // A page of another site makes nothing.
    let foreign = [("Origin", "http://evil.example")];
    assert_eq!(
        http(at, "POST", "/init/write", &foreign, answers.to_string().as_bytes()).0,
        403
    );
    assert!(!file.exists());
    let (status, checked) = ask("POST", "/init/check", &answers);
    assert_eq!(status, 200);
    assert_eq!(ask("POST", "/init/write", &answers).0, 200);
    assert_eq!(checked["text"], std::fs::read_to_string(&file).unwrap());
    assert_eq!(ask("POST", "/init/write", &answers).0, 409, "it is there now");
    assert_eq!(ask("POST", "/init/write", &with("replace", json!(true))).0, 200);
    // The control listens at the same address; that this interface is none for a bus it finds out later.
    assert_eq!(ask("POST", "/init/start", &json!({})).0, 202);
    let mut line = String::new();
    while !line.starts_with(&format!("panel: http://{at}/")) {
        line.clear();
        assert!(output.read_line(&mut line).unwrap() > 0, "the control does not begin");
    }
    // Gone already where it has found out.
    let _ = process.kill();
    process.wait().unwrap();
}
