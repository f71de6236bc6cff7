//! EEPROM images: one of a drive, one of a terminal, any octets.

use super::octets;
use crate::wire::WireError;
use crate::wire::sii::*;
use proptest::prelude::*;
use std::vec::Vec;

fn drive() -> Image<'static> {
    const MAILBOXES: Mailboxes = Mailboxes {
        receive: Area {
            start: 0x1000,
            length: 128,
        },
        send: Area {
            start: 0x1080,
            length: 128,
        },
        protocols: protocol::COE,
    };
    const fn entry(start: u16, length: u16, control: u8, usage: Usage) -> SyncManagerEntry {
        SyncManagerEntry {
            start,
            length,
            control,
            enable: 1,
            usage,
        }
    }
    const MANAGERS: &[SyncManagerEntry] = &[
        entry(0x1000, 128, 0x26, Usage::MailboxOut),
        entry(0x1080, 128, 0x22, Usage::MailboxIn),
        entry(0x1100, 12, 0x64, Usage::Outputs),
        entry(0x1400, 16, 0x20, Usage::Inputs),
    ];
    const ENTRIES: &[PdoEntry] = &[
        PdoEntry {
            index: 0x6040,
            sub: 0,
            name: 0,
            data_type: 6,
            bits: 16,
        },
        PdoEntry {
            index: 0,
            sub: 0,
            name: 0,
            data_type: 0,
            bits: 8,
        },
    ];
    const RX: &[PdoImage<'static>] = &[PdoImage {
        index: 0x1600,
        sync_manager: 2,
        entries: ENTRIES,
    }];
    Image {
        pdi: 5,
        alias: 7,
        identity: Identity {
            vendor: 2,
            product: 0x1234,
            revision: 3,
            serial: 99,
        },
        mailboxes: MAILBOXES,
        strings: &["SERVO", "Servo drive"],
        general: General {
            order: 1,
            name: 2,
            coe: 0x0F,
            ports: 0x0011,
            ebus_ma: -5,
            ..General::default()
        },
        fmmus: &[1, 2],
        sync_managers: MANAGERS,
        rx_pdos: RX,
        ..Image::default()
    }
}

#[test]
fn an_image_is_read_as_it_was_written() {
    let mut eeprom = [0xA5; 2048];
    let image = drive();
    let length = image.emit(&mut eeprom).unwrap();
    assert_eq!(eeprom[0x7C..0x80], [15, 0, 1, 0], "16 KiBit less one; version");
    assert!(eeprom[length..].iter().all(|octet| *octet == 0xFF));
    let sii = Sii::parse(&eeprom).unwrap();
    assert_eq!(sii.length(), Some(length));
    assert!(sii.checksum_is_right());
    assert_eq!((sii.alias(), sii.identity(), sii.size()), (7, image.identity, 2048));
    assert_eq!(sii.mailboxes(), image.mailboxes);
    assert_eq!(sii.string(1), Some(&b"SERVO"[..]));
    assert_eq!(sii.string(2), Some(&b"Servo drive"[..]));
    assert_eq!((sii.string(0), sii.string(3)), (None, None));
    assert_eq!(sii.general(), Some(image.general));
    assert_eq!(sii.fmmus(), [1, 2]);
    assert!(sii.sync_managers().eq(image.sync_managers.iter().copied()));
    let pdos: Vec<_> = sii.pdos(category::RX_PDO).collect();
    assert_eq!(
        (pdos.len(), pdos[0].index, pdos[0].sync_manager, pdos[0].bits()),
        (1, 0x1600, 2, 24)
    );
    assert!(pdos[0].entries().eq(image.rx_pdos[0].entries.iter().copied()));
    assert_eq!(sii.pdos(category::TX_PDO).count(), 0);
    for short in 0..length {
        assert!(
            matches!(image.emit(&mut eeprom[..short]), Err(WireError::NoRoom { .. })),
            "{short}"
        );
    }
    // The octets themselves: general is 32 octets, an FMMU octet each.
    image.emit(&mut eeprom).unwrap();
    assert_eq!(eeprom[0x80..0x84], octets("0a 00 0a 00", 4));
    assert_eq!(eeprom[0x84..0x98], *b"\x02\x05SERVO\x0bServo drive\0");
    assert_eq!(eeprom[0x98..0x9C], octets("1e 00 10 00", 4));
    assert_eq!(eeprom[0xBC..0xC2], octets("28 00 01 00 01 02", 6));
}

#[test]
fn a_cut_image_is_read_as_far_as_it_goes() {
    let mut eeprom = [0; 1024];
    let length = drive().emit(&mut eeprom).unwrap();
    let whole = Sii::parse(&eeprom).unwrap().categories().count();
    assert_eq!(whole, 5);
    for cut in 0..length {
        let Ok(sii) = Sii::parse(&eeprom[..cut]) else {
            assert!(cut < HEADER_LEN);
            continue;
        };
        assert_eq!(sii.length(), None, "{cut}");
        assert!(sii.categories().count() <= whole);
    }
}

#[test]
fn the_check_sum_is_a_crc_8() {
    assert_eq!(checksum(&[0; 14]), bitwise(&[0; 14]));
    // "123456789" is the usual check of a CRC; with start FFh and polynomial 07h it is FBh.
    assert_eq!(bitwise(b"123456789"), 0xFB);
    let image = drive();
    let mut eeprom = [0; 1024];
    image.emit(&mut eeprom).unwrap();
    assert_eq!(eeprom[14], bitwise(&eeprom[..14]));
    for bit in 0..8 * 14 {
        let mut changed = eeprom;
        changed[bit / 8] ^= 1 << (bit % 8);
        assert!(!Sii::parse(&changed).unwrap().checksum_is_right(), "bit {bit}");
    }
}

/// The same by division of polynomials, bit after bit.
fn bitwise(octets: &[u8]) -> u8 {
    let mut register = 0xFF_u16;
    for octet in octets {
        for bit in (0..8).rev() {
            let out = register >> 7 & 1 ^ u16::from(octet >> bit) & 1;
            register = register << 1 & 0xFF;
            if out == 1 {
                register ^= 0x07;
            }
        }
    }
    register as u8
}

proptest! {
    #[test]
    fn any_image_is_read_or_refused(
        noise in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..20),
        random in prop::collection::vec(any::<u8>(), 0..600),
    ) {
        look_at(&random);
        let mut eeprom = [0xFF; 512];
        drive().emit(&mut eeprom).unwrap();
        for (at, value) in noise {
            eeprom[at.index(512)] = value;
        }
        look_at(&eeprom);
    }
}

fn look_at(octets: &[u8]) {
    let Ok(sii) = Sii::parse(octets) else { return };
    sii.categories().for_each(drop);
    sii.sync_managers().for_each(drop);
    (0..=u8::MAX).for_each(|number| assert!(number > 0 || sii.string(number).is_none()));
    for direction in [category::RX_PDO, category::TX_PDO] {
        sii.pdos(direction).for_each(|pdo| assert!(pdo.bits() <= 255 * 255));
    }
    let _ = (
        sii.general(),
        sii.fmmus(),
        sii.identity(),
        sii.mailboxes(),
        sii.length(),
        sii.size(),
    );
}
