//! Simple jobs (`crates/jobs`) on the simulated machine: what set-points drive is where a drawing of the job wants it, within 5 µm.
//!
//! Judged from the set-points of all cycles alone, in work coordinates; never from the text of the program.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::operator::rehearsal::rehearse;
use isocnc::sim::NetConfig;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::path::Path;

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const CYCLES_MAX: u64 = 400_000;
/// What a job may be wrong by.
const TOLERANCE_MM: f64 = 0.005;
/// Where jobs are, so that all of them is within the travel.
const MIDDLE: [f64; 2] = [60.0, 55.0];

fn machine() -> Config {
    config::parse(MACHINE, Path::new("mill3-demo.toml")).expect("a good machine file")
}

/// The set-points of a job, one a cycle.
fn driven(kind: &str, values: &Value) -> Vec<[f64; 3]> {
    let config = machine();
    let made = jobs::kind(kind).and_then(|kind| kind.make(values.as_object().unwrap()));
    let text = made.unwrap_or_else(|wrong| panic!("{}", wrong.message));
    let origin = config.work_offsets[0].0;
    let mut points = Vec::new();
    rehearse(&config, text.as_bytes(), NetConfig::clean(1), |run| {
        let outcome = run.run(CYCLES_MAX).unwrap_or_else(|error| panic!("{error:#}\n{text}"));
        assert_eq!((outcome, run.operator.alarms()), (Outcome::Completed, &[][..]));
        let samples = run.operator.recorder.samples();
        points = samples
            .iter()
            .map(|sample| std::array::from_fn(|axis| sample.command[axis] - origin[axis]))
            .collect();
        Ok(())
    })
    .expect("a machine to rehearse on");
    assert!(points.len() > 1000, "{} cycles", points.len());
    points
}

/// Ways that are driven at this height.
fn at_height(points: &[[f64; 3]], z: f64) -> Vec<[[f64; 2]; 2]> {
    let is_there = |point: &[f64; 3]| (point[2] - z).abs() < TOLERANCE_MM;
    let pairs = points.windows(2).filter(|pair| pair.iter().all(is_there));
    pairs
        .map(|pair| [[pair[0][0], pair[0][1]], [pair[1][0], pair[1][1]]])
        .collect()
}

/// How far a place is from the nearest way.
fn distance(ways: &[[[f64; 2]; 2]], [x, y]: [f64; 2]) -> f64 {
    let off = ways.iter().map(|[a, b]| {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx * dx + dy * dy;
        let share = match length > 0.0 {
            true => (((x - a[0]) * dx + (y - a[1]) * dy) / length).clamp(0.0, 1.0),
            false => 0.0,
        };
        (x - a[0] - share * dx).hypot(y - a[1] - share * dy)
    });
    off.fold(f64::INFINITY, f64::min)
}

/// How far a place lies outside of a rectangle with round corners about the middle of the job; below 0 inside.
fn outside([x, y]: [f64; 2], half: [f64; 2], corner: f64) -> f64 {
    let (dx, dy) = (
        (x - MIDDLE[0]).abs() - (half[0] - corner),
        (y - MIDDLE[1]).abs() - (half[1] - corner),
    );
    dx.max(0.0).hypot(dy.max(0.0)) + dx.max(dy).min(0.0) - corner
}

/// Asserts an error, and tells the greatest of a job.
struct Judge {
    what: &'static str,
    worst: f64,
}

impl Judge {
    fn new(what: &'static str) -> Judge {
        Judge { what, worst: 0.0 }
    }

    #[track_caller]
    fn look(&mut self, off: f64, place: &str) {
        assert!(off.abs() <= TOLERANCE_MM, "{}: {place}: off by {off} mm", self.what);
        self.worst = self.worst.max(off.abs());
    }
}

impl Drop for Judge {
    fn drop(&mut self) {
        println!("{}: off by {:.4} mm at most", self.what, self.worst);
    }
}

/// The wall is met all around, at full depth, and never cut; the floor is at its depth.
fn assert_pocket(what: &'static str, points: &[[f64; 3]], half: [f64; 2], corner: f64, depth: f64) {
    let mut judge = Judge::new(what);
    let lowest = points.iter().fold(f64::INFINITY, |lowest, point| lowest.min(point[2]));
    judge.look(lowest + depth, "depth");
    for &[x, y, z] in points.iter().filter(|point| point[2] < -TOLERANCE_MM) {
        judge.look(outside([x, y], half, corner).max(0.0), &format!("wall at {x} {y} {z}"));
    }
    let floor = at_height(points, -depth);
    // Rays from the middle to the wall.
    for index in 0..720 {
        let (sin, cos) = (f64::from(index) / 720.0 * TAU).sin_cos();
        let (mut low, mut high) = (0.0, half[0].hypot(half[1]));
        for _ in 0..50 {
            let middle = (low + high) / 2.0;
            match outside([MIDDLE[0] + middle * cos, MIDDLE[1] + middle * sin], half, corner) > 0.0 {
                true => high = middle,
                false => low = middle,
            }
        }
        let wall = [MIDDLE[0] + low * cos, MIDDLE[1] + low * sin];
        judge.look(distance(&floor, wall), &format!("wall not met at {wall:?}"));
    }
}

