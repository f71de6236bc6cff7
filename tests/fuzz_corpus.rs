//! Every input that fuzzing keeps (`fuzz/corpus`), replayed with an ordinary compiler.

#![allow(unreachable_pub, reason = "the modules are those of another package")]

#[path = "../fuzz/src/controlled_node.rs"]
mod controlled_node;
#[path = "../fuzz/src/device_files.rs"]
mod device_files;
#[path = "../fuzz/src/frame.rs"]
mod frame;
#[path = "../fuzz/src/managing_node.rs"]
mod managing_node;
#[path = "../fuzz/src/parameter_file.rs"]
mod parameter_file;
#[path = "../fuzz/src/pitch_table.rs"]
mod pitch_table;
#[path = "../fuzz/src/program_grammar.rs"]
mod program_grammar;
#[path = "../fuzz/src/program_text.rs"]
mod program_text;
#[path = "../fuzz/src/sdo_server.rs"]
mod sdo_server;
#[path = "../fuzz/src/tool_table.rs"]
mod tool_table;

use powerlink::nmt::NmtState;
use std::fs;
use std::path::Path;

/// Runs every file of a target's corpus; a failure names the file.
fn replay(target: &str, run: impl Fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let mut files: Vec<_> = fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    assert!(!files.is_empty(), "{}: no inputs", folder.display());
    for file in files {
        println!("{}", file.display());
        run(&fs::read(file).unwrap());
    }
}

#[test]
fn frame() {
    replay("frame", frame::run);
}

#[test]
fn managing_node() {
    replay("managing_node", |octets| {
        managing_node::run(octets);
    });
}

#[test]
fn controlled_node() {
    replay("controlled_node", controlled_node::run);
}

#[test]
fn sdo_server() {
    replay("sdo_server", sdo_server::run);
}

#[test]
fn program_text() {
    replay("program_text", program_text::run);
}

/// Most programs of the grammar get far before they fail, else the fuzzer would see little.
#[test]
fn programs_of_the_grammar_run() {
    let octets: Vec<u8> = (0..400_u32)
        .map(|index| (index * index / 7 + index * 31) as u8)
        .collect();
    let program = program_grammar::program(&octets);
    assert!(program.lines().count() > 30, "{program}");
    program_text::look_at(program.as_bytes());
}

#[test]
fn device_files() {
    replay("device_files", device_files::run);
}

#[test]
fn tool_table() {
    replay("tool_table", tool_table::run);
}

#[test]
fn parameter_file() {
    replay("parameter_file", parameter_file::run);
}

#[test]
fn pitch_table() {
    replay("pitch_table", pitch_table::run);
}

/// The fuzzer of the managing node begins from a network that runs, not from one that never boots.
#[test]
fn without_faults_the_fuzzed_network_is_operational() {
    assert_eq!(managing_node::run(&[0; 4000]), NmtState::Operational);
}
