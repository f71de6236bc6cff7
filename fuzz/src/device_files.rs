//! Any octets as a device description: read or refused with places, and what is read can be used.

use obd::device;
use obd::mapping::Direction;

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    match device::parse("file", octets) {
        Ok(description) => {
            for object in &description.objects {
                let bits = object.bits().unwrap_or(8);
                let _ = description.may_map(object.index, object.sub, bits, Direction::Receive);
                let _ = description.may_map(object.index, object.sub, bits, Direction::Transmit);
                let _ = object.octets(1);
            }
            for node in [1, 239] {
                let stored = description.stored_parameters(node);
                assert!(
                    stored
                        .writes
                        .iter()
                        .all(|write| !device::set_by_managing_node(write.index, write.sub))
                );
            }
            let _ = (description.mapping(0x1600), description.mapping(0x1A00));
        }
        Err(errors) => {
            assert!(!errors.mistakes.is_empty());
            assert!(!errors.to_string().contains("was lost"));
        }
    }
}
