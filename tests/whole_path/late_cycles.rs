//! Cycles that come late or are left out: they cost time and never a jump.

use super::*;

#[test]
fn late_cycles_cost_time_and_no_jump() {
    let clean = rehearse_part(NetConfig::clean(11), PART, |run| {
        assert_eq!(finish(run), Outcome::Completed);
        commands(run)
    });
    // A date that has passed by no more than half the cycle is still kept; what comes later waits for the next date on the grid.
    for (late_us, late_max_us, skipped) in [(400, 400, 0), (600, 0, 1), (4_100, 100, 4), (4_600, 0, 5)] {
        rehearse_part(NetConfig::clean(11), PART, |run| {
            reach_midst(run);
            run.cycle(late_us * 1000).expect("a good program");
            assert_eq!(finish(run), Outcome::Completed);
            assert_eq!(run.operator.late_cycles(), skipped, "late by {late_us} us");
            assert_eq!(
                run.operator.live().late_max_ns,
                late_max_us * 1000,
                "late by {late_us} us"
            );
            // One step of the trajectory for every cycle that ran: the very same set-points, only later.
            assert!(commands(run) == clean, "late by {late_us} us");
            assert_part_cut(run);
        });
    }
}

#[test]
fn many_overruns_are_told_of_and_too_many_stop_the_machine_on_the_path() {
    let mut config = machine();
    (config.rt.overruns_warn, config.rt.overruns_stop) = (5, 20);
    // Every so many cycles one is late by more than is kept.
    let run_late = |every: u64, outcome: Outcome| {
        rehearse_on(&config, NetConfig::clean(21), PART, |run| {
            reach_midst(run);
            let mut cycle = 0;
            while run.operator.outcome().is_none() {
                cycle += 1;
                let late_ns = if run.control.state() == State::Running && cycle % every == 0 {
                    600_000
                } else {
                    0
                };
                run.cycle(late_ns).expect("a good program");
            }
            assert_eq!(run.operator.outcome(), Some(outcome), "{}", journal(run));
            let commands = commands(run);
            assert_within_limits(&commands, outcome == Outcome::Faulted);
            assert_on_path(run);
            assert_ends_at_rest(&commands);
            let told = journal(run)
                .matches("warning: 6 of the last 1000 cycles were skipped")
                .count();
            let alarms: Vec<String> = run
                .operator
                .alarms()
                .iter()
                .map(|alarm| alarm.cause.text.clone())
                .collect();
            (told, alarms, run.operator.late_cycles())
        })
    };
    let (told, alarms, late) = run_late(400, Outcome::Completed);
    assert_eq!((told, alarms.len()), (0, 0));
    assert!(late > 0);
    let (told, alarms, _) = run_late(60, Outcome::Completed);
    assert_eq!((told, alarms.len()), (1, 0));
    let (told, alarms, late) = run_late(20, Outcome::Faulted);
    assert_eq!((told, late), (1, 21));
    assert!(
        alarms[0].starts_with("21 of the last 1000 cycles were skipped"),
        "{alarms:?}"
    );
}

#[test]
fn overruns_of_boot_up_do_not_count_against_the_machine() {
    let mut config = machine();
    (config.rt.overruns_warn, config.rt.overruns_stop) = (0, 20);
    rehearse_on(&config, NetConfig::clean(22), PART, |run| {
        let (mut cycles, mut late) = (0_u64, 0);
        while run.control.state() == State::Booting {
            cycles += 1;
            let is_late = cycles.is_multiple_of(5);
            late += u64::from(is_late);
            run.cycle(if is_late { 600_000 } else { 0 }).expect("a good program");
        }
        assert!(late > 100, "{late} late cycles");
        run.cycle(600_000).expect("a good program");
        assert_eq!(finish(run), Outcome::Completed, "{}", journal(run));
        assert_eq!(run.operator.late_cycles(), late + 1);
    });
}
