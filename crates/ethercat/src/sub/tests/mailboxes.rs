//! Mails: full and empty, lost and repeated; SDO in all its forms, information, emergencies.

use super::*;
use crate::wire::coe::{
    Bytes4, Emergency, InfoRequest, InfoResponse, ListKind, Object, SdoRequest, SdoResponse, Segment, abort,
};
use crate::wire::mailbox::{MailError, Protocol};
use obd::AbortCode;

const fn object(index: u16, sub: u8) -> Object {
    Object {
        index,
        sub,
        complete: false,
    }
}

const fn complete(index: u16, sub: u8) -> Object {
    Object {
        index,
        sub,
        complete: true,
    }
}

fn bench() -> Bench {
    let mut bench = Bench::new(vec![drive()]);
    bench.pre_op(0x1001);
    bench
}

fn sdo(bench: &mut Bench, request: SdoRequest<'_>) -> Vec<u8> {
    bench.mail(0x1001, Message::Request(request)).expect("an answer")
}

fn code(answer: &[u8]) -> Option<AbortCode> {
    match Message::parse(answer) {
        Ok(Message::Request(SdoRequest::Abort { code, .. })) => Some(code),
        _ => None,
    }
}

fn upload(bench: &mut Bench, object: Object) -> Result<Vec<u8>, AbortCode> {
    let answer = sdo(bench, SdoRequest::Upload(object));
    match Message::parse(&answer).unwrap() {
        Message::Response(SdoResponse::UploadExpedited { value, .. }) => Ok(value.octets().to_vec()),
        Message::Response(SdoResponse::Upload { total, data, .. }) => {
            let mut value = data.to_vec();
            let mut toggle = false;
            while value.len() < total as usize {
                let answer = sdo(bench, SdoRequest::UploadSegment { toggle });
                let Message::Response(SdoResponse::UploadSegment(segment)) = Message::parse(&answer).unwrap() else {
                    panic!("{answer:02x?}")
                };
                assert_eq!(segment.toggle, toggle);
                value.extend_from_slice(segment.data);
                assert_eq!(segment.last, value.len() == total as usize);
                toggle = !toggle;
            }
            Ok(value)
        }
        Message::Request(SdoRequest::Abort { code, object: refused }) => {
            assert_eq!((refused.index, refused.sub), (object.index, object.sub));
            Err(code)
        }
        other => panic!("{other:?}"),
    }
}

fn download(bench: &mut Bench, object: Object, value: &[u8]) -> Result<(), AbortCode> {
    let request = match Bytes4::new(value).filter(|_| !object.complete) {
        Some(value) => SdoRequest::DownloadExpedited { object, value },
        None => SdoRequest::Download {
            object,
            total: value.len() as u32,
            data: value,
        },
    };
    let answer = sdo(bench, request);
    match Message::parse(&answer).unwrap() {
        Message::Response(SdoResponse::DownloadDone(_)) => Ok(()),
        _ => Err(code(&answer).unwrap()),
    }
}

#[test]
fn a_full_mailbox_takes_no_mail_and_an_empty_one_gives_none() {
    let mut bench = bench();
    let (out, back) = (register::station(0x1001, 0x1000), register::station(0x1001, 0x1080));
    assert_eq!(
        bench.send(Command::Fprd, back, &[9; 128]),
        (vec![9; 128], 0),
        "it is empty"
    );
    assert_eq!(bench.send(Command::Fprd, out, &[0; 128]).1, 0, "it is written only");
    assert_eq!(bench.send(Command::Fpwr, back, &[0; 128]).1, 0, "it is read only");
    let mut mail = [0; 128];
    Message::Request(SdoRequest::Upload(object(0x1000, 0)))
        .emit(1, &mut mail)
        .unwrap();
    // All but the last octet: it is not full yet. Then the last one.
    assert_eq!(bench.send(Command::Fpwr, out, &mail[..127]).1, 1);
    assert_eq!(
        bench.read(0x1001, register::sync_manager(0) + 5, 1)[0] & SyncManager::FULL,
        0
    );
    assert_eq!(
        bench
            .send(Command::Fpwr, register::station(0x1001, 0x107F), &mail[127..])
            .1,
        1
    );
    assert_eq!(bench.send(Command::Fpwr, out, &mail).1, 0, "it is full");
    assert!(bench.fetch(0x1001).is_some());
    assert_eq!(bench.send(Command::Fprd, back, &[0; 128]).1, 0, "it was fetched");
    // The last octet alone is no mail.
    assert_eq!(bench.send(Command::Fpwr, register::station(0x1001, 0x107F), &[0]).1, 0);
}

