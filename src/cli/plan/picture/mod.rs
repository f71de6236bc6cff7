//! A plan as a picture: the tool path coloured by speed; below it velocity, acceleration and jerk of every joint over
//! time, each with its limit.
//!
//! In:  a program that was run down, and its report.
//! Out: SVG.

pub(super) mod recording;
mod strips;
mod tool_path;

use super::report::Report;
use super::run_down::Work;
use crate::config::Config;
use crate::plot::sheet::Sheet;
use crate::plot::{BODY, TITLE};
use recording::Recording;

/// Whole picture, pixels.
const WIDTH: f64 = 1200.0;
/// White on both sides.
const EDGE: f64 = 24.0;
const HEAD: f64 = 84.0;

/// Draws it.
pub(super) fn picture(name: &str, config: &Config, recording: &Recording, work: &Work, report: &Report) -> String {
    let view = tool_path::View::new(&recording.moving, config.work_offsets[0]);
    let strips = strips::Strips::new(recording, work);
    let mut sheet = Sheet::new(WIDTH);
    sheet.text((EDGE, 34.0), TITLE, &format!("{name} on {}", config.name));
    sheet.text((EDGE, 56.0), BODY, &report.in_short());
    view.draw(&mut sheet, HEAD);
    strips.draw(&mut sheet, HEAD + view.height());
    sheet.finish(HEAD + view.height() + strips.height())
}
