//! Parameters that tell something of the state: `#5420`, `#<_x>` and the like.
//!
//! Lengths are in the units of the program, angles in degrees.

use super::State;
use crate::code::{Distance, FeedUnit, Retract};
use crate::expression::Values;
use motion::canon::{Axis, Cutter, LengthUnit, Plane, Position, Side, SpindleDirection, SpindleMode};

impl State {
    /// A length or angle as the program speaks of it.
    fn in_program_units(&self, position: Position, axis: Axis) -> f64 {
        if axis.is_rotary() {
            position[axis]
        } else {
            position[axis] / self.modal.unit.mm()
        }
    }

    /// The position that a program sees: that of the tool's centre while this differs from the programmed one. In the
    /// profile of a lathe cycle nothing moves yet, and it is the end of the last move of the profile.
    fn visible_position(&self) -> Position {
        match &self.turning {
            Some(_) => self.at,
            None => self.compensation.centre.unwrap_or(self.at),
        }
    }

    /// A length in the unit of the machine, or an angle.
    fn in_machine_units(&self, position: Position, index: u32, first: u32) -> f64 {
        let axis = Axis::ALL[(index - first) as usize];
        if axis.is_rotary() {
            position[axis]
        } else {
            position[axis] / self.settings.machine_unit.mm()
        }
    }

    fn in_program_units_at(&self, position: Position, index: u32, first: u32) -> f64 {
        self.in_program_units(position, Axis::ALL[(index - first) as usize])
    }
}

impl Values for State {
    fn numbered(&self, index: u32) -> Option<f64> {
        if index < 5021 {
            return Some(self.parameters.get(index));
        }
        Some(match index {
            5021..=5029 => self.in_program_units_at(self.machine(), index, 5021),
            5081..=5089 => self.in_machine_units(self.offsets.tool, index, 5081),
            5400 => f64::from(self.tools.in_spindle),
            5401..=5409 => self.in_machine_units(self.tool().offset, index, 5401),
            5410 => self.tool().diameter_mm / self.settings.machine_unit.mm(),
            5411 => self.tool().front_angle_deg,
            5412 => self.tool().back_angle_deg,
            5413 => f64::from(self.tool().orientation),
            5420..=5428 => self.in_program_units_at(self.visible_position(), index, 5420),
            _ => self.parameters.get(index),
        })
    }

    fn named(&self, name: &str) -> Option<f64> {
        self.parameters.named(name).or_else(|| self.predefined(name))
    }

    fn nearest(&self, name: &str) -> Option<String> {
        self.parameters.nearest(name)
    }

    #[inline]
    fn remapped(&self, letter: u8, number: f64) -> Option<usize> {
        if self.remaps.is_empty() {
            return None;
        }
        let found = self.remaps.iter().position(|entry| entry.is(letter, number))?;
        // Within its own subroutine a code is the usual one.
        (!self.remapping.contains(&found)).then_some(found)
    }
}

impl State {
    /// The table's entry of the tool in the spindle, zeros without one.
    pub(crate) fn tool(&self) -> crate::Tool {
        self.tools.table.with_wear(self.tools.in_spindle).unwrap_or_default()
    }