/// Numbers of all jobs here, and those of one: fast, in the middle.
fn with(values: &Value) -> Value {
    let mut all = json!({ "x": MIDDLE[0], "y": MIDDLE[1], "feed": 2000, "safe_height": 5 });
    let own = values.as_object().unwrap().clone();
    all.as_object_mut().unwrap().extend(own);
    all
}

#[test]
fn rectangular_pockets() {
    for (what, corner, finish) in [
        (
            "rectangular pocket with round corners and a finishing pass",
            6.0_f64,
            0.2,
        ),
        ("rectangular pocket with the tool's corners", 0.0, 0.2),
        ("rectangular pocket without a finishing pass", 6.0, 0.0),
    ] {
        let points = driven(
            "rectangular_pocket",
            &with(&json!({
                "length": 34, "width": 24, "corner_radius": corner, "depth": 3, "stepdown": 2, "tool_diameter": 8, "finish": finish,
                "ramp_angle": 10, "plunge_feed": 1000,
            })),
        );
        let half = [13.0, 8.0];
        assert_pocket(what, &points, half, (corner - 4.0).max(0.0), 3.0);
    }
}

#[test]
fn circular_pockets() {
    for (what, entry) in [
        ("circular pocket entered on a helix", "helix"),
        ("circular pocket entered on a ramp", "ramp"),
    ] {
        let points = driven(
            "circular_pocket",
            &with(
                &json!({ "diameter": 30, "depth": 2.5, "stepdown": 2.5, "tool_diameter": 8, "entry": entry, "ramp_angle": 10,
                "plunge_feed": 1000 }),
            ),
        );
        assert_pocket(what, &points, [11.0; 2], 11.0, 2.5);
    }
}

#[test]
fn a_faced_surface() {
    let points = driven(
        "facing",
        &json!({
            "x": 20, "y": 20, "length": 60, "width": 40, "depth": 1, "stepdown": 0.5, "finish": 0.2, "tool_diameter": 20, "stepover": 15,
            "overrun": 1, "feed": 4000, "plunge_feed": 2000, "safe_height": 5,
        }),
    );
    let mut judge = Judge::new("facing");
    let lowest = points.iter().fold(f64::INFINITY, |lowest, point| lowest.min(point[2]));
    judge.look(lowest + 1.0, "depth");
    // 41 mm in three rows; the edge of the tool is where each of them ends.
    let floor = at_height(&points, -1.0);
    for row in 1..=3 {
        let y = 20.0 + f64::from(row) * 41.0 / 3.0 - 10.0;
        for x in 9..=91 {
            // Rows end in corners.
            judge.look(distance(&floor, [f64::from(x), y]), &format!("row {row} at {x}"));
        }
    }
}

/// The middle of each place where the tool is at the bottom, in the order in which it is there.
fn bottoms(points: &[[f64; 3]], depth: f64) -> Vec<[f64; 3]> {
    let mut found: Vec<[f64; 3]> = Vec::new();
    for &[x, y, z] in points.iter().filter(|point| point[2] < -0.9 * depth) {
        match found.last_mut() {
            Some(last) if (last[0] - x).hypot(last[1] - y) < 1.0 => last[2] = last[2].min(z),
            _ => found.push([x, y, z]),
        }
    }
    found
}

/// In the hole, the tool never leaves its axis; each hole once, as deep as was said.
fn assert_holes(what: &'static str, points: &[[f64; 3]], holes: &[[f64; 2]], depth: f64) {
    let mut judge = Judge::new(what);
    let found = bottoms(points, depth);
    assert_eq!(found.len(), holes.len(), "{what}: {found:?}");
    for &[x, y, _] in points.iter().filter(|point| point[2] < -TOLERANCE_MM) {
        let off = holes.iter().map(|hole| (hole[0] - x).hypot(hole[1] - y));
        judge.look(off.fold(f64::INFINITY, f64::min), &format!("off the hole at {x} {y}"));
    }
    for hole in holes {
        let nearest = found
            .iter()
            .min_by(|a, b| {
                let off = |at: &[f64; 3]| (at[0] - hole[0]).hypot(at[1] - hole[1]);
                off(a).total_cmp(&off(b))
            })
            .unwrap();
        judge.look(
            (nearest[0] - hole[0]).hypot(nearest[1] - hole[1]),
            &format!("hole {hole:?}"),
        );
        judge.look(nearest[2] + depth, &format!("depth of hole {hole:?}"));
    }
}

