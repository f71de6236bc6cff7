//! SDO frames as they stand on the wire: fixed octets that tshark 4.0 (dissector `epl`) has confirmed, and, where tshark is
//! installed, its word on the whole session, over ASnd and over UDP.

use std::process::Command;

use obd::{DataType, Dictionary, EntryDef};
use powerlink::link::pcap::PcapWriter;
use powerlink::sdo::command::Address;
use powerlink::sdo::datagram::{DATAGRAM_MAX, Datagram, UDP_PORT};
use powerlink::sdo::multiple::{BlockWriter, emit_addresses};
use powerlink::sdo::{Client, SERVICE_DATA_MAX, Server, Timing};
use powerlink::wire::{Asnd, FRAME_LEN_MAX, Header, multicast};

const MN: u8 = 240;
const CN: u8 = 1;
const TABLE: &[EntryDef] = &[
    EntryDef::rws(0x1006, DataType::U32, "NMT_CycleLen_U32").default(1000),
    EntryDef::ro(0x1018, DataType::U32, "Identity").subs(1, 4).default(7),
    EntryDef::rw(0x2000, DataType::Domain, "Blob").capacity(2000),
];

/// A client, a server, and what they said: whether the client spoke, and the service data.
struct Session {
    client: Client,
    server: Server,
    objects: Box<Dictionary<8, 2100>>,
    now_ns: u64,
    frames: Vec<(bool, Vec<u8>)>,
}

impl Session {
    fn new() -> Session {
        Session {
            client: Client::new(Timing::default()),
            server: Server::new(),
            objects: Box::new(Dictionary::new(&[TABLE]).unwrap()),
            now_ns: 0,
            frames: Vec::new(),
        }
    }

    /// Runs a command that was started, one frame a millisecond from each side; returns the frames it took.
    fn run(&mut self, value: &[u8]) -> Vec<(bool, Vec<u8>)> {
        let (first, mut sink, mut out) = (self.frames.len(), [0; 2048], [0; SERVICE_DATA_MAX]);
        while self.client.result().is_none() {
            self.now_ns += 1_000_000;
            if let Some(len) = self.client.poll_transmit(self.now_ns, value, &mut out) {
                self.frames.push((true, out[..len].to_vec()));
                self.server.receive(MN, &out[..len], &mut *self.objects);
            }
            if let Some((_, len)) = self.server.poll_transmit(&mut out) {
                self.frames.push((false, out[..len].to_vec()));
                self.client.receive(self.now_ns, &out[..len], &mut sink);
            }
            assert!(self.frames.len() < 1000, "no end");
        }
        self.frames[first..].to_vec()
    }
}

fn at(index: u16, sub: u8) -> Address {
    Address { index, sub }
}

/// Everything the server can do, and a few refusals. The commands for several objects are long enough to need no padding: the
/// dissector takes padding for further objects.
fn session() -> Session {
    let mut session = Session::new();
    let value: Vec<u8> = (0..900_u32).map(|at| at as u8).collect();
    session.client.start_write(0x2000, 0, value.len()).unwrap();
    session.run(&value);
    session.client.start_read(0x2000, 0).unwrap();
    session.run(&[]);
    session.client.start_read(0x3000, 0).unwrap();
    session.run(&[]);
    let mut request = [0; 600];
    let mut blocks = BlockWriter::new(&mut request);
    assert!(blocks.push(at(0x2000, 0), &[9; 5]));
    assert!((1..=4).all(|sub| blocks.push(at(0x1018, sub), &[1, 2, 3, 4])));
    let len = blocks.len();
    session.client.start_write_multiple(len).unwrap();
    session.run(&request[..len]);
    let objects = [0x1006, 0x3000, 0x2000, 0x1006, 0x3001, 0x2000, 0x1006, 0x3002];
    let len = emit_addresses(objects.map(|index| at(index, 0)), &mut request).unwrap();
    session.client.start_read_multiple(len).unwrap();
    session.run(&request[..len]);
    session
}

