//! See `src/uploads.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::uploads::run(octets));
