//! Lost frames, error history and error signalling of one node.

use super::*;

#[test]
fn missed_socs_count_and_at_the_threshold_the_node_leaves() {
    let mut bench = Bench::new();
    bench.start();
    bench.write(0x1C0B, 3, &24_u32.to_le_bytes()).unwrap();
    bench.now_ns = 1000 * US;
    assert!(bench.soc().sync.is_some());
    // Due at 2000 us + 100 us tolerance, then every 1000 us.
    assert_eq!(bench.node.next_deadline_ns(), Some(2100 * US));
    assert_eq!(bench.node.poll(2100 * US - 1), Events::default());
    let missed = |events: Events| (events.soc_missed, events.cycle_error, events.nmt_state);
    assert_eq!(missed(bench.node.poll(2100 * US)), (1, None, None));
    assert_eq!(missed(bench.node.poll(2101 * US)), (0, None, None));
    assert_eq!(missed(bench.node.poll(3100 * US)), (1, None, None));
    assert_eq!((bench.u32_of(0x1C0B, 1), bench.u32_of(0x1C0B, 2)), (2, 16));
    let lost = bench.node.poll(4100 * US);
    assert_eq!(
        missed(lost),
        (1, Some(CycleError::LossOfSoc), Some(NmtState::PreOperational1))
    );
    assert_eq!(bench.u32_of(0x1C0B, 1), 3);
    assert_eq!(bench.node.next_deadline_ns(), None);
    assert_eq!(bench.node.dictionary().read(0x1001, 0).unwrap(), [0x11]);
    let newest = bench.node.dictionary().read(0x1003, 1).unwrap();
    assert_eq!(newest[..4], [0x02, 0x30, 0x45, 0x82]);
}

#[test]
fn a_lost_node_that_is_started_again_is_as_before() {
    let mut bench = Bench::new();
    bench.start();
    bench.soc();
    bench.node.poll(10_000 * US);
    assert_eq!(bench.node.nmt_state(), NmtState::PreOperational1);
    assert_eq!(bench.node.dictionary().read(0x1001, 0).unwrap(), [0x11]);
    bench.now_ns = 20_000 * US;
    bench.soc();
    bench.plain(NmtCommand::EnableReadyToOperate);
    assert_eq!(bench.node.dictionary().read(0x1001, 0).unwrap(), [0x11]);
    bench.plain(NmtCommand::StartNode);
    assert_eq!(bench.node.dictionary().read(0x1001, 0).unwrap(), [0]);
    bench.poll_with(&OUTPUTS);
    assert!(bench.events.last().unwrap().outputs);
}

#[test]
fn errors_bear_the_time_of_the_last_soc() {
    let mut bench = Bench::new();
    let net_time = NetTime {
        seconds: 0x0403_0201,
        nanoseconds: 0x0807_0605,
    };
    let soc = Soc {
        net_time,
        ..Soc::default()
    };
    bench.send(multicast::SOC, node::BROADCAST, &Frame::Soc(soc));
    bench.node.report_error(1, 0xFF01, [9; 8]);
    let newest = bench.node.dictionary().read(0x1003, 1).unwrap();
    assert_eq!(
        newest,
        [0x01, 0x30, 0x01, 0xFF, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 9, 9, 9, 9, 9]
    );
}

#[test]
fn one_missed_soc_is_forgiven_by_good_cycles() {
    let mut bench = Bench::new();
    bench.start();
    for cycle in 1..=40_u64 {
        bench.now_ns = cycle * 1000 * US;
        if cycle % 20 != 0 {
            let events = bench.soc();
            assert_eq!(
                events.soc_missed,
                u32::from(cycle % 20 == 1 && cycle > 1),
                "cycle {cycle}"
            );
            bench.poll_with(&OUTPUTS);
        }
    }
    // Cycle 20 is missed, 40 is the last and not yet overdue; each good SoC takes back 1 of the 8.
    assert_eq!((bench.u32_of(0x1C0B, 1), bench.u32_of(0x1C0B, 2)), (1, 0));
    assert_eq!(bench.node.nmt_state(), NmtState::Operational);
}

#[test]
fn a_long_pause_is_bounded_work() {
    let mut bench = Bench::new();
    bench.start();
    bench.write(0x1C0B, 3, &0_u32.to_le_bytes()).unwrap();
    bench.soc();
    assert_eq!(
        bench.node.poll(u64::MAX / 2).soc_missed,
        supervision::MISSED_PER_CHECK_MAX
    );
    assert_eq!(
        bench.node.nmt_state(),
        NmtState::Operational,
        "threshold 0 never leads away"
    );
}

