use super::*;
use crate::config;
use obd::AbortCode;
use powerlink::mn::{BootStage, ForeignSign, IdentityField, NetworkReason};
use powerlink::nmt::NmtState;
use std::path::Path;

const MACHINE: &str = include_str!("../../configs/mill3-demo.toml");

#[test]
fn nodes_are_found_in_the_machine_file() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/mill3-demo.toml");
    let config = config::read(&path).unwrap();
    let view = NetworkView::of(&config);
    let lines: Vec<&str> = MACHINE.lines().collect();
    for node in &view.nodes {
        let line = node.line.unwrap();
        assert_eq!(lines[line - 1], "[[bus.node]]", "{}", node.name);
        assert_eq!(lines[line], format!("id = {}", node.id));
    }
    assert_eq!(view.nodes.len(), config.bus.nodes.len());
    // Objects lie side by side.
    let drive = &view.nodes[0];
    assert_eq!(drive.outputs[0].offset_bits, 0);
    assert_eq!(drive.outputs[1].offset_bits, u32::from(drive.outputs[0].bits));
    // A file that is gone takes the lines with it and nothing else.
    let gone = config::parse(MACHINE, Path::new("/nowhere.toml")).unwrap();
    assert!(NetworkView::of(&gone).nodes.iter().all(|node| node.line.is_none()));
}

#[test]
fn a_view_goes_through_json_unchanged() {
    let mut view = NetworkView::of(&config::parse(MACHINE, Path::new("demo.toml")).unwrap());
    view.live = Some(NetworkLive::of(
        &NetworkDiagnosis {
            state: NmtState::NotActive,
            reason: Some(NetworkReason::ForeignMn(ForeignSign {
                id: 240,
                mac: [2, 0, 0, 0, 0, 9],
            })),
            foreign_mn: None,
        },
        &Counters::default(),
        0,
    ));
    let text = serde_json::to_string(&view).unwrap();
    assert_eq!(serde_json::from_str::<NetworkView>(&text).unwrap(), view);
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
