//! Random and fixed paths through the whole stage.

use super::round::distance;
use super::*;
use crate::canon::{AXES, Position};
use crate::element::{Auxiliary, Enables};
use crate::path::{Circle, Shape};
use crate::plan::program::Corner;
use crate::plan::{AxisLimits, PlannerKind, Programmed, deviation};
use proptest::prelude::*;

fn settings(planner_kind: PlannerKind) -> Settings {
    let limits = AxisLimits {
        velocity: 100.0,
        acceleration: 1000.0,
        jerk: 20_000.0,
        travel: [-1e6, 1e6],
    };
    Settings {
        look_ahead_blocks: 100,
        planner_kind,
        ..Settings::new([Some(limits); AXES], 1e-3)
    }
}

fn moves(points: &[Position], tolerance: f64) -> Vec<Move> {
    let line = |(k, pair): (usize, &[Position])| {
        Some(Move {
            piece: Piece::line(pair[0], pair[1])?,
            feed: 100.0,
            line: k as u32 + 1,
            rapid: false,
            enables: Enables::default(),
            auxiliary: Auxiliary::INITIAL,
            modes: 0,
            corner: Corner::Round(tolerance),
            naive_cam_mm: 0.0,
        })
    };
    points.windows(2).enumerate().filter_map(line).collect()
}

fn smoothed(moves: &[Move], planner_kind: PlannerKind) -> Vec<Passed> {
    let (mut smoother, mut out, settings) = (Smoother::default(), Vec::new(), settings(planner_kind));
    for part in moves {
        smoother.push(Box::new(*part), &settings, &mut out);
    }
    smoother.flush(&settings, &mut out);
    out
}

/// What was found on a smoothed path on which everything holds that must.
struct Found {
    quintics: usize,
    /// Corners that are left as they are.
    direction_jumps: usize,
    /// Greatest third derivative on quintics, 1/mm².
    third: f64,
    /// Greatest curvature on quintics, 1/mm.
    curvature: f64,
}

/// Asserts what must hold for any path: both ends exact, no gap, continuous direction and curvature at both ends of
/// every quintic, tolerance kept both ways.
fn proven(moves: &[Move], tolerance: f64, planner_kind: PlannerKind) -> Found {
    let out = smoothed(moves, planner_kind);
    let mut found = Found {
        quintics: 0,
        direction_jumps: 0,
        third: 0.0,
        curvature: 0.0,
    };
    let mut samples = Vec::new();
    let mut last: Option<(crate::path::Jet, bool, f64)> = None;
    for passed in &out {
        let stretch = match passed {
            Passed::Stretch(stretch) => stretch,
            Passed::Seam(_) => unreachable!("all at feed"),
            Passed::Stop => {
                found.direction_jumps += 1;
                continue;
            }
        };
        let piece = &stretch.piece;
        let quintic = matches!(piece.shape(), Shape::Blend(_));
        let (first, end) = (piece.jet(0.0), piece.jet(piece.length()));
        if let Some((before, quintic_before, length_before)) = &last {
            assert!(distance(&before.q, &first.q) < 1e-9, "gap in line {}", stretch.line);
            let (kink, bend) = (distance(&before.d1, &first.d1), distance(&before.d2, &first.d2));
            if quintic || *quintic_before {
                assert!(kink < 1e-9, "direction jumps by {kink} in line {}", stretch.line);
                let curvature = distance(&first.d2, &[0.0; AXES]);
                // Positions are rounded to about 1e-15 mm, which bends a short piece.
                let short = piece.length().min(*length_before);
                assert!(
                    bend < 1e-7 * (1.0 + curvature) + 1e-14 / (short * short),
                    "curvature {curvature} jumps by {bend} in line {}",
                    stretch.line
                );
            } else if kink > 1e-9 {
                found.direction_jumps += 1;
            }
        }
        last = Some((end, quintic, piece.length()));
        found.quintics += usize::from(quintic);
        let steps = (piece.length() / 0.005).ceil().clamp(16.0, 4000.0) as usize;
        for k in 0..steps {
            let jet = piece.jet(piece.length() * k as f64 / steps as f64);
            if quintic {
                found.curvature = found.curvature.max(distance(&jet.d2, &[0.0; AXES]));
                found.third = found.third.max(distance(&jet.d3, &[0.0; AXES]));
            }
            samples.push(Position(jet.q));
        }
    }
    let (first, end) = (&moves[0].piece, &moves[moves.len() - 1].piece);
    samples.extend(last.map(|(jet, ..)| Position(jet.q)));
    assert_eq!(samples[0], first.position(0.0));
    assert!(distance(&samples[samples.len() - 1].0, &end.position(end.length()).0) < 1e-12);
    let ideal: Vec<_> = moves
        .iter()
        .map(|part| Programmed {
            piece: part.piece,
            feed: part.feed,
            line: part.line,
            rapid: false,
        })
        .collect();
    let off = deviation(&samples, &ideal, tolerance);
    assert!(off.off_mm <= tolerance && off.missed_mm <= tolerance * 1.001, "{off:?}");
    found
}

