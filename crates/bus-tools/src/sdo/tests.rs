use super::*;
use clap::Parser;
use obd::AbortCode;
use powerlink::link::memory;
use powerlink::sdo::udp::UdpServer;
use sim::{SimMachine, serve};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Runs commands on the nodes of the demo machine, each line one command; returns what was printed and the exit codes.
fn on_machine(node: u8, commands: &[&str], device: Option<&DeviceDescription>) -> (String, Vec<String>) {
    let machine = include_str!("../../../../configs/mill3-demo.toml");
    let config = config::parse(machine, Path::new("demo.toml")).unwrap();
    let mut machine = SimMachine::new(&config).unwrap();
    let (near, mut far) = memory::pair(0);
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let machine = scope.spawn(|| serve(&mut far, &mut machine, &stop, &mut |_| {}, &mut |_, _| {}));
        let mut access = Access::on(Box::new(near), [2, 0, 0, 0, 0, 0xF0], None, node, 1_000_000).unwrap();
        let (mut out, mut codes) = (Vec::new(), Vec::new());
        for command in commands {
            let words = ["sdo"].into_iter().chain(command.split_whitespace());
            let Line { sdo, json } = Line::try_parse_from(words).unwrap();
            codes.push(match run(&sdo.command, &mut access, device, json, &mut out) {
                Ok(code) if format!("{code:?}") == format!("{:?}", ExitCode::SUCCESS) => "ok".to_owned(),
                Ok(_) => "trouble".to_owned(),
                Err(error) => error.to_string(),
            });
        }
        access.close().unwrap();
        drop(access);
        stop.store(true, Ordering::Relaxed);
        // Our end of the wire is gone, which may end it, too.
        let _ = machine.join().unwrap();
        (String::from_utf8(out).unwrap(), codes)
    })
}

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    sdo: SdoArgs,
    #[arg(long, global = true)]
    json: bool,
}

#[test]
fn objects_are_read_and_refused() {
    let (text, codes) = on_machine(1, &["get 0x1018:4 0x1008 0x9999 0x1000", "get 0x1E40:2 --json"], None);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[..4],
        [
            "0x1018/4     4 octets  1 (0x00000001)                            identity",
            "0x1008       7 octets  \"x-drive\"                                 device name",
            "0x9999      refused: object does not exist in the object dictionary (0x06020000)",
            "0x1000       4 octets  131474 (0x00020192)                       device type",
        ]
    );
    let json: serde_json::Value = serde_json::from_str(lines[4]).unwrap();
    assert_eq!(
        (&json["object"], &json["octets"]),
        (&json!("0x1E40/2"), &json!("0164a8c0"))
    );
    assert_eq!(json["shown"], "192.168.100.1");
    assert_eq!(codes, ["trouble", "ok"]);
}

#[test]
fn a_write_shows_the_value_before_and_after() {
    let (text, codes) = on_machine(
        2,
        &[
            "set 0x1006 2000",
            "set 0x1F9A hello",
            "set 0x1000 5",
            "set 0x1006 2000000000000",
            "set 0x9999 1",
            "set 0x1006 -1",
            "set 0x1C14 --type u32 0x186A1",
        ],
        None,
    );
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines,
        [
            "0x1006 before: 0 (0x00000000)",
            "0x1006 after:  2000 (0x000007D0)",
            "0x1F9A before: \"y-drive\"",
            "0x1F9A after:  \"hello\"",
            "0x1000      refused: attempt to write a read-only object (0x06010002)",
            "0x1006 before: 2000 (0x000007D0)",
            "0x1006 after:  -1 (0xFFFFFFFF)",
            "0x1C14 before: 100000 (0x000186A0)",
            "0x1C14 after:  100001 (0x000186A1)",
        ]
    );
    let too_long = "0x1006: expected a whole number from 0 to 4294967295 (u32), got \"2000000000000\"";
    let unknown = "0x9999 cannot be read, so its type is not known: give it, like --type u32";
    assert_eq!(codes, ["ok", "ok", "trouble", too_long, unknown, "ok", "ok"]);
}

#[test]
fn a_list_probes_the_profile() {
    let (text, codes) = on_machine(10, &["list"], None);
    assert_eq!(codes, ["ok"]);
    for line in [
        "0x1000       4 octets  983441 (0x000F0191)                       device type",
        "0x1018        1 octet  4 (0x04)                                  identity",
        "0x1018/4     4 octets  10 (0x0000000A)                           identity",
        "0x1008       2 octets  \"io\"                                      device name",
        "0x1030/5     6 octets  02:00:00:45:50:0a                         network interface",
    ] {
        assert!(text.lines().any(|own| own == line), "{line}\nis not in\n{text}");
    }
    // Ascending, each once.
    let objects: Vec<&str> = text
        .lines()
        .filter(|line| line.starts_with("0x"))
        .map(|line| &line[..10])
        .collect();
    let key = |object: &&str| value::object(object.trim()).unwrap();
    assert!(objects.is_sorted_by(|a, b| key(a) < key(b)), "{objects:?}");
}

