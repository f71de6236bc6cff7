//! A private wire is made where namespaces are allowed, as root and as an ordinary user.
//!
//! This program has no test harness, for a namespace is entered by a process of one thread: it runs itself again, once per
//! user, and checks what the other one says. Where the system refuses, it prints the reason and passes.

use isocnc::analyser::Analyser;
use isocnc::bus::sender::{ClaimError, SoleSender};
use isocnc::host::netns::{NetnsError, private_wire};
use nix::ifaddrs::getifaddrs;
use nix::net::if_::InterfaceFlags;
use powerlink::link::Link;
use powerlink::link::pcap::PcapReader;
use powerlink::link::raw::{RawConfig, RawLink};
use std::fs::read_to_string;
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::time::{Duration, Instant};

const ROLE: &str = "ISOCNC_TEST_PRIVATE_WIRE";
const NOBODY: u32 = 65_534;

pub(crate) fn main() {
    if std::env::var_os(ROLE).is_some() {
        make_wire();
        return;
    }
    check("as this user", |_| {});
    if nix::unistd::geteuid().is_root() {
        if let Some(said) = check("as an ordinary user", |command| {
            command.uid(NOBODY).gid(NOBODY);
        }) {
            assert!(said.contains("WIRE MADE, user namespace: true"), "{said}");
        }
    } else {
        println!("private_wire as root ... SKIPPED: run as root");
    }
    std::thread::scope(|scope| {
        let refused = scope
            .spawn(|| private_wire("plk0", "plk1").unwrap_err())
            .join()
            .unwrap();
        assert!(matches!(refused, NetnsError::Threads { threads: 2.. }), "{refused}");
        println!("private_wire in a process with threads ... ok, refused");
    });
}

fn check(name: &str, configure: impl FnOnce(&mut Command)) -> Option<String> {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.env(ROLE, "1").current_dir("/");
    configure(&mut command);
    let output = match command.output() {
        Ok(output) => output,
        Err(cause) => {
            println!("private_wire {name} ... SKIPPED: this program cannot run so: {cause}");
            return None;
        }
    };
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success(),
        "{name}: {said}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    if let Some((_, reason)) = said.split_once("REFUSED: ") {
        println!("private_wire {name} ... SKIPPED: {}", reason.trim());
        return None;
    }
    assert!(said.contains("WIRE MADE"), "{said}");
    println!("private_wire {name} ... ok");
    Some(said)
}

/// Runs in a process of its own.
fn make_wire() {
    if !nix::unistd::geteuid().is_root() {
        // Whoever may not send cannot keep others from it either.
        let refused = SoleSender::claim("lo").expect_err("an ordinary user has no raw sockets");
        assert!(matches!(refused, ClaimError::Open(_)), "{refused}");
    }
    let wire = match private_wire("plk0", "plk1") {
        Ok(wire) => wire,
        Err(error @ NetnsError::Forbidden { .. }) => {
            println!("REFUSED: {error}");
            return;
        }
        Err(error) => panic!("{error}"),
    };
    assert_eq!((wire.near.as_str(), wire.far.as_str()), ("plk0", "plk1"));
    // The kernel says that a link runs some time after it does.
    let give_up = Instant::now() + testing::PATIENCE;
    let flags = loop {
        let flags: Vec<_> = getifaddrs()
            .unwrap()
            .map(|found| (found.interface_name, found.flags))
            .collect();
        let good = InterfaceFlags::IFF_UP | InterfaceFlags::IFF_NOARP | InterfaceFlags::IFF_RUNNING;
        let is_good = |end| flags.iter().any(|(name, flags)| name == end && flags.contains(good));
        if ["plk0", "plk1"].into_iter().all(is_good) {
            break flags;
        }
        assert!(Instant::now() < give_up, "{flags:?}");
        std::thread::sleep(Duration::from_millis(20));
    };
    let (_, lo) = flags.iter().find(|(name, _)| name == "lo").unwrap();
    assert!(lo.contains(InterfaceFlags::IFF_UP));
    if wire.notes.is_empty() {
        let addresses = read_to_string("/proc/net/if_inet6").unwrap_or_default();
        assert!(
            !addresses.contains("plk"),
            "no IPv6 address, so no neighbour discovery: {addresses}"
        );
    }
    claim_interfaces();
    measure_soc_periods();
    println!(
        "WIRE MADE, user namespace: {}, notes: {:?}",
        wire.user_namespace, wire.notes
    );
}

/// An interface has one sender, who is named; another interface is free, and so is this one behind him.
fn claim_interfaces() {
    let near = SoleSender::claim("plk0").expect("nobody sends on a new wire");
    let refused = SoleSender::claim("plk0").expect_err("it is taken");
    let ClaimError::Taken { interface, by } = &refused else {
        panic!("{refused}");
    };
    let (pid, command) = by.process.clone().expect("our own process can be seen");
    assert_eq!((interface.as_str(), pid), ("plk0", std::process::id()));
    let this = std::env::current_exe().expect("this program");
    assert!(command.contains(&*this.to_string_lossy()), "{command}");
    let far = SoleSender::claim("plk1").expect("another interface");
    drop(near);
    SoleSender::claim("plk0").expect("free again");
    drop(far);
    let missing = SoleSender::claim("plk9").expect_err("there is none");
    assert!(missing.to_string().contains("no interface has this name"), "{missing}");
}

/// The far end sees every SoC that the near end sends, stamped, and what the far end sends itself.
fn measure_soc_periods() {
    const SOCS: u64 = 50;
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("wire.pcap");
    let mut near = RawLink::open("plk0", RawConfig::default()).unwrap();
    let mut far = RawLink::open("plk1", RawConfig::default()).unwrap();
    let frame = |message_type: u8| {
        let mut frame = [0; 60];
        frame[..6].copy_from_slice(&[0x01, 0x11, 0x1E, 0, 0, message_type]);
        frame[12..15].copy_from_slice(&[0x88, 0xAB, message_type]);
        frame
    };
    // The kernel stamps frames from some time after the first socket asks for it until the last one is closed.
    let first = Analyser::start("plk1", None, 1000, None).unwrap();
    loop {
        let probe = Analyser::start("plk1", None, 1000, None).unwrap();
        near.send(&frame(0x0D)).unwrap();
        let report = probe.stop().unwrap();
        assert_eq!(report.frames.other, 1);
        if report.frames_unstamped == 0 {
            break;
        }
    }
    let analyser = Analyser::start("plk1", Some("plk0"), 1000, Some(&file)).unwrap();
    for _ in 0..SOCS {
        near.send(&frame(0x01)).unwrap();
        far.send(&frame(0x04)).unwrap();
    }
    let report = analyser.stop().unwrap();
    first.stop().unwrap();
    assert_eq!(
        (
            report.n + report.breaks.restarts,
            report.frames_dropped,
            report.frames_unstamped
        ),
        (SOCS - 1, 0, 0)
    );
    assert_eq!(
        (report.frames.soc, report.frames.pres, report.frames.foreign),
        (SOCS, SOCS, 0),
        "{report:?}"
    );
    let octets = std::fs::read(&file).unwrap();
    let types: Vec<u8> = PcapReader::new(&octets)
        .unwrap()
        .map(|captured| captured.unwrap().frame[14])
        .collect();
    assert_eq!(types.len() as u64, 2 * SOCS);
    assert!(types.chunks(2).all(|pair| pair == [0x01, 0x04]), "{types:?}");
}