#[test]
fn segments_as_octets() {
    let mut session = Session::new();
    let value: Vec<u8> = (0..600_u32).map(|at| at as u8).collect();
    session.client.start_write(0x2000, 0, value.len()).unwrap();
    let frames = session.run(&value);
    let commands: Vec<_> = frames.iter().filter(|(_, octets)| octets[7] != 0).collect();
    let heads: Vec<_> = commands
        .iter()
        .map(|(_, octets)| &octets[..20.min(octets.len())])
        .collect();
    // Sequence header; command header; in the first segment the total size, 600 + 8, and the address; then the value.
    assert_eq!(
        heads[0],
        [
            0x02, 0x06, 0, 0, 0, 1, 0x10, 1, 0, 1, 0, 0, 0x60, 2, 0, 0, 0x00, 0x20, 0, 0
        ]
    );
    assert_eq!(
        heads[1],
        [
            0x02, 0x0A, 0, 0, 0, 1, 0x20, 1, 0, 1, 0, 0, 248, 249, 250, 251, 252, 253, 254, 255
        ]
    );
    assert_eq!(
        heads[2],
        [
            0x02, 0x0E, 0, 0, 0, 1, 0x30, 1, 96, 0, 0, 0, 248, 249, 250, 251, 252, 253, 254, 255
        ]
    );
    assert_eq!(heads[3], [0x0E, 0x06, 0, 0, 0, 1, 0x80, 1, 0, 0, 0, 0]);
    assert_eq!(heads.len(), 4);
    assert_eq!(commands[2].1.len(), 12 + 96);

    session.client.start_read(0x2000, 0).unwrap();
    let frames = session.run(&[]);
    let answers: Vec<_> = frames
        .iter()
        .filter(|(asks, _)| !asks)
        .map(|(_, octets)| &octets[..18])
        .collect();
    assert_eq!(
        answers[0],
        [0x12, 0x0A, 0, 0, 0, 2, 0x90, 2, 0, 1, 0, 0, 0x5C, 2, 0, 0, 0, 1]
    );
    assert_eq!(
        answers[1],
        [0x12, 0x0E, 0, 0, 0, 2, 0xA0, 2, 0, 1, 0, 0, 252, 253, 254, 255, 0, 1]
    );
    assert_eq!(
        answers[2],
        [0x12, 0x12, 0, 0, 0, 2, 0xB0, 2, 92, 0, 0, 0, 252, 253, 254, 255, 0, 1]
    );
    assert_eq!(answers.len(), 3);
}

#[test]
fn several_objects_as_octets() {
    let mut session = Session::new();
    let mut request = [0; 600];
    let mut blocks = BlockWriter::new(&mut request);
    assert!(blocks.push(at(0x1006, 0), &2000_u32.to_le_bytes()) && blocks.push(at(0x1018, 1), &[1, 2, 3, 4]));
    assert!(blocks.push(at(0x2000, 0), &[9; 5]));
    let len = blocks.len();
    session.client.start_write_multiple(len).unwrap();
    session.run(&request[..len]);
    let len = emit_addresses([at(0x1006, 0), at(0x3000, 1), at(0x2000, 0)], &mut request).unwrap();
    session.client.start_read_multiple(len).unwrap();
    session.run(&request[..len]);
    let commands: Vec<_> = session.frames.iter().filter(|(_, octets)| octets[7] > 2).collect();
    let expected: [&[u8]; 4] = [
        &[
            0, 1, 0, 0x31, 40, 0, 0, 0, // the next block lies 20 octets behind the command header
            20, 0, 0, 0, 0x06, 0x10, 0, 0, 0xD0, 7, 0, 0, //
            32, 0, 0, 0, 0x18, 0x10, 1, 0, 1, 2, 3, 4, //
            0, 0, 0, 0, 0x00, 0x20, 0, 3, 9, 9, 9, 9, 9, 0, 0, 0,
        ],
        &[0, 1, 0x80, 0x31, 8, 0, 0, 0, 0x18, 0x10, 1, 0x80, 0x02, 0, 1, 6],
        &[
            0, 2, 0, 0x32, 12, 0, 0, 0, 0x06, 0x10, 0, 0, 0x00, 0x30, 1, 0, 0x00, 0x20, 0, 0,
        ],
        &[
            0, 2, 0x80, 0x32, 40, 0, 0, 0, //
            20, 0, 0, 0, 0x06, 0x10, 0, 0, 0xD0, 7, 0, 0, //
            32, 0, 0, 0, 0x00, 0x30, 1, 0x80, 0, 0, 2, 6, //
            0, 0, 0, 0, 0x00, 0x20, 0, 3, 9, 9, 9, 9, 9, 0, 0, 0,
        ],
    ];
    let octets: Vec<_> = commands.iter().map(|(_, octets)| &octets[4..]).collect();
    assert_eq!(octets, expected);
}

