//! Smoothing near the limits of the travel: what is run stays inside, whatever the tolerance.

use super::random::{Step, program, step};
use super::*;
use crate::canon::Axis;
use crate::kinematics::{Elbow, Follows, JOINTS, Kinematics, Scara, ToolFrame, Transform};
use crate::path::NO_MOVE;
use crate::plan::smooth::round::nearest;
use proptest::prelude::*;

const PLANNERS: [PlannerKind; 2] = [PlannerKind::Optimal, PlannerKind::Classic];
/// What a sample may be beyond the travel by rounding, mm or degrees.
const ROUNDING: f64 = 1e-9;

fn within(tolerance_mm: f64) -> Call {
    Call::SetPathMode(PathMode::Continuous {
        tolerance_mm: Some(tolerance_mm),
        naive_cam_tolerance_mm: None,
    })
}

/// Settings with this travel of the first axes.
fn with_travel(planner_kind: PlannerKind, travel: &[[f64; 2]]) -> Settings {
    let mut settings = Settings {
        planner_kind,
        ..settings()
    };
    for (limits, travel) in settings.axes.iter_mut().flatten().zip(travel) {
        limits.travel = *travel;
    }
    settings
}

/// Least and greatest position of an axis.
fn extremes<'p>(positions: impl IntoIterator<Item = &'p Position>, axis: usize) -> [f64; 2] {
    let each = positions.into_iter().map(|q| q.0[axis]);
    each.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], q| {
        [low.min(q), high.max(q)]
    })
}

/// Chords of an arc about the origin from `-until` to `until`, degrees; the middle of one of them is at 0.
fn chords(radius: f64, step: f64, until: f64) -> Vec<Position> {
    let count = (until / step).floor();
    (0..=2 * count as u32 + 1)
        .map(|k| (step * (f64::from(k) - count - 0.5)).to_radians().sin_cos())
        .map(|(sin, cos)| Position::xyz(radius * cos, radius * sin, 0.0))
        .collect()
}

fn along(points: &[Position], tolerance_mm: f64) -> Vec<Event> {
    let lines = points.iter().map(|to| Call::StraightFeed { to: *to });
    events([F, within(tolerance_mm)].into_iter().chain(lines))
}

#[test]
fn chords_of_an_arc_whose_ends_touch_the_limit_stay_inside() {
    // 4 degrees at 50 mm: a curve through their ends rises by 0.03 mm above them.
    for (step, tolerance) in [(4.0, 0.05), (4.0, 0.5), (1.0, 0.05), (0.2, 0.01)] {
        let points = chords(50.0, step, 60.0);
        let calls = along(&points, tolerance);
        let high = extremes(&points, 0)[1];
        for planner_kind in PLANNERS {
            let run = |high: f64| proven(&calls, with_travel(planner_kind, &[[-60.0, high]]), tolerance);
            let (near, far) = (run(high), run(60.0));
            let reached = extremes(&near.samples, 0)[1];
            assert!(
                reached <= high + ROUNDING,
                "{planner_kind:?} {step}: {reached} of {high}"
            );
            // Not at the cost of creeping.
            let ratio = near.motion_time_s / far.motion_time_s;
            assert!(ratio < 1.1, "{planner_kind:?} {step} {tolerance}: {ratio}");
            assert!(step < 4.0 || extremes(&far.samples, 0)[1] > high + 0.03);
        }
    }
}

