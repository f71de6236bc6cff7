//! Pockets: a rectangle, a circle.
//!
//! In:  place, size and depth, tool, stepover, stepdown. Out: for each level an entry in the middle, then rings outwards, counter-clockwise:
//! climb milling. With a finishing allowance the wall is cut once at full depth, with arcs as its beginning and its end.
//!
//! Distances are those of the middle of the tool; `d` is how far a ring lies inside the one along the wall. All rings have the shape of the
//! wall, moved inwards by `d`: corners of radius `corner - d`, at least 0.

use crate::facing::stepover;
use crate::fields::{Coolant, Wrong, job, steps};
use crate::writer::{Writer, number};
use libm::tan;
use protocol::message;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Share of the tool's diameter up to which rings leave nothing in their corners: `(1 + 1/√2) / 2`, rounded down.
const STEPOVER_SHARE_MAX: f64 = 0.85;
/// Radius of the helix, in radii of the tool: below 1, so that no core remains.
const HELIX_SHARE: f64 = 0.75;
/// Least radius of the helix, in radii of the tool.
const HELIX_SHARE_MIN: f64 = 0.1;
/// What a pocket is at least wider than the tool, mm.
const ROOM_MM: f64 = 0.02;
/// Corners of a smaller radius are sharp, mm.
const SHARP_MM: f64 = 0.002;

/// How the tool gets down to a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Entry {
    /// On a helix.
    #[default]
    Helix,
    /// To and fro on a line.
    Ramp,
    /// Straight down: a tool that cuts at its centre.
    Plunge,
}

impl Entry {
    pub(crate) const WORDS: &'static [&'static str] = &["helix", "ramp", "plunge"];
}

job! {
    "Rectangular pocket, from its middle outwards"
    RectangularPocket {
        #[doc = " X of the middle of the pocket."]
        x = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Y of its middle."]
        y = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Size along X."]
        length = number("mm", 60.0, 0.1, 10_000.0);
        #[doc = " Size along Y."]
        width = number("mm", 40.0, 0.1, 10_000.0);
        #[doc = " Radius of the corners. 0: that of the tool."]
        corner_radius = number("mm", 0.0, 0.0, 5000.0);
        #[doc = " Depth below the surface."]
        depth = number("mm", 5.0, 0.001, 1000.0);
        #[doc = " Maximum depth of a level; all levels are equal."]
        stepdown = number("mm", 2.0, 0.001, 1000.0);
        #[doc = " Diameter of the tool."]
        tool_diameter = number("mm", 8.0, 0.01, 1000.0);
        #[doc = " Maximum distance of rings; all are equal."]
        stepover = number("mm", 4.0, 0.01, 1000.0);
        #[doc = " What is left on the wall for a last pass at full depth. 0: no last pass."]
        finish = number("mm", 0.2, 0.0, 100.0);
        #[doc = " How the tool gets down."]
        entry = choice(Entry);
        #[doc = " Slope of helix and ramp."]
        ramp_angle = number("degrees", 3.0, 0.1, 45.0);
        #[doc = " Feed downwards."]
        plunge_feed = number("mm/min", 200.0, 1.0, 100_000.0);
    }
}

job! {
    "Circular pocket, from its middle outwards"
    CircularPocket {
        #[doc = " X of the middle of the pocket."]
        x = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Y of its middle."]
        y = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Diameter of the pocket."]
        diameter = number("mm", 40.0, 0.1, 10_000.0);
        #[doc = " Depth below the surface."]
        depth = number("mm", 5.0, 0.001, 1000.0);
        #[doc = " Maximum depth of a level; all levels are equal."]
        stepdown = number("mm", 2.0, 0.001, 1000.0);
        #[doc = " Diameter of the tool."]
        tool_diameter = number("mm", 8.0, 0.01, 1000.0);
        #[doc = " Maximum distance of rings; all are equal."]
        stepover = number("mm", 4.0, 0.01, 1000.0);
        #[doc = " What is left on the wall for a last pass at full depth. 0: no last pass."]
        finish = number("mm", 0.2, 0.0, 100.0);
        #[doc = " How the tool gets down."]
        entry = choice(Entry);
        #[doc = " Slope of helix and ramp."]
        ramp_angle = number("degrees", 3.0, 0.1, 45.0);
        #[doc = " Feed downwards."]
        plunge_feed = number("mm/min", 200.0, 1.0, 100_000.0);
    }
}

