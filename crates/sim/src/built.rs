//! How a simulated drive was built: what its profile says of it, and the objects of its maker.
//!
//! In:  a node of the machine file, with the profile of its drive.
//! Out: the quirks of its device, the lines of its object dictionary.

use cia402::device::{DRIVE_OBJECTS, DRIVE_OBJECTS_WITH_DEMAND, Quirks};
use cia402::profile::{axis_of, object_of};
use config::{FactorGroup, Mapped, Node};
use obd::{Access, DataType, EntryDef, PdoAccess};

/// Room for objects of makers that the machine file names, each with a number of entries.
pub(super) const MAKER_ENTRIES: usize = 128;
/// Below are objects of the network.
const MAKERS_BEGIN: u16 = 0x2000;

/// Whether it takes its target in the position demand: a machine file that maps that as the target has drives that do.
fn takes_target_in_demand(node: &Node) -> bool {
    node.outputs.iter().any(|object| axis_of(object.index).1 == 0x6062)
}

pub(super) fn quirks(node: &Node, group: &FactorGroup) -> Quirks {
    let mut quirks = Quirks {
        target_in_demand: takes_target_in_demand(node),
        ..Quirks::default()
    };
    // The machine file tells both encoders as they are.
    if let (Some(velocity), Some(position)) = (group.velocity_encoder, group.encoder) {
        quirks.encoders = [velocity, position];
    }
    let Some(drive) = &node.drive else { return quirks };
    quirks.home_offset_adds = drive.home_offset_adds;
    quirks.stays_in_quick_stop = drive.stays_in_quick_stop;
    let bits = drive.input_bits;
    quirks.input_bits = [bits.limits[0], bits.limits[1], bits.home];
    if let Some(sto) = drive.sto.filter(|sto| sto.object == (0x60FD, 0)) {
        quirks.sto = (sto.bit as u8, sto.active);
    }
    if !drive.homing_methods.is_empty() {
        let bits = drive
            .homing_methods
            .iter()
            .filter_map(|method| u32::try_from(*method).ok());
        quirks.homing_methods = bits.fold(0, |all, bit| all | 1_u64.checked_shl(bit).unwrap_or(0));
    }
    quirks
}

/// The lines of its dictionary, for so many axes. Those that are made for it are kept as long as the process lives, once for each drive.
pub(super) fn objects(node: &Node, axes: u8) -> &'static [EntryDef] {
    let table = match takes_target_in_demand(node) {
        true => DRIVE_OBJECTS_WITH_DEMAND,
        false => DRIVE_OBJECTS,
    };
    let of_axis = |axis| {
        table.iter().map(move |line| EntryDef {
            index: object_of(axis, line.index),
            ..*line
        })
    };
    let mut lines: Vec<EntryDef> = (0..axes).flat_map(of_axis).collect();
    if let Some(drive) = &node.drive {
        for line in &mut lines {
            let object = Mapped {
                index: line.index,
                sub: line.sub_first,
                bits: 0,
            };
            let [takes, sends] = [&drive.outputs, &drive.inputs].map(|limits| limits.takes(&object));
            line.pdo = match line.pdo {
                PdoAccess::Rpdo if !takes => PdoAccess::No,
                PdoAccess::Tpdo if !sends => PdoAccess::No,
                other => other,
            };
            // The device works with the value; nobody can write it.
            if drive.without.contains(&(axis_of(object.index).1, object.sub)) {
                line.access = Access::ReadOnly;
                line.pdo = PdoAccess::No;
            }
            if let (0x6502, Some(modes)) = (axis_of(line.index).1, drive.modes) {
                *line = line.default(modes.into());
            }
        }
    }
    let written = node
        .writes
        .iter()
        .map(|write| (write.index, write.sub, 8 * write.value.len()));
    let mapped = node.inputs.iter().chain(&node.outputs);
    let mapped = mapped.map(|object| (object.index, object.sub, usize::from(object.bits)));
    for (index, sub, bits) in written.chain(mapped) {
        let is_there = |line: &EntryDef| line.index == index && (line.sub_first..=line.sub_last).contains(&sub);
        if index < MAKERS_BEGIN || lines.iter().any(is_there) {
            continue;
        }
        let data_type = match bits {
            8 => DataType::U8,
            16 => DataType::U16,
            32 => DataType::U32,
            _ => DataType::U64,
        };
        lines.push(EntryDef::rw(index, data_type, "Object of the maker").sub(sub).any_pdo());
    }
    match lines == table {
        true => table,
        false => lines.leak(),
    }
}
