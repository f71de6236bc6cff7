//! See `src/frame.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::ethercat_wire::run(octets));
