//! EDS and DCF: sections of `key=value` lines.
//!
//! In:  the text. Out: the description; mistakes in the [`Log`]. Sections and keys are compared without case; those that are
//! not known are skipped.

use super::description::check_limits;
use super::error::Log;
use super::value::{TypeCode, Value, either_direction, integer};
use super::{DeviceDescription, DeviceIdentity, Features, Format, Object};
use crate::{Access, DataType, PdoAccess};
use std::collections::BTreeMap;
use std::string::{String, ToString};
use std::vec::Vec;

/// A value and the octet of the text where it starts.
#[derive(Clone, Copy)]
struct Entry<'t> {
    text: &'t str,
    at: usize,
}

/// A section by its keys in lower case.
struct Section<'t> {
    at: usize,
    entries: BTreeMap<String, Entry<'t>>,
}

/// Sections by their names in lower case.
type Sections<'t> = BTreeMap<String, Section<'t>>;

pub(super) fn read(text: &str, log: &mut Log<'_>) -> Option<DeviceDescription> {
    let sections = sections(text, log);
    let head = |section: &str, key: &str| {
        sections
            .get(section)
            .and_then(|section| section.entries.get(key))
            .copied()
    };
    let name = |key| head("deviceinfo", key).map_or(String::new(), |entry| entry.text.to_string());
    let mut number = |section: &str, key: &str, most: u32| {
        let entry = head(section, key).filter(|entry| !entry.text.is_empty())?;
        let number = integer(entry.text).and_then(|number| u32::try_from(number).ok());
        let number = number.filter(|number| *number <= most);
        if number.is_none() {
            let rule = std::format!("expected an integer from 0 to {most}, decimal or with 0x");
            log.wrong(entry.at, std::format!("[{section}] {key}"), Some(entry.text), rule);
        }
        number
    };
    let identity = DeviceIdentity {
        vendor_name: name("vendorname"),
        product_name: name("productname"),
        device_type: None,
        vendor_id: number("deviceinfo", "vendornumber", u32::MAX),
        product_code: number("deviceinfo", "productnumber", u32::MAX),
        revision: number("deviceinfo", "revisionnumber", u32::MAX),
    };
    // The standard itself spells it with one m.
    let node_id = number("devicecomissioning", "nodeid", 239).or_else(|| number("devicecommissioning", "nodeid", 239));
    let features = Features {
        rpdo_channels: number("deviceinfo", "nrofrxpdo", 512).map(|channels| channels as u16),
        ..Features::default()
    };
    let mut reader = Reader {
        log,
        sections: &sections,
        objects: Vec::new(),
    };
    for (name, section) in &sections {
        if let Some(index) = hex(name, 4) {
            reader.object(index, name, section);
        }
    }
    if reader.objects.is_empty() {
        reader
            .log
            .wrong(text.len(), "", None, "expected at least one object, like [1000]");
    }
    reader.orphans();
    let mut objects = std::mem::take(&mut reader.objects);
    objects.sort_by_key(|object| (object.index, object.sub));
    Some(DeviceDescription {
        file: log.file.to_string(),
        format: Format::Text,
        identity,
        features,
        node_id: node_id.map(|id| id as u8).filter(|id| *id > 0),
        objects,
        notes: Vec::new(),
    })
}

/// Exactly so many hex digits.
fn hex(text: &str, digits: usize) -> Option<u16> {
    let valid = text.len() == digits && text.bytes().all(|digit| digit.is_ascii_hexdigit());
    valid.then(|| u16::from_str_radix(text, 16).ok()).flatten()
}

/// `1018sub1`: index and sub-index.
fn sub_section(name: &str) -> Option<(u16, u8)> {
    let (index, sub) = name.split_once("sub")?;
    let sub_valid = (1..=2).contains(&sub.len()) && sub.bytes().all(|digit| digit.is_ascii_hexdigit());
    Some((hex(index, 4)?, u8::from_str_radix(sub, 16).ok().filter(|_| sub_valid)?))
}

