//! Moves of micrometres: what they take in time, and that nothing of the path is lost.

use super::*;

const PLANNERS: [PlannerKind; 2] = [PlannerKind::Optimal, PlannerKind::Classic];
const P: f64 = 0.01;

/// As G64 with P alone tells it.
fn round(tolerance_mm: f64) -> Call {
    Call::SetPathMode(PathMode::Continuous {
        tolerance_mm: Some(tolerance_mm),
        naive_cam_tolerance_mm: Some(tolerance_mm),
    })
}

fn plan(planner_kind: PlannerKind, mode: Call, moves: &[Call]) -> Offline {
    let settings = Settings {
        planner_kind,
        look_ahead_blocks: 10_000,
        ..settings()
    };
    let tolerance = match mode {
        Call::SetPathMode(PathMode::Continuous { .. }) => P,
        _ => 0.0,
    };
    let calls: Vec<Call> = [F, mode].into_iter().chain(moves.iter().cloned()).collect();
    proven(&events(calls), settings, tolerance)
}

/// Steps of so much along X and Y in turn, as far as X `until`.
fn stairs(step: f64, until: f64) -> Vec<Call> {
    let count = (until / step).round() as u32;
    (0..count)
        .flat_map(|k| [(k + 1, k), (k + 1, k + 1)])
        .map(|(x, y)| feed(step * f64::from(x), step * f64::from(y), 0.0))
        .collect()
}

#[test]
fn stairs_within_the_tolerance_are_run_as_the_line_that_they_are() {
    for planner_kind in PLANNERS {
        let line = plan(planner_kind, round(P), &[feed(5.3, 5.3, 0.0)]).motion_time_s;
        for step in [0.001, 0.002, 0.005] {
            let time = plan(planner_kind, round(P), &stairs(step, 5.3)).motion_time_s;
            assert!(time < 1.15 * line, "{planner_kind:?} {step}: {time} s, a line {line} s");
        }
    }
}

#[test]
fn a_tip_among_tiny_steps_is_not_cut_off() {
    // Out by 0.03 mm and back, in steps of 0.005 mm; and back along the way itself.
    for tip in [[1.0, 1.03], [0.97, 0.97]] {
        let mut moves = stairs(0.005, 1.0);
        let leg = |from: [f64; 2], to: [f64; 2]| {
            (1..=6).map(move |k| {
                let part = f64::from(k) / 6.0;
                let at = [0, 1].map(|i| from[i] + part * (to[i] - from[i]));
                feed(at[0], at[1], 0.0)
            })
        };
        moves.extend(leg([1.0; 2], tip));
        moves.extend(leg(tip, [1.0; 2]));
        moves.extend(stairs(0.005, 2.0).split_off(400));
        for planner_kind in PLANNERS {
            let plan = plan(planner_kind, round(P), &moves);
            // Among the samples behind the place from which it goes to the tip.
            let off = |q: &Position, [x, y]: [f64; 2]| libm::hypot(q.0[0] - x, q.0[1] - y);
            let begins = plan.samples.iter().position(|q| off(q, [1.0; 2]) <= P).unwrap();
            let least = plan.samples[begins..]
                .iter()
                .map(|q| off(q, tip))
                .fold(f64::INFINITY, f64::min);
            assert!(least <= P, "{planner_kind:?}: {least} mm from the tip {tip:?}");
        }
    }
}

#[test]
fn a_tiny_arc_between_tangent_lines_is_passed_like_the_corner_that_it_is() {
    for degrees in [5.0f64, 90.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let lines = [feed(20.0, 0.0, 0.0), feed(20.0 + 20.0 * cos, 20.0 * sin, 0.0)];
        for radius in [0.001, 0.002] {
            let (x, y) = (20.0 + radius * sin, radius * (1.0 - cos));
            let arc = Call::ArcFeed {
                to: Position::xyz(x, y, 0.0),
                plane: Plane::Xy,
                centre_mm: [20.0, radius],
                turns: 1,
            };
            let with = [lines[0].clone(), arc, feed(x + 20.0 * cos, y + 20.0 * sin, 0.0)];
            for planner_kind in PLANNERS {
                let [time, corner] =
                    [&with[..], &lines[..]].map(|moves| plan(planner_kind, round(P), moves).motion_time_s);
                assert!(
                    time < 1.02 * corner,
                    "{planner_kind:?} {degrees} {radius}: {time} s, the corner {corner} s"
                );
            }
        }
    }
}

#[test]
fn exact_blocks_of_micrometres_are_run_at_full_speed() {
    for planner_kind in PLANNERS {
        let line = plan(
            planner_kind,
            Call::SetPathMode(PathMode::ExactPath),
            &[feed(20.0, 0.0, 0.0)],
        )
        .motion_time_s;
        for block in [0.001f64, 0.002, 0.004, 0.008] {
            let count = (20.0 / block).round() as u32;
            let blocks: Vec<Call> = (1..=count).map(|k| feed(block * f64::from(k), 0.0, 0.0)).collect();
            let time = plan(planner_kind, Call::SetPathMode(PathMode::ExactPath), &blocks).motion_time_s;
            assert!(
                time < 1.02 * line,
                "{planner_kind:?} {block}: {time} s, a line {line} s"
            );
        }
    }
}

#[test]
fn the_rounding_of_numbers_is_no_corner_of_an_exact_path() {
    // As a turned work coordinate system makes them.
    let rounded = |x: f64| (x * 1e9).round() / 1e9;
    let blocks: Vec<Call> = (1..=400)
        .map(f64::from)
        .map(|s| feed(rounded(0.0808123456789 * s), rounded(0.0599412345678 * s), 0.0))
        .collect();
    for planner_kind in PLANNERS {
        let exact = Call::SetPathMode(PathMode::ExactPath);
        let time = plan(planner_kind, exact.clone(), &blocks).motion_time_s;
        let line = plan(planner_kind, exact, &blocks[399..]).motion_time_s;
        assert!(time < 1.02 * line, "{planner_kind:?}: {time} s, a line {line} s");
    }
}
