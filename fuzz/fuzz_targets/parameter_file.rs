//! See `src/parameter_file.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::parameter_file::run(octets));
