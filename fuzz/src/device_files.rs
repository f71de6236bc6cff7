//! Any octets as a device description: read or refused with places, and what is read can be used.

use obd::device;
use obd::mapping::Direction;

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    esi(octets);
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

/// The same octets as a description of devices for EtherCAT.
fn esi(octets: &[u8]) {
    match device::parse_esi("file", octets) {
        Ok(file) => {
            assert!(!file.devices.is_empty());
            for of in &file.devices {
                let found = file.find(of.product, Some(of.revision)).expect("it is in the file");
                assert_eq!((found.product, found.revision), (of.product, of.revision));
                let _ = (of.octets(true), of.octets(false));
                for entry in of.rx_pdos.iter().chain(&of.tx_pdos).flat_map(|pdo| &pdo.entries) {
                    assert!(entry.mapping() & 0xFF > 0);
                }
            }
        }
        Err(errors) => {
            assert!(!errors.mistakes.is_empty());
            assert!(!errors.to_string().contains("was lost"));
        }
    }
}
