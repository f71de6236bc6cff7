//! Both links to a real interface over a veth pair, held against each other.
//!
//! The tests need a network namespace of their own and the `ip` command to make the pair; where either is missing they
//! print why and pass. The namespace is entered by a child process, this test binary started again.
#![cfg(all(feature = "pnet", target_os = "linux"))]

use std::os::unix::process::CommandExt;
use std::process::Command;

use powerlink::link::pnet::PnetLink;
use powerlink::link::raw::{RawConfig, RawLink, Reception};
use powerlink::link::{Link, LinkError, Received};
use powerlink::wire::FRAME_LEN_MAX;

/// Set in the child that runs inside the namespace.
const INSIDE: &str = "POWERLINK_LINKS_INSIDE_NAMESPACE";

#[test]
fn both_links_carry_the_same_frames() {
    if std::env::var_os(INSIDE).is_some() {
        return inside();
    }
    let mut child = Command::new(std::env::current_exe().unwrap());
    child
        .args(["--exact", "raw_links::both_links_carry_the_same_frames", "--nocapture"])
        .env(INSIDE, "1");
    let (uid, gid) = (nix::unistd::getuid(), nix::unistd::getgid());
    let (uid_map, gid_map) = (format!("0 {uid} 1"), format!("0 {gid} 1"));
    // SAFETY: between fork and exec only system calls are made; all strings are ready.
    unsafe { child.pre_exec(move || enter_namespace(&uid_map, &gid_map)) };
    match child.output() {
        Ok(output) => {
            print!("{}", String::from_utf8_lossy(&output.stdout));
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        }
        Err(error) => println!("skipped: no network namespace: {error}"),
    }
}

fn enter_namespace(uid_map: &str, gid_map: &str) -> std::io::Result<()> {
    use nix::sched::{CloneFlags, unshare};
    if unshare(CloneFlags::CLONE_NEWNET).is_ok() {
        return Ok(());
    }
    unshare(CloneFlags::CLONE_NEWUSER | CloneFlags::CLONE_NEWNET)?;
    std::fs::write("/proc/self/setgroups", "deny")?;
    std::fs::write("/proc/self/uid_map", uid_map)?;
    std::fs::write("/proc/self/gid_map", gid_map)
}

fn ip(arguments: &str) -> bool {
    let done = Command::new("ip").args(arguments.split(' ')).status();
    done.is_ok_and(|status| status.success())
}

