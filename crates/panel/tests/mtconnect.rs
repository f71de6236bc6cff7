//! MTConnect over HTTP, with a control of its own kind behind the panel: what it tells is what a client sees.

use panel::{Control, Counts, Guest, Listener, Settings, serve};
use protocol::{
    Activity, Described, DescribedAxis, Mode, Overrides, Parts, Pin, PinDirection, PinType, Pins, Power, Status,
    StatusAxis, StatusProgram, Tool, Tools,
};
use serde_json::{Value, json};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A machine that stands at X 10, and moves to X 20 as soon as somebody subscribes.
struct Fake;

/// X is a joint alone, with what is measured of it.
const PINS: [(&str, f64); 3] = [
    ("joint.0.motor-pos-fb", 9.75),
    ("joint.0.f-error", 0.25),
    ("cia402.0.drv-actual-torque", 405.0),
];

fn pin(name: &str, value: f64) -> Pin {
    Pin {
        name: name.into(),
        kind: PinType::Float,
        direction: PinDirection::Out,
        value: json!(value),
        net: None,
        source: None,
        alias_of: None,
        unit: None,
    }
}

/// Of these pins, those that a control of this kind has.
fn pins(wanted: impl Fn(&str) -> bool) -> Pins {
    let found = PINS.iter().filter(|(name, _)| wanted(name));
    Pins {
        pins: found.map(|(name, value)| pin(name, *value)).collect(),
        more: false,
    }
}

fn answer(method: &str, params: &Value) -> Value {
    match method {
        "hal.list" => json!(pins(|name| params["pattern"] == name)),
        "hal.values" => {
            let asked = params["pins"].as_array().unwrap();
            json!(pins(|name| asked.contains(&json!(name))))
        }
        "machine.describe" => {
            let axis = |axis: &str, unit: &str, number, joint| DescribedAxis {
                axis: axis.into(),
                unit: unit.into(),
                joints: vec![number],
                joint,
                ..DescribedAxis::default()
            };
            json!(Described {
                machine: "mill".into(),
                axes: vec![axis("X", "mm", 0, Some(0)), axis("A", "degrees", 1, None)],
                spindles: 1,
                ..Described::default()
            })
        }
        "tool.list" => json!(Tools {
            unit: "inch".into(),
            in_spindle: 3,
            tools: vec![Tool {
                tool: 3,
                pocket: 1,
                length: 2.0,
                diameter: 0.25,
                remark: "end mill".into(),
                ..Tool::default()
            }],
        }),
        _ => json!(state(10.0)),
    }
}

fn state(x: f64) -> Status {
    let axis = |axis: &str, joint| StatusAxis {
        axis: axis.into(),
        joints: vec![joint],
        ..StatusAxis::default()
    };
    Status {
        power: Power::On,
        activity: Activity::Running,
        mode: Mode::Auto,
        program: Some(StatusProgram {
            name: "p.ngc".into(),
            ..StatusProgram::default()
        }),
        line: 7,
        tool: 3,
        axes: vec![axis("X", 0), axis("A", 1)],
        position_mm: vec![x, 0.0, 0.0, 90.0],
        overrides: Overrides {
            feed_percent: 80.0,
            ..Overrides::default()
        },
        codes: vec!["G54".into()],
        parts: Parts { count: 4, target: None },
        ..Status::default()
    }
}

impl Control for Fake {
    fn connect(&self, _guest: &Guest) -> io::Result<UnixStream> {
        let (inside, outside) = UnixStream::pair()?;
        std::thread::spawn(move || {
            let lines = BufReader::new(inside.try_clone().unwrap()).lines();
            let mut inside = inside;
            for line in lines.map_while(Result::ok) {
                let request: Value = serde_json::from_str(&line).unwrap();
                let (id, method) = (&request["id"], request["method"].as_str().unwrap());
                let told = match method {
                    "subscribe" => {
                        let result = json!({ "id": id, "result": { "monotonic_s": 1.0, "unix_s": 1.0e9, "state": state(10.0) } });
                        let changed = json!({ "position_mm": [20.0, 0.0, 0.0, 90.0] });
                        let moved = json!({ "monotonic_s": 1.0, "unix_s": 1.0e9, "changed": changed });
                        let news = json!({ "method": "state", "params": moved });
                        format!("{result}\n{news}\n")
                    }
                    _ => format!(
                        "{}\n",
                        json!({ "id": id, "result": answer(method, &request["params"]) })
                    ),
                };
                if inside.write_all(told.as_bytes()).is_err() {
                    return;
                }
            }
        });
        Ok(outside)
    }
}

