use super::*;
use crate::link::pcap::PcapWriter;
use std::sync::{Arc, Mutex};
use std::vec;

/// A frame of `len` octets that starts with a number.
fn frame(number: u8, len: usize) -> Vec<u8> {
    let mut frame = vec![0xEE; len];
    frame[0] = number;
    frame
}

fn receive_all(hub: &mut Hub) -> Vec<(Arrival, Vec<u8>)> {
    let mut buffer = [0; FRAME_LEN_MAX];
    let mut arrivals = Vec::new();
    while let Some(arrival) = hub.receive(u64::MAX, &mut buffer) {
        arrivals.push((arrival, buffer[..arrival.length].to_vec()));
    }
    arrivals
}

#[test]
fn a_frame_reaches_all_others_after_its_wire_time_and_both_delays() {
    let mut hub = Hub::new(1);
    let [a, b, c] = [100, 20, 3].map(|delay_ns| {
        hub.attach(Path {
            delay_ns,
            ..Path::default()
        })
    });
    // Preamble, 60 octets, FCS: 72 octets of 80 ns.
    assert_eq!(hub.send(a, 1_000, &frame(1, 60)), Ok(1_000 + 5_760));
    let arrivals: Vec<_> = receive_all(&mut hub)
        .iter()
        .map(|(arrival, octets)| {
            (
                arrival.at_ns,
                arrival.from,
                arrival.to,
                octets.len(),
                arrival.faults.any(),
            )
        })
        .collect();
    assert_eq!(arrivals, [(6_863, a, c, 60, false), (6_880, a, b, 60, false)]);
    assert_eq!(hub.receive(u64::MAX, &mut [0; 60]), None, "nobody hears himself");
}

#[test]
fn a_station_sends_one_frame_after_the_other() {
    let mut hub = Hub::new(1);
    let [a, _] = [0, 0].map(|_| hub.attach(Path::default()));
    assert_eq!(hub.send(a, 0, &frame(1, 60)), Ok(5_760));
    // The gap of 12 octets, then preamble, 100 octets and FCS.
    assert_eq!(hub.send(a, 10, &frame(2, 100)), Ok(5_760 + 960 + 8_960));
    assert_eq!(hub.take_collision(), None);
    let numbers: Vec<_> = receive_all(&mut hub).iter().map(|(_, octets)| octets[0]).collect();
    assert_eq!(numbers, [1, 2]);
}

#[test]
fn two_frames_at_once_are_seen_and_two_in_a_row_are_not() {
    let mut hub = Hub::new(1);
    let [a, b] = [0, 0].map(|_| hub.attach(Path::default()));
    hub.send(a, 1_000, &frame(1, 60)).unwrap();
    hub.send(b, 1_000 + 5_760, &frame(2, 60)).unwrap();
    assert_eq!(hub.take_collision(), None);
    hub.send(a, 12_000, &frame(3, 60)).unwrap();
    let collision = Collision {
        at_ns: 12_000 + 1_000,
        stations: [b, a],
    };
    assert_eq!(hub.take_collision(), Some(collision));
    assert_eq!(hub.take_collision(), None, "told once");
}

#[test]
fn an_unplugged_station_neither_sends_nor_receives() {
    let mut hub = Hub::new(1);
    let [a, b, c] = [0; 3].map(|_| hub.attach(Path::default()));
    hub.send(a, 0, &frame(1, 60)).unwrap();
    hub.plug(b, false);
    assert_eq!(hub.send(b, 10, &frame(2, 60)), Err(LinkError::Down));
    hub.send(a, 20_000, &frame(3, 60)).unwrap();
    let to: Vec<_> = receive_all(&mut hub).iter().map(|(arrival, _)| arrival.to).collect();
    assert_eq!((to, hub.lost()), (vec![c, c], 1), "the first frame was on its way to b");
    hub.plug(b, true);
    hub.send(a, 40_000, &frame(4, 60)).unwrap();
    assert_eq!(receive_all(&mut hub).len(), 2);
    for length in [0, 13, FRAME_LEN_MAX + 1] {
        let error = LinkError::FrameLength {
            got: length,
            max: FRAME_LEN_MAX,
        };
        assert_eq!(hub.send(a, 50_000, &vec![0; length]), Err(error));
    }
}

