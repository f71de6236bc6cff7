//! What devices do with their process data: servo drives, terminals, couplers.

use super::objects::ObjectStore;
use crate::wire::coe::Emergency;
use crate::wire::register::AlStatusCode;
use cia402::device::{Delays, Demand, Device, Injected, Sensors};
use std::boxed::Box;
use std::vec::Vec;

/// A cycle of an application.
#[derive(Debug)]
pub struct Cycle<'a> {
    /// Objects of the device; outputs that are mapped stand there already, inputs are taken from there.
    pub objects: &'a mut ObjectStore,
    /// The output memory; empty where there are no outputs.
    pub outputs: &'a [u8],
    /// The input memory, of a device without objects.
    pub inputs: &'a mut [u8],
    /// The device is in OP: its outputs count.
    pub led: bool,
    /// It has power.
    pub powered: bool,
}

/// What a device does with its process data.
pub trait Application: core::any::Any + core::fmt::Debug + Send {
    /// The device comes to SAFE-OP, with this period of its cycles.
    ///
    /// # Errors
    /// Why it cannot work so.
    fn start(&mut self, objects: &mut ObjectStore, period_ns: u32) -> Result<(), AlStatusCode> {
        let _ = (objects, period_ns);
        Ok(())
    }

    /// One cycle; an error that the device reports.
    fn cycle(&mut self, cycle: Cycle<'_>) -> Option<Emergency>;

    /// Its power has come back; the objects are as they come out of the box.
    fn power_on(&mut self, objects: &mut ObjectStore) {
        let _ = objects;
    }

    /// The drive that it is, to be looked into.
    fn as_drive(&mut self) -> Option<&mut Drive> {
        None
    }

    /// The terminal that it is, to be looked into.
    fn as_terminal(&mut self) -> Option<&mut Terminal> {
        None
    }
}

/// A device without process data, such as a coupler.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProcessData;

impl Application for NoProcessData {
    fn cycle(&mut self, _: Cycle<'_>) -> Option<Emergency> {
        None
    }
}

/// A terminal whose memory is its channels: digital ones bit by bit, analog ones word by word.
#[derive(Clone, Debug, Default)]
pub struct Terminal {
    /// What its outputs are; zeros where they are not led.
    pub outputs: Vec<u8>,
    /// What its inputs see.
    pub inputs: Vec<u8>,
}

impl Application for Terminal {
    fn cycle(&mut self, cycle: Cycle<'_>) -> Option<Emergency> {
        self.outputs.clear();
        if cycle.led && cycle.powered {
            self.outputs.extend_from_slice(cycle.outputs);
        } else {
            self.outputs.resize(cycle.outputs.len(), 0);
        }
        let octets = cycle.inputs.len().min(self.inputs.len());
        cycle.inputs[..octets].copy_from_slice(&self.inputs[..octets]);
        None
    }

    fn as_terminal(&mut self) -> Option<&mut Terminal> {
        Some(self)
    }
}

/// What turns when a drive says so.
pub trait Motor: core::fmt::Debug + Send {
    /// One period; what the encoder and the switches show at its end.
    fn advance(&mut self, demand: &Demand, period_s: f64) -> Sensors;
}

/// A motor that is where it is told to be.
#[derive(Clone, Copy, Debug, Default)]
pub struct IdealMotor {
    position: f64,
}

impl Motor for IdealMotor {
    fn advance(&mut self, demand: &Demand, period_s: f64) -> Sensors {
        let before = self.position;
        if demand.powered {
            self.position = match demand.control {
                cia402::device::Control::Position => demand.position,
                _ => before + demand.velocity * period_s,
            };
        }
        Sensors {
            position: self.position.round() as i64,
            velocity: ((self.position - before) / period_s).round() as i64,
            ..Sensors::default()
        }
    }
}

/// One axis of a drive.
#[derive(Debug)]
struct Axis {
    /// The part of the objects that is its own.
    part: usize,
    motor: Box<dyn Motor>,
    device: Option<Device>,
    demand: Demand,
    reported: u16,
}

/// A servo drive of CiA 402 with one axis or several.
#[derive(Debug)]
pub struct Drive {
    axes: Vec<Axis>,
    period_ns: u32,
    delays: Delays,
}

impl Drive {
    /// A drive whose axes have these parts of the objects, each with its motor.
    pub fn new(axes: Vec<(usize, Box<dyn Motor>)>, delays: Delays) -> Drive {
        let axis = |(part, motor)| Axis {
            part,
            motor,
            device: None,
            demand: Demand::default(),
            reported: 0,
        };
        Drive {
            axes: axes.into_iter().map(axis).collect(),
            period_ns: 1_000_000,
            delays,
        }
    }

    /// State of the power section of an axis; `None` before its first cycle.
    pub fn state(&self, axis: usize) -> Option<cia402::profile::State> {
        self.axes[axis].device.as_ref().map(Device::state)
    }

    /// A fault inside the drive.
    pub fn raise_fault(&mut self, axis: usize, code: u16) {
        if let Some(device) = &mut self.axes[axis].device {
            device.raise_fault(code);
        }
    }

    /// What is done to the drive from outside the network.
    pub fn injected(&mut self, axis: usize) -> Option<&mut Injected> {
        self.axes[axis].device.as_mut().map(|device| &mut device.injected)
    }
}

impl Application for Drive {
    fn start(&mut self, objects: &mut ObjectStore, period_ns: u32) -> Result<(), AlStatusCode> {
        if period_ns != self.period_ns {
            self.period_ns = period_ns;
            for axis in &mut self.axes {
                axis.device = None;
            }
        }
        // A drive that does not find its objects is built wrong.
        for axis in &self.axes {
            Device::new(objects.part(axis.part), period_ns, self.delays).map_err(|_| AlStatusCode::DEVICE_SETUP)?;
        }
        Ok(())
    }

    fn cycle(&mut self, cycle: Cycle<'_>) -> Option<Emergency> {
        let period_s = f64::from(self.period_ns) * 1e-9;
        let mut emergency = None;
        for axis in &mut self.axes {
            let sensors = axis.motor.advance(&axis.demand, period_s);
            if !cycle.powered {
                axis.demand = Demand::default();
                continue;
            }
            let objects = cycle.objects.part_mut(axis.part);
            if axis.device.is_none() {
                axis.device = Device::new(objects, self.period_ns, self.delays).ok();
            }
            let Some(device) = &mut axis.device else { continue };
            axis.demand = device.cycle(objects, &sensors, cycle.led);
            let code = device.error_code();
            if code != axis.reported {
                axis.reported = code;
                emergency = Some(Emergency {
                    code,
                    register: device.error_register(),
                    data: [0; 5],
                });
            }
        }
        emergency
    }

    fn power_on(&mut self, _: &mut ObjectStore) {
        for axis in &mut self.axes {
            axis.device = None;
            axis.demand = Demand::default();
            axis.reported = 0;
        }
    }

    fn as_drive(&mut self) -> Option<&mut Drive> {
        Some(self)
    }
}