impl RectangularPocket {
    /// The program.
    ///
    /// # Errors
    /// Which number is wrong, and what to do about it.
    pub fn program(&self) -> Result<String, Wrong> {
        let radius = self.tool_diameter / 2.0;
        let corner = match self.corner_radius {
            0.0 => 0.0,
            corner if corner < radius => {
                return Wrong::at(
                    "corner_radius",
                    message!(
                        "job.corner_radius",
                        "a tool of {diameter} mm cannot cut corners of a radius of {corner} mm: at least {least} mm, or a smaller tool",
                        diameter = self.tool_diameter,
                        corner = corner,
                        least = radius
                    ),
                );
            }
            corner if 2.0 * corner > self.length.min(self.width) => {
                return Wrong::at(
                    "corner_radius",
                    message!(
                        "job.corner_too_round",
                        "corners of a radius of {corner} mm do not fit into a pocket of {size} mm: at most {most} mm",
                        corner = corner,
                        size = self.length.min(self.width),
                        most = self.length.min(self.width) / 2.0
                    ),
                );
            }
            corner => corner - radius,
        };
        let corners = match self.corner_radius {
            0.0 => "corners as the tool".to_owned(),
            corner => format!("corners R{}", number(corner)),
        };
        let shape = Shape {
            middle: [self.x, self.y],
            half: [self.length / 2.0 - radius, self.width / 2.0 - radius],
            corner,
            top: self.top,
            depth: self.depth,
            stepdown: self.stepdown,
            tool_diameter: self.tool_diameter,
            stepover: self.stepover,
            finish: self.finish,
            entry: self.entry,
            ramp_angle: self.ramp_angle,
            feed: self.feed,
            plunge_feed: self.plunge_feed,
        };
        shape.check(self.length.min(self.width))?;
        let writer = Writer::new(
            &format!(
                "Rectangular pocket {} x {} mm, {} mm deep, {corners}",
                number(self.length),
                number(self.width),
                number(self.depth)
            ),
            &shape.told(),
            &format!("end mill of {} mm", number(self.tool_diameter)),
            &self.common(),
        )?;
        shape.write(writer)
    }
}

impl CircularPocket {
    /// The program.
    ///
    /// # Errors
    /// Which number is wrong, and what to do about it.
    pub fn program(&self) -> Result<String, Wrong> {
        let half = (self.diameter - self.tool_diameter) / 2.0;
        let shape = Shape {
            middle: [self.x, self.y],
            half: [half; 2],
            corner: half,
            top: self.top,
            depth: self.depth,
            stepdown: self.stepdown,
            tool_diameter: self.tool_diameter,
            stepover: self.stepover,
            finish: self.finish,
            entry: self.entry,
            ramp_angle: self.ramp_angle,
            feed: self.feed,
            plunge_feed: self.plunge_feed,
        };
        shape.check(self.diameter)?;
        let writer = Writer::new(
            &format!(
                "Circular pocket of {} mm, {} mm deep",
                number(self.diameter),
                number(self.depth)
            ),
            &shape.told(),
            &format!("end mill of {} mm", number(self.tool_diameter)),
            &self.common(),
        )?;
        shape.write(writer)
    }
}

/// A pocket as the middle of the tool sees it.
struct Shape {
    middle: [f64; 2],
    /// Half the size of the ring along the wall.
    half: [f64; 2],
    /// Radius of its corners.
    corner: f64,
    top: f64,
    depth: f64,
    stepdown: f64,
    tool_diameter: f64,
    stepover: f64,
    finish: f64,
    entry: Entry,
    ramp_angle: f64,
    feed: f64,
    plunge_feed: f64,
}

