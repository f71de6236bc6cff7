//! A sheet of SVG: lines, bars and words at places in pixels.
//!
//! In:  shapes. Out: SVG text that any browser shows.
//!
//! Only what pictures of measurements need. Numbers are written to a tenth of a pixel; NaN is left out, so that
//! no data make a picture that cannot be read.

use std::fmt::Write;

/// Fonts; the first one that is there.
const FONT: &str = "DejaVu Sans, Helvetica, Arial, sans-serif";

pub struct Sheet {
    width: f64,
    body: String,
}

/// Where a text stands from its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

/// How a text looks.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    pub size: f64,
    pub colour: &'static str,
    pub bold: bool,
    pub anchor: Anchor,
}

impl Face {
    pub const fn new(size: f64, colour: &'static str) -> Face {
        Face {
            size,
            colour,
            bold: false,
            anchor: Anchor::Start,
        }
    }

    pub const fn bold(self) -> Face {
        Face { bold: true, ..self }
    }

    pub const fn at(self, anchor: Anchor) -> Face {
        Face { anchor, ..self }
    }

    /// Width of a text, pixels; an estimate on the safe side.
    pub fn width(&self, text: &str) -> f64 {
        text.chars().count() as f64 * self.size * if self.bold { 0.65 } else { 0.57 }
    }
}

impl Sheet {
    pub fn new(width: f64) -> Sheet {
        Sheet {
            width,
            body: String::new(),
        }
    }

    pub fn rectangle(&mut self, from: (f64, f64), to: (f64, f64), colour: &str) {
        let (width, height) = (to.0 - from.0, to.1 - from.1);
        if [from.0, from.1, width, height].iter().all(|number| number.is_finite()) && width > 0.0 && height > 0.0 {
            let _ = writeln!(
                self.body,
                r#"<rect x="{:.1}" y="{:.1}" width="{width:.1}" height="{height:.1}" fill="{colour}"/>"#,
                from.0, from.1
            );
        }
    }

    /// A straight line; dashed where `dashes` is not empty.
    pub fn line(&mut self, from: (f64, f64), to: (f64, f64), colour: &str, width: f64, dashes: &str) {
        if [from.0, from.1, to.0, to.1].iter().all(|number| number.is_finite()) {
            let dashes = match dashes {
                "" => String::new(),
                dashes => format!(r#" stroke-dasharray="{dashes}""#),
            };
            let _ = writeln!(
                self.body,
                r#"<line x1="{:.1}" y1="{:.1}" x2="{:.1}" y2="{:.1}" stroke="{colour}" stroke-width="{width}"{dashes}/>"#,
                from.0, from.1, to.0, to.1
            );
        }
    }

    /// A line through points; dashed where `dashes` is not empty.
    pub fn path(&mut self, points: &[(f64, f64)], colour: &str, width: f64, dashes: &str) {
        if points.len() < 2 || !points.iter().all(|(x, y)| x.is_finite() && y.is_finite()) {
            return;
        }
        let dashes = match dashes {
            "" => String::new(),
            dashes => format!(r#" stroke-dasharray="{dashes}""#),
        };
        let mut places = String::with_capacity(points.len() * 12);
        for (x, y) in points {
            let _ = write!(places, "{x:.1},{y:.1} ");
        }
        let _ = writeln!(
            self.body,
            r#"<polyline points="{}" fill="none" stroke="{colour}" stroke-width="{width}" stroke-linejoin="round"{dashes}/>"#,
            places.trim_end()
        );
    }

    /// A closed area.
    pub fn area(&mut self, points: &[(f64, f64)], colour: &str) {
        if points.iter().all(|(x, y)| x.is_finite() && y.is_finite()) {
            let places: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            let _ = writeln!(self.body, r#"<polygon points="{}" fill="{colour}"/>"#, places.join(" "));
        }
    }

    /// A dot, filled or a ring.
    pub fn dot(&mut self, at: (f64, f64), radius: f64, colour: &str, filled: bool) {
        if at.0.is_finite() && at.1.is_finite() {
            let fill = if filled { colour } else { "white" };
            let _ = writeln!(
                self.body,
                r#"<circle cx="{:.1}" cy="{:.1}" r="{radius}" fill="{fill}" stroke="{colour}" stroke-width="1.3"/>"#,
                at.0, at.1
            );
        }
    }

    /// A round mark with a short text in it, that leads to a place in the page.
    pub fn mark(&mut self, at: (f64, f64), text: &str, title: &str, address: &str) {
        const RADIUS: f64 = 9.0;
        if at.0.is_finite() && at.1.is_finite() {
            let _ = writeln!(
                self.body,
                r##"<a href="{}"><title>{}</title><circle cx="{:.1}" cy="{:.1}" r="{RADIUS}" fill="#fff4c2" stroke="#222222"/><text x="{:.1}" y="{:.1}" font-size="11" text-anchor="middle" fill="#222222">{}</text></a>"##,
                escaped(address),
                escaped(title),
                at.0,
                at.1,
                at.0,
                at.1 + 4.0,
                escaped(text)
            );
        }
    }

    /// A text whose base line is at the place.
    pub fn text(&mut self, at: (f64, f64), face: Face, text: &str) {
        self.write(at, face, "", text);
    }

    /// The same with a white edge, to be read over lines and bars.
    pub fn text_over(&mut self, at: (f64, f64), face: Face, text: &str) {
        self.write(
            at,
            face,
            r#" stroke="white" stroke-width="4" paint-order="stroke""#,
            text,
        );
    }

    fn write(&mut self, at: (f64, f64), face: Face, edge: &str, text: &str) {
        if !(at.0.is_finite() && at.1.is_finite()) {
            return;
        }
        let anchor = match face.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let weight = if face.bold { r#" font-weight="bold""# } else { "" };
        let _ = writeln!(
            self.body,
            r#"<text x="{:.1}" y="{:.1}" font-size="{}" fill="{}" text-anchor="{anchor}"{weight}{edge}>{}</text>"#,
            at.0,
            at.1,
            face.size,
            face.colour,
            escaped(text)
        );
    }

    /// The whole picture, so high.
    pub fn finish(self, height: f64) -> String {
        let width = self.width;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"{FONT}\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{}</svg>\n",
            self.body
        )
    }
}

/// Text as it may stand in XML.
pub fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '&' => safe.push_str("&amp;"),
            '"' => safe.push_str("&quot;"),
            // XML knows no control characters, and two that are none.
            character if character.is_control() || matches!(character, '\u{FFFE}' | '\u{FFFF}') => safe.push(' '),
            character => safe.push(character),
        }
    }
    safe
}
