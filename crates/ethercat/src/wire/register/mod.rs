//! Registers of a device's bus chip (ESC), and what stands in them.

mod al;

pub use al::{AlControl, AlState, AlStatus, AlStatusCode};

use super::{WireError, array, cleared, put, slice, u16_at, u32_at};

/// Type of the chip; revision and build behind it.
pub const TYPE: u16 = 0x0000;
/// Numbers of FMMUs and SyncManagers, RAM in KiB, ports.
pub const FMMU_COUNT: u16 = 0x0004;
/// See [`feature`].
pub const FEATURES: u16 = 0x0008;
/// Station address, given by the main device.
pub const STATION: u16 = 0x0010;
/// Alias of the station address, from the EEPROM.
pub const ALIAS: u16 = 0x0012;
/// Control of the data link layer: loops of the ports, use of the alias.
pub const DL_CONTROL: u16 = 0x0100;
/// Links, loops and communication of the ports; see [`DlStatus`].
pub const DL_STATUS: u16 = 0x0110;
/// State that the main device asks for; see [`AlControl`].
pub const AL_CONTROL: u16 = 0x0120;
/// State of the device; see [`AlStatus`].
pub const AL_STATUS: u16 = 0x0130;
/// Why it is not in another one; see [`AlStatusCode`].
pub const AL_STATUS_CODE: u16 = 0x0134;
/// Kind of the interface to the firmware; see [`PDI_EMULATED`].
pub const PDI_CONTROL: u16 = 0x0140;
/// Bit of [`PDI_CONTROL`]: there is no firmware, AL status mirrors AL control.
pub const PDI_EMULATED: u16 = 1 << 8;
/// Which events reach the frame header.
pub const EVENT_MASK: u16 = 0x0200;
/// Which events reach the firmware.
pub const PDI_EVENT_MASK: u16 = 0x0204;
/// Events for the main device.
pub const EVENT_REQUEST: u16 = 0x0210;
/// Events for the firmware.
pub const PDI_EVENT_REQUEST: u16 = 0x0220;
/// Invalid frames and PHY errors, two octets a port.
pub const RX_ERRORS: u16 = 0x0300;
/// Errors that a device before has seen already, an octet a port.
pub const FORWARDED_ERRORS: u16 = 0x0308;
/// Frames that the processing unit found invalid.
pub const UNIT_ERRORS: u16 = 0x030C;
/// Errors of the interface to the firmware.
pub const PDI_ERRORS: u16 = 0x030D;
/// Lost links, an octet a port.
pub const LOST_LINKS: u16 = 0x0310;
/// Tick of the watchdogs, 40 ns each, less two.
pub const WATCHDOG_DIVIDER: u16 = 0x0400;
/// Watchdog of the firmware, ticks; 0: off.
pub const WATCHDOG_PDI: u16 = 0x0410;
/// Watchdog of the process data, ticks; 0: off.
pub const WATCHDOG_DATA: u16 = 0x0420;
/// Bit 0: process data come, or nobody watches.
pub const WATCHDOG_STATUS: u16 = 0x0440;
/// How often the watchdog of the process data has expired; that of the firmware behind it.
pub const WATCHDOG_COUNTER: u16 = 0x0442;
/// Who may use the EEPROM.
pub const EEPROM_OWNER: u16 = 0x0500;
/// Bit 0: the device has it.
pub const EEPROM_TAKEN: u16 = 0x0501;
/// Control and status of the EEPROM; see [`eeprom`].
pub const EEPROM_CONTROL: u16 = 0x0502;
/// Address in the EEPROM, in words.
pub const EEPROM_ADDRESS: u16 = 0x0504;
/// Data of the EEPROM.
pub const EEPROM_DATA: u16 = 0x0508;
/// First FMMU; see [`Fmmu`].
pub const FMMU: u16 = 0x0600;
/// First SyncManager; see [`SyncManager`].
pub const SYNC_MANAGER: u16 = 0x0800;
/// Receive times of the four ports; a write latches all.
pub const DC_RECEIVE_TIMES: u16 = 0x0900;
/// System time of the device.
pub const DC_SYSTEM_TIME: u16 = 0x0910;
/// Receive time of the processing unit.
pub const DC_UNIT_TIME: u16 = 0x0918;
/// Offset from the local clock to the system time.
pub const DC_OFFSET: u16 = 0x0920;
/// Delay from the reference clock, ns.
pub const DC_DELAY: u16 = 0x0928;
/// Filtered difference to the reference clock; see [`difference_ns`].
pub const DC_DIFFERENCE: u16 = 0x092C;
/// Start of the speed counter; a write resets the control loop.
pub const DC_SPEED_START: u16 = 0x0930;
/// What the loop adds to the speed of the clock.
pub const DC_SPEED_DIFFERENCE: u16 = 0x0932;
/// Depths of the filters of the loop.
pub const DC_FILTER: u16 = 0x0934;
/// Who rules the SYNC unit.
pub const DC_SYNC_OWNER: u16 = 0x0980;
/// Which SYNC pulses are on; see [`sync`].
pub const DC_SYNC_ACTIVATION: u16 = 0x0981;
/// Length of a pulse, 10 ns each.
pub const DC_PULSE_LENGTH: u16 = 0x0982;
/// Whether SYNC0 is on.
pub const DC_SYNC0_STATE: u16 = 0x098E;
/// First SYNC0 (write), next SYNC0 (read), in system time.
pub const DC_SYNC0_START: u16 = 0x0990;
/// Cycle of SYNC0, ns.
pub const DC_SYNC0_CYCLE: u16 = 0x09A0;
/// From SYNC0 to SYNC1, ns.
pub const DC_SYNC1_CYCLE: u16 = 0x09A4;
/// First octet of the memory behind the registers.
pub const MEMORY: u16 = 0x1000;

