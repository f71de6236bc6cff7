//! The examples of `configs/logic` beside their tables: what comes out is what is kept, and each small change of a program shows
//! in its table. `REFERENCES=write` writes the tables anew, to be looked through line by line. A mutant that no table tells from the program is a case that the example does not try.

use logic::{Logic, Role, Runtime, duration};
use std::fs::read_to_string;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const EXAMPLES: [&str; 6] = ["carousel", "coolant", "door", "lubrication", "turret", "two-hand"];
const PERIOD_NS: i64 = 10_000_000;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(path: &str) -> String {
    let path = root().join(path);
    read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The table of outputs, as `isocnc logic run` prints it; what goes wrong stands at its end.
fn trace(logic: &Arc<Logic>, inputs: &str) -> String {
    let mut lines = inputs.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').skip(1).collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let outputs: Vec<_> = logic
        .all_variables()
        .filter(|variable| variable.role == Role::Output)
        .collect();
    let mut runtime = Runtime::new(Arc::clone(logic));
    let names: String = outputs
        .iter()
        .map(|output| format!(",{}", logic.name(output)))
        .collect();
    let mut shown = format!("t_ms{names}\n");
    let time = |row: &[&str]| duration::of_milliseconds(row[0]).unwrap();
    let mut now_ns = 0;
    while now_ns <= time(rows.last().unwrap()) {
        let row = rows.iter().rev().find(|row| time(row) <= now_ns).unwrap();
        for (name, value) in header.iter().zip(&row[1..]) {
            let input = logic.variable(name).unwrap_or_else(|| panic!("no {name}"));
            let value = logic.read(input, value).unwrap_or_else(|| panic!("{name} = {value}"));
            assert!(runtime.set(input, value));
        }
        runtime.scan(now_ns);
        let values: String = outputs
            .iter()
            .map(|output| format!(",{}", runtime.get(output)))
            .collect();
        shown += &format!("{}{values}\n", duration::milliseconds(now_ns));
        now_ns += PERIOD_NS;
    }
    match runtime.fault() {
        Some(fault) => format!("{shown}{fault}\n"),
        None => shown,
    }
}

#[test]
fn the_examples_do_what_is_kept() {
    for name in EXAMPLES {
        let text = read(&format!("configs/logic/{name}.st"));
        let logic = logic::compile(&text).unwrap_or_else(|told| panic!("{}", told[0].render(name)));
        assert!(
            logic
                .warnings()
                .iter()
                .all(|told| told.severity == logic::Severity::Note),
            "{:?}",
            logic.warnings()
        );
        let table = trace(&Arc::new(logic), &read(&format!("configs/logic/{name}.csv")));
        let kept = format!("tests/logic/{name}.csv");
        if std::env::var("REFERENCES").is_ok_and(|what| what == "write") {
            std::fs::write(root().join(&kept), &table).unwrap();
        }
        assert_eq!(table, read(&kept), "{name}");
    }
}

/// Small changes: what stands in a program, and what takes its place.
const CHANGES: [(&str, &str); 26] = [
    (" AND ", " OR "),
    (" OR ", " AND "),
    (" XOR ", " OR "),
    ("NOT ", ""),
    (" <> ", " = "),
    (" = ", " <> "),
    (" > ", " >= "),
    (" > ", " < "),
    (" >= ", " > "),
    (" < ", " <= "),
    (" < ", " > "),
    (" + ", " - "),
    (" - ", " + "),
    (" MOD ", " / "),
    (" / ", " * "),
    ("TRUE", "FALSE"),
    ("FALSE", "TRUE"),
    ("TON", "TOF"),
    ("TOF", "TON"),
    (": TP", ": TON"),
    ("R_TRIG", "F_TRIG"),
    ("F_TRIG", "R_TRIG"),
    (": SR", ": TON"),
    ("ELSIF", "END_IF; IF"),
    ("SEL(", "SEL(FALSE AND "),
    ("SEL(", "SEL(TRUE OR "),
];

/// Every mutant of a program, with its line and what was changed. Comments and what is declared stay, instances change their kind.
fn mutants(text: &str) -> Vec<(usize, String, String)> {
    let mut mutants = Vec::new();
    let mut at_start = 0;
    let mut in_comment = false;
    let mut in_constants = false;
    for (index, line) in text.split_inclusive('\n').enumerate() {
        let start = at_start;
        at_start += line.len();
        in_comment |= line.contains("(*");
        let is_comment = in_comment;
        in_comment &= !line.contains("*)");
        in_constants =
            (in_constants || line.contains("VAR_INPUT") || line.contains("CONSTANT")) && !line.contains("END_VAR");
        if is_comment || in_constants {
            continue;
        }
        let code = line.split("//").next().unwrap();
        let mut changed = |at: usize, from: usize, to: &str| {
            let mutant = format!("{}{to}{}", &text[..start + at], &text[start + at + from..]);
            mutants.push((index + 1, format!("{:?} to {to:?}", &code[at..at + from]), mutant));
        };
        for (from, to) in CHANGES {
            for (at, _) in code.match_indices(from) {
                changed(at, from.len(), to);
            }
        }
        // Conditions that always hold or never do.
        if let (Some(at), Some(end)) = (code.find("IF "), code.find(" THEN"))
            && !code.contains("END_IF")
        {
            changed(at + 3, end - at - 3, "TRUE");
            changed(at + 3, end - at - 3, "FALSE");
        }
        // A block that is not called.
        let trimmed = code.trim();
        if trimmed.ends_with(");") && !trimmed.starts_with("IF") && trimmed.find('(') < trimmed.find(":=") {
            changed(code.len() - code.trim_start().len(), trimmed.len(), ";");
        }
        // Times that are a scan longer.
        for (at, _) in code.match_indices("T#") {
            let end = code[at..].find([')', ',', ';', ' ']).map_or(code.len(), |end| at + end);
            changed(at, end - at, &format!("({} + T#10ms)", &code[at..end]));
        }
        // An assignment that is left out, and numbers that are one more.
        if let (Some(at), true) = (code.find(" := "), code.trim_end().ends_with(';')) {
            let name = code[..at].rfind(' ').map_or(0, |space| space + 1);
            if !code[..at].contains(['(', ':']) {
                changed(name, code.trim_end().len() - name, ";");
            }
        }
        for (at, number) in code.match_indices(|letter: char| letter.is_ascii_digit()) {
            let is_alone = !code[..at]
                .ends_with(|letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '_' | '#' | '$'));
            if is_alone && !code[at + 1..].starts_with(|letter: char| letter.is_ascii_digit()) {
                changed(at, 1, &(number.parse::<u8>().unwrap() + 1).to_string());
            }
        }
    }
    mutants
}

