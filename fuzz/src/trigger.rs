//! Any text as the trigger of an oscilloscope: read or refused with a place in it; what is read is read again from its own words.

use isocnc::scope::trigger::{Trigger, Watch};

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    let text = String::from_utf8_lossy(octets);
    match Trigger::parse(&text) {
        Ok(trigger) => {
            assert_eq!(Trigger::parse(&trigger.to_string()).as_ref(), Ok(&trigger));
            assert!(hal_pins::check_name(&trigger.pin).is_ok());
            let levels = trigger.levels();
            assert!(levels.iter().all(|level| level.is_finite()));
            let mut watch = Watch::new(trigger);
            for value in [0.0, 1.0, f64::NAN, -1e300, f64::INFINITY].into_iter().chain(levels) {
                watch.fires(value);
            }
        }
        Err(error) => assert!((1..=text.chars().count() + 1).contains(&error.column), "{error}"),
    }
}