/// Bits of [`FEATURES`].
pub mod feature {
    /// FMMUs map whole octets only.
    pub const OCTET_FMMU: u16 = 1 << 0;
    /// There are distributed clocks.
    pub const DC: u16 = 1 << 2;
    /// Their times have 64 bits.
    pub const DC_64: u16 = 1 << 3;
    /// LRW is not supported.
    pub const NO_LRW: u16 = 1 << 9;
    /// BRW, APRW and FPRW are not supported.
    pub const NO_READ_WRITE: u16 = 1 << 10;
}

/// Bits of [`EEPROM_CONTROL`].
pub mod eeprom {
    /// Writing is enabled, for one command.
    pub const WRITE_ENABLE: u16 = 1 << 0;
    /// Eight octets are read at once, else four.
    pub const EIGHT_OCTETS: u16 = 1 << 6;
    /// Read, or its being under way.
    pub const READ: u16 = 1 << 8;
    /// Write.
    pub const WRITE: u16 = 1 << 9;
    /// Load what the chip itself takes from the EEPROM.
    pub const RELOAD: u16 = 1 << 10;
    /// The check sum of the first words is wrong.
    pub const BAD_CHECKSUM: u16 = 1 << 11;
    /// The chip has not loaded the EEPROM.
    pub const NOT_LOADED: u16 = 1 << 12;
    /// The EEPROM does not acknowledge, or the command is none.
    pub const NO_ACKNOWLEDGE: u16 = 1 << 13;
    /// A write that was not enabled.
    pub const NOT_ENABLED: u16 = 1 << 14;
    /// A command is under way.
    pub const BUSY: u16 = 1 << 15;
    /// All errors.
    pub const ERRORS: u16 = BAD_CHECKSUM | NOT_LOADED | NO_ACKNOWLEDGE | NOT_ENABLED;
}

/// Bits of [`DC_SYNC_ACTIVATION`].
pub mod sync {
    /// Cyclic operation is on.
    pub const CYCLIC: u8 = 1 << 0;
    /// SYNC0 is put out.
    pub const SYNC0: u8 = 1 << 1;
    /// SYNC1 is put out.
    pub const SYNC1: u8 = 1 << 2;
    /// A write to [`DC_SYNC0_START`](super::DC_SYNC0_START) switches on.
    pub const AUTO_START: u8 = 1 << 3;
}