fn rounded(q: Position) -> Position {
    Position(q.0.map(|x| (x * 1e4).round() / 1e4))
}

/// A part of a random path, relative to where it begins.
#[derive(Clone, Debug)]
enum Part {
    // Radii are large against the tolerance and circles are not closed, so that the walk that compares paths does not
    // take one side for the other.
    /// Chords of a circle: radius, chord, number, turn of the first chord.
    Bow {
        radius: f64,
        chord: f64,
        count: usize,
        turn: f64,
    },
    /// One straight move.
    Straight { length: f64, turn: f64 },
    /// Nearly back along the last move.
    Back { length: f64 },
    /// Steps of a few resolutions of the programmed numbers.
    Tiny { count: usize },
}

fn part() -> impl Strategy<Value = Part> {
    let turn = prop_oneof![3 => Just(0.0), 1 => -2.6f64..2.6];
    prop_oneof![
        4 => (prop_oneof![0.3f64..1.0, 1.0f64..50.0], 0.01f64..0.4, 2usize..60, turn.clone(), any::<bool>()).prop_map(
            |(radius, chord, count, turn, left)| Part::Bow {
                radius: if left { radius } else { -radius }, chord: chord.min(radius * 0.5), count: count.min((4.0 * radius / chord) as usize + 1), turn
            }
        ),
        2 => (prop_oneof![0.2f64..0.5, 1.0f64..10.0], turn).prop_map(|(length, turn)| Part::Straight { length, turn }),
        1 => (0.2f64..2.0).prop_map(|length| Part::Back { length }),
        1 => (1usize..20).prop_map(|count| Part::Tiny { count }),
    ]
}

fn points(parts: &[Part], others: bool) -> Vec<Position> {
    let (mut at, mut heading, mut way) = (Position::ZERO, 0.3f64, 0.0f64);
    let mut points = vec![at];
    let mut go = |length: f64, heading: f64| {
        at.0[0] += length * heading.cos();
        at.0[1] += length * heading.sin();
        way += length;
        if others {
            at.0[2] = 0.5 * (0.3 * way).sin();
            at.0[3] = 5.0 * (0.1 * way).sin();
            at.0[4] = way;
            at.0[5] = -0.2 * way;
            (at.0[6], at.0[7], at.0[8]) = (0.1 * way, (0.05 * way).cos(), 0.3 * (0.2 * way).sin());
        }
        points.push(rounded(at));
    };
    for part in parts {
        match *part {
            Part::Bow {
                radius,
                chord,
                count,
                turn,
            } => {
                heading += turn;
                for _ in 0..count {
                    heading += 0.5 * chord / radius;
                    go(chord, heading);
                    heading += 0.5 * chord / radius;
                }
            }
            Part::Straight { length, turn } => {
                heading += turn;
                go(length, heading);
            }
            Part::Back { length } => {
                heading += 2.6;
                go(length, heading);
            }
            Part::Tiny { count } => {
                for k in 0..count {
                    go(3e-4, heading + (k % 3) as f64);
                }
            }
        }
    }
    points
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn any_path_is_joined_within_its_tolerance(
        parts in prop::collection::vec(part(), 1..12), others in any::<bool>(),
        tolerance in prop_oneof![Just(0.001), Just(0.01)],
    ) {
        let mut moves = moves(&points(&parts, others), tolerance);
        for part in &mut moves {
            part.naive_cam_mm = if others { tolerance } else { 0.0 };
        }
        if !moves.is_empty() {
            proven(&moves, tolerance, PlannerKind::Classic);
        }
    }

    #[test]
    fn equal_paths_give_equal_bits(parts in prop::collection::vec(part(), 1..8)) {
        let moves = moves(&points(&parts, true), 0.01);
        let bits = || -> Vec<u64> {
            let bits = |passed: &Passed| match passed {
                Passed::Stretch(stretch) => {
                    let jet = stretch.piece.jet(0.3 * stretch.piece.length());
                    jet.q.iter().chain(&jet.d3).map(|x| x.to_bits()).collect()
                }
                Passed::Seam(_) => unreachable!("all at feed"),
                Passed::Stop => vec![0],
            };
            smoothed(&moves, PlannerKind::Classic).iter().flat_map(bits).collect()
        };
        prop_assert_eq!(bits(), bits());
    }
}

