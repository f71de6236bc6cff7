//! Server against the frames of a captured connection.

use super::*;
use obd::{AbortCode, DataType, Dictionary, EntryDef};
use std::vec::Vec;

const TABLE: &[EntryDef] = &[
    EntryDef::rws(0x1006, DataType::U32, "NMT_CycleLen_U32"),
    EntryDef::rws(0x1600, DataType::U8, "NumberOfEntries"),
];
type Objects = Dictionary<4, 8>;

struct Bench {
    server: Server,
    objects: Objects,
}

impl Bench {
    fn new() -> Bench {
        Bench {
            server: Server::new(),
            objects: Objects::new(&[TABLE]).unwrap(),
        }
    }

    fn receive_from(&mut self, client: u8, octets: &[u8]) {
        let mut padded = octets.to_vec();
        padded.resize(42, 0);
        self.server.receive(client, &padded, &mut self.objects);
    }

    fn transmit(&mut self) -> Option<(u8, Vec<u8>)> {
        let mut out = [0xA5; SERVICE_DATA_MAX];
        self.server
            .poll_transmit(&mut out)
            .map(|(client, len)| (client, out[..len].to_vec()))
    }

    fn exchange(&mut self, octets: &[u8]) -> Option<Vec<u8>> {
        self.receive_from(240, octets);
        self.transmit().map(|(client, octets)| {
            assert_eq!(client, 240);
            octets
        })
    }

    fn open(&mut self) {
        self.exchange(&[0x00, 0x01]).unwrap();
        self.exchange(&[0x01, 0x02]).unwrap();
    }
}

const NOTHING: [u8; 10] = [0; 10];
const WRITE_1006: &[u8] = &[
    0x02, 0x06, 0, 0, 0, 3, 0, 1, 8, 0, 0, 0, 0x06, 0x10, 0, 0, 0x10, 0x27, 0, 0,
];

fn sequence_only(receive: u8, send: u8) -> Vec<u8> {
    let mut octets = std::vec![receive, send];
    octets.extend(NOTHING);
    octets
}

#[test]
fn the_captured_connection_frame_by_frame() {
    // openpowerlink-mn-3cn-10ms.pcap: each line is a client frame and the server frame that answered it (955 -> 999,
    // 1029 -> 1082, 1126 -> 1197, 1233 -> none, 1268 -> 1286, 1383 -> none).
    let mut bench = Bench::new();
    assert_eq!(bench.exchange(&[0x00, 0x01]), Some(sequence_only(0x01, 0x01)));
    assert_eq!(bench.exchange(&[0x01, 0x02]), Some(sequence_only(0x02, 0x02)));
    let write_1011 = [
        0x02, 0x06, 0, 0, 0, 0, 0, 1, 8, 0, 0, 0, 0x11, 0x10, 1, 0, 0x6C, 0x6F, 0x61, 0x64,
    ];
    let aborted = [0x06, 0x06, 0, 0, 0, 0, 0xC0, 1, 4, 0, 0, 0, 0, 0, 2, 6];
    assert_eq!(bench.exchange(&write_1011).unwrap(), aborted);
    assert_eq!(bench.exchange(&[0x06, 0x06]), None);
    let write_1600 = [0x06, 0x0A, 0, 0, 0, 1, 0, 1, 5, 0, 0, 0, 0, 0x16, 0, 0, 0];
    assert_eq!(
        bench.exchange(&write_1600).unwrap(),
        [0x0A, 0x0A, 0, 0, 0, 1, 0x80, 1, 0, 0, 0, 0]
    );
    assert_eq!(bench.exchange(&[0x0A, 0x0A]), None);
    assert_eq!(bench.server.pending(), 0);
}

#[test]
fn a_repeated_command_is_answered_again_but_carried_out_once() {
    let mut bench = Bench::new();
    bench.open();
    let answer = bench.exchange(WRITE_1006).unwrap();
    assert_eq!(answer, [0x06, 0x06, 0, 0, 0, 3, 0x80, 1, 0, 0, 0, 0]);
    let cycle = bench.objects.key::<u32>(0x1006, 0).unwrap();
    assert_eq!(bench.objects.get(cycle), 10_000);
    bench.objects.set(cycle, 77);
    let mut repeated = WRITE_1006.to_vec();
    repeated[1] = 0x07; // the same number, asking for an acknowledge
    assert_eq!(bench.exchange(&repeated).unwrap(), answer);
    assert_eq!(bench.exchange(WRITE_1006).unwrap(), answer);
    // An acknowledge request without the command fetches a lost answer, too.
    assert_eq!(bench.exchange(&[0x02, 0x07]).unwrap(), answer);
    assert_eq!(bench.objects.get(cycle), 77);
    // Once the client has it, it gets a plain acknowledge.
    assert_eq!(bench.exchange(&[0x06, 0x07]), Some(sequence_only(0x06, 0x06)));
}

#[test]
fn a_gap_in_the_numbers_is_reported() {
    let mut bench = Bench::new();
    bench.open();
    let mut second = WRITE_1006.to_vec();
    second[1] = 0x0A;
    assert_eq!(bench.exchange(&second), Some(sequence_only(0x03, 0x02)));
    assert_eq!(bench.objects.read(0x1006, 0).unwrap(), [0; 4]);
    assert!(bench.exchange(WRITE_1006).is_some());
    assert_eq!(bench.objects.read(0x1006, 0).unwrap(), 10_000_u32.to_le_bytes());
}

