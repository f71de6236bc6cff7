//! See `src/grbl_session.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::grbl_session::run(octets));
