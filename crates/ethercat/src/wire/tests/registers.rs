//! Registers: fixed octets, all values there and back.

use super::octets;
use crate::wire::WireError;
use crate::wire::register::*;
use std::collections::BTreeSet;
use std::string::ToString;

#[test]
fn the_difference_of_clocks_is_sign_and_magnitude() {
    // Bit 31: the local clock is ahead.
    assert_eq!(difference_ns(0x8000_0005), 5);
    assert_eq!(difference_ns(0x0000_0005), -5);
    assert_eq!(difference_ns(0), 0);
    assert_eq!(difference_ns(0x8000_0000), 0);
    for ns in [0, 1, -1, 1000, -1000, i32::MAX, -i32::MAX] {
        assert_eq!(difference_ns(difference_register(ns)), ns);
    }
    // ORed, it is an upper bound; two's complement would not be.
    let all = difference_register(-6) | difference_register(-9) | difference_register(3);
    assert!(difference_ns(all).abs() >= 9);
}

#[test]
fn ports_tell_link_and_loop() {
    // In the middle of a line, and at its end.
    let middle = DlStatus(0x5A31);
    assert!((0..4).map(|port| middle.is_open(port)).eq([true, true, false, false]));
    assert!((0..4).map(|port| middle.is_closed(port)).eq([false, false, true, true]));
    let end = DlStatus(0x5611);
    assert!((0..4).map(|port| end.link(port)).eq([true, false, false, false]));
    assert_eq!(DlStatus::of_links([true, true, false, false]).0, 0x5A33);
    assert_eq!(DlStatus::of_links([true, false, false, false]).0, 0x5613);
}

#[test]
fn sync_managers_are_read_and_written() {
    let outputs = SyncManager {
        start: 0x1100,
        length: 12,
        control: SyncManager::OUTPUTS,
        status: 0,
        activate: 1,
        pdi: 0,
    };
    let mut buffer = [0xA5; 9];
    outputs.emit(&mut buffer).unwrap();
    assert_eq!(buffer[..], octets("00 11 0c 00 64 00 01 00 a5", 9));
    assert_eq!(SyncManager::parse(&buffer), Ok(outputs));
    assert!(outputs.is_active() && outputs.is_written() && !outputs.is_mailbox());
    for got in 0..SyncManager::LEN {
        assert_eq!(
            SyncManager::parse(&buffer[..got]),
            Err(WireError::TooShort { need: 8, got })
        );
        assert!(outputs.emit(&mut buffer[..got]).is_err());
    }
}

#[test]
fn fmmus_are_read_and_written() {
    let bits = Fmmu {
        logical: 0x0001_0203,
        length: 2,
        first_bit: 6,
        last_bit: 1,
        physical: 0x0F00,
        physical_bit: 3,
        kind: Fmmu::WRITE,
        active: true,
    };
    let mut buffer = [0xA5; 17];
    bits.emit(&mut buffer).unwrap();
    assert_eq!(
        buffer[..],
        octets("03 02 01 00 02 00 06 01 00 0f 03 02 01 00 00 00 a5", 17)
    );
    assert_eq!(Fmmu::parse(&buffer), Ok(bits));
    for got in 0..Fmmu::LEN {
        assert_eq!(Fmmu::parse(&buffer[..got]), Err(WireError::TooShort { need: 16, got }));
        assert!(bits.emit(&mut buffer[..got]).is_err());
    }
}

#[test]
fn states_keep_their_unknown_values() {
    for octet in 0..=u8::MAX {
        assert_eq!(u8::from(AlState::from(octet)), octet & 0x0F);
        let word = u16::from(octet & 0x3F);
        assert_eq!(u16::from(AlStatus::from(word)), word);
        assert_eq!(u16::from(AlControl::from(word)), word);
    }
    let refused = AlStatus::from(0x0012);
    assert!(refused.error && refused.state == AlState::PreOp);
    assert_eq!(AlState::from(0x0C).to_string(), "unknown state 12");
}

#[test]
fn status_codes_have_words() {
    let codes: BTreeSet<u16> = AlStatusCode::ALL.iter().map(|code| code.0).collect();
    assert_eq!(codes.len(), AlStatusCode::ALL.len());
    let texts: BTreeSet<&str> = AlStatusCode::ALL.iter().map(|code| code.text()).collect();
    assert_eq!(texts.len(), AlStatusCode::ALL.len());
    assert_eq!(
        AlStatusCode(0x001B).to_string(),
        "001Bh (no outputs came in time (SyncManager watchdog))"
    );
    assert_eq!(AlStatusCode(0x8123).text(), "a code of the maker");
    assert_eq!(AlStatusCode(0x0FFF).text(), "unknown status code");
}

/// `replay-dc`, frame 506: times of a device whose ports 0 and 1 are open; port 3 holds garbage.
#[test]
fn receive_times_of_all_ports() {
    let data = octets("52 0f 62 3c aa 11 62 3c 00 00 00 00 56 65 72 6c", 16);
    assert_eq!(receive_times(&data), Ok([0x3C62_0F52, 0x3C62_11AA, 0, 0x6C72_6556]));
    for got in 0..16 {
        assert!(receive_times(&data[..got]).is_err());
    }
}

#[test]
fn addresses_of_registers() {
    assert_eq!(station(0x1001, AL_STATUS), 0x0130_1001);
    // Position 1 is addressed by -1: the first device makes it 0.
    assert_eq!(position(1, STATION), 0x0010_FFFF);
    assert_eq!((sync_manager(3), fmmu(2)), (0x0818, 0x0620));
}
