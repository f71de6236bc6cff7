//! The device file of a node, and the values that are written into the node besides those that the control needs itself.
//!
//! In:  `device_file`, `sdo` and the identity keys of a `[[bus.node]]`.
//! Out: the description, read once; writes that fit it. A mistake in a device file is noted at the line of the machine file
//! that names it, with its own place in the device file.

use super::document::Item;
use super::objects::{Identity, parse_object};
use super::question::Bound;
use super::section::Section;
use obd::device::{self, ConfigurationWrite, DeviceDescription, Object, TypeCode};
use obd::{Access, DataType};
use std::path::Path;
use toml::de::DeValue;

/// Mistakes of a device file that are told.
pub(super) const MISTAKES_TOLD: usize = 10;

/// Reads the device file; `Some(None)`: there is none. Its path is relative to the machine file, which is in `folder`; left out:
/// `usual`.
pub(super) fn file(
    section: &mut Section<'_, '_>,
    folder: &Path,
    cycle_us: Option<u32>,
    usual: Option<&Path>,
) -> Option<Option<DeviceDescription>> {
    let path = match (section.optional("device_file"), usual) {
        (Some(item), _) => folder.join(item.text(&section.key("device_file"))?),
        (None, Some(usual)) => usual.to_owned(),
        (None, None) => return Some(None),
    };
    let octets = match files::read(&path, files::read::TEXT_MAX) {
        Ok(octets) => octets,
        Err(error) => {
            return section.refused("device_file", format!("cannot be read: {error}"));
        }
    };
    let description = match device::parse(&path.display().to_string(), &octets) {
        Ok(description) => description,
        Err(errors) => {
            for line in errors.lines().take(MISTAKES_TOLD) {
                let rule = format!("is no device description that can be used: {line}");
                section.wrong("device_file", rule);
            }
            let more = (errors.mistakes.len() + errors.more).saturating_sub(MISTAKES_TOLD);
            if more > 0 {
                section.wrong("device_file", format!("has {more} more mistakes"));
            }
            return None;
        }
    };
    let (least, most) = (description.features.cycle_us_min, description.features.cycle_us_max);
    let within =
        |cycle_us: u32| least.is_none_or(|least| least <= cycle_us) && most.is_none_or(|most| cycle_us <= most);
    if let Some(cycle_us) = cycle_us.filter(|cycle_us| !within(*cycle_us)) {
        let side = |limit: Option<u32>| limit.map_or_else(|| "any".to_owned(), |limit| limit.to_string());
        let (least, most) = (side(least), side(most));
        let rule = format!("describes a device for cycles from {least} to {most} us, machine.cycle_us is {cycle_us}");
        return section.refused("device_file", rule);
    }
    Some(Some(description))
}

/// What the node must say it is: the keys, and what they leave out from the device file. The revision is only checked where the
/// machine file asks for it: a newer one is no other device.
/// What neither of them says is `usual`.
pub(super) fn identity(
    section: &mut Section<'_, '_>,
    device: Option<&DeviceDescription>,
    usual: Identity,
) -> Option<Identity> {
    let file = device.map(|device| &device.identity);
    let device_type = number(section, "device_type", device, file.and_then(|file| file.device_type));
    let vendor_id = number(section, "vendor_id", device, file.and_then(|file| file.vendor_id));
    let product_code = number(section, "product_code", device, file.and_then(|file| file.product_code));
    let (revision, serial) = (
        number(section, "revision", None, None),
        number(section, "serial", None, None),
    );
    Some(Identity {
        device_type: device_type?.or(usual.device_type),
        vendor_id: vendor_id?.or(usual.vendor_id),
        product_code: product_code?.or(usual.product_code),
        revision: revision?.or(usual.revision),
        serial: serial?.or(usual.serial),
    })
}

fn number(
    section: &mut Section<'_, '_>,
    key: &'static str,
    device: Option<&DeviceDescription>,
    in_file: Option<u32>,
) -> Option<Option<u32>> {
    let Some(number) = section.maybe(key, |item, path| item.integer(path, 0..=u32::MAX))? else {
        return Some(in_file);
    };
    if let (Some(device), Some(other)) = (device, in_file.filter(|other| *other != number)) {
        return section.refused(key, format!("must be what {} says: 0x{other:08X}", device.file));
    }
    Some(Some(number))
}