#[test]
fn expedited_values_of_one_to_four_octets() {
    let mut bench = bench();
    for (at, value) in [
        (object(0x6060, 0), &[8_u8][..]),
        (object(0x6007, 0), &[3, 0]),
        (object(0x607A, 0), &[1, 2, 3, 4]),
    ] {
        assert_eq!(download(&mut bench, at, value), Ok(()));
        assert_eq!(upload(&mut bench, at).unwrap(), value);
    }
    assert_eq!(upload(&mut bench, object(0x1018, 1)).unwrap(), 0x0A1B_u32.to_le_bytes());
    assert_eq!(upload(&mut bench, object(0x1008, 0)).unwrap(), b"Simulated servo drive");
    // Normal, of four octets in one mail: as some masters do.
    let request = SdoRequest::Download {
        object: object(0x607A, 0),
        total: 4,
        data: &[9, 0, 0, 0],
    };
    assert!(code(&sdo(&mut bench, request)).is_none());
    assert_eq!(upload(&mut bench, object(0x607A, 0)).unwrap(), [9, 0, 0, 0]);
}

#[test]
fn refusals_have_their_codes() {
    let mut bench = bench();
    let cases = [
        (object(0x2000, 0), &[0_u8][..], AbortCode::NO_OBJECT),
        (object(0x6041, 0), &[0, 0], AbortCode::WRITE_OF_READ_ONLY),
        (object(0x6060, 1), &[0], AbortCode::NO_SUB_INDEX),
        (object(0x6060, 0), &[0, 0], AbortCode::TOO_LONG),
        (object(0x607A, 0), &[0, 0], AbortCode::TOO_SHORT),
        (object(0x6060, 0), &[55], AbortCode::VALUE_RANGE),
        (object(0x6007, 0), &[9, 0], AbortCode::VALUE_TOO_HIGH),
        // Mapping entries are written while their number is 0.
        (object(0x1600, 1), &[0x10, 0, 0x40, 0x60], abort::SUB_0_NOT_ZERO),
        (complete(0x1C12, 5), &[0; 4], AbortCode::UNSUPPORTED_ACCESS),
    ];
    for (at, value, expected) in cases {
        assert_eq!(download(&mut bench, at, value), Err(expected), "{at:?}");
    }
    assert_eq!(upload(&mut bench, object(0x2000, 0)), Err(AbortCode::NO_OBJECT));
    assert_eq!(
        code(&sdo(&mut bench, SdoRequest::UploadSegment { toggle: false })),
        Some(AbortCode::UNKNOWN_COMMAND)
    );
}

