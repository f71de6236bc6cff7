//! Any octets as a parameter file: read, or refused with places; what is written is read again.

use gcode::parameter::file;

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    match file::parse(octets) {
        Ok(parameters) => {
            assert!(parameters.is_sorted_by(|one, other| one.0 < other.0));
            assert!(file::required().all(|number| parameters.iter().any(|entry| entry.0 == number)));
            let once = file::parse(file::write(&parameters).as_bytes()).expect("what was written");
            let twice = file::parse(file::write(&once).as_bytes()).expect("what was written");
            assert_eq!(once, twice);
        }
        Err(errors) => {
            assert!(!errors.is_empty());
            assert!(errors.is_sorted_by_key(|error| error.line));
            for error in errors.iter().take(20) {
                assert!(!error.render("machine.var", octets).is_empty());
            }
        }
    }
}
