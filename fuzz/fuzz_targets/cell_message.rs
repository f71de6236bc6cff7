//! See `src/cell_message.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::cell_message::run(octets));