fn sections<'t>(text: &'t str, log: &mut Log<'_>) -> Sections<'t> {
    let mut sections: Sections<'t> = BTreeMap::new();
    let mut current: Option<String> = None;
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let start = at + (line.len() - line.trim_start().len());
        at += line.len();
        let line = line.trim();
        if line.is_empty() || line.starts_with(';') || line.starts_with('#') {
            continue;
        }
        if let Some(rest) = line.strip_prefix('[') {
            let Some(name) = rest.strip_suffix(']') else {
                log.wrong(start, "", Some(line), "expected a section, like [1018sub1]");
                current = None;
                continue;
            };
            let key = name.trim().to_ascii_lowercase();
            if sections.contains_key(&key) {
                log.wrong(
                    start,
                    std::format!("section [{name}]"),
                    None,
                    "stands twice in the file",
                );
                current = None;
                continue;
            }
            sections.insert(
                key.clone(),
                Section {
                    at: start,
                    entries: BTreeMap::new(),
                },
            );
            current = Some(key);
            continue;
        }
        let Some((key, value)) = line.split_once('=') else {
            log.wrong(start, "", Some(line), "expected key=value");
            continue;
        };
        // Keys of a section that could not be read are not looked at.
        let Some(section) = current.as_ref().and_then(|name| sections.get_mut(name)) else {
            continue;
        };
        let value_at = start + key.len() + 1 + (value.len() - value.trim_start().len());
        let entry = Entry {
            text: value.trim(),
            at: value_at,
        };
        if section.entries.insert(key.trim().to_ascii_lowercase(), entry).is_some() {
            log.wrong(
                start,
                std::format!("key {}", key.trim()),
                None,
                "stands twice in its section",
            );
        }
    }
    sections
}

struct Reader<'r, 'l, 's, 't> {
    log: &'r mut Log<'l>,
    sections: &'s Sections<'t>,
    objects: Vec<Object>,
}

impl Reader<'_, '_, '_, '_> {
    fn number(&mut self, section: &Section<'_>, key: &str, most: i128, what: &str) -> Option<u16> {
        let entry = section.entries.get(key).filter(|entry| !entry.text.is_empty())?;
        let number = integer(entry.text).filter(|number| (0..=most).contains(number));
        if number.is_none() {
            let rule = std::format!("expected an integer from 0 to {most}, decimal or with 0x");
            self.log
                .wrong(entry.at, std::format!("{what} {key}"), Some(entry.text), rule);
        }
        number.map(|number| number as u16)
    }

    fn object(&mut self, index: u16, name: &str, section: &Section<'_>) {
        let what = std::format!("object 0x{index:04X}");
        let kind = match section.entries.contains_key("objecttype") {
            true => self.number(section, "objecttype", 9, &what),
            // The standard's default: a plain variable.
            false => Some(7),
        };
        let compact = self
            .number(section, "compactsubobj", 254, &what)
            .filter(|count| *count > 0);
        match (kind, compact) {
            // Placeholders, definitions of types, and a kind that was refused above.
            (Some(0 | 5 | 6) | None, _) => {}
            (Some(8 | 9), Some(count)) => self.compact(index, name, section, count as u8),
            (Some(8 | 9), None) => {
                let prefix = std::format!("{name}sub");
                let subs = self
                    .sections
                    .range(prefix.clone()..)
                    .take_while(|(name, _)| name.starts_with(&prefix));
                for (sub_name, sub_section_) in subs {
                    if let Some((_, sub)) = sub_section(sub_name) {
                        self.variable(index, sub, sub_section_, Some(section));
                    }
                }
            }
            (Some(2 | 7), _) => self.variable(index, 0, section, None),
            (Some(_), _) => {
                if let Some(entry) = section.entries.get("objecttype") {
                    let subject = std::format!("{what} objecttype");
                    self.log
                        .wrong(entry.at, subject, Some(entry.text), "expected 0, 2, 5, 6, 7, 8 or 9");
                }
            }
        }
    }

    /// Sub-indices without the section of their object; of each object the first.
    fn orphans(&mut self) {
        let mut last = None;
        for (name, section) in self.sections {
            if let Some((index, sub)) = sub_section(name)
                && !self.sections.contains_key(&name[..4])
                && last.replace(index) != Some(index)
            {
                let rule = std::format!("expected a section [{index:04X}] for the object itself");
                self.log
                    .wrong(section.at, std::format!("object 0x{index:04X}:{sub}"), None, rule);
            }
        }
    }

    fn name(section: &Section<'_>) -> String {
        section
            .entries
            .get("parametername")
            .map_or(String::new(), |entry| entry.text.to_string())
    }

    fn variable(&mut self, index: u16, sub: u8, section: &Section<'_>, of: Option<&Section<'_>>) {
        let what = match of {
            None => std::format!("object 0x{index:04X}"),
            Some(_) => std::format!("object 0x{index:04X}:{sub}"),
        };
        let name = match of {
            None => Self::name(section),
            Some(of) => std::format!("{}.{}", Self::name(of), Self::name(section)),
        };
        let Some(object) = self.described(index, sub, section, name, &what) else {
            return;
        };
        let place = |key: &str| section.entries.get(file_key(key)).map_or(section.at, |entry| entry.at);
        check_limits(self.log, &object, &what, place);
        self.objects.push(object);
    }

