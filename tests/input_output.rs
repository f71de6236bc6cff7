//! Inputs and outputs of programs (M62 to M68), on virtual time: in which cycle they act.

use hal_pins::Input;
use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::machine::tables::Tables;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::program::{Begin, check};
use isocnc::rt::shared::Command;
use isocnc::sim::NetConfig;
use motion::cancel::Cancel;
use motion::plan::PlannerKind;
use std::path::Path;

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const CYCLES_MAX: u64 = 200_000;
const PLANNERS: [PlannerKind; 2] = [PlannerKind::Optimal, PlannerKind::Classic];
/// X of G54.
const G54_X: f64 = 20.0;

fn machine(planner: PlannerKind) -> Config {
    // The second digital output also leaves for the I/O node.
    let net = "\n[[hal.net]]\nname = \"laser\"\nsource = \"motion.digital-out-01\"\ntargets = [\"io.10.out-05\"]\n";
    let mut config =
        config::parse(&format!("{MACHINE}{net}"), Path::new("mill3-demo.toml")).expect("a good machine file");
    config.program.planner = planner;
    config
}

fn rehearse_part<T>(planner: PlannerKind, text: &str, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    rehearse(&machine(planner), text.as_bytes(), NetConfig::clean(1), |run| {
        Ok(act(run))
    })
    .expect("a machine to rehearse on")
}

/// Pins of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    line: u32,
    x: f64,
    speed: f64,
    digital: [bool; 3],
    analog: f64,
    node_bit: bool,
}

struct Pins {
    line: Input<u32>,
    x: Input<f64>,
    speed: Input<f64>,
    digital: [Input<bool>; 3],
    analog: Input<f64>,
    node_bit: Input<bool>,
}

impl Pins {
    fn new(run: &Rehearsal<'_>) -> Pins {
        let bit = |name: &str| run.hal.reader(name).expect("a pin");
        Pins {
            line: run.hal.reader("motion.program-line").expect("a pin"),
            x: run.hal.reader("axis.x.pos-cmd").expect("a pin"),
            speed: run.hal.reader("motion.current-vel").expect("a pin"),
            digital: [0, 1, 2].map(|index| bit(&format!("motion.digital-out-{index:02}"))),
            analog: run.hal.reader("motion.analog-out-00").expect("a pin"),
            node_bit: bit("io.10.out-05"),
        }
    }

    fn see(&self) -> Seen {
        Seen {
            line: self.line.get(),
            x: self.x.get(),
            speed: self.speed.get(),
            digital: [0, 1, 2].map(|index| self.digital[index].get()),
            analog: self.analog.get(),
            node_bit: self.node_bit.get(),
        }
    }
}

