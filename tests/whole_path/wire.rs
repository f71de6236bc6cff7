//! The network: lost answers, dead nodes, noise, another managing node, chained and multiplexed nodes.

use super::*;

#[test]
fn lost_answers_up_to_the_limit_are_counted_and_ridden_out() {
    let limit = machine().bus.pres_lost_max;
    assert_eq!(limit, 3);
    for count in [1, limit] {
        rehearse_part(NetConfig::clean(2), PART, |run| {
            reach_midst(run);
            let before = lost(run);
            assert_eq!(before, [0; 3]);
            let now_ns = run.now_ns();
            run.net().at(now_ns, Disturbance::DropPres { node: 2, count });
            assert_eq!(finish(run), Outcome::Completed);
            assert_eq!(lost(run), [0, u64::from(count), 0]);
            assert_eq!(run.operator.alarms(), []);
            assert_part_cut(run);
            assert_within_limits(&commands(run), false);
        });
    }
}

#[test]
fn where_nodes_bear_any_loss_everything_waits_for_an_answer_and_goes_on_where_it_was() {
    let mut config = machine();
    (config.bus.soc_lost_max, config.bus.pres_lost_max) = (None, 1000);
    let run_with = |lost: u32| {
        rehearse_on(&config, NetConfig::clean(2), PART, |run| {
            reach_midst(run);
            let now_ns = run.now_ns();
            run.net().at(now_ns, Disturbance::DropPres { node: 2, count: lost });
            assert_eq!(finish(run), Outcome::Completed);
            assert_eq!(run.operator.alarms(), []);
            assert_part_cut(run);
            (commands(run), run.now_ns())
        })
    };
    let ((clean, clean_ns), (late, late_ns)) = (run_with(0), run_with(400));
    assert!(late == clean);
    assert_eq!(late_ns - clean_ns, 400_000_000);
}

#[test]
fn more_lost_answers_than_the_limit_stop_all_joints_on_the_path() {
    rehearse_part(NetConfig::clean(3), PART, |run| {
        let causes = fails_in_order(run, Disturbance::DropPres { node: 2, count: 5 }, &[0, 2]);
        assert_eq!(causes, ["y-drive (node 2): lost, it does not answer any more"]);
        assert_eq!(lost(run)[0], 0);
    });
}

#[test]
fn a_node_dead_in_mid_program_stops_the_others_on_the_path() {
    for (node, alive, cause) in [
        (1, &[1, 2][..], "x-drive (node 1): lost, it does not answer any more"),
        (3, &[0, 1][..], "z-drive (node 3): lost, it does not answer any more"),
        (10, &[0, 1, 2][..], "io (node 10): lost, it does not answer any more"),
    ] {
        for disturbance in [Disturbance::PowerOff { node }, Disturbance::Unplug { node }] {
            rehearse_part(NetConfig::clean(4), PART, |run| {
                let causes = fails_in_order(run, disturbance, alive);
                assert_eq!(causes, [cause], "{disturbance:?}");
            });
        }
    }
}

#[test]
fn a_mandatory_node_that_never_answers_ends_the_boot_and_is_named() {
    rehearse_part(NetConfig::clean(5), PART, |run| {
        run.net().at(0, Disturbance::PowerOff { node: 2 });
        assert_eq!(finish(run), Outcome::TimedOut(Step::Network));
        assert!(journal(run).contains("y-drive (node 2) is missing: expected device type 0x00020192"));
        assert_eq!(commands(run), [[0.0; 3]; 0]);
    });
}

#[test]
fn a_mandatory_node_that_dies_during_boot_ends_it_and_is_named() {
    for at_ms in [655, 700, 800, 900, 963] {
        rehearse_part(NetConfig::clean(6), PART, |run| {
            println!("dies at {at_ms} ms");
            run.net().at(at_ms * 1_000_000, Disturbance::PowerOff { node: 2 });
            let outcome = finish(run);
            assert!(
                matches!(outcome, Outcome::TimedOut(Step::Network) | Outcome::Faulted),
                "{outcome:?}"
            );
            let named = journal(run).lines().any(|line| {
                line.contains("y-drive (node 2)") && !line.ends_with("found") && !line.ends_with("operational")
            });
            assert!(named, "{}", journal(run));
            assert_eq!(commands(run), [[0.0; 3]; 0]);
        });
    }
}

#[test]
fn a_noisy_wire_is_ridden_out() {
    for seed in [101, 102, 103] {
        let net = NetConfig {
            loss: 0.01,
            ..NetConfig::clean(seed)
        };
        // Losses of that share hit neighbouring polls all the time, but hardly ever more than the limit in a row.
        rehearse_part(net, PART, |run| {
            assert_eq!(finish(run), Outcome::Completed);
            assert_part_cut(run);
            assert_within_limits(&commands(run), false);
            assert!(lost(run).iter().sum::<u64>() > 100, "{:?}", lost(run));
        });
    }
}

#[test]
fn a_very_noisy_wire_never_hangs_the_machine() {
    for seed in 111..117 {
        let net = NetConfig {
            loss: 0.08,
            ..NetConfig::clean(seed)
        };
        rehearse_part(net, PART, |run| match finish(run) {
            Outcome::Completed => assert_part_cut(run),
            Outcome::Faulted => assert!(!run.operator.alarms().is_empty()),
            Outcome::TimedOut(step) => assert_eq!(step, Step::Network),
            Outcome::Stopped => panic!("nobody stopped it"),
        });
    }
}

