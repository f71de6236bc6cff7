//! Velocity, acceleration and jerk over time, a strip for each joint that moves.
//!
//! A pixel of a long program stands for many cycles: the least and the greatest value of them are drawn, so that no peak
//! is lost.

use super::recording::{Event, Extremes, Recording, Stretches};
use super::{Place, WIDTH};
use crate::joints::{Joint, NAMES, ORDERS};
use crate::judge::Judged;
use plot::lines::{number, round_up};
use plot::sheet::{Anchor, Face, Sheet};
use plot::{BODY, GRID, INK, SMALL};

const LEFT: f64 = 64.0;
const RIGHT: f64 = WIDTH - 118.0;
const COLUMNS: usize = (RIGHT - LEFT) as usize;
/// Between two groups: name of the quantity.
const GROUP_HEAD: f64 = 24.0;
const AXIS_HEIGHT: f64 = 50.0;
const LIMIT: &str = "#d55e00";
const CURVE: [&str; ORDERS] = ["#0072b2", "#009e73", "#7b4fa0"];
const MARK: &str = "#999999";
/// Above this many, marks are thinned out.
const MARKS_MAX: usize = 60;
/// How far a strip reaches beyond its limit.
const BEYOND: f64 = 1.18;

/// What is drawn.
pub(super) struct Strips<'a> {
    recording: &'a Recording,
    judged: &'a Judged,
    moving: Vec<(usize, &'a Joint)>,
    strip_height: f64,
}

impl<'a> Strips<'a> {
    pub(super) fn new(recording: &'a Recording, judged: &'a Judged) -> Strips<'a> {
        let moving: Vec<_> = judged
            .joints
            .all
            .iter()
            .enumerate()
            .filter(|(_, joint)| joint.moves)
            .collect();
        let strip_height = match moving.len() {
            0..=2 => 84.0,
            3 => 64.0,
            4 => 54.0,
            _ => 46.0,
        };
        Strips {
            recording,
            judged,
            moving,
            strip_height,
        }
    }

    fn group_height(&self) -> f64 {
        GROUP_HEAD + self.strip_height * self.moving.len() as f64
    }

    pub(super) fn height(&self) -> f64 {
        30.0 + ORDERS as f64 * self.group_height() + AXIS_HEIGHT
    }

    pub(super) fn draw(&self, sheet: &mut Sheet, top: f64, places: &[Place]) {
        let top = top + 30.0;
        let bottom = top + ORDERS as f64 * self.group_height();
        self.draw_time(sheet, top, bottom);
        for order in 0..ORDERS {
            let group = top + order as f64 * self.group_height();
            let unit = self.moving.first().map_or("mm", |(_, joint)| joint.unit());
            let power = ["", "²", "³"][order];
            let mixed = self.moving.iter().any(|(_, joint)| joint.unit() != unit);
            let unit = if mixed { "mm or degrees" } else { unit };
            let name = format!("{}, {unit}/s{power}", NAMES[order]);
            sheet.text((LEFT, group + 17.0), BODY, &name);
            for (row, (index, joint)) in self.moving.iter().enumerate() {
                let at = group + GROUP_HEAD + row as f64 * self.strip_height;
                self.draw_strip(sheet, at, *index, joint, order);
            }
        }
        for place in places {
            // Above the names of what happens at rest.
            place.mark(sheet, (self.pixel(place.time_s), top - 31.0));
        }
    }

    /// Where a time is.
    fn pixel(&self, time_s: f64) -> f64 {
        let end_s = self.judged.cycles.max(2) as f64 * self.judged.cycle_s;
        LEFT + time_s / end_s * COLUMNS as f64
    }

    /// Grid of time, and what happened at rest.
    fn draw_time(&self, sheet: &mut Sheet, top: f64, bottom: f64) {
        let end_s = self.judged.cycles.max(2) as f64 * self.judged.cycle_s;
        let pixel = |time_s: f64| self.pixel(time_s);
        let step_s = round_up(end_s / 12.0);
        for k in 0..=(end_s / step_s) as i32 {
            let time_s = f64::from(k) * step_s;
            let x = pixel(time_s);
            sheet.line((x, top), (x, bottom), GRID, 0.8, "");
            sheet.text((x, bottom + 17.0), SMALL.at(Anchor::Middle), &number(time_s));
        }
        let middle = (LEFT + RIGHT) / 2.0;
        sheet.text((middle, bottom + 36.0), BODY.at(Anchor::Middle), "time, s");
        let marks = &self.recording.marks;
        let mut named = f64::NEG_INFINITY;
        for mark in marks.iter().step_by(marks.len().div_ceil(MARKS_MAX).max(1)) {
            let x = pixel(mark.cycle as f64 * self.judged.cycle_s);
            sheet.line((x, top - 4.0), (x, bottom), MARK, 0.8, "");
            let name = match mark.what {
                Event::Dwell => "wait".to_owned(),
                Event::ToolChange(tool) => format!("T{tool}"),
                Event::Stop => "stop".to_owned(),
            };
            if x >= named {
                sheet.text((x, top - 9.0), Face::new(11.0, INK).at(Anchor::Middle), &name);
                named = x + 36.0;
            }
        }
    }

    fn draw_strip(&self, sheet: &mut Sheet, top: f64, index: usize, joint: &Joint, order: usize) {
        let limit = joint.limits[order];
        let columns = columns(self.judged.cycles, &self.recording.values[index][order]);
        let peak = columns
            .iter()
            .flatten()
            .fold(0.0_f64, |peak, value| peak.max(value.abs()));
        // A strip shows all there is, even what is over.
        let reach = (limit * BEYOND).max(peak * 1.05);
        let half = (self.strip_height - 8.0) / 2.0;
        let middle = top + self.strip_height / 2.0;
        let y = |value: f64| middle - value / reach * half;
        sheet.line((LEFT, middle), (RIGHT, middle), GRID, 0.8, "");
        for sign in [1.0, -1.0] {
            sheet.line((LEFT, y(sign * limit)), (RIGHT, y(sign * limit)), LIMIT, 0.9, "7 5");
        }
        let points: Vec<(f64, f64)> = (columns.iter().enumerate())
            .flat_map(|(column, values)| values.iter().map(move |value| (column, *value)))
            // To a tenth of a pixel, as it is written: what is level is then two points.
            .map(|(column, value)| (LEFT + column as f64 + 0.5, (y(value) * 10.0).round() / 10.0))
            .collect();
        sheet.path(&without_straights(points), CURVE[order], 0.9, "");
        let name = joint
            .axis
            .map_or_else(|| format!("joint {index}"), |axis| axis.letter().to_string());
        sheet.text((LEFT - 12.0, middle + 5.0), Face::new(14.0, INK).at(Anchor::End), &name);
        let limit_text = format!("limit {}", number(limit));
        sheet.text((RIGHT + 6.0, y(limit) + 4.0), Face::new(11.0, LIMIT), &limit_text);
        let share = format!("peak {:.1} %", peak / limit * 100.0);
        sheet.text((RIGHT + 6.0, middle + 5.0), Face::new(11.0, INK), &share);
    }
}

