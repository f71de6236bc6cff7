//! A component with its pins in shared memory.
//!
//! In:  values of input pins.
//! Out: values of output pins.
//!
//! RT: nothing allocates but [`Instance::claim`].

use crate::component::{Component, Direction, Slot};
use hal_pins::{Hal, HalError, Input, Output};

/// A component that runs.
pub struct Instance {
    component: Box<dyn Component>,
    inputs: Box<[Reader]>,
    outputs: Box<[Writer]>,
}

enum Reader {
    Bit(Input<bool>),
    S32(Input<i32>),
    U32(Input<u32>),
    Float(Input<f64>),
}

enum Writer {
    Bit(Output<bool>),
    S32(Output<i32>),
    U32(Output<u32>),
    Float(Output<f64>),
}

impl Instance {
    /// Claims the pins of a component under the name of an instance: `and2.0` has `and2.0.in0`. Outputs show their defaults.
    ///
    /// # Errors
    /// Names that are taken or break the rules, shared memory too small.
    pub fn claim(hal: &mut Hal, name: &str, mut component: Box<dyn Component>) -> Result<Instance, HalError> {
        let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
        let mut failed = None;
        component.visit(Direction::In, &mut |pin| {
            let name = format!("{name}.{}", pin.name());
            let claimed = match pin.slot {
                Slot::Bit(value) => hal.input(&name, *value).map(Reader::Bit),
                Slot::S32(value) => hal.input(&name, *value).map(Reader::S32),
                Slot::U32(value) => hal.input(&name, *value).map(Reader::U32),
                Slot::Float(value) => hal.input(&name, *value).map(Reader::Float),
                Slot::OnNet(_) => hal.input(&name, 0.0).map(Reader::Float),
            };
            match claimed {
                Ok(reader) => inputs.push(reader),
                Err(error) => failed = failed.take().or(Some(error)),
            }
        });
        component.visit(Direction::Out, &mut |pin| {
            let name = format!("{name}.{}", pin.name());
            let claimed = match pin.slot {
                Slot::Bit(_) => hal.output(&name).map(Writer::Bit),
                Slot::S32(_) => hal.output(&name).map(Writer::S32),
                Slot::U32(_) => hal.output(&name).map(Writer::U32),
                Slot::Float(_) | Slot::OnNet(_) => hal.output(&name).map(Writer::Float),
            };
            match claimed {
                Ok(writer) => outputs.push(writer),
                Err(error) => failed = failed.take().or(Some(error)),
            }
        });
        if let Some(error) = failed {
            return Err(error);
        }
        let mut instance = Instance {
            component,
            inputs: inputs.into(),
            outputs: outputs.into(),
        };
        instance.show();
        Ok(instance)
    }

    /// Reads the inputs, updates, writes the outputs. RT: no allocation, no lock, bounded by the pins; `benches/list.rs`.
    pub fn update(&mut self, period_s: f64) {
        let mut readers = self.inputs.iter();
        self.component.visit(Direction::In, &mut |pin| {
            match (pin.slot, readers.next()) {
                (Slot::Bit(value), Some(Reader::Bit(reader))) => *value = reader.get(),
                (Slot::S32(value), Some(Reader::S32(reader))) => *value = reader.get(),
                (Slot::U32(value), Some(Reader::U32(reader))) => *value = reader.get(),
                (Slot::Float(value), Some(Reader::Float(reader))) => *value = reader.get(),
                (Slot::OnNet(value), Some(Reader::Float(reader))) => {
                    *value = reader.is_on_net().then(|| reader.get());
                }
                // Pins are visited as they were claimed.
                _ => {}
            }
        });
        self.component.update(period_s);
        self.show();
    }

    fn show(&mut self) {
        let mut writers = self.outputs.iter_mut();
        self.component.visit(Direction::Out, &mut |pin| {
            match (pin.slot, writers.next()) {
                (Slot::Bit(value), Some(Writer::Bit(writer))) => writer.set(*value),
                (Slot::S32(value), Some(Writer::S32(writer))) => writer.set(*value),
                (Slot::U32(value), Some(Writer::U32(writer))) => writer.set(*value),
                (Slot::Float(value), Some(Writer::Float(writer))) => writer.set(*value),
                // Pins are visited as they were claimed.
                _ => {}
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::find;

    #[test]
    fn a_pin_that_counts_on_a_net_alone_counts_as_soon_as_one_reaches_it() {
        let mut hal = Hal::create(&format!("on-net-{}", std::process::id()), 40).unwrap();
        let made = |kind: &str| find(kind).unwrap().make(&[]).unwrap();
        let mut constant = Instance::claim(&mut hal, "speed", made("constant")).unwrap();
        let mut pid = Instance::claim(&mut hal, "pid.0", made("pid")).unwrap();
        for (pin, value) in [("speed.value", 7.0), ("pid.0.pgain", 0.0), ("pid.0.dgain", 1.0)] {
            hal.set(pin, value).unwrap();
        }
        hal.set("pid.0.enable", true).unwrap();
        // A value of its own means nothing: the speed is worked out, of a command at rest.
        hal.set("pid.0.command-deriv", 3.0).unwrap();
        let output = hal.reader::<f64>("pid.0.output").unwrap();
        let mut call = || {
            constant.update(0.001);
            pid.update(0.001);
            output.get()
        };
        assert_eq!(call(), 0.0);
        hal.link("wanted-speed", "speed.out", &["pid.0.command-deriv"]).unwrap();
        assert_eq!(call(), 7.0);
    }
}
