//! What the main device shall make of the devices on its wire.

use crate::wire::register::AlState;
use crate::wire::sii::Identity;

/// How a device is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// By its position on the wire, 0 first.
    Position(u16),
    /// By the alias in its EEPROM.
    Alias(u16),
}

/// What a device has to be; `None`: anything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Expected {
    /// Number of its maker.
    pub vendor: Option<u32>,
    /// Kind of device.
    pub product: Option<u32>,
    /// State of its development.
    pub revision: Option<u32>,
    /// Number of this one.
    pub serial: Option<u32>,
}

impl Expected {
    /// Whether a device is so.
    pub fn matches(&self, found: &Identity) -> bool {
        [
            (self.vendor, found.vendor),
            (self.product, found.product),
            (self.revision, found.revision),
            (self.serial, found.serial),
        ]
        .into_iter()
        .all(|(expected, found)| expected.is_none_or(|expected| expected == found))
    }
}

/// A process data object of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoConfig<'a> {
    /// 16xxh or 1Axxh.
    pub index: u16,
    /// Entries as in the mapping object: index << 16 | sub-index << 8 | bits. Empty: as the device has them.
    pub entries: &'a [u32],
}

/// Process data of one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ProcessDataConfig<'a> {
    /// Their length.
    pub octets: u16,
    /// Objects that shall be assigned. Empty: as the device has them.
    pub pdos: &'a [PdoConfig<'a>],
}

/// A value that is written into a device in PRE-OP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StartValue<'a> {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub sub: u8,
    /// All sub-indices at once.
    pub complete: bool,
    /// A device that does not have the object comes up without.
    pub optional: bool,
    /// Its octets.
    pub value: &'a [u8],
}

/// Distributed clocks of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockConfig {
    /// Registers 0980h and 0981h, as its ESI file has them: 0300h SYNC0, 0700h SYNC0 and SYNC1.
    pub activate: u16,
    /// SYNC0 comes so long after the dates of the cycle, ns.
    pub shift_ns: i32,
    /// SYNC1 comes so long after SYNC0, ns.
    pub sync1_ns: u32,
}

/// A device that takes part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceConfig<'a> {
    /// Where it is.
    pub place: Place,
    /// What it is.
    pub expected: Expected,
    /// Process data to it.
    pub outputs: ProcessDataConfig<'a>,
    /// Process data from it.
    pub inputs: ProcessDataConfig<'a>,
    /// Values for PRE-OP, in order.
    pub start: &'a [StartValue<'a>],
    /// Values that it must have behind those.
    pub checks: &'a [obd::Expected],
    /// Its clock; `None`: it runs with the frames.
    pub clock: Option<ClockConfig>,
    /// Watchdog of its outputs, ms; `None`: as it has it.
    pub watchdog_ms: Option<u16>,
    /// Where it is led: OP, or PRE-OP for one that is only asked by SDO.
    pub goal: AlState,
}

impl DeviceConfig<'_> {
    /// A device without process data at this position.
    pub const fn at(position: u16) -> Self {
        DeviceConfig {
            place: Place::Position(position),
            expected: Expected {
                vendor: None,
                product: None,
                revision: None,
                serial: None,
            },
            outputs: ProcessDataConfig { octets: 0, pdos: &[] },
            inputs: ProcessDataConfig { octets: 0, pdos: &[] },
            start: &[],
            checks: &[],
            clock: None,
            watchdog_ms: None,
            goal: AlState::Op,
        }
    }
}

/// How long things may take, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Times {
    /// A frame that has not come back by then is lost.
    pub frame_ns: u64,
    /// Between two looks at what a device does by itself.
    pub pause_ns: u64,
    /// A command of an EEPROM.
    pub eeprom_ns: u64,
    /// The answer to a mail.
    pub mail_ns: u64,
    /// A step of the state machine, but the one to OP.
    pub step_ns: u64,
    /// The step to OP.
    pub op_ns: u64,
    /// Until clocks have come together.
    pub clock_ns: u64,
    /// Clocks that are nearer are together.
    pub clock_limit_ns: u32,
    /// From the set-up of SYNC0 to its first pulse.
    pub sync_start_ns: u64,
    /// Between two looks at the mailbox of a device that runs.
    pub mailbox_ns: u64,
    /// A device that has left is tried again after this.
    pub retry_ns: u64,
}

impl Default for Times {
    fn default() -> Times {
        Times {
            frame_ns: 5_000_000,
            pause_ns: 500_000,
            eeprom_ns: 100_000_000,
            mail_ns: 1_000_000_000,
            step_ns: 5_000_000_000,
            op_ns: 10_000_000_000,
            clock_ns: 5_000_000_000,
            clock_limit_ns: 1_000,
            sync_start_ns: 100_000_000,
            mailbox_ns: 10_000_000,
            retry_ns: 200_000_000,
        }
    }
}

/// The whole network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config<'a> {
    /// Length of a cycle.
    pub cycle_ns: u32,
    /// Devices that take part.
    pub devices: &'a [DeviceConfig<'a>],
    /// Cycles in a row without data of a device that are ridden out; one more, and it is gone.
    pub lost_max: u32,
    /// How long things may take.
    pub times: Times,
}

impl Config<'_> {
    /// No device exchanges anything: they are led to PRE-OP to be asked, also what their EEPROMs say of process data.
    pub(super) fn only_asks(&self) -> bool {
        !self.devices.is_empty() && self.devices.iter().all(|device| device.goal == AlState::PreOp)
    }
}
