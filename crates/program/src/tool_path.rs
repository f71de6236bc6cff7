//! The way of a whole program for a picture of it, before anything moves.
//!
//! In:  program text; offsets and tools as they are; a tolerance.
//! Out: records, in parts, as long as somebody takes them. Memory does not grow with the program.
//!
//! The way is the programmed one, before corners are rounded, in machine coordinates. A record is where a straight piece of it ends:
//! line of the program (u32), [`Kind`] (u8), one f32 for each axis of the machine (mm, degrees), little end first, without gaps.

use super::text::Reader;
use super::waits::Waits;
use super::{folder, planned_settings};
use config::{Config, UserCodes};
use gcode::{CheckLimits, Interpreter};
use machine::motion_settings::plan_settings;
use machine::tables::Tables;
use motion::cancel::Cancel;
use motion::canon::{AXES, Axis, Call, Position};
use motion::path::{Piece, Shape};
use motion::plan::PathPlanner;
use plot::lines::needed;
use std::time::Duration;

/// Octets of a part at the most.
pub const PART_MAX: usize = 24 * 1024;
/// Finest tolerance, mm: below that, the f32 of a record are no better.
pub const TOLERANCE_MIN_MM: f64 = 1e-3;
/// Points that are simplified together.
const POINTS: usize = 4096;
/// Straight pieces of a curve at the most.
const CHORDS_MAX: usize = 4096;
/// Two places that are the same, mm.
const SAME: f64 = 1e-6;

/// How a record is reached from the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Not at all: the way begins here, or again.
    Begin = 0,
    /// By a rapid move.
    Rapid = 1,
    /// By a straight move at feed.
    Feed = 2,
    /// By a piece of an arc or of another curve.
    Curve = 3,
    /// By a probing move, as if it went its whole way.
    Probe = 4,
}

/// Octets of a record.
pub fn record_octets(axes: usize) -> usize {
    5 + 4 * axes
}

/// The way of a program; `path`: its name. Parts go to `send`, which says whether more is wanted.
///
/// # Errors
/// What is wrong with the program, behind the way up to there.
pub fn trace(
    config: &Config,
    tables: &Tables,
    path: &str,
    text: Reader<'_>,
    (at, tolerance_mm): (Position, f64),
    cancel: &Cancel,
    mut send: impl FnMut(Vec<u8>) -> bool,
) -> Result<(), String> {
    let mut settings = planned_settings(config, tables, at);
    if let Some(folder) = folder(path) {
        settings.subroutine_folders.insert(0, folder.to_owned());
    }
    // It lasts as long as somebody takes it.
    let limits = CheckLimits {
        time: Duration::MAX,
        cancel: cancel.clone(),
        ..CheckLimits::default()
    };
    let (_, asked) = Waits::new(UserCodes::default());
    let mut run = Interpreter::new(settings)
        .with_machine(asked)
        .run_reader(text)
        .within(limits);
    let mut planner = PathPlanner::new(plan_settings(config, at));
    let axes = config.axes.iter().map(|map| map.axis).collect();
    let mut way = Way::new(axes, tolerance_mm);
    let mut failed = None;
    while let Some(event) = run.next() {
        let event = match event {
            Ok(event) => event,
            Err(error) => {
                failed = Some(error.render(path));
                break;
            }
        };
        if let Err(error) = planner.push(&event) {
            failed = Some(run.error_at(error.source, None, error.kind.to_string()).render(path));
        }
        // Nobody wants to know of speeds.
        planner.smoothed().for_each(drop);
        let is_probing = matches!(event.call, Call::StraightProbe { .. });
        for programmed in planner.ideal_path() {
            let kind = match programmed.piece.shape() {
                _ if programmed.rapid => Kind::Rapid,
                _ if is_probing => Kind::Probe,
                Shape::Line(_) => Kind::Feed,
                _ => Kind::Curve,
            };
            way.add(&programmed.piece, kind, programmed.line);
        }
        if way.octets.len() >= PART_MAX && !way.hand_out(&mut send) {
            return Ok(());
        }
        if failed.is_some() {
            break;
        }
    }
    way.simplify();
    way.hand_out(&mut send);
    failed.map_or(Ok(()), Err)
}

/// A place on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    at: [f64; AXES],
    line: u32,
}

/// The way as it comes.
struct Way {
    axes: Vec<Axis>,
    tolerance: f64,
    /// Of one kind, the first of them told already.
    points: Vec<Point>,
    kind: Kind,
    octets: Vec<u8>,
}

