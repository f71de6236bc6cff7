//! See `src/managing_node.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|octets: &[u8]| {
    isocnc_fuzz::managing_node::run(octets);
});
