//! What a device says of itself, whatever the format of its file.

use super::error::{DeviceMistake, Log};
use super::value::{TypeCode, Value};
use crate::mapping::MappingEntry;
use crate::{Access, PdoAccess};
use std::string::{String, ToString};
use std::vec::Vec;

/// Where a description came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// XDD or XDC.
    Xml,
    /// EDS or DCF.
    Text,
}

/// What a device says of itself in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceDescription {
    /// The file as it was named.
    pub file: String,
    /// Where the description came from.
    pub format: Format,
    /// What the device is.
    pub identity: DeviceIdentity,
    /// What it can do.
    pub features: Features,
    /// Node id that a configured file (XDC, DCF) was made for.
    pub node_id: Option<u8>,
    /// Every object that has a value, in the order of index and sub-index.
    pub objects: Vec<Object>,
    /// What is odd in the file but changes nothing that is used.
    pub notes: Vec<DeviceMistake>,
}

/// What the device is. Numbers come from the default values of 0x1000 and 0x1018, names from the head of the file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceIdentity {
    /// Name of the vendor.
    pub vendor_name: String,
    /// Name of the product.
    pub product_name: String,
    /// Object 0x1000.
    pub device_type: Option<u32>,
    /// Object 0x1018/1.
    pub vendor_id: Option<u32>,
    /// Object 0x1018/2.
    pub product_code: Option<u32>,
    /// Object 0x1018/3.
    pub revision: Option<u32>,
}

/// What the device can do; `None`: its file does not say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Features {
    /// Object 0x1F82.
    pub feature_flags: Option<u32>,
    /// Shortest cycle, µs.
    pub cycle_us_min: Option<u32>,
    /// Longest cycle, µs.
    pub cycle_us_max: Option<u32>,
    /// Longest time from the end of the PReq to the PRes, ns (object 0x1F98/3).
    pub pres_latency_ns: Option<u32>,
    /// Shortest time from the SoC to the PReq, ns.
    pub soc_to_preq_ns: Option<u32>,
    /// Most octets of a PReq that it takes (object 0x1F98/2).
    pub preq_octets_max: Option<u16>,
    /// Most octets of a PRes that it sends (object 0x1F98/1).
    pub pres_octets_max: Option<u16>,
    /// Can be polled in one cycle of a round only.
    pub multiplexing: Option<bool>,
    /// Can send its PRes without a PReq.
    pub chaining: Option<bool>,
    /// Number of RPDOs.
    pub rpdo_channels: Option<u16>,
    /// Most objects in one RPDO.
    pub rpdo_objects: Option<u16>,
    /// Most objects in its TPDO.
    pub tpdo_objects: Option<u16>,
}

/// One value of the object dictionary of a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Index of the object.
    pub index: u16,
    /// Sub-index of the object.
    pub sub: u8,
    /// Name; of a sub-index with that of the object in front.
    pub name: String,
    /// Data type; `None`: one that only the file defines.
    pub data_type: Option<TypeCode>,
    /// SDO access; `None`: the file does not say.
    pub access: Option<Access>,
    /// In which PDOs it may be mapped.
    pub pdo: PdoAccess,
    /// Value after a reset to defaults.
    pub default: Option<Value>,
    /// Value that a configured file (XDC, DCF) wants.
    pub actual: Option<Value>,
    /// Least value that may be written.
    pub low: Option<Value>,
    /// Greatest value that may be written.
    pub high: Option<Value>,
    /// Line of the file.
    pub line: u32,
}

impl Object {
    /// Length in bits; `None`: variable or not known.
    pub fn bits(&self) -> Option<u16> {
        self.data_type.and_then(TypeCode::bits)
    }

    /// Octets of the wanted value, else of the default one, for the device as node `node`.
    pub fn octets(&self, node: u8) -> Option<Vec<u8>> {
        self.actual.as_ref().or(self.default.as_ref())?.octets(node)
    }

    fn unsigned(&self) -> Option<u64> {
        let value = self.actual.as_ref().or(self.default.as_ref())?;
        value.integer().and_then(|value| u64::try_from(value).ok())
    }
}

