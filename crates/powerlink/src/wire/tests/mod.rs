//! Octets from outside: traffic of an openPOWERLINK 2.7.2 network, `openpowerlink-mn-3cn-10ms.pcap` ("capture");
//! the number in each test is the frame's. They are written out here, so that an offset wrong in `parse` and `emit`
//! alike is found.

use super::*;
use crate::nmt::{NmtCommand, NmtState};
use proptest::prelude::*;
use std::string::ToString;
use std::vec;
use std::vec::Vec;

mod addresses;
mod chaining;

const MN_MAC: Mac = [0x02, 0x00, 0x5E, 0x00, 0x00, 0x01];
const CN1_MAC: Mac = [0x02, 0x00, 0x5E, 0x00, 0x00, 0x02];
const CN110_MAC: Mac = [0x02, 0x00, 0x5E, 0x00, 0x00, 0x04];

/// Octets from hexadecimal text, zeros up to `len`.
fn frame(hex: &str, len: usize) -> Vec<u8> {
    let mut octets: Vec<u8> = hex
        .split_whitespace()
        .map(|word| u8::from_str_radix(word, 16).unwrap())
        .collect();
    assert!(octets.len() <= len);
    octets.resize(len, 0);
    octets
}

/// The frame is read as `expected`, written back into a dirty buffer identically up to padding, and refused or read
/// without a panic when cut anywhere.
fn check(octets: &[u8], header: Header, expected: Frame<'_>, shortest: usize) {
    assert_eq!(Header::parse(octets), Ok(header));
    assert_eq!(Frame::parse(octets), Ok(expected));
    let mut buffer = [0xA5; FRAME_LEN_MAX];
    let len = expected.emit(&header, &mut buffer).unwrap();
    assert_eq!(len, octets.len().max(FRAME_LEN_MIN));
    assert_eq!(&buffer[..octets.len()], octets);
    assert!(
        buffer[octets.len()..len].iter().all(|octet| *octet == 0),
        "padding is not zero"
    );
    assert!(buffer[len..].iter().all(|octet| *octet == 0xA5), "wrote past the frame");
    for cut in 0..octets.len() {
        let got = Frame::parse(&octets[..cut]);
        if cut < shortest {
            let refused = matches!(got, Err(WireError::TooShort { .. } | WireError::PayloadSize { .. }));
            assert!(refused, "{cut} octets: {got:?}");
        } else {
            assert!(got.is_ok(), "{cut} octets: {got:?}");
        }
    }
    for short in 0..len {
        assert!(matches!(
            expected.emit(&header, &mut buffer[..short]),
            Err(WireError::NoRoom { .. })
        ));
    }
}

#[test]
fn soc_of_frame_947() {
    let octets = frame(
        "01 11 1e 00 00 01 02 00 5e 00 00 01 88 ab 01 ff f0 00 00 00 fa fe 00 6b fe a1 bc 0c",
        36,
    );
    let soc = Soc {
        multiplexed_cycle: false,
        prescaled_slot: false,
        net_time: NetTime {
            seconds: 0x6B00_FEFA,
            nanoseconds: 0x0CBC_A1FE,
        },
        relative_time_us: 0,
    };
    check(
        &octets,
        Header::multicast(multicast::SOC, MN_MAC, node::MN),
        Frame::Soc(soc),
        SOC_LEN,
    );
}

