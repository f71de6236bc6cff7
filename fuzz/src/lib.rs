//! What the fuzzers run, one module each. The same modules are part of an ordinary test (`tests/fuzz_corpus.rs`), which replays
//! the inputs kept in `corpus/`.

pub mod cell_message;
pub mod controlled_node;
pub mod device_files;
pub mod ethercat_main;
pub mod ethercat_sub;
pub mod ethercat_wire;
pub mod frame;
pub mod grbl_session;
pub mod managing_node;
pub mod panel_connection;
pub mod parameter_file;
pub mod pitch_table;
pub mod program_grammar;
pub mod program_text;
pub mod request;
pub mod scope_memory;
pub mod sdo_server;
pub mod state_file;
pub mod structured_text;
pub mod tool_table;
pub mod trigger;
pub mod uploads;
