//! Kinds of devices, ready made: servo drives, terminals, couplers.

use super::application::{Application, Drive, Motor, NoProcessData, Terminal};
use super::device::SubDeviceConfig;
use super::objects::{COMMUNICATION, ObjectStore, PDO_ENTRIES};
use crate::wire::sii::{
    Area, General, Identity, Image, Mailboxes, PdoEntry, PdoImage, SyncManagerEntry, Usage, protocol,
};
use cia402::device::{DEVICE_TYPE, DRIVE_OBJECTS, Delays};
use obd::{AbortCode, DataType, EntryDef};
use std::boxed::Box;
use std::vec;
use std::vec::Vec;

/// Most axes of a drive.
pub const AXES_MAX: usize = 4;
/// Octets of each direction of an axis as it comes out of the box.
pub const AXIS_OCTETS: u16 = 8;
/// Octets of an EEPROM.
const EEPROM_LEN: usize = 2048;
const MAILBOX: u16 = 0x1000;
/// Room for three buffers of each direction.
const ROOM: u16 = 0x0300;

const fn mapped(index: u16, sub: u8, bits: u8) -> i64 {
    ((index as i64) << 16) | ((sub as i64) << 8) | bits as i64
}

/// PDOs of axis `N`: control word, mode, a gap, target; status word, mode, a gap, position.
const fn axis_pdos<const N: u16>() -> [EntryDef; 12] {
    const fn count(index: u16, name: &'static str) -> EntryDef {
        EntryDef::rw(index, DataType::U8, name)
            .default(4)
            .limits(0, PDO_ENTRIES as i64)
    }
    const fn entry(index: u16, sub: u8, value: i64, name: &'static str) -> EntryDef {
        EntryDef::rw(index, DataType::U32, name).sub(sub).default(value)
    }
    let (rx, tx, shift) = (0x1600 + 0x10 * N, 0x1A00 + 0x10 * N, 0x0800 * N);
    let (out, back) = ("RxPDO mapping", "TxPDO mapping");
    [
        count(rx, out),
        entry(rx, 1, mapped(0x6040 + shift, 0, 16), out),
        entry(rx, 2, mapped(0x6060 + shift, 0, 8), out),
        entry(rx, 3, mapped(0, 0, 8), out),
        entry(rx, 4, mapped(0x607A + shift, 0, 32), out),
        EntryDef::rw(rx, DataType::U32, out).subs(5, PDO_ENTRIES),
        count(tx, back),
        entry(tx, 1, mapped(0x6041 + shift, 0, 16), back),
        entry(tx, 2, mapped(0x6061 + shift, 0, 8), back),
        entry(tx, 3, mapped(0, 0, 8), back),
        entry(tx, 4, mapped(0x6064 + shift, 0, 32), back),
        EntryDef::rw(tx, DataType::U32, back).subs(5, PDO_ENTRIES),
    ]
}

const AXIS_PDOS: [&[EntryDef]; AXES_MAX] = [
    &axis_pdos::<0>(),
    &axis_pdos::<1>(),
    &axis_pdos::<2>(),
    &axis_pdos::<3>(),
];

/// A device with a CoE mailbox, whose process data are what its objects assign.
#[derive(Clone, Copy, Debug)]
pub struct CoeModel<'a> {
    /// What it says it is.
    pub identity: Identity,
    /// 1000h.
    pub device_type: u32,
    /// Order number and name.
    pub names: [&'a str; 2],
    /// Alias of the station address.
    pub alias: u16,
    /// Octets of each mailbox.
    pub mailbox: u16,
    /// Octets of the outputs and of the inputs as it comes out of the box.
    pub octets: [u16; 2],
    /// Octets of the memory for three buffers of each direction.
    pub room: u16,
    /// What its EEPROM tells of CoE.
    pub coe: u8,
    /// Kinds of its ports, as its EEPROM has them.
    pub ports: u16,
}

