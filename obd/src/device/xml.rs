//! XDD and XDC: `ISO15745ProfileContainer` with the bodies of device and communication profile.
//!
//! In:  the text. Out: the description; mistakes in the [`Log`]. Names are compared without their namespace; elements and
//! attributes that are not known are skipped, as the schema is extended by every edition.

use super::description::check_limits;
use super::error::Log;
use super::value::{TypeCode, Value, integer};
use super::{DeviceDescription, DeviceIdentity, Features, Format, Object};
use crate::{Access, DataType, PdoAccess};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::{BTreeMap, BTreeSet};
use std::string::{String, ToString};
use std::vec::Vec;

/// Most elements, comments and pieces of text.
const NODES_MAX: u32 = 1 << 20;
/// Deepest nesting; a description needs about ten levels.
const DEPTH_MAX: usize = 64;
/// Most attributes of one element, which are compared with each other.
const ATTRIBUTES_MAX: usize = 256;
/// Elements of a parameter that are looked at: every object may refer to the same one.
const PARTS_MAX: usize = 100;
/// Most declarations of namespaces: elements within copy those around them.
const NAMESPACES_MAX: usize = 1000;

pub(super) fn read(text: &str, log: &mut Log<'_>) -> Option<DeviceDescription> {
    let document = document(text, log)?;
    let root = document.root_element();
    if root.tag_name().name() != "ISO15745ProfileContainer" {
        let got = root.tag_name().name();
        let rule = match got {
            "EtherCATInfo" => "expected ISO15745ProfileContainer; this is an ESI file, of a device for EtherCAT",
            _ => "expected ISO15745ProfileContainer",
        };
        log.wrong(root.range().start, "root element", Some(got), rule);
        return None;
    }
    let elements: Vec<_> = root.descendants().filter(Node::is_element).collect();
    let named = |name: &str| {
        elements
            .iter()
            .copied()
            .filter(move |node| node.tag_name().name() == name)
            .collect::<Vec<_>>()
    };
    let mut reader = Reader {
        log,
        parameters: parameters(&named("parameter")),
        objects: Vec::new(),
    };
    let lists = [named("ObjectList"), named("CANopenObjectList")].concat();
    match lists[..] {
        [] => reader.log.wrong(
            root.range().start,
            "ObjectList",
            None,
            "is missing: the objects of the device",
        ),
        [list] => reader.object_list(list),
        [_, second, ..] => reader.log.wrong(
            second.range().start,
            "ObjectList",
            None,
            "expected one list of objects only",
        ),
    }
    reader.objects.sort_by_key(|object| (object.index, object.sub));
    let objects = std::mem::take(&mut reader.objects);
    let identity = reader.identity(named("DeviceIdentity").first().copied());
    let features = reader.features(&named("GeneralFeatures"), &named("CNFeatures"));
    let commissioning = [named("deviceCommissioning"), named("DeviceCommissioning")].concat();
    let node_id = commissioning
        .first()
        .and_then(|node| reader.number(*node, "nodeID", 1..=239));
    Some(DeviceDescription {
        file: reader.log.file.to_string(),
        format: Format::Xml,
        identity,
        features,
        node_id: node_id.map(|id| id as u8),
        objects,
        notes: Vec::new(),
    })
}

/// The elements of a text, unless it asks for more than the parser can give, or is no XML.
pub(super) fn document<'t>(text: &'t str, log: &mut Log<'_>) -> Option<Document<'t>> {
    if let Some((offset, rule)) = excess(text) {
        log.wrong(offset, "", None, rule);
        return None;
    }
    let options = ParsingOptions {
        nodes_limit: NODES_MAX,
        ..ParsingOptions::default()
    };
    match Document::parse_with_options(text, options) {
        Ok(document) => Some(document),
        Err(error) => {
            let place = error.pos();
            let line = text.split_inclusive('\n').take(place.row.saturating_sub(1) as usize);
            let start: usize = line.map(str::len).sum();
            let column = text[start..].char_indices().nth(place.col.saturating_sub(1) as usize);
            let offset = start + column.map_or(0, |(offset, _)| offset);
            log.wrong(offset, "", None, std::format!("expected XML: {error}"));
            None
        }
    }
}

