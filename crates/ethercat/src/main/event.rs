//! What the main device tells, and why a device does not come up, in words.

use super::config::{Expected, Place};
use crate::wire::Mac;
use crate::wire::coe::{Emergency, Object, abort};
use crate::wire::mailbox::MailError;
use crate::wire::register::{AlState, AlStatusCode, eeprom};
use crate::wire::sii::{Area, Identity, Usage};
use obd::AbortCode;

/// Why a device does not come up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetupError {
    /// It does not answer any more.
    Gone,
    /// There is none at its place.
    Missing(Place),
    /// It is another one.
    WrongIdentity {
        /// What it should be.
        expected: Expected,
        /// What it is.
        found: Identity,
    },
    /// Its EEPROM shows these errors, or `None`: does not become ready.
    Eeprom(Option<u16>),
    /// Its EEPROM has no SyncManager for this.
    NoSyncManager(Usage),
    /// Its mailbox is longer than a frame.
    MailboxTooLong {
        /// Octets.
        octets: u16,
    },
    /// It should be set up by SDO and has no mailbox for that.
    NoMailbox,
    /// What a SyncManager holds does not fit into the memory of the device.
    NoRoom(NoRoom),
    /// Its mailboxes are too short for an SDO.
    MailboxTooShort {
        /// Octets of the shorter one.
        octets: u16,
    },
    /// It has no mailbox, and its process data have another length.
    Length {
        /// Outputs or inputs.
        usage: Usage,
        /// Octets, by its EEPROM.
        expected: u16,
        /// Octets, by the configuration.
        octets: u16,
    },
    /// It cannot take LRW.
    NoLrw,
    /// It should follow the clock of the bus and has none.
    NoClock,
    /// Its clock does not come near to that of the bus.
    ClockApart {
        /// How far it is away.
        ns: i32,
    },
    /// It has refused a state.
    Refused {
        /// The state.
        state: AlState,
        /// Where it is.
        at: AlState,
        /// Why.
        code: AlStatusCode,
        /// What was set up.
        set_up: SetUp,
    },
    /// It has not come to a state in time.
    Late {
        /// The state.
        state: AlState,
        /// Where it is.
        at: AlState,
    },
    /// It has refused a value.
    Sdo {
        /// Of which object.
        object: Object,
        /// Why.
        code: AbortCode,
    },
    /// It has not answered an SDO in time.
    SdoTimeout {
        /// Of which object.
        object: Object,
    },
    /// It has not understood a mail.
    Mail(MailError),
    /// A value that was written, or that it must have, is another one when it is read.
    Differs {
        /// Of which object.
        object: Object,
        /// What it should be.
        expected: u32,
        /// What it is.
        found: u32,
    },
}

/// What does not fit into the memory of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoRoom {
    /// Number of the SyncManager, and what it is for.
    pub manager: (u8, Usage),
    /// Where its memory begins.
    pub start: u16,
    /// Octets of its data.
    pub octets: u16,
    /// How often they are kept: process data three times.
    pub times: u8,
    /// What begins behind it: the number of a SyncManager and what it is for; `None`: the memory ends.
    pub behind: Option<(u8, Usage)>,
    /// Where that is.
    pub end: u32,
}

impl core::fmt::Display for NoRoom {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let NoRoom {
            manager: (number, usage),
            start,
            octets,
            times,
            behind,
            end,
        } = *self;
        let own_end = u32::from(start) + u32::from(times) * u32::from(octets);
        write!(f, "SyncManager {number} ({}) does not fit: ", usage_text(usage))?;
        write!(
            f,
            "{times} x {octets} octets from {start:04X}h on end at {own_end:04X}h, "
        )?;
        match behind {
            Some((number, usage)) => write!(f, "SyncManager {number} ({}) begins at {end:04X}h", usage_text(usage)),
            None => write!(f, "the memory of the device ends at {end:04X}h"),
        }
    }
}