#[test]
fn missing_polls_count_in_the_states_that_exchange_data() {
    let mut bench = Bench::new();
    bench.start();
    let mut cycle = |polled: bool, multiplexed: bool| {
        bench.now_ns += 1000 * US;
        let lost = bench.soc().cycle_error;
        if polled {
            bench.preq(Preq {
                multiplexed,
                exception_acknowledge: false,
                ready: true,
                pdo_version: 0,
                payload: &OUTPUTS,
            });
        }
        lost
    };
    assert_eq!(
        (cycle(false, false), cycle(false, false)),
        (None, None),
        "never polled, nothing lost"
    );
    assert_eq!(
        (cycle(true, true), cycle(false, false), cycle(false, false)),
        (None, None, None),
        "multiplexed"
    );
    assert_eq!((cycle(true, false), cycle(false, false)), (None, None));
    assert_eq!(cycle(false, false), None, "8 of 15");
    assert_eq!(cycle(false, false), Some(CycleError::LossOfPreq), "16 of 15");
    assert_eq!(bench.node.nmt_state(), NmtState::PreOperational1);
    assert_eq!(bench.u32_of(0x1C0D, 1), 2);
}

#[test]
fn good_polls_take_back_lost_ones() {
    let mut bench = Bench::new();
    bench.start();
    let mut cycles = |polled: &[bool]| {
        for polled in polled {
            bench.now_ns += 1000 * US;
            assert_eq!(bench.soc().cycle_error, None);
            if *polled {
                bench.poll_with(&OUTPUTS);
            }
        }
        bench.u32_of(0x1C0D, 2)
    };
    assert_eq!(cycles(&[true, false, true]), 7, "8 for the lost one, 1 taken back");
    assert_eq!(cycles(&[true; 3]), 4);
    assert_eq!(cycles(&[false, true]), 11);
}

#[test]
fn silence_leads_to_basic_ethernet_and_a_frame_back() {
    let mut bench = Bench::new();
    assert_eq!(bench.node.next_deadline_ns(), Some(5_000_000 * US));
    assert_eq!(bench.node.poll(5_000_000 * US - 1).nmt_state, None);
    assert_eq!(bench.node.poll(5_000_000 * US).nmt_state, Some(NmtState::BasicEthernet));
    bench.now_ns = 6_000_000 * US;
    assert_eq!(bench.soa(RequestedService::IdentRequest, NODE).unwrap()[20], 0x1D);
    assert_eq!(bench.node.nmt_state(), NmtState::PreOperational1);
    assert_eq!(bench.node.next_deadline_ns(), None);
}

#[test]
fn traffic_of_others_keeps_a_waiting_node_from_basic_ethernet() {
    let mut bench = Bench::new();
    bench.now_ns = 4_000_000 * US;
    assert_eq!(bench.poll_with(&[]), None);
    assert_eq!(bench.node.nmt_state(), NmtState::NotActive);
    assert_eq!(bench.node.next_deadline_ns(), Some(9_000_000 * US));
}

#[test]
fn error_signalling_as_captured_and_then_an_error_of_the_device() {
    let mut bench = Bench::new();
    bench.wake();
    let flags = |status: &[u8]| (status[17], status[18]);
    // openpowerlink-mn-3cn-10ms.pcap, frames 980, 1046, 1108, 1153: two requests with ER, two without.
    let seen = [(true, 0x08), (true, 0x08), (false, 0x08), (false, 0x00)].map(|(exception_reset, expected)| {
        let status = bench.status(exception_reset, false);
        assert_eq!(status.len(), 72);
        (flags(&status), (0x02, expected))
    });
    for (got, expected) in seen {
        assert_eq!(got, expected);
    }
    bench.node.report_error(402, 0x8611, [1, 2, 3, 4, 5, 6, 7, 8]);
    let pres = bench.poll_with(&[]).unwrap();
    assert_eq!(pres[18] & 0x10, 0x10, "EN");
    let status = bench.status(false, false);
    assert_eq!(flags(&status), (0x02, 0x10));
    assert_eq!(status[32..36], [0x92, 0x31, 0x11, 0x86]);
    assert_eq!(status[44..54], [1, 2, 3, 4, 5, 6, 7, 8, 0, 0]);
    let acknowledge = Preq {
        multiplexed: false,
        exception_acknowledge: true,
        ready: true,
        pdo_version: 0,
        payload: &[],
    };
    bench.preq(acknowledge);
    let status = bench.status(false, true);
    assert_eq!(flags(&status), (0x02, 0x10), "EN stays until the next error");
    assert_eq!(status[32..], [0; 40]);
    // A reset of communication starts the signalling anew.
    bench.plain(NmtCommand::ResetCommunication);
    bench.wake();
    assert_eq!(flags(&bench.status(false, false)), (0x02, 0x08));
}

#[test]
fn the_history_is_emptied_by_writing_0() {
    let mut bench = Bench::new();
    bench.node.report_error(402, 0x8611, [0; 8]);
    assert_eq!(bench.write(0x1003, 0, &[1]), Err(AbortCode::VALUE_TOO_HIGH));
    assert_eq!(bench.node.dictionary().read(0x1003, 0).unwrap(), [1]);
    bench.write(0x1003, 0, &[0]).unwrap();
    assert_eq!(bench.node.dictionary().read(0x1003, 0).unwrap(), [0]);
    assert_eq!(bench.node.dictionary().read(0x1003, 1).unwrap(), [] as [u8; 0]);
}
