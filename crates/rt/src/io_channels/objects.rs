//! Whole objects in payloads of I/O nodes, shown or set by one pin each.
//!
//! In:  payloads, pins. Out: pins, payloads. Made at start-up, then RT.

use bus::NodeIndex;
use bus::layout::Field;
use config::ObjectKind;
use hal_pins::{Hal, HalError, Input, Output};

/// An object in the payload of a node.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) node: NodeIndex,
    pub(super) field: Field,
    pub(super) kind: ObjectKind,
}

impl Place {
    pub(super) fn read(&self, payload: &[u8]) -> u64 {
        self.field.read(payload)
    }

    /// The number; of a real one the whole part.
    pub(super) fn whole(&self, payload: &[u8]) -> i64 {
        match self.kind {
            ObjectKind::Signed => self.field.read_signed(payload),
            ObjectKind::Unsigned | ObjectKind::Bits => i64::try_from(self.read(payload)).unwrap_or(i64::MAX),
            ObjectKind::Real => self.number(payload) as i64,
        }
    }

    pub(super) fn number(&self, payload: &[u8]) -> f64 {
        match (self.kind, self.field.object.bits) {
            (ObjectKind::Real, 32) => f64::from(f32::from_bits(self.read(payload) as u32)),
            (ObjectKind::Real, _) => f64::from_bits(self.read(payload)),
            (ObjectKind::Signed, _) => self.field.read_signed(payload) as f64,
            (ObjectKind::Unsigned | ObjectKind::Bits, _) => self.read(payload) as f64,
        }
    }

    /// Least and greatest number that the object holds.
    pub(super) fn range(&self) -> [f64; 2] {
        let bits = i32::from(self.field.object.bits);
        match self.kind {
            ObjectKind::Signed => [-(2.0_f64.powi(bits - 1)), 2.0_f64.powi(bits - 1) - 1.0],
            ObjectKind::Unsigned | ObjectKind::Bits => [0.0, 2.0_f64.powi(bits) - 1.0],
            ObjectKind::Real => [f64::MIN, f64::MAX],
        }
    }

    /// The nearest number that the object holds; what is no number is written as 0.
    pub(super) fn write_number(&self, payload: &mut [u8], number: f64) {
        let octets = match (self.kind, self.field.object.bits) {
            (ObjectKind::Real, _) if number.is_nan() => 0,
            (ObjectKind::Real, 32) => {
                let most = f64::from(f32::MAX);
                u64::from((number.clamp(-most, most) as f32).to_bits())
            }
            (ObjectKind::Real, _) => number.to_bits(),
            // Conversions end at the greatest number, and take NaN as 0.
            (ObjectKind::Signed, _) => number.round() as i64 as u64,
            (ObjectKind::Unsigned | ObjectKind::Bits, _) => number.round() as u64,
        };
        self.field.write(payload, octets);
    }
}

/// A whole object shown by one pin: an input, or what a channel makes of an output.
pub(super) struct Shown {
    pub(super) place: Place,
    pin: ShownPin,
}

enum ShownPin {
    S32(Output<i32>),
    U32(Output<u32>),
    S64(Output<i64>),
    U64(Output<u64>),
    Real(Output<f64>),
}

impl Shown {
    pub(super) fn new(hal: &mut Hal, name: &str, place: Place) -> Result<Shown, HalError> {
        let pin = match (place.kind, place.field.object.bits) {
            (ObjectKind::Real, _) => ShownPin::Real(hal.output(name)?),
            (ObjectKind::Signed, 64) => ShownPin::S64(hal.output(name)?),
            (ObjectKind::Signed, _) => ShownPin::S32(hal.output(name)?),
            (ObjectKind::Unsigned | ObjectKind::Bits, 64) => ShownPin::U64(hal.output(name)?),
            (ObjectKind::Unsigned | ObjectKind::Bits, _) => ShownPin::U32(hal.output(name)?),
        };
        Ok(Shown { place, pin })
    }

    pub(super) fn show(&mut self, payload: &[u8]) {
        match &mut self.pin {
            ShownPin::S32(pin) => pin.set(self.place.whole(payload) as i32),
            ShownPin::U32(pin) => pin.set(self.place.read(payload) as u32),
            ShownPin::S64(pin) => pin.set(self.place.whole(payload)),
            ShownPin::U64(pin) => pin.set(self.place.read(payload)),
            ShownPin::Real(pin) => pin.set(self.place.number(payload)),
        }
    }
}

/// A whole object set by one pin.
pub(super) struct Driven {
    pub(super) place: Place,
    pin: DrivenPin,
}

enum DrivenPin {
    S32(Input<i32>),
    U32(Input<u32>),
    S64(Input<i64>),
    U64(Input<u64>),
    Real(Input<f64>),
}

impl Driven {
    pub(super) fn new(hal: &mut Hal, name: &str, place: Place) -> Result<Driven, HalError> {
        let pin = match (place.kind, place.field.object.bits) {
            (ObjectKind::Real, _) => DrivenPin::Real(hal.input(name, 0.0)?),
            (ObjectKind::Signed, 64) => DrivenPin::S64(hal.input(name, 0)?),
            (ObjectKind::Signed, _) => DrivenPin::S32(hal.input(name, 0)?),
            (ObjectKind::Unsigned | ObjectKind::Bits, 64) => DrivenPin::U64(hal.input(name, 0)?),
            (ObjectKind::Unsigned | ObjectKind::Bits, _) => DrivenPin::U32(hal.input(name, 0)?),
        };
        Ok(Driven { place, pin })
    }

    /// Numbers beyond what the object holds are written as the nearest one.
    pub(super) fn write(&self, payload: &mut [u8]) {
        let [least, most] = self.place.range();
        let clamp = |number: f64| self.place.field.object.bits < 64 && !(least..=most).contains(&number);
        let octets = match &self.pin {
            DrivenPin::S32(pin) if clamp(pin.get().into()) => f64::from(pin.get()).clamp(least, most) as i64 as u64,
            DrivenPin::U32(pin) if clamp(pin.get().into()) => f64::from(pin.get()).clamp(least, most) as u64,
            DrivenPin::S32(pin) => i64::from(pin.get()) as u64,
            DrivenPin::U32(pin) => u64::from(pin.get()),
            DrivenPin::S64(pin) => pin.get() as u64,
            DrivenPin::U64(pin) => pin.get(),
            DrivenPin::Real(pin) => return self.place.write_number(payload, pin.get()),
        };
        self.place.field.write(payload, octets);
    }
}
