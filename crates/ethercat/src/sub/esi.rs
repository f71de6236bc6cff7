//! The simulated devices as their maker would describe them: an ESI file, out of their own EEPROMs and objects.

use super::models::{self, DriveModel};
use super::{IdealMotor, ObjectStore, SubDeviceConfig};
use crate::wire::sii::{Identity, PdoEntry, Sii, Usage, category};
use obd::AbortCode;
use std::boxed::Box;
use std::fmt::{self, Write as _};
use std::string::String;
use std::vec;
use std::vec::Vec;

/// Maker of the simulated devices.
const VENDOR: u32 = 0x0A1B;
/// The digital terminal of the file.
pub const TERMINAL: Identity = Identity {
    vendor: VENDOR,
    product: 0x0001_0808,
    revision: 1,
    serial: 0,
};

/// The text of the file: a servo drive of one axis, a digital terminal.
///
/// # Errors
/// An object that is not as the models have it.
pub fn text() -> Result<String, AbortCode> {
    let drive = DriveModel::default().build(vec![Box::new(IdealMotor::default())])?;
    let terminal = models::digital_terminal(TERMINAL);
    let mut out = String::new();
    // Writing into a text does not fail.
    let _ = write_file(&mut out, &[drive, terminal]);
    Ok(out)
}

