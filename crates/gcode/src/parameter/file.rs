//! LinuxCNC's parameter file: what outlives a program and the control, such as the work offsets.
//!
//! In:  the octets of the file ([`parse`]); numbers and values ([`write()`]).
//! Out: numbers and values, ascending, or all errors of the file at once; the text of the file.
//!
//! A line is a number and its value, in the units of the machine: `5221 -100.250000`. Numbers ascend. Those that are
//! [`required`] are added with value 0 where they are missing; which others the machine keeps, the file itself says by
//! naming them. Blank lines and lines that start with `;` or `#` are left out, and gone when the file is written again.
//! LinuxCNC leaves out any line that it cannot read; here such lines are errors.
//!
//! ```
//! use gcode::parameter::file;
//!
//! let mut parameters = file::parse(b"31\t1.5\n5221\t-100.25\n").unwrap();
//! assert_eq!(parameters[0], (31, 1.5));
//! parameters[0].1 = 2.0;
//! assert!(file::write(&parameters).starts_with("31\t2.000000\n5161\t0.000000\n"));
//! ```

use super::PARAMETER_MAX;
use crate::Settings;
use crate::located::{Located, MISTAKES_MAX, lines, text_of};
use motion::canon::{Axis, Position};
use std::fmt::Write;
use std::ops::{Range, RangeInclusive};

/// Parameters that each file has: points of G28 and G30, G92, active system, origins and rotations of the nine systems.
const REQUIRED: [RangeInclusive<u16>; 13] = [
    5161..=5169,
    5181..=5189,
    5210..=5219,
    5220..=5220,
    5221..=5230,
    5241..=5250,
    5261..=5270,
    5281..=5290,
    5301..=5310,
    5321..=5330,
    5341..=5350,
    5361..=5370,
    5381..=5390,
];

/// A mistake in a parameter file.
pub type ParameterFileError = Located<ParameterFileErrorKind>;

/// What is wrong with a parameter file; `Display` tells rule and remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParameterFileErrorKind {
    /// The first column is no integer.
    #[error("a line is the number of a parameter, blank or tab, and its value: this is no number of a parameter")]
    NotInteger,
    /// The first column is an integer out of range.
    #[error("parameter numbers go from 1 to {PARAMETER_MAX}")]
    OutOfRange,
    /// No second column.
    #[error("the value of parameter {number} is missing")]
    ValueMissing {
        /// Number of the parameter, the first column.
        number: u16,
    },
    /// The second column is not a number.
    #[error("the value of parameter {number} is a plain number such as -1.5")]
    NotNumber {
        /// Number of the parameter, the first column.
        number: u16,
    },
    /// More than two columns.
    #[error("there is more than a number and its value on this line: one parameter a line")]
    TooMuch,
    /// Not above the line before.
    #[error("parameter {number} comes after {before}: numbers ascend, each stands once")]
    OutOfOrder {
        /// The number of this line.
        number: u16,
        /// The one before it.
        before: u16,
    },
}

/// The numbers that each file has, ascending.
pub fn required() -> impl Iterator<Item = u16> {
    REQUIRED.into_iter().flatten()
}