fn inside() {
    let made = ip("link add plk-a address 02:00:00:00:00:f0 type veth peer name plk-b address 02:00:00:00:00:01")
        && ip("link set plk-a up")
        && ip("link set plk-b up");
    if !made {
        println!("skipped: the ip command cannot make a veth pair here");
        return;
    }
    let stamped = RawConfig {
        receive_stamps: true,
        ..RawConfig::default()
    };
    let spinning = RawConfig {
        spin_ns: 100_000,
        ..RawConfig::default()
    };

    let unknown = RawLink::open("no-such-if", stamped)
        .err()
        .expect("there is no such interface");
    assert!(unknown.to_string().contains("no-such-if") && unknown.to_string().contains("no interface has this name"));

    let raw = |interface, config| RawLink::open(interface, config).unwrap();
    let by_calls = RawConfig {
        ring_frames: 0,
        ..stamped
    };
    // First of all: nobody has asked the kernel for stamps in this namespace yet.
    for config in [by_calls, stamped] {
        stamps_are_of_the_arrival(raw("plk-a", RawConfig::default()), raw("plk-b", config));
    }

    let (a, b) = (raw("plk-a", stamped), raw("plk-b", stamped));
    assert_eq!((a.mac(), b.mac()), ([2, 0, 0, 0, 0, 0xF0], [2, 0, 0, 0, 0, 1]));
    assert!(
        matches!(a.reception(), Reception::Ring { frames: 64.. }),
        "{}",
        a.reception()
    );
    exchange("ring, ring", a, b, true);
    exchange("ring, calls", raw("plk-a", stamped), raw("plk-b", by_calls), true);
    exchange("calls, ring", raw("plk-a", by_calls), raw("plk-b", spinning), true);
    exchange(
        "ring, pnet",
        raw("plk-a", spinning),
        PnetLink::open("plk-b", 0).unwrap(),
        false,
    );
    exchange(
        "pnet, ring",
        PnetLink::open("plk-a", 20_000).unwrap(),
        raw("plk-b", stamped),
        true,
    );

    for config in [stamped, by_calls] {
        tags_are_seen(raw("plk-a", stamped), raw("plk-b", config));
        let every_ether_type = RawConfig {
            every_ether_type: true,
            ..config
        };
        tags_are_seen(raw("plk-a", stamped), raw("plk-b", every_ether_type));
    }

    tags_are_left_out(raw("plk-a", stamped), PnetLink::open("plk-b", 0).unwrap());

    overflow(raw("plk-a", stamped), |ring_frames| {
        raw("plk-b", RawConfig { ring_frames, ..stamped })
    });
    every_ether_type(
        raw("plk-a", stamped),
        raw(
            "plk-b",
            RawConfig {
                every_ether_type: true,
                ..stamped
            },
        ),
    );
    oversize(raw("plk-a", stamped), |config| raw("plk-b", config));
    a_refused_ring_is_no_reason_to_fail();

    let mut links: Vec<Box<dyn Link>> = vec![
        Box::new(raw("plk-a", stamped)),
        Box::new(raw("plk-a", by_calls)),
        Box::new(PnetLink::open("plk-a", 20_000).unwrap()),
    ];
    let mut waiting = raw("plk-a", stamped);
    assert!(ip("link set plk-a down"));
    // Each is told once by an error: at the next look or wait.
    let mut buffer = [0; FRAME_LEN_MAX];
    let soon_ns = waiting.now_ns() + 5_000_000_000;
    assert_eq!(waiting.receive(&mut buffer, soon_ns), Err(LinkError::Down));
    for link in &mut links {
        assert_eq!(link.receive(&mut buffer, 0), Err(LinkError::Down));
        assert_eq!(link.receive(&mut buffer, 0), Ok(None));
        assert_eq!(link.send(&frame(1, 60)), Err(LinkError::Down));
    }
    assert!(ip("link set plk-a up"));
    let mut b = raw("plk-b", stamped);
    b.send(&frame(2, 60)).unwrap();
    for link in &mut links {
        assert_eq!(
            next(link.as_mut(), &mut buffer).map(|received| received.length),
            Some(60)
        );
    }
}

/// A POWERLINK frame with a number in it.
fn frame(number: u8, len: usize) -> Vec<u8> {
    let mut octets = vec![number; len];
    octets[..6].copy_from_slice(&[0x01, 0x11, 0x1E, 0, 0, 1]);
    octets[6..12].copy_from_slice(&[2, 0, 0, 0, 0, 0xF0]);
    octets[12..14].copy_from_slice(&[0x88, 0xAB]);
    octets
}

fn next(link: &mut (impl Link + ?Sized), buffer: &mut [u8]) -> Option<Received> {
    let deadline_ns = link.now_ns() + 2_000_000_000;
    link.receive(buffer, deadline_ns).unwrap()
}

/// Everything a link promises, in both directions.
fn exchange(name: &str, mut a: impl Link, mut b: impl Link, b_stamps: bool) {
    let mut buffer = [0; FRAME_LEN_MAX];
    for (number, len) in [(1, 60), (2, 36), (3, FRAME_LEN_MAX), (4, 61)] {
        a.send(&frame(number, len)).unwrap();
        let received = next(&mut b, &mut buffer).unwrap_or_else(|| panic!("{name}: frame {number} did not arrive"));
        assert_eq!(buffer[..received.length], frame(number, len), "{name}");
        assert_eq!(received.stamp_ns.is_some(), b_stamps, "{name}");
    }
    // Many before the first is read, and in order.
    for number in 0..50 {
        b.send(&frame(number, 60)).unwrap();
    }
    for number in 0..50 {
        let received = next(&mut a, &mut buffer).unwrap();
        assert_eq!(buffer[..received.length], frame(number, 60), "{name}");
    }
    // Not POWERLINK: never delivered, nor is what one sent oneself.
    let mut foreign = frame(9, 60);
    foreign[12..14].copy_from_slice(&[0x08, 0x00]);
    a.send(&foreign).unwrap();
    a.send(&frame(10, 60)).unwrap();
    assert_eq!(
        next(&mut b, &mut buffer).map(|received| buffer[received.length - 1]),
        Some(10),
        "{name}"
    );
    assert_eq!(
        a.receive(&mut buffer, 0),
        Ok(None),
        "{name}: a deadline in the past only looks"
    );
    let soon_ns = a.now_ns() + 3_000_000;
    assert_eq!(a.receive(&mut buffer, soon_ns), Ok(None), "{name}");
    assert!(a.now_ns() >= soon_ns, "{name}: came back before the deadline");
    for length in [0, 13, FRAME_LEN_MAX + 1] {
        let refused = Err(LinkError::FrameLength {
            got: length,
            max: FRAME_LEN_MAX,
        });
        assert_eq!(a.send(&vec![0; length]), refused, "{name}");
    }
}

