//! Machines whose joints are not their axes: frames, reach and travel. Places and messages; speeds are tested elsewhere.

use super::settings;
use crate::canon::{Axis, Call, Event, PathMode, Position, Source};
use crate::element::Element;
use crate::kinematics::{
    Elbow, Follows, Hand, JOINTS, Kinematics, LinearDelta, Rotary, RotaryAxis, Scara, TableTable, ToolFrame, Transform,
};
use crate::plan::offline::Recorder;
use crate::plan::{AxisLimits, JointSpace, PlanError, Planner, PlannerKind, Settings};

fn machine(transform: Transform, axes: &[Axis], travel: [f64; 2]) -> Settings {
    let follows: Vec<Follows> = axes
        .iter()
        .map(|&axis| Follows {
            axis: Some(axis),
            offset: 0.0,
        })
        .collect();
    let mut settings = settings();
    let limits = AxisLimits {
        travel,
        ..settings.axes[0].expect("an X axis")
    };
    let kinematics = Kinematics::new(transform, &follows);
    let of_axis = AxisLimits {
        // Axes have a travel of their own only where they are joints.
        travel: if kinematics.is_trivial(&ToolFrame::OFF) {
            travel
        } else {
            [f64::NEG_INFINITY, f64::INFINITY]
        },
        ..limits
    };
    settings.axes = Axis::ALL.map(|axis| axes.contains(&axis).then_some(of_axis));
    settings.joints = Some(JointSpace {
        kinematics,
        limits: [limits; JOINTS],
    });
    settings
}

fn trunnion(travel: [f64; 2]) -> Settings {
    let rotary = |axis| Rotary {
        axis,
        hand: Hand::Right,
        centre_mm: [0.0; 3],
    };
    let table = TableTable {
        primary: rotary(RotaryAxis::A),
        secondary: rotary(RotaryAxis::C),
    };
    machine(
        Transform::TableTable(table),
        &[Axis::X, Axis::Y, Axis::Z, Axis::A, Axis::C],
        travel,
    )
}

fn events(calls: &[Call]) -> impl Iterator<Item = Event> + '_ {
    let feed = Call::SetFeedRate {
        linear: 20.0,
        angular: 20.0,
    };
    (1..)
        .zip([feed].into_iter().chain(calls.iter().cloned()))
        .map(|(line, call)| Event {
            source: Source {
                line,
                ..Source::default()
            },
            call,
        })
}

fn plan(settings: Settings, calls: &[Call]) -> Result<Vec<Element>, PlanError> {
    let mut planner = Planner::new(settings, Recorder::default());
    for event in events(calls) {
        planner.push(&event)?;
        planner.pump();
    }
    planner.finish();
    planner.pump();
    Ok(planner.sink().elements.clone())
}

fn error(settings: Settings, calls: &[Call]) -> String {
    plan(settings, calls).expect_err("an error").to_string()
}

fn feed(values: &[(Axis, f64)]) -> Call {
    let mut to = Position::ZERO;
    for &(axis, value) in values {
        to[axis] = value;
    }
    Call::StraightFeed { to }
}

fn tool(z: f64) -> Call {
    let offset = Position::xyz(0.0, 0.0, z);
    Call::SetToolLengthOffset { offset }
}

