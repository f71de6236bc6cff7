//! How long a whole program still takes, on virtual time: from its check, where the machine is, and the overrides.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Step;
use isocnc::machine::state::State;
use isocnc::machine::tables::Tables;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::program::outline::Outline;
use isocnc::program::{Begin, approach, check};
use isocnc::rt::overrides::Overridden::{self, Feed, Rapid};
use isocnc::rt::shared::Command;
use isocnc::sim::NetConfig;
use motion::cancel::Cancel;
use motion::canon::Position;
use std::path::Path;

/// Half a minute at feed, a few seconds of rapid moves, a dwell, corners, an arc, a loop.
const PART: &str = "G21 G90 G94 G54 G17 G64 P0.01\nG0 X40 Y40 Z-5\nM3 S500\nG1 Z-8 F600\n#1=0\no1 while [#1 LT 4]\nG1 X90 F1200\n\
                    G3 X100 Y50 J10\nG1 Y60\nX40\nY40\n#1=[#1+1]\no1 endwhile\nG4 P1\nG0 Z-5\nG1 X80 F2400\nG0 X0 Y0\nM5\nM2\n";
const CYCLES_MAX: u64 = 200_000;

fn machine() -> (Config, Tables) {
    let config = config::parse(include_str!("../configs/mill3-demo.toml"), Path::new("demo.toml")).expect("a machine");
    let tables = Tables::read(&config).expect("tables");
    (config, tables)
}

fn outline(config: &Config, tables: &Tables, text: &str, begin: &Begin) -> Outline {
    let checked = check(config, tables, "p.ngc", text.as_bytes(), begin, &Cancel::default());
    checked.expect("a good program").outline
}

fn turn(run: &Rehearsal<'_>, what: Overridden, percent: f64) {
    let overrides = &run.operator.shared().overrides;
    overrides.order(what, percent).expect("in its range");
}

fn shares(run: &Rehearsal<'_>) -> [f64; 2] {
    [Feed, Rapid].map(|what| run.operator.shared().overrides.share(what))
}

/// Runs to the end, and gives for some moments what was said to be left and what was, s, and the share said to be done.
fn said_and_was(run: &mut Rehearsal<'_>, outline: &Outline) -> Vec<(Option<f64>, f64, f64)> {
    let mut said = Vec::new();
    let mut last_s = 0.0;
    let ended = run.run_until(CYCLES_MAX, |run| {
        let live = run.operator.live();
        if run.control.state() == State::Running && live.cycles % 500 == 0 {
            let left = outline
                .left(live.way, run.operator.shared().lead(), shares(run))
                .expect("within the program");
            said.push((left.time_s, live.elapsed_s, left.done));
        }
        last_s = f64::max(last_s, live.elapsed_s);
        run.operator.outcome().is_some() || run.operator.step() == Step::Disable
    });
    assert!(ended.expect("a good program"), "{:#?}", run.operator.journal());
    said.into_iter()
        .map(|(said_s, at_s, done)| (said_s, last_s - at_s, done))
        .collect()
}

fn assert_true(said: &[(Option<f64>, f64, f64)], slack_s: f64) {
    assert!(said.len() > 20, "{said:?}");
    for (said_s, was_s, _) in said {
        let off_s = said_s.expect("known") - was_s;
        assert!(off_s.abs() < slack_s, "said {said_s:?}, was {was_s}");
    }
    let done: Vec<f64> = said.iter().map(|(.., done)| *done).collect();
    assert!(
        done.is_sorted() && done[0] < 0.05 && done[done.len() - 1] > 0.95,
        "{done:?}"
    );
}

#[test]
fn as_programmed_the_time_that_is_left_is_right() {
    let (config, tables) = machine();
    let outline = outline(&config, &tables, PART, &Begin::at_home(&config));
    rehearse(&config, PART.as_bytes(), NetConfig::clean(1), |run| {
        let said = said_and_was(run, &outline);
        assert_true(&said, 0.05 * said[0].1);
        Ok(())
    })
    .expect("a good program");
}