    fn predefined(&self, name: &str) -> Option<f64> {
        let modal = &self.modal;
        let spindle = &modal.spindles[0];
        let flag = |on: bool| Some(f64::from(on));
        if let Some(letter) = name.strip_prefix("_abs_") {
            let axis = axis_of(letter)?;
            return Some(self.in_program_units(self.machine(), axis));
        }
        if let Some(axis) = name.strip_prefix('_').and_then(axis_of) {
            return Some(self.in_program_units(self.visible_position(), axis));
        }
        match name {
            "_vmajor" => Some(2.9),
            "_vminor" => Some(0.0),
            "_line" => Some(f64::from(self.source.line)),
            "_motion_mode" => Some(f64::from(modal.motion.map_or(800, |motion| motion.code()))),
            "_plane" => Some(match modal.plane {
                Plane::Xy => 170.0,
                Plane::Zx => 180.0,
                Plane::Yz => 190.0,
                Plane::Uv => 171.0,
                Plane::Wu => 181.0,
                Plane::Vw => 191.0,
            }),
            "_ccomp" => Some(match self.compensation.cutter {
                None => 400.0,
                Some(Cutter { side: Side::Left, .. }) => 410.0,
                Some(Cutter { side: Side::Right, .. }) => 420.0,
            }),
            "_metric" => flag(modal.unit == LengthUnit::Millimetre),
            "_imperial" => flag(modal.unit == LengthUnit::Inch),
            "_metric_machine" => flag(self.settings.machine_unit == LengthUnit::Millimetre),
            "_absolute" => flag(modal.distance == Distance::Absolute),
            "_incremental" => flag(modal.distance == Distance::Incremental),
            "_inverse_time" => flag(modal.feed_unit == FeedUnit::InverseTime),
            "_units_per_minute" => flag(modal.feed_unit == FeedUnit::UnitsPerMinute),
            "_units_per_rev" => flag(modal.feed_unit == FeedUnit::UnitsPerTurn),
            "_coord_system" => Some(match self.offsets.system {
                system @ 1..=6 => 530.0 + 10.0 * f64::from(system),
                system => 584.0 + f64::from(system),
            }),
            "_tool_offset" => flag(self.offsets.tool != Position::ZERO),
            "_retract_r_plane" => flag(modal.retract == Retract::R),
            "_retract_old_z" => flag(modal.retract == Retract::OldZ),
            "_spindle_rpm_mode" => flag(spindle.mode == SpindleMode::Rpm),
            "_spindle_css_mode" => flag(spindle.mode != SpindleMode::Rpm),
            "_ijk_absolute_mode" => flag(modal.arc_distance == Distance::Absolute),
            "_lathe_diameter_mode" => flag(modal.diameter),
            "_lathe_radius_mode" => flag(!modal.diameter),
            "_spindle_on" => flag(spindle.turning.is_some()),
            "_spindle_cw" => flag(spindle.turning == Some(SpindleDirection::Clockwise)),
            "_mist" => flag(modal.mist),
            "_flood" => flag(modal.flood),
            "_speed_override" => flag(modal.overrides.speed[0]),
            "_feed_override" => flag(modal.overrides.feed),
            "_adaptive_feed" => flag(modal.overrides.adaptive),
            "_feed_hold" => flag(modal.overrides.hold),
            "_feed" => Some(modal.feed),
            "_rpm" => Some(spindle.speed),
            "_current_tool" => Some(f64::from(self.tools.in_spindle)),
            "_current_pocket" => Some(self.tools.pocket_of(self.tools.line)),
            "_selected_tool" => Some(f64::from(self.tools.selected.unwrap_or(0))),
            "_selected_pocket" => Some(
                self.tools
                    .pocket_of(self.tools.selected.and_then(|tool| self.tools.line_of(tool))),
            ),
            "_value" | "_value_returned" => Some(0.0), // set by a return, then found among the globals
            "_task" => flag(self.pins.is_some()),      // a machine runs the program
            "_call_level" => Some(f64::from(self.call_level)),
            "_remap_level" => Some(self.remapping.len() as f64),
            name => self.ini_value(name).or_else(|| self.pin_value(name)),
        }
    }

    /// `#<_hal[pin]>`: of a running control, else as the settings say.
    fn pin_value(&self, name: &str) -> Option<f64> {
        let pin = name.strip_prefix("_hal[")?.strip_suffix(']')?;
        match &self.pins {
            Some(pins) => pins.value(pin),
            None => self.settings.pin_values.get(pin).copied(),
        }
    }

    /// `#<_ini[section]key>`.
    fn ini_value(&self, name: &str) -> Option<f64> {
        let (section, key) = name.strip_prefix("_ini[")?.split_once(']')?;
        let key = (section.to_string(), key.to_string());
        self.settings.ini_values.get(&key).copied()
    }
}

/// The axis of a name that is one small letter.
fn axis_of(name: &str) -> Option<Axis> {
    let mut characters = name.chars();
    let axis = Axis::from_letter(characters.next()?)?;
    characters.next().is_none().then_some(axis)
}