impl Shape {
    /// From the middle to the outermost ring of roughing.
    fn rough(&self) -> f64 {
        self.half[0].min(self.half[1]) - self.finish
    }

    /// The axis along which the pocket is longer.
    fn long(&self) -> usize {
        usize::from(self.half[1] > self.half[0])
    }

    fn helix_radius(&self) -> f64 {
        (HELIX_SHARE * self.tool_diameter / 2.0).min(self.rough())
    }

    /// Half the length of the ramp.
    fn half_ramp(&self) -> f64 {
        self.tool_diameter.min(self.half[self.long()] - self.finish)
    }

    /// `size`: of its narrow side.
    fn check(&self, size: f64) -> Result<(), Wrong> {
        let radius = self.tool_diameter / 2.0;
        if self.tool_diameter > size - ROOM_MM {
            return Wrong::at(
                "tool_diameter",
                message!(
                    "job.tool_in_pocket",
                    "a tool of {diameter} mm does not fit into a pocket of {size} mm: take a smaller one",
                    diameter = self.tool_diameter,
                    size = size
                ),
            );
        }
        let most = STEPOVER_SHARE_MAX * self.tool_diameter;
        if self.stepover > most {
            return stepover(self.stepover, self.tool_diameter, most);
        }
        // The arcs of the finishing pass begin where roughing has been.
        let most = (0.4 * radius).min(0.3 / 1.3 * (self.rough() + self.finish));
        if self.finish > most {
            return Wrong::at(
                "finish",
                message!(
                    "job.finish",
                    "an allowance of {finish} mm is too much for this tool in this pocket: at most {most:.3} mm",
                    finish = self.finish,
                    most = most
                ),
            );
        }
        if self.entry == Entry::Helix && self.helix_radius() < HELIX_SHARE_MIN * radius {
            return Wrong::at(
                "entry",
                message!(
                    "job.narrow_for_helix",
                    "the pocket is too narrow for a helix of a tool of {diameter} mm: take a smaller tool, or another entry",
                    diameter = self.tool_diameter
                ),
            );
        }
        if self.entry == Entry::Ramp && self.half_ramp() < radius / 2.0 {
            return Wrong::at(
                "entry",
                message!(
                    "job.short_for_ramp",
                    "the pocket is too short for a ramp of a tool of {diameter} mm: take a smaller tool, or another entry",
                    diameter = self.tool_diameter
                ),
            );
        }
        Ok(())
    }

    fn told(&self) -> [String; 2] {
        let (levels, rings) = (steps(self.depth, self.stepdown), steps(self.rough(), self.stepover));
        [
            format!("Middle at X{} Y{}", number(self.middle[0]), number(self.middle[1])),
            format!(
                "Levels: {levels} of {} mm, stepover {} mm, finishing allowance {} mm",
                number(self.depth / f64::from(levels)),
                number(self.rough() / f64::from(rings)),
                number(self.finish)
            ),
        ]
    }

