//! PRes chaining, seen from the node.

use super::*;
use crate::wire::{SyncRequest, SyncResponse};

fn sync(bench: &mut Bench, target: u8, request: SyncRequest) -> Option<SyncResponse> {
    let soa = Soa {
        sync: request,
        ..Soa::new(NmtState::PreOperational2, RequestedService::SyncRequest, target)
    };
    let answer = bench.send(multicast::SOA, node::BROADCAST, &Frame::Soa(soa))?;
    assert_eq!((answer.len(), &answer[..6]), (60, &multicast::ASND[..]));
    assert_eq!(answer[14..18], [6, 240, NODE, 6]);
    match Frame::parse(&answer).unwrap() {
        Frame::Asnd(Asnd::SyncResponse(response)) => Some(response),
        other => panic!("{other:?}"),
    }
}

fn set(time_ns: u32) -> SyncRequest {
    SyncRequest {
        pres_time_first_ns: Some(time_ns),
        mode_set: true,
        ..SyncRequest::default()
    }
}

/// A node in OPERATIONAL whose RPDO 0 reads the PResMN and whose PRes is due 3000 ns after it.
fn chained() -> Bench {
    let mut bench = Bench::new();
    bench.wake();
    bench.map();
    bench.write(0x1400, 1, &[node::MN]).unwrap();
    bench.plain(NmtCommand::EnableReadyToOperate);
    bench.plain(NmtCommand::StartNode);
    assert!(sync(&mut bench, NODE, set(3000)).unwrap().mode_set);
    bench
}

#[test]
fn a_sync_request_sets_times_and_mode_and_its_answer_tells_them() {
    let mut bench = Bench::new();
    bench.wake();
    let none = sync(&mut bench, NODE, SyncRequest::default()).unwrap();
    let expected = SyncResponse {
        latency_ns: 20_000,
        ..SyncResponse::default()
    };
    assert_eq!(none, expected, "nothing is set");
    let mode_only = SyncRequest {
        mode_set: true,
        ..SyncRequest::default()
    };
    assert!(
        !sync(&mut bench, NODE, mode_only).unwrap().mode_set,
        "without a time there is nothing to follow"
    );
    let request = SyncRequest {
        pres_time_first_ns: Some(1000),
        pres_time_second_ns: Some(2000),
        mn_delay_first_ns: Some(300),
        mn_delay_second_ns: Some(400),
        ..SyncRequest::default()
    };
    let times = sync(&mut bench, NODE, request).unwrap();
    assert_eq!((times.pres_time_first_ns, times.pres_time_second_ns), (1000, 2000));
    assert!(times.pres_time_first_valid && times.pres_time_second_valid && !times.mode_set);
    assert!(sync(&mut bench, NODE, mode_only).unwrap().mode_set);
    let read: Vec<u32> = (11..=14).map(|sub| bench.u32_of(0x1F98, sub)).collect();
    assert_eq!(read, [1000, 2000, 300, 400]);
    assert_eq!(bench.node.dictionary().read(0x1F98, 10).unwrap(), [1]);
    let both = SyncRequest {
        mode_reset: true,
        ..set(1000)
    };
    assert!(
        !sync(&mut bench, NODE, both).unwrap().mode_set,
        "a reset goes before a set"
    );
    assert_eq!(bench.node.dictionary().read(0x1F98, 10).unwrap(), [0]);
}

#[test]
fn a_request_to_another_address_is_not_answered() {
    let mut bench = Bench::new();
    bench.wake();
    let to = |destination| SyncRequest {
        destination: Some(destination),
        ..set(1000)
    };
    assert_eq!(sync(&mut bench, NODE, to([9; 6])), None);
    assert!(!bench.node.is_chained());
    assert!(sync(&mut bench, NODE, to(MAC)).unwrap().mode_set);
    assert_eq!(sync(&mut bench, NODE + 1, set(5)), None);
    assert_eq!(bench.u32_of(0x1F98, 11), 1000);
}

#[test]
fn the_pres_follows_the_pres_mn_at_its_time() {
    let mut bench = chained();
    bench.now_ns = 1_000_000;
    bench.soc();
    assert_eq!(bench.poll_with(&OUTPUTS), None, "a chained node is not polled");
    bench.now_ns = 1_010_000;
    assert!(
        bench.pres_from(node::MN, &OUTPUTS, true).outputs,
        "outputs come with the PResMN"
    );
    assert_eq!(bench.node.next_deadline_ns(), Some(1_013_000));
    let mut out = [0xA5; FRAME_LEN_MAX];
    assert_eq!(bench.node.poll_transmit(1_012_999, &mut out), None);
    bench.now_ns = 1_011_000;
    bench.pres_from(2, &[], true);
    assert_eq!(bench.node.poll_transmit(1_013_000, &mut out), Some(60));
    assert_eq!(out[..6], multicast::PRES);
    assert_eq!(out[14..24], [4, 255, NODE, 0xFD, 1, 0, 0, 0, 6, 0]);
    assert_eq!(bench.node.poll_transmit(1_014_000, &mut out), None, "once a cycle");
    assert_ne!(bench.node.next_deadline_ns(), Some(1_013_000));
}

