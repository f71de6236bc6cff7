//! Client and server over a channel that loses, repeats, delays and reorders frames, from a seed.

use std::vec;
use std::vec::Vec;

use obd::{AbortCode, Objects};
use proptest::prelude::*;

use super::client::{Client, ClientError, Timing};
use super::command::{self, Address};
use super::multiple::{self, BlockWriter, Blocks};
use super::{SERVICE_DATA_MAX, Server};

const MS: u64 = 1_000_000;
const MIB: usize = 1 << 20;
/// Room of the server for values that pass as a whole.
const STAGING: usize = 8192;
/// Passes as a whole.
const WHOLE: u16 = 0x2000;
/// Passes in parts.
const PARTS: u16 = 0x2001;
/// Can be read and written in no way.
const BROKEN: u16 = 0x2002;

/// Two objects and what was done to them.
#[derive(Default)]
struct Store {
    whole: Vec<u8>,
    parts: Vec<u8>,
    /// Parts that came, with the length announced.
    coming: Option<(usize, Vec<u8>)>,
    writes: u32,
    cancelled: u32,
    read_to: usize,
}

impl Store {
    fn value(&mut self, index: u16) -> &mut Vec<u8> {
        if index == WHOLE {
            &mut self.whole
        } else {
            &mut self.parts
        }
    }
}

impl Objects for Store {
    fn sdo_read(&mut self, index: u16, _: u8, out: &mut [u8]) -> Result<usize, AbortCode> {
        if index != WHOLE {
            return Err(AbortCode::NO_OBJECT);
        }
        let room = out.get_mut(..self.whole.len()).ok_or(AbortCode::OUT_OF_MEMORY)?;
        room.copy_from_slice(&self.whole);
        Ok(self.whole.len())
    }

    fn sdo_write(&mut self, index: u16, _: u8, value: &[u8]) -> Result<(), AbortCode> {
        if index == BROKEN {
            return Err(AbortCode::NO_OBJECT);
        }
        self.writes += 1;
        *self.value(index) = value.to_vec();
        Ok(())
    }

    fn sdo_read_parts(&mut self, index: u16, _: u8) -> Result<Option<usize>, AbortCode> {
        self.read_to = 0;
        match index {
            WHOLE => Ok(None),
            BROKEN => Ok(Some(1000)),
            _ => Ok(Some(self.parts.len())),
        }
    }

    fn sdo_read_part(&mut self, index: u16, _: u8, offset: usize, out: &mut [u8]) -> Result<(), AbortCode> {
        if index == BROKEN && offset > 0 {
            return Err(AbortCode::HARDWARE);
        }
        assert_eq!(offset, self.read_to, "parts in order, each once");
        self.read_to += out.len();
        if index == PARTS {
            out.copy_from_slice(&self.parts[offset..offset + out.len()]);
        }
        Ok(())
    }

    fn sdo_write_parts(&mut self, index: u16, _: u8, len: usize) -> Result<bool, AbortCode> {
        if index == PARTS {
            self.coming = Some((len, Vec::new()));
        }
        Ok(index == PARTS)
    }

    fn sdo_write_part(&mut self, _: u16, _: u8, offset: usize, part: &[u8]) -> Result<(), AbortCode> {
        let (_, octets) = self.coming.as_mut().expect("begun");
        assert_eq!(offset, octets.len(), "parts in order, each once");
        octets.extend(part);
        Ok(())
    }

    fn sdo_write_end(&mut self, _: u16, _: u8) -> Result<(), AbortCode> {
        let (len, octets) = self.coming.take().expect("begun");
        assert_eq!(len, octets.len());
        self.writes += 1;
        self.parts = octets;
        Ok(())
    }

    fn sdo_write_cancel(&mut self, _: u16, _: u8) {
        self.coming = None;
        self.cancelled += 1;
    }
}

/// xorshift64*; the same numbers for the same seed everywhere.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) % limit
    }

    fn octets(&mut self, len: usize) -> Vec<u8> {
        (0..len).map(|_| self.below(256) as u8).collect()
    }
}

/// What the channel does to each frame, in per mille and ms.
#[derive(Clone, Copy, Default)]
struct Faults {
    lost: u64,
    doubled: u64,
    delay_ms: u64,
}

