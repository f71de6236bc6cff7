//! See `src/scope_memory.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::scope_memory::run(octets));
