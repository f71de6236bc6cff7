//! Wear and life of tools: what G43 counts with, what programs use up, and the sister that takes the place of a tool whose life is over.

use crate::common::Control;
use serde_json::Value;
use std::process::Stdio;

const PART: &str = "G21 G90 G54 F3000\nT5 M6\nG43 H5\nS1500 M3\nG1 X7\nG1 X5\nM5\nM2\n";

fn ready(control: &Control) {
    control.wait_for("the network", |status| status["power"] == "off");
    control.ask(&["home"]).unwrap();
}

/// Runs a part; the offset of the tool that is in force at its end.
fn run(control: &Control) -> f64 {
    let program = control.program("part.ngc", PART);
    control.ask(&["program", "run", program.to_str().unwrap()]).unwrap();
    let status = control.wait_for("the end", |status| status["activity"] == "idle");
    assert_eq!(status["program"]["result"], "completed");
    status["work_offset_mm"][2].as_f64().unwrap()
}

fn tool(control: &Control, number: u32) -> Value {
    let tools = control.ask(&["tool", "list"]).unwrap();
    let found = tools["tools"].as_array().unwrap().iter();
    found.clone().find(|tool| tool["tool"] == number).unwrap().clone()
}

fn said(control: &Control, what: &str) -> bool {
    control.words(&["journal"]).1.contains(what)
}

#[test]
fn a_tool_whose_life_is_over_gives_way_to_its_sister() {
    let folder = tempfile::tempdir().unwrap();
    let mut control = Control::start_in(folder, "tool-life", Stdio::null(), |text| {
        text.replacen("[machine]\n", "[machine]\nstate_directory = \"state\"\n", 1)
    });
    ready(&control);
    let set = |arguments: &[&str]| control.ask(&[&["tool", "set"], arguments].concat()).unwrap();
    set(&[
        "5",
        "--length",
        "40",
        "--length-wear",
        "-0.5",
        "--life-parts",
        "2",
        "--sister",
        "15",
    ]);
    set(&["15", "--length", "30"]);
    let first = run(&control);
    let used = tool(&control, 5);
    assert_eq!(
        (&used["life"]["used_parts"], &used["worn_out"]),
        (&Value::from(1), &Value::from(false)),
        "{used}"
    );
    assert!(used["life"]["used_minutes"].as_f64().unwrap() > 0.0, "{used}");
    assert_eq!(run(&control), first);
    assert_eq!(tool(&control, 5)["worn_out"], true);
    assert!(said(
        &control,
        "T5: its life is over (used for 2 of 2 parts); from the next program on T15 takes its place"
    ));
    let with_sister = run(&control);
    assert!((first - with_sister - 9.5).abs() < 1e-9, "{first} and {with_sister}");
    assert_eq!(control.ask(&["tool", "list"]).unwrap()["in_spindle"], 15);
    assert!(said(&control, "T15 is used where T5 is called, whose life is over"));
    assert_eq!(tool(&control, 15)["life"]["used_parts"], 1);
    // What was used is known again, and what was measured anew has not worn.
    let before = [tool(&control, 5), tool(&control, 15)];
    control.restart();
    control.wait_for("the network", |status| status["power"] == "off");
    assert_eq!([tool(&control, 5), tool(&control, 15)], before);
    ready(&control);
    let set = |arguments: &[&str]| control.ask(&[&["tool", "set"], arguments].concat());
    set(&[
        "5",
        "--length",
        "41",
        "--used-parts",
        "0",
        "--life-parts",
        "1",
        "--sister",
        "0",
    ])
    .unwrap();
    assert!((run(&control) - first - 1.5).abs() < 1e-9);
    assert_eq!(tool(&control, 5)["length_wear"], 0.0);
    assert!(said(&control, "and no sister tool can take its place"));
    // Without one it is used all the same.
    run(&control);
    assert_eq!(tool(&control, 5)["life"]["used_parts"], 2);
    for (wrong, expected) in [
        (["5", "--sister", "5"], "a tool is no sister of its own"),
        (["5", "--sister", "777"], "the tool table has no tool 777"),
        (
            ["5", "--life-minutes", "1e9"],
            "\"life_minutes\" is a number from 0 to 10000000",
        ),
    ] {
        assert!(set(&wrong).unwrap_err().contains(expected), "{wrong:?}");
    }
}
