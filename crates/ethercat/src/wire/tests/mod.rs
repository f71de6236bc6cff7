//! Octets from outside: traffic of ethercrab with devices of Beckhoff, as shipped in the crate ethercrab 0.7.1 (MIT or
//! Apache 2.0), `tests/replay-*.pcapng`; each test names the file and the number of the frame.

mod coe;
mod registers;
mod sii;

use super::*;
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

/// Octets from hexadecimal text, zeros up to `length`.
fn octets(hex: &str, length: usize) -> Vec<u8> {
    let mut octets: Vec<u8> = hex
        .split_whitespace()
        .map(|word| u8::from_str_radix(word, 16).unwrap())
        .collect();
    assert!(octets.len() <= length);
    octets.resize(length, 0);
    octets
}

/// The frame is written into a dirty buffer as it came, and refused when cut in front of its padding.
fn check(octets: &[u8], used: usize) {
    let frame = Frame::parse(octets).unwrap();
    let mut buffer = [0xA5; FRAME_LEN_MAX];
    let length = frame.emit(&mut buffer).unwrap();
    assert_eq!(length, octets.len().max(FRAME_LEN_MIN));
    assert_eq!(&buffer[..octets.len()], octets);
    assert!(
        buffer[length..].iter().all(|octet| *octet == 0xA5),
        "wrote past the frame"
    );
    for cut in 0..used {
        let got = Frame::parse(&octets[..cut]);
        assert!(
            matches!(got, Err(WireError::TooShort { .. } | WireError::Overrun { .. })),
            "{cut} octets: {got:?}"
        );
    }
    for cut in used..octets.len() {
        assert_eq!(Frame::parse(&octets[..cut]), Ok(frame));
    }
    for short in 0..length {
        let got = frame.emit(&mut buffer[..short]);
        assert!(matches!(got, Err(WireError::NoRoom { .. })), "{short} octets: {got:?}");
    }
}

/// `replay-ek1914-segmented-upload`, frame 2: the answer of two devices to the first BRD.
#[test]
fn the_answer_to_a_broadcast_counts_the_devices_twice() {
    let answer = octets(
        "ff ff ff ff ff ff 12 10 10 10 10 10 88 a4 0d 10 07 00 02 00 00 00 01 00 00 00 13 02",
        60,
    );
    let frame = Frame::parse(&answer).unwrap();
    assert!(answers(frame.source, [0x10; 6]));
    assert!(!answers([0x10; 6], [0x10; 6]), "our own frame");
    assert!(!answers([0x12, 0x10, 0x10, 0x10, 0x10, 0x11], [0x10; 6]), "another's");
    let all: Vec<_> = frame.datagrams().collect();
    assert_eq!(all.len(), 1);
    let expected = Datagram {
        command: Command::Brd,
        index: 0,
        address: 2,
        circulating: false,
        irq: 0,
        data: &[0x13],
        working_counter: 2,
        at: 16,
    };
    assert_eq!(all[0], expected);
    assert_eq!((all[0].adp(), all[0].ado(), all[0].data_at()), (2, 0, 26));
    check(&answer, 29);
}

/// `replay-ek1100-el2828-el2889`, frame 2298: two datagrams.
#[test]
fn datagrams_follow_each_other() {
    let answer = octets(
        "ff ff ff ff ff ff 12 10 10 10 10 10 88 a4 1c 10 04 7c 00 10 30 01 02 80 00 00 04 00 01 00 \
         04 7d 02 10 30 01 02 00 00 00 04 00 01 00",
        60,
    );
    let frame = Frame::parse(&answer).unwrap();
    let all: Vec<_> = frame
        .datagrams()
        .map(|datagram| (datagram.adp(), datagram.index, datagram.data))
        .collect();
    assert_eq!(all, [(0x1000, 0x7C, &[4, 0][..]), (0x1002, 0x7D, &[4, 0][..])]);
    check(&answer, 44);
}

#[test]
fn a_frame_is_written_datagram_by_datagram() {
    let mut buffer = [0xA5; FRAME_LEN_MAX];
    let mut writer = FrameWriter::new(&mut buffer, BROADCAST, [0x10; 6]).unwrap();
    assert_eq!(writer.room(), DATA_MAX);
    assert_eq!(writer.push_data(Command::Lrw, 1, 0x0001_0000, &[7; 3]), Ok(26));
    assert_eq!(
        writer.push(Command::Brd, 2, register::station(0, register::AL_STATUS), 2),
        Ok(41)
    );
    let length = writer.finish();
    assert_eq!(length, 60);
    let expected = octets(
        "ff ff ff ff ff ff 10 10 10 10 10 10 88 a4 1d 10 0c 01 00 00 01 00 03 80 00 00 07 07 07 00 00 \
         07 02 00 00 30 01 02 00 00 00 00 00 00 00",
        60,
    );
    assert_eq!(buffer[..60], expected);
    assert!(buffer[60..].iter().all(|octet| *octet == 0xA5));
}

