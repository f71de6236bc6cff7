//! Devices of EtherCAT on an interface where no control is at work: what they are, and their objects.
//!
//! In:  a link. Out: the main device of `ethercat::main` with nothing to exchange, which leads them to PRE-OP and asks.

pub(super) mod scan;
pub(super) mod sdo;
#[cfg(test)]
mod tests;

use anyhow::{anyhow, bail, ensure};
use bus::ethercat::setup::{DEVICES_MAX, FRAMES_MAX};
use ethercat::main::config::{Config, DeviceConfig, Times};
use ethercat::main::{DeviceState, Event, MainDevice, SetupError};
use ethercat::wire::coe::Object;
use ethercat::wire::register::AlState;
use ethercat::wire::sii::Identity;
use ethercat::wire::{ETHER_TYPE, FRAME_LEN_MAX, MAC_PASSED};
use powerlink::link::Link;

/// What lies between two looks at what devices do by themselves, ns.
const PAUSE_NS: u64 = 500_000;
/// Devices that are not known by then are not there, ns.
const KNOWN_NS: u64 = 3_000_000_000;
/// Those that are not in PRE-OP by then do not come there, ns.
const LED_NS: u64 = 8_000_000_000;
/// An SDO is over by then, ns.
const SDO_NS: u64 = 5_000_000_000;
/// Where the type of an Ethernet frame stands.
const TYPE_AT: usize = 12;

type Main<'a> = MainDevice<'a, DEVICES_MAX, FRAMES_MAX>;

/// A device that answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Found {
    /// From 1, as people count.
    pub(super) position: u8,
    pub(super) identity: Identity,
    /// Alias of its EEPROM; 0: none.
    pub(super) alias: u16,
}

/// The main device, and the wire.
pub(super) struct Lead<'a, 'l> {
    main: Box<Main<'a>>,
    link: &'l mut dyn Link,
    buffer: [u8; FRAME_LEN_MAX],
    events: Vec<Event>,
}

/// Listens whether another main device sends; its address.
///
/// # Errors
/// The link.
pub(super) fn listen(link: &mut dyn Link, listen_ns: u64) -> anyhow::Result<Option<[u8; 6]>> {
    let mut buffer = [0; FRAME_LEN_MAX];
    let end_ns = link.now_ns() + listen_ns;
    while link.now_ns() < end_ns {
        let Some(received) = link.receive(&mut buffer, end_ns)? else {
            break;
        };
        let frame = &buffer[..received.length.min(FRAME_LEN_MAX)];
        let is_ours = frame.get(TYPE_AT..TYPE_AT + 2) == Some(&ETHER_TYPE.to_be_bytes());
        if let Some(source) = frame.get(6..TYPE_AT).filter(|_| is_ours) {
            let mut mac = [0; 6];
            mac.copy_from_slice(source);
            mac[0] &= !MAC_PASSED;
            return Ok(Some(mac));
        }
    }
    Ok(None)
}

