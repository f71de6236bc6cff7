//! Arcs: G2 and G3, their words. The geometry is in `circle`.

use super::circle;
use super::feed::PathLength;
use crate::block::{Block, letters};
use crate::code::{Distance, Motion, plane_name};
use crate::error::ArcError;
use crate::scan::Fault;
use crate::state::{Calls, State};
use motion::canon::{Call, Plane, Position};

/// Names of the words of an arc in a plane.
pub(super) struct ArcWords {
    /// Centre letters of the first and second axis.
    pub(super) offsets: [u8; 2],
    /// Centre letter of the normal.
    other: u8,
    pub(super) offset_names: &'static str,
    axis_names: &'static str,
}

impl ArcWords {
    pub(super) fn in_plane(plane: Plane) -> ArcWords {
        let (offsets, other, offset_names, axis_names) = match plane {
            Plane::Xy => (*b"IJ", b'K', "I, J", "X and Y"),
            Plane::Zx => (*b"KI", b'J', "I, K", "X and Z"),
            Plane::Yz => (*b"JK", b'I', "J, K", "Y and Z"),
            Plane::Uv => (*b"IJ", b'K', "I, J", "U and V"),
            Plane::Wu => (*b"KI", b'J', "I, K", "U and W"),
            Plane::Vw => (*b"JK", b'I', "J, K", "V and W"),
        };
        ArcWords {
            offsets,
            other,
            offset_names,
            axis_names,
        }
    }
}

impl State {
    pub(super) fn arc(&mut self, motion: Motion, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let plane = self.modal.plane;
        let name = plane_name(plane);
        if matches!(plane, Plane::Uv | Plane::Wu | Plane::Vw) {
            return Err(block.motion_span().fault(ArcError::Plane { plane: name }));
        }
        if plane != Plane::Xy && block.has(letters(b"@^")) {
            return Err(block.motion_span().fault(ArcError::PolarPlane { plane: name }));
        }
        let mut to = self.end(block)?;
        let arc = self.arc_to(motion, block, &mut to)?;
        let length = || {
            let [first, second, normal] = plane.axes();
            let in_plane = |position: Position| [position[first], position[second]];
            let length_mm = circle::length_mm(arc, in_plane(self.at), in_plane(to));
            PathLength::Mm(libm::hypot(length_mm, to[normal] - self.at[normal]))
        };
        self.need_feed(block, length, calls)?;
        self.doubts.cut(self.source);
        calls.push_back(Call::ArcFeed {
            to,
            plane,
            centre_mm: arc.centre_mm,
            turns: arc.turns,
        });
        self.at = to;
        Ok(())
    }

    /// Circle of a G2 or G3 that ends at `to`; sets its plane coordinates to those of the start if they differ from
    /// them by rounding only, so that a full circle stays one.
    fn arc_to(&self, motion: Motion, block: &Block, to: &mut Position) -> Result<circle::Arc, Fault> {
        let plane = self.modal.plane;
        let words = ArcWords::in_plane(plane);
        let unit = self.modal.unit;
        let count = match block.word_value(b'P') {
            Some(p) => circle::turns_of(p).map_err(|kind| block.span(b'P').fault(kind))?,
            None => 1,
        };
        let turns = circle::signed_turns(motion == Motion::ArcClockwise, count);
        // 0 along the normal says nothing, and some post-processors write it in every arc.
        if block.word_value(words.other).is_some_and(|number| number != 0.0) {
            return Err(block.span(words.other).fault(ArcError::OffsetOfOtherPlane {
                letter: words.other.into(),
                plane: plane_name(plane),
                offsets: words.offset_names,
            }));
        }
        let [first, second, _] = plane.axes();
        let start_mm = [self.at[first], self.at[second]];
        let offset = words.offsets.map(|letter| {
            // Never a diameter, not even in G7 with G90.1.
            block.word_value(letter).map(|number| number * unit.mm())
        });
        let given = block.first_of(&words.offsets);

        if let Some(radius) = block.word_value(b'R') {
            if let Some(letter) = given {
                return Err(block.span(letter).fault(ArcError::Mixed { letter: letter.into() }));
            }
            let polar = block.has(letters(b"@^"));
            if block.axis(first).is_none() && block.axis(second).is_none() && !polar {
                return Err(block.span(b'R').fault(ArcError::EndMissing { axes: words.axis_names }));
            }
            let end_mm = [to[first], to[second]];
            if is_same_point(start_mm, end_mm) {
                let offsets = words.offset_names;
                return Err(block.span(b'R').fault(ArcError::EndIsStart { offsets }));
            }
            return circle::by_radius(start_mm, end_mm, radius * unit.mm(), turns, unit)
                .map_err(|kind| block.span(b'R').fault(kind));
        }

        let Some(given) = given else {
            return Err(block.motion_span().fault(ArcError::CentreMissing {
                motion: motion.name(),
                offsets: words.offset_names,
            }));
        };
        let centre_mm = match self.modal.arc_distance {
            Distance::Incremental => [
                start_mm[0] + offset[0].unwrap_or(0.0),
                start_mm[1] + offset[1].unwrap_or(0.0),
            ],
            Distance::Absolute => {
                let missing = |letter: u8| {
                    let missing = letter.into();
                    block.span(given).fault(ArcError::AbsoluteCentreIncomplete { missing })
                };
                [
                    offset[0].ok_or_else(|| missing(words.offsets[0]))?,
                    offset[1].ok_or_else(|| missing(words.offsets[1]))?,
                ]
            }
        };
        if is_same_point(start_mm, [to[first], to[second]]) {
            to[first] = start_mm[0];
            to[second] = start_mm[1];
        }
        let tolerance_mm = self.settings.arc_radius_tolerance_mm;
        circle::by_centre(start_mm, [to[first], to[second]], centre_mm, turns, unit, tolerance_mm)
            .map_err(|kind| block.span(given).fault(kind))
    }
}

