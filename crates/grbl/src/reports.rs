//! Answers to `$$`, `$#` and `$I`.

use crate::status::{Machine, triple};
use std::fmt::Write;

/// What version this claims to be: senders look at it.
pub(crate) const VERSION: &str = "1.1h";

/// Origins in machine coordinates, mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Offsets {
    /// G54 to G59.
    pub systems: [[f64; 3]; 6],
    /// G28 and G30, as far as they are known.
    pub homes: [[f64; 3]; 2],
    /// G92, added to the work system.
    pub g92: [f64; 3],
    /// Of the tool in force, mm.
    pub tool_length_mm: f64,
}

/// `$#`; `probed`: where the last probing move touched something, machine coordinates, and whether it did.
pub(crate) fn offsets(offsets: &Offsets, probed: ([f64; 3], bool)) -> String {
    let mut text = String::new();
    let systems = (54..)
        .zip(&offsets.systems)
        .map(|(number, origin)| (format!("G{number}"), *origin));
    let homes = ["G28", "G30"].map(str::to_owned).into_iter().zip(offsets.homes);
    for (name, place) in systems.chain(homes).chain([("G92".to_owned(), offsets.g92)]) {
        // Writing to a text cannot fail.
        let _ = write!(text, "[{name}:{}]\r\n", triple(place));
    }
    let _ = write!(text, "[TLO:{:.3}]\r\n{}", offsets.tool_length_mm, probe(probed));
    text
}

/// `[PRB:..]`
pub(crate) fn probe((place, touched): ([f64; 3], bool)) -> String {
    format!("[PRB:{}:{}]\r\n", triple(place), u8::from(touched))
}

/// `$I`
pub(crate) fn build() -> String {
    format!("[VER:{VERSION}.20190825:isocnc]\r\n[OPT:VM,15,128]\r\n")
}

/// `$$`: as the machine file has it; none can be set here.
pub(crate) fn settings(machine: &Machine) -> String {
    let mut text = String::new();
    let mut tell = |number: u16, value: String| {
        let _ = write!(text, "${number}={value}\r\n");
    };
    for (number, value) in [
        // Pulses of steps, their delay and directions: the drives have them.
        (0, 10),
        (1, 255),
        (2, 0),
        (3, 0),
        (4, 0),
        (5, 0),
        (6, 0),
        // Machine coordinates and the buffer are in the status.
        (10, 3),
    ] {
        tell(number, value.to_string());
    }
    for (number, value) in [
        (11, "0.010"),
        (12, "0.002"),
        (13, "0"),
        (20, "1"),
        (21, "1"),
        (22, "1"),
        (23, "0"),
    ] {
        tell(number, value.to_owned());
    }
    for (number, value) in [(24, "25.000"), (25, "500.000"), (26, "250"), (27, "1.000")] {
        tell(number, value.to_owned());
    }
    tell(30, format!("{:.0}", machine.rpm_max));
    tell(31, "0".into());
    tell(32, "0".into());
    let axes = || {
        (0..)
            .zip(machine.axes)
            .map(|(place, axis)| (place, axis.unwrap_or_default()))
    };
    for (place, _) in axes() {
        tell(100 + place, "1000.000".into());
    }
    for (place, axis) in axes() {
        tell(110 + place, format!("{:.3}", axis.velocity_mm_min));
    }
    for (place, axis) in axes() {
        tell(120 + place, format!("{:.3}", axis.acceleration_mm_s2));
    }
    for (place, axis) in axes() {
        tell(130 + place, format!("{:.3}", axis.travel_mm[1] - axis.travel_mm[0]));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::Axis;

    #[test]
    fn offsets_are_told_in_the_order_of_grbl() {
        let mut told = Offsets::default();
        told.systems[0] = [1.0, 2.0, 3.0];
        told.homes[1] = [4.0, 0.0, 0.0];
        told.tool_length_mm = 12.5;
        let text = offsets(&told, ([7.0, 8.0, -9.0], true));
        let names: Vec<&str> = text.lines().map(|line| &line[1..4]).collect();
        assert_eq!(
            names,
            [
                "G54", "G55", "G56", "G57", "G58", "G59", "G28", "G30", "G92", "TLO", "PRB"
            ]
        );
        assert!(text.starts_with("[G54:1.000,2.000,3.000]\r\n"), "{text}");
        assert!(text.contains("[G30:4.000,0.000,0.000]\r\n"), "{text}");
        assert!(
            text.ends_with("[TLO:12.500]\r\n[PRB:7.000,8.000,-9.000:1]\r\n"),
            "{text}"
        );
    }

    #[test]
    fn settings_show_the_machine() {
        let axis = Axis {
            travel_mm: [-5.0, 305.0],
            velocity_mm_min: 9000.0,
            acceleration_mm_s2: 1500.0,
        };
        let machine = Machine {
            axes: [Some(axis), None, None],
            rpm_max: 24000.0,
            ..Machine::default()
        };
        let text = settings(&machine);
        let value = |number: u16| {
            let start = format!("${number}=");
            text.lines()
                .find_map(|line| line.strip_prefix(&start))
                .unwrap_or("missing")
        };
        assert_eq!(
            [10, 20, 22, 30, 110, 120, 130].map(value),
            ["3", "1", "1", "24000", "9000.000", "1500.000", "310.000"]
        );
        assert_eq!([13, 32, 131].map(value), ["0", "0", "0.000"]);
        for number in (10..=13)
            .chain(20..=27)
            .chain(30..=32)
            .chain(100..=102)
            .chain(110..=112)
        {
            assert_ne!(value(number), "missing", "${number}");
        }
        assert!(build().starts_with("[VER:1.1h."));
    }
}
