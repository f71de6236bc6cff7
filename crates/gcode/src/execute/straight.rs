//! Straight moves: G0, G1, with G53, polar coordinates and wrapped rotary axes.

use super::feed::PathLength;
use crate::block::Block;
use crate::code::{Distance, NonModal};
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::{Calls, State};
use motion::canon::{Axis, Call, Position};

impl State {
    pub(super) fn traverse(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let to = self.end_of_straight(block)?;
        calls.push_back(Call::StraightTraverse { to });
        self.at = to;
        Ok(())
    }

    pub(super) fn straight_feed(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let to = self.end_of_straight(block)?;
        self.need_feed(block, || PathLength::straight(self.at, to), calls)?;
        self.doubts.cut(self.source);
        calls.push_back(Call::StraightFeed { to });
        self.at = to;
        Ok(())
    }

    #[inline]
    fn end_of_straight(&self, block: &Block) -> Result<Position, Fault> {
        match block.codes.non_modal {
            Some(code) if code.value == NonModal::MachineCoordinates => self.end_in_machine(block),
            Some(_) | None => self.end(block),
        }
    }

    /// End of a move in work coordinates.
    #[inline]
    pub(super) fn end(&self, block: &Block) -> Result<Position, Fault> {
        let mut to = self.at;
        for axis in Axis::ALL {
            if let Some(number) = block.axis(axis) {
                to[axis] = self
                    .end_of_axis(axis, number)
                    .map_err(|kind| (block.span(axis.letter() as u8), kind))?;
            }
        }
        if block.has(crate::block::letters(b"@^")) {
            self.polar(block, &mut to)?;
        }
        Ok(to)
    }

    #[inline]
    fn end_of_axis(&self, axis: Axis, number: f64) -> Result<f64, ErrorKind> {
        let mut value = self.length(axis, number);
        if axis == Axis::X && self.modal.diameter {
            value /= 2.0;
        }
        match self.modal.distance {
            Distance::Incremental => Ok(self.at[axis] + value),
            Distance::Absolute if self.settings.wrapped_rotary[axis as usize] => wrapped(self.at[axis], axis, number),
            Distance::Absolute => Ok(value),
        }
    }
}

impl State {
    /// End of a G53 move: the words are machine coordinates, without work system, G92 and tool.
    fn end_in_machine(&self, block: &Block) -> Result<Position, Fault> {
        if block.has(crate::block::letters(b"@^")) {
            return Err((block.motion_span(), ErrorKind::PolarInMachineCoordinates));
        }
        let mut machine = self.machine();
        // The words name where the spindle goes, not the tip of the tool.
        for axis in Axis::ALL {
            if let Some(number) = block.axis(axis) {
                let mut value = self.length(axis, number);
                if axis == Axis::X && self.modal.diameter {
                    value /= 2.0;
                }
                machine[axis] = if self.settings.wrapped_rotary[axis as usize] {
                    wrapped(machine[axis], axis, number).map_err(|kind| (block.span(axis.letter() as u8), kind))?
                } else {
                    value
                };
            }
        }
        let mut to = self.offsets.work(machine);
        // Axes that are not named stay to the bit, unless a rotation couples them.
        for axis in Axis::ALL {
            let coupled = self.offsets.rotation_degrees != 0.0 && matches!(axis, Axis::X | Axis::Y);
            if block.axis(axis).is_none() && !coupled {
                to[axis] = self.at[axis];
            }
        }
        Ok(to)
    }

    /// `@` is the distance from the work origin in XY, `^` the angle; either one alone keeps the other.
    fn polar(&self, block: &Block, to: &mut Position) -> Result<(), Fault> {
        if let Some(letter) = block.first_of(b"XY") {
            let letter = letter.into();
            return Err((block.motion_span(), ErrorKind::PolarMixed { letter }));
        }
        let (x, y) = (self.at[Axis::X], self.at[Axis::Y]);
        let (mut radius, mut degrees) = (libm::hypot(x, y), libm::atan2(y, x).to_degrees());
        let distance = block.word_value(b'@').map(|number| number * self.modal.unit.mm());
        let angle = block.word_value(b'^');
        match self.modal.distance {
            Distance::Absolute if angle.is_none() && radius == 0.0 => {
                return Err((block.motion_span(), ErrorKind::PolarAngleMissing));
            }
            Distance::Absolute => {
                radius = distance.unwrap_or(radius);
                degrees = angle.unwrap_or(degrees);
            }
            Distance::Incremental if radius == 0.0 => {
                return Err((block.motion_span(), ErrorKind::PolarAtOrigin));
            }
            Distance::Incremental => {
                radius += distance.unwrap_or(0.0);
                degrees += angle.unwrap_or(0.0);
            }
        }
        let (sin, cos) = libm::sincos(degrees.to_radians());
        to[Axis::X] = radius * cos;
        to[Axis::Y] = radius * sin;
        Ok(())
    }
}

/// Places closer than this are one, degrees: a rounding error must not become a whole turn.
const SAME_PLACE_DEGREES: f64 = 1e-9;

