//! Random programs, random look-ahead, random consumers.

use super::*;
use crate::canon::{Axis, SpindleDirection};
use crate::element::Element;
use crate::plan::offline::sample;
use crate::ring::{Publish, Sink};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// A random step of a program, relative to where the program is.
#[derive(Clone, Debug)]
pub(super) enum Step {
    Line {
        by: [f64; 3],
        scale: f64,
        turn_a: f64,
        rapid: bool,
    },
    Arc {
        plane: Plane,
        radius: f64,
        from: f64,
        sweep: f64,
        turns: i32,
        rise: f64,
        spiral: f64,
    },
    Dense {
        radius: f64,
        chord: f64,
        count: u32,
        heading: f64,
    },
    /// The end is told again, or nearly: in X, Y, Z and A.
    Again {
        by: [f64; 4],
        rapid: bool,
    },
    Feed(f64),
    Mode(u8),
    Rest(u8),
}

/// What computing leaves beside a number: of either sign, all orders of magnitude alike; or nothing.
pub(super) fn residue() -> impl Strategy<Value = f64> {
    let beside = |sign: f64| (-17.0..-3.0_f64).prop_map(move |order| sign * libm::pow(10.0, order));
    prop_oneof![2 => Just(0.0), 1 => beside(1.0), 1 => beside(-1.0), 1 => Just(1e-8), 1 => Just(1.1e-8)]
}

pub(super) fn step() -> impl Strategy<Value = Step> {
    let scale = prop_oneof![Just(0.02), Just(0.3), Just(5.0), Just(30.0)];
    let direction = prop_oneof![
        3 => prop::array::uniform3(-1.0f64..1.0),
        1 => prop::array::uniform3(-1i8..2).prop_map(|d| d.map(f64::from)),
    ];
    let turn = prop_oneof![4 => Just(0.0), 1 => -20.0f64..20.0];
    prop_oneof![
        6 => (direction, scale, turn, prop::bool::weighted(0.15))
            .prop_map(|(by, scale, turn_a, rapid)| Step::Line { by, scale, turn_a, rapid }),
        3 => (
            prop_oneof![Just(Plane::Xy), Just(Plane::Zx), Just(Plane::Yz)],
            prop_oneof![0.05f64..1.0, 1.0f64..20.0],
            0.0..TAU,
            0.01..TAU,
            prop_oneof![Just(1), Just(-1), Just(2), Just(-2)],
            prop_oneof![Just(0.0), -3.0f64..3.0],
            prop_oneof![3 => Just(0.0), 1 => -0.002f64..0.002],
        )
            .prop_map(|(plane, radius, from, sweep, turns, rise, spiral)| Step::Arc {
                plane, radius, from, sweep, turns, rise, spiral
            }),
        2 => (2.0f64..40.0, 0.02f64..0.5, 3u32..60, 0.0..TAU)
            .prop_map(|(radius, chord, count, heading)| Step::Dense { radius, chord, count, heading }),
        2 => (prop::array::uniform4(residue()), prop::bool::weighted(0.2)).prop_map(|(by, rapid)| Step::Again { by, rapid }),
        1 => (0.5f64..150.0).prop_map(Step::Feed),
        1 => (0u8..5).prop_map(Step::Mode),
        1 => (0u8..4).prop_map(Step::Rest),
    ]
}

/// A step that is short against the tolerance, mostly forward, while A turns.
fn short_step() -> impl Strategy<Value = Step> {
    let scale = prop_oneof![3 => Just(0.02), 2 => Just(0.1), 1 => Just(0.3), 1 => Just(5.0)];
    let turn = prop_oneof![Just(0.0), -0.5f64..0.5, -20.0f64..20.0];
    let line = (prop::array::uniform3(-0.2f64..1.0), scale, turn).prop_map(|(by, scale, turn_a)| Step::Line {
        by,
        scale,
        turn_a,
        rapid: false,
    });
    prop_oneof![9 => line, 1 => Just(Step::Mode(1)), 1 => Just(Step::Mode(2))]
}

