//! Decisions on made-up measurements, and the order of the wake-ups on a made-up clock.

use super::*;
use config::KeepAwake::{DmaLatency, IdleThread, None as Nothing};

fn plan() -> Plan {
    Plan {
        cycle_us: 1000,
        keep_awake: vec![DmaLatency, IdleThread, Nothing],
        phases_us: vec![175, 375, 575],
        cycles: 20,
        spin_max_us: 200,
    }
}

/// A round in which every wake-up of a phase is late by the same, µs.
fn round(keep_awake: KeepAwake, late_us: [u64; 3]) -> Round {
    Round {
        keep_awake,
        late_ns: late_us.map(|late_us| vec![late_us * 1000; 20]).to_vec(),
    }
}

/// Five rounds, the ways taking turns.
fn rounds(late_us: [(KeepAwake, [u64; 3]); 3]) -> Vec<Round> {
    let turns = (0..5).flat_map(|_| late_us.iter().map(|(way, late_us)| round(*way, *late_us)));
    turns.collect()
}

fn values(calibration: &Calibration) -> (KeepAwake, u32, u32) {
    (
        calibration.keep_awake.value,
        calibration.phase_us.value,
        calibration.spin_us.value,
    )
}

#[test]
fn equal_measurements_keep_the_defaults() {
    let rounds = rounds([(DmaLatency, [4, 4, 4]), (IdleThread, [4, 4, 4]), (Nothing, [4, 4, 4])]);
    let chosen = decide(&Rt::default(), &plan(), &rounds);
    assert_eq!(values(&chosen), (DmaLatency, 375, 50));
    let sources = [chosen.keep_awake.source, chosen.phase_us.source, chosen.spin_us.source];
    assert_eq!(sources, [Source::Measured; 3]);
    assert_eq!(
        chosen.to_string(),
        "calibration: spin 50 µs (measured), phase 375 µs (measured), core kept awake by dma-latency (measured)\n  \
         300 wake-ups late by p50 4.0, p99 4.0, p99.9 4.0 µs; p90 with dma-latency 4.0, idle-thread 4.0, none 4.0; \
         p90 at phase 175: 4.0, 375: 4.0, 575: 4.0 µs"
    );
}

#[test]
fn what_is_clearly_better_replaces_a_default_and_what_is_a_little_better_does_not() {
    let rounds = |idle_us, phase_us| {
        rounds([
            (DmaLatency, [20, 20, 20]),
            (IdleThread, [idle_us, idle_us, phase_us]),
            (Nothing, [40, 40, 40]),
        ])
    };
    assert_eq!(
        values(&decide(&Rt::default(), &plan(), &rounds(17, 17))),
        (DmaLatency, 375, 50)
    );
    assert_eq!(
        values(&decide(&Rt::default(), &plan(), &rounds(15, 15))),
        (IdleThread, 375, 50)
    );
    assert_eq!(
        values(&decide(&Rt::default(), &plan(), &rounds(15, 9))),
        (IdleThread, 575, 50)
    );
    // Half of 2 µs is only 1 µs.
    let tiny = [(DmaLatency, [2, 2, 1]), (IdleThread, [1, 1, 1]), (Nothing, [2, 2, 2])];
    assert_eq!(
        values(&decide(&Rt::default(), &plan(), &super::tests::rounds(tiny))),
        (DmaLatency, 375, 50)
    );
}

#[test]
fn two_rounds_in_which_the_pc_stood_still_change_nothing() {
    let mut rounds = rounds([(DmaLatency, [4, 4, 4]), (IdleThread, [9, 9, 9]), (Nothing, [9, 9, 9])]);
    let quiet = decide(&Rt::default(), &plan(), &rounds);
    for index in [0, 3] {
        assert_eq!(rounds[index].keep_awake, DmaLatency);
        rounds[index].late_ns = vec![vec![3_000_000; 20]; 3];
    }
    assert_eq!(values(&decide(&Rt::default(), &plan(), &rounds)), values(&quiet));
}