#[test]
fn soc_flags_and_relative_time() {
    let soc = Soc {
        multiplexed_cycle: true,
        prescaled_slot: true,
        net_time: NetTime::default(),
        relative_time_us: 0x0807_0605_0403_0201,
    };
    let mut buffer = [0xA5; 64];
    assert_eq!(
        soc.emit(&Header::multicast(multicast::SOC, MN_MAC, node::MN), &mut buffer),
        Ok(60)
    );
    assert_eq!(buffer[17..20], [0, 0xC0, 0]);
    assert_eq!(buffer[28..36], [1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(Frame::parse(&buffer[..60]), Ok(Frame::Soc(soc)));
}

#[test]
fn preq_of_frame_977() {
    let octets = frame(
        "02 00 5e 00 00 04 02 00 5e 00 00 01 88 ab 03 6e f0 00 01 00 00 00 01 00 40",
        60,
    );
    let header = Header {
        destination: CN110_MAC,
        source: MN_MAC,
        destination_node: 110,
        source_node: 240,
    };
    let preq = Preq {
        multiplexed: false,
        exception_acknowledge: false,
        ready: true,
        pdo_version: 0,
        payload: &[0x40],
    };
    check(&octets, header, Frame::Preq(preq), 25);
}

#[test]
fn pres_of_frame_964() {
    let octets = frame(
        "01 11 1e 00 00 02 02 00 5e 00 00 04 88 ab 04 ff 6e 5d 00 00 00 00 00 00",
        60,
    );
    let pres = Pres {
        nmt_state: NmtState::PreOperational2,
        multiplexed: false,
        exception_new: false,
        ready: false,
        requests: Requests::default(),
        pdo_version: 0,
        payload: &[],
    };
    check(
        &octets,
        Header::multicast(multicast::PRES, CN110_MAC, 110),
        Frame::Pres(pres),
        24,
    );
}

#[test]
fn flags_of_preq_and_pres() {
    let header = Header::multicast(multicast::PRES, CN1_MAC, 1);
    let preq = Preq {
        multiplexed: true,
        exception_acknowledge: true,
        ready: false,
        pdo_version: 0x21,
        payload: &[7, 8],
    };
    let mut buffer = [0xA5; 200];
    assert_eq!(
        preq.emit(&header, 100, &mut buffer),
        Ok(124),
        "the limit, not the payload, makes the length"
    );
    assert_eq!(buffer[17..26], [0, 0x24, 0, 0x21, 0, 2, 0, 7, 8]);
    assert_eq!(buffer[26..124], [0; 98]);
    assert_eq!(Frame::parse(&buffer[..124]), Ok(Frame::Preq(preq)));
    let pres = Pres {
        nmt_state: NmtState::Operational,
        multiplexed: true,
        exception_new: true,
        ready: true,
        requests: Requests {
            count: 2,
            priority: Requests::PRIORITY_GENERIC,
        },
        pdo_version: 0x10,
        payload: &[9],
    };
    assert_eq!(pres.emit(&header, 36, &mut buffer), Ok(60));
    assert_eq!(buffer[17..25], [0xFD, 0x31, 0x1A, 0x10, 0, 1, 0, 9]);
    assert_eq!(Frame::parse(&buffer[..60]), Ok(Frame::Pres(pres)));
}

#[test]
fn the_size_field_is_not_believed() {
    let mut octets = frame(
        "01 11 1e 00 00 02 02 00 5e 00 00 04 88 ab 04 ff 6e fd 01 00 00 00 24 00",
        60,
    );
    let Ok(Frame::Pres(pres)) = Frame::parse(&octets) else {
        panic!("36 octets fit")
    };
    assert_eq!(pres.payload.len(), 36);
    octets[22] = 37;
    assert_eq!(
        Frame::parse(&octets),
        Err(WireError::PayloadSize { size: 37, room: 36 })
    );
    octets[23] = 0xFF;
    assert_eq!(
        Frame::parse(&octets),
        Err(WireError::PayloadSize { size: 0xFF25, room: 36 })
    );
    let too_much = vec![0; PAYLOAD_MAX + 1];
    let preq = Preq {
        multiplexed: false,
        exception_acknowledge: false,
        ready: true,
        pdo_version: 0,
        payload: &too_much,
    };
    let header = Header::multicast(multicast::PRES, MN_MAC, 240);
    assert!(preq.emit(&header, 0, &mut [0; 2000]).is_err());
    let most = Preq {
        payload: &too_much[..PAYLOAD_MAX],
        ..preq
    };
    assert_eq!(most.emit(&header, 0, &mut [0; 2000]), Ok(FRAME_LEN_MAX));
}

#[test]
fn soa_of_frames_1_11_and_965() {
    let header = Header::multicast(multicast::SOA, MN_MAC, node::MN);
    let octets = frame(
        "01 11 1e 00 00 03 02 00 5e 00 00 01 88 ab 05 ff f0 1d 00 00 00 00 20",
        54,
    );
    let soa = Soa::new(NmtState::PreOperational1, RequestedService::NoService, 0);
    check(&octets, header, Frame::Soa(soa), 24);
    let octets = frame(
        "01 11 1e 00 00 03 02 00 5e 00 00 01 88 ab 05 ff f0 1d 00 00 03 f0 20",
        54,
    );
    let soa = Soa::new(NmtState::PreOperational1, RequestedService::NmtRequestInvite, node::MN);
    check(&octets, header, Frame::Soa(soa), 24);
    let octets = frame(
        "01 11 1e 00 00 03 02 00 5e 00 00 01 88 ab 05 ff f0 fd 02 00 02 6e 20",
        54,
    );
    let soa = Soa {
        exception_reset: true,
        ..Soa::new(NmtState::Operational, RequestedService::StatusRequest, 110)
    };
    check(&octets, header, Frame::Soa(soa), 24);
}

#[test]
fn ident_response_of_frame_949() {
    let octets = frame(
        "01 11 1e 00 00 04 02 00 5e 00 00 02 88 ab 06 ff 01 01 00 00 1d 00 20 00 65 02 01 00 dc 05 24 00
         24 00 50 c3 00 00 00 00 91 01 0f 00 00 00 00 00 00 00 00 00 07 00 02 00 00 00 00 00 00 00 00 00
         00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 01 64 a8 c0 00 ff ff ff fe 64 a8 c0
         30 31 2d 66 66 66 66 66 66 66 66",
        176,
    );
    let mut host_name = [0; 32];
    host_name[..11].copy_from_slice(b"01-ffffffff");
    let ident = IdentResponse {
        feature_flags: 0x0001_0265,
        mtu: 1500,
        response_time_ns: 50_000,
        device_type: 0x000F_0191,
        revision: 0x0002_0007,
        ip_address: 0xC0A8_6401,
        subnet_mask: 0xFFFF_FF00,
        default_gateway: 0xC0A8_64FE,
        host_name,
        ..IdentResponse::default()
    };
    check(
        &octets,
        Header::multicast(multicast::ASND, CN1_MAC, 1),
        Frame::Asnd(Asnd::IdentResponse(ident)),
        IDENT_RESPONSE_LEN,
    );
}

#[test]
fn every_field_of_an_ident_response_has_its_place() {
    let octets: Vec<u8> = (0..176).map(|at| at as u8).collect();
    let mut octets = octets;
    octets[12..18].copy_from_slice(&[0x88, 0xAB, 0x06, 0xFF, 0x01, 0x01]);
    let Ok(Frame::Asnd(Asnd::IdentResponse(ident))) = Frame::parse(&octets) else {
        panic!()
    };
    assert_eq!(ident.requests, Requests { count: 3, priority: 2 });
    assert_eq!(ident.nmt_state, NmtState::Unknown(20));
    assert_eq!(ident.epl_version, 22);
    let fields = [
        (ident.feature_flags, 24u8),
        (ident.response_time_ns, 34),
        (ident.device_type, 40),
        (ident.vendor_id, 44),
        (ident.product_code, 48),
        (ident.revision, 52),
        (ident.serial, 56),
        (ident.configuration_date, 68),
        (ident.configuration_time, 72),
        (ident.software_date, 76),
        (ident.software_time, 80),
        (ident.ip_address, 84),
        (ident.subnet_mask, 88),
        (ident.default_gateway, 92),
    ];
    for (value, at) in fields {
        assert_eq!(value, u32::from_le_bytes([at, at + 1, at + 2, at + 3]), "field at {at}");
    }
    assert_eq!(
        (ident.mtu, ident.poll_in_size, ident.poll_out_size),
        (0x1D1C, 0x1F1E, 0x2120)
    );
    assert_eq!(
        (
            ident.vendor_extension_1[0],
            ident.host_name[0],
            ident.vendor_extension_2[47]
        ),
        (60, 96, 175)
    );
}

#[test]
fn status_response_of_frame_966() {
    let octets = frame("01 11 1e 00 00 04 02 00 5e 00 00 04 88 ab 06 ff 6e 02 08 00 5d", 72);
    let entries = [0; 40];
    let status = StatusResponse {
        exception_clear: true,
        exception_new: false,
        requests: Requests::default(),
        nmt_state: NmtState::PreOperational2,
        static_errors: [0; 8],
        entries: ErrorEntries(&entries),
    };
    assert_eq!(status.entries.iter().count(), 0);
    // The error list ends where the frame ends, so a cut frame is a shorter list: only the start is fixed.
    let header = Header::multicast(multicast::ASND, CN110_MAC, 110);
    assert_eq!(Frame::parse(&octets), Ok(Frame::Asnd(Asnd::StatusResponse(status))));
    let mut buffer = [0xA5; 100];
    assert_eq!(
        Frame::Asnd(Asnd::StatusResponse(status)).emit(&header, &mut buffer),
        Ok(72)
    );
    assert_eq!(&buffer[..72], &octets[..]);
    for cut in 0..72 {
        assert_eq!(Frame::parse(&octets[..cut]).is_ok(), cut >= 32);
    }
}

#[test]
fn error_entries_end_at_type_zero_and_at_thirteen() {
    let entry = ErrorEntry {
        entry_type: 0x3002,
        code: 0x8232,
        time: NetTime {
            seconds: 0x0403_0201,
            nanoseconds: 0x0807_0605,
        },
        info: [9, 10, 11, 12, 13, 14, 15, 16],
    };
    let octets = entry.to_octets();
    assert_eq!(
        octets,
        [
            0x02, 0x30, 0x32, 0x82, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16
        ]
    );
    let mut list = Vec::new();
    list.extend(octets);
    list.extend([0; 20]);
    list.extend(octets);
    assert_eq!(ErrorEntries(&list).iter().collect::<Vec<_>>(), [entry]);
    assert_eq!(ErrorEntries(&octets[..19]).iter().count(), 0);
    assert_eq!(ErrorEntries(&octets.repeat(20)).iter().count(), ERROR_ENTRIES_MAX);
}

#[test]
fn nmt_command_of_frame_12() {
    let octets = frame("01 11 1e 00 00 04 02 00 5e 00 00 01 88 ab 06 ff f0 04 28 00", 60);
    let command = NmtCommandFrame::plain(NmtCommand::ResetNode);
    let header = Header::multicast(multicast::ASND, MN_MAC, node::MN);
    check(&octets, header, Frame::Asnd(Asnd::NmtCommand(command)), 20);
}

#[test]
fn extended_nmt_command_and_nmt_request() {
    let mut nodes = crate::nmt::NodeList::default();
    nodes.insert(9);
    let command = NmtCommandFrame::extended(NmtCommand::StartNodeEx, nodes);
    let header = Header::multicast(multicast::ASND, MN_MAC, node::MN);
    let mut buffer = [0xA5; 60];
    Asnd::NmtCommand(command).emit(&header, &mut buffer).unwrap();
    assert_eq!(buffer[17..23], [0x04, 0x41, 0, 0, 0x02, 0]);
    assert_eq!(Frame::parse(&buffer), Ok(Frame::Asnd(Asnd::NmtCommand(command))));
    assert!(command.nodes().contains(9));

    let request = NmtRequestFrame {
        command: NmtCommand::StopNode,
        target: 5,
        data: [0; 32],
    };
    Asnd::NmtRequest(request).emit(&header, &mut buffer).unwrap();
    assert_eq!(buffer[17..21], [0x03, 0x22, 5, 0]);
    assert_eq!(Frame::parse(&buffer), Ok(Frame::Asnd(Asnd::NmtRequest(request))));
}

#[test]
fn sdo_container_of_frame_1064() {
    let octets = frame(
        "01 11 1e 00 00 04 02 00 5e 00 00 01 88 ab 06 6e f0 05 02 06 00 00 00 00 00 01 08 00 00 00 11 10
         01 00 6c 6f 61 64",
        60,
    );
    let header = Header {
        destination: multicast::ASND,
        source: MN_MAC,
        destination_node: 110,
        source_node: 240,
    };
    check(&octets, header, Frame::Asnd(Asnd::Sdo(&octets[18..])), 18);
}

#[test]
fn other_services_and_message_types_are_kept_or_named() {
    let mut octets = frame("01 11 1e 00 00 04 02 00 5e 00 00 01 88 ab 06 ff f0 a7 11 22", 60);
    let service = Service {
        id: ServiceId::Unknown(0xA7),
        data: &octets.clone()[18..],
    };
    assert_eq!(Frame::parse(&octets), Ok(Frame::Asnd(Asnd::Other(service))));
    octets[14] = 0x07;
    assert!(matches!(Frame::parse(&octets), Ok(Frame::Amni(_))));
    octets[14] = 0x0D;
    assert!(matches!(Frame::parse(&octets), Ok(Frame::Ainv(_))));
    octets[14] = 0x86;
    assert!(
        matches!(Frame::parse(&octets), Ok(Frame::Asnd(_))),
        "bit 7 is no part of the type"
    );
    octets[14] = 0x02;
    assert_eq!(Frame::parse(&octets), Err(WireError::MessageType { got: 2 }));
    octets[13] = 0x00;
    assert_eq!(Frame::parse(&octets), Err(WireError::EtherType { got: 0x8800 }));
    assert_eq!(Frame::parse(&[0; 1515]), Err(WireError::TooLong { got: 1515 }));
}

#[test]
fn every_octet_of_service_ids_survives() {
    for octet in 0..=u8::MAX {
        assert_eq!(u8::from(ServiceId::from(octet)), octet);
        assert_eq!(u8::from(RequestedService::from(octet)), octet);
        assert_eq!(Requests::from_octet(octet).to_octet(), octet & 0x3F);
    }
}

proptest! {
    #[test]
    fn any_octets_never_panic_and_what_is_read_can_be_written(
        mut octets in proptest::collection::vec(any::<u8>(), 0..1600), kind in 0u8..16, service in 0u8..9,
    ) {
        if octets.len() > 17 {
            octets[12..15].copy_from_slice(&[0x88, 0xAB, kind]);
            octets[17] = service;
        }
        if let Ok(frame) = Frame::parse(&octets) {
            let header = Header::parse(&octets).unwrap();
            let mut first = [0xA5; FRAME_LEN_MAX];
            let len = frame.emit(&header, &mut first).unwrap();
            let mut second = [0x5A; FRAME_LEN_MAX];
            let again = Frame::parse(&first[..len]).unwrap();
            prop_assert_eq!(again.emit(&header, &mut second), Ok(len));
            prop_assert_eq!(&first[..len], &second[..len]);
        }
    }
}