struct Net {
    client: Client,
    server: Server<2, STAGING>,
    store: Store,
    random: Random,
    faults: Faults,
    now_ns: u64,
    /// Frames under way: when they arrive, whether at the server, and their octets.
    wire: Vec<(u64, bool, Vec<u8>)>,
    sent: Vec<(bool, Vec<u8>)>,
}

impl Net {
    fn new(seed: u64, faults: Faults) -> Net {
        Net {
            client: Client::new(Timing::default()),
            server: Server::new(),
            store: Store::default(),
            random: Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1),
            faults,
            now_ns: 0,
            wire: Vec::new(),
            sent: Vec::new(),
        }
    }

    fn send(&mut self, to_server: bool, frame: &[u8]) {
        self.sent.push((to_server, frame.to_vec()));
        let copies = if self.random.below(1000) < self.faults.lost {
            0
        } else if self.random.below(1000) < self.faults.doubled {
            2
        } else {
            1
        };
        for _ in 0..copies {
            let at_ns = self.now_ns + MS * self.random.below(self.faults.delay_ms + 1);
            self.wire.push((at_ns, to_server, frame.to_vec()));
        }
    }

    /// One millisecond: each side may send one frame, and what is due arrives.
    fn step(&mut self, value: &[u8], sink: &mut [u8]) {
        self.now_ns += MS;
        let mut out = [0xA5; SERVICE_DATA_MAX];
        if let Some(len) = self.client.poll_transmit(self.now_ns, value, &mut out) {
            self.send(true, &out[..len]);
        }
        self.deliver(sink);
        if let Some((client, len)) = self.server.poll_transmit(&mut out) {
            assert_eq!(client, 240);
            self.send(false, &out[..len]);
        }
        self.deliver(sink);
    }

    fn deliver(&mut self, sink: &mut [u8]) {
        let now_ns = self.now_ns;
        let (due, later) = core::mem::take(&mut self.wire)
            .into_iter()
            .partition::<Vec<_>, _>(|(at_ns, ..)| *at_ns <= now_ns);
        self.wire = later;
        for (_, to_server, frame) in due {
            if to_server {
                self.server.receive(240, &frame, &mut self.store);
            } else {
                self.client.receive(now_ns, &frame, sink);
            }
        }
    }

    fn run(&mut self, value: &[u8], sink: &mut [u8]) -> Result<usize, ClientError> {
        for _ in 0..400_000 {
            self.step(value, sink);
            if let Some(result) = self.client.result() {
                return result;
            }
        }
        panic!("no end");
    }

    fn write(&mut self, index: u16, value: &[u8]) -> Result<usize, ClientError> {
        self.client.start_write(index, 0, value.len())?;
        self.run(value, &mut [])
    }

    fn read(&mut self, index: u16) -> Result<Vec<u8>, ClientError> {
        let mut sink = vec![0xA5; MIB];
        self.client.start_read(index, 0)?;
        let len = self.run(&[], &mut sink)?;
        sink.truncate(len);
        Ok(sink)
    }

    /// No frame lives longer than this.
    fn calm_down(&mut self) {
        for _ in 0..100 {
            self.step(&[], &mut []);
        }
    }
}

#[test]
fn one_mebibyte_there_and_back() {
    let mut net = Net::new(1, Faults::default());
    let value = net.random.octets(MIB);
    assert_eq!(net.write(PARTS, &value), Ok(0));
    assert_eq!((net.store.writes, net.store.parts == value), (1, true));
    // Three frames to open it, and one for each segment.
    let sent = net.sent.iter().filter(|(to_server, _)| *to_server).count();
    assert_eq!(sent, 2 + command::segments(MIB + 4));
    net.sent.clear();
    assert!(net.read(PARTS).unwrap() == value);
    let answers = net.sent.iter().filter(|(to_server, _)| !to_server).count();
    assert_eq!(answers, command::segments(MIB));
    // The server's own buffer does not limit that, but it does limit values that pass as a whole.
    let longest = &value[..STAGING];
    assert_eq!(net.write(WHOLE, longest), Ok(0));
    assert_eq!(net.read(WHOLE).unwrap(), longest);
    let too_long = Err(ClientError::Aborted(AbortCode::OUT_OF_MEMORY));
    assert_eq!(net.write(WHOLE, &value[..STAGING + 1]), too_long);
    assert_eq!(net.read(WHOLE).unwrap(), longest);
}

