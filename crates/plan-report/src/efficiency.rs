//! What threads, buffers and overlaps bring: a program is planned with many of them, and as far as many lengths, again and again in turn.
//!
//! In:  machine, program, how many threads there may be.
//! Out: tables and pictures of the medians: blocks a second, efficiency (time of one thread over that of n threads times n) over
//! threads and over the number of blocks, and the part of the look-ahead that was computed again because an overlap was too short.

use config::Config;
use machine::tables::Tables;
use motion::element::Element;
use motion::plan::PlannerKind;
use motion::ring::{Publish, Sink};
use plot::lines::{number, round_up};
use plot::sheet::{Anchor, Sheet};
use plot::{BODY, GRID, INK, SMALL, TITLE};
use program::text::Reader;
use program::{FeedError, Feeder, Threads, home};
use std::fmt;
use std::time::Instant;

/// Buffers and overlaps of the classic planner that have their turn, beside those of the machine file.
const BUFFERS: [(usize, usize); 8] = [
    (100, 50),
    (300, 0),
    (300, 50),
    (300, 200),
    (1000, 50),
    (1000, 200),
    (3000, 50),
    (3000, 500),
];
const ROUNDS: usize = 5;
/// Threads that have their turn, as far as there may be so many.
const THREADS: [usize; 6] = [1, 2, 3, 4, 6, 8];

/// Blocks after which a plan may end, as far as the program has so many.
const LENGTHS: [usize; 7] = [100, 300, 1_000, 3_000, 10_000, 30_000, 100_000];

/// Takes a plan for nothing.
struct Nothing;

impl Sink<Element> for Nothing {
    fn free(&self) -> usize {
        usize::MAX / 2
    }

    fn publish(&mut self, _: &[Element], _: &[Element]) -> Publish {
        Publish::Done
    }
}

/// Figures of one variant.
#[derive(Clone, Debug)]
struct Row {
    threads: usize,
    /// `None`: the planner cuts its windows by itself.
    buffer: Option<(usize, usize)>,
    /// It ends after so many blocks; `None`: with the program.
    length: Option<usize>,
    seconds: Vec<f64>,
    blocks: usize,
    again: Option<f64>,
}

impl Row {
    fn new(threads: usize, buffer: Option<(usize, usize)>, length: Option<usize>) -> Row {
        Row {
            threads,
            buffer,
            length,
            seconds: Vec::new(),
            blocks: 0,
            again: None,
        }
    }

    fn median_s(&self) -> f64 {
        let mut seconds = self.seconds.clone();
        seconds.sort_by(f64::total_cmp);
        seconds[seconds.len() / 2]
    }
}

/// All variants.
pub(super) struct Efficiency {
    rows: Vec<Row>,
    load: [String; 2],
}