#[test]
fn the_spin_covers_what_a_spin_can_cover() {
    // 300 wake-ups with the chosen way; the latest ones are those of the first round.
    let with_late = |late_us: &[u64]| {
        let mut rounds = rounds([(DmaLatency, [4, 4, 4]), (IdleThread, [9, 9, 9]), (Nothing, [9, 9, 9])]);
        for (late_ns, late_us) in rounds[0].late_ns[0].iter_mut().zip(late_us) {
            *late_ns = late_us * 1000;
        }
        decide(&Rt::default(), &plan(), &rounds).spin_us.value
    };
    assert_eq!(with_late(&[]), 50);
    assert_eq!(with_late(&[71]), 75, "the one in a thousand");
    assert_eq!(with_late(&[200]), 200);
    // A stall of 3 ms is beyond any spin; all below it is not.
    assert_eq!(with_late(&[3000, 90, 80, 61]), 90);
    assert_eq!(with_late(&[3000, 3000, 201, 161]), 165);
    assert_eq!(with_late(&[3000, 3000, 3000, 3000]), 50);
    assert_eq!(with_late(&[3000; 20]), 50);
}

#[test]
fn what_the_file_gives_is_taken_whatever_is_measured() {
    let rounds = rounds([(DmaLatency, [90, 90, 4]), (IdleThread, [4, 4, 4]), (Nothing, [4, 4, 4])]);
    let rt = Rt {
        keep_awake: Some(DmaLatency),
        phase_us: Some(175),
        ..Rt::default()
    };
    let chosen = decide(&rt, &plan(), &rounds);
    assert_eq!(values(&chosen), (DmaLatency, 175, 90));
    assert_eq!(
        (chosen.phase_us.source, chosen.spin_us.source),
        (Source::File, Source::Measured)
    );
    let applied = chosen.applied(&rt);
    assert_eq!(
        (applied.keep_awake, applied.phase_us, applied.spin_us, applied.priority),
        (Some(DmaLatency), Some(175), Some(90), rt.priority)
    );
    let all = Rt { spin_us: Some(0), ..rt };
    assert_eq!(values(&decide(&all, &plan(), &rounds)), (DmaLatency, 175, 0));
}

#[test]
fn a_spin_is_raised_while_running_unless_the_file_gives_it_and_that_is_told() {
    let text = include_str!("../../../../configs/mill3-demo.toml");
    let mut config = config::parse(text, std::path::Path::new("demo.toml")).unwrap();
    let raised_us = |rt: Rt, config: &mut Config| {
        config.rt = rt;
        let mut spin = Calibration::unmeasured(&config.rt, 1000, Nothing, "why").spin(config);
        (0..3).for_each(|_| spin.add_wakeup(60_000));
        spin.raised_us()
    };
    let given = Rt {
        spin_us: Some(50),
        ..Rt::default()
    };
    let set = Rt {
        calibrate: false,
        ..Rt::default()
    };
    assert_eq!(raised_us(Rt::default(), &mut config), Some(60));
    assert_eq!(raised_us(given, &mut config), None);
    assert_eq!(raised_us(set, &mut config), None);

    let rounds = rounds([(DmaLatency, [4, 4, 4]), (IdleThread, [4, 4, 4]), (Nothing, [4, 4, 4])]);
    let chosen = Calibration {
        spin_raised_us: Some(165),
        ..decide(&Rt::default(), &plan(), &rounds)
    };
    assert!(
        chosen.to_string().contains("spin raised to 165 µs while it ran"),
        "{chosen}"
    );
    assert_eq!(chosen.applied(&Rt::default()).spin_us, Some(165));
}

#[test]
fn without_a_single_wake_up_the_defaults_hold() {
    let chosen = decide(&Rt::default(), &plan(), &[]);
    assert_eq!(
        (chosen.phase_us.value, chosen.spin_us.value, chosen.measured),
        (375, 50, None)
    );
    assert_eq!(chosen.unmeasured.as_deref(), Some("no thread could be had"));
}