#[test]
fn a_frame_takes_1486_octets_and_no_more() {
    let mut buffer = [0; FRAME_LEN_MAX + 10];
    let mut writer = FrameWriter::new(&mut buffer, BROADCAST, [0x10; 6]).unwrap();
    let refused = WireError::NoRoom { need: 1499, got: 1498 };
    assert_eq!(writer.push(Command::Lrd, 0, 0, DATA_MAX + 1), Err(refused));
    assert_eq!(writer.push(Command::Lrd, 0, 0, DATA_MAX), Ok(26));
    assert_eq!(writer.room(), 0);
    assert!(matches!(
        writer.push(Command::Nop, 0, 0, 0),
        Err(WireError::NoRoom { .. })
    ));
    assert_eq!(writer.finish(), FRAME_LEN_MAX);
    assert_eq!(Frame::parse(&buffer), Err(WireError::TooLong { got: 1524 }));
    assert_eq!(Frame::parse(&buffer[..FRAME_LEN_MAX]).unwrap().datagrams().count(), 1);
}

#[test]
fn what_is_no_frame_of_datagrams_says_why() {
    let good = octets(
        "ff ff ff ff ff ff 12 10 10 10 10 10 88 a4 0d 10 07 00 02 00 00 00 01 00 00 00 13 02",
        60,
    );
    let with = |at: usize, value: u8| {
        let mut changed = good.clone();
        changed[at] = value;
        Frame::parse(&changed).map(|_| ())
    };
    assert_eq!(with(13, 0xAB), Err(WireError::EtherType { got: 0x88AB }));
    assert_eq!(with(15, 0x40), Err(WireError::FrameType { got: 4 }));
    assert_eq!(with(14, 0x2D), Err(WireError::Overrun { need: 45, got: 44 }));
    assert_eq!(with(14, 0x0E), Err(WireError::Rest { octets: 1 }));
    // The datagram says that it has two octets, or that another one follows.
    assert_eq!(with(22, 2), Err(WireError::Overrun { need: 14, got: 13 }));
    assert_eq!(with(23, 0x80), Err(WireError::Overrun { need: 12, got: 0 }));
    // Bits 11 to 13 are reserved.
    assert_eq!(with(23, 0x38), Ok(()));
}

#[test]
fn every_octet_is_a_command_there_and_back() {
    let known = (0..=u8::MAX).filter(|octet| !matches!(Command::from(*octet), Command::Unknown(_)));
    assert_eq!(known.count(), 15);
    for octet in 0..=u8::MAX {
        let command = Command::from(octet);
        assert_eq!(u8::from(command), octet);
        let addressed = command.addressing() != Addressing::None;
        assert_eq!(addressed, command.reads() || command.writes(), "{command:?}");
    }
}

proptest! {
    #[test]
    fn any_octets_are_read_or_refused(octets in prop::collection::vec(any::<u8>(), 0..1600)) {
        let _ = Frame::parse(&octets);
    }

    #[test]
    fn any_datagrams_are_read_as_they_were_written(
        all in prop::collection::vec((any::<u8>(), any::<u8>(), any::<u32>(), prop::collection::vec(any::<u8>(), 0..60)), 1..15),
        noise in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
    ) {
        let mut buffer = vec![0xA5; FRAME_LEN_MAX];
        let mut writer = FrameWriter::new(&mut buffer, BROADCAST, [0x10; 6]).unwrap();
        for (command, index, address, data) in &all {
            writer.push_data(Command::from(*command), *index, *address, data).unwrap();
        }
        let length = writer.finish();
        let frame = Frame::parse(&buffer[..length]).unwrap();
        let read: Vec<_> = frame
            .datagrams()
            .map(|datagram| (datagram.command.into(), datagram.index, datagram.address, datagram.data.to_vec()))
            .collect();
        prop_assert_eq!(read, all);
        // Changed in flight, it is read or refused, and what is read can be written.
        for (at, value) in &noise {
            let at = at.index(length);
            buffer[at] = *value;
        }
        if let Ok(changed) = Frame::parse(&buffer[..length]) {
            let mut again = vec![0x5A; FRAME_LEN_MAX];
            let written = changed.emit(&mut again).unwrap();
            let read = Frame::parse(&again[..written]).unwrap();
            prop_assert!(read.datagrams().eq(changed.datagrams()));
        }
    }
}
