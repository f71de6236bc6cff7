//! `isocnc interpret` as a user runs it: streams, options, exit codes, what errors look like.

use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn isocnc(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
    command.current_dir(folder).arg("interpret").args(arguments);
    command
}

/// Runs `interpret` with these files in the current directory.
fn interpret(files: &[(&str, &str)], arguments: &[&str]) -> (tempfile::TempDir, Output) {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    let output = isocnc(folder.path(), arguments).output().unwrap();
    (folder, output)
}

fn text(octets: &[u8]) -> &str {
    std::str::from_utf8(octets).unwrap()
}

/// Printed calls, without their counts and those of start and end.
fn calls(output: &Output) -> Vec<&str> {
    let lines = text(&output.stdout).lines().map(|line| &line[6..]);
    let lines = lines.skip_while(|line| !line.contains("ON_RESET")).skip(1);
    lines
        .take_while(|line| !line.contains("SET_G5X_OFFSET(1") && !line.contains("ON_RESET"))
        .collect()
}

const FIRST_MOVE: &str = "N..... STRAIGHT_TRAVERSE(1.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)";

/// `mill.canon` is what LinuxCNC 2.9 printed for `mill.ngc` (`rs274 -g` with a tool 1 in the table).
#[test]
fn a_program_is_printed_as_linuxcnc_prints_it() {
    // Newer ones print tool changes otherwise.
    let newest = |line: &str| match line {
        _ if line.ends_with("START_CHANGE()") => None,
        _ => Some(
            line.find("CHANGE_TOOL(")
                .map_or(line, |at| &line[..at + "CHANGE_TOOL(".len()])
                .to_owned(),
        ),
    };
    let without_count = |text: &str| -> Vec<String> { text.lines().filter_map(|line| newest(&line[6..])).collect() };
    let program = include_str!("interpret/mill.ngc");
    let (_, output) = interpret(
        &[("mill.ngc", program), ("tools.tbl", "T1 P1\n")],
        &["mill.ngc", "-t", "tools.tbl"],
    );
    assert_eq!(text(&output.stderr), "");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(
        without_count(text(&output.stdout)),
        without_count(include_str!("interpret/mill.canon"))
    );
    for (index, line) in text(&output.stdout).lines().enumerate() {
        assert_eq!(line[..6], format!("{:5} ", index + 1));
    }
}

#[test]
fn an_error_is_shown_with_its_place_behind_the_calls_before_it() {
    let program = "G0 X1\nG1 X2 F10\nG2 X5 Y5\nM2\n";
    let (_, output) = interpret(&[("part.ngc", program)], &["part.ngc"]);
    assert_eq!(output.status.code(), Some(1));
    let calls = calls(&output);
    assert_eq!(calls.len(), 3);
    assert_eq!(calls[0], FIRST_MOVE);
    let errors = text(&output.stderr);
    for part in ["error: G2", " --> part.ngc:3:1", "3 | G2 X5 Y5", "  | ^^"] {
        assert!(errors.contains(part), "{part:?} is missing in\n{errors}");
    }
}

#[test]
fn an_error_in_a_subroutine_tells_who_called_it() {
    let files = [
        ("part.ngc", "o<hole> call\nM2\n"),
        ("hole.ngc", "o<hole> sub\nG0 X1\nG0 Q1\no<hole> endsub\n"),
    ];
    let (_, output) = interpret(&files, &["part.ngc"]);
    assert_eq!(output.status.code(), Some(1));
    let errors = text(&output.stderr);
    assert!(errors.contains("hole.ngc:3:4"), "{errors}");
    assert!(errors.contains("called at part.ngc:1"), "{errors}");
}

#[test]
fn subroutines_are_found_beside_the_program_and_in_further_folders() {
    let subroutine = "o<a> sub\nG0 X1\no<a> endsub\n";
    for (path, arguments) in [
        ("jobs/a.ngc", &["jobs/part.ngc"][..]),
        ("library/a.ngc", &["jobs/part.ngc", "--subroutines", "library"][..]),
    ] {
        let files = [("jobs/part.ngc", "o<a> call\nM2\n"), (path, subroutine)];
        let (_, output) = interpret(&files, arguments);
        assert_eq!(text(&output.stderr), "");
        assert_eq!(calls(&output), [FIRST_MOVE]);
    }
}

