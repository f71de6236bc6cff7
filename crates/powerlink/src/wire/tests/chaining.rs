//! SyncRequest and SyncResponse. No capture of them is at hand: the octets were written by hand from the field table, and
//! tshark's `epl` dissector reads the same values from them.

use super::*;

#[test]
fn a_sync_request_that_sets_everything() {
    let octets = frame(
        "01 11 1e 00 00 03 02 00 5e 00 00 01 88 ab 05 ff f0 5d 00 00 06 20 20 00
         3f 00 00 80 e8 03 00 00 d0 07 00 00 01 02 03 04 05 06 07 08 40 4b 4c 00 02 00 5e 00 00 04",
        54,
    );
    let soa = Soa {
        sync: SyncRequest {
            pres_time_first_ns: Some(1000),
            pres_time_second_ns: Some(2000),
            mn_delay_first_ns: Some(0x0403_0201),
            mn_delay_second_ns: Some(0x0807_0605),
            fall_back_timeout_ns: Some(5_000_000),
            destination: Some(CN110_MAC),
            mode_reset: false,
            mode_set: true,
        },
        ..Soa::new(NmtState::PreOperational2, RequestedService::SyncRequest, 0x20)
    };
    let header = Header::multicast(multicast::SOA, MN_MAC, node::MN);
    assert_eq!(Frame::parse(&octets), Ok(Frame::Soa(soa)));
    let mut buffer = [0xA5; 60];
    assert_eq!(soa.emit(&header, &mut buffer), Ok(60));
    assert_eq!(buffer[..54], octets);
    assert_eq!(buffer[54..], [0; 6]);
    for cut in 24..54 {
        let Ok(Frame::Soa(short)) = Frame::parse(&octets[..cut]) else {
            panic!("{cut} octets")
        };
        assert_eq!(short.sync, SyncRequest::default(), "{cut} octets");
    }
}

#[test]
fn each_bit_of_a_sync_request_has_its_field() {
    let header = Header::multicast(multicast::SOA, MN_MAC, node::MN);
    let none = SyncRequest::default();
    let cases: [(SyncRequest, u32, usize); 8] = [
        (
            SyncRequest {
                pres_time_first_ns: Some(0xAA),
                ..none
            },
            1,
            28,
        ),
        (
            SyncRequest {
                pres_time_second_ns: Some(0xAA),
                ..none
            },
            2,
            32,
        ),
        (
            SyncRequest {
                mn_delay_first_ns: Some(0xAA),
                ..none
            },
            4,
            36,
        ),
        (
            SyncRequest {
                mn_delay_second_ns: Some(0xAA),
                ..none
            },
            8,
            40,
        ),
        (
            SyncRequest {
                fall_back_timeout_ns: Some(0xAA),
                ..none
            },
            16,
            44,
        ),
        (
            SyncRequest {
                destination: Some([0xAA, 0, 0, 0, 0, 0]),
                ..none
            },
            32,
            48,
        ),
        (
            SyncRequest {
                mode_reset: true,
                ..none
            },
            0x4000_0000,
            0,
        ),
        (SyncRequest { mode_set: true, ..none }, 0x8000_0000, 0),
    ];
    for (sync, bits, at) in cases {
        let soa = Soa {
            sync,
            ..Soa::new(NmtState::Operational, RequestedService::SyncRequest, 7)
        };
        let mut buffer = [0xA5; 60];
        soa.emit(&header, &mut buffer).unwrap();
        assert_eq!(buffer[24..28], bits.to_le_bytes(), "{sync:?}");
        for (position, octet) in buffer.iter().enumerate().skip(28) {
            assert_eq!(
                *octet,
                if position == at { 0xAA } else { 0 },
                "octet {position} of {sync:?}"
            );
        }
        assert_eq!(Frame::parse(&buffer), Ok(Frame::Soa(soa)));
    }
}

#[test]
fn the_area_is_zero_with_any_other_service() {
    let header = Header::multicast(multicast::SOA, MN_MAC, node::MN);
    let soa = Soa {
        sync: SyncRequest {
            mode_set: true,
            ..SyncRequest::default()
        },
        ..Soa::new(NmtState::Operational, RequestedService::StatusRequest, 7)
    };
    let mut buffer = [0xA5; 60];
    soa.emit(&header, &mut buffer).unwrap();
    assert_eq!(buffer[24..], [0; 36]);
    buffer[24] = 0xFF;
    let Ok(Frame::Soa(read)) = Frame::parse(&buffer) else {
        panic!()
    };
    assert_eq!(read.sync, SyncRequest::default());
}

#[test]
fn a_sync_response() {
    let octets = frame(
        "01 11 1e 00 00 04 02 00 5e 00 00 04 88 ab 06 ff 6e 06 00 00
         01 00 00 80 50 c3 00 00 f0 00 00 00 10 27 00 00 e8 03 00 00 d0 07 00 00",
        60,
    );
    let response = SyncResponse {
        pres_time_first_valid: true,
        pres_time_second_valid: false,
        mode_set: true,
        latency_ns: 50_000,
        sync_node: 240,
        delay_ns: 10_000,
        pres_time_first_ns: 1000,
        pres_time_second_ns: 2000,
    };
    let header = Header::multicast(multicast::ASND, CN110_MAC, 110);
    check(
        &octets,
        header,
        Frame::Asnd(Asnd::SyncResponse(response)),
        SYNC_RESPONSE_LEN,
    );
    let second = SyncResponse {
        pres_time_second_valid: true,
        ..SyncResponse::default()
    };
    let mut buffer = [0xA5; 60];
    Asnd::SyncResponse(second).emit(&header, &mut buffer).unwrap();
    assert_eq!(buffer[17..24], [6, 0, 0, 2, 0, 0, 0]);
}