#[test]
fn holes() {
    for (cycle, what) in [("drill", "bolt circle, G81"), ("peck", "bolt circle, G83")] {
        let points = driven(
            "bolt_circle",
            &with(
                &json!({ "diameter": 40, "count": 5, "angle": 15, "depth": 6, "cycle": cycle, "peck": 2.5, "retract": 0.5 }),
            ),
        );
        let hole = |index: u32| {
            let (sin, cos) = (15.0 + 72.0 * f64::from(index)).to_radians().sin_cos();
            [MIDDLE[0] + 20.0 * cos, MIDDLE[1] + 20.0 * sin]
        };
        assert_holes(what, &points, &(0..5).map(hole).collect::<Vec<_>>(), 6.0);
    }
    for (cycle, what) in [("chip_break", "rows of holes, G73"), ("dwell", "rows of holes, G82")] {
        let points = driven(
            "hole_rows",
            &with(&json!({
                "columns": 3, "rows": 2, "column_spacing": 12, "row_spacing": 9, "angle": 20, "depth": 6, "cycle": cycle, "peck": 2.5,
                "dwell": 0.1,
            })),
        );
        let (sin, cos) = 20_f64.to_radians().sin_cos();
        let hole = |index: u32| {
            let (u, v) = (12.0 * f64::from(index % 3), 9.0 * f64::from(index / 3));
            [MIDDLE[0] + u * cos - v * sin, MIDDLE[1] + u * sin + v * cos]
        };
        assert_holes(what, &points, &(0..6).map(hole).collect::<Vec<_>>(), 6.0);
    }
}

#[test]
fn threads() {
    // M10 and its bolt; left-hand and conventional ones turn the other way.
    for (what, side, hand, cut) in [
        ("inner right-hand thread", "inside", "right", "climb"),
        ("inner left-hand thread", "inside", "left", "climb"),
        ("outer right-hand thread", "outside", "right", "climb"),
        (
            "outer left-hand thread, conventional",
            "outside",
            "left",
            "conventional",
        ),
    ] {
        let points = driven(
            "thread_milling",
            &with(
                &json!({ "side": side, "hand": hand, "cut": cut, "diameter": 10, "pitch": 1.5, "depth": 5, "tool_diameter": 6 }),
            ),
        );
        let mut judge = Judge::new(what);
        let radius = match side {
            "inside" => 2.0,
            _ => 5.0 - 0.613_435 * 1.5 + 3.0,
        };
        let lowest = points.iter().fold(f64::INFINITY, |lowest, point| lowest.min(point[2]));
        judge.look(lowest + 5.0, "depth");
        // Cycles on the cylinder of the thread, without those in which the tool comes and goes.
        let on_it: Vec<[f64; 3]> = points
            .iter()
            .map(|[x, y, z]| [x - MIDDLE[0], y - MIDDLE[1], *z])
            .filter(|[x, y, z]| (x.hypot(*y) - radius).abs() < 0.05 && *z < 2.0)
            .collect();
        let (mut turned, mut before, mut from) = (0.0, None, None);
        let mut pieces = 0;
        for [x, y, z] in on_it {
            judge.look(
                match side {
                    "inside" => (x.hypot(y) - radius).max(0.0),
                    _ => (radius - x.hypot(y)).max(0.0),
                },
                "profile",
            );
            let angle = y.atan2(x);
            let step: f64 = before.map_or(0.0, |before| angle - before);
            turned += step - (step / TAU).round() * TAU;
            before = Some(angle);
            // On the whole turns.
            if (x.hypot(y) - radius).abs() > 0.001 {
                continue;
            }
            pieces += 1;
            let sign = if hand == "right" { 1.0 } else { -1.0 };
            let height = z - sign * 1.5 * turned / TAU;
            let from = *from.get_or_insert(height);
            judge.look(height - from, &format!("pitch at {x} {y} {z}"));
        }
        assert!(
            pieces > 500 && turned.abs() > 3.0 * TAU,
            "{what}: {pieces} cycles, {turned}"
        );
    }
}

#[test]
fn engraved_letters() {
    let points = driven(
        "engraving",
        &with(&json!({ "text": "O", "height": 16, "angle": 30, "depth": 0.3, "feed": 1000 })),
    );
    let mut judge = Judge::new("engraving");
    let lowest = points.iter().fold(f64::INFINITY, |lowest, point| lowest.min(point[2]));
    judge.look(lowest + 0.3, "depth");
    // The letter: all places 6 mm from a line of 4 mm, in the middle of its 12 by 16 mm.
    let (sin, cos) = 30_f64.to_radians().sin_cos();
    let off = |x: f64, y: f64| {
        let (x, y) = (x - MIDDLE[0], y - MIDDLE[1]);
        let (u, v) = (x * cos + y * sin - 6.0, y * cos - x * sin - 8.0);
        u.hypot((v.abs() - 2.0).max(0.0)) - 6.0
    };
    for &[x, y, z] in points.iter().filter(|point| point[2] < -TOLERANCE_MM) {
        judge.look(off(x, y), &format!("stroke at {x} {y} {z}"));
    }
    let ways = at_height(&points, -0.3);
    for index in 0..360 {
        let (sine, cosine) = f64::from(index).to_radians().sin_cos();
        let (u, v) = (6.0 + 6.0 * cosine, 8.0 + 6.0 * sine + 2.0 * sine.signum());
        let place = [MIDDLE[0] + u * cos - v * sin, MIDDLE[1] + u * sin + v * cos];
        judge.look(distance(&ways, place), &format!("not engraved at {place:?}"));
    }
}