impl DeviceDescription {
    /// The object of this index and sub-index.
    pub fn object(&self, index: u16, sub: u8) -> Option<&Object> {
        let found = self
            .objects
            .binary_search_by_key(&(index, sub), |object| (object.index, object.sub));
        found.ok().map(|at| &self.objects[at])
    }

    /// Objects of one index.
    pub fn subs(&self, index: u16) -> &[Object] {
        let from = self.objects.partition_point(|object| object.index < index);
        let to = self.objects.partition_point(|object| object.index <= index);
        &self.objects[from..to]
    }

    /// What the file maps in 0x1600 + channel or 0x1A00 + channel; empty where it maps nothing.
    pub fn mapping(&self, mapping_index: u16) -> Vec<MappingEntry> {
        let value = |sub| self.object(mapping_index, sub).and_then(Object::unsigned);
        let count = value(0).unwrap_or(0).min(254) as u8;
        let entries = (1..=count).map(|sub| value(sub).filter(|entry| *entry != 0));
        // One entry that is not known makes all the rest worthless.
        let entries: Option<Vec<_>> = entries.map(|entry| entry.map(MappingEntry::from_u64)).collect();
        entries.unwrap_or_default()
    }

    /// Numbers that stand in the dictionary as well as, or instead of, in the head of the file.
    pub(super) fn complete(&mut self) {
        let number = |index, sub| {
            let object = self.object(index, sub)?;
            let value = object.default.as_ref().or(object.actual.as_ref())?;
            value.integer().and_then(|value| u32::try_from(value).ok())
        };
        let (device_type, vendor_id) = (number(0x1000, 0), number(0x1018, 1));
        let (product_code, revision) = (number(0x1018, 2), number(0x1018, 3));
        let (flags, latency) = (number(0x1F82, 0), number(0x1F98, 3));
        let octets = |sub| number(0x1F98, sub).and_then(|octets| u16::try_from(octets).ok());
        let (transmit, receive) = (octets(1), octets(2));
        let identity = &mut self.identity;
        identity.device_type = device_type.or(identity.device_type);
        identity.vendor_id = vendor_id.or(identity.vendor_id);
        identity.product_code = product_code.or(identity.product_code);
        identity.revision = revision.or(identity.revision);
        let features = &mut self.features;
        features.feature_flags = flags;
        features.pres_latency_ns = latency.filter(|latency| *latency > 0);
        features.pres_octets_max = transmit;
        features.preq_octets_max = receive;
    }
}

/// Limits that exclude each other or a wanted value are mistakes. A default outside the limits is odd, but never written.
pub(super) fn check_limits(log: &mut Log<'_>, object: &Object, what: &str, place: impl Fn(&str) -> usize) {
    let integer = |value: &Option<Value>| value.as_ref().and_then(Value::integer);
    let (low, high) = (integer(&object.low), integer(&object.high));
    if let (Some(low), Some(high)) = (low, high)
        && low > high
    {
        let rule = std::format!("expected at least the low limit {low}");
        let got = object.high.as_ref().map(|high| high.text.as_str());
        return log.wrong(place("highLimit"), std::format!("{what} highLimit"), got, rule);
    }
    let outside = |value: i128| low.is_some_and(|low| value < low) || high.is_some_and(|high| value > high);
    let rule = || {
        let side = |limit: Option<i128>| limit.map_or_else(|| "any".to_string(), |limit| limit.to_string());
        std::format!(
            "expected a value within the limits, from {} to {}",
            side(low),
            side(high)
        )
    };
    if let Some(actual) = object
        .actual
        .as_ref()
        .filter(|value| value.integer().is_some_and(outside))
    {
        log.wrong(
            place("actualValue"),
            std::format!("{what} actualValue"),
            Some(&actual.text),
            rule(),
        );
    }
    if let Some(default) = object
        .default
        .as_ref()
        .filter(|value| value.integer().is_some_and(outside))
    {
        log.odd(
            place("defaultValue"),
            std::format!("{what} defaultValue"),
            Some(&default.text),
            rule(),
        );
    }
}