/// [`DL_STATUS`]: what the ports are like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DlStatus(pub u16);

impl DlStatus {
    /// The firmware runs.
    pub const RUNS: u16 = 1 << 0;
    /// The watchdog of the firmware has not expired.
    pub const WATCHDOG: u16 = 1 << 1;

    /// There is a link at this port, 0 to 3.
    pub const fn link(self, port: usize) -> bool {
        self.0 >> (4 + port) & 1 != 0
    }

    /// Frames turn round at this port.
    pub const fn is_closed(self, port: usize) -> bool {
        self.0 >> (8 + 2 * port) & 1 != 0
    }

    /// Frames go out at this port and come back.
    pub const fn is_open(self, port: usize) -> bool {
        self.0 >> (9 + 2 * port) & 1 != 0
    }

    /// Of a device whose firmware runs and at which these ports have a link.
    pub fn of_links(links: [bool; 4]) -> DlStatus {
        let mut word = DlStatus::RUNS | DlStatus::WATCHDOG;
        for (port, link) in links.into_iter().enumerate() {
            let bits = if link {
                1 << (4 + port) | 2 << (8 + 2 * port)
            } else {
                1 << (8 + 2 * port)
            };
            word |= bits;
        }
        DlStatus(word)
    }
}

/// One SyncManager: who may use which part of the memory, and when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SyncManager {
    /// First octet of the memory.
    pub start: u16,
    /// Octets.
    pub length: u16,
    /// See [`SyncManager::MAILBOX`] and those beside it.
    pub control: u8,
    /// See [`SyncManager::FULL`].
    pub status: u8,
    /// Bit 0: on. Bit 1: repeat request, toggled.
    pub activate: u8,
    /// Bit 0: switched off by the device. Bit 1: repeat acknowledge.
    pub pdi: u8,
}

impl SyncManager {
    /// Octets of its registers.
    pub const LEN: usize = 8;
    /// Control: a mailbox; else three buffers.
    pub const MAILBOX: u8 = 0x02;
    /// Control: the main device writes; else it reads.
    pub const WRITE: u8 = 0x04;
    /// Control: a write feeds the watchdog of the process data.
    pub const TRIGGER: u8 = 0x40;
    /// Status: the mailbox is full.
    pub const FULL: u8 = 0x08;
    /// Control of a mailbox to the device.
    pub const MAILBOX_OUT: u8 = 0x26;
    /// Control of a mailbox from the device.
    pub const MAILBOX_IN: u8 = 0x22;
    /// Control of outputs whose absence is noticed.
    pub const OUTPUTS: u8 = 0x64;
    /// Control of inputs.
    pub const INPUTS: u8 = 0x20;

    /// It is on.
    pub const fn is_active(&self) -> bool {
        self.activate & 1 != 0
    }

    /// It is a mailbox.
    pub const fn is_mailbox(&self) -> bool {
        self.control & 0x03 == SyncManager::MAILBOX
    }

    /// The main device writes it.
    pub const fn is_written(&self) -> bool {
        self.control & 0x0C == SyncManager::WRITE
    }

    /// Reads its registers; never panics.
    ///
    /// # Errors
    /// [`WireError::TooShort`].
    pub fn parse(octets: &[u8]) -> Result<SyncManager, WireError> {
        slice(octets, 0, SyncManager::LEN)?;
        Ok(SyncManager {
            start: u16_at(octets, 0)?,
            length: u16_at(octets, 2)?,
            control: octets[4],
            status: octets[5],
            activate: octets[6],
            pdi: octets[7],
        })
    }

    /// Writes its registers.
    ///
    /// # Errors
    /// [`WireError::NoRoom`].
    pub fn emit(&self, buffer: &mut [u8]) -> Result<(), WireError> {
        let out = cleared(buffer, SyncManager::LEN)?;
        put(out, 0, self.start.to_le_bytes());
        put(out, 2, self.length.to_le_bytes());
        put(out, 4, [self.control, self.status, self.activate, self.pdi]);
        Ok(())
    }
}