#[test]
fn process_data_are_mapped_and_assigned() {
    let mut bench = bench();
    let write = |bench: &mut Bench, index, sub, value: &[u8]| download(bench, object(index, sub), value);
    assert_eq!(write(&mut bench, 0x1C12, 0, &[0]), Ok(()));
    assert_eq!(write(&mut bench, 0x1600, 0, &[0]), Ok(()));
    let entries = [0x6040_0010_u32, 0x6060_0008, 0x607A_0020, 0x60FF_0020, 0x60B8_0010];
    for (sub, entry) in (1..).zip(entries) {
        assert_eq!(write(&mut bench, 0x1600, sub, &entry.to_le_bytes()), Ok(()));
    }
    assert_eq!(write(&mut bench, 0x1600, 0, &[5]), Ok(()));
    assert_eq!(write(&mut bench, 0x1C12, 1, &0x1600_u16.to_le_bytes()), Ok(()));
    assert_eq!(write(&mut bench, 0x1C12, 0, &[1]), Ok(()));
    assert_eq!(
        bench.segment.device(0).objects().process_data(true).unwrap().octets(),
        13
    );
    // What cannot be mapped so is refused when the number is written.
    for (entry, expected) in [
        (0x6041_0010_u32, AbortCode::NOT_MAPPABLE),
        (0x607A_0010, AbortCode::PDO_LENGTH),
        (0x2345_0010, AbortCode::NO_OBJECT),
    ] {
        write(&mut bench, 0x1600, 0, &[0]).unwrap();
        write(&mut bench, 0x1600, 1, &entry.to_le_bytes()).unwrap();
        assert_eq!(write(&mut bench, 0x1600, 0, &[1]), Err(expected));
    }
    write(&mut bench, 0x1C12, 0, &[0]).unwrap();
    write(&mut bench, 0x1C12, 1, &0x1A00_u16.to_le_bytes()).unwrap();
    assert_eq!(
        write(&mut bench, 0x1C12, 0, &[1]),
        Err(AbortCode::PARAMETER_INCOMPATIBLE)
    );
    assert_eq!(write(&mut bench, 0x1C12, 0, &[9]), Err(AbortCode::VALUE_TOO_HIGH));
    // Only in PRE-OP.
    let mut bench = super::Bench::new(vec![drive()]);
    bench.op(0x1001, 0);
    assert_eq!(write(&mut bench, 0x1C12, 0, &[0]), Err(AbortCode::DEVICE_STATE));
}

#[test]
fn complete_access_takes_all_or_nothing() {
    let mut bench = bench();
    assert_eq!(upload(&mut bench, complete(0x1C12, 0)).unwrap(), [1, 0, 0x00, 0x16]);
    assert_eq!(upload(&mut bench, complete(0x1C12, 1)).unwrap(), [0x00, 0x16]);
    let identity = upload(&mut bench, complete(0x1018, 0)).unwrap();
    assert_eq!(
        (identity.len(), identity[0], &identity[2..6]),
        (18, 4, &[0x1B, 0x0A, 0, 0][..])
    );
    // Three entries at once.
    let mapping = [
        &[3, 0][..],
        &0x6040_0010_u32.to_le_bytes(),
        &0x607A_0020_u32.to_le_bytes(),
        &0x60FF_0020_u32.to_le_bytes(),
    ];
    assert_eq!(download(&mut bench, complete(0x1600, 0), &mapping.concat()), Ok(()));
    assert_eq!(upload(&mut bench, complete(0x1600, 0)).unwrap(), mapping.concat());
    let wrong = [
        &[2, 0][..],
        &0x6040_0010_u32.to_le_bytes(),
        &0x6041_0010_u32.to_le_bytes(),
    ];
    assert_eq!(
        download(&mut bench, complete(0x1600, 0), &wrong.concat()),
        Err(AbortCode::NOT_MAPPABLE)
    );
    assert_eq!(upload(&mut bench, complete(0x1600, 0)).unwrap(), mapping.concat());
    let mut config = drive();
    config.abilities.complete_access = false;
    let mut bench = super::Bench::new(vec![config]);
    bench.pre_op(0x1001);
    assert_eq!(upload(&mut bench, complete(0x1018, 0)), Err(abort::NO_COMPLETE_ACCESS));
}

