use super::*;

const LIMITS: Limits = Limits {
    period_ns: 1_000_000,
    late_ns: 250_000,
    hung_cycles: 5,
    phase_ns: 0,
    tick_ns: 50_000,
    shortest_wait_ns: 0,
    every_tick: true,
};

struct Rig {
    watch: Arc<Watch>,
    watchdog: Watchdog,
    seen: Vec<Report>,
}

impl Rig {
    fn new() -> Rig {
        let watch = Arc::new(Watch::default());
        Rig {
            watchdog: Watchdog::new(watch.clone(), LIMITS),
            watch,
            seen: Vec::new(),
        }
    }

    /// Ticks every 50 µs from one time to before another.
    fn run(&mut self, from_ns: u64, to_ns: u64) {
        for now_ns in (from_ns..to_ns).step_by(50_000) {
            self.watchdog.tick(now_ns, |report| self.seen.push(report));
        }
    }

    fn take(&mut self) -> Vec<(u64, Event)> {
        self.seen.drain(..).map(|report| (report.at_ns, report.event)).collect()
    }
}

#[test]
fn a_poll_is_lost_within_one_tick_of_its_limit() {
    let mut rig = Rig::new();
    rig.watch.begin_poll(7, 1_120_000);
    rig.run(1_000_000, 1_120_000);
    assert!(rig.watch.is_poll_open());
    rig.run(1_150_000, 1_400_000);
    assert!(!rig.watch.is_poll_open());
    assert!(!rig.watch.end_poll(), "an answer after the limit is too late");
    assert_eq!(rig.take(), [(1_150_000, Event::PresTimeout { node: 7 })]);
    assert_eq!(rig.watch.counters().polls_lost, 1);
}

#[test]
fn an_answer_in_time_is_never_lost() {
    let mut rig = Rig::new();
    rig.watch.begin_poll(1, 1_120_000);
    rig.watch.begin_async(3, 1_500_000);
    rig.run(1_000_000, 1_100_000);
    assert!(rig.watch.end_poll());
    rig.watch.begin_poll(2, 1_220_000);
    rig.run(1_100_000, 1_200_000);
    assert!(rig.watch.end_poll());
    assert!(rig.watch.is_async_open());
    rig.run(1_200_000, 1_450_000);
    assert!(rig.watch.end_async());
    rig.run(1_450_000, 2_000_000);
    assert_eq!(rig.take(), []);
}

#[test]
fn an_async_slot_that_stays_empty_is_reported() {
    let mut rig = Rig::new();
    rig.watch.begin_async(240, 1_490_000);
    rig.run(1_000_000, 2_000_000);
    assert_eq!(rig.take(), [(1_500_000, Event::AsyncTimeout { node: 240 })]);
    assert!(!rig.watch.end_async());
}

#[test]
fn waits_last_as_long_however_long_the_pc_has_run() {
    const TEN_YEARS_NS: u64 = 10 * 365 * 86_400 * 1_000_000_000;
    let mut rig = Rig::new();
    rig.watch.begin_poll(254, TEN_YEARS_NS + 120_001);
    rig.run(TEN_YEARS_NS, TEN_YEARS_NS + 120_000);
    assert_eq!(rig.take(), []);
    rig.run(TEN_YEARS_NS + 150_000, TEN_YEARS_NS + 160_000);
    assert_eq!(rig.take(), [(TEN_YEARS_NS + 150_000, Event::PresTimeout { node: 254 })]);
}

#[test]
fn cycles_in_time_raise_nothing() {
    let mut rig = Rig::new();
    for cycle in 1..=100 {
        rig.watch.begin_cycle(cycle, cycle * 1_000_000);
        rig.run(cycle * 1_000_000, cycle * 1_000_000 + 400_000);
        rig.watch.end_cycle(cycle, true);
        rig.run(cycle * 1_000_000 + 400_000, (cycle + 1) * 1_000_000);
    }
    assert_eq!(rig.take(), []);
    assert_eq!(rig.watch.counters().ticks, 2000);
}

#[test]
fn a_late_cycle_is_reported_once_and_the_network_goes_on() {
    let mut rig = Rig::new();
    rig.watch.begin_cycle(8, 8_000_000);
    rig.run(8_000_000, 10_000_000);
    let late = Event::CycleLate {
        cycle: 9,
        late_ns: 300_000,
        computing: true,
    };
    assert_eq!(rig.take(), [(9_300_000, late)]);
    rig.watch.begin_cycle(10, 10_000_000);
    rig.watch.end_cycle(10, true);
    rig.run(10_000_000, 11_600_000);
    let late = Event::CycleLate {
        cycle: 11,
        late_ns: 300_000,
        computing: false,
    };
    assert_eq!(rig.take(), [(11_300_000, late)]);
    assert!(rig.watch.soc_allowed());
    assert_eq!(rig.watch.counters().late_cycles, 2);
}

