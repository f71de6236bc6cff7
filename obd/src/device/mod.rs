//! Device descriptions as vendors deliver them: XDD and XDC (XML, EPSG DS 311), EDS and DCF (text, CiA 306); ESI of EtherCAT.
//!
//! In:  the octets of a file.
//! Out: one plain [`DeviceDescription`] for all formats, or every mistake of the file with line, column, what was
//! expected and what came. What the formats allow to be unknown is skipped; a wrong value never is.
//!
//! Not for real-time code: allocates, and needs `std` (feature `device`).

mod description;
mod error;
mod esi;
#[cfg(test)]
mod esi_tests;
mod ini;
mod profile;
#[cfg(test)]
mod tests;
mod value;
mod xml;

pub use description::{DeviceDescription, DeviceIdentity, Features, Format, Object};
pub use error::{DeviceErrors, DeviceMistake};
pub use esi::{
    EsiChoice, EsiCoe, EsiCommand, EsiDevice, EsiDictionary, EsiEntry, EsiFile, EsiModule, EsiOpMode, EsiPdo, EsiSlot,
    EsiSyncManager, EsiUsage, parse_esi, parse_esi_with,
};
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
    let text = text(file, octets)?;
    let mut log = Log::new(file, &text);
    let description = match text.trim_start().chars().next() {
        Some('<') => xml::read(&text, &mut log),
        Some(_) => ini::read(&text, &mut log),
        None => {
            let rule = "expected a device description, is empty".to_string();
            return Err(DeviceErrors::whole(file, rule));
        }
    };
    let notes = log.finish()?;
    let mut description =
        description.ok_or_else(|| DeviceErrors::whole(file, "is refused for a reason that was lost".to_string()))?;
    description.notes = notes;
    description.complete();
    Ok(description)
}

/// The text of a file, unless it is too long or of an encoding that is not read.
fn text<'a>(file: &str, octets: &'a [u8]) -> Result<Cow<'a, str>, DeviceErrors> {
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
    Ok(decode(octets))
}

/// Old tools write ISO 8859-1; only names can tell the difference.
fn decode(octets: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(octets) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(octets.iter().map(|octet| char::from(*octet)).collect()),
    }
}
