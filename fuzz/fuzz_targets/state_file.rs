//! See `src/state_file.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::state_file::run(octets));