    /// What a section says of a value.
    fn described(&mut self, index: u16, sub: u8, section: &Section<'_>, name: String, what: &str) -> Option<Object> {
        let data_type = if section
            .entries
            .get("datatype")
            .is_none_or(|entry| entry.text.is_empty())
        {
            self.log
                .wrong(section.at, std::format!("{what} datatype"), None, "is missing");
            return None;
        } else {
            Some(TypeCode(self.number(section, "datatype", 0xFFFF, what)?))
        };
        let (access, direction) = self.access(section, what);
        let pdo = match self.number(section, "pdomapping", 1, what) {
            Some(1) => direction.unwrap_or_else(|| either_direction(access)),
            _ => PdoAccess::No,
        };
        let mut value = |key: &str| self.value(section, key, data_type, what);
        Some(Object {
            index,
            sub,
            name,
            data_type,
            access,
            pdo,
            default: value("defaultvalue"),
            actual: value("parametervalue"),
            low: value("lowlimit"),
            high: value("highlimit"),
            line: self.log.line(section.at),
        })
    }

    /// Access by SDO, and the direction of process data where it says one.
    fn access(&mut self, section: &Section<'_>, what: &str) -> (Option<Access>, Option<PdoAccess>) {
        let Some(entry) = section.entries.get("accesstype").filter(|entry| !entry.text.is_empty()) else {
            return (None, None);
        };
        match entry.text.to_ascii_lowercase().as_str() {
            "const" => (Some(Access::Const), None),
            "ro" => (Some(Access::ReadOnly), None),
            "wo" => (Some(Access::WriteOnly), None),
            "rw" => (Some(Access::ReadWrite), None),
            "rwr" => (Some(Access::ReadWrite), Some(PdoAccess::Tpdo)),
            "rww" => (Some(Access::ReadWrite), Some(PdoAccess::Rpdo)),
            _ => {
                let rule = "expected const, ro, wo, rw, rwr or rww";
                self.log
                    .wrong(entry.at, std::format!("{what} accesstype"), Some(entry.text), rule);
                (None, None)
            }
        }
    }

    fn value(&mut self, section: &Section<'_>, key: &str, data_type: Option<TypeCode>, what: &str) -> Option<Value> {
        let entry = section.entries.get(key).filter(|entry| !entry.text.is_empty())?;
        let subject = || std::format!("{what} {key}");
        match Value::parse(entry.text, data_type) {
            Ok(value) => Some(value),
            Err(rule) if key == "defaultvalue" && Value::may_be_any_text(data_type) => {
                self.log.odd(entry.at, subject(), Some(entry.text), rule);
                Some(Value::unknown(entry.text))
            }
            Err(rule) => {
                self.log.wrong(entry.at, subject(), Some(entry.text), rule);
                None
            }
        }
    }

    /// An array whose entries share one section; names and values may stand in sections of their own.
    fn compact(&mut self, index: u16, name: &str, section: &Section<'_>, count: u8) {
        let what = std::format!("object 0x{index:04X}");
        let of = Self::name(section);
        let Some(shared) = self.described(index, 1, section, String::new(), &what) else {
            return;
        };
        check_limits(self.log, &shared, &what, |key| {
            section.entries.get(file_key(key)).map_or(section.at, |entry| entry.at)
        });
        let u8_type = Some(TypeCode(DataType::U8.code()));
        self.objects.push(Object {
            sub: 0,
            name: std::format!("{of}.NumberOfEntries"),
            data_type: u8_type,
            access: Some(Access::ReadOnly),
            pdo: PdoAccess::No,
            default: Value::parse(&count.to_string(), u8_type).ok(),
            actual: None,
            low: None,
            high: None,
            ..shared.clone()
        });
        let sections = self.sections;
        let (names, values) = (
            sections.get(&std::format!("{name}name")),
            sections.get(&std::format!("{name}value")),
        );
        for sub in 1..=count {
            let key = sub.to_string();
            let own = names
                .and_then(|names| names.entries.get(&key))
                .map(|entry| entry.text.to_string());
            let mut object = Object {
                sub,
                name: std::format!("{of}.{}", own.unwrap_or_else(|| std::format!("{of}{sub}"))),
                ..shared.clone()
            };
            let what = std::format!("{what}:{sub}");
            if let Some(values) = values
                && let Some(actual) = self.value(values, &key, shared.data_type, &what)
            {
                object.actual = Some(actual);
                check_limits(self.log, &object, &what, |_| {
                    values.entries.get(&key).map_or(values.at, |entry| entry.at)
                });
            }
            self.objects.push(object);
        }
    }
}

/// The key that stands for an attribute of the XML formats.
fn file_key(attribute: &str) -> &'static str {
    match attribute {
        "defaultValue" => "defaultvalue",
        "actualValue" => "parametervalue",
        "lowLimit" => "lowlimit",
        _ => "highlimit",
    }
}