#[test]
fn a_circle_of_chords_becomes_few_quintics_of_even_curvature() {
    let points: Vec<_> = (0..=1256)
        .map(|k| (f64::from(k) * 0.005).sin_cos())
        .map(|(sin, cos)| rounded(Position::xyz(20.0 * cos, 20.0 * sin, 0.0)))
        .collect();
    let found = proven(&moves(&points, 0.01), 0.01, PlannerKind::Classic);
    assert_eq!(found.direction_jumps, 0);
    assert!(found.quintics < 1256 / 20, "{}", found.quintics);
    // Between two points, 0.0001 of rounding make a curvature of 0.01; here it is 1/20 and a third more where it begins and ends.
    assert!(found.curvature < 0.075, "{}", found.curvature);
}

#[test]
fn a_corner_in_the_middle_of_short_moves_is_kept_within_the_tolerance() {
    let leg = |k: i32| f64::from(k) * 0.1;
    let points: Vec<_> = (0..40)
        .map(|k| Position::xyz(leg(k), 0.0, 0.0))
        .chain((0..=40).map(|k| Position::xyz(leg(40), leg(k), 0.0)))
        .collect();
    proven(&moves(&points, 0.01), 0.01, PlannerKind::Classic);
    proven(&moves(&points, 0.2), 0.2, PlannerKind::Classic);
}

#[test]
fn long_moves_between_short_ones_stay_straight_in_their_middle() {
    // A slot: half circles of short chords, and straight sides.
    let bow = |x: f64, from: f64| {
        (0..=50)
            .map(move |k| (from + f64::from(k) / 50.0 * std::f64::consts::PI).sin_cos())
            .map(move |(sin, cos)| Position::xyz(x + 3.0 * sin, -3.0 * cos, 0.0))
    };
    let points: Vec<_> = bow(30.0, 0.0)
        .chain(bow(0.0, std::f64::consts::PI))
        .chain([Position::xyz(30.0, -3.0, 0.0)])
        .collect();
    let moves = moves(&points, 0.01);
    let found = proven(&moves, 0.01, PlannerKind::Classic);
    assert_eq!(found.direction_jumps, 0);
    let straight = |passed: &&Passed| matches!(passed, Passed::Stretch(s) if matches!(s.piece.shape(), Shape::Line(_)) && s.piece.length() > 20.0);
    assert_eq!(
        smoothed(&moves, PlannerKind::Classic).iter().filter(straight).count(),
        2
    );
    assert!(found.curvature < 0.5, "{}", found.curvature);
}

