//! Losses of SoA and PReq, collisions and CRC errors.

use super::*;

/// One cycle of the managing node, parts of it left out.
fn cycle(bench: &mut Bench, polled: bool, multiplexed: bool, soa: bool) -> Option<CycleError> {
    bench.now_ns += 1000 * US;
    let events = bench.soc();
    if polled {
        bench.preq(Preq {
            multiplexed,
            exception_acknowledge: false,
            ready: true,
            pdo_version: 0,
            payload: &OUTPUTS,
        });
    }
    if soa {
        bench.soa(RequestedService::NoService, 0);
    }
    events.cycle_error
}

#[test]
fn a_lost_soa_counts_when_the_next_cycle_begins() {
    let mut bench = Bench::new();
    bench.start();
    bench.soa(RequestedService::NoService, 0);
    bench.write(0x1C0C, 3, &24_u32.to_le_bytes()).unwrap();
    assert_eq!(cycle(&mut bench, true, false, false), None);
    assert_eq!(bench.cumulative(0x1C0C), (0, 0), "its cycle is not over");
    assert_eq!(cycle(&mut bench, true, false, true), None);
    assert_eq!(bench.cumulative(0x1C0C), (1, 7));
    assert_eq!(cycle(&mut bench, true, false, false), None);
    assert_eq!(cycle(&mut bench, true, false, false), None);
    assert_eq!(bench.cumulative(0x1C0C), (2, 15));
    assert_eq!(cycle(&mut bench, true, false, false), None);
    assert_eq!(bench.cumulative(0x1C0C), (3, 23));
    assert_eq!(cycle(&mut bench, true, false, true), Some(CycleError::LossOfSoa));
    assert_eq!(bench.cumulative(0x1C0C), (4, 0), "the counter starts again");
    assert_eq!(bench.node.nmt_state(), NmtState::PreOperational1);
    let newest = bench.node.dictionary().read(0x1003, 1).unwrap();
    assert_eq!(newest[..4], [0x02, 0x30, 0x44, 0x82]);
}

#[test]
fn a_cycle_without_soc_and_soa_counts_once_each() {
    let mut bench = Bench::new();
    bench.start();
    for (index, sub) in [(0x1C0B, 3), (0x1C0C, 3)] {
        bench.write(index, sub, &80_u32.to_le_bytes()).unwrap();
    }
    cycle(&mut bench, true, false, false);
    let soa_before = bench.u32_of(0x1C0C, 1);
    bench.now_ns += 3100 * US;
    assert_eq!(bench.node.poll(bench.now_ns).soc_missed, 3);
    assert_eq!(bench.u32_of(0x1C0B, 1), 3);
    assert_eq!(bench.u32_of(0x1C0C, 1), soa_before + 1, "only after a SoC a SoA is due");
}

#[test]
fn soas_before_the_first_soc_are_not_missed() {
    let mut bench = Bench::new();
    for _ in 0..10 {
        bench.soa(RequestedService::NoService, 0);
    }
    bench.soc();
    assert_eq!(bench.cumulative(0x1C0C), (0, 0));
}

#[test]
fn a_multiplexed_node_misses_its_poll_only_in_its_own_cycle() {
    let mut bench = Bench::new();
    bench.wake();
    bench.write(0x1F98, 7, &[4]).unwrap();
    bench.write(0x1C0D, 3, &80_u32.to_le_bytes()).unwrap();
    bench.map();
    bench.plain(NmtCommand::EnableReadyToOperate);
    bench.plain(NmtCommand::StartNode);
    // Cycle 1 of 4 is this node's, three rounds long.
    for number in 0..12 {
        cycle(&mut bench, number % 4 == 1, true, true);
    }
    assert_eq!(bench.cumulative(0x1C0D), (0, 0));
    // Its poll stays away in two rounds; each loss is seen when its cycle is over.
    let losses: Vec<u32> = (12..24)
        .map(|_| {
            cycle(&mut bench, false, true, true);
            bench.u32_of(0x1C0D, 1)
        })
        .collect();
    assert_eq!(losses, [0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3]);
    // A poll in another cycle of the round moves it; a poll that is not multiplexed is expected in every cycle from then on.
    cycle(&mut bench, true, true, true);
    for _ in 0..3 {
        cycle(&mut bench, false, true, true);
    }
    assert_eq!(bench.u32_of(0x1C0D, 1), 3);
    cycle(&mut bench, true, false, true);
    cycle(&mut bench, false, false, true);
    cycle(&mut bench, false, false, true);
    assert_eq!(bench.u32_of(0x1C0D, 1), 4);
}

#[test]
fn the_flag_ms_comes_back_in_the_pres() {
    let mut bench = Bench::new();
    bench.start();
    for multiplexed in [true, false] {
        let preq = Preq {
            multiplexed,
            exception_acknowledge: false,
            ready: true,
            pdo_version: 0,
            payload: &OUTPUTS,
        };
        assert_eq!(bench.preq(preq).unwrap()[18], if multiplexed { 0x21 } else { 0x01 });
    }
}

