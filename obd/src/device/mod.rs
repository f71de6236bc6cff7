//! Device descriptions as vendors deliver them: XDD and XDC (XML, EPSG DS 311), EDS and DCF (text, CiA 306).
//!
//! In:  the octets of a file.
//! Out: one plain [`DeviceDescription`] for all formats, or every mistake of the file with line, column, what was
//! expected and what came. What the formats allow to be unknown is skipped; a wrong value never is.
//!
//! Not for real-time code: allocates, and needs `std` (feature `device`).

mod description;
mod error;
mod ini;
mod profile;
#[cfg(test)]
mod tests;
mod value;
mod xml;

pub use description::{DeviceDescription, DeviceIdentity, Features, Format, Object};
pub use error::{DeviceErrors, DeviceMistake};
pub use profile::{ConfigurationWrite, MappingRefusal, StoredParameters, set_by_managing_node};
pub use value::{TypeCode, Value};

use error::Log;
use std::borrow::Cow;
use std::string::{String, ToString};

/// Longest file that is read.
pub const FILE_OCTETS_MAX: usize = 16 << 20;

/// Reads a device description; which format it is shows in its first character.
///
/// # Errors
/// Every mistake in the file.
pub fn parse(file: &str, octets: &[u8]) -> Result<DeviceDescription, DeviceErrors> {
    let whole = |rule: String| DeviceErrors::whole(file, rule);
    if octets.len() > FILE_OCTETS_MAX {
        let rule = std::format!(
            "expected at most {FILE_OCTETS_MAX} octets, is {} octets long",
            octets.len()
        );
        return Err(whole(rule));
    }
    if octets.starts_with(&[0xFF, 0xFE]) || octets.starts_with(&[0xFE, 0xFF]) {
        return Err(whole("expected UTF-8 or ISO 8859-1, is UTF-16".to_string()));
    }
    let octets = octets.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(octets);
    let text = decode(octets);
    let mut log = Log::new(file, &text);
    let description = match text.trim_start().chars().next() {
        Some('<') => xml::read(&text, &mut log),
        Some(_) => ini::read(&text, &mut log),
        None => return Err(whole("expected a device description, is empty".to_string())),
    };
    let notes = log.finish()?;
    let mut description = description.ok_or_else(|| whole("is refused for a reason that was lost".to_string()))?;
    description.notes = notes;
    description.complete();
    Ok(description)
}

/// Old tools write ISO 8859-1; only names can tell the difference.
fn decode(octets: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(octets) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(octets.iter().map(|octet| char::from(*octet)).collect()),
    }
}