/// Where a text asks for more than the parser can give in a time that is in proportion to its length, and what it may ask for.
///
/// Passes over the tags only, and takes no offence at anything: what is no XML, the parser says.
fn excess(text: &str) -> Option<(usize, String)> {
    if text.matches("xmlns").count() > NAMESPACES_MAX {
        return Some((
            0,
            std::format!("expected at most {NAMESPACES_MAX} declarations of namespaces"),
        ));
    }
    let mut depth = 0_usize;
    let mut at = 0;
    while let Some(open) = text[at..].find('<').map(|found| at + found) {
        let tag = &text[open..];
        let passed_over = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")];
        if let Some((_, end)) = passed_over.iter().find(|(begin, _)| tag.starts_with(begin)) {
            at = open + tag.find(end)? + end.len();
            continue;
        }
        let (mut attributes, mut quote, mut last) = (0, None, b'<');
        let mut end = tag.len();
        for (index, octet) in tag.bytes().enumerate() {
            match (quote, octet) {
                (None, b'>') => {
                    end = index + 1;
                    break;
                }
                (None, b'"' | b'\'') => {
                    attributes += 1;
                    quote = Some(octet);
                }
                (Some(open), _) if open == octet => quote = None,
                (None | Some(_), _) => {}
            }
            last = octet;
        }
        if attributes > ATTRIBUTES_MAX {
            return Some((
                open,
                std::format!("expected at most {ATTRIBUTES_MAX} attributes of an element"),
            ));
        }
        if tag.starts_with("</") {
            depth = depth.saturating_sub(1);
        } else if last != b'/' && !tag.starts_with("<!") {
            depth += 1;
            if depth > DEPTH_MAX {
                return Some((
                    open,
                    std::format!("expected at most {DEPTH_MAX} elements inside each other"),
                ));
            }
        }
        at = open + end;
    }
    None
}

/// `parameter` elements of the application process by their id.
fn parameters<'a, 'i>(elements: &[Node<'a, 'i>]) -> BTreeMap<&'a str, Node<'a, 'i>> {
    elements
        .iter()
        .filter_map(|element| Some((element.attribute("uniqueID")?, *element)))
        .collect()
}

/// Data type of a simple type of the application process.
fn simple_type(element: &str) -> Option<TypeCode> {
    let known = match element {
        "BOOL" => DataType::Bool,
        "SINT" => DataType::I8,
        "INT" => DataType::I16,
        "DINT" => DataType::I32,
        "LINT" => DataType::I64,
        "USINT" | "BYTE" | "CHAR" => DataType::U8,
        "UINT" | "WORD" => DataType::U16,
        "UDINT" | "DWORD" => DataType::U32,
        "ULINT" | "LWORD" => DataType::U64,
        "REAL" => DataType::Real32,
        "LREAL" => DataType::Real64,
        "STRING" => DataType::VisibleString,
        _ => return None,
    };
    Some(TypeCode(known.code()))
}

struct Reader<'r, 't, 'a, 'i> {
    log: &'r mut Log<'t>,
    parameters: BTreeMap<&'a str, Node<'a, 'i>>,
    objects: Vec<Object>,
}

/// Where an attribute's value stands.
fn value_at(node: Node<'_, '_>, attribute: &str) -> usize {
    node.attribute_node(attribute)
        .map_or(node.range().start, |attribute| attribute.range_value().start)
}

/// What an object is called in messages.
fn subject(index: u16, sub: Option<u8>) -> String {
    match sub {
        None => std::format!("object 0x{index:04X}"),
        Some(sub) => std::format!("object 0x{index:04X}:{sub}"),
    }
}

