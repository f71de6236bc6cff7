//! A record as a picture: a lane for each channel, one time below all.
//!
//! In:  columns of a record, thinned. Out: SVG. Where cycles are missing, a lane is broken and marked.

use super::thin::Column;
use hal_pins::Type;
use hal_pins::scope::Channel;
use plot::lines::{number, round_up, thin_out};
use plot::sheet::{Anchor, Sheet};
use plot::{BODY, GRID, INK, SMALL, TITLE};

/// Columns that a picture needs at the most.
pub const COLUMNS_MAX: usize = 2000;

const WIDTH: f64 = 1000.0;
const LEFT: f64 = 90.0;
const RIGHT: f64 = 976.0;
const LANE: f64 = 96.0;
const LANE_OF_BIT: f64 = 26.0;
const BETWEEN: f64 = 34.0;
const TOLERANCE: f64 = 0.1;
const GAP: &str = "#f6d5d5";
const TRIGGER: &str = "#d55e00";
const COLOURS: [&str; 4] = ["#0072b2", "#009e73", "#7b4fa0", "#a05a00"];

/// What a picture tells beside its lanes.
#[derive(Clone, Debug, Default)]
pub struct Told {
    pub title: String,
    /// Below the title.
    pub text: String,
    /// Time of a cycle, ns.
    pub period_ns: u64,
    /// The trigger, in words; time 0 is marked then.
    pub trigger: Option<String>,
    /// Values that the trigger compares with, by the number of a channel.
    pub levels: Vec<(usize, f64)>,
}