#[test]
fn who_does_not_answer_is_named() {
    let (near, mut far) = memory::pair(0);
    let reader = std::thread::spawn(move || {
        let mut buffer = [0; 1514];
        while powerlink::link::Link::receive(&mut far, &mut buffer, u64::MAX).is_ok() {}
    });
    let Err(error) = Access::on(Box::new(near), [2, 0, 0, 0, 0, 0xF0], None, 77, 1_000_000) else {
        panic!("found")
    };
    reader.join().unwrap();
    assert!(error.to_string().starts_with("node 77 does not answer: "), "{error}");
}

/// One object.
struct One(Vec<u8>);

impl obd::Objects for One {
    fn sdo_read(&mut self, index: u16, _: u8, out: &mut [u8]) -> Result<usize, AbortCode> {
        if index != 0x2000 {
            return Err(AbortCode::NO_OBJECT);
        }
        out[..self.0.len()].copy_from_slice(&self.0);
        Ok(self.0.len())
    }

    fn sdo_write(&mut self, _: u16, _: u8, value: &[u8]) -> Result<(), AbortCode> {
        self.0 = value.to_vec();
        Ok(())
    }
}

#[test]
fn udp_is_a_third_way() {
    let mut server: Box<UdpServer> = Box::new(UdpServer::bind("127.0.0.1:0", 5).unwrap());
    let address = server.local_addr().unwrap().to_string();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut objects = One(vec![1, 2, 0, 0]);
            while !stop.load(Ordering::Relaxed) {
                server.serve(&mut objects, Duration::from_millis(20)).unwrap();
            }
        });
        let words = ["sdo", "--node", "5", "--udp", &address, "set", "0x2000", "7"];
        let Line { sdo: args, .. } = Line::try_parse_from(words).unwrap();
        let mut out = Vec::new();
        let done = sdo(&args, false, &mut out);
        stop.store(true, Ordering::Relaxed);
        done.unwrap();
        let text = String::from_utf8(out).unwrap();
        assert_eq!(text, "0x2000 before: 513 (0x00000201)\n0x2000 after:  7 (0x00000007)\n");
    });
}

#[test]
fn ways_exclude_each_other() {
    let parse = |words: &str| Line::try_parse_from(words.split_whitespace()).is_ok();
    assert!(parse("sdo --node 3 --interface eth0 get 0x1000"));
    assert!(parse("sdo get 0x1000 --node 3"));
    assert!(!parse("sdo --node 3 --interface eth0 --udp 1.2.3.4 get 0x1000"));
    assert!(!parse("sdo --node 0 get 0x1000"));
    assert!(!parse("sdo --node 3 get"));
    assert!(!parse("sdo --node 3 get 1000"));
    assert!(!parse("sdo --node 3 get 0x1000 --type u33"));
}

/// A node of a newer or older firmware than its device file: 255 questions for an object that it does not have.
#[test]
fn an_object_that_a_node_does_not_have_is_asked_for_once() {
    let entries =
        (0..=8).map(|sub| format!("[9999sub{sub}]\nParameterName=x\nObjectType=7\nDataType=7\nAccessType=rw\n"));
    let object = |index: &str| format!("[{index}]\nParameterName=x\nObjectType=7\nDataType=7\nAccessType=ro\n");
    let file = format!(
        "[DeviceInfo]\n[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n[ManufacturerObjects]\nSupportedObjects=2\n\
         1=0x9999\n2=0x999A\n{}[9999]\nParameterName=x\nObjectType=9\nSubNumber=9\n{}{}",
        object("1000"),
        entries.collect::<String>(),
        object("999A"),
    );
    let device = obd::device::parse("x.eds", file.as_bytes()).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(device.objects.iter().filter(|object| object.index == 0x9999).count(), 9);
    let (text, codes) = on_machine(1, &["list"], Some(&device));
    let of_missing = text.lines().filter(|line| line.starts_with("0x9999"));
    assert_eq!(of_missing.count(), 1, "{text}");
    // What comes behind it is asked for.
    assert!(text.contains("0x1000") && text.contains("0x999A"), "{text}");
    assert_eq!(codes, ["ok"]);
}