#[test]
fn a_client_is_small_and_a_server_bounded() {
    // 239 clients live in a managing node.
    assert!(size_of::<Client>() <= 200, "{}", size_of::<Client>());
    // Two connections, each with its window of frames and its staging area.
    let connection = 5 * 272 + STAGING + 128;
    assert!(
        size_of::<Server<2, STAGING>>() <= 2 * connection,
        "{}",
        size_of::<Server<2, STAGING>>()
    );
}

#[test]
fn every_length_around_the_segment_boundaries() {
    let mut net = Net::new(2, Faults::default());
    for len in (0..8).chain(250..262).chain(500..520).chain(1270..1290) {
        for index in [WHOLE, PARTS] {
            let value = net.random.octets(len);
            assert_eq!(net.write(index, &value), Ok(0), "{len} octets");
            assert_eq!(net.read(index).unwrap(), value, "{len} octets");
        }
    }
}

#[test]
fn a_faulty_channel_changes_nothing() {
    let (mut failed, mut done) = (0, 0);
    for seed in 0..150 {
        let mut random = Random(seed + 1);
        let faults = Faults {
            lost: [0, 10, 50, 200, 500][random.below(5) as usize],
            doubled: random.below(200),
            delay_ms: random.below(15),
        };
        let mut net = Net::new(seed, faults);
        for round in 0..6 {
            let index = if random.below(2) == 0 { WHOLE } else { PARTS };
            let most = [4, 300, 3000, if index == WHOLE { 8000 } else { 100_000 }][random.below(4) as usize];
            let len = random.below(most) as usize;
            let value = random.octets(len);
            let place = std::format!("seed {seed}, round {round}, {index:04X}h, {} octets", value.len());
            let before = (net.store.writes, net.store.value(index).clone());
            match net.write(index, &value) {
                Ok(len) => {
                    assert_eq!((len, net.store.writes), (0, before.0 + 1), "{place}");
                    assert!(*net.store.value(index) == value, "{place}");
                    done += 1;
                }
                Err(ClientError::TimedOut { .. }) => {
                    let new = (before.0 + 1, value);
                    let now = (net.store.writes, net.store.value(index).clone());
                    assert!(now == before || now == new, "{place}: carried out once or not at all");
                    failed += 1;
                    net.calm_down();
                }
                Err(error) => panic!("{place}: {error}"),
            }
            match net.read(index) {
                Ok(read) => assert!(read == *net.store.value(index), "{place}"),
                Err(ClientError::TimedOut { .. }) => {
                    failed += 1;
                    net.calm_down();
                }
                Err(error) => panic!("{place}: {error}"),
            }
        }
    }
    assert!(
        done > 880 && failed < 20,
        "{done} writes done, {failed} commands failed"
    );
}

/// Sequence octets of the frames that one side has to send now.
fn sequences(net: &mut Net, from_client: bool, value: &[u8]) -> Vec<[u8; 2]> {
    let (mut out, mut sequences) = ([0; SERVICE_DATA_MAX], Vec::new());
    loop {
        let len = if from_client {
            net.client.poll_transmit(net.now_ns, value, &mut out)
        } else {
            net.server.poll_transmit(&mut out).map(|(_, len)| len)
        };
        let Some(len) = len else { return sequences };
        net.sent.push((from_client, out[..len].to_vec()));
        sequences.push([out[0], out[1]]);
    }
}

