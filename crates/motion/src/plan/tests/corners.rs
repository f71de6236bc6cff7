//! What corners cost.

use super::*;
use crate::element::{Element, Span};
use crate::plan::offline::{Recorder, plan_offline};
use proptest::prelude::*;

fn machine() -> Settings {
    let limits = AxisLimits {
        velocity: 100.0,
        acceleration: 1000.0,
        jerk: 20_000.0,
        travel: [-500.0, 500.0],
    };
    Settings::new([Some(limits); AXES], 1e-3)
}

/// A path through these points, with corners within the tolerance; 0: from rest to rest.
fn through(points: &[Position], feed_mm_s: f64, tolerance: f64, settings: Settings) -> Offline {
    let mode = if tolerance > 0.0 {
        PathMode::Continuous {
            tolerance_mm: Some(tolerance),
            naive_cam_tolerance_mm: None,
        }
    } else {
        PathMode::ExactStop
    };
    let head = [
        Call::SetFeedRate {
            linear: feed_mm_s,
            angular: feed_mm_s,
        },
        Call::SetPathMode(mode),
    ];
    let moves = points.iter().map(|to| Call::StraightFeed { to: *to });
    plan_offline(&events(head.into_iter().chain(moves)), settings).unwrap()
}

fn corner(degrees: f64, tolerance: f64) -> f64 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let points = [
        Position::xyz(10.0, 0.0, 0.0),
        Position::xyz(10.0 + 10.0 * cos, 10.0 * sin, 0.0),
    ];
    let plan = through(&points, 100.0, tolerance, machine());
    assert_eq!(check(&plan.samples, 1e-3, &machine().axes).over(), 0);
    plan.motion_time_s
}

#[test]
fn corners_take_little_longer_than_the_reference() {
    // By angle and tolerance: the reference of benches/corners.rs, path and speed chosen together.
    for (degrees, tolerance, reference_s) in [
        (20.0, 0.01, 0.455),
        (45.0, 0.01, 0.465),
        (45.0, 0.05, 0.426),
        (60.0, 0.01, 0.471),
        (60.0, 0.05, 0.440),
        (90.0, 0.01, 0.471),
        (90.0, 0.05, 0.447),
        (90.0, 0.5, 0.438),
        (120.0, 0.01, 0.457),
        (120.0, 0.05, 0.444),
        (120.0, 0.5, 0.414),
    ] {
        let ratio = corner(degrees, tolerance) / reference_s;
        assert!(ratio < 1.05, "{degrees} degrees within {tolerance} mm: {ratio}");
    }
}

/// Spans of a plan.
fn spans(events: &[Event], settings: Settings) -> Vec<Span> {
    let mut planner = Planner::new(settings, Recorder::default());
    for event in events {
        planner.push(event).unwrap();
        planner.pump();
    }
    planner.finish();
    planner.pump();
    let elements = planner.sink().elements.iter();
    elements
        .filter_map(|element| match element {
            Element::Span(span) => Some(*span),
            _ => None,
        })
        .collect()
}

const FEED_MM_S: f64 = 20.0;

/// Straight on into the material, along it, out of it and away.
fn plunge(mode: PathMode) -> Vec<Event> {
    let rapid = |x: f64, y: f64, z: f64| Call::StraightTraverse {
        to: Position::xyz(x, y, z),
    };
    let head = [
        Call::SetFeedRate {
            linear: FEED_MM_S,
            angular: FEED_MM_S,
        },
        Call::SetPathMode(mode),
    ];
    let moves = [
        rapid(0.0, 0.0, -10.0),
        feed(0.0, 0.0, -14.0),
        feed(6.0, 0.0, -14.0),
        rapid(6.0, 0.0, 0.0),
        rapid(6.0, 30.0, 0.0),
        feed(9.0, 30.0, 0.0),
    ];
    events(head.into_iter().chain(moves))
}