#[test]
fn an_arc_between_tangent_lines_that_touches_the_limit_stays_inside() {
    // The optimal planner lets the path sway to both sides of lines and arcs.
    let arc = |x: f64, y: f64| Call::ArcFeed {
        to: Position::xyz(x, y, 0.0),
        plane: Plane::Xy,
        centre_mm: [30.0, 5.0],
        turns: 1,
    };
    let calls = events([
        F,
        within(0.05),
        feed(30.0, 0.0, 0.0),
        arc(30.0, 10.0),
        feed(0.0, 10.0, 0.0),
    ]);
    for planner_kind in PLANNERS {
        let run = |travel: &[[f64; 2]]| proven(&calls, with_travel(planner_kind, travel), 0.05);
        let near = run(&[[0.0, 35.0], [0.0, 10.0]]);
        for (axis, travel) in [[0.0, 35.0], [0.0, 10.0]].into_iter().enumerate() {
            let [low, high] = extremes(&near.samples, axis);
            assert!(
                low >= travel[0] - ROUNDING && high <= travel[1] + ROUNDING,
                "{planner_kind:?} {axis}: {low} {high}"
            );
        }
        let far = run(&[[-1.0, 36.0], [-1.0, 11.0]]);
        let ratio = near.motion_time_s / far.motion_time_s;
        assert!(ratio < 1.25, "{planner_kind:?}: {ratio}");
    }
}

#[test]
fn the_elbow_of_a_scara_stays_inside_its_travel() {
    let arms = Scara {
        inner_arm_mm: 300.0,
        outer_arm_mm: 200.0,
        tool_offset_mm: 0.0,
        elbow: Elbow::Positive,
        shoulder_middle_degrees: 0.0,
    };
    let follows = [Axis::X, Axis::Y, Axis::Z].map(|axis| Follows {
        axis: Some(axis),
        offset: 0.0,
    });
    let kinematics = Kinematics::new(Transform::Scara(arms), &follows);
    // The ends of the chords are where the elbow is bent by two degrees.
    let radius = (300.0f64.powi(2) + 200.0f64.powi(2) + 2.0 * 300.0 * 200.0 * 2.0f64.to_radians().cos()).sqrt();
    for (step, tolerance) in [(1.0, 0.05), (0.1, 0.05)] {
        let points = chords(radius, step, 20.0);
        let mut settings = with_travel(PlannerKind::Optimal, &[[f64::NEG_INFINITY, f64::INFINITY]; 2]);
        settings.start = points[0];
        let limits = |travel| AxisLimits {
            travel,
            ..settings.axes[0].expect("an X axis")
        };
        let mut joints = [limits([-170.0, 170.0]); JOINTS];
        joints[1] = limits([2.0, 150.0]);
        settings.joints = Some(JointSpace {
            kinematics,
            limits: joints,
        });
        let plan = plan_offline(&along(&points[1..], tolerance), settings).unwrap();
        let mut least = f64::INFINITY;
        for sample in &plan.samples {
            let mut at = [0.0; 3];
            kinematics.inverse(&ToolFrame::OFF, &sample.0, &mut at).unwrap();
            least = least.min(at[1]);
        }
        assert!(least >= 2.0 - ROUNDING, "{step}: {least}");
        let found = deviation(&plan.samples, &plan.ideal, tolerance);
        assert!(found.off_mm <= tolerance, "{found:?}");
    }
}

/// A program of these steps within one tolerance.
fn calls(steps: &[Step], tolerance_mm: f64) -> Vec<Event> {
    let mut events = program(steps, false);
    for event in &mut events {
        if let Call::SetPathMode(PathMode::Continuous { .. }) = event.call {
            event.call = within(tolerance_mm);
        }
    }
    events
}

/// How far a place is from the nearest one of a path; as soon as it is within the tolerance, that is enough.
fn off_path(place: &Position, path: &[Programmed], tolerance: f64) -> f64 {
    let mut least = distance(&place.0, &[0.0; AXES]);
    for part in path {
        let piece = &part.piece;
        for guess in [0.5, 0.1, 0.9, 0.3, 0.7] {
            let (off, _) = nearest(piece, &place.0, 0.0, piece.length(), guess * piece.length());
            least = least.min(off);
            if least <= tolerance {
                return least;
            }
        }
    }
    least
}