/// Reads a file; an empty one gives the required parameters, all 0.
///
/// # Errors
/// What is wrong, in the order of the file; a hundred mistakes are told.
pub fn parse(text: &[u8]) -> Result<Vec<(u16, f64)>, Vec<ParameterFileError>> {
    let mut found: Vec<(u16, f64)> = Vec::new();
    let mut errors = Vec::new();
    for (index, line) in lines(text).enumerate() {
        if errors.len() >= MISTAKES_MAX {
            break;
        }
        let line = text_of(line);
        let mut wrong = |(span, kind)| errors.push(Located::at(index, &line, span, kind));
        match read_line(&line) {
            Ok(None) => {}
            Ok(Some((number, value, span))) => match found.last() {
                Some(&(before, _)) if before >= number => {
                    wrong((span, ParameterFileErrorKind::OutOfOrder { number, before }));
                }
                Some(_) | None => found.push((number, value)),
            },
            Err(error) => wrong(error),
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let is_found = |number: u16| found.binary_search_by_key(&number, |entry| entry.0).is_ok();
    let missing: Vec<u16> = required().filter(|number| !is_found(*number)).collect();
    found.extend(missing.into_iter().map(|number| (number, 0.0)));
    found.sort_unstable_by_key(|entry| entry.0);
    Ok(found)
}

/// The text of a file, with six decimals as LinuxCNC writes them; `parameters` ascend, values are finite.
pub fn write(parameters: &[(u16, f64)]) -> String {
    debug_assert!(parameters.is_sorted_by(|one, other| one.0 < other.0));
    debug_assert!(parameters.iter().all(|entry| entry.1.is_finite()));
    let mut text = String::new();
    for (number, value) in parameters {
        let start = text.len();
        let _ = writeln!(text, "{number}\t{value:.6}"); // writing into a String cannot fail
        let column = &text[start..];
        if column.ends_with("\t-0.000000\n") {
            text.truncate(start);
            let _ = writeln!(text, "{number}\t0.000000");
        }
    }
    text
}

impl Settings {
    /// Takes over what a parameter file holds, in the units of the machine ([`Settings::machine_unit`]). Those numbers are
    /// kept: [`Run::snapshot`](crate::Run::snapshot) tells their values again.
    pub fn set_parameters(&mut self, parameters: &[(u16, f64)]) {
        self.parameters = parameters.iter().copied().collect();
        let value = |number: u32| {
            let number = u16::try_from(number).ok()?;
            self.parameters.get(&number).copied()
        };
        let value = |number: u32| value(number).unwrap_or(0.0);
        let unit_mm = self.machine_unit.mm();
        let position = |first: u32| {
            let mut position = Position::ZERO;
            for (number, axis) in (first..).zip(Axis::ALL) {
                let scale = if axis.is_rotary() { 1.0 } else { unit_mm };
                position[axis] = value(number) * scale;
            }
            position
        };
        self.g28 = position(super::G28_POINT);
        self.g30 = position(super::G30_POINT);
        self.g92_offset = position(super::G92_OFFSET);
        self.g92_active = value(super::G92_ACTIVE) != 0.0;
        // What is no system is G54, as in LinuxCNC.
        self.work_system = (1..=9)
            .find(|system| f64::from(*system) == value(super::ACTIVE_SYSTEM).floor())
            .unwrap_or(1);
        self.work_offsets = std::array::from_fn(|index| position(super::system_origin(index as u8 + 1)));
        self.work_rotations_degrees = std::array::from_fn(|index| value(super::system_rotation(index as u8 + 1)));
    }
}

type Wrong = (Range<usize>, ParameterFileErrorKind);

/// Number, value, and the place of the number; `None` of a line without a parameter.
fn read_line(line: &str) -> Result<Option<(u16, f64, Range<usize>)>, Wrong> {
    let text = line.trim_end();
    let start = text.len() - text.trim_start().len();
    if text[start..].is_empty() || text[start..].starts_with([';', '#']) {
        return Ok(None);
    }
    let (number, rest) = text[start..]
        .split_once(char::is_whitespace)
        .unwrap_or((&text[start..], ""));
    let place = start..start + number.len();
    let digits = number.strip_prefix(['+', '-']).unwrap_or(number);
    if digits.is_empty() || !digits.bytes().all(|octet| octet.is_ascii_digit()) {
        return Err((place, ParameterFileErrorKind::NotInteger));
    }
    let number = match number.parse::<u16>() {
        Ok(number) if (1..=PARAMETER_MAX).contains(&number) => number,
        Ok(_) | Err(_) => return Err((place, ParameterFileErrorKind::OutOfRange)),
    };
    let value = rest.trim_start();
    let value_start = text.len() - value.len();
    let (value, more) = value.split_once(char::is_whitespace).unwrap_or((value, ""));
    let value_place = value_start..value_start + value.len();
    if value.is_empty() {
        return Err((place, ParameterFileErrorKind::ValueMissing { number }));
    }
    let plain = value
        .bytes()
        .all(|octet| matches!(octet, b'0'..=b'9' | b'.' | b'+' | b'-' | b'e' | b'E'));
    let value = match value.parse::<f64>() {
        Ok(value) if plain && value.is_finite() => value + 0.0, // -0 is 0
        Ok(_) | Err(_) => return Err((value_place, ParameterFileErrorKind::NotNumber { number })),
    };
    let more = more.trim_start();
    if !more.is_empty() && !more.starts_with([';', '#']) {
        return Err((text.len() - more.len()..text.len(), ParameterFileErrorKind::TooMuch));
    }
    Ok(Some((number, value, place)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Interpreter;
    use motion::canon::LengthUnit;
    use proptest::prelude::*;

    fn errors(text: &str) -> Vec<String> {
        let errors = parse(text.as_bytes()).unwrap_err();
        errors.iter().map(ParameterFileError::to_string).collect()
    }

    #[test]
    fn of_a_file_that_is_none_a_hundred_mistakes_are_told() {
        assert_eq!(errors(&"x\n".repeat(1_000_000)).len(), 100);
        let tools = crate::ToolTable::parse(&b"x\n".repeat(1_000_000), LengthUnit::Inch, crate::ToolChanger::Fixed);
        assert!(tools.unwrap_err().len() <= 102);
    }

    #[test]
    fn a_file_has_at_least_the_required_parameters() {
        let parameters = parse(b"").unwrap();
        assert_eq!(parameters.len(), 9 + 9 + 10 + 1 + 9 * 10);
        assert!(parameters.is_sorted_by(|one, other| one.0 < other.0));
        let text = write(&parameters);
        assert!(text.starts_with("5161\t0.000000\n5162\t0.000000\n"));
        assert!(text.ends_with("5389\t0.000000\n5390\t0.000000\n"));
    }

    #[test]
    fn what_the_file_names_is_kept() {
        let text = "\n; kept by hand\n 1 1\r\n31\t-2.5 \n100 1e3 # a remark\n5161\t+7.\n5599 .5\n5601 3\n";
        let parameters = parse(text.as_bytes()).unwrap();
        let found: Vec<_> = parameters.iter().filter(|(_, value)| *value != 0.0).collect();
        let expected = [
            (1, 1.0),
            (31, -2.5),
            (100, 1000.0),
            (5161, 7.0),
            (5599, 0.5),
            (5601, 3.0),
        ];
        assert_eq!(found, expected.iter().collect::<Vec<_>>());
        assert_eq!(parameters.len(), 119 + 5);
    }

    #[test]
    fn values_have_six_decimals_and_zero_has_no_sign() {
        let text = write(&[(1, 1.123_456_78), (2, -1e-9), (3, -0.0), (4, 1e12), (5, -0.5)]);
        assert_eq!(
            text,
            "1\t1.123457\n2\t0.000000\n3\t0.000000\n4\t1000000000000.000000\n5\t-0.500000\n"
        );
    }

    #[test]
    fn all_errors_come_at_once_with_their_places() {
        let text =
            "abc\n1.5 2\n0 1\n-3 1\n5602 1\n99999 1\n 40\n41\tnan\n42 1e999\n43 1 2\n50 1\n50 2\n49 3\n51 4\n(x)\n";
        let place =
            "a line is the number of a parameter, blank or tab, and its value: this is no number of a parameter";
        let number = |number| format!("the value of parameter {number} is a plain number such as -1.5");
        let expected = [
            format!("1:1: {place}"),
            format!("2:1: {place}"),
            "3:1: parameter numbers go from 1 to 5601".into(),
            "4:1: parameter numbers go from 1 to 5601".into(),
            "5:1: parameter numbers go from 1 to 5601".into(),
            "6:1: parameter numbers go from 1 to 5601".into(),
            "7:2: the value of parameter 40 is missing".into(),
            format!("8:4: {}", number(41)),
            format!("9:4: {}", number(42)),
            "10:6: there is more than a number and its value on this line: one parameter a line".into(),
            "12:1: parameter 50 comes after 50: numbers ascend, each stands once".into(),
            "13:1: parameter 49 comes after 50: numbers ascend, each stands once".into(),
            format!("15:1: {place}"),
        ];
        assert_eq!(errors(text), expected);
    }

    #[test]
    fn settings_take_a_file_and_tell_it_again() {
        let text =
            "31\t7\n5161\t1\n5164\t10\n5189\t2\n5210\t1\n5213\t-2\n5220\t9\n5221\t4\n5230\t30\n5386\t5\n5390\t-15\n";
        let parameters = parse(text.as_bytes()).unwrap();
        let mut settings = Settings {
            machine_unit: LengthUnit::Inch,
            ..Settings::default()
        };
        settings.set_parameters(&parameters);
        assert_eq!(settings.g28, Position([25.4, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        assert_eq!(settings.g30[Axis::W], 50.8);
        assert_eq!(
            (settings.g92_active, settings.g92_offset),
            (true, Position::xyz(0.0, 0.0, -50.8))
        );
        assert_eq!((settings.work_system, settings.work_offsets[0][Axis::X]), (9, 101.6));
        assert_eq!(
            (settings.work_rotations_degrees[0], settings.work_rotations_degrees[8]),
            (30.0, -15.0)
        );
        assert_eq!(settings.work_offsets[8][Axis::C], 5.0);
        let kept: Vec<(u16, f64)> = Interpreter::new(settings)
            .run(b"")
            .snapshot()
            .parameters
            .into_iter()
            .collect();
        assert_eq!(write(&kept), write(&parameters));
        for (system, expected) in [(0.0, 1), (9.9, 9), (10.0, 1), (-1.0, 1), (1e300, 1)] {
            let mut settings = Settings::default();
            settings.set_parameters(&[(5220, system)]);
            assert_eq!(settings.work_system, expected, "{system}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(entries in prop::collection::btree_map(1..=PARAMETER_MAX, -1e6..1e6, 0..60)) {
            let parameters: Vec<(u16, f64)> = entries.into_iter().collect();
            let read = parse(write(&parameters).as_bytes()).unwrap();
            for (number, value) in &parameters {
                let at = read.binary_search_by_key(number, |entry| entry.0).unwrap();
                prop_assert!((read[at].1 - value).abs() <= 0.501e-6);
            }
            prop_assert_eq!(parse(write(&read).as_bytes()).unwrap(), read);
        }

        #[test]
        fn any_octets_are_read_or_refused(
            text in prop_oneof![
                prop::collection::vec(any::<u8>(), 0..200),
                "([0-9]{1,4}[\t ;#ä]-?[0-9.]{1,3}\n?){0,30}".prop_map(String::into_bytes),
            ],
        ) {
            match parse(&text) {
                Ok(parameters) => prop_assert!(parameters.is_sorted_by(|one, other| one.0 < other.0)),
                Err(errors) => {
                    prop_assert!(!errors.is_empty());
                    prop_assert!(errors.is_sorted_by_key(|error| error.line));
                    for error in errors {
                        prop_assert!(!error.render("machine.var", &text).is_empty());
                    }
                }
            }
        }
    }
}
