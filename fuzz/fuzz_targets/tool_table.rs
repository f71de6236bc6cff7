//! See `src/tool_table.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::tool_table::run(octets));
