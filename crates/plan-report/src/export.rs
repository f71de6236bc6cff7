//! Files of numbers about a plan, for other programs.
//!
//! In:  a program that is run down.
//! Out: set-points; the programmed path; the smoothed path with its derivatives.

use super::judge::Cycle;
use super::run_down::whole;
use config::Config;
use machine::tables::Tables;
use motion::canon::{Axis, Position};
use motion::element::{Element, Span};
use motion::path::{Jet, Shape};
use motion::plan::Programmed;
use motion::ring::{Publish, Sink};
use program::text::Reader;
use program::{FeedError, Feeder, home};
use std::collections::HashMap;
use std::fmt::Write as _;

/// Speed below which a span ends at rest, mm/s: less than a cycle of the lowest jerk reaches.
const REST_MM_S: f64 = 1e-6;

fn letters(config: &Config) -> Vec<(Axis, char)> {
    let axes = config.axes.iter().map(|map| map.axis);
    axes.map(|axis| (axis, axis.letter().to_ascii_lowercase())).collect()
}

/// One commanded position per cycle: `t,` and the axes, s and mm (degrees).
#[derive(Debug)]
pub(super) struct Samples {
    axes: Vec<Axis>,
    csv: String,
}

impl Samples {
    pub(super) fn new(config: &Config) -> Samples {
        let axes = letters(config);
        let mut csv = String::from("t");
        axes.iter().for_each(|(_, letter)| csv.extend([',', *letter]));
        Samples {
            axes: axes.into_iter().map(|(axis, _)| axis).collect(),
            csv,
        }
    }

    pub(super) fn push(&mut self, cycle: &Cycle, cycle_s: f64) {
        let _ = write!(self.csv, "\n{:.6}", cycle.number as f64 * cycle_s);
        for axis in &self.axes {
            let _ = write!(self.csv, ",{:.12}", cycle.position[*axis]);
        }
    }

    pub(super) fn finish(self) -> String {
        self.csv + "\n"
    }
}

/// The programmed path, one element a line: `P x y z`, `L x y z F mm/s`, `C x y z cx cy cz nx ny nz F mm/s T turns`.
#[derive(Debug, Default)]
pub(super) struct ProgrammedPath {
    pub(super) text: String,
}

impl ProgrammedPath {
    pub(super) fn push(&mut self, element: &Programmed) {
        let xyz = |position: &Position| {
            let [x, y, z] = [Axis::X, Axis::Y, Axis::Z].map(|axis| position[axis]);
            format!("{x:.12} {y:.12} {z:.12}")
        };
        let text = &mut self.text;
        if text.is_empty() {
            *text += &format!("P {}\n", xyz(&element.piece.position(0.0)));
        }
        let end = xyz(&element.piece.position(element.piece.length()));
        let feed = if element.feed.is_finite() {
            format!(" F {:.9}", element.feed)
        } else {
            String::new()
        };
        match element.piece.shape() {
            Shape::Arc(arc) => {
                let ([cx, cy, cz], [nx, ny, nz]) = (arc.centre_mm(), arc.turns_about());
                // Full turns beyond the first; an arc that ends where it begins makes one.
                let turns = (arc.sweep_rad() / std::f64::consts::TAU - 1e-9).ceil() - 1.0;
                *text += &format!("C {end} {cx:.12} {cy:.12} {cz:.12} {nx} {ny} {nz}{feed} T {turns}\n");
            }
            Shape::Line(_) => *text += &format!("L {end}{feed}\n"),
            // A part of a curve, which turns by less than a radian: lines that leave it by less than a micrometre.
            Shape::Blend(_) => {
                let length = element.piece.length();
                let count = (length / 8e-3).sqrt().ceil().max(1.0) * 2.0;
                for k in 1..=count as u32 {
                    let end = xyz(&element.piece.position(length * f64::from(k) / count));
                    *text += &format!("L {end}{feed}\n");
                }
            }
        }
    }
}

/// The smoothed path, one point per millisecond of the plan: section (a new one begins at every rest), plan time within it,
/// length, planned speed, programmed feed of the line (`feeds`), and for each axis position and three derivatives by length.
///
/// # Errors
/// The first thing of the program that cannot be planned.
pub(super) fn smoothed(
    config: &Config,
    tables: &Tables,
    (name, text): (&str, Reader<'_>),
    feeds: HashMap<u32, f64>,
) -> Result<String, FeedError> {
    let axes = letters(config);
    let mut csv = String::from("section,t,s,v,feed");
    for name in ["", "1", "2", "3"] {
        axes.iter().for_each(|(_, letter)| {
            let _ = write!(csv, ",{letter}{name}");
        });
    }
    csv.push('\n');
    let points = Points {
        axes: axes.into_iter().map(|(axis, _)| axis).collect(),
        feeds,
        csv,
        section: 0,
        time_s: 0.0,
        next_s: 0.0,
        length: 0.0,
        tail: Vec::new(),
    };
    let mut feeder = Feeder::new(config, tables, text, home(config), points).beside(name);
    whole(&mut feeder)?;
    let points = feeder.sink();
    for element in std::mem::take(&mut points.tail) {
        points.element(&element);
    }
    Ok(std::mem::take(&mut points.csv))
}

/// Writes down points of whatever is planned.
struct Points {
    axes: Vec<Axis>,
    feeds: HashMap<u32, f64>,
    csv: String,
    section: usize,
    /// Plan time and length since the beginning of the section.
    time_s: f64,
    length: f64,
    /// When the next point is due.
    next_s: f64,
    tail: Vec<Element>,
}

impl Sink<Element> for Points {
    fn free(&self) -> usize {
        usize::MAX / 2
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        committed.iter().for_each(|element| self.element(element));
        self.tail.clear();
        self.tail.extend_from_slice(tail);
        Publish::Done
    }
}

impl Points {
    /// Seconds between points.
    const STEP_S: f64 = 1e-3;

    fn element(&mut self, element: &Element) {
        let Element::Span(span) = element else {
            // Rest follows upon rest, which has begun a section already.
            return;
        };
        while self.next_s < self.time_s + span.duration_s {
            let t_s = (self.next_s - self.time_s).max(0.0);
            self.point(span, t_s);
            self.next_s += Points::STEP_S;
        }
        if span.speed(span.duration_s) < REST_MM_S {
            self.point(span, span.duration_s);
            self.section += 1;
            (self.time_s, self.next_s, self.length) = (0.0, 0.0, 0.0);
        } else {
            self.length += span.place(span.duration_s) - span.s0;
            self.time_s += span.duration_s;
        }
    }

    fn point(&mut self, span: &Span, t_s: f64) {
        let place = span.place(t_s);
        let Jet { q, d1, d2, d3 } = span.piece.jet(place);
        let feed = self.feeds.get(&span.line).copied().filter(|_| !span.rapid);
        let _ = write!(
            self.csv,
            "{},{:.9},{:.12},{:.12},{}",
            self.section,
            self.time_s + t_s,
            self.length + place - span.s0,
            span.speed(t_s).max(0.0),
            feed.unwrap_or(f64::INFINITY)
        );
        for values in [q, d1, d2, d3] {
            for axis in &self.axes {
                let _ = write!(self.csv, ",{:.12e}", values[*axis as usize]);
            }
        }
        self.csv.push('\n');
    }
}