/// Mutants that do the same as the program: program, what stands in the line, the change.
const EQUIVALENT: [(&str, &str, &str); 6] = [
    // The way to another pocket is never 0.
    (
        "carousel",
        "way := SEL(way_to(pocket, wanted) > 0",
        "\" > \" to \" >= \"",
    ),
    // The two branches exclude each other as it is.
    (
        "carousel",
        "ELSIF way <> rest AND (pocket = wanted",
        "\"ELSIF\" to \"END_IF; IF\"",
    ),
    ("turret", "ELSIF step = loose THEN", "\"ELSIF\" to \"END_IF; IF\""),
    ("lubrication", "ELSIF NOT pressure", "\"ELSIF\" to \"END_IF; IF\""),
    ("two-hand", "ELSIF window.Q AND armed", "\"ELSIF\" to \"END_IF; IF\""),
    ("two-hand", "ELSIF blocked OR NOT", "\"ELSIF\" to \"END_IF; IF\""),
];

#[test]
fn each_small_change_of_an_example_shows_in_its_table() {
    let (mut all, mut alive) = (0, Vec::new());
    for name in EXAMPLES {
        let text = read(&format!("configs/logic/{name}.st"));
        let inputs = read(&format!("configs/logic/{name}.csv"));
        let kept = read(&format!("tests/logic/{name}.csv"));
        for (line, change, mutant) in mutants(&text) {
            // One that does not compile is found by its error.
            let Ok(logic) = logic::compile(&mutant) else { continue };
            all += 1;
            let code = text.lines().nth(line - 1).unwrap_or_default();
            let is_it =
                |(known, part, what): &(&str, &str, &str)| *known == name && code.contains(part) && *what == change;
            let is_known = EQUIVALENT.iter().any(is_it);
            let is_told = trace(&Arc::new(logic), &inputs) != kept;
            if is_told == is_known {
                alive.push(format!(
                    "{name}.st:{line}: {change}{}",
                    if is_known { " is told now" } else { "" }
                ));
            }
        }
    }
    assert!(all > 150, "only {all} mutants");
    assert!(
        alive.is_empty(),
        "{} of {all} mutants live:\n{}",
        alive.len(),
        alive.join("../..")
    );
}
