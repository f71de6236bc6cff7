//! What a device is asked and told by SDO: start values, process data, what it says of itself, orders of the application.

use super::{Device, Notice, Now, Purpose, QUICKEST, Step};
use crate::main::config::DeviceConfig;
use crate::main::event::SetupError;
use crate::main::mail::Outcome;
use crate::main::mapping::Task;
use crate::main::orders::Orders;
use crate::wire::coe::Object;
use crate::wire::{FrameWriter, WireError};
use obd::Expected;

impl Device<'_> {
    pub(super) fn ask_mailbox(
        &mut self,
        now: &Now<'_>,
        orders: &mut Orders,
        writer: &mut FrameWriter<'_>,
        index: u8,
    ) -> Result<bool, WireError> {
        let Some((number, config)) = self.config else {
            return Ok(false);
        };
        if self.step == Step::Run && !self.found.has_coe() {
            return Ok(false);
        }
        if self.mailbox.is_free() {
            self.next_sdo(now, orders, number, config);
        }
        let source = match self.purpose {
            Purpose::Start => config
                .start
                .get(self.item as usize)
                .map_or(&[][..], |start| start.value),
            Purpose::Order(order) => orders.value(order),
            _ => &self.small,
        };
        self.mailbox.ask(now.ns, self.station(), source, writer, index)
    }

    /// Begins what comes next, if there is something.
    fn next_sdo(&mut self, now: &Now<'_>, orders: &mut Orders, number: usize, config: &DeviceConfig<'_>) {
        let until_ns = now.ns + now.config.times.mail_ns;
        match self.step {
            Step::Quickest => {
                self.purpose = Purpose::Quickest;
                self.mailbox.begin(QUICKEST, None, until_ns);
            }
            Step::StartValues => {
                if let Some(start) = config.start.get(self.item as usize) {
                    let object = Object {
                        index: start.index,
                        sub: start.sub,
                        complete: start.complete,
                    };
                    self.purpose = Purpose::Start;
                    self.mailbox.begin(object, Some(start.value.len()), until_ns);
                }
            }
            Step::MapOutputs | Step::MapInputs => {
                let data = if self.step == Step::MapOutputs {
                    &config.outputs
                } else {
                    &config.inputs
                };
                let Task { object, write } = self.mapping.task(data);
                self.purpose = Purpose::Mapping;
                if let Some((value, _)) = write {
                    self.small = value.to_le_bytes();
                }
                self.mailbox.begin(object, write.map(|(_, octets)| octets), until_ns);
            }
            Step::Checks => {
                if let Some(object) = check_of(config, self.item).map(object_of) {
                    self.purpose = Purpose::Check;
                    self.mailbox.begin(object, None, until_ns);
                }
            }
            _ => match orders.take(number) {
                Some((order, object, write)) => {
                    self.purpose = Purpose::Order(order);
                    self.mailbox.begin(object, write, until_ns);
                }
                None if now.ns >= self.mail_ns => {
                    self.mail_ns = now.ns + now.config.times.mailbox_ns;
                    self.mailbox.look();
                }
                None => {}
            },
        }
    }

    pub(super) fn mailed(
        &mut self,
        now: &Now<'_>,
        working_counter: u16,
        data: &[u8],
        orders: &mut Orders,
    ) -> Option<Notice> {
        let sink = match self.purpose {
            Purpose::Order(order) => orders.value_mut(order),
            _ => &mut self.small[..],
        };
        match self.mailbox.answer(now.ns, working_counter, data, sink) {
            Outcome::Nothing => None,
            Outcome::Emergency(emergency) => Some(Notice::Emergency(emergency)),
            Outcome::Done(octets) => self.sdo_ended(now, Ok(octets), orders),
            Outcome::Failed(error) => self.sdo_ended(now, Err(error), orders),
        }
    }

    pub(super) fn sdo_ended(
        &mut self,
        now: &Now<'_>,
        result: Result<usize, SetupError>,
        orders: &mut Orders,
    ) -> Option<Notice> {
        match core::mem::replace(&mut self.purpose, Purpose::None) {
            Purpose::None => None,
            Purpose::Order(order) => {
                orders.finish(order, result);
                None
            }
            Purpose::Quickest => {
                let least_ns = u32::from_le_bytes(self.small);
                let is_slow = result == Ok(4) && least_ns > now.config.cycle_ns;
                self.advance(now);
                is_slow.then_some(Notice::Slow(least_ns))
            }
            Purpose::Start => match result {
                Ok(_) => {
                    self.item += 1;
                    let count = self.config.map_or(0, |(_, config)| config.start.len());
                    if self.item as usize >= count {
                        self.advance(now);
                    }
                    None
                }
                Err(error) => Some(self.fail(now, error)),
            },
            Purpose::Check => {
                let (_, config) = self.config?;
                let check = check_of(config, self.item)?;
                match result.and_then(|octets| compare(check, self.value(octets))) {
                    Ok(()) if check_of(config, self.item + 1).is_some() => self.item += 1,
                    Ok(()) => self.advance(now),
                    Err(error) => return Some(self.fail(now, error)),
                }
                None
            }
            Purpose::Mapping => {
                let (_, config) = self.config?;
                let data = if self.step == Step::MapOutputs {
                    &config.outputs
                } else {
                    &config.inputs
                };
                let done = result.and_then(|octets| self.mapping.done(data, self.value(octets)));
                match done {
                    Ok(true) => {
                        self.advance(now);
                        None
                    }
                    Ok(false) => None,
                    Err(error) => Some(self.fail(now, error)),
                }
            }
        }
    }

    /// The value that was read: its first octets.
    fn value(&self, octets: usize) -> u32 {
        let mut value = [0; 4];
        let octets = octets.min(4);
        value[..octets].copy_from_slice(&self.small[..octets]);
        u32::from_le_bytes(value)
    }
}

fn check_of<'c>(config: &'c DeviceConfig<'_>, number: u32) -> Option<&'c Expected> {
    config.checks.get(number as usize)
}

fn object_of(check: &Expected) -> Object {
    Object {
        index: check.index,
        sub: check.sub,
        complete: false,
    }
}

/// Whether a value is as it must be.
fn compare(check: &Expected, found: u32) -> Result<(), SetupError> {
    if found & check.mask == check.value & check.mask {
        return Ok(());
    }
    Err(SetupError::Differs {
        object: object_of(check),
        expected: check.value,
        found,
    })
}
