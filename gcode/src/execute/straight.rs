//! Straight moves: G0, G1, with G53, polar coordinates and wrapped rotary axes.

use super::feed::PathLength;
use super::{Calls, motion_span};
use crate::block::Block;
use crate::code::{Distance, NonModal};
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::State;
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
        calls.push_back(Call::StraightFeed { to });
        self.at = to;
        Ok(())
    }

    #[inline]
    fn end_of_straight(&self, block: &Block) -> Result<Position, Fault> {
        match block.codes.non_modal {
            Some(code) if code.value == NonModal::MachineCoordinates => self.end_in_machine(block, code.span),
            Some(_) | None => self.end(block),
        }
    }

    /// End of a move in work coordinates.
    #[inline]
    pub(super) fn end(&self, block: &Block) -> Result<Position, Fault> {
        let mut to = self.at;
        for axis in Axis::ALL {
            if let Some(number) = block.axis(axis) {
                to[axis] = self.end_of_axis(axis, number);
            }
        }
        if block.has(crate::block::letters(b"@^")) {
            self.polar(block, &mut to)?;
        }
        Ok(to)
    }

    #[inline]
    fn end_of_axis(&self, axis: Axis, number: f64) -> f64 {
        let mut value = self.length(axis, number);
        if axis == Axis::X && self.modal.diameter {
            value /= 2.0;
        }
        match self.modal.distance {
            Distance::Incremental => self.at[axis] + value,
            Distance::Absolute if self.settings.wrapped_rotary[axis as usize] => self.wrapped(axis, number),
            Distance::Absolute => value,
        }
    }
}

impl State {
    /// End of a G53 move: the words are machine coordinates, without work system, G92 and tool.
    fn end_in_machine(&self, block: &Block, span: crate::scan::Span) -> Result<Position, Fault> {
        if self.modal.distance == Distance::Incremental {
            return Err((span, ErrorKind::MachineCoordinatesIncremental));
        }
        if block.has(crate::block::letters(b"@^")) {
            return Err((motion_span(block), ErrorKind::PolarInMachineCoordinates));
        }
        let mut machine = self.machine();
        // The words name where the spindle goes, not the tip of the tool.
        for axis in Axis::ALL {
            if let Some(number) = block.axis(axis) {
                let mut value = self.length(axis, number);
                if axis == Axis::X && self.modal.diameter {
                    value /= 2.0;
                }
                machine[axis] = value;
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
            return Err((motion_span(block), ErrorKind::PolarMixed { letter }));
        }
        let (x, y) = (self.at[Axis::X], self.at[Axis::Y]);
        let (mut radius, mut degrees) = (x.hypot(y), y.atan2(x).to_degrees());
        let distance = block.word_value(b'@').map(|number| number * self.modal.unit.mm());
        let angle = block.word_value(b'^');
        match self.modal.distance {
            Distance::Absolute => {
                radius = distance.unwrap_or(radius);
                degrees = angle.unwrap_or(degrees);
            }
            Distance::Incremental if radius == 0.0 => {
                return Err((motion_span(block), ErrorKind::PolarAtOrigin));
            }
            Distance::Incremental => {
                radius += distance.unwrap_or(0.0);
                degrees += angle.unwrap_or(0.0);
            }
        }
        let (sin, cos) = degrees.to_radians().sin_cos();
        to[Axis::X] = radius * cos;
        to[Axis::Y] = radius * sin;
        Ok(())
    }

    /// The nearest place at which an axis without ends shows an angle, in the direction of the number's sign.
    fn wrapped(&self, axis: Axis, number: f64) -> f64 {
        let turn = self.at[axis] - self.at[axis].rem_euclid(360.0);
        let target = turn + number.abs();
        if number.is_sign_negative() && target > self.at[axis] {
            target - 360.0
        } else if number.is_sign_positive() && target < self.at[axis] {
            target + 360.0
        } else {
            target
        }
    }
}