/// Sends 10,000 numbered frames over a path, 10 µs apart.
fn ten_thousand(seed: u64, path: Path) -> (Vec<(Arrival, Vec<u8>)>, u64) {
    let mut hub = Hub::new(seed);
    let a = hub.attach(Path::default());
    hub.attach(path);
    for number in 0..10_000_u64 {
        let mut octets = frame(0, 60);
        octets[..8].copy_from_slice(&number.to_le_bytes());
        hub.send(a, number * 10_000, &octets).unwrap();
    }
    (receive_all(&mut hub), hub.lost())
}

#[test]
fn shares_are_kept_and_every_fault_is_named() {
    let (arrivals, lost) = ten_thousand(
        7,
        Path {
            loss: 0.1,
            ..Path::default()
        },
    );
    assert_eq!(arrivals.len() as u64 + lost, 10_000);
    assert!((900..1_100).contains(&lost), "{lost}");

    let (arrivals, _) = ten_thousand(
        7,
        Path {
            duplicate: 0.1,
            ..Path::default()
        },
    );
    let second = arrivals.iter().filter(|(arrival, _)| arrival.faults.duplicated).count();
    assert_eq!(arrivals.len(), 10_000 + second);
    assert!((900..1_100).contains(&second), "{second}");

    let (arrivals, _) = ten_thousand(
        7,
        Path {
            reorder: 0.1,
            ..Path::default()
        },
    );
    let numbers: Vec<_> = arrivals.iter().map(|(_, octets)| octets[..2].to_vec()).collect();
    assert!(
        numbers
            .windows(2)
            .any(|pair| pair[0][1] == pair[1][1] && pair[0][0] > pair[1][0])
    );
    let held: Vec<_> = arrivals
        .iter()
        .filter(|(arrival, _)| arrival.faults.held_back)
        .collect();
    assert!((900..1_100).contains(&held.len()), "{}", held.len());

    let (arrivals, _) = ten_thousand(
        7,
        Path {
            corrupt: 0.1,
            corrupt_octets: 20..22,
            ..Path::default()
        },
    );
    let mut wrong = 0;
    for (arrival, octets) in &arrivals {
        let bits: u32 = octets[8..].iter().map(|octet| (octet ^ 0xEE).count_ones()).sum();
        assert_eq!(bits, u32::from(arrival.faults.corrupted));
        assert_eq!(
            bits,
            octets[20..22]
                .iter()
                .map(|octet| (octet ^ 0xEE).count_ones())
                .sum::<u32>()
        );
        wrong += bits;
    }
    assert!((900..1_100).contains(&wrong), "{wrong}");
}

#[test]
fn a_seed_makes_one_run() {
    let path = Path {
        jitter_ns: 5_000,
        loss: 0.05,
        duplicate: 0.05,
        reorder: 0.05,
        corrupt: 0.05,
        ..Path::default()
    };
    let run = |seed| ten_thousand(seed, path.clone());
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

#[test]
fn a_capture_holds_what_was_sent() {
    let file = Arc::new(Mutex::new(PcapWriter::new(Vec::new()).unwrap()));
    let mut hub = Hub::new(1);
    let a = hub.attach(Path::default());
    hub.attach(Path {
        loss: 1.0,
        ..Path::default()
    });
    let tapped = Arc::clone(&file);
    hub.set_tap(Box::new(move |at_ns, frame| {
        tapped.lock().unwrap().write(at_ns, frame).unwrap()
    }));
    hub.send(a, 5, &frame(1, 60)).unwrap();
    hub.send(a, 6, &frame(2, 64)).unwrap();
    drop(hub);
    let octets = Arc::into_inner(file).unwrap().into_inner().unwrap().finish().unwrap();
    let frames: Vec<_> = crate::link::pcap::PcapReader::new(&octets)
        .unwrap()
        .map(|captured| captured.map(|captured| (captured.stamp_ns, captured.frame.to_vec())))
        .collect();
    // The second one leaves when the first one and the gap are over.
    assert_eq!(frames, [Ok((5, frame(1, 60))), Ok((5 + 5_760 + 960, frame(2, 64)))]);
}

#[test]
fn the_generator_gives_its_published_numbers() {
    let mut random = SplitMix64::new(1_234_567);
    assert_eq!(
        [random.next(), random.next()],
        [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]
    );
}