/// The calls of a program. With `exact`, corners are never rounded.
pub(super) fn program(steps: &[Step], exact: bool) -> Vec<Event> {
    let mut at = Position::ZERO;
    let mut calls = vec![
        F,
        if exact {
            Call::SetPathMode(PathMode::ExactPath)
        } else {
            ROUND
        },
    ];
    for step in steps {
        match *step {
            Step::Line {
                by,
                scale,
                turn_a,
                rapid,
            } => {
                for (at, by) in at.0.iter_mut().zip(by) {
                    *at = (*at + by * scale).clamp(-400.0, 400.0);
                }
                at.0[3] += turn_a;
                calls.push(if rapid {
                    Call::StraightTraverse { to: at }
                } else {
                    Call::StraightFeed { to: at }
                });
            }
            Step::Arc {
                plane,
                radius,
                from,
                sweep,
                turns,
                rise,
                spiral,
            } => {
                let [first, second, normal] = plane.axes();
                let centre_mm = [at[first] - radius * from.cos(), at[second] - radius * from.sin()];
                let until = if turns > 0 { from + sweep } else { from - sweep };
                let radius = radius * (1.0 + spiral);
                at[first] = centre_mm[0] + radius * until.cos();
                at[second] = centre_mm[1] + radius * until.sin();
                at[normal] += rise;
                calls.push(Call::ArcFeed {
                    to: at,
                    plane,
                    centre_mm,
                    turns,
                });
            }
            Step::Dense {
                radius,
                chord,
                count,
                heading,
            } => {
                let (x, y) = (
                    at[Axis::X] - radius * heading.cos(),
                    at[Axis::Y] - radius * heading.sin(),
                );
                for k in 1..=count {
                    let angle = heading + f64::from(k) * chord / radius;
                    // As programs are written: five decimals.
                    at[Axis::X] = ((x + radius * angle.cos()) * 1e5).round() / 1e5;
                    at[Axis::Y] = ((y + radius * angle.sin()) * 1e5).round() / 1e5;
                    calls.push(Call::StraightFeed { to: at });
                }
            }
            Step::Again { by, rapid } => {
                for (at, by) in at.0.iter_mut().zip(by) {
                    *at += by;
                }
                calls.push(if rapid {
                    Call::StraightTraverse { to: at }
                } else {
                    Call::StraightFeed { to: at }
                });
            }
            Step::Feed(per_second) => calls.push(Call::SetFeedRate {
                linear: per_second,
                angular: per_second,
            }),
            Step::Mode(mode) => calls.push(Call::SetPathMode(match mode {
                0 => PathMode::ExactStop,
                1 if !exact => PathMode::Continuous {
                    tolerance_mm: None,
                    naive_cam_tolerance_mm: None,
                },
                2 | 3 if !exact => PathMode::Continuous {
                    tolerance_mm: Some(0.01),
                    naive_cam_tolerance_mm: None,
                },
                _ => PathMode::ExactPath,
            })),
            Step::Rest(0) => calls.push(Call::Dwell { seconds: 0.0123 }),
            Step::Rest(1) => calls.push(Call::StartSpindle {
                spindle: 0,
                direction: SpindleDirection::Clockwise,
                wait_for_speed: true,
            }),
            Step::Rest(2) => calls.push(Call::SetSpindleSpeed {
                spindle: 0,
                speed: 1000.0,
            }),
            Step::Rest(_) => calls.push(Call::Message("now".into())),
        }
    }
    events(calls)
}

/// Asserts that what one element ends with is what the next begins with, and that all ends at rest; returns the end.
fn continuous(elements: &[Element]) {
    let (mut q, mut v, mut a) = (None::<[f64; AXES]>, 0.0, 0.0);
    for element in elements {
        match element {
            Element::Span(span) => {
                let begin = span.piece.position(span.s0).0;
                if let Some(q) = q {
                    assert!(
                        distance(&q, &begin) < 1e-9,
                        "position jumps by {}",
                        distance(&q, &begin)
                    );
                }
                assert!((span.v0 - v).abs() < 1e-7, "speed jumps from {v} to {}", span.v0);
                assert!((span.a0 - a).abs() < 1e-4, "acceleration jumps from {a} to {}", span.a0);
                let t = span.duration_s;
                assert!(t > 0.0 && span.place(t) <= span.piece.length() + 1e-9);
                q = Some(span.piece.position(span.place(t)).0);
                (v, a) = (span.speed(t), span.a0 + t * span.jerk);
            }
            Element::Synced(_) | Element::Probing(_) | Element::Dwell { .. } | Element::Action { .. } => {
                assert!(v.abs() < 1e-7 && a.abs() < 1e-4, "no rest: {v} {a}");
                (v, a) = (0.0, 0.0);
            }
        }
    }
    assert!(v.abs() < 1e-7 && a.abs() < 1e-4, "no rest at the end: {v} {a}");
}

/// A consumer that follows a script: takes a publication, is full, or has run into the tail.
#[derive(Debug)]
struct Scripted {
    script: Vec<u8>,
    at: usize,
    ran: Vec<Element>,
    tail: Vec<Element>,
    largest: usize,
}