/// One FMMU: where a part of the logical image lies in the memory of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fmmu {
    /// First octet in the logical image.
    pub logical: u32,
    /// Octets that it touches there.
    pub length: u16,
    /// First bit of the first octet.
    pub first_bit: u8,
    /// Last bit of the last octet.
    pub last_bit: u8,
    /// First octet in the memory.
    pub physical: u16,
    /// First bit there.
    pub physical_bit: u8,
    /// Bit 0: the main device reads. Bit 1: it writes.
    pub kind: u8,
    /// It is on.
    pub active: bool,
}

impl Fmmu {
    /// Octets of its registers.
    pub const LEN: usize = 16;
    /// The main device reads.
    pub const READ: u8 = 1;
    /// The main device writes.
    pub const WRITE: u8 = 2;

    /// An FMMU of whole octets that is on.
    pub const fn octets(logical: u32, length: u16, physical: u16, kind: u8) -> Fmmu {
        Fmmu {
            logical,
            length,
            first_bit: 0,
            last_bit: 7,
            physical,
            physical_bit: 0,
            kind,
            active: true,
        }
    }

    /// Reads its registers; never panics.
    ///
    /// # Errors
    /// [`WireError::TooShort`].
    pub fn parse(octets: &[u8]) -> Result<Fmmu, WireError> {
        slice(octets, 0, Fmmu::LEN)?;
        Ok(Fmmu {
            logical: u32_at(octets, 0)?,
            length: u16_at(octets, 4)?,
            first_bit: octets[6] & 7,
            last_bit: octets[7] & 7,
            physical: u16_at(octets, 8)?,
            physical_bit: octets[10] & 7,
            kind: octets[11] & 3,
            active: octets[12] & 1 != 0,
        })
    }

    /// Writes its registers.
    ///
    /// # Errors
    /// [`WireError::NoRoom`].
    pub fn emit(&self, buffer: &mut [u8]) -> Result<(), WireError> {
        let out = cleared(buffer, Fmmu::LEN)?;
        put(out, 0, self.logical.to_le_bytes());
        put(out, 4, self.length.to_le_bytes());
        put(out, 6, [self.first_bit & 7, self.last_bit & 7]);
        put(out, 8, self.physical.to_le_bytes());
        put(out, 10, [self.physical_bit & 7, self.kind & 3, u8::from(self.active)]);
        Ok(())
    }
}

/// The difference in [`DC_DIFFERENCE`] as a number, ns; above 0: the local clock is ahead. There it is a sign and a magnitude,
/// so that the OR of all devices is an upper bound.
pub const fn difference_ns(register: u32) -> i32 {
    let magnitude = (register & 0x7FFF_FFFF) as i32;
    if register >> 31 != 0 { magnitude } else { -magnitude }
}

/// The register that holds such a difference; see [`difference_ns`].
pub const fn difference_register(ns: i32) -> u32 {
    if ns > 0 {
        1 << 31 | ns as u32
    } else {
        ns.unsigned_abs() & 0x7FFF_FFFF
    }
}

/// The address of a register of the device with this station address, as datagrams have it.
pub const fn station(address: u16, register: u16) -> u32 {
    address as u32 | (register as u32) << 16
}

/// The same of the device at this position, from 0.
pub const fn position(position: u16, register: u16) -> u32 {
    station(position.wrapping_neg(), register)
}

/// Where the registers of this SyncManager lie.
pub const fn sync_manager(number: u8) -> u16 {
    SYNC_MANAGER + 8 * number as u16
}

/// Where the registers of this FMMU lie.
pub const fn fmmu(number: u8) -> u16 {
    FMMU + 16 * number as u16
}

/// Receive times of the four ports, 32 bits each, as read from [`DC_RECEIVE_TIMES`].
///
/// # Errors
/// [`WireError::TooShort`].
pub fn receive_times(octets: &[u8]) -> Result<[u32; 4], WireError> {
    let mut times = [0; 4];
    for (port, time) in times.iter_mut().enumerate() {
        *time = u32::from_le_bytes(array(octets, 4 * port)?);
    }
    Ok(times)
}