/// Frames of another network on the same cable, by their tags.
const TAGS: [[u8; 4]; 3] = [
    [0x81, 0x00, 0x00, 0x05],
    // A priority and no network.
    [0x81, 0x00, 0xE0, 0x00],
    [0x88, 0xA8, 0x0F, 0xFE],
];

fn tagged(number: u8, tag: [u8; 4]) -> Vec<u8> {
    let mut tagged = frame(number, 60);
    tagged.splice(12..12, tag);
    tagged
}

/// They arrive with the VLAN tag that they had on the wire.
fn tags_are_seen(mut a: impl Link, mut b: impl Link) {
    let mut buffer = [0; FRAME_LEN_MAX];
    for (number, tag) in (1..).zip(TAGS) {
        a.send(&tagged(number, tag)).unwrap();
        a.send(&frame(number, 60)).unwrap();
        for expected in [tagged(number, tag), frame(number, 60)] {
            let received = next(&mut b, &mut buffer).unwrap();
            assert_eq!(buffer[..received.length], expected);
        }
    }
}

/// Or not at all: without its tag such a frame would pass for one of this network.
fn tags_are_left_out(mut a: impl Link, mut b: impl Link) {
    let mut buffer = [0; FRAME_LEN_MAX];
    for (number, tag) in (1..).zip(TAGS) {
        a.send(&tagged(number, tag)).unwrap();
        a.send(&frame(number + 100, 60)).unwrap();
        let received = next(&mut b, &mut buffer).unwrap();
        assert_eq!(buffer[..received.length], frame(number + 100, 60));
    }
    assert_eq!(b.receive(&mut buffer, 0), Ok(None));
}

fn realtime_ns() -> u64 {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    now.unwrap().as_nanos() as u64
}

/// A frame that waits to be read carries the time at which it came, not that of reading it. The first frame after opening
/// is where a stamp of reading would appear: the kernel switches stamping on late.
fn stamps_are_of_the_arrival(mut a: RawLink, mut b: RawLink) {
    let mut buffer = [0; FRAME_LEN_MAX];
    for number in 0..5 {
        let before_ns = realtime_ns();
        a.send(&frame(number, 60)).unwrap();
        // A veth delivers within `send`, or a moment later by another thread.
        let sent_ns = realtime_ns();
        std::thread::sleep(std::time::Duration::from_millis(5));
        let stamp_ns = next(&mut b, &mut buffer).unwrap().stamp_ns.unwrap();
        assert_eq!(buffer[20], number);
        let read_ns = realtime_ns();
        assert!(read_ns - sent_ns >= 5_000_000);
        assert!(
            (before_ns..read_ns - 4_000_000).contains(&stamp_ns),
            "{}: frame {number} sent from {before_ns} to {sent_ns}, read at {read_ns}, stamped {stamp_ns}",
            b.reception()
        );
    }
}

/// More frames than find room: the first are delivered in order, the others counted, and later ones arrive again.
fn overflow(mut a: RawLink, open_b: impl Fn(usize) -> RawLink) {
    let mut b = open_b(4);
    let &Reception::Ring { frames } = b.reception() else {
        panic!("{}", b.reception());
    };
    let mut buffer = [0; FRAME_LEN_MAX];
    assert_eq!(b.dropped(), Ok(0));
    for round in 1..=3 {
        let sent = frames as u8 + 5;
        for number in 0..sent {
            a.send(&frame(number, 60)).unwrap();
        }
        for number in 0..frames as u8 {
            let received = next(&mut b, &mut buffer).unwrap();
            assert_eq!(buffer[..received.length], frame(number, 60));
        }
        assert_eq!(b.receive(&mut buffer, 0), Ok(None));
        assert_eq!(b.dropped(), Ok(5 * round));
    }
}