/// A value of 15 octets in segments of 7 and of 8.
#[test]
fn values_come_and_go_in_segments() {
    let mut bench = bench();
    let at = complete(0x1C12, 0);
    let value = [2, 0, 0x00, 0x16, 0x00, 0x16, 0, 0];
    let start = SdoRequest::Download {
        object: at,
        total: 8,
        data: &[],
    };
    assert!(code(&sdo(&mut bench, start)).is_none());
    let segment = |toggle, last, data| SdoRequest::DownloadSegment(Segment { toggle, last, data });
    assert!(code(&sdo(&mut bench, segment(false, false, &value[..7]))).is_none());
    assert!(code(&sdo(&mut bench, segment(true, true, &value[7..]))).is_none());
    assert_eq!(upload(&mut bench, at).unwrap(), value[..6]);
    // Eight octets in one segment, which has then no octets to be left out.
    let value = [3, 0, 0x00, 0x16, 0x00, 0x16, 0x00, 0x16];
    assert!(
        code(&sdo(
            &mut bench,
            SdoRequest::Download {
                object: at,
                total: 8,
                data: &[]
            }
        ))
        .is_none()
    );
    assert!(code(&sdo(&mut bench, segment(false, true, &value))).is_none());
    assert_eq!(upload(&mut bench, at).unwrap(), value);
    // A wrong toggle, too much, too little.
    sdo(
        &mut bench,
        SdoRequest::Download {
            object: at,
            total: 8,
            data: &[],
        },
    );
    assert_eq!(code(&sdo(&mut bench, segment(true, true, &value))), Some(abort::TOGGLE));
    sdo(
        &mut bench,
        SdoRequest::Download {
            object: at,
            total: 8,
            data: &[],
        },
    );
    assert_eq!(
        code(&sdo(&mut bench, segment(false, true, &[0; 9]))),
        Some(AbortCode::TOO_LONG)
    );
    sdo(
        &mut bench,
        SdoRequest::Download {
            object: at,
            total: 8,
            data: &[],
        },
    );
    assert_eq!(
        code(&sdo(&mut bench, segment(false, true, &[0; 7]))),
        Some(AbortCode::TOO_SHORT)
    );
    let most = SdoRequest::Download {
        object: at,
        total: u32::MAX,
        data: &[],
    };
    assert_eq!(code(&sdo(&mut bench, most)), Some(AbortCode::OUT_OF_MEMORY));
    assert_eq!(upload(&mut bench, at).unwrap(), value, "nothing has changed");
}

#[test]
fn a_device_may_send_all_but_the_first_mail_in_segments() {
    let mut config = drive();
    config.abilities.one_mail = false;
    let mut bench = super::Bench::new(vec![config]);
    bench.pre_op(0x1001);
    assert_eq!(upload(&mut bench, object(0x1008, 0)).unwrap(), b"Simulated servo drive");
}

#[test]
fn objects_are_listed_in_fragments_and_described() {
    let mut bench = bench();
    let answer = bench
        .mail(0x1001, Message::InfoRequest(InfoRequest::List(ListKind::Counts)))
        .unwrap();
    let Ok(Message::InfoResponse(InfoResponse::List { left: 0, data })) = Message::parse(&answer) else {
        panic!("{answer:02x?}")
    };
    let count = usize::from(u16::from_le_bytes([data[2], data[3]]));
    let mut list = Vec::new();
    let mut answer = bench.mail(0x1001, Message::InfoRequest(InfoRequest::List(ListKind::All)));
    let mut fragments = 0;
    while let Some(mail) = answer {
        let Ok(Message::InfoResponse(InfoResponse::List { left, data })) = Message::parse(&mail) else {
            panic!("{mail:02x?}")
        };
        list.extend_from_slice(if fragments == 0 { &data[2..] } else { data });
        fragments += 1;
        answer = if left > 0 { bench.fetch(0x1001) } else { None };
    }
    assert_eq!((list.len() / 2, fragments), (count, (2 * count + 2).div_ceil(116)));
    assert!(fragments > 1);
    assert!(list.chunks(2).any(|index| index == 0x6041_u16.to_le_bytes()));
    let ask = |bench: &mut Bench, request| bench.mail(0x1001, Message::InfoRequest(request)).unwrap();
    let answer = ask(&mut bench, InfoRequest::Object { index: 0x1018 });
    let expected = InfoResponse::Object {
        index: 0x1018,
        data_type: 5,
        sub_max: 4,
        code: 9,
        name: b"Identity",
    };
    assert_eq!(Message::parse(&answer), Ok(Message::InfoResponse(expected)));
    let answer = ask(
        &mut bench,
        InfoRequest::Entry {
            index: 0x607A,
            sub: 0,
            wanted: 0,
        },
    );
    let expected = InfoResponse::Entry {
        index: 0x607A,
        sub: 0,
        wanted: 0,
        data_type: 4,
        bits: 32,
        access: 0x7F,
        data: b"Target_position",
    };
    assert_eq!(Message::parse(&answer), Ok(Message::InfoResponse(expected)));
    let answer = ask(&mut bench, InfoRequest::Object { index: 0x2345 });
    assert_eq!(
        Message::parse(&answer),
        Ok(Message::InfoResponse(InfoResponse::Error(AbortCode::NO_OBJECT)))
    );
}