#[test]
fn the_window_and_the_repetition_of_what_is_missing_octet_by_octet() {
    let mut net = Net::new(8, Faults::default());
    net.write(PARTS, &[0; 4]).unwrap();
    // Client to server: five frames, the last asks for an acknowledge.
    let value = vec![7; 2000];
    net.client.start_write(PARTS, 0, value.len()).unwrap();
    net.sent.clear();
    let window = [[0x06, 0x0A], [0x06, 0x0E], [0x06, 0x12], [0x06, 0x16], [0x06, 0x1B]];
    assert_eq!(sequences(&mut net, true, &value), window);
    // The third one gets lost: the server has up to number 3 and says so once, though two frames came behind the gap.
    for at in [0, 1, 3] {
        let frame = net.sent[at].1.clone();
        net.server.receive(240, &frame, &mut net.store);
    }
    assert_eq!(sequences(&mut net, false, &[]), [[0x0F, 0x06]]);
    let missing = net.sent.last().unwrap().1.clone();
    net.client.receive(net.now_ns, &missing, &mut []);
    // Two have arrived, so two more may go. The last one repeated asks what the server has now.
    let again = [[0x06, 0x12], [0x06, 0x16], [0x06, 0x1B], [0x06, 0x1E], [0x06, 0x23]];
    assert_eq!(sequences(&mut net, true, &value), again);
    net.sent.drain(..6);
    for (_, frame) in core::mem::take(&mut net.sent) {
        net.server.receive(240, &frame, &mut net.store);
    }
    // Seven segments have come; the answer to the eighth acknowledges all.
    assert_eq!(
        net.store.coming.as_ref().map(|(_, octets)| octets.len()),
        Some(248 + 6 * 256)
    );
    assert_eq!(net.run(&value, &mut []), Ok(0));
    assert_eq!(net.store.parts, value);

    // Server to client: the same. The first frame gets lost.
    let mut sink = [0; 2000];
    net.client.start_read(PARTS, 0).unwrap();
    assert_eq!(sequences(&mut net, true, &[]), [[0x0A, 0x2A]]);
    let command = net.sent.last().unwrap().1.clone();
    net.server.receive(240, &command, &mut net.store);
    net.sent.clear();
    let window = [[0x2A, 0x0E], [0x2A, 0x12], [0x2A, 0x16], [0x2A, 0x1A], [0x2A, 0x1F]];
    assert_eq!(sequences(&mut net, false, &[]), window);
    for (_, frame) in net.sent.drain(1..4) {
        net.client.receive(net.now_ns, &frame, &mut sink);
    }
    assert_eq!(sequences(&mut net, true, &[]), [[0x0B, 0x2A]]);
    let missing = net.sent.last().unwrap().1.clone();
    net.server.receive(240, &missing, &mut net.store);
    assert_eq!(sequences(&mut net, false, &[]), window);
    // The client asks when nothing comes.
    net.now_ns += 50 * MS;
    assert_eq!(sequences(&mut net, true, &[]), [[0x0A, 0x2B]]);
    assert_eq!(net.run(&[], &mut sink), Ok(2000));
    assert_eq!(sink[..], value);
}

#[test]
fn a_transfer_that_breaks_off_leaves_the_old_value() {
    let mut net = Net::new(3, Faults::default());
    for index in [WHOLE, PARTS] {
        net.write(index, b"old").unwrap();
        let value = vec![7; 5000];
        net.client.start_write(index, 0, value.len()).unwrap();
        while net.client.arrived() < 8 {
            net.step(&value, &mut []);
        }
        net.client.close();
        net.calm_down();
        assert_eq!(net.store.value(index), b"old");
        assert_eq!(net.read(index).unwrap(), b"old");
    }
    assert_eq!((net.store.cancelled, net.store.coming.is_none()), (1, true));
    // Another client takes the place of the writer that was silent longest: its value is dropped, too.
    let value = vec![7; 5000];
    net.client.start_write(PARTS, 0, value.len()).unwrap();
    while net.client.arrived() < 8 {
        net.step(&value, &mut []);
    }
    for client in [1, 2] {
        net.server.receive(client, &[0, 1, 0, 0], &mut net.store);
    }
    assert_eq!((net.store.cancelled, net.store.coming.is_none()), (2, true));
    assert_eq!(net.store.parts, b"old");
}

#[test]
fn either_side_aborts_in_the_middle() {
    let mut net = Net::new(4, Faults::default());
    // The server cannot go on.
    assert_eq!(net.read(BROKEN), Err(ClientError::Aborted(AbortCode::HARDWARE)));
    // The client has no room.
    net.store.parts = vec![1; 3000];
    net.client.start_read(PARTS, 0).unwrap();
    let result = net.run(&[], &mut [0; 2999]);
    assert_eq!(result, Err(ClientError::TooLong { got: 3000, most: 2999 }));
    net.sent.clear();
    net.calm_down();
    let told: Vec<_> = net.sent.iter().filter(|(to_server, _)| *to_server).collect();
    // Abort with the reason, and the end of the connection.
    assert_eq!(told[0].1[6..], [0x40, 2, 4, 0, 0, 0, 0x05, 0, 0x04, 0x05]);
    assert_eq!(told[1].1[..2], [0x0C, 0x0C]);
    assert_eq!(net.read(PARTS).unwrap(), vec![1; 3000]);
    // The server refuses the value when it is complete, and before.
    let aborted = Err(ClientError::Aborted(AbortCode::NO_OBJECT));
    assert_eq!(net.write(BROKEN, &[0; 1000]), aborted);
    assert_eq!(net.write(BROKEN, &[0; 4]), aborted);
    // The caller does not hand in what it announced.
    net.client.start_write(WHOLE, 0, 10).unwrap();
    let wrong = ClientError::WrongLength { expected: 10, got: 9 };
    assert_eq!(net.run(&[0; 9], &mut []), Err(wrong));
    assert_eq!(net.write(WHOLE, &[0; 10]), Ok(0));
}

