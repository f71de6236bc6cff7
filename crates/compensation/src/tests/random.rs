//! Random contours: the centre's path keeps the radius from all of the contour. Random events: no panic.

use super::*;
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

/// A contour around zero, its corners at growing angles; between them lines and arcs that bulge by a part of their chord.
/// No two moves that are not neighbours come closer to each other than the tool is wide: that is beyond one corner.
#[derive(Clone, Debug)]
pub(super) struct Random {
    /// Distance of each corner from zero, angle to the next, and bulge of the move to it: height over chord.
    corners: Vec<(f64, f64, f64)>,
    clockwise: bool,
    side: Side,
    radius_mm: f64,
    pub(super) plane: Plane,
}

pub(super) fn random() -> impl Strategy<Value = Random> {
    let bulge = prop_oneof![2 => Just(0.0), 1 => 0.03f64..0.12, 1 => -0.12f64..-0.03];
    (
        prop::collection::vec((40.0f64..60.0, 0.8f64..1.2, bulge), 4..9),
        any::<bool>(),
        prop_oneof![Just(Side::Left), Just(Side::Right)],
        0.05f64..1.5,
        prop_oneof![Just(Plane::Xy), Just(Plane::Zx)],
    )
        .prop_map(|(corners, clockwise, side, radius_mm, plane)| Random {
            corners,
            clockwise,
            side,
            radius_mm,
            plane,
        })
}

/// A move of the contour with its own idea of geometry: points by angle about the centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    from: Point,
    to: Point,
    /// Centre and angle swept, positive to the left.
    arc: Option<(Point, f64)>,
}

impl Piece {
    pub(super) fn at(&self, part: f64) -> Point {
        match self.arc {
            None => [0, 1].map(|i| self.from[i] + part * (self.to[i] - self.from[i])),
            Some((centre, sweep)) => {
                let arm = sub(self.from, centre);
                let (sin, cos) = (sweep * part).sin_cos();
                add(centre, [arm[0] * cos - arm[1] * sin, arm[0] * sin + arm[1] * cos])
            }
        }
    }

    /// Direction at the start or end.
    fn heading(&self, part: f64) -> f64 {
        let (a, b) = if part == 0.0 { (0.0, 1e-6) } else { (1.0 - 1e-6, 1.0) };
        let way = sub(self.at(b), self.at(a));
        way[1].atan2(way[0])
    }

    /// Least distance of a point from the piece, and the side on which it lies there, +1 left.
    pub(super) fn distance(&self, point: Point) -> (f64, f64) {
        let ends = length(sub(point, self.from)).min(length(sub(point, self.to)));
        match self.arc {
            None => {
                let way = sub(self.to, self.from);
                let along = geometry::dot(sub(point, self.from), way) / geometry::dot(way, way);
                let across = geometry::cross(way, sub(point, self.from)) / length(way);
                if (0.0..=1.0).contains(&along) {
                    (across.abs(), across.signum())
                } else {
                    (ends, 0.0)
                }
            }
            Some((centre, sweep)) => {
                let (arm, start) = (sub(point, centre), sub(self.from, centre));
                let turned = geometry::angle(start, arm).rem_euclid(TAU);
                let inside = if sweep > 0.0 {
                    turned <= sweep
                } else {
                    turned - TAU >= sweep
                };
                let across = (length(start) - length(arm)) * sweep.signum();
                if inside {
                    (across.abs(), across.signum())
                } else {
                    (ends, 0.0)
                }
            }
        }
    }
}

impl Random {
    pub(super) fn pieces(&self) -> Vec<Piece> {
        let total: f64 = self.corners.iter().map(|corner| corner.1).sum();
        let mut angle = 0.0;
        let mut points: Vec<Point> = Vec::new();
        for (distance, step, _) in &self.corners {
            points.push([distance * f64::cos(angle), distance * f64::sin(angle)]);
            angle += step / total * TAU;
        }
        if self.clockwise {
            points.reverse();
        }
        (1..points.len())
            .map(|i| {
                let (from, to) = (points[i - 1], points[i]);
                let (chord, bulge) = (sub(to, from), self.corners[i].2);
                // A chord with an arc of height h over it: half the swept angle is 2 atan(2 h / chord).
                let arc = (bulge != 0.0).then(|| {
                    let sweep = 4.0 * (2.0 * bulge).atan();
                    let middle = scale(add(from, to), 0.5);
                    (add(middle, scale(left(chord), 0.5 / (sweep / 2.0).tan())), sweep)
                });
                Piece { from, to, arc }
            })
            .collect()
    }

    fn position(&self, point: Point) -> Position {
        with_plane(Position::xyz(7.0, 7.0, 7.0), self.plane, point)
    }

