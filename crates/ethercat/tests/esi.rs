//! The ESI file of the simulated devices is the one that they make, and what it says brings them to OP.
#![cfg(feature = "std")]

use ethercat::main::config::{
    ClockConfig, Config, DeviceConfig, Expected, PdoConfig, Place, ProcessDataConfig, StartValue, Times,
};
use ethercat::main::{Event, MainDevice};
use ethercat::sub::{IdealMotor, Segment, SubDevice, esi, models};
use ethercat::wire::FRAME_LEN_MAX;
use ethercat::wire::register::AlState;
use obd::device::{EsiDevice, EsiEntry, parse_esi};
use std::path::Path;

const FILE: &str = "../../obd/tests/data/simulated.esi.xml";

/// `REFERENCES=write` writes it anew.
#[test]
fn the_file_is_as_the_devices_are() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(FILE);
    let text = esi::text().expect("the devices can be described");
    if std::env::var_os("REFERENCES").is_some() {
        std::fs::write(&path, &text).expect("it is written");
    }
    let file = std::fs::read_to_string(&path).expect("the file");
    assert!(
        file == text,
        "{FILE} is of other devices; REFERENCES=write makes it anew"
    );
}

fn pdos(device: &EsiDevice, to_device: bool) -> ProcessDataConfig<'static> {
    let pdo = |pdo: &obd::device::EsiPdo| PdoConfig {
        index: pdo.index,
        entries: Vec::leak(pdo.entries.iter().map(EsiEntry::mapping).collect()),
    };
    ProcessDataConfig {
        octets: device.octets(to_device) as u16,
        pdos: Vec::leak(device.assigned(to_device).map(pdo).collect()),
    }
}

#[test]
fn devices_come_up_as_the_file_describes_them() {
    let file = parse_esi("simulated", esi::text().expect("a text").as_bytes()).expect("it is read");
    let parts: Vec<DeviceConfig<'static>> = (0..)
        .zip(&file.devices)
        .map(|(position, device)| {
            let start = device.coe.iter().flat_map(|coe| &coe.start);
            let start = start.map(|command| StartValue {
                index: command.index,
                sub: command.sub,
                complete: command.complete,
                optional: false,
                value: Vec::leak(command.data.clone()),
            });
            DeviceConfig {
                place: Place::Position(position),
                expected: Expected {
                    vendor: Some(file.vendor),
                    product: Some(device.product),
                    revision: Some(device.revision),
                    serial: None,
                },
                outputs: pdos(device, true),
                inputs: pdos(device, false),
                start: Vec::leak(start.collect()),
                clock: device.op_modes.first().map(|mode| ClockConfig {
                    activate: mode.activate,
                    shift_ns: 500_000,
                    sync1_ns: 0,
                }),
                checks: &[],
                watchdog_ms: None,
                goal: AlState::Op,
            }
        })
        .collect();
    let config = Config {
        cycle_ns: 1_000_000,
        devices: &parts,
        lost_max: 2,
        times: Times::default(),
    };
    let drive = models::DriveModel::default().build(vec![Box::new(IdealMotor::default())]);
    let mut segment = Segment::new();
    segment.push(SubDevice::new(drive.expect("a drive"), 0), 300);
    segment.push(SubDevice::new(models::digital_terminal(esi::TERMINAL), 0), 300);
    let mut main = Box::new(MainDevice::<8, 1>::new([0x10; 6], &config).expect("it fits"));
    let mut buffer = [0; FRAME_LEN_MAX];
    let mut now_ns = 1_000_000;
    let mut events = Vec::new();
    for _ in 0..1000 {
        for number in 0..main.prepare() {
            let length = main.frame(number).len();
            buffer[..length].copy_from_slice(main.frame(number));
            if segment.receive(now_ns, &mut buffer[..length]).is_some() {
                main.receive(now_ns, &buffer[..length]);
            }
        }
        for _ in 0..18 {
            now_ns += 50_000;
            segment.poll(now_ns);
            if let Some(frame) = main.service_frame(now_ns) {
                let length = frame.len();
                buffer[..length].copy_from_slice(frame);
                if segment.receive(now_ns, &mut buffer[..length]).is_some() {
                    main.receive(now_ns, &buffer[..length]);
                }
            }
        }
        now_ns += 100_000;
        segment.poll(now_ns);
        main.finish_cycle(now_ns);
        events.extend(std::iter::from_fn(|| main.pop_event()));
    }
    assert!(main.is_operational(), "{events:?}");
    assert!(events.contains(&Event::Up { device: 0 }) && events.contains(&Event::Up { device: 1 }));
}
