//! Arbitrary octets at both ends of an SDO connection, alone and in the middle of real transfers; nothing may panic, and what waits
//! to be sent stays bounded.

use obd::{DataType, Dictionary, EntryDef};
use powerlink::sdo::datagram::Datagram;
use powerlink::sdo::multiple::{Blocks, failures};
use powerlink::sdo::{Client, SERVICE_DATA_MAX, Server, Timing};

const TABLE: &[EntryDef] = &[
    EntryDef::rws(0x1006, DataType::U32, "NMT_CycleLen_U32").limits(400, 0xFFFF_FFFF),
    EntryDef::ro(0x1018, DataType::U32, "Identity").subs(1, 4).default(7),
    EntryDef::rw(0x2000, DataType::Domain, "Blob").capacity(1500),
];

/// Most frames a server of two connections may hold: a window each, and a request for missing ones.
const PENDING_MAX: usize = 12;

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    let mut objects = Dictionary::<8, 1600>::new(&[TABLE]).expect("a table without faults");
    let (mut client, mut server) = (Client::new(Timing::default()), Server::<2, 2048>::new());
    let value: Vec<u8> = (0..1400_u32).map(|at| at as u8).collect();
    let (mut handed_in, mut sink, mut out) = (&value[..0], [0; 1000], [0; SERVICE_DATA_MAX]);
    let (mut now_ns, mut rest) = (0, octets);
    // Each step: what happens (one octet), then for made-up frames a length (one octet) and that many octets.
    while let Some((step, after)) = rest.split_first() {
        rest = after;
        now_ns += 1_000_000 << (step >> 5);
        match step & 0x0F {
            0 if client.start_write(0x2000, 0, value.len()).is_ok() => handed_in = &value,
            1 if client.start_read(0x2000, 0).is_ok() => handed_in = &[],
            2 if client.start_write_multiple(400).is_ok() => handed_in = &value[..400],
            3 if client.start_read_multiple(8).is_ok() => handed_in = &[0x06, 0x10, 0, 0, 0, 0x20, 0, 0],
            4 => client.close(),
            5 => server.reset(),
            kind @ 6..=8 => {
                let len = rest.first().map_or(0, |len| usize::from(*len));
                let frame = rest.get(1..).unwrap_or_default();
                let frame = &frame[..len.min(frame.len())];
                rest = &rest[(1 + frame.len()).min(rest.len())..];
                match kind {
                    6 => server.receive(step >> 4, frame, &mut objects),
                    7 => client.receive(now_ns, frame, &mut sink),
                    _ => {
                        Datagram::parse(frame);
                        Blocks::new(frame).for_each(drop);
                        failures(frame).for_each(drop);
                    }
                }
            }
            // Real frames, delivered, lost or doubled.
            kind => {
                if let Some(len) = client.poll_transmit(now_ns, handed_in, &mut out) {
                    for _ in 0..kind & 3 {
                        server.receive(240, &out[..len], &mut objects);
                    }
                }
                if let Some((to, len)) = server.poll_transmit(&mut out)
                    && to == 240
                {
                    for _ in 0..(kind >> 1) & 3 {
                        client.receive(now_ns, &out[..len], &mut sink);
                    }
                }
            }
        }
        assert!(server.pending() <= PENDING_MAX);
        if let Some(Ok(len)) = client.result() {
            assert!(len <= sink.len());
        }
    }
}