/// What a device was told of mailboxes and process data, for words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SetUp {
    /// Octets of the outputs and of the inputs.
    pub octets: (u16, u16),
    /// Mailbox of the main device's mails, by the EEPROM.
    pub receive: Area,
    /// Mailbox of the device's mails.
    pub send: Area,
    /// Values that were written before.
    pub values: u16,
}

/// A number in hexadecimal digits, or what stands for any.
struct Any(Option<u32>);

impl core::fmt::Display for Any {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.0 {
            Some(number) => write!(f, "{number:08X}h"),
            None => f.write_str("any"),
        }
    }
}

impl core::fmt::Display for Expected {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let (vendor, product) = (Any(self.vendor), Any(self.product));
        write!(f, "vendor {vendor} product {product} revision {}", Any(self.revision))?;
        self.serial.map_or(Ok(()), |serial| write!(f, " serial {serial}"))
    }
}

impl core::fmt::Display for Identity {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Identity {
            vendor,
            product,
            revision,
            serial,
        } = self;
        write!(
            f,
            "vendor {vendor:08X}h product {product:08X}h revision {revision:08X}h serial {serial}"
        )
    }
}

impl core::fmt::Display for Place {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Place::Position(position) => write!(f, "position {position}"),
            Place::Alias(alias) => write!(f, "alias {alias}"),
        }
    }
}

/// The object of an SDO, as people write it.
struct Name(Object);

impl core::fmt::Display for Name {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:04X}h:{:02X}", self.0.index, self.0.sub)
    }
}

impl core::fmt::Display for SetupError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            SetupError::Gone => f.write_str("does not answer any more"),
            SetupError::Missing(place) => write!(f, "nothing is at {place}"),
            SetupError::WrongIdentity { expected, found } => write!(f, "expected {expected}, found {found}"),
            SetupError::Eeprom(None) => f.write_str("the EEPROM does not become ready"),
            SetupError::Eeprom(Some(bits)) => f.write_str(eeprom_text(bits)),
            SetupError::NoSyncManager(usage) => {
                let text = usage_text(usage);
                write!(
                    f,
                    "the EEPROM has no SyncManager for {text}: the device has none, their list has to be empty"
                )
            }
            SetupError::Length {
                usage,
                expected,
                octets,
            } => {
                write!(
                    f,
                    "has {expected} octets of {} that cannot be changed, not {octets}",
                    usage_text(usage)
                )
            }
            SetupError::MailboxTooLong { octets } => {
                write!(
                    f,
                    "a mailbox of {octets} octets does not fit into a frame, {} do",
                    crate::wire::DATA_MAX
                )
            }
            SetupError::NoMailbox => f.write_str("values shall be written by SDO, and it has no CoE mailbox"),
            SetupError::NoRoom(no_room) => no_room.fmt(f),
            SetupError::MailboxTooShort { octets } => write!(
                f,
                "a mailbox of {octets} octets by its EEPROM is too short for an SDO, which takes {}",
                crate::wire::coe::MAILBOX_MIN
            ),
            SetupError::NoLrw => f.write_str("cannot be read and written by one datagram (LRW)"),
            SetupError::NoClock => f.write_str("has no distributed clock; switch SYNC0 off for it"),
            SetupError::ClockApart { ns } => write!(f, "its clock stays {ns} ns away from that of the bus"),
            SetupError::Refused {
                state,
                at,
                code,
                set_up,
            } => {
                write!(f, "refused {state} and is in {at}: {code}")?;
                hint(f, code, &set_up)
            }
            SetupError::Late { state, at } => write!(f, "has not come to {state} in time and is in {at}"),
            SetupError::Sdo { object, code } => {
                write!(f, "refused {}: {}", Name(object), abort::text(code))?;
                match (code, object.index) {
                    (AbortCode::WRITE_OF_READ_ONLY, 0x1600..=0x17FF | 0x1A00..=0x1BFF) => {
                        write!(
                            f,
                            "; PDO {:04X}h cannot be changed, use its own entries or another one",
                            object.index
                        )
                    }
                    _ => Ok(()),
                }
            }
            SetupError::SdoTimeout { object } => write!(f, "has not answered to {} in time", Name(object)),
            SetupError::Mail(error) => write!(f, "has not understood a mail: {error}"),
            SetupError::Differs {
                object,
                expected,
                found,
            } => write!(
                f,
                "{} should be {expected:08X}h and is read as {found:08X}h",
                Name(object)
            ),
        }
    }
}

