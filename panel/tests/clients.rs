//! Clients that do not read, many clients, and the end of the control: the panel with a control of its own kind behind it.

use panel::{Control, Counts, Guest, Listener, Settings, serve};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Tells each client the same again and again as soon as it reads, or echoes what it says.
struct Fake {
    is_talkative: bool,
}

impl Control for Fake {
    fn connect(&self, _guest: &Guest) -> io::Result<UnixStream> {
        let (inside, outside) = UnixStream::pair()?;
        let is_talkative = self.is_talkative;
        std::thread::spawn(move || {
            let mut lines = BufReader::new(inside.try_clone().unwrap());
            let mut inside = inside;
            let told = format!("{{\"told\":\"{}\"}}\n", "x".repeat(1000));
            let mut line = String::new();
            if is_talkative {
                while inside.write_all(told.as_bytes()).is_ok() {}
            }
            while lines.read_line(&mut line).is_ok_and(|count| count > 0) {
                if inside.write_all(line.as_bytes()).is_err() {
                    return;
                }
                line.clear();
            }
        });
        Ok(outside)
    }
}

/// Runs a panel beside `clients`.
fn beside(is_talkative: bool, clients: impl FnOnce(SocketAddr, &Counts, UnixStream)) {
    let listener = Listener::bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let address = listener.address();
    let counts = Arc::new(Counts::default());
    let (stays, until) = UnixStream::pair().unwrap();
    let (counting, control) = (Arc::clone(&counts), Arc::new(Fake { is_talkative }));
    let serving = std::thread::spawn(move || serve(listener, Settings::default(), control, counting, until));
    clients(address, &counts, stays);
    serving.join().unwrap().unwrap();
}

/// A WebSocket that does as little as a client may.
fn open(address: SocketAddr) -> TcpStream {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let request = format!(
        "GET /rpc HTTP/1.1\r\nHost: {address}\r\nOrigin: http://{address}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).unwrap();
    let (mut head, mut octet) = (Vec::new(), [0]);
    while !head.ends_with(b"\r\n\r\n") {
        stream.read_exact(&mut octet).unwrap();
        head.push(octet[0]);
    }
    let head = String::from_utf8(head).unwrap();
    // Of RFC 6455.
    assert!(
        head.starts_with("HTTP/1.1 101") && head.contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="),
        "{head}"
    );
    stream
}

/// A masked text frame.
fn send(stream: &mut TcpStream, text: &str) {
    assert!(text.len() < 126);
    let mut frame = vec![0x81, 0x80 | text.len() as u8, 0, 0, 0, 0];
    frame.extend(text.as_bytes());
    stream.write_all(&frame).unwrap();
}

/// Opcode and payload of a frame.
fn frame(stream: &mut TcpStream) -> (u8, Vec<u8>) {
    let mut head = [0; 2];
    stream.read_exact(&mut head).unwrap();
    let mut length = u64::from(head[1]);
    if length >= 126 {
        let mut octets = [0; 8];
        let from = if length == 126 { 6 } else { 0 };
        stream.read_exact(&mut octets[from..]).unwrap();
        length = u64::from_be_bytes(octets);
    }
    let mut payload = vec![0; length as usize];
    stream.read_exact(&mut payload).unwrap();
    (head[0] & 0xF, payload)
}

fn resident_octets() -> u64 {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap();
    4096 * statm.split(' ').nth(1).unwrap().parse::<u64>().unwrap()
}

#[test]
fn who_does_not_read_is_dropped_and_counted_in_bounded_memory() {
    beside(true, |address, counts, _stays| {
        let mut others: Vec<TcpStream> = (0..20).map(|_| open(address)).collect();
        let reading = others.pop().unwrap();
        let before = resident_octets();
        let reader = std::thread::spawn(move || {
            let mut stream = reading;
            (0..20_000).filter(|_| frame(&mut stream).0 == 1).count()
        });
        let give_up = Instant::now() + Duration::from_secs(60);
        while counts.slow_dropped() < 19 {
            assert!(Instant::now() < give_up, "{} were dropped", counts.slow_dropped());
            std::thread::sleep(Duration::from_millis(50));
        }
        assert!(reader.join().unwrap() > 10_000);
        let grown = resident_octets().saturating_sub(before);
        assert!(grown < 32 << 20, "{grown} octets more");
        assert_eq!(counts.slow_dropped(), 19);
    });
}

#[test]
fn each_of_fifty_is_a_client_of_its_own_and_hears_that_the_control_ends() {
    beside(false, |address, counts, stays| {
        let mut all: Vec<TcpStream> = (0..50).map(|_| open(address)).collect();
        for (number, stream) in all.iter_mut().enumerate() {
            send(stream, &format!("{{\"n\":{number}}}"));
        }
        for (number, stream) in all.iter_mut().enumerate() {
            let told = loop {
                let (kind, payload) = frame(stream);
                if kind == 1 {
                    break payload;
                }
            };
            assert_eq!(told, format!("{{\"n\":{number}}}").into_bytes());
        }
        assert_eq!(counts.clients(), 50);
        // Code 1001: going away.
        drop(stays);
        for stream in &mut all {
            let closing = loop {
                let (kind, payload) = frame(stream);
                if kind == 8 {
                    break payload;
                }
            };
            assert_eq!(closing[..2], 1001_u16.to_be_bytes());
        }
    });
}
