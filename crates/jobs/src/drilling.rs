//! Holes: on a circle, and in rows.
//!
//! In:  where they are, how deep, by which cycle. Out: the cycle at each hole, G81, G82, G83 or G73, between them at the safe height.

use crate::fields::{Common, Coolant, Wrong, job, steps};
use crate::writer::{Writer, number};
use libm::{cos, sin};
use protocol::message;
use serde::{Deserialize, Serialize};

/// How a hole is drilled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cycle {
    /// At once: G81.
    #[default]
    Drill,
    /// With a dwell at the bottom: G82.
    Dwell,
    /// In pecks, out of the hole after each: G83.
    Peck,
    /// In pecks, a little back after each: G73.
    ChipBreak,
}

impl Cycle {
    pub(crate) const WORDS: &'static [&'static str] = &["drill", "dwell", "peck", "chip_break"];
}

job! {
    "Holes on a circle"
    BoltCircle {
        #[doc = " X of the middle of the circle."]
        x = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Y of its middle."]
        y = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Diameter of the circle on which the holes lie."]
        diameter = number("mm", 60.0, 0.1, 10_000.0);
        #[doc = " Number of holes."]
        count = whole(6, 1, 1000);
        #[doc = " Angle of the first hole, counter-clockwise from X."]
        angle = number("degrees", 0.0, -360.0, 360.0);
        #[doc = " Angle from the first to the last hole. 360: evenly all around."]
        span = number("degrees", 360.0, 0.001, 360.0);
        #[doc = " Depth of the tip of the drill below the surface."]
        depth = number("mm", 10.0, 0.001, 1000.0);
        #[doc = " Diameter of the drill."]
        tool_diameter = number("mm", 5.0, 0.01, 1000.0);
        #[doc = " How a hole is drilled: at once, with a dwell, or in pecks."]
        cycle = choice(Cycle);
        #[doc = " Maximum depth of a peck; all pecks are equal."]
        peck = number("mm", 3.0, 0.001, 1000.0);
        #[doc = " Dwell at the bottom, with the cycle of that name."]
        dwell = number("s", 0.5, 0.0, 60.0);
        #[doc = " How far above the surface the feed begins."]
        retract = number("mm", 1.0, 0.0, 1000.0);
    }
}

job! {
    "Rows of holes"
    HoleRows {
        #[doc = " X of the first hole."]
        x = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Y of the first hole."]
        y = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Holes in a row."]
        columns = whole(4, 1, 1000);
        #[doc = " Number of rows."]
        rows = whole(3, 1, 1000);
        #[doc = " Distance of holes in a row."]
        column_spacing = number("mm", 20.0, -10_000.0, 10_000.0);
        #[doc = " Distance of rows."]
        row_spacing = number("mm", 20.0, -10_000.0, 10_000.0);
        #[doc = " Direction of rows, counter-clockwise from X."]
        angle = number("degrees", 0.0, -360.0, 360.0);
        #[doc = " Depth of the tip of the drill below the surface."]
        depth = number("mm", 10.0, 0.001, 1000.0);
        #[doc = " Diameter of the drill."]
        tool_diameter = number("mm", 5.0, 0.01, 1000.0);
        #[doc = " How a hole is drilled: at once, with a dwell, or in pecks."]
        cycle = choice(Cycle);
        #[doc = " Maximum depth of a peck; all pecks are equal."]
        peck = number("mm", 3.0, 0.001, 1000.0);
        #[doc = " Dwell at the bottom, with the cycle of that name."]
        dwell = number("s", 0.5, 0.0, 60.0);
        #[doc = " How far above the surface the feed begins."]
        retract = number("mm", 1.0, 0.0, 1000.0);
    }
}

impl BoltCircle {
    /// The program.
    ///
    /// # Errors
    /// Which number is wrong, and what to do about it.
    pub fn program(&self) -> Result<String, Wrong> {
        let step = match self.span {
            span if span > 360.0 - 1e-6 => 360.0 / f64::from(self.count),
            span => span / f64::from(self.count.max(2) - 1),
        };
        let radius = self.diameter / 2.0;
        let hole = |index: u32| {
            let angle = (self.angle + f64::from(index) * step).to_radians();
            [self.x + radius * cos(angle), self.y + radius * sin(angle)]
        };
        // Of neighbours; the last hole may be closer to the first one.
        let closest = match self.span {
            span if self.count > 2 && span < 360.0 - 1e-6 => step.min(360.0 - span),
            _ => step,
        };
        let chord = 2.0 * radius * sin((closest / 2.0).to_radians());
        if self.count > 1 && chord < self.tool_diameter {
            return touching("count", self.tool_diameter, chord);
        }
        let holes: Vec<_> = (0..self.count).map(hole).collect();
        Holes {
            depth: self.depth,
            cycle: self.cycle,
            peck: self.peck,
            dwell: self.dwell,
            retract: self.retract,
            tool_diameter: self.tool_diameter,
            common: self.common(),
        }
        .write(
            &format!(
                "Holes on a circle: {} on {} mm, {} mm deep",
                self.count,
                number(self.diameter),
                number(self.depth)
            ),
            &format!(
                "Middle at X{} Y{}, first hole at {} degrees, then every {} degrees",
                number(self.x),
                number(self.y),
                number(self.angle),
                number(step)
            ),
            &holes,
        )
    }
}