/// Measures; `threads`: the most.
///
/// # Errors
/// The first thing of the program that cannot be planned.
pub(super) fn measure(
    config: &Config,
    tables: &Tables,
    program: (&str, Reader<'_>),
    threads: usize,
) -> Result<Efficiency, FeedError> {
    let own = (
        config.program.look_ahead_buffer_blocks,
        config.program.look_ahead_overlap_blocks,
    );
    let mut buffers = vec![None];
    if config.program.planner == PlannerKind::Classic {
        buffers = BUFFERS.map(Some).to_vec();
        if !BUFFERS.contains(&own) {
            buffers.push(Some(own));
        }
    }
    let mut rows: Vec<Row> = Vec::new();
    for buffer in buffers {
        let counts = THREADS.iter().filter(|count| **count <= threads);
        rows.extend(counts.map(|threads| Row::new(*threads, buffer, None)));
    }
    let own = (config.program.planner == PlannerKind::Classic).then_some(own);
    for length in LENGTHS {
        let counts = THREADS.iter().filter(|count| **count <= threads);
        rows.extend(counts.map(|threads| Row::new(*threads, own, Some(length))));
    }
    let before = load();
    for _ in 0..ROUNDS {
        for row in &mut rows {
            planned(config, tables, program, row)?;
        }
    }
    let load = [before, load()];
    // What is longer than the program is the program.
    rows.retain(|row| row.length.is_none_or(|length| row.blocks >= length));
    Ok(Efficiency { rows, load })
}

/// Plans the program once more.
fn planned(config: &Config, tables: &Tables, (name, text): (&str, Reader<'_>), row: &mut Row) -> Result<(), FeedError> {
    let mut config = config.clone();
    if let Some((buffer, overlap)) = row.buffer {
        config.program.look_ahead_buffer_blocks = buffer;
        config.program.look_ahead_overlap_blocks = overlap;
    }
    std::thread::scope(|scope| {
        let began = Instant::now();
        let threads = Threads::new(row.threads, scope);
        let mut feeder = Feeder::in_threads((&config, tables), text, home(&config), Nothing, threads).beside(name);
        let mut blocks = 0;
        loop {
            let is_done = feeder.pump()? == program::Progress::Done;
            blocks += feeder.ideal_path().count();
            if is_done || row.length.is_some_and(|length| blocks >= length) {
                break;
            }
        }
        row.seconds.push(began.elapsed().as_secs_f64());
        row.blocks = blocks;
        let [ahead, again] = feeder.computed_ahead();
        row.again = (ahead + again > 0).then(|| again as f64 / (ahead + again) as f64);
        Ok(())
    })
}

/// What else the PC does: `load average` of a minute.
fn load() -> String {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').next().unwrap_or_default().to_owned()
}

/// A curve of a picture.
struct Curve {
    name: String,
    points: Vec<(f64, f64)>,
}

// Of a picture, points.
const WIDTH: f64 = 1000.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 740.0;
const CHART: f64 = 460.0;
/// Colours that people with any colour vision can tell apart.
const COLOURS: [&str; 9] = [
    "#0072b2", "#d55e00", "#009e73", "#e69f00", "#56b4e9", "#cc79a7", "#7b4fa0", "#999999", "#222222",
];

/// Efficiency over something that has these marks on its axis.
fn chart(sheet: &mut Sheet, top: f64, axis: &str, marks: &[(f64, String)], curves: &[Curve]) {
    let bottom = top + CHART;
    let points = curves.iter().flat_map(|curve| &curve.points);
    let best = points.map(|point| point.1).fold(1.0, f64::max);
    let top_value = (best * 10.0).ceil() / 10.0;
    let first = marks.first().map_or(0.0, |mark| mark.0);
    let wide = marks.last().map_or(1.0, |mark| mark.0) - first;
    let x = |value: f64| LEFT + (RIGHT - LEFT) * (value - first) / if wide > 0.0 { wide } else { 1.0 };
    let y = |value: f64| bottom - CHART * value / top_value;
    let step = round_up(top_value / 10.0);
    let mut value = 0.0;
    while value <= top_value + 1e-9 {
        sheet.line((LEFT, y(value)), (RIGHT, y(value)), GRID, 1.0, "");
        sheet.text((LEFT - 8.0, y(value) + 4.0), SMALL.at(Anchor::End), &number(value));
        value += step;
    }
    for (at, mark) in marks {
        sheet.line((x(*at), top), (x(*at), bottom), GRID, 1.0, "");
        sheet.text((x(*at), bottom + 18.0), SMALL.at(Anchor::Middle), mark);
    }
    sheet.text((0.5 * (LEFT + RIGHT), bottom + 42.0), BODY.at(Anchor::Middle), axis);
    for (place, curve) in curves.iter().enumerate() {
        let colour = COLOURS[place % COLOURS.len()];
        let points: Vec<_> = curve.points.iter().map(|point| (x(point.0), y(point.1))).collect();
        sheet.path(&points, colour, 2.0, "");
        points.iter().for_each(|at| sheet.dot(*at, 3.5, colour, true));
        let at = top + 10.0 + 22.0 * place as f64;
        sheet.line((RIGHT + 18.0, at), (RIGHT + 46.0, at), colour, 3.0, "");
        sheet.text((RIGHT + 54.0, at + 4.0), BODY, &curve.name);
    }
    sheet.line((LEFT, bottom), (RIGHT, bottom), INK, 1.0, "");
}

impl Efficiency {
    /// Blocks a second, and time of one thread over that of all threads together.
    fn of(&self, row: &Row) -> (f64, f64) {
        let seconds = row.median_s();
        let is_same = |one: &&Row| one.threads == 1 && (one.buffer, one.length) == (row.buffer, row.length);
        let one_s = self.rows.iter().find(is_same).map_or(seconds, Row::median_s);
        (row.blocks as f64 / seconds, one_s / (seconds * row.threads as f64))
    }

    /// Efficiency over threads, a curve for each buffer and overlap, and over the number of blocks, a curve for each number of threads;
    /// `title`: program and machine.
    pub(super) fn picture(&self, title: &str) -> String {
        let mut sheet = Sheet::new(WIDTH);
        sheet.text((24.0, 34.0), TITLE, title);
        let [before, after] = &self.load;
        let what =
            format!("time of one thread over time of n threads times n; medians of {ROUNDS}; load {before} to {after}");
        sheet.text((24.0, 56.0), BODY, &what);
        let most = self.rows.iter().map(|row| row.threads).max().unwrap_or(1).max(2);
        let marks: Vec<_> = (1..=most)
            .map(|threads| (threads as f64, threads.to_string()))
            .collect();
        let whole = || self.rows.iter().filter(|row| row.length.is_none());
        let mut buffers: Vec<_> = whole().map(|row| row.buffer).collect();
        buffers.dedup();
        let curves: Vec<_> = buffers
            .into_iter()
            .map(|buffer| Curve {
                name: name(buffer),
                points: whole()
                    .filter(|row| row.buffer == buffer)
                    .map(|row| (row.threads as f64, self.of(row).1))
                    .collect(),
            })
            .collect();
        chart(&mut sheet, 90.0, "threads", &marks, &curves);
        let parts = || self.rows.iter().filter(|row| row.length.is_some());
        let place = |row: &Row| (row.blocks as f64).log10();
        let ones = parts().filter(|row| row.threads == 1);
        let marks: Vec<_> = ones.map(|row| (place(row), row.blocks.to_string())).collect();
        if marks.is_empty() {
            return sheet.finish(90.0 + CHART + 70.0);
        }
        let curves: Vec<_> = (2..=most)
            .map(|threads| Curve {
                name: format!("{threads} threads"),
                points: parts()
                    .filter(|row| row.threads == threads)
                    .map(|row| (place(row), self.of(row).1))
                    .collect(),
            })
            .filter(|curve| !curve.points.is_empty())
            .collect();
        let top = 90.0 + CHART + 90.0;
        chart(&mut sheet, top, "blocks", &marks, &curves);
        sheet.finish(top + CHART + 70.0)
    }
}

fn name(buffer: Option<(usize, usize)>) -> String {
    match buffer {
        Some((buffer, overlap)) => format!("buffer {buffer}, overlap {overlap}"),
        None => "windows by time".to_owned(),
    }
}

impl fmt::Display for Efficiency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "   blocks  threads   buffer  overlap   blocks/s  efficiency  computed again"
        )?;
        for row in &self.rows {
            let (rate, efficiency) = self.of(row);
            let [buffer, overlap] = match row.buffer {
                Some((buffer, overlap)) => [buffer, overlap].map(|blocks| blocks.to_string()),
                None => ["by time", "by time"].map(str::to_owned),
            };
            let again = row
                .again
                .map_or("-".to_owned(), |again| format!("{:.1} %", 100.0 * again));
            let (blocks, threads) = (row.blocks, row.threads);
            writeln!(
                f,
                "{blocks:>9} {threads:>8} {buffer:>8} {overlap:>8} {rate:>10.0} {efficiency:>11.2} {again:>15}"
            )?;
        }
        writeln!(
            f,
            "medians of {ROUNDS} rounds; load {} to {}",
            self.load[0], self.load[1]
        )
    }
}