#[test]
fn an_emergency_comes_before_the_answer() {
    let mut bench = bench();
    let emergency = Emergency {
        code: 0x8611,
        register: 0x21,
        data: [1, 2, 3, 4, 5],
    };
    bench.segment.device_mut(0).faults.emergency = Some(emergency);
    let first = sdo(&mut bench, SdoRequest::Upload(object(0x1000, 0)));
    assert_eq!(Message::parse(&first), Ok(Message::Emergency(emergency)));
    let second = bench.fetch(0x1001).unwrap();
    assert!(matches!(
        Message::parse(&second),
        Ok(Message::Response(SdoResponse::UploadExpedited { .. }))
    ));
    // A drive reports its own faults.
    let mut bench = super::Bench::new(vec![drive()]);
    bench.op(0x1001, 0);
    let drive = bench.segment.device_mut(0).application_mut().as_drive().unwrap();
    drive.raise_fault(0, 0x2310);
    bench.now_ns += 1_000_000;
    bench.send(Command::Lrw, 0, &[0; 8]);
    let mail = bench.fetch(0x1001).unwrap();
    assert!(matches!(
        Message::parse(&mail),
        Ok(Message::Emergency(Emergency {
            code: 0x2310,
            register: 3,
            ..
        }))
    ));
}

#[test]
fn a_repeated_mail_is_dropped_and_a_lost_answer_comes_again() {
    let mut bench = bench();
    let first = sdo(&mut bench, SdoRequest::Upload(object(0x1000, 0)));
    // The same counter once more.
    bench.counter -= 1;
    bench.post(0x1001, Message::Request(SdoRequest::Upload(object(0x1000, 0))));
    assert_eq!(bench.fetch(0x1001), None);
    // The answer was lost: the toggle asks for it.
    bench.write(0x1001, register::sync_manager(1) + 6, &[0x03]);
    assert_eq!(bench.fetch(0x1001), Some(first));
    assert_eq!(bench.read(0x1001, register::sync_manager(1) + 7, 1), [0x02]);
    // A mute one.
    bench.segment.device_mut(0).faults.mute = true;
    assert_eq!(
        bench.mail(0x1001, Message::Request(SdoRequest::Upload(object(0x1000, 0)))),
        None
    );
}

#[test]
fn what_is_no_coe_is_answered_with_an_error() {
    let mut bench = bench();
    let mut post = |counter: u8, protocol, data: &[u8]| {
        let mut mail = [0; 128];
        Mail {
            address: 0,
            channel: 0,
            protocol,
            counter,
            data,
        }
        .emit(&mut mail)
        .unwrap();
        bench.write(0x1001, 0x1000, &mail);
        bench.wait(1_000_000);
        let mailbox = bench.read(0x1001, 0x1080, 128);
        let answer = Mail::parse(&mailbox).unwrap();
        assert_eq!(answer.protocol, Protocol::Error);
        MailError::parse(answer.data).unwrap()
    };
    assert_eq!(post(1, Protocol::EoE, &[1, 2, 3]), MailError::PROTOCOL);
    assert_eq!(post(2, Protocol::CoE, &[0, 0x90]), MailError::SERVICE);
    assert_eq!(post(3, Protocol::CoE, &[0, 0x20, 0x40]), MailError::SERVICE);
}