    pub(super) fn programmed(&self, pieces: &[Piece]) -> Vec<Call> {
        // In along the extension of the first move's start, out straight ahead.
        let (first, last) = (pieces[0], pieces[pieces.len() - 1]);
        let ahead = |piece: &Piece, part: f64, by: f64| {
            add(
                piece.at(part),
                [by * piece.heading(part).cos(), by * piece.heading(part).sin()],
            )
        };
        let mut calls = vec![
            Call::SelectPlane(self.plane),
            Call::StraightTraverse {
                to: self.position(ahead(&first, 0.0, -20.0)),
            },
            Call::SetCutterCompensation(Some(Cutter {
                side: self.side,
                radius_mm: self.radius_mm,
                orientation: 0,
            })),
            Call::StraightFeed {
                to: self.position(first.from),
            },
        ];
        calls.extend(pieces.iter().map(|piece| match piece.arc {
            None => Call::StraightFeed {
                to: self.position(piece.to),
            },
            Some((centre_mm, sweep)) => Call::ArcFeed {
                to: self.position(piece.to),
                plane: self.plane,
                centre_mm,
                turns: sweep.signum() as i32,
            },
        }));
        calls.push(Call::SetCutterCompensation(None));
        calls.push(Call::StraightTraverse {
            to: self.position(ahead(&last, 1.0, 20.0)),
        });
        calls
    }
}

/// Moves of the output as pieces in the plane.
pub(super) fn moves(calls: &[Call], plane: Plane) -> Vec<Piece> {
    let mut at = [0.0; 2];
    let mut pieces = Vec::new();
    for call in calls {
        let Some(to) = end_of(call) else { continue };
        let to = in_plane(to, plane);
        let arc = match call {
            Call::ArcFeed { centre_mm, turns, .. } => {
                assert_eq!(turns.abs(), 1);
                let (start, end) = (length(sub(at, *centre_mm)), length(sub(to, *centre_mm)));
                assert!(
                    (start - end).abs() < 1e-9,
                    "the path has a step: radius {start} to {end}"
                );
                let angle = geometry::angle(sub(at, *centre_mm), sub(to, *centre_mm));
                let swept = (angle * f64::from(*turns)).rem_euclid(TAU);
                Some((*centre_mm, swept * f64::from(*turns)))
            }
            _ => None,
        };
        pieces.push(Piece { from: at, to, arc });
        at = to;
    }
    pieces
}