const WITHIN: PathMode = PathMode::Continuous {
    tolerance_mm: Some(0.05),
    naive_cam_tolerance_mm: None,
};

#[test]
fn rapid_and_feed_moves_follow_each_other_without_a_stop() {
    let [stopped, rounded] = [PathMode::ExactStop, WITHIN].map(|mode| proven(&plunge(mode), machine(), 0.05));
    assert!(rounded.motion_time_s < 0.9 * stopped.motion_time_s);
    // Nothing but what lies on rapid moves is faster than the feed.
    for span in spans(&plunge(WITHIN), machine()) {
        let fastest = span.speed(0.0).max(span.speed(span.duration_s));
        assert!(span.rapid || fastest <= FEED_MM_S, "{fastest} on line {}", span.line);
        let on_its_line = span.line == 3 || span.line == 6 || span.line == 7;
        assert_eq!(span.rapid, on_its_line, "line {}", span.line);
    }
    // But for start and end.
    let rests = |plan: &Offline| {
        let between = &plan.samples[10..plan.samples.len() - 10];
        let pairs = between.windows(2);
        pairs.filter(|pair| distance(&pair[0].0, &pair[1].0) < 2e-4).count()
    };
    assert!(rests(&stopped) > 0);
    assert_eq!(rests(&rounded), 0);
}

#[test]
fn where_rapid_and_feed_moves_meet_both_overrides_hold() {
    for shares in [[0.5, 1.0], [1.0, 0.1], [1.2, 0.3], [0.1, 0.05], [1.0, 0.02]] {
        let mut planner = Planner::new(machine(), Recorder::default());
        planner.set_override(shares[0], shares[1]);
        planner.pump();
        for event in plunge(WITHIN) {
            planner.push(&event).unwrap();
        }
        planner.finish();
        while planner.pump() != Pumped::Done {}
        let spans: Vec<Span> = planner
            .sink()
            .elements
            .iter()
            .filter_map(|element| match element {
                Element::Span(span) => Some(*span),
                _ => None,
            })
            .collect();
        let mut corners = 0;
        for span in &spans {
            let fastest = span.speed(0.0).max(span.speed(span.duration_s));
            let (feed, rapid) = (FEED_MM_S * shares[0], 100.0 * shares[1]);
            let corner = matches!(span.piece.shape(), crate::path::Shape::Blend(_));
            corners += usize::from(corner);
            // A blend may point along two axes, each of which may run at its limit.
            let rapid = if corner { rapid * 2f64.sqrt() } else { rapid };
            assert!(span.rapid || fastest <= feed, "{fastest} at feed on line {}", span.line);
            assert!(!span.rapid || fastest <= rapid, "{fastest} rapid on line {}", span.line);
        }
        assert!(corners > 0);
    }
}

