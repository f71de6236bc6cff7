use super::*;
use crate::powerlink::publisher::rings;
use obd::AbortCode;
use powerlink::mn::{BootStage, IdentityField, NetworkReason};
use powerlink::nmt::NmtState;

#[test]
fn orders_wait_for_a_buffer_and_no_longer() {
    let (_publisher, mut service) = rings(1);
    let read = |ticket| MailboxRequest {
        ticket,
        node: 0,
        index: 0x1018,
        sub: 1,
        value: None,
    };
    for ticket in 0..SDO_ORDERS as u64 {
        assert_eq!(service.request(read(ticket)), Ok(()));
    }
    assert_eq!(service.request(read(9)), Err(MailboxFull));
    assert_eq!(service.reply(), None);
}

#[test]
fn records_are_told_as_soon_as_they_are_there() {
    let (mut publisher, mut service) = rings(1);
    assert_eq!((service.network(0), service.node(0, 0)), (None, None));
    let network = NetworkDiagnosis {
        state: NmtState::NotActive,
        reason: Some(NetworkReason::Starting),
        foreign_mn: None,
    };
    publisher
        .records
        .push(Record::Network(network, Counters::default()))
        .expect("room");
    let told = service.network(0).expect("the network is known");
    assert_eq!(
        (told.nmt_state.as_str(), told.why.as_deref()),
        ("NOT_ACTIVE", Some("wakes and resets the nodes"))
    );
    assert_eq!(service.node(0, 0), None);
}

#[test]
fn faults_name_object_expected_and_actual_value() {
    let mismatch = Fault::WrongIdentity {
        field: IdentityField::VendorId,
        expected: 0x12D,
        got: 0,
    };
    let told = fault(mismatch);
    assert_eq!(told.text, "0x1018/1 vendor id is 0x00000000, expected 0x0000012D");
    assert_eq!(told.object.as_deref(), Some("0x1018/1"));
    assert_eq!(
        (told.expected.as_deref(), told.actual.as_deref()),
        (Some("0x0000012D"), Some("0x00000000"))
    );
    let serial = Fault::WrongIdentity {
        field: IdentityField::Serial,
        expected: 4711,
        got: 4712,
    };
    assert_eq!(fault(serial).text, "0x1018/4 serial number is 4712, expected 4711");
    let refused = Fault::ConfigurationRefused {
        index: 0x1006,
        sub: 0,
        code: AbortCode::VALUE_TOO_LOW,
    };
    assert_eq!(
        fault(refused).text,
        "refused the configured value of 0x1006: value too low (0x06090032)"
    );
    let late = Fault::BootTimeout {
        expected: NmtState::ReadyToOperate,
        got: NmtState::PreOperational2,
    };
    assert_eq!(
        fault(late).text,
        "still PRE_OPERATIONAL_2, expected READY_TO_OPERATE by now"
    );
    assert_eq!(
        fault(Fault::PresLost { in_row: 4 }).text,
        "lost: 4 polls in a row without an answer"
    );
}

#[test]
fn reasons_say_since_when_and_what_next() {
    const S: u64 = 1_000_000_000;
    let lost = Fault::PresLost { in_row: 4 };
    for (reason, text) in [
        (
            Reason::NotAnswering { since_ns: 2 * S },
            "does not answer IdentRequests; looked for since 8.0 s: is it on, connected, and set to this node id?",
        ),
        (
            Reason::GivenUp {
                fault: lost,
                since_ns: 9 * S,
            },
            "lost: 4 polls in a row without an answer; was reset and has not answered for 1.0 s",
        ),
        (
            Reason::Refused {
                fault: lost,
                again_ns: 12 * S + S / 2,
            },
            "lost: 4 polls in a row without an answer; tried again in 2.5 s",
        ),
        (
            Reason::Booting {
                stage: BootStage::Configuring {
                    written: 3,
                    index: 0x1A00,
                    sub: 1,
                },
            },
            "being configured: 3 objects written, now 0x1A00/1",
        ),
        (
            Reason::WaitingForNetwork {
                state: NmtState::Operational,
                held_by: Some(7),
            },
            "ready, but the network is not OPERATIONAL: mandatory node 7 holds it back",
        ),
    ] {
        assert_eq!(why(reason, 10 * S).text, text);
    }
    let waiting = NetworkReason::WaitingForNode {
        state: NmtState::PreOperational2,
        node: 2,
        why: Reason::NetworkNotRunning {
            state: NmtState::NotActive,
        },
        others: 1,
    };
    assert_eq!(
        waiting.at(0).to_string(),
        "PRE_OPERATIONAL_2 waits for mandatory node 2 and 1 other: the managing node is in NOT_ACTIVE and does not look for nodes"
    );
}

#[test]
fn a_host_name_cannot_write_to_the_terminal() {
    let frame = {
        // The IdentResponse is built by its octets: a name with an escape sequence in it.
        let mut octets = [0; 176];
        octets[12..18].copy_from_slice(&[0x88, 0xAB, 0x06, 0xFF, 3, 0x01]);
        octets[96..101].copy_from_slice(b"a\x1b[2J");
        octets[84..88].copy_from_slice(&[3, 100, 168, 192]);
        octets
    };
    let Ok(powerlink::wire::Frame::Asnd(powerlink::wire::Asnd::IdentResponse(ident))) =
        powerlink::wire::Frame::parse(&frame)
    else {
        panic!("no IdentResponse")
    };
    let view = IdentityView::from(&ident);
    assert_eq!(view.host_name, "a\\x1b[2J");
    assert_eq!(view.ip_address, "192.168.100.3");
}
