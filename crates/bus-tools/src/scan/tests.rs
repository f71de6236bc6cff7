use super::*;
use powerlink::link::memory;
use powerlink::nmt::NmtState;
use powerlink::wire::RequestedService;
use powerlink::wire::{Frame, Header, Soa, multicast, node};
use sim::{SimMachine, serve};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

const MAC: Mac = [0x02, 0, 0, 0, 0, 0xF0];
const FOREIGN: Mac = [0x02, 0, 0, 0, 0, 0xEE];

fn args() -> ScanArgs {
    ScanArgs {
        bus: Some(Protocol::Powerlink),
        interface: "eth7".into(),
        listen: 0.3,
        answer_us: 2000,
        write: None,
        add: false,
        devices: None,
    }
}

fn printed(link: impl Link + 'static, as_json: bool) -> (String, ExitCode) {
    let mut out = Vec::new();
    let scanned = ask(Box::new(link), MAC, None, &args(), false).unwrap();
    let code = tell(scanned, &args(), as_json, &mut out).unwrap();
    (String::from_utf8(out).unwrap(), code)
}

fn is(code: ExitCode, expected: ExitCode) -> bool {
    format!("{code:?}") == format!("{expected:?}")
}

#[test]
fn every_node_of_a_machine_is_found() {
    let machine = include_str!("../../../../configs/mill3-demo.toml");
    let config = config::parse(machine, Path::new("demo.toml")).unwrap();
    let mut machine = SimMachine::new(&config).unwrap();
    let (near, mut far) = memory::pair(0);
    let stop = AtomicBool::new(false);
    let (text, code) = std::thread::scope(|scope| {
        let machine = scope.spawn(|| serve(&mut far, &mut machine, &stop, &mut |_| {}, &mut |_, _| {}));
        let printed = printed(near, false);
        stop.store(true, Ordering::Relaxed);
        // Our end of the wire is gone, which may end it, too.
        let _ = machine.join().unwrap();
        printed
    });
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "4 nodes on eth7");
    let head = "id  address            state   device type  vendor      product     revision    serial  name";
    assert_eq!(lines[2], head);
    let ids: Vec<&str> = lines[3..]
        .iter()
        .map(|line| line.split_whitespace().next().unwrap())
        .collect();
    assert_eq!(ids, ["1", "2", "3", "10"]);
    assert!(
        lines[3].ends_with("PreOp1  0x00020192   0x00000000  0x00000000  0x00000000  1       x-drive"),
        "{}",
        lines[3]
    );
    assert!(is(code, ExitCode::SUCCESS));
}

#[test]
fn beside_a_managing_node_nothing_is_sent() {
    let (near, mut far) = memory::pair(0);
    let (stop, sent) = (AtomicBool::new(false), AtomicU32::new(0));
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let header = Header::multicast(multicast::SOA, FOREIGN, node::MN);
            let soa = Soa::new(NmtState::Operational, RequestedService::IdentRequest, 5);
            let mut buffer = [0; 1514];
            let length = Frame::Soa(soa).emit(&header, &mut buffer).unwrap();
            let mut heard = [0; 1514];
            while !stop.load(Ordering::Relaxed) {
                let _ = far.send(&buffer[..length]);
                let until_ns = far.now_ns() + 5_000_000;
                if let Ok(Some(_)) = far.receive(&mut heard, until_ns) {
                    sent.fetch_add(1, Ordering::Relaxed);
                }
            }
        });
        let (text, code) = printed(near, false);
        stop.store(true, Ordering::Relaxed);
        assert!(is(code, ExitCode::FAILURE));
        let first = "a managing node is at work on this wire (02:00:00:00:00:ee): nothing was sent.";
        assert_eq!(text.lines().next(), Some(first));
        assert!(text.lines().any(|line| line == " 240  Operational 0.000"), "{text}");
    });
    assert_eq!(sent.into_inner(), 0, "frames were sent");
}

#[test]
fn an_empty_wire_says_what_to_look_at() {
    let (near, mut far) = memory::pair(0);
    let reader = std::thread::spawn(move || {
        // Takes what is sent, until the other end is gone, and says nothing.
        let mut buffer = [0; 1514];
        while far.receive(&mut buffer, u64::MAX).is_ok() {}
    });
    let (text, code) = printed(near, true);
    reader.join().unwrap();
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value["nodes"], json!([]));
    assert!(value["trouble"][0].as_str().unwrap().starts_with("nobody answers: "));
    assert!(is(code, ExitCode::FAILURE));
}

#[test]
fn two_nodes_with_one_id_are_trouble() {
    let mut octets = [0; 176];
    octets[12..18].copy_from_slice(&[0x88, 0xAB, 0x06, 0xFF, 3, 0x01]);
    let Ok(Frame::Asnd(powerlink::wire::Asnd::IdentResponse(ident))) = Frame::parse(&octets) else {
        panic!("no IdentResponse")
    };
    let found = |id, last| Found {
        id,
        mac: [2, 0, 0, 0, 0, last],
        ident,
    };
    let expected = "two nodes have the id 3: 02:00:00:00:00:01 and 02:00:00:00:00:02; give one of them another id";
    assert_eq!(troubles(&[found(3, 1), found(3, 2), found(4, 2)]), [expected]);
    assert!(troubles(&[found(3, 1), found(4, 1)]).is_empty());
}

