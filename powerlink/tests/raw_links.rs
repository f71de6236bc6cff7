//! Both links to a real interface over a veth pair, held against each other.
//!
//! The tests need a network namespace of their own and the `ip` command to make the pair; where either is missing they
//! print why and pass. The namespace is entered by a child process, this test binary started again.
#![cfg(all(feature = "pnet", target_os = "linux"))]

use std::os::unix::process::CommandExt;
use std::process::Command;

use powerlink::link::pnet::PnetLink;
use powerlink::link::raw::{RawConfig, RawLink};
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
        .args(["--exact", "both_links_carry_the_same_frames", "--nocapture"])
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

    let (a, b) = (
        RawLink::open("plk-a", stamped).unwrap(),
        RawLink::open("plk-b", stamped).unwrap(),
    );
    assert_eq!((a.mac(), b.mac()), ([2, 0, 0, 0, 0, 0xF0], [2, 0, 0, 0, 0, 1]));
    exchange("raw, raw", a, b, true);
    exchange(
        "raw, pnet",
        RawLink::open("plk-a", spinning).unwrap(),
        PnetLink::open("plk-b").unwrap(),
        false,
    );
    exchange(
        "pnet, raw",
        PnetLink::open("plk-a").unwrap(),
        RawLink::open("plk-b", stamped).unwrap(),
        true,
    );

    let mut a = RawLink::open("plk-a", stamped).unwrap();
    assert!(ip("link set plk-a down"));
    // The socket is told once by an error at the next look.
    let mut buffer = [0; FRAME_LEN_MAX];
    let told = a.receive(&mut buffer, 0);
    assert_eq!(told, Err(LinkError::Down));
    assert_eq!(a.send(&frame(1, 60)), Err(LinkError::Down));
}

/// A POWERLINK frame with a number in it.
fn frame(number: u8, len: usize) -> Vec<u8> {
    let mut octets = vec![number; len];
    octets[..6].copy_from_slice(&[0x01, 0x11, 0x1E, 0, 0, 1]);
    octets[6..12].copy_from_slice(&[2, 0, 0, 0, 0, 0xF0]);
    octets[12..14].copy_from_slice(&[0x88, 0xAB]);
    octets
}

fn next(link: &mut impl Link, buffer: &mut [u8]) -> Option<Received> {
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
