//! Client against fixed octets, and client against server over a wire that loses and repeats frames.

use super::*;
use crate::sdo::{EXPEDITED_WRITE_MAX, SERVICE_DATA_MAX, Server};
use obd::{DataType, Dictionary, EntryDef};
use proptest::prelude::*;
use std::vec::Vec;

const MS: u64 = 1_000_000;

const TABLE: &[EntryDef] = &[
    EntryDef::rws(0x1006, DataType::U32, "NMT_CycleLen_U32").limits(400, 0xFFFF_FFFF),
    EntryDef::ro(0x1018, DataType::U32, "Identity").subs(1, 4).default(7),
    EntryDef::rw(0x2000, DataType::Domain, "Blob").capacity(400),
];
type Objects = Dictionary<8, 512>;

/// A client with what its caller holds.
struct Caller {
    client: Client,
    value: Vec<u8>,
    sink: Vec<u8>,
}

impl Caller {
    fn new(timing: Timing) -> Caller {
        Caller {
            client: Client::new(timing),
            value: Vec::new(),
            sink: std::vec![0; 4096],
        }
    }

    fn start_write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), ClientError> {
        self.client.start_write(index, sub, value.len())?;
        self.value = value.to_vec();
        Ok(())
    }

    fn start_read(&mut self, index: u16, sub: u8) -> Result<(), ClientError> {
        self.client.start_read(index, sub)?;
        self.value.clear();
        Ok(())
    }

    fn receive(&mut self, now_ns: u64, octets: &[u8]) {
        self.client.receive(now_ns, octets, &mut self.sink);
    }

    fn result(&mut self) -> Option<Result<&[u8], ClientError>> {
        let result = self.client.result()?;
        Some(result.map(|len| &self.sink[..len]))
    }
}

fn transmit(caller: &mut Caller, now_ns: u64) -> Option<Vec<u8>> {
    let mut out = [0xA5; SERVICE_DATA_MAX];
    caller
        .client
        .poll_transmit(now_ns, &caller.value, &mut out)
        .map(|len| out[..len].to_vec())
}

/// Lets client and server talk without losses, one frame per millisecond, until the command ends.
fn run(client: &mut Caller, server: &mut Server, objects: &mut Objects, now_ns: &mut u64) -> Vec<Vec<u8>> {
    let mut frames = Vec::new();
    while client.client.progress == Progress::Running {
        *now_ns += MS;
        if let Some(frame) = transmit(client, *now_ns) {
            server.receive(240, &frame, objects);
            frames.push(frame);
        }
        *now_ns += MS;
        let mut out = [0xA5; SERVICE_DATA_MAX];
        if let Some((receiver, len)) = server.poll_transmit(&mut out) {
            assert_eq!(receiver, 240);
            client.receive(*now_ns, &out[..len]);
            frames.push(out[..len].to_vec());
        }
        assert!(frames.len() < 50, "no end: {frames:02x?}");
    }
    frames
}