impl Sink<Element> for Scripted {
    fn free(&self) -> usize {
        usize::MAX
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        assert!((1..=self.largest).contains(&(committed.len() + tail.len())));
        self.at += 1;
        match self.script[self.at % self.script.len()] {
            0 if self.at.is_multiple_of(2) => Publish::Full,
            1 if !self.tail.is_empty() => {
                self.ran.append(&mut self.tail);
                Publish::TailTaken
            }
            _ => {
                self.ran.extend_from_slice(committed);
                self.tail = tail.to_vec();
                continuous(&[&self.ran[..], tail].concat());
                Publish::Done
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn limits_and_tolerance_hold(steps in prop::collection::vec(step(), 1..25), window in 1usize..51) {
        let plan = proven(&program(&steps, false), Settings { look_ahead_blocks: window, ..settings() }, 0.05);
        prop_assert!(plan.motion_time_s.is_finite());
    }

    #[test]
    fn short_moves_with_a_turning_axis_keep_the_limits(steps in prop::collection::vec(short_step(), 1..25)) {
        proven(&program(&steps, false), settings(), 0.05);
    }

    #[test]
    fn exact_path_is_exact(steps in prop::collection::vec(step(), 1..15), window in 1usize..51) {
        proven(&program(&steps, true), Settings { look_ahead_blocks: window, ..settings() }, 0.0);
    }

    #[test]
    fn every_publication_goes_on_from_the_last_and_ends_at_rest(
        steps in prop::collection::vec(step(), 1..20), window in 1usize..51,
        script in prop::collection::vec(0u8..6, 1..40),
    ) {
        let settings = Settings { look_ahead_blocks: window, ..settings() };
        let sink = Scripted { script, at: 0, ran: Vec::new(), tail: Vec::new(), largest: settings.largest_publication() };
        let mut planner = Planner::new(settings, sink);
        for event in &program(&steps, false) {
            planner.push(event).unwrap();
            planner.pump();
        }
        planner.finish();
        let mut pumps = 0;
        while planner.pump() != Pumped::Done {
            pumps += 1;
            prop_assert!(pumps < 10_000);
        }
        prop_assert!(planner.is_done());
        let ideal: Vec<_> = planner.ideal_path().collect();
        let ran = std::mem::take(&mut planner.sink().ran);
        continuous(&ran);
        let samples = sample(&ran, settings.start, settings.cycle_s);
        prop_assert_eq!(check(&samples, settings.cycle_s, &settings.axes).over(), 0);
        if let (Some(last), Some(end)) = (ideal.last(), samples.last()) {
            prop_assert!(distance(&last.piece.position(last.piece.length()).0, &end.0) < 1e-12);
        }
    }

    #[test]
    fn equal_programs_give_equal_bits(steps in prop::collection::vec(step(), 1..15)) {
        let events = program(&steps, false);
        let bits = || {
            let plan = plan_offline(&events, settings()).unwrap();
            plan.samples.iter().flat_map(|q| q.0.map(f64::to_bits)).collect::<Vec<_>>()
        };
        prop_assert_eq!(bits(), bits());
    }
}

#[test]
fn a_blend_that_nearly_turns_back_between_arcs_keeps_the_limits() {
    let arc = |radius, from, sweep, turns, spiral| Step::Arc {
        plane: Plane::Zx,
        radius,
        from,
        sweep,
        turns,
        rise: 0.0,
        spiral,
    };
    let line = |by| Step::Line {
        by,
        scale: 0.02,
        turn_a: 0.0,
        rapid: false,
    };
    let steps = [
        line([0.0, -0.2046080279796792, 0.489650958227066]),
        line([0.0, 0.0, 0.15827170141563338]),
        Step::Mode(1),
        arc(
            11.24247676698559,
            3.5553477543657745,
            5.466553100580763,
            -2,
            0.0012908694371140397,
        ),
        arc(0.6587356242541359, 1.386227281885698, 4.483746114061658, -1, 0.0),
    ];
    proven(
        &program(&steps, false),
        Settings {
            look_ahead_blocks: 2,
            ..settings()
        },
        0.05,
    );
}

/// Lines in the tolerance of 0.05 mm, of which the last turns A.
fn short_lines<const N: usize>(lines: [([f64; 3], f64, f64); N]) {
    let line = |(by, scale, turn_a)| Step::Line {
        by,
        scale,
        turn_a,
        rapid: false,
    };
    let steps: Vec<_> = [Step::Mode(1)].into_iter().chain(lines.map(line)).collect();
    let settings = Settings {
        look_ahead_blocks: 1,
        ..settings()
    };
    proven(&program(&steps, false), settings, 0.05);
}

#[test]
fn a_short_line_before_a_turning_axis_keeps_the_jerk_limit() {
    short_lines([
        ([0.0, 0.8295, 0.0], 0.02, 0.0),
        ([0.0, 0.9990, 0.0729], 0.02, 0.0),
        ([0.0, 0.2321, -0.3398], 5.0, -14.7459),
    ]);
}

#[test]
fn a_corner_where_only_a_turning_axis_goes_on_keeps_the_jerk_limit() {
    short_lines([
        ([0.0, 0.3211312821316481, 0.0], 0.02, 0.0),
        ([0.0, 0.9976468274054657, 0.7797114880667849], 0.02, 0.31176681181003957),
    ]);
}
