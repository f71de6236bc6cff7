//! Engraving of text with single strokes, along a line or around a circle.
//!
//! In:  the text, where and how high, how deep. Out: each stroke at its depth, between strokes a little above the surface.

use crate::fields::{Coolant, Wrong, job};
use crate::font::{CAPITAL, SPACING, Stroke, glyph};
use crate::writer::{Writer, number};
use libm::{cos, sin, tan};
use protocol::message;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// On what the text stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// On a line.
    #[default]
    Line,
    /// Clockwise on a circle, letters pointing outwards.
    ArcOutwards,
    /// Counter-clockwise in a circle, letters pointing to its middle.
    ArcInwards,
}

impl Layout {
    pub(crate) const WORDS: &'static [&'static str] = &["line", "arc_outwards", "arc_inwards"];
}

/// Which part of the text stands at its place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Align {
    /// Its beginning.
    #[default]
    Left,
    /// Its middle.
    Middle,
    /// Its end.
    Right,
}

impl Align {
    pub(crate) const WORDS: &'static [&'static str] = &["left", "middle", "right"];
}

job! {
    "Engraving of text with single strokes"
    Engraving {
        #[doc = " The text."]
        text = text("ISOCNC", 100);
        #[doc = " X of the text on its base line; on a circle of the middle of the circle."]
        x = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Y of the text on its base line; on a circle of the middle of the circle."]
        y = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Height of capitals."]
        height = number("mm", 8.0, 0.5, 1000.0);
        #[doc = " Space between letters, in percent of the usual one."]
        spacing = number("%", 100.0, 0.0, 1000.0);
        #[doc = " Which part of the text stands at its place."]
        align = choice(Align);
        #[doc = " On a line, or around a circle."]
        layout = choice(Layout);
        #[doc = " Direction of the line; on a circle the place of the text, 90 at its top."]
        angle = number("degrees", 0.0, -360.0, 360.0);
        #[doc = " Radius of the base line on a circle."]
        radius = number("mm", 30.0, 0.1, 10_000.0);
        #[doc = " Depth below the surface."]
        depth = number("mm", 0.2, 0.001, 100.0);
        #[doc = " Feed downwards."]
        plunge_feed = number("mm/min", 200.0, 1.0, 100_000.0);
    }
}

impl Engraving {
    /// The program.
    ///
    /// # Errors
    /// Which number is wrong, and what to do about it; which characters the font does not have.
    pub fn program(&self) -> Result<String, Wrong> {
        let mut unknown: Vec<char> = self.text.chars().filter(|&letter| glyph(letter).is_none()).collect();
        unknown.sort_unstable();
        unknown.dedup();
        if !unknown.is_empty() {
            let names: Vec<String> = unknown.iter().map(|letter| named(*letter)).collect();
            return Wrong::at(
                "text",
                message!(
                    "job.no_letter",
                    "the font does not have {letters}: write it in other letters",
                    letters = names.join(" ")
                ),
            );
        }
        if self.text.trim().is_empty() {
            return Wrong::at("text", message!("job.no_text", "there is no text to engrave"));
        }
        let scale = self.height / CAPITAL;
        let gap = SPACING * self.spacing / 100.0;
        let glyphs: Vec<(f64, Vec<Stroke>)> = self.text.chars().filter_map(glyph).collect();
        let units: f64 = glyphs.iter().map(|(width, _)| width + gap).sum::<f64>() - gap;
        let length = units * scale;
        if self.layout != Layout::Line && length > TAU * self.radius {
            return Wrong::at(
                "radius",
                message!(
                    "job.text_around",
                    "a text {length:.3} mm long does not fit around a circle of {around:.3} mm: take a larger radius",
                    length = length,
                    around = TAU * self.radius
                ),
            );
        }
        // Letters grow narrower towards the middle.
        if self.layout == Layout::ArcInwards && self.radius <= self.height {
            return Wrong::at(
                "radius",
                message!(
                    "job.text_inwards",
                    "letters {height} mm high that point inwards do not fit into a radius of {radius} mm: take a larger radius",
                    height = self.height,
                    radius = self.radius
                ),
            );
        }
        let place = match self.layout {
            Layout::Line => format!(
                "At X{} Y{}, {} degrees",
                number(self.x),
                number(self.y),
                number(self.angle)
            ),
            Layout::ArcOutwards | Layout::ArcInwards => format!(
                "Around X{} Y{}, radius {} mm, at {} degrees",
                number(self.x),
                number(self.y),
                number(self.radius),
                number(self.angle)
            ),
        };
        let mut writer = Writer::new(
            &format!(
                "Engraving, {} mm high, {} mm deep",
                number(self.height),
                number(self.depth)
            ),
            &[format!("Text: {}", self.text), place],
            "engraving tool",
            &self.common(),
        )?;
        let mut along = match self.align {
            Align::Left => 0.0,
            Align::Middle => -length / 2.0,
            Align::Right => -length,
        };
        for (letter, (width, strokes)) in self.text.chars().zip(&glyphs) {
            let half = width * scale / 2.0;
            let frame = self.frame(along + half);
            if letter != ' ' {
                writer.comment(&letter.to_string())?;
            }
            for stroke in strokes {
                self.stroke(&mut writer, stroke, &|[x, y]| {
                    frame.place([x * scale - half, y * scale])
                })?;
            }
            along += (width + gap) * scale;
        }
        writer.end()
    }

