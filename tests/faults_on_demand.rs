//! Faults of simulated drives that a client asks for while the machine runs.

use common::Control;
use isocnc::api::client;
use serde_json::{Value, json};
use std::process::Stdio;

use crate::common;

const ETHERCAT: &str = include_str!("../configs/mill3-ethercat.toml");

fn standing_by(name: &str) -> Control {
    changed(name, str::to_owned)
}

fn changed(name: &str, change: fn(&str) -> String) -> Control {
    let control = Control::start_in(tempfile::tempdir().unwrap(), name, Stdio::null(), change);
    control.wait_for("disabled", |status| status["state"] == "disabled");
    control
}

/// The machine of EtherCAT under the name of this one, which bears that this PC is busy.
fn on_ethercat(machine: &str) -> String {
    let name = |text: &str| {
        text.lines()
            .find(|line| line.starts_with("name = "))
            .unwrap()
            .to_owned()
    };
    ETHERCAT
        .replacen(&name(ETHERCAT), &name(machine), 1)
        .replace("kind = \"ethercat\"", "kind = \"ethercat-memory\"")
        .replace("\nlock_memory = true", "\noverruns_stop = 0\nlock_memory = true")
        .replace("lost_max = 20", "lost_max = 500")
        .replace("following_error_mm = 2.0", "following_error_mm = 100.0")
}

fn journal(control: &Control) -> String {
    control.words(&["journal"]).1
}

fn has_alarm(status: &Value) -> bool {
    !status["alarm"].is_null()
}

/// Behind a fault: acknowledged, and on again.
fn goes_on(control: &Control) {
    control.ask(&["alarm", "acknowledge"]).expect("acknowledged");
    control.wait_for("disabled again", |status| {
        status["state"] == "disabled" && !has_alarm(status)
    });
    control.ask(&["on"]).expect("on");
}

#[test]
fn what_goes_wrong_stops_the_machine_and_what_is_mended_lets_it_on() {
    let control = standing_by("faults-happen");
    control.ask(&["on"]).expect("on");
    // An overcurrent is over at once.
    control.ask(&["fault", "overcurrent", "--node", "1"]).expect("a fault");
    control.wait_for("faulted", has_alarm);
    let told = journal(&control);
    assert!(
        told.contains("simulated fault asked of x-drive (node 1), axis 0: overcurrent"),
        "{told}"
    );
    assert!(told.contains("2310"), "{told}");
    goes_on(&control);

    // Twice is once, and it stays until it is mended.
    for _ in 0..2 {
        control.ask(&["fault", "sto", "--node", "2"]).expect("a fault");
    }
    control.wait_for("off", |status| status["state"] != "ready");
    assert!(control.ask(&["on"]).is_err(), "the safety circuit is open");
    control.ask(&["fault", "none", "--node", "2"]).expect("mended");
    if has_alarm(&control.ask(&["status"]).expect("a status")) {
        control.ask(&["alarm", "acknowledge"]).expect("acknowledged");
    }
    control.ask(&["on"]).expect("on");

    // What is gone is booted again once it is back.
    let (code, said) = control.words(&["fault", "power-off", "--node", "3", "--for", "1"]);
    assert_eq!(
        (code, said.as_str()),
        (Some(0), "power-off for 1 s; see: isocnc status\n")
    );
    control.wait_for("faulted", has_alarm);
    let operational = |control: &Control| {
        // Its exit code tells of nodes that are missing.
        let (_, said) = control.words(&["bus", "nodes", "--json"]);
        let network: Value = serde_json::from_str(&said).expect("a network");
        network["nodes"][2]["live"]["operational"] == true
    };
    control.wait_for("back", |_| operational(&control));
    goes_on(&control);
}

#[test]
fn on_ethercat_a_drive_without_power_is_named_with_its_cable_and_comes_back_by_itself() {
    let control = changed("faults-ethercat", on_ethercat);
    control.ask(&["on"]).expect("on");
    control.ask(&["fault", "overcurrent", "--node", "1"]).expect("a fault");
    let alarm = control.wait_for("faulted", has_alarm)["alarm"].to_string();
    assert!(alarm.contains("2310"), "{alarm}");
    goes_on(&control);

    control
        .ask(&["fault", "power-off", "--node", "3", "--for", "2"])
        .expect("a fault");
    let alarm = control.wait_for("faulted", has_alarm)["alarm"].to_string();
    assert!(
        alarm.contains("z-drive (node 3): lost, it does not answer any more"),
        "{alarm}"
    );
    let all_operational = |control: &Control| {
        let (_, said) = control.words(&["bus", "nodes", "--json"]);
        let network: Value = serde_json::from_str(&said).expect("a network");
        let nodes = network["nodes"].as_array().expect("nodes");
        nodes.iter().all(|node| node["live"]["operational"] == true)
    };
    control.wait_for("back", |_| all_operational(&control));
    let told = journal(&control);
    for text in [
        "z-drive (node 3) is lost: working counter 0, expected 3: it does not answer",
        "no link between y-drive (node 2), port 1, and z-drive (node 3): the cable, or power of the latter",
    ] {
        assert!(told.contains(text), "not told: {text}\n{told}");
    }
    // Nothing is switched on by that.
    assert_ne!(control.ask(&["status"]).expect("a status")["state"], "ready");
    goes_on(&control);
}

#[test]
fn what_is_no_simulated_drive_and_what_makes_no_sense_is_refused_in_words() {
    let control = standing_by("faults-refused");
    for (arguments, why) in [
        (
            &["sto", "--node", "77"][..],
            "no node has the id 77; nodes are 1, 2, 3, 10",
        ),
        (&["sto", "--node", "10"], "node 10 (io) is no drive"),
        (
            &["sto", "--node", "1", "--axis", "3"],
            "x-drive (node 1) has no axis 3, if it is a simulated drive: it has no 0x5F00:4",
        ),
        (&["sto", "--node", "1", "--axis", "8"], "axis"),
        (
            &["sto", "--node", "1", "--for", "0"],
            "expected a number from 0.1 to 6553.5, got 0",
        ),
        (&["none", "--node", "1", "--for", "3"], "\"none\" has no time"),
        (&["short-circuit", "--node", "1"], "short-circuit"),
    ] {
        control.refused(&[&["fault"], arguments].concat(), why);
    }
    // Not into the work of another client.
    let mut other = client::connect(Some(&control.machine)).expect("a client");
    other
        .call("control.take", json!({ "name": "the panel" }))
        .expect("control");
    control.refused(&["fault", "sto", "--node", "1"], "the panel");
    other.call("control.release", json!({})).expect("released");
    // Nobody else writes what such a drive takes for a fault.
    let (_, said) = control.words(&["bus", "sdo", "set", "--node", "1", "0x5F00:1", "7", "--type", "u64"]);
    assert!(said.contains("refused: value out of range"), "{said}");
    assert!(!has_alarm(&control.ask(&["status"]).expect("a status")));
}
