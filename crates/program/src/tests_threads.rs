//! A program planned in one thread and in several: the same bits, the same errors, the same end.

use super::stages::Stage;
use super::*;
use motion::canon::ProbeEnd;
use motion::plan::PlannerKind;
use motion::plan::workers::Workers;
use motion::ring::{Consumer, Publish, channel};
use motion::rt::probe::Probed;
use rt::overrides::Overrides;
use rt::shared::RtStatus;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread::{Builder, scope};

const MACHINE: &str = include_str!("../../../tests/proof_programs/three-axes.toml");

fn machine(planner: PlannerKind) -> (Config, Tables) {
    let mut config = config::parse(MACHINE, Path::new("three-axes.toml")).unwrap();
    config.program.planner = planner;
    let tables = Tables::read(&config).unwrap();
    (config, tables)
}

/// Everything that is handed over.
#[derive(Default)]
struct Recorder {
    elements: Vec<Element>,
    tail: Vec<Element>,
    publications: Vec<[usize; 2]>,
}

impl Sink<Element> for Recorder {
    fn free(&self) -> usize {
        usize::MAX / 2
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        self.elements.extend_from_slice(committed);
        self.tail = tail.to_vec();
        self.publications.push([committed.len(), tail.len()]);
        Publish::Done
    }
}

/// All that can be seen of a plan. Numbers that are printed like this are equal only if their bits are.
#[derive(Debug, PartialEq)]
struct Seen {
    elements: Vec<String>,
    ideal: Vec<String>,
    lines_and_tolerances: Vec<(u32, f64)>,
    error: Option<String>,
    parameters: String,
}

fn planned(planner: PlannerKind, text: &str, threads: usize) -> Seen {
    let (config, tables) = machine(planner);
    scope(|scope| {
        let machine = (&config, &tables);
        let sink = Recorder::default();
        let mut feeder = Feeder::in_threads(
            machine,
            text.as_bytes(),
            home(&config),
            sink,
            Threads::new(threads, scope),
        );
        let (mut ideal, mut lines_and_tolerances, mut error) = (Vec::new(), Vec::new(), None);
        loop {
            let progress = feeder.pump();
            ideal.extend(feeder.ideal_path().map(|part| format!("{part:?}")));
            lines_and_tolerances.push((feeder.line(), feeder.tolerance_mm()));
            match progress {
                Ok(Progress::Done) => break,
                Ok(_) => {}
                Err(failed) => {
                    error = Some(failed.render("p.ngc"));
                    break;
                }
            }
        }
        let elements = feeder
            .sink()
            .elements
            .iter()
            .map(|element| format!("{element:?}"))
            .collect();
        let parameters = match error {
            // The interpreter may be ahead of what is wrong.
            Some(_) => String::new(),
            None => format!("{:?}", feeder.left_behind().parameters),
        };
        Seen {
            elements,
            ideal,
            lines_and_tolerances,
            error,
            parameters,
        }
    })
}

/// Blocks of 0.1 mm along a wave; more than some batches of them.
fn surface(blocks: usize) -> String {
    let mut text = "G21 G90 G17 G94 G64 P0.01\nG0 X0 Y0\nF3000\n".to_owned();
    for block in 1..=blocks {
        let x = 0.1 * block as f64;
        text += &format!("G1 X{x:.4} Y{:.4}\n", 5.0 * (0.4 * x).sin());
    }
    text + "M2\n"
}

/// Cutter compensation, arcs, offsets, a loop with parameters, waits, exact stops, a probing move that nobody carries out.
const MIXED: &str = "G21 G90 G17 G94 G64 P0.05\nT1\nF1200\nG0 X0 Y0 Z5\n\
    G41.1 D4\nG1 X10 Y0\nG1 X10 Y20\nG3 X0 Y30 I-10 J0\nG1 X-20\nG40\nG1 Y-10\n\
    #1 = 0\no100 while [#1 lt 400]\n#1 = [#1 + 1]\nG1 X[10 * sin[#1 * 9]] Y[0.05 * #1]\no100 endwhile\n\
    G10 L2 P1 X1 Y2\nG4 P0.1\nG61\nG1 X20 Y5\nG1 X20 Y25\nG61.1\nG1 X0\nG64 P0.02 Q0.02\n\
    M62 P1\nM67 E0 Q1.5\nG1 X2\nM63 P1\nM64 P2\nG1 X3\nM66 P0 L3 Q1\nG1 X[3 + #5399]\n\
    G38.2 Z-1 F100\n#500 = #5063\nG1 X5 F900\nM3 S1000\nG2 X5 Y25 I3 J0 Z1 P3\nM5\nM2\n";

#[test]
fn any_number_of_threads_plans_the_same_bits() {
    for planner in [PlannerKind::Optimal, PlannerKind::Classic] {
        for text in [
            surface(3000),
            MIXED.to_owned(),
            "M2\n".to_owned(),
            "G21 G1 X1 F100\nM2\n".to_owned(),
        ] {
            let expected = planned(planner, &text, 1);
            assert_eq!(expected.error, None);
            for threads in 2..=8 {
                let seen = planned(planner, &text, threads);
                assert!(seen == expected, "{planner:?}, {threads} threads: {:.80}", text);
            }
        }
    }
}