impl CoeModel<'_> {
    /// The device; `objects` has [`COMMUNICATION`], whose identity and names are set here, and its mapping.
    ///
    /// # Errors
    /// An object of [`COMMUNICATION`] that is missing.
    pub fn build(
        &self,
        mut objects: ObjectStore,
        application: Box<dyn Application>,
    ) -> Result<SubDeviceConfig, AbortCode> {
        let Identity {
            vendor,
            product,
            revision,
            serial,
        } = self.identity;
        for (sub, value) in (1_u8..).zip([vendor, product, revision, serial]) {
            objects.preset(0x1018, sub, &value.to_le_bytes())?;
        }
        objects.preset(0x1000, 0, &self.device_type.to_le_bytes())?;
        objects.preset(0x1008, 0, self.names[1].as_bytes())?;
        objects.preset(0x1009, 0, b"1.0")?;
        objects.preset(0x100A, 0, env!("CARGO_PKG_VERSION").as_bytes())?;
        let behind = MAILBOX + 2 * self.mailbox;
        let [outputs, inputs] = self.octets;
        let managers = [
            manager(MAILBOX, self.mailbox, 0x26, Usage::MailboxOut),
            manager(MAILBOX + self.mailbox, self.mailbox, 0x22, Usage::MailboxIn),
            manager(behind, outputs, 0x64, Usage::Outputs),
            manager(behind + self.room, inputs, 0x20, Usage::Inputs),
        ];
        let image = Image {
            pdi: 0x0005,
            alias: self.alias,
            identity: self.identity,
            mailboxes: Mailboxes {
                receive: area(&managers[0]),
                send: area(&managers[1]),
                protocols: protocol::COE,
            },
            strings: &self.names,
            general: General {
                order: 1,
                name: 2,
                coe: self.coe,
                ports: self.ports,
                ..General::default()
            },
            fmmus: &[1, 2],
            sync_managers: &managers,
            ..Image::default()
        };
        Ok(SubDeviceConfig::new(eeprom(&image), objects, application))
    }
}

/// A servo drive.
#[derive(Clone, Copy, Debug)]
pub struct DriveModel<'a> {
    /// What it says it is.
    pub identity: Identity,
    /// Its name.
    pub name: &'a str,
    /// Alias of the station address.
    pub alias: u16,
    /// Octets of each mailbox.
    pub mailbox: u16,
    /// Times of the power section.
    pub delays: Delays,
}

impl Default for DriveModel<'_> {
    fn default() -> Self {
        DriveModel {
            identity: Identity {
                vendor: 0x0000_0A1B,
                product: 0x0402_0001,
                revision: 1,
                serial: 0,
            },
            name: "Simulated servo drive",
            alias: 0,
            mailbox: 128,
            delays: Delays::default(),
        }
    }
}

impl DriveModel<'_> {
    /// A drive with an axis for each motor, at most [`AXES_MAX`].
    ///
    /// # Errors
    /// An object that is not as the tables here have it.
    ///
    /// # Panics
    /// With no motor, or too many.
    pub fn build(&self, motors: Vec<Box<dyn Motor>>) -> Result<SubDeviceConfig, AbortCode> {
        let axes = motors.len();
        assert!((1..=AXES_MAX).contains(&axes), "{axes} axes");
        let mut objects = ObjectStore::new();
        let mut tables = vec![COMMUNICATION];
        tables.extend_from_slice(&AXIS_PDOS[..axes]);
        let built = |_| AbortCode::INTERNAL_INCOMPATIBLE;
        objects.add(0x1000..=0x1FFF, 0, &tables).map_err(built)?;
        let mut parts = Vec::new();
        for axis in 0..axes as u16 {
            let first = 0x6000 + 0x0800 * axis;
            let part = objects
                .add(first..=first + 0x07FF, 0x0800 * axis, &[DRIVE_OBJECTS])
                .map_err(built)?;
            parts.push(part);
        }
        for assign in [0x1C12_u16, 0x1C13] {
            objects.preset(assign, 0, &[axes as u8])?;
            for axis in 0..axes as u16 {
                let first = if assign == 0x1C12 { 0x1600 } else { 0x1A00 };
                objects.preset(assign, axis as u8 + 1, &(first + 0x10 * axis).to_le_bytes())?;
            }
        }
        let octets = AXIS_OCTETS * axes as u16;
        let drive = Drive::new(parts.into_iter().zip(motors).collect(), self.delays);
        let model = CoeModel {
            identity: self.identity,
            device_type: DEVICE_TYPE,
            names: ["ISOCNC-SIM", self.name],
            alias: self.alias,
            mailbox: self.mailbox,
            octets: [octets; 2],
            room: ROOM,
            coe: 0x0F | General::COMPLETE_ACCESS,
            ports: 0x0011,
        };
        model.build(objects, Box::new(drive))
    }
}

const fn manager(start: u16, length: u16, control: u8, usage: Usage) -> SyncManagerEntry {
    SyncManagerEntry {
        start,
        length,
        control,
        enable: 1,
        usage,
    }
}

fn area(manager: &SyncManagerEntry) -> Area {
    Area {
        start: manager.start,
        length: manager.length,
    }
}

fn eeprom(image: &Image<'_>) -> Vec<u8> {
    let mut octets = vec![0; EEPROM_LEN];
    if let Err(error) = image.emit(&mut octets) {
        unreachable!("the images here are short: {error}");
    }
    octets
}