#[test]
fn check_tells_all_errors_and_prints_no_calls() {
    let program = "G1 X1\nG0 Q5 X\nG99999\nM2\n";
    let (_, output) = interpret(&[("part.ngc", program)], &["part.ngc", "--check"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(text(&output.stdout), "");
    let errors = text(&output.stderr);
    for place in ["part.ngc:1:1", "part.ngc:2:7", "part.ngc:3:1", "part.ngc: 3 errors"] {
        assert!(errors.contains(place), "{place} is missing in\n{errors}");
    }
    let (_, output) = interpret(&[("part.ngc", "G0 X1\nM2\n")], &["part.ngc", "--check"]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!((text(&output.stdout), text(&output.stderr)), ("", ""));
}

#[test]
fn a_program_without_end_is_stopped_by_the_step_limit() {
    let program = "o1 while [1]\no1 endwhile\nM2\n";
    for arguments in [
        &["part.ngc", "--check", "--steps", "1000"][..],
        &["part.ngc", "--steps", "1000"],
    ] {
        let (_, output) = interpret(&[("part.ngc", program)], arguments);
        assert_eq!(output.status.code(), Some(1));
        assert!(text(&output.stderr).contains("1000"), "{}", text(&output.stderr));
    }
}

#[test]
fn lines_with_errors_are_passed_over_where_asked_for() {
    let program = "G0 X1\nG1 X2\nG0 Y3 Y4\nG0 Z5\nM2\n";
    let (_, output) = interpret(&[("part.ngc", program)], &["-n", "part.ngc"]);
    assert_eq!(output.status.code(), Some(1));
    let last = "N..... STRAIGHT_TRAVERSE(1.0000, 0.0000, 5.0000, 0.0000, 0.0000, 0.0000)";
    assert_eq!(calls(&output), [FIRST_MOVE, last]);
    assert_eq!(text(&output.stderr).matches("error:").count(), 2);
}

#[test]
fn block_delete_leaves_lines_out() {
    let files = [("part.ngc", "G0 X1\n/ G0 X2\nM2\n")];
    assert_eq!(calls(&interpret(&files, &["part.ngc"]).1).len(), 2);
    assert_eq!(calls(&interpret(&files, &["-b", "part.ngc"]).1), [FIRST_MOVE]);
}

#[test]
fn the_program_may_come_from_standard_input() {
    let mut command = isocnc(Path::new("."), &["-"]);
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    input
        .write_all(b"o1 repeat [2]\nG0 X1\no1 endrepeat\nG0 X\nM2\n")
        .unwrap();
    drop(input);
    let output = child.wait_with_output().unwrap();
    assert_eq!(calls(&output), [FIRST_MOVE, FIRST_MOVE]);
    assert!(text(&output.stderr).contains("(standard input):4:4"));
}

#[test]
fn output_begins_at_once_and_a_closed_pipe_ends_quietly() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("part.ngc"), "o1 while [1]\nG0 X1\no1 endwhile\nM2\n").unwrap();
    let mut command = isocnc(folder.path(), &["part.ngc"]);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut first = [0; 45];
    std::io::Read::read_exact(&mut child.stdout.take().unwrap(), &mut first).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(text(&output.stderr), "");
    assert!(text(&first).starts_with("    1 N..... USE_LENGTH_UNITS(CANON_UNITS_MM)"));
}

#[test]
fn programs_may_call_tools_without_a_table() {
    let program = include_str!("../configs/sample-part.ngc");
    let (_, output) = interpret(&[("part.ngc", program)], &["part.ngc"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("SELECT_TOOL(1)"));
    let (_, output) = interpret(&[("part.ngc", "T100\nM2\n")], &["part.ngc"]);
    assert!(text(&output.stderr).contains("tool 100 is not in the tool table"));
}

#[test]
fn tables_are_in_inches_unless_said_otherwise() {
    let files = [
        ("part.ngc", "T1 M6 G43\nG55\nM2\n"),
        ("tools.tbl", "T1 P1 Z2\n"),
        ("part.var", "5241 3\n"),
    ];
    let offset = |arguments: &[&str]| {
        let (_, output) = interpret(
            &files,
            &[&["part.ngc", "-t", "tools.tbl", "-v", "part.var"], arguments].concat(),
        );
        assert_eq!(text(&output.stderr), "");
        let find = |name: &str| text(&output.stdout).lines().find(|line| line.contains(name)).unwrap()[13..].to_owned();
        [find("TOOL_LENGTH_OFFSET"), find("SET_G5X_OFFSET(2")]
    };
    let of = |z: &str, x: &str| {
        [
            format!("USE_TOOL_LENGTH_OFFSET(0.0000 0.0000 {z}, 0.0000 0.0000 0.0000, 0.0000 0.0000 0.0000)"),
            format!("SET_G5X_OFFSET(2, {x}, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)"),
        ]
    };
    assert_eq!(offset(&[]), of("50.8000", "76.2000"));
    assert_eq!(offset(&["--unit", "mm"]), of("2.0000", "3.0000"));
}

#[test]
fn mistakes_in_tables_are_shown_with_their_place() {
    let files = [
        ("part.ngc", "M2\n"),
        ("tools.tbl", "T1 P1 Z2\nT1 P2\n"),
        ("part.var", "5241\n"),
    ];
    for (arguments, place) in [
        (["part.ngc", "-t", "tools.tbl"], "tools.tbl:2:"),
        (["part.ngc", "-v", "part.var"], "part.var:1:"),
    ] {
        let (_, output) = interpret(&files, &arguments);
        assert_eq!(output.status.code(), Some(1));
        assert_eq!(text(&output.stdout), "");
        assert!(text(&output.stderr).contains(place), "{}", text(&output.stderr));
    }
    let (_, output) = interpret(&files, &["part.ngc", "-t", "none.tbl"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("none.tbl"), "{}", text(&output.stderr));
}

#[test]
fn parameters_are_written_only_where_asked_for() {
    let var = "31 7\n5221 1\n";
    let files = [("part.ngc", "#31=[#31+1]\n#32=5\nM2\n"), ("part.var", var)];
    let (folder, output) = interpret(&files, &["part.ngc", "-v", "part.var"]);
    assert_eq!(text(&output.stderr), "");
    assert_eq!(std::fs::read_to_string(folder.path().join("part.var")).unwrap(), var);
    let (folder, _) = interpret(&files, &["part.ngc", "-v", "part.var", "--write-var", "new.var"]);
    let written = std::fs::read_to_string(folder.path().join("new.var")).unwrap();
    assert!(written.starts_with("31\t8.000000\n5161\t0.000000\n"), "{written}");
    assert!(written.contains("5221\t1.000000\n"), "{written}");
    assert!(!written.contains("\n32\t"), "{written}"); // not listed in the file
}

#[test]
fn prints_go_to_standard_error_and_logs_to_files_where_asked_for() {
    let files = [(
        "part.ngc",
        "#1=2\n(PRINT,one is #1)\n(LOGOPEN,l.txt)\n(LOG,a #1)\n(LOGCLOSE)\n(LOGAPPEND,l.txt)\n(LOG,b)\nM2\n",
    )];
    let (folder, output) = interpret(&files, &["part.ngc"]);
    assert_eq!(text(&output.stderr), "one is 2.000000\n");
    assert!(!folder.path().join("l.txt").exists());
    let (folder, _) = interpret(&files, &["part.ngc", "--write-logs"]);
    assert_eq!(
        std::fs::read_to_string(folder.path().join("l.txt")).unwrap(),
        "a 2.000000\nb\n"
    );
}

#[test]
fn json_names_file_line_and_octets() {
    let files = [
        ("part.ngc", "N5 G0 X1\no<a> call\nM2\n"),
        ("a.ngc", "o<a> sub\nG4 P0.5\no<a> endsub\n"),
    ];
    let (_, output) = interpret(&files, &["part.ngc", "--format", "json"]);
    assert_eq!(text(&output.stderr), "");
    let objects: Vec<serde_json::Value> = text(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let to = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let first = objects.iter().find(|object| object["line"] == 1).unwrap();
    assert_eq!(
        *first,
        serde_json::json!({
            "call": "straight_traverse", "file": "part.ngc", "line": 1, "n": 5, "span": [0, 8], "to": to,
        })
    );
    let dwell = objects.iter().find(|object| object["call"] == "dwell").unwrap();
    assert_eq!(dwell["file"], "a.ngc");
    assert_eq!(dwell["line"], 2);
    assert_eq!(dwell["seconds"], 0.5);
}

#[test]
fn plain_g_code_has_no_loops_and_gives_the_same_calls() {
    let program = "#1=0\no1 while [#1 LT 3]\n#1=[#1+1]\nG1 X[#1*10] F100\no1 endwhile\nM2\n";
    let (_, output) = interpret(&[("part.ngc", program)], &["part.ngc", "--format", "gcode"]);
    let flat = text(&output.stdout);
    assert_eq!(flat, "%\nG21 G90 G90.1\nG1 X10 F100\nG1 X20\nG1 X30\nM5\nG97\nM2\n%\n");
    let moves = |program: &str| {
        let (_, output) = interpret(&[("part.ngc", program)], &["part.ngc"]);
        let moves = calls(&output).into_iter().filter(|call| call.contains("STRAIGHT"));
        moves.map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(moves(flat), moves(program));
    assert_eq!(moves(flat).len(), 3);
}

/// `rs274` prints a move that compensation held back when, and with the number, of the line that lets it go; JSON tells its own.
#[test]
fn a_compensated_move_is_numbered_by_the_line_that_lets_it_go() {
    let program = "N1 G41.1 D2\nN2 G0 X10\nN3 X20\nN4 Y10\nN5 G40\nN6 X0\nM2\n";
    let numbers = |output: &Output| -> Vec<String> {
        let moves = calls(output)
            .into_iter()
            .filter(|line| line.contains("STRAIGHT_TRAVERSE"));
        moves.map(|line| line[..6].trim_end().to_owned()).collect()
    };
    let (_, output) = interpret(&[("part.ngc", program)], &["part.ngc"]);
    assert_eq!(text(&output.stderr), "");
    assert_eq!(numbers(&output), ["N3", "N4", "N5", "N6"]);
    let (_, output) = interpret(&[("part.ngc", program)], &["part.ngc", "--format", "json"]);
    let own: Vec<bool> = text(&output.stdout)
        .lines()
        .filter(|line| line.contains("straight_traverse"))
        .zip(["\"n\":2", "\"n\":3", "\"n\":4", "\"n\":6"])
        .map(|(line, n)| line.replace(": ", ":").contains(n))
        .collect();
    assert_eq!(own, [true; 4]);
}

#[test]
fn a_start_in_the_middle_gives_the_state_and_goes_on_from_there() {
    let program = "G20 F10\n#1=3\nG1 X1\nG1 X#1\nG1 X4\nM2\n";
    let files = [("part.ngc", program)];
    let (_, output) = interpret(&files, &["part.ngc", "--start-line", "4"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stderr).starts_with("part.ngc: starts before line 4 with "));
    let calls = text(&output.stdout);
    let at = |call: &str| {
        calls
            .find(call)
            .unwrap_or_else(|| panic!("{call} is missing in\n{calls}"))
    };
    assert!(at("USE_LENGTH_UNITS(CANON_UNITS_INCHES)") < at("STRAIGHT_FEED(3.0000"));
    assert!(at("SET_FEED_RATE(10.0000)") < at("STRAIGHT_FEED(3.0000"));
    assert!(at("STRAIGHT_FEED(3.0000") < at("STRAIGHT_FEED(4.0000"));
    assert!(!calls.contains("STRAIGHT_FEED(1.0000"));
    let (_, output) = interpret(&files, &["part.ngc", "--start-line", "40"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(text(&output.stdout), "");
    assert!(text(&output.stderr).contains("40"), "{}", text(&output.stderr));
}

/// The machine of the demo, with more keys in `[program]`.
fn machine(keys: &str) -> String {
    let text = include_str!("../configs/mill3-demo.toml");
    match text.contains("[program]\n") {
        true => text.replace("[program]\n", &format!("[program]\n{keys}\n")),
        false => format!("{text}\n[program]\n{keys}\n"),
    }
}

#[test]
fn g92_is_forgotten_where_the_machine_does_not_keep_it() {
    let x_of = |keep: bool| {
        let machine = machine(&format!("parameter_file = \"m.var\"\nkeep_g92 = {keep}"));
        let files = [
            ("m.toml", machine.as_str()),
            ("m.var", "5161 0\n5210 1\n5211 7\n5220 1\n"),
            ("part.ngc", "(debug,#5210 #5211)\nM2\n"),
        ];
        let (_, output) = interpret(&files, &["part.ngc", "-m", "m.toml"]);
        assert_eq!(text(&output.stderr), "");
        calls(&output).join("\n")
    };
    assert!(x_of(true).contains("1.000000 7.000000"), "{}", x_of(true));
    assert!(x_of(false).contains("0.000000 0.000000"), "{}", x_of(false));
}

#[test]
fn plan_finds_subroutines_beside_the_program_too() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    write("m.toml", &machine(""));
    write("jobs/part.ngc", "o<a> call\nM2\n");
    write("jobs/a.ngc", "o<a> sub\nG0 X1\no<a> endsub\n");
    for (place, program) in [
        (folder.path().to_owned(), "jobs/part.ngc"),
        (folder.path().join("jobs"), "part.ngc"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_isocnc"))
            .current_dir(place)
            .args([
                "plan".as_ref(),
                folder.path().join("m.toml").as_os_str(),
                program.as_ref(),
            ])
            .output()
            .unwrap();
        assert_eq!(text(&output.stderr), "", "{program}");
        assert_eq!(output.status.code(), Some(0), "{program}");
    }
}

#[test]
fn plan_marks_what_is_beyond_the_travel_and_names_the_offset() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), machine("")).unwrap();
    let program = "G21 G90\nG10 L2 P2 X100\nG55\nG0 Y5 X212 (far)\nM2\n";
    std::fs::write(folder.path().join("part.ngc"), program).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .current_dir(folder.path())
        .args(["plan", "m.toml", "part.ngc"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let expected = "\
error: X 212.000 mm in G55 (offset X 100.000) is machine 312.000, travel ends at 305.000
 --> part.ngc:4:7
  |
4 | G0 Y5 X212 (far)
  |       ^^^^";
    assert!(text(&output.stderr).contains(expected), "{}", text(&output.stderr));
}

/// What people are told beside a plan, programs are told in it.
#[test]
fn plan_tells_doubts_and_warnings_in_json_as_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("m.toml", &(machine("") + "\n[tools]\ntable = \"m.tbl\"\n"));
    write("m.tbl", "T1 P1 Z2 sharp drill\n");
    write("part.ngc", "G21 G90 F600\nS1000\nG0 X5\nG1 X6\no<wait> call\nM2\n");
    write("wait.ngc", "o<wait> sub\nG4 P5000\no<wait> endsub\n");
    let plan = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        command.current_dir(folder.path()).args(["plan", "m.toml", "part.ngc"]);
        let output = command.args(more).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        output
    };
    let said = plan(&[]);
    let said: Vec<&str> = text(&said.stderr).lines().collect();
    let output = plan(&["--json"]);
    assert_eq!(text(&output.stderr), "");
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let warnings = told["warnings"].as_array().unwrap().iter();
    let mut words: Vec<String> = warnings
        .map(|text| format!("warning: {}", text.as_str().unwrap()))
        .collect();
    assert_eq!(words.len(), 2, "{words:?}");
    let doubts = told["doubts"].as_array().unwrap();
    let place = |doubt: &Value| {
        (
            doubt["file"].as_str().unwrap().to_owned(),
            doubt["line"].as_u64().unwrap(),
        )
    };
    let places: Vec<(String, u64)> = doubts.iter().map(place).collect();
    assert_eq!(places, [("part.ngc".to_owned(), 2), ("wait.ngc".to_owned(), 2)]);
    words.extend(
        doubts
            .iter()
            .zip(&places)
            .map(|(doubt, (file, line))| format!("warning: {file}:{line}: {}", doubt["doubt"].as_str().unwrap())),
    );
    assert_eq!(said, words);
    let doubt = doubts[0]["doubt"].as_str().unwrap();
    assert_eq!(
        doubt,
        "S without M3 or M4: the spindle stands while the tool cuts in line 4"
    );
}

#[test]
fn efficiency_is_measured_over_threads_and_over_the_number_of_blocks() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("long.ngc");
    let lines: String = (1..=1200)
        .map(|n| format!("X{} Y{}\n", n % 7, f64::from(n) * 0.01))
        .collect();
    std::fs::write(&program, format!("G21 G90 G54 G64 P0.01\nG1 F3000\n{lines}M2\n")).unwrap();
    let picture = folder.path().join("efficiency.svg");
    let output = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["plan", "configs/mill3-demo.toml"])
        .arg(&program)
        .args(["--threads", "2", "--efficiency"])
        .arg(&picture)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{output:?}");
    let rows: Vec<Vec<&str>> = said.lines().map(|line| line.split_whitespace().collect()).collect();
    let blocks: Vec<usize> = rows[1..].iter().map_while(|row| row[0].parse().ok()).collect();
    let threads: Vec<&str> = rows[1..=blocks.len()].iter().map(|row| row[1]).collect();
    assert_eq!(threads, ["1", "2", "1", "2", "1", "2", "1", "2"], "{said}");
    // The whole program, and its first 100, 300 and 1,000 blocks; no length beyond its end.
    assert!(blocks[2..].windows(2).all(|pair| pair[0] <= pair[1]), "{said}");
    for (found, least) in blocks.iter().zip([1200, 1200, 100, 100, 300, 300, 1000, 1000]) {
        assert!((least..least + 400).contains(found), "{said}");
    }
    let svg = std::fs::read_to_string(&picture).unwrap();
    assert!(
        [">threads<", ">blocks<", ">2 threads<"]
            .iter()
            .all(|text| svg.contains(text))
    );
}