#[test]
fn at_half_the_feed_it_is_about_right_from_the_first_moment_on() {
    let (config, tables) = machine();
    let outline = outline(&config, &tables, PART, &Begin::at_home(&config));
    let as_programmed_s = outline
        .left(0.0, (0, 0.0), [1.0, 1.0])
        .and_then(|left| left.time_s)
        .expect("known");
    rehearse(&config, PART.as_bytes(), NetConfig::clean(1), |run| {
        turn(run, Feed, 50.0);
        turn(run, Rapid, 50.0);
        let said = said_and_was(run, &outline);
        assert!(said[0].0.expect("known") > 1.7 * as_programmed_s, "{said:?}");
        // Speeding up does not take twice as long.
        assert_true(&said, 0.05 * said[0].1);
        Ok(())
    })
    .expect("a good program");
}

#[test]
fn with_no_feed_nobody_knows_and_what_is_done_stays_done() {
    let (config, tables) = machine();
    let outline = outline(&config, &tables, PART, &Begin::at_home(&config));
    rehearse(&config, PART.as_bytes(), NetConfig::clean(1), |run| {
        let there = run.run_until(CYCLES_MAX, |run| run.operator.live().elapsed_s > 5.0)?;
        assert!(there);
        turn(run, Feed, 0.0);
        run.run_until(2_000, |_| false)?;
        let left = |run: &Rehearsal<'_>| {
            outline
                .left(run.operator.live().way, run.operator.shared().lead(), shares(run))
                .expect("within it")
        };
        let held = left(run);
        assert_eq!(held.time_s, None);
        run.run_until(2_000, |_| false)?;
        assert_eq!(left(run), held);
        // Back along the path, less is done.
        turn(run, Feed, 100.0);
        run.operator.give(Command::Reverse(1.0));
        run.run_until(1_000, |_| false)?;
        assert!(left(run).done < held.done, "{:?} {held:?}", left(run));
        run.operator.give(Command::Resume);
        let on_last_way = run.run_until(CYCLES_MAX, |run| run.operator.live().line == 17)?;
        assert!(on_last_way);
        // Behind the corner.
        run.run_until(100, |_| false)?;
        // Only rapid moves are left, which do not wait for it.
        turn(run, Feed, 0.0);
        assert!(left(run).time_s.expect("known") < 2.0);
        Ok(())
    })
    .expect("a good program");
}

/// A program is checked when it is loaded, and run from wherever the machine is then.
#[test]
fn a_program_that_begins_elsewhere_than_it_was_checked_from_has_its_time_all_the_same() {
    let (config, tables) = machine();
    let far = Begin::Program {
        at: Position::xyz(240.0, 140.0, -10.0),
    };
    let elsewhere = outline(&config, &tables, PART, &far);
    let at_home = outline(&config, &tables, PART, &Begin::at_home(&config));
    assert_ne!(elsewhere, at_home);
    rehearse(&config, PART.as_bytes(), NetConfig::clean(1), |run| {
        let said = said_and_was(run, &elsewhere);
        // Behind the way there, which took another time.
        assert_true(&said[2..], 0.05 * said[0].1);
        Ok(())
    })
    .expect("a good program");
}

#[test]
fn from_a_line_on_it_is_the_time_of_what_is_run() {
    let (config, tables) = machine();
    let at = isocnc::program::home(&config);
    let begin = Begin::FromLine {
        at,
        line: 14,
        approach: approach(&config),
    };
    let outline = outline(&config, &tables, PART, &begin);
    rehearse(&config, PART.as_bytes(), NetConfig::clean(1), |run| {
        run.set_program(PART.as_bytes(), tables.clone(), begin.clone(), false);
        let said = said_and_was(run, &outline);
        assert!(said.len() > 5, "{said:?}");
        assert!((said[0].0.expect("known") - said[0].1).abs() < 0.5, "{said:?}");
        Ok(())
    })
    .expect("a good program");
}

#[test]
fn a_program_that_asks_the_machine_says_what_its_time_takes_for_granted() {
    let (config, tables) = machine();
    let begin = Begin::at_home(&config);
    assert_eq!(outline(&config, &tables, PART, &begin).assumes(), None);
    let text = "G21 G90 G94\nG1 X10 F600\nM66 P0 L3 Q5\nM66 P1 L3 Q5\nG1 X20\nM2\n";
    let assumes = outline(&config, &tables, text, &begin);
    assert_eq!(
        assumes.assumes(),
        Some("line 3 reads an input (M66), which counts as if it came at once")
    );
}
