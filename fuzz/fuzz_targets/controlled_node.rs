//! See `src/controlled_node.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::controlled_node::run(octets));
