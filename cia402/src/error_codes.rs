//! Texts of the error codes that a drive shows in 603F and in the first word of an error entry.
//!
//! In:  a code. Out: what it means, from the most exact row that fits.

/// (code, text), ascending. A code that is not here takes the text of its group: last octet zero, then first digit.
const TEXTS: [(u16, &str); 83] = [
    (0x0000, "no error"),
    (0x1000, "unspecified"),
    (0x2000, "current"),
    (0x2110, "input: short circuit or earth leakage"),
    (0x2120, "input: earth leakage"),
    (0x2130, "input: short circuit"),
    (0x2211, "internal current 1"),
    (0x2212, "internal current 2"),
    (0x2213, "over-current in the ramp"),
    (0x2214, "over-current in the sequence"),
    (0x2220, "continuous over-current inside the device"),
    (0x2310, "continuous over-current at the output"),
    (0x2311, "continuous over-current at the output 1"),
    (0x2312, "continuous over-current at the output 2"),
    (0x2320, "output: short circuit or earth leakage"),
    (0x2330, "output: earth leakage"),
    (0x2340, "output: short circuit"),
    (0x3000, "voltage"),
    (0x3110, "mains over-voltage"),
    (0x3120, "mains under-voltage"),
    (0x3130, "mains phase lost"),
    (0x3140, "mains frequency"),
    (0x3210, "DC link over-voltage"),
    (0x3220, "DC link under-voltage"),
    (0x3310, "output over-voltage"),
    (0x3320, "armature circuit"),
    (0x3330, "field circuit"),
    (0x4000, "temperature"),
    (0x4110, "ambient temperature too high"),
    (0x4120, "ambient temperature too low"),
    (0x4210, "device temperature too high"),
    (0x4220, "device temperature too low"),
    (0x4310, "motor temperature too high"),
    (0x4320, "motor temperature too low"),
    (0x5000, "device hardware"),
    (0x5111, "15 V supply low"),
    (0x5112, "24 V supply low"),
    (0x5113, "5 V supply low"),
    (0x5210, "measuring circuit"),
    (0x5220, "computing circuit"),
    (0x5410, "output stage"),
    (0x5430, "input stage"),
    (0x5440, "contactor"),
    (0x5450, "fuse"),
    (0x5510, "working memory"),
    (0x5520, "program memory"),
    (0x5530, "non-volatile memory"),
    (0x6000, "device software"),
    (0x6010, "software reset by the watchdog"),
    (0x6300, "data set"),
    (0x6310, "parameters lost"),
    (0x6320, "parameter wrong"),
    (0x7000, "additional module"),
    (0x7110, "brake chopper"),
    (0x7120, "motor"),
    (0x7121, "motor blocked"),
    (0x7122, "motor or commutation"),
    (0x7300, "sensor"),
    (0x7303, "resolver 1"),
    (0x7304, "resolver 2"),
    (0x7305, "incremental sensor 1"),
    (0x7306, "incremental sensor 2"),
    (0x7307, "incremental sensor 3"),
    (0x7310, "speed sensor"),
    (0x7320, "position sensor"),
    (0x7500, "communication"),
    (0x7510, "serial interface 1"),
    (0x7520, "serial interface 2"),
    (0x8000, "monitoring"),
    (0x8100, "communication monitoring"),
    (0x8300, "torque control"),
    (0x8311, "torque too high"),
    (0x8321, "torque too low"),
    (0x8400, "speed controller"),
    (0x8500, "position controller"),
    (0x8600, "positioning controller"),
    (0x8611, "following error"),
    (0x8612, "reference limit"),
    (0x8700, "synchronisation controller"),
    (0x8800, "winding controller"),
    (0x9000, "external error"),
    (0xF000, "special function"),
    (0xFF00, "maker-specific"),
];

/// Meaning of an error code (603F).
///
/// RT: two or three binary searches in a constant table.
pub fn error_text(code: u16) -> &'static str {
    error_entry(code).map_or("code unknown to the profile", |entry| entry.1)
}

/// The entry of the profile that an error code has its meaning from: its own code, and its text.
pub fn error_entry(code: u16) -> Option<(u16, &'static str)> {
    let codes = [code, code & 0xFF00, code & 0xF000];
    let mut entries = codes
        .into_iter()
        .map(|code| TEXTS.binary_search_by_key(&code, |row| row.0));
    entries.find_map(Result::ok).map(|row| TEXTS[row])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_sorted_so_that_every_row_is_found() {
        assert!(TEXTS.is_sorted_by(|a, b| a.0 < b.0));
    }

    #[test]
    fn codes_take_their_own_text_or_that_of_their_group() {
        assert_eq!(error_text(0x8611), "following error");
        assert_eq!(error_text(0x3210), "DC link over-voltage");
        assert_eq!(error_text(0x8699), "positioning controller");
        assert_eq!(error_text(0x2999), "current");
        assert_eq!(error_text(0xFF42), "maker-specific");
        assert_eq!(error_text(0xA001), "code unknown to the profile");
    }
}
