//! A plan as a picture: the tool path coloured by speed; below it velocity, acceleration and jerk of every joint over
//! time, each with its limit.
//!
//! In:  a program that was run down, and its report.
//! Out: SVG.

pub(super) mod recording;
mod strips;
mod tool_path;

use super::judge::Judged;
use super::report::Report;
use config::Config;
use plot::sheet::Sheet;
use plot::{BODY, TITLE};
use recording::Recording;

/// Whole picture, pixels.
const WIDTH: f64 = 1200.0;
/// White on both sides.
const EDGE: f64 = 24.0;
const HEAD: f64 = 84.0;

/// A place with a number, that leads to its line in the text beside the picture.
pub(super) struct Place {
    pub(super) number: usize,
    pub(super) line: u32,
    pub(super) time_s: f64,
    /// X, Y, Z of the machine.
    pub(super) at_mm: [f64; 3],
    /// What is the matter there.
    pub(super) what: String,
}

impl Place {
    fn mark(&self, sheet: &mut Sheet, at: (f64, f64)) {
        let title = format!("line {}: {}", self.line, self.what);
        sheet.mark(at, &self.number.to_string(), &title, &format!("#L{}", self.line));
    }
}

/// Draws it.
pub(super) fn picture(name: &str, config: &Config, recording: &Recording, judged: &Judged, report: &Report) -> String {
    let view = tool_path::View::new(&recording.moving, config.work_offsets[0], None, &[]);
    let strips = strips::Strips::new(recording, judged);
    let mut sheet = Sheet::new(WIDTH);
    sheet.text((EDGE, 34.0), TITLE, &format!("{name} on {}", config.name));
    sheet.text((EDGE, 56.0), BODY, &report.in_short());
    view.draw(&mut sheet, HEAD, &[]);
    strips.draw(&mut sheet, HEAD + view.height(), &[]);
    sheet.finish(HEAD + view.height() + strips.height())
}

/// The path from above and isometrically, and the strips over time, each with places that lead to lines.
pub(super) fn pictures(config: &Config, recording: &Recording, judged: &Judged, places: &[Place]) -> [String; 3] {
    let [above, isometric] = [false, true].map(|isometric| {
        let view = tool_path::View::new(&recording.moving, config.work_offsets[0], Some(isometric), places);
        let mut sheet = Sheet::new(WIDTH);
        view.draw(&mut sheet, EDGE, places);
        sheet.finish(EDGE + view.height())
    });
    let strips = strips::Strips::new(recording, judged);
    let mut sheet = Sheet::new(WIDTH);
    strips.draw(&mut sheet, EDGE, places);
    [above, isometric, sheet.finish(EDGE + strips.height())]
}