/// Draws a record.
pub fn svg(told: &Told, channels: &[Channel], columns: &[Column]) -> String {
    let mut sheet = Sheet::new(WIDTH);
    sheet.text((24.0, 34.0), TITLE, &told.title);
    sheet.text((24.0, 56.0), BODY, &told.text);
    let begin_ns = columns.first().map_or(0, |column| column.time_ns);
    let after = |column: &Column| end_ns(column, told.period_ns);
    let end_ns = columns.last().map_or(1, after).max(begin_ns.saturating_add(1));
    let seconds = |ns: i64| ns as f64 * 1e-9;
    let (from_s, to_s) = (seconds(begin_ns), seconds(end_ns));
    let x_of = |time_s: f64| LEFT + (time_s - from_s) / (to_s - from_s) * (RIGHT - LEFT);
    let step_s = round_up((to_s - from_s) / 12.0);
    let first = (from_s / step_s).ceil() as i64;
    let grid: Vec<f64> = (first..first + 30)
        .map(|at| at as f64 * step_s)
        .take_while(|time_s| *time_s <= to_s)
        .collect();
    let gaps: Vec<(i64, i64)> = columns
        .windows(2)
        .map(|pair| (after(&pair[0]), pair[1].time_ns))
        .filter(|(end, next)| is_gap(*end, *next, told.period_ns))
        .collect();
    let mut top = 84.0;
    for (number_of, channel) in channels.iter().enumerate() {
        let is_bit = channel.value_type == Type::Bit;
        let bottom = top + if is_bit { LANE_OF_BIT } else { LANE };
        let ranges = columns.iter().filter_map(|column| column.ranges.get(number_of));
        let finite = ranges
            .clone()
            .filter(|[least, greatest]| least.is_finite() && greatest.is_finite());
        let extremes = finite.fold(None, |all: Option<[f64; 2]>, [least, greatest]| {
            let [low, high] = all.unwrap_or([*least, *greatest]);
            Some([low.min(*least), high.max(*greatest)])
        });
        let told_range = match extremes {
            None => "no number".to_owned(),
            Some(_) if is_bit => String::new(),
            Some([low, high]) => format!("{low} .. {high} {}", channel.unit),
        };
        sheet.text((LEFT, top - 6.0), BODY, &channel.name);
        sheet.text((RIGHT, top - 6.0), SMALL.at(Anchor::End), told_range.trim_end());
        let levels = told
            .levels
            .iter()
            .filter(|(of, _)| *of == number_of)
            .map(|(_, level)| *level);
        let [low, high] = match extremes {
            _ if is_bit => [0.0, 1.0],
            Some([low, high]) => levels
                .clone()
                .fold([low, high], |[low, high], level| [low.min(level), high.max(level)]),
            None => [0.0, 1.0],
        };
        // A constant has room around it, too.
        let room = match high - low {
            0.0 => low.abs().max(1.0) * 0.1,
            range => range * 0.08,
        };
        let (low, high) = (low - room, high + room);
        let y_of = |value: f64| bottom - (value - low) / (high - low) * (bottom - top);
        for (end, next) in &gaps {
            sheet.rectangle((x_of(seconds(*end)), top), (x_of(seconds(*next)), bottom), GAP);
        }
        if !is_bit {
            let step = round_up((high - low) / 3.0);
            let first = (low / step).ceil() as i64;
            for value in (first..first + 8)
                .map(|at| at as f64 * step)
                .take_while(|value| *value <= high)
            {
                sheet.line((LEFT, y_of(value)), (RIGHT, y_of(value)), GRID, 1.0, "");
                sheet.text((LEFT - 7.0, y_of(value) + 4.0), SMALL.at(Anchor::End), &label(value));
            }
        }
        for time_s in &grid {
            sheet.line((x_of(*time_s), top), (x_of(*time_s), bottom), GRID, 1.0, "");
        }
        sheet.path(&[(LEFT, top), (LEFT, bottom), (RIGHT, bottom)], INK, 1.0, "");
        for level in levels {
            sheet.line((LEFT, y_of(level)), (RIGHT, y_of(level)), TRIGGER, 1.0, "5 4");
        }
        if told.trigger.is_some() && (begin_ns..=end_ns).contains(&0) {
            sheet.line((x_of(0.0), top), (x_of(0.0), bottom), TRIGGER, 1.0, "2 3");
        }
        let holds = channel.value_type != Type::Float;
        let colour = COLOURS[number_of % COLOURS.len()];
        for line in lines(columns, number_of, holds, told.period_ns) {
            let places: Vec<(f64, f64)> = line
                .iter()
                .map(|(time_s, value)| (x_of(*time_s), y_of(*value)))
                .collect();
            sheet.path(&thin_out(&places, TOLERANCE), colour, 1.3, "");
        }
        top = bottom + BETWEEN;
    }
    for time_s in &grid {
        sheet.text(
            (x_of(*time_s), top - BETWEEN + 17.0),
            SMALL.at(Anchor::Middle),
            &label(*time_s),
        );
    }
    let below = match &told.trigger {
        Some(trigger) => format!("time, s; 0 is the trigger: {trigger}"),
        None => "time, s".into(),
    };
    let middle = (LEFT + RIGHT) / 2.0;
    sheet.text((middle, top + 4.0), BODY.at(Anchor::Middle), &below);
    if !gaps.is_empty() {
        sheet.text((LEFT, top + 24.0), SMALL, "shaded: cycles that are missing");
    }
    sheet.finish(top + if gaps.is_empty() { 18.0 } else { 36.0 })
}

/// Short, and exact enough to tell lines of a grid apart.
fn label(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if (0.01..1e6).contains(&size) => number(value),
        _ => format!("{value:.0e}"),
    }
}

fn end_ns(column: &Column, period_ns: u64) -> i64 {
    let length = column.samples.saturating_mul(period_ns);
    column.time_ns.saturating_add(i64::try_from(length).unwrap_or(i64::MAX))
}

/// Whether a cycle is missing between the end of a column and the next one.
fn is_gap(end_ns: i64, next_ns: i64, period_ns: u64) -> bool {
    next_ns.saturating_sub(end_ns) > (period_ns / 2) as i64
}

