//! See `src/structured_text.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::structured_text::run(octets));
