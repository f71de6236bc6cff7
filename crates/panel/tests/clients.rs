//! Clients that do not read, many clients, and the end of the control: the panel with a control of its own kind behind it.

use panel::{Control, Counts, Guest, Listener, Settings, serve};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What the control does with each client.
#[derive(Clone, Copy)]
enum Fake {
    /// Tells the same again and again as soon as it reads.
    Talks,
    /// Says what it hears.
    Echoes,
    /// Tells a state of the usual length 20 times a second, with its number.
    Ticks,
}

/// Octets of a state of a mill as it is told.
const STATE: usize = 600;
/// Between two of them.
const TICK: Duration = Duration::from_millis(50);

impl Control for Fake {
    fn connect(&self, _guest: &Guest) -> io::Result<UnixStream> {
        let (inside, outside) = UnixStream::pair()?;
        let what = *self;
        std::thread::spawn(move || {
            let mut lines = BufReader::new(inside.try_clone().unwrap());
            let mut inside = inside;
            let told = format!("{{\"told\":\"{}\"}}\n", "x".repeat(1000));
            let mut line = String::new();
            match what {
                Fake::Talks => while inside.write_all(told.as_bytes()).is_ok() {},
                Fake::Ticks => {
                    let text = "x".repeat(STATE);
                    let mut number = 0_u64;
                    // As the control does: a client that does not read is told less often, and nobody waits for it.
                    inside.set_nonblocking(true).unwrap();
                    loop {
                        match inside.write(format!("{{\"n\":{number},\"text\":\"{text}\"}}\n").as_bytes()) {
                            Ok(count) => assert!(count > STATE, "a part of a line"),
                            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                            Err(_) => return,
                        }
                        number += 1;
                        std::thread::sleep(TICK);
                    }
                }
                Fake::Echoes => {}
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
fn beside(fake: Fake, clients: impl FnOnce(SocketAddr, &Counts, UnixStream)) {
    let listener = Listener::bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let address = listener.address();
    let counts = Arc::new(Counts::default());
    let (stays, until) = UnixStream::pair().unwrap();
    let (counting, control) = (Arc::clone(&counts), Arc::new(fake));
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
    beside(Fake::Talks, |address, counts, _stays| {
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
    beside(Fake::Echoes, |address, counts, stays| {
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

/// PANEL_S: so many seconds; ten minutes are a proof, a few seconds find what grows with each message.
#[test]
fn fifty_clients_at_20_hz_hear_everything_in_order_and_in_flat_memory() {
    const CLIENTS: usize = 50;
    let told = std::env::var("PANEL_S").ok().and_then(|text| text.parse().ok());
    let messages = told.unwrap_or(8_u64) * 20;
    beside(Fake::Ticks, |address, counts, _stays| {
        let read = |mut stream: TcpStream, messages: u64, first: u64| {
            std::thread::spawn(move || {
                for number in first..first + messages {
                    let payload = loop {
                        match frame(&mut stream) {
                            (1, payload) => break payload,
                            // A sign of life is asked for: an answer without payload, masked.
                            (9, _) => stream.write_all(&[0x8A, 0x80, 0, 0, 0, 0]).unwrap(),
                            (kind, _) => panic!("a frame of kind {kind}"),
                        }
                    };
                    let wanted = format!("{{\"n\":{number},");
                    assert!(payload.starts_with(wanted.as_bytes()), "{wanted} was expected");
                }
                stream
            })
        };
        // Nobody reads these.
        let deaf: Vec<TcpStream> = (0..2).map(|_| open(address)).collect();
        let all: Vec<TcpStream> = (0..CLIENTS).map(|_| open(address)).collect();
        let join = |reading: Vec<std::thread::JoinHandle<TcpStream>>| -> Vec<TcpStream> {
            reading.into_iter().map(|reader| reader.join().unwrap()).collect()
        };
        // Buffers have found their size after a quarter.
        let all = join(all.into_iter().map(|stream| read(stream, messages / 4, 0)).collect());
        let before = resident_octets();
        let rest = messages - messages / 4;
        let all = join(
            (all.into_iter())
                .map(|stream| read(stream, rest, messages / 4))
                .collect(),
        );
        let grown = resident_octets().saturating_sub(before);
        let [sent, slow] = [CLIENTS as u64 * messages, counts.slow_dropped()];
        println!(
            "{CLIENTS} clients, {sent} messages in {} s: {grown} octets more, {slow} dropped as they did not read",
            messages / 20
        );
        assert!(grown < 4 << 20, "{grown} octets more");
        // After 15 s of nothing, which a few seconds are only on a busy PC.
        let dropped = slow + counts.silent_dropped();
        assert!(dropped <= 2, "{dropped} were dropped, of which two did not read");
        if messages > 20 * 30 {
            assert_eq!(dropped, 2);
            assert_eq!(
                counts.clients(),
                CLIENTS as u64,
                "those that read are there, and no others"
            );
        }
        drop((all, deaf));
    });
}