fn write_file(out: &mut String, devices: &[SubDeviceConfig]) -> fmt::Result {
    writeln!(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>")?;
    writeln!(
        out,
        "<!-- Simulated devices of isocnc. Made of their EEPROMs and objects; not written by hand. -->"
    )?;
    writeln!(out, "<EtherCATInfo Version=\"1.6\">")?;
    writeln!(
        out,
        "  <Vendor>\n    <Id>#x{VENDOR:08X}</Id>\n    <Name>isocnc</Name>\n  </Vendor>"
    )?;
    writeln!(out, "  <Descriptions>\n    <Devices>")?;
    for device in devices {
        write_device(out, device)?;
    }
    writeln!(out, "    </Devices>\n  </Descriptions>\n</EtherCATInfo>")
}

fn write_device(out: &mut String, device: &SubDeviceConfig) -> fmt::Result {
    let Ok(sii) = Sii::parse(&device.eeprom) else {
        return Ok(());
    };
    let Identity { product, revision, .. } = sii.identity();
    let general = sii.general().unwrap_or_default();
    let string = |number: u8| String::from_utf8_lossy(sii.string(number).unwrap_or_default()).into_owned();
    let (order, name) = (string(general.order), string(general.name));
    let has_coe = sii.mailboxes().protocols != 0;
    writeln!(
        out,
        "      <Device Physics=\"{}\">",
        if general.ports & 0xF == 1 { "YY" } else { "KK" }
    )?;
    writeln!(
        out,
        "        <Type ProductCode=\"#x{product:08X}\" RevisionNo=\"#x{revision:08X}\">{order}</Type>"
    )?;
    writeln!(out, "        <Name LcId=\"1033\">{name}</Name>")?;
    for usage in sii.fmmus() {
        writeln!(
            out,
            "        <Fmmu>{}</Fmmu>",
            if *usage == 1 { "Outputs" } else { "Inputs" }
        )?;
    }
    let managers: Vec<_> = sii.sync_managers().collect();
    for (number, manager) in managers.iter().enumerate() {
        let next = managers.get(number + 1).map(|next| (next.start - manager.start) / 3);
        let (size, most) = match manager.usage {
            Usage::MailboxOut | Usage::MailboxIn => (manager.length, manager.length),
            _ if !has_coe => (manager.length, manager.length),
            _ => (manager.length, next.unwrap_or(0x0100)),
        };
        let words = match manager.usage {
            Usage::MailboxOut => "MBoxOut",
            Usage::MailboxIn => "MBoxIn",
            Usage::Outputs => "Outputs",
            _ => "Inputs",
        };
        writeln!(
            out,
            "        <Sm MaxSize=\"{most}\" DefaultSize=\"{size}\" StartAddress=\"#x{:04X}\" ControlByte=\"#x{:02X}\" Enable=\"1\">{words}</Sm>",
            manager.start, manager.control
        )?;
    }
    for (to_device, tag, assign, kind, usage) in [
        (true, "RxPdo", 0x1C12, category::RX_PDO, Usage::Outputs),
        (false, "TxPdo", 0x1C13, category::TX_PDO, Usage::Inputs),
    ] {
        let number = managers.iter().position(|manager| manager.usage == usage).unwrap_or(0);
        for (index, is_fixed, entries) in pdos(device, &sii, assign, kind) {
            let fixed = if is_fixed { " Fixed=\"1\"" } else { "" };
            let direction = if to_device { "Outputs" } else { "Inputs" };
            writeln!(out, "        <{tag} Sm=\"{number}\"{fixed}>")?;
            writeln!(
                out,
                "          <Index>#x{index:04X}</Index>\n          <Name>{direction}</Name>"
            )?;
            for entry in entries {
                write_entry(out, &device.objects, &entry)?;
            }
            writeln!(out, "        </{tag}>")?;
        }
    }
    if has_coe {
        writeln!(out, "        <Mailbox DataLinkLayer=\"1\">")?;
        writeln!(
            out,
            "          <CoE SdoInfo=\"1\" PdoAssign=\"1\" PdoConfig=\"1\" CompleteAccess=\"1\">"
        )?;
        writeln!(
            out,
            "            <InitCmd>\n              <Transition>PS</Transition>\n              <Index>#x6060</Index>"
        )?;
        writeln!(
            out,
            "              <SubIndex>0</SubIndex>\n              <Data>08</Data>"
        )?;
        writeln!(
            out,
            "              <Comment>Cyclic synchronous position</Comment>\n            </InitCmd>"
        )?;
        writeln!(out, "          </CoE>\n        </Mailbox>")?;
    }
    if device.clock.is_some() {
        writeln!(out, "        <Dc>")?;
        for (name, activate) in [("DC", 0x0300), ("Synchron", 0)] {
            writeln!(out, "          <OpMode>\n            <Name>{name}</Name>")?;
            writeln!(out, "            <AssignActivate>#x{activate:04X}</AssignActivate>")?;
            writeln!(out, "            <CycleTimeSync0 Factor=\"1\">0</CycleTimeSync0>")?;
            writeln!(
                out,
                "            <ShiftTimeSync0>0</ShiftTimeSync0>\n          </OpMode>"
            )?;
        }
        writeln!(out, "        </Dc>")?;
    }
    writeln!(out, "      </Device>")
}

/// PDOs that are assigned: by the objects of the device, or by its EEPROM.
fn pdos(device: &SubDeviceConfig, sii: &Sii<'_>, assign: u16, kind: u16) -> Vec<(u16, bool, Vec<PdoEntry>)> {
    let objects = &device.objects;
    let number = |index: u16, sub: u8| {
        let octets = objects.read(index, sub).ok()?;
        Some(
            octets
                .iter()
                .rev()
                .fold(0_u32, |value, octet| value << 8 | u32::from(*octet)),
        )
    };
    let Some(count) = number(assign, 0) else {
        let of_eeprom = sii.pdos(kind).map(|pdo| (pdo.index, true, pdo.entries().collect()));
        return of_eeprom.collect();
    };
    let assigned = (1..=count as u8).filter_map(|sub| number(assign, sub));
    assigned
        .map(|pdo| {
            let pdo = pdo as u16;
            let entries = (1..=number(pdo, 0).unwrap_or(0) as u8).filter_map(|sub| number(pdo, sub));
            let entry = |word: u32| PdoEntry {
                index: (word >> 16) as u16,
                sub: (word >> 8) as u8,
                bits: word as u8,
                ..PdoEntry::default()
            };
            (pdo, false, entries.map(entry).collect())
        })
        .collect()
}

fn write_entry(out: &mut String, objects: &ObjectStore, entry: &PdoEntry) -> fmt::Result {
    writeln!(out, "          <Entry>")?;
    writeln!(out, "            <Index>#x{:04X}</Index>", entry.index)?;
    if entry.index != 0 {
        writeln!(out, "            <SubIndex>{}</SubIndex>", entry.sub)?;
    }
    writeln!(out, "            <BitLen>{}</BitLen>", entry.bits)?;
    if entry.index != 0 {
        let name = objects.describe(entry.index, entry.sub).map_or("Channel", |of| of.name);
        let is_signed = matches!(entry.index & 0x07FF, 0x0060 | 0x0061 | 0x0064 | 0x007A);
        let kind = match (entry.bits, is_signed) {
            (1, _) => "BOOL",
            (8, true) => "SINT",
            (8, false) => "USINT",
            (16, _) => "UINT",
            (_, true) => "DINT",
            _ => "UDINT",
        };
        writeln!(
            out,
            "            <Name>{name}</Name>\n            <DataType>{kind}</DataType>"
        )?;
    }
    writeln!(out, "          </Entry>")
}