fn compensate(calls: &[Call]) -> Result<Vec<Call>, Box<CompensationError>> {
    let (mut compensator, mut out) = (Compensator::new(), Vec::new());
    for call in calls {
        let event = Event {
            source: Source::default(),
            call: call.clone(),
        };
        compensator.push(event, &mut out)?;
    }
    compensator.finish(&mut out)?;
    Ok(out.into_iter().map(|event| event.call).collect())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn the_centre_keeps_its_radius_from_the_whole_contour(random in random()) {
        let contour = random.pieces();
        // Corners that are passed as flat ones cost a little of the distance; they are left out here.
        let bends = (1..contour.len()).map(|i| (contour[i].heading(0.0) - contour[i - 1].heading(1.0) + PI).rem_euclid(TAU) - PI);
        prop_assume!(bends.clone().all(|bend| bend.abs() > 0.051 && bend.abs() < 2.6));
        let out = compensate(&random.programmed(&contour)).expect("fits");
        let path = moves(&out, random.plane);
        let side = if random.side == Side::Left { 1.0 } else { -1.0 };
        // Without the way there, the entry and the way out.
        prop_assert!(path.len() >= contour.len() + 3);
        let radius = random.radius_mm;
        for piece in &path[2..path.len() - 1] {
            for step in 0..=40 {
                let point = piece.at(f64::from(step) / 40.0);
                let near = contour.iter().map(|piece| piece.distance(point)).min_by(|a, b| a.0.total_cmp(&b.0)).expect("pieces");
                prop_assert!((near.0 - radius).abs() < 1e-6, "{} of {radius} at {point:?}", near.0);
                prop_assert!(near.1 != -side, "wrong side at {point:?}");
            }
        }
    }

    /// Left of the mirrored contour is where right of it was.
    #[test]
    fn a_mirrored_contour_has_a_mirrored_path(random in random()) {
        let contour = random.pieces();
        let mirror_point = |point: Point| [point[0], -point[1]];
        let mirrored: Vec<Piece> = contour
            .iter()
            .map(|piece| Piece {
                from: mirror_point(piece.from),
                to: mirror_point(piece.to),
                arc: piece.arc.map(|(centre, sweep)| (mirror_point(centre), -sweep)),
            })
            .collect();
        let other = Random { side: if random.side == Side::Left { Side::Right } else { Side::Left }, ..random.clone() };
        let (a, b) = (compensate(&random.programmed(&contour)), compensate(&other.programmed(&mirrored)));
        let (Ok(a), Ok(b)) = (a, b) else {
            return Err(TestCaseError::reject("does not fit"));
        };
        let (a, b) = (ends(&a, random.plane), ends(&b, random.plane));
        prop_assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(&b) {
            prop_assert!(length(sub(mirror_point(*a), *b)) < 1e-6, "{a:?} {b:?}");
        }
    }

    /// Whatever the orientation, the tip is where a round tool's centre would be.
    #[test]
    fn a_lathe_tool_goes_the_same_path_beside_itself(random in random(), orientation in 0u8..12) {
        let random = Random { plane: Plane::Zx, ..random };
        let mut calls = random.programmed(&random.pieces());
        let Ok(plain) = compensate(&calls) else {
            return Err(TestCaseError::reject("does not fit"));
        };
        let Call::SetCutterCompensation(Some(cutter)) = &mut calls[2] else { unreachable!() };
        cutter.orientation = orientation;
        let shifted = compensate(&calls).expect("fits");
        let shift = tip::shift(orientation, random.radius_mm, Plane::Zx);
        prop_assert_eq!(plain.len(), shifted.len());
        let (plain, shifted) = (ends(&plain, Plane::Zx), ends(&shifted, Plane::Zx));
        // The first and the last traverse are not compensated.
        for (a, b) in plain[1..plain.len() - 1].iter().zip(&shifted[1..]) {
            prop_assert!(length(sub(add(*a, shift), *b)) < 1e-9);
        }
    }

    #[test]
    fn random_events_never_panic(events in prop::collection::vec(garbage(), 0..40), orientation in any::<u8>()) {
        let (mut compensator, mut out) = (Compensator::new(), Vec::new());
        let (mut pushed, mut refused, mut gouges) = (0, 0, 0);
        for call in events {
            let call = match call {
                Call::SetCutterCompensation(Some(cutter)) => Call::SetCutterCompensation(Some(Cutter { orientation, ..cutter })),
                call => call,
            };
            let switch = matches!(call, Call::SetCutterCompensation(_));
            match compensator.push(Event { source: Source::default(), call }, &mut out) {
                Ok(()) => pushed += usize::from(!switch),
                Err(error) => {
                    refused += 1;
                    gouges += usize::from(matches!(error.kind, Kind::Gouge { .. }));
                    prop_assert!(error.to_string().len() > 20);
                }
            }
            // Nothing is lost: all that was taken is out or held, with at most one corner and one entry move for each. Moves
            // that showed a gouge were taken too, but for the exit.
            let there = out.len() + compensator.held();
            prop_assert!((pushed..=2 * (pushed + gouges)).contains(&there), "{pushed} {refused} {there}");
            prop_assert!(compensator.position().0.iter().all(|x| compensator.is_idle() || x.is_finite()));
        }
        let _ = compensator.finish(&mut out);
    }
}

fn ends(calls: &[Call], plane: Plane) -> Vec<Point> {
    calls.iter().filter_map(end_of).map(|to| in_plane(to, plane)).collect()
}

/// Calls with numbers of every kind.
fn garbage() -> impl Strategy<Value = Call> {
    let number = || {
        prop_oneof![
            6 => (-4i8..5).prop_map(f64::from),
            3 => -10.0f64..10.0,
            1 => any::<f64>(),
            1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(1e-300), Just(1e9), Just(-1e9), Just(1e-9)],
        ]
    };
    let to = || (number(), number(), number()).prop_map(|(x, y, z)| Position::xyz(x, y, z));
    let turns = prop_oneof![4 => Just(1), 4 => Just(-1), 1 => any::<i32>()];
    let plane = || prop_oneof![8 => Just(Plane::Xy), 1 => Just(Plane::Zx), 1 => Just(Plane::Yz)];
    let side = prop_oneof![Just(Side::Left), Just(Side::Right)];
    prop_oneof![
        6 => to().prop_map(|to| Call::StraightFeed { to }),
        3 => to().prop_map(|to| Call::StraightTraverse { to }),
        6 => (to(), plane(), number(), number(), turns)
            .prop_map(|(to, plane, i, j, turns)| Call::ArcFeed { to, plane, centre_mm: [i, j], turns }),
        3 => (side, number()).prop_map(|(side, radius_mm)| {
            Call::SetCutterCompensation(Some(Cutter { side, radius_mm, orientation: 0 }))
        }),
        1 => Just(Call::SetCutterCompensation(None)),
        1 => plane().prop_map(Call::SelectPlane),
        1 => Just(Call::Flood(true)),
        1 => Just(Call::Message("m".to_owned())),
        1 => number().prop_map(|degrees| Call::SetXyRotation { degrees }),
    ]
}