/// Leads devices for the time of a call. None: they are only identified.
///
/// # Errors
/// More devices than there is room for, the link, or what the call gives.
pub(super) fn lead<T>(
    link: &mut dyn Link,
    mac: [u8; 6],
    devices: &[DeviceConfig<'_>],
    run: impl FnOnce(&mut Lead<'_, '_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let network = Config {
        cycle_ns: 1_000_000,
        devices,
        lost_max: 3,
        times: Times::default(),
    };
    let [first, rest @ ..] = mac;
    let [a, b, c, d, e] = rest;
    let main = Main::new([first & !MAC_PASSED, a, b, c, d, e], &network).map_err(|error| anyhow!("{error}"))?;
    run(&mut Lead {
        main: Box::new(main),
        link,
        buffer: [0; FRAME_LEN_MAX],
        events: Vec::new(),
    })
}

/// The device at a position, from 1, that is only asked.
pub(super) fn asked(position: u8) -> DeviceConfig<'static> {
    DeviceConfig {
        goal: AlState::PreOp,
        ..DeviceConfig::at(u16::from(position) - 1)
    }
}

impl Lead<'_, '_> {
    /// Sends what is due and hears what comes, until `done` or `span_ns` is over; whether it was done.
    fn until(&mut self, span_ns: u64, mut done: impl FnMut(&mut Main<'_>) -> bool) -> anyhow::Result<bool> {
        let end_ns = self.link.now_ns() + span_ns;
        loop {
            let now_ns = self.link.now_ns();
            let sent = match self.main.service_frame(now_ns) {
                Some(frame) => self.link.send(frame).map(|()| true)?,
                None => false,
            };
            let wait_ns = now_ns + PAUSE_NS;
            if let Some(received) = self.link.receive(&mut self.buffer, wait_ns)? {
                let now_ns = self.link.now_ns();
                let length = received.length.min(FRAME_LEN_MAX);
                self.main.receive(now_ns, &self.buffer[..length]);
            }
            while let Some(event) = self.main.pop_event() {
                if let Event::OtherMain { .. } = event {
                    bail!("{event}: stopped at once");
                }
                self.events.push(event);
            }
            if done(&mut self.main) {
                return Ok(true);
            }
            if self.link.now_ns() >= end_ns && !sent {
                return Ok(false);
            }
        }
    }

    /// All devices, in the order of the wire.
    ///
    /// # Errors
    /// The link; more devices than there is room for.
    pub(super) fn find(&mut self) -> anyhow::Result<Vec<Found>> {
        let is_known = |main: &mut Main<'_>| {
            let count = main.count();
            count > 0 && (0..count).all(|at| main.at_position(at).is_some())
        };
        self.until(KNOWN_NS, is_known)?;
        let too_many = self.events.iter().find(|event| matches!(event, Event::TooMany { .. }));
        if let Some(event) = too_many {
            bail!("{event}");
        }
        let found = (1..=self.main.count()).zip(1_u8..).filter_map(|(at, position)| {
            let (identity, alias) = self.main.at_position(at - 1)?;
            Some(Found {
                position,
                identity,
                alias,
            })
        });
        Ok(found.collect())
    }

    /// Waits until the devices are in PRE-OP: why one is not.
    ///
    /// # Errors
    /// The link.
    pub(super) fn led(&mut self, count: usize) -> anyhow::Result<Vec<(usize, SetupError)>> {
        self.until(LED_NS, |main| {
            (0..count).all(|device| {
                let state = main.device_state(device);
                state == DeviceState::Operational || state == DeviceState::Faulted
            })
        })?;
        let why = |device| Some((device, self.main.diagnosis(device)?.why?));
        Ok((0..count).filter_map(why).collect())
    }

    /// Whether a device has objects.
    pub(super) fn has_objects(&self, device: usize) -> bool {
        let found = self.main.found(device);
        found.is_some_and(|(_, found)| found.has_coe()) && self.main.device_state(device) == DeviceState::Operational
    }

    /// Octets of its process data as its EEPROM has them: outputs, inputs.
    pub(super) fn octets(&self, device: usize) -> [u16; 2] {
        use ethercat::wire::sii::Usage;
        let found = self.main.found(device);
        [Usage::Outputs, Usage::Inputs].map(|usage| {
            let manager = found.and_then(|(_, found)| found.manager(usage));
            manager.map_or(0, |(_, manager)| manager.length)
        })
    }

    /// Which bits of those have an object, by the PDOs of its EEPROM; `None`: it does not tell.
    pub(super) fn used_bits(&self, device: usize) -> [Option<Vec<u8>>; 2] {
        use ethercat::wire::sii::Usage;
        let found = self.main.found(device);
        [Usage::Outputs, Usage::Inputs].map(|usage| {
            let (_, found) = found?;
            found.used_bits(usage).map(<[u8]>::to_vec)
        })
    }

    /// Reads or writes an object; what was read.
    ///
    /// # Errors
    /// The outer one: the link; the inner one: the device.
    pub(super) fn sdo(
        &mut self,
        device: usize,
        (index, sub): (u16, u8),
        write: Option<&[u8]>,
    ) -> anyhow::Result<Result<Vec<u8>, SetupError>> {
        let object = Object {
            index,
            sub,
            complete: false,
        };
        let order = match write {
            Some(value) => self.main.sdo_write(device, object, value),
            None => self.main.sdo_read(device, object),
        };
        let order = order.ok_or_else(|| anyhow!("the value is too long"))?;
        let mut result = None;
        self.until(SDO_NS, |main| {
            result = main.sdo_result(order).map(|result| result.map(<[u8]>::to_vec));
            result.is_some()
        })?;
        Ok(result.unwrap_or(Err(SetupError::SdoTimeout { object })))
    }

    /// Leaves all devices in INIT.
    ///
    /// # Errors
    /// The link.
    pub(super) fn end(&mut self) -> anyhow::Result<()> {
        let frame = self.main.shut_down_frame();
        Ok(self.link.send(frame)?)
    }
}

/// Refuses to send where somebody else does.
///
/// # Errors
/// Who it is.
pub(super) fn refuse_other(link: &mut dyn Link, listen_ns: u64) -> anyhow::Result<()> {
    let other = listen(link, listen_ns)?;
    ensure!(
        other.is_none(),
        "another main device is at work ({}): nothing was sent",
        super::words::mac(other.unwrap_or_default())
    );
    Ok(())
}
