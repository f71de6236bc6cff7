//! Simulated devices on a network interface, for any main device: `cargo run --release -p isocnc-ethercat --example simulate -- IF [DRIVES]`.
//!
//! A line of servo drives with a digital and an analog terminal behind them. Ends with the interface.

use ethercat::sub::{IdealMotor, Segment, SubDevice, SubDeviceConfig, esi, models};
use ethercat::wire::FRAME_LEN_MAX;
use ethercat::wire::sii::Identity;
use powerlink::link::Link;
use powerlink::link::raw::{RawConfig, RawLink};
use std::error::Error;

/// Cable between two devices.
const CABLE_NS: u64 = 300;
/// Nothing is due for longer than this.
const LOOK_NS: u64 = 1_000_000;
/// Frames of EtherCAT.
const ETHER_TYPE: [u8; 2] = [0x88, 0xA4];

const ANALOG: Identity = Identity {
    vendor: esi::TERMINAL.vendor,
    product: 0x0001_0404,
    revision: 1,
    serial: 0,
};

fn devices(drives: usize) -> Result<Vec<SubDeviceConfig>, Box<dyn Error>> {
    let mut devices = Vec::new();
    for _ in 0..drives {
        let drive = models::DriveModel::default().build(vec![Box::new(IdealMotor::default())]);
        devices.push(drive.map_err(|code| code.to_string())?);
    }
    devices.push(models::digital_terminal(esi::TERMINAL));
    devices.push(models::analog_terminal(ANALOG).map_err(|code| code.to_string())?);
    Ok(devices)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let interface = arguments.next().ok_or("an interface is needed")?;
    let drives = arguments.next().map_or(Ok(2), |text| text.parse())?;
    let config = RawConfig {
        every_ether_type: true,
        promiscuous: true,
        // On the core of a main device a look for the next frame would keep that from getting its answer.
        spin_ns: 0,
        ..RawConfig::default()
    };
    let mut link = RawLink::open(&interface, config)?;
    let start_ns = link.now_ns();
    let mut segment = Segment::new();
    for device in devices(drives)? {
        segment.push(SubDevice::new(device, start_ns), CABLE_NS);
    }
    println!("{} devices answer on {interface}", segment.len());
    let mut buffer = [0; FRAME_LEN_MAX];
    loop {
        let now_ns = link.now_ns();
        let due_ns = segment.next_ns(now_ns).min(now_ns + LOOK_NS);
        match link.receive(&mut buffer, due_ns)? {
            Some(received) => {
                let length = received.length.min(FRAME_LEN_MAX);
                let now_ns = link.now_ns();
                let frame = &mut buffer[..length];
                if frame.get(12..14) == Some(&ETHER_TYPE) && segment.receive(now_ns, frame).is_some() {
                    link.send(frame)?;
                }
            }
            None => segment.poll(link.now_ns()),
        }
    }
}
