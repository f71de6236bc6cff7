//! PReq, PRes and PDO mapping of one node.

use super::*;

#[test]
fn outputs_come_and_inputs_go_in_operational() {
    let mut bench = Bench::new();
    bench.start();
    let position = bench.node.dictionary().key::<i32>(0x6064, 0).unwrap();
    let status = bench.node.dictionary().key::<u16>(0x6041, 0).unwrap();
    bench.node.dictionary_mut().set(position, -2);
    bench.node.dictionary_mut().set(status, 0x0237);
    // Mapping version 0 of the node: that of the frame does not matter.
    let preq = Preq {
        multiplexed: false,
        exception_acknowledge: false,
        ready: true,
        pdo_version: 0x70,
        payload: &OUTPUTS,
    };
    let pres = bench.preq(preq).unwrap();
    assert!(bench.events.last().unwrap().outputs);
    assert_eq!(pres.len(), 60);
    assert_eq!(pres[..14], [0x01, 0x11, 0x1E, 0, 0, 2, 2, 0, 0, 0, 0, 5, 0x88, 0xAB]);
    assert_eq!(
        pres[14..30],
        [4, 255, 5, 0xFD, 1, 0, 0, 0, 6, 0, 0xFE, 0xFF, 0xFF, 0xFF, 0x37, 0x02]
    );
    assert_eq!(
        bench.node.dictionary().read(0x607A, 0).unwrap(),
        [0x78, 0x56, 0x34, 0x12]
    );
    assert_eq!(bench.node.dictionary().read(0x6060, 0).unwrap(), [8]);
    assert_eq!(bench.node.dictionary().read(0x6040, 0).unwrap(), [0x0F, 0]);
}

#[test]
fn outputs_are_ignored_before_operational_and_without_rd() {
    let mut bench = Bench::new();
    bench.wake();
    bench.map();
    assert_eq!(
        bench.poll_with(&OUTPUTS).unwrap()[17..24],
        [0x5D, 0, 0, 0, 0, 0, 0],
        "mapping not yet active"
    );
    bench.plain(NmtCommand::EnableReadyToOperate);
    assert_eq!(bench.poll_with(&OUTPUTS).unwrap()[17..24], [0x6D, 0, 0, 0, 0, 6, 0]);
    bench.plain(NmtCommand::StartNode);
    let not_ready = Preq {
        multiplexed: false,
        exception_acknowledge: false,
        ready: false,
        pdo_version: 0,
        payload: &OUTPUTS,
    };
    assert_eq!(bench.preq(not_ready).unwrap()[17..24], [0xFD, 1, 0, 0, 0, 6, 0]);
    assert!(bench.events.iter().all(|events| !events.outputs));
    assert_eq!(bench.node.dictionary().read(0x607A, 0).unwrap(), [0; 4]);
    assert_eq!(
        bench.node.dictionary().read(0x1003, 0).unwrap(),
        [0],
        "nothing of this is an error"
    );
}

#[test]
fn a_poll_for_another_node_or_state_is_not_answered() {
    let mut bench = Bench::new();
    bench.soa(RequestedService::NoService, 0);
    assert_eq!(bench.node.nmt_state(), NmtState::PreOperational1);
    assert_eq!(bench.poll_with(&[]), None);
    bench.soc();
    assert!(bench.poll_with(&[]).is_some());
    let preq = Preq {
        multiplexed: false,
        exception_acknowledge: false,
        ready: true,
        pdo_version: 0,
        payload: &[],
    };
    assert_eq!(bench.send(MAC, NODE + 1, &Frame::Preq(preq)), None);
    assert_eq!(bench.soa(RequestedService::IdentRequest, NODE + 1), None);
    bench.plain(NmtCommand::StopNode);
    assert_eq!(bench.poll_with(&[]), None);
    assert!(bench.soa(RequestedService::IdentRequest, NODE).is_some());
}

#[test]
fn bad_pdos_are_dropped_and_reported_once() {
    let mut bench = Bench::new();
    bench.wake();
    bench.map();
    bench.write(0x1400, 2, &[0x10]).unwrap();
    bench.plain(NmtCommand::EnableReadyToOperate);
    bench.plain(NmtCommand::StartNode);
    let mut poll = |pdo_version, payload: &[u8]| {
        let preq = Preq {
            multiplexed: false,
            exception_acknowledge: false,
            ready: true,
            pdo_version,
            payload,
        };
        bench.preq(preq).unwrap();
        let count = bench.node.dictionary().read(0x1003, 0).unwrap()[0];
        let newest = bench.node.dictionary().read(0x1003, 1).unwrap();
        let code = newest
            .get(2..4)
            .map_or(0, |code| u16::from_le_bytes([code[0], code[1]]));
        (bench.events.last().unwrap().outputs, count, code)
    };
    assert_eq!(poll(0x1F, &OUTPUTS), (true, 0, 0), "the sub-version may differ");
    assert_eq!(poll(0x20, &OUTPUTS), (false, 1, error_code::PDO_MAP_VERSION));
    assert_eq!(poll(0x20, &OUTPUTS), (false, 1, error_code::PDO_MAP_VERSION));
    assert_eq!(poll(0x10, &OUTPUTS[..6]), (false, 2, error_code::PDO_SHORT_RX));
    assert_eq!(poll(0x10, &[0; 37]), (false, 3, error_code::PREQ_LIMIT));
    assert!(poll(0x10, &[0; 36]).0, "a longer payload is no fault");
    assert_eq!(poll(0x20, &OUTPUTS), (false, 4, error_code::PDO_MAP_VERSION));
}

