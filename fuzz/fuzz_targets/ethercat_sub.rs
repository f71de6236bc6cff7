//! See `src/ethercat_sub.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::ethercat_sub::run(octets));