#[test]
fn errors_come_behind_what_stands_before_them() {
    let wrong = |line: &str, behind: &str| surface(700).replace("M2\n", &format!("{line}\n{behind}M2\n"));
    // Of the text; of the plan, with an error of the text behind it; of the end; of no text.
    for text in [
        wrong("G1 X1 G99.9", ""),
        wrong("G0 Z-900", "G1 X1 G99.9\n"),
        wrong("G0 X0", "").replace("M2\n", ""),
        String::new(),
    ] {
        for planner in [PlannerKind::Optimal, PlannerKind::Classic] {
            let expected = planned(planner, &text, 1);
            assert!(expected.error.is_some());
            for threads in 2..=5 {
                assert!(
                    planned(planner, &text, threads) == expected,
                    "{threads}: {:?}",
                    expected.error
                );
            }
        }
    }
    let error = planned(PlannerKind::Optimal, &wrong("G0 Z-900", "G1 X1 G99.9\n"), 3).error;
    assert!(
        error
            .clone()
            .is_some_and(|error| error.contains("p.ngc:704:4\n") && error.contains("G0 Z-900")),
        "{error:?}"
    );
}

/// Runs the machine until it has nothing to do.
fn run_dry(consumer: &mut Consumer<Element>) {
    while consumer.advance().is_some() {}
}

#[test]
fn what_follows_a_probing_move_begins_where_it_ended() {
    let text = "G21 G90 G94 F600\nG0 X1\nG38.2 Z-20\nG1 X[#5063]\nG38.3 Y5\nG1 Z0\nM2\n";
    let probed = |threads: usize| {
        let (config, tables) = machine(PlannerKind::Optimal);
        scope(|scope| {
            let (producer, mut consumer) = channel(1 << 14);
            let (mut answers, results) = waits::line();
            let mut feeder = Feeder::in_threads(
                (&config, &tables),
                text.as_bytes(),
                home(&config),
                producer,
                Threads::new(threads, scope),
            )
            .with_probe(results)
            .following(Arc::new(RtStatus::new(Overrides::new(PlannerKind::Optimal))));
            let (mut seen, mut contacts) = (Vec::new(), 0);
            loop {
                match feeder.pump().unwrap() {
                    Progress::Done => break,
                    Progress::Waiting => {
                        run_dry(&mut consumer);
                        seen.push(format!(
                            "{} {:?}",
                            feeder.line(),
                            feeder.ideal_path().collect::<Vec<_>>()
                        ));
                        contacts += 1;
                        let at = Position([1.0, 0.5 * f64::from(contacts), -2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
                        let end = ProbeEnd::Tripped;
                        answers.push(Answer::Probed(Probed { end, at, rest: at })).unwrap();
                    }
                    Progress::Working | Progress::RingFull => {}
                }
            }
            seen.push(format!("{:?}", feeder.ideal_path().collect::<Vec<_>>()));
            seen.push(format!("{:?}", feeder.left_behind().parameters));
            seen
        })
    };
    let expected = probed(1);
    assert_eq!(expected.len(), 4);
    assert!(expected[2].contains("-2.0"), "{expected:?}");
    for threads in 2..=5 {
        assert_eq!(probed(threads), expected, "{threads} threads");
    }
}

#[test]
fn a_program_that_nobody_wants_any_more_leaves_no_thread_behind() {
    let endless = "G21 G90 F600\no100 while [1]\nG1 X1\nG1 X0\no100 endwhile\nM2\n";
    let (config, tables) = machine(PlannerKind::Optimal);
    for threads in [2, 3, 5, 64] {
        // Comes back only if all threads of the scope have ended.
        scope(|scope| {
            let machine = (&config, &tables);
            let sink = Recorder::default();
            let mut feeder = Feeder::in_threads(
                machine,
                endless.as_bytes(),
                home(&config),
                sink,
                Threads::new(threads, scope),
            );
            for _ in 0..3 {
                assert_eq!(feeder.pump().unwrap(), Progress::Working);
            }
        });
        // In the middle of a probing move, and by a wish.
        let waits = "G21 G90 F600\nG38.2 Z-20\nM2\n";
        scope(|scope| {
            let (_answers, results) = waits::line();
            let machine = (&config, &tables);
            let mut feeder = Feeder::in_threads(
                machine,
                waits.as_bytes(),
                home(&config),
                Recorder::default(),
                Threads::new(threads, scope),
            )
            .with_probe(results);
            while feeder.pump().unwrap() != Progress::Waiting {}
            feeder.give_up_contact();
            assert_eq!(feeder.ideal_path().count(), 1);
        });
        scope(|scope| {
            let limits = CheckLimits::default();
            let cancel = limits.cancel.clone();
            let machine = (&config, &tables);
            let sink = Recorder::default();
            let mut feeder = Feeder::in_threads(
                machine,
                endless.as_bytes(),
                home(&config),
                sink,
                Threads::new(threads, scope),
            )
            .within(limits);
            assert_eq!(feeder.pump().unwrap(), Progress::Working);
            cancel.cancel();
            while feeder.pump().is_ok() {}
        });
    }
}

#[test]
fn a_panic_of_a_stage_is_one_of_its_caller() {
    let panicked = catch_unwind(AssertUnwindSafe(|| {
        scope(|scope| {
            let workers = Workers::with_helpers(0, 1, None, || ());
            let mut stage: Stage<'_, u32, u32> = Stage::Here(Box::new(7));
            stage.start(
                Builder::new(),
                &Threads::new(1, scope).spawn,
                &workers,
                |number, numbers| {
                    assert!(numbers.put(*number));
                    panic!("bad data at {number}");
                },
            );
            let Stage::There(thread) = &stage else {
                panic!("no thread")
            };
            assert_eq!((thread.batches.take(), thread.batches.take()), (Some(7), None));
            stage.recall();
        });
    }));
    let payload = panicked.unwrap_err();
    assert_eq!(
        payload.downcast_ref::<String>().map(String::as_str),
        Some("bad data at 7")
    );
}