#[test]
fn outputs_can_come_from_another_node() {
    let mut bench = Bench::new();
    bench.wake();
    bench.map();
    bench.write(0x1400, 1, &[9]).unwrap();
    bench.plain(NmtCommand::EnableReadyToOperate);
    bench.plain(NmtCommand::StartNode);
    bench.poll_with(&OUTPUTS);
    assert!(!bench.events.last().unwrap().outputs);
    for (from, expected) in [(8, false), (9, true)] {
        let pres = Pres {
            nmt_state: NmtState::Operational,
            multiplexed: false,
            exception_new: false,
            ready: true,
            requests: Requests::default(),
            pdo_version: 0,
            payload: &OUTPUTS,
        };
        let mut octets = [0; FRAME_LEN_MAX];
        let len = pres
            .emit(&Header::multicast(multicast::PRES, [7; 6], from), 36, &mut octets)
            .unwrap();
        assert_eq!(
            bench
                .node
                .receive(0, &octets[..len], &mut bench.response)
                .events
                .outputs,
            expected
        );
    }
}

#[test]
fn mapping_is_checked_where_it_is_written() {
    let mut bench = Bench::new();
    bench.wake();
    let entry = |raw: u64| raw.to_le_bytes();
    bench.write(0x1600, 1, &entry(0x0010_0000_0000_6041)).unwrap();
    assert_eq!(
        bench.write(0x1600, 0, &[1]),
        Err(AbortCode::NOT_MAPPABLE),
        "a status cannot be received"
    );
    bench.write(0x1600, 1, &entry(0x0010_0000_0000_6042)).unwrap();
    assert_eq!(bench.write(0x1600, 0, &[1]), Err(AbortCode::NO_OBJECT));
    bench.write(0x1600, 1, &entry(0x0010_0120_0000_6040)).unwrap();
    assert_eq!(
        bench.write(0x1600, 0, &[1]),
        Err(AbortCode::PDO_LENGTH),
        "36 octets are the limit"
    );
    bench.write(0x1F98, 4, &38_u16.to_le_bytes()).unwrap();
    bench.write(0x1600, 0, &[1]).unwrap();
    assert_eq!(
        bench.write(0x1F98, 4, &37_u16.to_le_bytes()),
        Err(AbortCode::PARAMETER_INCOMPATIBLE)
    );
    assert_eq!(
        bench.write(0x1F98, 4, &35_u16.to_le_bytes()),
        Err(AbortCode::VALUE_TOO_LOW)
    );
    assert_eq!(
        bench.write(0x1600, 2, &entry(0)),
        Err(AbortCode::PARAMETER_INCOMPATIBLE),
        "the count is not 0"
    );
    assert_eq!(bench.write(0x1600, 0, &[33]), Err(AbortCode::VALUE_TOO_HIGH));
    bench.write(0x1600, 0, &[0]).unwrap();
    bench.write(0x1600, 2, &entry(0)).unwrap();
    assert_eq!(bench.write(0x1800, 1, &[3]), Err(AbortCode::VALUE_TOO_HIGH));
    bench.plain(NmtCommand::EnableReadyToOperate);
    for (index, sub, value) in [(0x1600, 0, &[0][..]), (0x1400, 2, &[1]), (0x1F98, 5, &[40, 0])] {
        assert_eq!(
            bench.write(index, sub, value),
            Err(AbortCode::DEVICE_STATE),
            "{index:04x}/{sub}"
        );
    }
}

#[test]
fn the_payload_limit_makes_the_length_of_the_pres() {
    let mut bench = Bench::new();
    bench.wake();
    bench.write(0x1F98, 5, &100_u16.to_le_bytes()).unwrap();
    assert_eq!(bench.poll_with(&[]).unwrap().len(), 60);
    bench.plain(NmtCommand::ResetConfiguration);
    bench.wake();
    assert_eq!(bench.poll_with(&[]).unwrap().len(), 124);
}