#[test]
fn what_the_driver_tells_counts_and_leads_away_at_the_threshold() {
    type Report = fn(&mut Node, u64) -> Events;
    let cases: [(u16, Report, CycleError, u16); 2] = [
        (0x1C0F, Node::report_crc_error, CycleError::Crc, 0x8164),
        (0x1C0A, Node::report_collision, CycleError::Collision, 0x8163),
    ];
    for (index, report, error, code) in cases {
        let mut bench = Bench::new();
        report(&mut bench.node, 0);
        report(&mut bench.node, 0);
        assert_eq!(bench.node.nmt_state(), NmtState::NotActive, "counted only");
        assert_eq!(bench.u32_of(index, 1), 2);
        bench.start();
        assert_eq!(report(&mut bench.node, 0).cycle_error, None);
        assert_eq!(bench.cumulative(index), (3, 8));
        cycle(&mut bench, true, false, true);
        assert_eq!(bench.cumulative(index), (3, 8), "that was no good cycle");
        cycle(&mut bench, true, false, true);
        assert_eq!(bench.cumulative(index), (3, 7));
        assert_eq!(report(&mut bench.node, 0).cycle_error, Some(error));
        assert_eq!(bench.cumulative(index), (4, 0));
        assert_eq!(bench.node.nmt_state(), NmtState::PreOperational1);
        let newest = bench.node.dictionary().read(0x1003, 1).unwrap();
        assert_eq!(newest[2..4], code.to_le_bytes());
        // Cleared by the managing node, this stays off.
        bench.write(index, 1, &0_u32.to_le_bytes()).unwrap();
        assert_eq!(bench.u32_of(index, 1), 0);
    }
}

#[test]
fn telegrams_are_counted() {
    let mut bench = Bench::new();
    bench.start();
    let before: Vec<u32> = (1..=8).map(|sub| bench.u32_of(0x1101, sub)).collect();
    for _ in 0..3 {
        cycle(&mut bench, true, false, true);
    }
    bench.status(false, false);
    bench.pres_from(7, &[], true);
    bench.send(multicast::ASND, NODE, &Frame::Asnd(Asnd::Sdo(&[0x00, 0x01, 0, 0])));
    bench.soa(RequestedService::UnspecifiedInvite, NODE).unwrap();
    let grown: Vec<u32> = (1..=8)
        .map(|sub| bench.u32_of(0x1101, sub) - before[usize::from(sub) - 1])
        .collect();
    // SoC; PReq and PRes; PRes sent; ASnd; two answers; SDO; SDO; StatusRequest.
    assert_eq!(grown, [3, 4, 3, 1, 2, 1, 1, 1]);
}

#[test]
fn a_doubled_soc_is_no_second_cycle() {
    let mut bench = Bench::new();
    bench.start();
    bench.soa(RequestedService::NoService, 0);
    bench.write(0x1C0C, 3, &15_u32.to_le_bytes()).unwrap();
    for _ in 0..20 {
        cycle(&mut bench, true, false, false);
        // The doubled one comes before and after the SoA; without it this cycle is complete.
        bench.relative_time_us -= 1000;
        assert_eq!(bench.soc().sync, None);
        bench.poll_with(&OUTPUTS);
        bench.soa(RequestedService::NoService, 0);
        bench.relative_time_us -= 1000;
        assert_eq!(bench.soc().sync, None);
    }
    assert_eq!((bench.cumulative(0x1C0C), bench.cumulative(0x1C0D)), ((0, 0), (0, 0)));
    assert_eq!(bench.node.nmt_state(), NmtState::Operational);
    // A cycle that begins early is a cycle: the last one was late.
    bench.now_ns += 400 * US;
    assert!(bench.soc().sync.is_some());
    // Half a cycle later the same time is that of a managing node that does not count it.
    bench.now_ns += 500 * US;
    bench.relative_time_us -= 1000;
    assert!(bench.soc().sync.is_some());
}

#[test]
fn a_doubled_soa_is_answered_once() {
    let mut bench = Bench::new();
    bench.start();
    for mark in [1, 2, 3] {
        bench.node.send_ethernet(&[mark; 60]).unwrap();
    }
    cycle(&mut bench, true, false, false);
    let mut invite = |pause_ns| {
        bench.now_ns += pause_ns;
        bench.soa(RequestedService::UnspecifiedInvite, NODE).map(|sent| sent[0])
    };
    assert_eq!((invite(0), invite(10_000)), (Some(1), None));
    assert_eq!(invite(1000 * US), Some(2));
    assert_eq!((invite(499_999), invite(500_000)), (None, Some(3)), "half a cycle");
}
