//! Velocity, acceleration and jerk over time, a strip for each joint that moves.
//!
//! A pixel of a long program stands for many cycles: the least and the greatest value of them are drawn, so that no peak
//! is lost.

use super::WIDTH;
use crate::cli::plan::joints::{Joint, NAMES, ORDERS};
use crate::cli::plan::run_down::{Event, Work};
use crate::service::plot::PlotError;
use crate::service::plot::canvas::{Area, FINE, GRID, INK, line, number, round_up, stroke, text};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

const LEFT: i32 = 64;
const RIGHT: i32 = 118;
const COLUMNS: usize = (WIDTH as i32 - LEFT - RIGHT) as usize;
/// Between two groups: name of the quantity.
const GROUP_HEAD: i32 = 24;
const AXIS_HEIGHT: i32 = 44;
const LIMIT: RGBColor = RGBColor(0xD5, 0x5E, 0x00);
const CURVE: [RGBColor; ORDERS] = [
    RGBColor(0x00, 0x72, 0xB2),
    RGBColor(0x00, 0x9E, 0x73),
    RGBColor(0x7B, 0x4F, 0xA0),
];
const MARK: RGBColor = RGBColor(0x99, 0x99, 0x99);
/// Above this many, marks are thinned out.
const MARKS_MAX: usize = 60;
/// How far a strip reaches beyond its limit.
const BEYOND: f64 = 1.18;

/// What is drawn.
pub(super) struct Strips<'a> {
    work: &'a Work,
    moving: Vec<(usize, &'a Joint)>,
    strip_height: i32,
}