/// Scans the nodes of a machine file with these arguments.
fn scanned(machine: &str, args: &ScanArgs) -> (String, ExitCode) {
    let config = config::parse(machine, Path::new("m.toml")).unwrap();
    let mut machine = SimMachine::new(&config).unwrap();
    let (near, mut far) = memory::pair(0);
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let machine = scope.spawn(|| serve(&mut far, &mut machine, &stop, &mut |_| {}, &mut |_, _| {}));
        let mut out = Vec::new();
        let scanned = ask(Box::new(near), MAC, None, args, false).unwrap();
        let code = tell(scanned, args, false, &mut out);
        stop.store(true, Ordering::Relaxed);
        // Our end of the wire is gone, which may end it, too.
        let _ = machine.join().unwrap();
        (String::from_utf8(out).unwrap(), code.unwrap())
    })
}

const IO: &str = include_str!("../../../../configs/io-only.toml");

#[test]
fn a_scan_writes_a_machine_file_of_what_answers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cabinet.toml");
    std::fs::copy("../../obd/tests/data/io.xdd", folder.path().join("io.xdd")).unwrap();
    let args = ScanArgs {
        write: Some(path.clone()),
        ..args()
    };
    let (text, code) = scanned(IO, &args);
    assert!(is(code, ExitCode::SUCCESS), "{text}");
    assert!(
        text.ends_with(&format!(
            "{0} is written: 2 nodes. Next: isocnc check {0}\n",
            path.display()
        )),
        "{text}"
    );
    let config = config::read(&path).unwrap();
    assert_eq!(
        (config.name.as_str(), config.bus.interface.as_str()),
        ("cabinet", "eth7")
    );
    let [inputs, outputs] = &config.bus.nodes[..] else {
        panic!("{config:?}")
    };
    assert_eq!((inputs.id, inputs.name.as_str()), (10, "inputs"));
    assert_eq!((outputs.id, outputs.name.as_str()), (11, "outputs"));
    assert_eq!(inputs.identity.device_type, Some(0x000F_0191));
    // What the simulated node has: 2 octets and 8 numbers each way.
    assert_eq!((inputs.inputs.len(), inputs.outputs.len()), (10, 10));
    assert_eq!(inputs.channels.len(), 16 + 8 + 16 + 8);
    let names: Vec<&str> = inputs.channels.iter().map(|channel| channel.name.as_str()).collect();
    for name in ["input-00", "input-15", "analog-input-7", "output-00", "analog-output-0"] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    assert_eq!(inputs.device, None);

    // A second time nothing is replaced, and what is there is right.
    let before = std::fs::read(&path).unwrap();
    let (text, code) = scanned(IO, &args);
    assert!(
        text.contains("is there already and was not changed: --add adds"),
        "{text}"
    );
    assert!(is(code, ExitCode::SUCCESS), "{text}");
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[test]
fn a_scan_adds_what_a_file_does_not_have_and_names_what_is_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.toml");
    // By hand: a remark, a name, another device expected at 11, a net; node 12 is not on the wire, node 10 not in the file.
    let by_hand = "schema = 1\n# my cabinet\n[machine]\nname = \"mine\"\nkinematics = \"none\"\n[bus]\nkind = \"memory\"\n\
                   [[bus.node]]\nid = 11\nname = \"lamps\"\nprofile = \"io\"\nserial = 4711\n\
                   [[bus.node]]\nid = 12\nname = \"valves\"\nprofile = \"io\"\n\
                   [[hal.net]]\nname = \"lamp\"\nsource = \"io.11.in-08\"\ntargets = [\"io.11.out-00\"]";
    std::fs::write(&path, by_hand).unwrap();
    let args = ScanArgs {
        write: Some(path.clone()),
        add: true,
        ..args()
    };
    let (text, code) = scanned(IO, &args);
    assert!(is(code, ExitCode::FAILURE), "{text}");
    assert!(
        text.contains("lamps (node 11) is another device: expected serial 4711; found device type 0x000F0191"),
        "{text}"
    );
    assert!(
        text.contains("valves (node 12) is missing: expected any device; nobody answers there"),
        "{text}"
    );
    assert!(!text.contains("node 10 is on the network"), "{text}");
    assert!(text.contains("m.toml: 1 node added, all else kept."), "{text}");
    let written = std::fs::read_to_string(&path).unwrap();
    assert!(written.starts_with(by_hand), "{written}");
    let config = config::read(&path).unwrap();
    let ids: Vec<u8> = config.bus.nodes.iter().map(|node| node.id).collect();
    assert_eq!(ids, [11, 12, 10]);
    assert_eq!(config.nets.len(), 1);
    let (text, _) = scanned(IO, &args);
    assert!(text.contains("m.toml has them all: not changed"), "{text}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), written);
}

#[test]
fn a_device_file_that_fits_is_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy("../../obd/tests/data/io.xdd", folder.path().join("io.xdd")).unwrap();
    std::fs::write(folder.path().join("broken.xdd"), "<nothing").unwrap();
    let devices = propose::devices(folder.path(), &folder.path().join("m.toml")).unwrap();
    assert_eq!(devices.len(), 1);
    assert_eq!(devices[0].0, "io.xdd");
    let missing = propose::devices(Path::new("no/such/folder"), Path::new("m.toml"));
    assert!(
        missing
            .unwrap_err()
            .to_string()
            .contains("no/such/folder: cannot be read")
    );
}