impl HoleRows {
    /// The program.
    ///
    /// # Errors
    /// Which number is wrong, and what to do about it.
    pub fn program(&self) -> Result<String, Wrong> {
        for (count, field, spacing) in [
            (self.columns, "column_spacing", self.column_spacing),
            (self.rows, "row_spacing", self.row_spacing),
        ] {
            if count > 1 && spacing.abs() < self.tool_diameter {
                return touching(field, self.tool_diameter, spacing.abs());
            }
        }
        let angle = self.angle.to_radians();
        let (sin, cos) = (sin(angle), cos(angle));
        let mut holes = Vec::new();
        for row in 0..self.rows {
            for index in 0..self.columns {
                if holes.len() > crate::LINES_MAX as usize {
                    break;
                }
                // Every other row backwards: the shorter way.
                let column = if row % 2 == 0 { index } else { self.columns - 1 - index };
                let u = f64::from(column) * self.column_spacing;
                let v = f64::from(row) * self.row_spacing;
                holes.push([self.x + u * cos - v * sin, self.y + u * sin + v * cos]);
            }
        }
        Holes {
            depth: self.depth,
            cycle: self.cycle,
            peck: self.peck,
            dwell: self.dwell,
            retract: self.retract,
            tool_diameter: self.tool_diameter,
            common: self.common(),
        }
        .write(
            &format!(
                "Rows of holes: {} by {}, {} mm deep",
                self.columns,
                self.rows,
                number(self.depth)
            ),
            &format!(
                "First hole at X{} Y{}, spacing {} mm in rows at {} degrees, rows {} mm apart",
                number(self.x),
                number(self.y),
                number(self.column_spacing),
                number(self.angle),
                number(self.row_spacing)
            ),
            &holes,
        )
    }
}

/// Holes that run into each other.
fn touching<T>(field: &'static str, diameter: f64, distance: f64) -> Result<T, Wrong> {
    Wrong::at(
        field,
        message!(
            "job.holes_touch",
            "holes of {diameter} mm are only {distance:.3} mm apart: they would run into each other",
            diameter = diameter,
            distance = distance
        ),
    )
}

/// What all holes of a job have.
struct Holes {
    depth: f64,
    cycle: Cycle,
    peck: f64,
    dwell: f64,
    retract: f64,
    tool_diameter: f64,
    common: Common,
}

impl Holes {
    fn write(&self, title: &str, places: &str, holes: &[[f64; 2]]) -> Result<String, Wrong> {
        let tool = format!("drill of {} mm", number(self.tool_diameter));
        let mut writer = Writer::new(title, &[places.to_owned()], &tool, &self.common)?;
        let (bottom, level) = (self.common.top - self.depth, self.common.top + self.retract);
        if level > self.common.safe_height {
            return Wrong::at(
                "retract",
                message!(
                    "job.retract",
                    "feed cannot begin at {level} mm, above the safe height of {safe} mm: lower it, or raise the safe height",
                    level = level,
                    safe = self.common.safe_height
                ),
            );
        }
        let way = level - bottom;
        // Rounded up, so that no peck of a rounding is left.
        let peck = (way / f64::from(steps(way, self.peck)) * 1e4).ceil() / 1e4;
        let ends = format!("Z{} R{}", number(bottom), number(level));
        let (what, cycle) = match self.cycle {
            Cycle::Drill => ("Drilling".to_owned(), format!("G81 {ends}")),
            Cycle::Dwell => (
                format!("Drilling with a dwell of {} s", number(self.dwell)),
                format!("G82 {ends} P{}", number(self.dwell)),
            ),
            Cycle::Peck => (
                format!("Deep hole drilling in pecks of {} mm", number(peck)),
                format!("G83 {ends} Q{}", number(peck)),
            ),
            Cycle::ChipBreak => (
                format!("Drilling with chip breaking every {} mm", number(peck)),
                format!("G73 {ends} Q{}", number(peck)),
            ),
        };
        writer.comment(&what)?;
        writer.cycle(&cycle, holes, self.common.feed)?;
        writer.end()
    }
}