#[test]
fn a_wire_that_corrupts_doubles_and_reorders_never_hangs_the_machine() {
    for seed in [201, 202, 203] {
        let net = NetConfig {
            loss: 0.002,
            duplicate: 0.01,
            reorder: 0.005,
            corrupt: 0.002,
            ..NetConfig::clean(seed)
        };
        rehearse_part(net, PART, |run| match finish(run) {
            Outcome::Completed => {
                let last = *commands(run).last().expect("a program ran");
                assert_eq!(last[Axis::X as usize], PART_END[0]);
            }
            Outcome::Faulted => assert!(!run.operator.alarms().is_empty()),
            Outcome::TimedOut(_) => {}
            Outcome::Stopped => panic!("nobody stopped it"),
        });
    }
}

#[test]
fn a_node_lost_while_the_drives_are_off_wants_an_acknowledge() {
    rehearse_part(NetConfig::clean(24), PART, |run| {
        disable_in_midst(run);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::Unplug { node: 10 });
        reach_state(run, State::Faulted);
        assert_eq!(finish(run), Outcome::Faulted);
        let causes: Vec<&str> = run
            .operator
            .alarms()
            .iter()
            .map(|alarm| alarm.cause.text.as_str())
            .collect();
        assert_eq!(causes, ["io (node 10): lost, it does not answer any more"]);
    });
}

/// A SoC of another managing node arrives.
fn hear_foreign_master(run: &mut Rehearsal<'_>) {
    let header = Header::multicast(multicast::SOC, [2, 0, 0, 0, 0, 9], 240);
    let mut frame = [0; 60];
    let length = Soc::default().emit(&header, &mut frame).expect("room for a SoC");
    run.net().inject(&frame[..length]);
}

#[test]
fn another_managing_node_is_told_of_and_nothing_starts_beside_it() {
    for at_ms in [300, 655, 690, 711] {
        rehearse_part(NetConfig::clean(27), PART, |run| {
            println!("heard at {at_ms} ms");
            reach(run, "so late", |run| run.now_ns() >= at_ms * 1_000_000);
            assert_eq!(run.control.state(), State::Booting);
            hear_foreign_master(run);
            assert_eq!(finish(run), Outcome::Faulted);
            assert!(
                run.operator.alarms()[0]
                    .cause
                    .text
                    .starts_with("another managing node is on the wire: 02:00:00:00:00:09")
            );
            assert_eq!(commands(run), [[0.0; 3]; 0]);
        });
    }
}

#[test]
fn another_managing_node_in_mid_program_stops_the_machine_on_the_path() {
    rehearse_part(NetConfig::clean(28), PART, |run| {
        reach_midst(run);
        hear_foreign_master(run);
        reach_state(run, State::Stopping);
        assert_eq!(finish(run), Outcome::Faulted);
        let commands = commands(run);
        assert_ends_at_rest(&commands);
        assert_within_limits(&commands, true);
        assert_on_path(run);
        assert_powerless(run);
    });
}

/// The demo machine with other ways to exchange process data: Y and Z chained, the I/O node in one cycle of four.
fn mixed_machine() -> Config {
    let text = MACHINE
        .replacen(
            "interface = \"plk0\"\n",
            "interface = \"plk0\"\nmultiplex_cycles = 4\n",
            1,
        )
        .replacen("name = \"y-drive\"\n", "name = \"y-drive\"\nchained = true\n", 1)
        .replacen("name = \"z-drive\"\n", "name = \"z-drive\"\nchained = true\n", 1)
        .replacen("name = \"io\"\n", "name = \"io\"\nmultiplex = 2\n", 1);
    let mut config = config::parse(&text, Path::new("mixed.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    config.bus.pres_lost_max = 3;
    config
}

#[test]
fn chained_drives_and_a_multiplexed_node_cut_the_same_part() {
    let polled = rehearse_part(NetConfig::clean(41), PART, |run| {
        assert_eq!(finish(run), Outcome::Completed);
        commands(run)
    });
    rehearse_on(&mixed_machine(), NetConfig::clean(41), PART, |run| {
        assert_eq!(finish(run), Outcome::Completed);
        assert_part_cut(run);
        assert_on_path(run);
        assert_eq!(lost(run), [0; 3]);
        let polls: Vec<u64> = (0..4)
            .map(|node| run.control.bus_mut().statistics(node).polls)
            .collect();
        let cycles = polls[0];
        assert!(
            polls[1].abs_diff(cycles) < 100 && polls[2].abs_diff(cycles) < 100,
            "{polls:?}"
        );
        assert!(polls[3].abs_diff(cycles / 4) < 100, "one cycle of four: {polls:?}");
        let mixed = commands(run);
        // The network boots at another pace, the program is the same to the last bit.
        assert_eq!(mixed[mixed.len() - 1000..], polled[polled.len() - 1000..]);
    });
}

#[test]
fn a_chained_drive_that_dies_stops_the_machine_and_is_named() {
    rehearse_on(&mixed_machine(), NetConfig::clean(42), PART, |run| {
        reach_midst(run);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::Unplug { node: 2 });
        assert_eq!(finish(run), Outcome::Faulted);
        let cause = run.operator.alarms()[0].cause.text.clone();
        assert!(cause.contains("y-drive"), "{cause}");
        assert_within_limits(&commands(run), true);
    });
}