#[test]
fn the_captured_connection_frame_by_frame() {
    // openpowerlink-mn-3cn-10ms.pcap: client frames 955, 1029, 1126; server frames 999, 1082, 1197.
    let mut client = Caller::new(Timing::default());
    client.client.transaction = 0xFF; // the captured client counts from 0
    client.start_write(0x1011, 1, b"load").unwrap();
    let padded = |frame: &[u8]| {
        let mut octets = frame.to_vec();
        octets.resize(42, 0);
        octets
    };
    assert_eq!(
        transmit(&mut client, 0).unwrap(),
        [0x00, 0x01, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    );
    client.receive(MS, &padded(&[0x01, 0x01]));
    assert_eq!(
        transmit(&mut client, MS).unwrap(),
        [0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    );
    client.receive(2 * MS, &padded(&[0x02, 0x02]));
    assert_eq!(
        transmit(&mut client, 2 * MS).unwrap(),
        [
            0x02, 0x06, 0, 0, 0, 0, 0, 1, 8, 0, 0, 0, 0x11, 0x10, 1, 0, 0x6C, 0x6F, 0x61, 0x64
        ]
    );
    client.receive(
        3 * MS,
        &padded(&[0x06, 0x06, 0, 0, 0, 0, 0xC0, 1, 4, 0, 0, 0, 0, 0, 2, 6]),
    );
    assert_eq!(client.result(), Some(Err(ClientError::Aborted(AbortCode::NO_OBJECT))));
    assert_eq!(client.result(), None);

    // The next command carries the acknowledge: frame 1268 without the frame 1233 before it.
    client.start_write(0x1600, 0, &[0]).unwrap();
    assert_eq!(
        transmit(&mut client, 4 * MS).unwrap(),
        [0x06, 0x0A, 0, 0, 0, 1, 0, 1, 5, 0, 0, 0, 0, 0x16, 0, 0, 0]
    );
    // Frame 1286.
    client.receive(5 * MS, &padded(&[0x0A, 0x0A, 0, 0, 0, 1, 0x80, 1, 0, 0]));
    assert_eq!(client.result(), Some(Ok(&[][..])));
    // Without a further command the acknowledge goes alone, once: frame 1383.
    assert_eq!(transmit(&mut client, 24 * MS), None);
    assert_eq!(
        transmit(&mut client, 25 * MS).unwrap(),
        [0x0A, 0x0A, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    );
    assert_eq!(transmit(&mut client, 60 * MS), None);
    // Close: as frame 2791, numbers kept.
    client.client.close();
    assert_eq!(
        transmit(&mut client, 61 * MS).unwrap(),
        [0x08, 0x08, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    );
    assert_eq!(transmit(&mut client, 62 * MS), None);
}

#[test]
fn writes_and_reads_through_a_server() {
    let mut objects = Objects::new(&[TABLE]).unwrap();
    let (mut client, mut server, mut now_ns) = (Caller::new(Timing::default()), Server::new(), 0);
    client.start_write(0x1006, 0, &1000_u32.to_le_bytes()).unwrap();
    assert_eq!(client.start_read(0x1006, 0), Err(ClientError::Busy));
    // Three frames to open the connection and its confirmation, command and answer.
    assert_eq!(run(&mut client, &mut server, &mut objects, &mut now_ns).len(), 6);
    assert_eq!(client.result(), Some(Ok(&[][..])));
    assert_eq!(objects.read(0x1006, 0).unwrap(), 1000_u32.to_le_bytes());

    client.start_read(0x1006, 0).unwrap();
    assert_eq!(run(&mut client, &mut server, &mut objects, &mut now_ns).len(), 2);
    assert_eq!(client.result(), Some(Ok(&1000_u32.to_le_bytes()[..])));

    client.start_write(0x1006, 0, &399_u32.to_le_bytes()).unwrap();
    run(&mut client, &mut server, &mut objects, &mut now_ns);
    assert_eq!(
        client.result(),
        Some(Err(ClientError::Aborted(AbortCode::VALUE_TOO_LOW)))
    );

    // The longest value that fits in one frame.
    let longest = [0x5A; EXPEDITED_WRITE_MAX];
    client.start_write(0x2000, 0, &longest).unwrap();
    assert_eq!(run(&mut client, &mut server, &mut objects, &mut now_ns).len(), 2);
    assert_eq!(client.result(), Some(Ok(&[][..])));
    assert_eq!(objects.read(0x2000, 0).unwrap(), longest);
}

#[test]
fn numbers_wrap_over_a_long_connection() {
    let mut objects = Objects::new(&[TABLE]).unwrap();
    let (mut client, mut server, mut now_ns) = (Caller::new(Timing::default()), Server::new(), 0);
    for round in 0..200_u32 {
        client.start_write(0x1006, 0, &(400 + round).to_le_bytes()).unwrap();
        let frames = run(&mut client, &mut server, &mut objects, &mut now_ns).len();
        assert_eq!(frames, if round == 0 { 6 } else { 2 }, "round {round}");
        assert_eq!(client.result(), Some(Ok(&[][..])));
        assert_eq!(objects.read(0x1006, 0).unwrap(), (400 + round).to_le_bytes());
    }
}

#[test]
fn a_lost_frame_is_repeated_after_the_short_time_out_which_doubles() {
    let mut client = Caller::new(Timing {
        give_up_ns: 1000 * MS,
        ..Timing::default()
    });
    client.start_read(0x1018, 1).unwrap();
    let mut sent_ms = Vec::new();
    for now_ms in 0..1000 {
        if transmit(&mut client, now_ms * MS).is_some() {
            sent_ms.push(now_ms);
        }
    }
    assert_eq!(sent_ms, [0, 50, 150, 350, 750]);
    assert_eq!(
        transmit(&mut client, 1000 * MS).unwrap()[..2],
        [0x00, 0x00],
        "the close that ends it"
    );
    assert_eq!(client.result(), Some(Err(ClientError::TimedOut { frames: 5 })));
}

#[test]
fn a_server_that_forgot_the_connection_gets_a_new_one_and_the_command_again() {
    let mut objects = Objects::new(&[TABLE]).unwrap();
    let (mut client, mut server, mut now_ns) = (Caller::new(Timing::default()), Server::new(), 0);
    client.start_read(0x1018, 1).unwrap();
    run(&mut client, &mut server, &mut objects, &mut now_ns);
    assert_eq!(client.result(), Some(Ok(&[7, 0, 0, 0][..])));
    server.reset();
    client.start_write(0x1006, 0, &1000_u32.to_le_bytes()).unwrap();
    let before_ns = now_ns;
    // Refused command and close, then the six frames of a new connection.
    assert_eq!(run(&mut client, &mut server, &mut objects, &mut now_ns).len(), 8);
    assert!(now_ns - before_ns < 50 * MS, "waited for a time-out");
    assert_eq!(client.result(), Some(Ok(&[][..])));
}

#[test]
fn a_dead_node_leads_to_an_error_and_a_clean_start() {
    let mut client = Caller::new(Timing {
        give_up_ns: 100 * MS,
        ..Timing::default()
    });
    client.start_read(0x1018, 1).unwrap();
    assert!(transmit(&mut client, 0).is_some());
    assert!(transmit(&mut client, 60 * MS).is_some());
    // The close that follows tells a node that may have heard us.
    assert_eq!(transmit(&mut client, 100 * MS).unwrap()[..2], [0, 0]);
    assert_eq!(client.result(), Some(Err(ClientError::TimedOut { frames: 2 })));
    client.start_read(0x1018, 1).unwrap();
    assert_eq!(transmit(&mut client, 200 * MS).unwrap()[..2], [0x00, 0x01]);
}

#[test]
fn a_command_after_a_failed_one_opens_a_new_connection() {
    let mut objects = Objects::new(&[TABLE]).unwrap();
    let timing = Timing {
        give_up_ns: 100 * MS,
        ..Timing::default()
    };
    let (mut client, mut server, mut now_ns) = (Caller::new(timing), Server::new(), 0);
    client.start_read(0x1018, 1).unwrap();
    run(&mut client, &mut server, &mut objects, &mut now_ns);
    assert!(client.result().unwrap().is_ok());
    client.start_write(0x1006, 0, &1000_u32.to_le_bytes()).unwrap();
    while client.client.progress == Progress::Running {
        now_ns += MS;
        transmit(&mut client, now_ns); // lost
    }
    assert_eq!(client.result(), Some(Err(ClientError::TimedOut { frames: 2 })));
    client.start_read(0x1018, 2).unwrap();
    assert_eq!(run(&mut client, &mut server, &mut objects, &mut now_ns).len(), 6);
    assert_eq!(client.result(), Some(Ok(&[7, 0, 0, 0][..])));
    // Closed by the application: the same.
    client.client.close();
    client.start_read(0x1018, 2).unwrap();
    assert_eq!(transmit(&mut client, now_ns).unwrap()[..2], [0x00, 0x01]);
}

#[test]
fn an_answer_to_another_command_is_no_answer() {
    let mut client = Caller::new(Timing::default());
    client.start_read(0x1018, 1).unwrap();
    transmit(&mut client, 0).unwrap();
    client.receive(0, &[0x01, 0x01, 0, 0]);
    transmit(&mut client, 0).unwrap();
    // The server repeats its agreement: our confirmation got lost and goes again at once.
    client.receive(MS, &[0x01, 0x01, 0, 0]);
    assert_eq!(transmit(&mut client, MS).unwrap()[..2], [0x01, 0x02]);
    client.receive(2 * MS, &[0x02, 0x02, 0, 0]);
    assert_eq!(
        transmit(&mut client, 2 * MS).unwrap()[..8],
        [0x02, 0x06, 0, 0, 0, 1, 0, 2]
    );
    client.receive(3 * MS, &[0x06, 0x06, 0, 0, 0, 9, 0x80, 2, 1, 0, 0, 0, 0x55]);
    assert_eq!(client.result(), None, "transaction 9");
    client.receive(4 * MS, &[0x06, 0x0A, 0, 0, 0, 1, 0x00, 2, 1, 0, 0, 0, 0x55]);
    assert_eq!(client.result(), None, "no response");
    client.receive(5 * MS, &[0x06, 0x0E, 0, 0, 0, 1, 0x80, 2, 1, 0, 0, 0, 0x55]);
    assert_eq!(client.result(), Some(Ok(&[0x55][..])));
}

#[test]
fn requests_of_the_server_are_met_at_once() {
    let mut objects = Objects::new(&[TABLE]).unwrap();
    let (mut client, mut server, mut now_ns) = (Caller::new(Timing::default()), Server::new(), 0);
    client.start_read(0x1018, 1).unwrap();
    let frames = run(&mut client, &mut server, &mut objects, &mut now_ns);
    assert!(client.result().unwrap().is_ok());
    // It repeats its answer and asks for an acknowledge, as in openpowerlink-mn-3cn-10ms.pcap, frame 6400.
    let mut repeated = frames.last().unwrap().clone();
    repeated[1] |= 1;
    client.receive(now_ns, &repeated);
    assert_eq!(transmit(&mut client, now_ns).unwrap()[..2], [0x06, 0x06]);
    assert_eq!(client.result(), None);
    // It lacks a frame.
    client.start_read(0x1018, 2).unwrap();
    let command = transmit(&mut client, now_ns).unwrap();
    assert_eq!(transmit(&mut client, now_ns), None);
    client.receive(now_ns, &[0x07, 0x06, 0, 0]);
    let again = transmit(&mut client, now_ns).unwrap();
    assert_eq!(again[2..], command[2..]);
    assert_eq!(
        (command[1], again[1]),
        (0x0A, 0x0B),
        "the same number, asking for an acknowledge"
    );
}

#[test]
fn answers_against_the_protocol_are_named() {
    let answer = |octets: &[u8]| {
        let mut client = Caller::new(Timing::default());
        client.start_read(0x1018, 1).unwrap();
        for sequence in [[0x01, 0x01, 0, 0], [0x02, 0x02, 0, 0]] {
            transmit(&mut client, 0).unwrap();
            client.receive(0, &sequence);
        }
        transmit(&mut client, 0).unwrap();
        let mut frame = std::vec![0x06, 0x06, 0, 0];
        frame.extend(octets);
        client.receive(0, &frame);
        match client.result() {
            Some(Err(ClientError::BadAnswer(what))) => what,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(answer(&[0, 1, 0xC0, 2, 3, 0, 0, 0, 1, 2, 3]), "an abort without a code");
    assert_eq!(
        answer(&[0, 1, 0x80, 1, 0, 0, 0, 0]),
        "another command than the one that was sent"
    );
}

proptest! {
    /// Whatever is lost or repeated, every write is carried out once and in order, and its result is right.
    #[test]
    fn losses_and_repetitions_change_nothing(fates in proptest::collection::vec(0_u8..4, 0..120)) {
        struct Counting(Vec<u32>);
        impl obd::Objects for Counting {
            fn sdo_read(&mut self, _: u16, _: u8, _: &mut [u8]) -> Result<usize, AbortCode> {
                Err(AbortCode::READ_OF_WRITE_ONLY)
            }
            fn sdo_write(&mut self, _: u16, _: u8, value: &[u8]) -> Result<(), AbortCode> {
                self.0.push(u32::from_le_bytes(value.try_into().map_err(|_| AbortCode::LENGTH_MISMATCH)?));
                Ok(())
            }
        }
        let mut objects = Counting(Vec::new());
        let (mut client, mut server) = (Caller::new(Timing::default()), Server::<2>::new());
        let mut fates = fates.into_iter();
        let (mut now_ns, mut done) = (0, 0_u32);
        // 0: lost, 1: delivered twice, else delivered once; when the fates are over, everything arrives.
        while done < 5 {
            now_ns += MS;
            prop_assert!(now_ns < 60_000 * MS, "no end");
            if !client.client.is_busy() {
                client.start_write(0x2000, 0, &done.to_le_bytes()).unwrap();
            }
            if let Some(frame) = transmit(&mut client, now_ns) {
                for _ in 0..copies(fates.next()) {
                    server.receive(240, &frame, &mut objects);
                }
            }
            let mut out = [0; SERVICE_DATA_MAX];
            if let Some((_, len)) = server.poll_transmit(&mut out) {
                for _ in 0..copies(fates.next()) {
                    client.receive(now_ns, &out[..len]);
                }
            }
            if let Some(result) = client.result() {
                prop_assert_eq!(result, Ok(&[][..]));
                done += 1;
            }
        }
        prop_assert_eq!(objects.0, [0, 1, 2, 3, 4]);
    }

    #[test]
    fn arbitrary_octets_never_panic(frames in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..60), 0..30)) {
        let mut objects = Objects::new(&[TABLE]).unwrap();
        let (mut client, mut server) = (Caller::new(Timing::default()), Server::<2>::new());
        let mut out = [0; SERVICE_DATA_MAX];
        for (round, frame) in frames.iter().enumerate() {
            let now_ns = round as u64 * 7 * MS;
            let _ = client.start_read(0x1018, 1);
            client.receive(now_ns, frame);
            client.client.poll_transmit(now_ns, &client.value, &mut out);
            client.result();
            server.receive(frame.first().copied().unwrap_or(0), frame, &mut objects);
            server.poll_transmit(&mut out);
        }
    }
}

fn copies(fate: Option<u8>) -> usize {
    match fate {
        Some(0) => 0,
        Some(1) => 2,
        Some(_) | None => 1,
    }
}

/// A server that is open does not have to say so twice (openPOWERLINK's does not): without its first word the command follows
/// the second confirmation.
#[test]
fn a_lost_end_of_the_handshake_is_followed_by_the_command() {
    let first = Timing::default().first_timeout_ns;
    let mut client = Caller::new(Timing::default());
    client.start_write(0x1006, 0, &[0xE8, 0x03, 0, 0]).unwrap();
    transmit(&mut client, 0).unwrap();
    client.receive(MS, &[0x01, 0x01, 0, 0]);
    let confirmation = [0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    assert_eq!(transmit(&mut client, MS).unwrap(), confirmation);
    assert_eq!(transmit(&mut client, first), None, "the answer may still come");
    assert_eq!(transmit(&mut client, MS + first).unwrap(), confirmation);
    let command = transmit(&mut client, MS + first).unwrap();
    assert_eq!(command[..2], [0x02, 0x06]);
    client.receive(2 * MS + first, &[0x06, 0x06, 0, 0, 0, 1, 0x80, 1, 0, 0, 0, 0]);
    assert_eq!(client.result(), Some(Ok(&[][..])));
}

/// Each frame of a connection gets lost once, one at a time, to and from a server that repeats nothing by itself.
#[test]
fn every_single_loss_costs_one_time_out() {
    let run = |lost: usize| {
        let mut client = Caller::new(Timing::default());
        let (mut server, mut objects): (Server, _) = (Server::new(), Objects::new(&[TABLE]).unwrap());
        client.start_write(0x1006, 0, &[0xE8, 0x03, 0, 0]).unwrap();
        let mut frames = 0;
        for step in 0..10_000 {
            let now_ns = step * MS;
            let mut arrives = || {
                frames += 1;
                frames != lost + 1
            };
            if let Some(frame) = transmit(&mut client, now_ns)
                && arrives()
            {
                server.receive(240, &frame, &mut objects);
            }
            let mut out = [0; SERVICE_DATA_MAX];
            if let Some((_, len)) = server.poll_transmit(&mut out)
                && arrives()
            {
                client.receive(now_ns, &out[..len]);
            }
            if let Some(result) = client.client.result() {
                assert_eq!(result, Ok(0), "frame {lost} lost");
                return (frames, now_ns);
            }
        }
        panic!("frame {lost} lost: no end");
    };
    let (frames, clean_ns) = run(usize::MAX - 1);
    assert_eq!(frames, 6, "three there and three back");
    for lost in 0..frames {
        let (_, taken_ns) = run(lost);
        let cost_ns = taken_ns - clean_ns;
        assert!(
            cost_ns <= Timing::default().first_timeout_ns + 5 * MS,
            "frame {lost} lost costs {cost_ns} ns"
        );
    }
}