impl core::error::Error for SetupError {}

/// What the set-up says to a status code.
fn hint(f: &mut core::fmt::Formatter<'_>, code: AlStatusCode, set_up: &SetUp) -> core::fmt::Result {
    match code {
        AlStatusCode::OUTPUT_SM => write!(
            f,
            "; {} octets of outputs were set up, it expects another length",
            set_up.octets.0
        ),
        AlStatusCode::INPUT_SM => write!(
            f,
            "; {} octets of inputs were set up, it expects another length",
            set_up.octets.1
        ),
        AlStatusCode::MAILBOX => {
            let SetUp { receive, send, .. } = set_up;
            write!(
                f,
                "; mailboxes were set up as in its EEPROM, {:04X}h/{} and {:04X}h/{}",
                receive.start, receive.length, send.start, send.length
            )
        }
        AlStatusCode::WATCHDOG | AlStatusCode::NO_OUTPUTS => f.write_str("; it got no outputs in time"),
        AlStatusCode::SYNCHRONISATION | AlStatusCode::FATAL_SYNC | AlStatusCode::NO_SYNC0 | AlStatusCode::PLL => {
            f.write_str("; frames come too near to SYNC0 or too late: look at the shift and at the jitter of the cycle")
        }
        AlStatusCode::NO_FREE_RUN => f.write_str("; it wants SYNC0: switch its clock on"),
        AlStatusCode::NO_SYNC_MODE => f.write_str("; it wants no SYNC0: switch its clock off"),
        AlStatusCode::INPUT_MAPPING | AlStatusCode::OUTPUT_MAPPING => {
            f.write_str("; a PDO that was set up has an entry that it cannot map, or is none of its own")
        }
        AlStatusCode::CYCLE_TOO_SHORT
        | AlStatusCode::CYCLE_TIME
        | AlStatusCode::SYNC0_CYCLE
        | AlStatusCode::SYNC1_CYCLE => {
            f.write_str("; the cycle is none of those that its manual lists: choose another one")
        }
        AlStatusCode::MODULES => f.write_str("; modules stand in its slots other than it was told"),
        AlStatusCode::SYNC_MANAGER | AlStatusCode::SM_TYPES => write!(
            f,
            "; {} octets of outputs and {} of inputs were set up",
            set_up.octets.0, set_up.octets.1
        ),
        _ if set_up.values > 0 => write!(f, "; {} values were written before", set_up.values),
        _ => Ok(()),
    }
}

const fn usage_text(usage: Usage) -> &'static str {
    match usage {
        Usage::Outputs => "outputs",
        Usage::Inputs => "inputs",
        Usage::MailboxOut => "mails to it",
        Usage::MailboxIn => "mails from it",
        _ => "mails",
    }
}

fn eeprom_text(bits: u16) -> &'static str {
    if bits & eeprom::BAD_CHECKSUM != 0 {
        "the check sum of the EEPROM is wrong"
    } else if bits & eeprom::NOT_LOADED != 0 {
        "the EEPROM could not be loaded"
    } else {
        "the EEPROM does not acknowledge"
    }
}

