//! What a device is asked and told by SDO: start values, process data, what it says of itself, orders of the application.

use super::{Device, Notice, Now, Step};
use crate::main::config::DeviceConfig;
use crate::main::event::SetupError;
use crate::main::mail::{Mailbox, Outcome};
use crate::main::mapping::{Mapping, Task};
use crate::main::orders::Orders;
use crate::wire::coe::Object;
use crate::wire::sii::{Mailboxes, Usage};
use crate::wire::{FrameWriter, WireError};
use obd::AbortCode;
use obd::Expected;

/// Its shortest cycle, ns, as it says itself.
const QUICKEST: Object = Object {
    index: 0x1C32,
    sub: 5,
    complete: false,
};

/// Who has asked for the SDO that is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Nobody.
    None,
    /// A value of the start.
    Start,
    /// Its shortest cycle.
    Quickest,
    /// Process data.
    Mapping,
    /// A value that it must have.
    Check,
    /// An order of the application, by its number.
    Order(usize),
}

/// What is under way between a device and us by SDO.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sdos {
    pub(super) mailbox: Mailbox,
    pub(super) purpose: Purpose,
    /// Number of the start value or of the check.
    pub(super) item: u32,
    pub(super) mapping: Mapping,
    /// A value that is written or read, little endian.
    value: [u8; 4],
    /// When the mailbox is looked at next.
    pub(super) mail_ns: u64,
}

impl Sdos {
    pub(super) fn new() -> Sdos {
        Sdos {
            mailbox: Mailbox::new(Mailboxes::default(), 0),
            purpose: Purpose::None,
            item: 0,
            mapping: Mapping::new(Usage::Outputs),
            value: [0; 4],
            mail_ns: 0,
        }
    }

    /// The value that was read: its first octets.
    fn read(&self, octets: usize) -> u32 {
        let mut value = [0; 4];
        let octets = octets.min(4);
        value[..octets].copy_from_slice(&self.value[..octets]);
        u32::from_le_bytes(value)
    }
}

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
        if self.sdos.mailbox.is_free() {
            self.next_sdo(now, orders, number, config);
        }
        let source = match self.sdos.purpose {
            Purpose::Start => config
                .start
                .get(self.sdos.item as usize)
                .map_or(&[][..], |start| start.value),
            Purpose::Order(order) => orders.value(order),
            _ => &self.sdos.value,
        };
        self.sdos.mailbox.ask(now.ns, self.station(), source, writer, index)
    }

    /// Begins what comes next, if there is something.
    fn next_sdo(&mut self, now: &Now<'_>, orders: &mut Orders, number: usize, config: &DeviceConfig<'_>) {
        let until_ns = now.ns + now.config.times.mail_ns;
        match self.step {
            Step::Quickest => {
                self.sdos.purpose = Purpose::Quickest;
                self.sdos.mailbox.begin(QUICKEST, None, until_ns);
            }
            Step::StartValues => {
                if let Some(start) = config.start.get(self.sdos.item as usize) {
                    let object = Object {
                        index: start.index,
                        sub: start.sub,
                        complete: start.complete,
                    };
                    self.sdos.purpose = Purpose::Start;
                    self.sdos.mailbox.begin(object, Some(start.value.len()), until_ns);
                }
            }
            Step::MapOutputs | Step::MapInputs => {
                let data = if self.step == Step::MapOutputs {
                    &config.outputs
                } else {
                    &config.inputs
                };
                let Task { object, write } = self.sdos.mapping.task(data);
                self.sdos.purpose = Purpose::Mapping;
                if let Some((value, _)) = write {
                    self.sdos.value = value.to_le_bytes();
                }
                self.sdos
                    .mailbox
                    .begin(object, write.map(|(_, octets)| octets), until_ns);
            }
            Step::Checks => {
                if let Some(object) = check_of(config, self.sdos.item).map(object_of) {
                    self.sdos.purpose = Purpose::Check;
                    self.sdos.mailbox.begin(object, None, until_ns);
                }
            }
            _ => match orders.take(number) {
                Some((order, object, write)) => {
                    self.sdos.purpose = Purpose::Order(order);
                    self.sdos.mailbox.begin(object, write, until_ns);
                }
                None if now.ns >= self.sdos.mail_ns => {
                    self.sdos.mail_ns = now.ns + now.config.times.mailbox_ns;
                    self.sdos.mailbox.look();
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
        let sink = match self.sdos.purpose {
            Purpose::Order(order) => orders.value_mut(order),
            _ => &mut self.sdos.value[..],
        };
        match self.sdos.mailbox.answer(now.ns, working_counter, data, sink) {
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
        match core::mem::replace(&mut self.sdos.purpose, Purpose::None) {
            Purpose::None => None,
            Purpose::Order(order) => {
                orders.finish(order, result);
                None
            }
            Purpose::Quickest => {
                let least_ns = u32::from_le_bytes(self.sdos.value);
                let is_slow = result == Ok(4) && least_ns > now.config.cycle_ns;
                self.advance(now);
                is_slow.then_some(Notice::Slow(least_ns))
            }
            Purpose::Start => {
                let (_, config) = self.config?;
                let start = config.start.get(self.sdos.item as usize);
                let lacks = match result {
                    Ok(_) => None,
                    Err(SetupError::Sdo { object, code })
                        if start.is_some_and(|start| start.optional) && is_missing(code) =>
                    {
                        // Once, not at each try.
                        (self.tries == 0).then_some(Notice::Lacks(object))
                    }
                    Err(error) => return Some(self.fail(now, error)),
                };
                self.sdos.item += 1;
                if self.sdos.item as usize >= config.start.len() {
                    self.advance(now);
                }
                lacks
            }
            Purpose::Check => {
                let (_, config) = self.config?;
                let check = check_of(config, self.sdos.item)?;
                match result.and_then(|octets| compare(check, self.sdos.read(octets))) {
                    Ok(()) if check_of(config, self.sdos.item + 1).is_some() => self.sdos.item += 1,
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
                let done = result.and_then(|octets| self.sdos.mapping.done(data, self.sdos.read(octets)));
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
}

/// Whether a device refuses an object that it does not have.
fn is_missing(code: AbortCode) -> bool {
    matches!(code, AbortCode::NO_OBJECT | AbortCode::NO_SUB_INDEX)
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