#[test]
fn joints_go_on_where_the_axes_begin_to_mean_something_else() {
    use Axis::{A, C, X, Y, Z};
    let settings = trunnion([-1e3, 1e3]);
    // The same story as the interpreter's: Y-10 Z60 at A90 reads Y10 Z10 on the work with the tool of 50.
    let calls = [
        feed(&[(Y, -10.0), (Z, 60.0), (A, 90.0)]),
        tool(50.0),
        Call::SetToolCentrePoint(true),
        feed(&[(X, 5.0), (Y, 10.0), (Z, 10.0), (A, 90.0)]),
        feed(&[(X, 5.0), (Y, 10.0), (Z, 10.0), (A, 30.0), (C, 120.0)]),
        Call::SetToolCentrePoint(false),
        tool(0.0),
        feed(&[(X, 1.0), (A, 30.0), (C, 120.0)]),
    ];
    let elements = plan(settings, &calls).unwrap();
    let kinematics = settings.joints.unwrap().kinematics;
    let mut joints = [0.0; 5];
    let mut last = [0.0; 5];
    let mut frames: Vec<ToolFrame> = Vec::new();
    for element in &elements {
        let Element::Span(span) = element else { continue };
        let frame = *span.piece.frame();
        for (time, is_end) in [(0.0, false), (span.duration_s, true)] {
            let place = span.piece.position(span.place(time));
            kinematics.inverse(&frame, &place.0, &mut joints).unwrap();
            if !is_end {
                let jump = joints.iter().zip(last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(jump < 1e-6, "{joints:?} after {last:?}");
            }
        }
        last = joints;
        if frames.last() != Some(&frame) {
            assert_eq!(span.v0, 0.0);
            frames.push(frame);
        }
    }
    let on = ToolFrame {
        tcp: true,
        length_mm: 50.0,
    };
    assert_eq!(frames, [ToolFrame::OFF, on, ToolFrame::OFF]);
    assert_eq!(last[0], 1.0);
}

#[test]
fn a_turn_of_the_table_may_take_a_linear_joint_beyond_its_travel_between_its_ends() {
    // A tip at X80 goes half a turn about C by Y80, whatever it does at both ends.
    let calls = [
        feed(&[(Axis::X, 80.0)]),
        Call::SetToolCentrePoint(true),
        feed(&[(Axis::X, 80.0), (Axis::C, 180.0)]),
    ];
    let with_y = |high: f64| {
        let mut settings = trunnion([-1e3, 1e3]);
        if let Some(joints) = &mut settings.joints {
            joints.limits[1].travel[1] = high;
        }
        settings
    };
    assert!(plan(with_y(80.0), &calls).is_ok());
    let error = error(with_y(79.999), &calls);
    assert!(error.starts_with("line 4: joint 1 would reach 80.0000"), "{error}");
    assert!(
        error.contains("mm, beyond its travel limit 79.9990, at X80.000 Y0.000 Z0.000 C"),
        "{error}"
    );
}

#[test]
fn without_tool_centre_point_control_the_travel_of_the_axes_counts() {
    let got = error(trunnion([-50.0, 50.0]), &[feed(&[(Axis::C, 51.0)])]);
    assert!(
        got.contains("C would reach 51.0000 degrees in machine coordinates"),
        "{got}"
    );
}

#[test]
fn arms_and_rods_have_their_reach() {
    let arms = Scara {
        inner_arm_mm: 300.0,
        outer_arm_mm: 200.0,
        tool_offset_mm: 0.0,
        elbow: Elbow::Positive,
        shoulder_middle_degrees: 0.0,
    };
    let mut scara = machine(
        Transform::Scara(arms),
        &[Axis::X, Axis::Y, Axis::Z, Axis::C],
        [-170.0, 170.0],
    );
    if let Some(joints) = &mut scara.joints {
        joints.limits[3].travel = [-1e3, 1e3];
    }
    scara.start = Position::xyz(400.0, 0.0, 0.0);
    let got = error(scara, &[feed(&[(Axis::X, 400.0), (Axis::Y, 311.0)])]);
    assert!(
        got.contains("line 2: joint 1 cannot follow: the place is farther away than both arms reach at X400.000"),
        "{got}"
    );
    // Straight through behind the shoulder: the elbow folds as far as it may.
    let got = error(scara, &[feed(&[(Axis::X, -400.0), (Axis::Y, 1.0)])]);
    assert!(got.contains("line 2: joint 1 would reach 17"), "{got}");
    // Round behind, the shoulder meets its limit.
    let got = error(
        scara,
        &[
            feed(&[(Axis::X, 10.0), (Axis::Y, 350.0)]),
            feed(&[(Axis::X, -350.0), (Axis::Y, 0.0)]),
            feed(&[(Axis::X, -10.0), (Axis::Y, -350.0)]),
        ],
    );
    assert!(got.contains("degrees, beyond its travel limit 170.0000"), "{got}");
    assert!(plan(scara, &[feed(&[(Axis::X, 250.0), (Axis::Y, 250.0), (Axis::C, 30.0)])]).is_ok());

    let rods = LinearDelta {
        rod_mm: 250.0,
        radius_mm: 150.0,
        towers: [90.0, -30.0, -150.0].map(LinearDelta::tower),
    };
    let delta = machine(Transform::LinearDelta(rods), &[Axis::X, Axis::Y, Axis::Z], [0.0, 240.0]);
    assert!(plan(delta, &[feed(&[(Axis::Y, 79.0)])]).is_ok());
    let got = error(delta, &[feed(&[(Axis::Y, 81.0)])]);
    assert!(
        got.contains("joint 0 would reach 240.") && got.contains("limit 240.0000"),
        "{got}"
    );
    let got = error(delta, &[feed(&[(Axis::Y, -121.0)])]);
    assert!(
        got.contains("the rod is too short for a place so far from its tower"),
        "{got}"
    );
}

#[test]
fn tool_centre_point_control_needs_kinematics_that_have_it() {
    let got = error(settings(), &[Call::SetToolCentrePoint(true)]);
    assert!(
        got.contains("needs kinematics \"table-table\" or \"head-table\""),
        "{got}"
    );
}

/// Greatest velocity, acceleration and jerk of every joint over its limits, by differences of what drives are told.
fn peaks(settings: &Settings, elements: &[Element]) -> [f64; 3] {
    let joints = settings.joints.as_ref().expect("joints");
    let (count, cycle_s) = (joints.count(), settings.cycle_s);
    let mut samples: Vec<[f64; JOINTS]> = Vec::new();
    let mut before = 0.0;
    for element in elements {
        let Element::Span(span) = element else { continue };
        let mut t = cycle_s - before;
        while t <= span.duration_s {
            let mut at = [0.0; JOINTS];
            let place = span.piece.position(span.place(t).clamp(0.0, span.piece.length()));
            joints
                .kinematics
                .inverse(span.piece.frame(), &place.0, &mut at[..count])
                .expect("a place within reach");
            samples.push(at);
            t += cycle_s;
        }
        before = span.duration_s - (t - cycle_s);
    }
    let mut peaks = [0.0_f64; 3];
    for window in samples.windows(4) {
        for (k, limits) in joints.limits[..count].iter().enumerate() {
            let [q3, q2, q1, q0] = [0, 1, 2, 3].map(|i| window[i][k]);
            let differences = [
                (q0 - q1) / cycle_s / limits.velocity,
                (q0 - 2.0 * q1 + q2) / cycle_s.powi(2) / limits.acceleration,
                (q0 - 3.0 * q1 + 3.0 * q2 - q3) / cycle_s.powi(3) / limits.jerk,
            ];
            for (peak, amount) in peaks.iter_mut().zip(differences) {
                *peak = peak.max(amount.abs());
            }
        }
    }
    peaks
}

#[test]
fn limits_of_joints_hold_while_the_tip_stays_on_a_turning_work() {
    use Axis::{A, C, X, Y, Z};
    let mut settings = trunnion([-1e4, 1e4]);
    settings.planner_kind = PlannerKind::Optimal;
    let round = Call::SetPathMode(PathMode::Continuous {
        tolerance_mm: Some(0.02),
        naive_cam_tolerance_mm: None,
    });
    let fast = Call::SetFeedRate {
        linear: 200.0,
        angular: 200.0,
    };
    let calls = [
        round,
        fast,
        tool(60.0),
        Call::SetToolCentrePoint(true),
        feed(&[(X, 80.0), (Z, 60.0)]),
        // The tip at one place, the table by two turns under it.
        feed(&[(X, 80.0), (Z, 60.0), (C, 720.0)]),
        feed(&[(X, 60.0), (Y, 40.0), (Z, 80.0), (A, 40.0), (C, 600.0)]),
        feed(&[(X, -60.0), (Y, 40.0), (Z, 80.0), (A, -30.0), (C, 700.0)]),
        feed(&[(X, -60.0), (Y, -40.0), (Z, 70.0), (A, 10.0), (C, 500.0)]),
    ];
    let elements = plan(settings, &calls).unwrap();
    let [velocity, acceleration, jerk] = peaks(&settings, &elements);
    assert!(
        velocity <= 1.0 && acceleration <= 1.0 && jerk <= 1.0,
        "{velocity} {acceleration} {jerk}"
    );
    // They are used, too.
    assert!(velocity > 0.9 && acceleration > 0.9, "{velocity} {acceleration} {jerk}");
}
