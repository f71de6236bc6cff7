//! Both sides of the profile: the controller enables a simulated drive and moves it by 10,000 counts: `cargo run -p
//! isocnc-cia402 --example move_axis`.

use std::error::Error;

use cia402::device::{DRIVE_OBJECTS, Delays, Device, Sensors};
use cia402::{Axis, AxisConfig, Feedback, Request, Status};
use obd::{Dictionary, lines_of, octets_of};

const PERIOD_NS: u32 = 1_000_000;
const DISTANCE: i64 = 10_000;
/// Counts in each period.
const STEP: i64 = 10;

fn main() -> Result<(), Box<dyn Error>> {
    let mut objects = Dictionary::<{ lines_of(DRIVE_OBJECTS) }, { octets_of(DRIVE_OBJECTS) }>::new(&[DRIVE_OBJECTS])?;
    let mut device = Device::new(&objects, PERIOD_NS, Delays::default())?;
    let mut sensors = Sensors::default();
    let mut axis = Axis::new(AxisConfig::default());
    let mut commanded = 0;
    let mut before = None;

    for cycle in 1..=3000 {
        let feedback = Feedback {
            statusword: objects.get(objects.key(0x6041, 0)?),
            position: objects.get(objects.key(0x6064, 0)?),
            following_error: objects.get(objects.key(0x60F4, 0)?),
            mode_display: objects.get(objects.key(0x6061, 0)?),
            digital_inputs: objects.get(objects.key(0x60FD, 0)?),
            error_code: objects.get(objects.key(0x603F, 0)?),
        };
        let setpoint = axis.cycle(cycle * u64::from(PERIOD_NS), true, &feedback, commanded);
        objects.set(objects.key(0x6040, 0)?, setpoint.controlword);
        objects.set(objects.key(0x6060, 0)?, setpoint.mode);
        objects.set(objects.key(0x607A, 0)?, setpoint.target_position);
        // The motor follows its demand at once.
        let demand = device.cycle(&mut objects, &sensors, true);
        if demand.powered {
            sensors.position = demand.position.round() as i64;
        }
        if before != Some(axis.status()) {
            println!(
                "{cycle:4} ms  {:?}, statusword 0x{:04X}",
                axis.status(),
                feedback.statusword
            );
            before = Some(axis.status());
        }
        match axis.status() {
            Status::Disabled => axis.request(Request::Enable),
            Status::Enabled => commanded = (commanded + STEP).min(DISTANCE),
            _ => {}
        }
    }
    println!("at {} of {DISTANCE} counts", sensors.position);
    assert_eq!(sensors.position, DISTANCE);
    Ok(())
}