/// An IPv4 datagram in an Ethernet frame; the UDP checksum is left out.
fn udp_frame(from_client: bool, payload: &[u8]) -> Vec<u8> {
    let (source, destination) = if from_client { (MN, CN) } else { (CN, MN) };
    let (source_port, destination_port) = if from_client {
        (50_000, UDP_PORT)
    } else {
        (UDP_PORT, 50_000)
    };
    let mut frame = vec![2, 0, 0, 0, 0, destination, 2, 0, 0, 0, 0, source, 0x08, 0x00];
    let mut ip = vec![0x45, 0];
    ip.extend((28 + payload.len() as u16).to_be_bytes());
    ip.extend([
        0,
        0,
        0,
        0,
        64,
        17,
        0,
        0,
        192,
        168,
        100,
        source,
        192,
        168,
        100,
        destination,
    ]);
    let sum: u32 = ip
        .chunks(2)
        .map(|word| u32::from(u16::from_be_bytes([word[0], word[1]])))
        .sum();
    let checksum = !((sum & 0xFFFF) + (sum >> 16)) as u16;
    ip[10..12].copy_from_slice(&checksum.to_be_bytes());
    frame.extend(ip);
    for word in [source_port, destination_port, 8 + payload.len() as u16, 0] {
        frame.extend(word.to_be_bytes());
    }
    frame.extend(payload);
    frame
}

fn asnd_frame(from_client: bool, service_data: &[u8]) -> Vec<u8> {
    let (source_node, destination_node) = if from_client { (MN, CN) } else { (CN, MN) };
    let header = Header {
        destination: multicast::ASND,
        source: [2, 0, 0, 0, 0, source_node],
        destination_node,
        source_node,
    };
    let mut frame = [0; FRAME_LEN_MAX];
    let len = Asnd::Sdo(service_data).emit(&header, &mut frame).unwrap();
    frame[..len].to_vec()
}

/// Has tshark read the frames, where it is installed, and expects that it finds SDO in each and no fault.
fn ask_tshark(name: &str, frames: &[Vec<u8>]) {
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let mut capture = PcapWriter::new(Vec::new()).unwrap();
    for (stamp_ms, frame) in (0..).zip(frames) {
        capture.write(stamp_ms * 1_000_000, frame).unwrap();
    }
    std::fs::write(&path, capture.finish().unwrap()).unwrap();
    let tshark = |filter: &str| {
        Command::new("tshark")
            .arg("-r")
            .arg(&path)
            .args(["-Y", filter])
            .output()
    };
    let Ok(wrong) = tshark("_ws.malformed or _ws.expert") else {
        println!("tshark is not installed: nothing to ask");
        return;
    };
    assert!(wrong.status.success(), "{}", String::from_utf8_lossy(&wrong.stderr));
    assert_eq!(
        String::from_utf8_lossy(&wrong.stdout),
        "",
        "malformed frames or expert items"
    );
    let decoded = tshark("epl.asnd.svid == 5").unwrap();
    let lines = String::from_utf8_lossy(&decoded.stdout).lines().count();
    assert_eq!(lines, frames.len(), "all frames are SDO");
}

#[test]
fn tshark_finds_nothing_wrong_over_asnd() {
    let frames: Vec<_> = session()
        .frames
        .iter()
        .map(|(from_client, service_data)| asnd_frame(*from_client, service_data))
        .collect();
    ask_tshark("sdo.pcap", &frames);
}

#[test]
fn tshark_finds_nothing_wrong_over_udp() {
    let frames: Vec<_> = session()
        .frames
        .iter()
        .map(|(from_client, service_data)| {
            let (source, destination) = if *from_client { (MN, CN) } else { (CN, MN) };
            let mut payload = [0; DATAGRAM_MAX];
            let datagram = Datagram {
                destination,
                source,
                service_data,
            };
            let len = datagram.emit(&mut payload).unwrap();
            udp_frame(*from_client, &payload[..len])
        })
        .collect();
    ask_tshark("sdo_udp.pcap", &frames);
}