fn request(address: SocketAddr, path: &str, more: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    write!(
        stream,
        "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n{more}\r\n"
    )
    .unwrap();
    stream
}

fn get(address: SocketAddr, path: &str) -> String {
    let mut told = String::new();
    request(address, path, "").read_to_string(&mut told).unwrap();
    told
}

fn beside(client: impl FnOnce(SocketAddr)) {
    beside_with(Settings::default(), client);
}

fn beside_with(settings: Settings, client: impl FnOnce(SocketAddr)) {
    let listener = Listener::bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let address = listener.address();
    let (stays, until) = UnixStream::pair().unwrap();
    let serving =
        std::thread::spawn(move || serve(listener, settings, Arc::new(Fake), Arc::new(Counts::default()), until));
    client(address);
    drop(stays);
    serving.join().unwrap().unwrap();
}

#[test]
fn a_client_sees_what_the_control_tells() {
    beside(|address| {
        let probe = get(address, "/mtconnect/probe");
        assert!(
            probe.starts_with("HTTP/1.1 200") && probe.contains("text/xml"),
            "{probe}"
        );
        assert!(
            probe.contains("<Linear id=\"x_axis\" name=\"X\">") && probe.contains("<Rotary id=\"a_axis\""),
            "{probe}"
        );
        let current = get(address, "/mtconnect/mill/current");
        for told in [">ACTIVE<", ">AUTOMATIC<", ">p.ngc<", ">80<", ">90<"] {
            assert!(current.contains(told), "{told}: {current}");
        }
        for told in [">9.75<", ">0.25<", ">40.5<"] {
            assert!(current.contains(told), "{told}: {current}");
        }
        let until = Instant::now() + Duration::from_secs(60);
        while !get(address, "/mtconnect/current?path=//DataItem[@id='x_com']").contains(">20<") {
            assert!(Instant::now() < until, "what is new is never told");
            std::thread::sleep(Duration::from_millis(20));
        }
        let tool = get(address, "/mtconnect/asset/T3");
        assert!(tool.contains("50.8") && tool.contains("6.35"), "in mm: {tool}");
        assert!(get(address, "/mtconnect/asset/T9").starts_with("HTTP/1.1 404"));
        assert!(get(address, "/mtconnect/sample?from=99999").contains("<OutOfRange>"));
    });
}

#[test]
fn a_stream_begins_at_once_and_ends_with_the_panel() {
    beside(|address| {
        let mut lines = BufReader::new(request(address, "/mtconnect/current?interval=50", "")).lines();
        let mut next = |what: &str| {
            lines
                .find(|line| line.as_ref().is_ok_and(|line| line.contains(what)))
                .is_some()
        };
        assert!(next("multipart/mixed;boundary="));
        assert!(next("<MTConnectStreams") && next("<MTConnectStreams"));
    });
}

#[test]
fn a_page_of_another_site_is_told_nothing() {
    beside(|address| {
        let mut told = String::new();
        let mut stream = request(address, "/mtconnect/current", "Sec-Fetch-Site: cross-site\r\n");
        stream.read_to_string(&mut told).unwrap();
        assert!(told.starts_with("HTTP/1.1 403"), "{told}");
    });
}

#[test]
fn an_agent_of_somebody_else_reads_lines_and_is_answered() {
    let shdr = Listener::bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let port = shdr.address();
    let settings = Settings {
        shdr: Some(shdr),
        mtconnect_old_errors: true,
        ..Settings::default()
    };
    beside_with(settings, |address| {
        let mut stream = TcpStream::connect(port).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let mut lines = BufReader::new(stream.try_clone().unwrap()).lines().map(Result::unwrap);
        assert_eq!(lines.next().unwrap(), "* shdrversion: 2");
        let mut until = |what: &str| while !lines.next().unwrap().ends_with(what) {};
        until("* device: mill");
        // Time, key, value, in the order of the model.
        until("|x_act|9.75");
        until("|x_com|20");
        stream.write_all(b"* PING\n").unwrap();
        until("* PONG 10000");
        // Another one is told all of it, too.
        let mut second = BufReader::new(TcpStream::connect(port).unwrap()).lines();
        assert!(second.any(|line| line.unwrap().contains("|x_act|9.75")));
        assert!(get(address, "/mtconnect/sample?from=99999").contains("<Error errorCode=\"OUT_OF_RANGE\">"));
    });
}
