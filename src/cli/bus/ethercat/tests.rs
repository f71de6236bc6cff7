//! Devices that are asked, with simulated ones at the other end of a link.

use super::scan::{Module, ask, new_file};
use super::*;
use crate::config;
use ethercat::sub::models::{DriveModel, analog_terminal, coupler, digital_terminal};
use ethercat::sub::{IdealMotor, Segment, SubDevice};
use powerlink::link::{LinkError, Received};
use std::collections::VecDeque;
use std::path::Path;

/// A wire on virtual time: each frame comes back at once.
struct Wire {
    segment: Segment,
    now_ns: u64,
    answers: VecDeque<Vec<u8>>,
}

impl Wire {
    fn new() -> Wire {
        let identity = |product| Identity {
            vendor: 2,
            product,
            revision: 1,
            serial: 9,
        };
        let drive = DriveModel {
            alias: 77,
            ..DriveModel::default()
        };
        let devices = [
            coupler(identity(1)),
            digital_terminal(identity(2)),
            analog_terminal(identity(3)).expect("a terminal"),
            drive.build(vec![Box::new(IdealMotor::default())]).expect("a drive"),
        ];
        let mut segment = Segment::new();
        for device in devices {
            segment.push(SubDevice::new(device, 0), 300);
        }
        Wire {
            segment,
            now_ns: 1_000_000,
            answers: VecDeque::new(),
        }
    }
}

impl Link for Wire {
    fn now_ns(&mut self) -> u64 {
        self.now_ns
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let mut octets = frame.to_vec();
        if self.segment.receive(self.now_ns, &mut octets).is_some() {
            self.answers.push_back(octets);
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        let Some(octets) = self.answers.pop_front() else {
            self.now_ns = self.now_ns.max(deadline_ns);
            self.segment.poll(self.now_ns);
            return Ok(None);
        };
        self.now_ns += 20_000;
        buffer[..octets.len()].copy_from_slice(&octets);
        Ok(Some(Received {
            length: octets.len(),
            stamp_ns: None,
        }))
    }
}

const MAC: [u8; 6] = [0x12, 0, 0, 0, 0, 1];

fn modules() -> Vec<Module> {
    let mut wire = Wire::new();
    let found = lead(&mut wire, MAC, &[], |lead| lead.find()).expect("they answer");
    let devices = asked(found.len());
    lead(&mut wire, MAC, &devices, |lead| {
        assert_eq!(lead.led(devices.len())?, []);
        let modules = found.iter().enumerate();
        modules.map(|(device, found)| ask(lead, device, *found)).collect()
    })
    .expect("they are led")
}

#[test]
fn devices_are_found_in_the_order_of_the_wire() {
    let mut wire = Wire::new();
    let found = lead(&mut wire, MAC, &[], |lead| lead.find()).expect("they answer");
    let shown: Vec<_> = found
        .iter()
        .map(|found| (found.position, found.identity.product, found.alias))
        .collect();
    let drive = DriveModel::default().identity.product;
    assert_eq!(shown, [(1, 1, 0), (2, 2, 0), (3, 3, 0), (4, drive, 77)]);
    // Nobody: no device, and no wait without end.
    wire.segment.cut(0);
    assert_eq!(
        lead(&mut wire, MAC, &[], |lead| lead.find()).expect("the link is there"),
        []
    );
}

#[test]
fn a_machine_file_is_written_that_is_taken() {
    let text = new_file(&modules(), "found", "eth1");
    let config = config::parse(&text, Path::new("found.toml")).unwrap_or_else(|errors| panic!("{errors}\n{text}"));
    let nodes: Vec<_> = config
        .bus
        .nodes
        .iter()
        .map(|node| (node.id, node.name.as_str(), node.inputs.len(), node.channels.len()))
        .collect();
    assert_eq!(nodes[..2], [(2, "io-2", 1, 16), (3, "io-3", 4, 8)]);
    assert_eq!((nodes[2].0, nodes[2].1), (4, "drive-4"));
    assert_eq!(nodes.len(), 3, "a coupler exchanges nothing");
}

#[test]
fn objects_are_read_and_written_and_refusals_are_told() {
    let mut wire = sdo::Wire::open(Box::new(Wire::new()), MAC, None, 4).expect("it is there");
    let vendor = DriveModel::default().identity.vendor;
    let ok = wire.ask((0x1018, 1), None).expect("the link");
    assert_eq!(ok, Ok(vendor.to_le_bytes().to_vec()));
    let refused = wire.ask((0x5FFF, 0), None).expect("the link");
    assert!(matches!(refused, Err(SetupError::Sdo { .. })), "{refused:?}");
    let none = sdo::Wire::open(Box::new(Wire::new()), MAC, None, 5)
        .err()
        .expect("there is none");
    assert!(
        none.to_string()
            .starts_with("nothing is at position 5: 4 devices answer"),
        "{none}"
    );
    let mut coupler = sdo::Wire::open(Box::new(Wire::new()), MAC, None, 1).expect("it is there");
    let none = coupler.ask((0x1000, 0), None).expect_err("no mailbox");
    assert!(none.to_string().contains("has no mailbox"), "{none}");
}

#[test]
fn another_main_device_is_heard_before_anything_is_sent() {
    let mut wire = Wire::new();
    assert_eq!(listen(&mut wire, 1_000_000).expect("the link"), None);
    let mut frame = vec![0xFF; 6];
    frame.extend([0x22, 1, 2, 3, 4, 5, 0x88, 0xA4, 0x0E, 0x10]);
    frame.resize(60, 0);
    wire.answers.push_back(frame);
    let other = refuse_other(&mut wire, 1_000_000).expect_err("it is heard");
    assert_eq!(
        other.to_string(),
        "another main device is at work (20:01:02:03:04:05): nothing was sent"
    );
}
