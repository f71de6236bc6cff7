//! Every input that fuzzing keeps (`fuzz/corpus`), replayed with an ordinary compiler.

#![allow(unreachable_pub, reason = "the modules are those of another package")]

#[path = "../fuzz/src/cell_message.rs"]
mod cell_message;
#[path = "../fuzz/src/controlled_node.rs"]
mod controlled_node;
#[path = "../fuzz/src/device_files.rs"]
mod device_files;
#[path = "../fuzz/src/ethercat_main.rs"]
mod ethercat_main;
#[path = "../fuzz/src/ethercat_sub.rs"]
mod ethercat_sub;
#[path = "../fuzz/src/ethercat_wire.rs"]
mod ethercat_wire;
#[path = "../fuzz/src/frame.rs"]
mod frame;
#[path = "../fuzz/src/grbl_session.rs"]
mod grbl_session;
#[path = "../fuzz/src/managing_node.rs"]
mod managing_node;
#[cfg(feature = "panel")]
#[path = "../fuzz/src/panel_connection.rs"]
mod panel_connection;
#[path = "../fuzz/src/parameter_file.rs"]
mod parameter_file;
#[path = "../fuzz/src/pitch_table.rs"]
mod pitch_table;
#[path = "../fuzz/src/program_grammar.rs"]
pub(crate) mod program_grammar;
#[path = "../fuzz/src/program_text.rs"]
mod program_text;
#[path = "../fuzz/src/request.rs"]
mod request;
#[path = "../fuzz/src/scope_memory.rs"]
mod scope_memory;
#[path = "../fuzz/src/sdo_server.rs"]
mod sdo_server;
#[path = "../fuzz/src/state_file.rs"]
mod state_file;
#[path = "../fuzz/src/structured_text.rs"]
mod structured_text;
#[path = "../fuzz/src/tool_table.rs"]
mod tool_table;
#[path = "../fuzz/src/trigger.rs"]
mod trigger;
#[path = "../fuzz/src/uploads.rs"]
mod uploads;

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
fn ethercat_wire() {
    replay("ethercat_wire", ethercat_wire::run);
}

#[test]
fn grbl_session() {
    replay("grbl_session", grbl_session::run);
}

#[test]
fn ethercat_main() {
    replay("ethercat_main", ethercat_main::run);
}

#[test]
fn ethercat_sub() {
    replay("ethercat_sub", ethercat_sub::run);
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

/// Beside what is kept, every example with each of its lines left out, cut short at each octet, and with octets changed.
#[test]
fn structured_text() {
    replay("structured_text", structured_text::run);
    let mut bits = 1_u64;
    let mut number = |below: usize| {
        bits = bits
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (bits >> 33) as usize % below
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/logic");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = files
        .filter(|path| path.extension().is_some_and(|kind| kind == "st"))
        .collect();
    files.sort();
    assert!(files.len() > 5);
    for file in files {
        let text = fs::read(&file).unwrap();
        let lines: Vec<&[u8]> = text.split_inclusive(|octet| *octet == b'\n').collect();
        for left_out in 0..lines.len() {
            let rest = [lines[..left_out].concat(), lines[left_out + 1..].concat()].concat();
            structured_text::run(&rest);
        }
        for end in (0..text.len()).step_by(7) {
            structured_text::run(&text[..end]);
        }
        for _ in 0..300 {
            let mut changed = text.clone();
            for _ in 0..=number(3) {
                // An octet of another place: more often a program than any octet would be.
                let (to, from) = (number(changed.len()), number(changed.len()));
                changed[to] = changed[from];
            }
            structured_text::run(&changed);
        }
    }
}

#[test]
fn state_file() {
    replay("state_file", state_file::run);
}

#[test]
fn uploads() {
    replay("uploads", uploads::run);
    // Orders as they come, the same each time.
    let mut bits = 1_u64;
    for _ in 0..200 {
        let octets: Vec<u8> = (0..400)
            .map(|_| {
                bits = bits
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (bits >> 33) as u8 % 24
            })
            .collect();
        uploads::run(&octets);
    }
}

#[test]
fn request() {
    replay("request", request::run);
}

/// Beside what is kept, each of it with octets changed and cut short.
#[cfg(feature = "panel")]
#[test]
fn panel_connection() {
    replay("panel_connection", |octets| {
        panel_connection::run(octets);
        let mut bits = octets.len() as u64;
        for _ in 0..20 {
            let mut changed = octets.to_vec();
            bits = bits
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let at = (bits >> 33) as usize % changed.len();
            changed[at] = changed[(bits >> 20) as usize % octets.len()] ^ (bits >> 61) as u8;
            changed.truncate(1 + (bits >> 40) as usize % (2 * octets.len()));
            panel_connection::run(&changed);
        }
    });
}

#[test]
fn cell_message() {
    replay("cell_message", cell_message::run);
}

#[test]
fn trigger() {
    replay("trigger", trigger::run);
}

#[test]
fn scope_memory() {
    replay("scope_memory", scope_memory::run);
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