/// Random programs with limits of the travel that their programmed path touches or nearly so.
fn stays_inside(steps: &[Step], tolerance: f64, room: &[[f64; 2]; 4]) {
    let calls = calls(steps, tolerance);
    for planner_kind in PLANNERS {
        let wide = with_travel(planner_kind, &[[-1e4, 1e4], [-1e4, 1e4], [-1e4, 1e4], [-1e5, 1e5]]);
        let mut planner = Planner::new(wide, offline::Recorder::default());
        let mut travel = [[0.0f64; 2]; 4];
        for event in &calls {
            planner.push(event).unwrap();
            planner.pump();
        }
        for part in planner.ideal_path() {
            for (axis, travel) in travel.iter_mut().enumerate() {
                let (low, high) = super::super::travel::reach(&part.piece, axis);
                *travel = [travel[0].min(low), travel[1].max(high)];
            }
        }
        for (travel, room) in travel.iter_mut().zip(room) {
            *travel = [
                travel[0] - 2.0 * tolerance * room[0],
                travel[1] + 2.0 * tolerance * room[1],
            ];
        }
        let plan = plan_offline(&calls, with_travel(planner_kind, &travel)).unwrap();
        for sample in &plan.samples {
            let off = off_path(sample, &plan.ideal, tolerance);
            assert!(off <= tolerance + ROUNDING, "{planner_kind:?}: {off} off at {sample:?}");
        }
        for (axis, travel) in travel.iter().enumerate() {
            let [low, high] = extremes(&plan.samples, axis);
            // What is no move is no part of the path, but driven to all the same.
            let room = ROUNDING + NO_MOVE;
            assert!(
                low >= travel[0] - room && high <= travel[1] + room,
                "{planner_kind:?}, axis {axis}: {low} to {high} of {travel:?}"
            );
        }
    }
}

/// Arcs of about the tolerance, of which a rounded corner takes several radians.
#[test]
fn a_corner_of_tiny_arcs_stays_within_the_tolerance_between_the_places_where_it_is_measured() {
    type Arc = (Plane, f64, f64, f64, i32, f64, f64);
    let programs: [(f64, [Arc; 2]); 2] = [
        (
            0.05,
            [
                (
                    Plane::Yz,
                    0.07613880426217498,
                    1.5164754514287946,
                    3.2662684406234255,
                    2,
                    0.0,
                    0.0,
                ),
                (
                    Plane::Yz,
                    0.507220990518616,
                    0.86754254020375,
                    1.8991745889427007,
                    -2,
                    -0.6497475694243436,
                    -0.0018993608768797026,
                ),
            ],
        ),
        (
            0.1561562027037163,
            [
                (
                    Plane::Zx,
                    0.2573988267437507,
                    3.2228243229603164,
                    3.424627677766162,
                    2,
                    0.0,
                    0.0,
                ),
                (
                    Plane::Xy,
                    0.6967542381630153,
                    4.653162400888209,
                    3.2883033290024475,
                    1,
                    0.0,
                    0.0,
                ),
            ],
        ),
    ];
    for (tolerance, arcs) in programs {
        let steps = arcs.map(|(plane, radius, from, sweep, turns, rise, spiral)| Step::Arc {
            plane,
            radius,
            from,
            sweep,
            turns,
            rise,
            spiral,
        });
        stays_inside(&steps, tolerance, &[[1.0; 2]; 4]);
    }
}

/// How much farther away than the path the limits are, in parts of twice the tolerance.
fn room() -> impl Strategy<Value = [[f64; 2]; 4]> {
    prop::array::uniform4(prop::array::uniform2(prop_oneof![Just(0.0), 0.0f64..1.0]))
}

fn tolerance() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.001), Just(0.01), Just(0.05), 0.001f64..0.5]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_program_stays_inside_the_travel(
        steps in prop::collection::vec(step(), 1..20), tolerance in tolerance(), room in room(),
    ) {
        stays_inside(&steps, tolerance, &room);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// `cargo test --release -p isocnc-motion any_of_3000 -- --ignored`
    #[test]
    #[ignore = "takes minutes"]
    fn any_of_3000_programs_stays_inside_the_travel(
        steps in prop::collection::vec(step(), 1..30), tolerance in tolerance(), room in room(),
    ) {
        stays_inside(&steps, tolerance, &room);
    }
}