#[test]
fn a_hung_cycle_thread_may_send_no_soc_any_more() {
    let mut rig = Rig::new();
    rig.watch.begin_cycle(3, 3_000_000);
    rig.run(3_000_000, 9_000_001);
    assert!(rig.watch.soc_allowed());
    rig.seen.clear();
    rig.run(9_050_000, 20_000_000);
    assert_eq!(
        rig.take(),
        [(
            9_050_000,
            Event::CycleHung {
                cycle: 3,
                overdue_ns: 5_050_000
            }
        )]
    );
    assert!(!rig.watch.soc_allowed());
    rig.watch.begin_cycle(4, 20_000_000);
    rig.run(20_000_000, 20_500_000);
    assert!(!rig.watch.soc_allowed(), "coming back is not enough");
}

#[test]
fn a_pc_that_stood_still_is_late_but_its_cycle_thread_does_not_hang() {
    let mut rig = Rig::new();
    rig.watch.begin_cycle(1, 1_000_000);
    rig.run(1_000_000, 1_500_000);
    rig.run(60_000_000, 60_100_000);
    assert!(matches!(rig.take()[..], [(60_000_000, Event::CycleLate { .. })]));
    assert!(rig.watch.soc_allowed());
    rig.watch.begin_cycle(2, 60_000_000);
    rig.run(60_100_000, 61_000_000);
    assert_eq!(rig.take(), []);
}

#[test]
fn a_cycle_thread_that_does_not_get_the_core_is_starved_and_one_that_computes_hangs() {
    for (share, hangs_at_ns) in [(0, None), (10, None), (60, Some(10_000_000)), (100, Some(9_050_000))] {
        let mut rig = Rig::new();
        rig.watch.begin_cycle(3, 3_000_000);
        for now_ns in (3_000_000..20_000_000).step_by(50_000) {
            let ran_ns = Some(7_000_000 + now_ns * share / 100);
            let report = |report| rig.seen.push(report);
            rig.watchdog.check(now_ns, report, |_| ran_ns);
        }
        let hung = rig.seen.iter().find_map(|report| match report.event {
            Event::CycleHung { cycle: 3, .. } => Some(report.at_ns),
            _ => None,
        });
        assert!(
            hung.is_some() == hangs_at_ns.is_some() && hung <= hangs_at_ns,
            "{share} %: {hung:?}"
        );
        assert_eq!(rig.watch.soc_allowed(), hung.is_none(), "{share} %");
        let starved = |report: &&Report| matches!(report.event, Event::CycleStarved { cycle: 3, .. });
        let starved = rig.seen.iter().filter(starved).count();
        assert_eq!(starved, usize::from(share < 60), "{share} %: told of once");
        // It goes on where it was.
        rig.watch.begin_cycle(30, 30_000_000);
        rig.seen.clear();
        rig.run(30_000_000, 31_000_000);
        assert_eq!(rig.take(), []);
    }
}

#[test]
fn what_the_host_took_is_no_time_that_the_cycle_thread_computed() {
    // The host of a virtual machine runs something else for 4 ms behind each look, and the system counts that as time of the
    // thread that had the core: of 50 us in which it could run it had 15.
    let mut rig = Rig::new();
    rig.watch.begin_cycle(3, 3_000_000);
    let (mut now_ns, mut cpu_ns) = (3_000_000, 0);
    while rig.seen.len() < 2 {
        rig.watchdog
            .check(now_ns, |report| rig.seen.push(report), |_| Some(cpu_ns));
        let due_ns = rig.watchdog.due_ns.max(now_ns + 50_000);
        cpu_ns += 15_000 + 4_000_000;
        now_ns = due_ns + 4_000_000;
        rig.watchdog
            .check(now_ns, |report| rig.seen.push(report), |_| Some(cpu_ns));
        cpu_ns += 15_000;
        now_ns += 50_000;
    }
    let [late, starved] = rig.seen[..] else {
        panic!("{:?}", rig.seen);
    };
    assert!(matches!(late.event, Event::CycleLate { cycle: 4, .. }));
    assert!(
        matches!(starved.event, Event::CycleStarved { cycle: 3, ran_ns, .. } if ran_ns < 2_500_000),
        "{starved:?}"
    );
    assert!(rig.watch.soc_allowed());
}