/// The lines of a channel, each without a gap. `holds`: its value stays until the next one, else it goes there straight.
fn lines(columns: &[Column], channel: usize, holds: bool, period_ns: u64) -> Vec<Vec<(f64, f64)>> {
    let mut lines: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut line: Vec<(f64, f64)> = Vec::new();
    let mut before_ns: Option<i64> = None;
    for column in columns {
        let Some([least, greatest]) = column.ranges.get(channel).copied() else {
            continue;
        };
        let is_broken = before_ns.is_some_and(|before_ns| is_gap(before_ns, column.time_ns, period_ns));
        if is_broken || !least.is_finite() || !greatest.is_finite() {
            lines.push(std::mem::take(&mut line));
        }
        before_ns = Some(end_ns(column, period_ns));
        if !least.is_finite() || !greatest.is_finite() {
            continue;
        }
        let time_s = column.time_ns as f64 / 1e9;
        let last = line.last().map(|(_, value)| *value);
        if let Some(last) = last.filter(|_| holds) {
            line.push((time_s, last));
        }
        // The nearer end first, so that no line is drawn that is none.
        let is_falling = last.is_some_and(|last| (last - greatest).abs() < (last - least).abs());
        let (first, second) = if is_falling {
            (greatest, least)
        } else {
            (least, greatest)
        };
        line.push((time_s, first));
        if first != second {
            line.push((time_s, second));
        }
        // One cycle alone is a point that lasts a cycle.
        if holds || column.samples == 1 && columns.len() == 1 {
            line.push((end_ns(column, period_ns) as f64 / 1e9, second));
        }
    }
    lines.push(line);
    lines.retain(|line| line.len() > 1);
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use hal_pins::scope::{Capture, Sampler};
    use hal_pins::{Attached, Hal};

    fn channels() -> Vec<Channel> {
        let folder = tempfile::tempdir().unwrap();
        let dirs = [folder.path().to_owned()];
        let mut hal = Hal::create_in(&dirs, "m", 4).unwrap();
        hal.input("a.position", 0.0).unwrap();
        hal.set_unit("a.position", "mm").unwrap();
        hal.input("a.on", false).unwrap();
        let _sampler = Sampler::new(&hal, 1).unwrap();
        let pins = Attached::attach_in(&dirs, "m").unwrap();
        let capture = Capture::begin(&pins, &["a.position", "a.on"]).unwrap();
        capture.channels().to_vec()
    }

    fn column(time_ns: i64, position: [f64; 2], on: [f64; 2]) -> Column {
        Column {
            time_ns,
            samples: 2,
            ranges: vec![position, on],
        }
    }

    #[test]
    fn a_record_is_a_picture_with_its_lanes_gaps_and_trigger() {
        let columns = [
            column(-4_000_000, [1.0, 2.0], [0.0, 0.0]),
            column(-2_000_000, [2.0, 3.0], [0.0, 1.0]),
            column(0, [f64::NAN, f64::NAN], [1.0, 1.0]),
            // Three cycles later than it should be.
            column(5_000_000, [3.0, -1.5], [1.0, 1.0]),
        ];
        let told = Told {
            title: "mill <3>".into(),
            text: "two pins".into(),
            period_ns: 1_000_000,
            trigger: Some("a.position>2.5".into()),
            levels: vec![(0, 2.5)],
        };
        let svg = svg(&told, &channels(), &columns);
        assert!(roxmltree::Document::parse(&svg).is_ok(), "{svg}");
        for text in [
            ">mill &lt;3&gt;<",
            ">a.position<",
            ">a.on<",
            "mm<",
            "time, s; 0 is the trigger: a.position&gt;2.5",
            ">shaded: cycles that are missing<",
            GAP,
        ] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn lines_break_at_gaps_and_keep_every_extreme() {
        let ms = 1_000_000;
        let columns = [
            column(0, [1.0, 5.0], [0.0, 0.0]),
            column(2 * ms, [0.0, 4.0], [0.0, 1.0]),
            column(7 * ms, [2.0, 2.0], [1.0, 1.0]),
            column(9 * ms, [3.0, 3.0], [1.0, 1.0]),
        ];
        let found = lines(&columns, 0, false, ms as u64);
        assert_eq!(
            found,
            [
                vec![(0.0, 1.0), (0.0, 5.0), (0.002, 4.0), (0.002, 0.0)],
                vec![(0.007, 2.0), (0.009, 3.0)]
            ]
        );
        let held = lines(&columns, 1, true, ms as u64);
        assert_eq!(
            held[0],
            [
                (0.0, 0.0),
                (0.002, 0.0),
                (0.002, 0.0),
                (0.002, 0.0),
                (0.002, 1.0),
                (0.004, 1.0)
            ]
        );
        for nothing in [svg(&Told::default(), &channels(), &[]), svg(&Told::default(), &[], &[])] {
            assert!(roxmltree::Document::parse(&nothing).is_ok());
        }
    }
}