/// Where a cable is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Break {
    /// Position and port of the last device that answers; `None`: this PC.
    pub before: Option<(u16, u8)>,
    /// Position of the first one that does not.
    pub behind: u16,
    /// The device before it sees no link any more: cable or power. Else the link is there, and the device is silent.
    pub link_lost: bool,
    /// Links that this port has lost since the start.
    pub lost_links: u8,
}

impl core::fmt::Display for Break {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.before {
            None => write!(
                f,
                "nothing answers behind this PC: cable to position {} or its power",
                self.behind
            )?,
            Some((position, port)) if self.link_lost => write!(
                f,
                "no link between position {position}, port {port}, and position {}: cable, or power of the latter",
                self.behind
            )?,
            Some((position, port)) => write!(
                f,
                "position {} is silent, though position {position} has a link at port {port}",
                self.behind
            )?,
        }
        match self.lost_links {
            0 | 1 => Ok(()),
            times => write!(f, "; this link was lost {times} times"),
        }
    }
}

/// Something that happened. `device`: its number in the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Nobody answers; so many frames were sent.
    Silent {
        /// Frames.
        sent: u32,
    },
    /// So many devices are on the wire.
    Found {
        /// Devices.
        devices: u16,
    },
    /// More devices than there is room for.
    TooMany {
        /// Devices.
        devices: u16,
    },
    /// A device that the configuration does not have; it is left alone.
    Stranger {
        /// Where.
        position: u16,
        /// What it is.
        identity: Identity,
    },
    /// The number of devices that answer does not stay the same, so that none can be led to OP.
    Unsteady {
        /// Devices now.
        devices: u16,
        /// Devices before.
        before: u16,
    },
    /// A device is there and the right one.
    Identified {
        /// Which.
        device: u16,
        /// Where.
        position: u16,
    },
    /// A device does not come up; it is tried again after a while.
    Failed {
        /// Which.
        device: u16,
        /// Why.
        error: SetupError,
    },
    /// A device does not have an object that it should be told at its start; it is set up all the same.
    Lacks {
        /// Which.
        device: u16,
        /// The object.
        object: Object,
    },
    /// A device says that its shortest cycle is longer than ours (1C32h:05); it is set up all the same, as some mean another one.
    Slow {
        /// Which.
        device: u16,
        /// Its shortest cycle, ns.
        least_ns: u32,
    },
    /// More devices are on the wire than were counted; they are looked at.
    More {
        /// Devices.
        devices: u16,
    },
    /// A device is in OP.
    Up {
        /// Which.
        device: u16,
    },
    /// A device has left OP by itself.
    Left {
        /// Which.
        device: u16,
        /// Where it is.
        at: AlState,
        /// Why.
        code: AlStatusCode,
    },
    /// A device has not answered more cycles in a row than are ridden out.
    Lost {
        /// Which.
        device: u16,
        /// Its last working counter.
        working_counter: u16,
        /// What it should be.
        expected: u16,
    },
    /// A cable is broken, or a device without power.
    Broken(Break),
    /// Frames have arrived spoilt at this port: the cable there, or what lies at its other end.
    Spoilt {
        /// Position of the first device that has seen them so.
        position: u16,
        /// Its port.
        port: u8,
        /// How many, since the last look.
        frames: u8,
    },
    /// At the place of a device is one with another station address: their order was changed, or one was put in between.
    OrderChanged {
        /// Which.
        device: u16,
        /// Where it should be.
        position: u16,
        /// Station address of the one that is there.
        station: u16,
    },
    /// A device reports an error.
    Emergency {
        /// Which.
        device: u16,
        /// Its error.
        emergency: Emergency,
    },
    /// A frame came that another main device has sent.
    OtherMain {
        /// Its address.
        source: Mac,
    },
}