#[test]
fn corners_between_rapid_moves_have_a_tolerance_of_their_own() {
    let rapid = |x: f64, y: f64| Call::StraightTraverse {
        to: Position::xyz(x, y, 0.0),
    };
    let at_feed = |x: f64, y: f64| Call::StraightFeed {
        to: Position::xyz(x, y, 0.0),
    };
    let program = |mode| {
        let head = [
            Call::SetFeedRate {
                linear: 50.0,
                angular: 50.0,
            },
            Call::SetPathMode(mode),
        ];
        // A corner between rapid moves, one into the feed, one at feed, one out of it.
        let moves = [
            rapid(20.0, 0.0),
            rapid(20.0, 20.0),
            at_feed(40.0, 20.0),
            at_feed(40.0, 40.0),
            rapid(60.0, 40.0),
        ];
        events(head.into_iter().chain(moves))
    };
    let corners = [[20.0, 0.0], [20.0, 20.0], [40.0, 20.0], [40.0, 40.0]];
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        let missed = |rapid_tolerance_mm, mode| {
            let settings = Settings {
                rapid_tolerance_mm,
                planner_kind,
                ..machine()
            };
            let plan = plan_offline(&program(mode), settings).unwrap();
            assert_eq!(check(&plan.samples, 1e-3, &settings.axes).over(), 0);
            // Of each corner: how far the set-points next to it are from it, and how far the farthest is from the path.
            let missed = corners.map(|[x, y]| {
                let off = plan.samples.iter().map(|at| (at.0[0] - x).hypot(at.0[1] - y));
                off.fold(f64::INFINITY, f64::min)
            });
            let off = corners.map(|[x, y]| {
                let near = plan.samples.iter().filter(|at| (at.0[0] - x).hypot(at.0[1] - y) < 9.0);
                let legs = plan.ideal.iter().map(|part| part.piece).collect::<Vec<_>>();
                near.map(|at| {
                    let off = legs
                        .iter()
                        .map(|leg| super::super::smooth::round::nearest(leg, &at.0, 0.0, leg.length(), 0.0).0);
                    off.fold(f64::INFINITY, f64::min)
                })
                .fold(0.0, f64::max)
            });
            (missed, off, plan.motion_time_s)
        };
        let (_, alike, time_s) = missed(None, WITHIN);
        let (of_rapid, off, shorter_s) = missed(Some(2.0), WITHIN);
        assert!(alike.iter().all(|off| *off <= 0.05), "{planner_kind:?} {alike:?}");
        assert!(off[0] > 0.5 && off[0] <= 2.0, "{planner_kind:?} {off:?}");
        assert!(off[1..].iter().all(|off| *off <= 0.05), "{planner_kind:?} {off:?}");
        assert!(of_rapid[0] <= 2.0 && of_rapid[1..].iter().all(|missed| *missed <= 0.05 + 0.05));
        assert!(shorter_s < time_s - 0.01, "{planner_kind:?}: {shorter_s} {time_s}");
        // Less than P counts as well, and nothing is rounded where the path is exact.
        let (_, tight, _) = missed(Some(0.001), WITHIN);
        assert!(tight[0] <= 0.001, "{planner_kind:?} {tight:?}");
        let (_, exact, _) = missed(Some(2.0), PathMode::ExactPath);
        assert!(exact.iter().all(|off| *off < 1e-9), "{planner_kind:?} {exact:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn whatever_q_is_the_path_stays_within_p(
        steps in prop::collection::vec((0.05f64..6.0, -1.0f64..1.0), 3..40), wave in prop_oneof![Just(0.001), Just(0.01), Just(0.1)],
        p in prop_oneof![Just(0.01), Just(0.05)], q in prop_oneof![Just(0.0), Just(0.2), Just(0.9), Just(1.0), Just(5.0)],
        classic in any::<bool>(),
    ) {
        let mut x = 0.0;
        let moves: Vec<_> = steps.iter().map(|(along, across)| {
            x += along;
            Call::StraightFeed { to: Position::xyz(x, across * wave, 0.0) }
        }).collect();
        let head = [
            Call::SetFeedRate { linear: 60.0, angular: 60.0 },
            Call::SetPathMode(PathMode::Continuous { tolerance_mm: Some(p), naive_cam_tolerance_mm: Some(q * p) }),
        ];
        let planner_kind = if classic { PlannerKind::Classic } else { PlannerKind::Optimal };
        proven(&events(head.into_iter().chain(moves)), Settings { planner_kind, ..machine() }, p);
    }
}

/// Asserts that a path with rounded corners takes no longer than from rest to rest, and stays within limits and tolerance.
fn no_longer_than_stops(points: &[Position], feed_mm_s: f64, jerk: f64, tolerance: f64) {
    let mut settings = machine();
    for axis in settings.axes.iter_mut().flatten() {
        axis.jerk = jerk;
    }
    let [rounded, stopped] = [tolerance, 0.0].map(|tolerance| through(points, feed_mm_s, tolerance, settings));
    // Speeds are planned to within 0.2 % of the time.
    assert!(
        rounded.motion_time_s <= 1.002 * stopped.motion_time_s + 1e-3,
        "{} {}",
        rounded.motion_time_s,
        stopped.motion_time_s
    );
    assert_eq!(check(&rounded.samples, 1e-3, &settings.axes).over(), 0);
    let off = deviation(&rounded.samples, &rounded.ideal, tolerance);
    assert!(off.off_mm <= tolerance, "{off:?}");
}

