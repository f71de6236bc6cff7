//! Values of objects: text to octets and back.
//!
//! In:  what a person types, with a type or the length of the present value. Out: octets as they go over the wire; and what
//! octets may mean, as hexadecimal and decimal number and as text.

use super::words;
use obd::DataType;
use serde_json::{Value as Json, json};

/// Names of the types, as they are given behind --type.
pub const TYPES: [(&str, DataType); 17] = [
    ("bool", DataType::Bool),
    ("i8", DataType::I8),
    ("i16", DataType::I16),
    ("i32", DataType::I32),
    ("i64", DataType::I64),
    ("u8", DataType::U8),
    ("u16", DataType::U16),
    ("u32", DataType::U32),
    ("u64", DataType::U64),
    ("real32", DataType::Real32),
    ("real64", DataType::Real64),
    ("string", DataType::VisibleString),
    ("octets", DataType::OctetString),
    ("domain", DataType::Domain),
    ("mac", DataType::Mac),
    ("ip", DataType::Ip),
    ("nettime", DataType::NetTime),
];

/// Reads the name of a type.
pub fn data_type(text: &str) -> Result<DataType, String> {
    let found = TYPES.iter().find(|(name, _)| *name == text);
    found.map(|(_, data_type)| *data_type).ok_or_else(|| {
        let names: Vec<&str> = TYPES.iter().map(|(name, _)| *name).collect();
        format!("expected one of {}", names.join(", "))
    })
}

/// Name of a type.
pub fn type_name(data_type: DataType) -> &'static str {
    // Every type is in the table; a test walks them.
    TYPES
        .iter()
        .find(|(_, own)| *own == data_type)
        .map_or("octets", |(name, _)| name)
}

/// Type of a value of this length, where nobody says more.
pub fn guess(length: usize) -> DataType {
    match length {
        1 => DataType::U8,
        2 => DataType::U16,
        4 => DataType::U32,
        8 => DataType::U64,
        _ => DataType::VisibleString,
    }
}

/// Reads an object: `0x1018:1`, `0x1018/1`, `0x1006`.
pub fn object(text: &str) -> Result<(u16, u8), String> {
    let wrong = || "expected an object like 0x1006 or 0x1018:1".to_owned();
    let (index, sub) = text.split_once([':', '/']).unwrap_or((text, "0"));
    let digits = index
        .strip_prefix("0x")
        .or_else(|| index.strip_prefix("0X"))
        .ok_or_else(wrong)?;
    let plain = |digits: &str| !digits.is_empty() && digits.bytes().all(|octet| octet.is_ascii_hexdigit());
    if !plain(digits) {
        return Err(wrong());
    }
    let index = u16::from_str_radix(digits, 16).map_err(|_| wrong())?;
    let sub = match sub.strip_prefix("0x") {
        Some(digits) if plain(digits) => u8::from_str_radix(digits, 16).map_err(|_| wrong())?,
        Some(_) => return Err(wrong()),
        None if plain(sub) => sub.parse().map_err(|_| wrong())?,
        None => return Err(wrong()),
    };
    Ok((index, sub))
}

/// Octets of a typed value.
///
/// # Errors
/// What was expected.
pub fn encode(text: &str, data_type: DataType) -> Result<Vec<u8>, String> {
    let name = type_name(data_type);
    match data_type {
        DataType::Bool if matches!(text, "true" | "false") => Ok(vec![u8::from(text == "true")]),
        DataType::Real32 => {
            let number: f32 = text
                .parse()
                .map_err(|_| format!("expected a number ({name}), got {text:?}"))?;
            Ok(number.to_le_bytes().into())
        }
        DataType::Real64 => {
            let number: f64 = text
                .parse()
                .map_err(|_| format!("expected a number ({name}), got {text:?}"))?;
            Ok(number.to_le_bytes().into())
        }
        DataType::VisibleString => match text.is_ascii() {
            true => Ok(text.as_bytes().to_vec()),
            false => Err(format!("expected ASCII text ({name}), got {text:?}")),
        },
        DataType::OctetString | DataType::Domain => hex(text)
            .ok_or_else(|| format!("expected octets as pairs of hexadecimal digits, like 0a1b ({name}), got {text:?}")),
        DataType::Mac => hex(text)
            .filter(|octets| octets.len() == 6)
            .ok_or_else(|| format!("expected six octets, like 02:00:00:00:00:01 ({name}), got {text:?}")),
        DataType::NetTime => {
            let wrong = || format!("expected seconds.nanoseconds, like 12.500000000 ({name}), got {text:?}");
            let (seconds, nanoseconds) = text.split_once('.').ok_or_else(wrong)?;
            let seconds: u32 = seconds.parse().map_err(|_| wrong())?;
            let nanoseconds: u32 = nanoseconds.parse().map_err(|_| wrong())?;
            Ok([seconds.to_le_bytes(), nanoseconds.to_le_bytes()].concat())
        }
        DataType::Ip if text.contains('.') => {
            let address: std::net::Ipv4Addr = text
                .parse()
                .map_err(|_| format!("expected an address like 192.168.100.1 ({name}), got {text:?}"))?;
            Ok(u32::from(address).to_le_bytes().into())
        }
        DataType::Bool
        | DataType::I8
        | DataType::I16
        | DataType::I32
        | DataType::I64
        | DataType::U8
        | DataType::U16
        | DataType::U32
        | DataType::U64
        | DataType::Ip => integer(text, data_type),
    }
}

