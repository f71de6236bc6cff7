//! See `src/pitch_table.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::pitch_table::run(octets));