#[test]
fn a_command_without_connection_is_answered_by_a_close() {
    let mut bench = Bench::new();
    assert_eq!(bench.exchange(WRITE_1006), Some(sequence_only(0x04, 0x00)));
    assert_eq!(bench.objects.read(0x1006, 0).unwrap(), [0; 4]);
    bench.open();
    assert_eq!(bench.exchange(&[0x00, 0x00]), None);
    assert_eq!(bench.exchange(WRITE_1006), Some(sequence_only(0x04, 0x00)));
}

#[test]
fn a_new_handshake_replaces_an_open_connection() {
    let mut bench = Bench::new();
    bench.open();
    bench.exchange(WRITE_1006).unwrap();
    assert_eq!(bench.exchange(&[0x00, 0x01]), Some(sequence_only(0x01, 0x01)));
    assert_eq!(bench.exchange(&[0x01, 0x02]), Some(sequence_only(0x02, 0x02)));
    assert_eq!(bench.exchange(&[0x01, 0x02]), Some(sequence_only(0x02, 0x02)));
}

#[test]
fn what_is_not_supported_is_aborted_by_name() {
    let mut bench = Bench::new();
    bench.open();
    let aborted = |number: u8, transaction, id, code: AbortCode| {
        let mut octets = std::vec![
            number << 2 | 2,
            number << 2 | 2,
            0,
            0,
            0,
            transaction,
            0xC0,
            id,
            4,
            0,
            0,
            0
        ];
        octets.extend(code.0.to_le_bytes());
        octets
    };
    // A value longer than the object, in segments; then the second segment, which was on its way.
    let initiate = [
        0x02, 0x06, 0, 0, 0, 9, 0x10, 1, 8, 0, 0, 0, 0xFF, 0, 0, 0, 0x06, 0x10, 0, 0,
    ];
    assert_eq!(
        bench.exchange(&initiate).unwrap(),
        aborted(1, 9, 1, AbortCode::TOO_LONG)
    );
    let second = [0x06, 0x0A, 0, 0, 0, 9, 0x20, 1, 2, 0, 0, 0, 1, 2];
    assert_eq!(bench.exchange(&second).unwrap(), sequence_only(0x0A, 0x06));
    // A segment that nothing comes before, the segment size, several objects without a block, an address that is cut off.
    let stray = [0x06, 0x0E, 0, 0, 0, 10, 0x20, 1, 2, 0, 0, 0, 1, 2];
    let expected = [0x0E, 0x0A, 0, 0, 0, 10, 0xC0, 1, 4, 0, 0, 0, 0x01, 0x00, 0x04, 0x05];
    assert_eq!(bench.exchange(&stray).unwrap(), expected);
    let mut bench = Bench::new();
    bench.open();
    let segment_size = [0x02, 0x06, 0, 0, 0, 9, 0, 0x70, 4, 0, 0, 0, 0, 1, 0, 0];
    assert_eq!(
        bench.exchange(&segment_size).unwrap(),
        aborted(1, 9, 0x70, AbortCode::UNKNOWN_COMMAND)
    );
    let multiple = [0x06, 0x0A, 0, 0, 0, 10, 0, 0x31, 4, 0, 0, 0, 0, 0, 0, 0];
    assert_eq!(
        bench.exchange(&multiple).unwrap(),
        aborted(2, 10, 0x31, AbortCode::BLOCK_SIZE)
    );
    let cut = [0x0A, 0x0E, 0, 0, 0, 11, 0, 2, 3, 0, 0, 0, 0x06, 0x10, 0];
    assert_eq!(bench.exchange(&cut).unwrap(), aborted(3, 11, 2, AbortCode::BLOCK_SIZE));
}

#[test]
fn a_command_larger_than_its_frame_is_dropped() {
    let mut bench = Bench::new();
    bench.open();
    let mut command = WRITE_1006.to_vec();
    command[8] = 43;
    assert_eq!(bench.exchange(&command), None);
    assert!(bench.exchange(WRITE_1006).is_some());
    for len in 0..WRITE_1006.len() {
        let mut bench = Bench::new();
        bench.open();
        bench.server.receive(240, &WRITE_1006[..len], &mut bench.objects);
        assert_eq!(bench.objects.read(0x1006, 0).unwrap(), [0; 4], "{len} octets");
    }
}

#[test]
fn two_clients_are_served_in_turn_and_a_third_replaces_the_one_silent_longest() {
    let mut bench = Bench::new();
    bench.receive_from(240, &[0x00, 0x01]);
    bench.receive_from(253, &[0x00, 0x01]);
    assert_eq!(bench.server.pending(), 2);
    assert_eq!(bench.transmit().unwrap().0, 240);
    bench.receive_from(240, &[0x01, 0x02]);
    assert_eq!(bench.transmit().unwrap().0, 253);
    assert_eq!(bench.transmit().unwrap().0, 240);
    assert_eq!(bench.transmit(), None);
    bench.receive_from(17, &[0x00, 0x01]);
    assert_eq!(bench.transmit().unwrap(), (17, sequence_only(0x01, 0x01)));
    assert!(
        bench.exchange(WRITE_1006).unwrap().len() == 12,
        "the connection of 240 lives"
    );
    bench.receive_from(253, &[0x01, 0x02]);
    assert_eq!(bench.transmit().unwrap(), (253, sequence_only(0x00, 0x00)));
}
