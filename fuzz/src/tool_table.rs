//! Any octets as a tool table: read and written back equal, or refused with places.

use gcode::{ToolChanger, ToolTable};
use motion::canon::LengthUnit;

/// One run of the fuzzer; the first octet says what kind of machine reads the rest.
pub fn run(octets: &[u8]) {
    let (kind, text) = octets.split_first().unwrap_or((&0, &[]));
    let unit = if kind & 1 == 0 {
        LengthUnit::Millimetre
    } else {
        LengthUnit::Inch
    };
    let changer = if kind & 2 == 0 {
        ToolChanger::Fixed
    } else {
        ToolChanger::Random
    };
    let table = match ToolTable::parse(text, unit, changer) {
        Ok(table) => table,
        Err(errors) => {
            assert!(!errors.is_empty());
            assert!(errors.is_sorted_by_key(|error| error.line));
            for error in errors.iter().take(20) {
                assert!(!error.render("tool.tbl", text).is_empty());
            }
            return;
        }
    };
    let read = |text: &str| ToolTable::parse(text.as_bytes(), unit, changer);
    assert_eq!(read(&table.write()).as_ref(), Ok(&table));
    // Each line written anew.
    let mut again = ToolTable::new(unit, changer);
    for tool in table.tools() {
        assert_eq!(table.by_number(tool.number), Some(tool));
        assert_eq!(again.set(tool.clone()), Ok(()));
    }
    assert_eq!(read(&again.write()), Ok(table));
}
