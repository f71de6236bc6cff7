//! A plan as a picture: the tool path coloured by speed; below it velocity, acceleration and jerk of every joint over
//! time, each with its limit.
//!
//! In:  a program that was run down, and its report.
//! Out: SVG.

mod strips;
mod tool_path;

use super::report::Report;
use super::run_down::Work;
use crate::service::plot::PlotError;
use crate::service::plot::canvas::{INK, draw, text};
use plotters::style::text_anchor::HPos;

/// Whole picture, pixels.
const WIDTH: u32 = 1200;
/// White on both sides.
const EDGE: i32 = 24;
const HEAD: i32 = 64;

/// Draws it.
///
/// # Errors
/// If the picture cannot be drawn; not expected for any program.
pub(super) fn picture(name: &str, work: &Work, report: &Report) -> Result<String, PlotError> {
    let view = tool_path::View::of(work);
    let strips = strips::Strips::of(work);
    let path_height = view.height();
    let size = (WIDTH, (HEAD + path_height + strips.height()) as u32);
    draw(size, |root| {
        text(root, (EDGE, 14), name, 20, INK, HPos::Left)?;
        text(root, (EDGE, 41), &report.in_short(), 13, INK, HPos::Left)?;
        view.draw(root, HEAD)?;
        strips.draw(root, HEAD + path_height)
    })
}