#[test]
fn a_late_cycle_is_looked_at_four_times_a_cycle_and_when_it_may_hang() {
    let mut rig = Rig::new();
    rig.watch.begin_cycle(3, 3_000_000);
    let limits = Limits {
        shortest_wait_ns: 10_000_000,
        ..LIMITS
    };
    rig.watchdog = Watchdog::new(rig.watch.clone(), limits);
    rig.run(3_000_000, 4_300_001);
    let (mut now_ns, mut looks) = (4_300_000, 0);
    while rig.watch.soc_allowed() {
        now_ns = limits.tick_at_or_after(rig.watchdog.due_ns);
        rig.watchdog.check(now_ns, |_| {}, |_| Some(now_ns));
        looks += 1;
    }
    assert_eq!(
        (now_ns, looks),
        (9_025_000, 19),
        "and not later than with a look at each tick"
    );
}

#[test]
fn a_cycle_thread_that_leaves_every_cycle_out_is_late_and_alive() {
    let mut rig = Rig::new();
    rig.watch.begin_cycle(1, 1_000_000);
    for cycle in 2..40 {
        let date_ns = cycle * 1_000_000;
        rig.run(date_ns - 600_000, date_ns + 350_000);
        rig.watch.leave_out(date_ns + LIMITS.period_ns, LIMITS.period_ns);
        rig.run(date_ns + 350_000, date_ns + 400_000);
    }
    let late = |report: &Report| matches!(report.event, Event::CycleLate { .. });
    assert!(rig.seen.len() >= 38 && rig.seen.iter().all(late), "{:?}", rig.seen);
    assert!(rig.watch.soc_allowed());
}

#[test]
fn nothing_is_expected_before_the_first_cycle_and_after_the_last() {
    let mut rig = Rig::new();
    rig.run(0, 20_000_000);
    rig.watch.begin_cycle(1, 20_000_000);
    rig.run(20_000_000, 20_500_000);
    rig.watch.disarm();
    rig.run(20_500_000, 60_000_000);
    assert_eq!(rig.take(), []);
    assert!(rig.watch.soc_allowed());
}

/// Limits of the demo's machine.
const SPARING: Limits = Limits {
    phase_ns: 375_000,
    shortest_wait_ns: 120_000,
    every_tick: false,
    ..LIMITS
};

#[test]
fn ticks_lie_between_the_beginnings_of_cycles() {
    let dates = |limits: Limits| {
        let mut date_ns = limits.tick_at_or_after(0);
        let mut dates = Vec::new();
        while date_ns < 7_000_000 {
            dates.push(date_ns);
            let next_ns = limits.tick_at_or_after(date_ns + 1);
            assert!(next_ns > date_ns && next_ns - date_ns <= limits.tick_ns + 2 * CLEAR_NS);
            date_ns = next_ns;
        }
        dates
    };
    let regular = dates(SPARING);
    assert_eq!(regular[..2], [0, 50_000], "25 us from 375 us");
    assert!(regular.windows(2).all(|pair| pair[1] - pair[0] == 50_000));
    // Ticks that do not divide the cycle, and ones that are hardly longer than what is kept clear.
    for (period_ns, tick_ns) in [
        (1_000_000, 70_000),
        (333_000, 50_000),
        (1_000_000, 31_000),
        (250_000, 20_000),
    ] {
        let limits = Limits {
            period_ns,
            tick_ns,
            ..SPARING
        };
        for date_ns in dates(limits) {
            let phase_ns = limits.phase_ns % period_ns;
            let behind_ns = (date_ns + period_ns - phase_ns) % period_ns;
            assert!(
                behind_ns >= CLEAR_NS && period_ns - behind_ns >= CLEAR_NS,
                "{date_ns} in {limits:?}"
            );
        }
    }
}

/// What a cycle thread does at a date.
#[derive(Clone, Copy, Debug)]
enum Act {
    BeginCycle(u64),
    EndCycle(u64),
    BeginPoll(u8, u64),
    EndPoll,
    BeginAsync(u8, u64),
}

/// Ticks as the thread does, over what a cycle thread does; gives the ticks and the reports.
fn play(limits: Limits, acts: &[(u64, Act)], to_ns: u64) -> (u64, Vec<(u64, Event)>) {
    let mut rig = Rig::new();
    rig.watchdog = Watchdog::new(rig.watch.clone(), limits);
    let mut acts = acts.iter().peekable();
    let mut date_ns = limits.tick_at_or_after(1_000_000);
    let mut ticks = 0;
    while date_ns < to_ns {
        while let Some((_, act)) = acts.next_if(|(at_ns, _)| *at_ns <= date_ns) {
            let watch = &rig.watch;
            match *act {
                Act::BeginCycle(deadline_ns) => watch.begin_cycle(deadline_ns / 1_000_000, deadline_ns),
                Act::EndCycle(deadline_ns) => watch.end_cycle(deadline_ns / 1_000_000, true),
                Act::BeginPoll(node, due_ns) => watch.begin_poll(node, due_ns),
                Act::EndPoll => _ = watch.end_poll(),
                Act::BeginAsync(node, due_ns) => watch.begin_async(node, due_ns),
            }
        }
        let due_ns = rig.watchdog.tick(date_ns, |report| rig.seen.push(report));
        ticks += 1;
        date_ns = limits.tick_at_or_after(due_ns.max(date_ns + 1));
    }
    (ticks, rig.take())
}