#[test]
fn the_second_writer_in_parts_makes_the_first_one_void() {
    let mut net = Net::new(5, Faults::default());
    let value = vec![7; 5000];
    net.client.start_write(PARTS, 0, value.len()).unwrap();
    while net.client.arrived() < 8 {
        net.step(&value, &mut []);
    }
    let mut second = Client::new(Timing::default());
    second.start_write(PARTS, 0, 400).unwrap();
    let (mut now_ns, mut out) = (net.now_ns, [0; SERVICE_DATA_MAX]);
    let mut store = core::mem::take(&mut net.store);
    let result = loop {
        now_ns += MS;
        if let Some(len) = second.poll_transmit(now_ns, &[9; 400], &mut out) {
            net.server.receive(253, &out[..len], &mut store);
        }
        while let Some((client, len)) = net.server.poll_transmit(&mut out) {
            if client == 253 {
                second.receive(now_ns, &out[..len], &mut []);
            }
        }
        if let Some(result) = second.result() {
            break result;
        }
    };
    net.store = store;
    assert_eq!((result, net.store.parts.clone()), (Ok(0), vec![9; 400]));
    let aborted = Err(ClientError::Aborted(AbortCode::DEVICE_STATE));
    assert_eq!(net.run(&value, &mut []), aborted);
    assert_eq!(net.store.parts, vec![9; 400]);
}

#[test]
fn several_objects_in_one_command() {
    for faults in [0, 300] {
        let mut net = Net::new(
            6,
            Faults {
                lost: faults,
                ..Faults::default()
            },
        );
        let (mut request, mut sink) = ([0; 2000], [0; 4000]);
        let at = |index| Address { index, sub: 0 };
        let mut blocks = BlockWriter::new(&mut request);
        assert!(
            blocks.push(at(WHOLE), &[1; 5]) && blocks.push(at(BROKEN), &[2; 4]) && blocks.push(at(WHOLE), &[3; 1001])
        );
        let len = blocks.len();
        net.client.start_write_multiple(len).unwrap();
        let answer = net.run(&request[..len], &mut sink).unwrap();
        let failures: Vec<_> = multiple::failures(&sink[..answer]).collect();
        assert_eq!(failures, [(at(BROKEN), AbortCode::NO_OBJECT)]);
        assert_eq!((net.store.writes, net.store.whole.clone()), (2, vec![3; 1001]));

        let len = multiple::emit_addresses([WHOLE, BROKEN, WHOLE].map(at), &mut request).unwrap();
        net.client.start_read_multiple(len).unwrap();
        let answer = net.run(&request[..len], &mut sink).unwrap();
        let values: Vec<_> = Blocks::new(&sink[..answer])
            .map(|block| block.map(|block| (block.address.index, block.value.map(<[u8]>::len))))
            .collect();
        let expected = [
            Ok((WHOLE, Ok(1001))),
            Ok((BROKEN, Err(AbortCode::NO_OBJECT))),
            Ok((WHOLE, Ok(1001))),
        ];
        assert_eq!(values, expected);
    }
}

proptest! {
    /// Both ends get arbitrary octets in the middle of a transfer, and neither panics.
    #[test]
    fn arbitrary_frames_never_panic(
        frames in proptest::collection::vec((any::<[u8; 2]>(), proptest::collection::vec(any::<u8>(), 0..40)), 0..60)
    ) {
        let mut net = Net::new(7, Faults::default());
        let value = vec![5; 3000];
        for (round, (sequence, rest)) in frames.iter().enumerate() {
            let _ = net.client.start_write(WHOLE, 0, value.len());
            let mut frame = sequence.to_vec();
            frame.extend([0, 0, 0, round as u8]);
            frame.extend(rest);
            net.step(&value, &mut [0; 100]);
            net.server.receive(240, &frame, &mut net.store);
            net.client.receive(net.now_ns, &frame, &mut [0; 100]);
            net.client.result();
        }
        prop_assert!(net.server.pending() <= 14);
    }
}
