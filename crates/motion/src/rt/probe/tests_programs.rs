//! Probing moves in whole programs: calls, plan, interpolation, and a program that waits for the result.

use super::*;
use crate::canon::{AXES, Call, Event, ProbeMode, Source};
use crate::element::Element;
use crate::plan::{AxisLimits, Planner, PlannerKind, Settings};
use crate::ring::{self, Producer};
use crate::rt::{Interpolator, SampleState, ScaleRamp};

const CYCLE_S: f64 = 1e-3;
const LIMITS: MotionLimits = MotionLimits {
    velocity: 100.0,
    acceleration: 1000.0,
    jerk: 20_000.0,
};
const STOP: StopLimits = StopLimits {
    acceleration: 2000.0,
    jerk: 80_000.0,
};
/// G54.
const ORIGIN_Z: f64 = -60.0;

struct Rig {
    planner: Planner<Producer<Element>>,
    interpolator: Interpolator,
    results: rtrb::Consumer<Answer>,
    line: u32,
    starved: bool,
}

impl Rig {
    fn new(planner_kind: PlannerKind) -> Rig {
        let mut axes = [None; AXES];
        axes[..3].fill(Some(AxisLimits {
            velocity: LIMITS.velocity,
            acceleration: LIMITS.acceleration,
            jerk: LIMITS.jerk,
            travel: [-200.0, 200.0],
        }));
        let settings = Settings {
            look_ahead_blocks: 100,
            planner_kind,
            ..Settings::new(axes, CYCLE_S)
        };
        let (producer, consumer) = ring::channel(settings.largest_publication());
        let (answers, results) = rtrb::RingBuffer::new(1);
        let ramp = ScaleRamp::new(&[(LIMITS, STOP)], CYCLE_S);
        let shares = StopShares::new([(LIMITS, STOP)].into_iter());
        let mut rig = Rig {
            planner: Planner::new(settings, producer),
            interpolator: Interpolator::new(consumer, Position::ZERO, ramp).with_probe(answers, shares),
            results,
            line: 0,
            starved: false,
        };
        rig.push(&[
            Call::SetG5xOffset {
                system: 1,
                origin: Position::xyz(0.0, 0.0, ORIGIN_Z),
            },
            Call::SetFeedRate {
                linear: 20.0,
                angular: 20.0,
            },
        ]);
        rig
    }

    fn result(&mut self) -> Probed {
        match self.results.pop() {
            Ok(Answer::Probed(probed)) => probed,
            other => panic!("no result: {other:?}"),
        }
    }

    /// Pushes calls and plans them to their end.
    fn push(&mut self, calls: &[Call]) {
        for call in calls {
            self.line += 1;
            let source = Source {
                line: self.line,
                ..Source::default()
            };
            let call = call.clone();
            self.planner.push(&Event { source, call }).unwrap();
        }
        self.planner.finish();
        self.planner.pump();
        assert!(self.planner.is_done());
    }

    /// A cycle against a surface at this height: the commanded height.
    fn cycle(&mut self, scale: f64, surface: f64) -> f64 {
        let at = self.interpolator.position();
        self.interpolator.see_probe(at.0[2] <= surface, &at);
        let sample = self.interpolator.step(scale);
        self.starved = sample.state == SampleState::Starved;
        sample.position.0[2]
    }

    fn run(&mut self, surface: f64) -> Vec<f64> {
        let mut heights = vec![self.interpolator.position().0[2]];
        while heights.len() < 20_000 {
            heights.push(self.cycle(1.0, surface));
            if self.starved && self.interpolator.remaining_s() < 1e-9 {
                return heights;
            }
        }
        panic!("no end");
    }
}

fn probe(to_z: f64, must_trip: bool) -> Call {
    Call::StraightProbe {
        to: Position::xyz(0.0, 0.0, to_z - ORIGIN_Z),
        mode: ProbeMode {
            towards: true,
            must_trip,
        },
    }
}