impl<'a, 'i> Reader<'_, '_, 'a, 'i> {
    /// An attribute of exactly so many hex digits.
    fn hex(&mut self, node: Node<'a, 'i>, attribute: &str, digits: usize, what: &str) -> Option<u16> {
        let Some(text) = node.attribute(attribute) else {
            self.log.wrong(
                node.range().start,
                std::format!("{what} {attribute}"),
                None,
                "is missing",
            );
            return None;
        };
        let valid = text.len() == digits && text.bytes().all(|digit| digit.is_ascii_hexdigit());
        let number = u16::from_str_radix(text, 16).ok().filter(|_| valid);
        if number.is_none() {
            let rule = std::format!("expected {digits} hex digits");
            self.log.wrong(
                value_at(node, attribute),
                std::format!("{what} {attribute}"),
                Some(text),
                rule,
            );
        }
        number
    }

    /// An attribute that is a number in a range, if it is there.
    fn number(&mut self, node: Node<'a, 'i>, attribute: &str, range: std::ops::RangeInclusive<u32>) -> Option<u32> {
        let text = node.attribute(attribute).filter(|text| !text.is_empty())?;
        let number = integer(text.trim()).and_then(|number| u32::try_from(number).ok());
        let number = number.filter(|number| range.contains(number));
        if number.is_none() {
            let rule = std::format!("expected an integer from {} to {}", range.start(), range.end());
            self.log.wrong(
                value_at(node, attribute),
                std::format!("{} {attribute}", node.tag_name().name()),
                Some(text),
                rule,
            );
        }
        number
    }

    fn flag(&mut self, node: Node<'a, 'i>, attribute: &str) -> Option<bool> {
        let text = node.attribute(attribute)?;
        match text {
            "true" | "1" => Some(true),
            "false" | "0" => Some(false),
            _ => {
                let subject = std::format!("{} {attribute}", node.tag_name().name());
                self.log
                    .wrong(value_at(node, attribute), subject, Some(text), "expected true or false");
                None
            }
        }
    }

    fn object_list(&mut self, list: Node<'a, 'i>) {
        let is_object = |node: &Node<'_, '_>| ["Object", "CANopenObject"].contains(&node.tag_name().name());
        let is_sub = |node: &Node<'_, '_>| ["SubObject", "CANopenSubObject"].contains(&node.tag_name().name());
        let mut indices = BTreeSet::new();
        for object in list.children().filter(is_object) {
            let Some(index) = self.hex(object, "index", 4, "object") else {
                continue;
            };
            let what = subject(index, None);
            if !indices.insert(index) {
                self.log
                    .wrong(value_at(object, "index"), what, None, "stands twice in the file");
                continue;
            }
            let mut subs = BTreeSet::new();
            match object.attribute("objectType").and_then(integer) {
                // Placeholders and definitions of types have no value.
                Some(0 | 5 | 6) => {}
                Some(2 | 7) => self.variable(object, index, 0, None, None),
                Some(8 | 9) => {
                    for element in object.children().filter(is_sub) {
                        let Some(sub) = self.hex(element, "subIndex", 2, &what) else {
                            continue;
                        };
                        let sub = sub as u8;
                        if subs.insert(sub) {
                            let array_type = if sub > 0 { object.attribute("dataType") } else { None };
                            self.variable(element, index, sub, object.attribute("name"), array_type);
                        } else {
                            self.log.wrong(
                                value_at(element, "subIndex"),
                                subject(index, Some(sub)),
                                None,
                                "stands twice in the file",
                            );
                        }
                    }
                }
                _ => {
                    let got = object.attribute("objectType");
                    let rule = if got.is_some() {
                        "expected 0, 2, 5, 6, 7, 8 or 9"
                    } else {
                        "is missing"
                    };
                    self.log.wrong(
                        value_at(object, "objectType"),
                        std::format!("{what} objectType"),
                        got,
                        rule,
                    );
                }
            }
        }
    }