    /// Where a letter stands whose middle is so far along the base line.
    fn frame(&self, along: f64) -> Frame {
        let middle = self.angle.to_radians();
        let on_circle = |polar: f64, turn: f64| Frame {
            origin: [self.x + self.radius * cos(polar), self.y + self.radius * sin(polar)],
            turn: polar + turn,
        };
        match self.layout {
            Layout::Line => Frame {
                origin: [self.x + along * cos(middle), self.y + along * sin(middle)],
                turn: middle,
            },
            Layout::ArcOutwards => on_circle(middle - along / self.radius, -PI / 2.0),
            Layout::ArcInwards => on_circle(middle + along / self.radius, PI / 2.0),
        }
    }

    fn stroke(&self, writer: &mut Writer, stroke: &Stroke, place: &dyn Fn([f64; 2]) -> [f64; 2]) -> Result<(), Wrong> {
        let mut from = place(stroke.from);
        writer.rapid(from)?;
        writer.rapid_z(writer.clearance)?;
        writer.plunge(self.top - self.depth, self.plunge_feed)?;
        for piece in &stroke.pieces {
            let to = place(piece.to);
            match piece.sweep {
                0.0 => writer.cut(to, self.feed)?,
                sweep => writer.arc(sweep > 0.0, to, None, centre(from, to, sweep), self.feed)?,
            }
            from = to;
        }
        writer.rapid_z(writer.clearance)
    }
}

/// Where letters stand: the middle of their base line, and how they are turned.
struct Frame {
    origin: [f64; 2],
    turn: f64,
}

impl Frame {
    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = (sin(self.turn), cos(self.turn));
        [self.origin[0] + x * cos - y * sin, self.origin[1] + x * sin + y * cos]
    }
}

/// Centre of an arc that turns by so many degrees from one point to another, counter-clockwise: it is on the left of the chord, half a chord
/// by the tangent of half the angle away.
fn centre(from: [f64; 2], to: [f64; 2], sweep: f64) -> [f64; 2] {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let share = match sweep.abs() {
        half if half >= 180.0 => 0.0,
        _ => 0.5 / tan((sweep / 2.0).to_radians()),
    };
    [
        (from[0] + to[0]) / 2.0 - dy * share,
        (from[1] + to[1]) / 2.0 + dx * share,
    ]
}

/// A character as it can be shown.
fn named(letter: char) -> String {
    match letter.is_control() {
        true => format!("U+{:04X}", u32::from(letter)),
        false => letter.to_string(),
    }
}