impl<'a> Strips<'a> {
    pub(super) fn of(work: &'a Work) -> Strips<'a> {
        let moving: Vec<_> = work
            .joints
            .all
            .iter()
            .enumerate()
            .filter(|(_, joint)| joint.moves())
            .collect();
        let strip_height = match moving.len() {
            0..=2 => 84,
            3 => 64,
            4 => 54,
            _ => 46,
        };
        Strips {
            work,
            moving,
            strip_height,
        }
    }

    fn group_height(&self) -> i32 {
        GROUP_HEAD + self.strip_height * self.moving.len() as i32
    }

    pub(super) fn height(&self) -> i32 {
        30 + ORDERS as i32 * self.group_height() + AXIS_HEIGHT
    }

    pub(super) fn draw(&self, root: &Area<'_>, top: i32) -> Result<(), PlotError> {
        let top = top + 30;
        let bottom = top + ORDERS as i32 * self.group_height();
        self.draw_time(root, top, bottom)?;
        for order in 0..ORDERS {
            let group = top + order as i32 * self.group_height();
            let unit = self.moving.first().map_or("mm", |(_, joint)| joint.unit());
            let power = ["", "²", "³"][order];
            let mixed = self.moving.iter().any(|(_, joint)| joint.unit() != unit);
            let unit = if mixed { "mm or degrees" } else { unit };
            let name = format!("{}, {unit}/s{power}", NAMES[order]);
            text(root, (LEFT, group + 5), &name, 13, INK, HPos::Left)?;
            for (row, (index, joint)) in self.moving.iter().enumerate() {
                let at = group + GROUP_HEAD + row as i32 * self.strip_height;
                self.draw_strip(root, at, *index, joint, order)?;
            }
        }
        Ok(())
    }

    /// Grid of time, and what happened at rest.
    fn draw_time(&self, root: &Area<'_>, top: i32, bottom: i32) -> Result<(), PlotError> {
        let end_s = self.work.cycle_count().max(2) as f64 * self.work.cycle_s;
        let pixel = |time_s: f64| LEFT + (time_s / end_s * COLUMNS as f64).round() as i32;
        let step_s = round_up(end_s / 12.0);
        for k in 0..=(end_s / step_s) as i32 {
            let time_s = f64::from(k) * step_s;
            let x = pixel(time_s);
            line(root, (x, top), (x, bottom), stroke(GRID, 0.8))?;
            text(root, (x, bottom + 6), &number(time_s), 12, INK, HPos::Center)?;
        }
        text(
            root,
            (LEFT + COLUMNS as i32 / 2, bottom + 24),
            "time, s",
            13,
            INK,
            HPos::Center,
        )?;
        let marks = &self.work.marks;
        let mut named = i32::MIN;
        for mark in marks.iter().step_by(marks.len().div_ceil(MARKS_MAX).max(1)) {
            let x = pixel(mark.cycle as f64 * self.work.cycle_s);
            line(root, (x, top - 4), (x, bottom), stroke(MARK, 0.8))?;
            let name = match mark.what {
                Event::Dwell => "wait".to_owned(),
                Event::ToolChange(tool) => format!("T{tool}"),
                Event::Stop => "stop".to_owned(),
            };
            if x >= named {
                text(root, (x, top - 20), &name, 11, INK, HPos::Center)?;
                named = x + 36;
            }
        }
        Ok(())
    }

    fn draw_strip(
        &self,
        root: &Area<'_>,
        top: i32,
        index: usize,
        joint: &Joint,
        order: usize,
    ) -> Result<(), PlotError> {
        let limit = joint.limits[order];
        let columns = columns(self.work, joint, order);
        let peak = columns
            .iter()
            .flatten()
            .fold(0.0_f64, |peak, value| peak.max(value.abs()));
        // A strip shows all there is, even what is over.
        let reach = (limit * BEYOND).max(peak * 1.05);
        let half = f64::from(self.strip_height - 8) / 2.0;
        let middle = f64::from(top) + f64::from(self.strip_height) / 2.0;
        let y = |value: f64| middle - value / reach * half;
        let right = LEFT + COLUMNS as i32;
        line(root, (LEFT, middle as i32), (right, middle as i32), stroke(GRID, 0.8))?;
        for sign in [1.0, -1.0] {
            dashed(root, (LEFT, right), y(sign * limit))?;
        }
        let scale = f64::from(FINE);
        let points: Vec<(i32, i32)> = (columns.iter().enumerate())
            .flat_map(|(column, values)| values.iter().map(move |value| (column, *value)))
            .map(|(column, value)| {
                let x = (f64::from(LEFT) + column as f64 + 0.5) * scale;
                (x.round() as i32, (y(value) * scale).round() as i32)
            })
            .collect();
        let curve = PathElement::new(without_straights(points), stroke(CURVE[order], 0.9));
        root.draw(&curve).map_err(PlotError::new)?;
        let name = joint
            .axis
            .map_or_else(|| format!("joint {index}"), |axis| axis.letter().to_string());
        text(root, (LEFT - 12, middle as i32 - 8), &name, 14, INK, HPos::Right)?;
        let upper = y(limit) as i32 - 7;
        text(
            root,
            (right + 6, upper),
            &format!("limit {}", number(limit)),
            11,
            LIMIT,
            HPos::Left,
        )?;
        let share = format!("peak {:.1} %", peak / limit * 100.0);
        text(root, (right + 6, middle as i32 - 6), &share, 11, INK, HPos::Left)?;
        Ok(())
    }
}

/// Least and greatest value of each column of pixels, in the order in which they came.
fn columns(work: &Work, joint: &Joint, order: usize) -> Vec<Vec<f64>> {
    let count = work.cycles.len();
    let cycles = work.cycle_count() as usize + ORDERS;
    let value = |cycle: usize| joint.differences(cycle)[order];
    // Place among the cycles that were run of the first that is not before this one.
    let place = |number: usize| {
        let run = work.cycles.partition_point(|cycle| cycle.number < number as u64);
        run + number
            .saturating_sub(work.cycle_count() as usize)
            .min(joint.cycles() - count)
    };
    let begin = |column: usize| place(column * cycles / COLUMNS);
    (0..COLUMNS)
        .map(|column| {
            let (from, to) = (begin(column), begin(column + 1));
            let mut least: Option<(usize, f64)> = None;
            let mut greatest: Option<(usize, f64)> = None;
            for cycle in from..to {
                let now = value(cycle);
                if least.is_none_or(|(_, low)| now < low) {
                    least = Some((cycle, now));
                }
                if greatest.is_none_or(|(_, high)| now > high) {
                    greatest = Some((cycle, now));
                }
            }
            match (least, greatest) {
                (Some(low), Some(high)) if low.0 < high.0 => vec![low.1, high.1],
                (Some(low), Some(high)) if low.0 > high.0 => vec![high.1, low.1],
                (Some(one), _) => vec![one.1],
                // Fewer cycles than pixels: the line passes.
                (None, _) => Vec::new(),
            }
        })
        .collect()
}

/// Leaves out points between others of the same height.
fn without_straights(points: Vec<(i32, i32)>) -> Vec<(i32, i32)> {
    let mut kept: Vec<(i32, i32)> = Vec::with_capacity(points.len());
    for point in points {
        if let [.., before, last] = kept[..]
            && before.1 == last.1
            && last.1 == point.1
        {
            kept.pop();
        }
        kept.push(point);
    }
    kept
}

fn dashed(root: &Area<'_>, (left, right): (i32, i32), y: f64) -> Result<(), PlotError> {
    let y = (y * f64::from(FINE)).round() as i32;
    let fine = FINE as i32;
    for x in (left..right).step_by(12) {
        let ends = vec![(x * fine, y), ((x + 7).min(right) * fine, y)];
        root.draw(&PathElement::new(ends, stroke(LIMIT, 0.9)))
            .map_err(PlotError::new)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_stretches_are_two_points() {
        let points = vec![(0, 5), (1, 5), (2, 5), (3, 7), (4, 5), (5, 5)];
        assert_eq!(without_straights(points), [(0, 5), (2, 5), (3, 7), (4, 5), (5, 5)]);
    }
}