/// `sdo = [{ object = "0x2010:3", value = 5, bits = 16 }]`, behind what is `usual` of other objects.
pub(super) fn writes(
    section: &mut Section<'_, '_>,
    device: Option<&DeviceDescription>,
    usual: &[ConfigurationWrite],
    is_ours: IsOurs,
) -> Option<Vec<ConfigurationWrite>> {
    let written = section
        .optional("sdo")
        .is_some_and(|item| item.value.get_ref().as_array().is_none());
    let writes = section.tables("sdo", |table, above: &[ConfigurationWrite]| {
        let write = write(table, device, is_ours)?;
        if above
            .iter()
            .any(|other| (other.index, other.sub) == (write.index, write.sub))
        {
            return table.refused("object", "is written by an entry above");
        }
        Some(write)
    });
    let writes = writes.filter(|_| !written)?;
    let at = |write: &ConfigurationWrite| (write.index, write.sub);
    let others = usual
        .iter()
        .filter(|usual| writes.iter().all(|write| at(write) != at(usual)));
    Some(others.chain(&writes).cloned().collect())
}

/// Whether the control sets an object itself.
pub(super) type IsOurs = fn(u16, u8) -> bool;

fn write(
    table: &mut Section<'_, '_>,
    device: Option<&DeviceDescription>,
    is_ours: IsOurs,
) -> Option<ConfigurationWrite> {
    let object = table.required("object", "an object, like \"0x2010:3\"");
    let value = table.required("value", "a number");
    let bits: Option<Option<u16>> = table.maybe("bits", |item, path| item.integer(path, 8..=64));
    let text = object?.text(&table.key("object"))?;
    let Some((index, sub)) = parse_object(text).filter(|(index, _)| *index >= 0x1000) else {
        return table.refused("object", "must be an object, like \"0x2010:3\" or \"0x6065\"");
    };
    if is_ours(index, sub) {
        return table.refused("object", "is set by the control from the other keys of this file");
    }
    let described = match device.map(|device| (device, device.object(index, sub))) {
        None => None,
        Some((_, Some(object))) => Some(object),
        Some((device, None)) => {
            return table.refused("object", format!("does not stand in {}", device.file));
        }
    };
    if let Some(object) = described.filter(|object| !object.access.is_none_or(Access::writable)) {
        return table.refused("object", format!("cannot be written: {} is read only", object.name));
    }
    let own_bits = described.and_then(Object::bits);
    let bits = match (bits?, own_bits) {
        (Some(bits), Some(own)) if bits != own => {
            let rule = format!("must be {own}, the length that the device file gives it");
            return table.refused("bits", rule);
        }
        (Some(bits), _) if !bits.is_multiple_of(8) => {
            return table.refused("bits", "must be whole octets");
        }
        (Some(bits), _) | (None, Some(bits)) => bits,
        (None, None) => {
            let rule = "is missing: the length of the object, which no device file tells";
            return table.refused("bits", rule);
        }
    };
    let octets = octets(value?, &table.key("value"), bits, described)?;
    Some(ConfigurationWrite {
        index,
        sub,
        value: octets,
    })
}

/// The value as it stands on the wire.
fn octets(item: Item<'_, '_>, key: &str, bits: u16, described: Option<&Object>) -> Option<Vec<u8>> {
    let real = described.and_then(|object| object.data_type).and_then(TypeCode::known);
    let real = real.filter(|real| matches!(real, DataType::Real32 | DataType::Real64));
    if matches!(item.value.get_ref(), DeValue::Float(_)) || real.is_some() {
        let number = item.number(key, Bound::Size(f64::MAX))?;
        return match real {
            Some(DataType::Real64) => Some(number.to_le_bytes().to_vec()),
            Some(_) => Some((number as f32).to_le_bytes().to_vec()),
            None => item.refused(key, "must be an integer: no device file says that it is a real number"),
        };
    }
    // Signed or not is all the same to the octets.
    let (least, most) = match bits {
        64 => (i64::MIN, i64::MAX),
        bits => (-(1 << (bits - 1)), (1 << bits) - 1),
    };
    let limit = |value: Option<&device::Value>| {
        value
            .and_then(device::Value::integer)
            .and_then(|value| i64::try_from(value).ok())
    };
    let least = limit(described.and_then(|object| object.low.as_ref())).unwrap_or(least);
    let most = limit(described.and_then(|object| object.high.as_ref())).unwrap_or(most);
    let number = item.integer(key, least..=most)?;
    Some(number.to_le_bytes()[..usize::from(bits / 8)].to_vec())
}