/// Where an axis without ends goes from `at`: the number is a place on the turn, its sign (also that of -0) tells which
/// way round, LinuxCNC's rule.
fn wrapped(at: f64, axis: Axis, number: f64) -> Result<f64, ErrorKind> {
    if number.abs() >= 360.0 {
        let letter = axis.letter();
        return Err(ErrorKind::WrappedRotary { letter, value: number });
    }
    Ok(turned_to(at, number.abs(), number.is_sign_negative()))
}

/// The nearest value from `at` on, upwards or downwards, at which an axis without ends shows a place.
pub(super) fn turned_to(at: f64, place: f64, downwards: bool) -> f64 {
    let ahead = (place - at).rem_euclid(360.0);
    let same = SAME_PLACE_DEGREES..=360.0 - SAME_PLACE_DEGREES;
    // Counted in turns from 0, so that the place itself is met to the bit.
    let turns = ((at - place) / 360.0).floor();
    match (same.contains(&ahead), downwards) {
        (false, _) => place + ((at - place) / 360.0).round() * 360.0,
        (true, false) => place + (turns + 1.0) * 360.0,
        (true, true) => place + turns * 360.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::printed::{printed, printed_with};
    use crate::{NoMachine, Settings};

    fn with_wrapped_a(program: &str) -> String {
        let mut settings = Settings::default();
        settings.wrapped_rotary[Axis::A as usize] = true;
        printed_with(program, settings, NoMachine)
    }

    /// The A words of moves.
    fn places(shown: &str) -> Vec<&str> {
        let moves = shown.lines().filter(|line| line.starts_with("STRAIGHT"));
        moves.filter_map(|line| line.split(", ").nth(3)).collect()
    }

    #[test]
    fn the_sign_tells_a_wrapped_axis_which_way_round() {
        // As LinuxCNC's interpreter prints it.
        let shown = with_wrapped_a("G0 A350\nA10\nA-350\nG91 A500\nG90 A10\nA-10\nA-0\nA0\nA-90\nA-90\nM2\n");
        let expected = [
            "350.0000",
            "370.0000",
            "350.0000",
            "850.0000",
            "1090.0000",
            "1090.0000",
            "1080.0000",
            "1080.0000",
            "810.0000",
            "810.0000",
        ];
        assert_eq!(places(&shown), expected, "{shown}");
    }

    #[test]
    fn a_wrapped_axis_returns_to_a_stored_point_upwards() {
        let shown = with_wrapped_a("G0 A45\nG28.1\nG0 A90\nG28\nG28 A10\nG28 A-20\nM2\n");
        let expected = [
            "45.0000", "90.0000", "90.0000", "405.0000", "730.0000", "765.0000", "740.0000", "765.0000",
        ];
        assert_eq!(places(&shown), expected, "{shown}");
    }

    #[test]
    fn a_wrapped_axis_knows_less_than_a_turn() {
        for (program, error) in [
            ("G0 A360", "1:4: A360 is no place on a rotary axis without ends"),
            ("G53 G0 A-400", "1:8: A-400 is no place on a rotary axis without ends"),
        ] {
            let shown = with_wrapped_a(&format!("{program}\nM2\n"));
            assert!(shown.starts_with(error), "{shown}");
        }
        assert_eq!(places(&with_wrapped_a("G91 G0 A400\nM2\n")), ["400.0000"]);
        assert_eq!(
            places(&with_wrapped_a("G0 A45\nG53 G0 A10\nG53 G0 A-10\nM2\n")),
            ["45.0000", "370.0000", "370.0000"]
        );
    }

    #[test]
    fn a_rounding_error_is_no_turn() {
        for (at, place, down, expected) in [
            (10.0, 10.0, false, 10.0),
            (370.1 + 1e-12, 10.1, false, 370.1),
            (370.1 - 1e-12, 10.1, true, 370.1),
            (-350.0, 10.0, true, -350.0),
            (-350.0, 9.0, false, 9.0),
            (-350.0, 9.0, true, -351.0),
            (719.0, 0.0, false, 720.0),
        ] {
            let to = turned_to(at, place, down);
            assert!((to - expected).abs() < 1e-9, "{at} to {place}: {to}");
        }
    }

    #[test]
    fn polar_coordinates_need_a_direction() {
        for (program, error) in [
            ("G0 @5", "1:1: a polar distance (@) from the origin needs an angle"),
            ("G91 G0 @5 ^30", "1:5: incremental polar coordinates need a direction"),
            ("G0 @5 X1", "1:1: X and polar coordinates"),
            (
                "F9 G18 G3 @5 ^90 R10",
                "1:8: polar coordinates (@, ^) of an arc lie in the XY plane",
            ),
        ] {
            let shown = printed(&format!("{program}\nM2\n"));
            assert!(shown.lines().any(|line| line.starts_with(error)), "{program}: {shown}");
        }
        let shown = printed("G0 @10 ^0\n^90\n@5\nG91 @1 ^-90\nM2\n");
        assert_eq!(
            shown,
            "STRAIGHT_TRAVERSE(10.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)\n\
             STRAIGHT_TRAVERSE(0.0000, 10.0000, 0.0000, 0.0000, 0.0000, 0.0000)\n\
             STRAIGHT_TRAVERSE(0.0000, 5.0000, 0.0000, 0.0000, 0.0000, 0.0000)\n\
             COMMENT(\"interpreter: distance mode changed to incremental\")\n\
             STRAIGHT_TRAVERSE(6.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)\n"
        );
    }
}