#[test]
fn a_chain_ends_with_the_isochronous_phase() {
    let mut out = [0; FRAME_LEN_MAX];
    for by_soc in [false, true] {
        let mut bench = chained();
        bench.pres_from(node::MN, &OUTPUTS, true);
        if by_soc {
            bench.soc();
        } else {
            bench.soa(RequestedService::NoService, 0);
        }
        assert_eq!(bench.node.poll_transmit(1_000_000, &mut out), None);
    }
    let mut bench = chained();
    bench.pres_from(node::MN, &OUTPUTS, true);
    bench.plain(NmtCommand::StopNode);
    assert_eq!(
        bench.node.poll_transmit(1_000_000, &mut out),
        None,
        "STOPPED sends no PRes"
    );
}

#[test]
fn a_chained_node_misses_no_polls() {
    let mut bench = Bench::new();
    bench.start();
    bench.poll_with(&OUTPUTS);
    sync(&mut bench, NODE, set(1000));
    for _ in 0..10 {
        bench.now_ns += 1000 * US;
        assert_eq!(bench.soc().cycle_error, None);
    }
    assert_eq!(bench.cumulative(0x1C0D), (0, 0));
}

#[test]
fn without_a_pres_mn_the_node_falls_back() {
    let mut bench = chained();
    bench.write(0x1C0B, 3, &0_u32.to_le_bytes()).unwrap();
    let request = SyncRequest {
        fall_back_timeout_ns: Some(2_500_000),
        ..set(3000)
    };
    bench.now_ns = 1_000_000;
    sync(&mut bench, NODE, request).unwrap();
    bench.now_ns = 2_000_000;
    bench.pres_from(node::MN, &OUTPUTS, true);
    bench.node.poll(4_499_999);
    assert!(bench.node.is_chained());
    bench.soc();
    bench.node.poll(4_500_000);
    assert!(!bench.node.is_chained());
    assert!(bench.poll_with(&OUTPUTS).is_some(), "polled again");
}

#[test]
fn resets_and_the_way_back_to_pre_operational_1_end_chaining() {
    for command in [NmtCommand::ResetConfiguration, NmtCommand::ResetNode] {
        let mut bench = chained();
        bench.plain(command);
        assert!(!bench.node.is_chained());
        bench.wake();
        let response = sync(&mut bench, NODE, SyncRequest::default()).unwrap();
        assert!(!response.pres_time_first_valid && !response.mode_set, "{command:?}");
    }
    let mut bench = chained();
    bench.soc();
    bench.node.poll(1_000_000_000);
    assert_eq!(bench.node.nmt_state(), NmtState::PreOperational1);
    assert!(!bench.node.is_chained());
    // What is set in PRE_OPERATIONAL_1 is there when the cycle starts.
    sync(&mut bench, NODE, set(1000));
    bench.soc();
    assert!(bench.node.is_chained());
}

#[test]
fn the_delay_between_two_nodes_is_measured() {
    let mut bench = Bench::new();
    bench.wake();
    let answer_of = |bench: &mut Bench, from: u8| {
        let mut octets = [0; FRAME_LEN_MAX];
        let header = Header {
            destination: multicast::ASND,
            source: [7; 6],
            destination_node: node::MN,
            source_node: from,
        };
        let len = Asnd::SyncResponse(SyncResponse::default())
            .emit(&header, &mut octets)
            .unwrap();
        bench.node.receive(bench.now_ns, &octets[..len], &mut bench.response);
    };
    let measured = |bench: &mut Bench| {
        let response = sync(bench, NODE, SyncRequest::default()).unwrap();
        (response.sync_node, response.delay_ns)
    };
    bench.now_ns = 100_000;
    sync(&mut bench, 7, SyncRequest::default());
    bench.now_ns = 120_000;
    answer_of(&mut bench, 7);
    // 72 octets of 80 ns are the SyncResponse itself.
    assert_eq!(measured(&mut bench), (7, 20_000 - 5760));
    // The answer of a node that was not asked says nothing.
    sync(&mut bench, 7, SyncRequest::default());
    answer_of(&mut bench, 8);
    assert_eq!(measured(&mut bench), (0, 0));
    // Frames that seem to come at once are an inter-frame gap apart.
    sync(&mut bench, 7, SyncRequest::default());
    answer_of(&mut bench, 7);
    assert_eq!(measured(&mut bench), (7, 960));
    // Nor does one that comes in another slot: the request to it was not heard.
    sync(&mut bench, 7, SyncRequest::default());
    bench.soc();
    answer_of(&mut bench, 7);
    assert_eq!(measured(&mut bench), (0, 0));
}