#[test]
fn plans_stay_between_the_ticks_and_leave_the_exchange_its_time() {
    let plan = |rt: &Rt, cycle_us, busy_us| Plan::new(rt, cycle_us, IdleThread, busy_us);
    let usual = plan(&Rt::default(), 1000, 700);
    assert_eq!(usual.keep_awake, [IdleThread, DmaLatency, Nothing]);
    assert_eq!(
        (usual.phases_us, usual.cycles, usual.spin_max_us),
        (vec![175, 375, 575, 775, 975], 20, 200)
    );
    assert_eq!(plan(&Rt::default(), 1000, 880).spin_max_us, 120);
    assert_eq!(plan(&Rt::default(), 1000, 1000).spin_max_us, 50);
    assert_eq!(plan(&Rt::default(), 250, 100).phases_us, [75, 175]);
    assert_eq!(plan(&Rt::default(), 10_000, 100).cycles, 2);
    let given = Rt {
        keep_awake: Some(Nothing),
        timeout_us: 300,
        ..Rt::default()
    };
    let uneven = plan(&given, 1000, 100);
    assert_eq!(
        (uneven.keep_awake, uneven.phases_us),
        (vec![Nothing], vec![170, 370, 570, 770, 970])
    );
    // Each lies in the middle between two ticks.
    for cycle_us in [250, 400, 500, 750, 1000, 2000, 10_000] {
        let phases_us = plan(&Rt::default(), cycle_us, 100).phases_us;
        assert!(
            phases_us
                .iter()
                .all(|phase_us| phase_us % 50 == 25 && *phase_us < cycle_us),
            "{phases_us:?}"
        );
        assert!(phases_us.is_sorted_by(|a, b| a < b), "{phases_us:?}");
    }
}

/// Wakes late by 3 µs, but once by more than two of three phases.
struct Made {
    now_ns: u64,
    dates: Vec<u64>,
}

impl Clock for Made {
    fn now_ns(&mut self) -> u64 {
        self.now_ns
    }

    fn wait_until(&mut self, deadline_ns: u64, spin_ns: u64) -> u64 {
        assert_eq!(spin_ns, 0);
        self.dates.push(deadline_ns / 1000);
        self.now_ns = deadline_ns + if self.dates.len() == 2 { 450_000 } else { 3_000 };
        self.now_ns
    }
}

#[test]
fn every_phase_of_every_cycle_is_probed_and_what_has_passed_is_left_out() {
    let mut clock = Made {
        now_ns: 5_300_000,
        dates: Vec::new(),
    };
    let plan = Plan { cycles: 2, ..plan() };
    let mut late_ns = vec![Vec::new(); 3];
    probe(&mut clock, &plan, &mut late_ns);
    // The second wake-up comes at 7825 µs: the date at 7575 has passed.
    assert_eq!(clock.dates, [7175, 7375, 8175, 8375, 8575]);
    assert_eq!(late_ns, [vec![3000, 3000], vec![450_000, 3000], vec![3000]]);
}

#[test]
fn a_machine_that_leaves_nothing_open_is_not_measured() {
    let text = include_str!("../../../../configs/mill3-demo.toml");
    let mut config = config::parse(text, std::path::Path::new("demo.toml")).unwrap();
    config.rt = Rt {
        phase_us: Some(370),
        keep_awake: Some(Nothing),
        calibrate: false,
        lock_memory: false,
        ..Rt::default()
    };
    let mut process = super::super::setup::prepare_process(&config.rt).unwrap();
    let chosen = calibrate(&config, &mut process);
    assert_eq!(chosen.unmeasured.as_deref(), Some("rt.calibrate = false"));
    assert_eq!(values(&chosen), (Nothing, 370, 50));
    assert_eq!(
        (chosen.phase_us.source, chosen.spin_us.source),
        (Source::File, Source::Default)
    );
}
