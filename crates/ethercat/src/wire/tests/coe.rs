//! Mails and SDOs, octet by octet.

use super::octets;
use crate::wire::WireError;
use crate::wire::coe::*;
use crate::wire::mailbox::{self, Mail, MailError, Protocol};
use obd::AbortCode;
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

const fn object(index: u16, sub: u8) -> Object {
    Object {
        index,
        sub,
        complete: false,
    }
}

/// The message is written into a dirty mailbox as `hex`, zeros behind it, read back, and never panics when cut.
fn check(message: Message<'_>, hex: &str) {
    let mut mail = [0xA5; 64];
    message.emit(3, &mut mail).unwrap();
    assert_eq!(mail[..], octets(hex, 64), "{message:?}");
    let read = Mail::parse(&mail).unwrap();
    assert_eq!((read.protocol, read.counter, read.address), (Protocol::CoE, 3, 0));
    assert_eq!(Message::parse(read.data), Ok(message));
    let used = mailbox::HEADER_LEN + read.data.len();
    for cut in 0..used {
        assert!(Mail::parse(&mail[..cut]).is_err(), "{cut}");
        assert!(matches!(
            message.emit(3, &mut [0; 64][..cut]),
            Err(WireError::NoRoom { .. })
        ));
    }
    for cut in 0..read.data.len() {
        let _ = Message::parse(&read.data[..cut]);
    }
}

/// `replay-ek1914-segmented-upload`, frames 955 and 964: an upload of 1008h/0 and the answer in one mail.
#[test]
fn an_upload_as_a_device_of_beckhoff_answers_it() {
    let mail = octets("0a 00 00 00 00 13 00 20 40 08 10 00 00 00 00 00", 256);
    let mut written = [0xA5; 256];
    Message::Request(SdoRequest::Upload(object(0x1008, 0)))
        .emit(1, &mut written)
        .unwrap();
    assert_eq!(written[..], mail);
    let answer = octets(
        "10 00 00 00 00 13 00 30 41 08 10 00 06 00 00 00 45 4b 31 39 31 34 31 d0 3f e7 c1 c2",
        256,
    );
    let mail = Mail::parse(&answer).unwrap();
    assert_eq!(mail.counter, 1);
    let response = SdoResponse::Upload {
        object: object(0x1008, 0),
        total: 6,
        data: b"EK1914",
    };
    assert_eq!(Message::parse(mail.data), Ok(Message::Response(response)));
}

#[test]
fn downloads() {
    let value = |octets: &[u8]| Bytes4::new(octets).unwrap();
    let to = object(0x6060, 2);
    for (octets, command) in [
        (&[8][..], "2f"),
        (&[8, 9], "2b"),
        (&[8, 9, 10], "27"),
        (&[8, 9, 10, 11], "23"),
    ] {
        let text: Vec<_> = octets.iter().map(|octet| std::format!("{octet:02x}")).collect();
        let hex = std::format!("0a 00 00 00 00 33 00 20 {command} 60 60 02 {}", text.join(" "));
        check(
            Message::Request(SdoRequest::DownloadExpedited {
                object: to,
                value: value(octets),
            }),
            &hex,
        );
    }
    assert_eq!((Bytes4::new(&[]), Bytes4::new(&[0; 5])), (None, None));
    check(
        Message::Response(SdoResponse::DownloadDone(to)),
        "0a 00 00 00 00 33 00 30 60 60 60 02",
    );
    check(
        Message::Request(SdoRequest::Download {
            object: to,
            total: 9,
            data: &[1, 2, 3, 4, 5, 6, 7, 8, 9],
        }),
        "13 00 00 00 00 33 00 20 21 60 60 02 09 00 00 00 01 02 03 04 05 06 07 08 09",
    );
    let all = Object {
        index: 0x1C12,
        sub: 0,
        complete: true,
    };
    check(
        Message::Request(SdoRequest::Download {
            object: all,
            total: 6,
            data: &[1, 0, 0, 0x16, 0, 0],
        }),
        "10 00 00 00 00 33 00 20 31 12 1c 00 06 00 00 00 01 00 00 16",
    );
    check(
        Message::Request(SdoRequest::Upload(all)),
        "0a 00 00 00 00 33 00 20 50 12 1c 00",
    );
}

#[test]
fn segments_of_seven_octets_and_of_eight() {
    let segment = |toggle, last, data| SdoRequest::DownloadSegment(Segment { toggle, last, data });
    let seven = &[1, 2, 3, 4, 5, 6, 7];
    check(
        Message::Request(segment(false, false, seven)),
        "0a 00 00 00 00 33 00 20 00 01 02 03 04 05 06 07",
    );
    check(
        Message::Request(segment(true, true, &[9, 8])),
        "0a 00 00 00 00 33 00 20 1b 09 08",
    );
    let eight = &[1, 2, 3, 4, 5, 6, 7, 8];
    check(
        Message::Request(segment(true, true, eight)),
        "0b 00 00 00 00 33 00 20 11 01 02 03 04 05 06 07 08",
    );
    check(
        Message::Request(segment(false, true, &[])),
        "0a 00 00 00 00 33 00 20 0f",
    );
    check(
        Message::Response(SdoResponse::DownloadSegmentDone { toggle: true }),
        "0a 00 00 00 00 33 00 30 30",
    );
    check(
        Message::Request(SdoRequest::UploadSegment { toggle: true }),
        "0a 00 00 00 00 33 00 20 70",
    );
    let answer = Segment {
        toggle: true,
        last: true,
        data: &[9, 8],
    };
    check(
        Message::Response(SdoResponse::UploadSegment(answer)),
        "0a 00 00 00 00 33 00 30 1b 09 08",
    );
    assert_eq!(segment_room(128), 119);
}