proptest::proptest! {
    #[test]
    fn no_limit_is_looked_at_later_for_the_ticks_that_are_slept_over(
        cycles in proptest::collection::vec(
            (0_u64..60_000, proptest::collection::vec((120_000_u64..200_000, 0_u64..300_000), 0..4), 0_u64..2), 1..12),
    ) {
        let mut acts = Vec::new();
        let mut lost = Vec::new();
        let mut end_ns = 0;
        for (k, (late_ns, polls, slot)) in cycles.iter().enumerate() {
            let deadline_ns = (k as u64 + 2) * 1_000_000 + SPARING.phase_ns;
            let mut now_ns = deadline_ns + late_ns;
            acts.push((now_ns, Act::BeginCycle(deadline_ns)));
            for (node, (wait_ns, answer_ns)) in (1..).zip(polls) {
                let due_ns = now_ns + wait_ns;
                acts.push((now_ns, Act::BeginPoll(node, due_ns)));
                // One that stays unanswered is left behind only when it has been looked at.
                let end_ns = if answer_ns < wait_ns { now_ns + answer_ns } else { due_ns + SPARING.tick_ns + 256 };
                if answer_ns >= wait_ns {
                    lost.push((due_ns, Event::PresTimeout { node }));
                }
                acts.push((end_ns, Act::EndPoll));
                now_ns = end_ns + 1;
                if now_ns + 450_000 > deadline_ns + 1_000_000 {
                    break;
                }
            }
            if *slot == 1 {
                acts.push((now_ns, Act::BeginAsync(9, now_ns + 150_000)));
                lost.push((now_ns + 150_000, Event::AsyncTimeout { node: 9 }));
            }
            acts.push((now_ns + 10_000, Act::EndCycle(deadline_ns)));
            end_ns = deadline_ns + 999_000;
        }
        let (_, seen) = play(SPARING, &acts, end_ns);
        proptest::prop_assert_eq!(seen.len(), lost.len(), "{:?} {:?}", seen, lost);
        for ((seen_ns, seen), (due_ns, lost)) in seen.iter().zip(&lost) {
            proptest::prop_assert_eq!(seen, lost);
            proptest::prop_assert!(seen_ns >= due_ns && seen_ns - due_ns <= SPARING.tick_ns + 256, "{} for {}", seen_ns, due_ns);
        }
    }
}

#[test]
fn ticks_at_which_nothing_can_be_due_are_slept_over_and_lateness_and_hang_are_seen_all_the_same() {
    let mut acts = Vec::new();
    for cycle in 2..102 {
        let deadline_ns = cycle * 1_000_000 + SPARING.phase_ns;
        acts.push((deadline_ns, Act::BeginCycle(deadline_ns)));
        for poll in 0..3 {
            let now_ns = deadline_ns + poll * 30_000;
            acts.push((now_ns, Act::BeginPoll(poll as u8 + 1, now_ns + 120_000)));
            acts.push((now_ns + 25_000, Act::EndPoll));
        }
        acts.push((deadline_ns + 95_000, Act::EndCycle(deadline_ns)));
    }
    let (ticks, seen) = play(SPARING, &acts, 102_300_000);
    assert_eq!(seen, []);
    assert!(ticks < 350, "{ticks} ticks in 100 cycles of 20");
    // Then it hangs: late by a quarter of a cycle, hung once five cycles have gone by.
    let (_, seen) = play(SPARING, &acts, 120_000_000);
    let last_ns = 101_375_000;
    let [
        (late_ns, Event::CycleLate { cycle: 102, .. }),
        (hung_ns, Event::CycleHung { cycle: 101, .. }),
    ] = seen[..]
    else {
        panic!("{seen:?}");
    };
    assert!(
        (last_ns + 1_250_000..=last_ns + 1_350_000).contains(&late_ns),
        "{late_ns}"
    );
    assert!(
        (last_ns + 6_000_000..=last_ns + 6_200_000).contains(&hung_ns),
        "{hung_ns}"
    );
}