/// Greatest differences of heights by time: velocity, acceleration, jerk.
fn peaks(heights: &[f64]) -> [f64; 3] {
    let mut peaks = [0.0_f64; 3];
    for window in heights.windows(4) {
        let [a, b, c, d] = [window[0], window[1], window[2], window[3]];
        let differences = [d - c, d - 2.0 * c + b, d - 3.0 * c + 3.0 * b - a];
        let mut power = 1.0;
        for (peak, difference) in peaks.iter_mut().zip(differences) {
            power *= CYCLE_S;
            *peak = peak.max((difference / power).abs());
        }
    }
    peaks
}

#[test]
fn a_program_goes_on_from_where_the_probe_came_to_rest() {
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        let mut rig = Rig::new(planner_kind);
        let down = Call::StraightTraverse {
            to: Position::xyz(0.0, 0.0, -10.0 - ORIGIN_Z),
        };
        rig.push(&[down, probe(-90.0, true)]);
        let mut heights = rig.run(-40.0);
        let result = rig.result();
        assert_eq!(result.end, ProbeEnd::Tripped);
        // 20 mm/s: seen within the way of one cycle; v^1.5/J^0.5 = 0.32 mm to rest.
        let at = result.at.0[2];
        assert!(at <= -40.0 && at > -40.02, "{planner_kind:?}: {at}");
        assert!(
            result.rest.0[2] < at && result.rest.0[2] > at - 0.34,
            "{planner_kind:?}: {result:?}"
        );
        assert_eq!(heights.last(), Some(&result.rest.0[2]));
        let work = rig.planner.to_work(&result.at).0[2];
        assert!((work - (at - ORIGIN_Z)).abs() < 1e-12);

        rig.planner.probed(result.rest);
        rig.push(&[Call::StraightTraverse {
            to: Position::xyz(0.0, 0.0, 5.0 - ORIGIN_Z),
        }]);
        heights.extend(rig.run(-40.0));
        assert!((heights[heights.len() - 1] - 5.0).abs() < 1e-12, "{planner_kind:?}");
        assert!(rig.results.pop().is_err(), "one result for one move");
        let [v, a, j] = peaks(&heights);
        assert!(v <= 100.0 * (1.0 + 1e-6), "{planner_kind:?}: {v}");
        assert!(
            a <= STOP.acceleration * (1.0 + 1e-6) && j <= STOP.jerk * (1.0 + 1e-6),
            "{planner_kind:?}: {a} {j}"
        );
    }
}

#[test]
fn without_contact_the_whole_way_is_gone_and_told() {
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        let mut rig = Rig::new(planner_kind);
        rig.push(&[probe(-30.0, false)]);
        let heights = rig.run(-99.0);
        let result = rig.result();
        assert_eq!((result.end, result.rest.0[2]), (ProbeEnd::Missed, -30.0));
        assert_eq!(heights.last(), Some(&-30.0));
    }
}

#[test]
fn a_hold_rests_on_the_way_and_the_contact_counts_meanwhile() {
    let mut rig = Rig::new(PlannerKind::Optimal);
    rig.push(&[probe(-90.0, true)]);
    for _ in 0..1000 {
        rig.cycle(1.0, -40.0);
    }
    assert!(rig.interpolator.is_probing() && !rig.interpolator.is_at_rest());
    let mut held = 0.0;
    for _ in 0..500 {
        held = rig.cycle(0.0, -40.0);
    }
    assert!(rig.interpolator.is_at_rest() && held < -15.0 && held > -40.0, "{held}");
    assert!(rig.results.pop().is_err());
    assert_eq!(rig.cycle(0.0, -40.0), held);
    rig.run(-40.0);
    assert_eq!(rig.result().end, ProbeEnd::Tripped);
}

#[test]
fn a_hold_keeps_a_probing_move_from_beginning() {
    let mut rig = Rig::new(PlannerKind::Optimal);
    rig.push(&[probe(-90.0, true)]);
    for _ in 0..100 {
        assert_eq!(rig.cycle(0.0, 99.0), 0.0);
    }
    assert!(rig.interpolator.is_at_rest() && rig.results.pop().is_err());
    rig.cycle(1.0, 99.0);
    assert_eq!(rig.result().end, ProbeEnd::Already);
}