fn every_ether_type(mut a: RawLink, mut b: RawLink) {
    let mut buffer = [0; FRAME_LEN_MAX];
    let mut ip = frame(1, 98);
    ip[12..14].copy_from_slice(&[0x08, 0x00]);
    for frame in [&ip, &frame(2, 60)] {
        a.send(frame).unwrap();
        let received = next(&mut b, &mut buffer).unwrap();
        assert_eq!(buffer[..received.length], **frame);
    }
    assert_eq!(b.receive(&mut buffer, 0), Ok(None));
}

/// A frame longer than the buffer is cut, also one that is longer than Ethernet allows and than a place of the ring.
fn oversize(mut a: RawLink, open_b: impl Fn(RawConfig) -> RawLink) {
    assert!(ip("link set plk-a mtu 9000") && ip("link set plk-b mtu 9000"));
    let by_calls = RawConfig {
        ring_frames: 0,
        ..RawConfig::default()
    };
    let mut links: Vec<Box<dyn Link>> = vec![
        Box::new(open_b(RawConfig::default())),
        Box::new(open_b(by_calls)),
        Box::new(PnetLink::open("plk-b", 0).unwrap()),
    ];
    let long = frame(7, 4000);
    send_any_length("plk-a", &long);
    for (at, link) in links.iter_mut().enumerate() {
        let mut buffer = [0; FRAME_LEN_MAX];
        let received = next(link.as_mut(), &mut buffer).unwrap_or_else(|| panic!("link {at}"));
        assert_eq!(received.length, FRAME_LEN_MAX, "link {at}");
        assert_eq!(buffer, long[..FRAME_LEN_MAX], "link {at}");
    }
    a.send(&frame(8, 60)).unwrap();
    for link in &mut links {
        let mut short = [0; 20];
        assert_eq!(
            next(link.as_mut(), &mut short).map(|received| received.length),
            Some(20)
        );
        assert_eq!(short, frame(8, 60)[..20]);
    }
    assert!(ip("link set plk-a mtu 1500") && ip("link set plk-b mtu 1500"));
}

/// Sends past our links, which refuse what is no Ethernet frame.
fn send_any_length(interface: &str, frame: &[u8]) {
    use pnet::datalink::{self, Channel};
    let found = datalink::interfaces().into_iter().find(|found| found.name == interface);
    let config = datalink::Config {
        write_buffer_size: frame.len(),
        promiscuous: false,
        ..datalink::Config::default()
    };
    let Ok(Channel::Ethernet(mut sender, _)) = datalink::channel(&found.unwrap(), config) else {
        panic!("no channel to {interface}");
    };
    sender.send_to(frame, None).unwrap().unwrap();
}

/// A limit of memory that the ring does not fit into: the link works without it and says why.
fn a_refused_ring_is_no_reason_to_fail() {
    use nix::sys::resource::{Resource, getrlimit, setrlimit};
    let (soft, hard) = getrlimit(Resource::RLIMIT_AS).unwrap();
    let pages: u64 = std::fs::read_to_string("/proc/self/statm")
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    // Room for what the test itself needs, not for 64 MiB.
    setrlimit(Resource::RLIMIT_AS, pages * 4096 + (16 << 20), hard).unwrap();
    let ring_frames = 32 * 1024;
    let opened = RawLink::open(
        "plk-b",
        RawConfig {
            ring_frames,
            receive_stamps: true,
            ..RawConfig::default()
        },
    );
    setrlimit(Resource::RLIMIT_AS, soft, hard).unwrap();
    let b = opened.unwrap();
    let Reception::Calls { why } = b.reception() else {
        panic!("{}", b.reception());
    };
    assert!(why.contains("mapping the ring") && why.contains("memory"), "{why}");
    exchange(
        "no ring",
        RawLink::open("plk-a", RawConfig::default()).unwrap(),
        b,
        true,
    );
}