    fn write(&self, mut writer: Writer) -> Result<String, Wrong> {
        let levels = steps(self.depth, self.stepdown);
        let rings = steps(self.rough(), self.stepover);
        let outermost = self.start(self.finish);
        let mut from = writer.clearance;
        for level in 1..=levels {
            let z = self.top - self.depth * f64::from(level) / f64::from(levels);
            writer.comment(&format!("Level at Z{}", number(z)))?;
            self.enter(&mut writer, level == 1, from, z)?;
            from = z;
            // The innermost ring is a line or a point.
            let [x, y] = self.middle;
            let half_line = (self.half[0] - self.half[1]).abs();
            for end in [-half_line, half_line] {
                let to = match self.long() {
                    0 => [x + end, y],
                    _ => [x, y + end],
                };
                writer.cut(to, self.feed)?;
            }
            if self.long() == 1 {
                writer.cut(self.middle, self.feed)?;
            }
            for ring in 1..=rings {
                let d = self.finish + self.rough() * f64::from(rings - ring) / f64::from(rings);
                writer.cut(self.start(d), self.feed)?;
                self.ring(&mut writer, d)?;
            }
        }
        let lead = (self.tool_diameter / 2.0).min(self.rough() / 2.0);
        match self.finish > 0.0 {
            true => {
                writer.comment("Finishing pass")?;
                let [x, y] = self.start(0.0);
                let centre = [x - lead, y];
                writer.cut([x - lead, y - lead], self.feed)?;
                writer.arc(true, [x, y], None, centre, self.feed)?;
                self.ring(&mut writer, 0.0)?;
                writer.arc(true, [x - lead, y + lead], None, centre, self.feed)?;
            }
            // Off the wall.
            false => writer.cut([outermost[0] - lead, outermost[1]], self.feed)?,
        }
        writer.end()
    }

    /// Down to `z`: for the first level from above, otherwise from the end of a ring.
    fn enter(&self, writer: &mut Writer, first: bool, from: f64, z: f64) -> Result<(), Wrong> {
        let [x, y] = self.middle;
        let slope = tan(self.ramp_angle.to_radians());
        let mut begin = |to| match first {
            true => writer.approach(to),
            false => writer.cut(to, self.feed),
        };
        match self.entry {
            Entry::Plunge => {
                begin(self.middle)?;
                writer.plunge(z, self.plunge_feed)
            }
            Entry::Helix => {
                let radius = self.helix_radius();
                let to = [x + radius, y];
                begin(to)?;
                let turns = steps(from - z, 2.0 * PI * radius * slope);
                for turn in 1..=turns {
                    let z = from + (z - from) * f64::from(turn) / f64::from(turns);
                    writer.arc(true, to, Some(z), self.middle, self.plunge_feed)?;
                }
                Ok(())
            }
            Entry::Ramp => {
                let half = self.half_ramp();
                let ends = match self.long() {
                    0 => [[x - half, y], [x + half, y]],
                    _ => [[x, y - half], [x, y + half]],
                };
                begin(ends[0])?;
                let ways = steps(from - z, 2.0 * half * slope);
                for way in 1..=ways {
                    let z = from + (z - from) * f64::from(way) / f64::from(ways);
                    writer.slope(ends[(way % 2) as usize], z, self.plunge_feed)?;
                }
                Ok(())
            }
        }
    }

    /// Where a ring begins and ends: in the middle of its right side.
    fn start(&self, d: f64) -> [f64; 2] {
        [self.middle[0] + self.half[0] - d, self.middle[1]]
    }

    /// Once around, counter-clockwise.
    fn ring(&self, writer: &mut Writer, d: f64) -> Result<(), Wrong> {
        let ([x, y], feed) = (self.middle, self.feed);
        let [hx, hy] = self.half.map(|half| half - d);
        let corner = match self.corner - d {
            corner if corner < SHARP_MM => 0.0,
            corner => corner,
        };
        if corner > 0.0 && hx - corner < SHARP_MM && hy - corner < SHARP_MM {
            return writer.arc(true, self.start(d), None, self.middle, feed);
        }
        // Of each corner: where its arc begins and ends, and its centre.
        let (ix, iy) = (hx - corner, hy - corner);
        for (begin, end, centre) in [
            ([hx, iy], [ix, hy], [ix, iy]),
            ([-ix, hy], [-hx, iy], [-ix, iy]),
            ([-hx, -iy], [-ix, -hy], [-ix, -iy]),
            ([ix, -hy], [hx, -iy], [ix, -iy]),
        ] {
            let place = |[px, py]: [f64; 2]| [x + px, y + py];
            writer.cut(place(begin), feed)?;
            if corner > 0.0 {
                writer.arc(true, place(end), None, place(centre), feed)?;
            }
        }
        writer.cut(self.start(d), feed)
    }
}