/// Least and greatest value of each column of pixels, in the order in which they came; none where there are fewer cycles than
/// pixels: the line passes.
fn columns(cycles: u64, values: &Stretches) -> Vec<Vec<f64>> {
    let cycles = cycles + ORDERS as u64;
    let mut columns = vec![None; COLUMNS];
    for (begin, extremes) in values.iter() {
        let column = (begin * COLUMNS as u64 / cycles) as usize;
        let column: &mut Option<Extremes> = &mut columns[column.min(COLUMNS - 1)];
        *column = Some(column.map_or(extremes, |all| all.with(extremes)));
    }
    let shown = |column: &Option<Extremes>| match column {
        None => Vec::new(),
        Some(Extremes { least, greatest }) if least.0 == greatest.0 => vec![least.1],
        Some(Extremes { least, greatest }) if least.0 < greatest.0 => vec![least.1, greatest.1],
        Some(Extremes { least, greatest }) => vec![greatest.1, least.1],
    };
    columns.iter().map(shown).collect()
}

/// Leaves out points between others of the same height.
fn without_straights(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::with_capacity(points.len());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_stretches_are_two_points() {
        let points = [(0, 5), (1, 5), (2, 5), (3, 7), (4, 5), (5, 5)].map(|(x, y)| (f64::from(x), f64::from(y)));
        let kept = [(0, 5), (2, 5), (3, 7), (4, 5), (5, 5)].map(|(x, y)| (f64::from(x), f64::from(y)));
        assert_eq!(without_straights(points.to_vec()), kept);
    }
}
