//! Why a node, or the network, is not operational: the values and the words.

use std::string::ToString;

use obd::AbortCode;

use super::*;
use crate::sdo::command::Address;
use crate::wire::IdentResponse;

fn reason(net: &Net<'_>, node: usize) -> Reason {
    net.mn.diagnosis(node).unwrap().reason.expect("not operational")
}

fn network_words(net: &Net<'_>) -> std::string::String {
    let reason = net.mn.network_diagnosis().reason.expect("not OPERATIONAL");
    reason.at(net.now_ns).to_string()
}

#[test]
fn a_network_that_runs_has_no_reasons_and_knows_who_is_there() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(7, &configuration)];
    let mut net = Net::new(&nodes);
    net.boot();
    assert_eq!(net.mn.network_diagnosis().state, NmtState::Operational);
    assert_eq!(net.mn.network_diagnosis().reason, None);
    for (position, id) in [(0, 1), (1, 7)] {
        let diagnosis = net.mn.diagnosis(position).unwrap();
        assert_eq!(
            (diagnosis.node, diagnosis.reason, diagnosis.last_fault),
            (id, None, None)
        );
        assert_eq!(diagnosis.stage, BootStage::Operational);
        assert_eq!(diagnosis.expected_nmt_state, NmtState::Operational);
        let (at_ns, ident) = diagnosis.ident.unwrap();
        assert!(at_ns > 0 && at_ns < net.now_ns);
        assert_eq!(
            (ident.device_type, ident.vendor_id, ident.product_code, ident.serial),
            (0x0002_0192, 1, 2, u32::from(id))
        );
        // Since the configuration was written it reports its date.
        assert_eq!(ident.configuration_date, 20_000);
        assert_eq!(ident.ip_address, 0xC0A8_6400 | u32::from(id));
        assert_eq!(&ident.host_name[..6], b"drive\0");
    }
    assert_eq!(net.mn.diagnosis(2), None);
}

#[test]
fn the_node_that_is_missing_is_named_by_all_that_wait_for_it() {
    let configuration = configuration();
    let mut nodes = [1, 2, 3, 4].map(|id| node_config(id, &configuration));
    nodes[3].assignment.mandatory = false;
    let mut net = Net::new(&nodes);
    let listening = NetworkReason::Listening { until_ns: 20 * MS };
    net.cycle();
    assert_eq!(net.mn.network_diagnosis().reason, Some(listening));
    let state = NmtState::NotActive;
    assert_eq!(reason(&net, 0), Reason::NetworkNotRunning { state });
    net.dead = std::vec![2, 3, 4];
    net.cycles(25);
    assert_eq!(net.mn.network_diagnosis().reason, Some(NetworkReason::Starting));
    net.cycles(200);
    // Since the network looks for nodes, and not since the clock began to count.
    assert_eq!(reason(&net, 1), Reason::NotAnswering { since_ns: 20 * MS });
    assert_eq!(
        reason(&net, 0),
        Reason::WaitingForNetwork {
            state: NmtState::PreOperational2,
            held_by: Some(2)
        }
    );
    assert_eq!(
        network_words(&net),
        "PRE_OPERATIONAL_2 waits for mandatory node 2 and 1 other: does not answer IdentRequests; looked for since 0.2 s: \
         is it on, connected, and set to this node id?"
    );
    net.dead = std::vec![4];
    net.until(1000, |net| net.mn.nmt_state() == NmtState::Operational);
    assert_eq!(net.mn.network_diagnosis().reason, None);
    assert_eq!(
        reason(&net, 3),
        Reason::NotAnswering { since_ns: 20 * MS },
        "an optional node holds nobody"
    );
}

#[test]
fn a_wrong_identity_is_named_with_object_and_both_values() {
    let mut nodes = [node_config(1, &[]), node_config(2, &[])];
    nodes[1].identity.revision = Some(0x0001_0002);
    let mut net = Net::new(&nodes);
    net.cycles(300);
    let fault = Fault::WrongIdentity {
        field: IdentityField::Revision,
        expected: 0x0001_0002,
        got: 3,
    };
    let diagnosis = net.mn.diagnosis(1).unwrap();
    assert!(matches!(diagnosis.stage, BootStage::Refused { .. }));
    let Some(Reason::Refused { fault: got, again_ns }) = diagnosis.reason else {
        panic!("{diagnosis:?}")
    };
    assert!(got == fault && again_ns > net.now_ns);
    assert_eq!(
        diagnosis.reason.unwrap().at(again_ns - 2500 * MS).to_string(),
        "0x1018/3 revision number is 0x00000003, expected 0x00010002; tried again in 2.5 s"
    );
    assert_eq!(fault.object(), Some(Address { index: 0x1018, sub: 3 }));
    let values = [fault.expected(), fault.found()].map(|value| value.unwrap().to_string());
    assert_eq!(values, ["0x00010002", "0x00000003"]);
    let (_, ident) = diagnosis.ident.unwrap();
    assert_eq!(ident.revision, 3, "what it is can be seen all the same");
    // It is looked at again every five seconds; the same again and again.
    net.cycles(11_000);
    let last = net.mn.diagnosis(1).unwrap().last_fault.unwrap();
    assert_eq!((last.fault, last.count), (fault, 3));
}