/// Points closer than this are one, mm: far below any resolution, far above rounding errors.
const SAME_POINT_MM: f64 = 1e-9;

pub(super) fn is_same_point(a: [f64; 2], b: [f64; 2]) -> bool {
    libm::hypot(a[0] - b[0], a[1] - b[1]) < SAME_POINT_MM
}

#[cfg(test)]
mod tests {
    use crate::printed::printed;

    #[test]
    fn arcs_are_told_as_linuxcnc_tells_them() {
        for (line, call) in [
            (
                "G2 X10 P2 I5",
                "10.0000, 0.0000, 5.0000, 0.0000, -2, 0.0000, 0.0000, 0.0000, 0.0000",
            ),
            (
                "G3 I5 P3 Z5",
                "0.0000, 0.0000, 5.0000, 0.0000, 3, 5.0000, 0.0000, 0.0000, 0.0000",
            ),
            (
                "G2 X10 R5",
                "10.0000, 0.0000, 5.0000, 0.0000, -1, 0.0000, 0.0000, 0.0000, 0.0000",
            ),
            (
                "G18 G2 X10 Z10 R10",
                "10.0000, 10.0000, 10.0000, 0.0000, -1, 0.0000, 0.0000, 0.0000, 0.0000",
            ),
            (
                "G19 G2 Y10 Z10 R10 X5",
                "10.0000, 10.0000, 10.0000, 0.0000, -1, 5.0000, 0.0000, 0.0000, 0.0000",
            ),
            (
                "G90.1 G2 X10 I5 J0",
                "10.0000, 0.0000, 5.0000, 0.0000, -1, 0.0000, 0.0000, 0.0000, 0.0000",
            ),
            (
                "G2 X10 I5 J0 A90 B10",
                "10.0000, 0.0000, 5.0000, 0.0000, -1, 0.0000, 90.0000, 10.0000, 0.0000",
            ),
            (
                "G3 @10 ^90 R10",
                "0.0000, 10.0000, -8.6603, 5.0000, 1, 0.0000, 0.0000, 0.0000, 0.0000",
            ),
            // In G7 the centre is no diameter.
            (
                "G7 G18 G90.1 G3 X10 Z-5 I0 K-5",
                "-5.0000, 5.0000, -5.0000, 0.0000, 1, 0.0000, 0.0000, 0.0000, 0.0000",
            ),
        ] {
            let shown = printed(&format!("F100\n{line}\nM2\n"));
            let arc = shown.lines().find_map(|line| line.strip_prefix("ARC_FEED("));
            assert_eq!(arc, Some(format!("{call})").as_str()), "{line}: {shown}");
        }
    }

    #[test]
    fn every_rule_has_its_error() {
        for (line, error) in [
            ("G17.1 G2 X1 I1", "2:7: there are no arcs in the plane G17.1"),
            ("G2 X10", "2:1: G2 needs I, J or R"),
            ("G2 X10 K5", "2:8: K is no centre offset of the plane G17"),
            ("G2 X10 I5 R5", "2:8: an arc takes I or R"),
            (
                "G90.1 G2 X10 I5",
                "2:14: absolute arc centres (G90.1) need both coordinates: J is missing",
            ),
            ("G2 Z5 R5", "2:7: an arc by R needs its end point"),
            ("G2 X0 Y0 R5", "2:10: an arc by R cannot end where it starts"),
            (
                "G2 X10 R4.998",
                "2:8: radius 4.9980 is too small: half the distance to the end point is 5.0000",
            ),
            (
                "G2 X10.03 I5",
                "2:11: radius at start 5.0000, at end 5.0300: difference 0.0300 > 0.0283 tolerance",
            ),
            ("G2 I0 J0", "2:4: the centre of the arc lies on its start or end"),
            ("G2 X10 I5 P0", "2:11: P0 of an arc is its number of turns"),
        ] {
            let shown = printed(&format!("F100\n{line}\nM2\n"));
            assert!(shown.lines().any(|line| line.starts_with(error)), "{line}: {shown}");
        }
    }
}
