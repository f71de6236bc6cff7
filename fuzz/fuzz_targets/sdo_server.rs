//! See `src/sdo_server.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::sdo_server::run(octets));
