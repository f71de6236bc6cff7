//! Modules that are not where the machine file has them are named at start, on virtual time.

use isocnc::bus::powerlink::Powerlink;
use isocnc::bus::powerlink::managing_node::{mn_config, node_configs};
use isocnc::bus::powerlink::network;
use isocnc::bus::watch::Watch;
use isocnc::config;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::rehearse_on;
use isocnc::sim::near_end::VirtualPowerlink;
use isocnc::sim::{NetConfig, SimMachine, VirtualNet};
use powerlink::wire::NetTime;
use std::path::Path;
use std::sync::Arc;

const MACHINE: &str = include_str!("../configs/io-only.toml");

/// What the journal has after two seconds of a control of this machine, on whose wire that one is.
fn journal(wanted: &str, there: &str) -> String {
    let [wanted, there] = [wanted, there].map(|text| config::parse(text, Path::new("m.toml")).expect("a machine"));
    let plans = network::plan(&wanted);
    let nodes = node_configs(&wanted.bus, &plans);
    let link = VirtualNet::new(SimMachine::new(&there).expect("simulated"), NetConfig::clean(1));
    let bus: VirtualPowerlink<'_> = Powerlink::new(
        mn_config(&wanted, &nodes, [2, 0, 0, 0, 0, 0xF0]),
        link,
        Arc::new(Watch::default()),
        NetTime::default,
    )
    .expect("a network");
    rehearse_on(&wanted, b"", bus, Operator::standing_by, |run| {
        run.run_until(3000, |_| false)?;
        let texts = run.operator.journal().iter().map(|entry| entry.text.clone());
        Ok(texts.collect::<Vec<String>>().join("\n"))
    })
    .expect("a control")
}

#[test]
fn a_moved_and_a_swapped_module_are_named_with_what_was_expected_and_found() {
    let known = MACHINE.replacen("device_type = 0x000F0191 ", "device_type = 0x000F0191\nserial = 77 ", 1);
    let moved = known
        .replace("id = 10\n", "id = 12\n")
        .replace("io.10.", "io.12.")
        .replace("node = 10\n", "node = 12\n");
    let other =
        "mandatory = false               # the others go on without it\npres_timeout_us = 150\ndevice_type = 0x000";
    assert_eq!(moved.matches(other).count(), 1);
    let there = moved.replace(other, &other.replace("0x000", "0x001"));
    let journal = journal(&known, &there);
    let said = |text: &str| assert_eq!(journal.matches(text).count(), 1, "{text}\n{journal}");
    said("inputs (node 10) is missing: expected device type 0x000F0191, serial 77; nobody answers there");
    said(
        "inputs (node 10) has moved: expected device type 0x000F0191, serial 77; found at node 12: set its id back, or write 12 \
         into the file",
    );
    assert!(
        journal.contains(
            "outputs (node 11) is another device: expected device type 0x000F0191; found device type 0x001F0191"
        ),
        "{journal}"
    );
}

#[test]
fn a_node_that_nobody_knows_is_told_where_one_is_missing_and_not_else() {
    let more = MACHINE.to_owned() + "[[bus.node]]\nid = 200\nname = \"spare\"\nprofile = \"io\"\n";
    assert!(!journal(MACHINE, &more).contains("200"));
    let without = more
        .replacen("id = 10\n", "id = 199\n", 1)
        .replace("io.10.", "io.199.")
        .replace("node = 10\n", "node = 199\n");
    let journal = journal(MACHINE, &without);
    assert!(
        journal.contains("inputs (node 10) has moved: expected device type 0x000F0191; found at node 199"),
        "{journal}"
    );
    assert!(journal.contains("found at node 200"), "{journal}");
}
