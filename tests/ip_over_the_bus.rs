//! A node of the bus answers a ping: IP frames in the asynchronous slot, through TAP devices on both sides.
//!
//! Two network namespaces with a wire between them: in one the control runs a part program, in the other the simulated
//! machine, whose node 1 has an address on a TAP device. This program has no test harness, for a namespace is entered by
//! a process of one thread. Where the system refuses namespaces or TAP devices it prints the reason and passes.

use isocnc::host::netns::{give_interface, private_namespace, private_wire, start_interface};
use nix::errno::Errno;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::Ipv4Addr;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Instant;
use testing::PATIENCE;

const ROLE: &str = "ISOCNC_TEST_IP_ROLE";
const ISOCNC: &str = env!("CARGO_BIN_EXE_isocnc");
const NODE: Ipv4Addr = Ipv4Addr::new(192, 168, 100, 1);
const PINGS: u16 = 5;

pub(crate) fn main() {
    match std::env::var(ROLE).as_deref() {
        Ok("near") => near(),
        Ok("far") => far(),
        _ => {
            if !Path::new("/dev/net/tun").exists() {
                println!("ip_over_the_bus ... SKIPPED: there is no /dev/net/tun");
                return;
            }
            let output = again("near").output().unwrap();
            let said = String::from_utf8_lossy(&output.stdout);
            print!("{said}");
            eprint!("{}", String::from_utf8_lossy(&output.stderr));
            assert!(output.status.success());
            assert!(said.contains("ip_over_the_bus ... "));
        }
    }
}

fn again(role: &str) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.env(ROLE, role);
    command
}

/// Ends a process with this value.
struct Ending(Child);

