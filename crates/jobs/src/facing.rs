//! Facing: rows over a rectangular surface.
//!
//! In:  the corner and the size of the surface, depth, tool. Out: rows, each of which takes the same width, in levels of the same depth; the
//! tool enters the material from outside.

use crate::fields::{Coolant, Wrong, job, steps};
use crate::writer::{Writer, number};
use protocol::message;
use serde::{Deserialize, Serialize};

/// How rows follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pattern {
    /// There and back.
    #[default]
    Zigzag,
    /// All rows in the direction of climb milling.
    OneWay,
}

impl Pattern {
    pub(crate) const WORDS: &'static [&'static str] = &["zigzag", "one_way"];
}

/// Along which axis rows lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Along {
    /// X.
    #[default]
    X,
    /// Y.
    Y,
}

impl Along {
    pub(crate) const WORDS: &'static [&'static str] = &["x", "y"];
}

job! {
    "Facing: rows over a rectangular surface"
    Facing {
        #[doc = " X of the left edge of the surface."]
        x = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Y of its front edge."]
        y = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Size along X."]
        length = number("mm", 100.0, 0.1, 10_000.0);
        #[doc = " Size along Y."]
        width = number("mm", 60.0, 0.1, 10_000.0);
        #[doc = " Depth below the surface."]
        depth = number("mm", 1.0, 0.001, 1000.0);
        #[doc = " Maximum depth of a pass; all passes but the last are equal."]
        stepdown = number("mm", 1.0, 0.001, 1000.0);
        #[doc = " Depth that the last pass takes. 0: as the others."]
        finish = number("mm", 0.0, 0.0, 100.0);
        #[doc = " Diameter of the tool."]
        tool_diameter = number("mm", 40.0, 0.01, 1000.0);
        #[doc = " Maximum width of a row; all rows are equal."]
        stepover = number("mm", 28.0, 0.01, 1000.0);
        #[doc = " Rows there and back, or all in the direction of climb milling."]
        pattern = choice(Pattern);
        #[doc = " Axis along which rows lie."]
        along = choice(Along);
        #[doc = " How far the edge of the tool passes the edges of the surface."]
        overrun = number("mm", 2.0, 0.0, 1000.0);
        #[doc = " Feed downwards, outside of the material."]
        plunge_feed = number("mm/min", 600.0, 1.0, 100_000.0);
    }
}

impl Facing {
    /// The program.
    ///
    /// # Errors
    /// Which number is wrong, and what to do about it.
    pub fn program(&self) -> Result<String, Wrong> {
        if self.stepover > self.tool_diameter {
            return stepover(self.stepover, self.tool_diameter, self.tool_diameter);
        }
        if self.finish >= self.depth {
            return Wrong::at(
                "finish",
                message!(
                    "job.finish_depth",
                    "a last pass of {finish} mm takes the whole depth of {depth} mm: less, or 0",
                    finish = self.finish,
                    depth = self.depth
                ),
            );
        }
        let radius = self.tool_diameter / 2.0;
        // `u` along the rows, `v` from row to row.
        let (u0, u1, v0, across) = match self.along {
            Along::X => (self.x, self.x + self.length, self.y, self.width),
            Along::Y => (self.y, self.y + self.width, self.x, self.length),
        };
        let place = |u: f64, v: f64| match self.along {
            Along::X => [u, v],
            Along::Y => [v, u],
        };
        let rows = steps(across + self.overrun, self.stepover);
        let step = (across + self.overrun) / f64::from(rows);
        let (low, high) = (u0 - self.overrun - radius, u1 + self.overrun + radius);
        // What is still to be cut has to be on the right of the tool: rows go towards larger v.
        let climb = match self.along {
            Along::X => (high, low),
            Along::Y => (low, high),
        };
        let rough = steps(self.depth - self.finish, self.stepdown);
        let mut levels: Vec<f64> = Vec::new();
        for level in 1..=rough.min(crate::LINES_MAX) {
            levels.push(self.top - (self.depth - self.finish) * f64::from(level) / f64::from(rough));
        }
        if self.finish > 0.0 {
            levels.push(self.top - self.depth);
        }

        let mut writer = Writer::new(
            &format!(
                "Facing {} x {} mm, {} mm deep",
                number(self.length),
                number(self.width),
                number(self.depth)
            ),
            &[
                format!("Left front corner at X{} Y{}", number(self.x), number(self.y)),
                format!("Rows: {rows} of {} mm, passes: {}", number(step), levels.len()),
            ],
            &format!("face mill of {} mm", number(self.tool_diameter)),
            &self.common(),
        )?;
        for (index, z) in levels.iter().enumerate() {
            let what = match self.finish > 0.0 && index + 1 == levels.len() {
                true => "Last pass",
                false => "Pass",
            };
            writer.comment(&format!("{what} at Z{}", number(*z)))?;
            for row in 0..rows {
                let v = v0 + f64::from(row + 1) * step - radius;
                let (from, to) = match self.pattern == Pattern::Zigzag && row % 2 == 1 {
                    true => (climb.1, climb.0),
                    false => climb,
                };
                match self.pattern == Pattern::Zigzag && row > 0 {
                    true => writer.cut(place(from, v), self.feed)?,
                    false => {
                        writer.approach(place(from, v))?;
                        writer.plunge(*z, self.plunge_feed)?;
                    }
                }
                writer.cut(place(to, v), self.feed)?;
            }
            writer.retract()?;
        }
        writer.end()
    }
}

/// A stepover that leaves ridges.
pub(crate) fn stepover<T>(stepover: f64, diameter: f64, most: f64) -> Result<T, Wrong> {
    Wrong::at(
        "stepover",
        message!(
            "job.stepover",
            "a stepover of {stepover} mm leaves ridges with a tool of {diameter} mm: at most {most:.3} mm",
            stepover = stepover,
            diameter = diameter,
            most = most
        ),
    )
}