impl core::fmt::Display for Event {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Event::Unsteady { devices, before } => write!(
                f,
                "the number of devices does not stay the same: {devices} answer now, {before} did before; look at cables and supplies"
            ),
            Event::Silent { sent } => write!(
                f,
                "no answer to {sent} frames: cable, IN and OUT of the first device swapped, or its power"
            ),
            Event::Found { devices } => write!(f, "{devices} devices are on the wire"),
            Event::TooMany { devices } => write!(f, "{devices} devices are on the wire, more than there is room for"),
            Event::Stranger { position, identity } => {
                write!(
                    f,
                    "position {position} is not in the configuration and left alone: {identity}"
                )
            }
            Event::Identified { device, position } => write!(f, "device {device} was found at position {position}"),
            Event::Failed { device, error } => write!(f, "device {device}: {error}"),
            Event::Lacks { device, object } => write!(
                f,
                "device {device} does not have {}: nothing is written there",
                Name(object)
            ),
            Event::Slow { device, least_ns } => write!(
                f,
                "device {device} says that its shortest cycle is {} us (1C32h:05), which is longer than ours",
                least_ns.div_ceil(1000)
            ),
            Event::More { devices } => write!(f, "{devices} devices are on the wire now, more than there were"),
            Event::Up { device } => write!(f, "device {device} is in OP"),
            Event::Left {
                device,
                at,
                code: AlStatusCode::NONE,
            } => write!(f, "device {device} has left OP and is in {at}"),
            Event::Left { device, at, code } => {
                write!(f, "device {device} has left OP and is in {at}: {code}")?;
                hint(f, code, &SetUp::default())
            }
            Event::Lost {
                device,
                working_counter,
                expected,
            } => {
                let words = match working_counter {
                    0 => "it does not answer",
                    1 => "it is read, and takes no outputs",
                    2 => "it takes outputs, and is not read",
                    _ => "more devices than it answer",
                };
                write!(
                    f,
                    "device {device} is lost: working counter {working_counter}, expected {expected}: {words}"
                )
            }
            Event::Broken(place) => place.fmt(f),
            Event::Spoilt { position, port, frames } => write!(
                f,
                "{frames} frames arrived spoilt at position {position}, port {port}: the cable there, or what lies at its other end"
            ),
            Event::OrderChanged {
                device,
                position,
                station,
            } => write!(
                f,
                "device {device} should be at position {position}, where that of position {} is: was the order changed?",
                station.wrapping_sub(super::device::STATION_FIRST)
            ),
            Event::Emergency { device, emergency } => write!(
                f,
                "device {device} reports error {:04X}h, register {:02X}h",
                emergency.code, emergency.register
            ),
            Event::OtherMain {
                source: [a, b, c, d, e, g],
            } => write!(
                f,
                "another main device sends, {a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{g:02x}: one of both has to be switched off"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn events_have_words() {
        for (event, words) in [
            (
                Event::Lost {
                    device: 2,
                    working_counter: 1,
                    expected: 3,
                },
                "device 2 is lost: working counter 1, expected 3: it is read, and takes no outputs",
            ),
            (
                Event::Left {
                    device: 1,
                    at: AlState::SafeOp,
                    code: AlStatusCode::WATCHDOG,
                },
                "device 1 has left OP and is in SAFE-OP: 001Bh (no outputs came in time (SyncManager watchdog)); it got no outputs \
                 in time",
            ),
            (
                Event::OrderChanged {
                    device: 1,
                    position: 1,
                    station: 0x1002,
                },
                "device 1 should be at position 1, where that of position 2 is: was the order changed?",
            ),
            (
                Event::OtherMain {
                    source: [1, 2, 3, 4, 5, 0xAB],
                },
                "another main device sends, 01:02:03:04:05:ab: one of both has to be switched off",
            ),
            (
                Event::Broken(Break {
                    before: Some((3, 1)),
                    behind: 4,
                    link_lost: false,
                    lost_links: 3,
                }),
                "position 4 is silent, though position 3 has a link at port 1; this link was lost 3 times",
            ),
        ] {
            assert_eq!(event.to_string(), words);
        }
    }
}
