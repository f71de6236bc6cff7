//! Which thread planned what, and when, as a picture.
//!
//! In:  the record of a planning.
//! Out: SVG: a lane for each thread over the whole time, with the share of time that it worked; below, one by one, its pieces of
//! work in the first part of it.

use motion::plan::timeline::{Lane, Record, TASKS, Task};
use plot::lines::{number, round_up};
use plot::sheet::{Anchor, Face, Sheet};
use plot::{BODY, GRID, INK, SMALL, TITLE};

const WIDTH: f64 = 1200.0;
const EDGE: f64 = 24.0;
const LEFT: f64 = 130.0;
const RIGHT: f64 = WIDTH - 260.0;
const HEAD: f64 = 110.0;
/// Of a lane, and between two.
const LANE: f64 = 34.0;
const GAP: f64 = 8.0;
/// Between the two parts of the picture: numbers and name of the axis, name of what follows.
const BELOW: f64 = 92.0;
/// Pieces of work of the busiest thread that are drawn one by one.
const PIECES: usize = 160;

/// Colours that people with any colour vision can tell apart, and words.
const TASKS_SHOWN: [(Task, &str, &str); TASKS] = [
    (Task::Interpret, "#0072b2", "interpret, compensate"),
    (Task::Smooth, "#56b4e9", "smooth"),
    (Task::Slope, "#e69f00", "slope, hand over"),
    (Task::LookAhead, "#009e73", "look ahead"),
];

/// Draws it; `what`: program, machine and figures, a line each.
pub(super) fn picture(what: &[String; 2], record: &Record) -> String {
    let mut sheet = Sheet::new(WIDTH);
    sheet.text((EDGE, 34.0), TITLE, &what[0]);
    sheet.text((EDGE, 56.0), BODY, &what[1]);
    legend(&mut sheet);
    let end_ns = record.end_ns().max(1);
    let bottom = whole(&mut sheet, record, end_ns);
    let height = begin(&mut sheet, record, bottom + BELOW);
    sheet.finish(height)
}

fn legend(sheet: &mut Sheet) {
    let mut x = EDGE;
    let white = ("#ffffff", "wait");
    let tasks = TASKS_SHOWN.iter().map(|(_, colour, name)| (*colour, *name));
    for (colour, name) in tasks.chain([white]) {
        sheet.rectangle((x, 72.0), (x + 14.0, 86.0), INK);
        sheet.rectangle((x + 1.0, 73.0), (x + 13.0, 85.0), colour);
        sheet.text((x + 20.0, 84.0), BODY, name);
        x += 44.0 + BODY.width(name);
    }
}

/// Every thread over the whole time; gives where it ends.
fn whole(sheet: &mut Sheet, record: &Record, end_ns: u64) -> f64 {
    let bottom = HEAD + record.lanes.len() as f64 * (LANE + GAP);
    let at = |ns: u64| LEFT + (RIGHT - LEFT) * ns as f64 / end_ns as f64;
    time_axis(sheet, (HEAD, bottom), end_ns);
    for (row, lane) in record.lanes.iter().enumerate() {
        let top = HEAD + row as f64 * (LANE + GAP);
        name(sheet, lane, top);
        for (part, tasks) in lane.parts.iter().enumerate() {
            let (from, to) = (part as u64 * record.part_ns, (part as u64 + 1) * record.part_ns);
            let mut foot = top + LANE;
            for (task, colour, _) in TASKS_SHOWN {
                let height = LANE * tasks[task as usize] as f64 / record.part_ns as f64;
                if height > 0.05 {
                    sheet.rectangle((at(from), foot - height), (at(to), foot), colour);
                }
                foot -= height;
            }
        }
        let busy_ns: u64 = lane.total_ns.iter().sum();
        let share = |ns: u64| format!("{:.0} %", 100.0 * ns as f64 / end_ns as f64);
        let text = format!("busy {}", share(busy_ns));
        sheet.text((RIGHT + 12.0, top + 15.0), BODY.bold(), &text);
        let tasks = TASKS_SHOWN
            .iter()
            .filter(|(task, ..)| lane.total_ns[*task as usize] > 0);
        let mut x = RIGHT + 12.0;
        for (task, colour, _) in tasks {
            let text = share(lane.total_ns[*task as usize]);
            sheet.rectangle((x, top + 22.0), (x + 9.0, top + 31.0), colour);
            sheet.text((x + 13.0, top + 31.0), SMALL, &text);
            x += 20.0 + SMALL.width(&text);
        }
    }
    bottom
}

/// The pieces of work at the beginning, one by one; gives the height of the picture.
fn begin(sheet: &mut Sheet, record: &Record, top: f64) -> f64 {
    // As long as all pieces of every thread are known, and no more than can be told apart.
    let known = |lane: &Lane| lane.first.get(PIECES).map(|worked| worked.end_ns);
    let last = |lane: &Lane| lane.first.last().map(|worked| worked.end_ns);
    let most = record.lanes.iter().filter_map(last).max().unwrap_or(1);
    let end_ns = record.lanes.iter().filter_map(known).min().unwrap_or(most).max(1);
    sheet.text((EDGE, top - 18.0), BODY.bold(), "the beginning, piece by piece");
    let bottom = top + record.lanes.len() as f64 * (LANE + GAP);
    let at = |ns: u64| LEFT + (RIGHT - LEFT) * ns.min(end_ns) as f64 / end_ns as f64;
    time_axis(sheet, (top, bottom), end_ns);
    for (row, lane) in record.lanes.iter().enumerate() {
        let top = top + row as f64 * (LANE + GAP);
        name(sheet, lane, top);
        for worked in lane.first.iter().take_while(|worked| worked.begin_ns < end_ns) {
            let colour = TASKS_SHOWN[worked.task as usize].1;
            let (from, to) = (at(worked.begin_ns), at(worked.end_ns));
            sheet.rectangle((from, top), (to.max(from + 0.4), top + LANE), colour);
        }
    }
    bottom + 60.0
}

fn name(sheet: &mut Sheet, lane: &Lane, top: f64) {
    const NAME: Face = BODY.at(Anchor::End);
    let name = if lane.name == "main" { "program" } else { &lane.name };
    sheet.text((LEFT - 10.0, top + 0.65 * LANE), NAME, name);
    sheet.line((LEFT, top + LANE), (RIGHT, top + LANE), GRID, 1.0, "");
}

fn time_axis(sheet: &mut Sheet, (top, bottom): (f64, f64), end_ns: u64) {
    let end_ms = end_ns as f64 / 1e6;
    let step = round_up(end_ms / 8.0);
    let mut ms = 0.0;
    while ms <= end_ms {
        let x = LEFT + (RIGHT - LEFT) * ms / end_ms;
        sheet.line((x, top - 4.0), (x, bottom), GRID, 1.0, "");
        sheet.text((x, bottom + 16.0), SMALL.at(Anchor::Middle), &number(ms));
        ms += step;
    }
    sheet.text(
        (0.5 * (LEFT + RIGHT), bottom + 36.0),
        BODY.at(Anchor::Middle),
        "time, ms",
    );
}
