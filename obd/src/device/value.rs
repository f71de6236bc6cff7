//! Values as device descriptions write them: text and a data type in, octets as on the wire out.

use crate::{Access, DataType, PdoAccess};
use std::string::{String, ToString};
use std::vec::Vec;

/// Code of a data type: its index in the object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TypeCode(pub u16);

/// Integers of odd lengths, which no object of ours has: code, bits, whether signed.
const ODD_INTEGERS: [(u16, u16, bool); 8] = [
    (0x0010, 24, true),
    (0x0012, 40, true),
    (0x0013, 48, true),
    (0x0014, 56, true),
    (0x0016, 24, false),
    (0x0018, 40, false),
    (0x0019, 48, false),
    (0x001A, 56, false),
];

impl TypeCode {
    /// The type if it is one of the types of our own dictionaries.
    pub fn known(self) -> Option<DataType> {
        DataType::from_code(self.0)
    }

    /// Length in bits; `None`: variable, or not known.
    pub fn bits(self) -> Option<u16> {
        match self.known() {
            Some(known) => known.size().map(|octets| 8 * octets as u16),
            None => ODD_INTEGERS
                .iter()
                .find(|(code, ..)| *code == self.0)
                .map(|(_, bits, _)| *bits),
        }
    }

    /// Least and greatest value of an integer type.
    fn integer_range(self) -> Option<(i128, i128)> {
        if let Some(known) = self.known() {
            return known.integer_range();
        }
        let (_, bits, signed) = ODD_INTEGERS.iter().find(|(code, ..)| *code == self.0)?;
        Some(if *signed {
            (-(1 << (bits - 1)), (1 << (bits - 1)) - 1)
        } else {
            (0, (1 << bits) - 1)
        })
    }
}

/// A value of a device description.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Value {
    /// As it is written.
    pub text: String,
    kind: Kind,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Kind {
    /// Octets as on the wire, and the number if it is one.
    Known(Vec<u8>, Option<i128>),
    /// This plus the node id, in so many octets.
    NodeId { plus: i128, octets: usize },
    /// Of a type that only the file defines, or a text that stands for octets.
    Unknown,
}

impl Value {
    /// Octets as on the wire, for the device as node `node`; `None`: of a type that only the file defines, or the sum with the
    /// node id is too long for its type.
    pub fn octets(&self, node: u8) -> Option<Vec<u8>> {
        match &self.kind {
            Kind::Known(octets, _) => Some(octets.clone()),
            Kind::NodeId { plus, octets } => little_endian(plus + i128::from(node), *octets),
            Kind::Unknown => None,
        }
    }

    /// The number if it is one that does not depend on the node id.
    pub fn integer(&self) -> Option<i128> {
        match self.kind {
            Kind::Known(_, number) => number,
            Kind::NodeId { .. } | Kind::Unknown => None,
        }
    }

    /// Whether a default that cannot be read may stand: it is never written, and tools put any text into those of octet strings
    /// and domains.
    pub(super) fn may_be_any_text(data_type: Option<TypeCode>) -> bool {
        let known = data_type.and_then(TypeCode::known);
        matches!(known, Some(DataType::OctetString | DataType::Domain))
    }

    /// A default of which only the text is known.
    pub(super) fn unknown(text: &str) -> Value {
        Value {
            text: text.to_string(),
            kind: Kind::Unknown,
        }
    }

    /// Reads a value; the error says what was expected.
    pub(super) fn parse(text: &str, data_type: Option<TypeCode>) -> Result<Value, String> {
        let kind = match data_type {
            None => Kind::Unknown,
            Some(code) => kind(text.trim(), code)?,
        };
        Ok(Value {
            text: text.to_string(),
            kind,
        })
    }
}

fn kind(text: &str, code: TypeCode) -> Result<Kind, String> {
    if let Some((low, high)) = code.integer_range() {
        let octets = usize::from(code.bits().unwrap_or(8) / 8);
        return integer_kind(text, code, low, high, octets);
    }
    let Some(known) = code.known() else {
        return Ok(Kind::Unknown);
    };
    let octets = match known {
        DataType::Real32 => real(text, 4).map(|value| (value as f32).to_le_bytes().to_vec()),
        DataType::Real64 => real(text, 8).map(|value| value.to_le_bytes().to_vec()),
        DataType::VisibleString => Ok(text.as_bytes().to_vec()),
        DataType::OctetString | DataType::Domain => hex_octets(text).ok_or("expected octets as pairs of hex digits"),
        DataType::Mac => hex_octets(text)
            .filter(|mac| mac.len() == 6)
            .ok_or("expected the 6 octets of a MAC address"),
        DataType::NetTime => hex_octets(text)
            .filter(|time| time.len() == 8)
            .ok_or("expected 8 octets as pairs of hex digits"),
        // Integers came above.
        DataType::Bool | DataType::I8 | DataType::I16 | DataType::I32 | DataType::I64 => return Ok(Kind::Unknown),
        DataType::U8 | DataType::U16 | DataType::U32 | DataType::U64 | DataType::Ip => return Ok(Kind::Unknown),
    };
    octets.map(|octets| Kind::Known(octets, None)).map_err(str::to_string)
}

