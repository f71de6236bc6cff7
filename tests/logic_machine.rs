//! A machine whose door, lubrication and tool carousel run in Structured Text, on virtual time: `configs/cell3-demo.toml`.
//!
//! Its sensors are played by a second program. Faults are put into it by its pins.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::rt::shared::Command;
use isocnc::sim::NetConfig;
use std::path::Path;

const CYCLES_MAX: u64 = 400_000;
const PART: &[u8] = b"G21 G90 G94 G54\nT3 M6\nS1000 M3\nG0 X5 Y5 Z-5\nG1 X100 F3000\nY50\nX5\nT1 M6\nG1 Y5\nM5\nM2\n";

fn machine() -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/cell3-demo.toml");
    config::read(&path).unwrap_or_else(|errors| panic!("{errors}"))
}

fn with<T>(text: &[u8], act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    rehearse(&machine(), text, NetConfig::clean(1), |run| Ok(act(run))).expect("a machine to rehearse on")
}

fn until(run: &mut Rehearsal<'_>, what: &str, done: impl FnMut(&mut Rehearsal<'_>) -> bool) {
    let reached = run.run_until(CYCLES_MAX, done).expect("a good program");
    assert!(reached, "{what}: {:#?}", run.operator.journal());
}

fn said(run: &Rehearsal<'_>, text: &str) -> bool {
    run.operator.journal().iter().any(|entry| entry.text.contains(text))
}

#[test]
fn the_part_is_cut_with_tools_of_the_carousel() {
    let (outcome, pockets, journal) = with(PART, |run| {
        let pocket = run.hal.reader::<i32>("logic.cell.pocket").expect("a pin");
        let mut pockets = Vec::new();
        until(run, "the end", |run| {
            if pockets.last() != Some(&pocket.get()) {
                pockets.push(pocket.get());
            }
            run.operator.outcome().is_some()
        });
        (
            run.operator.outcome(),
            pockets,
            format!("{:#?}", run.operator.journal()),
        )
    });
    assert_eq!(outcome, Some(Outcome::Completed), "{journal}");
    // From pocket 1, where it is found, to 3 and back to 1.
    assert_eq!(pockets, [0, 1, 2, 3, 4, 1], "{journal}");
}

#[test]
fn the_sample_part_is_cut() {
    let text = include_bytes!("../configs/sample-part.ngc");
    let outcome = with(text, |run| run.run(CYCLES_MAX));
    assert_eq!(outcome.expect("an end"), Outcome::Completed);
}

#[test]
fn a_door_that_is_opened_in_the_cut_holds_until_it_is_closed() {
    with(PART, |run| {
        let speed = run.hal.reader::<f64>("motion.current-vel").expect("a pin");
        let x = run.hal.reader::<f64>("axis.x.pos-cmd").expect("a pin");
        until(run, "the cut", |_| x.get() > 60.0);
        run.hal.set("logic.plant.open-door", true).expect("a pin");
        until(run, "rest", |_| speed.get() == 0.0);
        let at = x.get();
        run.run_until(3000, |_| false).expect("a good program");
        assert_eq!((x.get(), run.control.state()), (at, State::Running));
        assert!(said(run, "the door is open"));
        run.hal.set("logic.plant.open-door", false).expect("a pin");
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
    });
}

#[test]
fn no_oil_stops_the_machine_with_an_alarm_in_words() {
    with(PART, |run| {
        run.hal.set("logic.plant.no-oil", true).expect("a pin");
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Faulted);
        assert!(
            said(run, "alarm: lubrication: no pressure"),
            "{:#?}",
            run.operator.journal()
        );
    });
}

#[test]
fn a_carousel_whose_sensor_is_stuck_times_out_with_an_alarm() {
    with(PART, |run| {
        let motor = run.hal.reader::<bool>("logic.cell.motor").expect("a pin");
        run.hal.set("logic.plant.stuck", true).expect("a pin");
        until(run, "the motor", |_| motor.get());
        until(run, "the fault", |run| run.control.state() == State::Faulted);
        // Until the operator has looked.
        run.run_until(20, |_| false).expect("a good program");
        assert!(
            said(run, "alarm: carousel: the pocket does not come"),
            "{:#?}",
            run.operator.journal()
        );
        assert!(!motor.get());
        run.operator.give(Command::Acknowledge);
        run.run_until(100, |_| false).expect("a good program");
        assert!(!motor.get());
    });
}

#[test]
fn the_same_comes_out_each_time() {
    let bits = || {
        with(PART, |run| {
            let x = run.hal.reader::<f64>("axis.x.pos-cmd").expect("a pin");
            let pocket = run.hal.reader::<i32>("logic.cell.pocket").expect("a pin");
            let mut seen = Vec::new();
            until(run, "the end", |run| {
                seen.push((x.get().to_bits(), pocket.get()));
                run.operator.outcome().is_some()
            });
            seen
        })
    };
    assert!(bits() == bits());
}