#[test]
fn feed_and_line_are_those_of_the_moves_covered() {
    let points: Vec<_> = (0..=400).map(|k| Position::xyz(f64::from(k) * 0.1, 0.0, 0.0)).collect();
    let mut moves = moves(&points, 0.01);
    for part in &mut moves[200..] {
        part.feed = 50.0;
    }
    let mut x = 0.0;
    for passed in smoothed(&moves, PlannerKind::Classic) {
        let Passed::Stretch(stretch) = passed else {
            panic!("no stop on a straight path")
        };
        let end = x + stretch.piece.length();
        assert_eq!(
            stretch.feed,
            if end > 20.0 + 1e-6 { 50.0 } else { 100.0 },
            "{x} to {end}"
        );
        assert!(
            (f64::from(stretch.line) - (end / 0.1).ceil()).abs() <= 1.0,
            "{} at {end}",
            stretch.line
        );
        x = end;
    }
    assert!((x - 40.0).abs() < 1e-9);
}

#[test]
fn nearly_tangent_arcs_are_joined() {
    // Centres lie 0.001 above the ends: 0.001 / radius less than half a turn at each end, or more.
    let half = |start: f64, end: f64, side: f64| Move {
        piece: Piece::arc(&Circle {
            start: Position::xyz(start, 0.0, 0.0),
            end: Position::xyz(end, 0.0, 0.0),
            centre_mm: [0.5 * (start + end), 0.001, 0.0],
            normal: [0.0, 0.0, 1.0],
            sweep_rad: side * (std::f64::consts::PI - side * 2.0 * 0.001f64.atan2(0.5 * (end - start))),
        })
        .unwrap(),
        feed: 100.0,
        line: 1,
        rapid: false,
        enables: Enables::default(),
        auxiliary: Auxiliary::INITIAL,
        modes: 0,
        corner: Corner::Round(0.01),
        naive_cam_mm: 0.0,
    };
    let found = proven(
        &[half(0.0, 4.0, 1.0), half(4.0, 10.0, -1.0), half(10.0, 12.0, 1.0)],
        0.01,
        PlannerKind::Classic,
    );
    assert_eq!((found.quintics, found.direction_jumps), (2, 0));
}

#[test]
fn a_path_that_turns_back_stops_or_stays_within_the_tolerance() {
    let points: Vec<_> = (0..=20)
        .chain((0..20).rev())
        .map(|k| Position::xyz(f64::from(k) * 0.1, 0.0, 0.0))
        .collect();
    let out = smoothed(&moves(&points, 0.01), PlannerKind::Classic);
    let furthest = out
        .iter()
        .filter_map(|passed| match passed {
            Passed::Stretch(stretch) => Some(stretch.piece.position(stretch.piece.length()).0[0]),
            Passed::Seam(_) => unreachable!("all at feed"),
            Passed::Stop => None,
        })
        .fold(0.0, f64::max);
    assert!((furthest - 2.0).abs() <= 0.01, "{furthest}");
}

/// A line or an arc that goes on from a place: turn before it, length, curvature.
type Bend = (f64, f64, f64);