fn integer_kind(text: &str, code: TypeCode, low: i128, high: i128, octets: usize) -> Result<Kind, String> {
    let expected = || std::format!("expected an integer from {low} to {high}, decimal or with 0x");
    if code.known() == Some(DataType::Bool) {
        let flag = match text.to_ascii_lowercase().as_str() {
            "true" | "1" | "0x1" | "0x01" => 1,
            "false" | "0" | "0x0" | "0x00" => 0,
            _ => return Err("expected true, false, 0 or 1".to_string()),
        };
        return Ok(Kind::Known(Vec::from([flag as u8]), Some(flag)));
    }
    if code.known() == Some(DataType::Ip)
        && let Ok(address) = text.parse::<std::net::Ipv4Addr>()
    {
        let number = u32::from(address);
        return Ok(Kind::Known(number.to_le_bytes().to_vec(), Some(i128::from(number))));
    }
    if let Some(plus) = node_id_formula(text) {
        let plus = plus.ok_or("expected $NODEID, $NODEID+number or number+$NODEID")?;
        return match plus <= high {
            true => Ok(Kind::NodeId { plus, octets }),
            false => Err(expected()),
        };
    }
    let number = match integer(text) {
        Some(number) if (low..=high).contains(&number) => number,
        // Negative numbers are often written as the octets that they are.
        Some(number) if low < 0 && text.starts_with("0x") && number <= high - low => number + 2 * low,
        Some(_) | None => return Err(expected()),
    };
    little_endian(number, octets)
        .map(|octets| Kind::Known(octets, Some(number)))
        .ok_or_else(expected)
}

/// `None`: no formula; `Some(None)`: a wrong one.
fn node_id_formula(text: &str) -> Option<Option<i128>> {
    const NODE_ID: &str = "$NODEID";
    let upper = text.to_ascii_uppercase();
    upper.contains('$').then(|| {
        let (left, right) = upper.split_once('+').unwrap_or((&upper, "0"));
        match (left.trim(), right.trim()) {
            (NODE_ID, number) | (number, NODE_ID) => integer(&number.replace('X', "x")),
            _ => None,
        }
    })
}

/// Decimal, or hex with `0x`. Leading zeros are refused: to some tools they mean octal.
pub(super) fn integer(text: &str) -> Option<i128> {
    if let Some(digits) = text.strip_prefix("0x").or(text.strip_prefix("0X")) {
        let valid = (1..=16).contains(&digits.len()) && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
        return valid
            .then(|| u64::from_str_radix(digits, 16).ok().map(i128::from))
            .flatten();
    }
    let digits = text.strip_prefix('-').unwrap_or(text);
    let octal = digits.starts_with('0') && digits.bytes().any(|digit| digit != b'0');
    let valid = (1..=20).contains(&digits.len()) && digits.bytes().all(|digit| digit.is_ascii_digit()) && !octal;
    valid.then(|| text.parse().ok()).flatten()
}

/// A decimal number, or the octets of one as hex.
fn real(text: &str, octets: usize) -> Result<f64, &'static str> {
    if text.starts_with("0x") {
        let raw = integer(text)
            .filter(|raw| *raw < 1 << (8 * octets))
            .ok_or("expected the octets of a floating-point number")?;
        return Ok(if octets == 4 {
            f64::from(f32::from_bits(raw as u32))
        } else {
            f64::from_bits(raw as u64)
        });
    }
    let number: Option<f64> = text.parse().ok();
    number
        .filter(|number| number.is_finite() && (octets == 8 || (*number as f32).is_finite()))
        .ok_or("expected a finite number")
}

/// `00:0a`, `00-0A`, `00 0a`, `000A` or `0x000A`.
fn hex_octets(text: &str) -> Option<Vec<u8>> {
    let text = text.strip_prefix("0x").unwrap_or(text);
    let digits: Vec<u8> = text.bytes().filter(|octet| !b":- ".contains(octet)).collect();
    let value = |digit: u8| (digit as char).to_digit(16).map(|value| value as u8);
    let pairs = digits.chunks_exact(2);
    if !pairs.remainder().is_empty() {
        return None;
    }
    pairs.map(|pair| Some(value(pair[0])? << 4 | value(pair[1])?)).collect()
}

fn little_endian(number: i128, octets: usize) -> Option<Vec<u8>> {
    let bits = 8 * octets as u32;
    let fits = number < 1 << bits && number >= -(1 << (bits - 1));
    fits.then(|| number.to_le_bytes()[..octets].to_vec())
}

/// Where an object may be mapped whose file gives no direction: by who may write it.
pub(super) fn either_direction(access: Option<Access>) -> PdoAccess {
    match access {
        Some(Access::Const | Access::ReadOnly) => PdoAccess::Tpdo,
        Some(Access::WriteOnly) => PdoAccess::Rpdo,
        Some(Access::ReadWrite | Access::ReadWriteStored) | None => PdoAccess::Both,
    }
}