fn integer(text: &str, data_type: DataType) -> Result<Vec<u8>, String> {
    let (least, most) = data_type.integer_range().unwrap_or((0, 0));
    let expected = || {
        format!(
            "expected a whole number from {least} to {most} ({}), got {text:?}",
            type_name(data_type)
        )
    };
    let (sign, digits) = match text.strip_prefix('-') {
        Some(digits) => (-1, digits),
        None => (1, text),
    };
    let plain = |digits: &str| digits.bytes().all(|octet| octet.is_ascii_hexdigit());
    let number = match digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
        Some(digits) if plain(digits) => i128::from_str_radix(digits, 16),
        _ if plain(digits) => digits.parse(),
        _ => return Err(expected()),
    };
    let number = sign * number.map_err(|_| expected())?;
    if !(least..=most).contains(&number) {
        return Err(expected());
    }
    let length = data_type.size().unwrap_or(0);
    Ok(number.to_le_bytes()[..length].to_vec())
}

/// Pairs of hexadecimal digits, with or without colons or blanks between pairs.
fn hex(text: &str) -> Option<Vec<u8>> {
    let digits: String = text.chars().filter(|digit| !matches!(digit, ':' | ' ')).collect();
    api::rpc::from_hex(digits.strip_prefix("0x").unwrap_or(&digits))
}

/// A value as its type shows it; without a type all that it may mean.
pub fn show(octets: &[u8], data_type: Option<DataType>) -> String {
    let typed = data_type.filter(|data_type| data_type.size().is_none_or(|size| size == octets.len()));
    let Some(data_type) = typed else {
        return guessed(octets);
    };
    match data_type {
        DataType::Real32 | DataType::Real64 | DataType::Mac | DataType::Ip | DataType::NetTime => {
            special(octets, data_type)
        }
        DataType::VisibleString => format!("{:?}", words::text(octets)),
        DataType::OctetString | DataType::Domain => words::octets(octets),
        DataType::Bool
        | DataType::I8
        | DataType::I16
        | DataType::I32
        | DataType::I64
        | DataType::U8
        | DataType::U16
        | DataType::U32
        | DataType::U64 => {
            let signed = data_type.integer_range().is_some_and(|(least, _)| least < 0);
            let shown = if signed {
                signed_number(octets)
            } else {
                i128::from(number(octets))
            };
            format!("{shown} (0x{:0width$X})", number(octets), width = 2 * octets.len())
        }
    }
}

fn special(octets: &[u8], data_type: DataType) -> String {
    match (data_type, octets) {
        (DataType::Real32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).to_string(),
        (DataType::Real64, &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]).to_string(),
        (DataType::Mac, &[a, b, c, d, e, f]) => words::mac([a, b, c, d, e, f]),
        // Sent as a little endian number: the last octet of the address comes first.
        (DataType::Ip, [a, b, c, d]) => format!("{d}.{c}.{b}.{a}"),
        (DataType::NetTime, octets) if octets.len() == 8 => {
            format!("{}.{:09} s", number(&octets[..4]), number(&octets[4..]))
        }
        _ => guessed(octets),
    }
}

fn guessed(octets: &[u8]) -> String {
    // Short numbers look like text too easily.
    let text = if octets.len() >= 4 && octets.iter().all(|octet| octet.is_ascii_graphic()) {
        format!("  {:?}", words::text(octets))
    } else {
        String::new()
    };
    match octets.len() {
        0 => "empty".into(),
        1 | 2 | 4 | 8 => {
            let number = number(octets);
            let signed = match signed_number(octets) {
                negative @ ..0 => format!(" or {negative}"),
                _ => String::new(),
            };
            format!("{number}{signed} (0x{number:0width$X}){text}", width = 2 * octets.len())
        }
        _ if words::is_text(octets) => text.trim_start().to_owned(),
        _ => words::octets(octets),
    }
}

fn number(octets: &[u8]) -> u64 {
    let mut wide = [0; 8];
    for (wide, octet) in wide.iter_mut().zip(octets) {
        *wide = *octet;
    }
    u64::from_le_bytes(wide)
}

fn signed_number(octets: &[u8]) -> i128 {
    let unused_bits = 64 - 8 * octets.len().clamp(1, 8) as u32;
    i128::from(((number(octets) << unused_bits) as i64) >> unused_bits)
}

/// The same for programs.
pub fn to_json(octets: &[u8], data_type: Option<DataType>) -> Json {
    let is_number = matches!(octets.len(), 1 | 2 | 4 | 8);
    json!({
        "octets": api::rpc::to_hex(octets),
        "length": octets.len(),
        "unsigned": is_number.then(|| number(octets)),
        "signed": is_number.then(|| signed_number(octets) as i64),
        "text": words::is_text(octets).then(|| words::text(octets)),
        "type": data_type.map(type_name),
        "shown": show(octets, data_type),
    })
}

#[cfg(test)]
mod tests;