impl Way {
    fn new(axes: Vec<Axis>, tolerance_mm: f64) -> Way {
        Way {
            axes,
            tolerance: tolerance_mm.max(TOLERANCE_MIN_MM) / 2.0,
            points: Vec::new(),
            kind: Kind::Begin,
            octets: Vec::new(),
        }
    }

    fn add(&mut self, piece: &Piece, kind: Kind, line: u32) {
        let begin = piece.position(0.0).0;
        if self.points.last().is_none_or(|last| distance(&last.at, &begin) > SAME) {
            self.simplify();
            self.points.clear();
            let point = Point { at: begin, line };
            self.points.push(point);
            self.tell(&point, Kind::Begin);
        }
        if kind != self.kind {
            self.simplify();
            self.kind = kind;
        }
        let chords = match piece.shape() {
            Shape::Line(_) => 1,
            _ => chords(piece, self.tolerance),
        };
        for chord in 1..=chords {
            let s = piece.length() * chord as f64 / chords as f64;
            let at = piece.position(s).0;
            self.points.push(Point { at, line });
            if self.points.len() >= POINTS {
                self.simplify();
            }
        }
    }

    /// Tells the points that are needed; the last of them stays, as the beginning of what follows.
    fn simplify(&mut self) {
        let points = std::mem::take(&mut self.points);
        let apart = |point: &Point, from: &Point, to: &Point| off_line(&point.at, &from.at, &to.at);
        let kept = needed(&points, self.tolerance, apart);
        for at in kept.into_iter().skip(1) {
            self.tell(&points[at], self.kind);
        }
        self.points.extend(points.last());
    }

    fn tell(&mut self, point: &Point, kind: Kind) {
        self.octets.extend(point.line.to_le_bytes());
        self.octets.push(kind as u8);
        for axis in &self.axes {
            self.octets.extend((point.at[*axis as usize] as f32).to_le_bytes());
        }
    }

    /// Hands out what there is in parts; false: nobody wants more.
    fn hand_out(&mut self, send: &mut impl FnMut(Vec<u8>) -> bool) -> bool {
        let records = PART_MAX / record_octets(self.axes.len());
        let octets = std::mem::take(&mut self.octets);
        let mut parts = octets.chunks(records * record_octets(self.axes.len()));
        parts.all(|part| send(part.to_vec()))
    }
}

/// How many straight pieces of equal length stay within a tolerance of a curve.
fn chords(piece: &Piece, tolerance: f64) -> usize {
    let mut chords = 4;
    while chords < CHORDS_MAX {
        let place = |quarter: usize| piece.position(piece.length() * quarter as f64 / (4 * chords) as f64).0;
        let is_near = (0..chords).all(|chord| {
            let (from, to) = (place(4 * chord), place(4 * chord + 4));
            (1..4).all(|quarter| off_line(&place(4 * chord + quarter), &from, &to) <= tolerance)
        });
        if is_near {
            break;
        }
        chords *= 2;
    }
    chords
}

fn distance(from: &[f64; AXES], to: &[f64; AXES]) -> f64 {
    let squares = from.iter().zip(to).map(|(from, to)| (to - from) * (to - from));
    squares.sum::<f64>().sqrt()
}