    /// An object that has a value; `of` is the name of the array or record around it.
    fn variable(&mut self, node: Node<'a, 'i>, index: u16, sub: u8, of: Option<&str>, array_type: Option<&str>) {
        let what = subject(index, of.map(|_| sub));
        let parameter = node
            .attribute("uniqueIDRef")
            .and_then(|id| self.parameters.get(id).copied());
        if let (Some(id), None) = (node.attribute("uniqueIDRef"), parameter) {
            let subject = std::format!("{what} uniqueIDRef");
            self.log.wrong(
                value_at(node, "uniqueIDRef"),
                subject,
                Some(id),
                "expected the uniqueID of a parameter of this file",
            );
        }
        let data_type = if node.attribute("dataType").is_some() {
            let Some(code) = self.hex(node, "dataType", 4, &what) else {
                return;
            };
            Some(TypeCode(code))
        } else if let Some(parameter) = parameter {
            parameter
                .children()
                .take(PARTS_MAX)
                .find_map(|child| simple_type(child.tag_name().name()))
        } else if let Some(code) = array_type.and_then(|text| u16::from_str_radix(text, 16).ok()) {
            Some(TypeCode(code))
        } else {
            self.log
                .wrong(node.range().start, std::format!("{what} dataType"), None, "is missing");
            return;
        };
        let access = self.access(node, parameter, &what);
        let pdo = self.pdo(node, access, &what);
        let mut value = |attribute, child: &[&str]| self.value(node, attribute, parameter, child, data_type, &what);
        let default = value("defaultValue", &["defaultValue"]);
        let actual = value("actualValue", &["actualValue"]);
        let low = value("lowLimit", &["allowedValues", "range", "minValue"]);
        let high = value("highLimit", &["allowedValues", "range", "maxValue"]);
        let name = node.attribute("name").unwrap_or("");
        let object = Object {
            index,
            sub,
            name: of.map_or_else(|| name.to_string(), |of| std::format!("{of}.{name}")),
            data_type,
            access,
            pdo,
            default,
            actual,
            low,
            high,
            line: self.log.line(node.range().start),
        };
        check_limits(self.log, &object, &what, |attribute| value_at(node, attribute));
        self.objects.push(object);
    }

    fn access(&mut self, node: Node<'a, 'i>, parameter: Option<Node<'a, 'i>>, what: &str) -> Option<Access> {
        let (place, attribute) = match (node.attribute("accessType"), parameter) {
            (Some(_), _) => (node, "accessType"),
            (None, Some(parameter)) => (parameter, "access"),
            (None, None) => return None,
        };
        // What a parameter does not say is, by the schema, `read`.
        let text = place.attribute(attribute).unwrap_or("read");
        Some(match text {
            "const" => Access::Const,
            "ro" | "read" => Access::ReadOnly,
            "wo" | "wos" | "write" => Access::WriteOnly,
            "rw" | "readWrite" | "readWriteInput" | "readWriteOutput" => Access::ReadWrite,
            "rws" => Access::ReadWriteStored,
            "noAccess" => return None,
            _ => {
                let rule = "expected const, ro, wo, rw or rws";
                self.log.wrong(
                    value_at(place, attribute),
                    std::format!("{what} {attribute}"),
                    Some(text),
                    rule,
                );
                return None;
            }
        })
    }

    fn pdo(&mut self, node: Node<'a, 'i>, access: Option<Access>, what: &str) -> PdoAccess {
        let text = node.attribute("PDOmapping").unwrap_or("no");
        match text.to_ascii_lowercase().as_str() {
            "no" => PdoAccess::No,
            "rpdo" => PdoAccess::Rpdo,
            "tpdo" => PdoAccess::Tpdo,
            "default" | "optional" => super::value::either_direction(access),
            _ => {
                let rule = "expected no, default, optional, RPDO or TPDO";
                self.log.wrong(
                    value_at(node, "PDOmapping"),
                    std::format!("{what} PDOmapping"),
                    Some(text),
                    rule,
                );
                PdoAccess::No
            }
        }
    }

