//! Programs beside a cycle that is played here.

use super::*;
use config::parse;
use hal_pins::AnyValue;
use logic::Wrong;

const MACHINE: &str = include_str!("../../../../configs/mill3-demo.toml");

struct Played {
    _folder: tempfile::TempDir,
    hal: Hal,
    ports: Ports,
    cycle: u64,
}

fn played(program: &str, keys: &str) -> Played {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cell.st"), program).unwrap();
    let text = format!("{MACHINE}\n[[logic]]\nfile = \"cell.st\"\n{keys}");
    let config = parse(&text, &folder.path().join("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let mut hal = Hal::create_in(&[folder.path().to_owned()], "played", 128).unwrap();
    let ports = Ports::claim(&mut hal, &config).map_err(|(_, error)| error).unwrap();
    Played {
        _folder: folder,
        hal,
        ports,
        cycle: 0,
    }
}

impl Played {
    /// One cycle; `now` is called behind what scans have come to.
    fn cycle(&mut self) {
        self.ports.publish();
        self.ports.sample(0, true);
        self.cycle += 1;
    }

    fn cycles(&mut self, count: u64) {
        for _ in 0..count {
            self.cycle();
        }
    }

    fn number(&self, pin: &str) -> f64 {
        match self.hal.view().value(&format!("logic.cell.{pin}")) {
            Some(AnyValue::Bit(on)) => f64::from(u8::from(on)),
            Some(AnyValue::S32(number)) => f64::from(number),
            Some(AnyValue::U64(number)) => number as f64,
            Some(AnyValue::Float(number)) => number,
            other => panic!("{pin}: {other:?}"),
        }
    }
}

/// Counts its scans; both inputs, with the sum that they have in one cycle, and its time.
const COUNT: &str = "PROGRAM p VAR_INPUT a, b : DINT; END_VAR
VAR_OUTPUT n, sum : DINT; on : BOOL; et : TIME; END_VAR VAR t : TON; END_VAR
n := n + 1; sum := a + b; t(IN := TRUE, PT := T#35ms); on := t.Q; et := t.ET; END_PROGRAM";

#[test]
fn a_scan_comes_every_period_sees_one_cycle_and_shows_in_the_next_one() {
    let mut played = played(COUNT, "period_ms = 10\n");
    let mut shown = Vec::new();
    for cycle in 0..45_i32 {
        played.hal.set("logic.cell.a", cycle).unwrap();
        played.hal.set("logic.cell.b", -cycle).unwrap();
        played.cycle();
        shown.push(["n", "sum", "on", "et"].map(|pin| played.number(pin)));
    }
    // Scans in cycles 0, 10, 20, ...; what they come to shows from the cycle behind on.
    let n: Vec<f64> = shown.iter().map(|shown| shown[0]).collect();
    assert_eq!(n[..2], [0.0, 1.0]);
    assert_eq!(n[10..12], [1.0, 2.0]);
    assert_eq!(n[44], 5.0);
    assert!(shown.iter().all(|shown| shown[1] == 0.0), "{shown:?}");
    // Time is that of the cycles: 35 ms are over in the scan of cycle 40.
    let on: Vec<usize> = (0..45).filter(|cycle| shown[*cycle][2] == 1.0).collect();
    assert_eq!(on[0], 41);
    assert_eq!((shown[31][3], shown[44][3]), (0.03, 0.035));
    assert_eq!(
        (played.number("task.scans"), played.number("task.overruns")),
        (5.0, 0.0)
    );
}

#[test]
fn cycles_that_are_left_out_count_for_the_time_and_the_grid() {
    let mut played = played(COUNT, "period_ms = 10\n");
    played.cycles(8);
    played.ports.publish();
    // Cycles 8 to 30 are left out: this one is 31, and the scans of 10 and 20 and 30 come as one.
    played.ports.sample(23, true);
    played.cycle();
    assert_eq!((played.number("n"), played.number("et")), (2.0, 0.031));
    // On the old grid again.
    played.cycles(8);
    assert_eq!(played.number("n"), 2.0);
    played.cycles(1);
    assert_eq!(played.number("n"), 3.0);
}

const DIVIDE: &str = "PROGRAM p VAR_INPUT per : INT := 1; END_VAR VAR_OUTPUT q, n : INT; lamp : BOOL; END_VAR VAR RETAIN all_scans : INT; END_VAR
n := n + 1; all_scans := all_scans + 1; lamp := FALSE;
q := 100 / per; END_PROGRAM";

#[test]
fn behind_an_error_outputs_are_safe_until_it_is_acknowledged_and_it_begins_anew() {
    let mut played = played(DIVIDE, "period_ms = 1\nsafe = { lamp = true, q = -1 }\n");
    // Before the first scan outputs are safe.
    assert_eq!((played.number("q"), played.number("lamp")), (-1.0, 1.0));
    played.cycles(5);
    assert_eq!(
        (played.number("q"), played.number("lamp"), played.number("n")),
        (100.0, 0.0, 4.0)
    );
    played.hal.set("logic.cell.per", 0_i32).unwrap();
    played.cycles(2);
    let error = LogicError {
        wrong: Wrong::DivisionByZero,
        line: 3,
        column: 6,
        goes_on: false,
    };
    assert_eq!(played.ports.take_fault(), Some(Fault::LogicError { task: 0, error }));
    assert_eq!(played.ports.take_fault(), None);
    let safe = ["q", "lamp", "n", "task.stands"].map(|pin| played.number(pin));
    assert_eq!(safe, [-1.0, 1.0, 0.0, 1.0]);
    // It stands: no scan, no other fault, and its variables are those of the scan that failed.
    played.cycles(50);
    assert_eq!((played.ports.take_fault(), played.number("task.scans")), (None, 6.0));
    let desk = played.ports.desk();
    let value = |name: &str| desk.look(0, &[name.to_owned()]).unwrap().1[0].value.clone();
    assert_eq!(["n", "q", "all_scans"].map(value), ["6", "0", "6"]);
    // Acknowledged while the cause is there: the same again.
    played.ports.acknowledge();
    played.cycles(3);
    assert!(matches!(played.ports.take_fault(), Some(Fault::LogicError { .. })));
    played.hal.set("logic.cell.per", 2_i32).unwrap();
    played.ports.acknowledge();
    played.cycles(3);
    assert_eq!(
        ["q", "n", "lamp", "task.stands"].map(|pin| played.number(pin)),
        [50.0, 2.0, 0.0, 0.0]
    );
    assert_eq!(desk.look(0, &["all_scans".into()]).unwrap().1[0].value, "10");
}

#[test]
fn variables_are_searched_by_the_words_of_their_names_and_pins_page_by_page() {
    let mut played = played(DIVIDE, "period_ms = 1\n");
    played.cycles(3);
    let desk = played.ports.desk();
    let found = |search: &str, from: usize, most: usize| {
        let (_, shown, more) = desk.look_at(0, &[], search, from, most).unwrap();
        (shown.into_iter().map(|one| one.name).collect::<Vec<_>>(), more)
    };
    assert_eq!(found("SCANS all", 0, 9), (vec!["all_scans".to_owned()], false));
    assert_eq!(found("logic.cell.q", 0, 9), (vec!["q".to_owned()], false), "by its pin");
    assert_eq!(found("scans lamp", 0, 9), (vec![], false), "all words in one");
    let (all, _) = found("", 0, 9);
    assert_eq!(all.len(), 5);
    assert_eq!(found("l", 0, 1), (vec![found("l", 0, 9).0[0].clone()], true));
    let pages: Vec<String> = (0..5).flat_map(|from| found("", from, 1).0).collect();
    assert_eq!(pages, all);
}

#[test]
fn with_on_error_continue_it_goes_on_with_a_warning() {
    let mut played = played(DIVIDE, "period_ms = 1\non_error = \"continue\"\n");
    played.hal.set("logic.cell.per", 0_i32).unwrap();
    played.cycles(4);
    let fault = played.ports.take_fault().unwrap();
    assert_eq!(fault.reaction(), machine::faults::Reaction::Warn);
    assert_eq!(
        (played.number("q"), played.number("n"), played.number("task.stands")),
        (0.0, 3.0, 0.0)
    );
}

/// A thread that is late: scans are run here where the thread would.
fn by_hand(played: &mut Played) -> Scanner {
    let mut scanners = played.ports.take_scanners();
    assert_eq!(scanners.len(), 1);
    scanners.remove(0)
}

#[test]
fn a_scan_that_is_late_is_finished_and_three_late_ones_in_a_row_are_a_fault() {
    let mut played = played(COUNT, "period_ms = 10\nsafe = { n = -7 }\n");
    let mut thread = by_hand(&mut played);
    let mut scan_in_cycles = |played: &mut Played, count: u64, when: &dyn Fn(u64) -> bool| {
        for cycle in 0..count {
            played.cycle();
            if when(cycle) {
                thread.scan_if_due();
            }
        }
    };
    // Each scan ends 5 ms behind its date, then one 15 ms: its successor is left out, and the next one is on the grid.
    scan_in_cycles(&mut played, 10, &|cycle| cycle == 5);
    scan_in_cycles(&mut played, 20, &|cycle| cycle == 15);
    assert_eq!((played.number("n"), played.number("task.overruns")), (2.0, 1.0));
    scan_in_cycles(&mut played, 10, &|cycle| cycle == 5);
    assert_eq!((played.number("n"), played.ports.take_fault()), (3.0, None));
    // Three times 15 ms in a row.
    scan_in_cycles(&mut played, 59, &|cycle| cycle % 20 == 15);
    assert_eq!(played.ports.take_fault(), Some(Fault::LogicLate { task: 0, scans: 3 }));
    assert_eq!((played.number("n"), played.number("task.stands")), (-7.0, 1.0));
    // Its late end changes nothing; an acknowledge lets it begin anew.
    scan_in_cycles(&mut played, 21, &|_| true);
    assert_eq!(played.number("n"), -7.0);
    played.ports.acknowledge();
    scan_in_cycles(&mut played, 20, &|_| true);
    assert_eq!((played.number("n"), played.number("task.stands")), (2.0, 0.0));
    // One that never ends is found, too.
    scan_in_cycles(&mut played, 50, &|_| false);
    assert_eq!(played.ports.take_fault(), Some(Fault::LogicLate { task: 0, scans: 3 }));
}

const TEXTS: &str = "PROGRAM p VAR_INPUT k : INT; END_VAR VAR_OUTPUT alarm, said : STRING; END_VAR
alarm := MUX(k, '', 'no oil', 'no air'); said := SEL(k = 3, 'ready', ''); IF k = 3 THEN alarm := ''; END_IF; END_PROGRAM";

#[test]
fn a_text_is_told_as_it_changes_and_an_alarm_holds_as_long_as_it_is_there() {
    let mut played = played(TEXTS, "period_ms = 1\nalarms = [\"alarm\"]\non_error = \"continue\"\n");
    let desk = played.ports.desk();
    let alarm = |fault: Option<Fault>| match fault {
        Some(Fault::LogicAlarm { task: 0, text }) => Some(desk.text(0, text)),
        None => None,
        other => panic!("{other:?}"),
    };
    played.cycles(2);
    assert_eq!(
        (alarm(played.ports.take_fault()), alarm(played.ports.standing())),
        (None, None)
    );
    assert_eq!(
        played.ports.take_message().map(|(_, text)| desk.text(0, text)),
        Some("ready".into())
    );
    assert_eq!(played.ports.take_message(), None);
    for (k, text) in [(1, "no oil"), (2, "no air")] {
        played.hal.set("logic.cell.k", k).unwrap();
        played.cycles(20);
        assert_eq!(alarm(played.ports.take_fault()).as_deref(), Some(text));
        assert_eq!(alarm(played.ports.take_fault()), None);
        assert_eq!(alarm(played.ports.standing()).as_deref(), Some(text));
    }
    played.hal.set("logic.cell.k", 0_i32).unwrap();
    played.cycles(2);
    assert_eq!(
        (alarm(played.ports.take_fault()), alarm(played.ports.standing())),
        (None, None)
    );
}

#[test]
fn forced_values_hold_against_pins_and_statements_until_they_are_released() {
    let mut played = played(COUNT, "period_ms = 1\n");
    let desk = played.ports.desk();
    played.hal.set("logic.cell.a", 1_i32).unwrap();
    assert_eq!(desk.force(0, "A", "40"), Ok("a = 40".into()));
    assert_eq!(desk.force(0, "n", "-3"), Ok("n = -3".into()));
    assert_eq!(desk.force(0, "t.PT", "2.5"), Ok("t.PT = 2.5".into()));
    played.cycles(10);
    assert_eq!((played.number("sum"), played.number("n")), (40.0, -3.0));
    let forced = |name: &str| desk.look(0, &[name.to_owned()]).unwrap().1[0].forced;
    assert_eq!(["a", "b", "n"].map(forced), [true, false, true]);
    assert_eq!((desk.release(0, Some("a")), desk.told()[0].forced), (Ok(1), 2));
    played.cycles(2);
    assert_eq!((played.number("sum"), played.number("n")), (1.0, -3.0));
    assert_eq!(desk.release(0, None), Ok(2));
    played.cycles(3);
    assert!(played.number("n") > -3.0);
    for (name, value, rule) in [
        ("x", "1", "there is no variable x"),
        ("summ", "1", "did you mean sum?"),
        ("on", "yes", "\"yes\" is no BOOL: TRUE or FALSE"),
        ("a", "3000000000", "is no DINT"),
        ("et", "1s", "is no TIME: T#1s500ms, or milliseconds"),
    ] {
        let why = desk.force(0, name, value).unwrap_err();
        assert!(why.contains(rule), "{why}");
    }
    assert!(desk.release(0, Some("a")).unwrap_err().contains("a is not forced"));
}

#[test]
fn no_more_is_forced_than_there_is_room_for() {
    let program = "PROGRAM p VAR l : ARRAY[1..100] OF INT; END_VAR l[1] := 0; END_PROGRAM";
    let mut played = played(program, "period_ms = 1\n");
    let desk = played.ports.desk();
    let force = |number: usize| desk.force(0, &format!("l[{number}]"), "5");
    for number in 1..=64 {
        assert!(force(number).is_ok(), "{number}");
        played.cycles(2);
    }
    assert!(force(65).unwrap_err().contains("64 variables are forced already"));
    assert!(force(64).is_ok());
}

const CHANGED: &str = "PROGRAM p VAR_INPUT a, b : DINT; END_VAR
VAR_OUTPUT n, sum : DINT; on : BOOL; et : TIME; END_VAR VAR t : TON; new : INT := 4; END_VAR
n := n + 100; sum := a - b; t(IN := TRUE, PT := T#35ms); on := t.Q; et := t.ET; END_PROGRAM";

#[test]
fn a_changed_program_goes_on_where_the_old_one_was() {
    let mut played = played(COUNT, "period_ms = 10\n");
    let desk = played.ports.desk();
    played.hal.set("logic.cell.a", 7_i32).unwrap();
    played.hal.set("logic.cell.b", 2_i32).unwrap();
    played.cycles(21);
    assert_eq!((played.number("n"), played.number("sum")), (2.0, 9.0));
    desk.force(0, "b", "1").unwrap();
    std::fs::write(played._folder.path().join("cell.st"), CHANGED).unwrap();
    desk.replace(0, 5).unwrap();
    assert!(
        desk.replace(0, 6)
            .unwrap_err()
            .contains("another change of it is on its way")
    );
    assert_eq!(desk.replaced(), None);
    played.cycles(11);
    // n, sum, on, et, a, b, and the six of the timer.
    let wanted = Replaced {
        ticket: 5,
        task: 0,
        carried: Ok(12),
    };
    assert_eq!(desk.replaced(), Some(wanted));
    assert_eq!(desk.forced(), []);
    // Forced is nothing any more; the timer has gone on.
    assert_eq!(["n", "sum", "et"].map(|pin| played.number(pin)), [103.0, 5.0, 0.03]);
    assert_eq!(desk.look(0, &["new".into()]).unwrap().1[0].value, "4");
    played.cycles(10);
    assert_eq!(["n", "on"].map(|pin| played.number(pin)), [203.0, 1.0]);
}

#[test]
fn a_program_is_not_replaced_in_motion_nor_by_one_that_does_not_fit() {
    let mut played = played(COUNT, "period_ms = 10\n");
    let desk = played.ports.desk();
    let write = |text: &str| std::fs::write(played._folder.path().join("cell.st"), text).unwrap();
    write("PROGRAM p VAR x : INT; END_VAR\n x = 1; END_PROGRAM");
    assert!(
        desk.replace(0, 1)
            .unwrap_err()
            .ends_with("cell.st:2:4: = compares: write := to assign")
    );
    write(&COUNT.replace("sum : DINT", "sum : LINT"));
    assert!(
        desk.replace(0, 1)
            .unwrap_err()
            .contains("line 2: n is new, or has another type")
    );
    write(
        "PROGRAM p VAR i, j : DINT; END_VAR FOR i := 1 TO 60000 DO FOR j := 1 TO 60000 DO i := i; END_FOR; END_FOR; END_PROGRAM",
    );
    assert!(desk.replace(0, 1).is_err());
    write(CHANGED);
    desk.replace(0, 2).unwrap();
    played.ports.publish();
    played.ports.sample(0, false);
    let Replaced { ticket, carried, .. } = desk.replaced().unwrap();
    assert_eq!(ticket, 2);
    assert!(carried.unwrap_err().contains("the machine is not at rest"));
    played.cycles(1);
    assert_eq!(played.number("n"), 1.0);
}

#[test]
fn an_edge_is_none_because_a_program_is_new() {
    let program = |extra: &str| {
        format!(
            "PROGRAM p VAR_INPUT go : BOOL; END_VAR VAR_OUTPUT n : DINT; END_VAR VAR e : R_TRIG; {extra} END_VAR
             e(CLK := go); IF e.Q THEN n := n + 1; END_IF; END_PROGRAM"
        )
    };
    let mut played = played(&program(""), "period_ms = 1\n");
    let desk = played.ports.desk();
    played.hal.set("logic.cell.go", true).unwrap();
    played.cycles(5);
    for (round, extra) in ["a : INT;", "a, b : REAL;", ""].iter().enumerate() {
        std::fs::write(played._folder.path().join("cell.st"), program(extra)).unwrap();
        desk.replace(0, round as u64).unwrap();
        played.cycles(5);
        assert!(desk.replaced().is_some_and(|replaced| replaced.carried.is_ok()));
        assert_eq!(played.number("n"), 1.0);
    }
}

#[test]
fn what_is_retained_comes_again_with_its_time_and_what_has_another_type_does_not() {
    let program = "TYPE mode : (one, two); END_TYPE
        PROGRAM p VAR_OUTPUT et : TIME; END_VAR VAR RETAIN t : TON; parts : DINT := 3; m : mode := two; r : REAL := 0.1; END_VAR VAR n : INT; END_VAR
        parts := parts + 1; n := n + 1; t(IN := TRUE, PT := T#1s); et := t.ET; END_PROGRAM";
    let mut first = played(program, "period_ms = 10\n");
    first.cycles(22);
    let (time_ns, retained) = first.ports.desk().retained(0).unwrap();
    assert_eq!(time_ns, 20_000_000);
    let value = |name: &str| {
        retained
            .iter()
            .find(|one| one.name == name)
            .map(|one| one.value.as_str())
    };
    assert_eq!(
        (value("p.parts"), value("p.m"), value("p.n")),
        (Some("6"), Some("two"), None)
    );

    let mut second = played(program, "period_ms = 10\n");
    assert_eq!(second.ports.recall(0, time_ns, &retained), Vec::<String>::new());
    second.cycles(2);
    let desk = second.ports.desk();
    let value = |name: &str| desk.look(0, &[name.to_owned()]).unwrap().1[0].value.clone();
    // The timer goes on as if the time between had not been.
    assert_eq!(["parts", "n", "t.ET", "r"].map(value), ["7", "1", "30", "0.1"]);

    let changed = program
        .replace("parts : DINT := 3", "parts : INT := 9")
        .replace("one, two", "two_a, one");
    let mut third = played(&changed.replace("m : mode := two;", ""), "period_ms = 10\n");
    let told = third.ports.recall(0, time_ns, &retained);
    assert_eq!(
        told,
        [
            "p.parts was DINT and is INT now: it begins with its value of the start",
            "p.m is not RETAIN any more"
        ]
    );
    let changed = program
        .replace("(one, two)", "(one, three)")
        .replace(":= two", ":= three");
    let mut fourth = played(&changed, "period_ms = 10\n");
    let told = fourth.ports.recall(0, time_ns, &retained);
    assert_eq!(
        told,
        ["p.m has no value two any more: it begins with its value of the start"]
    );
}