/// Every cycle of a program; `act` is asked before each.
fn run_down(planner: PlannerKind, text: &str, mut act: impl FnMut(&mut Rehearsal<'_>, &Seen)) -> Vec<Seen> {
    rehearse_part(planner, text, |run| {
        let pins = Pins::new(run);
        let mut seen = vec![pins.see()];
        let ended = run.run_until(CYCLES_MAX, |run| {
            seen.push(pins.see());
            act(run, &pins.see());
            run.operator.outcome().is_some()
        });
        assert!(ended.expect("a good program"), "{:#?}", run.operator.journal());
        assert_eq!(
            run.operator.outcome(),
            Some(Outcome::Completed),
            "{:#?}",
            run.operator.journal()
        );
        seen
    })
}

/// Cycles in which something is no longer as it was in the one before.
fn edges<T: PartialEq>(seen: &[Seen], of: impl Fn(&Seen) -> T) -> Vec<usize> {
    (1..seen.len())
        .filter(|&cycle| of(&seen[cycle]) != of(&seen[cycle - 1]))
        .collect()
}

/// The first cycle of a line.
fn begin_of(seen: &[Seen], line: u32) -> usize {
    let mut cycles = 1..seen.len();
    cycles
        .find(|&cycle| seen[cycle].line == line && seen[cycle - 1].line != line)
        .unwrap_or_else(|| {
            panic!(
                "line {line} among {:?}",
                edges(seen, |seen| seen.line)
                    .iter()
                    .map(|&cycle| seen[cycle].line)
                    .collect::<Vec<_>>()
            )
        })
}

/// Straight on at 100 mm/s at X50; around a corner at X100.
fn part(mode: &str) -> String {
    format!(
        "G21 G90 G94 G17 {mode} F6000\nG0 X0 Y0 Z0\nG1 X50\nM62 P1\nM62 P0\nM67 E0 Q2.5\nG1 X100\nM63 P1\nM67 E0 Q-1\nM67 E0 Q7\n\
         G1 Y50\nG1 X110 Y70\nM64 P2\nG4 P0.05\nM62 P1\nM5\nM2\n"
    )
}
const STRAIGHT_ON: u32 = 7;
const CORNER: u32 = 11;

fn assert_edges(seen: &[Seen], what: &str) {
    let (straight, corner) = (begin_of(seen, STRAIGHT_ON), begin_of(seen, CORNER));
    // In the cycle of the block boundary, neither before nor behind it; together; once.
    assert_eq!(edges(seen, |seen| seen.digital[1]), [straight, corner], "{what}");
    assert_eq!(edges(seen, |seen| seen.node_bit), [straight, corner], "{what}");
    assert_eq!(edges(seen, |seen| seen.digital[0]), [straight], "{what}");
    assert_eq!(edges(seen, |seen| seen.analog), [straight, corner], "{what}");
    assert_eq!((seen[straight].analog, seen[corner].analog), (2.5, 7.0), "{what}");
    let boundary = G54_X + 50.0;
    assert!(
        seen[straight - 1].x <= boundary && seen[straight].x > boundary,
        "{what}: {:?}",
        seen[straight]
    );
    // What M64 sets is set at rest, behind the last move; M62 without a move behind it never is.
    let [at] = edges(seen, |seen| seen.digital[2])[..] else {
        panic!("{what}: M64 sets once")
    };
    assert_eq!((seen[at].speed, seen[at].line), (0.0, 13), "{what}");
    let last = seen.last().expect("cycles");
    assert_eq!(
        (last.digital, last.analog),
        ([true, false, true], 7.0),
        "{what}: outputs keep what they have"
    );
}

#[test]
fn an_output_with_motion_changes_in_the_cycle_of_its_block_boundary() {
    for planner in PLANNERS {
        for mode in ["G61", "G64 P0.05", "G64 P0", "G61.1"] {
            let seen = run_down(planner, &part(mode), |_, _| {});
            let what = format!("{planner:?} {mode}");
            assert_edges(&seen, &what);
            if mode != "G61.1" {
                let straight = begin_of(&seen, STRAIGHT_ON);
                assert!(
                    seen[straight].speed > 95.0,
                    "{what}: on the way, not at rest: {:?}",
                    seen[straight]
                );
            }
        }
    }
}

#[test]
fn holds_overrides_and_the_way_back_do_not_move_the_edge() {
    for planner in PLANNERS {
        for mode in ["G61", "G64 P0.05"] {
            for stop_mm in [49.0, 47.0, 46.2, 30.0] {
                // A hold whose ramp ends before, at or behind the boundary; 0.3 s later, on.
                let (mut begun, mut gone) = (None, false);
                let mut cycle = 0;
                let seen = run_down(planner, &part(mode), |run, seen| {
                    cycle += 1;
                    if begun.is_none() && seen.line == 3 && seen.x > G54_X + stop_mm {
                        begun = Some(cycle);
                        run.operator.give(Command::Hold);
                    }
                    if !gone && begun.is_some_and(|begun| cycle > begun + 300) {
                        gone = true;
                        assert_eq!(run.operator.live().state, State::Held);
                        run.operator.give(Command::Resume);
                    }
                });
                assert!(gone);
                assert_edges(&seen, &format!("{planner:?} {mode} hold at {stop_mm}"));
            }
            // Slower on the way, by the operator; then back from behind the boundary, as far as there is a way, and on.
            let (mut slower, mut back, mut on) = (false, None, false);
            let mut cycle = 0;
            let seen = run_down(planner, &part(mode), |run, seen| {
                cycle += 1;
                if !slower && seen.line == 3 && seen.x > G54_X + 10.0 {
                    slower = true;
                    run.hal.set("halui.feed-override.direct-value", true).expect("a pin");
                    run.hal.set("halui.feed-override.scale", 0.01).expect("a pin");
                    run.hal.set("halui.feed-override.counts", 37_i32).expect("a pin");
                }
                if back.is_none() && seen.line == STRAIGHT_ON && seen.x > G54_X + 80.0 {
                    back = Some(cycle);
                    run.operator.give(Command::Reverse(1.0));
                }
                if !on && back.is_some_and(|back| cycle > back + 3000) {
                    on = true;
                    run.operator.give(Command::Resume);
                }
            });
            assert!(slower && on);
            let least = seen
                .iter()
                .filter(|seen| seen.line == STRAIGHT_ON)
                .map(|seen| seen.x)
                .fold(f64::MAX, f64::min);
            assert!(least < G54_X + 51.0, "it went back: {least}");
            assert_edges(&seen, &format!("{planner:?} {mode} slower and back"));
        }
    }
}

/// Runs a program with a wait; `act` is asked in every cycle, and is told for how many the wait has lasted. Gives how often the
/// machine was in each line, and whether it completed.
fn wait(text: &str, mut act: impl FnMut(&mut Rehearsal<'_>, u64)) -> (Vec<Seen>, Option<Outcome>) {
    rehearse_part(PlannerKind::Optimal, text, |run| {
        let pins = Pins::new(run);
        let (mut seen, mut waited) = (Vec::new(), 0);
        run.run_until(CYCLES_MAX, |run| {
            seen.push(pins.see());
            waited = if pins.line.get() == 3 { waited + 1 } else { 0 };
            act(run, waited);
            run.operator.outcome().is_some()
        })
        .expect("a good program");
        (seen, run.operator.outcome())
    })
}

/// Where X ends tells what M66 read.
fn ends_at(text: &str, act: impl FnMut(&mut Rehearsal<'_>, u64)) -> (f64, usize) {
    let (seen, outcome) = wait(text, act);
    assert_eq!(outcome, Some(Outcome::Completed));
    let waited = seen.iter().filter(|seen| seen.line == 3).count();
    // The drives count 0.1 um.
    (((seen.last().expect("cycles").x - G54_X) * 1e3).round() / 1e3, waited)
}

fn m66(words: &str) -> String {
    format!("G21 G90 G94 F6000\nG0 X0\nM66 {words}\nG1 X[50 + 10 * #5399]\nM2\n")
}

fn set(run: &Rehearsal<'_>, index: u8, on: bool) {
    run.hal
        .set(&format!("motion.digital-in-{index:02}"), on)
        .expect("a pin");
}

#[test]
fn m66_waits_for_a_level_or_an_edge() {
    // Nothing to wait for.
    assert_eq!(ends_at(&m66("P2 L0"), |run, _| set(run, 2, true)).0, 60.0);
    assert_eq!(ends_at(&m66("P2"), |_, _| {}).0, 50.0);
    assert_eq!(
        ends_at(&m66("E1 L0"), |run, _| run
            .hal
            .set("motion.analog-in-01", -1.25)
            .expect("a pin"))
        .0,
        37.5
    );
    // A level that is there is no wait; one that comes ends it; an edge has to come.
    let (x, short) = ends_at(&m66("P2 L3 Q5"), |run, _| set(run, 2, true));
    assert_eq!(x, 60.0);
    let (x, waited) = ends_at(&m66("P2 L3 Q5"), |run, waited| set(run, 2, waited >= 500));
    assert_eq!((x, waited), (60.0, short + 500));
    let (x, waited) = ends_at(&m66("P2 L4 Q5"), |run, waited| set(run, 2, waited < 500));
    assert_eq!((x, waited), (50.0, short + 500));
    let (x, waited) = ends_at(&m66("P2 L1 Q5"), |run, waited| {
        set(run, 2, waited < 100 || waited == 500)
    });
    assert_eq!((x, waited), (60.0, short + 500), "one cycle long is long enough");
    let (x, waited) = ends_at(&m66("P2 L2 Q5"), |run, waited| {
        set(run, 2, waited > 100 && waited < 500)
    });
    assert_eq!((x, waited), (50.0, short + 500));
    // Another input is none of its business.
    let (x, waited) = ends_at(&m66("P2 L1 Q0.7"), |run, waited| set(run, 1, waited == 500));
    assert_eq!(x, 40.0, "the time is over");
    assert_eq!(waited, short + 699);
}

#[test]
fn an_edge_in_the_cycle_in_which_m66_begins_counts() {
    // The line of M66 is the first one that is shown in the cycle in which it begins.
    let rises_in = |cycle: u64| {
        let mut before = 0;
        let mut begun = None;
        let text = m66("P2 L1 Q0.2");
        let (seen, _) = wait(&text, |run, waited| {
            before += 1;
            if waited == 1 {
                begun = Some(before);
            }
            set(run, 2, before >= cycle);
        });
        (
            begun.expect("M66 begins"),
            (seen.last().expect("cycles").x - G54_X).round(),
        )
    };
    let (begun, missed) = rises_in(u64::MAX);
    assert_eq!(missed, 40.0);
    // Pins set behind cycle n are read in cycle n + 1.
    assert_eq!(rises_in(begun - 2).1, 40.0, "it was up before");
    assert_eq!(rises_in(begun - 1).1, 60.0, "it rises in the very cycle");
    assert_eq!(rises_in(begun).1, 60.0);
}

#[test]
fn a_stop_ends_a_wait_and_nothing_behind_it_runs() {
    let (seen, outcome) = wait(&m66("P2 L3 Q1000"), |run, waited| {
        if waited == 300 {
            run.operator.give(Command::Stop);
        }
    });
    assert_ne!(outcome, Some(Outcome::Completed));
    assert_eq!(seen.last().expect("cycles").x, G54_X);
}

#[test]
fn outputs_and_inputs_that_there_are_not_are_refused_at_their_place() {
    let config = machine(PlannerKind::Optimal);
    let tables = Tables::read(&config).expect("tables");
    let refused = |line: &str| {
        let text = format!("G21\n{line}\nM2\n");
        let checked = check(
            &config,
            &tables,
            "p.ngc",
            text.as_bytes(),
            &Begin::at_home(&config),
            &Cancel::default(),
        );
        checked.expect_err(line).to_string()
    };
    for (line, place) in [
        ("M62 P4", "p.ngc:2:5"),
        ("M65 P64", "p.ngc:2:5"),
        ("M68 E4 Q1", "p.ngc:2:5"),
        ("M66 E4 L0", "p.ngc:2:5"),
    ] {
        let shown = refused(line);
        assert!(shown.contains(place) && shown.contains('3'), "{line}: {shown}");
    }
}