#[test]
fn a_corner_at_a_very_short_leg_takes_no_longer_than_a_stop() {
    let line = |points: &[[f64; 3]]| {
        points
            .iter()
            .map(|[x, y, z]| Position::xyz(*x, *y, *z))
            .collect::<Vec<_>>()
    };
    // A leg of 0.08, 0.05, 0.29 and 0.18 mm.
    let short_first = line(&[[0.0346, -0.0733, 0.0], [14.5528, -1.5858, 0.0]]);
    let short_second = line(&[
        [0.86458, 0.32785, 9.48368],
        [0.86874, 0.36032, 9.51577],
        [2.20687, -4.43831, 8.55905],
    ]);
    let short_before_long = line(&[
        [-9.23137, -4.2511, 2.62559],
        [-9.26171, -4.50404, 2.49461],
        [-14.08116, -3.8512, -4.92838],
    ]);
    let short_behind_long = line(&[
        [-1.50385, -6.60156, -2.48659],
        [-1.40072, -6.75099, -2.49005],
        [-1.00028, -6.1613, -2.79446],
    ]);
    no_longer_than_stops(&short_first, 47.30166619959684, 2e4, 0.5);
    no_longer_than_stops(&short_second, 68.76260577844003, 2e4, 0.05);
    no_longer_than_stops(&short_before_long, 89.07989022357194, 2e4, 0.5);
    no_longer_than_stops(&short_behind_long, 86.34588983776204, 2e4, 0.5);
}

#[test]
fn where_curvature_changes_fast_the_acceleration_is_kept_between_checkpoints() {
    let line = |points: &[[f64; 3]]| {
        points
            .iter()
            .map(|[x, y, z]| Position::xyz(*x, *y, *z))
            .collect::<Vec<_>>()
    };
    let four = line(&[
        [-1.868542171247717, 0.13458967241121642, -1.2530002636361859],
        [-2.4200855668232704, 0.5981654928417159, -1.0687024400117622],
        [-3.2465966217734805, -0.9244053462962334, 2.45104604032659],
        [-2.7771878351400057, -0.36033213174723333, 2.3622686359865437],
    ]);
    let three = line(&[
        [0.2813171894599204, -0.3221931568033377, 0.29894948497531215],
        [-13.39325461713006, -15.79731353079607, -12.399263839458717],
        [-13.793566617284322, -16.06450020890932, -12.417404177581526],
    ]);
    no_longer_than_stops(&four, 16.252960161360193, 1e6, 0.5);
    no_longer_than_stops(&three, 36.277507819810346, 1e6, 0.05);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn rounded_corners_take_no_longer_than_stops(
        steps in prop::collection::vec((prop::array::uniform3(-1.0f64..1.0), prop_oneof![0.05f64..1.0, 1.0f64..20.0]), 2..8),
        flat in any::<bool>(), feed in prop_oneof![2.0f64..20.0, 20.0f64..100.0], jerk in prop_oneof![Just(2e4), Just(1e5), Just(1e6)],
        tolerance in prop_oneof![Just(0.001), Just(0.01), Just(0.05), Just(0.5)],
    ) {
        let mut at = Position::ZERO;
        let points: Vec<_> = steps.iter().map(|(by, scale)| {
            for (axis, by) in by.iter().enumerate() {
                at.0[axis] += if flat && axis == 2 { 0.0 } else { by * scale };
            }
            at
        }).collect();
        no_longer_than_stops(&points, feed, jerk, tolerance);
    }
}