/// Lines and arcs in the plane that is spanned by two unit vectors.
fn bends(bends: &[Bend], axes: [[f64; 3]; 2], tolerance: f64) -> Vec<Move> {
    let (mut at, mut heading) = ([0.0f64; 2], 0.4f64);
    let space = |p: [f64; 2]| [0, 1, 2].map(|i| p[0] * axes[0][i] + p[1] * axes[1][i]);
    let point = |p: [f64; 2]| {
        let [x, y, z] = space(p);
        Position::xyz(x, y, z)
    };
    let [a, b] = axes;
    let normal = [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
    let mut moves = Vec::new();
    for (k, &(turn, length, curvature)) in bends.iter().enumerate() {
        heading += turn;
        let (sin, cos) = heading.sin_cos();
        let piece = if curvature == 0.0 {
            let end = [at[0] + length * cos, at[1] + length * sin];
            let piece = Piece::line(point(at), point(end));
            at = end;
            piece
        } else {
            let centre = [at[0] - sin / curvature, at[1] + cos / curvature];
            heading += curvature * length;
            let (sin, cos) = heading.sin_cos();
            let end = [centre[0] + sin / curvature, centre[1] - cos / curvature];
            let piece = Piece::arc(&Circle {
                start: point(at),
                end: point(end),
                centre_mm: space(centre),
                normal,
                sweep_rad: curvature * length,
            });
            at = end;
            piece
        };
        moves.extend(piece.map(|piece| Move {
            piece,
            feed: 100.0,
            line: k as u32 + 1,
            rapid: false,
            enables: Enables::default(),
            auxiliary: Auxiliary::INITIAL,
            modes: 0,
            corner: Corner::Round(tolerance),
            naive_cam_mm: 0.0,
        }));
    }
    moves
}

const XY: [[f64; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
const ZX: [[f64; 3]; 2] = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
const TILTED: [[f64; 3]; 2] = [[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]];

fn bend() -> impl Strategy<Value = Bend> {
    let turn = prop_oneof![4 => Just(0.0), 1 => -0.1f64..0.1, 2 => -1.2f64..1.2];
    let length = prop_oneof![1 => 1e-4f64..0.05, 2 => 0.05f64..1.0, 6 => 1.0f64..12.0];
    // Arcs of at most 2.5 rad, so that no circle is closed.
    let curvature = prop_oneof![1 => Just(0.0), 1 => -1.0f64..1.0];
    (turn, length, curvature).prop_map(|(turn, length, x)| (turn, length, x * 2.5 / length.max(0.8)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_lines_and_arcs_are_joined_within_their_tolerance(
        parts in prop::collection::vec(bend(), 2..24), axes in prop_oneof![Just(XY), Just(ZX), Just(TILTED)],
        tolerance in prop_oneof![Just(0.001), Just(0.01), Just(0.1)],
    ) {
        proven(&bends(&parts, axes, tolerance), tolerance, PlannerKind::Optimal);
    }
}

/// A line, half a slot and so on: arcs of a quarter turn between lines, all of them tangential.
fn slots(count: usize) -> Vec<Bend> {
    (0..count)
        .flat_map(|k| {
            let side = if k % 3 == 0 { -1.0 } else { 1.0 };
            [(0.0, 7.0, 0.0), (0.0, 5.0, side * 0.2)]
        })
        .collect()
}

#[test]
fn tangent_arcs_are_entered_with_a_fraction_of_the_jerk() {
    for axes in [XY, ZX, TILTED] {
        let moves = bends(&slots(12), axes, 0.01);
        let [apart, swaying] =
            [PlannerKind::Classic, PlannerKind::Optimal].map(|planner_kind| proven(&moves, 0.01, planner_kind));
        assert_eq!((apart.direction_jumps, swaying.direction_jumps), (0, 0));
        assert!(swaying.third < 0.65 * apart.third, "{} {}", swaying.third, apart.third);
    }
}

#[test]
fn moves_out_of_the_plane_are_left_as_they_are() {
    let mut moves = bends(&slots(2), XY, 0.01);
    for part in &mut moves {
        if let Shape::Arc(arc) = *part.piece.shape() {
            let (start, mut end) = (part.piece.position(0.0), part.piece.position(f64::INFINITY));
            end.0[2] = 1.0;
            part.piece = Piece::arc(&Circle {
                start,
                end,
                centre_mm: arc.centre_mm(),
                normal: arc.turns_about(),
                sweep_rad: arc.sweep_rad(),
            })
            .unwrap();
        }
    }
    let [classic, optimal] = [PlannerKind::Classic, PlannerKind::Optimal].map(|planner_kind| {
        smoothed(&moves[..2], planner_kind)
            .iter()
            .filter(
                |passed| matches!(passed, Passed::Stretch(stretch) if matches!(stretch.piece.shape(), Shape::Blend(_))),
            )
            .count()
    });
    assert_eq!(classic, optimal);
}

/// Two legs that meet at the origin, the second turned by so much within the plane of two unit vectors.
fn two_legs(degrees: f64, [u, w]: [[f64; 3]; 2], lengths: [f64; 2], tolerance: f64) -> Vec<Move> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let place = |length: f64, along: f64, across: f64| {
        let [x, y, z] = [0, 1, 2].map(|i| length * (along * u[i] + across * w[i]));
        Position::xyz(x, y, z)
    };
    let points = [
        place(-lengths[0], 1.0, 0.0),
        Position::ZERO,
        place(lengths[1], cos, sin),
    ];
    moves(&points, tolerance)
}

/// Two unit vectors at a right angle, of any orientation.
fn plane() -> impl Strategy<Value = [[f64; 3]; 2]> {
    let angle = || -std::f64::consts::PI..std::f64::consts::PI;
    prop_oneof![1 => Just(XY), 4 => (angle(), angle(), angle()).prop_map(|(a, b, c)| {
        let ((sa, ca), (sb, cb), (sc, cc)) = (a.sin_cos(), b.sin_cos(), c.sin_cos());
        [[ca * cb, sa * cb, -sb], [ca * sb * sc - sa * cc, sa * sb * sc + ca * cc, cb * sc]]
    })]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn a_corner_of_any_angle_is_within_its_tolerance_everywhere(
        degrees in 3.0f64..177.0, axes in plane(), lengths in prop::array::uniform2(prop_oneof![0.02f64..1.0, 1.0f64..50.0]),
        tolerance in prop_oneof![Just(0.001), Just(0.01), Just(0.05), Just(0.5)],
    ) {
        /// Samples of each blend.
        const STEPS: u32 = 5000;
        let moves = two_legs(degrees, axes, lengths, tolerance);
        let mut missed = f64::INFINITY;
        let mut last: Option<Piece> = None;
        for passed in smoothed(&moves, PlannerKind::Optimal) {
            let Passed::Stretch(stretch) = passed else {
                (missed, last) = (0.0, None);
                continue;
            };
            let piece = stretch.piece;
            let first = piece.jet(0.0);
            // Two lines meet in a stop.
            let joined = last.replace(piece).filter(|before| [before, &piece].iter().any(|piece| matches!(piece.shape(), Shape::Blend(_))));
            if let Some(before) = joined.map(|piece| piece.jet(piece.length())) {
                prop_assert!(distance(&before.q, &first.q) < 1e-9);
                prop_assert!(distance(&before.d1, &first.d1) < 1e-9);
                let curvature = distance(&first.d2, &[0.0; AXES]);
                prop_assert!(distance(&before.d2, &first.d2) < 1e-7 * (1.0 + curvature) + 1e-14 / (piece.length() * piece.length()));
            }
            for k in 0..=STEPS {
                let q = piece.position(piece.length() * f64::from(k) / f64::from(STEPS));
                let off = moves.iter().map(|leg| round::nearest(&leg.piece, &q.0, 0.0, leg.piece.length(), 0.0).0);
                prop_assert!(off.fold(f64::INFINITY, f64::min) <= tolerance);
                missed = missed.min(distance(&q.0, &[0.0; AXES]));
            }
        }
        prop_assert!(missed <= tolerance, "the corner is missed by {missed}");
    }

    #[test]
    fn a_corner_of_an_arc_is_within_its_tolerance(
        turns in prop::array::uniform3(-3.0f64..3.0), lengths in prop::array::uniform3(0.2f64..12.0),
        curvature in -1.0f64..1.0, axes in prop_oneof![Just(XY), Just(ZX), Just(TILTED)],
        tolerance in prop_oneof![Just(0.001), Just(0.01), Just(0.1)],
    ) {
        let [a, b, c] = lengths;
        let parts = [(0.0, a, 0.0), (turns[0], b, curvature * 2.5 / b.max(0.8)), (turns[1], c, 0.0)];
        proven(&bends(&parts, axes, tolerance), tolerance, PlannerKind::Optimal);
    }
}

#[test]
fn a_right_angle_is_left_and_met_with_a_swing() {
    let moves = two_legs(90.0, XY, [10.0, 10.0], 0.01);
    let (mut lowest, mut farthest) = (0.0f64, 0.0f64);
    for passed in smoothed(&moves, PlannerKind::Optimal) {
        let Passed::Stretch(stretch) = passed else {
            panic!("no stop")
        };
        for k in 0..=1000 {
            let q = stretch.piece.position(stretch.piece.length() * f64::from(k) / 1000.0).0;
            (lowest, farthest) = (lowest.min(q[1]), farthest.max(q[0]));
        }
    }
    // Out, before it turns in; and on the other side of the second leg behind the corner.
    assert!(lowest < -0.008 && farthest > 0.008, "{lowest} {farthest}");
}