/// A digital terminal with 8 outputs and 8 inputs, without a mailbox, without a clock, without firmware.
pub fn digital_terminal(identity: Identity) -> SubDeviceConfig {
    let bits = |index: u16| -> Vec<PdoEntry> {
        let entry = |sub: u8| PdoEntry {
            index,
            sub,
            name: 0,
            data_type: 1,
            bits: 1,
        };
        (1..=8).map(entry).collect()
    };
    let (outputs, inputs) = (bits(0x7000), bits(0x6000));
    let image = Image {
        // Bit 8: the state machine is emulated.
        pdi: 0x0104,
        identity,
        strings: &["DIO-8-8", "Simulated digital terminal"],
        general: General {
            order: 1,
            name: 2,
            ports: 0x0033,
            ..General::default()
        },
        fmmus: &[1, 2],
        sync_managers: &[
            manager(0x0F00, 1, 0x44, Usage::Outputs),
            manager(0x1000, 1, 0x00, Usage::Inputs),
        ],
        rx_pdos: &[PdoImage {
            index: 0x1600,
            sync_manager: 0,
            entries: &outputs,
        }],
        tx_pdos: &[PdoImage {
            index: 0x1A00,
            sync_manager: 1,
            entries: &inputs,
        }],
        ..Image::default()
    };
    let terminal = Terminal {
        inputs: vec![0],
        ..Terminal::default()
    };
    let mut config = SubDeviceConfig::new(eeprom(&image), ObjectStore::new(), Box::new(terminal));
    config.clock = None;
    config.eight_octets = false;
    config
}

/// Words of the analog terminal: each direction has four.
const ANALOG: &[EntryDef] = &[
    EntryDef::ro(0x6000, DataType::I16, "Input").subs(1, 4).tpdo(),
    EntryDef::rw(0x7000, DataType::I16, "Output").subs(1, 4).rpdo(),
];
const ANALOG_PDOS: &[EntryDef] = &[
    EntryDef::constant(0x1600, DataType::U8, "Outputs").default(4),
    EntryDef::constant(0x1600, DataType::U32, "Outputs")
        .sub(1)
        .default(mapped(0x7000, 1, 16)),
    EntryDef::constant(0x1600, DataType::U32, "Outputs")
        .sub(2)
        .default(mapped(0x7000, 2, 16)),
    EntryDef::constant(0x1600, DataType::U32, "Outputs")
        .sub(3)
        .default(mapped(0x7000, 3, 16)),
    EntryDef::constant(0x1600, DataType::U32, "Outputs")
        .sub(4)
        .default(mapped(0x7000, 4, 16)),
    EntryDef::constant(0x1A00, DataType::U8, "Inputs").default(4),
    EntryDef::constant(0x1A00, DataType::U32, "Inputs")
        .sub(1)
        .default(mapped(0x6000, 1, 16)),
    EntryDef::constant(0x1A00, DataType::U32, "Inputs")
        .sub(2)
        .default(mapped(0x6000, 2, 16)),
    EntryDef::constant(0x1A00, DataType::U32, "Inputs")
        .sub(3)
        .default(mapped(0x6000, 3, 16)),
    EntryDef::constant(0x1A00, DataType::U32, "Inputs")
        .sub(4)
        .default(mapped(0x6000, 4, 16)),
];

/// An analog terminal with four outputs and four inputs of 16 bits, a mailbox, and PDOs that cannot be changed.
///
/// # Errors
/// An object that is not as the tables here have it.
pub fn analog_terminal(identity: Identity) -> Result<SubDeviceConfig, AbortCode> {
    let mut objects = ObjectStore::new();
    let built = |_| AbortCode::INTERNAL_INCOMPATIBLE;
    objects
        .add(0x1000..=0x1FFF, 0, &[COMMUNICATION, ANALOG_PDOS])
        .map_err(built)?;
    objects.add(0x2000..=0x9FFF, 0, &[ANALOG]).map_err(built)?;
    for (assign, pdo) in [(0x1C12, 0x1600_u16), (0x1C13, 0x1A00)] {
        objects.preset(assign, 0, &[1])?;
        objects.preset(assign, 1, &pdo.to_le_bytes())?;
    }
    let model = CoeModel {
        identity,
        device_type: 0x0000_1389,
        names: ["AIO-4-4", "Simulated analog terminal"],
        alias: 0,
        mailbox: 128,
        octets: [8; 2],
        room: ROOM,
        coe: 0x03,
        ports: 0x0033,
    };
    model.build(objects, Box::new(Terminal::default()))
}

/// A coupler: no mailbox, no process data, terminals behind it.
pub fn coupler(identity: Identity) -> SubDeviceConfig {
    let image = Image {
        pdi: 0x0001,
        identity,
        strings: &["COUPLER", "Simulated coupler"],
        general: General {
            order: 1,
            name: 2,
            ebus_ma: -2000,
            ports: 0x0031,
            ..General::default()
        },
        ..Image::default()
    };
    let mut config = SubDeviceConfig::new(eeprom(&image), ObjectStore::new(), Box::new(NoProcessData));
    config.eight_octets = false;
    config
}