    /// A value from an attribute of the object or, failing that, from a descendant of its parameter; empty is none.
    fn value(
        &mut self,
        node: Node<'a, 'i>,
        attribute: &str,
        parameter: Option<Node<'a, 'i>>,
        path: &[&str],
        data_type: Option<TypeCode>,
        what: &str,
    ) -> Option<Value> {
        let (place, name) = if node.attribute(attribute).is_some() {
            (node, attribute)
        } else {
            let step = |at: Node<'a, 'i>, name: &&str| {
                let mut parts = at.children().take(PARTS_MAX);
                parts.find(|child| child.tag_name().name() == *name)
            };
            let found = path.iter().try_fold(parameter?, step)?;
            (found, "value")
        };
        let text = place.attribute(name).filter(|text| !text.trim().is_empty())?;
        match Value::parse(text, data_type) {
            Ok(value) => Some(value),
            Err(rule) if attribute == "defaultValue" && Value::may_be_any_text(data_type) => {
                let subject = std::format!("{what} {attribute}");
                self.log.odd(value_at(place, name), subject, Some(text), rule);
                Some(Value::unknown(text))
            }
            Err(rule) => {
                let subject = std::format!("{what} {attribute}");
                self.log.wrong(value_at(place, name), subject, Some(text), rule);
                None
            }
        }
    }

    fn identity(&mut self, head: Option<Node<'a, 'i>>) -> DeviceIdentity {
        let Some(head) = head else {
            return DeviceIdentity::default();
        };
        let child = |name: &str| head.children().find(|child| child.tag_name().name() == name);
        let text = |name: &str| child(name).and_then(|child| child.text()).unwrap_or("").trim();
        let number = |text: &str| {
            // Eight digits without 0x are the hexBinary of the schema.
            if text.len() == 8 && !text.starts_with("0x") {
                u32::from_str_radix(text, 16).ok()
            } else {
                integer(text)?.try_into().ok()
            }
        };
        let vendor_id = number(text("vendorID"));
        if let (None, Some(place), false) = (vendor_id, child("vendorID"), text("vendorID").is_empty()) {
            let rule = "expected an integer from 0 to 4294967295, decimal or with 0x";
            self.log
                .wrong(place.range().start, "vendorID", Some(text("vendorID")), rule);
        }
        DeviceIdentity {
            vendor_name: text("vendorName").to_string(),
            product_name: text("productName").to_string(),
            vendor_id,
            // By the schema any text: often an order number.
            product_code: number(text("productID")),
            ..DeviceIdentity::default()
        }
    }

    fn features(&mut self, general: &[Node<'a, 'i>], cn: &[Node<'a, 'i>]) -> Features {
        let mut features = Features::default();
        if let Some(node) = general.first() {
            features.cycle_us_min = self.number(*node, "NMTCycleTimeMin", 0..=u32::MAX);
            features.cycle_us_max = self.number(*node, "NMTCycleTimeMax", 0..=u32::MAX);
            let mut count = |name| {
                self.number(*node, name, 0..=u32::from(u16::MAX))
                    .map(|count| count as u16)
            };
            features.rpdo_channels = count("PDORPDOChannels");
            features.rpdo_objects = count("PDORPDOChannelObjects");
            features.tpdo_objects = count("PDOTPDOChannelObjects");
        }
        if let Some(node) = cn.first() {
            features.multiplexing = self.flag(*node, "DLLCNFeatureMultiplex");
            features.chaining = self.flag(*node, "DLLCNPResChaining");
            features.soc_to_preq_ns = self.number(*node, "NMTCNSoC2PReq", 0..=u32::MAX);
        }
        features
    }
}
