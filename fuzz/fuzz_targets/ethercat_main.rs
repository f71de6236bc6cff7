//! See `src/ethercat_main.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::ethercat_main::run(octets));
