//! `isocnc logic` as a user runs it: the examples beside their tables, errors, the budget of a scan.

use serde_json::Value as Json;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const EXAMPLES: [&str; 6] = ["carousel", "coolant", "door", "lubrication", "turret", "two-hand"];

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn isocnc(words: &[&str]) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(words)
        .current_dir(root(""))
        .output();
    output.expect("isocnc")
}

fn out(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("text")
}

fn said(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("text")
}

/// A file of this content, and its folder, which is gone at the end of the test.
fn file(name: &str, text: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, text).expect("a file");
    let path = path.to_str().expect("a name").to_owned();
    (folder, path)
}

#[test]
fn every_example_is_good_and_does_what_is_kept() {
    let files = fs::read_dir(root("configs/logic")).expect("examples").count();
    assert_eq!(files, 2 * EXAMPLES.len());
    for name in EXAMPLES {
        let text = format!("configs/logic/{name}.st");
        let checked = isocnc(&["logic", "check", &text]);
        assert!(checked.status.success(), "{}", said(&checked));
        let inputs = format!("configs/logic/{name}.csv");
        let run = isocnc(&["logic", "run", &text, "--inputs", &inputs, "--period-ms", "10"]);
        assert!(run.status.success(), "{}", said(&run));
        let kept = fs::read_to_string(root(&format!("tests/logic/{name}.csv"))).expect("a table");
        assert_eq!(out(&run), kept, "{name}");
    }
}

#[test]
fn a_check_tells_all_errors_or_what_a_scan_takes() {
    let (_folder, bad) = file(
        "bad.st",
        "PROGRAM p\nVAR a : INT; END_VAR\na = 1;\nb := 2;\nEND_PROGRAM\n",
    );
    let told = isocnc(&["logic", "check", &bad]);
    assert_eq!(told.status.code(), Some(1));
    let shown = said(&told);
    assert!(
        shown.contains("= compares: write := to assign") && shown.contains("b is not declared"),
        "{shown}"
    );
    assert!(
        shown.contains("bad.st:3:3") && shown.contains("bad.st: 2 errors"),
        "{shown}"
    );
    let told = isocnc(&["logic", "check", &bad, "--json"]);
    let json: Json = serde_json::from_slice(&told.stdout).expect("JSON");
    assert_eq!(
        (&json["errors"][0]["line"], &json["errors"][0]["column"]),
        (&Json::from(3), &Json::from(3))
    );
    assert_eq!(json["errors"].as_array().map(Vec::len), Some(2));

    let good = isocnc(&["logic", "check", "configs/logic/door.st", "--json"]);
    let json: Json = serde_json::from_slice(&good.stdout).expect("JSON");
    assert_eq!(
        json["inputs"],
        serde_json::json!(["request", "closed", "running", "standstill"])
    );
    assert_eq!(
        json["outputs"],
        serde_json::json!(["hold", "unlock", "start_allowed", "message"])
    );
    assert!(
        json["steps"].as_u64().is_some_and(|steps| (20..200).contains(&steps)),
        "{json}"
    );
}

#[test]
fn a_scan_that_takes_too_long_is_refused() {
    let text = "PROGRAM p VAR i, j, n : DINT; END_VAR
        FOR i := 1 TO 1000000 DO FOR j := 1 TO 1000000 DO n := n + 1; EXIT; END_FOR; EXIT; END_FOR; END_PROGRAM";
    let (_folder, long) = file("long.st", text);
    let told = isocnc(&["logic", "check", &long]);
    assert_eq!(told.status.code(), Some(1), "{}", out(&told));
    assert!(
        said(&told).contains("more than 50 % of a period of 10 ms"),
        "{}",
        said(&told)
    );
}

/// Of loops inside each other without a bound each is told at its own place.
#[test]
fn a_loop_without_a_bound_is_told_at_its_line() {
    let text = "PROGRAM p\nVAR a, b : DINT; END_VAR\na := 1;\nWHILE a < b DO\n  WHILE a < b DO\n    REPEAT\n      WHILE a < b DO\n        \
                a := a + 1;\n      END_WHILE;\n    UNTIL a > b END_REPEAT;\n  END_WHILE;\nEND_WHILE;\nEND_PROGRAM\n";
    let (_folder, long) = file("loops.st", text);
    let told = isocnc(&["logic", "check", &long]);
    assert_eq!(told.status.code(), Some(1));
    let shown = said(&told);
    assert!(
        shown.contains("loops.st:4:1: the loop names no bound and counts with 1000 iterations: write {max_iterations := n} before it"),
        "{shown}"
    );
    assert!(shown.contains("so do those of the lines 5, 6, 7"), "{shown}");
    let told = isocnc(&["logic", "check", &long, "--json"]);
    let json: Json = serde_json::from_slice(&told.stdout).expect("JSON");
    let errors = json["errors"].as_array().expect("errors");
    let places: Vec<_> = errors
        .iter()
        .map(|error| (error["line"].as_u64(), error["column"].as_u64()))
        .collect();
    assert_eq!(
        places,
        [(4, 1), (5, 3), (6, 5), (7, 7)].map(|(line, column)| (Some(line), Some(column)))
    );
    let bound = text
        .replace("WHILE a < b DO", "{max_iterations := 2} WHILE a < b DO")
        .replace("REPEAT\n", "{max_iterations := 2} REPEAT\n");
    let (_other, bound) = file("bound.st", &bound);
    assert_eq!(isocnc(&["logic", "check", &bound]).status.code(), Some(0));
}

#[test]
fn a_run_tells_what_went_wrong_behind_its_table() {
    let text = "PROGRAM p\nVAR_INPUT n : INT; END_VAR VAR_OUTPUT x : INT; END_VAR VAR t : TON; END_VAR\nx := 10 / n;\nt(IN := n = 2, PT := T#1s);\nEND_PROGRAM";
    let (_folder, program) = file("divide.st", text);
    let (_other, inputs) = file("in.csv", "t_ms,n\n0,5\n10,0\n20,2\n30,2\n");
    let run = isocnc(&["logic", "run", &program, "--inputs", &inputs, "--watch", "n,t.ET"]);
    assert_eq!(out(&run), "t_ms,x,n,t.ET\n0,2,5,0\n10,0,0,0\n20,5,2,0\n30,5,2,10\n");
    assert_eq!(run.status.code(), Some(1));
    assert!(
        said(&run).contains("divide.st:3:6: division by zero: the result is 0; 1 times in all"),
        "{}",
        said(&run)
    );

    let (_another, wrong) = file("wrong.csv", "t_ms,m\n0,5\n");
    let run = isocnc(&["logic", "run", &program, "--inputs", &wrong]);
    assert_eq!((run.status.code(), out(&run)), (Some(1), String::new()));
    assert!(
        said(&run).contains("wrong.csv:1: m is no input; inputs are n"),
        "{}",
        said(&run)
    );
    let run = isocnc(&["logic", "run", &program, "--inputs", &inputs, "--period-ms", "0"]);
    assert_eq!(run.status.code(), Some(2));
}