/// Distance of a point from the straight line between two ends.
fn off_line(point: &[f64; AXES], from: &[f64; AXES], to: &[f64; AXES]) -> f64 {
    let (mut along, mut length2) = (0.0, 0.0);
    for axis in 0..AXES {
        let whole = to[axis] - from[axis];
        along += (point[axis] - from[axis]) * whole;
        length2 += whole * whole;
    }
    let share = if length2 > 0.0 {
        (along / length2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let nearest: [f64; AXES] = std::array::from_fn(|axis| from[axis] + share * (to[axis] - from[axis]));
    distance(point, &nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;
    use std::path::Path;

    fn demo() -> (Config, Tables) {
        let config = config::parse(include_str!("../../../configs/mill3-demo.toml"), Path::new("demo.toml")).unwrap();
        let tables = Tables::read(&config).unwrap();
        (config, tables)
    }

    /// Parts, as far as they are wanted, and how it ended.
    fn parts(text: &str, tolerance_mm: f64, wanted: usize) -> (Vec<Vec<u8>>, Result<(), String>) {
        let (config, tables) = demo();
        let mut parts = Vec::new();
        let at = (crate::home(&config), tolerance_mm);
        let ended = trace(
            &config,
            &tables,
            "p.ngc",
            Reader::from(text.as_bytes()),
            at,
            &Cancel::default(),
            |part| {
                parts.push(part);
                parts.len() < wanted
            },
        );
        (parts, ended)
    }

    fn records(parts: &[Vec<u8>]) -> Vec<(u32, u8, [f32; 3])> {
        let octets = parts.concat();
        let record = |octets: &[u8]| {
            let number = |at: usize| f32::from_le_bytes(octets[at..at + 4].try_into().unwrap());
            (
                u32::from_le_bytes(octets[..4].try_into().unwrap()),
                octets[4],
                [number(5), number(9), number(13)],
            )
        };
        octets.chunks(record_octets(3)).map(record).collect()
    }

    #[test]
    fn moves_are_told_by_kind_and_line_in_machine_coordinates() {
        let text =
            "G21 G90 G94 G10 L2 P1 X5 Y6 Z-1\nG0 X10 Y10\nG1 Z-2 F600\nX20\nX30\nX40\nG3 X50 Y20 J10\nG38.3 X60\nM2\n";
        let (parts, ended) = parts(text, 0.01, usize::MAX);
        assert_eq!(ended, Ok(()));
        let told = records(&parts);
        let (begin, rapid, down) = (told[0], told[1], told[2]);
        assert_eq!(begin.1, Kind::Begin as u8);
        assert_eq!((rapid.0, rapid.1), (2, Kind::Rapid as u8));
        assert_eq!(rapid.2[..2], [15.0, 16.0]);
        assert_eq!((down.0, down.1, down.2), (3, Kind::Feed as u8, [15.0, 16.0, -3.0]));
        // Three lines that are one straight line.
        assert_eq!(told[3], (6, Kind::Feed as u8, [45.0, 16.0, -3.0]));
        let arc: Vec<_> = told.iter().filter(|record| record.1 == Kind::Curve as u8).collect();
        // A quarter of a circle of 10 mm, 0.01 mm off at the most: a chord takes 5 degrees at least.
        assert!((9..=36).contains(&arc.len()), "{arc:?}");
        for (line, _, [x, y, _]) in &arc {
            assert_eq!(*line, 7);
            assert!(((x - 45.0).hypot(y - 26.0) - 10.0).abs() < 1e-4, "{x} {y}");
        }
        assert_eq!(told[told.len() - 1], (8, Kind::Probe as u8, [65.0, 26.0, -3.0]));
    }

    #[test]
    fn a_million_lines_take_parts_of_bounded_size_and_few_where_they_are_straight() {
        let mut text = String::from("G21 G90 G94 G61 F6000\n");
        for line in 0..1_000_000 {
            writeln!(text, "G1X{:.4}", f64::from(line) * 1e-4).unwrap();
        }
        text.push_str("M2\n");
        let (told, ended) = parts(&text, 0.01, usize::MAX);
        assert_eq!(ended, Ok(()));
        let octets: usize = told.iter().map(Vec::len).sum();
        assert!(octets < 300 * record_octets(3), "{octets}");
        // G54 of this machine is 20 mm from its home.
        assert_eq!(records(&told).last().unwrap().2[0], 119.9999);
    }

    #[test]
    fn whoever_has_seen_enough_gets_no_more() {
        let mut text = String::from("G21 G90 G94 G61 F6000\n");
        for line in 0..20_000 {
            writeln!(text, "G1X{}Y{}", line % 100, (line + 1) % 2).unwrap();
        }
        let (told, ended) = parts(&text, 0.01, 3);
        assert_eq!((told.len(), ended), (3, Ok(())));
        assert!(
            told.iter()
                .all(|part| part.len() <= PART_MAX && part.len() % record_octets(3) == 0)
        );
        // All of it: a record a line, as none is straight on.
        let (told, _) = parts(&text, 0.01, usize::MAX);
        let octets: usize = told.iter().map(Vec::len).sum();
        assert_eq!(octets / record_octets(3), 20_001);
    }

    #[test]
    fn an_error_comes_behind_the_way_up_to_it() {
        let (told, ended) = parts("G21 G90 G94 F600\nG1 X10\nG1 X9000\nG1 X20\nM2\n", 0.01, usize::MAX);
        assert!(ended.unwrap_err().contains("p.ngc:3:"));
        assert_eq!(records(&told).last().unwrap().0, 2);
    }
}