impl Drop for Ending {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The side of the control, and the one who pings.
fn near() {
    let skipped = |why: &dyn std::fmt::Display| println!("ip_over_the_bus ... SKIPPED: {why}");
    if let Err(error) = private_wire("plk0", "plk1") {
        return skipped(&error);
    }
    let mut far = again("far")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(far.stdout.take().unwrap());
    let mut tell = far.stdin.take().unwrap();
    let pid = far.id();
    let _far = Ending(far);
    if line(&mut said) != "in a namespace" {
        return skipped(&"no second namespace");
    }
    give_interface("plk1", pid).unwrap();
    tell.write_all(b"go\n").unwrap();
    let ready = line(&mut said);
    if ready.starts_with("SKIPPED") {
        return skipped(&ready);
    }
    assert_eq!(ready, "ready");

    let folder = tempfile::tempdir().unwrap();
    let machine = folder.path().join("machine.toml");
    std::fs::write(&machine, machine_file(true)).unwrap();
    let mut run = Command::new(ISOCNC);
    // Without a program, so that it does not end before it is asked.
    run.arg("run")
        .arg(&machine)
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    let mut run = Ending(run.spawn().unwrap());
    let socket = ping_socket().unwrap();
    let began = Instant::now();
    let mut answered = 0;
    while answered < PINGS {
        if let Some(status) = run.0.try_wait().unwrap() {
            let mut text = String::new();
            run.0.stderr.take().unwrap().read_to_string(&mut text).unwrap();
            if text.contains("TAP device") {
                return skipped(&text);
            }
            panic!("the control ended ({status}) with {answered} of {PINGS} pings answered: {text}");
        }
        assert!(began.elapsed() < PATIENCE, "{answered} of {PINGS} pings were answered");
        if ping(&socket, answered).unwrap_or(false) {
            answered += 1;
        }
    }
    println!("ip_over_the_bus ... ok, {answered} pings answered by {NODE} through the asynchronous slot");
}

/// The side of the simulated machine.
fn far() {
    let mut input = BufReader::new(std::io::stdin());
    if let Err(error) = private_namespace() {
        println!("{error}");
        return;
    }
    println!("in a namespace");
    assert_eq!(line(&mut input), "go");
    start_interface("plk1").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let machine = folder.path().join("machine.toml");
    std::fs::write(&machine, machine_file(false)).unwrap();
    let mut simulate = Command::new(ISOCNC);
    simulate
        .arg("simulate")
        .arg(&machine)
        .args(["--interface", "plk1", "--tap", "node1", "--tap-node", "1"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut simulate = Ending(simulate.spawn().unwrap());
    let first = line(&mut BufReader::new(simulate.0.stdout.take().unwrap()));
    if first != "ready" {
        let mut text = String::new();
        simulate.0.stderr.take().unwrap().read_to_string(&mut text).unwrap();
        println!("SKIPPED {}", text.replace('\n', " "));
        return;
    }
    println!("ready");
    // The other side has gone when this ends.
    let _ = line(&mut input);
}

fn line(from: &mut impl BufRead) -> String {
    let mut text = String::new();
    from.read_line(&mut text).unwrap();
    text.trim_end().to_owned()
}

/// The demo machine on the wire of this test, with every way to exchange process data.
fn machine_file(with_tap: bool) -> String {
    let demo = include_str!("../configs/mill3-demo.toml");
    let tap = if with_tap { "\ntap = \"isoplk\"" } else { "" };
    let (head, tail) = demo.split_once("[bus]").unwrap();
    let (bus, nodes) = tail.split_once("[[bus.node]]").unwrap();
    let bus: String = bus
        .lines()
        .map(|line| {
            if line.starts_with("interface") {
                "interface = \"plk0\""
            } else {
                line
            }
        })
        .map(|line| format!("{line}\n"))
        .collect();
    let head = head.replace("mill3-demo\"", "ip-over-the-bus\"");
    let mut nodes = nodes.to_owned();
    for (name, exchange) in [
        ("y-drive", "chained = true"),
        ("z-drive", "chained = true"),
        ("io", "multiplex = 2"),
    ] {
        let line = format!("name = \"{name}\"\n");
        assert!(nodes.contains(&line));
        nodes = nodes.replacen(&line, &format!("{line}{exchange}\n"), 1);
    }
    let bus = format!("\nmultiplex_cycles = 4{bus}");
    format!("{head}[bus]{tap}{bus}[[bus.node]]{nodes}")
}

fn ping_socket() -> Result<OwnedFd, Errno> {
    // SAFETY: takes three numbers and touches no memory.
    let fd =
        Errno::result(unsafe { libc::socket(libc::AF_INET, libc::SOCK_RAW | libc::SOCK_CLOEXEC, libc::IPPROTO_ICMP) })?;
    // SAFETY: the descriptor has just been made and belongs to nobody else.
    let socket = unsafe { OwnedFd::from_raw_fd(fd) };
    let patience = nix::sys::time::TimeVal::new(0, 500_000);
    nix::sys::socket::setsockopt(&socket, nix::sys::socket::sockopt::ReceiveTimeout, &patience)?;
    Ok(socket)
}

/// One echo request; whether its answer came within half a second.
fn ping(socket: &OwnedFd, sequence: u16) -> Result<bool, Errno> {
    use nix::sys::socket::{MsgFlags, SockaddrIn, recv, sendto};
    let mut request = [0; 40];
    request[0] = 8; // echo request
    request[4..6].copy_from_slice(&0x1507_u16.to_be_bytes());
    request[6..8].copy_from_slice(&sequence.to_be_bytes());
    request[8..].fill(0x5A);
    let sum = request.chunks_exact(2).fold(0_u32, |sum, pair| {
        sum + u32::from(u16::from_be_bytes([pair[0], pair[1]]))
    });
    let folded = (sum & 0xFFFF) + (sum >> 16);
    request[2..4].copy_from_slice(&(!(folded as u16)).to_be_bytes());
    let [a, b, c, d] = NODE.octets();
    sendto(
        socket.as_raw_fd(),
        &request,
        &SockaddrIn::new(a, b, c, d, 0),
        MsgFlags::empty(),
    )?;
    let mut packet = [0; 1500];
    loop {
        let length = recv(socket.as_raw_fd(), &mut packet, MsgFlags::empty())?;
        // An IPv4 header of 20 octets, then echo reply (0) with our id and number.
        let answer = packet[..length].get(20..);
        let ours = |answer: &[u8]| answer[0] == 0 && answer[4..8] == request[4..8] && answer[8..] == request[8..];
        if answer.is_some_and(|answer| answer.len() == request.len() && ours(answer)) {
            return Ok(packet[12..16] == NODE.octets());
        }
    }
}
