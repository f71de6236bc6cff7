//! See `src/panel_connection.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| isocnc_fuzz::panel_connection::run(octets));