#[test]
fn a_refused_value_is_named_with_its_abort_code() {
    let mut octets = [0; 60];
    let mut writer = CdcWriter::new(&mut octets).unwrap();
    writer.push(0x6060, 0, &[8]).unwrap();
    writer.push(0x1018, 1, &1_u32.to_le_bytes()).unwrap();
    let configuration = writer.finish();
    let nodes = [node_config(1, configuration)];
    let mut net = Net::new(&nodes);
    net.until(1000, |net| net.mn.node_state(0) == NodeState::Faulted);
    let fault = Fault::ConfigurationRefused {
        index: 0x1018,
        sub: 1,
        code: AbortCode::WRITE_OF_READ_ONLY,
    };
    assert!(matches!(reason(&net, 0), Reason::Refused { fault: got, .. } if got == fault));
    assert_eq!(
        fault.to_string(),
        "refused the configured value of 0x1018/1: attempt to write a read-only object (0x06010002)"
    );
    let network = network_words(&net);
    assert!(
        network.starts_with("PRE_OPERATIONAL_2 waits for mandatory node 1: refused the configured value"),
        "{network}"
    );
}

#[test]
fn the_object_that_is_written_at_the_moment_is_named() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::new(&nodes);
    let writes = |net: &Net<'_>| {
        matches!(
            net.mn.diagnosis(0).unwrap().stage,
            BootStage::Configuring { written: 4, .. }
        )
    };
    // In the running network a write takes two cycles.
    net.boot();
    net.reset_node(0);
    net.until(1000, writes);
    let stage = BootStage::Configuring {
        written: 4,
        index: 0x1600,
        sub: 0,
    };
    assert_eq!(reason(&net, 0), Reason::Booting { stage });
    assert_eq!(
        reason(&net, 0).to_string(),
        "being configured: 4 objects written, now 0x1600"
    );
}

#[test]
fn a_lost_node_keeps_its_reason_after_it_is_back() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = Net::new(&nodes);
    net.boot();
    for count in 1..=2 {
        net.dead = std::vec![2];
        net.cycles(50);
        let diagnosis = net.mn.diagnosis(1).unwrap();
        let fault = Fault::PresLost { in_row: 4 };
        let Some(Reason::GivenUp { fault: got, since_ns }) = diagnosis.reason else {
            panic!("{diagnosis:?}")
        };
        assert!(got == fault && since_ns < net.now_ns && since_ns + 50 * MS > net.now_ns);
        assert!(diagnosis.ident.is_some(), "what it was is still known");
        assert_eq!(
            diagnosis.reason.unwrap().at(since_ns + 1300 * MS).to_string(),
            "lost: 4 polls in a row without an answer; was reset and has not answered for 1.3 s"
        );
        net.drives.insert(2, drive(2, net.now_ns));
        net.dead.clear();
        net.boot();
        let diagnosis = net.mn.diagnosis(1).unwrap();
        assert_eq!(diagnosis.reason, None);
        let last = diagnosis.last_fault.unwrap();
        assert_eq!((last.fault, last.at_ns, last.count), (fault, since_ns, count));
    }
}

#[test]
fn the_newest_eight_error_entries_are_kept() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::new(&nodes);
    net.boot();
    net.cycles(50);
    let before = net.mn.diagnosis(0).unwrap().errors.total();
    for code in 0x5000..0x500B {
        net.drives.get_mut(&1).unwrap().report_error(402, code, [0; 8]);
        net.cycles(20);
    }
    let errors = net.mn.diagnosis(0).unwrap().errors;
    assert_eq!(errors.newest_first().count(), ERRORS_KEPT);
    assert!(errors.total() - before >= 11);
    let newest = errors.newest_first().next().unwrap();
    assert_eq!(newest.entry.code, 0x500A);
    assert!(newest.at_ns <= net.now_ns && newest.at_ns + 20 * MS > net.now_ns);
}

#[test]
fn another_managing_node_is_named() {
    let nodes = [node_config(1, &[])];
    let mut net = Net::new(&nodes);
    net.cycles(2);
    let header = Header::multicast(multicast::SOC, FOREIGN_MAC, 240);
    net.hear(header, &Frame::Soc(Soc::default()));
    let diagnosis = net.mn.network_diagnosis();
    assert_eq!(diagnosis.reason, Some(NetworkReason::ForeignMn(FOREIGN)));
    let foreign = ForeignMn {
        sign: FOREIGN,
        heard_ns: 2 * MS,
        frames: 1,
    };
    assert_eq!(diagnosis.foreign_mn, Some(foreign));
    net.boot();
    let diagnosis = net.mn.network_diagnosis();
    assert_eq!((diagnosis.reason, diagnosis.foreign_mn), (None, Some(foreign)));
}

#[test]
fn a_record_is_small() {
    assert!(size_of::<Diagnosis>() < 1024, "{}", size_of::<Diagnosis>());
    assert!(size_of::<IdentResponse>() < 200);
}
