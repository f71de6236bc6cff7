//! See `src/request.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::request::run(octets));