#[test]
fn answers_of_uploads_aborts_emergencies() {
    let to = object(0x6041, 0);
    let value = Bytes4::new(&[0x37, 0x02]).unwrap();
    check(
        Message::Response(SdoResponse::UploadExpedited { object: to, value }),
        "0a 00 00 00 00 33 00 30 4b 41 60 00 37 02",
    );
    let code = AbortCode::NO_OBJECT;
    check(
        Message::Response(SdoResponse::Abort { object: to, code }),
        "0a 00 00 00 00 33 00 30 80 41 60 00 00 00 02 06",
    );
    check(
        Message::Request(SdoRequest::Abort { object: to, code }),
        "0a 00 00 00 00 33 00 20 80 41 60 00 00 00 02 06",
    );
    let emergency = Emergency {
        code: 0x8611,
        register: 0x21,
        data: [1, 2, 3, 4, 5],
    };
    check(
        Message::Emergency(emergency),
        "0a 00 00 00 00 33 00 10 11 86 21 01 02 03 04 05",
    );
}

#[test]
fn information() {
    check(
        Message::InfoRequest(InfoRequest::List(ListKind::All)),
        "08 00 00 00 00 33 00 80 01 00 00 00 01 00",
    );
    check(
        Message::InfoResponse(InfoResponse::List {
            left: 2,
            data: &[1, 0, 0, 0x10],
        }),
        "0a 00 00 00 00 33 00 80 82 00 02 00 01 00 00 10",
    );
    check(
        Message::InfoRequest(InfoRequest::Object { index: 0x1018 }),
        "08 00 00 00 00 33 00 80 03 00 00 00 18 10",
    );
    check(
        Message::InfoResponse(InfoResponse::Object {
            index: 0x1018,
            data_type: 0x23,
            sub_max: 4,
            code: 9,
            name: b"Id",
        }),
        "0e 00 00 00 00 33 00 80 04 00 00 00 18 10 23 00 04 09 49 64",
    );
    check(
        Message::InfoRequest(InfoRequest::Entry {
            index: 0x1018,
            sub: 1,
            wanted: 7,
        }),
        "0a 00 00 00 00 33 00 80 05 00 00 00 18 10 01 07",
    );
    check(
        Message::InfoResponse(InfoResponse::Entry {
            index: 0x1018,
            sub: 1,
            wanted: 0,
            data_type: 7,
            bits: 32,
            access: 7,
            data: b"Vendor",
        }),
        "16 00 00 00 00 33 00 80 06 00 00 00 18 10 01 00 07 00 20 00 07 00 56 65 6e 64 6f 72",
    );
    check(
        Message::InfoResponse(InfoResponse::Error(AbortCode::NO_OBJECT)),
        "0a 00 00 00 00 33 00 80 07 00 00 00 00 00 02 06",
    );
    for number in 0..=300 {
        assert_eq!(u16::from(ListKind::from(number)), number);
    }
}

#[test]
fn counters_go_from_1_to_7() {
    let mut counter = 0;
    let seen: Vec<u8> = (0..9)
        .map(|_| {
            counter = mailbox::next_counter(counter);
            counter
        })
        .collect();
    assert_eq!(seen, [1, 2, 3, 4, 5, 6, 7, 1, 2]);
}

#[test]
fn a_mail_that_was_wrong_is_answered_with_why() {
    let mut mail = [0xA5; 16];
    MailError::PROTOCOL.emit(2, &mut mail).unwrap();
    assert_eq!(mail[..], octets("04 00 00 00 00 20 01 00 02 00", 16));
    let read = Mail::parse(&mail).unwrap();
    assert_eq!(read.protocol, Protocol::Error);
    assert_eq!(MailError::parse(read.data), Ok(MailError::PROTOCOL));
    assert_eq!(MailError(77).text(), "unknown mailbox error");
    for octet in 0..=15 {
        assert_eq!(u8::from(Protocol::from(octet)), octet);
    }
}

#[test]
fn abort_codes_of_coe_have_their_own_words() {
    assert_eq!(abort::text(abort::TOGGLE), "toggle bit not alternated");
    assert_eq!(abort::text(AbortCode::NO_OBJECT), AbortCode::NO_OBJECT.text());
    for code in [
        abort::SUB_0_NOT_ZERO,
        abort::NO_COMPLETE_ACCESS,
        abort::EXCEEDS_MAILBOX,
        abort::MAPPED,
    ] {
        assert!(!AbortCode::ALL.contains(&code));
        assert_ne!(abort::text(code), "unknown abort code");
    }
}

proptest! {
    /// What is read can be written, and is then read as the same message.
    #[test]
    fn any_mail_is_read_or_refused(data in prop::collection::vec(any::<u8>(), 0..200), service in 0_u8..16) {
        let _ = Mail::parse(&data);
        let _ = MailError::parse(&data);
        let mut data = data;
        if data.len() > 2 {
            data[1] = service << 4;
        }
        if let Ok(message) = Message::parse(&data) {
            let mut mail = vec![0xA5; 256];
            message.emit(1, &mut mail).unwrap();
            let again = Mail::parse(&mail).unwrap();
            prop_assert_eq!(Message::parse(again.data), Ok(message));
        }
    }
}
